//! Rays against triangles: Woop, Benthin and Wald, "Watertight ray/triangle intersection" (2013).
//!
//! A shear takes the ray to the z axis; the hit is decided in the plane by the signs of three edge functions. The
//! two triangles of a shared edge compute the same sheared vertices and exactly opposite edge functions, and zero
//! counts as inside on both sides, so no ray passes between them.
//!
//! Where it deviates:
//! - What is missed by more than the rounding of f32 is sorted out in f32, the three edges side by side.
//! - Else the shear is in f64 and an edge function never has the wrong sign (`exact`), which also settles vertices:
//!   the projected triangles are those of exact points in the plane, with closed borders.
//! - t, by weights as in the paper, is confined to the triangle's box (`slab`); and an origin exactly on the plane
//!   is no hit, which the weights alone could not tell.
//! - Nothing overflows or vanishes: products of three differences of f32 stay far within the range of f64.

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};

use crate::exact::difference_of_products;
use crate::slab::{DEFLATE, Slabs};
use crate::triangles::Nearest;
use crate::{Aabb, PreparedRay, Ray};

/// Three corners side by side: the rows x, y and z, each with the coordinate of a, b and c, and that of c again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    rows: [Vec4; 3],
}

impl Triangle {
    /// The triangle abc.
    #[inline]
    pub fn new([a, b, c]: [Vec3; 3]) -> Self {
        let row = |axis: usize| Vec4::new(a[axis], b[axis], c[axis], c[axis]);
        Self { rows: [row(0), row(1), row(2)] }
    }

    fn corner(&self, lane: usize) -> DVec3 {
        let [x, y, z] = self.rows;
        Vec3::new(x[lane], y[lane], z[lane]).as_dvec3()
    }

    fn bounds(&self) -> Aabb {
        let min = |row: Vec4| row.x.min(row.y).min(row.z);
        let max = |row: Vec4| row.x.max(row.y).max(row.z);
        let [x, y, z] = self.rows;
        Aabb { min: Vec3::new(min(x), min(y), min(z)), max: Vec3::new(max(x), max(y), max(z)) }
    }
}

/// Four triangles side by side: for each corner the rows x, y and z. Where there are fewer, NaN, which is never hit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Block {
    corners: [[Vec4; 3]; 3],
    ids: [u32; 4],
}

impl Block {
    /// A block of 1 to 4 triangles, each with its id.
    pub(crate) fn new(triangles: impl Iterator<Item = (u32, [Vec3; 3])>) -> Self {
        let mut block = Self { corners: [[Vec4::NAN; 3]; 3], ids: [u32::MAX; 4] };
        for (lane, (id, corners)) in triangles.enumerate() {
            block.ids[lane] = id;
            for (rows, corner) in block.corners.iter_mut().zip(corners) {
                for (row, coordinate) in rows.iter_mut().zip(corner.to_array()) {
                    row[lane] = coordinate;
                }
            }
        }
        block
    }

    /// The triangle in this lane.
    #[inline]
    pub(crate) fn triangle(&self, lane: usize) -> Triangle {
        let corner = |rows: &[Vec4; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        let [a, b, c] = &self.corners;
        Triangle::new([corner(a), corner(b), corner(c)])
    }

    /// The triangle in this lane and its id, the coordinates in the order of `axes`.
    #[inline(always)]
    pub(crate) fn ordered(&self, lane: usize, axes: [usize; 3]) -> (u32, [[f32; 3]; 3]) {
        let corner = |rows: &[Vec4; 3]| {
            let at = |k: usize| rows[axes[k] % 3].as_ref()[lane & 3];
            [at(0), at(1), at(2)]
        };
        let [a, b, c] = &self.corners;
        (self.ids[lane & 3], [corner(a), corner(b), corner(c)])
    }

    /// Makes the triangle in this lane the nearest if it is.
    #[inline]
    pub(crate) fn offer(&self, lane: usize, ray: &PreparedRay, nearest: &mut Nearest, front_only: bool) {
        let id = self.ids[lane];
        if let Some(hit) = intersect_exactly(ray, &self.triangle(lane), nearest.t)
            && (hit.t < nearest.t || id < nearest.id)
            && (hit.front || !front_only)
        {
            *nearest = Nearest { t: hit.t, u: hit.u, v: hit.v, id };
        }
    }

    /// The triangles that may be hit before `t_max`, a bit for each: [`surely_missed`] for four, with one bound for the three edges of each;
    /// and none that lies behind the origin or beyond `t_max`.
    #[inline(always)]
    fn candidates(&self, ray: &PreparedRay, t_max: f32) -> u32 {
        let [kx, ky, kz] = ray.shear.axes;
        let (kx, ky, kz) = (kx % 3, ky % 3, kz % 3);
        let origin = &ray.slabs.origin;
        let (ox, oy, oz) = (Vec4::splat(origin[kx]), Vec4::splat(origin[ky]), Vec4::splat(origin[kz]));
        let (sx, sy) = (Vec4::splat(ray.shear.rough[0]), Vec4::splat(ray.shear.rough[1]));
        // As |s| ≤ 1, what a sheared coordinate is summed from has at most twice the size of the largest difference.
        let [a, b, c] = &self.corners;
        let (ax, ay, az) = (a[kx] - ox, a[ky] - oy, a[kz] - oz);
        let (bx, by, bz) = (b[kx] - ox, b[ky] - oy, b[kz] - oz);
        let (cx, cy, cz) = (c[kx] - ox, c[ky] - oy, c[kz] - oz);
        let size = |x: Vec4, y: Vec4, z: Vec4| x.abs().max(y.abs()).max(z.abs());
        let d = size(ax, ay, az).max(size(bx, by, bz)).max(size(cx, cy, cz)) * 2.0;
        let there = ax.cmpeq(ax);
        // Between the corners along the longest axis lies the triangle, and what `confine` makes of t: its very products.
        let along = Vec4::splat(ray.shear.along);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let beyond = (ta.min(tb).min(tc) * DEFLATE).cmpgt(Vec4::splat(t_max)) | ta.max(tb).max(tc).cmple(Vec4::ZERO);
        let (ax, ay) = (ax - sx * az, ay - sy * az);
        let (bx, by) = (bx - sx * bz, by - sy * bz);
        let (cx, cy) = (cx - sx * cz, cy - sy * cz);
        let m = size(ax, ay, bx).max(size(by, cx, cy));
        let wa = bx * cy - by * cx;
        let wb = cx * ay - cy * ax;
        let wc = ax * by - ay * bx;
        let bound = d * m * (2.0 * RELATIVE) + (d * (2.0 * UNDERFLOW) + f32::MIN_POSITIVE);
        let missed = wa.max(wb).max(wc).cmpgt(bound) & wa.min(wb).min(wc).cmplt(-bound);
        // Lanes without a triangle are NaN, which no comparison sorts out.
        there.bitmask() & !(missed | beyond).bitmask()
    }
}

pub(crate) const RELATIVE: f32 = 10.0 * f32::EPSILON;
pub(crate) const UNDERFLOW: f32 = f32::MIN_POSITIVE * 256.0;

/// Makes the nearest of a block's triangles `nearest`, if one is.
#[inline(always)]
pub(crate) fn nearest_in_block(ray: &PreparedRay, block: &Block, nearest: &mut Nearest, front_only: bool) {
    let mut candidates = block.candidates(ray, nearest.t);
    while candidates != 0 {
        block.offer(candidates.trailing_zeros() as usize, ray, nearest, front_only);
        candidates &= candidates - 1;
    }
}

/// The lane of a triangle that is hit at or before `t_max` and `blocks`.
#[inline(always)]
pub(crate) fn any_in_block(
    ray: &PreparedRay,
    block: &Block,
    t_max: f32,
    front_only: bool,
    blocks: &mut impl FnMut(u32) -> bool,
) -> Option<u32> {
    let mut candidates = block.candidates(ray, t_max);
    while candidates != 0 {
        let lane = candidates.trailing_zeros();
        let hit = intersect_exactly(ray, &block.triangle(lane as usize), t_max);
        if hit.is_some_and(|hit| hit.front || !front_only) && blocks(block.ids[lane as usize]) {
            return Some(lane);
        }
        candidates &= candidates - 1;
    }
    None
}

/// The shear that takes a ray to the z axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    /// The axis of the longest component of the direction last, the other two ordered such that winding is kept.
    pub(crate) axes: [usize; 3],
    /// Shears of x and y.
    pub(crate) exact: [f64; 2],
    /// The same, rounded; NaN, which decides nothing, where that would take digits off.
    pub(crate) rough: [f32; 2],
    /// 1 / direction along the last axis; NaN, which decides nothing, for rays that the slabs are careful with.
    along: f32,
}

impl Shear {
    #[inline]
    pub(crate) fn new(ray: &Ray, slabs: &Slabs) -> Self {
        let direction = ray.direction.as_dvec3();
        let length = ray.direction.abs();
        let z = if length.x >= length.y && length.x >= length.z {
            0
        } else if length.y >= length.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            (x, y) = (y, x);
        }
        // NaN for a zero direction, which fails every comparison below.
        let exact = [direction[x] / direction[z], direction[y] / direction[z]];
        let rough = |s: f64| if s == 0.0 || (s as f32).is_normal() { s as f32 } else { f32::NAN };
        let along = if slabs.regular { slabs.reciprocal[z] } else { f32::NAN };
        Self { axes: [x, y, z], exact, rough: [rough(exact[0]), rough(exact[1])], along }
    }
}

/// Where a ray meets a triangle abc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// The ray's parameter.
    pub t: f32,
    /// Weight of b; the point is (1 − u − v) a + u b + v c, with no weight below 0.
    pub u: f32,
    /// Weight of c.
    pub v: f32,
    /// Whether the ray meets the side from which a, b, c run counter-clockwise.
    pub front: bool,
}

/// The hit on a triangle with 0 < t ≤ t_max. Both sides are hit; a triangle of no area never is.
#[inline]
pub fn intersect(ray: &PreparedRay, triangle: &Triangle, t_max: f32) -> Option<TriangleHit> {
    if surely_missed(ray, triangle) { None } else { intersect_exactly(ray, triangle, t_max) }
}

/// Whether two edge functions have opposite signs for certain, told in f32: with D the sum of the sizes of what a sheared
/// coordinate m is summed from, its error is at most 4 u D, and so that of an edge function less than
/// 10 u (D₁ m₂ + m₁ D₂). The bound is twice that, plus what underflow may have taken; where something overflows, so
/// does the bound.
#[inline]
fn surely_missed(ray: &PreparedRay, triangle: &Triangle) -> bool {
    let [x, y, z] = ray.shear.axes.map(|axis| triangle.rows[axis % 3] - Vec4::splat(ray.slabs.origin[axis % 3]));
    let [sx, sy] = ray.shear.rough.map(|s| Vec4::splat(s) * z);
    let (px, py) = (x - sx, y - sy);
    let edges = px.yzxw() * py.zxyw() - py.yzxw() * px.zxyw();
    let m = px.abs().max(py.abs());
    let d = (x.abs() + sx.abs()).max(y.abs() + sy.abs());
    let [(d1, d2), (m1, m2)] = [d, m].map(|v| (v.yzxw(), v.zxyw()));
    let bound = (d1 * m2 + m1 * d2) * RELATIVE + ((d1 + d2) * UNDERFLOW + f32::MIN_POSITIVE);
    // The fourth lane repeats the third corner, for an edge function of 0.
    edges.cmpgt(bound).any() && edges.cmplt(-bound).any()
}

#[inline(always)]
fn intersect_exactly(ray: &PreparedRay, triangle: &Triangle, t_max: f32) -> Option<TriangleHit> {
    let relative = |axis: usize| {
        let (row, origin) = (triangle.rows[axis % 3].to_array(), ray.origin[axis % 3]);
        [f64::from(row[0]) - origin, f64::from(row[1]) - origin, f64::from(row[2]) - origin]
    };
    let (x, y, z) = (relative(ray.shear.axes[0]), relative(ray.shear.axes[1]), relative(ray.shear.axes[2]));
    // The vertices relative to the ray, sheared.
    let [sx, sy] = ray.shear.exact;
    let [ax, bx, cx] = [x[0] - sx * z[0], x[1] - sx * z[1], x[2] - sx * z[2]];
    let [ay, by, cy] = [y[0] - sy * z[0], y[1] - sy * z[1], y[2] - sy * z[2]];
    // Twice the signed areas that the ray spans with each edge, i.e. unnormalised weights of a, b and c.
    let wa = difference_of_products(bx, cy, by, cx);
    let wb = difference_of_products(cx, ay, cy, ax);
    let wc = difference_of_products(ax, by, ay, bx);
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    let area = wa + wb + wc;
    if !inside || area == 0.0 {
        return None;
    }
    let depth = wa * z[0] + wb * z[1] + wc * z[2];
    let t = depth / area / ray.direction[ray.shear.axes[2]];
    let t = ray.slabs.confine(&triangle.bounds(), t, t_max)?;
    // As the shear leaves volumes as they are, `depth` is the origin's height times the size of the normal, and `area` the slope. Far
    // from rounding, they tell that neither normal nor height is 0.
    let size = |v: &[f64; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
    let d = size(&x).max(size(&y)).max(size(&z));
    let far = |value: f64, scale: f64| value.abs() > scale * SURELY;
    if !(far(area, d * d) && far(depth, d * d * d)) && degenerate(ray, triangle) {
        return None;
    }
    let u = ((wb / area) as f32).clamp(0.0, 1.0);
    let v = ((wc / area) as f32).clamp(0.0, 1.0 - u);
    Some(TriangleHit { t, u, v, front: area < 0.0 })
}

/// 2⁻⁴⁰: far above what rounding in f64 makes of products of differences of corners.
pub(crate) const SURELY: f64 = 1.0 / (1u64 << 40) as f64;

/// Whether the triangle has no area, or the origin lies on its plane: then it is at t = 0, which rounding must not turn into a hit;
/// unless all of the ray lies in the plane, when the triangle may stand between two that are seen from the sides.
#[cold]
#[inline(never)]
fn degenerate(ray: &PreparedRay, triangle: &Triangle) -> bool {
    let (a, b, c) = (triangle.corner(0), triangle.corner(1), triangle.corner(2));
    let normal = cross(b - a, c - a);
    let (height, slope) = ((a - ray.origin).dot(normal), ray.direction.dot(normal));
    normal == DVec3::ZERO || height == 0.0 && slope != 0.0
}

/// The cross product, exactly 0 for parallel vectors.
fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Primitive, Random, closed_mesh, nearest_in_tree, tree};
    use glam::Vec3Swizzles;

    const A: Vec3 = Vec3::new(0.0, 0.0, 0.0);
    const B: Vec3 = Vec3::new(4.0, 0.0, 0.0);
    const C: Vec3 = Vec3::new(0.0, 4.0, 0.0);

    fn intersect(origin: Vec3, direction: Vec3, [a, b, c]: [Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        super::intersect(&Ray::new(origin, direction).prepare(), &Triangle::new([a, b, c]), t_max)
    }

    #[test]
    fn a_hit_tells_distance_weights_and_side() {
        let hit = |t, u, v, front| Some(TriangleHit { t, u, v, front });
        let from = Vec3::new(1.0, 2.0, 8.0);
        assert_eq!(intersect(from, -2.0 * Vec3::Z, [A, B, C], 9.0), hit(4.0, 0.25, 0.5, true));
        assert_eq!(intersect(from, -2.0 * Vec3::Z, [A, C, B], 9.0), hit(4.0, 0.5, 0.25, false));
        let below = Vec3::new(1.0, 2.0, -8.0);
        assert_eq!(intersect(below, 2.0 * Vec3::Z, [A, B, C], 9.0), hit(4.0, 0.25, 0.5, false));
        // The same with each axis as the longest.
        for turn in [Vec3::zxy as fn(Vec3) -> Vec3, Vec3::yzx] {
            let turned = [A, B, C].map(turn);
            assert_eq!(intersect(turn(from), turn(-2.0 * Vec3::Z), turned, 9.0), hit(4.0, 0.25, 0.5, true));
            assert_eq!(intersect(turn(below), turn(2.0 * Vec3::Z), turned, 9.0), hit(4.0, 0.25, 0.5, false));
        }
    }

    #[test]
    fn the_end_counts_and_the_start_does_not() {
        let (origin, d) = (Vec3::new(1.0, 1.0, 3.0), -Vec3::Z);
        assert!(intersect(origin, d, [A, B, C], 3.0).is_some());
        assert!(intersect(origin, d, [A, B, C], 3.0_f32.next_down()).is_none());
        assert!(intersect(origin, -d, [A, B, C], f32::INFINITY).is_none());
        // On the plane, also seen along other axes.
        for d in [d, Vec3::new(3.0, 1.0, -1.0), Vec3::new(0.3, -0.7, 0.1)] {
            assert!(intersect(Vec3::new(1.0, 1.0, 0.0), d, [A, B, C], f32::INFINITY).is_none());
        }
    }

    #[test]
    fn a_ray_that_starts_on_the_plane_of_a_triangle_does_not_hit_it() {
        let random = &mut Random(16);
        for i in 0..6000 {
            let on_plane = [0; 4].map(|_| {
                if i % 2 == 0 {
                    let mut p = random.vector();
                    p[i % 3] = 0.7;
                    p
                } else {
                    // Whole numbers with x + 2 y + 5 z = 3.
                    let [y, z] = [random.below(99) as f32 - 49.0, random.below(99) as f32 - 49.0];
                    Vec3::new(3.0 - 2.0 * y - 5.0 * z, y, z)
                }
            });
            let [a, b, c, _] = on_plane;
            let origin = [on_plane[3], a, b][random.below(3)];
            assert_eq!(intersect(origin, random.vector(), [a, b, c], f32::INFINITY), None);
        }
    }

    #[test]
    fn what_is_surely_missed_is_missed() {
        let random = &mut Random(17);
        let (mut sorted_out, mut missed) = (0, 0);
        for i in 0..400_000 {
            // From large ones nearby to dots far away, of all magnitudes, aimed at beside, on and next to their borders.
            let far = random.vector() * 10f32.powi(random.below(6) as i32 - 1);
            let [a, b, c] = [0; 3].map(|_| far + random.vector() * [1.0, 1e-2, 1e-4][i % 3]);
            let edge = a + (b - a) * random.signed();
            let target =
                [a, edge, edge + (c - a) * random.signed() * 10f32.powi(-(random.below(8) as i32))][random.below(3)];
            let origin = random.vector() * [1.0, 0.0, 1e-3][random.below(3)];
            let mut direction = target - origin;
            direction[random.below(3)] *= [1.0, 1.0, 0.0, 1e-20, 1e-39][random.below(5)];
            let scale = 10f32.powi(random.below(60) as i32 - 30);
            let ray = Ray::new(origin * scale, direction * [1.0, scale][i % 2]).prepare();
            let triangle = Triangle::new([a, b, c].map(|p| p * scale));
            let surely = surely_missed(&ray, &triangle);
            let exactly = intersect_exactly(&ray, &triangle, f32::INFINITY).is_none();
            assert!(!surely || exactly, "{ray:?} {triangle:?}");
            sorted_out += usize::from(surely);
            missed += usize::from(exactly);
        }
        assert!(missed / 4 < sorted_out && sorted_out < missed, "{sorted_out} of {missed}");
    }

    #[test]
    fn borders_belong_to_the_triangle() {
        for p in [A, B, C, (A + B) / 2.0, (B + C) / 2.0, (C + A) / 2.0] {
            for d in [Vec3::new(0.0, 0.0, -1.0), Vec3::new(1.0, 0.5, -2.0), Vec3::new(-2.0, 1.0, 1.0)] {
                let hit = intersect(p - d, d, [A, B, C], 2.0).unwrap();
                assert_eq!(hit.t, 1.0);
                assert_eq!((1.0 - hit.u - hit.v) * A + hit.u * B + hit.v * C, p);
            }
        }
        let out = Vec3::new(2.0_f32.next_up(), 2.0, 1.0);
        assert!(intersect(out, -Vec3::Z, [A, B, C], 2.0).is_none());
    }

    #[test]
    fn a_triangle_without_area_is_never_hit() {
        let random = &mut Random(11);
        for _ in 0..2000 {
            // Differences of few bits, so that the three are in one line exactly.
            let [a, d] = [random.vector(), random.vector()].map(|p| (p * 512.0).round());
            let triangle = [a, a + d, a + d * random.below(4) as f32];
            let target = a + d * random.signed();
            let origin = 1000.0 * random.vector();
            assert_eq!(intersect(origin, target - origin, triangle, f32::INFINITY), None);
            assert_eq!(intersect(a - d, d, triangle, f32::INFINITY), None);
        }
    }

    #[test]
    fn a_triangle_seen_edge_on_is_missed_or_hit_within_its_box() {
        let random = &mut Random(12);
        let mut hits = 0;
        for _ in 0..20_000 {
            // Whole numbers, so that ray and triangle lie in one plane exactly, and too large for t to be told
            // from rounding errors.
            let [p, q] = [random.vector(), random.vector()].map(|v| (v * 1e6).round());
            let mut point = || p * random.below(5) as f32 + q * random.below(5) as f32;
            let [a, b, c, origin, target] = [point(), point(), point(), point(), point()];
            let ray = Ray::new(origin, target - origin);
            if let Some(hit) = intersect(origin, ray.direction, [a, b, c], f32::INFINITY) {
                hits += 1;
                let at = ray.at(hit.t);
                let bounds = Aabb::from_points([a, b, c]);
                let distance = (at - at.clamp(bounds.min, bounds.max)).length();
                assert!(distance < 10.0, "{distance} {ray:?} {:?}", [a, b, c]);
            }
        }
        assert!(hits > 10, "{hits}");
    }

    #[test]
    fn weights_stay_within_the_triangle_and_give_the_point() {
        let random = &mut Random(13);
        let mut hits = 0;
        for _ in 0..20_000 {
            let [a, b, c, origin] = [0; 4].map(|_| random.vector());
            let Some(hit) = intersect(origin, random.vector() * 0.1, [a, b, c], f32::INFINITY) else { continue };
            hits += 1;
            assert!(hit.u >= 0.0 && hit.v >= 0.0 && 1.0 - hit.u - hit.v >= 0.0, "{hit:?}");
        }
        assert!(hits > 500);
        // Onto the edge where the weight of a is 0.
        for _ in 0..2000 {
            let [a, b, c, origin] = [0; 4].map(|_| random.vector());
            let target = b + random.signed().abs() * (c - b);
            if let Some(hit) = intersect(origin, target - origin, [a, b, c], f32::INFINITY) {
                assert!(1.0 - hit.u - hit.v >= 0.0, "{hit:?}");
            }
        }
        // The point, for triangles that are not seen edge-on.
        for _ in 0..2000 {
            let [b, c] = [Vec3::X + 0.3 * random.vector(), Vec3::Y + 0.3 * random.vector()];
            let origin = Vec3::new(0.3, 0.3, 1.5) + 0.2 * random.vector();
            let ray = Ray::new(origin, 0.3 * b + 0.3 * c - origin);
            let hit = super::intersect(&ray.prepare(), &Triangle::new([A, b, c]), f32::INFINITY).unwrap();
            let by_weights = hit.u * b + hit.v * c;
            assert!((ray.at(hit.t) - by_weights).length() < 1e-6);
        }
    }

    /// The points to aim at: corners, points of edges and of faces.
    fn targets(faces: &[[Vec3; 3]], random: &mut Random) -> Vec<Vec3> {
        let mut targets = Vec::new();
        for &[a, b, c] in faces {
            targets.extend([a, 0.5 * (a + b), a + (b - a) * random.signed().abs(), (a + b + c) / 3.0]);
        }
        targets
    }

    #[test]
    fn no_ray_leaks_out_of_a_closed_surface() {
        let random = &mut Random(14);
        let mesh = closed_mesh(random);
        // A cube, in whose planes and along whose edges rays run exactly.
        let cube: Vec<[Vec3; 3]> = (0..3)
            .flat_map(|axis| [-1.0, 1.0].map(|side| (axis, side)))
            .flat_map(|(axis, side)| {
                (0..16).flat_map(move |cell| {
                    let at = |x: i32, y: i32| {
                        let mut p = Vec3::splat(side);
                        p[(axis + 1) % 3] = x as f32 / 2.0 - 1.0;
                        p[(axis + 2) % 3] = y as f32 / 2.0 - 1.0;
                        p
                    };
                    let (x, y) = (cell % 4, cell / 4);
                    [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
                })
            })
            .collect();
        for faces in [mesh, cube] {
            let targets = targets(&faces, random);
            for exponent in -6..=9 {
                let scale = 10f32.powi(exponent);
                // At the origin, and so far from it that coordinates lose half of their bits.
                for offset in [Vec3::ZERO, Vec3::new(3000.0, -1000.0, 700.0) * scale] {
                    let place = |p: Vec3| p * scale + offset;
                    let scene: Vec<_> = faces.iter().map(|f| Primitive::Triangle(f.map(place))).collect();
                    let bvh = tree(&scene);
                    for &target in targets.iter().skip(random.below(4)).step_by(3) {
                        let start = match random.below(4) {
                            // Exactly on planes of symmetry, for rays with exact zeros.
                            0 => Vec3::ZERO,
                            1 => target * Vec3::AXES[random.below(3)] * 0.5,
                            _ => random.vector() * 0.4,
                        };
                        let origin = place(start);
                        let ray = Ray::new(origin, place(target) - origin);
                        let leak = nearest_in_tree(&scene, &bvh, &ray, f32::INFINITY).0.is_none();
                        assert!(!leak, "{exponent} {offset} {ray:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_floor_close_below_the_eye_has_no_cracks() {
        // Squares of a size of 1000 whose borders are those of their boxes, seen from a height of 1e-3 and less.
        let at = |x: i32, z: i32| Vec3::new(x as f32 * 1000.0, 0.0, z as f32 * 1000.0);
        let scene: Vec<_> = (0..36)
            .map(|cell| (cell % 6 - 3, cell / 6 - 3))
            .flat_map(|(x, z)| [[at(x, z), at(x, z + 1), at(x + 1, z + 1)], [at(x, z), at(x + 1, z + 1), at(x + 1, z)]])
            .map(Primitive::Triangle)
            .collect();
        let bvh = tree(&scene);
        let random = &mut Random(15);
        for i in 0..20_000 {
            let height = 10f32.powi(-(i % 4) - 3);
            let mut origin = random.vector() * height;
            origin.y = height;
            let mut target = random.vector() * height;
            target.y = 0.0;
            // Onto a border or close to it.
            target[2 * random.below(2)] *= [0.0, 1e-3, 1e-6][random.below(3)];
            let ray = Ray::new(origin, target - origin);
            let (hit, _) = nearest_in_tree(&scene, &bvh, &ray, f32::INFINITY);
            assert!(hit.is_some_and(|hit| (hit.0 - 1.0).abs() < 1e-6), "{ray:?} {hit:?}");
        }
    }

    #[test]
    fn extreme_sizes_neither_vanish_nor_overflow() {
        for s in [1e-36, 1e-30, 1e-20, 1e20, 1e30, 1e37] {
            let triangle = [A, B, C].map(|p| p * s);
            let origin = Vec3::new(1.0, 1.0, 2.0) * s;
            let hit = intersect(origin, -Vec3::Z, triangle, f32::INFINITY).unwrap();
            assert!((hit.t / (2.0 * s) - 1.0).abs() < 1e-6 && hit.u == 0.25, "{s} {hit:?}");
            assert!(intersect(origin * Vec3::new(4.0, 1.0, 1.0), -Vec3::Z, triangle, f32::INFINITY).is_none());
            assert!(intersect(origin, -Vec3::Z * s, triangle, f32::INFINITY).is_some_and(|hit| hit.t == 2.0));
        }
    }
}
