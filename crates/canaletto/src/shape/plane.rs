//! Infinite planes.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A plane without bounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// A point of the plane.
    pub point: Vec3,
    /// The direction of its visible side; any length but zero.
    pub normal: Vec3,
}
