//! The use of a texture by a material (5.5): colours that replace or cover the shaded one, any number of the model,
//! holes, bumps.

use super::{Mapping, MaterialPoint, Parameter, ParameterValue, StandardBlock, StandardTarget};
use crate::math::Rgb;
use crate::{Named, OutOfRange, named};
use serde::{Deserialize, Serialize};

/// A texture on a material. Uses apply in the order of the material's list. A later one replaces the result of an
/// earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextureUse {
    /// The index into [`crate::scene::Scene::textures`].
    pub texture: u32,
    /// The quantity that the texture sets.
    pub target: Target,
    /// The channel of the texture, for a target that is one number.
    pub channel: Channel,
    /// The numbers that the texture's values 0 and 1 stand for.
    pub range: [f32; 2],
    /// Whether the value multiplies what the point has already, instead of replacing it: factor × texture × vertex
    /// colour. It has no meaning for overlays, heights and normals.
    #[serde(default)]
    pub multiply: bool,
    /// The mapping from the surface to texture coordinates.
    pub mapping: Mapping,
}

/// The quantity that a texture sets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Target {
    /// The colour of the point, in place of the shaded one: the texture already contains the light.
    Replace,
    /// A transparent overlay on the shaded colour I: a t + (1 − a) I, with the texture's colour t and alpha a.
    Decal,
    /// The coverage, the share of the surface that exists; 0 is a hole.
    Cutout,
    /// Heights, of which only the slope is visible (Blinn, *Simulation of Wrinkled Surfaces*, 1978). `range` holds the
    /// heights of 0 and 1, outwards, in the units of the object before its transforms.
    Bump,
    /// Heights by which the surface is raised along its normal. `range` holds the heights of 0 and 1, in the units of
    /// the object before its transforms. The world's build makes the object triangles, whose smallest edges are its
    /// size divided by `detail`.
    Displace {
        /// The detail, 16 or more.
        detail: f32,
    },
    /// Normals in tangent space: red, green and blue from 0 to 1 are x, y and z from −1 to 1. x is along u, y towards
    /// smaller v (OpenGL's; upwards in the image), z outwards. `range` isn't used.
    Normal {
        /// The factor of x and y; 1 leaves them unchanged.
        strength: f32,
        /// Whether y is towards larger v, as in Direct3D.
        down: bool,
    },
    /// Normals of the coat of the standard surface alone, as [`Target::Normal`] has them. The coat follows no other
    /// normals or bumps.
    #[serde(rename = "coat-normal")]
    CoatNormal {
        /// The factor of x and y; 1 leaves them unchanged.
        strength: f32,
        /// Whether y is towards larger v, as in Direct3D.
        down: bool,
    },
    /// The direction that highlights of the standard surface are stretched along, in tangent space: red and green from
    /// 0 to 1 are x and y from −1 to 1. It is turned by the surface's own rotation. `range` isn't used.
    #[serde(rename = "anisotropy-direction")]
    AnisotropyDirection,
    /// A parameter of the material's model.
    #[serde(untagged)]
    Parameter(Parameter),
    /// A parameter of the standard surface.
    #[serde(untagged)]
    Standard(StandardTarget),
}

/// The channel of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// The luminance 0.2126 r + 0.7152 g + 0.0722 b (Rec. 709). It equals the channels where all three are equal.
    #[default]
    Luminance,
    /// The red channel.
    Red,
    /// The green channel.
    Green,
    /// The blue channel.
    Blue,
    /// The alpha channel.
    Alpha,
    /// The largest of red, green and blue.
    Max,
}

named!(Channel {
    Luminance => "luminance",
    Red => "red",
    Green => "green",
    Blue => "blue",
    Alpha => "alpha",
    Max => "max",
});

impl Channel {
    /// The number that this channel has in a texture's value.
    pub fn of(self, [r, g, b, a]: [f32; 4]) -> f32 {
        match self {
            Channel::Luminance if r == g && g == b => r,
            Channel::Luminance => Rgb::new(r, g, b).luminance(),
            Channel::Red => r,
            Channel::Green => g,
            Channel::Blue => b,
            Channel::Alpha => a,
            Channel::Max => r.max(g).max(b),
        }
    }
}

/// The targets: colours over the shaded one, the parameters of the model, then what changes the surface itself.
const TARGETS: [Target; Parameter::COUNT + StandardTarget::COUNT + 8] = {
    let mut all = [Target::Replace; Parameter::COUNT + StandardTarget::COUNT + 8];
    all[1] = Target::Decal;
    let mut i = 0;
    while i < Parameter::COUNT {
        all[2 + i] = Target::Parameter(Parameter::ALL[i].parameter);
        i += 1;
    }
    let mut k = 0;
    while k < StandardTarget::COUNT {
        all[2 + i + k] = Target::Standard(StandardTarget::ALL[k]);
        k += 1;
    }
    all[2 + i + k] = Target::AnisotropyDirection;
    let i = 3 + i + k;
    all[i] = Target::Cutout;
    all[i + 1] = Target::Bump;
    all[i + 2] = Target::Displace { detail: Target::DEFAULT_DETAIL };
    all[i + 3] = Target::Normal { strength: 1.0, down: false };
    all[i + 4] = Target::CoatNormal { strength: 1.0, down: false };
    all
};

const NAMES: [&str; TARGETS.len()] = {
    let mut names = [""; TARGETS.len()];
    let mut i = 0;
    while i < TARGETS.len() {
        names[i] = TARGETS[i].word();
        i += 1;
    }
    names
};

// The macro has no variants that are sets of their own.
impl Named for Target {
    const ALL: &'static [Target] = &TARGETS;
    const NAMES: &'static [&'static str] = &NAMES;

    fn name(&self) -> &'static str {
        self.word()
    }

    fn meaning(&self) -> &'static str {
        ""
    }

    fn from_name(name: &str) -> Option<Target> {
        TARGETS.into_iter().find(|target| target.word() == name)
    }
}

impl Target {
    /// The default detail of displacements.
    pub const DEFAULT_DETAIL: f32 = 128.0;

    const fn word(&self) -> &'static str {
        match self {
            Target::Parameter(parameter) => parameter.info().target,
            Target::Replace => "replace",
            Target::Decal => "decal",
            Target::AnisotropyDirection => "anisotropy-direction",
            Target::Standard(target) => target.word(),
            Target::Cutout => "cutout",
            Target::Bump => "bump",
            Target::Displace { .. } => "displace",
            Target::Normal { .. } => "normal",
            Target::CoatNormal { .. } => "coat-normal",
        }
    }

    /// Whether the texture's numbers are colours, so that an image's colour space matters.
    #[inline]
    pub fn takes_color(&self) -> bool {
        match self {
            Target::Replace | Target::Decal => true,
            Target::Parameter(parameter) => parameter.info().is_color(),
            Target::Standard(target) => target.parameter().is_color(),
            Target::AnisotropyDirection
            | Target::Cutout
            | Target::Bump
            | Target::Displace { .. }
            | Target::Normal { .. }
            | Target::CoatNormal { .. } => false,
        }
    }

    /// Whether the target bends the normal.
    pub fn bends_normal(&self) -> bool {
        matches!(self, Target::Bump | Target::Normal { .. })
    }

    /// Whether the texture's colours are normals.
    pub fn takes_normals(&self) -> bool {
        matches!(self, Target::Normal { .. } | Target::CoatNormal { .. })
    }

    /// Whether the target may let light through.
    pub fn may_transmit(&self) -> bool {
        matches!(self, Target::Parameter(Parameter::Opacity) | Target::Cutout)
            || self.is_in_block(StandardBlock::Transmission)
    }

    /// Whether the target stretches highlights.
    pub(crate) fn stretches(&self) -> bool {
        matches!(self, Target::Standard(target) if target.parameter().name == "anisotropy")
    }

    /// Whether the target is a parameter of this block of the standard surface.
    fn is_in_block(&self, block: StandardBlock) -> bool {
        matches!(self, Target::Standard(target) if target.parameter().block == block)
    }

    /// Whether a value may multiply what the target has. Those of decals, heights and normals can't.
    pub fn takes_products(&self) -> bool {
        matches!(self, Target::Replace | Target::Parameter(_) | Target::Standard(_) | Target::Cutout)
    }
}

impl TextureUse {
    /// The texture on the surface's own coordinates, with its values unchanged.
    pub fn new(texture: u32, target: Target) -> TextureUse {
        let channel = if target == Target::Cutout { Channel::Alpha } else { Channel::default() };
        TextureUse { texture, target, channel, range: [0.0, 1.0], multiply: false, mapping: Mapping::default() }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        if let Some(bad) = self.range.iter().find(|v| !v.is_finite()) {
            return Err(OutOfRange::new("range", format!("holds {bad}; both numbers must be finite")));
        }
        if let Target::Normal { strength, .. } | Target::CoatNormal { strength, .. } = self.target
            && !(strength.is_finite() && strength >= 0.0)
        {
            return Err(OutOfRange::new("strength", format!("is {strength}; it must be 0 or more and finite")));
        }
        if let Target::Displace { detail } = self.target
            && !(16.0..=65536.0).contains(&detail)
        {
            return Err(OutOfRange::new("detail", format!("is {detail}; it must be between 16 and 65536")));
        }
        self.mapping.check()
    }

    /// The number that this use takes from a texture's value.
    pub fn number(&self, value: [f32; 4]) -> f32 {
        self.ranged(self.channel.of(value))
    }

    fn ranged(&self, v: f32) -> f32 {
        // The default range returns the value without rounding.
        if self.range == [0.0, 1.0] { v } else { self.range[0] + v * (self.range[1] - self.range[0]) }
    }

    /// Sets the target to a texture's value. Numbers out of the model's range are clamped to it, since textures may
    /// hold any number.
    pub fn apply(&self, value: [f32; 4], point: &mut MaterialPoint) {
        let number = || positive(self.number(value));
        let color = || {
            let [r, g, b, _] = value.map(|v| positive(self.ranged(v)));
            Rgb::new(r, g, b)
        };
        match self.target {
            // A product with a surface that nothing replaces yet is the colour itself.
            Target::Replace if self.multiply && point.overlay.1 == 1.0 => point.overlay.0 = point.overlay.0 * color(),
            Target::Replace => point.overlay = (color(), 1.0),
            Target::Decal => {
                let (under, alpha) = (point.overlay, positive(value[3]).min(1.0));
                // Two overlays combine into one.
                let both = alpha + under.1 * (1.0 - alpha);
                if both > 0.0 {
                    let share = if under.1 > 0.0 { alpha / both } else { 1.0 };
                    point.overlay = ((color() * share + under.0 * (1.0 - share)).saturated(), both);
                }
            }
            Target::Parameter(parameter) => {
                let old = |old: Rgb| if self.multiply { old } else { Rgb::WHITE };
                match (&mut point.standard, parameter) {
                    (Some(standard), Parameter::Diffuse) => {
                        standard.base.color = (old(standard.base.color) * color()).map(|share| share.min(1.0));
                    }
                    _ => {
                        let old = match parameter.info().get(&point.classic) {
                            ParameterValue::Color(color) => old(color),
                            ParameterValue::Number(number) => old(Rgb::gray(number)),
                        };
                        let (color, number) = (|| old * color(), || old.r * number());
                        parameter.info().set_textured(&mut point.classic, color, number);
                    }
                }
            }
            Target::Standard(target) => {
                if let Some(standard) = &mut point.standard {
                    target.set_textured(standard, self.multiply, color, number);
                }
            }
            Target::AnisotropyDirection => {
                let [x, y] = [value[0], value[1]].map(|v| 2.0 * f64::from(v) - 1.0);
                if let Some(standard) = point.standard.as_mut().filter(|_| (x, y) != (0.0, 0.0)) {
                    standard.specular.anisotropy_rotation += libm::atan2(y, x).to_degrees() as f32;
                }
            }
            Target::Cutout => {
                let old = if self.multiply { point.coverage } else { 1.0 };
                point.coverage = (old * number()).min(1.0);
            }
            Target::Bump | Target::Displace { .. } | Target::Normal { .. } | Target::CoatNormal { .. } => {}
        }
    }
}

/// The value if it is at least 0, else 0. NaN becomes 0, and infinity the largest number.
fn positive(v: f32) -> f32 {
    if v > 0.0 { v.min(f32::MAX) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Named;

    fn point() -> MaterialPoint {
        MaterialPoint::default()
    }

    #[test]
    fn each_target_replaces_its_number() {
        let value = [0.25, 0.5, 0.75, 0.5];
        let applied = |target: Target, range: [f32; 2]| {
            let mut p = point();
            TextureUse { range, ..TextureUse::new(0, target) }.apply(value, &mut p);
            p
        };
        let rgb = Rgb::new(0.25, 0.5, 0.75);
        assert_eq!(applied(Target::Parameter(Parameter::Diffuse), [0.0, 1.0]).classic.kd, rgb);
        assert_eq!(applied(Target::Parameter(Parameter::Specular), [0.0, 1.0]).classic.ks, rgb);
        assert_eq!(applied(Target::Parameter(Parameter::Mirror), [1.0, 0.0]).classic.k, Rgb::new(0.75, 0.5, 0.25));
        assert_eq!(applied(Target::Replace, [0.0, 1.0]).overlay, (rgb, 1.0));
        assert_eq!(applied(Target::Decal, [0.0, 1.0]).overlay, (rgb, 0.5));
        assert_eq!(applied(Target::Cutout, [0.0, 1.0]).coverage, 0.5);
        let luminance = 0.2126 * 0.25 + 0.7152 * 0.5 + 0.0722 * 0.75;
        assert_eq!(applied(Target::Parameter(Parameter::Exponent), [0.0, 100.0]).classic.n, luminance * 100.0);
        assert_eq!(applied(Target::Parameter(Parameter::Opacity), [0.0, 1.0]).classic.opacity, luminance);
        assert_eq!(applied(Target::Parameter(Parameter::Roughness), [0.0, 1.0]).classic.roughness, luminance);
        assert_eq!(applied(Target::Parameter(Parameter::Eta), [1.0, 2.0]).classic.eta, 1.0 + luminance);
    }

    #[test]
    fn wild_values_become_possible_ones() {
        for wild in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -3.0, 1e38] {
            for &target in Target::ALL {
                let mut p = point();
                TextureUse { range: [0.0, 3e38], ..TextureUse::new(0, target) }.apply([wild; 4], &mut p);
                p.classic.check().unwrap();
                assert!((0.0..=1.0).contains(&p.coverage), "{p:?}");
                assert!(p.overlay.0.is_finite() && (0.0..=1.0).contains(&p.overlay.1), "{wild}: {p:?}");
            }
        }
    }

    #[test]
    fn a_print_over_a_print_is_blended_like_both_in_turn() {
        let mut p = point();
        let decal = TextureUse::new(0, Target::Decal);
        decal.apply([1.0, 0.0, 0.0, 0.5], &mut p);
        decal.apply([0.0, 1.0, 0.0, 0.25], &mut p);
        let base = Rgb::new(0.1, 0.2, 0.3);
        let first = Rgb::new(1.0, 0.0, 0.0) * 0.5 + base * 0.5;
        let both = Rgb::new(0.0, 1.0, 0.0) * 0.25 + first * 0.75;
        let once = p.overlay.0 * p.overlay.1 + base * (1.0 - p.overlay.1);
        assert!((once - both).to_array().into_iter().all(|d| d.abs() < 1e-6), "{once:?} {both:?}");
    }
}
