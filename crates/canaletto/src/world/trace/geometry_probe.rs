//! The part of a probe that the world calls: it observes textures and occluders, and knows nothing of shading.

use crate::world::{Hit, TextureRead};

/// An observer of what the world evaluates for a ray. An integrator's probe is one, too.
pub trait GeometryProbe {
    /// Whether the probe needs calls at all.
    #[inline]
    fn is_active(&self) -> bool {
        true
    }
    /// A texture was read at the hit that is evaluated.
    fn texture(&mut self, _read: &TextureRead) {}
    /// A surface blocks the light towards a point, in whole or in part. `opacity` is its o.
    fn blocker(&mut self, _hit: &Hit, _opacity: f32) {}
}

/// The empty probe.
impl GeometryProbe for () {
    #[inline]
    fn is_active(&self) -> bool {
        false
    }
}
