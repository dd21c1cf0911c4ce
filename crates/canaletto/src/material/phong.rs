//! Phong's model (5.4) with the chapter's mirror and transparency.

use super::Parameter;
use crate::OutOfRange;
use crate::math::{Rgb, power_all};
use serde::{Deserialize, Serialize};

/// The coefficients of (5.39b), and the light that the surface emits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phong {
    /// The diffuse colour k_d ≥ 0.
    pub kd: Rgb,
    /// The colour of highlights k_s ≥ 0.
    pub ks: Rgb,
    /// The exponent of highlights n ≥ 0.
    pub n: f32,
    /// The factor of the reflected ray k ≥ 0. The chapter's k is one number.
    pub k: Rgb,
    /// The coefficient of refraction η > 0.
    pub eta: f32,
    /// The opacity o: 0 clear, 1 opaque. The factor of the refracted ray is 1 − o.
    pub opacity: f32,
    /// The roughness of the mirror or of the clear body's boundary, 0 (polished) to 1. Reflected and refracted rays get
    /// random directions around their smooth ones. Highlights have the exponent n instead.
    #[serde(default)]
    pub roughness: f32,
    /// The radiance Lₑ ≥ 0 that the surface emits by itself in all directions, from its outer side. See
    /// [`Material::two_sided`](super::Material::two_sided).
    #[serde(default)]
    pub emission: Rgb,
}

impl Default for Phong {
    fn default() -> Phong {
        Phong {
            kd: Rgb::gray(0.8),
            ks: Rgb::BLACK,
            n: 1.0,
            k: Rgb::BLACK,
            eta: 1.0,
            opacity: 1.0,
            roughness: 0.0,
            emission: Rgb::BLACK,
        }
    }
}

impl Phong {
    /// A bound of the light that a surface returns by the chapter's equation, as a share of what arrives:
    /// kd + 2 ks / (n + 1) + k + 1 − o. The highlight's share is the integral of (5.38), π l times ks cosⁿ α / π, over
    /// all directions.
    pub fn largest_albedo(&self) -> f32 {
        let highlight = 2.0 / (self.n + 1.0);
        (self.kd + self.ks * highlight + self.k + Rgb::gray(1.0 - self.opacity)).max_component()
    }

    /// Whether the surface is opaque and has nothing but diffuse reflection.
    #[inline]
    pub fn is_diffuse(&self) -> bool {
        self.ks.is_black() && self.k.is_black() && self.opacity >= 1.0
    }

    /// All that scatters light scaled, so that no more light leaves than arrives ([`Phong::largest_albedo`]).
    pub(crate) fn bounded(&self) -> Phong {
        let albedo = self.largest_albedo();
        if albedo <= 1.0 {
            return *self;
        }
        let scale = 1.0 / albedo;
        let opacity = 1.0 - (1.0 - self.opacity) * scale;
        Phong { kd: self.kd * scale, ks: self.ks * scale, k: self.k * scale, opacity, ..*self }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        Parameter::ALL.iter().try_for_each(|parameter| parameter.check(self))
    }
}

/// Replaces each r·L by cosⁿα of (5.38), cut off below 0: pow(max(0, r·L), n). An n of 0 gives 1 everywhere.
pub(crate) fn highlights(r_dot_l: &mut [f32], n: &[f32]) {
    for cosine in &mut *r_dot_l {
        *cosine = cosine.max(0.0);
    }
    power_all(r_dot_l, n);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn highlights_follow_the_power() {
        let mut cosines = [0.969, -0.2];
        highlights(&mut cosines, &[30.0; 2]);
        assert!((cosines[0] - 0.969f32.powi(30)).abs() < 1e-6); // exercise 18
        assert_eq!(cosines[1], 0.0);
    }

    #[test]
    fn ranges_are_checked() {
        assert!(Phong::default().check().is_ok());
        assert!(Phong { opacity: 1.5, ..Phong::default() }.check().unwrap_err().to_string().contains("opacity is 1.5"));
        let field = |phong: Phong| phong.check().unwrap_err().field;
        assert_eq!(field(Phong { kd: Rgb::new(0.0, f32::NAN, 0.0), ..Phong::default() }), Some("kd"));
        assert_eq!(field(Phong { eta: 0.0, ..Phong::default() }), Some("eta"));
        for emission in [Rgb::new(0.0, -1.0, 0.0), Rgb::new(f32::INFINITY, 0.0, 0.0)] {
            assert_eq!(field(Phong { emission, ..Phong::default() }), Some("emission"));
        }
    }
}
