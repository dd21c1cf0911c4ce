//! Tests of `canaletto bake`: its files, its messages, and the classic pictures that they are read back into.

mod support;

use canaletto_io::picture::decode;
use serde_json::Value;
use std::fs;
use support::Folder;

/// A room with a lamp and a block.
const ROOM: &str = r#"
camera { eye 0 0.2 0.9; center 0 -0.2 -1; up 0 1 0; fovy 60; size 24 16; near 0.1; far 10 }
integrator "radiosity" { error 0.1; show "solution" }
background 0
ambient 0
material "wall" { kd 0.6 0.5 0.4 }
material "lamp" { kd 0; emission 4 }
box material="wall" name="room" { min -1 -1 -1; max 1 1 1 }
box material="lamp" name="lamp" { min -0.3 0.8 -0.3; max 0.3 0.9 0.3 }
box material="wall" name="block" { min -0.5 -1 -0.5; max 0 -0.4 0 }
"#;

/// The JSON of a GLB file.
fn json(folder: &Folder, name: &str) -> Value {
    let bytes = folder.bytes(name);
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

#[test]
fn files_of_all_formats() {
    let folder = Folder::new("room.kdl", ROOM);
    folder.says("bake room.kdl", 0, &["room.glb: ", " patches, ", "light map ", " texels per unit"]);
    assert_eq!(folder.names(), ["room.glb"]);
    let names: Vec<String> =
        json(&folder, "room.glb")["nodes"].as_array().unwrap().iter().map(|n| n["name"].to_string()).collect();
    assert_eq!(names, ["\"room\"", "\"lamp\"", "\"block\"", "\"camera\""]);
    let first = fs::read(folder.path("room.glb")).unwrap();
    for threads in ["1", "2", "3"] {
        folder.says(&format!("bake room.kdl -q --threads {threads}"), 0, &[]);
        assert!(fs::read(folder.path("room.glb")).unwrap() == first, "{threads} threads");
    }
    // A solution that was saved makes the same file.
    folder.says("render room.kdl -q -o room.png --save-solution room.rad", 0, &[]);
    folder.says("bake room.kdl -q --solution room.rad", 0, &[]);
    assert!(fs::read(folder.path("room.glb")).unwrap() == first, "with a saved solution");
    folder.says("bake room.kdl -o room.rad --solution room.rad", 2, &["can't be written as .rad"]);
    folder.says("bake room.kdl --solution room.rad --set integrator.error=0.2", 3, &["--solution room.rad"]);
    fs::remove_file(folder.path("room.rad")).unwrap();
    fs::remove_file(folder.path("room.png")).unwrap();
    folder.says("bake room.kdl --maps light -o a.glb --size 128", 0, &["a.glb: ", "a.light.exr: ", "128 x 128"]);
    folder.says("bake room.kdl -o b.OBJ --texels-per-unit 10 -q", 0, &[]);
    let all = ["a.glb", "a.light.exr", "b.OBJ", "b.light.exr", "b.mtl", "b.png", "room.glb"];
    assert_eq!(folder.names(), all);
    let light = decode(&fs::read(folder.path("a.light.exr")).unwrap()).unwrap().image;
    assert_eq!((light.width, light.height), (128, 128));
    assert_eq!(json(&folder, "a.glb")["materials"][0]["extras"]["lightMap"]["file"], "a.light.exr");
}

/// The texture of an OBJ in even ambient light is shown as it is. The picture is the one that the solution makes.
#[test]
fn an_obj_shows_the_solution() {
    let folder = Folder::new("room.kdl", ROOM);
    folder.says("bake room.kdl -o baked.obj -q --size 512", 0, &[]);
    folder.says("render room.kdl -o solution.png -q --size 120x80", 0, &[]);
    let view = ROOM.lines().find(|line| line.starts_with("camera")).unwrap();
    let shown = format!(
        "{view}\nbackground 0\nambient 1\ntexture \"baked\" file=\"baked.png\"\n\
         material \"baked\" {{ texture \"baked\" }}\nmesh file=\"baked.obj\" material=\"baked\"\n"
    );
    fs::write(folder.path("shown.kdl"), shown).unwrap();
    folder.says("render shown.kdl -o shown.png -q --stage ambient --size 120x80", 0, &[]);
    let [a, b] = ["solution.png", "shown.png"].map(|name| decode(&fs::read(folder.path(name)).unwrap()).unwrap().image);
    let mut far = 0;
    for channel in 0..3 {
        let [a, b] = [&a, &b].map(|image| image.rgb().unwrap()[channel]);
        far += a.iter().zip(b).filter(|(a, b)| (**a - **b).abs() > 2.5 / 255.0).count();
    }
    // Filtering reads texels beyond the edges of surfaces in a few pixels.
    assert!(far < 3 * 120 * 80 / 100, "{far} of {} values differ", 3 * 120 * 80);
}

#[test]
fn mistakes_are_named() {
    let folder = Folder::new("room.kdl", ROOM);
    folder.says(
        "bake room.kdl -o room.fbx",
        2,
        &["baked scenes can't be written as .fbx", "end the name in .glb or .obj"],
    );
    folder.says("bake room.kdl -o room", 2, &["has no extension"]);
    folder.says("bake room.kdl -o -", 2, &["baked scenes need files"]);
    folder.says("bake room.kdl --size 64 --texels-per-unit 5", 2, &["cannot be used with"]);
    folder.says("bake room.kdl --texels-per-unit 0", 2, &["more than 0"]);
    folder.says("bake room.kdl --size 9000", 2, &["8192"]);
    folder.says("bake room.kdl --texels-per-unit 1e7", 3, &["don't fit into a light map of 8192 x 8192; at most "]);
    folder.says("bake room.kdl -o nosuch/room.glb", 1, &["there is no folder nosuch"]);
    folder.says("bake room.kdl --set material.lamp.emission=0", 3, &["nothing gives light"]);
    folder.says("bake room.kdl --set material.wall.kd=2", 3, &["material \"wall\" reflects 2"]);
    assert_eq!(folder.names(), [""; 0]);
    // None of several files is written if one can't be replaced.
    fs::write(folder.path("room.mtl"), "mine").unwrap();
    folder.says("bake room.kdl -o room.obj --no-clobber", 1, &["room.mtl exists already"]);
    assert_eq!(folder.names(), ["room.mtl"]);
}

#[test]
fn scenes_without_settings_and_with_planes() {
    let folder = Folder::new("room.kdl", ROOM);
    let scene = ROOM.lines().filter(|line| !line.starts_with("integrator") && !line.contains("name=\"room\""));
    let plane = "plane material=\"wall\" name=\"ground\" { point 0 0 -1; normal 0 0 1 }\n";
    let scene: String = scene.map(|line| format!("{line}\n")).chain([plane.into()]).collect();
    fs::write(folder.path("open.kdl"), scene.replace("up 0 1 0", "up 0 0 1")).unwrap();
    folder.says("bake open.kdl --size 256", 0, &["planes have no end"]);
    // z is up: the plane at z = -1 lies at y = -1.
    let json = json(&folder, "open.glb");
    let ground = json["meshes"].as_array().unwrap().iter().find(|mesh| mesh["name"] == "ground").unwrap();
    let positions = ground["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let accessor = &json["accessors"][positions];
    assert_eq!((accessor["min"][1].as_f64(), accessor["max"][1].as_f64()), (Some(-1.0), Some(-1.0)));
}

/// A plane outside the bounds of all other surfaces is baked below them. What isn't baked is named.
#[test]
fn nothing_is_left_out_in_silence() {
    let folder = Folder::new("room.kdl", ROOM);
    let scene = |height: f32| {
        format!(
            "camera {{ eye 0 3 9; center 0 0 0; size 32 24 }}\nintegrator \"radiosity\" {{ error 0.1 }}\n\
             material \"w\" {{ kd 0.6 }}\nmaterial \"e\" {{ kd 0; emission 5 }}\n\
             disk material=\"e\" {{ center 0 4 0; normal 0 -1 0; radius 1 }}\n\
             box name=\"crate\" material=\"w\" {{ min -0.1 4.5 -0.1; max 0.1 4.6 0.1 }}\n\
             box name=\"core\" material=\"w\" {{ min -0.01 4.54 -0.01; max 0.01 4.56 0.01 }}\n\
             plane name=\"ground\" material=\"w\" {{ point 0 {height} 0; normal 0 1 0 }}\n"
        )
    };
    fs::write(folder.path("near.kdl"), scene(0.0)).unwrap();
    let dark = "object \"crate\" isn't in the light map: no light arrives";
    let covered = "object \"core\" isn't in the light map: other bodies cover it";
    folder.says("bake near.kdl", 0, &["planes have no end", dark, covered]);
    let json = json(&folder, "near.glb");
    assert!(json["meshes"].as_array().unwrap().iter().any(|mesh| mesh["name"] == "ground"), "{json}");
    fs::write(folder.path("far.kdl"), scene(-1000.0)).unwrap();
    folder.says("bake far.kdl", 0, &["plane \"ground\" gets no light", "a rectangle in its place"]);
}
