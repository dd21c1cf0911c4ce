//! Fireflies: samples that one half of a pixel's paths met and that nothing around confirms.

use super::LAMP;
use super::plane::{ColorPlanes, Part, Plane, Window, strips};
use super::source::Source;
use rayon::prelude::*;

/// A pixel of one half is at most this many times what its surroundings and the other half show.
const TOLERANCE: f32 = 1.5;
/// The radii in blocks of the two boxes whose convolution spreads an outlier.
const REACHES: [usize; 4] = [3, 6, 12, 24];
/// The side of blocks in pixels. The share that outliers add is that of a block.
const BLOCK: usize = 2;
/// An outlier that adds a larger share to a pixel is spread farther.
const VISIBLE: f32 = 0.02;
/// The least ratio of two albedos of alike surfaces.
const ALIKE: f32 = 0.7;

/// What the pixels of each half are multiplied by to have no outliers. A pixel is at most [`TOLERANCE`] times the third
/// brightest of its 3 × 3 neighbours in the same half, or times the same pixel of the other half, whatever is more.
/// Lamps are never outliers.
pub(super) fn lowering(source: &Source<'_>) -> [Plane; 2] {
    let mut factors = [0, 1].map(|_| Plane::new(source.size));
    let [a, b] = &mut factors;
    strips([a, b]).into_par_iter().for_each(|strip| {
        for part in strip.parts(source.size) {
            let largest = |v: [f32; 3]| v[0].max(v[1]).max(v[2]);
            let windows = part.windows(1, |i| {
                [largest(source.color(0, i)), largest(source.color(1, i)), largest(source.albedo(i)), 1.0]
            });
            let [a, b, albedo, inside] = &windows;
            for (half, [own, other]) in [[a, b], [b, a]].into_iter().enumerate() {
                for y in 0..part.size[1] {
                    let row = &mut strip.rows[half][part.row(y)];
                    for (x, factor) in row.iter_mut().enumerate() {
                        let value = own.at(x, y);
                        let limit = TOLERANCE * third_largest(own, inside, x, y).max(other.at(x, y));
                        let is_outlier = value > limit && is_judged(albedo, inside, x, y);
                        *factor = if is_outlier { limit / value } else { 1.0 };
                    }
                }
            }
        }
    });
    factors
}

/// The shares of its light that outliers add to each block of pixels.
pub(super) struct SpreadLight {
    width: usize,
    shares: ColorPlanes,
}

impl SpreadLight {
    /// The shares of a pixel of a picture that is `width` pixels wide.
    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> [f32; 3] {
        let block = i / self.width / BLOCK * self.shares[0].size[0] + i % self.width / BLOCK;
        [0, 1, 2].map(|c: usize| self.shares[c].values[block])
    }
}

/// Spreads removed light in proportion to `takers`, which are light: what is dark stays dark. Each outlier takes the
/// smallest of a few reaches at which it adds less than [`VISIBLE`] to any pixel, or the whole picture. So one strong
/// outlier makes no bright patch. Returns the shares of light to add, and the lost light, which even the whole picture
/// would show.
///
/// With a symmetric kernel K, the light T of outliers becomes W (K ∗ (T / (K ∗ W))), whose sum is that of T.
pub(super) fn spread_outliers(
    size: [usize; 2],
    removed: impl Fn(usize) -> [f32; 3] + Sync,
    takers: impl Fn(usize) -> [f32; 3] + Sync,
) -> (SpreadLight, f64) {
    let takers = block_sums(size, takers);
    let mut left = block_sums(size, removed);
    let mut shares = [0, 1, 2].map(|_| Plane::new(takers[0].size));
    for radius in REACHES {
        let sums = [0, 1, 2].map(|c| takers[c].box_sum(radius).box_sum(radius));
        let peak = ((2 * radius + 1) * (2 * radius + 1)) as f32;
        let is_fit = Plane::of(takers[0].size, |i| {
            let is_fit = (0..3).all(|c| left[c].values[i] * peak <= VISIBLE * sums[c].values[i]);
            if is_fit { 1.0 } else { 0.0 }
        });
        for c in 0..3 {
            let part = Plane::of(takers[0].size, |i| {
                let sum = sums[c].values[i];
                if sum > 0.0 { is_fit.values[i] * left[c].values[i] / sum } else { 0.0 }
            });
            let add = part.box_sum(radius).box_sum(radius);
            shares[c].values.iter_mut().zip(&add.values).for_each(|(v, add)| *v += add);
            left[c].values.iter_mut().zip(&is_fit.values).for_each(|(v, is_fit)| *v *= 1.0 - is_fit);
        }
    }
    let mut lost = 0.0;
    for c in 0..3 {
        let sum = takers[c].total();
        let most = f64::from(VISIBLE) * sum;
        let rest: f64 = left[c].values.iter().map(|v| f64::from(*v).min(most)).sum();
        lost += left[c].total() - rest;
        let whole = if sum > 0.0 { (rest / sum) as f32 } else { 0.0 };
        shares[c].values.iter_mut().for_each(|share| *share += whole);
    }
    (SpreadLight { width: size[0], shares }, lost)
}

/// The sums over blocks of pixels.
fn block_sums([width, height]: [usize; 2], value: impl Fn(usize) -> [f32; 3] + Sync) -> ColorPlanes {
    let size = [width.div_ceil(BLOCK), height.div_ceil(BLOCK)];
    [0, 1, 2].map(|c: usize| {
        Plane::of(size, |block| {
            let [left, top] = [block % size[0] * BLOCK, block / size[0] * BLOCK];
            let rows = top..(top + BLOCK).min(height);
            let pixels = rows.flat_map(|y| (left..(left + BLOCK).min(width)).map(move |x| y * width + x));
            pixels.map(|i| value(i)[c]).sum()
        })
    })
}

/// Whether neighbours can judge a pixel: not that of a lamp, whose albedo is 1 or far above that of its surroundings.
fn is_judged(albedo: &Window, inside: &Window, x: usize, y: usize) -> bool {
    let own = albedo.at(x, y);
    own < LAMP && third_largest(albedo, inside, x, y) >= ALIKE * own
}

fn third_largest(window: &Window, inside: &Window, x: usize, y: usize) -> f32 {
    let mut top = [f32::NEG_INFINITY; 3];
    for v in window.neighbors(inside, x, y) {
        if v > top[0] {
            top = [v, top[0], top[1]];
        } else if v > top[1] {
            top = [top[0], v, top[1]];
        } else if v > top[2] {
            top[2] = v;
        }
    }
    top[2]
}

/// The median of a pixel of a part and of its neighbours.
pub(super) fn median(window: &Window, inside: &Window, x: usize, y: usize) -> f32 {
    let (mut values, mut count) = ([0.0; 9], 0);
    for v in window.neighbors(inside, x, y) {
        values[count] = v;
        count += 1;
    }
    let values = &mut values[..count];
    values.sort_unstable_by(f32::total_cmp);
    values[count / 2]
}

/// The light that was removed from one half: the sum of all components.
pub(super) fn removed_light(source: &Source<'_>, half: usize, factors: &Plane) -> f64 {
    let rows = factors.values.par_chunks(source.size[0]).enumerate().map(|(y, row)| {
        let removed = |(x, factor): (usize, &f32)| {
            let color = source.color(half, y * source.size[0] + x);
            color.iter().map(|v| f64::from(*v) * f64::from(1.0 - factor)).sum::<f64>()
        };
        row.iter().enumerate().filter(|(_, factor)| **factor < 1.0).map(removed).sum::<f64>()
    });
    rows.collect::<Vec<f64>>().iter().sum()
}

/// Light without outliers.
pub(super) fn lowered(source: &Source<'_>, half: usize, factors: &[Plane; 2], i: usize) -> [f32; 3] {
    source.light(half, i).map(|v| v * factors[half].values[i])
}

/// Windows of the light of both halves without outliers.
pub(super) fn lowered_windows(source: &Source<'_>, factors: &[Plane; 2], part: &Part, reach: usize) -> [Window; 6] {
    part.windows(reach, |i| {
        let [[a, b, c], [d, e, f]] = [0, 1].map(|half| lowered(source, half, factors, i));
        [a, b, c, d, e, f]
    })
}
