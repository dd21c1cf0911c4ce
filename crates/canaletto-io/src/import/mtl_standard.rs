//! The words of physically based materials in MTL files, as Blender and tinyobjloader write them, on the standard
//! surface.
//!
//! | MTL | standard surface |
//! |---|---|
//! | `Pr`, `Pm` | specular roughness, base metalness |
//! | `Pc`, `Pcr` | weight and roughness of the coat |
//! | `Ps` | weight of the fuzz |
//! | `aniso`, `anisor` | anisotropy, and its rotation in turns |
//!
//! `Kd` is the base colour, `Ni` the index of refraction, `Ke` the emission, and `d` the coverage, or of glass by its
//! `illum` what doesn't pass. `Ks` and `Ns` have no meaning beside these words.

use super::texture_map::MapKind;
use canaletto::material::StandardSurface;

/// The words, in the order of the numbers.
const WORDS: [&[u8]; 7] = [b"pr", b"pm", b"ps", b"pc", b"pcr", b"aniso", b"anisor"];

/// The numbers of a material that are given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PhysicalNumbers([Option<f32>; WORDS.len()]);

impl PhysicalNumbers {
    /// Whether a word in lower case is one of them.
    pub(super) fn takes(&self, word: &[u8]) -> bool {
        WORDS.contains(&word)
    }

    /// Sets the number of a word.
    pub(super) fn set(&mut self, word: &[u8], value: f32) {
        if let Some(index) = WORDS.iter().position(|own| *own == word) {
            self.0[index] = Some(value);
        }
    }

    /// Whether there is any.
    pub(super) fn are_given(&self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    /// The surface with these numbers. What has a picture and no number, or 0, is 1: the picture multiplies it.
    pub(super) fn surface(&self, has: impl Fn(MapKind) -> bool) -> StandardSurface {
        let [roughness, metalness, sheen, coat, coat_roughness, anisotropy, rotation] = self.0;
        let number = |given: Option<f32>, kind: MapKind, default: f32| match given {
            None | Some(0.0) if has(kind) => 1.0,
            given => given.unwrap_or(default).clamp(0.0, 1.0),
        };
        let mut surface = StandardSurface::default();
        let plain = surface.specular.roughness;
        surface.specular.roughness = number(roughness, MapKind::Roughness, plain);
        surface.base.metalness = number(metalness, MapKind::Metalness, 0.0);
        surface.fuzz.weight = number(sheen, MapKind::Sheen, 0.0);
        surface.coat.weight = number(coat, MapKind::Coat, 0.0);
        surface.coat.roughness = number(coat_roughness, MapKind::CoatRoughness, surface.coat.roughness);
        surface.specular.anisotropy = anisotropy.unwrap_or(0.0).clamp(0.0, 1.0);
        surface.specular.anisotropy_rotation = 360.0 * rotation.unwrap_or(0.0);
        surface
    }
}
