//! Closed surfaces have no leaks. No ray from inside escapes through an edge or a vertex, at any scale, even after
//! reflections inside. `CANALETTO_RAYS=10000000 cargo test --profile tests -p canaletto-tests watertight::` is the long
//! form.

use canaletto::Ray;
use canaletto::material::reflect;
use canaletto::math::{Transform, offset_origin};
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::{Cone, Cuboid, Cylinder, Mesh, Shape, Sphere, Torus};
use canaletto::world::World;
use canaletto_tests::gallery::icosphere;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The number of rays for each property.
fn rays() -> u64 {
    std::env::var("CANALETTO_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(400_000)
}

/// A number in [-1, 1) that depends only on the arguments.
fn number(i: u64, k: u64) -> f32 {
    let mut x = i.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(k.wrapping_mul(0xd1b5_4a32_d192_ed03));
    x = (x ^ (x >> 31)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x >> 40) as f32) / 8_388_608.0 - 1.0
}

fn vector(i: u64, k: u64) -> Vec3 {
    Vec3::new(number(i, k), number(i, k + 1), number(i, k + 2))
}

const SCALES: [f32; 6] = [1e-6, 1e-3, 1.0, 7.3, 1e5, 1e9];

/// A closed mesh with needles: an icosphere squeezed to a thin lens and stretched.
fn lens() -> Mesh {
    let mut mesh = icosphere(3, 1.0, false);
    for p in &mut mesh.positions {
        *p *= Vec3::new(3.0, 0.02, 1.0);
    }
    mesh
}

/// A closed mesh that isn't convex: a tube bent to a ring.
fn ring() -> Mesh {
    let (around, across) = (48u32, 12u32);
    let point = |i: u32, j: u32| {
        let (a, b) =
            (i as f32 / around as f32 * std::f32::consts::TAU, j as f32 / across as f32 * std::f32::consts::TAU);
        let r = 1.0 + 0.35 * b.cos();
        Vec3::new(r * a.cos(), 0.35 * b.sin(), -r * a.sin())
    };
    let index = |i: u32, j: u32| (i % around) * across + j % across;
    Mesh {
        name: "ring".into(),
        positions: (0..around * across).map(|n| point(n / across, n % across)).collect(),
        triangles: (0..around)
            .flat_map(|i| (0..across).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect(),
        ..Mesh::default()
    }
}

fn world(mesh: Mesh, scale: f32, offset: Vec3, instanced: bool) -> World {
    let moved = Transform::translate((offset * scale).as_dvec3())
        .after(&Transform::scale(DVec3::splat(f64::from(scale))).unwrap());
    let mut nodes = vec![Node::new(Content::Mesh(0)).with_transform(&moved)];
    if instanced {
        // A second use keeps the mesh in its own space, so that rays are transformed.
        nodes.push(
            Node::new(Content::Mesh(0))
                .with_transform(&Transform::translate(DVec3::splat(f64::from(scale) * 100.0)).after(&moved)),
        );
    }
    World::build(Scene { meshes: vec![mesh], nodes, ..Scene::default() }).unwrap()
}

/// The number of rays that escape. They start inside and aim at vertices, at points of edges, and anywhere.
fn leaks(
    mesh: &Mesh,
    inside: impl Fn(u64) -> Vec3 + Sync,
    scale: f32,
    offset: Vec3,
    instanced: bool,
    count: u64,
) -> u64 {
    let world = world(mesh.clone(), scale, offset, instanced);
    let at = |p: Vec3| (p + offset) * scale;
    (0..count)
        .into_par_iter()
        .filter(|&i| {
            let [a, b, _] = mesh.corners((i as usize * 7919) % mesh.triangles.len());
            let origin = at(inside(i));
            let target = match i % 4 {
                0 => at(a),
                1 => at(a.lerp(b, number(i, 20) * 0.5 + 0.5)),
                2 => at(a.midpoint(b)),
                _ => origin + vector(i, 30) * scale,
            };
            let ray = Ray::new(origin, target - origin);
            world.intersect(&ray, f32::INFINITY).is_none()
        })
        .count() as u64
}

#[test]
fn closed_meshes_do_not_leak() {
    let offsets = [Vec3::ZERO, Vec3::new(3.0, -5.0, 11.0)];
    let cases = SCALES.len() * offsets.len() * 3 * 2;
    let count = rays() / cases as u64;
    for scale in SCALES {
        for offset in offsets {
            for instanced in [false, true] {
                let found = leaks(&icosphere(3, 1.0, false), |i| vector(i, 1) * 0.5, scale, offset, instanced, count);
                assert_eq!(found, 0, "icosphere at scale {scale}, offset {offset}, instanced {instanced}");
                let found =
                    leaks(&lens(), |i| vector(i, 1) * Vec3::new(1.5, 0.009, 0.5), scale, offset, instanced, count);
                assert_eq!(found, 0, "lens at scale {scale}, offset {offset}, instanced {instanced}");
                let core = |i: u64| {
                    let angle = number(i, 1) * std::f32::consts::PI;
                    Vec3::new(angle.cos(), 0.0, -angle.sin()) + vector(i, 2) * 0.15
                };
                let found = leaks(&ring(), core, scale, offset, instanced, count);
                assert_eq!(found, 0, "ring at scale {scale}, offset {offset}, instanced {instanced}");
            }
        }
    }
}

/// Light is trapped in a body. After every reflection inside, the next hit is from inside again. A ray that hit the
/// surface it just left would do so from outside or at distance zero.
#[test]
fn rays_that_bounce_inside_never_get_out() {
    let closed: Vec<(&str, Content)> = vec![
        ("sphere", Content::Shape(Shape::Sphere(Sphere { center: Vec3::new(0.3, -0.2, 0.1), radius: 1.0 }))),
        ("box", Content::Shape(Shape::Box(Cuboid { min: Vec3::new(-1.0, -0.6, -0.9), max: Vec3::new(0.9, 0.8, 1.3) }))),
        (
            "cylinder",
            Content::Shape(Shape::Cylinder(Cylinder {
                base: Vec3::new(-0.6, -1.0, 0.2),
                top: Vec3::new(0.7, 0.9, -0.1),
                radius: 0.8,
                caps: true,
            })),
        ),
        (
            "cone",
            Content::Shape(Shape::Cone(Cone {
                base: Vec3::new(0.1, -1.0, 0.0),
                top: Vec3::new(0.0, 1.4, 0.3),
                radius: 1.2,
                top_radius: 0.5,
                caps: true,
            })),
        ),
        (
            "torus",
            Content::Shape(Shape::Torus(Torus {
                center: Vec3::new(-1.0, 0.0, 0.0),
                axis: Vec3::new(0.2, 1.0, 0.1),
                radius: 1.0,
                tube: 0.4,
            })),
        ),
        ("mesh", Content::Mesh(0)),
        (
            "stretched sphere",
            Content::Group(vec![
                Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }))
                    .with_transform(&Transform::scale(DVec3::new(1.4, 0.5, 0.9)).unwrap())
                    .with_transform(&Transform::rotate(DVec3::new(1.0, 2.0, 0.3), 40.0).unwrap()),
            ]),
        ),
    ];
    let count = rays() / (closed.len() as u64 * SCALES.len() as u64 * 20);
    for (name, content) in &closed {
        for scale in SCALES {
            let node = Node::new(content.clone())
                .with_transform(&Transform::scale(DVec3::splat(f64::from(scale))).unwrap())
                .with_transform(&Transform::translate(DVec3::new(2.0, -1.0, 3.0) * f64::from(scale)));
            let scene = Scene { meshes: vec![icosphere(2, 1.0, false)], nodes: vec![node], ..Scene::default() };
            let world = World::build(scene).unwrap();
            let center = Vec3::new(2.0, -1.0, 3.0) * scale;
            let escaped: Vec<String> = (0..count)
                .into_par_iter()
                .filter_map(|i| {
                    let mut ray = Ray::new(center + vector(i, 1) * 0.05 * scale, vector(i, 5).normalize_or(Vec3::X));
                    for bounce in 0..20 {
                        let Some(hit) = world.intersect(&ray, f32::INFINITY) else {
                            return Some(format!("ray {i} is out after {bounce} bounces: {ray:?}"));
                        };
                        let surface = world.surface(&ray, &hit);
                        if ray.direction.as_dvec3().dot(surface.normal) <= -1e-3 {
                            return Some(format!(
                                "ray {i} meets the outside after {bounce} bounces: {ray:?} {surface:?}"
                            ));
                        }
                        let direction = reflect(-ray.direction.as_dvec3(), surface.normal).normalize();
                        let origin = offset_origin(surface.point, surface.error, surface.normal, -surface.normal);
                        ray = Ray::new(origin, direction.as_vec3());
                    }
                    None
                })
                .collect();
            assert!(
                escaped.is_empty(),
                "{name} at scale {scale}: {} of {count} rays, such as\n{}",
                escaped.len(),
                escaped[0]
            );
        }
    }
}
