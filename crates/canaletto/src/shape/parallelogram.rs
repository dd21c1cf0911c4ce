//! Parallelograms: rectangles as objects, and the surfaces of rectangular lights.
//!
//! Texture coordinates are in [0, 1]². Seen from the outer side with the edge `v` upwards, u grows along the edge `u`
//! and v downwards, against the edge `v`, so that an image stands upright.

use super::mesh::Corners;
use super::{ShapeHit, Surface, SurfaceDifferential, solve, triangle};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray, triangle as kernel};
use glam::{DVec2, DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A flat surface between two edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parallelogram {
    /// A corner of the parallelogram.
    pub corner: Vec3,
    /// An edge from the corner.
    pub u: Vec3,
    /// The other edge from the corner, not along `u`. u × v is on the outer (visible) side.
    pub v: Vec3,
}

/// The corners of the two halves on both sides of the diagonal from `corner`, by their places among
/// [`Parallelogram::corners`].
pub(crate) const HALVES: [[usize; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

impl Parallelogram {
    /// The corners, counter-clockwise seen from the outer side.
    pub(crate) fn corners(&self) -> [Vec3; 4] {
        let Parallelogram { corner, u, v } = *self;
        [corner, corner + u, corner + (u + v), corner + v]
    }

    /// The triangles on both sides of the diagonal from `corner`.
    pub(crate) fn halves(&self) -> [[Vec3; 3]; 2] {
        let corners = self.corners();
        HALVES.map(|half| half.map(|i| corners[i]))
    }

    /// The half of this part, as a triangle.
    #[inline]
    pub(crate) fn half(&self, part: u32) -> Corners {
        Corners { positions: self.halves()[usize::from(part != 0)], normals: None }
    }

    /// The hit, if its t lies in (0, t_max]. Its part is the half on one side of the diagonal, and its uv are the
    /// barycentric coordinates there. The halves are met as triangles of a mesh are, so that no ray passes between
    /// neighbours with common corners.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let ray = ray.prepare();
        (0..).zip(self.halves()).find_map(|(part, half)| {
            let hit = kernel::intersect(&ray, &kernel::Triangle::new(half), t_max)?;
            Some(ShapeHit { t: hit.t, part, uv: [hit.u, hit.v] })
        })
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        let is_first = hit.part == 0;
        let half = self.half(hit.part);
        // The shares of the edges u and v, of which the latter counts from the far edge.
        let upright =
            |[u, v]: [f64; 2]| if is_first { DVec2::new(u + v, 1.0 - v) } else { DVec2::new(u, 1.0 - (u + v)) };
        if half.is_large(&line, hit.t) {
            let surface = half.on_line(&line).0;
            let uv = surface.uv.as_dvec2() + surface.uv_rest.as_dvec2();
            return surface.with_fine_uv(upright(uv.into()));
        }
        let [u, v] = hit.uv;
        Surface { uv: upright([u, v].map(f64::from)).as_vec2(), ..half.surface(u, v) }
    }

    /// The surface differential at every point.
    pub fn surface_differential(&self) -> SurfaceDifferential {
        let [corner, u_end, _, v_end] = self.corners();
        let [_, u, v] = triangle::gradients([corner, u_end, v_end]);
        SurfaceDifferential::flat(u, -v)
    }

    /// The box around the parallelogram.
    pub fn bounds(&self) -> Aabb {
        let [a, b, c, d] = self.corners();
        Aabb { min: a.min(b).min(c).min(d), max: a.max(b).max(c).max(d) }
    }

    /// The parallelogram moved by a transform.
    pub fn transformed(&self, t: &Transform) -> Parallelogram {
        let edge = |v: Vec3| t.vector(v.as_dvec3()).as_vec3();
        let corner = t.point(self.corner.as_dvec3()).as_vec3();
        let (u, v) = (edge(self.u), edge(self.v));
        // A mirroring transform turns u × v to the other side of the surface; swapped edges turn it back.
        let (u, v) = if solve::mirrors(t) { (v, u) } else { (u, v) };
        Parallelogram { corner, u, v }
    }

    /// The unit normal on the outer side.
    pub(crate) fn normal(&self) -> DVec3 {
        self.u.as_dvec3().cross(self.v.as_dvec3()).normalize_or_zero()
    }

    pub(crate) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("corner", self.corner)?;
        solve::finite("u", self.u)?;
        solve::finite("v", self.v)?;
        if self.normal() == DVec3::ZERO {
            return Err(OutOfRange::new("u", "and v must be two edges of a rectangle, of different directions"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEET: Parallelogram =
        Parallelogram { corner: Vec3::new(1.0, 2.0, 3.0), u: Vec3::new(4.0, 0.0, 0.0), v: Vec3::new(1.0, 2.0, 0.0) };

    #[test]
    fn it_ends_at_its_edges_and_its_image_stands_upright() {
        for (a, b) in [(0.25, 0.5), (0.75, 0.5), (0.01, 0.99), (0.99, 0.01), (0.5, 0.5)] {
            let p = SHEET.corner + SHEET.u * a + SHEET.v * b;
            let ray = Ray::new(p + Vec3::Z * 4.0, Vec3::NEG_Z);
            let hit = SHEET.intersect(&ray, 100.0).unwrap();
            let surface = SHEET.surface(&ray, &hit);
            assert_eq!((hit.t, surface.normal), (4.0, DVec3::Z));
            assert!((surface.uv.as_dvec2() - DVec2::new(a.into(), 1.0 - f64::from(b))).length() < 1e-6, "{surface:?}");
            assert!((surface.exact - p.as_dvec3()).length() < 1e-6);
        }
        for (a, b) in [(-0.001, 0.5), (1.001, 0.5), (0.5, -0.001), (0.5, 1.001)] {
            let p = SHEET.corner + SHEET.u * a + SHEET.v * b;
            assert_eq!(SHEET.intersect(&Ray::new(p + Vec3::Z, Vec3::NEG_Z), 100.0), None, "{a} {b}");
        }
    }

    /// Rays at the common edge of two rectangles, whose corners are no numbers of few digits.
    #[test]
    fn no_ray_passes_between_neighbours() {
        let (mut random, mut count) = (super::super::testing::Random(4), 0);
        for _ in 0..20_000 {
            let [corner, u, v] = [random.cube(), random.vector(), random.vector()];
            let left = Parallelogram { corner, u, v };
            let [_, from, to, _] = left.corners();
            // The edge of the right one is that of the left one, to the last bit.
            let right = Parallelogram { corner: from, u: random.vector(), v: to - from };
            let target = from + (to - from) * random.unit();
            let origin = target + u.cross(v) + random.cube() * 0.1;
            let ray = Ray::new(origin, target - origin);
            let faces = |sheet: &Parallelogram| sheet.normal().dot(ray.direction.as_dvec3()) < -0.01;
            if right.corners()[3] != to || !faces(&left) || !faces(&right) {
                continue;
            }
            count += 1;
            let met = left.intersect(&ray, 100.0).or(right.intersect(&ray, 100.0));
            assert!(met.is_some(), "{left:?} {right:?} {ray:?}");
        }
        assert!(count > 2000, "{count}");
    }

    #[test]
    fn edges_along_one_line_are_refused() {
        let line = Parallelogram { v: SHEET.u * -2.0, ..SHEET };
        let said = line.check().unwrap_err().to_string();
        assert_eq!(said, "u and v must be two edges of a rectangle, of different directions");
    }
}
