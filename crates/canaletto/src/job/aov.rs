//! Extra layers (arbitrary output variables).

use crate::film::{Accumulation, Layer};
use crate::world::World;
use crate::{Named, named};
use serde::{Deserialize, Serialize};

/// An extra layer of the picture.
///
/// Geometry layers (depth to material id) come from the first hit of the first sample, since a mean of two objects has
/// no meaning. Pixels of the background have infinite depth and zeros elsewhere. Light layers (diffuse to refraction)
/// are filtered like the picture, and so is `alpha`. They sum to it, except for `shadow`, which holds the light that
/// shadows remove. `tree-depth` and `cost` count rays. `half-a`, `half-b` and `samples` tell of the samples of a
/// picture that is made in passes. The layers for denoising are means over camera rays of their own, 8 to 32 for a
/// pixel, which perfect mirrors and smooth clear bodies reflect and refract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Aov {
    /// Distance of the point from the eye, even if the ray leaves another point of a lens.
    Depth,
    /// Shading normal on the viewer's side, in world space.
    Normal,
    /// The point in world space. It is `f32`, and so rounded far from zero.
    Position,
    /// Texture coordinates.
    Uv,
    /// [`World::object_id`], which counts objects from 1 on in the order of the file; 0 is the background.
    ObjectId,
    /// 1 + the material's index; 0 is the background.
    MaterialId,
    /// [`World::element_id`], the row of a cloud's table or a mesh's triangle, from 1 on; 0 is the background.
    ElementId,
    /// Σ f_s l ⊗ kd (n·L) at the first hit, and the colours of overlays.
    Diffuse,
    /// Σ f_s l ⊗ ks (r·L)ⁿ at the first hit.
    Specular,
    /// The light that shadows remove at the first hit.
    Shadow,
    /// Iₐ ⊗ kd at the first hit; the background for rays without a hit.
    Ambient,
    /// The radiance that the surface at the first hit emits.
    Emission,
    /// k times the colour of the mirrored ray.
    Reflection,
    /// 1 − o times the colour of the refracted ray, and the light through cut-outs.
    Refraction,
    /// The largest depth in the pixel's ray trees.
    TreeDepth,
    /// The number of rays traced for the pixel, of all kinds.
    Cost,
    /// The share of the background that the pixel hides, 0 to 1. What a camera ray passes without being bent lets it
    /// through: cut-outs, media, thin walls. Clear bodies that bend it don't.
    Alpha,
    /// The picture by the first half of its samples. Both halves estimate the same light, so their difference tells the
    /// error.
    HalfA,
    /// The picture by the second half of its samples.
    HalfB,
    /// The number of the pixel's samples.
    Samples,
    /// The picture itself, which stays as it is when the colours are denoised.
    Noisy,
    /// The share of light that the first rough surface scatters, 0 to 1. Lamps and the background have their colour.
    DenoisingAlbedo,
    /// The shading normal there on the viewer's side, in world space; shorter than 1 where a pixel has several.
    DenoisingNormal,
    /// The length of the way from the eye to there, as a harmonic mean; infinite where all of the pixel is background.
    DenoisingDepth,
}

named!(Aov {
    Depth => "depth",
    Normal => "normal",
    Position => "position",
    Uv => "uv",
    ObjectId => "object-id",
    MaterialId => "material-id",
    ElementId => "element-id",
    Diffuse => "diffuse",
    Specular => "specular",
    Shadow => "shadow",
    Ambient => "ambient",
    Emission => "emission",
    Reflection => "reflection",
    Refraction => "refraction",
    TreeDepth => "tree-depth",
    Cost => "cost",
    Alpha => "alpha",
    HalfA => "half-a",
    HalfB => "half-b",
    Samples => "samples",
    Noisy => "noisy",
    DenoisingAlbedo => "denoising-albedo",
    DenoisingNormal => "denoising-normal",
    DenoisingDepth => "denoising-depth",
});

impl Aov {
    /// Whether the layer tells of the surface that a pixel's first sample sees, or of how much of the background it
    /// hides.
    pub fn is_of_first_hit(self) -> bool {
        matches!(
            self,
            Aov::Depth
                | Aov::Normal
                | Aov::Position
                | Aov::Uv
                | Aov::ObjectId
                | Aov::MaterialId
                | Aov::ElementId
                | Aov::Alpha
        )
    }

    /// Whether the layer tells of the samples of a picture that is made in passes.
    pub fn is_of_samples(self) -> bool {
        self.is_half() || self == Aov::Samples
    }

    /// Whether the layer is the picture by half its samples.
    pub fn is_half(self) -> bool {
        matches!(self, Aov::HalfA | Aov::HalfB)
    }

    /// Whether the layer tells a denoiser of surfaces.
    pub(crate) fn is_feature(self) -> bool {
        matches!(self, Aov::DenoisingAlbedo | Aov::DenoisingNormal | Aov::DenoisingDepth)
    }

    /// Whether the layer is made after the picture, for denoising.
    pub fn is_of_denoising(self) -> bool {
        self.is_feature() || self == Aov::Noisy
    }

    /// Whether the layer holds light, in red, green and blue.
    pub fn is_light(self) -> bool {
        self.channels() == ["R", "G", "B"] && !self.is_feature()
    }

    /// The names of the layer's channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Aov::Depth | Aov::DenoisingDepth => &["Z"],
            Aov::Normal | Aov::Position | Aov::DenoisingNormal => &["X", "Y", "Z"],
            Aov::Uv => &["U", "V"],
            Aov::ObjectId | Aov::MaterialId | Aov::ElementId | Aov::TreeDepth | Aov::Cost | Aov::Samples => &["X"],
            Aov::Alpha => &["A"],
            Aov::Diffuse
            | Aov::Specular
            | Aov::Shadow
            | Aov::Ambient
            | Aov::Emission
            | Aov::Reflection
            | Aov::Refraction
            | Aov::HalfA
            | Aov::HalfB
            | Aov::Noisy
            | Aov::DenoisingAlbedo => &["R", "G", "B"],
        }
    }

    /// Whether the layer holds numbers of objects, materials or elements.
    pub fn is_id(self) -> bool {
        matches!(self, Aov::ObjectId | Aov::MaterialId | Aov::ElementId)
    }

    /// The rule by which the layer's values accumulate where a pixel has several.
    pub(crate) fn accumulation(self) -> Accumulation {
        match self {
            Aov::Depth
            | Aov::Normal
            | Aov::Position
            | Aov::Uv
            | Aov::ObjectId
            | Aov::MaterialId
            | Aov::ElementId
            | Aov::Noisy
            | Aov::DenoisingAlbedo
            | Aov::DenoisingNormal
            | Aov::DenoisingDepth => Accumulation::First,
            Aov::Diffuse
            | Aov::Specular
            | Aov::Shadow
            | Aov::Ambient
            | Aov::Emission
            | Aov::Reflection
            | Aov::Refraction
            | Aov::HalfA
            | Aov::HalfB
            | Aov::Alpha => Accumulation::Mean,
            Aov::TreeDepth => Accumulation::Largest,
            Aov::Cost | Aov::Samples => Accumulation::Sum,
        }
    }

    /// A layer of zeros for a part of the picture.
    pub(crate) fn layer(self, world: &World, width: u32, height: u32) -> Layer {
        /// `f32` represents all integers up to this one.
        const EXACT: u64 = 1 << f32::MANTISSA_DIGITS;
        let (name, channels) = (self.name(), self.channels());
        let pixels = width as usize * height as usize;
        let largest = if self == Aov::ElementId { world.largest_element_id() } else { world.largest_id() };
        let ids = if self.is_id() && largest > EXACT { vec![0; pixels] } else { Vec::new() };
        Layer { name, channels, data: vec![0.0; pixels * channels.len()], ids }
    }
}
