//! `canaletto explain`: the tree of rays behind a pixel, or the first difference of two.

mod data_url;
mod difference;
mod subject;

use crate::command_files::FolderFlag;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags::{PictureFlags, SourceFlags, pixel};
use crate::format::{JSON_VERSION, count};
use crate::output::write_file;
use crate::solutions::GivenSolutionFlags;
use crate::source::on_threads;
use crate::stdout::{print, print_json};
use canaletto::explain::TextStyle;
use canaletto::math::Rgb;
use clap::Args;
use difference::explain_difference;
use serde::Serialize;
use std::path::{Path, PathBuf};
use subject::{Explained, Subject};

/// Explains a pixel: the tree of rays behind it, with every term of the shading equation as a number.
///
/// The sum of the terms is the pixel's colour in linear light, bit for bit as in an EXR.
///
/// With --diff or another flag of this name it prints the first term that differs between two explanations, A and B,
/// with both values and what leads to them. All other flags count for both.
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

    /// Explains the path of this sample of a path-traced pixel, from 1 [default: the one nearest to the pixel's colour]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Pixel", conflicts_with_all = ["ray", "brightest"])]
    pub sample: Option<u32>,

    /// Explains the path that adds most to a path-traced pixel: the one behind a firefly
    #[arg(long, help_heading = "Pixel", conflicts_with = "ray")]
    pub brightest: bool,

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

    /// Compares with the same pixel of another scene
    #[arg(long, value_name = "SCENE", help_heading = "Difference", conflicts_with_all = DRAWN)]
    pub diff: Option<PathBuf>,

    /// Compares with the scene in which one value is changed, as by --set; may be repeated
    #[arg(long, value_name = "KEY=VALUE", help_heading = "Difference", conflicts_with_all = DRAWN)]
    pub diff_set: Vec<String>,

    /// Compares with another pixel. What follows from its ray alone, such as points and normals, isn't a difference
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "X,Y",
        value_parser = pixel,
        help_heading = "Difference",
        conflicts_with = "ray",
        conflicts_with_all = DRAWN
    )]
    pub diff_pixel: Option<[u32; 2]>,

    /// Compares with the picture of another seed
    #[arg(long, value_name = "N", help_heading = "Difference", conflicts_with_all = DRAWN)]
    pub diff_seed: Option<u64>,

    /// Compares with another frame
    #[arg(long, value_name = "N", help_heading = "Difference", conflicts_with_all = DRAWN)]
    pub diff_frame: Option<u32>,

    /// Prints rays down to this level; camera rays have level 1 [default: as many levels as fit into 100 lines]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Messages")]
    pub levels: Option<u32>,

    /// Prints everything: all samples, all points of lights, all rays, and numbers that read back exactly
    #[arg(long, help_heading = "Messages")]
    pub full: bool,

    /// Prints numbers with this many significant digits [default: 6; those that read back exactly with --full]. Numbers
    /// that are equal with these digits are no difference
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=17), help_heading = "Messages")]
    pub digits: Option<u8>,

    /// Adds the numbers on the chapter's way: the camera's axes, each object that the ray is tried against, the
    /// equation of the intersection, the vectors of reflection and refraction, the factors of light
    #[arg(long, help_heading = "Messages")]
    pub steps: bool,

    /// Draws the tree of rays too, as in fig. 5.29: surfaces with their colours, rays with their factors, and the rays
    /// in the scene from outside. - prints the drawing alone
    #[arg(long, value_name = "FILE.svg", help_heading = "Messages")]
    pub svg: Option<PathBuf>,

    /// Writes a page too, for a browser: the drawing, the way from light to the file, and the terms as tables that
    /// fold. It needs no other file. - prints the page alone
    #[arg(long, value_name = "FILE.html", help_heading = "Messages")]
    pub html: Option<PathBuf>,

    #[command(flatten)]
    pub folder: FolderFlag,

    /// Prints JSON, with the sum of all terms as `sum`
    #[arg(long, help_heading = "Messages")]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto explain scenes/chapter/fig-5.23b-shadow.kdl --pixel 115,80
  canaletto explain scenes/chapter/fig-5.23b-shadow.kdl --pixel 115,149 --y-up
  canaletto explain scenes/chapter/fig-5.23b-shadow.kdl --pixel 115,80 --steps --digits 4
  canaletto explain scenes/chapter/fig-5.23b-shadow.kdl --ray 100,40,40,-1,-0.2,-0.4
  canaletto explain scenes/chapter/fig-5.27b-glass.kdl --pixel 110,75 --svg tree.svg --html tree.html
  canaletto explain scenes/chapter/fig-5.27b-glass.kdl --pixel 110,75 --json | jq .sum
  canaletto explain scenes/chapter/fig-5.26b-mirror.kdl -p 120,40 --diff scenes/chapter/fig-5.23b-shadow.kdl
  canaletto explain scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --diff-set material.glass.eta=1.5
  canaletto explain scenes/chapter/fig-5.23b-shadow.kdl --pixel 115,80 --diff-pixel 60,120
  canaletto explain scenes/path.kdl --samples 64 --pixel 120,230 --brightest --svg path.svg";

impl ExplainFlags {
    /// Whether two explanations are compared.
    fn is_difference(&self) -> bool {
        self.diff_pixel.is_some() || self.has_other_job()
    }

    /// Whether the explanations are of two scenes, or of two pictures of one.
    fn has_other_job(&self) -> bool {
        self.diff.is_some() || !self.diff_set.is_empty() || self.diff_seed.is_some() || self.diff_frame.is_some()
    }
}

/// The flags that show one tree.
const DRAWN: [&str; 5] = ["levels", "full", "steps", "svg", "html"];

/// A tree of rays with the sum of its terms.
#[derive(Serialize)]
struct WithSum<'a> {
    version: u32,
    #[serde(flatten)]
    tree: &'a Explained,
    sum: Rgb,
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
    on_threads(flags.source.threads, || if flags.is_difference() { explain_difference(flags) } else { explain(flags) })?
}

fn explain(flags: &ExplainFlags) -> Result<Exit, Failure> {
    let subject = Subject::open(flags)?;
    let tree = subject.explained(flags.pixel, "--pixel", flags.steps)?;
    let mut style = if flags.full { TextStyle::FULL } else { TextStyle::SHORT };
    style.levels = flags.levels;
    style.digits = flags.digits.or(style.digits);
    let is_stdout = |file: &Option<PathBuf>| file.as_deref() == Some(Path::new("-"));
    if is_stdout(&flags.svg) && is_stdout(&flags.html) {
        return Err(Failure::usage("--svg - and --html - can't both have the standard output"));
    }
    if flags.svg.is_some() || flags.html.is_some() {
        let outside = subject.outside(&tree)?;
        let written = [
            flags.svg.as_ref().map(|file| (file, tree.svg(flags.levels, outside.given()))),
            flags.html.as_ref().map(|file| (file, tree.html(&subject.name, style, outside.given()))),
        ];
        for (file, text) in written.iter().flatten() {
            write_file(file, text.as_bytes())?;
        }
        if is_stdout(&flags.svg) || is_stdout(&flags.html) {
            return Ok(Exit::Done);
        }
    }
    if flags.json {
        print_json(&WithSum { version: JSON_VERSION, sum: tree.sum(), tree: &tree })?;
    } else {
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
