//! The leaf tests of single rays and streams.
#![allow(unsafe_code)] // `StreamVisitor::leaf` is unsafe, though this one needs no instructions.

use crate::node::{Node, PrefetchTable};
use crate::primitive::cull::{Candidates, LANES, UnitRay};
use crate::primitive::primitive4::{FilterFunction, Primitive4, UserIntersect};
use crate::simd::NodeTest;
use crate::traverse::{AnyHitVisitor, ClosestVisitor, NumberedRay, StreamVisitor};
use crate::{Leaf, PreparedRay, PrimitiveHit};

/// The lanes of a leaf that hold a primitive, one bit for each.
#[inline(always)]
fn filled(leaf: Leaf) -> u32 {
    (1 << leaf.count()) - 1
}

#[inline(always)]
pub(super) fn closest(
    block: &Primitive4,
    candidates: &Candidates,
    ray: &PreparedRay,
    nearest: &mut PrimitiveHit,
    user: &UserIntersect,
) {
    let mut lanes = candidates.lanes;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        // A hit found meanwhile may be nearer. A NaN bound skips nothing.
        if candidates.near[lane] > nearest.t {
            continue;
        }
        block.accept_if_nearer(lane, ray, nearest, user);
    }
}

#[inline(always)]
pub(super) fn any(
    block: &Primitive4,
    (lanes, surely): (u32, u32),
    ray: &PreparedRay,
    t_max: f32,
    user: &UserIntersect,
    counts: &mut (impl FnMut(u32) -> bool + ?Sized),
) -> Option<u32> {
    // Certain hits come first, as they need no exact test.
    for (mut lanes, surely) in [(surely, true), (lanes & !surely, false)] {
        while lanes != 0 {
            let lane = lanes.trailing_zeros();
            lanes &= lanes - 1;
            let met = surely || block.intersect(lane as usize, ray, t_max, user).is_some();
            if met && counts(block.ids[lane as usize]) {
                return Some(lane);
            }
        }
    }
    None
}

pub(super) struct ClosestOfRay<'a> {
    pub(super) blocks: &'a [Primitive4],
    pub(super) ray: &'a PreparedRay,
    pub(super) unit_ray: UnitRay,
    pub(super) nearest: &'a mut PrimitiveHit,
    pub(super) user: &'a UserIntersect<'a>,
}

impl ClosestVisitor for ClosestOfRay<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        let block = &self.blocks[leaf.first() as usize];
        let candidates = block.cull(filled(leaf), self.ray, &self.unit_ray, self.nearest.t);
        closest(block, &candidates, self.ray, self.nearest, self.user);
        *t_max = self.nearest.t;
    }
}

pub(super) struct ClosestOfStream<'a> {
    pub(super) blocks: &'a [Primitive4],
    pub(super) unit_ray: &'a [UnitRay],
    pub(super) nearest: &'a mut [PrimitiveHit],
    pub(super) user: &'a UserIntersect<'a>,
}

impl StreamVisitor for ClosestOfStream<'_> {
    type CoarseResult = Candidates;

    #[inline(always)]
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, Candidates) {
        let candidates =
            self.blocks[leaf.first() as usize].cull(filled(leaf), ray.ray, &self.unit_ray[ray.number], t_max);
        (candidates.lanes != 0, candidates)
    }

    #[inline(always)]
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        candidates: &Candidates,
        _: u32,
        t_max: &mut f32,
    ) {
        let (block, nearest) = (&self.blocks[leaf.first() as usize], &mut self.nearest[ray.number]);
        closest(block, candidates, ray.ray, nearest, self.user);
        *t_max = nearest.t;
    }

    #[inline(always)]
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::new(nodes, self.blocks)
    }
}

pub(super) struct AnyHitOfStream<'a> {
    pub(super) blocks: &'a [Primitive4],
    pub(super) unit_ray: &'a [UnitRay],
    pub(super) user: &'a UserIntersect<'a>,
}

impl StreamVisitor for AnyHitOfStream<'_> {
    type CoarseResult = (u32, u32);
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, (u32, u32)) {
        let candidates =
            self.blocks[leaf.first() as usize].cull_any(filled(leaf), ray.ray, &self.unit_ray[ray.number], t_max);
        (candidates.0 | candidates.1 != 0, candidates)
    }

    #[inline(always)]
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        candidates: &(u32, u32),
        _: u32,
        t_max: &mut f32,
    ) {
        let block = &self.blocks[leaf.first() as usize];
        if any(block, *candidates, ray.ray, *t_max, self.user, &mut |_| true).is_some() {
            *t_max = f32::NEG_INFINITY;
        }
    }

    #[inline(always)]
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::new(nodes, self.blocks)
    }
}

pub(super) struct AnyHitOfRay<'a> {
    pub(super) blocks: &'a [Primitive4],
    pub(super) ray: &'a PreparedRay,
    pub(super) unit_ray: UnitRay,
    pub(super) t_max: f32,
    pub(super) user: &'a UserIntersect<'a>,
    pub(super) counts: &'a mut FilterFunction<'a>,
    pub(super) place: &'a mut Option<u32>,
}

impl AnyHitVisitor for AnyHitOfRay<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let block = &self.blocks[leaf.first() as usize];
        let candidates = block.cull_any(filled(leaf), self.ray, &self.unit_ray, self.t_max);
        *self.place = any(block, candidates, self.ray, self.t_max, self.user, self.counts)
            .map(|lane| leaf.first() * LANES as u32 + lane);
        self.place.is_some()
    }
}
