//! The numbers and colours of material models in one table. The scene text's fields, texture targets, range checks,
//! explanations and `canaletto info` read it.

use super::Phong;
use crate::OutOfRange;
use crate::math::Rgb;
use serde::{Deserialize, Serialize};

/// A number or colour of a material model. Textures can set each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Parameter {
    /// The diffuse colour kd.
    Diffuse,
    /// The colour of highlights ks.
    Specular,
    /// The exponent of highlights n.
    Exponent,
    /// The factor of the reflected ray k.
    Mirror,
    /// The coefficient of refraction η.
    Eta,
    /// The opacity o.
    Opacity,
    /// The roughness.
    Roughness,
    /// The radiance that the surface emits.
    Emission,
}

/// A row of the table of parameters.
pub struct ParameterInfo {
    /// The parameter.
    pub parameter: Parameter,
    /// The name of the field in scene text.
    pub name: &'static str,
    /// The name as the target of a texture in scene text.
    pub target: &'static str,
    /// The name in explanations.
    pub symbol: &'static str,
    /// Where it is shown.
    pub shown: Shown,
    /// The meaning, for the reference of the scene text.
    pub doc: &'static str,
    field: Field,
}

/// Where a parameter is shown. All show it where it differs from its default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// Always.
    Always,
    /// Always in explanations, whose terms it is a factor of.
    InExplanations,
    /// Only where it is set.
    IfSet,
}

/// The field that holds a parameter.
enum Field {
    /// A colour whose components are 0 or more.
    Color(fn(&mut Phong) -> &mut Rgb),
    /// A number in a range, and the range in words.
    Number(fn(&mut Phong) -> &mut f32, Range, &'static str),
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

/// The value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    /// A colour.
    Color(Rgb),
    /// A number.
    Number(f32),
}

use Field::{Color, Number};
use Parameter as P;

/// The table, in the order of [`Parameter`]: a row for each.
#[rustfmt::skip]
static TABLE: [ParameterInfo; Parameter::COUNT] = [
    row(P::Diffuse, "kd", "the colour in diffuse light", Color(|m| &mut m.kd)).target("diffuse"),
    row(P::Specular, "ks", "the colour of highlights", Color(|m| &mut m.ks)),
    row(P::Exponent, "n", "the exponent of highlights: the larger, the smaller they are",
        Number(|m| &mut m.n, Range::NonNegative, "the exponent must be 0 or more")),
    row(P::Mirror, "k", "the factor of the reflected ray: 0 no mirror, 1 a perfect one", Color(|m| &mut m.k))
        .shown(Shown::InExplanations),
    row(P::Eta, "eta", "the coefficient of refraction, more than 0",
        Number(|m| &mut m.eta, Range::Positive, "the coefficient of refraction must be more than 0"))
        .shown(Shown::InExplanations),
    row(P::Opacity, "opacity", "0 clear to 1 opaque, as glass is: its surface shades as a whole",
        Number(|m| &mut m.opacity, Range::Unit, "it must be between 0 (clear) and 1 (opaque)"))
        .symbol("o").shown(Shown::InExplanations),
    row(P::Roughness, "roughness",
        "0 polished to 1 rough: scatters mirrored and refracted rays; it takes several rays in a pixel, such as \
         `film { samples 64 }`",
        Number(|m| &mut m.roughness, Range::Unit, "it must be between 0 (polished) and 1")).shown(Shown::IfSet),
    row(P::Emission, "emission", "the radiance that the surface emits by itself, from its outer side; 1 looks white",
        Color(|m| &mut m.emission)).shown(Shown::IfSet),
];

const fn row(parameter: Parameter, name: &'static str, doc: &'static str, field: Field) -> ParameterInfo {
    ParameterInfo { parameter, name, target: name, symbol: name, shown: Shown::Always, doc, field }
}

impl ParameterInfo {
    const fn target(mut self, target: &'static str) -> ParameterInfo {
        self.target = target;
        self
    }

    const fn symbol(mut self, symbol: &'static str) -> ParameterInfo {
        self.symbol = symbol;
        self
    }

    const fn shown(mut self, shown: Shown) -> ParameterInfo {
        self.shown = shown;
        self
    }

    /// Whether the parameter is a colour.
    pub const fn is_color(&self) -> bool {
        matches!(self.field, Field::Color(_))
    }

    /// The value in a material.
    pub fn get(&self, phong: &Phong) -> ParameterValue {
        let mut phong = *phong;
        match self.field {
            Field::Color(field) => ParameterValue::Color(*field(&mut phong)),
            Field::Number(field, ..) => ParameterValue::Number(*field(&mut phong)),
        }
    }

    /// The value in a material that sets nothing.
    pub fn default_value(&self) -> ParameterValue {
        self.get(&Phong::default())
    }

    /// Sets the value in a material; a colour sets a number to its red.
    pub fn set(&self, phong: &mut Phong, value: ParameterValue) {
        match (&self.field, value) {
            (Field::Color(field), ParameterValue::Color(color)) => *field(phong) = color,
            (Field::Color(field), ParameterValue::Number(number)) => *field(phong) = Rgb::gray(number),
            (Field::Number(field, ..), ParameterValue::Number(number)) => *field(phong) = number,
            (Field::Number(field, ..), ParameterValue::Color(color)) => *field(phong) = color.r,
        }
    }

    /// Sets the value to a texture's: `color` or `number`, 0 or more, clamped to the range.
    #[inline]
    pub(super) fn set_textured(&self, phong: &mut Phong, color: impl Fn() -> Rgb, number: impl Fn() -> f32) {
        match self.field {
            Field::Color(field) => *field(phong) = color().map(|v| v.min(f32::MAX)),
            Field::Number(field, Range::NonNegative, _) => *field(phong) = number().min(f32::MAX),
            Field::Number(field, Range::Positive, _) => *field(phong) = number().max(1e-3),
            Field::Number(field, Range::Unit, _) => *field(phong) = number().min(1.0),
        }
    }

    /// Checks the value's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the parameter, its value and the range.
    pub fn check(&self, phong: &Phong) -> Result<(), OutOfRange> {
        match (self.get(phong), &self.field) {
            (ParameterValue::Color(c), _) if c.to_array().iter().any(|v| !v.is_finite() || *v < 0.0) => {
                let problem = format!("is {} {} {}; each component must be finite and 0 or more", c.r, c.g, c.b);
                Err(OutOfRange::new(self.name, problem))
            }
            (ParameterValue::Number(v), Field::Number(_, range, words)) if !range.contains(v) => {
                Err(OutOfRange::new(self.name, format!("is {v}; {words}")))
            }
            _ => Ok(()),
        }
    }
}

impl Range {
    fn contains(self, v: f32) -> bool {
        match self {
            Range::NonNegative => v.is_finite() && v >= 0.0,
            Range::Positive => v.is_finite() && v > 0.0,
            Range::Unit => (0.0..=1.0).contains(&v),
        }
    }
}

impl Parameter {
    /// The number of parameters.
    pub const COUNT: usize = Parameter::Emission as usize + 1;

    /// The whole table.
    pub const ALL: &'static [ParameterInfo; Parameter::COUNT] = &TABLE;

    /// The parameter's row of the table.
    #[inline]
    pub const fn info(self) -> &'static ParameterInfo {
        &TABLE[self as usize]
    }
}

impl ParameterValue {
    /// The components.
    pub fn to_vec(self) -> Vec<f32> {
        match self {
            ParameterValue::Color(color) => color.to_array().to_vec(),
            ParameterValue::Number(number) => vec![number],
        }
    }
}

impl std::fmt::Debug for ParameterInfo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_in_the_order_of_the_parameters() {
        for (i, row) in Parameter::ALL.iter().enumerate() {
            assert_eq!((row.parameter as usize, row.parameter.info().name), (i, row.name));
        }
    }

    /// Each row reads and writes a field of its own, and nothing else.
    #[test]
    fn each_row_has_its_own_field() {
        let mut phong = Phong::default();
        for (i, row) in Parameter::ALL.iter().enumerate() {
            let number = 0.1 + i as f32 * 0.05;
            let value =
                if row.is_color() { ParameterValue::Color(Rgb::gray(number)) } else { ParameterValue::Number(number) };
            row.set(&mut phong, value);
            for (j, other) in Parameter::ALL.iter().enumerate() {
                let expected = if j > i { other.default_value().to_vec()[0] } else { 0.1 + j as f32 * 0.05 };
                assert_eq!(other.get(&phong).to_vec()[0], expected, "{row:?} changes {other:?}");
            }
        }
    }

    #[test]
    fn names_are_different() {
        for name in [|row: &ParameterInfo| row.name, |row: &ParameterInfo| row.target, |row: &ParameterInfo| row.symbol]
        {
            for (i, row) in Parameter::ALL.iter().enumerate() {
                assert!(Parameter::ALL[..i].iter().all(|other| name(other) != name(row)), "{row:?}");
            }
        }
    }
}
