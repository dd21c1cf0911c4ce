//! The numbers and colours of standard surfaces in one table. The scene text, range checks and presets read it.

use super::StandardSurface;
use crate::math::Rgb;
use crate::{OutOfRange, named};

/// A block of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StandardBlock {
    /// What a metal mirrors, or what a dielectric scatters inside.
    Base,
    /// The reflection of the base.
    Specular,
    /// The clear part of a dielectric base.
    Transmission,
    /// The translucent part of an opaque base.
    Subsurface,
    /// A clear coat over the base.
    Coat,
    /// Fibres over all.
    Fuzz,
    /// A film on the base.
    ThinFilm,
    /// The light that the surface emits.
    Emission,
}

named!(StandardBlock {
    Base => "base",
    Specular => "specular",
    Transmission => "transmission",
    Subsurface => "subsurface",
    Coat => "coat",
    Fuzz => "fuzz",
    ThinFilm => "thin-film",
    Emission => "emission",
});

impl StandardBlock {
    /// What the block describes, for the reference of the scene text.
    pub const fn doc(self) -> &'static str {
        match self {
            StandardBlock::Base => "the base: what a metal mirrors, or what a dielectric scatters inside",
            StandardBlock::Specular => "the reflection of the base",
            StandardBlock::Transmission => "the clear part of a dielectric base",
            StandardBlock::Subsurface => "the translucent part of an opaque base, whose light leaves where it enters",
            StandardBlock::Coat => "a clear coat over the base",
            StandardBlock::Fuzz => "fibres over all, as on cloth and dust",
            StandardBlock::ThinFilm => "a film on the base, as thin as wavelengths are: the colours of soap bubbles",
            StandardBlock::Emission => "the light that the surface emits",
        }
    }
}

/// A number or colour of a standard surface.
pub struct StandardParameter {
    /// The block.
    pub block: StandardBlock,
    /// The name in its block.
    pub name: &'static str,
    /// The meaning, for the reference of the scene text.
    pub doc: &'static str,
    field: Field,
}

/// The field that holds a parameter.
enum Field {
    /// A colour whose components are in this range.
    Color(fn(&mut StandardSurface) -> &mut Rgb, Range),
    /// A number in this range.
    Number(fn(&mut StandardSurface) -> &mut f32, Range),
}

/// The range of a number.
#[derive(Clone, Copy)]
enum Range {
    /// 0 or more.
    NonNegative,
    /// More than 0.
    Positive,
    /// From 0 to 1.
    Unit,
}

use Field::{Color, Number};
use Range::{NonNegative, Positive, Unit};
use StandardBlock as B;

/// The table, block by block.
#[rustfmt::skip]
static TABLE: [StandardParameter; 30] = [
    row(B::Base, "weight", "the factor of the colour, 0 to 1", Number(|s| &mut s.base.weight, Unit)),
    row(B::Base, "color", "the diffuse colour, or a metal's colour seen at right angles, 0 to 1",
        Color(|s| &mut s.base.color, Unit)),
    row(B::Base, "metalness", "the share that is metal: 0 dielectric, 1 metal",
        Number(|s| &mut s.base.metalness, Unit)),
    row(B::Base, "diffuse-roughness", "the roughness of diffuse reflection, 0 (Lambert's) to 1 (flat, as of the moon)",
        Number(|s| &mut s.base.diffuse_roughness, Unit)),
    row(B::Specular, "weight", "the factor of the reflection at right angles",
        Number(|s| &mut s.specular.weight, NonNegative)),
    row(B::Specular, "color", "the tint of a dielectric's reflection, or of a metal's at its rim (82°), 0 to 1",
        Color(|s| &mut s.specular.color, Unit)),
    row(B::Specular, "roughness", "0 polished to 1 rough; the facets' width is its square",
        Number(|s| &mut s.specular.roughness, Unit)),
    row(B::Specular, "ior", "the coefficient of refraction of a dielectric, more than 0",
        Number(|s| &mut s.specular.ior, Positive)),
    row(B::Specular, "anisotropy", "how far highlights are stretched along the surface's u, as on brushed metal, 0 to 1",
        Number(|s| &mut s.specular.anisotropy, Unit)),
    row(B::Transmission, "weight", "the share of a dielectric that is clear, 0 to 1",
        Number(|s| &mut s.transmission.weight, Unit)),
    row(B::Transmission, "color", "the colour of white light that has passed `depth`, 0 to 1",
        Color(|s| &mut s.transmission.color, Unit)),
    row(B::Transmission, "depth", "that length; 0 tints light where it crosses the surface",
        Number(|s| &mut s.transmission.depth, NonNegative)),
    row(B::Transmission, "dispersion-scale", "the amount of dispersion, 0 to 1; it divides the Abbe number",
        Number(|s| &mut s.transmission.dispersion_scale, Unit)),
    row(B::Transmission, "dispersion-abbe-number", "the Abbe number: the smaller, the wider the rainbow",
        Number(|s| &mut s.transmission.dispersion_abbe_number, Positive)),
    row(B::Subsurface, "weight", "the share of an opaque dielectric that is translucent, 0 to 1",
        Number(|s| &mut s.subsurface.weight, Unit)),
    row(B::Subsurface, "color", "the colour that it reflects, 0 to 1", Color(|s| &mut s.subsurface.color, Unit)),
    row(B::Coat, "weight", "the share of the surface that has a coat, 0 to 1", Number(|s| &mut s.coat.weight, Unit)),
    row(B::Coat, "color", "what is left of white light that passes the coat twice, 0 to 1",
        Color(|s| &mut s.coat.color, Unit)),
    row(B::Coat, "roughness", "0 polished to 1 rough", Number(|s| &mut s.coat.roughness, Unit)),
    row(B::Coat, "anisotropy", "how far its highlights are stretched along the surface's u, 0 to 1",
        Number(|s| &mut s.coat.anisotropy, Unit)),
    row(B::Coat, "ior", "the coefficient of refraction, more than 0", Number(|s| &mut s.coat.ior, Positive)),
    row(B::Coat, "darkening", "how far reflections inside the coat darken the base: 0 not at all, 1 as physics has it",
        Number(|s| &mut s.coat.darkening, Unit)),
    row(B::Fuzz, "weight", "the share of the surface that has fuzz, 0 to 1", Number(|s| &mut s.fuzz.weight, Unit)),
    row(B::Fuzz, "color", "the colour of the fibres, 0 to 1", Color(|s| &mut s.fuzz.color, Unit)),
    row(B::Fuzz, "roughness", "0 upright fibres, bright at the rim, to 1 dust", Number(|s| &mut s.fuzz.roughness, Unit)),
    row(B::ThinFilm, "weight", "the share of the base that has a film, 0 to 1",
        Number(|s| &mut s.thin_film.weight, Unit)),
    row(B::ThinFilm, "thickness", "the thickness in micrometres", Number(|s| &mut s.thin_film.thickness, NonNegative)),
    row(B::ThinFilm, "ior", "the coefficient of refraction, more than 0", Number(|s| &mut s.thin_film.ior, Positive)),
    row(B::Emission, "radiance", "the radiance from the outer side; 1 looks white",
        Number(|s| &mut s.emission.radiance, NonNegative)),
    row(B::Emission, "color", "its factor in red, green and blue", Color(|s| &mut s.emission.color, NonNegative)),
];

const fn row(block: StandardBlock, name: &'static str, doc: &'static str, field: Field) -> StandardParameter {
    StandardParameter { block, name, doc, field }
}

impl StandardParameter {
    /// The whole table.
    pub const ALL: &'static [StandardParameter] = &TABLE;

    /// Whether the parameter is a colour.
    pub const fn is_color(&self) -> bool {
        matches!(self.field, Field::Color(..))
    }

    /// The components of the value: three of a colour, or one.
    pub fn get(&self, surface: &StandardSurface) -> Vec<f32> {
        let mut surface = *surface;
        match self.field {
            Color(field, _) => field(&mut surface).to_array().to_vec(),
            Number(field, _) => vec![*field(&mut surface)],
        }
    }

    /// Sets a colour; a number becomes its red component.
    pub fn set(&self, surface: &mut StandardSurface, value: Rgb) {
        match self.field {
            Color(field, _) => *field(surface) = value,
            Number(field, _) => *field(surface) = value.r,
        }
    }

    /// Checks the value's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the parameter, its value and the range.
    pub fn check(&self, surface: &StandardSurface) -> Result<(), OutOfRange> {
        let (Color(_, range) | Number(_, range)) = self.field;
        match self.get(surface).into_iter().find(|value| !range.contains(*value)) {
            Some(value) => Err(OutOfRange::new(self.name, format!("is {value}; it must be {}", range.words()))),
            None => Ok(()),
        }
    }
}

impl Range {
    fn contains(self, v: f32) -> bool {
        match self {
            NonNegative => v.is_finite() && v >= 0.0,
            Positive => v.is_finite() && v > 0.0,
            Unit => (0.0..=1.0).contains(&v),
        }
    }

    fn words(self) -> &'static str {
        match self {
            NonNegative => "0 or more",
            Positive => "more than 0",
            Unit => "between 0 and 1",
        }
    }
}

impl std::fmt::Debug for StandardParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} {}", self.block, self.name)
    }
}
