//! Shadow rays that pass surfaces: holes and partial coverage, and what light passes straight on: boundaries of media,
//! thin walls, sheets of η 1. A path that is scattered towards an emitter passes the same surfaces, so that both find
//! the same light and can be weighted against each other.
//!
//! Shadow rays to lights pass smooth clear bodies, too, as if these didn't bend them. The share that passes is the one
//! of a path that is refracted there. A path that goes through clear bodies finds no such light again.

use super::PathTracer;
use super::direct::{PAST_EMITTER, ShadowRay};
use super::light_sampler::Source;
use super::trace::{MAX_PASSED, Segment};
use super::vertex::{SurfaceVertex, Vertex};
use crate::integrator::media::NONE;
use crate::integrator::shading::BEFORE_LIGHT;
use crate::integrator::visible_hit::{Frame, VisibleHit, visible_hit};
use crate::math::{DRay, Rgb};

/// A smaller share of a light counts as zero.
const LEAST_PASSED: f32 = 1.0 / (1u64 << 40) as f32;

impl PathTracer<'_> {
    /// The share of a sampled source's light that passes what lies between.
    pub(super) fn visible_through(&mut self, shadow: &ShadowRay) -> Rgb {
        if shadow.t_max < 0.0 {
            return Rgb::WHITE;
        }
        let mark = self.media.mark();
        let seen = self.see(shadow, false);
        self.media.release(mark);
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(seen.is_none());
        seen.unwrap_or(Rgb::BLACK)
    }

    /// The share of the background that a camera ray hides: 1 minus what passes straight on, as the mean of red, green
    /// and blue. The light of the environment behind it would pass the same surfaces.
    pub(super) fn hidden_behind(&mut self, line: DRay) -> f32 {
        self.media.clear();
        let Segment { ray, line, inside, .. } = self.start(line, None, self.sample).segment;
        let light = Rgb::BLACK;
        let shadow = ShadowRay { source: Source::Environment, ray, t_max: f32::INFINITY, light, line, inside };
        let seen = self.see(&shadow, true);
        seen.map_or(1.0, |Rgb { r, g, b }| 1.0 - (r + g + b) / 3.0)
    }

    /// What is left of the light of a shadow ray's source; none if something hides it. Shadow catchers hide nothing of
    /// the background if they stand for it.
    fn see(&mut self, shadow: &ShadowRay, catchers_are_background: bool) -> Option<Rgb> {
        let point = shadow.t_max.is_finite().then(|| shadow.line.origin + shadow.line.direction);
        let is_light = matches!(shadow.source, Source::Light(_));
        let (mut line, mut ray, mut inside) = (shadow.line, shadow.ray, shadow.inside);
        let mut passed = Rgb::WHITE;
        for _ in 0..MAX_PASSED {
            let found = self.world.intersect_at(&ray, f32::INFINITY, self.time);
            let arriving = (line, ray, found, None);
            let met = visible_hit(self.world, &mut self.media, arriving, inside, self.time, &mut ());
            let Some(met) = met else {
                return (point.is_none() || is_light).then_some(passed);
            };
            if catchers_are_background && self.world.material(&met.hit).shadow_catcher {
                return Some(passed);
            }
            let frame = Frame::new(line.direction, &met.surface);
            let distance = line.origin.distance(frame.exact);
            let left = point.map_or(f64::INFINITY, |point| line.origin.distance(point));
            if let Some((medium, _)) = self.medium_before(&met, frame.outside) {
                passed = passed * medium.transmittance(distance.min(left));
            }
            if is_light && distance >= left * f64::from(BEFORE_LIGHT) {
                return Some(passed);
            }
            if let Source::Emitter(number) = shadow.source
                && distance > left * f64::from(2.0 - PAST_EMITTER)
            {
                let is_it =
                    self.lights.emitters.of_hit(&met.hit) == Some(number) && distance < left * f64::from(PAST_EMITTER);
                return is_it.then_some(passed);
            }
            inside = self.pass(&met, frame, is_light, &mut passed)?;
            if passed.max_component() < LEAST_PASSED {
                return None;
            }
            line = frame.leave(point.map_or(line.direction, |point| point - frame.exact));
            ray = frame.rounded(&line);
        }
        None
    }

    /// Takes a shadow ray through a surface. Returns the bodies beyond, or none if the surface hides what is behind.
    fn pass(&mut self, met: &VisibleHit, frame: Frame, is_light: bool, passed: &mut Rgb) -> Option<[u32; 2]> {
        if is_light && !self.world.casts_shadow(met.hit.instance, met.hit.primitive) {
            return Some([met.inside, NONE]);
        }
        let (coverage, wo) = (met.material.coverage, frame.wo);
        if coverage >= 1.0 && !met.material.is_clear() {
            return None;
        }
        let vertex = self.vertex(met, frame, None);
        let through = vertex.bsdf.specular_transmission();
        let mut share = Rgb::BLACK;
        if is_light || through.is_straight {
            share = self.in_all_channels(met, &vertex, through.share) * (1.0 - met.material.overlay.1);
        }
        if coverage < 1.0 {
            share = Rgb::gray(1.0 - coverage) + share * coverage;
        }
        if share.is_black() {
            return None;
        }
        *passed = *passed * share;
        let beyond = self.inside_after(&Vertex::Surface(&vertex), -wo);
        Some(beyond.unwrap_or([met.inside, NONE]))
    }

    /// The share that passes a surface by the η of each channel, where `share` is that of all of them by one η.
    fn in_all_channels(&mut self, met: &VisibleHit, vertex: &SurfaceVertex, share: Rgb) -> Rgb {
        if share.is_black() || !self.world.material(&met.hit).is_dispersive() {
            return share;
        }
        let of_channel = |channel| {
            let vertex = self.vertex(met, vertex.frame, Some(channel));
            vertex.bsdf.specular_transmission().share.to_array()[channel]
        };
        Rgb::from([0, 1, 2].map(of_channel))
    }
}

#[cfg(test)]
mod tests;
