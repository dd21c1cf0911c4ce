//! Checkpoints: a picture that is killed at any moment is taken up by the same command.
#![cfg(unix)]

mod support;

use std::fs;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use support::{CANALETTO, Folder};

/// A glossy ball in an open box, under a lamp.
const SCENE: &str = r#"
    camera { eye 0 1 5; center 0 0.8 0; fovy 40; size 64 48 }
    material "wall" { kd 0.7 0.6 0.5 }
    material "lamp" { kd 0; emission 8 }
    material "shiny" { kd 0.2 0.3 0.5; ks 0.5; n 40 }
    box material="wall" { min -2 -0.1 -2; max 2 0 2 }
    box material="wall" { min -2 0 -2.1; max 2 3 -2 }
    sphere material="shiny" { center 0 0.7 0; radius 0.7 }
    sphere material="lamp" { center 1 3 2; radius 0.4 }
"#;

/// Random whole numbers below a limit (Steele, Lea & Flood, *Fast splittable pseudorandom number generators*, 2014).
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ mixed >> 31) % limit
    }
}

fn begin(folder: &Folder, run: &str) -> Child {
    let mut command = Command::new(CANALETTO);
    command.args(run.split_whitespace()).current_dir(folder.path(""));
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Runs a command and sends it a signal when it is at work on a checkpoint. Returns its exit code.
fn run_until_at_work(folder: &Folder, run: &str, checkpoint: &str, signal: &str) -> Option<i32> {
    let mut child = begin(folder, run);
    while !folder.path(&format!(".{checkpoint}.lock")).exists() {
        sleep(Duration::from_millis(5));
    }
    sleep(Duration::from_millis(100));
    let _ = Command::new("kill").args([signal, &child.id().to_string()]).status();
    child.wait().unwrap().code()
}

/// Runs a command and sends it a signal after a while. Returns its exit code; none if the signal killed it.
fn run_until(folder: &Folder, run: &str, (signal, after): (&str, Duration)) -> Option<i32> {
    let mut child = begin(folder, run);
    sleep(after);
    let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
    child.wait().unwrap().code()
}

/// Runs a command and sends it signals, again and again, until it ends by itself. Returns the number of signals that
/// ended it.
fn run_through(folder: &Folder, run: &str, signals: &[&str], random: &mut SplitMix) -> u32 {
    for ended in 0..400 {
        let signal = signals[ended as usize % signals.len()];
        // Later rounds get more time, so that each picture is finished.
        let after = Duration::from_millis(20 + random.below(200 + 10 * u64::from(ended)));
        match run_until(folder, run, (signal, after)) {
            Some(0) => return ended,
            code => assert!([None, Some(130), Some(143)].contains(&code), "{code:?}"),
        }
    }
    panic!("the picture isn't finished: {run}");
}

#[test]
fn a_killed_picture_is_taken_up_by_the_same_command() {
    let folder = Folder::new("s.kdl", SCENE);
    let mut random = SplitMix(7);
    let mut ended = 0;
    for (name, flags) in [
        ("path?.exr", "--integrator path --samples 700"),
        ("noise?.exr", "--integrator path --samples 4096 --noise 0.03 --denoise=fast"),
        ("classic?.exr", "--samples 2000 --size 96x72"),
        ("radiosity?.exr", "--integrator radiosity --set integrator.error=0.4 --progressive --samples 100"),
        ("frames.##?.exr", "--integrator path --samples 200 --frames 1-3"),
        ("guided?.exr", "--integrator path --set integrator.guiding=on --samples 200"),
        ("film?.apng", "--integrator path --samples 200 --frames 1-4"),
    ] {
        let run = format!("render s.kdl -q {flags} --checkpoint c.exr --checkpoint-every 15ms");
        folder.says(&format!("{run} -o {}", name.replace('?', ".whole")), 0, &[]);
        let own = format!("{run} -o {}", name.replace('?', ""));
        ended += run_through(&folder, &own, &["-KILL", "-KILL", "-TERM", "-INT"], &mut random);
        for entry in fs::read_dir(folder.path("")).unwrap() {
            let path = entry.unwrap().path();
            let file = path.file_name().unwrap().to_str().unwrap();
            if file.contains(".whole.") {
                let own = path.with_file_name(file.replace(".whole.", "."));
                assert!(fs::read(&own).unwrap() == fs::read(&path).unwrap(), "{own:?} differs from {path:?}");
                fs::remove_file(&path).unwrap();
            }
        }
        let rest = ["c.exr", "c.state", "film.frames"].iter().any(|rest| folder.path(rest).exists());
        assert!(!rest, "{name}: a finished picture has no checkpoint");
    }
    assert!(ended > 10, "{ended} ends");
}

/// Signals have their own exit codes, and the last checkpoint has all samples.
#[test]
fn a_terminated_render_leaves_a_checkpoint() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --integrator path --samples 60000 --checkpoint c.exr -o a.png";
    for (signal, code) in [("-TERM", 143), ("-INT", 130)] {
        assert_eq!(run_until_at_work(&folder, run, "c.exr", signal), Some(code));
        assert!(folder.path("c.exr").exists());
        folder.says("info c.exr", 0, &["samples"]);
    }
    // A picture with fewer samples isn't the one that was begun.
    folder.says("render s.kdl --integrator path --samples 1 --checkpoint c.exr -o a.png", 3, &["c.exr", "sampl"]);
}

/// A scheduler's warning makes a checkpoint, and the render goes on.
#[test]
fn a_request_makes_a_checkpoint() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --integrator path --samples 60000 --checkpoint c.exr --checkpoint-every 1h -o a.png";
    let mut child = begin(&folder, run);
    while !folder.path(".c.exr.lock").exists() {
        sleep(Duration::from_millis(5));
    }
    assert!(!folder.path("c.exr").exists());
    let pid = child.id().to_string();
    let _ = Command::new("kill").args(["-USR1", &pid]).status();
    while !folder.path("c.exr").exists() {
        sleep(Duration::from_millis(5));
    }
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    let _ = Command::new("kill").args(["-TERM", &pid]).status();
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

/// A checkpoint of another picture is never overwritten: it is an error where it was asked for, else another name is
/// taken.
#[test]
fn checkpoints_of_other_pictures_are_kept() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --integrator path --samples 60000 --checkpoint-every 1ms";
    let asked = format!("{run} --checkpoint a.checkpoint.exr -o a.png");
    assert_eq!(run_until_at_work(&folder, &asked, "a.checkpoint.exr", "-TERM"), Some(143));
    let before = fs::read(folder.path("a.checkpoint.exr")).unwrap();
    for (change, said) in [
        ("--seed 3", "its seed is 0, not 3"),
        ("--size 32x24", "its size is 64 48, not 32 24"),
        ("--clamp 2", "its clamp is none, not 2"),
    ] {
        folder.says(&format!("{asked} {change}"), 3, &["checkpoint a.checkpoint.exr", said, "remove it"]);
    }
    fs::write(folder.path("s.kdl"), SCENE.replace("radius 0.4", "radius 0.5")).unwrap();
    folder.says(&asked, 3, &["s.kdl has changed since it was rendered", "remove it"]);
    // Without being asked for.
    let short = "render s.kdl --integrator path --samples 4 -o a.png";
    folder.says(short, 0, &["s.kdl has changed", "a.checkpoint-2.exr"]);
    assert!(fs::read(folder.path("a.checkpoint.exr")).unwrap() == before);
    folder.says(&format!("{short} --checkpoint off"), 0, &["a.png"]);
    // A scene that is only renamed and moved is the same.
    fs::create_dir(folder.path("b")).unwrap();
    fs::write(folder.path("b/t.kdl"), SCENE).unwrap();
    let moved = "render b/t.kdl --integrator path --samples 60000 --checkpoint a.checkpoint.exr -o a.png";
    assert_eq!(run_until_at_work(&folder, moved, "a.checkpoint.exr", "-TERM"), Some(143));
    assert!(fs::read(folder.path("a.checkpoint.exr")).unwrap() != before);
}

/// Of two renders with one checkpoint the second says so, and does no harm.
#[test]
fn two_renders_have_no_checkpoint_in_common() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --integrator path --samples 60000 --checkpoint c.exr";
    let mut first = begin(&folder, &format!("{run} -q -o a.png"));
    while !folder.path(".c.exr.lock").exists() {
        sleep(Duration::from_millis(5));
    }
    folder.says(&format!("{run} -o b.png"), 1, &["checkpoint c.exr: another render is at work on it"]);
    let _ = Command::new("kill").args(["-TERM", &first.id().to_string()]).status();
    assert_eq!(first.wait().unwrap().code(), Some(143));
    assert!(folder.path("c.exr").exists() && !folder.path(".c.exr.lock").exists());
}

/// Where a checkpoint can't be written, the render goes on.
#[test]
fn a_checkpoint_that_cant_be_written_costs_no_picture() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::create_dir(folder.path("gone")).unwrap();
    let mut child = Command::new(CANALETTO)
        .args(
            "render s.kdl --integrator path --samples 3000 --checkpoint gone/c.exr --checkpoint-every 1ms -o a.png"
                .split_whitespace(),
        )
        .current_dir(folder.path(""))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !folder.path("gone/c.exr").exists() {
        sleep(Duration::from_millis(5));
    }
    fs::rename(folder.path("gone"), folder.path("elsewhere")).unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{said}");
    assert!(said.contains("warning: ") && said.contains("the render goes on"), "{said}");
    assert!(folder.path("a.png").exists());
}
