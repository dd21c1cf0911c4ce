//! The chapter's recursive ray tracing (box 5.8; Whitted 1980). `trace` finds the nearest surfaces. `shade` sums
//! (5.39b) there and calls `trace` for mirrors and clear bodies.
//!
//! Rays are traced in batches. The rays of neighbouring samples are traced together, then their shadow rays to one
//! light point, then the mirrored rays, then the refracted rays. A batch of one ray takes the steps of the chapter's
//! recursion in the chapter's order; a probe observes such a batch. The rays of a larger batch take these steps side by
//! side.
//!
//! Deviations from the chapter: the normal faces the viewer; a shadow ray passes clear surfaces by their 1 − o; beyond
//! the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the largest
//! number ([`Rgb::saturated`]), so no colour is infinite or NaN.

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
    /// Called at intervals with the number of rays traced; returns whether to cancel.
    cancelled: Option<&'w (dyn Fn(u64) -> bool + Sync)>,
    /// Whether `cancelled` returned true. No child ray is followed after that, and colours are meaningless.
    is_cancelled: bool,
    /// The number of rays left before the next call of `cancelled`.
    rays_until_poll: u32,
    /// The last occluder of each light's shadow rays.
    occluders: Vec<OccluderCache>,
    /// The source of random numbers.
    sample: Sample,
    /// The time of the sample, from 0 (the shutter opens) to 1 (it closes).
    time: f32,
    /// The world's lights at that time; empty if no light moves.
    lights: Vec<PreparedLight>,
    /// Camera rays that wait to be traced.
    pending: Wave,
    /// The rays of the current query and its results.
    batch: RayBundle,
    /// The inputs of surface evaluation for the last interactions.
    surface_inputs: SurfaceInputs8,
    /// Shadow rays that cross clear surfaces.
    shadow_rays: ShadowRays,
    /// Waves whose memory can be reused.
    spare: Vec<Wave>,
    /// Buffers for direct lighting.
    lighting: Lighting,
    /// The media that rays are in.
    media: Media,
}

/// Rays that are traced together, with their interactions.
#[derive(Default)]
struct Wave {
    batch: RayBatch,
    /// For each ray, the interaction of the parent wave that it leaves.
    parents: Vec<u32>,
    /// The colour of each ray.
    colors: Vec<Rgb>,
    interactions: Interactions,
    /// The footprint at each interaction, if rays have differentials.
    footprints: Vec<Footprint>,
}

/// The number of camera rays and child rays between two calls of the cancel callback.
const RAYS_PER_POLL: u32 = 4096;

/// The most camera rays that are traced together. Their interactions should fit the nearer caches.
pub(crate) const BATCH_SIZE: usize = 256;

impl<'w> Whitted<'w> {
    /// An integrator that has traced nothing yet.
    pub fn new(world: &'w World, settings: IntegratorSettings) -> Whitted<'w> {
        Whitted {
            world,
            settings,
            counts: RayCounts::default(),
            cancelled: None,
            is_cancelled: false,
            rays_until_poll: RAYS_PER_POLL,
            occluders: vec![OccluderCache::NONE; world.lights.len()],
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            lights: if world.lights_move() { world.lights.clone() } else { Vec::new() },
            pending: Wave::default(),
            batch: RayBundle::default(),
            surface_inputs: SurfaceInputs8::NONE,
            shadow_rays: ShadowRays::default(),
            spare: Vec::new(),
            lighting: Lighting::default(),
            media: Media::default(),
        }
    }

    /// Returns this integrator with a callback that can cancel it.
    ///
    /// The callback gets the number of rays traced so far and returns whether to cancel. Each level of a ray tree may
    /// double the rays, so a single pixel between mirrors and clear bodies can take very long.
    pub fn with_cancel(self, cancelled: &'w (dyn Fn(u64) -> bool + Sync)) -> Whitted<'w> {
        Whitted { cancelled: Some(cancelled), ..self }
    }

    /// Whether the callback cancelled the integrator. Colours returned since then are meaningless.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }

    /// The world that this integrator traces.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// Begins a sample of a pixel. `sample` supplies random numbers until the next sample. `time` runs from 0 (the
    /// shutter opens) to 1 (it closes).
    #[inline]
    pub fn begin(&mut self, sample: Sample, time: f32) {
        self.sample = sample;
        if time != self.time {
            self.time = time;
            self.world.move_lights(&mut self.lights, time);
        }
    }

    /// The colour along a camera ray. `differential` is the ray differential to the neighbouring samples; it is needed
    /// if [`World::needs_differentials`] returns true.
    pub fn eye<P: Probe>(
        &mut self,
        line: impl Into<DRay>,
        differential: Option<&RayDifferential>,
        probe: &mut P,
    ) -> Rgb {
        self.push_camera_rays(&[line.into()], &[self.sample], differential.copied());
        self.trace_pending(probe)[0]
    }

    /// Adds camera rays to the batch that waits to be traced. All of them have one time; successive rays should have
    /// nearly equal directions. There are as many `samples` as `lines`. There are as many `differentials` too, unless
    /// nothing uses them. Each is as for [`Whitted::eye`].
    pub(crate) fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        self.poll(lines.len() as u32);
        self.pending.batch.push_camera_rays(lines, samples, differentials);
    }

    /// Whether the batch of waiting rays has reached its best size.
    #[inline]
    pub(crate) fn is_full(&self) -> bool {
        self.pending.batch.len() >= BATCH_SIZE
    }

    /// Traces the waiting rays and returns their colours.
    pub(crate) fn trace_pending<P: Probe>(&mut self, probe: &mut P) -> &[Rgb] {
        if self.pending.batch.is_empty() {
            return &[];
        }
        let mut wave = std::mem::take(&mut self.pending);
        if self.world.has_clear() {
            let Whitted { world, time, media, .. } = self;
            let depth = self.settings.max_depth;
            media.clear();
            wave.batch.set_around(|line| media.around_eye(world, line.origin, *time, depth));
        }
        self.trace(&mut wave, probe);
        wave.batch.clear();
        self.pending = wave;
        &self.pending.colors
    }

    /// An empty wave.
    fn wave(&mut self) -> Wave {
        let mut wave = self.spare.pop().unwrap_or_default();
        wave.batch.clear();
        wave.parents.clear();
        wave
    }

    /// Box 5.8, `trace`: sets the colours to those of the nearest surfaces, or to the background. With an active probe
    /// there is one ray.
    fn trace<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        debug_assert!(!P::ACTIVE || wave.batch.len() == 1);
        self.intersect(wave, probe);
        if wave.interactions.len() == 0 || self.is_cancelled {
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
            wave.colors[interaction.ray_index()] = interaction.color;
            probe.end(interaction.color);
        }
    }

    /// Box 5.8, `shade`: (5.39b), up to the stage of the settings.
    fn shade<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        let stage = self.settings.stage;
        // The shading under an opaque overlay is not visible.
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
