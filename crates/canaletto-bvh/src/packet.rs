//! Sixteen rays that go nearly the same way, through the tree together: a node is visited if the interval of all of them
//! may meet it (Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire ray packets", 2006), and
//! triangles are tested against all rays side by side.
//!
//! The answers are those of single rays, bit for bit: the same operations in the same order, lane by lane. Where a lane would
//! leave the straight way (products that nearly cancel, triangles without area), that ray's triangle is decided alone.
//!
//! The loops over lanes have no branches, so that the compiler makes vectors of them, for whatever instructions the function around them
//! is compiled for.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use crate::node::{Leaf, Link, Node};
use crate::slab::{DEFLATE, INFLATE, LEAVE, Slabs, WIDTH, max, min};
use crate::traverse::STACK;
use crate::triangle::{self, Block, RELATIVE, SURELY, Shear, UNDERFLOW};
use crate::triangles::Nearest;
use crate::{InstructionSet, Ray};
use std::mem::MaybeUninit;

/// Rays in a packet.
pub(crate) const LANES: usize = 16;

type Lanes<T> = [T; LANES];

/// Rays of one octant and one longest axis.
pub(crate) struct Packet {
    rays: Lanes<Ray>,
    /// x, y and z.
    origin: [Lanes<f32>; 3],
    reciprocal: [Lanes<f32>; 3],
    leaving: [Lanes<f32>; 3],
    /// Up to where anything must be entered to be worth a visit.
    limits: Lanes<f32>,
    /// Which planes of a box are met first.
    entry: [usize; 3],
    /// The axes as the shear orders them, and all below in that order.
    axes: [usize; 3],
    wide_origin: [Lanes<f64>; 3],
    shear: [Lanes<f64>; 2],
    direction: Lanes<f64>,
    rough: [Lanes<f32>; 2],
    /// For each axis what all rays lie between: the origin that meets entry and exit planes first and last, and the
    /// reciprocals.
    interval: [Interval; 3],
    pub(crate) nearest: Hits,
}

#[derive(Clone, Copy)]
struct Interval {
    enter: f32,
    leave: f32,
    reciprocal: [f32; 2],
    leaving: [f32; 2],
}

/// The nearest hits so far; a lane whose t is −∞ takes no part.
pub(crate) struct Hits {
    pub(crate) t: Lanes<f32>,
    pub(crate) u: Lanes<f32>,
    pub(crate) v: Lanes<f32>,
    pub(crate) id: Lanes<u32>,
}

impl Packet {
    /// The packet of 1 to 16 rays, if they go together. No ray has met anything before its `t_max`.
    #[inline]
    pub(crate) fn new(rays: &[Ray], t_max: impl Fn(usize) -> f32) -> Option<Packet> {
        #[allow(unsafe_code)]
        // SAFETY: `current` never tells more than the machine has.
        match InstructionSet::current() {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => unsafe { gather_avx512(rays, t_max) },
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => unsafe { gather_avx2(rays, t_max) },
            _ => Packet::gather(rays, t_max),
        }
    }

    #[inline(always)]
    fn gather(rays: &[Ray], t_max: impl Fn(usize) -> f32) -> Option<Packet> {
        let last = rays.len() - 1;
        let rays: Lanes<Ray> = std::array::from_fn(|i| rays[i.min(last)]);
        let first = Slabs::new(&rays[0]);
        let axes = Shear::new(&rays[0], &first).axes;
        let mut packet = Packet {
            rays,
            origin: [[0.0; LANES]; 3],
            reciprocal: [[0.0; LANES]; 3],
            leaving: [[0.0; LANES]; 3],
            limits: [0.0; LANES],
            entry: first.entry.map(usize::from),
            axes,
            wide_origin: [[0.0; LANES]; 3],
            shear: [[0.0; LANES]; 2],
            direction: [0.0; LANES],
            rough: [[0.0; LANES]; 2],
            interval: [Interval { enter: 0.0, leave: 0.0, reciprocal: [0.0; 2], leaving: [0.0; 2] }; 3],
            nearest: Hits { t: [0.0; LANES], u: [0.0; LANES], v: [0.0; LANES], id: [Nearest::NONE; LANES] },
        };
        // The numbers of `Slabs` and `Shear`, lane by lane.
        let mut direction = [[0.0f32; LANES]; 3];
        for (i, ray) in packet.rays.iter().enumerate() {
            for axis in 0..3 {
                packet.origin[axis][i] = ray.origin[axis];
                direction[axis][i] = ray.direction[axis];
            }
        }
        let mut together = true;
        for axis in 0..3 {
            let (backwards, longest) = (packet.entry[axis] == 1, &direction[axes[2]]);
            for i in 0..LANES {
                let d = direction[axis][i];
                let r = 1.0 / d;
                let l = r * LEAVE;
                packet.reciprocal[axis][i] = r;
                packet.leaving[axis][i] = l;
                // Within the axis' length; of equal ones `Shear` takes the first, which is then another ray's way.
                let shorter = d.abs() < longest[i].abs() || axis == axes[2];
                together &=
                    normal(r) & normal(l) & packet.origin[axis][i].is_finite() & ((d < 0.0) == backwards) & shorter;
            }
        }
        if !together {
            return None;
        }
        for k in 0..3 {
            for i in 0..LANES {
                packet.wide_origin[k][i] = f64::from(packet.origin[axes[k]][i]);
            }
        }
        for k in 0..2 {
            for i in 0..LANES {
                let exact = f64::from(direction[axes[k]][i]) / f64::from(direction[axes[2]][i]);
                let rough = exact as f32;
                packet.shear[k][i] = exact;
                packet.rough[k][i] = if exact == 0.0 || normal(rough) { rough } else { f32::NAN };
            }
        }
        for i in 0..LANES {
            packet.direction[i] = f64::from(direction[axes[2]][i]);
            packet.nearest.t[i] = if i <= last { t_max(i) } else { f32::NEG_INFINITY };
        }
        let ends =
            |v: &Lanes<f32>| v.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
        for axis in 0..3 {
            let [low, high] = ends(&packet.origin[axis]);
            let backwards = packet.entry[axis] == 1;
            packet.interval[axis] = Interval {
                enter: if backwards { low } else { high },
                leave: if backwards { high } else { low },
                reciprocal: ends(&packet.reciprocal[axis]),
                leaving: ends(&packet.leaving[axis]),
            };
        }
        Some(packet)
    }

    /// Sets `limits` and returns the largest.
    #[inline(always)]
    fn limit(&mut self) -> f32 {
        let mut largest = f32::NEG_INFINITY;
        for i in 0..LANES {
            self.limits[i] = Slabs::limit(self.nearest.t[i]);
            largest = max(largest, self.limits[i]);
        }
        largest
    }

    /// Where the rays may enter and leave the boxes of a node: bounds for all of them, by monotone rounding.
    #[inline(always)]
    fn clip(&self, node: &Node, limit: f32) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut near, mut far) = ([0.0f32; WIDTH], [limit; WIDTH]);
        for axis in 0..3 {
            let Interval { enter, leave, reciprocal: [r0, r1], leaving: [l0, l1] } = self.interval[axis];
            let (first, second) =
                (&node.boxes[self.entry[axis] & 1][axis], &node.boxes[(self.entry[axis] & 1) ^ 1][axis]);
            for i in 0..WIDTH {
                let (x, y) = (first[i] - enter, second[i] - leave);
                near[i] = max(near[i], min(x * r0, x * r1));
                far[i] = min(far[i], max(y * l0, y * l1));
            }
        }
        (near, far)
    }

    /// Whether any ray meets the box in this lane of a node.
    #[inline(always)]
    fn enters(&self, node: &Node, lane: usize) -> bool {
        let planes = |axis: usize| {
            let entry = self.entry[axis] & 1;
            (node.boxes[entry][axis][lane & 7], node.boxes[entry ^ 1][axis][lane & 7])
        };
        let [(x0, x1), (y0, y1), (z0, z1)] = [planes(0), planes(1), planes(2)];
        let ([ox, oy, oz], [rx, ry, rz], [lx, ly, lz]) = (&self.origin, &self.reciprocal, &self.leaving);
        let mut any = 0u32;
        for i in 0..LANES {
            let near = max(max((x0 - ox[i]) * rx[i], (y0 - oy[i]) * ry[i]), max((z0 - oz[i]) * rz[i], 0.0));
            let far = min(min((x1 - ox[i]) * lx[i], (y1 - oy[i]) * ly[i]), min((z1 - oz[i]) * lz[i], self.limits[i]));
            any |= u32::from(near <= far);
        }
        any != 0
    }

    /// Whether any ray may meet the triangle: `Block::candidates` with rays for lanes.
    #[inline(always)]
    fn may_meet(&self, corners: &[[f32; 3]; 3]) -> bool {
        let [a, b, c] = corners;
        let [kx, ky, kz] = self.axes;
        let (ox, oy, oz) = (&self.origin[kx % 3], &self.origin[ky % 3], &self.origin[kz % 3]);
        let (along, nearest) = (&self.reciprocal[kz % 3], &self.nearest.t);
        let mut may = 0u32;
        for i in 0..LANES {
            let (ax, ay, az) = (a[0] - ox[i], a[1] - oy[i], a[2] - oz[i]);
            let (bx, by, bz) = (b[0] - ox[i], b[1] - oy[i], b[2] - oz[i]);
            let (cx, cy, cz) = (c[0] - ox[i], c[1] - oy[i], c[2] - oz[i]);
            let size = |x: f32, y: f32, z: f32| max(max(x.abs(), y.abs()), z.abs());
            let d = max(max(size(ax, ay, az), size(bx, by, bz)), size(cx, cy, cz)) * 2.0;
            let (ta, tb, tc) = (az * along[i], bz * along[i], cz * along[i]);
            let beyond = min(min(ta, tb), tc) * DEFLATE > nearest[i] || max(max(ta, tb), tc) <= 0.0;
            let (sx, sy) = (self.rough[0][i], self.rough[1][i]);
            let (ax, ay) = (ax - sx * az, ay - sy * az);
            let (bx, by) = (bx - sx * bz, by - sy * bz);
            let (cx, cy) = (cx - sx * cz, cy - sy * cz);
            let m = max(size(ax, ay, bx), size(by, cx, cy));
            let (wa, wb, wc) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
            let bound = d * m * (2.0 * RELATIVE) + (d * (2.0 * UNDERFLOW) + f32::MIN_POSITIVE);
            let missed = max(max(wa, wb), wc) > bound && min(min(wa, wb), wc) < -bound;
            may |= u32::from(!(missed | beyond));
        }
        may != 0
    }

    /// `intersect_exactly` with rays for lanes; the nearest hits are kept.
    #[inline(always)]
    fn meet(&mut self, corners: &[[f32; 3]; 3], id: u32, front_only: bool) {
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        let [ox, oy, oz] = &self.wide_origin;
        let [sx, sy] = &self.shear;
        let (mut t, mut u, mut v) = ([0.0f64; LANES], [0.0f64; LANES], [0.0f64; LANES]);
        let (mut inside, mut alone) = ([0u64; LANES], [0u64; LANES]);
        for i in 0..LANES {
            let (ax, ay, az) = (a[0] - ox[i], a[1] - oy[i], a[2] - oz[i]);
            let (bx, by, bz) = (b[0] - ox[i], b[1] - oy[i], b[2] - oz[i]);
            let (cx, cy, cz) = (c[0] - ox[i], c[1] - oy[i], c[2] - oz[i]);
            let size = |x: f64, y: f64, z: f64| wide_max(wide_max(x.abs(), y.abs()), z.abs());
            let d = wide_max(wide_max(size(ax, ay, az), size(bx, by, bz)), size(cx, cy, cz));
            let (ax, ay) = (ax - sx[i] * az, ay - sy[i] * az);
            let (bx, by) = (bx - sx[i] * bz, by - sy[i] * bz);
            let (cx, cy) = (cx - sx[i] * cz, cy - sy[i] * cz);
            let ((wa, sa), (wb, sb), (wc, sc)) =
                (difference(bx, cy, by, cx), difference(cx, ay, cy, ax), difference(ax, by, ay, bx));
            let positive = (wa >= 0.0) & (wb >= 0.0) & (wc >= 0.0);
            let negative = (wa <= 0.0) & (wb <= 0.0) & (wc <= 0.0);
            let area = wa + wb + wc;
            let depth = wa * az + wb * bz + wc * cz;
            t[i] = depth / area / self.direction[i];
            u[i] = wb / area;
            v[i] = wc / area;
            let sure = sa & sb & sc;
            let far = (area.abs() > d * d * SURELY) & (depth.abs() > d * d * d * SURELY);
            let counts = if front_only { area < 0.0 } else { true };
            // What isn't sure may be inside or not.
            inside[i] = u64::from(sure & (positive | negative) & far & counts);
            alone[i] = u64::from(!sure | ((positive | negative) & !far));
        }
        let planes = |axis: usize| {
            let k = [self.axes[0] % 3, self.axes[1] % 3, self.axes[2] % 3];
            let at = if k[0] == axis {
                0
            } else if k[1] == axis {
                1
            } else {
                2
            };
            let [a, b, c] = [corners[0][at], corners[1][at], corners[2][at]];
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            if self.entry[axis] == 0 { (low, high) } else { (high, low) }
        };
        let [(x0, x1), (y0, y1), (z0, z1)] = [planes(0), planes(1), planes(2)];
        let ([ox, oy, oz], [rx, ry, rz]) = (&self.origin, &self.reciprocal);
        let hits = &mut self.nearest;
        for i in 0..LANES {
            let (x0, x1) = ((x0 - ox[i]) * rx[i], (x1 - ox[i]) * rx[i]);
            let (y0, y1) = ((y0 - oy[i]) * ry[i], (y1 - oy[i]) * ry[i]);
            let (z0, z1) = ((z0 - oz[i]) * rz[i], (z1 - oz[i]) * rz[i]);
            let near = max(max(x0, y0), max(z0, 0.0));
            let far = min(min(x1, y1), min(z1, f32::INFINITY)) * INFLATE;
            let confined = min(t[i] as f32, far);
            let confined = if near > 0.0 { max(confined, near * DEFLATE) } else { confined };
            let nearer = (confined < hits.t[i]) | ((confined == hits.t[i]) & (id < hits.id[i]));
            let met = (inside[i] != 0) & (near <= far) & (confined > 0.0) & (confined < f32::INFINITY) & nearer;
            let u = clamp(u[i] as f32, 1.0);
            let v = clamp(v[i] as f32, 1.0 - u);
            hits.t[i] = if met { confined } else { hits.t[i] };
            hits.u[i] = if met { u } else { hits.u[i] };
            hits.v[i] = if met { v } else { hits.v[i] };
            hits.id[i] = if met { id } else { hits.id[i] };
        }
        if alone.iter().fold(0, |a, b| a | b) != 0 {
            self.meet_alone(corners, id, front_only, &alone);
        }
    }

    /// The same for single rays.
    #[cold]
    #[inline(never)]
    fn meet_alone(&mut self, corners: &[[f32; 3]; 3], id: u32, front_only: bool, alone: &Lanes<u64>) {
        let mut in_order = [[0.0; 3]; 3];
        for (to, from) in in_order.iter_mut().zip(corners) {
            for (axis, value) in self.axes.iter().zip(from) {
                to[*axis] = *value;
            }
        }
        let corners = triangle::Triangle::new(in_order.map(Into::into));
        for i in (0..LANES).filter(|&i| alone[i] != 0) {
            let hits = &mut self.nearest;
            if let Some(hit) = triangle::intersect(&self.rays[i].prepare(), &corners, hits.t[i])
                && (hit.t < hits.t[i] || id < hits.id[i])
                && (hit.front || !front_only)
            {
                (hits.t[i], hits.u[i], hits.v[i], hits.id[i]) = (hit.t, hit.u, hit.v, id);
            }
        }
    }

    #[inline(always)]
    fn leaf(&mut self, block: &Block, leaf: Leaf, front_only: bool, any: bool) {
        for lane in 0..leaf.count() as usize {
            let (id, corners) = block.ordered(lane, self.axes);
            if self.may_meet(&corners) {
                self.meet(&corners, id, front_only);
            }
        }
        if any {
            for i in 0..LANES {
                let hit = self.nearest.id[i] != Nearest::NONE;
                self.nearest.t[i] = if hit { f32::NEG_INFINITY } else { self.nearest.t[i] };
            }
        }
    }

    /// Takes the rays through the tree. With `any`, a ray ends at the first hit that it finds, and its t becomes −∞.
    pub(crate) fn trace(&mut self, nodes: &[Node], blocks: &[Block], front_only: bool, any: bool) {
        #[allow(unsafe_code)] // `current` never tells more than the machine has.
        #[cfg(target_arch = "x86_64")]
        match InstructionSet::current() {
            // SAFETY: as said.
            InstructionSet::Avx512 => return unsafe { trace_avx512(self, nodes, blocks, front_only, any) },
            // SAFETY: as said.
            InstructionSet::Avx2 => return unsafe { trace_avx2(self, nodes, blocks, front_only, any) },
            InstructionSet::Baseline => {}
        }
        trace(self, nodes, blocks, front_only, any);
    }
}

#[inline(always)]
fn trace(packet: &mut Packet, nodes: &[Node], blocks: &[Block], front_only: bool, any: bool) {
    if nodes.is_empty() {
        return;
    }
    let mirror = packet.entry[0] | packet.entry[1] << 1 | packet.entry[2] << 2 ^ (WIDTH - 1);
    let mut stack = [const { MaybeUninit::<(f32, Link)>::uninit() }; STACK];
    stack[0].write((f32::NEG_INFINITY, Link::node(0)));
    let mut len = 1;
    let mut limit = packet.limit();
    while len > 0 {
        len -= 1;
        #[allow(unsafe_code)]
        // SAFETY: entries below `len` were written.
        let (near, link) = unsafe { stack[len].assume_init() };
        if near > limit {
            continue;
        }
        match link.follow() {
            Err(node) => {
                let node = &nodes[node];
                let (near, far) = packet.clip(node, limit);
                for i in 0..WIDTH {
                    let lane = (i ^ mirror) & (WIDTH - 1);
                    if near[lane] <= far[lane] && packet.enters(node, lane) {
                        stack[len].write((near[lane], node.children[lane]));
                        len += 1;
                    }
                }
            }
            Ok(leaf) => {
                packet.leaf(&blocks[leaf.first() as usize], leaf, front_only, any);
                limit = packet.limit();
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn trace_avx2(packet: &mut Packet, nodes: &[Node], blocks: &[Block], front_only: bool, any: bool) {
    trace(packet, nodes, blocks, front_only, any);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn trace_avx512(packet: &mut Packet, nodes: &[Node], blocks: &[Block], front_only: bool, any: bool) {
    trace(packet, nodes, blocks, front_only, any);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn gather_avx2(rays: &[Ray], t_max: impl Fn(usize) -> f32) -> Option<Packet> {
    Packet::gather(rays, t_max)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn gather_avx512(rays: &[Ray], t_max: impl Fn(usize) -> f32) -> Option<Packet> {
    Packet::gather(rays, t_max)
}

/// `exact::difference_of_products`, where rounding can't have spoilt the sign; tells whether that is so.
#[inline(always)]
fn difference(a: f64, b: f64, c: f64, d: f64) -> (f64, bool) {
    let (p, q) = (a * b, c * d);
    let e = p - q;
    (e, e.abs() > (p.abs() + q.abs()) * f64::EPSILON * 2.0)
}

#[inline(always)]
fn normal(a: f32) -> bool {
    (a.abs() >= f32::MIN_POSITIVE) & (a.abs() < f32::INFINITY)
}

/// `f32::clamp` from 0; like that one, it leaves −0 alone.
#[inline(always)]
fn clamp(a: f32, end: f32) -> f32 {
    let a = if a < 0.0 { 0.0 } else { a };
    if a > end { end } else { a }
}

#[inline(always)]
fn wide_max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
