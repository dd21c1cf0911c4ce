//! The instruction sets that kernels are compiled for.

use std::sync::atomic::{AtomicU8, Ordering};

/// The instruction sets that kernels are compiled for. Each includes all before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum InstructionSet {
    /// The baseline of every machine: SSE2 on x86-64, NEON on ARM.
    Baseline = 1,
    /// AVX2 and FMA.
    Avx2 = 2,
    /// AVX-512 F, VL, BW and DQ.
    Avx512 = 3,
}

static CHOSEN: AtomicU8 = AtomicU8::new(0);

impl InstructionSet {
    /// All instruction sets that kernels are compiled for, on any machine.
    pub const ALL: [InstructionSet; 3] = [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];

    /// The sets that this machine has.
    pub fn available() -> &'static [InstructionSet] {
        &Self::ALL[..InstructionSet::best() as usize]
    }

    /// The name: "baseline", "avx2" or "avx512".
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

    /// The set in use: the best that the machine has, unless [`InstructionSet::limit`] has set a lower one.
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

    /// Limits all threads to this set from now on, for tests and measurements. No result depends on it.
    pub fn limit(self) {
        CHOSEN.store(self.min(InstructionSet::best()) as u8, Ordering::Relaxed);
    }
}
