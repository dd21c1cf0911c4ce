//! The traversal of packets over spheres, cylinders and user primitives.

use super::group::{NOTHING, RayGroup};
use super::primitive_test::{TestMasks, UnitRays, UnpackedPrimitive};
use super::walk::GROUPS;
use super::{Packet, PacketOutcome, in_packets, lanes};
use crate::node::{Node, PrefetchTable};
use crate::primitive::cull::LANES;
use crate::primitive::primitive4::{Primitive4, UserIntersect};
use crate::primitive::sphere::{self, Sphere8};
use crate::simd::dispatch::{self, SimdKernel};
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::{PreparedRay, PrimitiveHit, Ray};

/// The data of a tree over primitives that kernels read.
#[derive(Clone, Copy)]
pub(crate) struct PrimitiveScene<'a> {
    pub(crate) nodes: &'a [Node],
    pub(crate) blocks: &'a [Primitive4],
    pub(crate) user: &'a UserIntersect<'a>,
}

/// The largest spread of a group's unit directions along an axis. Rays of a wider group are traced one by one, since
/// they rarely visit common nodes. The times of whole pictures hardly depend on this number between a fifth and five
/// times as much.
const MAX_SPREAD: f32 = 0.1;

/// Traverses the tree with all groups. `alone` is called for each ray that has to be tested against a primitive
/// exactly. Its arguments are the group, the ray's lane, and the primitive's place.
#[inline(always)]
fn trace<S: Instructions, const NEAREST: bool>(
    s: S,
    scene: PrimitiveScene<'_>,
    packet: &mut Packet,
    outcome: &mut PacketOutcome,
    mut alone: impl FnMut(&mut RayGroup, usize, u32),
) {
    let mut unit_rays = [UnitRays::EMPTY; GROUPS];
    for (group, unit_ray) in packet.groups.iter_mut().zip(&mut unit_rays).take(packet.len) {
        unit_ray.set(group);
        if unit_ray.spread(s, group) > MAX_SPREAD {
            outcome.diverged |= u64::from(group.active) << group.first;
            group.active = 0;
            group.t_max = Row([f32::NEG_INFINITY; ROW]);
        }
    }
    packet.start(s);
    let data = PrefetchTable::new(scene.nodes, scene.blocks);
    while let Some((leaf, mut parts)) = packet.walk.next::<S, NEAREST>(s, scene.nodes, data, &packet.groups) {
        let block = &scene.blocks[leaf.first() as usize];
        while parts != 0 {
            let number = parts.trailing_zeros() as usize;
            parts &= parts - 1;
            let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
            let (group, unit_ray) = (&mut packet.groups[index], &unit_rays[index]);
            let mut changed = 0;
            for lane in 0..leaf.count() as usize {
                let place = leaf.first() * LANES as u32 + lane as u32;
                let TestMasks { taken, undecided } = match block.unpack(lane) {
                    UnpackedPrimitive::Sphere(center, radius) => {
                        group.test_sphere::<S, NEAREST>(s, part, unit_ray, center, radius, place)
                    }
                    UnpackedPrimitive::Cylinder(ends, radius) => {
                        group.test_cylinder::<S, NEAREST>(s, part, unit_ray, ends, radius, place)
                    }
                    UnpackedPrimitive::User(bounds) => group.test_box(s, part, bounds),
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

/// Tests a ray's pending primitive exactly, then another primitive. Returns whether the pending primitive was not hit.
#[inline(never)]
fn test_alone(
    group: &mut RayGroup,
    scene: PrimitiveScene<'_>,
    i: usize,
    place: u32,
    nearest: &mut PrimitiveHit,
) -> bool {
    let ray = PreparedRay::new(&group.ray(i));
    let mut accept_if_nearer = |place: u32| {
        let (block, lane) = (&scene.blocks[place as usize / LANES], place as usize % LANES);
        block.accept_if_nearer(lane, &ray, nearest, scene.user)
    };
    let pending = std::mem::replace(&mut group.pending.0[i], NOTHING);
    let mut failed = pending != NOTHING && !accept_if_nearer(pending);
    if place != NOTHING {
        accept_if_nearer(place);
    }
    failed |= pending != NOTHING && nearest.t > group.t_max.0[i];
    (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
    failed
}

/// Tests the pending spheres of a group exactly, side by side, and returns the rays whose sphere was not hit. Other
/// primitives stay pending.
#[inline(always)]
fn resolve_spheres(group: &mut RayGroup, scene: PrimitiveScene<'_>, nearest: &mut [PrimitiveHit]) -> u32 {
    const HALF: usize = sphere::LANES;
    let (waiting, mut failed) = (group.waiting(), 0);
    for first in (0..ROW).step_by(HALF) {
        let mut side = Sphere8::NOTHING;
        let mut spheres = 0;
        for i in lanes(waiting & ((1 << HALF) - 1) << first) {
            let place = group.pending.0[i] as usize;
            if let UnpackedPrimitive::Sphere(center, radius) = scene.blocks[place / LANES].unpack(place % LANES) {
                let lane = i - first;
                for (row, c) in side.center.iter_mut().zip(center) {
                    row[lane] = c;
                }
                side.radius[lane] = radius;
                side.t_max[lane] = nearest[group.first + i].t;
                spheres |= 1u32 << i;
            }
        }
        // Fewer spheres aren't worth it.
        if spheres.count_ones() < 3 {
            continue;
        }
        for axis in 0..3 {
            side.origin[axis].copy_from_slice(&group.origin[axis].0[first..first + HALF]);
            side.direction[axis].copy_from_slice(&group.direction[axis].0[first..first + HALF]);
        }
        let found = side.intersect(&side.bounds());
        for i in lanes(spheres) {
            let (lane, place, nearest) = (i - first, group.pending.0[i] as usize, &mut nearest[group.first + i]);
            if found.is_known[lane] == 0 {
                continue;
            }
            let (t, id) = (found.t[lane], scene.blocks[place / LANES].ids[place % LANES]);
            let met = t < nearest.t || t == nearest.t && id < nearest.id;
            if met {
                *nearest = PrimitiveHit { id, ..PrimitiveHit::none(t) };
            }
            failed |= u32::from(!met || nearest.t > group.t_max.0[i]) << i;
            group.pending.0[i] = NOTHING;
            (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
        }
    }
    failed
}

/// Ends a ray if a primitive is hit, by the exact test.
#[inline(never)]
fn end(group: &mut RayGroup, scene: PrimitiveScene<'_>, i: usize, place: u32) {
    let (block, lane) = (&scene.blocks[place as usize / LANES], place as usize % LANES);
    if block.intersect(lane, &group.ray(i).prepare(), group.t_max.0[i], scene.user).is_some() {
        group.t_max.0[i] = f32::NEG_INFINITY;
    }
}

#[inline(always)]
fn closest_in<S: Instructions>(
    s: S,
    scene: PrimitiveScene<'_>,
    packet: &mut Packet,
    nearest: &mut [PrimitiveHit],
    outcome: &mut PacketOutcome,
) {
    let mut retry = 0;
    let alone = |group: &mut RayGroup, i: usize, place: u32, nearest: &mut [PrimitiveHit]| {
        let ray = group.first + i;
        u64::from(test_alone(group, scene, i, place, &mut nearest[ray])) << ray
    };
    trace::<S, true>(s, scene, packet, outcome, |group, i, place| retry |= alone(group, i, place, nearest));
    for group in &mut packet.groups[..packet.len] {
        retry |= u64::from(resolve_spheres(group, scene, nearest)) << group.first;
        for i in lanes(group.waiting()) {
            retry |= alone(group, i, NOTHING, nearest);
        }
    }
    outcome.retry |= retry;
}

#[inline(always)]
fn any_in<S: Instructions>(
    s: S,
    scene: PrimitiveScene<'_>,
    packet: &mut Packet,
    t_max: &mut [f32],
    outcome: &mut PacketOutcome,
) {
    trace::<S, false>(s, scene, packet, outcome, |group, i, place| end(group, scene, i, place));
    packet.write_back(t_max);
}

struct ClosestPackets<'a> {
    scene: PrimitiveScene<'a>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    nearest: &'a mut [PrimitiveHit],
}

impl SimdKernel for ClosestPackets<'_> {
    type Answer = PacketOutcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> PacketOutcome {
        let Self { scene, packet, rays, nearest } = self;
        let mut outcome = PacketOutcome::default();
        in_packets!(
            s,
            packet,
            rays,
            nearest,
            |nearest: &PrimitiveHit| nearest.t,
            outcome,
            closest_in(s, scene, packet, nearest, &mut outcome)
        );
        outcome
    }
}

struct AnyHitPackets<'a> {
    scene: PrimitiveScene<'a>,
    packet: &'a mut Packet,
    rays: &'a [Ray],
    t_max: &'a mut [f32],
}

impl SimdKernel for AnyHitPackets<'_> {
    type Answer = PacketOutcome;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> PacketOutcome {
        let Self { scene, packet, rays, t_max } = self;
        let mut outcome = PacketOutcome::default();
        in_packets!(s, packet, rays, t_max, |t_max| *t_max, outcome, any_in(s, scene, packet, t_max, &mut outcome));
        outcome
    }
}

/// [`super::closest`] for a tree over primitives.
pub(crate) fn closest(
    scene: PrimitiveScene<'_>,
    packet: &mut Packet,
    rays: &[Ray],
    nearest: &mut [PrimitiveHit],
) -> PacketOutcome {
    if scene.nodes.is_empty() {
        return PacketOutcome::default();
    }
    dispatch::run(ClosestPackets { scene, packet, rays, nearest })
}

/// [`super::any`] for a tree over primitives.
pub(crate) fn any(scene: PrimitiveScene<'_>, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> PacketOutcome {
    if scene.nodes.is_empty() {
        return PacketOutcome::default();
    }
    dispatch::run(AnyHitPackets { scene, packet, rays, t_max })
}
