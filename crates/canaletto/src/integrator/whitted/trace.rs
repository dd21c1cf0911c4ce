//! Box 5.8: the chapter's recursive ray tracing, one ray after the other. Pictures are made by [`wave`](super::wave),
//! which takes the same steps for many rays side by side; both give equal bits.

use super::Whitted;
use super::interaction::SurfaceInteraction;
use super::ray_state::RayState;
use crate::integrator::Probe;
use crate::math::Rgb;
use crate::scene::Stage;

impl Whitted<'_> {
    /// `trace`: the colour along a ray.
    pub(super) fn trace<P: Probe + ?Sized>(&mut self, ray: &RayState, probe: &mut P) -> Rgb {
        probe.ray(ray.path_state.kind, &ray.ray, ray.path_state.depth, ray.path_state.attenuation);
        let Some(visible_hit) = self.intersect(ray, probe) else {
            let background = self.background(ray, probe);
            probe.miss(background);
            probe.end(background);
            return background;
        };
        let at = SurfaceInteraction::new(&visible_hit, ray);
        probe.hit(at.hit, &visible_hit.surface, at.material, at.frame.outside);
        let mut color = self.shade_under_overlay(&at, probe);
        let coverage = at.material.coverage;
        if coverage < 1.0 {
            probe.coverage(coverage);
            color = (color * coverage + self.follow(&at, Self::passed_ray, probe)).saturated();
        }
        probe.end(color);
        color
    }

    /// [`Whitted::shade`] under the material's overlay.
    pub(super) fn shade_under_overlay<P: Probe + ?Sized>(&mut self, at: &SurfaceInteraction, probe: &mut P) -> Rgb {
        let color = self.shade(at, probe);
        let (overlay, share) = at.material.overlay;
        if share > 0.0 {
            probe.overlay(overlay, share);
        }
        at.material.under_overlay(color)
    }

    /// `shade`: (5.39b), up to the stage of the settings. Under an opaque overlay nothing of it is visible.
    fn shade<P: Probe + ?Sized>(&mut self, at: &SurfaceInteraction, probe: &mut P) -> Rgb {
        let (stage, phong, mut color) = (self.settings.stage, &at.material.classic, Rgb::BLACK);
        if !at.material.is_seen() || self.is_cancelled {
            return color;
        }
        if stage == Stage::Unlit {
            probe.unlit(phong.kd);
            return phong.kd;
        }
        if stage >= Stage::Ambient {
            let ambient = (self.ambient(at) * phong.kd).saturated(); // (5.33)
            probe.ambient(ambient);
            color += ambient;
        }
        if let Some(term) = self.emitters(at) {
            probe.emitters(&term);
            color = (color + term.contribution).saturated();
        }
        let emission = at.material.emitted(at.frame.outside);
        if !emission.is_black() {
            probe.emission(emission);
            color = (color + emission).saturated();
        }
        for light in 0..self.light_count() {
            for point in 0..self.world.lights[light as usize].points() {
                color = (color + self.light(at, light, point, probe)).saturated(); // (5.39a)
            }
        }
        if stage >= Stage::Reflection && at.material.is_mirror() {
            color += self.follow(at, Self::reflected_ray, probe); // k trace(p, r)
        }
        if stage >= Stage::Full && at.material.is_clear() {
            color += self.follow(at, Self::refracted_ray, probe); // (1 − o) trace(p, t)
        }
        color.saturated()
    }

    /// The light along a child ray, times the ray's factor; black if the tree ends at this surface.
    fn follow<P: Probe + ?Sized>(
        &mut self,
        at: &SurfaceInteraction,
        child: impl Fn(&mut Self, &SurfaceInteraction, &mut P) -> Option<RayState>,
        probe: &mut P,
    ) -> Rgb {
        let mark = self.media.mark();
        let color = match child(self, at, probe) {
            Some(ray) => (self.trace(&ray, probe) * ray.path_state.attenuation).saturated(),
            None => Rgb::BLACK,
        };
        self.media.release(mark);
        color
    }
}
