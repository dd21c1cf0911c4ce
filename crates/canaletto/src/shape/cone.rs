//! Cones and truncated cones. Parts are side 0, base 1 and top 2; the module `frustum` describes their texture
//! coordinates.

use super::frustum::Frustum;
use super::solve;
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A cone, or a truncated one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cone {
    /// The centre of the base.
    pub base: Vec3,
    /// The apex, or the centre of the upper end; not `base`.
    pub top: Vec3,
    /// The radius at the base, ≥ 0.
    pub radius: f32,
    /// The radius at the top, ≥ 0. At least one of both radii is above 0.
    pub top_radius: f32,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}

impl Cone {
    fn frustum(&self) -> Frustum {
        Frustum::new(self.base, self.top, self.radius, self.top_radius, self.caps)
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

    /// The box around the cone.
    pub fn bounds(&self) -> Aabb {
        self.frustum().bounds()
    }

    /// The cone moved by a transform, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Cone> {
        let scale = t.uniform_scale()?;
        let [base, top] = [self.base, self.top].map(|p| t.point(p.as_dvec3()).as_vec3());
        let [radius, top_radius] = [self.radius, self.top_radius].map(|r| (f64::from(r) * scale) as f32);
        Some(Cone { base, top, radius, top_radius, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::ends(self.base, self.top)?;
        for (name, r) in [("radius", self.radius), ("top-radius", self.top_radius)] {
            if !r.is_finite() || r < 0.0 {
                return Err(OutOfRange::new(name, format!("is {r}; it must be 0 or more and finite")));
            }
        }
        if self.radius == 0.0 && self.top_radius == 0.0 {
            return Err(OutOfRange::new("radius", "and top-radius are both 0; one of them must be more than 0"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f32 = f32::INFINITY;
    const CONE: Cone =
        Cone { base: Vec3::ZERO, top: Vec3::new(0.0, 2.0, 0.0), radius: 1.0, top_radius: 0.0, caps: true };

    fn first(cone: &Cone, o: [f32; 3], d: [f32; 3]) -> Option<(f32, u32)> {
        cone.intersect(&Ray::new(o.into(), d.into()), INF).map(|h| (h.t, h.part))
    }

    #[test]
    fn the_side_is_met_at_half_height_and_half_radius() {
        assert_eq!(first(&CONE, [5.0, 1.0, 0.0], [-1.0, 0.0, 0.0]), Some((4.5, 0)));
        let ray = Ray::new(Vec3::new(5.0, 1.0, 0.0), Vec3::NEG_X);
        let s = CONE.surface(&ray, &CONE.intersect(&ray, INF).unwrap());
        let n = Vec3::new(2.0, 1.0, 0.0).normalize();
        assert!(s.normal.as_vec3().distance(n) < 1e-7, "{s:?}");
        assert_eq!(s.uv.to_array(), [0.75, 0.5]);
    }

    #[test]
    fn there_is_no_ghost_beyond_the_apex() {
        for caps in [true, false] {
            let cone = Cone { caps, ..CONE };
            assert_eq!(first(&cone, [5.0, 3.0, 0.0], [-1.0, 0.0, 0.0]), None);
            // A ray steeper than the side: it passes through the ghost cone beyond the apex, then into the cone.
            let (t, part) = first(&cone, [0.125, 4.0, 0.0], [0.0, -1.0, 0.0]).unwrap();
            assert_eq!((t, part), (2.25, 0));
        }
    }

    #[test]
    fn caps_close_the_base() {
        assert_eq!(first(&CONE, [0.25, -1.0, 0.0], [0.0, 1.0, 0.0]), Some((1.0, 1)));
        let open = Cone { caps: false, ..CONE };
        assert_eq!(first(&open, [0.25, -1.0, 0.0], [0.0, 1.0, 0.0]), Some((2.5, 0)));
    }

    #[test]
    fn a_truncated_cone_has_a_top() {
        let cone = Cone { top_radius: 0.5, ..CONE };
        assert_eq!(first(&cone, [0.25, 5.0, 0.25], [0.0, -1.0, 0.0]), Some((3.0, 2)));
        assert_eq!(first(&cone, [0.75, 5.0, 0.0], [0.0, -1.0, 0.0]), Some((4.0, 0)));
    }

    #[test]
    fn a_ray_along_a_generator_meets_the_far_side() {
        // Parallel to the side at x < 0, inside: the quadratic is linear.
        assert_eq!(first(&CONE, [-0.5, 0.0, 0.0], [1.0, 2.0, 0.0]).map(|h| h.1), Some(0));
        assert_eq!(first(&CONE, [-0.5, -1.0, 0.0], [0.5, 1.0, 0.0]), Some((1.0, 1)));
    }

    #[test]
    fn the_apex_has_a_normal() {
        let ray = Ray::new(Vec3::new(0.0, 5.0, 0.0), Vec3::NEG_Y);
        let hit = CONE.intersect(&ray, INF).unwrap();
        let s = CONE.surface(&ray, &hit);
        assert_eq!(s.point, CONE.top);
        assert!((s.normal.length() - 1.0).abs() < 1e-6 && s.uv.is_finite(), "{s:?}");
    }

    #[test]
    fn a_needle_is_refused() {
        let error = Cone { radius: 0.0, ..CONE }.check().unwrap_err().to_string();
        assert_eq!(error, "radius and top-radius are both 0; one of them must be more than 0");
    }
}
