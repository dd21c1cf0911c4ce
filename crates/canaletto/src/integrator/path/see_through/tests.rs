//! Media and partial coverage against closed forms.

use super::super::PathSettings;
use super::super::tests::{PATH, Spread, matte, mean, node, spread};
use crate::light::environment::{Environment, EnvironmentKind, Gradient};
use crate::light::{Light, LightKind, Omni};
use crate::material::{Dielectric, Material, Medium, Phong};
use crate::math::Rgb;
use crate::scene::{Guiding, Node, Scene};
use crate::shape::{Cuboid, Disk, Plane, Shape, Sphere};
use glam::Vec3;

/// Light of radiance 1 from all sides, found by chance alone, and by both ways.
fn even_light() -> [Option<Environment>; 2] {
    let even = Gradient { stops: vec![(-90.0, Rgb::WHITE), (90.0, Rgb::WHITE)] };
    [None, Some(Environment::new(EnvironmentKind::Gradient(even)))]
}

fn fog(medium: Medium) -> Material {
    Material::new("fog", Dielectric::new(1.0)).with_medium(medium)
}

fn ball(radius: f32, material: u32) -> Node {
    node(Shape::Sphere(Sphere { center: Vec3::ZERO, radius }), material)
}

/// What absorbs nothing is as bright as the even light around it, with a surface and without, and with a matte white
/// ball in it.
#[test]
fn fog_that_absorbs_nothing_is_white() {
    for (environment, anisotropy, eta) in
        even_light().into_iter().flat_map(|e| [(e.clone(), 0.0, 1.0), (e.clone(), 0.6, 1.0), (e, -0.4, 1.5)])
    {
        let medium = Medium { scattering: Rgb::new(1.0, 0.5, 0.1), anisotropy, ..Medium::VACUUM };
        let fog = Material { medium, ..Material::new("fog", Dielectric::new(eta)) };
        let scene = Scene {
            background: Rgb::WHITE,
            environment,
            materials: vec![fog, Material::new("ball", matte(1.0))],
            nodes: vec![ball(1.5, 0), ball(0.5, 1)],
            ..Scene::default()
        };
        let (mean, error) = mean(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, 64);
        assert!((mean - 1.0).abs() <= 3.3 * error + 1e-5, "{anisotropy}, {eta}: {mean} ± {error}");
        assert!(error < 0.01, "{error}");
    }
}

/// So are thick clouds and milk, in which paths are scattered hundreds of times: without a surface, with a smooth or a
/// rough one, and with a black lamp in them that shines as brightly as the light around. In a body of index η all light
/// is η² times as bright. The middle pixel is white as well, not the mean of grey ones and a few dots.
#[test]
fn thick_white_media_are_white() {
    let rough = |eta: f32, roughness: f32| {
        let glass = Dielectric::new(eta);
        Dielectric { roughness, ..glass }
    };
    let surfaces = [(1.0, 0.0, 0.0), (1.33, 0.0, 0.6), (1.5, 0.4, 0.0), (2.4, 0.3, 0.0)];
    for ((eta, roughness, anisotropy), has_lamp) in surfaces.into_iter().flat_map(|s| [(s, false), (s, true)]) {
        let medium = Medium { scattering: Rgb::gray(20.0), anisotropy, ..Medium::VACUUM };
        let milk = Material::new("milk", rough(eta, roughness)).with_medium(medium);
        let lamp = Phong { emission: Rgb::gray(eta * eta), ..matte(0.0) };
        let mut nodes = vec![ball(1.0, 0)];
        nodes.extend(has_lamp.then(|| ball(0.4, 1)));
        let materials = vec![milk, Material::new("lamp", lamp)];
        let scene = Scene { background: Rgb::WHITE, materials, nodes, ..Scene::default() };
        // Each pixel's ray meets the ball.
        let views = [Vec3::Z * 4.0, Vec3::ZERO];
        let Spread { mean, error, middle } = spread(&scene, views, PathSettings { guiding: Guiding::Off, ..PATH }, 8);
        let what = format!("{eta}, {roughness}, {has_lamp}");
        assert!((mean - 1.0).abs() <= 3.3 * error + 1e-5 && error < 0.01, "{what}: {mean} ± {error}");
        assert!((middle - 1.0).abs() < 0.1, "{what}: {middle}");
    }
}

/// A plate of thickness d lets e^(−σ d) through, from outside and to an eye within it.
#[test]
fn absorption_follows_beer_and_lambert() {
    for (back, front, passed) in [(-0.5, 1.0, 1.5), (-2.0, 9.0, 7.0)] {
        let plate = Shape::Box(Cuboid { min: Vec3::new(-50.0, -50.0, back), max: Vec3::new(50.0, 50.0, front) });
        let absorption = Rgb::gray(0.3);
        let scene = Scene {
            background: Rgb::WHITE,
            materials: vec![fog(Medium { absorption, ..Medium::VACUUM })],
            nodes: vec![node(plate, 0)],
            ..Scene::default()
        };
        let (mean, _) = mean(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, 4);
        // The mean over the pixels, whose rays cross the plate at slightly different angles.
        let tan = 10.0f64.to_radians().tan();
        let at = |i: u32| ((f64::from(i) + 0.5) / 16.0 - 1.0) * tan;
        let slant = |i: u32| (1.0 + at(i % 32) * at(i % 32) + at(i / 32) * at(i / 32)).sqrt();
        let expected = (0..1024).map(|i| (-0.3 * passed * slant(i)).exp()).sum::<f64>() / 1024.0;
        assert!((mean - expected).abs() < 2e-4 * expected, "{mean}, not {expected}");
    }
}

/// A point light in a medium is weaker by e^(−σ d) on a floor at distance d, for it shines straight down on a small
/// part of the floor. So is a lamp.
#[test]
fn lights_shine_through_media() {
    let even = Medium { absorption: Rgb::gray(0.25), ..Medium::VACUUM };
    let floor = || node(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0);
    let cloud = Shape::Sphere(Sphere { center: Vec3::Y * 2.0, radius: 1.5 });
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::Y * 2.0)), Rgb::WHITE);
    let emission = Rgb::gray(100.0);
    let lamp = Shape::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 0.1 });
    for source in [Node::from(light), node(lamp, 2)] {
        let mut radiance = [0.0; 2];
        for (radiance, medium) in radiance.iter_mut().zip([Medium::VACUUM, even]) {
            let scene = Scene {
                materials: vec![
                    Material::new("floor", matte(0.5)),
                    fog(medium),
                    Material::new("lamp", Phong { emission, ..matte(0.0) }),
                ],
                nodes: vec![floor(), node(cloud, 1), source.clone()],
                ..Scene::default()
            };
            *radiance = mean(&scene, [Vec3::new(0.02, 0.03, 0.0), Vec3::ZERO], PATH, 64).0;
        }
        let expected = (-0.25f64 * 1.5).exp();
        let passed = radiance[1] / radiance[0];
        assert!(radiance[0] > 0.1 && (passed - expected).abs() < 1e-3, "{radiance:?}: {passed}, not {expected}");
    }
}

/// A ball in a black box of coverage c gets 1 − c of the light around it, and of a lamp outside.
#[test]
fn partial_coverage_lets_its_share_of_the_light_pass() {
    let cage = |half: f32| node(Shape::Box(Cuboid { min: Vec3::splat(-half), max: Vec3::splat(half) }), 1);
    let view = [Vec3::new(0.0, 0.5, 3.0), Vec3::ZERO];
    let seen = |coverages: [f32; 2], environment: Option<Environment>, background: Rgb| {
        let [near, far] = coverages;
        let black = |coverage: f32| Material { coverage, ..Material::new("cage", matte(0.0)) };
        let lamp = Phong { emission: Rgb::gray(30.0), ..matte(0.0) };
        let above = Shape::Disk(Disk { center: Vec3::Y * 9.0, normal: Vec3::NEG_Y, radius: 2.0 });
        let scene = Scene {
            background,
            environment,
            materials: vec![Material::new("ball", matte(0.7)), black(near), black(far), Material::new("lamp", lamp)],
            nodes: vec![ball(1.0, 0), cage(6.0), Node { material: Some(2), ..cage(7.0) }, node(above, 3)],
            ..Scene::default()
        };
        mean(&scene, view, PATH, 256)
    };
    for (environment, background) in even_light().into_iter().zip([Rgb::WHITE, Rgb::BLACK]).chain([(None, Rgb::BLACK)])
    {
        let (open, _) = seen([0.0, 0.0], environment.clone(), background);
        let (covered, error) = seen([0.25, 0.4], environment, background);
        let expected = open * 0.75 * 0.6;
        assert!(open > 0.05 && (covered - expected).abs() <= 4.0 * error + 1e-6, "{covered} ± {error}, not {expected}");
        assert!(error < 0.05 * expected, "{error}");
    }
}
