//! What other integrators take in place of the standard surface.

use super::super::Phong;
use super::{StandardSurface, layers};
use crate::math::Rgb;

/// The roughness up to which other integrators trace mirrored rays for the reflection of a dielectric.
const POLISHED: f32 = 0.1;

impl StandardSurface {
    /// The classic view of the surface where no texture drives it.
    pub(in crate::material) fn classic(&self) -> Phong {
        let emission = self.emission.color * self.emission.radiance;
        let mut phong = Phong { roughness: self.specular.roughness, emission, ..Phong::default() };
        self.approximate(&mut phong);
        phong
    }

    /// Sets the coefficients of (5.39b) to those nearest to the surface with the roughness that `phong` has.
    ///
    /// kd is the diffuse colour. A point light's highlight has the height of the microfacets' peak at right angles,
    /// F0 / (4 α²), up to F0, and Phong's exponent of Blinn's, (2/α² − 2) / 4 (Fisher & Woo, *R.E versus N.H Specular
    /// Highlights*, 1994). k is F0 of metals, and of polished dielectrics and coats. The opacity is 1 less what passes
    /// at right angles. The coat's colour tints all below it, and fuzz adds its mean albedo to kd.
    pub(in crate::material) fn approximate(&self, phong: &mut Phong) {
        let StandardSurface { base, specular, transmission, subsurface, coat, fuzz, thin_walled, .. } = self;
        let metal = base.metalness;
        let ior = self.ior();
        let (reflection, f0) = match self.schlick {
            true => {
                let [f0, _] = self.schlick_ends();
                (f0, f0.luminance())
            }
            false => {
                let f0 = layers::reflection_at_right_angles(f64::from(ior)) as f32;
                (specular.color * f0, f0)
            }
        };
        let coat_f0 = layers::reflection_at_right_angles(f64::from(coat.ior)) as f32 * coat.weight;
        let base_color = base.color * base.weight;
        let opaque = base_color * (1.0 - subsurface.weight) + subsurface.color * subsurface.weight;
        let tint = (Rgb::WHITE * (1.0 - coat.weight) + coat.color * coat.weight) * (1.0 - coat_f0);
        let clear = (1.0 - metal) * transmission.weight;
        let weight = if self.schlick { 1.0 } else { specular.weight.min(1.0) };
        let mirrored = base_color * (metal * weight);
        let gloss = reflection * (1.0 - metal);
        let alpha = (phong.roughness * phong.roughness).max(0.01);
        let peak = (0.25 / (alpha * alpha)).min(1.0);
        let coat_alpha = (coat.roughness * coat.roughness).max(0.01);
        let is_polished = phong.roughness <= POLISHED;
        let coat_is_polished = coat.roughness <= POLISHED;
        // The mean albedo of fuzz over all angles is about a quarter.
        let fuzzy = 0.25 * fuzz.weight;
        phong.kd = opaque * tint * ((1.0 - metal) * (1.0 - transmission.weight) * (1.0 - f0) * (1.0 - fuzzy))
            + fuzz.color * fuzzy;
        phong.ks = (mirrored + gloss) * tint * peak + Rgb::gray(coat_f0 * (0.25 / (coat_alpha * coat_alpha)).min(1.0));
        let exponent = |alpha: f32| ((2.0 / (alpha * alpha) - 2.0) / 4.0).max(1.0);
        phong.n = if coat_f0 > 0.0 { exponent(coat_alpha) } else { exponent(alpha) };
        phong.k = mirrored * tint;
        if is_polished || clear > 0.0 {
            phong.k += gloss * tint;
        }
        if coat_is_polished {
            phong.k += Rgb::gray(coat_f0);
        }
        phong.eta = if *thin_walled { 1.0 } else { ior };
        phong.opacity = 1.0 - clear * (1.0 - f0) * (1.0 - coat_f0);
    }
}
