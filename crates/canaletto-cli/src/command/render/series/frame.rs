//! One frame of a series: its samples so far, its render, its checkpoints, and what is written of it.

use super::{FrameContext, RenderedFrame, Series};
use crate::checkpoint::{CheckpointPlace, CheckpointWriter, Found};
use crate::command::render::frame_writer::FramePicture;
use crate::denoiser::{self, Denoiser, blacken_uncovered, with_layers};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line};
use crate::format::{JSON_VERSION, plural};
use crate::guiding_file::{is_guided, read_guiding, write_guiding};
use crate::interrupt;
use crate::omissions::shortfalls;
use crate::output::window;
use crate::part::layers_of_part;
use crate::passes::{OutlookTime, PassObserver, noise_left, sample_warnings};
use crate::preview::{PreviewFile, warn_unwritten};
use crate::progress::{ProgressDisplay, RunProgress, Style, emit};
use crate::report::{Report, SampleReport, Times};
use crate::sample_file::{add_part, add_samples, samples_of_file};
use crate::solutions::SolutionSource;
use canaletto::film::{Checkpoint, metered_exposure};
use canaletto::integrator::radiosity::RadiositySolution;
use canaletto::integrator::{GuidingField, HearsGuiding};
use canaletto::render::{Job, JobError, Observer, Preparation, Rendering, render_from};
use canaletto::scene::Developing;
use canaletto::world::World;
use canaletto_io::diagnostic::Diagnostics;
use serde_json::json;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What a frame's picture is made from besides its samples so far.
#[derive(Clone, Copy, Default)]
pub(super) struct Prepared<'p, 'w> {
    /// What keeps the solution of radiosity, or has one.
    checkpoints: Option<&'p CheckpointWriter<'w>>,
    /// What path guiding learnt before, and what hears of it when it learns.
    guiding: Option<&'p Arc<GuidingField>>,
    learnt: Option<HearsGuiding<'p>>,
}

impl Series<'_> {
    /// Renders a frame and writes it.
    pub(super) fn frame(
        &mut self,
        frame_context: &FrameContext,
        world: &World,
        frame: u32,
    ) -> Result<RenderedFrame, Failure> {
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
        let texts_of_samples =
            cut.map_or_else(|| frame_context.texts_of_samples(), |cut| frame_context.texts_of_part(&cut));
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
        if let Some(cut) = &cut {
            rendered_job.aovs = layers_of_part(cut, &rendered_job.aovs);
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
        let checkpoint_writer = checkpoints.as_ref();
        let guiding = self.guiding(frame_context, &job, checkpoint_writer)?;
        let keep_guiding = |field: &Arc<GuidingField>| {
            let (field, job, texts) = (Arc::clone(field), job.clone(), frame_context.texts_of_samples());
            if let Some(writer) = checkpoint_writer {
                writer.keep_prepared(move |out| write_guiding(&field, (&job, &texts), out));
            }
        };
        let prepared =
            Prepared { checkpoints: checkpoint_writer, guiding: guiding.as_ref(), learnt: Some(&keep_guiding) };
        let rendered = self.rendering(frame_context, world, (&rendered_job, start), &observer, prepared);
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
            let picture = FramePicture { world, job: &job, rendering: &rendering, developing, texts: &texts };
            written = self.writer.write(&picture)?;
            if written.is_some() && self.keeps_frames_of_films() {
                self.keep(&picture);
            }
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

    /// Keeps a finished frame of a film. Where it can't be kept, the render goes on.
    fn keep(&self, picture: &FramePicture<'_>) {
        match self.writer.keep(picture) {
            Ok(Some(folder)) if self.plan.style == Style::Json => {
                emit(&json!({ "event": "kept", "frame": picture.job.frame, "folder": folder }));
            }
            Ok(_) => {}
            Err(failure) => warn_unwritten("--checkpoint", &failure, self.plan.style, self.flags.quiet),
        }
    }

    /// The file of a frame's checkpoints, if it is a picture that grows.
    fn checkpoint_place(&self, job: &Job) -> Option<CheckpointPlace> {
        let (plan, flags) = (self.plan, &self.flags.checkpoints);
        let picture = &plan.files(job.frame)[0];
        let is_film = plan.output.format.film().is_some();
        let grows = job.passes().is_ok();
        grows.then(|| flags.place(plan.output.has_place_beside(picture).then_some(picture), is_film))?
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
            let rendered = self.rendering(frame_context, world, (&coarse, None), &watch, Prepared::default());
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
    pub(super) fn rendering(
        &mut self,
        frame_context: &FrameContext,
        world: &World,
        (job, start): (&Job, Option<&Checkpoint>),
        observer: &dyn Observer,
        Prepared { checkpoints, guiding, learnt }: Prepared<'_, '_>,
    ) -> Result<(Rendering, Option<SolutionSource>), Failure> {
        let name = self.reader.name.clone();
        let of_session = |solution: Option<&Arc<RadiositySolution>>| {
            let failed = |e: JobError| match e {
                JobError::Start(_) => Failure::new(Exit::Scene, format!("--continue: {e}")),
                _ => Failure::new(Exit::Scene, format!("{name}: {e}")),
            };
            let preparation = Preparation { solution, guiding, learnt, ..Preparation::default() };
            render_from(world, job, preparation, start, observer).map_err(failed)
        };
        let (Some(fingerprint), Some(settings)) = (&frame_context.fingerprint, job.description().radiosity()) else {
            return Ok((of_session(None)?, None));
        };
        if let Some(checkpoints) = checkpoints {
            self.solutions.take_from(&checkpoints.prepared_file(), fingerprint);
        }
        let Some((solution, source)) = self.solutions.solution(&name, world, fingerprint, settings, observer)? else {
            return Ok((Rendering::unfinished(world, job), None));
        };
        if let Some(checkpoints) = checkpoints.filter(|_| source == SolutionSource::Solved) {
            let (solution, fingerprint) = (Arc::clone(&solution), *fingerprint);
            checkpoints.keep_prepared(move |out| solution.write(&fingerprint, out));
        }
        Ok((of_session(Some(&solution))?, Some(source)))
    }

    /// What path guiding learnt of a picture before: in the file of --prepared, or in a render that ended early.
    fn guiding(
        &self,
        frame_context: &FrameContext,
        job: &Job,
        checkpoints: Option<&CheckpointWriter<'_>>,
    ) -> Result<Option<Arc<GuidingField>>, Failure> {
        let prepared = &self.flags.prepared.prepared;
        if !is_guided(job) {
            return prepared.as_ref().map_or(Ok(None), |file| {
                let message = format!("--prepared {}: the picture needs nothing prepared", file.display());
                Err(Failure::usage(message).help("leave it out: it is for radiosity, and for paths with guiding"))
            });
        }
        let texts = frame_context.texts_of_samples();
        if let Some(file) = prepared {
            return Ok(Some(Arc::new(read_guiding("--prepared", file, (job, &texts))?)));
        }
        let kept = checkpoints
            .map(|checkpoints| read_guiding("--checkpoint", &checkpoints.prepared_file(), (job, &texts)).map(Arc::new));
        Ok(kept.and_then(Result::ok))
    }

    /// The time of the first solve, if it was for this frame. The next frames may need none.
    pub(super) fn first_solve(&self, report: &Report) -> Duration {
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
}
