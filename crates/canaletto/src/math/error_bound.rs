//! Bounds of rounding errors, and the ray offset made from them. There is no constant in scene units: every bound is a
//! multiple of the numbers it bounds. A scene scaled by a power of two gives equal bits.

use super::Vector;
use canaletto_bvh::lanes::{Real, Real64};
use glam::{DVec3, Vec3};

/// Half the distance between 1 and the next `f32`: the largest relative error of one rounding.
const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// γₙ = n u / (1 − n u): the relative error of n consecutive roundings (Higham, *Accuracy and Stability of Numerical
/// Algorithms*, §3.1).
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// The error of each coordinate of a point that was computed in `f64` and rounded to `f32`. It is a whole unit in the
/// last place rather than half of one, which covers the preceding `f64` arithmetic.
#[inline(always)]
pub fn rounding(p: Vec3) -> Vec3 {
    p.abs() * f32::EPSILON
}

/// Moves `p`, known up to ± `error` in each coordinate, along the unit geometric normal. The result is certainly on the
/// side of the surface to which `direction` points (pbrt-v4, §6.8.6). The bound includes the sum's own rounding; unlike
/// a step to the next float, this keeps the offset scale-invariant.
#[inline(always)]
pub fn offset_origin(p: Vec3, error: Vec3, normal: DVec3, direction: DVec3) -> Vec3 {
    offset_origins((p.into(), error.into(), Vector::from(normal)), direction.into()).into()
}

/// [`offset_origin`] of a point with its error and normal in each lane.
#[inline(always)]
pub(crate) fn offset_origins<F: Real64>(
    (p, error, normal): (Vector<F::Narrow>, Vector<F::Narrow>, Vector<F>),
    direction: Vector<F>,
) -> Vector<F::Narrow> {
    let is_behind = normal.dot(direction).less(F::splat(0.0));
    let normal = normal.narrow();
    let rounding = Vector { x: p.x.abs(), y: p.y.abs(), z: p.z.abs() } * F::Narrow::splat(f32::EPSILON);
    let out = Vector { x: normal.x.abs(), y: normal.y.abs(), z: normal.z.abs() };
    let distance = out.dot(error + rounding) * (1.0 + gamma(6));
    p + normal * F::Narrow::select(is_behind, -distance, distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_point_is_on_its_side_of_the_plane() {
        // For a plane through p with any normal, the f64 distance of the moved point has the sign of the direction.
        for i in 0..2000u32 {
            let h = |k: u32| {
                (i.wrapping_mul(2654435761).wrapping_add(k.wrapping_mul(40503) << 8) >> 8) as f32 / 8388608.0 - 1.0
            };
            let p = Vec3::new(h(1), h(2), h(3)) * 10f32.powi((i % 13) as i32 - 6);
            let n = Vec3::new(h(4), h(5), h(6)).as_dvec3().normalize();
            for side in [1.0, -1.0] {
                let moved = offset_origin(p, rounding(p), n, n * side);
                let d = (moved.as_dvec3() - p.as_dvec3()).dot(n) * side;
                assert!(d > n.abs().dot(rounding(p).as_dvec3()), "point {p}, normal {n}: moved by {d}");
            }
        }
    }
}
