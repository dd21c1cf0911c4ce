//! Flattening of groups and prototypes, by hand.

use crate::material::{Material, Phong};
use crate::math::Transform;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cuboid, Shape, Sphere};
use crate::world::World;
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

#[test]
fn prototypes_and_groups_place_their_shapes() {
    let moved = |content, to: DVec3| Node { transform: Transform::translate(to).into(), ..Node::new(content) };
    let cube = Shape::Box(Cuboid { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) });
    let named = |name: &str, node: Node| Node { name: Some(name.into()), ..node };
    let pair = vec![
        named("low", moved(Content::Shape(cube), DVec3::ZERO)),
        named("high", moved(Content::Shape(cube), DVec3::Y * 2.0)),
    ];
    let scene = Scene {
        materials: vec![Material::new("m", Phong::default())],
        prototypes: vec![Node { material: Some(0), ..Node::new(Content::Group(pair)) }],
        nodes: vec![
            moved(Content::Instance(0), DVec3::X * 10.0),
            Node {
                material: Some(0),
                ..moved(Content::Group(vec![moved(Content::Instance(0), DVec3::Z * 3.0)]), DVec3::X * -10.0)
            },
        ],
        ..Scene::default()
    };
    let world = World::build(scene).unwrap();
    // Two objects are described, and each is placed twice.
    assert_eq!((world.primitives(), world.stats().objects), (4, 2));
    let mut ids = Vec::new();
    for (x, y, z, name) in
        [(10.0, 0.0, 0.0, "low"), (10.0, 2.0, 0.0, "high"), (-10.0, 0.0, 3.0, "low"), (-10.0, 2.0, 3.0, "high")]
    {
        let hit = world.intersect(&Ray::new(Vec3::new(x, y, z + 5.0), -Vec3::Z), f32::INFINITY).unwrap();
        assert_eq!((hit.t, world.object(&hit).name.as_str()), (4.5, name), "{x} {y} {z}");
        ids.push(world.object_id(&hit));
    }
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids, [1, 2, 3, 4]);
}

#[test]
fn unnamed_objects_are_called_by_the_group_around_them() {
    let ball = || Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }));
    let group = |nodes| Node::new(Content::Group(nodes));
    let scene = Scene {
        materials: vec![Material::new("m", Phong::default())],
        prototypes: vec![ball(), group(vec![ball()]).named("bulb")],
        nodes: vec![
            ball(),
            group(vec![
                ball(),
                ball().named("own"),
                group(vec![ball()]),
                group(vec![ball()]).named("inner"),
                Node::new(Content::Instance(0)),
                Node::new(Content::Instance(1)),
                ball(),
            ])
            .named("outer"),
            ball(),
        ],
        ..Scene::default()
    };
    let world = World::build(scene).unwrap();
    let names: Vec<&str> = (1..=9).map(|id| world.object_with_id(id).unwrap().name.as_str()).collect();
    let expected = [
        "sphere #1",
        "group \"outer\", sphere #2",
        "own",
        "group \"outer\", sphere #4",
        "group \"inner\", sphere #5",
        "sphere #6",
        "group \"bulb\", sphere #7",
        "group \"outer\", sphere #8",
        "sphere #9",
    ];
    assert_eq!(names, expected);
}
