//! Sixteen numbers side by side, by the instructions that the machine has. All give the same numbers.
//!
//! Values are made by [`Instructions`], which is unsafe to get hold of; what is done with them is safe therefore.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use crate::slab::WIDTH;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

/// How many.
pub(crate) const SIXTEEN: usize = 16;

/// In memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; SIXTEEN]);

/// Makes values: who has it knows that the machine has the instructions.
pub(crate) trait Instructions: Copy {
    /// What is made.
    type Sixteen: Sixteen;

    /// The same number in all lanes.
    fn splat(self, value: f32) -> Self::Sixteen;

    fn load(self, row: &Row<f32>) -> Self::Sixteen;

    /// Eight numbers, and again.
    fn twice(self, row: &[f32; WIDTH]) -> Self::Sixteen;

    /// A bit for each lane.
    fn mask(self, bits: u32) -> Mask<Self>;
}

/// What comparisons give.
pub(crate) type Mask<S> = <<S as Instructions>::Sixteen as Sixteen>::Mask;

/// Sixteen numbers. Comparisons with NaN are false.
pub(crate) trait Sixteen:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// What comparisons give, a yes or no for each.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    fn store(self, row: &mut Row<f32>);

    /// Leaves those lanes alone that are not in the mask.
    fn store_where(self, mask: Self::Mask, row: &mut Row<f32>);

    /// The same with one number.
    fn put_where(mask: Self::Mask, value: u32, row: &mut Row<u32>);

    /// `a < b ? a : b`.
    fn min(self, other: Self) -> Self;

    /// `a > b ? a : b`.
    fn max(self, other: Self) -> Self;

    fn abs(self) -> Self;

    fn sqrt(self) -> Self;

    fn less(self, other: Self) -> Self::Mask;

    fn less_or_equal(self, other: Self) -> Self::Mask;

    /// `a` where the mask says so, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// A bit for each lane.
    fn bits(mask: Self::Mask) -> u32;

    /// The largest of all lanes.
    #[inline(always)]
    fn largest(self) -> f32 {
        let mut row = Row([0.0; SIXTEEN]);
        self.store(&mut row);
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let (mut a, mut b, mut c) = ([0.0f32; 8], [0.0f32; 4], [0.0f32; 2]);
        for i in 0..8 {
            a[i] = larger(row.0[i], row.0[i + 8]);
        }
        for i in 0..4 {
            b[i] = larger(a[i], a[i + 4]);
        }
        for i in 0..2 {
            c[i] = larger(b[i], b[i + 2]);
        }
        larger(c[0], c[1])
    }
}

/// What the compiler makes of loops.
#[derive(Clone, Copy)]
pub(crate) struct Loops([f32; SIXTEEN]);

/// All bits of a lane, or none.
#[derive(Clone, Copy)]
pub(crate) struct LoopMask([u32; SIXTEEN]);

#[inline(always)]
fn each<A: Copy, B: Copy, C: Copy + Default>(a: [A; SIXTEEN], b: [B; SIXTEEN], f: impl Fn(A, B) -> C) -> [C; SIXTEEN] {
    let mut c = [C::default(); SIXTEEN];
    for i in 0..SIXTEEN {
        c[i] = f(a[i], b[i]);
    }
    c
}

operators!(Loops {
    Add add(a, b) each(a, b, |a, b| a + b);
    Sub sub(a, b) each(a, b, |a, b| a - b);
    Mul mul(a, b) each(a, b, |a, b| a * b);
    Div div(a, b) each(a, b, |a, b| a / b);
});

operators!(LoopMask {
    BitAnd bitand(a, b) each(a, b, |a, b| a & b);
    BitOr bitor(a, b) each(a, b, |a, b| a | b);
});

impl Not for LoopMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(each(self.0, self.0, |a, _| !a))
    }
}

/// What every machine has.
#[derive(Clone, Copy)]
pub(crate) struct Baseline;

impl Instructions for Baseline {
    type Sixteen = Loops;

    #[inline(always)]
    fn splat(self, value: f32) -> Loops {
        Loops([value; SIXTEEN])
    }

    #[inline(always)]
    fn load(self, row: &Row<f32>) -> Loops {
        Loops(row.0)
    }

    #[inline(always)]
    fn twice(self, row: &[f32; WIDTH]) -> Loops {
        let mut both = [0.0; SIXTEEN];
        both[..WIDTH].copy_from_slice(row);
        both[WIDTH..].copy_from_slice(row);
        Loops(both)
    }

    #[inline(always)]
    fn mask(self, bits: u32) -> LoopMask {
        let mut mask = [0; SIXTEEN];
        for (i, mask) in mask.iter_mut().enumerate() {
            *mask = (bits >> i & 1).wrapping_neg();
        }
        LoopMask(mask)
    }
}

impl Sixteen for Loops {
    type Mask = LoopMask;

    #[inline(always)]
    fn store(self, row: &mut Row<f32>) {
        row.0 = self.0;
    }

    #[inline(always)]
    fn store_where(self, mask: LoopMask, row: &mut Row<f32>) {
        row.0 = Self::select(mask, self, Self(row.0)).0;
    }

    #[inline(always)]
    fn put_where(mask: LoopMask, value: u32, row: &mut Row<u32>) {
        row.0 = each(mask.0, row.0, |m, old| if m != 0 { value } else { old });
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(each(self.0, other.0, |a, b| if a < b { a } else { b }))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(each(self.0, other.0, |a, b| if a > b { a } else { b }))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(each(self.0, self.0, |a, _| a.abs()))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each(self.0, self.0, |a, _| a.sqrt()))
    }

    #[inline(always)]
    fn less(self, other: Self) -> LoopMask {
        LoopMask(each(self.0, other.0, |a, b| if a < b { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> LoopMask {
        LoopMask(each(self.0, other.0, |a, b| if a <= b { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn select(mask: LoopMask, a: Self, b: Self) -> Self {
        let mut chosen = b.0;
        for i in 0..SIXTEEN {
            chosen[i] = if mask.0[i] != 0 { a.0[i] } else { b.0[i] };
        }
        Self(chosen)
    }

    #[inline(always)]
    fn bits(mask: LoopMask) -> u32 {
        mask.0.iter().enumerate().fold(0, |bits, (i, m)| bits | (m & 1) << i)
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{WithAvx2, WithAvx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use std::arch::x86_64::*;

    /// One register of AVX-512.
    #[derive(Clone, Copy)]
    pub(crate) struct Zmm(__m512);

    operators!(Zmm {
        Add add(a, b) _mm512_add_ps(a, b);
        Sub sub(a, b) _mm512_sub_ps(a, b);
        Mul mul(a, b) _mm512_mul_ps(a, b);
        Div div(a, b) _mm512_div_ps(a, b);
    });

    /// AVX-512.
    #[derive(Clone, Copy)]
    pub(crate) struct WithAvx512(());

    impl WithAvx512 {
        /// # Safety
        /// The machine must have AVX-512, with all of `InstructionSet::Avx512`.
        #[inline(always)]
        pub(crate) unsafe fn new() -> Self {
            Self(())
        }
    }

    // SAFETY, for all in this file: who has made one of these, or a value by it, has promised that the machine has the instructions.
    impl Instructions for WithAvx512 {
        type Sixteen = Zmm;

        #[inline(always)]
        fn splat(self, value: f32) -> Zmm {
            unsafe { Zmm(_mm512_set1_ps(value)) }
        }

        #[inline(always)]
        fn load(self, row: &Row<f32>) -> Zmm {
            unsafe { Zmm(_mm512_load_ps(row.0.as_ptr())) }
        }

        #[inline(always)]
        fn twice(self, row: &[f32; WIDTH]) -> Zmm {
            unsafe { Zmm(_mm512_broadcast_f32x8(_mm256_loadu_ps(row.as_ptr()))) }
        }

        #[inline(always)]
        fn mask(self, bits: u32) -> __mmask16 {
            bits as u16
        }
    }

    impl Sixteen for Zmm {
        type Mask = __mmask16;

        #[inline(always)]
        fn store(self, row: &mut Row<f32>) {
            unsafe { _mm512_store_ps(row.0.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn store_where(self, mask: __mmask16, row: &mut Row<f32>) {
            unsafe { _mm512_mask_store_ps(row.0.as_mut_ptr(), mask, self.0) }
        }

        #[inline(always)]
        fn put_where(mask: __mmask16, value: u32, row: &mut Row<u32>) {
            unsafe { _mm512_mask_store_epi32(row.0.as_mut_ptr().cast(), mask, _mm512_set1_epi32(value as i32)) }
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
        fn bits(mask: __mmask16) -> u32 {
            u32::from(mask)
        }

        #[inline(always)]
        fn largest(self) -> f32 {
            unsafe { _mm512_reduce_max_ps(self.0) }
        }
    }

    /// Two registers of AVX2.
    #[derive(Clone, Copy)]
    pub(crate) struct Ymm([__m256; 2]);

    /// All bits of a lane, or none.
    #[derive(Clone, Copy)]
    pub(crate) struct YmmMask([__m256; 2]);

    #[inline(always)]
    fn both(a: [__m256; 2], b: [__m256; 2], f: impl Fn(__m256, __m256) -> __m256) -> [__m256; 2] {
        [f(a[0], b[0]), f(a[1], b[1])]
    }

    operators!(Ymm {
        Add add(a, b) both(a, b, |a, b| _mm256_add_ps(a, b));
        Sub sub(a, b) both(a, b, |a, b| _mm256_sub_ps(a, b));
        Mul mul(a, b) both(a, b, |a, b| _mm256_mul_ps(a, b));
        Div div(a, b) both(a, b, |a, b| _mm256_div_ps(a, b));
    });

    operators!(YmmMask {
        BitAnd bitand(a, b) both(a, b, |a, b| _mm256_and_ps(a, b));
        BitOr bitor(a, b) both(a, b, |a, b| _mm256_or_ps(a, b));
    });

    impl Not for YmmMask {
        type Output = Self;
        #[inline(always)]
        fn not(self) -> Self {
            Self(both(self.0, self.0, |a, _| unsafe { _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1))) }))
        }
    }

    /// AVX2.
    #[derive(Clone, Copy)]
    pub(crate) struct WithAvx2(());

    impl WithAvx2 {
        /// # Safety
        /// The machine must have AVX2.
        #[inline(always)]
        pub(crate) unsafe fn new() -> Self {
            Self(())
        }
    }

    // SAFETY, for all in this file: who has made one of these, or a value by it, has promised that the machine has the instructions.
    impl Instructions for WithAvx2 {
        type Sixteen = Ymm;

        #[inline(always)]
        fn splat(self, value: f32) -> Ymm {
            unsafe { Ymm([_mm256_set1_ps(value); 2]) }
        }

        #[inline(always)]
        fn load(self, row: &Row<f32>) -> Ymm {
            unsafe { Ymm([_mm256_load_ps(row.0.as_ptr()), _mm256_load_ps(row.0.as_ptr().add(8))]) }
        }

        #[inline(always)]
        fn twice(self, row: &[f32; WIDTH]) -> Ymm {
            unsafe { Ymm([_mm256_loadu_ps(row.as_ptr()); 2]) }
        }

        #[inline(always)]
        fn mask(self, bits: u32) -> YmmMask {
            unsafe {
                let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let half = |bits: u32| {
                    let bits = _mm256_set1_epi32(bits as i32);
                    _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(bits, lane), lane))
                };
                YmmMask([half(bits), half(bits >> 8)])
            }
        }
    }

    impl Sixteen for Ymm {
        type Mask = YmmMask;

        #[inline(always)]
        fn store(self, row: &mut Row<f32>) {
            unsafe {
                _mm256_store_ps(row.0.as_mut_ptr(), self.0[0]);
                _mm256_store_ps(row.0.as_mut_ptr().add(8), self.0[1]);
            }
        }

        #[inline(always)]
        fn store_where(self, mask: YmmMask, row: &mut Row<f32>) {
            let old = WithAvx2(()).load(row);
            Self::select(mask, self, old).store(row);
        }

        #[inline(always)]
        fn put_where(mask: YmmMask, value: u32, row: &mut Row<u32>) {
            unsafe {
                for half in 0..2 {
                    let place = row.0.as_mut_ptr().add(8 * half).cast::<f32>();
                    let value = _mm256_castsi256_ps(_mm256_set1_epi32(value as i32));
                    _mm256_store_ps(place, _mm256_blendv_ps(_mm256_load_ps(place), value, mask.0[half]));
                }
            }
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(both(self.0, other.0, |a, b| unsafe { _mm256_min_ps(a, b) }))
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(both(self.0, other.0, |a, b| unsafe { _mm256_max_ps(a, b) }))
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(both(self.0, self.0, |a, _| unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }))
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            Self(both(self.0, self.0, |a, _| unsafe { _mm256_sqrt_ps(a) }))
        }

        #[inline(always)]
        fn less(self, other: Self) -> YmmMask {
            YmmMask(both(self.0, other.0, |a, b| unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(a, b) }))
        }

        #[inline(always)]
        fn less_or_equal(self, other: Self) -> YmmMask {
            YmmMask(both(self.0, other.0, |a, b| unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(a, b) }))
        }

        #[inline(always)]
        fn select(mask: YmmMask, a: Self, b: Self) -> Self {
            unsafe { Self([_mm256_blendv_ps(b.0[0], a.0[0], mask.0[0]), _mm256_blendv_ps(b.0[1], a.0[1], mask.0[1])]) }
        }

        #[inline(always)]
        fn bits(mask: YmmMask) -> u32 {
            unsafe { _mm256_movemask_ps(mask.0[0]) as u32 | (_mm256_movemask_ps(mask.0[1]) as u32) << 8 }
        }
    }
}
