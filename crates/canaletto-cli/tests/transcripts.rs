//! The book's transcripts: each `console` block of a page is run as a reader would run it, and what it prints is
//! compared with the page. `CANALETTO_BLESS=1` writes what is printed into the page instead.
//!
//! A page has a folder of its own, in which `scenes` is that of the project. A `kdl` block that begins with the comment
//! `// NAME.kdl` is written to this file there before the commands after it run.
#![cfg(unix)]

use std::collections::BTreeMap;
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

/// A piece of a page, in the page's order.
enum Piece<'a> {
    Line(&'a str),
    /// A file that is written before the commands after it run.
    File {
        name: &'a str,
        text: String,
    },
    Command(&'a str),
}

fn pieces(page: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        pieces.push(Piece::Line(line));
        if !["```console", "```kdl"].contains(&line) {
            continue;
        }
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        if line == "```kdl" {
            let name = block.first().and_then(|first| first.strip_prefix("// ")).filter(|name| name.ends_with(".kdl"));
            pieces.extend(name.map(|name| Piece::File { name, text: block.join("\n") + "\n" }));
            pieces.extend(block.into_iter().map(Piece::Line));
        } else {
            pieces.extend(block.into_iter().filter_map(|line| line.strip_prefix("$ ")).map(Piece::Command));
        }
        pieces.push(Piece::Line("```"));
    }
    pieces
}

/// All files and commands of a page. Pages of equal scripts print the same.
fn script(pieces: &[Piece]) -> String {
    let mut script = String::new();
    for piece in pieces {
        match piece {
            Piece::Line(_) => {}
            Piece::File { name, text } => writeln!(script, "> {name}\n{text}").unwrap(),
            Piece::Command(command) => writeln!(script, "$ {command}").unwrap(),
        }
    }
    script
}

/// What each command of a page prints.
fn outputs(pieces: &[Piece]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(root().join("scenes"), folder.path().join("scenes")).unwrap();
    let mut outputs = Vec::new();
    for piece in pieces {
        match piece {
            Piece::Line(_) => {}
            Piece::File { name, text } => std::fs::write(folder.path().join(name), text).unwrap(),
            Piece::Command(command) => outputs.push(printed(folder.path(), command)),
        }
    }
    outputs
}

/// A page with these outputs in place of what it says its commands print.
fn with_outputs(pieces: &[Piece], outputs: &[String]) -> String {
    let mut text = String::new();
    let mut outputs = outputs.iter();
    for piece in pieces {
        match piece {
            Piece::Line(line) => writeln!(text, "{line}").unwrap(),
            Piece::File { .. } => {}
            // Without a last empty line, which the next command's line would otherwise follow.
            Piece::Command(command) => writeln!(text, "$ {command}\n{}", outputs.next().unwrap().trim_end()).unwrap(),
        }
    }
    text
}

/// The pages in a folder and in the folders below it, in a fixed order.
fn pages_below(folder: &Path) -> Vec<PathBuf> {
    let mut pages = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            pages.extend(pages_below(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            pages.push(path);
        }
    }
    pages.sort();
    pages
}

fn page(name: &str) -> String {
    std::fs::read_to_string(root().join("docs").join(name)).unwrap()
}

#[test]
fn the_books_transcripts_are_true() {
    let bless = std::env::var_os("CANALETTO_BLESS").is_some();
    let docs = root().join("docs");
    let mut counts = BTreeMap::new();
    // A page in another language has the script of its sister, which therefore runs once for both.
    let mut known: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in pages_below(&docs) {
        let page = std::fs::read_to_string(&path).unwrap();
        if !page.contains("```console\n") {
            continue;
        }
        let pieces = pieces(&page);
        let outputs = known.entry(script(&pieces)).or_insert_with(|| outputs(&pieces));
        let text = with_outputs(&pieces, outputs);
        if bless {
            std::fs::write(&path, &text).unwrap();
        } else if let Some((is, should)) = text.lines().zip(page.lines()).find(|(is, should)| is != should) {
            panic!("{}: CANALETTO_BLESS=1 corrects it\nthe page says {should:?}\nthe command {is:?}", path.display());
        } else {
            assert_eq!(text.lines().count(), page.lines().count(), "{}", path.display());
        }
        counts.insert(path.strip_prefix(&docs).unwrap().to_string_lossy().into_owned(), outputs.len());
    }
    for (name, least) in [("exercises.md", 15), ("pt/exercicios.md", 15), ("troubleshooting.md", 10)] {
        assert!(counts.get(name).is_some_and(|&commands| commands >= least), "{name}: {counts:?}");
    }
}

/// The Portuguese pages follow their English sisters: the commands of one, the words of the other.
#[test]
fn portuguese_pages_follow_the_english_ones() {
    let (english, portuguese) = (page("exercises.md"), page("pt/exercicios.md"));
    assert_eq!(script(&pieces(&english)), script(&pieces(&portuguese)));

    // A row's English word and the file to read first.
    let rows = |glossary: &str, word: usize| -> Vec<(String, String)> {
        let cells = glossary.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
        let rows = cells.filter(|cells| cells.len() > 2 && cells[cells.len() - 2].starts_with('`'));
        rows.map(|cells| (cells[word].to_owned(), cells[cells.len() - 2].to_owned())).collect()
    };
    let (english, portuguese) = (rows(&page("glossary.md"), 1), rows(&page("pt/glossario.md"), 2));
    assert!(english.len() > 150, "{}", english.len());
    for row in &english {
        assert!(portuguese.contains(row), "docs/pt/glossario.md lacks the row {row:?} of docs/glossary.md");
    }
    assert_eq!(english, portuguese);
}

/// Each of the chapter's 21 exercises has its heading, in both languages.
#[test]
fn all_exercises_have_an_answer() {
    for name in ["exercises.md", "pt/exercicios.md"] {
        let page = page(name);
        let headings = page.lines().filter_map(|line| line.strip_prefix("## "));
        let told: Vec<u32> = headings.filter_map(|heading| heading.split('.').next()?.parse().ok()).collect();
        assert_eq!(told, (1..=21).collect::<Vec<u32>>(), "{name}");
    }
}

#[test]
fn a_wrong_transcript_is_corrected() {
    let page = "```kdl\n// wrong.kdl\nmaterial 1\n```\n```console\n$ canaletto check -q wrong.kdl | wc -l\n7\n```\n";
    let pieces = pieces(page);
    let outputs = outputs(&pieces);
    assert_eq!(outputs.len(), 1);
    let text = with_outputs(&pieces, &outputs);
    assert!(text.contains("material") && text.contains("--> wrong.kdl:2:10") && text.ends_with("\n0\n```\n"), "{text}");
}
