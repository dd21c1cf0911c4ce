//! A render that is open: what its integrator prepared, and the picture so far.

use super::noise::NoiseEstimate;
use super::sample_tile::{SampleTile, layers_of_first_sample};
use super::{Rendering, features, stack_of};
use crate::film::{Checkpoint, NoiseOutlook, Pass, Picture, SampleBlocks, SampleStatistics, TileBuffer};
use crate::integrator::{BLUE_NOISE, Cancelled, Counts, IntegratorWorker, Preparation, PreparedIntegrator, TaskQueue};
use crate::integrator::{PreparedRadiosity, Transport, preparable};
use crate::job::{Aov, FinishedTile, Job, JobError, Observer, PassProgress, PlacedJob, Progress};
use crate::scene::SamplerKind;
use crate::world::World;
use canaletto_bvh::with_stack;
use std::collections::HashMap;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError, TryLockError};

/// A job in its world with what its integrator prepared and the picture so far. Pictures, passes, parts of pictures and
/// explanations of pixels are made from it, and nothing is prepared twice.
///
/// ```
/// use canaletto::render::{Preparation, Session};
/// use std::ops::ControlFlow;
/// # use canaletto::{camera::Camera, render::Job, scene::*, world::World};
/// # let camera = Camera::new(&Intrinsics { width: 8, height: 8, ..Intrinsics::default() }, &Extrinsics::default())?;
/// # let film = FilmSettings { sampling: Sampling::Sampled(4), ..FilmSettings::default() };
/// # let (world, job) = (World::build(Scene::default())?, Job::new(camera, film, PathSettings::default()));
/// let ControlFlow::Continue(mut session) = Session::new(&world, &job, Preparation::default(), &())? else {
///     return Ok(()); // The observer cancelled.
/// };
/// // The first two samples of all pixels, then the next two.
/// session.pass(2, session.tiles(), &())?;
/// session.pass(4, session.tiles(), &())?;
/// assert_eq!(session.samples().unwrap().counts()[0], 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session<'w> {
    /// The job with all its layers.
    job: PlacedJob<'w>,
    /// The job with the layers that the integrator makes.
    made: PlacedJob<'w>,
    prepared: Box<dyn PreparedIntegrator + 'w>,
    film: FilmState,
    picture: Mutex<PictureState>,
    /// The pass in work, or one that a checkpoint began.
    pass: Option<Pass>,
}

/// The state of the film besides its picture.
enum FilmState {
    /// The picture holds weighted means: each tile is made at once.
    Weighted {
        /// Whether each tile is made.
        is_done: Vec<AtomicBool>,
    },
    /// Blocks of samples, which grow.
    Blocks {
        tiles: Vec<Mutex<SampleTile>>,
        /// The samples of the tiles in work, as they were before.
        before: Mutex<HashMap<usize, SampleBlocks>>,
    },
}

/// The picture so far, which all threads write.
struct PictureState {
    picture: Picture,
    counts: Counts,
    noise: Option<NoiseEstimate>,
    /// The number of finished pixels, and of all pixels of this run; for blocks, of samples.
    done: u64,
    planned: u64,
}

impl<'w> Session<'w> {
    /// Prepares a job. Breaks if the observer cancels.
    ///
    /// # Errors
    /// [`JobError`] if [`Job::check`] finds an error, if the solution is one of another world, or if required threads
    /// can't be started.
    pub fn new(
        world: &'w World,
        job: &Job,
        preparation: Preparation<'_>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Session<'w>>, JobError> {
        job.check()?;
        preparation.solution.map_or(Ok(()), |solution| solution.check(world, job))?;
        let job = PlacedJob::new(world, job);
        let made = job.with(|job| {
            job.aovs.retain(|aov| !aov.is_of_denoising());
            if job.film.alpha && !job.is_progressive() {
                job.aovs.push(Aov::Alpha);
            }
        });
        let prepare = || preparable(&made.integrator).prepare(&made, preparation, observer);
        let prepared = with_stack(stack_of(world, &made), prepare)??;
        Ok(prepared.map_continue(|prepared| Session::of(job, made, prepared)))
    }

    /// Prepares a job without an observer, for [`Session::pass`] and explanations.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn open(world: &'w World, job: &Job, preparation: Preparation<'_>) -> Result<Session<'w>, JobError> {
        match Session::new(world, job, preparation, &())? {
            ControlFlow::Continue(session) => Ok(session),
            ControlFlow::Break(()) => unreachable!("the empty observer cancels nothing"),
        }
    }

    fn of(job: PlacedJob<'w>, made: PlacedJob<'w>, prepared: Box<dyn PreparedIntegrator + 'w>) -> Session<'w> {
        let tiles = made.tiles();
        let film = if made.is_progressive() {
            let tile = |number| Mutex::new(SampleTile::new(&made, tiles.area(number)));
            FilmState::Blocks { tiles: (0..tiles.count()).map(tile).collect(), before: Mutex::default() }
        } else {
            FilmState::Weighted { is_done: (0..tiles.count()).map(|_| AtomicBool::new(false)).collect() }
        };
        let [_, _, width, height] = made.window();
        let samples = if made.is_progressive() { made.own_sample_count().into() } else { 1 };
        let picture = PictureState {
            picture: Rendering::unfinished(made.world(), &made).picture,
            counts: prepared.preparation_counts(),
            noise: made.noise.map(|limit| NoiseEstimate::new([width, height], limit)),
            done: 0,
            planned: u64::from(width) * u64::from(height) * samples,
        };
        Session { job, made, prepared, film, picture: Mutex::new(picture), pass: None }
    }

    /// The job, with its camera relative to the world's origin.
    pub fn job(&self) -> &PlacedJob<'w> {
        &self.job
    }

    /// The numbers of all tiles.
    pub fn tiles(&self) -> Range<usize> {
        0..self.made.tiles().count()
    }

    /// The solution of radiosity that the picture shows, and how light goes from patch to patch if that is kept.
    pub(crate) fn radiosity(&self) -> Option<(&PreparedRadiosity, Option<&Transport<'_>>)> {
        self.prepared.radiosity()
    }

    /// The integrator's state for one thread, for a probe that watches pixels.
    pub(crate) fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn IntegratorWorker + 'a> {
        self.prepared.worker(cancelled)
    }

    /// Makes some tiles. In a progressive picture the pixels that need more samples get them up to number `end`, which
    /// isn't included. Other pictures get all their samples at once, and `end` means nothing. [`Session::render`] alone
    /// judges the noise between passes.
    ///
    /// Breaks if the observer cancelled. A progressive picture keeps the whole blocks of samples that were made; of
    /// another one the finished tiles stay.
    ///
    /// # Panics
    /// If the observer panics in one thread. The other threads then end soon, and the panic is passed on to the caller.
    ///
    /// # Errors
    /// [`JobError::NoThreads`] if the rays need threads with more stack, and these can't be started.
    pub fn pass(
        &mut self,
        end: u32,
        tiles: Range<usize>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<()>, JobError> {
        let queue = TaskQueue::new(observer);
        Ok(with_stack(stack_of(self.made.world(), &self.made), || match &self.film {
            FilmState::Weighted { is_done } => self.weighted_pass(is_done, tiles, &queue, observer),
            FilmState::Blocks { tiles: all, before } => self.block_pass((all, before), end, tiles, &queue, observer),
        })?)
    }

    /// Makes tiles of weighted means.
    fn weighted_pass(
        &self,
        is_done: &[AtomicBool],
        tiles: Range<usize>,
        queue: &TaskQueue,
        observer: &dyn Observer,
    ) -> ControlFlow<()> {
        let Session { made, prepared, picture, .. } = self;
        let ([left, top, ..], areas) = (made.window(), made.tiles());
        let cancelled = |_| queue.is_stopped();
        let rules = || made.aovs.iter().map(|aov| (aov.channels().len(), aov.accumulation()));
        let new_worker = || (prepared.worker(&cancelled), TileBuffer::new([0; 4], rules()));
        queue.run(tiles, new_worker, |(worker, buffer), number| {
            let area = areas.area(number);
            buffer.reset(area);
            worker.tile(buffer)?;
            let mut state = picture.lock().unwrap_or_else(PoisonError::into_inner);
            buffer.write(&mut state.picture, [left, top]);
            state.counts += worker.take_counts();
            state.done += buffer.len() as u64;
            let progress = Progress { pixels_done: state.done, pixels: state.planned, rays: state.counts.rays.total() };
            observer.tile_finished(&FinishedTile::of(&state.picture, [left, top], area));
            drop(state);
            is_done[number].store(true, Ordering::Relaxed);
            observer.progress(&progress);
            ControlFlow::Continue(())
        })
    }

    /// Adds samples to the pixels of tiles.
    fn block_pass(
        &self,
        (sample_tiles, before): (&[Mutex<SampleTile>], &Mutex<HashMap<usize, SampleBlocks>>),
        end: u32,
        tiles: Range<usize>,
        queue: &TaskQueue,
        observer: &dyn Observer,
    ) -> ControlFlow<()> {
        let Session { made, prepared, picture, .. } = self;
        let [left, top, width, _] = made.window();
        let needed =
            picture.lock().unwrap_or_else(PoisonError::into_inner).noise.as_ref().map(|noise| noise.needed().to_vec());
        let cancelled = |_| queue.is_stopped();
        queue.run(
            tiles,
            || prepared.worker(&cancelled),
            |worker, number| {
                let mut tile = sample_tiles[number].lock().unwrap_or_else(PoisonError::into_inner);
                before.lock().unwrap_or_else(PoisonError::into_inner).insert(number, tile.blocks.clone());
                let area = tile.area;
                let needs = |[x, y]: [u32; 2]| {
                    let cell = NoiseEstimate::cell_of([area[0] - left + x, area[1] - top + y], width);
                    needed.as_ref().is_none_or(|needed| needed[cell])
                };
                let added = tile.add(made, &mut **worker, end, needs);
                before.lock().unwrap_or_else(PoisonError::into_inner).remove(&number);
                let mut state = picture.lock().unwrap_or_else(PoisonError::into_inner);
                let PictureState { picture, counts, noise, done, planned } = &mut *state;
                // Whole blocks of an unfinished tile are kept.
                tile.write(made, picture, noise.as_mut());
                let (samples, own) = added?;
                *counts += own;
                *done += samples;
                let pixels = picture.pixels.len() as u64;
                let pixels_done = (u128::from(pixels) * u128::from(*done) / u128::from((*planned).max(1))) as u64;
                let progress = Progress { pixels_done, pixels, rays: counts.rays.total() };
                observer.tile_finished(&FinishedTile::of(picture, [left, top], area));
                drop(state);
                drop(tile);
                observer.progress(&progress);
                if observer.wants_checkpoint()
                    && let Some(checkpoint) = self.checkpoint()
                {
                    observer.checkpoint(&checkpoint);
                }
                ControlFlow::Continue(())
            },
        )
    }

    /// The samples at this moment and the pass in which they are made.
    fn checkpoint(&self) -> Option<Checkpoint> {
        Some(Checkpoint { samples: self.samples()?, pass: self.pass.clone() })
    }

    /// Takes up a picture where a checkpoint left it.
    ///
    /// # Errors
    /// As [`Session::merge`].
    pub fn resume(&mut self, checkpoint: &Checkpoint) -> Result<(), JobError> {
        self.merge(&checkpoint.samples)?;
        self.pass = checkpoint.pass.clone();
        Ok(())
    }

    /// Adds samples that were made elsewhere: those with which the picture begins, or the next ones. The bytes are
    /// equal to those of one render of all of them.
    ///
    /// # Errors
    /// [`JobError`] if the picture isn't progressive, or if the samples don't fit it: another size, other numbers, or
    /// halves that aren't known and won't be.
    pub fn merge(&mut self, samples: &SampleBlocks) -> Result<(), JobError> {
        check_samples(&self.made, samples, self.fewest_samples() == 0)?;
        let FilmState::Blocks { tiles, .. } = &self.film else { return Ok(()) };
        let [left, top, ..] = self.made.window();
        let mut state = self.picture.lock().unwrap_or_else(PoisonError::into_inner);
        let PictureState { picture, noise, .. } = &mut *state;
        for tile in tiles {
            let mut tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
            let [x, y, width, height] = tile.area;
            let part = samples.part([x - left, y - top, width, height], tile.blocks.keeps_halves());
            if !tile.blocks.merge(&part, [0, 0]) {
                let problem =
                    format!("they begin with number {}, which isn't the next one everywhere", samples.first());
                return Err(JobError::Start(problem));
            }
            tile.write(&self.made, picture, noise.as_mut());
        }
        Ok(())
    }

    /// The picture so far, in linear light, with the layers that the integrator makes.
    pub fn picture(&mut self) -> &Picture {
        &self.picture.get_mut().unwrap_or_else(PoisonError::into_inner).picture
    }

    /// The samples so far of a progressive picture; none of another one. Tiles that threads work at are as they were
    /// before.
    pub fn samples(&self) -> Option<SampleBlocks> {
        let FilmState::Blocks { tiles, before } = &self.film else { return None };
        let ([left, top, width, height], areas) = (self.made.window(), self.made.tiles());
        let mut all: Option<SampleBlocks> = None;
        for (number, tile) in tiles.iter().enumerate() {
            let [x, y, ..] = areas.area(number);
            let mut add = |blocks: &SampleBlocks| {
                let new = || SampleBlocks::new([width, height], self.made.first_sample, blocks.keeps_halves());
                all.get_or_insert_with(new).insert(blocks, [x - left, y - top]);
            };
            loop {
                match tile.try_lock() {
                    Ok(tile) => break add(&tile.blocks),
                    Err(TryLockError::Poisoned(tile)) => break add(&tile.into_inner().blocks),
                    Err(TryLockError::WouldBlock) => {}
                }
                if let Some(blocks) = before.lock().unwrap_or_else(PoisonError::into_inner).get(&number) {
                    break add(blocks);
                }
                // The tile is about to be begun, or is done.
                std::thread::yield_now();
            }
        }
        all
    }

    /// The number of samples that every pixel has.
    fn fewest_samples(&self) -> u32 {
        let FilmState::Blocks { tiles, .. } = &self.film else { return 0 };
        let fewest = |tile: &Mutex<SampleTile>| {
            let tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
            tile.blocks.counts().iter().min().copied()
        };
        tiles.iter().filter_map(fewest).min().unwrap_or(0)
    }

    /// Makes all that is missing, pass by pass, until all pixels have their samples or the observer ends them.
    ///
    /// # Panics
    /// As [`Session::pass`].
    ///
    /// # Errors
    /// As [`Session::pass`].
    pub fn render(self, observer: &dyn Observer) -> Result<Rendering, JobError> {
        with_stack(stack_of(self.made.world(), &self.made), || self.run(observer))?
    }

    fn run(mut self, observer: &dyn Observer) -> Result<Rendering, JobError> {
        let ended = match &self.film {
            FilmState::Weighted { .. } => self.pass(0, self.tiles(), observer)?,
            FilmState::Blocks { .. } => self.run_passes(observer)?,
        };
        Ok(self.finish(ended.is_continue(), observer))
    }

    /// Makes passes until all pixels have their samples, or little enough noise, or the observer ends them.
    fn run_passes(&mut self, observer: &dyn Observer) -> Result<ControlFlow<()>, JobError> {
        let from = self.fewest_samples();
        let end = self.made.own_sample_count().max(from);
        let state = self.state();
        state.planned = state.picture.pixels.len() as u64 * u64::from(end - from);
        let mut begun = self.begun_pass(end);
        let (mut count, mut needed) = match &begun {
            Some((pass, needed)) => (pass.begin, *needed),
            None => (from, self.judge(from, end)),
        };
        // A picture that has enough samples already may need layers.
        let mut needs_pass = needed > 0 || !layers_of_first_sample(&self.made).is_empty() || self.made.has_alpha();
        while needs_pass {
            let next = match begun.take() {
                Some((pass, _)) => pass.end,
                None if needed > 0 => next_count(count, end),
                None => count,
            };
            let cells = self.state().noise.as_ref().map_or_else(Vec::new, |noise| noise.needed().to_vec());
            self.pass = Some(Pass { begin: count, end: next, needed: cells });
            if self.pass(self.made.first_sample + next, self.tiles(), observer)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
            count = next;
            needed = self.judge(count, end);
            let state = self.picture.lock().unwrap_or_else(PoisonError::into_inner);
            let outlook = || self.outlook(state.noise.as_ref(), end);
            let progress = PassProgress {
                samples: count,
                next: (needed > 0).then(|| next_count(count, end)),
                pixels_left: needed,
                noise: state.noise.as_ref().map(NoiseEstimate::largest),
                picture: &state.picture,
                outlook: &outlook,
            };
            needs_pass = observer.pass_ended(&progress).is_continue() && needed > 0;
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The pass that a checkpoint began, and the number of pixels that need more samples. Without an estimate of the
    /// noise the passes begin with the pixels that have the fewest.
    fn begun_pass(&mut self, end: u32) -> Option<(Pass, u64)> {
        let pass = self.pass.take().filter(|pass| pass.begin < pass.end && pass.end <= end)?;
        let needed = self.state().noise.as_mut()?.resume(&pass.needed)?;
        Some((pass, needed))
    }

    fn state(&mut self) -> &mut PictureState {
        self.picture.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of pixels that need more than `count` samples, of at most `end`.
    fn judge(&mut self, count: u32, end: u32) -> u64 {
        let state = self.state();
        let pixels = state.picture.pixels.len() as u64;
        let needed = state.noise.as_mut().map_or(pixels, |noise| noise.judge(count));
        if count < end { needed } else { 0 }
    }

    /// What is left of the noise of pixels that get at most `end` samples.
    fn outlook(&self, noise: Option<&NoiseEstimate>, end: u32) -> NoiseOutlook {
        let [left, top, width, _] = self.made.window();
        let FilmState::Blocks { tiles, .. } = &self.film else { return NoiseOutlook::default() };
        let mut counts = vec![0; noise.map_or(0, NoiseEstimate::pixels)];
        let (mut statistics, mut squares, mut samples) = (SampleStatistics::default(), 0.0, 0.0);
        for tile in tiles {
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
            if self.made.clamp.is_none() { statistics.clamp_outlook(squares / f64::max(samples, 1.0)) } else { None };
        let noisiest = noise.and_then(|noise| noise.noisiest([left, top]));
        let left = noise.and_then(|noise| noise.samples_left(&counts, end));
        NoiseOutlook { noisiest, left, clamp }
    }

    /// Ends the session: what is known becomes a rendering. Layers for denoising are made if the picture is complete.
    fn finish(self, is_complete: bool, observer: &dyn Observer) -> Rendering {
        let end = self.made.own_sample_count();
        let (samples, mut statistics) = (self.samples(), None);
        if let (Some(samples), FilmState::Blocks { tiles, .. }) = (&samples, &self.film) {
            let mut all = SampleStatistics::default();
            for tile in tiles {
                all.add(&tile.lock().unwrap_or_else(PoisonError::into_inner).statistics);
            }
            all.count(samples.counts());
            let state = self.picture.lock().unwrap_or_else(PoisonError::into_inner);
            all.noise = state.noise.as_ref().map(NoiseEstimate::largest);
            all.outlook = Some(self.outlook(state.noise.as_ref(), end));
            statistics = Some(all);
        }
        let pixels_done = match (&self.film, &samples) {
            (FilmState::Weighted { is_done }, _) => {
                let done = self
                    .tiles()
                    .filter(|tile| is_done[*tile].load(Ordering::Relaxed))
                    .map(|tile| self.made.tiles().area(tile));
                done.map(|[_, _, width, height]| u64::from(width) * u64::from(height)).sum()
            }
            (_, Some(samples)) => samples.counts().iter().filter(|count| **count > 0).count() as u64,
            (..) => 0,
        };
        let pass = self.pass.filter(|_| !is_complete);
        let PictureState { mut picture, counts, .. } =
            self.picture.into_inner().unwrap_or_else(PoisonError::into_inner);
        if self.made.aovs.len() > self.job.aovs.iter().filter(|aov| !aov.is_of_denoising()).count() {
            picture.alpha = picture.layers.pop().map_or_else(Vec::new, |layer| layer.data);
        }
        let mut rendering =
            Rendering { picture, counts, pixels_done, complete: is_complete, samples, pass, statistics };
        if self.job.aovs.iter().any(|aov| aov.is_of_denoising()) {
            features::add_layers(&self.job, &mut rendering, observer);
        } else if let Some(background) = self.job.world().shadow_background() {
            rendering.picture.separate_shadow(background, is_complete);
        }
        rendering
    }
}

/// Checks that samples can be added to a picture that has none, or to one that has some.
pub(super) fn check_samples(job: &Job, samples: &SampleBlocks, is_empty: bool) -> Result<(), JobError> {
    let wrong = |problem: String| Err(JobError::Start(problem));
    let passes = if job.film.sampler == SamplerKind::BlueNoise { Err(BLUE_NOISE) } else { job.passes() };
    passes.map_err(|why| JobError::NotInPasses { what: "going on with samples", why })?;
    let ([_, _, width, height], [own_width, own_height]) = (job.window(), samples.size());
    if [width, height] != samples.size() {
        return wrong(format!("they are of {own_width} x {own_height} pixels, not of {width} x {height}"));
    }
    if is_empty && samples.first() != job.first_sample {
        return wrong(format!("they begin with number {}, not with {}", samples.first(), job.first_sample));
    }
    let count = job.sample_count();
    if count == 1 {
        return wrong("a single sample goes through the pixel's centre, where several don't".into());
    }
    let asks_for_halves = job.aovs.iter().any(|aov| aov.is_half());
    // A block becomes a half of a larger one where the number of samples has a digit more.
    let stays = |old: u32| old > 1 && (job.first_sample > 0 || old.max(count).ilog2() == old.ilog2());
    let has_old_blocks = samples.counts().iter().any(|old| stays(*old));
    if asks_for_halves && !samples.keeps_halves() && has_old_blocks {
        let most = samples.counts().iter().copied().max().unwrap_or(1);
        let least = 2 << most.ilog2();
        return wrong(format!("their halves aren't known; with {least} samples and more they will be"));
    }
    Ok(())
}

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
