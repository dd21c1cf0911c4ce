//! Infinite planes.
//!
//! Texture coordinates are lengths in the scene's units from `point`, as a plane has no size of its own. Seen from the
//! visible side with +y upwards, u grows to the right and v downwards; on a floor, they are along x and z.

use super::solve::{self, Frame};
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// An infinite plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// A point of the plane.
    pub point: Vec3,
    /// The direction of the visible side; any length but zero.
    pub normal: Vec3,
}

impl Plane {
    /// The parameter t of (5.27); NaN or infinite for a parallel ray.
    #[inline(always)]
    pub(super) fn parameter(&self, line: DRay) -> f64 {
        let n = self.normal.as_dvec3();
        (self.point.as_dvec3() - line.origin).dot(n) / line.direction.dot(n)
    }

    /// The point of (5.28) relative to `point`, without the rounding error along the normal.
    #[inline(always)]
    pub(super) fn offset(&self, line: DRay, t: f64) -> DVec3 {
        let n = self.normal.as_dvec3();
        let p = line.origin - self.point.as_dvec3() + line.direction * t;
        p - n * (p.dot(n) / n.length_squared())
    }

    /// The hit, if its t lies in (0, t_max] and `f32` can hold its point.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let hit = solve::hit(self.parameter(ray.into()), 0, t_max)?;
        (ray.origin + ray.direction * hit.t).abs().cmplt(Vec3::splat(f32::MAX)).all().then_some(hit)
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        let p = self.offset(line, self.parameter(line));
        let frame = Frame::around(self.normal.as_dvec3());
        let size = self.point.as_dvec3().abs().max_element() + p.abs().max_element();
        let uv = [p.dot(frame.x), p.dot(frame.z)];
        let surface = solve::surface(self.point.as_dvec3() + p, size, frame.y, uv);
        if solve::is_large(uv[0].abs().max(uv[1].abs()), line.longest(), hit.t) {
            return surface.with_fine_uv(uv.into());
        }
        surface
    }

    /// The surface differential at every point.
    pub fn surface_differential(&self) -> SurfaceDifferential {
        let frame = Frame::around(self.normal.as_dvec3());
        SurfaceDifferential::flat(frame.x, frame.z)
    }

    /// The plane moved by a transform.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Plane> {
        let point = t.point(self.point.as_dvec3()).as_vec3();
        Some(Plane { point, normal: solve::moved_normal(t, self.normal) })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("point", self.point)?;
        solve::direction("normal", self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: Plane = Plane { point: Vec3::new(0.0, -50.0, 0.0), normal: Vec3::new(0.0, 3.0, 0.0) };

    #[test]
    fn a_floor_is_met_exactly_and_measured_along_x_and_z() {
        let ray = Ray::new(Vec3::new(1.0, 50.0, 2.0), Vec3::new(0.1, -0.3, 0.7));
        let hit = FLOOR.intersect(&ray, f32::INFINITY).unwrap();
        let s = FLOOR.surface(&ray, &hit);
        assert_eq!((s.point.y, s.normal.as_vec3()), (-50.0, Vec3::Y));
        assert_eq!(s.uv.to_array(), [s.point.x, s.point.z]);
    }

    #[test]
    fn parallel_rays_and_hits_beyond_all_numbers_are_none() {
        let from = Vec3::new(0.0, 1e30, 0.0);
        for d in [Vec3::X, Vec3::new(1.0, -1e-20, 0.0)] {
            assert_eq!(FLOOR.intersect(&Ray::new(from, d), f32::INFINITY), None, "{d}");
        }
    }

    #[test]
    fn a_point_met_by_a_grazing_ray_lies_on_the_plane() {
        // At a large distance, t's rounding alone would move the point off the plane.
        let ray = Ray::new(Vec3::new(1.0, -49.9, 2.0), Vec3::new(1.0, -1e-9, 0.3));
        let hit = FLOOR.intersect(&ray, f32::INFINITY).unwrap();
        assert_eq!(FLOOR.surface(&ray, &hit).point.y, -50.0);
        let near = Plane { point: Vec3::new(0.0, 1e-9, 0.0), ..FLOOR };
        let ray = Ray::new(Vec3::new(-3e7, 1e5, 0.7), Vec3::new(3.1, -0.011, 0.1));
        let hit = near.intersect(&ray, f32::INFINITY).unwrap();
        assert_eq!(near.surface(&ray, &hit).point.y, 1e-9);
    }

    #[test]
    fn a_normal_needs_a_length() {
        let error = Plane { normal: Vec3::ZERO, ..FLOOR }.check().unwrap_err().to_string();
        assert_eq!(error, "normal is 0 0 0; it must have a length");
    }
}
