//! Explanations of many pixels in one thread, with what an open session has prepared.

use super::developed::DevelopedNode;
use super::patch::RadiosityTerms;
use super::patch_terms::{BlendedPlace, patch_node, place_node};
use super::path::{PathRecorder, PathTree};
use super::ray_tree::RayTree;
use super::record::{EyeLine, RecordedSteps, Recorder};
use super::steps::CameraSteps;
use super::summing::Summing;
use super::tree::{Outcome, RayNode, SampleNode};
use super::tried_objects::MOST_PRIMITIVES;
use super::{ExplainError, PixelTree};
use crate::integrator::{Cancelled, IntegratorWorker, Probe};
use crate::math::{DRay, Rgb, saturate};
use crate::render::Session;
use std::collections::{BTreeSet, VecDeque};
use std::ops::ControlFlow;

/// The most patches, and the most places, of a pixel that are explained.
const MOST_EXPLAINED: usize = 256;

/// The first different items, and others.
struct Few<T> {
    kept: BTreeSet<T>,
    more: BTreeSet<T>,
}

impl<T> Default for Few<T> {
    fn default() -> Few<T> {
        Few { kept: BTreeSet::new(), more: BTreeSet::new() }
    }
}

impl<T: Ord> Few<T> {
    fn insert(&mut self, item: T) {
        let is_kept = self.kept.len() < MOST_EXPLAINED || self.kept.contains(&item);
        let set = if is_kept { &mut self.kept } else { &mut self.more };
        set.insert(item);
    }
}

/// Explains pixels in one thread. Pixels of one tile should follow each other.
pub(crate) struct ExplainWorker<'a> {
    session: &'a Session<'a>,
    /// Asked with the rays of the current pixel.
    stops: Cancelled<'a>,
    max_rays: u64,
    worker: Box<dyn IntegratorWorker + 'a>,
    lists_rivals: bool,
    /// Whether the chapter's steps are recorded.
    has_steps: bool,
    /// The rays traced so far.
    pub(crate) rays: u64,
}

impl<'a> ExplainWorker<'a> {
    /// A worker that ends pixels with more than `max_rays` rays. `stops` gets the rays of a pixel so far and returns
    /// whether they are too many, or the work is cancelled.
    pub(crate) fn new(session: &'a Session<'a>, max_rays: u64, stops: Cancelled<'a>) -> ExplainWorker<'a> {
        let worker = session.worker(stops);
        ExplainWorker { session, stops, max_rays, worker, lists_rivals: false, has_steps: false, rays: 0 }
    }

    /// Returns this worker such that it lists what covers a place and isn't seen, which takes time.
    pub(crate) fn listing_rivals(self) -> ExplainWorker<'a> {
        ExplainWorker { lists_rivals: true, ..self }
    }

    /// Returns this worker such that it records the chapter's steps, which takes time.
    pub(crate) fn with_steps(self, has_steps: bool) -> ExplainWorker<'a> {
        ExplainWorker { has_steps, ..self }
    }

    fn recorder(&self, eye: EyeLine) -> Recorder<'a> {
        let job = self.session.job();
        let steps = self.has_steps.then_some(RecordedSteps { eye, primitives_left: MOST_PRIMITIVES });
        Recorder::new(job.world(), &job.camera)
            .with_radiosity(self.session.radiosity().map(|(radiosity, _)| radiosity))
            .with_steps(steps)
            .listing_rivals(self.lists_rivals)
    }

    /// Prepares for the pixels of an area: column and row of its corner, width and height. Changes no explanation.
    pub(crate) fn begin_area(&mut self, area: [u32; 4]) {
        self.worker.begin_area(area);
        self.worker.take_counts();
    }

    /// Explains a pixel of the job's window by its rays.
    ///
    /// # Errors
    /// [`ExplainError`] if the pixel has too many rays, or if cancelled.
    pub(crate) fn pixel(&mut self, pixel: [u32; 2]) -> Result<PixelTree, ExplainError> {
        let mut recorder = self.recorder(EyeLine::Camera);
        let colors = self.watch(pixel, &mut recorder)?;
        Ok(self.tree(pixel, recorder, &colors, Summing::of(self.session.job())))
    }

    /// Explains a pixel of the job's window by its paths.
    ///
    /// # Errors
    /// As [`ExplainWorker::pixel`].
    pub(crate) fn paths(&mut self, pixel: [u32; 2]) -> Result<PathTree, ExplainError> {
        let job = self.session.job();
        let mut recorder = PathRecorder::new(job.world());
        let colors = self.watch(pixel, &mut recorder)?;
        Ok(PathTree::new(job, pixel, recorder, Summing::of(job).color(colors.into_iter())))
    }

    /// Explains what the job's rays see at places of a pixel, with weights, as a z-buffer looks at them: through the
    /// middle of the lens, at the shutter's opening, with a z-buffer's footprints. None for a rasteriser.
    ///
    /// # Errors
    /// [`ExplainError`] if there are too many rays, or if cancelled.
    pub(crate) fn at_places(
        &mut self,
        pixel: [u32; 2],
        places: &[([f64; 2], f64)],
    ) -> Result<Option<PixelTree>, ExplainError> {
        let job = self.session.job();
        let (camera, mut colors) = (job.camera.at(0.0), Vec::new());
        let mut recorder = Recorder::new(job.world(), &camera);
        let Some(rays) = self.worker.rays() else { return Ok(None) };
        let ended = rays.places(pixel, places, &mut recorder, &mut |color, weight| colors.push((color, weight)));
        self.count(ended)?;
        Ok(Some(self.tree(pixel, recorder, &colors, Summing::Weights)))
    }

    /// Explains what a ray of the world sees, whose direction may have any length. None for a rasteriser.
    ///
    /// # Errors
    /// [`ExplainError`] if there are too many rays, or if cancelled.
    pub(crate) fn ray(&mut self, line: DRay) -> Result<Option<RayTree>, ExplainError> {
        let mut recorder = self.recorder(EyeLine::Given(line));
        let unit = DRay { direction: line.direction.normalize(), ..line };
        let Some(rays) = self.worker.rays() else { return Ok(None) };
        let seen = rays.ray(unit, &mut recorder);
        let color = seen.continue_value();
        self.count(color.map_or(ControlFlow::Break(()), |_| ControlFlow::Continue(())))?;
        let mut samples = recorder.into_samples();
        let radiosity = self.lit(&samples);
        let ray = samples.pop().map(|sample| sample.ray);
        Ok(ray.zip(color).map(|(ray, color)| RayTree { ray, radiosity, color }))
    }

    /// Makes a pixel for a probe. Returns the colour and weight of each sample.
    fn watch(&mut self, pixel: [u32; 2], probe: &mut dyn Probe) -> Result<Vec<(Rgb, f64)>, ExplainError> {
        let mut colors = Vec::new();
        let ended = self.worker.watch(pixel, probe, &mut |color, weight| colors.push((color, weight)));
        self.count(ended)?;
        Ok(colors)
    }

    /// Counts the rays of a pixel.
    ///
    /// # Errors
    /// [`ExplainError`] if there were too many, or if cancelled.
    fn count(&mut self, ended: ControlFlow<()>) -> Result<(), ExplainError> {
        let rays = self.worker.take_counts().rays.total();
        self.rays += rays;
        if ended.is_continue() {
            return Ok(());
        }
        // A worker that was stopped traces no more.
        self.worker = self.session.worker(self.stops);
        Err(if rays > self.max_rays { ExplainError::TooManyRays } else { ExplainError::Cancelled })
    }

    fn tree(&self, [x, y]: [u32; 2], recorder: Recorder, colors: &[(Rgb, f64)], summing: Summing) -> PixelTree {
        let job = self.session.job();
        let [width, height] = job.camera.size();
        let weight: f64 = colors.iter().map(|(_, weight)| weight).sum();
        let alpha = job.divides_by_alpha().then(|| saturate((recorder.alpha() / weight) as f32));
        let samples = recorder.into_samples();
        let color = summing.color(colors.iter().copied());
        PixelTree {
            pixel: [x, y],
            chapter_pixel: [x, height - 1 - y],
            size: [width, height],
            radiosity: self.lit(&samples),
            samples,
            camera: self.has_steps.then(|| CameraSteps::new(job.world(), &job.camera)),
            developed: DevelopedNode::new(color, alpha, &job.developing()),
            summing,
            color,
        }
    }

    /// What lights the patches and the places whose light the samples have.
    fn lit(&self, samples: &[SampleNode]) -> RadiosityTerms {
        let Some((radiosity, Some(transport))) = self.session.radiosity() else { return RadiosityTerms::default() };
        let (mut patches, mut places) = (Few::default(), Few::default());
        let mut waiting: VecDeque<&RayNode> = samples.iter().map(|sample| &sample.ray).collect();
        while let Some(ray) = waiting.pop_front() {
            if let Outcome::Hit(hit) = &ray.outcome
                && let Some(light) = &hit.radiosity
            {
                patches.insert(light.patch);
                let blended = light.corners.iter().filter_map(|corner| BlendedPlace::of(light, corner));
                blended.for_each(|place| places.insert(place));
            }
            waiting.extend(ray.below());
        }
        let (world, (solution, ..)) = (self.session.job().world(), radiosity.shown());
        let patch = |number: u32| patch_node(world, solution, transport, number as usize);
        let place = |place: BlendedPlace| place_node(world, solution, transport, place);
        RadiosityTerms {
            patches: patches.kept.into_iter().map(patch).collect(),
            more_patches: patches.more.len(),
            places: places.kept.into_iter().map(place).collect(),
            more_places: places.more.len(),
        }
    }
}
