//! The second pass: a picture of a solution by the classic integrator (fig. 5.38). The solution's light takes the place
//! of ambient light.

use super::{RadiosityError, RadiositySolution};
use crate::integrator::whitted::{DiffuseLight, EmitterReceiver};
use crate::integrator::{Cancelled, Counts, EmittersTerm, PreparedRayIntegrator, Whitted};
use crate::job::{JobError, Observer};
use crate::math::Rgb;
use crate::scene::{RadiositySettings, RadiosityShow, Stage, WhittedSettings};
use crate::world::{Hit, World};
use glam::DVec3;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A solution with the part of it that is shown.
struct ShownSolution {
    solution: Arc<RadiositySolution>,
    show: RadiosityShow,
    /// The shadow rays to emitters at each hit.
    light_samples: u32,
}

impl DiffuseLight for ShownSolution {
    fn takes_lights(&self) -> bool {
        self.show == RadiosityShow::Full
    }

    fn light_at(&self, hit: &Hit, point: DVec3, outside: bool) -> Rgb {
        let light = match self.show {
            RadiosityShow::Patches => {
                let patch = self.solution.patch_at(hit.instance, hit.primitive, hit.part, outside, point);
                patch.map(|patch| self.solution.patches()[patch].arriving().sum())
            }
            RadiosityShow::Solution => {
                let light = self.solution.light_at(hit.instance, hit.primitive, hit.part, outside, point);
                light.map(|light| light.sum())
            }
            RadiosityShow::Full => {
                let light = self.solution.light_at(hit.instance, hit.primitive, hit.part, outside, point);
                let has_emitters = !self.solution.emitters.is_empty();
                light.map(|light| if has_emitters { light.indirect } else { light.from_emitters + light.indirect })
            }
        };
        Rgb::from(light.unwrap_or_default().to_array().map(|v| v as f32)).saturated()
    }

    fn emitters_at(&self, receiver: &EmitterReceiver) -> Option<EmittersTerm> {
        if self.show != RadiosityShow::Full || self.solution.emitters.is_empty() {
            return None;
        }
        let term = self.solution.emitters.light_at(receiver, self.light_samples);
        (!term.unoccluded.is_black()).then_some(term)
    }
}

/// Radiosity that is solved and ready to be seen.
pub(crate) struct PreparedRadiosity {
    shown: ShownSolution,
    settings: WhittedSettings,
}

impl PreparedRadiosity {
    /// Solves the balance of light, unless its solution is given. Breaks if the observer cancels.
    pub(crate) fn new(
        world: &World,
        settings: RadiositySettings,
        solution: Option<Arc<RadiositySolution>>,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), PreparedRadiosity>, JobError> {
        let solution = match solution {
            Some(solution) => solution,
            None => match RadiositySolution::solve(world, &settings, observer) {
                Ok(solution) => Arc::new(solution),
                Err(RadiosityError::Cancelled) => return Ok(ControlFlow::Break(())),
                Err(problem) => return Err(problem.into()),
            },
        };
        let shown = ShownSolution { solution, show: settings.show, light_samples: settings.light_samples };
        Ok(ControlFlow::Continue(PreparedRadiosity { shown, settings: second_pass(settings.show) }))
    }

    /// The classic integrator of one thread with the solution's light.
    pub(crate) fn whitted<'a>(&'a self, world: &'a World) -> Whitted<'a> {
        Whitted::new(world, self.settings).with_solution(&self.shown)
    }
}

/// The settings of the second pass. Patches and interpolated solutions have no mirrors.
fn second_pass(show: RadiosityShow) -> WhittedSettings {
    let stage = if show == RadiosityShow::Full { Stage::Full } else { Stage::Shadow };
    WhittedSettings { stage, ..WhittedSettings::DEFAULT }
}

impl PreparedRayIntegrator for PreparedRadiosity {
    type Worker<'a> = Whitted<'a>;

    fn preparation_counts(&self) -> Counts {
        let solution = &self.shown.solution;
        let mut others = vec![("patches", solution.patches().len() as u64), ("links", solution.links as u64)];
        if solution.emitters.excess > 0 {
            others.push(("emitting polygons that light as patches", solution.emitters.excess as u64));
        }
        if solution.limit_reached {
            others.push(("patch limit reached", 1));
        }
        Counts { others, ..Counts::default() }
    }

    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> Whitted<'a> {
        self.whitted(world).with_cancel(cancelled)
    }
}
