//! The book's transcripts: each `console` block of a page is run as a reader would run it, and what it prints is
//! compared with the page. `CANALETTO_BLESS=1` writes what is printed into the page instead.
//!
//! A page has a folder of its own, in which `scenes` is that of the project. A `kdl` block that begins with the comment
//! `// NAME.kdl` is written to this file there before the commands after it run.
#![cfg(unix)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// What a shell prints for a line, both streams in the order of writing.
fn printed(folder: &Path, line: &str) -> String {
    let programs = Path::new(env!("CARGO_BIN_EXE_canaletto")).parent().unwrap().to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(programs).chain(std::env::split_paths(&path))).unwrap();
    let output = Command::new("sh")
        .args(["-c", &format!("exec 2>&1\n{line}")])
        .current_dir(folder)
        .env("PATH", path)
        .env("NO_COLOR", "1")
        .env("LC_ALL", "C.UTF-8")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    String::from_utf8(output.stdout).unwrap()
}

/// A page with what its commands print in place of what it says they print, and the number of commands.
fn with_true_output(page: &str) -> (String, usize) {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(root().join("scenes"), folder.path().join("scenes")).unwrap();
    let (mut text, mut commands) = (String::new(), 0);
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        writeln!(text, "{line}").unwrap();
        if !["```console", "```kdl"].contains(&line) {
            continue;
        }
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        if line == "```kdl" {
            if let Some(name) =
                block.first().and_then(|first| first.strip_prefix("// ")).filter(|n| n.ends_with(".kdl"))
            {
                std::fs::write(folder.path().join(name), block.join("\n") + "\n").unwrap();
            }
            block.iter().for_each(|line| writeln!(text, "{line}").unwrap());
        } else {
            for command in block.iter().filter_map(|line| line.strip_prefix("$ ")) {
                let output = printed(folder.path(), command);
                // Without a last empty line, which the next command's line would otherwise follow.
                writeln!(text, "$ {command}\n{}", output.trim_end()).unwrap();
                commands += 1;
            }
        }
        text.push_str("```\n");
    }
    (text, commands)
}

#[test]
fn the_books_transcripts_are_true() {
    let bless = std::env::var_os("CANALETTO_BLESS").is_some();
    let mut counts = Vec::new();
    let mut pages: Vec<PathBuf> =
        std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.sort();
    for path in pages.into_iter().filter(|path| path.extension().is_some_and(|e| e == "md")) {
        let page = std::fs::read_to_string(&path).unwrap();
        if !page.contains("```console\n") {
            continue;
        }
        let (text, commands) = with_true_output(&page);
        if bless {
            std::fs::write(&path, &text).unwrap();
        } else if let Some((is, should)) = text.lines().zip(page.lines()).find(|(is, should)| is != should) {
            panic!("{}: CANALETTO_BLESS=1 corrects it\nthe page says {should:?}\nthe command {is:?}", path.display());
        } else {
            assert_eq!(text.lines().count(), page.lines().count(), "{}", path.display());
        }
        counts.push((path.file_name().unwrap().to_string_lossy().into_owned(), commands));
    }
    let count = |name: &str| counts.iter().find(|(page, _)| page == name).map_or(0, |(_, commands)| *commands);
    assert!(count("exercises.md") >= 15 && count("troubleshooting.md") >= 10, "{counts:?}");
}

/// Each of the chapter's 21 exercises has its heading.
#[test]
fn all_exercises_have_an_answer() {
    let page = std::fs::read_to_string(root().join("docs/exercises.md")).unwrap();
    let numbers: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    let told: Vec<u32> = numbers.iter().filter_map(|line| line.split('.').next()?.parse().ok()).collect();
    assert_eq!(told, (1..=21).collect::<Vec<u32>>());
}

#[test]
fn a_wrong_transcript_is_corrected() {
    let page = "```kdl\n// wrong.kdl\nmaterial 1\n```\n```console\n$ canaletto check -q wrong.kdl | wc -l\n7\n```\n";
    let (text, commands) = with_true_output(page);
    assert_eq!(commands, 1);
    assert!(text.contains("material") && text.contains("--> wrong.kdl:2:10") && text.ends_with("\n0\n```\n"), "{text}");
}
