//! The form factor of a differential patch to a polygon: Lambert's contour integral (*Photometria*, 1760).

use glam::DVec3;
use std::f64::consts::TAU;

/// Points nearer to a polygon's plane than this share of their distance to its corners lie in it, as far as rounding
/// shows.
const IN_PLANE: f64 = 4.0 * f64::EPSILON;

/// The form factor from a differential patch to a planar polygon in full view, from −1 to 1. The part of the polygon
/// behind the patch is clipped away.
///
/// `normal` is the patch's unit normal. The polygon has any number of corners and may be concave. The factor is
/// positive if the patch sees the polygon's front, where the corners are counter-clockwise, and negative if it sees the
/// back. It is zero for a point in the polygon's plane. The rounding error is some `f64::EPSILON`.
///
/// F = Σ θᵢ n·Γᵢ / 2π, where θᵢ is the angle that edge i subtends at the point and Γᵢ is the unit normal of the plane
/// through the point and the edge.
pub fn point_to_polygon(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let Some(&last) = polygon.last() else { return 0.0 };
    let mut contour = Contour::new(normal);
    let mut before = last - point;
    let mut height_before = before.dot(normal);
    for &corner in polygon {
        let here = corner - point;
        let height = here.dot(normal);
        if (height_before > 0.0 && height < 0.0) || (height_before < 0.0 && height > 0.0) {
            contour.extend_to(before + (here - before) * (height_before / (height_before - height)));
        }
        if height >= 0.0 {
            contour.extend_to(here);
        }
        (before, height_before) = (here, height);
    }
    contour.close()
}

/// The contour of a clipped polygon, seen from the origin, with its integral so far.
struct Contour {
    normal: DVec3,
    /// The first and the last point so far.
    ends: Option<(DVec3, DVec3)>,
    /// Σ θᵢ n·Γᵢ.
    sum: f64,
    /// Σ rᵢ × rᵢ₊₁, twice the polygon's area vector.
    area: DVec3,
}

impl Contour {
    fn new(normal: DVec3) -> Contour {
        Contour { normal, ends: None, sum: 0.0, area: DVec3::ZERO }
    }

    #[inline]
    fn extend_to(&mut self, point: DVec3) {
        let Some((first, last)) = self.ends else {
            self.ends = Some((point, point));
            return;
        };
        self.add_edge(last, point);
        self.ends = Some((first, point));
    }

    #[inline]
    fn add_edge(&mut self, a: DVec3, b: DVec3) {
        let cross = a.cross(b);
        let length = cross.length();
        if length > 0.0 {
            self.sum += libm::atan2(length, a.dot(b)) * (cross.dot(self.normal) / length);
            self.area += cross;
        }
    }

    fn close(mut self) -> f64 {
        let Some((first, last)) = self.ends else { return 0.0 };
        self.add_edge(last, first);
        // The height over the polygon's plane, times twice the area.
        let height = self.area.dot(first).abs();
        if height <= IN_PLANE * self.area.length() * first.length().max(last.length()) {
            return 0.0;
        }
        // Seen from its front, a polygon's contour is counter-clockwise, so that each Γᵢ points away from it.
        (self.sum / -TAU).clamp(-1.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::{area_vector, literature};
    use crate::sampler::Sampler;
    use std::f64::consts::PI;

    fn close(what: &str, ours: f64, exact: f64) {
        assert!((ours - exact).abs() < 1e-14, "{what}: {ours} instead of {exact}");
    }

    /// A rectangle from a corner along two edges, whose front is on the side of u × v.
    fn rectangle(corner: DVec3, u: DVec3, v: DVec3) -> [DVec3; 4] {
        [corner, corner + u, corner + u + v, corner + v]
    }

    /// Howell's catalogue, B-3: the plane is parallel, and the normal passes through a corner.
    #[test]
    fn parallel_rectangles() {
        for (a, b, c) in [(1.0, 1.0, 1.0), (3.0, 0.5, 2.0), (1e3, 1e-3, 1.0), (20.0, 30.0, 1e-6f64)] {
            let down = rectangle(DVec3::Z * c, DVec3::Y * b, DVec3::X * a);
            let exact = literature::patch_to_parallel_rectangle(a, b, c);
            close("B-3", point_to_polygon(DVec3::ZERO, DVec3::Z, &down), exact);
            let up = rectangle(DVec3::Z * c, DVec3::X * a, DVec3::Y * b);
            close("B-3 from behind", point_to_polygon(DVec3::ZERO, DVec3::Z, &up), -exact);
            close("B-3 turned away", point_to_polygon(DVec3::ZERO, -DVec3::Z, &down), 0.0);
        }
    }

    /// Howell's catalogue, B-4: the plane is perpendicular, and the rectangle stands on the patch's plane.
    #[test]
    fn perpendicular_rectangles() {
        for (a, b, c) in [(1.0, 1.0, 1.0), (3.0, 0.5, 2.0), (0.2, 7.0, 1e-9f64)] {
            let exact = literature::patch_to_perpendicular_rectangle(a, b, c);
            let wall = rectangle(DVec3::Y * c, DVec3::X * b, DVec3::Z * a);
            close("B-4", point_to_polygon(DVec3::ZERO, DVec3::Z, &wall), exact);
            // A part below the patch's horizon adds nothing.
            let deeper = rectangle(DVec3::new(0.0, c, -2.0), DVec3::X * b, DVec3::Z * (a + 2.0));
            close("B-4 with a part below", point_to_polygon(DVec3::ZERO, DVec3::Z, &deeper), exact);
        }
    }

    /// Sparrow's factor of a disk over a parallel patch (Howell's catalogue, B-12), between polygons inside and
    /// outside.
    #[test]
    fn disks_lie_between_polygons() {
        let (h, r, n) = (1.5, 0.75, 4000);
        let polygon = |radius: f64| -> Vec<DVec3> {
            let angle = |k: i32| -TAU * f64::from(k) / f64::from(n);
            (0..n).map(|k| DVec3::new(radius * angle(k).cos(), radius * angle(k).sin(), h)).collect()
        };
        let exact = literature::patch_to_disk(r, h);
        let inner = point_to_polygon(DVec3::ZERO, DVec3::Z, &polygon(r));
        let outer = point_to_polygon(DVec3::ZERO, DVec3::Z, &polygon(r / (PI / f64::from(n)).cos()));
        assert!(inner < exact && exact < outer && outer - inner < 1e-6, "{inner} {exact} {outer}");
    }

    /// Random triangles, tilted and cut by the horizon, against a sum over small triangles.
    #[test]
    fn triangles_agree_with_their_definition() {
        let random = |i: u32, k: u32| Sampler::new(3, 0, [i, 0]).uniform(0, k) * 2.0 - 1.0;
        let n = 300;
        for i in 0..40 {
            let v = |k: u32| DVec3::new(random(i, 3 * k), random(i, 3 * k + 1), random(i, 3 * k + 2));
            let triangle = [v(0), v(1), v(2) + DVec3::X];
            let (point, normal) = (v(3) * 2.0, v(4).normalize());
            let area = area_vector(&triangle);
            let mut sum = 0.0;
            for row in 0..n {
                for column in 0..2 * row + 1 {
                    // The centre of a small triangle, in barycentric coordinates.
                    let third = if column % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
                    let a = (f64::from(row) + 1.0 - third) / f64::from(n);
                    let b = (f64::from(column / 2) + third) / f64::from(n);
                    let r = triangle[0] + (triangle[1] - triangle[0]) * a + (triangle[2] - triangle[1]) * b - point;
                    let distance = r.length();
                    sum -= (normal.dot(r).max(0.0) * area.dot(r)) / (PI * distance.powi(4));
                }
            }
            let definition = sum / f64::from(n * n);
            let ours = point_to_polygon(point, normal, &triangle);
            assert!((ours - definition).abs() < 2e-4 * (1.0 + definition.abs()), "{i}: {ours} {definition}");
        }
    }

    /// The faces of a closed body around a point take all its light, and the faces of a body elsewhere take none in
    /// sum.
    #[test]
    fn closed_bodies_sum_to_one() {
        let corner = |k: u32| DVec3::new(f64::from(k & 1) * 3.0, f64::from(k >> 1 & 1), f64::from(k >> 2) * 0.1);
        let faces: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let sum = |point: DVec3, normal: DVec3| -> f64 {
            // Listed with their fronts inside.
            faces.iter().map(|face| point_to_polygon(point, normal, &face.map(corner))).sum()
        };
        for normal in [DVec3::Z, DVec3::new(1.0, -2.0, 0.5).normalize(), DVec3::new(-0.1, 3.0, -1.0).normalize()] {
            close("inside", sum(DVec3::new(0.01, 0.3, 0.05), normal), 1.0);
            close("near a corner", sum(DVec3::new(1e-9, 1e-10, 0.1 - 1e-9), normal), 1.0);
            close("outside", sum(DVec3::new(-1.0, 0.3, 2.0), normal), 0.0);
        }
    }

    #[test]
    fn places_in_the_plane_give_numbers() {
        let square = rectangle(DVec3::new(0.1, 0.2, 0.3), DVec3::X * 0.7, DVec3::Y * 0.9);
        let normals = [DVec3::X, DVec3::Z, -DVec3::Z, DVec3::new(0.3, -0.5, 0.1).normalize()];
        for normal in normals {
            for (s, t) in [(0.0, 0.0), (0.3, 0.0), (1.0, 1.0), (0.4, 0.6), (0.0, 0.99), (3.0, 0.5), (-1.0, 0.0)] {
                let point = square[0] + DVec3::X * (0.7 * s) + DVec3::Y * (0.9 * t);
                assert_eq!(point_to_polygon(point, normal, &square), 0.0, "{s} {t} {normal}");
                for k in 1..60 {
                    let near = point + normals[3] * 0.5f64.powi(k);
                    let factor = point_to_polygon(near, normal, &square);
                    assert!((-1.0..=1.0).contains(&factor), "{s} {t} {normal} {k}: {factor}");
                }
            }
        }
        assert_eq!(point_to_polygon(DVec3::ZERO, DVec3::X, &[]), 0.0);
        assert_eq!(point_to_polygon(DVec3::ZERO, DVec3::X, &square[..1]), 0.0);
        assert_eq!(point_to_polygon(DVec3::ZERO, DVec3::X, &square[..2]), 0.0);
        assert_eq!(point_to_polygon(DVec3::ZERO, DVec3::X, &[DVec3::X; 4]), 0.0);
    }

    /// The limit at the foot of a wall is a half: the wall fills the half of the hemisphere.
    #[test]
    fn the_foot_of_a_wall() {
        let wall = rectangle(DVec3::ZERO, DVec3::X, DVec3::Z);
        for distance in [1e-6, 1e-9, 1e-12, 1e-14] {
            let factor = point_to_polygon(DVec3::new(0.5, -distance, 0.0), DVec3::Z, &wall);
            assert!((factor - 0.5).abs() < 2.0 * distance + 1e-15, "{distance}: {factor}");
        }
    }

    #[test]
    fn scale_by_a_power_of_two_keeps_all_bits() {
        let triangle = [DVec3::new(0.1, 0.3, 0.7), DVec3::new(1.3, 0.2, 0.9), DVec3::new(0.3, 1.1, -0.4)];
        let (point, normal) = (DVec3::new(0.2, 0.4, -0.3), DVec3::new(0.3, 0.4, 0.6).normalize());
        let factor = point_to_polygon(point, normal, &triangle);
        assert!(factor != 0.0);
        for scale in [2f64.powi(-40), 2f64.powi(50)] {
            assert_eq!(point_to_polygon(point * scale, normal, &triangle.map(|p| p * scale)), factor);
        }
    }
}
