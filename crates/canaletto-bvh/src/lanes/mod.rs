//! Lanes: one text for one number and for eight numbers side by side.
//!
//! A function that is generic in [`Real64`] is the program of one ray with `f64`, and that of eight rays with the types
//! that [`run_lanes`] chooses. Each operation is one of IEEE 754, rounded once, so a lane has the bits of the single
//! number. There are no fused operations and no estimates. Conditions are masks: both sides are evaluated, and
//! [`Real::select`] takes one of them for each lane.
//!
//! | instruction set | a register | eight lanes of `f64` |
//! |---|---|---|
//! | AVX-512 | `avx512` | one register |
//! | AVX2 | `avx2` | a [`Pair`] of registers |
//! | SSE2 | `sse2` | a pair of pairs |
//! | others | `f64` itself | pairs of pairs of pairs, which the compiler vectorises |
//!
//! The types of registers can't be named outside of this module. Only [`run_lanes`] makes functions for them, and it
//! does so for machines that have the instructions. Therefore their functions are safe.
#![allow(unsafe_code)] // Intrinsics.

mod one;
mod pair;

#[cfg(target_arch = "x86_64")]
mod x86;

pub use pair::Pair;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

/// The number of lanes that [`run_lanes`] works with.
pub const LANES: usize = 8;

/// For each mask of bits of lanes the lanes whose bit is set, in order, and zeros. It compacts what lanes hold.
pub static SET_LANES: [[u8; LANES]; 1 << LANES] = {
    let mut table = [[0; LANES]; 1 << LANES];
    let mut mask = 0;
    while mask < 1 << LANES {
        let (mut lane, mut count) = (0, 0);
        while lane < LANES {
            if mask >> lane & 1 == 1 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// True or false for each lane.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// The number of lanes.
    const COUNT: u32;

    /// One value in all lanes.
    fn splat(value: bool) -> Self;

    /// The mask of these bits, the first lane in the lowest one.
    fn from_bits(bits: u32) -> Self;

    /// A bit for each true lane, the first lane in the lowest bit.
    fn bits(self) -> u32;

    /// The mask that a function gives for each lane.
    #[inline(always)]
    fn gather(of_lane: impl Fn(usize) -> bool) -> Self {
        Self::from_bits((0..Self::COUNT).map(|lane| u32::from(of_lane(lane as usize)) << lane).sum())
    }

    /// Whether any lane is true.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// A floating-point number in each lane. Comparisons with NaN are false.
pub trait Real:
    Copy
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<Self::Scalar, Output = Self>
    + Sub<Self::Scalar, Output = Self>
    + Mul<Self::Scalar, Output = Self>
    + Div<Self::Scalar, Output = Self>
{
    /// The number of one lane.
    type Scalar: Copy + Default;
    /// The result of comparisons.
    type Mask: Mask;
    /// The number of lanes.
    const COUNT: usize;

    /// One number in all lanes.
    fn splat(value: Self::Scalar) -> Self;

    /// The first [`Real::COUNT`] numbers of a slice.
    ///
    /// # Panics
    /// If there are fewer.
    fn load(from: &[Self::Scalar]) -> Self;

    /// Writes the numbers to the first [`Real::COUNT`] places of a slice.
    ///
    /// # Panics
    /// If there are fewer.
    fn store(self, to: &mut [Self::Scalar]);

    /// The square root.
    fn sqrt(self) -> Self;

    /// The number without its sign.
    fn abs(self) -> Self;

    /// `self < other`
    fn less(self, other: Self) -> Self::Mask;

    /// `self <= other`
    fn at_most(self, other: Self) -> Self::Mask;

    /// `self == other`
    fn equal(self, other: Self) -> Self::Mask;

    /// `yes` in the lanes of the mask, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// The number that a function gives for each lane.
    #[inline(always)]
    fn gather(mut of_lane: impl FnMut(usize) -> Self::Scalar) -> Self {
        let mut all = [Self::Scalar::default(); LANES];
        for (lane, number) in all[..Self::COUNT].iter_mut().enumerate() {
            *number = of_lane(lane);
        }
        Self::load(&all)
    }

    /// The numbers of all lanes, with zeros after the last one.
    #[inline(always)]
    fn to_array(self) -> [Self::Scalar; LANES] {
        let mut all = [Self::Scalar::default(); LANES];
        self.store(&mut all);
        all
    }

    /// `if self < other { self } else { other }`
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.less(other), self, other)
    }

    /// `if self > other { self } else { other }`
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.less(self), self, other)
    }
}

/// An `f64` in each lane.
pub trait Real64: Real<Scalar = f64> {
    /// An `f32` in each of these lanes.
    type Narrow: Real32<Wide = Self, Mask = Self::Mask>;
    /// 64 bits in each of these lanes.
    type Bits: Bits64;

    /// The nearest `f32`.
    fn narrow(self) -> Self::Narrow;

    /// The bits of the number.
    fn to_bits(self) -> Self::Bits;

    /// The number of these bits.
    fn from_bits(bits: Self::Bits) -> Self;
}

/// An `f32` in each lane.
pub trait Real32: Real<Scalar = f32> {
    /// An `f64` in each of these lanes.
    type Wide: Real64<Narrow = Self, Mask = Self::Mask>;

    /// The same number as `f64`.
    fn widen(self) -> Self::Wide;
}

/// 64 bits in each lane.
pub trait Bits64: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + BitXor<Output = Self> {
    /// The same bits in all lanes.
    fn splat(bits: u64) -> Self;

    /// The bits moved up by N places.
    fn up<const N: u32>(self) -> Self;

    /// The bits moved down by N places, with zeros above them.
    fn down<const N: u32>(self) -> Self;
}

/// A program for any number of lanes.
pub trait LaneKernel {
    /// The result.
    type Answer;

    /// Runs the kernel. It has to be `#[inline(always)]`, as must all functions that it calls. Otherwise each operation
    /// is a call.
    fn run<F: Real64>(self) -> Self::Answer;
}

/// Runs a kernel for [`LANES`] lanes with the instructions in use.
#[inline]
pub fn run_lanes<K: LaneKernel>(kernel: K) -> K::Answer {
    #[cfg(target_arch = "x86_64")]
    {
        use crate::InstructionSet;
        match InstructionSet::current() {
            // SAFETY: `current` never returns more than the machine has.
            InstructionSet::Avx512 => unsafe { x86::avx512(kernel) },
            // SAFETY: as above.
            InstructionSet::Avx2 => unsafe { x86::avx2(kernel) },
            InstructionSet::Baseline => x86::sse2(kernel),
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    kernel.run::<Pair<Pair<Pair<f64>>>>()
}

#[cfg(test)]
mod tests;
