//! Vectors of f32: as many numbers as a register of the instruction set holds. All instruction sets give equal numbers,
//! except for [`Vector::minus_product`].
//!
//! A row holds sixteen numbers, in one, two or four vectors, its *parts*. Parts are processed one after the other, so
//! that the values of a part stay in registers. Values are made by [`Instructions`]. To get an `Instructions` is
//! unsafe, so that operations on the values can be safe. Closures are not passed around: one that isn't inlined would
//! be a function without the instructions.

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

/// The number of lanes of a row, and of rays in a group.
pub(crate) const ROW: usize = 16;

/// A row of sixteen numbers in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; ROW]);

/// An instruction set in use. A value of this type exists only if the machine has the instructions.
pub(crate) trait Instructions: NodeTest {
    /// The vector type.
    type Vector: Vector;

    /// A vector with one number in all lanes.
    fn splat(self, value: f32) -> Self::Vector;

    /// Loads a part of a row.
    fn load(self, row: &Row<f32>, part: usize) -> Self::Vector;

    /// A part of sixteen numbers that are still in registers. Numbers that were stored in fours can't be loaded as one
    /// register before they have reached the cache.
    fn load_fours(self, row: &[Vec4; 4], part: usize) -> Self::Vector;

    /// Loads a part of eight numbers. A vector of sixteen lanes gets them twice.
    fn eight(self, row: &[f32; WIDTH], part: usize) -> Self::Vector;

    /// The mask of a part, from the bits of a row.
    fn mask(self, bits: u32, part: usize) -> Mask<Self>;

    /// Compares the first eight numbers of two rows. `order` lists lanes in three bits each, the first in the lowest
    /// bits. Bit i of the result is set if `row` ≤ `other` in the i-th listed lane. Writes the numbers of `row` in this
    /// order to `to`.
    fn at_most_in_order(self, row: &Row<f32>, other: &Row<f32>, order: u32, to: &mut [f32; WIDTH]) -> u32;
}

/// The mask type: the result of comparisons.
pub(crate) type Mask<S> = <<S as Instructions>::Vector as Vector>::Mask;

/// A vector of four, eight or sixteen numbers. Comparisons with NaN are false.
pub(crate) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The number of lanes.
    const LANES: usize;
    /// The number of parts of a row.
    const PARTS: usize = ROW / Self::LANES;
    /// The number of parts of eight numbers.
    const PARTS_OF_EIGHT: usize = if Self::LANES < WIDTH { WIDTH / Self::LANES } else { 1 };
    /// The number of rays of a group from which on an exact test of all sixteen side by side pays.
    const MIN_EXACT_RAYS: u32 = 4;

    /// The result of comparisons: true or false for each lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    /// Stores the vector to a part of a row.
    fn store(self, row: &mut Row<f32>, part: usize);

    /// Stores the lanes in the mask and keeps the others. It loads, selects and stores the whole vector: masked stores
    /// are slow on AMD processors, and their results reach the next load late. (With AVX, a volatile load keeps the
    /// compiler from using a masked store.)
    fn store_where(self, mask: Self::Mask, row: &mut Row<f32>, part: usize);

    /// Stores one number to the lanes in the mask and keeps the others, as [`Vector::store_where`].
    fn store_u32_where(mask: Self::Mask, value: u32, row: &mut Row<u32>, part: usize);

    /// `a < b ? a : b`.
    fn min(self, other: Self) -> Self;

    /// `a > b ? a : b`.
    fn max(self, other: Self) -> Self;

    /// `self - a * b`, rounded once or twice: for bounds, where no result depends on the last bit.
    fn minus_product(self, a: Self, b: Self) -> Self;

    fn abs(self) -> Self;

    fn sqrt(self) -> Self;

    fn less(self, other: Self) -> Self::Mask;

    fn less_or_equal(self, other: Self) -> Self::Mask;

    /// `a` in the lanes of the mask, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// A bit for each lane in the mask.
    fn lanes(mask: Self::Mask) -> u32;

    /// The bits of the mask at their positions in a row.
    #[inline(always)]
    fn bits(mask: Self::Mask, part: usize) -> u32 {
        Self::lanes(mask) << (part * Self::LANES)
    }

    /// The largest number of all lanes.
    fn largest(self) -> f32;
}
