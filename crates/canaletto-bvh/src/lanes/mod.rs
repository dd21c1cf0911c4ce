//! A ray against the eight boxes of a node, by the instructions that the machine has.
//!
//! All give the same answer: what the ray meets, roughly from far to near, and where it enters. Only + − × and comparisons
//! are used, never fused.

#![allow(unsafe_code)] // Intrinsics, and stacks written without bounds checks.

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

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod four;
mod portable;
mod vector;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
pub(crate) use four::Four;
pub(crate) use portable::{Careful, Portable};
pub(crate) use vector::{Baseline, Instructions, Mask, Row, SIXTEEN, Vector};
#[cfg(target_arch = "x86_64")]
pub(crate) use vector::{WithAvx2, WithAvx512};

use crate::node::{Link, Node};
use crate::{Aabb, PreparedRay, WideRay};
use std::sync::atomic::{AtomicU8, Ordering};

/// What goes through a tree: a ray with or without a margin.
pub(crate) trait Passing {
    /// The ray itself.
    fn ray(&self) -> &PreparedRay;
    /// The origins from which the planes that it enters by, and those that it leaves by, are seen.
    fn origins(&self) -> [&[f32; 3]; 2];
    /// A box with its margin.
    fn grown(&self, bounds: Aabb) -> Aabb;
}

impl Passing for PreparedRay {
    #[inline(always)]
    fn ray(&self) -> &PreparedRay {
        self
    }

    #[inline(always)]
    fn origins(&self) -> [&[f32; 3]; 2] {
        [self.ray.origin.as_ref(); 2]
    }

    #[inline(always)]
    fn grown(&self, bounds: Aabb) -> Aabb {
        bounds
    }
}

impl Passing for WideRay {
    #[inline(always)]
    fn ray(&self) -> &PreparedRay {
        &self.ray
    }

    #[inline(always)]
    fn origins(&self) -> [&[f32; 3]; 2] {
        self.origins.each_ref()
    }

    #[inline(always)]
    fn grown(&self, bounds: Aabb) -> Aabb {
        WideRay::grown(self, &bounds)
    }
}

/// What the exact kernel for four triangles is made of.
pub(crate) trait Exact {
    /// The same instructions for f64.
    type Four: Four;
}

impl Exact for Portable {
    type Four = four::Loops;
}

impl Exact for Careful {
    type Four = four::Loops;
}

#[cfg(target_arch = "x86_64")]
impl Exact for Avx2 {
    type Four = four::InAvx;
}

#[cfg(target_arch = "x86_64")]
impl Exact for Avx512 {
    type Four = four::InAvx;
}

/// A way to test a ray against a node.
pub(crate) trait Lanes<R = PreparedRay>: Copy + Exact {
    /// Writes the children that the ray, a `regular` one but for [`Careful`], meets before `limit`: if `ORDERED`, the nearest in
    /// general last, and where it enters them; else the most promising for any hit last. Returns how
    /// many they are, and the last link again, if there is one: to read it where it was just written would have to wait until a part of a wide store
    /// can be read.
    ///
    /// Whatever numbers the ray holds, no more than eight links are written, and only those of the node; a lane without a child is
    /// never met, as NaN is not.
    ///
    /// # Safety
    /// The machine must have the instructions, and there must be room for eight entries.
    unsafe fn visit<const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        near: *mut f32,
        links: *mut Link,
    ) -> (usize, Link);
}

/// Sets of instructions that kernels exist for, each with all before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum InstructionSet {
    /// What every machine has: SSE2 on x86-64, NEON on ARM.
    Baseline = 1,
    /// AVX2 and FMA.
    Avx2 = 2,
    /// AVX-512 F, VL, BW and DQ.
    Avx512 = 3,
}

static CHOSEN: AtomicU8 = AtomicU8::new(0);

impl InstructionSet {
    /// All that kernels exist for, on whatever machine.
    pub const ALL: [InstructionSet; 3] = [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];

    /// The sets that this machine has.
    pub fn available() -> &'static [InstructionSet] {
        &Self::ALL[..InstructionSet::best() as usize]
    }

    /// "baseline", "avx2" or "avx512".
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }

    fn best() -> InstructionSet {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
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
