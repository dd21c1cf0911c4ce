//! Tests of `canaletto compare-methods`.

mod support;

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use support::{canaletto, root, says};

fn run(arguments: &[&str], output: &Path) -> Output {
    canaletto(root()).arg("compare-methods").args(arguments).arg("-o").arg(output).output().unwrap()
}

const MIRROR: &str = "scenes/chapter/fig-5.26b-mirror.kdl";

#[test]
fn pictures_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let output = run(&[MIRROR, "--size", "80x80", "--json", "-q"], &file);
    says(&output, 0, &[]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["reference"], &found["pixels"]), (&"whitted".into(), &6400.into()));
    let comparison = &found["comparisons"][0];
    assert_eq!(comparison["method"], "zbuffer");
    let causes = comparison["causes"].as_array().unwrap();
    let count = |name: &str| causes.iter().find(|c| c["cause"] == name).map_or(0, |c| c["pixels"].as_u64().unwrap());
    assert_eq!(causes.iter().map(|c| c["pixels"].as_u64().unwrap()).sum::<u64>(), comparison["differing"]);
    assert!(count("mirror") > 800 && count("unexplained") == 0, "{comparison}");
    let mirror = causes.iter().find(|c| c["cause"] == "mirror").unwrap();
    assert_eq!(mirror["worst"]["object"], "wall");
    // The pictures are those of `render`, pixel for pixel.
    for method in ["zbuffer", "whitted"] {
        let own = folder.path().join(format!("own.{method}.png"));
        let mut render = Command::new(env!("CARGO_BIN_EXE_canaletto"));
        render.current_dir(root()).args(["render", MIRROR, "--size", "80x80", "-q", "--integrator", method, "-o"]);
        assert!(render.arg(&own).status().unwrap().success());
        let of = |path: &Path| canaletto_io::picture::decode(&std::fs::read(path).unwrap()).unwrap().image;
        assert!(of(&own) == of(&folder.path().join(format!("out.{method}.png"))), "{method}");
    }
    let picture = canaletto_io::picture::decode(&std::fs::read(&file).unwrap()).unwrap().image;
    assert!(picture.width >= 80 && picture.height > 80);
}

#[test]
fn thresholds_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let arguments = [MIRROR, "--size", "40x40", "-q"];
    let with = |more: &[&str]| run(&[&arguments, more].concat(), &file);
    says(&with(&["--threshold", "unexplained=0"]), 0, &["zbuffer against whitted", "mirror", "on wall"]);
    says(&with(&["--threshold", "mirror=3"]), 4, &["zbuffer: mirror is over the threshold 3"]);
    says(&with(&["--no-clobber"]), 1, &["exists"]);
    says(&run(&arguments, &folder.path().join("out.exr")), 0, &["out.whitted.exr"]);
}

/// A lamp that shines on a room by radiosity, and on nothing by classic ray tracing.
#[test]
fn radiosity_differs_by_indirect_light() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let room = ["scenes/red-wall.kdl", "--size", "60x60", "--methods", "whitted,radiosity", "-q"];
    let output = run(&[&room[..], &["--json", "--threshold", "unexplained=0"]].concat(), &file);
    says(&output, 0, &[]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let comparison = &found["comparisons"][0];
    assert_eq!((&found["reference"], &comparison["method"]), (&"whitted".into(), &"radiosity".into()));
    let causes = comparison["causes"].as_array().unwrap();
    assert_eq!(causes.len(), 1, "{comparison}");
    assert_eq!(causes[0]["cause"], "indirect light");
    assert!(
        causes[0]["pixels"].as_u64().unwrap() > 2000 && causes[0]["worst"]["shares"][0]["share"] == 1.0,
        "{comparison}"
    );
    for method in ["whitted", "radiosity"] {
        assert!(folder.path().join(format!("out.{method}.png")).exists());
    }
}

#[test]
fn mistakes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.png");
    let with = |more: &[&str]| run(&[&[MIRROR], more].concat(), &file);
    says(&with(&["--methods", "zbuffer"]), 2, &["two methods or more", "whitted"]);
    says(&with(&["--methods", "zbuffer,zbuffer"]), 2, &["names zbuffer twice"]);
    says(&with(&["--methods", "zbuffer,whited"]), 2, &["whitted"]);
    says(&with(&["--integrator", "whitted"]), 2, &["--methods"]);
    says(&with(&["--threshold", "miror=1"]), 2, &["did you mean mirror?"]);
    says(&with(&["--tolerance", "-1"]), 2, &["between 0 and 255"]);
    says(&run(&[MIRROR], Path::new("-")), 2, &["need files"]);
    says(&run(&[MIRROR], &folder.path().join("out.gif")), 2, &["isn't a format of pictures"]);
    says(&run(&[MIRROR], &folder.path().join("no/out.png")), 1, &["no folder"]);
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "nothing is written");
}

/// The book's page shows the beginning of an explanation.
#[test]
fn the_book_shows_a_true_triangle() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_canaletto"));
    command.current_dir(root()).args(["explain", "scenes/zbuffer.kdl", "--pixel", "610,240"]);
    let said = String::from_utf8(command.output().unwrap().stdout).unwrap();
    let page = std::fs::read_to_string(root().join("docs/zbuffer.md")).unwrap();
    let start = page.find("camera ray through").expect("the page has its block");
    let end = start + page[start..].find("```").expect("the block ends");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        let from = said.find("camera ray through").expect("the pixel has a ray");
        let to = said[from..].find("camera ray, depth 1").expect("the triangle comes before the ray");
        let page = format!("{}{}{}", &page[..start], &said[from..from + to], &page[end..]);
        std::fs::write(root().join("docs/zbuffer.md"), page).unwrap();
    } else {
        assert!(said.contains(&page[start..end]), "{said}");
    }
}

/// The book's pictures and its numbers are those of the command above them.
#[test]
fn the_book_shows_a_true_comparison() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("zbuffer-causes.png");
    let output = run(&["scenes/canal.kdl", "--size", "400x250", "-q"], &file);
    says(&output, 0, &[]);
    let said = String::from_utf8(output.stdout).unwrap();
    let numbers = said.split_once("\n\n").unwrap().1;
    let page = root().join("docs/zbuffer.md");
    let golden = |name: &str| root().join("docs/pictures").join(name);
    let pictures = [
        (file, golden("zbuffer-causes.png")),
        (folder.path().join("zbuffer-causes.whitted.png"), golden("canal.png")),
        (folder.path().join("zbuffer-causes.zbuffer.png"), golden("canal-zbuffer.png")),
    ];
    let text = std::fs::read_to_string(&page).unwrap();
    let start = text.find("zbuffer against whitted").expect("the page has the numbers");
    let end = start + text[start..].find("```").expect("the block ends");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        pictures.iter().for_each(|(file, golden)| assert!(std::fs::copy(file, golden).is_ok()));
        std::fs::write(&page, format!("{}{numbers}{}", &text[..start], &text[end..])).unwrap();
        return;
    }
    let of = |path: &Path| canaletto_io::picture::decode(&std::fs::read(path).unwrap()).unwrap().image;
    for (file, golden) in pictures {
        assert!(of(&file) == of(&golden), "{} is old; CANALETTO_BLESS=1 writes it anew", golden.display());
    }
    assert_eq!(&text[start..end], numbers);
}
