//! Tests of `canaletto form-factor` on the scene that its help names.

mod support;

use serde_json::Value;
use std::process::{Command, Output, Stdio};
use support::{canaletto, root};

fn command(arguments: &[&str]) -> Command {
    let mut command = canaletto(root());
    command.args(["form-factor", "scenes/form-factor.kdl"]).args(arguments);
    command
}

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = run(&[arguments, &["--json", "--error", "1e-3"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Asserts the exit code, and that the output contains these words.
#[track_caller]
fn says(arguments: &[&str], code: i32, words: &[&str]) {
    support::says(&run(arguments), code, words);
}

#[test]
fn published_values() {
    let exact = [("ceiling", 0.199_824_895_698), ("wall", 0.200_043_776_075)];
    for (receiver, factor) in exact {
        let found = json(&["floor", receiver]);
        assert_eq!((&found["method"], &found["sampled"]), (&"analytic".into(), &Value::Null));
        assert!((found["a_to_b"]["value"].as_f64().unwrap() - factor).abs() < 1e-11, "{found}");
        assert!(found["a_to_b"]["error"].as_f64().unwrap() < 1e-11);
    }
    // Howell's catalogue, C-41 and C-125.
    for (names, factor) in [(["disk", "disk #2"], 0.186_513), (["ball", "plate"], 0.146_447)] {
        let found = json(&names);
        let (value, error) = (found["a_to_b"]["value"].as_f64().unwrap(), found["a_to_b"]["error"].as_f64().unwrap());
        assert!((value - factor).abs() < 3.5 * error && error <= 1e-3, "{found}");
        let area = |object: &str| found[object]["area"].as_f64().unwrap();
        let back = found["b_to_a"]["value"].as_f64().unwrap();
        assert!((area("a") * value - area("b") * back).abs() < 1e-12, "{found}");
    }
    let hidden = json(&["low", "high"]);
    assert_eq!(hidden["sampled"]["blocked"][0]["object"], "screen");
    let inside = json(&["ball", "room", "--side-b", "back"]);
    assert_eq!((&inside["b"]["side"], &inside["sampled"]["complete"]), (&"back".into(), &true.into()));
}

#[test]
fn answers_for_people() {
    says(&["floor", "ceiling"], 0, &["A         floor, front, area 1\n", "F(A->B)   0.1998248956", "analytic"]);
    says(&["low", "high", "--error", "1e-3"], 0, &["rays from A", "rays by screen", "standard error"]);
    says(&["floor", "room"], 0, &["--side-b"]);
    says(&["disk", "plate", "--max-rays", "1e3"], 0, &["warning: --max-rays ended sampling"]);
}

#[test]
fn mistakes_are_named() {
    says(&["flor", "wall"], 2, &["no object \"flor\"", "did you mean \"floor\"?", "\"ball\""]);
    says(&["floor", "wall", "--error", "0"], 2, &["between 0 and 1"]);
    says(&["floor", "wall", "--max-rays", "many"], 2, &["such as 1e6"]);
    says(&["floor", "wall", "--side-a", "left"], 2, &["front", "back", "both"]);
    says(&["floor"], 2, &["<B>"]);
    let with = |text: &str, arguments: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.kdl");
        std::fs::write(&file, text).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_canaletto"));
        let output = command.arg("form-factor").arg(file).args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let text = "plane name=\"ground\" { point 0 0 0; normal 0 1 0 }\nsphere name=\"ball\" { center 0 2 0; radius 1 }\n\
                light \"omni\" name=\"sun\" { position 0 9 0; intensity 1 1 1 }";
    let (code, said) = with(text, &["ground", "ball"]);
    assert!(code == Some(3) && said.contains("is a plane") && said.contains("exchange"), "{said}");
    let (code, said) = with(text, &["ball", "sun"]);
    assert!(code == Some(2) && said.contains("a light has no surface"), "{said}");
    // No camera is used, so none is missed.
    assert!(!said.contains("camera"), "{said}");
    assert_eq!(with(text, &["ball", "ground", "--error", "1e-2"]).0, Some(0));
}

#[test]
fn methods_are_chosen() {
    let hidden = ["low", "high", "--hemicube", "128", "--method"];
    let [sampled, hemicube] = ["sampled", "hemicube"].map(|method| {
        let found = json(&[&hidden[..], &[method]].concat());
        assert_eq!(found["method"], method);
        [&found["a_to_b"]["value"], &found["a_to_b"]["error"]].map(|number| number.as_f64().unwrap())
    });
    assert!((sampled[0] - hemicube[0]).abs() < 3.0 * (sampled[1] + hemicube[1]), "{sampled:?} {hemicube:?}");
    let found = json(&["floor", "wall", "--method", "hemicube", "--points", "9", "--hemicube", "64"]);
    let words = [&found["hemicube"]["points"], &found["hemicube"]["resolution"], &found["hemicube"]["complete"]];
    assert_eq!(words, [&Value::from(16), &Value::from(64), &Value::from(true)]);
    says(
        &["floor", "wall", "--method", "hemicube", "--points", "8"],
        0,
        &["8 hemicubes of 256 pixels", "by the points"],
    );
    says(&["floor", "wall", "--method", "analytic"], 0, &["0.2000437760", "analytic"]);
    says(&["low", "high", "--method", "analytic"], 3, &["no exact factor is known", "--method sampled"]);
    says(&["floor", "wall", "--hemicube", "255"], 2, &["even number from 4 to 4096"]);
    says(&["floor", "wall", "--points", "0"], 2, &["from 1 to 1048576"]);
    says(&["floor", "wall", "--method", "rays"], 2, &["auto", "analytic", "sampled", "hemicube"]);
}

/// A signal ends sampling, and the answer so far is printed.
#[cfg(unix)]
#[test]
fn interruptions_print_the_answer_so_far() {
    let mut command = command(&["disk", "disk #2", "--error", "1e-9", "--json"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["sampled"]["complete"], false);
    assert!((found["a_to_b"]["value"].as_f64().unwrap() - 0.1865).abs() < 0.05, "{found}");
}
