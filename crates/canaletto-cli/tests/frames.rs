//! Animations on the command line: frames, continuation after an interruption, films.

mod support;

use canaletto_io::picture::{Decoded, decode};
use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::SystemTime;
use support::{Folder, says};

/// A ball that crosses the picture in 8 frames.
const SCENE: &str = r#"
animation { frames 1 4; fps 10 }
camera { eye 0 0 10; center 0 0 0; fovy 40; size 24 16 }
material "red" { kd 0.8 0.2 0.1 }
sphere name="ball" material="red" { center 0 0 0; radius 1; translate { key 1 -4 0 0; key 9 4 0 0; ease "linear" } }
light "omni" { position 3 5 9 }
"#;

fn time(folder: &Folder, name: &str) -> SystemTime {
    fs::metadata(folder.path(name)).unwrap().modified().unwrap()
}

/// The column of the reddest pixel, from the left.
fn ball(picture: &Decoded) -> usize {
    let (red, width) = (&picture.image.rgb().unwrap()[0], picture.image.width as usize);
    let row = &red[8 * width..9 * width];
    let lit: Vec<usize> = (0..width).filter(|x| row[*x] > 0.2).collect();
    lit[lit.len() / 2]
}

#[test]
fn frames_move() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl --frames 1-9x4 -o f.##.png", 0, &["3 of 3", "3 frames rendered", "in all"]);
    assert_eq!(folder.names(), ["f.01.png", "f.05.png", "f.09.png"]);
    let places = ["f.01.png", "f.05.png", "f.09.png"].map(|name| ball(&folder.picture(name)));
    assert!(places[0] < 6 && (11..=13).contains(&places[1]) && places[2] > 18, "{places:?}");
    // Without --frames, the scene's first frame is rendered. explain and check accept any frame.
    folder.says("render s.kdl -q", 0, &[]);
    assert_eq!(folder.picture("s.png").image, folder.picture("f.01.png").image);
    folder.says("explain s.kdl --frame 5 -p 12,8", 0, &["ball"]);
    assert!(!folder.says("explain s.kdl -p 12,8", 0, &[]).contains("ball"));
    folder.says("render s.kdl --frames all -o a.#.png --dry-run", 0, &["4 frames: 1-4"]);
    folder.says("info s.kdl --frame 9", 0, &["bounds"]);
    folder.says("render s.kdl --frames 1-9x0", 2, &["at least 1"]);
    folder.says("render s.kdl --fps 0", 2, &["between 0.01 and 1000"]);
}

/// A PNG whose palette makes the `png` crate panic.
const PALETTE_OF_FOUR_BYTES: &[u8] = include_bytes!("../../canaletto-io/tests/fuzz/seeds/palette-of-four-bytes.png");

#[test]
fn what_breaks_a_decoder_in_the_place_of_a_frame_is_replaced() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl --frames 1-3 -o f.#.png", 0, &["3 frames rendered"]);
    let whole = ["f.1.png", "f.2.png", "f.3.png"].map(|name| fs::read(folder.path(name)).unwrap());
    fs::write(folder.path("f.1.png"), PALETTE_OF_FOUR_BYTES).unwrap();
    // The header announces 16384 x 16384 pixels in a file of few bytes.
    let mut large = PALETTE_OF_FOUR_BYTES.to_vec();
    large[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    fs::write(folder.path("f.2.png"), &large).unwrap();
    let text = folder.says("render s.kdl --frames 1-3 -o f.#.png", 0, &["2 frames rendered, 1 complete before"]);
    assert!(!text.contains("panicked"), "{text}");
    assert!(whole == ["f.1.png", "f.2.png", "f.3.png"].map(|name| fs::read(folder.path(name)).unwrap()));
    fs::write(folder.path("a.png"), PALETTE_OF_FOUR_BYTES).unwrap();
    let text = folder.says("compare a.png f.1.png", 3, &["can't read a.png", "its palette has 4 bytes"]);
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn complete_frames_are_kept() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl --frames 1-3 -o f.#.png --aov depth", 0, &["3 frames rendered"]);
    let before = time(&folder, "f.1.png");
    // One frame is cut off, one lacks a layer, one has another size.
    let bytes = fs::read(folder.path("f.2.png")).unwrap();
    fs::write(folder.path("f.2.png"), &bytes[..bytes.len() / 2]).unwrap();
    fs::remove_file(folder.path("f.3.depth.png")).unwrap();
    folder.says(
        "render s.kdl --frames 1-4 -o f.#.png --aov depth",
        0,
        &["4 of 4", "3 frames rendered, 1 complete before (--force"],
    );
    assert_eq!(time(&folder, "f.1.png"), before);
    assert_eq!(fs::read(folder.path("f.2.png")).unwrap(), bytes, "the same again");
    let again = "render s.kdl --frames 1-4 -o f.#.png --aov depth";
    folder.says(again, 0, &["0 frames rendered, 4 complete before"]);
    let json = folder.says(&format!("{again} --progress json"), 0, &["\"skipped\":4", "\"rendered\":0"]);
    assert_eq!(json.matches("\"event\":\"skipped\"").count(), 4);
    // Frames that would differ are rendered again: another size, other settings, another scene.
    for change in ["--force", "--size 12x8", "--samples 4", "--seed 7", "--set sphere.ball.radius=2", "--bits 16"] {
        folder.says(&format!("{again} {change}"), 0, &["4 frames rendered"]);
    }
    folder.says(again, 0, &["4 frames rendered"]);
    fs::write(folder.path("s.kdl"), SCENE.replace("radius 1", "radius 1.5")).unwrap();
    folder.says(again, 0, &["4 frames rendered"]);
    folder.says(&format!("{again} --no-clobber"), 1, &["exists already"]);
}

#[test]
fn exr_frames_are_kept_with_their_layers() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --frames 1-2 -o f.#.exr";
    folder.says(&format!("{run} --aov normal,depth"), 0, &["2 frames rendered"]);
    folder.says(&format!("{run} --aov normal,depth"), 0, &["2 complete before"]);
    folder.says(run, 0, &["2 frames rendered"]);
}

/// Frames that a second command would render differently are rendered again, in both directions. The others are kept.
#[test]
fn only_frames_of_the_same_command_are_kept() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("s.kdl"), SCENE.replace("camera {", "camera \"é 水\" {")).unwrap();
    let flags = [
        "--size 12x9",
        "--samples 4",
        "--pattern corner",
        "--sampler independent --samples 3",
        "--seed 5",
        "--stage shadow",
        "--max-depth 2",
        "--no-shadows",
        "--tone scale",
        "--transfer none",
        "--crop 2,2,4,4",
        "--crop 4,4,4,4",
        "--set background=1",
        "--set ambient=0.5",
        "--set film.filter=tent",
        "--set integrator.min-weight=0.5",
    ];
    let exr = ["--aov normal", "--aov position", "--aov depth", "--aov object-id", "--aov uv,depth", "--aov depth,uv"];
    let png = ["--bits 16", "--aov normal", "--aov position"];
    for (format, more) in [("png", png.as_slice()), ("exr", &exr)] {
        let run = format!("render s.kdl --frames 1-2 -o f.#.{format}");
        folder.says(&run, 0, &["2 frames rendered"]);
        for flag in flags.iter().chain(more) {
            let with = format!("{run} {flag}");
            folder.says(&with, 0, &["2 frames rendered"]);
            folder.says(&with, 0, &["2 complete before"]);
        }
        // A PNG doesn't depend on the layers beside it; an EXR contains them.
        folder.says(&run, 0, &[if format == "png" { "2 complete before" } else { "2 frames rendered" }]);
        folder.says(&format!("{run} --threads 1 --tile 8 --build high"), 0, &["2 complete before"]);
    }
    // The files come from another version of the program.
    let old = b"Canaletto ";
    for name in ["f.1.png", "f.1.exr"] {
        let mut bytes = fs::read(folder.path(name)).unwrap();
        let at = bytes.windows(old.len()).position(|part| part == old).unwrap() + old.len();
        let Some(end) = bytes[at..].iter().position(|b| !b.is_ascii_digit() && *b != b'.') else { panic!() };
        bytes[at] = if bytes[at] == b'9' { b'8' } else { b'9' };
        if name.ends_with("png") {
            let chunk = bytes.windows(4).position(|part| part == b"tEXt").unwrap();
            let sum = crc(&bytes[chunk..at + end]);
            bytes[at + end..at + end + 4].copy_from_slice(&sum.to_be_bytes());
        }
        fs::write(folder.path(name), bytes).unwrap();
        let format = &name[4..];
        folder.says(&format!("render s.kdl --frames 1-2 -o f.#.{format}"), 0, &["1 frame rendered, 1 complete before"]);
    }
    // A moved scene has an equal digest.
    fs::create_dir(folder.path("moved")).unwrap();
    fs::copy(folder.path("s.kdl"), folder.path("moved/s.kdl")).unwrap();
    folder.says("render moved/s.kdl --frames 1-2 -o f.#.png", 0, &["2 complete before"]);
}

/// The checksum of a PNG's chunk (ISO/IEC 15948, annex D).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

#[test]
fn mistakes_at_later_keys_are_told_before_the_first_frame() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("s.kdl"), SCENE.replace("radius 1", "radius { key 1 1; key 90 -1; key 100 -1 }")).unwrap();
    folder.says("render s.kdl --frames 1-100 -o f.###.png", 3, &["radius is -1"]);
    assert!(folder.names().is_empty());
    folder.says("render s.kdl --frames 1-20 -o f.###.png -q", 0, &[]);
    folder.says("check s.kdl", 0, &["ok"]);
    folder.says("check s.kdl --frame 95", 3, &["radius is -1"]);
}

#[test]
fn files_are_read_once() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path("s.kdl"), format!("{SCENE}\nmesh file=\"m.obj\" {{ rotate-y {{ key 1 0; key 9 90 }} }}"))
        .unwrap();
    let text = folder.says("render s.kdl --frames 1-3 -o f.#.png --progress json", 0, &[]);
    assert_eq!(text.matches("\"event\":\"done\"").count(), 3, "{text}");
    // A changed mesh changes the scene.
    fs::write(folder.path("m.obj"), "v 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    folder.says("render s.kdl --frames 1-3 -o f.#.png", 0, &["3 frames rendered"]);
}

/// The numbers of kept, refitted and built hierarchies of each rendered frame.
fn hierarchies(events: &str) -> Vec<[u64; 3]> {
    let events = events.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let done = events.filter(|event| event["event"] == "done");
    done.map(|event| ["kept", "refitted", "built"].map(|word| event["hierarchies"][word].as_u64().unwrap())).collect()
}

#[test]
fn what_stays_between_frames_changes_no_byte() {
    let folder = Folder::new("s.kdl", SCENE);
    let mut sheet = String::new();
    for n in 0..400 {
        sheet +=
            &format!("v {} {} {}\n", (n % 20) as f32 * 0.1 - 1.0, (n / 20) as f32 * 0.1 - 1.0, (n as f32).sin() * 0.1);
    }
    for n in (1..380).filter(|n| n % 20 != 0) {
        sheet += &format!("f {n} {} {}\nf {} {} {}\n", n + 1, n + 20, n + 1, n + 21, n + 20);
    }
    fs::write(folder.path("sheet.obj"), sheet).unwrap();
    let more = r#"
        texture "bumps" kind="noise"
        material "rough" { kd 0.4 0.5 0.6; texture "bumps" use="displace" { detail 16; height { key 1 0.1; key 9 0.3 } } }
        mesh name="turns" file="sheet.obj" { translate 2 1 0; rotate-y { key 1 0; key 9 8; ease "linear" } }
        mesh name="stays" file="sheet.obj" one-sided=#true { translate -2 -1 0 }
        sphere name="swells" material="rough" { center -2 2 0; radius 0.8 }
        spheres radius=0.2 { points 2 -2 0  2.5 -2 0  2.2 -1.5 0.3; translate { key 1 0 0 0; key 9 0 1 0 } }
    "#;
    fs::write(folder.path("s.kdl"), format!("{SCENE}{more}")).unwrap();
    let row = "render s.kdl --frames 1-6 --samples 4 -o a.#.png --progress json";
    let found = hierarchies(&folder.says(row, 0, &[]));
    assert_eq!(found[0], [0, 0, 4]);
    assert!(found.len() == 6 && found[1..].iter().all(|[kept, _, built]| *kept == 2 && *built <= 2), "{found:?}");
    assert!(found.iter().any(|[_, refitted, _]| *refitted > 0), "{found:?}");
    let bytes = |name: &str, frame: u32| fs::read(folder.path(&format!("{name}.{frame}.png"))).unwrap();
    let whole: Vec<Vec<u8>> = (1..=6).map(|frame| bytes("a", frame)).collect();
    assert!(whole.windows(2).all(|pair| pair[0] != pair[1]));
    // Each frame is rendered by itself, with other threads and other hierarchies.
    for frame in 1..=6 {
        let work = ["medium --threads 1", "high --threads 3"][frame as usize % 2];
        folder.says(&format!("render s.kdl --frames {frame} --samples 4 -o b.#.png -q --build {work}"), 0, &[]);
        assert!(bytes("b", frame) == whole[frame as usize - 1], "{frame}");
    }
    // Some frames are rendered again after complete ones; then every second frame is rendered.
    for frame in [2, 5, 6] {
        fs::remove_file(folder.path(&format!("a.{frame}.png"))).unwrap();
    }
    assert_eq!(hierarchies(&folder.says(row, 0, &["\"skipped\":3"])).len(), 3);
    assert!((1..=6).all(|frame| bytes("a", frame) == whole[frame as usize - 1]));
    folder.says("render s.kdl --frames 1-5x2 --samples 4 -o c.#.png -q", 0, &[]);
    assert!([1, 3, 5].into_iter().all(|frame| bytes("c", frame) == whole[frame as usize - 1]));
    // If nothing moves, one world serves all frames.
    let still = "camera { eye 0 -5 3; center 0 0 0; up 0 0 1; fovy 45; size 24 16 }\nmesh file=\"sheet.obj\"\n";
    fs::write(folder.path("s.kdl"), format!("{still}light \"omni\" {{ position 3 5 9 }}")).unwrap();
    let still = hierarchies(&folder.says("render s.kdl --frames 1-3 --size 24x16 -o d.#.png --progress json", 0, &[]));
    assert_eq!(still, [[0, 0, 1], [1, 0, 0], [1, 0, 0]]);
}

#[test]
fn films_in_one_file() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -o f.apng", 0, &["f.apng: 4 frames rendered"]);
    let still = folder.run("render s.kdl -o one.png -q");
    assert!(still.status.success());
    let film = fs::read(folder.path("f.apng")).unwrap();
    assert_eq!(decode(&film).unwrap().image, folder.picture("one.png").image);
    let mut reader = png::Decoder::new(std::io::Cursor::new(&film)).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 4);
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut data).unwrap();
    let control = *reader.info().frame_control().unwrap();
    assert_eq!((control.delay_num, control.delay_den), (1, 10));
    folder.says("render s.kdl --frames 2-3 -o f.png --format apng --fps 24", 0, &["2 frames"]);
    folder.says("render s.kdl --frames 1-9 -o f.gif --fps 20 -q", 0, &[]);
    assert!(fs::read(folder.path("f.gif")).unwrap().starts_with(b"GIF89a"));
    assert!(folder.run("render s.kdl -o - --format gif -q").stdout.starts_with(b"GIF89a"));
    folder.says("render s.kdl -o f.gif --fps 60", 2, &["at most 50"]);
    folder.says("render s.kdl -o f.gif --aov depth", 2, &["GIF has no layers"]);
    folder.says("render s.kdl -o f.gif --bits 16", 2, &["8 bits"]);
    folder.says("render s.kdl -o f.gif --no-clobber", 1, &["exists already"]);
    fs::write(folder.path("s.kdl"), SCENE.replace("frames 1 4; ", "")).unwrap();
    folder.says("render s.kdl -o f.gif", 2, &["a film needs its frames", "animation { frames 1 100 }"]);
    folder.says("render s.kdl --frames all", 2, &["doesn't say which"]);
    assert!(folder.names().iter().all(|name| !name.contains("tmp")));
}

/// The bytes are equal on 1, 2, 3 and 7 threads.
#[test]
fn threads_change_no_film() {
    let folder = Folder::new("s.kdl", SCENE);
    for format in ["apng", "gif"] {
        let film = |threads| {
            folder.run(&format!("render s.kdl --samples 4 -o - --format {format} -q --threads {threads}")).0.stdout
        };
        let one = film(1);
        assert!(one.len() > 100);
        for threads in [2, 3, 7] {
            assert!(film(threads) == one, "{format} on {threads} threads");
        }
    }
}

/// Runs until an event's line contains these words, then sends an interrupt.
#[cfg(unix)]
fn interrupted_at(folder: &Folder, run: &str, words: &str) -> String {
    use std::io::{BufRead, BufReader};
    let run = format!("{run} --progress json --threads 1");
    let mut child = folder.command(&run).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(lines.by_ref().any(|line| line.unwrap().contains(words)), "{run}");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.map(|line| line.unwrap()).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    rest.join("\n")
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_is_finished_and_the_same_command_goes_on() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("f.3.png"), "an older frame").unwrap();
    let run = "render s.kdl --frames 1-9 -o f.#.png --size 300x200 --samples 400";
    interrupted_at(&folder, run, "\"event\":\"progress\",\"frame\":3");
    assert_eq!(folder.names(), ["f.1.png", "f.2.png", "f.3.partial.png", "f.3.png"]);
    assert_eq!(fs::read(folder.path("f.3.png")).unwrap(), b"an older frame");
    let part = folder.picture("f.3.partial.png");
    assert!(part.metadata.iter().any(|(key, _)| key == "unfinished") && part.image.width == 300);
    folder.says(&run.replace("1-9", "1-3"), 0, &["1 frame rendered, 2 complete before"]);
    assert_eq!(folder.names(), ["f.1.png", "f.2.png", "f.3.png"], "the part has gone");
}

#[cfg(unix)]
#[test]
fn part_of_a_film_goes_beside_an_older_one() {
    let folder = Folder::new("s.kdl", SCENE);
    for format in ["gif", "apng"] {
        let (film, part) = (format!("f.{format}"), format!("f.partial.{format}"));
        fs::write(folder.path(&film), "an older film").unwrap();
        let run = format!("render s.kdl --frames 1-9 -o {film} --size 300x200 --samples 150");
        interrupted_at(&folder, &run, "\"event\":\"progress\",\"frame\":3");
        assert_eq!(fs::read(folder.path(&film)).unwrap(), b"an older film");
        // The part equals a film of the two frames, except for the mark that it is partial.
        let bytes = fs::read(folder.path(&part)).unwrap();
        folder.says(&run.replace("1-9", "1-2").replace(&film, "two"), 2, &["extension"]);
        folder.says(&format!("{} --format {format}", run.replace("1-9", "1-2").replace(&film, "two")), 0, &[]);
        let two = fs::read(folder.path("two")).unwrap();
        if format == "gif" {
            assert!(bytes.starts_with(&two[..two.len() - 1]), "all but the trailer");
        } else {
            let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
            assert_eq!(reader.info().animation_control.unwrap().num_frames, 2);
            let mut data = vec![0; reader.output_buffer_size().unwrap()];
            assert!(reader.next_frame(&mut data).is_ok() && reader.next_frame(&mut data).is_ok());
            reader.finish().unwrap();
        }
        folder.says(&format!("render s.kdl -o {film} -q"), 0, &[]);
        assert!(!folder.path(&part).exists(), "the part goes when the whole is there");
        fs::remove_file(folder.path("two")).unwrap();
    }
    // Before the first frame is finished, there is no partial film.
    let run = "render s.kdl --frames 1-9 -o g.gif --size 300x200 --samples 1500";
    interrupted_at(&folder, run, "\"event\":\"progress\"");
    assert_eq!(folder.names(), ["f.apng", "f.gif"]);
}

/// Scripts in the place of ffmpeg test the data that is sent to it, and its failures.
#[cfg(unix)]
mod ffmpeg {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// Runs with a PATH of one folder of the test, in which `script` is called ffmpeg.
    fn with(folder: &Folder, script: Option<&str>, arguments: &str) -> Output {
        let bin = folder.path("bin");
        fs::create_dir_all(&bin).unwrap();
        if let Some(script) = script {
            let file = bin.join("ffmpeg");
            fs::write(&file, format!("#!/bin/sh\n{script}\n")).unwrap();
            fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
        }
        folder.command(arguments).env("PATH", &bin).output().unwrap()
    }

    #[test]
    fn it_gets_all_pixels_and_safe_arguments() {
        let folder = Folder::new("s.kdl", SCENE);
        let script = "for last; do :; done\necho \"$@\" > arguments\n/bin/cat > \"${last#file:}\"";
        let output = with(&folder, Some(script), "render s.kdl -o -odd:name.mp4 --fps 23.976");
        // A name that starts with a dash needs the form with `=`.
        assert_eq!(output.status.code(), Some(2));
        let output = with(&folder, Some(script), "render s.kdl --output=-odd:name.mp4 --fps 23.976");
        says(&output, 0, &["4 frames rendered"]);
        let film = fs::read(folder.path("-odd:name.mp4")).unwrap();
        assert_eq!(film.len(), 4 * 24 * 16 * 3);
        folder.says("render s.kdl --frames 1-4 -o f.#.png -q", 0, &[]);
        for (frame, sent) in film.chunks_exact(24 * 16 * 3).enumerate() {
            let picture = folder.picture(&format!("f.{}.png", frame + 1));
            let [r, g, b] = picture.image.rgb().unwrap();
            let level = |v: f32| (v * 255.0).round() as u8;
            assert!(sent.chunks_exact(3).enumerate().all(|(i, p)| p == [level(r[i]), level(g[i]), level(b[i])]));
        }
        let arguments = fs::read_to_string(folder.path("arguments")).unwrap();
        for words in ["-nostdin", "-video_size 24x16", "-framerate 24000/1001", "-f mp4 file:/"] {
            assert!(arguments.contains(words), "{arguments}");
        }
    }

    #[test]
    fn its_failure_is_shown_and_leaves_nothing() {
        let folder = Folder::new("s.kdl", SCENE);
        let film = "render s.kdl -o f.webm";
        says(&with(&folder, None, film), 1, &["WebM needs the program ffmpeg", "help: install it"]);
        let script = "/bin/cat > /dev/null; echo 'Unknown encoder: libvpx' >&2; exit 1";
        says(&with(&folder, Some(script), film), 1, &["ffmpeg failed: Unknown encoder: libvpx", "help:"]);
        // The script ends while data is still being sent.
        let large = "render s.kdl -o f.webm --size 600x400";
        says(&with(&folder, Some("echo 'no such option' >&2; exit 8"), large), 1, &["no such option"]);
        says(&with(&folder, Some("exit 8"), film), 1, &["ffmpeg failed: "]);
        assert_eq!(folder.names(), ["bin"]);
        says(&with(&folder, Some("exit 0"), "render s.kdl -o - --format mp4"), 2, &["standard output"]);
    }

    /// A test with the real ffmpeg, if it is installed.
    #[test]
    fn films_by_ffmpeg_itself() {
        let Some(program) = canaletto_io::movie::find_ffmpeg() else {
            eprintln!("films_by_ffmpeg_itself: skipped, ffmpeg isn't installed");
            return;
        };
        let folder = Folder::new("s.kdl", SCENE);
        for name in ["f.mp4", "f.webm"] {
            folder.says(&format!("render s.kdl -o {name} --size 31x17"), 0, &["4 frames rendered"]);
            let mut command = Command::new(&program);
            command.args(["-v", "error", "-i", name, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]);
            let output = command.current_dir(folder.path("")).output().unwrap();
            assert_eq!(output.stdout.len(), 4 * 32 * 18 * 3, "{}", String::from_utf8_lossy(&output.stderr));
        }
    }
}
