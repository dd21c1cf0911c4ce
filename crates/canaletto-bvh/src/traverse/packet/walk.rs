//! The traversal loop of a packet.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use super::group::{Interval, RayGroup};
use crate::Leaf;
use crate::node::MAX_DEPTH;
use crate::node::{Node, PrefetchTable};
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::slab::{self, INFLATE, WIDTH};
use glam::Vec4;

/// The number of groups in a packet.
pub(super) const GROUPS: usize = 4;

/// A level of the traversal stack: a node whose entered children are still to be visited.
#[derive(Clone, Copy)]
struct Level {
    node: u32,
    /// The lanes in the order of visits, the first in the highest bits, as in `Node::orders`.
    order: u32,
    /// The positions in the order at which a child is still to be visited, one bit for each.
    waiting: u32,
}

impl Level {
    /// The level below the root's, which is never popped.
    const BOTTOM: Self = Self { node: 0, order: IN_ORDER, waiting: 1 };

    /// The position in the order of the child that comes next.
    #[inline(always)]
    fn next(self) -> usize {
        31 - (self.waiting | 1).leading_zeros() as usize
    }

    #[inline(always)]
    fn lane(self, place: usize) -> usize {
        (self.order >> (3 * place)) as usize % WIDTH
    }
}

/// The order word that lists the lanes by number.
const IN_ORDER: u32 = 0o76543210;

/// The levels of the deepest tree, and the bottom level.
const LEVELS: usize = MAX_DEPTH as usize + 2;

/// The state of a packet's traversal: the bounds of all rays and the stack.
pub(super) struct PacketWalk {
    /// The intervals of all rays.
    hull: [Interval; 3],
    /// The largest entry distance at which each group still visits a box; −∞ without a group.
    limits: Vec4,
    /// The largest of the limits.
    farthest: f32,
    octant: usize,
    /// The levels with children still to be visited. The lowest is [`Level::BOTTOM`].
    levels: [Level; LEVELS],
    /// Lower bounds of the distances at which the rays enter the children, in the order of the level.
    near: [[f32; WIDTH]; LEVELS],
    /// The index of the top level of the stack.
    top: usize,
    /// Whether the root has not been visited yet.
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

    /// Starts at the root, without groups yet, for rays within these intervals.
    #[inline(always)]
    pub(super) fn start(&mut self, octant: usize, hull: [Interval; 3]) {
        self.octant = octant;
        self.hull = hull;
        self.limits = Vec4::NEG_INFINITY;
        self.top = 0;
        self.starts = true;
    }

    /// Sets the end of a group.
    #[inline(always)]
    pub(super) fn limit(&mut self, group: usize, t_max: f32) {
        // All four limits are written at once. A later read of the register then doesn't wait for four separate writes.
        let only = Vec4::splat(group as f32).cmpeq(Vec4::new(0.0, 1.0, 2.0, 3.0));
        self.limits = Vec4::select(only, Vec4::splat(slab::cull_limit(t_max)), self.limits);
        self.farthest = self.limits.max_element();
    }

    /// The next leaf that rays may enter, and a bit for each part of their groups. (The caller pulls leaves from this
    /// function. A callback for each leaf would not be compiled for the caller's instructions.)
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
            // Pop the next child of the top level.
            let level = self.levels[self.top];
            let (place, node) = (level.next(), &nodes[level.node as usize]);
            let (near, lane) = (self.near[self.top][place], level.lane(place));
            let waiting = level.waiting ^ 1 << place;
            self.levels[self.top].waiting = waiting;
            self.top -= usize::from(waiting == 0);
            // The groups that still reach the child. Without one, it is culled.
            let groups = Vec4::splat(near).cmple(self.limits).bitmask();
            if groups == 0 {
                continue;
            }
            // Prefetch the child after this one.
            let after = self.levels[self.top];
            data.fetch(nodes[after.node as usize].children()[after.lane(after.next())]);
            let link = node.children()[lane];
            if !link.is_leaf() {
                // This is a node: visit it if any ray enters its box.
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
            // This is a leaf: find the parts of groups that enter its box. All groups are tested, as a branch on
            // whether a group is active costs more.
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

    /// Pushes the children of a node that the rays may enter. (One interval clips all groups: as they are neighbours,
    /// separate intervals would enter hardly fewer children.)
    #[inline(always)]
    fn visit<S: Instructions, const ORDERED: bool>(&mut self, s: S, node: &Node, index: u32) {
        let (near, far) = self.clip(s, node);
        let order = if ORDERED { node.orders[self.octant & 7] } else { IN_ORDER };
        let above = self.top + 1;
        let waiting = s.at_most_in_order(&near, &far, order, &mut self.near[above]);
        self.levels[above] = Level { node: index, order, waiting };
        self.top = if waiting == 0 { self.top } else { above };
    }

    /// Bounds on the distances at which the rays enter and leave the boxes of a node. They hold for all rays, by
    /// monotone rounding.
    #[inline(always)]
    fn clip<S: Instructions>(&self, s: S, node: &Node) -> (Row<f32>, Row<f32>) {
        let (mut enter_at, mut leave_at) = (Row([0.0; ROW]), Row([0.0; ROW]));
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
