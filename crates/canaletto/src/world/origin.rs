//! Where coordinates are counted from.
//!
//! Rays and surfaces are `f32`, which has 24 bits. Meshes and clouds whose coordinates all lie far from zero are
//! therefore counted from a point among them, which their instance's transform takes back in `f64`.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The least and the largest coordinates of some points.
pub(super) type Span = [DVec3; 2];

/// The span of all these points.
pub(super) fn span(points: &[Vec3]) -> Span {
    let none = || [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let join = |a: [Vec3; 2], b: [Vec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    points.par_iter().fold(none, |all, p| join(all, [*p, *p])).reduce(none, join).map(Vec3::as_dvec3)
}

/// A point near the middle of the span if its coordinates are more than `far` times as large as its sides; zero along axes
/// where they aren't. It is a multiple of a power of two, so that differences of `f32` from it are exact.
pub(super) fn origin_of([min, max]: Span, far: f64) -> DVec3 {
    let size = (max - min).max_element();
    if !(size.is_finite() && size > 0.0) {
        return DVec3::ZERO;
    }
    let step = libm::exp2(libm::ceil(libm::log2(size)));
    let middle = (min + max) * 0.5;
    if middle.abs().max_element() <= far * step {
        return DVec3::ZERO;
    }
    (middle / step).round() * step
}
