//! Directions of an environment and their densities, for any number of lanes.
//!
//! Each lane has a surface of its own. Searches of all lanes go on step by step together, since each waits for memory.

use super::super::panorama;
use super::{
    BLOCK_COLUMNS, BLOCK_ROWS, BlockWeights, Blocks, EnvironmentDistribution, EnvironmentSample, LEAST_COSINE, POLAR,
    row_at,
};
use crate::math::{Affine, Vector};
use canaletto_bvh::lanes::{LANES, Real64};
use glam::DVec3;
use std::f64::consts::PI;
use std::ops::Range;

/// An index in each lane.
type Indices = [usize; LANES];

/// A sampled direction in each lane: [`EnvironmentSample`].
pub(crate) struct EnvironmentSamples<F> {
    pub(crate) wi: Vector<F>,
    pub(crate) place: [F; 2],
    pub(crate) pdf: F,
}

/// The indices that a function gives for each lane.
#[inline(always)]
fn indices<F: Real64>(of_lane: impl Fn(usize) -> usize) -> Indices {
    let mut all = [0; LANES];
    for (lane, index) in all[..F::COUNT].iter_mut().enumerate() {
        *index = of_lane(lane);
    }
    all
}

impl Blocks {
    /// What the radiance of a block in each lane counts for a surface: the mean cosine of its directions, as if their
    /// cosines were distributed evenly. The unit normal is that of the environment's own space, or zero in a medium.
    #[inline(always)]
    pub(super) fn factors<F: Real64>(
        &self,
        [columns, rows]: [&Indices; 2],
        normal: Vector<F>,
        two_sided: F::Mask,
    ) -> F {
        let [x, y, z] = &self.middle;
        let middle = Vector {
            x: F::gather(|lane| x[columns[lane]][rows[lane]]),
            y: F::gather(|lane| y[columns[lane]][rows[lane]]),
            z: F::gather(|lane| z[columns[lane]][rows[lane]]),
        };
        let radius = F::gather(|lane| self.radius[columns[lane]][rows[lane]]);
        let quarter = F::gather(|lane| self.quarter[columns[lane]][rows[lane]]);
        factor(middle.dot(normal), radius, quarter, two_sided)
    }
}

/// The mean cosine of a block's directions. `middle` is the cosine of the mean direction.
#[inline(always)]
pub(super) fn factor<F: Real64>(middle: F, radius: F, quarter: F, two_sided: F::Mask) -> F {
    let (front, behind) = (cosine(middle, radius, quarter), cosine(-middle, radius, quarter));
    F::select(two_sided, front + behind, front).max(F::splat(LEAST_COSINE))
}

#[inline(always)]
fn cosine<F: Real64>(middle: F, radius: F, quarter: F) -> F {
    let zero = F::splat(0.0);
    let within = (middle.min(radius) + radius).max(zero);
    let beyond = (middle - radius).max(zero);
    within * within * quarter + beyond
}

impl EnvironmentDistribution {
    /// The direction at `u` of the unit square for a surface of these weights.
    pub(crate) fn sample(&self, weights: &BlockWeights, u: [f64; 2]) -> EnvironmentSample {
        let EnvironmentSamples { wi, place, pdf } = self.samples(|_| weights, u);
        EnvironmentSample { wi: wi.into(), place, pdf }
    }

    /// The density with which a surface samples a unit direction, per unit of solid angle. `place` is the direction's
    /// (u, v) in a latitude-longitude image of the environment, and `total` is that of the surface's weights.
    pub(crate) fn pdf(&self, (normal, two_sided): (DVec3, bool), total: f64, direction: DVec3, place: [f64; 2]) -> f64 {
        self.pdfs((normal.into(), two_sided), total, direction.into(), place)
    }

    /// [`EnvironmentDistribution::sample`] in each lane, with the weights that a function gives for it.
    #[inline(always)]
    pub(crate) fn samples<'a, F: Real64>(
        &self,
        weights: impl Fn(usize) -> &'a BlockWeights,
        [u, v]: [F; 2],
    ) -> EnvironmentSamples<F> {
        let [width, _] = self.size;
        let sum_of_rows = |lane: usize, row: usize| if row == 0 { 0.0 } else { weights(lane).rows[row - 1] };
        let (block_row, u) = pick(u, |_| 0..BLOCK_ROWS, sum_of_rows);
        let sum_of_columns = |lane: usize, column: usize| match column {
            0 => 0.0,
            _ => weights(lane).sums[column - 1][block_row[lane]],
        };
        let (block_column, v) = pick(v, |_| 0..BLOCK_COLUMNS, sum_of_columns);
        let integral = |lane: usize, row: usize| self.rows[block_column[lane]][row];
        let (row, u) = pick(u, |lane| self.rows_of(block_row[lane]), integral);
        let above = F::gather(|lane| self.sum_between(row[lane], block_column[lane]));
        let below = F::gather(|lane| self.sum_between(row[lane] + 1, block_column[lane]));
        let y = linear(u, [above, below]);
        let heights = y.to_array();
        let sum_of_nodes = |lane: usize, column: usize| {
            let [upper, lower] = [row[lane], row[lane] + 1].map(|row| self.sums_of(row)[column]);
            upper + (lower - upper) * heights[lane]
        };
        let (column, v) = pick(v, |lane| self.columns_of(block_column[lane]), sum_of_nodes);
        let ends = self.blended_nodes(&row, &column, y);
        let x = linear(v, ends);
        let [above, below]: [F; 2] = self.heights(&row);
        let across = (F::gather(|lane| column[lane] as f64) + 0.5 + x) / width as f64;
        let place = [F::select(across.less(F::splat(1.0)), across, across - 1.0), above + (below - above) * y];
        let factor = F::gather(|lane| weights(lane).factors[block_column[lane]][block_row[lane]]);
        let factor = factor / F::gather(|lane| weights(lane).total());
        let local = panorama::directions(place);
        let pdf = density(ends, x, local) * factor;
        let wi = Affine::splat(self.to_scene.matrix()).vector(local).normalized();
        EnvironmentSamples { wi, place, pdf }
    }

    /// [`EnvironmentDistribution::pdf`] in each lane.
    #[inline(always)]
    pub(crate) fn pdfs<F: Real64>(
        &self,
        (normal, two_sided): (Vector<F>, F::Mask),
        total: F,
        direction: Vector<F>,
        [u, v]: [F; 2],
    ) -> F {
        let [width, height] = self.size;
        let to_local = Affine::splat(self.to_local.matrix());
        let x = u * width as f64 - 0.5;
        let (places, heights) = (x.to_array(), v.to_array());
        // The first node is half a column from the seam. The last column reaches over the seam to it.
        let is_first = |lane: usize| places[lane] < 0.0;
        let column =
            indices::<F>(|lane| if is_first(lane) { width - 1 } else { (places[lane] as usize).min(width - 1) });
        let left = F::gather(|lane| if is_first(lane) { -1.0 } else { column[lane] as f64 });
        let row = indices::<F>(|lane| row_at(heights[lane], height));
        let [above, below]: [F; 2] = self.heights(&row);
        let y = ((v - above) / (below - above)).max(F::splat(0.0)).min(F::splat(1.0));
        // The block is the last one that begins at the place or before it.
        let block = |place: usize, count: usize, blocks: usize| ((place + 1) * blocks - 1) / count;
        let rows = self.texel_rows();
        let texel_row = |lane: usize| (row[lane] + 1).saturating_sub(POLAR).min(rows);
        let block_row = indices::<F>(|lane| block(texel_row(lane), rows + 1, BLOCK_ROWS));
        let block_column = indices::<F>(|lane| block(column[lane], width, BLOCK_COLUMNS));
        let factor = self.blocks.factors([&block_column, &block_row], to_local.vector(normal), two_sided);
        let factor = F::select(normal.is_zero(), F::splat(1.0), factor);
        let ends = self.blended_nodes(&row, &column, y);
        density(ends, x - left, to_local.vector(direction)) * (factor / total)
    }

    /// The heights of the rows of nodes above and below places.
    #[inline(always)]
    fn heights<F: Real64>(&self, row: &Indices) -> [F; 2] {
        [F::gather(|lane| self.heights[row[lane]]), F::gather(|lane| self.heights[row[lane] + 1])]
    }

    /// The densities at the left and right ends of a column at a share y of the way from a row of nodes to the next.
    #[inline(always)]
    fn blended_nodes<F: Real64>(&self, row: &Indices, column: &Indices, y: F) -> [F; 2] {
        let [width, _] = self.size;
        let node = |lane: usize, below: usize, right: usize| {
            let column = column[lane] + right;
            let column = if column == width { 0 } else { column };
            f64::from(self.nodes[(row[lane] + below) * width + column])
        };
        let left = [F::gather(|lane| node(lane, 0, 0)), F::gather(|lane| node(lane, 1, 0))];
        let right = [F::gather(|lane| node(lane, 0, 1)), F::gather(|lane| node(lane, 1, 1))];
        [left[0] + (left[1] - left[0]) * y, right[0] + (right[1] - right[0]) * y]
    }
}

/// The density in a unit direction of the environment's own, at a share x of the way between the ends of a column.
#[inline(always)]
fn density<F: Real64>([left, right]: [F; 2], x: F, local: Vector<F>) -> F {
    let per_square = left + (right - left) * x;
    // Both vanish at the poles; dω = 2π² sin θ du dv.
    let (zero, sin) = (F::splat(0.0), (local.x * local.x + local.z * local.z).sqrt());
    F::select(zero.less(sin), per_square / (sin * (2.0 * PI * PI)), zero)
}

/// The part of a range that `u` of [0, 1) selects in proportion to the parts, and where `u` lies within its part.
/// `before` is the sum of the parts before one. Each lane has a range and parts of its own.
#[inline(always)]
fn pick<F: Real64>(u: F, parts: impl Fn(usize) -> Range<usize>, before: impl Fn(usize, usize) -> f64) -> (Indices, F) {
    let mut low = indices::<F>(|lane| parts(lane).start);
    let mut count = indices::<F>(|lane| parts(lane).len());
    let first = F::gather(|lane| before(lane, low[lane]));
    let value = first + u * (F::gather(|lane| before(lane, low[lane] + count[lane])) - first);
    let values = value.to_array();
    while count.iter().any(|count| *count > 1) {
        for lane in 0..F::COUNT {
            // A step without a branch, since none could be predicted.
            let half = count[lane] / 2;
            low[lane] += if before(lane, low[lane] + half) > values[lane] { 0 } else { half };
            count[lane] -= half;
        }
    }
    let start = F::gather(|lane| before(lane, low[lane]));
    let step = F::gather(|lane| before(lane, low[lane] + 1)) - start;
    let zero = F::splat(0.0);
    let share = F::select(zero.less(step), (value - start) / step, zero);
    (low, below_one(share))
}

/// A share, at least 0 and below 1.
#[inline(always)]
fn below_one<F: Real64>(share: F) -> F {
    share.max(F::splat(0.0)).min(F::splat(1.0 - f64::EPSILON))
}

/// The place in 0..1 below which the share `u` of a density lies that goes evenly from one value to another.
#[inline(always)]
fn linear<F: Real64>(u: F, [a, b]: [F; 2]) -> F {
    let divisor = a + ((F::splat(1.0) - u) * a * a + u * b * b).sqrt();
    F::select(F::splat(0.0).less(divisor), below_one(u * (a + b) / divisor), u)
}
