//! Clouds: millions of exact spheres or cylinders as one object.

use crate::math::Rgb;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Many spheres of one object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SphereCloud {
    /// The file or node it came from, for messages.
    pub name: String,
    /// The centres.
    pub centers: Vec<Vec3>,
    /// One radius for all, or one for each centre; > 0.
    pub radii: Vec<f32>,
    /// A colour for each centre that replaces kd, or nothing.
    pub colors: Vec<Rgb>,
}

/// Many cylinders of one object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CylinderCloud {
    /// The file or node it came from, for messages.
    pub name: String,
    /// The two ends of each axis.
    pub axes: Vec<[Vec3; 2]>,
    /// One radius for all, or one for each axis; > 0.
    pub radii: Vec<f32>,
    /// A colour for each axis that replaces kd, or nothing.
    pub colors: Vec<Rgb>,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}
