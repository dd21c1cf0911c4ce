//! Rendering from a world and a job to a picture: sessions, passes, cancellation and progress.

mod features;
mod noise;
mod sample_tile;
mod session;

use crate::film::{Checkpoint, Pass, Picture, SampleBlocks, SampleStatistics};
use crate::integrator::radiosity::RadiositySolution;
use crate::integrator::{Counts, GuidingField, learn_field, preparable};
pub use crate::integrator::{Preparation, PreparationMemory};
pub use crate::job::{
    Aov, FinishedTile, Job, JobError, Observer, PassProgress, PlacedJob, Progress, SolvingPhase, SolvingProgress, Tiles,
};
use crate::scene::Integrator;
use crate::world::World;
use canaletto_bvh::with_stack;
pub use session::Session;
use session::check_samples;
use std::ops::ControlFlow;
use std::sync::Arc;

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
    /// The pass in which an unfinished one of these pictures ended.
    pub pass: Option<Pass>,
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
    render_from(world, job, Preparation::default(), None, observer)
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
    let preparation = Preparation { solution: Some(solution), ..Preparation::default() };
    render_from(world, job, preparation, None, observer)
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
    render_from(world, job, Preparation::default(), Some(&start.clone().into()), observer)
}

/// Learns where light comes from, as a render by guided paths does before its first sample. A render from it
/// ([`Preparation::guiding`]) has the bytes of one that learns it. It serves all parts of a picture: their samples and
/// crop windows don't count. The field of other integrators guides nowhere. Breaks if the observer cancels.
///
/// # Errors
/// [`JobError`] as from a render.
pub fn learn_guiding(
    world: &World,
    job: &Job,
    observer: &dyn Observer,
) -> Result<ControlFlow<(), GuidingField>, JobError> {
    job.check()?;
    let Integrator::Path(settings) = job.integrator else { return Ok(ControlFlow::Continue(GuidingField::default())) };
    let placed = PlacedJob::new(world, job);
    Ok(with_stack(stack_of(world, job), || learn_field(&placed, settings, observer))?)
}

/// Renders a picture from what is there already: a solution of radiosity, which isn't solved then, and samples, which
/// are gone on with. From a checkpoint of an equal job the bytes are equal to those of [`render`].
///
/// # Panics
/// As [`render`].
///
/// # Errors
/// [`JobError`] as from [`render_with_solution`] and [`render_on`].
pub fn render_from(
    world: &World,
    job: &Job,
    preparation: Preparation<'_>,
    start: Option<&Checkpoint>,
    observer: &dyn Observer,
) -> Result<Rendering, JobError> {
    // A depth beyond all bounds would ask for a stack beyond all memory.
    job.check()?;
    start.map_or(Ok(()), |start| check_samples(job, &start.samples, true))?;
    with_stack(stack_of(world, job), || {
        let ControlFlow::Continue(mut session) = Session::new(world, job, preparation, observer)? else {
            return Ok(Rendering::unfinished(world, job));
        };
        start.map_or(Ok(()), |start| session.resume(start))?;
        session.render(observer)
    })?
}

/// The largest stack in bytes that the rays of a job need. It is the sum for the ray itself, for each of its parents,
/// and for each group around the primitive that it hits. Even a debug build uses only about half of it.
pub(crate) fn stack_of(world: &World, job: &Job) -> usize {
    const RAY: usize = 256 << 10;
    const PARENT: usize = 16 << 10;
    const GROUP: usize = 16 << 10;
    RAY + PARENT * job.description().max_depth() as usize + GROUP * world.most_groups()
}

/// Checks whether a job can be rendered, as far as that is known without rendering it.
///
/// # Errors
/// The [`JobError`] with which [`render`] would refuse it.
pub fn check(world: &World, job: &Job) -> Result<(), JobError> {
    job.check()?;
    job.description().check_world(world)
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
            pass: None,
            statistics: None,
        }
    }
}

/// Calls `measure` with the memory that preparing this job takes. Triangles and shadow maps of a z-buffer are made for
/// it and held meanwhile, since that takes little time. The caller measures them.
///
/// # Errors
/// As [`check`].
pub fn while_prepared<T>(
    world: &World,
    job: &Job,
    measure: impl FnOnce(PreparationMemory) -> T,
) -> Result<T, JobError> {
    let (memory, _held) = preparable(&job.integrator).preparation_memory(&PlacedJob::new(world, job))?;
    Ok(measure(memory))
}
