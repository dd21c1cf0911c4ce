//! Vectors of four numbers: SSE2, NEON or scalar code.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use glam::{BVec4A, Vec4};

use super::{Instructions, Row, Vector};
use crate::slab::WIDTH;

/// The baseline instructions, which every machine has.
#[derive(Clone, Copy)]
pub(crate) struct Baseline;

/// A vector of four numbers.
#[derive(Clone, Copy)]
pub(crate) struct Quad(Vec4);

/// True or false for each of four lanes.
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
    fn load_fours(self, row: &[Vec4; 4], part: usize) -> Quad {
        Quad(row[part])
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
    fn store_u32_where(mask: QuadMask, value: u32, row: &mut Row<u32>, part: usize) {
        let lanes = Self::lanes(mask);
        for (lane, to) in row.0[4 * part..4 * part + 4].iter_mut().enumerate() {
            *to = if lanes >> lane & 1 == 1 { value } else { *to };
        }
    }

    // Not glam's `min` and `max`: other machines than SSE treat NaN differently.
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
