//! One path: from surface to surface, with the light that each of them sends along it.

mod features;

use super::PathTracer;
use super::direct::ShadowRay;
use super::emitter::seen_emission;
use super::light_sampler::KnownChoice;
use super::light_tree::Receiver;
use super::vertex::{MediumVertex, MeterVertex, SurfaceVertex, Vertex};
use super::{Passage, PathChannel, PathDensities, PathEmitter, PathEnd, PathEvent};
use crate::integrator::media::{NONE, Refraction, SIMPLE};
use crate::integrator::visible_hit::{Footprint, Frame, HitInside, VisibleHit, visible_hit};
use crate::integrator::{Probe, RayCount, RayKind};
use crate::material::{
    BsdfSample, HenyeyGreenstein, Lobe, MaterialPoint, Medium, MediumSample, ScatteringFrame, SeenBsdf,
};
use crate::math::{DRay, RayDifferential, Rgb, Vector};
use crate::sampler::{Dimension, Sample};
use crate::scene::WhittedSettings;
use crate::shape::Surface;
use crate::world::Hit;
use canaletto_bvh::Ray;
use canaletto_bvh::lanes::Real32;
use glam::DVec3;

/// Numbers of the uses of random numbers along a path.
pub(super) mod uses {
    /// The first surface; each later surface is one use of the one before it.
    pub(in crate::integrator::path) const PATH: u32 = 7;
    pub(in crate::integrator::path) const NEXT: u32 = 1;
    pub(in crate::integrator::path) const COVERAGE: u32 = 2;
    pub(in crate::integrator::path) const LIGHT: u32 = 3;
    pub(in crate::integrator::path) const LOBE: u32 = 5;
    pub(in crate::integrator::path) const ROULETTE: u32 = 7;
    pub(in crate::integrator::path) const DISTANCE: u32 = 8;
    pub(in crate::integrator::path) const CHANNEL: u32 = 9;
}

/// The number of surfaces after which roulette begins.
pub(super) const ROULETTE_AFTER: u32 = 3;

/// The throughput below which a path may end. With 1 the variance of a glass sphere in a box was twice as large, in
/// four fifths of the time.
const ROULETTE_BELOW: f32 = 0.25;

/// The number of scatterings after which a path may end whatever its throughput, so that every path ends.
///
/// After n of them it has survived with probability (512 / n)^1.5. Paths that nothing else ends thus have 1536
/// scatterings on average. Those of milk and clouds mostly leave before 512. The weight of longer ones grows as
/// (n / 512)^1.5, where a constant probability q would let it grow as q⁻ⁿ. That is of infinite variance in media that
/// paths leave more slowly than that.
const LONG: u32 = 512;

/// The probability with which a path of this throughput survives roulette at a scattering of this number.
#[inline(always)]
pub(super) fn survival<F: Real32>(throughput: Vector<F>, depth: F) -> F {
    let Vector { x, y, z } = throughput;
    let one = F::splat(1.0);
    let by_throughput = (x.max(y).max(z) * (1.0 / ROULETTE_BELOW)).min(one);
    // The product of (1 − 1/k) from 513 to n is 512 / n.
    let step = one - one / depth;
    let by_length = F::select(F::splat(LONG as f32).less(depth), step * step.sqrt(), one);
    by_throughput * by_length
}

/// The most surfaces of partial coverage that a path passes one after the other.
pub(super) const MAX_PASSED: u32 = 1 << 16;

/// A point where a path was scattered.
pub(super) struct ScatteredFrom {
    /// The point as lights see it, and the choice of a light there.
    pub(super) receiver: Receiver,
    pub(super) choice: KnownChoice,
    /// The density of the path's direction.
    pub(super) pdf: f64,
}

/// The ray that a path goes on along.
pub(super) struct Segment {
    pub(super) ray: Ray,
    pub(super) line: DRay,
    differential: Option<RayDifferential>,
    /// The bodies that the ray is in, and the coinciding surface at its origin.
    pub(super) inside: [u32; 2],
    /// Where it was scattered last, if it has gone straight on since then. None from the eye, and after a mirror or a
    /// refraction, which no light is sampled for.
    scattered: Option<ScatteredFrom>,
    /// Whether it has passed surfaces since then.
    passed: bool,
    asked: Asked,
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

/// Whether lights that are found by shadow rays alone were asked for along a ray: the sun, and others that may be seen.
/// Their shadow rays pass clear bodies. So a path that goes through clear bodies alone doesn't find their light again.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    /// The path was not scattered yet: what it meets is seen from the eye, in mirrors or through clear bodies.
    Nowhere,
    /// Where it was scattered last. It has gone through clear bodies since then, if anything.
    Along,
    /// Where it was scattered last, but it was mirrored since then, where no shadow ray goes.
    Elsewhere,
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
    pub(super) segment: Segment,
    pub(super) sample: Sample,
    /// The time of its rays.
    pub(super) time: f32,
    /// The place of its numbers at the last surface.
    pub(super) place: Dimension,
    /// The light that it has found.
    pub(super) light: Rgb,
    /// The factor of the light that it finds next.
    pub(super) throughput: Rgb,
    /// How much more probable its directions were by the guiding field and the surfaces than by the surfaces alone.
    pub(super) guided: f32,
    /// The number of surfaces that bend it, with the next one.
    pub(super) depth: u32,
    /// The number of surfaces of partial coverage that it has passed.
    passed: u32,
    /// The only channel that it carries, once it has met a body that refracts the three by different angles.
    channel: Option<usize>,
}

impl Path {
    /// Whether its ray starts outside of all bodies.
    pub(super) fn is_outside(&self) -> bool {
        self.segment.inside == [NONE; 2]
    }

    /// The offsets along a surface that its ray hits to the hits of the neighbouring rays.
    pub(super) fn step(&self, surface: &Surface) -> Option<[DVec3; 2]> {
        let Segment { differential, line, .. } = &self.segment;
        Footprint::new(differential.as_ref(), line, surface).map(|footprint| footprint.step)
    }

    /// Where it was scattered at the start of its ray, if it is outside of all bodies and sources were asked for there.
    #[inline]
    pub(super) fn scattered_straight(&self) -> Option<&ScatteredFrom> {
        let is_straight = self.is_outside() && !self.segment.passed && self.segment.asked == Asked::Along;
        self.segment.scattered.as_ref().filter(|_| is_straight)
    }

    /// The line of its next ray.
    pub(super) fn line(&self) -> &DRay {
        &self.segment.line
    }

    /// Sends it on along a ray in a sampled direction, into these bodies. `through` tells whether the direction leads
    /// through a surface as the only one of its lobe, and if so, whether it is straight on. `lit` is the vertex as
    /// lights see it, and the choice of a light there, if one was chosen.
    pub(super) fn leave(
        &mut self,
        ray: Ray,
        line: DRay,
        inside: [u32; 2],
        (scattered, through): (&BsdfSample, Option<bool>),
        lit: Option<(Receiver, KnownChoice)>,
    ) {
        let goes_straight = through == Some(true);
        let asked = match (self.segment.asked, through) {
            _ if !scattered.is_delta => Asked::Along,
            (before, Some(_)) => before,
            (Asked::Nowhere, None) => Asked::Nowhere,
            (_, None) => Asked::Elsewhere,
        };
        let segment = &mut self.segment;
        (segment.ray, segment.line, segment.differential, segment.inside) = (ray, line, None, inside);
        (segment.passed, segment.asked, segment.kind) = (goes_straight, asked, Kind::Scattered(scattered.lobe));
        if goes_straight {
            return;
        }
        self.depth += 1;
        segment.scattered = match lit {
            Some((receiver, choice)) if !scattered.is_delta => {
                Some(ScatteredFrom { receiver, choice, pdf: scattered.pdf })
            }
            _ => None,
        };
    }

    /// The bodies that the next ray starts in.
    pub(super) fn inside(&self) -> u32 {
        self.segment.inside[0]
    }

    /// The ray that the path goes along next.
    pub(super) fn ray(&self) -> &Ray {
        &self.segment.ray
    }
}

/// What a path comes to.
#[expect(clippy::large_enum_variant, reason = "one lives on the stack, until the path goes on")]
pub(super) enum Arrival {
    /// A step that is done.
    Step(Step),
    /// A surface where it is scattered.
    Surface(SurfaceVertex),
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

impl PathTracer<'_> {
    /// The light along a camera ray by one path. The probe observes the camera ray alone.
    pub(super) fn path<P: Probe + ?Sized>(
        &mut self,
        line: DRay,
        differential: Option<RayDifferential>,
        sample: Sample,
        probe: &mut P,
    ) -> Rgb {
        self.media.clear();
        let path = self.start(line, differential, sample);
        probe.ray(RayKind::Eye, path.ray(), 1, Rgb::WHITE);
        let light = self.follow(path, Step { shadow: None, goes_on: true }, probe);
        probe.end(light);
        light
    }

    /// Takes a path from a step to its end.
    pub(super) fn follow<P: Probe + ?Sized>(&mut self, mut path: Path, mut step: Step, probe: &mut P) -> Rgb {
        loop {
            if let Some((shadow, throughput)) = &step.shadow {
                let visible = self.visible(shadow);
                probe.path(PathEvent::Visible(visible));
                path.light += (*throughput * (shadow.light * visible).saturated()).saturated();
            }
            if !step.goes_on || self.is_cancelled {
                return path.light.saturated();
            }
            self.poll(1);
            let found = self.world.intersect_at(path.ray(), f32::INFINITY, self.time);
            probe.path(PathEvent::Ray { ray: path.ray(), depth: path.depth });
            step = match self.arrive(&mut path, found, probe) {
                Arrival::Step(step) => step,
                Arrival::Surface(vertex) => self.scatter(&mut path, &Vertex::Surface(&vertex), probe),
            };
        }
    }

    /// A path that begins at a point instead of a camera ray.
    pub(super) fn start_at(&mut self, position: DVec3, sample: Sample) -> Path {
        self.start(DRay { origin: position, direction: DVec3::Z }, None, sample)
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
            asked: Asked::Nowhere,
            kind: Kind::Eye,
        };
        Path {
            segment,
            sample,
            time: self.time,
            place: Dimension::EYE.of(uses::PATH),
            light: Rgb::BLACK,
            throughput: Rgb::WHITE,
            guided: 1.0,
            depth: 1,
            passed: 0,
            channel: None,
        }
    }

    /// Takes a path to the first visible surface of its ray, and on from there. `found` is the ray's first hit.
    pub(super) fn arrive<P: Probe + ?Sized>(&mut self, path: &mut Path, found: Option<Hit>, probe: &mut P) -> Arrival {
        let is_eye = matches!(path.segment.kind, Kind::Eye);
        let seen =
            if is_eye { self.meet(&path.segment, found, probe) } else { self.meet(&path.segment, found, &mut ()) };
        let Some(met) = seen else {
            let is_direct = self.sees_through || found.is_none() && !path.segment.passed;
            // A path that nothing has bent is on its first surface.
            let arriving = match self.backdrop.filter(|_| path.depth == 1) {
                Some(Rgb::BLACK) => Rgb::BLACK,
                Some(backdrop) => self::found(PathEmitter::Background, backdrop, None, probe),
                None => self.environment(&path.segment, is_direct, probe),
            };
            if is_eye {
                probe.miss(arriving);
            }
            path.light += (path.throughput * arriving).saturated();
            probe.path(PathEvent::End(PathEnd::Miss));
            return Arrival::Step(Step::END);
        };
        let is_first = path.segment.inside[1] == NONE && found == Some(met.hit);
        let VisibleHit { hit, surface, material, line, .. } = &met;
        let frame = Frame::new(line.direction, surface);
        if is_eye {
            probe.hit(hit, surface, material, frame.outside);
        }
        probe.path(PathEvent::Surface { hit, surface, material, outside: frame.outside });
        let place = path.place.of(uses::NEXT);
        path.place = place;
        if let Some((medium, inside)) = self.medium_before(&met, frame.outside) {
            let distance = path.segment.line.origin.distance(frame.exact);
            if let Some(step) = self.pass_medium(path, &medium, inside, distance, probe) {
                return Arrival::Step(step);
            }
        }
        let is_direct = self.sees_through || is_first && !path.segment.passed;
        let emitted = self.emitted(&path.segment, hit, &frame, material, is_direct, probe);
        path.light += (path.throughput * emitted).saturated();
        if self.settings.max_depth != 0 && path.depth > self.settings.max_depth {
            probe.path(PathEvent::End(PathEnd::MaxDepth));
            return Arrival::Step(Step::END);
        }
        let (coverage, sample) = (material.coverage, path.sample);
        if coverage < 1.0 {
            if is_eye {
                probe.coverage(coverage);
            }
            if path.passed < MAX_PASSED && sample.one(place.of(uses::COVERAGE)) >= f64::from(coverage) {
                path.passed += 1;
                probe.path(PathEvent::Passed(Passage::Coverage));
                let inside = self.media.crossing(met.crossing).map(|crossing| [crossing.beyond, crossing.next]);
                path.segment.go_through(&met, &frame, inside.unwrap_or([met.inside, NONE]));
                return Arrival::Step(Step { shadow: None, goes_on: true });
            }
        }
        let (overlay, share) = material.overlay;
        if share > 0.0 {
            path.light += (path.throughput * overlay * share).saturated();
            path.throughput *= 1.0 - share;
            probe.path(PathEvent::Overlay { color: overlay, share });
        }
        self.disperse(path, &met, probe);
        let vertex = self.vertex(&met, frame, path.channel);
        if let Some(crossing) = vertex.crossing.filter(|_| vertex.is_index_matched()) {
            path.segment.go_through(&met, &vertex.frame, [crossing.beyond, crossing.next]);
            probe.path(PathEvent::Passed(Passage::IndexMatched));
            return Arrival::Step(Step { shadow: None, goes_on: true });
        }
        Arrival::Surface(vertex)
    }

    /// Takes a path through a medium to the end of its ray at a distance. If it is scattered before, returns the step
    /// from there.
    fn pass_medium<P: Probe + ?Sized>(
        &mut self,
        path: &mut Path,
        medium: &Medium,
        inside: u32,
        end: f64,
        probe: &mut P,
    ) -> Option<Step> {
        let DRay { origin, direction } = path.segment.line;
        let direction = direction.normalize();
        let MediumSample { distance, factor } = if medium.scatters() {
            medium.sample(path.throughput, path.sample.two(path.place.of(uses::DISTANCE)), end)
        } else {
            MediumSample { distance: None, factor: medium.transmittance(end) }
        };
        path.throughput = path.throughput * factor;
        let scattered = distance.map(|distance| origin + direction * distance);
        probe.path(PathEvent::Medium { medium, distance: distance.unwrap_or(end), factor, scattered });
        let position = scattered?;
        let is_last = self.settings.max_depth != 0 && path.depth > self.settings.max_depth;
        if is_last || path.throughput.is_black() {
            probe.path(PathEvent::End(if is_last { PathEnd::MaxDepth } else { PathEnd::Absorbed }));
            return Some(Step::END);
        }
        let phase = HenyeyGreenstein { g: medium.anisotropy.into() };
        let vertex = MediumVertex { position, wo: -direction, phase, inside };
        Some(self.scatter(path, &Vertex::Medium(vertex), probe))
    }

    /// What fills the place before a hit, with the bodies there. None if light passes it as if nothing were there.
    pub(super) fn medium_before(&mut self, met: &VisibleHit, outside: bool) -> Option<(Medium, u32)> {
        if !self.has_media {
            return None;
        }
        let inside = self.inside_before(&met.hit_inside(), outside);
        let medium = self.world.materials()[self.media.filling(inside)?.material as usize].medium;
        (!medium.is_vacuum()).then_some((medium, inside))
    }

    /// The bodies that a ray is in before a hit.
    fn inside_before(&mut self, met: &HitInside, outside: bool) -> u32 {
        match met.crossing {
            SIMPLE => self.media.simple_inside(self.world, &met.hit, outside, met.inside),
            _ => met.inside,
        }
    }

    /// Samples a source for a path, and sends it on in a random direction.
    pub(super) fn scatter<P: Probe + ?Sized>(&mut self, path: &mut Path, vertex: &Vertex, probe: &mut P) -> Step {
        let (sample, place) = (path.sample, path.place);
        let numbers = sample.one_and_two(place.of(uses::LIGHT));
        let receiver = vertex.receiver();
        let choice = (!vertex.is_delta()).then(|| self.choice(0, &receiver));
        let shadow = choice
            .as_ref()
            .and_then(|choice| self.sample_source(vertex, (&receiver, choice), numbers.0, numbers.1, probe));
        let shadow = shadow.map(|shadow| (shadow, path.throughput));
        let end = self.go_on(path, vertex, choice.map(|choice| (receiver, choice.known())), probe).err();
        if let Some(end) = end {
            probe.path(PathEvent::End(end));
        }
        Step { shadow, goes_on: end.is_none() }
    }

    /// Sends a path on in a random direction. `lit` is the vertex as lights see it, and the choice of a light there, if
    /// one was chosen.
    ///
    /// # Errors
    /// The reason why it ends.
    fn go_on<P: Probe + ?Sized>(
        &mut self,
        path: &mut Path,
        vertex: &Vertex,
        lit: Option<(Receiver, KnownChoice)>,
        probe: &mut P,
    ) -> Result<(), PathEnd> {
        let (sample, place) = (path.sample, path.place);
        let numbers = sample.one_and_two(place.of(uses::LOBE));
        let (scattered, guiding) = vertex.sample(numbers.0, numbers.1).ok_or(PathEnd::Absorbed)?;
        probe.path(PathEvent::Scattered { sample: &scattered, guiding });
        path.throughput = (path.throughput * scattered.f * (1.0 / scattered.pdf) as f32).saturated();
        if let Some(guiding) = guiding {
            path.guided *= (scattered.pdf / guiding.pdf_scattering) as f32;
        }
        if path.throughput.is_black() || !path.throughput.is_finite() {
            return Err(PathEnd::Absorbed);
        }
        if self.settings.roulette && path.depth > ROULETTE_AFTER {
            // Guiding makes throughputs small where much light is, and paths there shouldn't end.
            let survival = survival(Vector::from(path.throughput * path.guided), path.depth as f32);
            let survived = sample.one(place.of(uses::ROULETTE)) < f64::from(survival);
            probe.path(PathEvent::Roulette { survival, survived });
            if !survived {
                return Err(PathEnd::Roulette);
            }
            path.throughput *= 1.0 / survival;
        }
        let inside = self.inside_after(vertex, scattered.wi).ok_or(PathEnd::Absorbed)?;
        let line = vertex.line(scattered.wi);
        let through = if let Vertex::Surface(surface) = vertex { surface.goes_through(&scattered) } else { None };
        path.leave(vertex.ray(&line), line, inside, (&scattered, through), lit);
        Ok(())
    }

    /// The first visible surface of a ray whose first hit is `found`.
    fn meet<P: Probe + ?Sized>(&mut self, segment: &Segment, found: Option<Hit>, probe: &mut P) -> Option<VisibleHit> {
        let arriving = (segment.line, segment.ray, found, segment.differential.as_ref());
        let visible = visible_hit(self.world, &mut self.media, arriving, segment.inside, self.time, probe);
        let count = self.count(segment.kind);
        count.traced += 1;
        count.hit += u64::from(visible.is_some());
        visible
    }

    /// Counts a ray of a path that hit nothing.
    pub(super) fn count_miss(&mut self, path: &Path) {
        self.count(path.segment.kind).traced += 1;
    }

    /// Counts a ray of a path that hit something.
    pub(super) fn count_hit(&mut self, path: &Path) {
        let count = self.count(path.segment.kind);
        count.traced += 1;
        count.hit += 1;
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
    fn environment<P: Probe + ?Sized>(&self, segment: &Segment, is_direct: bool, probe: &mut P) -> Rgb {
        let Some(environment) = &self.world.environment else {
            let radiance = self.world.background;
            return found(PathEmitter::Background, radiance, None, probe);
        };
        let direction = segment.line.direction;
        let footprint = segment.differential.as_ref().map_or([DVec3::ZERO; 2], |d| d.direction);
        let shows_sun = match segment.asked {
            Asked::Nowhere => true,
            Asked::Along => false,
            Asked::Elsewhere => environment.sun_is_light(),
        };
        if !shows_sun && environment.is_sun(direction) {
            probe.path(PathEvent::LeftOut(PathEmitter::Environment));
        }
        let Some(ScatteredFrom { receiver, choice, pdf }) = &segment.scattered else {
            let radiance = match shows_sun {
                true => environment.lookup(direction, footprint).radiance,
                false => environment.radiance_without_sun(direction, footprint),
            };
            return found(PathEmitter::Environment, radiance, None, probe);
        };
        let direction = direction.normalize();
        let (radiance, place) = environment.radiance_and_place(direction, footprint);
        let densities = is_direct.then(|| {
            let source = self.lights.pdf_of_environment((receiver, choice), direction, place);
            PathDensities { scattering: *pdf, source }
        });
        found(PathEmitter::Environment, radiance, densities, probe)
    }

    /// The light that a surface emits towards the ray that hits it, with its weight. `is_direct` tells that a shadow
    /// ray would have found it, too.
    fn emitted<P: Probe + ?Sized>(
        &self,
        segment: &Segment,
        hit: &Hit,
        frame: &Frame,
        material: &MaterialPoint,
        is_direct: bool,
        probe: &mut P,
    ) -> Rgb {
        let emission = seen_emission(material, frame.outside);
        if emission.is_black() {
            return emission;
        }
        if segment.asked == Asked::Along && self.lights.is_light_of_shadow_rays(self.world, hit) {
            probe.path(PathEvent::LeftOut(PathEmitter::Surface));
            return Rgb::BLACK;
        }
        let Some(ScatteredFrom { receiver, choice, pdf }) = &segment.scattered else {
            return found(PathEmitter::Surface, emission, None, probe);
        };
        let emission = self.lights.lit(self.world, hit, emission, receiver.point.distance(frame.exact));
        let densities = is_direct.then(|| {
            let source = self.lights.pdf_of_hit(self.world, (receiver, choice), hit, frame.exact, frame.outer);
            PathDensities { scattering: *pdf, source }
        });
        found(PathEmitter::Surface, emission, densities, probe)
    }

    /// Leaves a path one channel of three at a body that refracts them by different angles.
    fn disperse<P: Probe + ?Sized>(&self, path: &mut Path, met: &VisibleHit, probe: &mut P) {
        if path.channel.is_none() && self.world.material(&met.hit).is_dispersive() {
            // Each as often as the throughput has it, so that those that are left out take little light with them.
            let shares = path.throughput.to_array().map(f64::from);
            let sum: f64 = shares.iter().sum();
            if sum == 0.0 {
                return;
            }
            let u = path.sample.one(path.place.of(uses::CHANNEL)) * sum;
            let channel = match shares {
                [r, g, b] if b > 0.0 && u >= r + g => 2,
                [r, g, _] if g > 0.0 && u >= r => 1,
                _ => 0,
            };
            let mut one = [0.0; 3];
            one[channel] = (sum / shares[channel]) as f32;
            let factor = Rgb::from(one);
            path.throughput = path.throughput * factor;
            path.channel = Some(channel);
            probe.path(PathEvent::Dispersed { channel: PathChannel::ALL[channel], factor });
        }
    }

    /// The scattering at a surface. A path of one channel meets that channel's η.
    pub(super) fn vertex(&mut self, met: &VisibleHit, frame: Frame, channel: Option<usize>) -> SurfaceVertex {
        let described = self.world.material(&met.hit);
        let crossing = match met.crossing {
            SIMPLE => Some(self.media.simple(self.world, &met.hit, frame.outside, met.inside)),
            crossing => self.media.crossing(crossing).copied(),
        };
        let dispersed = channel.zip(described.standard().filter(|surface| surface.is_dispersive()));
        let eta = dispersed.map_or(met.material.classic.eta, |(channel, surface)| surface.dispersed_ior()[channel]);
        let eta = f64::from(eta);
        let eta_ratio = match crossing.map(|crossing| crossing.refraction) {
            Some(Refraction::Outer(outer)) if frame.outside => outer / eta,
            Some(Refraction::Outer(outer)) => eta / outer,
            Some(Refraction::Straight) | None => 1.0,
        };
        let tangent = match described.is_anisotropic() {
            true => {
                let tangents = self.world.tangent_frame(met.line, &met.hit);
                stretched_along(tangents, frame.normal, &met.material)
            }
            false => DVec3::ZERO,
        };
        let Frame { normal, facing, outside, .. } = frame;
        let is_closed = crossing.is_some();
        let scattering = ScatteringFrame { normal, facing, tangent, outside, eta_ratio, is_closed };
        let bsdf = described.bsdf(&met.material, scattering);
        let opaque = (!is_closed).then_some(frame.normal);
        let is_delta = bsdf.is_delta();
        let guide = self.guide.filter(|_| !is_delta).and_then(|field| field.at(frame.exact, opaque));
        SurfaceVertex { hit: met.hit_inside(), frame, bsdf: bsdf.seen_from(frame.wo), is_delta, guide, crossing }
    }

    /// The bodies that a ray is in after it leaves a vertex, and the coinciding surface there. None if it goes into a
    /// body of which nothing is known.
    pub(super) fn inside_after(&mut self, vertex: &Vertex, wi: DVec3) -> Option<[u32; 2]> {
        let SurfaceVertex { hit: met, frame, crossing, bsdf, .. } = match vertex {
            Vertex::Surface(surface) => surface,
            Vertex::Medium(MediumVertex { inside, .. }) | Vertex::Meter(MeterVertex { inside, .. }) => {
                return Some([*inside, NONE]);
            }
        };
        if wi.dot(frame.facing) < 0.0 {
            let is_thin = matches!(bsdf, SeenBsdf::Standard(standard) if standard.bsdf.is_thin_walled());
            let beyond = crossing.map(|crossing| [crossing.beyond, crossing.next]);
            return beyond.or_else(|| is_thin.then_some([met.inside, NONE]));
        }
        let back = self.media.crossing(met.crossing).map_or(NONE, |crossing| crossing.back);
        Some([self.inside_before(met, frame.outside), back])
    }
}

/// The direction that highlights are stretched along: the tangent, turned towards the bitangent.
fn stretched_along([tangent, bitangent]: [DVec3; 2], normal: DVec3, material: &MaterialPoint) -> DVec3 {
    let degrees = material.standard.map_or(0.0, |standard| standard.specular.anisotropy_rotation);
    if degrees == 0.0 {
        return tangent;
    }
    let (sin, cos) = libm::sincos(f64::from(degrees).to_radians());
    let tangent = tangent.reject_from_normalized(normal).normalize_or_zero();
    let across = normal.cross(tangent);
    let across = if across.dot(bitangent) < 0.0 { -across } else { across };
    tangent * cos + across * sin
}

/// Light that a path finds, with its weight.
fn found<P: Probe + ?Sized>(
    emitter: PathEmitter,
    radiance: Rgb,
    densities: Option<PathDensities>,
    probe: &mut P,
) -> Rgb {
    probe.path(PathEvent::Found { emitter, radiance, densities });
    densities.map_or(radiance, |densities| radiance * densities.weight_of_scattering())
}
