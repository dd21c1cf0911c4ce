//! Rays against spheres, in f64: Haines, Günther and Akenine-Möller, "Precision improvements for ray/sphere
//! intersection", Ray Tracing Gems (2019), chapter 7. Spheres that are missed by more than the rounding of f32 are
//! culled in f32, four side by side.

use glam::{Vec3, Vec4};

use crate::min_max::min;
use crate::primitive::cull::{Candidates, RELATIVE, Rows, UnitRay};
use crate::slab::{DEFLATE, INFLATE};
use crate::{Aabb, PreparedRay, Ray};

/// The box around the sphere, rounded outwards so that it contains all of it.
#[inline]
pub fn bounds(center: Vec3, radius: f32) -> Aabb {
    let [min, max] = [-radius, radius]
        .map(|r| Vec3::new(add_outwards(center.x, r), add_outwards(center.y, r), add_outwards(center.z, r)));
    Aabb { min, max }
}

/// c + r, rounded away from c, in the direction of r. It has no branches, as the direction of the first rounding is
/// unpredictable.
#[inline(always)]
pub(super) fn add_outwards(c: f32, r: f32) -> f32 {
    let exact = f64::from(c) + f64::from(r);
    let near = exact as f32;
    let (below, above) = (i32::from(f64::from(near) < exact), i32::from(f64::from(near) > exact));
    // The bits as integers in the order of the numbers, with −0 next to 0.
    let order = |bits: i32| bits ^ (bits >> 31 & i32::MAX);
    let step = if r > 0.0 { below } else { -above };
    f32::from_bits(order(order(near.to_bits() as i32).wrapping_add(step)) as u32)
}

/// The nearest t in (0, t_max] at which the ray hits the sphere, from outside or from inside. A sphere whose radius is
/// not above 0 is never hit.
#[inline]
pub fn intersect(ray: &PreparedRay, center: Vec3, radius: f32, t_max: f32) -> Option<f32> {
    intersect_inline(ray, center, radius, t_max)
}

/// [`intersect`] for a ray that is not prepared. Only a hit prepares it.
#[inline]
pub fn intersect_once(ray: &Ray, center: Vec3, radius: f32, t_max: f32) -> Option<f32> {
    let t = parameter(ray, center, radius, t_max)?;
    ray.prepare().clamp_to_box(&bounds(center, radius), t, t_max)
}

#[inline(always)]
pub(crate) fn intersect_inline(ray: &PreparedRay, center: Vec3, radius: f32, t_max: f32) -> Option<f32> {
    let t = parameter(&ray.ray, center, radius, t_max)?;
    ray.clamp_to_box(&bounds(center, radius), t, t_max)
}

/// The hit's t, before it is clamped to the sphere's box and tested against `t_max`.
#[inline(always)]
fn parameter(ray: &Ray, center: Vec3, radius: f32, t_max: f32) -> Option<f64> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let f = origin - center.as_dvec3();
    let r = f64::from(radius);
    // a t² − 2 b t + c = 0
    let a = direction.dot(direction);
    let b = -f.dot(direction);
    // r² minus the squared distance of center and ray: b² − a c without its cancellation (eq. 5).
    let l = f + (b / a) * direction;
    let discriminant = r * r - l.dot(l);
    // NaN, for a zero direction, must fail as well.
    if !(discriminant >= 0.0 && r > 0.0) {
        return None;
    }
    let root = (a * discriminant).sqrt();
    // The root of larger size first, then the other from their product c / a (eq. 9 and 10).
    let q = if b < 0.0 { b - root } else { b + root };
    let [t0, t1] = [(f.dot(f) - r * r) / q, q / a];
    let (first, second) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
    // NaN, from 0 / 0, means an origin on the surface of a sphere that the ray touches: no hit ahead.
    let t = if first > 0.0 { first } else { second };
    (t > 0.0 && t <= 2.0 * f64::from(t_max)).then_some(t)
}

/// The distances of a ray's line from the centers of four spheres, with E, a bound on the f32 error of these lengths.
///
/// Let u = 2⁻²⁴. The vector g from the origin to a center is off by u |g|, and the unit direction e by u. So b = g·e is
/// off by 5 u |g|, and l = g − b e, from the ray's nearest point to the center, by 9 u |g|. Underflow adds less than
/// the smallest normal number. E = 16 u (|g₁| + |g₂| + |g₃|) plus that number is more than enough, also for the
/// roundings of the sums that use it here. What f64 adds in the exact test is smaller by 2⁻²⁴, or, where the
/// discriminant nearly vanishes, still by 2⁻⁴.
struct LineDistance {
    /// The distance along the ray from the origin to the point nearest the center.
    b: Vec4,
    /// The squared distance of that point from the center.
    squared: Vec4,
    error: Vec4,
}

impl LineDistance {
    #[inline(always)]
    fn new([x, y, z]: &Rows, ray: &UnitRay) -> Self {
        let [gx, gy, gz] = [*x - ray.origin[0], *y - ray.origin[1], *z - ray.origin[2]];
        let [ex, ey, ez] = ray.unit;
        let b = gx * ex + gy * ey + gz * ez;
        let (lx, ly, lz) = (gx - b * ex, gy - b * ey, gz - b * ez);
        let error = (gx.abs() + gy.abs() + gz.abs()) * RELATIVE + f32::MIN_POSITIVE;
        Self { b, squared: lx * lx + ly * ly + lz * lz, error }
    }

    /// A bound for `squared`: a line that hits the sphere has no larger `squared`, with all roundings.
    #[inline(always)]
    fn reach(&self, radius: Vec4) -> Vec4 {
        let reach = radius + self.error;
        reach * reach * INFLATE + f32::MIN_POSITIVE
    }
}

/// Culls the spheres that the line passes, that lie behind the origin or that are entered beyond `t_max`. A comparison
/// with NaN, from overflow or from a lane without a sphere, culls nothing.
#[inline(always)]
pub(crate) fn cull(center: &Rows, radius: Vec4, ray: &UnitRay, t_max: f32) -> Candidates {
    let passing = LineDistance::new(center, ray);
    let reach = passing.reach(radius);
    let missed = passing.squared.cmpgt(reach).bitmask();
    if missed == 0b1111 {
        return Candidates::NONE;
    }
    // The ray is inside for h = √(r² − l²) to both sides of b. This is an upper bound of h.
    let h = (reach - passing.squared).sqrt();
    let near = (passing.b - h - passing.error) * ray.per_length;
    let beyond = (near * DEFLATE).cmpgt(Vec4::splat(t_max)) | (passing.b + h + passing.error).cmplt(Vec4::ZERO);
    Candidates { lanes: !(missed | beyond.bitmask()), near: (near * DEFLATE).to_array() }
}

/// [`cull`] for any-hit rays: the spheres that may be hit, and those that certainly are. A certain hit is a sphere
/// ahead of the origin by more than its radius, whose center the line passes by less than the radius before `t_max`.
/// The exact test then finds the first root. That root lies in the sphere's box, so that `clamp_to_box` accepts it.
#[inline(always)]
pub(crate) fn cull_any(center: &Rows, radius: Vec4, ray: &UnitRay, t_max: f32) -> (u32, u32) {
    let passing = LineDistance::new(center, ray);
    let missed = passing.squared.cmpgt(passing.reach(radius)).bitmask();
    if missed == 0b1111 {
        return (0, 0);
    }
    let LineDistance { b, squared, error } = passing;
    let inner = radius - error;
    let met = inner.cmpgt(Vec4::ZERO) & (squared * INFLATE + f32::MIN_POSITIVE).cmplt(inner * inner);
    let ahead = b.cmpgt(radius + error);
    let before = ((b + error) * ray.per_length * INFLATE).cmple(Vec4::splat(min(f32::MAX, t_max)));
    let surely = (met & ahead & before).bitmask();
    let early = ((b - radius - error * 2.0) * ray.per_length * DEFLATE).cmpgt(Vec4::splat(t_max));
    let behind = (b + radius + error * 2.0).cmplt(Vec4::ZERO);
    (!(missed | (early | behind).bitmask()), surely)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn hit(origin: [f32; 3], direction: [f32; 3], radius: f32) -> Option<f32> {
        intersect(&Ray::new(origin.into(), direction.into()).prepare(), Vec3::ZERO, radius, f32::INFINITY)
    }

    #[test]
    fn from_outside_inside_and_the_surface() {
        assert_eq!(hit([0.0, 0.0, 5.0], [0.0, 0.0, -1.0], 2.0), Some(3.0));
        assert_eq!(hit([0.0, 0.0, 5.0], [0.0, 0.0, -0.5], 2.0), Some(6.0));
        assert_eq!(hit([0.0, 0.0, 5.0], [0.0, 0.0, 1.0], 2.0), None);
        assert_eq!(hit([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], 2.0), Some(1.0));
        assert_eq!(hit([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], 2.0), Some(3.0));
        assert_eq!(hit([0.0, 0.0, 0.0], [3.0, 0.0, 4.0], 5.0), Some(1.0));
        // An origin on the surface: outwards nothing is hit, inwards the other side.
        for (inwards, far) in [([-3.0, -4.0, 0.0], Some(2.0)), ([-1.0, 0.0, 0.0], Some(6.0)), ([3.0, 4.0, 0.0], None)] {
            assert_eq!(hit([3.0, 4.0, 0.0], inwards, 5.0), far);
        }
        assert_eq!(hit([3.0, 4.0, 0.0], [4.0, -3.0, 0.0], 5.0), None);
    }

    #[test]
    fn the_end_counts() {
        let ray = Ray::new(Vec3::Z * 5.0, -Vec3::Z);
        assert_eq!(intersect(&ray.prepare(), Vec3::ZERO, 2.0, 3.0), Some(3.0));
        assert_eq!(intersect(&ray.prepare(), Vec3::ZERO, 2.0, 3.0_f32.next_down()), None);
    }

    #[test]
    fn a_tangent_touches() {
        for far in [2.0, 1e3, 2f32.powi(30)] {
            assert_eq!(hit([1.0, 0.0, far], [0.0, 0.0, -1.0], 1.0), Some(far));
            assert_eq!(hit([1.0_f32.next_up(), 0.0, far], [0.0, 0.0, -1.0], 1.0), None);
        }
    }

    #[test]
    fn a_far_origin_does_not_blur_the_rim() {
        let random = &mut Random(23);
        // The ray runs through 0, so that the distance of the center is exact. f·f − r² would lose it in f·f.
        let ray = Ray::new(Vec3::new(2f32.powi(28), 2f32.powi(28), 0.0), Vec3::new(-1.0, -1.0, 0.0));
        for _ in 0..1000 {
            let c = random.vector();
            let distance = c.z.hypot((c.x - c.y) / 2f32.sqrt());
            if (distance - 1.0).abs() > 1e-6 {
                let hit = intersect(&ray.prepare(), c, 1.0, f32::INFINITY);
                assert_eq!(hit.is_some(), distance < 1.0, "{c}");
            }
        }
    }

    #[test]
    fn no_radius_and_no_direction_are_no_hit() {
        for radius in [0.0, -1.0, f32::NAN] {
            assert_eq!(hit([0.0, 0.0, 5.0], [0.0, 0.0, -1.0], radius), None);
        }
        assert_eq!(hit([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 1.0), None);
    }

    #[test]
    fn sizes_from_tiny_to_huge() {
        for s in [1e-36_f32, 1e-20, 1.0, 1e20, 1e37] {
            for d in [1.0, s] {
                let t = hit([0.0, 0.0, 5.0 * s], [0.0, 0.0, -d], 2.0 * s).unwrap();
                assert!((t / (3.0 * s / d) - 1.0).abs() < 1e-6, "{s} {t}");
            }
        }
        // A planet's ground from the height of an eye, and a pea from the moon.
        assert_eq!(hit([0.0, 6_371_002.0, 0.0], [0.0, -1.0, 0.0], 6_371_000.0), Some(2.0));
        let t = hit([0.0, 1e-9, 4e8], [0.0, 0.0, -1.0], 4e-3);
        assert_eq!(t, Some(4e8));
        assert_eq!(hit([0.0, 4.1e-3, 4e8], [0.0, 0.0, -1.0], 4e-3), None);
    }

    /// With whole numbers everything is exact in i128: whether there is a hit, and between which two floats t lies.
    #[test]
    fn whole_numbers_are_solved_to_the_last_place() {
        let random = &mut Random(21);
        let mut whole = |size: f32| random.vector().to_array().map(|x| (x * size) as i128);
        let float = |v: [i128; 3]| Vec3::from_array(v.map(|x| x as f32));
        let dot = |a: [i128; 3], b: [i128; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (mut hits, mut inside) = (0, 0);
        for i in 0..40_000 {
            let size = [100.0, 3e3, 1e5][i % 3];
            let [origin, center, aim] = [whole(size), whole(size), whole(size)];
            let radius = whole(size)[0].abs() + 1;
            let d = if i % 2 == 0 { whole(300.0) } else { [0, 1, 2].map(|i| aim[i] - origin[i]) };
            let f = [0, 1, 2].map(|i| origin[i] - center[i]);
            let (a, b, c) = (dot(d, d), -dot(f, d), dot(f, f) - radius * radius);
            let ray = Ray::new(float(origin), float(d));
            let t = intersect(&ray.prepare(), float(center), radius as f32, f32::INFINITY);
            // a t² − 2 b t + c = 0 has a root above 0 if the origin is inside, or if the sphere is ahead with b² ≥ a c.
            let exists = a > 0 && (c < 0 || (b > 0 && b * b >= a * c));
            assert_eq!(t.is_some(), exists, "{ray:?}");
            let Some(t) = t else { continue };
            hits += 1;
            inside += usize::from(c < 0);
            if (b * b - a * c) * 1_000_000 < b * b {
                continue; // Nearly tangential: the polynomial may not change its sign.
            }
            // The sign of the polynomial at t = m 2^-s, times 2^2s.
            let sign = |t: f32| {
                let (m, s) = ((f64::from(t) * 2f64.powi(40)) as i128, 40);
                let shift = m.trailing_zeros().min(s);
                let (m, s) = (m >> shift, s - shift);
                (a * m * m - ((2 * b * m) << s) + (c << (2 * s))).signum()
            };
            if !(1e-3..1e3).contains(&t) {
                continue; // 2^40 t, or the sums above, would not be exact.
            }
            let (before, after) = (sign(t.next_down()), sign(t.next_up()));
            // At the nearer root the polynomial falls from above 0, at the farther root it rises. From outside the
            // nearer root is hit.
            let expected = if c < 0 { (-1, 1) } else { (1, -1) };
            assert_eq!((before, after), expected, "{ray:?} {t}");
        }
        assert!(hits > 5000 && inside > 1000, "{hits} {inside}");
    }

    #[test]
    fn bounds_are_the_nearest_that_hold_the_sphere() {
        let random = &mut Random(24);
        for i in 0..20_000 {
            let size = |r: &mut Random| r.signed() * 10f32.powi(r.below(90) as i32 - 45);
            let (c, r) = (size(random), size(random).abs().max(f32::from_bits(1)));
            let c = [c, 0.0, -0.0, r, -r][i % 5];
            let Aabb { min, max } = bounds(Vec3::splat(c), r);
            let [low, high] = [-r, r].map(|r| f64::from(c) + f64::from(r));
            let (near_low, near_high) = (low as f32, high as f32);
            let least = if f64::from(near_low) > low { near_low.next_down() } else { near_low };
            let greatest = if f64::from(near_high) < high { near_high.next_up() } else { near_high };
            assert_eq!((min.x.to_bits(), max.x.to_bits()), (least.to_bits(), greatest.to_bits()), "{c} {r}");
        }
    }

    #[test]
    fn bounds_hold_the_sphere() {
        let random = &mut Random(22);
        for _ in 0..1000 {
            let (center, radius) = (100.0 * random.vector(), random.signed().abs());
            let b = bounds(center, radius);
            let r = f64::from(radius);
            assert!((b.min.as_dvec3() + r).cmple(center.as_dvec3()).all());
            assert!((b.max.as_dvec3() - r).cmpge(center.as_dvec3()).all());
            assert!((b.max.as_dvec3() - r - 1e-5).cmple(center.as_dvec3()).all(), "and no more");
        }
        assert_eq!(bounds(Vec3::ONE, 2.0), Aabb { min: -Vec3::ONE, max: Vec3::splat(3.0) });
    }
}
