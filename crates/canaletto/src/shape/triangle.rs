//! Triangles (5.23–5.31).

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A triangle, counter-clockwise seen from its visible side (5.23).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Triangle {
    /// First corner.
    pub a: Vec3,
    /// Second corner.
    pub b: Vec3,
    /// Third corner.
    pub c: Vec3,
    /// Whether rays from behind pass through.
    pub one_sided: bool,
}
