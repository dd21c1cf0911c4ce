//! Fresnel's equations for unpolarised light: the share of light that a smooth boundary mirrors.

use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{Real32, Real64};

/// The share that the boundary of two clear media mirrors. `cos` ≥ 0 is the cosine of the angle of incidence, and
/// `eta_ratio` is ηᵢ/ηₜ. It is 1 beyond the critical angle.
pub fn fresnel_dielectric(cos: f64, eta_ratio: f64) -> f64 {
    fresnel_dielectrics(cos, eta_ratio)
}

/// [`fresnel_dielectric`] in each lane.
#[inline(always)]
pub(crate) fn fresnel_dielectrics<F: Real64>(cos: F, eta_ratio: F) -> F {
    let one = F::splat(1.0);
    let sin2 = eta_ratio * eta_ratio * (one - cos * cos).max(F::splat(0.0));
    let transmitted = (one - sin2).sqrt();
    let parallel = (cos - eta_ratio * transmitted) / (cos + eta_ratio * transmitted);
    let perpendicular = (eta_ratio * cos - transmitted) / (eta_ratio * cos + transmitted);
    let share = (parallel * parallel + perpendicular * perpendicular) * 0.5;
    F::select(one.at_most(sin2), one, share)
}

/// The share that a metal with the complex index η + ik mirrors in air.
pub fn fresnel_conductor(cos: f64, eta: Rgb, k: Rgb) -> Rgb {
    fresnel_conductors::<f64>(cos, eta.into(), k.into()).into()
}

/// [`fresnel_conductor`] in each lane.
#[inline(always)]
pub(crate) fn fresnel_conductors<F: Real64>(cos: F, eta: Vector<F::Narrow>, k: Vector<F::Narrow>) -> Vector<F::Narrow> {
    let cos = cos.max(F::splat(0.0)).min(F::splat(1.0));
    Vector { x: conductor(cos, eta.x, k.x), y: conductor(cos, eta.y, k.y), z: conductor(cos, eta.z, k.z) }
}

/// One component. a² + b² is the squared length of √(η² − k² − sin² θ + 2iηk).
#[inline(always)]
fn conductor<F: Real64>(cos: F, eta: F::Narrow, k: F::Narrow) -> F::Narrow {
    let (eta, k, zero) = (eta.widen(), k.widen(), F::splat(0.0));
    let (cos2, sin2) = (cos * cos, F::splat(1.0) - cos * cos);
    let real = eta * eta - k * k - sin2;
    let length = (real * real + eta * 4.0 * eta * k * k).sqrt();
    let a = ((length + real) * 0.5).max(zero).sqrt();
    let perpendicular = share(length + cos2, a * 2.0 * cos);
    let parallel = perpendicular * share(cos2 * length + sin2 * sin2, a * 2.0 * cos * sin2);
    ((perpendicular + parallel) * 0.5).narrow()
}

/// (sum − less) / (sum + less). Without absorption and with η 1, differences of equal numbers are rounded below 0, and
/// sums may be 0.
#[inline(always)]
fn share<F: Real64>(sum: F, less: F) -> F {
    (sum - less).max(F::splat(0.0)) / (sum + less).max(F::splat(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At normal incidence F = ((η − 1)² + k²) / ((η + 1)² + k²). A metal without absorption is a dielectric.
    #[test]
    fn known_values() {
        assert!((fresnel_dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-12);
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-12 && fresnel_dielectric(0.5, 1.5) == 1.0);
        // Brewster's angle: no light of one polarisation, so half of the other one.
        let brewster = libm::cos(libm::atan(1.5));
        let perpendicular = (1.0 - 1.5f64 * 1.5) / (1.0 + 1.5 * 1.5);
        assert!((fresnel_dielectric(brewster, 1.0 / 1.5) - 0.5 * perpendicular * perpendicular).abs() < 1e-12);
        let (eta, k) = (Rgb::new(0.143, 0.375, 1.442), Rgb::new(3.983, 2.386, 1.603));
        let f0 = fresnel_conductor(1.0, eta, k);
        for (f0, expected) in f0.to_array().into_iter().zip([0.966_688, 0.802_205, 0.324_034]) {
            assert!((f0 - expected).abs() < 1e-5, "{f0}");
        }
        for cos in [1.0, 0.7, 0.3, 0.05] {
            let glass = fresnel_conductor(cos, Rgb::gray(1.5), Rgb::BLACK).r;
            assert!((f64::from(glass) - fresnel_dielectric(cos, 1.0 / 1.5)).abs() < 1e-6, "{cos}: {glass}");
        }
    }

    /// The mean over the cosine-weighted hemisphere for η = 1.5 is 0.0918 from outside and 0.5963 from inside.
    #[test]
    fn means_over_the_hemisphere() {
        for (ratio, expected) in [(1.0 / 1.5, 0.0918), (1.5, 0.5963)] {
            let n = 20_000;
            let mean =
                (0..n).map(|i| fresnel_dielectric(((f64::from(i) + 0.5) / f64::from(n)).sqrt(), ratio)).sum::<f64>()
                    / f64::from(n);
            assert!((mean - expected).abs() < 1e-4, "{mean}");
        }
    }
}
