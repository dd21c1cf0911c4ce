//! Which clear bodies a ray is inside, and what it crosses where faces coincide.
//!
//! Each ray has a set of bodies that it is in; the one of them that [fills](Body::fills_before) the place is its medium. Sets are lists that
//! share their tails, in an arena that grows with the tree of rays and shrinks with it.
//!
//! Where faces coincide, a ray first leaves bodies, then meets what is open or opaque, then enters bodies: between bodies and
//! anything else there is a gap of no width. Where nothing stands in the gap there is none: a ray from one body into the next is bent once.
//! Each of these surfaces is a stop of its own.

use crate::integrator::Probe;
use crate::math::Line;
use crate::shape::Surface;
use crate::world::{Body, Contact, Hit, World};
use glam::DVec3;
use std::cmp::Ordering;

/// No set of bodies, or no crossing.
pub(super) const NONE: u32 = u32::MAX;

/// A body that a ray is in, and those that fill less.
#[derive(Clone, Copy)]
struct Inside {
    body: Body,
    /// How often; less than 0 where a ray has left a body that it wasn't in, as happens with surfaces turned inside out.
    count: i32,
    /// The rest of the set.
    rest: u32,
}

/// How a ray is bent where it crosses a surface.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Bend {
    /// Not at all: further surfaces of the same boundary follow.
    Straight,
    /// Between the surface's own η and this, which is on its outer side.
    Outer(f64),
}

/// A surface that a ray may cross, and what follows.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    pub(super) hit: Hit,
    pub(super) bend: Bend,
    /// The bodies that a ray beyond it is in.
    pub(super) beyond: u32,
    /// The surface in the same place that a ray beyond it meets next, or [`NONE`].
    pub(super) next: u32,
    /// The one that came before it, or [`NONE`].
    before: u32,
    /// The one in the same place that a ray mirrored from it meets next, or [`NONE`].
    pub(super) back: u32,
    /// Whether there is anything else in the same place.
    pub(super) touches: bool,
}

impl Crossing {
    /// That of a surface at `hit`, on whose outer side η is `outer`, with nothing else in the same place.
    fn alone(hit: Hit, outer: f64, beyond: u32) -> Crossing {
        let bend = Bend::Outer(outer);
        Crossing { hit, bend, beyond, next: NONE, before: NONE, back: NONE, touches: false }
    }
}

/// The sets of bodies and the crossings of all rays under way.
#[derive(Default)]
pub(super) struct Media {
    inside: Vec<Inside>,
    crossings: Vec<Crossing>,
    /// Where and when an eye was last, and the bodies around it, from those that fill most.
    eye: Option<(DVec3, f32)>,
    around: Vec<(Body, i32)>,
    /// Their set, if the arena holds it.
    eye_set: Option<u32>,
    contacts: Vec<Contact>,
    scratch: Vec<Inside>,
}

/// How far the arena has grown.
#[derive(Clone, Copy)]
pub(super) struct Mark(usize, usize);

/// What a ray does where it meets something that is clear, or from within a body.
pub(super) enum Boundary {
    /// It stops there, as at any surface.
    Plain,
    /// It stops at this crossing first.
    At(u32),
    /// It goes on: another body fills the place. From then on it is in these.
    Hidden(u32),
}

/// A surface at a boundary while it is sorted.
#[derive(Clone, Copy)]
struct Met {
    hit: Hit,
    body: Option<Body>,
    outside: bool,
    opaque: bool,
}

impl Met {
    /// The place in the order in which a ray meets what coincides.
    fn turn(&self) -> u32 {
        match (self.body, self.opaque, self.outside) {
            (Some(_), _, false) => 0,
            (None, false, false) => 1,
            (None, true, _) => 2,
            (None, false, true) => 3,
            (Some(_), _, true) => 4,
        }
    }
}

impl Media {
    pub(super) fn clear(&mut self) {
        self.inside.clear();
        self.crossings.clear();
        self.eye_set = None;
    }

    pub(super) fn mark(&self) -> Mark {
        Mark(self.inside.len(), self.crossings.len())
    }

    /// Forgets all that came after.
    pub(super) fn release(&mut self, Mark(inside, crossings): Mark) {
        self.inside.truncate(inside);
        self.crossings.truncate(crossings);
    }

    #[inline]
    pub(super) fn crossing(&self, number: u32) -> Option<&Crossing> {
        self.crossings.get(number as usize)
    }

    /// The bodies that an eye is in; of more than `depth`, as many fill the place that a ray can leave.
    pub(super) fn around_eye(&mut self, world: &World, eye: DVec3, time: f32, depth: u32) -> u32 {
        if self.eye != Some((eye, time)) {
            (self.eye, self.eye_set) = (Some((eye, time)), None);
            self.around = nearest_filling(world.bodies_around(eye, time), depth);
        }
        if let Some(set) = self.eye_set {
            return set;
        }
        let mut set = NONE;
        for &(body, count) in self.around.iter().rev() {
            self.inside.push(Inside { body, count, rest: set });
            set = self.inside.len() as u32 - 1;
        }
        self.eye_set = Some(set);
        set
    }

    /// The body that fills the place where a ray in these bodies is.
    fn filling(&self, mut set: u32) -> Option<&Body> {
        while let Some(inside) = self.inside.get(set as usize) {
            if inside.count > 0 {
                return Some(&inside.body);
            }
            set = inside.rest;
        }
        None
    }

    /// The one that would fill it without this one.
    fn filling_besides(&self, mut set: u32, body: &Body) -> Option<&Body> {
        while let Some(inside) = self.inside.get(set as usize) {
            if inside.count > 0 && inside.body.id != body.id {
                return Some(&inside.body);
            }
            set = inside.rest;
        }
        None
    }

    /// Its η; 1 outside of all bodies.
    pub(super) fn eta(&self, set: u32) -> f64 {
        self.filling(set).map_or(1.0, |body| f64::from(body.eta))
    }

    fn count(&self, mut set: u32, body: &Body) -> i32 {
        while let Some(inside) = self.inside.get(set as usize) {
            if inside.body.id == body.id {
                return inside.count;
            }
            set = inside.rest;
        }
        0
    }

    /// The set with the body entered or left.
    fn changed(&mut self, set: u32, body: &Body, enters: bool) -> u32 {
        self.scratch.clear();
        let (mut rest, mut count) = (set, 0);
        while let Some(&inside) = self.inside.get(rest as usize) {
            if inside.body.id != body.id && !inside.body.fills_before(body) {
                break;
            }
            rest = inside.rest;
            if inside.body.id == body.id {
                count = inside.count;
                break;
            }
            self.scratch.push(inside);
        }
        count += if enters { 1 } else { -1 };
        if !body.overlaps_itself {
            count = count.clamp(-1, 1);
        }
        let mut set = rest;
        if count != 0 {
            self.inside.push(Inside { body: *body, count, rest });
            set = self.inside.len() as u32 - 1;
        }
        for at in (0..self.scratch.len()).rev() {
            self.inside.push(Inside { rest: set, ..self.scratch[at] });
            set = self.inside.len() as u32 - 1;
        }
        set
    }

    /// What becomes of a ray in the bodies of `set` whose line meets `surface` at `hit`.
    pub(super) fn boundary<P: Probe>(
        &mut self,
        world: &World,
        (line, hit, surface): (&Line, &Hit, &Surface),
        set: u32,
        probe: &mut P,
    ) -> Boundary {
        let met = |hit: &Hit, outside: bool| {
            let body = world.body(hit);
            Met { hit: *hit, body, outside, opaque: body.is_none() && world.material(hit).is_opaque() }
        };
        let first = met(hit, line.direction.dot(surface.normal) < 0.0);
        let mut contacts = std::mem::take(&mut self.contacts);
        world.contacts(line, hit, surface, &mut contacts);
        let boundary = if contacts.is_empty() {
            self.alone(&first, set, probe)
        } else {
            let others = contacts.iter().map(|contact| met(&contact.hit, contact.outside));
            let mut all: Vec<Met> = std::iter::once(first).chain(others).collect();
            // Sorting is stable: what was met first comes first.
            all.sort_by_key(Met::turn);
            self.together(&all, hit, set, probe)
        };
        self.contacts = contacts;
        boundary
    }

    /// A surface where nothing else is.
    fn alone<P: Probe>(&mut self, met: &Met, set: u32, probe: &mut P) -> Boundary {
        if met.opaque {
            return Boundary::Plain;
        }
        let Some(body) = &met.body else {
            return Boundary::At(self.push(Crossing::alone(met.hit, self.eta(set), set)));
        };
        let beyond = self.changed(set, body, met.outside);
        if self.is_hidden(body, set, if met.outside { set } else { beyond }) {
            probe.hidden(&met.hit);
            return Boundary::Hidden(beyond);
        }
        let outer = self.filling_besides(set, body).map_or(1.0, |body| f64::from(body.eta));
        Boundary::At(self.push(Crossing::alone(met.hit, outer, beyond)))
    }

    /// Whether the surface of a body isn't there: among the bodies of `set` another one fills the place, or a ray on its outer side is in
    /// the same body still.
    fn is_hidden(&self, body: &Body, set: u32, outer: u32) -> bool {
        self.filling_besides(set, body).is_some_and(|other| other.fills_before(body))
            || body.overlaps_itself && self.count(outer, body) > 0
    }

    fn push(&mut self, crossing: Crossing) -> u32 {
        self.crossings.push(crossing);
        self.crossings.len() as u32 - 1
    }

    /// Surfaces in the same place, in the order in which they are met; `first` is the one that a ray was found to meet.
    fn together<P: Probe>(&mut self, all: &[Met], first: &Hit, set: u32, probe: &mut P) -> Boundary {
        let opaque = all.iter().position(|met| met.opaque);
        let mut gap = set;
        for body in sides(all, false) {
            gap = self.changed(gap, body, false);
        }
        let mut beyond = gap;
        if opaque.is_none() {
            for body in sides(all, true) {
                beyond = self.changed(beyond, body, true);
            }
        }
        let mut seen = Vec::with_capacity(all.len());
        for (index, met) in all.iter().enumerate() {
            // Nothing shows behind what is opaque, or beside it.
            if opaque.is_some_and(|opaque| index > opaque) {
                break;
            }
            match &met.body {
                Some(body) if self.is_hidden(body, if met.outside { beyond } else { set }, gap) => {
                    probe.hidden(&met.hit)
                }
                _ => seen.push(*met),
            }
        }
        if let [Met { opaque: true, hit, .. }] = &seen[..]
            && hit == first
        {
            return Boundary::Plain;
        }
        let Some(last) = seen.len().checked_sub(1) else { return Boundary::Hidden(beyond) };
        let is_gap = seen.iter().any(|met| met.body.is_none());
        let [eta_before, eta_gap, eta_beyond] = [set, gap, beyond].map(|set| self.eta(set));
        let base = self.crossings.len() as u32;
        for (index, met) in (0..).zip(&seen) {
            let is_last = index == last as u32;
            let outer = match (is_gap, met.outside) {
                (true, _) => eta_gap,
                (false, true) => eta_before,
                (false, false) => eta_beyond,
            };
            let between = if is_gap { gap } else { set };
            self.push(Crossing {
                bend: if is_gap || is_last { Bend::Outer(outer) } else { Bend::Straight },
                next: if is_last { NONE } else { base + index + 1 },
                before: if index == 0 { NONE } else { base + index - 1 },
                touches: true,
                ..Crossing::alone(met.hit, outer, if is_last { beyond } else { between })
            });
        }
        if is_gap {
            self.way_back(base, seen.len() as u32, [set, gap], eta_gap);
        }
        Boundary::At(base)
    }

    /// What rays meet that are mirrored from the surfaces in a gap, back through those before them.
    fn way_back(&mut self, base: u32, count: u32, [set, gap]: [u32; 2], eta_gap: f64) {
        let mut back = NONE;
        for number in base..base + count {
            self.crossings[number as usize].back = back;
            let hit = self.crossings[number as usize].hit;
            let beyond = if number == base { set } else { gap };
            back = self.push(Crossing { next: back, touches: true, ..Crossing::alone(hit, eta_gap, beyond) });
        }
    }

    /// Calls `f` with each surface in the same place that a ray crossed before it came to this one.
    pub(super) fn for_before(&self, crossing: u32, mut f: impl FnMut(&Hit)) {
        let mut before = self.crossing(crossing).map_or(NONE, |crossing| crossing.before);
        while let Some(crossing) = self.crossing(before) {
            f(&crossing.hit);
            before = crossing.before;
        }
    }
}

/// The bodies in the order in which they fill the place; as many as a ray can leave.
fn nearest_filling(mut around: Vec<(Body, i32)>, depth: u32) -> Vec<(Body, i32)> {
    around.sort_by(|(a, _), (b, _)| if a.fills_before(b) { Ordering::Less } else { Ordering::Greater });
    around.truncate(depth as usize + 1);
    around
}

/// The bodies that are left, or those that are entered.
fn sides(all: &[Met], entered: bool) -> impl Iterator<Item = &Body> {
    all.iter().filter(move |met| met.outside == entered).filter_map(|met| met.body.as_ref())
}
