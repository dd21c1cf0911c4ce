//! What f32 may be wrong by.

use std::ops::{Add, Mul};

use glam::{Vec3, Vec4};

use super::triangle::{SURELY, UNDERFLOW};
use crate::simd::{Instructions, Vector};
use crate::slab::max;
use crate::{Aabb, PreparedRay};

/// How far rounding may take the edge functions of a ray and a tree's triangles.
///
/// With u = 2⁻²⁴ and no corner farther from the origin than D along any axis, a sheared coordinate is wrong by at most δ = 6 u D: u D for the
/// difference, 3 u D for the shear times another, and u times the result, which is at most 2 D. The
/// edge functions of a triangle that the ray meets are made of coordinates not larger than M, twice the triangle's size, since their
/// origin lies between them; so they are wrong by at most 4 δ (M + δ) for the coordinates and 4 u (M + δ)² for the
/// products, which is below 64 u D size + 200 u² D². Of a triangle that the ray doesn't meet, they may be wrong by more if the ray passes it
/// at a distance; but they never have one sign, since rounding is monotone: a difference of rounded products is not above 0 where the products'
/// difference isn't. (Of a fused product and difference this would not be true: packets use one where only misses are told. That of the shear, which they fuse
/// where the machine can, moves a corner by less, and to one place for both of its edges.)
/// The bound has a quarter more, and what underflow may have taken; where something overflows, so does the bound.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeError<N = f32> {
    /// D.
    reach: N,
    scale: N,
    least: N,
    /// Areas above it, and volumes above the other, are none that the exact test might take for degenerate: 2⁻⁴⁰ times powers of D, and
    /// more than what rounding may add.
    pub(crate) area: N,
    pub(crate) volume: N,
}

/// What makes a bound of D: that of the scale, two of the least bound, those of area and volume.
const FACTORS: [f32; 5] =
    [40.0 * f32::EPSILON, 8.0 * f32::EPSILON, 4.0 * UNDERFLOW, 16.0 / (1u64 << 34) as f32, 1.0 / (1u64 << 38) as f32];

impl<N: Copy + Add<Output = N> + Mul<Output = N>> EdgeError<N> {
    /// For D, one for all or for each lane, as are [`FACTORS`] and the least number.
    #[inline(always)]
    fn with(reach: N, [scale, a, b, area, volume]: [N; 5], least: N, max: fn(N, N) -> N) -> Self {
        let scale = reach * scale;
        Self {
            reach,
            scale,
            least: scale * (reach * a) + (reach * b + least),
            // ∞, where a product may overflow.
            area: max(reach * reach * area, least),
            volume: max(reach * reach * reach * volume, least),
        }
    }

    /// By how much edge functions of triangles of this size may be wrong.
    #[inline(always)]
    pub(crate) fn of(self, size: N) -> N {
        size * self.scale + self.least
    }
}

impl EdgeError {
    /// For triangles within a box.
    #[inline(always)]
    pub(crate) fn new(ray: &PreparedRay, bounds: &Aabb) -> Self {
        Self::within(ray.ray.origin, ray.ray.origin, bounds)
    }

    /// For rays whose origins lie between two corners of a box.
    #[inline(always)]
    pub(crate) fn within(low: Vec3, high: Vec3, bounds: &Aabb) -> Self {
        let reach = |axis: usize| max(bounds.max[axis] - low[axis], high[axis] - bounds.min[axis]).abs();
        Self::with(max(max(reach(0), reach(1)), reach(2)), FACTORS, f32::MIN_POSITIVE, max)
    }

    /// The same bounds in f64, for all rays and triangles, as `triangle::intersect_exactly` has them for one.
    #[inline(always)]
    pub(crate) fn surely(self) -> (f64, f64) {
        let reach = f64::from(self.reach);
        (reach * reach * SURELY, reach * reach * reach * SURELY)
    }

    /// For rays side by side.
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
    /// For triangles side by side, none of whose corners is farther from the origin than this.
    #[inline(always)]
    pub(super) fn of_triangles(reach: Vec4) -> Self {
        let [scale, a, b, area, volume] = FACTORS;
        let splat = Vec4::splat;
        let factors = [splat(scale), splat(a), splat(b), splat(area), splat(volume)];
        Self::with(reach, factors, splat(f32::MIN_POSITIVE), Vec4::max)
    }
}

impl<N: Vector> EdgeError<N> {
    /// For rays side by side, no corner being farther from an origin than this.
    #[inline(always)]
    pub(crate) fn of_rays<S: Instructions<Vector = N>>(s: S, reach: N) -> Self {
        let [scale, a, b, area, volume] = FACTORS;
        let factors = [s.splat(scale), s.splat(a), s.splat(b), s.splat(area), s.splat(volume)];
        Self::with(reach, factors, s.splat(f32::MIN_POSITIVE), N::max)
    }
}
