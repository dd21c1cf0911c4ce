//! Diffuse reflection by rough surfaces: the energy-preserving Oren–Nayar model (Portsmouth, Kutz & Hill, *EON: A
//! Practical Energy-Preserving Rough Diffuse BRDF*, 2024). It is reciprocal, and white if its colour is.

use crate::math::Rgb;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, PI};

/// ½ − 2/(3π), by which the roughness lowers the factor A of the Fujii form.
const C1: f64 = 0.5 - 2.0 / (3.0 * PI);
/// ⅔ − 28/(15π), by which it raises the mean albedo.
const C2: f64 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

/// The albedo of a white surface by the Fujii form, without what facets send to each other.
fn single_albedo(cos: f64, roughness: f64) -> f64 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let tangent = if cos > 1e-9 { sin * (1.0 - sin * sin * sin) / cos } else { 0.0 };
    let g = sin * (libm::acos(cos.clamp(0.0, 1.0)) - sin * cos) + 2.0 / 3.0 * (tangent - sin);
    (1.0 + roughness * g * FRAC_1_PI) / (1.0 + C1 * roughness)
}

/// f cos θi. Both directions are above the surface, whose normal is z.
pub(super) fn eval(color: Rgb, roughness: f64, wo: DVec3, wi: DVec3) -> Rgb {
    let lambert = wi.z * FRAC_1_PI;
    if roughness == 0.0 {
        return color * lambert as f32;
    }
    let s = wo.dot(wi) - wo.z * wi.z;
    let t = if s > 0.0 { wo.z.max(wi.z) } else { 1.0 };
    let a = 1.0 / (1.0 + C1 * roughness);
    let single = a * (1.0 + roughness * s / t);
    let mean = a * (1.0 + C2 * roughness);
    let lost = (1.0 - single_albedo(wo.z, roughness)) * (1.0 - single_albedo(wi.z, roughness));
    let multiple = (lost / (1.0 - mean).max(1e-9)).max(0.0);
    color.map(|rho| {
        let rho = f64::from(rho);
        let again = rho * rho * mean / (1.0 - rho * (1.0 - mean));
        (lambert * (rho * single + again * multiple)) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::sphere_integral;
    use super::*;

    /// The single albedo is the integral of the Fujii form, and a white surface is white.
    #[test]
    fn white_is_white_and_the_albedo_is_the_integral() {
        for roughness in [0.2, 0.6, 1.0] {
            for cos in [0.05, 0.3, 0.7, 1.0f64] {
                let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let above = |wi: DVec3, f: &dyn Fn() -> f64| if wi.z > 0.0 { f() } else { 0.0 };
                let single = sphere_integral(&|wi| {
                    let s = wo.dot(wi) - wo.z * wi.z;
                    let t = if s > 0.0 { wo.z.max(wi.z) } else { 1.0 };
                    above(wi, &|| (1.0 + roughness * s / t) / (1.0 + C1 * roughness) * wi.z * FRAC_1_PI)
                });
                let all = sphere_integral(&|wi| above(wi, &|| eval(Rgb::WHITE, roughness, wo, wi).g.into()));
                assert!((single - single_albedo(cos, roughness)).abs() < 1e-3, "{roughness}, {cos}: {single}");
                assert!((all - 1.0).abs() < 1e-3, "{roughness}, {cos}: {all}");
            }
        }
    }

    /// Light that facets keep takes the colour once more with each scattering. Of it, the mean of what one scattering
    /// lets go leaves each time.
    #[test]
    fn later_scattering_is_a_series() {
        let n = 4000;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        for (roughness, rho) in [(0.3, 0.5f32), (1.0, 0.8), (1.0, 0.2)] {
            let mean = (0..n).map(|i| single_albedo(at(i).sqrt(), roughness)).sum::<f64>() / f64::from(n);
            for cos in [0.2, 0.9f64] {
                let (mut series, mut kept) = (single_albedo(cos, roughness) * f64::from(rho), f64::from(rho));
                kept *= 1.0 - single_albedo(cos, roughness);
                for _ in 0..60 {
                    kept *= f64::from(rho);
                    series += kept * mean;
                    kept *= 1.0 - mean;
                }
                let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let f = |wi: DVec3| if wi.z > 0.0 { eval(Rgb::gray(rho), roughness, wo, wi).g.into() } else { 0.0 };
                let albedo = sphere_integral(&f);
                assert!((albedo - series).abs() < 1e-3, "{roughness}, {rho}, {cos}: {albedo}, {series}");
            }
        }
    }

    #[test]
    fn it_is_reciprocal() {
        let (a, b) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.3, 0.5, 0.3).normalize());
        for roughness in [0.0, 0.5, 1.0] {
            let color = Rgb::new(0.9, 0.5, 0.1);
            let (there, back) = (eval(color, roughness, a, b), eval(color, roughness, b, a));
            assert!((f64::from(there.g) / b.z - f64::from(back.g) / a.z).abs() < 1e-7, "{there:?}, {back:?}");
        }
    }
}
