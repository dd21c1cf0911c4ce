//! The integrator of a scene, and its settings.

use crate::{Named, named};
use serde::{Deserialize, Serialize};

/// The integrator that makes the picture, with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Integrator {
    /// The chapter's recursive ray tracing (box 5.8; Whitted 1980).
    Whitted(WhittedSettings),
}

named!(Integrator {
    Whitted(WhittedSettings::DEFAULT) => "whitted",
});

impl Integrator {
    /// Its settings: the words of the scene text with their values.
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        match self {
            Integrator::Whitted(WhittedSettings { max_depth, min_weight, stage, shadows }) => vec![
                ("stage", stage.name().into()),
                ("max-depth", max_depth.to_string()),
                ("min-weight", min_weight.to_string()),
                ("shadows", shadows.to_string()),
            ],
        }
    }

    /// The largest depth of the rays that it traces. Camera rays have depth 1.
    pub fn max_depth(&self) -> u32 {
        match self {
            Integrator::Whitted(settings) => settings.max_depth,
        }
    }

    /// Whether it traces shadow rays to lights that cast shadows.
    pub fn traces_shadows(&self) -> bool {
        match self {
            Integrator::Whitted(settings) => settings.shadows && settings.stage >= Stage::Shadow,
        }
    }

    /// The settings of the classic integrator, if it is this one.
    pub fn whitted(&self) -> Option<&WhittedSettings> {
        match self {
            Integrator::Whitted(settings) => Some(settings),
        }
    }

    /// The settings of the classic integrator, if it is this one, to be changed.
    pub fn whitted_mut(&mut self) -> Option<&mut WhittedSettings> {
        match self {
            Integrator::Whitted(settings) => Some(settings),
        }
    }
}

impl Default for Integrator {
    fn default() -> Integrator {
        Integrator::Whitted(WhittedSettings::default())
    }
}

impl From<WhittedSettings> for Integrator {
    fn from(settings: WhittedSettings) -> Integrator {
        Integrator::Whitted(settings)
    }
}

/// Settings of the classic integrator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WhittedSettings {
    /// The largest depth of rays: rays of this depth have no children. Camera rays have depth 1 (box 5.8). At
    /// most [`Self::MAX_DEPTH`].
    pub max_depth: u32,
    /// The least throughput: a ray below it in every component is not traced; 0 traces all rays. The default is 2⁻¹⁰,
    /// as each level of the tree doubles the rays between clear mirrors. A ray below it adds less than a step of 8
    /// bits.
    pub min_weight: f32,
    /// The part of the shading equation that is evaluated.
    pub stage: Stage,
    /// Whether any light casts shadows.
    pub shadows: bool,
}

impl WhittedSettings {
    /// The largest `max_depth`. The stack of a rendering thread has room for this many nested rays.
    pub const MAX_DEPTH: u32 = 256;

    /// The settings of a scene that names none.
    pub const DEFAULT: WhittedSettings =
        WhittedSettings { max_depth: 6, min_weight: 1.0 / 1024.0, stage: Stage::Full, shadows: true };
}

impl Default for WhittedSettings {
    fn default() -> WhittedSettings {
        WhittedSettings::DEFAULT
    }
}

/// The chapter's stages from flat colour to the whole equation. Each stage contains the earlier ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Stage {
    /// The diffuse colour alone (fig. 5.18), without any light.
    Unlit,
    /// The diffuse term (5.32) of each light.
    Diffuse,
    /// The ambient light of (5.33) is added.
    Ambient,
    /// The highlights of (5.38) are added.
    Specular,
    /// The shadows of (5.39a) are added.
    Shadow,
    /// Reflected rays are added.
    Reflection,
    /// Refracted rays are added: the whole of (5.39b).
    #[default]
    Full,
}

named!(Stage {
    Unlit => "unlit": "The diffuse colour alone",
    Diffuse => "diffuse": "Diffuse light from each light",
    Ambient => "ambient": "+ ambient light",
    Specular => "specular": "+ highlights",
    Shadow => "shadow": "+ shadows",
    Reflection => "reflection": "+ reflected rays",
    Full => "full": "+ refracted rays: the whole equation",
});
