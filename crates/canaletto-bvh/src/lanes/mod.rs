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
mod sixteen;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
pub(crate) use portable::{Careful, Portable};
pub(crate) use sixteen::{Baseline, Instructions, Mask, Row, SIXTEEN, Sixteen};
#[cfg(target_arch = "x86_64")]
pub(crate) use sixteen::{WithAvx2, WithAvx512};

use crate::PreparedRay;
use crate::node::{Link, Node};
use crate::slab::WIDTH;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU8, Ordering};

/// A way to test a ray against a node.
pub(crate) trait Lanes: Copy {
    /// The rays that it knows.
    type Ray;
    /// Writes the children that the ray, a `regular` one but for [`Careful`], meets before `limit`, and where it enters them: the nearest in
    /// general last, or, unless `ORDERED`, the largest. Returns how
    /// many they are, and the last link again, if there is one: to read it where it was just written would have to wait until a part of a wide store
    /// can be read.
    ///
    /// # Safety
    /// The machine must have the instructions, and there must be room for eight entries.
    unsafe fn visit<const ORDERED: bool>(
        node: &Node,
        ray: &Self::Ray,
        limit: f32,
        near: *mut f32,
        links: *mut Link,
    ) -> (usize, Link);
}

/// The same instructions for rays with a margin.
#[derive(Clone, Copy)]
pub(crate) struct Wide<L>(PhantomData<L>);

/// The child of the highest lane in a mask of lanes in the order of `visit`; any child, if there is none.
#[inline(always)]
fn last<const ORDERED: bool>(node: &Node, ray: &PreparedRay, mask: u32) -> Link {
    let last = 31u32.wrapping_sub(mask.leading_zeros()) as usize;
    let lane = if ORDERED { (node.orders[usize::from(ray.octant) & 7] >> ((3 * last) & 31)) as usize } else { last };
    node.children[lane & (WIDTH - 1)]
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
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
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
