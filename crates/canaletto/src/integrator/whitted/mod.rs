//! The chapter's recursive ray tracing (box 5.8; Whitted 1980): `trace` finds the nearest surfaces, `shade` sums
//! (5.39b) there and calls `trace` for mirrors and clear bodies.
//!
//! Rays go in bundles: those of neighbouring samples are traced together, then their shadow rays to one point of light,
//! then those from their mirrors, then those into their clear bodies. A bundle of one ray takes the steps of the chapter's
//! recursion in the chapter's order, which is what a probe watches; the rays of a larger one take the same steps side by side.
//!
//! Deviations, from `chapter-decisions`: the normal faces the viewer; a shadow ray passes clear surfaces by their
//! 1 − o; beyond the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the
//! largest number ([`Rgb::saturated`]), so that no colour is ever infinite or NaN.

mod direct;
mod interaction;
mod interactions8;
mod intersect;
mod media;
mod ray_batch;
mod secondary;

use super::{Probe, RayCounts};
use crate::light::PreparedLight;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Sample, Sampler};
use crate::scene::{IntegratorSettings, Stage};
use crate::shape::SurfaceInputs8;
use crate::world::{OccluderCache, RayBundle, ShadowRays, World};
use direct::Lighting;
use interaction::{Footprint, Interaction, Interactions};
use media::Media;
use ray_batch::RayBatch;

/// The classic integrator on one world.
pub struct Whitted<'w> {
    world: &'w World,
    settings: IntegratorSettings,
    /// The rays traced so far.
    pub counts: RayCounts,
    /// Asked now and then whether to give up.
    cancelled: Option<&'w (dyn Fn(u64) -> bool + Sync)>,
    /// Whether it said so: from then on no child ray is followed, and colours are worth nothing.
    cancelled_early: bool,
    /// Rays until it is asked again.
    rays_until_poll: u32,
    /// What stood in each light's way last.
    occluders: Vec<OccluderCache>,
    /// Where random numbers come from.
    sample: Sample,
    /// When it is, from the shutter's opening at 0 to its closing at 1.
    time: f32,
    /// The world's lights at that time; empty if none of them moves.
    lights: Vec<PreparedLight>,
    /// Rays from the eye that have not been traced.
    pending: Wave,
    /// What is asked of the world.
    bundle: RayBundle,
    /// What the rays of the last stops meet.
    surface_inputs: SurfaceInputs8,
    /// Shadow rays through what is clear, kept likewise.
    shadow_rays: ShadowRays,
    /// Memory of bundles that have been shaded.
    spare: Vec<Wave>,
    /// Memory for lights.
    lighting: Lighting,
    /// The bodies that rays are in.
    media: Media,
}

/// Rays that are traced together, and where they are met.
#[derive(Default)]
struct Wave {
    ways: RayBatch,
    /// For each of them, the stop of the generation before that it comes from.
    parents: Vec<u32>,
    /// What they bring.
    colors: Vec<Rgb>,
    interactions: Interactions,
    /// Of each stop, if its way spreads.
    footprints: Vec<Footprint>,
}

/// How many rays from the eye and child rays are followed before somebody is asked whether they are still wanted.
const RAYS_PER_POLL: u32 = 4096;

/// The most rays from the eye that are traced together: their stops should stay in the nearer caches.
pub(crate) const BUNDLE: usize = 256;

impl<'w> Whitted<'w> {
    /// An integrator that has traced nothing yet.
    pub fn new(world: &'w World, settings: IntegratorSettings) -> Whitted<'w> {
        Whitted {
            world,
            settings,
            counts: RayCounts::default(),
            cancelled: None,
            cancelled_early: false,
            rays_until_poll: RAYS_PER_POLL,
            occluders: vec![OccluderCache::NONE; world.lights.len()],
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            lights: if world.lights_move() { world.lights.clone() } else { Vec::new() },
            pending: Wave::default(),
            bundle: RayBundle::default(),
            surface_inputs: SurfaceInputs8::NONE,
            shadow_rays: ShadowRays::default(),
            spare: Vec::new(),
            lighting: Lighting::default(),
            media: Media::default(),
        }
    }

    /// The same integrator, which asks now and then, with the rays traced so far, whether to give up: a single pixel between mirrors and clear bodies
    /// can take longer than anybody waits, since every level of its tree may double the rays.
    pub fn with_cancel(self, cancelled: &'w (dyn Fn(u64) -> bool + Sync)) -> Whitted<'w> {
        Whitted { cancelled: Some(cancelled), ..self }
    }

    /// Whether it gave up. The colours that it returned since are worth nothing.
    pub fn cancelled_early(&self) -> bool {
        self.cancelled_early
    }

    /// The world it traces.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// Begins a sample of a pixel: where random numbers come from until the next one, and when it is, from the shutter's
    /// opening at 0 to its closing at 1.
    #[inline]
    pub fn begin(&mut self, sample: Sample, time: f32) {
        self.sample = sample;
        if time != self.time {
            self.time = time;
            self.world.move_lights(&mut self.lights, time);
        }
    }

    /// The colour that an eye ray brings. `differential` is how it changes to the neighbouring samples, if the world
    /// [wants](World::needs_differentials) to know.
    pub fn eye<P: Probe>(
        &mut self,
        line: impl Into<DRay>,
        differential: Option<&RayDifferential>,
        probe: &mut P,
    ) -> Rgb {
        self.push_camera_rays(&[line.into()], &[self.sample], differential.copied());
        self.trace_pending(probe)[0]
    }

    /// Lets rays from the eye wait for others of their time, of which the last ones should go nearly the same way. There are as many
    /// `samples` as `lines`, and `differentials`, unless nothing wants to know them; they are as for [`Whitted::eye`].
    pub(crate) fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        self.poll(lines.len() as u32);
        self.pending.ways.push_camera_rays(lines, samples, differentials);
    }

    /// Whether as many wait as are best traced together.
    #[inline]
    pub(crate) fn is_full(&self) -> bool {
        self.pending.ways.len() >= BUNDLE
    }

    /// The colours that the waiting rays bring.
    pub(crate) fn trace_pending<P: Probe>(&mut self, probe: &mut P) -> &[Rgb] {
        if self.pending.ways.is_empty() {
            return &[];
        }
        let mut wave = std::mem::take(&mut self.pending);
        if self.world.has_clear() {
            let Whitted { world, time, media, .. } = self;
            let depth = self.settings.max_depth;
            media.clear();
            wave.ways.set_around(|line| media.around_eye(world, line.origin, *time, depth));
        }
        self.trace(&mut wave, probe);
        wave.ways.clear();
        self.pending = wave;
        &self.pending.colors
    }

    /// An empty one.
    fn wave(&mut self) -> Wave {
        let mut wave = self.spare.pop().unwrap_or_default();
        wave.ways.clear();
        wave.parents.clear();
        wave
    }

    /// Box 5.8, `trace`: the colours of the nearest surfaces, or the background. With a probe there is one ray.
    fn trace<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        debug_assert!(!P::ACTIVE || wave.ways.len() == 1);
        self.intersect(wave, probe);
        if wave.interactions.len() == 0 || self.cancelled_early {
            return;
        }
        self.shade(wave, probe);
        for interaction in wave.interactions.all_mut() {
            let (overlay, share) = interaction.material.overlay;
            if share > 0.0 {
                probe.overlay(overlay, share);
                interaction.color = (overlay * share + interaction.color * (1.0 - share)).saturated();
            }
        }
        self.pass(wave, probe);
        for interaction in wave.interactions.each() {
            wave.colors[interaction.way()] = interaction.color;
            probe.end(interaction.color);
        }
    }

    /// Box 5.8, `shade`: (5.39b), as far as the stage goes.
    fn shade<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        let stage = self.settings.stage;
        // Under an opaque print nothing is seen of the rest.
        let seen = |interaction: &&mut Interaction| interaction.is_seen();
        if stage == Stage::Unlit {
            for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
                interaction.color = interaction.material.phong.kd;
                probe.unlit(interaction.color);
            }
            return;
        }
        if stage >= Stage::Ambient {
            for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
                let ambient = (self.world.ambient * interaction.material.phong.kd).saturated(); // (5.33)
                probe.ambient(ambient);
                interaction.color += ambient;
            }
        }
        self.light(wave, probe);
        if stage >= Stage::Reflection {
            self.reflect(wave, probe);
        }
        if stage >= Stage::Full {
            self.refract(wave, probe);
        }
        for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
            interaction.color = interaction.color.saturated();
        }
    }

    /// Asks now and then whether to give up; before this many rays.
    #[inline]
    fn poll(&mut self, rays: u32) {
        if let Some(rays_until_poll) = self.rays_until_poll.checked_sub(rays) {
            self.rays_until_poll = rays_until_poll;
        } else {
            self.rays_until_poll = RAYS_PER_POLL;
            self.cancelled_early |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
    }
}
