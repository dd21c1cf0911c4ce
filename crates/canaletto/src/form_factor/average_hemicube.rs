//! The form factor from a surface by hemicubes at many of its points.

use super::delta_factors::DeltaFactors;
use super::hemicube::{HemicubeSettings, draw};
use super::sampled::Side;
use crate::sampler::{Dimension, Sampler};
use crate::world::{ObjectSurface, World};
use canaletto_bvh::{NoThreads, with_stack};
use canaletto_parallel::prelude::*;
use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;

/// The number of independent sets of points, whose differences show the error.
const SETS: u32 = 8;

/// The settings of a mean of hemicubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AverageHemicubeSettings {
    /// The number of points, from 1 to [`AverageHemicubeSettings::MAX_POINTS`]. It is rounded up to a multiple of 8.
    pub points: u32,
    /// The pixels along an edge of a hemicube's top face; see [`HemicubeSettings::resolution`].
    pub resolution: u32,
    /// The seed of the points.
    pub seed: u64,
}

impl AverageHemicubeSettings {
    /// The most points.
    pub const MAX_POINTS: u32 = 1 << 20;
}

impl Default for AverageHemicubeSettings {
    fn default() -> AverageHemicubeSettings {
        AverageHemicubeSettings { points: 64, resolution: HemicubeSettings::default().resolution, seed: 0 }
    }
}

/// A form factor by hemicubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AverageHemicube {
    /// The form factor.
    pub value: f64,
    /// The standard error of the points.
    pub point_error: f64,
    /// The difference to hemicubes of half the resolution at the same points.
    pub resolution_error: f64,
    /// The points.
    pub points: u32,
    /// The pixels along an edge of a hemicube's top face.
    pub resolution: u32,
    /// Whether the mean was cancelled.
    pub cancelled: bool,
}

impl AverageHemicube {
    /// Both errors together.
    pub fn error(&self) -> f64 {
        libm::hypot(self.point_error, self.resolution_error)
    }
}

/// The form factor from one surface to another one by hemicubes at random points of the first. The points are Sobol's,
/// scrambled for each of eight independent sets. Each hemicube is turned by a random angle. `progress` gets the number
/// of points so far, and may break.
///
/// # Panics
/// If `from` has no area.
///
/// # Errors
/// [`NoThreads`] if threads with a larger stack are needed and can't be started.
pub fn average_hemicube(
    world: &World,
    from: (&ObjectSurface, Side),
    to: (&ObjectSurface, Side),
    settings: &AverageHemicubeSettings,
    progress: &(dyn Fn(u32) -> ControlFlow<()> + Sync),
) -> Result<AverageHemicube, NoThreads> {
    assert!(from.0.nominal_area() > 0.0, "hemicubes need a surface with an area to stand on");
    with_stack(super::sampled::stack(world), || Average::new(world, from, to, settings).run(progress))
}

struct Average<'a> {
    world: &'a World,
    from: (&'a ObjectSurface, Side),
    to: (&'a ObjectSurface, Side),
    seed: u64,
    points_of_set: u32,
    /// The settings and the delta form factors of the resolution, and of half of it.
    resolutions: [(HemicubeSettings, DeltaFactors); 2],
}

/// The sums of some points.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weights: f64,
    /// Σ of the weights times the factors, for each resolution.
    factors: [f64; 2],
}

impl<'a> Average<'a> {
    fn new(
        world: &'a World,
        from: (&'a ObjectSurface, Side),
        to: (&'a ObjectSurface, Side),
        settings: &AverageHemicubeSettings,
    ) -> Average<'a> {
        let full = HemicubeSettings { resolution: settings.resolution, ..HemicubeSettings::default() };
        let full = HemicubeSettings { resolution: full.side(), ..full };
        let half = HemicubeSettings { resolution: full.resolution / 2, ..full };
        let resolutions = [full, half].map(|settings| (settings, DeltaFactors::new(settings.side())));
        let points_of_set = settings.points.clamp(1, AverageHemicubeSettings::MAX_POINTS).div_ceil(SETS);
        Average { world, from, to, seed: settings.seed, points_of_set, resolutions }
    }

    fn run(&self, progress: &(dyn Fn(u32) -> ControlFlow<()> + Sync)) -> AverageHemicube {
        let mut sets = [Sums::default(); SETS as usize];
        let (mut done, mut cancelled) = (0, false);
        for index in 0..self.points_of_set {
            let is_cancelled = || progress(index * SETS).is_break();
            // After an interruption, the sets have equally many points.
            let round = (0..SETS).into_par_iter().map(|set| self.point(set, index, &is_cancelled)).collect();
            let Some(round) = round.into_iter().collect::<Option<Vec<Sums>>>() else {
                cancelled = true;
                break;
            };
            for (set, sums) in sets.iter_mut().zip(round) {
                set.weights += sums.weights;
                (set.factors[0], set.factors[1]) = (set.factors[0] + sums.factors[0], set.factors[1] + sums.factors[1]);
            }
            done += SETS;
        }
        let sum = |f: fn(&Sums) -> f64| sets.iter().map(f).sum::<f64>();
        let (weights, count) = (sum(|s| s.weights), f64::from(SETS));
        let (full, delta) = &self.resolutions[0];
        let mut average = AverageHemicube {
            value: 0.0,
            point_error: f64::INFINITY,
            resolution_error: 0.0,
            points: done,
            resolution: full.resolution,
            cancelled,
        };
        if weights > 0.0 {
            average.value = sum(|s| s.factors[0]) / weights;
            average.resolution_error = (average.value - sum(|s| s.factors[1]) / weights).abs();
            // A ratio of sums; each set's deviation is that of its own sums from the ratio.
            let deviation = |s: &Sums| (s.factors[0] - average.value * s.weights) * count / weights;
            let squares: f64 = sets.iter().map(|s| deviation(s) * deviation(s)).sum();
            // What is seen in no hemicube may hide between the pixels, as with none of so many rays.
            let unseen = std::f64::consts::SQRT_2 * delta.largest() / f64::from(done);
            average.point_error = libm::hypot((squares / (count * (count - 1.0))).sqrt(), unseen);
        }
        average
    }

    /// The factors of the point of this index in a set.
    fn point(&self, set: u32, index: u32, cancelled: &(dyn Fn() -> bool + Sync)) -> Option<Sums> {
        const POINT: Dimension = Dimension::EYE.of(1);
        let (from, side) = self.from;
        let [u, v, turn, _] = Sampler::new(self.seed, 0, [set, 0]).four(POINT, index);
        let point = from.sample(self.world, [u, v]);
        let mut sums = Sums { weights: point.weight, ..Sums::default() };
        if point.weight == 0.0 {
            return Some(sums);
        }
        let normals: &[f64] = match side {
            Side::Front => &[1.0],
            Side::Back => &[-1.0],
            Side::Both => &[1.0, -1.0],
        };
        for (k, (settings, delta)) in self.resolutions.iter().enumerate() {
            let seed = self.seed ^ (u64::from(set) << 32 | u64::from(index)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let settings = HemicubeSettings { turn: turn * FRAC_PI_2, seed, ..*settings };
            for sign in normals {
                let place = [point.surface.exact, point.surface.normal * *sign];
                let (to, side) = self.to;
                let drawn = draw(self.world, place, Some(to), &settings, delta, cancelled);
                let ControlFlow::Continue(seen) = drawn else { return None };
                let arrives = |is_front: bool| side == Side::Both || (side == Side::Front) == is_front;
                let factors = seen.primitives.iter().filter(|p| arrives(p.is_front) && to.ids().contains(p.object));
                sums.factors[k] += point.weight * factors.map(|p| p.factor).sum::<f64>() / normals.len() as f64;
            }
        }
        Some(sums)
    }
}

#[cfg(test)]
mod tests;
