//! `canaletto render`: from a scene to pictures.

use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags};
use crate::interrupt;
use crate::layers::{self, MAPPINGS};
use crate::output::{Format, Frames, Output, OutputFlags, unfit};
use crate::progress::{ProgressFlag, Style, Watch, emit};
use crate::report::{Report, Times};
use crate::settings::{Settings, list, metadata, sampling_words, transfer_word};
use crate::source::{Source, build, on_threads};
use crate::stdout::print;
use crate::terminal::Paint;
use crate::words::{bytes, count, plural};
use canaletto::render::{Aov, Job, Rendering};
use canaletto::scene::{Stage, Transfer};
use canaletto::world::World;
use canaletto_io::picture::{Image, MAX_PIXELS, encode_exr, encode_png};
use canaletto_io::text::nearest;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Renders a scene or a model to a picture.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct RenderFlags {
    #[command(flatten)]
    pub source: SourceFlags,
    #[command(flatten)]
    pub output: OutputFlags,
    #[command(flatten)]
    pub picture: PictureFlags,

    /// Renders frames A to B, each with random numbers of its own
    #[arg(long, allow_hyphen_values = true, value_name = "A-B", value_parser = Frames::parse, help_heading = "Output")]
    pub frames: Option<Frames>,

    /// Extra layers beside the picture, such as normal,depth, or all
    #[arg(long, value_name = "LAYERS", value_delimiter = ',', value_parser = aov, help_heading = "Output")]
    pub aov: Vec<Layers>,

    /// The side of the squares that threads work on, in pixels; changes no picture
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=4096),
        hide_short_help = true, help_heading = "Output")]
    pub tile: u32,

    /// How progress is shown, on stderr
    #[arg(long, value_name = "HOW", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressFlag,

    /// Says nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,

    /// Reads and builds everything, says what would be rendered, and writes nothing
    #[arg(long, help_heading = "Messages")]
    pub dry_run: bool,
}

/// The names of one item of --aov.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layers {
    All,
    One(Aov),
}

const EXAMPLES: &str = "\
Examples:
  canaletto render shadow.kdl                                # makes shadow.png here
  canaletto render bunny.ply -o bunny.png --size 1600x1200 --samples 16
  canaletto render shot.kdl -o shot.exr --aov normal,depth   # layers in the same file
  canaletto render shot.kdl -o out/shot.####.png --frames 1-100
  canaletto render shot.kdl --set camera.fovy=40 -o - | display";

fn long_help() -> String {
    format!(
        "{EXAMPLES}\n\n{MAPPINGS}\n\nCtrl-C stops rendering and saves the picture so far; a second one exits at once."
    )
}

fn aov(text: &str) -> Result<Layers, String> {
    if text == "all" {
        return Ok(Layers::All);
    }
    Aov::from_name(text).map(Layers::One).ok_or_else(|| {
        let names = Aov::ALL.map(|(_, name, _)| name);
        match nearest(text, names) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("the layers are {}, and all", names.join(", ")),
        }
    })
}

/// What `render` does, all flags understood.
struct Plan {
    output: Output,
    frames: Frames,
    /// Whether frames were asked for.
    numbered: bool,
    aovs: Vec<Aov>,
    style: Style,
}

impl Plan {
    fn new(flags: &RenderFlags) -> Result<Plan, Failure> {
        let stem = flags.source.scene.file_stem().map_or_else(|| "picture".into(), |s| s.to_string_lossy());
        let output = Output::new(&flags.output, &stem, flags.frames)?;
        let mut aovs: Vec<Aov> = Vec::new();
        for layers in &flags.aov {
            let named = match layers {
                Layers::All => Aov::ALL.map(|(aov, ..)| aov).to_vec(),
                Layers::One(aov) => vec![*aov],
            };
            for aov in named {
                if !aovs.contains(&aov) {
                    aovs.push(aov);
                }
            }
        }
        if output.is_stdout() && output.format == Format::Png && !aovs.is_empty() {
            return Err(Failure::usage("--aov with PNG writes several files, but --output - takes one")
                .help("--format exr holds all layers in one file"));
        }
        let style = Style::new(flags.progress, flags.quiet);
        Ok(Plan {
            output,
            frames: flags.frames.unwrap_or(Frames::STILL),
            numbered: flags.frames.is_some(),
            aovs,
            style,
        })
    }

    /// The files of a frame, the picture first.
    fn files(&self, frame: u32) -> Vec<PathBuf> {
        let mut files = vec![self.output.path(frame)];
        if self.output.format == Format::Png {
            files.extend(self.aovs.iter().map(|aov| self.output.layer_path(frame, aov.name())));
        }
        files
    }
}

/// Runs the command.
pub(crate) fn run(flags: &RenderFlags) -> Result<Exit, Failure> {
    let plan = Plan::new(flags)?;
    plan.output.check(plan.frames.iter().flat_map(|frame| plan.files(frame)))?;
    interrupt::install(plan.style == Style::Json);
    on_threads(flags.source.threads, || on_pool(flags, &plan))?
}

fn on_pool(flags: &RenderFlags, plan: &Plan) -> Result<Exit, Failure> {
    let source = Source::read(&flags.source)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, plan.style == Style::Json);
    }
    let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
    let [_, _, width, height] = settings.job.window();
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MAX_PIXELS {
        let (pixels, most) = (count(pixels), count(MAX_PIXELS));
        return Err(Failure::usage(format!("a picture of {width} x {height} has {pixels} pixels; the most is {most}"))
            .help("render it in parts with --crop"));
    }
    room(&plan.aovs, [width, height])?;
    let inputs = source.files.iter().map(|used| Path::new(&used.file));
    plan.output.spare(plan.frames.iter().flat_map(|frame| plan.files(frame)), inputs)?;
    let Source { name, scene, files, time, .. } = source;
    let (world, build_time) = build(&name, scene)?;
    if flags.dry_run {
        return dry_run(flags, plan, &settings, &world, files.len());
    }
    let times = Times { read: time.as_secs_f64(), build: build_time.as_secs_f64(), ..Times::default() };
    let texts = metadata(&flags.source, &settings);
    let job = Job { aovs: plan.aovs.clone(), tile: flags.tile, ..settings.job };
    let session = Session { plan, name, camera: settings.camera, world, job, texts, times, pixels };
    let _rendering = interrupt::Rendering::begin();
    for frame in plan.frames.iter() {
        let report = session.frame(frame)?;
        match plan.style {
            Style::Json => emit(&report),
            _ if flags.quiet => {}
            _ => eprint_line(&report.text(&sampling_words(&session.job.film))),
        }
        if !report.complete || (interrupt::requested() && frame < plan.frames.last) {
            if plan.style != Style::Json {
                eprint_line(&interrupted(&report));
            }
            return Ok(Exit::Interrupted);
        }
    }
    Ok(Exit::Done)
}

/// Whether there is memory for a picture with its layers: thrice, since it is put into the order of its file and
/// compressed. Found out before anything is rendered, not after.
fn room(aovs: &[Aov], [width, height]: [u32; 2]) -> Result<(), Failure> {
    let channels = 3 + aovs.iter().map(|aov| aov.channels().len() as u64).sum::<u64>();
    let size = u64::from(width) * u64::from(height) * channels * size_of::<f32>() as u64 * 3;
    let size_in_memory = usize::try_from(size).unwrap_or(usize::MAX);
    if Vec::<u8>::new().try_reserve_exact(size_in_memory).is_ok() {
        return Ok(());
    }
    let (layers, size) = (plural(aovs.len() as u64, "layer"), bytes(size));
    let message = format!("there is no memory for {width} x {height} pixels with {layers}: it takes {size}");
    Err(Failure::new(Exit::Failed, message).help("render it in parts with --crop, or with fewer layers"))
}

/// All that the frames have in common.
struct Session<'a> {
    plan: &'a Plan,
    /// The scene's file.
    name: String,
    camera: String,
    world: World,
    job: Job,
    /// What the files carry besides pixels.
    texts: Vec<(String, String)>,
    times: Times,
    /// Of one frame.
    pixels: u64,
}

impl Session<'_> {
    /// Renders a frame and writes it.
    fn frame(&self, frame: u32) -> Result<Report, Failure> {
        let Session { plan, pixels, .. } = *self;
        let job = Job { frame, ..self.job.clone() };
        let [_, _, width, height] = job.window();
        let threads = rayon::current_num_threads();
        let (first, last) = (plan.frames.first, plan.frames.last);
        if plan.style == Style::Json {
            emit(&json!({
                "event": "start", "scene": self.name, "camera": self.camera, "frame": frame, "frames": [first, last],
                "size": [width, height], "pixels": pixels, "threads": threads, "files": plan.files(frame),
            }));
        }
        let label = if plan.numbered { format!("frame {frame} of {first}-{last}  ") } else { String::new() };
        let watch = Watch::begin(plan.style, frame, label, pixels);
        let rendered = canaletto::render::render(&self.world, &job, &watch);
        let render = watch.finish().as_secs_f64();
        let rendering = rendered.map_err(|e| Failure::new(Exit::Scene, format!("{}: {e}", self.name)))?;
        let start = Instant::now();
        // A black picture is worth nothing, and might replace a good one.
        let files = if rendering.pixels_done > 0 { self.save(&job, &rendering)? } else { Vec::new() };
        let rays_total = rendering.counts.total();
        Ok(Report {
            event: "done",
            frame,
            complete: rendering.complete,
            pixels_done: rendering.pixels_done,
            pixels,
            files,
            size: [width, height],
            primitives: self.world.census().primitives,
            rays: rendering.counts,
            rays_total,
            rays_per_second: (rays_total as f64 / render.max(1e-9)).round(),
            threads,
            seconds: Times { render, write: start.elapsed().as_secs_f64(), ..self.times },
        })
    }

    /// Writes a picture and its layers; returns the files' names.
    fn save(&self, job: &Job, rendering: &Rendering) -> Result<Vec<String>, Failure> {
        let mut texts = self.texts.clone();
        texts.push(("frame".into(), job.frame.to_string()));
        if !rendering.complete {
            texts.push(("unfinished".into(), "interrupted; black parts aren't rendered".into()));
        }
        let (picture, film, output) = (&rendering.picture, &job.film, &self.plan.output);
        let files = self.plan.files(job.frame);
        if output.format == Format::Exr {
            let bytes = encode_exr(&layers::linear(picture), &texts).map_err(|e| unfit(&e))?;
            output.write(&files[0], &bytes)?;
        } else {
            let write = |file: &Path, image: &Image, transfer, texts: &[_]| {
                output.write(file, &encode_png(image, output.depth, transfer, texts).map_err(|e| unfit(&e))?)
            };
            write(&files[0], &layers::developed(picture, film), film.transfer, &texts)?;
            for (layer, file) in picture.layers.iter().zip(&files[1..]) {
                let (image, transfer) = layers::to_image(layer, picture, film, &self.world.bounds());
                let mut texts = texts.clone();
                texts.retain(|(key, _)| key != "transfer");
                texts.push(("transfer".into(), transfer_word(transfer).into()));
                texts.push(("layer".into(), layer.name.into()));
                write(file, &image, transfer, &texts)?;
            }
        }
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }
}

fn interrupted(report: &Report) -> String {
    let paint = Paint::stderr().yellow("interrupted:");
    let percent = match report.pixels_done * 100 / report.pixels.max(1) {
        0 => "less than 1%".to_owned(),
        n => format!("{n}%"),
    };
    match report.files.first() {
        _ if report.complete => format!("{paint} frame {} is finished, the rest isn't rendered", report.frame),
        Some(file) => {
            let file = if file == "-" { "the standard output" } else { file };
            format!("{paint} {percent} of the picture is rendered; {file} has it, the rest is black")
        }
        None => format!("{paint} no part of the picture was finished, so nothing is written"),
    }
}

fn dry_run(
    flags: &RenderFlags,
    plan: &Plan,
    settings: &Settings,
    world: &World,
    files: usize,
) -> Result<Exit, Failure> {
    let (job, census) = (&settings.job, world.census());
    let [_, _, width, height] = job.window();
    let first = plan.files(plan.frames.first);
    if plan.style == Style::Json {
        emit(&json!({
            "event": "plan", "scene": flags.source.scene, "camera": settings.camera, "size": [width, height],
            "frames": [plan.frames.first, plan.frames.last], "files": first, "census": census,
        }));
        return Ok(Exit::Done);
    }
    let integrator = &job.integrator;
    let stage = Stage::ALL.iter().find(|(stage, _)| *stage == integrator.stage).map_or("", |(_, name)| name);
    let shadows = if integrator.shadows { "shadows" } else { "no shadows" };
    let kind = match (plan.output.format, job.film.transfer) {
        (Format::Exr, _) => "OpenEXR, linear".to_owned(),
        (Format::Png, transfer) => format!(
            "PNG, {} bits, {}",
            flags.output.bits.as_deref().unwrap_or("8"),
            if transfer == Transfer::Srgb { "sRGB" } else { "no transfer curve" }
        ),
    };
    let names: Vec<String> = first.iter().map(|file| file.display().to_string()).collect();
    let names = list(&names.iter().map(String::as_str).collect::<Vec<_>>()).replace('"', "");
    let frames =
        if plan.numbered { format!("; frames {} to {}", plan.frames.first, plan.frames.last) } else { String::new() };
    print(&format!(
        "scene     {}, {}\ncamera    {}, {width} x {height} pixels\nsampling  {}\nlight     stage {stage}, depth {}, {shadows}\n\
         world     {}, {}, {}\noutput    {names} ({kind}){frames}\nnothing is rendered or written (--dry-run)\n",
        flags.source.scene.display(),
        plural(files as u64, "file"),
        settings.camera,
        sampling_words(&job.film),
        integrator.max_depth,
        plural(census.primitives, "primitive"),
        match census.light_points {
            1 => "1 point of light".to_owned(),
            n => format!("{} points of light", count(n)),
        },
        bytes(census.bytes),
    ))?;
    Ok(Exit::Done)
}
