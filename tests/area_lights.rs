//! Area lights in whole pictures: brightness by closed forms, transforms, explanations, threads and scales.

use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::light::{DiskLight, Emission, Light, LightKind, MeshLight, RectangleLight, SphereLight};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Job, render};
use canaletto::scene::{
    Content, Extrinsics, FilmSettings, Intrinsics, Node, SamplerKind, Sampling, Scene, WhittedSettings,
};
use canaletto::shape::{Disk, Mesh, Parallelogram, Plane, Shape, Sphere};
use canaletto::world::World;
use canaletto_tests::gallery::{icosphere, still_life, still_life_job};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

const POINTS: u32 = 16;

/// A pixel of a white matte floor at the origin, lit only by these nodes.
fn floor(nodes: Vec<Node>, meshes: Vec<Mesh>, sampling: Sampling) -> f64 {
    let white = Material::new("white", Phong { kd: Rgb::WHITE, ..Phong::default() });
    let plane = Node::from(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y })).with_material(0);
    let scene = Scene {
        materials: vec![white],
        meshes,
        nodes: std::iter::once(plane).chain(nodes).collect(),
        ..Scene::default()
    };
    let intrinsics = Intrinsics { fovy: 0.001, width: 1, height: 1, ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: DVec3::new(-3.0, 1.0, 0.0), center: DVec3::ZERO, up: DVec3::Y };
    let film = FilmSettings { sampling, sampler: SamplerKind::Sobol, ..FilmSettings::default() };
    let job = Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, WhittedSettings::default());
    f64::from(render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixel(0, 0).g)
}

fn rectangle(points: u32) -> LightKind {
    // The corner is straight above the origin at height 2; u × v points down.
    LightKind::Rectangle(Box::new(RectangleLight {
        parallelogram: Parallelogram { corner: Vec3::Y * 2.0, u: Vec3::X, v: Vec3::Z * 3.0 },
        points,
    }))
}

/// The form factor of that rectangle.
fn factor() -> f64 {
    let (a, b) = (0.5f64, 1.5f64);
    let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / ra * (b / ra).atan() + b / rb * (a / rb).atan()) / (2.0 * PI)
}

fn matte(kind: LightKind, samples: u32) -> Light {
    Light { samples, emission: Emission::Matte, ..Light::new(kind, Rgb::gray(5.0)) }
}

/// A pixel is radiance times form factor. Points may be fixed or random, and any transforms may place the light.
#[test]
fn pixels_under_matte_lights_are_radiance_times_form_factor() {
    let one = |node: Node, meshes, sampling| floor(vec![node], meshes, sampling);
    let many = Sampling::Sampled(1024);
    let check = |what: &str, value: f64, exact: f64, tolerance: f64| {
        println!("{what}: {value:.5}, exactly {exact:.5}");
        assert!((value / exact - 1.0).abs() < tolerance, "{what}: {value} instead of {exact}");
    };
    let exact = 5.0 * factor();
    check("fixed points", one(matte(rectangle(1024), 0).into(), vec![], Sampling::Center), exact, 2e-3);
    check("random points", one(matte(rectangle(1), 1).into(), vec![], many), exact, 2e-3);
    // The unit square is turned, stretched and lifted to the rectangle's place. As triangles it is an equal light.
    let square = |points| {
        LightKind::Rectangle(Box::new(RectangleLight {
            parallelogram: Parallelogram { corner: Vec3::ZERO, u: Vec3::X, v: Vec3::Y },
            points,
        }))
    };
    let moved = Transform::translate(DVec3::Y * 2.0)
        .after(&Transform::rotate(DVec3::X, 90.0).unwrap())
        .after(&Transform::scale(DVec3::new(1.0, 3.0, 7.0)).unwrap());
    check("moved", one(Node::from(matte(square(1), 1)).with_transform(&moved), vec![], many), exact, 2e-3);
    let mesh = Mesh {
        name: "square".into(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::ONE.with_z(0.0), Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let light = MeshLight { meshes: vec![0], transform: Transform::IDENTITY, points: 1 };
    let light = || Node::from(matte(LightKind::Mesh(Box::new(light.clone())), 1));
    check("mesh", one(light().with_transform(&moved), vec![mesh.clone()], many), exact, 2e-3);
    // The mesh is mirrored twice, in two groups.
    let flip = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
    let group = Node::new(Content::Group(vec![light().with_transform(&moved).with_transform(&flip)]));
    check("mirrored mesh", one(group.with_transform(&flip), vec![mesh.clone()], many), exact, 2e-3);
    // A mirrored mesh still emits outwards.
    let corner = Transform::translate(DVec3::X).after(&flip);
    check("mirrored", one(light().with_transform(&corner).with_transform(&moved), vec![mesh], many), exact, 2e-3);

    let sphere = |points| {
        LightKind::Sphere(SphereLight { sphere: Sphere { center: Vec3::new(0.0, 3.0, 0.0), radius: 1.0 }, points })
    };
    check("sphere", one(matte(sphere(1), 1).into(), vec![], many), 5.0 / 9.0, 2e-3);
    check("sphere, fixed", one(matte(sphere(256), 0).into(), vec![], Sampling::Center), 5.0 / 9.0, 2e-3);
    let ball = MeshLight { meshes: vec![0], transform: Transform::translate(DVec3::Y * 3.0), points: 1 };
    let ball = matte(LightKind::Mesh(Box::new(ball)), 16);
    check("a sphere of triangles", one(ball.into(), vec![icosphere(4, 1.0, false)], many), 5.0 / 9.0, 1e-2);
    let disk =
        LightKind::Disk(DiskLight { disk: Disk { center: Vec3::Y, normal: Vec3::NEG_Y, radius: 0.5 }, points: POINTS });
    check("disk", one(matte(disk, 1).into(), vec![], many), 5.0 * 0.2, 2e-3);
    // The back of the disk is dark.
    let away =
        LightKind::Disk(DiskLight { disk: Disk { center: Vec3::Y, normal: Vec3::Y, radius: 0.5 }, points: POINTS });
    assert_eq!(one(matte(away, 1).into(), vec![], Sampling::Sampled(16)), 0.0);
    // Points with even emission give l times the mean cosine, 1 − r²/3d² for a sphere straight above.
    let even = Light { samples: 4, ..Light::new(sphere(1), Rgb::gray(5.0)) };
    check("sphere, even", one(even.into(), vec![], many), 5.0 * (1.0 - 1.0 / 27.0), 2e-3);
}

/// The still life with area lights of all kinds.
fn lit(scale: f32) -> Scene {
    let v = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * scale;
    let kinds = [
        LightKind::Rectangle(Box::new(RectangleLight {
            parallelogram: Parallelogram { corner: v(-3.0, 5.0, 1.0), u: v(2.0, 0.0, 0.5), v: v(0.0, 0.5, 2.0) },
            points: 5,
        })),
        LightKind::Sphere(SphereLight { sphere: Sphere { center: v(3.0, 4.0, 3.0), radius: 0.7 * scale }, points: 6 }),
        LightKind::Mesh(Box::new(MeshLight {
            meshes: vec![0, 1],
            transform: Transform::translate(v(0.0, 6.0, 0.0).as_dvec3()),
            points: 7,
        })),
        LightKind::Disk(DiskLight {
            disk: Disk { center: v(-2.0, 5.0, -2.0), normal: Vec3::NEG_Y, radius: scale },
            points: 3,
        }),
    ];
    let mut scene = still_life(scale);
    scene.nodes.retain(|node| !matches!(node.content, Content::Light(_)));
    for kind in kinds {
        for (emission, intensity) in [(Emission::Even, 0.1), (Emission::Matte, 2.0)] {
            for samples in [0, 2] {
                let light = Light { samples, emission, ..Light::new(kind.clone(), Rgb::gray(intensity)) };
                scene.nodes.push(light.into());
            }
        }
    }
    scene
}

#[test]
fn area_lights_depend_on_neither_threads_nor_the_unit_of_length() {
    let picture = |scale: f32, threads: usize| -> Vec<u32> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let job = still_life_job(scale, 40, 30, Sampling::Sampled(2));
            let picture = render(&World::build(lit(scale)).unwrap(), &job, &()).unwrap().picture;
            assert!(picture.pixels.iter().all(|p| p.is_finite()));
            picture.pixels.iter().flat_map(|p| p.to_array()).map(f32::to_bits).collect()
        })
    };
    let first = picture(1.0, 1);
    assert!(first.iter().collect::<std::collections::HashSet<_>>().len() > 1000, "it shows something");
    for threads in [2, 3, 7] {
        assert!(picture(1.0, threads) == first, "{threads} threads");
    }
    for k in [-20, -1, 7, 30] {
        let scaled = picture(2f32.powi(k), 2);
        let differing = scaled.iter().zip(&first).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "scaled by 2^{k}");
    }
}

#[test]
fn explanations_of_area_lights_sum_to_the_pixel_bit_for_bit() {
    let world = World::build(lit(1.0)).unwrap();
    let job = still_life_job(1.0, 20, 15, Sampling::Sampled(2));
    let picture = render(&world, &job, &()).unwrap().picture;
    for y in 0..15 {
        for x in 0..20 {
            let tree = explain(&world, &job, x, y).unwrap();
            assert_eq!(tree.sum().to_array().map(f32::to_bits), picture.pixel(x, y).to_array().map(f32::to_bits));
        }
    }
}

#[test]
fn mesh_lights_that_cannot_shine_are_refused() {
    let light = |meshes: Vec<u32>, points| {
        let light = MeshLight { meshes, transform: Transform::IDENTITY, points };
        Node::from(Light::new(LightKind::Mesh(Box::new(light)), Rgb::WHITE)).named("lamp")
    };
    let flat = Mesh { positions: vec![Vec3::ZERO; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let broken = Mesh { positions: vec![Vec3::ZERO; 2], triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let problem = |nodes: Vec<Node>, mesh: Mesh| {
        World::build(Scene { nodes, meshes: vec![mesh], ..Scene::default() }).unwrap_err().to_string()
    };
    assert!(problem(vec![light(vec![0], 4)], flat.clone()).contains("light \"lamp\": its meshes have no area"));
    assert!(problem(vec![light(vec![0], 4)], broken).contains("lamp"));
    assert!(problem(vec![light(vec![1], 4)], flat.clone()).contains("mesh number 1"));
    assert!(problem(vec![light(vec![], 4)], flat).contains("no mesh"));
    assert!(problem(vec![light(vec![0], 0)], icosphere(0, 1.0, false)).contains("points is 0"));
    // A thousand lights of 1280 triangles each exceed the limit.
    let many = (0..1000).map(|_| light(vec![0], 4)).collect();
    assert!(problem(many, icosphere(3, 1.0, false)).contains("points of light and triangles"));
}
