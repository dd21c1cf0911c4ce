use super::*;
use crate::assets::{AssetPath, MemoryAssets};
use crate::content::Content;
use canaletto::math::Rgb;
use glam::{Vec2, Vec3};
use proptest::prelude::*;

fn load(text: &str, others: &[(&str, &str)]) -> Result<ObjContent, Diagnostics> {
    let mut files = MemoryAssets::new().with("a.obj", text);
    for (name, text) in others {
        files = files.with(name, *text);
    }
    load_content(&files)
}

/// The content of the file `a.obj` among these.
fn load_content(files: &MemoryAssets) -> Result<ObjContent, Diagnostics> {
    let (fragment, warnings) = super::super::load_objects("a.obj", files, &AssetPath::base())?;
    let mut pictures = Pictures::default();
    (pictures.images, pictures.textures) = (fragment.images, fragment.textures);
    Ok(ObjContent { meshes: fragment.meshes, materials: fragment.materials, pictures, warnings })
}

fn good(text: &str) -> ObjContent {
    load(text, &[]).unwrap()
}

fn error(text: &str) -> String {
    load(text, &[]).unwrap_err().to_string()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn polygons_become_triangles() {
    let model = good(&format!("{SQUARE}f 1 2 3 4\nf -4 -3 -2\n"));
    let mesh = &model.meshes[0];
    assert_eq!((mesh.name.as_str(), mesh.positions.len()), ("a.obj", 4));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert!(mesh.normals.is_empty() && mesh.uvs.is_empty() && mesh.colors.is_empty() && mesh.materials.is_empty());
    assert!(model.warnings.is_empty());
}

#[test]
fn faces_may_come_first_and_lines_may_go_on() {
    let model = good("f 1 2 \\\n 3\nv 0 0 0\nv 1 0 0\nv 1 1 0 # corner\nf 1 3 2 # back\n");
    assert_eq!(model.meshes[0].triangles, [[0, 1, 2], [0, 2, 1]]);
}

#[test]
fn corners_are_shared_where_all_their_indices_agree() {
    let text =
        format!("{SQUARE}vt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/2/1 4/1/1\nf 1//1 2//1 4//1\n");
    let mesh = &good(&text).meshes[0];
    assert_eq!(mesh.positions.len(), 8);
    assert_eq!((mesh.triangles[0][0], mesh.triangles[1][0]), (0, 0));
    assert_ne!(mesh.triangles[0][2], mesh.triangles[1][1]);
    assert_eq!((mesh.uvs.len(), mesh.normals.len(), mesh.uvs[mesh.triangles[1][1] as usize]), (8, 8, Vec2::X));
}

#[test]
fn missing_and_zero_normals_come_from_the_faces() {
    let mesh = &good(&format!("{SQUARE}vn 0 0 0\nvn 0 1e-30 0\nf 1//1 2//2 3\n")).meshes[0];
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Y, Vec3::Z]);
}

#[test]
fn vertex_colours_are_srgb_and_weights_are_ignored() {
    let mesh = &good("v 0 0 0 1 0.735357 0\nv 1 0 0 0.5\nv 0 1 0\nf 1 2 3\n").meshes[0];
    assert!((mesh.colors[0].g - 0.5).abs() < 1e-5 && mesh.colors[0].r == 1.0);
    assert_eq!(mesh.colors[1..], [Rgb::WHITE; 2]);
}

#[test]
fn objects_and_groups_are_meshes_and_go_on() {
    let text = format!("{SQUARE}o cup\nf 1 2 3\ng handle\nf 1 2 4\no cup\nf 1 3 4\no cup\ng cup\nf 2 3 4\ng empty\n");
    let model = good(&text);
    let found: Vec<(&str, usize)> = model.meshes.iter().map(|m| (m.name.as_str(), m.triangles.len())).collect();
    assert_eq!(found, [("cup", 3), ("cup/handle", 1)]);
    assert_eq!((model.meshes[0].positions.len(), model.meshes[1].positions.len()), (4, 3));
}

#[test]
fn one_mesh_holds_several_materials() {
    let text = format!(
        "mtllib m.mtl\n{SQUARE}usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\nusemtl red\nf 1 2 4\nusemtl no\nf 2 3 4\n"
    );
    let model = load(&text, &[("m.mtl", "newmtl blue\nKd 0 0 1\nnewmtl red\nKd 1 0 0\n")]).unwrap();
    let mesh = &model.meshes[0];
    assert_eq!(
        (model.meshes.len(), mesh.slots.as_slice(), mesh.materials.as_slice()),
        (1, &[0, 1, 0, 2][..], &[1, 0, 2][..])
    );
    let names: Vec<&str> = model.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["blue", "red", "default"]);
    let warnings = model.warnings.to_string();
    assert!(
        warnings.contains("a.obj:12:8: warning: `no` is no material of this file; its faces get the default"),
        "{warnings}"
    );
}

#[test]
fn one_material_needs_no_slots() {
    let model = load(&format!("mtllib m.mtl\n{SQUARE}usemtl red\nf 1 2 3 4\n"), &[("m.mtl", "newmtl red\n")]).unwrap();
    assert_eq!((&model.meshes[0].slots[..], &model.meshes[0].materials[..]), (&[][..], &[0][..]));
}

#[test]
fn material_files_may_have_spaces_or_be_many_or_missing() {
    let red = ("my red.mtl", "newmtl red\n");
    let model = load(&format!("mtllib my red.mtl\n{SQUARE}f 1 2 3\n"), &[red]).unwrap();
    assert_eq!(model.materials.len(), 1);
    let model = load(
        &format!("mtllib b.mtl sub\\c.mtl no.mtl\n{SQUARE}f 1 2 3\n"),
        &[("b.mtl", "newmtl b"), ("sub/c.mtl", "newmtl c")],
    );
    let model = model.unwrap();
    assert_eq!((model.materials.len(), model.warnings.len()), (2, 1));
    assert!(
        model.warnings.to_string().contains("a.obj:1:24: warning: there is no file \"no.mtl\""),
        "{}",
        model.warnings
    );
    let outside = load(&format!("mtllib ../b.mtl\n{SQUARE}f 1 2 3\n"), &[]).unwrap();
    assert!(outside.warnings.to_string().contains("outside"), "{}", outside.warnings);
    assert!(outside.materials.is_empty());
}

#[test]
fn what_is_left_out_is_told_once_with_its_count() {
    let warnings = good(&format!("{SQUARE}s 1\ns off\ns soft\ns hard\nl 1 2\nf 1 2\nvp 1 2\nf 1 2 3\n")).warnings;
    let text = warnings.to_string();
    assert!(
        text.contains("a.obj:7:1: warning: `s` names no group of smooth faces") && text.contains("(2 times)"),
        "{text}"
    );
    assert!(text.contains("`l` is left out: lines and points have no area"), "{text}");
    assert!(text.contains("`f` with fewer than 3 corners is left out") && text.contains("`vp` is left out"), "{text}");
    let garbage: String = (0..100).map(|i| format!("word{i} 1\n")).collect();
    assert_eq!(good(&format!("{garbage}{SQUARE}f 1 2 3\n")).warnings.len(), 25);
}

#[test]
fn missing_normals_and_texture_coordinates_are_warnings() {
    let model = good(&format!("{SQUARE}f 1/1/1 2/2/2 3/3/0\n"));
    assert!(model.meshes[0].normals.is_empty() && model.meshes[0].uvs.is_empty());
    let text = model.warnings.to_string();
    assert!(
        text.contains("a.obj:5:3: warning: `f` refers to normals that don't exist; they are computed (3 times)"),
        "{text}"
    );
}

#[test]
fn spaces_in_names_may_be_escaped() {
    let text = format!("mtllib no.mtl my\\ own.mtl\n{SQUARE}f 1 2 3\n");
    let model = load(&text, &[("my own.mtl", "newmtl red\n")]).unwrap();
    assert_eq!((model.materials.len(), model.warnings.len()), (1, 1));
}

#[test]
fn errors_name_line_and_reason() {
    for (text, message) in [
        ("f 1 2 9", "a.obj:5:7: error: face refers to vertex 9, but only 4 exist\n5 | f 1 2 9\n  |       ^\n"),
        ("f 1 2 0", "a.obj:5:7: error: face refers to vertex 0, but they are counted from 1"),
        ("f 1 2 -5", "face refers to vertex -5, but only 4 come before it"),
        ("f 1 2 x", "\"x\" is not a corner: v, v/vt, v//vn or v/vt/vn, each a whole number"),
        ("f 1///4 2 3", "\"1///4\" is not a corner"),
        ("f 1////4 2 3", "\"1////4\" is not a corner"),
        ("f 1 2 99999999999999999999", "is not a corner"),
        ("v 1 2", "a.obj:5:1: error: vertex needs 3 numbers, and here are 2"),
        ("v 1 2 nun", "a.obj:5:7: error: vertex: \"nun\" is not a number"),
        (
            "v 1,5 2,5 3",
            "\"1,5\" is not a number\n5 | v 1,5 2,5 3\n  |   ^^^\n  help: a decimal point is expected, not a comma",
        ),
        (
            "v 1.0-2.5-3.0",
            "\"1.0-2.5-3.0\" is not a number\n5 | v 1.0-2.5-3.0\n  |   ^^^^^^^^^^^\n  help: there may be a space",
        ),
        ("vn 1 1", "normal needs 3 numbers"),
        ("# nothing", "a.obj: error: there are no faces in it\n  help: an OBJ file has lines such as `f 1 2 3`"),
    ] {
        let found = error(&format!("{SQUARE}{text}\n"));
        assert!(found.contains(message), "{text}: {found}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_warnings() {
    let text = format!(
        "{SQUARE}v nan 0 0\nv 0 1e40 0\nv -1.#IND 1 1\nvt nan 1\nvt 0.25 0.25\nvn -nan(ind) 0 0\nvn 0 0 1\n\
        f 1/1/1 2/2/2 3/2/2\nf 1 2 5\nf 1 2 3 6\nf 4 2 1\n"
    );
    let model = good(&text);
    let mesh = &model.meshes[0];
    assert_eq!(mesh.triangles.len(), 2);
    mesh.check().unwrap();
    let [a, b, _] = mesh.triangles[0].map(|i| i as usize);
    assert_eq!((mesh.normals[a], mesh.uvs[a], mesh.uvs[b]), (Vec3::Z, Vec2::ZERO, Vec2::new(0.25, 0.75)));
    let told = model.warnings.to_string();
    for part in [
        "a.obj:5:1: warning: `v` has no finite place, and faces that use it are left out (3 times)",
        "`vt` isn't finite and counts as 0 0",
        "`vn` isn't finite; normals there are computed",
        "a.obj:13:1: warning: `f` uses a vertex without a finite place and is left out (2 times)",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    // A vertex that no face uses doesn't affect the others.
    let model = good(&format!("{SQUARE}v nan nan nan\nf 1 2 3 4\n"));
    assert_eq!((model.meshes[0].triangles.len(), model.warnings.len()), (2, 1));
    model.meshes[0].check().unwrap();
    assert!(error("v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").contains("none of its faces has three corners"));
}

#[test]
fn vertex_colours_of_every_scale_are_read() {
    let colors = |most: &str, half: &str| {
        let text = format!("v 0 0 0 {most} 0 0\nv 1 0 0 0 {half} 0\nv 0 1 0\nf 1 2 3\n");
        let model = good(&text);
        (model.meshes[0].colors.clone(), model.warnings.to_string())
    };
    let (unit, warnings) = colors("1", "0.501961");
    assert_eq!((warnings.as_str(), unit[0], unit[2]), ("", Rgb::new(1., 0., 0.), Rgb::WHITE));
    for (most, half, told) in [
        ("255", "128", "a.obj: warning: vertex colours go up to 255: they are read as shares of 255"),
        ("200", "128", "shares of 255"),
        ("65535", "32896", "shares of 65535"),
    ] {
        let (found, warnings) = colors(most, half);
        assert!(warnings.contains(told), "{warnings}");
        assert!((found[1].g - unit[1].g).abs() < 1e-5 && found[2] == Rgb::WHITE, "{found:?}");
    }
    // Small deviations from 0 and 1 are rounding.
    let (found, warnings) = colors("1.00001", "-1e-5");
    assert!((found[0].r - 1.0).abs() < 1e-4 && found[1].g == 0.0, "{found:?}");
    assert!(
        warnings.contains("a.obj:2:1: warning: `v` has a colour with numbers below 0, which count as 0"),
        "{warnings}"
    );
    assert_eq!(colors("nan", "0").0[0], Rgb::WHITE);
    assert!(colors("1e9", "0").0.is_empty() && colors("1e9", "0").1.contains("are left out"));
    // Comments are no colours, with or without a space.
    assert!(good("v 0 0 0 # 1 1 1\nv 1 0 0#0 0 0\nv 0 1 0\nf 1 2 3#4 5\n").meshes[0].colors.is_empty());
}

#[test]
fn texture_coordinates_are_counted_from_the_top() {
    let mesh = &good(&format!("{SQUARE}vt 0 0\nvt 1 0.25\nvt 0.5\nf 1/1 2/2 3/3\n")).meshes[0];
    assert_eq!(mesh.uvs, [Vec2::new(0., 1.), Vec2::new(1., 0.75), Vec2::new(0.5, 1.)]);
}

#[test]
fn words_may_be_in_capitals_or_without_spaces() {
    let plain = good("v 0 0 0\nv 1 0 0\nv 0 -1 0\nvt 0 0\nvn 0 0 1\no a\nf 1/1/1 2/1/1 3/1/1\n");
    let odd = good("V 0 0 0\r\tV 1.0e+00\t0 0\rv0 -1.0D0 0\nVT0 0\nVn 0 0 1\nO a\nF-3/1/1 2/1/1 \\ \t\n 3/1/1\n");
    assert_eq!(odd.meshes, plain.meshes);
    assert!(odd.warnings.is_empty(), "{}", odd.warnings);
}

#[test]
fn utf_16_is_read() {
    let text = format!("\u{feff}{SQUARE}o \u{e9}\nmtllib m.mtl\nusemtl gr\u{fc}n\nf 1 2 3 4\nf 1 2 9\n");
    let library = "newmtl gr\u{fc}n\nKd 0 1 0\n";
    for order in [u16::to_le_bytes, u16::to_be_bytes] {
        let wide = |text: &str| text.encode_utf16().flat_map(order).collect::<Vec<u8>>();
        let load = |text: &str| {
            let assets = MemoryAssets::new().with("a.obj", wide(text)).with("m.mtl", wide(library));
            load_content(&assets)
        };
        let model = load(&text.replace("f 1 2 9\n", "")).unwrap();
        assert_eq!((model.meshes[0].name.as_str(), model.materials[0].name.as_str()), ("\u{e9}", "gr\u{fc}n"));
        assert_eq!(model.meshes[0].materials, [0]);
        let wrong = load(&text).unwrap_err().to_string();
        assert!(wrong.contains("a.obj:9:7: error: face refers to vertex 9, but only 4 exist\n9 | f 1 2 9"), "{wrong}");
    }
}

#[test]
fn material_names_are_bytes() {
    let load = |obj: &[u8], mtl: &[u8]| {
        let text = [b"mtllib m.mtl\n".as_slice(), SQUARE.as_bytes(), b"usemtl ", obj, b"\nf 1 2 3\n"].concat();
        let assets = MemoryAssets::new().with("a.obj", text).with("m.mtl", [b"newmtl x\nnewmtl ", mtl, b"\n"].concat());
        let model = load_content(&assets).unwrap();
        let materials = model.meshes[0].materials.iter().map(|m| model.materials[*m as usize].name.clone());
        (materials.collect::<Vec<_>>(), model.warnings.to_string())
    };
    let none = String::new();
    assert_eq!(load(b"gr\xfcn", b"gr\xfcn"), (vec!["gr\u{fc}n".into()], none.clone()));
    // One file in UTF-8, the other in Latin-1.
    assert_eq!(load("gr\u{fc}n".as_bytes(), b"gr\xfcn"), (vec!["gr\u{fc}n".into()], none.clone()));
    assert_eq!(load(b"\xc1\xc2", b"\xc1\xc2").0.len(), 1);
    assert_eq!(load(b"\xc1\xc2", b"\xc1\xc3").0.len(), 0);
    assert_eq!(load(b"Material #25", b"Material #25"), (vec!["Material #25".into()], none));
    for (obj, mtl) in [("RED", "red"), ("red # nice", "red"), ("red", "red # nice"), ("\"red\"", "red")] {
        let (names, warnings) = load(obj.as_bytes(), mtl.as_bytes());
        assert_eq!(names, [mtl]);
        assert!(warnings.contains("but for capitals, quotes or a comment"), "{warnings}");
    }
}

#[test]
fn material_files_are_found_beside_the_model() {
    let red = ("m.mtl", "newmtl red\n");
    let found = |names: &str| {
        let files = [red, ("own b.mtl", "newmtl blue\n"), ("sub/c.mtl", "newmtl green\n")];
        let model = load(&format!("mtllib {names}\n{SQUARE}f 1 2 3\n"), &files).unwrap();
        let names: Vec<String> = model.materials.iter().map(|m| m.name.clone()).collect();
        (names.join(" "), model.warnings.warnings(), model.warnings.to_string())
    };
    for (names, materials, warnings) in [
        ("m.mtl", "red", 0),
        ("\"m.mtl\"", "red", 1),
        ("'m.mtl'", "red", 1),
        ("./m.mtl", "red", 0),
        (".\\m.mtl", "red", 0),
        ("sub\\c.mtl", "green", 0),
        ("\"own b.mtl\"", "blue", 1),
        ("own b.mtl", "blue", 0),
        ("own\\ b.mtl", "blue", 0),
        ("m.mtl # all of them", "red", 0),
        ("m.mtl own b.mtl sub/c.mtl", "red blue green", 0),
        ("\"m.mtl\" \"own b.mtl\"", "red blue", 2),
        ("m.mtl m.mtl", "red", 0),
        ("C:\\Users\\some one\\m.mtl", "red", 1),
        ("\"C:\\Users\\some one\\own b.mtl\"", "blue", 1),
        ("/home/someone/m.mtl", "red", 1),
        ("//server/share/m.mtl", "red", 1),
        ("file:///home/m.mtl", "red", 1),
        ("../other/m.mtl", "red", 1),
        ("textures/m.mtl", "red", 1),
        ("M.MTL", "red", 1),
        ("OWN B.mtl", "blue", 1),
        ("C:m.mtl", "red", 1),
        ("C:\\a\\m.mtl D:\\b\\own b.mtl", "red blue", 2),
        ("m.mtl none.mtl", "red", 1),
        ("none.mtl", "", 1),
        ("", "", 0),
    ] {
        let (got, count, told) = found(names);
        assert_eq!((got.as_str(), count), (materials, warnings), "{names}: {told}");
        if warnings > 0 && !materials.is_empty() && !names.contains("none") {
            let said = ["which lies beside the model, is read instead", "is read without its quotes"];
            assert!(said.iter().any(|words| told.contains(words)), "{told}");
        }
    }
    let many = "x.mtl ".repeat(1000);
    assert_eq!(found(&format!("m.mtl {many}")).1, 256);
}

#[test]
fn many_groups_and_shared_corners_stay_fast() {
    let mut text = SQUARE.to_owned();
    for i in 0..20_000 {
        text += &format!("vt {i} 0\ng {}\nf 1/{n} 2/{n} 3/{n}\n", i % 7000, n = i + 1);
    }
    let start = std::time::Instant::now();
    assert_eq!(good(&text).meshes.len(), 7000);
    assert!(start.elapsed().as_secs() < 5);
}

/// Reads a file in every manner: in pieces of a few bytes and at once, from memory and from a disk, by one thread and
/// by three. Returns meshes, materials and all messages, or the mistakes.
fn every_way(text: &[u8]) -> Result<ObjContent, String> {
    let assets = MemoryAssets::new().with("a.obj", text).with("m.mtl", "newmtl red\nnewmtl blue\nwhat 1\n");
    let mut file = tempfile::tempfile().unwrap();
    std::io::Write::write_all(&mut file, text).unwrap();
    let memory = assets.open("a.obj", &AssetPath::base()).unwrap();
    let disk = OpenAsset { path: memory.path.clone(), content: Content::File(file, text.len()) };
    let read = |asset: &OpenAsset, size: usize| {
        let text = Text { view: asset.content.view(), size };
        read_pieces(asset, &assets, text, DefaultShading::Flat).map_err(|errors| errors.to_string())
    };
    let expected = read(&memory, text.len().max(1));
    let told = |result: &Result<ObjContent, String>| match result {
        Ok(model) => format!("{:?} {:?} {}", model.meshes, model.materials, model.warnings),
        Err(message) => message.clone(),
    };
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for size in [1, 2, 3, 5, 8, 13, 40, 200] {
            let found = pool.install(|| read(if size % 2 == 0 { &memory } else { &disk }, size));
            assert_eq!(told(&found), told(&expected), "{threads} threads, pieces of {size}");
        }
    }
    expected
}

#[test]
fn pieces_change_nothing() {
    let model = every_way(
        b"\xef\xbb\xbff 1 2 3\r\n\r\nmtllib m.mtl\rv 0 0 0\nv 1 0 \\\r\n 0\nv 1 1 0 1 0 0\nusemtl red\n# c \\\nf -1 -2 -3\n\
        \n\n\\\n\nv 0 1 0\nf 1 2 3 \\\n 4\nusemtl blue\nf -4 -3 -1\ns 1\nvn 0 0 1\ng a\nf 1//1 2//1 3//-1\nf 1/9 2 3\n\
        usemtl none\ns 2\nl 1 2\nf 2 3\nf 2 3 4\n",
    );
    let model = model.unwrap();
    assert_eq!((model.meshes.len(), model.materials.len()), (2, 3));
    assert_eq!(model.meshes[0].slots, [0, 1, 1, 1, 2]);
    assert_eq!(model.meshes[1].triangles.len(), 3);
    // Only the first mistake is reported; those of vertices precede those of faces.
    for (text, message) in [
        ("v 1 2 3\nf 1 1 4\nf 1 1 5\nf x\n", "a.obj:2:7: error: face refers to vertex 4, but only 1 exist"),
        ("v 1 2 3\nf 1 1 -2\nv 1 2 3\nf 1 1 9\n", "a.obj:2:7: error: face refers to vertex -2, but only 1 come"),
        ("f 1 2 3\nv 1 2 3\nv 1 2\nv 1\n", "a.obj:3:1: error: vertex needs 3 numbers, and here are 2"),
    ] {
        let told = every_way(text.as_bytes()).unwrap_err();
        assert!(told.starts_with(message), "{told}");
    }
}

#[test]
fn plain_files_keep_their_vertices() {
    let mesh = &good(&format!("v 9 9 9\n{SQUARE}f 2 3 4 5\n")).meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles[0]), (5, [1, 2, 3]));
    let both = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 2\nvn 0 0 1\nvn 0 0 1\nvn 0 0 1\nf 4/4/4 3/3/3 1/1/1\n";
    let mesh = &good(&format!("{SQUARE}{both}")).meshes[0];
    assert_eq!((mesh.triangles[0], mesh.uvs[2], mesh.normals[0]), ([3, 2, 0], Vec2::X, Vec3::Z));
    // Texture coordinates that differ between the corners of a vertex.
    let mesh = &good(&format!("{SQUARE}vt 5 5\n{both}f 1/1 2/2 3/3\n")).meshes[0];
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
}

proptest! {

    #![proptest_config(crate::testing::seeded())]

    #[test]
    fn pieces_never_change_anything(lines in prop::collection::vec(prop::sample::select(vec![
        "v 0 0 0", "v 1 0 0", "v 0 1 0 0.5 0 0", "v 1 1 \\\n 1", "vt 0 1", "vn 0 0 1", "f 1 2 3", "f 1/1 2/2 3/3", "f 1//1 2//1 3//1",
        "f -1 -2 -3", "f 1 2 3 4", "f 3 2 1 # back \\", "# v \\", "usemtl red", "usemtl blue", "usemtl no", "g a", "g b", "o c", "s 1",
        "l 1 2", "mtllib m.mtl", "", "\\", "\r", "f 1 2", "what 1", "fo 2 3 1", "f 1/9/9 2 3", " \tv 3 1 2 \r",
    ]), 0..40), broken in prop::sample::select(vec!["", "", "v 1", "f 1 2 x", "f 1 2 99", "f 0 1 2", "v 1e40 0 0"])) {
        let mut text = "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 2 2 0\n".to_owned();
        for (i, line) in lines.iter().enumerate() {
            text += line;
            text += if i % 5 == 4 { "\r\n" } else { "\n" };
            if i == 17 {
                text += broken;
                text += "\n";
            }
        }
        let _ = every_way(text.as_bytes());
    }
}

/// A picture of one column: red above blue.
fn red_over_blue() -> Vec<u8> {
    use crate::picture::{EncodeSettings, Image, PictureFormat};
    let image = Image::from_rgb(1, 2, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].into_iter());
    let srgb = canaletto::scene::Transfer::Srgb;
    PictureFormat::Png.encode_image(&image, srgb, &EncodeSettings::default(), &[]).unwrap()
}

#[test]
fn pictures_of_materials_are_textures() {
    use canaletto::material::{Parameter, Target};
    use canaletto::texture::{TextureKind, Wrap};
    let text = format!("mtllib sub/m.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n");
    let library = "newmtl a\nKd 0.5\nmap_Kd ../wood.png\nmap_d C:\\work\\Wood.png\n\
        newmtl b\nmap_Kd -clamp on ../wood.png\nmap_Ke none.png\nmap_Ks ../../out.png\nnorm ../m.txt\n";
    let files = MemoryAssets::new().with("a.obj", text.as_str()).with("sub/m.mtl", library);
    let files = files.with("wood.png", red_over_blue()).with("sub/Wood.png", red_over_blue()).with("m.txt", "x");
    let ObjContent { materials, pictures, warnings, .. } = load_content(&files).unwrap();
    // One image for each file, one texture for each way of using it.
    assert_eq!((pictures.images.len(), pictures.textures.len()), (2, 3));
    let [a, b] = &materials[..] else { panic!("there are two materials") };
    let targets: Vec<Target> = a.textures.iter().map(|used| used.target).collect();
    assert_eq!(targets, [Target::Parameter(Parameter::Diffuse), Target::Cutout]);
    assert_eq!(a.textures[0].range, [0.0, 0.5]);
    assert_eq!(b.textures.len(), 1);
    let TextureKind::Image(clamped) = &pictures.textures[b.textures[0].texture as usize].kind else { panic!() };
    assert_eq!(clamped.wrap, [Wrap::Clamp; 2]);
    let warnings = warnings.to_string();
    for told in [
        "m.mtl:4:7: warning: `map_d` of material `a`: \"C:/work/Wood.png\" lies outside",
        "\"sub/Wood.png\" is read instead",
        "`map_Ke` of material `b`: there is no file \"none.png\"",
        "`map_Ks` of material `b`: \"../../out.png\" lies outside",
        "`norm` of material `b`: \"../m.txt\": it is no image",
    ] {
        assert!(warnings.contains(told), "no {told:?} in:\n{warnings}");
    }
}

/// A picture of one colour.
fn plain_png(color: [f32; 3]) -> Vec<u8> {
    use crate::picture::{EncodeSettings, Image, PictureFormat};
    let image = Image::from_rgb(2, 2, std::iter::repeat_n(color, 4));
    PictureFormat::Png.encode_image(&image, canaletto::scene::Transfer::Srgb, &EncodeSettings::default(), &[]).unwrap()
}

/// Pictures of heights have the model's size in them. One with the colours of normals is one of normals.
#[test]
fn pictures_of_physical_materials_are_textures() {
    use canaletto::Named;
    use canaletto::material::{Parameter, Target};
    let text = format!("mtllib m.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 1 2 4\n");
    let library = "newmtl a\nmap_Bump -bm 0.5 h.png\ndisp -mm 1 2 h.png\nNs 100\nmap_Ns h.png\n\
        newmtl b\nmap_Bump -bm 0.5 n.png\ndisp h.png\n\
        newmtl c\nKd 1 0.5 0\nPr 0.5\nmap_Kd h.png\nmap_Pr h.png\nmap_Pm h.png\nmap_Ps h.png\nmap_Pc \
         h.png\nmap_Pcr h.png\n";
    let files = MemoryAssets::new().with("a.obj", text.as_str()).with("m.mtl", library);
    let files = files.with("h.png", plain_png([0.5; 3])).with("n.png", plain_png([0.5, 0.5, 1.0]));
    let ObjContent { meshes, materials, warnings, .. } = load_content(&files).unwrap();
    assert_eq!(warnings.to_string(), "");
    let bounds =
        meshes[0].positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
    let size = (bounds.1 - bounds.0).length();
    let [a, b, c] = &materials[..] else { panic!("there are three materials") };
    let of = |material: &Material| material.textures.iter().map(|u| (u.target, u.range)).collect::<Vec<_>>();
    let displace = Target::Displace { detail: Target::DEFAULT_DETAIL };
    let exponent = Target::Parameter(Parameter::Exponent);
    assert_eq!(of(a), [(Target::Bump, [0.0, 0.005 * size]), (displace, [1.0, 3.0]), (exponent, [0.0, 100.0])]);
    let normal = Target::Normal { strength: 0.5, down: false };
    assert_eq!(of(b), [(normal, [0.0, 1.0]), (displace, [0.0, 0.02 * size])]);
    let surface = c.standard().unwrap();
    assert_eq!((surface.specular.roughness, surface.base.metalness, surface.fuzz.weight), (0.5, 1.0, 1.0));
    let targets: Vec<&str> = c.textures.iter().map(|used| used.target.name()).collect();
    assert_eq!(targets, ["diffuse", "roughness", "metalness", "fuzz-weight", "coat-weight", "coat-roughness"]);
    assert!(c.textures.iter().all(|used| used.multiply));
    c.check().unwrap();
}
