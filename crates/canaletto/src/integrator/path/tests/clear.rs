//! Lights, the sun and clear bodies: each light path is counted once.

use super::{PATH, matte, mean, node, pixels};
use crate::light::environment::{Environment, EnvironmentKind, PreparedEnvironment, Sky};
use crate::light::{Directional, Emission, Light, LightKind, Omni, SphereLight};
use crate::material::{
    Dielectric, Material, Medium, Phong, StandardSpecular, StandardSurface, StandardTransmission, fresnel_dielectric,
};
use crate::math::Rgb;
use crate::scene::{Content, Node, PathSettings, Scene};
use crate::shape::{Cuboid, Disk, Mesh, Plane, Shape, Sphere};
use glam::{DVec3, Vec3};

/// Direct light alone.
const DIRECT: PathSettings = PathSettings { max_depth: 1, ..PATH };

/// A view of a tiny part of the floor around the origin.
const FLOOR: [Vec3; 2] = [Vec3::new(0.02, 0.03, 0.0), Vec3::ZERO];

/// The direction to the sun, which is 55° high.
fn sun() -> Vec3 {
    let (sin, cos) = 55f32.to_radians().sin_cos();
    Vec3::new(0.0, sin, cos)
}

/// A floor under a cover of the first material.
fn covered(cover: Shape, material: Material, light: Option<Light>) -> Scene {
    let floor = node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 1);
    Scene {
        materials: vec![material, Material::new("floor", matte(0.5))],
        nodes: [floor, node(cover, 0)].into_iter().chain(light.map(Node::from)).collect(),
        ..Scene::default()
    }
}

fn sheet() -> Shape {
    Shape::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::Y, radius: 60.0 })
}

fn slab() -> Shape {
    Shape::Box(Cuboid { min: Vec3::new(-60.0, 2.0, -60.0), max: Vec3::new(60.0, 2.5, 60.0) })
}

fn clear(eta: f32, opacity: f32) -> Material {
    Material::new("clear", Phong { eta, opacity, ..matte(0.0) })
}

fn glass(roughness: f32) -> Material {
    let glass = Dielectric::new(1.5);
    Material::new("glass", Dielectric { roughness, ..glass })
}

fn standard() -> StandardSurface {
    StandardSurface {
        specular: StandardSpecular { roughness: 0.0, ..StandardSpecular::default() },
        transmission: StandardTransmission { weight: 1.0, ..StandardTransmission::default() },
        ..StandardSurface::default()
    }
}

fn thin() -> StandardSurface {
    StandardSurface { thin_walled: true, ..standard() }
}

fn mean_color(pixels: &[Rgb]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in pixels {
        sum.iter_mut().zip(pixel.to_array()).for_each(|(sum, v)| *sum += f64::from(v) / pixels.len() as f64);
    }
    sum
}

/// A light's share that arrives below a cover is 1 − o, or that of Fresnel's equations at each surface: 1 − F of a
/// boundary, (1 − F) / (1 + F) of a thin wall, less what a medium absorbs.
#[test]
fn lights_shine_through_clear_bodies_by_their_transmittance() {
    let cos = f64::from(sun().y);
    let single = |eta: f64| 1.0 - fresnel_dielectric(cos, 1.0 / eta);
    let (one, both) = (single(1.5), single(1.5) * single(1.5));
    let passed = |shares: f64| [shares; 3];
    let wall = one / (2.0 - one);
    let tinted = StandardSurface {
        transmission: StandardTransmission { color: Rgb::new(0.5, 0.8, 1.0), ..thin().transmission },
        ..thin()
    };
    let dispersive = StandardSurface {
        transmission: StandardTransmission { dispersion_scale: 1.0, ..standard().transmission },
        ..standard()
    };
    let absorption = Rgb::new(0.9, 0.3, 0.1);
    let absorbed = |sigma: f32| (-0.5 * f64::from(sigma) / cos).exp();
    let medium = Medium { absorption, ..Medium::VACUUM };
    let new = Material::new_standard;
    let ball = Shape::Sphere(Sphere { center: sun() * 4.0, radius: 1.0 });
    let at_right_angles = 1.0 - 0.04;
    let all = [
        ("nothing", sheet(), clear(1.0, 0.0), passed(1.0)),
        ("a clear sheet", sheet(), clear(1.0, 0.25), passed(0.75)),
        ("a clear slab", slab(), clear(1.5, 0.25), passed(0.75 * 0.75)),
        ("nothing by its index", sheet(), Material::new("air", Dielectric::new(1.0)), passed(1.0)),
        ("one surface", sheet(), glass(0.0), passed(one)),
        ("a part of it", sheet(), glass(0.0).with_coverage(0.4), passed(0.6 + 0.4 * one)),
        ("a pane", slab(), glass(0.0), passed(both)),
        ("a frosted pane", slab(), glass(0.4), passed(0.0)),
        ("a ball", ball, glass(0.0), passed(at_right_angles * at_right_angles)),
        ("a tinted pane", slab(), glass(0.0).with_medium(medium), absorption.to_array().map(|s| both * absorbed(s))),
        ("a standard pane", slab(), new("glass", standard()), passed(both)),
        ("a prism", slab(), new("glass", dispersive), dispersive.dispersed_ior().map(|eta| single(eta.into()).powi(2))),
        ("a thin wall", sheet(), new("glass", thin()), passed(wall)),
        ("a part of a thin wall", sheet(), new("glass", thin()).with_coverage(0.5), passed(0.5 + 0.5 * wall)),
        ("a stained thin wall", sheet(), new("glass", tinted), [0.5, 0.8, 1.0].map(|tint| tint * wall)),
    ];
    let towards = -sun();
    let far = || Light::new(LightKind::Directional(Directional { towards, beam: None }), Rgb::WHITE);
    let near = || Light::new(LightKind::Omni(Omni::at(sun() * 1e4)), Rgb::WHITE);
    for (name, cover, material, expected) in all {
        for light in [far(), near()] {
            let scene = covered(cover, material.clone(), Some(light));
            let ours = mean_color(&pixels(&scene, FLOOR, DIRECT, 1)).map(|v| v / (0.5 * cos));
            let off = ours.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 2e-4, "{name}: {ours:?}, not {expected:?}");
        }
    }
}

/// A light that is seen and found by shadow rays is as bright through clear bodies as one that isn't seen: its light
/// isn't counted again. In a mirror, where no shadow ray goes, its surface is found as (r / d)² of the radiance.
#[test]
fn seen_lights_shine_through_clear_bodies_once() {
    let sphere = Sphere { center: Vec3::new(0.0, 4.0, 1.0), radius: 1.0 };
    let light = |visible: bool| Light {
        visible,
        emission: Emission::Even,
        ..Light::new(LightKind::Sphere(SphereLight { sphere, points: 1 }), Rgb::gray(4.0))
    };
    for (name, cover, material) in [
        ("sheet", sheet(), clear(1.0, 0.0)),
        ("slab", slab(), clear(1.5, 0.3)),
        ("pane", slab(), glass(0.0)),
        ("thin wall", sheet(), Material::new_standard("glass", thin())),
        ("ball", Shape::Sphere(Sphere { center: Vec3::Y * 1.5, radius: 1.0 }), glass(0.0)),
    ] {
        let settings = PathSettings { max_depth: 3, ..PATH };
        let of = |visible: bool| mean(&covered(cover, material.clone(), Some(light(visible))), FLOOR, settings, 16);
        let ((seen, error), (unseen, _)) = (of(true), of(false));
        // What is mirrored inside the glass adds a little.
        assert!((seen - unseen).abs() < 0.004 * unseen + 3.3 * error, "{name}: {seen} and {unseen}");
        assert!(error < 0.01 * unseen, "{name}: {error}");
    }
    let mirror = Material::new("mirror", Phong { k: Rgb::WHITE, ..matte(0.0) });
    let wall = Shape::Plane(Plane { point: Vec3::NEG_Z * 2.0, normal: Vec3::Z });
    let settings = PathSettings { max_depth: 2, ..PATH };
    let of = |visible: bool| mean(&covered(wall, mirror.clone(), Some(light(visible))), FLOOR, settings, 128);
    let ((seen, error), (unseen, _)) = (of(true), of(false));
    let image = Vec3::new(0.0, 4.0, -5.0);
    let expected = f64::from(0.5 * 4.0 * image.normalize().y / image.length_squared());
    assert!(error < 0.1 * expected, "{error}");
    assert!((seen - unseen - expected).abs() < 3.3 * error, "{seen} - {unseen} ± {error}, not {expected}");
}

fn sky(disk: bool, light: bool) -> Environment {
    Environment::new(EnvironmentKind::Sky(Sky { sun: sun(), disk, light, ..Sky::default() }))
}

/// At the focus of a ball, paths find the sun's disk through it often. Its light has come by shadow rays, so that the
/// disk changes nothing. Without light of its own, the sun doesn't light there, either.
#[test]
fn the_sun_shines_through_clear_bodies_once() {
    for (name, material) in
        [("glass", glass(0.0)), ("phong", clear(1.5, 0.0)), ("standard", Material::new_standard("glass", standard()))]
    {
        // The focus of a ball of η 1.5 is 1.5 radii from its centre.
        let ball = Shape::Sphere(Sphere { center: sun() * 1.45, radius: 1.0 });
        let of = |disk: bool, light: bool| {
            let covered = covered(ball, material.clone(), None);
            let scene = Scene { environment: Some(sky(disk, light)), ..covered };
            mean(&scene, FLOOR, PATH, 16).0
        };
        assert_eq!([of(true, true), of(true, false)], [of(false, true), of(false, false)], "{name}");
    }
}

/// A parabolic mirror throws the light of the whole disk on its focus: as much as if the mirror were as bright as the
/// sun, k L sin² θ.
#[test]
fn a_mirror_throws_the_suns_light_on_its_focus() {
    const STEPS: u32 = 64;
    let (focus, rim) = (1.0f32, 0.5f32);
    let at = |i: u32| rim * (2.0 * i as f32 / STEPS as f32 - 1.0);
    let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j))) {
        let (x, z) = (at(i), at(j));
        positions.push(Vec3::new(x, (x * x + z * z) / (4.0 * focus), z));
        normals.push(Vec3::new(-x / (2.0 * focus), 1.0, -z / (2.0 * focus)).normalize());
        if i < STEPS && j < STEPS {
            let corner = i * (STEPS + 1) + j;
            let (right, up) = (corner + STEPS + 1, corner + 1);
            triangles.extend([[corner, up, right], [right, up, right + 1]]);
        }
    }
    let mirror = Material::new("mirror", Phong { k: Rgb::gray(0.5), ..matte(0.0) });
    let receiver = Shape::Disk(Disk { center: Vec3::Y * focus, normal: Vec3::NEG_Y, radius: 0.002 });
    let of = |light: bool| {
        let sky = Sky { sun: Vec3::Y, light, ..Sky::default() };
        let scene = Scene {
            environment: Some(Environment::new(EnvironmentKind::Sky(sky))),
            materials: vec![mirror.clone(), Material::new("receiver", matte(0.5))],
            meshes: vec![Mesh {
                positions: positions.clone(),
                normals: normals.clone(),
                triangles: triangles.clone(),
                ..Mesh::default()
            }],
            nodes: vec![Node::new(Content::Mesh(0)).with_material(0), node(receiver, 1)],
            ..Scene::default()
        };
        mean(&scene, [Vec3::Y * (focus - 0.004), Vec3::Y * focus], PathSettings { max_depth: 2, ..PATH }, 8)
    };
    let (lit, error) = of(true);
    let zenith = Environment::new(EnvironmentKind::Sky(Sky { sun: Vec3::Y, ..Sky::default() }));
    let sky = PreparedEnvironment::new(&zenith, &mut [], |_| false).unwrap();
    let disk = sky.lookup(DVec3::Y, [DVec3::ZERO; 2]).radiance - sky.radiance_without_sun(DVec3::Y, [DVec3::ZERO; 2]);
    let disk = disk.to_array().map(f64::from).iter().sum::<f64>() / 3.0;
    // The square rim, seen from the focus: the form factor of the directions within it.
    let n = 400;
    let mut share = 0.0;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let within = |i: i32| f64::from(rim) * ((2.0 * f64::from(i) + 1.0) / f64::from(n) - 1.0);
        let (x, z) = (within(i), within(j));
        let (r2, f) = (x * x + z * z, f64::from(focus));
        // The distance of a parabola's point from the focus is f + r² / 4f, and its cosine is (f − r² / 4f) over that.
        let distance = f + r2 / (4.0 * f);
        let cos = (f - r2 / (4.0 * f)) / distance;
        // The mirrored rays are parallel, so that an area dx dz is seen as dx dz / distance².
        share += cos / (distance * distance);
    }
    share *= (2.0 * f64::from(rim) / f64::from(n)).powi(2) / std::f64::consts::PI;
    let expected = 0.5 * 0.5 * disk * share;
    assert!((lit - expected).abs() < 0.03 * expected + 3.3 * error, "{lit} ± {error}, not {expected}");
    assert!(error < 0.02 * expected, "{error}");
    // A sun that doesn't light the scene is seen in mirrors, and lights nothing by them.
    assert!(of(false).0 < 1e-3 * expected);
}

/// The environment's sun is the last light by day. At night no light is, and the last one is the scene's own.
#[test]
fn lamps_at_night_shine_as_if_the_sun_were_no_light() {
    let floor = Material::new("floor", Phong { ks: Rgb::gray(0.3), n: 20.0, ..matte(0.5) });
    let of = |height: f32, light: bool| {
        let (sin, cos) = height.to_radians().sin_cos();
        let sky = Sky { sun: Vec3::new(0.0, sin, cos), light, ..Sky::default() };
        let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::Y * 2.0)), Rgb::gray(0.5));
        let scene = Scene {
            environment: Some(Environment::new(EnvironmentKind::Sky(sky))),
            materials: vec![floor.clone()],
            nodes: vec![node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0), lamp.into()],
            ..Scene::default()
        };
        pixels(&scene, [Vec3::new(0.0, 2.0, 5.0), Vec3::ZERO], PATH, 4)
    };
    for height in [-0.9, -6.0, -90.0] {
        assert!(of(height, true) == of(height, false), "{height} degrees");
    }
    assert!(of(-0.5, true) != of(-0.5, false), "a part of the disk is above the horizon");
}

/// A point light in a rough ball that absorbs nothing, amid a hollow ball of albedo ρ and radius R: the light stays the
/// same as without the ball, l / R² ρ / (1 − ρ).
#[test]
fn a_rough_ball_passes_the_light_of_a_point_once() {
    for roughness in [0.5, 1.0] {
        let light = Light {
            attenuation: [0.0, 0.0, 1.0],
            ..Light::new(LightKind::Omni(Omni::at(Vec3::new(0.01, 0.0, 0.0))), Rgb::gray(9.0))
        };
        let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
        let wall = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 3.0 });
        let scene = Scene {
            materials: vec![glass(roughness), Material::new("wall", matte(0.5))],
            nodes: vec![node(ball, 0), node(wall, 1), light.into()],
            ..Scene::default()
        };
        let (mean, error) = mean(&scene, [Vec3::new(0.0, 2.0, 2.0), Vec3::new(1.0, 2.5, 0.0)], PATH, 16);
        assert!((mean - 1.0).abs() < 0.01 + 3.3 * error && error < 0.03, "roughness {roughness}: {mean} ± {error}");
    }
}
