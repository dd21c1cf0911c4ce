//! Tests of `canaletto grade`. `tests/grade.rs` at the root holds what is graded how.

mod support;

use canaletto_io::picture::decode;
use serde_json::Value;
use std::process::Output;
use support::{canaletto, root, says};

fn run(arguments: &[&str]) -> Output {
    canaletto(root()).args(arguments).output().unwrap()
}

const GLASS: &str = "scenes/chapter/fig-5.27b-glass.kdl";

/// Renders a scene with these flags, and grades the picture.
fn graded(flags: &[&str], more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("student.png");
    let file = file.to_str().unwrap();
    says(&run(&[&["render", GLASS, "-q", "-o", file], flags].concat()), 0, &[]);
    run(&[&["grade", GLASS, file, "-q"], more].concat())
}

#[test]
fn pictures_are_graded() {
    says(&graded(&[], &[]), 0, &["is right", "mean of 52,900 pixels"]);
    says(&graded(&["--samples", "16"], &[]), 0, &["is right"]);
    says(&graded(&["--size", "120x90"], &[]), 0, &["is right", "120 x 90 in place of the scene's 230 x 230"]);
    let no_ambient = graded(&["--set", "ambient=0"], &[]);
    says(&no_ambient, 4, &["has a mistake: no-ambient", "(5.33)", "pixel ", "canaletto explain scenes/chapter"]);
    says(&graded(&["--stage", "shadow"], &[]), 4, &["right up to the stage", "missing    full: refracted rays"]);
    says(&graded(&["--stage", "shadow"], &["--stage", "shadow"]), 0, &["is right"]);
    let both = ["--set", "camera.eye=60 90 10", "--set", "material.yellow.kd=0 1 0"];
    says(&graded(&both, &[]), 4, &["no known mistake explains it", "wrong      ", " connected pixels of "]);
    // A pattern is no mistake.
    says(&graded(&["--pattern", "center"], &[]), 0, &["is right", "remark     rays go through the pixels' centres"]);
    says(&graded(&["--transfer", "srgb"], &[]), 0, &["is right", "remark     the file declares another transfer"]);
}

/// The scene's own numbers are found by fits, and told with the object and the factor.
#[test]
fn numbers_are_found() {
    let kd = graded(&["--set", "material.yellow.kd=0 1 0"], &[]);
    says(&kd, 4, &["mistake: diffuse-colour", "of floor, wall", "kd is 0 1 0, not 0.7 0.7 0"]);
    let ks = graded(&["--set", "material.glass.ks=2 2 2"], &[]);
    says(&ks, 4, &["mistake: highlight-factor", "the highlights of ball are 2 times as bright as they should be"]);
    let eye = graded(&["--set", "camera.eye=100 40 30"], &["--json"]);
    says(&eye, 4, &[]);
    let found: Value = serde_json::from_slice(&eye.stdout).unwrap();
    assert_eq!(found["mistake"], "eye", "{found}");
    assert_eq!(found["finding"]["found"], serde_json::json!([100.0, 40.0, 30.0]), "{found}");
    assert!(!found["regions"].as_array().unwrap().is_empty(), "{found}");
}

#[test]
fn programs_read_json() {
    let output = graded(&["--set", "material.glass.n=100", "--set", "material.yellow.n=80"], &["--json"]);
    says(&output, 4, &[]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["verdict"], &found["mistake"]), (&"mistaken".into(), &"exponent".into()), "{found}");
    let evidence = found["evidence"].as_array().unwrap();
    assert!(!evidence.is_empty() && evidence.iter().all(|pixel| pixel["object"].is_string()), "{found}");
}

/// Students' files: a plain PPM, a larger size, and a JPEG with its losses.
#[test]
fn formats_of_students() {
    let folder = tempfile::tempdir().unwrap();
    let png = folder.path().join("student.png");
    let file = png.to_str().unwrap();
    says(&run(&["render", GLASS, "-q", "--no-shadows", "--size", "160x120", "-o", file]), 0, &[]);
    let image = decode(&std::fs::read(&png).unwrap()).unwrap().image;
    let rgb = image.rgb().unwrap();
    let mut ppm = format!("P3\n{} {}\n255\n", image.width, image.height);
    for i in 0..rgb[0].len() {
        ppm += &rgb.map(|c| ((c[i] * 255.0).round() as u8).to_string()).join(" ");
        ppm.push('\n');
    }
    let plain = folder.path().join("student.ppm");
    std::fs::write(&plain, ppm).unwrap();
    says(&run(&["grade", GLASS, plain.to_str().unwrap()]), 4, &["has a mistake: no-shadows"]);
    let jpeg = "crates/canaletto-cli/tests/data/glass-no-shadows.jpg";
    says(&run(&["grade", GLASS, jpeg]), 4, &["has a mistake: no-shadows", "on floor"]);
    says(&run(&["grade", GLASS, "crates/canaletto-cli/tests/data/glass.jpg"]), 0, &["is right"]);
}

#[test]
fn wrong_inputs_are_named() {
    says(&run(&["grade", GLASS, "none.png"]), 3, &["none.png"]);
    says(&run(&["grade", GLASS, GLASS]), 3, &["fig-5.27b-glass.kdl"]);
    says(&run(&["grade", "none.kdl", "docs/pictures/fig-5.27b-glass.png"]), 3, &["none.kdl"]);
    let picture = "docs/pictures/fig-5.27b-glass.png";
    says(&run(&["grade", GLASS, picture, "--integrator", "zbuffer"]), 2, &["classic integrator"]);
    says(&run(&["grade", GLASS, picture, "--crop", "0,0,20,20"]), 2, &["230 x 230", "20 x 20"]);
}
