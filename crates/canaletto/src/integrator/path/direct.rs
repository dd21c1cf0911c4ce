//! Next-event estimation: the light of one sampled source at a surface of a path.
//!
//! Sampling the source and asking whether it is seen are two steps, so that the shadow rays of many paths can be traced
//! together.

use super::PathTracer;
use super::emitter::EmitterSample;
use super::light_sampler::Source;
use super::trace::Vertex;
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

/// A sampled source at a surface, and the ray that asks whether it is seen.
pub(super) struct ShadowRay {
    pub(super) source: Source,
    pub(super) ray: Ray,
    /// The end of the ray. It is negative if nothing can hide the source.
    pub(super) t_max: f32,
    /// The light that the surface sends back if nothing hides the source, with its weight.
    pub(super) light: Rgb,
    /// The ray before rounding. At its parameter 1 is the sampled point, if the source isn't infinitely far.
    pub(super) line: DRay,
    /// The bodies that the ray starts in, and the coinciding surface at its origin, where shadow rays pass surfaces.
    pub(super) inside: [u32; 2],
}

/// The weight of a sample whose own density is `pdf`, where another technique has density `other` (power heuristic).
pub(super) fn weight(pdf: f64, other: f64) -> f32 {
    // Densities may overflow when squared.
    let ratio = other / pdf;
    (1.0 / (1.0 + ratio * ratio)) as f32
}

impl PathTracer<'_> {
    /// The source that the numbers choose at a surface. None if the surface sends none of its light back.
    pub(super) fn sample_source(&mut self, vertex: &Vertex, u_source: f64, u: [f64; 2]) -> Option<ShadowRay> {
        if vertex.is_delta() {
            return None;
        }
        let (source, chosen) = self.lights.sample(self.world, &vertex.receiver(), u_source)?;
        let mut shadow = match source {
            Source::Light(number) => self.sample_light(vertex, number, u, chosen),
            Source::Emitter(number) => self.sample_emitter(vertex, number, u, chosen),
            Source::Environment => self.sample_environment(vertex, u, chosen),
        }?;
        if self.sees_through {
            shadow.inside = self.inside_after(vertex, shadow.line.direction)?;
        }
        Some(shadow)
    }

    /// A light that no ray hits.
    fn sample_light(&self, vertex: &Vertex, number: u32, u: [f64; 2], chosen: f64) -> Option<ShadowRay> {
        let light = self.light(number);
        let LightSample { wi, position, li, pdf, .. } = light.sample(vertex.position(), u)?;
        let f = reflected(vertex, wi, li)?;
        let mut line = vertex.line(wi);
        let ray = vertex.ray(&line);
        let (to, end) = match position {
            Some(position) => {
                line.direction = position - line.origin;
                ((position - ray.origin.as_dvec3()).as_vec3(), BEFORE_LIGHT)
            }
            None => (wi.as_vec3(), f32::INFINITY),
        };
        Some(ShadowRay {
            source: Source::Light(number),
            ray: Ray::new(ray.origin, to),
            t_max: if light.light.shadows { end } else { f32::NEG_INFINITY },
            light: f * li * (1.0 / (pdf * chosen)) as f32,
            line,
            inside: [NONE; 2],
        })
    }

    /// A point of an emitting surface.
    fn sample_emitter(&self, vertex: &Vertex, number: u32, u: [f64; 2], chosen: f64) -> Option<ShadowRay> {
        let from = vertex.position();
        let emitter = &self.lights.emitters.all[number as usize];
        let EmitterSample { point, radiance, pdf } = emitter.sample_from(self.world, self.time, from, u)?;
        let wi = (point - from).try_normalize()?;
        let f = reflected(vertex, wi, radiance)?;
        let start = vertex.ray(&vertex.line(wi)).origin;
        let pdf = pdf * chosen;
        Some(ShadowRay {
            source: Source::Emitter(number),
            ray: Ray::new(start, (point - start.as_dvec3()).as_vec3()),
            t_max: PAST_EMITTER,
            light: f * radiance * (1.0 / pdf) as f32 * weight(pdf, vertex.pdf(wi)),
            line: DRay { origin: from, direction: point - from },
            inside: [NONE; 2],
        })
    }

    /// A direction to the environment.
    fn sample_environment(&self, vertex: &Vertex, u: [f64; 2], chosen: f64) -> Option<ShadowRay> {
        let (wi, pdf) = self.lights.environment.as_ref()?.sample(u);
        let radiance = self.world.environment.as_ref()?.radiance_without_sun(wi, [DVec3::ZERO; 2]);
        let f = reflected(vertex, wi, radiance)?;
        let line = vertex.line(wi);
        let pdf = pdf * chosen;
        Some(ShadowRay {
            source: Source::Environment,
            ray: vertex.ray(&line),
            t_max: f32::INFINITY,
            light: f * radiance * (1.0 / pdf) as f32 * weight(pdf, vertex.pdf(wi)),
            line,
            inside: [NONE; 2],
        })
    }

    /// The light that a surface sends back of a sampled source, by a shadow ray of its own.
    pub(super) fn shadowed(&mut self, shadow: &ShadowRay) -> Rgb {
        if self.sees_through {
            return self.light_through(shadow);
        }
        match shadow.source {
            Source::Light(_) => {
                let occlusion = if shadow.t_max < 0.0 {
                    Occlusion::Nothing
                } else {
                    self.world.occlusion(&shadow.ray, shadow.t_max, self.time, &mut self.occluder)
                };
                self.light_past(shadow, occlusion)
            }
            Source::Emitter(_) | Source::Environment => {
                let hit = self.world.intersect_at(&shadow.ray, shadow.t_max, self.time);
                self.light_at(shadow, hit)
            }
        }
    }

    /// The light of a light that no ray hits, past what lies between.
    pub(super) fn light_past(&mut self, shadow: &ShadowRay, occlusion: Occlusion) -> Rgb {
        if shadow.t_max < 0.0 {
            return shadow.light;
        }
        let ShadowRay { ray, t_max, .. } = shadow;
        let passed = match occlusion {
            Occlusion::Nothing => 1.0,
            Occlusion::Opaque => 0.0,
            Occlusion::Clear => self.world.transmittance_past(ray, *t_max, self.time, None, occlusion, &mut ()),
        };
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(passed == 0.0);
        (shadow.light * passed).saturated()
    }

    /// The light of an emitter or of the environment by the first hit of its shadow ray.
    pub(super) fn light_at(&mut self, shadow: &ShadowRay, hit: Option<Hit>) -> Rgb {
        self.counts.shadow.traced += 1;
        let is_seen = match (shadow.source, hit) {
            (Source::Environment, None) => true,
            (Source::Emitter(number), Some(hit)) => {
                hit.t > 2.0 - PAST_EMITTER && self.lights.emitters.of_hit(&hit) == Some(number)
            }
            _ => false,
        };
        self.counts.shadow.hit += u64::from(!is_seen);
        if is_seen { shadow.light.saturated() } else { Rgb::BLACK }
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
