//! Importance sampling of an environment: directions with about the density of its radiance times the cosine at a
//! surface.
//!
//! The radiance is bilinear between the nodes of a grid over (u, v) of a [latitude-longitude image](super::panorama).
//! Its value at a node is the radiance there times sin θ. For such an image the nodes are its texels, so that the
//! density follows the image's own interpolation. Columns are sampled by the blended cumulative sums of two rows.
//!
//! Between a pole and the row of texels beside it, the image's interpolation reaches over the pole: the light of a
//! texel there is seen half a turn away, too. sin θ falls to 0 meanwhile, so that more rows of nodes lie in between.
//!
//! The grid is divided into [`BLOCKS`]. A surface weights each block by the mean cosine of its directions, and the
//! density within a block is that of the radiance.

mod sampling;

use super::PreparedEnvironment;
use super::panorama;
use crate::math::Transform;
use canaletto_bvh::{InstructionSet, Kernel};
use glam::DVec3;
use sampling::factor;
use std::f64::consts::PI;
use std::ops::Range;

/// The share of the light that counts as uniform, so that none can be missed between nodes.
const UNIFORM: f64 = 0.02;

/// The columns and rows of blocks.
const BLOCK_COLUMNS: usize = 8;
const BLOCK_ROWS: usize = 4;

/// The number of parts between a pole and the row of texels beside it.
const POLAR: usize = 4;

/// A number for each block, by column and row.
type OfBlocks = [[f64; BLOCK_ROWS]; BLOCK_COLUMNS];

/// The least mean cosine of a block that counts. Light from behind a surface's normal may still count for some
/// materials.
const LEAST_COSINE: f64 = 0.02;

/// The density of directions.
#[derive(Debug)]
pub(crate) struct EnvironmentDistribution {
    /// The numbers of columns and rows of nodes, by [`height_of`].
    size: [usize; 2],
    /// The heights of the rows of nodes.
    heights: Vec<f64>,
    /// The densities at the nodes per unit of (u, v), row by row. Their integral over the unit square is 1.
    nodes: Vec<f32>,
    /// For each row of nodes the cumulative sums of the means of two neighbours, from 0 on. Column i lies between nodes
    /// i and i + 1.
    columns: Vec<f64>,
    /// For each column of blocks the cumulative sums of the integrals between two rows of nodes, from 0 on.
    rows: [Vec<f64>; BLOCK_COLUMNS],
    blocks: Blocks,
    /// The integral of the radiance over all directions, as a sum of its components.
    total: f64,
    /// The rotation between the scene's directions and the environment's own.
    to_local: Transform,
    to_scene: Transform,
}

/// A sampled direction of an environment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnvironmentSample {
    /// The unit direction in the scene.
    pub(crate) wi: DVec3,
    /// Its (u, v) in a latitude-longitude image of the environment.
    pub(crate) place: [f64; 2],
    /// The density per unit of solid angle.
    pub(crate) pdf: f64,
}

/// The directions of the blocks of the grid.
#[derive(Clone, Debug, Default)]
struct Blocks {
    /// Their shares of the light.
    share: OfBlocks,
    /// The coordinates of their mean directions, and the root mean square distances from them.
    middle: [OfBlocks; 3],
    radius: OfBlocks,
    /// 1 / (4 radius).
    quarter: OfBlocks,
}

/// The shares of the blocks in the light that arrives at a surface.
#[derive(Debug, Default)]
pub(crate) struct BlockWeights {
    /// What the radiance of a block counts.
    factors: OfBlocks,
    /// The sums of the light of a row's first columns.
    sums: OfBlocks,
    /// The sums of the light of the first rows.
    rows: [f64; BLOCK_ROWS],
}

/// Finds the weights for a unit normal of the environment's own space.
struct WeighBlocks<'a> {
    blocks: &'a Blocks,
    normal: DVec3,
    two_sided: bool,
}

impl WeighBlocks<'_> {
    /// What the radiance of a block counts.
    #[inline(always)]
    fn factor(&self, column: usize, row: usize) -> f64 {
        let ([x, y, z], n) = (&self.blocks.middle, self.normal);
        let middle = x[column][row] * n.x + y[column][row] * n.y + z[column][row] * n.z;
        factor(middle, self.blocks.radius[column][row], self.blocks.quarter[column][row], self.two_sided)
    }
}

impl Kernel for WeighBlocks<'_> {
    type Answer = BlockWeights;

    #[inline(always)]
    fn run(self) -> BlockWeights {
        let mut factors = [[0.0; BLOCK_ROWS]; BLOCK_COLUMNS];
        for (column, factors) in factors.iter_mut().enumerate() {
            for (row, factor) in factors.iter_mut().enumerate() {
                *factor = self.factor(column, row);
            }
        }
        self.blocks.weights(factors)
    }
}

impl Blocks {
    fn set(&mut self, column: usize, row: usize, middle: DVec3, radius: f64) {
        for (axis, value) in middle.to_array().into_iter().enumerate() {
            self.middle[axis][column][row] = value;
        }
        self.radius[column][row] = radius;
        self.quarter[column][row] = 0.25 / radius;
    }

    #[inline(always)]
    fn weights(&self, factors: OfBlocks) -> BlockWeights {
        let mut sums = factors;
        let mut sum = [0.0; BLOCK_ROWS];
        for column in 0..BLOCK_COLUMNS {
            for row in 0..BLOCK_ROWS {
                sum[row] += factors[column][row] * self.share[column][row];
            }
            sums[column] = sum;
        }
        for row in 1..BLOCK_ROWS {
            sum[row] += sum[row - 1];
        }
        BlockWeights { factors, sums, rows: sum }
    }
}

impl BlockWeights {
    /// All light that arrives, relative to the environment's.
    pub(crate) fn total(&self) -> f64 {
        self.rows[BLOCK_ROWS - 1]
    }
}

impl EnvironmentDistribution {
    /// The distribution of an environment's light without its sun's disk; none if it is black.
    pub(crate) fn new(environment: &PreparedEnvironment) -> Option<EnvironmentDistribution> {
        let [width, texel_rows] = environment.resolution();
        let size = [width, rows_of_nodes(texel_rows)];
        let sines: Vec<f64> = (0..size[1]).map(|row| libm::sin(PI * height_of(row, size[1]))).collect();
        let mut weights = vec![0.0; width * size[1]];
        for row in 1..size[1] - 1 {
            let v = height_of(row, size[1]);
            for column in 0..width {
                let radiance = node_radiance(environment, [width, texel_rows], column, v);
                weights[row * width + column] = radiance.iter().sum::<f64>() * sines[row];
            }
        }
        let texels = POLAR..POLAR + texel_rows;
        let sum: f64 = weights[texels.start * width..texels.end * width].iter().sum();
        let whole = sines[texels].iter().sum::<f64>() * width as f64;
        if sum.is_nan() || sum <= 0.0 || sum.is_infinite() {
            return None;
        }
        let floor = sum / whole * UNIFORM / (1.0 - UNIFORM);
        for row in 1..size[1] - 1 {
            let even = floor * sines[row];
            weights[row * width..][..width].iter_mut().for_each(|weight| *weight += even);
        }
        Some(EnvironmentDistribution::of_nodes(size, &weights, 4.0 * PI * sum / whole, environment.to_local))
    }

    fn of_nodes(size: [usize; 2], weights: &[f64], total: f64, to_local: Transform) -> EnvironmentDistribution {
        let [width, height] = size;
        let step = |row: usize| height_of(row + 1, height) - height_of(row, height);
        let row_mean = |row: usize| weights[row * width..][..width].iter().sum::<f64>() / width as f64;
        let sum: f64 = (0..height - 1).map(|row| step(row) * 0.5 * (row_mean(row) + row_mean(row + 1))).sum();
        // Samples and densities use the same rounded nodes.
        let nodes: Vec<f32> = weights.iter().map(|weight| (weight / sum) as f32).collect();
        let mut columns = Vec::with_capacity(nodes.len() + height);
        for row in nodes.chunks(width) {
            let mut sum = 0.0;
            columns.push(sum);
            for (i, node) in row.iter().enumerate() {
                sum += 0.5 * (f64::from(*node) + f64::from(row[(i + 1) % width])) / width as f64;
                columns.push(sum);
            }
        }
        let to_scene = to_local.inverse();
        let (rows, blocks) = (Default::default(), Blocks::default());
        let heights = (0..height).map(|row| height_of(row, height)).collect();
        let mut this =
            EnvironmentDistribution { size, heights, nodes, columns, rows, blocks, total, to_local, to_scene };
        for column in 0..BLOCK_COLUMNS {
            let mut sum = 0.0;
            let integrals = (0..height - 1).map(|row| {
                sum += step(row) * 0.5 * (this.sum_between(row, column) + this.sum_between(row + 1, column));
                sum
            });
            this.rows[column] = std::iter::once(0.0).chain(integrals).collect();
            for row in 0..BLOCK_ROWS {
                let rows = this.rows_of(row);
                let share = this.rows[column][rows.end] - this.rows[column][rows.start];
                let (middle, radius) = this.directions(row, column);
                this.blocks.share[column][row] = share;
                this.blocks.set(column, row, middle, radius);
            }
        }
        this
    }

    /// The mean direction of a block, and the root mean square distance from it.
    fn directions(&self, row: usize, column: usize) -> (DVec3, f64) {
        const POINTS: usize = 16;
        let [width, height] = self.size;
        let (rows, columns) = (self.rows_of(row), self.columns_of(column));
        let [top, bottom] = [rows.start, rows.end].map(|row| height_of(row, height));
        let [left, right] = [columns.start, columns.end].map(|column| (column as f64 + 0.5) / width as f64);
        let directions = (0..POINTS * POINTS).map(|i| {
            let [x, y] = [i % POINTS, i / POINTS].map(|i| (i as f64 + 0.5) / POINTS as f64);
            let v = top + (bottom - top) * y;
            (panorama::direction([left + (right - left) * x, v]), libm::sin(PI * v))
        });
        let whole: f64 = directions.clone().map(|(_, weight)| weight).sum();
        let middle = directions.clone().map(|(d, weight)| d * weight).sum::<DVec3>() / whole;
        let spread = directions.map(|(d, weight)| (d - middle).length_squared() * weight).sum::<f64>() / whole;
        (middle, libm::sqrt(spread).max(1e-3))
    }

    /// The rows between nodes that a row of blocks covers. Those between a pole and the texels beside it count as one.
    fn rows_of(&self, row: usize) -> Range<usize> {
        let rows = self.texel_rows() + 1;
        let start = |block: usize| match rows * block / BLOCK_ROWS {
            0 => 0,
            end if end == rows => self.size[1] - 1,
            row => row + POLAR - 1,
        };
        start(row)..start(row + 1)
    }

    /// The number of rows of nodes that aren't close to the poles.
    fn texel_rows(&self) -> usize {
        self.size[1] - 2 * POLAR
    }

    /// The columns between nodes that a column of blocks covers.
    fn columns_of(&self, column: usize) -> Range<usize> {
        self.size[0] * column / BLOCK_COLUMNS..self.size[0] * (column + 1) / BLOCK_COLUMNS
    }

    /// The integral along a row of nodes over a column of blocks.
    fn sum_between(&self, row: usize, block_column: usize) -> f64 {
        let (sums, columns) = (self.sums_of(row), self.columns_of(block_column));
        sums[columns.end] - sums[columns.start]
    }

    /// The cumulative sums along a row of nodes.
    fn sums_of(&self, row: usize) -> &[f64] {
        let count = self.size[0] + 1;
        &self.columns[row * count..][..count]
    }

    /// The weights of all blocks for a surface with a unit normal, or for a point in a medium where the normal is zero.
    /// Light from behind counts as much if the surface is two-sided.
    pub(crate) fn weights(&self, normal: DVec3, two_sided: bool) -> BlockWeights {
        if normal == DVec3::ZERO {
            return self.blocks.weights([[1.0; BLOCK_ROWS]; BLOCK_COLUMNS]);
        }
        InstructionSet::run(WeighBlocks { blocks: &self.blocks, normal: self.to_local.vector(normal), two_sided })
    }

    /// The light that arrives at a surface if nothing hides the environment: about the irradiance, as a sum of its
    /// components.
    pub(crate) fn arriving(&self, weights: &BlockWeights) -> f64 {
        self.total * weights.total()
    }
}

/// The number of rows of nodes over so many rows of texels.
fn rows_of_nodes(texel_rows: usize) -> usize {
    texel_rows + 2 * POLAR
}

/// The height v of a row of nodes: a pole, rows up to the texels beside it, the middles of the texels' rows, and so on
/// to the other pole.
fn height_of(row: usize, rows: usize) -> f64 {
    let texel_rows = (rows - 2 * POLAR) as f64;
    let polar = |steps: usize| 0.5 * steps as f64 / POLAR as f64 / texel_rows;
    let steps_below = rows - 1 - row;
    if row < POLAR {
        polar(row)
    } else if steps_below < POLAR {
        1.0 - polar(steps_below)
    } else {
        ((row - POLAR) as f64 + 0.5) / texel_rows
    }
}

/// The last of the rows of nodes above a height v, which isn't the last of all.
fn row_at(v: f64, rows: usize) -> usize {
    let texel_rows = (rows - 2 * POLAR) as f64;
    let at = v * texel_rows;
    let polar = |distance: f64| ((distance * (2 * POLAR) as f64).max(0.0) as usize).min(POLAR - 1);
    if at < 0.5 {
        polar(at)
    } else if at < texel_rows - 0.5 {
        (POLAR + (at - 0.5) as usize).min(rows - POLAR - 2)
    } else {
        rows - 1 - POLAR + polar(at - (texel_rows - 0.5))
    }
}

/// The radiance at a node of a grid of so many columns and rows of texels: where the grid is the image's own that of a
/// point, otherwise the mean of four lookups around it that each cover a quarter.
fn node_radiance(environment: &PreparedEnvironment, [width, rows]: [usize; 2], column: usize, v: f64) -> [f64; 3] {
    let to_scene = environment.to_local.inverse();
    let (width, rows, is_own) = (width as f64, rows as f64, environment.panorama_size() == Some([width, rows]));
    let direction = |x: f64, y: f64| {
        let place = [x / width, (y / rows).clamp(0.0, 1.0)];
        to_scene.vector(panorama::direction(place)).normalize()
    };
    let look = |middle: DVec3, footprint: [DVec3; 2]| {
        environment.radiance_without_sun(middle, footprint).to_array().map(f64::from)
    };
    let (x, y) = (column as f64 + 0.5, v * rows);
    if is_own {
        return look(direction(x, y), [DVec3::ZERO; 2]);
    }
    // Close to a pole, rows of nodes are closer.
    let height = (y.min(rows - y) * 2.0).min(1.0);
    let mut sum = [0.0; 3];
    for (dx, dy) in [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)] {
        let (x, y) = (x + dx, y + dy * height);
        let middle = direction(x, y);
        let footprint = [direction(x + 0.5, y), direction(x, y + 0.5 * height)].map(|d| d - middle);
        sum.iter_mut().zip(look(middle, footprint)).for_each(|(sum, v)| *sum += v * 0.25);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::{Environment, EnvironmentKind, Gradient, Sky, Smoothing};
    use super::*;
    use crate::math::Rgb;
    use crate::sampler::Sampler;
    use crate::texture::{ColorSpace, Image, Samples};
    use std::f64::consts::TAU;

    fn gradient() -> Gradient {
        Gradient {
            stops: vec![(-90.0, Rgb::BLACK), (10.0, Rgb::gray(3.0)), (20.0, Rgb::gray(0.1)), (90.0, Rgb::BLACK)],
        }
    }

    /// An image with a lone bright texel at its edge and another at a pole.
    fn image() -> Image {
        let mut texels = vec![0.1f32; 16 * 8 * 3];
        texels[(3 * 16 + 15) * 3] = 50.0;
        texels[5 * 3 + 1] = 20.0;
        Image {
            name: "bright".into(),
            width: 16,
            height: 8,
            channels: 3,
            samples: Samples::F32(texels),
            space: ColorSpace::Linear,
            premultiplied: false,
        }
    }

    fn all() -> Vec<PreparedEnvironment> {
        let mut turned = Environment::new(EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Bilinear });
        turned.rotation = Transform::rotate(DVec3::new(1.0, 2.0, -1.0), 40.0).unwrap();
        let others = [EnvironmentKind::Sky(Sky::default()), EnvironmentKind::Gradient(gradient())];
        let all = others.into_iter().map(Environment::new).chain([turned]);
        all.map(|environment| PreparedEnvironment::new(&environment, &mut [image()], |_| false).unwrap()).collect()
    }

    /// Directions fall into the cells of a grid as often as the density says (χ²).
    #[test]
    fn directions_have_their_density() {
        let tilted = DVec3::new(0.36, -0.48, 0.8);
        let receivers = [(DVec3::ZERO, false), (DVec3::Y, false), (tilted, false), (tilted, true)];
        for (environment, (normal, two_sided)) in all().iter().flat_map(|e| receivers.map(|receiver| (e, receiver))) {
            let distribution = EnvironmentDistribution::new(environment).unwrap();
            const SIDE: usize = 16;
            const FINE: usize = 64;
            let n = 512;
            let pdf_of = |d: DVec3| {
                let total = distribution.weights(normal, two_sided).total();
                let place = environment.radiance_and_place(d, [DVec3::ZERO; 2]).1;
                distribution.pdf((normal, two_sided), total, d, place)
            };
            let sampler = Sampler::new(3, 0, [0; 2]);
            let (mut counts, mut expected) = (vec![0.0; SIDE * SIDE], vec![0.0; SIDE * SIDE]);
            let bin = |d: DVec3| {
                let row = ((1.0 - d.y) * 0.5 * SIDE as f64) as usize;
                let turn = (libm::atan2(d.z, d.x) / TAU).rem_euclid(1.0);
                row.min(SIDE - 1) * SIDE + ((turn * SIDE as f64) as usize).min(SIDE - 1)
            };
            for i in 0..n * n {
                let u = [sampler.uniform(i, 0), sampler.uniform(i, 1)];
                let EnvironmentSample { wi: d, pdf, .. } =
                    distribution.sample(&distribution.weights(normal, two_sided), u);
                assert!((d.length() - 1.0).abs() < 1e-12, "{d}");
                let again = pdf_of(d);
                assert!((pdf - again).abs() <= 1e-9 * pdf, "{d}: {pdf} {again}");
                counts[bin(d)] += 1.0;
            }
            let side = SIDE * FINE;
            for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
                let y = 1.0 - 2.0 * (row as f64 + 0.5) / side as f64;
                let (sin, cos) = libm::sincos(TAU * (column as f64 + 0.5) / side as f64);
                let across = (1.0 - y * y).sqrt();
                let pdf = pdf_of(DVec3::new(across * cos, y, across * sin));
                expected[row / FINE * SIDE + column / FINE] += pdf * 4.0 * PI / (side * side) as f64 * f64::from(n * n);
            }
            for (count, expected) in counts.iter().zip(&expected) {
                let most = 5.0 * expected.sqrt() + 2e-3 * expected + 4.0;
                assert!((count - expected).abs() < most, "{count} for {expected}");
            }
            assert!(
                (expected.iter().sum::<f64>() / f64::from(n * n) - 1.0).abs() < 2e-3,
                "{}",
                expected.iter().sum::<f64>()
            );
        }
    }

    /// The radiance over the density differs little from its mean for an image, since both are bilinear.
    #[test]
    fn the_density_follows_an_image() {
        let environment = all().pop().unwrap();
        let distribution = EnvironmentDistribution::new(&environment).unwrap();
        let n = 256;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n * n {
            let sample = distribution.sample(
                &distribution.weights(DVec3::ZERO, false),
                [i % n, i / n].map(|i| (f64::from(i) + 0.5) / f64::from(n)),
            );
            let radiance = environment.radiance_without_sun(sample.wi, [DVec3::ZERO; 2]);
            let at_place = environment.radiance_of_sample(&sample);
            for (one, other) in radiance.to_array().into_iter().zip(at_place.to_array()) {
                assert!((one - other).abs() <= 1e-5 * one.abs(), "{radiance:?} {at_place:?}");
            }
            let weight = radiance.to_array().iter().map(|v| f64::from(*v)).sum::<f64>() / sample.pdf;
            sum += weight;
            squares += weight * weight;
        }
        let mean = sum / f64::from(n * n);
        let relative = squares / f64::from(n * n) / (mean * mean) - 1.0;
        // sin θ isn't linear between the few rows. A grid that is half a texel off has 2.
        assert!(relative < 0.05, "{relative}");
        let whole = distribution.arriving(&distribution.weights(DVec3::ZERO, false));
        assert!((mean / whole - 1.0).abs() < 0.05, "{mean} {whole}");
    }

    /// An image that is black but for one texel.
    fn lamp([width, height]: [u32; 2], [x, y]: [u32; 2]) -> Image {
        let mut texels = vec![0.0f32; (width * height * 3) as usize];
        texels[((y * width + x) * 3) as usize..][..3].fill(1.0);
        Image { name: "lamp".into(), width, height, samples: Samples::F32(texels), ..image() }
    }

    /// A lone bright texel is sampled as it is seen, also in a row beside a pole, over which it is seen half a turn
    /// away. The irradiance by samples is that by quadrature, and no light weighs more than a few.
    #[test]
    fn lone_texels_are_found_wherever_they_stand() {
        for (size, at) in [
            ([32, 16], [5, 0]),
            ([32, 16], [0, 0]),
            ([32, 16], [31, 0]),
            ([32, 16], [5, 1]),
            ([32, 16], [5, 15]),
            ([31, 15], [30, 14]),
            ([31, 15], [3, 7]),
            ([9, 5], [8, 2]),
            ([7, 3], [6, 2]),
            ([7, 3], [3, 1]),
            ([3, 2], [1, 0]),
            ([8, 1], [3, 0]),
            ([1, 8], [0, 3]),
            ([1, 1], [0, 0]),
        ] {
            let kind = EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Bilinear };
            let images = &mut [lamp(size, at)];
            let environment = PreparedEnvironment::new(&Environment::new(kind), images, |_| false).unwrap();
            let what = format!("{at:?} of {size:?}");
            let distribution = EnvironmentDistribution::new(&environment).unwrap();
            // Quadrature over (u, v): dω = 2π² sin θ du dv.
            // No step crosses the border of two blocks, where densities jump.
            let steps = [(distribution.size[0] * 2, 360), (distribution.texel_rows() * 2 * POLAR, 720)];
            let [columns, rows] = steps.map(|(step, fewest)| (step * usize::div_ceil(fewest, step)) as u32);
            let places = (0..columns * rows).map(|i| [(i % columns, columns), (i / columns, rows)]);
            let places = places.map(|place| place.map(|(i, n)| (f64::from(i) + 0.5) / f64::from(n)));
            let seen: Vec<(DVec3, f64, f64)> = places
                .map(|place| {
                    let d = panorama::direction(place);
                    let solid = 2.0 * PI * PI * libm::sin(PI * place[1]) / f64::from(columns * rows);
                    (d, f64::from(environment.radiance_without_sun(d, [DVec3::ZERO; 2]).r), solid)
                })
                .collect();
            for normal in [DVec3::ZERO, DVec3::Y, DVec3::new(0.48, -0.6, 0.64)] {
                let cosine = |d: DVec3| if normal == DVec3::ZERO { 1.0 } else { d.dot(normal).max(0.0) };
                let expected: f64 = seen.iter().map(|(d, radiance, solid)| radiance * cosine(*d) * solid).sum();
                let weights = distribution.weights(normal, false);
                let pdf = |d: DVec3| distribution.pdf((normal, false), weights.total(), d, panorama::uv(d));
                let whole: f64 = seen.iter().map(|(d, _, solid)| pdf(*d) * solid).sum();
                assert!((whole - 1.0).abs() < 2e-3, "{what}: density {whole}");
                let (mut sum, mut squares) = (0.0, 0.0);
                let n = 256;
                for i in 0..n * n {
                    let sample =
                        distribution.sample(&weights, [i % n, i / n].map(|i| (f64::from(i) + 0.5) / f64::from(n)));
                    let again = pdf(sample.wi);
                    assert!((sample.pdf - again).abs() <= 1e-9 * again, "{what}: {} {again}", sample.pdf);
                    let radiance = f64::from(environment.radiance_of_sample(&sample).r);
                    sum += radiance * cosine(sample.wi) / sample.pdf;
                    squares += radiance * radiance / (sample.pdf * sample.pdf);
                }
                let count = f64::from(n * n);
                assert!((sum / count - expected).abs() <= 3e-2 * expected + 1e-9, "{what}: {} {expected}", sum / count);
                if normal == DVec3::ZERO {
                    let relative = squares / count / (expected * expected) - 1.0;
                    let heaviest =
                        seen.iter().map(|(d, radiance, _)| radiance / pdf(*d)).fold(0.0, f64::max) / expected;
                    // sin θ isn't linear between few rows.
                    let most = if size[1] < 15 { [1.0, 6.0] } else { [0.2, 3.0] };
                    assert!(relative < most[0] && heaviest < most[1], "{what}: {relative}, {heaviest}");
                }
            }
        }
    }

    /// The same on the faces of cubes, whose grid isn't that of the density. Texels at their corners are the smallest.
    #[test]
    fn lone_texels_of_cubes_are_found_wherever_they_stand() {
        for (n, face, at) in [
            (8, 0, [3, 3]),
            (8, 0, [0, 0]),
            (8, 2, [4, 4]),
            (8, 5, [7, 2]),
            (32, 0, [0, 0]),
            (32, 2, [15, 16]),
            (32, 2, [0, 31]),
            (7, 2, [3, 3]),
            (1, 2, [0, 0]),
            (2, 3, [0, 1]),
        ] {
            let what = format!("{at:?} of face {face} of {n}");
            let kind = EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing: Smoothing::Bilinear };
            let black = |i: u32| match i == face {
                true => lamp([n, n], at),
                false => Image { samples: Samples::F32(vec![0.0; (n * n * 3) as usize]), ..lamp([n, n], at) },
            };
            let images = &mut [0, 1, 2, 3, 4, 5].map(black);
            let environment = PreparedEnvironment::new(&Environment::new(kind), images, |_| false).unwrap();
            let distribution = EnvironmentDistribution::new(&environment).unwrap();
            let steps = [(distribution.size[0] * 2, 720), (distribution.texel_rows() * 2 * POLAR, 720)];
            let [columns, rows] = steps.map(|(step, fewest)| (step * usize::div_ceil(fewest, step)) as u32);
            let weights = distribution.weights(DVec3::ZERO, false);
            let (mut expected, mut whole, mut squares, mut heaviest) = (0.0, 0.0, 0.0, 0.0f64);
            for i in 0..columns * rows {
                let place =
                    [(i % columns, columns), (i / columns, rows)].map(|(i, n)| (f64::from(i) + 0.5) / f64::from(n));
                let d = panorama::direction(place);
                let solid = 2.0 * PI * PI * libm::sin(PI * place[1]) / f64::from(columns * rows);
                let radiance = f64::from(environment.radiance_without_sun(d, [DVec3::ZERO; 2]).r);
                let pdf = distribution.pdf((DVec3::ZERO, false), weights.total(), d, place);
                expected += radiance * solid;
                whole += pdf * solid;
                squares += radiance * radiance / pdf * solid;
                heaviest = heaviest.max(radiance / pdf);
            }
            assert!((whole - 1.0).abs() < 2e-3, "{what}: density {whole}");
            let (relative, heaviest) = (squares / (expected * expected) - 1.0, heaviest / expected);
            assert!(relative < 3.0 && heaviest < 8.0, "{what}: {relative}, {heaviest}");
        }
    }
}
