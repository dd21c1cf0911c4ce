//! What surfaces do with light.

mod phong;
mod refract;

pub use phong::Phong;
pub use refract::{reflect, refract};

use crate::math::Rgb;
use crate::shape::Surface;
use serde::{Deserialize, Serialize};

/// A named material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// The name that objects refer to.
    pub name: String,
    /// The model and its numbers.
    pub phong: Phong,
}

impl Material {
    /// The material with its numbers for one point of a surface.
    pub fn at(&self, surface: &Surface) -> MaterialPoint {
        MaterialPoint { phong: Phong { kd: surface.color.unwrap_or(self.phong.kd), ..self.phong } }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// A sentence that names the number, its value and the range.
    pub fn check(&self) -> Result<(), String> {
        self.phong.check()
    }
}

/// A material evaluated at a point: all that an integrator sees of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialPoint {
    /// The Phong model's numbers here.
    pub phong: Phong,
}

impl MaterialPoint {
    /// Whether light passes: o < 1.
    pub fn is_clear(&self) -> bool {
        self.phong.opacity < 1.0
    }

    /// Whether a reflected ray counts: k ≠ 0.
    pub fn is_mirror(&self) -> bool {
        !self.phong.k.is_black()
    }

    /// (5.32): kd ⊗ l (n·L).
    pub fn diffuse(&self, intensity: Rgb, n_dot_l: f32) -> Rgb {
        (intensity * self.phong.kd).saturated() * n_dot_l
    }
}
