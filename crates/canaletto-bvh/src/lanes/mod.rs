//! A ray against the eight boxes of a node, by the instructions that the machine has.
//!
//! All give the same answer: what the ray meets, roughly from far to near, and where it enters. Only + − × and comparisons
//! are used, never fused.

#![allow(unsafe_code)] // Intrinsics, and stacks written without bounds checks.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
pub(crate) use portable::{Careful, Portable};

use crate::node::{Link, Node};
use crate::slab::Slabs;
use std::sync::atomic::{AtomicU8, Ordering};

/// A way to test a ray against a node.
pub(crate) trait Lanes: Copy {
    /// Writes the children that the ray, a `regular` one but for [`Careful`], meets before `limit`, and where it enters them, the nearest in general last. Returns how
    /// many they are.
    ///
    /// # Safety
    /// The machine must have the instructions, and there must be room for eight entries.
    unsafe fn visit(node: &Node, slabs: &Slabs, limit: f32, near: *mut f32, links: *mut Link) -> usize;
}

/// Sets of instructions that kernels exist for, each with all before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum InstructionSet {
    /// What every machine has: SSE2 on x86-64, NEON on ARM.
    Baseline = 1,
    /// AVX2.
    Avx2 = 2,
    /// AVX-512 F, VL, BW and DQ.
    Avx512 = 3,
}

static CHOSEN: AtomicU8 = AtomicU8::new(0);

impl InstructionSet {
    /// The sets that this machine has.
    pub fn available() -> &'static [InstructionSet] {
        const ALL: [InstructionSet; 3] = [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];
        &ALL[..InstructionSet::best() as usize]
    }

    fn best() -> InstructionSet {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
            {
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                {
                    return InstructionSet::Avx512;
                }
                return InstructionSet::Avx2;
            }
        }
        InstructionSet::Baseline
    }

    /// The set in use: the best that the machine has, unless [`InstructionSet::limit`] said otherwise.
    #[inline]
    pub fn current() -> InstructionSet {
        match CHOSEN.load(Ordering::Relaxed) {
            0 => InstructionSet::choose(),
            1 => InstructionSet::Baseline,
            2 => InstructionSet::Avx2,
            _ => InstructionSet::Avx512,
        }
    }

    #[cold]
    fn choose() -> InstructionSet {
        let best = InstructionSet::best();
        CHOSEN.store(best as u8, Ordering::Relaxed);
        best
    }

    /// From now on uses no instructions beyond this set, in all threads: for tests and measurements. No answer depends on it.
    pub fn limit(self) {
        CHOSEN.store(self.min(InstructionSet::best()) as u8, Ordering::Relaxed);
    }
}
