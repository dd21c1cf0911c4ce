//! As many numbers side by side as a register holds, by the instructions that the machine has. All give the same numbers.
//!
//! Rows of sixteen are gone through in parts, one after the other, so that what is known of a part stays in registers.
//! Values are made by [`Instructions`], which is unsafe to get hold of; what is done with them is safe therefore. No closures
//! are handed around: one that isn't inlined would be a function without the instructions.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use glam::{BVec4A, Vec4};

use crate::slab::WIDTH;

/// How many make a row.
pub(crate) const SIXTEEN: usize = 16;

/// In memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; SIXTEEN]);

/// Makes values: who has it knows that the machine has the instructions.
pub(crate) trait Instructions: Copy {
    /// What is made.
    type Vector: Vector;

    /// The same number in all lanes.
    fn splat(self, value: f32) -> Self::Vector;

    /// A part of a row.
    fn load(self, row: &Row<f32>, part: usize) -> Self::Vector;

    /// A part of eight numbers; those again, where there is room for sixteen.
    fn eight(self, row: &[f32; WIDTH], part: usize) -> Self::Vector;

    /// The bits for the lanes of a part.
    fn mask(self, bits: u32, part: usize) -> Mask<Self>;

    /// Whether each of the first eight numbers of a row is at most its fellow in another row: a bit for each, in an order of lanes (three bits each, the first
    /// lowest). Writes the former in that order.
    fn at_most_in_order(self, row: &Row<f32>, other: &Row<f32>, order: u32, to: &mut [f32; WIDTH]) -> u32;
}

/// What comparisons give.
pub(crate) type Mask<S> = <<S as Instructions>::Vector as Vector>::Mask;

/// Four, eight or sixteen numbers. Comparisons with NaN are false.
pub(crate) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many.
    const LANES: usize;
    /// How many parts a row has.
    const PARTS: usize = SIXTEEN / Self::LANES;
    /// How many parts eight numbers have.
    const PARTS_OF_EIGHT: usize = if Self::LANES < WIDTH { WIDTH / Self::LANES } else { 1 };
    /// Whether some lanes are stored by reading all: then it pays to look first whether there are any.
    const BLENDS: bool = true;

    /// What comparisons give, a yes or no for each.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    /// To a part of a row.
    fn store(self, row: &mut Row<f32>, part: usize);

    /// Leaves those lanes alone that are not in the mask.
    fn store_where(self, mask: Self::Mask, row: &mut Row<f32>, part: usize);

    /// The same with one number.
    fn put_where(mask: Self::Mask, value: u32, row: &mut Row<u32>, part: usize);

    /// `a < b ? a : b`.
    fn min(self, other: Self) -> Self;

    /// `a > b ? a : b`.
    fn max(self, other: Self) -> Self;

    /// `self - a * b`, rounded once or twice: for bounds, of which no answer depends on the last bit.
    fn minus_product(self, a: Self, b: Self) -> Self;

    fn abs(self) -> Self;

    fn sqrt(self) -> Self;

    fn less(self, other: Self) -> Self::Mask;

    fn less_or_equal(self, other: Self) -> Self::Mask;

    /// `a` where the mask says so, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// A bit for each lane.
    fn lanes(mask: Self::Mask) -> u32;

    /// The same as bits of a row of which this is a part.
    #[inline(always)]
    fn bits(mask: Self::Mask, part: usize) -> u32 {
        Self::lanes(mask) << (part * Self::LANES)
    }

    /// The largest of all lanes.
    fn largest(self) -> f32;
}

/// What every machine has: SSE2, NEON, or plain numbers.
#[derive(Clone, Copy)]
pub(crate) struct Baseline;

/// Four numbers.
#[derive(Clone, Copy)]
pub(crate) struct Quad(Vec4);

/// A yes or no for each.
#[derive(Clone, Copy)]
pub(crate) struct QuadMask(BVec4A);

operators!(Quad {
    Add add(a, b) a + b;
    Sub sub(a, b) a - b;
    Mul mul(a, b) a * b;
    Div div(a, b) a / b;
});

operators!(QuadMask {
    BitAnd bitand(a, b) a & b;
    BitOr bitor(a, b) a | b;
});

impl Not for QuadMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Instructions for Baseline {
    type Vector = Quad;

    #[inline(always)]
    fn splat(self, value: f32) -> Quad {
        Quad(Vec4::splat(value))
    }

    #[inline(always)]
    fn load(self, row: &Row<f32>, part: usize) -> Quad {
        Quad(Vec4::from_slice(&row.0[4 * part..]))
    }

    #[inline(always)]
    fn eight(self, row: &[f32; WIDTH], part: usize) -> Quad {
        Quad(Vec4::from_slice(&row[4 * part..]))
    }

    #[inline(always)]
    fn mask(self, bits: u32, part: usize) -> QuadMask {
        let bit = |lane: usize| bits >> (4 * part + lane) & 1 == 1;
        QuadMask(BVec4A::new(bit(0), bit(1), bit(2), bit(3)))
    }

    #[inline(always)]
    fn at_most_in_order(self, row: &Row<f32>, other: &Row<f32>, order: u32, to: &mut [f32; WIDTH]) -> u32 {
        let mut bits = 0;
        for (i, to) in to.iter_mut().enumerate() {
            let lane = (order >> (3 * i)) as usize % WIDTH;
            *to = row.0[lane];
            bits |= u32::from(row.0[lane] <= other.0[lane]) << i;
        }
        bits
    }
}

impl Vector for Quad {
    const LANES: usize = 4;
    type Mask = QuadMask;

    #[inline(always)]
    fn store(self, row: &mut Row<f32>, part: usize) {
        self.0.write_to_slice(&mut row.0[4 * part..]);
    }

    #[inline(always)]
    fn store_where(self, mask: QuadMask, row: &mut Row<f32>, part: usize) {
        Self::select(mask, self, Baseline.load(row, part)).store(row, part);
    }

    #[inline(always)]
    fn put_where(mask: QuadMask, value: u32, row: &mut Row<u32>, part: usize) {
        let lanes = Self::lanes(mask);
        for (lane, to) in row.0[4 * part..4 * part + 4].iter_mut().enumerate() {
            *to = if lanes >> lane & 1 == 1 { value } else { *to };
        }
    }

    // What others than SSE make of NaN differs.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if cfg!(target_arch = "x86_64") {
            Self(self.0.min(other.0))
        } else {
            Self::select(self.less(other), self, other)
        }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if cfg!(target_arch = "x86_64") {
            Self(self.0.max(other.0))
        } else {
            Self::select(other.less(self), self, other)
        }
    }

    #[inline(always)]
    fn minus_product(self, a: Self, b: Self) -> Self {
        self - a * b
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(Vec4::from_array(self.0.to_array().map(f32::sqrt)))
    }

    #[inline(always)]
    fn less(self, other: Self) -> QuadMask {
        QuadMask(self.0.cmplt(other.0))
    }

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> QuadMask {
        QuadMask(self.0.cmple(other.0))
    }

    #[inline(always)]
    fn select(mask: QuadMask, a: Self, b: Self) -> Self {
        Self(Vec4::select(mask.0, a.0, b.0))
    }

    #[inline(always)]
    fn lanes(mask: QuadMask) -> u32 {
        mask.0.bitmask()
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        self.0.max_element()
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{WithAvx2, WithAvx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use std::arch::x86_64::*;

    /// The lanes of an order, in the lowest three bits of each.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn lanes_of(order: u32) -> __m256i {
        _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21))
    }

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
        const BLENDS: bool = false;
        type Mask = __mmask16;

        #[inline(always)]
        fn store(self, row: &mut Row<f32>, _part: usize) {
            unsafe { _mm512_store_ps(row.0.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn store_where(self, mask: __mmask16, row: &mut Row<f32>, _part: usize) {
            unsafe { _mm512_mask_store_ps(row.0.as_mut_ptr(), mask, self.0) }
        }

        #[inline(always)]
        fn put_where(mask: __mmask16, value: u32, row: &mut Row<u32>, _part: usize) {
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

    /// A register of AVX2.
    #[derive(Clone, Copy)]
    pub(crate) struct Ymm(__m256);

    /// All bits of a lane, or none.
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
            let old = WithAvx2(()).load(row, part);
            Self::select(mask, self, old).store(row, part);
        }

        #[inline(always)]
        fn put_where(mask: YmmMask, value: u32, row: &mut Row<u32>, part: usize) {
            unsafe {
                let place = row.0[8 * part..8 * part + 8].as_mut_ptr().cast::<f32>();
                let value = _mm256_castsi256_ps(_mm256_set1_epi32(value as i32));
                _mm256_store_ps(place, _mm256_blendv_ps(_mm256_load_ps(place), value, mask.0));
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
}
