//! Vectors of sixteen numbers: registers of AVX-512.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use glam::Vec4;

use super::{Instructions, Row, Vector};
use crate::simd::node_test::avx2::lanes_of;
use crate::slab::WIDTH;

/// A register of AVX-512.
#[derive(Clone, Copy)]
pub(crate) struct Zmm(__m512);

operators!(Zmm {
    Add add(a, b) _mm512_add_ps(a, b);
    Sub sub(a, b) _mm512_sub_ps(a, b);
    Mul mul(a, b) _mm512_mul_ps(a, b);
    Div div(a, b) _mm512_div_ps(a, b);
});

/// The instruction set AVX-512.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

impl Avx512 {
    /// The value that stands for AVX-512.
    ///
    /// # Safety
    /// The machine must have AVX-512, with all of `InstructionSet::Avx512`.
    #[inline(always)]
    pub(crate) unsafe fn new() -> Self {
        Self(())
    }
}

// SAFETY, for all in this file: whenever a value of these types exists, its constructor's caller has ensured that the
// machine has the instructions.
impl Instructions for Avx512 {
    type Vector = Zmm;

    #[inline(always)]
    fn splat(self, value: f32) -> Zmm {
        unsafe { Zmm(_mm512_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(self, row: &Row<f32>, _part: usize) -> Zmm {
        unsafe { Zmm(_mm512_load_ps(row.0.as_ptr())) }
    }

    #[inline(always)]
    fn load_fours(self, [a, b, c, d]: &[Vec4; 4], _part: usize) -> Zmm {
        unsafe {
            let (low, high) = (_mm256_set_m128((*b).into(), (*a).into()), _mm256_set_m128((*d).into(), (*c).into()));
            Zmm(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high))
        }
    }

    #[inline(always)]
    fn eight(self, row: &[f32; WIDTH], _part: usize) -> Zmm {
        unsafe { Zmm(_mm512_broadcast_f32x8(_mm256_loadu_ps(row.as_ptr()))) }
    }

    #[inline(always)]
    fn mask(self, bits: u32, _part: usize) -> __mmask16 {
        bits as u16
    }

    #[inline(always)]
    fn at_most_in_order(self, row: &Row<f32>, other: &Row<f32>, order: u32, to: &mut [f32; WIDTH]) -> u32 {
        unsafe {
            // Four bits of each index are read. The fourth doesn't matter, as the eight numbers are there twice.
            let lanes = _mm512_zextsi256_si512(lanes_of(order));
            let number = _mm512_permutexvar_ps(lanes, _mm512_load_ps(row.0.as_ptr()));
            let other = _mm512_permutexvar_ps(lanes, _mm512_load_ps(other.0.as_ptr()));
            _mm256_storeu_ps(to.as_mut_ptr(), _mm512_castps512_ps256(number));
            u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(number, other)) & 0xff
        }
    }
}

impl Vector for Zmm {
    const LANES: usize = 16;
    const MIN_EXACT_RAYS: u32 = 1;
    type Mask = __mmask16;

    #[inline(always)]
    fn store(self, row: &mut Row<f32>, _part: usize) {
        unsafe { _mm512_store_ps(row.0.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn store_where(self, mask: __mmask16, row: &mut Row<f32>, _part: usize) {
        unsafe {
            let old = row.0.as_ptr().cast::<__m512>().read_volatile(); // See `Vector::store_where`.
            Self::select(mask, self, Self(old)).store(row, 0);
        }
    }

    #[inline(always)]
    fn store_u32_where(mask: __mmask16, value: u32, row: &mut Row<u32>, _part: usize) {
        unsafe {
            let place = row.0.as_mut_ptr().cast::<__m512i>();
            _mm512_store_si512(place, _mm512_mask_set1_epi32(place.read_volatile(), mask, value as i32));
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Self(_mm512_min_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Self(_mm512_max_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn minus_product(self, a: Self, b: Self) -> Self {
        unsafe { Self(_mm512_fnmadd_ps(a.0, b.0, self.0)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Self(_mm512_abs_ps(self.0)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Self(_mm512_sqrt_ps(self.0)) }
    }

    #[inline(always)]
    fn less(self, other: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn select(mask: __mmask16, a: Self, b: Self) -> Self {
        unsafe { Self(_mm512_mask_blend_ps(mask, b.0, a.0)) }
    }

    #[inline(always)]
    fn lanes(mask: __mmask16) -> u32 {
        u32::from(mask)
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}
