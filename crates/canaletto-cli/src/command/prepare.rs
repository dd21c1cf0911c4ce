//! `canaletto prepare`: what a picture needs before its first sample, once for all its parts.

use crate::command_files::{CommandFiles, FolderFlag};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags};
use crate::format::{duration, plural};
use crate::guiding_file::{is_guided, write_guiding};
use crate::model::is_model;
use crate::output::{check_files, write_with};
use crate::progress::{ProgressDisplay, ProgressFlag, RunProgress, Style};
use crate::sample_file::scene_digest;
use crate::settings::{Settings, metadata};
use crate::solutions::{SolutionFlags, Solutions, fingerprint};
use crate::source::{Reader, build, on_threads, seen_through};
use canaletto::Named;
use canaletto::render::{Job, learn_guiding};
use canaletto::scene::Integrator;
use canaletto_io::picture::WriteOptions;
use clap::Args;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Prepares a picture: solves radiosity, or learns where the light of guided paths comes from.
///
/// The file serves all parts of the picture by `render --prepared`, and their bytes are those without it. It belongs
/// to the scene and to the settings that it was made with.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PrepareFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the file of what is prepared
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub output: PathBuf,

    /// Fails if the file exists already, instead of replacing it
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,

    #[command(flatten)]
    pub folder: FolderFlag,
    #[command(flatten)]
    pub picture: PictureFlags,

    /// Sets how progress is shown on stderr
    #[arg(long, value_name = "HOW", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressFlag,

    /// Prints errors only
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto prepare scenes/path.kdl --set integrator.guiding=on -o room.state
  canaletto render scenes/path.kdl --set integrator.guiding=on --prepared room.state --part 1/8 -o 1.exr
  canaletto prepare scenes/gallery-room.kdl -o gallery.state";

/// Runs the command.
pub(crate) fn run(flags: &PrepareFlags) -> Result<Exit, Failure> {
    on_threads(flags.source.threads, || prepare(flags))?
}

fn prepare(flags: &PrepareFlags) -> Result<Exit, Failure> {
    let (source_flags, file) = (&flags.source, &flags.output);
    let style = Style::new(flags.progress, flags.quiet);
    let integrator = flags.picture.integrator_of(source_flags);
    let mut reader = Reader::open(source_flags, integrator, flags.picture.max_depth)?;
    reader.choose_camera(flags.picture.camera.as_deref());
    let frame = reader.first_frame();
    let source = reader.at(frame)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, style == Style::Json);
    }
    let files = CommandFiles::default().writes("--output", [file.clone()]);
    files.check_scene(&reader)?;
    flags.folder.make_folders(&files)?;
    check_files([file.clone()], file, flags.no_clobber)?;
    let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
    settings.check_pixels()?;
    let mut texts = metadata(source_flags, &settings);
    texts.extend(scene_digest(&source.files, &source_flags.changes()));
    let job = Job { frame, ..settings.job };
    let solved = fingerprint(&source.scene, &job);
    if solved.is_none() && !is_guided(&job) {
        let message = format!("{}: a picture by {} needs nothing prepared", source.name, job.integrator.name());
        let help = match job.integrator {
            Integrator::Path(_) => "parts need no --prepared; --set integrator.guiding=auto guides paths",
            _ if is_model(&source_flags.scene) => "parts need no --prepared",
            _ => "parts need no --prepared; radiosity and guided paths do",
        };
        return Err(Failure::usage(message).help(help));
    }
    let options = seen_through(&settings.camera, &source.scene, source_flags.build_options(0));
    let (world, _) = build(&source.name, source.scene, &options, None)?;
    let display = ProgressDisplay::begin(style, frame, String::new(), 0, RunProgress::SINGLE);
    let made = match (&solved, job.description().radiosity()) {
        (Some(fingerprint), Some(radiosity)) => {
            let save = SolutionFlags { save_solution: Some(file.clone()), solution: None };
            let mut solutions = Solutions::new(&save, flags.no_clobber)?;
            let solution = solutions.solution(&source.name, &world, fingerprint, radiosity, &display)?;
            solution.map(|_| "the solution of radiosity".to_owned())
        }
        _ => {
            let learnt = learn_guiding(&world, &job, &display);
            match learnt.map_err(|e| Failure::new(Exit::Scene, format!("{}: {e}", source.name)))? {
                ControlFlow::Break(()) => None,
                ControlFlow::Continue(field) => {
                    let options = WriteOptions { no_clobber: flags.no_clobber, durable: true };
                    write_with(file, options, |out| write_guiding(&field, (&job, &texts), out))?;
                    Some(match field.cell_count() as u64 {
                        0 => "that guiding isn't worth its time here".to_owned(),
                        cells => format!("a field of path guiding with {}", plural(cells, "cell")),
                    })
                }
            }
        }
    };
    let time = display.finish();
    let Some(made) = made else {
        return Err(Failure::new(Exit::Interrupted, "interrupted; nothing is written"));
    };
    if !flags.quiet && style != Style::Json {
        eprint_line(&format!("{}: {made}, {}", file.display(), duration(time)));
    }
    Ok(Exit::Done)
}
