//! Grading of pictures that others have rendered of a scene: which stage of the chapter a picture shows, and which
//! mistake explains best why it differs.
//!
//! Each hypothesis is a stage with or without a [`Mistake`]. A plain tracer renders it at the pixels of the student's
//! picture, and the one with the least error wins. A mistake is named only if it is clearly better than having none. At
//! edges any colour between those of the pixel's corners and centre is right, since it depends on where exactly rays
//! go. A remark tells of other places of rays. A picture is right if no connected region of one object is wrong.

mod display;
mod filter;
mod finding;
mod fit;
mod left_out;
mod mistake;
mod numbers;
mod regions;
mod remark;
mod seen;
mod special;
mod student;
mod tracer;

pub use filter::PictureFilter;
pub use finding::{Finding, WrongRegion};
pub use mistake::Mistake;
pub use remark::Remark;
pub use student::StudentPicture;

use crate::job::{Job, JobError, Observer, PlacedJob, SolvingPhase, SolvingProgress};
use crate::named::Named;
use crate::scene::{Sampling, Scene, Stage, View, WhittedSettings};
use crate::world::{Hit, World};
use canaletto_bvh::with_stack;
use canaletto_parallel::prelude::*;
use display::{displayed, error};
use fit::Fitted;
use glam::DVec3;
use left_out::{left_out, own_error};
use mistake::form;
use numbers::Subject;
use regions::Judgement;
use seen::Seen;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
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
    /// The number of the scene that the mistake concerns, if it was found by a fit.
    pub finding: Option<Finding>,
    /// Where the picture differs from the job's stage without a mistake: connected pixels of one object.
    pub regions: Vec<WrongRegion>,
    /// Where it differs from the mistake's picture as well.
    pub left_over: Vec<WrongRegion>,
    /// What is otherwise than in the scene and no mistake.
    pub remarks: Vec<Remark>,
    /// The filter of a right picture, about, if it has [`Remark::OtherFilter`].
    pub filter: Option<PictureFilter>,
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

/// What a verdict is based on.
struct Context<'a> {
    /// The stages with pictures that differ, the last one first.
    stages: &'a [(Stage, Vec<Shown>)],
    /// The stage that is nearest to the picture.
    nearest: usize,
    right_error: f64,
    compared: &'a [u32],
    subject: &'a Subject<'a>,
    remark: Option<Remark>,
}

/// The passes over the hypotheses: the most pixels that are rendered, and how many hypotheses stay.
const PASSES: [(usize, usize); 3] = [(200, 40), (1_500, 10), (MOST_PIXELS, 10)];
/// The most pixels that are compared.
const MOST_PIXELS: usize = 60_000;
/// The mean error in steps of 8 bits that is as good as none.
const NOTHING: f64 = 0.002;
/// The mean error from which on a picture of one ray for each pixel is doubted.
const SHARP_ERROR: f64 = 0.01;
/// The most pixels that are given as evidence.
const MOST_EVIDENCE: usize = 3;

/// A picture that is asked for: the scene, and the view and the job with which it is rendered.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The scene of the world.
    pub scene: &'a Scene,
    /// The view of the job's camera.
    pub view: &'a View,
    /// The world that the scene describes.
    pub world: &'a World,
    /// The job.
    pub job: &'a Job,
}

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
pub fn grade(task: Task<'_>, student: &StudentPicture, observer: &dyn Observer) -> Result<Grade, JobError> {
    let Task { scene, view, world, job } = task;
    job.check()?;
    let [_, _, width, height] = job.window();
    assert_eq!([width, height], [student.width, student.height], "the picture has the window's size");
    let left_out = left_out(world, job);
    let own_error = if left_out.is_empty() { None } else { own_error(world, job, student, &left_out, observer)? };
    let placed = PlacedJob::new(world, job);
    let job = &*placed;
    let mut grader = Grader {
        job,
        student,
        observer,
        whitted: job.description().nearest_whitted(),
        edges: student.edges(),
        left_out,
        own_error,
        seen: Seen::of(world, scene, job.camera.clone()),
        place: if job.film.sampling == Sampling::Corner { [0.0; 2] } else { [0.5; 2] },
        met: Vec::new(),
        is_sharp: false,
        fitted: AtomicU64::new(0),
    };
    let subject = Subject { scene, view, world };
    let graded = || {
        let remark = grader.find_place();
        grader.met = grader.met(&grader.seen, grader.settings(grader.whitted.stage, None));
        grader.grade(&subject, remark)
    };
    Ok(with_stack(crate::render::stack_of(world, job), graded)?)
}

struct Grader<'a> {
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
    /// The scene as it is.
    seen: Seen<'a>,
    /// The offset of rays from their pixel's lower left corner.
    place: [f64; 2],
    /// Whether each pixel has the colour of one ray through its place.
    is_sharp: bool,
    /// What the rays of each pixel meet ([`Tracer::met`]); empty if it isn't needed.
    met: Vec<u64>,
    /// The number of pictures that fits have rendered.
    fitted: AtomicU64,
}

/// The range of a pixel's display values.
type Shown = [DVec3; 2];

/// The places of a pixel whose colours bound that of an edge, from its lower left corner.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];

/// A hypothesis with its settings.
#[derive(Clone)]
struct Guess<'s> {
    settings: TracerSettings,
    error: f64,
    /// A scene with other numbers, and these numbers.
    seen: Option<Arc<Seen<'s>>>,
    fitted: Option<Arc<Fitted>>,
}

impl Guess<'_> {
    fn new<'s>(settings: TracerSettings, error: f64) -> Guess<'s> {
        Guess { settings, error, seen: None, fitted: None }
    }
}

/// Pixels with the weights of their errors.
struct Chosen {
    pixels: Vec<u32>,
    weights: Vec<f64>,
}

impl Grader<'_> {
    fn tell(&self, phase: SolvingPhase) {
        self.observer.solving(&SolvingProgress { phase, patches: 0, links: 0 });
    }

    /// Tells that a fit has rendered one more picture.
    fn tell_fit(&self) {
        self.tell(SolvingPhase::Numbers { step: self.fitted.fetch_add(1, Ordering::Relaxed) + 1 });
    }

    fn settings(&self, stage: Stage, mistake: Option<(Mistake, f64)>) -> TracerSettings {
        let WhittedSettings { max_depth, min_weight, shadows, .. } = self.whitted;
        TracerSettings { stage, max_depth, min_weight: f64::from(min_weight), shadows, mistake }
    }

    fn seen_of<'t>(&'t self, guess: &'t Guess<'_>) -> &'t Seen<'t> {
        guess.seen.as_deref().unwrap_or(&self.seen)
    }

    /// The linear colours at places of pixels.
    fn colors(
        &self,
        seen: &Seen<'_>,
        settings: TracerSettings,
        places: &[(u32, [f64; 2])],
        all_blocked: bool,
    ) -> Vec<DVec3> {
        let [left, top, width, _] = self.job.window();
        let [w, h] = seen.camera.size();
        let upside_down = settings.amount(Mistake::UpsideDown).is_some();
        let transposed = settings.amount(Mistake::Transposed);
        let color = |(index, place): &(u32, [f64; 2])| {
            let (x, y) = (left + index % width, top + index / width);
            let row = if upside_down { y } else { h - 1 - y };
            let at = match transposed {
                Some(amount) => transposed_place([x, y], [w, h], *place, amount),
                None => [f64::from(x) + place[0], f64::from(row) + place[1]],
            };
            let (world, camera, radii) = (seen.world(), &seen.camera, &seen.radii[..]);
            let tracer = Tracer { world, camera, radii, settings, all_blocked, met: None };
            tracer.pixel(at[0], at[1]) * seen.gain
        };
        places.par_iter().with_min_len(64).map(color).collect()
    }

    /// The display values at places of pixels.
    fn displayed_at(
        &self,
        seen: &Seen<'_>,
        settings: TracerSettings,
        places: &[(u32, [f64; 2])],
        all_blocked: bool,
    ) -> Vec<DVec3> {
        displayed(&self.colors(seen, settings, places, all_blocked), &self.job.developing(), &settings)
    }

    /// The display values at one place of each pixel.
    fn shown_at(
        &self,
        seen: &Seen<'_>,
        settings: TracerSettings,
        pixels: &[u32],
        place: [f64; 2],
        all_blocked: bool,
    ) -> Vec<DVec3> {
        let places: Vec<_> = pixels.iter().map(|pixel| (*pixel, place)).collect();
        self.displayed_at(seen, settings, &places, all_blocked)
    }

    /// The display values of pixels: at edges a range, elsewhere those at the rays' own place.
    fn shown(&self, guess: &Guess<'_>, pixels: &[u32]) -> Vec<Shown> {
        let own = [self.place];
        let is_range = |pixel: u32| self.edges[pixel as usize] && !self.is_sharp;
        let places_of = |pixel: u32| if is_range(pixel) { &PLACES[..] } else { &own };
        let places: Vec<_> =
            pixels.iter().flat_map(|pixel| places_of(*pixel).iter().map(|place| (*pixel, *place))).collect();
        let values = self.displayed_at(self.seen_of(guess), guess.settings, &places, false);
        let mut rest = &values[..];
        let range = |pixel: &u32| {
            let (own, others) = rest.split_at(places_of(*pixel).len());
            rest = others;
            own.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
        };
        pixels.iter().map(range).collect()
    }

    /// Whether a pixel of the picture is an edge, and not of a smooth highlight.
    fn is_jump(&self, index: u32) -> bool {
        let [_, _, width, height] = self.job.window();
        let (x, y) = (index % width, index / width);
        let met = |x: u32, y: u32| self.met.get((y * width + x) as usize);
        let beside = |at: u32, side: u32| at.saturating_sub(1)..(at + 2).min(side);
        let is_same = |x: u32, y: u32| beside(y, height).all(|v| beside(x, width).all(|u| met(u, v) == met(x, y)));
        self.edges[index as usize] && !is_same(x, y)
    }

    /// What is seen first through a pixel.
    fn first_hit(&self, seen: &Seen<'_>, index: u32) -> Option<Hit> {
        let [left, top, width, _] = self.job.window();
        let (column, row) = (left + index % width, top + index / width);
        let y = f64::from(seen.camera.size()[1] - 1 - row) + self.place[1];
        let line = seen.camera.line(f64::from(column) + self.place[0], y);
        seen.world().intersect(&line.rounded(), f32::INFINITY)
    }

    fn errors(&self, shown: &[Shown], pixels: &[u32]) -> Vec<f64> {
        let error = |(shown, pixel): (&Shown, &u32)| {
            error(*shown, self.student.pixels[*pixel as usize], self.student.tolerance)
        };
        shown.iter().zip(pixels).map(error).collect()
    }

    fn grade(&self, subject: &Subject<'_>, remark: Option<Remark>) -> Grade {
        let compared = thinned(&self.student.compared(), MOST_PIXELS);
        // Each stage without a mistake. Of stages with equal pictures the last one stands for all.
        let mut stages: Vec<(Stage, Vec<Shown>)> = Vec::new();
        for &stage in Stage::ALL.iter().rev().filter(|stage| **stage <= self.whitted.stage) {
            let shown = self.shown(&Guess::new(self.settings(stage, None), 0.0), &compared);
            if stages.iter().all(|(_, other)| !are_same(other, &shown)) {
                stages.push((stage, shown));
            }
        }
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        let stage_errors: Vec<Vec<f64>> = stages.iter().map(|(_, shown)| self.errors(shown, &compared)).collect();
        let right_error = self.own_error.map_or(mean(&stage_errors[0]), |own| own.min(mean(&stage_errors[0])));
        let nearest = (0..stages.len()).min_by(|a, b| mean(&stage_errors[*a]).total_cmp(&mean(&stage_errors[*b])));
        let nearest = nearest.unwrap_or(0);
        let mut guesses: Vec<Guess<'_>> = stages
            .iter()
            .zip(&stage_errors)
            .map(|((stage, _), errors)| Guess::new(self.settings(*stage, None), mean(errors)))
            .collect();
        let is_own = right_error < guesses[nearest].error && self.is_small(right_error);
        guesses[0].error = right_error;
        let context = Context { stages: &stages, nearest, right_error, compared: &compared, subject, remark };
        if is_own {
            guesses.sort_by(|a, b| a.error.total_cmp(&b.error));
            let judgement = Judgement { regions: Vec::new(), error: None, filter: None };
            return self.verdict(guesses, &context, Some(judgement));
        }
        if self.is_small(guesses[nearest].error) || !self.is_sharp {
            let judgement = self.judged(&guesses[nearest]);
            if self.is_faultless(&guesses[nearest], &judgement) {
                let own = guesses.remove(nearest);
                guesses.insert(0, own);
                return self.verdict(guesses, &context, Some(judgement));
            }
        }
        let mut mistaken: Vec<Guess<'_>> = Vec::new();
        for (stage, _) in &stages {
            for &mistake in Mistake::ALL.iter().filter(|mistake| is_tried(**mistake, *stage)) {
                let settings = |amount: &f64| self.settings(*stage, Some((mistake, *amount)));
                mistaken.extend(mistake.amounts().iter().map(settings).map(|settings| Guess::new(settings, 0.0)));
            }
        }
        for (most, stay) in PASSES {
            let chosen = choose(&compared, &stage_errors[nearest], most);
            let rights: Vec<(Stage, Vec<Shown>)> = stages
                .iter()
                .map(|(stage, _)| (*stage, self.shown(&Guess::new(self.settings(*stage, None), 0.0), &chosen.pixels)))
                .collect();
            let mut rest = Vec::new();
            let steps = mistaken.len() as u64;
            for (step, mut guess) in (1..).zip(mistaken) {
                if self.observer.cancelled() {
                    return self.cancelled(right_error, compared.len());
                }
                self.tell(SolvingPhase::Mistakes { step, steps });
                let shown = self.shown(&guess, &chosen.pixels);
                // What changes nothing is no mistake.
                if rights.iter().all(|(stage, right)| *stage != guess.settings.stage || !are_same(right, &shown)) {
                    let errors = self.errors(&shown, &chosen.pixels);
                    guess.error = errors.iter().zip(&chosen.weights).map(|(error, weight)| error * weight).sum();
                    rest.push(guess);
                }
            }
            rest.sort_by(|a, b| a.error.total_cmp(&b.error));
            rest.truncate(stay);
            mistaken = rest;
        }
        let stages_error = guesses[nearest].error;
        let is_found = mistaken.first().is_some_and(|best| best.error <= self.found_below(stages_error));
        guesses.extend(mistaken);
        guesses.extend(self.acne(&stages));
        if !is_found && self.left_out.is_empty() {
            guesses.extend(self.fits(subject, stages[0].0, &compared, &stage_errors[0]));
            if nearest != 0 && mean(&stage_errors[nearest]) < 0.7 * mean(&stage_errors[0]) {
                guesses.extend(self.fits(subject, stages[nearest].0, &compared, &stage_errors[nearest]));
            }
            if self.observer.cancelled() {
                return self.cancelled(right_error, compared.len());
            }
        }
        guesses.sort_by(|a, b| a.error.total_cmp(&b.error));
        self.verdict(guesses, &context, None)
    }

    /// Whether an error is small enough for a right picture: by another filter of textures, or by a compression.
    fn is_small(&self, error: f64) -> bool {
        error <= if self.student.is_compressed() { 0.2 } else { 0.1 }
    }

    /// The error of a mistake below which no number of the scene is looked at. `without` is that without a mistake.
    fn found_below(&self, without: f64) -> f64 {
        if self.is_sharp { self.nothing() } else { (0.02 * without).max(NOTHING) }
    }

    /// The mean error that is as good as none.
    fn nothing(&self) -> f64 {
        if self.is_sharp { 0.1 * NOTHING } else { NOTHING }
    }

    /// Whether an error is small enough for a right picture in which no region is wrong. Filters differ at edges.
    fn may_be_right(&self, error: f64) -> bool {
        self.is_small(error) || !self.is_sharp && error <= 0.5
    }

    /// Whether a picture is right without a look at mistakes.
    fn is_faultless(&self, guess: &Guess<'_>, judgement: &Judgement) -> bool {
        let error = judgement.error.map_or(guess.error, |error| error.min(guess.error));
        judgement.regions.is_empty() && self.is_small(error) && !(self.is_sharp && error > SHARP_ERROR)
    }

    /// The grade by the hypotheses, the best first. `faultless` is the judgement of a picture that is known to be
    /// right.
    fn verdict(&self, guesses: Vec<Guess<'_>>, context: &Context<'_>, faultless: Option<Judgement>) -> Grade {
        let Context { stages, nearest, right_error, compared, subject, remark } = context;
        let full = stages.first().map_or(Stage::Full, |(stage, _)| *stage);
        // Of hypotheses that are about as good as the best, the simplest one.
        let simplicity = |guess: &Guess<'_>| {
            let (early, wrong) = (guess.settings.stage != full, guess.settings.mistake.is_some());
            let numbers = guess.fitted.as_ref().map_or(0, |fitted| subject.weight(&fitted.number, &fitted.values));
            (u32::from(early) + u32::from(wrong), wrong, numbers)
        };
        let best_of = |is_candidate: &dyn Fn(&Guess<'_>) -> bool| {
            let least = guesses.iter().filter(|guess| is_candidate(guess)).map(|g| g.error).fold(f64::MAX, f64::min);
            let as_good =
                guesses.iter().filter(|guess| is_candidate(guess) && guess.error <= 1.2 * least + self.nothing());
            as_good.min_by(|a, b| simplicity(a).cmp(&simplicity(b)).then(a.error.total_cmp(&b.error))).cloned()
        };
        let is_faultless = faultless.is_some();
        let without = match is_faultless {
            true => guesses.iter().find(|guess| guess.settings.mistake.is_none()).cloned(),
            false => best_of(&|guess| guess.settings.mistake.is_none()),
        };
        let best = best_of(&|guess| guess.settings.mistake.is_some());
        let Some(without) = without else { return self.cancelled(*right_error, compared.len()) };
        let Judgement { regions, error, filter } = faultless.unwrap_or_else(|| self.judged(&without));
        let error = error.map_or(without.error, |error| error.min(without.error));
        let is_right = is_faultless || regions.is_empty() && self.may_be_right(error);
        let least_gain = if self.student.is_compressed() { 0.02 } else { NOTHING };
        let explains = |best: &Guess<'_>| {
            let share = if best.fitted.is_some() { 0.3 } else { 0.4 };
            best.error <= share * without.error && without.error - best.error >= least_gain
        };
        // A picture of one ray for each pixel has next to no error if it is right. Edges by other filters have some,
        // but no mistake explains them.
        let doubted = if self.is_sharp { SHARP_ERROR } else { 0.1 };
        let is_doubtful =
            |best: &Guess<'_>| without.error > doubted && best.error <= 0.1 * without.error && !is_faultless;
        let mistaken = best.filter(|best| explains(best) && (!is_right || is_doubtful(best)));
        let (verdict, chosen) = match mistaken {
            Some(best) => (Verdict::Mistaken, best),
            None if !is_right => (Verdict::Unexplained, without),
            None if without.settings.stage == full => (Verdict::Right, without),
            None => (Verdict::Unfinished, without),
        };
        let mut also = Vec::new();
        if verdict == Verdict::Mistaken {
            let equals = guesses.iter().filter(|guess| {
                guess.error <= chosen.error + self.nothing() && simplicity(guess).2 <= simplicity(&chosen).2
            });
            let mistakes = equals.filter_map(|guess| Some(guess.settings.mistake?.0));
            for mistake in mistakes.filter(|mistake| Some(*mistake) != chosen.settings.mistake.map(|(own, _)| own)) {
                if !also.contains(&mistake) {
                    also.push(mistake);
                }
            }
        }
        let evidence = match verdict {
            Verdict::Right | Verdict::Unexplained => Vec::new(),
            Verdict::Unfinished => self.evidence(&stages[0].1, &chosen, compared),
            // A mistake shows by what it changes in its own stage.
            _ => {
                let own = stages.iter().find(|(stage, _)| *stage == chosen.settings.stage);
                self.evidence(&own.unwrap_or(&stages[*nearest]).1, &chosen, compared)
            }
        };
        let hypothesis = |guess: &Guess<'_>| Hypothesis {
            stage: guess.settings.stage,
            mistake: guess.settings.mistake.map(|(mistake, _)| mistake),
            error: guess.error,
        };
        let is_right = matches!(verdict, Verdict::Right | Verdict::Unfinished);
        let filter = filter.filter(|_| is_right);
        let finding = chosen.fitted.as_ref().map(|fitted| subject.finding(&fitted.number, &fitted.values));
        Grade {
            verdict,
            stage: chosen.settings.stage,
            mistake: chosen.settings.mistake.map(|(mistake, _)| mistake).filter(|_| verdict == Verdict::Mistaken),
            also,
            finding,
            left_over: if verdict == Verdict::Mistaken { self.judged(&chosen).regions } else { Vec::new() },
            regions,
            remarks: remark.iter().copied().chain(filter.map(|_| Remark::OtherFilter)).collect(),
            filter,
            hypotheses: guesses.iter().map(hypothesis).collect(),
            error: *right_error,
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
            finding: None,
            regions: Vec::new(),
            left_over: Vec::new(),
            remarks: Vec::new(),
            filter: None,
            hypotheses: Vec::new(),
            error,
            evidence: Vec::new(),
            left_out: self.left_out.clone(),
            compared,
            complete: false,
        }
    }

    /// The pixels at which a guess explains most of the difference, away from each other.
    fn evidence(&self, right: &[Shown], guess: &Guess<'_>, compared: &[u32]) -> Vec<EvidencePixel> {
        let shown = self.shown(guess, compared);
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
        let pixel = |i: usize| {
            let [x, y] = at(i);
            let (column, row) = (left + x, top + y);
            let hit = self.first_hit(&self.seen, compared[i]);
            EvidencePixel {
                pixel: [column, row],
                object: hit.map(|hit| self.seen.world().object(&hit).name.clone()),
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
    stage >= mistake.first_stage() && !mistake.amounts().is_empty()
}

/// The place in a camera's picture, from its lower left corner, that a picture with exchanged rows and columns has at
/// a pixel.
fn transposed_place([x, y]: [u32; 2], [w, h]: [u32; 2], place: [f64; 2], amount: f64) -> [f64; 2] {
    // The column and the row from the top in the picture before it was transposed, and its size.
    let ([column, row], [own_w, own_h]) = match amount {
        form::EXCHANGED => ([y, x], [h, w]),
        form::COLUMN_BY_COLUMN => {
            let number = y * w + x;
            ([number / h, number % h], [w, h])
        }
        form::TURNED_LEFT => ([h - 1 - y, x], [h, w]),
        form::TURNED_RIGHT => ([y, w - 1 - x], [h, w]),
        _ => ([w - 1 - x, h - 1 - y], [w, h]),
    };
    let [u, v] = [f64::from(column) + place[0], f64::from(own_h - 1 - row) + place[1]];
    let [w, h, own_w, own_h] = [w, h, own_w, own_h].map(f64::from);
    // The window is as wide as that of a picture of the other size.
    let wider = (own_w / own_h) / (w / h);
    [((u / own_w - 0.5) * wider + 0.5) * w, v / own_h * h]
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
