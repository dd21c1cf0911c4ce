//! `canaletto measure`: the light at points, as a light meter reads it.

use crate::command_files::{CommandFiles, FolderFlag};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::flags::SourceFlags;
use crate::format::{count, duration, plural};
use crate::interrupt;
use crate::omissions::shortfalls;
use crate::output::{check_files, write_file};
use crate::points::read_points;
use crate::solutions::{GivenSolutionFlags, SolutionFlags, Solutions};
use crate::source::{Reader, build, on_threads};
use canaletto::glam::DVec3;
use canaletto::integrator::radiosity::{RadiosityMeter, RadiositySolution, SolutionFingerprint};
use canaletto::integrator::{Measurement, PathMeter, describe};
use canaletto::render::Observer;
use clap::Args;
use rayon::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Measures the light that arrives at points: irradiance and illuminance, with their standard errors.
///
/// Random paths from each point find what arrives, if the scene's integrator is "path" or with --integrator path.
/// Otherwise the light of the scene is solved by radiosity, with the settings of the scene if its integrator is
/// "radiosity", and rays from each point find that. Each line of the points' file holds a place and a direction, x y z
/// nx ny nz, as CSV or with blanks between them; # begins a comment. A header may name these columns in any order, and
/// others, which are ignored.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct MeasureFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Names the file of the points
    #[arg(long, value_name = "FILE", help_heading = "Points")]
    pub points: PathBuf,

    /// Sets the output's file; - is the standard output
    #[arg(short, long, value_name = "FILE", default_value = "-", help_heading = "Output")]
    pub output: PathBuf,
    #[command(flatten)]
    pub folder: FolderFlag,

    /// Sets how light is found [default: path if the scene's integrator is that, or else radiosity]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Sampling")]
    pub integrator: Option<Method>,

    #[command(flatten)]
    pub solution: GivenSolutionFlags,

    /// Sets the number of rays or paths from each point
    #[arg(long, value_name = "N", default_value_t = 1024,
        value_parser = clap::value_parser!(u32).range(16..=16_777_216), help_heading = "Sampling")]
    pub rays: u32,

    /// Sets the seed of the random numbers; the same seed gives the same answer
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Sampling")]
    pub seed: u64,

    /// Sets the frame [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Prints nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

/// How light is found.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// By radiosity, between matte surfaces
    Radiosity,
    /// By paths, off all surfaces
    Path,
}

const EXAMPLES: &str = "\
The output has the columns x y z nx ny nz, then the irradiance in red, green and
blue, the illuminance, and the standard errors of all four. The illuminance is the
luminance of the irradiance (Rec. 709): lux, if the lights are photometric.

Examples:
  printf '2.78 1 2.8  0 1 0\\n' > desk.csv
  canaletto measure scenes/cornell-box.kdl --points desk.csv -o desk-light.csv
  printf '2.78 1 2.8  0 1 0\\n' | canaletto measure scenes/cornell-box.kdl --points -
  canaletto measure scenes/cornell-box.kdl --points desk.csv --rays 16384
  canaletto measure scenes/cornell-box.kdl --points desk.csv --integrator path
  canaletto render scenes/cornell-box.kdl --save-solution cornell.rad
  canaletto measure scenes/cornell-box.kdl --points desk.csv --solution cornell.rad";

/// What measures.
enum Meter<'w> {
    Paths(Box<PathMeter<'w>>),
    Radiosity(Box<RadiosityMeter<'w>>),
}

/// The header of the output.
const HEADER: &str = "x,y,z,nx,ny,nz,irradiance_r,irradiance_g,irradiance_b,illuminance,\
                      error_r,error_g,error_b,illuminance_error\n";

/// The number of points between two looks at whether to stop.
const CHUNK: usize = 64;

/// Stops solving after a signal.
struct Signals;

impl Observer for Signals {
    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

/// Runs the command.
pub(crate) fn run(flags: &MeasureFlags) -> Result<Exit, Failure> {
    on_threads(flags.source.threads, || measure(flags))?
}

fn measure(flags: &MeasureFlags) -> Result<Exit, Failure> {
    let begun = Instant::now();
    let files = CommandFiles::default().reads("--points", [&flags.points]);
    let files = files.reads("--solution", &flags.solution.solution).writes("--output", [flags.output.clone()]);
    files.check()?;
    flags.folder.make_folders(&files)?;
    check_files([flags.output.clone()], &flags.output, false)?;
    let points = read_points(&flags.points)?;
    let mut reader = Reader::open(&flags.source, None, None)?;
    reader.use_no_camera();
    let source = reader.at_chosen(None, flags.frame)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, false);
    }
    files.check_scene(&reader)?;
    let integrator = describe(&source.scene.integrator);
    let method = flags.integrator.unwrap_or(if integrator.traces_paths() { Method::Path } else { Method::Radiosity });
    if method == Method::Path && flags.solution.solution.is_some() {
        return Err(Failure::usage("--solution is of radiosity; with --integrator path no solution is used"));
    }
    let paths = integrator.nearest_path();
    let settings = integrator.radiosity().copied().unwrap_or_default();
    let mut solutions = Solutions::new(&SolutionFlags::from(&flags.solution), false)?;
    let fingerprint = SolutionFingerprint::new(&source.scene, &settings);
    if method == Method::Radiosity {
        solutions.check(&fingerprint)?;
    }
    let (world, _) = build(&source.name, source.scene, &flags.source.build_options(0), None)?;
    let _measuring = interrupt::Rendering;
    interrupt::Rendering::begins();
    let solution: Arc<RadiositySolution>;
    let meter = match method {
        Method::Path => Meter::Paths(Box::new(PathMeter::new(&world, paths))),
        Method::Radiosity => {
            let solved = solutions.solution(&source.name, &world, &fingerprint, &settings, &Signals)?;
            let Some((solved, _)) = solved else { return Ok(Exit::Interrupted) };
            solution = solved;
            if !flags.quiet {
                print_diagnostics(&shortfalls(&source.name, &solution.warnings(&world, &settings)), false);
            }
            Meter::Radiosity(Box::new(RadiosityMeter::new(&world, &solution)))
        }
    };
    let mut text = String::from(HEADER);
    let mut done = 0;
    for chunk in points.chunks(CHUNK) {
        if interrupt::requested() {
            break;
        }
        let first = done;
        let measured: Vec<Measurement> = chunk
            .par_iter()
            .enumerate()
            .map(|(i, (point, normal))| {
                let place = (*point - world.origin(), *normal);
                let numbers = (flags.seed, (first + i) as u32);
                match &meter {
                    Meter::Paths(meter) => meter.measure(place, flags.rays, numbers),
                    Meter::Radiosity(meter) => meter.measure(place, flags.rays, numbers),
                }
            })
            .collect();
        for ((point, normal), measurement) in chunk.iter().zip(&measured) {
            push_line(&mut text, *point, *normal, measurement);
        }
        done += chunk.len();
    }
    write_file(&flags.output, text.as_bytes())?;
    if !flags.quiet {
        let place =
            if flags.output == Path::new("-") { String::new() } else { format!("{}: ", flags.output.display()) };
        let points = plural(done as u64, "point");
        let how = match &meter {
            Meter::Paths(_) => format!("{} paths each", flags.rays),
            Meter::Radiosity(meter) => {
                format!("{} rays each, {} patches", flags.rays, count(meter.patches() as u64))
            }
        };
        eprint_line(&format!("{place}{points}, {how}, {}", duration(begun.elapsed())));
    }
    if done < points.len() {
        eprint_line(&format!("stopped: {} of {} points were measured", done, points.len()));
        return Ok(Exit::Interrupted);
    }
    Ok(Exit::Done)
}

fn push_line(text: &mut String, point: DVec3, normal: DVec3, measurement: &Measurement) {
    let [place, facing] = [point, normal].map(|v| v.to_array());
    let [light, error] = [measurement.irradiance, measurement.standard_error].map(|v| v.to_array().map(|v| v as f32));
    let [lux, lux_error] = [measurement.illuminance(), measurement.illuminance_error()].map(|v| v as f32);
    let all = place.iter().chain(&facing).map(f64::to_string);
    let all = all.chain(light.iter().chain([&lux]).chain(&error).chain([&lux_error]).map(f32::to_string));
    let _ = writeln!(text, "{}", all.collect::<Vec<_>>().join(","));
}
