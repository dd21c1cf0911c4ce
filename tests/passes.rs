//! Pictures that are made in passes of samples: parts add up, stopped pictures go on, and pixels get as many samples as
//! they need.

use canaletto::film::{BlockMean, Checkpoint, HalfBuffers, SampleBlocks};
use canaletto::render::{
    Aov, Job, JobError, Observer, PassProgress, Preparation, Progress, Rendering, render, render_from, render_on,
};
use canaletto::scene::{Filter, PathSettings, SamplerKind, Sampling, WhittedSettings};
use canaletto::world::World;
use canaletto_tests::gallery::{distributed_job, distributed_still_life};
use canaletto_tests::{Random, assert_same_picture};
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// A scene with a lens, motion, glossy surfaces and area lights.
fn world() -> World {
    World::build(distributed_still_life(1.0)).unwrap()
}

fn job(samples: u32) -> Job {
    let mut job = distributed_job(1.0, 40, 30, samples, SamplerKind::Sobol);
    (job.integrator, job.tile) = (PathSettings::DEFAULT.into(), 16);
    job.aovs = vec![Aov::HalfA, Aov::HalfB, Aov::Samples, Aov::Normal];
    job
}

fn same(a: &Rendering, b: &Rendering, name: &str) {
    assert_same_picture(&a.picture, &b.picture, name);
    assert!(a.samples == b.samples, "{name}: other samples");
}

#[test]
fn two_runs_of_32_samples_are_one_of_64() {
    let world = world();
    let at_once = render(&world, &job(64), &()).unwrap();
    let first = render(&world, &job(32), &()).unwrap();
    let on = render_on(&world, &job(64), first.samples.as_ref().unwrap(), &()).unwrap();
    same(&on, &at_once, "gone on with");
    // Or apart from each other, and then added.
    let second = render(&world, &Job { first_sample: 32, ..job(32) }, &()).unwrap();
    for (pixel, color) in at_once.picture.pixels.iter().enumerate() {
        let halves = [first.picture.pixels[pixel], second.picture.pixels[pixel]];
        assert_eq!(BlockMean::of(halves).mean, *color);
    }
    assert_ne!(first.picture.pixels, second.picture.pixels);
}

#[test]
fn any_number_of_samples_goes_on_to_any_other() {
    let world = world();
    let counts = [3, 17, 24, 64, 100];
    let job = |count| Job { aovs: vec![Aov::Samples], ..job(count) };
    for pair in counts.windows(2) {
        let first = render(&world, &job(pair[0]), &()).unwrap();
        let on = render_on(&world, &job(pair[1]), first.samples.as_ref().unwrap(), &()).unwrap();
        same(&on, &render(&world, &job(pair[1]), &()).unwrap(), &format!("{pair:?}"));
    }
}

/// Cancels after this number of pixels of passes, as a signal does.
struct After(u64, AtomicU64);

impl Observer for After {
    fn cancelled(&self) -> bool {
        self.1.load(Ordering::Relaxed) >= self.0
    }

    fn progress(&self, _: &Progress) {
        self.1.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn a_stopped_picture_goes_on_to_the_same_bytes() {
    let world = world();
    let whole = render(&world, &job(64), &()).unwrap();
    // Six tiles: in the first and in the tenth pass.
    for tiles in [2, 57] {
        let part = render(&world, &job(64), &After(tiles, AtomicU64::new(0))).unwrap();
        assert!(!part.complete && part.pixels_done > 0);
        let samples = part.samples.as_ref().unwrap();
        let statistics = part.statistics.as_ref().unwrap();
        assert!(statistics.most > 0 && statistics.fewest < 64, "{tiles}: {statistics:?}");
        for (pixel, color) in part.picture.pixels.iter().enumerate() {
            assert_eq!(*color, samples.mean(pixel));
        }
        same(&render_on(&world, &job(64), samples, &()).unwrap(), &whole, &format!("after {tiles} tiles"));
    }
}

/// A render that makes a checkpoint now and then, and is killed after a number of tiles: what is left of it is its last
/// checkpoint.
struct Killed {
    every: u64,
    after: u64,
    tiles: AtomicU64,
    last: Mutex<Option<Checkpoint>>,
}

impl Observer for Killed {
    fn cancelled(&self) -> bool {
        self.tiles.load(Ordering::Relaxed) >= self.after
    }

    fn wants_checkpoint(&self) -> bool {
        (self.tiles.fetch_add(1, Ordering::Relaxed) + 1).is_multiple_of(self.every)
    }

    fn checkpoint(&self, checkpoint: &Checkpoint) {
        *self.last.lock().unwrap() = Some(checkpoint.clone());
    }
}

/// A picture is killed again and again, and taken up from its last checkpoint each time. It has the bytes of one that
/// wasn't: by paths and by classic rays, with an end by noise and without one.
#[test]
fn a_picture_killed_at_any_moment_goes_on_to_the_same_bytes() {
    let world = world();
    let by_noise = |limit: f32| Job { noise: Some(limit), ..job(512) };
    let mut classic = Job { progressive: true, ..job(40) };
    classic.integrator = WhittedSettings::default().into();
    let mut random = Random(5);
    for (name, job) in
        [("64", job(64)), ("noise", by_noise(0.05)), ("less noise", by_noise(0.03)), ("classic", classic)]
    {
        let whole = render(&world, &job, &()).unwrap();
        let (mut kills, mut midway) = (0, 0);
        for round in 0..4 {
            let mut start = None;
            let made = loop {
                let [every, after] = [4.0, 40.0].map(|most| random.within(1.0, most) as u64);
                let killed = Killed { every, after, tiles: AtomicU64::new(0), last: Mutex::default() };
                let rendering = render_from(&world, &job, Preparation::default(), start.as_ref(), &killed).unwrap();
                if rendering.complete {
                    break rendering;
                }
                let last = killed.last.into_inner().unwrap();
                let counts = |checkpoint: &Checkpoint| checkpoint.samples.counts().to_vec();
                midway +=
                    u32::from(last.as_ref().is_some_and(|last| counts(last).iter().any(|n| *n != counts(last)[0])));
                start = last.or(start);
                kills += 1;
            };
            same(&made, &whole, &format!("{name}, round {round}, {kills} kills"));
        }
        assert!(kills > 4 && midway > 0, "{name}: {kills} kills, {midway} in the middle of a pass");
    }
}

/// Parts of samples and of rows, cut anywhere, add up to the picture: by one after the other, or by a tree of merges.
#[test]
fn parts_of_any_cut_are_the_whole() {
    let world = world();
    let [width, height] = [40, 30];
    let whole = render(&world, &job(50), &()).unwrap().samples.unwrap();
    let mut random = Random(9);
    let mut cuts = |end: u32, most: f32| -> Vec<u32> {
        let mut cuts: Vec<u32> =
            (0..random.within(0.0, most) as u32).map(|_| random.within(1.0, end as f32) as u32).collect();
        cuts.extend([0, end]);
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    };
    // CANALETTO_PARTITIONS=1000 cuts it as often.
    let rounds = std::env::var("CANALETTO_PARTITIONS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(6);
    for round in 0..rounds {
        let (rows, samples) = (cuts(height, 3.0), cuts(50, 5.0));
        let part = |[top, bottom]: [u32; 2], [first, end]: [u32; 2]| {
            let mut job = Job { first_sample: first, end_sample: Some(end), ..job(50) };
            job.film.crop = Some([0, top, width, bottom - top]);
            render(&world, &job, &()).unwrap().samples.unwrap()
        };
        let mut joined = SampleBlocks::new([width, height], 0, true);
        let mut by_trees = SampleBlocks::new([width, height], 0, true);
        for row in rows.windows(2) {
            let mut parts: Vec<SampleBlocks> =
                samples.windows(2).map(|range| part([row[0], row[1]], [range[0], range[1]])).collect();
            for part in &parts {
                assert!(joined.merge(part, [0, row[0]]));
                assert!(!joined.merge(part, [0, row[0]]), "no part is added twice");
            }
            // Neighbours are joined first, in any order.
            while parts.len() > 1 {
                let at = (round * 7 + parts.len()) % (parts.len() - 1);
                let next = parts.remove(at + 1);
                assert!(parts[at].merge(&next, [0, 0]));
            }
            assert!(by_trees.merge(&parts[0], [0, row[0]]));
        }
        assert!(joined == whole && by_trees == whole, "rows {rows:?}, samples {samples:?}");
    }
}

/// Stops after a pass, and lists the passes.
struct Until(u32, Mutex<Vec<u32>>);

impl Observer for Until {
    fn pass_ended(&self, progress: &PassProgress<'_>) -> ControlFlow<()> {
        self.1.lock().unwrap().push(progress.samples);
        assert!(progress.picture.pixels.iter().any(|color| !color.is_black()));
        if progress.samples >= self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[test]
fn passes_double_and_then_grow_by_quarters() {
    let world = world();
    let until = Until(40, Mutex::default());
    let rendering = render(&world, &job(64), &until).unwrap();
    assert_eq!(*until.1.lock().unwrap(), [1, 2, 4, 8, 16, 20, 24, 28, 32, 40]);
    // A picture that its observer ends is complete, and the one of as many samples.
    assert!(rendering.complete);
    same(&rendering, &render(&world, &job(40), &()).unwrap(), "40 samples");
}

#[test]
fn halves_have_the_picture_as_their_mean() {
    let world = world();
    for count in [2, 16, 24, 64] {
        let rendering = render(&world, &job(count), &()).unwrap();
        let halves = HalfBuffers::of(&rendering.picture).unwrap();
        assert!(halves.samples.iter().all(|samples| *samples == count));
        let (mut variance, mut light) = (0.0f64, 0.0f64);
        for (pixel, color) in rendering.picture.pixels.iter().enumerate() {
            let mean = BlockMean::of([halves.halves[0][pixel], halves.halves[1][pixel]]).mean;
            for (mean, color) in mean.to_array().into_iter().zip(color.to_array()) {
                assert!((mean - color).abs() <= 2e-6 * color, "{count}: {mean} {color}");
            }
            variance += f64::from(halves.variance(pixel).g);
            light += f64::from(color.g);
        }
        assert!(variance > 0.0 && light > 0.0);
    }
}

/// The estimate of halves is the real error, which a picture of many samples tells.
#[test]
fn the_error_that_halves_estimate_is_the_real_one() {
    let world = world();
    let reference = render(&world, &Job { seed: 9, ..job(2048) }, &()).unwrap().picture;
    for count in [16, 64, 128] {
        let picture = render(&world, &job(count), &()).unwrap().picture;
        let halves = HalfBuffers::of(&picture).unwrap();
        let (mut estimated, mut real) = (0.0f64, 0.0f64);
        for (pixel, (color, exact)) in picture.pixels.iter().zip(&reference.pixels).enumerate() {
            estimated += halves.variance(pixel).to_array().map(f64::from).iter().sum::<f64>();
            real += color.to_array().iter().zip(exact.to_array()).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        }
        let ratio = (estimated / real).sqrt();
        println!("{count} samples: estimated error / real error = {ratio:.3}");
        // Few pixels hold most of the error, so that one picture tells it within a quarter.
        assert!((0.75..1.8).contains(&ratio), "{count}: {ratio}");
    }
}

#[test]
fn samples_that_dont_fit_are_refused() {
    let world = world();
    let samples = render(&world, &Job { aovs: Vec::new(), ..job(16) }, &()).unwrap().samples.unwrap();
    let refused = |job: Job, word: &str| {
        let error = render_on(&world, &job, &samples, &()).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    };
    let plain = |count| Job { aovs: Vec::new(), ..job(count) };
    let mut crop = plain(32);
    crop.film.crop = Some([1, 2, 20, 20]);
    refused(crop, "40 x 30 pixels");
    refused(Job { first_sample: 8, ..plain(32) }, "begin with number 0");
    refused(plain(1), "centre");
    // The halves of 16 samples are known from 32 on.
    refused(job(24), "with 32 samples");
    assert!(render_on(&world, &job(32), &samples, &()).is_ok());
}

#[test]
fn what_only_passes_have_is_refused_elsewhere() {
    let world = world();
    let refused = |change: &dyn Fn(&mut Job), words: [&str; 2]| {
        let mut job = Job { aovs: Vec::new(), ..job(4) };
        change(&mut job);
        let error = render(&world, &job, &()).unwrap_err();
        assert!(matches!(error, JobError::NotInPasses { .. }), "{error}");
        assert!(words.iter().all(|word| error.to_string().contains(word)), "{error}");
    };
    refused(&|job| (job.noise, job.film.filter) = (Some(0.1), Filter::Mitchell), ["noise", "mitchell"]);
    refused(&|job| (job.clamp, job.film.sampler) = (Some(1.0), SamplerKind::Jittered), ["clamp", "jittered"]);
    refused(&|job| (job.first_sample, job.film.sampling) = (4, Sampling::Regular(2)), ["first-sample", "--pattern"]);
    refused(&|job| (job.integrator, job.noise) = (Default::default(), Some(0.1)), ["noise", "progressive"]);
}

#[test]
fn pixels_get_samples_until_they_are_even() {
    let mut pictures = Vec::new();
    for (threads, tile) in [(1, 64), (2, 16), (7, 13)] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let job = Job { noise: Some(0.16), tile, ..job(1024) };
            pictures.push((format!("{threads} threads, tile {tile}"), render(&world(), &job, &()).unwrap()));
        });
    }
    for (name, rendering) in &pictures {
        same(rendering, &pictures[0].1, name);
        assert_eq!(rendering.counts, pictures[0].1.counts, "{name}");
    }
    let statistics = pictures[0].1.statistics.as_ref().unwrap();
    let is_even = statistics.noise.unwrap() <= 0.16 && statistics.fewest >= 64;
    assert!(is_even && statistics.most > statistics.fewest && statistics.most < 1024, "{statistics:?}");
    let samples = pictures[0].1.picture.layer("samples").unwrap();
    assert_eq!(samples.data.iter().map(|count| *count as u64).sum::<u64>(), statistics.total);
}

#[test]
fn a_clamp_bounds_samples_and_tells_what_it_takes() {
    let world = world();
    let free = render(&world, &job(16), &()).unwrap();
    let clamped = render(&world, &Job { clamp: Some(0.5), ..job(16) }, &()).unwrap();
    let sum = |rendering: &Rendering| -> f64 {
        let parts = rendering.picture.pixels.iter().flat_map(|color| color.to_array());
        parts.map(f64::from).sum()
    };
    let share = 1.0 - sum(&clamped) / sum(&free);
    let statistics = clamped.statistics.unwrap();
    assert!(statistics.clamped > 0 && (statistics.removed_share() - share).abs() < 1e-5);
    assert!(clamped.picture.pixels.iter().all(|color| color.max_component() <= 0.5));
    assert_eq!(free.statistics.unwrap().removed_share(), 0.0);
    let none = render(&world, &Job { clamp: Some(1e6), ..job(16) }, &()).unwrap();
    assert_eq!((none.picture.pixels, none.statistics.unwrap().clamped), (free.picture.pixels, 0));
}
