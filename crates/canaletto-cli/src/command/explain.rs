//! `canaletto explain`: the tree of rays behind a pixel.

use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags, pixel};
use crate::format::JSON_VERSION;
use crate::settings::Settings;
use crate::solutions::{GivenSolutionFlags, SolutionFlags, Solutions, fingerprint};
use crate::source::{Reader, build, on_threads, seen_through};
use crate::stdout::print;
use canaletto::explain::{PixelTree, explain, explain_with_solution};
use canaletto::math::Rgb;
use canaletto::render::Job;
use canaletto::scene::Integrator;
use clap::Args;
use serde::Serialize;

/// Explains a pixel: the tree of rays behind it, with every term of the shading equation as a number.
///
/// The sum of the terms is the pixel's colour in linear light, bit for bit as in an EXR.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ExplainFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the pixel: column and row from the top left, from 0, as in image viewers
    #[arg(short, long, allow_hyphen_values = true, value_name = "X,Y", value_parser = pixel, help_heading = "Pixel")]
    pub pixel: [u32; 2],

    /// Counts rows from the bottom
    #[arg(long, help_heading = "Pixel")]
    pub y_up: bool,

    /// Sets the frame, as in `render --frames` [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Pixel")]
    pub frame: Option<u32>,

    #[command(flatten)]
    pub picture: PictureFlags,
    #[command(flatten)]
    pub solution: GivenSolutionFlags,

    /// Prints JSON, with the sum of all terms as `sum`
    #[arg(long, help_heading = "Messages")]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto explain fig-5.23b-shadow.kdl --pixel 115,80
  canaletto explain fig-5.23b-shadow.kdl --pixel 115,149 --y-up    # the same pixel of 230 rows
  canaletto explain glass.kdl --pixel 60,40 --json | jq .sum";

/// A tree of rays with the sum of its terms.
#[derive(Serialize)]
struct WithSum<'a> {
    version: u32,
    #[serde(flatten)]
    tree: &'a PixelTree,
    sum: Rgb,
}

/// Runs the command.
pub(crate) fn run(flags: &ExplainFlags) -> Result<Exit, Failure> {
    let tree = on_threads(flags.source.threads, || tree(flags))??;
    if flags.json {
        let json = serde_json::to_string_pretty(&WithSum { version: JSON_VERSION, sum: tree.sum(), tree: &tree })
            .map_err(|e| Failure::new(Exit::Failed, format!("the tree can't be written as JSON: {e}")))?;
        print(&(json + "\n"))?;
    } else {
        print(&tree.to_string())?;
    }
    Ok(Exit::Done)
}

fn tree(flags: &ExplainFlags) -> Result<PixelTree, Failure> {
    let mut reader = Reader::open(&flags.source, flags.picture.integrator)?;
    reader.choose_camera(flags.picture.camera.as_deref());
    let frame = flags.frame.unwrap_or(reader.first_frame());
    let source = reader.at(frame)?;
    print_diagnostics(&source.warnings, false);
    let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
    let solution = SolutionFlags::from(&flags.solution);
    solution.check_integrator(&source.name, &settings.job.integrator)?;
    let mut solutions = Solutions::new(&solution, false)?;
    let fingerprint = fingerprint(&source.scene, &settings.job).filter(|_| solution.given().is_some());
    let options = seen_through(&settings.camera, &source.scene, flags.source.build_options(0));
    let (world, _) = build(&source.name, source.scene, &options, None)?;
    let job = Job { frame, ..settings.job };
    let [x, y] = flags.pixel;
    let [_, height] = job.camera.size();
    // A row outside the picture is not mirrored, so that the message shows the user's own number.
    let row = if flags.y_up && y < height { height - 1 - y } else { y };
    let explained = match (&fingerprint, &job.integrator) {
        (Some(fingerprint), Integrator::Radiosity(settings)) => {
            match solutions.solution(&source.name, &world, fingerprint, settings, &(), &mut ())? {
                Some((solution, _)) => explain_with_solution(&world, &job, &solution, x, row),
                None => return Err(Failure::Reported(Exit::Interrupted)),
            }
        }
        _ => explain(&world, &job, x, row),
    };
    explained.map_err(|e| Failure::usage(format!("--pixel: {e}")))
}
