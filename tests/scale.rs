//! Large numbers of objects. A million spheres from a data file are read, built and rendered, and compared with brute
//! force. There are more copies of a mesh than any list could hold.

use canaletto::Ray;
use canaletto::camera::Camera;
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Job, render};
use canaletto::scene::{Content, Extrinsics, FilmSettings, Intrinsics, Node, Scene, WhittedSettings};
use canaletto::world::{BuildError, Hit, World};
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::gallery::icosphere;
use glam::{DVec3, Vec3};

const COUNT: u32 = 1_000_000;

/// Spheres with centres in a cube of side 20 and radii of 0.01 to 0.05.
fn sphere(i: u32) -> [f32; 4] {
    let h = |k: u32| {
        let x = i.wrapping_mul(0x9e37_79b1) ^ k.wrapping_mul(0x85eb_ca6b);
        let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
        (x ^ (x >> 15)) as f32 / u32::MAX as f32
    };
    [h(1) * 20.0 - 10.0, h(2) * 20.0 - 10.0, h(3) * 20.0 - 10.0, 0.01 + 0.04 * h(4)]
}

#[test]
fn a_million_spheres() {
    let data: Vec<u8> = (0..COUNT).flat_map(sphere).flat_map(f32::to_le_bytes).collect();
    let text = r#"
        camera { eye 0 0 32; center 0 0 0; fovy 45; size 160 120 }
        material "red" { kd 0.7 0.3 0.2 }
        spheres name="cloud" material="red" file="points.bin"
        light "omni" { position 20 30 40; intensity 0.8 }
    "#;
    let assets = MemoryAssets::new().with("cloud.kdl", text).with("points.bin", data);
    let (scene, _) = read_scene("cloud.kdl", &assets).unwrap_or_else(|errors| panic!("{errors}"));
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    let world = World::build(scene).unwrap();
    assert_eq!(world.stats().cloud_spheres, u64::from(COUNT));

    let rendering = render(&world, &job, &()).unwrap();
    assert!(
        rendering.counts.rays.eye.hit > 8_000 && rendering.counts.rays.shadow.hit > 1_000,
        "{:?}",
        rendering.counts
    );

    for i in 0..20 {
        let [x, y, z, _] = sphere(i * 7919);
        let ray = Ray::new(Vec3::new(0.0, 0.0, 32.0), Vec3::new(x, y, z - 32.0));
        let hit = world.intersect(&ray, f32::INFINITY);
        assert!(hit.is_some());
        assert_eq!(hit, world.intersect_brute_force(&ray, f32::INFINITY));
    }
}

/// The transform of member `k` of a group of a thousand, in a grid, each with its own rotation.
fn member(k: u32, pitch: f64) -> Transform {
    let at = DVec3::new(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100)) - 4.5;
    let turn = Transform::rotate(DVec3::new(1.0, f64::from(k % 7), 0.5), f64::from(k) * 17.0).unwrap();
    Transform::translate(at * pitch).after(&turn)
}

/// A thousand times a thousand times a thousand copies of a mesh.
fn thousand_million() -> Scene {
    let thousand = |content: Content, pitch: f64| -> Vec<Node> {
        (0..1000).map(|k| Node::new(content.clone()).with_transform(&member(k, pitch))).collect()
    };
    let (grove, forest) = (thousand(Content::Mesh(0), 3.0), thousand(Content::Instance(0), 60.0));
    Scene {
        materials: vec![Material::new("leaf", Phong { kd: Rgb::new(0.2, 0.7, 0.3), ..Phong::default() })],
        meshes: vec![icosphere(1, 1.0, false)],
        prototypes: vec![Node::new(Content::Group(grove)), Node::new(Content::Group(forest)).with_material(0)],
        nodes: thousand(Content::Instance(1), 1200.0),
        ..Scene::default()
    }
}

#[test]
fn a_thousand_million_copies() {
    let world = World::build(thousand_million()).unwrap();
    let stats = world.stats();
    assert_eq!((stats.instances, stats.primitives), (1_000_000_000, 80_000_000_000));
    assert!(stats.instances > World::MAX_INSTANCES as u64 && stats.bytes < 2 << 20, "{stats:?}");
    let mut met = 0;
    for n in 0..400u32 {
        let k = [7, 13, 29].map(|step| n.wrapping_mul(2_654_435_761) % 1_000_003 / step % 1000);
        let place = [1200.0, 60.0, 3.0];
        let [outer, middle, inner] = [0, 1, 2].map(|level| member(k[level], place[level]));
        let transform = outer.after(&middle.after(&inner));
        // The origin is beside the copy, so that no other copy occludes it.
        let from = transform.point(DVec3::new(0.3, 1.4, 0.2)).as_vec3();
        let ray = Ray::new(from, transform.point(DVec3::new(0.0, 0.1, 0.05)).as_vec3() - from);
        // A mesh at an equal place, and another one at zero. A single mesh far from zero would have coordinates
        // relative to a point near it.
        let copy = Node::new(Content::Instance(0)).with_material(0);
        let alone = Scene {
            prototypes: vec![Node::new(Content::Mesh(0))],
            nodes: vec![Node { transform: transform.into(), ..copy.clone() }, copy],
            ..thousand_million()
        };
        let alone = World::build(alone).unwrap();
        let (found, expected) = (world.intersect(&ray, 1.0), alone.intersect(&ray, 1.0));
        let number = k[0] * 1_000_000 + k[1] * 1000 + k[2];
        assert_eq!(found, expected.map(|hit| Hit { instance: number, ..hit }), "{k:?}");
        if let (Some(found), Some(expected)) = (found, expected) {
            assert_eq!(world.surface(&ray, &found), alone.surface(&ray, &expected));
            assert_eq!((world.object_id(&found), world.material_index(&found)), (number + 1, 0));
            met += 1;
        }
    }
    assert_eq!(met, 400);

    let camera = Camera::new(
        &Intrinsics { fovy: 50.0, width: 64, height: 48, ..Intrinsics::default() },
        &Extrinsics { eye: DVec3::new(3000.0, 4000.0, 17_000.0), ..Extrinsics::default() },
    );
    let job = Job::new(camera.unwrap(), FilmSettings::default(), WhittedSettings::default());
    assert!(render(&world, &job, &()).unwrap().counts.rays.eye.hit > 300);
}

#[test]
fn more_copies_than_numbers_are_refused() {
    let twice = |of: u32| {
        let copy = |x: f64| Node::new(Content::Instance(of)).with_transform(&Transform::translate(DVec3::X * x));
        Node::new(Content::Group(vec![copy(0.0), copy(f64::from(of + 1))])).named(format!("p{}", of + 1))
    };
    let scene = |times: u32| Scene {
        meshes: vec![icosphere(0, 1.0, false)],
        prototypes: [Node::new(Content::Mesh(0))].into_iter().chain((0..times).map(twice)).collect(),
        nodes: vec![Node::new(Content::Instance(times))],
        ..Scene::default()
    };
    assert_eq!(World::build(scene(31)).unwrap().stats().instances, 1 << 31);
    let refused = World::build(scene(40)).unwrap_err();
    assert_eq!(refused, BuildError::TooManyCopies("\"p32\"".into()));
    assert_eq!(refused.to_string(), "\"p32\" expands to more than 4294967294 copies");
}
