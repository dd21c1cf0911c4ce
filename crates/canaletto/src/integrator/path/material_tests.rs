//! Materials in even light, end to end: what absorbs nothing can't be seen.

use super::tests::{PATH, mean, node};
use crate::material::{
    Dielectric, Material, Phong, StandardBase, StandardCoat, StandardSpecular, StandardSurface, StandardTransmission,
};
use crate::math::Rgb;
use crate::scene::Scene;
use crate::shape::{Cuboid, Shape, Sphere};
use glam::Vec3;

/// The mean of a picture of a ball in light of radiance 1 from all sides, and its standard error.
fn ball(material: Material, samples: u32) -> (f64, f64) {
    let scene = Scene {
        background: Rgb::WHITE,
        materials: vec![material],
        nodes: vec![node(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 2.0 }), 0)],
        ..Scene::default()
    };
    mean(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, samples)
}

fn glass(roughness: f32) -> StandardSurface {
    StandardSurface {
        specular: StandardSpecular { roughness, ..StandardSpecular::default() },
        transmission: StandardTransmission { weight: 1.0, ..StandardTransmission::default() },
        ..StandardSurface::default()
    }
}

/// Clear bodies, rough and smooth, with a coat, with dispersion, or as thin walls, and white plastic.
#[test]
fn what_absorbs_nothing_is_not_seen_in_even_light() {
    let rough = |roughness: f32| {
        let glass = Dielectric::new(1.5);
        Material::new("glass", Dielectric { phong: Phong { roughness, ..glass.phong }, ..glass })
    };
    let standard = |surface: StandardSurface| Material::new_standard("standard", surface);
    let dispersed = StandardTransmission { dispersion_scale: 1.0, ..glass(0.0).transmission };
    let white = StandardBase { color: Rgb::WHITE, ..StandardBase::default() };
    let all = [
        ("smooth", rough(0.0)),
        ("rough", rough(0.4)),
        ("very rough", rough(1.0)),
        ("standard", standard(glass(0.4))),
        ("dispersed", standard(StandardSurface { transmission: dispersed, ..glass(0.0) })),
        ("pane", standard(StandardSurface { thin_walled: true, ..glass(0.3) })),
        ("plastic", standard(StandardSurface { base: white, ..StandardSurface::default() })),
        (
            "coated",
            standard(StandardSurface {
                base: white,
                coat: StandardCoat { weight: 1.0, roughness: 0.2, ..StandardCoat::default() },
                ..StandardSurface::default()
            }),
        ),
    ];
    for (name, material) in all {
        let (mean, error) = ball(material, 64);
        assert!((mean - 1.0).abs() < 5e-3 + 3.3 * error && error < 0.02, "{name}: {mean} ± {error}");
    }
}

/// White light that has passed the depth has the colour. Without a specular weight the body's surface isn't seen.
#[test]
fn clear_bodies_absorb_by_their_depth() {
    let transmission =
        StandardTransmission { weight: 1.0, color: Rgb::new(0.9, 0.5, 0.1), depth: 2.0, ..glass(0.0).transmission };
    let specular = StandardSpecular { weight: 0.0, roughness: 0.0, ..StandardSpecular::default() };
    let surface = StandardSurface { transmission, specular, ..StandardSurface::default() };
    let scene = Scene {
        background: Rgb::WHITE,
        materials: vec![Material::new_standard("jelly", surface)],
        nodes: vec![node(Shape::Box(Cuboid { min: Vec3::new(-9.0, -9.0, -0.5), max: Vec3::new(9.0, 9.0, 0.5) }), 0)],
        ..Scene::default()
    };
    // Far away, so that all rays pass a length of 1.
    let (mean, error) = mean(&scene, [Vec3::Z * 20.0, Vec3::ZERO], PATH, 16);
    let expected = (0.9f64.sqrt() + 0.5f64.sqrt() + 0.1f64.sqrt()) / 3.0;
    assert!((mean - expected).abs() < 0.01 + 3.3 * error, "{mean} ± {error}, not {expected}");
}
