//! A ray against the eight boxes of a node, by the instructions that the machine has.
//!
//! All give the same answer: what the ray meets, roughly from far to near, and where it enters. Only + − × and comparisons
//! are used, never fused.

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

/// What goes through a tree: a ray with or without a margin.
pub(crate) trait TraversalRay {
    /// The ray itself.
    fn ray(&self) -> &PreparedRay;
    /// The origins from which the planes that it enters by, and those that it leaves by, are seen.
    fn origins(&self) -> [&[f32; 3]; 2];
    /// A box with its margin.
    fn grown(&self, bounds: Aabb) -> Aabb;
    /// Called for each node that is tested box by box.
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
    fn grown(&self, bounds: Aabb) -> Aabb {
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
    fn grown(&self, bounds: Aabb) -> Aabb {
        InflatedRay::grown(self, &bounds)
    }
}

/// A way to test a ray against a node.
pub(crate) trait NodeTest: Copy {
    /// Four numbers of f64 by these instructions.
    type F64x4: F64x4;

    /// Writes the children that the ray, a `regular` one but for [`IrregularNodeTest`], meets before `limit`: if `ORDERED`, the nearest in
    /// general last, and where it enters them; else the most promising for any hit last. Returns how
    /// many they are, and the last link again, if there is one: to read it where it was just written would have to wait until a part of a wide store
    /// can be read.
    ///
    /// Whatever numbers the ray holds, no more than eight links are written, and only those of the node; a lane without a child is
    /// never met, as NaN is not.
    ///
    /// # Safety
    /// The machine must have the instructions, and there must be room for eight entries.
    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        near: *mut f32,
        links: *mut NodeRef,
    ) -> (usize, NodeRef);
}
