//! The test of a ray against the eight boxes of a node, once per instruction set.
//!
//! All versions give equal results: the entered children, roughly from far to near, and the distances at which they are
//! entered. They use only + − × and comparisons, and never fuse them.

#![allow(unsafe_code)] // Intrinsics, and stacks written without bounds checks.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

pub(crate) use portable::IrregularNodeTest;

use super::F64x4;
#[cfg(target_arch = "x86_64")]
use super::f64x4::AvxF64x4;
use super::f64x4::ScalarF64x4;
use crate::node::{Node, NodeRef};
use crate::{Aabb, InflatedRay, PreparedRay};

/// A ray that traverses a tree, with or without a margin (Embree's `TravRay`).
pub(crate) trait TraversalRay {
    /// The ray itself.
    fn ray(&self) -> &PreparedRay;
    /// The origins for the entry planes and for the exit planes.
    fn origins(&self) -> [&[f32; 3]; 2];
    /// The box enlarged by the ray's margin.
    fn inflate(&self, bounds: Aabb) -> Aabb;
    /// A hook that is called for each node that is tested box by box.
    #[inline(always)]
    fn visited(&self) {}
}

impl TraversalRay for PreparedRay {
    #[inline(always)]
    fn ray(&self) -> &PreparedRay {
        self
    }

    #[inline(always)]
    fn origins(&self) -> [&[f32; 3]; 2] {
        [self.ray.origin.as_ref(); 2]
    }

    #[inline(always)]
    fn inflate(&self, bounds: Aabb) -> Aabb {
        bounds
    }
}

impl TraversalRay for InflatedRay {
    #[inline(always)]
    fn ray(&self) -> &PreparedRay {
        &self.ray
    }

    #[inline(always)]
    fn origins(&self) -> [&[f32; 3]; 2] {
        self.origins.each_ref()
    }

    #[inline(always)]
    fn inflate(&self, bounds: Aabb) -> Aabb {
        InflatedRay::inflate(self, &bounds)
    }
}

/// A node test: an implementation for one instruction set.
pub(crate) trait NodeTest: Copy {
    /// Four f64 numbers with these instructions.
    type F64x4: F64x4;

    /// Writes the children that the ray enters before `limit`. The ray has to be `regular`, except for
    /// [`IrregularNodeTest`].
    ///
    /// With `ORDERED`, the child that is usually the nearest comes last, and the entry distances are written, too.
    /// Otherwise the child of highest any-hit priority comes last. Returns the number of entered children, and the last
    /// link again, if there is one. Reading that link back from the stack would be a failed store-to-load forward from
    /// a wide store.
    ///
    /// Whatever numbers the ray holds, no more than eight links are written, and only those of the node. A lane without
    /// a child is never entered, and a ray with NaN enters no lane.
    ///
    /// # Safety
    /// The machine must have the instructions, and there must be room for eight entries.
    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        near: *mut f32,
        node_refs: *mut NodeRef,
    ) -> (usize, NodeRef);
}
