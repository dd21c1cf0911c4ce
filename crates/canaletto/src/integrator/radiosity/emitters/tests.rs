//! The light of emitting surfaces against dense quadrature.

use super::*;
use crate::integrator::radiosity::RadiositySolution;
use crate::material::{Material, Phong};
use crate::sampler::Sampler;
use crate::scene::{Content, Node, RadiositySettings, Scene};
use crate::shape::{Mesh, Shape, Sphere};
use crate::world::World;
use glam::Vec3;
use std::f64::consts::PI;

fn rectangle(name: &str, [x0, x1]: [f32; 2], [y0, y1]: [f32; 2], z: f32) -> Mesh {
    // Counter-clockwise when seen from below.
    let corners = [[x0, y0], [x0, y1], [x1, y1], [x1, y0]].map(|[x, y]| Vec3::new(x, y, z));
    Mesh { name: name.into(), positions: corners.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }
}

fn emitting(emission: Rgb) -> Material {
    Material::new("lamp", Phong { kd: Rgb::gray(0.5), emission, ..Phong::default() })
}

/// The mean light at a point that faces up over samples of a pixel.
fn light_at(world: &World, emitters: &Emitters, point: DVec3, samples: u32) -> (DVec3, DVec3) {
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for index in 0..samples {
        let term = emitters.light_at(
            &EmitterReceiver {
                world,
                time: 0.0,
                point,
                normal: DVec3::Z,
                facing: DVec3::Z,
                start: point.as_vec3(),
                sample: &Sampler::new(7, 0, [3, 5]).sample(index, samples),
                dimension: crate::sampler::Dimension::EYE,
            },
            16,
        );
        let light = DVec3::from_array(term.arriving.to_array().map(f64::from));
        sum += light;
        squares += light * light;
    }
    let n = f64::from(samples);
    let mean = sum / n;
    let variance = ((squares / n - mean * mean) / n).max(DVec3::ZERO);
    (mean, DVec3::from_array(variance.to_array().map(f64::sqrt)))
}

/// Two lamps of different colours, and a screen that hides parts of both.
#[test]
fn light_behind_a_screen_is_that_of_dense_quadrature() {
    let colors = [Rgb::new(8.0, 4.0, 1.0), Rgb::new(1.0, 2.0, 9.0)];
    let materials = vec![
        emitting(colors[0]),
        emitting(colors[1]),
        Material::new("gray", Phong { kd: Rgb::gray(0.5), ..Phong::default() }),
    ];
    let places = [([-1.0f32, 0.0], [-0.5f32, 0.5], 3.0f32), ([0.25, 1.75], [-0.25, 1.0], 2.5)];
    let screen = ([-0.6f32, 0.7], [-0.3f32, 0.4], 1.25f32);
    let rectangles = [places[0], places[1], screen];
    let meshes = rectangles.iter().map(|&(x, y, z)| rectangle("rectangle", x, y, z)).collect();
    let nodes = (0..3).map(|i| Node::new(Content::Mesh(i)).with_material(i)).collect();
    let world = World::build(Scene { materials, meshes, nodes, ..Scene::default() }).unwrap();
    let solution =
        RadiositySolution::solve(&world, &RadiositySettings { error: 0.1, ..Default::default() }, &()).unwrap();
    let [mut in_full_view, mut in_penumbra] = [0, 0];
    for i in 0..25 {
        let point = DVec3::new(f64::from(i % 5) - 2.0, f64::from(i / 5) - 2.0, 0.0);
        let (mut expected, mut whole) = (DVec3::ZERO, DVec3::ZERO);
        for ((x, y, z), color) in places.iter().zip(colors) {
            const N: usize = 400;
            let area = f64::from((x[1] - x[0]) * (y[1] - y[0]));
            for k in 0..N * N {
                let along = |range: &[f32; 2], k: usize| {
                    f64::from(range[0]) + f64::from(range[1] - range[0]) * (k as f64 + 0.5) / N as f64
                };
                let way = DVec3::new(along(x, k % N), along(y, k / N), f64::from(*z)) - point;
                let light = way.z * way.z / (PI * way.length_squared() * way.length_squared()) * area / (N * N) as f64;
                let light = DVec3::from_array(color.to_array().map(f64::from)) * light;
                let hides = |(x, y, height): &([f32; 2], [f32; 2], f32)| {
                    let crossing = point + way * (f64::from(*height) / way.z);
                    let inside = |range: &[f32; 2], v: f64| (f64::from(range[0])..f64::from(range[1])).contains(&v);
                    height < z && inside(x, crossing.x) && inside(y, crossing.y)
                };
                whole += light;
                if !rectangles.iter().any(hides) {
                    expected += light;
                }
            }
        }
        let (found, error) = light_at(&world, &solution.emitters, point, 64);
        assert!(
            (found - expected).abs().cmplt(4.0 * error + 1e-3 * whole).all(),
            "{point}: {found}, {expected} +- {error}"
        );
        if expected.x == whole.x {
            in_full_view += 1;
            assert!(
                (found - whole).abs().max_element() < 1e-5 * whole.max_element() || error.x > 0.0,
                "{point}: {found}, {whole}"
            );
        } else if expected.x > 0.0 {
            in_penumbra += 1;
        }
    }
    assert!(in_full_view > 5 && in_penumbra > 5, "{in_full_view} {in_penumbra}");
}

/// The irradiance of a sphere of radiance L and radius r at distance d, facing it, is π L (r / d)².
#[test]
fn a_glowing_sphere_gives_its_light() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(0.0, 0.0, 3.0), radius: 1.0 });
    let nodes = vec![Node::from(sphere).with_material(0)];
    let world = World::build(Scene { materials: vec![emitting(Rgb::WHITE)], nodes, ..Scene::default() }).unwrap();
    let settings = RadiositySettings { error: 0.02, ..Default::default() };
    let solution = RadiositySolution::solve(&world, &settings, &()).unwrap();
    let (found, error) = light_at(&world, &solution.emitters, DVec3::ZERO, 64);
    assert_eq!(solution.emitters.excess, 0);
    // The facets lie inside the sphere.
    assert!((found.x * 9.0 - 1.0).abs() < 0.02 + 36.0 * error.x, "{found} {error}");
    assert!(found.x * 9.0 > 0.95, "{found}: the sphere must not hide itself");
}
