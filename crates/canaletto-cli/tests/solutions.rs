//! Solutions of radiosity as files, and over the frames of films.

mod support;

use std::fs;
use std::process::Command;
use support::{CANALETTO, Folder};

/// A room with two cameras; the first moves from frame 1 to frame 3.
const ROOM: &str = r#"
animation { frames 1 3; fps 10 }
camera "one" { eye { key 1  0 0.2 2.8; key 3  0.5 0.4 2.4; ease "linear" }; center 0 0 0; fovy 50; size 16 12 }
camera "two" { eye 1.2 0.8 2.2; center 0 -0.2 0; fovy 60; size 20 10 }
integrator "radiosity" { error 0.2 }
material "wall" { kd 0.7 0.5 0.4 }
material "lamp" { kd 0; emission 6 }
texture "grain" file="grain.png"
material "paper" { kd 0.8; texture "grain" }
box name="floor" material="wall" { min -1 -1.1 -1; max 1 -1 1 }
box name="back" material="paper" { min -1 -1 -1.1; max 1 1 -1 }
box name="lamp" material="lamp" { min -0.3 0.95 -0.3; max 0.3 1 0.3 }
sphere name="ball" material="wall" { center 0.4 -0.7 0.2; radius 0.3 }
light "omni" { position 0.5 0.5 1; intensity 0.2 }
environment "gradient" { stops -90 0.1 0.1 0.1  90 0.2 0.2 0.3 }
"#;

const GRAIN: &[u8] = include_bytes!("../../../scenes/chapter/textures/checker.png");
const OTHER_GRAIN: &[u8] = include_bytes!("../../../scenes/chapter/textures/laminate.png");

/// A folder with a room and the grain of its floor.
fn room() -> Folder {
    let folder = Folder::new("room.kdl", ROOM);
    folder.write("grain.png", GRAIN);
    folder
}

/// Asserts that a file has the bytes of another.
#[track_caller]
fn equal(folder: &Folder, a: &str, b: &str) {
    assert!(folder.bytes(a) == folder.bytes(b), "{a} and {b} differ");
}

#[test]
fn a_saved_solution_makes_the_pictures_that_solving_makes() {
    let folder = room();
    folder.says("render room.kdl -o one.png --save-solution room.rad", 0, &["one.png"]);
    folder.says("render room.kdl -o plain.png -q", 0, &[]);
    equal(&folder, "one.png", "plain.png");
    let others = [
        "",
        "--camera two",
        "--size 9x7 --samples 4",
        "--set integrator.show=patches",
        "--camera two --set integrator.show=solution",
        "--set ambient=0.3 --set background=1",
    ];
    for other in others {
        let json =
            folder.says(&format!("render room.kdl -o a.png --solution room.rad --progress json {other}"), 0, &[]);
        assert!(json.contains("\"solution\":\"read\""), "{json}");
        folder.says(&format!("render room.kdl -o b.png -q {other}"), 0, &[]);
        equal(&folder, "a.png", "b.png");
    }
    // Saving again gives the same bytes.
    folder.says("render room.kdl -o c.png --save-solution again.rad -q --camera two --threads 1", 0, &[]);
    equal(&folder, "room.rad", "again.rad");
}

#[test]
fn a_solution_of_a_scene_that_changed_is_refused_with_the_reason() {
    let folder = room();
    folder.says("render room.kdl -o one.png -q --save-solution room.rad", 0, &[]);
    let refused = |edit: &str, what: &str| {
        let why = format!("--solution room.rad: {what} changed since the solution was made");
        folder.says(&format!("render room.kdl -o no.png --solution room.rad {edit}"), 3, &[&why, "solve again"]);
        assert!(!folder.path("no.png").exists());
    };
    refused("--set sphere.radius=0.31", "the geometry");
    refused("--set material.wall.kd=0.6", "the materials");
    refused("--set light.intensity=0.3", "the lights");
    refused("--set integrator.error=0.3", "the settings");
    refused("--set integrator.error=0.3 --set sphere.radius=0.31", "the geometry and the settings");
    let settings = "the settings changed since the solution was made (with method hierarchical, error 0.2, \
                    max-patches 200000)";
    folder.says("render room.kdl --solution room.rad --set integrator.method=full", 3, &[settings]);
    let edited = |from: &str, to: &str| {
        assert!(ROOM.contains(from));
        folder.write("room.kdl", ROOM.replace(from, to));
    };
    edited("material=\"wall\" { center", "material=\"paper\" { center");
    refused("", "the choice of objects' materials");
    edited("90 0.2", "90 0.3");
    refused("", "the environment");
    folder.write("room.kdl", ROOM);
    fs::write(folder.path("grain.png"), OTHER_GRAIN).unwrap();
    refused("", "the materials");
}

#[test]
fn files_that_are_no_solutions_are_refused() {
    let folder = room();
    folder.says("render room.kdl -o one.png -q --save-solution room.rad", 0, &[]);
    let solution = folder.bytes("room.rad");
    let refused = |bytes: &[u8], why: &str| {
        fs::write(folder.path("bad.rad"), bytes).unwrap();
        let words = format!("can't read the solution bad.rad: {why}");
        folder.says("render room.kdl -o no.png --solution bad.rad", 3, &[&words, "--save-solution"]);
    };
    refused(b"", "it isn't a solution of radiosity");
    refused(&folder.bytes("one.png"), "it isn't a solution of radiosity");
    refused(&solution[..solution.len() / 2], "it ends too early: it is cut off or damaged");
    let mut damaged = solution.clone();
    damaged[solution.len() / 2] ^= 4;
    refused(&damaged, "it is damaged: its content doesn't match its checksum");
    let mut newer = solution.clone();
    newer[8] += 1;
    refused(&newer, "its format is version");
    folder.says("render room.kdl --solution none.rad", 3, &["can't read the solution none.rad: no such file"]);
    folder.says("render room.kdl --solution .", 3, &["can't read the solution .: it is no file"]);
    assert!(!folder.path("no.png").exists());
}

#[test]
fn no_output_is_lost() {
    let folder = room();
    let wrong = |arguments: &str, code: i32, words: &[&str]| {
        let text = folder.says(&format!("render room.kdl {arguments}"), code, words);
        assert!(folder.bytes("room.kdl") == ROOM.as_bytes(), "{text}");
    };
    wrong("--save-solution room.kdl", 2, &["--save-solution room.kdl would replace a file that is read"]);
    wrong("-o a.png --save-solution a.png", 2, &["--save-solution and --output are both a.png"]);
    wrong("-o a.png --save-solution none/room.rad", 1, &["there is no folder none"]);
    wrong("-o a.png --save-solution .", 1, &["is a folder"]);
    wrong("-o a.png --save-solution -", 2, &["a solution needs a file"]);
    wrong("-o a.png --save-solution b.rad --solution c.rad", 2, &["cannot be used with"]);
    wrong("-o a.png --integrator whitted --save-solution b.rad", 2, &["is for the integrator radiosity"]);
    wrong("-o a.png --integrator zbuffer --solution b.rad", 3, &["can't read the solution b.rad"]);
    wrong("room.kdl -o . --save-solution b.rad", 2, &["--save-solution: it is for one scene"]);
    assert!(!folder.path("a.png").exists() && !folder.path("b.rad").exists());
    folder.says("render room.kdl -q -o a.png --save-solution b.rad", 0, &[]);
    let solution = folder.bytes("b.rad");
    wrong("-o c.png --save-solution b.rad --no-clobber", 1, &["b.rad exists already"]);
    wrong("-o b.rad --format png --solution b.rad", 2, &["b.rad would replace a file"]);
    wrong("-o a.png --integrator zbuffer --solution b.rad", 2, &["is for the integrator radiosity"]);
    assert!(folder.bytes("b.rad") == solution);
    // A dry run checks the solution and writes nothing.
    wrong("-o c.png --dry-run --solution b.rad", 0, &["nothing is rendered"]);
    wrong("-o c.png --dry-run --solution b.rad --set sphere.radius=0.31", 3, &["the geometry changed"]);
    wrong("-o c.png --dry-run --save-solution d.rad", 0, &["nothing is rendered"]);
    assert!(!folder.path("c.png").exists() && !folder.path("d.rad").exists());
}

#[test]
fn a_walk_through_film_solves_once() {
    let folder = room();
    let film = "render room.kdl --frames all -o f.#.png --save-solution room.rad";
    folder.says(film, 0, &["3 frames rendered, radiosity solved once"]);
    for frame in 1..=3 {
        folder.says(&format!("render room.kdl --frames {frame} -o g.#.png -q"), 0, &[]);
        equal(&folder, &format!("f.{frame}.png"), &format!("g.{frame}.png"));
    }
    assert!(folder.bytes("f.1.png") != folder.bytes("f.3.png"));
    // Complete frames are kept, whether they were solved for or not.
    let json = folder.says("render room.kdl --frames all -o g.#.png --progress json", 0, &["\"skipped\":3"]);
    assert!(json.contains("\"solves\":0"), "{json}");
    // A solution that isn't saved yet takes one frame.
    folder.says("render room.kdl --frames all -o g.#.png --save-solution other.rad", 0, &["1 frame rendered, 2 comp"]);
    equal(&folder, "other.rad", "room.rad");
    let json = folder.says("render room.kdl --frames all -o h.#.png --progress json --solution room.rad", 0, &[]);
    assert_eq!(json.matches("\"solution\":\"read\"").count(), 3);
    (1..=3).for_each(|frame| equal(&folder, &format!("f.{frame}.png"), &format!("h.{frame}.png")));
    let json = folder.says("render room.kdl --frames all -o i.apng --progress json", 0, &["\"solves\":1"]);
    let of = |word: &str| json.matches(&format!("\"solution\":\"{word}\"")).count();
    assert_eq!((of("solved"), of("kept"), of("read")), (1, 2, 0));
}

#[test]
fn a_film_of_a_scene_that_changes_solves_for_each_change() {
    let folder = room();
    // The lamp brightens after frame 2.
    let brighter = ROOM.replace("intensity 0.2", "intensity { key 2 0.2; key 3 0.3; ease \"linear\" }");
    folder.write("room.kdl", &brighter);
    folder.says(
        "render room.kdl --frames all -o f.#.png",
        0,
        &["radiosity is solved again for each that differs", "3 frames rendered, radiosity solved 2 times"],
    );
    for frame in 1..=3 {
        folder.says(&format!("render room.kdl --frames {frame} -o g.#.png -q"), 0, &[]);
        equal(&folder, &format!("f.{frame}.png"), &format!("g.{frame}.png"));
    }
    let words = ["--save-solution room.rad: one solution doesn't serve all frames; the lights changed", "(at frame 3)"];
    folder.says("render room.kdl --frames all -o h.#.png --save-solution room.rad", 2, &words);
    folder.says("render room.kdl --frames 1-2 -o h.#.png --save-solution room.rad", 0, &["solved once"]);
    let words = ["--solution room.rad: the lights changed since the solution was made", "(at frame 3)"];
    folder.says("render room.kdl --frames all -o i.#.png --solution room.rad", 3, &words);
    assert!(!folder.path("h.3.png").exists() && !folder.path("i.1.png").exists());
}

#[test]
fn scenes_that_are_equal_without_their_cameras_share_a_solution() {
    let folder = room();
    folder.write("other.kdl", ROOM.replace("eye 1.2 0.8", "eye 1.3 0.9").replace("camera \"one\"", "camera \"first\""));
    let json = folder.says("render room.kdl other.kdl --camera two --progress json", 0, &[]);
    assert!(json.contains("\"solution\":\"solved\"") && json.contains("\"solution\":\"kept\""), "{json}");
    for name in ["room", "other"] {
        folder.says(&format!("render {name}.kdl --camera two -q -o alone.png"), 0, &[]);
        equal(&folder, &format!("{name}.png"), "alone.png");
    }
}

/// All events of `--progress json` of a kind.
fn events(json: &str, kind: &str) -> Vec<serde_json::Value> {
    let all = json.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    all.filter(|event| event["event"] == kind).collect()
}

#[test]
fn solving_tells_of_its_phases() {
    let folder = room();
    let phases = |arguments: &str| {
        let json = folder.says(&format!("render room.kdl -o a.png --progress json {arguments}"), 0, &[]);
        let events = events(&json, "solving");
        let mut phases: Vec<String> = events.iter().map(|e| e["phase"].as_str().unwrap().to_owned()).collect();
        phases.dedup();
        let last = events.last().unwrap();
        assert!(last["patches"].as_u64().unwrap() > 10 && last["seconds"].as_f64().unwrap() >= 0.0, "{json}");
        assert!(json.find("\"solving\"") < json.find("\"done\""), "{json}");
        phases.join(" ")
    };
    assert_eq!(phases(""), "patches lights links balance links balance links balance links balance");
    assert_eq!(phases("--set integrator.method=full --set integrator.error=0.5"), "patches lights links balance");
    assert_eq!(phases("--set integrator.method=shooting --set integrator.error=0.5"), "patches lights shooting");
    folder.says("render room.kdl -q -o a.png --save-solution a.rad", 0, &[]);
    let json = folder.says("render room.kdl -o a.png --progress json --solution a.rad", 0, &[]);
    assert!(events(&json, "solving").is_empty(), "{json}");
}

#[test]
fn ambient_light_that_is_not_added_is_told_of() {
    let folder = room();
    folder.write("room.kdl", format!("{ROOM}ambient 0.2\n"));
    let sentence = "ambient 0.2 0.2 0.2 is not added: radiosity computes what ambient stands for";
    folder.says("render room.kdl -o a.png", 0, &[sentence]);
    folder.says("check room.kdl", 0, &[sentence]);
    assert!(!folder.says("render room.kdl -o a.png --integrator whitted", 0, &[]).contains("ambient 0.2"));
}

/// A signal while radiosity is solved ends the program soon, and nothing is written.
#[cfg(unix)]
#[test]
fn solving_can_be_stopped() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    let folder = room();
    let mut command = Command::new(CANALETTO);
    let arguments = "render room.kdl -o a.png --set integrator.error=0.0005 --progress json --save-solution a.rad";
    command.args(arguments.split_whitespace()).current_dir(folder.path("")).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("\"phase\":\"links\"")));
    let stopped = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(stopped.success());
    let start = Instant::now();
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    assert!(!folder.path("a.png").exists() && !folder.path("a.rad").exists() && !folder.path("a.partial.png").exists());
}

#[test]
fn explanations_and_measurements_take_a_solution() {
    let folder = room();
    folder.says("render room.kdl -q -o a.png --save-solution a.rad", 0, &[]);
    let explain = "explain room.kdl -p 8,9 --camera two --json";
    let solved = folder.says(explain, 0, &["\"sum\""]);
    // A file has no links, which tell what lights a patch and the places on it.
    let without_patches = |text: String| {
        let mut tree: serde_json::Value = serde_json::from_str(&text).unwrap();
        let [patches, places] = ["patches", "places"].map(|name| tree.as_object_mut().unwrap().remove(name));
        assert_eq!(patches.is_some(), places.is_some());
        (tree, patches.is_some_and(|patches| !patches.as_array().unwrap().is_empty()))
    };
    let [(found, found_patches), (solved, solved_patches)] =
        [folder.says(&format!("{explain} --solution a.rad"), 0, &[]), solved].map(without_patches);
    assert_eq!(found, solved);
    assert!(solved_patches && !found_patches);
    folder.says(&format!("{explain} --solution a.rad --set integrator.error=0.3"), 3, &["the settings changed"]);
    folder.says(&format!("{explain} --solution a.rad --integrator whitted"), 2, &["for the integrator radiosity"]);
    folder.write("points.csv", "0 -0.9 0  0 1 0\n");
    let measure = "measure room.kdl --points points.csv -q --rays 64";
    let solved = folder.says(measure, 0, &["illuminance"]);
    assert_eq!(folder.says(&format!("{measure} --solution a.rad"), 0, &[]), solved);
    folder.says(&format!("{measure} --solution a.rad --set sphere.radius=0.31"), 3, &["the geometry changed"]);
    let before = folder.bytes("a.rad");
    folder.says(&format!("{measure} --solution a.rad -o a.rad"), 2, &["a.rad would replace a file that is read"]);
    assert!(folder.bytes("a.rad") == before);
}

#[test]
fn points_are_measured_in_the_order_of_their_file() {
    let folder = room();
    folder.write(
        "dim.kdl",
        "material \"lit\" { kd 0; emission 1 }\nsphere material=\"lit\" { center 0 2 0; radius 0.5 }\n",
    );
    folder.write("points.csv", "nx,ny,nz,x,y,z\n\"0\",\"1\",\"0\",\"0\",\"0\",\"0\"\n0 1 0 0 0.5 0\n");
    let measure = "measure dim.kdl --integrator path --rays 16 --points";
    let said = folder.says(&format!("{measure} points.csv -o light.csv"), 0, &["2 points"]);
    assert!(!said.contains("camera"), "{said}");
    let light = fs::read_to_string(folder.path("light.csv")).unwrap();
    let rows: Vec<&str> = light.lines().collect();
    assert!(rows.len() == 3 && rows[1].starts_with("0,0,0,0,1,0,") && rows[2].starts_with("0,0.5,0,0,1,0,"), "{light}");
    // No name of the points' file is taken for its output.
    fs::hard_link(folder.path("points.csv"), folder.path("again.csv")).unwrap();
    for output in ["points.csv", "./points.csv", "again.csv"] {
        let words = [&*format!("--output {output} would replace a file that is read")];
        folder.says(&format!("{measure} points.csv -o {output}"), 2, &words);
    }
    fs::remove_file(folder.path("again.csv")).unwrap();
    // Its own output is a file of points.
    folder.says(&format!("{measure} light.csv -o again.csv"), 0, &["2 points"]);
    assert_eq!(fs::read_to_string(folder.path("again.csv")).unwrap(), light);
}

#[test]
fn files_of_points_that_cant_be_read_are_errors() {
    let folder = room();
    let measure = "measure room.kdl -q --rays 16 --points";
    folder.write("wrong.csv", "0 0 0 0 1 0\n0,0,abc,0,1,0\n0 0 0 0 0 0\n");
    let wrong = ["z: \"abc\" is no number", "wrong.csv:2:5", "wrong.csv:3:1", "nz is zero", "2 errors"];
    folder.says(&format!("{measure} wrong.csv"), 3, &wrong);
    let missing = ["can't open none.csv: no such file or directory", "help: --points names a file of places"];
    folder.says(&format!("{measure} none.csv"), 3, &missing);
    folder.says(&format!("{measure} wrong.cs"), 3, &["help: did you mean wrong.csv?"]);
    folder.says(&format!("{measure} ."), 3, &["can't open .: is a directory", "help: --points"]);
    fs::write(folder.path("latin.csv"), b"0 0 0 0 1 0\n# caf\xe9\n").unwrap();
    let latin = ["latin.csv: line 2 isn't UTF-8 text: byte 17 is 0xe9", "help: save the points as UTF-8"];
    folder.says(&format!("{measure} latin.csv"), 3, &latin);
}

#[test]
fn compared_methods_solve_once() {
    let folder = room();
    let compared = "compare-methods room.kdl --methods zbuffer,radiosity,whitted -o c.png --progress json";
    let json = folder.says(compared, 0, &[]);
    let begun = events(&json, "solving").iter().filter(|event| event["phase"] == "patches").count();
    assert_eq!(begun, 1, "{json}");
}
