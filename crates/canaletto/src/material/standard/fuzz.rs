//! Fuzz: fibres that stand on the surface (Zeltner, Burley & Chiang, *Practical Multiple-Scattering Sheen Using
//! Linearly Transformed Cosines*, 2022).
//!
//! The lobe is a cosine around the normal after a linear map that leans it. The map and the albedo depend on the
//! viewer's angle and on the roughness. They are the rational fits of MaterialX (Apache-2.0) to the authors' table. The
//! lobe is reciprocal only nearly, as the authors say, since the cosine is part of it.

use crate::math::warp;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, TAU};

/// The fuzz as it is seen from one angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fuzz {
    /// The albedo of white fibres.
    pub(super) albedo: f64,
    /// The map to the cosine: x' = a x + b z, y' = a y, z' = z, with x to the viewer's side.
    a: f64,
    b: f64,
    /// The direction of x in the surface's plane.
    toward: DVec3,
}

impl Fuzz {
    /// The fuzz for the viewer at `wo`, above the surface, whose normal is z.
    pub(super) fn new(wo: DVec3, roughness: f64) -> Fuzz {
        let (x, y) = (wo.z.clamp(0.0, 1.0), roughness.clamp(0.01, 1.0));
        let s = y * (0.020_660_7 + 1.584_91 * y) / (0.037_942_4 + y * (1.322_27 + y));
        let m = y * (-0.193_854 + y * (-1.148_85 + y * (1.793_2 - 0.959_43 * y * y))) / (0.046_391 + y);
        let o = y * (0.000_654_023 + (-0.020_781_8 + 0.119_681 * y) * y) / (1.262_64 + y * (-1.920_21 + y));
        let off = (x - m) / s;
        let albedo = libm::exp(-0.5 * off * off) / (s * TAU.sqrt()) + o;
        let a = (2.581_26 * x + 0.813_703 * y) * y / (1.0 + 0.310_327 * x * x + 2.609_94 * x * y);
        let b = (1.0 - x).sqrt() * (y - 1.0) * y * y * y
            / (0.000_025_405_3 + 1.712_28 * x - 1.715_06 * x * y + 1.341_74 * y * y);
        let toward = DVec3::new(wo.x, wo.y, 0.0).try_normalize().unwrap_or(DVec3::X);
        Fuzz { albedo: albedo.clamp(0.0, 1.0), a, b, toward }
    }

    /// The density of the lobe, of which f cos θ is a multiple.
    pub(super) fn pdf(&self, wi: DVec3) -> f64 {
        if wi.z <= 0.0 {
            return 0.0;
        }
        let (along, across) = (self.toward.dot(wi), self.toward.x * wi.y - self.toward.y * wi.x);
        let mapped = DVec3::new(self.a * along + self.b * wi.z, self.a * across, wi.z);
        // The cosine's density times the determinant a² over the cubed length.
        let length2 = mapped.length_squared();
        wi.z * FRAC_1_PI * self.a * self.a / (length2 * length2)
    }

    /// The direction of the lobe at `u` of the unit square.
    pub(super) fn sample(&self, u: [f64; 2]) -> DVec3 {
        let cosine = warp::cosine_hemisphere(u);
        let (along, across) = ((cosine.x - self.b * cosine.z) / self.a, cosine.y / self.a);
        let side = DVec3::new(-self.toward.y, self.toward.x, 0.0);
        (self.toward * along + side * across).with_z(cosine.z).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fits are near some values of the authors' table: roughness and cosine in steps of 1/31, then a, b and the
    /// albedo.
    #[test]
    fn fits_are_near_the_authors_table() {
        let table = [
            ([6, 6], [0.129_58, -0.008_64, 0.084_32]),
            ([11, 0], [0.128_69, -0.179_52, 0.697_66]),
            ([11, 8], [0.295_68, -0.031_24, 0.221_85]),
            ([11, 16], [0.344_44, -0.028_78, 0.042_75]),
            ([27, 2], [0.664_33, -0.074_76, 0.684_81]),
            ([27, 20], [0.802_72, -0.044_48, 0.357_37]),
            ([31, 31], [0.879_58, 0.0, 0.341_87]),
        ];
        for (at, expected) in table {
            let [roughness, cos] = at.map(|i| f64::from(i) / 31.0);
            let fuzz = Fuzz::new(DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos), roughness);
            for (ours, expected) in [fuzz.a, fuzz.b, fuzz.albedo].into_iter().zip(expected) {
                assert!((ours - expected).abs() < 0.03, "{roughness}, {cos}: {fuzz:?}");
            }
        }
    }

    /// In the authors' frame x is on the viewer's side, and b is negative: more light goes back than on.
    #[test]
    fn the_lobe_leans_to_the_viewer() {
        let fuzz = Fuzz::new(DVec3::new(0.8, 0.0, 0.6), 0.5);
        let at = |x: f64| fuzz.pdf(DVec3::new(x, 0.0, 0.6));
        assert!(fuzz.b < 0.0 && at(0.8) > 1.1 * at(-0.8), "{} {}", at(0.8), at(-0.8));
    }
}
