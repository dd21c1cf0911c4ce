//! The surface area heuristic in bins: where to split.

use glam::Vec4;
use rayon::prelude::*;

use super::item::{Box4, Centers, Item};

const MAX_BINS: usize = 16;

/// Where a center falls among equal bins along each axis.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: Vec4,
    scale: Vec4,
    bins: usize,
}

impl Grid {
    /// Along an axis on which the centers coincide, or nearly so that a scale would overflow, all fall into the first bin.
    fn new(centers: &Centers, bins: usize) -> Self {
        let Box4 { min, max } = centers.0;
        // A little less than the bins, so that rounding never reaches beyond the last.
        let scale = (bins as f32 * (1.0 - 1e-6)) / (max - min);
        let scale = Vec4::select(scale.cmplt(Vec4::INFINITY), scale, Vec4::ZERO);
        Self { origin: min, scale: scale.with_w(0.0), bins }
    }

    /// The bins of a center along x, y and z.
    #[inline]
    fn bins(&self, center: Vec4) -> [usize; 3] {
        // In [16, 32) the first four bits of the fraction are the whole part less 16.
        let [x, y, z, _] = ((center - self.origin) * self.scale + 16.0).to_array();
        [x, y, z].map(|x| (x.to_bits() >> 19) as usize & (MAX_BINS - 1))
    }

    #[inline]
    pub(super) fn bin(&self, center: Vec4, axis: usize) -> usize {
        self.bins(center)[axis]
    }
}

/// For each bin along each axis the box around its items and their number.
#[derive(Clone)]
pub(super) struct Bins {
    boxes: [[Box4; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    pub(super) const EMPTY: Self = Self { boxes: [[Box4::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] };

    /// Empties the bins that a grid has.
    fn clear(&mut self, bins: usize) {
        self.boxes.iter_mut().for_each(|boxes| boxes[..bins].fill(Box4::EMPTY));
        self.counts.iter_mut().for_each(|counts| counts[..bins].fill(0));
    }

    fn fill(&mut self, items: &[Item], grid: &Grid) {
        if items.len() > super::CHUNK {
            let one = |chunk| {
                let mut own = Self::EMPTY;
                own.fill(chunk, grid);
                own
            };
            let all = items.par_chunks(super::CHUNK).map(one).reduce(|| Self::EMPTY, Self::join);
            *self = all;
            return;
        }
        self.clear(grid.bins);
        for item in items {
            let bounds = item.bounds();
            for (axis, bin) in grid.bins(item.center()).into_iter().enumerate() {
                let place = &mut self.boxes[axis][bin];
                *place = place.join(bounds);
                self.counts[axis][bin] += 1;
            }
        }
    }

    fn join(mut self, other: Self) -> Self {
        for axis in 0..3 {
            for bin in 0..MAX_BINS {
                self.boxes[axis][bin] = self.boxes[axis][bin].join(other.boxes[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
        self
    }
}

/// A split: items whose bin along `axis` lies below `bin` go left.
pub(super) struct Plan {
    pub(super) grid: Grid,
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// The sum over both sides of area times blocks of primitives.
    pub(super) cost: f32,
    /// The boxes of both sides.
    pub(super) bounds: [Box4; 2],
}

/// What a cost is counted in.
#[derive(Clone, Copy)]
pub(super) struct Measure {
    /// Primitives that cost as much as one.
    pub(super) block: u32,
    /// The unit of lengths, see [`Box4::half_area`].
    pub(super) scale: f32,
}

impl Measure {
    pub(super) fn blocks(&self, count: u32) -> f32 {
        count.div_ceil(self.block) as f32
    }

    #[inline]
    fn cost(&self, bounds: &Box4, count: u32) -> f32 {
        bounds.half_area(self.scale) * self.blocks(count)
    }
}

impl Plan {
    /// The cheapest split, of equal ones the first. None if all centers fall into one bin. `all` is room to work in.
    pub(super) fn best(items: &[Item], centers: &Centers, measure: &Measure, all: &mut Bins) -> Option<Self> {
        // Few bins do for few items.
        let grid = Grid::new(centers, (4 + items.len() / 8).min(MAX_BINS));
        all.fill(items, &grid);
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in 0..3 {
            let (boxes, counts) = (&all.boxes[axis][..grid.bins], &all.counts[axis][..grid.bins]);
            let mut right_costs = [0.0; MAX_BINS];
            let (mut right, mut count) = (Box4::EMPTY, 0);
            for i in (1..grid.bins).rev() {
                if counts[i] > 0 {
                    right = right.join(boxes[i]);
                    count += counts[i];
                    right_costs[i] = measure.cost(&right, count);
                } else if i + 1 < grid.bins {
                    right_costs[i] = right_costs[i + 1];
                }
            }
            let (mut left, mut count) = (Box4::EMPTY, 0);
            for i in 1..grid.bins {
                // Where nothing comes to the left, the split before costs the same.
                if counts[i - 1] == 0 {
                    continue;
                }
                left = left.join(boxes[i - 1]);
                count += counts[i - 1];
                if count as usize == items.len() {
                    break;
                }
                let cost = measure.cost(&left, count) + right_costs[i];
                if best.is_none_or(|best| cost < best.0) {
                    best = Some((cost, axis, i));
                }
            }
        }
        let (cost, axis, bin) = best?;
        let side = |boxes: &[Box4]| boxes.iter().fold(Box4::EMPTY, |a, &b| a.join(b));
        let (left, right) = all.boxes[axis][..grid.bins].split_at(bin);
        Some(Self { grid, axis, bin, cost, bounds: [side(left), side(right)] })
    }
}
