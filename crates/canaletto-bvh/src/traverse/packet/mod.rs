//! The traversal of coherent rays in packets of up to four groups of sixteen rays. One interval over all rays is
//! clipped to the boxes of a node. See Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire
//! ray packets", 2006. A triangle is tested against all rays of a group side by side.
//!
//! Read the files in this order:
//! 1. `coherent` cuts a list of rays into packets, and traces the diverged rays as a stream.
//! 2. `group` gathers sixteen rays of one octant and one longest axis into rows ([`RayGroup`]).
//! 3. `walk` is the traversal loop of a packet ([`PacketWalk`]). It returns one leaf after the other.
//! 4. `triangle_test` is the f32 test of a triangle, `resolve` the exact test of the pending triangles.
//! 5. `primitives` and `primitive_test` do this for spheres, cylinders and user primitives.
//!
//! The results are those of single rays, bit for bit. As in `primitive::triangle4`, triangles are tested in f32, and a
//! triangle that is almost certainly the nearest stays pending until the traversal has ended. Then all rays are tested
//! side by side with their pending triangles, by the operations of the exact test in equal order. A ray for which the
//! exact test would take a slow branch (edges, products that nearly cancel, triangles without area) is tested alone.

mod coherent;
mod group;
mod primitive_test;
pub(crate) mod primitives;
mod resolve;
mod triangle_test;
mod walk;

use crate::PrimitiveHit;
use crate::node::PrefetchTable;
use crate::primitive::edge_error::EdgeError;
use crate::primitive::triangle4::TriangleScene;
use crate::ray::AxisOrder;
use crate::simd::dispatch::{self, SimdKernel};
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::{PreparedRay, Ray};
pub(crate) use coherent::{PacketQuery, coherent};
use glam::Vec3;
pub(in crate::traverse) use group::Interval;
use group::{Corners, Ends, NOTHING, RayGroup};
use triangle_test::{TestMasks, TestParams, TriangleRef};
use walk::{GROUPS, PacketWalk};

/// The largest number of rays in a packet.
pub(crate) const RAYS: usize = GROUPS * ROW;

/// The rays that a packet has not completed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PacketOutcome {
    /// Rays that diverge from their neighbours, one bit for each. They have not been traced.
    pub(crate) diverged: u64,
    /// Rays that have to be traced again without pending triangles. The hits that they have so far are valid.
    pub(crate) retry: u64,
}

/// Up to four groups of one octant and one longest axis.
pub(crate) struct Packet {
    groups: [RayGroup; GROUPS],
    /// The corners of the pending triangles.
    corners: [Corners; GROUPS],
    len: usize,
    axis_order: AxisOrder,
    walk: PacketWalk,
}

impl Packet {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            groups: [RayGroup::EMPTY; GROUPS],
            corners: [[[Row([0.0; ROW]); 3]; 3]; GROUPS],
            len: 0,
            axis_order: AxisOrder::FORWARDS,
            walk: PacketWalk::new(),
        }
    }

    /// The intervals of the origins and reciprocals of all active rays.
    #[inline(always)]
    fn hull<S: Instructions>(&self, s: S) -> [Interval; 3] {
        let mut hull = [Interval::NONE; 3];
        for (axis, interval) in hull.iter_mut().enumerate() {
            let (mut origin, mut reciprocal) = (Ends::none(s), Ends::none(s));
            for group in &self.groups[..self.len] {
                origin.widen(s, group.active, &group.origin[axis]);
                reciprocal.widen(s, group.active, &group.reciprocal[axis]);
            }
            *interval = Interval { origin: origin.of_all(s), reciprocal: reciprocal.of_all(s) };
        }
        hull
    }

    #[inline(always)]
    fn params(&self, scene: &TriangleScene<'_>, any: bool, [x, y, z]: [Interval; 3]) -> TestParams {
        let corner = |i: usize| Vec3::new(x.origin[i], y.origin[i], z.origin[i]);
        let bound = EdgeError::within(corner(0), corner(1), &scene.bounds);
        TestParams {
            rows: self.axis_order.rows,
            axes: self.axis_order.axes(),
            bound,
            front_only: scene.front_only,
            any,
        }
    }

    /// Starts the traversal, and returns the intervals of all rays.
    #[inline(always)]
    fn start<S: Instructions>(&mut self, s: S) -> [Interval; 3] {
        let hull = self.hull(s);
        self.walk.start(usize::from(self.axis_order.octant), hull);
        for i in 0..self.len {
            self.walk.limit(i, self.groups[i].farthest(s));
        }
        hull
    }

    /// Traverses the tree with all groups. `exactly` is called for rays that have to be tested against a triangle
    /// exactly. Its arguments are their group, the corners of the group's pending triangles, a bit for each lane, and
    /// four times the block plus the triangle's lane.
    #[inline(always)]
    fn trace<S: Instructions, const NEAREST: bool>(
        &mut self,
        s: S,
        scene: TriangleScene<'_>,
        mut exactly: impl FnMut(&mut RayGroup, &mut Corners, &TestParams, u32, u32),
    ) -> TestParams {
        let hull = self.start(s);
        let params = self.params(&scene, !NEAREST, hull);
        let data = PrefetchTable::new(scene.nodes, scene.blocks);
        while let Some((leaf, mut parts)) = self.walk.next::<S, NEAREST>(s, scene.nodes, data, &self.groups) {
            let block = &scene.blocks[leaf.first() as usize];
            let size = block.size();
            // First all pairs of a part and a triangle are tested coarsely, without branches on the unpredictable
            // results. A misprediction costs more than starting again with the few pairs that are left.
            let mut may_hit_pairs = 0u64;
            while parts != 0 {
                let number = parts.trailing_zeros() as usize;
                parts &= parts - 1;
                let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
                for lane in 0..leaf.count() as usize {
                    let corners = block.ordered(lane, params.rows);
                    let may_hit = self.groups[index].may_meet(s, part, &params, &corners, size);
                    may_hit_pairs |= u64::from(may_hit) << (number << 2 | lane);
                }
            }
            while may_hit_pairs != 0 {
                let pair = may_hit_pairs.trailing_zeros() as usize;
                may_hit_pairs &= may_hit_pairs - 1;
                let (number, lane) = (pair >> 2, pair & 3);
                let (index, part) = (number / S::Vector::PARTS % GROUPS, number % S::Vector::PARTS);
                let (group, waiting) = (&mut self.groups[index], &mut self.corners[index]);
                let place = leaf.first() << 2 | lane as u32;
                let which = TriangleRef { place, id: block.id(lane), corners: block.ordered(lane, params.rows) };
                let TestMasks { taken, undecided } = group.test(s, part, &params, which, size, waiting);
                if undecided != 0 {
                    exactly(group, waiting, &params, undecided, place);
                }
                if taken | undecided != 0 {
                    let farthest = group.farthest(s);
                    self.walk.limit(index, farthest);
                }
            }
        }
        params
    }

    #[inline(always)]
    fn closest<S: Instructions>(
        &mut self,
        s: S,
        scene: TriangleScene<'_>,
        nearest: &mut [PrimitiveHit],
        outcome: &mut PacketOutcome,
    ) {
        let mut alone = |group: &mut RayGroup, i: usize, place: u32, nearest: &mut [PrimitiveHit]| {
            let ray = group.first + i;
            outcome.retry |= u64::from(test_alone(group, scene, i, place, &mut nearest[ray])) << ray;
        };
        let params = self.trace::<S, true>(s, scene, |group, waiting, params, rays, place| {
            for i in lanes(make_pending_exactly::<S>(group, waiting, params, scene, rays, place)) {
                alone(group, i, place, nearest);
            }
        });
        for (group, corners) in self.groups[..self.len].iter_mut().zip(&self.corners) {
            for i in lanes(resolve::resolve(s, group, corners, &params, nearest)) {
                alone(group, i, NOTHING, nearest);
            }
        }
    }

    #[inline(always)]
    fn any<S: Instructions>(&mut self, s: S, scene: TriangleScene<'_>, t_max: &mut [f32]) {
        self.trace::<S, false>(s, scene, |group, _, params, rays, place| end::<S>(group, params, scene, rays, place));
        self.write_back(t_max);
    }

    /// Writes the end of each ray.
    #[inline(always)]
    fn write_back(&self, t_max: &mut [f32]) {
        for group in &self.groups[..self.len] {
            for i in lanes(group.active) {
                t_max[group.first + i] = group.t_max.0[i];
            }
        }
    }
}

/// The positions of the set bits.
#[inline(always)]
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < ROW).then_some(lane)
    })
}

/// Makes a triangle pending for those rays that hit it before all else. Returns the rays that have to be tested alone.
#[cold]
#[inline(never)]
fn make_pending_exactly<S: Instructions>(
    group: &mut RayGroup,
    waiting: &mut Corners,
    params: &TestParams,
    scene: TriangleScene<'_>,
    rays: u32,
    place: u32,
) -> u32 {
    if rays.count_ones() < S::Vector::MIN_EXACT_RAYS {
        return rays;
    }
    let (block, lane) = (&scene.blocks[(place >> 2) as usize], place as usize & 3);
    let (id, corners) = (block.id(lane), block.ordered(lane, params.rows));
    let exactly = resolve::exact_same_triangle(group, params, corners);
    let mut left = rays & !exactly.missed;
    let take = |group: &mut RayGroup, waiting: &mut Corners, i: usize, t: f32| {
        (group.t_max.0[i], group.low.0[i]) = (t, t);
        (group.pending.0[i], group.last_seen.0[i]) = (place, id);
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
        } else if group.pending.0[i] != NOTHING {
            contested |= 1 << i;
        }
    }
    if contested != 0 {
        let waited = resolve::exact_triangle_per_ray(group, params, waiting);
        for i in lanes(contested & waited.met) {
            // A triangle as near as the pending one may have the lower id.
            if (exactly.t[i], id) < (waited.t[i], group.last_seen.0[i]) {
                take(group, waiting, i, exactly.t[i]);
            } else {
                (group.t_max.0[i], group.low.0[i]) = (waited.t[i], waited.t[i]);
            }
            left &= !(1 << i);
        }
    }
    left
}

/// Tests a ray's pending triangle exactly, then another triangle. Returns whether the pending triangle was not hit.
#[cold]
#[inline(never)]
fn test_alone(
    group: &mut RayGroup,
    scene: TriangleScene<'_>,
    i: usize,
    place: u32,
    nearest: &mut PrimitiveHit,
) -> bool {
    let ray = PreparedRay::new(&group.ray(i));
    let mut accept_if_nearer = |place: u32| {
        scene.blocks[(place >> 2) as usize].accept_if_nearer(place as usize & 3, &ray, nearest, scene.front_only)
    };
    let pending = std::mem::replace(&mut group.pending.0[i], NOTHING);
    let failed = pending != NOTHING && !accept_if_nearer(pending);
    if place != NOTHING && accept_if_nearer(place) {
        group.last_seen.0[i] = scene.blocks[(place >> 2) as usize].id(place as usize & 3);
    }
    let failed = failed || pending != NOTHING && nearest.t > group.t_max.0[i];
    (group.t_max.0[i], group.low.0[i]) = (nearest.t, nearest.t);
    failed
}

/// Ends those of some rays that hit a triangle, by the exact test.
#[cold]
#[inline(never)]
fn end<S: Instructions>(group: &mut RayGroup, params: &TestParams, scene: TriangleScene<'_>, rays: u32, place: u32) {
    let (block, lane) = (&scene.blocks[(place >> 2) as usize], place as usize & 3);
    let (mut met, mut alone) = (0, rays);
    if rays.count_ones() >= S::Vector::MIN_EXACT_RAYS {
        let exactly = resolve::exact_same_triangle(group, params, block.ordered(lane, params.rows));
        (met, alone) = (rays & exactly.met, rays & !(exactly.met | exactly.missed));
    }
    for i in lanes(alone) {
        let mut nearest = PrimitiveHit::none(group.t_max.0[i]);
        met |= u32::from(block.accept_if_nearer(lane, &group.ray(i).prepare(), &mut nearest, scene.front_only)) << i;
    }
    for i in lanes(met) {
        group.t_max.0[i] = f32::NEG_INFINITY;
    }
}

/// Gathers up to 64 rays into packets, and runs `go` for each packet. (It is a macro, since a function argument would
/// not be compiled for the caller's instructions.)
macro_rules! in_packets {
    ($s:expr, $packet:ident, $rays:expr, $results:expr, $t_max:expr, $outcome:ident, $go:expr) => {
        $packet.len = 0;
        let mut next = 0;
        let mut waiting = None;
        loop {
            if let Some(axis_order) = waiting.take() {
                $packet.axis_order = axis_order;
                $packet.len = 1;
            }
            while next < $rays.len() {
                let first = next;
                let rays = &$rays[first..if $rays.len() - first < ROW { $rays.len() } else { first + ROW }];
                next += rays.len();
                let len = $packet.len % GROUPS;
                let group = &mut $packet.groups[len];
                group.first = first;
                let gathered = group.gather($s, rays, &$results[first..next], $t_max);
                $outcome.diverged |= u64::from(!group.active & (u32::MAX >> (32 - rays.len()))) << first;
                let Some(axis_order) = gathered else { continue };
                if len > 0 && axis_order != $packet.axis_order {
                    waiting = gathered;
                    break;
                }
                $packet.axis_order = axis_order;
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

struct ClosestPackets<'a> {
    scene: TriangleScene<'a>,
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
            packet.closest(s, scene, nearest, &mut outcome)
        );
        outcome
    }
}

struct AnyHitPackets<'a> {
    scene: TriangleScene<'a>,
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
        in_packets!(s, packet, rays, t_max, |t_max| *t_max, outcome, packet.any(s, scene, t_max));
        outcome
    }
}

/// Finds the nearest triangles that 1 to 64 rays hit, nearer than the hits in `nearest`.
pub(crate) fn closest(
    scene: TriangleScene<'_>,
    packet: &mut Packet,
    rays: &[Ray],
    nearest: &mut [PrimitiveHit],
) -> PacketOutcome {
    if scene.nodes.is_empty() {
        return PacketOutcome::default();
    }
    dispatch::run(ClosestPackets { scene, packet, rays, nearest })
}

/// Sets `t_max` to −∞ for those of 1 to 64 rays that hit a triangle at or before `t_max`.
pub(crate) fn any(scene: TriangleScene<'_>, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> PacketOutcome {
    if scene.nodes.is_empty() {
        return PacketOutcome::default();
    }
    dispatch::run(AnyHitPackets { scene, packet, rays, t_max })
}
