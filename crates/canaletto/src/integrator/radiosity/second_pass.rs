//! The second pass: a picture of a solution by the classic integrator (fig. 5.38). The solution's light takes the place
//! of ambient light.

use super::{ArrivingLight, RadiosityError, RadiositySolution, Transport};
use crate::integrator::shading::{DiffuseLight, EmitterReceiver};
use crate::integrator::{Cancelled, Counts, EmittersTerm, PreparedRayIntegrator, Whitted};
use crate::job::{JobError, Observer};
use crate::math::Rgb;
use crate::scene::{RadiositySettings, RadiosityShow, Stage, WhittedSettings};
use crate::world::{Hit, World};
use glam::DVec3;
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The part of a solution's light that stands for ambient light at a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ShownLight {
    /// All light.
    All,
    /// All but the light of the scene's lights, which the picture has from its own rays.
    FromSurfaces,
    /// Only light of reflections and of the environment. Emitting surfaces are lights of the picture, too.
    Indirect,
}

impl ShownLight {
    /// The part of light that is shown.
    pub fn of(self, light: &ArrivingLight) -> DVec3 {
        match self {
            ShownLight::All => light.sum(),
            ShownLight::FromSurfaces => light.from_emitters + light.indirect,
            ShownLight::Indirect => light.indirect,
        }
    }
}

/// A solution with the part of it that is shown.
struct ShownSolution {
    solution: Arc<RadiositySolution>,
    shown: ShownLight,
    /// Whether light is interpolated between patches.
    is_interpolated: bool,
    /// Whether the classic integrator adds its own terms.
    is_full: bool,
    /// The shadow rays to emitters at each hit.
    light_samples: u32,
}

impl DiffuseLight for ShownSolution {
    fn takes_lights(&self) -> bool {
        self.is_full
    }

    fn light_at(&self, hit: &Hit, point: DVec3, outside: bool) -> Rgb {
        let light = if self.is_interpolated {
            self.solution.light_at(hit.instance, hit.primitive, hit.part, outside, point)
        } else {
            let patch = self.solution.patch_at(hit.instance, hit.primitive, hit.part, outside, point);
            patch.map(|patch| self.solution.patches()[patch].arriving())
        };
        let light = light.map_or(DVec3::ZERO, |light| self.shown.of(&light));
        Rgb::from(light.to_array().map(|v| v as f32)).saturated()
    }

    fn emitters_at(&self, receiver: &EmitterReceiver) -> Option<EmittersTerm> {
        if self.shown != ShownLight::Indirect {
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
    /// What the solution falls short of.
    warnings: Vec<String>,
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
            Some(solution) => ControlFlow::Continue(solution),
            None => or_cancelled(RadiositySolution::solve(world, &settings, observer))?.map_continue(Arc::new),
        };
        Ok(solution.map_continue(|solution| PreparedRadiosity::of(world, solution, &settings)))
    }

    /// [`PreparedRadiosity::new`] that keeps how light goes from patch to patch.
    pub(crate) fn with_transport<'w>(
        world: &'w World,
        settings: RadiositySettings,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), (PreparedRadiosity, Transport<'w>)>, JobError> {
        let solved = RadiositySolution::solve_with_transport(world, &settings, observer);
        let prepared = |(solution, transport)| (PreparedRadiosity::of(world, Arc::new(solution), &settings), transport);
        Ok(or_cancelled(solved)?.map_continue(prepared))
    }

    fn of(world: &World, solution: Arc<RadiositySolution>, settings: &RadiositySettings) -> PreparedRadiosity {
        let RadiositySettings { show, light_samples, .. } = *settings;
        let has_emitters = !solution.emitters.is_empty();
        let shown = match show {
            RadiosityShow::Full if has_emitters => ShownLight::Indirect,
            RadiosityShow::Full => ShownLight::FromSurfaces,
            RadiosityShow::Patches | RadiosityShow::Solution => ShownLight::All,
        };
        let is_interpolated = show != RadiosityShow::Patches;
        let is_full = show == RadiosityShow::Full;
        PreparedRadiosity {
            warnings: solution.warnings(world, settings),
            shown: ShownSolution { solution, shown, is_interpolated, is_full, light_samples },
            settings: second_pass(show),
        }
    }

    /// The solution, the part of its light that is shown, and whether that is interpolated between patches.
    pub(crate) fn shown(&self) -> (&RadiositySolution, ShownLight, bool) {
        (&self.shown.solution, self.shown.shown, self.shown.is_interpolated)
    }

    /// The classic integrator of one thread with the solution's light.
    pub(crate) fn whitted<'a>(&'a self, world: &'a World) -> Whitted<'a> {
        Whitted::new(world, self.settings).with_solution(&self.shown)
    }
}

fn or_cancelled<T>(solved: Result<T, RadiosityError>) -> Result<ControlFlow<(), T>, JobError> {
    match solved {
        Ok(solved) => Ok(ControlFlow::Continue(solved)),
        Err(RadiosityError::Cancelled) => Ok(ControlFlow::Break(())),
        Err(problem) => Err(problem.into()),
    }
}

/// The settings of the second pass. Patches and interpolated solutions have no mirrors.
fn second_pass(show: RadiosityShow) -> WhittedSettings {
    let stage = if show == RadiosityShow::Full { Stage::Full } else { Stage::Shadow };
    WhittedSettings { stage, ..WhittedSettings::DEFAULT }
}

impl PreparedRayIntegrator for PreparedRadiosity {
    type Worker<'a> = Whitted<'a>;

    fn radiosity(&self) -> Option<&PreparedRadiosity> {
        Some(self)
    }

    fn preparation_counts(&self) -> Counts {
        let solution = &self.shown.solution;
        let mut others = vec![("patches", solution.patches().len() as u64), ("links", solution.links as u64)];
        if solution.emitters.excess > 0 {
            others.push(("emitting polygons that light as patches", solution.emitters.excess as u64));
        }
        Counts { others, warnings: self.warnings.clone(), ..Counts::default() }
    }

    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> Whitted<'a> {
        self.whitted(world).with_cancel(cancelled)
    }
}
