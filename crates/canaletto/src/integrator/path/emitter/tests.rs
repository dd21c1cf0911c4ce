//! Sampled emitters against rays in all directions.

use super::super::light_sampler::{LightSampler, Source};
use super::super::light_tree::Receiver;
use crate::light::environment::BlockWeights;
use crate::light::{Emission, Light, LightKind, RectangleLight, SphereLight};
use crate::material::{Material, Phong};
use crate::math::{DRay, Rgb, Transform};
use crate::scene::{Content, Node, Scene};
use crate::shape::testing::Random;
use crate::shape::{Cuboid, Cylinder, Disk, Mesh, Parallelogram, Shape, Sphere, Torus, Triangle};
use crate::world::World;
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;

/// Emitters of all kinds around the origin: still, turned, stretched, mirrored and moving ones.
fn scene() -> Scene {
    let lamp = |two_sided: bool| {
        let phong = Phong { kd: Rgb::BLACK, emission: Rgb::new(2.0, 1.0, 0.5), ..Phong::default() };
        Material::new("lamp", phong).with_two_sided(two_sided)
    };
    let node = |shape: Shape, at: Vec3| {
        Node::from(shape).with_material(0).with_transform(&Transform::translate(at.as_dvec3()))
    };
    let placed = |shape: Shape, scale: [f64; 3], degrees: f64, at: Vec3| {
        let turn = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), degrees).unwrap();
        let t = Transform::translate(at.as_dvec3()).after(&turn).after(&Transform::scale(scale.into()).unwrap());
        Node::from(shape).with_material(0).with_transform(&t)
    };
    let ball = Shape::Sphere(Sphere { center: Vec3::new(0.1, 0.0, -0.1), radius: 0.5 });
    let cuboid = Shape::Box(Cuboid { min: Vec3::splat(-0.4), max: Vec3::new(0.3, 0.5, 0.4) });
    let disk = Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::new(-1.0, -0.4, 0.2), radius: 0.6 });
    let tube = Shape::Cylinder(Cylinder { base: Vec3::ZERO, top: Vec3::new(0.2, 0.8, 0.0), radius: 0.3, caps: true });
    let ring = Shape::Torus(Torus { center: Vec3::ZERO, axis: Vec3::new(0.3, 1.0, 0.2), radius: 0.5, tube: 0.2 });
    let triangle = Shape::Triangle(Triangle {
        a: Vec3::ZERO,
        b: Vec3::new(0.0, 0.7, 0.2),
        c: Vec3::new(0.2, 0.1, 0.8),
        one_sided: false,
    });
    let quad = Mesh {
        positions: vec![Vec3::ZERO, Vec3::new(0.0, 0.9, 0.0), Vec3::new(0.1, 0.9, 0.7), Vec3::new(0.1, 0.0, 0.7)],
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    };
    let kite = Mesh {
        positions: vec![Vec3::ZERO, Vec3::new(0.0, 0.9, 0.0), Vec3::new(0.1, 0.7, 0.9), Vec3::new(0.4, 0.0, 0.3)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let mirror = Transform::scale(DVec3::new(-1.0, 1.2, 0.8)).unwrap();
    let mesh = |number: u32, material: u32, at: Vec3, t: &Transform| {
        let t = Transform::translate(at.as_dvec3()).after(t);
        Node::new(Content::Mesh(number)).with_material(material).with_transform(&t)
    };
    let moving = |node: Node| {
        let poses = [(0.0, 0.0), (0.7, 50.0)].map(|(z, degrees)| {
            Transform::translate(DVec3::Z * z).after(&Transform::rotate(DVec3::X, degrees).unwrap())
        });
        node.with_motion(poses.to_vec())
    };
    let light = |kind: LightKind| Light {
        emission: Emission::Matte,
        visible: true,
        attenuation: [1.0, 0.3, 0.1],
        ..Light::new(kind, Rgb::WHITE)
    };
    let sheet = Parallelogram { corner: Vec3::new(-6.0, -3.0, 1.0), u: Vec3::Y, v: Vec3::new(0.0, 0.0, 1.3) };
    let bulb = Sphere { center: Vec3::new(-5.0, 3.0, 1.0), radius: 0.5 };
    Scene {
        materials: vec![lamp(false), lamp(true)],
        meshes: vec![quad, kite],
        nodes: vec![
            node(ball, Vec3::new(3.0, 0.0, 0.0)),
            node(cuboid, Vec3::new(3.0, 2.0, 0.0)),
            node(disk, Vec3::new(3.0, 4.0, 0.0)),
            node(tube, Vec3::new(3.0, -2.0, 0.0)),
            node(ring, Vec3::new(3.0, -4.0, 0.0)),
            node(triangle, Vec3::new(3.0, 0.0, 2.0)),
            mesh(0, 1, Vec3::new(3.0, 2.0, 2.0), &Transform::IDENTITY),
            mesh(1, 1, Vec3::new(3.0, 4.0, 2.0), &mirror),
            placed(ball, [1.4, 0.6, 0.9], 40.0, Vec3::new(3.0, -2.0, 2.0)),
            placed(ring, [-1.0, 1.3, 0.7], 20.0, Vec3::new(3.0, -4.0, 2.0)),
            placed(cuboid, [1.2, 0.7, 1.1], 70.0, Vec3::new(3.0, 0.0, 4.0)),
            placed(disk, [1.2, 0.7, 1.1], 15.0, Vec3::new(3.0, 2.0, 4.0)),
            moving(node(ball, Vec3::new(3.0, 4.0, 4.0))),
            moving(placed(tube, [1.5, 0.8, 1.0], 10.0, Vec3::new(3.0, -3.0, 4.0))),
            moving(mesh(0, 1, Vec3::new(-3.0, 0.0, 2.0), &Transform::IDENTITY)),
            Node::from(light(LightKind::Rectangle(Box::new(RectangleLight { parallelogram: sheet, points: 4 })))),
            Node::from(light(LightKind::Sphere(SphereLight { sphere: bulb, points: 4 }))),
        ],
        ..Scene::default()
    }
}

/// The light of each emitter at a point by its samples is that by rays in all directions, and a hit has the density of
/// the sample that leads to it.
#[test]
fn emitters_are_sampled_as_rays_find_them() {
    let world = World::build(scene()).unwrap();
    let lights = LightSampler::new(&world);
    let count = lights.emitters.all.len();
    // The triangles of the kite don't make a parallelogram.
    assert_eq!(count, 18);
    let mut random = Random(41);
    for (p, time) in [(DVec3::new(0.1, 0.2, 1.5), 0.0), (DVec3::new(0.4, -1.0, 2.0), 0.6)] {
        let to = Receiver { point: p, normal: DVec3::new(0.3, 0.2, 0.9).normalize(), two_sided: true };
        let known = lights.choice(&world, &to, &mut BlockWeights::default()).known();
        let ray = |w: DVec3| Ray::new(p.as_vec3(), w.as_vec3());
        // The vector irradiance of each emitter, by strata of directions.
        let (rows, columns) = (1200, 2400);
        let part = 2.0 * TAU / f64::from(rows * columns);
        let mut expected = vec![DVec3::ZERO; count];
        for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            let cos = 1.0 - 2.0 * (f64::from(i) + f64::from(random.unit())) / f64::from(rows);
            let (s, c) = (TAU * (f64::from(j) + f64::from(random.unit())) / f64::from(columns)).sin_cos();
            let w = DVec3::new(c * (1.0 - cos * cos).sqrt(), s * (1.0 - cos * cos).sqrt(), cos);
            let Some(hit) = world.intersect_at(&ray(w), f32::INFINITY, time) else { continue };
            let Some(emitter) = lights.emitters.of_hit(&hit) else { continue };
            let surface = world.surface(DRay { origin: p, direction: w }, &hit);
            let emission = world.material(&hit).at(&surface).emitted(w.dot(surface.normal) < 0.0);
            let lit = lights.lit(&world, &hit, emission, p.distance(surface.exact));
            expected[emitter as usize] += w * (part * f64::from(lit.g));
        }
        let n = 60_000;
        let mut found = vec![DVec3::ZERO; count];
        for emitter in 0..count {
            let mut compared = 0;
            for i in 0..n {
                let u = [(f64::from(i) + f64::from(random.unit())) / f64::from(n), f64::from(random.unit())];
                let Some(sample) = lights.emitters.all[emitter].sample_from(&world, time, p, u) else { continue };
                let w = sample.point - p;
                let Some(hit) = world.intersect_at(&ray(w), 1.001, time) else { continue };
                if hit.t < 0.999 || lights.emitters.of_hit(&hit) != Some(emitter as u32) {
                    continue;
                }
                found[emitter] += w.normalize() * (f64::from(sample.radiance.g) / sample.pdf / f64::from(n));
                if i % 100 == 0 {
                    let surface = world.surface(DRay { origin: p, direction: w }, &hit);
                    let chosen =
                        lights.pdf_of_hit(&world, (&to, &known), &hit, surface.exact, surface.normal) / sample.pdf;
                    let own = lights.probability_of_emitter(&to, &known, emitter as u32);
                    assert!((chosen / own - 1.0).abs() < 3e-3, "emitter {emitter}: {chosen}, not {own}");
                    compared += 1;
                }
            }
            let (found, expected) = (found[emitter], expected[emitter]);
            let error = (found - expected).length() / expected.length().max(1e-3);
            println!(
                "emitter {emitter}: {found} by samples, {expected} by rays, off by {error:.4}; {compared} compared"
            );
            assert!(error < 0.02, "emitter {emitter} at time {time}: {found} by samples, {expected} by rays");
            assert!(compared > 50 || expected.length() < 1e-3, "emitter {emitter}: {compared} compared");
        }
        assert!(expected.iter().filter(|e| e.length() > 1e-3).count() >= count - 3);
    }
}

/// Sources are chosen as often as their probabilities say, and those sum to 1.
#[test]
fn sources_are_chosen_by_their_probabilities() {
    let world = World::build(scene()).unwrap();
    let lights = LightSampler::new(&world);
    let mut random = Random(42);
    for _ in 0..10 {
        let point = random.cube().as_dvec3() * 3.0;
        let to = Receiver { point, normal: DVec3::new(0.3, 0.2, 0.9).normalize(), two_sided: false };
        let choice = lights.choice(&world, &to, &mut BlockWeights::default());
        let n = 20_000;
        let mut counts = vec![0.0; lights.emitters.all.len()];
        for i in 0..n {
            let u = (f64::from(i) + f64::from(random.unit())) / f64::from(n);
            let Some((Source::Emitter(emitter), probability)) = lights.sample(&world, &to, &choice, u) else {
                continue;
            };
            let own = lights.probability_of_emitter(&to, &choice.known(), emitter);
            assert!((own / probability - 1.0).abs() < 1e-9, "{own}, not {probability}");
            counts[emitter as usize] += 1.0;
        }
        for (emitter, count) in (0..).zip(counts) {
            let expected = lights.probability_of_emitter(&to, &choice.known(), emitter) * f64::from(n);
            assert!((count - expected).abs() < 3.0 + 2.0 * expected.sqrt(), "{count} instead of {expected}");
        }
    }
}
