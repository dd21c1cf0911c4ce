//! Rendering from a world and a job to a picture: tiles, pixels, cancellation and progress.

mod aov;
mod lattice;
mod pixel;

pub use aov::Aov;
pub(crate) use pixel::{PixelRenderer, weighted_mean};

use crate::OutOfRange;
use crate::camera::Camera;
use crate::film::Picture;
use crate::integrator::{RayCounts, Whitted};
use crate::math::Rgb;
use crate::scene::{FilmSettings, Integrator, WhittedSettings};
use crate::world::World;
use aov::AovProbe;
use canaletto_bvh::{NoThreads, with_stack};
use glam::DVec3;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Everything that a picture depends on besides the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The camera.
    pub camera: Camera,
    /// The settings for sampling pixels. Tone and transfer affect only adaptive sampling: pictures stay linear.
    pub film: FilmSettings,
    /// The integrator that makes the picture.
    pub integrator: Integrator,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The number of the frame. Each frame has random numbers of its own.
    pub frame: u32,
    /// The side of a tile in pixels, at least 1. No picture depends on it.
    pub tile: u32,
    /// The requested extra layers.
    pub aovs: Vec<Aov>,
}

/// An error in a job.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The crop window is empty or reaches beyond the picture.
    #[error(
        "the crop window {width} x {height} at {x}, {y} doesn't lie inside the picture of {of_width} x {of_height} pixels"
    )]
    Crop {
        /// Left edge in pixels, from the left.
        x: u32,
        /// Upper edge in pixels, from the top.
        y: u32,
        /// Width of the window in pixels.
        width: u32,
        /// Height of the window in pixels.
        height: u32,
        /// The picture's width in pixels.
        of_width: u32,
        /// The picture's height in pixels.
        of_height: u32,
    },
    /// A grid of samples is out of range.
    #[error("n is {0}, so {0} x {0} rays for a pixel; n must be between 1 and 16 (with adaptive sampling from 2 on)")]
    Grid(u32),
    /// The number of samples is out of range.
    #[error("samples is {0}; a pixel takes between 1 and {max} rays", max = crate::scene::Sampling::MAX_SAMPLES)]
    Samples(u32),
    /// The depth of the ray tree is out of range.
    #[error("max-depth is {0}; it must be between 1 (only the eye's rays) and {max}", max = WhittedSettings::MAX_DEPTH)]
    Depth(u32),
    /// A filter or threshold is out of range.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// The rays need threads with more stack than the caller's thread, and these can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

impl Job {
    /// A job with the default tile size, seed 0 and no extra layers.
    pub fn new(camera: Camera, film: FilmSettings, integrator: impl Into<Integrator>) -> Job {
        Job { camera, film, integrator: integrator.into(), seed: 0, frame: 0, tile: 32, aovs: Vec::new() }
    }

    /// Checks the values that come from files and users.
    ///
    /// # Errors
    /// [`JobError`] with the value and its range.
    pub fn check(&self) -> Result<(), JobError> {
        use crate::scene::{Filter, Sampling};
        let [of_width, of_height] = self.camera.size();
        if let Some([x, y, width, height]) = self.film.crop {
            let inside =
                |start: u32, length: u32, of: u32| length > 0 && start.checked_add(length).is_some_and(|end| end <= of);
            if !inside(x, width, of_width) || !inside(y, height, of_height) {
                return Err(JobError::Crop { x, y, width, height, of_width, of_height });
            }
        }
        if !(1..=WhittedSettings::MAX_DEPTH).contains(&self.integrator.max_depth()) {
            return Err(JobError::Depth(self.integrator.max_depth()));
        }
        match self.film.sampling {
            Sampling::Regular(n) | Sampling::Jittered(n) if !(1..=Sampling::MAX_GRID).contains(&n) => {
                return Err(JobError::Grid(n));
            }
            Sampling::Adaptive { n, .. } if !(2..=Sampling::MAX_GRID).contains(&n) => return Err(JobError::Grid(n)),
            Sampling::Sampled(n) if !(1..=Sampling::MAX_SAMPLES).contains(&n) => return Err(JobError::Samples(n)),
            Sampling::Adaptive { threshold, .. } if !(0.0..=1.0).contains(&threshold) => {
                return Err(OutOfRange::new("threshold", format!("is {threshold}; it must be between 0 and 1")).into());
            }
            _ => {}
        }
        match self.film.filter {
            Filter::Gaussian { sigma } if !(sigma > 0.0 && sigma <= 4.0) => {
                let problem = format!("is {sigma}; it must be more than 0 and at most 4 pixels");
                Err(OutOfRange::new("sigma", problem).into())
            }
            _ => Ok(()),
        }
    }

    /// This job with its camera relative to the world's origin, if that isn't zero.
    pub(crate) fn relative_to(&self, world: &World) -> Option<Job> {
        let origin = world.origin();
        (origin != DVec3::ZERO).then(|| Job { camera: self.camera.relative_to(origin), ..self.clone() })
    }

    /// The area to render: x and y (from the top left), width and height, in pixels.
    pub fn window(&self) -> [u32; 4] {
        let [w, h] = self.camera.size();
        self.film.crop.unwrap_or([0, 0, w, h])
    }
}

/// An observer of a render, which may cancel it. Its methods are called from many threads.
pub trait Observer: Sync {
    /// Whether to cancel. Called before every few pixels, and at intervals within them. Once it returns true,
    /// unfinished tiles are dropped and the picture so far is returned.
    fn cancelled(&self) -> bool {
        false
    }
    /// Reports the progress after each tile.
    fn progress(&self, _progress: &Progress) {}
}

/// The empty observer, which never cancels.
impl Observer for () {}

/// The progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The number of finished pixels.
    pub pixels_done: u64,
    /// The number of all pixels.
    pub pixels: u64,
    /// The number of rays traced so far.
    pub rays: u64,
}

/// The result of a render.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendering {
    /// The picture, in linear light. Pixels of unfinished tiles are black.
    pub picture: Picture,
    /// The numbers of rays by kind, in finished tiles.
    pub counts: RayCounts,
    /// The number of finished pixels.
    pub pixels_done: u64,
    /// Whether every tile was finished.
    pub complete: bool,
}

/// Renders a picture on the threads of the current rayon pool. If their stacks are too small, it starts as many threads
/// with larger stacks. The result depends only on world and job: any number of threads and any tile size give equal
/// bytes.
///
/// # Panics
/// If the observer panics in one thread. The other threads then end soon, and the panic is passed on to the caller.
///
/// # Errors
/// [`JobError`] if [`Job::check`] finds an error, or if required threads can't be started. Nothing after that can fail.
pub fn render(world: &World, job: &Job, observer: &dyn Observer) -> Result<Rendering, JobError> {
    job.check()?;
    let counted = job.relative_to(world);
    let job = counted.as_ref().unwrap_or(job);
    Ok(with_stack(stack_of(world, job), || on_all_threads(world, job, observer))?)
}

/// The largest stack in bytes that the rays of a job need. It is the sum for the ray itself, for each of its parents,
/// and for each group around the primitive that it hits. Even a debug build uses only about half of it.
pub(crate) fn stack_of(world: &World, job: &Job) -> usize {
    const RAY: usize = 256 << 10;
    const PARENT: usize = 16 << 10;
    const GROUP: usize = 16 << 10;
    RAY + PARENT * job.integrator.max_depth() as usize + GROUP * world.most_groups()
}

fn on_all_threads(world: &World, job: &Job, observer: &dyn Observer) -> Rendering {
    let [left, top, width, height] = job.window();
    let tile = job.tile.max(1);
    let tiles_across = width.div_ceil(tile) as usize;
    let tile_count = tiles_across * height.div_ceil(tile) as usize;
    let mut picture = Picture::new(width, height);
    picture.layers = job.aovs.iter().map(|aov| aov.layer(world, width, height)).collect();
    let shared = Mutex::new(Rendering { picture, counts: RayCounts::default(), pixels_done: 0, complete: false });
    let next = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    // When one thread has stopped, the others don't finish their tiles.
    let cancelled = || stopped.load(Ordering::Relaxed) || observer.cancelled();
    let gives_up = |_| cancelled();
    rayon::broadcast(|_| {
        let ended = StopOnDrop(&stopped);
        let mut worker = Worker::new(world, job, &gives_up);
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= tile_count || stopped.load(Ordering::Relaxed) {
                break;
            }
            let x0 = left + (index % tiles_across) as u32 * tile;
            let y0 = top + (index / tiles_across) as u32 * tile;
            let area = [x0, y0, tile.min(left + width - x0), tile.min(top + height - y0)];
            let Some(finished) = worker.tile(area, &cancelled) else {
                stopped.store(true, Ordering::Relaxed);
                break;
            };
            let Ok(mut shared) = shared.lock() else { break };
            let progress = finished.blit(&mut shared, [x0 - left, y0 - top]);
            drop(shared);
            observer.progress(&progress);
        }
        std::mem::forget(ended);
    });
    let mut rendering = shared.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    rendering.complete = rendering.pixels_done == u64::from(width) * u64::from(height);
    rendering
}

/// Ends the work of all threads when it is dropped, as by a panic in one of them.
struct StopOnDrop<'a>(&'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The state of one thread.
struct Worker<'a> {
    pixels: PixelRenderer<'a>,
    whitted: Whitted<'a>,
    camera: &'a Camera,
    aovs: &'a [Aov],
    /// The size of the last tile, and its places [in squares](in_squares).
    size: [u32; 2],
    places: Vec<[u32; 2]>,
    /// Pixels that are traced together, and their colours.
    together: Vec<[u32; 2]>,
    colors: Vec<Rgb>,
}

/// A finished tile.
struct Tile {
    part: Picture,
    counts: RayCounts,
}

impl<'a> Worker<'a> {
    fn new(world: &'a World, job: &'a Job, cancelled: &'a (dyn Fn(u64) -> bool + Sync)) -> Worker<'a> {
        let Integrator::Whitted(settings) = job.integrator;
        let whitted = Whitted::new(world, settings).with_cancel(cancelled);
        Worker {
            pixels: PixelRenderer::new(job),
            whitted,
            camera: &job.camera,
            aovs: &job.aovs,
            size: [0; 2],
            places: Vec::new(),
            together: Vec::new(),
            colors: Vec::new(),
        }
    }

    /// Renders the pixels of an area (x, y, width, height). Returns `None` if cancelled.
    fn tile(&mut self, [x0, y0, width, height]: [u32; 4], cancelled: &dyn Fn() -> bool) -> Option<Tile> {
        let mut part = Picture::new(width, height);
        part.layers = self.aovs.iter().map(|aov| aov.layer(self.whitted.world(), width, height)).collect();
        self.whitted.counts = RayCounts::default();
        self.pixels.sample_sites(&mut self.whitted, [x0, y0, width, height]);
        if self.whitted.is_cancelled() {
            return None;
        }
        if self.aovs.is_empty() {
            if self.size != [width, height] {
                (self.size, self.places) = ([width, height], in_squares([width, height]));
            }
            for places in self.places.chunks(self.pixels.together()) {
                if cancelled() {
                    return None;
                }
                self.together.clear();
                self.together.extend(places.iter().map(|[x, y]| [x0 + x, y0 + y]));
                self.pixels.pixels(&mut self.whitted, &self.together, &mut self.colors);
                if self.whitted.is_cancelled() {
                    return None;
                }
                for ([x, y], color) in places.iter().zip(&self.colors) {
                    part.pixels[(y * width + x) as usize] = *color;
                }
            }
            return Some(Tile { part, counts: self.whitted.counts });
        }
        for (index, pixel) in part.pixels.iter_mut().enumerate() {
            if cancelled() {
                return None;
            }
            let (x, y) = (x0 + index as u32 % width, y0 + index as u32 / width);
            let mut probe = AovProbe::new(self.whitted.world(), self.camera);
            let (color, rays) = self.pixels.pixel(&mut self.whitted, x, y, &mut probe);
            *pixel = color;
            probe.finish(rays);
            for (aov, layer) in self.aovs.iter().zip(&mut part.layers) {
                let n = layer.channels.len();
                probe.write(*aov, &mut layer.data[index * n..(index + 1) * n]);
                if let (Some(to), Some(id)) = (layer.ids.get_mut(index), probe.id(*aov)) {
                    *to = id;
                }
            }
            if self.whitted.is_cancelled() {
                return None;
            }
        }
        Some(Tile { part, counts: self.whitted.counts })
    }
}

/// The places of an area along a Z-shaped curve (Morton order). Neighbours in the list are close to each other in both
/// directions. Each run of 4ⁿ places that begins at a multiple of 4ⁿ fills a square, unless the area ends within it.
fn in_squares([width, height]: [u32; 2]) -> Vec<[u32; 2]> {
    fn square(places: &mut Vec<[u32; 2]>, [x, y]: [u32; 2], side: u32, area: [u32; 2]) {
        if x >= area[0] || y >= area[1] {
            return;
        }
        let Some(half) = (side > 1).then_some(side / 2) else { return places.push([x, y]) };
        for corner in [[x, y], [x + half, y], [x, y + half], [x + half, y + half]] {
            square(places, corner, half, area);
        }
    }
    let mut places = Vec::with_capacity((width * height) as usize);
    square(&mut places, [0, 0], width.max(height).next_power_of_two(), [width, height]);
    places
}

impl Tile {
    /// Copies the tile to its place, relative to the upper left corner of the rendering.
    fn blit(&self, into: &mut Rendering, [x0, y0]: [u32; 2]) -> Progress {
        let (width, stride) = (self.part.width as usize, into.picture.width as usize);
        fn copy<T: Copy>(from: &[T], to: &mut [T], width: usize, stride: usize, start: usize) {
            for (line, to) in from.chunks_exact(width).zip(to[start..].chunks_mut(stride)) {
                to[..width].copy_from_slice(line);
            }
        }
        let start = y0 as usize * stride + x0 as usize;
        copy(&self.part.pixels, &mut into.picture.pixels, width, stride, start);
        for (from, to) in self.part.layers.iter().zip(&mut into.picture.layers) {
            let n = from.channels.len();
            copy(&from.data, &mut to.data, width * n, stride * n, start * n);
            if !from.ids.is_empty() {
                copy(&from.ids, &mut to.ids, width, stride, start);
            }
        }
        into.counts += self.counts;
        into.pixels_done += self.part.pixels.len() as u64;
        let pixels = into.picture.pixels.len() as u64;
        Progress { pixels_done: into.pixels_done, pixels, rays: into.counts.total() }
    }
}
