//! What integrators prepare, and the work of their threads: how a render asks for tiles, and an explanation for rays.

use super::path::GuidingField;
use super::radiosity::RadiositySolution;
use super::{Counts, PreparedRadiosity, Probe, RayCounts, Transport};
use crate::film::TileBuffer;
use crate::job::{Aov, Job};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::world::World;
use std::fmt::{self, Debug, Formatter};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A callback that gets the number of rays traced so far and returns whether to cancel.
pub(crate) type Cancelled<'a> = &'a (dyn Fn(u64) -> bool + Sync);

/// A callback that hears of a field that path guiding learnt.
pub type HearsGuiding<'s> = &'s (dyn Fn(&Arc<GuidingField>) + Sync);

/// What preparing an integrator may start from, and what it keeps.
#[derive(Clone, Copy, Default)]
pub struct Preparation<'s> {
    /// A solution of radiosity that was found before. Other integrators have none.
    pub solution: Option<&'s Arc<RadiositySolution>>,
    /// What path guiding learnt before. Other integrators learn nothing.
    pub guiding: Option<&'s Arc<GuidingField>>,
    /// What hears of the field that path guiding learnt, before the first tile. It isn't called if the field was given.
    pub learnt: Option<HearsGuiding<'s>>,
    /// Whether radiosity keeps how light goes from patch to patch, for explanations. It takes memory.
    pub keeps_links: bool,
}

impl Debug for Preparation<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Preparation { solution, guiding, learnt: _, keeps_links } = self;
        let mut fields = f.debug_struct("Preparation");
        fields.field("solution", solution).field("guiding", guiding).field("keeps_links", keeps_links);
        fields.finish_non_exhaustive()
    }
}

/// An integrator that is prepared for a job in its world. Whatever takes time before the first tile is done.
pub(crate) trait PreparedIntegrator: Send + Sync {
    /// What was counted while the integrator was prepared.
    fn preparation_counts(&self) -> Counts {
        Counts::default()
    }

    /// The integrator's state for one thread.
    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn IntegratorWorker + 'a>;

    /// The solution of radiosity that the picture shows.
    fn radiosity(&self) -> Option<(&PreparedRadiosity, Option<&Transport<'_>>)> {
        None
    }
}

/// The state of an integrator in one thread. Its methods break if the render was cancelled.
pub(crate) trait IntegratorWorker {
    /// Adds all samples of a tile's pixels, with their weights, and its layers. They depend on job and tile only.
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()>;

    /// Adds the layers of geometry, by each pixel's first sample. Its rays aren't counted.
    fn first_hits(&mut self, aovs: &[Aov], buffer: &mut TileBuffer) -> ControlFlow<()>;

    /// Calls `add` with the colours of a block of samples, for each pixel of a tile that is at one of these places.
    /// Samples depend on job, pixel and number only.
    fn block(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, &mut [Rgb])) -> ControlFlow<()>;

    /// Calls `add` with the share of the background that each of these samples hides, in the order of their numbers.
    fn alphas(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, f64)) -> ControlFlow<()>;

    /// Prepares for the pixels of an area that are watched. Changes no colour.
    fn begin_area(&mut self, _area: [u32; 4]) {}

    /// Makes a pixel with a probe that observes it, and calls `add` with the colour and weight of each sample.
    fn watch(&mut self, pixel: [u32; 2], probe: &mut dyn Probe, add: &mut dyn FnMut(Rgb, f64)) -> ControlFlow<()>;

    /// The integrator as one that traces single rays; none for a rasteriser.
    fn rays(&mut self) -> Option<&mut dyn RayWatcher>;

    /// What was counted since the last call.
    fn take_counts(&mut self) -> Counts;
}

/// An integrator that traces single rays for a probe.
pub(crate) trait RayWatcher {
    /// Looks at places of a pixel, with weights, as a rasteriser does: through the middle of the lens, at the shutter's
    /// opening, with a rasteriser's footprints.
    fn places(
        &mut self,
        pixel: [u32; 2],
        places: &[([f64; 2], f64)],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> ControlFlow<()>;

    /// The colour along a ray with a unit direction.
    fn ray(&mut self, line: DRay, probe: &mut dyn Probe) -> ControlFlow<(), Rgb>;
}

/// A block of samples of some pixels of a tile.
#[derive(Clone, Copy)]
pub(crate) struct TileBlock<'a> {
    /// x and y from the picture's upper left corner, width and height, in pixels.
    pub(crate) area: [u32; 4],
    /// Pixels from the tile's upper left corner, neighbours near each other.
    pub(crate) places: &'a [[u32; 2]],
    /// The numbers of the samples.
    pub(crate) first: u32,
    pub(crate) size: u32,
}

/// What the threads of an integrator of rays share: its settings, and what was prepared for the world.
pub(crate) trait PreparedRayIntegrator: Send + Sync {
    /// What was counted while the integrator was prepared.
    fn preparation_counts(&self) -> Counts {
        Counts::default()
    }

    /// The solution of radiosity that is seen.
    fn radiosity(&self) -> Option<&PreparedRadiosity> {
        None
    }

    /// The integrator of one thread.
    type Worker<'a>: RayIntegrator<'a>
    where
        Self: 'a;

    /// Makes the integrator of one thread.
    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> Self::Worker<'a>;

    /// Makes the integrator of one thread for a job's picture, with or without the background.
    fn picture_worker<'a>(&'a self, world: &'a World, job: &Job, cancelled: Cancelled<'a>) -> Self::Worker<'a> {
        let mut worker = self.worker(world, cancelled);
        if let Some(radiance) = job.backdrop(world) {
            worker.replace_background(radiance);
        }
        worker
    }
}

/// An integrator that finds the light along rays: along one ray for a probe, or along many without one.
pub(crate) trait RayIntegrator<'w> {
    /// The most rays that are traced together.
    const BATCH_SIZE: usize;

    /// The world that it traces.
    fn world(&self) -> &'w World;

    /// Replaces the surroundings that camera rays see straight on.
    fn replace_background(&mut self, radiance: Rgb);

    /// The share of the light behind all bodies that a camera ray of the current sample hides, 0 to 1. What the ray
    /// passes without being bent lets light through: holes, partial coverage, media, thin walls, and bodies of the η
    /// around them.
    fn alpha(&mut self, line: DRay) -> f32;

    /// Begins a sample of a pixel. `sample` supplies random numbers until the next sample. `time` runs from 0 (the
    /// shutter opens) to 1 (it closes).
    fn begin(&mut self, sample: Sample, time: f32);

    /// The colour along a camera ray, for a probe that observes it. `differential` is the ray differential to the
    /// neighbouring samples; it is needed if [`World::needs_differentials`] returns true.
    fn eye(&mut self, line: DRay, differential: Option<&RayDifferential>, probe: &mut dyn Probe) -> Rgb;

    /// Adds camera rays to the batch that waits to be traced. Successive rays should have nearly equal directions.
    /// There are as many `samples` as `lines`. There are as many `times` too, unless nothing in the world moves, and as
    /// many `differentials`, unless nothing uses them.
    fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        times: &[f32],
        differentials: impl IntoIterator<Item = RayDifferential>,
    );

    /// Whether the batch of waiting rays has reached its best size.
    fn is_full(&self) -> bool;

    /// Traces the waiting rays and returns their colours. They are equal to those of [`RayIntegrator::eye`].
    fn trace_pending(&mut self) -> &[Rgb];

    /// Whether the callback cancelled the integrator. Colours returned since then are meaningless.
    fn is_cancelled(&self) -> bool;

    /// The rays traced so far.
    fn counts(&mut self) -> &mut RayCounts;
}
