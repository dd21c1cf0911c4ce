//! Random shapes and rays, and a second definition of the shapes as distances in `f64`.

use super::*;
use glam::Vec3;
use std::f64::consts::TAU;

/// Pseudo-random numbers, equal in every run (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    /// A number in [−1, 1).
    pub(crate) fn signed(&mut self) -> f32 {
        self.within(-1.0, 1.0)
    }

    /// A whole number in 0..n.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f32) as usize
    }

    pub(crate) fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A point in the cube [−1, 1]³.
    pub(crate) fn cube(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// A vector of length 0.1 to 1.7.
    pub(crate) fn vector(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            if v.length() > 0.1 {
                return v;
            }
        }
    }

    /// Returns true once in n calls on average.
    pub(super) fn one_in(&mut self, n: u32) -> bool {
        self.unit() * (n as f32) < 1.0
    }

    /// A direction, sometimes along an axis or in a plane of two.
    pub(super) fn direction(&mut self) -> Vec3 {
        let mut d = self.vector();
        for i in 0..3 {
            let other = d[(i + 1) % 3] != 0.0 || d[(i + 2) % 3] != 0.0;
            if other && self.one_in(12) {
                d[i] = 0.0;
            }
        }
        d
    }
}

/// Closed shapes of each kind, of about the given size, around `at`.
pub(super) fn closed(random: &mut Random, at: Vec3, size: f32) -> [Shape; 6] {
    let r = |random: &mut Random| random.within(0.2, 1.0) * size;
    let (base, top) = (at + random.vector() * size, at);
    let (min, max) = (at - Vec3::from_array([(); 3].map(|()| r(random))), at + Vec3::splat(r(random)));
    let radius = r(random);
    [
        Shape::Sphere(Sphere { center: at, radius: r(random) }),
        Shape::Box(Cuboid { min, max }),
        Shape::Cylinder(Cylinder { base, top, radius: r(random), caps: true }),
        Shape::Cone(Cone { base, top, radius: r(random), top_radius: 0.0, caps: true }),
        Shape::Cone(Cone { base, top, radius: r(random), top_radius: r(random), caps: true }),
        Shape::Torus(Torus { center: at, axis: random.vector(), radius, tube: radius * random.within(0.05, 1.5) }),
    ]
}

/// Open shapes of each kind; triangles and rectangles take turns, and so do whole round shapes and parts of them.
pub(super) fn open(random: &mut Random, at: Vec3, size: f32) -> [Shape; 5] {
    let r = |random: &mut Random| random.within(0.2, 1.0) * size;
    let (base, top) = (at + random.vector() * size, at);
    let [a, b, c] = [(); 3].map(|()| at + random.cube() * size);
    [
        if a.x < at.x {
            Shape::Triangle(Triangle { a, b, c, one_sided: false })
        } else {
            Shape::Rectangle(Parallelogram { corner: a, u: b - a, v: c - a })
        },
        Shape::Plane(Plane { point: at, normal: random.vector() }),
        part_or_whole(Round::Disk(Disk { center: at, normal: random.vector(), radius: r(random) })),
        part_or_whole(Round::Cylinder(Cylinder { base, top, radius: r(random), caps: false })),
        part_or_whole(Round::Cone(Cone { base, top, radius: r(random), top_radius: r(random), caps: false })),
    ]
}

/// A round shape or a part of it, as its radius tells.
fn part_or_whole(whole: Round) -> Shape {
    let [_, (_, radius)] = whole.ends();
    let bits = (radius as f32).to_bits();
    let (start, angle) = ((bits >> 3 & 0xff) as f32 * 1.4, 10.0 + (bits >> 8 & 0xff) as f32 * 1.3);
    match whole {
        _ if bits & 1 == 0 => Shape::Partial(Partial { whole, start, angle }),
        Round::Cylinder(s) => Shape::Cylinder(s),
        Round::Cone(s) => Shape::Cone(s),
        Round::Disk(s) => Shape::Disk(s),
    }
}

/// Closed and open shapes of each kind.
pub(super) fn shapes(random: &mut Random, at: Vec3, size: f32) -> Vec<Shape> {
    closed(random, at, size).into_iter().chain(open(random, at, size)).collect()
}

/// A number that is 0 on the shape's surface and, for a closed shape, negative inside. Its magnitude is never more than
/// the distance, and equal to it near the surface (except at edges).
pub(super) fn distance(shape: &Shape, p: DVec3) -> f64 {
    let frustum = |base: Vec3, top: Vec3, r0: f32, r1: f32, caps: bool| {
        let (base, top) = (base.as_dvec3(), top.as_dvec3());
        let axis = (top - base).normalize();
        let (h, height) = ((p - base).dot(axis), base.distance(top));
        let across = (p - base).reject_from_normalized(axis).length();
        let slope = (f64::from(r1) - f64::from(r0)) / height;
        let side = (across - f64::from(r0) - slope * h) / (1.0 + slope * slope).sqrt();
        let slab = (-h).max(h - height);
        if caps { side.max(slab) } else { side.abs().max(slab) }
    };
    let triangle = |corners: [Vec3; 3]| {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let n = (b - a).cross(c - a).normalize();
        let beyond = |a: DVec3, b: DVec3| (b - a).cross(n).normalize().dot(p - a);
        (p - a).dot(n).abs().max(beyond(a, b)).max(beyond(b, c)).max(beyond(c, a))
    };
    match *shape {
        Shape::Sphere(s) => p.distance(s.center.as_dvec3()) - f64::from(s.radius),
        Shape::Box(s) => (s.min.as_dvec3() - p).max(p - s.max.as_dvec3()).max_element(),
        Shape::Triangle(s) => triangle([s.a, s.b, s.c]),
        Shape::Rectangle(s) => s.halves().map(triangle).into_iter().fold(f64::INFINITY, f64::min),
        Shape::Partial(s) => {
            let (frame, whole) = (
                s.whole.frame(),
                match s.whole {
                    Round::Cylinder(s) => Shape::Cylinder(s),
                    Round::Cone(s) => Shape::Cone(s),
                    Round::Disk(s) => Shape::Disk(s),
                },
            );
            let across = p - s.whole.ends()[0].0;
            let across = across - frame.y * across.dot(frame.y);
            // The angle from the start, by the angle between vectors.
            let angle = |from: DVec3, to: DVec3| from.cross(to).dot(frame.y).atan2(from.dot(to)).rem_euclid(TAU);
            let edges = [0.0, 1.0].map(|fraction| s.out(&frame, fraction));
            let beyond = if angle(edges[0], across) <= f64::from(s.angle).to_radians() {
                0.0
            } else {
                let from = |edge: DVec3| (across - edge * across.dot(edge).max(0.0)).length();
                from(edges[0]).min(from(edges[1]))
            };
            distance(&whole, p).abs().max(beyond)
        }
        Shape::Plane(s) => (p - s.point.as_dvec3()).dot(s.normal.as_dvec3().normalize()).abs(),
        Shape::Disk(s) => {
            let p = p - s.center.as_dvec3();
            let h = p.dot(s.normal.as_dvec3().normalize());
            h.abs().max((p.length_squared() - h * h).max(0.0).sqrt() - f64::from(s.radius))
        }
        Shape::Cylinder(s) => frustum(s.base, s.top, s.radius, s.radius, s.caps),
        Shape::Cone(s) => frustum(s.base, s.top, s.radius, s.top_radius, s.caps),
        Shape::Torus(s) => {
            let p = p - s.center.as_dvec3();
            let h = p.dot(s.axis.as_dvec3().normalize());
            let across = (p.length_squared() - h * h).max(0.0).sqrt();
            (across - f64::from(s.radius)).hypot(h) - f64::from(s.tube)
        }
    }
}

/// A ray that starts near the shape and points roughly towards it.
pub(super) fn ray_near(random: &mut Random, at: Vec3, size: f32) -> Ray {
    let origin = at + random.vector() * size * if random.one_in(4) { 0.3 } else { 4.0 };
    let target = at + random.cube() * size;
    let direction = if random.one_in(4) { random.direction() } else { (target - origin) / size };
    Ray::new(origin, direction * random.within(0.1, 3.0))
}
