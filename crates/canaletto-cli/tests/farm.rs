//! Jobs for engines: what is written, and pictures and films that the engines make of it, where they are installed.
#![cfg(unix)]

mod support;

use std::fs;
use std::path::Path;
use std::process::Command;
use support::{CANALETTO, Folder, says};

/// A ball that falls onto a floor under a lamp.
const SCENE: &str = r#"
    camera { eye 0 1 5; center 0 0.8 0; fovy 40; size 32 24 }
    integrator "path"
    animation { frames 1 5; fps 10 }
    material "wall" { kd 0.7 0.6 0.5 }
    material "lamp" { kd 0; emission 8 }
    box material="wall" { min -2 -0.1 -2; max 2 0 2 }
    sphere material="wall" { center 0 0.7 0; radius 0.7; translate { key 1 0 0 0; key 5 0 1 0 } }
    sphere material="lamp" { center 1 3 2; radius 0.4 }
"#;

/// A folder whose name means something to shells, make and Slurm.
const FOLDER: &str = "it's \"a\" 10%j $HOME #1";

/// What is rendered: the flags, and the file.
const JOBS: [(&str, &str); 3] = [
    ("--samples 24 --denoise=fast --set integrator.guiding=on --parts 3", "room.png"),
    ("--samples 8 --split tiles --parts 2", "rows.exr"),
    ("--samples 4", "ball.gif"),
];

/// Runs a command in the odd folder.
fn run(folder: &Path, program: &str, line: &[&str]) -> std::process::Output {
    let mut command = Command::new(program);
    command.args(line).current_dir(folder).env("CANALETTO", CANALETTO);
    command.output().unwrap_or_else(|error| panic!("{program}: {error}"))
}

fn is_installed(program: &str) -> bool {
    let is_there = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !is_there {
        eprintln!("SKIPPED: there is no {program}");
    }
    is_there
}

/// A folder with the scene, and the renders that jobs must equal.
fn prepared() -> (Folder, std::path::PathBuf) {
    let folder = Folder::new("unused.kdl", SCENE);
    let odd = folder.path(FOLDER);
    fs::create_dir(&odd).unwrap();
    fs::write(odd.join("s.kdl"), SCENE).unwrap();
    for (flags, file) in JOBS {
        let flags = flags.split(" --parts").next().unwrap().replace("--split tiles", "");
        let line = format!("render s.kdl -q {flags} -o whole.{file}");
        says(&run(&odd, CANALETTO, &line.split_whitespace().collect::<Vec<_>>()), 0, &[]);
    }
    (folder, odd)
}

/// Writes the jobs of an engine and makes them.
fn make_all(engine: &str, odd: &Path, make: &dyn Fn(&str)) {
    for (flags, file) in JOBS {
        let line = format!("farm {engine} s.kdl {flags} -o {file} --job job");
        says(&run(odd, CANALETTO, &line.split_whitespace().collect::<Vec<_>>()), 0, &["job: ", file]);
        make("job");
        let [made, whole] = [file.to_owned(), format!("whole.{file}")].map(|file| fs::read(odd.join(file)).unwrap());
        assert!(made == whole, "{engine}: {file} isn't the file of one render");
        for name in [file, "room.parts", "rows.parts", "ball.parts"] {
            let path = odd.join(name);
            let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
    }
}

#[test]
fn make_renders_jobs() {
    let (_folder, odd) = prepared();
    if is_installed("make") {
        let program = format!("CANALETTO={CANALETTO}");
        make_all("make", &odd, &|job| {
            says(&run(&odd, "make", &["-f", job, "-j", "2", &program]), 0, &[]);
        });
    }
}

#[test]
fn parallel_renders_jobs() {
    let (_folder, odd) = prepared();
    if is_installed("parallel") {
        make_all("parallel", &odd, &|job| {
            says(&run(&odd, "bash", &[job]), 0, &[]);
        });
    }
}

/// The steps of the script for Slurm, as its tasks run them.
#[test]
fn steps_for_slurm_render_jobs() {
    let (_folder, odd) = prepared();
    make_all("slurm", &odd, &|job| {
        let text = fs::read_to_string(odd.join(job)).unwrap();
        for word in ["#SBATCH --requeue", "afterok", "--signal=B:USR1@60", "scontrol requeue"] {
            assert!(text.contains(word), "no {word} in:\n{text}");
        }
        let count = text.lines().find_map(|line| line.strip_prefix("count=")?.split(' ').next()?.parse().ok()).unwrap();
        if text.contains("\nprepare()") {
            says(&run(&odd, "bash", &[job, "prepare"]), 0, &[]);
        }
        for part in 1..=count {
            let part: u32 = part;
            says(&run(&odd, "bash", &[job, "part", &part.to_string()]), 0, &[]);
        }
        says(&run(&odd, "bash", &[job, "merge"]), 0, &[]);
        says(&run(&odd, "bash", &[job, "nothing"]), 2, &["there is no step nothing"]);
    });
}

#[test]
fn open_job_description_renders_jobs() {
    let (_folder, odd) = prepared();
    if is_installed("openjd") {
        let program = format!("Canaletto={CANALETTO}");
        make_all("openjd", &odd, &|job| {
            says(&run(&odd, "openjd", &["check", &format!("{job}/template.yaml")]), 0, &[]);
            let (template, values) = (format!("{job}/template.yaml"), format!("file://{job}/values.json"));
            let line = ["run", &template, "-p", &values, "-p", &program, "--step", "Merge", "--run-dependencies"];
            says(&run(&odd, "openjd", &line), 0, &["openjd_progress", "successfully"]);
            fs::remove_dir_all(odd.join(job)).unwrap();
        });
    }
}

/// What no job can have is refused by name, and nothing is written.
#[test]
fn what_jobs_cant_have_is_refused() {
    let folder = Folder::new("s.kdl", SCENE);
    for (line, words) in [
        ("slurm s.kdl --samples 8 --part 1/2", &["--part can't be had in a job"][..]),
        ("slurm s.kdl --samples 8 --time 5s", &["--time"]),
        ("slurm s.kdl --samples 8 --aov cost", &["--aov can't be had in parts"]),
        ("slurm s.kdl --samples 8 --aov normal -o a.png", &["--aov: PNG has no layers"]),
        ("slurm s.kdl --samples 8 --noise 0.1", &["--noise"]),
        ("slurm s.kdl --samples 8 --background #fff -o a.png", &["--background"]),
        ("slurm s.kdl --samples 8 --checkpoint c.exr", &["each part has its own"]),
        ("slurm s.kdl s.kdl --samples 8", &["more scenes"]),
        ("slurm - --samples 8", &["standard input"]),
        ("slurm s.kdl --samples 8 -o -", &["--output -"]),
        ("slurm s.kdl --samples 8 --parts 9", &["there are fewer parts"]),
        ("slurm s.kdl --samples 8 --split frames", &["--frames all"]),
        ("slurm s.kdl --samples 8 --frames all --split tiles -o a.##.png", &["--split frames"]),
        ("slurm s.kdl --samples 8 --job s.kdl", &["--job s.kdl"]),
        ("cron s.kdl", &["slurm, openjd, parallel, make"]),
    ] {
        folder.says(&format!("farm {line}"), 2, words);
    }
    folder.says("farm slurm gone.kdl", 3, &["gone.kdl"]);
    assert_eq!(folder.names(), Vec::<String>::new());
    let odd = folder.path("a\nb");
    fs::create_dir(&odd).unwrap();
    fs::write(odd.join("s.kdl"), SCENE).unwrap();
    says(&run(&odd, CANALETTO, &["farm", "make", "s.kdl", "--samples", "8"]), 2, &["new line"]);
    fs::write(folder.path("{{x}}.kdl"), SCENE).unwrap();
    folder.says("farm openjd {{x}}.kdl --samples 8 -o a.png", 2, &["double braces"]);
}
