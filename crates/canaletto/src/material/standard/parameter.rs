//! The numbers and colours of standard surfaces in one table. The scene text, range checks and presets read it.

use super::StandardSurface;
use crate::math::Rgb;
use crate::{OutOfRange, named};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
    /// The name as the target of a texture in scene text; none for numbers that are constant on a surface.
    pub target: Option<&'static str>,
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
    /// From −1 to 1.
    Signed,
    /// Any finite number.
    Finite,
}

use Field::{Color, Number};
use Range::{Finite, NonNegative, Positive, Signed, Unit};
use StandardBlock as B;

const TABLE_LEN: usize = 33;

/// The table, block by block.
#[rustfmt::skip]
static TABLE: [StandardParameter; TABLE_LEN] = [
    row(B::Base, "weight", "the factor of the colour, 0 to 1", Number(|s| &mut s.base.weight, Unit))
        .target("base-weight"),
    row(B::Base, "color", "the diffuse colour, or a metal's colour seen at right angles, 0 to 1",
        Color(|s| &mut s.base.color, Unit)),
    row(B::Base, "metalness", "the share that is metal: 0 dielectric, 1 metal",
        Number(|s| &mut s.base.metalness, Unit)).target("metalness"),
    row(B::Base, "diffuse-roughness", "the roughness of diffuse reflection, 0 (Lambert's) to 1 (flat, as of the moon)",
        Number(|s| &mut s.base.diffuse_roughness, Unit)).target("diffuse-roughness"),
    row(B::Specular, "weight", "the factor of the reflection at right angles",
        Number(|s| &mut s.specular.weight, NonNegative)).target("specular-weight"),
    row(B::Specular, "color", "the tint of a dielectric's reflection, or of a metal's at its rim (82°), 0 to 1",
        Color(|s| &mut s.specular.color, Unit)).target("specular-color"),
    row(B::Specular, "roughness", "0 polished to 1 rough; the facets' width is its square",
        Number(|s| &mut s.specular.roughness, Unit)),
    row(B::Specular, "ior", "the coefficient of refraction of a dielectric, more than 0",
        Number(|s| &mut s.specular.ior, Positive)),
    row(B::Specular, "anisotropy", 
        "how far highlights are stretched along the surface's u, as on brushed metal, 0 to 1",
        Number(|s| &mut s.specular.anisotropy, Unit)).target("specular-anisotropy"),
    row(B::Specular, "anisotropy-rotation",
        "the angle in degrees from the surface's u to the direction that they are stretched along, counter-clockwise",
        Number(|s| &mut s.specular.anisotropy_rotation, Finite)),
    row(B::Transmission, "weight", "the share of a dielectric that is clear, 0 to 1",
        Number(|s| &mut s.transmission.weight, Unit)).target("transmission-weight"),
    row(B::Transmission, "color", "the colour of white light that has passed `depth`, 0 to 1",
        Color(|s| &mut s.transmission.color, Unit)).target("transmission-color"),
    row(B::Transmission, "depth", "that length; 0 tints light where it crosses the surface",
        Number(|s| &mut s.transmission.depth, NonNegative)),
    row(B::Transmission, "tint", "what each crossing of the surface leaves of white light, whatever the depth, 0 to 1",
        Color(|s| &mut s.transmission.tint, Unit)).target("transmission-tint"),
    row(B::Transmission, "dispersion-scale", "the amount of dispersion, 0 to 1; it divides the Abbe number",
        Number(|s| &mut s.transmission.dispersion_scale, Unit)),
    row(B::Transmission, "dispersion-abbe-number", "the Abbe number: the smaller, the wider the rainbow",
        Number(|s| &mut s.transmission.dispersion_abbe_number, Positive)),
    row(B::Subsurface, "weight", "the share of an opaque dielectric that is translucent, 0 to 1",
        Number(|s| &mut s.subsurface.weight, Unit)).target("subsurface-weight"),
    row(B::Subsurface, "color", "the colour that it reflects, 0 to 1", Color(|s| &mut s.subsurface.color, Unit))
        .target("subsurface-color"),
    row(B::Subsurface, "scatter-anisotropy",
        "where a thin wall sends that light: 1 through, -1 back, 0 half of it to each side",
        Number(|s| &mut s.subsurface.scatter_anisotropy, Signed)),
    row(B::Coat, "weight", "the share of the surface that has a coat, 0 to 1", Number(|s| &mut s.coat.weight, Unit))
        .target("coat-weight"),
    row(B::Coat, "color", "what is left of white light that passes the coat twice, 0 to 1",
        Color(|s| &mut s.coat.color, Unit)).target("coat-color"),
    row(B::Coat, "roughness", "0 polished to 1 rough", Number(|s| &mut s.coat.roughness, Unit))
        .target("coat-roughness"),
    row(B::Coat, "anisotropy", "how far its highlights are stretched along the surface's u, 0 to 1",
        Number(|s| &mut s.coat.anisotropy, Unit)).target("coat-anisotropy"),
    row(B::Coat, "ior", "the coefficient of refraction, more than 0", Number(|s| &mut s.coat.ior, Positive)),
    row(B::Coat, "darkening", "how far reflections inside the coat darken the base: 0 not at all, 1 as physics has it",
        Number(|s| &mut s.coat.darkening, Unit)).target("coat-darkening"),
    row(B::Fuzz, "weight", "the share of the surface that has fuzz, 0 to 1", Number(|s| &mut s.fuzz.weight, Unit))
        .target("fuzz-weight"),
    row(B::Fuzz, "color", "the colour of the fibres, 0 to 1", Color(|s| &mut s.fuzz.color, Unit)).target("fuzz-color"),
    row(B::Fuzz, "roughness", "0 upright fibres, bright at the rim, to 1 dust", Number(|s| &mut s.fuzz.roughness, Unit))
        .target("fuzz-roughness"),
    row(B::ThinFilm, "weight", "the share of the base that has a film, 0 to 1",
        Number(|s| &mut s.thin_film.weight, Unit)).target("thin-film-weight"),
    row(B::ThinFilm, "thickness", "the thickness in micrometres", Number(|s| &mut s.thin_film.thickness, NonNegative))
        .target("thin-film-thickness"),
    row(B::ThinFilm, "ior", "the coefficient of refraction, more than 0", Number(|s| &mut s.thin_film.ior, Positive))
        .target("thin-film-ior"),
    row(B::Emission, "radiance", "the radiance from the outer side; 1 looks white",
        Number(|s| &mut s.emission.radiance, NonNegative)),
    row(B::Emission, "color", "its factor in red, green and blue", Color(|s| &mut s.emission.color, NonNegative)),
];

const fn row(block: StandardBlock, name: &'static str, doc: &'static str, field: Field) -> StandardParameter {
    StandardParameter { block, name, target: None, doc, field }
}

impl StandardParameter {
    /// The whole table.
    pub const ALL: &'static [StandardParameter] = &TABLE;

    const fn target(mut self, target: &'static str) -> StandardParameter {
        self.target = Some(target);
        self
    }

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

    /// The value as a colour; a number is the grey of its size.
    fn color(&self, surface: &mut StandardSurface) -> Rgb {
        match self.field {
            Color(field, _) => *field(surface),
            Number(field, _) => Rgb::gray(*field(surface)),
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

/// A parameter of the standard surface that textures set: a row of the table that has a name as a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StandardTarget(u8);

impl StandardTarget {
    /// The number of targets.
    pub(in crate::material) const COUNT: usize = {
        let (mut n, mut i) = (0, 0);
        while i < TABLE_LEN {
            n += TABLE[i].target.is_some() as usize;
            i += 1;
        }
        n
    };

    /// The targets, in the order of the table.
    pub(in crate::material) const ALL: [StandardTarget; StandardTarget::COUNT] = {
        let mut all = [StandardTarget(0); StandardTarget::COUNT];
        let (mut n, mut i) = (0, 0);
        while i < TABLE_LEN {
            if TABLE[i].target.is_some() {
                all[n] = StandardTarget(i as u8);
                n += 1;
            }
            i += 1;
        }
        all
    };

    /// The row of the table.
    pub const fn parameter(self) -> &'static StandardParameter {
        &TABLE[self.0 as usize]
    }

    /// The name in scene text.
    pub const fn word(self) -> &'static str {
        match self.parameter().target {
            Some(word) => word,
            None => self.parameter().name,
        }
    }

    /// Sets the parameter to a texture's value: `color` or `number`, 0 or more and finite. With `multiplies` it is
    /// multiplied by the value. The result is clamped to the parameter's range.
    pub(in crate::material) fn set_textured(
        self,
        surface: &mut StandardSurface,
        multiplies: bool,
        color: impl Fn() -> Rgb,
        number: impl Fn() -> f32,
    ) {
        let row = self.parameter();
        let (Color(_, range) | Number(_, range)) = row.field;
        let value = if row.is_color() { color() } else { Rgb::gray(number()) };
        let value = if multiplies { row.color(surface) * value } else { value };
        row.set(surface, value.map(|v| range.nearest(v)));
    }
}

impl Serialize for StandardTarget {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl<'de> Deserialize<'de> for StandardTarget {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<StandardTarget, D::Error> {
        let word = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
        let found = StandardTarget::ALL.into_iter().find(|target| target.word() == word);
        found.ok_or_else(|| serde::de::Error::custom(format!("there is no target {word:?}")))
    }
}

impl Range {
    /// The number of the range that is nearest to `v`, which is 0 or more.
    fn nearest(self, v: f32) -> f32 {
        match self {
            NonNegative | Finite => v.min(f32::MAX),
            Positive => v.clamp(1e-3, f32::MAX),
            Unit | Signed => v.min(1.0),
        }
    }

    fn contains(self, v: f32) -> bool {
        match self {
            NonNegative => v.is_finite() && v >= 0.0,
            Positive => v.is_finite() && v > 0.0,
            Unit => (0.0..=1.0).contains(&v),
            Signed => (-1.0..=1.0).contains(&v),
            Finite => v.is_finite(),
        }
    }

    fn words(self) -> &'static str {
        match self {
            NonNegative => "0 or more",
            Positive => "more than 0",
            Unit => "between 0 and 1",
            Signed => "between -1 and 1",
            Finite => "finite",
        }
    }
}

impl std::fmt::Debug for StandardParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} {}", self.block, self.name)
    }
}
