//! Integrators of rays as ones of tiles: each pixel is sampled by camera rays.

mod aov_probe;
mod lattice;
mod pixel;

use super::prepared::{RayWatcher, TileBlock};
use super::{
    Cancelled, Counts, IntegratorWorker, PreparedIntegrator, PreparedRadiosity, PreparedRayIntegrator, Probe,
    RayIntegrator, Transport,
};
use crate::film::TileBuffer;
use crate::job::{Aov, PlacedJob, in_squares};
use crate::math::{DRay, Rgb};
use aov_probe::AovProbe;
pub(crate) use pixel::{PixelRenderer, progressive_spacing};
use std::ops::ControlFlow;

/// An integrator of rays that is prepared for a job.
pub(crate) struct CameraRays<'w, I> {
    pub(crate) job: PlacedJob<'w>,
    pub(crate) integrator: I,
    /// How light goes between the patches of radiosity, if that is kept.
    pub(crate) transport: Option<Transport<'w>>,
}

impl<'w, I: PreparedRayIntegrator + 'w> CameraRays<'w, I> {
    /// The integrator for this job's pixels.
    pub(crate) fn boxed(job: &PlacedJob<'w>, integrator: I) -> Box<dyn PreparedIntegrator + 'w> {
        Box::new(CameraRays { job: job.clone(), integrator, transport: None })
    }
}

impl<I: PreparedRayIntegrator> PreparedIntegrator for CameraRays<'_, I> {
    fn preparation_counts(&self) -> Counts {
        self.integrator.preparation_counts()
    }

    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn IntegratorWorker + 'a> {
        Box::new(CameraRayWorker {
            job: &self.job,
            integrator: self.integrator.picture_worker(self.job.world(), &self.job, cancelled),
            cancelled,
            pixels: PixelRenderer::new(&self.job),
            size: [0; 2],
            places: Vec::new(),
            together: Vec::new(),
        })
    }

    fn radiosity(&self) -> Option<(&PreparedRadiosity, Option<&Transport<'_>>)> {
        Some((self.integrator.radiosity()?, self.transport.as_ref()))
    }
}

/// The state of one thread.
struct CameraRayWorker<'a, I> {
    job: &'a PlacedJob<'a>,
    integrator: I,
    cancelled: Cancelled<'a>,
    pixels: PixelRenderer<'a>,
    /// The size of the last tile, and its places [in squares](in_squares).
    size: [u32; 2],
    places: Vec<[u32; 2]>,
    /// Pixels that are traced together.
    together: Vec<[u32; 2]>,
}

impl<'a, I: RayIntegrator<'a>> IntegratorWorker for CameraRayWorker<'a, I> {
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        self.pixels.sample_sites(&mut self.integrator, buffer.area());
        self.poll()?;
        if self.job.aovs.is_empty() { self.without_layers(buffer) } else { self.with_layers(buffer) }
    }

    fn first_hits(&mut self, aovs: &[Aov], buffer: &mut TileBuffer) -> ControlFlow<()> {
        let [x0, y0, width, _] = buffer.area();
        let counts = *self.integrator.counts();
        for index in 0..buffer.len() {
            self.poll()?;
            let place = [x0 + index as u32 % width, y0 + index as u32 / width];
            let mut probe = AovProbe::new(self.job.world(), &self.job.camera);
            let block = [self.job.first_sample, 1];
            self.pixels.block_with_probe(&mut self.integrator, place, block, &mut probe, &mut |_| ());
            probe.finish(0, aovs, index, buffer);
        }
        *self.integrator.counts() = counts;
        ControlFlow::Continue(())
    }

    fn block(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, &mut [Rgb])) -> ControlFlow<()> {
        let TileBlock { area: [x0, y0, ..], places, first, size } = *block;
        let each = (I::BATCH_SIZE / size as usize).max(1);
        for (start, chunk) in (0..).step_by(each).zip(places.chunks(each)) {
            self.poll()?;
            self.together.clear();
            self.together.extend(chunk.iter().map(|[x, y]| [x0 + x, y0 + y]));
            let Self { pixels, integrator, together, .. } = self;
            pixels.block(integrator, together, [first, size], |index, colors| add(start + index, colors));
        }
        self.poll()
    }

    fn alphas(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, f64)) -> ControlFlow<()> {
        let TileBlock { area: [x0, y0, ..], places, first, size } = *block;
        for (number, [x, y]) in places.iter().enumerate() {
            self.poll()?;
            for index in first..first + size {
                add(number, self.pixels.sample_alpha(&mut self.integrator, [x0 + x, y0 + y], index));
            }
        }
        ControlFlow::Continue(())
    }

    fn begin_area(&mut self, area: [u32; 4]) {
        self.pixels.sample_sites(&mut self.integrator, area);
    }

    fn watch(&mut self, pixel: [u32; 2], probe: &mut dyn Probe, add: &mut dyn FnMut(Rgb, f64)) -> ControlFlow<()> {
        let Self { job, integrator, pixels, .. } = self;
        if job.is_progressive() {
            let block = [job.first_sample, job.sample_count()];
            pixels.block_with_probe(integrator, pixel, block, probe, &mut |color| add(color, 1.0));
        } else {
            pixels.pixel(integrator, pixel, probe, add);
        }
        self.poll()
    }

    fn rays(&mut self) -> Option<&mut dyn RayWatcher> {
        Some(self)
    }

    fn take_counts(&mut self) -> Counts {
        std::mem::take(self.integrator.counts()).into()
    }
}

impl<'a, I: RayIntegrator<'a>> CameraRayWorker<'a, I> {
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
            let mut probe = AovProbe::new(self.job.world(), &self.job.camera);
            let mut add = |color, weight| buffer.add(index, color, weight);
            let rays = self.pixels.pixel(&mut self.integrator, place, &mut probe, &mut add);
            probe.finish(rays, &self.job.aovs, index, buffer);
        }
        self.poll()
    }

    fn poll(&mut self) -> ControlFlow<()> {
        poll(self.cancelled, &mut self.integrator)
    }
}

impl<'a, I: RayIntegrator<'a>> RayWatcher for CameraRayWorker<'a, I> {
    fn places(
        &mut self,
        pixel: [u32; 2],
        places: &[([f64; 2], f64)],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> ControlFlow<()> {
        self.pixels.at_places(&mut self.integrator, pixel, places, probe, add);
        self.poll()
    }

    fn ray(&mut self, line: DRay, probe: &mut dyn Probe) -> ControlFlow<(), Rgb> {
        let color = self.pixels.along(&mut self.integrator, line, probe);
        self.poll()?;
        ControlFlow::Continue(color)
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
