//! Compares surface differentials with differences of surfaces at neighbouring rays, on every shape.

use super::super::testing::*;
use super::super::*;
use glam::{DAffine3, DMat3, DVec2, Vec2, Vec3};

/// Compares the changes of point, normal and texture coordinates between two neighbouring rays.
fn compare(name: &str, from: &Surface, to: &Surface, surface_differential: &SurfaceDifferential, size: f64) -> bool {
    let step = to.exact - from.exact;
    let turned = to.shading_normal - from.shading_normal;
    let uv = to.uv.as_dvec2() - from.uv.as_dvec2();
    // The rays hit different faces, or different sides of the seam where u jumps.
    if turned.length() > 0.05 || uv.abs().max_element() > 0.05 {
        return false;
    }
    let small = step.length() / size;
    let expected = surface_differential.shape_operator * step;
    assert!(
        (turned - expected).length() <= 0.02 * expected.length().max(turned.length()) + 1e-7 + 1e-3 * small,
        "{name}: the normal changed by {turned}, not {expected}, over {step}"
    );
    let expected = surface_differential.uv(step);
    assert!(
        (uv - expected).length() <= 0.02 * expected.length().max(uv.length()) + 3e-7 + 1e-3 * small,
        "{name}: uv changed by {uv}, not {expected}, over {step}"
    );
    true
}

#[test]
fn patches_are_the_differences_of_neighbouring_rays() {
    let mut random = Random(31);
    let mut compared = std::collections::HashMap::new();
    for _ in 0..1500 {
        let at = random.cube() * 2.0;
        for shape in shapes(&mut random, at, 1.0) {
            let ray = ray_near(&mut random, at, 1.0);
            let neighbour = Ray::new(ray.origin, ray.direction + random.vector() * 3e-4);
            let (Some(hit), Some(near)) = (shape.intersect(&ray, 1e6), shape.intersect(&neighbour, 1e6)) else {
                continue;
            };
            let (from, to) = (shape.surface(&ray, &hit), shape.surface(&neighbour, &near));
            let step = to.exact - from.exact;
            // Near poles, apexes and the horizon two rays are too far apart for first order.
            let surface_differential = shape.surface_differential(&from, &hit);
            let curved = surface_differential.gradients.iter().map(|g| g.length()).fold(0.0, f64::max);
            if hit.part != near.part || step.length() > 3e-3 || curved * step.length() > 0.01 {
                continue;
            }
            let slope = (surface_differential.shape_operator * step).length();
            if slope < 0.01 && compare(shape.kind(), &from, &to, &surface_differential, 1.0) {
                *compared.entry(shape.kind()).or_insert(0) += 1;
            }
        }
    }
    assert_eq!(compared.len(), 9, "{compared:?}");
    assert!(compared.values().all(|n| *n > 40), "{compared:?}");
}

#[test]
fn transformed_patches_are_those_of_the_transformed_surface() {
    let mut random = Random(32);
    let mut compared = 0;
    for _ in 0..400 {
        let m = DMat3::from_cols(random.vector().as_dvec3(), random.vector().as_dvec3(), random.vector().as_dvec3());
        if m.determinant().abs() < 0.1 {
            continue;
        }
        let t = Transform::new(DAffine3::from_mat3_translation(m, random.vector().as_dvec3())).unwrap();
        for shape in shapes(&mut random, Vec3::ZERO, 1.0) {
            let ray = ray_near(&mut random, Vec3::ZERO, 1.0);
            let neighbour = Ray::new(ray.origin, ray.direction + random.vector() * 3e-4);
            let (Some(hit), Some(near)) = (shape.intersect(&ray, 1e6), shape.intersect(&neighbour, 1e6)) else {
                continue;
            };
            let (from, to) = (shape.surface(&ray, &hit), shape.surface(&neighbour, &near));
            let local = shape.surface_differential(&from, &hit);
            let step = to.exact - from.exact;
            let curved = local.gradients.iter().map(|g| g.length()).fold(0.0, f64::max);
            if hit.part != near.part || step.length() > 3e-3 || curved * step.length() > 0.01 {
                continue;
            }
            let surface_differential = local.transformed(&t, &from);
            if (local.shape_operator * step).length() < 0.01 {
                compared += usize::from(compare(
                    shape.kind(),
                    &from.transformed(&t),
                    &to.transformed(&t),
                    &surface_differential,
                    1.0,
                ));
            }
        }
    }
    assert!(compared > 300, "{compared}");
}

#[test]
fn a_smooth_meshs_patch_is_its_interpolation() {
    let mut random = Random(33);
    let unit = |v: Vec3| v.normalize();
    for _ in 0..200 {
        let n = unit(random.vector());
        let mesh = Mesh {
            positions: vec![random.cube(), random.cube(), random.cube()],
            uvs: [(); 3].map(|()| Vec2::new(random.unit(), random.unit())).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let corners = mesh.corners(0).map(Vec3::as_dvec3);
        let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if flat.length() < 0.1 {
            continue;
        }
        let flat = flat.normalize().as_vec3();
        let normals = [(); 3].map(|()| unit(flat + random.cube() * 0.3)).to_vec();
        let mesh = Mesh { normals, ..mesh };
        let (u, v) = (random.within(0.1, 0.4), random.within(0.1, 0.4));
        let (from, surface_differential) = (mesh.surface(0, u, v), mesh.surface_differential(0, u, v, 0.0));
        for (du, dv) in [(0.002, 0.0), (0.0, 0.002), (-0.001, 0.002)] {
            assert!(compare("mesh", &from, &mesh.surface(0, u + du, v + dv), &surface_differential, 1.0), "{n}");
        }
    }
}

#[test]
fn tangents_follow_the_coordinates() {
    let mut random = Random(34);
    for _ in 0..300 {
        for shape in shapes(&mut random, Vec3::ZERO, 1.0) {
            let ray = ray_near(&mut random, Vec3::ZERO, 1.0);
            let Some(hit) = shape.intersect(&ray, 1e6) else { continue };
            let surface = shape.surface(&ray, &hit);
            let surface_differential = shape.surface_differential(&surface, &hit);
            let [du, dv] = surface_differential.tangents(surface.normal);
            if du.length() < 1e-3 {
                continue;
            }
            assert!(
                (surface_differential.uv(du) - DVec2::X).length() < 1e-6,
                "{shape:?}: {}",
                surface_differential.uv(du)
            );
            assert!(
                (surface_differential.uv(dv) - DVec2::Y).length() < 1e-6,
                "{shape:?}: {}",
                surface_differential.uv(dv)
            );
            assert!(du.dot(surface.normal).abs() < 1e-6 * du.length());
        }
    }
}
