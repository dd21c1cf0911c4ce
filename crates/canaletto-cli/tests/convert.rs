//! Tests of `canaletto convert`: its files, its messages, and pictures of what it writes.

mod support;

use serde_json::Value;
use std::fs;
use support::Folder;

/// A scene with what no other form has, in a folder with a model.
const SCENE: &str = r#"
camera { eye 0 1 5; size 24 16 }
material "a wall" { kd 0.6 0.5 0.4 }
box material="a wall" name="block" { min -1 0 -1; max 1 1 1; rotate-y 30 }
light "disk" name="lamp" { position 0 9 0; normal 0 -1 0; radius 1 }
"#;

const MODEL: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl odd/name\nf 1 2 3\n";

#[test]
fn files_of_all_forms() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("m.obj"), MODEL).unwrap();
    fs::write(folder.path("m.mtl"), "newmtl odd/name\nKd 1 0 0\n").unwrap();
    folder.says("convert m.obj n.kdl", 0, &[]);
    folder.says("check n.kdl", 0, &["ok"]);
    assert!(folder.path("n.assets/studio.exr").is_file());
    folder.says("convert m.obj classic.kdl --integrator whitted --light sky --view top", 0, &[]);
    // The same picture.
    folder.says("render m.obj -q --size 24x18 --denoise=none -o a.exr", 0, &[]);
    folder.says("render n.kdl -q --size 24x18 -o b.exr", 0, &[]);
    folder.says("compare a.exr b.exr", 0, &["equal"]);
    for form in ["glb", "gltf", "obj", "ply"] {
        folder.says(&format!("convert s.kdl out.{form}"), 0, &["lost: lights", "\"lamp\""]);
        folder.says(&format!("info out.{form}"), 0, &["12 triangles"]);
        folder.says(&format!("convert s.kdl quiet.{form} -q"), 0, &[]);
    }
    let said = folder.says("convert s.kdl again.GLB --json", 0, &["\"version\""]);
    let json: Value = serde_json::from_str(&said[said.find('{').unwrap()..=said.rfind('}').unwrap()]).unwrap();
    assert_eq!(json["files"], serde_json::json!(["again.GLB"]));
    assert_eq!(json["lost"][0]["names"], serde_json::json!(["lamp"]));
    assert!(folder.path("again.GLB").is_file());
}

#[test]
fn mistakes_are_told_and_nothing_is_replaced() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("convert s.kdl a.fbx", 2, &["can't be written as .fbx", ".kdl, .glb"]);
    folder.says("convert s.kdl -", 2, &["needs a file"]);
    folder.says("convert s.kdl a", 2, &["no extension"]);
    folder.says("convert s.kdl ./s.kdl", 2, &["would replace"]);
    folder.says("convert s.kdl a.kdl --view top", 2, &["--view"]);
    folder.says("convert none.obj a.kdl", 3, &["none.obj"]);
    folder.says("convert s.kdl none/a.kdl", 1, &["mkdir"]);
    fs::write(folder.path("a.glb"), "mine").unwrap();
    folder.says("convert s.kdl a.glb --no-clobber", 1, &["a.glb"]);
    assert_eq!(fs::read(folder.path("a.glb")).unwrap(), b"mine");
    // The files beside the output may be those that the scene names.
    fs::write(folder.path("m.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").unwrap();
    folder.says("convert m.obj b.kdl -q", 0, &[]);
    let before = fs::read(folder.path("b.assets/m.glb")).unwrap();
    folder.says("convert b.kdl b.KDL -q", 2, &["b.assets/", "would replace a file that is read for it"]);
    assert_eq!(fs::read(folder.path("b.assets/m.glb")).unwrap(), before);
    assert!(!folder.path("b.KDL").exists());
}

#[test]
fn animations_become_one_frame() {
    let folder = Folder::new(
        "s.kdl",
        "animation { frames 1 10 }\nsphere \"ball\" { center { key 1 0 0 0; key 10 9 0 0; \
        ease \"linear\" }; radius 1 }\ncamera { eye 0 1 50 }",
    );
    folder.says("convert s.kdl a.kdl", 0, &["lost: the animation, of which frame 1 is written"]);
    folder.says("convert s.kdl b.kdl --frame 4", 0, &["frame 4"]);
    assert!(fs::read_to_string(folder.path("b.kdl")).unwrap().contains("center 3 0 0"));
}
