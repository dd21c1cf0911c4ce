//! The error bound of edge functions in f32.

use std::ops::{Add, Mul};

use glam::{Vec3, Vec4};

use super::triangle::{DEGENERATE, UNDERFLOW};
use crate::min_max::max;
use crate::simd::{Instructions, Vector};
use crate::{Aabb, PreparedRay};

/// A bound on the rounding error of the edge functions of a ray and the triangles of a tree.
///
/// Let u = 2⁻²⁴, and let no corner be farther from the origin than D along any axis. A sheared coordinate is wrong by
/// at most δ = 6 u D. Of this, u D is for the difference and 3 u D for the shear times another difference. The rest is
/// u times the result, which is at most 2 D.
///
/// If the ray hits the triangle, the sheared origin lies between the corners. The coordinates in the edge functions are
/// then not larger than M, twice the triangle's size. The edge functions are wrong by at most 4 δ (M + δ) for the
/// coordinates and 4 u (M + δ)² for the products. The sum is below 64 u D size + 200 u² D².
///
/// If the ray misses the triangle at a distance, the edge functions may be wrong by more. But they never all have one
/// sign, since rounding is monotone: a difference of rounded products is not above 0 where the difference of the
/// products isn't. This is not true of a fused product and difference, so packets fuse it only where a test can
/// conclude nothing but misses. Packets also fuse the shear where the machine can. A fused shear moves a corner by
/// less, and to one place for both of its edges.
///
/// The bound has a quarter more than that, and what underflow may have taken. Where something overflows, so does the
/// bound.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeError<N = f32> {
    /// The distance D.
    reach: N,
    scale: N,
    least: N,
    /// The exact test can't take an area and a volume above these bounds for degenerate. The bounds cover 2⁻⁴⁰ times
    /// powers of D, and more than rounding may add.
    pub(crate) area: N,
    pub(crate) volume: N,
}

/// The factors of D in the bounds: one for the scale, two for the constant part, and one each for area and volume.
const FACTORS: [f32; 5] =
    [40.0 * f32::EPSILON, 8.0 * f32::EPSILON, 4.0 * UNDERFLOW, 16.0 / (1u64 << 34) as f32, 1.0 / (1u64 << 38) as f32];

impl<N: Copy + Add<Output = N> + Mul<Output = N>> EdgeError<N> {
    /// The bound for D. D is one number or a vector, as are [`FACTORS`] and the smallest normal number.
    #[inline(always)]
    fn with(reach: N, [scale, a, b, area, volume]: [N; 5], least: N, max: fn(N, N) -> N) -> Self {
        let scale = reach * scale;
        Self {
            reach,
            scale,
            least: scale * (reach * a) + (reach * b + least),
            // Infinity, where a product may overflow.
            area: max(reach * reach * area, least),
            volume: max(reach * reach * reach * volume, least),
        }
    }

    /// The error bound for edge functions of triangles of this size.
    #[inline(always)]
    pub(crate) fn error(self, size: N) -> N {
        size * self.scale + self.least
    }
}

impl EdgeError {
    /// The bound for triangles within a box.
    #[inline(always)]
    pub(crate) fn new(ray: &PreparedRay, bounds: &Aabb) -> Self {
        Self::within(ray.ray.origin, ray.ray.origin, bounds)
    }

    /// The bound for triangles within a box and rays whose origins lie between two corners.
    #[inline(always)]
    pub(crate) fn within(low: Vec3, high: Vec3, bounds: &Aabb) -> Self {
        let reach = |axis: usize| max(bounds.max[axis] - low[axis], high[axis] - bounds.min[axis]).abs();
        Self::with(max(max(reach(0), reach(1)), reach(2)), FACTORS, f32::MIN_POSITIVE, max)
    }

    /// The bounds of area and volume in f64, for all rays and triangles. `triangle::intersect_exactly` has them for a
    /// single one.
    #[inline(always)]
    pub(crate) fn degenerate_bounds(self) -> (f64, f64) {
        let reach = f64::from(self.reach);
        (reach * reach * DEGENERATE, reach * reach * reach * DEGENERATE)
    }

    /// The bound, copied to all lanes of a vector.
    #[inline(always)]
    pub(crate) fn splat<S: Instructions>(self, s: S) -> EdgeError<S::Vector> {
        EdgeError {
            reach: s.splat(self.reach),
            scale: s.splat(self.scale),
            least: s.splat(self.least),
            area: s.splat(self.area),
            volume: s.splat(self.volume),
        }
    }
}

impl EdgeError<Vec4> {
    /// The bound for triangles side by side, none of whose corners is farther from the origin than `reach`.
    #[inline(always)]
    pub(super) fn of_triangles(reach: Vec4) -> Self {
        let [scale, a, b, area, volume] = FACTORS;
        let splat = Vec4::splat;
        let factors = [splat(scale), splat(a), splat(b), splat(area), splat(volume)];
        Self::with(reach, factors, splat(f32::MIN_POSITIVE), Vec4::max)
    }
}

impl<N: Vector> EdgeError<N> {
    /// The bound for rays side by side, where no corner is farther from an origin than `reach`.
    #[inline(always)]
    pub(crate) fn of_rays<S: Instructions<Vector = N>>(s: S, reach: N) -> Self {
        let [scale, a, b, area, volume] = FACTORS;
        let factors = [s.splat(scale), s.splat(a), s.splat(b), s.splat(area), s.splat(volume)];
        Self::with(reach, factors, s.splat(f32::MIN_POSITIVE), N::max)
    }
}
