//! Larger and smaller numbers in one instruction, so that loops with them are vectorised, unlike with `f32::max`.

/// The larger of two numbers, or the second if one is NaN.
#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller of two numbers, or the second if one is NaN.
#[inline(always)]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
