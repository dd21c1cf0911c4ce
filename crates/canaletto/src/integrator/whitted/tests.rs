//! Box 5.8 in worlds of two shapes, against the terms of (5.39b) computed by hand, and waves against single rays.

use super::*;
use crate::Named;
use crate::integrator::RayIntegrator;
use crate::light::{Light, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::scene::{Content, Node, Scene, Stage};
use crate::shape::{Plane, Shape, Sphere};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

const FLOOR: Phong = Phong {
    kd: Rgb::new(0.5, 0.25, 0.125),
    ks: Rgb::new(0.25, 0.25, 0.25),
    n: 8.0,
    k: Rgb::new(0.5, 0.5, 0.5),
    eta: 1.0,
    opacity: 1.0,
    roughness: 0.0,
    emission: Rgb::BLACK,
};
const GLASS: Phong = Phong { kd: Rgb::BLACK, ks: Rgb::BLACK, k: Rgb::BLACK, eta: 1.5, opacity: 0.25, ..FLOOR };
const BACKGROUND: Rgb = Rgb::new(0.25, 0.5, 1.0);
const AMBIENT: f32 = 0.5;

fn world(sphere: Phong) -> World {
    world_of(Material::new("sphere", sphere))
}

/// A floor at y = 0 and a sphere of radius 1 around (0, 3, 0), with a lamp at (0, 8, 0).
fn world_of(sphere: Material) -> World {
    let shape = |shape: Shape, material| Node { material: Some(material), ..Node::new(Content::Shape(shape)) };
    let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::new(0.0, 8.0, 0.0))), Rgb::gray(2.0));
    World::build(Scene {
        background: BACKGROUND,
        ambient: Rgb::gray(AMBIENT),
        materials: vec![Material::new("floor", FLOOR), sphere],
        nodes: vec![
            shape(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0),
            shape(Shape::Sphere(Sphere { center: Vec3::new(0.0, 3.0, 0.0), radius: 1.0 }), 1),
            Node::new(Content::Light(lamp)),
        ],
        ..Scene::default()
    })
    .unwrap()
}

fn color(world: &World, stage: Stage, from: Vec3, to: Vec3) -> Rgb {
    let settings = WhittedSettings { stage, ..WhittedSettings::default() };
    Whitted::new(world, settings).eye(&Ray::new(from, (to - from).normalize()), None, &mut ())
}

fn assert_near(found: Rgb, expected: [f64; 3]) {
    for (found, expected) in found.to_array().into_iter().zip(expected) {
        assert!((f64::from(found) - expected).abs() < 1e-5, "{found} instead of {expected}");
    }
}

#[test]
fn each_stage_adds_its_term() {
    let world = world(GLASS);
    // The ray hits (6, 0, 0) at 45 degrees; r goes up along +x, and misses everything.
    let (from, to, hit) = (Vec3::new(3.0, 3.0, 0.0), Vec3::new(6.0, 0.0, 0.0), DVec3::new(6.0, 0.0, 0.0));
    let to_lamp = (DVec3::new(0.0, 8.0, 0.0) - hit).normalize();
    let mirrored = DVec3::new(1.0, 1.0, 0.0).normalize();
    let kd = FLOOR.kd.to_array().map(f64::from);
    let n_dot_l = to_lamp.y;
    let highlight = mirrored.dot(to_lamp).max(0.0).powi(8);
    let mut sum = kd.map(|kd| 2.0 * kd * n_dot_l);
    assert_near(color(&world, Stage::Diffuse, from, to), sum);
    sum = [0, 1, 2].map(|c: usize| sum[c] + f64::from(AMBIENT) * kd[c]);
    assert_near(color(&world, Stage::Ambient, from, to), sum);
    sum = sum.map(|s| s + 2.0 * 0.25 * highlight);
    assert_near(color(&world, Stage::Specular, from, to), sum);
    assert_near(color(&world, Stage::Shadow, from, to), sum);
    let background = BACKGROUND.to_array().map(f64::from);
    sum = [0, 1, 2].map(|c: usize| sum[c] + 0.5 * background[c]);
    assert_near(color(&world, Stage::Reflection, from, to), sum);
    assert_near(color(&world, Stage::Full, from, to), sum);
}

#[test]
fn a_clear_sphere_passes_its_share_of_the_light() {
    // Below the sphere the shadow ray goes through its centre: two surfaces, each passes 1 - 0.25.
    let (from, to) = (Vec3::new(0.0, 0.5, 2.0), Vec3::ZERO);
    let kd = FLOOR.kd.to_array().map(f64::from);
    for (sphere, f_s) in [(GLASS, 0.75 * 0.75), (FLOOR, 0.0)] {
        let world = world(sphere);
        let [lit, shadowed] = [Stage::Specular, Stage::Shadow].map(|stage| color(&world, stage, from, to));
        let ambient = kd.map(|kd| kd * f64::from(AMBIENT));
        let lit = lit.to_array().map(f64::from);
        assert_near(shadowed, [0, 1, 2].map(|c: usize| ambient[c] + f_s * (lit[c] - ambient[c])));
        assert!(lit[0] > ambient[0] + 0.1);
    }
}

#[test]
fn a_ray_through_the_centre_of_glass_goes_straight_on() {
    let background = BACKGROUND.to_array().map(f64::from);
    let seen = color(&world(GLASS), Stage::Full, Vec3::new(5.0, 3.0, 0.0), Vec3::new(0.0, 3.0, 0.0));
    assert_near(seen, background.map(|c| 0.75 * 0.75 * c));
    let without = color(&world(GLASS), Stage::Reflection, Vec3::new(5.0, 3.0, 0.0), Vec3::new(0.0, 3.0, 0.0));
    assert_near(without, [0.0; 3]);
}

const LAMP: Phong =
    Phong { emission: Rgb::new(17.0, 12.0, 4.0), kd: Rgb::BLACK, ks: Rgb::BLACK, k: Rgb::BLACK, ..FLOOR };

#[test]
fn a_surface_emits_from_its_outer_side_or_from_both() {
    let emission = LAMP.emission.to_array().map(f64::from);
    let from_outside = (Vec3::new(5.0, 3.0, 0.0), Vec3::new(0.0, 3.0, 0.0));
    let from_inside = (Vec3::new(0.0, 3.0, 0.0), Vec3::new(5.0, 3.0, 0.0));
    for two_sided in [false, true] {
        let world = world_of(Material::new("sphere", LAMP).with_two_sided(two_sided));
        for &stage in Stage::ALL {
            let seen = |(from, to)| color(&world, stage, from, to);
            let lit = stage != Stage::Unlit;
            assert_near(seen(from_outside), if lit { emission } else { [0.0; 3] });
            assert_near(seen(from_inside), if lit && two_sided { emission } else { [0.0; 3] });
        }
    }
    // It is added to what the surface reflects.
    let both = Phong { emission: LAMP.emission, ..FLOOR };
    let seen = |sphere: Phong| color(&world(sphere), Stage::Full, from_outside.0, from_outside.1).to_array();
    let (with, without) = (seen(both), seen(FLOOR));
    let sum = [0, 1, 2].map(|c: usize| emission[c] + f64::from(without[c]));
    assert_near(Rgb::from(with), sum);
    assert!(without[0] > 0.2, "{without:?}");
}

#[test]
fn emission_is_seen_in_mirrors_and_through_holes_and_lights_nothing() {
    let emission = LAMP.emission.to_array().map(f64::from);
    let background = BACKGROUND.to_array().map(f64::from);
    // The floor mirrors the ray by 45 degrees to the sphere's middle, with k of a half.
    let (from, to) = (Vec3::new(3.0, 0.5, 0.0), Vec3::new(2.5, 0.0, 0.0));
    let dark = Phong { emission: Rgb::BLACK, ..LAMP };
    let seen = |stage| [LAMP, dark].map(|sphere| color(&world(sphere), stage, from, to).to_array().map(f64::from));
    let [with, without] = seen(Stage::Reflection);
    assert_near(Rgb::from(with.map(|v| v as f32)), [0, 1, 2].map(|c: usize| without[c] + 0.5 * emission[c]));
    // Without the mirrored ray, the floor is as bright as beside a dark sphere.
    let [with, without] = seen(Stage::Shadow);
    assert_eq!(with, without);
    // A quarter of the sphere exists. Its far side is seen from inside.
    let (from, to) = (Vec3::new(5.0, 3.0, 0.0), Vec3::new(0.0, 3.0, 0.0));
    for (two_sided, inner) in [(false, 0.0), (true, 0.25)] {
        let world = world_of(Material::new("sphere", LAMP).with_coverage(0.25).with_two_sided(two_sided));
        let expected =
            [0, 1, 2].map(|c: usize| 0.25 * emission[c] + 0.75 * (inner * emission[c] + 0.75 * background[c]));
        assert_near(color(&world, Stage::Full, from, to), expected);
    }
    // A clear body emits from its boundary, too.
    let clear = Phong { opacity: 0.25, ..LAMP };
    let expected = [0, 1, 2].map(|c: usize| emission[c] + 0.75 * 0.75 * background[c]);
    assert_near(color(&world(clear), Stage::Full, from, to), expected);
}

#[test]
fn waves_equal_single_rays_bit_for_bit() {
    let mirror = Phong { k: Rgb::gray(0.75), ..FLOOR };
    let rough = Phong { roughness: 0.5, ..mirror };
    let [glass, brightest] = [
        Phong { emission: LAMP.emission, k: Rgb::gray(0.5), ..GLASS },
        Phong { emission: Rgb::gray(f32::MAX), ..FLOOR },
    ];
    let plain = [FLOOR, GLASS, mirror, rough, LAMP, glass, brightest].map(|phong| Material::new("sphere", phong));
    let more = [
        Material::new("sphere", glass).with_two_sided(true),
        Material::new("sphere", LAMP).with_coverage(0.25),
        Material::new("sphere", LAMP).with_coverage(0.25).with_two_sided(true),
    ];
    for sphere in plain.into_iter().chain(more) {
        let world = world_of(sphere);
        for &stage in Stage::ALL {
            let settings = WhittedSettings { stage, ..WhittedSettings::default() };
            let (mut single, mut wave) = (Whitted::new(&world, settings), Whitted::new(&world, settings));
            let line = |i: u32| {
                let [u, v] = [i % 23, i / 23].map(|k| f64::from(k) / 11.0 - 1.0);
                let to = DVec3::new(6.0 * u, 3.0 + 4.0 * v, -2.0);
                let origin = DVec3::new(0.5, 4.0, 9.0);
                DRay { origin, direction: (to - origin).normalize() }
            };
            let samples: Vec<Sample> = (0..500).map(|i| Sampler::new(7, 0, [i % 23, i / 23]).sample(0, 1)).collect();
            let one_by_one: Vec<Rgb> = (0..500)
                .map(|i| {
                    single.begin(samples[i as usize], 0.0);
                    single.eye(line(i), None, &mut ())
                })
                .collect();
            let lines: Vec<DRay> = (0..500).map(line).collect();
            wave.push_camera_rays(&lines, &samples, &[], []);
            let together = wave.trace_pending().to_vec();
            for (i, (a, b)) in one_by_one.iter().zip(&together).enumerate() {
                assert_eq!(
                    a.to_array().map(f32::to_bits),
                    b.to_array().map(f32::to_bits),
                    "{stage:?} ray {i}: {a:?} {b:?}"
                );
            }
            assert_eq!(single.counts, wave.counts, "{stage:?}");
        }
    }
}
