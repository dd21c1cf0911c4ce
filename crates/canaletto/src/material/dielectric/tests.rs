//! Clear bodies against closed forms and independent integrals.

use super::super::Bsdf;
use super::super::testing::{albedo, bsdf_of, check_sampling, direction, unsqueezed_albedo};
use super::*;

fn glass(roughness: f32, eta_ratio: f64) -> Bsdf {
    bsdf_of(Dielectric { roughness, ..Dielectric::new(1.5) }, ScatteringFrame::flat(DVec3::Z, eta_ratio))
}

/// Smooth glass loses nothing: F + (1 − F) (ηₒ/ηᵢ)² is 1 where radiance isn't squeezed.
#[test]
fn smooth_glass_loses_nothing() {
    for ratio in [1.0 / 1.5, 1.5] {
        for degrees in [0.0f64, 30.0, 60.0, 85.0] {
            let share = fresnel_dielectric(libm::cos(degrees.to_radians()), ratio);
            let expected = share + (1.0 - share) * ratio * ratio;
            let albedo = albedo(&glass(0.0, ratio), degrees);
            assert!((albedo.mean - expected).abs() < 2e-3, "{ratio}, {degrees}°: {albedo:?}, not {expected}");
        }
    }
}

/// What facets lose is given back, at any roughness, angle and η, from outside and from inside.
#[test]
fn rough_glass_loses_nothing() {
    for eta in [1.1, 1.5, 2.4] {
        for ratio in [1.0 / eta, eta] {
            for roughness in [0.05, 0.2, 0.4, 0.7, 1.0] {
                let bsdf = glass(roughness, ratio);
                for degrees in [0.0, 41.0, 65.0, 80.0, 88.0] {
                    let albedo = unsqueezed_albedo(&bsdf, ratio, degrees);
                    assert!(albedo.is_one_within(2e-3), "η {ratio}, roughness {roughness}, {degrees}°: {albedo:?}");
                }
            }
        }
    }
}

#[test]
fn directions_have_their_density() {
    for (roughness, ratio) in [(0.4, 1.0 / 1.5), (0.4, 1.5), (0.9, 1.0 / 1.5), (0.9, 1.5)] {
        for degrees in [10.0, 60.0] {
            check_sampling(&glass(roughness, ratio), direction(degrees), 0.0);
        }
    }
}

/// What one scattering of rough glass keeps from inside at α = 0.3, without the squeezing of radiance: .767 at
/// cos θ = 0.2, .785 at 0.5 and .900 at 1, by an independent integration over facets of density D cos θ.
#[test]
fn one_scattering_of_rough_glass_loses_what_is_known() {
    let albedo = DielectricAlbedo::new(1.5, 0.3);
    for (cos, expected) in [(0.2, 0.767), (0.5, 0.785), (1.0, 0.900)] {
        let kept = albedo.kept(cos, true).total();
        assert!((kept - expected).abs() < 2e-3, "{cos}: {kept}");
    }
}

/// Light that goes the same way back finds the same factor: f(wo, wi) / ηₒ² = f(wi, wo) / ηᵢ², with f cos θ evaluated.
#[test]
fn rough_glass_is_reciprocal() {
    for roughness in [0.3, 0.6, 1.0] {
        for (a, b) in [(20.0, 50.0), (70.0, 35.0), (40.0, 140.0), (60.0, 170.0), (15.0, 110.0)] {
            let (wo, across, wi) = (direction(a), 0.8 * direction(b).x, direction(b));
            let wi = DVec3::new(0.6 * wi.x, across, wi.z);
            let ratio = 1.0 / 1.5;
            let there = f64::from(glass(roughness, ratio).eval(wo, wi).g) / wi.z.abs();
            // From the other end the surface is seen from the side of `wi`.
            let (back, scale) = if wi.z > 0.0 {
                (glass(roughness, ratio).eval(wi, wo), 1.0)
            } else {
                (glass(roughness, 1.0 / ratio).eval(-wi, -wo), ratio * ratio)
            };
            let back = f64::from(back.g) / wo.z.abs() * scale;
            assert!((there - back).abs() <= 1e-5 * there.max(1e-3), "{roughness}, {a}°, {b}°: {there} and {back}");
        }
    }
}
