//! A pixel from its samples (5.6): a pure function of world, job and pixel.

use super::Job;
use crate::film::{FilterTable, display_all};
use crate::integrator::{BUNDLE, Probe, Whitted};
use crate::math::{Line, Rgb, Spread};
use crate::sampler::{Sample, Sampler};
use crate::scene::Sampling;
use crate::world::World;
use glam::DVec2;

/// Renders single pixels of a job.
pub(crate) struct PixelRenderer<'a> {
    job: &'a Job,
    filter: FilterTable,
    /// Whether rays from the eye need no random numbers besides their place in the pixel.
    plain: bool,
    /// Memory for samples that go together.
    waiting: Waiting,
}

/// Samples that go together, with their places and lines.
#[derive(Default)]
struct Waiting {
    shots: Vec<Shot>,
    places: Vec<[f64; 2]>,
    lines: Vec<Line>,
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
    /// How far the pixel's samples are from each other, as if they stood on a grid.
    spacing: f64,
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
        PixelRenderer { job, filter, plain, waiting: Waiting::default() }
    }

    /// The colour of the pixel in column `x` and row `y` from the top left, with a probe that sees ray after ray.
    pub(crate) fn pixel<P: Probe>(&self, whitted: &mut Whitted, x: u32, y: u32, probe: &mut P) -> Rgb {
        let sampling = self.job.film.sampling;
        let single = |probe: &mut P, whitted: &mut Whitted, shot: &Shot| self.watched(whitted, shot, probe);
        match sampling {
            Sampling::Corner | Sampling::Center => single(probe, whitted, &self.shot([x, y], sampling, 0)),
            Sampling::Adaptive { n, threshold } => {
                let counts = whitted.counts;
                let colors: Vec<Rgb> =
                    (0..CORNERS).map(|i| self.watched(whitted, &self.shot([x, y], sampling, i), &mut ())).collect();
                if self.is_even(&colors, threshold) {
                    // A probe should see the samples that count, and these once: their rays are counted already.
                    whitted.counts = counts;
                    return weighted_mean(
                        (0..CORNERS).map(|i| (single(probe, whitted, &self.shot([x, y], sampling, i)), 1.0)),
                    );
                }
                self.mean_of(whitted, [x, y], Sampling::Jittered(n), probe)
            }
            _ => self.mean_of(whitted, [x, y], sampling, probe),
        }
    }

    fn mean_of<P: Probe>(&self, whitted: &mut Whitted, pixel: [u32; 2], sampling: Sampling, probe: &mut P) -> Rgb {
        weighted_mean((0..shots(sampling)).map(|i| {
            let shot = self.shot(pixel, sampling, i);
            (self.watched(whitted, &shot, probe), shot.weight)
        }))
    }

    /// How many pixels are best given to [`PixelRenderer::pixels`] at a time.
    pub(crate) fn together(&self) -> usize {
        (BUNDLE / shots(self.job.film.sampling) as usize).max(1)
    }

    /// The colours of many pixels, of which neighbours in the list are neighbours in the picture: rays of several go together.
    pub(crate) fn pixels(&mut self, whitted: &mut Whitted, pixels: &[[u32; 2]], colors: &mut Vec<Rgb>) {
        let sampling = self.job.film.sampling;
        let shown = self.samples(whitted, pixels, sampling);
        colors.clear();
        match sampling {
            Sampling::Corner | Sampling::Center => colors.extend(shown.iter().map(|(color, _)| *color)),
            Sampling::Adaptive { n, threshold } => {
                let corners: Vec<Rgb> = shown.iter().map(|(color, _)| *color).collect();
                let corners = corners.chunks_exact(CORNERS as usize);
                let even: Vec<bool> = corners.map(|colors| self.is_even(colors, threshold)).collect();
                let rest: Vec<[u32; 2]> =
                    pixels.iter().zip(&even).filter(|(_, even)| !**even).map(|(pixel, _)| *pixel).collect();
                let fine = self.samples(whitted, &rest, Sampling::Jittered(n));
                let mut fine = fine.chunks_exact(shots(Sampling::Jittered(n)) as usize);
                for (even, coarse) in even.into_iter().zip(shown.chunks_exact(CORNERS as usize)) {
                    let samples = if even { coarse } else { fine.next().unwrap_or_default() };
                    colors.push(weighted_mean(samples.iter().copied()));
                }
            }
            _ => {
                let of_pixels = shown.chunks_exact(shots(sampling) as usize);
                colors.extend(of_pixels.map(|samples| weighted_mean(samples.iter().copied())));
            }
        }
    }

    /// The colours and weights of all samples of some pixels.
    fn samples(&mut self, whitted: &mut Whitted, pixels: &[[u32; 2]], sampling: Sampling) -> Vec<(Rgb, f64)> {
        let world = whitted.world();
        let mut samples: Vec<(Rgb, f64)> = Vec::with_capacity(pixels.len() * shots(sampling) as usize);
        // Lights and moving instances are where they are at one time.
        let alone = self.moves(world);
        let (plain, wants_spread) = (self.plain && !alone, world.wants_spread());
        let mut done = 0;
        let mut arrive = |whitted: &mut Whitted, samples: &mut Vec<(Rgb, f64)>| {
            for ((color, _), arrived) in samples[done..].iter_mut().zip(whitted.arrive(&mut ())) {
                *color = *arrived;
            }
            done = samples.len();
        };
        if !plain {
            for (pixel, i) in pixels.iter().flat_map(|pixel| (0..shots(sampling)).map(move |i| (*pixel, i))) {
                let shot = self.shot(pixel, sampling, i);
                let Eye { line, spread, time, .. } = self.eye(world, &shot);
                whitted.begin(shot.numbers, time);
                whitted.depart(line, spread, shot.numbers);
                samples.push((Rgb::BLACK, shot.weight));
                if alone || whitted.is_full() {
                    arrive(whitted, &mut samples);
                }
            }
            arrive(whitted, &mut samples);
            return samples;
        }
        let camera = &self.job.camera;
        let Waiting { shots: mut together, mut places, mut lines } = std::mem::take(&mut self.waiting);
        let mut send = |together: &mut Vec<Shot>| {
            places.clear();
            places.extend(together.iter().map(|shot| shot.position));
            lines.clear();
            camera.lines(&places, &mut lines);
            for (shot, line) in together.iter().zip(&lines) {
                let [x, y] = shot.position;
                let spread = wants_spread.then(|| camera.spread(x, y, shot.spacing));
                whitted.depart(*line, spread, shot.numbers);
                samples.push((Rgb::BLACK, shot.weight));
            }
            arrive(whitted, &mut samples);
            together.clear();
        };
        for &pixel in pixels {
            for i in 0..shots(sampling) {
                together.push(self.shot(pixel, sampling, i));
                if together.len() == BUNDLE {
                    send(&mut together);
                }
            }
        }
        send(&mut together);
        self.waiting = Waiting { shots: together, places, lines };
        samples
    }

    /// Sample number `index` of a pixel.
    #[inline]
    fn shot(&self, [x, y]: [u32; 2], sampling: Sampling, index: u32) -> Shot {
        // The chapter counts rows from the bottom (fig. 5.9b).
        let corner = [f64::from(x), f64::from(self.job.camera.size()[1] - 1 - y)];
        let sampler = Sampler::new(self.job.seed, self.job.frame, [x, y]).of_kind(self.job.film.sampler);
        let numbers = sampler.sample(index, shots(sampling));
        let at = |[dx, dy]: [f64; 2], spacing| Shot {
            position: [corner[0] + dx, corner[1] + dy],
            weight: 1.0,
            spacing,
            numbers,
        };
        // Spread and weighted by the filter.
        let filtered = |[u, v]: [f64; 2], spacing| {
            let ((dx, wx), (dy, wy)) = (self.filter.sample(u), self.filter.sample(v));
            let position = [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy];
            Shot { position, weight: wx * wy, spacing, numbers }
        };
        // n × n sub-pixels, one ray in each, `place` of the way across (fig. 5.36).
        let grid = |n: u32, place: [f64; 2]| {
            let [u, v] = [(index % n, place[0]), (index / n, place[1])];
            let across = |(i, place)| (f64::from(i) + place) / f64::from(n);
            filtered([across(u), across(v)], 1.0 / f64::from(n))
        };
        match sampling {
            Sampling::Corner => at([0.0; 2], 1.0),
            Sampling::Center => at([0.5; 2], 1.0),
            Sampling::Regular(n) => grid(n, [0.5; 2]),
            Sampling::Jittered(n) => grid(n, [sampler.uniform(index, 0), sampler.uniform(index, 1)]),
            Sampling::Sampled(n) => filtered(numbers.film(), 1.0 / f64::from(n).sqrt()),
            Sampling::Adaptive { .. } => {
                const PLACES: [[f64; 2]; CORNERS as usize] =
                    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];
                // Four of the five are shared with the neighbours: two samples for each pixel.
                at(PLACES[index as usize], std::f64::consts::FRAC_1_SQRT_2)
            }
        }
    }

    #[inline]
    fn eye(&self, world: &World, shot: &Shot) -> Eye {
        let (camera, [x, y]) = (&self.job.camera, shot.position);
        let wants_spread = world.wants_spread();
        let moves = self.moves(world);
        if self.plain && !moves {
            let spread = wants_spread.then(|| camera.spread(x, y, shot.spacing));
            return Eye { line: camera.line(x, y), spread, time: 0.0, lens: None };
        }
        let numbers = shot.numbers.eye();
        // Rounded once, so that camera and world agree about it.
        let time = if moves { numbers.time as f32 } else { 0.0 };
        let ray = camera.ray(x, y, numbers.lens, f64::from(time), wants_spread.then_some(shot.spacing));
        Eye { line: ray.line, spread: ray.spread, time, lens: ray.lens }
    }

    fn moves(&self, world: &World) -> bool {
        world.moves() || self.job.camera.moves()
    }

    /// A sample whose rays a probe sees.
    fn watched<P: Probe>(&self, whitted: &mut Whitted, shot: &Shot, probe: &mut P) -> Rgb {
        probe.sample(shot.position, shot.weight);
        let eye = self.eye(whitted.world(), shot);
        let moves = self.moves(whitted.world());
        if !self.plain || moves {
            probe.drawn(moves.then_some(f64::from(eye.time)), eye.lens.map(|p| p.to_array()));
        }
        whitted.begin(shot.numbers, eye.time);
        whitted.eye(eye.line, eye.spread.as_ref(), probe)
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

/// How many samples a pixel has, or begins with.
fn shots(sampling: Sampling) -> u32 {
    match sampling {
        Sampling::Corner | Sampling::Center => 1,
        Sampling::Regular(n) | Sampling::Jittered(n) => n * n,
        Sampling::Sampled(n) => n,
        Sampling::Adaptive { .. } => CORNERS,
    }
}
