//! Waves: rays of box 5.8 side by side, with their interactions and colours. Their surfaces and the light that arrives
//! there are found for eight at once.

mod direct;
mod fragments;
mod interactions;
mod interactions8;
mod intersect;
mod ray_batch;

use super::Whitted;
use super::interaction::SurfaceInteraction;
use super::ray_state::RayState;
use crate::integrator::visible_hit::Footprint;
use crate::integrator::{Probe, RayCounts, RayIntegrator};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::shape::SurfaceInputs8;
use crate::world::{RayBundle, ShadowRays, World};
use direct::Lighting;
use interactions::Interactions;
use ray_batch::RayBatch;

/// The most camera rays that are traced together. Their interactions should fit the nearer caches.
const BATCH_SIZE: usize = 256;

/// The buffers of the waves of one thread.
pub(super) struct Waves {
    /// Camera rays that wait to be traced.
    pending: Wave,
    /// The rays of the current query and its results.
    bundle: RayBundle,
    /// The inputs of surface evaluation for the last interactions.
    surface_inputs: SurfaceInputs8,
    /// Shadow rays that cross clear surfaces.
    shadow_rays: ShadowRays,
    /// Waves whose memory can be reused.
    pub(super) spare: Vec<Wave>,
    /// Buffers for direct lighting.
    lighting: Lighting,
}

impl Default for Waves {
    fn default() -> Waves {
        Waves {
            pending: Wave::default(),
            bundle: RayBundle::default(),
            surface_inputs: SurfaceInputs8::NONE,
            shadow_rays: ShadowRays::default(),
            spare: Vec::new(),
            lighting: Lighting::default(),
        }
    }
}

impl Waves {
    /// An empty wave.
    pub(super) fn wave(&mut self) -> Wave {
        let mut wave = self.spare.pop().unwrap_or_default();
        wave.batch.clear();
        wave.parents.clear();
        wave
    }
}

/// Rays that are traced together, with their interactions.
#[derive(Default)]
pub(super) struct Wave {
    pub(super) batch: RayBatch,
    /// For each ray, the interaction of the parent wave that it leaves.
    pub(super) parents: Vec<u32>,
    /// The colour of each ray.
    pub(super) colors: Vec<Rgb>,
    pub(super) interactions: Interactions,
    /// The footprint at each interaction, if rays have differentials.
    footprints: Vec<Footprint>,
}

impl Wave {
    /// Adds a ray with its world and its time, and the interaction of the parent wave that it leaves.
    pub(super) fn push(&mut self, ray: RayState, (world, time): (&World, f32), parent: usize) {
        self.batch.push(ray);
        if world.moves() {
            self.batch.times.push(time);
        }
        self.parents.push(parent as u32);
    }

    /// The interaction at an index.
    #[inline]
    pub(super) fn at(&self, index: usize) -> SurfaceInteraction<'_> {
        let interaction = &self.interactions.each()[index];
        SurfaceInteraction {
            hit: &interaction.hit,
            material: &interaction.material,
            frame: self.interactions.frame(index),
            footprint: self.footprints.get(index),
            inside: interaction.inside,
            crossing: interaction.crossing,
            path_state: self.batch.path_state(interaction.ray_index()),
            sample: self.batch.sample(interaction.ray_index()),
        }
    }
}

impl<'w> RayIntegrator<'w> for Whitted<'w> {
    const BATCH_SIZE: usize = BATCH_SIZE;

    fn world(&self) -> &'w World {
        self.world
    }

    fn replace_background(&mut self, radiance: Rgb) {
        self.backdrop = Some(radiance);
    }

    fn alpha(&mut self, line: DRay) -> f32 {
        1.0 - self.seen_through(line)
    }

    #[inline]
    fn begin(&mut self, sample: Sample, time: f32) {
        Whitted::begin(self, sample, time);
    }

    fn eye(&mut self, line: DRay, differential: Option<&RayDifferential>, probe: &mut dyn Probe) -> Rgb {
        Whitted::eye(self, line, differential, probe)
    }

    fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        times: &[f32],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        self.poll(lines.len() as u32);
        self.waves.pending.batch.push_camera_rays(lines, samples, times, differentials);
    }

    #[inline]
    fn is_full(&self) -> bool {
        self.waves.pending.batch.len() >= Self::BATCH_SIZE
    }

    fn trace_pending(&mut self) -> &[Rgb] {
        if self.waves.pending.batch.is_empty() {
            return &[];
        }
        let mut wave = std::mem::take(&mut self.waves.pending);
        if self.world.has_clear() {
            let Whitted { world, media, .. } = self;
            let depth = self.settings.max_depth;
            media.clear();
            wave.batch.set_around(|line, time| media.around_eye(world, line.origin, time, depth));
        }
        self.trace(&mut wave, &mut ());
        wave.batch.clear();
        self.waves.pending = wave;
        &self.waves.pending.colors
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }

    fn counts(&mut self) -> &mut RayCounts {
        &mut self.counts
    }
}
