//! One path: from surface to surface, with the light that each of them sends along it.

use super::PathTracer;
use super::direct::{ShadowRay, weight};
use super::emitter::seen_emission;
use super::light_tree::Receiver;
use crate::integrator::media::{Crossing, NONE, Refraction, SIMPLE};
use crate::integrator::visible_hit::{Frame, VisibleHit, visible_hit};
use crate::integrator::{Probe, RayCount, RayKind};
use crate::material::{
    Bsdf, BsdfSample, HenyeyGreenstein, Lobe, MaterialModel, MaterialPoint, Medium, ScatteringFrame,
};
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
    pub(super) const DISTANCE: u32 = 8;
}

/// The number of surfaces after which roulette begins.
const ROULETTE_AFTER: u32 = 3;

/// The largest probability with which a path survives roulette, so that every path ends.
const SURVIVAL: f32 = 0.97;

/// The most surfaces of partial coverage that a path passes one after the other.
pub(super) const MAX_PASSED: u32 = 1 << 16;

/// The ray that a path goes on along.
struct Segment {
    ray: Ray,
    line: DRay,
    differential: Option<RayDifferential>,
    /// The bodies that the ray is in, and the coinciding surface at its origin.
    inside: [u32; 2],
    /// The point where it was scattered last, with the density of its direction there. None from the eye, and after a
    /// mirror or a refraction, which no light is sampled for.
    scattered: Option<(Receiver, f64)>,
    /// Whether it has passed surfaces since then.
    passed: bool,
    kind: Kind,
}

impl Segment {
    /// Goes straight on through a surface, into these bodies.
    fn go_through(&mut self, met: &VisibleHit, frame: &Frame, inside: [u32; 2]) {
        self.inside = inside;
        self.line = frame.leave(-frame.wo);
        self.ray = frame.rounded(&self.line);
        self.differential = met.footprint.map(|f| f.differential.passed(f.step));
        (self.passed, self.kind) = (true, Kind::Passed);
    }
}

/// Why a ray is traced, for counts.
#[derive(Clone, Copy)]
enum Kind {
    Eye,
    Passed,
    Scattered(Lobe),
}

/// A path on its way.
pub(super) struct Path {
    /// The ray that it goes along next.
    segment: Segment,
    sample: Sample,
    /// The place of its numbers at the last surface.
    place: Dimension,
    /// The light that it has found.
    pub(super) light: Rgb,
    /// The factor of the light that it finds next.
    throughput: Rgb,
    /// The number of surfaces, with the next one.
    depth: u32,
    /// The number of surfaces of partial coverage that it has passed.
    passed: u32,
}

impl Path {
    /// The ray that the path goes along next.
    pub(super) fn ray(&self) -> &Ray {
        &self.segment.ray
    }
}

/// What a surface asks of a path.
pub(super) struct Step {
    /// A ray to a sampled source, with the factor of its light.
    pub(super) shadow: Option<(ShadowRay, Rgb)>,
    /// Whether the path goes on.
    pub(super) goes_on: bool,
}

impl Step {
    const END: Step = Step { shadow: None, goes_on: false };
}

/// A point where a path is scattered.
pub(super) enum Vertex<'a> {
    /// A point of a surface.
    Surface(&'a SurfaceVertex<'a>),
    /// A point in a medium.
    Medium(MediumVertex),
}

/// A surface of a path.
pub(super) struct SurfaceVertex<'a> {
    hit: &'a VisibleHit,
    frame: Frame,
    bsdf: Bsdf,
    /// What a ray into the surface crosses; none at opaque surfaces.
    pub(super) crossing: Option<Crossing>,
}

impl SurfaceVertex<'_> {
    /// Whether light passes as if no surface were there.
    pub(super) fn is_index_matched(&self) -> bool {
        matches!(&self.bsdf, Bsdf::Dielectric(dielectric) if dielectric.is_index_matched())
    }
}

/// A point in a medium where a path is scattered.
pub(super) struct MediumVertex {
    position: DVec3,
    wo: DVec3,
    phase: HenyeyGreenstein,
    /// The bodies that it is in.
    inside: u32,
}

impl Vertex<'_> {
    /// Whether light is scattered to single directions only, so that no source is sampled.
    pub(super) fn is_delta(&self) -> bool {
        match self {
            Vertex::Surface(surface) => surface.bsdf.is_delta(),
            Vertex::Medium(_) => false,
        }
    }

    /// The point before rounding.
    pub(super) fn position(&self) -> DVec3 {
        match self {
            Vertex::Surface(surface) => surface.frame.exact,
            Vertex::Medium(medium) => medium.position,
        }
    }

    /// The point as lights see it.
    pub(super) fn receiver(&self) -> Receiver {
        match self {
            Vertex::Surface(SurfaceVertex { frame, crossing, .. }) => {
                Receiver { point: frame.exact, normal: frame.normal, two_sided: crossing.is_some() }
            }
            Vertex::Medium(medium) => Receiver::in_medium(medium.position),
        }
    }

    /// f |cos θ| of light along `wi`; in a medium, the phase function.
    pub(super) fn eval(&self, wi: DVec3) -> Rgb {
        match self {
            Vertex::Surface(surface) => surface.bsdf.eval(surface.frame.wo, wi),
            Vertex::Medium(medium) => Rgb::gray(medium.phase.eval(medium.wo, wi) as f32),
        }
    }

    /// The density with which the path goes on along `wi`.
    pub(super) fn pdf(&self, wi: DVec3) -> f64 {
        match self {
            Vertex::Surface(surface) => surface.bsdf.pdf(surface.frame.wo, wi),
            Vertex::Medium(medium) => medium.phase.eval(medium.wo, wi),
        }
    }

    /// A random direction in which the path goes on.
    fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        match self {
            Vertex::Surface(surface) => surface.bsdf.sample(surface.frame.wo, u_lobe, u),
            Vertex::Medium(MediumVertex { wo, phase, .. }) => {
                let wi = phase.sample(*wo, u);
                let pdf = phase.eval(*wo, wi);
                Some(BsdfSample { wi, f: Rgb::gray(pdf as f32), pdf, lobe: Lobe::Diffuse, is_delta: false })
            }
        }
    }

    /// The `f64` ray that leaves in a direction.
    pub(super) fn line(&self, wi: DVec3) -> DRay {
        DRay { origin: self.position(), direction: wi }
    }

    /// The rounded ray of a line that leaves.
    pub(super) fn ray(&self, line: &DRay) -> Ray {
        match self {
            Vertex::Surface(surface) => surface.frame.rounded(line),
            Vertex::Medium(_) => line.rounded(),
        }
    }
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
        self.media.clear();
        let mut path = self.start(line, differential, sample);
        probe.ray(RayKind::Eye, path.ray(), 1, Rgb::WHITE);
        loop {
            self.poll(1);
            let found = self.world.intersect_at(path.ray(), f32::INFINITY, self.time);
            let is_eye = matches!(path.segment.kind, Kind::Eye);
            let step =
                if is_eye { self.arrive(&mut path, found, probe) } else { self.arrive(&mut path, found, &mut ()) };
            if let Some((shadow, factor)) = &step.shadow {
                path.light += (*factor * self.shadowed(shadow)).saturated();
            }
            if !step.goes_on || self.is_cancelled {
                break;
            }
        }
        probe.end(path.light);
        path.light.saturated()
    }

    /// A path that begins with a camera ray.
    pub(super) fn start(&mut self, line: DRay, differential: Option<RayDifferential>, sample: Sample) -> Path {
        let inside = match self.world.has_clear() {
            true => self.media.around_eye(self.world, line.origin, self.time, WhittedSettings::MAX_DEPTH),
            false => NONE,
        };
        let segment = Segment {
            ray: line.rounded(),
            line,
            differential,
            inside: [inside, NONE],
            scattered: None,
            passed: false,
            kind: Kind::Eye,
        };
        let place = Dimension::EYE.of(uses::PATH);
        Path { segment, sample, place, light: Rgb::BLACK, throughput: Rgb::WHITE, depth: 1, passed: 0 }
    }

    /// Takes a path to the first visible surface of its ray, and on from there. `found` is the ray's first hit.
    pub(super) fn arrive<P: Probe>(&mut self, path: &mut Path, found: Option<Hit>, probe: &mut P) -> Step {
        let is_eye = matches!(path.segment.kind, Kind::Eye);
        let Some((met, is_first)) = self.meet(&path.segment, found, probe) else {
            let is_direct = self.sees_through || found.is_none() && !path.segment.passed;
            let arriving = self.environment(&path.segment, is_direct);
            if is_eye {
                probe.miss(arriving);
            }
            path.light += (path.throughput * arriving).saturated();
            return Step::END;
        };
        let VisibleHit { hit, surface, material, line, .. } = &met;
        let frame = Frame::new(line.direction, surface);
        if is_eye {
            probe.hit(hit, surface, material, frame.outside);
        }
        let place = path.place.of(uses::NEXT);
        path.place = place;
        if let Some((medium, inside)) = self.medium_before(&met, frame.outside) {
            let distance = path.segment.line.origin.distance(frame.exact);
            if let Some(step) = self.pass_medium(path, &medium, inside, distance) {
                return step;
            }
        }
        let is_direct = self.sees_through || is_first && !path.segment.passed;
        let emitted = self.emitted(&path.segment, hit, &frame, material, is_direct);
        path.light += (path.throughput * emitted).saturated();
        if self.settings.max_depth != 0 && path.depth > self.settings.max_depth {
            return Step::END;
        }
        let (coverage, sample) = (material.coverage, path.sample);
        if coverage < 1.0 {
            if is_eye {
                probe.coverage(coverage);
            }
            if path.passed < MAX_PASSED && sample.one(place.of(uses::COVERAGE)) >= f64::from(coverage) {
                path.passed += 1;
                let inside = self.media.crossing(met.crossing).map(|crossing| [crossing.beyond, crossing.next]);
                path.segment.go_through(&met, &frame, inside.unwrap_or([met.inside, NONE]));
                return Step { shadow: None, goes_on: true };
            }
        }
        let (overlay, share) = material.overlay;
        if share > 0.0 {
            path.light += (path.throughput * overlay * share).saturated();
            path.throughput *= 1.0 - share;
        }
        let vertex = self.vertex(&met, frame);
        if let Some(crossing) = vertex.crossing.filter(|_| vertex.is_index_matched()) {
            path.segment.go_through(&met, &vertex.frame, [crossing.beyond, crossing.next]);
            return Step { shadow: None, goes_on: true };
        }
        self.scatter(path, &Vertex::Surface(&vertex))
    }

    /// Takes a path through a medium to the end of its ray at a distance. If it is scattered before, returns the step
    /// from there.
    fn pass_medium(&mut self, path: &mut Path, medium: &Medium, inside: u32, distance: f64) -> Option<Step> {
        if !medium.scatters() {
            path.throughput = path.throughput * medium.transmittance(distance);
            return None;
        }
        let u = path.sample.two(path.place.of(uses::DISTANCE));
        let sample = medium.sample(path.throughput, u, distance);
        path.throughput = path.throughput * sample.factor;
        let distance = sample.distance?;
        if path.throughput.is_black() || self.settings.max_depth != 0 && path.depth > self.settings.max_depth {
            return Some(Step::END);
        }
        let DRay { origin, direction } = path.segment.line;
        let direction = direction.normalize();
        let (position, phase) = (origin + direction * distance, HenyeyGreenstein { g: medium.anisotropy.into() });
        let vertex = MediumVertex { position, wo: -direction, phase, inside };
        Some(self.scatter(path, &Vertex::Medium(vertex)))
    }

    /// What fills the place before a hit, with the bodies there. None if light passes it as if nothing were there.
    pub(super) fn medium_before(&mut self, met: &VisibleHit, outside: bool) -> Option<(Medium, u32)> {
        if !self.has_media {
            return None;
        }
        let inside = self.inside_before(met, outside);
        let medium = self.world.materials()[self.media.filling(inside)?.material as usize].medium;
        (!medium.is_vacuum()).then_some((medium, inside))
    }

    /// The bodies that a ray is in before a hit.
    fn inside_before(&mut self, met: &VisibleHit, outside: bool) -> u32 {
        match met.crossing {
            SIMPLE => self.media.simple_inside(self.world, &met.hit, outside, met.inside),
            _ => met.inside,
        }
    }

    /// Samples a source for a path, and sends it on in a random direction.
    fn scatter(&mut self, path: &mut Path, vertex: &Vertex) -> Step {
        let (sample, place) = (path.sample, path.place);
        let numbers = (sample.one(place.of(uses::LIGHT)), sample.two(place.of(uses::LIGHT_POINT)));
        let shadow = self.sample_source(vertex, numbers.0, numbers.1).map(|shadow| (shadow, path.throughput));
        Step { shadow, goes_on: self.go_on(path, vertex) }
    }

    /// Sends a path on in a random direction. Returns whether it goes on.
    fn go_on(&mut self, path: &mut Path, vertex: &Vertex) -> bool {
        let (sample, place) = (path.sample, path.place);
        let numbers = (sample.one(place.of(uses::LOBE)), sample.two(place.of(uses::DIRECTION)));
        let Some(scattered) = vertex.sample(numbers.0, numbers.1) else { return false };
        path.throughput = (path.throughput * scattered.f * (1.0 / scattered.pdf) as f32).saturated();
        if path.throughput.is_black() || !path.throughput.is_finite() {
            return false;
        }
        if self.settings.roulette && path.depth > ROULETTE_AFTER {
            let survival = path.throughput.max_component().min(SURVIVAL);
            if sample.one(place.of(uses::ROULETTE)) >= f64::from(survival) {
                return false;
            }
            path.throughput *= 1.0 / survival;
        }
        let Some(inside) = self.inside_after(vertex, scattered.wi) else { return false };
        let line = vertex.line(scattered.wi);
        path.segment = Segment {
            ray: vertex.ray(&line),
            line,
            differential: None,
            inside,
            passed: false,
            scattered: (!scattered.is_delta).then(|| (vertex.receiver(), scattered.pdf)),
            kind: Kind::Scattered(scattered.lobe),
        };
        path.depth += 1;
        true
    }

    /// The first visible surface of a ray whose first hit is `found`, and whether it is that hit.
    fn meet<P: Probe>(&mut self, segment: &Segment, found: Option<Hit>, probe: &mut P) -> Option<(VisibleHit, bool)> {
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

    /// The light of the environment or the background along a ray that hits nothing, with its weight. `is_direct` tells
    /// that a shadow ray would have passed, too.
    fn environment(&self, segment: &Segment, is_direct: bool) -> Rgb {
        let Some(environment) = &self.world.environment else { return self.world.background };
        let direction = segment.line.direction;
        let footprint = segment.differential.as_ref().map_or([DVec3::ZERO; 2], |d| d.direction);
        let Some((from, pdf)) = &segment.scattered else {
            return environment.lookup(direction, footprint).radiance;
        };
        let radiance = environment.radiance_without_sun(direction, footprint);
        if !is_direct {
            return radiance;
        }
        radiance * weight(*pdf, self.lights.pdf_of_environment(self.world, from, direction.normalize()))
    }

    /// The light that a surface emits towards the ray that hits it, with its weight. `is_direct` tells that a shadow
    /// ray would have found it, too.
    fn emitted(&self, segment: &Segment, hit: &Hit, frame: &Frame, material: &MaterialPoint, is_direct: bool) -> Rgb {
        let emission = seen_emission(material, frame.outside);
        if emission.is_black() {
            return emission;
        }
        let Some((from, pdf)) = &segment.scattered else { return emission };
        let Some(emission) = self.lights.lit(self.world, hit, emission, from.point.distance(frame.exact)) else {
            return Rgb::BLACK;
        };
        if !is_direct {
            return emission;
        }
        emission * weight(*pdf, self.lights.pdf_of_hit(self.world, from, hit, frame.exact, frame.outer))
    }

    /// The scattering at a surface.
    pub(super) fn vertex<'a>(&mut self, met: &'a VisibleHit, frame: Frame) -> SurfaceVertex<'a> {
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
        SurfaceVertex { hit: met, frame, bsdf, crossing }
    }

    /// The bodies that a ray is in after it leaves a vertex, and the coinciding surface there. None if it goes into a
    /// body of which nothing is known.
    pub(super) fn inside_after(&mut self, vertex: &Vertex, wi: DVec3) -> Option<[u32; 2]> {
        let SurfaceVertex { hit: met, frame, crossing, .. } = match vertex {
            Vertex::Surface(surface) => surface,
            Vertex::Medium(medium) => return Some([medium.inside, NONE]),
        };
        if wi.dot(frame.facing) < 0.0 {
            return crossing.map(|crossing| [crossing.beyond, crossing.next]);
        }
        let back = self.media.crossing(met.crossing).map_or(NONE, |crossing| crossing.back);
        Some([self.inside_before(met, frame.outside), back])
    }
}
