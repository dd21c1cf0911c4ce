//! What authors of scenes use while they work: settings without editing, several scenes in one call.

mod support;

use canaletto_io::picture::decode;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use support::{CANALETTO, Folder, says};

const SCENE: &str = r#"
camera { eye 0 2 6; center 0 0 0; fovy 40; size 24 16 }
material "red" { kd 0.8 0.2 0.1; ks 0.5 0.5 0.5; n 20 }
sphere material="red" { center 0 0 0; radius 1 }
box { min -3 -1.5 -3; max 3 -1 3 }
light "omni" { position 3 5 4; intensity 0.8 0.8 0.8 }
"#;

const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3 4\n";

/// A folder with a scene and a model.
fn folder() -> Folder {
    let folder = Folder::new("s.kdl", SCENE);
    folder.write("a.obj", OBJ);
    folder.write("a.mtl", "newmtl red\nKd 1 0 0\n");
    folder
}

fn size(folder: &Folder, name: &str) -> (u32, u32) {
    let image = folder.picture(name).image;
    (image.width, image.height)
}

/// A box whose last side is missing holds no medium, which explains a picture without it.
#[test]
fn meshes_that_should_hold_a_medium_are_told_of_if_they_are_open() {
    const BOX: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\n";
    let folder = folder();
    folder.write("open.obj", BOX);
    folder.write("closed.obj", format!("{BOX}f 4 1 5 8\n"));
    let scene = |file: &str| {
        format!(
            "{SCENE}material \"ale\" {{ dielectric 1.33; absorption 1 2 3 }}\nintegrator \"path\"\n\
             mesh file=\"{file}\" material=\"ale\" name=\"cup\"\n"
        )
    };
    folder.write("cup.kdl", scene("open.obj"));
    let words = ["\"cup\" has 4 open edges", "\"ale\" is missing there", "help: an open edge", "ok, 1 warning"];
    folder.says("check cup.kdl", 0, &words);
    folder.write("cup.kdl", scene("closed.obj"));
    folder.says("check cup.kdl", 0, &["cup.kdl: ok\n"]);
}

#[test]
fn an_integrator_is_chosen_before_its_settings() {
    let folder = folder();
    let run = |arguments: &str| folder.says(&format!("render {arguments} -q"), 0, &[]);
    run("s.kdl -o flag.png --integrator zbuffer --set integrator.shadows=none");
    run("s.kdl -o set.png --set integrator.shadows=none --set integrator=zbuffer");
    folder.write("own.kdl", format!("{SCENE}integrator \"zbuffer\" {{ shadows \"none\" }}\n"));
    run("own.kdl -o own.png");
    let own = folder.picture("own.png");
    for name in ["flag.png", "set.png"] {
        assert!(folder.picture(name).image == own.image, "{name}");
    }
    run("own.kdl -o shadows.png --set integrator.shadows=map");
    assert!(folder.picture("shadows.png").image != own.image);
    let explain = "explain s.kdl --pixel 12,8 --integrator zbuffer --set integrator.shadows=none";
    folder.says(explain, 0, &[]);
    folder.says("render s.kdl --set integrator.shadows=none", 2, &["takes #true or #false", "--set"]);
}

#[test]
fn models_have_settings_like_scenes() {
    let folder = folder();
    let set = "--set integrator=whitted --set camera.size=20,10 --set material.red.kd=0,0,1 --set light.key.points=1 --set background=0,0,0";
    let mut command = folder.command("render a.obj -q");
    command.args(set.split(' ').map(|word| word.replace(',', " ")));
    says(&command.output().unwrap(), 0, &[]);
    assert_eq!(size(&folder, "a.png"), (20, 10));
    let colors = folder.picture("a.png").image.rgb().unwrap().map(|channel| channel[5 * 20 + 10]);
    assert!(colors[2] > 0.3 && colors[0] < 0.1, "the square is blue, not red: {colors:?}");
    folder.says("info a.obj --set integrator=whitted --set light.key.intensity=2", 0, &["intensity (2, 2, 2)"]);
    folder.says("render a.obj --set sphere.radius=2", 2, &["a model has no sphere to set", "help: a model has"]);
    folder.says("render a.obj --integrator zbuffer -q --size 5% -o z.png", 0, &[]);
}

#[test]
fn scenes_are_rendered_in_one_call() {
    let folder = folder();
    fs::create_dir(folder.path("out")).unwrap();
    folder.write("t.kdl", SCENE.replace("0.8 0.2 0.1", "0.1 0.2 0.8"));
    folder.write("wrong.kdl", "sphre { radius 1 }\n");
    let call = "render s.kdl wrong.kdl t.kdl missing.kdl -q --size 50% -o";
    let errors = folder.says(&format!("{call} out/{{name}}.half.png"), 3, &["wrong.kdl:1:1", "missing.kdl"]);
    assert!(!errors.contains("s.kdl:") && !errors.contains("t.kdl:"), "{errors}");
    assert_eq!([size(&folder, "out/s.half.png"), size(&folder, "out/t.half.png")], [(12, 8); 2]);
    // A sheet has a place for each of them, and the exit code stays.
    folder.says(&format!("{call} out/{{name}}.half.png --contact-sheet sheet.png"), 3, &["wrong.kdl:1:1"]);
    let sheet = folder.picture("sheet.png").image;
    assert!(sheet.width > 40 && sheet.height > 20, "{} x {}", sheet.width, sheet.height);
    folder.says("render s.kdl -q -o film.####.exr --frames 1-3 --contact-sheet sheet.jpg", 0, &[]);
    assert!(folder.picture("sheet.jpg").image.width > 40);
    folder.says("render s.kdl -o s.png --contact-sheet s.png", 2, &["--contact-sheet", "s.png"]);
    folder.says(
        "render s.kdl -o s.gif --frames 1-3 --contact-sheet t.png",
        2,
        &["--contact-sheet", "files of their own"],
    );
    folder.says(&format!("{call} one.png"), 2, &["several scenes", "'pictures/{name}.png'"]);
    folder.says("render s.kdl -q -o {name}.2.png", 0, &[]);
    assert_eq!(size(&folder, "s.2.png"), (24, 16));
    fs::create_dir(folder.path("sub")).unwrap();
    folder.write("sub/s.kdl", SCENE);
    folder.says("render s.kdl sub/s.kdl -o out", 2, &["two scenes would be rendered to out/s.png"]);
}

#[test]
fn a_scene_comes_from_the_standard_input_with_its_files() {
    let folder = folder();
    fs::create_dir(folder.path("parts")).unwrap();
    folder.write("parts/ball.kdl", SCENE);
    let run = |text: &str, code: i32, words: &[&str]| {
        let mut command = folder.command("render - -q -o in.png");
        let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
        says(&child.wait_with_output().unwrap(), code, words)
    };
    run("include \"parts/ball.kdl\"\n", 0, &[]);
    assert_eq!(size(&folder, "in.png"), (24, 16));
    run("include \"../s.kdl\"\n", 3, &["<stdin>:1:9", "outside"]);
    run("sphre\n", 3, &["<stdin>:1:1", "sphere"]);
}

#[test]
fn sizes_in_percent_scale_the_window() {
    let folder = folder();
    folder.write("c.kdl", format!("{SCENE}film {{ crop 4 4 12 8 }}\n"));
    folder.says("render c.kdl -q --size 50%", 0, &[]);
    assert_eq!(size(&folder, "c.png"), (6, 4));
    folder.says("render c.kdl -q --size 50% --crop 0,0,12,8", 0, &[]);
    assert_eq!(size(&folder, "c.png"), (12, 8));
    folder.says("render s.kdl --size 0%", 2, &["more than 0"]);
    folder.says("render s.kdl --size 99999999%", 2, &["the most are"]);
}

/// Scripts that use the former name of `--pattern` go on.
#[test]
fn former_names_are_understood() {
    let folder = folder();
    folder.says("render s.kdl -q --sample jittered --samples 4 -o old.png", 0, &[]);
    folder.says("render s.kdl -q --pattern jittered --samples 4 -o new.png", 0, &[]);
    assert!(fs::read(folder.path("old.png")).unwrap() == fs::read(folder.path("new.png")).unwrap());
    assert!(!folder.says("render --help", 0, &["--pattern"]).contains("--sample "));
    folder.says("render s.kdl --samples sobol", 2, &["--sampler sobol"]);
}

/// What `info` says of a picture makes equal bytes, whatever its settings are.
#[test]
fn a_picture_tells_how_it_is_made_again() {
    let folder = folder();
    folder.write("name with $.kdl", SCENE);
    folder.write("moves.kdl", SCENE.replace("radius 1 }", "radius 1; translate { key 0  0 0 0; key 2  2 0 0 } }"));
    let bin = PathBuf::from(CANALETTO);
    let path = std::env::join_paths([bin.parent().unwrap().to_owned(), "/usr/bin".into(), "/bin".into()]).unwrap();
    for (scene, flags) in [
        ("s.kdl", "-o s.png"),
        ("name with $.kdl", "-o it's.png --size 50% --pattern adaptive --samples 16 --seed 7 --no-shadows"),
        ("s.kdl", "-o s.exr --bits 16 --aov depth,normal --samples 5 --sampler jittered --crop 1,2,9,8"),
        ("s.kdl", "-o z.png --integrator zbuffer --set integrator.shadows=none --set background=1|0|0.5"),
        ("s.kdl", "-o deep.png --bits 16 --stage specular --max-depth 2 --tone scale --transfer none --pattern corner"),
        ("s.kdl", "-o layers.png --aov depth"),
        ("a.obj", "-o a.png --size 5% --set material.red.kd=0|1|0 --set integrator=whitted --set light.key.points=2"),
        ("a.obj", "-o b.png --size 5% --view front --light neutral --ground none --turn 30 --quality draft"),
        ("a.obj", "-o c.png --size 5% --samples 4 --denoise=none --ground #808080"),
        ("moves.kdl", "-o m.####.png --frames 1-2 --samples 2"),
        ("moves.kdl", "-o film.png --format apng --frames 0-2"),
    ] {
        let mut command = folder.command("render -q");
        says(&command.arg(scene).args(flags.split(' ').map(|f| f.replace('|', " "))).output().unwrap(), 0, &[]);
        let name = flags.split(' ').nth(1).unwrap().replace("####", "0002");
        for name in [name.clone(), name.replace("layers.png", "layers.depth.png")] {
            let before = fs::read(folder.path(&name)).unwrap();
            let told = folder.command("info").arg(&name).output().unwrap();
            let told = says(&told, 0, &["settings", "Canaletto", "the command that makes it again:"]);
            let again = told.lines().find(|line| line.starts_with("  canaletto render")).unwrap();
            fs::remove_file(folder.path(&name)).unwrap();
            let mut shell = Command::new("/bin/sh");
            let shell = shell.args(["-c", &format!("{again} -q")]).current_dir(folder.path("")).env("PATH", &path);
            says(&shell.output().unwrap(), 0, &[]);
            assert!(fs::read(folder.path(&name)).unwrap() == before, "{again}");
        }
    }
    folder.says("info s.png --set camera.fovy=3", 2, &["--set: s.png is a picture"]);
    folder.write("student.ppm", "P3 2 1 255\n255 0 0 0 255 0\n");
    folder.says("info student.ppm", 0, &["PPM, 2 x 1 pixels, 8 bits", "settings    none in the file"]);
    let json: serde_json::Value = serde_json::from_str(&folder.says("info s.png --json", 0, &[])).unwrap();
    assert_eq!(
        (&json["format"], &json["command"][2], &json["settings"]["scene"]),
        (&"PNG".into(), &"s.kdl".into(), &"s.kdl".into())
    );
}

/// Pictures of students come as PPM or JPEG.
#[test]
fn pictures_of_other_programs_are_compared() {
    let folder = folder();
    folder.says("render s.kdl -q", 0, &[]);
    let pixels = folder.picture("s.png").image;
    let bytes: Vec<[u8; 3]> =
        (0..24 * 16).map(|i| pixels.rgb().unwrap().map(|c| (c[i] * 255.0).round() as u8)).collect();
    let text = bytes.iter().map(|p| format!("{} {} {}\n", p[0], p[1], p[2])).collect::<String>();
    folder.write("s.ppm", format!("P3\n# made by hand\n24 16 255\n{text}"));
    folder.says("compare s.png s.ppm", 0, &["the pictures are equal"]);
    fs::write(folder.path("binary.ppm"), [b"P6 24 16 255\n", bytes.as_flattened()].concat()).unwrap();
    folder.says("compare binary.ppm s.ppm", 0, &["the pictures are equal"]);
    let jpeg = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../canaletto-io/src/image/testdata/ramp.jpg");
    fs::copy(jpeg, folder.path("a.jpg")).unwrap();
    folder.says("compare a.jpg a.jpg", 0, &["the pictures are equal"]);
}

#[test]
fn a_preview_becomes_the_picture() {
    let folder = folder();
    let events = folder.says("render s.kdl --preview --samples 4 --progress json -o p.png", 0, &[]);
    let events: Vec<serde_json::Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let blocks: Vec<i64> = events.iter().filter_map(|event| event["block"].as_i64()).collect();
    assert_eq!(blocks, [16, 4, 1]);
    assert_eq!(events.last().unwrap()["event"], "done");
    folder.says("render s.kdl --samples 4 -q -o whole.png", 0, &[]);
    assert!(fs::read(folder.path("p.png")).unwrap() == fs::read(folder.path("whole.png")).unwrap());
    // A window has previews of the window, also of an EXR and by radiosity.
    folder.says("render s.kdl --preview -q --crop 3,2,5,6 -o c.exr", 0, &[]);
    folder.says("render s.kdl --preview -q --integrator radiosity --aov depth -o r.png", 0, &[]);
    assert_eq!(size(&folder, "c.exr"), (5, 6));
    folder.says("render s.kdl --preview --no-clobber", 2, &["--no-clobber"]);
    folder.says("render s.kdl --preview -o -", 2, &["--preview", "one picture"]);
    folder.says("render s.kdl --preview --frames 1-2 -o a.##.png", 2, &["--preview: it is for one frame"]);
}

/// The file is there long before the picture is whole.
#[cfg(unix)]
#[test]
fn a_preview_comes_early() {
    let folder = folder();
    let mut child = folder.command("render s.kdl --preview -q --size 1600x1000 --samples 65536").spawn().unwrap();
    let start = Instant::now();
    let is_there = || fs::read(folder.path("s.png")).is_ok_and(|bytes| decode(&bytes).is_ok());
    while !is_there() {
        assert!(start.elapsed() < Duration::from_secs(30) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(20));
    }
    let picture = folder.picture("s.png");
    assert_eq!((picture.image.width, picture.image.height), (1600, 1000));
    let (key, text) = picture.metadata.iter().find(|(key, _)| key == "unfinished").unwrap();
    assert!(text.starts_with("a preview with one ray for "), "{key}: {text}");
    // The middle of the ball is red already.
    let [red, green, _] = picture.image.rgb().unwrap().map(|channel| channel[500 * 1600 + 800]);
    assert!(red > green + 0.2, "{red} {green}");
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

/// Changes of the scene, of an included file and of a missing file are seen. Mistakes don't end the watch.
#[cfg(unix)]
#[test]
fn a_watch_renders_again() {
    use std::io::{BufRead, BufReader};
    let folder = folder();
    folder.write("w.kdl", "include \"part.kdl\"\n");
    folder.write("part.kdl", SCENE);
    let mut command = folder.command("render w.kdl --watch --progress plain");
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| send.send(line)));
    let until = |words: &str| {
        let mut all = String::new();
        while !all.contains(words) {
            let line = receive.recv_timeout(Duration::from_secs(20));
            all += &(line.unwrap_or_else(|_| panic!("no {words:?} after:\n{all}")) + "\n");
        }
        all
    };
    until("watching 2 files; Ctrl-C ends");
    let first = folder.picture("w.png").image;
    folder.write("part.kdl", SCENE.replace("0.8 0.2 0.1", "0.1 0.8 0.2"));
    until("watching 2 files");
    let second = folder.picture("w.png").image;
    assert!(first != second);
    folder.write("part.kdl", "sphre\n");
    let told = until("watching 2 files");
    assert!(told.contains("part.kdl:1:1"), "{told}");
    assert!(folder.picture("w.png").image == second);
    fs::remove_file(folder.path("part.kdl")).unwrap();
    let told = until("watching 2 files");
    assert!(told.contains("there is no file \"part.kdl\""), "{told}");
    folder.write("part.kdl", SCENE);
    until("watching 2 files");
    assert!(folder.picture("w.png").image == first);
    // A change stops a long render.
    folder.write("part.kdl", format!("{SCENE}film {{ samples 65536 }}\n").replace("24 16", "1600 1000"));
    std::thread::sleep(Duration::from_millis(1500));
    folder.write("part.kdl", SCENE);
    let told = until("watching 2 files");
    assert!(!told.contains("partial") && !folder.path("w.partial.png").exists(), "{told}");
    assert!(folder.picture("w.png").image == first);
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    folder.says("render - --watch", 2, &["--watch: the standard input is read once"]);
    folder.says("render w.kdl --watch --camera no", 2, &["no camera \"no\""]);
}

/// Meshes that look odd are named by `check`, and pictures that show nothing by `render`, too.
#[test]
fn odd_pictures_are_told_of() {
    let folder = Folder::new(
        "s.kdl",
        "camera { eye 3 2 4; center 0.3 0.3 0.3; size 8 8 }\nmaterial \"glass\" { dielectric 1.5 }\n\
         mesh file=\"in.obj\" material=\"glass\"\nlight \"omni\" { position 5 5 5 }\n",
    );
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    folder.write("in.obj", format!("{corners}f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n"));
    folder.says("check s.kdl", 0, &["warning: mesh \"in.obj\" is inside out", "turn its faces round"]);
    folder.write("in.obj", format!("{corners}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"));
    let said = folder.says("check s.kdl", 0, &[]);
    assert!(!said.contains("inside out"), "{said}");
    folder.write("in.obj", format!("{corners}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 2 3 4\n"));
    folder.says("check s.kdl", 0, &["mesh \"in.obj\" has 1 face with the same corners", "double faces"]);
    folder.write("away.kdl", "camera { eye 0 0 5; center 0 0 9; size 8 8 }\nsphere { center 0 0 0; radius 1 }\n");
    folder.says("render away.kdl", 0, &["warning: the picture will be empty: everything lies behind the eye"]);
    let quiet = folder.run("render away.kdl -q");
    assert!(quiet.status.success() && quiet.stderr.is_empty());
}
