//! A pixel from its samples (5.6): a pure function of world, job and pixel.

use super::lattice::{FilterSites, Lattice, Site};
use crate::film::{Division, FilterTable, Part};
use crate::integrator::zbuffer::sample_spacing;
use crate::integrator::{Probe, RayCounts, RayIntegrator};
use crate::job::Job;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Dimension, FrameSampler, Sample};
use crate::scene::Sampling;
use crate::world::World;
use glam::{DVec2, DVec3};

/// The number of a pixel's first samples whose footprints aren't points, in a picture made in passes.
const FILTERED: u32 = 16;

/// Renders single pixels of a job with an integrator that traces camera rays.
pub(crate) struct PixelRenderer<'a> {
    job: &'a Job,
    filter: FilterTable,
    /// The division of a pixel's samples between the filter's parts.
    division: Division,
    sampler: FrameSampler,
    /// Whether camera rays need no random numbers besides their position in the pixel.
    plain: bool,
    /// The first samples of adaptive sampling: the sites of a pixel, and the colours in the current area.
    probes: FilterSites,
    lattice: Lattice,
    /// Buffers for samples that are traced together.
    samples: Samples,
}

/// Samples of pixels, side by side.
#[derive(Default)]
struct Samples {
    places: Vec<[f64; 2]>,
    numbers: Vec<Sample>,
    weights: Vec<f64>,
    /// The colours of the samples.
    colors: Vec<Rgb>,
    /// The camera rays of one batch.
    lines: Vec<DRay>,
}

impl Samples {
    /// The colours and weights of each pixel with this many samples per pixel.
    fn pixels(&self, samples: u32) -> impl Iterator<Item = impl Iterator<Item = (Rgb, f64)>> {
        let samples = samples as usize;
        let pixels = self.colors.chunks_exact(samples).zip(self.weights.chunks_exact(samples));
        pixels.map(|(colors, weights)| colors.iter().copied().zip(weights.iter().copied()))
    }
}

/// A sample of a pixel.
#[derive(Clone, Copy)]
struct CameraSample {
    /// The position in the picture, in pixels, y upwards.
    position: [f64; 2],
    weight: f64,
    numbers: Sample,
}

/// The camera ray of a sample.
pub(crate) struct CameraRay {
    pub(crate) line: DRay,
    /// The ray differential, if the world needs it.
    pub(crate) differential: Option<RayDifferential>,
    /// The time, from 0 (the shutter opens) to 1 (it closes).
    pub(crate) time: f32,
    /// The point of the lens that the ray leaves.
    lens: Option<DVec2>,
}

impl<'a> PixelRenderer<'a> {
    pub(crate) fn new(job: &'a Job) -> PixelRenderer<'a> {
        let (filter, plain) = (FilterTable::new(job.film.filter), job.camera.is_plain());
        let sampler = FrameSampler::new(job.seed, job.frame, job.film.sampler);
        let probes = match job.film.sampling {
            Sampling::Adaptive { .. } => FilterSites::new(&filter),
            _ => FilterSites::default(),
        };
        // Positions of a regular grid are distributed evenly over the four sides of the negative part.
        let step = if matches!(job.film.sampling, Sampling::Regular(_)) { 4 } else { 1 };
        let division = filter.divide(job.film.sampling.count(), step);
        PixelRenderer {
            job,
            filter,
            division,
            sampler,
            plain,
            probes,
            lattice: Lattice::default(),
            samples: Samples::default(),
        }
    }

    /// Calls `add` with the colour and weight of each sample of the pixel in column `x` and row `y` from the top left.
    /// Returns the number of rays traced for it. A probe observes ray after ray. For adaptive sampling, the number
    /// includes the first samples at the pixel's own corner and centre.
    pub(crate) fn pixel<'w>(
        &mut self,
        integrator: &mut impl RayIntegrator<'w>,
        [x, y]: [u32; 2],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> u64 {
        let sampling = self.job.film.sampling;
        let Sampling::Adaptive { n, threshold } = sampling else {
            return self.trace_with_probe(integrator, self.camera_samples([x, y], sampling), sampling, probe, add);
        };
        let place = self.lattice_place([x, y]);
        if !self.lattice.covers(place) {
            self.sample_sites(integrator, [x, y, 1, 1]);
        }
        // The rays of the survey are counted already.
        let counts = *integrator.counts();
        let own = Site::of(place).into_iter().map(|site| self.site_sample(site, 1.0));
        let rays = self.trace_with_probe(integrator, own, sampling, &mut (), &mut |_, _| ());
        *integrator.counts() = counts;
        if !self.lattice.is_even(&self.probes, place, threshold) {
            let camera_samples = self.camera_samples([x, y], Sampling::Jittered(n));
            return rays + self.trace_with_probe(integrator, camera_samples, Sampling::Jittered(n), probe, add);
        }
        // The probe observes the samples that make the pixel.
        let sites = self.probes.weighted().map(|(site, weight)| self.site_sample(site.at(place), weight));
        self.trace_with_probe(integrator, sites, sampling, probe, add);
        *integrator.counts() = counts;
        rays
    }

    /// Takes the first samples of adaptive sampling in an area (x, y from the top left, width, height). They extend as
    /// far as the filters of its pixels reach. Neighbouring pixels share most of these samples. Does nothing for other
    /// sampling.
    pub(crate) fn sample_sites<'w>(
        &mut self,
        integrator: &mut impl RayIntegrator<'w>,
        [x, y, width, height]: [u32; 4],
    ) {
        let Sampling::Adaptive { .. } = self.job.film.sampling else { return };
        let [left, bottom] = self.lattice_place([x, y + height - 1]);
        let mut lattice = Lattice::around([left, bottom], [width, height], &self.probes);
        let mut samples = std::mem::take(&mut self.samples);
        let mut counts = RayCounts::default();
        for own in [true, false] {
            // Samples of the surrounding pixels are counted with those pixels, so that counts don't depend on tiles.
            if !own {
                counts = *integrator.counts();
            }
            let sites: Vec<Site> = lattice.sites(own).collect();
            let camera_samples = sites.iter().map(|site| self.site_sample(*site, 1.0));
            samples.places.clear();
            samples.numbers.clear();
            for camera_sample in camera_samples {
                samples.places.push(camera_sample.position);
                samples.numbers.push(camera_sample.numbers);
            }
            self.trace(integrator, |_| spacing(self.job.film.sampling), &mut samples);
            let alphas: Vec<f32> = match self.job.film.alpha {
                true => sites.iter().map(|site| self.alpha(integrator, self.site_sample(*site, 1.0))).collect(),
                false => Vec::new(),
            };
            lattice.fill(&sites, &samples.colors, &alphas);
        }
        *integrator.counts() = counts;
        lattice.develop(self.job.film.transfer);
        (self.samples, self.lattice) = (samples, lattice);
    }

    /// The pixel's column and its row from the bottom, as the chapter counts (fig. 5.9b).
    fn lattice_place(&self, [x, y]: [u32; 2]) -> [i64; 2] {
        [i64::from(x), i64::from(self.job.camera.size()[1]) - 1 - i64::from(y)]
    }

    /// The best number of pixels for one call of [`PixelRenderer::pixels`], if this many rays are traced together.
    pub(crate) fn together(&self, batch_size: usize) -> usize {
        match self.job.film.sampling {
            // Few of these pixels are refined.
            Sampling::Adaptive { .. } => batch_size / 4,
            sampling => (batch_size / sampling.count() as usize).max(1),
        }
    }

    /// Calls `add` with the number, colour and weight of each sample of many pixels, whose rays are traced together.
    /// Neighbours in the list should be neighbours in the picture. With adaptive sampling they lie in the area of the
    /// last [`PixelRenderer::sample_sites`].
    pub(crate) fn pixels<'w>(
        &mut self,
        integrator: &mut impl RayIntegrator<'w>,
        pixels: &[[u32; 2]],
        mut add: impl FnMut(usize, Rgb, f64),
    ) {
        let sampling = self.job.film.sampling;
        let mut samples = std::mem::take(&mut self.samples);
        if let Sampling::Adaptive { n, threshold } = sampling {
            let place = |pixel: &[u32; 2]| self.lattice_place(*pixel);
            let is_uneven = |pixel: &&[u32; 2]| !self.lattice.is_even(&self.probes, place(pixel), threshold);
            let rest: Vec<[u32; 2]> = pixels.iter().filter(is_uneven).copied().collect();
            self.samples(integrator, &rest, Sampling::Jittered(n), &mut samples);
            let mut fine = rest.iter().zip(samples.pixels(n * n)).peekable();
            for (number, pixel) in pixels.iter().enumerate() {
                match fine.next_if(|(uneven, _)| *uneven == pixel) {
                    Some((_, samples)) => samples.for_each(|(color, weight)| add(number, color, weight)),
                    None => {
                        let colors = self.lattice.colors(&self.probes, self.lattice_place(*pixel));
                        colors.for_each(|(color, weight)| add(number, color, weight));
                    }
                }
            }
        } else {
            self.samples(integrator, pixels, sampling, &mut samples);
            for (number, samples) in samples.pixels(sampling.count()).enumerate() {
                samples.for_each(|(color, weight)| add(number, color, weight));
            }
        }
        self.samples = samples;
    }

    /// Calls `add` with the number and the colours of a block of samples of many pixels, whose rays are traced
    /// together. The block is the number of its first sample and its size. Does nothing if the render is cancelled
    /// meanwhile.
    pub(crate) fn block<'w>(
        &mut self,
        integrator: &mut impl RayIntegrator<'w>,
        pixels: &[[u32; 2]],
        [first, size]: [u32; 2],
        mut add: impl FnMut(usize, &mut [Rgb]),
    ) {
        let mut samples = std::mem::take(&mut self.samples);
        samples.places.clear();
        samples.numbers.clear();
        for &pixel in pixels {
            for index in first..first + size {
                let CameraSample { position, numbers, .. } = self.progressive_sample(pixel, index);
                samples.places.push(position);
                samples.numbers.push(numbers);
            }
        }
        let spacing = |at: usize| progressive_spacing(self.job.sample_count(), first + at as u32 % size);
        self.trace(integrator, spacing, &mut samples);
        if !integrator.is_cancelled() {
            for (number, colors) in samples.colors.chunks_exact_mut(size as usize).enumerate() {
                add(number, colors);
            }
        }
        self.samples = samples;
    }

    /// The share of the background that sample number `index` of a pixel hides, of a picture made in passes.
    pub(crate) fn sample_alpha<'w>(&self, integrator: &mut impl RayIntegrator<'w>, pixel: [u32; 2], index: u32) -> f64 {
        self.alpha(integrator, self.progressive_sample(pixel, index)).into()
    }

    /// The share of the background that a sample hides.
    fn alpha<'w>(&self, integrator: &mut impl RayIntegrator<'w>, sample: CameraSample) -> f32 {
        let eye = self.eye(integrator.world(), sample.position, &sample.numbers, 0.0);
        integrator.begin(sample.numbers, eye.time);
        integrator.alpha(eye.line)
    }

    /// Calls `add` with the colour of each sample of a block of a pixel's samples. A probe observes ray after ray.
    pub(crate) fn block_with_probe<'w>(
        &self,
        integrator: &mut impl RayIntegrator<'w>,
        pixel: [u32; 2],
        [first, size]: [u32; 2],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb),
    ) {
        let sample =
            |index: u32| (self.progressive_sample(pixel, index), progressive_spacing(self.job.sample_count(), index));
        self.trace_each(integrator, &mut (first..first + size).map(sample), probe, &mut |color, _| add(color));
    }

    /// Calls `add` with what the job's rays see at places of a pixel, with weights, as a rasteriser looks at them.
    pub(crate) fn at_places<'w>(
        &self,
        integrator: &mut impl RayIntegrator<'w>,
        pixel: [u32; 2],
        places: &[([f64; 2], f64)],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) {
        let (camera, spacing) = (self.job.camera.at(0.0), sample_spacing(self.job));
        let needs_differentials = integrator.world().needs_differentials();
        let sampler = self.sampler.pixel(pixel);
        for (index, &([x, y], weight)) in places.iter().enumerate() {
            let differential = needs_differentials.then(|| camera.differential(x, y, spacing));
            probe.sample([x, y], weight);
            integrator.begin(sampler.sample(index as u32, places.len() as u32), 0.0);
            add(integrator.eye(camera.line(x, y), differential.as_ref(), probe), weight);
        }
    }

    /// The colour along a ray with a unit direction that no pixel sends, at the shutter's opening.
    pub(crate) fn along<'w>(&self, integrator: &mut impl RayIntegrator<'w>, line: DRay, probe: &mut dyn Probe) -> Rgb {
        probe.sample([0.0; 2], 1.0);
        integrator.begin(self.sampler.pixel([0; 2]).sample(0, 1), 0.0);
        integrator.eye(line, None, probe)
    }

    /// Sample number `index` of a pixel of a picture made in passes. It doesn't depend on how many there are, unless
    /// there is a single one.
    fn progressive_sample(&self, [x, y]: [u32; 2], index: u32) -> CameraSample {
        let corner = [f64::from(x), f64::from(self.job.camera.size()[1] - 1 - y)];
        let count = self.job.sample_count();
        let numbers = self.sampler.pixel([x, y]).sample(index, count);
        let [dx, dy] = if count == 1 { [0.0; 2] } else { self.filter.place(Part::Above, numbers.film()) };
        CameraSample { position: [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy], weight: 1.0, numbers }
    }

    /// Chooses and traces all samples of some pixels.
    fn samples<'w>(
        &mut self,
        integrator: &mut impl RayIntegrator<'w>,
        pixels: &[[u32; 2]],
        sampling: Sampling,
        samples: &mut Samples,
    ) {
        // Each case is compiled separately.
        match sampling {
            Sampling::Corner => self.choose(pixels, Sampling::Corner, samples),
            Sampling::Center => self.choose(pixels, Sampling::Center, samples),
            other => self.choose(pixels, other, samples),
        }
        self.trace(integrator, |_| spacing(sampling), samples);
    }

    /// The colours of the chosen samples. `spacing` is that of a sample by its place in the list.
    fn trace<'w, I: RayIntegrator<'w>>(
        &self,
        integrator: &mut I,
        spacing: impl Fn(usize) -> f64,
        samples: &mut Samples,
    ) {
        let Samples { places, numbers, colors, lines, .. } = samples;
        colors.clear();
        let (world, camera) = (integrator.world(), &self.job.camera);
        let world_moves = world.moves();
        if !self.plain || self.moves(world) {
            for (at, (place, numbers)) in places.iter().zip(numbers).enumerate() {
                let CameraRay { line, differential, time, .. } = self.eye(world, *place, numbers, spacing(at));
                let times = if world_moves { &[time][..] } else { &[] };
                integrator.push_camera_rays(&[line], &[*numbers], times, differential);
                if integrator.is_full() {
                    colors.extend_from_slice(integrator.trace_pending());
                }
                if integrator.is_cancelled() {
                    break;
                }
            }
            colors.extend_from_slice(integrator.trace_pending());
            return colors.resize(places.len(), Rgb::BLACK);
        }
        let needs_differentials = world.needs_differentials();
        let batches = places.chunks(I::BATCH_SIZE).zip(numbers.chunks(I::BATCH_SIZE));
        for (first, (places, numbers)) in (0..).step_by(I::BATCH_SIZE).zip(batches) {
            lines.resize(places.len(), DRay { origin: DVec3::ZERO, direction: DVec3::ZERO });
            camera.lines(places, lines);
            let seen = if needs_differentials { places } else { &[] };
            let differential = |(at, [x, y]): (usize, &[f64; 2])| camera.differential(*x, *y, spacing(first + at));
            let differentials = seen.iter().enumerate().map(differential);
            integrator.push_camera_rays(lines, numbers, &[], differentials);
            colors.extend_from_slice(integrator.trace_pending());
            if integrator.is_cancelled() {
                break;
            }
        }
        colors.resize(places.len(), Rgb::BLACK);
    }

    /// Chooses the positions, weights and random numbers of the samples of some pixels.
    #[inline(always)]
    fn choose(&self, pixels: &[[u32; 2]], sampling: Sampling, samples: &mut Samples) {
        let Samples { places, numbers, weights, .. } = samples;
        let each = sampling.count() as usize;
        let count = pixels.len() * each;
        places.resize(count, [0.0; 2]);
        numbers.resize(count, self.sampler.pixel([0; 2]).sample(0, 1));
        weights.resize(count, 1.0);
        let (places, numbers, weights) = (&mut places[..count], &mut numbers[..count], &mut weights[..count]);
        let mut at = 0;
        for &pixel in pixels {
            for i in 0..each {
                let camera_sample = self.camera_sample(pixel, sampling, i as u32);
                (places[at], numbers[at], weights[at]) =
                    (camera_sample.position, camera_sample.numbers, camera_sample.weight);
                at += 1;
            }
        }
    }

    /// The samples of a pixel.
    fn camera_samples(&self, pixel: [u32; 2], sampling: Sampling) -> impl Iterator<Item = CameraSample> + use<'_, 'a> {
        (0..sampling.count()).map(move |index| self.camera_sample(pixel, sampling, index))
    }

    /// The camera rays of a pixel's samples, with their random numbers and weights.
    pub(crate) fn camera_rays<'r>(
        &'r self,
        world: &'r World,
        pixel: [u32; 2],
    ) -> impl Iterator<Item = (CameraRay, Sample, f64)> + use<'r, 'a> {
        let sampling = self.job.film.sampling;
        self.camera_samples(pixel, sampling).map(move |sample| {
            let ray = self.eye(world, sample.position, &sample.numbers, spacing(sampling));
            (ray, sample.numbers, sample.weight)
        })
    }

    /// Sample number `index` of a pixel.
    #[inline(always)]
    fn camera_sample(&self, [x, y]: [u32; 2], sampling: Sampling, index: u32) -> CameraSample {
        // The chapter counts rows from the bottom (fig. 5.9b).
        let corner = [f64::from(x), f64::from(self.job.camera.size()[1] - 1 - y)];
        let sampler = self.sampler.pixel([x, y]);
        let (numbers, division) = (sampler.sample(index, sampling.count()), &self.division);
        let at = |[dx, dy]: [f64; 2]| CameraSample { position: [corner[0] + dx, corner[1] + dy], weight: 1.0, numbers };
        // Distributed by the filter.
        let filtered = |(part, place): (Part, [f64; 2])| {
            let [dx, dy] = self.filter.place(part, place);
            let weight = division.weights[part as usize];
            CameraSample { position: [corner[0] + 0.5 + dx, corner[1] + 0.5 + dy], weight, numbers }
        };
        match sampling {
            Sampling::Corner => at([0.0; 2]),
            // A single ray goes through the centre, although several rays would be distributed.
            Sampling::Center | Sampling::Sampled(1) => at([0.5; 2]),
            Sampling::Regular(n) => filtered(cell(index, n, division, [0.5; 2])),
            Sampling::Jittered(n) | Sampling::Adaptive { n, .. } => {
                let place = [sampler.uniform(index, 0), sampler.uniform(index, 1)];
                filtered(cell(index, n, division, place))
            }
            Sampling::Sampled(_) => filtered(match index.checked_sub(division.above) {
                None => (Part::Above, numbers.two_among(Dimension::EYE, index, division.above)),
                Some(index) => (Part::Below, numbers.two_among(Dimension::BELOW, index, division.below)),
            }),
        }
    }

    /// A first sample of adaptive sampling. Each pixel of the lattice has random numbers for two.
    fn site_sample(&self, site: Site, weight: f64) -> CameraSample {
        let [x, y] = site.pixel;
        // Beyond the picture's edges, rows and columns continue modulo 2³².
        let row = i64::from(self.job.camera.size()[1]) - 1 - y;
        let numbers = self.sampler.pixel([x as u32, row as u32]).sample(site.kind as u32, 2);
        CameraSample { position: site.position(), weight, numbers }
    }

    #[inline]
    fn eye(&self, world: &World, [x, y]: [f64; 2], numbers: &Sample, spacing: f64) -> CameraRay {
        let camera = &self.job.camera;
        let needs_differentials = world.needs_differentials();
        let moves = self.moves(world);
        if self.plain && !moves {
            let differential = needs_differentials.then(|| camera.differential(x, y, spacing));
            return CameraRay { line: camera.line(x, y), differential, time: 0.0, lens: None };
        }
        let numbers = numbers.eye();
        // The time is rounded once, so that camera and world use equal times.
        let time = if moves { numbers.time as f32 } else { 0.0 };
        let ray = camera.ray(x, y, numbers.lens, f64::from(time), needs_differentials.then_some(spacing));
        CameraRay { line: ray.line, differential: ray.differential, time, lens: ray.lens }
    }

    fn moves(&self, world: &World) -> bool {
        world.moves() || self.job.camera.moves()
    }

    /// Calls `add` with samples whose rays a probe observes, and returns the number of these rays.
    fn trace_with_probe<'w>(
        &self,
        integrator: &mut impl RayIntegrator<'w>,
        camera_samples: impl Iterator<Item = CameraSample>,
        sampling: Sampling,
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> u64 {
        let mut samples = camera_samples.map(|sample| (sample, spacing(sampling)));
        self.trace_each(integrator, &mut samples, probe, add)
    }

    /// Calls `add` with the colour and weight of each sample, whose rays a probe observes. The samples have their
    /// [`spacing`]s with them. Returns the number of these rays.
    fn trace_each<'w>(
        &self,
        integrator: &mut impl RayIntegrator<'w>,
        camera_samples: &mut dyn Iterator<Item = (CameraSample, f64)>,
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> u64 {
        let before = integrator.counts().total();
        let moves = self.moves(integrator.world());
        for (camera_sample, spacing) in camera_samples {
            probe.sample(camera_sample.position, camera_sample.weight);
            let eye = self.eye(integrator.world(), camera_sample.position, &camera_sample.numbers, spacing);
            if !self.plain || moves {
                probe.drawn(moves.then_some(f64::from(eye.time)), eye.lens.map(|p| p.to_array()));
            }
            integrator.begin(camera_sample.numbers, eye.time);
            if self.job.has_alpha() {
                probe.alpha(integrator.alpha(eye.line));
            }
            add(integrator.eye(eye.line, eye.differential.as_ref(), probe), camera_sample.weight);
        }
        integrator.counts().total() - before
    }
}

/// The position of sample `index` in a grid of n × n, at `place` within its cell (fig. 5.36). If some samples are for
/// the filter's negative part, the others keep the grid's rows. Some rows are then shorter by a cell, and lower.
#[inline]
fn cell(index: u32, n: u32, division: &Division, place: [f64; 2]) -> (Part, [f64; 2]) {
    if division.below == 0 {
        let [u, v] = [(index % n, place[0]), (index / n, place[1])];
        let across = |(i, place)| (f64::from(i) + place) / f64::from(n);
        return (Part::Above, [across(u), across(v)]);
    }
    match index.checked_sub(division.above) {
        None => (Part::Above, in_rows(index, division.above, n, place)),
        Some(index) => (Part::Below, in_rows(index, division.below, division.below.min(2), place)),
    }
}

/// A position in one of `count` cells of equal area, in rows of nearly equal numbers of cells.
fn in_rows(index: u32, count: u32, rows: u32, [x, y]: [f64; 2]) -> [f64; 2] {
    let start = |row: u32| row * count / rows;
    let row = (0..rows).rev().find(|row| start(*row) <= index).unwrap_or(0);
    let (first, cells) = (start(row), start(row + 1) - start(row));
    [(f64::from(index - first) + x) / f64::from(cells), (f64::from(first) + y * f64::from(cells)) / f64::from(count)]
}

/// The distance between a pixel's samples in pixels, as if they stood on a grid.
fn spacing(sampling: Sampling) -> f64 {
    match sampling {
        Sampling::Corner | Sampling::Center => 1.0,
        Sampling::Regular(n) | Sampling::Jittered(n) => 1.0 / f64::from(n),
        Sampling::Sampled(n) => 1.0 / f64::from(n).sqrt(),
        // There are two for each pixel.
        Sampling::Adaptive { .. } => std::f64::consts::FRAC_1_SQRT_2,
    }
}

/// [`spacing`] of sample number `index` of a progressive picture, whose number of samples isn't known: that of 64
/// samples for the first few. Later samples look at points, so that what footprints blur, as at a horizon, falls as 1
/// over the number of samples, faster than noise. With footprints the first samples have less noise. A single sample
/// has the whole pixel.
pub(crate) fn progressive_spacing(count: u32, index: u32) -> f64 {
    match index {
        _ if count == 1 => 1.0,
        0..FILTERED => 0.125,
        _ => 0.0,
    }
}
