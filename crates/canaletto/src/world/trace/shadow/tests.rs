//! Occlusion and transmittance in rows of a few surfaces, by hand.

use crate::material::{Material, Phong};
use crate::scene::{Content, Node, Scene};
use crate::shape::{Plane, Shape, Sphere};
use crate::world::{GeometryProbe, Hit};
use crate::world::{OccluderCache, Occlusion, World};
use canaletto_bvh::Ray;
use glam::Vec3;

/// Opaque, clear by 1 − 0.25, and clear by 1 − 0.5.
const OPACITIES: [f32; 3] = [1.0, 0.25, 0.5];

/// Unit spheres along the x axis, each with its centre and an index into [`OPACITIES`], and a floor of this material.
fn world(spheres: &[(f32, u32)], floor: Option<u32>) -> World {
    let shape = |shape: Shape, material| Node { material: Some(material), ..Node::new(Content::Shape(shape)) };
    let sphere = |&(x, material): &(f32, u32)| {
        shape(Shape::Sphere(Sphere { center: Vec3::new(x, 0.0, 0.0), radius: 1.0 }), material)
    };
    let floor = floor.map(|material| shape(Shape::Plane(Plane { point: -Vec3::Y, normal: Vec3::Y }), material));
    let material = |opacity: f32| Material::new(format!("{opacity}"), Phong { opacity, ..Phong::default() });
    World::build(Scene {
        materials: OPACITIES.map(material).to_vec(),
        nodes: spheres.iter().map(sphere).chain(floor).collect(),
        ..Scene::default()
    })
    .unwrap()
}

/// A probe that lists the surfaces that block light.
#[derive(Default)]
struct Blockers(Vec<(u32, f32)>);

impl GeometryProbe for Blockers {
    fn blocker(&mut self, hit: &Hit, opacity: f32) {
        self.0.push((hit.primitive, opacity));
    }
}

fn passes(world: &World, ray: &Ray, t_max: f32) -> (Occlusion, f32, Vec<(u32, f32)>) {
    let (mut cache, mut blockers) = (OccluderCache::NONE, Blockers::default());
    let occlusion = world.occlusion(ray, t_max, 0.0, &mut cache);
    let plain = world.transmittance(ray, t_max, 0.0, None, &mut OccluderCache::NONE.clone(), &mut ());
    let probed = world.transmittance(ray, t_max, 0.0, None, &mut cache, &mut blockers);
    assert_eq!(plain, probed, "a probe changes no share of the light");
    (occlusion, plain, blockers.0)
}

#[test]
fn each_clear_surface_takes_its_share() {
    let along_x = Ray::new(Vec3::new(-10.0, 0.0, 0.0), Vec3::X);
    let through = |spheres: &[(f32, u32)]| passes(&world(spheres, None), &along_x, f32::INFINITY);
    assert_eq!(through(&[]), (Occlusion::Nothing, 1.0, vec![]));
    assert_eq!(through(&[(0.0, 1)]), (Occlusion::Clear, 0.75 * 0.75, vec![(0, 0.25); 2]));
    let (occlusion, passed, blockers) = through(&[(0.0, 1), (5.0, 2)]);
    assert_eq!((occlusion, passed), (Occlusion::Clear, 0.75 * 0.75 * 0.5 * 0.5));
    assert_eq!(blockers, [(0, 0.25), (0, 0.25), (1, 0.5), (1, 0.5)]);
    // A probe is told of the clear surfaces in front of the opaque one.
    let (occlusion, passed, blockers) = through(&[(5.0, 0), (0.0, 2)]);
    assert_eq!((occlusion, passed), (Occlusion::Opaque, 0.0));
    assert_eq!(blockers, [(1, 0.5), (1, 0.5), (0, 1.0)]);
}

#[test]
fn only_surfaces_before_the_end_count() {
    let world = world(&[(0.0, 1), (5.0, 0)], None);
    let from = Vec3::new(-10.0, 0.0, 0.0);
    let towards = |x: f32| passes(&world, &Ray::new(from, Vec3::new(x, 0.0, 0.0) - from), 1.0 - f32::EPSILON);
    assert_eq!(towards(-1.5).0, Occlusion::Nothing);
    assert_eq!((towards(0.0).0, towards(0.0).1), (Occlusion::Clear, 0.75));
    assert_eq!((towards(3.5).0, towards(3.5).1), (Occlusion::Clear, 0.75 * 0.75));
    assert_eq!((towards(5.0).0, towards(5.0).1), (Occlusion::Opaque, 0.0));
    // A ray that starts inside crosses one surface.
    let inside = passes(&world, &Ray::new(Vec3::ZERO, Vec3::Y), f32::INFINITY);
    assert_eq!((inside.0, inside.1), (Occlusion::Clear, 0.75));
}

#[test]
fn shapes_without_bounds_block_too() {
    let down = Ray::new(Vec3::new(3.0, 4.0, 0.0), -Vec3::Y);
    for (material, expected) in [(0, (Occlusion::Opaque, 0.0)), (2, (Occlusion::Clear, 0.5))] {
        let (occlusion, passed, _) = passes(&world(&[(0.0, 0)], Some(material)), &down, f32::INFINITY);
        assert_eq!((occlusion, passed), expected);
    }
}

#[test]
fn a_remembered_occluder_changes_no_result() {
    let spheres: Vec<(f32, u32)> = (0..40).map(|i| (3.0 * i as f32, u32::from(i % 2 == 0))).collect();
    let world = world(&spheres, None);
    let mut cache = OccluderCache::NONE;
    for i in 0..400 {
        let x = i as f32 * 0.317 - 2.0;
        let ray = Ray::new(Vec3::new(x, 5.0, 0.0), -Vec3::Y);
        let fresh = world.occlusion(&ray, f32::INFINITY, 0.0, &mut OccluderCache::NONE.clone());
        assert_eq!(world.occlusion(&ray, f32::INFINITY, 0.0, &mut cache), fresh, "x = {x}");
        // The spheres with odd numbers are opaque.
        let (near, odd) = ((x / 3.0).round(), (x / 3.0).round() as i32 % 2 != 0);
        let expected = match (x - 3.0 * near).abs() < 1.0 && (0.0..40.0).contains(&near) {
            false => Occlusion::Nothing,
            true if odd => Occlusion::Opaque,
            true => Occlusion::Clear,
        };
        assert_eq!(fresh, expected, "x = {x}");
    }
}

/// Twelve large spheres with nearly the same centre. Between two of their surfaces a ray that is rounded at each hit
/// may go to and fro, up to the most surfaces that a ray crosses. Along a surface it advances by units in the last
/// place.
#[test]
fn rays_between_surfaces_closer_than_rounding_end() {
    const RADIUS: f32 = 440_000.0;
    let center = |i: u32| Vec3::new((i as f32 * 0.71).sin(), (i as f32 * 1.3).cos(), (i as f32 * 2.1).sin()) * 1.5;
    let ball = |i: u32| {
        let sphere = Shape::Sphere(Sphere { center: center(i), radius: RADIUS });
        Node { material: Some(0), ..Node::new(Content::Shape(sphere)) }
    };
    let clear = Material::new("clear", Phong { opacity: 0.0, ..Phong::default() });
    let world =
        World::build(Scene { materials: vec![clear], nodes: (0..12).map(ball).collect(), ..Scene::default() }).unwrap();
    let mut most = 0;
    for turn in 0..64 {
        let (y, angle) = ((turn as f32 - 31.5) / 32.0, turn as f32 * 2.4);
        let across = (1.0 - y * y).sqrt();
        let direction = Vec3::new(across * angle.cos(), y, across * angle.sin());
        for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let [from, to] = [i, j].map(|i| center(i) + direction * RADIUS);
            let (mut cache, mut blockers) = (OccluderCache::NONE, Blockers::default());
            world.transmittance(&Ray::new(from, to - from), 0.9999999, 0.0, None, &mut cache, &mut blockers);
            most = most.max(blockers.0.len());
        }
    }
    assert!(most < 2000, "{most} surfaces");
}
