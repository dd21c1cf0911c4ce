//! The traversal of one ray.
//!
//! No branch depends on how many children a ray enters: the entered children go on the stack at once, with the nearest
//! on top. Their order is approximate (see `node`). The stack also keeps the distance at which each child is entered,
//! and a new hit culls the entries behind it.
#![allow(unsafe_code)] // Kernels for instructions that are chosen at run time, and uninitialised stacks.

use super::stack::Stack;
use super::{AnyHitVisitor, ClosestVisitor};
use crate::node::{Node, NodeRef};
use crate::simd::dispatch::{self, Traversal};
use crate::simd::{NodeTest, TraversalRay};
use crate::slab::cull_limit;

/// [`crate::Bvh::intersect`], for a ray with or without a margin. Returns the final `t_max`.
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

/// [`closest`] with the node test `N`.
///
/// # Safety
/// As for [`NodeTest`]; `nodes` must be all nodes of a tree.
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
    let mut limit = cull_limit(t_max);
    let mut node_ref = NodeRef::node(0);
    // SAFETY: the caller's promise. Links lead to nodes of the tree, to leaves, or are END (see `Node::children`),
    // whatever lanes are entered.
    unsafe {
        loop {
            // Descend: test the node, push the entered children, go on with the nearest.
            while !node_ref.is_leaf() {
                node_ref = stack.visit::<R, N, true>(nodes.get_unchecked(node_ref.node_index()), ray, limit);
            }
            // The stack is empty: the traversal has ended.
            if node_ref == NodeRef::END {
                return t_max;
            }
            // This is a leaf: test its primitives.
            let before = t_max;
            leaf.leaf(node_ref.leaf(), &mut t_max);
            // A nearer hit: cull the entries behind it.
            if t_max < before {
                limit = cull_limit(t_max);
                stack.cull(limit);
            }
            // Pop the next node or leaf.
            node_ref = stack.pop();
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
        let limit = cull_limit(self.t_max);
        let mut node_ref = NodeRef::node(0);
        // SAFETY: the caller's promise. Links lead to nodes of the tree, to leaves, or are END (see `Node::children`),
        // whatever lanes are entered.
        unsafe {
            loop {
                // Descend: test the node, push the entered children, go on with the last.
                while !node_ref.is_leaf() {
                    node_ref =
                        stack.visit::<R, N, false>(self.nodes.get_unchecked(node_ref.node_index()), self.ray, limit);
                }
                // The stack is empty: nothing is hit.
                if node_ref == NodeRef::END {
                    return false;
                }
                // This is a leaf: test its primitives, and end at the first hit.
                if self.leaf.leaf(node_ref.leaf()) {
                    return true;
                }
                // Pop the next node or leaf.
                node_ref = stack.pop();
            }
        }
    }
}
