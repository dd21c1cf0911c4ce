//! Sixteen rays that go nearly the same way, side by side.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use crate::lanes::{Instructions, Row, SIXTEEN, Vector};
use crate::node::Node;
use crate::ray::Way;
use crate::slab::{INFLATE, WIDTH};
use crate::{Nearest, Ray};
use glam::{Mat4, Vec3, Vec4};

/// Rays of one octant and one longest axis.
#[repr(C, align(64))]
pub(super) struct Group {
    /// x, y and z.
    pub(super) origin: [Row<f32>; 3],
    pub(super) direction: [Row<f32>; 3],
    pub(super) reciprocal: [Row<f32>; 3],
    pub(super) shear: [Row<f32>; 2],
    /// Up to where anything counts; −∞ for a ray that takes no part any more.
    pub(super) t_max: Row<f32>,
    /// No hit of the triangle that waits is nearer; without one, the nearest hit.
    pub(super) low: Row<f32>,
    /// The triangle that waits: four times its block plus its lane, or [`NOTHING`].
    pub(super) waits: Row<u32>,
    /// The id of that triangle, or of the last one that waited or was the nearest: it may be met again in another leaf.
    pub(super) known: Row<u32>,
    /// The place of its first ray in the list.
    pub(super) first: usize,
    /// The rays that take part.
    pub(super) part: u32,
}

pub(super) const NOTHING: u32 = u32::MAX;

/// The corners of a triangle for each ray, the coordinates in the order of the way's `rows`.
pub(super) type Corners = [[Row<f32>; 3]; 3];

/// What the numbers of all rays of a group, or of some, lie between, along one axis.
#[derive(Clone, Copy)]
pub(super) struct Interval {
    pub(super) origin: [f32; 2],
    pub(super) reciprocal: [f32; 2],
}

impl Interval {
    /// Of no rays.
    pub(super) const NONE: Self =
        Self { origin: [f32::INFINITY, f32::NEG_INFINITY], reciprocal: [f32::INFINITY, f32::NEG_INFINITY] };
}

/// The rays side by side, four at a time; where there are fewer than sixteen, the last is repeated. (Numbers written one by one are not
/// there yet when a register wants to read them.)
#[inline(always)]
fn transpose(rays: &[Ray], origin: &mut [Row<f32>; 3], direction: &mut [Row<f32>; 3]) {
    if let Ok(rays) = <&[Ray; SIXTEEN]>::try_from(rays) {
        for first in (0..SIXTEEN).step_by(4) {
            four([&rays[first], &rays[first + 1], &rays[first + 2], &rays[first + 3]], first, origin, direction);
        }
    } else {
        let ray = |i: usize| &rays[if i < rays.len() { i } else { rays.len() - 1 }];
        for first in (0..SIXTEEN).step_by(4) {
            four([ray(first), ray(first + 1), ray(first + 2), ray(first + 3)], first, origin, direction);
        }
    }
}

#[inline(always)]
fn four(rays: [&Ray; 4], first: usize, origin: &mut [Row<f32>; 3], direction: &mut [Row<f32>; 3]) {
    let [a, b, c, d] = rays.map(|ray| ray.origin.extend(ray.direction.x));
    let start = Mat4::from_cols(a, b, c, d).transpose();
    let [a, b, c, d] = rays.map(|Ray { origin: o, direction: d }| Vec4::new(o.z, d.x, d.y, d.z));
    let end = Mat4::from_cols(a, b, c, d).transpose();
    let put = |row: &mut Row<f32>, four: Vec4| four.write_to_slice(&mut row.0[first..first + 4]);
    put(&mut origin[0], start.x_axis);
    put(&mut origin[1], start.y_axis);
    put(&mut origin[2], start.z_axis);
    put(&mut direction[0], start.w_axis);
    put(&mut direction[1], end.z_axis);
    put(&mut direction[2], end.w_axis);
}

/// The smallest and the largest of numbers, in each lane.
pub(super) struct Ends<N> {
    low: N,
    high: N,
}

impl<N: Vector> Ends<N> {
    /// Of no numbers.
    #[inline(always)]
    pub(super) fn none<S: Instructions<Vector = N>>(s: S) -> Self {
        Self { low: s.splat(f32::INFINITY), high: s.splat(f32::NEG_INFINITY) }
    }

    /// With those numbers of a row that take part.
    #[inline(always)]
    pub(super) fn widen<S: Instructions<Vector = N>>(&mut self, s: S, rays: u32, row: &Row<f32>) {
        for part in 0..N::PARTS {
            let (mask, numbers) = (s.mask(rays, part), s.load(row, part));
            self.low = self.low.min(N::select(mask, numbers, self.low));
            self.high = self.high.max(N::select(mask, numbers, self.high));
        }
    }

    /// Of all lanes.
    #[inline(always)]
    pub(super) fn of_all<S: Instructions<Vector = N>>(self, s: S) -> [f32; 2] {
        [-(s.splat(0.0) - self.low).largest(), self.high.largest()]
    }
}

impl Group {
    pub(super) const EMPTY: Self = Self {
        origin: [Row([0.0; SIXTEEN]); 3],
        direction: [Row([0.0; SIXTEEN]); 3],
        reciprocal: [Row([0.0; SIXTEEN]); 3],
        shear: [Row([0.0; SIXTEEN]); 2],
        t_max: Row([f32::NEG_INFINITY; SIXTEEN]),
        low: Row([f32::NEG_INFINITY; SIXTEEN]),
        waits: Row([NOTHING; SIXTEEN]),
        known: Row([Nearest::NONE; SIXTEEN]),
        first: 0,
        part: 0,
    };

    /// Takes those of 1 to 16 rays that go together with the first that may go with any. Those that are left have no bit in `part`.
    #[inline(always)]
    pub(super) fn gather<S: Instructions, T>(
        &mut self,
        s: S,
        rays: &[Ray],
        told: &[T],
        t_max: impl Fn(&T) -> f32,
    ) -> Option<Way> {
        // Nearly always it is the first; which is told only after divisions.
        let mut way = Way::of(&rays[0]);
        transpose(rays, &mut self.origin, &mut self.direction);
        let (origin, direction) = (&self.origin, &self.direction);
        let (least, infinity) = (s.splat(f32::MIN_POSITIVE), s.splat(f32::INFINITY));
        let zero = s.splat(0.0);
        let mut together = 0;
        for part in 0..S::Vector::PARTS {
            let mut fit = s.mask(u32::MAX >> (32 - rays.len()), part);
            for axis in 0..3 {
                let reciprocal = s.splat(1.0) / s.load(&direction[axis], part);
                reciprocal.store(&mut self.reciprocal[axis], part);
                let size = reciprocal.abs();
                fit = fit & least.less_or_equal(size) & size.less(infinity);
                fit = fit & s.load(&origin[axis], part).abs().less(infinity);
            }
            together |= S::Vector::bits(fit, part);
        }
        self.part = together;
        if together == 0 {
            return None;
        }
        let first = together.trailing_zeros() as usize % SIXTEEN;
        if first != 0 {
            way = Way::of(&rays[first]);
        }
        if let Ok(told) = <&[T; SIXTEEN]>::try_from(told) {
            for i in 0..SIXTEEN {
                self.t_max.0[i] = t_max(&told[i]);
            }
        } else {
            for (to, told) in self.t_max.0.iter_mut().zip(told) {
                *to = t_max(told);
            }
        }
        let [k0, k1, longest] = way.axes();
        let axes = [k0, k1];
        self.part = 0;
        for part in 0..S::Vector::PARTS {
            let mut fit = s.mask(together, part);
            let length = s.load(&direction[longest], part);
            for axis in 0..3 {
                let d = s.load(&direction[axis], part);
                fit = fit & if way.octant >> axis & 1 == 1 { d.less(zero) } else { zero.less(d) };
                if axis != longest {
                    // Of equal ones a single ray takes the first, which is then another way.
                    fit = fit & d.abs().less(length.abs());
                }
            }
            for k in 0..2 {
                let along = s.load(&direction[axes[k]], part) / length;
                // No direction is 0 here, but what a quotient vanishes to.
                let size = along.abs();
                let sure = (least.less_or_equal(size) & size.less(infinity)) | size.less_or_equal(zero);
                S::Vector::select(sure, along, s.splat(f32::NAN)).store(&mut self.shear[k], part);
            }
            s.splat(f32::NEG_INFINITY).store_where(!fit, &mut self.t_max, part);
            s.load(&self.t_max, part).store(&mut self.low, part);
            self.part |= S::Vector::bits(fit, part);
        }
        self.waits = Row([NOTHING; SIXTEEN]);
        self.known = Row([Nearest::NONE; SIXTEEN]);
        Some(way)
    }

    /// The parts with rays that meet the box in this lane of a node.
    #[inline(always)]
    pub(super) fn entering<S: Instructions>(&self, s: S, node: &Node, lane: usize, octant: usize) -> u32 {
        let mut met = 0;
        for part in 0..S::Vector::PARTS {
            met |= u32::from(self.enters(s, part, node, lane, octant)) << part;
        }
        met
    }

    /// Whether any ray meets the box in this lane of a node.
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

    /// Whether any ray of a part does.
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

    /// The rays for which something waits.
    #[inline(always)]
    pub(super) fn waiting(&self) -> u32 {
        let mut waiting = 0;
        for i in 0..SIXTEEN {
            waiting |= u32::from(self.waits.0[i] != NOTHING) << i;
        }
        waiting
    }

    /// The ray in a lane.
    pub(super) fn ray(&self, lane: usize) -> Ray {
        let at = |rows: &[Row<f32>; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Ray::new(at(&self.origin), at(&self.direction))
    }

    /// Up to where all that counts lies, for all rays together.
    #[inline(always)]
    pub(super) fn farthest<S: Instructions>(&self, s: S) -> f32 {
        let mut most = s.load(&self.t_max, 0);
        for part in 1..S::Vector::PARTS {
            most = most.max(s.load(&self.t_max, part));
        }
        most.largest()
    }
}
