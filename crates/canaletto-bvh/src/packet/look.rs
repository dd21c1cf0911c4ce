//! What f32 tells of a triangle and the rays of a group: `block::Tested` with rays for lanes.

use super::group::{Corners, Group, Way};
use crate::block::{BLUR, Bound};
use crate::lanes::{Instructions, Mask, Sixteen};
use crate::slab::{DEFLATE, INFLATE};

/// How triangles are tested.
#[derive(Clone, Copy)]
pub(super) struct Terms {
    pub(super) way: Way,
    pub(super) bound: Bound,
    /// Triangles seen from behind don't count.
    pub(super) front_only: bool,
    /// It counts that something is hit, not what.
    pub(super) any: bool,
}

/// A triangle.
#[derive(Clone, Copy)]
pub(super) struct Which {
    /// Four times its block plus its lane.
    pub(super) place: u32,
    pub(super) id: u32,
    /// The coordinates in the order of the way's `rows`.
    pub(super) corners: [[f32; 3]; 3],
}

/// What a test did.
#[derive(Clone, Copy)]
pub(super) struct Told {
    /// Rays that now have a hit, or end.
    pub(super) taken: u32,
    /// Rays for which the triangle has to be decided alone.
    pub(super) undecided: u32,
}

/// Whether hits certainly count.
#[derive(Clone, Copy)]
struct Certainly<N> {
    bound: Bound<N>,
    area: N,
    along: N,
    end: N,
}

impl<N: Sixteen> Certainly<N> {
    /// Of those on a triangle between `low` and `high`.
    #[inline(always)]
    fn met<S: Instructions<Sixteen = N>>(self, s: S, terms: &Terms, group: &Group, low: N, high: N) -> N::Mask {
        let zero = s.splat(0.0);
        if terms.any {
            let large = self.bound.area.less(self.area) & (self.bound.volume * self.along).less(self.area * low);
            s.splat(f32::MIN_POSITIVE).less_or_equal(low) & large & high.less_or_equal(self.end)
        } else {
            zero.less(low) & high.less(s.load(&group.low))
        }
    }
}

/// What f32 makes of sixteen rays and a triangle.
#[derive(Clone, Copy)]
struct Seen<N> {
    /// The least and the most of the edge functions, and their sum.
    least: N,
    most: N,
    sum: N,
    /// The sum of the edge functions times t at the opposite corners.
    weighed: N,
    /// Between them lies t of all points of the triangle.
    first: N,
    last: N,
}

/// What is certain of [`Seen`] if the edge functions are wrong by no more than a bound.
struct Within<N: Sixteen> {
    /// The line passes between the edges.
    inside: N::Mask,
    /// It doesn't, or what it meets doesn't count.
    missed: N::Mask,
    /// Between them lies t of the hit, if there is one.
    low: N,
    high: N,
}

impl<N: Sixteen> Seen<N> {
    /// `closely`, t is found from the edge functions where that helps, as in `Tested::between`, not from the corners alone.
    #[inline(always)]
    fn within<S: Instructions<Sixteen = N>>(self, s: S, off: N, front_only: bool, closely: bool) -> Within<N> {
        let Self { least, most, sum, weighed, first, last } = self;
        let below = s.splat(0.0) - off;
        let inside = most.less(below) | off.less(least);
        let mut missed = off.less(most) & least.less(below);
        if front_only {
            missed = missed | off.less(least);
        }
        let high = last * s.splat(INFLATE);
        if !closely {
            return Within { inside, missed, low: first, high };
        }
        let reach = last.abs().max(first.abs());
        let mean = weighed / sum;
        let blur = (off * s.splat(4.0) / sum.abs()) * (last - first) + reach * s.splat(BLUR);
        // Unless something overflows or vanishes.
        let told = inside
            & first.less_or_equal(mean)
            & mean.less_or_equal(high)
            & s.splat(f32::MIN_POSITIVE).less_or_equal(sum.abs() * reach);
        let low = N::select(told, first.max(mean - blur), first);
        let high = N::select(told, high.min(mean + blur), high);
        Within { inside, missed, low, high }
    }
}

impl Group {
    /// Tests a triangle, and lets it wait for the rays that all but certainly meet it before all else; with
    /// `any`, ends those that certainly meet it. `size` is more than its extent along any axis; `waiting` has the corners of what waits.
    #[inline(always)]
    pub(super) fn test<S: Instructions>(
        &mut self,
        s: S,
        terms: &Terms,
        which: Which,
        size: f32,
        waiting: &mut Corners,
    ) -> Told {
        let [a, b, c] = &which.corners;
        let [kx, ky, kz] = terms.way.axes();
        let (ox, oy, oz) = (s.load(&self.origin[kx]), s.load(&self.origin[ky]), s.load(&self.origin[kz]));
        let (sx, sy) = (s.load(&self.shear[0]), s.load(&self.shear[1]));
        let t_max = s.load(&self.t_max);
        let off = terms.bound.of(size);
        let (zero, bound) = (s.splat(0.0), s.splat(off));
        let (az, bz, cz) = (s.splat(a[2]) - oz, s.splat(b[2]) - oz, s.splat(c[2]) - oz);
        let (ax, ay) = (s.splat(a[0]) - ox - sx * az, s.splat(a[1]) - oy - sy * az);
        let (bx, by) = (s.splat(b[0]) - ox - sx * bz, s.splat(b[1]) - oy - sy * bz);
        let (cx, cy) = (s.splat(c[0]) - ox - sx * cz, s.splat(c[1]) - oy - sy * cz);
        let (wa, wb, wc) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
        let (least, most) = (wa.min(wb).min(wc), wa.max(wb).max(wc));
        let missed = bound.less(most) & least.less(s.splat(-off));
        let mut met = !missed & zero.less(t_max);
        if terms.front_only {
            met = met & !bound.less(least);
        }
        if S::Sixteen::bits(met) == 0 {
            return Told { taken: 0, undecided: 0 };
        }
        let along = s.load(&self.reciprocal[kz]);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let seen = Seen {
            least,
            most,
            sum: wa + wb + wc,
            weighed: wa * ta + wb * tb + wc * tc,
            first: ta.min(tb).min(tc) * s.splat(DEFLATE),
            last: ta.max(tb).max(tc),
        };
        let end = t_max.min(s.splat(f32::MAX));
        let met = met & !(end.less(seen.first) | seen.last.less_or_equal(zero));
        let certainly =
            Certainly { bound: terms.bound.splat(s), area: least.abs().max(most.abs()), along: along.abs(), end };
        // For a shadow t is seldom of interest; for the nearest hit, bounds that are close leave out more.
        let Within { inside, low, high, .. } = seen.within(s, bound, terms.front_only, !terms.any);
        let take = met & inside & certainly.met(s, terms, self, low, high);
        self.take(s, take, [low, high], terms.any, which, waiting);
        let gone = inside & (high.less_or_equal(zero) | end.less(low));
        let undecided = met & !(take | gone);
        let (mut taken, mut left) = (S::Sixteen::bits(take), S::Sixteen::bits(undecided));
        if left != 0 {
            // A closer look at triangles near the origin with less error than at those at the scene's other end.
            let farthest = |x: f32, y: f32, z: f32, o: S::Sixteen| {
                (s.splat(x) - o).abs().max((s.splat(y) - o).abs()).max((s.splat(z) - o).abs())
            };
            let distance =
                farthest(a[0], b[0], c[0], ox).max(farthest(a[1], b[1], c[1], oy)).max(farthest(a[2], b[2], c[2], oz));
            let bound = Bound::of_sixteen(s, distance);
            let Within { inside, missed, low, high } = seen.within(s, bound.for_size(s, size), terms.front_only, true);
            // A triangle may be met again in another leaf.
            let undecided = undecided & !self.knows(s, which.id);
            let inside = undecided & inside & !missed;
            let certainly = Certainly { bound, ..certainly };
            let take = inside & certainly.met(s, terms, self, low, high);
            let gone = (inside & (high.less_or_equal(zero) | end.less(low))) | missed;
            self.take(s, take, [low, high], terms.any, which, waiting);
            taken |= S::Sixteen::bits(take);
            left = S::Sixteen::bits(undecided & !(take | gone));
        }
        Told { taken, undecided: left }
    }

    /// The rays whose `known` is a triangle.
    #[inline(always)]
    fn knows<S: Instructions>(&self, s: S, id: u32) -> Mask<S> {
        let mut same = 0;
        for (i, &known) in self.known.0.iter().enumerate() {
            same |= u32::from(known == id) << i;
        }
        s.mask(same)
    }

    #[inline(always)]
    fn take<S: Instructions>(
        &mut self,
        s: S,
        take: Mask<S>,
        [low, high]: [S::Sixteen; 2],
        any: bool,
        which: Which,
        waiting: &mut Corners,
    ) {
        if any {
            s.splat(f32::NEG_INFINITY).store_where(take, &mut self.t_max);
        } else {
            high.store_where(take, &mut self.t_max);
            low.store_where(take, &mut self.low);
            S::Sixteen::put_where(take, which.place, &mut self.waits);
            S::Sixteen::put_where(take, which.id, &mut self.known);
            for (rows, corner) in waiting.iter_mut().zip(which.corners) {
                for (row, x) in rows.iter_mut().zip(corner) {
                    s.splat(x).store_where(take, row);
                }
            }
        }
    }
}
