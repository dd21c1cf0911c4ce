//! Pictures by paths that grow by passes: --time, --noise, --clamp, --continue, --preview=FILE and Ctrl-C.
//! What `denoise` takes.

mod support;

use canaletto::scene::Transfer;
use canaletto_io::picture::{Channel, Decoded, EncodeSettings, Image, PictureFormat, decode};
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{CANALETTO, Folder};

const SCENE: &str = r#"
camera { eye 0 1.5 5.5; center 0 1.2 0; fovy 40; size 24 16 }
integrator "path"
material "white" { kd 0.7 }
material "lamp" { kd 0; emission 9 7 5 }
box material="white" { min -2 -0.1 -2; max 2 0 2 }
sphere material="white" { center 0 0.7 0; radius 0.7 }
sphere material="lamp" { center 1.2 2.5 0.5; radius 0.4 }
background 0.1
"#;

fn text(folder: &Folder, name: &str, key: &str) -> Option<String> {
    folder.picture(name).metadata.into_iter().find(|(own, _)| own == key).map(|(_, text)| text)
}

/// The stops that a picture's exposure became.
#[track_caller]
fn metered_stops(folder: &Folder, name: &str) -> f32 {
    text(folder, name, "auto-exposure").unwrap_or_else(|| panic!("{name} tells no metered exposure")).parse().unwrap()
}

#[track_caller]
fn same(folder: &Folder, a: &str, b: &str) {
    assert!(folder.picture(a).image == folder.picture(b).image, "{a} and {b} differ");
}

#[test]
fn two_runs_of_32_samples_are_one_of_64() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -q --samples 64 -o whole.exr", 0, &[]);
    folder.says("render s.kdl -q --samples 32 -o half.exr", 0, &[]);
    folder.says("render s.kdl -q --samples 64 --continue half.exr -o on.exr --threads 3", 0, &[]);
    assert!(folder.bytes("on.exr") == folder.bytes("whole.exr"));
    // Over itself, by a number of samples that makes several blocks, and with the halves.
    folder.says("render s.kdl -q --samples 40 --continue half.exr -o half.exr", 0, &[]);
    assert!(folder.picture("half.exr").image.channel("block_2.R").is_some());
    folder.says("render s.kdl -q --samples 64 --continue half.exr -o half.exr --aov half-a,half-b,samples", 0, &[]);
    folder.says("render s.kdl -q --samples 64 -o halves.exr --aov half-a,half-b,samples", 0, &[]);
    same(&folder, "half.exr", "halves.exr");
    // A picture apart, whose mean with the first one is the whole one.
    folder.says("render s.kdl -q --samples 32 --first-sample 32 -o second.exr", 0, &[]);
    folder.says("render s.kdl -q --samples 32 -o first.exr", 0, &[]);
    let of = |name: &str| folder.picture(name).image.channel("G").unwrap().to_vec();
    let mean: Vec<f32> = of("first.exr").iter().zip(of("second.exr")).map(|(a, b)| 0.5 * a + 0.5 * b).collect();
    assert_eq!(mean, of("whole.exr"));
    assert_eq!(text(&folder, "whole.exr", "samples").unwrap(), "64");
}

#[test]
fn samples_of_another_picture_are_refused_by_name() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -q --samples 16 -o a.exr", 0, &[]);
    let refused = |flags: &str, code: i32, words: &[&str]| {
        folder.says(&format!("render s.kdl -q --samples 32 {flags} -o b.exr"), code, words);
        assert!(!folder.path("b.exr").exists());
    };
    refused("--continue a.exr --seed 1", 3, &["its seed is 0, not 1"]);
    refused("--continue a.exr --size 20x20", 3, &["its size is 24 16, not 20 20"]);
    refused("--continue a.exr --set background=0.2", 3, &["its set is none, not"]);
    refused("--continue a.exr --max-depth 3", 3, &["its max-depth is 0, not 3"]);
    refused("--continue a.exr --clamp 2", 3, &["its clamp is none, not 2"]);
    refused("--continue none.exr", 3, &["none.exr"]);
    refused("--continue a.exr --integrator whitted", 3, &["its integrator is path, not whitted"]);
    refused("--continue a.exr --sampler jittered", 2, &["--continue", "jittered"]);
    refused("--continue s.kdl", 3, &["--continue s.kdl"]);
    folder.says("render s.kdl -q --samples 16 --continue a.exr -o b.exr", 3, &["has 16 samples", "--samples 32"]);
    folder.says("render s.kdl -q --samples 16 -o c.png", 0, &[]);
    refused("--continue c.png", 3, &["isn't an EXR"]);
    folder.says("render s.kdl -q --samples 16 --bits 16 -o d.exr", 0, &[]);
    refused("--continue d.exr", 3, &["rounded"]);
    folder.says("render s.kdl -q --samples 1 -o e.exr", 0, &[]);
    refused("--continue e.exr", 3, &["centre"]);
    fs::write(folder.path("s.kdl"), SCENE.replace("0.7 0; radius 0.7", "0.6 0; radius 0.6")).unwrap();
    refused("--continue a.exr", 3, &["s.kdl has changed since it was rendered"]);
}

/// The last event of a render of 4096 samples that is interrupted after 16, and the number of samples to go on to.
#[cfg(unix)]
fn interrupted(folder: &Folder, output: &str) -> (serde_json::Value, u64) {
    interrupted_after(folder, &format!("--size 96x64 -o {output}"), 16)
}

#[cfg(unix)]
fn interrupted_after(folder: &Folder, flags: &str, samples: u32) -> (serde_json::Value, u64) {
    let run = format!("render s.kdl --samples 4096 --progress json {flags}");
    let passed = format!("\"samples\":{samples},");
    let mut child = folder.command(&run).stderr(Stdio::piped()).spawn().unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    let mut last = String::new();
    for line in lines.map_while(Result::ok) {
        if line.contains(&passed) && line.contains("\"event\":\"pass\"") {
            let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
            assert!(kill.success());
        }
        last = line;
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let done: serde_json::Value = serde_json::from_str(&last).unwrap();
    let wanted = (done["samples"]["most"].as_u64().unwrap() + 1).next_power_of_two();
    (done, wanted)
}

#[cfg(unix)]
#[test]
fn an_interrupted_picture_goes_on() {
    let folder = Folder::new("s.kdl", SCENE);
    let (done, wanted) = interrupted(&folder, "a.exr");
    assert_eq!((&done["complete"], &done["files"][0]), (&false.into(), &"a.partial.exr".into()));
    assert!(done["samples"]["fewest"].as_u64().unwrap() >= 16);
    assert!(text(&folder, "a.partial.exr", "unfinished").is_some());
    folder.says(&format!("render s.kdl --size 96x64 --samples {wanted} -q --continue a.partial.exr -o a.exr"), 0, &[]);
    folder.says(&format!("render s.kdl --size 96x64 --samples {wanted} -q -o whole.exr"), 0, &[]);
    same(&folder, "a.exr", "whole.exr");
    assert!(!folder.path("a.partial.exr").exists(), "the whole picture makes the part obsolete");
}

/// Runs a render and sends a signal at this time after its last pass of samples. Returns the exit code, and the time
/// from that pass to the end.
#[cfg(unix)]
fn after_the_last_sample(folder: &Folder, run: &str, signal: Option<(&str, Duration)>) -> (i32, Duration) {
    let mut child = folder.command(&format!("{run} --progress json")).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines =
        std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap())).map_while(Result::ok);
    lines.find(|line| line.contains("\"event\":\"pass\"") && line.contains("\"next\":null")).unwrap();
    let start = Instant::now();
    if let Some((name, delay)) = signal {
        std::thread::sleep(delay);
        // The program may have ended.
        let _ = Command::new("kill").args([name, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
    }
    lines.for_each(drop);
    (child.wait().unwrap().code().unwrap(), start.elapsed())
}

/// Signals after the last sample: during features, denoising, encoding and writing. A picture is finished, or an older
/// one stays and the part beside it says that it isn't, and goes on to the same bytes.
#[cfg(unix)]
#[test]
fn signals_after_the_last_sample_leave_a_part() {
    let folder = Folder::new("s.kdl", SCENE);
    for (format, samples, part) in [("exr", 4, "a.partial.exr"), ("png", 6, "a.png.partial.exr")] {
        let run = format!("render s.kdl --size 144x96 --samples {samples} --denoise --aov depth");
        let (code, time) = after_the_last_sample(&folder, &format!("{run} -o whole.{format}"), None);
        assert_eq!(code, 0);
        let (picture, whole) = (folder.path(&format!("a.{format}")), folder.path(&format!("whole.{format}")));
        let mut stopped = 0;
        for (moment, name) in ["-INT", "-TERM", "-HUP", "-INT"].into_iter().enumerate() {
            fs::write(&picture, "older").unwrap();
            let delay = time * moment as u32 / 5;
            let (code, _) = after_the_last_sample(&folder, &format!("{run} -o a.{format}"), Some((name, delay)));
            if code == 0 {
                assert!(fs::read(&picture).unwrap() == fs::read(&whole).unwrap());
                continue;
            }
            stopped += 1;
            let expected = if name == "-TERM" { 143 } else { 130 };
            assert_eq!((code, fs::read(&picture).unwrap()), (expected, b"older".to_vec()));
            assert!(text(&folder, part, "unfinished").is_some());
            folder.says(&format!("{run} -q --continue {part} -o a.{format}"), 0, &[]);
            assert!(fs::read(&picture).unwrap() == fs::read(&whole).unwrap(), "{delay:?}");
            assert!(!folder.path(part).exists());
        }
        assert!(stopped > 0, "no signal came in time");
    }
}

/// A frame that a signal stops while it is denoised is made again.
#[cfg(unix)]
#[test]
fn a_series_makes_a_frame_again_that_was_not_denoised() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --frames 1-2 --size 144x96 --samples 4 --denoise";
    folder.says(&format!("{run} -q -o whole.##.png"), 0, &[]);
    let (code, _) = after_the_last_sample(&folder, &format!("{run} -o a.##.png"), Some(("-TERM", Duration::ZERO)));
    assert_eq!((code, folder.path("a.01.png").exists()), (143, false));
    folder.says(&format!("{run} -o a.##.png"), 0, &["2 frames rendered"]);
    for frame in ["01", "02"] {
        let [own, whole] = ["a", "whole"].map(|name| fs::read(folder.path(&format!("{name}.{frame}.png"))).unwrap());
        assert!(own == whole, "frame {frame}");
    }
}

/// The samples of a denoised picture aren't its colours.
#[test]
fn a_denoised_picture_goes_on() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -q --samples 32 -o whole.exr", 0, &[]);
    for flags in ["", "--aov noisy"] {
        folder.says(&format!("render s.kdl -q --samples 16 --denoise {flags} -o half.exr"), 0, &[]);
        folder.says("render s.kdl -q --samples 32 --continue half.exr -o on.exr", 0, &[]);
        same(&folder, "on.exr", "whole.exr");
    }
    folder.says("render s.kdl -q --samples 16 --aov half-a,half-b -o noisy.exr", 0, &[]);
    folder.says("denoise noisy.exr -q -o half.exr", 0, &[]);
    folder.says("render s.kdl -q --samples 32 --continue half.exr -o on.exr", 0, &[]);
    same(&folder, "on.exr", "whole.exr");
}

/// A PNG holds no samples, so an EXR beside its part does.
#[cfg(unix)]
#[test]
fn an_interrupted_png_goes_on() {
    let folder = Folder::new("s.kdl", SCENE);
    let (done, wanted) = interrupted(&folder, "a.png");
    assert_eq!(done["files"], serde_json::json!(["a.partial.png", "a.png.partial.exr"]));
    assert_eq!(done["samples_file"], "a.png.partial.exr");
    let run = format!("render s.kdl --size 96x64 --samples {wanted} -q");
    folder.says(&format!("{run} --continue a.png.partial.exr -o a.png"), 0, &[]);
    folder.says(&format!("{run} -o whole.png"), 0, &[]);
    same(&folder, "a.png", "whole.png");
    assert!(!folder.path("a.partial.png").exists() && !folder.path("a.png.partial.exr").exists());
}

/// The samples are worth more than the picture. The picture is large, so that the times of the files differ.
#[cfg(unix)]
#[test]
fn the_samples_of_an_interrupted_png_are_saved_first() {
    let folder = Folder::new("s.kdl", SCENE);
    let (done, _) = interrupted_after(&folder, "--size 480x320 -o a.png --aov depth", 2);
    assert_eq!(done["files"], serde_json::json!(["a.partial.png", "a.depth.partial.png", "a.png.partial.exr"]));
    let time = |name: &str| fs::metadata(folder.path(name)).unwrap().modified().unwrap();
    assert!(time("a.png.partial.exr") < time("a.partial.png"), "the picture was written first");
    // A signal between two passes leaves equal numbers of samples, which need no channel.
    assert!(text(&folder, "a.png.partial.exr", "samples").is_some());
}

#[test]
fn a_time_has_as_many_passes_as_fit() {
    let folder = Folder::new("s.kdl", SCENE);
    let start = Instant::now();
    let said = folder.says("render s.kdl --time 1s --progress json -o a.exr", 0, &[]);
    let events: Vec<serde_json::Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let done = events.last().unwrap();
    let passes: Vec<u64> = events
        .iter()
        .filter(|event| event["event"] == "pass")
        .map(|event| event["samples"].as_u64().unwrap())
        .collect();
    assert!(start.elapsed() < Duration::from_secs(20) && passes[..5] == [1, 2, 4, 8, 16], "{passes:?}");
    let samples = done["samples"]["fewest"].as_u64().unwrap();
    assert!(done["complete"] == true && samples == *passes.last().unwrap() && samples < 65_536);
    // The number of samples is all that depends on the time.
    folder.says(&format!("render s.kdl -q --samples {samples} -o b.exr"), 0, &[]);
    same(&folder, "a.exr", "b.exr");
    folder.says("render s.kdl --time 1h --samples 16 -o c.exr", 0, &["16 samples per pixel"]);
    folder.says("render s.kdl --time 0s", 2, &["60s"]);
    let grid = ["--time", "its rays stand on a grid", "--samples"];
    folder.says("render s.kdl --time 5s --integrator whitted --pattern regular", 2, &grid);
    folder.says("render s.kdl --time 5s --integrator whitted --pattern adaptive", 2, &grid);
}

/// The flags of integrators whose pictures grow if they are asked to.
const GROWING: [&str; 3] =
    ["--integrator whitted", "--integrator zbuffer", "--integrator radiosity --set integrator.error=0.3"];

#[test]
fn all_integrators_grow() {
    let folder = Folder::new("s.kdl", SCENE);
    for integrator in GROWING {
        let render = |flags: &str, words: &[&str]| {
            folder.says(&format!("render s.kdl {integrator} {flags}"), 0, words);
        };
        render("-q --samples 8 --progressive -o half.exr", &[]);
        render("-q --samples 16 --progressive -o whole.exr", &[]);
        render("-q --samples 16 --continue half.exr -o on.exr --threads 3", &[]);
        assert!(folder.bytes("on.exr") == folder.bytes("whole.exr"), "{integrator}");
        render("-q --samples 8 --first-sample 8 -o second.exr", &[]);
        let of = |name: &str| folder.picture(name).image.channel("G").unwrap().to_vec();
        let mean: Vec<f32> = of("half.exr").iter().zip(of("second.exr")).map(|(a, b)| 0.5 * a + 0.5 * b).collect();
        assert_eq!(mean, of("whole.exr"), "{integrator}");
        render("--time 1h --samples 16 -o time.exr", &["16 samples per pixel"]);
        same(&folder, "time.exr", "whole.exr");
        render("--noise 0.5 --samples 256 -o noise.exr", &["64 samples, noise 0."]);
        // Without being asked for, the picture is the usual one, and holds no samples.
        render("-q --samples 16 -o usual.exr", &[]);
        let refused = format!("render s.kdl {integrator} --samples 32 --continue usual.exr -o b.exr");
        folder.says(&refused, 3, &["it isn't an EXR of a growing picture"]);
        let refused = format!("render s.kdl {integrator} --samples 32 --continue half.exr --seed 1 -o b.exr");
        folder.says(&refused, 3, &["its seed is 0, not 1"]);
    }
}

#[cfg(unix)]
#[test]
fn interrupted_pictures_of_all_integrators_go_on() {
    for integrator in GROWING {
        let folder = Folder::new("s.kdl", SCENE);
        let (done, wanted) =
            interrupted_after(&folder, &format!("{integrator} --progressive --size 96x64 -o a.exr"), 4);
        assert_eq!((&done["complete"], &done["files"][0]), (&false.into(), &"a.partial.exr".into()), "{integrator}");
        let run = format!("render s.kdl {integrator} --progressive --size 96x64 --samples {wanted} -q");
        folder.says(&format!("{run} --continue a.partial.exr -o a.exr"), 0, &[]);
        folder.says(&format!("{run} -o whole.exr"), 0, &[]);
        same(&folder, "a.exr", "whole.exr");
    }
}

#[test]
fn noise_is_as_low_as_asked_or_a_warning_says_so() {
    let folder = Folder::new("s.kdl", SCENE);
    let said = folder.says("render s.kdl --noise 0.1 -o a.exr --threads 1", 0, &[" samples", "noise 0.0"]);
    assert!(!said.contains("warning"), "{said}");
    folder.says("render s.kdl --noise 0.1 -q -o b.exr --threads 3 --tile 7", 0, &[]);
    same(&folder, "a.exr", "b.exr");
    let words = ["warning", "not 0.001", "64 samples", "0.001 would take about ", "of the noise", "--clamp 10 would"];
    folder.says("render s.kdl --noise 0.001 --samples 64 -o c.png", 0, &words);
    folder.says("render s.kdl --noise 0", 2, &["above 0"]);
}

#[test]
fn a_clamp_says_what_it_takes() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl --clamp 1 --samples 16 -o a.exr", 0, &["--clamp 1 removed", "% of the picture's light"]);
    let most = folder.picture("a.exr").image.channel("R").unwrap().iter().fold(0.0f32, |most, v| most.max(*v));
    assert!(most <= 1.0);
    folder.says("render s.kdl --clamp 100 --samples 16 -o b.exr", 0, &[]);
    folder.says("render s.kdl -q --samples 16 -o c.exr", 0, &[]);
    same(&folder, "b.exr", "c.exr");
}

#[test]
fn a_live_preview_is_a_whole_picture_after_each_pass() {
    let folder = Folder::new("s.kdl", SCENE);
    let run = "render s.kdl --samples 65536 --size 400x300 --preview=live.png -q -o a.exr";
    let mut child = folder.command(run).spawn().unwrap();
    let start = Instant::now();
    let wanted = |text: &str| text.starts_with("a preview with ") && text.ends_with(" samples");
    loop {
        assert!(start.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
        let picture = fs::read(folder.path("live.png")).ok().map(|bytes| decode(&bytes).unwrap());
        let texts = picture.map(|picture| picture.metadata).unwrap_or_default();
        if texts.iter().any(|(key, text)| key == "unfinished" && wanted(text)) {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(!folder.path("a.exr").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    folder.says("render s.kdl --preview=live.gif", 2, &["--preview=live.gif"]);
}

/// The two halves of one sample are equal, and still its noise isn't zero.
#[test]
fn one_sample_is_denoised() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -q --samples 1 -o noisy.png", 0, &[]);
    folder.says("render s.kdl --samples 1 --denoise -o clean.png", 0, &["guessed from neighbouring", "wavelets 100%"]);
    folder.says("compare noisy.png clean.png", 0, &["differing"]);
}

#[test]
fn settings_of_the_classic_integrator_are_refused() {
    let folder = Folder::new("s.kdl", SCENE);
    for flag in ["--stage unlit", "--no-shadows"] {
        let name = flag.split(' ').next().unwrap();
        folder.says(
            &format!("render s.kdl {flag} -o a.png"),
            2,
            &[name, "integrator \"path\"", "--integrator whitted"],
        );
        folder.says(&format!("render s.kdl {flag} -q --integrator whitted -o a.png"), 0, &[]);
    }
}

#[test]
fn halves_for_denoising_are_independent() {
    let folder = Folder::new("s.kdl", SCENE);
    for (name, flags) in [("a", ""), ("b", "--seed 1"), ("c", "--first-sample 8"), ("d", "--first-sample 4")] {
        folder.says(&format!("render s.kdl -q --samples 8 -o {name}.exr {flags}"), 0, &[]);
    }
    fs::copy(folder.path("a.exr"), folder.path("copy.exr")).unwrap();
    fs::hard_link(folder.path("a.exr"), folder.path("link.exr")).unwrap();
    let twice = ["a.exr is given twice", "--seed 1"];
    folder.says("denoise a.exr ./a.exr -o no.exr", 2, &twice[1..]);
    folder.says("denoise a.exr a.exr -o no.exr", 2, &twice);
    folder.says("denoise a.exr link.exr -o no.exr", 2, &["a.exr and link.exr are one file"]);
    let shared = ["a.exr and copy.exr aren't independent: both have samples 0 to 7 of seed 0", "--first-sample 8"];
    folder.says("denoise a.exr copy.exr -o no.exr", 3, &shared);
    folder.says("denoise d.exr a.exr -o no.exr", 3, &["samples 4 to 11 and samples 0 to 7", "--first-sample 12"]);
    assert!(!folder.path("no.exr").exists());
    folder.says("denoise a.exr b.exr -o of-seeds.exr", 0, &["denoised"]);
    folder.says("denoise a.exr c.exr -o of-samples.exr", 0, &["denoised"]);
}

/// Files of other programs keep their colours in a layer.
#[test]
fn colours_of_a_single_layer_are_denoised() {
    let folder = Folder::new("s.kdl", SCENE);
    let exr = PictureFormat::all().find(|format| format.extension() == "exr").unwrap();
    let write = |file: &str, names: &[&str]| {
        // Channels of the same last letter have the same values.
        let value =
            |name: &str, i: usize| 0.5 + 0.01 * (i * 7 % 11) as f32 + f32::from(*name.as_bytes().last().unwrap());
        let channel = |name: &&str| Channel::new(*name, (0..12 * 8).map(|i| value(name, i)).collect());
        let image = Image { width: 12, height: 8, channels: names.iter().map(channel).collect() };
        let bytes = exr.encode_image(&image, Transfer::None, &EncodeSettings::default(), &[]).unwrap();
        fs::write(folder.path(file), bytes).unwrap();
    };
    let combined = ["A", "B", "G", "R"].map(|channel| format!("ViewLayer.Combined.{channel}"));
    let combined = combined.each_ref().map(String::as_str);
    write("plain.exr", &["A", "B", "G", "R"]);
    write("layer.exr", &[&combined[..], &["ViewLayer.Depth.Z"]].concat());
    folder.says("denoise plain.exr -q -o of-plain.exr", 0, &[]);
    let note = ["note: layer.exr: its colours are those of the layer ViewLayer.Combined"];
    folder.says("denoise layer.exr -o of-layer.exr", 0, &note);
    let [plain, layer] = ["of-plain.exr", "of-layer.exr"].map(|name| folder.picture(name).image);
    for name in ["R", "G", "B", "A", "noisy.R"] {
        assert!(plain.channel(name).is_some() && plain.channel(name) == layer.channel(name), "{name}");
    }
    assert!(layer.channel("ViewLayer.Depth.Z").is_some());
    write("two.exr", &["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"]);
    let found =
        ["two.exr has no channels R G B or Y, and no single layer", "it has \"a.B\", \"a.G\", \"a.R\", \"b.B\""];
    folder.says("denoise two.exr -o no.exr", 3, &found);
    write("none.exr", &["B", "G", "Z"]);
    folder.says("denoise none.exr -o no.exr", 3, &["it has \"B\", \"G\" and \"Z\""]);
}

/// Pixels that are no light are filled and counted. A picture of nothing else is refused.
#[test]
fn pixels_that_are_no_light_are_counted() {
    let folder = Folder::new("s.kdl", SCENE);
    let exr = PictureFormat::all().find(|format| format.extension() == "exr").unwrap();
    let write = |file: &str, broken: &dyn Fn(usize) -> f32| {
        let channel = |name: &str| Channel::new(name, (0..12 * 8).map(|i| 0.5 + broken(i)).collect());
        let image = Image { width: 12, height: 8, channels: ["B", "G", "R"].map(channel).into() };
        let bytes = exr.encode_image(&image, Transfer::None, &EncodeSettings::default(), &[]).unwrap();
        fs::write(folder.path(file), bytes).unwrap();
    };
    write("dots.exr", &|i| match i {
        40 => f32::NAN,
        41 => f32::INFINITY,
        77 => -5.0,
        _ => 0.0,
    });
    folder.says("denoise dots.exr -o out.exr", 0, &["warning: dots.exr: 3 pixels were no light"]);
    let image = folder.picture("out.exr").image;
    for name in ["R", "G", "B"] {
        assert!(image.channel(name).unwrap().iter().all(|v| (v - 0.5).abs() < 1e-4), "{name}");
    }
    write("none.exr", &|_| f32::NAN);
    folder.says("denoise none.exr -o no.exr", 3, &["none.exr: none of its pixels is light"]);
    assert!(!folder.path("no.exr").exists());
}

/// The halves of a denoised picture aren't those of its colours.
#[test]
fn a_denoised_picture_is_refused() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -q --samples 4 --aov half-a,half-b -o noisy.exr", 0, &[]);
    folder.says("denoise noisy.exr -q -o clean.exr", 0, &[]);
    folder.says("denoise clean.exr -o again.exr", 3, &["clean.exr is denoised already", "layer noisy"]);
    assert!(!folder.path("again.exr").exists());
}

/// The format doesn't notice damage of pixels that are stored as they are. The hash beside the settings does.
#[test]
fn damaged_pixels_are_noticed() {
    let folder = Folder::new("s.kdl", SCENE);
    let damage = |name: &str| {
        let mut bytes = fs::read(folder.path(name)).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(folder.path(name), &bytes).unwrap();
        assert!(decode(&bytes).unwrap().is_changed, "{name}");
    };
    let run = "render s.kdl -q --size 2x1";
    folder.says(&format!("{run} --samples 2 -o a.exr"), 0, &[]);
    folder.says("compare a.exr a.exr", 0, &[]);
    damage("a.exr");
    let words = ["a.exr", "aren't those that were written"];
    folder.says(&format!("{run} --samples 4 --continue a.exr -o b.exr"), 3, &words);
    folder.says("denoise a.exr -o b.exr", 3, &words);
    assert!(!folder.path("b.exr").exists());
    for bits in [16, 32] {
        let series =
            format!("render s.kdl --size 2x1 --samples 2 --frames 1-2 --bits {bits} -o f{bits}.#.exr --aov object-id");
        folder.says(&series, 0, &[]);
        folder.says(&series, 0, &["0 frames rendered, 2 complete before"]);
        let whole = fs::read(folder.path(&format!("f{bits}.2.exr"))).unwrap();
        damage(&format!("f{bits}.2.exr"));
        folder.says(&series, 0, &["1 frame rendered, 1 complete before"]);
        assert!(fs::read(folder.path(&format!("f{bits}.2.exr"))).unwrap() == whole);
    }
}

/// A preview that can't be written doesn't cost the picture.
#[cfg(target_os = "linux")]
#[test]
fn a_preview_that_cant_be_written_is_a_warning() {
    let folder = Folder::new("s.kdl", SCENE);
    std::os::unix::fs::symlink("/dev/full", folder.path("full.png")).unwrap();
    let said = folder.says("render s.kdl --samples 4 --preview=full.png -o a.png", 0, &["warning", "full.png"]);
    assert!(said.contains("the render goes on") && folder.path("a.png").exists(), "{said}");
    folder.says("render s.kdl --samples 4 --preview=full.png -o b.png --progress json", 0, &["\"warning\""]);
    same(&folder, "a.png", "b.png");
    folder.says("render s.kdl --samples 4 --preview=none/full.png -o c.png", 1, &["there is no folder none"]);
    assert!(!folder.path("c.png").exists(), "it is tried before the work");
}

/// What --dry-run tells of memory is near what a render takes, with samples, blocks, halves and layers.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_told_beforehand() {
    let folder = Folder::new("s.kdl", SCENE);
    for flags in [
        "--integrator whitted -o a.png",
        "--samples 2 -o a.png",
        "--samples 3 -o a.png",
        "--samples 3 -o a.exr",
        "--samples 2 --denoise=fast -o a.png",
        "--integrator zbuffer -o a.png",
        "--samples 2 --set integrator.guiding=on -o a.png",
        "--samples 2 --background none -o a.png",
        "--samples 3 --background none -o a.exr",
        "--integrator whitted --background none -o a.png",
    ] {
        let run = format!("render s.kdl --size 480x360 {flags} --progress json");
        let said = folder.says(&format!("{run} --dry-run"), 0, &["\"peak\""]);
        let plan: serde_json::Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
        let told = plan["memory"]["peak"].as_f64().unwrap();
        let script = format!("{} {run} 2>/dev/null & wait $!", CANALETTO);
        let mut shell = Command::new("sh").args(["-c", &script]).current_dir(folder.path("")).spawn().unwrap();
        let mut real = 0.0f64;
        while shell.try_wait().unwrap().is_none() {
            let children = fs::read_to_string(format!("/proc/{0}/task/{0}/children", shell.id())).unwrap_or_default();
            for child in children.split_whitespace() {
                let status = fs::read_to_string(format!("/proc/{child}/status")).unwrap_or_default();
                let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
                let kilobytes = peak.and_then(|peak| peak.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
                real = real.max(kilobytes.unwrap_or(0.0) * 1024.0);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let ratio = told / real;
        assert!((0.75..1.4).contains(&ratio), "{flags}: told {told}, real {real}");
    }
}

/// A room by day whose window takes a small part of the picture. Nothing says how it is developed.
const ROOM: &str = r#"
camera { eye 0 1.2 2.6; center -0.4 1.2 -2; fovy 65; size 36 24 }
integrator "path" { max-depth 4 }
film { samples 16 }
background 1 1.2 1.6
material "white" { kd 0.6 0.55 0.5 }
box material="white" { min -2 -0.1 -2; max 2 0 3 }
box material="white" { min -2 2.5 -2; max 2 2.6 3 }
box material="white" { min -2 0 -2.1; max 2 2.5 -2 }
box material="white" { min -2 0 3; max 2 2.5 3.1 }
box material="white" { min 2 0 -2; max 2.1 2.5 3 }
box material="white" { min -2.1 0 -2; max -2 1 3 }
box material="white" { min -2.1 1.8 -2; max -2 2.5 3 }
box material="white" { min -2.1 1 -0.6; max -2 1.8 3 }
"#;

/// A room by day is shown as a photo, with nothing said: neither dark nor white. Parts of it, previews, films and
/// pictures that go on have the same exposure, and files that are developed later take it over.
#[test]
fn a_room_is_a_photo_by_default() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("s.kdl"), ROOM).unwrap();
    folder.says("render s.kdl -o a.png", 0, &["auto exposure: "]);
    let stops = metered_stops(&folder, "a.png");
    assert!(stops > 2.0, "the room's own numbers are far too dark: {stops} stops");
    let shown = folder.picture("a.png").image.rgb().unwrap().map(<[f32]>::to_vec);
    let shares = |low: f32, high: f32| {
        let pixels = shown[1].iter().filter(|v| (low..=high).contains(*v)).count();
        pixels as f32 / shown[1].len() as f32
    };
    assert!(shares(0.25, 0.9) > 0.8, "{}", shares(0.25, 0.9));
    assert!(shares(0.0, 0.1) < 0.05, "{}", shares(0.0, 0.1));
    folder.says(&format!("render s.kdl -o b.png --exposure {stops} --tone agx"), 0, &[]);
    same(&folder, "a.png", "b.png");
    folder.says("render s.kdl -o b.png --crop 3,2,9,8 --samples 1 --seed 5", 0, &[]);
    assert_eq!(metered_stops(&folder, "b.png"), stops);
    // An EXR holds light, whatever is said of exposure. Pictures that are made of it are developed like the PNG.
    folder.says("render s.kdl -o a.exr", 0, &[]);
    folder.says("render s.kdl -o b.exr --exposure 3 --tone clamp", 0, &[]);
    assert_eq!(folder.picture("a.exr").image, folder.picture("b.exr").image);
    folder.says("compare a.exr a.png", 0, &["the pictures are equal"]);
    folder.says("render s.kdl -o b.exr --samples 4", 0, &[]);
    folder.says("render s.kdl -o b.png --continue b.exr", 0, &[]);
    same(&folder, "a.png", "b.png");
    folder.says("denoise a.exr -o clean.png", 0, &[]);
    assert_eq!(text(&folder, "clean.png", "exposure"), Some(stops.to_string()));
    assert_eq!(text(&folder, "clean.png", "tone"), Some("agx".into()));
    // 0 stops are told, so that the picture can be made again.
    folder.says("render s.kdl -o b.png --exposure 0", 0, &[]);
    folder.says("info b.png", 0, &["--exposure 0"]);
}

/// A film of a dusk grows dark: all frames have the exposure of the first one, whichever are rendered, in every format.
/// Keys on exposure and tone are followed.
#[test]
fn films_by_paths_do_not_flicker() {
    let folder = Folder::new("s.kdl", SCENE);
    let dusk = ROOM.replace("background 1 1.2 1.6", "background { key 1 4 4 4; key 4 0.5 0.5 0.5 }");
    let dusk = dusk.replace("size 36 24", "size 18 12").replace("samples 16", "samples 4");
    fs::write(folder.path("s.kdl"), format!("animation {{ frames 1 4 }}\n{dusk}")).unwrap();
    folder.says("render s.kdl --frames 1-4 -o f.#.png", 0, &[]);
    let stops = metered_stops(&folder, "f.1.png");
    let mean = |picture: &Decoded| picture.image.rgb().unwrap()[1].iter().sum::<f32>();
    let mut means = Vec::new();
    for frame in 1..=4 {
        assert_eq!(metered_stops(&folder, &format!("f.{frame}.png")), stops);
        means.push(mean(&folder.picture(&format!("f.{frame}.png"))));
    }
    assert!(means.windows(2).all(|pair| pair[1] < 0.95 * pair[0]), "{means:?}");
    folder.says("render s.kdl --frames 3 -o one.#.png", 0, &[]);
    assert_eq!(folder.picture("one.3.png").image, folder.picture("f.3.png").image);
    folder.says("render s.kdl --frames 1-4 -o film.apng", 0, &[]);
    assert_eq!(folder.picture("film.apng").image, folder.picture("f.1.png").image);
    assert_eq!(metered_stops(&folder, "film.apng"), stops);
    folder.says("render s.kdl --frames 1-4 -o film.gif", 0, &[]);
    folder.says(&format!("render s.kdl --frames 1-4 -o given.gif --exposure {stops} --tone agx"), 0, &[]);
    assert!(fs::read(folder.path("film.gif")).unwrap() == fs::read(folder.path("given.gif")).unwrap());
    // Keys.
    let keyed = dusk.replace(
        "film { ",
        "film { exposure { key 1 1; key 4 4; ease \"linear\" }; tone { key 1 \"agx\"; key 3 \"pbr-neutral\" }; ",
    );
    fs::write(folder.path("s.kdl"), format!("animation {{ frames 1 4 }}\n{keyed}")).unwrap();
    folder.says("render s.kdl --frames 1-4 -o k.#.png", 0, &[]);
    let told = |frame: u32| ["exposure", "tone"].map(|key| text(&folder, &format!("k.{frame}.png"), key).unwrap());
    assert_eq!(told(1), ["1", "agx"]);
    assert_eq!(told(3), ["3", "pbr-neutral"]);
    folder.says("render s.kdl --frames 1-4 -o film.apng", 0, &[]);
    assert_eq!(folder.picture("film.apng").image, folder.picture("k.1.png").image);
    folder.says("render s.kdl --frames 3 -o again.#.png --exposure 3 --tone pbr-neutral", 0, &[]);
    assert_eq!(folder.picture("again.3.png").image, folder.picture("k.3.png").image);
}
