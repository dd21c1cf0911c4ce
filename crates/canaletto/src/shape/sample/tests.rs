use super::super::testing::{Random, distance, shapes};
use super::super::{Plane, Tessellation};
use super::*;
use canaletto_bvh::{Aabb, Ray};

const NOWHERE: Aabb = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };

/// Shapes with an area, spindle tori among them.
fn gallery(seed: u64) -> Vec<Shape> {
    let mut random = Random(seed);
    let mut all = shapes(&mut random, Vec3::new(0.3, -0.2, 0.1), 1.0);
    all.retain(|shape| !matches!(shape, Shape::Plane(_)));
    for (radius, tube) in [(0.5, 0.7), (0.5, 0.5), (0.5, 0.2)] {
        all.push(Shape::Torus(Torus { center: Vec3::Y, axis: random.vector(), radius, tube }));
    }
    all
}

fn fine(shape: &Shape) -> Tessellation {
    shape.tessellate(2e-5, &NOWHERE, 1 << 22).unwrap()
}

fn uniform(random: &mut Random) -> [f64; 2] {
    [random.unit().into(), random.unit().into()]
}

#[test]
fn areas_are_those_of_the_formulas() {
    let area = |shape: Shape| shape.area().unwrap();
    let (base, top) = (Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0));
    for (shape, expected) in [
        (Shape::Sphere(Sphere { center: Vec3::ONE, radius: 2.0 }), 16.0 * PI),
        (Shape::Box(Cuboid { min: Vec3::ZERO, max: Vec3::new(1.0, 2.0, 3.0) }), 22.0),
        (Shape::Triangle(Triangle { a: Vec3::ZERO, b: Vec3::X * 3.0, c: Vec3::Z * 2.0, one_sided: true }), 3.0),
        (Shape::Disk(Disk { center: Vec3::ONE, normal: Vec3::ONE, radius: 3.0 }), 9.0 * PI),
        (Shape::Cylinder(Cylinder { base, top, radius: 2.0, caps: false }), 16.0 * PI),
        (Shape::Cylinder(Cylinder { base, top, radius: 2.0, caps: true }), 24.0 * PI),
        (Shape::Cone(Cone { base, top, radius: 3.0, top_radius: 0.0, caps: false }), 15.0 * PI),
        (Shape::Cone(Cone { base, top, radius: 6.0, top_radius: 3.0, caps: true }), (45.0 + 36.0 + 9.0) * PI),
        (Shape::Torus(Torus { center: base, axis: top, radius: 3.0, tube: 1.0 }), 12.0 * PI * PI),
    ] {
        assert!((area(shape) / expected - 1.0).abs() < 1e-6, "{shape:?}: {} instead of {expected}", area(shape));
    }
    assert_eq!(Shape::Plane(Plane { point: base, normal: top }).area(), None);
}

#[test]
fn areas_are_those_of_the_tessellation() {
    for seed in [1, 2, 3] {
        for shape in gallery(seed) {
            let (area, triangles) = (shape.area().unwrap(), fine(&shape).area());
            assert!((triangles / area - 1.0).abs() < 1e-3, "{shape:?}: {area}, triangles {triangles}");
        }
    }
    let parallelogram = Parallelogram { corner: Vec3::ONE, u: Vec3::X * 2.0, v: Vec3::new(1.0, 3.0, 0.0) };
    assert!((parallelogram.sampler().area() - 6.0).abs() < 1e-12);
}

#[test]
fn samples_lie_on_the_surface_with_its_normal() {
    let mut random = Random(4);
    for shape in gallery(5) {
        let sampler = shape.sampler().unwrap();
        let [min, max] = sampler.bounds();
        for _ in 0..2000 {
            let SurfaceSample { point, normal, pdf } = sampler.sample(uniform(&mut random));
            assert_eq!(pdf, 1.0 / sampler.area());
            assert!(distance(&shape, point).abs() < 1e-6, "{shape:?}: {point} is off the surface");
            assert!((normal.length() - 1.0).abs() < 1e-6, "{shape:?}: {normal}");
            assert!((point - min).min_element() > -1e-6 && (max - point).min_element() > -1e-6, "{shape:?}: {point}");
            let lifted = distance(&shape, point + normal * 1e-3);
            assert!((lifted.abs() - 1e-3).abs() < 1e-4, "{shape:?}: {normal} at {point} leads {lifted} away");
            assert!(!shape.is_closed() || lifted > 0.0, "{shape:?}: {normal} at {point} leads inwards");
        }
    }
}

/// Compares the numbers of samples in cells of space with the areas of the tessellation there, by χ².
#[test]
fn samples_are_uniform() {
    let (side, n) = (6, 60_000);
    let mut random = Random(6);
    for shape in gallery(7) {
        let sampler = shape.sampler().unwrap();
        let [min, max] = sampler.bounds();
        let cell = |p: DVec3| {
            // The grid is turned a little, so that no face of a box lies in a wall between cells.
            let p = (p - min + 0.0137) / (max - min + 0.05) * f64::from(side);
            let at = p.to_array().map(|v| (v as i32).clamp(0, side - 1));
            ((at[0] * side + at[1]) * side + at[2]) as usize
        };
        let mut expected = vec![0.0; (side * side * side) as usize];
        let t = shape.tessellate(2e-4, &NOWHERE, 1 << 22).unwrap();
        for corners in &t.triangles {
            let [a, b, c] = corners.map(|v| t.vertices[v as usize].point);
            let cross = (b - a).cross(c - a).length();
            // Enough parts that few of them cross a wall.
            let parts = ((b - a).length().max((c - a).length()).max((c - b).length()) / 0.01).ceil().min(400.0) as u32;
            for (i, j) in (0..parts).flat_map(|i| (0..parts).map(move |j| (i, j))) {
                let [u, v] = [i, j].map(|k| (f64::from(k) + 1.0 / 3.0) / f64::from(parts));
                let (u, v) = if u + v < 1.0 { (u, v) } else { (1.0 - u, 1.0 - v) };
                expected[cell(a + (b - a) * u + (c - a) * v)] += 0.5 * cross / f64::from(parts * parts);
            }
        }
        let total: f64 = expected.iter().sum();
        let mut counts = vec![0.0; expected.len()];
        (0..n).for_each(|_| counts[cell(sampler.sample(uniform(&mut random)).point)] += 1.0);
        let (mut chi2, mut cells) = (0.0f64, 0.0f64);
        for (count, area) in counts.iter().zip(&expected) {
            let expected = area / total * f64::from(n);
            if expected > 20.0 {
                (chi2, cells) = (chi2 + (count - expected) * (count - expected) / expected, cells + 1.0);
            }
        }
        assert!(
            cells >= 4.0 && chi2 < 1.3 * cells + 6.0 * (2.0 * cells).sqrt(),
            "{shape:?}: χ² {chi2} of {cells} cells"
        );
    }
}

/// Every hit of a ray, the nearest first.
fn hits(shape: &Shape, origin: Vec3, direction: Vec3) -> Vec<(DVec3, DVec3)> {
    let (mut found, mut from) = (Vec::new(), 0.0);
    while let Some(hit) = shape.intersect(&Ray::new(origin + direction * from, direction), f32::INFINITY) {
        let surface = shape.surface(&Ray::new(origin + direction * from, direction), &hit);
        found.push((surface.exact, surface.normal));
        from += hit.t + 1e-4;
    }
    found
}

/// The integral of the solid-angle density over all directions, with all points along each, is 1. The mean of 1/pdf
/// over the samples that nothing hides is the solid angle.
#[test]
fn densities_of_area_and_solid_angle_agree() {
    let mut random = Random(8);
    for (i, shape) in gallery(9).into_iter().enumerate() {
        let sampler = shape.sampler().unwrap();
        let center = shape.bounds().map(|b| (b.min + b.max) * 0.5).unwrap();
        let size = shape.bounds().map(|b| (b.max - b.min).length()).unwrap();
        let p = center + random.vector().normalize() * size * if i % 3 == 0 { 0.8 } else { 2.0 };
        // Directions of a cone around the shape, in cells of equal solid angle.
        let axis = (center - p).as_dvec3().normalize();
        let (x, y) = axis.any_orthonormal_pair();
        let versine = if i % 3 == 0 { 2.0 } else { 0.04 };
        let (rows, columns) = (700, 700);
        let (mut integral, mut solid_angle) = (0.0, 0.0);
        let part = TAU * versine / f64::from(rows * columns);
        for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
            let cos = 1.0 - versine * (f64::from(row) + 0.5) / f64::from(rows);
            let (s, c) = (TAU * (f64::from(column) + 0.5) / f64::from(columns)).sin_cos();
            let wi = axis * cos + (x * c + y * s) * (1.0 - cos * cos).sqrt();
            let found = hits(&shape, p, wi.as_vec3());
            solid_angle += if found.is_empty() { 0.0 } else { part };
            let density = found.iter().map(|(point, normal)| sampler.pdf_from(p.as_dvec3(), *point, *normal));
            integral += part * density.map(|d| d.min(1e6)).sum::<f64>();
        }
        assert!((integral - 1.0).abs() < 0.04, "{shape:?} from {p}: {integral}");
        let n = 40_000;
        let mut mean = 0.0;
        for _ in 0..n {
            let Some(sample) = sampler.sample_from(p.as_dvec3(), uniform(&mut random)) else { continue };
            let to = sample.point - p.as_dvec3();
            let first = hits(&shape, p, to.normalize().as_vec3());
            let is_first = first.first().is_some_and(|(q, _)| q.distance(sample.point) < 1e-3);
            mean += if is_first { 1.0 / sample.pdf / f64::from(n) } else { 0.0 };
        }
        assert!((mean / solid_angle - 1.0).abs() < 0.03, "{shape:?} from {p}: {mean} instead of {solid_angle}");
    }
}

#[test]
fn a_sphere_is_sampled_where_it_is_seen() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(0.0, 0.0, 5.0), radius: 2.0 }).sampler().unwrap();
    let mut random = Random(10);
    for _ in 0..1000 {
        let sample = sphere.sample_from(DVec3::ZERO, uniform(&mut random)).unwrap();
        assert!(sample.normal.dot(sample.point) <= 1e-9, "{sample:?} is on the averted side");
        let expected = 1.0 / (TAU * (1.0 - (1.0f64 - 0.16).sqrt()));
        assert!((sample.pdf / expected - 1.0).abs() < 1e-9);
    }
    assert_eq!(sphere.pdf_from(DVec3::ZERO, DVec3::Z * 7.0, DVec3::Z), 0.0);
    // From inside, points are uniform over the area.
    let inside = sphere.sample_from(DVec3::Z * 5.0, uniform(&mut random)).unwrap();
    assert!((inside.pdf - 1.0 / (4.0 * PI)).abs() < 1e-9, "{inside:?}");
}
