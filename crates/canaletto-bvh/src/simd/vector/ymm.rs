//! Vectors of eight numbers: registers of AVX2.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use glam::Vec4;

use super::{Instructions, Row, Vector};
use crate::simd::node_test::avx2::lanes_of;
use crate::slab::WIDTH;

/// A register of AVX2.
#[derive(Clone, Copy)]
pub(crate) struct Ymm(__m256);

/// A mask: each lane has all bits set, or none.
#[derive(Clone, Copy)]
pub(crate) struct YmmMask(__m256);

operators!(Ymm {
    Add add(a, b) _mm256_add_ps(a, b);
    Sub sub(a, b) _mm256_sub_ps(a, b);
    Mul mul(a, b) _mm256_mul_ps(a, b);
    Div div(a, b) _mm256_div_ps(a, b);
});

operators!(YmmMask {
    BitAnd bitand(a, b) _mm256_and_ps(a, b);
    BitOr bitor(a, b) _mm256_or_ps(a, b);
});

impl Not for YmmMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        unsafe { Self(_mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))) }
    }
}

/// The instruction set AVX2.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// The value that stands for AVX2.
    ///
    /// # Safety
    /// The machine must have AVX2.
    #[inline(always)]
    pub(crate) unsafe fn new() -> Self {
        Self(())
    }
}

// SAFETY, for all in this file: whenever a value of these types exists, its constructor's caller has ensured that the
// machine has the instructions.
impl Instructions for Avx2 {
    type Vector = Ymm;

    #[inline(always)]
    fn splat(self, value: f32) -> Ymm {
        unsafe { Ymm(_mm256_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(self, row: &Row<f32>, part: usize) -> Ymm {
        unsafe { Ymm(_mm256_load_ps(row.0[8 * part..8 * part + 8].as_ptr())) }
    }

    #[inline(always)]
    fn load_fours(self, row: &[Vec4; 4], part: usize) -> Ymm {
        unsafe { Ymm(_mm256_set_m128(row[2 * part + 1].into(), row[2 * part].into())) }
    }

    #[inline(always)]
    fn eight(self, row: &[f32; WIDTH], _part: usize) -> Ymm {
        unsafe { Ymm(_mm256_loadu_ps(row.as_ptr())) }
    }

    #[inline(always)]
    fn mask(self, bits: u32, part: usize) -> YmmMask {
        unsafe {
            let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let bits = _mm256_set1_epi32((bits >> (8 * part)) as i32);
            YmmMask(_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(bits, lane), lane)))
        }
    }

    #[inline(always)]
    fn at_most_in_order(self, row: &Row<f32>, other: &Row<f32>, order: u32, to: &mut [f32; WIDTH]) -> u32 {
        unsafe {
            let lanes = lanes_of(order);
            let number = _mm256_permutevar8x32_ps(_mm256_load_ps(row.0.as_ptr()), lanes);
            let other = _mm256_permutevar8x32_ps(_mm256_load_ps(other.0.as_ptr()), lanes);
            _mm256_storeu_ps(to.as_mut_ptr(), number);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(number, other)) as u32
        }
    }
}

impl Vector for Ymm {
    const LANES: usize = 8;
    type Mask = YmmMask;

    #[inline(always)]
    fn store(self, row: &mut Row<f32>, part: usize) {
        unsafe { _mm256_store_ps(row.0[8 * part..8 * part + 8].as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn store_where(self, mask: YmmMask, row: &mut Row<f32>, part: usize) {
        unsafe {
            // See `Vector::store_where`.
            let old = row.0[8 * part..8 * part + 8].as_ptr().cast::<__m256>().read_volatile();
            Self::select(mask, self, Self(old)).store(row, part);
        }
    }

    #[inline(always)]
    fn store_u32_where(mask: YmmMask, value: u32, row: &mut Row<u32>, part: usize) {
        unsafe {
            let place = row.0[8 * part..8 * part + 8].as_mut_ptr();
            let value = _mm256_castsi256_ps(_mm256_set1_epi32(value as i32));
            let old = place.cast::<__m256>().read_volatile();
            _mm256_store_ps(place.cast(), _mm256_blendv_ps(old, value, mask.0));
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Self(_mm256_min_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Self(_mm256_max_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn minus_product(self, a: Self, b: Self) -> Self {
        unsafe { Self(_mm256_fnmadd_ps(a.0, b.0, self.0)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Self(_mm256_sqrt_ps(self.0)) }
    }

    #[inline(always)]
    fn less(self, other: Self) -> YmmMask {
        unsafe { YmmMask(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> YmmMask {
        unsafe { YmmMask(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn select(mask: YmmMask, a: Self, b: Self) -> Self {
        unsafe { Self(_mm256_blendv_ps(b.0, a.0, mask.0)) }
    }

    #[inline(always)]
    fn lanes(mask: YmmMask) -> u32 {
        unsafe { _mm256_movemask_ps(mask.0) as u32 }
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe {
            let four = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)))
        }
    }
}
