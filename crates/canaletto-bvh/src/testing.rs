//! Helpers of the tests: random numbers, primitives, scenes, and the loop over all primitives with which the tree must
//! agree.

use glam::{Vec3, Vec3Swizzles};

use crate::primitive::triangle::{self, Triangle};
use crate::{Aabb, Bvh, PreparedRay, Ray, sphere};

/// A random number generator: Marsaglia's xorshift.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (((self.bits() >> 32) * n as u64) >> 32) as usize
    }

    /// A random number in [-1, 1).
    pub(crate) fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum TestPrimitive {
    Triangle([Vec3; 3]),
    Sphere(Vec3, f32),
}

/// A hit: t, u, v and the primitive's id.
pub(crate) type Hit = (f32, f32, f32, u32);

impl TestPrimitive {
    pub(crate) fn bounds(&self) -> Aabb {
        match *self {
            Self::Triangle(vertices) => Aabb::from_points(vertices),
            Self::Sphere(center, radius) => sphere::bounds(center, radius),
        }
    }

    pub(crate) fn scaled(&self, s: f32) -> Self {
        match *self {
            Self::Triangle(vertices) => Self::Triangle(vertices.map(|p| p * s)),
            Self::Sphere(center, radius) => Self::Sphere(center * s, radius * s),
        }
    }

    pub(crate) fn intersect(&self, ray: &PreparedRay, t_max: f32) -> Option<(f32, f32, f32)> {
        match *self {
            Self::Triangle(corners) => {
                triangle::intersect(ray, &Triangle::new(corners), t_max).map(|hit| (hit.t, hit.u, hit.v))
            }
            Self::Sphere(center, radius) => sphere::intersect(ray, center, radius, t_max).map(|t| (t, 0.0, 0.0)),
        }
    }
}

pub(crate) fn tree(scene: &[TestPrimitive]) -> Bvh {
    Bvh::build(&scene.iter().map(TestPrimitive::bounds).collect::<Vec<_>>()).unwrap()
}

/// The nearest hit by a loop over `ids`. Of equally near hits, the one of the lowest id.
pub(crate) fn nearest(scene: &[TestPrimitive], ids: &[u32], ray: &Ray, t_max: f32) -> Option<Hit> {
    let ray = ray.prepare();
    let mut best: Option<Hit> = None;
    for &id in ids {
        let limit = best.map_or(t_max, |best| best.0);
        if let Some((t, u, v)) = scene[id as usize].intersect(&ray, limit)
            && best.is_none_or(|best| t < best.0 || id < best.3)
        {
            best = Some((t, u, v, id));
        }
    }
    best
}

/// The nearest hit by the tree, and the visited leaves in order.
pub(crate) fn nearest_in_tree(scene: &[TestPrimitive], bvh: &Bvh, ray: &Ray, t_max: f32) -> (Option<Hit>, Vec<u32>) {
    let mut best: Option<Hit> = None;
    let mut visits = Vec::new();
    bvh.intersect(&ray.prepare(), t_max, |leaf, t_max| {
        visits.push(leaf.first());
        let ids = &bvh.order()[leaf.first() as usize..leaf.slots().end as usize];
        if let Some(hit) = nearest(scene, ids, ray, *t_max)
            && best.is_none_or(|best| hit.0 < best.0 || hit.3 < best.3)
        {
            *t_max = hit.0;
            best = Some(hit);
        }
    });
    (best, visits)
}

/// A ray that is likely to hit something, and likely to be an awkward case.
pub(crate) fn awkward_ray(scene: &[TestPrimitive], random: &mut Random) -> Ray {
    let bounds = scene[random.below(scene.len())].bounds();
    let other = scene[random.below(scene.len())].bounds();
    let corner = |b: &Aabb, r: &mut Random| Vec3::from_array([0, 1, 2].map(|i| [b.min[i], b.max[i]][r.below(2)]));
    let target = match (scene[random.below(scene.len())], random.below(3)) {
        (TestPrimitive::Triangle(vertices), 0) => vertices[random.below(3)],
        (TestPrimitive::Triangle([a, b, _]), 1) => a + (b - a) * (0.5 + 0.5 * random.signed()),
        _ => corner(&bounds, random),
    };
    let size = (bounds.max - bounds.min).max_element().max((target - other.center()).length());
    let size = if size > 0.0 { size } else { 1.0 };
    match random.below(6) {
        // A ray along an axis, forwards or backwards.
        0 => {
            let axis = Vec3::AXES[random.below(3)] * [1.0, -1.0][random.below(2)];
            Ray::new(target - axis * size, axis)
        }
        // A ray in a plane of two axes.
        1 => {
            let mut direction = random.vector();
            direction[random.below(3)] = [0.0, -0.0][random.below(2)];
            Ray::new(target - direction * size, direction)
        }
        // A ray from another primitive.
        2 => {
            let origin = corner(&other, random);
            Ray::new(origin, target - origin)
        }
        // A direction with components of very different size.
        3 => {
            let power = Vec3::new(1.0, 1e-10, 1e-20);
            let direction = random.vector() * if random.below(2) == 0 { power } else { power.zxy() };
            Ray::new(target - direction * size, direction)
        }
        // A ray from a vertex of another triangle, in whose plane it may lie.
        4 => match scene[random.below(scene.len())] {
            TestPrimitive::Triangle([origin, ..]) => Ray::new(origin, target - origin),
            TestPrimitive::Sphere(origin, radius) => Ray::new(origin + Vec3::X * radius, target - origin),
        },
        _ => {
            let origin = other.center() + random.vector() * size;
            Ray::new(origin, target - origin)
        }
    }
}

fn triangle(center: Vec3, size: Vec3, random: &mut Random) -> TestPrimitive {
    TestPrimitive::Triangle([0; 3].map(|_| center + size * random.vector()))
}

/// Named scenes: soups, and the inputs that are hard for trees.
pub(crate) fn zoo() -> Vec<(&'static str, Vec<TestPrimitive>)> {
    let random = &mut Random(1);
    let mut zoo = Vec::new();
    let mut add = |name, n: usize, make: &mut dyn FnMut(usize, &mut Random) -> TestPrimitive| {
        zoo.push((name, (0..n).map(|i| make(i, random)).collect::<Vec<_>>()));
    };
    for n in [1, 2, 3, 4, 5, 9] {
        add("few", n, &mut |_, r| triangle(r.vector(), Vec3::splat(0.5), r));
    }
    add("triangles", 400, &mut |_, r| triangle(r.vector(), Vec3::splat(0.2), r));
    add("spheres", 300, &mut |_, r| TestPrimitive::Sphere(r.vector(), 0.1 + 0.09 * r.signed()));
    add("mixed", 300, &mut |i, r| match i % 2 {
        0 => triangle(r.vector(), Vec3::splat(0.3), r),
        _ => TestPrimitive::Sphere(r.vector(), 0.1),
    });
    add("identical", 100, &mut |_, _| TestPrimitive::Triangle([Vec3::X, Vec3::Y, Vec3::Z]));
    add("same center", 100, &mut |i, _| TestPrimitive::Sphere(Vec3::ONE, 0.01 * (i + 1) as f32));
    add("flat in z", 200, &mut |_, r| triangle(r.vector() * Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.3, 0.3, 0.0), r));
    add("flat in x, off the origin", 200, &mut |_, r| {
        triangle(Vec3::new(0.7, r.signed(), r.signed()), Vec3::new(0.0, 0.3, 0.3), r)
    });
    add("giant among tiny", 200, &mut |i, r| match i {
        77 => triangle(Vec3::ZERO, Vec3::splat(1e6), r),
        _ => triangle(r.vector(), Vec3::splat(1e-3), r),
    });
    let [p, q] = [Vec3::new(812_345.0, 3_421.0, -234_567.0), Vec3::new(-98_765.0, 534_231.0, 77_777.0)];
    add("in a slanted plane", 200, &mut |_, r| {
        TestPrimitive::Triangle([0; 3].map(|_| p * r.below(9) as f32 + q * r.below(9) as f32))
    });
    add("in a line", 300, &mut |i, r| triangle(Vec3::X * i as f32, Vec3::splat(0.6), r));
    add("needles", 200, &mut |_, r| triangle(r.vector(), Vec3::new(1.0, 1e-6, 1e-6), r));
    add("points and segments", 60, &mut |i, r| {
        let [a, b] = [r.vector(), r.vector()];
        TestPrimitive::Triangle([a, b, [a, b, 0.5 * (a + b)][i % 3]])
    });
    add("1e-30", 200, &mut |_, r| triangle(r.vector() * 1e-30, Vec3::splat(2e-31), r));
    add("1e30", 200, &mut |_, r| triangle(r.vector() * 1e30, Vec3::splat(2e29), r));
    add("1e-30 to 1e30", 240, &mut |i, r| {
        let s = 10f32.powi(i as i32 / 4 - 30);
        triangle(r.vector() * s, Vec3::splat(s), r)
    });
    add("powers of two in a line", 240, &mut |i, r| {
        let s = f32::from_bits((i as u32 + 8) << 23);
        triangle(Vec3::X * s, Vec3::splat(s * 0.1), r)
    });
    add("far from the origin", 200, &mut |_, r| triangle(Vec3::splat(1e6) + r.vector() * 10.0, Vec3::splat(2.0), r));
    add("a floor of squares", 200, &mut |i, _| {
        let at = |x: usize, z: usize| Vec3::new(x as f32 - 5.0, 0.0, z as f32 - 5.0);
        let (x, z) = (i / 2 % 10, i / 20);
        match i % 2 {
            0 => TestPrimitive::Triangle([at(x, z), at(x + 1, z), at(x + 1, z + 1)]),
            _ => TestPrimitive::Triangle([at(x, z), at(x + 1, z + 1), at(x, z + 1)]),
        }
    });
    zoo
}

/// A closed surface of triangles around 0, of size about 1: an icosahedron, subdivided twice, with a random radius at
/// each vertex.
pub(crate) fn closed_mesh(random: &mut Random) -> Vec<[Vec3; 3]> {
    let g = 1.618_034;
    let mut corners = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        corners.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
    }
    let adjacent = |a: Vec3, b: Vec3| (a - b).length() < 2.1;
    let mut faces: Vec<[Vec3; 3]> = Vec::new();
    for (i, &a) in corners.iter().enumerate() {
        for (j, &b) in corners[..i].iter().enumerate() {
            for &c in &corners[..j] {
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    // The corners run counter-clockwise as seen from outside.
                    let outwards = (b - a).cross(c - a).dot(a) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    assert_eq!(faces.len(), 20);
    for _ in 0..2 {
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                // Addition commutes, so both sides of an edge get one and the same middle.
                let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let mut moved: Vec<(Vec3, Vec3)> = Vec::new();
    for vertex in faces.iter_mut().flatten() {
        let to = match moved.iter().find(|(from, _)| from == vertex) {
            Some(&(_, to)) => to,
            None => {
                let to = vertex.normalize() * (1.0 + 0.2 * random.signed());
                moved.push((*vertex, to));
                to
            }
        };
        *vertex = to;
    }
    faces
}
