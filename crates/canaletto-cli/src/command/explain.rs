//! `canaletto explain`: the tree of rays behind a pixel.

use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags, pixel};
use crate::format::{JSON_VERSION, count};
use crate::output::write_file;
use crate::settings::Settings;
use crate::solutions::{GivenSolutionFlags, SolutionFlags, Solutions, fingerprint};
use crate::source::{Reader, build, on_threads, seen_through};
use crate::stdout::print;
use canaletto::explain::{Explainer, PixelTree, RayTree, TextStyle};
use canaletto::math::Rgb;
use canaletto::render::Job;
use canaletto::scene::{Extrinsics, Integrator, Intrinsics, View};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Explains a pixel: the tree of rays behind it, with every term of the shading equation as a number.
///
/// The sum of the terms is the pixel's colour in linear light, bit for bit as in an EXR.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ExplainFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the pixel: column and row from the top left, from 0, as in image viewers
    #[arg(
        short,
        long,
        allow_hyphen_values = true,
        value_name = "X,Y",
        value_parser = pixel,
        help_heading = "Pixel",
        required_unless_present = "ray",
        conflicts_with = "ray"
    )]
    pub pixel: Option<[u32; 2]>,

    /// Explains a ray instead of a pixel: its origin and its direction, six numbers. The scene needs no camera
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "OX,OY,OZ,DX,DY,DZ",
        value_parser = ray,
        help_heading = "Pixel",
        conflicts_with = "y_up"
    )]
    pub ray: Option<[f64; 6]>,

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

    /// Prints rays down to this level; camera rays have level 1 [default: as many levels as fit into 100 lines]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Messages")]
    pub levels: Option<u32>,

    /// Prints everything: all samples, all points of lights, all rays, and numbers that read back exactly
    #[arg(long, help_heading = "Messages")]
    pub full: bool,

    /// Prints numbers with this many significant digits [default: 6; those that read back exactly with --full]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=17), help_heading = "Messages")]
    pub digits: Option<u8>,

    /// Adds the numbers on the chapter's way: the camera's axes, each object that the ray is tried against, the
    /// equation of the intersection, the vectors of reflection and refraction, the factors of light
    #[arg(long, help_heading = "Messages")]
    pub steps: bool,

    /// Draws the tree of rays too, as in fig. 5.29: surfaces with their colours, rays with their factors. - prints the
    /// drawing alone
    #[arg(long, value_name = "FILE.svg", help_heading = "Messages")]
    pub svg: Option<PathBuf>,

    /// Prints JSON, with the sum of all terms as `sum`
    #[arg(long, help_heading = "Messages")]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto explain fig-5.23b-shadow.kdl --pixel 115,80
  canaletto explain fig-5.23b-shadow.kdl --pixel 115,149 --y-up    # the same pixel of 230 rows
  canaletto explain fig-5.23b-shadow.kdl --pixel 115,80 --steps --digits 4
  canaletto explain fig-5.23b-shadow.kdl --ray 100,40,40,-1,-0.2,-0.4
  canaletto explain glass.kdl --pixel 60,40 --svg tree.svg
  canaletto explain glass.kdl --pixel 60,40 --json | jq .sum";

/// A tree of rays with the sum of its terms.
#[derive(Serialize)]
struct WithSum<'a> {
    version: u32,
    #[serde(flatten)]
    tree: &'a Explained,
    sum: Rgb,
}

/// What is explained.
#[derive(Serialize)]
#[serde(untagged)]
enum Explained {
    Pixel(Box<PixelTree>),
    Ray(Box<RayTree>),
}

impl Explained {
    fn sum(&self) -> Rgb {
        match self {
            Explained::Pixel(tree) => tree.sum(),
            Explained::Ray(tree) => tree.ray.sum(),
        }
    }

    fn svg(&self, levels: Option<u32>) -> String {
        match self {
            Explained::Pixel(tree) => tree.svg(levels),
            Explained::Ray(tree) => tree.svg(levels),
        }
    }

    fn text(&self, style: &TextStyle) -> String {
        match self {
            Explained::Pixel(tree) => tree.text(style),
            Explained::Ray(tree) => tree.text(style),
        }
    }
}

/// Six numbers with commas between them.
fn ray(text: &str) -> Result<[f64; 6], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "write six numbers: the origin's x,y,z and the direction's x,y,z".into())
}

/// Runs the command.
pub(crate) fn run(flags: &ExplainFlags) -> Result<Exit, Failure> {
    let tree = on_threads(flags.source.threads, || tree(flags))??;
    if let Some(file) = &flags.svg {
        write_file(file, tree.svg(flags.levels).as_bytes())?;
        if file == Path::new("-") {
            return Ok(Exit::Done);
        }
    }
    if flags.json {
        let json = serde_json::to_string_pretty(&WithSum { version: JSON_VERSION, sum: tree.sum(), tree: &tree })
            .map_err(|e| Failure::new(Exit::Failed, format!("the tree can't be written as JSON: {e}")))?;
        print(&(json + "\n"))?;
    } else {
        let mut style = if flags.full { TextStyle::FULL } else { TextStyle::SHORT };
        style.levels = flags.levels;
        style.digits = flags.digits.or(style.digits);
        let text = tree.text(&style);
        let (lines, all) = (text.lines().count(), tree.text(&TextStyle::FULL).lines().count());
        let folded = if lines < all {
            let (lines, all) = (count(lines as u64), count(all as u64));
            format!("\n{lines} of {all} lines; --levels N shows more rays, --full everything\n")
        } else {
            String::new()
        };
        print(&(text + &folded))?;
    }
    Ok(Exit::Done)
}

fn tree(flags: &ExplainFlags) -> Result<Explained, Failure> {
    let mut reader = Reader::open(&flags.source, flags.picture.integrator)?;
    reader.choose_camera(flags.picture.camera.as_deref());
    let frame = flags.frame.unwrap_or(reader.first_frame());
    let mut source = reader.at(frame)?;
    print_diagnostics(&source.warnings, false);
    if flags.ray.is_some() && source.scene.views.is_empty() {
        // A ray has no camera, but a job has one.
        source.scene.views.push(View {
            name: "none".into(),
            intrinsics: Intrinsics::default(),
            extrinsics: Extrinsics::default(),
            motion: Vec::new(),
        });
    }
    let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
    let solution = SolutionFlags::from(&flags.solution);
    solution.check_integrator(&source.name, &settings.job.integrator)?;
    let mut solutions = Solutions::new(&solution, false)?;
    let fingerprint = fingerprint(&source.scene, &settings.job).filter(|_| solution.given().is_some());
    let options = seen_through(&settings.camera, &source.scene, flags.source.build_options(0));
    let (world, _) = build(&source.name, source.scene, &options, None)?;
    let job = Job { frame, ..settings.job };
    let given = match (&fingerprint, &job.integrator) {
        (Some(fingerprint), Integrator::Radiosity(settings)) => {
            let found = solutions.solution(&source.name, &world, fingerprint, settings, &(), &mut ())?;
            Some(found.ok_or(Failure::Reported(Exit::Interrupted))?.0)
        }
        _ => None,
    };
    let mut explainer = Explainer::new(&world, &job).with_steps(flags.steps);
    if let Some(solution) = &given {
        explainer = explainer.with_solution(solution);
    }
    match (flags.ray, flags.pixel) {
        (Some([ox, oy, oz, dx, dy, dz]), _) => {
            let ray = explainer.ray([ox, oy, oz], [dx, dy, dz]);
            let ray = ray.map_err(|e| Failure::usage(format!("--ray: {e}")))?;
            Ok(Explained::Ray(Box::new(ray)))
        }
        (None, pixel) => {
            let [x, y] = pixel.unwrap_or_default();
            let [_, height] = job.camera.size();
            // A row outside the picture is not mirrored, so that the message shows the user's own number.
            let row = if flags.y_up && y < height { height - 1 - y } else { y };
            let pixel = explainer.pixel(x, row).map_err(|e| Failure::usage(format!("--pixel: {e}")))?;
            Ok(Explained::Pixel(Box::new(pixel)))
        }
    }
}
