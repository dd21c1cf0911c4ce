//! The hash behind all random numbers.

/// A mixing bijection of 64 bits (Stafford's variant 13 of MurmurHash3's finaliser, as in SplitMix64). It adds an odd
/// constant first so that 0 isn't a fixed point.
#[inline(always)]
pub(super) const fn mix(value: u64) -> u64 {
    let mut x = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The leading bits as a number in [0, 1).
#[inline]
pub(super) fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}
