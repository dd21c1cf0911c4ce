//! Rendering from a world and a job to a picture: tiles, passes, cancellation and progress.

mod aov_probe;
mod camera_tiles;
mod features;
mod guiding;
mod lattice;
mod noise;
mod pixel;
mod preparation_memory;
mod progressive;
#[cfg(test)]
mod tests;

pub use crate::job::{Aov, Job, JobError, Observer, PassProgress, Progress, SolvingPhase, SolvingProgress};
pub(crate) use guiding::prepare_path;
pub(crate) use pixel::PixelRenderer;
pub use preparation_memory::{PreparationMemory, while_prepared};

use crate::film::{Picture, SampleBlocks, SampleStatistics, TileBuffer};
use crate::integrator::radiosity::RadiositySolution;
use crate::integrator::{Counts, PreparedRadiosity, TileIntegrator, Zbuffer};
use crate::scene::Integrator;
use crate::world::World;
use camera_tiles::CameraTiles;
use canaletto_bvh::with_stack;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The result of a render.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendering {
    /// The picture, in linear light. Pixels of unfinished tiles are black, or have fewer samples.
    pub picture: Picture,
    /// What the integrator counted, in finished tiles.
    pub counts: Counts,
    /// The number of pixels in finished tiles.
    pub pixels_done: u64,
    /// Whether every tile was finished, in every pass, and every layer.
    pub complete: bool,
    /// The samples of a picture that was made in passes ([`Job::passes`]), with which [`render_on`] goes on.
    pub samples: Option<SampleBlocks>,
    /// What is known of these samples.
    pub statistics: Option<SampleStatistics>,
}

/// Renders a picture on the threads of the current rayon pool. If their stacks are too small, it starts as many threads
/// with larger stacks. The result depends only on world and job: any number of threads and any tile size give equal
/// bytes.
///
/// ```
/// use canaletto::render::{Job, render};
/// use canaletto::world::World;
/// # use canaletto::camera::Camera;
/// # use canaletto::glam::{DVec3, Vec3};
/// # use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, Node, Scene, WhittedSettings};
/// # use canaletto::shape::{Shape, Sphere};
/// # let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
/// # let scene = Scene { nodes: vec![Node::from(ball)], ..Scene::default() };
/// # let intrinsics = Intrinsics { width: 32, height: 18, ..Intrinsics::default() };
/// # let extrinsics = Extrinsics { eye: DVec3::Z * 5.0, center: DVec3::ZERO, ..Extrinsics::default() };
/// # let camera = Camera::new(&intrinsics, &extrinsics)?;
/// let job = Job::new(camera, FilmSettings::default(), WhittedSettings::default());
/// let rendering = render(&World::build(scene)?, &job, &())?;
/// assert!(rendering.complete);
/// assert_eq!(rendering.picture.pixels.len(), 32 * 18);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// If the observer panics in one thread. The other threads then end soon, and the panic is passed on to the caller.
///
/// # Errors
/// [`JobError`] if [`Job::check`] finds an error, or if required threads can't be started. Nothing after that can fail.
pub fn render(world: &World, job: &Job, observer: &dyn Observer) -> Result<Rendering, JobError> {
    render_given(world, job, None, None, observer)
}

/// Renders a picture of a radiosity solution that is already found, as [`render`] does. With the solution of this world
/// and of the job's settings, the bytes are equal to those of `render`. Each picture may show another part of it.
///
/// # Panics
/// As [`render`].
///
/// # Errors
/// [`JobError`] as from a render, if the job's integrator isn't radiosity, or if the solution is one of another world.
pub fn render_with_solution(
    world: &World,
    job: &Job,
    solution: &Arc<RadiositySolution>,
    observer: &dyn Observer,
) -> Result<Rendering, JobError> {
    solution.check(world, job)?;
    render_given(world, job, Some(solution), None, observer)
}

/// Goes on with the samples of a picture, up to the number that the job's film says. If they are the job's own, the
/// bytes are equal to those of [`render`]. A picture of 64 samples can so be made of one of 32. A job of a single
/// sample has another one than all others, so its picture isn't the start of any.
///
/// # Panics
/// As [`render`].
///
/// # Errors
/// [`JobError`] as from a render, and [`JobError::Start`] if the samples don't fit the job: another size, other
/// numbers, or halves that aren't known and won't be.
pub fn render_on(
    world: &World,
    job: &Job,
    start: &SampleBlocks,
    observer: &dyn Observer,
) -> Result<Rendering, JobError> {
    job.check()?;
    progressive::check_start(job, start)?;
    render_given(world, job, None, Some(start), observer)
}

/// Renders a picture. If its solution of radiosity is given, it isn't solved. If it has samples, they are gone on with.
fn render_given(
    world: &World,
    job: &Job,
    solution: Option<&Arc<RadiositySolution>>,
    start: Option<&SampleBlocks>,
    observer: &dyn Observer,
) -> Result<Rendering, JobError> {
    job.check()?;
    let counted = job.relative_to(world);
    let job = counted.as_ref().unwrap_or(job);
    let made = features::without_features(job);
    let finished = |mut rendering: Rendering| {
        if made.is_some() {
            features::add_layers(world, job, &mut rendering, observer);
        }
        rendering
    };
    let inner = made.as_ref().unwrap_or(job);
    with_stack(stack_of(world, job), || {
        let job = inner;
        if let (Integrator::Path(settings), Ok(())) = (job.integrator, job.passes()) {
            return Ok(finished(match prepare_path(world, job, settings, observer) {
                ControlFlow::Continue(integrator) => progressive::render(world, job, &integrator, start, observer),
                ControlFlow::Break(()) => Rendering::unfinished(world, job),
            }));
        }
        let with_alpha = job.film.alpha.then(|| Job { aovs: [&job.aovs[..], &[Aov::Alpha]].concat(), ..job.clone() });
        let layered = with_alpha.as_ref().unwrap_or(job);
        let mut rendering = match prepare(world, layered, solution, observer)? {
            ControlFlow::Continue(integrator) => on_all_threads(world, layered, &*integrator, observer),
            ControlFlow::Break(()) => return Ok(finished(Rendering::unfinished(world, job))),
        };
        if with_alpha.is_some() {
            rendering.picture.alpha = rendering.picture.layers.pop().map_or_else(Vec::new, |layer| layer.data);
        }
        Ok(finished(rendering))
    })?
}

/// The largest stack in bytes that the rays of a job need. It is the sum for the ray itself, for each of its parents,
/// and for each group around the primitive that it hits. Even a debug build uses only about half of it.
pub(crate) fn stack_of(world: &World, job: &Job) -> usize {
    const RAY: usize = 256 << 10;
    const PARENT: usize = 16 << 10;
    const GROUP: usize = 16 << 10;
    RAY + PARENT * job.integrator.max_depth() as usize + GROUP * world.most_groups()
}

/// Prepares the job's integrator: the one place that knows which integrators there are. Breaks if cancelled.
fn prepare<'w>(
    world: &'w World,
    job: &'w Job,
    solution: Option<&Arc<RadiositySolution>>,
    observer: &dyn Observer,
) -> Result<ControlFlow<(), Box<dyn TileIntegrator + 'w>>, JobError> {
    Ok(match job.integrator {
        Integrator::Whitted(integrator) => {
            ControlFlow::Continue(Box::new(CameraTiles { world, job, integrator }) as Box<dyn TileIntegrator>)
        }
        Integrator::Radiosity(settings) => PreparedRadiosity::new(world, settings, solution.cloned(), observer)?
            .map_continue(|integrator| Box::new(CameraTiles { world, job, integrator }) as Box<dyn TileIntegrator>),
        Integrator::Path(settings) => prepare_path(world, job, settings, observer)
            .map_continue(|integrator| Box::new(CameraTiles { world, job, integrator }) as Box<dyn TileIntegrator>),
        Integrator::Zbuffer(settings) => Zbuffer::prepare(world, job, settings, observer)?
            .map_continue(|zbuffer| Box::new(zbuffer) as Box<dyn TileIntegrator>),
    })
}

/// Checks whether a job can be rendered, as far as that is known without rendering it.
///
/// # Errors
/// The [`JobError`] with which [`render`] would refuse it.
pub fn check(world: &World, job: &Job) -> Result<(), JobError> {
    job.check()?;
    match &job.integrator {
        Integrator::Whitted(_) | Integrator::Path(_) => Ok(()),
        Integrator::Radiosity(settings) => Ok(RadiositySolution::check_world(world, settings)?),
        Integrator::Zbuffer(settings) => Zbuffer::check(world, settings),
    }
}

impl Rendering {
    /// A render that was cancelled before its first tile.
    pub fn unfinished(world: &World, job: &Job) -> Rendering {
        let [_, _, width, height] = job.window();
        let mut picture = Picture::new(width, height);
        picture.alpha = if job.film.alpha { vec![0.0; picture.pixels.len()] } else { Vec::new() };
        picture.layers = job.aovs.iter().map(|aov| aov.layer(world, width, height)).collect();
        Rendering {
            picture,
            counts: Counts::default(),
            pixels_done: 0,
            complete: false,
            samples: None,
            statistics: None,
        }
    }
}

/// Makes all passes over all tiles.
fn on_all_threads(world: &World, job: &Job, integrator: &dyn TileIntegrator, observer: &dyn Observer) -> Rendering {
    let [left, top, width, height] = job.window();
    let side = job.tile.max(1);
    let tiles_across = width.div_ceil(side) as usize;
    let tile_count = tiles_across * height.div_ceil(side) as usize;
    let passes = integrator.passes().max(1);
    let rendering = Rendering { counts: integrator.preparation_counts(), ..Rendering::unfinished(world, job) };
    let shared =
        Mutex::new(Shared { rendering, pixels: u64::from(width) * u64::from(height) * u64::from(passes), done: 0 });
    let new_buffer =
        |area| TileBuffer::new(area, job.aovs.iter().map(|aov| (aov.channels().len(), aov.accumulation())));
    // Sums live on between passes only.
    let kept: Vec<Mutex<Option<TileBuffer>>> =
        if passes > 1 { (0..tile_count).map(|_| Mutex::default()).collect() } else { Vec::new() };
    let stopped = AtomicBool::new(false);
    // When one thread has stopped, the others don't finish their tiles.
    let cancelled = |_| stopped.load(Ordering::Relaxed) || observer.cancelled();
    // A pass ends before the next begins, so that sums have one order.
    for _ in 0..passes {
        let next = AtomicUsize::new(0);
        rayon::broadcast(|_| {
            let ended = StopOnDrop(&stopped);
            let mut worker = integrator.worker(&cancelled);
            let mut own = new_buffer([0; 4]);
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= tile_count || stopped.load(Ordering::Relaxed) {
                    break;
                }
                let x = left + (index % tiles_across) as u32 * side;
                let y = top + (index / tiles_across) as u32 * side;
                let area = [x, y, side.min(left + width - x), side.min(top + height - y)];
                let mut kept = kept.get(index).map(|kept| kept.lock().unwrap_or_else(PoisonError::into_inner));
                let buffer = match &mut kept {
                    Some(kept) => kept.get_or_insert_with(|| new_buffer(area)),
                    None => {
                        own.reset(area);
                        &mut own
                    }
                };
                let ControlFlow::Continue(()) = worker.tile(buffer) else {
                    stopped.store(true, Ordering::Relaxed);
                    break;
                };
                let Ok(mut shared) = shared.lock() else { break };
                let progress = shared.finish(buffer, worker.take_counts(), [left, top]);
                drop(shared);
                buffer.end_pass();
                observer.progress(&progress);
            }
            std::mem::forget(ended);
        });
        if stopped.load(Ordering::Relaxed) {
            break;
        }
    }
    let shared = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    Rendering { complete: shared.done == shared.pixels, ..shared.rendering }
}

/// The picture so far.
struct Shared {
    rendering: Rendering,
    /// The number of pixels in all passes, and of those that are finished.
    pixels: u64,
    done: u64,
}

impl Shared {
    /// Writes a tile after a pass into the picture, whose upper left corner is pixel `corner`.
    fn finish(&mut self, tile: &TileBuffer, counts: Counts, corner: [u32; 2]) -> Progress {
        let Rendering { picture, counts: all, pixels_done, .. } = &mut self.rendering;
        tile.write(picture, corner);
        *all += counts;
        self.done += tile.len() as u64;
        if tile.pass() == 0 {
            *pixels_done += tile.len() as u64;
        }
        Progress { pixels_done: self.done, pixels: self.pixels, rays: all.rays.total() }
    }
}

/// Ends the work of all threads when it is dropped, as by a panic in one of them.
struct StopOnDrop<'a>(&'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
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
