//! The frames of a render, in order. Complete frames are kept; the others are rendered and written.

use super::frame_writer::{FramePicture, FrameWriter};
use super::{Plan, RenderFlags};
use crate::backdrop::BackgroundFlag;
use crate::checkpoint::{CheckpointPlace, CheckpointWriter, Found};
use crate::complete::{is_complete, texts};
use crate::denoiser::{self, Denoiser, blacken_uncovered, with_layers};
use crate::digest::Digest;
use crate::doubts::doubt_picture;
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::format::{JSON_VERSION, count, duration, plural};
use crate::interrupt;
use crate::metering::{exposed, first_frame, is_metered, is_metered_elsewhere, meter};
use crate::omissions::{doubt_omissions, doubt_ray_trees, shortfalls};
use crate::output::window;
use crate::output_format::Format;
use crate::part::{self, texts_of_part};
use crate::passes::{
    OutlookTime, PassObserver, add_part, add_samples, noise_left, sample_warnings, samples_of_file, scene_digest,
};
use crate::preview::{Preview, PreviewFile, previews, warn_unwritten};
use crate::progress::{ProgressDisplay, RunProgress, Style, emit};
use crate::report::{Report, SampleReport, Times};
use crate::settings::{BACKGROUND, Settings, metadata, not_progressive, sampling_words};
use crate::solutions::{SolutionSource, Solutions, fingerprint};
use crate::source::{Reader, Source, build, seen_through};
use crate::terminal::Paint;
use crate::told_developing::METERED_EXPOSURE;
use canaletto::film::{Checkpoint, metered_exposure};
use canaletto::integrator::radiosity::{RadiositySolution, SolutionFingerprint};
use canaletto::render::{Job, JobError, Observer, Preparation, Rendering, render_from};
use canaletto::scene::{Developing, Sampling, Scene};
use canaletto::world::{ReuseCounts, World};
use canaletto_io::diagnostic::Diagnostics;
use serde_json::json;
use std::collections::HashSet;
use std::sync::Arc;
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
    ) -> Series<'a> {
        Series {
            flags,
            plan,
            reader,
            solutions,
            writer: FrameWriter::new(plan),
            told: HashSet::new(),
            start: Instant::now(),
            metered: None,
            rendered: 0,
            kept: 0,
            spent: Duration::ZERO,
        }
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
            if self.keeps(&frame_context, frame) {
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
        if self.flags.parts.part.is_some() {
            settings.job.progressive = true;
            settings.job.passes().map_err(|why| not_progressive("--part", why))?;
        }
        if self.flags.checkpoints.file().is_some() {
            settings.job.progressive = true;
            settings.job.passes().map_err(|why| not_progressive("--checkpoint", why))?;
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
        if self.plan.numbered {
            if self.reader.timeline().seconds {
                texts.push(("fps".into(), self.plan.rate.fps().to_string()));
            }
            let digest = Digest::of_program().with_files(&source.files).with(&self.flags.source.changes());
            texts.push(("fingerprint".into(), self.plan.output.digest(digest, &texts, &job).to_string()));
        } else if job.passes().is_ok() && self.plan.output.format.has_layers() {
            texts.extend(scene_digest(&source.files, &self.flags.source.changes()));
        }
        if self.flags.parts.part.is_some() {
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

    /// Whether a frame's files exist, are complete and match what would be rendered.
    fn keeps(&self, frame_context: &FrameContext, frame: u32) -> bool {
        let output = &self.plan.output;
        if self.solutions.is_unsaved() {
            return false; // Solutions are written when a frame is rendered.
        }
        if self.flags.force || !self.plan.numbered || output.format.film().is_some() || output.is_stdout() {
            return false;
        }
        let job = Job { frame, ..frame_context.job.clone() };
        self.plan.files(frame).iter().enumerate().all(|(index, file)| {
            is_complete(
                file,
                &job,
                output,
                &texts(&frame_context.texts, &job, index.checked_sub(1).map(|layer| job.aovs[layer])),
            )
        })
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
                let rendered = self.rendering(frame_context, world, (&small, None), &watch);
                watch.finish();
                metered_exposure(&rendered?.0.picture)
            }
        };
        self.metered = Some(stops);
        Ok(Some(stops))
    }

    /// Renders a frame and writes it.
    fn frame(&mut self, frame_context: &FrameContext, world: &World, frame: u32) -> Result<RenderedFrame, Failure> {
        let plan = self.plan;
        let job = Job { frame, ..frame_context.job.clone() };
        let cut = self.flags.parts.cut(&job)?;
        let job = cut.map_or(job.clone(), |cut| cut.of_job(&job));
        let [_, _, width, height] = job.window();
        let pixels = u64::from(width) * u64::from(height);
        let threads = rayon::current_num_threads();
        let (first, last) = (plan.frames.first, plan.frames.last);
        let whole = RunProgress {
            frames: plan.frames.count(),
            done: self.rendered + self.kept,
            rendered: self.rendered,
            spent: self.spent,
        };
        if plan.style == Style::Json {
            emit(&json!({
                "event": "start", "version": JSON_VERSION, "scene": self.reader.name, "camera": frame_context.camera, "frame": frame,
                "frames": [first, last], "frames_done": whole.done, "frames_total": whole.frames,
                "size": [width, height], "pixels": pixels, "threads": threads, "files": plan.files(frame),
            }));
        }
        let label = if whole.frames > 1 || plan.numbered {
            format!("frame {frame} of {}  ", plan.frames)
        } else {
            String::new()
        };
        interrupt::Rendering::begins();
        let first_solution = self.previews(frame_context, world, &job)?;
        let mut texts_of_samples = frame_context.texts_of_samples();
        texts_of_samples.extend(cut.iter().flat_map(|cut| texts_of_part(cut, &frame_context.texts)));
        let mut place = self.checkpoint_place(&job);
        let found = match &mut place {
            Some(place) => self.checkpoint(place, (&job, &texts_of_samples))?,
            None => None,
        };
        let continued = match (&found, &self.flags.passes.continue_from) {
            (None, Some(file)) => {
                let samples = samples_of_file(file, &job, &texts_of_samples, self.flags.denoiser().is_some())?;
                Some(Checkpoint::from(samples))
            }
            _ => None,
        };
        let start = found.as_ref().map(|found| &found.checkpoint).or(continued.as_ref());
        let watch = ProgressDisplay::begin(plan.style, frame, label, pixels, whole);
        let mut rendered_job = if self.flags.denoiser().is_some() { with_layers(&job) } else { job.clone() };
        rendered_job.film.alpha |= plan.backdrop.is_some();
        if cut.is_some_and(|cut| !cut.is_first()) {
            rendered_job.aovs.retain(|aov| !aov.is_of_denoising());
        }
        let preview = plan.preview.as_ref().filter(|_| job.passes().is_ok());
        let texts = &frame_context.texts;
        let preview = preview.map(|output| {
            let finish = plan.finish(output, world);
            PreviewFile { output, job: &job, texts, window: window(&job), finish }
        });
        let spent_before = found.as_ref().map_or(Duration::ZERO, |found| found.spent);
        let outlook = OutlookTime::new(world, &job, start.map(|start| &start.samples), spent_before);
        let flags = &self.flags;
        let checkpoints = place.as_ref().map(|place| {
            CheckpointWriter::new(place, &job, texts_of_samples.clone(), (plan.style, flags.quiet), found.as_ref())
        });
        let observer = PassObserver::new(&watch, plan.style, frame, &flags.passes, preview, flags.quiet, outlook)
            .with_checkpoints(checkpoints.as_ref().map(|writer| writer as _));
        let rendered = self.rendering(frame_context, world, (&rendered_job, start), &observer);
        let render = watch.finish().as_secs_f64();
        let (mut rendering, solution) = rendered?;
        // A signal after the last sample, or one that ended the passes, leaves a part, too.
        rendering.complete &= !interrupt::stops();
        let mut checkpoint_file = None;
        if let (false, Some(writer), Some(samples)) = (rendering.complete, &checkpoints, &rendering.samples) {
            let checkpoint = Checkpoint { samples: samples.clone(), pass: rendering.pass.clone() };
            checkpoint_file = writer.write_last(&checkpoint).map(|file| file.display().to_string());
        }
        if let (Some(denoiser), None) = (self.flags.denoiser(), &cut) {
            self.denoise(denoiser, &mut rendering, (world, &job))?;
        }
        self.tell_of_samples(&rendering, &job);
        let developing = plan.finish(&plan.output, world).apply(&mut rendering.picture, &job, rendering.complete);
        let solution = first_solution.or(solution);
        self.tell_of_solves(solution);
        self.tell_of(&shortfalls(&self.reader.name, &rendering.counts.warnings));
        let start = Instant::now();
        let noise_left = noise_left(&rendering, outlook, render);
        if let (Some((lines, _)), false) = (&noise_left, self.flags.quiet || plan.style == Style::Json) {
            lines.iter().for_each(|line| eprint_line(&format!("note: {}: {line}", self.reader.name)));
        }
        let keeps_samples = !plan.numbered && plan.output.format.has_layers();
        let texts_with_samples = |rendering: &mut Rendering| {
            let mut texts = frame_context.texts.clone();
            if cut.is_some() {
                texts.clone_from(&texts_of_samples);
                add_part(rendering, &mut texts);
            } else if keeps_samples {
                add_samples(rendering, &mut texts, self.flags.denoiser().is_some());
            }
            texts
        };
        let mut written = None;
        if rendering.complete {
            let texts = texts_with_samples(&mut rendering);
            written = self.writer.write(&FramePicture {
                world,
                job: &job,
                rendering: &rendering,
                developing,
                texts: &texts,
            })?;
            rendering.complete = written.is_some();
        }
        if let (true, Some(writer)) = (rendering.complete, &checkpoints) {
            writer.remove();
        }
        let (files, samples_file) = if let Some(files) = written {
            (files, None)
        } else if rendering.pixels_done > 0 && plan.output.format.film().is_none() && !interrupt::is_outdated() {
            let texts = texts_with_samples(&mut rendering);
            let samples = if checkpoint_file.is_none() { Some(&frame_context.scene_digest) } else { None };
            self.write_part(samples, texts, &mut rendering, (world, &job), developing)?
        } else {
            (Vec::new(), None) // A black picture is worthless, and a film has whole frames.
        };
        let rays_total = rendering.counts.rays.total();
        let report = Report {
            event: "done",
            frame,
            complete: rendering.complete,
            pixels_done: rendering.pixels_done,
            pixels,
            files,
            samples_file,
            checkpoint: checkpoint_file,
            size: [width, height],
            primitives: world.primitives(),
            hierarchies: frame_context.hierarchies,
            rays: rendering.counts.rays,
            solution,
            metered_exposure: self.metered,
            noise_left: noise_left.map(|(_, json)| json),
            samples: rendering.statistics.as_ref().map(|statistics| SampleReport::new(statistics, pixels)),
            counts: rendering.counts.others.iter().copied().collect(),
            rays_total,
            rays_per_second: (rays_total as f64 / render.max(1e-9)).round(),
            threads,
            seconds: Times { render, write: start.elapsed().as_secs_f64(), ..frame_context.times },
        };
        Ok(RenderedFrame { whole: report.complete, report })
    }

    /// The file of a frame's checkpoints, if it is a picture that grows.
    fn checkpoint_place(&self, job: &Job) -> Option<CheckpointPlace> {
        let (plan, flags) = (self.plan, &self.flags.checkpoints);
        let picture = &plan.files(job.frame)[0];
        let grows = job.passes().is_ok() && plan.output.format.film().is_none();
        grows.then(|| flags.place(plan.output.has_place_beside(picture).then_some(picture)))?
    }

    /// The checkpoint of a frame that a render which ended early left.
    fn checkpoint(
        &mut self,
        place: &mut CheckpointPlace,
        job: (&Job, &[(String, String)]),
    ) -> Result<Option<Found>, Failure> {
        let picture = self.plan.files(job.0.frame).swap_remove(0);
        let beside = self.plan.output.has_place_beside(&picture).then_some(picture);
        let mut warnings = Diagnostics::new();
        let found = place.open(job, beside.as_deref(), &mut |warning| warnings.push(warning))?;
        self.tell_of(&warnings);
        if let Some(Found { checkpoint, .. }) = &found {
            let (file, samples) = (place.path(), checkpoint.samples.counts().iter().min());
            if self.plan.style == Style::Json {
                emit(&json!({ "event": "resumed", "frame": job.0.frame, "file": file, "samples": samples }));
            } else if !self.flags.quiet {
                let samples = plural(u64::from(*samples.unwrap_or(&0)), "sample");
                eprint_line(&format!("going on with {}: each pixel has {samples}", file.display()));
            }
        }
        Ok(found)
    }

    /// Writes the part of a picture, and with a scene's digest its samples if the picture's own file can't hold them;
    /// returns the files' names, that of the samples apart, too.
    fn write_part(
        &self,
        scene_digest: Option<&[(String, String); 2]>,
        texts: Vec<(String, String)>,
        rendering: &mut Rendering,
        (world, job): (&World, &Job),
        developing: Developing,
    ) -> Result<(Vec<String>, Option<String>), Failure> {
        let plan = self.plan;
        let has_place = plan.output.has_place_beside(&plan.files(job.frame)[0]);
        let has_own = rendering.samples.is_some() && has_place && !plan.numbered && !plan.output.format.has_layers();
        // The samples come first. The picture can be made of them, but they can't be made of the picture. So a second
        // signal, a crash or the end of the time for saving rather costs the picture. The picture takes little time.
        let samples = scene_digest.filter(|_| has_own).map(|scene_digest| {
            let mut texts = texts.clone();
            texts.extend(scene_digest.clone());
            let own = rendering.picture.layers.len();
            add_samples(rendering, &mut texts, self.flags.denoiser().is_some());
            let written = self.writer.write_samples(&FramePicture { world, job, rendering, developing, texts: &texts });
            rendering.picture.layers.truncate(own);
            written
        });
        let mut is_late = !interrupt::has_time_to_save();
        if has_own {
            interrupt::samples_are_saved();
        }
        // Where the disk has no room for the samples, it may have some for the picture.
        let mut files = self.writer.write_part(&FramePicture { world, job, rendering, developing, texts: &texts })?;
        is_late |= !interrupt::has_time_to_save();
        if is_late && plan.style != Style::Json && !self.flags.quiet {
            eprint_line("saving the part took too long: its lower rows, layers or samples may be missing");
        }
        let samples = samples.transpose()?;
        files.extend(samples.clone());
        Ok((files, samples))
    }

    /// Denoises a complete picture, and removes the layers that only denoising needs. A picture that a signal stops
    /// stays noisy and isn't complete.
    fn denoise(
        &self,
        denoiser: Denoiser,
        rendering: &mut Rendering,
        (world, job): (&World, &Job),
    ) -> Result<(), Failure> {
        let start = Instant::now();
        let noisy = denoiser::of_rendering(&mut rendering.picture, &job.aovs);
        if !rendering.complete {
            return Ok(());
        }
        if let Some(lacks) = denoiser::lacks(&noisy)
            && !self.flags.quiet
            && self.plan.style != Style::Json
        {
            eprint_line(&format!("note: {}: {lacks}", self.reader.name));
        }
        let Some(denoised) = denoiser.run(noisy)? else {
            rendering.complete = false;
            return Ok(());
        };
        let seconds = start.elapsed();
        if self.plan.style == Style::Json {
            emit(&json!({
                "event": "denoised", "frame": job.frame, "denoiser": denoiser.name(), "seconds": seconds.as_secs_f64(),
                "outlier_light": denoised.outlier_light, "lost_light": denoised.lost_light,
            }));
        } else if !self.flags.quiet {
            eprint_line(&denoiser::told(&denoised, seconds));
        }
        rendering.picture.pixels = denoised.color;
        if world.shadow_background().is_none() {
            blacken_uncovered(&mut rendering.picture.pixels, &rendering.picture.alpha);
        }
        Ok(())
    }

    /// Writes the previews of a frame. Returns where the solution comes from, if radiosity makes them.
    fn previews(
        &mut self,
        frame_context: &FrameContext,
        world: &World,
        job: &Job,
    ) -> Result<Option<SolutionSource>, Failure> {
        let mut source = None;
        for preview in &frame_context.previews {
            let ([_, _, width, height], block) = (preview.job.window(), preview.block);
            let style = if self.plan.style == Style::Json { Style::Silent } else { self.plan.style };
            let (label, pixels) = (format!("preview 1/{block}  "), u64::from(width) * u64::from(height));
            let watch = ProgressDisplay::begin(style, job.frame, label, pixels, RunProgress::SINGLE);
            let coarse = Job { frame: job.frame, ..preview.job.clone() };
            let rendered = self.rendering(frame_context, world, (&coarse, None), &watch);
            watch.finish();
            let (rendering, solution) = rendered?;
            source = source.or(solution);
            if !rendering.complete {
                break;
            }
            let texts = &frame_context.texts;
            let picture = FramePicture { world, job, rendering: &rendering, developing: job.developing(), texts };
            let file = match self.writer.write_preview(&picture, preview) {
                Ok(file) => file,
                Err(failure) => {
                    warn_unwritten("--preview", &failure, self.plan.style, self.flags.quiet);
                    break;
                }
            };
            if self.plan.style == Style::Json {
                emit(&json!({ "event": "preview", "frame": job.frame, "block": block, "file": file }));
            }
        }
        Ok(source)
    }

    /// Makes the picture of a frame from the samples that it has already, with its solution if radiosity makes it.
    fn rendering(
        &mut self,
        frame_context: &FrameContext,
        world: &World,
        (job, start): (&Job, Option<&Checkpoint>),
        observer: &dyn Observer,
    ) -> Result<(Rendering, Option<SolutionSource>), Failure> {
        let name = self.reader.name.clone();
        let of_session = |solution: Option<&Arc<RadiositySolution>>| {
            let failed = |e: JobError| match e {
                JobError::Start(_) => Failure::new(Exit::Scene, format!("--continue: {e}")),
                _ => Failure::new(Exit::Scene, format!("{name}: {e}")),
            };
            let preparation = Preparation { solution, ..Preparation::default() };
            render_from(world, job, preparation, start, observer).map_err(failed)
        };
        let (Some(fingerprint), Some(settings)) = (&frame_context.fingerprint, job.description().radiosity()) else {
            return Ok((of_session(None)?, None));
        };
        let solved = self.solutions.solution(&name, world, fingerprint, settings, observer)?;
        match solved {
            Some((solution, source)) => Ok((of_session(Some(&solution))?, Some(source))),
            None => Ok((Rendering::unfinished(world, job), None)),
        }
    }

    /// The time of the first solve, if it was for this frame. The next frames may need none.
    fn first_solve(&self, report: &Report) -> Duration {
        let is_first = report.solution == Some(SolutionSource::Solved) && self.solutions.solves == 1;
        if is_first { self.solutions.solve_time } else { Duration::ZERO }
    }

    /// Warns of samples that aren't finite, of light that a clamp removes, and of noise that isn't as low as asked.
    fn tell_of_samples(&mut self, rendering: &Rendering, job: &Job) {
        let Some(statistics) = &rendering.statistics else { return };
        let mut warnings = sample_warnings(statistics, job, rendering.complete);
        warnings.extend(self.darkness(rendering, job));
        self.tell_of(&shortfalls(&self.reader.name, &warnings));
    }

    /// A warning that a picture for display is much darker than a photo, where nobody chose its exposure.
    fn darkness(&self, rendering: &Rendering, job: &Job) -> Option<String> {
        /// The stops from which little is seen.
        const DARK: f32 = 4.0;
        let is_shown = self.plan.output.format.capabilities().is_none_or(|can| !can.linear);
        if job.film.exposure.is_some() || !is_shown || !rendering.complete {
            return None;
        }
        let stops = metered_exposure(&rendering.picture);
        (stops >= DARK).then(|| {
            format!("the picture is {stops:.1} stops darker than a photo would be; --exposure auto shows what is there")
        })
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
                "{paint} {done} of {of} were rendered; {}. Numbered pictures (--output shot.####.png) can be gone on \
                 with",
                match film_part {
                    Some(file) => format!("{file} has them"),
                    None => "nothing is written".to_owned(),
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
