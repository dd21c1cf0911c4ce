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
    use super::*;

    /// ∫ f cos θ by a fine grid: the single albedo is the integral of the Fujii form, and a white surface is white.
    #[test]
    fn white_is_white_and_the_albedo_is_the_integral() {
        for roughness in [0.2, 0.6, 1.0] {
            for cos in [0.05, 0.3, 0.7, 1.0f64] {
                let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let n = 400;
                let (mut all, mut single) = (0.0, 0.0);
                for i in 0..n * n {
                    let z = ((f64::from(i % n) + 0.5) / f64::from(n)).sqrt();
                    let (sin, cosine) = libm::sincos((f64::from(i / n) + 0.5) / f64::from(n) * 2.0 * PI);
                    let across = (1.0 - z * z).sqrt();
                    let wi = DVec3::new(across * cosine, across * sin, z);
                    all += f64::from(eval(Rgb::WHITE, roughness, wo, wi).g) / z * PI / f64::from(n * n);
                    let s = wo.dot(wi) - wo.z * wi.z;
                    let t = if s > 0.0 { wo.z.max(wi.z) } else { 1.0 };
                    single += (1.0 + roughness * s / t) / (1.0 + C1 * roughness) / f64::from(n * n);
                }
                assert!((single - single_albedo(cos, roughness)).abs() < 1e-3, "{roughness}, {cos}: {single}");
                assert!((all - 1.0).abs() < 2e-3, "{roughness}, {cos}: {all}");
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
