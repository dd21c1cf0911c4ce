//! A group of sixteen coherent rays, side by side.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use crate::node::Node;
use crate::ray::AxisOrder;
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::slab::{INFLATE, WIDTH};
use crate::{PrimitiveHit, Ray};
use glam::{Mat4, Vec3, Vec4};

/// Up to sixteen rays of one octant and one longest axis, as rows with one lane per ray.
#[repr(C, align(64))]
pub(super) struct RayGroup {
    /// The origins, as rows x, y and z.
    pub(super) origin: [Row<f32>; 3],
    pub(super) direction: [Row<f32>; 3],
    pub(super) reciprocal: [Row<f32>; 3],
    pub(super) shear: [Row<f32>; 2],
    /// The end of each ray; −∞ for a ray that is no longer active.
    pub(super) t_max: Row<f32>,
    /// A lower bound of t on the pending triangle. Without a pending triangle, the t of the nearest hit.
    pub(super) low: Row<f32>,
    /// The pending triangle: four times its block plus its lane, or [`NOTHING`].
    pub(super) pending: Row<u32>,
    /// The id of the pending triangle, or of the last triangle that was pending or nearest. The ray may hit it again
    /// in another leaf.
    pub(super) last_seen: Row<u32>,
    /// The index of its first ray in the list.
    pub(super) first: usize,
    /// The active rays, one bit for each.
    pub(super) active: u32,
}

pub(super) const NOTHING: u32 = u32::MAX;

/// The corners of one triangle per ray, with coordinates in the order of the axis order's `rows`.
pub(super) type Corners = [[Row<f32>; 3]; 3];

/// The intervals of the origins and reciprocals of some rays along one axis.
#[derive(Clone, Copy)]
pub(in crate::traverse) struct Interval {
    pub(in crate::traverse) origin: [f32; 2],
    pub(in crate::traverse) reciprocal: [f32; 2],
}

impl Interval {
    /// The interval of no rays.
    pub(in crate::traverse) const NONE: Self =
        Self { origin: [f32::INFINITY, f32::NEG_INFINITY], reciprocal: [f32::INFINITY, f32::NEG_INFINITY] };
}

/// Sixteen numbers in four vectors of four.
type Fours = [Vec4; ROW / 4];

/// The rows x, y and z of the rays' origins and directions. If there are fewer than sixteen rays, the last is repeated.
#[inline(always)]
fn transpose(rays: &[Ray]) -> ([Fours; 3], [Fours; 3]) {
    let (mut origin, mut direction) = ([[Vec4::ZERO; 4]; 3], [[Vec4::ZERO; 4]; 3]);
    for i in 0..4 {
        let [start, end] = match <&[Ray; ROW]>::try_from(rays) {
            Ok(rays) => four([&rays[4 * i], &rays[4 * i + 1], &rays[4 * i + 2], &rays[4 * i + 3]]),
            Err(_) => {
                let ray = |lane: usize| &rays[(4 * i + lane).min(rays.len() - 1)];
                four([ray(0), ray(1), ray(2), ray(3)])
            }
        };
        (origin[0][i], origin[1][i], origin[2][i]) = (start.x_axis, start.y_axis, start.z_axis);
        (direction[0][i], direction[1][i], direction[2][i]) = (start.w_axis, end.z_axis, end.w_axis);
    }
    (origin, direction)
}

/// The first four and the last four numbers of four rays.
#[inline(always)]
fn four(rays: [&Ray; 4]) -> [Mat4; 2] {
    let [a, b, c, d] = rays.map(|ray| ray.origin.extend(ray.direction.x));
    let start = Mat4::from_cols(a, b, c, d).transpose();
    let [a, b, c, d] = rays.map(|Ray { origin: o, direction: d }| Vec4::new(o.z, d.x, d.y, d.z));
    [start, Mat4::from_cols(a, b, c, d).transpose()]
}

/// The smallest and the largest of some numbers, lane by lane.
pub(super) struct Ends<N> {
    low: N,
    high: N,
}

impl<N: Vector> Ends<N> {
    /// The ends of no numbers.
    #[inline(always)]
    pub(super) fn none<S: Instructions<Vector = N>>(s: S) -> Self {
        Self { low: s.splat(f32::INFINITY), high: s.splat(f32::NEG_INFINITY) }
    }

    /// Includes those numbers of a row whose rays have a bit.
    #[inline(always)]
    pub(super) fn widen<S: Instructions<Vector = N>>(&mut self, s: S, rays: u32, row: &Row<f32>) {
        for part in 0..N::PARTS {
            let (mask, numbers) = (s.mask(rays, part), s.load(row, part));
            self.low = self.low.min(N::select(mask, numbers, self.low));
            self.high = self.high.max(N::select(mask, numbers, self.high));
        }
    }

    /// The smallest and the largest number of all lanes.
    #[inline(always)]
    pub(super) fn of_all<S: Instructions<Vector = N>>(self, s: S) -> [f32; 2] {
        [-(s.splat(0.0) - self.low).largest(), self.high.largest()]
    }
}

impl RayGroup {
    pub(super) const EMPTY: Self = Self {
        origin: [Row([0.0; ROW]); 3],
        direction: [Row([0.0; ROW]); 3],
        reciprocal: [Row([0.0; ROW]); 3],
        shear: [Row([0.0; ROW]); 2],
        t_max: Row([f32::NEG_INFINITY; ROW]),
        low: Row([f32::NEG_INFINITY; ROW]),
        pending: Row([NOTHING; ROW]),
        last_seen: Row([PrimitiveHit::NONE; ROW]),
        first: 0,
        active: 0,
    };

    /// Takes those of 1 to 16 rays that have the axis order of the first ray that can go in a packet. Returns that axis
    /// order, or None if no ray can. The other rays have no bit in `part`.
    #[inline(always)]
    pub(super) fn gather<S: Instructions, T>(
        &mut self,
        s: S,
        rays: &[Ray],
        results: &[T],
        t_max: impl Fn(&T) -> f32,
    ) -> Option<AxisOrder> {
        // The first ray nearly always can. That is known only after divisions, so its axis order is computed ahead.
        let mut axis_order = AxisOrder::of(&rays[0]);
        let (origins, directions) = transpose(rays);
        let mut ends = [Vec4::ZERO; 4];
        for i in 0..4 {
            ends[i] = if results.len() == ROW {
                let results = &results[4 * i..4 * i + 4];
                Vec4::new(t_max(&results[0]), t_max(&results[1]), t_max(&results[2]), t_max(&results[3]))
            } else {
                let end = |lane: usize| t_max(&results[(4 * i + lane).min(results.len() - 1)]);
                Vec4::new(end(0), end(1), end(2), end(3))
            };
        }
        let (least, infinity) = (s.splat(f32::MIN_POSITIVE), s.splat(f32::INFINITY));
        let zero = s.splat(0.0);
        let mut together = 0;
        for part in 0..S::Vector::PARTS {
            let mut fit = s.mask(u32::MAX >> (32 - rays.len()), part);
            for axis in 0..3 {
                let (origin, direction) = (s.load_fours(&origins[axis], part), s.load_fours(&directions[axis], part));
                let reciprocal = s.splat(1.0) / direction;
                origin.store(&mut self.origin[axis], part);
                direction.store(&mut self.direction[axis], part);
                reciprocal.store(&mut self.reciprocal[axis], part);
                let size = reciprocal.abs();
                fit = fit & least.less_or_equal(size) & size.less(infinity);
                fit = fit & origin.abs().less(infinity);
            }
            together |= S::Vector::bits(fit, part);
        }
        self.active = together;
        if together == 0 {
            return None;
        }
        let first = together.trailing_zeros() as usize % ROW;
        if first != 0 {
            axis_order = AxisOrder::of(&rays[first]);
        }
        let [k0, k1, longest] = axis_order.axes();
        let axes = [k0, k1];
        self.active = 0;
        for part in 0..S::Vector::PARTS {
            let end = s.load_fours(&ends, part);
            // A ray with a NaN end is traced alone: a maximum would take its end for that of its neighbours.
            let mut fit = s.mask(together, part) & end.less_or_equal(infinity);
            let length = s.load(&self.direction[longest], part);
            for axis in 0..3 {
                let d = s.load(&self.direction[axis], part);
                fit = fit & if axis_order.octant >> axis & 1 == 1 { d.less(zero) } else { zero.less(d) };
                if axis != longest {
                    // For equal components, the preparation of a single ray takes the first axis, and the axis order
                    // would differ.
                    fit = fit & d.abs().less(length.abs());
                }
            }
            for k in 0..2 {
                let along = s.load(&self.direction[axes[k]], part) / length;
                // No direction is 0 here. A shear of 0 is a quotient that underflowed.
                let size = along.abs();
                let sure = (least.less_or_equal(size) & size.less(infinity)) | size.less_or_equal(zero);
                S::Vector::select(sure, along, s.splat(f32::NAN)).store(&mut self.shear[k], part);
            }
            let end = S::Vector::select(fit, end, s.splat(f32::NEG_INFINITY));
            end.store(&mut self.t_max, part);
            end.store(&mut self.low, part);
            self.active |= S::Vector::bits(fit, part);
        }
        self.pending = Row([NOTHING; ROW]);
        self.last_seen = Row([PrimitiveHit::NONE; ROW]);
        Some(axis_order)
    }

    /// The parts with rays that enter the box in this lane of a node.
    #[inline(always)]
    pub(super) fn entering<S: Instructions>(&self, s: S, node: &Node, lane: usize, octant: usize) -> u32 {
        let mut met = 0;
        for part in 0..S::Vector::PARTS {
            met |= u32::from(self.enters(s, part, node, lane, octant)) << part;
        }
        met
    }

    /// Whether any ray enters the box in this lane of a node.
    #[inline(always)]
    pub(super) fn any_enters<S: Instructions>(&self, s: S, node: &Node, lane: usize, octant: usize) -> bool {
        let mut part = 0;
        while part < S::Vector::PARTS {
            if self.enters(s, part, node, lane, octant) {
                return true;
            }
            part += 1;
        }
        false
    }

    /// Whether any ray of a part enters the box in this lane of a node.
    #[inline(always)]
    fn enters<S: Instructions>(&self, s: S, part: usize, node: &Node, lane: usize, octant: usize) -> bool {
        let (mut near, mut far) = (s.splat(0.0), s.load(&self.t_max, part));
        for axis in 0..3 {
            let entry = octant >> axis & 1;
            let (first, second) = (node.boxes[entry][axis][lane % WIDTH], node.boxes[entry ^ 1][axis][lane % WIDTH]);
            let (o, r) = (s.load(&self.origin[axis], part), s.load(&self.reciprocal[axis], part));
            near = near.max((s.splat(first) - o) * r);
            far = far.min((s.splat(second) - o) * r);
        }
        S::Vector::lanes(near.less_or_equal(far * s.splat(INFLATE))) != 0
    }

    /// The rays with a pending primitive.
    #[inline(always)]
    pub(super) fn waiting(&self) -> u32 {
        let mut waiting = 0;
        for i in 0..ROW {
            waiting |= u32::from(self.pending.0[i] != NOTHING) << i;
        }
        waiting
    }

    /// The ray in a lane.
    pub(super) fn ray(&self, lane: usize) -> Ray {
        let at = |rows: &[Row<f32>; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Ray::new(at(&self.origin), at(&self.direction))
    }

    /// The largest end of all rays.
    #[inline(always)]
    pub(super) fn farthest<S: Instructions>(&self, s: S) -> f32 {
        let mut most = s.load(&self.t_max, 0);
        for part in 1..S::Vector::PARTS {
            most = most.max(s.load(&self.t_max, part));
        }
        most.largest()
    }
}
