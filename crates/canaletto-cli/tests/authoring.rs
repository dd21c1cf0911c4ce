//! What authors of scenes use while they work: settings without editing, several scenes in one call.

use canaletto_io::picture::{Decoded, decode};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

const SCENE: &str = r#"
camera { eye 0 2 6; center 0 0 0; fovy 40; size 24 16 }
material "red" { kd 0.8 0.2 0.1; ks 0.5 0.5 0.5; n 20 }
sphere material="red" { center 0 0 0; radius 1 }
box { min -3 -1.5 -3; max 3 -1 3 }
light "omni" { position 3 5 4; intensity 0.8 0.8 0.8 }
"#;

const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3 4\n";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.write("s.kdl", SCENE);
        folder.write("a.obj", OBJ);
        folder.write("a.mtl", "newmtl red\nKd 1 0 0\n");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_canaletto"));
        command.args(arguments.split_whitespace()).current_dir(self.0.path());
        command
    }

    /// Runs a command and expects an exit code and words on stdout or stderr.
    #[track_caller]
    fn says(&self, arguments: &str, code: i32, words: &[&str]) -> String {
        said(&self.command(arguments).output().unwrap(), code, words)
    }

    fn picture(&self, name: &str) -> Decoded {
        decode(&fs::read(self.path(name)).unwrap()).unwrap()
    }

    fn size(&self, name: &str) -> (u32, u32) {
        let image = self.picture(name).image;
        (image.width, image.height)
    }
}

#[track_caller]
fn said(output: &Output, code: i32, words: &[&str]) -> String {
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "no {word:?} in:\n{said}"));
    said
}

#[test]
fn an_integrator_is_chosen_before_its_settings() {
    let folder = Folder::new();
    let run = |arguments: &str| folder.says(&format!("render {arguments} -q"), 0, &[]);
    run("s.kdl -o flag.png --integrator zbuffer --set integrator.shadows=none");
    run("s.kdl -o set.png --set integrator.shadows=none --set integrator=zbuffer");
    folder.write("own.kdl", &format!("{SCENE}integrator \"zbuffer\" {{ shadows \"none\" }}\n"));
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
    let folder = Folder::new();
    let set = "--set camera.size=20,10 --set material.red.kd=0,0,1 --set light.key.points=1 --set background=0,0,0";
    let mut command = folder.command("render a.obj -q");
    command.args(set.split(' ').map(|word| word.replace(',', " ")));
    said(&command.output().unwrap(), 0, &[]);
    assert_eq!(folder.size("a.png"), (20, 10));
    let colors = folder.picture("a.png").image.rgb().unwrap().map(|channel| channel[5 * 20 + 10]);
    assert!(colors[2] > 0.3 && colors[0] < 0.1, "the square is blue, not red: {colors:?}");
    folder.says("info a.obj --set light.key.intensity=2", 0, &["intensity (2, 2, 2)"]);
    folder.says("render a.obj --set sphere.radius=2", 2, &["a model has no sphere to set", "help: a model has"]);
    folder.says("render a.obj --integrator zbuffer -q --size 5% -o z.png", 0, &[]);
}

#[test]
fn scenes_are_rendered_in_one_call() {
    let folder = Folder::new();
    fs::create_dir(folder.path("out")).unwrap();
    folder.write("t.kdl", &SCENE.replace("0.8 0.2 0.1", "0.1 0.2 0.8"));
    folder.write("wrong.kdl", "sphre { radius 1 }\n");
    let call = "render s.kdl wrong.kdl t.kdl missing.kdl -q --size 50% -o";
    let errors = folder.says(&format!("{call} out/{{name}}.half.png"), 3, &["wrong.kdl:1:1", "missing.kdl"]);
    assert!(!errors.contains("s.kdl:") && !errors.contains("t.kdl:"), "{errors}");
    assert_eq!([folder.size("out/s.half.png"), folder.size("out/t.half.png")], [(12, 8); 2]);
    folder.says(&format!("{call} one.png"), 2, &["several scenes", "'pictures/{name}.png'"]);
    folder.says("render s.kdl -q -o {name}.2.png", 0, &[]);
    assert_eq!(folder.size("s.2.png"), (24, 16));
    fs::create_dir(folder.path("sub")).unwrap();
    folder.write("sub/s.kdl", SCENE);
    folder.says("render s.kdl sub/s.kdl -o out", 2, &["two scenes would be rendered to out/s.png"]);
}

#[test]
fn a_scene_comes_from_the_standard_input_with_its_files() {
    let folder = Folder::new();
    fs::create_dir(folder.path("parts")).unwrap();
    folder.write("parts/ball.kdl", SCENE);
    let run = |text: &str, code: i32, words: &[&str]| {
        let mut command = folder.command("render - -q -o in.png");
        let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
        said(&child.wait_with_output().unwrap(), code, words)
    };
    run("include \"parts/ball.kdl\"\n", 0, &[]);
    assert_eq!(folder.size("in.png"), (24, 16));
    run("include \"../s.kdl\"\n", 3, &["<stdin>:1:9", "outside"]);
    run("sphre\n", 3, &["<stdin>:1:1", "sphere"]);
}

#[test]
fn sizes_in_percent_scale_the_window() {
    let folder = Folder::new();
    folder.write("c.kdl", &format!("{SCENE}film {{ crop 4 4 12 8 }}\n"));
    folder.says("render c.kdl -q --size 50%", 0, &[]);
    assert_eq!(folder.size("c.png"), (6, 4));
    folder.says("render c.kdl -q --size 50% --crop 0,0,12,8", 0, &[]);
    assert_eq!(folder.size("c.png"), (12, 8));
    folder.says("render s.kdl --size 0%", 2, &["more than 0"]);
    folder.says("render s.kdl --size 99999999%", 2, &["the most are"]);
}

/// Scripts that use the former name of `--pattern` go on.
#[test]
fn former_names_are_understood() {
    let folder = Folder::new();
    folder.says("render s.kdl -q --sample jittered --samples 4 -o old.png", 0, &[]);
    folder.says("render s.kdl -q --pattern jittered --samples 4 -o new.png", 0, &[]);
    assert!(fs::read(folder.path("old.png")).unwrap() == fs::read(folder.path("new.png")).unwrap());
    assert!(!folder.says("render --help", 0, &["--pattern"]).contains("--sample "));
    folder.says("render s.kdl --samples sobol", 2, &["--sampler sobol"]);
}
