//! Flat disks.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A flat round disk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Disk {
    /// Its centre.
    pub center: Vec3,
    /// The direction of its visible side; any length but zero.
    pub normal: Vec3,
    /// r > 0.
    pub radius: f32,
}
