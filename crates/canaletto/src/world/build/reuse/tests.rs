//! Tests that hierarchies of the previous world are reused where possible, and that this changes no picture.

use crate::camera::Camera;
use crate::light::{Light, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::math::{Rgb, Transform};
use crate::render::{Aov, Job, render};
use crate::scene::{Content, Extrinsics, FilmSettings, Intrinsics, Node, Scene, WhittedSettings};
use crate::shape::{CylinderCloud, Mesh, Shape, Sphere, SphereCloud};
use crate::world::build::reuse::ReuseCounts;
use crate::world::{BuildOptions, Quality, World};
use glam::{DVec3, Vec3};

const SIDE: u32 = 40;

/// A square of 3,200 triangles in the plane of x and z. `height` returns the height of each vertex.
fn sheet(height: impl Fn(u32) -> f32) -> Mesh {
    let at = |n: u32| Vec3::new((n % SIDE) as f32 / 20.0 - 1.0, height(n), (n / SIDE) as f32 / 20.0 - 1.0);
    let corners = (0..SIDE * (SIDE - 1)).filter(|n| n % SIDE != SIDE - 1);
    let quad = |n: u32| [[n, n + SIDE, n + 1], [n + 1, n + SIDE, n + SIDE + 1]];
    Mesh {
        positions: (0..SIDE * SIDE).map(at).collect(),
        triangles: corners.flat_map(quad).collect(),
        ..Mesh::default()
    }
}

fn waves(amount: f32) -> Mesh {
    sheet(|n| amount * libm::sinf(n as f32 * 0.7))
}

/// The vertices of the waves in a different order.
fn crumpled() -> Mesh {
    let flat = waves(0.1);
    let positions = (0..flat.positions.len()).map(|n| flat.positions[n * 7919 % flat.positions.len()]).collect();
    Mesh { positions, ..flat }
}

/// The waves, with vertices moved by up to `far` in all directions.
fn stirred(far: f32) -> Mesh {
    let mut mesh = waves(0.1);
    for (n, p) in mesh.positions.iter_mut().enumerate() {
        *p += far * Vec3::new(libm::sinf(n as f32 * 12.9), libm::sinf(n as f32 * 78.2), libm::sinf(n as f32 * 37.7));
    }
    mesh
}

/// A sail, a mesh with two copies, a cloud of each kind and a loose shape.
fn scene() -> Scene {
    let clay =
        Phong { kd: Rgb::new(0.7, 0.5, 0.4), ks: Rgb::gray(0.3), n: 20.0, k: Rgb::gray(0.2), ..Phong::default() };
    let centers = (0..50).map(|n| Vec3::new(n as f32 * 0.05 - 1.2, 0.6, libm::sinf(n as f32))).collect();
    let axes = (0..50).map(|n| n as f32 * 0.06 - 1.5).map(|x| [Vec3::new(x, -1.0, -1.0), Vec3::new(x, 1.0, -1.5)]);
    let at = |x: f64, z: f64| Transform::translate(DVec3::new(x, -0.5, z));
    let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::new(2.0, 4.0, 3.0))), Rgb::gray(0.9));
    Scene {
        materials: vec![Material::new("clay", clay)],
        meshes: vec![waves(0.1), sheet(|n| (n % 3) as f32 * 0.02)],
        spheres: vec![SphereCloud { centers, radii: vec![0.04; 50], ..SphereCloud::default() }],
        cylinders: vec![CylinderCloud { axes: axes.collect(), radii: vec![0.02], ..CylinderCloud::default() }],
        prototypes: vec![Node::new(Content::Mesh(1)).named("tile")],
        nodes: vec![
            Node::new(Content::Mesh(0)).named("sail").with_material(0),
            Node::new(Content::Instance(0)).with_material(0).with_transform(&at(0.8, -0.5)),
            Node::new(Content::Instance(0)).with_material(0).with_transform(&at(-0.9, 0.3)),
            Node::new(Content::Spheres(0)).with_material(0),
            Node::new(Content::Cylinders(0)).with_material(0),
            Node::from(Shape::Sphere(Sphere { center: Vec3::new(0.5, 0.3, 0.8), radius: 0.2 })).with_material(0),
            Node::from(lamp),
        ],
        ..Scene::default()
    }
}

/// All bits of a picture with layers.
fn picture(world: &World) -> String {
    let intrinsics = Intrinsics { fovy: 40.0, width: 48, height: 36, ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: DVec3::new(0.3, 2.0, 4.0), ..Extrinsics::default() };
    let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
    let job = Job::new(camera, FilmSettings::default(), WhittedSettings::default());
    let job = Job { aovs: vec![Aov::Normal, Aov::Depth, Aov::ObjectId], ..job };
    format!("{:?}", render(world, &job, &()).unwrap().picture)
}

fn origins(kept: u64, refitted: u64, built: u64) -> ReuseCounts {
    ReuseCounts { kept, refitted, built }
}

#[test]
fn frames_after_each_other_are_as_each_by_itself() {
    let options = BuildOptions::default();
    let mut now = scene();
    let mut world = World::build(now.clone()).unwrap();
    assert_eq!(world.origins(), origins(0, 0, 4));
    let mut last = picture(&world);
    type Change = (&'static str, fn(&mut Scene), ReuseCounts);
    let changes: [Change; 14] = [
        ("nothing", |_| {}, origins(4, 0, 0)),
        ("higher waves", |s| s.meshes[0] = waves(0.11), origins(3, 1, 0)),
        ("nothing after that", |_| {}, origins(4, 0, 0)),
        ("a turn", |s| turn(s, 2.0), origins(3, 1, 0)),
        ("colours", |s| s.meshes[0].colors = vec![Rgb::new(0.1, 0.9, 0.2); 1600], origins(4, 0, 0)),
        (
            "another place of copies",
            |s| s.nodes[1].transform = Transform::translate(DVec3::Y * 0.4).into(),
            origins(4, 0, 0),
        ),
        ("a crumpled sail", |s| s.meshes[0] = crumpled(), origins(3, 0, 1)),
        ("a larger sphere", |s| s.spheres[0].radii[30] = 0.2, origins(3, 0, 1)),
        ("a sphere elsewhere", |s| s.spheres[0].centers[30].y = 0.9, origins(3, 0, 1)),
        ("thicker cylinders", |s| s.cylinders[0].radii[0] = 0.05, origins(3, 0, 1)),
        ("nothing that is seen, but ends of cylinders", |s| s.cylinders[0].caps = true, origins(3, 0, 1)),
        ("a hole", |s| drop(s.meshes[0].triangles.drain(800..1400)), origins(3, 0, 1)),
        ("a sign of zero", |s| s.cylinders[0].axes[25] = [Vec3::new(-0.0, -1.0, 0.0), Vec3::Y], origins(3, 0, 1)),
        ("no sail", |s| drop(s.nodes.remove(0)), origins(3, 0, 0)),
    ];
    for (what, change, expected) in changes {
        change(&mut now);
        world = World::build_after(world, now.clone(), &options).unwrap();
        assert_eq!(world.origins(), expected, "{what}");
        let found = picture(&world);
        assert!(found == picture(&World::build(now.clone()).unwrap()), "{what}");
        assert_eq!(found == last, what.starts_with("nothing"), "{what}");
        last = found;
    }
}

fn turn(scene: &mut Scene, degrees: f64) {
    scene.nodes[0].transform = Transform::rotate(DVec3::Y, degrees).unwrap().into();
}

#[test]
fn refitting_ends_before_rays_lose_more_than_it_saves() {
    let refitted = [0, 40_000, 60_000].map(|rays| {
        let options = BuildOptions { rays, ..BuildOptions::default() };
        let mut world = World::build(scene()).unwrap();
        let (mut refitted, mut built) = (0, 0);
        for step in 1..=30 {
            let mut now = scene();
            now.meshes[0] = stirred(step as f32 * 0.004);
            world = World::build_after(world, now, &options).unwrap();
            (refitted, built) = (refitted + world.origins().refitted, built + world.origins().built);
        }
        assert_eq!(refitted + built, 30);
        refitted
    });
    assert!(refitted[0] < 30 && refitted[0] > refitted[1] && refitted[1] >= refitted[2], "{refitted:?}");
    // Refitting doesn't pay for very many rays, or for another quality.
    let mut now = scene();
    turn(&mut now, 0.1);
    for (first, rays, second) in [
        (Quality::Medium, 1_000_000, Quality::Medium),
        (Quality::Medium, 0, Quality::High),
        (Quality::High, 0, Quality::Medium),
    ] {
        let world = World::build_with(scene(), &BuildOptions { quality: first, ..BuildOptions::default() }).unwrap();
        let after = World::build_after(world, now.clone(), &BuildOptions { quality: second, rays, view: 0 }).unwrap();
        assert_eq!(after.origins().refitted, 0, "{first:?} {second:?}");
        assert_eq!(after.origins().built, if first == second { 1 } else { 2 });
    }
}

#[test]
fn objects_are_found_again_among_others_of_their_name() {
    let many = |count: usize, lift: f32| Scene {
        meshes: (0..count).map(|n| sheet(|v| (v % 5) as f32 * 0.01 * n as f32 + lift)).collect(),
        nodes: (0..count as u32).map(|n| Node::new(Content::Mesh(n)).named("leaf")).collect(),
        ..Scene::default()
    };
    let options = BuildOptions::default();
    let world = World::build(many(3, 0.0)).unwrap();
    let world = World::build_after(world, many(4, 0.0), &options).unwrap();
    assert_eq!(world.origins(), origins(3, 0, 1));
    let world = World::build_after(world, many(2, 0.01), &options).unwrap();
    assert_eq!(world.origins(), origins(0, 2, 0));
    let world = World::build_after(world, Scene::default(), &options).unwrap();
    assert_eq!(world.origins(), ReuseCounts::default());
}
