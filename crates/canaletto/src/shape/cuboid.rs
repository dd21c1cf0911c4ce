//! Axis-aligned boxes (fig. 5.16).
//!
//! Parts number the faces: −x, +x, −y, +y, −z, +z. Each has its own texture coordinates in [0, 1]² (fig. 5.31). Seen
//! from outside, u grows to the right and v downwards. +y is upwards on the four sides, −z on the top and +z on the
//! bottom.

use super::solve;
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform, larger, smaller};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec2, DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cuboid {
    /// The corner of smallest coordinates.
    pub min: Vec3,
    /// The corner of largest coordinates. None is below that of `min`.
    pub max: Vec3,
}

impl Cuboid {
    /// The nearest hit with t in (0, t_max]. From outside it is where the ray has entered all three pairs of faces,
    /// from inside where it first leaves one. A ray in the plane of a face doesn't hit the box.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            let (min, max) = (self.min[axis], self.max[axis]);
            if d == 0.0 {
                if o <= min || o >= max {
                    return None;
                }
                continue;
            }
            let to = |plane: f32| (f64::from(plane) - f64::from(o)) / f64::from(d);
            let (low, high) = ((to(min), 2 * axis as u32), (to(max), 2 * axis as u32 + 1));
            let (near, far) = if d > 0.0 { (low, high) } else { (high, low) };
            if near.0 > enter.0 {
                enter = near;
            }
            if far.0 < leave.0 {
                leave = far;
            }
        }
        if enter.0.is_nan() || leave.0.is_nan() || enter.0 > leave.0 {
            return None;
        }
        let (t, face) = if enter.0 as f32 > 0.0 { enter } else { leave };
        solve::hit(t, face, t_max)
    }

    /// The surface at a hit. The point lies exactly on its face.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        let surface = self.surface_without_uv(line, hit.part);
        let point = surface.exact;
        // The fraction of the distance from min to max, and from max to min.
        let fraction = |along: usize, from: Vec3| {
            let size = f64::from(self.max[along]) - f64::from(self.min[along]);
            let way = (point[along] - f64::from(from[along])).abs();
            if size > 0.0 { way / size } else { 0.0 }
        };
        let (up, down) = (|along| fraction(along, self.min), |along| fraction(along, self.max));
        let uv = match hit.part {
            0 => DVec2::new(up(2), down(1)),
            1 => DVec2::new(down(2), down(1)),
            2 => DVec2::new(up(0), down(2)),
            3 => DVec2::new(up(0), up(2)),
            4 => DVec2::new(down(0), down(1)),
            _ => DVec2::new(up(0), down(1)),
        };
        let size = f64::from((self.max - self.min).max_element());
        if solve::is_large(size, line.longest(), hit.t) {
            return surface.with_fine_uv(uv);
        }
        Surface { uv: uv.as_vec2(), ..surface }
    }

    /// [`Cuboid::surface`] without texture coordinates.
    #[inline(always)]
    pub(super) fn surface_without_uv(&self, line: DRay, part: u32) -> Surface {
        // Without a branch or an index, so that the compiler vectorises.
        let (is_x, is_y, upper) = (part < 2, part / 2 == 1, part % 2 == 1);
        let along = |v: DVec3| if is_x { v.x } else { if is_y { v.y } else { v.z } };
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        let plane = if upper { along(max) } else { along(min) };
        let DRay { origin: o, direction: d } = line;
        let p = o + d * ((plane - along(o)) / along(d));
        let within = |p: f64, min: f64, max: f64| smaller(larger(p, min), max);
        let point = DVec3 {
            x: if is_x { plane } else { within(p.x, min.x, max.x) },
            y: if is_y { plane } else { within(p.y, min.y, max.y) },
            z: if is_x | is_y { within(p.z, min.z, max.z) } else { plane },
        };
        let out = if upper { 1.0 } else { -1.0 };
        let normal = DVec3 {
            x: if is_x { out } else { 0.0 },
            y: if is_y { out } else { 0.0 },
            z: if is_x | is_y { 0.0 } else { out },
        };
        Surface::at(point, normal, Vec2::ZERO)
    }

    /// The surface differential at a hit.
    pub fn surface_differential(&self, hit: &ShapeHit) -> SurfaceDifferential {
        let along = |axis: usize, sign: f64| {
            let size = f64::from(self.max[axis]) - f64::from(self.min[axis]);
            if size > 0.0 { DVec3::AXES[axis] * (sign / size) } else { DVec3::ZERO }
        };
        let (u, v) = match hit.part {
            0 => (along(2, 1.0), along(1, -1.0)),
            1 => (along(2, -1.0), along(1, -1.0)),
            2 => (along(0, 1.0), along(2, -1.0)),
            3 => (along(0, 1.0), along(2, 1.0)),
            4 => (along(0, -1.0), along(1, -1.0)),
            _ => (along(0, 1.0), along(1, -1.0)),
        };
        SurfaceDifferential::flat(u, v)
    }

    /// The box as bounds.
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// The box moved by a transform, if it stays an axis-aligned box.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Cuboid> {
        if !t.is_axis_aligned() {
            return None;
        }
        let (a, b) = (t.point(self.min.as_dvec3()).as_vec3(), t.point(self.max.as_dvec3()).as_vec3());
        Some(Cuboid { min: a.min(b), max: a.max(b) })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("min", self.min)?;
        solve::finite("max", self.max)?;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (min, max) = (self.min[axis], self.max[axis]);
            if min > max {
                return Err(OutOfRange::new(
                    "min",
                    format!("is {min} in {name}; it must not be more than max, which is {max}"),
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f32 = f32::INFINITY;
    const BOX: Cuboid = Cuboid { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 3.0) };
    const OUT: [Vec3; 6] = [Vec3::NEG_X, Vec3::X, Vec3::NEG_Y, Vec3::Y, Vec3::NEG_Z, Vec3::Z];

    #[test]
    fn each_face_is_met_from_outside() {
        for (face, n) in OUT.into_iter().enumerate() {
            // One component is 1, the others are 0.
            let ray = Ray::new(n * 10.0, -n);
            let hit = BOX.intersect(&ray, INF).unwrap();
            assert_eq!((hit.part, hit.t), (face as u32, 10.0 - BOX.max.dot(n.abs())));
            assert_eq!(BOX.surface(&ray, &hit).normal.as_vec3(), n);
        }
    }

    #[test]
    fn each_face_is_met_from_inside() {
        for (face, n) in OUT.into_iter().enumerate() {
            let ray = Ray::new(Vec3::splat(0.5), n);
            let hit = BOX.intersect(&ray, INF).unwrap();
            let s = BOX.surface(&ray, &hit);
            assert_eq!((hit.part, s.normal.as_vec3()), (face as u32, n));
            assert_eq!(s.point.dot(n), BOX.max.dot(n.abs()));
        }
    }

    #[test]
    fn a_ray_in_the_plane_of_a_face_or_beside_passes() {
        for y in [2.0, 2.5, -2.0] {
            assert_eq!(BOX.intersect(&Ray::new(Vec3::new(-5.0, y, 0.0), Vec3::X), INF), None);
        }
        assert!(BOX.intersect(&Ray::new(Vec3::new(-5.0, 1.999, 0.0), Vec3::X), INF).is_some());
    }

    #[test]
    fn a_face_that_the_ray_starts_on_does_not_count() {
        let up = BOX.intersect(&Ray::new(Vec3::new(0.0, 2.0, 0.0), Vec3::Y), INF);
        assert_eq!(up, None);
        let down = BOX.intersect(&Ray::new(Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y), INF).unwrap();
        assert_eq!((down.t, down.part), (4.0, 2));
    }

    #[test]
    fn a_flat_box_shows_the_face_towards_the_ray() {
        let flat = Cuboid { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::new(1.0, 0.0, 1.0) };
        for (from, face) in [(5.0, 3), (-5.0, 2)] {
            let ray = Ray::new(Vec3::new(0.5, from, 0.5), Vec3::new(0.0, -from, 0.0));
            let hit = flat.intersect(&ray, INF).unwrap();
            assert_eq!((hit.t, hit.part), (1.0, face));
            assert!(flat.surface(&ray, &hit).uv.is_finite());
        }
        assert!(flat.check().is_ok());
    }

    #[test]
    fn texture_coordinates_grow_right_and_down() {
        // The face's upper left corner, as seen from outside.
        let corners = [
            (0, Vec3::new(-1.0, 2.0, -3.0)),
            (1, Vec3::new(1.0, 2.0, 3.0)),
            (2, Vec3::new(-1.0, -2.0, 3.0)),
            (3, Vec3::new(-1.0, 2.0, -3.0)),
            (4, Vec3::new(1.0, 2.0, -3.0)),
            (5, Vec3::new(-1.0, 2.0, 3.0)),
        ];
        for (face, corner) in corners {
            let n = OUT[face];
            let at = |p: Vec3| {
                let ray = Ray::new(p + n, -n);
                let hit = ShapeHit { t: 1.0, part: face as u32, uv: [0.0; 2] };
                BOX.surface(&ray, &hit).uv
            };
            assert_eq!(at(corner), Vec2::ZERO, "face {face}");
            // Mirrored at the face's middle, the corner becomes the lower right one.
            assert_eq!(at(-corner + n * (2.0 * n.dot(corner))), Vec2::ONE, "face {face}");
        }
    }

    #[test]
    fn crossed_corners_are_refused() {
        let error = Cuboid { min: Vec3::new(0.0, 3.0, 0.0), max: Vec3::ONE }.check().unwrap_err().to_string();
        assert_eq!(error, "min is 3 in y; it must not be more than max, which is 1");
    }
}
