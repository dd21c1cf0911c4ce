//! The exact test for four triangles side by side. Its results are those of
//! [`triangle::intersect`](super::triangle::intersect), bit for bit. A lane in which that would take one of its slow
//! branches is tested by the scalar test.
#![allow(unsafe_code)] // Vectors for instructions that only some machines have.

use glam::Vec4;

use super::difference_of_products::CANCELLED;
use super::triangle::DEGENERATE;
use super::triangle4::Triangle4;
use crate::PreparedRay;
use crate::PrimitiveHit;
use crate::min_max::min;
use crate::simd::F64x4;
use crate::slab::{DEFLATE, INFLATE};

/// `difference_of_products::difference_of_products` without its `careful` branch. The second result is above 0 where
/// that branch isn't needed.
#[inline(always)]
fn difference<F: F64x4>([a, b, c, d]: [F; 4], cancelled: F) -> (F, F) {
    let (p, q) = (a * b, c * d);
    let e = p - q;
    (e, e.abs() - (p.abs() + q.abs()) * cancelled)
}

impl Triangle4 {
    /// Tests these lanes exactly. If one of the triangles is the nearest, stores it in `nearest` and returns its lane.
    ///
    /// # Safety
    /// The machine must have the instructions of `F`.
    #[inline(always)]
    pub(crate) unsafe fn accept_nearest_of<F: F64x4>(
        &self,
        lanes: u32,
        ray: &PreparedRay,
        nearest: &mut PrimitiveHit,
        front_only: bool,
    ) -> Option<usize> {
        // No closures over `F`: until they are inlined, closures are functions without the instructions.
        macro_rules! splat {
            ($value:expr) => {
                // SAFETY: the caller's promise.
                unsafe { F::splat($value) }
            };
        }
        macro_rules! relative {
            ($corner:expr, $axis:literal, $origin:expr) => {
                // SAFETY: the caller's promise.
                unsafe { F::wide($corner[$axis]) - $origin }
            };
        }
        let [kx, ky, kz] = ray.axis_order.rows;
        let corner = |corner: usize| [self.row(corner, kx), self.row(corner, ky), self.row(corner, kz)];
        let corners = [corner(0), corner(1), corner(2)];
        let origin = [ray.origin(kx), ray.origin(ky), ray.origin(kz)];
        let (ox, oy, oz) = (splat!(origin[0].into()), splat!(origin[1].into()), splat!(origin[2].into()));
        let [a, b, c] = &corners;
        let (ax, ay, az) = (relative!(a, 0, ox), relative!(a, 1, oy), relative!(a, 2, oz));
        let (bx, by, bz) = (relative!(b, 0, ox), relative!(b, 1, oy), relative!(b, 2, oz));
        let (cx, cy, cz) = (relative!(c, 0, ox), relative!(c, 1, oy), relative!(c, 2, oz));
        // No corner is farther from the origin along any axis than `reach`.
        let reach = ax.abs().max(ay.abs()).max(az.abs()) + splat!(self.size().into());
        let along = f64::from(ray.direction(kz));
        let sx = splat!(f64::from(ray.direction(kx)) / along);
        let sy = splat!(f64::from(ray.direction(ky)) / along);
        let (ax, ay) = (ax - sx * az, ay - sy * az);
        let (bx, by) = (bx - sx * bz, by - sy * bz);
        let (cx, cy) = (cx - sx * cz, cy - sy * cz);
        let cancelled = splat!(CANCELLED);
        let (wa, sa) = difference([bx, cy, by, cx], cancelled);
        let (wb, sb) = difference([cx, ay, cy, ax], cancelled);
        let (wc, sc) = difference([ax, by, ay, bx], cancelled);
        let zero = splat!(0.0);
        let decided = if ray.regular { zero.below(sa.min(sb).min(sc)) } else { 0 };
        let inside = zero.at_most(wa.min(wb).min(wc)) | wa.max(wb).max(wc).at_most(zero);
        let area = wa + wb + wc;
        let depth = wa * az + wb * bz + wc * cz;
        let scale = splat!(1.0) / (area * splat!(along));
        let t = (depth * scale).narrow();
        // `PreparedRay::clamp_to_triangle`. As rounding is monotone, the ray enters the box's planes at the t of the
        // corners' planes.
        let (mut near, mut far, mut last) = (Vec4::ZERO, Vec4::INFINITY, Vec4::ZERO);
        for axis in 0..3 {
            let (origin, scale) =
                (Vec4::splat(origin[axis]), Vec4::splat(ray.neg_reciprocal(ray.axis_order.rows[axis])));
            let (a, b, c) = ((origin - a[axis]) * scale, (origin - b[axis]) * scale, (origin - c[axis]) * scale);
            last = a.max(b).max(c);
            near = near.max(a.min(b).min(c));
            far = far.min(last);
        }
        let t = (near * DEFLATE).max((last * INFLATE).min(t));
        let between = near.cmple(far * INFLATE)
            & t.cmpge(Vec4::splat(f32::MIN_POSITIVE))
            & t.cmple(Vec4::splat(min(f32::MAX, nearest.t)));
        let between = between.bitmask();
        let enough = reach * reach * splat!(DEGENERATE);
        let far = enough.below(area.abs()) & (enough * reach).below(depth.abs());
        let mut scalar_lanes = lanes & (!decided | inside & between & !far);
        let mut hits = lanes & decided & inside & between & far;
        if front_only {
            hits &= area.below(zero);
        }
        let mut found = None;
        if hits != 0 {
            let t = t.to_array();
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize & 3;
                hits &= hits - 1;
                let (t, id) = (t[lane], self.id(lane));
                if t < nearest.t || t == nearest.t && id < nearest.id {
                    (nearest.t, nearest.id) = (t, id);
                    found = Some(lane);
                }
            }
            if let Some(lane) = found {
                let (wb, wc, scale) = (wb.to_array()[lane], wc.to_array()[lane], scale.to_array()[lane]);
                nearest.uv[0] = ((wb * along * scale) as f32).clamp(0.0, 1.0);
                nearest.uv[1] = ((wc * along * scale) as f32).clamp(0.0, 1.0 - nearest.uv[0]);
            }
        }
        while scalar_lanes != 0 {
            let lane = scalar_lanes.trailing_zeros() as usize & 3;
            scalar_lanes &= scalar_lanes - 1;
            if self.accept_scalar(lane, ray, nearest, front_only) {
                found = Some(lane);
            }
        }
        found
    }

    #[cold]
    #[inline(never)]
    fn accept_scalar(&self, lane: usize, ray: &PreparedRay, nearest: &mut PrimitiveHit, front_only: bool) -> bool {
        self.accept_if_nearer(lane, ray, nearest, front_only)
    }
}
