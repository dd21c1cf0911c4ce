//! What is done at the leaves that a single ray meets.

use crate::node::Leaf;

/// What is done at leaves. Unlike a closure it can be told to be inlined, so that it, too, is compiled for the instructions of its
/// caller.
pub(crate) trait ClosestVisitor {
    /// Tests a leaf, and lowers `t_max` to the nearest hit.
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32);
}

impl<F: FnMut(Leaf, &mut f32)> ClosestVisitor for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        self(leaf, t_max);
    }
}

/// The same for any hit.
pub(crate) trait AnyHitVisitor {
    /// Whether something is hit in a leaf.
    fn leaf(&mut self, leaf: Leaf) -> bool;
}

impl<F: FnMut(Leaf) -> bool> AnyHitVisitor for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        self(leaf)
    }
}
