//! The frames of a render, in order. Complete frames are kept; the others are rendered and written.

mod frame;

use frame::Prepared;

use super::frame_writer::FrameWriter;
use super::{Plan, RenderFlags};
use crate::backdrop::BackgroundFlag;
use crate::complete::{FINGERPRINT, is_complete, texts};
use crate::digest::Digest;
use crate::doubts::doubt_picture;
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::format::{count, duration, plural};
use crate::interrupt;
use crate::metering::{exposed, first_frame, is_metered, is_metered_elsewhere, meter};
use crate::omissions::{doubt_omissions, doubt_ray_trees};
use crate::output_format::Format;
use crate::part::{self, Cut, texts_of_part};
use crate::passes::growing;
use crate::preview::{Preview, previews};
use crate::progress::{ProgressDisplay, RunProgress, Style, emit, print_openjd};
use crate::report::{Report, Times};
use crate::sample_file::{is_part_of, scene_digest};
use crate::settings::{BACKGROUND, Settings, metadata, sampling_words};
use crate::solutions::{SolutionSource, Solutions, fingerprint};
use crate::source::{Reader, Source, build, seen_through};
use crate::terminal::Paint;
use crate::told_developing::METERED_EXPOSURE;
use canaletto::film::metered_exposure;
use canaletto::integrator::radiosity::SolutionFingerprint;
use canaletto::render::Job;
use canaletto::scene::{Sampling, Scene};
use canaletto::world::{ReuseCounts, World};
use canaletto_io::diagnostic::Diagnostics;
use serde_json::json;
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// Renders the frames of a plan.
pub(crate) struct Series<'a> {
    flags: &'a RenderFlags,
    plan: &'a Plan,
    reader: Reader,
    solutions: &'a mut Solutions,
    writer: FrameWriter<'a>,
    /// The warnings that were already printed.
    told: HashSet<String>,
    start: Instant,
    /// The stops that the exposure `auto` became, once they are metered.
    metered: Option<f32>,
    /// The number of rendered frames, the number of frames that were complete before, and the time for the former.
    rendered: u64,
    kept: u64,
    spent: Duration,
}

/// The state for a frame. If nothing moves, one state serves all frames.
struct FrameContext {
    camera: String,
    job: Job,
    /// The fingerprint of the scene, if radiosity makes the picture.
    fingerprint: Option<SolutionFingerprint>,
    /// The text entries of the files.
    texts: Vec<(String, String)>,
    /// The text entries by which files of --continue are compared with the scene.
    scene_digest: [(String, String); 2],
    times: Times,
    previews: Vec<Preview>,
    scene: Option<Scene>,
    world: Option<World>,
    /// The world of the previously rendered frame, whose hierarchies this frame may reuse.
    before: Option<World>,
    hierarchies: ReuseCounts,
}

/// An estimate of the rays of a picture: two for each camera ray.
fn rays(job: &Job) -> u64 {
    let [_, _, width, height] = job.window();
    let samples = match job.film.sampling {
        Sampling::Corner | Sampling::Center => 1,
        Sampling::Regular(n) | Sampling::Jittered(n) | Sampling::Adaptive { n, .. } => n * n,
        Sampling::Sampled(n) => n,
    };
    2 * u64::from(width) * u64::from(height) * u64::from(samples)
}

impl FrameContext {
    /// The text entries of a file with samples.
    fn texts_of_samples(&self) -> Vec<(String, String)> {
        let mut texts = self.texts.clone();
        let lacking = self.scene_digest.iter().filter(|(key, _)| self.texts.iter().all(|(own, _)| own != key));
        texts.extend(lacking.cloned());
        texts
    }

    /// The text entries of a part's file.
    fn texts_of_part(&self, cut: &Cut) -> Vec<(String, String)> {
        let mut texts = self.texts_of_samples();
        texts.extend(texts_of_part(cut, &self.texts, &self.job.aovs));
        texts
    }

    /// Sets the exposure that was metered, and notes it in the texts.
    fn expose(&mut self, stops: f32) {
        self.job = exposed(&self.job, stops);
        for preview in &mut self.previews {
            preview.job = exposed(&preview.job, stops);
        }
        self.texts.push((METERED_EXPOSURE.into(), stops.to_string()));
    }
}

/// A frame that was rendered.
struct RenderedFrame {
    report: Report,
    /// Whether the frame counts. Of many frames, a partial one is dropped.
    whole: bool,
}

impl<'a> Series<'a> {
    pub(crate) fn new(
        flags: &'a RenderFlags,
        plan: &'a Plan,
        reader: Reader,
        solutions: &'a mut Solutions,
    ) -> Result<Series<'a>, Failure> {
        let writer = FrameWriter::new(plan, &flags.output)?;
        Ok(Series {
            flags,
            plan,
            reader,
            solutions,
            writer,
            told: HashSet::new(),
            start: Instant::now(),
            metered: None,
            rendered: 0,
            kept: 0,
            spent: Duration::ZERO,
        })
    }

    /// Renders all frames. `first` is the scene at the first frame; its warnings are already printed.
    pub(crate) fn run(mut self, first: Source) -> Result<Exit, Failure> {
        let _rendering = interrupt::Rendering;
        if self.plan.frames.count() > 1 {
            interrupt::Rendering::begins(); // Finished frames are reported; those of a film are kept.
        }
        self.told.insert(first.warnings.to_string());
        let moves = self.reader.timeline().moves;
        let mut frame_context = self.frame_context(first)?;
        for frame in self.plan.frames.iter() {
            if interrupt::is_outdated() {
                return Ok(Exit::Interrupted);
            }
            if interrupt::requested() {
                return self.interrupted(None);
            }
            let begun = Instant::now();
            if moves && frame != self.plan.frames.first {
                let source = self.reader.at(frame)?;
                self.tell_of(&source.warnings);
                let before = frame_context.world.take().or(frame_context.before.take());
                frame_context = FrameContext { before, ..self.frame_context(source)? };
            }
            if self.keeps(&frame_context, frame)? {
                self.kept += 1;
                if self.plan.style == Style::Json {
                    emit(&json!({ "event": "skipped", "frame": frame, "files": self.plan.files(frame) }));
                }
                continue;
            }
            // No two worlds are there at once.
            if self.metered.is_none() && is_metered(&frame_context.job) && is_metered_elsewhere(&self.reader, frame) {
                let (first, job) = first_frame(&mut self.reader, (&self.flags.source, &self.flags.picture))?;
                self.metered = Some(meter(&self.reader.name, &first, &job, None)?);
            }
            if let Some(scene) = frame_context.scene.take() {
                let options = self.flags.source.build_options(rays(&frame_context.job));
                let options = seen_through(&frame_context.camera, &scene, options);
                let (world, time) = build(&self.reader.name, scene, &options, frame_context.before.take())?;
                (frame_context.hierarchies, frame_context.times.build) = (world.origins(), time.as_secs_f64());
                self.tell_of(&doubt_omissions(&self.reader.name, &world, &frame_context.job));
                if self.rendered == 0 && !self.flags.quiet {
                    self.tell_of(&doubt_picture(&self.reader.name, None, &world, &frame_context.job));
                    self.tell_of(&doubt_ray_trees(&self.reader.name, &world, &frame_context.job));
                }
                frame_context.world = Some(world);
            }
            let Some(world) = &frame_context.world else { continue };
            let metered = self.metered_stops(&frame_context, world, frame)?;
            if let Some(stops) = metered {
                frame_context.expose(stops);
            }
            let Some(world) = &frame_context.world else { continue };
            let RenderedFrame { report, whole } = self.frame(&frame_context, world, frame)?;
            if whole {
                self.rendered += 1;
                self.spent += begun.elapsed().saturating_sub(self.first_solve(&report));
            }
            if !report.complete && interrupt::is_outdated() {
                return Ok(Exit::Interrupted);
            }
            self.tell(&report, &frame_context.job);
            if !report.complete {
                return self.interrupted(Some(&report));
            }
            // The times of reading and building belong to this frame. If nothing moves, the next frames need neither.
            (frame_context.times.read, frame_context.times.build) = (0.0, 0.0);
            let ReuseCounts { kept, refitted, built } = frame_context.hierarchies;
            frame_context.hierarchies = ReuseCounts { kept: kept + refitted + built, ..ReuseCounts::default() };
        }
        self.finish()
    }

    /// Prints warnings, unless equal ones were printed for another frame.
    fn tell_of(&mut self, warnings: &Diagnostics) {
        if !self.flags.quiet && !warnings.is_empty() && self.told.insert(warnings.to_string()) {
            print_diagnostics(warnings, self.plan.style == Style::Json);
        }
    }

    /// Evaluates the settings of a scene at its frame.
    fn frame_context(&self, source: Source) -> Result<FrameContext, Failure> {
        let mut settings = Settings::new(&source.name, &source.scene, &self.flags.picture)?;
        let format = self.plan.output.format;
        if settings.job.film.alpha && !format.has_alpha() {
            let message = format!("{format} has no alpha, which a picture without a background needs");
            let able = Format::short_names(Format::has_alpha);
            return Err(
                Failure::usage(message).help(format!("{able} have it; --background scene shows the background"))
            );
        }
        let asked_for =
            [("--part", self.flags.parts.is_of_picture()), ("--checkpoint", self.flags.checkpoints.file().is_some())];
        for (flag, _) in asked_for.into_iter().filter(|(_, is_given)| *is_given) {
            settings.job = growing(settings.job, flag)?;
        }
        settings.job = self.flags.passes.apply(settings.job, self.flags.picture.samples)?;
        let mut texts = metadata(&self.flags.source, &settings);
        texts.extend(self.flags.passes.texts());
        if let Some(backdrop) = self.flags.picture.background.as_ref().and_then(BackgroundFlag::backdrop) {
            texts.push((BACKGROUND.into(), backdrop.word.clone()));
        }
        let job = Job { aovs: self.plan.aovs.clone(), tile: self.flags.tile, ..settings.job };
        if let Some(denoiser) = self.flags.denoiser() {
            texts.push(("denoiser".into(), denoiser.name().into()));
        }
        if self.plan.has_frames() {
            if self.reader.timeline().seconds {
                texts.push(("fps".into(), self.plan.rate.fps().to_string()));
            }
            let digest = Digest::of_program().with_files(&source.files).with(&self.flags.source.changes());
            texts.extend(scene_digest(&source.files, &self.flags.source.changes()).into_iter().take(1));
            texts.push((FINGERPRINT.into(), self.plan.output.digest(digest, &texts, &job).to_string()));
        } else if job.passes().is_ok() && self.plan.output.format.has_layers() {
            texts.extend(scene_digest(&source.files, &self.flags.source.changes()));
        }
        if self.flags.parts.is_of_picture() {
            part::check(&job)?;
        }
        let previews = match self.plan.preview.is_some() {
            true => previews(&source.name, &source.scene, &self.flags.picture, &job),
            false => Vec::new(),
        };
        let times = Times { read: source.time.as_secs_f64(), ..Times::default() };
        Ok(FrameContext {
            camera: settings.camera,
            fingerprint: fingerprint(&source.scene, &job),
            scene_digest: scene_digest(&source.files, &self.flags.source.changes()),
            job,
            texts,
            times,
            previews,
            scene: Some(source.scene),
            world: None,
            before: None,
            hierarchies: ReuseCounts::default(),
        })
    }

    /// Whether a frame is there already: its files exist, are complete and match what would be rendered. A frame of a
    /// film is then added to it.
    fn keeps(&mut self, frame_context: &FrameContext, frame: u32) -> Result<bool, Failure> {
        let output = &self.plan.output;
        if self.solutions.is_unsaved() {
            return Ok(false); // Solutions are written when a frame is rendered.
        }
        if self.flags.force || output.is_stdout() {
            return Ok(false);
        }
        let job = Job { frame, ..frame_context.job.clone() };
        if output.format.film().is_some() {
            return self.writer.add_kept(&job, &frame_context.texts);
        }
        if let Some(cut) = self.flags.parts.cut(&job)? {
            let file = self.plan.files(frame).swap_remove(0);
            return Ok(file.exists() && is_part_of(&file, &cut.of_job(&job), &frame_context.texts_of_part(&cut)));
        }
        if !self.plan.numbered {
            return Ok(false);
        }
        Ok(self.plan.files(frame).iter().enumerate().all(|(index, file)| {
            is_complete(
                file,
                &job,
                output,
                &texts(&frame_context.texts, &job, index.checked_sub(1).map(|layer| job.aovs[layer])),
            )
        }))
    }

    /// Whether finished frames of a film are kept by now. As with checkpoints, that is after a minute, or from the
    /// start if checkpoints are asked for.
    fn keeps_frames_of_films(&self) -> bool {
        self.plan.output.format.film().is_some() && self.flags.checkpoints.is_due(self.start.elapsed())
    }

    /// The stops of the frame's exposure, if it is `auto`. They are metered once, in the scene's first frame.
    fn metered_stops(
        &mut self,
        frame_context: &FrameContext,
        world: &World,
        frame: u32,
    ) -> Result<Option<f32>, Failure> {
        if !is_metered(&frame_context.job) {
            return Ok(None);
        }
        let stops = match self.metered {
            Some(stops) => stops,
            None => {
                // The first frame's random numbers: a series that is gone on with has the exposure that it began with.
                let small = Job { frame: self.reader.first_frame(), ..frame_context.job.metering() };
                let label = "exposure  ".to_owned();
                let pixels = u64::from(small.window()[2]) * u64::from(small.window()[3]);
                let watch = ProgressDisplay::begin(Style::Silent, frame, label, pixels, RunProgress::SINGLE);
                let rendered = self.rendering(frame_context, world, (&small, None), &watch, Prepared::default());
                watch.finish();
                metered_exposure(&rendered?.0.picture)
            }
        };
        self.metered = Some(stops);
        Ok(Some(stops))
    }

    /// Says once that radiosity is solved again for frames whose scene changes.
    fn tell_of_solves(&self, solution: Option<SolutionSource>) {
        let says = !self.flags.quiet && self.plan.style != Style::Json;
        if says
            && solution == Some(SolutionSource::Solved)
            && self.solutions.solves == 2
            && self.plan.frames.count() > 1
        {
            eprint_line("the scene changes between frames, so radiosity is solved again for each that differs");
        }
    }

    /// Reports that a frame is done.
    fn tell(&self, report: &Report, job: &Job) {
        match self.plan.style {
            Style::Json => emit(report),
            Style::Openjd if report.complete => {
                let done = 100.0 * (self.rendered + self.kept) as f64 / self.plan.frames.count() as f64;
                print_openjd(Some(done), &report.line());
            }
            _ if self.flags.quiet => {}
            _ if self.plan.frames.count() == 1 => eprint_line(&report.text(&sampling_words(&job.film))),
            _ if !report.complete => {}
            _ => {
                let done = self.rendered + self.kept;
                let left = self.spent.mul_f64((self.plan.frames.count() - done) as f64 / self.rendered.max(1) as f64);
                let left =
                    if done < self.plan.frames.count() { format!(", {} left", duration(left)) } else { String::new() };
                eprint_line(&format!("{}; {done} of {}{left}", report.line(), self.plan.frames.count()));
            }
        }
    }

    /// Finishes the run and gives the film its name.
    fn finish(self) -> Result<Exit, Failure> {
        let format = self.plan.output.format;
        self.writer.finish()?;
        let (rendered, kept, frames) = (self.rendered, self.kept, self.plan.frames.count());
        if self.plan.style == Style::Json {
            if frames == 1 && !self.plan.numbered {
                return Ok(Exit::Done);
            }
            emit(&json!({
                "event": "finished", "frames": frames, "rendered": rendered, "skipped": kept,
                "solves": self.solutions.solves,
                "seconds": self.start.elapsed().as_secs_f64(),
            }));
        } else if !self.flags.quiet && (frames > 1 || kept > 0) {
            let kept = match kept {
                0 => String::new(),
                n => format!(", {} complete before (--force renders all again)", count(n)),
            };
            let file = match format.film() {
                Some(_) => format!("{}: ", self.plan.output.path(0).display()),
                None => String::new(),
            };
            let time = duration(self.start.elapsed());
            let solved = match self.solutions.solves {
                0 => String::new(),
                1 => ", radiosity solved once".into(),
                n => format!(", radiosity solved {} times", count(n)),
            };
            eprint_line(&format!("{file}{} rendered{kept}{solved}, {time} in all", plural(rendered, "frame")));
        }
        Ok(Exit::Done)
    }

    /// Reports the result of an interrupted run and how to continue it. `report` is that of the interrupted frame, if
    /// there is one.
    fn interrupted(self, report: Option<&Report>) -> Result<Exit, Failure> {
        let (json, plan, done) = (self.plan.style == Style::Json, self.plan, self.rendered + self.kept);
        let (frames, format) = (plan.frames, plan.output.format);
        let paint = Paint::stderr().yellow("interrupted:");
        let kept = self.writer.kept_frames();
        let film_part = self.writer.finish_part()?;
        if json {
            if let Some(file) = film_part {
                emit(&json!({ "event": "interrupted", "frames": done, "files": [file] }));
            }
            return Ok(Exit::Interrupted);
        }
        let of = plural(frames.count(), "frame");
        eprint_line(&match report {
            _ if format.film().is_some() => format!(
                "{paint} {done} of {of} were rendered; {}{}",
                match film_part {
                    Some(file) => format!("{file} has them"),
                    None => "nothing is written".to_owned(),
                },
                match kept {
                    Some(folder) => format!("; the same command goes on with those in {}", folder.display()),
                    None => String::new(),
                }
            ),
            Some(report) if frames.count() == 1 => one_interrupted(&paint, report),
            _ => {
                let next = report.map(|report| report.frame).or_else(|| frames.iter().nth(done as usize));
                let next =
                    next.map_or_else(String::new, |next| format!("; the same command goes on with frame {next}"));
                let part = report.and_then(|report| Some((percent(report), report.files.first()?)));
                let part = part.map_or_else(String::new, |(share, file)| format!(", {file} has {share} of the next"));
                format!("{paint} {done} of {of} are complete{part}{next}")
            }
        });
        Ok(Exit::Interrupted)
    }
}

/// The rendered share of a picture in percent.
fn percent(report: &Report) -> String {
    match report.pixels_done * 100 / report.pixels.max(1) {
        0 => "less than 1%".to_owned(),
        n => format!("{n}%"),
    }
}

fn one_interrupted(paint: &str, report: &Report) -> String {
    if let (Some(samples), Some(file)) = (&report.samples, report.files.first())
        && samples.fewest > 0
    {
        let kept = report.files.iter().find(|file| file.ends_with(".exr"));
        let go_on = match (&report.checkpoint, kept) {
            (Some(checkpoint), _) => format!("; the same command goes on from {checkpoint}"),
            (None, Some(kept)) => format!("; --continue {kept} goes on with it"),
            (None, None) => String::new(),
        };
        return format!("{paint} each pixel has {}; {file} has the picture{go_on}", samples.words());
    }
    let percent = percent(report);
    match report.files.first() {
        Some(file) => {
            let file = if file == "-" { "the standard output" } else { file };
            if report.pixels_done == report.pixels {
                return format!("{paint} the picture is rendered, but isn't finished; {file} has it");
            }
            format!("{paint} {percent} of the picture is rendered; {file} has it, the rest is black")
        }
        None => format!("{paint} no part of the picture was finished, so nothing is written"),
    }
}
