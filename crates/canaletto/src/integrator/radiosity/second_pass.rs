//! The second pass: a picture of a solution by the classic integrator (fig. 5.38). The solution's light takes the place
//! of ambient light.

use super::{RadiosityError, RadiositySolution};
use crate::integrator::whitted::DiffuseLight;
use crate::integrator::{Cancelled, Counts, PreparedRayIntegrator, Whitted};
use crate::job::{JobError, Observer};
use crate::math::Rgb;
use crate::scene::{RadiositySettings, RadiosityShow, Stage, WhittedSettings};
use crate::world::{Hit, World};
use glam::DVec3;
use std::ops::ControlFlow;

/// A solution with the part of it that is shown.
struct ShownSolution {
    solution: RadiositySolution,
    show: RadiosityShow,
}

impl DiffuseLight for ShownSolution {
    fn takes_lights(&self) -> bool {
        self.show == RadiosityShow::Full
    }

    fn light_at(&self, hit: &Hit, point: DVec3, outside: bool) -> Rgb {
        let light = match self.show {
            RadiosityShow::Patches => {
                let patch = self.solution.patch_at(hit.instance, hit.primitive, hit.part, outside, point);
                patch.map(|patch| {
                    let patch = &self.solution.patches()[patch];
                    patch.direct + patch.indirect
                })
            }
            RadiosityShow::Solution => {
                let light = self.solution.light_at(hit.instance, hit.primitive, hit.part, outside, point);
                light.map(|light| light.direct + light.indirect)
            }
            RadiosityShow::Full => {
                let light = self.solution.light_at(hit.instance, hit.primitive, hit.part, outside, point);
                light.map(|light| light.indirect)
            }
        };
        Rgb::from(light.unwrap_or_default().to_array().map(|v| v as f32)).saturated()
    }
}

/// Radiosity that is solved and ready to be seen.
pub(crate) struct PreparedRadiosity {
    shown: ShownSolution,
    settings: WhittedSettings,
}

impl PreparedRadiosity {
    /// Solves the balance of light. Breaks if the observer cancels.
    pub(crate) fn new(
        world: &World,
        settings: RadiositySettings,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), PreparedRadiosity>, JobError> {
        let solution = match RadiositySolution::solve(world, &settings, observer) {
            Ok(solution) => solution,
            Err(RadiosityError::Cancelled) => return Ok(ControlFlow::Break(())),
            Err(RadiosityError::NoThreads(problem)) => return Err(problem.into()),
            Err(problem) => return Err(JobError::Radiosity(problem.to_string())),
        };
        Ok(ControlFlow::Continue(PreparedRadiosity {
            shown: ShownSolution { solution, show: settings.show },
            settings: second_pass(settings.show),
        }))
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
        if solution.limit_reached {
            others.push(("patch limit reached", 1));
        }
        Counts { others, ..Counts::default() }
    }

    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> Whitted<'a> {
        self.whitted(world).with_cancel(cancelled)
    }
}
