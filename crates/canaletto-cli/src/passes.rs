//! Pictures that grow by passes of samples: how long they do, and what is seen of them meanwhile.

use crate::failure::Failure;
use crate::format::{count, duration, plural};
use crate::interrupt;
use crate::noise_outlook::Outlook;
use crate::preview::{PreviewFile, warn_unwritten};
use crate::progress::{PassState, ProgressDisplay, Style, emit};
use crate::settings::not_progressive;
use canaletto::film::{Checkpoint, SampleBlocks, SampleStatistics};
use canaletto::render::{Job, Observer, PassProgress, Progress, Rendering, SolvingProgress};
use canaletto::scene::{SamplerKind, Sampling};
use canaletto::world::World;
use clap::Args;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Flags about passes of samples.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct PassFlags {
    /// Renders a growing picture for about this time: as many passes of samples as fit, at least one
    ///
    /// The time is one of rendering, such as 60s, 5min or 1h30min. Reading, building and writing come on top. --samples
    /// is then the most that a pixel gets; without it there is no other end. The number of samples depends on the
    /// machine. A picture of equally many samples has the same bytes on all.
    #[arg(long, value_name = "TIME", value_parser = time, help_heading = "Sampling")]
    pub time: Option<Duration>,

    /// Renders a growing picture until its noise is below this, such as 0.02: pixels get as many samples as they need
    ///
    /// The noise is the relative error of a block of 8 x 8 pixels: the root of the mean square error, divided by the
    /// block's brightness. In blocks darker than a tenth of the picture's middle one that tenth counts. It is estimated
    /// by the two halves of each pixel's samples, and the standard error of the mean square is added. A block stops
    /// after 64 samples or more, when it and its eight neighbours are good enough. --samples is the most that a pixel
    /// gets.
    #[arg(long, allow_hyphen_values = true, value_name = "ERROR", value_parser = positive, help_heading = "Sampling")]
    pub noise: Option<f32>,

    /// Makes samples brighter than this darker, and says how much light that takes away [default: none]
    ///
    /// It is for single bright pixels (fireflies) in pictures by paths. What is removed is missing: the picture is
    /// darker than it should be, most where light is found by chance, as in caustics.
    #[arg(long, allow_hyphen_values = true, value_name = "VALUE", value_parser = positive, help_heading = "Sampling")]
    pub clamp: Option<f32>,

    /// Goes on with the samples of a growing picture, an EXR of 32 bits, up to the number of --samples
    ///
    /// The bytes are those of a picture that is made at once. The file may be finished, or the part of an interrupted
    /// render. The scene, the seed, the size and all else that the samples depend on must be the same.
    #[arg(long = "continue", value_name = "FILE", conflicts_with = "frames", help_heading = "Sampling")]
    pub continue_from: Option<PathBuf>,

    /// Sets the number of each pixel's first sample [default: 0]
    ///
    /// Pictures of samples 0 to 31 and 32 to 63 have the picture of 64 samples as their mean.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, hide_short_help = true,
        value_parser = clap::value_parser!(u32).range(0..i64::from(Sampling::MAX_SAMPLES)), help_heading = "Sampling")]
    pub first_sample: u32,
}

/// The parser of a length of time.
pub(crate) fn time(text: &str) -> Result<Duration, String> {
    let expected = || "write a time such as 60s, 5min or 1h30min".to_owned();
    let (mut rest, mut seconds) = (text.trim(), 0.0);
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let number: f64 = rest[..digits].parse().map_err(|_| expected())?;
        let unit_end = rest[digits..].find(|c: char| c.is_ascii_digit()).map_or(rest.len(), |end| digits + end);
        seconds += number
            * match rest[digits..unit_end].trim() {
                "ms" => 1e-3,
                "" | "s" => 1.0,
                "m" | "min" => 60.0,
                "h" => 3600.0,
                _ => return Err(expected()),
            };
        rest = &rest[unit_end..];
    }
    match Duration::try_from_secs_f64(seconds) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err(expected()),
    }
}

fn positive(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("write a number above 0".into()),
    }
}

impl PassFlags {
    /// The first of the flags that is given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let given = [
            (self.time.is_some(), "--time"),
            (self.noise.is_some(), "--noise"),
            (self.clamp.is_some(), "--clamp"),
            (self.continue_from.is_some(), "--continue"),
            (self.first_sample > 0, "--first-sample"),
        ];
        given.into_iter().find(|(given, _)| *given).map(|(_, flag)| flag)
    }

    /// The job with these flags. `samples` is the value of --samples.
    pub(crate) fn apply(&self, mut job: Job, samples: Option<u32>) -> Result<Job, Failure> {
        let Some(flag) = self.given() else { return Ok(job) };
        let ends_by_itself = self.time.is_some() || self.noise.is_some();
        if ends_by_itself && samples.is_none() && matches!(job.film.sampling, Sampling::Sampled(_) | Sampling::Center) {
            job.film.sampling = Sampling::Sampled(Sampling::MAX_SAMPLES - self.first_sample);
        }
        job = growing(job, flag)?;
        if self.time.is_some() && job.film.sampler == SamplerKind::BlueNoise {
            return Err(Failure::usage("--time: the blue-noise sampler needs to know the number of samples first")
                .help("leave --sampler out, or give --samples instead"));
        }
        (job.noise, job.clamp, job.first_sample) = (self.noise, self.clamp, self.first_sample);
        job.check().map_err(|error| Failure::usage(format!("{flag}: {error}")))?;
        Ok(job)
    }

    /// The texts of files that tell of these flags.
    pub(crate) fn texts(&self) -> Vec<(String, String)> {
        let time = self.time.map(|time| format!("{} s", time.as_secs_f64()));
        let texts = [
            ("time", time),
            ("noise", self.noise.map(|noise| noise.to_string())),
            ("clamp", self.clamp.map(|clamp| clamp.to_string())),
            ("first-sample", (self.first_sample > 0).then(|| self.first_sample.to_string())),
        ];
        texts.into_iter().filter_map(|(key, text)| Some((key.to_owned(), text?))).collect()
    }
}

/// The job as one of a growing picture, which a flag asks for.
pub(crate) fn growing(mut job: Job, flag: &str) -> Result<Job, Failure> {
    job.progressive = true;
    job.passes().map_err(|why| not_progressive(flag, why))?;
    Ok(job)
}

/// Warnings about the samples of a picture.
pub(crate) fn sample_warnings(statistics: &SampleStatistics, job: &Job, is_complete: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    if statistics.non_finite > 0 {
        let places = statistics.non_finite_samples.iter().take(3);
        let places: Vec<String> =
            places.map(|place| format!("sample {} of pixel {},{}", place.sample, place.x, place.y)).collect();
        let others = if statistics.non_finite > 3 { ", ..." } else { "" };
        warnings.push(format!(
            "{} infinite or not a number and counted as black: {}{others}",
            match statistics.non_finite {
                1 => "1 sample was".to_owned(),
                n => format!("{} samples were", count(n)),
            },
            places.join(", ")
        ));
    }
    if let Some(clamp) = job.clamp.filter(|_| statistics.clamped > 0) {
        warnings.push(format!(
            "--clamp {clamp} removed {:.2}% of the picture's light, from {}",
            statistics.removed_share() * 100.0,
            plural(statistics.clamped, "sample")
        ));
    }
    if let (Some(asked), Some(noise)) = (job.noise, statistics.noise)
        && is_complete
        && noise > asked
    {
        let noise = if noise.is_finite() { format!("{noise:.3}") } else { "unknown".to_owned() };
        warnings.push(format!(
            "the noise of the worst block is {noise}, not {asked}: its pixels have {} samples",
            count(statistics.most.into())
        ));
    }
    warnings
}

/// What a picture that missed the noise it was asked for, or was stopped, tells of its noise: how long it would have
/// taken, after `seconds` of rendering, where the noise is, and what a clamp would take away.
pub(crate) fn noise_left(
    rendering: &Rendering,
    outlook: OutlookTime<'_>,
    seconds: f64,
) -> Option<(Vec<String>, Value)> {
    let OutlookTime { world, job, made_before, .. } = outlook;
    let statistics = rendering.statistics.as_ref()?;
    let asked = job.noise.zip(statistics.noise);
    let has_missed = asked.is_some_and(|(asked, noise)| noise.is_nan() || noise > asked);
    if rendering.complete && !has_missed {
        return None;
    }
    let outlook = Outlook::new(statistics.outlook.clone()?, asked, world, job);
    let seconds_left = outlook.seconds_left(seconds, made_before);
    let mut lines: Vec<String> = seconds_left.map(|left| outlook.time_words(left)).into_iter().collect();
    lines.extend(outlook.noise_words());
    Some((lines, outlook.json()))
}

/// What takes the checkpoints of a render.
pub(crate) trait TakesCheckpoints: Sync {
    /// Whether one is due. The caller that hears true makes it.
    fn is_due(&self) -> bool;

    /// Takes a checkpoint that was due.
    fn take(&self, checkpoint: &Checkpoint);
}

/// The observer of a render that may be made in passes.
pub(crate) struct PassObserver<'a> {
    display: &'a ProgressDisplay,
    style: Style,
    frame: u32,
    limit: Option<Duration>,
    noise: Option<f32>,
    preview: Option<PreviewFile<'a>>,
    is_quiet: bool,
    outlook: OutlookTime<'a>,
    checkpoints: Option<&'a dyn TakesCheckpoints>,
    state: Mutex<PassTimes>,
}

/// When a render tells how long it will be.
#[derive(Clone, Copy)]
pub(crate) struct OutlookTime<'a> {
    pub world: &'a World,
    pub job: &'a Job,
    /// The number of samples of all pixels that a continued picture had already.
    pub made_before: f64,
    /// The time after which it is told, once.
    pub after: Duration,
    /// The time of rendering before the checkpoint that was taken up.
    pub spent_before: Duration,
}

impl<'a> OutlookTime<'a> {
    /// After a minute.
    pub(crate) fn new(
        world: &'a World,
        job: &'a Job,
        start: Option<&SampleBlocks>,
        spent_before: Duration,
    ) -> OutlookTime<'a> {
        let made_before = start.map_or(0.0, |start| start.counts().iter().map(|count| f64::from(*count)).sum());
        OutlookTime { world, job, made_before, after: Duration::from_secs(60), spent_before }
    }

    /// Whether a pass that ends now may be the last one before that time. Passes at most double the samples.
    fn is_near(&self, elapsed: Duration) -> bool {
        elapsed.mul_f64(2.5) >= self.after
    }
}

/// The times of passes.
struct PassTimes {
    start: Instant,
    /// The end of the last pass, and the number of samples then.
    last: Instant,
    samples: u32,
    /// The time of the last preview.
    shown: Option<Instant>,
    /// Whether a preview couldn't be written.
    has_failed: bool,
    /// What will be told after a while, with the seconds that were left at the end of the last pass and those of the
    /// run then.
    outlook: Option<(Outlook, [f64; 2])>,
    has_told: bool,
}

/// The shortest time between two previews.
const PREVIEW_PAUSE: Duration = Duration::from_millis(500);

impl<'a> PassObserver<'a> {
    pub(crate) fn new(
        display: &'a ProgressDisplay,
        style: Style,
        frame: u32,
        flags: &PassFlags,
        preview: Option<PreviewFile<'a>>,
        is_quiet: bool,
        outlook: OutlookTime<'a>,
    ) -> PassObserver<'a> {
        let now = Instant::now();
        let state = Mutex::new(PassTimes {
            start: now.checked_sub(outlook.spent_before).unwrap_or(now),
            last: now,
            samples: 0,
            shown: None,
            has_failed: false,
            outlook: None,
            has_told: false,
        });
        let (limit, noise, checkpoints) = (flags.time, flags.noise, None);
        PassObserver { display, style, frame, limit, noise, preview, is_quiet, outlook, checkpoints, state }
    }

    /// Makes checkpoints.
    pub(crate) fn with_checkpoints(self, checkpoints: Option<&'a dyn TakesCheckpoints>) -> PassObserver<'a> {
        PassObserver { checkpoints, ..self }
    }

    /// Takes note of what is left after a pass.
    fn look_ahead(&self, state: &mut PassTimes, pass: &PassProgress<'_>, elapsed: f64) {
        let outlook = Outlook::new(pass.outlook(), self.noise.zip(pass.noise), self.outlook.world, self.outlook.job);
        let OutlookTime { job, made_before, .. } = self.outlook;
        let [before, samples] = [made_before / pass.picture.pixels.len() as f64, f64::from(pass.samples)];
        let more = (f64::from(job.film.sampling.count()) - samples).max(0.0);
        let by_samples = elapsed / (samples - before).max(1.0) * more;
        let left = outlook.seconds_left(elapsed, made_before).unwrap_or(by_samples);
        let left = self.limit.map_or(left, |limit| left.min((limit.as_secs_f64() - elapsed).max(0.0)));
        state.outlook = Some((outlook, [left, elapsed]));
    }

    /// How long it will be, where the noise is and what a clamp would take away, for people and for programs: once,
    /// after a while.
    fn due_outlook(&self) -> Option<(Vec<String>, Value)> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let elapsed = state.start.elapsed();
        if state.has_told || elapsed < self.outlook.after {
            return None;
        }
        let (outlook, [left, then]) = state.outlook.take()?;
        state.has_told = true;
        let left = (left - (elapsed.as_secs_f64() - then)).max(0.0);
        let mut lines = vec![format!("after {}: {}", duration(elapsed), outlook.time_words(left))];
        lines.extend(outlook.noise_words());
        let mut event = json!({
            "event": "outlook", "frame": self.frame, "seconds": elapsed.as_secs_f64(), "seconds_left": left,
        });
        if let (Some(event), Value::Object(fields)) = (event.as_object_mut(), outlook.json()) {
            event.extend(fields);
        }
        Some((lines, event))
    }
}

impl Observer for PassObserver<'_> {
    fn cancelled(&self) -> bool {
        self.display.cancelled()
    }

    fn progress(&self, progress: &Progress) {
        self.display.progress(progress);
        match (self.due_outlook(), self.style) {
            (Some((_, event)), Style::Json) => emit(&event),
            (Some((lines, _)), _) => self.display.tell(&lines),
            (None, _) => {}
        }
    }

    fn solving(&self, progress: &SolvingProgress) {
        self.display.solving(progress);
    }

    fn wants_checkpoint(&self) -> bool {
        self.checkpoints.is_some_and(TakesCheckpoints::is_due)
    }

    fn checkpoint(&self, checkpoint: &Checkpoint) {
        if let Some(checkpoints) = self.checkpoints {
            checkpoints.take(checkpoint);
        }
    }

    fn pass_ended(&self, pass: &PassProgress<'_>) -> ControlFlow<()> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (now, elapsed) = (Instant::now(), state.start.elapsed());
        if self.style == Style::Json {
            emit(&json!({
                "event": "pass", "frame": self.frame, "samples": pass.samples, "next": pass.next,
                "pixels_left": pass.pixels_left, "noise": pass.noise.filter(|noise| noise.is_finite()),
                "seconds": elapsed.as_secs_f64(),
            }));
        }
        let asked = self.noise.zip(pass.noise);
        self.display.passed(PassState { samples: pass.samples, noise: asked, limit: self.limit });
        let is_told = self.style == Style::Silent || state.has_told;
        if !is_told && pass.next.is_some() && self.outlook.is_near(elapsed) {
            self.look_ahead(&mut state, pass, elapsed.as_secs_f64());
        }
        if let Some(preview) = &self.preview
            && pass.next.is_some()
            && !state.has_failed
            && state.shown.is_none_or(|shown| shown.elapsed() > PREVIEW_PAUSE)
        {
            if let Err(failure) = preview.write(pass.picture, pass.samples) {
                warn_unwritten("--preview", &failure, self.style, self.is_quiet);
                state.has_failed = true;
            }
            state.shown = Some(Instant::now());
        }
        // The next pass takes as long for each sample as the last one did.
        let (seconds, made) = ((now - state.last).as_secs_f64(), f64::from(pass.samples - state.samples).max(1.0));
        (state.last, state.samples) = (Instant::now(), pass.samples);
        let (Some(limit), Some(next)) = (self.limit, pass.next) else { return ControlFlow::Continue(()) };
        let needed = seconds / made * f64::from(next - pass.samples);
        let fits = state.start.elapsed().as_secs_f64() + needed <= limit.as_secs_f64();
        if fits && !interrupt::stops() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::RunProgress;
    use canaletto::camera::Camera;
    use canaletto::render::render;
    use canaletto_io::assets::MemoryAssets;
    use canaletto_io::text::read_scene;

    /// Collects what is told after each pass.
    struct Told<'a>(PassObserver<'a>, Mutex<Vec<(Vec<String>, Value)>>);

    impl Observer for Told<'_> {
        fn pass_ended(&self, pass: &PassProgress<'_>) -> ControlFlow<()> {
            let answer = self.0.pass_ended(pass);
            self.1.lock().unwrap().extend(self.0.due_outlook());
            answer
        }
    }

    /// A ball under a small strong lamp, before an even wall.
    #[test]
    fn a_long_render_tells_of_its_noise_once() {
        let text = r#"
            camera { eye 0 0 5; center 0 0 0; fovy 40; size 32 24 }
            integrator "path"
            material "grey" { kd 0.5 }
            material "lamp" { kd 0; emission 3000 }
            material "mirror" { kd 0; ks 0; k 0.9 }
            sphere name="ball" material="mirror" { center 0 0 0; radius 0.8 }
            box name="wall" material="grey" { min -9 -9 -3; max 9 9 -2 }
            sphere material="lamp" { center 2 3 6; radius 0.05 }
        "#;
        let scene = read_scene("s.kdl", &MemoryAssets::new().with("s.kdl", text)).unwrap().0;
        let world = World::build(scene.clone()).unwrap();
        let mut job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
        (job.noise, job.film.sampling) = (Some(1e-4), Sampling::Sampled(128));
        let flags = PassFlags { noise: job.noise, ..PassFlags::default() };
        let display = ProgressDisplay::begin(Style::Silent, 0, String::new(), 32 * 24, RunProgress::SINGLE);
        for (after, times) in [(Duration::ZERO, 1), (Duration::from_secs(3600), 0)] {
            let outlook = OutlookTime { after, ..OutlookTime::new(&world, &job, None, Duration::ZERO) };
            let observer = PassObserver::new(&display, Style::Plain, 0, &flags, None, false, outlook);
            let observer = Told(observer, Mutex::default());
            let rendering = render(&world, &job, &observer).unwrap();
            let told = observer.1.into_inner().unwrap();
            assert_eq!(told.len(), times, "{told:?}");
            let (lines, json) = noise_left(&rendering, outlook, 1.0).unwrap();
            let text = lines.join("\n");
            for part in ["the noise is ", "0.0001 would take about ", "they get 128", "--clamp 10 would take away "] {
                assert!(text.contains(part), "{text}");
            }
            assert!(text.contains(" of the pixels hold 5") && text.contains('"'), "{text}");
            assert!(json["out_of_reach"] == true && json["noisiest"]["objects"][0]["share"].as_f64() > Some(0.1));
            assert!(told.iter().all(|(_, event)| event["event"] == "outlook" && event["seconds_left"].is_number()));
        }
    }

    #[test]
    fn times_have_units() {
        for (text, seconds) in [
            ("60s", 60.0),
            ("90", 90.0),
            ("5min", 300.0),
            ("5m", 300.0),
            ("1h30min", 5400.0),
            ("1.5h", 5400.0),
            ("250ms", 0.25),
        ] {
            assert_eq!(time(text), Ok(Duration::from_secs_f64(seconds)), "{text}");
        }
        for text in ["", "0s", "soon", "5 years", "-3s", "1e9999h", "s"] {
            assert!(time(text).unwrap_err().contains("60s"), "{text}");
        }
    }

    #[test]
    fn numbers_are_above_zero() {
        assert_eq!(positive("0.02"), Ok(0.02));
        for text in ["0", "-1", "nan", "inf", "x"] {
            assert!(positive(text).is_err(), "{text}");
        }
    }
}
