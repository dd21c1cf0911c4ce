//! Pictures that grow by passes: each pass adds an aligned block of samples to every pixel that still needs some.
//!
//! Sample i of a pixel doesn't depend on how many there will be. So a picture can be stopped after any pass, gone on
//! with later, and made in parts that are added ([`SampleBlocks`]).

use super::aov_probe::AovProbe;
use super::noise::NoiseEstimate;
use super::{PixelRenderer, Rendering, StopOnDrop, in_squares};
use crate::film::{BlockMean, NoiseOutlook, SampleBlocks, SampleStatistics, TileBuffer, block_sizes};
use crate::integrator::{Cancelled, Counts, PreparedRayIntegrator, RayIntegrator};
use crate::job::{Aov, BLUE_NOISE, Job, JobError, Observer, PassProgress, Progress};
use crate::scene::SamplerKind;
use crate::world::World;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The number of samples after the next pass over pixels with `count` samples, at most `end`. The first passes double
/// it. Later ones add a quarter of its highest digit, so that a picture that must stop loses little of what was begun.
fn next_count(count: u32, end: u32) -> u32 {
    let step = match count {
        0 => 1,
        1..16 => 1 << count.ilog2(),
        _ => 1 << (count.ilog2() - 2),
    };
    // A count that isn't a multiple of the step goes to the next one, by smaller blocks.
    (count - count % step).saturating_add(step).min(end)
}

/// A picture in the making.
struct Passes<'a, I> {
    world: &'a World,
    job: &'a Job,
    integrator: &'a I,
    tiles: Vec<Mutex<SampleTile>>,
    /// The layers of geometry, which are made by watching the first ray of each pixel.
    watched: Vec<Aov>,
}

/// What is known of the pixels of a tile.
struct SampleTile {
    /// x and y from the picture's upper left corner, width and height, in pixels.
    area: [u32; 4],
    blocks: SampleBlocks,
    /// The layers of geometry; none without such layers.
    layers: Option<TileBuffer>,
    /// The sum of each pixel's alphas, and the number of samples in it; empty if nobody asks for alpha.
    alphas: Vec<(f64, u32)>,
    statistics: SampleStatistics,
}

/// The picture so far, which the threads share.
struct Shared {
    rendering: Rendering,
    noise: Option<NoiseEstimate>,
    /// The number of samples that are finished in this run.
    samples: u64,
}

/// Checks that samples can be gone on with in a job.
pub(super) fn check_start(job: &Job, start: &SampleBlocks) -> Result<(), JobError> {
    let wrong = |problem: String| Err(JobError::Start(problem));
    let passes = if job.film.sampler == SamplerKind::BlueNoise { Err(BLUE_NOISE) } else { job.passes() };
    passes.map_err(|why| JobError::NotInPasses { what: "going on with samples", why })?;
    let ([_, _, width, height], [own_width, own_height]) = (job.window(), start.size());
    if [width, height] != start.size() {
        return wrong(format!("they are of {own_width} x {own_height} pixels, not of {width} x {height}"));
    }
    if start.first() != job.first_sample {
        return wrong(format!("they begin with number {}, not with {}", start.first(), job.first_sample));
    }
    let count = job.sample_count();
    if count == 1 {
        return wrong("a single sample goes through the pixel's centre, where several don't".into());
    }
    let asks_for_halves = job.aovs.iter().any(|aov| aov.is_half());
    // A block becomes a half of a larger one where the number of samples has a digit more.
    let stays = |old: u32| old > 1 && (job.first_sample > 0 || old.max(count).ilog2() == old.ilog2());
    let has_old_blocks = start.counts().iter().any(|old| stays(*old));
    if asks_for_halves && !start.keeps_halves() && has_old_blocks {
        let most = start.counts().iter().copied().max().unwrap_or(1);
        let least = 2 << most.ilog2();
        return wrong(format!("their halves aren't known; with {least} samples and more they will be"));
    }
    Ok(())
}

/// Makes a picture in passes, from nothing or from a picture that has samples already.
pub(super) fn render<I: PreparedRayIntegrator>(
    world: &World,
    job: &Job,
    integrator: &I,
    start: Option<&SampleBlocks>,
    observer: &dyn Observer,
) -> Rendering {
    let [left, top, width, height] = job.window();
    let first = job.first_sample;
    let keeps_halves = job.noise.is_some() || job.aovs.iter().any(|aov| aov.is_half());
    let watched: Vec<Aov> = job.aovs.iter().copied().filter(|aov| is_watched(*aov)).collect();
    let alphas = |pixels: u32| if job.has_alpha() { vec![(0.0, 0); pixels as usize] } else { Vec::new() };
    let side = job.tile.max(1);
    let mut tiles = Vec::new();
    for y in (0..height).step_by(side as usize) {
        for x in (0..width).step_by(side as usize) {
            let [w, h] = [side.min(width - x), side.min(height - y)];
            let layers = (!watched.is_empty()).then(|| {
                let rules = watched.iter().map(|aov| (aov.channels().len(), aov.accumulation()));
                TileBuffer::new([left + x, top + y, w, h], rules)
            });
            let blocks = match start {
                Some(start) => start.part([x, y, w, h], keeps_halves),
                None => SampleBlocks::new([w, h], first, keeps_halves),
            };
            let area = [left + x, top + y, w, h];
            let statistics = SampleStatistics::default();
            tiles.push(Mutex::new(SampleTile { area, blocks, layers, alphas: alphas(w * h), statistics }));
        }
    }
    let passes = Passes { world, job, integrator, tiles, watched };
    let rendering = Rendering { counts: integrator.preparation_counts(), ..Rendering::unfinished(world, job) };
    let noise = job.noise.map(|limit| NoiseEstimate::new([width, height], limit));
    let mut shared = Shared { rendering, noise, samples: 0 };
    for tile in &passes.tiles {
        let tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
        passes.write(&mut shared, &tile);
    }
    let fewest = start.and_then(|start| start.counts().iter().min().copied()).unwrap_or(0);
    passes.run(Mutex::new(shared), fewest, observer)
}

impl<I: PreparedRayIntegrator> Passes<'_, I> {
    /// Makes all passes over pixels that have this number of samples or more.
    fn run(&self, shared: Mutex<Shared>, from: u32, observer: &dyn Observer) -> Rendering {
        let [_, _, width, height] = self.job.window();
        let end = self.job.sample_count().max(from);
        let all = u64::from(width) * u64::from(height) * u64::from(end - from);
        let stopped = AtomicBool::new(false);
        let cancelled = |_| stopped.load(Ordering::Relaxed) || observer.cancelled();
        let mut count = from;
        let mut needed = self.judge(&shared, count, end);
        // A picture that has enough samples already may need layers.
        let mut needs_pass = needed > 0 || !self.watched.is_empty() || self.job.has_alpha();
        while needs_pass {
            let next = if needed > 0 { next_count(count, end) } else { count };
            self.pass(&shared, self.job.first_sample + next, all, &cancelled, &stopped, observer);
            if stopped.load(Ordering::Relaxed) {
                break;
            }
            count = next;
            needed = self.judge(&shared, count, end);
            let shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let outlook = || self.outlook(shared.noise.as_ref(), end);
            let progress = PassProgress {
                samples: count,
                next: (needed > 0).then(|| next_count(count, end)),
                pixels_left: needed,
                noise: shared.noise.as_ref().map(NoiseEstimate::largest),
                picture: &shared.rendering.picture,
                outlook: &outlook,
            };
            needs_pass = observer.pass_ended(&progress).is_continue() && needed > 0;
        }
        let Shared { mut rendering, noise, .. } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        rendering.complete = !stopped.load(Ordering::Relaxed);
        self.gather(&mut rendering);
        if let (Some(statistics), Some(noise)) = (&mut rendering.statistics, &noise) {
            statistics.noise = Some(noise.largest());
        }
        if let Some(statistics) = &mut rendering.statistics {
            statistics.outlook = Some(self.outlook(noise.as_ref(), end));
        }
        rendering
    }

    /// What is left of the noise of pixels that get at most `end` samples.
    fn outlook(&self, noise: Option<&NoiseEstimate>, end: u32) -> NoiseOutlook {
        let [left, top, width, _] = self.job.window();
        let mut counts = Vec::new();
        let (mut statistics, mut squares, mut samples) = (SampleStatistics::default(), 0.0, 0.0);
        counts.resize(noise.map_or(0, NoiseEstimate::pixels), 0);
        for tile in &self.tiles {
            let tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
            statistics.add(&tile.statistics);
            let [x, y, tile_width, _] = tile.area;
            for (pixel, &count) in tile.blocks.counts().iter().enumerate() {
                let mean = tile.blocks.mean(pixel).to_array().map(f64::from);
                samples += f64::from(count);
                squares += f64::from(count) * mean.iter().map(|v| v * v).sum::<f64>();
                let (column, row) = (pixel as u32 % tile_width, pixel as u32 / tile_width);
                let to = (y - top + row) as usize * width as usize + (x - left + column) as usize;
                counts.get_mut(to).into_iter().for_each(|own| *own = count);
            }
        }
        let clamp =
            if self.job.clamp.is_none() { statistics.clamp_outlook(squares / f64::max(samples, 1.0)) } else { None };
        let noisiest = noise.and_then(|noise| noise.noisiest([left, top]));
        let left = noise.and_then(|noise| noise.samples_left(&counts, end));
        NoiseOutlook { noisiest, left, clamp }
    }

    /// The number of pixels that need more than `count` samples, of at most `end`.
    fn judge(&self, shared: &Mutex<Shared>, count: u32, end: u32) -> u64 {
        let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
        let pixels = shared.rendering.picture.pixels.len() as u64;
        let needed = shared.noise.as_mut().map_or(pixels, |noise| noise.judge(count));
        if count < end { needed } else { 0 }
    }

    /// Makes one pass over all tiles: pixels that still need samples get them up to number `end`.
    fn pass(
        &self,
        shared: &Mutex<Shared>,
        end: u32,
        all: u64,
        cancelled: Cancelled<'_>,
        stopped: &AtomicBool,
        observer: &dyn Observer,
    ) {
        let needed = {
            let shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            shared.noise.as_ref().map(|noise| noise.needed().to_vec())
        };
        let next = AtomicUsize::new(0);
        let [left, top, width, _] = self.job.window();
        rayon::broadcast(|_| {
            let ended = StopOnDrop(stopped);
            let mut worker = Worker {
                integrator: self.integrator.picture_worker(self.world, self.job, cancelled),
                cancelled,
                pixels: PixelRenderer::new(self.job),
                size: [0; 2],
                places: Vec::new(),
                together: Vec::new(),
            };
            while !stopped.load(Ordering::Relaxed) {
                let Some(tile) = self.tiles.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                let mut tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
                let [x0, y0, ..] = tile.area;
                let needs = |[x, y]: [u32; 2]| {
                    let cell = NoiseEstimate::cell_of([x0 - left + x, y0 - top + y], width);
                    needed.as_ref().is_none_or(|needed| needed[cell])
                };
                let added = worker.tile(self, &mut tile, end, needs);
                let Ok(mut shared) = shared.lock() else { break };
                // Whole blocks of an unfinished tile are kept.
                self.write(&mut shared, &tile);
                let ControlFlow::Continue(samples) = added else {
                    stopped.store(true, Ordering::Relaxed);
                    break;
                };
                shared.samples += samples;
                shared.rendering.counts += Counts::from(std::mem::take(worker.integrator.counts()));
                let (done, pixels) = (shared.samples, shared.rendering.picture.pixels.len() as u64);
                let progress = Progress {
                    pixels_done: (u128::from(pixels) * u128::from(done) / u128::from(all.max(1))) as u64,
                    pixels,
                    rays: shared.rendering.counts.rays.total(),
                };
                drop(shared);
                observer.progress(&progress);
            }
            std::mem::forget(ended);
        });
    }

    /// Writes what is known of a tile into the picture and the estimate of noise.
    fn write(&self, shared: &mut Shared, tile: &SampleTile) {
        let Shared { rendering: Rendering { picture, .. }, noise, .. } = shared;
        let [left, top, ..] = self.job.window();
        let [x, y, width, height] = tile.area;
        for row in 0..height {
            let to = (y - top + row) as usize * picture.width as usize + (x - left) as usize;
            for column in 0..width as usize {
                let pixel = row as usize * width as usize + column;
                picture.pixels[to + column] = tile.blocks.mean(pixel);
                if let Some(alpha) = picture.alpha.get_mut(to + column) {
                    *alpha = tile.alpha(pixel);
                }
                if let (Some(noise), Some(halves)) = (noise.as_mut(), tile.blocks.half_means(pixel)) {
                    noise.set(to + column, picture.pixels[to + column], halves);
                }
            }
        }
        let mut watched = 0;
        for (aov, layer) in self.job.aovs.iter().zip(&mut picture.layers) {
            if let (true, Some(buffer)) = (is_watched(*aov), &tile.layers) {
                buffer.write_layer(watched, layer, picture.width, [left, top]);
                watched += 1;
                continue;
            }
            for row in 0..height {
                let to = (y - top + row) as usize * picture.width as usize + (x - left) as usize;
                for column in 0..width as usize {
                    let pixel = row as usize * width as usize + column;
                    let halves = || tile.blocks.half_means(pixel).unwrap_or_default();
                    match aov {
                        Aov::HalfA => layer.data[(to + column) * 3..][..3].copy_from_slice(&halves()[0].to_array()),
                        Aov::HalfB => layer.data[(to + column) * 3..][..3].copy_from_slice(&halves()[1].to_array()),
                        Aov::Alpha => layer.data[to + column] = tile.alpha(pixel),
                        _ => layer.data[to + column] = tile.blocks.counts()[pixel] as f32,
                    }
                }
            }
        }
    }

    /// Adds what only the end of a render needs: the blocks of all pixels, and statistics.
    fn gather(&self, rendering: &mut Rendering) {
        let [left, top, width, height] = self.job.window();
        let tiles: Vec<_> = self.tiles.iter().map(|tile| tile.lock().unwrap_or_else(PoisonError::into_inner)).collect();
        let keeps_halves = tiles.first().is_some_and(|tile| tile.blocks.keeps_halves());
        let mut blocks = SampleBlocks::new([width, height], self.job.first_sample, keeps_halves);
        let mut statistics = SampleStatistics::default();
        for tile in &tiles {
            blocks.insert(&tile.blocks, [tile.area[0] - left, tile.area[1] - top]);
            statistics.add(&tile.statistics);
        }
        statistics.count(blocks.counts());
        rendering.pixels_done = blocks.counts().iter().filter(|count| **count > 0).count() as u64;
        rendering.statistics = Some(statistics);
        rendering.samples = Some(blocks);
    }
}

/// Whether a layer is made by watching the first ray of each pixel. The others come from the samples.
fn is_watched(aov: Aov) -> bool {
    !aov.is_of_samples() && aov != Aov::Alpha
}

impl SampleTile {
    /// The mean alpha of a pixel.
    fn alpha(&self, pixel: usize) -> f32 {
        let (sum, count) = self.alphas[pixel];
        if count == 0 { 0.0 } else { (sum / f64::from(count)) as f32 }
    }
}

/// The state of one thread.
struct Worker<'a, R> {
    integrator: R,
    cancelled: Cancelled<'a>,
    pixels: PixelRenderer<'a>,
    /// The size of the last tile, and its places [in squares](in_squares).
    size: [u32; 2],
    places: Vec<[u32; 2]>,
    /// Pixels that are traced together.
    together: Vec<[u32; 2]>,
}

impl<'a, R: RayIntegrator<'a>> Worker<'a, R> {
    /// Adds samples up to number `end` to the pixels of a tile that need them. Returns how many it added.
    fn tile<I>(
        &mut self,
        passes: &Passes<'_, I>,
        tile: &mut SampleTile,
        end: u32,
        needs: impl Fn([u32; 2]) -> bool,
    ) -> ControlFlow<(), u64> {
        let [x0, y0, width, height] = tile.area;
        if self.size != [width, height] {
            (self.size, self.places) = ([width, height], in_squares([width, height]));
        }
        let is_new = tile.layers.as_ref().is_some_and(|layers| layers.pass() == 0);
        if is_new {
            self.watch_first(passes, tile)?;
        }
        let first = tile.blocks.first();
        let number = |[x, y]: [u32; 2]| (y * width + x) as usize;
        let mut samples = 0;
        loop {
            // Pixels with the fewest samples are first, so that all have equally many in the end.
            let counts = tile.blocks.counts();
            let wanting = self.places.iter().filter(|place| first + counts[number(**place)] < end && needs(**place));
            let Some(count) = wanting.map(|place| counts[number(*place)]).min() else { break };
            let start = first + count;
            let Some(size) = block_sizes(start, end).next() else { break };
            let places: Vec<[u32; 2]> = self
                .places
                .iter()
                .filter(|place| counts[number(**place)] == count && needs(**place))
                .copied()
                .collect();
            samples += places.len() as u64 * u64::from(size);
            for chunk in places.chunks((R::BATCH_SIZE / size as usize).max(1)) {
                self.poll()?;
                self.together.clear();
                self.together.extend(chunk.iter().map(|[x, y]| [x0 + x, y0 + y]));
                let SampleTile { blocks, statistics, .. } = tile;
                let clamp = passes.job.clamp;
                self.pixels.block(&mut self.integrator, &self.together, [start, size], |index, colors| {
                    let [x, y] = chunk[index];
                    statistics.check(colors, clamp, [x0 + x, y0 + y], start);
                    blocks.push(number([x, y]), size, BlockMean::of_samples(colors));
                });
            }
        }
        for (pixel, (sum, alphas)) in tile.alphas.iter_mut().enumerate() {
            self.poll()?;
            let place = [x0 + pixel as u32 % width, y0 + pixel as u32 / width];
            let count = tile.blocks.counts()[pixel];
            // One after the other, so that the sum is the same in any passes.
            for index in first + *alphas..first + count {
                *sum += self.pixels.sample_alpha(&mut self.integrator, place, index);
            }
            *alphas = count;
        }
        if let Some(layers) = &mut tile.layers {
            layers.end_pass();
        }
        ControlFlow::Continue(samples)
    }

    /// Collects layers of geometry by the first sample of each pixel.
    fn watch_first<I>(&mut self, passes: &Passes<'_, I>, tile: &mut SampleTile) -> ControlFlow<()> {
        let [x0, y0, width, height] = tile.area;
        let first = tile.blocks.first();
        let Some(layers) = &mut tile.layers else { return ControlFlow::Continue(()) };
        for index in 0..(width * height) as usize {
            self.poll()?;
            let place = [x0 + index as u32 % width, y0 + index as u32 / width];
            let mut probe = AovProbe::new(self.integrator.world(), &passes.job.camera);
            // The rays are those of the picture's first pass, and aren't counted twice.
            let counts = *self.integrator.counts();
            self.pixels.block_with_probe(&mut self.integrator, place, [first, 1], &mut probe, &mut Vec::new());
            *self.integrator.counts() = counts;
            probe.finish(0, &passes.watched, index, layers);
        }
        ControlFlow::Continue(())
    }

    /// Breaks if the render was cancelled.
    fn poll(&mut self) -> ControlFlow<()> {
        let is_cancelled = self.integrator.is_cancelled() || (self.cancelled)(self.integrator.counts().total());
        if is_cancelled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
