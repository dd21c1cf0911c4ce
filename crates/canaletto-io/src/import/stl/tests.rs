use super::super::load_objects;
use crate::assets::{AssetPath, MemoryAssets};
use canaletto::math::Rgb;
use canaletto::scene::Fragment;
use canaletto::texture::srgb_decode;
use glam::Vec3;

type Facet = ([[f32; 3]; 3], u16);

const TWO: [Facet; 2] = [
    ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0),
    ([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-0.0, 1.0, 0.0]], 0),
];

fn binary(header: &[u8], facets: &[Facet]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((facets.len() as u32).to_le_bytes());
    for (corners, attribute) in facets {
        bytes.extend([0; 12]);
        bytes.extend(corners.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(attribute.to_le_bytes());
    }
    bytes
}

fn text(name: &str, corners: &[[[f32; 3]; 3]]) -> String {
    let facet = |corners: &[[f32; 3]; 3]| {
        let vertices = corners.map(|[x, y, z]| format!("      vertex {x} {y} {z}\n")).concat();
        format!("  facet normal 0 0 1\n    outer loop\n{vertices}    endloop\n  endfacet\n")
    };
    format!("solid {name}\n{}endsolid {name}\n", corners.iter().map(facet).collect::<String>())
}

/// What is read, with all messages as text.
fn read(bytes: impl Into<Vec<u8>>) -> (Option<Fragment>, String) {
    let assets = MemoryAssets::new().with("a.stl", bytes);
    match load_objects("a.stl", &assets, &AssetPath::base()) {
        Ok((fragment, said)) => (Some(fragment), said.to_string()),
        Err(said) => (None, said.to_string()),
    }
}

#[test]
fn both_forms_hold_the_same_mesh() {
    let corners = TWO.map(|(corners, _)| corners);
    let forms = [
        binary(b"", &TWO),
        binary(b"solid made by a program", &TWO),
        text("", &corners).into(),
        text("", &corners).to_uppercase().replace('\n', "\r\n").into(),
    ];
    for bytes in forms {
        let (fragment, said) = read(bytes);
        let fragment = fragment.unwrap_or_else(|| panic!("{said}"));
        assert_eq!(said, "");
        assert_eq!(fragment.meshes[0].name, "a.stl");
        // Corners of two facets at one place are one vertex.
        assert_eq!(fragment.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)]);
        assert_eq!(fragment.meshes[0].triangles, [[0, 1, 2], [1, 3, 2]]);
        assert!(fragment.meshes[0].colors.is_empty());
    }
}

#[test]
fn solids_of_a_text_are_objects_with_names() {
    let corners = TWO.map(|(corners, _)| corners);
    let both = text("lower half", &corners[..1]) + &text("upper", &corners[1..]) + "\0\0";
    let (fragment, said) = read(both);
    let fragment = fragment.unwrap();
    assert_eq!(said, "");
    let names: Vec<_> = fragment.nodes.iter().map(|node| node.name.as_deref().unwrap_or_default()).collect();
    assert_eq!(names, ["lower half", "upper"]);
    assert!(fragment.meshes.iter().all(|mesh| mesh.triangles.len() == 1));
}

#[test]
fn facets_have_the_colours_of_both_conventions() {
    let red = |bits: u16| Rgb::new(srgb_decode(f32::from(bits) / 31.0), 0.0, 0.0);
    let with = |attributes: [u16; 2]| [(TWO[0].0, attributes[0]), (TWO[1].0, attributes[1])];
    // VisCAM: red are the bits from 10 on, and bit 15 tells that there is a colour.
    let (fragment, said) = read(binary(b"", &with([1 << 15 | 20 << 10, 0])));
    let colors = &fragment.unwrap().meshes[0].colors;
    assert_eq!((colors[0], colors[3], &*said), (red(20), canaletto::material::Phong::default().kd, ""));
    // Magics: red are the first bits, and bit 15 tells that the colour is the header's.
    let (fragment, _) = read(binary(b"COLOR=\x00\xff\x00\xff,MATERIAL=", &with([20, 1 << 15])));
    let colors = &fragment.unwrap().meshes[0].colors;
    assert_eq!((colors[0], colors[3]), (red(20), Rgb::new(0.0, 1.0, 0.0)));
    assert_eq!(colors.len(), 6, "vertices of two colours are two");
}

#[test]
fn survey_coordinates_of_a_text_keep_their_digits() {
    let text = text("", &[[[0.0; 3]; 3]]).replacen("vertex 0 0 0", "vertex 4080928.02 0 0", 1);
    let text =
        text.replacen("vertex 0 0 0", "vertex 4080928.27 0 0", 1).replacen("vertex 0 0 0", "vertex 4080928 1 0", 1);
    let mesh = &read(text).0.unwrap().meshes[0];
    let x = |corner: usize| mesh.origin.x + f64::from(mesh.positions[corner].x);
    assert!((x(0) - 4_080_928.02).abs() < 1e-6 && (x(1) - 4_080_928.27).abs() < 1e-6, "{}, {}", x(0), x(1));
}

#[test]
fn what_is_odd_is_told() {
    let (fragment, said) = read([binary(b"", &TWO), vec![0; 7]].concat());
    assert!(fragment.is_some() && said.contains("warning: 7 bytes after its 2 triangles are left out"), "{said}");
    let mut holed = TWO;
    holed[0].0[1][2] = f32::NAN;
    let (fragment, said) = read(binary(b"", &holed));
    assert_eq!(fragment.unwrap().meshes[0].len(), 1);
    assert!(said.contains("1 triangles are left out, as a coordinate isn't a finite number"), "{said}");
    let open = text("", &[TWO[0].0]).replace("endsolid", "");
    assert!(read(open).1.contains("it ends within a solid"));
}

#[test]
fn faulty_files_have_messages() {
    let whole = text("", &[TWO[0].0]);
    let cut = &whole[..whole.rfind("vertex").unwrap()];
    let mut many = binary(b"", &TWO);
    many[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let cases: [(Vec<u8>, &str); 9] = [
        (many, "its header counts 4294967295 triangles, which take 214748364834 bytes, but it has 184"),
        (binary(b"", &TWO)[..150].to_vec(), "its header counts 2 triangles, which take 184 bytes, but it has 150"),
        (b"hello".to_vec(), "it has 5 bytes, fewer than the 84 of a header"),
        (Vec::new(), "it has 0 bytes"),
        (binary(b"", &[]), "there are no triangles in it"),
        (b"solid nothing\nendsolid".to_vec(), "there are no triangles in it"),
        (cut.into(), "a.stl:2:3: error: the file ends within this facet"),
        (whole.replace("endloop", "vertex 1 2 3 endloop").into(), "a facet has more than three corners"),
        (whole.replacen("vertex 0 0 0", "vertex 0 zero 0", 1).into(), "y of a vertex: \"zero\" is not a number"),
    ];
    for (bytes, expected) in cases {
        let (fragment, said) = read(bytes);
        assert!(fragment.is_none() && said.contains(expected), "{said}, not {expected}");
    }
}
