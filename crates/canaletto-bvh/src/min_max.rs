//! The larger and the smaller of two numbers, in one instruction each.

/// The larger number of one of the two float types, in one instruction, unlike `f32::max`, so that loops are
/// vectorised. If one is NaN, the second is returned.
#[inline(always)]
pub fn max<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The smaller number of one of the two float types, in one instruction, unlike `f32::min`, so that loops are
/// vectorised. If one is NaN, the second is returned.
#[inline(always)]
pub fn min<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}
