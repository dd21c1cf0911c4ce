//! Bins of primitive references, into which the builder sorts them to find a split.

use super::prim_ref::{Box8, Centers};

pub(super) const MAX_BINS: usize = 16;

/// The mapping from a center to one of `bins` equal bins along each axis.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) origin: [f32; 4],
    pub(super) scale: [f32; 4],
    pub(super) bins: usize,
}

impl Grid {
    /// Along an axis on which the centers coincide, or nearly coincide so that the scale would overflow, all centers
    /// fall into the first bin.
    pub(super) fn new(centers: &Centers, bins: usize) -> Self {
        let mut grid = Self { origin: [0.0; 4], scale: [0.0; 4], bins };
        for axis in 0..3 {
            let (min, max) = (centers.0.min(axis), centers.0.max(axis));
            // The scale is slightly reduced, so that rounding never reaches beyond the last bin.
            let scale = (bins as f32 * (1.0 - 1e-6)) / (max - min);
            grid.origin[axis] = min;
            grid.scale[axis] = if scale < f32::INFINITY { scale } else { 0.0 };
        }
        grid
    }

    /// The bins of a center along x, y and z.
    #[inline(always)]
    pub(super) fn bins(&self, center: [f32; 4]) -> [usize; 3] {
        // For numbers in [16, 32), the first four bits of the fraction are the integer part minus 16.
        let mut at = center;
        for ((at, origin), scale) in at.iter_mut().zip(self.origin).zip(self.scale) {
            *at = (*at - origin) * scale + 16.0;
        }
        let bin = |x: f32| (x.to_bits() >> 19) as usize & (MAX_BINS - 1);
        [bin(at[0]), bin(at[1]), bin(at[2])]
    }

    #[inline(always)]
    pub(super) fn bin(&self, center: [f32; 4], axis: usize) -> usize {
        let x = (center[axis & 3] - self.origin[axis & 3]) * self.scale[axis & 3] + 16.0;
        (x.to_bits() >> 19) as usize & (MAX_BINS - 1)
    }
}

/// The box around the references in each bin, and their number, along each axis.
#[derive(Clone)]
pub(super) struct Bins {
    pub(super) boxes: [[Box8; MAX_BINS]; 3],
    pub(super) counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    pub(super) const EMPTY: Self = Self { boxes: [[Box8::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] };

    pub(super) fn join(&mut self, other: &Self, bins: usize) {
        for axis in 0..3 {
            for bin in 0..bins {
                self.boxes[axis][bin] = self.boxes[axis][bin].join(&other.boxes[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
    }
}

/// A split: references whose bin along `axis` lies below `bin` go left.
pub(super) struct BinSplit {
    pub(super) grid: Grid,
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// The SAH cost: the sum over both sides of area times blocks of primitives.
    pub(super) cost: f32,
    /// The boxes of both sides.
    pub(super) bounds: [Box8; 2],
}
