//! Traces rays through meshes with Canaletto and Embree in interleaved rounds, and compares their hits.

use rayon::prelude::*;
use serde_json::{Value, json};

use super::embree::{Eights, Embree, Part, Scene, Settings, Single, Sixteens};
use super::mesh::{Mesh, Recipe};
use super::ours::Ours;
use super::rays::{self, RaySet, Run, Segment};
use super::statistics::{Clock, Times};
use crate::say;

/// The results, one value per ray. `id` is `u32::MAX` for a ray that hits nothing.
pub struct Hits<'a> {
    /// The rays' parameters.
    pub t: &'a mut [f32],
    /// The barycentric weights of the second corners.
    pub u: &'a mut [f32],
    /// The barycentric weights of the third corners.
    pub v: &'a mut [f32],
    /// The triangles.
    pub id: &'a mut [u32],
}

/// An implementation that traces a run of rays on the current thread.
pub trait Tracer: Sync {
    /// Finds the closest hits.
    fn closest(&self, run: Run<'_>, out: &mut Hits<'_>);
    /// Finds out for each ray whether it hits anything: 1, else 0.
    fn any(&self, run: Run<'_>, out: &mut [u8]);
}

/// The options of the comparison.
pub struct Options {
    /// The meshes.
    pub meshes: Vec<Recipe>,
    /// The names of ray sets; all if empty.
    pub sets: Vec<String>,
    /// The numbers of threads.
    pub threads: Vec<usize>,
    /// The clock for the times.
    pub clock: Clock,
    /// The size of the pictures that the rays are for.
    pub size: [u32; 2],
    /// The number of rounds.
    pub rounds: usize,
    /// Embree's build settings.
    pub settings: Settings,
    /// Canaletto's build quality.
    pub own: canaletto_bvh::Quality,
}

/// The number of rays in a thread's work item; a multiple of sixteen.
const CHUNK: usize = 4096;

/// All results of a set.
#[derive(Clone, Debug, Default)]
struct Results {
    t: Vec<f32>,
    u: Vec<f32>,
    v: Vec<f32>,
    id: Vec<u32>,
    any: Vec<u8>,
}

impl Results {
    fn for_rays(set: &RaySet) -> Self {
        let n = set.rays.len();
        if set.any {
            return Self { any: vec![0; n], ..Self::default() };
        }
        Self { t: vec![0.0; n], u: vec![0.0; n], v: vec![0.0; n], id: vec![0; n], any: Vec::new() }
    }

    /// Traces the whole set on the current thread pool.
    fn trace(&mut self, tracer: &dyn Tracer, set: &RaySet) {
        let runs = set.runs(CHUNK);
        if set.any {
            self.any.par_chunks_mut(CHUNK).zip(runs).for_each(|(out, run)| tracer.any(run, out));
            return;
        }
        let Self { t, u, v, id, .. } = self;
        (t.par_chunks_mut(CHUNK), u.par_chunks_mut(CHUNK), v.par_chunks_mut(CHUNK), id.par_chunks_mut(CHUNK))
            .into_par_iter()
            .zip(runs)
            .for_each(|((t, u, v, id), run)| tracer.closest(run, &mut Hits { t, u, v, id }));
    }
}

/// The numbers of rays whose results differ, by kind.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    /// Only Canaletto has a hit.
    ours_only: usize,
    /// Only the peer has a hit.
    theirs_only: usize,
    /// The hits are other triangles at other distances.
    other: usize,
    /// The hits are other triangles at about equal distances: at edges, and at surfaces in contact.
    ties: usize,
    /// The hits are on one triangle at different distances.
    distance: usize,
}

impl Differences {
    fn between(ours: &Results, theirs: &Results, extent: f32) -> Self {
        let mut d = Self::default();
        for (&a, &b) in ours.any.iter().zip(&theirs.any) {
            d.ours_only += usize::from(a > b);
            d.theirs_only += usize::from(b > a);
        }
        for i in 0..ours.id.len() {
            let near = (ours.t[i] - theirs.t[i]).abs() <= 1e-4 * ours.t[i] + 1e-5 * extent;
            match (ours.id[i], theirs.id[i]) {
                (a, b) if a == b => d.distance += usize::from(a != u32::MAX && !near),
                (_, u32::MAX) => d.ours_only += 1,
                (u32::MAX, _) => d.theirs_only += 1,
                _ if near => d.ties += 1,
                _ => d.other += 1,
            }
        }
        d
    }

    fn json(&self) -> Value {
        json!({ "ours_only": self.ours_only, "theirs_only": self.theirs_only, "other": self.other, "ties": self.ties,
            "distance": self.distance })
    }
}

/// Canaletto's closest hits, for making rays.
pub(super) fn hits(ours: &dyn Tracer, rays: &[Segment]) -> Vec<Option<(u32, f32)>> {
    let set = RaySet::new("", false, false, rays.to_vec());
    let mut results = Results::for_rays(&set);
    results.trace(ours, &set);
    results.id.iter().zip(results.t).map(|(&id, t)| (id != u32::MAX).then_some((id, t))).collect()
}

pub(super) fn pool(threads: usize) -> Result<rayon::ThreadPool, String> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())
}

/// Compares, prints, and returns everything as JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    let embree = introduce(options);
    let mut rows = Vec::new();
    for recipe in &options.meshes {
        let mesh = recipe.make();
        rows.extend(compare(&mesh, embree.as_ref(), options)?);
    }
    Ok(json!({ "what": "rays", "embree": embree.map(|e| e.version()), "size": options.size, "rounds": options.rounds,
        "clock": format!("{:?}", options.clock), "rows": rows }))
}

/// Starts Embree, if it is installed, and prints the meaning of the columns.
pub(super) fn introduce(options: &Options) -> Option<Embree> {
    let most = options.threads.iter().copied().max().unwrap_or(1);
    let embree = match Embree::new(most) {
        Ok(embree) => {
            let Settings { quality, robust, compact } = options.settings;
            say!(
                "Embree {}, {quality:?} quality{}{}",
                embree.version(),
                if robust { ", robust" } else { ", fast (not robust)" },
                if compact { ", compact" } else { "" }
            );
            Some(embree)
        }
        Err(message) => {
            say!("{message}; our side runs alone");
            None
        }
    };
    let [width, height] = options.size;
    say!("rays of pictures of {width} × {height}; {} interleaved rounds; Mrays/s of medians", options.rounds);
    say!("ratios: ours / theirs, of medians [least, greatest of a round]; above 1 we are faster");
    say!("hits that differ: only ours + only theirs + other primitive + same one elsewhere (ties apart)\n");
    embree
}

fn compare(mesh: &Mesh, embree: Option<&Embree>, options: &Options) -> Result<Vec<Value>, String> {
    let most = options.threads.iter().copied().max().unwrap_or(1);
    let everyone = pool(most)?;
    let ours = everyone.install(|| Ours::build(mesh, options.own))?;
    let parts = [Part::triangles(&mesh.positions, &mesh.triangles)];
    let scene = embree.map(|embree| embree.build(&parts, options.settings)).transpose()?;
    let wanted = |name: &str| options.sets.is_empty() || options.sets.iter().any(|s| s == name);
    let normal = |triangle, _| mesh.normal(triangle);
    let sets = everyone.install(|| rays::make(&mesh.view(), options.size, wanted, normal, |rays| hits(&ours, rays)));
    say!("{}: {} triangles", mesh.name, mesh.triangles.len());
    rounds(mesh.name, mesh.extent(), &sets, &ours, scene.as_ref(), options.into())
}

/// The settings of interleaved rounds.
#[derive(Clone, Copy)]
pub(super) struct Turns<'a> {
    pub(super) threads: &'a [usize],
    pub(super) rounds: usize,
    pub(super) clock: Clock,
}

impl<'a> From<&'a Options> for Turns<'a> {
    fn from(options: &'a Options) -> Self {
        Self { threads: &options.threads, rounds: options.rounds, clock: options.clock }
    }
}

/// Traces all sets on a scene of this name and extent. Prints a line for each set and number of threads.
pub(super) fn rounds(
    name: &str,
    extent: f32,
    sets: &[RaySet],
    ours: &dyn Tracer,
    scene: Option<&Scene<'_>>,
    turns: Turns<'_>,
) -> Result<Vec<Value>, String> {
    let (singles, eights, sixteens) = (scene.map(Single), scene.map(Eights), scene.map(Sixteens));
    let mut peers: Vec<(&str, &dyn Tracer)> = Vec::new();
    if let (Some(singles), Some(eights), Some(sixteens)) = (&singles, &eights, &sixteens) {
        peers.extend([("1", singles as &dyn Tracer), ("8", eights), ("16", sixteens)]);
    }
    say!(
        "{:11} {:>2} {:>5} | {:>7} {:>7} {:>7} {:>7} | {:>17} {:>17} {:>17} | hits that differ",
        "rays",
        "th",
        "Mrays",
        "ours",
        "e1",
        "e8",
        "e16",
        "ours/e1",
        "ours/e8",
        "ours/e16"
    );
    let mut rows = Vec::new();
    for set in sets {
        for &threads in turns.threads {
            let pool = pool(threads)?;
            rows.push(pool.install(|| row(name, extent, set, threads, ours, &peers, turns)));
        }
    }
    say!();
    Ok(rows)
}

fn row(
    name: &str,
    extent: f32,
    set: &RaySet,
    threads: usize,
    ours: &dyn Tracer,
    peers: &[(&str, &dyn Tracer)],
    turns: Turns<'_>,
) -> Value {
    let mut contestants: Vec<&dyn Tracer> = vec![ours];
    contestants.extend(peers.iter().map(|peer| peer.1));
    let mut results: Vec<Results> = contestants.iter().map(|_| Results::for_rays(set)).collect();
    let mut times = vec![Times::default(); contestants.len()];
    // The first round warms up and provides the hits for the comparison.
    for round in 0..=turns.rounds {
        for (i, &tracer) in contestants.iter().enumerate() {
            let seconds = turns.clock.time(|| results[i].trace(tracer, set));
            if round > 0 {
                times[i].0.push(seconds);
            }
        }
    }
    let rate = |i: usize| times.get(i).map_or(f64::NAN, |t| set.rays.len() as f64 / t.median() / 1e6);
    let ratios: Vec<_> = times[1..].iter().map(|theirs| times[0].faster_than(theirs)).collect();
    let differences: Vec<_> = results[1..].iter().map(|r| Differences::between(&results[0], r, extent)).collect();
    let hit = results[0].id.iter().filter(|&&id| id != u32::MAX).count()
        + results[0].any.iter().filter(|&&any| any != 0).count();
    let mut line = format!("{:11} {threads:2} {:5.2} |", set.name, set.rays.len() as f64 / 1e6);
    for i in 0..4 {
        line += &if i < times.len() { format!(" {:7.2}", rate(i)) } else { format!(" {:>7}", "-") };
    }
    line += " |";
    for i in 0..3 {
        line += &format!(" {:>17}", ratios.get(i).map_or("-".into(), ToString::to_string));
    }
    line += " |";
    for d in &differences {
        line += &format!(" {}+{}+{}+{} ({})", d.ours_only, d.theirs_only, d.other, d.distance, d.ties);
    }
    say!("{line}");
    let theirs = |(i, (name, _)): (usize, &(&str, &dyn Tracer))| {
        json!({ "name": format!("rtc{name}"), "mrays": rate(i + 1), "seconds": times[i + 1].0,
            "ratio": ratios[i].median, "ratio_min": ratios[i].min, "ratio_max": ratios[i].max,
            "different": differences[i].json() })
    };
    json!({ "scene": name, "rays": set.name, "threads": threads,
        "count": set.rays.len(), "hit": hit, "mrays": rate(0), "seconds": times[0].0,
        "peers": peers.iter().enumerate().map(theirs).collect::<Vec<_>>() })
}
