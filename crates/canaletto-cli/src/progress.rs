//! Progress of a render on stderr, and of radiosity before it: a bar, lines of text, or lines of JSON.

use crate::failure::eprint_line;
use crate::format::{amount, count, duration, rate};
use crate::interrupt;
use canaletto::render::{Observer, Progress, SolvingPhase, SolvingProgress};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What --progress says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressFlag {
    /// A bar on a terminal, nothing elsewhere
    Auto,
    /// A bar on a terminal, lines of text elsewhere
    Bar,
    /// A line of text every two seconds
    Plain,
    /// One JSON object per line
    Json,
    /// Lines of Open Job Description, openjd_progress and openjd_status, which render farms read
    Openjd,
    /// Nothing
    None,
}

/// The form of progress messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    Silent,
    Bar,
    Plain,
    Json,
    Openjd,
}

impl Style {
    /// Evaluates the flags; `Auto` depends on stderr.
    pub(crate) fn new(flag: ProgressFlag, quiet: bool) -> Style {
        let terminal = std::io::stderr().is_terminal();
        match flag {
            _ if quiet => Style::Silent,
            ProgressFlag::Json => Style::Json,
            ProgressFlag::Openjd => Style::Openjd,
            ProgressFlag::None => Style::Silent,
            ProgressFlag::Plain => Style::Plain,
            ProgressFlag::Auto | ProgressFlag::Bar if terminal => Style::Bar,
            ProgressFlag::Auto => Style::Silent,
            ProgressFlag::Bar => Style::Plain,
        }
    }

    /// The minimum time between two messages.
    fn pause(self) -> Duration {
        Duration::from_millis(match self {
            Style::Plain | Style::Openjd => 2000,
            Style::Json => 200,
            Style::Silent | Style::Bar => 100,
        })
    }
}

/// Prints one event of `--progress json`.
pub(crate) fn emit(event: &impl Serialize) {
    if let Ok(line) = serde_json::to_string(event) {
        eprint_line(&line);
    }
}

/// Prints the progress of `--progress openjd`: the share of the work in percent, if it is known, and words. A line has
/// no more than 1,024 characters.
pub(crate) fn print_openjd(percent: Option<f64>, words: &str) {
    if let Some(percent) = percent {
        eprint_line(&format!("openjd_progress: {:.1}", percent.clamp(0.0, 100.0)));
    }
    eprint_line(&format!("openjd_status: {}", words.chars().take(1000).collect::<String>()));
}

/// The event "progress".
#[derive(Serialize)]
struct ProgressEvent {
    event: &'static str,
    frame: u32,
    pixels_done: u64,
    pixels: u64,
    percent: f64,
    rays: u64,
    rays_per_second: f64,
    seconds: f64,
    seconds_left: f64,
    frames_done: u64,
    frames_total: u64,
    seconds_left_in_all: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<f32>,
}

/// The event "solving".
#[derive(Serialize)]
struct SolvingEvent {
    event: &'static str,
    frame: u32,
    phase: &'static str,
    patches: u64,
    links: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    round: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rounds: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bounce: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    step: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unsent: Option<f64>,
    seconds: f64,
}

impl SolvingEvent {
    fn new(frame: u32, progress: &SolvingProgress, seconds: f64) -> SolvingEvent {
        let SolvingProgress { phase, patches, links, .. } = *progress;
        let (mut round, mut rounds, mut bounce, mut step, mut unsent) = (None, None, None, None, None);
        match phase {
            SolvingPhase::Links { round: this, rounds: all } | SolvingPhase::Guiding { round: this, rounds: all } => {
                (round, rounds) = (Some(this), Some(all));
            }
            SolvingPhase::Balance { bounce: this } => bounce = Some(this),
            SolvingPhase::Shooting { step: this, unsent: share } => (step, unsent) = (Some(this), Some(share)),
            SolvingPhase::Mistakes { step: this, .. } | SolvingPhase::Numbers { step: this } => step = Some(this),
            _ => {}
        }
        let phase = phase.name();
        SolvingEvent { event: "solving", frame, phase, patches, links, round, rounds, bounce, step, unsent, seconds }
    }
}

/// A line about the progress of radiosity, of path guiding or of grading, for people.
fn solving_words(progress: &SolvingProgress) -> String {
    let SolvingProgress { phase, patches, links, .. } = *progress;
    let (patches, links) = (format!("patches {}", count(patches)), format!("links {}", amount(links)));
    match phase {
        SolvingPhase::Patches => "radiosity: cutting surfaces into patches".into(),
        SolvingPhase::Lights => format!("radiosity: {patches}, light of lamps and sky"),
        SolvingPhase::Links { round, rounds } => {
            format!("radiosity: {patches}, {links}, round {round} of {rounds}")
        }
        SolvingPhase::Balance { bounce } => format!("radiosity: {patches}, {links}, bounce {bounce}"),
        SolvingPhase::Shooting { step, unsent } => {
            format!("radiosity: {patches}, step {}, {:.1}% unsent", count(step), unsent * 100.0)
        }
        SolvingPhase::Guiding { round, rounds } => {
            format!("guiding: learning where light comes from, round {round} of {rounds}")
        }
        SolvingPhase::Mistakes { step, steps } => format!("mistakes: {} of {}", count(step), count(steps)),
        SolvingPhase::Numbers { step } => format!("fits the scene's numbers: picture {}", count(step)),
        _ => format!("radiosity: {patches}"),
    }
}

/// All frames of a run, for the estimate of the time left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunProgress {
    /// The number of frames.
    pub frames: u64,
    /// The number of complete frames.
    pub done: u64,
    /// The number of these that this run rendered, and the time for them.
    pub rendered: u64,
    pub spent: Duration,
}

impl RunProgress {
    /// A run of one frame.
    pub(crate) const SINGLE: RunProgress = RunProgress { frames: 1, done: 0, rendered: 0, spent: Duration::ZERO };

    /// The share of all frames that is done, with a share of this frame.
    fn share(&self, of_frame: f64) -> f64 {
        (self.done as f64 + of_frame) / self.frames.max(1) as f64
    }

    /// The seconds left for all frames, with `share` of a frame rendered in `seconds`. Each frame left is taken to need
    /// the average time so far.
    fn left(&self, share: f64, seconds: f64) -> f64 {
        let each = (self.spent.as_secs_f64() + seconds) / (self.rendered as f64 + share);
        each * ((self.frames - self.done) as f64 - share).max(0.0)
    }
}

/// Shows the progress of one render.
pub(crate) struct ProgressDisplay {
    style: Style,
    frame: u32,
    label: String,
    whole: RunProgress,
    start: Instant,
    bar: Option<ProgressBar>,
    state: Mutex<State>,
}

/// A picture in the making after a pass of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassState {
    /// The number of samples of each pixel that still needed some.
    pub samples: u32,
    /// The noise that is asked for, and the present one.
    pub noise: Option<(f32, f32)>,
    /// The time that is asked for.
    pub limit: Option<Duration>,
}

impl PassState {
    /// The share of the work that is done, if it doesn't end with a number of samples. The error falls as the root of
    /// the number of samples.
    fn share(&self, seconds: f64) -> Option<f64> {
        let by_time = self.limit.map(|limit| seconds / limit.as_secs_f64());
        let square = |v: f64| v * v;
        let by_noise = self.noise.map(|(asked, noise)| square(f64::from(asked / noise)));
        let by_noise = by_noise.filter(|share| share.is_finite());
        let share = by_time.into_iter().chain(by_noise).reduce(f64::max)?;
        Some(share.clamp(1e-6, 1.0))
    }

    fn words(&self) -> String {
        let noise = self.noise.filter(|(_, noise)| noise.is_finite());
        let noise = noise.map_or_else(String::new, |(asked, noise)| format!(", noise {noise:.3} of {asked}"));
        format!("{} samples{noise}, ", count(self.samples.into()))
    }
}

struct State {
    /// The last pass of samples.
    pass: Option<PassState>,
    last: Instant,
    pixels_done: u64,
    /// The name of the phase of solving, and the time of its last report. Pixels begin after that.
    phase: &'static str,
    solved: Instant,
}

impl ProgressDisplay {
    /// Starts the progress display. `label` names the frame and the number of frames, if there are several.
    pub(crate) fn begin(style: Style, frame: u32, label: String, pixels: u64, whole: RunProgress) -> ProgressDisplay {
        let bar = (style == Style::Bar).then(|| {
            let bar = ProgressBar::new(pixels);
            // Only an invalid template fails, and a test below uses this one.
            if let Ok(look) = ProgressStyle::with_template(TEMPLATE) {
                bar.set_style(look.progress_chars("=> "));
            }
            bar.set_prefix(label.clone());
            bar
        });
        let now = Instant::now();
        ProgressDisplay {
            style,
            frame,
            label,
            whole,
            start: now,
            bar,
            state: Mutex::new(State { pass: None, last: now, pixels_done: 0, phase: "", solved: now }),
        }
    }

    /// Takes note of a pass of samples.
    pub(crate) fn passed(&self, pass: PassState) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).pass = Some(pass);
    }

    /// Tells lines about the whole run, between its progress.
    pub(crate) fn tell(&self, lines: &[String]) {
        match (&self.bar, self.style) {
            (Some(bar), _) => bar.suspend(|| lines.iter().for_each(|line| eprint_line(line))),
            (None, Style::Plain) => lines.iter().for_each(|line| eprint_line(&format!("{}{line}", self.label))),
            _ => {}
        }
    }

    /// Clears the bar and returns the time that the render took.
    pub(crate) fn finish(self) -> Duration {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        self.start.elapsed()
    }
}

const TEMPLATE: &str = "{prefix}[{bar:30}] {percent:>3}%  {msg}";

impl Observer for ProgressDisplay {
    fn cancelled(&self) -> bool {
        interrupt::stops()
    }

    fn solving(&self, progress: &SolvingProgress) {
        if self.style == Style::Silent {
            return;
        }
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.solved = Instant::now();
        // Programs hear of every phase, however short.
        let is_new = self.style == Style::Json && state.phase != progress.phase.name();
        if !is_new && state.last.elapsed() < self.style.pause() {
            return;
        }
        (state.last, state.phase) = (Instant::now(), progress.phase.name());
        let words = || format!("{}, {}", solving_words(progress), duration(self.start.elapsed()));
        match self.style {
            Style::Silent => {}
            Style::Openjd => print_openjd(None, &format!("{}{}", self.label, words())),
            Style::Json => emit(&SolvingEvent::new(self.frame, progress, self.start.elapsed().as_secs_f64())),
            Style::Plain => eprint_line(&format!("{}{}", self.label, words())),
            Style::Bar => {
                if let Some(bar) = &self.bar {
                    bar.set_message(words());
                }
            }
        }
    }

    fn progress(&self, progress: &Progress) {
        if self.style == Style::Silent {
            return;
        }
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        // Threads may arrive here in another order than they finished.
        if progress.pixels_done <= state.pixels_done || state.last.elapsed() < self.style.pause() {
            return;
        }
        (state.last, state.pixels_done) = (Instant::now(), progress.pixels_done);
        let seconds = state.solved.elapsed().as_secs_f64().max(1e-9);
        let pass = state.pass;
        let share = pass.and_then(|pass| pass.share(seconds));
        let share = share.unwrap_or(progress.pixels_done as f64 / progress.pixels as f64);
        let event = ProgressEvent {
            event: "progress",
            frame: self.frame,
            pixels_done: progress.pixels_done,
            pixels: progress.pixels,
            percent: (share * 1000.0).round() / 10.0,
            rays: progress.rays,
            rays_per_second: (progress.rays as f64 / seconds).round(),
            seconds: self.start.elapsed().as_secs_f64(),
            seconds_left: seconds * (1.0 - share) / share,
            frames_done: self.whole.done,
            frames_total: self.whole.frames,
            seconds_left_in_all: self.whole.left(share, seconds),
            samples: pass.map(|pass| pass.samples),
            noise: pass.and_then(|pass| pass.noise).map(|(_, noise)| noise).filter(|noise| noise.is_finite()),
        };
        let made = pass.map_or_else(String::new, |pass| pass.words());
        let speed = rate(event.rays_per_second);
        let time = |seconds: f64| duration(Duration::from_secs_f64(seconds.clamp(0.0, 1e9)));
        let left = match self.whole.frames {
            1 => format!("{} left", time(event.seconds_left)),
            _ => format!("{} left, {} in all", time(event.seconds_left), time(event.seconds_left_in_all)),
        };
        match self.style {
            Style::Silent => {}
            Style::Json => emit(&event),
            Style::Openjd => {
                print_openjd(Some(100.0 * self.whole.share(share)), &format!("{}{made}{speed}, {left}", self.label));
            }
            Style::Plain => eprint_line(&format!("{}{:.0}%, {made}{speed}, {left}", self.label, event.percent)),
            Style::Bar => {
                if let Some(bar) = &self.bar {
                    bar.set_position((share * progress.pixels as f64) as u64);
                    bar.set_message(format!("{made}{speed}, {left}"));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_has_a_look() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }

    #[test]
    fn time_left_in_all() {
        let whole = RunProgress { frames: 10, done: 5, rendered: 2, spent: Duration::from_secs(20) };
        assert_eq!(whole.share(0.5), 0.55);
        // Two and a half frames took 25 seconds; the 4½ frames left take 45.
        assert_eq!(whole.left(0.5, 5.0), 45.0);
    }

    #[test]
    fn radiosity_is_told_in_words() {
        let told = |phase| solving_words(&SolvingProgress { phase, patches: 12_345, links: 1_234_567 });
        assert_eq!(
            told(SolvingPhase::Links { round: 2, rounds: 4 }),
            "radiosity: patches 12,345, links 1.2 M, round 2 of 4"
        );
        assert_eq!(
            told(SolvingPhase::Shooting { step: 1024, unsent: 0.1234 }),
            "radiosity: patches 12,345, step 1,024, 12.3% unsent"
        );
        assert_eq!(told(SolvingPhase::Mistakes { step: 7, steps: 1024 }), "mistakes: 7 of 1,024");
        assert_eq!(told(SolvingPhase::Numbers { step: 2048 }), "fits the scene's numbers: picture 2,048");
    }

    #[test]
    fn quiet_is_silent() {
        assert_eq!(Style::new(ProgressFlag::Json, true), Style::Silent);
        assert_eq!(Style::new(ProgressFlag::Json, false), Style::Json);
    }
}
