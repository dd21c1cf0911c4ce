//! SIMD: explicit vectors and the node test. Read the files in this order:
//!
//! 1. `dispatch`: the place that chooses instructions at run time, for explicit vectors (`SimdKernel`) and for
//!    traversals (`Traversal`). Plain loops are chosen in `instruction_set`.
//! 2. `node_test/`: the test of a ray against the eight boxes of a node, once per instruction set.
//! 3. `vector/`: vectors of 4, 8 or 16 f32 for packets. `f64x4`: vectors of four f64 for the exact test.
//!
//! All instruction sets give equal results, bit for bit.
#![allow(unsafe_code)] // Intrinsics.

/// Implements the operators of a vector type by functions of the wrapped value.
macro_rules! operators {
    ($type:ty { $($trait:ident $name:ident ($a:ident, $b:ident) $do:expr;)* }) => {
        $(impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let ($a, $b) = (self.0, other.0);
                #[allow(unused_unsafe)]
                // SAFETY: a value exists only if the machine has the instructions, as its constructor requires.
                unsafe { Self($do) }
            }
        })*
    };
}

pub(crate) mod dispatch;
mod f64x4;
mod node_test;
mod vector;

pub(crate) use f64x4::F64x4;
pub(crate) use node_test::{IrregularNodeTest, NodeTest, TraversalRay};
#[cfg(target_arch = "x86_64")]
pub(crate) use vector::{Avx2, Avx512};
pub(crate) use vector::{Baseline, Instructions, Mask, ROW, Row, Vector};
