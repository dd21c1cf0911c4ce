//! The chapter's recursive ray tracing (box 5.8; Whitted 1980): `trace` finds the nearest surfaces, `shade` sums
//! (5.39b) there and calls `trace` for mirrors and clear bodies.
//!
//! Rays go in bundles: those of neighbouring samples are traced together, then their shadow rays to one point of light,
//! then those from their mirrors, then those into their clear bodies. A bundle of one ray takes the steps of the chapter's
//! recursion in the chapter's order, which is what a probe watches; the rays of a larger one take the same steps side by side.
//!
//! Deviations, from `chapter-decisions`: the normal faces the viewer; a shadow ray passes clear surfaces by their
//! 1 − o; beyond the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the
//! largest number ([`Rgb::saturated`]), so that no colour is ever infinite or NaN.

mod children;
mod light;
mod octet;
mod way;

use super::{Probe, RayCounts};
use crate::light::Source;
use crate::math::{Line, Rgb, Spread, offset_origin};
use crate::sampler::{Sample, Sampler};
use crate::scene::{IntegratorSettings, Stage};
use crate::world::{Blocker, Bundle, Hit, World};
use glam::DVec3;
use light::Lighting;
use way::{Branch, Footprint, Met, Stop, Way};

/// The classic integrator on one world.
pub struct Whitted<'w> {
    world: &'w World,
    settings: IntegratorSettings,
    /// The rays traced so far.
    pub counts: RayCounts,
    /// Asked now and then whether to give up.
    cancelled: Option<&'w (dyn Fn(u64) -> bool + Sync)>,
    /// Whether it said so: from then on no child ray is followed, and colours are worth nothing.
    gave_up: bool,
    /// Rays until it is asked again.
    patience: u32,
    /// What stood in each light's way last.
    blockers: Vec<Blocker>,
    /// Where random numbers come from.
    sample: Sample,
    /// When it is, from the shutter's opening at 0 to its closing at 1.
    time: f32,
    /// The world's lights at that time; empty if none of them moves.
    lights: Vec<Source>,
    /// Rays from the eye that have not been traced.
    waiting: Generation,
    /// What is asked of the world.
    bundle: Bundle,
    /// Memory of bundles that have been shaded.
    spare: Vec<Generation>,
    /// Memory for lights.
    lighting: Lighting,
}

/// Rays that are traced together, and where they are met.
#[derive(Default)]
struct Generation {
    ways: Vec<Way>,
    /// How each of them spreads, if anything wants to know.
    spreads: Vec<Spread>,
    /// For each of them, the stop of the generation before that it comes from.
    parents: Vec<u32>,
    /// What they bring.
    colors: Vec<Rgb>,
    stops: Vec<Stop>,
    /// Of each stop, if its way spreads.
    footprints: Vec<Footprint>,
}

/// How many rays from the eye and child rays are followed before somebody is asked whether they are still wanted.
const PATIENCE: u32 = 4096;

/// The most rays from the eye that are traced together: their stops should stay in the nearer caches.
pub(crate) const BUNDLE: usize = 128;

/// The most holes that a ray goes through; beyond them it meets what is around the next one.
const MAX_HOLES: usize = 1 << 16;

impl<'w> Whitted<'w> {
    /// An integrator that has traced nothing yet.
    pub fn new(world: &'w World, settings: IntegratorSettings) -> Whitted<'w> {
        Whitted {
            world,
            settings,
            counts: RayCounts::default(),
            cancelled: None,
            gave_up: false,
            patience: PATIENCE,
            blockers: vec![Blocker::NONE; world.lights.len()],
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            lights: if world.lights_move() { world.lights.clone() } else { Vec::new() },
            waiting: Generation::default(),
            bundle: Bundle::default(),
            spare: Vec::new(),
            lighting: Lighting::default(),
        }
    }

    /// The same integrator, which asks now and then, with the rays traced so far, whether to give up: a single pixel between mirrors and clear bodies
    /// can take longer than anybody waits, since every level of its tree may double the rays.
    pub fn until(self, cancelled: &'w (dyn Fn(u64) -> bool + Sync)) -> Whitted<'w> {
        Whitted { cancelled: Some(cancelled), ..self }
    }

    /// Whether it gave up. The colours that it returned since are worth nothing.
    pub fn gave_up(&self) -> bool {
        self.gave_up
    }

    /// The world it traces.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// Begins a sample of a pixel: where random numbers come from until the next one, and when it is, from the shutter's
    /// opening at 0 to its closing at 1.
    #[inline]
    pub fn begin(&mut self, sample: Sample, time: f32) {
        self.sample = sample;
        if time != self.time {
            self.time = time;
            self.world.move_lights(&mut self.lights, time);
        }
    }

    /// The colour that an eye ray brings. `spread` is how it changes to the neighbouring samples, if the world
    /// [wants](World::wants_spread) to know.
    pub fn eye<P: Probe>(&mut self, line: impl Into<Line>, spread: Option<&Spread>, probe: &mut P) -> Rgb {
        self.depart(line.into(), spread.copied(), self.sample);
        self.arrive(probe)[0]
    }

    /// Lets a ray from the eye wait for others of its time, of which the last ones should go nearly the same way. `spread` is as
    /// for [`Whitted::eye`].
    #[inline]
    pub(crate) fn depart(&mut self, line: Line, spread: Option<Spread>, sample: Sample) {
        self.ask();
        self.waiting.ways.push(Way { ray: line.rounded(), line, branch: Branch::eye(), sample });
        if let Some(spread) = spread {
            self.waiting.spreads.push(spread);
        }
    }

    /// Whether as many wait as are best traced together.
    #[inline]
    pub(crate) fn is_full(&self) -> bool {
        self.waiting.ways.len() >= BUNDLE
    }

    /// The colours that the waiting rays bring.
    pub(crate) fn arrive<P: Probe>(&mut self, probe: &mut P) -> &[Rgb] {
        if self.waiting.ways.is_empty() {
            return &[];
        }
        let mut generation = std::mem::take(&mut self.waiting);
        self.trace(&mut generation, probe);
        generation.ways.clear();
        generation.spreads.clear();
        self.waiting = generation;
        &self.waiting.colors
    }

    /// An empty one.
    fn generation(&mut self) -> Generation {
        let mut generation = self.spare.pop().unwrap_or_default();
        generation.ways.clear();
        generation.spreads.clear();
        generation.parents.clear();
        generation
    }

    /// Box 5.8, `trace`: the colours of the nearest surfaces, or the background. With a probe there is one ray.
    fn trace<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        debug_assert!(!P::ACTIVE || generation.ways.len() == 1);
        self.meet(generation, probe);
        if generation.stops.is_empty() {
            return;
        }
        self.shade(generation, probe);
        for stop in &mut generation.stops {
            let (print, share) = stop.material.print;
            if share > 0.0 {
                probe.print(print, share);
                stop.color = (print * share + stop.color * (1.0 - share)).saturated();
            }
        }
        self.pass(generation, probe);
        for stop in &generation.stops {
            generation.colors[stop.way as usize] = stop.color;
            probe.end(stop.color);
        }
    }

    /// The nearest surfaces on the ways, past holes. Colours become what is seen where there is none.
    fn meet<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        let Generation { ways, spreads, colors, stops, footprints, .. } = generation;
        colors.clear();
        stops.clear();
        footprints.clear();
        self.bundle.clear();
        for way in &*ways {
            probe.ray(way.branch.kind, &way.ray, way.branch.depth, way.branch.factor);
            self.counts.of_mut(way.branch.kind).traced += 1;
            self.bundle.push(way.ray, f32::INFINITY);
        }
        let world = self.world;
        world.intersect_bundle(&mut self.bundle, self.time);
        for (index, way) in ways.iter().enumerate() {
            let spread = spreads.get(index);
            let found = self.bundle.hit(index).map(|hit| (hit, world.material(&hit)));
            // It starts anew behind holes.
            let mut last = way.line;
            let met = match found {
                Some((hit, material)) if material.textures.is_empty() => {
                    // Only a probe asks for texture coordinates that no texture reads.
                    let surface =
                        if P::ACTIVE { world.surface(way.line, &hit) } else { world.bare_surface(way.line, &hit) };
                    let material = material.at(&surface);
                    if let Some(footprint) = Footprint::new(spread, &way.line, &surface) {
                        footprints.push(footprint);
                    }
                    stops.push(Stop::new(index, hit, surface, material, &way.line));
                    true
                }
                Some((hit, _)) => match self.meet_textured(way, hit, spread, probe) {
                    Some(Met { hit, surface, material, line, footprint }) => {
                        footprints.extend(footprint);
                        stops.push(Stop::new(index, hit, surface, material, &line));
                        last = line;
                        true
                    }
                    None => false,
                },
                None => false,
            };
            colors.push(if met { Rgb::BLACK } else { self.background(way.line.direction, spread, probe) });
            if !met {
                probe.miss(colors[index]);
                probe.end(colors[index]);
                continue;
            }
            self.counts.of_mut(way.branch.kind).hit += 1;
            let stop = &stops[stops.len() - 1];
            probe.hit(&stop.hit, &stop.surface, &stop.material, stop.outside);
            if let Some(footprint) = footprints.last_mut()
                && (stop.material.is_mirror() || stop.material.is_clear())
            {
                let side = if stop.outside { 1.0 } else { -1.0 };
                footprint.bend = world.patch(last, &stop.hit).bend * side;
            }
        }
    }

    #[inline(never)]
    fn meet_textured<P: Probe>(&self, way: &Way, mut hit: Hit, spread: Option<&Spread>, probe: &mut P) -> Option<Met> {
        let (mut line, mut spread) = (way.line, spread.copied());
        for holes in 0.. {
            let mut surface = self.world.surface(line, &hit);
            let footprint = Footprint::new(spread.as_ref(), &line, &surface);
            let step = footprint.map(|f| f.step);
            let material = self.world.textured(line, &hit, &mut surface, step, probe);
            if material.coverage > 0.0 || holes == MAX_HOLES {
                return Some(Met { hit, surface, material, line, footprint });
            }
            probe.hole(&hit);
            line.origin = surface.exact;
            spread = footprint.map(|f| f.spread.passed(f.step));
            let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            hit = self.world.intersect_at(&line.from_origin(origin), f32::INFINITY, self.time)?;
        }
        None
    }

    /// What a ray in this direction sees where it meets nothing.
    fn background<P: Probe>(&self, direction: DVec3, spread: Option<&Spread>, probe: &mut P) -> Rgb {
        let Some(environment) = &self.world.environment else { return self.world.background };
        let sighting = environment.look(direction, spread.map_or([DVec3::ZERO; 2], |spread| spread.direction));
        probe.sighting(&sighting);
        sighting.radiance
    }

    /// Box 5.8, `shade`: (5.39b), as far as the stage goes.
    fn shade<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        let stage = self.settings.stage;
        // Under an opaque print nothing is seen of the rest.
        let seen = |stop: &&mut Stop| stop.is_seen();
        if stage == Stage::Unlit {
            for stop in generation.stops.iter_mut().filter(seen) {
                stop.color = stop.material.phong.kd;
                probe.unlit(stop.color);
            }
            return;
        }
        if stage >= Stage::Ambient {
            for stop in generation.stops.iter_mut().filter(seen) {
                let ambient = (self.world.ambient * stop.material.phong.kd).saturated(); // (5.33)
                probe.ambient(ambient);
                stop.color += ambient;
            }
        }
        self.light(generation, probe);
        if stage >= Stage::Reflection {
            self.reflect(generation, probe);
        }
        if stage >= Stage::Full {
            self.refract(generation, probe);
        }
        for stop in generation.stops.iter_mut().filter(seen) {
            stop.color = stop.color.saturated();
        }
    }

    /// Asks now and then whether to give up.
    #[inline]
    fn ask(&mut self) {
        self.patience -= 1;
        if self.patience == 0 {
            self.patience = PATIENCE;
            self.gave_up |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
    }
}
