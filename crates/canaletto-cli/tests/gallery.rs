//! The book's gallery: each of its pictures is what the command below it makes. A part in the middle of each is
//! rendered again. `CANALETTO_BLESS=1` renders pictures that differ as a whole and replaces them.
#![cfg(unix)]

mod support;

use canaletto_io::picture::{Image, decode};
use std::path::Path;
use support::{canaletto, root};

/// The width and height of the part that is rendered again.
const PART: [u32; 2] = [96, 64];

/// A picture's file name and the arguments of its command.
struct Exhibit {
    picture: String,
    arguments: Vec<String>,
}

/// The pictures of the page. Each has a link to its scene, and a command.
fn exhibits(page: &str) -> Vec<Exhibit> {
    let mut exhibits = Vec::new();
    for part in page.split("pictures/").skip(1) {
        let end = part.find([')', '"']).expect("the picture's link ends");
        let (picture, rest) = part.split_at(end);
        let command = rest.lines().find(|line| line.starts_with("canaletto render "));
        let arguments: Vec<String> = command.expect(picture).split_whitespace().skip(1).map(str::to_owned).collect();
        let scene = &arguments[1];
        assert!(rest.contains(&format!("](../{scene})")), "{picture} has no link to {scene}");
        exhibits.push(Exhibit { picture: picture.to_owned(), arguments });
    }
    exhibits
}

fn render(arguments: &[String], crop: Option<[u32; 4]>, file: &Path) {
    let mut command = canaletto(root());
    command.args(arguments).arg("-q").arg("-o").arg(file);
    if let Some(crop) = crop {
        command.args(["--crop", &crop.map(|side| side.to_string()).join(",")]);
    }
    assert!(command.status().unwrap().success(), "{arguments:?}");
}

fn image(file: &Path) -> Image {
    decode(&std::fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))).unwrap().image
}

/// Whether `part` is this part of the picture. Pixels are compared, not bytes, which depend on the compressor's
/// version.
fn is_part(whole: &Image, [left, top, width, height]: [u32; 4], part: &Image) -> bool {
    let (Some(whole_colors), Some(colors)) = (whole.rgb(), part.rgb()) else { return false };
    let row = |y: u32, of: u32, from: u32| (y * of + from) as usize..(y * of + from + width) as usize;
    (part.width, part.height) == (width, height)
        && (0..height).all(|y| {
            let (there, here) = (row(top + y, whole.width, left), row(y, width, 0));
            (0..3).all(|c| whole_colors[c][there.clone()] == colors[c][here.clone()])
        })
}

#[test]
fn the_gallerys_commands_make_its_pictures() {
    let page = std::fs::read_to_string(root().join("docs/gallery.md")).unwrap();
    let exhibits = exhibits(&page);
    assert!(exhibits.len() >= 10, "{} pictures", exhibits.len());
    let folder = tempfile::tempdir().unwrap();
    let mut changed = Vec::new();
    for Exhibit { picture, arguments } in exhibits {
        let golden = root().join("docs/pictures").join(&picture);
        let shown = image(&golden);
        let [width, height] = [shown.width.min(PART[0]), shown.height.min(PART[1])];
        let crop = [(shown.width - width) / 2, (shown.height - height) / 2, width, height];
        let made = folder.path().join("part.png");
        render(&arguments, Some(crop), &made);
        if is_part(&shown, crop, &image(&made)) {
            continue;
        }
        if std::env::var_os("CANALETTO_BLESS").is_some() {
            render(&arguments, None, &golden);
        } else {
            changed.push(picture);
        }
    }
    assert!(changed.is_empty(), "changed: {changed:?}; CANALETTO_BLESS=1 replaces them");
}
