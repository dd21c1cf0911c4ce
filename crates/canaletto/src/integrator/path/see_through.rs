//! Shadow rays that pass surfaces: holes and partial coverage, boundaries of media, and for lights clear bodies.
//!
//! A path that is scattered towards an emitter passes the same surfaces, so that both find the same light and can be
//! weighted against each other.

use super::PathTracer;
use super::direct::{PAST_EMITTER, ShadowRay};
use super::light_sampler::Source;
use super::trace::MAX_PASSED;
use crate::integrator::media::NONE;
use crate::integrator::visible_hit::{Frame, VisibleHit, visible_hit};
use crate::integrator::whitted::BEFORE_LIGHT;
use crate::math::Rgb;

/// A smaller share of a light counts as zero.
const LEAST_PASSED: f32 = 1.0 / (1u64 << 40) as f32;

impl PathTracer<'_> {
    /// The share of a sampled source's light that passes what lies between.
    pub(super) fn visible_through(&mut self, shadow: &ShadowRay) -> Rgb {
        if shadow.t_max < 0.0 {
            return Rgb::WHITE;
        }
        let mark = self.media.mark();
        let seen = self.see(shadow);
        self.media.release(mark);
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(seen.is_none());
        seen.unwrap_or(Rgb::BLACK)
    }

    /// What is left of the light of a shadow ray's source; none if something hides it.
    fn see(&mut self, shadow: &ShadowRay) -> Option<Rgb> {
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
        if met.material.coverage < 1.0 {
            *passed *= 1.0 - if is_light { met.material.opacity_with_coverage() } else { met.material.coverage };
            let beyond = self.media.crossing(met.crossing).map(|crossing| [crossing.beyond, crossing.next]);
            return Some(beyond.unwrap_or([met.inside, NONE]));
        }
        let vertex = self.vertex(met, frame, None);
        let crossing = vertex.crossing?;
        if !vertex.is_index_matched() {
            if !is_light {
                return None;
            }
            *passed *= 1.0 - met.material.phong().opacity;
        }
        Some([crossing.beyond, crossing.next])
    }
}
