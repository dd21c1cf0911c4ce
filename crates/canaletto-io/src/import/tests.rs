use super::*;
use crate::assets::{Asset, MemoryAssets};
use proptest::prelude::*;

const OBJ: &str = "mtllib a.mtl\no cube\nv 0 0 0 1 1 1\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 3//1 -1\n";
const MTL: &str = "newmtl m\nKd 0.5 0.5 0.5\nKs 1\nNs 10\nd 0.5\nNi 1.5\nillum 7\nmap_Kd a.png\n";
const NFF: &str = "b 0 0 0\nv\nfrom 1 1 1\nat 0 0 0\nup 0 0 1\nangle 45\nhither 1\nresolution 4 4\nl 1 1 1\nf 1 1 1 1 0 1 0 0\n\
    s 0 0 0 1\nc 0 0 0 1 0 0 1 0\np 4 0 0 0 1 0 0 1 1 0 0 1 0\npp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
    property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
const CSV: &str = "x,y,z,radius,red,green,blue\n1,2,3,0.5,0.1,0.2,0.3\n# c\n4,5,6,0.5,1,0,1\n";

fn files(name: &str, bytes: &[u8]) -> MemoryAssets {
    MemoryAssets::new().with("a.mtl", MTL).with(name, bytes)
}

#[test]
fn a_model_alone_becomes_a_scene() {
    for (name, bytes) in [("a.obj", OBJ), ("a.ply", PLY)] {
        let (scene, _) = load(name, &files(name, bytes.as_bytes()), &Staging::default()).unwrap();
        assert_eq!(scene.meshes.len(), 1);
        assert_eq!((scene.views[0].intrinsics.width, scene.views[0].intrinsics.height), (960, 720));
        assert_eq!(scene.meshes[0].normals.len(), scene.meshes[0].positions.len());
        assert!(scene.nodes.iter().any(|n| n.name.as_deref() == Some("ground")));
        assert!(scene.environment.is_some());
        assert!(scene.nodes.iter().all(|n| n.material.is_none_or(|m| (m as usize) < scene.materials.len())));
        let (classic, _) = load(name, &files(name, bytes.as_bytes()), &Staging::classic()).unwrap();
        assert_eq!(classic.nodes.iter().filter(|n| matches!(n.content, Content::Light(_))).count(), 2);
    }
}

/// The table is what messages, help texts and the reference tell.
#[test]
fn formats_have_extensions_of_their_own_and_are_told() {
    let mut extensions: Vec<&str> = FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
    assert!(extensions.iter().all(|extension| extension.chars().all(|c| matches!(c, 'a'..='z' | '0'..='9'))));
    extensions.sort_unstable();
    extensions.dedup();
    assert_eq!(extensions, super::extensions(), "no extension is there twice");
    let reference = crate::text::reference_markdown();
    let of_meshes = FORMATS.iter().filter(|format| format.holds == Holds::Objects);
    of_meshes.for_each(|format| assert!(reference.contains(format.name), "{}", format.name));
}

/// The text in both byte orders of UTF-16, with and without a byte order mark.
fn utf_16(text: &str) -> Vec<Vec<u8>> {
    let marked = format!("\u{feff}{text}");
    let units = [marked.as_str(), text].map(|text| text.encode_utf16().collect::<Vec<u16>>());
    let orders: [fn(u16) -> [u8; 2]; 2] = [u16::to_le_bytes, u16::to_be_bytes];
    orders.iter().flat_map(|order| units.iter().map(|units| units.iter().copied().flat_map(*order).collect())).collect()
}

#[test]
fn every_text_may_be_utf_16_and_filled_up() {
    let with_text = |name: &str, text: &str| {
        let mut all = utf_16(text);
        if name != "a.ply" {
            all.push(format!("{text}\u{1a}\0\0").into_bytes());
        }
        all
    };
    for (name, text) in [("a.obj", OBJ), ("a.ply", PLY), ("a.nff", NFF)] {
        let plain = load(name, &files(name, text.as_bytes()), &Staging::default()).unwrap();
        for bytes in with_text(name, text) {
            let (scene, warnings) = load(name, &files(name, &bytes), &Staging::default()).unwrap();
            assert_eq!((&scene, warnings.warnings()), (&plain.0, plain.1.warnings()), "{name}: {warnings}");
        }
    }
    for (format, text) in [(cloud::CloudFormat::Text, CSV), (cloud::CloudFormat::Ply, PLY)] {
        let read = |bytes: &[u8]| {
            let asset = Asset { path: AssetPath::new("a", "a", "a"), bytes: bytes.to_vec() };
            cloud::read_spheres(&asset, format, Some(1.0)).map(|(cloud, _)| cloud).map_err(|e| e.to_string())
        };
        let plain = read(text.as_bytes());
        for bytes in with_text(if format == cloud::CloudFormat::Ply { "a.ply" } else { "a.csv" }, text) {
            assert_eq!((read(&bytes), plain.is_ok()), (plain.clone(), true));
        }
    }
}

#[test]
fn staging_grows_with_the_model() {
    let scene = |factor: f32| {
        let text = format!("v 0 0 0\nv {factor} 0 0\nv 0 {factor} {factor}\nf 1 2 3\n");
        load("a.obj", &files("a.obj", text.as_bytes()), &Staging::default()).unwrap().0
    };
    let (small, large) = (scene(1.0), scene(1024.0));
    assert_eq!(small.views[0].extrinsics.eye * 1024.0, large.views[0].extrinsics.eye);
    assert!(scene(1e-20).views[0].extrinsics.eye.length() < 1e-18 && scene(1e20).views[0].extrinsics.eye.is_finite());
}

#[test]
fn other_formats_are_named() {
    let error = |name: &str| load(name, &MemoryAssets::new(), &Staging::default()).unwrap_err().to_string();
    let message = "b/a.STP: error: STEP isn't supported yet\n  help: supported are glb, gltf, nff, obj, ply, stl; FreeCAD converts \
                   it to OBJ or PLY\n";
    assert_eq!(error("b/a.STP"), message);
    assert!(error("a.xyzw").contains("XYZW isn't supported yet") && error("noext").contains("it has no extension"));
    assert_eq!(error("a.obj").lines().next(), Some("a.obj: error: there is no file \"a.obj\""));
    let error = load_objects("a.nff", &MemoryAssets::new(), &AssetPath::base()).unwrap_err().to_string();
    assert!(error.contains("supported are glb, gltf, obj, ply, stl"), "{error}");
}

#[test]
fn bytes_that_are_no_text_keep_their_places() {
    let error = load("a.obj", &files("a.obj", b"# caf\xe9 \xff\xff\nv 1 2 \xe9\n"), &Staging::default())
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("a.obj:2:7: error: vertex:"), "{error}");
}

/// Reads bytes as every format; nothing may panic.
fn read_all(bytes: &[u8]) {
    for name in ["a.obj", "a.ply", "a.nff"] {
        let _ = load(name, &files(name, bytes), &Staging::default());
    }
    let mtl = MemoryAssets::new().with("a.obj", OBJ).with("a.mtl", bytes);
    let _ = load("a.obj", &mtl, &Staging::default());
    let asset = Asset { path: AssetPath::new("a", "a", "a"), bytes: bytes.to_vec() };
    for format in [CloudFormat::Text, CloudFormat::Ply, CloudFormat::Binary] {
        let _ = read_spheres(&asset, format, Some(1.0));
        let _ = read_cylinders(&asset, format, Some(1.0));
    }
}

fn binary_ply() -> Vec<u8> {
    let mut bytes = PLY[..PLY.find("0 0 0\n1").unwrap()].replace("ascii", "binary_big_endian").into_bytes();
    bytes.extend([0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.].iter().flat_map(|v| v.to_be_bytes()));
    bytes.push(4);
    bytes.extend([0i32, 1, 2, 3].iter().flat_map(|v| v.to_be_bytes()));
    bytes
}

proptest! {

    #![proptest_config(crate::testing::seeded())]

    #[test]
    fn mutated_files_never_panic(
        which in 0usize..6,
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0u8..4, any::<u8>(), prop::sample::select(vec![
            "-", "0", "99999999999", "nan", "1e38", " ", "\n", "/", "\\\n", "#", ",", "-1",
        ])), 1..8),
    ) {
        let mut bytes = match which {
            0 => OBJ.as_bytes().to_vec(),
            1 => MTL.as_bytes().to_vec(),
            2 => NFF.as_bytes().to_vec(),
            3 => PLY.as_bytes().to_vec(),
            4 => CSV.as_bytes().to_vec(),
            _ => binary_ply(),
        };
        for (at, kind, byte, word) in edits {
            let at = at.index(bytes.len().max(1)).min(bytes.len());
            match kind {
                0 if at < bytes.len() => bytes[at] = byte,
                1 if at < bytes.len() => { bytes.remove(at); }
                2 => { bytes.splice(at..at, word.bytes()); }
                _ => bytes.truncate(at),
            }
        }
        read_all(&bytes);
    }

    #[test]
    fn random_polygons_never_panic(corners in prop::collection::vec((-3i8..3, -3i8..3, -1i8..1), 3..20)) {
        let mut text: String = corners.iter().map(|(x, y, z)| format!("v {x} {y} {z}\n")).collect();
        text += "f";
        (1..=corners.len()).for_each(|i| text += &format!(" {i}"));
        match load_objects("a.obj", &files("a.obj", text.as_bytes()), &AssetPath::base()) {
            Ok((model, _)) => prop_assert!(model.meshes[0].triangles.len() <= corners.len() - 2),
            Err(errors) => prop_assert!(errors.to_string().contains("nothing in it has an area")),
        }
    }
}
