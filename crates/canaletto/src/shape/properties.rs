//! Properties of every shape, at random places, sizes and rays.

use super::testing::*;
use super::*;
use crate::math::offset_origin;
use glam::Vec3;

const INF: f32 = f32::INFINITY;

/// A shape of about the size `size` around `at`, and a ray that may hit it.
struct Case {
    shape: Shape,
    ray: Ray,
    at: Vec3,
    size: f32,
}

impl Case {
    /// The largest magnitude of the numbers in the case.
    fn scale(&self) -> f64 {
        f64::from(self.size.max(self.at.abs().max_element()))
    }
}

/// Sizes from far below to far above the usual.
const ALL: [f32; 2] = [1e-6, 1e9];
/// Sizes that leave room for a scale.
const USUAL: [f32; 2] = [0.1, 10.0];

/// Calls `test` with many cases of the given sizes. It returns whether the ray hit the shape, which must often be so.
fn each(seed: u64, rounds: usize, [least, most]: [f32; 2], mut test: impl FnMut(&mut Random, Case) -> Option<()>) {
    let mut random = Random(seed);
    let mut seen = 0;
    for _ in 0..rounds {
        let size = least * libm::powf(most / least, random.unit());
        let at = if random.one_in(3) { Vec3::ZERO } else { random.cube() * size * random.within(1.0, 30.0) };
        for shape in shapes(&mut random, at, size) {
            let ray = ray_near(&mut random, at, size);
            seen += usize::from(test(&mut random, Case { shape, ray, at, size }).is_some());
        }
    }
    assert!(seen > rounds, "only {seen} hits");
}

#[test]
fn surface_points_lie_on_the_shape() {
    each(1, 3000, ALL, |_, case| {
        let Case { shape, ray, .. } = &case;
        let hit = shape.intersect(ray, INF)?;
        let s = shape.surface(ray, &hit);
        // The hit of a plane may be far away.
        let scale = case.scale().max(s.point.as_dvec3().length());
        let d = distance(shape, s.point.as_dvec3());
        assert!(d.abs() <= 1e-6 * scale, "{shape:?} {ray:?} {hit:?}: {} is {d:e} away", s.point);
        Some(())
    });
}

#[test]
fn surface_points_are_those_of_the_parameter() {
    each(2, 3000, ALL, |_, case| {
        let Case { shape, ray, .. } = &case;
        let hit = shape.intersect(ray, INF)?;
        let s = shape.surface(ray, &hit);
        let p = ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(hit.t);
        let scale = case.scale().max(p.length());
        assert!(p.distance(s.point.as_dvec3()) <= 2e-6 * scale, "{shape:?} {ray:?} {hit:?}: {p} and {}", s.point);
        Some(())
    });
}

#[test]
fn normals_are_units_that_lead_outwards() {
    each(3, 3000, ALL, |_, case| {
        let Case { shape, ray, at, size } = &case;
        let hit = shape.intersect(ray, INF)?;
        let s = shape.surface(ray, &hit);
        assert!((s.normal.length() - 1.0).abs() < 1e-6, "{shape:?}: normal {}", s.normal);
        if !shape.is_closed() || at.length() > 20.0 * size {
            return None;
        }
        let step = 1e-3 * f64::from(*size);
        let [out, inside] = [step, -step].map(|step| distance(shape, s.point.as_dvec3() + s.normal * step));
        // The distance grows with the whole step. At the inner seam of a spindle torus it grows with a part of it.
        assert!(out > 0.5 * step, "{shape:?} {s:?}: {out:e} of {step:e}");
        assert!(inside < 0.0 || distance(shape, s.point.as_dvec3()).abs() > 0.1 * step, "{shape:?} {s:?}: {inside:e}");
        Some(())
    });
}

#[test]
fn bounds_hold_every_surface_point() {
    each(4, 5000, ALL, |_, case| {
        let Case { shape, ray, .. } = &case;
        let (hit, b) = (shape.intersect(ray, INF)?, shape.bounds()?);
        let p = shape.surface(ray, &hit).point;
        assert!(b.min.cmple(p).all() && p.cmple(b.max).all(), "{shape:?}: {p} is not in {b:?}");
        Some(())
    });
}

#[test]
fn bounds_are_tight() {
    // Rays in a plane a little inside each face of the bounds hit the shape.
    let mut random = Random(5);
    for shape in (0..200).flat_map(|_| closed(&mut random, Vec3::new(3.0, -2.0, 1.0), 2.0)) {
        let b = shape.bounds().unwrap();
        for (axis, at) in [(0, 0.03), (0, 0.97), (1, 0.03), (1, 0.97), (2, 0.03), (2, 0.97)] {
            let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
            let meets = (0..400).any(|i| {
                let mut from = b.min;
                from[axis] += (b.max[axis] - b.min[axis]) * at;
                from[across] += (b.max[across] - b.min[across]) * (i as f32 + 0.5) / 400.0;
                from[along] -= 1.0;
                shape.intersect(&Ray::new(from, Vec3::AXES[along]), INF).is_some()
            });
            assert!(meets, "{shape:?}: nothing at {at} of the bounds along axis {axis}");
        }
    }
}

#[test]
fn the_nearest_crossing_is_found() {
    // March in small steps: where the distance changes its sign there must be a hit, no farther away.
    let (mut random, mut crossings) = (Random(6), 0);
    for _ in 0..2000 {
        for shape in closed(&mut random, Vec3::ZERO, 1.0) {
            let ray = ray_near(&mut random, Vec3::ZERO, 1.0);
            let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let step = 0.01 / d.length();
            let inside = |t: f64| distance(&shape, o + d * t) < 0.0;
            let start = inside(0.0);
            let Some(i) = (1..1500).find(|i| inside(f64::from(*i) * step) != start) else { continue };
            let (mut low, mut high) = (f64::from(i - 1) * step, f64::from(i) * step);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if inside(middle) == start { low = middle } else { high = middle }
            }
            let hit = shape.intersect(&ray, INF).unwrap_or_else(|| panic!("{shape:?} {ray:?}: no hit at {low}"));
            let t = f64::from(hit.t);
            // A hit before the crossing is a graze between two steps, which other tests cover.
            assert!(t <= high + 1e-6 * high.max(step), "{shape:?} {ray:?}: {t}, not {low}");
            assert!(distance(&shape, o + d * t).abs() < 1e-5, "{shape:?} {ray:?}: {t}, not {low}");
            crossings += 1;
        }
    }
    assert!(crossings > 2000);
}

#[test]
fn the_end_of_the_interval_counts() {
    each(7, 2000, ALL, |_, Case { shape, ray, .. }| {
        let hit = shape.intersect(&ray, INF)?;
        assert_eq!(shape.intersect(&ray, hit.t), Some(hit), "{shape:?} {ray:?}");
        assert_eq!(shape.intersect(&ray, hit.t.next_down()), None, "{shape:?} {ray:?}");
        Some(())
    });
}

/// The ray from the surface's point to the side of `d`.
fn leave(s: &Surface, d: Vec3) -> Ray {
    Ray::new(offset_origin(s.point, s.error, s.normal, d.as_dvec3()), d)
}

#[test]
fn a_ray_that_leaves_a_convex_shape_never_meets_it_again() {
    each(8, 5000, ALL, |random, case| {
        let Case { shape, ray, .. } = &case;
        if !shape.is_closed() || matches!(shape, Shape::Torus(_)) {
            return None;
        }
        let s = shape.surface(ray, &shape.intersect(ray, INF)?);
        let d = random.direction();
        let out = leave(&s, if d.dot(s.normal.as_vec3()) < 0.0 { -d } else { d });
        assert_eq!(shape.intersect(&out, INF), None, "{shape:?} {s:?} {out:?}");
        Some(())
    });
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_meet_it_at_once() {
    each(9, 5000, ALL, |random, case| {
        let Case { shape, ray, .. } = &case;
        let s = shape.surface(ray, &shape.intersect(ray, INF)?);
        let d = random.vector();
        // The ray is steep, so that it hits a torus again only far off.
        let d =
            if d.dot(s.normal.as_vec3()) < 0.0 { d - s.normal.as_vec3() * 0.5 } else { d + s.normal.as_vec3() * 0.5 };
        if shape.is_closed() && d.dot(s.normal.as_vec3()) < 0.0 {
            return None;
        }
        let again = shape.intersect(&leave(&s, d), INF);
        let least = 1e-3 * case.size;
        assert!(again.is_none_or(|hit| hit.t > least), "{shape:?} {s:?} {d}: {again:?}");
        Some(())
    });
}

#[test]
fn a_ray_that_goes_inside_meets_the_far_side() {
    each(10, 5000, ALL, |random, case| {
        let Case { shape, ray, .. } = &case;
        if !shape.is_closed() {
            return None;
        }
        let s = shape.surface(ray, &shape.intersect(ray, INF)?);
        let d = random.direction();
        let d = if d.dot(s.normal.as_vec3()) > 0.0 { -d } else { d };
        let inside = leave(&s, d);
        // Points within rounding of an edge are left out: the other side of the surface isn't the inside there.
        let depth = -distance(shape, inside.origin.as_dvec3());
        if depth < 0.5 * f64::from(s.normal.as_vec3().abs().dot(s.error)) {
            return None;
        }
        let far = shape.intersect(&inside, INF).unwrap_or_else(|| panic!("{shape:?} {s:?} {inside:?}: lost"));
        let normal = shape.surface(&inside, &far).normal.as_vec3();
        let out = normal.dot(d);
        assert!(out > -1e-5 * d.length(), "{shape:?} {s:?} {inside:?}: left through {normal}");
        Some(())
    });
}

/// Calls `test` with shapes whose surface passes through the scene's origin, and the surface of a hit there.
/// Coordinates nearly cancel there, and their own rounding bounds nothing.
fn through_origin(seed: u64, mut test: impl FnMut(&mut Random, &Shape, Surface)) {
    each(seed, 20_000, USUAL, |random, Case { shape, ray, .. }| {
        let s = shape.surface(&ray, &shape.intersect(&ray, INF)?);
        let back = Transform::translate(-s.point.as_dvec3());
        let shape = shape.transformed(&back)?;
        // A little off the origin, so that the coordinates are tiny but not 0.
        let off = random.vector() * libm::powf(10.0, random.within(-18.0, -6.0));
        let ray = Ray::new(off - ray.direction, ray.direction);
        let hit = shape.intersect(&ray, INF).filter(|hit| (hit.t - 1.0).abs() < 1e-3)?;
        test(random, &shape, shape.surface(&ray, &hit));
        Some(())
    });
}

#[test]
fn bounds_hold_surface_points_next_to_the_origin() {
    through_origin(16, |_, shape, Surface { point: p, .. }| {
        let Some(b) = shape.bounds() else { return };
        assert!(b.min.cmple(p).all() && p.cmple(b.max).all(), "{shape:?}: {p} is not in {b:?}");
    });
}

#[test]
fn error_bounds_hold_next_to_the_origin() {
    through_origin(17, |_, shape, s| {
        let d = distance(shape, s.point.as_dvec3());
        let bound = f64::from(s.normal.as_vec3().abs().dot(s.error));
        // The distance itself has an error of a few 1e-15 of the shape's size.
        assert!(d.abs() <= bound, "{shape:?}: {s:?} is {d:e} away, beyond {bound:e}");
    });
}

#[test]
fn rays_leave_surfaces_next_to_the_origin() {
    through_origin(18, |random, shape, s| {
        let d = random.vector().normalize();
        if d.dot(s.normal.as_vec3()).abs() < 0.2 || shape.is_closed() && d.dot(s.normal.as_vec3()) < 0.0 {
            return;
        }
        let again = shape.intersect(&leave(&s, d), INF);
        assert!(again.is_none_or(|hit| hit.t > 1e-5), "{shape:?} {s:?} {d}: {again:?}");
    });
}

#[test]
fn surface_points_stay_within_edges() {
    // Rays at a box's and a cylinder's edges, where the point rounds to either side.
    let mut random = Random(19);
    for _ in 0..20_000 {
        let (a, b) = (random.cube(), random.cube());
        let shape = match random.one_in(2) {
            true => Shape::Box(Cuboid { min: a.min(b), max: a.max(b) }),
            false => Shape::Cylinder(Cylinder { base: a, top: b, radius: 0.5, caps: true }),
        };
        let edge = match shape {
            Shape::Box(s) => Vec3::new(s.min.x, s.max.y, s.min.z + (s.max.z - s.min.z) * random.unit()),
            _ => b + (b - a).any_orthonormal_vector() * 0.5,
        };
        let ray = Ray::new(random.cube() * 3.0, Vec3::ZERO);
        let ray = Ray { direction: edge - ray.origin, ..ray };
        let Some(hit) = shape.intersect(&ray, INF) else { continue };
        let s = shape.surface(&ray, &hit);
        let b = shape.bounds().unwrap();
        assert!(b.min.cmple(s.point).all() && s.point.cmple(b.max).all(), "{shape:?}: {s:?} is not in {b:?}");
        assert!(distance(&shape, s.point.as_dvec3()) < 2e-7, "{shape:?}: {s:?}");
        if let Shape::Box(Cuboid { min, max }) = shape {
            let plane = if hit.part % 2 == 1 { max } else { min };
            let axis = hit.part as usize / 2;
            assert_eq!(s.point[axis], plane[axis], "{shape:?}: {s:?}");
        }
    }
}

#[test]
fn a_scale_by_a_power_of_two_changes_no_bit() {
    each(11, 2000, USUAL, |_, Case { shape, ray, .. }| {
        let hit = shape.intersect(&ray, INF);
        for k in [-20, -3, 1, 30] {
            let f = libm::ldexpf(1.0, k);
            let scaled = scaled(&shape, f);
            let grown = Ray::new(ray.origin * f, ray.direction);
            let again = scaled.intersect(&grown, INF);
            assert_eq!(again, hit.map(|h| ShapeHit { t: h.t * f, ..h }), "{shape:?} {ray:?} by {f}");
            let (Some(hit), Some(again)) = (hit, again) else { continue };
            let (a, b) = (shape.surface(&ray, &hit), scaled.surface(&grown, &again));
            assert_eq!((a.point * f, a.error * f, a.normal), (b.point, b.error, b.normal), "{shape:?} {ray:?} by {f}");
            // A plane's texture coordinates are lengths.
            let uv = if let Shape::Plane(_) = shape { a.uv * f } else { a.uv };
            assert_eq!(uv, b.uv, "{shape:?} {ray:?} by {f}");
            // If the ray's direction is scaled as well, t is unchanged.
            let longer = Ray::new(ray.origin * f, ray.direction * f);
            assert_eq!(scaled.intersect(&longer, INF).map(|h| h.t), Some(hit.t), "{shape:?} {ray:?} by {f}");
        }
        hit.map(|_| ())
    });
}

fn scaled(shape: &Shape, f: f32) -> Shape {
    let mut shape = *shape;
    match &mut shape {
        Shape::Sphere(s) => (s.center, s.radius) = (s.center * f, s.radius * f),
        Shape::Box(s) => (s.min, s.max) = (s.min * f, s.max * f),
        Shape::Triangle(s) => (s.a, s.b, s.c) = (s.a * f, s.b * f, s.c * f),
        Shape::Plane(s) => s.point *= f,
        Shape::Disk(s) => (s.center, s.radius) = (s.center * f, s.radius * f),
        Shape::Cylinder(s) => (s.base, s.top, s.radius) = (s.base * f, s.top * f, s.radius * f),
        Shape::Cone(s) => {
            (s.base, s.top, s.radius, s.top_radius) = (s.base * f, s.top * f, s.radius * f, s.top_radius * f)
        }
        Shape::Torus(s) => (s.center, s.radius, s.tube) = (s.center * f, s.radius * f, s.tube * f),
        Shape::Rectangle(s) => (s.corner, s.u, s.v) = (s.corner * f, s.u * f, s.v * f),
        Shape::Partial(s) => match &mut s.whole {
            Round::Cylinder(s) => (s.base, s.top, s.radius) = (s.base * f, s.top * f, s.radius * f),
            Round::Cone(s) => {
                (s.base, s.top, s.radius, s.top_radius) = (s.base * f, s.top * f, s.radius * f, s.top_radius * f)
            }
            Round::Disk(s) => (s.center, s.radius) = (s.center * f, s.radius * f),
        },
    }
    shape
}

#[test]
fn a_moved_shape_is_hit_as_by_the_ray_moved_back() {
    each(12, 1500, USUAL, |random, Case { shape, ray, at, size }| {
        if at.length() > 20.0 * size {
            return None;
        }
        let scale = |v: Vec3| Transform::scale(v.as_dvec3()).unwrap();
        let turned = Transform::rotate(random.vector().as_dvec3(), 77.0).unwrap();
        let moved = Transform::translate(random.cube().as_dvec3() * 3.0);
        let t = match shape {
            Shape::Box(_) => moved.after(&scale(Vec3::new(2.0, -0.5, 1.5))),
            Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) => {
                turned.after(&scale(Vec3::new(2.0, 0.5, -1.5)))
            }
            _ => moved.after(&turned).after(&scale(Vec3::new(-1.5, 1.5, 1.5))),
        };
        // What keeps its image by another way becomes an instance.
        let Some(there) = shape.transformed(&t) else {
            assert!(matches!(shape, Shape::Rectangle(_) | Shape::Partial(_)), "{shape:?}");
            return None;
        };
        let ray_there =
            Ray::new(t.point(ray.origin.as_dvec3()).as_vec3(), t.vector(ray.direction.as_dvec3()).as_vec3());
        let (Some(a), Some(b)) = (shape.intersect(&ray, INF), there.intersect(&ray_there, INF)) else { return None };
        let (here, there) = (shape.surface(&ray, &a).transformed(&t), there.surface(&ray_there, &b));
        // Rounding may move a grazing hit far, or over an edge; such cases have a different parameter.
        if (a.t - b.t).abs() > 1e-4 * a.t {
            return None;
        }
        assert!(here.point.distance(there.point) < 1e-3 * size * (1.0 + a.t), "{shape:?} {t:?}: {here:?} {there:?}");
        assert!(here.normal.dot(there.normal) > 0.99, "{shape:?} {t:?}: {here:?} {there:?}");
        Some(())
    });
}

#[test]
fn texture_coordinates_stay_where_they_are_said_to() {
    each(13, 1500, USUAL, |random, Case { shape, ray, at, size }| {
        if at.length() > 20.0 * size {
            return None;
        }
        let t = match random.within(0.0, 4.0) as u32 {
            0 => Transform::translate(random.cube().as_dvec3() * 3.0),
            1 => Transform::scale(DVec3::splat(2.0)).unwrap(),
            2 => Transform::rotate(DVec3::Y, 30.0).unwrap(),
            _ => Transform::rotate(random.vector().as_dvec3(), 60.0).unwrap(),
        };
        if !shape.preserves_uv(&t) {
            return None;
        }
        let there = shape.transformed(&t)?;
        let ray_there =
            Ray::new(t.point(ray.origin.as_dvec3()).as_vec3(), t.vector(ray.direction.as_dvec3()).as_vec3());
        let (a, b) = (shape.intersect(&ray, INF)?, there.intersect(&ray_there, INF)?);
        if (a.t - b.t).abs() > 1e-4 * a.t || a.part != b.part {
            return None;
        }
        let (a, b) = (shape.surface(&ray, &a).uv, there.surface(&ray_there, &b).uv);
        let far = (a - b).abs().max_element();
        let seam = a.min(b).min_element() < 0.01 && a.max(b).max_element() > 0.99;
        assert!(far < 1e-2 * a.abs().max_element().max(1.0) || seam, "{shape:?} {t:?}: {a} {b}");
        Some(())
    });
}

#[test]
fn rays_without_direction_or_with_nan_meet_nothing() {
    each(14, 50, ALL, |_, Case { shape, ray, .. }| {
        assert_eq!(shape.intersect(&Ray::new(ray.origin, Vec3::ZERO), INF), None, "{shape:?}");
        assert_eq!(shape.intersect(&Ray::new(ray.origin, Vec3::NAN), INF), None, "{shape:?}");
        assert_eq!(shape.intersect(&Ray::new(Vec3::NAN, ray.direction), INF), None, "{shape:?}");
        Some(())
    });
}

fn vector<'a>(field: &'static str, vector: &'a mut Vec3) -> (&'static str, &'a mut [f32]) {
    (field, vector.as_mut())
}

fn number<'a>(field: &'static str, number: &'a mut f32) -> (&'static str, &'a mut [f32]) {
    (field, std::slice::from_mut(number))
}

#[test]
fn every_number_of_every_shape_is_checked() {
    // Each number of a valid shape in turn becomes NaN.
    each(15, 20, ALL, |_, Case { shape, .. }| {
        assert_eq!(shape.check(), Ok(()));
        for i in 0.. {
            let mut broken = shape;
            let fields: Vec<(&str, &mut [f32])> = match &mut broken {
                Shape::Sphere(s) => vec![vector("center", &mut s.center), number("radius", &mut s.radius)],
                Shape::Box(s) => vec![vector("min", &mut s.min), vector("max", &mut s.max)],
                Shape::Triangle(s) => vec![vector("a", &mut s.a), vector("b", &mut s.b), vector("c", &mut s.c)],
                Shape::Plane(s) => vec![vector("point", &mut s.point), vector("normal", &mut s.normal)],
                Shape::Disk(s) => vec![
                    vector("center", &mut s.center),
                    vector("normal", &mut s.normal),
                    number("radius", &mut s.radius),
                ],
                Shape::Cylinder(s) => {
                    vec![vector("base", &mut s.base), vector("top", &mut s.top), number("radius", &mut s.radius)]
                }
                Shape::Cone(s) => vec![
                    vector("base", &mut s.base),
                    vector("top", &mut s.top),
                    number("radius", &mut s.radius),
                    number("top-radius", &mut s.top_radius),
                ],
                Shape::Rectangle(s) => {
                    vec![vector("corner", &mut s.corner), vector("u", &mut s.u), vector("v", &mut s.v)]
                }
                Shape::Partial(s) => vec![number("start-angle", &mut s.start), number("angle", &mut s.angle)],
                Shape::Torus(s) => vec![
                    vector("center", &mut s.center),
                    vector("axis", &mut s.axis),
                    number("radius", &mut s.radius),
                    number("tube", &mut s.tube),
                ],
            };
            let mut numbers =
                fields.into_iter().flat_map(|(field, all)| all.iter_mut().map(move |number| (field, number)));
            let Some((field, number)) = numbers.nth(i) else { break };
            *number = f32::NAN;
            assert_eq!(broken.check().unwrap_err().field, Some(field), "{broken:?}");
        }
        Some(())
    });
}
