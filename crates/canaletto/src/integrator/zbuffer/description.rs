//! What the z-buffer says of itself.

use super::{Zbuffer, omissions};
use crate::integrator::description::{ChangedSettings, Description, MeasuredPreparation, Preparable};
use crate::integrator::prepared::{Preparation, PreparedIntegrator};
use crate::integrator::{Omission, PreparationMemory};
use crate::job::{Aov, JobError, Observer, PlacedJob};
use crate::scene::{Integrator, Sampling, ShadowMethod, Stage, WhittedSettings, ZbufferSettings};
use crate::world::World;
use crate::{Named, OutOfRange};
use std::ops::ControlFlow;

impl Description for ZbufferSettings {
    fn settings(&self) -> Vec<(&'static str, String)> {
        let ZbufferSettings { shading, shadows, shadow_map_size, multisampling, tolerance } = self;
        vec![
            ("shading", shading.name().into()),
            ("shadows", shadows.name().into()),
            ("shadow-map-size", shadow_map_size.to_string()),
            ("multisampling", multisampling.to_string()),
            ("tolerance", tolerance.to_string()),
        ]
    }

    fn check(&self) -> Result<(), OutOfRange> {
        ZbufferSettings::check(self)
    }

    /// The samples of a z-buffer have equal places in all pixels.
    fn default_sampling(&self, usual: Sampling) -> Sampling {
        match usual {
            Sampling::Adaptive { n, .. } => Sampling::Regular(n),
            other => other,
        }
    }

    fn check_world(&self, world: &World) -> Result<(), JobError> {
        Zbuffer::check(world, self)
    }

    fn has_shadows(&self) -> bool {
        self.shadows == ShadowMethod::Map
    }

    fn traces_rays(&self) -> bool {
        false
    }

    fn makes(&self, aov: Aov, is_progressive: bool) -> bool {
        aov.is_of_first_hit() || is_progressive && aov.is_of_samples()
    }

    fn nearest_whitted(&self) -> WhittedSettings {
        let stage = if self.has_shadows() { Stage::Shadow } else { Stage::Specular };
        WhittedSettings { stage, ..WhittedSettings::DEFAULT }
    }

    fn tolerance(&self) -> f64 {
        self.tolerance.into()
    }

    fn with_settings(&self, changed: &ChangedSettings) -> Result<Integrator, &'static str> {
        let shadows = if changed.without_shadows { ShadowMethod::None } else { self.shadows };
        Ok(Integrator::Zbuffer(ZbufferSettings { shadows, ..*self }))
    }

    fn for_metering(&self) -> Integrator {
        Integrator::Zbuffer(*self)
    }
}

impl Preparable for ZbufferSettings {
    fn omissions(&self, job: &PlacedJob) -> Vec<Omission> {
        omissions(job, self)
    }

    /// Triangles and shadow maps are made and held, so that the caller measures them.
    fn preparation_memory<'w>(&self, job: &PlacedJob<'w>) -> Result<MeasuredPreparation<'w>, JobError> {
        let held = Zbuffer::prepare(job, *self, &())?.continue_value();
        let held = held.map(|zbuffer| Box::new(zbuffer) as Box<dyn PreparedIntegrator>);
        Ok((PreparationMemory::default(), held))
    }

    fn prepare<'w>(
        &self,
        job: &PlacedJob<'w>,
        _preparation: Preparation<'_>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Box<dyn PreparedIntegrator + 'w>>, JobError> {
        let prepared = Zbuffer::prepare(job, *self, observer)?;
        Ok(prepared.map_continue(|zbuffer| Box::new(zbuffer) as Box<dyn PreparedIntegrator>))
    }
}
