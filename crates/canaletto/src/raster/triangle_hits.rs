//! Hits of lines on triangles, eight side by side. The rasteriser knows already that each line meets its triangle.

use crate::shape::{SURFACES, Vec3x8, set_vec3};
use canaletto_bvh::{InstructionSet, Kernel, Ray};
use glam::Vec3;

/// Rays from the viewer, each with the triangle that it sees.
#[derive(Default)]
pub(crate) struct TriangleHits {
    groups: Vec<TriangleHits8>,
    len: usize,
}

/// Eight rays with their triangles, and the results.
struct TriangleHits8 {
    origin: Vec3x8,
    direction: Vec3x8,
    corners: [Vec3x8; 3],
    /// The parameters of the hits.
    t: [f32; SURFACES],
    /// The barycentric coordinates.
    uv: [[f32; SURFACES]; 2],
    /// Whether a hit lies on the triangle.
    is_inside: [bool; SURFACES],
}

impl TriangleHits8 {
    const NOTHING: TriangleHits8 = TriangleHits8 {
        origin: [[0.0; SURFACES]; 3],
        direction: [[0.0; SURFACES]; 3],
        corners: [[[0.0; SURFACES]; 3]; 3],
        t: [0.0; SURFACES],
        uv: [[0.0; SURFACES]; 2],
        is_inside: [false; SURFACES],
    };

    #[inline(always)]
    fn find(&mut self) {
        let [a, b, c] = &self.corners;
        for i in 0..SURFACES {
            let at = |v: &Vec3x8| [v[0][i], v[1][i], v[2][i]];
            let (is_inside, t, uv) = meet([at(&self.origin), at(&self.direction)], [at(a), at(b), at(c)]);
            (self.is_inside[i], self.t[i]) = (is_inside, t);
            (self.uv[0][i], self.uv[1][i]) = (uv[0], uv[1]);
        }
    }
}

/// Whether a hit lies on the triangle, its t, and its u and v. They follow from Cramer's rule for
/// a + u (b − a) + v (c − a) = origin + t direction (Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle
/// Intersection*, 1997). In `f64` they differ from those of the ray tracer's watertight test by the rounding to `f32`
/// at most.
#[inline(always)]
fn meet([origin, direction]: [[f32; 3]; 2], corners: [[f32; 3]; 3]) -> (bool, f32, [f32; 2]) {
    let wide = |v: [f32; 3]| [f64::from(v[0]), f64::from(v[1]), f64::from(v[2])];
    let (o, d) = (wide(origin), wide(direction));
    let (a, b, c) = (wide(corners[0]), wide(corners[1]), wide(corners[2]));
    let (ab, ac, oa) = (minus(b, a), minus(c, a), minus(a, o));
    let (normal, across) = (cross(ab, ac), cross(oa, d));
    let scale = 1.0 / dot(normal, d);
    let t = dot(normal, oa) * scale;
    let (u, v) = (dot(across, ac) * scale, -(dot(across, ab) * scale));
    let is_inside =
        (t >= f64::from(f32::MIN_POSITIVE)) & (t < f64::from(f32::MAX)) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0);
    let (u, v) = (u as f32, v as f32);
    let rest = 1.0 - u;
    (is_inside, t as f32, [u, if v < rest { v } else { rest }])
}

/// The hit of a ray on a triangle: t and the barycentric coordinates. None if the ray passes beside the triangle.
pub(crate) fn triangle_hit(ray: &Ray, corners: &[Vec3; 3]) -> Option<(f32, [f32; 2])> {
    let (is_inside, t, uv) = meet([ray.origin, ray.direction].map(|v| v.to_array()), corners.map(|v| v.to_array()));
    is_inside.then_some((t, uv))
}

#[inline(always)]
fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

struct Find<'a>(&'a mut [TriangleHits8]);

impl Kernel for Find<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for group in self.0 {
            group.find();
        }
    }
}

impl TriangleHits {
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds a ray and the triangle that it sees.
    #[inline]
    pub(crate) fn push(&mut self, ray: &Ray, corners: &[Vec3; 3]) {
        let (number, lane) = (self.len / SURFACES, self.len % SURFACES);
        if number == self.groups.len() {
            self.groups.push(TriangleHits8::NOTHING);
        }
        let group = &mut self.groups[number];
        set_vec3(&mut group.origin, lane, ray.origin);
        set_vec3(&mut group.direction, lane, ray.direction);
        for (to, corner) in group.corners.iter_mut().zip(corners) {
            set_vec3(to, lane, *corner);
        }
        self.len += 1;
    }

    /// Finds the hits of all rays.
    pub(crate) fn find(&mut self) {
        InstructionSet::run(Find(&mut self.groups[..self.len.div_ceil(SURFACES)]));
    }

    /// [`triangle_hit`] of a ray.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> Option<(f32, [f32; 2])> {
        let (group, lane) = (&self.groups[index / SURFACES], index % SURFACES);
        group.is_inside[lane].then(|| (group.t[lane], [group.uv[0][lane], group.uv[1][lane]]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::testing::Random;
    use canaletto_bvh::triangle::{Triangle, intersect};

    /// The hits are those of the ray tracer's test.
    #[test]
    fn hits_are_those_of_the_ray_tracer() {
        let random = &mut Random(82);
        for set in InstructionSet::available() {
            set.limit();
            let (mut hits, mut cases) = (TriangleHits::default(), Vec::new());
            for i in 0..2000 {
                let size = [1.0, 1e-2, 1e-4][i % 3];
                let far = random.cube() * 4.0;
                let corners = [(); 3].map(|()| far + random.cube() * size);
                let [u, v] = [(); 2].map(|()| random.within(-0.2, 1.1));
                let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                let origin = random.cube();
                let ray = Ray::new(origin, (target - origin).normalize());
                hits.push(&ray, &corners);
                cases.push((ray, corners));
            }
            hits.find();
            let (mut met, mut equal) = (0, 0);
            for (index, (ray, corners)) in cases.iter().enumerate() {
                let expected = intersect(&ray.prepare(), &Triangle::new(*corners), f32::INFINITY);
                let found = hits.get(index);
                assert_eq!(found, triangle_hit(ray, corners));
                assert_eq!(found.is_some(), expected.is_some(), "{ray:?} {corners:?}");
                let (Some(expected), Some((t, [u, v]))) = (expected, found) else { continue };
                assert!((t - expected.t).abs() <= 1e-6 * t && (u - expected.u).abs() < 1e-6, "{ray:?} {corners:?}");
                assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0);
                (met, equal) = (met + 1, equal + u32::from([t, u, v] == [expected.t, expected.u, expected.v]));
            }
            assert!(met > 500 && equal >= met * 99 / 100, "{equal} of {met}");
        }
    }
}
