//! The exact test for the rays of a group: of what waits for them, or of a triangle that f32 leaves undecided.
//!
//! The loops over lanes have no branches, so that the compiler makes vectors of them, for whatever instructions the function around them
//! is compiled for.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use super::group::{Group, NOTHING};
use super::look::Terms;
use crate::block::Scene;
use crate::exact::CANCELLED;
use crate::lanes::SIXTEEN;
use crate::slab::{DEFLATE, INFLATE, max, min};
use crate::triangles::Nearest;
use crate::{InstructionSet, Kernel};

/// Tests for all rays what waits for them. Returns the rays for which this has to be done alone, a bit for each.
#[inline(always)]
pub(super) fn settle(group: &Group, terms: &Terms, scene: Scene<'_>, nearest: &mut [Nearest]) -> u32 {
    let mut waits = 0;
    for i in 0..SIXTEEN {
        waits |= u32::from(group.waits.0[i] != NOTHING) << i;
    }
    if waits == 0 {
        return 0;
    }
    let (mut corners, mut ids) = ([[[0.0f32; SIXTEEN]; 3]; 3], [0; SIXTEEN]);
    for i in 0..SIXTEEN {
        // Where nothing waits, any triangle.
        let place = if group.waits.0[i] == NOTHING { 0 } else { group.waits.0[i] };
        let block = &scene.blocks[(place >> 2) as usize];
        let triangle = block.ordered(place as usize & 3, terms.way.rows);
        for corner in 0..3 {
            for k in 0..3 {
                corners[corner][k][i] = triangle[corner][k];
            }
        }
        ids[i] = block.id(place as usize & 3);
    }
    let Exactly { t, u, v, met, .. } = exactly(group, terms, &corners);
    let done = met & waits;
    let mut left = done;
    while left != 0 {
        let i = left.trailing_zeros() as usize % SIXTEEN;
        left &= left - 1;
        nearest[group.first + i] = Nearest { t: t[i], u: u[i], v: v[i], id: ids[i] };
    }
    waits & !done
}

/// Tests one triangle for all rays.
#[cold]
#[inline(never)]
pub(super) fn settle_one(group: &Group, terms: &Terms, scene: Scene<'_>, place: u32) -> Exactly {
    InstructionSet::run(One { group, terms, scene, place })
}

struct One<'a> {
    group: &'a Group,
    terms: &'a Terms,
    scene: Scene<'a>,
    place: u32,
}

impl Kernel for One<'_> {
    type Answer = Exactly;

    #[inline(always)]
    fn run(self) -> Exactly {
        let block = &self.scene.blocks[(self.place >> 2) as usize];
        let triangle = block.ordered(self.place as usize & 3, self.terms.way.rows);
        let mut corners = [[[0.0f32; SIXTEEN]; 3]; 3];
        for corner in 0..3 {
            for k in 0..3 {
                corners[corner][k] = [triangle[corner][k]; SIXTEEN];
            }
        }
        exactly(self.group, self.terms, &corners)
    }
}

/// What the exact test says for each ray.
pub(super) struct Exactly {
    pub(super) t: [f32; SIXTEEN],
    u: [f32; SIXTEEN],
    v: [f32; SIXTEEN],
    /// Rays that meet the triangle up to `t_max`, a bit for each.
    pub(super) met: u32,
    /// Those that don't. The others have to be tested alone.
    pub(super) missed: u32,
}

/// `triangle::intersect_exactly` with rays for lanes, each with a triangle.
#[inline(always)]
fn exactly(group: &Group, terms: &Terms, [a, b, c]: &[[[f32; SIXTEEN]; 3]; 3]) -> Exactly {
    let k = terms.way.axes();
    let (area_bound, volume_bound) = terms.bound.surely();
    let (ox, oy, oz) = (&group.origin[k[0]].0, &group.origin[k[1]].0, &group.origin[k[2]].0);
    let (dx, dy, dz) = (&group.direction[k[0]].0, &group.direction[k[1]].0, &group.direction[k[2]].0);
    let (mut t, mut u, mut v) = ([0.0f32; SIXTEEN], [0.0f32; SIXTEEN], [0.0f32; SIXTEEN]);
    let (mut counts, mut told, mut far) = ([0u32; SIXTEEN], [0u32; SIXTEEN], [0u32; SIXTEEN]);
    for i in 0..SIXTEEN {
        let wide = |x: f32, o: f32| f64::from(x) - f64::from(o);
        let (ax, ay, az) = (wide(a[0][i], ox[i]), wide(a[1][i], oy[i]), wide(a[2][i], oz[i]));
        let (bx, by, bz) = (wide(b[0][i], ox[i]), wide(b[1][i], oy[i]), wide(b[2][i], oz[i]));
        let (cx, cy, cz) = (wide(c[0][i], ox[i]), wide(c[1][i], oy[i]), wide(c[2][i], oz[i]));
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
        t[i] = (depth / area / along) as f32;
        u[i] = clamp((wb / area) as f32, 1.0);
        v[i] = clamp((wc / area) as f32, 1.0 - u[i]);
        counts[i] = u32::from((positive | negative) & ((area < 0.0) | !terms.front_only));
        told[i] = u32::from(sa & sb & sc);
        far[i] = u32::from((area.abs() > area_bound) & (depth.abs() > volume_bound));
    }
    // `PreparedRay::confine_to_triangle`, the axes in another order: the longest comes last.
    for i in 0..SIXTEEN {
        let (mut near, mut far, mut last) = (0.0f32, f32::INFINITY, 0.0);
        for axis in 0..3 {
            let ends = [min(min(a[axis][i], b[axis][i]), c[axis][i]), max(max(a[axis][i], b[axis][i]), c[axis][i])];
            let (o, r) = (group.origin[k[axis]].0[i], group.reciprocal[k[axis]].0[i]);
            let (low, high) = ((ends[0] - o) * r, (ends[1] - o) * r);
            last = max(low, high);
            (near, far) = (max(near, min(low, high)), min(far, last));
        }
        let (far, last) = (far * INFLATE, last * INFLATE);
        let confined = if t[i] > last { last } else { t[i] };
        let confined = max(confined, near * DEFLATE);
        let within = (confined >= f32::MIN_POSITIVE) & (confined <= group.t_max.0[i]) & (confined < f32::INFINITY);
        counts[i] &= u32::from((near <= far) & within);
        t[i] = confined;
    }
    let (mut met, mut missed) = (0, 0);
    for i in 0..SIXTEEN {
        met |= (counts[i] & told[i] & far[i]) << i;
        missed |= (told[i] & !counts[i]) << i;
    }
    Exactly { t, u, v, met, missed }
}

/// `exact::difference_of_products`, where that is not careful; tells whether that is so.
#[inline(always)]
fn difference(a: f64, b: f64, c: f64, d: f64) -> (f64, bool) {
    let (p, q) = (a * b, c * d);
    let e = p - q;
    (e, e.abs() > (p.abs() + q.abs()) * CANCELLED)
}

/// `f32::clamp` from 0; like that one, it leaves −0 alone.
#[inline(always)]
fn clamp(a: f32, end: f32) -> f32 {
    let a = if a < 0.0 { 0.0 } else { a };
    if a > end { end } else { a }
}
