//! As many numbers side by side as a register holds, by the instructions that the machine has. All give the same numbers, but for
//! [`Vector::minus_product`].
//!
//! Rows of sixteen are gone through in parts, one after the other, so that what is known of a part stays in registers.
//! Values are made by [`Instructions`], which is unsafe to get hold of; what is done with them is safe therefore. No closures
//! are handed around: one that isn't inlined would be a function without the instructions.

mod quad;
#[cfg(target_arch = "x86_64")]
mod ymm;
#[cfg(target_arch = "x86_64")]
mod zmm;

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::NodeTest;
use crate::slab::WIDTH;
use glam::Vec4;
pub(crate) use quad::Baseline;
#[cfg(target_arch = "x86_64")]
pub(crate) use ymm::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use zmm::Avx512;

/// How many make a row.
pub(crate) const SIXTEEN: usize = 16;

/// In memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; SIXTEEN]);

/// Makes values: who has it knows that the machine has the instructions.
pub(crate) trait Instructions: NodeTest {
    /// What is made.
    type Vector: Vector;

    /// The same number in all lanes.
    fn splat(self, value: f32) -> Self::Vector;

    /// A part of a row.
    fn load(self, row: &Row<f32>, part: usize) -> Self::Vector;

    /// A part of sixteen numbers that have not been written yet: what was written in fours can't be read as one register before it has reached the cache.
    fn fours(self, row: &[Vec4; 4], part: usize) -> Self::Vector;

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
    /// From so many rays of a group on it pays to test a triangle exactly for all sixteen.
    const SEVERAL: u32 = 4;

    /// What comparisons give, a yes or no for each.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    /// To a part of a row.
    fn store(self, row: &mut Row<f32>, part: usize);

    /// Leaves those lanes alone that are not in the mask: reads all and writes all, as instructions that write some are slow on processors of
    /// AMD's, and what they wrote reaches the next read late. (With AVX, a volatile read keeps the compiler from making one of these of it.)
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
