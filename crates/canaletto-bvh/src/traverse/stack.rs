//! The traversal stack: the nodes and leaves that a ray has entered but not yet visited.
#![allow(unsafe_code)] // Uninitialised memory, and kernels.

use std::mem::MaybeUninit;

use crate::node::MAX_DEPTH;
use crate::node::{Node, NodeRef};
use crate::simd::{NodeTest, TraversalRay};
use crate::slab::WIDTH;

/// The size of the stack. Each level of the tree takes one entry and leaves at most eight. A visit may write eight
/// entries beyond the last.
const STACK: usize = (MAX_DEPTH as usize + 1) * (WIDTH - 1) + 1 + WIDTH;

/// `a` if `count` is not 0, else `b`, without a branch. The compiler would turn other code for this into a branch.
#[inline(always)]
fn choose(count: usize, a: NodeRef, b: NodeRef) -> NodeRef {
    #[cfg(target_arch = "x86_64")]
    {
        let (mut chosen, other) = (a.bits(), b.bits());
        // SAFETY: the instructions only read and write registers.
        unsafe {
            std::arch::asm!("test {0}, {0}", "cmovz {1:e}, {2:e}", in(reg) count, inout(reg) chosen, in(reg) other,
                options(pure, nomem, nostack));
        }
        NodeRef::from_bits(chosen)
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::hint::select_unpredictable(count == 0, b, a)
}

/// The entries that are still to be visited, with the distances at which the ray enters them.
pub(super) struct Stack {
    near: [MaybeUninit<f32>; STACK],
    node_refs: [MaybeUninit<NodeRef>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(super) fn new() -> Stack {
        // Not `[MaybeUninit::uninit(); STACK]`, which the compiler would fill with zeros.
        let mut stack = Stack {
            near: [const { MaybeUninit::uninit() }; STACK],
            node_refs: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        };
        stack.clear();
        stack
    }

    /// Empties the stack down to the lowest entry, [`NodeRef::END`].
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.near[0].write(f32::NEG_INFINITY);
        self.node_refs[0].write(NodeRef::END);
        self.len = 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self) -> NodeRef {
        self.len -= 1;
        // SAFETY: entries below `len` were written. The traversal ends when END is popped, which is the lowest entry
        // (END is also the link of a lane without a child).
        unsafe { self.node_refs.get_unchecked(self.len).assume_init() }
    }

    /// Pushes the children of a node that the ray enters. Returns their number and the topmost of them, if there is
    /// one.
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
        // SAFETY: the caller's promise. No path through a tree has more than MAX_DEPTH + 1 nodes (see
        // `Node::children`). Each node leaves at most seven of its children behind, whichever are entered, so that
        // there is always room for eight.
        unsafe {
            let near = self.near.as_mut_ptr().add(self.len).cast();
            let node_refs = self.node_refs.as_mut_ptr().add(self.len).cast();
            let (count, nearest) = N::visit::<R, ORDERED>(node, ray, limit, near, node_refs);
            self.len += count;
            (count, nearest)
        }
    }

    /// Visits a node and returns what to visit next. A branch selects it: if the processor predicts the branch, the
    /// next visit starts before this one has ended.
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

    /// [`Stack::visit`] without a branch. In a stream, a mispredicted branch would undo visits of other rays.
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
            let before = self.node_refs.get_unchecked(len - 1).assume_init();
            let (count, last) = self.push::<R, N, ORDERED>(node, ray, limit);
            // Finding the last entry through the order word costs more than reading it back from the stack.
            if ORDERED {
                return self.pop();
            }
            self.len = len + count - 1;
            choose(count, last, before)
        }
    }

    /// Culls the entries whose entry distance is beyond `limit`, except the lowest entry.
    #[inline(always)]
    pub(super) fn cull(&mut self, limit: f32) {
        let mut kept = 1;
        for i in 1..self.len {
            // SAFETY: entries below `len` were written, and `kept` ≤ i.
            unsafe {
                let near = self.near.get_unchecked(i).assume_init();
                *self.near.get_unchecked_mut(kept) = MaybeUninit::new(near);
                *self.node_refs.get_unchecked_mut(kept) = *self.node_refs.get_unchecked(i);
                kept += usize::from(near <= limit);
            }
        }
        self.len = kept;
    }
}
