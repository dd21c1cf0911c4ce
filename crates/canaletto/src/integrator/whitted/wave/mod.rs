//! Box 5.8 for many rays side by side. A wave is all rays of one step: camera rays of neighbouring samples, then their
//! shadow rays to one light point, then the mirrored rays, then the refracted rays. Each ray takes the steps of
//! [`Whitted::trace`] in that order, so its colour has equal bits.

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
use crate::material::MaterialPoint;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::scene::Stage;
use crate::shape::SurfaceInputs8;
use crate::world::{RayBundle, ShadowRays, World};
use direct::Lighting;
use interactions::{Interaction, Interactions};
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
    spare: Vec<Wave>,
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
    fn wave(&mut self) -> Wave {
        let mut wave = self.spare.pop().unwrap_or_default();
        wave.batch.clear();
        wave.parents.clear();
        wave
    }
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

impl Wave {
    /// The interaction at an index.
    #[inline]
    fn at(&self, index: usize) -> SurfaceInteraction<'_> {
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

/// Whether (5.39b) adds a mirrored ray.
fn is_seen_mirror(material: &MaterialPoint) -> bool {
    material.is_seen() && material.is_mirror()
}

/// Whether (5.39b) adds a refracted ray.
fn is_seen_clear(material: &MaterialPoint) -> bool {
    material.is_seen() && material.is_clear()
}

/// Whether part of the surface is missing.
fn is_partial(material: &MaterialPoint) -> bool {
    material.coverage < 1.0
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
        self.trace_wave(&mut wave);
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

impl Whitted<'_> {
    /// `trace`: sets the colours to those of the nearest surfaces, or to the background.
    fn trace_wave(&mut self, wave: &mut Wave) {
        self.intersect_wave(wave);
        if wave.interactions.len() == 0 || self.is_cancelled {
            return;
        }
        self.shade_wave(wave);
        let mut is_any_partial = false;
        for interaction in wave.interactions.all_mut() {
            interaction.color = interaction.material.under_overlay(interaction.color);
            if is_partial(&interaction.material) {
                interaction.color *= interaction.material.coverage;
                is_any_partial = true;
            }
        }
        if is_any_partial {
            self.follow_all(wave, is_partial, |whitted, at| whitted.passed_ray(at, &mut ()));
            for interaction in wave.interactions.all_mut().iter_mut().filter(|i| is_partial(&i.material)) {
                interaction.color = interaction.color.saturated();
            }
        }
        for interaction in wave.interactions.each() {
            wave.colors[interaction.ray_index()] = interaction.color;
        }
    }

    /// `shade`: (5.39b), up to the stage of the settings.
    fn shade_wave(&mut self, wave: &mut Wave) {
        let stage = self.settings.stage;
        // The shading under an opaque overlay is not visible.
        let seen = |interaction: &&mut Interaction| interaction.is_seen();
        if stage == Stage::Unlit {
            for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
                interaction.color = interaction.material.classic.kd;
            }
            return;
        }
        if self.solution.is_some() {
            for index in 0..wave.interactions.len() {
                if wave.interactions.each()[index].is_seen() {
                    let at = wave.at(index);
                    let ambient = (self.ambient(&at) * at.material.classic.kd).saturated(); // (5.33)
                    let emitters = self.emitters(&at).map(|term| term.contribution);
                    let color = &mut wave.interactions.all_mut()[index].color;
                    *color += ambient;
                    if let Some(emitters) = emitters {
                        *color = (*color + emitters).saturated();
                    }
                }
            }
        } else if stage >= Stage::Ambient {
            for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
                interaction.color += (self.world.ambient * interaction.material.classic.kd).saturated(); // (5.33)
            }
        }
        if self.world.may_emit() {
            wave.interactions.add_emission();
        }
        self.light_wave(wave);
        if stage >= Stage::Reflection {
            self.follow_all(wave, is_seen_mirror, |whitted, at| whitted.reflected_ray(at, &mut ()));
        }
        if stage >= Stage::Full {
            self.follow_all(wave, is_seen_clear, |whitted, at| whitted.refracted_ray(at, &mut ()));
        }
        for interaction in wave.interactions.all_mut().iter_mut().filter(seen) {
            interaction.color = interaction.color.saturated();
        }
    }

    /// Traces the rays that `child` returns for the interactions whose material `has_child`, and adds their light to
    /// the interactions' colours.
    fn follow_all(
        &mut self,
        wave: &mut Wave,
        has_child: impl Fn(&MaterialPoint) -> bool,
        child: impl Fn(&mut Self, &SurfaceInteraction) -> Option<RayState>,
    ) {
        let mut children = self.waves.wave();
        let mark = self.media.mark();
        let moves = self.world.moves();
        for index in 0..wave.interactions.len() {
            if has_child(&wave.interactions.each()[index].material)
                && let Some(ray) = child(self, &wave.at(index))
            {
                children.batch.push(ray);
                if moves {
                    children.batch.times.push(wave.interactions.each()[index].hit.time);
                }
                children.parents.push(index as u32);
            }
        }
        if !children.batch.is_empty() {
            self.trace_wave(&mut children);
            for (ray_index, (color, &parent)) in children.colors.iter().zip(&children.parents).enumerate() {
                wave.interactions.all_mut()[parent as usize].color +=
                    (*color * children.batch.path_state(ray_index).attenuation).saturated();
            }
        }
        self.waves.spare.push(children);
        self.media.release(mark);
    }
}
