//! What the tests of all scattering share.

use super::{Bsdf, Material, MaterialModel, PreparedMaterial, ScatteringFrame};
use crate::shape::testing::Random;
use glam::DVec3;
use std::f64::consts::TAU;

/// The scattering of a material of this model.
pub(super) fn bsdf_of(model: impl Into<MaterialModel>, frame: ScatteringFrame) -> Bsdf {
    let material = PreparedMaterial::new(Material::new("test", model), |_| false);
    material.bsdf(material.plain(), frame)
}

pub(super) fn direction(degrees: f64) -> DVec3 {
    DVec3::new(libm::sin(degrees.to_radians()), 0.0, libm::cos(degrees.to_radians()))
}

/// The direction at a height and a part of a turn.
fn at_height(z: f64, turn: f64) -> DVec3 {
    let ((sin, cos), across) = (libm::sincos(TAU * turn), (1.0 - z * z).sqrt());
    DVec3::new(across * cos, across * sin, z)
}

/// A value and its standard error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub(super) mean: f64,
    pub(super) error: f64,
}

impl Estimate {
    /// Whether the value is at most this but for three standard errors.
    pub(super) fn is_at_most(&self, most: f64) -> bool {
        self.mean <= most + 3.0 * self.error
    }

    /// Whether the value is within this distance of 1 but for three standard errors.
    pub(super) fn is_one_within(&self, distance: f64) -> bool {
        (self.mean - 1.0).abs() <= distance + 3.0 * self.error && self.error < distance
    }
}

/// The mean of a function over the unit cube by stratified samples: in blocks of 1024, whose means are independent,
/// until the standard error is small.
fn mean(f: impl Fn(f64, [f64; 2]) -> f64) -> Estimate {
    const SIDE: u32 = 32;
    const SIZE: u32 = SIDE * SIDE;
    let mut random = Random(1);
    let (mut sum, mut squares, mut blocks) = (0.0, 0.0, 0.0);
    loop {
        let mut block = 0.0;
        // Steps of an odd number visit every stratum of the third number once.
        let (first, step) = (random.within(0.0, SIZE as f32) as u32, 2 * (random.within(0.0, 512.0) as u32) + 1);
        for i in 0..SIZE {
            let mut within =
                |stratum: u32, strata: u32| (f64::from(stratum) + f64::from(random.unit())) / f64::from(strata);
            let u = [within(i % SIDE, SIDE), within(i / SIDE, SIDE)];
            block += f(within((first + i * step) % SIZE, SIZE), u) / f64::from(SIZE);
        }
        (sum, squares, blocks) = (sum + block, squares + block * block, blocks + 1.0);
        let mean = sum / blocks;
        let error = ((squares / blocks - mean * mean).max(0.0) / (blocks - 1.0)).sqrt();
        if blocks >= 8.0 && error < 5e-4 || blocks == 256.0 {
            return Estimate { mean, error };
        }
    }
}

/// The share of light from all sides that leaves at an angle to the normal.
pub(super) fn albedo(bsdf: &Bsdf, degrees: f64) -> Estimate {
    albedo_of(bsdf, degrees, |_| 1.0)
}

/// The albedo without the squeezing of radiance by a boundary of this ηᵢ/ηₜ.
pub(super) fn unsqueezed_albedo(bsdf: &Bsdf, eta_ratio: f64, degrees: f64) -> Estimate {
    albedo_of(bsdf, degrees, |wi| if wi.z > 0.0 { 1.0 } else { 1.0 / (eta_ratio * eta_ratio) })
}

/// The albedo with a factor for each direction of the arriving light: ∫ f cos θ by quadrature, or by samples where
/// lobes are single directions or narrow.
fn albedo_of(bsdf: &Bsdf, degrees: f64, factor: impl Fn(DVec3) -> f64) -> Estimate {
    let wo = direction(degrees);
    let mut random = Random(3);
    let is_narrow = (0..256).any(|_| {
        let [u_lobe, u0, u1] = [(); 3].map(|()| f64::from(random.unit()));
        bsdf.sample(wo, u_lobe, [u0, u1]).is_some_and(|s| s.is_delta || s.pdf > 100.0)
    });
    if is_narrow {
        return mean(|u_lobe, u| bsdf.sample(wo, u_lobe, u).map_or(0.0, |s| f64::from(s.f.g) / s.pdf * factor(s.wi)));
    }
    let f = |wi: DVec3| f64::from(bsdf.eval(wo, wi).g) * factor(wi);
    Estimate { mean: sphere_integral(&f), error: 2e-4 }
}

/// The integral of a function over the sphere of directions.
pub(super) fn sphere_integral(f: &impl Fn(DVec3) -> f64) -> f64 {
    Cell::all().map(|cell| cell.integral(f)).sum()
}

/// The rows and columns of cells of equal area.
const ROWS: usize = 12;
const COLUMNS: usize = 16;

/// A part of the sphere between two heights and two parts of a turn. Its area is a share of the sphere's.
#[derive(Clone, Copy)]
struct Cell {
    low: [f64; 2],
    high: [f64; 2],
}

impl Cell {
    /// The cells of equal area into which the sphere is divided.
    fn all() -> impl Iterator<Item = Cell> {
        let at = |row: usize, column: usize| [2.0 * row as f64 / ROWS as f64 - 1.0, column as f64 / COLUMNS as f64];
        (0..ROWS * COLUMNS).map(move |i| {
            let (row, column) = (i / COLUMNS, i % COLUMNS);
            Cell { low: at(row, column), high: at(row + 1, column + 1) }
        })
    }

    fn quarters(self) -> [Cell; 4] {
        let Cell { low, high } = self;
        let middle = [0, 1].map(|k: usize| 0.5 * (low[k] + high[k]));
        [0, 1, 2, 3].map(|i: usize| {
            let is_upper = [i & 1 == 1, i & 2 == 2];
            Cell {
                low: [0, 1].map(|k: usize| if is_upper[k] { middle[k] } else { low[k] }),
                high: [0, 1].map(|k: usize| if is_upper[k] { high[k] } else { middle[k] }),
            }
        })
    }

    /// The integral over the cell by Gauss and Legendre's rule of 3 × 3 points.
    fn gauss(self, f: &impl Fn(DVec3) -> f64) -> f64 {
        let offset = 0.5 * 0.6f64.sqrt();
        let rule = [(0.5 - offset, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + offset, 5.0 / 18.0)];
        let size = [0, 1].map(|k: usize| self.high[k] - self.low[k]);
        let mut sum = 0.0;
        for (x, wx) in rule {
            for (y, wy) in rule {
                sum += wx * wy * f(at_height(self.low[0] + x * size[0], self.low[1] + y * size[1]));
            }
        }
        sum * size[0] * size[1] * TAU
    }

    /// The integral over the cell.
    fn integral(self, f: &impl Fn(DVec3) -> f64) -> f64 {
        self.quarters().map(|quarter| quarter.divided(f, quarter.gauss(f), 7)).iter().sum()
    }

    /// The integral over the cell, which is divided until its quarters agree with the integral as a whole.
    fn divided(self, f: &impl Fn(DVec3) -> f64, whole: f64, times: u32) -> f64 {
        let quarters = self.quarters().map(|quarter| (quarter, quarter.gauss(f)));
        let sum = quarters.iter().map(|(_, part)| part).sum::<f64>();
        if times == 0 || (sum - whole).abs() < 1e-5 {
            return sum;
        }
        quarters.iter().map(|(quarter, part)| quarter.divided(f, *part, times - 1)).sum()
    }
}

/// Checks that random directions fall into cells of the sphere as often as the density says, by χ², and that the
/// density and f of a sample are those of its direction. `delta` is the probability of delta lobes.
pub(super) fn check_sampling(bsdf: &Bsdf, wo: DVec3, delta: f64) {
    let n = 1 << 16;
    let mut counts = [0.0; ROWS * COLUMNS];
    let (mut deltas, mut lost) = (0.0, 0.0);
    let mut random = Random(2);
    for i in 0..n {
        let [u_lobe, u0, u1] = [(); 3].map(|()| f64::from(random.unit()));
        let Some(s) = bsdf.sample(wo, u_lobe, [u0, u1]) else {
            lost += 1.0;
            continue;
        };
        assert!((s.wi.length() - 1.0).abs() < 1e-9 && s.pdf > 0.0, "{s:?}");
        if s.is_delta {
            deltas += 1.0;
            continue;
        }
        if i % 16 == 0 {
            assert!((s.pdf / bsdf.pdf(wo, s.wi) - 1.0).abs() < 1e-9 && s.f == bsdf.eval(wo, s.wi), "{s:?}");
        }
        let row = ((s.wi.z + 1.0) * 0.5 * ROWS as f64) as usize;
        let turn = (libm::atan2(s.wi.y, s.wi.x) / TAU).rem_euclid(1.0);
        counts[row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1)] += 1.0;
    }
    let n = f64::from(n);
    let density = |wi: DVec3| bsdf.pdf(wo, wi);
    let expected: Vec<f64> = Cell::all().map(|cell| n * cell.integral(&density)).collect();
    // Directions into the surface are the rest. Total reflections end at edges, where the integral is less exact.
    let total = expected.iter().sum::<f64>() + n * delta + lost;
    let slack = 4.0 * (lost * (1.0 - lost / n)).sqrt() + 1e-3 * n;
    assert!((total - n).abs() < slack, "{bsdf:?}, {wo}: a density of {} in all, ± {}", total / n, slack / n);
    // χ², where the cells of few directions count as one.
    let (mut chi2, mut cells, mut few) = (0.0, 0.0, (0.0, 0.0));
    let mut add = |count: f64, expected: f64| {
        chi2 += (count - expected) * (count - expected) / expected;
        cells += 1.0;
    };
    for (count, expected) in counts.iter().copied().zip(expected).chain([(deltas, n * delta)]) {
        if expected > 8.0 {
            add(count, expected);
        } else {
            few = (few.0 + count, few.1 + expected);
        }
    }
    add(few.0, few.1.max(1.0));
    assert!(chi2 < cells + 4.0 * (2.0f64 * cells).sqrt(), "{bsdf:?}, {wo}: χ² {chi2} of {cells} cells");
}
