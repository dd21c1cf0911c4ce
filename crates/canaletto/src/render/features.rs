//! The layers of features for a denoiser: means over a few camera rays of their own, after the picture is made. So
//! integrators know nothing of them, and pictures without them lose no time.

use super::Rendering;
use crate::integrator::camera_rays::PixelRenderer;
use crate::integrator::{PathTracer, PreparedPath, PreparedRayIntegrator, TaskQueue};
use crate::job::{Aov, Observer, PlacedJob};
use crate::math::Rgb;
use crate::scene::Sampling;
use crate::world::World;
use glam::DVec3;
use std::ops::ControlFlow;

/// The least and the largest number of camera rays for the features of a pixel.
const RAYS: [u32; 2] = [8, 32];

/// What tells the rays of features from those of the picture. So what both share is no noise.
const SEED: u64 = 0x6665_6174_7572_6573;

/// Adds the layers that integrators don't make to a picture, in the order of the job. A cancelled one isn't complete.
pub(super) fn add_layers(job: &PlacedJob, rendering: &mut Rendering, observer: &dyn Observer) {
    let world = job.world();
    let [left, top, width, height] = job.window();
    let mut sums = Vec::new();
    if job.aovs.iter().any(|aov| aov.is_feature()) {
        let rays = job.film.sampling.count().clamp(RAYS[0], RAYS[1]);
        let job = job.with(|job| {
            job.film.sampling = Sampling::Sampled(rays);
            job.seed ^= SEED;
            job.progressive = false;
        });
        let prepared = PreparedPath::without_lights(world);
        let queue = TaskQueue::new(observer);
        let cancelled = |_| queue.is_stopped();
        let new_worker = || {
            let tracer = prepared.picture_worker(world, &job, &cancelled);
            FeatureTracer { world, pixels: PixelRenderer::new(&job), tracer }
        };
        let rows = queue.collect(height as usize, new_worker, |tracer, y| {
            let row = (0..width).map(|x| tracer.pixel([left + x, top + y as u32])).collect::<Vec<FeatureSums>>();
            if queue.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(row) }
        });
        match rows {
            ControlFlow::Continue(rows) => sums = rows.into_iter().flatten().collect(),
            ControlFlow::Break(()) => rendering.complete = false,
        }
    }
    let mut made = std::mem::take(&mut rendering.picture.layers).into_iter();
    for aov in &job.aovs {
        let mut layer = match aov.is_of_denoising() {
            true => aov.layer(world, width, height),
            false => match made.next() {
                Some(layer) => layer,
                None => continue,
            },
        };
        let count = aov.channels().len();
        for (values, sums) in layer.data.chunks_exact_mut(count).zip(&sums) {
            if let Some(own) = sums.of(*aov) {
                values.iter_mut().zip(own).for_each(|(v, own)| *v = own as f32);
            }
        }
        if *aov == Aov::Noisy {
            let pixels = rendering.picture.pixels.iter();
            layer.data.chunks_exact_mut(3).zip(pixels).for_each(|(v, color)| v.copy_from_slice(&color.to_array()));
        }
        rendering.picture.layers.push(layer);
    }
}

/// The state of one thread.
struct FeatureTracer<'a> {
    world: &'a World,
    pixels: PixelRenderer<'a>,
    tracer: PathTracer<'a>,
}

/// Sums of the features of a pixel.
#[derive(Default)]
struct FeatureSums {
    albedo: [f64; 3],
    normal: DVec3,
    /// The sum of the depths' inverses.
    nearness: f64,
    weight: f64,
}

impl FeatureTracer<'_> {
    fn pixel(&mut self, pixel: [u32; 2]) -> FeatureSums {
        let mut sums = FeatureSums::default();
        for (ray, numbers, weight) in self.pixels.camera_rays(self.world, pixel) {
            let features = self.tracer.features(ray.line, ray.differential, ray.time, numbers);
            let Rgb { r, g, b } = features.albedo;
            for (sum, value) in sums.albedo.iter_mut().zip([r, g, b]) {
                *sum += weight * f64::from(value);
            }
            sums.normal += features.normal * weight;
            sums.nearness += weight / features.depth;
            sums.weight += weight;
        }
        sums
    }
}

impl FeatureSums {
    /// The values of a layer, if it is one of features.
    fn of(&self, aov: Aov) -> Option<[f64; 3]> {
        let mean = |sum: f64| sum / self.weight;
        Some(match aov {
            // A filter's negative parts lead beyond the range.
            Aov::DenoisingAlbedo => self.albedo.map(|sum| mean(sum).clamp(0.0, 1.0)),
            Aov::DenoisingNormal => (self.normal / self.weight).to_array(),
            Aov::DenoisingDepth => {
                let nearness = mean(self.nearness);
                [if nearness > 0.0 { 1.0 / nearness } else { f64::INFINITY }, 0.0, 0.0]
            }
            _ => return None,
        })
    }
}
