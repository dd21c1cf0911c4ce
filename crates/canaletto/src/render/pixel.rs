//! A pixel from its samples (5.6): a pure function of world, job and pixel.

use super::Job;
use crate::film::{FilterTable, display_all};
use crate::integrator::{BUNDLE, Probe, Whitted};
use crate::math::{Line, Rgb, Spread};
use crate::sampler::{FrameSampler, Sample};
use crate::scene::Sampling;
use crate::world::World;
use glam::{DVec2, DVec3};

/// Renders single pixels of a job.
pub(crate) struct PixelRenderer<'a> {
    job: &'a Job,
    filter: FilterTable,
    sampler: FrameSampler,
    /// Whether rays from the eye need no random numbers besides their place in the pixel.
    plain: bool,
    /// Memory for samples that go together.
    samples: Samples,
}

/// Samples of pixels, side by side.
#[derive(Default)]
struct Samples {
    places: Vec<[f64; 2]>,
    numbers: Vec<Sample>,
    weights: Vec<f64>,
    /// What they see.
    colors: Vec<Rgb>,
}

impl Samples {
    /// The colours and weights for each pixel, of which each has this many samples.
    fn pixels(&self, samples: u32) -> impl Iterator<Item = impl Iterator<Item = (Rgb, f64)>> {
        let samples = samples as usize;
        let pixels = self.colors.chunks_exact(samples).zip(self.weights.chunks_exact(samples));
        pixels.map(|(colors, weights)| colors.iter().copied().zip(weights.iter().copied()))
    }
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

/// A sample of a pixel.
struct Shot {
    /// Its place in the picture, in pixels, y upwards.
    position: [f64; 2],
    weight: f64,
    numbers: Sample,
}

/// The ray of a sample.
struct Eye {
    line: Line,
    /// How it changes to the neighbouring samples, if the world wants to know.
    spread: Option<Spread>,
    /// When it is, from the shutter's opening at 0 to its closing at 1.
    time: f32,
    /// The point of the lens that it leaves.
    lens: Option<DVec2>,
}

impl<'a> PixelRenderer<'a> {
    pub(crate) fn new(job: &'a Job) -> PixelRenderer<'a> {
        let (filter, plain) = (FilterTable::new(job.film.filter), job.camera.is_plain());
        let sampler = FrameSampler::new(job.seed, job.frame, job.film.sampler);
        PixelRenderer { job, filter, sampler, plain, samples: Samples::default() }
    }

    /// The colour of the pixel in column `x` and row `y` from the top left, with a probe that sees ray after ray.
    pub(crate) fn pixel<P: Probe>(&self, whitted: &mut Whitted, x: u32, y: u32, probe: &mut P) -> Rgb {
        let sampling = self.job.film.sampling;
        if let Sampling::Adaptive { n, threshold } = sampling {
            let counts = whitted.counts;
            let corner = |i| self.watched(whitted, [x, y], sampling, i, &mut ()).0;
            let corners: Vec<Rgb> = (0..CORNERS).map(corner).collect();
            if !self.is_even(&corners, threshold) {
                return self.mean_of(whitted, [x, y], Sampling::Jittered(n), probe);
            }
            // A probe should see the samples that count, and these once: their rays are counted already.
            whitted.counts = counts;
        }
        self.mean_of(whitted, [x, y], sampling, probe)
    }

    fn mean_of<P: Probe>(&self, whitted: &mut Whitted, pixel: [u32; 2], sampling: Sampling, probe: &mut P) -> Rgb {
        match sampling {
            Sampling::Corner | Sampling::Center => self.watched(whitted, pixel, sampling, 0, probe).0,
            _ => weighted_mean((0..shots(sampling)).map(|i| self.watched(whitted, pixel, sampling, i, probe))),
        }
    }

    /// How many pixels are best given to [`PixelRenderer::pixels`] at a time.
    pub(crate) fn together(&self) -> usize {
        (BUNDLE / shots(self.job.film.sampling) as usize).max(1)
    }

    /// The colours of many pixels, of which neighbours in the list are neighbours in the picture: rays of several go together.
    pub(crate) fn pixels(&mut self, whitted: &mut Whitted, pixels: &[[u32; 2]], colors: &mut Vec<Rgb>) {
        let sampling = self.job.film.sampling;
        let mut samples = std::mem::take(&mut self.samples);
        self.samples(whitted, pixels, sampling, &mut samples);
        colors.clear();
        match sampling {
            Sampling::Corner | Sampling::Center => colors.extend_from_slice(&samples.colors),
            Sampling::Adaptive { n, threshold } => {
                let even: Vec<bool> = samples
                    .colors
                    .chunks_exact(CORNERS as usize)
                    .map(|corners| self.is_even(corners, threshold))
                    .collect();
                let rest: Vec<[u32; 2]> =
                    pixels.iter().zip(&even).filter(|(_, even)| !**even).map(|(pixel, _)| *pixel).collect();
                let mut fine = Samples::default();
                self.samples(whitted, &rest, Sampling::Jittered(n), &mut fine);
                let mut fine = fine.pixels(shots(Sampling::Jittered(n))).map(weighted_mean);
                for (even, coarse) in even.into_iter().zip(samples.pixels(CORNERS)) {
                    colors.push(if even { weighted_mean(coarse) } else { fine.next().unwrap_or_default() });
                }
            }
            _ => colors.extend(samples.pixels(shots(sampling)).map(weighted_mean)),
        }
        self.samples = samples;
    }

    /// All samples of some pixels.
    fn samples(&mut self, whitted: &mut Whitted, pixels: &[[u32; 2]], sampling: Sampling, samples: &mut Samples) {
        // Each is compiled for itself.
        match sampling {
            Sampling::Corner => self.choose(pixels, Sampling::Corner, samples),
            Sampling::Center => self.choose(pixels, Sampling::Center, samples),
            other => self.choose(pixels, other, samples),
        }
        let Samples { places, numbers, colors, .. } = samples;
        colors.clear();
        let (world, camera, spacing) = (whitted.world(), &self.job.camera, spacing(sampling));
        // Lights and moving instances are where they are at one time.
        let alone = self.moves(world);
        if !self.plain || alone {
            for (place, numbers) in places.iter().zip(numbers) {
                let Eye { line, spread, time, .. } = self.eye(world, *place, numbers, spacing);
                whitted.begin(*numbers, time);
                whitted.depart(&[line], &[*numbers], spread);
                if alone || whitted.is_full() {
                    colors.extend_from_slice(whitted.arrive(&mut ()));
                }
                if whitted.gave_up() {
                    break;
                }
            }
            colors.extend_from_slice(whitted.arrive(&mut ()));
            return colors.resize(places.len(), Rgb::BLACK);
        }
        let wants_spread = world.wants_spread();
        let mut lines = [Line { origin: DVec3::ZERO, direction: DVec3::ZERO }; BUNDLE];
        for (places, numbers) in places.chunks(BUNDLE).zip(numbers.chunks(BUNDLE)) {
            let lines = &mut lines[..places.len()];
            camera.lines(places, lines);
            let seen = if wants_spread { places } else { &[] };
            whitted.depart(lines, numbers, seen.iter().map(|[x, y]| camera.spread(*x, *y, spacing)));
            colors.extend_from_slice(whitted.arrive(&mut ()));
            if whitted.gave_up() {
                break;
            }
        }
        colors.resize(places.len(), Rgb::BLACK);
    }

    /// Where the samples of some pixels are, their weights and random numbers.
    #[inline(always)]
    fn choose(&self, pixels: &[[u32; 2]], sampling: Sampling, samples: &mut Samples) {
        let Samples { places, numbers, weights, .. } = samples;
        let shots = shots(sampling) as usize;
        let count = pixels.len() * shots;
        places.resize(count, [0.0; 2]);
        numbers.resize(count, self.sampler.pixel([0; 2]).sample(0, 1));
        weights.resize(count, 1.0);
        let (places, numbers, weights) = (&mut places[..count], &mut numbers[..count], &mut weights[..count]);
        let mut at = 0;
        for &pixel in pixels {
            for i in 0..shots {
                let shot = self.shot(pixel, sampling, i as u32);
                (places[at], numbers[at], weights[at]) = (shot.position, shot.numbers, shot.weight);
                at += 1;
            }
        }
    }

    /// Sample number `index` of a pixel.
    #[inline(always)]
    fn shot(&self, [x, y]: [u32; 2], sampling: Sampling, index: u32) -> Shot {
        // The chapter counts rows from the bottom (fig. 5.9b).
        let corner = [f64::from(x), f64::from(self.job.camera.size()[1] - 1 - y)];
        let sampler = self.sampler.pixel([x, y]);
        let numbers = sampler.sample(index, shots(sampling));
        let at = |[dx, dy]: [f64; 2]| Shot { position: [corner[0] + dx, corner[1] + dy], weight: 1.0, numbers };
        // Spread and weighted by the filter.
        let filtered = |[u, v]: [f64; 2]| {
            let ((dx, wx), (dy, wy)) = (self.filter.sample(u), self.filter.sample(v));
            let position = [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy];
            Shot { position, weight: wx * wy, numbers }
        };
        // n × n sub-pixels, one ray in each, `place` of the way across (fig. 5.36).
        let grid = |n: u32, place: [f64; 2]| {
            let [u, v] = [(index % n, place[0]), (index / n, place[1])];
            let across = |(i, place)| (f64::from(i) + place) / f64::from(n);
            filtered([across(u), across(v)])
        };
        match sampling {
            Sampling::Corner => at([0.0; 2]),
            Sampling::Center => at([0.5; 2]),
            Sampling::Regular(n) => grid(n, [0.5; 2]),
            Sampling::Jittered(n) => grid(n, [sampler.uniform(index, 0), sampler.uniform(index, 1)]),
            Sampling::Sampled(_) => filtered(numbers.film()),
            Sampling::Adaptive { .. } => {
                const PLACES: [[f64; 2]; CORNERS as usize] =
                    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];
                at(PLACES[index as usize])
            }
        }
    }

    #[inline]
    fn eye(&self, world: &World, [x, y]: [f64; 2], numbers: &Sample, spacing: f64) -> Eye {
        let camera = &self.job.camera;
        let wants_spread = world.wants_spread();
        let moves = self.moves(world);
        if self.plain && !moves {
            let spread = wants_spread.then(|| camera.spread(x, y, spacing));
            return Eye { line: camera.line(x, y), spread, time: 0.0, lens: None };
        }
        let numbers = numbers.eye();
        // Rounded once, so that camera and world agree about it.
        let time = if moves { numbers.time as f32 } else { 0.0 };
        let ray = camera.ray(x, y, numbers.lens, f64::from(time), wants_spread.then_some(spacing));
        Eye { line: ray.line, spread: ray.spread, time, lens: ray.lens }
    }

    fn moves(&self, world: &World) -> bool {
        world.moves() || self.job.camera.moves()
    }

    /// The colour and the weight of a sample, whose rays a probe sees.
    fn watched<P: Probe>(
        &self,
        whitted: &mut Whitted,
        pixel: [u32; 2],
        sampling: Sampling,
        index: u32,
        probe: &mut P,
    ) -> (Rgb, f64) {
        let shot = self.shot(pixel, sampling, index);
        probe.sample(shot.position, shot.weight);
        let eye = self.eye(whitted.world(), shot.position, &shot.numbers, spacing(sampling));
        let moves = self.moves(whitted.world());
        if !self.plain || moves {
            probe.drawn(moves.then_some(f64::from(eye.time)), eye.lens.map(|p| p.to_array()));
        }
        whitted.begin(shot.numbers, eye.time);
        (whitted.eye(eye.line, eye.spread.as_ref(), probe), shot.weight)
    }

    /// Whether a pixel's corners and centre differ by no more than the threshold once developed (after Whitted 1980, §4, with
    /// a grid in place of his recursion).
    fn is_even(&self, colors: &[Rgb], threshold: f32) -> bool {
        let mut shown = [[0.0; 3]; CORNERS as usize];
        shown.iter_mut().zip(colors).for_each(|(shown, color)| *shown = color.to_array());
        display_all(shown.as_flattened_mut(), self.job.film.transfer);
        let contrast = (0..3).map(|channel| {
            let values = shown.map(|c| c[channel]);
            values.into_iter().fold(0.0, f32::max) - values.into_iter().fold(1.0, f32::min)
        });
        contrast.fold(0.0, f32::max) <= threshold
    }
}

/// The corners of a pixel and its centre, with which adaptive sampling begins.
const CORNERS: u32 = 5;

/// How far a pixel's samples are from each other, as if they stood on a grid.
fn spacing(sampling: Sampling) -> f64 {
    match sampling {
        Sampling::Corner | Sampling::Center => 1.0,
        Sampling::Regular(n) | Sampling::Jittered(n) => 1.0 / f64::from(n),
        Sampling::Sampled(n) => 1.0 / f64::from(n).sqrt(),
        // Four of the five are shared with the neighbours: two samples for each pixel.
        Sampling::Adaptive { .. } => std::f64::consts::FRAC_1_SQRT_2,
    }
}

/// How many samples a pixel has, or begins with.
fn shots(sampling: Sampling) -> u32 {
    match sampling {
        Sampling::Corner | Sampling::Center => 1,
        Sampling::Regular(n) | Sampling::Jittered(n) => n * n,
        Sampling::Sampled(n) => n,
        Sampling::Adaptive { .. } => CORNERS,
    }
}
