//! Tests of the binary with user mistakes and hostile files. The result is a message and an exit code, never a lost
//! file.
#![cfg(unix)]

mod support;

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{CANALETTO, Folder, canaletto};

const SCENE: &str = "camera { eye 0 0 5; center 0 0 0; size 12 8 }\nlight \"omni\" { position 0 5 5 }\n";
const BALL: &str = "sphere { center 0 0 0; radius 1 }\n";

/// A folder with a scene of these objects.
fn scene_of(objects: &str) -> Folder {
    Folder::new("s.kdl", &format!("{SCENE}{objects}"))
}

/// The exit code and the output on stderr.
fn run(folder: &Folder, arguments: &[&str]) -> (i32, String) {
    let output = canaletto(folder.path("")).args(arguments).stdin(Stdio::null()).output().unwrap();
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[track_caller]
fn expect(folder: &Folder, arguments: &[&str], exit: i32, parts: &[&str]) {
    let (code, said) = run(folder, arguments);
    assert_eq!(code, exit, "{arguments:?}: {said}");
    assert!(parts.iter().all(|part| said.contains(part)), "{arguments:?}: {said}");
}

#[test]
fn what_is_read_is_never_replaced() {
    let folder = scene_of("mesh file=\"m.obj\"\n");
    fs::write(folder.path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::os::unix::fs::symlink("s.kdl", folder.path("link.png")).unwrap();
    for output in ["s.kdl", "./m.obj", "link.png"] {
        let before = fs::read(folder.path(output)).unwrap();
        expect(
            &folder,
            &["render", "s.kdl", "--format", "png", "-o", output],
            2,
            &["would replace a file that is read"],
        );
        assert_eq!(fs::read(folder.path(output)).unwrap(), before);
    }
    expect(&folder, &["render", "s.kdl", "-q", "-o", "a.png"], 0, &[]);
    let before = fs::read(folder.path("a.png")).unwrap();
    expect(&folder, &["compare", "a.png", "a.png", "--diff", "./a.png"], 2, &["--diff ./a.png would replace"]);
    assert_eq!(fs::read(folder.path("a.png")).unwrap(), before);
}

/// No output replaces a file that the scene reads at any frame, under any name.
#[test]
fn what_a_later_frame_reads_is_not_replaced() {
    let folder = scene_of(
        "include \"more.kdl\"\nmesh { file { key 1 \"a.obj\"; key 3 \"b.obj\"; key 90 \"sub/c.obj\" } }\n\
         texture \"t\" kind=\"image\" { file { key 1 \"t.png\"; key 80 \"u.png\" } }\n",
    );
    let path = |name: &str| folder.path(name);
    fs::create_dir(path("sub")).unwrap();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for name in ["a.obj", "b.obj"] {
        fs::write(path(name), mesh).unwrap();
    }
    fs::write(path("sub/c.obj"), format!("mtllib my lib.mtl\n{mesh}")).unwrap();
    fs::write(path("sub/my lib.mtl"), "newmtl m\nKd 1 0 0\n").unwrap();
    fs::write(path("more.kdl"), BALL).unwrap();
    let plain = scene_of(BALL);
    expect(&plain, &["render", "s.kdl", "-q", "-o", "p.png"], 0, &[]);
    for name in ["t.png", "u.png"] {
        fs::copy(plain.path("p.png"), path(name)).unwrap();
    }
    fs::hard_link(path("b.obj"), path("hard.png")).unwrap();
    std::os::unix::fs::symlink("sub/c.obj", path("soft.png")).unwrap();
    std::os::unix::fs::symlink("sub", path("other")).unwrap();
    let inputs =
        ["b.obj", "./sub/../b.obj", "hard.png", "soft.png", "other/c.obj", "other/my lib.mtl", "more.kdl", "u.png"];
    for output in inputs {
        for (format, frames) in [("apng", "1-2"), ("png", "1"), ("exr", "1")] {
            let run = ["render", "s.kdl", "--format", format, "--frames", frames, "-o", output];
            expect(&folder, &run, 2, &["would replace a file that is read"]);
        }
    }
    // Partial files and layers have names of their own, and frames have numbers.
    fs::hard_link(path("b.obj"), path("p.partial.png")).unwrap();
    expect(&folder, &["render", "s.kdl", "-o", "p.png"], 2, &["p.partial.png would replace"]);
    fs::hard_link(path("b.obj"), path("l.depth.png")).unwrap();
    expect(&folder, &["render", "s.kdl", "-o", "l.png", "--aov", "depth"], 2, &["l.depth.png would replace"]);
    fs::hard_link(path("u.png"), path("n.07.png")).unwrap();
    expect(&folder, &["render", "s.kdl", "-o", "n.##.png", "--frames", "5-9"], 2, &["n.07.png would replace"]);
    expect(&folder, &["compare", "t.png", "u.png", "--diff", "n.07.png"], 2, &["--diff n.07.png would replace"]);
    assert!(["a.obj", "b.obj"].iter().all(|name| fs::read(path(name)).unwrap() == mesh.as_bytes()));
    expect(&folder, &["render", "s.kdl", "-q", "-o", "new.png"], 0, &[]);
    expect(&folder, &["render", "s.kdl", "-q", "-o", "new.png"], 0, &[]);
}

#[test]
fn scenes_that_multiply_say_so() {
    let mut text = format!("prototype name=\"p0\" {{ {BALL} }}\n");
    for i in 1..40 {
        let last = i - 1;
        text += &format!("prototype name=\"p{i}\" {{ instance of=\"p{last}\"; instance of=\"p{last}\" }}\n");
    }
    let folder = scene_of(&(text + "instance of=\"p39\""));
    expect(
        &folder,
        &["render", "s.kdl"],
        3,
        &["\"p32\" expands to more than 4294967294 copies", "help: instances of instances"],
    );
    let folder = scene_of("sphere name=\"moon\" { center 0 0 0; radius 1; scale 1e30; scale 1e30 }");
    expect(
        &folder,
        &["render", "s.kdl"],
        3,
        &["moon: after its transforms it reaches beyond", "help: transforms of an"],
    );
    let folder = scene_of(BALL);
    expect(&folder, &["render", "s.kdl", "--set", "integrator.max-depth=257"], 2, &["must be at most 256"]);
}

/// Runs under a memory limit. Neither an endless file nor a picture that doesn't fit takes all memory.
#[test]
fn memory_is_asked_for_before_it_is_taken() {
    let folder = scene_of(BALL);
    expect(&folder, &["render", "s.kdl", "-q", "-o", "a.png"], 0, &[]);
    let limited = |arguments: &str| {
        let script = format!("ulimit -v 3000000; exec {} {arguments}", CANALETTO);
        let output = Command::new("sh").args(["-c", &script]).current_dir(folder.path("")).output().unwrap();
        (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, said) = limited("render s.kdl -o b.exr --aov all --size 16384x16384 --threads 1");
    assert!(code == 1 && said.contains("there is no memory for 16384 x 16384 pixels with 17 layers"), "{code} {said}");
    let (code, said) = limited("compare a.png /dev/zero");
    assert!(code == 3 && said.contains("no picture that can be read"), "{code} {said}");
}

#[test]
fn odd_names_are_names() {
    let folder = scene_of(BALL);
    for name in ["a b", "ünï", "-x", "100%", "a####", "a\nb"] {
        fs::copy(folder.path("s.kdl"), folder.path(&format!("{name}.kdl"))).unwrap();
        expect(&folder, &["render", "-q", "--", &format!("{name}.kdl")], 0, &[]);
        assert!(folder.path(&format!("{name}.png")).exists(), "{name}");
    }
    expect(&folder, &["render", "s.kdl", "-q", "-o", "h.##.png"], 0, &[]);
    assert!(folder.path("h.##.png").exists(), "# counts with --frames only");
    let bytes = std::ffi::OsStr::from_bytes(b"\xff.kdl");
    fs::copy(folder.path("s.kdl"), folder.path("").join(bytes)).unwrap();
    let output = canaletto(folder.path("")).arg("info").arg(bytes).output();
    assert_eq!(output.unwrap().status.code(), Some(3));
    // Some files can't be opened. File names can't send control codes to a terminal.
    std::os::unix::fs::symlink("nowhere", folder.path("lost.kdl")).unwrap();
    expect(&folder, &["render", "lost.kdl"], 3, &["it is a link to nowhere"]);
    expect(&folder, &["render", "-"], 3, &["<stdin> has no camera"]);
    let (code, said) = run(&folder, &["render", "\u{1b}[31mred.kdl"]);
    assert!(code == 3 && !said.contains('\u{1b}'), "{said:?}");
}

#[test]
fn negative_numbers_are_judged_as_numbers() {
    let folder = scene_of(BALL);
    for (flag, value, part) in [
        ("--size", "-1x5", "write width x height"),
        ("--samples", "-4", "invalid value"),
        ("--max-depth", "-1", "-1 is not in 1..=256"),
        ("--threads", "-1", "-1 is not in 1..=1024"),
        ("--frames", "-1", "write a number or two"),
        ("--crop", "-1,0,2,2", "four whole"),
        ("--seed", "-1", "invalid value"),
    ] {
        expect(&folder, &["render", "s.kdl", flag, value], 2, &["invalid value", part]);
    }
    expect(&folder, &["explain", "s.kdl", "--pixel", "-1,0"], 2, &["invalid value"]);
    fs::write(folder.path("a.png"), "x").unwrap();
    expect(&folder, &["compare", "a.png", "a.png", "--diff", "d.png", "--diff-scale", "nan"], 2, &["more than 0"]);
}

/// Starts a command, waits for these words and then for `wait`, and interrupts it, twice if `twice`. Returns the exit
/// code and the output since the interrupt.
fn interrupted(folder: &Folder, arguments: &str, words: &str, wait: Duration, twice: bool) -> (Option<i32>, String) {
    let mut command = folder.command(arguments);
    command.stdin(Stdio::null());
    let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(words.is_empty() || lines.by_ref().any(|line| line.unwrap().contains(words)), "{arguments}");
    std::thread::sleep(wait);
    let signal = || Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    signal();
    if twice {
        std::thread::sleep(Duration::from_millis(100));
        signal();
    }
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        // A command should end within two seconds. The test allows 30, for a machine under load.
        if start.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            panic!("it goes on: {arguments}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    (child.wait().unwrap().code(), rest.join("\n"))
}

/// A signal ends even a pixel that would take practically forever.
#[test]
fn ctrl_c_ends_an_endless_pixel() {
    let glass = scene_of(
        "material \"m\" { k 1 1 1; kd 0 0 0; opacity 0; eta 1.5 }\nintegrator { max-depth 256; min-weight 0 }\n\
         spheres material=\"m\" radius=1 { points 0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 }\n",
    );
    let lights = scene_of(
        "sphere { center 0 0 0; radius 3 }\n\
         light \"disk\" { position 0 30 50; normal 0 -1 0; radius 2; points 4096 }\n",
    );
    for (folder, flags) in [(&glass, ""), (&lights, "--samples 65536"), (&lights, "--samples 65536 --aov depth")] {
        let run = format!("render s.kdl --crop 5,3,2,2 --threads 2 --progress json {flags}");
        let wait = Duration::from_millis(300);
        let (code, said) = interrupted(folder, &run, "\"event\":\"start\"", wait, false);
        // The render stopped in time to save its picture. A black picture is not saved and replaces no file.
        assert!(code == Some(130) && said.contains("\"complete\":false"), "{flags}: {code:?} {said}");
        assert!(!folder.path("s.png").exists() && !folder.path("s.partial.png").exists());
    }
}

/// Neither blocked files nor large files keep a command from ending on a signal.
#[test]
fn ctrl_c_ends_whatever_goes_on() {
    let folder = scene_of(BALL);
    let path = |name: &str| folder.path(name);
    for name in ["nobody.png", "nobody.exr", "nobody.kdl"] {
        assert!(Command::new("mkfifo").arg(path(name)).status().unwrap().success());
    }
    let large: String = (0..400_000).map(|n| format!("sphere {{ center {n} 0 0; radius 0.5 }}\n")).collect();
    fs::write(path("large.kdl"), format!("{SCENE}{large}")).unwrap();
    let mut grid: String = (0..1_000_000).map(|n| format!("v {} {} {}\n", n % 1000, n / 1000, n % 7)).collect();
    for n in (1..999_000).filter(|n| n % 1000 != 0) {
        grid += &format!("f {n} {} {}\n", n + 1, n + 1000);
    }
    fs::write(path("large.obj"), grid).unwrap();
    for run in [
        "render s.kdl -o nobody.png",
        "render s.kdl -o nobody.exr --frames 1",
        "compare nobody.png nobody.exr",
        "render large.kdl -o a.png",
        "check large.kdl",
        "explain large.kdl --pixel 3,3",
        "render large.obj -o a.png",
        "info large.obj",
    ] {
        for twice in [false, true] {
            // Before the handler is installed, a signal ends the process directly, without an exit code. That wait was
            // too short.
            let waits = [100, 200, 400, 800, 1600].map(Duration::from_millis);
            let mut ends = waits.iter().map(|wait| interrupted(&folder, run, "", *wait, twice));
            let end = ends.find(|(code, _)| code.is_some());
            let Some((code, said)) = end else { panic!("{run}: it never listened") };
            assert!(code == Some(130) && said.contains("interrupted"), "{run}: {code:?} {said}");
        }
    }
    assert!(!path("a.png").exists());
    expect(&folder, &["render", "nobody.kdl"], 3, &["a pipe, not a file"]);
}

/// The old file stays. The partial file lies beside it, and is removed when the picture is complete.
#[test]
fn the_part_of_a_picture_goes_beside_it() {
    let folder = scene_of(BALL);
    let path = |name: &str| folder.path(name);
    for (file, part) in [("a.png", "a.partial.png"), ("a.exr", "a.partial.exr")] {
        let layer = if file == "a.png" { "a.depth.png" } else { file };
        let short = format!("render s.kdl -o {file} --aov depth -q --size 300x200");
        expect(&folder, &short.split(' ').collect::<Vec<_>>(), 0, &[]);
        let whole = [file, layer].map(|name| fs::read(path(name)).unwrap());
        let long =
            format!("render s.kdl -o {file} --aov depth --size 300x200 --samples 2000 --tile 4 --progress plain");
        for _ in 0..2 {
            let (code, said) = interrupted(&folder, &long, "%", Duration::ZERO, false);
            assert!(code == Some(130) && said.contains(&format!("{part} has it")), "{code:?} {said}");
        }
        assert!([file, layer].map(|name| fs::read(path(name)).unwrap()) == whole);
        let names = || fs::read_dir(folder.path("")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let parts = names().filter(|name| name.starts_with("a.") && name.contains(".partial")).count();
        assert_eq!(parts, if file == "a.png" { 2 } else { 1 }, "{:?}", names().collect::<Vec<_>>());
        // A user's own file is not taken for a partial picture, and stays.
        fs::write(path("b.partial.png"), "mine").unwrap();
        expect(&folder, &["render", "s.kdl", "-o", "b.png", "-q"], 0, &[]);
        assert_eq!(fs::read(path("b.partial.png")).unwrap(), b"mine");
        let (_, said) = interrupted(&folder, &long.replace(file, "b.png"), "%", Duration::ZERO, false);
        assert!(said.contains("b.partial-2.png has it"), "{said}");
        for name in names().filter(|name| name.starts_with("b.") && name != "b.partial.png") {
            fs::remove_file(path(&name)).unwrap();
        }
        expect(&folder, &short.split(' ').collect::<Vec<_>>(), 0, &[]);
        assert!(names().all(|name| !name.starts_with("a.") || !name.contains(".partial")));
    }
}

/// A killed program leaves no temporary file, or the next run removes it.
#[test]
fn killed_programs_leave_nothing() {
    let folder = scene_of(&format!("animation {{ frames 1 9 }}\n{BALL}"));
    let names = || fs::read_dir(folder.path("")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut command = folder.command("render s.kdl -o f.gif --size 300x200 --samples 400");
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    child.kill().unwrap();
    child.wait().unwrap();
    if cfg!(target_os = "linux") {
        assert_eq!(names().collect::<Vec<_>>(), ["s.kdl"]);
    }
    fs::write(folder.path(".canaletto-0123abcd.tmp"), "left behind").unwrap();
    expect(&folder, &["render", "s.kdl", "-o", "a.png", "-q"], 0, &[]);
    let mut left: Vec<String> = names().collect();
    left.sort();
    assert_eq!(left, ["a.png", "s.kdl"]);
}

/// Files of every kind exceed the available memory.
#[cfg(target_os = "linux")]
#[test]
fn where_memory_runs_out_it_is_said() {
    const COUNT: usize = 400_000;
    let folder = scene_of("");
    let write = |name: &str, bytes: Vec<u8>| fs::write(folder.path(name), bytes).unwrap();
    let header = |kind: &str| {
        format!(
            "ply\nformat {kind} 1.0\nelement vertex {COUNT}\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let mut binary = header("binary_little_endian").into_bytes();
    binary.extend((0..3 * COUNT).flat_map(|i| ((i * i) as f32).to_le_bytes()));
    binary.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    write("a.ply", binary);
    let rows = |lead: &str| (0..COUNT).map(|i| format!("{lead}{i} {} {}\n", i * i % 7, i * i % 11)).collect::<String>();
    write("b.obj", format!("{}f 1 2 3\n", rows("v ")).into_bytes());
    write("c.csv", rows("").into_bytes());
    write("c.kdl", format!("{SCENE}spheres file=\"c.csv\" radius=1\n").into_bytes());
    let balls: String = (0..COUNT).map(|i| format!("sphere {{ center {i} 0 0; radius 1 }}\n")).collect();
    write("d.kdl", format!("{SCENE}{balls}").into_bytes());
    for name in ["a.ply", "b.obj", "c.kdl", "d.kdl"] {
        let mut ended = [false; 2];
        // The limits, in kilobytes of address space, range from too little for anything to enough for everything.
        for limit in [30_000, 45_000, 60_000, 300_000, 16_000_000] {
            let script = format!("ulimit -v {limit}; exec \"$0\" render {name} --size 8x8 --threads 1 -q -o o.png");
            let mut command = Command::new("sh");
            command.args(["-c", &script, CANALETTO]).current_dir(folder.path(""));
            let output = command.stdin(Stdio::null()).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            match output.status.code() {
                Some(0) => ended[0] = true,
                code => {
                    ended[1] = true;
                    assert_eq!(code, Some(1), "{name}, {limit} kB: {:?} {said}", output.status);
                    let figure = said.contains("out of memory while") || said.contains("there is no memory for");
                    assert!(figure, "{name}, {limit} kB: {said}");
                }
            }
        }
        assert!(ended[0], "{name} is never rendered");
        assert!(ended[1] || name != "d.kdl", "{name} is rendered in 30 MB of address space");
    }
}
