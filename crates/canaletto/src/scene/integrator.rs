//! How rays are followed.

use serde::{Deserialize, Serialize};

/// Settings of the classic integrator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntegratorSettings {
    /// Rays of this depth have no children; eye rays have depth 1 (box 5.8). At most [`Self::MAX_DEPTH`].
    pub max_depth: u32,
    /// Rays whose factors multiply to less than this in every component are not followed; 0 follows all. The default is
    /// 2⁻¹⁰: between clear mirrors each level of the tree doubles the rays, and what such a ray adds is below a step of 8 bits.
    pub min_weight: f32,
    /// How much of the shading equation is switched on.
    pub stage: Stage,
    /// Whether lights cast shadows at all.
    pub shadows: bool,
}

impl IntegratorSettings {
    /// The largest `max_depth`: the stack of any thread that renders has room for as many rays in each other.
    pub const MAX_DEPTH: u32 = 256;
}

impl Default for IntegratorSettings {
    fn default() -> IntegratorSettings {
        IntegratorSettings { max_depth: 6, min_weight: 1.0 / 1024.0, stage: Stage::Full, shadows: true }
    }
}

/// The chapter's way from flat colour to the whole equation; each stage contains the ones before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Stage {
    /// The diffuse colour alone (fig. 5.18).
    Unlit,
    /// (5.32) for each light.
    Diffuse,
    /// (5.33): + ambient light.
    Ambient,
    /// (5.38): + highlights.
    Specular,
    /// (5.39a): + shadows.
    Shadow,
    /// + reflected rays.
    Reflection,
    /// (5.39b): + refracted rays.
    #[default]
    Full,
}

impl Stage {
    /// Every stage with its name, in order.
    pub const ALL: [(Stage, &'static str); 7] = [
        (Stage::Unlit, "unlit"),
        (Stage::Diffuse, "diffuse"),
        (Stage::Ambient, "ambient"),
        (Stage::Specular, "specular"),
        (Stage::Shadow, "shadow"),
        (Stage::Reflection, "reflection"),
        (Stage::Full, "full"),
    ];
}
