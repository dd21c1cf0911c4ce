//! The checks of a job, and what its integrator decides of it.

use crate::job::{Job, JobError};
use crate::scene::{Developing, FilmSettings, Filter, SamplerKind, Sampling, WhittedSettings};
use crate::{Named, OutOfRange};

/// Why samples of the blue-noise sampler don't go on.
pub(crate) const BLUE_NOISE: &str = "the blue-noise sampler needs to know the number of samples first";

impl Job {
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
        let description = self.description();
        if !(1..=WhittedSettings::MAX_DEPTH).contains(&description.max_depth()) {
            return Err(JobError::Depth(description.max_depth()));
        }
        description.check()?;
        if let Some(aov) = self.aovs.iter().find(|aov| !description.makes(**aov, self.progressive)) {
            let otherwise = match (description.makes(*aov, !self.progressive), self.progressive) {
                (true, false) => ", but it does in a progressive picture",
                (true, true) => ", but it does in a picture that isn't progressive",
                (false, _) => "",
            };
            return Err(JobError::Layer { layer: aov.name(), integrator: self.integrator.name(), otherwise });
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
        if self.first_sample.checked_add(self.own_sample_count()).is_none_or(|end| end > Sampling::MAX_SAMPLES) {
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
            _ if self.progressive => "progressive",
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
        if !self.progressive && !self.description().is_progressive_by_default() {
            return Err("the job isn't progressive");
        }
        match (self.film.sampling, self.film.sampler, self.film.filter) {
            (Sampling::Center | Sampling::Sampled(1), ..) => Ok(()),
            (Sampling::Sampled(_), SamplerKind::Jittered, _) => {
                Err("the jittered sampler needs to know the number of samples first")
            }
            (Sampling::Sampled(_), _, Filter::Mitchell) => {
                Err("the mitchell filter needs to know the number of samples first")
            }
            (Sampling::Sampled(_), ..) => Ok(()),
            (Sampling::Corner, ..) => Err("its rays go through the corners of pixels; --samples sends others"),
            _ => Err("its rays stand on a grid; --samples without --pattern does without"),
        }
    }

    /// Whether the picture is made of blocks of samples that add up.
    pub fn is_progressive(&self) -> bool {
        self.passes().is_ok()
    }

    /// How the picture is developed for display.
    pub fn developing(&self) -> Developing {
        self.film.developing(self.description().is_photographic())
    }

    /// The job of a small picture of all that the camera sees, in which
    /// [`Exposure::Auto`](crate::scene::Exposure::Auto) is metered. It depends on neither crop, samples nor seed. All
    /// pictures of a scene have one exposure so: parts, previews, pixels that are explained, and pictures that are
    /// added up.
    pub fn metering(&self) -> Job {
        /// The longer side in pixels, and the rays of a pixel.
        const SIDE: u32 = 20;
        const SAMPLES: u32 = 32;
        let [width, height] = self.camera.size().map(f64::from);
        let share = f64::from(SIDE) / width.max(height);
        let size = [width, height].map(|side| ((side * share).round() as u32).max(1));
        let sampling = Sampling::Sampled(SAMPLES);
        let film = FilmSettings { sampling, alpha: self.film.alpha, ..FilmSettings::default() };
        let (camera, integrator) = (self.camera.resized(size), self.description().for_metering());
        Job { frame: self.frame, tile: 8, clamp: self.clamp, ..Job::new(camera, film, integrator) }
    }
}
