//! The choice of instructions at run time: code that is compiled once for each instruction set.

#![allow(unsafe_code)] // Functions for instructions that only some machines have.

#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx512};
use super::{Baseline, Instructions, IrregularNodeTest, NodeTest};
use crate::InstructionSet;

/// A kernel written with explicit vectors of [`Instructions`].
pub(crate) trait SimdKernel {
    /// The result.
    type Answer;
    /// Runs the kernel, as [`Kernel::run`](crate::Kernel::run).
    fn run<S: Instructions>(self, s: S) -> Self::Answer;
}

/// Runs a kernel with the instructions in use.
#[inline]
pub(crate) fn run<K: SimdKernel>(kernel: K) -> K::Answer {
    #[cfg(target_arch = "x86_64")]
    match InstructionSet::current() {
        // SAFETY: `current` never returns more than the machine has.
        InstructionSet::Avx512 => return unsafe { avx512(kernel) },
        // SAFETY: as above.
        InstructionSet::Avx2 => return unsafe { avx2(kernel) },
        InstructionSet::Baseline => {}
    }
    kernel.run(Baseline)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn avx2<K: SimdKernel>(kernel: K) -> K::Answer {
    // SAFETY: the caller of this function ensures that the machine has the instructions.
    kernel.run(unsafe { Avx2::new() })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512<K: SimdKernel>(kernel: K) -> K::Answer {
    // SAFETY: the caller of this function ensures that the machine has the instructions.
    kernel.run(unsafe { Avx512::new() })
}

/// A traversal of a tree, compiled for each instruction set.
pub(crate) trait Traversal {
    /// The result.
    type Answer;
    /// Runs the traversal. It has to be `#[inline(always)]`.
    ///
    /// # Safety
    /// As for [`NodeTest`].
    unsafe fn run<N: NodeTest>(self) -> Self::Answer;
}

/// Runs a traversal with the instructions in use. For a ray that is not `regular`, the boxes are tested one by one.
#[inline]
pub(crate) fn traverse<T: Traversal>(regular: bool, traversal: T) -> T::Answer {
    if regular {
        return run(TraversalKernel(traversal));
    }
    // SAFETY: `IrregularNodeTest` needs no special instructions.
    unsafe { traversal.run::<IrregularNodeTest>() }
}

struct TraversalKernel<T>(T);

impl<T: Traversal> SimdKernel for TraversalKernel<T> {
    type Answer = T::Answer;

    #[inline(always)]
    fn run<S: Instructions>(self, _: S) -> T::Answer {
        // SAFETY: there is an `S`, so the machine has the instructions.
        unsafe { self.0.run::<S>() }
    }
}
