use super::super::testing::{Random, distance, shapes};
use super::*;
use crate::math::Transform;

const LIMIT: usize = 1 << 20;
const CLIP: Aabb = Aabb { min: Vec3::new(-3.0, -2.0, -1.0), max: Vec3::new(2.0, 3.0, 4.0) };

/// A spindle torus and a torus whose hole is a point, besides the random shapes.
fn gallery(seed: u64) -> Vec<Shape> {
    let mut random = Random(seed);
    let mut all = shapes(&mut random, Vec3::new(0.3, -0.2, 0.1), 1.0);
    for (radius, tube) in [(0.5, 0.7), (0.5, 0.5), (0.5, 0.2)] {
        all.push(Shape::Torus(Torus { center: Vec3::Y, axis: random.vector(), radius, tube }));
    }
    all
}

/// The point of a triangle where its corners have these weights.
fn blend(t: &Tessellation, corners: &[u32; 3], weights: [f64; 3]) -> DVec3 {
    corners.iter().zip(weights).map(|(v, w)| t.vertices[*v as usize].point * w).sum()
}

#[test]
fn triangles_stay_within_the_tolerance() {
    for (seed, tolerance) in [(1, 0.3), (2, 0.03), (3, 1e-3), (4, 1e-4)] {
        for shape in gallery(seed) {
            let t = shape.tessellate(tolerance, &CLIP, LIMIT).unwrap();
            let step = t.triangles.len().div_ceil(2000);
            let (mut farthest, n) = (0.0f64, 8);
            for corners in t.triangles.iter().step_by(step) {
                for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
                    let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(n));
                    farthest = farthest.max(distance(&shape, blend(&t, corners, [1.0 - u - v, u, v])).abs());
                }
            }
            assert!(farthest <= tolerance * (1.0 + 1e-9), "{shape:?}: {farthest} is more than {tolerance}");
            // Triangles aren't much smaller than needed.
            let flat = matches!(shape, Shape::Disk(_)) || matches!(shape, Shape::Partial(partial) if partial.is_flat());
            let curved = !shape.is_polygonal() && !flat;
            assert!(!curved || tolerance > 0.01 || farthest > 0.2 * tolerance, "{shape:?}: only {farthest}");
        }
    }
}

/// Whether a point lies near a pole of a spindle torus, where a ray may meet the opposite side.
fn near_pole(shape: &Shape, p: DVec3) -> bool {
    let Shape::Torus(torus) = shape else { return false };
    let axis = torus.axis.as_dvec3().normalize();
    torus.tube >= torus.radius && (p - torus.center.as_dvec3()).reject_from_normalized(axis).length() < 0.15
}

#[test]
fn vertices_are_points_of_the_surface_with_its_normal_and_uv() {
    for shape in gallery(5) {
        let t = shape.tessellate(0.01, &CLIP, LIMIT).unwrap();
        assert!(!t.triangles.is_empty() && t.parts.len() == t.triangles.len());
        let mut met = 0;
        for (corners, part) in t.triangles.iter().zip(&t.parts) {
            // A ray from outside to a point near each corner, within the triangle.
            for k in 0..3 {
                let mut weights = [0.005; 3];
                weights[k] = 0.99;
                let [vertex, next, last] = [0, 1, 2].map(|i| t.vertices[corners[(k + i) % 3] as usize]);
                if near_pole(&shape, vertex.point) {
                    continue;
                }
                let cross = (next.point - vertex.point).cross(last.point - vertex.point);
                assert!(cross.dot(vertex.normal) > 0.0, "{shape:?} is inside out at {vertex:?}");
                assert!(distance(&shape, vertex.point).abs() < 1e-6, "{shape:?}: {vertex:?}");
                let p = blend(&t, corners, weights);
                let line = canaletto_bvh::Ray::new((p + vertex.normal * 0.05).as_vec3(), -vertex.normal.as_vec3());
                let Some(hit) = shape.intersect(&line, 0.1) else { continue };
                // Next to an edge the ray may meet another part first.
                if hit.part != *part {
                    continue;
                }
                met += 1;
                let surface = shape.surface(&line, &hit);
                // Weights of the uv, not of the vertex alone, since a pole's u differs from that of its neighbours.
                let uv: DVec2 = corners.iter().zip(weights).map(|(v, w)| t.vertices[*v as usize].uv * w).sum();
                let pole = match shape {
                    Shape::Sphere(_) => vertex.normal.y.abs() > 0.9,
                    Shape::Torus(torus) => torus.tube >= torus.radius,
                    Shape::Cone(_) => true,
                    Shape::Partial(partial) => !partial.is_flat(),
                    _ => false,
                };
                let least = if pole { 0.8 } else { 0.99 };
                assert!(surface.normal.dot(vertex.normal) > least, "{shape:?}: {vertex:?} {surface:?}");
                assert!(pole || (uv - surface.uv.as_dvec2()).length() < 0.02, "{shape:?}: {uv} {surface:?}");
            }
        }
        assert!(met > t.triangles.len(), "{shape:?}: only {met} corners were compared");
    }
}

#[test]
fn closed_shapes_are_watertight() {
    for (seed, tolerance) in [(6, 10.0), (7, 0.1), (8, 1e-3)] {
        for shape in gallery(seed) {
            let t = shape.tessellate(tolerance, &CLIP, LIMIT).unwrap();
            let places = t.places();
            let mut edges: HashMap<(u32, u32), [u32; 2]> = HashMap::new();
            for corners in &t.triangles {
                let [a, b, c] = corners.map(|v| places[v as usize]);
                assert!(a != b && b != c && c != a, "{shape:?} has a triangle without area");
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    edges.entry((from.min(to), from.max(to))).or_default()[usize::from(from > to)] += 1;
                }
            }
            if shape.is_closed() {
                assert!(edges.values().all(|uses| *uses == [1, 1]), "{shape:?} has a crack");
            } else {
                assert!(
                    edges.values().all(|uses| uses[0] <= 1 && uses[1] <= 1),
                    "{shape:?} has an edge of three triangles"
                );
            }
        }
    }
}

#[test]
fn counts_grow_as_the_tolerance_demands() {
    for shape in gallery(9) {
        let count = |tolerance: f64| shape.tessellate(tolerance, &CLIP, LIMIT).unwrap().triangles.len() as f64;
        // Each direction of curvature doubles where the tolerance is a quarter.
        let growth = count(1e-3) / count(4e-3);
        let expected = match shape {
            Shape::Sphere(_) | Shape::Torus(_) => 4.0,
            Shape::Cylinder(_) | Shape::Cone(_) | Shape::Disk(_) | Shape::Partial(_) => 2.0,
            Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) => 1.0,
        };
        assert!((growth / expected - 1.0).abs() < 0.15, "{shape:?}: {growth} instead of {expected}");
    }
}

#[test]
fn a_plane_is_cut_to_the_box() {
    let cube = Aabb { min: Vec3::splat(-1.0), max: Vec3::ONE };
    let area = |point: Vec3, normal: Vec3| {
        let plane = Shape::Plane(Plane { point, normal });
        let t = plane.tessellate(1.0, &cube, LIMIT).unwrap();
        assert!(t.vertices.iter().all(|v| v.point.abs().max_element() < 1.0 + 1e-9), "{t:?}");
        (t.area(), t.vertices.len())
    };
    let (square, corners) = area(Vec3::new(5.0, 0.25, -7.0), Vec3::Y * 3.0);
    assert!((square - 4.0).abs() < 1e-12 && corners == 4, "{square} {corners}");
    // The section through the middle, perpendicular to a diagonal, is a regular hexagon of side √2.
    let (hexagon, corners) = area(Vec3::ZERO, Vec3::ONE);
    assert!((hexagon - 3.0 * 3f64.sqrt()).abs() < 1e-9 && corners == 6, "{hexagon} {corners}");
    let (triangle, corners) = area(Vec3::new(1.0, 1.0, 0.5), Vec3::ONE);
    assert!((triangle - 3f64.sqrt() / 8.0).abs() < 1e-9 && corners == 3, "{triangle} {corners}");
    assert_eq!(area(Vec3::splat(1.5), Vec3::ONE), (0.0, 0));
}

#[test]
fn the_limit_is_kept_before_memory_is_filled() {
    for shape in gallery(10) {
        let exact = shape.tessellate(1e-3, &CLIP, LIMIT).unwrap().triangles.len();
        assert_eq!(shape.tessellate(1e-3, &CLIP, exact).unwrap().triangles.len(), exact);
        assert_eq!(shape.tessellate(1e-3, &CLIP, exact - 1).unwrap_err(), TooManyTriangles { limit: exact - 1 });
        let curved = !shape.is_polygonal();
        for tolerance in [1e-30, 0.0, -1.0, f64::NAN] {
            assert_eq!(shape.tessellate(tolerance, &CLIP, LIMIT).is_err(), curved, "{shape:?} {tolerance}");
        }
    }
}

/// An instance's triangles keep a tolerance of the world.
#[test]
fn a_stretched_sphere_keeps_the_tolerance_of_the_world() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
    let to_world = Transform::scale(DVec3::new(4.0, 1.0, 0.5)).unwrap();
    let tolerance = 0.01;
    let t = sphere.tessellate(tolerance / to_world.max_stretch(), &CLIP, LIMIT).unwrap();
    let mut farthest = 0.0f64;
    for corners in &t.triangles {
        let p = blend(&t, corners, [1.0 / 3.0; 3]);
        // The point of the sphere above is a point of the ellipsoid at most this far away.
        farthest = farthest.max(to_world.point(p).distance(to_world.point(p.normalize())));
    }
    assert!(farthest <= tolerance && farthest > 0.1 * tolerance, "{farthest}");
}
