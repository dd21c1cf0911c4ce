//! Rays that go nearly the same way, through the tree together. Up to four groups of sixteen are clipped to the boxes of nodes by one interval of all their rays
//! (Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire ray packets", 2006), and triangles are tested against all
//! rays of a group side by side.
//!
//! The answers are those of single rays, bit for bit. As there (`block`), triangles are tested in f32, and one that all but certainly is the nearest waits
//! for its exact test until the way has ended: then all rays are tested side by side with what waits for them, by the operations of the exact kernel in the same
//! order. Where a lane would leave the straight way (edges, products that nearly cancel, triangles without area), that ray
//! is served alone.

mod coherent;
mod group;
mod look;
mod round;
pub(crate) mod rounds;
mod settle;
mod walk;

use crate::block::{Bound, Scene};
use crate::kernel::{self, Explicit};
use crate::lanes::{Instructions, Row, SIXTEEN, Vector};
use crate::node::Places;
use crate::ray::Way;
use crate::triangles::Nearest;
use crate::{PreparedRay, Ray};
pub(crate) use coherent::{Query, coherent};
use glam::Vec3;
use group::{Corners, Ends, Group, Interval, NOTHING};
use look::{Terms, Told, Which};
use walk::{GROUPS, Walk};

/// The most rays in a packet.
pub(crate) const RAYS: usize = GROUPS * SIXTEEN;

/// What became of a packet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outcome {
    /// A bit for each ray that doesn't go with its neighbours; nothing was done for them.
    pub(crate) apart: u64,
    /// Rays that have to be sent again, another way; what they know of hits is true.
    pub(crate) again: u64,
}

/// Up to four groups that go the same way.
pub(crate) struct Packet {
    groups: [Group; GROUPS],
    /// Of the triangles that wait.
    corners: [Corners; GROUPS],
    len: usize,
    way: Way,
    walk: Walk,
}

impl Packet {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            groups: [Group::EMPTY; GROUPS],
            corners: [[[Row([0.0; SIXTEEN]); 3]; 3]; GROUPS],
            len: 0,
            way: Way::FORWARDS,
            walk: Walk::new(),
        }
    }

    /// What all rays that take part lie between.
    #[inline(always)]
    fn hull<S: Instructions>(&self, s: S) -> [Interval; 3] {
        let mut hull = [Interval::NONE; 3];
        for (axis, interval) in hull.iter_mut().enumerate() {
            let (mut origin, mut reciprocal) = (Ends::none(s), Ends::none(s));
            for group in &self.groups[..self.len] {
                origin.widen(s, group.part, &group.origin[axis]);
                reciprocal.widen(s, group.part, &group.reciprocal[axis]);
            }
            *interval = Interval { origin: origin.of_all(s), reciprocal: reciprocal.of_all(s) };
        }
        hull
    }

    #[inline(always)]
    fn terms(&self, scene: &Scene<'_>, any: bool, [x, y, z]: [Interval; 3]) -> Terms {
        let corner = |i: usize| Vec3::new(x.origin[i], y.origin[i], z.origin[i]);
        let bound = Bound::within(corner(0), corner(1), &scene.bounds);
        Terms { rows: self.way.rows, axes: self.way.axes(), bound, front_only: scene.front_only, any }
    }

    /// Starts the way, and tells what all rays lie between.
    #[inline(always)]
    fn start<S: Instructions>(&mut self, s: S) -> [Interval; 3] {
        let hull = self.hull(s);
        self.walk.start(usize::from(self.way.octant), hull);
        for i in 0..self.len {
            self.walk.limit(i, self.groups[i].farthest(s));
        }
        hull
    }

    /// Takes all groups to the leaves that they may meet; `exactly` is called for rays that have to be tested against a triangle exactly: with
    /// their group, the corners of what waits there, a bit for each lane, and four times the block plus the triangle's lane.
    #[inline(always)]
    fn go<S: Instructions, const NEAREST: bool>(
        &mut self,
        s: S,
        scene: Scene<'_>,
        mut exactly: impl FnMut(&mut Group, &mut Corners, &Terms, u32, u32),
    ) -> Terms {
        let hull = self.start(s);
        let terms = self.terms(&scene, !NEAREST, hull);
        let data = Places::new(scene.nodes, scene.blocks);
        while let Some((leaf, mut parts)) = self.walk.next::<S, NEAREST>(s, scene.nodes, data, &self.groups) {
            let block = &scene.blocks[leaf.first() as usize];
            let size = block.size();
            // First all pairs of a part and a triangle, roughly and without branches on what they tell, which are hard to foretell: to guess wrong
            // costs more than to begin anew with the few that are left.
            let mut hopeful = 0u64;
            while parts != 0 {
                let number = parts.trailing_zeros() as usize;
                parts &= parts - 1;
                let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
                for lane in 0..leaf.count() as usize {
                    let corners = block.ordered(lane, terms.rows);
                    let hope = self.groups[index].may_meet(s, part, &terms, &corners, size);
                    hopeful |= u64::from(hope) << (number << 2 | lane);
                }
            }
            while hopeful != 0 {
                let pair = hopeful.trailing_zeros() as usize;
                hopeful &= hopeful - 1;
                let (number, lane) = (pair >> 2, pair & 3);
                let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
                let (group, waiting) = (&mut self.groups[index], &mut self.corners[index]);
                let place = leaf.first() << 2 | lane as u32;
                let which = Which { place, id: block.id(lane), corners: block.ordered(lane, terms.rows) };
                let Told { taken, undecided } = group.test(s, part, &terms, which, size, waiting);
                if undecided != 0 {
                    exactly(group, waiting, &terms, undecided, place);
                }
                if taken | undecided != 0 {
                    let farthest = group.farthest(s);
                    self.walk.limit(index, farthest);
                }
            }
        }
        terms
    }

    #[inline(always)]
    fn closest<S: Instructions>(&mut self, s: S, scene: Scene<'_>, nearest: &mut [Nearest], outcome: &mut Outcome) {
        let mut alone = |group: &mut Group, i: usize, place: u32, nearest: &mut [Nearest]| {
            let ray = group.first + i;
            outcome.again |= u64::from(decide(group, scene, i, place, &mut nearest[ray])) << ray;
        };
        let terms = self.go::<S, true>(s, scene, |group, waiting, terms, rays, place| {
            for i in lanes(nearer::<S>(group, waiting, terms, scene, rays, place)) {
                alone(group, i, place, nearest);
            }
        });
        for (group, corners) in self.groups[..self.len].iter_mut().zip(&self.corners) {
            for i in lanes(settle::settle(s, group, corners, &terms, nearest)) {
                alone(group, i, NOTHING, nearest);
            }
        }
    }

    #[inline(always)]
    fn any<S: Instructions>(&mut self, s: S, scene: Scene<'_>, t_max: &mut [f32]) {
        self.go::<S, false>(s, scene, |group, _, terms, rays, place| end::<S>(group, terms, scene, rays, place));
        self.tell(t_max);
    }

    /// Writes up to where each ray goes on.
    #[inline(always)]
    fn tell(&self, t_max: &mut [f32]) {
        for group in &self.groups[..self.len] {
            for i in lanes(group.part) {
                t_max[group.first + i] = group.t_max.0[i];
            }
        }
    }
}

/// The places of bits.
#[inline(always)]
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < SIXTEEN).then_some(lane)
    })
}

/// Lets a triangle wait for those of some rays that meet it before all else. Returns the rays for which it has to be decided alone.
#[cold]
#[inline(never)]
fn nearer<S: Instructions>(
    group: &mut Group,
    waiting: &mut Corners,
    terms: &Terms,
    scene: Scene<'_>,
    rays: u32,
    place: u32,
) -> u32 {
    if rays.count_ones() < S::Vector::SEVERAL {
        return rays;
    }
    let (block, lane) = (&scene.blocks[(place >> 2) as usize], place as usize & 3);
    let (id, corners) = (block.id(lane), block.ordered(lane, terms.rows));
    let exactly = settle::settle_one(group, terms, corners);
    let mut left = rays & !exactly.missed;
    let take = |group: &mut Group, waiting: &mut Corners, i: usize, t: f32| {
        (group.t_max.0[i], group.low.0[i]) = (t, t);
        (group.waits.0[i], group.known.0[i]) = (place, id);
        for (rows, corner) in waiting.iter_mut().zip(corners) {
            for (row, x) in rows.iter_mut().zip(corner) {
                row.0[i] = x;
            }
        }
    };
    let mut contested = 0;
    for i in lanes(left & exactly.met) {
        if exactly.t[i] < group.low.0[i] {
            take(group, waiting, i, exactly.t[i]);
            left &= !(1 << i);
        } else if group.waits.0[i] != NOTHING {
            contested |= 1 << i;
        }
    }
    if contested != 0 {
        let waited = settle::settle_each(group, terms, waiting);
        for i in lanes(contested & waited.met) {
            // What is as near as what waits may have the lower id.
            if (exactly.t[i], id) < (waited.t[i], group.known.0[i]) {
                take(group, waiting, i, exactly.t[i]);
            } else {
                (group.t_max.0[i], group.low.0[i]) = (waited.t[i], waited.t[i]);
            }
            left &= !(1 << i);
        }
    }
    left
}

/// Tests what waits for a ray, then a triangle, exactly. Returns whether what had waited was not met.
#[cold]
#[inline(never)]
fn decide(group: &mut Group, scene: Scene<'_>, i: usize, place: u32, nearest: &mut Nearest) -> bool {
    let ray = PreparedRay::new(&group.ray(i));
    let mut offer =
        |place: u32| scene.blocks[(place >> 2) as usize].offer(place as usize & 3, &ray, nearest, scene.front_only);
    let waits = std::mem::replace(&mut group.waits.0[i], NOTHING);
    let failed = waits != NOTHING && !offer(waits);
    if place != NOTHING && offer(place) {
        group.known.0[i] = scene.blocks[(place >> 2) as usize].id(place as usize & 3);
    }
    let failed = failed || waits != NOTHING && nearest.t > group.t_max.0[i];
    (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
    failed
}

/// Ends those of some rays that meet a triangle, by the exact test.
#[cold]
#[inline(never)]
fn end<S: Instructions>(group: &mut Group, terms: &Terms, scene: Scene<'_>, rays: u32, place: u32) {
    let (block, lane) = (&scene.blocks[(place >> 2) as usize], place as usize & 3);
    let (mut met, mut alone) = (0, rays);
    if rays.count_ones() >= S::Vector::SEVERAL {
        let exactly = settle::settle_one(group, terms, block.ordered(lane, terms.rows));
        (met, alone) = (rays & exactly.met, rays & !(exactly.met | exactly.missed));
    }
    for i in lanes(alone) {
        let mut nearest = Nearest::before(group.t_max.0[i]);
        met |= u32::from(block.offer(lane, &group.ray(i).prepare(), &mut nearest, scene.front_only)) << i;
    }
    for i in lanes(met) {
        group.t_max.0[i] = f32::NEG_INFINITY;
    }
}

/// Gathers up to 64 rays in packets, and calls `go` for each. (A function that is handed to another would not be compiled for the same
/// instructions.)
macro_rules! in_packets {
    ($s:expr, $packet:ident, $rays:expr, $told:expr, $t_max:expr, $outcome:ident, $go:expr) => {
        $packet.len = 0;
        let mut next = 0;
        let mut waiting = None;
        loop {
            if let Some(way) = waiting.take() {
                $packet.way = way;
                $packet.len = 1;
            }
            while next < $rays.len() {
                let first = next;
                let rays = &$rays[first..if $rays.len() - first < SIXTEEN { $rays.len() } else { first + SIXTEEN }];
                next += rays.len();
                let len = $packet.len % GROUPS;
                let group = &mut $packet.groups[len];
                group.first = first;
                let gathered = group.gather($s, rays, &$told[first..next], $t_max);
                $outcome.apart |= u64::from(!group.part & (u32::MAX >> (32 - rays.len()))) << first;
                let Some(way) = gathered else { continue };
                if len > 0 && way != $packet.way {
                    waiting = gathered;
                    break;
                }
                $packet.way = way;
                $packet.len += 1;
            }
            if $packet.len == 0 {
                break;
            }
            let len = $packet.len;
            $go;
            if waiting.is_some() {
                $packet.groups.swap(0, len);
            }
            $packet.len = 0;
        }
    };
}

use in_packets;

struct Closest<'a> {
    scene: Scene<'a>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    nearest: &'a mut [Nearest],
}

impl Explicit for Closest<'_> {
    type Answer = Outcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> Outcome {
        let Self { scene, packet, rays, nearest } = self;
        let mut outcome = Outcome::default();
        in_packets!(
            s,
            packet,
            rays,
            nearest,
            |nearest: &Nearest| nearest.t,
            outcome,
            packet.closest(s, scene, nearest, &mut outcome)
        );
        outcome
    }
}

struct Any<'a> {
    scene: Scene<'a>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    t_max: &'a mut [f32],
}

impl Explicit for Any<'_> {
    type Answer = Outcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> Outcome {
        let Self { scene, packet, rays, t_max } = self;
        let mut outcome = Outcome::default();
        in_packets!(s, packet, rays, t_max, |t_max| *t_max, outcome, packet.any(s, scene, t_max));
        outcome
    }
}

/// Finds the nearest triangles that 1 to 64 rays meet, nearer than what is in `nearest`.
pub(crate) fn closest(scene: Scene<'_>, packet: &mut Packet, rays: &[Ray], nearest: &mut [Nearest]) -> Outcome {
    if scene.nodes.is_empty() {
        return Outcome::default();
    }
    kernel::run(Closest { scene, packet, rays, nearest })
}

/// Tells which of 1 to 64 rays meet a triangle at or before `t_max`, by −∞.
pub(crate) fn any(scene: Scene<'_>, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> Outcome {
    if scene.nodes.is_empty() {
        return Outcome::default();
    }
    kernel::run(Any { scene, packet, rays, t_max })
}
