//! The way of a packet through the tree.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use super::group::{Group, Interval};
use crate::Leaf;
use crate::lanes::{Instructions, Row, SIXTEEN, Sixteen};
use crate::node::{Link, Node, Places};
use crate::slab::{self, INFLATE, WIDTH};
use crate::traverse::STACK;
use glam::Vec4;
use std::mem::MaybeUninit;

/// Groups in a packet.
pub(super) const GROUPS: usize = 4;

/// One number for each group.
#[repr(align(16))]
struct Limits([f32; GROUPS]);

/// What is known of all groups, and what waits to be visited.
pub(super) struct Walk {
    /// What all rays lie between.
    hull: [Interval; 3],
    /// Up to where anything must be entered by a group to be worth a visit; −∞ without group.
    limits: Limits,
    /// The greatest of them.
    farthest: f32,
    octant: usize,
    /// Where the rays may enter first.
    near: [MaybeUninit<f32>; STACK],
    /// The node times eight, plus the lane of the child.
    places: [MaybeUninit<u32>; STACK],
    len: usize,
}

/// Not a child of any.
const ROOT: u32 = u32::MAX;

impl Walk {
    #[inline(always)]
    pub(super) fn new() -> Walk {
        Walk {
            hull: [Interval::NONE; 3],
            limits: Limits([f32::NEG_INFINITY; GROUPS]),
            farthest: f32::NEG_INFINITY,
            octant: 0,
            near: [const { MaybeUninit::uninit() }; STACK],
            places: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        }
    }

    /// Starts at the root, without groups yet, for rays that lie in these intervals.
    #[inline(always)]
    pub(super) fn start(&mut self, octant: usize, hull: [Interval; 3]) {
        self.octant = octant;
        self.hull = hull;
        self.limits.0 = [f32::NEG_INFINITY; GROUPS];
        self.near[0].write(f32::NEG_INFINITY);
        self.places[0].write(ROOT);
        self.len = 1;
    }

    /// Says up to where anything counts for a group.
    #[inline(always)]
    pub(super) fn limit(&mut self, group: usize, t_max: f32) {
        self.limits.0[group] = slab::limit(t_max);
        let [a, b, c, d] = self.limits.0;
        self.farthest = slab::max(slab::max(a, b), slab::max(c, d));
    }

    /// The next leaf that rays may meet, and a bit for each of their groups. (It is a function that is asked, not one that calls another for each leaf,
    /// since that would not be compiled for the same instructions.)
    #[inline(always)]
    pub(super) fn next<S: Instructions, const ORDERED: bool>(
        &mut self,
        s: S,
        nodes: &[Node],
        data: Places,
        all: &[Group; GROUPS],
    ) -> Option<(Leaf, u32)> {
        while self.len > 0 {
            self.len -= 1;
            let (near, place) = self.entry(self.len);
            let mut groups = Vec4::splat(near).cmple(Vec4::from_array(self.limits.0)).bitmask();
            if groups == 0 {
                continue;
            }
            if self.len > 0 {
                let (_, place) = self.entry(self.len - 1);
                data.fetch(nodes[place as usize / WIDTH].children[place as usize % WIDTH]);
            }
            let mut link = Link::node(0);
            if place != ROOT {
                let (node, lane) = (&nodes[place as usize / WIDTH], place as usize % WIDTH);
                // All groups, as a branch on whether one takes part is dearer. (A loop might not be unrolled.)
                let enters = |i: usize| u32::from(all[i].enters(s, node, lane, self.octant)) << i;
                groups &= enters(0) | enters(1) | enters(2) | enters(3);
                link = node.children[lane];
            }
            if groups == 0 {
                continue;
            }
            if link.is_leaf() {
                return Some((link.leaf(), groups));
            }
            self.visit::<S, ORDERED>(s, &nodes[link.index()], link.index() as u32);
        }
        None
    }

    /// What waits at a place of the stack.
    #[inline(always)]
    fn entry(&self, index: usize) -> (f32, u32) {
        debug_assert!(index <= self.len);
        #[allow(unsafe_code)]
        // SAFETY: only called for entries that were written.
        unsafe {
            (self.near[index].assume_init(), self.places[index].assume_init())
        }
    }

    /// Puts the children on top that rays may meet. (All groups are clipped by one interval: as they are neighbours, they would meet hardly fewer
    /// one by one.)
    #[inline(always)]
    fn visit<S: Instructions, const ORDERED: bool>(&mut self, s: S, node: &Node, index: u32) {
        let (near, met) = self.clip(s, node);
        let order = node.orders[self.octant & 7];
        for i in 0..WIDTH {
            let lane = if ORDERED { (order >> (3 * i)) as usize & (WIDTH - 1) } else { i };
            self.near[self.len].write(near.0[lane]);
            self.places[self.len].write(index * WIDTH as u32 + lane as u32);
            self.len += (met >> lane & 1) as usize;
        }
    }

    /// Where the rays may enter the boxes of a node, and which they may enter: bounds for all of them, by monotone rounding.
    #[inline(always)]
    fn clip<S: Instructions>(&self, s: S, node: &Node) -> (Row<f32>, u32) {
        let (mut near, mut far) = (s.splat(0.0), s.splat(f32::INFINITY));
        for axis in 0..3 {
            let Interval { origin: [low, high], reciprocal } = self.hull[axis];
            let entry = self.octant >> axis & 1;
            let (enter, leave) = if entry == 1 { (low, high) } else { (high, low) };
            let x = s.twice(&node.boxes[entry][axis]) - s.splat(enter);
            let y = s.twice(&node.boxes[entry ^ 1][axis]) - s.splat(leave);
            let (r0, r1) = (s.splat(reciprocal[0]), s.splat(reciprocal[1]));
            near = near.max((x * r0).min(x * r1));
            far = far.min((y * r0).max(y * r1));
        }
        let far = (far * s.splat(INFLATE)).min(s.splat(self.farthest));
        let mut row = Row([0.0; SIXTEEN]);
        near.store(&mut row);
        (row, S::Sixteen::bits(near.less_or_equal(far)))
    }
}
