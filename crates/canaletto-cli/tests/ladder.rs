//! Tests of `canaletto ladder`.

mod support;

use canaletto_io::picture::{Image, decode};
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use support::{canaletto, root, says};

fn run(arguments: &[&str], output: &Path) -> Output {
    canaletto(root()).args(arguments).arg("-o").arg(output).output().unwrap()
}

fn image(file: &Path) -> Image {
    decode(&std::fs::read(file).unwrap()).unwrap().image
}

/// The 8-bit values of a part of a picture.
fn part(image: &Image, [left, top]: [u32; 2], [width, height]: [u32; 2]) -> Vec<[u8; 3]> {
    let rgb = image.rgb().unwrap();
    let pixel = |x: u32, y: u32| rgb.map(|c| (c[(y * image.width + x) as usize] * 255.0).round() as u8);
    (top..top + height).flat_map(|y| (left..left + width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

const SCENE: &str = "scenes/chapter/ladder.kdl";
/// The size of each picture.
const SIZE: [u32; 2] = [180, 120];

/// Each picture of the sheet is that of `render`, pixel for pixel.
#[test]
fn pictures_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sheet.png");
    let output = run(&["ladder", SCENE, "--size", "180x120", "--json", "-q"], &file);
    says(&output, 0, &[]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rungs = found["rungs"].as_array().unwrap();
    let names: Vec<&str> = rungs.iter().map(|rung| rung["name"].as_str().unwrap()).collect();
    let expected =
        ["unlit", "diffuse", "ambient", "specular", "shadow", "reflection", "refraction", "textures", "anti-aliasing"];
    assert_eq!(names, expected);
    // Every term changes something in this scene.
    assert!(rungs[1..].iter().all(|rung| rung["changed"].as_u64().unwrap() > 100), "{found}");

    // The scene without textures, beside the files that it names.
    let plain = root().join(SCENE).with_file_name("camera.kdl");
    let text = std::fs::read_to_string(root().join(SCENE)).unwrap();
    let text = text.replace(" texture \"marble\" use=\"diffuse\"", "");
    let text: String =
        text.lines().filter(|line| !line.starts_with("texture")).map(|line| format!("{line}\n")).collect();
    std::fs::copy(plain, folder.path().join("camera.kdl")).unwrap();
    let plain = folder.path().join("plain.kdl");
    std::fs::write(&plain, text).unwrap();
    let plain = plain.to_str().unwrap();

    let sheet = image(&file);
    let cell = [(sheet.width - 6) / 3, (sheet.height - 6) / 3];
    let own = folder.path().join("own.png");
    for (index, name) in (0..).zip(&names) {
        let more: &[&str] = match *name {
            "refraction" => &[plain, "--stage", "full"],
            "textures" => &[SCENE],
            "anti-aliasing" => &[SCENE, "--pattern", "jittered", "--samples", "16"],
            stage => &[plain, "--stage", stage],
        };
        says(&run(&[&["render", "--size", "180x120", "-q"], more].concat(), &own), 0, &[]);
        let corner = [6 + index % 3 * cell[0], 6 + index / 3 * cell[1]];
        assert!(part(&sheet, corner, SIZE) == part(&image(&own), [0, 0], SIZE), "{name}");
        // Ink on paper below.
        let label = part(&sheet, [corner[0], corner[1] + SIZE[1]], [SIZE[0], cell[1] - SIZE[1] - 6]);
        let inked = label.iter().filter(|pixel| pixel[0] > 200).count();
        assert!((100..label.len() / 4).contains(&inked), "{name}: {inked} pixels of text");
    }
}

/// The book's picture.
#[test]
fn the_book_shows_a_true_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ladder.png");
    let output = run(&["ladder", SCENE, "-q"], &file);
    says(
        &output,
        0,
        &["9 pictures of 230 x 230 pixels", "4 specular       + sum of l ks (r.L)^n", "16 rays per pixel"],
    );
    let shown = root().join("docs/pictures/ladder.png");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        std::fs::copy(&file, &shown).unwrap();
    }
    assert!(image(&file) == image(&shown), "CANALETTO_BLESS=1 replaces the book's picture");
}

/// What a scene lacks changes nothing, and an integrator without stages is replaced.
#[test]
fn other_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let small = ["--size", "40x40", "-q"];
    let of = |scene: &str, more: &[&str]| run(&[&["ladder", scene], &small[..], more].concat(), &file);
    says(&of("scenes/chapter/box-5.4.kdl", &[]), 0, &["6 reflection     + k I(r)                  no pixel changes"]);
    says(
        &of("scenes/chapter/box-5.4.kdl", &["--no-shadows"]),
        0,
        &["5 shadow         each l times f_s          no pixel"],
    );
    says(&of("scenes/red-wall.kdl", &[]), 0, &["the scene's integrator is radiosity"]);
    says(&of("scenes/still-life.kdl", &[]), 0, &["2 rays per pixel, 16 jittered where they differ"]);
    let exr = folder.path().join("out.exr");
    says(&run(&[&["ladder", SCENE], &small[..]].concat(), &exr), 0, &["out.exr"]);
    let piped = run(&[&["ladder", SCENE, "--json"], &small[..]].concat(), Path::new("-"));
    assert_eq!(decode(&piped.stdout).unwrap().image, image_of_png(&of(SCENE, &[]), &file));
}

fn image_of_png(output: &Output, file: &Path) -> Image {
    says(output, 0, &[]);
    image(file)
}

#[test]
fn mistakes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let with = |more: &[&str]| run(&[&["ladder", SCENE, "-q"], more].concat(), &file);
    says(&with(&["--stage", "shadow"]), 2, &["shows all of them"]);
    says(&with(&["--integrator", "zbuffer"]), 2, &["classic integrator", "compare-methods"]);
    says(&with(&["--size", "60000x60000"]), 2, &["the most is", "--size"]);
    says(&run(&["ladder", SCENE, "-q"], &folder.path().join("out.gif")), 2, &["isn't a format of pictures"]);
    says(&run(&["ladder", SCENE, "-q"], &folder.path().join("no/out.png")), 1, &["no folder"]);
    says(&run(&["ladder", "scenes/none.kdl"], &file), 3, &["none.kdl"]);
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "nothing is written");
}
