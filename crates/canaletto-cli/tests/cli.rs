//! Tests of the binary as people and scripts use it: files in, files and exit codes out.

mod support;

use canaletto_io::picture::{Decoded, decode};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use support::{Folder, Ran};

/// A ball over a floor, a mirror and glass. They produce every kind of ray.
const SCENE: &str = r#"
background 0.4 0.4 0.4
ambient 0.2 0.2 0.2
camera "front" { eye 0 2 6; center 0 0 0; fovy 40; size 24 16 }
camera "side" { eye 6 2 0; center 0 0 0; fovy 40; size 24 16 }
material "red" { kd 0.8 0.2 0.1; ks 0.5 0.5 0.5; n 20 }
material "mirror" { kd 0.2 0.2 0.2; k 0.6 0.6 0.6 }
material "glass" { kd 0 0 0.2; opacity 0.3; eta 1.3 }
sphere name="ball" material="red" { center 0 0 0; radius 1 }
sphere material="glass" { center 1.2 -0.4 1.5; radius 0.5 }
box material="mirror" { min -3 -1.5 -3; max 3 -1 3 }
light "omni" { position 3 5 4; intensity 0.8 0.8 0.8 }
"#;

/// A folder whose scene has one ray for each pixel. Adaptive sampling compares developed colours, so that its rays
/// depend on the transfer curve and on the background.
fn with_one_ray() -> Folder {
    Folder::new("s.kdl", &format!("film {{ sample \"center\" }}\n{SCENE}"))
}

fn rgb(picture: &Decoded, index: usize) -> [f32; 3] {
    picture.image.rgb().unwrap().map(|channel| channel[index])
}

#[test]
fn a_picture_beside_its_report() {
    let folder = Folder::new("s.kdl", SCENE);
    let ran = folder.run("render s.kdl");
    ran.says(
        0,
        &[
            "s.png: 24 x 16 pixels, 2 rays per pixel, 9 jittered",
            "eye",
            "reflected",
            "refracted",
            "shadow",
            "3 primitives",
        ],
    );
    assert_eq!(ran.out(), "");
    assert_eq!(folder.names(), ["s.png"]);
    let picture = folder.picture("s.png");
    assert_eq!((picture.image.width, picture.image.height, picture.bits), (24, 16, 8));
    let has = |key: &str, value: &str| picture.metadata.iter().any(|(k, v)| k == key && v == value);
    assert!(has("scene", "s.kdl") && has("camera", "front") && has("seed", "0"), "{:?}", picture.metadata);
    let quiet = folder.run("render s.kdl --quiet");
    assert_eq!((quiet.code(), quiet.out(), quiet.err()), (0, String::new(), String::new()));
}

#[test]
fn exit_codes() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.write("wrong.kdl", "camera { eye 0 0 5; center 0 0 0; size 4 4 }\nsphre { center 0 0 0; radius 1 }\n");
    folder.run("render").says(2, &["SCENE"]);
    folder.run("render s.kdl --pattern jittered --samples 10").says(2, &["9 and 16"]);
    folder.run("render s.kdl --samples 65537").says(2, &["65536"]);
    folder.run("render s.kdl --pattern corner --samples 4").says(2, &["one ray for each pixel", "help:"]);
    folder.run("render s.kdl --camera frnt").says(2, &["no camera \"frnt\"", "did you mean \"front\"?", "\"side\""]);
    folder.run("render s.kdl --crop 20,0,10,4").says(2, &["--crop: the crop window 10 x 4 at 20, 0"]);
    folder.run("render s.kdl -o s.tiff").says(2, &[".png, .exr, .jpg or .webp"]);
    folder.run("render s.kdl --aov nromal").says(2, &["did you mean normal?"]);
    folder.run("render s.kdl --set material.red.shine=1").says(2, &["--set", "shine"]);
    folder.write("t.fbx", "solid");
    folder.run("render t.fbx").says(3, &["isn't a scene or model", "Blender converts FBX to OBJ or PLY"]);
    folder.run("render nosuch.kdl").says(3, &["can't open nosuch.kdl: no such file"]);
    folder.run("render S.kdll").says(3, &["did you mean s.kdl?"]);
    folder.run("render no/such.kdl").says(3, &["can't open no/such.kdl", "there is no folder no"]);
    folder.run("render wrong.kdl").says(3, &["wrong.kdl:2:1", "sphre", "sphere"]);
    folder.run("explain s.kdl --pixel 24,0").says(2, &["pixel 24, 0 isn't in the picture of 24 x 16"]);
    folder.run("nonsense").says(2, &["unrecognized"]);
    folder.run("--help").says(0, &["Exit codes:", "130  interrupted"]);
    assert_eq!(folder.names(), ["t.fbx", "wrong.kdl"]);
}

#[test]
fn what_cannot_be_written_leaves_nothing() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("render s.kdl -o no/such/s.png").says(1, &["there is no folder no/such", "mkdir -p no/such"]);
    folder.run("render s.kdl -o s.kdl/s.png").says(1, &["error:"]);
    fs::create_dir(folder.path("d.png")).unwrap();
    folder.run("render s.kdl -o d.png").says(1, &["d.png is a folder"]);
    if cfg!(target_os = "linux") {
        folder.run("render s.kdl -o /proc/canaletto.png").says(1, &["can't write into /proc"]);
    }
    assert_eq!(folder.names(), ["d.png"]);
}

#[cfg(unix)]
#[test]
fn a_folder_without_permission() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new("s.kdl", SCENE);
    let locked = folder.path("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    // The superuser may write everywhere.
    if fs::File::create(locked.join("probe")).is_err() {
        folder.run("render s.kdl -o locked/s.png").says(1, &["can't write into locked", "permission denied"]);
        assert_eq!(fs::read_dir(&locked).unwrap().count(), 0);
    }
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn no_clobber_keeps_files() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.write("s.png", "precious");
    folder.run("render s.kdl --no-clobber").says(1, &["s.png exists already", "--no-clobber"]);
    assert_eq!(fs::read(folder.path("s.png")).unwrap(), b"precious");
    folder.write("t.normal.png", "precious");
    folder.run("render s.kdl -o t.png --aov normal --no-clobber").says(1, &["t.normal.png exists already"]);
    assert_eq!(folder.names(), ["s.png", "t.normal.png"]);
    folder.run("render s.kdl").says(0, &[]);
    folder.picture("s.png");
}

#[test]
fn compression_changes_sizes_and_no_pixel() {
    let folder = Folder::new("s.kdl", SCENE);
    let size = |how: &str, kind: &str| {
        let file = format!("{how}.{kind}");
        let frames = if kind == "apng" { "--frames 1-2" } else { "" };
        folder.run(&format!("render s.kdl -q --size 300x200 -o {file} --compression {how} {frames}")).says(0, &[]);
        (folder.picture(&file).image, fs::metadata(folder.path(&file)).unwrap().len())
    };
    for kind in ["png", "apng"] {
        let [fast, default, best] = ["fast", "default", "best"].map(|how| size(how, kind));
        assert!(fast.0 == default.0 && default.0 == best.0);
        assert!(fast.1 > default.1 && default.1 >= best.1, "{} {} {}", fast.1, default.1, best.1);
    }
    folder.run("render s.kdl -q --size 300x200 -o none.png").says(0, &[]);
    assert_eq!(fs::read(folder.path("none.png")).unwrap(), fs::read(folder.path("default.png")).unwrap());
    folder.run("render s.kdl -o s.exr --compression best").says(2, &["--compression is for PNG and APNG"]);
}

#[test]
fn the_standard_output_takes_a_picture() {
    let folder = Folder::new("s.kdl", SCENE);
    let png = folder.run("render s.kdl -o -");
    png.says(0, &["standard output"]);
    let exr = folder.run("render s.kdl -o - --format exr --aov depth");
    assert_eq!(decode(&png.0.stdout).unwrap().bits, 8);
    assert!(decode(&exr.0.stdout).unwrap().image.channel("depth.Z").is_some());
    assert!(folder.names().is_empty());
    folder.run("render s.kdl -o - --aov depth").says(2, &["--format exr"]);
    folder.run("render s.kdl -o - --frames 1-2").says(2, &["one picture"]);
}

#[test]
fn a_reader_who_leaves_is_no_failure() {
    let folder = Folder::new("s.kdl", SCENE);
    for arguments in
        ["render s.kdl -o - --quiet --size 200x200 --bits 16", "explain s.kdl -p 12,8 --samples 256", "info s.kdl"]
    {
        let mut child = folder.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let ran = Ran(child.wait_with_output().unwrap());
        assert_eq!((ran.code(), ran.err()), (0, String::new()), "{arguments}");
    }
}

#[test]
fn frames_are_numbered_and_differ() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("render s.kdl --frames 9-11 -o f.###.png --samples 4 -q").says(0, &[]);
    assert_eq!(folder.names(), ["f.009.png", "f.010.png", "f.011.png"]);
    let [nine, ten] = ["f.009.png", "f.010.png"].map(|name| folder.picture(name).image);
    assert!(nine != ten, "two frames have the same random numbers");
    folder.run("render s.kdl --frames 1-2 -o f.png").says(2, &["every frame would be written to f.png", "####"]);
    folder.run("render s.kdl --frames 3-2").says(2, &["comes after the last"]);
    folder.run("render s.kdl --frames 5 -o one.png -q").says(0, &[]);
}

/// A lamp that is seen, and a warning that it lights nothing, once.
#[test]
fn materials_that_emit_are_warned_of_once() {
    let folder = Folder::new("s.kdl", SCENE);
    let lamp = "material \"lamp\" { kd 0; emission 17 12 4 }\nsphere material=\"lamp\" { center 0 2 0; radius 0.3 }\n";
    folder.write("lamp.kdl", format!("{SCENE}{lamp}"));
    let said = folder.run("render lamp.kdl -o q.png -q");
    said.says(0, &[]);
    assert!(!said.err().contains("emits"), "{}", said.err());
    let warning = "material \"lamp\" emits, but the whitted integrator takes light from lights only";
    for arguments in ["render lamp.kdl -o a.###.exr --aov emission --frames 1-3", "check lamp.kdl"] {
        let said = folder.run(arguments);
        said.says(0, &[warning, "integrator \"path\" or \"radiosity\""]);
        assert_eq!(said.err().matches("emits").count(), 1, "{}", said.err());
    }
    let said = folder.run("render lamp.kdl -o a.png --stage unlit");
    said.says(0, &[]);
    assert!(!said.err().contains("emits"), "{}", said.err());
    folder.run("info lamp.kdl").says(0, &["\"lamp\": kd (0, 0, 0), ks (0, 0, 0), n 1, emission (17, 12, 4)"]);
    let told = folder.run("explain lamp.kdl --pixel 12,0 --json");
    let tree: Value = serde_json::from_slice(&told.0.stdout).unwrap();
    let hit = &tree["samples"][0]["ray"]["outcome"]["hit"];
    assert_eq!(hit["object_id"], 4, "{tree:#}");
    assert_eq!(
        (&hit["material"], &hit["emission"]),
        (&"lamp".into(), &serde_json::json!([17.0, 12.0, 4.0])),
        "{tree:#}"
    );
    let image = folder.picture("a.001.exr").image;
    assert!(image.channel("emission.R").unwrap().contains(&17.0));
}

#[test]
fn layers_in_one_file_or_in_several() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("render s.kdl -o a.exr --aov all").says(0, &["a.exr: 24 x 16"]);
    let image = folder.picture("a.exr").image;
    for name in ["R", "normal.X", "depth.Z", "object_id.X", "cost.X", "reflection.G"] {
        assert!(image.channel(name).is_some(), "{name}");
    }
    folder.run("render s.kdl -o b.png --aov normal,object-id --aov normal").says(0, &["b.png and 2 layers"]);
    assert_eq!(folder.names(), ["a.exr", "b.normal.png", "b.object-id.png", "b.png"]);
}

#[test]
fn a_dry_run_writes_nothing() {
    let folder = Folder::new("s.kdl", SCENE);
    let ran = folder.run("render s.kdl --dry-run --samples 16 --camera side");
    ran.says(
        0,
        &["camera    side, 24 x 16", "16 rays per pixel, sobol", "3 primitives", "output    s.png (PNG, 8 bits, sRGB)"],
    );
    assert!(folder.names().is_empty());
    folder.run("render s.kdl --dry-run -o no/s.png").says(1, &["no folder"]);
}

#[test]
fn progress_as_json() {
    let folder = Folder::new("s.kdl", SCENE);
    let ran = folder.run("render s.kdl --progress json --size 400x300 --samples 16");
    let events: Vec<Value> = ran.err().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(events[0]["event"], "start");
    assert_eq!(events[0]["pixels"], 120_000);
    let done = events.last().unwrap();
    assert_eq!((&done["event"], &done["complete"], &done["files"][0]), (&"done".into(), &true.into(), &"s.png".into()));
    assert_eq!(done["rays"]["eye"]["traced"], 16 * 120_000);
    for progress in events.iter().filter(|event| event["event"] == "progress") {
        assert!(progress["percent"].as_f64().unwrap() <= 100.0 && progress["rays"].as_u64().unwrap() > 0);
    }
    let failed = folder.run("render nosuch.kdl --progress json");
    let error: Value = serde_json::from_str(failed.err().trim()).unwrap();
    assert_eq!((failed.code(), &error["event"], &error["exit"]), (3, &"error".into(), &3.into()));
}

#[test]
fn threads_and_tiles_change_no_byte() {
    let folder = Folder::new("s.kdl", SCENE);
    for (name, flags) in [("a", "--threads 1"), ("b", "--threads 4 --tile 5")] {
        for extension in ["png", "exr"] {
            folder.run(&format!("render s.kdl -q --samples 16 --aov all -o {name}.{extension} {flags}")).says(0, &[]);
        }
    }
    let bytes = |name: &str| fs::read(folder.path(name)).unwrap();
    let pairs: Vec<String> =
        folder.names().into_iter().filter_map(|name| name.strip_prefix("a.").map(str::to_owned)).collect();
    assert_eq!(pairs.len(), 19);
    for name in pairs {
        assert!(bytes(&format!("a.{name}")) == bytes(&format!("b.{name}")), "{name}");
    }
}

#[test]
fn work_on_hierarchies_changes_no_byte() {
    let folder = Folder::new("s.kdl", SCENE);
    // The mesh has crosswise splinters. Every sixteenth of them is so long that it is split.
    let mut mesh = String::new();
    for n in 0..300 {
        let (x, y) = ((n % 20) as f32 * 0.2 - 2.0, (n / 20) as f32 * 0.2 - 1.5);
        let length = if n % 16 == 0 { 4.0 } else { 0.1 };
        let (dx, dy) = ((n as f32).cos() * length, (n as f32).sin() * length);
        mesh += &format!(
            "v {x} {y} 0\nv {} {} {length}\nv {} {} {length}\nf -3 -2 -1\n",
            x + dx,
            y + dy,
            x + dx,
            y + dy + 0.02
        );
    }
    folder.write("splinters.obj", &mesh);
    folder.write("long.kdl", format!("{SCENE}\nmesh file=\"splinters.obj\" material=\"red\""));
    for work in ["medium", "high"] {
        folder.run(&format!("render long.kdl -q --samples 4 -o {work}.png --build {work}")).says(0, &[]);
    }
    let bytes = |name: &str| fs::read(folder.path(name)).unwrap();
    assert!(bytes("medium.png") == bytes("high.png"));
    let memory = |work: &str| {
        let info = folder.run(&format!("info long.kdl --json --build {work}")).out();
        serde_json::from_str::<Value>(&info).unwrap()["census"]["bytes"].as_u64().unwrap()
    };
    assert_ne!(memory("high"), memory("medium"), "the same trees");
    let pixel = "explain long.kdl -p 12,8 --build";
    assert_eq!(folder.run(&format!("{pixel} high")).out(), folder.run(&format!("{pixel} medium")).out());
    // Frames of one build quality are complete for the other.
    folder.run("render long.kdl --frames 1-2 -o f.#.png").says(0, &["2 frames rendered"]);
    folder.run("render long.kdl --frames 1-2 -o f.#.png --build high").says(0, &["2 complete before"]);
    folder.run("render long.kdl --build best").says(2, &["medium, high"]);
}

#[test]
fn an_explanation_adds_up_to_the_pixel() {
    let folder = Folder::new("s.kdl", SCENE);
    let flags = "--samples 4 --seed 5 --max-depth 4";
    folder.run(&format!("render s.kdl -q -o a.exr {flags}")).says(0, &[]);
    let picture = folder.picture("a.exr");
    for (x, y) in [(12usize, 8usize), (15, 10), (3, 13), (0, 0)] {
        let ran = folder.run(&format!("explain s.kdl --pixel {x},{y} {flags} --json"));
        let tree: Value = serde_json::from_str(&ran.out()).unwrap();
        let numbers = |value: &Value| match value {
            Value::Array(list) => [0, 1, 2].map(|i| list[i].as_f64().unwrap() as f32),
            other => ["r", "g", "b"].map(|c| other[c].as_f64().unwrap() as f32),
        };
        assert_eq!(numbers(&tree["sum"]), rgb(&picture, y * 24 + x), "{x} {y}");
        assert_eq!(tree["samples"].as_array().unwrap().len(), 4);
    }
    let down = folder.run("explain s.kdl --pixel 12,8");
    down.says(0, &["equal, bit for bit", "(5.39a)"]);
    assert_eq!(folder.run("explain s.kdl --pixel 12,7 --y-up").out(), down.out());
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("render s.kdl -q -o whole.exr").says(0, &[]);
    folder.run("render s.kdl -q -o part.exr --crop 5,3,10,4").says(0, &[]);
    let (whole, part) = (folder.picture("whole.exr"), folder.picture("part.exr"));
    assert_eq!([part.image.width, part.image.height], [10, 4]);
    for (x, y) in [(0, 0), (9, 3), (4, 2)] {
        assert_eq!(rgb(&part, y * 10 + x), rgb(&whole, (y + 3) * 24 + x + 5));
    }
}

#[test]
fn flags_change_the_scene() {
    let folder = with_one_ray();
    let render = |name: &str, flags: &str| {
        folder.run(&format!("render s.kdl -q -o {name}.exr {flags}")).says(0, &[]);
        folder.picture(&format!("{name}.exr")).image
    };
    let plain = render("a", "");
    assert!(plain == render("b", "--stage full --samples 1 --seed 3"));
    for flags in
        ["--stage unlit", "--no-shadows", "--max-depth 1", "--camera side", "--samples 4", "--set material.red.n=80"]
    {
        assert!(plain != render("c", flags), "{flags}");
    }
    assert_eq!(render("d", "--size 30x40").width, 30);
}

#[test]
fn compare_measures() {
    let folder = with_one_ray();
    folder.run("render s.kdl -q -o a.png").says(0, &[]);
    folder.run("render s.kdl -q -o a.exr").says(0, &[]);
    folder.run("render s.kdl -q -o b.png --no-shadows").says(0, &[]);
    folder.run("render s.kdl -q -o plain.png --transfer none").says(0, &[]);
    folder.run("render s.kdl -q -o small.png --size 12x8").says(0, &[]);
    folder.run("compare a.png a.png").says(0, &["the pictures are equal"]);
    // An EXR equals the PNG once it has the PNG's curve and is rounded to its bits.
    folder.run("compare a.png a.exr --threshold max=0.005").says(0, &[]);
    folder.run("compare a.exr plain.png --threshold max=0.005").says(0, &[]);
    folder.run("compare a.exr a.png --linear --threshold rmse=0.05").says(0, &[]);
    folder
        .run("compare a.png b.png --diff d.png")
        .says(0, &["rmse", "psnr", "max", "ssim", "flip", "diff       d.png"]);
    assert_eq!(folder.picture("d.png").image.width, 24);
    folder.run("compare a.png b.png -t rmse=0.001 -t psnr=10").says(4, &["rmse is over the threshold 0.001"]);
    let json: Value = serde_json::from_str(&folder.run("compare a.png b.png --json -t ssim=1").out()).unwrap();
    assert!(json["rmse"].as_f64().unwrap() > 0.001 && json["exceeded"][0] == "ssim");
    folder.run("compare a.png small.png").says(3, &["different sizes"]);
    folder.run("compare a.png nosuch.png").says(3, &["can't read nosuch.png: no such file"]);
    folder.run("compare a.png s.kdl").says(3, &["can't read s.kdl", "no picture that can be read"]);
    folder.run("compare a.png b.png -t rsme=1").says(2, &["did you mean rmse?"]);
}

#[test]
fn light_that_is_seen_alike_is_not_equal() {
    let folder = with_one_ray();
    // Both skies are white in a picture; in linear light one has twice the radiance of the other.
    for (name, sky) in [("a", "4"), ("b", "8")] {
        folder.run(&format!("render s.kdl -q -o {name}.exr --aov depth --set background={sky}")).says(0, &[]);
        folder.run(&format!("render s.kdl -q -o {name}.png --set background={sky} --max-depth 1")).says(0, &[]);
    }
    folder.run("compare a.exr b.exr -t differing=0").says(4, &["linear light differs unseen in", "by up to 4.000000"]);
    let json: Value = serde_json::from_str(&folder.run("compare a.exr b.exr --json").out()).unwrap();
    assert!(json["equal"] == false && json["unseen"]["max"] == 4.0, "{json}");
    folder.run("compare a.png b.png").says(0, &["the pictures are equal"]);
    folder.run("compare a.exr a.exr").says(0, &["the pictures are equal"]);
    let json: Value = serde_json::from_str(&folder.run("compare a.exr a.exr --json").out()).unwrap();
    assert!(json["equal"] == true && json["unseen"].is_null(), "{json}");
    folder.run("compare a.exr b.exr --layer depth.Z").says(0, &["the layers \"depth.Z\" are equal"]);
}

#[test]
fn several_scenes_replace_nothing_that_another_reads() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("render s.kdl -q -o two.png").says(0, &[]);
    let before = fs::read(folder.path("two.png")).unwrap();
    folder.write("two.kdl", SCENE);
    folder.write("uses.kdl", format!("{SCENE}\ntexture \"t\" file=\"two.png\"\n"));
    folder.run("render two.kdl uses.kdl -q -o .").says(2, &["two.png would replace a file that is read"]);
    assert_eq!(fs::read(folder.path("two.png")).unwrap(), before);
    fs::create_dir(folder.path("out")).unwrap();
    folder.run("render two.kdl uses.kdl -q -o out").says(0, &[]);
    folder.run("render s.kdl -q -o out").says(0, &[]);
    assert!(folder.path("out/s.png").is_file(), "a single scene goes into a folder, too");
    folder.run("render s.kdl s.kdl -q -o out").says(2, &["two scenes would be rendered to out/s.png"]);
}

#[cfg(target_os = "linux")]
#[test]
fn help_that_nobody_gets_is_a_failure() {
    let folder = Folder::new("s.kdl", SCENE);
    for arguments in ["--help", "--version", "help render", "info --help"] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let status = folder.command(arguments).stdout(full).stderr(Stdio::null()).status().unwrap();
        assert_eq!(status.code(), Some(1), "{arguments}");
        folder.run(arguments).says(0, &[]);
    }
}

#[test]
fn check_tells_every_mistake_of_every_file() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.write("a.kdl", "sphre { radius 1 }\nlight \"omny\" { position 0 0 0 }\n");
    folder.write("b.kdl", "camera { eye 0 0 0; center 0 0 0; size 4 4 }\n");
    let ran = folder.run("check a.kdl s.kdl b.kdl nosuch.kdl");
    ran.says(3, &["sphre", "omny", "s.kdl: ok", "a.kdl: 2 errors", "nosuch.kdl: 1 error", "same point"]);
    folder.run("check s.kdl").says(0, &["s.kdl: ok"]);
    let json: Value = serde_json::from_str(&folder.run("check a.kdl s.kdl --json").out()).unwrap();
    assert_eq!((json["files"][0]["ok"].as_bool(), json["files"][1]["ok"].as_bool()), (Some(false), Some(true)));
    assert_eq!(json["files"][0]["diagnostics"][0]["start"]["line"], 1);
}

#[test]
fn info_counts() {
    let folder = Folder::new("s.kdl", SCENE);
    folder
        .run("info s.kdl")
        .says(0, &["3 single shapes", "\"front\": eye (0, 2, 6)", "omni, intensity", "\"red\": kd", "s.kdl, "]);
    let json: Value = serde_json::from_str(&folder.run("info s.kdl --json").out()).unwrap();
    assert_eq!(json["census"]["primitives"], 3);
    assert_eq!(json["cameras"][1]["name"], "side");
    assert_eq!(json["files"][0]["bytes"], SCENE.len());
}

#[test]
fn models_are_looked_at_as_they_are() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.run("render t.obj --size 40x30").says(0, &["t.png: 40 x 30"]);
    folder.run("render t.obj --set mesh.scale=3").says(2, &["--set:1:1", "a model has no mesh", "mesh file="]);
}

#[test]
fn scripts_for_shells_and_manuals() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.run("completions bash").says(0, &["--no-clobber"]);
    folder.run("completions tcsh").says(2, &["bash"]);
    folder.run("man").says(0, &[".TH canaletto 1"]);
    folder.run("man --out pages").says(0, &[]);
    let page = fs::read_to_string(folder.path("pages/canaletto-render.1")).unwrap();
    assert!(page.contains(".TH canaletto-render 1") && page.contains(r"no\-clobber"));
}

/// Starts a render that takes minutes, and waits until a part of it is done.
#[cfg(unix)]
fn long_render(folder: &Folder) -> (std::process::Child, Vec<String>, impl Iterator<Item = String> + use<>) {
    let arguments = "render s.kdl --progress json --size 3000x2000 --samples 64 --tile 16 -o long.png";
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let mut seen: Vec<String> = Vec::new();
    while !seen.last().is_some_and(|line| line.contains("\"progress\"")) {
        seen.push(lines.next().expect("the render ended too early"));
    }
    (child, seen, lines)
}

#[cfg(unix)]
fn signal(child: &std::process::Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_the_picture_so_far() {
    let folder = Folder::new("s.kdl", SCENE);
    let (mut child, _, lines) = long_render(&folder);
    signal(&child, "-INT");
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let done: Value = serde_json::from_str(rest.last().unwrap()).unwrap();
    assert_eq!((&done["event"], &done["complete"]), (&"done".into(), &false.into()));
    assert_eq!(folder.names(), ["long.partial.png"]);
    let picture = folder.picture("long.partial.png");
    assert!(picture.metadata.iter().any(|(key, _)| key == "unfinished"));
    let pixels = picture.image.rgb().unwrap()[0];
    assert!(pixels.iter().any(|v| *v > 0.0) && pixels.contains(&0.0));
}

#[cfg(unix)]
#[test]
fn two_signals_leave_no_half_file() {
    let folder = Folder::new("s.kdl", SCENE);
    let (mut child, ..) = long_render(&folder);
    signal(&child, "-TERM");
    signal(&child, "-INT");
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert!(folder.names().iter().all(|name| name == "long.partial.png"), "{:?}", folder.names());
}

#[test]
fn colours_are_for_terminals() {
    let folder = Folder::new("s.kdl", SCENE);
    let said = folder.run("render s.kdl --camera x").err();
    assert!(!said.contains('\x1b'), "{said}");
}

/// Covers all kinds of hierarchies with many rays: meshes, clouds, single shapes, clear objects, shadows from a disk.
#[test]
fn no_picture_depends_on_the_instructions() {
    let folder = Folder::new("s.kdl", SCENE);
    let place = |i: usize, n: usize| ((i * 7919 % n) as f64 / n as f64 - 0.5) * 6.0;
    let (mut mesh, mut cloud) = (String::new(), String::new());
    for i in 0..600 {
        let [x, y, z] = [place(i, 601), place(i, 397), place(i, 211)];
        let [a, b, c] = [[0.0, 0.3, 0.1], [0.3, 0.0, 0.2], [0.1, 0.2, 0.4]].map(|[u, v, w]| [x + u, y + v, z + w]);
        for [x, y, z] in [a, b, c] {
            mesh += &format!("v {x} {y} {z}\n");
        }
        mesh += "f -3 -2 -1\n";
        cloud += &format!("{x} {y} {z} 0.04\n");
    }
    folder.write("mesh.obj", &mesh);
    let objects = format!(
        "{SCENE}mesh file=\"mesh.obj\" material=\"red\"\nspheres material=\"mirror\" {{ data \"\"\"\n{cloud}\"\"\"\n}}\n\
         cylinder material=\"glass\" {{ base -2 -1 1; top -1 1 1; radius 0.2 }}\ntorus material=\"red\" {{ center 0 1 0; axis 0 1 0; radius 1; tube 0.2 }}\n\
         light \"disk\" {{ position 0 5 0; normal 0 -1 0; radius 1; intensity 0.5; points 9 }}\n"
    );
    folder.write("many.kdl", &objects);
    let with = |set: &str, arguments: &str| {
        Ran(folder.command(arguments).env("CANALETTO_INSTRUCTION_SET", set).output().unwrap())
    };
    let mut expected: Option<Vec<Vec<u8>>> = None;
    let (mut used, mut refused) = (Vec::new(), Vec::new());
    for set in ["baseline", "avx2", "avx512", ""] {
        let first = with(set, "render s.kdl -o a.png --size 96x64 --samples 3");
        if first.code() == 2 {
            assert!(first.err().contains(&format!("is {set}, which this processor doesn't have")), "{}", first.err());
            assert!(first.err().contains("here there are: baseline"), "{}", first.err());
            refused.push(set);
            continue;
        }
        let second = with(set, "render many.kdl -o b.exr --size 96x64 --samples 3");
        let third = with(set, "render many.kdl -o c.exr --size 48x32 --aov normal,depth");
        for ran in [&first, &second, &third] {
            assert_eq!(ran.code(), 0, "{set}: {}", ran.err());
        }
        let tree = with(set, "explain many.kdl --pixel 10,8 --size 48x32").out();
        let mut bytes: Vec<Vec<u8>> =
            ["a.png", "b.exr", "c.exr"].map(|file| fs::read(folder.path(file)).unwrap()).into();
        bytes.push(tree.into_bytes());
        let expected = expected.get_or_insert_with(|| bytes.clone());
        assert!(*expected == bytes, "{set}");
        used.push(set);
    }
    assert_eq!((used.first(), used.last()), (Some(&"baseline"), Some(&"")), "without a value, all that there is");
    assert!(!refused.contains(&"baseline") && used.len() + refused.len() == 4);
    for wrong in ["AVX2", "sse9", "avx-512"] {
        let ran = with(wrong, "check s.kdl");
        assert_eq!(ran.code(), 2);
        assert!(ran.err().contains(&format!("CANALETTO_INSTRUCTION_SET is \"{wrong}\"")), "{}", ran.err());
        assert!(ran.err().contains("there are: baseline, avx2, avx512"), "{}", ran.err());
    }
}
