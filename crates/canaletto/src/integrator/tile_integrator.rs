//! The door of integrators: how a render asks an integrator for tiles.

use super::{Counts, Probe, RayCounts};
use crate::film::TileBuffer;
use crate::job::Job;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::world::World;
use std::ops::ControlFlow;

/// A callback that gets the number of rays traced so far and returns whether to cancel.
pub(crate) type Cancelled<'a> = &'a (dyn Fn(u64) -> bool + Sync);

/// An integrator that is prepared for one world and one job. It makes the picture in tiles, and in passes that
/// accumulate: each pass adds to each tile. Whatever takes time before the first tile is done when it is made.
pub(crate) trait TileIntegrator: Sync {
    /// The number of passes over the picture, at least 1.
    fn passes(&self) -> u32 {
        1
    }

    /// What was counted while the integrator was prepared.
    fn preparation_counts(&self) -> Counts {
        Counts::default()
    }

    /// The integrator's state for one thread.
    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn TileWorker + 'a>;
}

/// The state of an integrator in one thread.
pub(crate) trait TileWorker {
    /// Adds the next pass to a tile. What is added depends on world, job, tile and pass only. Breaks if cancelled; the
    /// buffer is then not used any more.
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()>;

    /// What was counted since the last call.
    fn take_counts(&mut self) -> Counts;
}

/// What the threads of an integrator of rays share: its settings, and what was prepared for the world.
pub(crate) trait PreparedRayIntegrator: Sync {
    /// What was counted while the integrator was prepared.
    fn preparation_counts(&self) -> Counts {
        Counts::default()
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
        if job.film.alpha {
            worker.hide_background();
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

    /// Leaves out the background that camera rays see straight on: it is black there.
    fn hide_background(&mut self);

    /// The share of the light behind all bodies that a camera ray of the current sample hides, 0 to 1. What the ray
    /// passes without being bent lets light through: holes, partial coverage, media, thin walls, and bodies of the η
    /// around them.
    fn alpha(&mut self, line: DRay) -> f32;

    /// Begins a sample of a pixel. `sample` supplies random numbers until the next sample. `time` runs from 0 (the
    /// shutter opens) to 1 (it closes).
    fn begin(&mut self, sample: Sample, time: f32);

    /// The colour along a camera ray, for a probe that observes it. `differential` is the ray differential to the
    /// neighbouring samples; it is needed if [`World::needs_differentials`] returns true.
    fn eye<P: Probe + ?Sized>(&mut self, line: DRay, differential: Option<&RayDifferential>, probe: &mut P) -> Rgb;

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
