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
        ("--samples 16 --split tiles", 13),
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

/// Layers come from the parts with the first samples, or are made of all samples.
#[test]
fn layers_are_merged() {
    let folder = Folder::new("s.kdl", SCENE);
    for (flags, count) in [
        ("--samples 32 --aov depth,normal,object-id,half-a,half-b,samples", 3),
        ("--samples 24 --aov material-id,denoising-normal,noisy,half-a --denoise=fast --split tiles", 2),
        ("--samples 16 --aov element-id,position --denoise=fast --uint-ids", 2),
        ("--samples 24 --aov uv,samples --integrator whitted", 4),
    ] {
        let names: Vec<String> = (1..=count).map(|k| format!("p{k}.exr")).collect();
        for (k, name) in names.iter().enumerate() {
            part(&folder, flags, &format!("{}/{count} --force", k + 1), name);
        }
        let whole = flags.replace(" --split tiles", "").replace("whitted", "whitted --progressive");
        folder.says(&format!("render s.kdl -q {whole} -o whole.exr"), 0, &[]);
        let names = names.join(" ");
        folder.says(&format!("merge -q {names} -o merged.exr"), 0, &[]);
        same(&folder, "merged.exr", "whole.exr", flags);
        folder.says(&format!("merge -q {names} -o m.png"), 2, &["the parts have layers, and PNG has none"]);
        let others = flags.replace("--aov ", "--aov denoising-depth,");
        part(&folder, &others, &format!("1/{count} --force"), "p1.exr");
        folder.says(&format!("merge -q {names} -o m.exr"), 14, &["its layers is"]);
    }
    for layer in ["alpha", "cost", "all"] {
        let said = "parts hold layers of the first hit";
        folder.says(&format!("render s.kdl --samples 4 --part 1/2 --aov {layer} -o a.exr"), 2, &[said]);
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
    for (name, flags) in [
        ("independent", "--sampler independent"),
        ("limited", "--clamp 3"),
        ("denoised", "--denoise=fast"),
        ("clamped", "--tone clamp"),
        ("cropped", "--crop 0,0,40,36"),
        ("short", "--max-depth 2"),
        ("unshadowed", "--integrator whitted --no-shadows"),
    ] {
        part(&folder, &format!("--samples 32 {flags}"), "2/4", &format!("{name}.exr"));
    }
    folder.says("merge -q p1.exr p2.exr --as-part -o pair.exr", 0, &[]);
    part(&folder, "--samples 32 --split tiles", "1/4", "top.exr");
    part(&folder, "--samples 32 --split tiles", "4/4", "bottom.exr");
    folder.says("render s.kdl -q --samples 32 -o whole.exr", 0, &[]);
    folder.says(
        "info p2.exr",
        0,
        &["part        samples 8 to 15 of 0 to 31, rows 0 to 35 of 0 to 35", "makes all of it"],
    );
    folder.says("info p2.exr --json", 0, &["\"of_samples\": [", "\"part\": {"]);
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
    let with = |old: &[u8], new: &[u8]| {
        let at = bytes.windows(old.len()).position(|bytes| bytes == old).unwrap();
        let mut other = bytes.clone();
        other[at..at + new.len()].copy_from_slice(new);
        other
    };
    fs::write(folder.path("claims.exr"), with(b"{\"samples\":[8,16]", b"{\"samples\":[8,99]")).unwrap();
    fs::write(folder.path("mute.exr"), with(b"{\"samples\"", b"{\"sampled\"")).unwrap();
    fs::write(folder.path("shifted.exr"), with(b"\"area\":[0,0,48,36]", b"\"area\":[0,0,48,35]")).unwrap();
    fs::write(folder.path("head.exr"), with(b"channels\0chlist", b"channels\0chl1st")).unwrap();
    folder.says("render s.kdl -q --samples 1 -o png.png", 0, &[]);
    fs::rename(folder.path("png.png"), folder.path("png.exr")).unwrap();
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
        ("p1.exr png.exr p3.exr p4.exr", 16, "png.exr: "),
        ("p1.exr head.exr p3.exr p4.exr", 16, "head.exr: "),
        ("p1.exr mute.exr p3.exr p4.exr", 16, "it is no part of a picture"),
        ("p1.exr claims.exr p3.exr p4.exr", 16, "it is no part of a picture"),
        ("p1.exr shifted.exr p3.exr p4.exr", 16, "its size isn't the one that its text says"),
        ("p1.exr pair.exr p3.exr p4.exr", 12, "pair.exr have samples 0 to 7 in common"),
        ("top.exr bottom.exr", 10, "parts are missing: samples 0 to 31 of rows 8 to "),
        ("p1.exr independent.exr p3.exr p4.exr", 14, "its sampler is independent"),
        ("p1.exr limited.exr p3.exr p4.exr", 14, "its clamp is 3"),
        ("p1.exr denoised.exr p3.exr p4.exr", 14, "its denoiser is fast, not none"),
        ("p1.exr clamped.exr p3.exr p4.exr", 14, "its tone is clamp"),
        ("p1.exr cropped.exr p3.exr p4.exr", 14, "its crop is 0 0 40 36, not none"),
        ("p1.exr short.exr p3.exr p4.exr", 14, "its max-depth is 2"),
        ("p1.exr unshadowed.exr p3.exr p4.exr", 14, "its integrator is whitted, not path"),
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
        ("--part 1/2 --aov cost -o a.exr", "--aov can't be had in parts"),
        ("--part 1/2 --background none -o a.exr", "alpha"),
        ("--part 1/2 --samples 1 -o a.exr", "--samples 1"),
        ("--part 1/9 --samples 4 -o a.exr", "there are fewer parts than that"),
        ("--part 1/99 --samples 8 --split tiles -o a.exr", "8 samples of 5 bands of 8 rows"),
        ("--split tiles -o a.exr", "--part"),
    ] {
        folder.says(&format!("render s.kdl {flags}"), 2, &[said]);
    }
}

/// A ball that falls, as paths.
const FILM: &str = r#"
    camera { eye { key 0  0 1 5; key 0.6  1 1 5 }; center 0 0.8 0; fovy 40; size 32 24 }
    integrator "path"
    film { exposure "auto" }
    animation { frames 1 7; fps 10; keys "seconds" }
    material "wall" { kd 0.7 0.6 0.5 }
    material "lamp" { kd 0; emission 8 }
    box material="wall" { min -2 -0.1 -2; max 2 0 2 }
    sphere material="wall" { center 0 0.7 0; radius 0.7; translate { key 0 0 0 0; key 0.6 0 1 0 } }
    sphere material="lamp" { center 1 3 2; radius 0.4 }
"#;

/// Frames in parts make the film of one render, whatever the format.
#[test]
fn frames_make_a_film() {
    let folder = Folder::new("s.kdl", FILM);
    for flags in ["--samples 4 --frames all", "--samples 2 --frames 2-7x2 --background none --tone clamp"] {
        let _ = fs::remove_dir_all(folder.path("frames"));
        for part in ["3/3", "1/3", "2/3"] {
            let parts = format!("--part {part} --split frames -o frames/shot.####.png --mkdir");
            folder.says(&format!("render s.kdl {flags} {parts}"), 0, &["render"]);
        }
        for format in ["gif", "apng"] {
            if format == "gif" && flags.contains("--background none") {
                folder.says("merge frames -o x.gif", 2, &["GIF has no alpha"]);
                continue;
            }
            folder.says(&format!("render s.kdl -q {flags} -o whole.{format}"), 0, &[]);
            folder.says(&format!("merge frames -o merged.{format}"), 0, &["frames, 10 a second"]);
            same(&folder, &format!("merged.{format}"), &format!("whole.{format}"), flags);
        }
    }
    for (command, exit, words) in [
        ("merge frames/shot.0002.png frames/shot.0002.png -o x.gif", 11, &["are both frame 2"][..]),
        ("render s.kdl -q --samples 3 --frames 4 -o other.####.png", 0, &[]),
        ("merge frames/shot.0002.png other.0004.png -o x.gif", 14, &["another film", "sampling"]),
        ("merge s.kdl -o x.gif", 16, &["s.kdl"]),
        ("render s.kdl --samples 4 --split frames -o x.png", 2, &["--part 1/8"]),
        ("render s.kdl --samples 4 --part 1/2 --split frames -o x.png", 2, &["--frames all"]),
        ("render s.kdl --samples 4 --frames all --part 1/8 --split frames -o x.####.png", 2, &["there are 7 frames"]),
        ("render s.kdl --samples 4 --frames all --part 1/2 --split frames -o x.gif", 2, &["canaletto merge"]),
    ] {
        folder.says(command, exit, words);
    }
    fs::write(folder.path("t.kdl"), FILM.replace("radius 0.7", "radius 0.6")).unwrap();
    folder.says("render t.kdl -q --samples 2 --frames 3 --background none --tone clamp -o t.####.png", 0, &[]);
    folder.says("merge frames/shot.0002.png t.0003.png -o x.apng", 13, &["a file of the scene has changed"]);
    let more = "render s.kdl -q --frames 3-7x2 --samples 2 --background none --tone clamp -o frames/shot.####.png";
    folder.says(more, 0, &[]);
    fs::remove_file(folder.path("frames/shot.0004.png")).unwrap();
    fs::remove_file(folder.path("frames/shot.0005.png")).unwrap();
    folder.says("merge frames -o x.apng", 10, &["frames are missing: 4 to 5", "--partial"]);
    folder.says("merge frames --partial --fps 5 -o x.apng", 0, &["4 frames, 5 a second"]);
}

/// A part that is there already isn't rendered again, unless it is another one.
#[test]
fn finished_parts_are_kept() {
    let folder = Folder::new("s.kdl", SCENE);
    let command = "render s.kdl --samples 16 --part 1/2 -o p.exr";
    folder.says(command, 0, &["8 samples"]);
    folder.says(command, 0, &["0 frames rendered, 1 complete before"]);
    folder.says(&format!("{command} --force"), 0, &["samples"]);
    for other in ["--samples 16 --part 2/2", "--samples 16 --part 1/2 --seed 2", "--samples 32 --part 1/2"] {
        folder.says(&format!("render s.kdl {other} -o p.exr"), 0, &["samples"]);
        folder.says(command, 0, &["samples"]);
    }
    let text = fs::read_to_string(folder.path("s.kdl")).unwrap();
    fs::write(folder.path("s.kdl"), text.replace("radius 0.7", "radius 0.6")).unwrap();
    folder.says(command, 0, &["samples"]);
    let mut bytes = fs::read(folder.path("p.exr")).unwrap();
    let at = bytes.len() - 100;
    bytes[at] ^= 1;
    fs::write(folder.path("p.exr"), bytes).unwrap();
    folder.says(command, 0, &["samples"]);
}

/// What is prepared once serves all parts, and changes no byte.
#[test]
fn prepared_parts_make_the_same_bytes() {
    let folder = Folder::new("s.kdl", SCENE);
    for (flags, kind) in [
        ("--set integrator.guiding=on --samples 24 --denoise", "path guiding"),
        ("--integrator radiosity --set integrator.error=0.3 --samples 8 --progressive", "solution of radiosity"),
    ] {
        let of_scene = flags.split(" --samples").next().unwrap();
        folder.says(&format!("prepare s.kdl {of_scene} -o s.state"), 0, &[kind]);
        for part in ["1/3", "2/3", "3/3"] {
            let name = format!("p{}.exr", &part[..1]);
            folder.says(&format!("render s.kdl -q {flags} --prepared s.state --part {part} -o {name}"), 0, &[]);
        }
        folder.says("merge -q p1.exr p2.exr p3.exr -o merged.exr", 0, &[]);
        folder.says(&format!("render s.kdl -q {flags} -o whole.exr"), 0, &[]);
        same(&folder, "merged.exr", "whole.exr", flags);
    }
    folder.says("prepare s.kdl --set integrator.guiding=on -q -o s.state", 0, &[]);
    let given = "--samples 4 --prepared s.state -o x.exr";
    let text = fs::read_to_string(folder.path("s.kdl")).unwrap();
    for (flags, exit, words) in [
        ("--set integrator.guiding=on --seed 3", 3, &["s.state: its seed is 0, not 3"][..]),
        ("--set integrator.guiding=on --size 24x18", 3, &["its size is 48 36, not 24 18", "canaletto prepare"]),
        ("--set integrator.guiding=auto", 3, &["guiding=on, not integrator.guiding=auto"]),
        ("--set integrator.guiding=on --set camera.fovy=30", 3, &["s.state: its set is"]),
        ("--set integrator.guiding=off", 2, &["needs nothing prepared"]),
        ("--integrator whitted --progressive", 2, &["needs nothing prepared"]),
        ("--set integrator.guiding=on", 0, &["4 samples"]),
    ] {
        folder.says(&format!("render s.kdl {flags} {given}"), exit, words);
    }
    fs::write(folder.path("s.kdl"), text.replace("radius 0.7", "radius 0.6")).unwrap();
    folder.says(&format!("render s.kdl --set integrator.guiding=on {given}"), 3, &["s.kdl has changed"]);
    fs::write(folder.path("s.state"), "no state").unwrap();
    folder.says(&format!("render s.kdl --set integrator.guiding=on {given}"), 3, &["it isn't a field of path guiding"]);
    folder.says("render s.kdl --prepared gone.state", 3, &["--prepared gone.state"]);
    folder.says("prepare s.kdl --integrator zbuffer -o z.state", 2, &["needs nothing prepared"]);
}
