//! Cones and truncated cones.

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
