//! One path: from surface to surface, with the light that each of them sends along it.

use super::PathTracer;
use super::light_sampler::Source;
use crate::integrator::media::{Crossing, NONE, Refraction, SIMPLE};
use crate::integrator::visible_hit::{Frame, VisibleHit, visible_hit};
use crate::integrator::whitted::BEFORE_LIGHT;
use crate::integrator::{Probe, RayCount, RayKind};
use crate::light::LightSample;
use crate::material::{Bsdf, BsdfSample, Lobe, MaterialModel, MaterialPoint, ScatteringFrame};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Dimension, Sample};
use crate::scene::WhittedSettings;
use crate::world::Hit;
use canaletto_bvh::Ray;
use glam::DVec3;

/// Numbers of the uses of random numbers along a path.
mod uses {
    /// The first surface; each later surface is one use of the one before it.
    pub(super) const PATH: u32 = 7;
    pub(super) const NEXT: u32 = 1;
    pub(super) const COVERAGE: u32 = 2;
    pub(super) const LIGHT: u32 = 3;
    pub(super) const LIGHT_POINT: u32 = 4;
    pub(super) const LOBE: u32 = 5;
    pub(super) const DIRECTION: u32 = 6;
    pub(super) const ROULETTE: u32 = 7;
}

/// The end of a ray to a sampled point of an emitter, whose distance it is measured in. The point's own rounding is
/// less.
const PAST_EMITTER: f32 = 1.0 + 1e-3;

/// The number of surfaces after which roulette begins.
const ROULETTE_AFTER: u32 = 3;

/// The largest probability with which a path survives roulette, so that every path ends.
const SURVIVAL: f32 = 0.97;

/// The most surfaces of partial coverage that a path passes one after the other.
const MAX_PASSED: u32 = 1 << 16;

/// The ray that a path goes on along.
struct Segment {
    ray: Ray,
    line: DRay,
    differential: Option<RayDifferential>,
    /// The bodies that the ray is in, and the coinciding surface at its origin.
    inside: [u32; 2],
    /// The point that it left by a random direction, with the density of that. None from the eye, and after a mirror or
    /// a refraction, which no light is sampled for.
    scattered: Option<(DVec3, f64)>,
    /// Whether it has passed surfaces since it left that point.
    passed: bool,
    kind: Kind,
}

/// Why a ray is traced, for counts.
#[derive(Clone, Copy)]
enum Kind {
    Eye,
    Passed,
    Scattered(Lobe),
}

/// A surface of a path.
struct Vertex<'a> {
    hit: &'a VisibleHit,
    frame: Frame,
    bsdf: Bsdf,
    /// What a ray into the surface crosses; none at opaque surfaces.
    crossing: Option<Crossing>,
    place: Dimension,
}

/// The weight of a sample whose own density is `pdf`, where another technique has density `other` (power heuristic).
fn weight(pdf: f64, other: f64) -> f32 {
    // Densities may overflow when squared.
    let ratio = other / pdf;
    (1.0 / (1.0 + ratio * ratio)) as f32
}

impl PathTracer<'_> {
    /// The light along a camera ray by one path. The probe observes the camera ray alone.
    pub(super) fn path<P: Probe>(
        &mut self,
        line: DRay,
        differential: Option<RayDifferential>,
        sample: Sample,
        probe: &mut P,
    ) -> Rgb {
        let mut inside = NONE;
        if self.world.has_clear() {
            self.media.clear();
            inside = self.media.around_eye(self.world, line.origin, self.time, WhittedSettings::MAX_DEPTH);
        }
        let mut segment = Segment {
            ray: line.rounded(),
            line,
            differential,
            inside: [inside, NONE],
            scattered: None,
            passed: false,
            kind: Kind::Eye,
        };
        let mut place = Dimension::EYE.of(uses::PATH);
        let (mut light, mut throughput) = (Rgb::BLACK, Rgb::WHITE);
        let (mut depth, mut passed) = (1, 0);
        probe.ray(RayKind::Eye, &segment.ray, 1, Rgb::WHITE);
        while !self.is_cancelled {
            let is_eye = matches!(segment.kind, Kind::Eye);
            let found = if is_eye { self.meet(&segment, probe) } else { self.meet(&segment, &mut ()) };
            let Some((met, is_first)) = found else {
                let arriving = self.environment(&segment);
                if is_eye {
                    probe.miss(arriving);
                }
                light += (throughput * arriving).saturated();
                break;
            };
            let VisibleHit { hit, surface, material, line, .. } = &met;
            let frame = Frame::new(line.direction, surface);
            if is_eye {
                probe.hit(hit, surface, material, frame.outside);
            }
            place = place.of(uses::NEXT);
            let emitted = self.emitted(&segment, hit, &frame, material, is_first && !segment.passed);
            light += (throughput * emitted).saturated();
            if self.settings.max_depth != 0 && depth > self.settings.max_depth {
                break;
            }
            let coverage = material.coverage;
            if coverage < 1.0 {
                if is_eye {
                    probe.coverage(coverage);
                }
                if passed < MAX_PASSED && sample.one(place.of(uses::COVERAGE)) >= f64::from(coverage) {
                    passed += 1;
                    segment = self.straight_on(segment, &met, &frame);
                    continue;
                }
            }
            let (overlay, share) = material.overlay;
            if share > 0.0 {
                light += (throughput * overlay * share).saturated();
                throughput *= 1.0 - share;
            }
            let vertex = self.vertex(&met, frame, place);
            light += (throughput * self.direct(&vertex, &sample)).saturated();
            let numbers = (sample.one(place.of(uses::LOBE)), sample.two(place.of(uses::DIRECTION)));
            let Some(scattered) = vertex.bsdf.sample(vertex.frame.wo, numbers.0, numbers.1) else { break };
            throughput = (throughput * scattered.f * (1.0 / scattered.pdf) as f32).saturated();
            if throughput.is_black() || !throughput.is_finite() {
                break;
            }
            if self.settings.roulette && depth > ROULETTE_AFTER {
                let survival = throughput.max_component().min(SURVIVAL);
                if sample.one(place.of(uses::ROULETTE)) >= f64::from(survival) {
                    break;
                }
                throughput *= 1.0 / survival;
            }
            let Some(next) = self.scatter(&vertex, &scattered) else { break };
            segment = next;
            depth += 1;
        }
        probe.end(light);
        light.saturated()
    }

    /// The first visible surface of a ray, and whether it is also the first surface of all.
    fn meet<P: Probe>(&mut self, segment: &Segment, probe: &mut P) -> Option<(VisibleHit, bool)> {
        self.poll();
        let found = self.world.intersect_at(&segment.ray, f32::INFINITY, self.time);
        let arriving = (segment.line, segment.ray, found, segment.differential.as_ref());
        let visible = visible_hit(self.world, &mut self.media, arriving, segment.inside, self.time, probe);
        let count = self.count(segment.kind);
        count.traced += 1;
        count.hit += u64::from(visible.is_some());
        let met = visible?;
        let is_first = segment.inside[1] == NONE && found == Some(met.hit);
        Some((met, is_first))
    }

    fn count(&mut self, kind: Kind) -> &mut RayCount {
        match kind {
            Kind::Eye => &mut self.counts.eye,
            Kind::Passed => &mut self.counts.passed,
            Kind::Scattered(Lobe::Mirror) => &mut self.counts.reflected,
            Kind::Scattered(Lobe::Refraction) => &mut self.counts.refracted,
            Kind::Scattered(_) => &mut self.counts.scattered,
        }
    }

    /// The light of the environment or the background along a ray that hits nothing, with its weight.
    fn environment(&self, segment: &Segment) -> Rgb {
        let Some(environment) = &self.world.environment else { return self.world.background };
        let direction = segment.line.direction;
        let footprint = segment.differential.as_ref().map_or([DVec3::ZERO; 2], |d| d.direction);
        let Some((_, pdf)) = segment.scattered else { return environment.lookup(direction, footprint).radiance };
        let radiance = environment.radiance_without_sun(direction, footprint);
        if segment.passed {
            return radiance;
        }
        radiance * weight(pdf, self.lights.pdf_of_environment(direction.normalize()))
    }

    /// The light that a surface emits towards the ray that hits it, with its weight. `is_direct` tells that nothing
    /// lies between.
    fn emitted(&self, segment: &Segment, hit: &Hit, frame: &Frame, material: &MaterialPoint, is_direct: bool) -> Rgb {
        let emission = seen_emission(material, frame.outside);
        if emission.is_black() {
            return emission;
        }
        let Some((from, pdf)) = segment.scattered else { return emission };
        if self.lights.is_only_seen(self.world, self.world.material_index(hit)) {
            return Rgb::BLACK;
        }
        if !is_direct {
            return emission;
        }
        emission * weight(pdf, self.lights.pdf_of_hit(self.world, from, hit, frame.exact, frame.outer))
    }

    /// The scattering at a surface.
    fn vertex<'a>(&mut self, met: &'a VisibleHit, frame: Frame, place: Dimension) -> Vertex<'a> {
        let crossing = match met.crossing {
            SIMPLE => Some(self.media.simple(self.world, &met.hit, frame.outside, met.inside)),
            crossing => self.media.crossing(crossing).copied(),
        };
        let eta = f64::from(met.material.phong().eta);
        let eta_ratio = match crossing.map(|crossing| crossing.refraction) {
            Some(Refraction::Outer(outer)) if frame.outside => outer / eta,
            Some(Refraction::Outer(outer)) => eta / outer,
            Some(Refraction::Straight) | None => 1.0,
        };
        let mut material = met.material;
        if let MaterialModel::Phong(phong) = &mut material.model {
            phong.bound_albedo();
        }
        if crossing.is_none() {
            // Nothing is known of what lies beyond, so nothing passes, as in the classic integrator.
            material.model.phong_mut().opacity = 1.0;
        }
        let bsdf = material.bsdf(ScatteringFrame { normal: frame.normal, facing: frame.facing, eta_ratio });
        Vertex { hit: met, frame, bsdf, crossing, place }
    }

    /// The light of one sampled source that a surface sends back along the path.
    fn direct(&mut self, vertex: &Vertex, sample: &Sample) -> Rgb {
        if vertex.bsdf.is_delta() {
            return Rgb::BLACK;
        }
        let Some((source, chosen)) = self.lights.sample(sample.one(vertex.place.of(uses::LIGHT))) else {
            return Rgb::BLACK;
        };
        let u = sample.two(vertex.place.of(uses::LIGHT_POINT));
        let light = match source {
            Source::Light(number) => self.sample_light(vertex, number, u, chosen),
            Source::Emitter(number) => self.sample_emitter(vertex, number, u),
            Source::Environment => self.sample_environment(vertex, u, chosen),
        };
        light.unwrap_or(Rgb::BLACK).saturated()
    }

    /// The light of a light that no ray hits.
    fn sample_light(&mut self, vertex: &Vertex, number: u32, u: [f64; 2], chosen: f64) -> Option<Rgb> {
        let light = self.light(number);
        let casts_shadows = light.light.shadows;
        let LightSample { wi, position, li, pdf, .. } = light.sample(vertex.frame.exact, u)?;
        let f = self.reflected(vertex, wi, li)?;
        let mut passed = 1.0;
        if casts_shadows {
            let ray = vertex.frame.rounded(&vertex.frame.leave(wi));
            let (to, t_max) = match position {
                Some(position) => ((position - ray.origin.as_dvec3()).as_vec3(), BEFORE_LIGHT),
                None => (wi.as_vec3(), f32::INFINITY),
            };
            let ray = Ray::new(ray.origin, to);
            let occluder = &mut self.occluders[number as usize];
            passed = self.world.transmittance(&ray, t_max, self.time, None, occluder, &mut ());
            self.counts.shadow.traced += 1;
            self.counts.shadow.hit += u64::from(passed == 0.0);
        }
        Some(f * li * (f64::from(passed) / (pdf * chosen)) as f32)
    }

    /// The light of an emitting surface.
    fn sample_emitter(&mut self, vertex: &Vertex, number: u32, u: [f64; 2]) -> Option<Rgb> {
        let from = vertex.frame.exact;
        let lights = self.lights;
        let point = lights.emitters.all[number as usize].sample_from(from, u)?;
        let wi = (point - from).try_normalize()?;
        let f = self.reflected(vertex, wi, Rgb::WHITE)?;
        let start = vertex.frame.rounded(&vertex.frame.leave(wi)).origin;
        let line = DRay { origin: from, direction: point - from };
        let ray = Ray::new(start, (point - start.as_dvec3()).as_vec3());
        self.counts.shadow.traced += 1;
        let hit = self.world.intersect_at(&ray, PAST_EMITTER, self.time);
        let hit = hit
            .filter(|hit| hit.t > 2.0 - PAST_EMITTER && hit.instance != Hit::UNBOUNDED)
            .filter(|hit| lights.emitters.of(self.world, hit.instance, hit.primitive) == Some(number));
        let Some(hit) = hit else {
            self.counts.shadow.hit += 1;
            return None;
        };
        let mut surface = self.world.surface(line, &hit);
        let material = self.world.material(&hit);
        let material = self.world.material_point(material, (line, &hit), &mut surface, None, &mut ());
        let outside = line.direction.dot(surface.normal) < 0.0;
        let emission = seen_emission(&material, outside);
        let pdf = lights.pdf_of_hit(self.world, from, &hit, surface.exact, surface.normal);
        if emission.is_black() || pdf <= 0.0 {
            return None;
        }
        Some(f * emission * (1.0 / pdf) as f32 * weight(pdf, vertex.bsdf.pdf(vertex.frame.wo, wi)))
    }

    /// The light of the environment.
    fn sample_environment(&mut self, vertex: &Vertex, u: [f64; 2], chosen: f64) -> Option<Rgb> {
        let (wi, pdf) = self.lights.environment.as_ref()?.sample(u);
        let radiance = self.world.environment.as_ref()?.radiance_without_sun(wi, [DVec3::ZERO; 2]);
        let f = self.reflected(vertex, wi, radiance)?;
        let ray = vertex.frame.rounded(&vertex.frame.leave(wi));
        self.counts.shadow.traced += 1;
        if self.world.intersect_at(&ray, f32::INFINITY, self.time).is_some() {
            self.counts.shadow.hit += 1;
            return None;
        }
        let pdf = pdf * chosen;
        Some(f * radiance * (1.0 / pdf) as f32 * weight(pdf, vertex.bsdf.pdf(vertex.frame.wo, wi)))
    }

    /// f |cos θ| of a direction to a light; none if nothing of this light is scattered.
    fn reflected(&self, vertex: &Vertex, wi: DVec3, light: Rgb) -> Option<Rgb> {
        if light.is_black() {
            return None;
        }
        let f = vertex.bsdf.eval(vertex.frame.wo, wi);
        (!f.is_black() && f.is_finite()).then_some(f)
    }

    /// The ray straight on through a surface of partial coverage.
    fn straight_on(&mut self, segment: Segment, met: &VisibleHit, frame: &Frame) -> Segment {
        let inside = match self.media.crossing(met.crossing) {
            Some(crossing) => [crossing.beyond, crossing.next],
            None => [met.inside, NONE],
        };
        let line = frame.leave(-frame.wo);
        let differential = met.footprint.map(|f| f.differential.passed(f.step));
        Segment { ray: frame.rounded(&line), line, differential, inside, passed: true, kind: Kind::Passed, ..segment }
    }

    /// The ray that goes on from a surface; none into a body of which nothing is known.
    fn scatter(&mut self, vertex: &Vertex, scattered: &BsdfSample) -> Option<Segment> {
        let Vertex { hit: met, frame, .. } = vertex;
        let is_transmitted = scattered.wi.dot(frame.facing) < 0.0;
        let inside = if is_transmitted {
            let crossing = vertex.crossing?;
            [crossing.beyond, crossing.next]
        } else {
            let inside = match met.crossing {
                SIMPLE => self.media.simple_inside(self.world, &met.hit, frame.outside, met.inside),
                _ => met.inside,
            };
            [inside, self.media.crossing(met.crossing).map_or(NONE, |crossing| crossing.back)]
        };
        let line = frame.leave(scattered.wi);
        Some(Segment {
            ray: frame.rounded(&line),
            line,
            differential: None,
            inside,
            scattered: (!scattered.is_delta).then_some((frame.exact, scattered.pdf)),
            passed: false,
            kind: Kind::Scattered(scattered.lobe),
        })
    }
}

/// The emission of what is there of a surface, under its overlay.
fn seen_emission(material: &MaterialPoint, outside: bool) -> Rgb {
    let emission = material.emitted(outside);
    if emission.is_black() { emission } else { emission * (material.coverage * (1.0 - material.overlay.1)) }
}
