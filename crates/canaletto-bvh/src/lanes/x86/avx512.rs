//! Eight lanes in a register of AVX-512.

use super::super::{Bits64, Mask, Real, Real32, Real64};
use super::{by_intrinsics, operators};
use std::arch::x86_64::*;
use std::ops::{BitAnd, BitOr, Not};

/// Eight `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F64x8(__m512d);

/// Eight `f32`.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x8(__m256);

/// Eight times 64 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bits64x8(__m512i);

/// A bit for each lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mask8(__mmask8);

operators!(F64x8 of f64: Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);
operators!(F32x8 of f32: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
operators!(Bits64x8: BitAnd bitand _mm512_and_si512, BitOr bitor _mm512_or_si512, BitXor bitxor _mm512_xor_si512);

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask8(self.0 & other.0)
    }
}

impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask8(self.0 | other.0)
    }
}

impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Mask8(!self.0)
    }
}

impl Mask for Mask8 {
    const COUNT: u32 = 8;

    #[inline(always)]
    fn splat(value: bool) -> Self {
        Mask8(if value { 0xff } else { 0 })
    }

    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Mask8(bits as u8)
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl F64x8 {
    by_intrinsics! {
        fn negated(self) -> Self { F64x8(_mm512_xor_pd(self.0, _mm512_set1_pd(-0.0))) }
    }
}

impl Real for F64x8 {
    type Scalar = f64;
    type Mask = Mask8;
    const COUNT: usize = 8;

    by_intrinsics! {
        fn splat(value: f64) -> Self { F64x8(_mm512_set1_pd(value)) }
        fn load(from: &[f64]) -> Self { F64x8(_mm512_loadu_pd(from[..8].as_ptr())) }
        fn store(self, to: &mut [f64]) -> () { _mm512_storeu_pd(to[..8].as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { F64x8(_mm512_sqrt_pd(self.0)) }
        fn abs(self) -> Self { F64x8(_mm512_abs_pd(self.0)) }
        fn less(self, other: Self) -> Mask8 { Mask8(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask8 { Mask8(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask8 { Mask8(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(self.0, other.0)) }
        fn select(mask: Mask8, yes: Self, no: Self) -> Self { F64x8(_mm512_mask_blend_pd(mask.0, no.0, yes.0)) }
    }
}

impl Real64 for F64x8 {
    type Narrow = F32x8;
    type Bits = Bits64x8;

    by_intrinsics! {
        fn narrow(self) -> F32x8 { F32x8(_mm512_cvtpd_ps(self.0)) }
        fn to_bits(self) -> Bits64x8 { Bits64x8(_mm512_castpd_si512(self.0)) }
        fn from_bits(bits: Bits64x8) -> Self { F64x8(_mm512_castsi512_pd(bits.0)) }
    }
}

impl F32x8 {
    by_intrinsics! {
        fn negated(self) -> Self { F32x8(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))) }
    }
}

impl Real for F32x8 {
    type Scalar = f32;
    type Mask = Mask8;
    const COUNT: usize = 8;

    by_intrinsics! {
        fn splat(value: f32) -> Self { F32x8(_mm256_set1_ps(value)) }
        fn load(from: &[f32]) -> Self { F32x8(_mm256_loadu_ps(from[..8].as_ptr())) }
        fn store(self, to: &mut [f32]) -> () { _mm256_storeu_ps(to[..8].as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { F32x8(_mm256_sqrt_ps(self.0)) }
        fn abs(self) -> Self { F32x8(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
        fn less(self, other: Self) -> Mask8 { Mask8(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)) }
        fn at_most(self, other: Self) -> Mask8 { Mask8(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)) }
        fn equal(self, other: Self) -> Mask8 { Mask8(_mm256_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0)) }
        fn select(mask: Mask8, yes: Self, no: Self) -> Self { F32x8(_mm256_mask_blend_ps(mask.0, no.0, yes.0)) }
    }
}

impl Real32 for F32x8 {
    type Wide = F64x8;

    by_intrinsics! {
        fn widen(self) -> F64x8 { F64x8(_mm512_cvtps_pd(self.0)) }
    }
}

impl Bits64 for Bits64x8 {
    by_intrinsics! {
        fn splat(bits: u64) -> Self { Bits64x8(_mm512_set1_epi64(bits as i64)) }
        fn up<const N: u32>(self) -> Self { Bits64x8(_mm512_sll_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
        fn down<const N: u32>(self) -> Self { Bits64x8(_mm512_srl_epi64(self.0, _mm_cvtsi32_si128(N as i32))) }
    }
}
