//! The instruction sets that kernels are compiled for, and kernels of plain loops.
#![allow(unsafe_code)] // Functions for instructions that only some machines have.

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

/// A kernel of plain loops, which the compiler vectorises for each instruction set. All sets give equal bits, since + −
/// × ÷ and sqrt are never fused.
pub trait Kernel {
    /// The result.
    type Answer;
    /// Runs the kernel. It has to be `#[inline(always)]`, as must all functions that it calls. Otherwise it is compiled
    /// for the baseline.
    fn run(self) -> Self::Answer;
}

impl InstructionSet {
    /// Runs a kernel with the instructions in use.
    #[inline]
    pub fn run<K: Kernel>(kernel: K) -> K::Answer {
        #[cfg(target_arch = "x86_64")]
        match InstructionSet::current() {
            // SAFETY: `current` never returns more than the machine has.
            InstructionSet::Avx512 => return unsafe { avx512(kernel) },
            // SAFETY: as above.
            InstructionSet::Avx2 => return unsafe { avx2(kernel) },
            InstructionSet::Baseline => {}
        }
        kernel.run()
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn avx2<K: Kernel>(kernel: K) -> K::Answer {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512<K: Kernel>(kernel: K) -> K::Answer {
    kernel.run()
}

/// Defines a function that is also compiled for AVX2. That version runs where the machine has AVX2.
macro_rules! compiled_wide {
    ($(#[$about:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),*) -> $result:ty $body:block) => {
        $(#[$about])*
        $vis fn $name($($arg: $type),*) -> $result {
            #[inline(always)]
            fn code($($arg: $type),*) -> $result $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,bmi1,bmi2")]
                fn wide($($arg: $type),*) -> $result {
                    code($($arg),*)
                }
                if crate::InstructionSet::current() >= crate::InstructionSet::Avx2 {
                    #[allow(unsafe_code)]
                    // SAFETY: `current` never returns more than the machine has.
                    return unsafe { wide($($arg),*) };
                }
            }
            code($($arg),*)
        }
    };
}
pub(crate) use compiled_wide;
