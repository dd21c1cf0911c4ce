//! Parts of a picture, and the picture that they make.

mod support;

use std::fs;
use support::Folder;

/// A ball on a floor under a lamp.
const SCENE: &str = r#"
    camera { eye 0 1 5; center 0 0.8 0; fovy 40; size 48 36 }
    integrator "path"
    material "wall" { kd 0.7 0.6 0.5 }
    material "lamp" { kd 0; emission 8 }
    box material="wall" { min -2 -0.1 -2; max 2 0 2 }
    sphere name="ball" material="wall" { center 0 0.7 0; radius 0.7 }
    sphere material="lamp" { center 1 3 2; radius 0.4 }
"#;

fn same(folder: &Folder, a: &str, b: &str, what: &str) {
    assert!(fs::read(folder.path(a)).unwrap() == fs::read(folder.path(b)).unwrap(), "{what}: {a} differs from {b}");
}

/// Renders a part into `name`.
fn part(folder: &Folder, flags: &str, part: &str, name: &str) {
    folder.says(&format!("render s.kdl -q {flags} --part {part} -o {name}"), 0, &[]);
}

#[test]
fn parts_make_the_bytes_of_one_render() {
    let folder = Folder::new("s.kdl", SCENE);
    for (flags, count) in [
        ("--samples 40", 3),
        ("--samples 64 --denoise", 4),
        ("--samples 24 --split tiles --denoise=fast --exposure 1", 3),
        ("--samples 50 --crop 8,4,30,25 --tone clamp --seed 3", 2),
        ("--integrator whitted --samples 20", 2),
    ] {
        let names: Vec<String> = (1..=count).map(|k| format!("p{k}.exr")).collect();
        // The last part first.
        for (k, name) in names.iter().enumerate().rev() {
            part(&folder, flags, &format!("{}/{count}", k + 1), name);
        }
        let whole = flags.replace(" --split tiles", "").replace("whitted", "whitted --progressive");
        for format in ["exr", "png", "jpg"] {
            folder.says(&format!("render s.kdl -q {whole} -o whole.{format}"), 0, &[]);
            let reversed: Vec<&str> = names.iter().rev().map(String::as_str).collect();
            folder.says(&format!("merge {} -o merged.{format}", reversed.join(" ")), 0, &["merged"]);
            same(&folder, &format!("merged.{format}"), &format!("whole.{format}"), flags);
        }
        // The scene may have another name on another machine.
        fs::copy(folder.path("s.kdl"), folder.path("t.kdl")).unwrap();
        folder.says(&format!("render t.kdl -q {flags} --part 2/{count} -o p2.exr"), 0, &[]);
        folder.says(&format!("merge -q {} -o renamed.exr", names.join(" ")), 0, &[]);
        same(&folder, "renamed.exr", "whole.exr", flags);
        // A tree of merges.
        folder.says(&format!("merge -q {} --as-part -o ab.exr", names[..2].join(" ")), 0, &[]);
        folder.says(&format!("merge -q ab.exr {} -o tree.exr", names[2..].join(" ")), 0, &[]);
        same(&folder, "tree.exr", "whole.exr", flags);
    }
}

/// Each kind of parts that don't fit has a message and an exit code of its own.
#[test]
fn parts_that_dont_fit_are_refused_by_name() {
    let folder = Folder::new("s.kdl", SCENE);
    for k in 1..=4 {
        part(&folder, "--samples 32", &format!("{k}/4"), &format!("p{k}.exr"));
    }
    part(&folder, "--samples 32", "1/2", "half.exr");
    part(&folder, "--samples 32 --seed 2", "2/4", "seed.exr");
    part(&folder, "--samples 64", "2/4", "more.exr");
    part(&folder, "--samples 32 --size 24x18", "2/4", "small.exr");
    part(&folder, "--samples 32 --exposure 1", "2/4", "bright.exr");
    part(&folder, "--samples 32 --split tiles", "2/4", "rows.exr");
    part(&folder, "--samples 32 --integrator whitted", "2/4", "classic.exr");
    part(&folder, "--samples 32 --set material.wall.kd=0.5", "2/4", "set.exr");
    folder.says("render s.kdl -q --samples 32 -o whole.exr", 0, &[]);
    fs::write(folder.path("s.kdl"), SCENE.replace("radius 0.7", "radius 0.6")).unwrap();
    part(&folder, "--samples 32", "2/4", "scene.exr");
    let bytes = fs::read(folder.path("p2.exr")).unwrap();
    fs::write(folder.path("cut.exr"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(folder.path("none.exr"), b"").unwrap();
    fs::write(folder.path("text.exr"), "no picture").unwrap();
    let software = b"Canaletto 0.1.0";
    let at = bytes.windows(software.len()).position(|bytes| bytes == software).unwrap();
    let mut other = bytes.clone();
    other[at + software.len() - 1] = b'9';
    fs::write(folder.path("version.exr"), other).unwrap();
    let mut bent = bytes.clone();
    let end = bent.len() - 200;
    bent[end] ^= 1;
    fs::write(folder.path("bent.exr"), bent).unwrap();
    for (parts, code, said) in [
        ("p1.exr p3.exr p4.exr", 10, "parts are missing: samples 8 to 15 of rows 0 to 35"),
        ("p1.exr", 10, "samples 8 to 31"),
        ("p1.exr p2.exr p2.exr p3.exr p4.exr", 11, "are the same part"),
        ("p1.exr half.exr p3.exr p4.exr", 12, "have samples 0 to 7 in common"),
        ("p1.exr rows.exr p3.exr", 12, "in common"),
        ("p1.exr scene.exr p3.exr p4.exr", 13, "s.kdl has changed"),
        ("p1.exr set.exr p3.exr p4.exr", 13, "the scenes differ"),
        ("p1.exr seed.exr p3.exr p4.exr", 14, "its seed is 2, not 0"),
        ("p1.exr more.exr p3.exr p4.exr", 14, "its sampling is 64"),
        ("p1.exr small.exr p3.exr p4.exr", 14, "its size is 24 18, not 48 36"),
        ("p1.exr bright.exr p3.exr p4.exr", 14, "exposure"),
        ("p1.exr classic.exr p3.exr p4.exr", 14, "its integrator is whitted, not path"),
        ("p1.exr version.exr p3.exr p4.exr", 15, "it was made by Canaletto 0.1.9"),
        ("p1.exr cut.exr p3.exr p4.exr", 16, "cut.exr: "),
        ("p1.exr none.exr p3.exr p4.exr", 16, "none.exr: "),
        ("p1.exr text.exr p3.exr p4.exr", 16, "text.exr: "),
        ("p1.exr whole.exr p3.exr p4.exr", 16, "it is no part of a picture"),
        ("p1.exr gone.exr p3.exr p4.exr", 16, "gone.exr: "),
    ] {
        folder.says(&format!("merge {parts} -o m.exr"), code, &[said]);
        assert!(!folder.path("m.exr").exists(), "{parts}");
    }
    let bent = folder.run("merge p1.exr bent.exr p3.exr p4.exr -o m.exr");
    assert!([16, 17].contains(&bent.code()), "{:?}", bent.code());
    // What is there makes a picture that says how much it is.
    folder.says("merge p1.exr p3.exr --partial -o some.png", 0, &["50.0% of the picture's samples are there"]);
    folder.says("info some.png", 0, &["unfinished", "merged of 50.0% of its samples"]);
}

#[test]
fn what_has_no_parts_is_told() {
    let folder = Folder::new("s.kdl", SCENE);
    for (flags, said) in [
        ("--part 1/2 -o a.png", "a part is one EXR of 32 bits"),
        ("--part 3/2 -o a.exr", "write K/N"),
        ("--part 0/2 -o a.exr", "write K/N"),
        ("--part 1/2 --noise 0.1 -o a.exr", "--noise"),
        ("--part 1/2 --aov depth -o a.exr", "parts hold colours only"),
        ("--part 1/2 --background none -o a.exr", "alpha"),
        ("--part 1/2 --samples 1 -o a.exr", "--samples 1"),
        ("--part 1/9 --samples 4 -o a.exr", "there are fewer parts than that"),
        ("--split tiles -o a.exr", "--part"),
    ] {
        folder.says(&format!("render s.kdl {flags}"), 2, &[said]);
    }
}
