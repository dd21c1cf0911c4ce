//! The chapter's jittered grid (fig. 5.36) for any number of samples and dimensions. Each sample has a cell of its own
//! and a random place in it.
//!
//! Each dimension assigns the cells in a different random order (after Kensler, *Correlated Multi-Jittered Sampling*,
//! 2013, §3). Otherwise a sample low in the pixel would always see a low part of the light.

use super::hash::{mix, unit};

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A number in one of `count` equal strata, one for each sample.
pub(super) fn one(index: u32, count: u32, key: u64) -> f64 {
    place(permute(index, count, key), unit(mix(key ^ u64::from(index))), count)
}

/// A point in a grid that is as square as possible. Where `count` isn't a product of two near numbers, some random
/// cells stay empty, so that no part of the square is preferred.
pub(super) fn two(index: u32, count: u32, key: u64) -> [f64; 2] {
    let across = count.isqrt().max(1);
    let up = count.div_ceil(across);
    let cell = permute(index, across * up, key);
    let jitter = mix(key ^ u64::from(index));
    [place(cell % across, unit(jitter), across), place(cell / across, unit(mix(jitter)), up)]
}

fn place(cell: u32, jitter: f64, cells: u32) -> f64 {
    ((f64::from(cell) + jitter) / f64::from(cells)).min(BELOW_ONE)
}

/// The position of `index` in a random order of 0..count.
fn permute(index: u32, count: u32, key: u64) -> u32 {
    if count < 2 {
        return 0;
    }
    let bits = 32 - (count - 1).leading_zeros();
    let mask = u32::MAX >> (32 - bits);
    let half = bits.div_ceil(2);
    // A bijection on the necessary number of bits is repeated until the number is below `count`. This is a random walk
    // along a cycle, of fewer than two steps in the mean. Few bits are mixed badly; the random start of the order still
    // makes every position equally likely.
    let start = ((u64::from(mix(!key) as u32) * u64::from(count)) >> 32) as u32;
    let mut x = ((u64::from(index) + u64::from(start)) % u64::from(count)) as u32;
    loop {
        let mut keys = key;
        for _ in 0..3 {
            keys = mix(keys);
            x = x.wrapping_add(keys as u32) & mask;
            x = x.wrapping_mul((keys >> 32) as u32 | 1) & mask;
            x ^= x >> half;
        }
        if x < count {
            return x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_one_sample() {
        for count in [1, 2, 3, 7, 16, 100, 1000] {
            for key in 0..20 {
                let mut seen = vec![false; count as usize];
                (0..count).for_each(|i| seen[permute(i, count, key) as usize] = true);
                assert!(seen.into_iter().all(|s| s), "{count} {key}");
            }
        }
    }

    /// Each index has each position equally often: χ² over the positions of every index, 24 degrees of freedom each,
    /// 99.9 % of which lie below 51.2.
    #[test]
    fn orders_are_random() {
        let (count, keys) = (25, 5000);
        let mut worst = 0f64;
        for index in 0..count {
            let mut cells = vec![0u32; count as usize];
            (0..keys).for_each(|key| cells[permute(index, count, mix(key)) as usize] += 1);
            let expected = keys as f64 / f64::from(count);
            worst = worst.max(cells.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum());
        }
        assert!(worst < 60.0, "{worst}");
    }
}
