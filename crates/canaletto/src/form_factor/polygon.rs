//! Planar polygons as lists of corners, counter-clockwise seen from their front.

use glam::DVec3;

/// The normal of a planar polygon on its front, with the polygon's area as its length (Newell's method). Zero if the
/// polygon has no area.
pub fn area_vector(polygon: &[DVec3]) -> DVec3 {
    let Some(&first) = polygon.first() else { return DVec3::ZERO };
    let mut sum = DVec3::ZERO;
    for pair in polygon.windows(2) {
        sum += (pair[0] - first).cross(pair[1] - first);
    }
    sum * 0.5
}

/// The part of a polygon in front of the plane through `point` with this normal of any length (Sutherland and Hodgman,
/// *Reentrant Polygon Clipping*, 1974). The parts of a concave polygon stay connected by edges on the plane, which go
/// there and back; contour integrals over them are zero.
pub fn clip_to_front(polygon: &[DVec3], point: DVec3, normal: DVec3) -> Vec<DVec3> {
    let mut front = Vec::with_capacity(polygon.len() + 1);
    let Some(&last) = polygon.last() else { return front };
    let height = |corner: DVec3| (corner - point).dot(normal);
    let mut before = (last, height(last));
    for &corner in polygon {
        let here = (corner, height(corner));
        if (before.1 > 0.0 && here.1 < 0.0) || (before.1 < 0.0 && here.1 > 0.0) {
            front.push(before.0 + (corner - before.0) * (before.1 / (before.1 - here.1)));
        }
        if here.1 >= 0.0 {
            front.push(corner);
        }
        before = here;
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<DVec3> {
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| DVec3::new(x, y, 5.0)).to_vec()
    }

    #[test]
    fn the_area_vector_is_the_normal_times_the_area() {
        assert_eq!(area_vector(&square()), DVec3::Z * 4.0);
        // A concave polygon: the square without a triangle of area 1.
        let mut arrow = square();
        arrow.insert(1, DVec3::new(1.0, 1.0, 5.0));
        assert_eq!(area_vector(&arrow), DVec3::Z * 3.0);
        assert_eq!(area_vector(&square()[..2]), DVec3::ZERO);
        assert_eq!(area_vector(&[]), DVec3::ZERO);
    }

    #[test]
    fn clipping_keeps_the_front() {
        let cut = clip_to_front(&square(), DVec3::X * 0.5, DVec3::X * 7.0);
        assert_eq!(area_vector(&cut), DVec3::Z * 3.0);
        assert_eq!(clip_to_front(&square(), DVec3::ZERO, DVec3::X), square());
        assert!(area_vector(&clip_to_front(&square(), DVec3::X * 2.0, DVec3::X)) == DVec3::ZERO);
        assert!(clip_to_front(&square(), DVec3::X * 3.0, DVec3::X).is_empty());
        // The two tips of an M are cut off a concave polygon.
        let m = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 0.0), (0.0, 2.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
        assert_eq!(area_vector(&clip_to_front(&m, DVec3::Y, DVec3::Y)), DVec3::Z);
    }
}
