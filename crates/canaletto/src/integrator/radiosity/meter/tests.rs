//! Light meters against closed forms, and their errors against what they miss.

use super::super::*;
use crate::material::{Material, Phong};
use crate::math::Rgb;
use crate::scene::{Node, Scene};
use crate::shape::{Cuboid, Disk, Shape, Sphere};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn matte(kd: f32, emission: f32) -> Material {
    let phong = Phong { kd: Rgb::gray(kd), emission: Rgb::gray(emission), ..Phong::default() };
    Material::new("matte", phong)
}

fn slab(min: [f32; 3], max: [f32; 3]) -> Shape {
    Shape::Box(Cuboid { min: Vec3::from_array(min), max: Vec3::from_array(max) })
}

/// A disk overhead gives E π r² / (r² + h²). A small ball gives E π r² cos θ / d².
#[test]
fn meters_below_lamps_read_closed_forms() {
    let disk = Shape::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 1.0 });
    let ball = Shape::Sphere(Sphere { center: Vec3::new(3.0, 4.0, 0.0), radius: 0.05 });
    for (name, lamp, expected, room) in [("disk", disk, PI / 5.0, 0.01), ("ball", ball, PI * 0.0025 / 25.0 * 0.8, 0.01)]
    {
        let nodes = vec![Node::from(lamp).with_material(0)];
        let world = World::build(Scene { materials: vec![matte(0.0, 1.0)], nodes, ..Scene::default() }).unwrap();
        let settings = RadiositySettings { error: 0.1, ..RadiositySettings::DEFAULT };
        let solution = RadiositySolution::solve(&world, &settings, &()).unwrap();
        let meter = RadiosityMeter::new(&world, &solution);
        let measured = meter.measure((DVec3::ZERO, DVec3::Y), 1024, (3, 0));
        let (found, error) = (measured.irradiance.x, measured.standard_error.x);
        assert!((found - expected).abs() < 3.0 * error, "{name}: {found} ± {error} instead of {expected}");
        assert!(error < room * expected, "{name}: {error} of {expected}");
    }
}

/// Two standard errors cover what is read in 95 of 100 measurements at least, and the mean of all is right: where a
/// lamp is seen through a slit, and where it is in full view.
#[test]
fn standard_errors_cover_rare_light() {
    let lamp = slab([-1.0, 4.0, -1.0], [1.0, 4.1, 1.0]);
    // Two shelves leave a slit of a thirtieth of the lamp.
    let shelves = [slab([-9.0, 2.0, -9.0], [-0.015, 2.1, 9.0]), slab([0.015, 2.0, -9.0], [9.0, 2.1, 9.0])];
    let seen = vec![Node::from(lamp).with_material(1)];
    let hidden = seen.iter().cloned().chain(shelves.map(|shelf| Node::from(shelf).with_material(2))).collect();
    // A lamp faces a tile and not the meter.
    let tile = slab([-0.1, 3.0, -0.1], [0.1, 3.1, 0.1]);
    let below = Shape::Disk(Disk { center: Vec3::Y * 2.9, normal: Vec3::Y, radius: 0.05 });
    let reflected = vec![Node::from(tile).with_material(0), Node::from(below).with_material(1)];
    for (name, nodes, rays) in [("seen", seen, 64), ("hidden", hidden, 128), ("reflected", reflected, 512)] {
        let materials = vec![matte(0.9, 0.0), matte(0.0, 10.0), matte(0.0, 0.0)];
        let world = World::build(Scene { materials, nodes, ..Scene::default() }).unwrap();
        let settings = RadiositySettings { error: 0.2, ..RadiositySettings::DEFAULT };
        let solution = RadiositySolution::solve(&world, &settings, &()).unwrap();
        let meter = RadiosityMeter::new(&world, &solution);
        let place = (DVec3::new(0.3, 0.0, 0.2), DVec3::Y);
        let truth = meter.measure(place, 1 << 19, (1, 0)).irradiance.x;
        let (mut covered, mut sum) = (0, 0.0);
        for seed in 0..200 {
            let measured = meter.measure(place, rays, (seed + 7, 0));
            covered += i32::from((measured.irradiance.x - truth).abs() <= 2.0 * measured.standard_error.x);
            sum += measured.irradiance.x / 200.0;
        }
        assert!(truth > 0.0 && covered >= 190, "{name}: {covered} of 200");
        assert!((sum / truth - 1.0).abs() < 0.25, "{name}: {sum} instead of {truth}");
    }
}
