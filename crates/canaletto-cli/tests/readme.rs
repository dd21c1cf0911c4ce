//! README's commands are run as a reader would paste them, and what README says that `explain` prints is compared.
//!
//! Pictures are a tenth as wide and high, because the time of a large one tests nothing more.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The lines of README's blocks in `language`, where the empty word stands for none.
fn blocks(language: &str) -> Vec<Vec<String>> {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let mut lines = readme.lines();
    let mut blocks = Vec::new();
    while let Some(line) = lines.next() {
        if let Some(word) = line.strip_prefix("```") {
            let block = lines.by_ref().take_while(|line| *line != "```").map(str::to_owned).collect();
            if word == language {
                blocks.push(block);
            }
        }
    }
    blocks
}

/// A folder that has the project's scenes, as the folder of the source has.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(root().join("scenes"), folder.path().join("scenes")).unwrap();
    folder
}

fn run(folder: &Path, line: &str) -> Output {
    let programs = Path::new(env!("CARGO_BIN_EXE_canaletto")).parent().unwrap().to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(programs).chain(std::env::split_paths(&path))).unwrap();
    let mut shell = Command::new("sh");
    shell.args(["-c", line]).current_dir(folder).env("PATH", path).env("NO_COLOR", "1").stdin(Stdio::null());
    shell.output().unwrap()
}

#[test]
fn every_command_of_readme_works() {
    let folder = folder();
    let mut commands = 0;
    for line in blocks("").iter().flatten().filter(|line| !line.starts_with("$ ")) {
        let line = line.split(" #").next().unwrap().trim();
        let line =
            line.strip_prefix("cargo run --release -- ").map_or(line.to_owned(), |rest| format!("canaletto {rest}"));
        if !line.starts_with("canaletto ") {
            continue;
        }
        let takes_size = ["render", "ladder", "compare-methods"].contains(&line.split(' ').nth(1).unwrap());
        let output = run(folder.path(), &if takes_size { format!("{line} --size 10%") } else { line.clone() });
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{line}: {}\n{errors}", output.status);
        commands += 1;
    }
    assert!(commands >= 11, "{commands}");
    for file in ["grand-canal.png", "fig-5.23b-shadow.png", "cake.png", "still-life.exr", "why.png", "cornell.glb"] {
        assert!(folder.path().join(file).exists(), "{file}");
    }
}

/// The lines are a selection in the order of the output, so that they can be found in it one after the other.
#[test]
fn readme_shows_a_true_explanation() {
    let folder = folder();
    let shown: Vec<_> = blocks("").into_iter().filter(|block| block[0].starts_with("$ ")).collect();
    let [block] = &shown[..] else { panic!("{} transcripts", shown.len()) };
    let output = run(folder.path(), block[0].strip_prefix("$ ").unwrap());
    let printed = String::from_utf8(output.stdout).unwrap();
    let mut printed = printed.lines();
    for line in &block[1..] {
        assert!(printed.any(|p| p == line), "not printed, or not in this order: {line}");
    }
    assert_eq!(block.len(), 7);
}
