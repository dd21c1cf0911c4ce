//! Compares whole processes that render pictures, from the start of the program to the written file.
//!
//! All renderers do equal work: one camera ray for each pixel. Before a scene is timed, small pictures of those that
//! report their camera rays are counted.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use canaletto::scene::Transfer;
use canaletto_io::picture::{EncodeSettings, PictureFormat, decode};
use serde_json::{Value, json};

use super::mitsuba::{Python, write};
use super::plain::Plain;
use super::stages::{Folder, Stage, load};
use super::statistics::{Clock, Times};
use super::{mitsuba, povray, tachyon};
use crate::say;

/// The options of the comparison.
pub struct Options {
    /// The scenes.
    pub stages: Vec<Stage>,
    /// The numbers of threads.
    pub threads: Vec<usize>,
    /// The clock for the times.
    pub clock: Clock,
    /// The size of the pictures.
    pub size: [u32; 2],
    /// The number of rounds.
    pub rounds: usize,
    /// Whether Tachyon renders meshes, too, which takes minutes.
    pub slow: bool,
}

/// One renderer: its name, its command, and seconds per round.
struct Renderer<'a> {
    name: &'static str,
    command: Box<dyn Fn() -> Command + 'a>,
    times: Times,
    rounds: usize,
    /// The picture, if the shading model equals Canaletto's.
    picture: Option<PathBuf>,
    /// The file with the renderer's own times, and those of all rounds.
    told: Option<(PathBuf, mitsuba::Told)>,
}

impl<'a> Renderer<'a> {
    fn new(name: &'static str, rounds: usize, command: impl Fn() -> Command + 'a) -> Self {
        Self { name, command: Box::new(command), times: Times::default(), rounds, picture: None, told: None }
    }

    /// Adds a picture that should resemble Canaletto's.
    fn like_ours(self, picture: &Path) -> Self {
        Self { picture: Some(picture.to_owned()), ..self }
    }
}

/// The path of a program in this program's folder.
fn beside(name: &str) -> Result<PathBuf, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?.with_file_name(name);
    if program.is_file() { Ok(program) } else { Err(format!("build {name} first: cargo build --release")) }
}

fn quiet(command: &mut Command) -> &mut Command {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null())
}

/// Runs a command to its end and returns the seconds that it took.
fn timed(mut command: Command, clock: Clock) -> Result<f64, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let mut status = None;
    let seconds = clock.time_child(|| status = Some(quiet(&mut command).status()));
    match status {
        Some(Ok(status)) if status.success() => Ok(seconds),
        Some(Ok(status)) => Err(format!("{name} failed: {status}")),
        Some(Err(e)) => Err(format!("{name}: {e}")),
        None => Ok(seconds),
    }
}

fn installed(program: &str) -> bool {
    quiet(Command::new(program).arg("--version")).status().is_ok()
}

/// The size of the pictures whose camera rays are counted.
const COUNTED: [u32; 2] = [64, 36];

/// Checks the number of camera rays of the renderers that report it: one for each pixel.
///
/// # Errors
/// The name of a renderer with another number, and that number.
fn count_camera_rays(stage: Stage, file: &Path, plain: &Plain<'_>, folder: &Path) -> Result<(), String> {
    let pixels = u64::from(COUNTED[0]) * u64::from(COUNTED[1]);
    let picture = folder.join(format!("{}-counted.png", stage.name()));
    let mut ours = canaletto(&beside("canaletto")?, file, &picture, Some(COUNTED), 1);
    ours.args(["--progress", "json"]).stdin(Stdio::null());
    let output = ours.output().map_err(|e| e.to_string())?;
    let reports = String::from_utf8_lossy(&output.stderr);
    let done = reports.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let done = done.rev().find(|report| report["event"] == "done");
    let traced = done.and_then(|report| report["rays"]["eye"]["traced"].as_u64());
    equal_work("canaletto", traced, pixels)?;
    if installed("povray") {
        let input = folder.join(format!("{}-counted.pov", stage.name()));
        write(&input, &povray::scene(plain, COUNTED))?;
        let output = povray::command(&input, &picture, COUNTED, 1).output().map_err(|e| e.to_string())?;
        equal_work("povray", povray::camera_rays(&String::from_utf8_lossy(&output.stderr)), pixels)?;
    }
    Ok(())
}

fn equal_work(renderer: &str, camera_rays: Option<u64>, pixels: u64) -> Result<(), String> {
    match camera_rays {
        Some(rays) if rays == pixels => Ok(()),
        Some(rays) => Err(format!("{renderer} traces {rays} camera rays for {pixels} pixels, and others one for each")),
        None => Err(format!("{renderer} reports no number of camera rays")),
    }
}

/// The command that renders a scene with one ray through the centre of each pixel.
fn canaletto(program: &Path, file: &Path, picture: &Path, size: Option<[u32; 2]>, threads: usize) -> Command {
    let mut command = Command::new(program);
    command.arg("render").arg(file).args(["--threads", &threads.to_string()]);
    if let Some([width, height]) = size {
        command.arg("--size").arg(format!("{width}x{height}"));
    }
    command.args(["--pattern", "center"]).arg("-o").arg(picture);
    command
}

/// That command without reports.
fn silent(mut command: Command) -> Command {
    command.args(["--quiet", "--progress", "none"]);
    command
}

/// Compares, prints, and returns everything as JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    let folder = Folder::new()?;
    say!("whole processes; {} interleaved rounds, medians; ratio: their time / ours", options.rounds);
    say!("difference: mean of that of channels to ours, of 255\n");
    say!("{:8} {:>2} {:>10} {:>9}   {:24} difference", "scene", "th", "renderer", "s", "ratio");
    let mut rows = Vec::new();
    let python = Python::find(&folder.0)?;
    let mut variants = Vec::new();
    match &python {
        Some(python) => {
            variants.extend(mitsuba::VARIANTS.into_iter().filter(|(_, variant)| python.has(variant)));
            if variants.len() < mitsuba::VARIANTS.len() {
                say!("a variant of Mitsuba doesn't work here; on Debian: {}", mitsuba::INSTALL_LLVM);
            }
        }
        None => say!("Mitsuba isn't installed: {}", mitsuba::INSTALL),
    }
    let mitsuba = python.as_ref().map(|python| (python, &variants[..]));
    for &stage in &options.stages {
        let file = stage.file(&folder.0)?;
        let scene = load(&file)?;
        let plain = Plain::new(&scene, options.size)?;
        count_camera_rays(stage, &file, &plain, &folder.0)?;
        for &threads in &options.threads {
            let renderers = renderers(stage, &file, &plain, threads, &folder.0, mitsuba, options)?;
            rows.extend(compare(stage, renderers, threads, options)?);
        }
    }
    Ok(json!({ "what": "pictures", "size": options.size, "clock": format!("{:?}", options.clock), "rows": rows }))
}

/// All installed renderers, Canaletto first, with the scene in their own languages.
fn renderers<'a>(
    stage: Stage,
    file: &'a Path,
    plain: &Plain<'_>,
    threads: usize,
    folder: &Path,
    mitsuba: Option<(&'a Python, &[(&'static str, &'static str)])>,
    options: &'a Options,
) -> Result<Vec<Renderer<'a>>, String> {
    let program = beside("canaletto")?;
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    let at = |name: &str| folder.join(format!("{}-{name}", stage.name()));
    let (size, few) = (options.size, options.rounds.min(3));
    let picture = at("ours.png");
    let ours = move || silent(canaletto(&program, file, &picture, Some(size), threads));
    let mut all = vec![Renderer::new("ours", options.rounds, ours).like_ours(&at("ours.png"))];
    match super::embree::Embree::new(threads) {
        Ok(_) => {
            let picture = at("embree.png");
            let recursion = move || {
                let mut command = Command::new(&this);
                command.arg("recursion").arg(file).arg("-o").arg(&picture);
                command.args(["--threads", &threads.to_string(), "--size", &format!("{}x{}", size[0], size[1])]);
                command
            };
            all.push(Renderer::new("embree", options.rounds, recursion).like_ours(&at("embree.png")));
        }
        Err(message) => say!("{message}"),
    }
    if installed("povray") {
        let (input, picture) = (at("pov"), at("povray.png"));
        write(&input, &povray::scene(plain, size))?;
        let command = move || povray::command(&input, &picture, size, threads);
        all.push(Renderer::new("povray", few, command).like_ours(&at("povray.png")));
    } else {
        say!("POV-Ray isn't installed; on Debian: {}", povray::INSTALL);
    }
    if stage == Stage::Serpent && !options.slow {
        say!("Tachyon takes minutes for meshes; --slow lets it");
    } else if installed("tachyon") {
        let (input, picture) = (at("dat"), at("tachyon.tga"));
        write(&input, &tachyon::scene(plain, size))?;
        let rounds = if stage == Stage::Serpent { 1 } else { few };
        all.push(Renderer::new("tachyon", rounds, move || tachyon::command(&input, &picture, size, threads)));
    } else {
        say!("Tachyon isn't installed; on Debian: {}", tachyon::INSTALL);
    }
    if let Some((python, variants)) = mitsuba {
        let input = at("mitsuba.xml");
        mitsuba::write_scene(plain, size, &input)?;
        for &(name, variant) in variants {
            let (input, picture, seconds) = (input.clone(), at(&format!("{name}.png")), at(&format!("{name}.json")));
            let told = Some((seconds.clone(), mitsuba::Told::default()));
            let command = move || python.command(variant, threads, [&input, &picture, &seconds]);
            all.push(Renderer { told, ..Renderer::new(name, few, command) });
        }
    }
    Ok(all)
}

/// Runs all renderers in interleaved rounds, and prints a line for each.
fn compare(
    stage: Stage,
    mut renderers: Vec<Renderer<'_>>,
    threads: usize,
    options: &Options,
) -> Result<Vec<Value>, String> {
    for round in 0..options.rounds {
        for renderer in renderers.iter_mut().filter(|renderer| round < renderer.rounds) {
            renderer.times.0.push(timed((renderer.command)(), options.clock)?);
            if let Some((file, told)) = &mut renderer.told {
                told.add(file, options.clock)?;
            }
        }
    }
    let mut rows = Vec::new();
    let (times, ours) = (&renderers[0].times, renderers[0].picture.as_deref());
    for renderer in &renderers {
        let ratio = times.faster_than(&renderer.times);
        let pair = ours.zip(renderer.picture.as_deref()).filter(|(ours, theirs)| ours != theirs);
        let difference = pair.map(|(ours, theirs)| difference(ours, theirs)).transpose()?;
        let median = renderer.times.median();
        let shown = difference.map_or(String::new(), |d| format!("{d:.2}"));
        let ratio_text = ratio.to_string();
        say!("{:8} {threads:2} {:>10} {median:9.3}   {ratio_text:24} {shown}", stage.name(), renderer.name);
        if let Some((_, told)) = &renderer.told {
            say!("{:22}   {told}", "");
        }
        rows.push(json!({ "scene": stage.name(), "threads": threads, "renderer": renderer.name,
            "seconds": renderer.times.0, "ratio": ratio.median, "ratio_min": ratio.min, "ratio_max": ratio.max,
            "difference": difference, "own": renderer.told.as_ref().map(|(_, told)| told.json()) }));
    }
    say!();
    Ok(rows)
}

/// The mean difference of two pictures' channels, of 255.
fn difference(ours: &Path, theirs: &Path) -> Result<f64, String> {
    let read = |path: &Path| {
        let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
        decode(&bytes).map(|decoded| decoded.image).map_err(|e| format!("{}: {e}", path.display()))
    };
    let [a, b] = [read(ours)?, read(theirs)?];
    let (Some(a), Some(b)) = (a.rgb(), b.rgb()) else { return Err("a picture without colours".into()) };
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    let (sum, count) = pairs.fold((0.0, 0), |(sum, n), (a, b)| (sum + f64::from((a - b).abs()), n + 1));
    Ok(255.0 * sum / f64::from(count.max(1)))
}

/// Compares whole processes: Canaletto on the chapter's scene of 230 × 230, and a process that only writes that
/// picture.
pub fn start(threads: &[usize], rounds: usize, clock: Clock) -> Result<Value, String> {
    let folder = Folder::new()?;
    let program = beside("canaletto")?;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/chapter/fig-5.24b-shadow.kdl");
    say!("the chapter's scene at 230 × 230; {rounds} interleaved rounds, medians; ratio: ours / (start + PNG)");
    let mut rows = Vec::new();
    for &threads in threads {
        let picture = folder.0.join("picture.png");
        let render = || timed(silent(canaletto(&program, &file, &picture, None, threads)), clock);
        render()?;
        let bytes = std::fs::read(&picture).map_err(|e| e.to_string())?;
        let image = decode(&bytes).map_err(|e| e.to_string())?.image;
        let (mut whole, mut starts, mut writes) = (Times::default(), Times::default(), Times::default());
        for _ in 0..rounds {
            whole.0.push(render()?);
            let mut version = Command::new(&program);
            version.arg("--version");
            starts.0.push(timed(version, clock)?);
            let again = folder.0.join("again.png");
            let mut written = Ok(());
            writes.0.push(clock.time(|| {
                let png = PictureFormat::Png
                    .encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[])
                    .unwrap_or_default();
                written = std::fs::write(&again, png);
            }));
            written.map_err(|e| e.to_string())?;
        }
        let alone = Times(starts.0.iter().zip(&writes.0).map(|(a, b)| a + b).collect());
        let ratio = alone.faster_than(&whole);
        let [a, b, c] = [&whole, &starts, &writes].map(|times| times.median() * 1e3);
        say!("{threads} threads: {a:.2} ms; start {b:.2} ms, PNG {c:.2} ms; ratio {ratio}");
        rows.push(json!({ "threads": threads, "seconds": whole.0, "start": starts.0, "png": writes.0,
            "ratio": ratio.median, "ratio_min": ratio.min, "ratio_max": ratio.max }));
    }
    Ok(json!({ "what": "start", "clock": format!("{clock:?}"), "rows": rows }))
}
