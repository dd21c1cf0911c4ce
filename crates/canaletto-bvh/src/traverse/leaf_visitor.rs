//! The leaf tests of single rays, as traits.

use crate::node::Leaf;

/// The leaf test of a closest-hit query. Unlike a closure it can be marked `#[inline(always)]`, so that it is compiled
/// for the instructions of its caller.
pub(crate) trait ClosestVisitor {
    /// Tests a leaf and lowers `t_max` to the nearest hit.
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32);
}

impl<F: FnMut(Leaf, &mut f32)> ClosestVisitor for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        self(leaf, t_max);
    }
}

/// The leaf test of an any-hit query.
pub(crate) trait AnyHitVisitor {
    /// Whether a primitive of the leaf is hit.
    fn leaf(&mut self, leaf: Leaf) -> bool;
}

impl<F: FnMut(Leaf) -> bool> AnyHitVisitor for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        self(leaf)
    }
}
