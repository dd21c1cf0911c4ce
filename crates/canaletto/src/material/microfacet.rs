//! Rough mirrors and frosted glass (5.6): a surface of many small facets, each a perfect mirror or a perfect boundary.
//!
//! A ray hits one random facet among those visible to it. Its direction is mirrored or refracted as at a smooth surface
//! with the facet's normal. Normals follow the GGX distribution (Walter et al., *Microfacet Models for Refraction
//! through Rough Surfaces*, 2007) with α = roughness². Visible facets are sampled by spherical caps (Dupuy & Benyoub,
//! *Sampling Visible GGX Normals with Spherical Caps*, 2023).
//!
//! Deviation: there is no loss. A direction into the surface would in truth hit the next facet; here it is mirrored to
//! the other side of the surface. Facets don't block light that leaves. So a ray's weight is that of a smooth surface,
//! k or 1 − o, for any roughness. A rough mirror in a room of one colour is as bright as a polished one.

use glam::{DVec2, DVec3};

/// The unit normal of the facet at `u` of the unit square that is visible from the unit direction `wo`. The unit normal
/// of the surface is on the side of `wo`.
pub fn sample_ggx_vndf(wo: DVec3, normal: DVec3, roughness: f64, u: [f64; 2]) -> DVec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let alpha = roughness * roughness;
    // After scaling by α the facets' normals are uniform over the hemisphere; the viewer sees a cap of the sphere.
    let squeezed = DVec3::new(wo.dot(x) * alpha, wo.dot(y) * alpha, wo.dot(normal).max(0.0)).normalize();
    let z = (1.0 - u[1]) * (1.0 + squeezed.z) - squeezed.z;
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * u[0]);
    let on_cap = DVec2::new(cos, sin) * (1.0 - z * z).max(0.0).sqrt();
    let half = on_cap.extend(z) + squeezed;
    let facet = DVec3::new(half.x * alpha, half.y * alpha, half.z.max(0.0));
    (x * facet.x + y * facet.y + normal * facet.z).try_normalize().unwrap_or(normal)
}

/// The density per unit of solid angle with which [`sample_ggx_vndf`] returns the unit normal `m`:
/// D(m) G₁(wo) max(0, wo·m) / (wo·n). `wo` is on the side of the surface's unit normal.
pub fn ggx_vndf_pdf(wo: DVec3, normal: DVec3, roughness: f64, m: DVec3) -> f64 {
    let alpha2 = roughness * roughness * roughness * roughness;
    let (cos, cos_m) = (wo.dot(normal), m.dot(normal));
    if cos_m <= 0.0 {
        return 0.0;
    }
    // D(m) = α² / (π (cos² θₘ (α² − 1) + 1)²)
    let spread = 1.0 - cos_m * cos_m * (1.0 - alpha2);
    let d = alpha2 / (std::f64::consts::PI * spread * spread);
    // G₁(wo) / (wo·n) = 2 / (cos θ + √(cos² θ + α² sin² θ))
    let g1 = 2.0 / (cos + (cos * cos + alpha2 * (1.0 - cos * cos)).sqrt());
    d * g1 * wo.dot(m).max(0.0)
}

/// The direction, mirrored in the plane of the unit normal if it points to the wrong side of the plane.
pub fn reflect_into_hemisphere(direction: DVec3, normal: DVec3) -> DVec3 {
    let height = direction.dot(normal);
    if height < 0.0 { direction - normal * (2.0 * height) } else { direction }
}

#[cfg(test)]
mod tests {
    use super::super::{reflect, refract};
    use super::*;

    /// The density of visible normals, D_v = D(m) G₁(wo) max(0, wo·m) / (wo·n), from Walter's formulas.
    fn density(wo: DVec3, m: DVec3, alpha: f64) -> f64 {
        let d = |m: DVec3| {
            let t = (m.x * m.x + m.y * m.y) / (alpha * alpha) + m.z * m.z;
            1.0 / (std::f64::consts::PI * alpha * alpha * t * t)
        };
        let tan2 = (1.0 - wo.z * wo.z) / (wo.z * wo.z);
        let g1 = 2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt());
        d(m) * g1 * wo.dot(m).max(0.0) / wo.z
    }

    /// Compares means over the samples with integrals of the density over the hemisphere.
    #[test]
    fn facets_follow_the_visible_ggx_normals() {
        for (roughness, degrees) in [(0.3, 0.0), (0.3, 60.0), (0.7, 30.0), (0.7, 85.0), (1.0, 70.0f64)] {
            let wo = DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
            let alpha = roughness * roughness;
            let n = 500;
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
            let tests: [&dyn Fn(DVec3) -> f64; 4] =
                [&|m| m.z, &|m| m.x, &|m| m.y * m.y, &|m| if m.z > 0.95 && m.x > 0.0 { 1.0 } else { 0.0 }];
            let (mut sums, mut integrals, mut total) = ([0.0; 4], [0.0; 4], 0.0);
            for i in 0..n * n {
                let m = sample_ggx_vndf(wo, DVec3::Z, roughness, [at(i % n), at(i / n)]);
                assert!((m.length() - 1.0).abs() < 1e-9 && m.z >= 0.0);
                // Uniform over the hemisphere in angle, with the solid angle as weight.
                let (theta, phi) = (at(i % n) * std::f64::consts::FRAC_PI_2, at(i / n) * std::f64::consts::TAU);
                let v = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let weight = density(wo, v, alpha) * theta.sin() * std::f64::consts::PI * std::f64::consts::PI;
                let walter = density(wo, v, alpha);
                assert!((ggx_vndf_pdf(wo, DVec3::Z, roughness, v) - walter).abs() <= 1e-9 * walter);
                total += weight / f64::from(n * n);
                for (k, test) in tests.iter().enumerate() {
                    sums[k] += test(m) / f64::from(n * n);
                    integrals[k] += weight * test(v) / f64::from(n * n);
                }
            }
            assert!((total - 1.0).abs() < 2e-3, "the density's own integral: {total}");
            for (sum, integral) in sums.iter().zip(integrals) {
                assert!((sum - integral).abs() < 4e-3, "{roughness}, {degrees}: {sums:?} and {integrals:?}");
            }
        }
    }

    #[test]
    fn polished_facets_are_the_surface() {
        let (n, wo) = (DVec3::new(0.3, 1.0, -0.2).normalize(), DVec3::new(1.0, 0.4, 0.3).normalize());
        for u in [[0.1, 0.2], [0.9, 0.999]] {
            let facet = sample_ggx_vndf(wo, n, 1e-6, u);
            assert!((reflect(wo, facet) - reflect(wo, n)).length() < 1e-9);
            assert!((refract(wo, facet, 0.7).unwrap() - refract(wo, n, 0.7).unwrap()).length() < 1e-9);
        }
    }

    #[test]
    fn no_direction_leads_through_the_surface() {
        for i in 0..10_000u32 {
            let u = [f64::from(i % 100) / 100.0, f64::from(i / 100) / 100.0];
            let wo = DVec3::new(1.0, 0.02, 0.0).normalize();
            let mirrored = reflect(wo, sample_ggx_vndf(wo, DVec3::Y, 1.0, u));
            let d = reflect_into_hemisphere(mirrored, DVec3::Y);
            assert!(d.y >= 0.0 && (d.length() - 1.0).abs() < 1e-12, "{d}");
        }
    }
}
