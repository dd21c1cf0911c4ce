//! Four triangles side by side.
//!
//! 1. [`Triangle4::test`] tests all four in f32 ([`CoarseTest`]) and culls nearly all triangles that the ray misses.
//! 2. [`Triangle4::refine`] bounds t and the edge functions more closely ([`RefinedTest`]), and decides most of the
//!    rest. For instance, it culls the triangle on which the ray starts.
//! 3. The exact test (`triangle`) has the last word. For the nearest hit of a single ray there is usually one exact
//!    test: a triangle that lies before all others stays pending until the traversal has ended ([`Search`]). In streams
//!    no triangle stays pending: the exact test follows at once, for all four triangles side by side (`exact4`).
#![allow(unsafe_code)] // Rows are read by their byte offsets.

use glam::{Vec3, Vec4};

use super::triangle::{Triangle, TriangleHit, intersect_exactly};
use crate::PrimitiveHit;
use crate::min_max::min;
use crate::node::Node;
use crate::ray::Axis;
use crate::slab::{DEFLATE, INFLATE};
use crate::{Aabb, FilterFunction, PreparedRay, Ray};

use super::edge_error::EdgeError;

/// Four triangles: the rows x, y and z of each corner, with one triangle per lane. An unused lane has corners at
/// infinity, which no ray reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Triangle4 {
    corners: [[Vec4; 3]; 3],
    /// The ids in the lower 28 bits. The upper bits of the last two hold an exponent: that of a power of two above the
    /// sizes of all triangles, or of infinity.
    ids: [u32; 4],
}

/// The data of a tree over triangles that kernels read.
#[derive(Clone, Copy)]
pub(crate) struct TriangleScene<'a> {
    pub(crate) nodes: &'a [Node],
    pub(crate) blocks: &'a [Triangle4],
    pub(crate) bounds: Aabb,
    /// Whether triangles seen from behind are ignored.
    pub(crate) front_only: bool,
}

impl TriangleScene<'_> {
    /// Prepares the rays of a stream and returns one error bound for all of them. A bound for each ray would be closer,
    /// but candidates are refined anyway.
    pub(crate) fn prepare(&self, rays: &[Ray], prepared: &mut Vec<PreparedRay>) -> EdgeError {
        let [low, high] = PreparedRay::prepare_all(rays, prepared);
        EdgeError::within(low, high, &self.bounds)
    }
}

/// The number of bits of an id.
pub(crate) const ID_BITS: u32 = 28;
const ID: u32 = (1 << ID_BITS) - 1;

impl Triangle4 {
    /// A block of 1 to 4 triangles, each with its id.
    pub(crate) fn new(triangles: impl Iterator<Item = (u32, [Vec3; 3])>) -> Self {
        let (mut ids, mut all) = ([ID; 4], [[Vec3::INFINITY; 3]; 4]);
        let mut size = 0.0f32;
        for ((own_id, own), (id, corners)) in ids.iter_mut().zip(&mut all).zip(triangles) {
            (*own_id, *own) = (id, corners);
            let bounds = Aabb::from_points(corners);
            size = size.max((bounds.max - bounds.min).max_element());
        }
        // An exponent of eight bits. That of infinity, for a difference that overflows, is the largest.
        let exponent = ((size.to_bits() >> 23) + 1).min(255);
        ids[2] |= exponent << ID_BITS;
        ids[3] |= exponent >> 4 << ID_BITS;
        let [a, b, c, d] = all;
        let row = |i: usize, k: usize| Vec4::new(a[i][k], b[i][k], c[i][k], d[i][k]);
        Self { corners: [0, 1, 2].map(|i| [row(i, 0), row(i, 1), row(i, 2)]), ids }
    }

    /// The number of triangles.
    pub(crate) fn len(&self) -> usize {
        self.corners[0][0].cmplt(Vec4::INFINITY).bitmask().count_ones() as usize
    }

    /// A block of the triangles of this block, with new corners.
    pub(crate) fn with(&self, corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        Self::new((0..self.len()).map(|lane| (self.id(lane), corners(self.id(lane)))))
    }

    /// A number larger than any triangle's extent along any axis.
    #[inline(always)]
    pub(crate) fn size(&self) -> f32 {
        f32::from_bits((self.ids[2] & !ID) >> 5 | (self.ids[3] & !ID) >> 1)
    }

    #[inline(always)]
    pub(crate) fn id(&self, lane: usize) -> u32 {
        self.ids[lane & 3] & ID
    }

    /// The triangle in this lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Triangle {
        let corner = |rows: &[Vec4; 3]| {
            let at = |k: usize| rows[k].as_ref()[lane & 3];
            [at(0), at(1), at(2)]
        };
        let [a, b, c] = &self.corners;
        Triangle::new([corner(a).into(), corner(b).into(), corner(c).into()])
    }

    /// The corners of the triangle in this lane, with coordinates in the order of a ray's `rows`.
    #[inline(always)]
    pub(crate) fn ordered(&self, lane: usize, rows: [Axis; 3]) -> [[f32; 3]; 3] {
        let corner = |corner: usize| {
            // SAFETY: the offset is that of the axis's row among the three rows of a corner, and each row has four
            // numbers.
            let at = |axis: Axis| unsafe {
                *self.corners[corner].as_ptr().byte_add(axis.offset()).cast::<f32>().add(lane & 3)
            };
            [at(rows[0]), at(rows[1]), at(rows[2])]
        };
        [corner(0), corner(1), corner(2)]
    }

    /// A corner's coordinates along an axis, for all four triangles.
    #[inline(always)]
    pub(super) fn row(&self, corner: usize, axis: Axis) -> Vec4 {
        // SAFETY: the offset is that of the axis's row among the three rows of a corner.
        unsafe { *self.corners[corner].as_ptr().byte_add(axis.offset()) }
    }

    /// The lane that has this id, as a bit.
    #[inline(always)]
    pub(crate) fn lane_of(&self, id: u32) -> u32 {
        (0..4).fold(0, |lanes, lane| lanes | u32::from(self.id(lane) == id) << lane)
    }

    /// The hit on the triangle in this lane, by the exact test.
    #[inline(always)]
    fn intersect(&self, lane: usize, ray: &PreparedRay, t_max: f32) -> Option<TriangleHit> {
        let bounds = self.triangle(lane).bounds();
        intersect_exactly(ray, &self.ordered(lane, ray.axis_order.rows), &bounds, t_max)
    }

    /// Tests the triangle in this lane exactly and stores it in `nearest` if it is nearer. Returns whether it is.
    #[inline(always)]
    pub(crate) fn accept_if_nearer(
        &self,
        lane: usize,
        ray: &PreparedRay,
        nearest: &mut PrimitiveHit,
        front_only: bool,
    ) -> bool {
        let id = self.id(lane);
        if let Some(hit) = self.intersect(lane, ray, nearest.t)
            && (hit.t < nearest.t || id < nearest.id)
            && (hit.front || !front_only)
        {
            *nearest = PrimitiveHit { t: hit.t, id, part: 0, uv: [hit.u, hit.v] };
            return true;
        }
        false
    }

    /// The coarse test of all four triangles in f32.
    #[inline(always)]
    pub(crate) fn test(&self, ray: &PreparedRay, bound: EdgeError, t_max: f32) -> CoarseTest {
        let [kx, ky, kz] = ray.axis_order.rows;
        let row = |corner, k| self.row(corner, k);
        let origin = |k: Axis| Vec4::splat(ray.origin(k));
        let (ox, oy, oz) = (origin(kx), origin(ky), origin(kz));
        let (sx, sy) = (Vec4::splat(ray.shear[0]), Vec4::splat(ray.shear[1]));
        // The vectors run from the corners to the origin, so that the subtraction can read the corners from memory.
        let (az, bz, cz) = (oz - row(0, kz), oz - row(1, kz), oz - row(2, kz));
        // The triangle lies between the corners along the longest axis, and so does the t of `clamp_to_box`, which uses
        // these very products.
        let along = Vec4::splat(ray.along);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let low = ta.min(tb).min(tc) * DEFLATE;
        let last = ta.max(tb).max(tc);
        // At most the largest float, so that corners at infinity are beyond it.
        let beyond = low.cmpgt(Vec4::splat(min(f32::MAX, t_max))) | last.cmple(Vec4::ZERO);
        let (ax, ay) = (ox - row(0, kx) - sx * az, oy - row(0, ky) - sy * az);
        let (bx, by) = (ox - row(1, kx) - sx * bz, oy - row(1, ky) - sy * bz);
        let (cx, cy) = (ox - row(2, kx) - sx * cz, oy - row(2, ky) - sy * cz);
        let wa = bx * cy - by * cx;
        let wb = cx * ay - cy * ax;
        let wc = ax * by - ay * bx;
        let off = Vec4::splat(bound.error(self.size()));
        let (least, most) = (wa.min(wb).min(wc), wa.max(wb).max(wc));
        let missed = most.cmpgt(off) & least.cmplt(-off);
        let mut candidates = !(missed | beyond).bitmask() & 15;
        if !ray.regular {
            // For an irregular ray, nothing is known to be beyond the end.
            candidates &= self.corners[0][0].cmplt(Vec4::INFINITY).bitmask();
        }
        let (sum, weighed) = (wa + wb + wc, wa * ta + wb * tb + wc * tc);
        CoarseTest { candidates, low, last, least, most, sum, weighed }
    }

    /// Refines the coarse test by an error bound for this block: the error near the origin is smaller than at the other
    /// end of the scene.
    #[inline(always)]
    pub(crate) fn refine<'a>(&self, ray: &PreparedRay, tested: &'a CoarseTest) -> RefinedTest<'a> {
        let ([x, y, z], origin, size) = (self.corners[0], ray.ray.origin, Vec4::splat(self.size()));
        let far = (x - Vec4::splat(origin.x)).abs().max((y - Vec4::splat(origin.y)).abs());
        let far = far.max((z - Vec4::splat(origin.z)).abs());
        // The other corners are no farther from the first corner than `size`.
        let bound = EdgeError::of_triangles(far + size);
        RefinedTest { tested, off: bound.error(size), bound }
    }

    /// The lane of a candidate that is hit at or before `t_max` and for whose id `counts` holds. Candidates in `surely`
    /// are certainly hit and need no exact test.
    #[inline(always)]
    pub(crate) fn any(
        &self,
        (surely, mut candidates): (u32, u32),
        ray: &PreparedRay,
        t_max: f32,
        front_only: bool,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        while candidates != 0 {
            let lane = candidates.trailing_zeros();
            let hit = surely >> lane & 1 == 1
                || self.intersect(lane as usize, ray, t_max).is_some_and(|hit| hit.front || !front_only);
            if hit && counts(self.id(lane as usize)) {
                return Some(lane);
            }
            candidates &= candidates - 1;
        }
        None
    }
}

/// The result of the f32 test of a block.
#[derive(Clone, Copy)]
pub(crate) struct CoarseTest {
    /// The triangles that may be hit, one bit for each.
    pub(crate) candidates: u32,
    /// A lower bound of t of a hit.
    low: Vec4,
    /// The t of the farthest corner.
    last: Vec4,
    /// The smallest and the largest edge function.
    least: Vec4,
    most: Vec4,
    /// The sum of the edge functions, and the sum of the corners' t weighted with them.
    sum: Vec4,
    weighed: Vec4,
}

/// The error of a hit's t in addition to that of the edge functions, relative to the largest t of a corner: 16 units in
/// the last place, including what `clamp_to_box` adds.
pub(crate) const T_ERROR: f32 = 16.0 * f32::EPSILON;

/// The result of the test of a block with its own error bound.
#[derive(Clone, Copy)]
pub(crate) struct RefinedTest<'a> {
    tested: &'a CoarseTest,
    /// The error bound of the edge functions.
    off: Vec4,
    bound: EdgeError<Vec4>,
}

impl RefinedTest<'_> {
    /// The triangles that certainly show their front, if they are hit at all.
    #[inline(always)]
    fn front(&self) -> u32 {
        self.tested.most.cmplt(-self.off).bitmask()
    }

    /// The triangles that certainly show their back, if they are hit at all.
    #[inline(always)]
    fn back(&self) -> u32 {
        self.tested.least.cmpgt(self.off).bitmask()
    }

    /// Two masks of candidates, for hits at or before `t_max`. The first holds those that the exact test would
    /// certainly report: the line passes between the edges, and the hit lies between origin and end. Area and volume
    /// are too large for the test to take the triangle for degenerate. The second holds all candidates that the exact
    /// test may report.
    #[inline(always)]
    pub(crate) fn any(&self, ray: &PreparedRay, t_max: f32, front_only: bool) -> (u32, u32) {
        let area = self.tested.least.abs().max(self.tested.most.abs());
        let (low, high) = self.t_bounds();
        let large = area.cmpgt(self.bound.area) & (area * low).cmpgt(self.bound.volume * Vec4::splat(ray.along.abs()));
        let between = low.cmpge(Vec4::splat(f32::MIN_POSITIVE)) & high.cmple(Vec4::splat(min(f32::MAX, t_max)));
        let candidates = self.remaining(low, high, t_max, front_only);
        (candidates & (self.front() | self.back()) & (large & between).bitmask(), candidates)
    }

    /// The candidates that may be hit at or before `t_max`.
    #[inline(always)]
    pub(crate) fn closest(&self, t_max: f32, front_only: bool) -> u32 {
        let (low, high) = self.t_bounds();
        self.remaining(low, high, t_max, front_only)
    }

    /// The candidates that may be hit at or before `t_max`, if t lies between `low` and `high`.
    #[inline(always)]
    fn remaining(&self, low: Vec4, high: Vec4, t_max: f32, front_only: bool) -> u32 {
        let gone = high.cmple(Vec4::ZERO) | low.cmpgt(Vec4::splat(t_max));
        self.tested.candidates & !gone.bitmask() & !if front_only { self.back() } else { 0 }
    }

    /// The bounds of a hit's t. They are the t of the corners. Where the line certainly passes between the edges, they
    /// are close to the mean of the corners' t, weighted with the edge functions.
    #[inline(always)]
    fn t_bounds(&self) -> (Vec4, Vec4) {
        let &CoarseTest { low, last, least, most, sum, weighed, .. } = self.tested;
        let inside = most.cmplt(-self.off) | least.cmpgt(self.off);
        let (high, size) = (last * INFLATE, last.abs().max(low.abs()));
        let mean = weighed / sum;
        let off = (self.off * 4.0 / sum.abs()) * (last - low) + size * T_ERROR;
        // Valid unless something overflows or vanishes.
        let told =
            inside & mean.cmpge(low) & mean.cmple(high) & (sum.abs() * size).cmpge(Vec4::splat(f32::MIN_POSITIVE));
        (Vec4::select(told, low.max(mean - off), low), Vec4::select(told, high.min(mean + off), high))
    }
}

/// The state of a ray's search for its nearest triangle. A triangle is left *pending* if its t is bounded, it is almost
/// certainly hit, and it lies before all others. Its exact test waits until the traversal has ended. That test may fail
/// for an origin so close to the triangle's plane that rounding can't decide. The search has then failed, and the ray
/// has to be traced again without pending triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    bound: EdgeError,
    /// A lower bound of t on the pending triangle. Without a pending triangle, the t of the nearest hit.
    low: f32,
    /// The pending triangle: four times its block plus its lane.
    pending: u32,
    /// The id of the pending triangle, or of the last triangle that was pending or nearest. The ray may hit it again
    /// in another leaf.
    last_seen: u32,
    /// Whether a pending triangle turned out not to be hit.
    pub(crate) failed: bool,
}

const NOTHING: u32 = u32::MAX;

impl Search {
    #[inline(always)]
    pub(crate) fn new(ray: &PreparedRay, bounds: &Aabb, t_max: f32) -> Self {
        Self {
            bound: EdgeError::new(ray, bounds),
            low: t_max,
            pending: NOTHING,
            last_seen: PrimitiveHit::NONE,
            failed: false,
        }
    }

    /// The coarse test of a block. Returns also whether [`Search::complete`] has anything to do.
    #[inline(always)]
    pub(crate) fn test(&self, block: &Triangle4, ray: &PreparedRay, t_max: f32) -> (bool, CoarseTest) {
        let tested = block.test(ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    /// Refines the candidates of a block and tests them. `t_max` is lowered to an upper bound of the nearest hit.
    #[inline(always)]
    pub(crate) fn test_candidates(
        &mut self,
        scene: TriangleScene<'_>,
        index: u32,
        ray: &PreparedRay,
        tested: &CoarseTest,
        nearest: &mut PrimitiveHit,
        t_max: &mut f32,
    ) {
        let block = &scene.blocks[index as usize];
        let refined = block.refine(ray, tested);
        let (low, high) = refined.t_bounds();
        let mut candidates = refined.remaining(low, high, *t_max, scene.front_only);
        let certain = refined.front() | refined.back();
        let (low, high) = (low.to_array(), high.to_array());
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize & 3;
            candidates &= candidates - 1;
            if low[lane] > *t_max || block.id(lane) == self.last_seen {
                continue;
            }
            if certain >> lane & 1 == 1 && low[lane] > 0.0 && high[lane] < self.low {
                self.pending = index << 2 | lane as u32;
                self.last_seen = block.id(lane);
                self.low = low[lane];
                *t_max = high[lane];
            } else {
                self.resolve(scene, ray, nearest, *t_max);
                if block.accept_if_nearer(lane, ray, nearest, scene.front_only) {
                    self.last_seen = block.id(lane);
                }
                self.low = nearest.t;
                *t_max = nearest.t;
            }
        }
    }

    /// Tests the pending triangle exactly, if there is one.
    #[inline(always)]
    pub(crate) fn resolve(
        &mut self,
        scene: TriangleScene<'_>,
        ray: &PreparedRay,
        nearest: &mut PrimitiveHit,
        t_max: f32,
    ) {
        if self.pending == NOTHING {
            return;
        }
        let block = &scene.blocks[(self.pending >> 2) as usize];
        let met = block.accept_if_nearer(self.pending as usize & 3, ray, nearest, scene.front_only);
        self.failed |= !met || nearest.t > t_max;
        self.pending = NOTHING;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn sizes_are_never_less_than_triangles_are() {
        for power in -149..=127 {
            for part in [1.0, 1.5, 1.999_999] {
                let size = (2f64.powi(power) * part) as f32;
                let corners = [Vec3::ZERO, Vec3::X * size, Vec3::Y * -size];
                let block = Triangle4::new([(7, corners), (9, [Vec3::ZERO; 3])].into_iter());
                assert!(
                    block.size() > size && (block.size() <= 2.0 * size || power < -125),
                    "{size}: {}",
                    block.size()
                );
                assert_eq!([block.id(0), block.id(1)], [7, 9]);
            }
        }
        // A difference that overflows.
        let block = Triangle4::new(std::iter::once((3, [Vec3::splat(-3e38), Vec3::splat(3e38), Vec3::ZERO])));
        assert_eq!((block.size(), block.id(0), block.len()), (f32::INFINITY, 3, 1));
    }

    #[test]
    fn what_a_block_is_sure_of_is_so() {
        let random = &mut Random(44);
        let (mut hits, mut candidates, mut surely_hit) = (0, 0, 0);
        for i in 0..200_000 {
            // Triangles from large ones nearby to dots far away, of all magnitudes. Rays are aimed beside, on and next
            // to their borders.
            let far = random.vector() * 10f32.powi(random.below(6) as i32 - 1);
            let scale = 10f32.powi(random.below(60) as i32 - 30);
            let triangles = [0; 4].map(|_| [0; 3].map(|_| (far + random.vector() * [1.0, 1e-2, 1e-4][i % 3]) * scale));
            let [a, b, c] = triangles[random.below(4)];
            let edge = a + (b - a) * random.signed();
            let target = [a, edge, edge + (c - a) * random.signed() * 10f32.powi(-(random.below(8) as i32))];
            let origin = random.vector() * [1.0, 0.0, 1e-3][random.below(3)] * scale;
            let mut direction = target[random.below(3)] - origin;
            direction[random.below(3)] *= [1.0, 1.0, 0.0, 1e-20, 1e-39][random.below(5)];
            let ray = Ray::new(origin, direction * [1.0, 1.0 / scale][i % 2]).prepare();
            let mut bounds = Aabb::from_points(triangles.into_iter().flatten());
            bounds.min -= (bounds.max - bounds.min) * random.below(2) as f32;
            let block = Triangle4::new(triangles.into_iter().enumerate().map(|(id, corners)| (id as u32, corners)));
            let bound = EdgeError::new(&ray, &bounds);
            for t_max in [f32::INFINITY, 1.0] {
                let tested = block.test(&ray, bound, t_max);
                let refined = block.refine(&ray, &tested);
                let (surely, possibly) = refined.any(&ray, t_max, false);
                assert_eq!(possibly, refined.closest(t_max, false));
                for lane in 0..4 {
                    let hit = block.intersect(lane, &ray, t_max);
                    let candidate = possibly >> lane & 1 == 1;
                    assert!(candidate || hit.is_none(), "{ray:?} {block:?}");
                    assert!(surely >> lane & 1 == 0 || hit.is_some(), "{ray:?} {block:?}");
                    if let Some(hit) = hit {
                        let (low, high) = refined.t_bounds();
                        assert!(low[lane] <= hit.t && hit.t <= high[lane] || !ray.regular, "{ray:?} {block:?}");
                        assert!(refined.front() >> lane & 1 == 0 || hit.front, "{ray:?} {block:?}");
                        assert!(refined.back() >> lane & 1 == 0 || !hit.front, "{ray:?} {block:?}");
                    }
                    hits += u32::from(hit.is_some());
                    candidates += u32::from(candidate);
                    surely_hit += surely >> lane & 1;
                }
            }
        }
        assert!(hits > 50_000 && candidates < 1_000_000 && surely_hit > 5_000, "{hits} {candidates} {surely_hit}");
    }
}
