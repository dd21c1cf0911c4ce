//! A density of directions, learnt from samples of radiance: a mixture of von Mises–Fisher lobes with distances
//! (Ruppert, Herholz & Lensch, *Robust Fitting of Parallax-Aware Mixtures for Path Guiding*, 2020).
//!
//! A lobe's density is κ / (2π (1 − e^−2κ)) e^(κ (μ · ω − 1)). Its distance tells where its light comes from, so that
//! another point of the cell turns the lobe towards there.

use canaletto_bvh::{InstructionSet, Kernel};
use glam::DVec3;
use std::f64::consts::TAU;

/// The number of lobes.
pub(super) const LOBES: usize = 8;

/// The lobes that begin at the brightest places; the others begin evenly over the sphere.
const PEAKS: usize = 5;

/// The steps of expectation and maximisation.
const STEPS: usize = 12;

/// The number of samples that a lobe's mean cosine is held against, as if they came evenly from all directions.
const PRIOR_SAMPLES: f64 = 0.05;

/// The share that each lobe has before any sample, so that none vanishes.
const PRIOR_SHARE: f64 = 0.01;

/// The largest κ.
const LARGEST: f64 = 1e4;

/// The largest share of the light that one sample may have. What is above is left out.
const LARGEST_SHARE: f64 = 0.02;

/// κ of the lobe that stands for a cosine (Herholz et al. 2016).
const COSINE: f32 = 2.188_53;

/// The least κ. Below it the density is even.
const SMALLEST: f32 = 0.01;

/// A sample of the radiance from a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct RadianceSample {
    /// The unit direction.
    pub(super) direction: [f32; 3],
    /// The radiance over the density with which the direction was sampled.
    pub(super) energy: f32,
    /// The inverse of the distance to what sends the light; 0 for light from infinity.
    pub(super) inverse_distance: f32,
}

impl RadianceSample {
    fn direction(&self) -> DVec3 {
        DVec3::from(self.direction.map(f64::from))
    }
}

/// The mixture.
#[derive(Clone, Debug)]
pub(super) struct Mixture {
    /// The point that the directions lead from.
    pub(super) pivot: DVec3,
    /// The mixture there.
    pub(super) at_pivot: LocalMixture,
    /// The inverse of each lobe's distance.
    pub(super) inverse_distances: Lanes,
}

/// Numbers of all lobes, side by side.
type Lanes = [f32; LOBES];

/// A mixture as a point has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalMixture {
    /// The lobes' shares.
    pub(super) shares: Lanes,
    /// The components of their mean directions.
    pub(super) means: [Lanes; 3],
    pub(super) kappas: Lanes,
    /// Their densities in the mean directions: κ / (2π (1 − e^−2κ)).
    pub(super) peaks: Lanes,
}

#[derive(Clone, Copy, Debug, Default)]
struct Lobe {
    /// The share of the mixture.
    share: f64,
    /// The unit mean direction.
    mean: DVec3,
    kappa: f64,
    /// κ / (2π (1 − e^−2κ)).
    peak: f64,
}

impl Lobe {
    fn new(share: f64, mean: DVec3, kappa: f64) -> Lobe {
        let kappa = kappa.max(SMALLEST.into());
        Lobe { share, mean, kappa, peak: kappa / (TAU * -libm::expm1(-2.0 * kappa)) }
    }
}

impl Mixture {
    /// The mixture of samples that were taken around a point; none if they are black or few.
    pub(super) fn new(samples: &[RadianceSample], pivot: DVec3, fewest: usize) -> Option<Mixture> {
        let bright: Vec<(DVec3, f64, f64)> = samples
            .iter()
            .filter(|sample| sample.energy > 0.0)
            .map(|sample| (sample.direction(), f64::from(sample.energy), f64::from(sample.inverse_distance)))
            .collect();
        let whole: f64 = bright.iter().map(|sample| sample.1).sum();
        if bright.len() < fewest || !whole.is_finite() {
            return None;
        }
        let bright: Vec<_> = bright.into_iter().map(|(d, e, i)| (d, e.min(whole * LARGEST_SHARE), i)).collect();
        let total: f64 = bright.iter().map(|sample| sample.1).sum();
        let mut lobes = first_lobes(&bright);
        let mut inverse_distances = [0.0; LOBES];
        for _ in 0..STEPS {
            let ExpectedParts { weights, directions, inverse_distances: inverses, counts } =
                InstructionSet::run(Expectation { mixture: &LocalMixture::of(&lobes), bright: &bright });
            for i in 0..LOBES {
                let (weight, count) = (weights[i], counts[i]);
                let direction = DVec3::from(directions.map(|axis| axis[i]));
                let share = (weight / total + PRIOR_SHARE) / (1.0 + PRIOR_SHARE * LOBES as f64);
                lobes[i].share = share;
                if weight <= 0.0 {
                    continue;
                }
                let cosine = direction.length() / weight * count / (count + PRIOR_SAMPLES);
                // Banerjee et al. 2005.
                let kappa = cosine * (3.0 - cosine * cosine) / (1.0 - cosine * cosine).max(1e-9);
                lobes[i] = Lobe::new(share, direction.try_normalize().unwrap_or(lobes[i].mean), kappa.min(LARGEST));
                inverse_distances[i] = inverses[i] / weight;
            }
        }
        let at_pivot = LocalMixture::of(&lobes);
        Some(Mixture { pivot, at_pivot, inverse_distances: inverse_distances.map(|inverse| inverse as f32) })
    }

    /// The mixture at a point near the pivot, times the cosine to a unit normal if there is one.
    pub(super) fn at(&self, point: DVec3, normal: Option<DVec3>) -> LocalMixture {
        InstructionSet::run(MoveMixture {
            mixture: self,
            from_pivot: (self.pivot - point).as_vec3().to_array(),
            normal: normal.map(|normal| normal.as_vec3().to_array()),
        })
    }
}

/// Divides samples among lobes. A sample has a direction, a weight and an inverse distance.
struct Expectation<'a> {
    mixture: &'a LocalMixture,
    bright: &'a [(DVec3, f64, f64)],
}

/// Each lobe's sums: of the weights, of what they weigh, and of its parts of the samples.
#[derive(Default)]
struct ExpectedParts {
    weights: [f64; LOBES],
    directions: [[f64; LOBES]; 3],
    inverse_distances: [f64; LOBES],
    counts: [f64; LOBES],
}

impl Kernel for Expectation<'_> {
    type Answer = ExpectedParts;

    #[inline(always)]
    fn run(self) -> ExpectedParts {
        let mut sums = ExpectedParts::default();
        for (direction, energy, inverse_distance) in self.bright {
            let densities = self.mixture.densities(direction.as_vec3().to_array());
            let mut all = 0.0;
            for density in densities {
                all += density;
            }
            if all <= 0.0 {
                continue;
            }
            let mut weights = [0.0; LOBES];
            for i in 0..LOBES {
                let part = f64::from(densities[i] / all);
                weights[i] = part * energy;
                sums.counts[i] += part;
            }
            for (sum, weight) in sums.weights.iter_mut().zip(weights) {
                *sum += weight;
            }
            for (row, axis) in sums.directions.iter_mut().zip(direction.to_array()) {
                for i in 0..LOBES {
                    row[i] += weights[i] * axis;
                }
            }
            for (sum, weight) in sums.inverse_distances.iter_mut().zip(weights) {
                *sum += weight * inverse_distance;
            }
        }
        sums
    }
}

/// Finds the mixture at another point, times a cosine. Loops write to one array each, so that they are vectorised.
struct MoveMixture<'a> {
    mixture: &'a Mixture,
    from_pivot: [f32; 3],
    normal: Option<[f32; 3]>,
}

impl Kernel for MoveMixture<'_> {
    type Answer = LocalMixture;

    #[inline(always)]
    fn run(self) -> LocalMixture {
        let near = &self.mixture.inverse_distances;
        let LocalMixture { mut shares, mut means, mut kappas, mut peaks } = self.mixture.at_pivot;
        // The directions to pivot + μ d.
        for (row, from_pivot) in means.iter_mut().zip(self.from_pivot) {
            for i in 0..LOBES {
                row[i] += from_pivot * near[i];
            }
        }
        normalize(&mut means);
        if let Some(normal) = self.normal {
            // A product of two lobes is a lobe. Its integral goes into its share.
            for (row, normal) in means.iter_mut().zip(normal) {
                for i in 0..LOBES {
                    row[i] = row[i] * kappas[i] + normal * COSINE;
                }
            }
            let mut products = normalize(&mut means);
            for product in &mut products {
                *product = if *product > SMALLEST { *product } else { SMALLEST };
            }
            let product_peaks = peaks_of(&products);
            for i in 0..LOBES {
                let ratio = exp(products[i] - kappas[i] - COSINE);
                shares[i] = shares[i] * peaks[i] / product_peaks[i] * ratio;
            }
            (kappas, peaks) = (products, product_peaks);
        }
        let mut total = 0.0;
        for share in shares {
            total += share;
        }
        for share in &mut shares {
            *share /= total;
        }
        LocalMixture { shares, means, kappas, peaks }
    }
}

/// Finds the density of a mixture.
struct Density<'a> {
    mixture: &'a LocalMixture,
    direction: [f32; 3],
}

impl Kernel for Density<'_> {
    type Answer = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut sum = 0.0;
        for density in self.mixture.densities(self.direction) {
            sum += f64::from(density);
        }
        sum
    }
}

impl LocalMixture {
    fn of(lobes: &[Lobe; LOBES]) -> LocalMixture {
        LocalMixture {
            shares: lobes.map(|lobe| lobe.share as f32),
            means: [0, 1, 2].map(|axis| lobes.map(|lobe| lobe.mean[axis] as f32)),
            kappas: lobes.map(|lobe| lobe.kappa as f32),
            peaks: lobes.map(|lobe| lobe.peak as f32),
        }
    }

    /// The density of each lobe in a direction, times its share.
    #[inline(always)]
    fn densities(&self, d: [f32; 3]) -> Lanes {
        let LocalMixture { shares, means: [x, y, z], kappas, peaks } = self;
        let mut densities = [0.0; LOBES];
        for i in 0..LOBES {
            // 1 − μ · ω = |μ − ω|² / 2 keeps its digits near the mean direction.
            let (x, y, z) = (x[i] - d[0], y[i] - d[1], z[i] - d[2]);
            densities[i] = shares[i] * peaks[i] * exp(-0.5 * kappas[i] * (x * x + y * y + z * z));
        }
        densities
    }

    /// A random unit direction for `u` of the unit square.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let mut rest = u;
        let mut chosen = LOBES - 1;
        for (i, share) in self.shares.iter().enumerate() {
            if rest < f64::from(*share) {
                chosen = i;
                break;
            }
            rest -= f64::from(*share);
        }
        let u = (rest / f64::from(self.shares[chosen])).clamp(0.0, 1.0);
        let kappa = f64::from(self.kappas[chosen]);
        // A lobe times the cosine is even, without a mean direction, if it had led exactly away from the normal.
        let mean = DVec3::from(self.means.map(|axis| f64::from(axis[chosen]))).try_normalize().unwrap_or(DVec3::Y);
        // The inverse of the cumulative density of the cosine (Jakob 2012).
        let cos = 1.0 + libm::log1p(u * libm::expm1(-2.0 * kappa)) / kappa;
        let cos = cos.clamp(-1.0, 1.0);
        let across = libm::sqrt((1.0 - cos * cos).max(0.0));
        let (sin_turn, cos_turn) = libm::sincos(TAU * v);
        let (x, y) = mean.any_orthonormal_pair();
        (x * (across * cos_turn) + y * (across * sin_turn) + mean * cos).normalize()
    }

    /// The density of a unit direction per unit of solid angle.
    pub(super) fn pdf(&self, direction: DVec3) -> f64 {
        InstructionSet::run(Density { mixture: self, direction: direction.as_vec3().to_array() })
    }
}

/// Gives vectors unit length, and returns the length that they had.
#[inline(always)]
fn normalize(vectors: &mut [Lanes; 3]) -> Lanes {
    let [x, y, z] = vectors;
    let mut lengths = [0.0; LOBES];
    for i in 0..LOBES {
        let length = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        lengths[i] = if length > f32::MIN_POSITIVE { length } else { f32::MIN_POSITIVE };
    }
    for axis in vectors {
        for i in 0..LOBES {
            axis[i] /= lengths[i];
        }
    }
    lengths
}

/// κ / (2π (1 − e^−2κ)).
#[inline(always)]
fn peaks_of(kappas: &Lanes) -> Lanes {
    let mut peaks = [0.0; LOBES];
    for i in 0..LOBES {
        peaks[i] = kappas[i] / (std::f32::consts::TAU * (1.0 - exp(-2.0 * kappas[i])));
    }
    peaks
}

/// e^x for x ≤ 88, with a relative error below 3e-7: 2^n for the nearest integer n, and the series for the rest.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // 1.5 × 2²³: added to n, its lowest bits are n.
    const ROUND: f32 = 12_582_912.0;
    let t = if x > -87.0 { x } else { -87.0 } * std::f32::consts::LOG2_E;
    let rounded = t + ROUND;
    let f = (t - (rounded - ROUND)) * std::f32::consts::LN_2;
    let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f / 720.0)))));
    // A conversion to an integer would have bounds, which cost more than the series.
    series * f32::from_bits(rounded.to_bits().wrapping_add(127) << 23)
}

/// The lobes before the first step: some at the brightest places of a coarse grid, others evenly over the sphere.
fn first_lobes(samples: &[(DVec3, f64, f64)]) -> [Lobe; LOBES] {
    const COLUMNS: usize = 24;
    const ROWS: usize = 12;
    let mut cells = [(0.0, DVec3::ZERO); COLUMNS * ROWS];
    for (direction, energy, _) in samples {
        let turn = (libm::atan2(direction.z, direction.x) / TAU + 1.0).fract();
        let column = ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let row = (((0.5 + 0.5 * direction.y).max(0.0) * ROWS as f64) as usize).min(ROWS - 1);
        let cell = &mut cells[row * COLUMNS + column];
        *cell = (cell.0 + energy, cell.1 + *direction * *energy);
    }
    let even = |i: usize, count: usize| {
        // A spherical Fibonacci lattice.
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = libm::sincos(TAU * i as f64 * 0.618_033_988_749_895);
        let across = libm::sqrt(1.0 - y * y);
        DVec3::new(across * cos, y, across * sin)
    };
    std::array::from_fn(|i| {
        let brightest = (0..cells.len()).reduce(|a, b| if cells[b].0 > cells[a].0 { b } else { a });
        let peak = brightest.filter(|cell| i < PEAKS && cells[*cell].0 > 0.0);
        let Some(mean) = peak.and_then(|cell| cells[cell].1.try_normalize()) else {
            return Lobe::new(1.0 / LOBES as f64, even(i, LOBES), 2.0);
        };
        for cell in &mut cells {
            if cell.1.try_normalize().is_some_and(|d| d.dot(mean) > 0.9) {
                *cell = (0.0, DVec3::ZERO);
            }
        }
        Lobe::new(1.0 / LOBES as f64, mean, 20.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;
    use std::f64::consts::PI;

    /// The unit direction at a place of the unit square, which keeps areas.
    fn direction([u, v]: [f64; 2]) -> DVec3 {
        let y = 2.0 * v - 1.0;
        let (sin, cos) = libm::sincos(TAU * u);
        let across = (1.0 - y * y).max(0.0).sqrt();
        DVec3::new(across * cos, y, across * sin)
    }

    fn place(d: DVec3) -> [f64; 2] {
        let turn = (libm::atan2(d.z, d.x) / TAU + 1.0).fract();
        [turn, 0.5 + 0.5 * d.y].map(|x| x.clamp(0.0, 1.0 - f64::EPSILON))
    }

    /// A bright ball around (3, 1, −2) as the origin sees it, and a dim half of the sphere.
    fn mixture() -> Mixture {
        let sampler = Sampler::new(5, 0, [0; 2]);
        let ball = DVec3::new(3.0, 1.0, -2.0);
        let samples: Vec<RadianceSample> = (0..6000)
            .map(|i| {
                let d = direction([sampler.uniform(i, 0), sampler.uniform(i, 1)]);
                let is_bright = d.angle_between(ball) < 0.1;
                let energy = if is_bright { 300.0 } else { f32::from(u8::from(d.x > 0.0)) };
                let inverse_distance = if is_bright { 1.0 / ball.length() } else { 0.1 };
                RadianceSample { direction: d.as_vec3().to_array(), energy, inverse_distance: inverse_distance as f32 }
            })
            .collect();
        Mixture::new(&samples, DVec3::ZERO, 1).unwrap()
    }

    /// Directions fall into the cells of a grid as often as the density says (χ²), at the pivot and elsewhere, with and
    /// without a cosine.
    #[test]
    fn directions_have_their_density() {
        let mixture = mixture();
        const SIDE: usize = 32;
        const FINE: usize = 16;
        let n = 512;
        let sampler = Sampler::new(6, 0, [0; 2]);
        let moved = DVec3::new(0.5, -0.5, 0.3);
        for local in [mixture.at(DVec3::ZERO, None), mixture.at(moved, None), mixture.at(moved, Some(DVec3::Y))] {
            let bin = |at: [f64; 2]| (at[1] * SIDE as f64) as usize * SIDE + (at[0] * SIDE as f64) as usize;
            let mut counts = vec![0.0; SIDE * SIDE];
            for i in 0..n * n {
                let d = local.sample([sampler.uniform(i, 0), sampler.uniform(i, 1)]);
                assert!((d.length() - 1.0).abs() < 1e-12 && local.pdf(d) > 0.0, "{d}");
                counts[bin(place(d))] += 1.0;
            }
            let mut expected = vec![0.0; SIDE * SIDE];
            let side = SIDE * FINE;
            for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
                let at = [column, row].map(|i| (i as f64 + 0.5) / side as f64);
                expected[bin(at)] += local.pdf(direction(at)) * 4.0 * PI / (side * side) as f64 * f64::from(n * n);
            }
            let all: f64 = expected.iter().sum();
            assert!((all / f64::from(n * n) - 1.0).abs() < 2e-3, "{all}");
            for (count, expected) in counts.iter().zip(&expected) {
                assert!(
                    (count - expected).abs() <= 5.0 * expected.sqrt() + 2e-3 * expected + 2.0,
                    "{count} for {expected}"
                );
            }
        }
    }

    /// From another point, the ball is where it is, not in the direction that was learnt.
    #[test]
    fn lobes_turn_with_the_point() {
        let (mixture, ball) = (mixture(), DVec3::new(3.0, 1.0, -2.0));
        for point in [DVec3::ZERO, DVec3::new(0.8, -0.6, 0.7), DVec3::new(-0.5, 1.0, 0.5)] {
            let local = mixture.at(point, None);
            let there = local.pdf((ball - point).normalize());
            assert!(there > 5.0, "{point}: {there}");
            assert!(point == DVec3::ZERO || local.pdf(ball.normalize()) < 0.7 * there, "{point}");
        }
    }

    /// With a cosine, more directions lie before the surface.
    #[test]
    fn a_cosine_prefers_what_the_surface_faces() {
        let mixture = mixture();
        let before = |normal: Option<DVec3>| {
            let local = mixture.at(DVec3::ZERO, normal);
            let points = (0..64 * 64).map(|i| [i % 64, i / 64].map(|i| (f64::from(i) + 0.5) / 64.0));
            points.filter(|u| local.sample(*u).x < 0.0).count()
        };
        let (with, without) = (before(Some(DVec3::NEG_X)), before(None));
        assert!(without > 50 && with > 3 * without, "{with} {without}");
    }

    #[test]
    fn nothing_is_learnt_of_darkness() {
        let dark = RadianceSample { direction: [0.0, 1.0, 0.0], energy: 0.0, inverse_distance: 0.0 };
        assert!(Mixture::new(&[dark; 100], DVec3::ZERO, 1).is_none());
        assert!(Mixture::new(&[RadianceSample { energy: 1.0, ..dark }; 3], DVec3::ZERO, 8).is_none());
        // One direction again and again makes a narrow lobe, no needle without width.
        let one = Mixture::new(&[RadianceSample { energy: 1.0, ..dark }; 100], DVec3::ZERO, 8).unwrap();
        let pdf = one.at(DVec3::ZERO, None).pdf(DVec3::Y);
        assert!(pdf.is_finite() && pdf > 10.0, "{pdf}");
    }
}
