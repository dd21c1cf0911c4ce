//! The first two dimensions of Sobol's sequence with Owen's scrambling.
//!
//! Direction numbers: Joe & Kuo, *Constructing Sobol sequences with better two-dimensional projections* (2008),
//! `new-joe-kuo-6`. Scrambling by hashing: Burley, *Practical Hash-based Owen Scrambling* (JCGT 9(4), 2020), after
//! Laine & Karras 2011. The constants are Vegdahl's, which scramble better (*Building a Better LK Hash*, 2021).
//!
//! Each bit of the scrambling hash depends only on the higher bits, which keeps all nets of the sequence. In a net of
//! 2^m points, each of 2^m equal boxes of any shape holds exactly one point. Every use takes these two dimensions with
//! another order of the points (Burley's padding), which is a scrambling of the index. The sequence's further
//! dimensions would be distributed jointly with the first, but their pairs are worse nets. For the two numbers of a
//! lens the error of 256 samples was a fifth larger.

use super::hash::mix;

/// Point `index` of the sequence scrambled by `key`, in the first N ≤ 2 dimensions.
pub(super) fn points<const N: usize>(index: u32, key: u64) -> [f64; N] {
    let index = scramble(index.reverse_bits(), key).reverse_bits();
    let mut seed = key;
    std::array::from_fn(|dimension| {
        seed = mix(seed);
        fraction(scramble(digits(index, dimension), seed))
    })
}

/// A single number.
pub(super) fn one(index: u32, key: u64) -> f64 {
    points::<1>(index, key)[0]
}

/// Point `index` in a dimension, the first digit in bit 0. The first dimension is van der Corput's sequence. In the
/// second, digit j is the sum of those digits i of the index for which the binomial coefficient of i over j is odd. It
/// is odd where i has all bits of j (Lucas). So the matrix is a power of its upper left quarter of two by two, and five
/// steps suffice.
fn digits(index: u32, dimension: usize) -> u32 {
    const STEPS: [(u32, u32); 5] =
        [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)];
    let steps = if dimension == 0 { &[] } else { STEPS.as_slice() };
    steps.iter().fold(index, |point, &(shift, without)| point ^ point >> shift & without)
}

/// Owen's scrambling of digits whose first is bit 0. Every bit is flipped, or not, depending on the lower bits and the
/// seed.
fn scramble(mut x: u32, seed: u64) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed as u32);
    x = x.wrapping_mul((seed >> 32) as u32 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

fn fraction(digits: u32) -> f64 {
    f64::from(digits.reverse_bits()) * (1.0 / (1u64 << 32) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the first points published with the direction numbers, in the sequence's own order (not Gray
    /// code's).
    #[test]
    fn the_sequence_is_sobols() {
        let expected = [
            [0.0, 0.0],
            [0.5, 0.5],
            [0.25, 0.75],
            [0.75, 0.25],
            [0.125, 0.625],
            [0.625, 0.125],
            [0.375, 0.375],
            [0.875, 0.875],
        ];
        for (index, point) in expected.iter().enumerate() {
            let ours: [f64; 2] = std::array::from_fn(|d| fraction(digits(index as u32, d)));
            assert_eq!(&ours, point, "{index}");
        }
    }

    #[test]
    fn the_second_dimension_is_that_of_its_direction_numbers() {
        // Degree s = 1, a = 0 and m = 1: every number is the one before, xor its half. The first digit after the point
        // is bit 31.
        let directions: Vec<u32> = std::iter::successors(Some(1u32 << 31), |v| Some(v ^ v >> 1)).take(32).collect();
        let sum = |index: u32| {
            let numbers = directions.iter().enumerate().filter(|(bit, _)| index >> bit & 1 == 1);
            numbers.fold(0, |sum, (_, v)| sum ^ v)
        };
        let indices = (0..5000).map(|n| if n < 1000 { n } else { mix(u64::from(n)) as u32 });
        for index in indices.chain([u32::MAX]) {
            assert_eq!(digits(index, 1).reverse_bits(), sum(index), "{index:x}");
        }
    }

    /// Counts the points in every box of volume 2^-m: one in each.
    #[test]
    fn every_prefix_of_a_power_of_two_is_a_net() {
        for key in [1, 77, 0xdead_beef_0123_4567] {
            for m in 0..=10u32 {
                for shift in 0..=m {
                    let (across, up) = (1u32 << shift, 1u32 << (m - shift));
                    let mut boxes = vec![0; 1 << m];
                    for index in 0..1 << m {
                        let [x, y] = points(index, key).map(|u: f64| u);
                        let column = (x * f64::from(across)) as u32;
                        let row = (y * f64::from(up)) as u32;
                        boxes[(row * across + column) as usize] += 1;
                    }
                    assert!(boxes.iter().all(|&n| n == 1), "key {key}: {across} x {up}");
                }
            }
        }
    }

    /// Owen's scrambling flips each digit of each point at random: over many seeds every digit is 1 half of the time,
    /// and independent of the digit before it.
    #[test]
    fn digits_are_turned_independently() {
        let seeds = 20_000u32;
        for point in [0u32, 1, 0x8000_0001, 0x1234_5678, u32::MAX] {
            let mut ones = [0u32; 32];
            let mut changes = [0u32; 31];
            for seed in 0..seeds {
                let x = scramble(point, mix(u64::from(seed)));
                for (bit, n) in ones.iter_mut().enumerate() {
                    *n += (x >> bit) & 1;
                }
                for (bit, n) in changes.iter_mut().enumerate() {
                    *n += ((x >> bit) ^ (x >> (bit + 1))) & 1;
                }
            }
            // Five standard deviations of a fair coin.
            let bound = 5.0 * 0.5 * f64::from(seeds).sqrt();
            for &n in ones.iter().chain(&changes) {
                assert!((f64::from(n) - f64::from(seeds) / 2.0).abs() < bound, "{point:x}: {ones:?} {changes:?}");
            }
        }
    }
}
