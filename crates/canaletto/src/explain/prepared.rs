//! Explanations of many pixels of one picture. What the job's integrator prepares is kept between them.

use super::developed::DevelopedNode;
use super::patch::RadiosityTerms;
use super::patch_terms::{BlendedPlace, patch_node, place_node};
use super::ray_tree::RayTree;
use super::record::{EyeLine, RecordedSteps, Recorder};
use super::steps::CameraSteps;
use super::tree::{Outcome, RayNode, SampleNode};
use super::tried_objects::MOST_PRIMITIVES;
use super::{ExplainError, PixelTree};
use crate::Named;
use crate::film::WeightedSum;
use crate::integrator::radiosity::RadiositySolution;
use crate::integrator::{
    Cancelled, PreparedRadiosity, Probe, RayIntegrator, Transport, Whitted, Zbuffer, ZbufferExplainer, zbuffer_spacing,
};
use crate::job::{Job, JobError, Observer};
use crate::math::{DRay, saturate};
use crate::render::PixelRenderer;
use crate::sampler::FrameSampler;
use crate::scene::{Integrator, WhittedSettings};
use crate::world::World;
use std::collections::{BTreeSet, VecDeque};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A job whose pixels can be explained. The camera is relative to the world's origin.
pub(crate) struct PreparedExplainer<'w> {
    world: &'w World,
    job: &'w Job,
    prepared: Prepared<'w>,
}

/// How a job with radiosity gets its solution. Other integrators take none.
#[derive(Clone, Copy)]
pub(crate) enum SolutionSource<'s> {
    /// A solution that was found before. What lights its patches isn't known.
    Given(&'s Arc<RadiositySolution>),
    /// The solution is found.
    Solved,
    /// The solution is found and keeps its links, which takes memory. They explain what lights its patches.
    SolvedWithLinks,
}

/// What the job's integrator prepared.
enum Prepared<'w> {
    Whitted(WhittedSettings),
    Radiosity(Box<PreparedRadiosity>, Option<Box<Transport<'w>>>),
    Zbuffer(Box<Zbuffer<'w>>),
}

impl<'w> PreparedExplainer<'w> {
    /// Prepares the job's integrator. Breaks if cancelled.
    ///
    /// # Errors
    /// [`JobError`] as from a render.
    pub(crate) fn new(
        world: &'w World,
        job: &'w Job,
        source: SolutionSource,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), PreparedExplainer<'w>>, JobError> {
        let prepared = match job.integrator {
            Integrator::Whitted(settings) => ControlFlow::Continue(Prepared::Whitted(settings)),
            Integrator::Radiosity(settings) => {
                let without_links = |radiosity: PreparedRadiosity| Prepared::Radiosity(Box::new(radiosity), None);
                match source {
                    SolutionSource::SolvedWithLinks => PreparedRadiosity::with_transport(world, settings, observer)?
                        .map_continue(|(radiosity, transport)| {
                            Prepared::Radiosity(Box::new(radiosity), Some(Box::new(transport)))
                        }),
                    SolutionSource::Given(solution) => {
                        PreparedRadiosity::new(world, settings, Some(Arc::clone(solution)), observer)?
                            .map_continue(without_links)
                    }
                    SolutionSource::Solved => {
                        PreparedRadiosity::new(world, settings, None, observer)?.map_continue(without_links)
                    }
                }
            }
            Integrator::Path(_) => return Err(JobError::NoExplanation { integrator: job.integrator.name() }),
            Integrator::Zbuffer(settings) => Zbuffer::prepare(world, job, settings, observer)?
                .map_continue(|zbuffer| Prepared::Zbuffer(Box::new(zbuffer))),
        };
        Ok(prepared.map_continue(|prepared| PreparedExplainer { world, job, prepared }))
    }

    /// The integrator that traces the job's rays; none for a rasteriser.
    fn ray_integrator(&self) -> Option<Whitted<'_>> {
        let mut whitted = match &self.prepared {
            Prepared::Whitted(settings) => Whitted::new(self.world, *settings),
            Prepared::Radiosity(radiosity, _) => radiosity.whitted(self.world),
            Prepared::Zbuffer(_) => return None,
        };
        if self.job.film.alpha {
            whitted.hide_background();
        }
        Some(whitted)
    }

    /// The solution of radiosity, and how light goes from patch to patch if that is kept.
    fn radiosity(&self) -> Option<(&PreparedRadiosity, Option<&Transport<'w>>)> {
        match &self.prepared {
            Prepared::Radiosity(radiosity, transport) => Some((radiosity, transport.as_deref())),
            Prepared::Whitted(_) | Prepared::Zbuffer(_) => None,
        }
    }

    /// What lights the patches and the places whose light the samples have.
    fn lit(&self, samples: &[SampleNode]) -> RadiosityTerms {
        let Some((radiosity, Some(transport))) = self.radiosity() else { return RadiosityTerms::default() };
        let (mut patches, mut places) = (Few::default(), Few::default());
        let mut waiting: VecDeque<&RayNode> = samples.iter().map(|sample| &sample.ray).collect();
        while let Some(ray) = waiting.pop_front() {
            if let Outcome::Hit(hit) = &ray.outcome
                && let Some(light) = &hit.radiosity
            {
                patches.insert(light.patch);
                light
                    .corners
                    .iter()
                    .filter_map(|corner| BlendedPlace::of(light, corner))
                    .for_each(|p| places.insert(p));
            }
            waiting.extend(ray.below());
        }
        let (solution, ..) = radiosity.shown();
        let patch = |number: u32| patch_node(self.world, solution, transport, number as usize);
        let place = |place: BlendedPlace| place_node(self.world, solution, transport, place);
        RadiosityTerms {
            patches: patches.kept.into_iter().map(patch).collect(),
            more_patches: patches.more.len(),
            places: places.kept.into_iter().map(place).collect(),
            more_places: places.more.len(),
        }
    }
}

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
    explainer: &'a PreparedExplainer<'a>,
    cancelled: Cancelled<'a>,
    /// The approximate limit of rays of a pixel.
    max_rays: u64,
    lists_rivals: bool,
    /// Whether the chapter's steps are recorded.
    has_steps: bool,
    pixels: PixelRenderer<'a>,
    raster: Option<ZbufferExplainer<'a>>,
    /// The rays traced so far.
    pub(crate) rays: u64,
}

impl<'a> ExplainWorker<'a> {
    pub(crate) fn new(
        explainer: &'a PreparedExplainer<'a>,
        max_rays: u64,
        cancelled: Cancelled<'a>,
    ) -> ExplainWorker<'a> {
        let raster = match &explainer.prepared {
            Prepared::Zbuffer(zbuffer) => Some(ZbufferExplainer::new(zbuffer, cancelled)),
            Prepared::Whitted(_) | Prepared::Radiosity(..) => None,
        };
        let pixels = PixelRenderer::new(explainer.job);
        ExplainWorker { explainer, cancelled, max_rays, lists_rivals: false, has_steps: false, pixels, raster, rays: 0 }
    }

    /// Returns this worker such that it lists what covers a place and isn't seen, which takes time.
    pub(crate) fn listing_rivals(self) -> ExplainWorker<'a> {
        ExplainWorker { lists_rivals: true, ..self }
    }

    /// Returns this worker such that it records the chapter's steps, which takes time.
    pub(crate) fn with_steps(self, has_steps: bool) -> ExplainWorker<'a> {
        ExplainWorker { has_steps, ..self }
    }

    /// Whether a pixel ends after so many rays.
    fn stops(&self) -> impl Fn(u64) -> bool + Sync + use<'a> {
        let (max_rays, cancelled) = (self.max_rays, self.cancelled);
        move |rays| rays > max_rays || cancelled(rays)
    }

    fn recorded_steps(&self, eye: EyeLine) -> Option<RecordedSteps> {
        self.has_steps.then_some(RecordedSteps { eye, primitives_left: MOST_PRIMITIVES })
    }

    /// Prepares for the pixels of an area: column and row of its corner, width and height. Changes no explanation.
    pub(crate) fn begin_area(&mut self, area: [u32; 4]) {
        if let Some(whitted) = self.explainer.ray_integrator() {
            self.pixels.sample_sites(&mut whitted.with_cancel(self.cancelled), area);
        }
    }

    /// Explains a pixel of the job's window.
    ///
    /// # Errors
    /// [`ExplainError`] if the pixel has too many rays, or if cancelled.
    pub(crate) fn pixel(&mut self, pixel: [u32; 2]) -> Result<PixelTree, ExplainError> {
        let (steps, stops) = (self.recorded_steps(EyeLine::Camera), self.stops());
        let Self { explainer, lists_rivals, pixels, raster, .. } = self;
        let radiosity = explainer.radiosity().map(|(radiosity, _)| radiosity);
        let mut recorder =
            Recorder::new(explainer.world, &explainer.job.camera).with_radiosity(radiosity).with_steps(steps);
        let mut sum = WeightedSum::default();
        if let Some(raster) = raster {
            let ControlFlow::Continue(rasters) = raster.pixel(pixel, *lists_rivals, &mut recorder, &mut sum) else {
                return Err(ExplainError::Cancelled);
            };
            let mut tree = self.tree(pixel, recorder, &sum);
            for (sample, raster) in tree.samples.iter_mut().zip(rasters) {
                sample.raster = Some(raster);
            }
            return Ok(tree);
        }
        let Some(whitted) = explainer.ray_integrator() else { return Err(ExplainError::Cancelled) };
        let mut whitted = whitted.with_cancel(&stops);
        pixels.pixel(&mut whitted, pixel, &mut recorder, &mut sum);
        self.count(&whitted)?;
        Ok(self.tree(pixel, recorder, &sum))
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
        let PreparedExplainer { world, job, .. } = self.explainer;
        let Some(whitted) = self.explainer.ray_integrator() else { return Ok(None) };
        let stops = self.stops();
        let mut whitted = whitted.with_cancel(&stops);
        let camera = job.camera.at(0.0);
        let mut recorder = Recorder::new(world, &camera);
        let mut sum = WeightedSum::default();
        let sampler = FrameSampler::new(job.seed, job.frame, job.film.sampler).pixel(pixel);
        let spacing = zbuffer_spacing(job);
        for (index, &([x, y], weight)) in places.iter().enumerate() {
            let differential = world.needs_differentials().then(|| camera.differential(x, y, spacing));
            recorder.sample([x, y], weight);
            whitted.begin(sampler.sample(index as u32, places.len() as u32), 0.0);
            sum.add(whitted.eye(camera.line(x, y), differential.as_ref(), &mut recorder), weight);
        }
        self.count(&whitted)?;
        Ok(Some(self.tree(pixel, recorder, &sum)))
    }

    /// Explains what a ray of the world sees, whose direction may have any length. None for a rasteriser.
    ///
    /// # Errors
    /// [`ExplainError`] if there are too many rays, or if cancelled.
    pub(crate) fn ray(&mut self, line: DRay) -> Result<Option<RayTree>, ExplainError> {
        let PreparedExplainer { world, job, .. } = self.explainer;
        let Some(whitted) = self.explainer.ray_integrator() else { return Ok(None) };
        let stops = self.stops();
        let mut whitted = whitted.with_cancel(&stops);
        let radiosity = self.explainer.radiosity().map(|(radiosity, _)| radiosity);
        let mut recorder = Recorder::new(world, &job.camera)
            .with_radiosity(radiosity)
            .with_steps(self.recorded_steps(EyeLine::Given(line)));
        recorder.sample([0.0; 2], 1.0);
        whitted.begin(FrameSampler::new(job.seed, job.frame, job.film.sampler).pixel([0; 2]).sample(0, 1), 0.0);
        let unit = DRay { direction: line.direction.normalize(), ..line };
        let color = whitted.eye(unit, None, &mut recorder);
        self.count(&whitted)?;
        let mut samples = recorder.into_samples();
        let radiosity = self.explainer.lit(&samples);
        let ray = samples.pop().map(|sample| sample.ray);
        Ok(ray.map(|ray| RayTree { ray, radiosity, color }))
    }

    /// Counts the rays of a pixel.
    ///
    /// # Errors
    /// [`ExplainError`] if there were too many, or if cancelled.
    fn count(&mut self, whitted: &Whitted) -> Result<(), ExplainError> {
        let rays = whitted.counts.total();
        self.rays += rays;
        match whitted.is_cancelled() {
            false => Ok(()),
            true if rays > self.max_rays => Err(ExplainError::TooManyRays),
            true => Err(ExplainError::Cancelled),
        }
    }

    fn tree(&self, [x, y]: [u32; 2], recorder: Recorder, sum: &WeightedSum) -> PixelTree {
        let [width, height] = self.explainer.job.camera.size();
        let film = &self.explainer.job.film;
        let alpha = film.alpha.then(|| saturate((recorder.alpha() / sum.weight()) as f32));
        let samples = recorder.into_samples();
        PixelTree {
            pixel: [x, y],
            chapter_pixel: [x, height - 1 - y],
            size: [width, height],
            radiosity: self.explainer.lit(&samples),
            samples,
            camera: self.has_steps.then(|| CameraSteps::new(self.explainer.world, &self.explainer.job.camera)),
            developed: DevelopedNode::new(sum.mean(), alpha, &self.explainer.job.developing()),
            color: sum.mean(),
        }
    }
}
