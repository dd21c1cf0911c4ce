//! What the tests of all scattering share.

use super::{Bsdf, Material, MaterialModel, MaterialPoint, ScatteringFrame};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// The scattering of a material of this model.
pub(super) fn bsdf_of(model: impl Into<MaterialModel>, frame: ScatteringFrame) -> Bsdf {
    let material = Material::new("test", model);
    material.bsdf(&MaterialPoint { model: material.model, ..MaterialPoint::default() }, frame)
}

pub(super) fn direction(degrees: f64) -> DVec3 {
    DVec3::new(libm::sin(degrees.to_radians()), 0.0, libm::cos(degrees.to_radians()))
}

/// Numbers of a sample: a point of a grid, whose side is a power of two, and a number that has nothing to do with it,
/// since lobes of small probability would see a part of any lattice. All these numbers are evenly spaced.
fn numbers(i: u32, n: u32) -> (f64, [f64; 2]) {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    // A permutation: each step can be undone.
    let (mask, bits) = (n * n - 1, (n * n).trailing_zeros());
    let mut shuffled = i;
    for factor in [0x9e37_79b1u32, 0x85eb_ca77, 0xc2b2_ae3d] {
        shuffled = shuffled.wrapping_mul(factor) & mask;
        shuffled ^= shuffled >> (bits / 2);
    }
    ((f64::from(shuffled) + 0.5) / f64::from(n * n), [at(i % n), at(i / n)])
}

/// The share of light from all sides that leaves at an angle to the normal, by sampling.
pub(super) fn albedo(bsdf: &Bsdf, degrees: f64) -> f64 {
    albedo_of(bsdf, degrees, |_| 1.0)
}

/// The albedo with a factor for each direction of the arriving light.
pub(super) fn albedo_of(bsdf: &Bsdf, degrees: f64, factor: impl Fn(DVec3) -> f64) -> f64 {
    let n = 256;
    let sample = |i: u32| {
        let (u_lobe, u) = numbers(i, n);
        bsdf.sample(direction(degrees), u_lobe, u).map_or(0.0, |s| f64::from(s.f.g) / s.pdf * factor(s.wi))
    };
    (0..n * n).map(sample).sum::<f64>() / f64::from(n * n)
}

/// Checks that sampled directions fall into bins of the sphere as often as the density says, and that f of a sample is
/// that of its direction.
pub(super) fn check_density(bsdf: &Bsdf, degrees: f64) {
    const ROWS: usize = 12;
    const COLUMNS: usize = 16;
    let wo = direction(degrees);
    let n = 512;
    let mut counts = vec![0.0; ROWS * COLUMNS];
    for i in 0..n * n {
        let (u_lobe, u) = numbers(i, n);
        let Some(s) = bsdf.sample(wo, u_lobe, u) else { continue };
        assert!(!s.is_delta && (s.wi.length() - 1.0).abs() < 1e-9);
        assert!((s.pdf - bsdf.pdf(wo, s.wi)).abs() <= 1e-9 * s.pdf && s.f == bsdf.eval(wo, s.wi));
        let row = ((s.wi.z + 1.0) * 0.5 * ROWS as f64) as usize;
        let turn = (libm::atan2(s.wi.y, s.wi.x) / TAU).rem_euclid(1.0);
        counts[row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1)] += 1.0;
    }
    for (bin, count) in counts.iter().enumerate() {
        let (row, column) = (bin / COLUMNS, bin % COLUMNS);
        // Lobes near the poles are narrow in z.
        let fine = if row == 0 || row == ROWS - 1 { 100 } else { 40 };
        let mut expected = 0.0;
        for i in 0..fine * fine {
            let at = |start: usize, i: u32| start as f64 + (f64::from(i) + 0.5) / f64::from(fine);
            let z = at(row, i % fine) / ROWS as f64 * 2.0 - 1.0;
            let (sin, cos) = libm::sincos(at(column, i / fine) / COLUMNS as f64 * TAU);
            let across = (1.0 - z * z).sqrt();
            expected += bsdf.pdf(wo, DVec3::new(across * cos, across * sin, z));
        }
        expected *= 4.0 * PI / (ROWS * COLUMNS) as f64 / f64::from(fine * fine) * f64::from(n * n);
        // Numerical integrals of peaks are off by some percent.
        let slack = 5.0 * expected.sqrt() + 0.02 * expected + 5.0;
        assert!((count - expected).abs() < slack, "{degrees}°, bin {row}, {column}: {count} for {expected}");
    }
}
