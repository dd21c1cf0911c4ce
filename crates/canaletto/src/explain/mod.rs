//! The explanation of a pixel: the tree of rays behind it, with every term of (5.39b) as a number.
//!
//! A probe records the tree while the pixel is rendered by the code that renders pictures. [`PixelTree::sum`] adds up
//! the recorded terms and returns the pixel bit for bit.

mod number;
mod patch;
mod patch_terms;
mod patch_text;
mod prepared;
mod record;
mod text;
mod tree;

pub use patch::{
    CornerNode, LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, SourceKind, SourceNode,
};
pub use tree::{
    BlockerNode, CutNode, HitNode, ImageNode, LightNode, LobeNode, Outcome, PixelTree, RayNode, ReadingNode,
    SampleNode, Side, TextureNode,
};

use crate::integrator::radiosity::RadiositySolution;
pub use crate::integrator::{RasterNode, RasterRival, RasterTriangle, RivalFate, ShownLight};
use crate::render::{Job, JobError, stack_of};
use crate::world::World;
use canaletto_bvh::with_stack;
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
/// # Errors
/// [`ExplainError`] if the pixel is outside the picture, has too many rays, or the job has an error.
pub fn explain(world: &World, job: &Job, x: u32, y: u32) -> Result<PixelTree, ExplainError> {
    explain_given(world, job, None, [x, y])
}

/// Explains a pixel as [`explain`] does, with a solution of radiosity that is already found.
///
/// # Errors
/// As [`explain`], and as [`render_with_solution`](crate::render::render_with_solution).
pub fn explain_with_solution(
    world: &World,
    job: &Job,
    solution: &Arc<RadiositySolution>,
    x: u32,
    y: u32,
) -> Result<PixelTree, ExplainError> {
    solution.check(world, job)?;
    explain_given(world, job, Some(solution), [x, y])
}

fn explain_given(
    world: &World,
    job: &Job,
    solution: Option<&Arc<RadiositySolution>>,
    [x, y]: [u32; 2],
) -> Result<PixelTree, ExplainError> {
    job.check()?;
    let [width, height] = job.camera.size();
    if x >= width || y >= height {
        return Err(ExplainError::Outside { x, y, width, height });
    }
    let counted = job.relative_to(world);
    let job = counted.as_ref().unwrap_or(job);
    with_stack(stack_of(world, job), || record(world, job, solution, [x, y])).map_err(JobError::from)?
}

fn record(
    world: &World,
    job: &Job,
    solution: Option<&Arc<RadiositySolution>>,
    [x, y]: [u32; 2],
) -> Result<PixelTree, ExplainError> {
    // Only what the pixel needs is prepared.
    let mut job = Job { tile: 1, aovs: Vec::new(), ..job.clone() };
    job.film.crop = Some([x, y, 1, 1]);
    let source = solution.map_or(SolutionSource::SolvedWithLinks, SolutionSource::Given);
    let prepared = PreparedExplainer::new(world, &job, source, &())?;
    let ControlFlow::Continue(explainer) = prepared else {
        return Err(ExplainError::Cancelled);
    };
    ExplainWorker::new(&explainer, MAX_RAYS, &|_| false).listing_rivals().pixel([x, y])
}
