//! Four triangles side by side.
//!
//! A ray tests them in f32, which sorts out nearly all that it misses. Where something may be left, a closer look ([`RefinedTest`]) bounds
//! where it is met, and tells for most that they are or are not: a ray that starts on a triangle doesn't meet it again. The exact kernel
//! (`triangle`) has the last word. For the nearest hit of a single ray it is asked once in general: a
//! triangle that lies before all others waits until the ray's way has ended ([`Search`]). Streams, in which nothing waits for its answer, ask it at
//! once, about all four triangles side by side (`exactly`).
#![allow(unsafe_code)] // Rows told by where they lie.

use glam::{Vec3, Vec4};

use super::triangle::{Triangle, TriangleHit, intersect_exactly};
use crate::PrimitiveHit;
use crate::node::Node;
use crate::ray::Axis;
use crate::slab::{DEFLATE, INFLATE, min};
use crate::{Aabb, PreparedRay, Ray};

use super::edge_error::EdgeError;

/// Four triangles: for each corner the rows x, y and z. Where there are fewer, corners at infinity, which lie beyond all that a ray
/// reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Triangle4 {
    corners: [[Vec4; 3]; 3],
    /// The upper bits of the last two are the exponent of a power of two above the sizes of all triangles, or of infinity.
    ids: [u32; 4],
}

/// A tree over triangles as kernels see it.
#[derive(Clone, Copy)]
pub(crate) struct TriangleScene<'a> {
    pub(crate) nodes: &'a [Node],
    pub(crate) blocks: &'a [Triangle4],
    pub(crate) bounds: Aabb,
    /// TriangleBvh seen from behind don't count.
    pub(crate) front_only: bool,
}

impl TriangleScene<'_> {
    /// Prepares rays of a stream, and tells the bound for all of them: one for each would be closer, but what counts is looked at closer anyway.
    pub(crate) fn prepare(&self, rays: &[Ray], prepared: &mut Vec<PreparedRay>) -> EdgeError {
        let [low, high] = PreparedRay::prepare_all(rays, prepared);
        EdgeError::within(low, high, &self.bounds)
    }
}

/// Bits of an id.
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
        // Eight bits: that of infinity, where a difference overflows, is the greatest.
        let exponent = ((size.to_bits() >> 23) + 1).min(255);
        ids[2] |= exponent << ID_BITS;
        ids[3] |= exponent >> 4 << ID_BITS;
        let [a, b, c, d] = all;
        let row = |i: usize, k: usize| Vec4::new(a[i][k], b[i][k], c[i][k], d[i][k]);
        Self { corners: [0, 1, 2].map(|i| [row(i, 0), row(i, 1), row(i, 2)]), ids }
    }

    /// How many triangles there are.
    pub(crate) fn len(&self) -> usize {
        self.corners[0][0].cmplt(Vec4::INFINITY).bitmask().count_ones() as usize
    }

    /// The same triangles elsewhere.
    pub(crate) fn with(&self, corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        Self::new((0..self.len()).map(|lane| (self.id(lane), corners(self.id(lane)))))
    }

    /// More than any triangle's extent along any axis.
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

    /// The corners of the triangle in this lane, the coordinates in the order of a ray's `rows`.
    #[inline(always)]
    pub(crate) fn ordered(&self, lane: usize, rows: [Axis; 3]) -> [[f32; 3]; 3] {
        let corner = |corner: usize| {
            // SAFETY: there, in the three rows of a corner, lies that of the axis, and each has four numbers.
            let at = |axis: Axis| unsafe {
                *self.corners[corner].as_ptr().byte_add(axis.offset()).cast::<f32>().add(lane & 3)
            };
            [at(rows[0]), at(rows[1]), at(rows[2])]
        };
        [corner(0), corner(1), corner(2)]
    }

    /// A corner's coordinates along an axis.
    #[inline(always)]
    pub(super) fn row(&self, corner: usize, axis: Axis) -> Vec4 {
        // SAFETY: there, in the three rows of a corner, lies that of the axis.
        unsafe { *self.corners[corner].as_ptr().byte_add(axis.offset()) }
    }

    /// The lane that has this id, a bit for it.
    #[inline(always)]
    pub(crate) fn lane_of(&self, id: u32) -> u32 {
        (0..4).fold(0, |lanes, lane| lanes | u32::from(self.id(lane) == id) << lane)
    }

    /// The hit on the triangle in this lane, by the exact kernel.
    #[inline(always)]
    fn intersect(&self, lane: usize, ray: &PreparedRay, t_max: f32) -> Option<TriangleHit> {
        let bounds = self.triangle(lane).bounds();
        intersect_exactly(ray, &self.ordered(lane, ray.axis_order.rows), &bounds, t_max)
    }

    /// Makes the triangle in this lane the nearest if it is. Tells whether it is.
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

    /// What f32 tells of all four.
    #[inline(always)]
    pub(crate) fn test(&self, ray: &PreparedRay, bound: EdgeError, t_max: f32) -> CoarseTest {
        let [kx, ky, kz] = ray.axis_order.rows;
        let row = |corner, k| self.row(corner, k);
        let origin = |k: Axis| Vec4::splat(ray.origin(k));
        let (ox, oy, oz) = (origin(kx), origin(ky), origin(kz));
        let (sx, sy) = (Vec4::splat(ray.shear[0]), Vec4::splat(ray.shear[1]));
        // From corners to the origin, since what is taken off can be read by the instruction that does it.
        let (az, bz, cz) = (oz - row(0, kz), oz - row(1, kz), oz - row(2, kz));
        // Between the corners along the longest axis lies the triangle, and what `clamp_to_box` makes of t: its very products.
        let along = Vec4::splat(ray.along);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let low = ta.min(tb).min(tc) * DEFLATE;
        let last = ta.max(tb).max(tc);
        // Not `t_max` as it is: what lies at infinity is beyond it.
        let beyond = low.cmpgt(Vec4::splat(min(f32::MAX, t_max))) | last.cmple(Vec4::ZERO);
        let (ax, ay) = (ox - row(0, kx) - sx * az, oy - row(0, ky) - sy * az);
        let (bx, by) = (ox - row(1, kx) - sx * bz, oy - row(1, ky) - sy * bz);
        let (cx, cy) = (ox - row(2, kx) - sx * cz, oy - row(2, ky) - sy * cz);
        let wa = bx * cy - by * cx;
        let wb = cx * ay - cy * ax;
        let wc = ax * by - ay * bx;
        let off = Vec4::splat(bound.of(self.size()));
        let (least, most) = (wa.min(wb).min(wc), wa.max(wb).max(wc));
        let missed = most.cmpgt(off) & least.cmplt(-off);
        let mut candidates = !(missed | beyond).bitmask() & 15;
        if !ray.regular {
            // Nothing is known to be beyond.
            candidates &= self.corners[0][0].cmplt(Vec4::INFINITY).bitmask();
        }
        let (sum, weighed) = (wa + wb + wc, wa * ta + wb * tb + wc * tc);
        CoarseTest { candidates, low, last, least, most, sum, weighed }
    }

    /// Looks closer at what was tested: origins near triangles have less error than those at the scene's other end.
    #[inline(always)]
    pub(crate) fn refine<'a>(&self, ray: &PreparedRay, tested: &'a CoarseTest) -> RefinedTest<'a> {
        let ([x, y, z], origin, size) = (self.corners[0], ray.ray.origin, Vec4::splat(self.size()));
        let far = (x - Vec4::splat(origin.x)).abs().max((y - Vec4::splat(origin.y)).abs());
        let far = far.max((z - Vec4::splat(origin.z)).abs());
        // The other corners are no farther from the first than that.
        let bound = EdgeError::of_triangles(far + size);
        RefinedTest { tested, off: bound.of(size), bound }
    }

    /// The lane of one of the candidates that is hit at or before `t_max` and `blocks`. Of those that surely are hit, no exact test is made.
    #[inline(always)]
    pub(crate) fn any(
        &self,
        (surely, mut candidates): (u32, u32),
        ray: &PreparedRay,
        t_max: f32,
        front_only: bool,
        blocks: &mut impl FnMut(u32) -> bool,
    ) -> Option<u32> {
        while candidates != 0 {
            let lane = candidates.trailing_zeros();
            let hit = surely >> lane & 1 == 1
                || self.intersect(lane as usize, ray, t_max).is_some_and(|hit| hit.front || !front_only);
            if hit && blocks(self.id(lane as usize)) {
                return Some(lane);
            }
            candidates &= candidates - 1;
        }
        None
    }
}

/// What f32 tells of the triangles of a block.
#[derive(Clone, Copy)]
pub(crate) struct CoarseTest {
    /// The triangles that may be hit, a bit for each.
    pub(crate) candidates: u32,
    /// No hit is nearer.
    low: Vec4,
    /// t of the farthest corner.
    last: Vec4,
    /// The least and the greatest edge functions.
    least: Vec4,
    most: Vec4,
    /// The sum of the edge functions, and that of t of the corners weighed with them.
    sum: Vec4,
    weighed: Vec4,
}

/// What t of a hit may be wrong by besides what edge functions are, as a share of the largest t of a corner: 16 units in the last place, with what
/// `clamp_to_box` adds.
pub(crate) const T_ERROR: f32 = 16.0 * f32::EPSILON;

/// What the bounds of triangles by themselves tell of a block.
#[derive(Clone, Copy)]
pub(crate) struct RefinedTest<'a> {
    tested: &'a CoarseTest,
    /// By how much edge functions may be wrong.
    off: Vec4,
    bound: EdgeError<Vec4>,
}

impl RefinedTest<'_> {
    /// The triangles that are seen from the front for certain, if they are met at all.
    #[inline(always)]
    fn front(&self) -> u32 {
        self.tested.most.cmplt(-self.off).bitmask()
    }

    /// The same from behind.
    #[inline(always)]
    fn back(&self) -> u32 {
        self.tested.least.cmpgt(self.off).bitmask()
    }

    /// The candidates of which the exact test would say that they are hit at or before `t_max`: the line passes between the
    /// edges, the hit lies between origin and end, and area and volume are so large that the test won't take it for degenerate. And all
    /// candidates of which it may say so.
    #[inline(always)]
    pub(crate) fn any(&self, ray: &PreparedRay, t_max: f32, front_only: bool) -> (u32, u32) {
        let area = self.tested.least.abs().max(self.tested.most.abs());
        let (low, high) = self.between();
        let large = area.cmpgt(self.bound.area) & (area * low).cmpgt(self.bound.volume * Vec4::splat(ray.along.abs()));
        let between = low.cmpge(Vec4::splat(f32::MIN_POSITIVE)) & high.cmple(Vec4::splat(min(f32::MAX, t_max)));
        let candidates = self.left(low, high, t_max, front_only);
        (candidates & (self.front() | self.back()) & (large & between).bitmask(), candidates)
    }

    /// The candidates that may be hit at or before `t_max`.
    #[inline(always)]
    pub(crate) fn closest(&self, t_max: f32, front_only: bool) -> u32 {
        let (low, high) = self.between();
        self.left(low, high, t_max, front_only)
    }

    /// The candidates without those that can't be hit at or before `t_max`, if t lies between these.
    #[inline(always)]
    fn left(&self, low: Vec4, high: Vec4, t_max: f32, front_only: bool) -> u32 {
        let gone = high.cmple(Vec4::ZERO) | low.cmpgt(Vec4::splat(t_max));
        self.tested.candidates & !gone.bitmask() & !if front_only { self.back() } else { 0 }
    }

    /// Between what t of a hit lies: between t of the corners, and where the line certainly passes between the edges, next to their mean,
    /// weighed with the edge functions.
    #[inline(always)]
    fn between(&self) -> (Vec4, Vec4) {
        let &CoarseTest { low, last, least, most, sum, weighed, .. } = self.tested;
        let inside = most.cmplt(-self.off) | least.cmpgt(self.off);
        let (high, size) = (last * INFLATE, last.abs().max(low.abs()));
        let mean = weighed / sum;
        let off = (self.off * 4.0 / sum.abs()) * (last - low) + size * T_ERROR;
        // Unless something overflows or vanishes.
        let told =
            inside & mean.cmpge(low) & mean.cmple(high) & (sum.abs() * size).cmpge(Vec4::splat(f32::MIN_POSITIVE));
        (Vec4::select(told, low.max(mean - off), low), Vec4::select(told, high.min(mean + off), high))
    }
}

/// The way of a ray to its nearest triangle: where t is bounded for a triangle that all but certainly is hit, and lies before all others,
/// the exact test waits. If it then fails (an origin so close to the triangle's plane that rounding can't tell), the search was in vain and the ray
/// has to be sent again, another way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    bound: EdgeError,
    /// No hit of the triangle that waits is nearer; without one, the nearest hit.
    low: f32,
    /// The triangle that waits: four times its block plus its lane.
    pending: u32,
    /// The id of that triangle, or of the last one that waited or was the nearest: it may be met again in another leaf.
    last_seen: u32,
    /// A triangle that had waited was not hit.
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

    /// Tests a block, roughly; tells whether [`Search::complete`] has anything to do.
    #[inline(always)]
    pub(crate) fn test(&self, block: &Triangle4, ray: &PreparedRay, t_max: f32) -> (bool, CoarseTest) {
        let tested = block.test(ray, self.bound, t_max);
        (tested.candidates != 0, tested)
    }

    /// Considers the candidates of a block. `t_max` is lowered to where the nearest triangle surely is.
    #[inline(always)]
    pub(crate) fn complete(
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
        let (low, high) = refined.between();
        let mut candidates = refined.left(low, high, *t_max, scene.front_only);
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

    /// Tests the triangle that waits, if one does, exactly.
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
            // From large ones nearby to dots far away, of all magnitudes, aimed at beside, on and next to their borders.
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
                        let (low, high) = refined.between();
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
