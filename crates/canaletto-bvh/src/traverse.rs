//! Ways of rays through the tree.
//!
//! Nothing branches on how many children a ray meets: what it meets goes on its stack at once, the nearest on top. That
//! order is approximate (see `node`); where each child is entered is kept, and what a hit has cut off is forgotten.
#![allow(unsafe_code)] // Kernels compiled for instructions that are asked for at run time, and stacks that are not cleared.

mod stack;
mod stream;

use crate::lanes::{Careful, InstructionSet, Lanes, Passing, Portable};
use crate::node::{Leaf, Link, Node};
use crate::slab::limit as limit_of;
use stack::Stack;
pub(crate) use stream::{ClosestOfMany, Numbered, closest_of_many};

/// What is compiled for each set of instructions.
trait Passage {
    /// What it takes through the tree.
    type Ray: Passing;
    /// What it tells.
    type Answer;
    /// Runs it, over all nodes of a tree. To be inlined into what is compiled for the instructions.
    ///
    /// # Safety
    /// As for [`Lanes`].
    unsafe fn run<L: Lanes<Self::Ray>>(self) -> Self::Answer;
}

/// Runs a passage by the machine's instructions, or carefully for a ray that needs it.
#[inline]
fn run<P: Passage>(regular: bool, passage: P) -> P::Answer {
    // SAFETY: `current` never tells more than the machine has; `Portable` and `Careful` need nothing.
    unsafe {
        if !regular {
            return passage.run::<Careful>();
        }
        match InstructionSet::current() {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => x86::avx512(passage),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => x86::avx2(passage),
            _ => passage.run::<Portable>(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Passage;
    use crate::lanes::{Avx2, Avx512};

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) unsafe fn avx2<P: Passage>(passage: P) -> P::Answer {
        // SAFETY: the caller's promise.
        unsafe { passage.run::<Avx2>() }
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
    pub(super) unsafe fn avx512<P: Passage>(passage: P) -> P::Answer {
        // SAFETY: the caller's promise.
        unsafe { passage.run::<Avx512>() }
    }
}

/// What is done at leaves. Unlike a closure it can be told to be inlined, so that it, too, is compiled for the instructions of its
/// caller.
pub(crate) trait Closest {
    /// Tests a leaf, and lowers `t_max` to the nearest hit.
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32);
}

impl<F: FnMut(Leaf, &mut f32)> Closest for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        self(leaf, t_max);
    }
}

/// The same for any hit.
pub(crate) trait Any {
    /// Whether something is hit in a leaf.
    fn leaf(&mut self, leaf: Leaf) -> bool;
}

impl<F: FnMut(Leaf) -> bool> Any for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        self(leaf)
    }
}

/// [`crate::Bvh::intersect`], for a ray with or without a margin. Returns what `t_max` is in the end.
#[inline]
pub(crate) fn closest<R: Passing>(nodes: &[Node], ray: &R, t_max: f32, leaf: impl Closest) -> f32 {
    run(ray.ray().regular, ToNearest { nodes, ray, t_max, leaf })
}

struct ToNearest<'a, R, F> {
    nodes: &'a [Node],
    ray: &'a R,
    t_max: f32,
    leaf: F,
}

impl<R: Passing, F: Closest> Passage for ToNearest<'_, R, F> {
    type Ray = R;
    type Answer = f32;

    #[inline(always)]
    unsafe fn run<L: Lanes<R>>(self) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { closest_by::<R, L, F>(self.nodes, self.ray, self.t_max, self.leaf) }
    }
}

/// [`closest`] by these instructions.
///
/// # Safety
/// As for [`Lanes`]; `nodes` must be all of a tree.
#[inline(always)]
pub(crate) unsafe fn closest_by<R, L: Lanes<R>, F: Closest>(
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
    let mut link = Link::node(0);
    // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met.
    unsafe {
        loop {
            while !link.is_leaf() {
                link = stack.visit::<R, L, true>(nodes.get_unchecked(link.node_index()), ray, limit);
            }
            if link == Link::END {
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
pub(crate) fn any<R: Passing>(nodes: &[Node], ray: &R, t_max: f32, leaf: impl Any) -> bool {
    run(ray.ray().regular, ToAny { nodes, ray, t_max, leaf })
}

struct ToAny<'a, R, F> {
    nodes: &'a [Node],
    ray: &'a R,
    t_max: f32,
    leaf: F,
}

impl<R: Passing, F: Any> Passage for ToAny<'_, R, F> {
    type Ray = R;
    type Answer = bool;

    #[inline(always)]
    unsafe fn run<L: Lanes<R>>(mut self) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let mut stack = Stack::new();
        let limit = limit_of(self.t_max);
        let mut link = Link::node(0);
        // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met.
        unsafe {
            loop {
                while !link.is_leaf() {
                    link = stack.visit::<R, L, false>(self.nodes.get_unchecked(link.node_index()), self.ray, limit);
                }
                if link == Link::END {
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
