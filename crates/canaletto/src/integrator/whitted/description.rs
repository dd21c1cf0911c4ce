//! What the classic integrator says of itself.

use crate::integrator::camera_rays::CameraRays;
use crate::integrator::description::{ChangedSettings, Description, Preparable};
use crate::integrator::prepared::{Preparation, PreparedIntegrator};
use crate::job::{Aov, JobError, Observer, PlacedJob};
use crate::scene::{Integrator, Stage, WhittedSettings};
use crate::{Named, OutOfRange};
use std::ops::ControlFlow;

impl Description for WhittedSettings {
    fn settings(&self) -> Vec<(&'static str, String)> {
        let WhittedSettings { max_depth, min_weight, stage, shadows } = self;
        vec![
            ("stage", stage.name().into()),
            ("max-depth", max_depth.to_string()),
            ("min-weight", min_weight.to_string()),
            ("shadows", shadows.to_string()),
        ]
    }

    fn check(&self) -> Result<(), OutOfRange> {
        Ok(())
    }

    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn has_shadows(&self) -> bool {
        self.shadows && self.stage >= Stage::Shadow
    }

    fn shades(&self) -> bool {
        self.stage > Stage::Unlit
    }

    fn makes(&self, aov: Aov, is_progressive: bool) -> bool {
        if is_progressive {
            aov.is_of_first_hit() || aov.is_of_samples() || aov.is_of_denoising()
        } else {
            !aov.is_of_samples()
        }
    }

    fn nearest_whitted(&self) -> WhittedSettings {
        *self
    }

    fn whitted(&self) -> Option<&WhittedSettings> {
        Some(self)
    }

    fn with_settings(&self, changed: &ChangedSettings) -> Result<Integrator, &'static str> {
        Ok(Integrator::Whitted(WhittedSettings {
            stage: changed.stage.unwrap_or(self.stage),
            max_depth: changed.max_depth.unwrap_or(self.max_depth),
            shadows: self.shadows && !changed.without_shadows,
            ..*self
        }))
    }

    fn for_metering(&self) -> Integrator {
        Integrator::Whitted(*self)
    }
}

impl Preparable for WhittedSettings {
    fn prepare<'w>(
        &self,
        job: &PlacedJob<'w>,
        _preparation: Preparation<'_>,
        _observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Box<dyn PreparedIntegrator + 'w>>, JobError> {
        Ok(ControlFlow::Continue(CameraRays::boxed(job, *self)))
    }
}
