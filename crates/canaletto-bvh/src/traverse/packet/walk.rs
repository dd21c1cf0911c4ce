//! The way of a packet through the tree.

#![allow(clippy::needless_range_loop)] // NodeTest of many lists side by side.

use super::group::{Interval, RayGroup};
use crate::Leaf;
use crate::build::MAX_DEPTH;
use crate::node::{Node, PrefetchTable};
use crate::simd::{Instructions, Row, SIXTEEN, Vector};
use crate::slab::{self, INFLATE, WIDTH};
use glam::Vec4;

/// Groups in a packet.
pub(super) const GROUPS: usize = 4;

/// The children of a node that wait to be visited.
#[derive(Clone, Copy)]
struct Level {
    node: u32,
    /// The lanes in the order of visits, the first highest: as in `Node::orders`.
    order: u32,
    /// A bit for each place in the order at which a child waits.
    waiting: u32,
}

impl Level {
    /// Below the root: nothing.
    const BOTTOM: Self = Self { node: 0, order: IN_ORDER, waiting: 1 };

    /// The place in the order of the child that comes next.
    #[inline(always)]
    fn next(self) -> usize {
        31 - (self.waiting | 1).leading_zeros() as usize
    }

    #[inline(always)]
    fn lane(self, place: usize) -> usize {
        (self.order >> (3 * place)) as usize % WIDTH
    }
}

/// The order of lanes that they have.
const IN_ORDER: u32 = 0o76543210;

/// Levels of a tree, and one below.
const LEVELS: usize = MAX_DEPTH as usize + 2;

/// What is known of all groups, and what waits to be visited.
pub(super) struct PacketWalk {
    /// What all rays lie between.
    hull: [Interval; 3],
    /// Up to where anything must be entered by a group to be worth a visit; −∞ without group.
    limits: Vec4,
    /// The greatest of them.
    farthest: f32,
    octant: usize,
    /// The levels at which something waits; the lowest is [`Level::BOTTOM`].
    levels: [Level; LEVELS],
    /// Where the rays may enter the children, in their order.
    near: [[f32; WIDTH]; LEVELS],
    /// The uppermost of the levels.
    top: usize,
    /// The root has not been visited.
    starts: bool,
}

impl PacketWalk {
    #[inline(always)]
    pub(super) fn new() -> PacketWalk {
        PacketWalk {
            hull: [Interval::NONE; 3],
            limits: Vec4::NEG_INFINITY,
            farthest: f32::NEG_INFINITY,
            octant: 0,
            levels: [Level::BOTTOM; LEVELS],
            near: [[0.0; WIDTH]; LEVELS],
            top: 0,
            starts: false,
        }
    }

    /// Starts at the root, without groups yet, for rays that lie in these intervals.
    #[inline(always)]
    pub(super) fn start(&mut self, octant: usize, hull: [Interval; 3]) {
        self.octant = octant;
        self.hull = hull;
        self.limits = Vec4::NEG_INFINITY;
        self.top = 0;
        self.starts = true;
    }

    /// Says up to where anything counts for a group.
    #[inline(always)]
    pub(super) fn limit(&mut self, group: usize, t_max: f32) {
        // All of them are written: a register is read that has not come from four places then.
        let only = Vec4::splat(group as f32).cmpeq(Vec4::new(0.0, 1.0, 2.0, 3.0));
        self.limits = Vec4::select(only, Vec4::splat(slab::limit(t_max)), self.limits);
        self.farthest = self.limits.max_element();
    }

    /// The next leaf that rays may meet, and a bit for each part of their groups. (It is a function that is asked, not one that calls another for each leaf,
    /// since that would not be compiled for the same instructions.)
    #[inline(always)]
    pub(super) fn next<S: Instructions, const ORDERED: bool>(
        &mut self,
        s: S,
        nodes: &[Node],
        data: PrefetchTable,
        all: &[RayGroup; GROUPS],
    ) -> Option<(Leaf, u32)> {
        if std::mem::take(&mut self.starts) {
            self.visit::<S, ORDERED>(s, &nodes[0], 0);
        }
        while self.top > 0 {
            let level = self.levels[self.top];
            let (place, node) = (level.next(), &nodes[level.node as usize]);
            let (near, lane) = (self.near[self.top][place], level.lane(place));
            let waiting = level.waiting ^ 1 << place;
            self.levels[self.top].waiting = waiting;
            self.top -= usize::from(waiting == 0);
            let groups = Vec4::splat(near).cmple(self.limits).bitmask();
            if groups == 0 {
                continue;
            }
            let after = self.levels[self.top];
            data.fetch(nodes[after.node as usize].children()[after.lane(after.next())]);
            let link = node.children()[lane];
            if !link.is_leaf() {
                let mut left = groups;
                while left != 0 {
                    let i = left.trailing_zeros() as usize % GROUPS;
                    left &= left - 1;
                    if all[i].any_enters(s, node, lane, self.octant) {
                        self.visit::<S, ORDERED>(s, &nodes[link.index()], link.index() as u32);
                        break;
                    }
                }
                continue;
            }
            // All groups, as a branch on whether one takes part is dearer.
            let mut parts = 0;
            for (i, group) in all.iter().enumerate() {
                let taking_part = (groups >> i & 1).wrapping_neg();
                parts |= (group.entering(s, node, lane, self.octant) & taking_part) << (i * S::Vector::PARTS);
            }
            if parts != 0 {
                return Some((link.leaf(), parts));
            }
        }
        None
    }

    /// Lets the children wait that rays may meet. (All groups are clipped by one interval: as they are neighbours, they would meet hardly fewer
    /// one by one.)
    #[inline(always)]
    fn visit<S: Instructions, const ORDERED: bool>(&mut self, s: S, node: &Node, index: u32) {
        let (near, far) = self.clip(s, node);
        let order = if ORDERED { node.orders[self.octant & 7] } else { IN_ORDER };
        let above = self.top + 1;
        let waiting = s.at_most_in_order(&near, &far, order, &mut self.near[above]);
        self.levels[above] = Level { node: index, order, waiting };
        self.top = if waiting == 0 { self.top } else { above };
    }

    /// Where the rays may enter the boxes of a node, and where they leave them: bounds for all of them, by monotone rounding.
    #[inline(always)]
    fn clip<S: Instructions>(&self, s: S, node: &Node) -> (Row<f32>, Row<f32>) {
        let (mut enter_at, mut leave_at) = (Row([0.0; SIXTEEN]), Row([0.0; SIXTEEN]));
        for part in 0..S::Vector::PARTS_OF_EIGHT {
            let (mut near, mut far) = (s.splat(0.0), s.splat(f32::INFINITY));
            for axis in 0..3 {
                let Interval { origin: [low, high], reciprocal } = self.hull[axis];
                let entry = self.octant >> axis & 1;
                let (enter, leave) = if entry == 1 { (low, high) } else { (high, low) };
                let x = s.eight(&node.boxes[entry][axis], part) - s.splat(enter);
                let y = s.eight(&node.boxes[entry ^ 1][axis], part) - s.splat(leave);
                let (r0, r1) = (s.splat(reciprocal[0]), s.splat(reciprocal[1]));
                near = near.max((x * r0).min(x * r1));
                far = far.min((y * r0).max(y * r1));
            }
            near.store(&mut enter_at, part);
            (far * s.splat(INFLATE)).min(s.splat(self.farthest)).store(&mut leave_at, part);
        }
        (enter_at, leave_at)
    }
}
