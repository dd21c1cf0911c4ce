//! Tori.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A torus: a tube around a circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Torus {
    /// Its centre.
    pub center: Vec3,
    /// The direction it is round about; any length but zero.
    pub axis: Vec3,
    /// The circle's radius, > 0.
    pub radius: f32,
    /// The tube's radius, > 0. More than `radius` gives a spindle torus.
    pub tube: f32,
}
