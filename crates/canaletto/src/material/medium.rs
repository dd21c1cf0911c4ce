//! Participating media: what fills a closed body and absorbs or scatters the light in it.

use crate::OutOfRange;
use crate::math::Rgb;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// A homogeneous medium. All coefficients are per unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Medium {
    /// σₐ ≥ 0, the share of the light that is absorbed.
    pub absorption: Rgb,
    /// σₛ ≥ 0, the share that is scattered.
    pub scattering: Rgb,
    /// g, the mean cosine of the scattering, −1 (back) < g < 1 (forward). 0 scatters to all sides alike.
    pub anisotropy: f32,
}

/// Where light along a ray through a medium is scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MediumSample {
    /// The distance; none if the light passes without being scattered.
    pub distance: Option<f64>,
    /// The factor of a path's throughput: transmittance, times σₛ where it is scattered, over the density.
    pub factor: Rgb,
}

impl Medium {
    /// No medium.
    pub const VACUUM: Medium = Medium { absorption: Rgb::BLACK, scattering: Rgb::BLACK, anisotropy: 0.0 };

    /// Whether light passes as if nothing were there.
    #[inline]
    pub fn is_vacuum(&self) -> bool {
        self.absorption.is_black() && self.scattering.is_black()
    }

    /// Whether the medium scatters light.
    #[inline]
    pub fn scatters(&self) -> bool {
        !self.scattering.is_black()
    }

    /// σₜ = σₐ + σₛ, the extinction in red, green and blue.
    fn extinction(&self) -> [f64; 3] {
        let [absorbed, scattered] = [self.absorption, self.scattering].map(|c| c.to_array().map(f64::from));
        std::array::from_fn(|c| absorbed[c] + scattered[c])
    }

    /// The share of the light that passes a distance without being absorbed or scattered (Beer and Lambert's law).
    pub fn transmittance(&self, distance: f64) -> Rgb {
        self.extinction().map(|extinction| libm::exp(-extinction * distance) as f32).into()
    }

    /// A random place of scattering before `end`. `throughput` is that of the path: `u[0]` chooses a channel by it, and
    /// `u[1]` a distance by that channel's extinction. The density is the mean over the channels, so that no channel's
    /// factor grows beyond the inverse of its share (Wilkie et al., *Hero Wavelength Spectral Sampling*, 2014).
    pub fn sample(&self, throughput: Rgb, u: [f64; 2], end: f64) -> MediumSample {
        let extinction = self.extinction();
        let weights = throughput.to_array().map(|c| f64::from(c).max(0.0));
        let sum: f64 = weights.iter().sum();
        let share = |channel: usize| if sum > 0.0 { weights[channel] / sum } else { 1.0 / 3.0 };
        let channel = match u[0] {
            u if u < share(0) => 0,
            u if u < share(0) + share(1) || share(2) == 0.0 => 1,
            _ => 2,
        };
        // A channel without extinction gives −ln(1 − u)/0 = ∞, and 0/0 for u = 0.
        let distance = -libm::log1p(-u[1]) / extinction[channel];
        let is_scattered = distance < end;
        let passed = extinction.map(|extinction| libm::exp(-extinction * if is_scattered { distance } else { end }));
        let density: f64 = (0..3).map(|c| share(c) * passed[c] * if is_scattered { extinction[c] } else { 1.0 }).sum();
        let scattered = self.scattering.to_array().map(f64::from);
        let factor: [f32; 3] = std::array::from_fn(|c| {
            let kept = passed[c] * if is_scattered { scattered[c] } else { 1.0 };
            if density > 0.0 { (kept / density) as f32 } else { 0.0 }
        });
        MediumSample { distance: is_scattered.then_some(distance), factor: factor.into() }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        for (name, Rgb { r, g, b }) in [("absorption", self.absorption), ("scattering", self.scattering)] {
            if ![r, g, b].into_iter().all(|v| v.is_finite() && v >= 0.0) {
                return Err(OutOfRange::new(name, format!("is {r} {g} {b}; each component must be 0 or more")));
            }
        }
        if !(self.anisotropy > -1.0 && self.anisotropy < 1.0) {
            let problem = format!("is {}; it must lie between -1 (back) and 1 (forward)", self.anisotropy);
            return Err(OutOfRange::new("anisotropy", problem));
        }
        Ok(())
    }
}

impl Default for Medium {
    fn default() -> Medium {
        Medium::VACUUM
    }
}

/// The phase function of Henyey and Greenstein (*Diffuse Radiation in the Galaxy*, 1941).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// The mean cosine of the angle between the directions of the light before and after.
    pub g: f64,
}

impl HenyeyGreenstein {
    /// The density per unit of solid angle with which light along `wi` leaves along `wo`. Both are unit vectors away
    /// from the point. It is its own density of [`HenyeyGreenstein::sample`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> f64 {
        let g = self.g;
        let squared = 1.0 + g * g + 2.0 * g * wo.dot(wi);
        (1.0 - g * g) / (4.0 * PI * squared * squared.sqrt())
    }

    /// A random direction with the density [`HenyeyGreenstein::eval`].
    pub fn sample(&self, wo: DVec3, u: [f64; 2]) -> DVec3 {
        let g = self.g;
        let cos = if g.abs() < 1e-4 {
            // The formula below divides by g; to first order it is this.
            let even = 1.0 - 2.0 * u[0];
            even + 1.5 * g * (1.0 - even * even)
        } else {
            let root = (1.0 - g * g) / (1.0 + g - 2.0 * g * u[0]);
            (1.0 + g * g - root * root) / (2.0 * g)
        }
        .clamp(-1.0, 1.0);
        let (sin_turn, cos_turn) = libm::sincos(TAU * u[1]);
        let (x, y) = (-wo).any_orthonormal_pair();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        (x * (sin * cos_turn) + y * (sin * sin_turn) - wo * cos).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: u32) -> impl Iterator<Item = [f64; 2]> {
        let at = move |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        (0..n * n).map(move |i| [at(i % n), at(i / n)])
    }

    /// The integral over all directions is 1, the mean cosine to the light's own direction is g, and sampled directions
    /// have this mean, too.
    #[test]
    fn the_phase_function_has_its_mean_cosine() {
        let wo = DVec3::new(0.6, 0.0, 0.8);
        for g in [-0.8, -0.3, 0.0, 5e-5, 0.5, 0.9] {
            let phase = HenyeyGreenstein { g };
            let (mut integral, mut mean, n) = (0.0, 0.0, 400);
            for [u, v] in grid(n) {
                let (z, (sin, cos)) = (2.0 * u - 1.0, libm::sincos(TAU * v));
                let r = (1.0 - z * z).sqrt();
                let wi = DVec3::new(r * cos, r * sin, z);
                let weight = 4.0 * PI / f64::from(n * n);
                integral += phase.eval(wo, wi) * weight;
                mean += phase.eval(wo, wi) * wi.dot(-wo) * weight;
            }
            assert!((integral - 1.0).abs() < 2e-3 && (mean - g).abs() < 2e-3, "{g}: {integral}, {mean}");
            // E[1/p] over sampled directions is the solid angle of all of them.
            let (mut sampled, mut solid_angle) = (0.0, 0.0);
            for u in grid(n) {
                let wi = phase.sample(wo, u);
                sampled += wi.dot(-wo) / f64::from(n * n);
                solid_angle += 1.0 / phase.eval(wo, wi) / f64::from(n * n);
            }
            assert!((sampled - g).abs() < 1e-4, "{g}: {sampled}");
            assert!((solid_angle / (4.0 * PI) - 1.0).abs() < 0.01, "{g}: {solid_angle}");
        }
    }

    /// What passes and what is scattered have the means of their integrals in every channel, whatever the throughput.
    #[test]
    fn distances_have_their_means() {
        let medium =
            Medium { absorption: Rgb::new(0.2, 0.0, 1.0), scattering: Rgb::new(0.5, 2.0, 0.0), anisotropy: 0.0 };
        let end = 1.3;
        for throughput in [Rgb::WHITE, Rgb::new(1.0, 0.1, 0.5), Rgb::new(1.0, 0.0, 0.0)] {
            let (mut passed, mut scattered, n) = ([0.0; 3], [0.0; 3], 1000);
            for u in grid(n) {
                let sample = medium.sample(throughput, u, end);
                let sum = if sample.distance.is_some() { &mut scattered } else { &mut passed };
                for (sum, factor) in sum.iter_mut().zip(sample.factor.to_array()) {
                    *sum += f64::from(factor) / f64::from(n * n);
                }
                assert!(sample.distance.is_none_or(|distance| distance < end));
            }
            for channel in (0..3).filter(|c| throughput.to_array()[*c] > 0.0) {
                let extinction = medium.extinction()[channel];
                let transmittance = libm::exp(-extinction * end);
                let albedo = f64::from(medium.scattering.to_array()[channel]) / extinction;
                assert!((passed[channel] - transmittance).abs() < 1e-3, "{throughput:?}: {passed:?}");
                let expected = albedo * (1.0 - transmittance);
                assert!((scattered[channel] - expected).abs() < 1e-3, "{throughput:?}: {scattered:?}, {expected}");
            }
        }
    }

    #[test]
    fn numbers_have_ranges() {
        assert!(Medium { anisotropy: 1.0, ..Medium::VACUUM }.check().is_err());
        assert!(Medium { absorption: Rgb::gray(-1.0), ..Medium::VACUUM }.check().is_err());
        Medium { scattering: Rgb::WHITE, ..Medium::VACUUM }.check().unwrap();
    }
}
