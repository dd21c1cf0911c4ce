//! Cylinders between two points (exercise 14).

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
