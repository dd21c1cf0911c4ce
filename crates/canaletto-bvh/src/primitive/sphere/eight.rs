//! Eight rays and spheres side by side: [`intersect_once`] for each pair, by the operations of the scalar test in equal
//! order.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use glam::Vec3;

use super::single::{add_outwards, intersect_once};
use crate::min_max::{max, min};
use crate::slab::{DEFLATE, INFLATE};
use crate::{InstructionSet, Kernel, Ray};

/// The number of lanes: what the widest registers hold of `f64`.
pub(crate) const LANES: usize = 8;

/// Replaces each `t`, the end of a ray, by the nearest t at which the ray hits the sphere, or by NaN if it doesn't.
///
/// # Panics
/// If `t` and `rays` differ in length.
pub fn intersect_many(rays: &[Ray], center: Vec3, radius: f32, t: &mut [f32]) {
    assert_eq!(rays.len(), t.len());
    InstructionSet::run(IntersectMany { rays, center, radius, t });
}

struct IntersectMany<'a> {
    rays: &'a [Ray],
    center: Vec3,
    radius: f32,
    t: &'a mut [f32],
}

impl Kernel for IntersectMany<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Self { rays, center, radius, t } = self;
        let mut side = Sphere8::NOTHING;
        side.radius = [radius; LANES];
        side.center = center.to_array().map(|c| [c; LANES]);
        let bounds = side.bounds();
        for (rays, t) in rays.chunks(LANES).zip(t.chunks_mut(LANES)) {
            for (i, (ray, t)) in rays.iter().zip(&*t).enumerate() {
                for axis in 0..3 {
                    side.origin[axis][i] = ray.origin[axis];
                    side.direction[axis][i] = ray.direction[axis];
                }
                side.t_max[i] = *t;
            }
            let found = side.intersect(&bounds);
            for (i, (ray, t)) in rays.iter().zip(t).enumerate() {
                *t = if found.is_known[i] == 1 {
                    found.t[i]
                } else {
                    intersect_once(ray, center, radius, *t).unwrap_or(f32::NAN)
                };
            }
        }
    }
}

/// Eight rays, each with its end and a sphere to test.
pub(crate) struct Sphere8 {
    pub(crate) origin: Rows,
    pub(crate) direction: Rows,
    pub(crate) t_max: [f32; LANES],
    pub(crate) center: Rows,
    pub(crate) radius: [f32; LANES],
}

/// The rows x, y and z.
type Rows = [[f32; LANES]; 3];

/// The result of the test.
pub(crate) struct Sphere8Hits {
    /// The t of the hit; NaN for a miss.
    pub(crate) t: [f32; LANES],
    /// Whether `t` is valid, 1 or 0. Where it is 0, the ray has to be tested alone.
    pub(crate) is_known: [u32; LANES],
}

impl Sphere8 {
    pub(crate) const NOTHING: Sphere8 = Sphere8 {
        origin: [[0.0; LANES]; 3],
        direction: [[0.0; LANES]; 3],
        t_max: [0.0; LANES],
        center: [[0.0; LANES]; 3],
        radius: [0.0; LANES],
    };

    /// The corners of the spheres' boxes: [`bounds`](super::bounds).
    #[inline(always)]
    pub(crate) fn bounds(&self) -> [Rows; 2] {
        let mut bounds = [[[0.0; LANES]; 3]; 2];
        for axis in 0..3 {
            for i in 0..LANES {
                bounds[0][axis][i] = add_outwards(self.center[axis][i], -self.radius[i]);
                bounds[1][axis][i] = add_outwards(self.center[axis][i], self.radius[i]);
            }
        }
        bounds
    }

    /// The hits of the rays on the spheres, whose boxes are `bounds`. To be called from a kernel.
    #[inline(always)]
    pub(crate) fn intersect(&self, bounds: &[Rows; 2]) -> Sphere8Hits {
        let ([ox, oy, oz], [dx, dy, dz], [cx, cy, cz]) = (&self.origin, &self.direction, &self.center);
        let (mut t, mut met, mut is_known) = ([0.0f32; LANES], [0u32; LANES], [0u32; LANES]);
        // The operations of `sphere::parameter`.
        for i in 0..LANES {
            let wide = |x: f32| f64::from(x);
            let r = wide(self.radius[i]);
            let (fx, fy, fz) = (wide(ox[i]) - wide(cx[i]), wide(oy[i]) - wide(cy[i]), wide(oz[i]) - wide(cz[i]));
            let (dx, dy, dz) = (wide(dx[i]), wide(dy[i]), wide(dz[i]));
            let a = dx * dx + dy * dy + dz * dz;
            let b = -fx * dx + -fy * dy + -fz * dz;
            let share = b / a;
            let (lx, ly, lz) = (fx + share * dx, fy + share * dy, fz + share * dz);
            let discriminant = r * r - (lx * lx + ly * ly + lz * lz);
            let root = (a * discriminant).sqrt();
            let q = if b < 0.0 { b - root } else { b + root };
            let t0 = ((fx * fx + fy * fy + fz * fz) - r * r) / q;
            let t1 = q / a;
            let first = if t0 < t1 { t0 } else { t1 };
            let second = if t0 < t1 { t1 } else { t0 };
            let nearest = if first > 0.0 { first } else { second };
            t[i] = nearest as f32;
            met[i] =
                u32::from((discriminant >= 0.0) & (r > 0.0) & (nearest > 0.0) & (nearest <= 2.0 * wide(self.t_max[i])));
        }
        // The operations of `PreparedRay::clamp_to_box`.
        for i in 0..LANES {
            let (mut near, mut far, mut regular) = (0.0f32, f32::INFINITY, true);
            for axis in 0..3 {
                let (o, reciprocal) = (self.origin[axis][i], 1.0 / self.direction[axis][i]);
                regular &= (reciprocal.abs() >= f32::MIN_POSITIVE) & (reciprocal.abs() < f32::INFINITY);
                regular &= o.abs() < f32::INFINITY;
                let (low, high) = ((bounds[0][axis][i] - o) * reciprocal, (bounds[1][axis][i] - o) * reciprocal);
                (near, far) = (max(near, min(low, high)), min(far, max(low, high)));
            }
            let far = far * INFLATE;
            let confined = max(near * DEFLATE, min(far, t[i]));
            let within = (confined > 0.0) & (confined <= self.t_max[i]) & (confined < f32::INFINITY);
            let hit = (met[i] == 1) & (near <= far) & within;
            // A sphere that is missed is a valid result whatever its box.
            is_known[i] = u32::from(regular | (met[i] == 0));
            t[i] = if hit { confined } else { f32::NAN };
        }
        Sphere8Hits { t, is_known }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn many_rays_meet_a_sphere_as_each_does() {
        let random = &mut Random(54);
        let sets = InstructionSet::available();
        let (mut hits, mut rays) = (0, Vec::new());
        for n in 0..4000 {
            let scale = [1.0, 1e-36, 1e20, 1e3][n % 4];
            let (center, radius) = (random.vector() * scale, random.signed() * scale);
            rays.clear();
            for i in 0..1 + n % 21 {
                // Rays from outside, inside, the surface and the center, past the sphere and along axes. Some are not
                // regular.
                let away = random.vector().normalize() * radius;
                let origin = center + away * [3.0, 0.5, 1.0, 0.0, 1e9][random.below(5)];
                let target = center + random.vector() * radius * [1.0, 2.0][random.below(2)];
                let mut direction = (target - origin) * [1.0, 1.0 / scale][random.below(2)];
                direction[random.below(3)] *=
                    [1.0, 1.0, 1.0, 0.0, -0.0, 1e-38, f32::INFINITY, f32::NAN][random.below(8)];
                let origin = if i == 7 && n % 5 == 0 { Vec3::NAN } else { origin };
                rays.push(Ray::new(origin, direction * [1.0, 1.0, 1.0, 1.0, 0.0][random.below(5)]));
            }
            let t_max: Vec<f32> = rays
                .iter()
                .map(|ray| {
                    let t = intersect_once(ray, center, radius, f32::INFINITY).unwrap_or(1.0);
                    [f32::INFINITY, t, t.next_down(), f32::NEG_INFINITY, 0.0][random.below(5)]
                })
                .collect();
            for set in sets {
                set.limit();
                let mut found = t_max.clone();
                intersect_many(&rays, center, radius, &mut found);
                for ((ray, t_max), found) in rays.iter().zip(&t_max).zip(found) {
                    let expected = intersect_once(ray, center, radius, *t_max);
                    hits += usize::from(expected.is_some());
                    let same = expected.map_or(found.is_nan(), |t| t.to_bits() == found.to_bits());
                    assert!(same, "{set:?} {ray:?} {center} {radius} {t_max}: {found} instead of {expected:?}");
                }
            }
        }
        assert!(hits > 3_000 * sets.len(), "{hits} hits by {sets:?}");
    }
}
