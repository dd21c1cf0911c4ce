//! The exact ray-triangle test: Woop, Benthin and Wald, "Watertight ray/triangle intersection" (2013).
//!
//! A shear maps the ray to the z axis. The hit is decided in the plane by the signs of three edge functions. The two
//! triangles of a shared edge compute equal sheared vertices and exactly opposite edge functions. Zero counts as inside
//! on both sides, so that no ray passes between them.
//!
//! It differs from the paper in these points:
//! - A triangle that is missed by more than the rounding of f32 is culled in f32, the three edges side by side.
//! - Otherwise the shear is in f64, and an edge function never has the wrong sign (`difference_of_products`). This also
//!   makes shared vertices watertight: the projected triangles are those of exact points in the plane, with closed
//!   borders.
//! - t, by weights as in the paper, is clamped to the triangle's box (`slab`). An origin exactly on the plane is no
//!   hit, which the weights alone could not decide.
//! - t leads to a point of the triangle also where the triangle is seen edge-on (proof below), and is at least the
//!   smallest normal number.
//! - Nothing overflows or vanishes: products of three differences of f32 stay far within the range of f64.
//!
//! # Triangles in parts
//!
//! A tree may hold a triangle as several references, which are boxes around its parts (`build/presplit`). The
//! condition: wherever the kernel reports a hit at t, the ray enters at least one of these boxes, at t or before. For a
//! triangle seen edge-on, t can't be determined from the line alone. But *some* part is entered if t belongs to some
//! point of the triangle that is next to the line's point at t. Let S be the triangle's largest extent and d the
//! direction.
//!
//! 1. Edge functions are off by δ ≤ 2⁻²³ of themselves (`difference_of_products`). So the weights λ, all of one sign,
//!    are those of a point p = Σ λ T of the triangle. The exact weights μ map the sheared corners v to Σ μ v = 0. The
//!    difference is Σ |λ − μ| ≤ 2 δ. As corners lie at most 2 S apart, |Σ λ v| ≤ 2 δ S.
//! 2. Coordinates relative to the origin are off by 2⁻⁵³ of S + t |d|. Their shears are off by as much times the shear,
//!    which is at most 1.
//! 3. t is off by 2⁻⁴⁹ of S + t |d_z| along the longest axis z, since the weights have one sign.
//!
//! Together: along each axis, p is at most 2⁻²¹ S + 2⁻⁴⁶ t |d| away from the line's point at t, where d is the
//! direction along that axis. The first term is covered by boxes that are 2⁻²¹ S wider than the parts on all sides. The
//! second term and the rounding of the slab test, 4 units in the last place where numbers are normal, are covered by
//! the 16 units of `slab::INFLATE`.
//!
//! Moving t to the farthest corner along z moves it by no more than the error of point 3. The slack covers this, too:
//! as |d| ≤ |d_z|, the line moves less along the other axes. Any other downward clamp of t may take it off all parts.
//! An upward clamp does no harm.

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};

use super::difference_of_products::difference_of_products;
use crate::ray::Axis;
use crate::{Aabb, PreparedRay};

/// A triangle by its three corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    corners: [Vec3; 3],
}

impl Triangle {
    /// The triangle with the corners a, b and c.
    #[inline]
    pub fn new(corners: [Vec3; 3]) -> Self {
        Self { corners }
    }

    #[inline(always)]
    pub(crate) fn bounds(&self) -> Aabb {
        let [a, b, c] = self.corners;
        Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
    }

    /// The corners, with coordinates in the order of a ray's `rows`.
    #[inline(always)]
    fn ordered(&self, rows: [Axis; 3]) -> [[f32; 3]; 3] {
        let corner = |p: &Vec3| [rows[0].of(p), rows[1].of(p), rows[2].of(p)];
        let [a, b, c] = &self.corners;
        [corner(a), corner(b), corner(c)]
    }
}

pub(crate) const RELATIVE: f32 = 10.0 * f32::EPSILON;
pub(crate) const UNDERFLOW: f32 = f32::MIN_POSITIVE * 256.0;

/// A hit of a ray on a triangle with the corners a, b and c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// The ray parameter.
    pub t: f32,
    /// The weight of b. The point is (1 − u − v) a + u b + v c, with no weight below 0.
    pub u: f32,
    /// The weight of c.
    pub v: f32,
    /// Whether the ray hits the side from which a, b, c run counter-clockwise.
    pub front: bool,
}

/// The hit on a triangle with 0 < t ≤ t_max. Both sides can be hit. A triangle without area is never hit.
#[inline]
pub fn intersect(ray: &PreparedRay, triangle: &Triangle, t_max: f32) -> Option<TriangleHit> {
    let corners = &triangle.ordered(ray.axis_order.rows);
    if surely_missed(ray, corners) { None } else { intersect_exactly(ray, corners, &triangle.bounds(), t_max) }
}

/// Whether two edge functions certainly have opposite signs, by f32. Let D be the sum of the absolute values from which
/// a sheared coordinate m is summed. The error of m is at most 4 u D, and that of an edge function less than 10 u (D₁
/// m₂ + m₁ D₂). The bound is twice that, plus what underflow may have taken. Where something overflows, so does the
/// bound.
#[inline]
fn surely_missed(ray: &PreparedRay, corners: &[[f32; 3]; 3]) -> bool {
    let relative = |k: usize| {
        let [a, b, c] = corners;
        Vec4::new(a[k], b[k], c[k], c[k]) - Vec4::splat(ray.origin(ray.axis_order.rows[k]))
    };
    let (x, y, z) = (relative(0), relative(1), relative(2));
    let (sx, sy) = (Vec4::splat(ray.shear[0]) * z, Vec4::splat(ray.shear[1]) * z);
    let (px, py) = (x - sx, y - sy);
    let edges = px.yzxw() * py.zxyw() - py.yzxw() * px.zxyw();
    let m = px.abs().max(py.abs());
    let d = (x.abs() + sx.abs()).max(y.abs() + sy.abs());
    let [(d1, d2), (m1, m2)] = [d, m].map(|v| (v.yzxw(), v.zxyw()));
    let bound = (d1 * m2 + m1 * d2) * RELATIVE + ((d1 + d2) * UNDERFLOW + f32::MIN_POSITIVE);
    // The fourth lane repeats the third corner, which gives an edge function of 0.
    edges.cmpgt(bound).any() && edges.cmplt(-bound).any()
}

/// [`intersect`] for corners in the order of the ray's `rows`, with the box around them.
#[inline(always)]
pub(crate) fn intersect_exactly(
    ray: &PreparedRay,
    corners: &[[f32; 3]; 3],
    bounds: &Aabb,
    t_max: f32,
) -> Option<TriangleHit> {
    let relative = |k: usize| {
        let ([a, b, c], origin) = (corners, f64::from(ray.origin(ray.axis_order.rows[k])));
        [f64::from(a[k]) - origin, f64::from(b[k]) - origin, f64::from(c[k]) - origin]
    };
    let (x, y, z) = (relative(0), relative(1), relative(2));
    let along = |k: usize| f64::from(ray.direction(ray.axis_order.rows[k]));
    let (sx, sy) = (along(0) / along(2), along(1) / along(2));
    // The sheared vertices, relative to the ray.
    let [ax, bx, cx] = [x[0] - sx * z[0], x[1] - sx * z[1], x[2] - sx * z[2]];
    let [ay, by, cy] = [y[0] - sy * z[0], y[1] - sy * z[1], y[2] - sy * z[2]];
    // Twice the signed areas that the ray spans with each edge, i.e. the unnormalised weights of a, b and c.
    let wa = difference_of_products(bx, cy, by, cx);
    let wb = difference_of_products(cx, ay, cy, ax);
    let wc = difference_of_products(ax, by, ay, bx);
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    let area = wa + wb + wc;
    if !inside || area == 0.0 {
        return None;
    }
    let depth = wa * z[0] + wb * z[1] + wc * z[2];
    // One division serves t and the weights, since it is the most expensive operation.
    let scale = 1.0 / (area * along(2));
    let t = depth * scale;
    let t = ray.clamp_to_triangle(bounds, t, t_max)?;
    // The shear preserves volumes. So `depth` is the origin's height times the size of the normal, and `area` is the
    // slope. If both are far above rounding, neither normal nor height is 0.
    let size = |v: &[f64; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
    let d = size(&x).max(size(&y)).max(size(&z));
    let far = |value: f64, scale: f64| value.abs() > scale * DEGENERATE;
    if !(far(area, d * d) && far(depth, d * d * d)) && degenerate(ray, corners) {
        return None;
    }
    let u = ((wb * along(2) * scale) as f32).clamp(0.0, 1.0);
    let v = ((wc * along(2) * scale) as f32).clamp(0.0, 1.0 - u);
    Some(TriangleHit { t, u, v, front: area < 0.0 })
}

/// 2⁻⁴⁰: far above the rounding error of products of differences of corners in f64.
pub(crate) const DEGENERATE: f64 = 1.0 / (1u64 << 40) as f64;

/// Whether the triangle has no area, or the origin lies on its plane. In the latter case the triangle is at t = 0,
/// which rounding must not turn into a hit. The exception is a ray that lies wholly in the plane: then the triangle may
/// stand between two triangles that the ray sees from the sides.
#[cold]
#[inline(never)]
fn degenerate(ray: &PreparedRay, corners: &[[f32; 3]; 3]) -> bool {
    let [mut a, mut b, mut c] = [DVec3::ZERO; 3];
    for (k, axis) in ray.axis_order.axes().into_iter().enumerate() {
        (a[axis], b[axis], c[axis]) = (corners[0][k].into(), corners[1][k].into(), corners[2][k].into());
    }
    let normal = cross(b - a, c - a);
    let (origin, direction) = (ray.ray.origin.as_dvec3(), ray.ray.direction.as_dvec3());
    let (height, slope) = ((a - origin).dot(normal), direction.dot(normal));
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
    use crate::Ray;
    use crate::testing::{Random, TestPrimitive, closed_mesh, nearest_in_tree, tree};
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
        // The scene turned, so that each axis is the longest once.
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
        // The origin is on the plane, also for directions along other axes.
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
        let (mut culled, mut missed) = (0, 0);
        for i in 0..400_000 {
            // Triangles from large ones nearby to dots far away, of all magnitudes. Rays are aimed beside, on and next
            // to their borders.
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
            let corners = &triangle.ordered(ray.axis_order.rows);
            let surely = surely_missed(&ray, corners);
            let exactly = intersect_exactly(&ray, corners, &triangle.bounds(), f32::INFINITY).is_none();
            assert!(!surely || exactly, "{ray:?} {triangle:?}");
            culled += usize::from(surely);
            missed += usize::from(exactly);
        }
        assert!(missed / 4 < culled && culled < missed, "{culled} of {missed}");
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
            // Differences of few bits, so that the three corners are exactly on one line.
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
            // Whole numbers, so that ray and triangle lie exactly in one plane. They are too large for t to be
            // determined from rounding errors.
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
    fn a_t_that_is_no_normal_number_is_none() {
        for (height, is_hit) in [(2.0, true), (0.5, false)] {
            // A reciprocal that is a normal number, and one that is not.
            for speed in [8e37, 3e38] {
                let hit = intersect(Vec3::new(1.0, 1.0, height * (speed / 8e37)), -Vec3::Z * speed, [A, B, C], 1.0);
                assert_eq!(hit.is_some(), is_hit, "{height} {speed}");
            }
        }
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
        // Rays onto the edge where the weight of a is 0.
        for _ in 0..2000 {
            let [a, b, c, origin] = [0; 4].map(|_| random.vector());
            let target = b + random.signed().abs() * (c - b);
            if let Some(hit) = intersect(origin, target - origin, [a, b, c], f32::INFINITY) {
                assert!(1.0 - hit.u - hit.v >= 0.0, "{hit:?}");
            }
        }
        // The hit point, for triangles that are not seen edge-on.
        for _ in 0..2000 {
            let [b, c] = [Vec3::X + 0.3 * random.vector(), Vec3::Y + 0.3 * random.vector()];
            let origin = Vec3::new(0.3, 0.3, 1.5) + 0.2 * random.vector();
            let ray = Ray::new(origin, 0.3 * b + 0.3 * c - origin);
            let hit = super::intersect(&ray.prepare(), &Triangle::new([A, b, c]), f32::INFINITY).unwrap();
            let by_weights = hit.u * b + hit.v * c;
            assert!((ray.at(hit.t) - by_weights).length() < 1e-6);
        }
    }

    /// Targets of rays: corners, points on edges and points on faces.
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
        // A cube. Rays run exactly in its planes and along its edges.
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
                // The mesh at the origin, and so far from it that coordinates lose half of their bits.
                for offset in [Vec3::ZERO, Vec3::new(3000.0, -1000.0, 700.0) * scale] {
                    let place = |p: Vec3| p * scale + offset;
                    let scene: Vec<_> = faces.iter().map(|f| TestPrimitive::Triangle(f.map(place))).collect();
                    let bvh = tree(&scene);
                    for &target in targets.iter().skip(random.below(4)).step_by(3) {
                        let start = match random.below(4) {
                            // An origin exactly on planes of symmetry, for rays with exact zeros.
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
        // Squares of size 1000 whose borders are those of their boxes, seen from a height of 1e-3 and less.
        let at = |x: i32, z: i32| Vec3::new(x as f32 * 1000.0, 0.0, z as f32 * 1000.0);
        let scene: Vec<_> = (0..36)
            .map(|cell| (cell % 6 - 3, cell / 6 - 3))
            .flat_map(|(x, z)| [[at(x, z), at(x, z + 1), at(x + 1, z + 1)], [at(x, z), at(x + 1, z + 1), at(x + 1, z)]])
            .map(TestPrimitive::Triangle)
            .collect();
        let bvh = tree(&scene);
        let random = &mut Random(15);
        for i in 0..20_000 {
            let height = 10f32.powi(-(i % 4) - 3);
            let mut origin = random.vector() * height;
            origin.y = height;
            let mut target = random.vector() * height;
            target.y = 0.0;
            // A target on a border or close to it.
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
