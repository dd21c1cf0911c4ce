//! What single rays and streams do at leaves.
#![allow(unsafe_code)] // Kernels for the instructions that a stream is compiled for.

use std::hint::select_unpredictable;

use super::Nearest;
use crate::block::{Bound, Scene, Search, Tested};
use crate::lanes::Exact;
use crate::node::{Node, Places};
use crate::traverse::{Any, Closest, ClosestOfMany, Numbered};
use crate::{Leaf, PreparedRay};

pub(super) struct OfRay<'a> {
    pub(super) scene: Scene<'a>,
    pub(super) ray: &'a PreparedRay,
    pub(super) nearest: &'a mut Nearest,
    pub(super) search: &'a mut Search,
}

impl Closest for OfRay<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        let (hope, tested) = self.search.test(&self.scene.blocks[leaf.first() as usize], self.ray, *t_max);
        if hope {
            self.search.complete(self.scene, leaf.first(), self.ray, &tested, self.nearest, t_max);
        }
    }
}

pub(super) struct OfRays<'a> {
    pub(super) scene: Scene<'a>,
    pub(super) nearest: &'a mut [Nearest],
    pub(super) bound: Bound,
    /// For each ray the triangle that was met last, which may come again in another leaf.
    pub(super) known: &'a mut [u32],
}

impl ClosestOfMany for OfRays<'_> {
    type Finding = Tested;

    #[inline(always)]
    fn test(&self, ray: Numbered<'_>, leaf: Leaf, t_max: f32) -> (bool, Tested) {
        let tested = self.scene.blocks[leaf.first() as usize].test(ray.ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    #[inline(always)]
    fn look(&self, ray: Numbered<'_>, leaf: Leaf, tested: &Tested, t_max: &mut f32) -> u32 {
        let block = &self.scene.blocks[leaf.first() as usize];
        let candidates = block.look(ray.ray, tested).closest(*t_max, self.scene.front_only);
        candidates & !block.lane_of(self.known[ray.number])
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: Numbered<'_>, leaf: Leaf, _: &Tested, which: u32, t_max: &mut f32) {
        let (block, nearest) = (&self.scene.blocks[leaf.first() as usize], &mut self.nearest[ray.number]);
        // SAFETY: the caller's promise.
        let met = unsafe { block.offer_some::<E::Four>(which, ray.ray, nearest, self.scene.front_only) };
        if let Some(lane) = met {
            self.known[ray.number] = block.id(lane);
        }
        *t_max = nearest.t;
    }

    #[inline(always)]
    fn places(&self, nodes: &[Node]) -> Places {
        Places::new(nodes, self.scene.blocks)
    }
}

pub(super) struct AnyOfRays<'a> {
    pub(super) scene: Scene<'a>,
    pub(super) bound: Bound,
}

impl ClosestOfMany for AnyOfRays<'_> {
    type Finding = Tested;
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: Numbered<'_>, leaf: Leaf, t_max: f32) -> (bool, Tested) {
        let tested = self.scene.blocks[leaf.first() as usize].test(ray.ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    #[inline(always)]
    fn look(&self, ray: Numbered<'_>, leaf: Leaf, tested: &Tested, t_max: &mut f32) -> u32 {
        let (block, ray) = (&self.scene.blocks[leaf.first() as usize], ray.ray);
        let (surely, possibly) = block.look(ray, tested).any(ray, *t_max, self.scene.front_only);
        *t_max = select_unpredictable(surely != 0, f32::NEG_INFINITY, *t_max);
        select_unpredictable(surely != 0, 0, possibly)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: Numbered<'_>, leaf: Leaf, _: &Tested, which: u32, t_max: &mut f32) {
        let block = &self.scene.blocks[leaf.first() as usize];
        if block.any((0, which), ray.ray, *t_max, self.scene.front_only, &mut |_| true).is_some() {
            *t_max = f32::NEG_INFINITY;
        }
    }

    #[inline(always)]
    fn places(&self, nodes: &[Node]) -> Places {
        Places::new(nodes, self.scene.blocks)
    }
}

pub(super) struct AnyOf<'a, F> {
    pub(super) scene: Scene<'a>,
    pub(super) ray: &'a PreparedRay,
    pub(super) bound: Bound,
    pub(super) t_max: f32,
    pub(super) counts: F,
    pub(super) place: &'a mut Option<u32>,
}

impl<F: FnMut(u32) -> bool> Any for AnyOf<'_, F> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let block = &self.scene.blocks[leaf.first() as usize];
        let tested = block.test(self.ray, self.bound, self.t_max);
        if tested.candidates == 0 {
            return false;
        }
        let front_only = self.scene.front_only;
        let looked = block.look(self.ray, &tested).any(self.ray, self.t_max, front_only);
        *self.place =
            block.any(looked, self.ray, self.t_max, front_only, &mut self.counts).map(|lane| leaf.first() << 2 | lane);
        self.place.is_some()
    }
}
