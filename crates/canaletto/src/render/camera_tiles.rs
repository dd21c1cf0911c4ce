//! Tiles of integrators that trace camera rays.

use super::aov_probe::AovProbe;
use super::{PixelRenderer, in_squares};
use crate::film::TileBuffer;
use crate::integrator::{Cancelled, Counts, PreparedRayIntegrator, RayIntegrator, TileIntegrator, TileWorker};
use crate::job::Job;
use crate::world::World;
use std::ops::ControlFlow;

/// An integrator of rays as one of tiles: it samples each pixel by camera rays, in one pass.
pub(super) struct CameraTiles<'w, I> {
    pub(super) world: &'w World,
    pub(super) job: &'w Job,
    pub(super) integrator: I,
}

impl<I: PreparedRayIntegrator> TileIntegrator for CameraTiles<'_, I> {
    fn preparation_counts(&self) -> Counts {
        self.integrator.preparation_counts()
    }

    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn TileWorker + 'a> {
        Box::new(CameraTileWorker {
            job: self.job,
            integrator: self.integrator.picture_worker(self.world, self.job, cancelled),
            cancelled,
            pixels: PixelRenderer::new(self.job),
            size: [0; 2],
            places: Vec::new(),
            together: Vec::new(),
        })
    }
}

/// The state of one thread.
struct CameraTileWorker<'a, I> {
    job: &'a Job,
    integrator: I,
    cancelled: Cancelled<'a>,
    pixels: PixelRenderer<'a>,
    /// The size of the last tile, and its places [in squares](in_squares).
    size: [u32; 2],
    places: Vec<[u32; 2]>,
    /// Pixels that are traced together.
    together: Vec<[u32; 2]>,
}

impl<'a, I: RayIntegrator<'a>> TileWorker for CameraTileWorker<'a, I> {
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        self.pixels.sample_sites(&mut self.integrator, buffer.area());
        self.poll()?;
        if self.job.aovs.is_empty() { self.without_layers(buffer) } else { self.with_layers(buffer) }
    }

    fn take_counts(&mut self) -> Counts {
        std::mem::take(self.integrator.counts()).into()
    }
}

impl<'a, I: RayIntegrator<'a>> CameraTileWorker<'a, I> {
    /// Traces neighbouring pixels together.
    fn without_layers(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        let [x0, y0, width, height] = buffer.area();
        if self.size != [width, height] {
            (self.size, self.places) = ([width, height], in_squares([width, height]));
        }
        for places in self.places.chunks(self.pixels.together(I::BATCH_SIZE)) {
            poll(self.cancelled, &mut self.integrator)?;
            self.together.clear();
            self.together.extend(places.iter().map(|[x, y]| [x0 + x, y0 + y]));
            self.pixels.pixels(&mut self.integrator, &self.together, |number, color, weight| {
                let [x, y] = places[number];
                buffer.add((y * width + x) as usize, color, weight);
            });
        }
        self.poll()
    }

    /// Traces one ray after the other, for a probe that collects the layers.
    fn with_layers(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        let [x0, y0, width, _] = buffer.area();
        for index in 0..buffer.len() {
            self.poll()?;
            let place = [x0 + index as u32 % width, y0 + index as u32 / width];
            let mut probe = AovProbe::new(self.integrator.world(), &self.job.camera);
            let rays = self.pixels.pixel(&mut self.integrator, place, &mut probe, buffer.pixel_mut(index));
            probe.finish(rays, &self.job.aovs, index, buffer);
        }
        self.poll()
    }

    fn poll(&mut self) -> ControlFlow<()> {
        poll(self.cancelled, &mut self.integrator)
    }
}

/// Breaks if the render was cancelled.
fn poll<'a>(cancelled: Cancelled<'_>, integrator: &mut impl RayIntegrator<'a>) -> ControlFlow<()> {
    if integrator.is_cancelled() || cancelled(integrator.counts().total()) {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}
