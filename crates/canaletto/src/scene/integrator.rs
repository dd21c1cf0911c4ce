//! The integrator of a scene, and its settings.

use super::{PathSettings, RadiositySettings};
use crate::{OutOfRange, named};
use serde::{Deserialize, Serialize};

/// The integrator that makes the picture, with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Integrator {
    /// The chapter's recursive ray tracing (box 5.8; Whitted 1980).
    Whitted(WhittedSettings),
    /// A rasteriser with a z-buffer (Catmull 1974), which the chapter compares ray tracing with.
    Zbuffer(ZbufferSettings),
    /// Radiosity, the balance of diffuse light (5.7), under the classic integrator's direct light and mirrors.
    Radiosity(RadiositySettings),
    /// Path tracing (Kajiya 1986): all light by random paths, without bias.
    Path(PathSettings),
}

named!(Integrator {
    Whitted(WhittedSettings::DEFAULT) => "whitted": "The classic recursive ray tracing",
    Zbuffer(ZbufferSettings::DEFAULT) => "zbuffer": "A rasteriser with a z-buffer",
    Radiosity(RadiositySettings::DEFAULT) => "radiosity": "Diffuse light by the balance of energies",
    Path(PathSettings::DEFAULT) => "path": "All light, by random paths",
});

impl Default for Integrator {
    fn default() -> Integrator {
        Integrator::Whitted(WhittedSettings::default())
    }
}

impl From<RadiositySettings> for Integrator {
    fn from(settings: RadiositySettings) -> Integrator {
        Integrator::Radiosity(settings)
    }
}

impl From<PathSettings> for Integrator {
    fn from(settings: PathSettings) -> Integrator {
        Integrator::Path(settings)
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

impl From<ZbufferSettings> for Integrator {
    fn from(settings: ZbufferSettings) -> Integrator {
        Integrator::Zbuffer(settings)
    }
}

/// Settings of the z-buffer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZbufferSettings {
    /// Where the shading equation is evaluated.
    pub shading: Shading,
    /// How shadows are found.
    pub shadows: ShadowMethod,
    /// The width and height of a shadow map in texels, in [`Self::SHADOW_MAP_SIZES`]. Light to all sides takes six.
    pub shadow_map_size: u32,
    /// The number of places in each pixel at which visibility is found: 1, 2, 4 or 8.
    pub multisampling: u32,
    /// The largest distance in pixels between a curved shape and the triangles that stand for it, more than 0.
    pub tolerance: f32,
}

impl ZbufferSettings {
    /// The settings of a scene that names none.
    pub const DEFAULT: ZbufferSettings = ZbufferSettings {
        shading: Shading::Phong,
        shadows: ShadowMethod::Map,
        shadow_map_size: 1024,
        multisampling: 1,
        tolerance: 0.5,
    };
    /// The sizes of shadow maps that are possible.
    pub const SHADOW_MAP_SIZES: std::ops::RangeInclusive<u32> = 16..=8192;
    /// The tolerances that are possible, in pixels.
    pub const TOLERANCES: std::ops::RangeInclusive<f32> = 1e-3..=1e3;

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let (sizes, tolerances) = (ZbufferSettings::SHADOW_MAP_SIZES, ZbufferSettings::TOLERANCES);
        if !sizes.contains(&self.shadow_map_size) {
            let problem = format!(
                "is {}; a shadow map has between {} and {} texels on a side",
                self.shadow_map_size,
                sizes.start(),
                sizes.end()
            );
            return Err(OutOfRange::new("shadow-map-size", problem));
        }
        if ![1, 2, 4, 8].contains(&self.multisampling) {
            let problem = format!("is {}; a pixel has 1, 2, 4 or 8 samples", self.multisampling);
            return Err(OutOfRange::new("multisampling", problem));
        }
        if !tolerances.contains(&self.tolerance) {
            let problem = format!(
                "is {}; it must be between {} and {} pixels",
                self.tolerance,
                tolerances.start(),
                tolerances.end()
            );
            return Err(OutOfRange::new("tolerance", problem));
        }
        Ok(())
    }
}

impl Default for ZbufferSettings {
    fn default() -> ZbufferSettings {
        ZbufferSettings::DEFAULT
    }
}

/// Where a z-buffer evaluates the shading equation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Shading {
    /// Once for each triangle, at its centroid with its own normal.
    Flat,
    /// At each corner, with colours interpolated between them (Gouraud 1971).
    Gouraud,
    /// At each pixel, with interpolated normals (Phong 1975).
    #[default]
    Phong,
}

named!(Shading {
    Flat => "flat": "Once for each triangle",
    Gouraud => "gouraud": "At each corner, with colours interpolated between them",
    Phong => "phong": "At each pixel, with normals interpolated between the corners",
});

/// How a z-buffer finds shadows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ShadowMethod {
    /// There are no shadows.
    None,
    /// By the depths that each light sees (Williams 1978).
    #[default]
    Map,
}

named!(ShadowMethod {
    None => "none": "No shadows",
    Map => "map": "By shadow maps, the depths that each light sees",
});

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
