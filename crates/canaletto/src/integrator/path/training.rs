//! The training of path guiding: paths through the whole picture that tell where light comes from.

use super::{GuidingField, GuidingRecord, GuidingRecorder, PathTracer, PreparedPath};
use crate::integrator::camera_rays::PixelRenderer;
use crate::integrator::task_queue::TaskQueue;
use crate::integrator::{Preparation, PreparedRayIntegrator};
use crate::job::{Job, Observer, PlacedJob, SolvingPhase, SolvingProgress};
use crate::scene::{Guiding, PathSettings, SamplerKind};
use std::ops::ControlFlow;
use std::sync::Arc;

/// The rounds of the training. Each has twice as many paths as the one before.
const ROUNDS: u32 = 4;

/// The paths of the training for each pixel, and the fewest and the most of all.
const PATHS_PER_PIXEL: u64 = 4;
const FEWEST_PATHS: u64 = 1 << 16;
const MOST_PATHS: u64 = 1 << 19;

/// The number of paths that one thread takes at once.
const CHUNK: u64 = 256;

/// The most paths that tell whether the training begins. Pictures above 23 × 23 pixels have that many, so that
/// their size decides nothing.
const FIRST_PATHS: u64 = 2048;

/// How rare the directions that bring light must be for the training to begin. The Cornell box has 1, a room with a
/// glass ball 7, a lamp behind a screen 31 and a lamp in glass 220.
const RARE: f64 = 20.0;

/// The noise of directions with guiding, over that without, up to which the training goes on after a round.
const PROMISING: f64 = 0.98;

/// That ratio after the last round, up to which guiding is worth its time. Of a picture's variance half or less is left
/// then, as a path has many directions.
const WORTHWHILE: f64 = 0.9;

/// The number of paths in the training of a job's guiding.
fn training_paths(job: &Job) -> u64 {
    let [width, height] = job.camera.size().map(u64::from);
    (width * height * PATHS_PER_PIXEL).clamp(FEWEST_PATHS, MOST_PATHS)
}

/// The number of paths in this round.
fn paths_of_round(budget: u64, round: u32) -> u64 {
    budget * (1 << round) / ((1 << ROUNDS) - 1)
}

/// The number of paths in the last round of the training, which takes the most memory.
fn last_round(job: &Job) -> u64 {
    paths_of_round(training_paths(job), ROUNDS - 1)
}

/// The number of paths that tell whether the training begins.
fn first_paths(job: &Job) -> u64 {
    let [width, height] = job.camera.size().map(u64::from);
    (width * height * PATHS_PER_PIXEL).min(FIRST_PATHS)
}

/// The memory of a job's training in bytes: about what its last round takes. The first paths tell how many records a
/// path leaves.
pub(super) fn training_memory(job: &PlacedJob, settings: PathSettings) -> u64 {
    let first = first_paths(job);
    let prepared = PreparedPath::new(job.world(), settings);
    let traced = TrainingPaths::new(job).trace(&prepared, 0, first, &());
    let (ControlFlow::Continue(records) | ControlFlow::Break(records)) = traced.map_break(|()| Vec::new());
    let bytes = records.len() as u64 * size_of::<GuidingRecord>() as u64;
    if settings.guiding == Guiding::Auto && GuidingField::rarity(records) < RARE {
        return 0;
    }
    // Each record stands in its chunk's list, then in the list of all, which grows as it is filled.
    const COPIES: f64 = 2.0;
    (COPIES * bytes as f64 * last_round(job) as f64 / first.max(1) as f64) as u64
}

/// The paths of a job's training.
struct TrainingPaths<'w> {
    job: PlacedJob<'w>,
}

impl<'w> TrainingPaths<'w> {
    fn new(job: &PlacedJob<'w>) -> TrainingPaths<'w> {
        // The picture's samples are independent of those of the training.
        let job = job.with(|job| {
            job.seed ^= 0x6775_6964_6564_2121;
            job.film.sampler = SamplerKind::Independent;
        });
        TrainingPaths { job }
    }

    /// Traces paths, of which `begun` were traced before. Breaks if cancelled.
    fn trace(
        &self,
        prepared: &PreparedPath,
        begun: u64,
        count: u64,
        observer: &dyn Observer,
    ) -> ControlFlow<(), Vec<GuidingRecord>> {
        let [width, height] = self.job.camera.size().map(u64::from);
        let pixels = PixelRenderer::new(&self.job);
        let queue = TaskQueue::new(observer);
        let cancelled = |_| queue.is_stopped();
        let chunk = |tracer: &mut PathTracer<'_>, number: usize| {
            let mut recorder = GuidingRecorder::new();
            let first = number as u64 * CHUNK;
            for path in first..(first + CHUNK).min(count) {
                let pixel = path * width * height / count;
                let place = [(pixel % width) as u32, (pixel / width) as u32];
                pixels.block_with_probe(tracer, place, [(begun + path) as u32, 1], &mut recorder, &mut |_| ());
            }
            if cancelled(0) { ControlFlow::Break(()) } else { ControlFlow::Continue(recorder.into_records()) }
        };
        let chunks = count.div_ceil(CHUNK) as usize;
        let records = queue.collect(chunks, || prepared.worker(self.job.world(), &cancelled), chunk)?;
        ControlFlow::Continue(records.into_iter().flatten().collect())
    }
}

/// Prepares path tracing of a job, which learns where light comes from if the settings say so. Breaks if cancelled.
pub(super) fn prepare_path(
    job: &PlacedJob,
    settings: PathSettings,
    Preparation { guiding, learnt, .. }: Preparation<'_>,
    observer: &dyn Observer,
) -> ControlFlow<(), PreparedPath> {
    let mut prepared = PreparedPath::new(job.world(), settings);
    if settings.guiding == Guiding::Off {
        return ControlFlow::Continue(prepared);
    }
    let field = match guiding {
        Some(field) => Arc::clone(field),
        None => {
            let field = train(&mut prepared, job, observer)?;
            if let Some(learnt) = learnt {
                learnt(&field);
            }
            field
        }
    };
    prepared.set_guide(Some(field));
    ControlFlow::Continue(prepared)
}

/// Learns where light comes from, for a job of path tracing whose settings ask for it. A field without cells says that
/// guiding isn't worth its time. Breaks if cancelled.
pub(crate) fn learn_field(
    job: &PlacedJob,
    settings: PathSettings,
    observer: &dyn Observer,
) -> ControlFlow<(), GuidingField> {
    if settings.guiding == Guiding::Off {
        return ControlFlow::Continue(GuidingField::default());
    }
    let field = train(&mut PreparedPath::new(job.world(), settings), job, observer)?;
    // Nothing else holds the field by now.
    ControlFlow::Continue(Arc::into_inner(field).unwrap_or_default())
}

/// Trains path guiding. A field without cells says that it isn't worth its time. `prepared` is guided meanwhile, and by
/// nothing afterwards.
fn train(prepared: &mut PreparedPath, job: &PlacedJob, observer: &dyn Observer) -> ControlFlow<(), Arc<GuidingField>> {
    let settings = prepared.settings;
    let budget = training_paths(job);
    let training = TrainingPaths::new(job);
    let trace = |prepared: &PreparedPath, begun, count| training.trace(prepared, begun, count, observer);
    let is_auto = settings.guiding == Guiding::Auto;
    if is_auto && GuidingField::rarity(trace(prepared, 0, first_paths(job))?) < RARE {
        return ControlFlow::Continue(Arc::default());
    }
    let mut last = Arc::default();
    let mut begun = 0;
    for round in 0..ROUNDS {
        observer.solving(&SolvingProgress {
            phase: SolvingPhase::Guiding { round: round + 1, rounds: ROUNDS },
            patches: 0,
            links: 0,
        });
        let count = paths_of_round(budget, round);
        let records = trace(prepared, begun, count)?;
        begun += count;
        let is_last = round + 1 == ROUNDS;
        let field = GuidingField::new(records, is_last);
        // The paths of the first round weren't guided.
        let most = if is_last { WORTHWHILE } else { PROMISING };
        if is_auto && round > 0 && field.noise_ratio() > most {
            last = Arc::default();
            break;
        }
        let field = Arc::new(field);
        prepared.set_guide(Some(Arc::clone(&field)));
        last = field;
    }
    prepared.set_guide(None);
    ControlFlow::Continue(last)
}
