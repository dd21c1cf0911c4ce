//! Materials in even light, end to end: what absorbs nothing can't be seen.

use super::{PATH, matte, mean, node, pixels};
use crate::light::environment::{Environment, EnvironmentKind, Gradient};
use crate::material::{
    Conductor, Dielectric, Material, Phong, StandardBase, StandardCoat, StandardFuzz, StandardSpecular,
    StandardSubsurface, StandardSurface, StandardThinFilm, StandardTransmission, Target, TextureUse,
};
use crate::math::Rgb;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cuboid, Mesh, Shape, Sphere};
use crate::texture::{Texture, TextureKind};
use glam::{Vec2, Vec3};

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
        Material::new("glass", Dielectric { roughness, ..glass })
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

/// Frosted glass of the standard surface is as noisy as that of the dielectric, whose facets are chosen alike.
#[test]
fn frosted_glass_is_as_noisy_as_a_dielectric() {
    for roughness in [0.2, 0.5] {
        let smooth = Dielectric::new(1.5);
        let frosted = Dielectric { roughness, ..smooth };
        let (mean, error) = ball(Material::new_standard("standard", glass(roughness)), 64);
        let (_, reference) = ball(Material::new("dielectric", frosted), 64);
        assert!((mean - 1.0).abs() < 1e-3 + 3.3 * error, "{roughness}: {mean} ± {error}");
        assert!(error < 1.5 * reference, "{roughness}: {error}, the dielectric's {reference}");
    }
}

/// A square whose shading normals lean by about 45° inwards, or are bent there by a normal map.
fn bent(material: Material, by_map: bool) -> Scene {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let positions = vec![corner(-4.0, -4.0), corner(4.0, -4.0), corner(4.0, 4.0), corner(-4.0, 4.0)];
    let normals = positions.iter().map(|p| (Vec3::Z - *p / 4.0).normalize()).collect();
    let mesh = Mesh {
        uvs: positions.iter().map(|p| Vec2::new(p.x, -p.y) / 8.0 + 0.5).collect(),
        normals: if by_map { Vec::new() } else { normals },
        positions,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    // x and z of a unit vector that leans by 60°.
    let leaning = TextureKind::Constant([0.5 + 0.5 * 0.75f32.sqrt(), 0.5, 0.75, 1.0]);
    let used = TextureUse::new(0, Target::Normal { strength: 1.0, down: false });
    Scene {
        background: Rgb::WHITE,
        textures: if by_map { vec![Texture { name: "leaning".into(), kind: leaning }] } else { Vec::new() },
        materials: vec![if by_map { material.with_texture(used) } else { material }],
        meshes: vec![mesh],
        nodes: vec![Node::new(Content::Mesh(0)).with_material(0)],
        ..Scene::default()
    }
}

/// White metal and white plastic stay white under normals that lean, rough and polished, by a mesh and by a map.
#[test]
fn leaning_normals_take_no_light() {
    let white = StandardBase { color: Rgb::WHITE, ..StandardBase::default() };
    for by_map in [false, true] {
        for roughness in [0.0, 0.1, 0.4] {
            let specular = StandardSpecular { roughness, ..StandardSpecular::default() };
            let mirror = Conductor::new(Rgb::gray(1e-6), Rgb::gray(1e6));
            for (name, material) in [
                ("metal", Material::new("m", Conductor { roughness, ..mirror })),
                (
                    "plastic",
                    Material::new_standard("p", StandardSurface { base: white, specular, ..Default::default() }),
                ),
            ] {
                for eye in [Vec3::new(0.0, 9.0, 6.0), Vec3::new(-12.0, 1.0, 3.0)] {
                    let (mean, error) = mean(&bent(material.clone(), by_map), [eye, Vec3::ZERO], PATH, 16);
                    assert!(
                        (mean - 1.0).abs() < 3e-3 + 3.3 * error && error < 0.02,
                        "{name} of roughness {roughness} from {eye}, by a map {by_map}: {mean} ± {error}"
                    );
                }
            }
        }
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

/// The corners of all parameters in even light: nothing is negative or no number, nothing gains light, and what absorbs
/// nothing loses nothing.
#[test]
fn corners_of_materials_keep_light() {
    let standard = |surface: StandardSurface| Material::new_standard("standard", surface);
    let white = StandardBase { color: Rgb::WHITE, ..StandardBase::default() };
    let of = |roughness: f32, specular: [f32; 2], clear: f32, metalness: f32| StandardSurface {
        base: StandardBase { metalness, ..white },
        specular: StandardSpecular { roughness, ior: specular[0], weight: specular[1], ..StandardSpecular::default() },
        transmission: StandardTransmission { weight: clear, ..StandardTransmission::default() },
        ..StandardSurface::default()
    };
    let dielectric = |eta: f32, roughness: f32| {
        let glass = Dielectric::new(eta);
        Material::new("glass", Dielectric { roughness, ..glass })
    };
    let conductor = |eta: f32, k: f32, roughness: f32| {
        let metal = Conductor::new(Rgb::gray(eta), Rgb::gray(k));
        Material::new("metal", Conductor { roughness, ..metal })
    };
    let phong = |[kd, ks, k, opacity]: [f32; 4], n: f32, roughness: f32| {
        let [ks, k] = [ks, k].map(Rgb::gray);
        Material::new("phong", Phong { ks, n, k, opacity, roughness, eta: 1.5, ..matte(kd) })
    };
    // Each with the share that comes back: at least this, and at most 1.
    let mut all: Vec<(String, Material, f64)> = Vec::new();
    let mut add = |name: String, material: Material, least: f64| all.push((name, material, least));
    for roughness in [0.0, 0.01, 0.3, 1.0] {
        for clear in [0.0, 0.1, 0.5, 0.9, 1.0] {
            add(format!("clear {clear}, {roughness}"), standard(of(roughness, [1.5, 1.0], clear, 0.0)), 1.0);
        }
        for (ior, weight) in [(1.0, 1.0), (1.5, 0.0), (1.5, 100.0), (1e4, 1.0), (1e8, 1.0)] {
            let surface = of(roughness, [ior, weight], 0.0, 0.0);
            add(format!("ior {ior} by {weight}, {roughness}"), standard(surface), 1.0);
        }
        add(format!("half a metal, {roughness}"), standard(of(roughness, [1.5, 1.0], 0.5, 0.5)), 1.0);
        let coat = StandardCoat { weight: 1.0, ior: 1e4, roughness, ..StandardCoat::default() };
        add(format!("coat, {roughness}"), standard(StandardSurface { coat, ..of(0.3, [1.5, 1.0], 0.5, 0.0) }), 0.0);
        let plastic = of(roughness, [1.5, 1.0], 0.0, 0.0);
        for thickness in [0.0, 0.4, 1e3] {
            let thin_film = StandardThinFilm { weight: 1.0, thickness, ior: 1.4 };
            for (base, surface) in [("plastic", plastic), ("glass", of(roughness, [1.5, 1.0], 1.0, 0.0))] {
                let surface = StandardSurface { thin_film, ..surface };
                add(format!("film of {thickness} on {base}, {roughness}"), standard(surface), 0.9);
            }
        }
        for weight in [0.3, 1.0] {
            let fuzz = StandardFuzz { weight, color: Rgb::WHITE, roughness };
            add(format!("fuzz {weight}, {roughness}"), standard(StandardSurface { fuzz, ..plastic }), 0.9);
        }
        for clear in [0.0, 0.5, 1.0] {
            let subsurface = StandardSubsurface { weight: 0.7, color: Rgb::WHITE, scatter_anisotropy: 0.0 };
            let pane = StandardSurface { thin_walled: true, subsurface, ..of(roughness, [1.5, 1.0], clear, 0.0) };
            add(format!("thin wall, clear {clear}, {roughness}"), standard(pane), 1.0);
        }
        for coverage in [0.01, 0.5] {
            add(format!("coverage {coverage}, {roughness}"), standard(plastic).with_coverage(coverage), 1.0);
        }
        for n in [1.0, 30.0, 1e5] {
            // A sky's light returns by ks, whatever the exponent is.
            add(format!("highlights of {n}, {roughness}"), phong([0.3, 0.5, 0.2, 1.0], n, roughness), 0.8);
        }
        for eta in [1.0, 1.0001, 1.5, 1e4, 1e8] {
            add(format!("dielectric {eta}, {roughness}"), dielectric(eta, roughness), 1.0);
        }
        add(format!("nothing, {roughness}"), conductor(1.0, 0.0, roughness), 0.0);
        add(format!("gold, {roughness}"), conductor(0.2, 3.0, roughness), 0.8);
        add(format!("tiny η, {roughness}"), conductor(1e-30, 1e-30, roughness), 1.0);
        add(format!("huge k, {roughness}"), conductor(1.0, 1e30, roughness), 1.0);
        add(format!("huge η, {roughness}"), conductor(1e30, 0.0, roughness), 1.0);
        for [kd, ks, k, opacity] in [[0.5, 0.0, 0.5, 1.0], [0.2, 0.0, 0.3, 0.5], [0.2, 0.2, 0.2, 0.6]] {
            add(format!("{kd} {ks} {k} {opacity}, {roughness}"), phong([kd, ks, k, opacity], 20.0, roughness), 1.0);
        }
    }
    let even = Gradient { stops: vec![(-90.0, Rgb::WHITE), (90.0, Rgb::WHITE)] };
    for (i, (name, material, least)) in all.into_iter().enumerate() {
        let scene = Scene {
            background: Rgb::WHITE,
            environment: (i % 2 == 0).then(|| Environment::new(EnvironmentKind::Gradient(even.clone()))),
            materials: vec![material],
            nodes: vec![node(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 2.0 }), 0)],
            ..Scene::default()
        };
        let pixels = pixels(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, 4);
        let values: Vec<f64> = pixels.iter().map(|pixel| pixel.g.into()).collect();
        assert!(values.iter().all(|v| *v >= 0.0 && v.is_finite()), "{name}: {values:?}");
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let error = (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n * n)).sqrt();
        let slack = 5e-3 + 3.5 * error;
        assert!(mean <= 1.0 + slack && mean >= least - slack, "{name}: {mean} ± {error}, not {least}");
        assert!(error < 0.04, "{name}: {error}");
    }
}

/// A sharp highlight returns the light of a lamp and of a sky as a mirror of its ks does.
#[test]
fn a_sharp_highlight_is_a_mirror() {
    let sky = Gradient { stops: vec![(-90.0, Rgb::gray(0.2)), (0.0, Rgb::WHITE), (90.0, Rgb::new(0.1, 0.3, 0.9))] };
    let of = |phong: Phong| {
        let lamp = Phong { emission: Rgb::gray(3.0), ..matte(0.0) };
        let scene = Scene {
            environment: Some(Environment::new(EnvironmentKind::Gradient(sky.clone()))),
            materials: vec![Material::new("ball", phong), Material::new("lamp", lamp)],
            nodes: vec![
                node(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 2.0 }), 0),
                node(Shape::Sphere(Sphere { center: Vec3::new(3.0, 4.0, 5.0), radius: 2.0 }), 1),
            ],
            ..Scene::default()
        };
        mean(&scene, [Vec3::Z * 5.0, Vec3::ZERO], PATH, 64)
    };
    let color = Rgb::new(0.4, 0.5, 0.6);
    let ((gloss, error), (mirror, _)) =
        (of(Phong { ks: color, n: 3e4, ..matte(0.3) }), of(Phong { k: color, ..matte(0.3) }));
    assert!((gloss - mirror).abs() < 3.3 * error + 2e-3 * mirror, "{gloss} ± {error}, not {mirror}");
    assert!(error < 0.03 * mirror, "{error}");
}
