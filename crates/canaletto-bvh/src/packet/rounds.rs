//! Packets among spheres, cylinders and whatever else there is.

use super::group::{Group, NOTHING};
use super::round::{Roughs, Target, Told};
use super::walk::GROUPS;
use super::{Outcome, Packet, in_packets, lanes};
use crate::kernel::{self, Explicit};
use crate::lanes::{Instructions, Row, SIXTEEN, Vector};
use crate::node::{Node, Places};
use crate::round::{Ask, Block, LANES, Met};
use crate::rounds::offer;
use crate::sphere::many::{self, Side};
use crate::{PreparedRay, Ray};

/// What rays go through.
pub(crate) struct Field<'a, A> {
    pub(crate) nodes: &'a [Node],
    pub(crate) blocks: &'a [Block],
    pub(crate) ask: &'a A,
}

impl<A> Clone for Field<'_, A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A> Copy for Field<'_, A> {}

/// Rays of a group whose directions, at length 1, differ by more than this along an axis are better off one by one: what they
/// visit is rarely the same. The times of whole pictures hardly depend on it between a fifth and five times as much.
const ASTRAY: f32 = 0.1;

/// Takes all groups to the leaves that they may meet; `alone` is called for rays that have to be tested against a primitive exactly: with
/// their group, their lane, and the primitive's place.
#[inline(always)]
fn go<S: Instructions, A: Ask, const NEAREST: bool>(
    s: S,
    field: Field<'_, A>,
    packet: &mut Packet,
    outcome: &mut Outcome,
    mut alone: impl FnMut(&mut Group, usize, u32),
) {
    let mut roughs = [Roughs::EMPTY; GROUPS];
    for (group, rough) in packet.groups.iter_mut().zip(&mut roughs).take(packet.len) {
        rough.set(group);
        if rough.spread(s, group) > ASTRAY {
            outcome.apart |= u64::from(group.part) << group.first;
            group.part = 0;
            group.t_max = Row([f32::NEG_INFINITY; SIXTEEN]);
        }
    }
    packet.start(s);
    let data = Places::new(field.nodes, field.blocks);
    while let Some((leaf, mut parts)) = packet.walk.next::<S, NEAREST>(s, field.nodes, data, &packet.groups) {
        let block = &field.blocks[leaf.first() as usize];
        while parts != 0 {
            let number = parts.trailing_zeros() as usize;
            parts &= parts - 1;
            let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
            let (group, rough) = (&mut packet.groups[index], &roughs[index]);
            let mut changed = 0;
            for lane in 0..leaf.count() as usize {
                let place = leaf.first() * LANES as u32 + lane as u32;
                let Told { taken, undecided } = match block.target(lane) {
                    Target::Sphere(center, radius) => {
                        group.test_sphere::<S, NEAREST>(s, part, rough, center, radius, place)
                    }
                    Target::Cylinder(ends, radius) => {
                        group.test_cylinder::<S, NEAREST>(s, part, rough, ends, radius, place)
                    }
                    Target::Other(bounds) => group.test_box(s, part, bounds),
                };
                changed |= taken | undecided;
                for i in lanes(undecided) {
                    alone(group, i, place);
                }
            }
            if changed != 0 {
                let farthest = group.farthest(s);
                packet.walk.limit(index, farthest);
            }
        }
    }
}

/// Tests what waits for a ray, then a primitive, exactly. Returns whether what had waited was not met.
#[inline(never)]
fn decide<A: Ask>(group: &mut Group, field: Field<'_, A>, i: usize, place: u32, nearest: &mut Met) -> bool {
    let ray = PreparedRay::new(&group.ray(i));
    let mut offer = |place: u32| {
        let (block, lane) = (&field.blocks[place as usize / LANES], place as usize % LANES);
        offer(block, lane, &ray, nearest, field.ask)
    };
    let waits = std::mem::replace(&mut group.waits.0[i], NOTHING);
    let mut failed = waits != NOTHING && !offer(waits);
    if place != NOTHING {
        offer(place);
    }
    failed |= waits != NOTHING && nearest.t > group.t_max.0[i];
    (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
    failed
}

/// Tests what waits for the rays of a group exactly, as far as these are spheres, side by side, and tells for which rays that was not met. Of others
/// everything waits on.
#[inline(always)]
fn decide_spheres<A>(group: &mut Group, field: Field<'_, A>, nearest: &mut [Met]) -> u32 {
    const HALF: usize = many::LANES;
    let (waiting, mut failed) = (group.waiting(), 0);
    for first in (0..SIXTEEN).step_by(HALF) {
        let mut side = Side::NOTHING;
        let mut spheres = 0;
        for i in lanes(waiting & ((1 << HALF) - 1) << first) {
            let place = group.waits.0[i] as usize;
            if let Target::Sphere(center, radius) = field.blocks[place / LANES].target(place % LANES) {
                let lane = i - first;
                for (row, c) in side.center.iter_mut().zip(center) {
                    row[lane] = c;
                }
                side.radius[lane] = radius;
                side.t_max[lane] = nearest[group.first + i].t;
                spheres |= 1u32 << i;
            }
        }
        // Fewer aren't worth it.
        if spheres.count_ones() < 3 {
            continue;
        }
        for axis in 0..3 {
            side.origin[axis].copy_from_slice(&group.origin[axis].0[first..first + HALF]);
            side.direction[axis].copy_from_slice(&group.direction[axis].0[first..first + HALF]);
        }
        let found = side.intersect(&side.bounds());
        for i in lanes(spheres) {
            let (lane, place, nearest) = (i - first, group.waits.0[i] as usize, &mut nearest[group.first + i]);
            if found.told[lane] == 0 {
                continue;
            }
            let (t, id) = (found.t[lane], field.blocks[place / LANES].ids[place % LANES]);
            let met = t < nearest.t || t == nearest.t && id < nearest.id;
            if met {
                *nearest = Met { id, ..Met::before(t) };
            }
            failed |= u32::from(!met || nearest.t > group.t_max.0[i]) << i;
            group.waits.0[i] = NOTHING;
            (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
        }
    }
    failed
}

/// Ends a ray if a primitive is met, by the exact test.
#[inline(never)]
fn end<A: Ask>(group: &mut Group, field: Field<'_, A>, i: usize, place: u32) {
    let (block, lane) = (&field.blocks[place as usize / LANES], place as usize % LANES);
    if block.exact(lane, &group.ray(i).prepare(), group.t_max.0[i], field.ask).is_some() {
        group.t_max.0[i] = f32::NEG_INFINITY;
    }
}

#[inline(always)]
fn closest_in<S: Instructions, A: Ask>(
    s: S,
    field: Field<'_, A>,
    packet: &mut Packet,
    nearest: &mut [Met],
    outcome: &mut Outcome,
) {
    let mut again = 0;
    let alone = |group: &mut Group, i: usize, place: u32, nearest: &mut [Met]| {
        let ray = group.first + i;
        u64::from(decide(group, field, i, place, &mut nearest[ray])) << ray
    };
    go::<S, A, true>(s, field, packet, outcome, |group, i, place| again |= alone(group, i, place, nearest));
    for group in &mut packet.groups[..packet.len] {
        again |= u64::from(decide_spheres(group, field, nearest)) << group.first;
        for i in lanes(group.waiting()) {
            again |= alone(group, i, NOTHING, nearest);
        }
    }
    outcome.again |= again;
}

#[inline(always)]
fn any_in<S: Instructions, A: Ask>(
    s: S,
    field: Field<'_, A>,
    packet: &mut Packet,
    t_max: &mut [f32],
    outcome: &mut Outcome,
) {
    go::<S, A, false>(s, field, packet, outcome, |group, i, place| end(group, field, i, place));
    packet.tell(t_max);
}

struct Closest<'a, A> {
    field: Field<'a, A>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    nearest: &'a mut [Met],
}

impl<A: Ask> Explicit for Closest<'_, A> {
    type Answer = Outcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> Outcome {
        let Self { field, packet, rays, nearest } = self;
        let mut outcome = Outcome::default();
        in_packets!(
            s,
            packet,
            rays,
            nearest,
            |nearest: &Met| nearest.t,
            outcome,
            closest_in(s, field, packet, nearest, &mut outcome)
        );
        outcome
    }
}

struct Any<'a, A> {
    field: Field<'a, A>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    t_max: &'a mut [f32],
}

impl<A: Ask> Explicit for Any<'_, A> {
    type Answer = Outcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> Outcome {
        let Self { field, packet, rays, t_max } = self;
        let mut outcome = Outcome::default();
        in_packets!(s, packet, rays, t_max, |t_max| *t_max, outcome, any_in(s, field, packet, t_max, &mut outcome));
        outcome
    }
}

/// [`super::closest`] among what is round.
pub(crate) fn closest<A: Ask>(field: Field<'_, A>, packet: &mut Packet, rays: &[Ray], nearest: &mut [Met]) -> Outcome {
    if field.nodes.is_empty() {
        return Outcome::default();
    }
    kernel::run(Closest { field, packet, rays, nearest })
}

/// [`super::any`] among what is round.
pub(crate) fn any<A: Ask>(field: Field<'_, A>, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> Outcome {
    if field.nodes.is_empty() {
        return Outcome::default();
    }
    kernel::run(Any { field, packet, rays, t_max })
}
