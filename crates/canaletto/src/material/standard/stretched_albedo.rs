//! The light that one scattering by stretched microfacets keeps, seen from the side of the thinner medium.
//!
//! A table has rows by index η, roughness and stretch, which are computed when they are first used. A row has columns
//! by the viewer's height and azimuth. The steps are small where facets lose most light: near grazing, and across the
//! stretch where it is strong.

use super::super::dielectric_albedo::{Kept, facets, kept, split};
use super::super::ggx::Ggx;
use super::super::reflect;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;
use std::sync::{LazyLock, OnceLock};

/// The steps between indices, which are equally spaced by (η − 1) / (η + 1).
const INDICES: usize = 20;
/// The rows by roughness r, where αx² + αy² = 2 r⁴, and by αy / αx. Both are equally spaced by square roots.
const ROUGHNESSES: usize = 24;
const STRETCHES: usize = 13;
/// The columns, by the square root of the height and by azimuth.
const HEIGHTS: usize = 32;
const AZIMUTHS: usize = 13;
/// The least αy / αx.
const LEAST: f64 = 1e-2;

/// The facets that a value is the mean of.
static FACETS: LazyLock<Vec<(DVec2, f64)>> = LazyLock::new(|| facets(610, 1.0));

/// The albedos at a direction: of facets that mirror all light, and what a boundary of clear media mirrors and
/// refracts.
type Albedos = [f32; 3];

type Row = [[Albedos; AZIMUTHS]; HEIGHTS];

fn row(index: usize, roughness: usize, stretch: usize) -> &'static Row {
    type Rows = [[OnceLock<Box<Row>>; STRETCHES]; ROUGHNESSES];
    static ALL: [Rows; INDICES + 1] =
        [const { [const { [const { OnceLock::new() }; STRETCHES] }; ROUGHNESSES] }; INDICES + 1];
    ALL[index][roughness][stretch].get_or_init(|| Box::new(computed_row(index, roughness, stretch)))
}

fn computed_row(index: usize, roughness: usize, stretch: usize) -> Row {
    let place = |i: usize, last: usize| i as f64 / last as f64;
    // The first and last index have no finite η of their own.
    let s = (index as f64).clamp(0.02, INDICES as f64 - 0.5) / INDICES as f64;
    let roughness = place(roughness, ROUGHNESSES - 1).max(0.03);
    let stretch = place(stretch, STRETCHES - 1).max(LEAST.sqrt());
    let ggx = stretched(roughness * roughness, stretch * stretch);
    std::array::from_fn(|height| {
        let root = place(height, HEIGHTS - 1).max(1e-3);
        let cos = root * root;
        std::array::from_fn(|azimuth| {
            let (y, x) = libm::sincos(place(azimuth, AZIMUTHS - 1) * FRAC_PI_2);
            let across = DVec2::new(x * stretch, y).normalize() * (1.0 - cos * cos).max(0.0).sqrt();
            albedos(across.extend(cos), (1.0 - s) / (1.0 + s), &ggx)
        })
    })
}

/// The distribution of facets of a roughness r and αy / αx.
fn stretched(roughness: f64, stretch: f64) -> Ggx {
    let along = roughness * roughness * (2.0 / (1.0 + stretch * stretch)).sqrt();
    Ggx { alpha: [along, along * stretch] }
}

fn albedos(wo: DVec3, eta_ratio: f64, ggx: &Ggx) -> Albedos {
    let Kept { mirrored, refracted } = kept(wo, eta_ratio, ggx, &FACETS);
    [lit(wo, ggx, &FACETS), mirrored, refracted].map(|v| v as f32)
}

/// The mean of G₂ / G₁ over the facets that are seen.
fn lit(wo: DVec3, ggx: &Ggx, facets: &[(DVec2, f64)]) -> f64 {
    let squeezed = ggx.squeezed(wo);
    let mirrored =
        |(circle, u): &(DVec2, f64)| reflect(wo, ggx.on_cap(squeezed, squeezed.z, (*circle).into(), *u).into());
    let lit = facets.iter().map(mirrored).filter(|wi| wi.z > 0.0).map(|wi| ggx.shadowing(wo, wi));
    lit.sum::<f64>() / facets.len() as f64
}

/// The albedo of facets that mirror all light, and what the boundary of clear media keeps, for ηᵢ/ηₜ of at most 1. The
/// frame is that of the facets, with αy ≤ αx.
pub(super) fn stretched_albedo(wo: DVec3, eta_ratio: f64, ggx: &Ggx) -> (f64, Kept) {
    let [x, y] = ggx.alpha;
    let stretch = (y / x).clamp(LEAST, 1.0).sqrt();
    let roughness = (0.5 * (x * x + y * y)).sqrt().sqrt().sqrt();
    // The azimuth where the stretch is halved.
    let azimuth = if wo.x == 0.0 && wo.y == 0.0 { 0.0 } else { libm::atan2(wo.y.abs() * stretch, wo.x.abs()) };
    let rows = [
        split((1.0 - eta_ratio) / (1.0 + eta_ratio) * INDICES as f64, INDICES),
        split(roughness * (ROUGHNESSES - 1) as f64, ROUGHNESSES - 1),
        split(stretch * (STRETCHES - 1) as f64, STRETCHES - 1),
    ];
    let columns = [
        split(wo.z.max(0.0).sqrt() * (HEIGHTS - 1) as f64, HEIGHTS - 1),
        split(azimuth / FRAC_PI_2 * (AZIMUTHS - 1) as f64, AZIMUTHS - 1),
    ];
    let mut sum = [0.0; 3];
    let shares = |pair: [(usize, f64); 2]| pair.into_iter().filter(|(_, share)| *share > 0.0);
    for (index, by_index) in shares(rows[0]) {
        for (roughness, by_roughness) in shares(rows[1]) {
            for (stretch, by_stretch) in shares(rows[2]) {
                let row = row(index, roughness, stretch);
                for (height, by_height) in shares(columns[0]) {
                    for (azimuth, by_azimuth) in shares(columns[1]) {
                        let share = by_index * by_roughness * by_stretch * by_height * by_azimuth;
                        for (sum, albedo) in sum.iter_mut().zip(row[height][azimuth]) {
                            *sum += share * f64::from(albedo);
                        }
                    }
                }
            }
        }
    }
    let [lit, mirrored, refracted] = sum;
    (lit, Kept { mirrored, refracted })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the table says is the mean over many facets, also between its rows and columns.
    #[test]
    fn tables_hold_the_means_over_facets() {
        let facets = facets(6765, 1.0);
        for (eta, roughness, stretch) in
            [(1.5, 0.1, 0.34), (1.3, 0.22, 0.1), (1.5, 0.6, 0.1), (2.1, 0.85, 0.7), (1.5, 1.0, 0.2)]
        {
            let (ggx, ratio) = (stretched(roughness, stretch), 1.0 / eta);
            for degrees in [0.0f64, 30.0, 50.0, 65.0, 75.0, 82.0, 88.0] {
                for turn in [10.0f64, 40.0, 85.0] {
                    let ((sin, cos), (y, x)) = (libm::sincos(degrees.to_radians()), libm::sincos(turn.to_radians()));
                    let wo = DVec3::new(sin * x, sin * y, cos);
                    let (ours, exact) = (stretched_albedo(wo, ratio, &ggx), kept(wo, ratio, &ggx, &facets));
                    let off = [
                        ours.0 - lit(wo, &ggx, &facets),
                        ours.1.total() - exact.total(),
                        ours.1.mirrored - exact.mirrored,
                    ];
                    let is_near = off.iter().all(|off| off.abs() < 7e-3);
                    assert!(is_near, "{eta}, {roughness}, {stretch}, {degrees}°, {turn}°: {off:?}");
                }
            }
        }
    }
}
