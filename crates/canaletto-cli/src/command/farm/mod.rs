//! `canaletto farm`: a job for an engine that runs many machines, as a file that people read and change.

mod make;
mod openjd;
mod parallel;
mod plan;
mod shell;
mod slurm;
mod words;

use super::render::RenderFlags;
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line};
use crate::output::{check_files, write_files};
use clap::{Args, ValueEnum};
use plan::FarmPlan;
use std::path::PathBuf;

/// Writes a job that renders a picture or frames in parts on many machines, for an engine that you have.
///
/// The job is one readable file, which you may change. Each part is a `canaletto render` of its own, which keeps
/// checkpoints and is taken up where it ended. The parts are merged to the bytes of one render. All that `render` takes
/// may be given.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct FarmFlags {
    /// The engine
    #[arg(value_name = "ENGINE")]
    pub engine: Engine,

    /// Sets the number of parts [default: 8; of frames one for each, at most 1000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000),
        help_heading = "Farm")]
    pub parts: Option<u32>,

    /// Sets the file of the job, or its folder for openjd [default: the picture's name with the engine's, here]
    #[arg(long, value_name = "PATH", help_heading = "Farm")]
    pub job: Option<PathBuf>,

    #[command(flatten)]
    pub render: RenderFlags,
}

/// An engine that runs jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Engine {
    /// Slurm: a script that submits an array of parts, and the merge after them
    Slurm,
    /// Open Job Description, as AWS Deadline Cloud runs it: a template with parameters
    Openjd,
    /// GNU parallel: a script for this machine, or some by ssh
    Parallel,
    /// make: a makefile for this machine, or some by ssh
    Make,
}

const EXAMPLES: &str = "\
Examples:
  canaletto farm slurm scenes/path.kdl --samples 1024 -o room.png --parts 16
  canaletto farm parallel scenes/chapter/bouncing-ball.kdl --frames all -o ball.gif
  canaletto farm make scenes/path.kdl --samples 256 --split tiles -o room.exr --denoise
  canaletto farm openjd scenes/path.kdl --samples 1024 -o room.png --parts 16";

/// A file of a job.
struct JobFile {
    path: PathBuf,
    content: Vec<u8>,
}

/// Runs the command.
pub(crate) fn run(flags: &FarmFlags) -> Result<Exit, Failure> {
    let plan = FarmPlan::new(flags)?;
    let path = flags.job.clone().unwrap_or_else(|| plan.default_job(flags.engine));
    let files = match flags.engine {
        Engine::Slurm => vec![JobFile { content: slurm::script(&plan, &path)?, path: path.clone() }],
        Engine::Parallel => vec![JobFile { content: parallel::script(&plan, &path)?, path: path.clone() }],
        Engine::Make => vec![JobFile { content: make::makefile(&plan, &path)?, path: path.clone() }],
        Engine::Openjd => openjd::bundle(&plan, &path)?,
    };
    let no_clobber = flags.render.output.no_clobber;
    if flags.engine == Engine::Openjd
        && let Err(error) = std::fs::create_dir(&path)
        && !path.is_dir()
    {
        let why = crate::failure::reason(&error);
        return Err(Failure::new(Exit::Failed, format!("--job {}: can't make the folder: {why}", path.display())));
    }
    let paths: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
    plan.check_job_files(&paths)?;
    check_files(paths.clone(), &paths[0], no_clobber)?;
    write_files(&paths, &files.into_iter().map(|file| file.content).collect::<Vec<_>>(), no_clobber)?;
    if !flags.render.quiet {
        eprint_line(&format!("{}: {}", path.display(), plan.summary()));
        eprint_line(&format!("  {}", plan.how_to_run(flags.engine, &path)));
    }
    Ok(Exit::Done)
}
