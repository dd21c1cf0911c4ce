//! Code that is compiled once for each instruction set.

#![allow(unsafe_code)] // Functions for instructions that only some machines have.

use crate::InstructionSet;
use crate::lanes::{Baseline, Instructions};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{WithAvx2, WithAvx512};

/// Loops over numbers side by side, which the compiler makes wide by whatever instructions it may use. They give the same bits with all of
/// them: + − × ÷ and sqrt are never fused.
pub trait Kernel {
    /// What it finds.
    type Answer;
    /// Does the work. Has to be `#[inline(always)]`, as must be all it calls, or it is compiled for the baseline.
    fn run(self) -> Self::Answer;
}

impl InstructionSet {
    /// Runs a kernel by the instructions in use.
    #[inline]
    pub fn run<K: Kernel>(kernel: K) -> K::Answer {
        run(Loops(kernel))
    }
}

struct Loops<K>(K);

impl<K: Kernel> Explicit for Loops<K> {
    type Answer = K::Answer;

    #[inline(always)]
    fn run<S: Instructions>(self, _: S) -> K::Answer {
        self.0.run()
    }
}

/// What says itself what is side by side, by values that [`Instructions`] make.
pub(crate) trait Explicit {
    /// What it finds.
    type Answer;
    /// As [`Kernel::run`].
    fn run<S: Instructions>(self, s: S) -> Self::Answer;
}

/// Runs it by the instructions in use.
#[inline]
pub(crate) fn run<K: Explicit>(kernel: K) -> K::Answer {
    #[cfg(target_arch = "x86_64")]
    match InstructionSet::current() {
        // SAFETY: `current` never tells more than the machine has.
        InstructionSet::Avx512 => return unsafe { avx512(kernel) },
        // SAFETY: as said.
        InstructionSet::Avx2 => return unsafe { avx2(kernel) },
        InstructionSet::Baseline => {}
    }
    kernel.run(Baseline)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn avx2<K: Explicit>(kernel: K) -> K::Answer {
    // SAFETY: who called this knows that the machine has the instructions.
    kernel.run(unsafe { WithAvx2::new() })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512<K: Explicit>(kernel: K) -> K::Answer {
    // SAFETY: who called this knows that the machine has the instructions.
    kernel.run(unsafe { WithAvx512::new() })
}
