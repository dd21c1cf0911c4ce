//! Flat disks.
//!
//! Texture coordinates are those of the square around the disk, in [0, 1]². Seen from the visible side with +y upwards,
//! u grows to the right and v downwards.

use super::solve::{self, Frame};
use super::{Plane, ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A flat round disk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Disk {
    /// The centre.
    pub center: Vec3,
    /// The direction of the visible side; any length but zero.
    pub normal: Vec3,
    /// The radius r > 0.
    pub radius: f32,
}

impl Disk {
    #[inline(always)]
    pub(super) fn plane(&self) -> Plane {
        Plane { point: self.center, normal: self.normal }
    }

    #[inline(always)]
    fn size(&self) -> f64 {
        self.center.as_dvec3().abs().max_element() + f64::from(self.radius)
    }

    /// The hit, if its t lies in (0, t_max].
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let plane = self.plane();
        let t = plane.parameter(ray.into());
        let hit = solve::hit(t, 0, t_max)?;
        let r = f64::from(self.radius);
        (plane.offset(ray.into(), t).length_squared() <= r * r).then_some(hit)
    }

    /// The place where a ray meets the disk's plane, relative to the centre.
    pub(super) fn offset(&self, ray: &Ray) -> DVec3 {
        let (plane, line) = (self.plane(), ray.into());
        plane.offset(line, plane.parameter(line))
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        let plane = self.plane();
        let r = f64::from(self.radius);
        let p = plane.offset(line, plane.parameter(line));
        let frame = Frame::around(self.normal.as_dvec3());
        let uv = [frame.x, frame.z].map(|axis| 0.5 * (1.0 + p.dot(axis) / r));
        let surface = solve::surface(self.center.as_dvec3() + p, self.size(), frame.y, uv);
        if solve::is_large(r, line.longest(), hit.t) { surface.with_fine_uv(uv.into()) } else { surface }
    }

    /// [`Disk::surface`] without texture coordinates.
    #[inline(always)]
    pub(super) fn surface_without_uv(&self, line: DRay) -> Surface {
        let plane = self.plane();
        let p = plane.offset(line, plane.parameter(line));
        solve::surface(self.center.as_dvec3() + p, self.size(), self.normal.as_dvec3().normalize(), [0.0; 2])
    }

    /// The surface differential at every point.
    pub fn surface_differential(&self) -> SurfaceDifferential {
        let (frame, width) = (Frame::around(self.normal.as_dvec3()), 2.0 * f64::from(self.radius));
        SurfaceDifferential::flat(frame.x / width, frame.z / width)
    }

    /// The box around the disk.
    pub fn bounds(&self) -> Aabb {
        let n = self.normal.as_dvec3().normalize();
        solve::bounds(self.center.as_dvec3(), solve::disk_extent(n, f64::from(self.radius)), self.size())
    }

    /// The disk moved by a transform, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Disk> {
        let scale = t.uniform_scale()?;
        let center = t.point(self.center.as_dvec3()).as_vec3();
        let radius = (f64::from(self.radius) * scale) as f32;
        Some(Disk { center, normal: solve::moved_normal(t, self.normal), radius })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("center", self.center)?;
        solve::direction("normal", self.normal)?;
        solve::positive("radius", self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISK: Disk = Disk { center: Vec3::new(1.0, 2.0, 3.0), normal: Vec3::Z, radius: 2.0 };

    #[test]
    fn it_ends_at_its_radius() {
        for (x, meets) in [(2.99, true), (3.01, false), (-0.99, true), (-1.01, false)] {
            let ray = Ray::new(Vec3::new(x, 2.0, 9.0), Vec3::NEG_Z);
            assert_eq!(DISK.intersect(&ray, 100.0).is_some(), meets, "{x}");
        }
    }

    #[test]
    fn texture_coordinates_are_those_of_the_square_around_it() {
        let uv = |x: f32, y: f32| {
            let ray = Ray::new(Vec3::new(x, y, 9.0), Vec3::NEG_Z);
            DISK.surface(&ray, &DISK.intersect(&ray, 100.0).unwrap()).uv.to_array()
        };
        assert_eq!(uv(1.0, 2.0), [0.5, 0.5]);
        assert_eq!(uv(3.0, 2.0), [1.0, 0.5]);
        assert_eq!(uv(1.0, 4.0), [0.5, 0.0]);
    }
}
