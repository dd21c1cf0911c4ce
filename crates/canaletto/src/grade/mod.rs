//! Grading of pictures that others have rendered of a scene: which stage of the chapter a picture shows, and which
//! mistake explains best why it differs.
//!
//! Each hypothesis is a stage with or without a [`Mistake`]. A plain tracer renders it at the pixels of the student's
//! picture, and the one with the least error wins. A mistake is named only if it is clearly better than having none. At
//! edges any colour between those of the pixel's corners and centre is right, since it depends on where exactly rays
//! go. Only [`Mistake::RayPlace`] looks at edges closely.

mod display;
mod left_out;
mod mistake;
mod special;
mod student;
mod tracer;

pub use mistake::Mistake;
pub use student::StudentPicture;

use crate::Named;
use crate::job::{Job, JobError, Observer};
use crate::scene::{Sampling, Stage, WhittedSettings};
use crate::world::World;
use canaletto_bvh::with_stack;
use display::{displayed, error};
use glam::DVec3;
use left_out::{left_out, own_error};
use rayon::prelude::*;
use tracer::{Tracer, TracerSettings};

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// The job's stage without a mistake.
    Right,
    /// An earlier stage without a mistake.
    Unfinished,
    /// A stage with a mistake.
    Mistaken,
    /// Something that no hypothesis explains.
    Unexplained,
}

/// A grade of a picture.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Grade {
    /// The verdict.
    pub verdict: Verdict,
    /// The stage that the picture matches best.
    pub stage: Stage,
    /// The mistake that explains it best.
    pub mistake: Option<Mistake>,
    /// Other mistakes that explain it as well.
    pub also: Vec<Mistake>,
    /// The hypotheses, the best first. Errors are means over the compared pixels in steps of 8 bits.
    pub hypotheses: Vec<Hypothesis>,
    /// The error of the job's stage without a mistake.
    pub error: f64,
    /// The pixels that show best that there is a mistake, or that something is missing.
    pub evidence: Vec<EvidencePixel>,
    /// What the scene has and hypotheses leave out, in words. The whole equation without a mistake has it.
    pub left_out: Vec<&'static str>,
    /// The number of pixels that were compared.
    pub compared: usize,
    /// Whether the observer let the grading finish.
    pub complete: bool,
}

/// A stage with or without a mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Hypothesis {
    /// The stage.
    pub stage: Stage,
    /// The mistake.
    pub mistake: Option<Mistake>,
    /// The mean error of the compared pixels in steps of 8 bits.
    pub error: f64,
    amount: f64,
}

/// A pixel at which the picture is as the mistake makes it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct EvidencePixel {
    /// Column and row from the top left.
    pub pixel: [u32; 2],
    /// The object that is seen there; none for the background.
    pub object: Option<String>,
    /// The display values of the picture.
    pub student: [f32; 3],
    /// The right display values.
    pub right: [f32; 3],
    /// The display values of the hypothesis.
    pub mistaken: [f32; 3],
}

/// The passes over the hypotheses: the most pixels that are rendered, and how many hypotheses stay.
const PASSES: [(usize, usize); 3] = [(200, 40), (1_500, 10), (MOST_PIXELS, 10)];
/// The most pixels that are compared.
const MOST_PIXELS: usize = 60_000;
/// The mean error in steps of 8 bits that is as good as none.
const NOTHING: f64 = 0.002;
/// The most pixels that are given as evidence.
const MOST_EVIDENCE: usize = 3;

/// Grades a picture of the job's window.
///
/// The job's integrator gives the stage that the picture should have, the largest depth and whether there are shadows.
/// Its film gives tone, transfer, and the place of rays. Lenses, motion and roughness are left out of hypotheses; see
/// [`Grade::left_out`].
///
/// # Panics
/// If the picture hasn't the size of the job's window.
///
/// # Errors
/// [`JobError`] if [`Job::check`] finds an error, or if required threads can't be started.
pub fn grade(world: &World, job: &Job, student: &StudentPicture, observer: &dyn Observer) -> Result<Grade, JobError> {
    job.check()?;
    let [_, _, width, height] = job.window();
    assert_eq!([width, height], [student.width, student.height], "the picture has the window's size");
    let left_out = left_out(world, job);
    let own_error = if left_out.is_empty() { None } else { own_error(world, job, student, &left_out, observer)? };
    let counted = job.relative_to(world);
    let job = counted.as_ref().unwrap_or(job);
    let grader = Grader {
        world,
        job,
        student,
        observer,
        whitted: job.integrator.nearest_whitted(),
        edges: student.edges(),
        left_out,
        own_error,
    };
    Ok(with_stack(crate::render::stack_of(world, job), || grader.grade())?)
}

struct Grader<'a> {
    world: &'a World,
    job: &'a Job,
    student: &'a StudentPicture,
    observer: &'a dyn Observer,
    whitted: WhittedSettings,
    /// Which pixels of the picture are edges.
    edges: Vec<bool>,
    /// What hypotheses leave out.
    left_out: Vec<&'static str>,
    /// The error against Canaletto's own picture, if anything is left out.
    own_error: Option<f64>,
}

/// The range of a pixel's display values.
type Shown = [DVec3; 2];

/// The places of a pixel whose colours bound that of an edge, from its lower left corner.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];

/// A hypothesis with its settings.
#[derive(Clone, Copy)]
struct Guess {
    settings: TracerSettings,
    error: f64,
}

/// Pixels with the weights of their errors.
struct Chosen {
    pixels: Vec<u32>,
    weights: Vec<f64>,
}

impl Grader<'_> {
    fn settings(&self, stage: Stage, mistake: Option<(Mistake, f64)>) -> TracerSettings {
        let WhittedSettings { max_depth, min_weight, shadows, .. } = self.whitted;
        TracerSettings { stage, max_depth, min_weight: f64::from(min_weight), shadows, mistake }
    }

    /// The offset of rays from their pixel's lower left corner.
    fn own_place(&self) -> [f64; 2] {
        if self.job.film.sampling == Sampling::Corner { [0.0; 2] } else { [0.5; 2] }
    }

    /// The linear colours at places of pixels.
    fn colors(&self, settings: TracerSettings, places: &[(u32, [f64; 2])], all_blocked: bool) -> Vec<DVec3> {
        let tracer = Tracer { world: self.world, settings, all_blocked };
        let (camera, [left, top, width, _]) = (&self.job.camera, self.job.window());
        let height = camera.size()[1];
        let upside_down = settings.amount(Mistake::UpsideDown).is_some();
        let color = |(index, place): &(u32, [f64; 2])| {
            let (x, y) = (left + index % width, top + index / width);
            let row = if upside_down { y } else { height - 1 - y };
            tracer.pixel(camera, f64::from(x) + place[0], f64::from(row) + place[1])
        };
        places.par_iter().with_min_len(64).map(color).collect()
    }

    /// The display values at one place of each pixel.
    fn shown_at(&self, settings: TracerSettings, pixels: &[u32], place: [f64; 2], all_blocked: bool) -> Vec<DVec3> {
        let places: Vec<_> = pixels.iter().map(|pixel| (*pixel, place)).collect();
        displayed(&self.colors(settings, &places, all_blocked), &self.job.developing(), &settings)
    }

    /// The display values of pixels: at edges a range, elsewhere those at the rays' own place.
    fn shown(&self, settings: TracerSettings, pixels: &[u32]) -> Vec<Shown> {
        let own = [self.own_place()];
        let places_of = |pixel: u32| if self.edges[pixel as usize] { &PLACES[..] } else { &own };
        let places: Vec<_> =
            pixels.iter().flat_map(|pixel| places_of(*pixel).iter().map(|place| (*pixel, *place))).collect();
        let values = displayed(&self.colors(settings, &places, false), &self.job.developing(), &settings);
        let mut rest = &values[..];
        let range = |pixel: &u32| {
            let (own, others) = rest.split_at(places_of(*pixel).len());
            rest = others;
            own.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
        };
        pixels.iter().map(range).collect()
    }

    fn errors(&self, shown: &[Shown], pixels: &[u32]) -> Vec<f64> {
        let error = |(shown, pixel): (&Shown, &u32)| {
            error(*shown, self.student.pixels[*pixel as usize], self.student.tolerance)
        };
        shown.iter().zip(pixels).map(error).collect()
    }

    fn grade(&self) -> Grade {
        let compared = thinned(&self.student.compared(), MOST_PIXELS);
        // Each stage without a mistake. Of stages with equal pictures the last one stands for all.
        let mut stages: Vec<(Stage, Vec<Shown>)> = Vec::new();
        for &stage in Stage::ALL.iter().rev().filter(|stage| **stage <= self.whitted.stage) {
            let shown = self.shown(self.settings(stage, None), &compared);
            if stages.iter().all(|(_, other)| !are_same(other, &shown)) {
                stages.push((stage, shown));
            }
        }
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        let stage_errors: Vec<Vec<f64>> = stages.iter().map(|(_, shown)| self.errors(shown, &compared)).collect();
        let right_error = self.own_error.map_or(mean(&stage_errors[0]), |own| own.min(mean(&stage_errors[0])));
        let nearest = (0..stages.len()).min_by(|a, b| mean(&stage_errors[*a]).total_cmp(&mean(&stage_errors[*b])));
        let nearest = nearest.unwrap_or(0);
        let mut guesses: Vec<Guess> = stages
            .iter()
            .zip(&stage_errors)
            .map(|((stage, _), errors)| Guess { settings: self.settings(*stage, None), error: mean(errors) })
            .collect();
        let is_own = right_error < guesses[nearest].error && self.is_small(right_error);
        guesses[0].error = right_error;
        if is_own {
            guesses.sort_by(|a, b| a.error.total_cmp(&b.error));
            return self.verdict(guesses, stages, 0, None, right_error, &compared);
        }
        if guesses[nearest].error <= NOTHING {
            let ray_place = self.ray_place(guesses[nearest].settings);
            guesses.sort_by(|a, b| a.error.total_cmp(&b.error));
            return self.verdict(guesses, stages, nearest, ray_place, right_error, &compared);
        }
        let mut mistaken: Vec<Guess> = Vec::new();
        for (stage, _) in &stages {
            for &mistake in Mistake::ALL.iter().filter(|mistake| is_tried(**mistake, *stage)) {
                let settings = |amount: &f64| self.settings(*stage, Some((mistake, *amount)));
                mistaken.extend(mistake.amounts().iter().map(settings).map(|settings| Guess { settings, error: 0.0 }));
            }
        }
        for (most, stay) in PASSES {
            let chosen = choose(&compared, &stage_errors[nearest], most);
            let rights: Vec<(Stage, Vec<Shown>)> = stages
                .iter()
                .map(|(stage, _)| (*stage, self.shown(self.settings(*stage, None), &chosen.pixels)))
                .collect();
            let mut rest = Vec::new();
            for Guess { settings, .. } in mistaken {
                if self.observer.cancelled() {
                    return self.cancelled(right_error, compared.len());
                }
                let shown = self.shown(settings, &chosen.pixels);
                // What changes nothing is no mistake.
                if rights.iter().all(|(stage, right)| *stage != settings.stage || !are_same(right, &shown)) {
                    let errors = self.errors(&shown, &chosen.pixels);
                    let error = errors.iter().zip(&chosen.weights).map(|(error, weight)| error * weight).sum();
                    rest.push(Guess { settings, error });
                }
            }
            rest.sort_by(|a, b| a.error.total_cmp(&b.error));
            rest.truncate(stay);
            mistaken = rest;
        }
        guesses.extend(mistaken);
        guesses.extend(self.acne(&stages));
        guesses.sort_by(|a, b| a.error.total_cmp(&b.error));
        self.verdict(guesses, stages, nearest, None, right_error, &compared)
    }

    /// Whether an error is small enough for a right picture: by another filter of textures, or by a compression.
    fn is_small(&self, error: f64) -> bool {
        error <= if self.student.is_compressed() { 0.2 } else { 0.1 }
    }

    /// The grade by the hypotheses, the best first. `special` is a mistake that was found by other means.
    fn verdict(
        &self,
        guesses: Vec<Guess>,
        stages: Vec<(Stage, Vec<Shown>)>,
        nearest: usize,
        special: Option<Guess>,
        right_error: f64,
        compared: &[u32],
    ) -> Grade {
        let full = stages.first().map_or(Stage::Full, |(stage, _)| *stage);
        // Of hypotheses that are about as good as the best, the simplest one.
        let best_of = |is_candidate: &dyn Fn(&Guess) -> bool| -> Option<Guess> {
            let least = guesses.iter().find(|guess| is_candidate(guess))?.error;
            let simplicity = |guess: &Guess| {
                let (early, wrong) = (guess.settings.stage != full, guess.settings.mistake.is_some());
                (u32::from(early) + u32::from(wrong), wrong)
            };
            let as_good = guesses.iter().filter(|guess| is_candidate(guess) && guess.error <= 1.2 * least + NOTHING);
            as_good.min_by(|a, b| simplicity(a).cmp(&simplicity(b)).then(a.error.total_cmp(&b.error))).copied()
        };
        let without = best_of(&|guess| guess.settings.mistake.is_none());
        let (Some(without), Some(best)) = (without, special.or_else(|| best_of(&|_| true))) else {
            return self.cancelled(right_error, compared.len());
        };
        let least_gain = if self.student.is_compressed() { 0.05 } else { 2.0 * NOTHING };
        let explains =
            special.is_some() || best.error <= 0.4 * without.error && without.error - best.error >= least_gain;
        let (verdict, chosen) = match best.settings.mistake {
            Some(_) if explains => (Verdict::Mistaken, best),
            _ if !self.is_small(without.error) => (Verdict::Unexplained, without),
            _ if without.settings.stage == full => (Verdict::Right, without),
            _ => (Verdict::Unfinished, without),
        };
        let mut also = Vec::new();
        if verdict == Verdict::Mistaken && special.is_none() {
            let equals = guesses.iter().filter(|guess| guess.error <= chosen.error + NOTHING);
            let mistakes = equals.filter_map(|guess| Some(guess.settings.mistake?.0));
            for mistake in mistakes.filter(|mistake| Some(*mistake) != chosen.settings.mistake.map(|(own, _)| own)) {
                if !also.contains(&mistake) {
                    also.push(mistake);
                }
            }
        }
        let evidence = match verdict {
            Verdict::Right | Verdict::Unexplained => Vec::new(),
            Verdict::Unfinished => self.evidence(&stages[0].1, chosen, compared),
            // A mistake shows by what it changes in its own stage.
            _ => {
                let own = stages.iter().find(|(stage, _)| *stage == chosen.settings.stage);
                self.evidence(&own.unwrap_or(&stages[nearest]).1, chosen, compared)
            }
        };
        let hypothesis = |guess: &Guess| Hypothesis {
            stage: guess.settings.stage,
            mistake: guess.settings.mistake.map(|(mistake, _)| mistake),
            amount: guess.settings.mistake.map_or(0.0, |(_, amount)| amount),
            error: guess.error,
        };
        Grade {
            verdict,
            stage: chosen.settings.stage,
            mistake: chosen.settings.mistake.map(|(mistake, _)| mistake).filter(|_| verdict == Verdict::Mistaken),
            also,
            hypotheses: guesses.iter().map(hypothesis).collect(),
            error: right_error,
            evidence,
            left_out: self.left_out.clone(),
            compared: compared.len(),
            complete: true,
        }
    }

    fn cancelled(&self, error: f64, compared: usize) -> Grade {
        Grade {
            verdict: Verdict::Unexplained,
            stage: Stage::Full,
            mistake: None,
            also: Vec::new(),
            hypotheses: Vec::new(),
            error,
            evidence: Vec::new(),
            left_out: self.left_out.clone(),
            compared,
            complete: false,
        }
    }

    /// The pixels at which a guess explains most of the difference, away from each other.
    fn evidence(&self, right: &[Shown], guess: Guess, compared: &[u32]) -> Vec<EvidencePixel> {
        let shown = self.shown(guess.settings, compared);
        let (right_errors, own_errors) = (self.errors(right, compared), self.errors(&shown, compared));
        let gain = |i: usize| right_errors[i] - own_errors[i];
        let mut order: Vec<usize> = (0..compared.len()).filter(|i| gain(*i) > 0.0).collect();
        // Edges are the weakest evidence.
        let is_edge = |i: usize| self.edges[compared[i] as usize];
        order.sort_by(|a, b| {
            is_edge(*a).cmp(&is_edge(*b)).then(gain(*b).total_cmp(&gain(*a))).then(compared[*a].cmp(&compared[*b]))
        });
        let [left, top, width, height] = self.job.window();
        let at = |i: usize| [compared[i] % width, compared[i] / width];
        let apart = (width + height) / 12;
        let mut found: Vec<usize> = Vec::new();
        for i in order {
            let is_apart = |j: &usize| {
                let ([x, y], [u, v]) = (at(i), at(*j));
                x.abs_diff(u) + y.abs_diff(v) >= apart
            };
            if found.iter().all(is_apart) {
                found.push(i);
            }
            if found.len() == MOST_EVIDENCE {
                break;
            }
        }
        let (camera_height, place) = (self.job.camera.size()[1], self.own_place());
        let pixel = |i: usize| {
            let [x, y] = at(i);
            let (column, row) = (left + x, top + y);
            let line =
                self.job.camera.line(f64::from(column) + place[0], f64::from(camera_height - 1 - row) + place[1]);
            let hit = self.world.intersect(&line.rounded(), f32::INFINITY);
            EvidencePixel {
                pixel: [column, row],
                object: hit.map(|hit| self.world.object(&hit).name.clone()),
                student: self.student.pixels[compared[i] as usize],
                right: middle(right[i]),
                mistaken: middle(shown[i]),
            }
        };
        found.into_iter().map(pixel).collect()
    }
}

/// Whether display values are equal but for roundings.
fn are_same(a: &[Shown], b: &[Shown]) -> bool {
    let is_near = |a: DVec3, b: DVec3| (a - b).abs().max_element() < 1e-6;
    a.iter().zip(b).all(|(a, b)| is_near(a[0], b[0]) && is_near(a[1], b[1]))
}

/// The display values in the middle of a range.
fn middle([low, high]: Shown) -> [f32; 3] {
    ((low + high) * 0.5).as_vec3().to_array()
}

/// Whether a mistake is rendered at a stage like any other.
fn is_tried(mistake: Mistake, stage: Stage) -> bool {
    stage >= mistake.first_stage() && !matches!(mistake, Mistake::RayPlace | Mistake::ShadowAcne)
}

/// At most this many elements, evenly spread.
fn thinned(all: &[u32], most: usize) -> Vec<u32> {
    let step = all.len().div_ceil(most).max(1);
    all.iter().copied().step_by(step).collect()
}

/// At most `most` pixels: half of them with an error, if there are enough of either. Their weighted errors sum to the
/// mean of all.
fn choose(compared: &[u32], errors: &[f64], most: usize) -> Chosen {
    let (mut chosen, total) = (Chosen { pixels: Vec::new(), weights: Vec::new() }, compared.len().max(1) as f64);
    for wrong in [true, false] {
        let all: Vec<u32> = compared
            .iter()
            .zip(errors)
            .filter(|(_, error)| (**error > 0.0) == wrong)
            .map(|(pixel, _)| *pixel)
            .collect();
        let some = thinned(&all, most / 2);
        let weight = all.len() as f64 / some.len().max(1) as f64 / total;
        chosen.weights.extend(some.iter().map(|_| weight));
        chosen.pixels.extend(some);
    }
    chosen
}
