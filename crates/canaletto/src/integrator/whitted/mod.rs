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
mod media;
mod meet;
mod octet;
mod stop;
mod way;

use super::{Probe, RayCounts};
use crate::light::Source;
use crate::math::{Line, Rgb, Spread};
use crate::sampler::{Sample, Sampler};
use crate::scene::{IntegratorSettings, Stage};
use crate::shape::Encounters;
use crate::world::{Blocker, Bundle, Crossings, World};
use light::Lighting;
use media::Media;
use stop::{Footprint, Stop, Stops};
use way::Ways;

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
    /// What the rays of the last stops meet.
    encounters: Encounters,
    /// Shadow rays through what is clear, kept likewise.
    crossings: Crossings,
    /// Memory of bundles that have been shaded.
    spare: Vec<Generation>,
    /// Memory for lights.
    lighting: Lighting,
    /// The bodies that rays are in.
    media: Media,
}

/// Rays that are traced together, and where they are met.
#[derive(Default)]
struct Generation {
    ways: Ways,
    /// For each of them, the stop of the generation before that it comes from.
    parents: Vec<u32>,
    /// What they bring.
    colors: Vec<Rgb>,
    stops: Stops,
    /// Of each stop, if its way spreads.
    footprints: Vec<Footprint>,
}

/// How many rays from the eye and child rays are followed before somebody is asked whether they are still wanted.
const PATIENCE: u32 = 4096;

/// The most rays from the eye that are traced together: their stops should stay in the nearer caches.
pub(crate) const BUNDLE: usize = 256;

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
            encounters: Encounters::NONE,
            crossings: Crossings::default(),
            spare: Vec::new(),
            lighting: Lighting::default(),
            media: Media::default(),
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
        self.depart(&[line.into()], &[self.sample], spread.copied());
        self.arrive(probe)[0]
    }

    /// Lets rays from the eye wait for others of their time, of which the last ones should go nearly the same way. There are as many
    /// `samples` as `lines`, and `spreads`, unless nothing wants to know them; they are as for [`Whitted::eye`].
    pub(crate) fn depart(&mut self, lines: &[Line], samples: &[Sample], spreads: impl IntoIterator<Item = Spread>) {
        self.ask(lines.len() as u32);
        self.waiting.ways.push_eyes(lines, samples, spreads);
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
        if self.world.has_clear() {
            let Whitted { world, time, media, .. } = self;
            let depth = self.settings.max_depth;
            media.clear();
            generation.ways.set_around(|line| media.around_eye(world, line.origin, *time, depth));
        }
        self.trace(&mut generation, probe);
        generation.ways.clear();
        self.waiting = generation;
        &self.waiting.colors
    }

    /// An empty one.
    fn generation(&mut self) -> Generation {
        let mut generation = self.spare.pop().unwrap_or_default();
        generation.ways.clear();
        generation.parents.clear();
        generation
    }

    /// Box 5.8, `trace`: the colours of the nearest surfaces, or the background. With a probe there is one ray.
    fn trace<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        debug_assert!(!P::ACTIVE || generation.ways.len() == 1);
        self.meet(generation, probe);
        if generation.stops.len() == 0 || self.gave_up {
            return;
        }
        self.shade(generation, probe);
        for stop in generation.stops.each_mut() {
            let (print, share) = stop.material.print;
            if share > 0.0 {
                probe.print(print, share);
                stop.color = (print * share + stop.color * (1.0 - share)).saturated();
            }
        }
        self.pass(generation, probe);
        for stop in generation.stops.each() {
            generation.colors[stop.way()] = stop.color;
            probe.end(stop.color);
        }
    }

    /// Box 5.8, `shade`: (5.39b), as far as the stage goes.
    fn shade<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        let stage = self.settings.stage;
        // Under an opaque print nothing is seen of the rest.
        let seen = |stop: &&mut Stop| stop.is_seen();
        if stage == Stage::Unlit {
            for stop in generation.stops.each_mut().iter_mut().filter(seen) {
                stop.color = stop.material.phong.kd;
                probe.unlit(stop.color);
            }
            return;
        }
        if stage >= Stage::Ambient {
            for stop in generation.stops.each_mut().iter_mut().filter(seen) {
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
        for stop in generation.stops.each_mut().iter_mut().filter(seen) {
            stop.color = stop.color.saturated();
        }
    }

    /// Asks now and then whether to give up; before this many rays.
    #[inline]
    fn ask(&mut self, rays: u32) {
        if let Some(patience) = self.patience.checked_sub(rays) {
            self.patience = patience;
        } else {
            self.patience = PATIENCE;
            self.gave_up |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
    }
}
