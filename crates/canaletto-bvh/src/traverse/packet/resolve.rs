//! The exact test for the rays of a group: of their pending triangles, or of a triangle that f32 leaves undecided.
//!
//! The loops over lanes have no branches. The compiler vectorises them for the instructions of the surrounding
//! function.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use super::group::{Corners, RayGroup};
use super::triangle_test::TestParams;
use crate::PrimitiveHit;
use crate::min_max::{max, min};
use crate::primitive::difference_of_products::CANCELLED;
use crate::simd::dispatch::{self, SimdKernel};
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::slab::{DEFLATE, INFLATE};
use glam::{Mat4, UVec4, Vec4};

/// Tests the pending triangles of all rays. Returns the rays that have to be tested alone, one bit for each.
#[inline(always)]
pub(super) fn resolve<S: Instructions>(
    s: S,
    group: &RayGroup,
    corners: &Corners,
    params: &TestParams,
    nearest: &mut [PrimitiveHit],
) -> u32 {
    let pending = group.waiting();
    if pending == 0 {
        return 0;
    }
    let ExactResult { t, u, v, met, .. } = exact_test(s, group, params, corners);
    let done = met & pending;
    let nearest = &mut nearest[group.first..];
    if let Some(nearest) = nearest.first_chunk_mut::<ROW>()
        && done == 0xffff
    {
        for first in (0..ROW).step_by(4) {
            let four = |numbers: &[f32; ROW]| Vec4::from_slice(&numbers[first..]);
            let ids = UVec4::from_slice(&group.last_seen.0[first..]);
            let found = Mat4::from_cols(four(&t), four(&u), four(&v), Vec4::ZERO).transpose();
            for i in 0..4 {
                let [t, u, v, _] = found.col(i).to_array();
                nearest[first + i] = PrimitiveHit { t, id: ids[i], part: 0, uv: [u, v] };
            }
        }
    } else {
        for i in super::lanes(done) {
            nearest[i] = PrimitiveHit { t: t[i], id: group.last_seen.0[i], part: 0, uv: [u[i], v[i]] };
        }
    }
    pending & !done
}

/// Tests one triangle against all rays.
#[cold]
#[inline(never)]
pub(super) fn exact_same_triangle(group: &RayGroup, params: &TestParams, [a, b, c]: [[f32; 3]; 3]) -> ExactResult {
    let for_all = |corner: [f32; 3]| corner.map(|x| Row([x; ROW]));
    exact_triangle_per_ray(group, params, &[for_all(a), for_all(b), for_all(c)])
}

/// Tests one triangle per ray.
#[cold]
#[inline(never)]
pub(super) fn exact_triangle_per_ray(group: &RayGroup, params: &TestParams, corners: &Corners) -> ExactResult {
    dispatch::run(ExactKernel { group, params, corners })
}

struct ExactKernel<'a> {
    group: &'a RayGroup,
    params: &'a TestParams,
    corners: &'a Corners,
}

impl SimdKernel for ExactKernel<'_> {
    type Answer = ExactResult;

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) -> ExactResult {
        exact_test(s, self.group, self.params, self.corners)
    }
}

/// The results of the exact test for each ray.
pub(super) struct ExactResult {
    pub(super) t: [f32; ROW],
    u: [f32; ROW],
    v: [f32; ROW],
    /// The rays that hit the triangle up to `t_max`, one bit for each.
    pub(super) met: u32,
    /// The rays that miss the triangle. Rays in neither mask have to be tested alone.
    pub(super) missed: u32,
}

/// `triangle::intersect_exactly` with one ray and one triangle per lane.
#[inline(always)]
fn exact_test<S: Instructions>(s: S, group: &RayGroup, params: &TestParams, [a, b, c]: &Corners) -> ExactResult {
    let k = params.axes;
    let (area_bound, volume_bound) = params.bound.degenerate_bounds();
    let (ox, oy, oz) = (&group.origin[k[0]].0, &group.origin[k[1]].0, &group.origin[k[2]].0);
    let (dx, dy, dz) = (&group.direction[k[0]].0, &group.direction[k[1]].0, &group.direction[k[2]].0);
    let (mut t, mut u, mut v) = ([0.0f32; ROW], [0.0f32; ROW], [0.0f32; ROW]);
    let (mut counts, mut results, mut far) = ([0u32; ROW], [0u32; ROW], [0u32; ROW]);
    for i in 0..ROW {
        let wide = |x: f32, o: f32| f64::from(x) - f64::from(o);
        let (ax, ay, az) = (wide(a[0].0[i], ox[i]), wide(a[1].0[i], oy[i]), wide(a[2].0[i], oz[i]));
        let (bx, by, bz) = (wide(b[0].0[i], ox[i]), wide(b[1].0[i], oy[i]), wide(b[2].0[i], oz[i]));
        let (cx, cy, cz) = (wide(c[0].0[i], ox[i]), wide(c[1].0[i], oy[i]), wide(c[2].0[i], oz[i]));
        let along = f64::from(dz[i]);
        let (sx, sy) = (f64::from(dx[i]) / along, f64::from(dy[i]) / along);
        let (ax, ay) = (ax - sx * az, ay - sy * az);
        let (bx, by) = (bx - sx * bz, by - sy * bz);
        let (cx, cy) = (cx - sx * cz, cy - sy * cz);
        let ((wa, sa), (wb, sb), (wc, sc)) =
            (difference(bx, cy, by, cx), difference(cx, ay, cy, ax), difference(ax, by, ay, bx));
        let positive = (wa >= 0.0) & (wb >= 0.0) & (wc >= 0.0);
        let negative = (wa <= 0.0) & (wb <= 0.0) & (wc <= 0.0);
        let area = wa + wb + wc;
        let depth = wa * az + wb * bz + wc * cz;
        let scale = 1.0 / (area * along);
        t[i] = (depth * scale) as f32;
        u[i] = clamp((wb * along * scale) as f32, 1.0);
        v[i] = clamp((wc * along * scale) as f32, 1.0 - u[i]);
        counts[i] = u32::from((positive | negative) & ((area < 0.0) | !params.front_only));
        results[i] = u32::from(sa & sb & sc);
        far[i] = u32::from((area.abs() > area_bound) & (depth.abs() > volume_bound));
    }
    // `PreparedRay::clamp_to_triangle`, with the axes in another order: the longest comes last.
    for i in 0..ROW {
        let (mut near, mut far, mut last) = (0.0f32, f32::INFINITY, 0.0);
        for axis in 0..3 {
            let ends = [
                min(min(a[axis].0[i], b[axis].0[i]), c[axis].0[i]),
                max(max(a[axis].0[i], b[axis].0[i]), c[axis].0[i]),
            ];
            let (o, r) = (group.origin[k[axis]].0[i], group.reciprocal[k[axis]].0[i]);
            let (low, high) = ((ends[0] - o) * r, (ends[1] - o) * r);
            last = max(low, high);
            (near, far) = (max(near, min(low, high)), min(far, last));
        }
        let (far, last) = (far * INFLATE, last * INFLATE);
        let confined = if t[i] > last { last } else { t[i] };
        let confined = max(near * DEFLATE, confined);
        let within = (confined >= f32::MIN_POSITIVE) & (confined <= group.t_max.0[i]) & (confined < f32::INFINITY);
        counts[i] &= u32::from((near <= far) & within);
        t[i] = confined;
    }
    let (mut met, mut missed) = (Row([0.0; ROW]), Row([0.0; ROW]));
    for i in 0..ROW {
        met.0[i] = if counts[i] & results[i] & far[i] != 0 { 1.0 } else { 0.0 };
        missed.0[i] = if results[i] & !counts[i] != 0 { 1.0 } else { 0.0 };
    }
    ExactResult { t, u, v, met: positive(s, &met), missed: positive(s, &missed) }
}

/// A bit for each positive number. (Single shifts would take the numbers out of their register one by one.)
#[inline(always)]
fn positive<S: Instructions>(s: S, row: &Row<f32>) -> u32 {
    let mut bits = 0;
    for part in 0..S::Vector::PARTS {
        bits |= S::Vector::bits(s.splat(0.0).less(s.load(row, part)), part);
    }
    bits
}

/// `difference_of_products::difference_of_products` without its `careful` branch. The second result is true where that
/// branch isn't needed.
#[inline(always)]
fn difference(a: f64, b: f64, c: f64, d: f64) -> (f64, bool) {
    let (p, q) = (a * b, c * d);
    let e = p - q;
    (e, e.abs() > (p.abs() + q.abs()) * CANCELLED)
}

/// `f32::clamp` from 0. It keeps −0, as `f32::clamp` does.
#[inline(always)]
fn clamp(a: f32, end: f32) -> f32 {
    let a = if a < 0.0 { 0.0 } else { a };
    if a > end { end } else { a }
}
