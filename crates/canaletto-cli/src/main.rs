//! The command `canaletto`: renders scenes, explains their pixels, compares pictures.
//!
//! [`command`] has a file for each subcommand. [`flags`] holds the shared flags, and [`settings`] defines their
//! meaning. Every error is a [`failure::Failure`], which `main` prints once.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod backdrop;
mod checkpoint;
mod command;
mod command_files;
mod complete;
mod denoiser;
mod digest;
mod doubts;
mod exit;
mod failure;
mod flags;
mod format;
mod frames;
mod guiding_file;
mod inputs;
mod instructions;
mod interrupt;
mod layers;
mod legend;
#[cfg(test)]
mod manual;
mod memory;
mod metering;
mod model;
mod noise_outlook;
mod omissions;
mod output;
mod output_format;
mod part;
mod partial;
mod passes;
mod picture_file;
mod points;
mod preview;
mod progress;
mod report;
mod resample;
mod sample_file;
mod sampling_progress;
mod settings;
mod solutions;
mod source;
mod stdout;
mod terminal;
mod told_developing;
mod watch;
mod watched;

use canaletto::memory::Guarded;
use clap::{CommandFactory, Parser, Subcommand};
use command::{
    bake, check, compare, compare_methods, completions, convert, denoise, explain, farm, form_factor, grade, info,
    ladder, man, measure, merge, prepare, render,
};
use exit::Exit;
use failure::Failure;
use std::io::Write;
use std::process::ExitCode;

#[global_allocator]
static MEMORY: Guarded = Guarded;

/// A ray tracer that explains every pixel.
#[derive(Parser, Debug)]
#[command(
    name = "canaletto",
    version,
    long_about = long_about(),
    arg_required_else_help = true,
    max_term_width = 110,
    after_help = EXAMPLES,
    after_long_help = format!("{EXAMPLES}\n\n{}", Exit::table())
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

fn long_about() -> String {
    format!(
        "A ray tracer that explains every pixel.\n\nCanaletto renders scene texts (.kdl) and models ({}) on the CPU. \
         Every machine computes the same picture. `canaletto explain` shows each term of a pixel's colour.",
        flags::model_extensions()
    )
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/still-life.kdl         # makes still-life.png in the current folder
  canaletto render scenes/models/spot.obj -o spot.exr   # adds a camera, lights and a ground to the model
  canaletto explain scenes/still-life.kdl --pixel 440,340   # why this pixel has this colour
  canaletto render scenes/still-life.kdl --samples 16 -o finer.exr
  canaletto compare still-life.png finer.exr --diff diff.png
  canaletto compare-methods scenes/zbuffer.kdl   # z-buffer and ray tracing, and why they differ
  canaletto ladder scenes/still-life.kdl         # a sheet of pictures, each with one term more
  canaletto grade scenes/still-life.kdl still-life.png   # what is missing or wrong in another program's picture
`canaletto help render` shows the whole help of a command.";

#[derive(Subcommand, Debug)]
enum Command {
    Render(Box<render::RenderFlags>),
    Explain(Box<explain::ExplainFlags>),
    FormFactor(form_factor::FormFactorFlags),
    Measure(measure::MeasureFlags),
    Bake(bake::BakeFlags),
    Convert(Box<convert::ConvertFlags>),
    Denoise(denoise::DenoiseFlags),
    Merge(merge::MergeFlags),
    Prepare(Box<prepare::PrepareFlags>),
    Farm(Box<farm::FarmFlags>),
    Info(info::InfoFlags),
    Compare(compare::CompareFlags),
    CompareMethods(Box<compare_methods::CompareMethodsFlags>),
    Ladder(Box<ladder::LadderFlags>),
    Grade(Box<grade::GradeFlags>),
    Check(check::CheckFlags),
    Completions(completions::CompletionsFlags),
    Man(man::ManFlags),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            // The output is the help, the version, or the error of a wrong command line.
            let printed = e.print().and_then(|()| std::io::stdout().flush());
            if !e.use_stderr()
                && let Err(failure) = output::check_stdout().and(printed.map_err(|e| Failure::stdout(&e)))
            {
                failure.print(false);
                return failure.exit().into();
            }
            return u8::try_from(e.exit_code()).map_or(Exit::Usage.into(), ExitCode::from);
        }
    };
    interrupt::install(cli.command.speaks_json());
    match run(&cli.command) {
        Ok(exit) => exit.into(),
        Err(failure) => {
            failure.print(cli.command.speaks_json());
            failure.exit().into()
        }
    }
}

fn run(command: &Command) -> Result<Exit, Failure> {
    instructions::choose()?;
    match command {
        Command::Render(flags) => render::run(flags),
        Command::Explain(flags) => explain::run(flags),
        Command::FormFactor(flags) => form_factor::run(flags),
        Command::Measure(flags) => measure::run(flags),
        Command::Bake(flags) => bake::run(flags),
        Command::Convert(flags) => convert::run(flags),
        Command::Denoise(flags) => denoise::run(flags),
        Command::Merge(flags) => merge::run(flags),
        Command::Prepare(flags) => prepare::run(flags),
        Command::Farm(flags) => farm::run(flags),
        Command::Info(flags) => info::run(flags),
        Command::Compare(flags) => compare::run(flags),
        Command::CompareMethods(flags) => compare_methods::run(flags),
        Command::Ladder(flags) => ladder::run(flags),
        Command::Grade(flags) => grade::run(flags),
        Command::Check(flags) => check::run(flags),
        Command::Completions(flags) => completions::run(flags, Cli::command()),
        Command::Man(flags) => man::run(flags, Cli::command()),
    }
}

impl Command {
    /// Whether messages on stderr are JSON.
    fn speaks_json(&self) -> bool {
        let progress = match self {
            Command::Render(flags) => flags.progress,
            Command::Prepare(flags) => flags.progress,
            Command::CompareMethods(flags) => flags.messages.progress,
            Command::Ladder(flags) => flags.messages.progress,
            Command::Grade(flags) => flags.messages.progress,
            Command::Bake(flags) => flags.progress,
            _ => return false,
        };
        progress == progress::ProgressFlag::Json
    }
}
