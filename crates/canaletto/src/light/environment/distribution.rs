//! Importance sampling of an environment: directions with about the density of its radiance (pbrt-v4, 12.5.2).

use super::PreparedEnvironment;
use crate::math::Rgb;
use crate::shape::{cumulative, pick_by_area};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// The rows and columns of cells. All cells cover equal solid angles: rows divide the height, columns the angle.
const ROWS: usize = 128;
const COLUMNS: usize = 256;
const CELLS: f64 = (ROWS * COLUMNS) as f64;

/// The share of directions that are uniform, so that no light can be missed between the samples of a cell.
const UNIFORM: f64 = 0.05;

/// The density of directions, constant in each cell.
#[derive(Debug)]
pub(crate) struct EnvironmentDistribution {
    /// The cumulative sums of the rows' weights.
    rows: Vec<f64>,
    /// For each row the cumulative sums of its cells' weights.
    cells: Vec<f64>,
    /// The mean radiance.
    mean: Rgb,
}

impl EnvironmentDistribution {
    /// The distribution of an environment's light without its sun's disk; none if it is black.
    pub(crate) fn new(environment: &PreparedEnvironment) -> Option<EnvironmentDistribution> {
        let mut weights = Vec::with_capacity(ROWS * COLUMNS);
        let mut sum = [0.0; 3];
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let radiance = cell_mean(environment, row, column);
                sum.iter_mut().zip(radiance).for_each(|(sum, v)| *sum += v);
                weights.push(radiance.iter().sum::<f64>());
            }
        }
        let total: f64 = weights.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let floor = total / CELLS * UNIFORM / (1.0 - UNIFORM);
        let cells: Vec<f64> =
            weights.chunks(COLUMNS).flat_map(|row| cumulative(row.iter().map(move |w| w + floor))).collect();
        let rows = cumulative(cells.chunks(COLUMNS).map(|row| row[COLUMNS - 1])).collect();
        let mean = Rgb::from(sum.map(|v| (v / CELLS) as f32)).saturated();
        Some(EnvironmentDistribution { rows, cells, mean })
    }

    /// The mean radiance over all directions.
    pub(crate) fn mean(&self) -> Rgb {
        self.mean
    }

    /// The unit direction at `u` of the unit square, and its density per unit of solid angle.
    pub(crate) fn sample(&self, [u, v]: [f64; 2]) -> (DVec3, f64) {
        let (row, in_row) = pick_by_area(u, &self.rows);
        let cells = &self.cells[row * COLUMNS..][..COLUMNS];
        let (column, in_column) = pick_by_area(v, cells);
        (direction(row as f64 + in_row, column as f64 + in_column), self.density(row, column))
    }

    /// The density of a unit direction per unit of solid angle.
    pub(crate) fn pdf(&self, direction: DVec3) -> f64 {
        let height = (1.0 - direction.y) * 0.5 * ROWS as f64;
        let turn = libm::atan2(direction.z, direction.x) / TAU;
        let turn = if turn < 0.0 { turn + 1.0 } else { turn };
        let [row, column] = [(height, ROWS), (turn * COLUMNS as f64, COLUMNS)]
            .map(|(place, count)| (place.max(0.0) as usize).min(count - 1));
        self.density(row, column)
    }

    fn density(&self, row: usize, column: usize) -> f64 {
        let cells = &self.cells[row * COLUMNS..][..COLUMNS];
        let weight = cells[column] - if column == 0 { 0.0 } else { cells[column - 1] };
        weight / self.rows[ROWS - 1] * CELLS / (4.0 * PI)
    }
}

/// The unit direction at a place of the grid of cells.
fn direction(row: f64, column: f64) -> DVec3 {
    let y = 1.0 - 2.0 * row / ROWS as f64;
    let (sin, cos) = libm::sincos(TAU * column / COLUMNS as f64);
    let across = (1.0 - y * y).max(0.0).sqrt();
    DVec3::new(across * cos, y, across * sin)
}

/// The mean radiance of a cell, from four lookups that each average over a quarter of it.
fn cell_mean(environment: &PreparedEnvironment, row: usize, column: usize) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for quarter in 0..4 {
        let (row, column) = (row as f64 + 0.25 + 0.5 * f64::from(quarter / 2), column as f64 + 0.25);
        let column = column + 0.5 * f64::from(quarter % 2);
        let middle = direction(row, column);
        let footprint = [direction(row, column + 0.5) - middle, direction(row + 0.5, column) - middle];
        let radiance = environment.radiance_without_sun(middle, footprint);
        sum.iter_mut().zip(radiance.to_array()).for_each(|(sum, v)| *sum += f64::from(v) * 0.25);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::{Environment, EnvironmentKind, Gradient, Sky};
    use super::*;

    fn gradient() -> Gradient {
        Gradient {
            stops: vec![(-90.0, Rgb::BLACK), (10.0, Rgb::gray(3.0)), (20.0, Rgb::gray(0.1)), (90.0, Rgb::BLACK)],
        }
    }

    fn distribution(kind: EnvironmentKind) -> EnvironmentDistribution {
        let prepared = PreparedEnvironment::new(&Environment::new(kind), &mut [], |_| false).unwrap();
        EnvironmentDistribution::new(&prepared).unwrap()
    }

    /// Directions fall into the cells of a coarse grid as often as the density says (χ²).
    #[test]
    fn directions_have_their_density() {
        for kind in [EnvironmentKind::Sky(Sky::default()), EnvironmentKind::Gradient(gradient())] {
            let distribution = distribution(kind);
            const SIDE: usize = 16;
            let n = 512;
            let (mut counts, mut expected) = (vec![0.0; SIDE * SIDE], vec![0.0; SIDE * SIDE]);
            let bin = |d: DVec3| {
                let row = ((1.0 - d.y) * 0.5 * SIDE as f64) as usize;
                let turn = (libm::atan2(d.z, d.x) / TAU).rem_euclid(1.0);
                row.min(SIDE - 1) * SIDE + ((turn * SIDE as f64) as usize).min(SIDE - 1)
            };
            for i in 0..n * n {
                let u = [i % n, i / n].map(|i| (f64::from(i) + 0.5) / f64::from(n));
                let (d, pdf) = distribution.sample(u);
                assert!((d.length() - 1.0).abs() < 1e-12 && (pdf - distribution.pdf(d)).abs() <= 1e-9 * pdf, "{d}");
                counts[bin(d)] += 1.0;
            }
            for row in 0..ROWS {
                for column in 0..COLUMNS {
                    let d = direction(row as f64 + 0.5, column as f64 + 0.5);
                    expected[bin(d)] += distribution.pdf(d) * 4.0 * PI / CELLS * f64::from(n * n);
                }
            }
            for (count, expected) in counts.iter().zip(&expected) {
                // Points of a grid differ from the mean by less than random ones.
                assert!((count - expected).abs() < 4.0 * expected.sqrt() + 4.0, "{count} for {expected}");
            }
            assert!((expected.iter().sum::<f64>() - f64::from(n * n)).abs() < 1.0);
        }
    }
}
