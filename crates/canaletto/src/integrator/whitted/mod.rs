//! The chapter's recursive ray tracing (box 5.8; Whitted 1980). `trace` finds the nearest surface. `shade` sums (5.39b)
//! there and calls `trace` for mirrors and clear bodies.
//!
//! [`trace`] holds the recursion as the chapter writes it, for many rays side by side, or for one with a probe that
//! observes it.
//!
//! Deviations from the chapter: the normal faces the viewer; a shadow ray passes clear surfaces by their 1 − o; beyond
//! the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the largest
//! number ([`Rgb::saturated`]), so no colour is infinite or NaN.

mod description;
mod interaction;
mod ray_state;
mod secondary;
#[cfg(test)]
mod tests;
mod trace;
mod wave;

use super::media::Media;
use super::shading::{DiffuseLight, EmitterReceiver, ShadowLookup};
use super::{Cancelled, EmittersTerm, PreparedRayIntegrator, Probe, RayCounts};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Sample, Sampler};
use crate::scene::{Stage, WhittedSettings};
use crate::world::{OccluderCache, World};
use interaction::SurfaceInteraction;

use ray_state::{PathState, RayState, uses};
use wave::Waves;

/// The classic integrator on one world.
pub struct Whitted<'w> {
    world: &'w World,
    settings: WhittedSettings,
    /// The rays traced so far.
    pub counts: RayCounts,
    /// The colour that camera rays see straight on instead of the environment or the background.
    backdrop: Option<Rgb>,
    /// What finds shadows in place of rays.
    shadow_lookup: Option<&'w dyn ShadowLookup>,
    /// Called at intervals with the number of rays traced; returns whether to cancel.
    cancelled: Option<Cancelled<'w>>,
    /// Whether `cancelled` returned true. No child ray is followed after that, and colours are meaningless.
    is_cancelled: bool,
    /// The number of rays left before the next call of `cancelled`.
    rays_until_poll: u32,
    /// The last occluder of each light's shadow rays.
    occluders: Vec<OccluderCache>,
    /// The source of random numbers.
    sample: Sample,
    /// The time of the sample, from 0 (the shutter opens) to 1 (it closes). The rays of waves have times of their own.
    time: f32,
    /// The media that rays are in.
    media: Media,
    /// The solution whose light takes the place of ambient light.
    solution: Option<&'w dyn DiffuseLight>,
    /// The rays that are traced side by side.
    waves: Waves,
}

/// The number of camera rays and child rays between two calls of the cancel callback.
const RAYS_PER_POLL: u32 = 4096;

impl<'w> Whitted<'w> {
    /// An integrator that has traced nothing yet.
    pub fn new(world: &'w World, settings: WhittedSettings) -> Whitted<'w> {
        Whitted {
            world,
            settings,
            counts: RayCounts::default(),
            backdrop: world.backdrop,
            shadow_lookup: None,
            cancelled: None,
            is_cancelled: false,
            rays_until_poll: RAYS_PER_POLL,
            occluders: vec![OccluderCache::NONE; world.lights.len()],
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            media: Media::default(),
            solution: None,
            waves: Waves::default(),
        }
    }

    /// Returns this integrator with the diffuse light of a radiosity solution in place of ambient light.
    pub(crate) fn with_solution(self, solution: &'w dyn DiffuseLight) -> Whitted<'w> {
        Whitted { solution: Some(solution), ..self }
    }

    /// The number of lights whose direct light is added.
    fn light_count(&self) -> u32 {
        let has_lights = self.solution.is_none_or(|solution| solution.takes_lights());
        if has_lights { self.world.lights.len() as u32 } else { 0 }
    }

    /// The light of emitting surfaces at an interaction, after shadows.
    fn emitters(&mut self, at: &SurfaceInteraction) -> Option<EmittersTerm> {
        let solution = self.solution?;
        let frame = &at.frame;
        let mut term = solution.emitters_at(&EmitterReceiver {
            world: self.world,
            time: at.hit.time,
            point: frame.exact,
            normal: frame.normal,
            facing: frame.facing,
            start: frame.start,
            sample: at.sample,
            dimension: at.path_state.place.of(uses::LIGHTS + self.world.lights.len() as u32),
        })?;
        self.poll(term.rays);
        self.counts.shadow.traced += u64::from(term.rays);
        self.counts.shadow.hit += u64::from(term.rays) - term.passed.ceil() as u64;
        term.contribution = (term.arriving * at.material.classic.kd).saturated(); // (5.32)
        Some(term)
    }

    /// Returns this integrator with a callback that can cancel it.
    ///
    /// The callback gets the number of rays traced so far and returns whether to cancel. Each level of a ray tree may
    /// double the rays, so a single pixel between mirrors and clear bodies can take very long.
    pub fn with_cancel(self, cancelled: &'w (dyn Fn(u64) -> bool + Sync)) -> Whitted<'w> {
        Whitted { cancelled: Some(cancelled), ..self }
    }

    /// Returns this integrator with a lookup that finds the shadows on fragments.
    pub(crate) fn with_shadows_by(self, lookup: &'w dyn ShadowLookup) -> Whitted<'w> {
        Whitted { shadow_lookup: Some(lookup), ..self }
    }

    /// Begins a sample of a pixel. `sample` supplies random numbers until the next sample. `time` runs from 0 (the
    /// shutter opens) to 1 (it closes).
    #[inline]
    pub fn begin(&mut self, sample: Sample, time: f32) {
        (self.sample, self.time) = (sample, time);
    }

    /// The colour along a camera ray. `differential` is the ray differential to the neighbouring samples; it is needed
    /// if [`World::needs_differentials`] returns true.
    pub fn eye<P: Probe + ?Sized>(
        &mut self,
        line: impl Into<DRay>,
        differential: Option<&RayDifferential>,
        probe: &mut P,
    ) -> Rgb {
        self.poll(1);
        let ray = self.eye_ray(line.into(), differential.copied());
        let mut wave = self.waves.wave();
        wave.push(ray, (self.world, self.time), 0);
        self.trace(&mut wave, probe);
        let color = wave.colors[0];
        self.waves.spare.push(wave);
        color
    }

    /// A camera ray of the current sample.
    fn eye_ray(&mut self, line: DRay, differential: Option<RayDifferential>) -> RayState {
        let mut path_state = PathState::EYE;
        if self.world.has_clear() {
            self.media.clear();
            path_state.inside = self.media.around_eye(self.world, line.origin, self.time, self.settings.max_depth);
        }
        RayState { ray: line.rounded(), line, path_state, sample: self.sample, differential }
    }

    /// The share of the background's light that reaches the eye straight on along a camera ray: past holes, partial
    /// coverage, and clear bodies of the η around them.
    fn seen_through(&mut self, line: DRay) -> f32 {
        let (mut ray, mut share) = (self.eye_ray(line, None), 1.0);
        while let Some(visible_hit) = self.seen_by(&ray) {
            if self.world.material(&visible_hit.hit).shadow_catcher {
                break;
            }
            let at = SurfaceInteraction::new(&visible_hit, &ray);
            let material = at.material;
            let (coverage, opacity) = (material.coverage, material.classic.opacity);
            let is_clear = self.settings.stage >= Stage::Full && material.is_clear() && material.is_seen();
            let refracted = if is_clear { self.refracted_ray(&at, &mut ()) } else { None };
            let straight = refracted.filter(|ray| ray.path_state.is_straight);
            let clear = straight.as_ref().map_or(0.0, |_| (1.0 - opacity) * (1.0 - material.overlay.1));
            share *= (1.0 - coverage) + coverage * clear;
            let passed = if coverage < 1.0 { self.passed_ray(&at, &mut ()) } else { straight };
            match passed.filter(|_| share > 0.0) {
                Some(passed) => ray = passed,
                None => {
                    share = 0.0;
                    break;
                }
            }
        }
        share
    }

    /// Counts `rays` towards the next call of the cancel callback, and calls it when it is due.
    #[inline]
    fn poll(&mut self, rays: u32) {
        if let Some(rays_until_poll) = self.rays_until_poll.checked_sub(rays) {
            self.rays_until_poll = rays_until_poll;
        } else {
            self.rays_until_poll = RAYS_PER_POLL;
            self.is_cancelled |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
    }
}

impl PreparedRayIntegrator for WhittedSettings {
    type Worker<'a> = Whitted<'a>;

    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> Whitted<'a> {
        Whitted::new(world, *self).with_cancel(cancelled)
    }
}
