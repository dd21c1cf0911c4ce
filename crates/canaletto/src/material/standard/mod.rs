//! The standard surface: OpenPBR Surface 1.1 (Academy Software Foundation, 2025) with its parameters, names and
//! defaults.
//!
//! A metal or a dielectric base, which is opaque or clear, lies under a coat, and that under fuzz. The numbers are a
//! description, which only integrators of physics read.
//!
//! Deviations: subsurface scattering is diffuse reflection of its colour. Emission is not dimmed by the layers over
//! it. Clear bodies absorb light and don't scatter it inside. Coat and base share a normal and a tangent.

mod bsdf;
mod diffuse;
mod fuzz;
mod layers;
mod metal;
mod opaque_base;
mod parameter;
mod point;
mod presets;
mod stretched_albedo;
#[cfg(test)]
mod tests;
mod thin_film;

pub(crate) use bsdf::SeenStandard;
pub use bsdf::StandardBsdf;
pub(crate) use opaque_base::{BaseNumbers, OpaqueBase, OpaqueBaseLobes};
pub use parameter::{StandardBlock, StandardParameter, StandardTarget};
pub use presets::{PRESETS, Preset};

use crate::OutOfRange;
use crate::math::Rgb;
use serde::{Deserialize, Serialize};

/// The numbers of a standard surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardSurface {
    /// The base: what a metal mirrors, or what a dielectric scatters inside.
    pub base: StandardBase,
    /// The reflection of the base.
    pub specular: StandardSpecular,
    /// The clear part of a dielectric base.
    pub transmission: StandardTransmission,
    /// The translucent part of an opaque base.
    pub subsurface: StandardSubsurface,
    /// A clear coat over the base.
    pub coat: StandardCoat,
    /// Fibres over all.
    pub fuzz: StandardFuzz,
    /// A film on the base, as thin as wavelengths are.
    pub thin_film: StandardThinFilm,
    /// The light that the surface emits.
    pub emission: StandardEmission,
    /// Whether the surface is a sheet with no inside, which looks the same from both sides.
    pub thin_walled: bool,
    /// Whether a dielectric reflects by Schlick's curve, as in glTF and in the generalized Schlick of MaterialX. F0 is
    /// the specular colour times the index's reflection times the specular weight, F90 is that weight. Both then have
    /// no effect on metals. Otherwise Fresnel's equations hold.
    pub schlick: bool,
}

/// The base of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardBase {
    /// The factor of the colour, 0 to 1.
    pub weight: f32,
    /// The diffuse colour, or a metal's colour at right angles, 0 to 1.
    pub color: Rgb,
    /// The share of the surface that is metal, 0 to 1.
    pub metalness: f32,
    /// The roughness of diffuse reflection, 0 (Lambert's) to 1.
    pub diffuse_roughness: f32,
}

/// The reflection of the base of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardSpecular {
    /// The factor of the reflection at right angles, 0 or more.
    pub weight: f32,
    /// The tint of a dielectric's reflection, or of a metal's at 82°, 0 to 1.
    pub color: Rgb,
    /// The roughness r, 0 (polished) to 1; α = r².
    pub roughness: f32,
    /// The coefficient of refraction of a dielectric, more than 0.
    pub ior: f32,
    /// The stretch of highlights along the tangent, 0 (none) to 1.
    pub anisotropy: f32,
    /// The angle in degrees from the tangent to the stretch, counter-clockwise seen from outside.
    pub anisotropy_rotation: f32,
}

/// The clear part of the base of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardTransmission {
    /// The share of a dielectric base that is clear, 0 to 1.
    pub weight: f32,
    /// The colour of white light after [`StandardTransmission::depth`], 0 to 1.
    pub color: Rgb,
    /// The length inside the body after which light has the colour; with 0 each crossing of the surface tints it.
    pub depth: f32,
    /// What each crossing of the surface leaves of white light, whatever the depth, 0 to 1.
    pub tint: Rgb,
    /// The amount of dispersion, 0 to 1: the Abbe number is divided by it.
    pub dispersion_scale: f32,
    /// The Abbe number, more than 0.
    pub dispersion_abbe_number: f32,
}

/// The translucent part of the base of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardSubsurface {
    /// The share of an opaque base that is translucent, 0 to 1.
    pub weight: f32,
    /// The colour that it reflects, 0 to 1.
    pub color: Rgb,
    /// Where a thin wall sends the light: 1 all of it through, −1 all of it back, 0 half of it to each side.
    pub scatter_anisotropy: f32,
}

/// The coat of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardCoat {
    /// The share of the surface that has a coat, 0 to 1.
    pub weight: f32,
    /// The share of light that passes the coat twice at right angles, 0 to 1.
    pub color: Rgb,
    /// The roughness r, 0 (polished) to 1; α = r².
    pub roughness: f32,
    /// The stretch of highlights along ∂P/∂u, 0 (none) to 1.
    pub anisotropy: f32,
    /// The coefficient of refraction, more than 0.
    pub ior: f32,
    /// The amount by which reflections inside the coat darken the base, 0 to 1.
    pub darkening: f32,
}

/// The fuzz of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardFuzz {
    /// The share of the surface that has fuzz, 0 to 1.
    pub weight: f32,
    /// The colour of the fibres, 0 to 1.
    pub color: Rgb,
    /// The roughness, 0 (upright fibres) to 1 (dust).
    pub roughness: f32,
}

/// The film on the base of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardThinFilm {
    /// The share of the base that has a film, 0 to 1.
    pub weight: f32,
    /// The thickness in micrometres, 0 or more.
    pub thickness: f32,
    /// The coefficient of refraction, more than 0.
    pub ior: f32,
}

/// The light that a standard surface emits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct StandardEmission {
    /// The radiance, 0 or more.
    pub radiance: f32,
    /// The factor of the radiance, 0 or more.
    pub color: Rgb,
}

impl Default for StandardBase {
    fn default() -> StandardBase {
        StandardBase { weight: 1.0, color: Rgb::gray(0.8), metalness: 0.0, diffuse_roughness: 0.0 }
    }
}

impl Default for StandardSpecular {
    fn default() -> StandardSpecular {
        StandardSpecular {
            weight: 1.0,
            color: Rgb::WHITE,
            roughness: 0.3,
            ior: 1.5,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
        }
    }
}

impl Default for StandardTransmission {
    fn default() -> StandardTransmission {
        StandardTransmission {
            weight: 0.0,
            color: Rgb::WHITE,
            depth: 0.0,
            tint: Rgb::WHITE,
            dispersion_scale: 0.0,
            dispersion_abbe_number: 20.0,
        }
    }
}

impl Default for StandardSubsurface {
    fn default() -> StandardSubsurface {
        StandardSubsurface { weight: 0.0, color: Rgb::gray(0.8), scatter_anisotropy: 0.0 }
    }
}

impl Default for StandardCoat {
    fn default() -> StandardCoat {
        StandardCoat { weight: 0.0, color: Rgb::WHITE, roughness: 0.0, anisotropy: 0.0, ior: 1.6, darkening: 1.0 }
    }
}

impl Default for StandardFuzz {
    fn default() -> StandardFuzz {
        StandardFuzz { weight: 0.0, color: Rgb::WHITE, roughness: 0.5 }
    }
}

impl Default for StandardThinFilm {
    fn default() -> StandardThinFilm {
        StandardThinFilm { weight: 0.0, thickness: 0.5, ior: 1.4 }
    }
}

impl Default for StandardEmission {
    fn default() -> StandardEmission {
        StandardEmission { radiance: 0.0, color: Rgb::WHITE }
    }
}

/// The wavelengths in micrometres that stand for red, green and blue: the dominant ones of sRGB's primaries.
const WAVELENGTHS: [f64; 3] = [0.611, 0.549, 0.464];

/// The wavelengths of the Fraunhofer lines F, d and C in micrometres, by which the Abbe number is defined.
const FRAUNHOFER: [f64; 3] = [0.486_1, 0.587_6, 0.656_3];

impl StandardSurface {
    /// Whether red, green and blue are refracted by different angles.
    pub fn is_dispersive(&self) -> bool {
        let StandardTransmission { weight, dispersion_scale, .. } = self.transmission;
        weight > 0.0 && dispersion_scale > 0.0 && !self.thin_walled
    }

    /// The coefficient of refraction of the base after the specular weight, at the Fraunhofer line d.
    pub fn ior(&self) -> f32 {
        if self.schlick {
            return self.specular.ior;
        }
        layers::weighted_ior(self.specular.ior.into(), self.specular.weight.into()) as f32
    }

    /// The coefficient of refraction for red, green and blue, by Cauchy's formula n = A + B / λ² with the Abbe number.
    pub fn dispersed_ior(&self) -> [f32; 3] {
        let ior = f64::from(self.ior());
        let StandardTransmission { dispersion_scale, dispersion_abbe_number, .. } = self.transmission;
        let [f, d, c] = FRAUNHOFER.map(|wavelength| 1.0 / (wavelength * wavelength));
        let b = (ior - 1.0) * f64::from(dispersion_scale) / (f64::from(dispersion_abbe_number) * (f - c));
        WAVELENGTHS.map(|wavelength| ((ior + b * (1.0 / (wavelength * wavelength) - d)) as f32).max(1e-3))
    }

    /// F0 and F90 of Schlick's curve for a dielectric.
    fn schlick_ends(&self) -> [Rgb; 2] {
        let StandardSpecular { weight, color, ior, .. } = self.specular;
        let f0 = layers::reflection_at_right_angles(f64::from(ior)) as f32;
        let weight = weight.min(1.0);
        [color.map(|tint| (tint * f0).min(1.0)) * weight, Rgb::gray(weight)]
    }

    /// The absorption of the clear body per unit of length.
    pub fn absorption(&self) -> Rgb {
        let StandardTransmission { weight, color, depth, .. } = self.transmission;
        if weight == 0.0 || depth == 0.0 || self.thin_walled {
            return Rgb::BLACK;
        }
        Rgb::from(color.to_array().map(|share| (-libm::log(f64::from(share.max(1e-6))) / f64::from(depth)) as f32))
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        StandardParameter::ALL.iter().try_for_each(|parameter| parameter.check(self))
    }
}
