//! SIMD: which instructions the machine has, vectors over them, and the test of a ray against the eight boxes of a node.
//!
//! [`dispatch`] is the one place that chooses instructions at run time.
#![allow(unsafe_code)] // Intrinsics.

/// Operators of what wraps numbers side by side, by functions of what it wraps.
macro_rules! operators {
    ($type:ty { $($trait:ident $name:ident ($a:ident, $b:ident) $do:expr;)* }) => {
        $(impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let ($a, $b) = (self.0, other.0);
                #[allow(unused_unsafe)]
                // SAFETY: who made the values knows that the machine has the instructions.
                unsafe { Self($do) }
            }
        })*
    };
}

pub(crate) mod dispatch;
mod f64x4;
mod instruction_set;
mod node_test;
mod vector;

pub use dispatch::Kernel;
pub(crate) use dispatch::compiled_wide;
pub(crate) use f64x4::F64x4;
pub use instruction_set::InstructionSet;
pub(crate) use node_test::{IrregularNodeTest, NodeTest, TraversalRay};
#[cfg(target_arch = "x86_64")]
pub(crate) use vector::{Avx2, Avx512};
pub(crate) use vector::{Baseline, Instructions, Mask, Row, SIXTEEN, Vector};
