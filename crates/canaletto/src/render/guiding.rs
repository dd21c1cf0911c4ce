//! The training of path guiding: paths through the whole picture that tell where light comes from.

use super::pixel::PixelRenderer;
use crate::integrator::{Benefit, GuidingField, GuidingRecorder, PreparedPath, PreparedRayIntegrator};
use crate::job::{Job, Observer, SolvingPhase, SolvingProgress};
use crate::scene::{Guiding, PathSettings, SamplerKind};
use crate::world::World;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// The rounds of the training. Each has twice as many paths as the one before.
const ROUNDS: u32 = 4;

/// The paths of the training for each pixel, and the fewest and the most of all.
const PATHS_PER_PIXEL: u64 = 4;
const FEWEST_PATHS: u64 = 1 << 16;
const MOST_PATHS: u64 = 1 << 19;

/// The number of paths that one thread takes at once.
const CHUNK: u64 = 1024;

/// How rare the directions that bring light must be in the first round for the training to go on. The Cornell box has
/// 10, light through a gap 35, a lamp in glass 275.
const RARE: f64 = 100.0;

/// The second moment with guiding, over that without, up to which it is worth its time.
const WORTHWHILE: f64 = 0.9;

/// Prepares path tracing of a job, which learns where light comes from if the settings say so. Breaks if cancelled.
pub(crate) fn prepare_path(
    world: &World,
    job: &Job,
    settings: PathSettings,
    observer: &dyn Observer,
) -> ControlFlow<(), PreparedPath> {
    let mut prepared = PreparedPath::new(world, settings);
    if settings.guiding == Guiding::Off {
        return ControlFlow::Continue(prepared);
    }
    let [width, height] = job.camera.size().map(u64::from);
    let budget = (width * height * PATHS_PER_PIXEL).clamp(FEWEST_PATHS, MOST_PATHS);
    // The picture's samples are independent of those of the training.
    let mut own = job.clone();
    own.seed = job.seed ^ 0x6775_6964_6564_2121;
    own.film.sampler = SamplerKind::Independent;
    let pixels = PixelRenderer::new(&own);
    let stopped = AtomicBool::new(false);
    let mut begun = 0;
    for round in 0..ROUNDS {
        observer.solving(&SolvingProgress {
            phase: SolvingPhase::Guiding { round: round + 1, rounds: ROUNDS },
            patches: 0,
            links: 0,
        });
        let count = budget * (1 << round) / ((1 << ROUNDS) - 1);
        let cancelled = |_| stopped.load(Ordering::Relaxed) || observer.cancelled();
        let trained = &prepared;
        let chunk = |number: u64| {
            let mut tracer = trained.worker(world, &cancelled);
            let mut recorder = GuidingRecorder::new();
            let mut colors = Vec::new();
            for path in number * CHUNK..((number + 1) * CHUNK).min(count) {
                let pixel = path * width * height / count;
                let place = [(pixel % width) as u32, (pixel / width) as u32];
                pixels.block_with_probe(&mut tracer, place, [(begun + path) as u32, 1], &mut recorder, &mut colors);
            }
            recorder.into_records()
        };
        let records: Vec<_> = (0..count.div_ceil(CHUNK)).into_par_iter().map(chunk).flatten_iter().collect();
        begun += count;
        if stopped.load(Ordering::Relaxed) || observer.cancelled() {
            return ControlFlow::Break(());
        }
        let is_last = round + 1 == ROUNDS;
        let field = GuidingField::new(records, is_last);
        let Benefit { rarity, ratio } = field.benefit();
        prepared.set_guide(Some(field));
        let pays = match round {
            0 => rarity > RARE,
            _ => !is_last || ratio < WORTHWHILE,
        };
        if settings.guiding == Guiding::Auto && !pays {
            prepared.set_guide(None);
            break;
        }
    }
    ControlFlow::Continue(prepared)
}
