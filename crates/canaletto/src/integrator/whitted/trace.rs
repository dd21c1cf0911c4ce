//! Box 5.8: the chapter's recursive ray tracing. Its text is one for pictures and for probes. A [`Wave`] holds the rays
//! of one step: camera rays of neighbouring samples, then the mirrored rays from there, then the refracted rays. Each
//! takes the steps of its own ray tree, so its colour doesn't depend on the others. A probe observes a wave of one ray,
//! and hears of the steps in the order of the tree.

use super::Whitted;
use super::interaction::SurfaceInteraction;
use super::ray_state::RayState;
use super::wave::Wave;
use crate::integrator::Probe;
use crate::material::MaterialPoint;
use crate::scene::Stage;

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

impl Whitted<'_> {
    /// `trace`: sets the colours to those of the nearest surfaces, or to the background.
    pub(super) fn trace<P: Probe + ?Sized>(&mut self, wave: &mut Wave, probe: &mut P) {
        self.intersect(wave, probe);
        if wave.interactions.len() == 0 {
            return;
        }
        if !self.is_cancelled {
            self.shade(wave, probe);
        }
        let mut is_any_partial = false;
        for interaction in wave.interactions.all_mut() {
            interaction.color = interaction.under_overlay(probe);
            let coverage = interaction.material.coverage;
            if coverage < 1.0 {
                probe.coverage(coverage);
                interaction.color *= coverage;
                is_any_partial = true;
            }
        }
        if is_any_partial {
            self.follow(wave, is_partial, Self::passed_ray, probe);
            for interaction in wave.interactions.all_mut().iter_mut().filter(|i| is_partial(&i.material)) {
                interaction.color = interaction.color.saturated();
            }
        }
        for interaction in wave.interactions.each() {
            wave.colors[interaction.ray_index()] = interaction.color;
            probe.end(interaction.color);
        }
    }

    /// `shade`: (5.39b), up to the stage of the settings. Under an opaque overlay nothing of it is visible.
    pub(super) fn shade<P: Probe + ?Sized>(&mut self, wave: &mut Wave, probe: &mut P) {
        let stage = self.settings.stage;
        if stage == Stage::Unlit {
            for interaction in wave.interactions.seen_mut() {
                let kd = interaction.material.classic.kd;
                probe.unlit(kd);
                interaction.color = kd;
            }
            return;
        }
        if stage >= Stage::Ambient {
            self.add_ambient(wave, probe); // (5.33)
        }
        if self.world.may_emit() {
            wave.interactions.add_emission(probe);
        }
        self.add_lights(wave, probe); // (5.39a)
        if stage >= Stage::Reflection {
            self.follow(wave, is_seen_mirror, Self::reflected_ray, probe); // k trace(p, r)
        }
        if stage >= Stage::Full {
            self.follow(wave, is_seen_clear, Self::refracted_ray, probe); // (1 − o) trace(p, t)
        }
        for interaction in wave.interactions.seen_mut() {
            interaction.color = interaction.color.saturated();
        }
    }

    /// Traces the rays that `child` returns for the interactions whose material `has_child`, and adds their light times
    /// their factors to the interactions' colours. The tree ends where there is no ray.
    fn follow<P: Probe + ?Sized>(
        &mut self,
        wave: &mut Wave,
        has_child: impl Fn(&MaterialPoint) -> bool,
        child: impl Fn(&mut Self, &SurfaceInteraction, &mut P) -> Option<RayState>,
        probe: &mut P,
    ) {
        let mut children = self.waves.wave();
        let mark = self.media.mark();
        for index in 0..wave.interactions.len() {
            if has_child(&wave.interactions.each()[index].material)
                && let Some(ray) = child(self, &wave.at(index), probe)
            {
                children.push(ray, (self.world, wave.interactions.each()[index].hit.time), index);
            }
        }
        if !children.batch.is_empty() {
            self.trace(&mut children, probe);
            for (ray_index, (color, &parent)) in children.colors.iter().zip(&children.parents).enumerate() {
                wave.interactions.all_mut()[parent as usize].color +=
                    (*color * children.batch.path_state(ray_index).attenuation).saturated();
            }
        }
        self.waves.spare.push(children);
        self.media.release(mark);
    }

    /// The ambient light, or that of a radiosity solution and of its emitters in its place.
    fn add_ambient<P: Probe + ?Sized>(&mut self, wave: &mut Wave, probe: &mut P) {
        let Some(solution) = self.solution else {
            for interaction in wave.interactions.seen_mut() {
                let ambient = (self.world.ambient * interaction.material.classic.kd).saturated();
                probe.ambient(ambient);
                interaction.color += ambient;
            }
            return;
        };
        for index in 0..wave.interactions.len() {
            if !wave.interactions.each()[index].material.is_seen() {
                continue;
            }
            let at = wave.at(index);
            let light = solution.light_at(at.hit, at.frame.exact, at.frame.outside);
            let ambient = (light * at.material.classic.kd).saturated();
            probe.ambient(ambient);
            let emitters = self.emitters(&at);
            let color = &mut wave.interactions.all_mut()[index].color;
            *color += ambient;
            if let Some(term) = emitters {
                probe.emitters(&term);
                *color = (*color + term.contribution).saturated();
            }
        }
    }
}
