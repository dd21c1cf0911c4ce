//! The leaf tests of single rays and streams.
#![allow(unsafe_code)] // Kernels for the instructions that a stream is compiled for.

use std::hint::select_unpredictable;

use crate::PrimitiveHit;
use crate::node::{Node, PrefetchTable};
use crate::primitive::edge_error::EdgeError;
use crate::primitive::triangle4::{CoarseTest, Search, TriangleScene};
use crate::simd::NodeTest;
use crate::traverse::{AnyHitVisitor, ClosestVisitor, NumberedRay, StreamVisitor};
use crate::{FilterFunction, Leaf, PreparedRay};

pub(super) struct ClosestOfRay<'a> {
    pub(super) scene: TriangleScene<'a>,
    pub(super) ray: &'a PreparedRay,
    pub(super) nearest: &'a mut PrimitiveHit,
    pub(super) search: &'a mut Search,
}

impl ClosestVisitor for ClosestOfRay<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        let (may_hit, tested) = self.search.test(&self.scene.blocks[leaf.first() as usize], self.ray, *t_max);
        if may_hit {
            self.search.test_candidates(self.scene, leaf.first(), self.ray, &tested, self.nearest, t_max);
        }
    }
}

pub(super) struct ClosestOfStream<'a> {
    pub(super) scene: TriangleScene<'a>,
    pub(super) nearest: &'a mut [PrimitiveHit],
    pub(super) bound: EdgeError,
    /// For each ray the id of the last triangle that was hit. The ray may hit it again in another leaf.
    pub(super) last_seen: &'a mut [u32],
}

impl StreamVisitor for ClosestOfStream<'_> {
    type CoarseResult = CoarseTest;

    #[inline(always)]
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, CoarseTest) {
        let tested = self.scene.blocks[leaf.first() as usize].test(ray.ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    #[inline(always)]
    fn refine(&self, ray: NumberedRay<'_>, leaf: Leaf, tested: &CoarseTest, t_max: &mut f32) -> u32 {
        let block = &self.scene.blocks[leaf.first() as usize];
        let candidates = block.refine(ray.ray, tested).closest(*t_max, self.scene.front_only);
        candidates & !block.lane_of(self.last_seen[ray.number])
    }

    #[inline(always)]
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        _: &CoarseTest,
        which: u32,
        t_max: &mut f32,
    ) {
        let (block, nearest) = (&self.scene.blocks[leaf.first() as usize], &mut self.nearest[ray.number]);
        // SAFETY: the caller's promise.
        let met = unsafe { block.accept_nearest_of::<N::F64x4>(which, ray.ray, nearest, self.scene.front_only) };
        if let Some(lane) = met {
            self.last_seen[ray.number] = block.id(lane);
        }
        *t_max = nearest.t;
    }

    #[inline(always)]
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::new(nodes, self.scene.blocks)
    }
}

pub(super) struct AnyHitOfStream<'a> {
    pub(super) scene: TriangleScene<'a>,
    pub(super) bound: EdgeError,
}

impl StreamVisitor for AnyHitOfStream<'_> {
    type CoarseResult = CoarseTest;
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, CoarseTest) {
        let tested = self.scene.blocks[leaf.first() as usize].test(ray.ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    #[inline(always)]
    fn refine(&self, ray: NumberedRay<'_>, leaf: Leaf, tested: &CoarseTest, t_max: &mut f32) -> u32 {
        let (block, ray) = (&self.scene.blocks[leaf.first() as usize], ray.ray);
        let (surely, possibly) = block.refine(ray, tested).any(ray, *t_max, self.scene.front_only);
        *t_max = select_unpredictable(surely != 0, f32::NEG_INFINITY, *t_max);
        select_unpredictable(surely != 0, 0, possibly)
    }

    #[inline(always)]
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        _: &CoarseTest,
        which: u32,
        t_max: &mut f32,
    ) {
        let block = &self.scene.blocks[leaf.first() as usize];
        if block.any((0, which), ray.ray, *t_max, self.scene.front_only, &mut |_| true).is_some() {
            *t_max = f32::NEG_INFINITY;
        }
    }

    #[inline(always)]
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::new(nodes, self.scene.blocks)
    }
}

pub(super) struct AnyHitOfRay<'a> {
    pub(super) scene: TriangleScene<'a>,
    pub(super) ray: &'a PreparedRay,
    pub(super) bound: EdgeError,
    pub(super) t_max: f32,
    pub(super) counts: &'a mut FilterFunction<'a>,
    pub(super) place: &'a mut Option<u32>,
}

impl AnyHitVisitor for AnyHitOfRay<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let block = &self.scene.blocks[leaf.first() as usize];
        let tested = block.test(self.ray, self.bound, self.t_max);
        if tested.candidates == 0 {
            return false;
        }
        let front_only = self.scene.front_only;
        let refined = block.refine(self.ray, &tested).any(self.ray, self.t_max, front_only);
        *self.place =
            block.any(refined, self.ray, self.t_max, front_only, self.counts).map(|lane| leaf.first() << 2 | lane);
        self.place.is_some()
    }
}
