//! Cylinders between two points (exercise 14). Parts are side 0, base 1 and top 2; the module `frustum` describes their
//! texture coordinates.

use super::frustum::Frustum;
use super::solve;
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cylinder {
    /// The centre of one end.
    pub base: Vec3,
    /// The centre of the other end; not `base`.
    pub top: Vec3,
    /// The radius r > 0.
    pub radius: f32,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}

impl Cylinder {
    fn frustum(&self) -> Frustum {
        Frustum::new(self.base, self.top, self.radius, self.radius, self.caps)
    }

    /// The nearest hit with t in (0, t_max], from outside or inside.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        self.frustum().intersect(ray, t_max)
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        self.frustum().surface(line.into(), hit)
    }

    /// The surface differential at a hit with this surface.
    pub fn surface_differential(&self, surface: &Surface, hit: &ShapeHit) -> SurfaceDifferential {
        self.frustum().surface_differential(surface, hit)
    }

    /// The box around the cylinder.
    pub fn bounds(&self) -> Aabb {
        self.frustum().bounds()
    }

    /// The cylinder moved by a transform, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Cylinder> {
        let scale = t.uniform_scale()?;
        let [base, top] = [self.base, self.top].map(|p| t.point(p.as_dvec3()).as_vec3());
        Some(Cylinder { base, top, radius: (f64::from(self.radius) * scale) as f32, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::ends(self.base, self.top)?;
        solve::positive("radius", self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Random;
    use super::*;
    use glam::DMat3;

    const INF: f32 = f32::INFINITY;

    /// All hits with their parts by exercise 14's suggestion: the ray is transformed to the canonical cylinder on the
    /// origin, along +z with radius and height 1. The parameters t are unchanged there.
    fn canonical(c: &Cylinder, ray: &Ray) -> Vec<(f64, u32)> {
        let axis = c.top.as_dvec3() - c.base.as_dvec3();
        let (x, y) = axis.normalize().any_orthonormal_pair();
        let r = f64::from(c.radius);
        let back = DMat3::from_cols(x * r, y * r, axis).inverse();
        let (o, d) = (back * (ray.origin.as_dvec3() - c.base.as_dvec3()), back * ray.direction.as_dvec3());
        let mut hits = Vec::new();
        let (a, b) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
        let discriminant = b * b - a * (o.x * o.x + o.y * o.y - 1.0);
        for sign in [-1.0, 1.0] {
            let t = (-b + sign * discriminant.sqrt()) / a;
            if (0.0..=1.0).contains(&(o.z + t * d.z)) {
                hits.push((t, 0));
            }
        }
        for (part, z) in [(1, 0.0), (2, 1.0)] {
            let t = (z - o.z) / d.z;
            let p = o + d * t;
            if c.caps && p.x * p.x + p.y * p.y <= 1.0 {
                hits.push((t, part));
            }
        }
        hits.retain(|h| h.0 > 0.0);
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits
    }

    #[test]
    fn exercise_14_in_canonical_position() {
        let (mut random, mut met) = (Random(14), [0; 3]);
        for i in 0..20_000 {
            let (base, top, radius) = (random.cube(), random.cube() * 3.0, random.within(0.1, 1.5));
            let cylinder = Cylinder { base, top, radius, caps: i % 2 == 0 };
            let origin = random.cube() * 4.0;
            let ray = Ray::new(origin, random.cube() * 2.0 - origin);
            let expected = canonical(&cylinder, &ray).first().copied();
            let found = cylinder.intersect(&ray, INF).map(|h| (f64::from(h.t), h.part));
            match (expected, found) {
                (None, None) => {}
                (Some(e), Some(f)) if (e.0 - f.0).abs() < 1e-5 * e.0.max(1.0) && e.1 == f.1 => met[e.1 as usize] += 1,
                _ => panic!("{cylinder:?} {ray:?}: {found:?}, not {expected:?}"),
            }
        }
        assert!(met.iter().all(|n| *n > 100), "{met:?}");
    }

    #[test]
    fn an_open_cylinder_shows_its_inside() {
        let open = Cylinder { base: Vec3::ZERO, top: Vec3::Y * 4.0, radius: 1.0, caps: false };
        let ray = Ray::new(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.5, -1.0, 0.0));
        let hit = open.intersect(&ray, INF).unwrap();
        assert_eq!((hit.t, hit.part), (2.0, SIDE));
        // The normal still points outwards.
        assert_eq!(open.surface(&ray, &hit).normal.as_vec3(), Vec3::X);
        let closed = Cylinder { caps: true, ..open };
        assert_eq!(closed.intersect(&ray, INF).map(|h| (h.t, h.part)), Some((1.0, TOP)));
        // A ray along the axis hits nothing.
        assert_eq!(open.intersect(&Ray::new(Vec3::new(0.5, 5.0, 0.0), Vec3::NEG_Y), INF), None);
    }

    const SIDE: u32 = 0;
    const TOP: u32 = 2;

    #[test]
    fn texture_coordinates_of_side_and_caps() {
        let cylinder = Cylinder { base: Vec3::ZERO, top: Vec3::Y * 4.0, radius: 1.0, caps: true };
        let uv = |o: Vec3, d: Vec3| {
            let ray = Ray::new(o, d);
            cylinder.surface(&ray, &cylinder.intersect(&ray, INF).unwrap()).uv.to_array()
        };
        assert_eq!(uv(Vec3::new(0.0, 3.0, 5.0), Vec3::NEG_Z), [0.5, 0.25]);
        assert_eq!(uv(Vec3::new(5.0, 3.0, 0.0), Vec3::NEG_X), [0.75, 0.25]);
        assert_eq!(uv(Vec3::new(0.5, 9.0, 0.0), Vec3::NEG_Y), [0.75, 0.5]);
        assert_eq!(uv(Vec3::new(0.0, 9.0, 0.5), Vec3::NEG_Y), [0.5, 0.75]);
        assert_eq!(uv(Vec3::new(0.0, -9.0, 0.5), Vec3::Y), [0.5, 0.25]);
    }

    #[test]
    fn a_thin_cylinder_far_away_is_met() {
        let at = Vec3::new(1e6, 0.0, 0.0);
        let thin = Cylinder { base: at, top: at + Vec3::Y * 1e4, radius: 0.25, caps: true };
        let hit = thin.intersect(&Ray::new(Vec3::new(0.0, 5e3, 0.0), Vec3::X), INF).unwrap();
        assert_eq!(hit.t, 1e6 - 0.25);
        assert_eq!(thin.intersect(&Ray::new(Vec3::new(0.0, 5e3, 0.3), Vec3::X), INF), None);
    }

    #[test]
    fn a_ray_in_a_caps_plane_passes() {
        let cylinder = Cylinder { base: Vec3::ZERO, top: Vec3::Y * 4.0, radius: 1.0, caps: true };
        for y in [0.0, 4.0] {
            assert_eq!(cylinder.intersect(&Ray::new(Vec3::new(0.0, y, 0.5), Vec3::X), INF), None);
        }
    }

    #[test]
    fn an_axis_needs_two_points() {
        let point = Cylinder { base: Vec3::ONE, top: Vec3::ONE, radius: 1.0, caps: true };
        assert_eq!(
            point.check().unwrap_err().to_string(),
            "base and top are both 1 1 1; they must be different points"
        );
    }
}
