//! Observers of a render.

use crate::film::{Checkpoint, NoiseOutlook, Picture};
use crate::math::Rgb;
use std::fmt;
use std::ops::ControlFlow;

/// An observer of a render, which may cancel it. Its methods are called from many threads.
pub trait Observer: Sync {
    /// Whether to cancel. Called before every few pixels, and at intervals within them. Once it returns true,
    /// unfinished tiles are dropped and the picture so far is returned.
    fn cancelled(&self) -> bool {
        false
    }
    /// Reports the progress after each tile.
    fn progress(&self, _progress: &Progress) {}
    /// Reports a finished tile with its pixels. Other threads wait meanwhile, so it should take little time.
    fn tile_finished(&self, _tile: &FinishedTile<'_>) {}
    /// Reports that a pass over the picture has ended, for pictures that are made in passes of samples. One thread
    /// calls it, and no other one works meanwhile. If it breaks, the picture is complete as it is.
    fn pass_ended(&self, _progress: &PassProgress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
    /// Whether a checkpoint is wanted at this moment. Each thread asks after each tile of a picture that is made in
    /// passes of samples. The thread that hears true makes one, while the others go on.
    fn wants_checkpoint(&self) -> bool {
        false
    }
    /// Takes a checkpoint that was [wanted](Observer::wants_checkpoint).
    fn checkpoint(&self, _checkpoint: &Checkpoint) {}
    /// Reports the progress of radiosity, which is solved before the first tile, and of grading.
    fn solving(&self, _progress: &SolvingProgress) {}
}

/// The empty observer, which never cancels.
impl Observer for () {}

/// The progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The number of finished pixels, summed over passes.
    pub pixels_done: u64,
    /// The number of all pixels, times the number of passes.
    pub pixels: u64,
    /// The number of rays traced so far.
    pub rays: u64,
}

/// A tile of the picture so far. In a progressive picture it may get more samples in later passes.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FinishedTile<'a> {
    /// x and y from the whole picture's upper left corner, width and height, in pixels.
    pub area: [u32; 4],
    picture: &'a Picture,
    corner: [u32; 2],
}

impl<'a> FinishedTile<'a> {
    /// The tile with this area of a picture whose upper left corner is pixel `corner`.
    pub(crate) fn of(picture: &'a Picture, corner: [u32; 2], area: [u32; 4]) -> FinishedTile<'a> {
        FinishedTile { area, picture, corner }
    }

    /// The rows of pixels from the top, in linear light.
    pub fn rows(&self) -> impl Iterator<Item = &'a [Rgb]> {
        let ([x, y, width, height], [left, top]) = (self.area, self.corner);
        let (pixels, stride) = (&self.picture.pixels, self.picture.width as usize);
        (y - top..y - top + height).map(move |row| {
            let start = row as usize * stride + (x - left) as usize;
            &pixels[start..start + width as usize]
        })
    }
}

/// A picture after a pass of samples.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct PassProgress<'a> {
    /// The number of samples of each pixel that still needed some.
    pub samples: u32,
    /// The number after the next pass; none if this was the last one.
    pub next: Option<u32>,
    /// The number of pixels that need more samples.
    pub pixels_left: u64,
    /// The largest relative error of a block of pixels, if the job limits it. Infinite while it is unknown.
    pub noise: Option<f32>,
    /// The picture so far, with its layers.
    pub picture: &'a Picture,
    pub(crate) outlook: &'a dyn Fn() -> NoiseOutlook,
}

impl PassProgress<'_> {
    /// What is left of the noise. It takes about as long as a look at each pixel.
    pub fn outlook(&self) -> NoiseOutlook {
        (self.outlook)()
    }
}

impl fmt::Debug for PassProgress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PassProgress { samples, next, pixels_left, noise, .. } = self;
        let mut fields = f.debug_struct("PassProgress");
        fields.field("samples", samples).field("next", next).field("pixels_left", pixels_left);
        fields.field("noise", noise).finish_non_exhaustive()
    }
}

/// The progress of work that isn't done by tiles: of solving radiosity, of guiding, and of grading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolvingProgress {
    /// What is being done.
    pub phase: SolvingPhase,
    /// The number of patches so far.
    pub patches: u64,
    /// The number of links between nodes so far, or of pairs of patches.
    pub links: u64,
}

/// A phase of work that isn't done by tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SolvingPhase {
    /// Surfaces are cut into patches.
    Patches,
    /// The light that arrives from lights and from the environment is found.
    Lights,
    /// Patches and clusters are linked.
    Links {
        /// The number of this round of refinement, from 1 on.
        round: u32,
        /// The number of all rounds.
        rounds: u32,
    },
    /// Light bounces over links until it is balanced.
    Balance {
        /// The number of bounces so far.
        bounce: u32,
    },
    /// Patches send their light, one after the other.
    Shooting {
        /// The number of patches that have sent light.
        step: u64,
        /// The share of all light that isn't sent yet.
        unsent: f64,
    },
    /// Paths learn where light comes from.
    Guiding {
        /// The number of this round, from 1 on.
        round: u32,
        /// The number of all rounds.
        rounds: u32,
    },
    /// A picture is compared with hypotheses of mistakes.
    Mistakes {
        /// The number of this hypothesis in its pass, from 1 on.
        step: u64,
        /// The number of hypotheses in this pass.
        steps: u64,
    },
    /// The scene's numbers are fitted to a picture.
    Numbers {
        /// The number of scenes that were rendered so far.
        step: u64,
    },
}

impl SolvingPhase {
    /// The name of the phase.
    pub fn name(&self) -> &'static str {
        match self {
            SolvingPhase::Patches => "patches",
            SolvingPhase::Lights => "lights",
            SolvingPhase::Links { .. } => "links",
            SolvingPhase::Balance { .. } => "balance",
            SolvingPhase::Shooting { .. } => "shooting",
            SolvingPhase::Guiding { .. } => "guiding",
            SolvingPhase::Mistakes { .. } => "mistakes",
            SolvingPhase::Numbers { .. } => "numbers",
        }
    }
}
