//! Spheres (5.11–5.22).

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// c, its centre.
    pub center: Vec3,
    /// r > 0.
    pub radius: f32,
}
