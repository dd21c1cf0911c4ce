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

/// Two groups against the eight boxes of a node: what the planes that are met first and last are compared with, eight times for the one,
/// eight for the other.
#[derive(Clone, Copy)]
struct Pair {
    enter: [Row<f32>; 3],
    leave: [Row<f32>; 3],
    reciprocal: [[Row<f32>; 3]; 2],
    limit: Row<f32>,
}

/// One number for each group.
#[repr(align(16))]
struct Limits([f32; GROUPS]);

/// Writes a number to the one or the other half. (`fill` would be called.)
#[inline(always)]
fn fill(row: &mut Row<f32>, half: usize, value: f32) {
    for i in 0..WIDTH {
        row.0[half % 2 * WIDTH + i] = value;
    }
}

/// What is known of all groups, and what waits to be visited.
pub(super) struct Walk {
    pairs: [Pair; GROUPS / 2],
    /// Up to where anything must be entered by a group to be worth a visit; −∞ without group.
    limits: Limits,
    octant: usize,
    /// Where each group enters, ∞ where it doesn't.
    near: [MaybeUninit<Vec4>; STACK],
    /// The node times eight, plus the lane of the child.
    places: [MaybeUninit<u32>; STACK],
    len: usize,
}

/// Not a child of any.
const ROOT: u32 = u32::MAX;

impl Walk {
    #[inline(always)]
    pub(super) fn new() -> Walk {
        let zeros = [Row([0.0; SIXTEEN]); 3];
        let pair = Pair { enter: zeros, leave: zeros, reciprocal: [zeros; 2], limit: zeros[0] };
        Walk {
            pairs: [pair; GROUPS / 2],
            limits: Limits([0.0; GROUPS]),
            octant: 0,
            near: [const { MaybeUninit::uninit() }; STACK],
            places: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        }
    }

    /// Starts at the root, without groups yet.
    #[inline(always)]
    pub(super) fn start(&mut self, octant: usize) {
        self.octant = octant;
        for group in 0..GROUPS {
            self.limit(group, f32::NEG_INFINITY);
        }
        self.near[0].write(Vec4::NEG_INFINITY);
        self.places[0].write(ROOT);
        self.len = 1;
    }

    /// Says what a group's rays are like.
    #[inline(always)]
    pub(super) fn set(&mut self, group: usize, intervals: &[Interval; 3]) {
        let (pair, half) = (&mut self.pairs[group / 2], group % 2);
        for axis in 0..3 {
            let Interval { origin: [low, high], reciprocal } = intervals[axis];
            let (enter, leave) = if self.octant >> axis & 1 == 1 { (low, high) } else { (high, low) };
            fill(&mut pair.enter[axis], half, enter);
            fill(&mut pair.leave[axis], half, leave);
            fill(&mut pair.reciprocal[0][axis], half, reciprocal[0]);
            fill(&mut pair.reciprocal[1][axis], half, reciprocal[1]);
        }
    }

    /// Says up to where anything counts for a group.
    #[inline(always)]
    pub(super) fn limit(&mut self, group: usize, t_max: f32) {
        let limit = slab::limit(t_max);
        self.limits.0[group] = limit;
        fill(&mut self.pairs[group / 2].limit, group % 2, limit);
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
            let mut groups = near.cmple(Vec4::from_array(self.limits.0)).bitmask();
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
                link = node.children[lane];
                // On the way to the nearest hit, nearly all rays that may enter a node do; to a shadow's, often none does.
                if link.is_leaf() || !ORDERED {
                    // All groups, as a branch on whether one takes part is dearer. (A loop might not be unrolled.)
                    let enters = |i: usize| u32::from(all[i].enters(s, node, lane, self.octant)) << i;
                    groups &= enters(0) | enters(1) | enters(2) | enters(3);
                }
            }
            if groups == 0 {
                continue;
            }
            if link.is_leaf() {
                return Some((link.leaf(), groups));
            }
            self.visit::<S, ORDERED>(s, &nodes[link.index()], link.index() as u32, groups);
        }
        None
    }

    /// What waits at a place of the stack.
    #[inline(always)]
    fn entry(&self, index: usize) -> (Vec4, u32) {
        debug_assert!(index <= self.len);
        #[allow(unsafe_code)]
        // SAFETY: only called for entries that were written.
        unsafe {
            (self.near[index].assume_init(), self.places[index].assume_init())
        }
    }

    #[inline(always)]
    fn visit<S: Instructions, const ORDERED: bool>(&mut self, s: S, node: &Node, index: u32, groups: u32) {
        let (near0, met0) = self.clip(s, node, 0, groups & 3);
        let (near1, met1) = self.clip(s, node, 1, groups >> 2);
        let met = met0 | met1;
        let met = met | met >> WIDTH;
        let columns = S::Sixteen::columns(near0, near1);
        let order = node.orders[self.octant & 7];
        for i in 0..WIDTH {
            let lane = if ORDERED { (order >> (3 * i)) as usize & (WIDTH - 1) } else { i };
            let column = columns[lane / 4].0.as_chunks::<4>().0[lane % 4];
            self.near[self.len].write(Vec4::from_array(column));
            self.places[self.len].write(index * WIDTH as u32 + lane as u32);
            self.len += (met >> lane & 1) as usize;
        }
    }

    /// Where the rays of two groups may enter the boxes of a node, ∞ if they don't, and which they may enter: bounds for all of them, by monotone rounding.
    #[inline(always)]
    fn clip<S: Instructions>(&self, s: S, node: &Node, pair: usize, groups: u32) -> (S::Sixteen, u32) {
        let (pair, nowhere) = (&self.pairs[pair], s.splat(f32::INFINITY));
        let (mut near, mut far) = (s.splat(0.0), nowhere);
        for axis in 0..3 {
            let entry = self.octant >> axis & 1;
            let x = s.twice(&node.boxes[entry][axis]) - s.load(&pair.enter[axis]);
            let y = s.twice(&node.boxes[entry ^ 1][axis]) - s.load(&pair.leave[axis]);
            let (r0, r1) = (s.load(&pair.reciprocal[0][axis]), s.load(&pair.reciprocal[1][axis]));
            near = near.max((x * r0).min(x * r1));
            far = far.min((y * r0).max(y * r1));
        }
        let far = (far * s.splat(INFLATE)).min(s.load(&pair.limit));
        // A bit for each group to one for each of its eight lanes.
        let groups = [0, 0xff, 0xff00, 0xffff][groups as usize & 3];
        let met = near.less_or_equal(far) & s.mask(groups);
        (S::Sixteen::select(met, near, nowhere), S::Sixteen::bits(met))
    }
}
