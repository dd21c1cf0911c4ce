//! Numbers of objects against an expansion of the description, node by node.

use crate::light::{Light, LightKind, Omni};
use crate::math::{Rgb, Transform};
use crate::scene::{Content, Node, Scene};
use crate::shape::testing::Random;
use crate::shape::{Cuboid, CylinderCloud, Mesh, Plane, Shape, Sphere, SphereCloud};
use crate::world::build::instancing::InstancingPolicy;
use crate::world::build::reuse::Previous;
use crate::world::{BuildOptions, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

const POLICIES: [InstancingPolicy; 3] = [
    InstancingPolicy { members: 4, part: 64, alone: 64 },
    InstancingPolicy { members: 1, part: usize::MAX, alone: 1 },
    InstancingPolicy { members: usize::MAX, part: 1, alone: usize::MAX },
];

fn below(random: &mut Random, n: usize) -> usize {
    (random.unit() * n as f32) as usize
}

/// A transform that moves far, and often turns and stretches.
fn place(random: &mut Random) -> Transform {
    let mut vector = || (2.0 * Vec3::new(random.unit(), random.unit(), random.unit()) - 1.0).as_dvec3();
    let (at, axis, scale) = (vector() * 3e3, vector(), 1.0 + 0.5 * vector());
    let moved = Transform::translate(at);
    match below(random, 4) {
        0 => moved,
        1 => moved.after(&Transform::rotate(axis, 70.0).unwrap()),
        2 => moved.after(&Transform::scale(DVec3::splat(scale.x)).unwrap()),
        _ => moved.after(&Transform::rotate(axis, 70.0).unwrap()).after(&Transform::scale(scale).unwrap()),
    }
}

/// A node of any kind, of size 0.1 around zero. Groups contain up to four more, and instances refer to prototypes below
/// `level`. Names of objects are given by `count`.
fn node(random: &mut Random, level: usize, depth: usize, count: &mut u32) -> Node {
    let cube = Cuboid { min: Vec3::splat(-0.1), max: Vec3::splat(0.1) };
    let content = match below(random, if depth < 3 { 14 } else { 8 }) {
        0 | 1 => Content::Shape(Sphere { center: Vec3::ZERO, radius: 0.1 }.into()),
        2 => Content::Shape(Shape::Box(cube)),
        3 => Content::Shape(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y })),
        4 => Content::Mesh(below(random, 3) as u32),
        5 => Content::Spheres(below(random, 2) as u32),
        6 => Content::Cylinders(0),
        7 => Content::Light(Light::new(LightKind::Omni(Omni::at(Vec3::ZERO)), Rgb::WHITE)),
        8 | 9 => Content::Group((0..below(random, 5)).map(|_| node(random, level, depth + 1, count)).collect()),
        _ if level > 0 => Content::Instance(below(random, level) as u32),
        _ => Content::Mesh(0),
    };
    *count += 1;
    let moves = !contains_plane(&content) && below(random, 40) == 0 && !matches!(content, Content::Instance(_));
    let motion = if moves { vec![Transform::IDENTITY, Transform::translate(DVec3::X * 9.0)] } else { Vec::new() };
    Node { transform: place(random).into(), motion: motion.into(), ..Node::new(content).named(format!("{count}")) }
}

/// Whether there may be planes, which can't move.
fn contains_plane(content: &Content) -> bool {
    match content {
        Content::Shape(shape) => shape.bounds().is_none(),
        Content::Group(children) => {
            children.iter().any(|c| contains_plane(&c.content) || matches!(c.content, Content::Instance(_)))
        }
        _ => false,
    }
}

fn scene(random: &mut Random) -> Scene {
    // An octahedron, so that a ray from above hits a face.
    let corners = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z].map(|c| c * 0.2);
    let faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    let mesh = Mesh { positions: corners.to_vec(), triangles: faces.to_vec(), ..Mesh::default() };
    let centers = vec![Vec3::ZERO, Vec3::splat(0.02), Vec3::splat(-0.02)];
    let spheres = SphereCloud { centers, radii: vec![0.1], ..SphereCloud::default() };
    let axes = vec![[Vec3::Y * -0.1, Vec3::Y * 0.1]];
    let cylinders = CylinderCloud { axes, radii: vec![0.1], caps: true, ..CylinderCloud::default() };
    let count = &mut 0;
    let mut list = |level: usize, n: usize| (0..n).map(|_| node(random, level, 0, count)).collect::<Vec<Node>>();
    let mut prototypes = Vec::new();
    for level in 0..4 {
        let members = list(level, 5);
        prototypes.push(Node::new(Content::Group(members)).with_transform(&Transform::translate(DVec3::X * 50.0)));
    }
    let nodes = list(4, 12);
    Scene {
        meshes: vec![mesh; 3],
        spheres: vec![spheres; 2],
        cylinders: vec![cylinders],
        prototypes,
        nodes,
        ..Scene::default()
    }
}

/// Appends the name, kind and transform of each object below these nodes, in their order, copies included.
fn expand(scene: &Scene, nodes: &[Node], outer: &Transform, objects: &mut Vec<(String, &'static str, Transform)>) {
    for node in nodes {
        let transform = outer.after(&node.transform);
        let kind = match &node.content {
            Content::Shape(shape) => shape.kind(),
            Content::Mesh(_) => "mesh",
            Content::Spheres(_) => "spheres",
            Content::Cylinders(_) => "cylinders",
            Content::Light(_) => continue,
            Content::Group(children) => {
                expand(scene, children, &transform, objects);
                continue;
            }
            Content::Instance(index) => {
                expand(scene, std::slice::from_ref(&scene.prototypes[*index as usize]), &transform, objects);
                continue;
            }
        };
        objects.push((node.name.as_deref().unwrap_or_default().into(), kind, transform));
    }
}

#[test]
fn objects_are_numbered_in_the_order_of_the_file() {
    let random = &mut Random(30);
    let (mut compared, mut groups, mut planes) = (0, 0, 0);
    for round in 0..40 {
        let scene = scene(random);
        let mut objects = Vec::new();
        expand(&scene, &scene.nodes, &Transform::IDENTITY, &mut objects);
        let lower = |policy, before| World::lower(scene.clone(), &BuildOptions::default(), policy, before).unwrap();
        let mut worlds: Vec<World> = POLICIES.map(|policy| lower(policy, Previous::default())).into();
        let again =
            World::build_after(lower(POLICIES[1], Previous::default()), scene.clone(), &BuildOptions::default());
        worlds.push(again.unwrap());
        groups += worlds[1].geometry.groups.len();
        for world in &worlds {
            for (number, (name, kind, transform)) in (1..).zip(&objects) {
                let label = || format!("round {round}, number {number}, {kind} {name}");
                let object = world.object_with_id(number).unwrap_or_else(|| panic!("{}", label()));
                assert_eq!((&object.name, object.kind), (name, *kind), "{}", label());
                let [from, at] = [DVec3::new(0.03, 0.4, 0.02), DVec3::ZERO].map(|p| transform.point(p).as_vec3());
                // A ray from just above the object. A plane, or another object, is rarely between them.
                let Some(hit) = world.intersect(&Ray::new(from, at - from), 1.1) else {
                    panic!("{}: no hit", label());
                };
                if world.object_id(&hit) != number {
                    // What lies before the object must be another object at another place.
                    let other = &objects[world.object_id(&hit) as usize - 1];
                    assert!(other.1 == "plane" && world.object(&hit).name == other.0, "{}: {other:?}", label());
                    continue;
                }
                assert_eq!(world.object(&hit), object);
                compared += 1;
                planes += usize::from(*kind == "plane");
            }
            let last = objects.len() as u32;
            assert!([0, last + 1, u32::MAX].iter().all(|&id| world.object_with_id(id).is_none()));
            assert_eq!(world.largest_id(), u64::from(last).max(1));
        }
    }
    assert!(compared > 10_000 && groups > 100 && planes > 1000, "{compared} {groups} {planes}");
}

/// 2³⁰ copies of eight spheres, and a sphere after them. Its number doesn't fit in 32 bits.
#[test]
fn numbers_beyond_32_bits_are_the_largest_number() {
    let sphere = |x: f32| Node::from(Shape::Sphere(Sphere { center: Vec3::X * x, radius: 0.1 }));
    let eight = Node::new(Content::Group((0..8).map(|n| sphere(n as f32)).collect()));
    let step = |level: u32, n: u32| Transform::translate(DVec3::Z * f64::from(n) * 4f64.powi(level as i32));
    let four = |level: u32| {
        (0..4).map(move |n| Node::new(Content::Instance(level)).with_transform(&step(level, n))).collect::<Vec<_>>()
    };
    let mut prototypes = vec![eight];
    prototypes.extend((0..14).map(|level| Node::new(Content::Group(four(level)))));
    let mut nodes = vec![sphere(-1.0).named("first")];
    nodes.extend(four(14));
    nodes.push(sphere(-2.0).named("last"));
    let world = World::build(Scene { prototypes, nodes, ..Scene::default() }).unwrap();
    let met = |x: f32, z: f32| world.intersect(&Ray::new(Vec3::new(x, 0.2, z), -Vec3::Y), 1.0).unwrap();
    assert_eq!(world.object_id(&met(-1.0, 0.0)), 1);
    for (x, z, id) in [(0.0, 0.0, 2), (3.0, 0.0, 5), (0.0, 1.0, 10), (7.0, 7.0, 65)] {
        assert_eq!(world.object_id(&met(x, z)), id);
    }
    let last = met(-2.0, 0.0);
    assert_eq!((world.object_id(&last), world.object(&last).name.as_str()), (u32::MAX, "last"));
    assert_eq!(world.largest_id(), (1 << 33) + 2);
    assert_eq!(world.object_with_id(u32::MAX - 1).map(|o| o.kind), Some("sphere"));
    assert_eq!(world.object_with_id(u32::MAX), None);
}
