//! What path tracing says of itself.

use super::training::{prepare_path, training_memory};
use crate::integrator::camera_rays::CameraRays;
use crate::integrator::description::{ChangedSettings, Description, MeasuredPreparation, Preparable};
use crate::integrator::prepared::{Preparation, PreparedIntegrator};
use crate::integrator::{Omission, PreparationMemory};
use crate::job::{Aov, JobError, Observer, PlacedJob};
use crate::scene::{Guiding, Integrator, PathSettings, Sampling};
use crate::{Named, OutOfRange};
use std::ops::ControlFlow;

impl Description for PathSettings {
    fn settings(&self) -> Vec<(&'static str, String)> {
        let PathSettings { max_depth, roulette, guiding } = self;
        vec![
            ("max-depth", max_depth.to_string()),
            ("roulette", roulette.to_string()),
            ("guiding", guiding.name().into()),
        ]
    }

    fn check(&self) -> Result<(), OutOfRange> {
        PathSettings::check(self)
    }

    /// Paths differ everywhere, so that no pixel may have fewer. A noisy preview takes seconds.
    fn default_sampling(&self, _usual: Sampling) -> Sampling {
        Sampling::Sampled(64)
    }

    fn traces_paths(&self) -> bool {
        true
    }

    fn is_photographic(&self) -> bool {
        true
    }

    fn nearest_path(&self) -> PathSettings {
        *self
    }

    fn finds_indirect_light(&self) -> bool {
        true
    }

    fn is_progressive_by_default(&self) -> bool {
        true
    }

    fn makes(&self, aov: Aov, _is_progressive: bool) -> bool {
        aov.is_of_first_hit() || aov.is_of_samples() || aov.is_of_denoising()
    }

    fn with_settings(&self, changed: &ChangedSettings) -> Result<Integrator, &'static str> {
        match changed {
            ChangedSettings { stage: Some(_), .. } => Err("stage"),
            ChangedSettings { without_shadows: true, .. } => Err("no-shadows"),
            _ => Ok(Integrator::Path(PathSettings { max_depth: changed.max_depth.unwrap_or(self.max_depth), ..*self })),
        }
    }

    /// Learning would take longer than the picture.
    fn for_metering(&self) -> Integrator {
        Integrator::Path(PathSettings { guiding: Guiding::Off, ..*self })
    }
}

impl Preparable for PathSettings {
    /// Media fill closed bodies only.
    fn omissions(&self, job: &PlacedJob) -> Vec<Omission> {
        let open = job.world().open_meshes().into_iter();
        let body = open.map(|open| Omission::OpenBody {
            object: open.object.to_owned(),
            material: open.material.name.clone(),
            edges: open.edges,
        });
        body.collect()
    }

    fn preparation_memory<'w>(&self, job: &PlacedJob<'w>) -> Result<MeasuredPreparation<'w>, JobError> {
        let bytes = if self.guiding == Guiding::Off { 0 } else { training_memory(job, *self) };
        Ok((PreparationMemory { bytes, at_most: false }, None))
    }

    fn prepare<'w>(
        &self,
        job: &PlacedJob<'w>,
        preparation: Preparation<'_>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Box<dyn PreparedIntegrator + 'w>>, JobError> {
        Ok(prepare_path(job, *self, preparation, observer)
            .map_continue(|integrator| CameraRays::boxed(job, integrator)))
    }
}
