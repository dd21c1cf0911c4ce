//! Sobol's sequence in the order of the picture's pixels, so that errors of neighbours differ (Ahmed & Wonka,
//! *Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels*, 2020).
//!
//! All pixels share one sequence. Pixels follow each other along Morton's curve, each with a run of successive points.
//! Then 4, 16, ... pixels of a square have a longer run, which is a net: their points complete each other. What one
//! pixel has too much of, its neighbours have too little of. The picture's error is as large as ever, but fine-grained.
//!
//! The curve's quadrants are permuted at random on each level, for each use of numbers in another way. It is the order
//! of `ZSobolSampler` in pbrt-v4, with runs of any power of two.

use super::hash::mix;
use super::sobol::scrambled_point;

/// The 24 orders of four things, two bits each.
const ORDERS: [u8; 24] = orders();

const fn orders() -> [u8; 24] {
    let mut orders = [0; 24];
    let (mut found, mut code) = (0, 0u32);
    while code < 256 {
        let digits = [code & 3, code >> 2 & 3, code >> 4 & 3, code >> 6];
        if 1 << digits[0] | 1 << digits[1] | 1 << digits[2] | 1 << digits[3] == 15 {
            orders[found] = code as u8;
            found += 1;
        }
        code += 1;
    }
    orders
}

/// The place of a pixel on Morton's curve. Columns and rows count modulo 2¹⁶.
pub(super) fn morton([x, y]: [u32; 2]) -> u32 {
    let spread = |v: u32| {
        const STEPS: [(u32, u32); 4] = [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)];
        STEPS.iter().fold(v & 0xffff, |v, (shift, mask)| (v | v << shift) & mask)
    };
    spread(x) | spread(y) << 1
}

/// Point `index` of `count` of the pixel at this place of the curve, in the first N ≤ 2 dimensions.
pub(super) fn points<const N: usize>(place: u32, index: u32, count: u32, key: u64) -> [f64; N] {
    // Runs have a power of two of points.
    let bits = u32::BITS - count.saturating_sub(1).leading_zeros();
    let place = u64::from(place) << bits | u64::from(index);
    scrambled_point(in_order(place, bits, key), key)
}

/// The number of a point after the permutation of quadrants, of which the lowest `bits` are within a pixel.
fn in_order(place: u64, bits: u32, key: u64) -> u64 {
    // An odd number of bits within a pixel has a lowest digit of one bit.
    let odd = bits & 1;
    let mut order = if odd == 1 { (place ^ mix(key ^ (place >> 1)) >> 63) & 1 } else { 0 };
    for level in 0..(32 + bits - odd) / 2 {
        let shift = 2 * level + odd;
        let above = place >> (shift + 2);
        let permutation = ORDERS[(mix(key ^ mix(above << 6 | u64::from(level))) >> 32) as usize % 24];
        let digit = place >> shift & 3;
        order |= u64::from(permutation >> (2 * digit) & 3) << shift;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_all_orders() {
        let mut all = ORDERS.to_vec();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 24);
        assert_eq!((morton([3, 0]), morton([0, 3]), morton([5, 9])), (5, 10, 0b1001_0011));
    }

    /// The run of each square of pixels is a net: one point in each box.
    #[test]
    fn squares_of_pixels_share_a_net() {
        for (samples, side) in [(1u32, 8u32), (4, 4), (16, 2), (2, 4), (8, 1)] {
            for corner in [[0, 0], [side, 0], [5 * side, 3 * side]] {
                let total = samples * side * side;
                let bits = total.ilog2();
                for across in 0..=bits {
                    let (columns, rows) = (1u32 << across, 1u32 << (bits - across));
                    let mut boxes = vec![0; total as usize];
                    for pixel in 0..side * side {
                        let place = morton([corner[0] + pixel % side, corner[1] + pixel / side]);
                        for index in 0..samples {
                            let [u, v]: [f64; 2] = points(place, index, samples, 77);
                            boxes[((v * f64::from(rows)) as u32 * columns + (u * f64::from(columns)) as u32)
                                as usize] += 1;
                        }
                    }
                    assert!(boxes.iter().all(|n| *n == 1), "{samples} samples, {columns} x {rows}: {boxes:?}");
                }
            }
        }
    }

    /// Errors of an integral over the unit square, for each pixel of a picture.
    fn errors(samples: u32, two: impl Fn([u32; 2], u32) -> [f64; 2]) -> Vec<f64> {
        let f = |[u, v]: [f64; 2]| if (u - 0.5) * (u - 0.5) + (v - 0.4) * (v - 0.4) < 0.09 { 1.0 } else { u * v };
        let mut values: Vec<f64> = (0..64 * 64)
            .map(|pixel| (0..samples).map(|i| f(two([pixel % 64, pixel / 64], i))).sum::<f64>() / f64::from(samples))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        values
    }

    /// The root of the mean square of a picture of 64 × 64 pixels, after a Gaussian blur of σ = 2 pixels, or without
    /// it.
    fn deviation(errors: &[f64], blurred: bool) -> f64 {
        let weights: Vec<f64> = (-8..=8).map(|d: i32| libm::exp(-0.125 * f64::from(d * d))).collect();
        let sum: f64 = weights.iter().sum();
        let at = |x: i32, y: i32| errors[(y.rem_euclid(64) * 64 + x.rem_euclid(64)) as usize];
        let mut squares = 0.0;
        for y in 0..64 {
            for x in 0..64 {
                let value = if blurred {
                    let row = |y: i32| (-8..=8).map(|d| weights[(d + 8) as usize] * at(x + d, y)).sum::<f64>();
                    (-8..=8).map(|d| weights[(d + 8) as usize] * row(y + d)).sum::<f64>() / (sum * sum)
                } else {
                    at(x, y)
                };
                squares += value * value;
            }
        }
        (squares / errors.len() as f64).sqrt()
    }

    /// Seen from afar, the picture's error is smaller than with points of each pixel's own. From near it is no larger.
    #[test]
    fn errors_of_neighbours_cancel() {
        use crate::sampler::{Dimension, FrameSampler};
        use crate::scene::SamplerKind;
        for samples in [1, 4, 16] {
            let [blue, white] = [SamplerKind::BlueNoise, SamplerKind::Sobol].map(|kind| {
                let frame = FrameSampler::new(5, 0, kind);
                let errors =
                    errors(samples, |pixel, i| frame.pixel(pixel).sample(i, samples).two(Dimension::EYE.of(9)));
                [deviation(&errors, false), deviation(&errors, true)]
            });
            println!(
                "{samples} samples: error {:.4} and {:.4}, blurred {:.5} and {:.5}",
                blue[0], white[0], blue[1], white[1]
            );
            assert!(blue[0] < 1.3 * white[0], "{samples}: {blue:?} {white:?}");
            assert!(blue[1] < 0.8 * white[1], "{samples}: {blue:?} {white:?}");
        }
    }
}
