//! Shadows without rays, as from shadow maps.

use glam::{DVec3, Vec3};

/// Shadows that are known without rays.
pub(crate) trait ShadowLookup: Sync {
    /// The share of a light that reaches a point with this unit geometric normal on the viewer's side. `ray` holds the
    /// origin and the direction of the shadow ray, which ends at `t_max`.
    fn passed(&self, light: u32, ray: [Vec3; 2], t_max: f32, point: DVec3, normal: DVec3) -> f32;
}
