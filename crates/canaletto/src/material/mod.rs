//! What surfaces do with light.

mod bump;
mod mapping;
mod microfacet;
mod phong;
mod refract;
mod texture_use;

pub use bump::{bumped, clamp_to_hemisphere, tilted};
pub use mapping::{Mapping, Place, Projection, Repeat, Space, TexCoord, TexCoords};
pub use microfacet::{reflect_into_hemisphere, sample_ggx_vndf};
pub use phong::Phong;
pub(crate) use phong::highlights;
pub use refract::{reflect, refract};
pub use texture_use::{Channel, Target, TextureUse};

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
    /// The share of the surface that is there, 0 (nothing) to 1: alpha of glTF, `d` of MTL. The rest is open: what is
    /// behind is seen straight on, by 1 − coverage, and nothing of it is shaded. Opacity is another thing, that of glass,
    /// whose surface shades as a whole.
    #[serde(default = "whole")]
    pub coverage: f32,
    /// Which clear body fills the place where several overlap: the one with the largest number; among equals the one
    /// with the smallest volume. Any finite number.
    #[serde(default)]
    pub priority: f32,
    /// What textures change of it, in this order.
    #[serde(default)]
    pub textures: Vec<TextureUse>,
}

/// The coverage of surfaces without holes.
fn whole() -> f32 {
    1.0
}

impl Default for Material {
    fn default() -> Material {
        Material {
            name: String::new(),
            phong: Phong::default(),
            coverage: whole(),
            priority: 0.0,
            textures: Vec::new(),
        }
    }
}

impl Material {
    /// A material without textures.
    pub fn new(name: impl Into<String>, phong: Phong) -> Material {
        Material { name: name.into(), phong, ..Material::default() }
    }

    /// The same material with this share of the surface there.
    pub fn with_coverage(self, coverage: f32) -> Material {
        Material { coverage, ..self }
    }

    /// The same material with this priority where clear bodies overlap.
    pub fn with_priority(self, priority: f32) -> Material {
        Material { priority, ..self }
    }

    /// The same material with one more texture.
    pub fn with_texture(mut self, texture: TextureUse) -> Material {
        self.textures.push(texture);
        self
    }

    /// The material with its numbers for one point of a surface, before any texture.
    #[inline]
    pub fn at(&self, surface: &Surface) -> MaterialPoint {
        let mut point = MaterialPoint::default();
        self.set(&mut point, surface.color);
        point
    }

    /// Makes `point` the same for a surface that brings this colour, or none.
    #[inline]
    pub(crate) fn set(&self, point: &mut MaterialPoint, color: Option<Rgb>) {
        let MaterialPoint { phong, overlay, coverage, bent } = point;
        *phong = self.phong;
        if let Some(color) = color {
            phong.kd = color;
        }
        (*overlay, *coverage, *bent) = ((Rgb::BLACK, 0.0), self.coverage, false);
    }

    /// Whether all surfaces made of it are there, at least in part, and the same everywhere.
    #[inline]
    pub(crate) fn is_plain(&self) -> bool {
        self.textures.is_empty() && self.coverage > 0.0
    }

    /// Whether it lets no light through anywhere.
    #[inline]
    pub fn is_opaque(&self) -> bool {
        self.phong.opacity >= 1.0
            && self.coverage >= 1.0
            && !self.textures.iter().any(|texture| texture.target.clears())
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// A sentence that names the number, its value and the range.
    pub fn check(&self) -> Result<(), String> {
        self.phong.check()?;
        if !(0.0..=1.0).contains(&self.coverage) {
            return Err(format!(
                "coverage is {}; it must be between 0 (nothing is there) and 1 (all of it)",
                self.coverage
            ));
        }
        if !self.priority.is_finite() {
            return Err(format!("priority is {}; it must be finite", self.priority));
        }
        self.textures
            .iter()
            .try_for_each(|texture| texture.check().map_err(|e| format!("texture for {}: {e}", texture.target.name())))
    }
}

/// A material evaluated at a point: all that an integrator sees of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialPoint {
    /// The Phong model's numbers here.
    pub phong: Phong,
    /// A colour over the shaded one and its share, 0 to 1; a share of 1 leaves nothing to shade.
    pub overlay: (Rgb, f32),
    /// The share of the surface that is there, 0 (a hole) to 1.
    pub coverage: f32,
    /// Whether a texture bent the shading normal.
    pub bent: bool,
}

impl Default for MaterialPoint {
    fn default() -> MaterialPoint {
        MaterialPoint { phong: Phong::default(), overlay: (Rgb::BLACK, 0.0), coverage: 1.0, bent: false }
    }
}

impl MaterialPoint {
    /// Whether anything but a print is seen.
    #[inline]
    pub fn is_seen(&self) -> bool {
        self.overlay.1 < 1.0
    }

    /// Whether light passes: o < 1.
    #[inline]
    pub fn is_clear(&self) -> bool {
        self.phong.opacity < 1.0
    }

    /// Whether a reflected ray counts: k ≠ 0.
    #[inline]
    pub fn is_mirror(&self) -> bool {
        !self.phong.k.is_black()
    }

    /// What it keeps of light that crosses it: o of the share that is there.
    pub fn blocked(&self) -> f32 {
        if self.coverage < 1.0 { self.coverage * self.phong.opacity } else { self.phong.opacity }
    }
}
