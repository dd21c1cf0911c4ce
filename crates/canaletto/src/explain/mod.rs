//! The explanation of a pixel: the tree of rays behind it, with every term of (5.39b) as a number.
//!
//! A probe records the tree while the pixel is rendered by the code that renders pictures. [`PixelTree::sum`] adds up
//! the recorded terms and returns the pixel bit for bit.

mod developed;
mod difference;
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
mod prepared;
mod raster_text;
mod ray_text;
mod ray_tree;
mod record;
mod round_shapes;
mod steps;
mod steps_text;
mod text;
mod text_writer;
mod tree;
mod tree_svg;
mod tried_objects;

pub use developed::{DevelopedNode, DevelopedValues, ToneCurve};
pub use difference::{TermDifference, TermValue, TreeDifference};
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
pub use text_writer::TextStyle;
pub use tree::{
    BlockerNode, CutNode, HitNode, ImageNode, LightNode, LobeNode, Outcome, PixelTree, RayNode, ReadingNode,
    SampleNode, Side, TextureNode,
};

use crate::integrator::radiosity::RadiositySolution;
pub use crate::integrator::{RasterNode, RasterRival, RasterTriangle, RivalFate, ShownLight};
use crate::math::DRay;
use crate::render::{Job, JobError, stack_of};
use crate::world::World;
use canaletto_bvh::with_stack;
use glam::DVec3;
pub(crate) use prepared::{ExplainWorker, PreparedExplainer, SolutionSource};
use std::ops::ControlFlow;
use std::sync::Arc;

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
    Explainer::new(world, job).pixel(x, y)
}

/// What explanations are made from.
#[derive(Clone, Copy, Debug)]
pub struct Explainer<'a> {
    world: &'a World,
    job: &'a Job,
    solution: Option<&'a Arc<RadiositySolution>>,
    has_steps: bool,
}

impl<'a> Explainer<'a> {
    /// Explanations of a job's pixels.
    pub fn new(world: &'a World, job: &'a Job) -> Explainer<'a> {
        Explainer { world, job, solution: None, has_steps: false }
    }

    /// Returns the explainer with a solution of radiosity that is already found. What lights its patches isn't known.
    pub fn with_solution(self, solution: &'a Arc<RadiositySolution>) -> Explainer<'a> {
        Explainer { solution: Some(solution), ..self }
    }

    /// Returns the explainer such that trees have the numbers on the chapter's way: those of the camera, of
    /// intersections, of all objects that are tried, of reflection and refraction.
    pub fn with_steps(self, has_steps: bool) -> Explainer<'a> {
        Explainer { has_steps, ..self }
    }

    /// Explains a pixel as [`explain`] does.
    ///
    /// # Errors
    /// As [`explain`], and as [`render_with_solution`](crate::render::render_with_solution).
    pub fn pixel(&self, x: u32, y: u32) -> Result<PixelTree, ExplainError> {
        let [width, height] = self.job.camera.size();
        if x >= width || y >= height {
            self.job.check()?;
            return Err(ExplainError::Outside { x, y, width, height });
        }
        self.with_worker([x, y], |worker| worker.listing_rivals().pixel([x, y]))
    }

    /// Explains the paths of a pixel of path tracing.
    ///
    /// # Errors
    /// As [`Explainer::pixel`], and [`ExplainError::NoPaths`] for another integrator.
    pub fn paths(&self, x: u32, y: u32) -> Result<PathTree, ExplainError> {
        let [width, height] = self.job.camera.size();
        self.job.check()?;
        if x >= width || y >= height {
            return Err(ExplainError::Outside { x, y, width, height });
        }
        let relative = self.job.relative_to(self.world);
        let job = relative.as_ref().unwrap_or(self.job);
        with_stack(stack_of(self.world, job), || path::path_tree(self.world, job, [x, y])).map_err(JobError::from)?
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
        let line = DRay { origin: origin - self.world.origin(), direction };
        self.with_worker([0, 0], |mut worker| worker.ray(line)?.ok_or(ExplainError::NoRays))
    }

    /// The scene from outside with the rays that [`PixelTree::svg`] draws for this number of levels. None for a tree
    /// without samples.
    pub fn outside(&self, tree: &PixelTree, levels: Option<u32>) -> Option<OutsideView> {
        let sample = tree.samples.get(tree.nearest_to_mean())?;
        Some(self.outside_of(&sample.ray, sample.time.unwrap_or(0.0) as f32, levels))
    }

    /// The scene from outside with the rays that [`PathTree::svg`] draws for this sample.
    pub fn outside_path(&self, tree: &PathTree, chosen: Option<usize>, levels: Option<u32>) -> Option<OutsideView> {
        let sample = tree.samples.get(chosen.or_else(|| tree.nearest_to_mean())?)?;
        Some(self.outside_of(&sample.as_tree()?, sample.time.unwrap_or(0.0) as f32, levels))
    }

    /// The scene from outside with the rays that [`RayTree::svg`] draws.
    pub fn outside_ray(&self, tree: &RayTree, levels: Option<u32>) -> OutsideView {
        self.outside_of(&tree.ray, 0.0, levels)
    }

    fn outside_of(&self, ray: &RayNode, time: f32, levels: Option<u32>) -> OutsideView {
        OutsideView::new(self.world, &self.job.camera.at(time.into()), time, ray, levels)
    }

    /// Prepares what a pixel needs, and calls `f`.
    fn with_worker<T: Send>(
        &self,
        [x, y]: [u32; 2],
        f: impl FnOnce(ExplainWorker) -> Result<T, ExplainError> + Send,
    ) -> Result<T, ExplainError> {
        let Explainer { world, job, solution, has_steps } = *self;
        job.check()?;
        solution.map_or(Ok(()), |solution| solution.check(world, job))?;
        let relative = job.relative_to(world);
        let job = relative.as_ref().unwrap_or(job);
        with_stack(stack_of(world, job), || {
            let mut job = Job { tile: 1, aovs: Vec::new(), ..job.clone() };
            job.film.crop = Some([x, y, 1, 1]);
            let source = solution.map_or(SolutionSource::SolvedWithLinks, SolutionSource::Given);
            let ControlFlow::Continue(explainer) = PreparedExplainer::new(world, &job, source, &())? else {
                return Err(ExplainError::Cancelled);
            };
            f(ExplainWorker::new(&explainer, MAX_RAYS, &|_| false).with_steps(has_steps))
        })
        .map_err(JobError::from)?
    }
}
