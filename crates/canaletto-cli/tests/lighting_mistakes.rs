//! Bad inputs of radiosity and of the z-buffer: each is a message that names the place, what was expected and what to
//! do, and leaves no file.

mod support;

use std::process::Stdio;
use support::Folder;

const CAMERA: &str = "camera { eye 0 1 5; center 0 1 0; size 12 8 }\n";
const WALL: &str = "material \"wall\" { kd 0.5 }\nbox name=\"block\" material=\"wall\" { min -1 -1 -1; max 1 0 1 }\n";
const LAMP: &str = "light \"omni\" { position 0 2 0 }\n";

/// The exit code for a wrong scene, as the manual says.
const SCENE: i32 = 3;

/// Renders a scene in a folder of its own; returns the exit code, what stderr says, and the files that came.
fn render(scene: &str, flags: &[&str]) -> (i32, String, Vec<String>) {
    let folder = Folder::new("s.kdl", scene);
    folder.write("flat.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 1\n");
    let mut command = folder.command("render s.kdl -o out.png");
    command.args(flags);
    if !flags.contains(&"--progress") {
        command.args(["--progress", "none"]);
    }
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let names = folder.names().into_iter().filter(|name| name != "flat.obj");
    (output.status.code().unwrap_or(-1), said, names.collect())
}

/// Asserts that a scene is refused with these words, and that nothing is written.
#[track_caller]
fn refused(scene: &str, words: &[&str]) {
    let (code, said, files) = render(scene, &[]);
    assert_eq!(code, SCENE, "{scene}\n{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "no {word:?} for\n{scene}\n{said}"));
    assert!(!said.contains("panicked") && said.len() < 2000, "{said}");
    assert!(files.is_empty(), "{scene}\n{files:?}");
}

/// Words of the node of the integrator that are out of range or unknown: kind, word, and what the message says. All
/// stand in line 2.
const WORDS: [(&str, &str, &[&str]); 24] = [
    ("radiosity", "error 0", &["error is 0; it must be between 0.0001 and 0.5"]),
    ("radiosity", "error -1", &["error is -1; it must be between"]),
    ("radiosity", "error 0.9", &["error is 0.9; it must be between"]),
    ("radiosity", "error #nan", &["error is #nan, which is no number"]),
    ("radiosity", "max-patches 0", &["max-patches is 0; it must be at least 1"]),
    ("radiosity", "max-patches -1", &["max-patches takes whole numbers from 0, got -1"]),
    ("radiosity", "light-samples 0", &["light-samples is 0; it must be between 1 and 4096"]),
    ("radiosity", "method \"hierachical\"", &["method can't be \"hierachical\"", "did you mean \"hierarchical\"?"]),
    ("radiosity", "show \"ful\"", &["show can't be \"ful\"", "\"patches\", \"solution\" or \"full\""]),
    ("radiosity", "shadows #true", &["the integrator \"radiosity\" has no shadows", "possible here: method, error"]),
    (
        "radiosity",
        "shading \"phong\"",
        &["the integrator \"radiosity\" has no shading", "possible here: method, error"],
    ),
    ("zbuffer", "shading \"fong\"", &["shading can't be \"fong\"", "\"flat\", \"gouraud\" or \"phong\""]),
    ("zbuffer", "shadows \"maps\"", &["shadows can't be \"maps\"", "did you mean \"map\"?"]),
    ("zbuffer", "multisampling 3", &["multisampling is 3; a pixel has 1, 2, 4 or 8 samples"]),
    ("zbuffer", "multisampling 0", &["multisampling is 0; a pixel has 1, 2, 4 or 8 samples"]),
    ("zbuffer", "tolerance 0", &["tolerance is 0; it must be between 0.001 and 1000 pixels"]),
    ("zbuffer", "tolerance -1", &["tolerance is -1; it must be between"]),
    ("zbuffer", "tolerance #inf", &["tolerance is infinite, but must be finite"]),
    ("zbuffer", "shadow-map-size 3", &["shadow-map-size is 3; a shadow map has between 16 and 8192 texels on a side"]),
    ("zbuffer", "shadow-map-size 100000", &["shadow-map-size is 100000; a shadow map has between"]),
    ("zbuffer", "method \"full\"", &["the integrator \"zbuffer\" has no method", "possible here: shading"]),
    ("zbuffer", "max-depth 3", &["the integrator \"zbuffer\" has no max-depth", "possible here: shading"]),
    ("whitted", "show \"full\"", &["the integrator \"whitted\" has no show", "possible here: max-depth"]),
    ("radiocity", "error 1", &["integrator can't be \"radiocity\"", "did you mean \"radiosity\"?"]),
];

#[test]
fn words_that_an_integrator_does_not_take() {
    for (kind, word, said) in WORDS {
        let scene = format!("{CAMERA}integrator \"{kind}\" {{ {word} }}\n{WALL}{LAMP}");
        let words: Vec<&str> = said.iter().copied().chain(["s.kdl:2:"]).collect();
        refused(&scene, &words);
    }
}

#[test]
fn near_and_far_planes_without_a_space_between() {
    for (planes, said) in [
        ("near 5; far 2", "near is 5 and far is 2; they must satisfy 0 < near < far"),
        ("near 2; far 2", "near is 2 and far is 2; they must satisfy 0 < near < far"),
        ("near 0", "near is 0; they must satisfy 0 < near < far"),
        ("near 0; far 9", "near is 0 and far is 9"),
        ("near -1; far 5", "near is -1 and far is 5"),
        ("near #nan", "near is #nan, which is no number"),
    ] {
        let camera = format!("camera {{ eye 0 1 5; center 0 1 0; size 12 8; {planes} }}\n");
        refused(&format!("{camera}integrator \"zbuffer\"\n{WALL}{LAMP}"), &[said, "s.kdl:1:"]);
    }
}

#[test]
fn emission_that_is_no_light() {
    for (emission, said) in [
        ("-1 0 0", "emission is -1 0 0; each component must be finite and 0 or more"),
        ("#nan 0 0", "emission is #nan, which is no number"),
        ("#inf 0 0", "emission is infinite, but must be finite"),
        ("1e39 0 0", "emission is 1e39, beyond what can be computed with"),
    ] {
        let lamp = format!("material \"lamp\" {{ kd 0; emission {emission} }}\n");
        let ball = "sphere material=\"lamp\" { center 0 2 0; radius 1 }\n";
        refused(&format!("{CAMERA}integrator \"radiosity\"\n{lamp}{ball}{WALL}"), &[said, "s.kdl:3:"]);
    }
}

#[test]
fn scenes_without_a_balance_of_light() {
    let radiosity = format!("{CAMERA}integrator \"radiosity\"\n");
    refused(&format!("{radiosity}{WALL}"), &["s.kdl: radiosity: nothing gives light", "needs a light, a material"]);
    refused(
        &format!("{radiosity}ambient 1 1 1\nbackground 1 1 1\n{WALL}"),
        &["nothing gives light", "ambient light and the background are none"],
    );
    let bright = "material \"snow\" { kd 0.4 1.2 0.4 }\nsphere material=\"snow\" { center 0 0 0; radius 1 }\n";
    refused(
        &format!("{radiosity}{bright}{LAMP}"),
        &["s.kdl: radiosity: material \"snow\" reflects 1.2 of the light", "a kd of at most 1"],
    );
    for method in ["hierarchical", "shooting", "full"] {
        let integrator = format!("integrator \"radiosity\" {{ method \"{method}\"; error 0.1 }}\n");
        let room = "material \"white\" { kd 1 }\nmaterial \"wall\" { kd 0.5 }\n\
                    box name=\"room\" material=\"white\" { min -2 -2 -6; max 2 3 6 }\n";
        refused(
            &format!("{CAMERA}{integrator}{room}{LAMP}"),
            &["s.kdl: radiosity: the light has no end", "material \"white\" reflects 1 of it", "a smaller kd"],
        );
    }
}

#[test]
fn surfaces_without_an_area() {
    let radiosity = format!("{CAMERA}integrator \"radiosity\"\n");
    let flat = "triangle { a 0 0 0; b 1 1 1; c 2 2 2 }\n";
    // The place of the triangle is told, too.
    refused(
        &format!("{radiosity}{flat}{LAMP}"),
        &["s.kdl:3:", "the triangle has no area", "radiosity: no surface has an area"],
    );
    refused(
        &format!("{radiosity}mesh file=\"flat.obj\"\n{LAMP}"),
        &["s.kdl:3:", "\"flat.obj\": nothing in it has an area: 2 triangles"],
    );
    refused(&format!("{radiosity}{LAMP}"), &["radiosity: no surface has an area"]);
    // A plane by itself has a part below the lamp. Beside other surfaces, surfaces without an area change nothing.
    let (code, said, files) = render(&format!("{radiosity}plane {{ point 0 0 0; normal 0 1 0 }}\n{LAMP}"), &[]);
    assert!(code == 0 && files == ["out.png"] && said.contains("patches"), "{code} {said}");
    let (code, said, files) = render(&format!("{radiosity}{flat}{WALL}{LAMP}"), &[]);
    assert!(code == 0 && files == ["out.png"] && said.contains("the triangle has no area"), "{code} {said}");
}

#[test]
fn the_limit_of_patches() {
    let with = |most: u32| {
        format!("{CAMERA}integrator \"radiosity\" {{ max-patches {most}; method \"hierarchical\" }}\n{WALL}{LAMP}")
    };
    // A box has six sides.
    refused(&with(3), &["s.kdl: radiosity: the scene's surfaces need more than 3 patches", "a larger max-patches"]);
    // A limit that is reached later is told, and the picture is made.
    let (code, said, files) = render(&with(40), &[]);
    assert!(code == 0 && files == ["out.png"], "{said}");
    let warned = ["warning: s.kdl: radiosity", "limit of 40 patches", "error of 0.01", "a larger max-patches"];
    warned.iter().for_each(|word| assert!(said.contains(word), "no {word:?} in\n{said}"));
    assert!(render(&with(40), &["--quiet"]).1.is_empty());
    let (_, json, _) = render(&with(40), &["--progress", "json"]);
    assert!(json.lines().any(|line| line.contains("\"warning\"") && line.contains("limit of 40 patches")), "{json}");
    assert!(!render(&with(20_000), &[]).1.contains("limit"));
}

/// A name on the command line.
#[test]
fn an_unknown_integrator_on_the_command_line() {
    let (code, said, files) = render(&format!("{CAMERA}{WALL}{LAMP}"), &["--integrator", "radiocity"]);
    assert!(code == 2 && files.is_empty(), "{said}");
    assert!(said.contains("radiocity") && said.contains("whitted, zbuffer, radiosity"), "{said}");
}
