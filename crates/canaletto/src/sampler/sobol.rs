//! The first four dimensions of Sobol's sequence with Owen's scrambling.
//!
//! Direction numbers: Joe & Kuo, *Constructing Sobol sequences with better two-dimensional projections* (2008),
//! `new-joe-kuo-6`. Scrambling by hashing: Burley, *Practical Hash-based Owen Scrambling* (JCGT 9(4), 2020), after
//! Laine & Karras 2011. The constants are Vegdahl's, which scramble better (*Building a Better LK Hash*, 2021).
//!
//! Each bit of the scrambling hash depends only on the higher bits, which keeps all nets of the sequence. In a net of
//! 2^m points, each of 2^m equal boxes of any shape holds exactly one point. Every use in a picture takes the first two
//! dimensions with another order of the points (Burley's padding), which is a scrambling of the index. The sequence's
//! further dimensions would be distributed jointly with the first, but their pairs are worse nets. For the two numbers
//! of a lens the error of 256 samples was a fifth larger. Integrals of exactly four dimensions use [`joint`] points. A
//! choice with a point, as of a light or a lobe, uses [`three`]: with numbers of its own for the choice, the variance
//! was 1.6 times as large under a sky, and equal in rooms with one lamp.

use super::hash::mix;

/// Point `index` of the sequence scrambled by `key`, in the first N ≤ 2 dimensions.
#[inline(always)]
pub(super) fn points<const N: usize>(index: u32, key: u64) -> [f64; N] {
    let index = scramble(index.reverse_bits(), key).reverse_bits();
    let mut seed = key;
    std::array::from_fn(|dimension| {
        seed = mix(seed);
        fraction(scramble(digits(index, dimension), seed))
    })
}

/// Point `index` of the first three dimensions, in the order of [`points`], whose two are the first two of these. All
/// three are distributed jointly.
#[inline(always)]
pub(super) fn three(index: u32, key: u64) -> [f64; 3] {
    let [u, v] = points(index, key);
    let index = scramble(index.reverse_bits(), key).reverse_bits();
    [u, v, fraction(scramble(THIRD_SUMS.digits(index), mix(mix(mix(key)))))]
}

/// Point `index` of the sequence itself, of up to 64 digits, scrambled by `key` in the first N ≤ 2 dimensions.
pub(super) fn scrambled_point<const N: usize>(index: u64, key: u64) -> [f64; N] {
    let mut seed = key;
    std::array::from_fn(|dimension| {
        seed = mix(seed);
        // In the second dimension digits of the index beyond the 32nd change the first digits of the point, too.
        let long = if dimension == 0 { 0 } else { digits((index >> 32) as u32, dimension) };
        fraction(scramble(digits(index as u32, dimension) ^ long, seed))
    })
}

/// Point `index` of the sequence's first four dimensions, each scrambled by `key`. The four are distributed jointly,
/// which integrals over exactly four dimensions need.
pub(super) fn joint(index: u32, key: u64) -> [f64; 4] {
    let mut seed = key;
    std::array::from_fn(|dimension| {
        seed = mix(seed);
        let digits = match dimension {
            0 | 1 => digits(index, dimension),
            2 => THIRD_SUMS.digits(index),
            _ => FOURTH_SUMS.digits(index),
        };
        fraction(scramble(digits, seed))
    })
}

/// The direction numbers of the third dimension: degree s = 2, a = 1, m = 1, 3.
const THIRD: [u32; 32] = directions(2, 1, [1, 3, 0]);
/// The direction numbers of the fourth dimension: degree s = 3, a = 1, m = 1, 3, 1.
const FOURTH: [u32; 32] = directions(3, 1, [1, 3, 1]);

static THIRD_SUMS: ByteSums = ByteSums::of(&THIRD);
static FOURTH_SUMS: ByteSums = ByteSums::of(&FOURTH);

/// The direction numbers of a primitive polynomial of degree `s` with the inner coefficients `a`, and the first ones m.
/// The first digit is bit 0.
const fn directions(s: usize, a: u32, m: [u32; 3]) -> [u32; 32] {
    let mut v = [0u32; 32];
    let mut i = 0;
    while i < 32 {
        if i < s {
            v[i] = m[i] << (31 - i);
        } else {
            v[i] = v[i - s] ^ v[i - s] >> s;
            let mut k = 1;
            while k < s {
                if a >> (s - 1 - k) & 1 == 1 {
                    v[i] ^= v[i - k];
                }
                k += 1;
            }
        }
        i += 1;
    }
    let mut i = 0;
    while i < 32 {
        v[i] = v[i].reverse_bits();
        i += 1;
    }
    v
}

/// For each byte of an index, and each value of that byte, the sum of its direction numbers.
struct ByteSums([[u32; 256]; 4]);

impl ByteSums {
    const fn of(directions: &[u32; 32]) -> ByteSums {
        let mut sums = [[0; 256]; 4];
        let mut byte = 0;
        while byte < 4 {
            let mut value = 1usize;
            while value < 256 {
                let lowest = value & value.wrapping_neg();
                sums[byte][value] =
                    sums[byte][value ^ lowest] ^ directions[8 * byte + lowest.trailing_zeros() as usize];
                value += 1;
            }
            byte += 1;
        }
        ByteSums(sums)
    }

    /// Point `index` in the dimension of the direction numbers, the first digit in bit 0.
    #[inline(always)]
    fn digits(&self, index: u32) -> u32 {
        let [a, b, c, d] = &self.0;
        a[(index & 255) as usize]
            ^ b[(index >> 8 & 255) as usize]
            ^ c[(index >> 16 & 255) as usize]
            ^ d[(index >> 24) as usize]
    }
}

/// A single number.
#[inline(always)]
pub(super) fn one(index: u32, key: u64) -> f64 {
    let index = scramble(index.reverse_bits(), key).reverse_bits();
    fraction(scramble(digits(index, 0), mix(key)))
}

/// Point `index` in a dimension, the first digit in bit 0. The first dimension is van der Corput's sequence. In the
/// second, digit j is the sum of those digits i of the index for which the binomial coefficient of i over j is odd. It
/// is odd where i has all bits of j (Lucas). So the matrix is a power of its upper left quarter of two by two, and five
/// steps suffice.
#[inline(always)]
fn digits(index: u32, dimension: usize) -> u32 {
    if dimension == 0 {
        return index;
    }
    let point = index ^ index >> 1 & 0x5555_5555;
    let point = point ^ point >> 2 & 0x3333_3333;
    let point = point ^ point >> 4 & 0x0f0f_0f0f;
    let point = point ^ point >> 8 & 0x00ff_00ff;
    point ^ point >> 16 & 0x0000_ffff
}

/// Owen's scrambling of digits whose first is bit 0. Every bit is flipped, or not, depending on the lower bits and the
/// seed.
#[inline(always)]
fn scramble(mut x: u32, seed: u64) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed as u32);
    x = x.wrapping_mul((seed >> 32) as u32 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

#[inline(always)]
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

    /// The first points published with the direction numbers.
    #[test]
    fn the_third_and_fourth_dimension_are_sobols() {
        let expected = [
            [0.0, 0.0],
            [0.5, 0.5],
            [0.25, 0.25],
            [0.75, 0.75],
            [0.625, 0.875],
            [0.125, 0.375],
            [0.875, 0.625],
            [0.375, 0.125],
        ];
        for (index, point) in (0u32..).zip(expected) {
            // They are published in the order of Gray's code.
            let index = index ^ index >> 1;
            assert_eq!([&THIRD_SUMS, &FOURTH_SUMS].map(|sums| fraction(sums.digits(index))), point, "{index}");
        }
    }

    /// Each pair of dimensions is spread far more evenly than random points, and each dimension is a net.
    #[test]
    fn joint_points_are_even() {
        let (m, key) = (12, 5);
        let points: Vec<[f64; 4]> = (0..1 << m).map(|index| joint(index, key)).collect();
        for dimension in 0..4 {
            let mut cells = vec![0; 1 << m];
            points.iter().for_each(|p| cells[(p[dimension] * f64::from(1 << m)) as usize] += 1);
            assert!(cells.iter().all(|&n| n == 1), "dimension {dimension}");
        }
        // 8 × 8 × 8 × 8 boxes with one point each on average: 63 % would have one if the points were random.
        let mut boxes = vec![0u32; 1 << m];
        for p in &points {
            boxes[p.iter().fold(0, |index, x| index * 8 + (x * 8.0) as usize)] += 1;
        }
        let filled = boxes.iter().filter(|&&n| n > 0).count() as f64 / f64::from(1 << m);
        assert!(filled > 0.7, "{filled}");
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
