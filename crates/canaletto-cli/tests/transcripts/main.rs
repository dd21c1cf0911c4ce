//! The book's transcripts: each command of a page is run as a reader would run it. `CANALETTO_BLESS=1` writes into the
//! page what is printed.
//!
//! - The lines after `$ ` in a `console` block are commands. What they print is compared with the page.
//! - The lines of a `bash` block are commands that succeed, and whose output isn't shown.
//! - A `kdl` block that begins with the comment `// NAME.kdl` is written to this file before the commands after it run.
//!   One that begins with `// + NAME.kdl` is put into the file, see `growing_scene`.
//! - A picture or drawing that a page's commands write and that the page shows is compared with the one in `docs`.
#![cfg(unix)]

mod growing_scene;
mod page;

use canaletto_io::picture::decode;
use growing_scene::with_nodes;
use page::{Piece, Run, figures_of, pieces, run, script, with_outputs};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Whether what is made takes the place of what the book says.
fn bless() -> bool {
    std::env::var_os("CANALETTO_BLESS").is_some()
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

/// A line without what differs from run to run: how long something took, the number of threads, and measured memory.
fn steady(line: &str) -> String {
    if line.starts_with("  read ") && line.contains(", render ") {
        return "  read …".into();
    }
    if line.starts_with("memory  ") {
        return "memory …".into();
    }
    match line.strip_suffix(" threads").and_then(|line| line.rsplit_once(' ')) {
        Some((before, _)) => format!("{before} … threads"),
        None => line.into(),
    }
}

#[test]
fn the_books_transcripts_are_true() {
    let docs = root().join("docs");
    let mut counts = BTreeMap::new();
    // A page in another language has the script of its sister, which therefore runs once for both.
    let mut known: BTreeMap<String, Run> = BTreeMap::new();
    let mut shown = 0;
    for path in pages_below(&docs) {
        let page = std::fs::read_to_string(&path).unwrap();
        let pieces = pieces(&page);
        if !pieces.iter().any(|piece| matches!(piece, Piece::Command(_) | Piece::SilentCommand(_))) {
            continue;
        }
        let made = known.entry(script(&pieces)).or_insert_with(|| run(&root(), &pieces));
        let text = with_outputs(&pieces, &made.outputs);
        let differs = |(is, says): &(&str, &str)| steady(is) != steady(says);
        if let Some((is, says)) = text.lines().zip(page.lines()).find(differs) {
            assert!(
                bless(),
                "{}: CANALETTO_BLESS=1 corrects it\nthe page says {says:?}\nthe command {is:?}",
                path.display()
            );
            std::fs::write(&path, &text).unwrap();
        } else if text.lines().count() != page.lines().count() {
            assert!(bless(), "{}: CANALETTO_BLESS=1 corrects how many lines are printed", path.display());
            std::fs::write(&path, &text).unwrap();
        }
        for name in figures_of(&page) {
            if let Some(figure) = made.figures.get(name.rsplit('/').next().unwrap()) {
                compare_figure(name, figure);
                shown += 1;
            }
        }
        counts.insert(path.strip_prefix(&docs).unwrap().to_string_lossy().into_owned(), made.outputs.len());
    }
    for (name, least) in
        [("exercises.md", 15), ("pt/exercicios.md", 15), ("troubleshooting.md", 10), ("tutorial.md", 3)]
    {
        assert!(counts.get(name).is_some_and(|&commands| commands >= least), "{name}: {counts:?}");
    }
    assert!(shown >= 9, "{shown} figures");
}

/// Compares a picture or a drawing in `docs` with what a page's command writes. Of pictures it compares pixels, not
/// bytes, which depend on the compressor's version.
fn compare_figure(name: &str, figure: &[u8]) {
    let path = root().join("docs").join(name);
    if bless() {
        std::fs::write(&path, figure).unwrap();
    }
    let golden = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; bless it", path.display()));
    let pixels = |png: &[u8]| decode(png).unwrap().image;
    let equal = golden == figure || (name.ends_with(".png") && pixels(&golden) == pixels(figure));
    assert!(equal, "{name} isn't what the page's command writes");
}

/// Each picture of the tutorial has its scene beside the others, for readers who don't type.
#[test]
fn the_tutorials_steps_are_scenes() {
    let page = page("tutorial.md");
    let (mut scene, mut steps) = (String::new(), 0);
    for piece in pieces(&page) {
        match piece {
            Piece::File { name: "tutorial.kdl", text } => scene = text,
            Piece::Nodes { name: "tutorial.kdl", text } => scene = with_nodes(&scene, &text),
            Piece::Command(command) | Piece::SilentCommand(command) if command.contains(" -o tutorial-") => {
                steps += 1;
                assert!(command.contains(&format!(" -o tutorial-{steps}.png")), "{command} is step {steps}");
                let path = root().join(format!("scenes/tutorial/tutorial-{steps}.kdl"));
                let told =
                    scene.replace("// tutorial.kdl\n", &format!("// Made from step {steps} of docs/tutorial.md.\n"));
                if bless() {
                    std::fs::write(&path, &told).unwrap();
                }
                let is = std::fs::read_to_string(&path).unwrap_or_default();
                assert_eq!(is, told, "{}: CANALETTO_BLESS=1 corrects it", path.display());
            }
            _ => {}
        }
    }
    assert!(steps >= 7, "{steps}");
}

/// The Portuguese pages follow their English sisters: the commands of one, the words of the other.
#[test]
fn portuguese_pages_follow_the_english_ones() {
    for (english, portuguese) in [("exercises.md", "pt/exercicios.md"), ("tutorial.md", "pt/tutorial.md")] {
        let (english, portuguese) = (page(english), page(portuguese));
        assert_eq!(script(&pieces(&english)), script(&pieces(&portuguese)));
        assert_eq!(figures_of(&english), figures_of(&portuguese));
    }

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
    let outputs = run(&root(), &pieces).outputs;
    assert_eq!(outputs.len(), 1);
    let text = with_outputs(&pieces, &outputs);
    assert!(text.contains("material") && text.contains("--> wrong.kdl:2:10") && text.ends_with("\n0\n```\n"), "{text}");
}
