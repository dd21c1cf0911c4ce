//! Next-event estimation: the light of one sampled source at a surface of a path.
//!
//! Sampling the source and asking whether it is seen are two steps, so that the shadow rays of many paths can be traced
//! together.

use super::emitter::EmitterSample;
use super::light_sampler::{GroupChoice, Source};
use super::light_tree::Receiver;
use super::vertex::Vertex;
use super::{PathEvent, PathTracer, SampledSource, SourceSample};
use crate::integrator::Probe;
use crate::integrator::media::NONE;
use crate::integrator::shading::BEFORE_LIGHT;
use crate::light::LightSample;
use crate::light::environment::EnvironmentSample;
use crate::math::{DRay, Rgb};
use crate::world::{Hit, Occlusion};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

/// The end of a ray to a sampled point of an emitter, whose distance it is measured in. The point's own rounding is
/// less.
pub(super) const PAST_EMITTER: f32 = 1.0 + 1e-3;

/// A point of a source that lights a point.
pub(super) struct SourcePoint {
    /// The unit direction to it.
    pub(super) wi: DVec3,
    /// None if it is infinitely far.
    pub(super) position: Option<DVec3>,
    /// Its radiance towards the lit point; of a light without a surface, its intensity.
    pub(super) radiance: Rgb,
    /// The density of the direction, times the probability of the source.
    pub(super) pdf: f64,
    /// The end of its shadow ray. It is negative if nothing can hide the source.
    pub(super) t_max: f32,
    /// Whether it is one of the chapter's points, whose intensity isn't a power.
    pub(super) is_point_light: bool,
}

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
    /// The bodies that the ray starts in, and the coinciding surface at its origin, where shadow rays may pass any.
    pub(super) inside: [u32; 2],
}

impl PathTracer<'_> {
    /// The choice among groups of sources for the point of a lane.
    pub(super) fn choice(&mut self, lane: usize, to: &Receiver) -> GroupChoice {
        self.lights.choice(self.world, to, &mut self.blocks[lane])
    }

    /// The source that the numbers choose at a surface. None if the surface sends none of its light back.
    pub(super) fn sample_source<P: Probe + ?Sized>(
        &mut self,
        vertex: &Vertex,
        (to, choice): (&Receiver, &GroupChoice),
        u_source: f64,
        u: [f64; 2],
        probe: &mut P,
    ) -> Option<ShadowRay> {
        let (source, chosen) = self.lights.sample(self.world, to, choice, u_source)?;
        let point = self.source_point(to, (source, chosen), u)?;
        let SourcePoint { wi, position, radiance, pdf, t_max, is_point_light } = point;
        let (f, scattering_pdf) = vertex.towards_source(wi, is_point_light, source.is_found_by_rays());
        if f.is_black() || !f.is_finite() {
            return None;
        }
        let sample = SourceSample {
            source: self.sampled(source),
            to: position.map_or(wi, |position| position - vertex.position()),
            is_infinite: position.is_none(),
            f,
            radiance,
            pdf,
            scattering_pdf,
        };
        let inside =
            if self.sees_through || self.world.has_clear() { self.inside_after(vertex, sample.to)? } else { [NONE; 2] };
        probe.path(PathEvent::Sampled(&sample));
        let ray = shadow_ray(vertex.ray(&vertex.line(wi)).origin, wi, position);
        Some(ShadowRay { source, ray, t_max, light: sample.light(), line: vertex.line(sample.to), inside })
    }

    /// A point of a source that sends light, with the probability of the source. The choice of the environment must be
    /// the last one that [`PathTracer::choice`] made for the first lane.
    pub(super) fn source_point(
        &self,
        to: &Receiver,
        (source, chosen): (Source, f64),
        u: [f64; 2],
    ) -> Option<SourcePoint> {
        let point = match source {
            Source::Light(number) => {
                let light = self.light(number);
                let LightSample { wi, position, li, pdf, is_delta, .. } = light.sample(to.point, u)?;
                let end = if position.is_some() { BEFORE_LIGHT } else { f32::INFINITY };
                let t_max = if light.light.shadows { end } else { f32::NEG_INFINITY };
                let is_point_light = is_delta && self.lights.sun != Some(number);
                SourcePoint { wi, position, radiance: li, pdf: pdf * chosen, t_max, is_point_light }
            }
            Source::Emitter(number) => {
                let emitter = &self.lights.emitters.all[number as usize];
                let sample = emitter.sample_from(self.world, self.time, to.point, u)?;
                let EmitterSample { point, wi, radiance, pdf } = sample;
                let (pdf, t_max) = (pdf * chosen, emitter.shadow_end());
                SourcePoint { wi, position: Some(point), radiance, pdf, t_max, is_point_light: false }
            }
            Source::Environment => {
                let sample = self.lights.environment.as_ref()?.sample(&self.blocks[0], u);
                let radiance = self.world.environment.as_ref()?.radiance_of_sample(&sample);
                let EnvironmentSample { wi, pdf, .. } = sample;
                let (pdf, t_max) = (pdf * chosen, f32::INFINITY);
                SourcePoint { wi, position: None, radiance, pdf, t_max, is_point_light: false }
            }
        };
        (!point.radiance.is_black()).then_some(point)
    }

    /// What a source is outside of path tracing.
    fn sampled(&self, source: Source) -> SampledSource {
        match source {
            Source::Light(number) => SampledSource::Light(number),
            Source::Emitter(number) => {
                let [instance, primitive] = self.lights.emitters.all[number as usize].first_primitive();
                SampledSource::Surface { instance, primitive }
            }
            Source::Environment => SampledSource::Environment,
        }
    }

    /// The share of a sampled source's light that passes what lies between, by a shadow ray of its own.
    pub(super) fn visible(&mut self, shadow: &ShadowRay) -> Rgb {
        if shadow.t_max < 0.0 {
            return Rgb::WHITE;
        }
        if self.lights.is_hidden_by_any(shadow.source) {
            let occlusion = self.world.occlusion(&shadow.ray, shadow.t_max, self.time, &mut self.occluder);
            self.visible_past(shadow, occlusion)
        } else {
            let hit = self.world.intersect_at(&shadow.ray, shadow.t_max, self.time);
            self.visible_at(shadow, hit)
        }
    }

    /// The share of the light of a source that [any hit hides](LightSampler::is_hidden_by_any), past what lies between.
    pub(super) fn visible_past(&mut self, shadow: &ShadowRay, occlusion: Occlusion) -> Rgb {
        if shadow.t_max < 0.0 {
            return Rgb::WHITE;
        }
        let is_light = matches!(shadow.source, Source::Light(_));
        let passed = match occlusion {
            Occlusion::Opaque => Rgb::BLACK,
            // Bodies that cast no shadow may be filled with a medium.
            Occlusion::Nothing if is_light && !self.has_media => Rgb::WHITE,
            Occlusion::Nothing if !is_light && (!self.sees_through || shadow.inside == [NONE; 2]) => Rgb::WHITE,
            Occlusion::Clear if !is_light && !self.sees_through => Rgb::BLACK,
            Occlusion::Nothing | Occlusion::Clear => return self.visible_through(shadow),
        };
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(passed.is_black());
        passed
    }

    /// The share of the light of another source, by the first hit of its shadow ray. It is white or
    /// black, unless the ray begins in a body, or something that lets light through is hit first.
    pub(super) fn visible_at(&mut self, shadow: &ShadowRay, hit: Option<Hit>) -> Rgb {
        let is_opaque = |hit: Hit| self.world.material(&hit).is_opaque();
        if self.sees_through && (shadow.inside != [NONE; 2] || !hit.is_none_or(is_opaque)) {
            return self.visible_through(shadow);
        }
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

/// The ray to a point of a source, or in its direction, from an origin that was moved off the surface.
#[inline(always)]
pub(super) fn shadow_ray(origin: Vec3, wi: DVec3, position: Option<DVec3>) -> Ray {
    let direction = match position {
        Some(position) => position - origin.as_dvec3(),
        None => wi,
    };
    Ray { origin, direction: direction.as_vec3() }
}
