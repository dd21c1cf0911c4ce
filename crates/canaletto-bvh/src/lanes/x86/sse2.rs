//! Two lanes in a register of SSE2. The two `f32` are in the lower half of theirs.

use super::super::{Bits64, Mask, Real, Real32, Real64};
use super::{by_intrinsics, operators};
use std::arch::x86_64::*;
use std::ops::Not;

/// Two `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F64x2(__m128d);

/// Two `f32`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x2(__m128);

/// Two times 64 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bits64x2(__m128i);

/// All bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mask2(__m128d);

operators!(F64x2 of f64: Add add _mm_add_pd, Sub sub _mm_sub_pd, Mul mul _mm_mul_pd, Div div _mm_div_pd);
operators!(F32x2 of f32: Add add _mm_add_ps, Sub sub _mm_sub_ps, Mul mul _mm_mul_ps, Div div _mm_div_ps);
operators!(Bits64x2: BitAnd bitand _mm_and_si128, BitOr bitor _mm_or_si128, BitXor bitxor _mm_xor_si128);
operators!(Mask2: BitAnd bitand _mm_and_pd, BitOr bitor _mm_or_pd);

impl Not for Mask2 {
    type Output = Self;
    by_intrinsics! {
        fn not(self) -> Self { Mask2(_mm_xor_pd(self.0, _mm_castsi128_pd(_mm_set1_epi64x(-1)))) }
    }
}

impl Mask for Mask2 {
    const COUNT: u32 = 2;

    by_intrinsics! {
        fn splat(value: bool) -> Self { Mask2(_mm_castsi128_pd(_mm_set1_epi64x(-i64::from(value)))) }
        fn from_bits(bits: u32) -> Self {
            let lane = |lane: u32| -i64::from(bits >> lane & 1);
            Mask2(_mm_castsi128_pd(_mm_set_epi64x(lane(1), lane(0))))
        }
        fn bits(self) -> u32 { _mm_movemask_pd(self.0) as u32 }
    }
}

impl F64x2 {
    by_intrinsics! {
        fn negated(self) -> Self { F64x2(_mm_xor_pd(self.0, _mm_set1_pd(-0.0))) }
    }
}

impl Real for F64x2 {
    type Scalar = f64;
    type Mask = Mask2;
    const COUNT: usize = 2;

    by_intrinsics! {
        fn splat(value: f64) -> Self { F64x2(_mm_set1_pd(value)) }
        fn load(from: &[f64]) -> Self { F64x2(_mm_loadu_pd(from[..2].as_ptr())) }
        fn store(self, to: &mut [f64]) -> () { _mm_storeu_pd(to[..2].as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { F64x2(_mm_sqrt_pd(self.0)) }
        fn abs(self) -> Self { F64x2(_mm_andnot_pd(_mm_set1_pd(-0.0), self.0)) }
        fn less(self, other: Self) -> Mask2 { Mask2(_mm_cmplt_pd(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask2 { Mask2(_mm_cmple_pd(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask2 { Mask2(_mm_cmpeq_pd(self.0, other.0)) }
        fn select(mask: Mask2, yes: Self, no: Self) -> Self {
            F64x2(_mm_or_pd(_mm_and_pd(mask.0, yes.0), _mm_andnot_pd(mask.0, no.0)))
        }
    }
}

impl Real64 for F64x2 {
    type Narrow = F32x2;
    type Bits = Bits64x2;

    by_intrinsics! {
        fn narrow(self) -> F32x2 { F32x2(_mm_cvtpd_ps(self.0)) }
        fn to_bits(self) -> Bits64x2 { Bits64x2(_mm_castpd_si128(self.0)) }
        fn from_bits(bits: Bits64x2) -> Self { F64x2(_mm_castsi128_pd(bits.0)) }
    }
}

/// A mask of two `f32`, with that of each in both halves of a lane.
#[inline(always)]
fn wide_mask(mask: __m128) -> Mask2 {
    // SAFETY: all machines of x86-64 have SSE2.
    unsafe { Mask2(_mm_castps_pd(_mm_unpacklo_ps(mask, mask))) }
}

impl F32x2 {
    by_intrinsics! {
        fn negated(self) -> Self { F32x2(_mm_xor_ps(self.0, _mm_set1_ps(-0.0))) }
    }
}

impl Real for F32x2 {
    type Scalar = f32;
    type Mask = Mask2;
    const COUNT: usize = 2;

    by_intrinsics! {
        fn splat(value: f32) -> Self { F32x2(_mm_set1_ps(value)) }
        fn load(from: &[f32]) -> Self { F32x2(_mm_castpd_ps(_mm_load_sd(from[..2].as_ptr().cast()))) }
        fn store(self, to: &mut [f32]) -> () { _mm_store_sd(to[..2].as_mut_ptr().cast(), _mm_castps_pd(self.0)) }
        fn sqrt(self) -> Self { F32x2(_mm_sqrt_ps(self.0)) }
        fn abs(self) -> Self { F32x2(_mm_andnot_ps(_mm_set1_ps(-0.0), self.0)) }
        fn less(self, other: Self) -> Mask2 { wide_mask(_mm_cmplt_ps(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask2 { wide_mask(_mm_cmple_ps(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask2 { wide_mask(_mm_cmpeq_ps(self.0, other.0)) }
        fn select(mask: Mask2, yes: Self, no: Self) -> Self {
            let mask = _mm_castpd_ps(mask.0);
            let mask = _mm_shuffle_ps::<0b10_00_10_00>(mask, mask);
            F32x2(_mm_or_ps(_mm_and_ps(mask, yes.0), _mm_andnot_ps(mask, no.0)))
        }
    }
}

impl Real32 for F32x2 {
    type Wide = F64x2;

    by_intrinsics! {
        fn widen(self) -> F64x2 { F64x2(_mm_cvtps_pd(self.0)) }
    }
}

impl Bits64 for Bits64x2 {
    by_intrinsics! {
        fn splat(bits: u64) -> Self { Bits64x2(_mm_set1_epi64x(bits as i64)) }
        fn up<const N: u32>(self) -> Self { Bits64x2(_mm_sll_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
        fn down<const N: u32>(self) -> Self { Bits64x2(_mm_srl_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
    }
}
