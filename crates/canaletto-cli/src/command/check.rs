//! `canaletto check`: finds mistakes, renders nothing.

use crate::exit::Exit;
use crate::failure::{Failure, plural, print_diagnostics};
use crate::source::{Source, build};
use crate::stdout::{print, print_json};
use canaletto::camera::Camera;
use canaletto::render::Job;
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
        let (found, failure) = match check(path, flags.allow_outside) {
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

/// Everything that `render` would find, for every camera.
fn check(path: &Path, allow_outside: bool) -> Result<Diagnostics, Failure> {
    let source = Source::read_file(path, &[], allow_outside)?;
    for view in &source.scene.views {
        let wrong = |e: &dyn std::fmt::Display| {
            Failure::new(Exit::Scene, format!("{}: camera \"{}\": {e}", source.name, view.name))
        };
        let camera = Camera::new(&view.intrinsics, &view.extrinsics).map_err(|e| wrong(&e))?;
        Job::new(camera, source.scene.film, source.scene.integrator).check().map_err(|e| wrong(&e))?;
    }
    build(&source.name, source.scene)?;
    Ok(source.warnings)
}
