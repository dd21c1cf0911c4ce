//! No output of a command replaces one of its inputs or another output, under whatever name.
#![cfg(unix)]

mod support;

use std::fs;
use std::path::Path;
use support::canaletto;

const SCENE: &str = r#"
camera { eye 0 1 5; size 8 8 }
texture "t" file="t.png"
material "m" { kd 0.5; emission 1; texture "t" }
box material="m" { min -1 0 -1; max 1 1 1 }
plane { point 0 -1 0; normal 0 1 0 }
light "omni" { position 3 3 3 }
"#;

/// A command with its inputs as `<FILE`, its outputs as `>FILE`, and flags. The same command works when all are apart.
const COMMANDS: [&str; 14] = [
    "render <s.kdl -q -o >a.png",
    "render <s.kdl -q -o >a.png --aov depth",
    "render <s.kdl -q -o >a.png --preview=>b.png --aov depth",
    "render <s.kdl -q --integrator radiosity --solution <room.rad -o >a.png --preview=>b.png",
    "render <s.kdl -q --integrator radiosity --save-solution >c.rad -o >a.png --preview=>b.png",
    "render <s.kdl -q --integrator path --samples 4 --continue <old.exr -o >a.exr --preview=>b.png --aov depth",
    "explain <s.kdl -p 4,4 --integrator radiosity --solution <room.rad --svg >a.svg --html >a.html",
    "measure <s.kdl --points <p.csv --solution <room.rad --rays 16 -o >a.csv",
    "bake <s.kdl --solution <room.rad -o >a.glb",
    "convert <s.kdl >a.kdl -q",
    "convert <s.kdl >a.glb -q",
    "denoise <old.exr -o >a.exr",
    "compare <old.exr <t.png --diff >a.png",
    "compare-methods <s.kdl -q -o >a.png",
];

#[test]
fn every_pair_of_files_of_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::write(place("s.kdl"), SCENE).unwrap();
    fs::write(place("p.csv"), "0 0.5 0 0 1 0\n").unwrap();
    fs::create_dir(place("sub")).unwrap();
    let run = |arguments: &[String]| {
        let done = canaletto(&folder).args(arguments).output().unwrap();
        (done.status.code().unwrap(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    fs::write(place("none.kdl"), SCENE.replace("texture \"t\" file=\"t.png\"\n", "").replace("; texture \"t\"", ""))
        .unwrap();
    let prepared = [
        "render none.kdl -q -o t.png",
        "render s.kdl -q --integrator radiosity --save-solution room.rad -o r.png",
        "render s.kdl -q --integrator path --samples 2 -o old.exr",
    ];
    for line in prepared {
        let (code, said) = run(&words(line));
        assert_eq!(code, 0, "{line}: {said}");
    }
    let name_of = |word: &str, mark: char| word.split_once(mark).map(|(_, name)| name.to_owned());
    let mut pairs = 0;
    for line in COMMANDS {
        let all = words(line);
        let outputs: Vec<usize> = (0..all.len()).filter(|&i| all[i].contains('>')).collect();
        let plain = |words: &[String]| words.iter().map(|word| word.replace(['<', '>'], "")).collect::<Vec<_>>();
        let mut others: Vec<String> =
            all.iter().filter_map(|word| name_of(word, '<').or_else(|| name_of(word, '>'))).collect();
        if line.contains("s.kdl") && !line.contains("bake") {
            others.push("t.png".into()); // The scene names it.
        }
        if line.contains("a.png") && line.contains("--aov depth") {
            others.push("a.depth.png".into());
        }
        for &output in &outputs {
            let own = name_of(&all[output], '>').unwrap();
            // Samples go on in their own file.
            let is_layer = |other: &str| own == "a.png" && other == "a.depth.png";
            let may = |other: &str| {
                other == own || is_layer(other) || line.contains("--continue") && own == "a.exr" && other == "old.exr"
            };
            for other in others.iter().filter(|other| !may(other)) {
                let extension = |name: &str| Path::new(name).extension().map(|e| e.to_string_lossy().into_owned());
                let is_picture = |name: &str| ["png", "exr"].contains(&extension(name).unwrap().as_str());
                // A picture's name tells its format, so that other names are refused anyway.
                if is_picture(&own) && !is_picture(other) && !all[output].starts_with("--preview") {
                    continue;
                }
                let _ = fs::remove_file(place("linked"));
                let mut names = vec![other.clone(), format!("./{other}"), format!("sub/../{other}")];
                if place(other).exists() && !is_picture(&own) && extension(&own) != Some("glb".into()) {
                    fs::hard_link(place(other), place("linked")).unwrap();
                    names.push("linked".into());
                }
                let before = fs::read(place(other)).ok();
                for name in names {
                    let mut changed = plain(&all);
                    changed[output] = all[output].replace(&format!(">{own}"), &name);
                    let (code, said) = run(&changed);
                    assert_eq!(code, 2, "{changed:?}: {said}");
                    assert_eq!(fs::read(place(other)).ok(), before, "{changed:?}");
                    pairs += 1;
                }
            }
        }
        let (code, said) = run(&plain(&all));
        assert!(code == 0 || code == 4, "{line}: {said}");
        for own in &outputs {
            let _ = fs::remove_file(place(&name_of(&all[*own], '>').unwrap()));
        }
        let _ = fs::remove_file(place("a.depth.png"));
    }
    assert!(pairs > 80, "{pairs} pairs");
}

/// `--mkdir` makes the folders of all outputs of every command; without it there is an error, and nothing is made.
#[test]
fn folders_are_made_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    for scene in ["s.kdl", "b.kdl"] {
        fs::write(place(scene), SCENE.replace("texture \"t\" file=\"t.png\"", "").replace("; texture \"t\"", ""))
            .unwrap();
    }
    fs::write(place("p.csv"), "0 0.5 0 0 1 0\n").unwrap();
    let run = |arguments: &str| {
        let words = arguments.split_whitespace();
        let output = canaletto(&folder).args(words).output();
        let output = output.unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for (arguments, files) in [
        (
            "render s.kdl -q -o 1/a/s.png --preview=2/p.png --aov depth",
            &["1/a/s.png", "1/a/s.depth.png", "2/p.png"][..],
        ),
        ("render s.kdl b.kdl -q -o 3", &["3/s.png", "3/b.png"]),
        ("render s.kdl b.kdl -q -o 4/{name}/x.png", &["4/s/x.png", "4/b/x.png"]),
        ("render s.kdl -q --integrator radiosity --save-solution 5/r.rad -o 6/s.png", &["5/r.rad", "6/s.png"]),
        ("explain s.kdl -p 4,4 --svg 7/a.svg --html 8/a.html", &["7/a.svg", "8/a.html"]),
        ("measure s.kdl --points p.csv --rays 16 -o 9/a.csv", &["9/a.csv"]),
        ("bake s.kdl -o 10/a.obj", &["10/a.obj", "10/a.mtl"]),
        ("convert s.kdl 15/a.kdl -q", &["15/a.kdl"]),
        ("denoise 3/s.png -o 11/a.png", &[]),
        ("compare 3/s.png 3/b.png --diff 12/a.png", &["12/a.png"]),
        ("compare-methods s.kdl -q -o 13/a.png", &["13/a.png"]),
        ("ladder s.kdl -q -o 14/a.png", &["14/a.png"]),
    ] {
        let there = || files.iter().filter(|file| place(file).is_file()).count();
        let (code, told) = run(arguments);
        assert!(code != Some(0) && there() == 0, "{arguments}: {code:?} {told}");
        let (code, told) = run(&format!("{arguments} --mkdir"));
        if !files.is_empty() {
            assert!(code == Some(0) && there() == files.len(), "{arguments}: {code:?} {told}");
        }
    }
    let (code, told) = run("render s.kdl -o 20/s.png --dry-run --mkdir -q");
    assert!(code == Some(0) && !place("20").exists(), "{told}");
    let (code, told) = run("render s.kdl -o s.kdl/x/s.png --mkdir");
    assert!(code == Some(1) && told.contains("can't make the folder s.kdl/x"), "{told}");
    let (_, told) = run("render s.kdl -o 21/s.png");
    assert!(told.contains("--mkdir"), "{told}");
}
