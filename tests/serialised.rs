//! The names in a serialised scene stay, so that stored scenes can be read again.

use canaletto::light::{DiskLight, Light, LightKind, RectangleLight, SphereLight};
use canaletto::material::{Conductor, Dielectric, Material, Parameter, Phong, StandardSurface, Target, TextureUse};
use canaletto::math::Rgb;
use canaletto::shape::{Disk, Parallelogram, Sphere};
use glam::Vec3;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Value, json};

/// The serialised form, after it was read back as an equal value.
fn serialised<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &T) -> Value {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&text).unwrap(), value);
    serde_json::from_str(&text).unwrap()
}

#[test]
fn lights_with_a_surface_keep_their_numbers_beside_their_points() {
    let kinds = [
        (
            LightKind::Disk(DiskLight { disk: Disk { center: Vec3::X, normal: Vec3::Y, radius: 2.0 }, points: 3 }),
            json!({"disk": {"position": [1.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0], "radius": 2.0, "points": 3}}),
        ),
        (
            LightKind::Sphere(SphereLight { sphere: Sphere { center: Vec3::Z, radius: 0.5 }, points: 4 }),
            json!({"sphere": {"center": [0.0, 0.0, 1.0], "radius": 0.5, "points": 4}}),
        ),
        (
            LightKind::Rectangle(Box::new(RectangleLight {
                parallelogram: Parallelogram { corner: Vec3::ONE, u: Vec3::X, v: Vec3::Z },
                points: 5,
            })),
            json!({"rectangle": {"corner": [1.0, 1.0, 1.0], "u": [1.0, 0.0, 0.0], "v": [0.0, 0.0, 1.0], "points": 5}}),
        ),
    ];
    for (kind, expected) in kinds {
        assert_eq!(serialised(&Light::new(kind, Rgb::WHITE))["kind"], expected);
    }
}

#[test]
fn a_material_names_its_model_and_its_targets() {
    let phong = Phong { kd: Rgb::new(0.5, 0.25, 0.0), n: 7.0, ..Phong::default() };
    let mut material = Material::new("m", phong);
    let targets = [
        (Target::Parameter(Parameter::Diffuse), json!("diffuse")),
        (Target::Parameter(Parameter::Specular), json!("specular")),
        (Target::Parameter(Parameter::Exponent), json!("exponent")),
        (Target::Parameter(Parameter::Mirror), json!("mirror")),
        (Target::Parameter(Parameter::Eta), json!("eta")),
        (Target::Parameter(Parameter::Opacity), json!("opacity")),
        (Target::Parameter(Parameter::Roughness), json!("roughness")),
        (Target::Cutout, json!("cutout")),
        (Target::Displace { detail: 32.0 }, json!({"displace": {"detail": 32.0}})),
    ];
    material.textures = targets.iter().map(|(target, _)| TextureUse::new(0, *target)).collect();
    let written = serialised(&material);
    assert_eq!(written["name"], "m");
    assert_eq!(
        (&written["phong"]["n"], &written["phong"]["kd"][1], &written["coverage"]),
        (&json!(7.0), &json!(0.25), &json!(1.0))
    );
    for (i, (_, expected)) in targets.iter().enumerate() {
        assert_eq!(&written["textures"][i]["target"], expected);
    }
}

#[test]
fn each_model_keeps_its_own_numbers() {
    let gold = Conductor { roughness: 0.25, ..Conductor::named("gold").unwrap() };
    let written = serialised(&Material::new("m", gold));
    assert_eq!((&written["conductor"]["roughness"], &written["phong"]), (&json!(0.25), &Value::Null));
    assert_eq!(serialised(&Material::new("m", Dielectric::new(1.5)))["dielectric"]["eta"], json!(1.5));
    let mut surface = StandardSurface::default();
    surface.coat.weight = 0.5;
    assert_eq!(serialised(&Material::new_standard("m", surface))["standard"]["coat"]["weight"], json!(0.5));
}
