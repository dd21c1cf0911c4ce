//! Tables of numbers: PLY, point clouds, CSV, XYZ and NFF.

use canaletto::camera::Camera;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::Scene;
use canaletto::shape::{Mesh, SphereCloud};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::diagnostic::Diagnostics;
use canaletto_io::import::load;
use canaletto_io::text::{Script, read_scene};
use glam::Vec3;
use std::time::{Duration, Instant};

/// Files that people have.
const FILES: [(&str, &[u8]); 13] = [
    ("face-colour.ply", include_bytes!("points/face-colour.ply")),
    ("wedge-uv.ply", include_bytes!("points/wedge-uv.ply")),
    ("header-space.ply", include_bytes!("points/header-space.ply")),
    ("bom.ply", include_bytes!("points/bom.ply")),
    ("int.ply", include_bytes!("points/int.ply")),
    ("ushort255.ply", include_bytes!("points/ushort255.ply")),
    ("zero.ply", include_bytes!("points/zero.ply")),
    ("nan-points.ply", include_bytes!("points/nan-points.ply")),
    ("nan.csv", include_bytes!("points/nan.csv")),
    ("quoted.csv", include_bytes!("points/quoted.csv")),
    ("mol.xyz", include_bytes!("points/mol.xyz")),
    ("concave.nff", include_bytes!("points/concave.nff")),
    ("concave-dup.nff", include_bytes!("points/concave-dup.nff")),
];

fn assets() -> MemoryAssets {
    FILES.iter().fold(MemoryAssets::new(), |assets, (name, bytes)| assets.with(name, bytes.to_vec()))
}

/// A model alone, and what is said of it.
fn model(name: &str) -> (Scene, String) {
    let (scene, said) = load(name, &assets()).unwrap_or_else(|errors| panic!("{errors}"));
    (scene, said.to_string())
}

fn text_of(name: &str) -> String {
    let (_, bytes) = FILES.iter().find(|(file, _)| *file == name).unwrap();
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn mesh(scene: &Scene) -> &Mesh {
    &scene.meshes[0]
}

fn pixels(scene: Scene) -> Vec<Rgb> {
    let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixels
}

/// The scene of a text, beside the files, and what is said of it.
fn scene(text: &str) -> (Scene, Diagnostics) {
    read_scene("case.kdl", &assets().with("case.kdl", text)).unwrap_or_else(|errors| panic!("{errors}"))
}

const VIEW: &str = "camera { eye 0.3 0.3 6; center 0.3 0.3 0; fovy 40; size 40 30 }\nambient 0.3\nbackground 0.1 0.1 0.3\n\
    light \"directional\" { direction -1 -1 -1 }\n";

fn cloud(words: &str) -> (SphereCloud, String, Vec<Rgb>) {
    let (scene, said) = scene(&format!("{VIEW}spheres {words}\n"));
    (scene.spheres[0].clone(), said.to_string(), pixels(scene))
}

#[test]
fn faces_show_their_colours() {
    let (scene, said) = model("face-colour.ply");
    assert_eq!(said, "");
    // Red in front, green behind, blue to the right, yellow to the left, magenta above, cyan below: seen unlit along each axis.
    for (eye, up, color) in [
        ("0 0 9", "0 1 0", [1.0, 0.0, 0.0]),
        ("0 0 -9", "0 1 0", [0.0, 1.0, 0.0]),
        ("9 0 0", "0 1 0", [0.0, 0.0, 1.0]),
        ("-9 0 0", "0 1 0", [1.0, 1.0, 0.0]),
        ("0 9 0", "0 0 1", [1.0, 0.0, 1.0]),
        ("0 -9 0", "0 0 1", [0.0, 1.0, 1.0]),
    ] {
        let text = format!(
            "camera {{ eye {eye}; center 0 0 0; up {up}; fovy 5; size 4 4 }}\nintegrator \"whitted\" {{ stage \"unlit\" }}\n\
             mesh file=\"face-colour.ply\"\n"
        );
        let (scene, _) = read_scene("case.kdl", &assets().with("case.kdl", text)).unwrap();
        let apart = |pixel: &Rgb| pixel.to_array().iter().zip(color).any(|(a, b): (&f32, f32)| (a - b).abs() > 1e-5);
        assert_eq!(pixels(scene).iter().filter(|pixel| apart(pixel)).count(), 0, "{eye}");
    }
    assert_eq!(mesh(&scene).triangles.len(), 12);
}

#[test]
fn corners_of_faces_have_texture_coordinates() {
    let (scene, said) = model("wedge-uv.ply");
    let mesh = mesh(&scene);
    mesh.check().unwrap();
    // Each face shows the whole picture: its triangles' corners are corners of the unit square, and cover half of it each.
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.uvs[v as usize]);
        assert!([a, b, c].iter().all(|uv| uv.to_array().iter().all(|v| *v == 0.0 || *v == 1.0)), "{a} {b} {c}");
        assert_eq!((b - a).perp_dot(c - a).abs(), 1.0);
    }
    assert!(said.contains("the property texnumber of element face is left out"), "{said}");
    assert!(said.contains("the picture wall.png, which its header names, is left out"), "{said}");
}

#[test]
fn headers_of_every_habit_are_read() {
    let plain = text_of("bom.ply").trim_start_matches('\u{feff}').to_owned();
    let expected = load("a.ply", &MemoryAssets::new().with("a.ply", plain)).unwrap().0;
    for name in ["header-space.ply", "bom.ply"] {
        assert_eq!((&mesh(&model(name).0).positions, model(name).1), (&mesh(&expected).positions, String::new()));
    }
}

#[test]
fn colours_are_those_of_bytes_or_it_is_said_what_was_assumed() {
    let bytes = text_of("int.ply").replace("property int red", "property uchar red");
    let bytes =
        bytes.replace("property int green", "property uchar green").replace("property int blue", "property uchar blue");
    let expected = load("a.ply", &MemoryAssets::new().with("a.ply", bytes)).unwrap().0;
    for (name, kind) in [("int.ply", "whole numbers"), ("ushort255.ply", "16-bit numbers")] {
        let (scene, said) = model(name);
        assert_eq!(mesh(&scene).colors, mesh(&expected).colors);
        let message =
            format!("the colours of its vertices are {kind} up to 255 only; they are taken as sRGB from 0 to 255");
        assert!(said.contains(&message), "{said}");
    }
}

#[test]
fn normals_of_length_zero_are_computed() {
    let (scene, said) = model("zero.ply");
    assert!(said.contains("8 normals have no direction; they are computed from the faces"), "{said}");
    // A box has six flat sides: every corner has the normal of its triangle.
    let mesh = mesh(&scene);
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(i);
        let normal = (b - a).cross(c - a).normalize();
        assert!(triangle.iter().all(|v| (mesh.normals[*v as usize] - normal).length() < 1e-6), "triangle {i}");
    }
}

#[test]
fn rows_without_a_place_are_left_out() {
    let (points, said, picture) = cloud("file=\"nan.csv\"");
    assert_eq!(points.centers, [Vec3::ZERO, Vec3::Y]);
    assert!(
        said.contains("nan.csv: warning: 1 of 3 rows are left out") && said.contains("the first is line 3"),
        "{said}"
    );
    assert_eq!(picture, cloud("radius=0.5 { points 0 0 0  0 1 0 }").2);
    let (points, said, picture) = cloud("file=\"nan-points.ply\" radius=0.4");
    assert_eq!(points.centers, [Vec3::ZERO, Vec3::Y]);
    assert!(said.contains("nan-points.ply: warning: 1 of 3 points are left out"), "{said}");
    assert_eq!(picture, cloud("radius=0.4 { points 0 0 0  0 1 0 }").2);
}

#[test]
fn quoted_numbers_are_numbers() {
    let (points, said, picture) = cloud("file=\"quoted.csv\"");
    assert_eq!((points.centers, said.as_str()), (vec![Vec3::ZERO, Vec3::X], ""));
    assert_eq!(picture, cloud("radius=0.5 { points 0 0 0  1 0 0 }").2);
}

#[test]
fn molecules_are_atoms_of_elements() {
    let (atoms, said, picture) = cloud("file=\"mol.xyz\" radius=0.4");
    assert_eq!((atoms.centers.len(), said.as_str()), (5, ""));
    // Carbon is grey, hydrogen white: as sRGB bytes 144 and 255.
    let grey = 0.278_894_3;
    let rows = format!(
        "radius=0.4 {{ data \"0 0 0 {grey} {grey} {grey}\\n.63 .63 .63 1 1 1\\n-.63 -.63 .63 1 1 1\\n-.63 .63 -.63 1 1 1\\n\
         .63 -.63 -.63 1 1 1\" }}"
    );
    let expected = cloud(&rows).2;
    let apart = |a: &Rgb, b: &Rgb| a.to_array().iter().zip(b.to_array()).any(|(a, b)| (a - b).abs() > 1e-6);
    assert_eq!(picture.iter().zip(&expected).filter(|(a, b)| apart(a, b)).count(), 0);
}

#[test]
fn a_repeated_corner_fills_no_notch() {
    assert_eq!(area(&model("concave.nff").0), 1.75);
    assert_eq!(area(&model("concave-dup.nff").0), 1.75);
}

/// The area of all triangles.
fn area(scene: &Scene) -> f32 {
    let of = |mesh: &Mesh, i: usize| {
        let [a, b, c] = mesh.corners(i);
        (b - a).cross(c - a).length() / 2.0
    };
    scene.meshes.iter().flat_map(|mesh| (0..mesh.len()).map(move |i| of(mesh, i))).sum()
}

#[test]
fn many_keys_take_time_in_proportion() {
    const KEYS: usize = 8000;
    let keys: String = (0..KEYS).map(|i| format!("key {i} 0 0 {}; ", i % 7)).collect();
    let text = format!(
        "camera {{ eye 0 0 50; size 8 8 }}\nlight \"omni\" {{ position 0 0 9 }}\nsphere {{ center {{ {keys} }}; radius 1 }}\n"
    );
    let assets = MemoryAssets::new();
    let start = Instant::now();
    let mut script = Script::of_text(&text, "case.kdl", &assets, &[]).unwrap();
    let frames = script.key_frames();
    assert_eq!(frames.len(), KEYS);
    for (i, frame) in frames.into_iter().enumerate() {
        let (scene, _) = script.scene(&assets, frame).unwrap();
        let canaletto::scene::Content::Shape(canaletto::shape::Shape::Sphere(sphere)) = &scene.nodes[1].content else {
            panic!("a sphere is expected");
        };
        assert_eq!(sphere.center.z, (i % 7) as f32);
    }
    // To judge all keys for each frame takes 2 ms, 16 s in all.
    assert!(start.elapsed() < Duration::from_secs(12), "{:?}", start.elapsed());
}
