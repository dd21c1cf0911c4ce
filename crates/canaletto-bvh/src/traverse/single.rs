//! One ray through the tree.
//!
//! Nothing branches on how many children a ray meets: what it meets goes on its stack at once, the nearest on top. That
//! order is approximate (see `node`); where each child is entered is kept, and what a hit has cut off is forgotten.
#![allow(unsafe_code)] // Kernels compiled for instructions that are asked for at run time, and stacks that are not cleared.

use super::stack::Stack;
use super::{AnyHitVisitor, ClosestVisitor};
use crate::node::{Node, NodeRef};
use crate::simd::dispatch::{self, Traversal};
use crate::simd::{NodeTest, TraversalRay};
use crate::slab::limit as limit_of;

/// [`crate::Bvh::intersect`], for a ray with or without a margin. Returns what `t_max` is in the end.
#[inline]
pub(crate) fn closest<R: TraversalRay>(nodes: &[Node], ray: &R, t_max: f32, leaf: impl ClosestVisitor) -> f32 {
    dispatch::traverse(ray.ray().regular, ClosestTraversal { nodes, ray, t_max, leaf })
}

struct ClosestTraversal<'a, R, F> {
    nodes: &'a [Node],
    ray: &'a R,
    t_max: f32,
    leaf: F,
}

impl<R: TraversalRay, F: ClosestVisitor> Traversal for ClosestTraversal<'_, R, F> {
    type Answer = f32;

    #[inline(always)]
    unsafe fn run<N: NodeTest>(self) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { closest_by::<R, N, F>(self.nodes, self.ray, self.t_max, self.leaf) }
    }
}

/// [`closest`] by these instructions.
///
/// # Safety
/// As for [`NodeTest`]; `nodes` must be all of a tree.
#[inline(always)]
pub(crate) unsafe fn closest_by<R: TraversalRay, N: NodeTest, F: ClosestVisitor>(
    nodes: &[Node],
    ray: &R,
    mut t_max: f32,
    mut leaf: F,
) -> f32 {
    if nodes.is_empty() {
        return t_max;
    }
    let mut stack = Stack::new();
    let mut limit = limit_of(t_max);
    let mut link = NodeRef::node(0);
    // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met.
    unsafe {
        loop {
            while !link.is_leaf() {
                link = stack.visit::<R, N, true>(nodes.get_unchecked(link.node_index()), ray, limit);
            }
            if link == NodeRef::END {
                return t_max;
            }
            let before = t_max;
            leaf.leaf(link.leaf(), &mut t_max);
            if t_max < before {
                limit = limit_of(t_max);
                stack.cull(limit);
            }
            link = stack.pop();
        }
    }
}

/// [`crate::Bvh::occluded`], for a ray with or without a margin.
#[inline]
pub(crate) fn any<R: TraversalRay>(nodes: &[Node], ray: &R, t_max: f32, leaf: impl AnyHitVisitor) -> bool {
    dispatch::traverse(ray.ray().regular, AnyHitTraversal { nodes, ray, t_max, leaf })
}

struct AnyHitTraversal<'a, R, F> {
    nodes: &'a [Node],
    ray: &'a R,
    t_max: f32,
    leaf: F,
}

impl<R: TraversalRay, F: AnyHitVisitor> Traversal for AnyHitTraversal<'_, R, F> {
    type Answer = bool;

    #[inline(always)]
    unsafe fn run<N: NodeTest>(mut self) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let mut stack = Stack::new();
        let limit = limit_of(self.t_max);
        let mut link = NodeRef::node(0);
        // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met.
        unsafe {
            loop {
                while !link.is_leaf() {
                    link = stack.visit::<R, N, false>(self.nodes.get_unchecked(link.node_index()), self.ray, limit);
                }
                if link == NodeRef::END {
                    return false;
                }
                if self.leaf.leaf(link.leaf()) {
                    return true;
                }
                link = stack.pop();
            }
        }
    }
}
