//! Axis-aligned boxes (fig. 5.16).

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cuboid {
    /// The corner of smallest coordinates.
    pub min: Vec3,
    /// The corner of largest coordinates; not below `min` anywhere.
    pub max: Vec3,
}
