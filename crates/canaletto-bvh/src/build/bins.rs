//! The surface area heuristic in bins: where to split.

use rayon::prelude::*;

use super::item::{Box8, Centers, Item};
use crate::InstructionSet;

pub(super) const MAX_BINS: usize = 16;

/// Where a center falls among equal bins along each axis.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) origin: [f32; 4],
    pub(super) scale: [f32; 4],
    pub(super) bins: usize,
}

impl Grid {
    /// Along an axis on which the centers coincide, or nearly so that a scale would overflow, all fall into the first bin.
    fn new(centers: &Centers, bins: usize) -> Self {
        let mut grid = Self { origin: [0.0; 4], scale: [0.0; 4], bins };
        for axis in 0..3 {
            let (min, max) = (centers.0.min(axis), centers.0.max(axis));
            // A little less than the bins, so that rounding never reaches beyond the last.
            let scale = (bins as f32 * (1.0 - 1e-6)) / (max - min);
            grid.origin[axis] = min;
            grid.scale[axis] = if scale < f32::INFINITY { scale } else { 0.0 };
        }
        grid
    }

    /// The bins of a center along x, y and z.
    #[inline(always)]
    fn bins(&self, center: [f32; 4]) -> [usize; 3] {
        // In [16, 32) the first four bits of the fraction are the whole part less 16.
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

/// For each bin along each axis the box around its items and their number.
#[derive(Clone)]
pub(super) struct Bins {
    pub(super) boxes: [[Box8; MAX_BINS]; 3],
    pub(super) counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    pub(super) const EMPTY: Self = Self { boxes: [[Box8::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] };

    fn fill(&mut self, items: &[Item], grid: &Grid) {
        if items.len() > super::CHUNK {
            let one = |chunk| {
                let mut own = Self::EMPTY;
                fill(&mut own, chunk, grid);
                own
            };
            let all = items.par_chunks(super::CHUNK).map(one).reduce(
                || Self::EMPTY,
                |mut a, b| {
                    a.join(&b, grid.bins);
                    a
                },
            );
            *self = all;
            return;
        }
        fill(self, items, grid);
    }

    pub(super) fn join(&mut self, other: &Self, bins: usize) {
        for axis in 0..3 {
            for bin in 0..bins {
                self.boxes[axis][bin] = self.boxes[axis][bin].join(&other.boxes[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
    }
}

fn fill(all: &mut Bins, items: &[Item], grid: &Grid) {
    // Only the bins that the grid has.
    for axis in 0..3 {
        all.boxes[axis][..grid.bins].fill(Box8::EMPTY);
        all.counts[axis] = [0; MAX_BINS];
    }
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::current() >= InstructionSet::Avx2 {
        #[allow(unsafe_code)]
        // SAFETY: `current` never tells more than the machine has.
        return unsafe { super::avx2::fill(all, items, grid) };
    }
    let [xs, ys, zs] = &mut all.boxes;
    let [nx, ny, nz] = &mut all.counts;
    for item in items {
        let bounds = item.bounds();
        let [x, y, z] = grid.bins(item.center());
        xs[x] = xs[x].join(bounds);
        ys[y] = ys[y].join(bounds);
        zs[z] = zs[z].join(bounds);
        nx[x] += 1;
        ny[y] += 1;
        nz[z] += 1;
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
    pub(super) bounds: [Box8; 2],
}

/// What a cost is counted in.
#[derive(Clone, Copy)]
pub(super) struct Measure {
    /// Primitives that cost as much as one.
    pub(super) block: u32,
    /// The unit of lengths, see [`Box8::half_area`].
    pub(super) scale: f32,
}

impl Measure {
    #[inline(always)]
    pub(super) fn blocks(&self, count: u32) -> f32 {
        // The block is 1 or 4: no division.
        (if self.block == 1 { count } else { count.div_ceil(super::MAX_LEAF as u32) }) as f32
    }

    /// What a node with these bounds costs.
    pub(super) fn node(&self, bounds: &Box8) -> f32 {
        (super::NODE_COST * bounds.half_area(self.scale)).max(super::LEAST_COST)
    }

    /// What a leaf costs.
    #[inline(always)]
    pub(super) fn cost(&self, bounds: &Box8, count: u32) -> f32 {
        bounds.half_area(self.scale) * self.blocks(count)
    }
}

impl Plan {
    /// The cheapest split, of equal ones the first. None if all centers fall into one bin. `all` is room to work in.
    pub(super) fn best(items: &[Item], centers: &Centers, measure: &Measure, all: &mut Bins) -> Option<Self> {
        // Few bins do for few items.
        let grid = Grid::new(centers, (4 + items.len() / 16).min(MAX_BINS));
        all.fill(items, &grid);
        cheapest(all, &grid, items.len(), measure)
    }
}

super::compiled_wide! {
    fn cheapest(all: &Bins, grid: &Grid, len: usize, measure: &Measure) -> Option<Plan> {
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in 0..3 {
            if grid.scale[axis] == 0.0 {
                continue;
            }
            let (boxes, counts) = (&all.boxes[axis][..grid.bins], &all.counts[axis][..grid.bins]);
            let mut right_costs = [0.0; MAX_BINS];
            let (mut right, mut count) = (Box8::EMPTY, 0);
            for i in (1..grid.bins).rev() {
                if counts[i] > 0 {
                    right = right.join(&boxes[i]);
                    count += counts[i];
                    right_costs[i] = measure.cost(&right, count);
                } else if i + 1 < grid.bins {
                    right_costs[i] = right_costs[i + 1];
                }
            }
            let (mut left, mut count) = (Box8::EMPTY, 0);
            for i in 1..grid.bins {
                // Where nothing comes to the left, the split before costs the same.
                if counts[i - 1] == 0 {
                    continue;
                }
                left = left.join(&boxes[i - 1]);
                count += counts[i - 1];
                if count as usize == len {
                    break;
                }
                let cost = measure.cost(&left, count) + right_costs[i];
                if best.is_none_or(|best| cost < best.0) {
                    best = Some((cost, axis, i));
                }
            }
        }
        let (cost, axis, bin) = best?;
        let side = |boxes: &[Box8]| boxes.iter().fold(Box8::EMPTY, |a, b| a.join(b));
        let (left, right) = all.boxes[axis][..grid.bins].split_at(bin);
        Some(Plan { grid: *grid, axis, bin, cost, bounds: [side(left), side(right)] })
    }
}
