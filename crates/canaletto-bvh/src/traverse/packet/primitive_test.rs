//! The f32 tests of a sphere and a cylinder against the rays of a group: `sphere::cull` and `cylinder4::cull` with rays
//! for lanes. Their proofs hold here: no culled primitive is hit, and no hit is nearer than its lower bound. An upper
//! bound of t, where a primitive is certainly hit, is later verified by the exact test of the pending primitive.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use super::group::RayGroup;
pub(super) use super::triangle_test::TestMasks;
use crate::Aabb;
use crate::primitive::cull::RELATIVE;
use crate::primitive::cylinder4::VANISHED;
pub(super) use crate::primitive::primitive4::UnpackedPrimitive;
use crate::simd::{Instructions, Mask, ROW, Row, Vector};
use crate::slab::{DEFLATE, INFLATE};

/// `cull::UnitRay` for all rays of a group.
#[derive(Clone, Copy)]
pub(super) struct UnitRays {
    unit: [Row<f32>; 3],
    per_length: Row<f32>,
}

/// The numbers of rays that both tests need.
struct Rays<N> {
    origin: [N; 3],
    unit: [N; 3],
    per_length: N,
    t_max: N,
}

impl UnitRays {
    pub(super) const EMPTY: Self = Self { unit: [Row([0.0; ROW]); 3], per_length: Row([0.0; ROW]) };

    #[inline(always)]
    pub(super) fn set(&mut self, group: &RayGroup) {
        let [x, y, z] = &group.direction;
        for i in 0..ROW {
            let (x, y, z) = (f64::from(x.0[i]), f64::from(y.0[i]), f64::from(z.0[i]));
            let per_length = 1.0 / (x * x + y * y + z * z).sqrt();
            self.unit[0].0[i] = (x * per_length) as f32;
            self.unit[1].0[i] = (y * per_length) as f32;
            self.unit[2].0[i] = (z * per_length) as f32;
            let per_length = per_length as f32;
            // No active ray has an infinite value here, as no reciprocal is infinite.
            self.per_length.0[i] = if per_length < f32::MIN_POSITIVE { f32::NAN } else { per_length };
        }
    }

    /// The spread of the active rays' unit directions: the largest along any axis.
    #[inline(always)]
    pub(super) fn spread<S: Instructions>(&self, s: S, group: &RayGroup) -> f32 {
        let (zero, nothing) = (s.splat(0.0), s.splat(-2.0));
        let mut widest = 0.0;
        for row in &self.unit {
            let (mut least, mut most) = (nothing, nothing);
            for part in 0..S::Vector::PARTS {
                let (unit, takes_part) = (s.load(row, part), s.mask(group.active, part));
                least = least.max(S::Vector::select(takes_part, zero - unit, nothing));
                most = most.max(S::Vector::select(takes_part, unit, nothing));
            }
            widest = crate::min_max::max(widest, most.largest() + least.largest());
        }
        widest
    }

    #[inline(always)]
    fn load<S: Instructions>(&self, s: S, part: usize, group: &RayGroup) -> Rays<S::Vector> {
        let ([x, y, z], [ex, ey, ez]) = (&group.origin, &self.unit);
        Rays {
            origin: [s.load(x, part), s.load(y, part), s.load(z, part)],
            unit: [s.load(ex, part), s.load(ey, part), s.load(ez, part)],
            per_length: s.load(&self.per_length, part),
            t_max: s.load(&group.t_max, part),
        }
    }
}

#[inline(always)]
fn cross<N: Vector>([ax, ay, az]: [N; 3], [bx, by, bz]: [N; 3]) -> [N; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

#[inline(always)]
fn dot<N: Vector>([ax, ay, az]: [N; 3], [bx, by, bz]: [N; 3]) -> N {
    ax * bx + ay * by + az * bz
}

/// The sum of the components' absolute values, which is no less than the length.
#[inline(always)]
fn size<N: Vector>([x, y, z]: [N; 3]) -> N {
    x.abs() + y.abs() + z.abs()
}

/// The interval in which rays enter a primitive.
struct Entry<N: Vector> {
    may: N::Mask,
    /// Rays that certainly hit it where they enter.
    surely: N::Mask,
    low: N,
    high: N,
}

impl RayGroup {
    #[inline(always)]
    pub(super) fn test_sphere<S: Instructions, const NEAREST: bool>(
        &mut self,
        s: S,
        part: usize,
        unit_ray: &UnitRays,
        center: [f32; 3],
        radius: f32,
        place: u32,
    ) -> TestMasks {
        let Rays { origin: [ox, oy, oz], unit: [ex, ey, ez], per_length, t_max } = unit_ray.load(s, part, self);
        let (gx, gy, gz) = (s.splat(center[0]) - ox, s.splat(center[1]) - oy, s.splat(center[2]) - oz);
        let b = gx * ex + gy * ey + gz * ez;
        let (lx, ly, lz) = (gx - b * ex, gy - b * ey, gz - b * ez);
        let squared = lx * lx + ly * ly + lz * lz;
        let (zero, least, radius) = (s.splat(0.0), s.splat(f32::MIN_POSITIVE), s.splat(radius));
        let error = size([gx, gy, gz]) * s.splat(RELATIVE) + least;
        let outer = radius + error;
        let reach = outer * outer * s.splat(INFLATE) + least;
        let may = !reach.less(squared) & zero.less(t_max);
        if S::Vector::lanes(may) == 0 {
            return TestMasks::NOTHING;
        }
        let h = (reach - squared).sqrt();
        let low = (b - h - error) * per_length * s.splat(DEFLATE);
        let may = may & !(t_max.less(low) | (b + h + error).less(zero));
        let inner = radius - error;
        let within = inner * inner - (squared * s.splat(INFLATE) + least);
        let surely = zero.less(inner) & zero.less(within) & within.less(s.splat(f32::INFINITY)) & outer.less(b);
        let high = (b - within.sqrt() + error) * per_length * s.splat(INFLATE);
        self.enter::<S, NEAREST>(s, part, Entry { may, surely, low, high }, place)
    }

    #[inline(always)]
    pub(super) fn test_cylinder<S: Instructions, const NEAREST: bool>(
        &mut self,
        s: S,
        part: usize,
        unit_ray: &UnitRays,
        [base, top]: [[f32; 3]; 2],
        r: f32,
        place: u32,
    ) -> TestMasks {
        let Rays { origin: [ox, oy, oz], unit: e, per_length, t_max } = unit_ray.load(s, part, self);
        let q = [s.splat(base[0]) - ox, s.splat(base[1]) - oy, s.splat(base[2]) - oz];
        let axis = [top[0] - base[0], top[1] - base[1], top[2] - base[2]];
        let v = [s.splat(axis[0]), s.splat(axis[1]), s.splat(axis[2])];
        let (zero, least, r) = (s.splat(0.0), s.splat(f32::MIN_POSITIVE), s.splat(r));
        let v_size = axis[0].abs() + axis[1].abs() + axis[2].abs();
        let n = cross(e, v);
        let k = dot(q, n).abs();
        let q_size = size(q);
        let n_error = s.splat(v_size * RELATIVE + VANISHED);
        let k_error = q_size * s.splat(v_size * RELATIVE + f32::MIN_POSITIVE) + least;
        let squared = dot(n, n);
        let length = squared.sqrt();
        let reach = (length + n_error) * r;
        let k_least = k - k_error;
        let may = !reach.less(k_least) & zero.less(t_max);
        if S::Vector::lanes(may) == 0 {
            return TestMasks::NOTHING;
        }
        let oblique = (n_error * s.splat(32.0)).less(length);
        let v_size = s.splat(v_size);
        let m = cross(q, v);
        let (vv, e_v, q_v) = (dot(v, v), dot(e, v), dot(q, v));
        let (most, k_least) = (reach + k_error, k_least.max(zero));
        let half = (vv * (most * most - k_least * k_least) + least).sqrt();
        let error = (q_size + r) * (v_size * v_size) * s.splat(4.0 * RELATIVE) + least;
        let per = s.splat(1.0) / squared;
        let middle = dot(n, m) * per;
        let aside = (half + error) * per;
        let (s0, s1) = (middle - aside, middle + aside);
        let low = s0 * per_length * s.splat(DEFLATE);
        let (h0, h1) = (s0 * e_v - q_v, s1 * e_v - q_v);
        let h_error = v_size * (q_size + v_size + s0.abs() + s1.abs()) * s.splat(RELATIVE) + least;
        let off = h0.max(h1).less(zero - h_error) | (vv + h_error).less(h0.min(h1));
        let beyond = t_max.less(low) | s1.less(zero);
        let may = may & !(oblique & (off | beyond));
        // A certain hit is one on the side, between the ends.
        let (k_most, inner) = (k + k_error, (length - n_error) * r - k_error);
        let within = inner * inner - k_most * k_most;
        let half = (vv * within).sqrt() * s.splat(DEFLATE);
        let last = middle - (half - error) * per;
        let h2 = last * e_v - q_v;
        let between = h_error.less(h0.min(h2)) & h0.max(h2).less(vv - h_error);
        let surely = oblique & zero.less(inner) & zero.less(within) & error.less(half) & zero.less(s0) & between;
        let low = S::Vector::select(oblique, low, s.splat(f32::NEG_INFINITY));
        let high = last * per_length * s.splat(INFLATE);
        self.enter::<S, NEAREST>(s, part, Entry { may, surely, low, high }, place)
    }

    /// The rays that enter a user primitive's box. They have to be tested alone.
    #[inline(always)]
    pub(super) fn test_box<S: Instructions>(&self, s: S, part: usize, bounds: Aabb) -> TestMasks {
        let (mut near, t_max) = (s.splat(0.0), s.load(&self.t_max, part));
        let (takes_part, mut far) = (near.less(t_max), t_max);
        for axis in 0..3 {
            let (o, r) = (s.load(&self.origin[axis], part), s.load(&self.reciprocal[axis], part));
            let (a, b) = ((s.splat(bounds.min[axis]) - o) * r, (s.splat(bounds.max[axis]) - o) * r);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        TestMasks {
            taken: 0,
            undecided: S::Vector::bits(takes_part & near.less_or_equal(far * s.splat(INFLATE)), part),
        }
    }

    /// Makes a primitive pending for the rays that certainly hit it before all else. Without `NEAREST`, ends the rays
    /// that certainly hit it.
    #[inline(always)]
    fn enter<S: Instructions, const NEAREST: bool>(
        &mut self,
        s: S,
        part: usize,
        entry: Entry<S::Vector>,
        place: u32,
    ) -> TestMasks {
        let Entry { may, surely, low, high } = entry;
        let end: Mask<S>;
        if NEAREST {
            end = may & surely & high.less(s.load(&self.low, part));
            high.store_where(end, &mut self.t_max, part);
            low.store_where(end, &mut self.low, part);
            S::Vector::store_u32_where(end, place, &mut self.pending, part);
        } else {
            end = may & surely & high.less_or_equal(s.splat(f32::MAX).min(s.load(&self.t_max, part)));
            s.splat(f32::NEG_INFINITY).store_where(end, &mut self.t_max, part);
        }
        TestMasks { taken: S::Vector::bits(end, part), undecided: S::Vector::bits(may & !end, part) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitive::cull::UnitRay;
    use crate::simd::Baseline;
    use crate::testing::Random;
    use crate::{Ray, sphere};
    use glam::Vec3;

    fn all_parts(test: impl FnMut(usize) -> TestMasks) -> TestMasks {
        (0..4).map(test).fold(TestMasks::NOTHING, |all, part| TestMasks {
            taken: all.taken | part.taken,
            undecided: all.undecided | part.undecided,
        })
    }

    /// Rays from one place to about a sphere's rim, from large spheres nearby to dots far away, of all magnitudes.
    #[test]
    fn spheres_are_met_where_a_group_is_told() {
        let random = &mut Random(47);
        let (mut hits, mut results, mut misses, mut passed) = (0, 0, 0, 0);
        for i in 0..100_000 {
            let far = random.vector() * 10f32.powi(random.below(6) as i32 - 1);
            let radius = random.signed().abs() * [1.0, 1e-2, 1e-4][i % 3];
            let origin = [Vec3::ZERO, random.vector() * 1e-3, far + random.vector() * radius][random.below(3)];
            let scale = 10f32.powi(random.below(60) as i32 - 30);
            let rays: Vec<Ray> = (0..ROW)
                .map(|_| {
                    let aside = random.vector().normalize().cross(far - origin).normalize_or_zero();
                    let off = [1.0 + random.signed() * 10f32.powi(-(random.below(8) as i32)), random.signed()];
                    let direction = far + aside * radius * off[random.below(2)] - origin;
                    Ray::new(origin * scale, direction * [1.0, scale][i % 2])
                })
                .collect();
            let (center, radius) = (far * scale, radius * scale);
            let exact = |ray: &Ray| sphere::intersect(&ray.prepare(), center, radius, f32::INFINITY);
            let end = exact(&rays[0]).map_or(f32::INFINITY, |t| [t, t.next_down(), 2.0 * t][random.below(3)]);
            let (mut group, mut unit_ray) = (RayGroup::EMPTY, UnitRays::EMPTY);
            group.gather(Baseline, &rays, &rays, |_| end);
            unit_ray.set(&group);
            let (low, part) = (group.low, group.active);
            let c = center.to_array();
            let nearest = all_parts(|part| group.test_sphere::<_, true>(Baseline, part, &unit_ray, c, radius, 5));
            let (lows, highs) = (group.low, group.t_max);
            (group.low, group.t_max) = (low, low);
            let any = all_parts(|part| group.test_sphere::<_, false>(Baseline, part, &unit_ray, c, radius, 5));
            for (i, ray) in rays.iter().enumerate().filter(|(i, _)| part >> i & 1 == 1) {
                let bit = |bits: u32| bits >> i & 1 == 1;
                let t = exact(ray).filter(|t| *t <= end);
                let what = format!("{ray:?} {:?} {center} {radius} {end} {t:?}", UnitRay::new(ray));
                assert!(t.is_none() || bit(nearest.taken | nearest.undecided), "{what}");
                assert!(t.is_none() || bit(any.taken | any.undecided), "{what}");
                assert!(t.is_some() || !bit(any.taken), "{what}");
                if bit(nearest.taken) {
                    let t = t.expect("a pending sphere is hit");
                    assert!(lows.0[i] <= t && t <= highs.0[i], "{what} {} {}", lows.0[i], highs.0[i]);
                }
                hits += usize::from(t.is_some());
                results += usize::from(bit(nearest.taken) && bit(any.taken));
                misses += usize::from(t.is_none());
                passed += usize::from(!bit(nearest.taken | nearest.undecided | any.undecided));
            }
        }
        assert!(
            hits / 4 < results && misses / 5 < passed && hits > 100_000,
            "{results} of {hits}, {passed} of {misses}"
        );
    }
}
