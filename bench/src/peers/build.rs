//! Measures the building of hierarchies over meshes: seconds, memory kept and peak memory.

use canaletto_bvh::Quality as Own;
use serde_json::{Value, json};

use super::embree::{Embree, Part, Quality, Settings};
use super::mesh::{Mesh, Recipe};
use super::ours::Ours;
use super::statistics::{Clock, Times};
use crate::say;

/// The options of the comparison.
pub struct Options {
    /// The meshes.
    pub meshes: Vec<Recipe>,
    /// The numbers of threads.
    pub threads: Vec<usize>,
    /// The clock for the times.
    pub clock: Clock,
    /// The number of rounds.
    pub rounds: usize,
}

/// One contestant: its name, seconds per round, bytes that a build keeps and its peak memory.
#[derive(Default)]
struct Builder {
    name: &'static str,
    times: Times,
    bytes: usize,
    peak: usize,
}

impl Builder {
    /// Runs one round. The result is dropped outside the measured time; `bytes` returns its size.
    fn turn<T>(
        &mut self,
        clock: Clock,
        warm_up: bool,
        build: impl FnOnce() -> Result<T, String>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Result<(), String> {
        let before = resident_peak(true);
        let mut built = None;
        let seconds = clock.time(|| built = Some(build()));
        let peak = resident_peak(false).saturating_sub(before);
        let Some(built) = built else { return Ok(()) };
        self.bytes = bytes(&built?);
        if warm_up {
            // Later rounds may reuse pages that the allocator kept.
            self.peak = peak;
        } else {
            self.times.0.push(seconds);
        }
        Ok(())
    }
}

/// The peak resident bytes of the process since the last call with `reset`; only on Linux, else 0.
pub(super) fn resident_peak(reset: bool) -> usize {
    if reset {
        // Where this isn't allowed, peaks are those of the whole run.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
    }
    status("VmHWM:")
}

/// The resident bytes of the process; only on Linux, else 0.
pub(super) fn resident() -> usize {
    status("VmRSS:")
}

fn status(field: &str) -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(field));
    line.and_then(|line| line.split_whitespace().next()?.parse::<usize>().ok()).unwrap_or(0) * 1024
}

/// Compares, prints, and returns everything as JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    say!("{} interleaved rounds, medians; ratio: their time / ours [least, greatest of a round]", options.rounds);
    say!("kept: what Embree says that it allocated, what ours takes for tracing; peak: growth of the process\n");
    say!("{:10} {:>2} {:>14} {:>9} {:>9} {:>9}   ratio", "mesh", "th", "builder", "s", "kept MiB", "peak MiB");
    let mut rows = Vec::new();
    for recipe in &options.meshes {
        let mesh = recipe.make();
        for &threads in &options.threads {
            rows.extend(compare(&mesh, threads, options)?);
        }
    }
    Ok(json!({ "what": "build", "rounds": options.rounds, "clock": format!("{:?}", options.clock), "rows": rows }))
}

fn compare(mesh: &Mesh, threads: usize, options: &Options) -> Result<Vec<Value>, String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
    let embree = Embree::new(threads).map_err(|message| say!("{message}")).ok();
    let parts = [Part::triangles(&mesh.positions, &mesh.triangles)];
    let peers = [("Embree medium", Quality::Medium), ("Embree high", Quality::High)];
    let mut builders: Vec<Builder> = ["ours", "ours high"].map(|name| Builder { name, ..Builder::default() }).into();
    if embree.is_some() {
        builders.extend(peers.map(|(name, _)| Builder { name, ..Builder::default() }));
    }
    for round in 0..=options.rounds {
        for builder in &mut builders {
            let quality = peers.iter().find(|peer| peer.0 == builder.name).map(|peer| peer.1);
            match (quality, &embree) {
                (Some(quality), Some(embree)) => builder.turn(
                    options.clock,
                    round == 0,
                    || {
                        let settings = Settings { quality, robust: false, compact: false };
                        embree.build(&parts, settings)
                    },
                    |scene| scene.bytes,
                )?,
                _ => {
                    let own = if builder.name == "ours" { Own::Medium } else { Own::High };
                    builder.turn(options.clock, round == 0, || pool.install(|| Ours::build(mesh, own)), Ours::bytes)?;
                }
            }
        }
    }
    let visits = |quality| pool.install(|| Ours::build(mesh, quality)).map(|ours| ours.expected_visits());
    let visits = [visits(Own::Medium)?, visits(Own::High)?];
    let [medium, high] = visits;
    let expected = |name: &str| ["ours", "ours high"].iter().position(|&n| n == name).map(|i| visits[i]);
    say!("{}: a random ray is expected to visit {medium:.2}, high {high:.2} of our nodes and primitives", mesh.name);
    let mebi = |bytes: usize| bytes as f64 / f64::from(1 << 20);
    let mut rows = Vec::new();
    for builder in &builders {
        let ratio = builders[0].times.faster_than(&builder.times);
        say!(
            "{:10} {threads:2} {:>14} {:9.4} {:9.1} {:9.1}   {ratio}",
            mesh.name,
            builder.name,
            builder.times.median(),
            mebi(builder.bytes),
            mebi(builder.peak)
        );
        rows.push(json!({ "mesh": mesh.name, "triangles": mesh.triangles.len(), "threads": threads,
            "builder": builder.name, "seconds": builder.times.0, "bytes": builder.bytes, "peak": builder.peak,
            "ratio": ratio.median, "ratio_min": ratio.min, "ratio_max": ratio.max,
            "expected_visits": expected(builder.name) }));
    }
    say!();
    Ok(rows)
}
