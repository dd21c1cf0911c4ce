//! Pictures, bumps, normal maps and displacements of objects far from zero equal those of objects near it.

use super::far::{CAMERA, SUN, SURVEY, moved};
use super::*;

/// Waves of several lengths, as grey levels or as a normal map.
fn waves(color: png::ColorType) -> Vec<u8> {
    let side = 64;
    let height = |x: u32, y: u32| {
        let turn = |n: u32| f64::from(n) / f64::from(side) * std::f64::consts::TAU;
        0.5 + 0.25 * libm::sin(turn(2 * x) + libm::cos(turn(y))) + 0.25 * libm::sin(turn(3 * y))
    };
    let mut data = Vec::new();
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let h = height(x, y);
        if color == png::ColorType::Rgb {
            let lean = |other: f64| (128.0 + 400.0 * (h - other)).clamp(0.0, 255.0) as u8;
            data.extend([lean(height(x + 1, y)), lean(height(x, y + 1)), 230]);
        } else {
            data.push((h * 255.0) as u8);
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(color);
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&data)).expect("a picture");
    bytes
}

/// A bent sheet with texture coordinates.
fn sheet(offset: [f64; 3]) -> Vec<u8> {
    let n = 8;
    let mut text = String::new();
    for (i, j) in (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))) {
        let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
        let p = [2.4 * u - 1.2, 0.3 + 0.2 * libm::sin(3.0 * u), 1.6 - 2.0 * v];
        text += &format!("v {} {} {}\nvt {u} {v}\n", p[0] + offset[0], p[1] + offset[1], p[2] + offset[2]);
    }
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let at = |i: i32, j: i32| format!("{0}/{0}", j * (n + 1) + i + 1);
        text += &format!("f {} {} {} {}\n", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
    text.into_bytes()
}

fn with_files(text: &str, sheet_at: [f64; 3]) -> Picture {
    let files = [
        ("waves.png", waves(png::ColorType::Grayscale)),
        ("normals.png", waves(png::ColorType::Rgb)),
        ("s.obj", sheet(sheet_at)),
    ];
    picture_of(scene(text, &files))
}

const MATERIALS: [(&str, &str); 7] = [
    ("diffuse", "texture \"w\""),
    ("bump", "texture \"w\" use=\"bump\" height=0.2 { repeat 2 2 }"),
    ("normal", "texture \"n\" use=\"normal\" { repeat 2 2 }"),
    ("displace", "texture \"w\" use=\"displace\" height=0.2 { detail 60 }"),
    ("displace by bounds", "texture \"w\" use=\"displace\" height=0.15 mapping=\"planar\" { rotate-x -90; detail 60 }"),
    (
        "colour in the object's space on displaced things",
        "texture \"w\" use=\"displace\" height=0.2 { detail 60 }
         texture \"w\" mapping=\"planar\" space=\"object\" { rotate-x -90; translate @0.13 0.21 0.37| }",
    ),
    (
        "displace in the object's space",
        "texture \"w\" use=\"displace\" height=0.15 mapping=\"box\" space=\"object\" { translate @0.13 0.21 0.37|; detail 60 }",
    ),
];

const OBJECTS: &str = "sphere material=\"m\" { center @1.2 0.6 -0.6; radius 0.5 }
box material=\"m\" { min @-1.6 0.2 -1.4; max @-0.8 0.9 -0.7 }
cylinder material=\"m\" { base @0 0.2 -1.4; top @0 1.2 -1.4; radius 0.35 }
";

fn described(material: &str) -> String {
    format!(
        "{CAMERA}texture \"w\" file=\"waves.png\"
texture \"n\" file=\"normals.png\"
material \"m\" {{ kd 0.8 0.7 0.5; ks 0.3; n 20; {material} }}
{SUN}"
    )
}

#[test]
fn reliefs_of_all_kinds() {
    let mut seen: Vec<(&str, Picture)> = Vec::new();
    for (what, material) in MATERIALS {
        let text = format!("{}{OBJECTS}mesh file=\"s.obj\" material=\"m\"\n", described(material));
        let near = with_files(&moved(&text, [0.0; 3]), [0.0; 3]);
        same(what, &with_files(&moved(&text, SURVEY), SURVEY), &near);
        let inside = format!("{OBJECTS}mesh file=\"s.obj\" material=\"m\"\n").replace('@', "");
        for placed in [
            format!("group {{ translate @0 0 0|\n{inside} }}\n"),
            format!("prototype name=\"p\" {{ {inside} }}\ninstance of=\"p\" {{ translate @0 0 0|\n }}\n"),
        ] {
            let there = format!("{}{placed}", described(&material.replace('@', "")));
            same(&format!("{what} by {placed}"), &with_files(&moved(&there, SURVEY), [0.0; 3]), &near);
        }
        for (other, picture) in &seen {
            assert!(difference(&near, picture).0 > 0.005, "{what} looks like {other}");
        }
        seen.push((what, near));
    }
}

/// Pictures projected in world space, moved along with their objects, give an equal picture.
#[test]
fn pictures_projected_in_the_world() {
    for mapping in ["planar", "box", "triplanar"] {
        for used in ["diffuse", "bump"] {
            let height = if used == "bump" { "height=0.2" } else { "" };
            let material = format!(
                "texture \"w\" use=\"{used}\" {height} mapping=\"{mapping}\" space=\"world\" {{ rotate-x -90; scale 2; translate @0.13 0.21 0.37| }}"
            );
            let text = format!("{}{OBJECTS}mesh file=\"s.obj\" material=\"m\"\n", described(&material));
            let near = with_files(&moved(&text, [0.0; 3]), [0.0; 3]);
            same(&format!("{mapping} {used}"), &with_files(&moved(&text, SURVEY), SURVEY), &near);
        }
    }
}
