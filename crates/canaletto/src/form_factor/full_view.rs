//! Whether two polygons see each other in full: nothing lies between them.

use super::polygon::{area_vector, clip_to_front};
use glam::DVec3;

/// The share of the extent by which points may lie beyond a plane. It is far more than rounding and far less than any
/// error of a form factor that is reported.
const SLACK: f64 = 1e-12;

/// Whether no convex body of this list reaches into the convex hull of two polygons. Each body is the hull of its
/// points. The polygons' own parts behind each other count for nothing. Bodies that only touch the hull don't reach
/// into it. False in doubt.
///
/// The hull is bounded by planes through the polygons and through an edge of one and a corner of the other (Haines and
/// Wallace, *Shaft Culling for Efficient Ray-Traced Radiosity*, 1994). A body is outside if it lies beyond one of them.
pub(super) fn is_full_view(a: &[DVec3], b: &[DVec3], bodies: &[Vec<DVec3>]) -> bool {
    let (front_a, front_b) = (clip_to_front(a, b[0], area_vector(b)), clip_to_front(b, a[0], area_vector(a)));
    if front_a.len() < 3 || front_b.len() < 3 {
        return true;
    }
    let extent = front_a.iter().chain(&front_b).fold(0.0, |extent: f64, p| extent.max(p.distance(front_a[0])));
    let planes = bounding_planes(&front_a, &front_b, SLACK * extent);
    let slack = SLACK * extent;
    let is_beyond_plane = |body: &Vec<DVec3>| {
        planes.iter().any(|&(point, normal)| body.iter().all(|p| (*p - point).dot(normal) <= slack))
    };
    // A triangle may have both polygons on one side of its own plane.
    let has_all_on_one_side = |body: &Vec<DVec3>| {
        let &[a, b, c] = &body[..] else { return false };
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { return true };
        let heights = || front_a.iter().chain(&front_b).map(|p| (*p - a).dot(normal));
        heights().all(|height| height >= -slack) || heights().all(|height| height <= slack)
    };
    bodies.iter().all(|body| is_beyond_plane(body) || has_all_on_one_side(body))
}

/// Whether two triangles of one plane and one front have more than their rims in common.
pub(super) fn overlap(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let (area_a, area_b) = (area_vector(a), area_vector(b));
    let Some(normal) = area_a.try_normalize() else { return false };
    let extent = a.iter().chain(b).fold(0.0, |extent: f64, p| extent.max(p.distance(a[0])));
    let slack = SLACK * extent;
    if area_b.dot(normal) <= 0.0 || b.iter().any(|p| (*p - a[0]).dot(normal).abs() > slack) {
        return false;
    }
    // Two convex polygons of a plane are apart if an edge of one has the other outside.
    let is_apart = |one: &[DVec3; 3], other: &[DVec3; 3]| {
        (0..3).any(|k| {
            let Some(outwards) = (one[(k + 1) % 3] - one[k]).cross(normal).try_normalize() else { return true };
            other.iter().all(|p| (*p - one[k]).dot(outwards) >= -slack)
        })
    };
    !is_apart(a, b) && !is_apart(b, a)
}

/// Points and inward unit normals of planes that have both polygons on one side.
fn bounding_planes(a: &[DVec3], b: &[DVec3], slack: f64) -> Vec<(DVec3, DVec3)> {
    let mut planes = Vec::new();
    let mut add = |point: DVec3, normal: DVec3| {
        let Some(normal) = normal.try_normalize() else { return };
        let heights = || a.iter().chain(b).map(|p| (*p - point).dot(normal));
        if heights().all(|height| height >= -slack) {
            planes.push((point, normal));
        }
        if heights().all(|height| height <= slack) {
            planes.push((point, -normal));
        }
    };
    add(a[0], area_vector(a));
    add(b[0], area_vector(b));
    for (one, other) in [(a, b), (b, a)] {
        for (from, to) in one.iter().zip(one.iter().cycle().skip(1)) {
            for corner in other {
                add(*from, (*to - *from).cross(*corner - *from));
            }
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_lie_on_each_other() {
        let triangle = |x: f64, y: f64, z: f64| [[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]].map(DVec3::from);
        let one = triangle(0.0, 0.0, 0.0);
        assert!(
            overlap(&one, &one) && overlap(&one, &triangle(0.4, 0.4, 0.0)) && overlap(&one, &triangle(0.5, 0.0, 0.0))
        );
        // In a corner, along an edge, apart, above, and back to back.
        assert!(
            !overlap(&one, &triangle(1.0, 0.0, 0.0)) && !overlap(&one, &[one[1], one[2], DVec3::new(1.0, 1.0, 0.0)])
        );
        assert!(!overlap(&one, &triangle(0.6, 0.6, 0.0)) && !overlap(&one, &triangle(0.0, 0.0, 1e-3)));
        assert!(!overlap(&one, &[one[0], one[2], one[1]]));
    }

    #[test]
    fn bodies_between_are_found() {
        let square = |z: f64, turned: bool| {
            let mut corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z));
            if turned {
                corners.reverse();
            }
            corners
        };
        let (floor, ceiling) = (square(0.0, false), square(1.0, true));
        let seen =
            |body: &[[f64; 3]]| is_full_view(&floor, &ceiling, &[body.iter().map(|p| DVec3::from(*p)).collect()]);
        assert!(is_full_view(&floor, &ceiling, &[]));
        assert!(is_full_view(&floor, &ceiling, &[floor.to_vec(), ceiling.to_vec()]));
        assert!(!seen(&[[0.5, 0.5, 0.5]]) && !seen(&[[-1.0, -1.0, 0.5], [2.0, 2.0, 0.6], [2.0, -1.0, 0.5]]));
        // Beside, touching the side, above, and a corner that reaches in.
        assert!(seen(&[[1.1, 0.0, 0.2], [3.0, 1.0, 0.9], [3.0, 0.0, 0.0]]));
        assert!(seen(&[[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]]));
        assert!(seen(&[[0.0, 0.0, 1.5], [1.0, 1.0, 1.0]]));
        assert!(!seen(&[[0.99, 0.5, 0.5], [3.0, 1.0, 0.9], [3.0, 0.0, 0.0]]));
        // A wall that touches the hull in a corner only.
        let wedge = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 0.5, 0.0), DVec3::new(0.0, 1.0, 0.0)];
        let wall = [[1.0, -9.0, -9.0], [1.0, 9.0, -9.0], [1.0, 0.0, 9.0]].map(DVec3::from).to_vec();
        let far = ceiling.map(|p| p - DVec3::X * 0.25);
        assert!(is_full_view(&wedge, &far, &[wall]));
        // Behind each other's planes, nothing is between.
        assert!(is_full_view(&square(0.0, true), &ceiling, &[vec![DVec3::splat(0.5)]]));
    }
}
