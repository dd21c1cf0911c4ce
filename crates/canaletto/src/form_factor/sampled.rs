//! Form factors between any surfaces of a world, by rays.
//!
//! Rays leave random points of one surface in directions whose density is cos θ / π. The share of the rays that meet
//! the front of the other surface first is the form factor. Points and directions are Sobol's four-dimensional points,
//! scrambled anew for each of [`REPLICATES`] independent estimates, whose differences show the error (Owen, *Monte
//! Carlo Variance of Scrambled Net Quadrature*, 1997).

use super::unoccluded::Unoccluded;
use crate::math::{DRay, offset_origin, warp};
use crate::sampler::{Dimension, Sample, Sampler};
use crate::world::{MAX_STALLED, ObjectSurface, World};
use canaletto_bvh::{NoThreads, Ray, with_stack};
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};

/// The number of independent estimates.
const REPLICATES: u32 = 32;
/// The samples of each estimate before the error is looked at first; it is looked at again after each doubling.
const FIRST_SAMPLES: u32 = 128;
/// The most samples of one unit of work.
const UNIT: u32 = 2048;
/// The most surfaces that a ray passes: holes, and what hides the other surface.
const MAX_CROSSINGS: u32 = 1 << 16;

/// Which sides of a surface count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// The outer side. It is the one that normals are on, from which a triangle's corners are counter-clockwise.
    #[default]
    Front,
    /// The inner side.
    Back,
    /// Both sides, which doubles the area.
    Both,
}

crate::named!(Side {
    Front => "front": "The outer side",
    Back => "back": "The inner side, such as that of a box around a room",
    Both => "both": "Both sides, which count as twice the area",
});

impl Side {
    /// The number of sides.
    pub fn count(self) -> u32 {
        if self == Side::Both { 2 } else { 1 }
    }

    fn faces(self, normal: DVec3, direction: DVec3) -> bool {
        let towards_front = normal.dot(direction) < 0.0;
        match self {
            Side::Front => towards_front,
            Side::Back => !towards_front,
            Side::Both => true,
        }
    }
}

/// The settings of sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleSettings {
    /// The standard error at which sampling ends, > 0.
    pub standard_error: f64,
    /// The most rays, at least 1. There are always a few for each of the independent estimates.
    pub max_rays: u64,
    /// The seed of the random numbers.
    pub seed: u64,
}

impl Default for SampleSettings {
    fn default() -> SampleSettings {
        SampleSettings { standard_error: 1e-4, max_rays: 1 << 30, seed: 0 }
    }
}

/// How far sampling has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingProgress {
    /// The rays so far.
    pub rays: u64,
    /// The standard error of the last round, or infinity in the first one.
    pub standard_error: f64,
}

/// A form factor by rays.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledFormFactor {
    /// The form factor.
    pub value: f64,
    /// The standard error: the truth is nearer than twice this with a probability of about 95 %.
    pub standard_error: f64,
    /// The area of the surface that the rays left, all counted sides.
    pub area: f64,
    /// The standard error of the area; 0 if the area is exact.
    pub area_error: f64,
    /// The rays from points that are there; see [`crate::world::ObjectSurface::is_exact`].
    pub rays: u64,
    /// The rays that arrived.
    pub arrived: u64,
    /// For each object that was first in the way of rays that would have arrived without it: its number and theirs.
    pub blocked: BTreeMap<u32, u64>,
    /// Whether sampling was cancelled.
    pub cancelled: bool,
}

/// Samples the form factor from one surface to another one, with everything else in the world in between. Sampling ends
/// at the standard error that the settings name, at their number of rays, or when `progress` breaks.
///
/// All surfaces are opaque, those of clear bodies too, but holes are open: a surface of partial coverage stops this
/// share of the rays. What casts no shadow stops none, but receives light. The world is as it is when the shutter
/// opens.
///
/// # Panics
/// If `from` has no area.
///
/// # Errors
/// [`NoThreads`] if threads with a larger stack are needed and can't be started.
pub fn sample_form_factor(
    world: &World,
    from: (&ObjectSurface, Side),
    to: (&ObjectSurface, Side),
    settings: &SampleSettings,
    progress: &(dyn Fn(&SamplingProgress) -> ControlFlow<()> + Sync),
) -> Result<SampledFormFactor, NoThreads> {
    sample(world, from, to, None, settings, progress)
}

/// [`sample_form_factor`] with the unoccluded factor as a control variate, if it is known. What is sampled is then the
/// light that doesn't arrive.
pub(super) fn sample(
    world: &World,
    from: (&ObjectSurface, Side),
    to: (&ObjectSurface, Side),
    unoccluded: Option<&Unoccluded>,
    settings: &SampleSettings,
    progress: &(dyn Fn(&SamplingProgress) -> ControlFlow<()> + Sync),
) -> Result<SampledFormFactor, NoThreads> {
    assert!(from.0.nominal_area() > 0.0, "rays need a surface with an area to leave from");
    let sampling = Sampling { world, from, to, unoccluded };
    with_stack(stack(world), || sampling.run(settings, progress))
}

/// The stack in bytes for rays and for drawing.
pub(super) fn stack(world: &World) -> usize {
    RAY_STACK + GROUP_STACK * world.most_groups()
}

/// The stack in bytes for a ray, and for each group around a primitive.
const RAY_STACK: usize = 256 << 10;
const GROUP_STACK: usize = 16 << 10;

/// The area of a surface and its standard error, by random points.
pub(super) fn sampled_area(world: &World, (surface, side): (&ObjectSurface, Side), seed: u64) -> [f64; 2] {
    const POINTS: u32 = 1 << 14;
    let mean = |replicate: u32| {
        let sampler = Sampler::new(seed, 1, [replicate, 0]);
        let sum: f64 = (0..POINTS)
            .map(|index| surface.sample(world, sampler.sample(index, POINTS).two(Dimension::EYE)).weight)
            .sum();
        sum / f64::from(POINTS)
    };
    let means: Vec<f64> = (0..REPLICATES).into_par_iter().map(mean).collect();
    let n = f64::from(REPLICATES);
    let mean = means.iter().sum::<f64>() / n;
    let squares: f64 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
    [mean, (squares / (n * (n - 1.0))).sqrt()].map(|v| v * surface.nominal_area() * f64::from(side.count()))
}

struct Sampling<'a> {
    world: &'a World,
    from: (&'a ObjectSurface, Side),
    to: (&'a ObjectSurface, Side),
    unoccluded: Option<&'a Unoccluded>,
}

/// The sums of some samples.
#[derive(Clone, Debug, Default)]
struct Tally {
    samples: u64,
    /// Σ of the weights of the points, and of those whose ray arrived.
    weights: f64,
    arrived_weights: f64,
    rays: u64,
    arrived: u64,
    blocked: BTreeMap<u32, u64>,
    /// Sums over rays of the receiver's triangles that the ray would cross without anything in between, of their
    /// square, and of those of rays that arrived.
    crossings: u64,
    squared_crossings: u64,
    arrived_crossings: u64,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.samples += other.samples;
        self.weights += other.weights;
        self.arrived_weights += other.arrived_weights;
        self.rays += other.rays;
        self.arrived += other.arrived;
        self.crossings += other.crossings;
        self.squared_crossings += other.squared_crossings;
        self.arrived_crossings += other.arrived_crossings;
        for (object, rays) in &other.blocked {
            *self.blocked.entry(*object).or_default() += rays;
        }
    }
}

/// The fate of a ray.
enum Fate {
    Arrived,
    /// It would have arrived without this object and perhaps others behind it.
    Blocked(u32),
    Missed,
}

impl Sampling<'_> {
    fn run(
        &self,
        settings: &SampleSettings,
        progress: &(dyn Fn(&SamplingProgress) -> ControlFlow<()> + Sync),
    ) -> SampledFormFactor {
        let most = (settings.max_rays / u64::from(REPLICATES)).clamp(4, u64::from(u32::MAX)) as u32;
        let mut tallies = vec![Tally::default(); REPLICATES as usize];
        let mut result = Estimate::new(&tallies, self.unoccluded);
        let (mut done, mut cancelled) = (0, false);
        while done < most && !cancelled && (done == 0 || result.standard_error > settings.standard_error) {
            let end = if done == 0 { FIRST_SAMPLES.min(most) } else { done.saturating_mul(2).min(most) };
            let units: Vec<(u32, Range<u32>)> = (0..REPLICATES)
                .flat_map(|replicate| {
                    (done..end).step_by(UNIT as usize).map(move |start| (replicate, start..end.min(start + UNIT)))
                })
                .collect();
            // Units of a few thousand rays each; their sums are added in the order of the units.
            for some in units.chunks(UNITS_AT_ONCE) {
                let state = SamplingProgress {
                    rays: tallies.iter().map(|t| t.rays).sum(),
                    standard_error: result.standard_error,
                };
                if progress(&state).is_break() {
                    cancelled = true;
                    break;
                }
                let sums: Vec<Tally> =
                    some.par_iter().map(|(r, range)| self.sample(settings.seed, *r, range)).collect();
                for ((replicate, _), sum) in some.iter().zip(&sums) {
                    tallies[*replicate as usize].add(sum);
                }
            }
            done = end;
            if !cancelled || tallies.iter().all(|tally| tally.samples > 0) {
                result = Estimate::new(&tallies, self.unoccluded);
            }
        }
        let mut all = Tally::default();
        tallies.iter().for_each(|tally| all.add(tally));
        let sides = f64::from(self.from.1.count());
        SampledFormFactor {
            value: result.value,
            standard_error: result.standard_error,
            area: self.from.0.nominal_area() * result.weight * sides,
            area_error: if self.from.0.is_exact() {
                0.0
            } else {
                self.from.0.nominal_area() * result.weight_error * sides
            },
            rays: all.rays,
            arrived: all.arrived,
            blocked: all.blocked,
            cancelled,
        }
    }

    fn sample(&self, seed: u64, replicate: u32, range: &Range<u32>) -> Tally {
        const RAY: Dimension = Dimension::EYE.of(1);
        const SIDE: Dimension = Dimension::EYE.of(2);
        let sampler = Sampler::new(seed, 0, [replicate, 0]);
        let mut tally = Tally::default();
        for index in range.clone() {
            let sample = sampler.sample(index, u32::MAX);
            let [u, v, s, t] = sampler.four(RAY, index);
            let point = self.from.0.sample(self.world, [u, v]);
            tally.samples += 1;
            if point.weight == 0.0 {
                continue;
            }
            tally.weights += point.weight;
            tally.rays += 1;
            let surface = point.surface;
            let is_front = match self.from.1 {
                Side::Front => true,
                Side::Back => false,
                Side::Both => sample.one(SIDE) < 0.5,
            };
            let normal = if is_front { surface.normal } else { -surface.normal };
            let disk = warp::disk([s, t]);
            let (x, y) = normal.any_orthonormal_pair();
            let up = (1.0 - disk.length_squared()).max(0.0).sqrt();
            let direction = x * disk.x + y * disk.y + normal * up;
            // Along the surface, a ray leaves on the side of its normal.
            let origin = offset_origin(surface.point, surface.error, surface.normal, normal);
            let crossings = self.unoccluded.map_or(0, |u| u64::from(u.crossings(surface.exact, direction)));
            tally.crossings += crossings;
            tally.squared_crossings += crossings * crossings;
            match self.follow(&sample, Ray::new(origin, direction.as_vec3())) {
                Fate::Arrived => {
                    tally.arrived += 1;
                    tally.arrived_weights += point.weight;
                    tally.arrived_crossings += crossings;
                }
                Fate::Blocked(object) => *tally.blocked.entry(object).or_default() += 1,
                Fate::Missed => {}
            }
        }
        tally
    }

    fn follow(&self, sample: &Sample, mut ray: Ray) -> Fate {
        const COVERAGE: Dimension = Dimension::EYE.of(3);
        let (world, (to, side)) = (self.world, self.to);
        let (mut blocker, mut stalled) = (None, 0);
        for crossing in 0..MAX_CROSSINGS {
            let Some(hit) = world.intersect(&ray, f32::INFINITY) else { return Fate::Missed };
            let line = DRay::from(&ray);
            let surface = world.surface_without_uv(line, &hit);
            let is_there = !world.material(&hit).has_holes()
                || sample.one(COVERAGE.of(crossing)) < f64::from(world.coverage_at(line, &hit));
            if is_there {
                let object = world.object_id(&hit);
                if to.ids().contains(object) && side.faces(surface.normal, line.direction) {
                    return blocker.map_or(Fate::Arrived, Fate::Blocked);
                }
                if world.casts_shadow(hit.instance, hit.primitive) {
                    blocker.get_or_insert(object);
                }
            }
            let start = ray.origin;
            ray.origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            // Where a surface is flatter than rounding errors, the ray hits it again without advancing.
            stalled = if (ray.origin - start).dot(ray.direction) > 0.0 { 0 } else { stalled + 1 };
            if stalled > MAX_STALLED {
                return Fate::Missed;
            }
            if blocker.is_some() && to.planes() == 0 && !ray.prepare().enters(&to.bounds(), f32::INFINITY) {
                return Fate::Missed;
            }
        }
        Fate::Missed
    }
}

/// The most units between two calls of `progress`.
const UNITS_AT_ONCE: usize = 64;

/// The mean of independent estimates.
struct Estimate {
    value: f64,
    standard_error: f64,
    /// The mean weight of a point.
    weight: f64,
    weight_error: f64,
}

impl Estimate {
    fn new(tallies: &[Tally], unoccluded: Option<&Unoccluded>) -> Estimate {
        let n = tallies.len() as f64;
        let sum = |f: fn(&Tally) -> f64| tallies.iter().map(f).sum::<f64>();
        let (samples, weights, rays) = (sum(|t| t.samples as f64), sum(|t| t.weights), sum(|t| t.rays as f64));
        if weights == 0.0 {
            return Estimate { value: 0.0, standard_error: f64::INFINITY, weight: 0.0, weight_error: 0.0 };
        }
        let weight = weights / samples;
        let arrived = sum(|t| t.arrived as f64) / rays;
        let (mut slope, mut ray_variance) = (0.0, arrived * (1.0 - arrived));
        let mut value = sum(|t| t.arrived_weights) / weights;
        if let Some(unoccluded) = unoccluded {
            // A control variate (Owen, *Monte Carlo Theory, Methods and Examples*, ch. 8.9): the crossings of each ray,
            // of which the mean is known. All weights are 1, since flat surfaces are sampled exactly.
            let crossings = sum(|t| t.crossings as f64) / rays;
            let variance = sum(|t| t.squared_crossings as f64) / rays - crossings * crossings;
            let covariance = sum(|t| t.arrived_crossings as f64) / rays - arrived * crossings;
            if variance > 0.0 {
                slope = covariance / variance;
                ray_variance = (ray_variance - slope * covariance).max(0.0);
            }
            value -= slope * (crossings - unoccluded.factor.value);
        }
        // A ratio of sums; each replicate's deviation is that of its own sums from the ratio.
        let (mut squares, mut weight_squares) = (0.0, 0.0);
        for tally in tallies {
            let share = tally.rays as f64 / rays;
            let controlled =
                slope * (tally.crossings as f64 / rays - share * unoccluded.map_or(0.0, |u| u.factor.value));
            let own_share = tally.weights / weights;
            let deviation = (tally.arrived_weights / weights - controlled - value * own_share) * n;
            squares += deviation * deviation;
            let deviation = (tally.weights - weight * tally.samples as f64) * n / samples;
            weight_squares += deviation * deviation;
        }
        // Where few rays make the difference, the estimates say little about their variance, and equal ones aren't
        // certainty. The variance of independent rays then counts as much as `prior` more estimates. Two are added to
        // the few, so that none among n is a standard error of 1.4 / n.
        let few = ray_variance * rays;
        let independent = n * (few + 2.0) / (rays * rays);
        let prior = n * n / few.max(1e-3);
        let variance = (squares + prior * independent) / (n - 1.0 + prior);
        let (standard_error, weight_error) = ((variance / n).sqrt(), (weight_squares / (n * (n - 1.0))).sqrt());
        Estimate { value: value.clamp(0.0, 1.0), standard_error, weight, weight_error }
    }
}

#[cfg(test)]
mod tests;
