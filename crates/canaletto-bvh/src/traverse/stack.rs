//! What waits while a ray is on its way through the tree.
#![allow(unsafe_code)] // Memory that is not cleared, and kernels.

use std::mem::MaybeUninit;

use crate::build::MAX_DEPTH;
use crate::node::{Node, NodeRef};
use crate::simd::{NodeTest, TraversalRay};
use crate::slab::WIDTH;

/// Each level takes one entry and leaves at most eight; a visit may write eight more beyond the last.
const STACK: usize = (MAX_DEPTH as usize + 1) * (WIDTH - 1) + 1 + WIDTH;

/// `a` unless `count` is 0, then `b`: without a branch, which the compiler would make of anything else that says so.
#[inline(always)]
fn choose(count: usize, a: NodeRef, b: NodeRef) -> NodeRef {
    #[cfg(target_arch = "x86_64")]
    {
        let (mut chosen, other) = (a.bits(), b.bits());
        // SAFETY: numbers in, a number out.
        unsafe {
            std::arch::asm!("test {0}, {0}", "cmovz {1:e}, {2:e}", in(reg) count, inout(reg) chosen, in(reg) other,
                options(pure, nomem, nostack));
        }
        NodeRef::from_bits(chosen)
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::hint::select_unpredictable(count == 0, b, a)
}

/// What waits to be visited, and where the ray enters it.
pub(super) struct Stack {
    near: [MaybeUninit<f32>; STACK],
    links: [MaybeUninit<NodeRef>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(super) fn new() -> Stack {
        // Not `[MaybeUninit::uninit(); STACK]`, which the compiler fills with zeros.
        let mut stack = Stack {
            near: [const { MaybeUninit::uninit() }; STACK],
            links: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        };
        stack.clear();
        stack
    }

    /// Leaves nothing but [`NodeRef::END`].
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.near[0].write(f32::NEG_INFINITY);
        self.links[0].write(NodeRef::END);
        self.len = 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self) -> NodeRef {
        self.len -= 1;
        // SAFETY: entries below `len` were written, and a way ends where END is popped, which is the lowest (and what a lane without a child has).
        unsafe { self.links.get_unchecked(self.len).assume_init() }
    }

    /// Puts what the ray meets in a node on top. Returns how much it is, and the topmost, if there is one.
    ///
    /// # Safety
    /// As for [`NodeTest`]; the node must be one of the tree that the stack was made for.
    #[inline(always)]
    unsafe fn push<R: TraversalRay, N: NodeTest, const ORDERED: bool>(
        &mut self,
        node: &Node,
        ray: &R,
        limit: f32,
    ) -> (usize, NodeRef) {
        if cfg!(any(test, debug_assertions)) {
            assert!(self.len > 0 && self.len + WIDTH <= STACK);
        }
        // SAFETY: the caller's promise. No way through a tree has more than MAX_DEPTH + 1 nodes (see `Node::children`), and each leaves at most
        // seven of its children behind, whichever are met, so that there is always room for eight.
        unsafe {
            let near = self.near.as_mut_ptr().add(self.len).cast();
            let links = self.links.as_mut_ptr().add(self.len).cast();
            let (count, nearest) = N::visit::<R, ORDERED>(node, ray, limit, near, links);
            self.len += count;
            (count, nearest)
        }
    }

    /// Visits a node. Returns what to visit next, chosen by a branch: the next visit then starts before this one has ended, if the processor guesses
    /// well.
    ///
    /// # Safety
    /// As for [`Stack::push`].
    #[inline(always)]
    pub(super) unsafe fn visit<R: TraversalRay, N: NodeTest, const ORDERED: bool>(
        &mut self,
        node: &Node,
        ray: &R,
        limit: f32,
    ) -> NodeRef {
        // SAFETY: the caller's promise.
        match unsafe { self.push::<R, N, ORDERED>(node, ray, limit) } {
            (0, _) => self.pop(),
            (_, nearest) => {
                self.len -= 1;
                nearest
            }
        }
    }

    /// The same without a branch: a wrong guess would undo visits of other rays.
    ///
    /// # Safety
    /// As for [`Stack::push`].
    #[inline(always)]
    pub(super) unsafe fn visit_without_branch<R: TraversalRay, N: NodeTest, const ORDERED: bool>(
        &mut self,
        node: &Node,
        ray: &R,
        limit: f32,
    ) -> NodeRef {
        // SAFETY: the caller's promise; entries below `len` were written.
        unsafe {
            let len = self.len;
            let before = self.links.get_unchecked(len - 1).assume_init();
            let (count, last) = self.push::<R, N, ORDERED>(node, ray, limit);
            // Where the last one has to be looked for in an order, it costs less to read it where it was just written.
            if ORDERED {
                return self.pop();
            }
            self.len = len + count - 1;
            choose(count, last, before)
        }
    }

    /// Forgets what is entered beyond `limit`, but for the lowest entry.
    #[inline(always)]
    pub(super) fn cull(&mut self, limit: f32) {
        let mut kept = 1;
        for i in 1..self.len {
            // SAFETY: entries below `len` were written, and `kept` ≤ i.
            unsafe {
                let near = self.near.get_unchecked(i).assume_init();
                *self.near.get_unchecked_mut(kept) = MaybeUninit::new(near);
                *self.links.get_unchecked_mut(kept) = *self.links.get_unchecked(i);
                kept += usize::from(near <= limit);
            }
        }
        self.len = kept;
    }
}
