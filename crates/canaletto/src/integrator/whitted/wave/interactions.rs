//! The interactions of a wave.

use super::interactions8::{Interactions8, LANES};
use crate::integrator::Probe;
use crate::integrator::media;
use crate::integrator::visible_hit::Frame;
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::SurfaceInputs8;
use crate::world::Hit;

/// The nearest hit of a ray, and the light that leaves it back along the ray. The surface's values are stored in groups
/// of eight; see [`Interactions::frame`].
pub(in crate::integrator::whitted) struct Interaction {
    ray_index: u32,
    pub(in crate::integrator::whitted) hit: Hit,
    pub(in crate::integrator::whitted) material: MaterialPoint,
    /// The sum of the light so far.
    pub(in crate::integrator::whitted) color: Rgb,
    /// The bodies that the ray is in.
    pub(super) inside: u32,
    /// The crossing for rays into a clear body, with the coinciding surfaces, or [`media::NONE`].
    pub(super) crossing: u32,
}

impl Interaction {
    /// An unused interaction.
    fn nowhere() -> Interaction {
        let (inside, crossing) = (media::NONE, media::NONE);
        Interaction {
            ray_index: 0,
            hit: Hit::none(0.0, 0.0),
            material: MaterialPoint::default(),
            color: Rgb::BLACK,
            inside,
            crossing,
        }
    }

    /// The index of the ray in its wave.
    #[inline]
    pub(in crate::integrator::whitted) fn ray_index(&self) -> usize {
        self.ray_index as usize
    }

    /// Whether any part of the surface's shading is visible through its overlay.
    #[inline]
    pub(super) fn is_seen(&self) -> bool {
        self.material.is_seen()
    }

    /// The sum of the light so far under the material's overlay.
    #[inline]
    pub(in crate::integrator::whitted) fn under_overlay<P: Probe + ?Sized>(&self, probe: &mut P) -> Rgb {
        let (overlay, share) = self.material.overlay;
        if share > 0.0 {
            probe.overlay(overlay, share);
        }
        self.material.under_overlay(self.color)
    }
}

/// The interactions of a wave in the order of its rays, and their surface values in groups of eight.
#[derive(Default)]
pub(in crate::integrator::whitted) struct Interactions {
    /// The interactions of the largest wave so far; the first `len` are in use.
    interactions: Vec<Interaction>,
    interactions8: Vec<Interactions8>,
    len: usize,
}

impl Interactions {
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(in crate::integrator::whitted) fn len(&self) -> usize {
        self.len
    }

    /// The group of eight of the next interaction, and its lane there.
    #[inline]
    pub(super) fn next(&mut self) -> (&mut Interactions8, usize) {
        let (number, lane) = (self.len / LANES, self.len % LANES);
        if number == self.interactions8.len() {
            self.interactions8.push(Interactions8::NOTHING);
            self.interactions.resize_with(self.interactions8.len() * LANES, Interaction::nowhere);
        }
        let interactions8 = &mut self.interactions8[number];
        if lane == 0 {
            interactions8.clear();
        }
        (interactions8, lane)
    }

    /// Adds an interaction. Its surface was stored in the lane of [`Interactions::next`], or `surface_inputs` holds its
    /// inputs. `set` sets the material.
    #[inline]
    pub(super) fn push(
        &mut self,
        ray_index: usize,
        hit: &Hit,
        surface_inputs: &mut SurfaceInputs8,
        set: impl FnOnce(&mut MaterialPoint),
    ) {
        let lane = self.len % LANES;
        let interaction = &mut self.interactions[self.len];
        (interaction.ray_index, interaction.hit, interaction.color) = (ray_index as u32, *hit, Rgb::BLACK);
        (interaction.inside, interaction.crossing) = (media::NONE, media::NONE);
        set(&mut interaction.material);
        self.interactions8[self.len / LANES].set_material(lane, &interaction.material);
        self.len += 1;
        if lane == LANES - 1 {
            self.interactions8[self.len / LANES - 1].evaluate(surface_inputs);
        }
    }

    /// The interaction that was added last.
    #[inline]
    pub(super) fn last_mut(&mut self) -> &mut Interaction {
        &mut self.interactions[self.len - 1]
    }

    /// Evaluates the last group of eight if it isn't full. Full groups are evaluated already.
    pub(super) fn evaluate(&mut self, surface_inputs: &mut SurfaceInputs8) {
        if !self.len.is_multiple_of(LANES) {
            self.interactions8[self.len / LANES].evaluate(surface_inputs);
        }
    }

    #[inline]
    pub(in crate::integrator::whitted) fn each(&self) -> &[Interaction] {
        &self.interactions[..self.len]
    }

    #[inline]
    pub(in crate::integrator::whitted) fn all_mut(&mut self) -> &mut [Interaction] {
        &mut self.interactions[..self.len]
    }

    /// The interactions whose shading is visible through their overlays.
    pub(in crate::integrator::whitted) fn seen_mut(&mut self) -> impl Iterator<Item = &mut Interaction> {
        self.all_mut().iter_mut().filter(|interaction| interaction.is_seen())
    }

    /// The groups of eight of all interactions.
    #[inline]
    pub(super) fn interactions8(&self) -> &[Interactions8] {
        &self.interactions8[..self.len.div_ceil(LANES)]
    }

    /// The interactions and their groups of eight.
    #[inline]
    pub(super) fn both(&mut self) -> (&mut [Interaction], &mut [Interactions8]) {
        (&mut self.interactions[..self.len], &mut self.interactions8[..self.len.div_ceil(LANES)])
    }

    /// Adds the light that the surfaces emit.
    pub(in crate::integrator::whitted) fn add_emission<P: Probe + ?Sized>(&mut self, probe: &mut P) {
        let (interactions, interactions8) = self.both();
        for (interactions8, interactions) in interactions8.iter().zip(interactions.chunks_mut(LANES)) {
            for (lane, interaction) in interactions.iter_mut().enumerate().filter(|(_, i)| i.is_seen()) {
                let emission = interaction.material.emitted(interactions8.is_outside(lane));
                if !emission.is_black() {
                    probe.emission(emission);
                    interaction.color = (interaction.color + emission).saturated();
                }
            }
        }
    }

    /// The frame of the interaction at an index.
    #[inline]
    pub(super) fn frame(&self, index: usize) -> Frame {
        self.interactions8[index / LANES].frame(index % LANES)
    }
}
