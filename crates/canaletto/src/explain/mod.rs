//! The explanation of a pixel: the tree of rays behind it, with every term of (5.39b) as a number.
//!
//! A probe records the tree while the pixel is rendered by the code that renders pictures. [`PixelTree::sum`] adds up
//! the recorded terms and returns the pixel bit for bit.

mod developed;
mod difference;
mod drawing;
mod environment_text;
mod intersection;
mod light_text;
mod material_text;
mod number;
mod outside;
mod page;
mod patch;
mod patch_terms;
mod patch_text;
mod path;
mod raster_text;
mod ray_text;
mod ray_tree;
mod record;
mod round_shapes;
mod steps;
mod steps_text;
mod summing;
mod term;
mod text;
mod text_writer;
mod tree;
mod tree_svg;
mod tried_objects;
mod worker;

pub use developed::{DevelopedNode, DevelopedValues, ToneCurve};
pub use difference::{TermDifference, TreeDifference};
pub use intersection::{Intersection, TriedObject};
pub use outside::{OutsidePicture, OutsideView};
pub use page::PageStyle;
pub use patch::{
    CornerNode, LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, RadiosityTerms, SourceKind,
    SourceNode,
};
pub use path::{Arrival, ArrivalSurface, PathRay, PathSample, PathStep, PathTree, SampledNode};
pub use ray_tree::RayTree;
pub use steps::{CameraSteps, HitSteps, LightSteps, RaySteps, RefractionSteps};
pub use term::TermValue;
pub use text_writer::TextStyle;
pub use tree::{
    BlockerNode, CutNode, HitNode, ImageNode, LightNode, LobeNode, Outcome, PixelTree, RayNode, ReadingNode,
    SampleNode, Side, TextureNode,
};

use crate::Named;
pub use crate::integrator::{RasterNode, RasterRival, RasterTriangle, RivalFate, ShownLight};
use crate::math::DRay;
use crate::render::{Job, JobError, Preparation, Session, stack_of};
use crate::world::World;
use canaletto_bvh::with_stack;
use glam::DVec3;
pub(crate) use worker::ExplainWorker;

/// The reason why a pixel can't be explained.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExplainError {
    /// The pixel isn't in the picture.
    #[error("pixel {x}, {y} isn't in the picture of {width} x {height} pixels (columns and rows count from 0)")]
    Outside {
        /// Column of the pixel, from the left.
        x: u32,
        /// Row of the pixel, from the top.
        y: u32,
        /// The picture's width in pixels.
        width: u32,
        /// The picture's height in pixels.
        height: u32,
    },
    /// Mirrors and clear bodies multiply the pixel's rays beyond the limit.
    #[error("the pixel's tree has more than {MAX_RAYS} rays; a smaller max-depth makes it one that can be read")]
    TooManyRays,
    /// The ray has no direction, or starts nowhere.
    #[error("the ray needs a finite origin and a direction that has a length")]
    Direction,
    /// The integrator traces no paths.
    #[error("the integrator traces no paths; \"path\" does")]
    NoPaths,
    /// A rasteriser traces no rays.
    #[error("a z-buffer traces no rays; the integrator \"whitted\" does")]
    NoRays,
    /// The observer cancelled the explanation.
    #[error("the explanation was cancelled")]
    Cancelled,
    /// The job has an error.
    #[error(transparent)]
    Job(#[from] JobError),
}

/// The approximate limit of rays of an explained pixel.
const MAX_RAYS: u64 = 1 << 20;

/// Explains the pixel in column `x` and row `y`, both from the top left of the whole picture (not of the crop window).
///
/// ```
/// use canaletto::explain::explain;
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
/// let world = World::build(scene)?;
/// let tree = explain(&world, &job, 16, 9)?;
/// // The sum of the tree is the pixel, bit for bit.
/// assert_eq!(tree.sum(), render(&world, &job, &())?.picture.pixel(16, 9));
/// println!("{tree}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ExplainError`] if the pixel is outside the picture, has too many rays, or the job has an error.
pub fn explain(world: &World, job: &Job, x: u32, y: u32) -> Result<PixelTree, ExplainError> {
    let preparation = Preparation { keeps_links: true, ..Preparation::default() };
    Explainer::new(&session_of_pixel(world, job, [x, y], preparation)?).pixel(x, y)
}

/// A session that prepares what one pixel of a job needs, for its explanation. Rays need any pixel.
///
/// # Errors
/// [`ExplainError`] if the pixel is outside the picture, or the job has an error.
pub fn session_of_pixel<'w>(
    world: &'w World,
    job: &Job,
    [x, y]: [u32; 2],
    preparation: Preparation<'_>,
) -> Result<Session<'w>, ExplainError> {
    job.check()?;
    let [width, height] = job.camera.size();
    check_place([0, 0, width, height], [x, y], job)?;
    let mut job = Job { tile: 1, aovs: Vec::new(), ..job.clone() };
    job.film.crop = Some([x, y, 1, 1]);
    Ok(Session::open(world, &job, preparation)?)
}

/// Checks that a pixel is in an area of the job's picture.
fn check_place([left, top, across, down]: [u32; 4], [x, y]: [u32; 2], job: &Job) -> Result<(), ExplainError> {
    if (left..left + across).contains(&x) && (top..top + down).contains(&y) {
        return Ok(());
    }
    let [width, height] = job.camera.size();
    Err(ExplainError::Outside { x, y, width, height })
}

/// Explains pixels and rays with what an open session has prepared.
#[derive(Clone, Copy)]
pub struct Explainer<'a> {
    session: &'a Session<'a>,
    has_steps: bool,
}

impl<'a> Explainer<'a> {
    /// Explanations of a session's pixels. What lights the patches of radiosity is told if the session keeps its links
    /// ([`Preparation::keeps_links`]).
    pub fn new(session: &'a Session<'a>) -> Explainer<'a> {
        Explainer { session, has_steps: false }
    }

    /// Returns the explainer such that trees have the numbers on the chapter's way: those of the camera, of
    /// intersections, of all objects that are tried, of reflection and refraction.
    pub fn with_steps(self, has_steps: bool) -> Explainer<'a> {
        Explainer { has_steps, ..self }
    }

    /// Explains a pixel by its rays.
    ///
    /// # Errors
    /// [`ExplainError`] if the pixel is outside the picture, or outside the window that a z-buffer draws, if it has too
    /// many rays, and for an integrator of paths.
    pub fn pixel(&self, x: u32, y: u32) -> Result<PixelTree, ExplainError> {
        let job = self.session.job();
        if job.description().traces_paths() {
            return Err(JobError::NoExplanation { integrator: job.integrator.name() }.into());
        }
        self.check_place([x, y])?;
        self.with_worker(|mut worker| worker.pixel([x, y]))
    }

    /// Explains the paths of a pixel of path tracing.
    ///
    /// # Errors
    /// As [`Explainer::pixel`], and [`ExplainError::NoPaths`] for another integrator.
    pub fn paths(&self, x: u32, y: u32) -> Result<PathTree, ExplainError> {
        self.check_place([x, y])?;
        if !self.session.job().description().traces_paths() {
            return Err(ExplainError::NoPaths);
        }
        self.with_worker(|mut worker| worker.paths([x, y]))
    }

    /// Explains a ray from `origin` in the scene's coordinates along `direction`, which may have any length but zero.
    /// The camera plays no part.
    ///
    /// # Errors
    /// [`ExplainError`] if the direction has no length, if the integrator traces no rays, and as
    /// [`Explainer::pixel`].
    pub fn ray(&self, origin: impl Into<DVec3>, direction: impl Into<DVec3>) -> Result<RayTree, ExplainError> {
        let (origin, direction): (DVec3, DVec3) = (origin.into(), direction.into());
        if !origin.is_finite() || direction.try_normalize().is_none() {
            return Err(ExplainError::Direction);
        }
        let line = DRay { origin: origin - self.session.job().world().origin(), direction };
        self.with_worker(|mut worker| worker.ray(line)?.ok_or(ExplainError::NoRays))
    }

    /// Checks that a pixel can be explained: any of the picture by rays, those of its window by a rasteriser.
    fn check_place(&self, pixel: [u32; 2]) -> Result<(), ExplainError> {
        let job = self.session.job();
        let [width, height] = job.camera.size();
        let traces_rays = job.description().traces_rays();
        check_place(if traces_rays { [0, 0, width, height] } else { job.window() }, pixel, job)
    }

    /// Calls `f` with a worker, on a thread whose stack is large enough.
    fn with_worker<T: Send>(
        &self,
        f: impl FnOnce(ExplainWorker) -> Result<T, ExplainError> + Send,
    ) -> Result<T, ExplainError> {
        let job = self.session.job();
        with_stack(stack_of(job.world(), job), || {
            let stops = |rays| rays > MAX_RAYS;
            f(ExplainWorker::new(self.session, MAX_RAYS, &stops).listing_rivals().with_steps(self.has_steps))
        })
        .map_err(JobError::from)?
    }
}
