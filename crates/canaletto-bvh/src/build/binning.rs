//! The binned surface area heuristic, which finds where to split.

use canaletto_parallel::prelude::*;
use glam::{Mat4, Vec4};

use super::bins::{BinSplit, Bins, Grid, MAX_BINS};
use super::prim_ref::{Box8, Centers, PrimRef};
use crate::InstructionSet;

/// Fills the bins, in parallel if there are many references.
fn fill_all(all: &mut Bins, refs: &[PrimRef], grid: &Grid) {
    if refs.len() > super::CHUNK {
        let one = |chunk| {
            let mut own = Bins::EMPTY;
            fill(&mut own, chunk, grid);
            own
        };
        *all = refs.par_chunks(super::CHUNK).map(one).reduce(
            || Bins::EMPTY,
            |mut a, b| {
                a.join(&b, grid.bins);
                a
            },
        );
        return;
    }
    fill(all, refs, grid);
}

fn fill(all: &mut Bins, refs: &[PrimRef], grid: &Grid) {
    // Clear only the bins that the grid has.
    for axis in 0..3 {
        all.boxes[axis][..grid.bins].fill(Box8::EMPTY);
        all.counts[axis] = [0; MAX_BINS];
    }
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::current() >= InstructionSet::Avx2 {
        #[allow(unsafe_code)]
        // SAFETY: `current` never returns more than the machine has.
        return unsafe { super::avx2::fill(all, refs, grid) };
    }
    let [xs, ys, zs] = &mut all.boxes;
    let [nx, ny, nz] = &mut all.counts;
    for prim in refs {
        let bounds = prim.bounds();
        let [x, y, z] = grid.bins(prim.center());
        xs[x] = xs[x].join(bounds);
        ys[y] = ys[y].join(bounds);
        zs[z] = zs[z].join(bounds);
        nx[x] += 1;
        ny[y] += 1;
        nz[z] += 1;
    }
}

/// The units of the SAH cost.
#[derive(Clone, Copy)]
pub(super) struct CostModel {
    /// The number of primitives in a block. A block costs as much as one primitive.
    pub(super) block: u32,
    /// The scale of lengths, see [`Box8::half_area`].
    pub(super) scale: f32,
}

impl CostModel {
    #[inline(always)]
    pub(super) fn blocks(&self, count: u32) -> f32 {
        // The block is 1 or 4, so that no division is necessary.
        (if self.block == 1 { count } else { count.div_ceil(crate::node::MAX_LEAF as u32) }) as f32
    }

    /// The cost of a node with these bounds.
    pub(super) fn node(&self, bounds: &Box8) -> f32 {
        (super::NODE_COST * bounds.half_area(self.scale)).max(super::LEAST_COST)
    }

    /// The cost of a leaf.
    #[inline(always)]
    pub(super) fn cost(&self, bounds: &Box8, count: u32) -> f32 {
        bounds.half_area(self.scale) * self.blocks(count)
    }
}

impl BinSplit {
    /// The split of least cost; of equal ones, the first. None if all centers fall into one bin. `all` is scratch
    /// memory.
    pub(super) fn best(refs: &[PrimRef], centers: &Centers, cost_model: &CostModel, all: &mut Bins) -> Option<Self> {
        // A few references need only a few bins.
        let grid = Grid::new(centers, (4 + refs.len() / 16).min(MAX_BINS));
        fill_all(all, refs, &grid);
        cheapest(all, &grid, cost_model)
    }
}

/// The bounds and the count of one side of a split, along each axis.
#[derive(Clone, Copy)]
struct Side {
    /// The corners of the boxes, in the layout of `Box8`.
    low: [Vec4; 3],
    high: [Vec4; 3],
    counts: [u32; 4],
}

impl Side {
    const NOTHING: Self = Self { low: [Vec4::NEG_INFINITY; 3], high: [Vec4::NEG_INFINITY; 3], counts: [0; 4] };

    /// Adds this bin of each axis.
    #[inline(always)]
    fn add(&mut self, all: &Bins, bin: usize) {
        for axis in 0..3 {
            let Box8([a, b, c, d, e, f, g, h]) = all.boxes[axis][bin];
            self.low[axis] = self.low[axis].max(Vec4::new(a, b, c, d));
            self.high[axis] = self.high[axis].max(Vec4::new(e, f, g, h));
            self.counts[axis] += all.counts[axis][bin];
        }
    }

    /// [`CostModel::cost`] for each axis. NaN for an empty side.
    #[inline(always)]
    fn costs(&self, cost_model: &CostModel) -> Vec4 {
        let scale = Vec4::splat(cost_model.scale);
        let extent = |axis: usize| self.high[axis] * scale + self.low[axis] * scale;
        let Mat4 { x_axis: x, y_axis: y, z_axis: z, .. } =
            Mat4::from_cols(extent(0), extent(1), extent(2), Vec4::ZERO).transpose();
        let blocks = self.counts.map(|count| cost_model.blocks(count));
        (x * y + y * z + z * x) * Vec4::from_array(blocks)
    }
}

crate::instruction_set::compiled_wide! {
    fn cheapest(all: &Bins, grid: &Grid, cost_model: &CostModel) -> Option<BinSplit> {
        let mut right_costs = [Vec4::ZERO; MAX_BINS];
        let mut right = Side::NOTHING;
        for bin in (1..grid.bins).rev() {
            right.add(all, bin);
            right_costs[bin] = right.costs(cost_model);
        }
        let (mut least, mut ends) = (Vec4::INFINITY, Vec4::ZERO);
        let mut left = Side::NOTHING;
        for (bin, right_costs) in right_costs.iter().enumerate().take(grid.bins).skip(1) {
            left.add(all, bin - 1);
            // The cost is NaN where one side is empty.
            let costs = left.costs(cost_model) + *right_costs;
            let better = costs.cmplt(least);
            least = Vec4::select(better, costs, least);
            ends = Vec4::select(better, Vec4::splat(bin as f32), ends);
        }
        let mut best: Option<(f32, usize)> = None;
        for axis in 0..3 {
            let cost = least[axis];
            if grid.scale[axis] != 0.0 && cost < best.map_or(f32::INFINITY, |best| best.0) {
                best = Some((cost, axis));
            }
        }
        let (cost, axis) = best?;
        let bin = ends[axis] as usize;
        let side = |boxes: &[Box8]| boxes.iter().fold(Box8::EMPTY, |a, b| a.join(b));
        let (left, right) = all.boxes[axis][..grid.bins].split_at(bin);
        Some(BinSplit { grid: *grid, axis, bin, cost, bounds: [side(left), side(right)] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::build::prim_ref::Extent;
    use crate::testing::Random;

    #[test]
    fn of_all_splits_the_first_of_the_cheapest_is_found() {
        let random = &mut Random(53);
        let mut none = 0;
        for n in 2..200 {
            // The boxes lie in few places, so that bins are empty, splits have equal cost, and some axes can't be
            // split. For one cell size all boxes coincide.
            let cell = [0.25, 1.0, 0.0][n % 3];
            let refs: Vec<PrimRef> = (0..n)
                .map(|id| {
                    let p = (random.vector() * 2.0).round() * cell;
                    PrimRef::new(&Aabb::from_points([p, p + cell]), id as u32)
                })
                .collect();
            let extent = Extent::of(&refs);
            let cost_model = CostModel { block: [1, 4][n % 2], scale: extent.bounds.scale() };
            let bin_split = BinSplit::best(&refs, &extent.centers, &cost_model, &mut { Bins::EMPTY });
            let grid = Grid::new(&extent.centers, (4 + n / 16).min(MAX_BINS));
            let mut expected: Option<(f32, usize, usize)> = None;
            for axis in 0..3 {
                for bin in 1..grid.bins {
                    let goes_left = |prim: &&PrimRef| grid.bin(prim.center(), axis) < bin;
                    let (left, right): (Vec<&PrimRef>, Vec<&PrimRef>) = refs.iter().partition(goes_left);
                    let cost = |side: &[&PrimRef]| {
                        let bounds = side.iter().fold(Box8::EMPTY, |all, prim| all.join(prim.bounds()));
                        cost_model.cost(&bounds, side.len() as u32)
                    };
                    if !left.is_empty() && !right.is_empty() {
                        let cost = cost(&left) + cost(&right);
                        expected = expected.filter(|best| best.0 <= cost).or(Some((cost, axis, bin)));
                    }
                }
            }
            none += usize::from(expected.is_none());
            assert_eq!(
                bin_split.map(|bin_split| (bin_split.cost, bin_split.axis, bin_split.bin)),
                expected,
                "{n} refs"
            );
        }
        assert!((60..70).contains(&none), "{none}");
    }
}
