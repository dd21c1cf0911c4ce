//! Rays against four cylinders side by side in f32. The test culls cylinders that are certainly missed. The exact test
//! is the caller's.

use glam::Vec4;

use super::cull::{Candidates, RELATIVE, Rows, UnitRay};
use crate::slab::DEFLATE;

/// The largest length whose square underflows in f32: √(3 · 2⁻¹⁴⁹), with slack.
pub(crate) const VANISHED: f32 = 1e-22;

#[inline(always)]
fn cross([ax, ay, az]: Rows, [bx, by, bz]: Rows) -> Rows {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

#[inline(always)]
fn dot([ax, ay, az]: Rows, [bx, by, bz]: Rows) -> Vec4 {
    ax * bx + ay * by + az * bz
}

/// The sum of the components' absolute values, which is no less than the length.
#[inline(always)]
fn size([x, y, z]: Rows) -> Vec4 {
    x.abs() + y.abs() + z.abs()
}

/// Culls the cylinders that the ray certainly misses.
///
/// Let e be the ray's unit direction, q the vector from the origin to the base, v the vector from the base to the top,
/// and n = e × v. The ray's line passes the endless axis at the distance |q·n| / |n|, which must not be above r. The
/// line is inside the endless cylinder for s within n·m / n² ± |v| √(r² n² − (q·n)²) / n² with m = q × v. The hit is
/// between the ends if s (e·v) − q·v, the height times |v|, is within 0..=v².
///
/// The errors, with u = 2⁻²⁴: q, v and e are off by u of their sizes, so n by 6 u |v|, and q·n by 10 u |q| |v|. For s
/// they are divided by n², which is itself off by 12 u |v| |n|. As |n·m| ≤ |n| |q| |v|, s is off by less than 32 u (|q|
/// + r) v² / n², with |v| ≥ |n|.
///
/// All bounds here are 16 u or 64 u times sums of components' sizes. This also covers the roundings of the bounds
/// themselves, and what f64 adds, which is smaller by 2⁻²⁴. Each bound also includes what underflow takes. Where
/// something overflows, so does a bound, and a comparison with NaN culls nothing.
#[inline(always)]
pub(crate) fn cull(base: &Rows, top: &Rows, r: Vec4, ray: &UnitRay, t_max: f32) -> Candidates {
    let ([bx, by, bz], [tx, ty, tz]) = (*base, *top);
    let e = [Vec4::splat(ray.unit[0]), Vec4::splat(ray.unit[1]), Vec4::splat(ray.unit[2])];
    let q = [bx - ray.origin[0], by - ray.origin[1], bz - ray.origin[2]];
    let v = [tx - bx, ty - by, tz - bz];
    let n = cross(e, v);
    let k = dot(q, n);
    let (q_size, v_size) = (size(q), size(v));
    let n_error = v_size * RELATIVE + VANISHED;
    let k_error = q_size * (v_size * RELATIVE + f32::MIN_POSITIVE) + f32::MIN_POSITIVE;
    let squared = dot(n, n);
    let length = squared.sqrt();
    let reach = (length + n_error) * r;
    let least = k.abs() - k_error;
    let missed = least.cmpgt(reach).bitmask();
    if missed == 0b1111 {
        return Candidates::NONE;
    }
    // The interval along the ray. For a ray nearly parallel to the axis, f32 can decide hardly anything.
    let oblique = length.cmpgt(n_error * 32.0);
    let m = cross(q, v);
    let (vv, e_v, q_v) = (dot(v, v), dot(e, v), dot(q, v));
    let (most, least) = (reach + k_error, least.max(Vec4::ZERO));
    let half = (vv * (most * most - least * least) + f32::MIN_POSITIVE).sqrt();
    let error = (q_size + r) * (v_size * v_size) * (4.0 * RELATIVE) + f32::MIN_POSITIVE;
    let per = Vec4::ONE / squared;
    let (middle, aside) = (dot(n, m) * per, (half + error) * per);
    let (s0, s1) = (middle - aside, middle + aside);
    let near = s0 * ray.per_length * DEFLATE;
    let (h0, h1) = (s0 * e_v - q_v, s1 * e_v - q_v);
    let h_error = v_size * (q_size + v_size + s0.abs() + s1.abs()) * RELATIVE + f32::MIN_POSITIVE;
    let off = h0.max(h1).cmplt(-h_error) | h0.min(h1).cmpgt(vv + h_error);
    let beyond = near.cmpgt(Vec4::splat(t_max)) | s1.cmplt(Vec4::ZERO);
    let culled = missed | (oblique & (off | beyond)).bitmask();
    let near = Vec4::select(oblique, near, Vec4::NEG_INFINITY);
    Candidates { lanes: !culled, near: near.to_array() }
}
