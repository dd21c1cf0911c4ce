//! What a picture depends on besides the world, and who observes its making.

mod aov;
mod observer;
mod placed_job;
mod tiles;

pub use aov::Aov;
pub use observer::{FinishedTile, Observer, PassProgress, Progress, SolvingPhase, SolvingProgress};
pub use placed_job::PlacedJob;
pub use tiles::Tiles;
pub(crate) use tiles::in_squares;

use crate::OutOfRange;
use crate::camera::Camera;
use crate::math::Rgb;
use crate::scene::{FilmSettings, Integrator, WhittedSettings};
use crate::world::World;
use canaletto_bvh::NoThreads;

/// Everything that a picture depends on besides the world.
///
/// ```
/// use canaletto::camera::Camera;
/// use canaletto::render::Job;
/// use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, PathSettings, Sampling};
///
/// let camera = Camera::new(&Intrinsics::default(), &Extrinsics::default())?;
/// let film = FilmSettings { sampling: Sampling::Sampled(16), ..FilmSettings::default() };
/// let job = Job { seed: 7, ..Job::new(camera, film, PathSettings::default()) };
/// job.check()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The camera.
    pub camera: Camera,
    /// The settings for sampling pixels. Pictures stay linear. Of developing, only the transfer affects them, and only
    /// with adaptive sampling.
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
    /// The number of each pixel's first sample. Pictures of other samples of the same scene can be added.
    pub first_sample: u32,
    /// The number after each pixel's last sample; none: as many samples as the film says. It makes a part of a picture
    /// of that many.
    pub end_sample: Option<u32>,
    /// Whether the picture is made of blocks of samples that add up, by integrators that make it otherwise as well.
    /// Path tracing's pictures are made so wherever they can be. Such a picture can be stopped after any pass, gone on
    /// with, and made in parts, since its samples don't depend on how many there will be.
    pub progressive: bool,
    /// The largest relative error that blocks of pixels should have. Pixels get samples until it is estimated to be
    /// reached, but no more than the film says. It is the root of the mean square error of the components in a block of
    /// 8 × 8 pixels, divided by the block's mean component. In dark blocks a tenth of the mean component of the middle
    /// one of all blocks counts instead.
    pub noise: Option<f32>,
    /// The largest component of a sample. Brighter samples become darker, which removes light from the picture.
    pub clamp: Option<f32>,
}

/// An error in a job.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The crop window is empty or reaches beyond the picture.
    #[error(
        "the crop window {width} x {height} at {x}, {y} doesn't lie inside the picture of {of_width} x {of_height} \
         pixels"
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
    #[error("max-depth is {0}; it must be between 1 (only camera rays) and {max}", max = WhittedSettings::MAX_DEPTH)]
    Depth(u32),
    /// The integrator can't make a layer.
    #[error("the {integrator} integrator doesn't make the layer \"{layer}\"{otherwise}")]
    Layer {
        /// The layer's name.
        layer: &'static str,
        /// The integrator's name.
        integrator: &'static str,
        /// Where it does make it, as the end of the sentence; empty if nowhere.
        otherwise: &'static str,
    },
    /// The integrator's pixels can't be explained.
    #[error(
        "pixels of the {integrator} integrator can't be explained; --integrator whitted explains the classic picture"
    )]
    NoExplanation {
        /// The integrator's name.
        integrator: &'static str,
    },
    /// The shadow maps would take too much memory.
    #[error(
        "the shadow maps take {mebibytes} MiB, more than {most} MiB; a smaller shadow-map-size or fewer lights take \
         less"
    )]
    ShadowMaps {
        /// The memory of all maps.
        mebibytes: u64,
        /// The most memory.
        most: u64,
    },
    /// Something is asked for that only pictures made in passes have.
    #[error("{what} needs a picture that is made in passes, but {why}")]
    NotInPasses {
        /// What is asked for.
        what: &'static str,
        /// Why the picture isn't made in passes.
        why: &'static str,
    },
    /// The samples to go on with aren't those of this picture.
    #[error("the picture can't go on with these samples: {0}")]
    Start(String),
    /// Radiosity finds no solution.
    #[error("radiosity: {0}")]
    Radiosity(String),
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
        Job {
            camera,
            film,
            integrator: integrator.into(),
            seed: 0,
            frame: 0,
            tile: 32,
            aovs: Vec::new(),
            first_sample: 0,
            end_sample: None,
            progressive: false,
            noise: None,
            clamp: None,
        }
    }

    /// The number of samples of each pixel; for adaptive sampling, of a refined one.
    pub(crate) fn sample_count(&self) -> u32 {
        self.film.sampling.count()
    }

    /// The number of samples of each pixel that this job makes.
    pub(crate) fn own_sample_count(&self) -> u32 {
        self.end_sample.map_or(self.sample_count(), |end| end.saturating_sub(self.first_sample))
    }

    /// What camera rays see straight on in place of the surroundings, in a picture with an alpha: nothing, or what the
    /// shadows on catchers are measured by.
    pub(crate) fn backdrop(&self, world: &World) -> Option<Rgb> {
        self.film.alpha.then(|| world.shadow_background().unwrap_or(Rgb::BLACK))
    }

    /// Whether it is asked how much of the background each pixel hides.
    pub(crate) fn has_alpha(&self) -> bool {
        self.film.alpha || self.aovs.contains(&Aov::Alpha)
    }

    /// The area to render: x and y (from the top left), width and height, in pixels.
    pub fn window(&self) -> [u32; 4] {
        let [w, h] = self.camera.size();
        self.film.crop.unwrap_or([0, 0, w, h])
    }
}
