//! The binary against people who slip and files that mean harm: a message and an exit code, never a lost file.
#![cfg(unix)]

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SCENE: &str = "camera { eye 0 0 5; center 0 0 0; size 12 8 }\nlight \"omni\" { position 0 5 5 }\n";
const BALL: &str = "sphere { center 0 0 0; radius 1 }\n";

struct Folder(tempfile::TempDir);

impl Folder {
    /// A folder with a scene of these objects in it as s.kdl.
    fn new(objects: &str) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        fs::write(folder.path().join("s.kdl"), format!("{SCENE}{objects}")).unwrap();
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// The exit code and what is said on stderr.
    fn run(&self, arguments: &[&str]) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_canaletto"));
        let output = command.args(arguments).current_dir(self.path()).stdin(Stdio::null()).output().unwrap();
        (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
    }

    fn expect(&self, arguments: &[&str], exit: i32, parts: &[&str]) {
        let (code, said) = self.run(arguments);
        assert_eq!(code, exit, "{arguments:?}: {said}");
        assert!(parts.iter().all(|part| said.contains(part)), "{arguments:?}: {said}");
    }
}

#[test]
fn what_is_read_is_never_replaced() {
    let folder = Folder::new("mesh file=\"m.obj\"\n");
    fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::os::unix::fs::symlink("s.kdl", folder.path().join("link.png")).unwrap();
    for output in ["s.kdl", "./m.obj", "link.png"] {
        let before = fs::read(folder.path().join(output)).unwrap();
        folder.expect(&["render", "s.kdl", "--format", "png", "-o", output], 2, &["would replace a file that is read"]);
        assert_eq!(fs::read(folder.path().join(output)).unwrap(), before);
    }
    folder.expect(&["render", "s.kdl", "-q", "-o", "a.png"], 0, &[]);
    let before = fs::read(folder.path().join("a.png")).unwrap();
    folder.expect(&["compare", "a.png", "a.png", "--diff", "./a.png"], 2, &["--diff ./a.png would replace"]);
    assert_eq!(fs::read(folder.path().join("a.png")).unwrap(), before);
}

#[test]
fn scenes_that_multiply_say_so() {
    let mut text = format!("prototype name=\"p0\" {{ {BALL} }}\n");
    for i in 1..40 {
        let last = i - 1;
        text += &format!("prototype name=\"p{i}\" {{ instance of=\"p{last}\"; instance of=\"p{last}\" }}\n");
    }
    let folder = Folder::new(&(text + "instance of=\"p39\""));
    folder.expect(
        &["render", "s.kdl"],
        3,
        &["\"p32\" expands to more than 4294967294 copies", "help: instances of instances"],
    );
    let folder = Folder::new("sphere name=\"moon\" { center 0 0 0; radius 1; scale 1e30; scale 1e30 }");
    folder.expect(&["render", "s.kdl"], 3, &["moon: after its transforms it reaches beyond", "help: transforms of an"]);
    let folder = Folder::new(BALL);
    folder.expect(&["render", "s.kdl", "--set", "integrator.max-depth=257"], 2, &["must be at most 256"]);
}

/// Nothing under a limit on memory: neither an endless file nor a picture that doesn't fit takes it all.
#[test]
fn memory_is_asked_for_before_it_is_taken() {
    let folder = Folder::new(BALL);
    folder.expect(&["render", "s.kdl", "-q", "-o", "a.png"], 0, &[]);
    let limited = |arguments: &str| {
        let script = format!("ulimit -v 3000000; exec {} {arguments}", env!("CARGO_BIN_EXE_canaletto"));
        let output = Command::new("sh").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
        (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, said) = limited("render s.kdl -o b.exr --aov all --size 16384x16384 --threads 1");
    assert!(code == 1 && said.contains("there is no memory for 16384 x 16384 pixels with 14 layers"), "{code} {said}");
    let (code, said) = limited("compare a.png /dev/zero");
    assert!(code == 1 && said.contains("neither a PNG nor an OpenEXR"), "{code} {said}");
}

#[test]
fn odd_names_are_names() {
    let folder = Folder::new(BALL);
    for name in ["a b", "ünï", "-x", "100%", "a####", "a\nb"] {
        fs::copy(folder.path().join("s.kdl"), folder.path().join(format!("{name}.kdl"))).unwrap();
        folder.expect(&["render", "-q", "--", &format!("{name}.kdl")], 0, &[]);
        assert!(folder.path().join(format!("{name}.png")).exists(), "{name}");
    }
    folder.expect(&["render", "s.kdl", "-q", "-o", "h.##.png"], 0, &[]);
    assert!(folder.path().join("h.##.png").exists(), "# counts with --frames only");
    let bytes = std::ffi::OsStr::from_bytes(b"\xff.kdl");
    fs::copy(folder.path().join("s.kdl"), folder.path().join(bytes)).unwrap();
    let output =
        Command::new(env!("CARGO_BIN_EXE_canaletto")).arg("info").arg(bytes).current_dir(folder.path()).output();
    assert_eq!(output.unwrap().status.code(), Some(3));
    // Files that can't be opened; a terminal is not steered by names.
    std::os::unix::fs::symlink("nowhere", folder.path().join("lost.kdl")).unwrap();
    folder.expect(&["render", "lost.kdl"], 3, &["it is a link to nowhere"]);
    folder.expect(&["render", "-"], 3, &["scenes are read from files"]);
    let (code, said) = folder.run(&["render", "\u{1b}[31mred.kdl"]);
    assert!(code == 3 && !said.contains('\u{1b}'), "{said:?}");
}

#[test]
fn negative_numbers_are_judged_as_numbers() {
    let folder = Folder::new(BALL);
    for (flag, value, part) in [
        ("--size", "-1x5", "write width x height"),
        ("--samples", "-4", "invalid value"),
        ("--max-depth", "-1", "-1 is not in 1..=256"),
        ("--threads", "-1", "-1 is not in 1..=1024"),
        ("--frames", "-1", "write a number or two"),
        ("--crop", "-1,0,2,2", "four whole"),
        ("--seed", "-1", "invalid value"),
    ] {
        folder.expect(&["render", "s.kdl", flag, value], 2, &["invalid value", part]);
    }
    folder.expect(&["explain", "s.kdl", "--pixel", "-1,0"], 2, &["invalid value"]);
    fs::write(folder.path().join("a.png"), "x").unwrap();
    folder.expect(&["compare", "a.png", "a.png", "--diff", "d.png", "--diff-scale", "nan"], 2, &["more than 0"]);
}

/// A pixel that would outlast everybody is no reason not to stop.
#[test]
fn ctrl_c_ends_an_endless_pixel() {
    let folder = Folder::new(
        "material \"m\" { k 1 1 1; kd 0 0 0; opacity 0; eta 1.5 }\nintegrator { max-depth 256 }\n\
         spheres material=\"m\" radius=1 { points 0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 }\n",
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_canaletto"));
    command.args(["render", "s.kdl", "--crop", "5,3,2,2", "--threads", "2"]).current_dir(folder.path());
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("it goes on");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert_eq!(status.code(), Some(130));
    assert!(!folder.path().join("s.png").exists(), "a black picture replaces nothing");
}
