//! The volume and the inside of closed shapes.

use super::{Cone, Cylinder, Shape};
use glam::DVec3;
use std::f64::consts::PI;

impl Shape {
    /// The volume inside, 0 for shapes that aren't [closed](Shape::is_closed).
    pub(crate) fn volume(&self) -> f64 {
        match self {
            _ if !self.is_closed() => 0.0,
            Shape::Partial(_) => 0.0,
            Shape::Sphere(s) => 4.0 / 3.0 * PI * cube(s.radius),
            Shape::Box(b) => (b.max.as_dvec3() - b.min.as_dvec3()).element_product(),
            Shape::Torus(t) => 2.0 * PI * PI * f64::from(t.radius) * square(t.tube),
            Shape::Cylinder(c) => PI * square(c.radius) * c.base.as_dvec3().distance(c.top.as_dvec3()),
            Shape::Cone(c) => {
                let [r, s] = [c.radius, c.top_radius].map(f64::from);
                PI / 3.0 * c.base.as_dvec3().distance(c.top.as_dvec3()) * (r * r + r * s + s * s)
            }
            Shape::Triangle(_) | Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) => 0.0,
        }
    }

    /// Whether the point lies inside; never for shapes that aren't [closed](Shape::is_closed).
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        match self {
            _ if !self.is_closed() => false,
            Shape::Partial(_) => false,
            Shape::Sphere(s) => p.distance(s.center.as_dvec3()) < f64::from(s.radius),
            Shape::Box(b) => p.cmpgt(b.min.as_dvec3()).all() && p.cmplt(b.max.as_dvec3()).all(),
            Shape::Torus(t) => {
                let (axis, from) = (t.axis.as_dvec3().normalize(), p - t.center.as_dvec3());
                let height = from.dot(axis);
                let ring = (from - axis * height).length() - f64::from(t.radius);
                (ring * ring + height * height).sqrt() < f64::from(t.tube)
            }
            Shape::Cylinder(Cylinder { base, top, radius, .. }) => {
                within(p, [base.as_dvec3(), top.as_dvec3()], [*radius; 2].map(f64::from))
            }
            Shape::Cone(Cone { base, top, radius, top_radius, .. }) => {
                within(p, [base.as_dvec3(), top.as_dvec3()], [*radius, *top_radius].map(f64::from))
            }
            Shape::Triangle(_) | Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) => false,
        }
    }
}

/// Whether a point lies in the truncated cone between two disks of these centres and radii.
fn within(p: DVec3, [base, top]: [DVec3; 2], [radius, top_radius]: [f64; 2]) -> bool {
    let (axis, from) = (top - base, p - base);
    let share = from.dot(axis) / axis.length_squared();
    0.0 < share && share < 1.0 && (from - axis * share).length() < radius + (top_radius - radius) * share
}

fn square(v: f32) -> f64 {
    f64::from(v) * f64::from(v)
}

fn cube(v: f32) -> f64 {
    f64::from(v) * square(v)
}

#[cfg(test)]
mod tests {
    use super::super::{Cuboid, Sphere, Torus};
    use super::*;
    use glam::Vec3;

    fn solids() -> [Shape; 6] {
        let (base, top) = (Vec3::new(-0.4, -0.5, 0.1), Vec3::new(0.5, 0.6, -0.2));
        [
            Shape::Sphere(Sphere { center: Vec3::new(0.1, -0.2, 0.3), radius: 0.6 }),
            Shape::Box(Cuboid { min: Vec3::new(-0.7, -0.2, -0.5), max: Vec3::new(0.3, 0.8, 0.4) }),
            Shape::Torus(Torus { center: Vec3::ZERO, axis: Vec3::new(1.0, 2.0, -0.5), radius: 0.6, tube: 0.25 }),
            Shape::Cylinder(Cylinder { base, top, radius: 0.3, caps: true }),
            Shape::Cone(Cone { base, top, radius: 0.4, top_radius: 0.1, caps: true }),
            Shape::Cone(Cone { base, top, radius: 0.4, top_radius: 0.0, caps: true }),
        ]
    }

    /// Compares volumes with the share of a grid's points inside.
    #[test]
    fn volumes_are_those_of_the_points_inside() {
        let n = 80;
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
        for shape in solids() {
            let points = (0..n * n * n).map(|i| DVec3::new(at(i % n), at(i / n % n), at(i / n / n)));
            let inside = points.filter(|p| shape.contains(*p)).count();
            let counted = inside as f64 * 8.0 / f64::from(n).powi(3);
            assert!((counted / shape.volume() - 1.0).abs() < 0.01, "{shape:?}: {counted} and {}", shape.volume());
        }
    }

    /// A point is inside where a ray from it hits the surface from behind.
    #[test]
    fn inside_is_where_rays_leave() {
        for shape in solids() {
            for i in 0..2000u32 {
                let h = |k: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(k << 29) >> 8) as f32 / 8_388_608.0 - 1.0;
                let ray = canaletto_bvh::Ray::new(Vec3::new(h(1), h(3), h(5)), Vec3::new(0.3, 0.5, h(7)));
                let leaves = shape
                    .intersect(&ray, f32::INFINITY)
                    .is_some_and(|hit| shape.surface(&ray, &hit).normal.dot(ray.direction.as_dvec3()) > 0.0);
                assert_eq!(shape.contains(ray.origin.as_dvec3()), leaves, "{shape:?} {ray:?}");
            }
        }
    }

    #[test]
    fn what_is_open_holds_nothing() {
        let tube = Cylinder { base: Vec3::ZERO, top: Vec3::Y, radius: 1.0, caps: false };
        let tube = Shape::Cylinder(tube);
        assert!(tube.volume() == 0.0 && !tube.contains(DVec3::Y * 0.5));
    }
}
