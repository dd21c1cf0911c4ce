//! Next-event estimation: the light of one sampled source at a surface of a path.
//!
//! Sampling the source and asking whether it is seen are two steps, so that the shadow rays of many paths can be traced
//! together.

use super::emitter::EmitterSample;
use super::light_sampler::Source;
use super::light_tree::Receiver;
use super::trace::Vertex;
use super::{PathEvent, PathTracer, SampledSource, SourceSample};
use crate::integrator::Probe;
use crate::integrator::media::NONE;
use crate::integrator::whitted::BEFORE_LIGHT;
use crate::light::LightSample;
use crate::math::{DRay, Rgb};
use crate::world::{Hit, Occlusion};
use canaletto_bvh::Ray;
use glam::DVec3;

/// The end of a ray to a sampled point of an emitter, whose distance it is measured in. The point's own rounding is
/// less.
pub(super) const PAST_EMITTER: f32 = 1.0 + 1e-3;

/// The ray that asks whether a sampled source is seen.
pub(super) struct ShadowRay {
    pub(super) source: Source,
    pub(super) ray: Ray,
    /// The end of the ray. It is negative if nothing can hide the source.
    pub(super) t_max: f32,
    /// The light that the vertex sends back if nothing hides the source, with its weight.
    pub(super) light: Rgb,
    /// The ray before rounding. At its parameter 1 is the sampled point, if the source isn't infinitely far.
    pub(super) line: DRay,
    /// The bodies that the ray starts in, and the coinciding surface at its origin, where shadow rays pass surfaces.
    pub(super) inside: [u32; 2],
}

impl PathTracer<'_> {
    /// The source that the numbers choose at a surface. None if the surface sends none of its light back.
    pub(super) fn sample_source<P: Probe>(
        &mut self,
        vertex: &Vertex,
        u_source: f64,
        u: [f64; 2],
        probe: &mut P,
    ) -> Option<ShadowRay> {
        if vertex.is_delta() {
            return None;
        }
        let (source, chosen) = self.lights.sample(self.world, &vertex.receiver(), u_source)?;
        let (sample, ray, t_max) = match source {
            Source::Light(number) => self.sample_light(vertex, number, u, chosen),
            Source::Emitter(number) => self.sample_emitter(vertex, number, u, chosen),
            Source::Environment => self.sample_environment(vertex, u, chosen),
        }?;
        let inside = if self.sees_through { self.inside_after(vertex, sample.to)? } else { [NONE; 2] };
        probe.path(PathEvent::Sampled(&sample));
        let line = vertex.line(sample.to);
        Some(ShadowRay { source, ray, t_max, light: sample.light(), line, inside })
    }

    /// A light that no ray hits, with its shadow ray and the end of that.
    fn sample_light(&self, vertex: &Vertex, number: u32, u: [f64; 2], chosen: f64) -> Option<(SourceSample, Ray, f32)> {
        let light = self.light(number);
        let LightSample { wi, position, li, pdf, .. } = light.sample(vertex.position(), u)?;
        let f = reflected(vertex, wi, li)?;
        let ray = vertex.ray(&vertex.line(wi));
        let (direction, end) = match position {
            Some(position) => ((position - ray.origin.as_dvec3()).as_vec3(), BEFORE_LIGHT),
            None => (wi.as_vec3(), f32::INFINITY),
        };
        let sample = SourceSample {
            source: SampledSource::Light(number),
            to: position.map_or(wi, |position| position - vertex.position()),
            is_infinite: position.is_none(),
            f,
            radiance: li,
            pdf: pdf * chosen,
            scattering_pdf: None,
        };
        let t_max = if light.light.shadows { end } else { f32::NEG_INFINITY };
        Some((sample, Ray::new(ray.origin, direction), t_max))
    }

    /// A point of an emitting surface.
    fn sample_emitter(
        &self,
        vertex: &Vertex,
        number: u32,
        u: [f64; 2],
        chosen: f64,
    ) -> Option<(SourceSample, Ray, f32)> {
        let from = vertex.position();
        let emitter = &self.lights.emitters.all[number as usize];
        let EmitterSample { point, radiance, pdf } = emitter.sample_from(self.world, self.time, from, u)?;
        let wi = (point - from).try_normalize()?;
        let f = reflected(vertex, wi, radiance)?;
        let start = vertex.ray(&vertex.line(wi)).origin;
        let [instance, primitive] = emitter.first_primitive();
        let sample = SourceSample {
            source: SampledSource::Surface { instance, primitive },
            to: point - from,
            is_infinite: false,
            f,
            radiance,
            pdf: pdf * chosen,
            scattering_pdf: Some(vertex.pdf(wi)),
        };
        Some((sample, Ray::new(start, (point - start.as_dvec3()).as_vec3()), PAST_EMITTER))
    }

    /// A direction to the environment.
    fn sample_environment(&self, vertex: &Vertex, u: [f64; 2], chosen: f64) -> Option<(SourceSample, Ray, f32)> {
        let (wi, pdf) = {
            let Receiver { normal, two_sided, .. } = vertex.receiver();
            self.lights.environment.as_ref()?.sample(normal, two_sided, u)
        };
        let radiance = self.world.environment.as_ref()?.radiance_without_sun(wi, [DVec3::ZERO; 2]);
        let sample = SourceSample {
            source: SampledSource::Environment,
            to: wi,
            is_infinite: true,
            f: reflected(vertex, wi, radiance)?,
            radiance,
            pdf: pdf * chosen,
            scattering_pdf: Some(vertex.pdf(wi)),
        };
        Some((sample, vertex.ray(&vertex.line(wi)), f32::INFINITY))
    }

    /// The share of a sampled source's light that passes what lies between, by a shadow ray of its own.
    pub(super) fn visible(&mut self, shadow: &ShadowRay) -> Rgb {
        if shadow.t_max < 0.0 {
            return Rgb::WHITE;
        }
        if self.sees_through {
            return self.visible_through(shadow);
        }
        match shadow.source {
            Source::Light(_) => {
                let occlusion = self.world.occlusion(&shadow.ray, shadow.t_max, self.time, &mut self.occluder);
                self.visible_past(shadow, occlusion)
            }
            Source::Emitter(_) | Source::Environment => {
                let hit = self.world.intersect_at(&shadow.ray, shadow.t_max, self.time);
                self.visible_at(shadow, hit)
            }
        }
    }

    /// The share of the light of a light that no ray hits, past what lies between.
    pub(super) fn visible_past(&mut self, shadow: &ShadowRay, occlusion: Occlusion) -> Rgb {
        let ShadowRay { ray, t_max, .. } = shadow;
        if *t_max < 0.0 {
            return Rgb::WHITE;
        }
        let passed = match occlusion {
            Occlusion::Nothing => 1.0,
            Occlusion::Opaque => 0.0,
            Occlusion::Clear => self.world.transmittance_past(ray, *t_max, self.time, None, occlusion, &mut ()),
        };
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(passed == 0.0);
        Rgb::gray(passed)
    }

    /// Whether an emitter or the environment is seen, by the first hit of its shadow ray: white or black.
    pub(super) fn visible_at(&mut self, shadow: &ShadowRay, hit: Option<Hit>) -> Rgb {
        self.counts.shadow.traced += 1;
        let is_seen = match (shadow.source, hit) {
            (Source::Environment, None) => true,
            (Source::Emitter(number), Some(hit)) => {
                hit.t > 2.0 - PAST_EMITTER && self.lights.emitters.of_hit(&hit) == Some(number)
            }
            _ => false,
        };
        self.counts.shadow.hit += u64::from(!is_seen);
        if is_seen { Rgb::WHITE } else { Rgb::BLACK }
    }
}

/// f |cos θ| of a direction to a light; none if nothing of this light is scattered.
fn reflected(vertex: &Vertex, wi: DVec3, light: Rgb) -> Option<Rgb> {
    if light.is_black() {
        return None;
    }
    let f = vertex.eval(wi);
    (!f.is_black() && f.is_finite()).then_some(f)
}
