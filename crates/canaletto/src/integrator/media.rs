//! The clear bodies that a ray is in, and the surfaces that it crosses where faces coincide.
//!
//! Each ray has a set of bodies that it is in. The medium of a ray is the body of the set that
//! [fills](Body::fills_before) the place. Sets are lists that share their tails. They lie in an arena that grows and
//! shrinks with the tree of rays.
//!
//! Where faces coincide, a ray first leaves bodies, then hits open or opaque surfaces, then enters bodies. An open or
//! opaque surface therefore lies in a gap of zero width between bodies. Without such a surface there is no gap, and a
//! ray from one body into the next is refracted once. Each of these surfaces is an interaction of its own.
//!
//! A hit overrides the set. A ray that hits a shape from inside was in it, and a ray that hits it from outside was not.
//! A ray that hits something else is in a shape only if it hits the shape from inside later.
//!
//! Bodies are counted anew along the ray where rounding may have led past one of their faces. This happens by an edge
//! of a mesh, and where other faces cross the place. A wrong body therefore stays in a set no longer than to the next
//! surface.

use crate::math::DRay;
use crate::shape::Surface;
use crate::world::{Body, Contact, Hit, World};
use canaletto_bvh::Ray;
use glam::DVec3;
use std::cmp::Ordering;

/// The empty set of bodies, or no crossing.
pub(in crate::integrator) const NONE: u32 = u32::MAX;

/// A crossing that [`Media::simple`] computes when a ray goes on.
pub(in crate::integrator) const SIMPLE: u32 = NONE - 1;

/// A body that a ray is in, with the rest of the set. The rest fills after it.
#[derive(Clone, Copy)]
struct BodyEntry {
    body: Body,
    /// The number of times that the ray has entered the body, less the times that it has left it. It is negative for
    /// meshes turned inside out, where a ray leaves a body that it wasn't in.
    count: i32,
    /// Whether the body is to be counted anew along the ray.
    uncertain: bool,
    /// The rest of the set.
    rest: u32,
}

/// The refraction of a ray where it crosses a surface.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::integrator) enum Refraction {
    /// No refraction: further surfaces of the boundary follow.
    Straight,
    /// Refraction between the surface's own η and this η on its outer side.
    Outer(f64),
}

/// A surface that a ray may cross, and the surfaces that coincide with it.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Crossing {
    pub(in crate::integrator) hit: Hit,
    pub(in crate::integrator) refraction: Refraction,
    /// The bodies of a ray beyond the surface.
    pub(in crate::integrator) beyond: u32,
    /// The coinciding surface that a ray beyond this one crosses next, or [`NONE`].
    pub(in crate::integrator) next: u32,
    /// The coinciding surface that came before this one, or [`NONE`].
    before: u32,
    /// The coinciding surface that a ray mirrored here crosses next, or [`NONE`].
    pub(in crate::integrator) back: u32,
    /// Whether any surface coincides with this one.
    pub(in crate::integrator) touches: bool,
}

impl Crossing {
    /// The crossing of a surface at `hit` that nothing coincides with. `outer` is η on its outer side.
    fn isolated(hit: Hit, outer: f64, beyond: u32) -> Crossing {
        let refraction = Refraction::Outer(outer);
        Crossing { hit, refraction, beyond, next: NONE, before: NONE, back: NONE, touches: false }
    }
}

/// The sets of bodies and the crossings of all rays in flight.
#[derive(Default)]
pub(in crate::integrator) struct Media {
    inside: Vec<BodyEntry>,
    crossings: Vec<Crossing>,
    /// The last eye position and time. `around` holds the bodies around it; bodies that fill first come first.
    eye: Option<(DVec3, f32)>,
    around: Vec<(Body, i32)>,
    /// The set of these bodies, if the arena holds it.
    eye_set: Option<u32>,
    contacts: Vec<Contact>,
    scratch: Vec<BodyEntry>,
}

/// The size of the arena at some moment.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct ArenaMark(usize, usize);

/// The result of a ray's hit on a clear surface, or of a hit from inside a body.
pub(in crate::integrator) enum Boundary {
    /// An interaction as on any surface.
    Plain,
    /// An interaction at this crossing comes first.
    At(u32),
    /// No interaction, because another body fills the place. The ray goes on in this set of bodies.
    Hidden(u32),
}

/// A surface at a boundary while its surfaces are sorted.
#[derive(Clone, Copy)]
struct BoundaryHit {
    hit: Hit,
    body: Option<Body>,
    outside: bool,
    opaque: bool,
}

impl BoundaryHit {
    /// The rank in the order in which a ray crosses coinciding surfaces.
    fn crossing_rank(&self) -> u32 {
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
    pub(in crate::integrator) fn clear(&mut self) {
        self.inside.clear();
        self.crossings.clear();
        self.eye_set = None;
    }

    pub(in crate::integrator) fn mark(&self) -> ArenaMark {
        ArenaMark(self.inside.len(), self.crossings.len())
    }

    /// Removes all sets and crossings added after the mark.
    pub(in crate::integrator) fn release(&mut self, ArenaMark(inside, crossings): ArenaMark) {
        self.inside.truncate(inside);
        self.crossings.truncate(crossings);
    }

    #[inline]
    pub(in crate::integrator) fn crossing(&self, number: u32) -> Option<&Crossing> {
        self.crossings.get(number as usize)
    }

    /// The bodies that an eye is in. At most `depth` + 1 of them are kept, those that fill first: a ray can't leave
    /// more.
    pub(in crate::integrator) fn around_eye(&mut self, world: &World, eye: DVec3, time: f32, depth: u32) -> u32 {
        if self.eye != Some((eye, time)) {
            (self.eye, self.eye_set) = (Some((eye, time)), None);
            self.around = filling_order(world.bodies_around(eye, time), depth);
        }
        if let Some(set) = self.eye_set {
            return set;
        }
        let mut set = NONE;
        for &(body, count) in self.around.iter().rev() {
            self.inside.push(BodyEntry { body, count, uncertain: false, rest: set });
            set = self.inside.len() as u32 - 1;
        }
        self.eye_set = Some(set);
        set
    }

    /// The body of the set that fills the place.
    pub(in crate::integrator) fn filling(&self, mut set: u32) -> Option<&Body> {
        while let Some(inside) = self.inside.get(set as usize) {
            if inside.count > 0 {
                return Some(&inside.body);
            }
            set = inside.rest;
        }
        None
    }

    /// The body of the set that fills the place if `body` is left out.
    fn filling_besides(&self, mut set: u32, body: &Body) -> Option<&Body> {
        while let Some(inside) = self.inside.get(set as usize) {
            if inside.count > 0 && inside.body.id != body.id {
                return Some(&inside.body);
            }
            set = inside.rest;
        }
        None
    }

    /// η of the body that fills the place; 1 outside of all bodies.
    pub(in crate::integrator) fn eta(&self, set: u32) -> f64 {
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

    /// The set after a body is entered or left.
    fn changed(&mut self, set: u32, body: &Body, enters: bool) -> u32 {
        self.with(set, body, |count, uncertain| match (body.overlaps_itself, enters) {
            (false, _) => (i32::from(enters), uncertain),
            (true, true) => (count + 1, uncertain),
            (true, false) => (count - 1, uncertain),
        })
    }

    /// The set with a changed entry of a body. `change` maps its count and doubt to new ones.
    fn with(&mut self, set: u32, body: &Body, change: impl FnOnce(i32, bool) -> (i32, bool)) -> u32 {
        self.scratch.clear();
        let (mut rest, mut before) = (set, (0, false));
        while let Some(&inside) = self.inside.get(rest as usize) {
            if inside.body.id != body.id && !inside.body.fills_before(body) {
                break;
            }
            rest = inside.rest;
            if inside.body.id == body.id {
                before = (inside.count, inside.uncertain);
                break;
            }
            self.scratch.push(inside);
        }
        let (count, uncertain) = change(before.0, before.1);
        if (count, uncertain) == before {
            return set;
        }
        let mut set = rest;
        if (count, uncertain) != (0, false) {
            self.inside.push(BodyEntry { body: *body, count, uncertain, rest });
            set = self.inside.len() as u32 - 1;
        }
        for at in (0..self.scratch.len()).rev() {
            self.inside.push(BodyEntry { rest: set, ..self.scratch[at] });
            set = self.inside.len() as u32 - 1;
        }
        set
    }

    /// The set without bodies that the ray can't be in. `met` is the body whose surface the ray hits, if any. Its flag
    /// is true for a hit on the outer side. `count` counts a body along the ray.
    fn confirmed(&mut self, set: u32, met: Option<(&Body, bool)>, count: impl Fn(&Body) -> i32) -> u32 {
        let mut confirmed = set;
        let mut rest = set;
        while let Some(&BodyEntry { body, uncertain, rest: next, .. }) = self.inside.get(rest as usize) {
            rest = next;
            let elsewhere = met.is_none_or(|(met, _)| met.id != body.id);
            if uncertain || !body.overlaps_itself && elsewhere {
                let counted = count(&body);
                confirmed = self.with(confirmed, &body, |_, _| (counted, false));
            }
        }
        match met {
            Some((body, outside)) if !body.overlaps_itself => {
                self.with(confirmed, body, |_, _| (i32::from(!outside), false))
            }
            _ => confirmed,
        }
    }

    /// The boundary of a ray in the bodies of `set` whose line hits `surface` at `hit`. `set` becomes the set of bodies
    /// that the ray is certainly in. Calls `hidden` with surfaces that another body hides.
    pub(in crate::integrator) fn boundary(
        &mut self,
        world: &World,
        (line, ray): (&DRay, &Ray),
        (hit, surface): (&Hit, &Surface),
        set: &mut u32,
        hidden: &mut dyn FnMut(&Hit),
    ) -> Boundary {
        let met = |hit: &Hit, outside: bool| {
            let body = world.body(hit);
            BoundaryHit { hit: *hit, body, outside, opaque: body.is_none() && world.material(hit).is_opaque() }
        };
        let first = met(hit, line.direction.dot(surface.normal) < 0.0);
        let own = first.body.as_ref().map(|body| (body, first.outside));
        *set = self.confirmed(*set, own, |body| world.containment_count(ray, hit.time, body));
        let mut contacts = std::mem::take(&mut self.contacts);
        world.contacts(line, hit, surface, &mut contacts, |across| {
            if let Some(body) = world.body(across) {
                *set = self.with(*set, &body, |count, _| (count, true));
            }
        });
        if let Some(body) = &first.body
            && body.overlaps_itself
            && world.is_near_edge(hit, surface)
        {
            *set = self.with(*set, body, |count, _| (count, true));
        }
        let boundary = if contacts.is_empty() {
            self.single_boundary(&first, *set, hidden)
        } else {
            let others = contacts.iter().map(|contact| met(&contact.hit, contact.outside));
            let mut all: Vec<BoundaryHit> = std::iter::once(first).chain(others).collect();
            // Sorting is stable: surfaces keep the order of their hits.
            all.sort_by_key(BoundaryHit::crossing_rank);
            self.coinciding_boundary(&all, hit, *set, hidden)
        };
        self.contacts = contacts;
        boundary
    }

    /// Whether a ray in these bodies has a simple crossing at a clear surface, so that [`Media::simple`] returns it.
    /// The ray is then in no other body, and no other surface is near.
    pub(in crate::integrator) fn is_simple(&self, world: &World, line: &DRay, hit: &Hit, set: u32) -> bool {
        if world.may_touch(line, hit) {
            return false;
        }
        let is_mesh = world.is_of_mesh(hit);
        if set == NONE {
            return !is_mesh || world.hits_outer_side(line, hit).is_some();
        }
        let only = self.inside.get(set as usize).filter(|only| only.count == 1 && !only.uncertain && only.rest == NONE);
        let (Some(only), Some(body)) = (only, world.body(hit)) else { return false };
        only.body.id == body.id && (!is_mesh || world.hits_outer_side(line, hit) == Some(false))
    }

    /// The crossing of a surface with nothing near it, by a ray that is in no other body.
    pub(in crate::integrator) fn simple(&mut self, world: &World, hit: &Hit, outside: bool, set: u32) -> Crossing {
        let beyond = world.body(hit).map_or(set, |body| self.changed(set, &body, outside));
        Crossing::isolated(*hit, 1.0, beyond)
    }

    /// The bodies of a ray that is mirrored at such a surface.
    pub(in crate::integrator) fn simple_inside(&mut self, world: &World, hit: &Hit, outside: bool, set: u32) -> u32 {
        match world.body(hit) {
            Some(body) if !body.overlaps_itself => self.with(set, &body, |_, _| (i32::from(!outside), false)),
            _ => set,
        }
    }

    /// The boundary at a surface that nothing coincides with.
    fn single_boundary(&mut self, met: &BoundaryHit, set: u32, hidden: &mut dyn FnMut(&Hit)) -> Boundary {
        if met.opaque {
            return Boundary::Plain;
        }
        let Some(body) = &met.body else {
            return Boundary::At(self.push(Crossing::isolated(met.hit, self.eta(set), set)));
        };
        let beyond = self.changed(set, body, met.outside);
        if self.is_hidden(body, set, if met.outside { set } else { beyond }) {
            hidden(&met.hit);
            return Boundary::Hidden(beyond);
        }
        let outer = self.filling_besides(set, body).map_or(1.0, |body| f64::from(body.eta));
        Boundary::At(self.push(Crossing::isolated(met.hit, outer, beyond)))
    }

    /// Whether a body's surface is hidden: another body of `set` fills the place, or a ray on its outer side is still
    /// in this body.
    fn is_hidden(&self, body: &Body, set: u32, outer: u32) -> bool {
        self.filling_besides(set, body).is_some_and(|other| other.fills_before(body))
            || body.overlaps_itself && self.count(outer, body) > 0
    }

    fn push(&mut self, crossing: Crossing) -> u32 {
        self.crossings.push(crossing);
        self.crossings.len() as u32 - 1
    }

    /// The boundary of coinciding surfaces in the order in which the ray crosses them. `first` is the hit that the ray
    /// query returned.
    fn coinciding_boundary(
        &mut self,
        all: &[BoundaryHit],
        first: &Hit,
        set: u32,
        hidden: &mut dyn FnMut(&Hit),
    ) -> Boundary {
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
            // Surfaces behind an opaque surface, or beside it, are not visible.
            if opaque.is_some_and(|opaque| index > opaque) {
                break;
            }
            match &met.body {
                Some(body) if self.is_hidden(body, if met.outside { beyond } else { set }, gap) => hidden(&met.hit),
                _ => seen.push(*met),
            }
        }
        if let [BoundaryHit { opaque: true, hit, .. }] = &seen[..]
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
            let between_bodies = if is_gap { gap } else { set };
            self.push(Crossing {
                refraction: if is_gap || is_last { Refraction::Outer(outer) } else { Refraction::Straight },
                next: if is_last { NONE } else { base + index + 1 },
                before: if index == 0 { NONE } else { base + index - 1 },
                touches: true,
                ..Crossing::isolated(met.hit, outer, if is_last { beyond } else { between_bodies })
            });
        }
        if is_gap {
            self.push_reflected_crossings(base, seen.len() as u32, [set, gap], eta_gap);
        }
        Boundary::At(base)
    }

    /// Adds the crossings of rays that are mirrored from surfaces in a gap, back through those before them.
    fn push_reflected_crossings(&mut self, base: u32, count: u32, [set, gap]: [u32; 2], eta_gap: f64) {
        let mut back = NONE;
        for number in base..base + count {
            self.crossings[number as usize].back = back;
            let hit = self.crossings[number as usize].hit;
            let beyond = if number == base { set } else { gap };
            back = self.push(Crossing { next: back, touches: true, ..Crossing::isolated(hit, eta_gap, beyond) });
        }
    }

    /// Calls `f` with each coinciding surface that a ray crossed before this crossing.
    pub(in crate::integrator) fn for_crossed_before(&self, crossing: u32, mut f: impl FnMut(&Hit)) {
        let mut before = self.crossing(crossing).map_or(NONE, |crossing| crossing.before);
        while let Some(crossing) = self.crossing(before) {
            f(&crossing.hit);
            before = crossing.before;
        }
    }
}

/// The bodies in the order in which they fill the place, at most as many as a ray can leave.
fn filling_order(mut around: Vec<(Body, i32)>, depth: u32) -> Vec<(Body, i32)> {
    around.sort_by(|(a, _), (b, _)| if a.fills_before(b) { Ordering::Less } else { Ordering::Greater });
    around.truncate(depth as usize + 1);
    around
}

/// The bodies that are entered, or those that are left.
fn sides(all: &[BoundaryHit], entered: bool) -> impl Iterator<Item = &Body> {
    all.iter().filter(move |met| met.outside == entered).filter_map(|met| met.body.as_ref())
}

#[cfg(test)]
mod tests;
