//! What single rays and streams do at leaves.
#![allow(unsafe_code)] // What is done at leaves may be compiled for a stream's instructions, though here it needs none.

use crate::lanes::Exact;
use crate::node::{Node, Places};
use crate::round::{Ask, Block, LANES, Met, Rough, Sorted};
use crate::traverse::{Any, Closest, ClosestOfMany, Numbered};
use crate::{Leaf, PreparedRay};

/// The bits of the lanes of a leaf that hold something.
#[inline(always)]
fn filled(leaf: Leaf) -> u32 {
    (1 << leaf.count()) - 1
}

/// Makes the primitive in this lane the nearest if it is, and tells whether.
#[inline(always)]
pub(crate) fn offer(block: &Block, lane: usize, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) -> bool {
    let id = block.ids[lane];
    // Whoever was asked need not have kept to `nearest.t`.
    if let Some(met) = block.exact(lane, ray, nearest.t, ask)
        && (met.t < nearest.t || met.t == nearest.t && id < nearest.id)
    {
        *nearest = Met { id, ..met };
        return true;
    }
    false
}

#[inline(always)]
pub(super) fn closest(block: &Block, sorted: &Sorted, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) {
    let mut lanes = sorted.lanes;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        // What was met meanwhile may be nearer; where the bound is no number it can't be told.
        if sorted.near[lane] > nearest.t {
            continue;
        }
        offer(block, lane, ray, nearest, ask);
    }
}

#[inline(always)]
pub(super) fn any(
    block: &Block,
    (lanes, surely): (u32, u32),
    ray: &PreparedRay,
    t_max: f32,
    ask: &impl Ask,
    counts: &mut impl FnMut(u32) -> bool,
) -> Option<u32> {
    // Those that need no asking first.
    for (mut lanes, surely) in [(surely, true), (lanes & !surely, false)] {
        while lanes != 0 {
            let lane = lanes.trailing_zeros();
            lanes &= lanes - 1;
            let met = surely || block.exact(lane as usize, ray, t_max, ask).is_some();
            if met && counts(block.ids[lane as usize]) {
                return Some(lane);
            }
        }
    }
    None
}

pub(super) struct OfRay<'a, A> {
    pub(super) blocks: &'a [Block],
    pub(super) ray: &'a PreparedRay,
    pub(super) rough: Rough,
    pub(super) nearest: &'a mut Met,
    pub(super) ask: &'a A,
}

impl<A: Ask> Closest for OfRay<'_, A> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        let block = &self.blocks[leaf.first() as usize];
        let sorted = block.sort(filled(leaf), self.ray, &self.rough, self.nearest.t);
        closest(block, &sorted, self.ray, self.nearest, self.ask);
        *t_max = self.nearest.t;
    }
}

pub(super) struct OfRays<'a, A> {
    pub(super) blocks: &'a [Block],
    pub(super) rough: &'a [Rough],
    pub(super) nearest: &'a mut [Met],
    pub(super) ask: &'a A,
}

impl<A: Ask> ClosestOfMany for OfRays<'_, A> {
    type Finding = Sorted;

    #[inline(always)]
    fn test(&self, ray: Numbered<'_>, leaf: Leaf, t_max: f32) -> (bool, Sorted) {
        let sorted = self.blocks[leaf.first() as usize].sort(filled(leaf), ray.ray, &self.rough[ray.number], t_max);
        (sorted.lanes != 0, sorted)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: Numbered<'_>, leaf: Leaf, sorted: &Sorted, _: u32, t_max: &mut f32) {
        let (block, nearest) = (&self.blocks[leaf.first() as usize], &mut self.nearest[ray.number]);
        closest(block, sorted, ray.ray, nearest, self.ask);
        *t_max = nearest.t;
    }

    #[inline(always)]
    fn places(&self, nodes: &[Node]) -> Places {
        Places::new(nodes, self.blocks)
    }
}

pub(super) struct AnyOfRays<'a, A> {
    pub(super) blocks: &'a [Block],
    pub(super) rough: &'a [Rough],
    pub(super) ask: &'a A,
}

impl<A: Ask> ClosestOfMany for AnyOfRays<'_, A> {
    type Finding = (u32, u32);
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: Numbered<'_>, leaf: Leaf, t_max: f32) -> (bool, (u32, u32)) {
        let sorted = self.blocks[leaf.first() as usize].sort_any(filled(leaf), ray.ray, &self.rough[ray.number], t_max);
        (sorted.0 | sorted.1 != 0, sorted)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: Numbered<'_>, leaf: Leaf, sorted: &(u32, u32), _: u32, t_max: &mut f32) {
        let block = &self.blocks[leaf.first() as usize];
        if any(block, *sorted, ray.ray, *t_max, self.ask, &mut |_| true).is_some() {
            *t_max = f32::NEG_INFINITY;
        }
    }

    #[inline(always)]
    fn places(&self, nodes: &[Node]) -> Places {
        Places::new(nodes, self.blocks)
    }
}

pub(super) struct AnyOf<'a, A, F> {
    pub(super) blocks: &'a [Block],
    pub(super) ray: &'a PreparedRay,
    pub(super) rough: Rough,
    pub(super) t_max: f32,
    pub(super) ask: &'a A,
    pub(super) counts: F,
    pub(super) place: &'a mut Option<u32>,
}

impl<A: Ask, F: FnMut(u32) -> bool> Any for AnyOf<'_, A, F> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let block = &self.blocks[leaf.first() as usize];
        let sorted = block.sort_any(filled(leaf), self.ray, &self.rough, self.t_max);
        *self.place = any(block, sorted, self.ray, self.t_max, self.ask, &mut self.counts)
            .map(|lane| leaf.first() * LANES as u32 + lane);
        self.place.is_some()
    }
}
