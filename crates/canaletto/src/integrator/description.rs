//! What each integrator says of itself, in a file of its own, and the one place that names them all.

use super::prepared::{Preparation, PreparedIntegrator};
use super::{Omission, PreparationMemory};
use crate::job::{Aov, Job, JobError, Observer, PlacedJob};
use crate::scene::{Integrator, PathSettings, RadiositySettings, Sampling, Stage, WhittedSettings};
use crate::world::World;
use crate::{Named, OutOfRange};
use std::fmt::Debug;
use std::ops::ControlFlow;

/// An integrator's settings with what follows from them.
pub trait Description: Debug + Sync {
    /// The settings: the words of the scene text with their values.
    fn settings(&self) -> Vec<(&'static str, String)>;

    /// Checks the numbers that have no check of their own in a job.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    fn check(&self) -> Result<(), OutOfRange>;

    /// The sampling of a scene that says nothing of it, where others have the `usual` one.
    fn default_sampling(&self, usual: Sampling) -> Sampling {
        usual
    }

    /// Checks whether a world can be rendered, as far as that is known without rendering it.
    ///
    /// # Errors
    /// The [`JobError`] with which a render would refuse it.
    fn check_world(&self, _world: &World) -> Result<(), JobError> {
        Ok(())
    }

    /// The largest depth of nested rays, which the stack must hold. Camera rays have depth 1.
    fn max_depth(&self) -> u32 {
        1
    }

    /// Whether lights that cast shadows do so.
    fn has_shadows(&self) -> bool {
        true
    }

    /// Whether it traces single rays. A rasteriser doesn't.
    fn traces_rays(&self) -> bool {
        true
    }

    /// Whether camera rays go on as random paths, so that a pixel is explained by its paths.
    fn traces_paths(&self) -> bool {
        false
    }

    /// Whether surfaces are shaded at all.
    fn shades(&self) -> bool {
        true
    }

    /// Whether its pictures have the range of real light, so that they are developed as photos.
    fn is_photographic(&self) -> bool {
        false
    }

    /// Whether it finds the light between surfaces, for which ambient light stands otherwise.
    fn finds_indirect_light(&self) -> bool {
        false
    }

    /// Whether its pictures are always made of samples that add up ([`Job::progressive`]), where sampler and filter
    /// allow it.
    fn is_progressive_by_default(&self) -> bool {
        false
    }

    /// Whether it makes a layer, of a progressive picture or of another one.
    fn makes(&self, aov: Aov, is_progressive: bool) -> bool;

    /// The settings with which the classic integrator makes the most similar picture.
    fn nearest_whitted(&self) -> WhittedSettings {
        WhittedSettings::DEFAULT
    }

    /// The settings of the classic integrator, if it is this one.
    fn whitted(&self) -> Option<&WhittedSettings> {
        None
    }

    /// The settings of radiosity, if it is this one. Its solution can be kept for other pictures.
    fn radiosity(&self) -> Option<&RadiositySettings> {
        None
    }

    /// The settings with which path tracing makes the most similar picture.
    fn nearest_path(&self) -> PathSettings {
        PathSettings::DEFAULT
    }

    /// The largest distance in pixels between a curved surface and the triangles that stand for it.
    fn tolerance(&self) -> f64 {
        0.5
    }

    /// The integrator with other settings, where it has such.
    ///
    /// # Errors
    /// The name of a setting that has no meaning for it.
    fn with_settings(&self, changed: &ChangedSettings) -> Result<Integrator, &'static str>;

    /// The integrator for a small picture that meters the exposure: without what takes longer than that picture.
    fn for_metering(&self) -> Integrator;
}

/// Settings that replace an integrator's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChangedSettings {
    /// The largest depth of nested rays, or of paths.
    pub max_depth: Option<u32>,
    /// The part of the shading equation.
    pub stage: Option<Stage>,
    /// Whether shadows are left out.
    pub without_shadows: bool,
}

/// What a render needs of an integrator besides its description.
pub(crate) trait Preparable: Description {
    /// The parts of the world that are left out of the job's picture, besides those that no integrator of its kind has.
    fn omissions(&self, _job: &PlacedJob) -> Vec<Omission> {
        Vec::new()
    }

    /// The memory that preparing the job takes, and what is held while it is measured, if that takes little time.
    ///
    /// # Errors
    /// [`JobError`] if the job can't be prepared.
    fn preparation_memory<'w>(&self, _job: &PlacedJob<'w>) -> Result<MeasuredPreparation<'w>, JobError> {
        Ok((PreparationMemory::default(), None))
    }

    /// Prepares a job. Breaks if the observer cancels.
    ///
    /// # Errors
    /// [`JobError`] if the world can't be rendered so.
    fn prepare<'w>(
        &self,
        job: &PlacedJob<'w>,
        preparation: Preparation<'_>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Box<dyn PreparedIntegrator + 'w>>, JobError>;
}

/// Memory of a preparation, and what was prepared to measure it.
pub(crate) type MeasuredPreparation<'w> = (PreparationMemory, Option<Box<dyn PreparedIntegrator + 'w>>);

/// The integrators: the one `match` that names them all.
pub(crate) fn preparable(integrator: &Integrator) -> &dyn Preparable {
    match integrator {
        Integrator::Whitted(settings) => settings,
        Integrator::Zbuffer(settings) => settings,
        Integrator::Radiosity(settings) => settings,
        Integrator::Path(settings) => settings,
    }
}

/// What an integrator says of itself.
pub fn describe(integrator: &Integrator) -> &dyn Description {
    preparable(integrator)
}

/// All layers that an integrator makes, of a progressive picture or of another one.
pub fn layers_of(integrator: &Integrator, is_progressive: bool) -> Vec<Aov> {
    Aov::ALL.iter().copied().filter(|aov| describe(integrator).makes(*aov, is_progressive)).collect()
}

impl Job {
    /// What the job's integrator says of itself.
    pub fn description(&self) -> &dyn Description {
        describe(&self.integrator)
    }
}
