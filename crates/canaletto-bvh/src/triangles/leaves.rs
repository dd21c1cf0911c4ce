//! What single rays and streams do at leaves.
#![allow(unsafe_code)] // Kernels for the instructions that a stream is compiled for.

use super::Nearest;
use crate::block::{Bound, Scene, Search, Tested};
use crate::lanes::Exact;
use crate::node::{Node, Places};
use crate::traverse::{Any, Closest, ClosestOfMany};
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
    pub(super) rays: &'a [PreparedRay],
    pub(super) nearest: &'a mut [Nearest],
    pub(super) ways: &'a mut [Way],
}

/// What a ray of a stream knows.
pub(super) struct Way {
    pub(super) bound: Bound,
    /// The triangle that was met last, which may come again in another leaf.
    pub(super) known: u32,
}

impl ClosestOfMany for OfRays<'_> {
    /// The triangles that may be hit, a bit for each.
    type Finding = u32;

    #[inline(always)]
    fn test(&self, ray: usize, leaf: Leaf, t_max: f32) -> (bool, u32) {
        let (block, way) = (&self.scene.blocks[leaf.first() as usize], &self.ways[ray]);
        let tested = block.test(&self.rays[ray], way.bound, t_max);
        let candidates = tested.candidates & !block.lane_of(way.known);
        (candidates != 0, candidates)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: usize, leaf: Leaf, candidates: &u32, t_max: &mut f32) {
        let (block, way) = (&self.scene.blocks[leaf.first() as usize], &mut self.ways[ray]);
        let (nearest, front_only) = (&mut self.nearest[ray], self.scene.front_only);
        // SAFETY: the caller's promise.
        let met = unsafe { block.offer_some::<E::Four>(*candidates, &self.rays[ray], way.bound, nearest, front_only) };
        if let Some(lane) = met {
            way.known = block.id(lane);
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
    pub(super) rays: &'a [PreparedRay],
    pub(super) bounds: &'a [Bound],
}

impl ClosestOfMany for AnyOfRays<'_> {
    type Finding = Tested;
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: usize, leaf: Leaf, t_max: f32) -> (bool, Tested) {
        let tested = self.scene.blocks[leaf.first() as usize].test(&self.rays[ray], self.bounds[ray], t_max);
        (tested.candidates != 0, tested)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: usize, leaf: Leaf, tested: &Tested, t_max: &mut f32) {
        let (block, bound) = (&self.scene.blocks[leaf.first() as usize], self.bounds[ray]);
        if block.any(&self.rays[ray], bound, tested, *t_max, self.scene.front_only, &mut |_| true).is_some() {
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
        *self.place = block
            .any(self.ray, self.bound, &tested, self.t_max, self.scene.front_only, &mut self.counts)
            .map(|lane| leaf.first() << 2 | lane);
        self.place.is_some()
    }
}
