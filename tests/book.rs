//! The book's pages: where their links lead, and how their pictures are shown.

use canaletto_io::picture::decode;
use canaletto_tests::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The pages of the book, README and others with links, each with its text.
fn pages() -> Vec<(PathBuf, String)> {
    let folders =
        ["docs", "docs/design", "docs/pt", "tests"].map(|folder| std::fs::read_dir(root().join(folder)).unwrap());
    let files = folders.into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut pages: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.extend(["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "fuzz/README.md"].map(|page| root().join(page)));
    pages.into_iter().map(|path| (path.clone(), std::fs::read_to_string(&path).unwrap())).collect()
}

/// The files that a page refers to, by `](…)` and `src="…"`, with what follows them on the page.
fn targets(page: &str) -> impl Iterator<Item = (&str, &str)> {
    let links = page.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    let sources = page.split("src=\"").skip(1).filter_map(|rest| rest.split_once('"'));
    links.chain(sources)
}

fn file(page: &Path, target: &str) -> PathBuf {
    page.parent().unwrap().join(target.split('#').next().unwrap())
}

#[test]
fn links_lead_somewhere() {
    let mut links = 0;
    for (path, page) in pages() {
        for (target, _) in targets(&page).filter(|(target, _)| !target.contains("://") && !target.starts_with('#')) {
            assert!(file(&path, target).exists(), "{} links to {target}", path.display());
            links += 1;
        }
    }
    assert!(links > 200, "{links}");
}

/// A picture narrower than 400 pixels is shown larger, by a whole number. Its pixels can then stay sharp squares.
#[test]
fn small_pictures_are_shown_at_whole_multiples() {
    let mut enlarged = 0;
    for (path, page) in pages().into_iter().filter(|(path, _)| !path.ends_with("README.md")) {
        // The table of presets has small pictures.
        let shown_alone = |target: &str| target.ends_with(".png") && !target.contains("/presets/");
        for (target, rest) in targets(&page).filter(|(target, _)| shown_alone(target)) {
            let width = decode(&std::fs::read(file(&path, target)).unwrap()).unwrap().image.width;
            let tag = rest.split('>').next().unwrap();
            let shown = tag.split_once("width=\"").and_then(|(_, rest)| rest.split('"').next()?.parse::<u32>().ok());
            let shown = shown.filter(|_| page.contains(&format!("src=\"{target}\""))).unwrap_or(width);
            let name = format!("{} shows {target}, {width} pixels wide, with a width of {shown}", path.display());
            assert!((400..=980).contains(&shown) && shown % width == 0, "{name}");
            enlarged += u32::from(shown > width);
        }
    }
    assert!(enlarged > 30, "{enlarged}");
}

/// What the pages say of versions is what Cargo knows.
#[test]
fn versions_on_pages_are_true() {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let value = |key: &str| {
        let line = manifest.lines().find(|line| line.starts_with(key)).unwrap();
        line.split('"').nth(1).unwrap().to_owned()
    };
    let (rust, glam) = (value("rust-version = "), value("glam = "));
    let library = std::fs::read_to_string(root().join("docs/library.md")).unwrap();
    assert!(library.contains(&format!("glam = \"{glam}\"")), "glam is {glam}");
    for page in ["docs/library.md", "docs/installing.md", "README.md"] {
        let page_text = std::fs::read_to_string(root().join(page)).unwrap();
        assert!(page_text.contains(&format!("Rust {rust}")), "{page}: Rust is {rust}");
    }
}

#[test]
fn diagrams_are_well_formed_and_used() {
    let shown: BTreeSet<PathBuf> = pages()
        .iter()
        .flat_map(|(path, page)| targets(page).map(|(target, _)| file(path, target)).collect::<Vec<_>>())
        .filter_map(|path| path.canonicalize().ok())
        .collect();
    let mut diagrams = 0;
    for entry in std::fs::read_dir(root().join("docs/diagrams")).unwrap() {
        let path = entry.unwrap().path().canonicalize().unwrap();
        assert!(shown.contains(&path), "no page shows {}", path.display());
        let text = std::fs::read_to_string(&path).unwrap();
        let drawing = roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let svg = drawing.root_element();
        assert_eq!(svg.tag_name().namespace(), Some("http://www.w3.org/2000/svg"), "{}", path.display());
        assert!(svg.has_attribute("viewBox"), "{}", path.display());
        // A page that shows a drawing as a picture loads nothing for it. A picture may stand in the drawing itself.
        let holds = |node: &roxmltree::Node| node.attribute("href").is_some_and(|href| href.starts_with("data:"));
        let loads =
            svg.descendants().any(|node| ["script", "image", "use"].contains(&node.tag_name().name()) && !holds(&node));
        assert!(!loads, "{} loads something", path.display());
        diagrams += 1;
    }
    assert!(diagrams >= 7, "{diagrams}");
}
