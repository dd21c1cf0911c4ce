//! A pixel from its samples (5.6): a pure function of world, job and pixel.

use super::Job;
use crate::film::{FilterTable, display_all};
use crate::integrator::{Probe, Whitted};
use crate::math::Rgb;
use crate::sampler::{Sample, Sampler};
use crate::scene::Sampling;

/// Renders single pixels of a job.
pub(crate) struct PixelRenderer<'a> {
    job: &'a Job,
    filter: FilterTable,
    /// Whether rays from the eye need no random numbers besides their place in the pixel.
    plain: bool,
}

/// Weighted colours in `f64`.
#[derive(Default)]
struct Sum {
    color: [f64; 3],
    weight: f64,
}

impl Sum {
    fn add(&mut self, color: Rgb, weight: f64) {
        for (sum, c) in self.color.iter_mut().zip(color.to_array()) {
            *sum += weight * f64::from(c);
        }
        self.weight += weight;
    }

    fn mean(&self) -> Rgb {
        Rgb::from(self.color.map(|c| (c / self.weight) as f32)).saturated()
    }
}

/// The mean of weighted colours, in the order and precision of the film.
pub(crate) fn weighted_mean(samples: impl IntoIterator<Item = (Rgb, f64)>) -> Rgb {
    let mut sum = Sum::default();
    samples.into_iter().for_each(|(color, weight)| sum.add(color, weight));
    sum.mean()
}

impl<'a> PixelRenderer<'a> {
    pub(crate) fn new(job: &'a Job) -> PixelRenderer<'a> {
        PixelRenderer { job, filter: FilterTable::new(job.film.filter), plain: job.camera.is_plain() }
    }

    /// The colour of the pixel in column `x` and row `y` from the top left.
    pub(crate) fn pixel<P: Probe>(&self, whitted: &mut Whitted, x: u32, y: u32, probe: &mut P) -> Rgb {
        // The chapter counts rows from the bottom (fig. 5.9b).
        let corner = [f64::from(x), f64::from(self.job.camera.size()[1] - 1 - y)];
        let sampler = Sampler::new(self.job.seed, self.job.frame, [x, y]).of_kind(self.job.film.sampler);
        match self.job.film.sampling {
            Sampling::Corner => self.sample(whitted, corner, [1.0; 2], sampler.sample(0, 1), probe),
            Sampling::Center => {
                self.sample(whitted, [corner[0] + 0.5, corner[1] + 0.5], [1.0; 2], sampler.sample(0, 1), probe)
            }
            Sampling::Regular(n) => self.grid(whitted, corner, sampler, n, |_, _| 0.5, probe),
            Sampling::Jittered(n) => self.grid(whitted, corner, sampler, n, |i, axis| sampler.uniform(i, axis), probe),
            Sampling::Sampled(n) => self.sampled(whitted, corner, sampler, n, probe),
            Sampling::Adaptive { n, threshold } => self
                .adaptive(whitted, corner, sampler, threshold, probe)
                .unwrap_or_else(|| self.grid(whitted, corner, sampler, n, |i, axis| sampler.uniform(i, axis), probe)),
        }
    }

    /// A ray through this place of the picture. `spacing` is how far the pixel's samples are from each other, as if they
    /// stood on a grid.
    fn sample<P: Probe>(
        &self,
        whitted: &mut Whitted,
        position: [f64; 2],
        [weight, spacing]: [f64; 2],
        sample: Sample,
        probe: &mut P,
    ) -> Rgb {
        probe.sample(position, weight);
        let (camera, [x, y]) = (&self.job.camera, position);
        let wants_spread = whitted.world().wants_spread();
        let moves = whitted.world().moves() || camera.moves();
        if self.plain && !moves {
            whitted.begin(sample, 0.0);
            let spread = wants_spread.then(|| camera.spread(x, y, spacing));
            return whitted.eye(camera.line(x, y), spread.as_ref(), probe);
        }
        let numbers = sample.eye();
        // Rounded once, so that camera and world agree about it.
        let time = if moves { numbers.time as f32 } else { 0.0 };
        whitted.begin(sample, time);
        let ray = camera.ray(x, y, numbers.lens, f64::from(time), wants_spread.then_some(spacing));
        probe.drawn(moves.then_some(f64::from(time)), ray.lens.map(|p| p.to_array()));
        whitted.eye(ray.line, ray.spread.as_ref(), probe)
    }

    /// n × n sub-pixels, one ray in each, `place` of the way across (fig. 5.36); spread and weighted by the filter.
    fn grid<P: Probe>(
        &self,
        whitted: &mut Whitted,
        corner: [f64; 2],
        sampler: Sampler,
        n: u32,
        place: impl Fn(u32, u32) -> f64,
        probe: &mut P,
    ) -> Rgb {
        let spacing = 1.0 / f64::from(n);
        weighted_mean((0..n * n).map(|i| {
            let (dx, wx) = self.filter.sample((f64::from(i % n) + place(i, 0)) / f64::from(n));
            let (dy, wy) = self.filter.sample((f64::from(i / n) + place(i, 1)) / f64::from(n));
            let position = [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy];
            (self.sample(whitted, position, [wx * wy, spacing], sampler.sample(i, n * n), probe), wx * wy)
        }))
    }

    /// `n` rays at places of the sampler's choice, spread and weighted by the filter.
    fn sampled<P: Probe>(
        &self,
        whitted: &mut Whitted,
        corner: [f64; 2],
        sampler: Sampler,
        n: u32,
        probe: &mut P,
    ) -> Rgb {
        let spacing = 1.0 / f64::from(n).sqrt();
        weighted_mean((0..n).map(|i| {
            let sample = sampler.sample(i, n);
            let [u, v] = sample.film();
            let ((dx, wx), (dy, wy)) = (self.filter.sample(u), self.filter.sample(v));
            let position = [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy];
            (self.sample(whitted, position, [wx * wy, spacing], sample, probe), wx * wy)
        }))
    }

    /// The mean of the pixel's corners and centre, or `None` where they differ by more than the threshold once
    /// developed (after Whitted 1980, §4, with a grid in place of his recursion).
    fn adaptive<P: Probe>(
        &self,
        whitted: &mut Whitted,
        corner: [f64; 2],
        sampler: Sampler,
        threshold: f32,
        probe: &mut P,
    ) -> Option<Rgb> {
        const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];
        /// Four of the five are shared with the neighbours: two samples for each pixel.
        const SPACING: f64 = std::f64::consts::FRAC_1_SQRT_2;
        let positions = PLACES.map(|[dx, dy]| [corner[0] + dx, corner[1] + dy]);
        let sample = |i: usize| sampler.sample(i as u32, PLACES.len() as u32);
        let colors: [Rgb; 5] =
            std::array::from_fn(|i| self.sample(whitted, positions[i], [1.0, SPACING], sample(i), &mut ()));
        let mut shown = colors;
        display_all(&mut shown, self.job.film.transfer);
        let shown = shown.map(Rgb::to_array);
        let contrast = (0..3).map(|channel| {
            let values = shown.map(|c| c[channel]);
            values.into_iter().fold(0.0, f32::max) - values.into_iter().fold(1.0, f32::min)
        });
        if contrast.fold(0.0, f32::max) > threshold {
            return None;
        }
        if P::ACTIVE {
            // A probe should see the samples that count, and these once: their rays are counted already.
            let counts = whitted.counts;
            positions.into_iter().enumerate().for_each(|(i, position)| {
                self.sample(whitted, position, [1.0, SPACING], sample(i), probe);
            });
            whitted.counts = counts;
        }
        Some(weighted_mean(colors.into_iter().map(|color| (color, 1.0))))
    }
}
