//! Path tracing against closed forms.

mod clear;
mod material;

use super::*;
use crate::camera::Camera;
use crate::job::Job;
use crate::light::environment::{Environment, EnvironmentKind, Gradient};
use crate::light::{Light, LightKind, Omni};
use crate::material::{Material, Medium, Phong};
use crate::math::Transform;
use crate::render::render;
use crate::scene::{
    Content, Extrinsics, FilmSettings, Guiding, Integrator, Intrinsics, Node, Sampling, Scene, WhittedSettings,
};
use crate::shape::{Cuboid, Disk, Mesh, Plane, Shape, Sphere};
use glam::{DVec3, Vec3};

/// All pixels of a scene seen from `eye` to `center`.
pub(super) fn pixels(
    scene: &Scene,
    [eye, center]: [Vec3; 2],
    integrator: impl Into<Integrator>,
    samples: u32,
) -> Vec<Rgb> {
    let intrinsics = Intrinsics { fovy: 20.0, width: 32, height: 32, ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: eye.into(), center: center.into(), up: DVec3::new(0.1, 1.0, 0.2) };
    let film = FilmSettings { sampling: Sampling::Sampled(samples), ..FilmSettings::default() };
    let job = Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, integrator);
    let picture = render(&World::build(scene.clone()).unwrap(), &job, &()).unwrap().picture;
    (0..32 * 32).map(|i| picture.pixel(i % 32, i / 32)).collect()
}

/// The mean of all pixels of a scene seen from `eye` to `center`, and its standard error from groups of pixels.
pub(super) fn mean(scene: &Scene, view: [Vec3; 2], integrator: impl Into<Integrator>, samples: u32) -> (f64, f64) {
    let Spread { mean, error, .. } = spread(scene, view, integrator, samples);
    (mean, error)
}

/// The pixels of a picture.
pub(super) struct Spread {
    pub(super) mean: f64,
    /// The mean's standard error.
    pub(super) error: f64,
    /// The middle one of their values.
    pub(super) middle: f64,
}

/// [`mean`] and more.
pub(super) fn spread(scene: &Scene, view: [Vec3; 2], integrator: impl Into<Integrator>, samples: u32) -> Spread {
    let pixels = pixels(scene, view, integrator, samples);
    let mut pixels: Vec<f64> = pixels.iter().map(|c| c.to_array().map(f64::from).iter().sum::<f64>() / 3.0).collect();
    let n = pixels.len() as f64;
    let mean = pixels.iter().sum::<f64>() / n;
    let variance = pixels.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    pixels.sort_by(f64::total_cmp);
    Spread { mean, error: (variance / n).sqrt(), middle: pixels[pixels.len() / 2] }
}

pub(super) const PATH: PathSettings = PathSettings::DEFAULT;

pub(super) fn matte(kd: f32) -> Phong {
    Phong { kd: Rgb::gray(kd), ..Phong::default() }
}

pub(super) fn node(shape: Shape, material: u32) -> Node {
    Node::from(shape).with_material(material)
}

fn box_mesh(half: f32) -> Mesh {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 * half - half;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Mesh { positions: (0..8).map(corner).collect(), triangles, ..Mesh::default() }
}

/// In a closed room whose walls have albedo ρ and emit 1 − ρ, the radiance is 1 everywhere.
#[test]
fn a_furnace_is_white() {
    for (albedo, samples) in [(0.0, 16), (0.5, 16), (0.95, 16), (0.99, 4)] {
        let walls = Phong { emission: Rgb::gray(1.0 - albedo), ..matte(albedo) };
        let materials = vec![Material::new("walls", walls).with_two_sided(true), Material::new("ball", matte(albedo))];
        let sphere = node(Shape::Sphere(Sphere { center: Vec3::new(0.1, 0.2, 0.0), radius: 2.0 }), 0);
        let cuboid = node(Shape::Box(Cuboid { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) }), 0);
        let mesh = Node::new(Content::Mesh(0)).with_material(0);
        for walls in [sphere, cuboid, mesh] {
            let scene = Scene {
                materials: materials.clone(),
                meshes: vec![box_mesh(2.0)],
                nodes: vec![walls],
                ..Scene::default()
            };
            let (mean, error) = mean(&scene, [Vec3::new(0.5, 0.0, 0.5), Vec3::X], PATH, samples);
            // 3.3 standard errors are 99.9 %.
            assert!((mean - 1.0).abs() <= 3.3 * error + 1e-6, "albedo {albedo}: {mean} ± {error}");
            assert!(error < 0.01, "albedo {albedo}: {error}");
        }
    }
}

/// Paths of full throughput go on for 512 scatterings. From there to ten times that, one of 31.6 is left.
#[test]
fn roulette_leaves_full_throughputs_alone_for_long() {
    let survival = |throughput: Rgb, n: u16| super::trace::survival(throughput.into(), f32::from(n));
    assert!([1, 100, 512].iter().all(|n| survival(Rgb::gray(0.25), *n) == 1.0 && survival(Rgb::gray(3.0), *n) == 1.0));
    assert_eq!(survival(Rgb::new(0.125, 0.0, 0.0), 512), 0.5);
    let left: f64 = (513..=5120).map(|n| f64::from(survival(Rgb::WHITE, n))).product();
    assert!((left - 0.1f64.powf(1.5)).abs() < 1e-5, "{left}");
}

/// In closed rooms that absorb nothing paths have 512 · 1.5 / 0.5 scatterings on average: no light, no end.
#[test]
fn paths_end_where_nothing_absorbs_them() {
    let mirror = Phong { k: Rgb::WHITE, ..matte(0.0) };
    let smoke = Medium { scattering: Rgb::gray(3.0), ..Medium::VACUUM };
    let room = Shape::Box(Cuboid { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) });
    let rooms = [
        ("matte", Material::new("walls", matte(1.0))),
        ("mirrors", Material::new("walls", mirror)),
        ("smoke", Material::new("walls", matte(1.0)).with_medium(smoke)),
    ];
    let view = Intrinsics { fovy: 20.0, width: 16, height: 16, ..Intrinsics::default() };
    // Not in the middle, from where mirrors send rays into edges.
    let eye = Extrinsics { eye: DVec3::new(0.1, 0.05, 1.0), ..Extrinsics::default() };
    let camera = Camera::new(&view, &eye).unwrap();
    let film = FilmSettings { sampling: Sampling::Sampled(1), ..FilmSettings::default() };
    for (name, walls) in rooms {
        let scene = Scene { materials: vec![walls], nodes: vec![node(room, 0)], ..Scene::default() };
        let unguided = PathSettings { guiding: Guiding::Off, ..PATH };
        let rendered = render(&World::build(scene).unwrap(), &Job::new(camera.clone(), film, unguided), &()).unwrap();
        let each = rendered.counts.rays.total() as f64 / 256.0;
        assert!((1000.0..2300.0).contains(&each), "{name}: {each}");
        assert!(rendered.picture.pixels.iter().all(|pixel| *pixel == Rgb::BLACK), "{name}");
    }
}

/// A ball of albedo ρ under light of radiance 1 from all sides has the radiance ρ.
#[test]
fn a_ball_in_even_light_shows_its_albedo() {
    let even = Gradient { stops: vec![(-90.0, Rgb::WHITE), (90.0, Rgb::WHITE)] };
    for environment in [None, Some(Environment::new(EnvironmentKind::Gradient(even)))] {
        let scene = Scene {
            background: Rgb::WHITE,
            environment,
            materials: vec![Material::new("ball", matte(0.7))],
            nodes: vec![node(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 2.0 }), 0)],
            ..Scene::default()
        };
        let (mean, error) = mean(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, 64);
        assert!((mean - 0.7).abs() <= 3.3 * error + 1e-6 && error < 1e-3, "{mean} ± {error}");
    }
}

/// A point light gives l kd cos θ, as in the classic integrator.
#[test]
fn a_point_light_is_as_bright_as_in_the_classic_integrator() {
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(1.0, 2.0, 0.5))), Rgb::gray(0.8));
    let scene = Scene {
        materials: vec![Material::new("floor", Phong { ks: Rgb::gray(0.2), n: 9.0, ..matte(0.5) })],
        nodes: vec![node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0), Node::from(light)],
        ..Scene::default()
    };
    let views = [Vec3::new(0.5, 3.0, 2.0), Vec3::ZERO];
    let (ours, _) = mean(&scene, views, PATH, 1);
    let (classic, _) = mean(&scene, views, WhittedSettings::DEFAULT, 1);
    assert!((ours - classic).abs() < 1e-6 * classic, "{ours} and {classic}");
}

/// Below a disk of radius r at height h the irradiance is π L r² / (r² + h²). A ball's is π L (r / d)².
#[test]
fn emitters_light_as_their_form_factors_say() {
    let lamp = Phong { emission: Rgb::gray(4.0), ..matte(0.0) };
    let disk = Shape::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 1.0 });
    let ball = Shape::Sphere(Sphere { center: Vec3::Y * 3.0, radius: 0.8 });
    for (shape, share) in [(disk, 1.0 / 5.0), (ball, (0.8 / 3.0) * (0.8 / 3.0))] {
        let scene = Scene {
            materials: vec![Material::new("floor", matte(0.5)), Material::new("lamp", lamp)],
            nodes: vec![node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0), node(shape, 1)],
            ..Scene::default()
        };
        // The picture shows a tiny part of the floor around the origin.
        let eye = Vec3::new(0.02, 0.03, 0.0);
        let (mean, error) = mean(&scene, [eye, Vec3::ZERO], PATH, 256);
        assert!((mean - 0.5 * 4.0 * share).abs() <= 3.3 * error + 2e-4, "{mean} ± {error}, not {}", 2.0 * share);
        assert!(error < 2e-3, "{error}");
    }
}

/// Two surfaces of a corner: the picture doesn't depend on whether the lamp moves by next to nothing, nor on roulette.
#[test]
fn still_and_moving_lamps_agree() {
    let lamp = Phong { emission: Rgb::gray(5.0), ..matte(0.0) };
    let gloss = Phong { ks: Rgb::gray(0.3), n: 30.0, ..matte(0.4) };
    let disk = Shape::Disk(Disk { center: Vec3::new(0.0, 2.0, 1.0), normal: Vec3::new(0.0, -1.0, -0.3), radius: 1.2 });
    let scene = |gloss: Phong| Scene {
        materials: vec![Material::new("corner", gloss), Material::new("lamp", lamp)],
        nodes: vec![
            node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0),
            node(Shape::Plane(Plane { point: Vec3::NEG_Z, normal: Vec3::Z }), 0),
            node(disk, 1),
        ],
        ..Scene::default()
    };
    let views = [Vec3::new(0.3, 1.0, 3.0), Vec3::new(0.0, 0.2, -0.5)];
    let (mis, error) = mean(&scene(gloss), views, PATH, 256);
    let mut moving = scene(gloss);
    moving.nodes[2] =
        moving.nodes[2].clone().with_motion([0.0, 1e-9].map(|z| Transform::translate(DVec3::Z * z)).to_vec());
    let (moved, more) = mean(&moving, views, PATH, 1024);
    assert!((mis - moved).abs() <= 3.3 * (error * error + more * more).sqrt(), "{mis} ± {error}, {moved} ± {more}");
    let long = PathSettings { max_depth: 40, roulette: false, ..PATH };
    let (without, more) = mean(&scene(gloss), views, long, 256);
    assert!((mis - without).abs() <= 3.3 * (error * error + more * more).sqrt(), "{mis} ± {error}, {without} ± {more}");
}

/// Shadow rays to lamps that stand alone ask for any hit, and others for the nearest one. Where something casts no
/// shadow all ask for the nearest one, and the picture is the same.
#[test]
fn any_hit_tells_what_the_nearest_one_tells() {
    use crate::material::Dielectric;
    let wall = |min: [f32; 3], max: [f32; 3]| node(Shape::Box(Cuboid { min: min.into(), max: max.into() }), 0);
    let ball = |center: [f32; 3], radius: f32, material: u32| {
        node(Shape::Sphere(Sphere { center: center.into(), radius }), material)
    };
    let lamp = Phong { emission: Rgb::gray(8.0), ..matte(0.0) };
    let sky = EnvironmentKind::Gradient(Gradient { stops: vec![(-90.0, Rgb::gray(0.2)), (90.0, Rgb::WHITE)] });
    for clear in [
        Material::new("glass", Dielectric::new(1.5)),
        Material::new("frost", Dielectric { roughness: 0.5, ..Dielectric::new(1.5) }),
        Material::new("veil", Phong { opacity: 0.5, eta: 1.0, ..matte(0.5) }),
    ] {
        let disk = Disk { center: Vec3::new(0.0, 0.98, 0.0), normal: -Vec3::Y, radius: 0.3 };
        let scene = Scene {
            materials: vec![Material::new("white", matte(0.7)), clear, Material::new("lamp", lamp)],
            nodes: vec![
                wall([-1.1, -1.1, -1.1], [1.1, -1.0, 1.0]),
                wall([-1.1, 1.0, -1.1], [1.1, 1.1, 1.0]),
                wall([-1.1, -1.0, -1.1], [-1.0, 1.0, 1.0]),
                node(Shape::Disk(disk), 2),
                // These touch.
                ball([0.6, -0.5, 0.2], 0.2, 2),
                ball([0.6, -0.1, 0.2], 0.2, 0),
                ball([-0.4, -0.6, 0.3], 0.35, 1),
            ],
            environment: Some(Environment::new(sky.clone())),
            ..Scene::default()
        };
        let mut shadowless = scene.clone();
        shadowless.nodes.push(ball([-1.05, 0.0, 0.0], 0.01, 0).with_shadow(false));
        let [lights, others] =
            [&scene, &shadowless].map(|scene| LightSampler::new(&World::build(scene.clone()).unwrap()));
        let isolated = |lights: &LightSampler| lights.emitters.all.iter().map(|e| e.is_isolated).collect::<Vec<_>>();
        assert_eq!((isolated(&lights), isolated(&others)), (vec![true, false], vec![false; 2]));
        assert!(lights.environment_is_hidden_by_any && !others.environment_is_hidden_by_any);
        let view = [Vec3::new(0.2, 0.1, 5.0), Vec3::ZERO];
        assert!(pixels(&scene, view, PATH, 4) == pixels(&shadowless, view, PATH, 4), "other pictures");
    }
}
