//! Fireflies: samples that one half of a pixel's paths met and that nothing around confirms.

use super::LAMP;
use super::plane::{ColorPlanes, Part, Plane, Window, strips};
use super::source::Source;
use canaletto_parallel::prelude::*;

/// A pixel of one half is at most this many times what its surroundings and the other half show.
const TOLERANCE: f32 = 1.5;
/// The radius of the squares in which chance is judged.
const CHANCE_RADIUS: usize = 10;
/// What is farther from chance than this many standard deviations isn't chance.
const DEVIATIONS: f32 = 3.0;
/// The radii in blocks of the two boxes whose convolution spreads an outlier.
const REACHES: [usize; 4] = [3, 6, 12, 24];
/// The side of blocks in pixels. The share that outliers add is that of a block.
const BLOCK: usize = 2;
/// An outlier that adds a larger share to a pixel is spread farther.
const VISIBLE: f32 = 0.02;
/// The least ratio of two albedos of alike surfaces.
const ALIKE: f32 = 0.7;

/// What the pixels of each half are multiplied by to have no outliers. A pixel is at most [`TOLERANCE`] times the
/// fourth brightest of the 3 × 3 pixels of both halves, or times the same pixel of the other half where that confirms
/// it, whatever is more. Lamps are never outliers.
///
/// Two halves that are bright at one pixel show a highlight, unless chance explains it. Where many pixels of each half
/// are bright, as by caustics, some are bright in both. If a of n pixels are bright in one half and b in the other one,
/// chance makes m = ab/n bright in both on average. The standard deviation of such rare events is √m (Poisson).
pub(super) fn lowering(source: &Source<'_>) -> [Plane; 2] {
    let size = source.size;
    let mut factors = [0, 1].map(|_| Plane::of(size, |_| 1.0));
    if !source.has_halves {
        return factors;
    }
    let limits = limits(source);
    let largest = |half: usize, i: usize| source.color(half, i).into_iter().fold(0.0, f32::max);
    let is_bright = |half: usize, i: usize| largest(half, i) > limits.values[i];
    let share = |is_in: &(dyn Fn(usize) -> bool + Sync)| {
        Plane::of(size, |i| if is_in(i) { 1.0 } else { 0.0 }).box_mean(CHANCE_RADIUS)
    };
    let n = ((2 * CHANCE_RADIUS + 1) * (2 * CHANCE_RADIUS + 1)).min(size[0] * size[1]) as f32;
    let (a, b) = (share(&|i| is_bright(0, i)), share(&|i| is_bright(1, i)));
    let both = share(&|i| is_bright(0, i) && is_bright(1, i));
    let is_confirmed = |i: usize| {
        let chance = a.values[i] * b.values[i];
        both.values[i] > chance + DEVIATIONS * (chance / n).sqrt()
    };
    for (half, factors) in factors.iter_mut().enumerate() {
        factors.fill(|i| {
            let (value, limit) = (largest(half, i), limits.values[i]);
            let other = TOLERANCE * largest(1 - half, i);
            let limit = if other > limit && is_confirmed(i) { other } else { limit };
            if value > limit { limit / value } else { 1.0 }
        });
    }
    factors
}

/// The most light that the 3 × 3 pixels of both halves confirm. It is infinite where they can't judge.
fn limits(source: &Source<'_>) -> Plane {
    let mut limits = Plane::new(source.size);
    strips([&mut limits]).into_par_iter().for_each(|strip| {
        for part in strip.parts(source.size) {
            let largest = |v: [f32; 3]| v[0].max(v[1]).max(v[2]);
            let [a, b, albedo, inside] = &part.windows(1, |i| {
                [largest(source.color(0, i)), largest(source.color(1, i)), largest(source.albedo(i)), 1.0]
            });
            for y in 0..part.size[1] {
                for (x, limit) in strip.rows[0][part.row(y)].iter_mut().enumerate() {
                    let is_judged = is_judged(albedo, inside, x, y);
                    *limit = if is_judged { TOLERANCE * fourth_largest([a, b], inside, x, y) } else { f32::INFINITY };
                }
            }
        }
    });
    limits
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

/// The fourth brightest of the 3 × 3 pixels of both halves, which are 18; at the picture's edges the same share of
/// them.
fn fourth_largest(halves: [&Window; 2], inside: &Window, x: usize, y: usize) -> f32 {
    let (mut values, mut count) = ([0.0; 18], 0);
    for v in halves.into_iter().flat_map(|half| half.neighbors(inside, x, y)) {
        values[count] = v;
        count += 1;
    }
    *values[..count].select_nth_unstable_by(count - (4 * count).div_ceil(18), f32::total_cmp).1
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
    rows.collect().iter().sum()
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
