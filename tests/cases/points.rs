//! Tables of numbers: PLY, point clouds, CSV, XYZ and NFF.

use canaletto::camera::Camera;
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Job, render};
use canaletto::scene::{Node, Scene};
use canaletto::shape::{Mesh, Shape, Sphere, SphereCloud};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::diagnostic::Diagnostics;
use canaletto_io::import::{Staging, load};
use canaletto_io::source::SceneSource;
use canaletto_io::text::{SceneDocument, read_scene};
use glam::{DVec3, Vec3};
use std::time::{Duration, Instant};

/// Files as they occur in practice.
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

/// A model alone, and its messages.
fn model(name: &str) -> (Scene, String) {
    let (scene, said) = load(name, &assets(), &Staging::classic()).unwrap_or_else(|errors| panic!("{errors}"));
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

/// The scene of a text beside the files, and its messages.
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
    // The faces are red in front, green behind, blue right, yellow left, magenta above and cyan below. They are seen
    // unlit along each axis.
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
    // Each face shows the whole picture. The corners of its triangles are corners of the unit square, and each triangle
    // covers half of it.
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.uvs[v as usize]);
        assert!([a, b, c].iter().all(|uv| uv.to_array().iter().all(|v| *v == 0.0 || *v == 1.0)), "{a} {b} {c}");
        assert_eq!((b - a).perp_dot(c - a).abs(), 1.0);
    }
    // Each corner of a face has the coordinates of its row, with v from below.
    let text = text_of("wedge-uv.ply");
    let rows: Vec<Vec<f32>> = text
        .lines()
        .skip_while(|line| *line != "end_header")
        .skip(1)
        .map(|line| line.split(' ').map(|number| number.parse().unwrap()).collect())
        .collect();
    let place = |vertex: f32| Vec3::from_slice(&rows[vertex as usize]);
    let faces = rows.iter().filter(|row| row.len() > 6);
    let faces: Vec<[(Vec3, [f32; 2]); 4]> =
        faces.map(|row| std::array::from_fn(|i| (place(row[1 + i]), [row[6 + 2 * i], 1.0 - row[7 + 2 * i]]))).collect();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| (mesh.positions[v as usize], mesh.uvs[v as usize].to_array()));
        let of = |face: &&[(Vec3, [f32; 2]); 4]| corners.iter().all(|(p, _)| face.iter().any(|(q, _)| p == q));
        let face = faces.iter().find(of).unwrap();
        assert!(corners.iter().all(|corner| face.contains(corner)), "{corners:?} {face:?}");
    }
    assert!(said.contains("a picture that its header names is left out: there is no file \"wall.png\""), "{said}");
}

#[test]
fn headers_of_every_habit_are_read() {
    let plain = text_of("bom.ply").trim_start_matches('\u{feff}').to_owned();
    let expected = load("a.ply", &MemoryAssets::new().with("a.ply", plain), &Staging::classic()).unwrap().0;
    for name in ["header-space.ply", "bom.ply"] {
        assert_eq!((&mesh(&model(name).0).positions, model(name).1), (&mesh(&expected).positions, String::new()));
    }
}

#[test]
fn colours_are_those_of_bytes_or_it_is_said_what_was_assumed() {
    let bytes = text_of("int.ply").replace("property int red", "property uchar red");
    let bytes =
        bytes.replace("property int green", "property uchar green").replace("property int blue", "property uchar blue");
    let expected = load("a.ply", &MemoryAssets::new().with("a.ply", bytes), &Staging::classic()).unwrap().0;
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
    // A box has six flat sides, so every corner has the normal of its triangle.
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
    // Carbon is grey and hydrogen white: sRGB bytes 144 and 255.
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
    let mut script = SceneDocument::of_text(&text, "case.kdl", &assets, &[]).unwrap();
    let frames = script.key_frames();
    assert_eq!(frames.len(), KEYS);
    for (i, frame) in frames.into_iter().enumerate() {
        let (scene, _) = script.scene(&assets, frame).unwrap();
        let canaletto::scene::Content::Shape(canaletto::shape::Shape::Sphere(sphere)) = &scene.nodes[1].content else {
            panic!("a sphere is expected");
        };
        assert_eq!(sphere.center.z, (i % 7) as f32);
    }
    // Evaluation of all keys at each frame would take 2 ms, 16 s in all.
    assert!(start.elapsed() < Duration::from_secs(12), "{:?}", start.elapsed());
}

/// A long text is read in pieces, unless an assignment may change its values. Both give equal scenes.
#[test]
fn many_things_are_read_as_few_are() {
    let mut text =
        String::from("camera { eye 0 0 50; fovy 40; size 8 8 }\nsphere name=\"a\" { center 0 0 0; radius 1 }\n");
    text += "prototype name=\"b\" { box { min 0 0 0; max 1 1 1 } }\n";
    for i in 0..6000 {
        text += &match i % 11 {
            0 => format!("sphere material=\"m{}\" {{ center {i} 0 0; radius 0.5 }};", i % 3000 / 11 * 11 + 7),
            1 => format!("// a comment {{\nbox {{ min {i} 0 0; max {}.5 1 1 }}\n", i),
            2 => format!("/- sphere {{ center {i} 0 }}\nlight \"omni\" {{ position {i} 9 9; intensity 0.001 }}\n"),
            3 => format!("instance of=\"a\" {{ translate {i} 0 0 }}; instance of=\"b\" {{ translate 0 {i} 0 }}\n"),
            4 => format!("light \"rectangle\" name=\"l{i}\" {{ corner {i} 1 2; u 1 0 0; v 0 1 0; intensity 0.1 }}\n"),
            5 => format!("light \"spot\" {{ position {i} 9 9; target 0 0 0; outer 20; shadows #false }}\n"),
            6 => format!("cone {{ base {i} 0 0; top {i} 1 0; radius 1; rotate-x {i} }}\n"),
            7 => format!("material \"m{i}\" {{ kd 0.5 0.25 0; n {i} }}\n"),
            8 => format!("group {{ sphere {{ center 0 {i} 0; radius 0.25 }}; translate 0 0 {i} }}\n"),
            9 => format!("/* {{ */ triangle {{ a {i} 0 0; b {i} 1 0\n c {i} 0 1 }}\n"),
            _ => format!("instance of=\"g{i}\"\ngroup name=\"g{i}\" {{ sphere {{ center 0 0 {i}; radius 2 }} }}\n"),
        };
    }
    let read = |set: &[String]| {
        SceneDocument::of_text(&text, "case.kdl", &MemoryAssets::new(), set).unwrap().scene(&MemoryAssets::new(), 0.0)
    };
    let (few, _) = read(&["camera.fovy=40".into()]).unwrap_or_else(|e| panic!("{e}"));
    let (many, _) = read(&[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(few.nodes.len() > 5000 && few.materials.len() > 500 && few.prototypes.len() > 500);
    assert!(many == few);
    // A mistake is reported at its place, and only once.
    for wrong in
        ["sphere { center 1 2; radius 1 }", "instance of=\"nothing\"", "material \"m7\" { kd 1 1 1 }", "sphere {"]
    {
        let said = |set: &[String]| {
            let text = format!("{text}{wrong}\n");
            match SceneDocument::of_text(&text, "case.kdl", &MemoryAssets::new(), set)
                .map(|mut s| s.scene(&MemoryAssets::new(), 0.0))
            {
                Err(e) | Ok(Err(e)) => e.to_string(),
                Ok(Ok(_)) => panic!("{wrong} is a mistake"),
            }
        };
        assert_eq!(said(&[]), said(&["camera.fovy=40".into()]), "{wrong}");
    }
}

/// Warnings are counted when there are too many to keep. They don't make a scene invalid.
#[test]
fn many_warnings_are_no_error() {
    let unused: String = (0..12_000).map(|i| format!("material \"m{i}\" {{ kd 1 1 1 }}\n")).collect();
    let (scene, warnings) = scene(&format!(
        "camera {{ eye 0 0 5 }}\nlight \"omni\" {{ position 0 0 9 }}\nsphere {{ radius 1; center 0 0 0 }}\n{unused}"
    ));
    assert_eq!(scene.materials.len(), 12_000);
    assert!(!warnings.has_errors() && warnings.to_string().contains("nothing uses the material"), "{warnings}");
}

/// Default values take no memory. A serialised node still contains its transform, and reading restores every field.
#[test]
fn nodes_are_written_and_read_whole() {
    let ball = Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 })).named("ball");
    let there = Transform::translate(DVec3::X);
    let moved = ball.clone().with_transform(&there).with_motion(vec![Transform::IDENTITY, there]);
    for node in [ball, moved] {
        let text = serde_json::to_string(&node).unwrap();
        assert!(text.contains("\"transform\"") && text.contains("\"motion\"") != node.motion.is_usual(), "{text}");
        assert!(serde_json::from_str::<Node>(&text).unwrap() == node);
    }
}
