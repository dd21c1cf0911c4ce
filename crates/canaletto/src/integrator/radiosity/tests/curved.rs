//! Radiosity on curved surfaces against closed forms. Between any two places inside a ball of radius R the form factor
//! is A / 4πR², whatever their distance.

use super::super::*;
use crate::light::{Light as SceneLight, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::math::{Rgb, Transform};
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cone, Cylinder, Disk, Mesh, Plane, Shape, Sphere, Torus};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn matte(kd: f32, emission: f32) -> Material {
    let phong = Phong { kd: Rgb::gray(kd), emission: Rgb::gray(emission), ..Phong::default() };
    Material::new("matte", phong)
}

fn glowing(kd: f32, emission: f32) -> Material {
    matte(kd, emission).with_two_sided(true)
}

fn ball(center: Vec3, radius: f32) -> Shape {
    Shape::Sphere(Sphere { center, radius })
}

/// The outline of a shape's triangles as a mesh, for those triangles whose middles pass.
fn mesh_of(shape: &Shape, tolerance: f64, keeps: impl Fn(DVec3) -> bool) -> Mesh {
    let tessellation = shape.tessellate(tolerance, &canaletto_bvh::Aabb::EMPTY, 1 << 20).unwrap();
    let point = |v: u32| tessellation.vertices[v as usize].point;
    let middle = |&[a, b, c]: &[u32; 3]| (point(a) + point(b) + point(c)) / 3.0;
    let places = tessellation.places();
    let mut positions = vec![Vec3::ZERO; tessellation.vertices.len()];
    places.iter().zip(&tessellation.vertices).for_each(|(&place, v)| positions[place as usize] = v.point.as_vec3());
    let corners = |t: &[u32; 3]| t.map(|v| places[v as usize]);
    let triangles = tessellation.triangles.iter().filter(|t| keeps(middle(t))).map(corners).collect();
    Mesh { name: "mesh".into(), positions, triangles, ..Mesh::default() }
}

fn solved(scene: Scene, error: f32) -> RadiositySolution {
    let world = World::build(scene).unwrap();
    let settings = RadiositySettings { error, ..RadiositySettings::DEFAULT };
    RadiositySolution::solve(&world, &settings, &()).unwrap()
}

fn scene(materials: Vec<Material>, nodes: Vec<Node>) -> Scene {
    Scene { materials, nodes, ..Scene::default() }
}

/// The mean over the patches of an instance's side, the least and the largest value.
fn over_side(solution: &RadiositySolution, instance: u32, is_outer: bool, of: impl Fn(&Patch) -> f64) -> [f64; 3] {
    let (mut sum, mut area, mut least, mut most) = (0.0, 0.0, f64::INFINITY, 0.0f64);
    for patch in solution.patches().iter().filter(|p| p.instance == instance && p.is_outer == is_outer && p.area > 0.0)
    {
        let value = of(patch);
        (sum, area) = (sum + value * patch.area, area + patch.area);
        (least, most) = (least.min(value), most.max(value));
    }
    [sum / area, least, most]
}

/// A closed body of emission E and reflectance ρ has the radiance E / (1 − ρ) everywhere inside.
#[test]
fn hollow_bodies_glow_evenly() {
    let tube = Cylinder { base: Vec3::NEG_Y, top: Vec3::Y, radius: 0.5, caps: true };
    let cone = Cone { base: Vec3::NEG_Y, top: Vec3::Y, radius: 0.8, top_radius: 0.2, caps: true };
    let torus = Torus { center: Vec3::ZERO, axis: Vec3::Y, radius: 1.0, tube: 0.3 };
    let round = ball(Vec3::ZERO, 1.0);
    let stretched = Node::from(round).with_transform(&Transform::scale(DVec3::new(1.0, 3.0, 0.5)).unwrap());
    for (name, nodes, error, room) in [
        ("ball", vec![Node::from(round)], 0.1, 1e-3),
        ("ball", vec![Node::from(round)], 0.05, 1e-3),
        ("ball in a ball", vec![Node::from(round), ball(Vec3::new(0.2, 0.1, 0.0), 0.4).into()], 0.1, 1e-3),
        ("stretched ball", vec![stretched], 0.1, 0.05),
        ("tube", vec![Shape::Cylinder(tube).into()], 0.1, 0.05),
        ("cone", vec![Shape::Cone(cone).into()], 0.1, 0.05),
        ("torus", vec![Shape::Torus(torus).into()], 0.2, 0.05),
    ] {
        let nodes: Vec<Node> = nodes.into_iter().map(|node: Node| node.with_material(0)).collect();
        let bodies = nodes.len() as u32;
        let solution = solved(scene(vec![glowing(0.5, 1.0)], nodes), error);
        let sides = (0..bodies).map(|body| (body, false)).chain((1..bodies).map(|body| (body, true)));
        for (body, is_outer) in sides {
            let [mean, least, most] = over_side(&solution, body, is_outer, |patch| patch.radiance().x);
            let [low, high] = [2.0 * (1.0 - room), 2.0 * (1.0 + room)];
            assert!(least > low && most < high, "{name} {error}: {least} {mean} {most}");
        }
        let interpolated =
            |light: &ArrivingLight| light.sum().x == 0.0 || (light.sum().x / 2.0 - 1.0).abs() < 2.0 * room;
        let inner = solution.patches().iter().zip(&solution.interpolation.centers).filter(|(patch, _)| !patch.is_outer);
        assert!(inner.map(|(_, light)| light).all(interpolated), "{name} {error}");
    }
}

/// A ball of radius r and radiance E in a hollow ball of radius R: E times (r/R)² arrives at the wall on average, and
/// 1 − (r/R)² of what the wall reflects.
#[test]
fn a_round_room_has_the_light_of_its_lamp() {
    let share = 0.0225;
    let wall = 0.7 * 10.0 * share / (1.0 - 0.7 * (1.0 - share));
    for (center, error) in [(Vec3::ZERO, 0.1), (Vec3::ZERO, 0.05), (Vec3::new(0.9, 0.3, 0.2), 0.1)] {
        let materials = vec![matte(0.7, 0.0), matte(0.0, 10.0)];
        let nodes =
            vec![Node::from(ball(Vec3::ZERO, 2.0)).with_material(0), Node::from(ball(center, 0.3)).with_material(1)];
        let solution = solved(scene(materials, nodes), error);
        let error = f64::from(error);
        let [direct, ..] = over_side(&solution, 0, false, |patch| patch.from_emitters.x);
        assert!((direct / (10.0 * share) - 1.0).abs() < 0.5 * error, "{error}: {direct}");
        let [mean, least, most] = over_side(&solution, 0, false, |patch| patch.indirect.x);
        let expected = wall * (1.0 - share);
        assert!((mean / expected - 1.0).abs() < 0.5 * error, "{error}: {mean} instead of {expected}");
        // Errors are relative to the mean light.
        let room = error * (expected + 10.0 * share);
        assert!(least > expected - room && most < expected + room, "{error}: {least} {most}");
    }
}

/// A point light anywhere in a hollow ball: what the wall reflects arrives evenly. The mean of the direct light is
/// l / R², since the flux is 4π l (5.32 counts l as radiance).
#[test]
fn a_round_room_spreads_the_light_of_a_point_evenly() {
    let mut lamp = SceneLight::new(LightKind::Omni(Omni::at(Vec3::new(0.7, 0.0, 0.3))), Rgb::gray(1.0));
    lamp.attenuation = [0.0, 0.0, 1.0];
    let nodes = vec![Node::from(ball(Vec3::ZERO, 2.0)).with_material(0), Node::from(lamp)];
    let solution = solved(scene(vec![matte(0.6, 0.0)], nodes), 0.05);
    let [mean, least, most] = over_side(&solution, 0, false, |patch| patch.indirect.x);
    let expected = 0.6 * 0.25 / 0.4;
    assert!((mean / expected - 1.0).abs() < 0.03, "{mean} instead of {expected}");
    assert!(least > expected * 0.95 && most < expected * 1.05, "{least} {most}");
}

/// A bowl below a lamp that closes it: the lamp has the view of the half that is missing, so that half of its radiance
/// arrives everywhere.
#[test]
fn a_bowl_has_the_light_of_its_lid() {
    let bowl = mesh_of(&ball(Vec3::ZERO, 1.0), 0.02, |middle| middle.y < 0.0);
    let lid = Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::NEG_Y, radius: 1.0 });
    let nodes = vec![Node::new(Content::Mesh(0)).with_material(0), Node::from(lid).with_material(1)];
    let materials = vec![matte(0.6, 0.0), matte(0.0, 1.0)];
    let solution = solved(Scene { meshes: vec![bowl], ..scene(materials, nodes) }, 0.05);
    let expected = 0.5 / (1.0 - 0.3);
    let [mean, ..] = over_side(&solution, 0, false, |patch| patch.arriving().sum().x);
    assert!((mean / expected - 1.0).abs() < 0.03, "{mean} instead of {expected}");
    // The facets' rim is no circle, and patches next to it see past the lid's edge.
    let below = |patch: &Patch| if patch.center.y < -0.3 { patch.arriving().sum().x } else { expected };
    let [_, least, most] = over_side(&solution, 0, false, below);
    assert!(least > expected * 0.9 && most < expected * 1.1, "{least} {most}");
}

/// The radiance along the axis of an open tube of emission 1. From a ring at x to one at y of a tube of radius r the
/// form factor is (1 − X (2X² + 3) / 2 (X² + 1)^1.5) dX, where X = |x − y| / 2r (Buckley 1927).
fn open_tube(radius: f64, length: f64, reflectance: f64) -> f64 {
    const RINGS: usize = 400;
    let width = length / RINGS as f64;
    let kernel = |i: usize, j: usize| {
        let x = (i as f64 - j as f64).abs() * width / (2.0 * radius);
        let square = x * x + 1.0;
        (1.0 - x * (2.0 * x * x + 3.0) / (2.0 * square * square.sqrt())) * width / (2.0 * radius)
    };
    let mut radiance = vec![1.0; RINGS];
    for _ in 0..60 {
        let received = |i: usize| (0..RINGS).map(|j| kernel(i, j) * radiance[j]).sum::<f64>();
        radiance = (0..RINGS).map(|i| 1.0 + reflectance * received(i)).collect();
    }
    radiance.iter().sum::<f64>() / RINGS as f64
}

#[test]
fn an_open_tube_has_the_light_of_its_rings() {
    let expected = open_tube(0.5, 2.0, 0.8);
    for error in [0.1, 0.05] {
        let tube = Shape::Cylinder(Cylinder { base: Vec3::NEG_Y, top: Vec3::Y, radius: 0.5, caps: false });
        let solution = solved(scene(vec![glowing(0.8, 1.0)], vec![Node::from(tube).with_material(0)]), error);
        let [mean, ..] = over_side(&solution, 0, false, |patch| patch.radiance().x);
        assert!((mean / expected - 1.0).abs() < f64::from(error), "{error}: {mean} instead of {expected}");
        let [outer, ..] = over_side(&solution, 0, true, |patch| patch.radiance().x);
        assert_eq!(outer, 1.0);
    }
}

/// Below a disk of radius r at height h the light E r² / (r² + h²) arrives at a plane, however far the plane lies from
/// all bodies.
#[test]
fn a_plane_below_a_lamp_has_patches() {
    let lamp = |height: f32| Shape::Disk(Disk { center: Vec3::Y * height, normal: Vec3::NEG_Y, radius: 1.0 });
    let floor = Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y });
    for height in [2.0, 4.0, 40.0] {
        let nodes = vec![Node::from(lamp(height)).with_material(1), Node::from(floor).with_material(0)];
        let scene = scene(vec![matte(0.6, 0.0), matte(0.0, 5.0)], nodes);
        let world = World::build(scene).unwrap();
        let settings = RadiositySettings { error: 0.1, ..RadiositySettings::DEFAULT };
        let solution = RadiositySolution::solve(&world, &settings, &()).unwrap();
        let light = solution.light_at(crate::world::Hit::UNBOUNDED, 0, 0, true, DVec3::ZERO).unwrap().sum().x;
        let expected = 5.0 / (1.0 + f64::from(height * height));
        assert!((light / expected - 1.0).abs() < 0.1, "{height}: {light} instead of {expected}");
        assert_eq!(solution.warnings(&world, &settings), Vec::<String>::new());
    }
    let nodes = vec![
        Node::from(lamp(1000.0)).with_material(1),
        Node { name: Some("floor".into()), ..Node::from(floor).with_material(0) },
    ];
    let world = World::build(scene(vec![matte(0.6, 0.0), matte(0.0, 5.0)], nodes)).unwrap();
    let settings = RadiositySettings { error: 0.1, ..RadiositySettings::DEFAULT };
    let solution = RadiositySolution::solve(&world, &settings, &()).unwrap();
    let warnings = solution.warnings(&world, &settings);
    assert!(warnings.len() == 1 && warnings[0].contains("\"floor\""), "{warnings:?}");
}

/// The facets of a body have the area of the exact surface, so that lamps send their whole light.
#[test]
fn lamps_send_the_light_of_their_exact_area() {
    let tall = Transform::scale(DVec3::new(1.0, 3.0, 1.0)).unwrap();
    let tube = Cylinder { base: Vec3::ZERO, top: Vec3::Y, radius: 0.5, caps: false };
    let torus = Torus { center: Vec3::ZERO, axis: Vec3::Y, radius: 1.0, tube: 0.3 };
    let eccentricity = (8.0f64 / 9.0).sqrt();
    for (name, node, area) in [
        ("ball", Node::from(ball(Vec3::ONE, 1.0)), 4.0 * PI),
        (
            "stretched ball",
            Node::from(ball(Vec3::ZERO, 1.0)).with_transform(&tall),
            2.0 * PI * (1.0 + 3.0 / eccentricity * eccentricity.asin()),
        ),
        ("tube", Shape::Cylinder(tube).into(), PI),
        ("torus", Shape::Torus(torus).into(), 4.0 * PI * PI * 0.3),
        ("disk", Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 2.0 }).into(), 4.0 * PI),
    ] {
        // A large box around keeps the tolerance large.
        let room = Shape::Box(crate::shape::Cuboid { min: Vec3::splat(-9.0), max: Vec3::splat(9.0) });
        let nodes = vec![node.with_material(0), Node::from(room).with_material(1)];
        let world = World::build(scene(vec![matte(0.0, 1.0), matte(0.5, 0.0)], nodes)).unwrap();
        let settings = RadiositySettings { error: 0.1, ..RadiositySettings::DEFAULT };
        let mesh = PatchMesh::new(&world, &settings).unwrap();
        let lit = |element: &&mesh::Element| element.emission.x > 0.0;
        let found: f64 = mesh.elements.iter().filter(lit).map(|element| element.outline.area()).sum();
        assert!((found / area - 1.0).abs() < 2e-3, "{name}: {found} instead of {area}");
    }
}
