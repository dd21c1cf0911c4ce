//! Four lanes in a register of AVX2.

use super::super::{Bits64, Mask, Real, Real32, Real64};
use super::{by_intrinsics, operators};
use std::arch::x86_64::*;
use std::ops::Not;

/// Four `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F64x4(__m256d);

/// Four `f32`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x4(__m128);

/// Four times 64 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bits64x4(__m256i);

/// All bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mask4(__m256d);

operators!(F64x4 of f64: Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);
operators!(F32x4 of f32: Add add _mm_add_ps, Sub sub _mm_sub_ps, Mul mul _mm_mul_ps, Div div _mm_div_ps);
operators!(Bits64x4: BitAnd bitand _mm256_and_si256, BitOr bitor _mm256_or_si256, BitXor bitxor _mm256_xor_si256);
operators!(Mask4: BitAnd bitand _mm256_and_pd, BitOr bitor _mm256_or_pd);

impl Not for Mask4 {
    type Output = Self;
    by_intrinsics! {
        fn not(self) -> Self { Mask4(_mm256_xor_pd(self.0, _mm256_castsi256_pd(_mm256_set1_epi64x(-1)))) }
    }
}

impl Mask for Mask4 {
    const COUNT: u32 = 4;

    by_intrinsics! {
        fn splat(value: bool) -> Self { Mask4(_mm256_castsi256_pd(_mm256_set1_epi64x(-i64::from(value)))) }
        fn from_bits(bits: u32) -> Self {
            let of_lane = _mm256_set_epi64x(8, 4, 2, 1);
            let set = _mm256_and_si256(_mm256_set1_epi64x(i64::from(bits)), of_lane);
            Mask4(_mm256_castsi256_pd(_mm256_cmpeq_epi64(set, of_lane)))
        }
        fn bits(self) -> u32 { _mm256_movemask_pd(self.0) as u32 }
    }
}

impl F64x4 {
    by_intrinsics! {
        fn negated(self) -> Self { F64x4(_mm256_xor_pd(self.0, _mm256_set1_pd(-0.0))) }
    }
}

impl Real for F64x4 {
    type Scalar = f64;
    type Mask = Mask4;
    const COUNT: usize = 4;

    by_intrinsics! {
        fn splat(value: f64) -> Self { F64x4(_mm256_set1_pd(value)) }
        fn load(from: &[f64]) -> Self { F64x4(_mm256_loadu_pd(from[..4].as_ptr())) }
        fn store(self, to: &mut [f64]) -> () { _mm256_storeu_pd(to[..4].as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { F64x4(_mm256_sqrt_pd(self.0)) }
        fn abs(self) -> Self { F64x4(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
        fn less(self, other: Self) -> Mask4 { Mask4(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask4 { Mask4(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask4 { Mask4(_mm256_cmp_pd::<_CMP_EQ_OQ>(self.0, other.0)) }
        fn select(mask: Mask4, yes: Self, no: Self) -> Self { F64x4(_mm256_blendv_pd(no.0, yes.0, mask.0)) }
    }
}

impl Real64 for F64x4 {
    type Narrow = F32x4;
    type Bits = Bits64x4;

    by_intrinsics! {
        fn narrow(self) -> F32x4 { F32x4(_mm256_cvtpd_ps(self.0)) }
        fn to_bits(self) -> Bits64x4 { Bits64x4(_mm256_castpd_si256(self.0)) }
        fn from_bits(bits: Bits64x4) -> Self { F64x4(_mm256_castsi256_pd(bits.0)) }
    }
}

/// A mask of four `f32`, with that of each in both halves of a lane.
#[inline(always)]
fn wide_mask(mask: __m128) -> Mask4 {
    // SAFETY: functions for these types are made only for machines that have the instructions.
    unsafe { Mask4(_mm256_castsi256_pd(_mm256_cvtepi32_epi64(_mm_castps_si128(mask)))) }
}

impl F32x4 {
    by_intrinsics! {
        fn negated(self) -> Self { F32x4(_mm_xor_ps(self.0, _mm_set1_ps(-0.0))) }
    }
}

impl Real for F32x4 {
    type Scalar = f32;
    type Mask = Mask4;
    const COUNT: usize = 4;

    by_intrinsics! {
        fn splat(value: f32) -> Self { F32x4(_mm_set1_ps(value)) }
        fn load(from: &[f32]) -> Self { F32x4(_mm_loadu_ps(from[..4].as_ptr())) }
        fn store(self, to: &mut [f32]) -> () { _mm_storeu_ps(to[..4].as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { F32x4(_mm_sqrt_ps(self.0)) }
        fn abs(self) -> Self { F32x4(_mm_andnot_ps(_mm_set1_ps(-0.0), self.0)) }
        fn less(self, other: Self) -> Mask4 { wide_mask(_mm_cmplt_ps(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask4 { wide_mask(_mm_cmple_ps(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask4 { wide_mask(_mm_cmpeq_ps(self.0, other.0)) }
        fn select(mask: Mask4, yes: Self, no: Self) -> Self {
            let mask = _mm256_castpd_ps(mask.0);
            let [low, high] = [_mm256_castps256_ps128(mask), _mm256_extractf128_ps::<1>(mask)];
            F32x4(_mm_blendv_ps(no.0, yes.0, _mm_shuffle_ps::<0b10_00_10_00>(low, high)))
        }
    }
}

impl Real32 for F32x4 {
    type Wide = F64x4;

    by_intrinsics! {
        fn widen(self) -> F64x4 { F64x4(_mm256_cvtps_pd(self.0)) }
    }
}

impl Bits64 for Bits64x4 {
    by_intrinsics! {
        fn splat(bits: u64) -> Self { Bits64x4(_mm256_set1_epi64x(bits as i64)) }
        fn up<const N: u32>(self) -> Self { Bits64x4(_mm256_sll_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
        fn down<const N: u32>(self) -> Self { Bits64x4(_mm256_srl_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
    }
}
