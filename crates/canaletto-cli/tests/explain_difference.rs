//! Tests of `canaletto explain --diff`: each planted difference is the first term that is printed.

mod support;

use serde_json::Value;
use std::path::Path;
use std::process::Output;
use support::{canaletto, root};

fn run(folder: &Path, arguments: &[&str]) -> Output {
    canaletto(folder).arg("explain").args(arguments).output().unwrap()
}

/// What a difference prints.
#[track_caller]
fn printed(folder: &Path, arguments: &[&str]) -> String {
    support::printed(canaletto(folder).arg("explain").args(arguments))
}

#[track_caller]
fn difference(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(folder, &[arguments, &["--json"]].concat())).unwrap()
}

const GLASS: &str = "scenes/chapter/fig-5.27b-glass.kdl";
const SHADOW: &str = "scenes/chapter/fig-5.23b-shadow.kdl";

/// A change of a scene, the place and the term of the first difference, and a part of the reasons.
type Planted<'a> = (&'a str, &'a str, &'a str, &'a str);

#[track_caller]
fn check(found: &Value, (change, place, term, reason): Planted) {
    let first = &found["first"];
    let way: Vec<&str> = first["place"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!((&*way.join(" > "), first["term"].as_str().unwrap()), (place, term), "{change}: {first}");
    assert_ne!(first["values"][0], first["values"][1], "{change}");
    assert!(first["reasons"].to_string().contains(reason), "{change}: {first}");
}

#[test]
fn planted_settings_are_the_first_difference() {
    let ball = "camera ray > ball";
    let light = "camera ray > ball > omni light #1";
    let inside = "camera ray > ball > refracted ray > ball";
    let planted: [Planted; 18] = [
        ("camera.eye=101 40 40", "camera", "eye", ""),
        ("camera.fovy=80", "camera", "height", ""),
        ("film.sample=center", "", "place in the picture", ""),
        ("sphere.radius=26", ball, "t", ""),
        ("sphere.center=0 90 0", "camera ray", "object", "misses ball: delta"),
        ("material.glass.kd=0 1 0", ball, "kd", "material \\\"glass\\\""),
        ("material.glass.ks=0.5", ball, "ks", ""),
        ("material.glass.n=51", ball, "n", ""),
        ("material.glass.eta=1.5", ball, "eta", ""),
        ("material.glass.opacity=0.5", ball, "o", ""),
        ("ambient=0.1", ball, "ambient Ia*kd", ""),
        ("light.position=40 100 0", light, "L", "the light is at (40, 100, 0)"),
        ("light.intensity=0.5", light, "intensity of the light", ""),
        ("light.attenuation=1 0.01 0", light, "attenuation", ""),
        ("integrator.shadows=#false", &format!("{inside} > omni light #1"), "f_s", "weakened by ball"),
        ("integrator.max-depth=2", inside, "refracted ray", "max-depth"),
        ("background=0.3", &format!("{inside} > refracted ray"), "background", ""),
        ("film.transfer=srgb", "", "transfer", ""),
    ];
    for planted in planted {
        let found = difference(&root(), &[GLASS, "-p", "110,75", "--diff-set", planted.0]);
        check(&found, planted);
        let text = printed(&root(), &[GLASS, "-p", "110,75", "--diff-set", planted.0]);
        assert!(text.contains(planted.2) && text.contains(planted.0), "{text}");
    }
}

/// Differences of other kinds of scenes: samples, random lights, textures, a z-buffer, radiosity, rays, other scenes.
#[test]
fn planted_differences_of_other_scenes_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |integrator: &str, more: &str| {
        format!(
            "camera {{ eye 0 0 0.9; center 0 0 0; fovy 60; size 24 24; near 0.4; far 1.7 }}\n\
             film {{ sample \"center\" }}\nintegrator {integrator}\nmaterial \"wall\" {{ kd 0.6 0.5 0.4 }}\n\
             box name=\"room\" material=\"wall\" {{ min -1 -1 -1; max 1 1 1 }}\n\
             light \"omni\" name=\"bulb\" {{ position 0.2 0.5 0.5; intensity 0.5 0.5 0.5 }}\n{more}\n"
        )
    };
    let block = "box name=\"block\" material=\"wall\" { min -0.3 -0.3 -0.3; max 0.3 0.3 0.3 }";
    for (name, text) in [
        ("room.kdl", scene("\"whitted\"", block)),
        ("empty.kdl", scene("\"whitted\"", "")),
        ("other.kdl", scene("\"whitted\"", &block.replace("\"block\"", "\"chest\""))),
        ("balance.kdl", scene("\"radiosity\" { error 0.3; show \"full\" }", block)),
        ("raster.kdl", scene("\"zbuffer\"", block)),
        (
            "soft.kdl",
            scene(
                "\"whitted\"",
                "light \"disk\" name=\"lamp\" { position 0 0.9 0; normal 0 -1 0; radius 0.2; \
                                           intensity 1 1 1; points 2; random #true }",
            ),
        ),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let folder = folder.path();
    let middle = ["-p", "12,12"];
    let found = |arguments: &[&str]| difference(folder, &[arguments, &middle].concat());
    check(&found(&["room.kdl", "--diff", "empty.kdl"]), ("block", "camera ray", "object", "there is no block"));
    check(&found(&["room.kdl", "--diff", "other.kdl"]), ("name", "camera ray", "object", "meets chest"));
    let lit = found(&["room.kdl", "--diff", "room.kdl", "--diff-set", "light.bulb.intensity=1"]);
    check(&lit, ("light", "camera ray > block > bulb", "intensity of the light", ""));
    let raster = found(&["raster.kdl", "--diff-set", "light.bulb.position=0.2 0.5 0.6"]);
    check(&raster, ("z-buffer", "camera ray > block > bulb", "L", "the light is at (0.2, 0.5, 0.6)"));
    // Paths have the same vertices while the light changes.
    let path = ["room.kdl", "--integrator", "path", "--samples", "2", "--diff-set", "light.bulb.intensity=1"];
    check(&found(&path), ("path", "sample 1 > camera ray to vertex 1", "radiance", ""));
    let path = ["room.kdl", "--integrator", "path", "--samples", "2", "--diff", "empty.kdl"];
    check(&found(&path), ("path", "sample 1 > camera ray to vertex 1", "object", ""));
    // The light of a patch comes from its sources.
    let radiosity = found(&["balance.kdl", "--diff-set", "light.bulb.intensity=1"]);
    let (first, place) = (&radiosity["first"], radiosity["first"]["place"].to_string());
    assert!(place.contains("\"patch ") && first["term"].as_str().unwrap().starts_with("from "), "{first}");
    let ray = ["room.kdl", "--ray", "0,0,0.9,0,0.05,-1", "--diff-set", "material.wall.n=7"];
    check(&difference(folder, &ray), ("ray", "camera ray > block", "n", "material"));
}

#[test]
fn other_seeds_and_samples() {
    let scene = "scenes/chapter/fig-5.37b-jittered.kdl";
    let at = [scene, "-p", "60,60"];
    let found = difference(&root(), &[&at[..], &["--diff-seed", "5"]].concat());
    check(&found, ("seed", "sample 1", "place in the picture", ""));
}

/// Of two pixels, the objects, faces, shadows and materials count, not what follows from their rays.
#[test]
fn two_pixels() {
    let found = |a: &str, b: &str| difference(&root(), &[SHADOW, "-p", a, "--diff-pixel", b]);
    check(&found("115,80", "10,10"), ("object", "camera ray", "object", ""));
    // The floor in light and in the ball's shadow.
    let shadow = found("150,160", "90,160");
    check(&shadow, ("shadow", "camera ray > floor > omni light #1", "f_s", "blocked by ball"));
    // Two places of the ball differ by the light that arrives.
    let near = found("110,75", "112,75");
    let first = &near["first"];
    assert_eq!(first["term"], "f_s (diffuse + specular)", "{first}");
    assert!(first["reasons"][0].as_str().unwrap().starts_with("n.L = "), "{first}");
    let same = found("110,75", "110,75");
    assert!(same["first"].is_null(), "{same}");
}

#[test]
fn nothing_differs() {
    let text = printed(&root(), &[GLASS, "-p", "110,75", "--diff", GLASS]);
    assert!(text.contains("nothing differs: ") && !text.contains("summands"), "{text}");
    // What differs after the digits that are asked for is equal.
    let tiny = [GLASS, "-p", "110,75", "--diff-set", "material.glass.kd=0 0 1.00001"];
    assert!(printed(&root(), &tiny).contains("first difference"));
    assert!(printed(&root(), &[&tiny[..], &["--digits", "3"]].concat()).contains("nothing differs"));
}

/// The changes of all summands are the change of the pixel.
#[test]
fn changes_sum_to_the_change_of_the_pixel() {
    for change in ["material.glass.kd=0.1 0.2 0.8", "light.intensity=0.3", "ambient=0.3", "background=0.1 0.2 0.3"] {
        let found = difference(&root(), &[GLASS, "-p", "110,75", "--diff-set", change]);
        assert_eq!(found["more_following"], 0, "{found}");
        let all = found["following"].as_array().unwrap().iter().chain([&found["first"]]);
        let changes: Vec<&Value> = all.map(|term| &term["change"]).filter(|change| !change.is_null()).collect();
        for c in 0..3 {
            let sum: f64 = changes.iter().map(|change| change[c].as_f64().unwrap()).sum();
            let [a, b] = [0, 1].map(|side: usize| found["colors"][side][c].as_f64().unwrap());
            assert!((b - a - sum).abs() < 1e-5, "{change}: {sum} in place of {}", b - a);
        }
    }
}

#[test]
fn wrong_inputs_are_named() {
    let fails = |arguments: &[&str], code: i32, words: &[&str]| {
        let output = run(&root(), arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{said}");
        words.iter().for_each(|word| assert!(said.contains(word), "no {word:?} in:\n{said}"));
    };
    fails(&[GLASS, "-p", "110,75", "--diff-pixel", "500,0"], 2, &["--diff-pixel", "230 x 230"]);
    fails(&[GLASS, "-p", "110,75", "--diff", "none.kdl"], 3, &["none.kdl"]);
    fails(&[GLASS, "-p", "110,75", "--diff-set", "sphere.radus=1"], 2, &["radius"]);
    fails(&[GLASS, "-p", "110,75", "--diff", GLASS, "--full"], 2, &["--full"]);
    fails(&[GLASS, "--ray", "0,0,0,1,0,0", "--diff-pixel", "1,1"], 2, &["--diff-pixel"]);
}
