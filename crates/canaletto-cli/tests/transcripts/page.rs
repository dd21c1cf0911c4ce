//! A page of the book as what is run of it: commands, and the files that they need.

use crate::growing_scene::with_nodes;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A piece of a page, in the page's order.
pub(crate) enum Piece<'a> {
    Line(&'a str),
    /// A file that is written before the commands after it run.
    File {
        name: &'a str,
        text: String,
    },
    /// Nodes that a scene gets, at its end or in place of those that they replace.
    Nodes {
        name: &'a str,
        text: String,
    },
    /// A command whose output stands behind it on the page.
    Command(&'a str),
    /// A command whose output isn't shown, and which succeeds.
    SilentCommand(&'a str),
}

/// What all commands of a page made.
pub(crate) struct Run {
    /// What each `Piece::Command` printed.
    pub(crate) outputs: Vec<String>,
    /// The pictures and drawings by their names.
    pub(crate) figures: BTreeMap<String, Vec<u8>>,
}

pub(crate) fn pieces(page: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        pieces.push(Piece::Line(line));
        if !["```console", "```kdl", "```bash"].contains(&line) {
            continue;
        }
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        match line {
            "```console" => {
                pieces.extend(block.into_iter().filter_map(|line| line.strip_prefix("$ ")).map(Piece::Command))
            }
            "```bash" => {
                pieces.extend(block.iter().copied().map(Piece::Line));
                pieces.extend(block.into_iter().map(Piece::SilentCommand));
            }
            _ => {
                pieces.extend(file(&block));
                pieces.extend(block.into_iter().map(Piece::Line));
            }
        }
        pieces.push(Piece::Line("```"));
    }
    pieces
}

/// What a block of scene text writes, if its first line names a file.
fn file<'a>(block: &[&'a str]) -> Option<Piece<'a>> {
    let first = block.first()?.strip_prefix("// ").filter(|first| first.ends_with(".kdl"))?;
    let text = |lines: &[&str]| lines.join("\n") + "\n";
    Some(match first.strip_prefix("+ ") {
        None => Piece::File { name: first, text: text(block) },
        Some(name) => Piece::Nodes { name, text: text(&block[1..]) },
    })
}

/// All files and commands of a page. Pages of equal scripts print the same.
pub(crate) fn script(pieces: &[Piece]) -> String {
    let mut script = String::new();
    for piece in pieces {
        match piece {
            Piece::Line(_) => {}
            Piece::File { name, text } => writeln!(script, "> {name}\n{text}").unwrap(),
            Piece::Nodes { name, text } => writeln!(script, ">> {name}\n{text}").unwrap(),
            Piece::Command(command) | Piece::SilentCommand(command) => writeln!(script, "$ {command}").unwrap(),
        }
    }
    script
}

/// What a shell does for a line in a folder, with both streams in the order of writing.
fn shell(folder: &Path, line: &str) -> Output {
    let programs = Path::new(env!("CARGO_BIN_EXE_canaletto")).parent().unwrap().to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(programs).chain(std::env::split_paths(&path))).unwrap();
    Command::new("sh")
        .args(["-c", &format!("exec 2>&1\n{line}")])
        .current_dir(folder)
        .env("PATH", path)
        .env("NO_COLOR", "1")
        .env("LC_ALL", "C.UTF-8")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// Runs a page in a folder of its own, in which `scenes` is that of the project.
pub(crate) fn run(root: &Path, pieces: &[Piece]) -> Run {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(root.join("scenes"), folder.path().join("scenes")).unwrap();
    let mut outputs = Vec::new();
    for piece in pieces {
        match piece {
            Piece::Line(_) => {}
            Piece::File { name, text } => std::fs::write(folder.path().join(name), text).unwrap(),
            Piece::Nodes { name, text } => {
                let path = folder.path().join(name);
                let scene = std::fs::read_to_string(&path).unwrap();
                std::fs::write(&path, with_nodes(&scene, text)).unwrap();
            }
            Piece::Command(command) => {
                outputs.push(String::from_utf8(shell(folder.path(), command).stdout).unwrap());
            }
            Piece::SilentCommand(command) => {
                let output = shell(folder.path(), command);
                assert!(output.status.success(), "{command}\n{}", String::from_utf8_lossy(&output.stdout));
            }
        }
    }
    let files = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let figures =
        files.filter(|path| path.extension().is_some_and(|extension| extension == "png" || extension == "svg"));
    let named = |path: PathBuf| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap());
    Run { outputs, figures: figures.map(named).collect() }
}

/// A page with these outputs in place of what it says its commands print.
pub(crate) fn with_outputs(pieces: &[Piece], outputs: &[String]) -> String {
    let mut text = String::new();
    let mut outputs = outputs.iter();
    for piece in pieces {
        match piece {
            Piece::Line(line) => writeln!(text, "{line}").unwrap(),
            Piece::File { .. } | Piece::Nodes { .. } | Piece::SilentCommand(_) => {}
            // Without a last empty line, which the next command's line would otherwise follow.
            Piece::Command(command) => writeln!(text, "$ {command}\n{}", outputs.next().unwrap().trim_end()).unwrap(),
        }
    }
    text
}

/// The pictures and drawings of the book that a page shows, in the page's order, by their paths in `docs`.
pub(crate) fn figures_of(page: &str) -> Vec<&str> {
    let targets = page.match_indices("](").chain(page.match_indices("src=\""));
    let mut targets: Vec<(usize, &str)> = targets.map(|(at, mark)| (at, &page[at + mark.len()..])).collect();
    targets.sort_by_key(|(at, _)| *at);
    let targets = targets.into_iter().filter_map(|(_, rest)| rest.split([')', '"']).next());
    let targets = targets.map(|target| target.trim_start_matches("../"));
    targets.filter(|target| target.starts_with("pictures/") || target.starts_with("diagrams/")).collect()
}
