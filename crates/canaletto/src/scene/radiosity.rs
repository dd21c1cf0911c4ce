//! The settings of radiosity.

use crate::{OutOfRange, named};
use serde::{Deserialize, Serialize};

/// Settings of radiosity, the balance of diffuse light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadiositySettings {
    /// The method that finds the balance.
    pub method: RadiosityMethod,
    /// The wanted error, relative to the mean light of the scene.
    pub error: f32,
    /// The part of the solution that pictures show.
    pub show: RadiosityShow,
    /// The most patches. Each side of an open surface has patches of its own.
    pub max_patches: u32,
    /// The number of shadow rays at each hit towards emitting surfaces, in [`Self::LIGHT_SAMPLES`].
    pub light_samples: u32,
}

impl RadiositySettings {
    /// The range of `error`.
    pub const ERRORS: std::ops::RangeInclusive<f32> = 1e-4..=0.5;

    /// The range of `light_samples`.
    pub const LIGHT_SAMPLES: std::ops::RangeInclusive<u32> = 1..=4096;

    /// The settings of a scene that names none.
    pub const DEFAULT: RadiositySettings = RadiositySettings {
        method: RadiosityMethod::Hierarchical,
        error: 0.01,
        show: RadiosityShow::Full,
        max_patches: 200_000,
        light_samples: 16,
    };

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        if !Self::ERRORS.contains(&self.error) {
            let [least, most] = [Self::ERRORS.start(), Self::ERRORS.end()];
            return Err(OutOfRange::new("error", format!("is {}; it must be between {least} and {most}", self.error)));
        }
        if self.max_patches == 0 {
            return Err(OutOfRange::new("max-patches", "is 0; it must be at least 1"));
        }
        if !Self::LIGHT_SAMPLES.contains(&self.light_samples) {
            let [least, most] = [Self::LIGHT_SAMPLES.start(), Self::LIGHT_SAMPLES.end()];
            let problem = format!("is {}; it must be between {least} and {most}", self.light_samples);
            return Err(OutOfRange::new("light-samples", problem));
        }
        Ok(())
    }
}

impl Default for RadiositySettings {
    fn default() -> RadiositySettings {
        RadiositySettings::DEFAULT
    }
}

/// The methods that find the balance of diffuse light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum RadiosityMethod {
    /// Links between nodes of a hierarchy, refined by a bound of their error (Hanrahan, Salzman, Aupperle 1991).
    #[default]
    Hierarchical,
    /// The brightest patch shoots its light, one after the other (Cohen et al. 1988).
    Shooting,
    /// The equations of all pairs of patches, for small scenes.
    Full,
}

named!(RadiosityMethod {
    Hierarchical => "hierarchical",
    Shooting => "shooting",
    Full => "full",
});

/// The part of a solution that pictures show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum RadiosityShow {
    /// Each patch in its colour.
    Patches,
    /// Colours interpolated between patches.
    Solution,
    /// Indirect light of the solution, with direct light and mirrors of the classic integrator.
    #[default]
    Full,
}

named!(RadiosityShow {
    Patches => "patches",
    Solution => "solution",
    Full => "full",
});
