//! Cones and truncated cones. Parts and texture coordinates: side 0, base 1, top 2, as described in the module
//! `frustum`.

use super::frustum::Frustum;
use super::solve;
use super::{ShapeHit, Surface};
use crate::math::Transform;
use canaletto_bvh::{Aabb, Ray};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A cone, or a truncated one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cone {
    /// Centre of the base.
    pub base: Vec3,
    /// The apex, or the centre of the upper end; not `base`.
    pub top: Vec3,
    /// Radius at the base, ≥ 0.
    pub radius: f32,
    /// Radius at the top, ≥ 0; not both radii are 0.
    pub top_radius: f32,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}

impl Cone {
    fn frustum(&self) -> Frustum {
        Frustum::new(self.base, self.top, self.radius, self.top_radius, self.caps)
    }

    /// The nearest t in (0, t_max], from outside or inside.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        self.frustum().intersect(ray, t_max)
    }

    /// The surface at a hit.
    pub fn surface(&self, ray: &Ray, hit: &ShapeHit) -> Surface {
        self.frustum().surface(ray, hit)
    }

    /// The box around it.
    pub fn bounds(&self) -> Aabb {
        self.frustum().bounds()
    }

    /// The cone moved, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Cone> {
        let scale = t.uniform_scale()?;
        let [base, top] = [self.base, self.top].map(|p| t.point(p.as_dvec3()).as_vec3());
        let [radius, top_radius] = [self.radius, self.top_radius].map(|r| (f64::from(r) * scale) as f32);
        Some(Cone { base, top, radius, top_radius, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), String> {
        solve::ends(self.base, self.top)?;
        for (name, r) in [("radius", self.radius), ("top-radius", self.top_radius)] {
            if !r.is_finite() || r < 0.0 {
                return Err(format!("{name} is {r}; it must be 0 or more and finite"));
            }
        }
        if self.radius == 0.0 && self.top_radius == 0.0 {
            return Err("radius and top-radius are both 0; one of them must be more than 0".into());
        }
        Ok(())
    }
}
