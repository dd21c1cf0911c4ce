//! Compares Canaletto with other installed ray tracers; see `docs/benchmarks.md`.
//!
//! `cargo run --release -p canaletto-bench --bin peers -- rays --mesh statue,field --threads 1,2`

use std::path::PathBuf;
use std::process::ExitCode;

use canaletto_bench::peers::embree::{Quality, Settings};
use canaletto_bench::peers::mesh::{RECIPES, Recipe};
use canaletto_bench::peers::rays::SETS;
use canaletto_bench::peers::stages::{self, Stage};
use canaletto_bench::peers::statistics::Clock;
use canaletto_bench::peers::{build, clouds, instances, load, pictures, recursion, trace};
use canaletto_bench::say;
use canaletto_bvh::{InstructionSet, Quality as Own};
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(about = "Canaletto beside other ray tracers, in turn, on the same rays and scenes")]
struct Arguments {
    #[command(subcommand)]
    what: What,
    /// Write all numbers to this file, too.
    #[arg(long, global = true, value_name = "FILE")]
    json: Option<PathBuf>,
    /// How many times each takes its turn.
    #[arg(long, global = true, default_value_t = 7, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
    /// Numbers of threads, one after the other.
    #[arg(long, global = true, value_delimiter = ',', default_value = "2")]
    threads: Vec<usize>,
    /// What to measure: the clock, or the time that the processor spent on us, which others on the machine disturb
    /// less.
    #[arg(long, global = true, value_enum, default_value = "wall")]
    clock: Clock,
    /// Size of the pictures, or of those that rays are for.
    #[arg(long, global = true, default_value = "1920x1080", value_parser = size)]
    size: [u32; 2],
}

#[derive(Subcommand)]
enum What {
    /// Rays through triangle meshes, ours and Embree's.
    Rays(Rays),
    /// Rays through a million spheres and a million cylinders, ours and Embree's; see `pictures` for Tachyon's.
    Clouds(Rays),
    /// Ten thousand copies of a mesh, as a list and nested, beside the mesh alone.
    Instances {
        /// The mesh, see `list`.
        #[arg(long, default_value = "statue", value_parser = recipe)]
        mesh: Recipe,
    },
    /// Hierarchies over triangle meshes, ours and Embree's.
    Build {
        /// Meshes, see `list`; all by default.
        #[arg(long, value_delimiter = ',', value_parser = recipe)]
        mesh: Vec<Recipe>,
    },
    /// Whole pictures by whole processes: ours, a plain recursion over Embree, POV-Ray, Tachyon, Mitsuba.
    Pictures {
        /// The scenes; all by default.
        #[arg(long = "scene", value_enum, value_delimiter = ',', default_value = "balls,serpent,shapes")]
        stages: Vec<Stage>,
        /// Let Tachyon render meshes, too, which takes minutes.
        #[arg(long)]
        slow: bool,
    },
    /// The chapter's scene of 230 × 230 beside starting a process and writing a PNG alone.
    Start,
    /// Files of ten million triangles: ours beside copying their bytes.
    Load {
        /// The formats.
        #[arg(long, value_delimiter = ',', default_value = "ply,obj", value_parser = ["ply", "obj"])]
        format: Vec<String>,
        /// The mesh has 400,000 times the square of this triangles.
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=20))]
        fineness: u32,
    },
    /// Renders one picture by a plain recursion over Embree's single rays.
    #[command(hide = true)]
    Recursion {
        scene: PathBuf,
        #[arg(short, value_name = "FILE")]
        o: PathBuf,
    },
    /// The meshes and ray sets there are.
    List,
}

#[derive(clap::Args)]
struct Rays {
    /// Meshes, see `list`; all by default.
    #[arg(long, value_delimiter = ',', value_parser = recipe)]
    mesh: Vec<Recipe>,
    /// Ray sets, see `list`; all by default.
    #[arg(long = "set", value_delimiter = ',', value_parser = SETS.map(|set| set.0))]
    sets: Vec<String>,
    /// How well Embree builds.
    #[arg(long, value_enum, default_value = "high")]
    quality: Quality,
    /// Build our side's trees with more work, too.
    #[arg(long)]
    high: bool,
    /// Embree's watertight mode.
    #[arg(long)]
    robust: bool,
    /// Embree's mode for less memory.
    #[arg(long)]
    compact: bool,
    /// The instructions that both sides may use at most, as if the machine had no others.
    #[arg(long, value_enum)]
    instructions: Option<Instructions>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Instructions {
    Baseline,
    Avx2,
    Avx512,
}

impl Instructions {
    /// Limits Canaletto and Embree to these instructions.
    fn limit(self) -> Result<(), String> {
        let set = match self {
            Self::Baseline => InstructionSet::Baseline,
            Self::Avx2 => InstructionSet::Avx2,
            Self::Avx512 => InstructionSet::Avx512,
        };
        if !InstructionSet::available().contains(&set) {
            return Err(format!("this machine has no {set:?}"));
        }
        set.limit();
        Ok(())
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed.filter(|size: &[u32; 2]| size.iter().all(|&n| (1..=16_384).contains(&n))).ok_or("expected WxH".into())
}

fn recipe(name: &str) -> Result<Recipe, String> {
    let names = RECIPES.map(|r| r.name).join(", ");
    RECIPES.into_iter().find(|r| r.name == name).ok_or(format!("there are {names}"))
}

/// The named meshes, or all meshes if none is named.
fn meshes(named: Vec<Recipe>) -> Vec<Recipe> {
    if named.is_empty() { RECIPES.to_vec() } else { named }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    say::run(|| run(arguments))
}

fn run(arguments: Arguments) -> Result<(), String> {
    let Arguments { what, json, rounds, threads, clock, size } = arguments;
    if threads.contains(&0) {
        return Err("--threads takes numbers above 0".into());
    }
    let rounds = usize::from(rounds);
    let of_rays = |Rays { mesh, sets, quality, high, robust, compact, instructions }, threads| {
        instructions.map_or(Ok(()), Instructions::limit)?;
        Ok::<_, String>(trace::Options {
            meshes: meshes(mesh),
            sets,
            threads,
            clock,
            size,
            rounds,
            settings: Settings { quality, robust, compact },
            own: if high { Own::High } else { Own::Medium },
        })
    };
    let report = match what {
        What::Rays(rays) => trace::run(&of_rays(rays, threads)?)?,
        What::Instances { mesh } => {
            let settings = Settings { quality: Quality::High, robust: false, compact: false };
            let (meshes, sets) = (vec![mesh], Vec::new());
            instances::run(&trace::Options { meshes, sets, threads, clock, size, rounds, settings, own: Own::Medium })?
        }
        What::Clouds(rays) => clouds::run(&of_rays(rays, threads)?)?,
        What::Build { mesh } => build::run(&build::Options { meshes: meshes(mesh), threads, clock, rounds })?,
        What::Pictures { stages, slow } => {
            pictures::run(&pictures::Options { stages, threads, clock, size, rounds, slow })?
        }
        What::Start => pictures::start(&threads, rounds, clock)?,
        What::Load { format, fineness } => load::run(fineness, &format, &threads, rounds, clock)?,
        What::Recursion { scene, o } => {
            let [build, trace] = recursion::render(&stages::load(&scene)?, size, threads[0], &o)?;
            say!("built in {build:.3} s, traced in {trace:.3} s");
            return Ok(());
        }
        What::List => {
            RECIPES.iter().for_each(|recipe| say!("{:12} {}", recipe.name, recipe.about));
            say!();
            SETS.iter().for_each(|(name, about)| say!("{name:12} {about}"));
            return Ok(());
        }
    };
    if let Some(path) = json {
        std::fs::write(&path, format!("{report:#}\n")).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}
