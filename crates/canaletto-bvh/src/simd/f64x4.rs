//! Four f64 numbers side by side. All implementations give equal numbers.

use std::ops::{Add, Div, Mul, Sub};

use glam::Vec4;

/// Four f64 numbers. A value may be made only if the machine has the instructions, and only in functions that are
/// inlined into code compiled for them.
pub(crate) trait F64x4:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// One number in all four lanes.
    ///
    /// # Safety
    /// The machine must have the instructions.
    unsafe fn splat(value: f64) -> Self;

    /// Four f32 numbers as f64.
    ///
    /// # Safety
    /// The machine must have the instructions.
    unsafe fn wide(row: Vec4) -> Self;

    /// The numbers rounded to f32.
    fn narrow(self) -> Vec4;

    fn to_array(self) -> [f64; 4];

    fn abs(self) -> Self;

    /// `a < b ? a : b`.
    fn min(self, other: Self) -> Self;

    /// `a > b ? a : b`.
    fn max(self, other: Self) -> Self;

    /// A bit for each lane that is less or equal; none for NaN.
    fn at_most(self, other: Self) -> u32;

    /// A bit for each lane that is less; none for NaN.
    fn below(self, other: Self) -> u32;
}

/// The implementation by loops, which the compiler vectorises.
#[derive(Clone, Copy)]
pub(crate) struct ScalarF64x4([f64; 4]);

#[inline(always)]
fn each<C>(a: [f64; 4], b: [f64; 4], f: impl Fn(f64, f64) -> C) -> [C; 4] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])]
}

#[inline(always)]
fn bits([a, b, c, d]: [bool; 4]) -> u32 {
    u32::from(a) | u32::from(b) << 1 | u32::from(c) << 2 | u32::from(d) << 3
}

operators!(ScalarF64x4 {
    Add add(a, b) each(a, b, |a, b| a + b);
    Sub sub(a, b) each(a, b, |a, b| a - b);
    Mul mul(a, b) each(a, b, |a, b| a * b);
    Div div(a, b) each(a, b, |a, b| a / b);
});

impl F64x4 for ScalarF64x4 {
    #[inline(always)]
    unsafe fn splat(value: f64) -> Self {
        Self([value; 4])
    }

    #[inline(always)]
    unsafe fn wide(row: Vec4) -> Self {
        Self(row.as_dvec4().to_array())
    }

    #[inline(always)]
    fn narrow(self) -> Vec4 {
        Vec4::from_array(self.0.map(|x| x as f32))
    }

    #[inline(always)]
    fn to_array(self) -> [f64; 4] {
        self.0
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(each(self.0, self.0, |a, _| a.abs()))
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
    fn at_most(self, other: Self) -> u32 {
        bits(each(self.0, other.0, |a, b| a <= b))
    }

    #[inline(always)]
    fn below(self, other: Self) -> u32 {
        bits(each(self.0, other.0, |a, b| a < b))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::AvxF64x4;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Add, Div, F64x4, Mul, Sub, Vec4};
    use std::arch::x86_64::*;

    /// One AVX register.
    #[derive(Clone, Copy)]
    pub(crate) struct AvxF64x4(__m256d);

    operators!(AvxF64x4 {
        Add add(a, b) _mm256_add_pd(a, b);
        Sub sub(a, b) _mm256_sub_pd(a, b);
        Mul mul(a, b) _mm256_mul_pd(a, b);
        Div div(a, b) _mm256_div_pd(a, b);
    });

    // SAFETY, for all functions below: a value exists only if the machine has the instructions, as its constructors
    // require.
    impl F64x4 for AvxF64x4 {
        #[inline(always)]
        unsafe fn splat(value: f64) -> Self {
            // SAFETY: the caller's promise.
            unsafe { Self(_mm256_set1_pd(value)) }
        }

        #[inline(always)]
        unsafe fn wide(row: Vec4) -> Self {
            // SAFETY: the caller's promise.
            unsafe { Self(_mm256_cvtps_pd(row.into())) }
        }

        #[inline(always)]
        fn narrow(self) -> Vec4 {
            // SAFETY: see above.
            unsafe { _mm256_cvtpd_ps(self.0).into() }
        }

        #[inline(always)]
        fn to_array(self) -> [f64; 4] {
            let mut array = [0.0; 4];
            // SAFETY: see above; there is room for four.
            unsafe { _mm256_storeu_pd(array.as_mut_ptr(), self.0) };
            array
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_min_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_max_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn at_most(self, other: Self) -> u32 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
        }

        #[inline(always)]
        fn below(self, other: Self) -> u32 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }
    }
}
