//! `canaletto check`: finds mistakes, renders nothing.

use crate::exit::Exit;
use crate::failure::{Failure, plural, print_diagnostics};
use crate::frames::Frames;
use crate::source::{Reader, build};
use crate::stdout::{print, print_json};
use canaletto::camera::Camera;
use canaletto::render::Job;
use canaletto::world::BuildOptions;
use canaletto_io::diagnostic::Diagnostics;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Checks scenes and models: reads and builds them, and tells every mistake in every one.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CheckFlags {
    /// The files to check
    #[arg(value_name = "SCENE", required = true)]
    pub scenes: Vec<PathBuf>,

    /// Lets scenes read files outside their own folder
    #[arg(long, help_heading = "Scene")]
    pub allow_outside: bool,

    /// Checks this frame only [default: for a scene that moves, its first and those at its keys]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Takes warnings for errors
    #[arg(long, help_heading = "Messages")]
    pub strict: bool,

    /// Prints JSON: for each file its mistakes
    #[arg(long, help_heading = "Messages")]
    pub json: bool,

    /// Prints mistakes only, and nothing about files without any
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto check scenes/*.kdl
  canaletto check shot.kdl --json | jq '.[].diagnostics[].message'";

/// Runs the command.
pub(crate) fn run(flags: &CheckFlags) -> Result<Exit, Failure> {
    let mut all_well = true;
    let mut results = Vec::new();
    for path in &flags.scenes {
        let (found, failure) = match check(path, flags.allow_outside, flags.frame) {
            Ok(warnings) => (warnings, None),
            Err(Failure::Diagnostics(errors)) => (errors, None),
            Err(other) => (Diagnostics::new(), Some(other)),
        };
        let wrong = failure.is_some() || found.has_errors() || (flags.strict && !found.is_empty());
        all_well &= !wrong;
        let message = match &failure {
            Some(Failure::Message { message, .. }) => Some(message.clone()),
            _ => None,
        };
        if flags.json {
            results.push(json!({ "file": path, "ok": !wrong, "message": message, "diagnostics": found }));
            continue;
        }
        print_diagnostics(&found, false);
        if let Some(failure) = &failure {
            failure.print(false);
        }
        if !flags.quiet {
            print(&format!("{}: {}\n", path.display(), summary(&found, failure.is_some())))?;
        }
    }
    if flags.json {
        print_json(&json!(results))?;
    }
    Ok(if all_well { Exit::Done } else { Exit::Scene })
}

fn summary(found: &Diagnostics, failed: bool) -> String {
    match (found.errors() + usize::from(failed), found.warnings()) {
        (0, 0) => "ok".into(),
        (0, warnings) => format!("ok, {}", plural(warnings, "warning")),
        (errors, 0) => plural(errors, "error"),
        (errors, warnings) => format!("{}, {}", plural(errors, "error"), plural(warnings, "warning")),
    }
}

/// Everything that `render` would find, for every camera: at a frame, or at those by which all others can be judged.
fn check(path: &Path, allow_outside: bool, frame: Option<u32>) -> Result<Diagnostics, Failure> {
    let mut reader = Reader::open_file(path, &[], allow_outside)?;
    let clip = reader.clip();
    let frames = match (frame, clip.frames) {
        (Some(frame), _) => vec![frame],
        (None, Some([first, last])) => {
            Frames::new(first, last, 1).map_or(vec![first], |f| f.next_to(&reader.key_frames()))
        }
        (None, None) => {
            let keys = reader.key_frames();
            let last = keys.iter().fold(0.0, |a: f64, b| a.max(*b)).min(f64::from(u32::MAX)) as u32;
            let mut frames: Vec<u32> = keys.iter().flat_map(|key| [key.floor() as u32, key.ceil() as u32]).collect();
            frames.push(reader.first_frame());
            frames.retain(|frame| *frame <= last);
            frames.sort_unstable();
            frames.dedup();
            frames
        }
    };
    let mut warnings = None;
    for frame in frames {
        let source = reader.at(frame)?;
        for view in &source.scene.views {
            let wrong = |e: &dyn std::fmt::Display| {
                let at = if clip.moves { format!(" at frame {frame}") } else { String::new() };
                Failure::new(Exit::Scene, format!("{}: camera \"{}\"{at}: {e}", source.name, view.name))
            };
            let camera = Camera::new(&view.intrinsics, &view.extrinsics).map_err(|e| wrong(&e))?;
            Job::new(camera, source.scene.film, source.scene.integrator).check().map_err(|e| wrong(&e))?;
        }
        build(&source.name, source.scene, &BuildOptions::default(), None)?;
        warnings.get_or_insert(source.warnings);
    }
    Ok(warnings.unwrap_or_default())
}
