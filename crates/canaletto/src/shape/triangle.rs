//! Triangles (5.23–5.31).
//!
//! Texture coordinates are the barycentric coordinates of the second and the third corner, L₂ and L₃ of (5.31).

use super::mesh::Corners;
use super::solve;
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray, triangle as kernel};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A triangle, counter-clockwise when seen from its visible side (5.23).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Triangle {
    /// The first corner.
    pub a: Vec3,
    /// The second corner.
    pub b: Vec3,
    /// The third corner.
    pub c: Vec3,
    /// Whether rays from behind pass through.
    pub one_sided: bool,
}

impl Triangle {
    /// The hit, if its t lies in (0, t_max]. A one-sided triangle is only hit from the front.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let corners = kernel::Triangle::new([self.a, self.b, self.c]);
        let hit = kernel::intersect(&ray.prepare(), &corners, t_max)?;
        (hit.front || !self.one_sided).then_some(ShapeHit { t: hit.t, part: 0, uv: [hit.u, hit.v] })
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        self.corners().at(&line.into(), hit)
    }

    #[inline]
    pub(crate) fn corners(&self) -> Corners {
        Corners { positions: [self.a, self.b, self.c], normals: None }
    }

    /// The surface differential at every point.
    pub fn surface_differential(&self) -> SurfaceDifferential {
        let [_, u, v] = gradients([self.a, self.b, self.c]);
        SurfaceDifferential::flat(u, v)
    }

    /// The box around the triangle.
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.a.min(self.b).min(self.c), max: self.a.max(self.b).max(self.c) }
    }

    /// The triangle moved by a transform. A mirroring transform would reverse its visible side; swapped corners restore
    /// it.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Triangle> {
        let [a, b, c] = [self.a, self.b, self.c].map(|p| t.point(p.as_dvec3()).as_vec3());
        let (b, c) = if solve::mirrors(t) { (c, b) } else { (b, c) };
        Some(Triangle { a, b, c, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("a", self.a)?;
        solve::finite("b", self.b)?;
        solve::finite("c", self.c)
    }
}

/// The cross product (p₂ − p₁) × (p₃ − p₁) of (5.23).
#[inline(always)]
pub(super) fn cross(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// The gradient of each corner's weight along the triangle; zero where it has no area.
pub(super) fn gradients([a, b, c]: [Vec3; 3]) -> [DVec3; 3] {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    let n = (b - a).cross(c - a);
    // The squared length isn't used: it may underflow in `f64`, although it doesn't overflow.
    let area = n.length();
    if area == 0.0 {
        return [DVec3::ZERO; 3];
    }
    let n = n / area;
    let (u, v) = ((c - a).cross(n) / area, n.cross(b - a) / area);
    [-u - v, u, v]
}

/// The weights of the corners. None is negative and their sum is 1 for any rounding of u and v.
#[inline(always)]
pub(super) fn weights(u: f64, v: f64) -> [f64; 3] {
    let (u, v) = (u.max(0.0), v.max(0.0));
    let w = (1.0 - u - v).max(0.0);
    let sum = w + u + v;
    [w / sum, u / sum, v / sum]
}

/// The point with these barycentric coordinates.
#[inline(always)]
pub(super) fn blend([a, b, c]: [Vec3; 3], [wa, wb, wc]: [f64; 3]) -> DVec3 {
    a.as_dvec3() * wa + b.as_dvec3() * wb + c.as_dvec3() * wc
}

/// The largest magnitude of a coordinate.
#[inline(always)]
pub(super) fn size([a, b, c]: [Vec3; 3]) -> f64 {
    f64::from(a.abs().max(b.abs()).max(c.abs()).max_element())
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXERCISE_17: Triangle = Triangle {
        a: Vec3::new(3.0, 4.0, 2.0),
        b: Vec3::new(4.0, 1.0, 5.0),
        c: Vec3::new(2.0, 1.0, 6.0),
        one_sided: false,
    };

    fn ray_17() -> Ray {
        Ray::new(Vec3::new(12.0, 18.0, 12.0), Vec3::new(-1.0, -2.0, -1.0))
    }

    #[test]
    fn exercise_17() {
        // The intersection with the plane lies outside the triangle, as a wider triangle of this plane shows.
        let Triangle { a, b, c, one_sided } = EXERCISE_17;
        assert_eq!(EXERCISE_17.intersect(&ray_17(), f32::INFINITY), None);
        let wide =
            Triangle { a, b: a + (b - a) * 4.0 - (c - a) * 2.0, c: a + (c - a) * 4.0 - (b - a) * 2.0, one_sided };
        let hit = wide.intersect(&ray_17(), f32::INFINITY).unwrap();
        assert!((hit.t - 185.0 / 23.0).abs() < 1e-6, "{hit:?}");
        let s = wide.surface(&ray_17(), &hit);
        assert!((s.point - Vec3::new(3.957, 1.913, 3.957)).abs().max_element() < 0.0005, "{s:?}");
        assert!(s.normal.as_vec3().dot(ray_17().direction) > 0.0, "not met from behind: {s:?}");
    }

    #[test]
    fn one_sided_triangles_are_not_met_from_behind() {
        let triangle = Triangle { a: Vec3::ZERO, b: Vec3::X, c: Vec3::Y, one_sided: true };
        let front = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
        let back = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
        assert_eq!(triangle.intersect(&front, 2.0).map(|h| (h.t, h.uv)), Some((1.0, [0.25, 0.25])));
        assert_eq!(triangle.intersect(&back, 2.0), None);
        assert!(Triangle { one_sided: false, ..triangle }.intersect(&back, 2.0).is_some());
    }

    #[test]
    fn a_mirrored_triangle_keeps_its_visible_side() {
        let triangle = Triangle { a: Vec3::ZERO, b: Vec3::X, c: Vec3::Y, one_sided: true };
        let moved = triangle.transformed(&Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap()).unwrap();
        assert!(moved.intersect(&Ray::new(Vec3::new(-0.25, 0.25, 1.0), Vec3::NEG_Z), 2.0).is_some());
    }

    #[test]
    fn a_triangle_without_area_is_sound_but_never_met() {
        let flat = Triangle { a: Vec3::ZERO, b: Vec3::X, c: Vec3::X * 2.0, one_sided: false };
        assert!(flat.check().is_ok());
        assert_eq!(flat.intersect(&Ray::new(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z), 2.0), None);
    }

    #[test]
    fn weights_are_never_negative_and_add_up_to_one() {
        let w = weights(0.6, 0.400_000_04);
        assert!(w.iter().all(|w| *w >= 0.0), "{w:?}");
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-15, "{w:?}");
    }
}
