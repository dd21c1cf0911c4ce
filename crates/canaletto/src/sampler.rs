//! Random numbers without a state: each is a hash of where it is used, so that tiles can be rendered in any order.

/// A source of numbers keyed by (seed, frame, pixel, sample, dimension).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    key: u64,
}

impl Sampler {
    /// The source for one pixel of one frame.
    pub fn new(seed: u64, frame: u32, pixel: [u32; 2]) -> Sampler {
        let position = u64::from(pixel[0]) << 32 | u64::from(pixel[1]);
        Sampler { key: mix(mix(mix(seed) ^ u64::from(frame)) ^ position) }
    }

    /// A number in [0, 1), uniform, for this use of the sample.
    pub fn uniform(&self, sample: u32, dimension: u32) -> f64 {
        let bits = mix(self.key ^ (u64::from(sample) << 32 | u64::from(dimension)));
        (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

/// A bijection of 64 bits that scatters its input (Stafford's variant 13 of MurmurHash3's finaliser, as in SplitMix64),
/// after adding its odd constant so that 0 isn't a fixed point.
fn mix(value: u64) -> u64 {
    let mut x = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_over_every_key() {
        // χ² over 64 cells with 63 degrees of freedom: 99.9 % lie below 103.4.
        for vary in 0..4 {
            let mut cells = [0u32; 64];
            for i in 0..64_000u32 {
                let at = |k: usize| if k == vary { i } else { 7 };
                let value = Sampler::new(3, 0, [at(0), at(1)]).uniform(at(2), at(3));
                cells[(value * 64.0) as usize] += 1;
            }
            let chi2: f64 = cells.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
            assert!(chi2 < 103.4, "varying key {vary}: {chi2}");
        }
    }

    #[test]
    fn keys_do_not_share_numbers() {
        let a = Sampler::new(1, 2, [3, 4]);
        for b in [Sampler::new(2, 2, [3, 4]), Sampler::new(1, 3, [3, 4]), Sampler::new(1, 2, [4, 3])] {
            assert_ne!(a.uniform(0, 0), b.uniform(0, 0));
        }
        assert_ne!(a.uniform(0, 1), a.uniform(1, 0));
    }
}
