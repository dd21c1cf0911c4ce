//! Registers of x86-64: two lanes with SSE2, four with AVX2, eight with AVX-512.

mod avx2;
mod avx512;
mod sse2;

use super::{LaneKernel, Pair};

pub(super) fn sse2<K: LaneKernel>(kernel: K) -> K::Answer {
    kernel.run::<Pair<Pair<sse2::F64x2>>>()
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn avx2<K: LaneKernel>(kernel: K) -> K::Answer {
    kernel.run::<Pair<avx2::F64x4>>()
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
pub(super) fn avx512<K: LaneKernel>(kernel: K) -> K::Answer {
    kernel.run::<avx512::F64x8>()
}

/// Operators of types that wrap a register, by functions of two registers.
macro_rules! operators {
    ($type:ident: $($trait:ident $name:ident $function:ident),*) => {
        $(impl std::ops::$trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                #[allow(unused_unsafe)]
                // SAFETY: functions for this type are made only for machines that have the instructions.
                unsafe { $type($function(self.0, other.0)) }
            }
        })*
    };
    ($type:ident of $scalar:ident: $($trait:ident $name:ident $function:ident),*) => {
        operators!($type: $($trait $name $function),*);
        $(impl std::ops::$trait<$scalar> for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: $scalar) -> Self {
                std::ops::$trait::$name(self, <$type as Real>::splat(other))
            }
        })*

        impl std::ops::Neg for $type {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                self.negated()
            }
        }
    };
}
use operators;

/// Functions whose bodies are calls of intrinsics.
macro_rules! by_intrinsics {
    ($(fn $name:ident $(<const $n:ident: u32>)? ($($arguments:tt)*) -> $answer:ty { $($body:tt)* })*) => {
        $(#[inline(always)]
        fn $name $(<const $n: u32>)? ($($arguments)*) -> $answer {
            #[allow(unused_unsafe)]
            // SAFETY: functions for these types are made only for machines that have the instructions. Slices are cut
            // to the lanes that are read or written.
            unsafe { $($body)* }
        })*
    };
}
use by_intrinsics;
