//! Cylinders between two points (exercise 14). Parts and texture coordinates: side 0, base 1, top 2, as described in
//! the module `frustum`.

use super::frustum::Frustum;
use super::solve;
use super::{ShapeHit, Surface};
use crate::math::Transform;
use canaletto_bvh::{Aabb, Ray};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cylinder {
    /// Centre of one end.
    pub base: Vec3,
    /// Centre of the other end; not `base`.
    pub top: Vec3,
    /// r > 0.
    pub radius: f32,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}

impl Cylinder {
    fn frustum(&self) -> Frustum {
        Frustum::new(self.base, self.top, self.radius, self.radius, self.caps)
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

    /// The cylinder moved, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Cylinder> {
        let scale = t.uniform_scale()?;
        let [base, top] = [self.base, self.top].map(|p| t.point(p.as_dvec3()).as_vec3());
        Some(Cylinder { base, top, radius: (f64::from(self.radius) * scale) as f32, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), String> {
        solve::ends(self.base, self.top)?;
        solve::positive("radius", self.radius)
    }
}
