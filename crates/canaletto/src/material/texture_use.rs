//! What a material does with a texture (5.5): colours instead of or over the shaded one, any number of the model, holes,
//! bumps.

use super::{Mapping, MaterialPoint};
use crate::math::Rgb;
use serde::{Deserialize, Serialize};

/// A texture on a material. Uses apply in the order of the material's list; a later one replaces what an earlier one
/// gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextureUse {
    /// Index into [`crate::scene::Scene::textures`].
    pub texture: u32,
    /// What for.
    pub target: Target,
    /// Which number of the texture, where one is wanted.
    pub channel: Channel,
    /// What the values 0 and 1 of the texture stand for.
    pub range: [f32; 2],
    /// How the surface gets texture coordinates.
    pub mapping: Mapping,
}

/// What a texture is for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Target {
    /// The colour of the point, instead of the shaded one: the texture holds the light already.
    Replace,
    /// A transparent print over the shaded colour I: a t + (1 − a) I, with the texture's colour t and alpha a.
    Decal,
    /// kd.
    Diffuse,
    /// ks.
    Specular,
    /// n.
    Exponent,
    /// k.
    Mirror,
    /// η.
    Eta,
    /// o.
    Opacity,
    /// The roughness.
    Roughness,
    /// The share of the surface that is there at all; where it is 0 there is a hole.
    Cutout,
    /// Heights, of which only the slope is seen (Blinn, *Simulation of Wrinkled Surfaces*, 1978). `range` says which
    /// heights 0 and 1 are, in the units of the object before its transforms, outwards.
    Bump,
    /// Heights by which the surface is raised along its normal, in the object's units before its transforms; `range` says
    /// which heights 0 and 1 are. Done when the world is built: the object becomes triangles, whose smallest edges are its
    /// size divided by `detail`.
    Displace {
        /// 16 and more.
        detail: f32,
    },
    /// Normals of tangent space: red, green and blue from 0 to 1 are x, y and z from −1 to 1; x goes along u, y towards
    /// smaller v (OpenGL's; upwards in the image), z outwards. `range` isn't used.
    Normal {
        /// How strongly x and y count; 1 as they stand.
        strength: f32,
        /// Whether y goes towards larger v, as Direct3D has it.
        down: bool,
    },
}

/// Which number of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// 0.2126 r + 0.7152 g + 0.0722 b (Rec. 709): the value itself where all three are the same.
    #[default]
    Luminance,
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Alpha.
    Alpha,
}

impl Channel {
    /// This number of a texture's value.
    pub fn of(self, [r, g, b, a]: [f32; 4]) -> f32 {
        match self {
            Channel::Luminance if r == g && g == b => r,
            Channel::Luminance => 0.2126 * r + 0.7152 * g + 0.0722 * b,
            Channel::Red => r,
            Channel::Green => g,
            Channel::Blue => b,
            Channel::Alpha => a,
        }
    }
}

impl Target {
    /// Every kind of target with the word that scenes use, in the order of the reference.
    pub const ALL: [(Target, &'static str); 13] = [
        (Target::Replace, "replace"),
        (Target::Decal, "decal"),
        (Target::Diffuse, "diffuse"),
        (Target::Specular, "ks"),
        (Target::Exponent, "n"),
        (Target::Mirror, "k"),
        (Target::Eta, "eta"),
        (Target::Opacity, "opacity"),
        (Target::Roughness, "roughness"),
        (Target::Cutout, "cutout"),
        (Target::Bump, "bump"),
        (Target::Displace { detail: Target::DEFAULT_DETAIL }, "displace"),
        (Target::Normal { strength: 1.0, down: false }, "normal"),
    ];

    /// The detail of displacements where nothing says so.
    pub const DEFAULT_DETAIL: f32 = 128.0;

    /// The scene text's word for it.
    pub fn name(&self) -> &'static str {
        let kind = std::mem::discriminant(self);
        Target::ALL.iter().find(|(t, _)| std::mem::discriminant(t) == kind).map_or("", |(_, name)| name)
    }

    /// Whether the texture's numbers are colours, so that an image's colour space matters.
    pub fn takes_color(&self) -> bool {
        matches!(self, Target::Replace | Target::Decal | Target::Diffuse | Target::Specular | Target::Mirror)
    }

    /// Whether it bends the normal.
    pub fn bends(&self) -> bool {
        matches!(self, Target::Bump | Target::Normal { .. })
    }

    /// Whether it may let light through.
    pub fn clears(&self) -> bool {
        matches!(self, Target::Opacity | Target::Cutout)
    }
}

impl TextureUse {
    /// The texture on the surface's own coordinates, with the values as they are.
    pub fn new(texture: u32, target: Target) -> TextureUse {
        let channel = if target == Target::Cutout { Channel::Alpha } else { Channel::default() };
        TextureUse { texture, target, channel, range: [0.0, 1.0], mapping: Mapping::default() }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// A sentence that names the number, its value and the range.
    pub fn check(&self) -> Result<(), String> {
        if let Some(bad) = self.range.iter().find(|v| !v.is_finite()) {
            return Err(format!("range holds {bad}; both numbers must be finite"));
        }
        if let Target::Normal { strength, .. } = self.target
            && !(strength.is_finite() && strength >= 0.0)
        {
            return Err(format!("strength is {strength}; it must be 0 or more and finite"));
        }
        if let Target::Displace { detail } = self.target
            && !(16.0..=65536.0).contains(&detail)
        {
            return Err(format!("detail is {detail}; it must be between 16 and 65536"));
        }
        self.mapping.check()
    }

    /// The one number that it takes from a texture's value.
    pub fn number(&self, value: [f32; 4]) -> f32 {
        self.ranged(self.channel.of(value))
    }

    fn ranged(&self, v: f32) -> f32 {
        // Values as they stand aren't rounded on the way.
        if self.range == [0.0, 1.0] { v } else { self.range[0] + v * (self.range[1] - self.range[0]) }
    }

    /// Puts a texture's value in its place. Numbers beyond what the model can do with become the nearest that it can:
    /// textures may hold anything.
    pub fn apply(&self, value: [f32; 4], point: &mut MaterialPoint) {
        let phong = &mut point.phong;
        let number = || positive(self.number(value));
        let color = || {
            let [r, g, b, _] = value.map(|v| positive(self.ranged(v)));
            Rgb::new(r, g, b)
        };
        match self.target {
            Target::Replace => point.overlay = (color(), 1.0),
            Target::Decal => {
                let (under, alpha) = (point.overlay, positive(value[3]).min(1.0));
                // A print over a print is one print.
                let both = alpha + under.1 * (1.0 - alpha);
                if both > 0.0 {
                    let share = if under.1 > 0.0 { alpha / both } else { 1.0 };
                    point.overlay = ((color() * share + under.0 * (1.0 - share)).saturated(), both);
                }
            }
            Target::Diffuse => phong.kd = color(),
            Target::Specular => phong.ks = color(),
            Target::Mirror => phong.k = color(),
            Target::Exponent => phong.n = number(),
            Target::Eta => phong.eta = number().max(1e-3),
            Target::Opacity => phong.opacity = number().min(1.0),
            Target::Roughness => phong.roughness = number().min(1.0),
            Target::Cutout => point.coverage = number().min(1.0),
            Target::Bump | Target::Displace { .. } | Target::Normal { .. } => {}
        }
    }
}

/// The value if it is a number from 0 on, else the nearest one.
fn positive(v: f32) -> f32 {
    if v > 0.0 { v.min(f32::MAX) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(applied(Target::Diffuse, [0.0, 1.0]).phong.kd, rgb);
        assert_eq!(applied(Target::Specular, [0.0, 1.0]).phong.ks, rgb);
        assert_eq!(applied(Target::Mirror, [1.0, 0.0]).phong.k, Rgb::new(0.75, 0.5, 0.25));
        assert_eq!(applied(Target::Replace, [0.0, 1.0]).overlay, (rgb, 1.0));
        assert_eq!(applied(Target::Decal, [0.0, 1.0]).overlay, (rgb, 0.5));
        assert_eq!(applied(Target::Cutout, [0.0, 1.0]).coverage, 0.5);
        let luminance = 0.2126 * 0.25 + 0.7152 * 0.5 + 0.0722 * 0.75;
        assert_eq!(applied(Target::Exponent, [0.0, 100.0]).phong.n, luminance * 100.0);
        assert_eq!(applied(Target::Opacity, [0.0, 1.0]).phong.opacity, luminance);
        assert_eq!(applied(Target::Roughness, [0.0, 1.0]).phong.roughness, luminance);
        assert_eq!(applied(Target::Eta, [1.0, 2.0]).phong.eta, 1.0 + luminance);
    }

    #[test]
    fn wild_values_become_possible_ones() {
        for wild in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -3.0, 1e38] {
            for (target, _) in Target::ALL {
                let mut p = point();
                TextureUse { range: [0.0, 3e38], ..TextureUse::new(0, target) }.apply([wild; 4], &mut p);
                p.phong.check().unwrap();
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
