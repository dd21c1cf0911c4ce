//! `canaletto ladder`: a sheet of pictures from flat colour to the whole equation, each with one term more.

mod sheet;

use crate::command::render::stem;
use crate::command_files::CommandFiles;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags::{MessageFlags, PictureFlags, SourceFlags};
use crate::format::{JSON_VERSION, bytes, count, plural};
use crate::layers::developed;
use crate::metering::{exposed, is_metered, meter};
use crate::output::{Output, OutputFlags};
use crate::progress::Style;
use crate::settings::{Settings, classic, sampling_words};
use crate::source::{Reader, build, on_threads, seen_through};
use crate::stdout::{print, print_json};
use crate::watched::watched;
use canaletto::integrator::describe;
use canaletto::ladder::{Rung, has_textures, without_textures};
use canaletto::render::{Job, render};
use canaletto::world::World;
use canaletto::{Named, memory};
use canaletto_io::picture::{Image, MAX_PIXELS};
use clap::Args;
use serde_json::{Value, json};
use sheet::{Cell, sheet};
use std::path::PathBuf;

/// Renders the stages of the shading equation into one sheet, each with the term that it adds.
///
/// Nine pictures climb from flat colour to the whole equation: unlit, diffuse, ambient, specular, shadow, reflection,
/// refraction, textures, anti-aliasing. Below each stands its term and how many pixels changed. The classic integrator
/// makes them all. The last picture takes the scene's own sampling if that has several rays for each pixel; else it
/// takes 16 jittered rays. The pictures before have one ray for each pixel.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct LadderFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the frame, as in `render --frames` [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Picture")]
    pub frame: Option<u32>,

    #[command(flatten)]
    pub output: OutputFlags,
    #[command(flatten)]
    pub picture: PictureFlags,
    #[command(flatten)]
    pub messages: MessageFlags,
}

const EXAMPLES: &str = "\
Examples:
  canaletto ladder scenes/chapter/fig-5.27b-glass.kdl
  canaletto ladder scenes/still-life.kdl --size 400x250 -o ladder.png
  canaletto ladder scenes/still-life.kdl --size 25% --json -o ladder.png | jq .rungs";

fn long_help() -> String {
    let rungs = Rung::ALL.iter().map(|rung| format!("  {:<14} {:<25} {}\n", rung.name(), rung.term(), rung.meaning()));
    format!("{EXAMPLES}\n\nPictures:\n{}", rungs.collect::<String>().trim_end())
}

/// A finished rung.
struct RungPicture {
    rung: Rung,
    job: Job,
    /// The picture in display values.
    image: Image,
    /// The number of pixels whose 8-bit values differ from those of the rung before; none for the first.
    changed: Option<u64>,
}

/// What the command prints.
struct LadderReport {
    scene: String,
    camera: String,
    size: [u32; 2],
    file: PathBuf,
    /// The name of the scene's integrator, if it isn't the classic one.
    replaced_integrator: Option<&'static str>,
    rungs: Vec<RungPicture>,
}

/// Runs the command.
pub(crate) fn run(flags: &LadderFlags) -> Result<Exit, Failure> {
    let report = on_threads(flags.source.threads, || ladder(flags))??;
    match flags.messages.json {
        // A picture on the standard output leaves no place for a report.
        _ if report.file.as_os_str() == "-" => {}
        true => print_json(&report.json())?,
        false => print(&report.text())?,
    }
    Ok(Exit::Done)
}

fn ladder(flags: &LadderFlags) -> Result<LadderReport, Failure> {
    if flags.picture.stage.is_some() {
        return Err(Failure::usage("--stage chooses one stage, but a ladder shows all of them"));
    }
    let output = Output::new(&flags.output, &format!("{}.ladder", stem(&flags.source.scene)), false, false)?;
    let Some(format) = output.format.picture() else {
        return Err(Failure::usage(format!("--output: {} isn't a format of pictures", output.format)));
    };
    let mut reader = Reader::open_classic(&flags.source)?;
    let source = reader.at_chosen(flags.picture.camera.as_deref(), flags.frame)?;
    flags.messages.warn(&source.warnings);
    let (name, scene, frame) = (source.name, source.scene, source.frame);
    let replaced_integrator = describe(&scene.integrator).whitted().is_none().then(|| scene.integrator.name());
    let settings = Settings::new(&name, &scene, &classic(&flags.picture, &scene)?)?;
    let job = Job { frame, ..settings.job };
    let file = output.path(frame);
    let files = CommandFiles::default().writes("--output", [file.clone()]);
    flags.output.folder.make_folders(&files)?;
    output.check([file.clone()])?;
    files.check_scene(&reader)?;
    let [_, _, width, height] = job.window();
    check_room([width, height])?;
    let options = seen_through(&settings.camera, &scene, flags.source.build_options(0));
    let textured = has_textures(&scene);
    let plain = if textured { Some(without_textures(&scene)) } else { None };
    let mut rungs = Vec::new();
    match plain {
        Some(plain) => {
            let (world, _) = build(&name, plain, &options, None)?;
            let work = LadderWork::new(&name, flags.messages.style(), &world, &job)?;
            work.climb(&world, |rung| !rung.has_textures(), &mut rungs)?;
            drop(world);
            let (world, _) = build(&name, scene, &options, None)?;
            work.climb(&world, Rung::has_textures, &mut rungs)?;
        }
        None => {
            let (world, _) = build(&name, scene, &options, None)?;
            LadderWork::new(&name, flags.messages.style(), &world, &job)?.climb(&world, |_| true, &mut rungs)?;
        }
    }
    let cells = rungs.iter().enumerate().map(|(index, rung)| Cell {
        image: &rung.image,
        lines: [
            format!("{} {}", index + 1, rung.rung.name()),
            rung.rung.term().to_owned(),
            rung.changed.map_or_else(String::new, changed_words),
        ],
    });
    let drawing = sheet(&cells.collect::<Vec<_>>());
    let names: Vec<&str> = rungs.iter().map(|rung| rung.rung.name()).collect();
    let file_name = flags.source.scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let texts = [("scene".to_owned(), file_name), ("ladder".to_owned(), names.join(" "))];
    output.write_drawing(&file, format, drawing, &texts)?;
    Ok(LadderReport { scene: name, camera: settings.camera, size: [width, height], file, replaced_integrator, rungs })
}

/// Checks before rendering that a file can hold the sheet, and that memory suffices for it.
fn check_room([width, height]: [u32; 2]) -> Result<(), Failure> {
    let pixels = u64::from(width) * u64::from(height) * Rung::ALL.len() as u64;
    if pixels > MAX_PIXELS {
        let message = format!("a sheet of {width} x {height} pictures has {} pixels", count(pixels));
        return Err(Failure::usage(format!("{message}; the most is {}", count(MAX_PIXELS)))
            .help("make the pictures smaller with --size"));
    }
    // The pictures, the sheet and its copies have 12 bytes in each pixel.
    let size = pixels * 12 * 5;
    memory::room(size).map_err(|_| {
        Failure::new(Exit::Failed, format!("there is no memory for the sheet: it takes {}", bytes(size)))
            .help("make the pictures smaller with --size")
    })
}

/// What all rungs need.
struct LadderWork<'a> {
    /// The scene's name.
    name: &'a str,
    style: Style,
    job: Job,
}

impl<'a> LadderWork<'a> {
    /// The work on a job. If its exposure is `auto`, it is metered in the world, and all rungs have it.
    fn new(name: &'a str, style: Style, world: &World, job: &Job) -> Result<LadderWork<'a>, Failure> {
        let mut job = if is_metered(job) { exposed(job, meter(name, world, job, None)?) } else { job.clone() };
        // The rungs differ in light.
        job.film.alpha = false;
        Ok(LadderWork { name, style, job })
    }

    /// Renders the rungs for which `belongs` holds.
    fn climb(
        &self,
        world: &World,
        belongs: impl Fn(Rung) -> bool,
        rungs: &mut Vec<RungPicture>,
    ) -> Result<(), Failure> {
        for &rung in Rung::ALL.iter().filter(|rung| belongs(**rung)) {
            let job = rung.job(&self.job);
            let rendering = watched(self.style, self.name, rung.name(), &job, |watch| render(world, &job, watch))?;
            if !rendering.complete {
                return Err(Failure::new(Exit::Interrupted, "interrupted; no sheet is written"));
            }
            let image = developed(&rendering.picture, &job.developing());
            let changed = rungs.last().map(|before| changed_pixels(&before.image, &image));
            rungs.push(RungPicture { rung, job, image, changed });
        }
        Ok(())
    }
}

/// The number of pixels whose 8-bit values differ.
fn changed_pixels(a: &Image, b: &Image) -> u64 {
    let (Some(a), Some(b)) = (a.rgb(), b.rgb()) else { return 0 };
    let stored = |v: f32| (v * 255.0).round();
    let differs = |i: &usize| (0..3).any(|c| stored(a[c][*i]) != stored(b[c][*i]));
    (0..a[0].len()).filter(differs).count() as u64
}

fn changed_words(changed: u64) -> String {
    match changed {
        0 => "no pixel changes".into(),
        1 => "1 pixel changes".into(),
        _ => format!("{} change", plural(changed, "pixel")),
    }
}

impl LadderReport {
    fn text(&self) -> String {
        let [width, height] = self.size;
        let mut out = format!(
            "{}: {} of {width} x {height} pixels\n",
            self.file.display(),
            plural(Rung::ALL.len() as u64, "picture")
        );
        if let Some(name) = self.replaced_integrator {
            out += &format!("the scene's integrator is {name}; these are the stages of the classic one\n");
        }
        for (index, rung) in self.rungs.iter().enumerate() {
            let changed = rung.changed.map_or_else(String::new, changed_words);
            let line = format!("{} {:<14} {:<25} {changed}", index + 1, rung.rung.name(), rung.rung.term());
            out += line.trim_end();
            out.push('\n');
        }
        if let Some(last) = self.rungs.last() {
            out += &format!("the last has {}\n", sampling_words(&last.job.film));
        }
        out
    }

    fn json(&self) -> Value {
        let rungs = self.rungs.iter().map(|rung| {
            json!({
                "name": rung.rung.name(),
                "term": rung.rung.term(),
                "stage": rung.rung.stage().name(),
                "sampling": sampling_words(&rung.job.film),
                "changed": rung.changed,
            })
        });
        json!({
            "version": JSON_VERSION,
            "scene": self.scene,
            "camera": self.camera,
            "size": self.size,
            "picture": self.file,
            "replaced_integrator": self.replaced_integrator,
            "rungs": rungs.collect::<Vec<_>>(),
        })
    }
}
