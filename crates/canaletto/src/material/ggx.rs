//! The GGX distribution of microfacets with height-correlated shadowing and masking (Walter et al. 2007; Heitz,
//! *Understanding the Masking-Shadowing Function*, 2014), and the light that one scattering loses.

use super::microfacet::sample_ggx_vndf;
use super::reflect;
use glam::DVec3;
use std::sync::LazyLock;

/// Λ of Smith's masking function. `cos` is the cosine between a direction and the normal, of any sign but not 0.
fn lambda(cos: f64, alpha: f64) -> f64 {
    let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// G₂ / G₁(wo): the share of the microfacets seen from one direction that the other one sees, too. The cosines are
/// those of the directions and the normal.
pub(super) fn shadowing(cos_o: f64, cos_i: f64, roughness: f64) -> f64 {
    let alpha = roughness * roughness;
    let (o, i) = (lambda(cos_o, alpha), lambda(cos_i, alpha));
    (1.0 + o) / (1.0 + o + i)
}

/// The rows (roughness) and columns (cosine) of [`ALBEDOS`].
const SIDE: usize = 32;

/// The albedo of a rough metal that reflects all light, for one scattering: what doesn't leave at once is missing.
static ALBEDOS: LazyLock<[[f32; SIDE]; SIDE]> = LazyLock::new(|| {
    std::array::from_fn(|row| std::array::from_fn(|column| single_scattering_albedo(place(column), place(row)) as f32))
});

/// The value of a row or column, from nearly 0 to 1.
fn place(index: usize) -> f64 {
    (index as f64 / (SIDE - 1) as f64).max(1e-3)
}

/// The mean of G₂ / G₁ over the microfacets that are seen from a direction.
fn single_scattering_albedo(cos: f64, roughness: f64) -> f64 {
    const POINTS: u32 = 1024;
    let wo = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..POINTS {
        // Few facets lean far, so that number has the finer steps.
        let u = [(f64::from(i) * 0.618_033_988_749_894_9).fract(), (f64::from(i) + 0.5) / f64::from(POINTS)];
        let wi = reflect(wo, sample_ggx_vndf(wo, DVec3::Z, roughness, u));
        if wi.z > 0.0 {
            sum += shadowing(cos, wi.z, roughness);
        }
    }
    sum / f64::from(POINTS)
}

/// E(cos θ, roughness): the albedo of one scattering by a metal that reflects all light, interpolated in a table.
pub(super) fn albedo(cos: f64, roughness: f64) -> f64 {
    let [(row, down), (column, right)] = [roughness, cos].map(|value| {
        let at = value.clamp(0.0, 1.0) * (SIDE - 1) as f64;
        let index = (at as usize).min(SIDE - 2);
        (index, at - index as f64)
    });
    let table = &*ALBEDOS;
    let along = |row: usize| f64::from(table[row][column]) * (1.0 - right) + f64::from(table[row][column + 1]) * right;
    along(row) * (1.0 - down) + along(row + 1) * down
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E(1) by numerical integration over tan² θ, and 1 − ln 2 for α = 1.
    #[test]
    fn albedos_are_the_known_ones() {
        for (alpha, cos, expected) in
            [(1.0f64, 1.0, 1.0 - std::f64::consts::LN_2), (0.5, 1.0, 0.687_849), (0.2, 1.0, 0.947_658)]
        {
            let ours = single_scattering_albedo(cos, alpha.sqrt());
            assert!((ours - expected).abs() < 2e-3, "{alpha}: {ours}");
            assert!((albedo(cos, alpha.sqrt()) - ours).abs() < 5e-3, "{alpha}: {}", albedo(cos, alpha.sqrt()));
        }
    }
}
