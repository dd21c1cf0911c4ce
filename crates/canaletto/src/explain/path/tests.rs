//! Paths add up to the picture, bit for bit.

use super::*;
use crate::camera::Camera;
use crate::explain::{ExplainError, Explainer, TextStyle};
use crate::light::environment::{Environment, EnvironmentKind, Gradient};
use crate::light::{Light, LightKind, Omni, SphereLight};
use crate::material::{Conductor, Dielectric, Material, Medium, Phong, StandardSurface, StandardTransmission};
use crate::render::{Job, Preparation, Session, render};
use crate::scene::{Extrinsics, FilmSettings, Intrinsics, Node, PathSettings, Sampling, Scene};
use crate::shape::{Cuboid, Disk, Shape, Sphere};
use crate::world::World;
use glam::Vec3;

/// A room with everything that paths meet.
fn scene() -> Scene {
    let phong = |kd: f32| Phong { kd: Rgb::new(kd, 0.9 * kd, 0.7 * kd), ..Phong::default() };
    let lamp = Phong { emission: Rgb::new(9.0, 7.0, 5.0), ..phong(0.1) };
    let fog = Medium { absorption: Rgb::gray(0.1), scattering: Rgb::new(0.9, 0.6, 0.4), anisotropy: 0.3 };
    let gold = Conductor::named("gold").unwrap();
    let rough = Conductor { roughness: 0.3, ..gold };
    let transmission = StandardTransmission { weight: 1.0, dispersion_scale: 1.0, ..StandardTransmission::default() };
    let ball = |x: f32, radius: f32| Shape::Sphere(Sphere { center: Vec3::new(x, radius, 0.0), radius });
    let node = |shape: Shape, material: u32| Node::from(shape).with_material(material);
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(1.0, 3.0, 2.0))), Rgb::gray(0.5));
    let sphere = Sphere { center: Vec3::new(-2.0, 4.5, 1.0), radius: 1.0 };
    let seen = LightKind::Sphere(SphereLight { sphere, points: 1 });
    let seen = Light { visible: true, ..Light::new(seen, Rgb::gray(0.3)) };
    Scene {
        environment: Some(Environment::new(EnvironmentKind::Gradient(Gradient {
            stops: vec![(-90.0, Rgb::gray(0.1)), (90.0, Rgb::new(0.3, 0.4, 0.9))],
        }))),
        materials: vec![
            Material::new("floor", phong(0.7)),
            Material::new("lamp", lamp),
            Material::new("glass", Dielectric::new(1.5)).with_medium(Medium { scattering: Rgb::BLACK, ..fog }),
            Material::new("fog", Dielectric::new(1.0)).with_medium(fog),
            Material::new("gold", rough),
            Material::new("veil", phong(0.4)).with_coverage(0.5),
            Material::new_standard("prism", StandardSurface { transmission, ..StandardSurface::default() }),
        ],
        nodes: vec![
            node(Shape::Box(Cuboid { min: Vec3::new(-4.0, -0.1, -4.0), max: Vec3::new(4.0, 0.0, 4.0) }), 0),
            node(Shape::Disk(Disk { center: Vec3::Y * 4.0, normal: Vec3::NEG_Y, radius: 1.0 }), 1),
            node(ball(-2.0, 0.8), 2),
            node(ball(0.0, 0.9), 3),
            node(ball(2.0, 0.7), 4),
            node(Shape::Sphere(Sphere { center: Vec3::new(-1.0, 2.0, -0.5), radius: 0.5 }), 6),
            node(Shape::Disk(Disk { center: Vec3::new(0.0, 1.0, 2.0), normal: Vec3::Z, radius: 0.8 }), 5),
            Node::from(light),
            Node::from(seen),
        ],
        ..Scene::default()
    }
}

fn job(samples: u32) -> Job {
    let intrinsics = Intrinsics { fovy: 50.0, width: 24, height: 16, ..Intrinsics::default() };
    let extrinsics = Extrinsics {
        eye: Vec3::new(0.0, 1.8, 5.5).into(),
        center: Vec3::new(0.0, 0.9, 0.0).into(),
        ..Extrinsics::default()
    };
    let film = FilmSettings { sampling: Sampling::Sampled(samples), ..FilmSettings::default() };
    Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, PathSettings::DEFAULT)
}

#[test]
fn the_factors_of_all_paths_make_the_picture() {
    let world = World::build(scene()).unwrap();
    let mut kinds = std::collections::BTreeSet::new();
    for samples in [1, 3, 8] {
        let job = job(samples);
        let picture = render(&world, &job, &()).unwrap().picture;
        let session = Session::open(&world, &job, Preparation::default()).unwrap();
        for (x, y) in (0..24).flat_map(|x| (0..16).map(move |y| (x, y))) {
            let tree = Explainer::new(&session).paths(x, y).unwrap();
            let bits = |color: Rgb| color.to_array().map(f32::to_bits);
            assert_eq!(bits(tree.color), bits(picture.pixel(x, y)), "{x}, {y}");
            assert_eq!(bits(tree.sum()), bits(tree.color), "{x}, {y}\n{tree}");
            for sample in &tree.samples {
                assert_eq!(bits(sample.sum()), bits(sample.color), "{x}, {y}, {}\n{tree}", sample.number);
                // The contributions are those of the sum.
                let all = sample.rays.iter().map(PathRay::contributions).fold(Rgb::BLACK, |sum, c| sum + c);
                let (a, b) = (all.max_component(), sample.color.max_component());
                assert!((a - b).abs() <= 1e-4 * b.max(1e-6), "{all:?}, {:?}", sample.color);
                for step in sample.rays.iter().flat_map(|ray| &ray.steps) {
                    kinds.insert(match step {
                        PathStep::Medium { .. } => "medium",
                        PathStep::Dispersed { .. } => "dispersed",
                        PathStep::Found { densities: Some(_), .. } => "weighted",
                        PathStep::Found { .. } => "found",
                        PathStep::LeftOut(_) => "left out",
                        PathStep::Passed(Passage::Coverage) => "coverage",
                        PathStep::Passed(Passage::IndexMatched) => "index-matched",
                        PathStep::Sampled(node) if node.visible.is_black() => "hidden",
                        PathStep::Sampled(node) if node.visible == Rgb::WHITE => "seen",
                        PathStep::Sampled(_) => "partly seen",
                        PathStep::Scattered { is_delta: true, .. } => "delta",
                        PathStep::Scattered { .. } => "scattered",
                        PathStep::Roulette { survived: true, .. } => "survived",
                        PathStep::Roulette { .. } => "roulette",
                        PathStep::End(_) | PathStep::Overlay { .. } => "end",
                    });
                }
            }
        }
    }
    assert_eq!(kinds.len(), 15, "{kinds:?}");
}

/// The text tells each factor, and a short one a single path.
#[test]
fn texts_and_drawings_show_the_chosen_path() {
    let world = World::build(scene()).unwrap();
    let job = job(8);
    let session = Session::open(&world, &job, Preparation::default()).unwrap();
    let explainer = Explainer::new(&session);
    let tree = explainer.paths(12, 8).unwrap();
    let brightest = tree.brightest().unwrap();
    let all = |a: &PathSample, b: &PathSample| a.value() >= b.value();
    assert!(tree.samples.iter().all(|sample| all(&tree.samples[brightest], sample)));
    let text = tree.text(&TextStyle::SHORT, Some(brightest));
    assert!(text.contains(&format!("path {} of 8", brightest + 1)) && text.contains("equal, bit for bit"), "{text}");
    assert_eq!(text.matches("camera ray through").count(), 1, "{text}");
    assert_eq!(tree.to_string().matches("camera ray through").count(), 8);
    let outside = tree.outside(&world, &job, Some(brightest), None).unwrap();
    let svg = tree.svg(Some(brightest), None, Some((&outside, "data:,"))).unwrap();
    assert!(svg.contains("path ") && svg.ends_with("</svg>\n"));
    assert_eq!(explainer.paths(24, 0).unwrap_err().to_string().split(' ').next(), Some("pixel"));
}

#[test]
fn other_integrators_have_no_paths() {
    let world = World::build(scene()).unwrap();
    let job = Job { integrator: crate::scene::WhittedSettings::DEFAULT.into(), ..job(1) };
    let session = Session::open(&world, &job, Preparation::default()).unwrap();
    assert_eq!(Explainer::new(&session).paths(0, 0), Err(ExplainError::NoPaths));
}
