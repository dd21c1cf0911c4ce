//! What a picture depends on besides the world, and who observes its making.

mod aov;
mod observer;
mod placed_job;

pub use aov::Aov;
pub use observer::{Observer, PassProgress, Progress, SolvingPhase, SolvingProgress};
pub use placed_job::PlacedJob;

use crate::camera::Camera;
use crate::scene::{Developing, FilmSettings, Filter, Guiding, Integrator, SamplerKind, Sampling, WhittedSettings};
use crate::world::World;
use crate::{Named, OutOfRange};
use canaletto_bvh::NoThreads;
use glam::DVec3;

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
    #[error("the {integrator} integrator doesn't make the layer \"{layer}\"")]
    Layer {
        /// The layer's name.
        layer: &'static str,
        /// The integrator's name.
        integrator: &'static str,
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

/// Why samples of the blue-noise sampler don't go on.
pub(crate) const BLUE_NOISE: &str = "the blue-noise sampler needs to know the number of samples first";

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
            noise: None,
            clamp: None,
        }
    }

    /// Checks the values that come from files and users.
    ///
    /// # Errors
    /// [`JobError`] with the value and its range.
    pub fn check(&self) -> Result<(), JobError> {
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
        self.integrator.check()?;
        if let Some(aov) = self.aovs.iter().find(|aov| !aov.is_made_by(&self.integrator)) {
            return Err(JobError::Layer { layer: aov.name(), integrator: self.integrator.name() });
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
        self.check_passes()?;
        match self.film.filter {
            Filter::Gaussian { sigma } if !(sigma > 0.0 && sigma <= 4.0) => {
                let problem = format!("is {sigma}; it must be more than 0 and at most 4 pixels");
                Err(OutOfRange::new("sigma", problem).into())
            }
            _ => Ok(()),
        }
    }

    /// Checks what only pictures made in passes have.
    fn check_passes(&self) -> Result<(), JobError> {
        for (name, value) in [("noise", self.noise), ("clamp", self.clamp)] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(OutOfRange::new(name, format!("is {value}; it must be more than 0")).into());
            }
        }
        if self.first_sample.checked_add(self.sample_count()).is_none_or(|end| end > Sampling::MAX_SAMPLES) {
            let problem = format!("is {}, so that samples pass number {}", self.first_sample, Sampling::MAX_SAMPLES);
            return Err(OutOfRange::new("first-sample", problem).into());
        }
        let made_of_one_number = self.film.sampler == SamplerKind::BlueNoise;
        let why = match self.passes() {
            Ok(()) if made_of_one_number && (self.noise.is_some() || self.first_sample > 0) => BLUE_NOISE,
            Ok(()) => return Ok(()),
            Err(why) => why,
        };
        let what = match (self.aovs.iter().find(|aov| aov.is_of_samples()), self.noise, self.clamp) {
            (Some(aov), ..) => aov.name(),
            (_, Some(_), _) => "noise",
            (_, _, Some(_)) => "clamp",
            _ if self.first_sample > 0 => "first-sample",
            _ => return Ok(()),
        };
        Err(JobError::NotInPasses { what, why })
    }

    /// Whether the picture is made in passes, each of which adds samples to its pixels, or why it isn't. Samples then
    /// don't depend on how many there will be.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn passes(&self) -> Result<(), &'static str> {
        match (self.integrator, self.film.sampling, self.film.sampler, self.film.filter) {
            (Integrator::Path(_), Sampling::Center | Sampling::Sampled(1), ..) => Ok(()),
            (Integrator::Path(_), Sampling::Sampled(_), SamplerKind::Jittered, _) => {
                Err("the jittered sampler needs to know the number of samples first")
            }
            (Integrator::Path(_), Sampling::Sampled(_), _, Filter::Mitchell) => {
                Err("the mitchell filter needs to know the number of samples first")
            }
            (Integrator::Path(_), Sampling::Sampled(_), ..) => Ok(()),
            (Integrator::Path(_), ..) => Err("its rays stand on a grid; --samples without --pattern does without"),
            _ => Err("only the path integrator makes such"),
        }
    }

    /// The number of samples of each pixel; for adaptive sampling, of a refined one.
    pub(crate) fn sample_count(&self) -> u32 {
        self.film.sampling.count()
    }

    /// This job with its camera relative to the world's origin, if that isn't zero.
    pub(crate) fn relative_to(&self, world: &World) -> Option<Job> {
        let origin = world.origin();
        (origin != DVec3::ZERO).then(|| Job { camera: self.camera.relative_to(origin), ..self.clone() })
    }

    /// How the picture is developed for display.
    pub fn developing(&self) -> Developing {
        self.film.developing(&self.integrator)
    }

    /// The job of a small picture of all that the camera sees, in which
    /// [`Exposure::Auto`](crate::scene::Exposure::Auto) is metered. It depends on neither crop, samples nor seed. All
    /// pictures of a scene have one exposure so: parts, previews, pixels that are explained, and pictures that are
    /// added up.
    pub fn metering(&self) -> Job {
        /// The longer side in pixels, and the rays of a pixel.
        const SIDE: u32 = 48;
        const SAMPLES: u32 = 32;
        let [width, height] = self.camera.size().map(f64::from);
        let share = f64::from(SIDE) / width.max(height);
        let size = [width, height].map(|side| ((side * share).round() as u32).max(1));
        let sampling = Sampling::Sampled(SAMPLES);
        let film = FilmSettings { sampling, alpha: self.film.alpha, ..FilmSettings::default() };
        let mut integrator = self.integrator;
        if let Some(path) = integrator.path_mut() {
            // Learning would take longer than the picture.
            path.guiding = Guiding::Off;
        }
        let camera = self.camera.resized(size);
        Job { frame: self.frame, tile: 8, clamp: self.clamp, ..Job::new(camera, film, integrator) }
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
