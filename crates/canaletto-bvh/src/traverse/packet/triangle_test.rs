//! The f32 test of a triangle against the rays of a group: `triangle4::CoarseTest` and `RefinedTest` with rays for
//! lanes.

use super::group::{Corners, RayGroup};
use crate::primitive::edge_error::EdgeError;
use crate::primitive::triangle4::T_ERROR;
use crate::ray::Axis;
use crate::simd::{Instructions, Mask, Row, Vector};
use crate::slab::{DEFLATE, INFLATE};

/// The parameters of the test, equal for all triangles.
#[derive(Clone, Copy)]
pub(super) struct TestParams {
    /// The rows of the rays' axis order.
    pub(super) rows: [Axis; 3],
    pub(super) axes: [usize; 3],
    pub(super) bound: EdgeError,
    /// Whether triangles seen from behind are ignored.
    pub(super) front_only: bool,
    /// Whether the query is any-hit.
    pub(super) any: bool,
}

/// A triangle and its place in the tree.
#[derive(Clone, Copy)]
pub(super) struct TriangleRef {
    /// Four times its block plus its lane.
    pub(super) place: u32,
    pub(super) id: u32,
    /// The corners, with coordinates in the order of the axis order's `rows`.
    pub(super) corners: [[f32; 3]; 3],
}

/// The result of a test: masks with one bit for each ray of the group.
#[derive(Clone, Copy)]
pub(super) struct TestMasks {
    /// Rays for which the triangle is now pending, or that have ended.
    pub(super) taken: u32,
    /// Rays that have to be tested alone.
    pub(super) undecided: u32,
}

impl TestMasks {
    pub(super) const NOTHING: Self = Self { taken: 0, undecided: 0 };
}

/// The numbers for deciding whether a hit is certain.
#[derive(Clone, Copy)]
struct CertainHit<N> {
    bound: EdgeError<N>,
    area: N,
    along: N,
    end: N,
}

impl<N: Vector> CertainHit<N> {
    /// The rays with a certain hit between `low` and `high`, if no hit nearer than `nearest` is known.
    #[inline(always)]
    fn met<S: Instructions<Vector = N>>(self, s: S, any: bool, nearest: N, low: N, high: N) -> N::Mask {
        let zero = s.splat(0.0);
        if any {
            let large = self.bound.area.less(self.area) & (self.bound.volume * self.along).less(self.area * low);
            s.splat(f32::MIN_POSITIVE).less_or_equal(low) & large & high.less_or_equal(self.end)
        } else {
            zero.less(low) & high.less(nearest)
        }
    }
}

/// A triangle in the sheared space of the rays.
#[derive(Clone, Copy)]
struct Sheared<N> {
    /// The corners' distances along the longest axis.
    z: [N; 3],
    /// The edge functions, and the smallest and the largest of them.
    edges: [N; 3],
    least: N,
    most: N,
}

impl<N: Vector> Sheared<N> {
    /// The rays for which the edge functions certainly differ in sign, if they are wrong by no more than `off`.
    #[inline(always)]
    fn missed<S: Instructions<Vector = N>>(&self, s: S, off: N) -> N::Mask {
        off.less(self.most) & self.least.less(s.splat(0.0) - off)
    }
}

/// The f32 numbers of rays and a triangle.
#[derive(Clone, Copy)]
struct EdgeValues<N> {
    /// The smallest and the largest edge function, and their sum.
    least: N,
    most: N,
    sum: N,
    /// The sum of the edge functions times t at the opposite corners.
    weighed: N,
    /// The bounds of t of all points of the triangle.
    first: N,
    last: N,
}

/// The certain results of [`EdgeValues`], if the edge functions are wrong by no more than a bound.
struct HitBounds<N: Vector> {
    /// The line passes between the edges.
    inside: N::Mask,
    /// The line misses the triangle, or the triangle is ignored.
    missed: N::Mask,
    /// The bounds of a hit's t, if there is a hit.
    low: N,
    high: N,
}

impl<N: Vector> EdgeValues<N> {
    /// With `use_edges`, t is bounded by the edge functions where that helps, as in `RefinedTest::between`. Otherwise
    /// it is bounded by the corners alone.
    #[inline(always)]
    fn within<S: Instructions<Vector = N>>(self, s: S, off: N, front_only: bool, use_edges: bool) -> HitBounds<N> {
        let Self { least, most, sum, weighed, first, last } = self;
        let below = s.splat(0.0) - off;
        let inside = most.less(below) | off.less(least);
        let mut missed = off.less(most) & least.less(below);
        if front_only {
            missed = missed | off.less(least);
        }
        let high = last * s.splat(INFLATE);
        if !use_edges {
            return HitBounds { inside, missed, low: first, high };
        }
        let reach = last.abs().max(first.abs());
        let mean = weighed / sum;
        let t_error = (off * s.splat(4.0) / sum.abs()) * (last - first) + reach * s.splat(T_ERROR);
        // Valid unless something overflows or vanishes.
        let results = inside
            & first.less_or_equal(mean)
            & mean.less_or_equal(high)
            & s.splat(f32::MIN_POSITIVE).less_or_equal(sum.abs() * reach);
        let low = N::select(results, first.max(mean - t_error), first);
        let high = N::select(results, high.min(mean + t_error), high);
        HitBounds { inside, missed, low, high }
    }
}

/// The largest distance of three numbers from those of the rays. Not a closure: that would be a function without the
/// instructions.
#[inline(always)]
fn farthest<S: Instructions>(s: S, part: usize, ([x, y, z], origin): ([f32; 3], &Row<f32>)) -> S::Vector {
    let o = s.load(origin, part);
    (s.splat(x) - o).abs().max((s.splat(y) - o).abs()).max((s.splat(z) - o).abs())
}

impl RayGroup {
    /// The triangle of these corners in the sheared space of the rays of a part. With `FROM_CORNERS`, vectors run from
    /// the corners to the origins, so that z has the opposite sign. The subtraction can then read the corners from
    /// memory, which pays where little else is done. With `FROM_CORNERS`, only misses can be concluded.
    #[inline(always)]
    fn shear_triangle<S: Instructions, const FROM_CORNERS: bool>(
        &self,
        s: S,
        part: usize,
        [kx, ky, kz]: [usize; 3],
        [a, b, c]: &[[f32; 3]; 3],
    ) -> Sheared<S::Vector> {
        let (ox, oy, oz) =
            (s.load(&self.origin[kx], part), s.load(&self.origin[ky], part), s.load(&self.origin[kz], part));
        let (sx, sy) = (s.load(&self.shear[0], part), s.load(&self.shear[1], part));
        // In this order, since AVX2 has sixteen registers.
        macro_rules! from {
            ($corner:expr, $origin:ident) => {
                if FROM_CORNERS { $origin - s.splat($corner) } else { s.splat($corner) - $origin }
            };
        }
        let (az, bz, cz) = (from!(a[2], oz), from!(b[2], oz), from!(c[2], oz));
        let (ax, ay) = (from!(a[0], ox).minus_product(sx, az), from!(a[1], oy).minus_product(sy, az));
        let (bx, by) = (from!(b[0], ox).minus_product(sx, bz), from!(b[1], oy).minus_product(sy, bz));
        let (cx, cy) = (from!(c[0], ox).minus_product(sx, cz), from!(c[1], oy).minus_product(sy, cz));
        // Fused where only misses can be concluded. `EdgeError` holds all the more for rays that hit the triangle, but
        // for the others the edge functions may now all have one sign.
        macro_rules! difference {
            ($a:ident * $b:ident - $c:ident * $d:ident) => {
                if FROM_CORNERS { ($a * $b).minus_product($c, $d) } else { $a * $b - $c * $d }
            };
        }
        let wa = difference!(bx * cy - by * cx);
        let wb = difference!(cx * ay - cy * ax);
        let wc = difference!(ax * by - ay * bx);
        Sheared { z: [az, bz, cz], edges: [wa, wb, wc], least: wa.min(wb).min(wc), most: wa.max(wb).max(wc) }
    }

    /// Whether any active ray of a part may hit the triangle of these corners, whatever its t. `size` is larger than
    /// its extent along any axis.
    #[inline(always)]
    pub(super) fn may_meet<S: Instructions>(
        &self,
        s: S,
        part: usize,
        params: &TestParams,
        corners: &[[f32; 3]; 3],
        size: f32,
    ) -> bool {
        let seen = self.shear_triangle::<S, true>(s, part, params.axes, corners);
        let missed = seen.missed(s, s.splat(params.bound.error(size)));
        S::Vector::lanes(!missed & s.splat(0.0).less(s.load(&self.t_max, part))) != 0
    }

    /// Tests a triangle against the rays of a part. It becomes pending for the rays that almost certainly hit it before
    /// all else. In an any-hit query, the rays that certainly hit it end. `size` is larger than its extent along any
    /// axis; `waiting` holds the corners of the pending triangles.
    #[inline(always)]
    pub(super) fn test<S: Instructions>(
        &mut self,
        s: S,
        part: usize,
        params: &TestParams,
        which: TriangleRef,
        size: f32,
        waiting: &mut Corners,
    ) -> TestMasks {
        let seen = self.shear_triangle::<S, false>(s, part, params.axes, &which.corners);
        let Sheared { z: [az, bz, cz], edges: [wa, wb, wc], least, most } = seen;
        let t_max = s.load(&self.t_max, part);
        let (zero, bound) = (s.splat(0.0), s.splat(params.bound.error(size)));
        let mut met = !seen.missed(s, bound) & zero.less(t_max);
        if params.front_only {
            met = met & !bound.less(least);
        }
        if S::Vector::lanes(met) == 0 {
            return TestMasks::NOTHING;
        }
        let along = s.load(&self.reciprocal[params.axes[2]], part);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let seen = EdgeValues {
            least,
            most,
            sum: wa + wb + wc,
            weighed: wa * ta + wb * tb + wc * tc,
            first: ta.min(tb).min(tc) * s.splat(DEFLATE),
            last: ta.max(tb).max(tc),
        };
        let end = s.splat(f32::MAX).min(t_max);
        let met = met & !(end.less(seen.first) | seen.last.less_or_equal(zero));
        let certainly =
            CertainHit { bound: params.bound.splat(s), area: least.abs().max(most.abs()), along: along.abs(), end };
        // For shadow rays t seldom matters. For the nearest hit, close bounds cull more.
        let HitBounds { inside, low, high, .. } = seen.within(s, bound, params.front_only, !params.any);
        let take = met & inside & certainly.met(s, params.any, s.load(&self.low, part), low, high);
        if params.any {
            self.end(s, part, take);
        } else {
            self.take(s, part, take, [low, high], which, waiting);
        }
        let culled = inside & (high.less_or_equal(zero) | end.less(low));
        let undecided = met & !(take | culled);
        let (mut taken, mut left) = (S::Vector::bits(take, part), S::Vector::bits(undecided, part));
        if left != 0 {
            // Refine by each ray's own error bound: the error near the origin is smaller than at the other end of the
            // scene.
            let far = |axis: usize| {
                let [a, b, c] = &which.corners;
                ([a[axis], b[axis], c[axis]], &self.origin[params.axes[axis]])
            };
            let bound = EdgeError::of_rays(
                s,
                farthest(s, part, far(0)).max(farthest(s, part, far(1))).max(farthest(s, part, far(2))),
            );
            let HitBounds { inside, missed, low, high } =
                seen.within(s, bound.error(s.splat(size)), params.front_only, true);
            // A ray may hit a triangle again in another leaf.
            let undecided = undecided & !self.has_seen(s, part, which.id);
            let inside = undecided & inside & !missed;
            let certainly = CertainHit { bound, ..certainly };
            let take = inside & certainly.met(s, params.any, s.load(&self.low, part), low, high);
            let culled = (inside & (high.less_or_equal(zero) | end.less(low))) | missed;
            if params.any {
                self.end(s, part, take);
            } else {
                self.take(s, part, take, [low, high], which, waiting);
            }
            taken |= S::Vector::bits(take, part);
            left = S::Vector::bits(undecided & !(take | culled), part);
        }
        TestMasks { taken, undecided: left }
    }

    /// The rays whose `last_seen` is this triangle.
    #[inline(always)]
    fn has_seen<S: Instructions>(&self, s: S, part: usize, id: u32) -> Mask<S> {
        let mut same = 0;
        for (i, &last_seen) in self.last_seen.0.iter().enumerate() {
            same |= u32::from(last_seen == id) << i;
        }
        s.mask(same, part)
    }

    #[inline(always)]
    fn end<S: Instructions>(&mut self, s: S, part: usize, rays: Mask<S>) {
        s.splat(f32::NEG_INFINITY).store_where(rays, &mut self.t_max, part);
    }

    #[inline(always)]
    fn take<S: Instructions>(
        &mut self,
        s: S,
        part: usize,
        rays: Mask<S>,
        [low, high]: [S::Vector; 2],
        which: TriangleRef,
        waiting: &mut Corners,
    ) {
        if S::Vector::lanes(rays) == 0 {
            return;
        }
        high.store_where(rays, &mut self.t_max, part);
        low.store_where(rays, &mut self.low, part);
        S::Vector::store_u32_where(rays, which.place, &mut self.pending, part);
        S::Vector::store_u32_where(rays, which.id, &mut self.last_seen, part);
        for (rows, corner) in waiting.iter_mut().zip(which.corners) {
            for (row, x) in rows.iter_mut().zip(corner) {
                s.splat(x).store_where(rays, row, part);
            }
        }
    }
}
