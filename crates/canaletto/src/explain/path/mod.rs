//! The explanation of a pixel of path tracing: the paths behind it, with every factor as a number.

mod record;
mod svg;
#[cfg(test)]
mod tests;
mod text;

use super::developed::DevelopedNode;
use super::tree::Side;
use super::{ExplainError, MAX_RAYS};
use crate::film::{BlockMean, SampleBlocks, SampleStatistics, WeightedSum, block_sizes};
use crate::integrator::{Passage, PathChannel, PathDensities, PathEmitter, PathEnd, RayKind, SourceSample};
use crate::integrator::{PreparedRayIntegrator, RayIntegrator};
use crate::material::Lobe;
use crate::math::{Rgb, saturate};
use crate::render::{Job, PixelRenderer, prepare_path};
use crate::scene::Integrator;
use crate::world::World;
use record::PathRecorder;
use serde::Serialize;
use std::ops::ControlFlow;

/// A pixel with the paths of its samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PathTree {
    /// Column and row from the top left.
    pub pixel: [u32; 2],
    /// The chapter's x and y, with y upwards.
    pub chapter_pixel: [u32; 2],
    /// The picture's width and height.
    pub size: [u32; 2],
    /// The samples, one path each.
    pub samples: Vec<PathSample>,
    #[serde(skip)]
    summing: Summing,
    /// The pixel's colour as rendered.
    pub color: Rgb,
    /// The colour's way into a file.
    pub developed: DevelopedNode,
}

/// How a pixel is made of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Summing {
    /// The mean over blocks of samples ([`SampleBlocks`]). Samples are numbered from `first` on.
    Blocks { first: u32, clamp: Option<f32> },
    /// The weighted mean.
    Weights,
}

/// The mean of samples with these numbers as a picture in passes has it.
fn mean_of_blocks(colors: &mut [Rgb], first: u32, clamp: Option<f32>) -> Rgb {
    SampleStatistics::default().check(colors, clamp, [0, 0], first);
    let mut blocks = SampleBlocks::new([1, 1], first, false);
    let mut start = 0;
    for size in block_sizes(first, first + colors.len() as u32) {
        let end = start + size as usize;
        blocks.push(0, size, BlockMean::of_samples(&mut colors[start..end]));
        start = end;
    }
    blocks.mean(0)
}

/// One path with its weight in the pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PathSample {
    /// The sample's number, from 1.
    pub number: u32,
    /// The position in the picture, in pixels with y upwards.
    pub position: [f64; 2],
    /// The sample's weight; the pixel is the weighted mean of its samples.
    pub weight: f64,
    /// The share of the background that the sample hides, if that is asked for.
    #[serde(skip)]
    pub alpha: Option<f32>,
    /// The time, from 0 (the shutter opens) to 1 (it closes), if anything moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The point of the lens that the ray left, relative to the eye, to the right and upwards.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<[f64; 2]>,
    /// The rays of the path, from the eye on.
    pub rays: Vec<PathRay>,
    /// The light that the path found.
    pub color: Rgb,
}

/// A ray of a path, and what happens at its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PathRay {
    /// The number of the vertex at its end, from 1. Surfaces that the path passes straight on have the number of the
    /// next vertex.
    pub depth: u32,
    /// Why the path goes along it.
    pub kind: RayKind,
    /// The ray's origin.
    pub origin: [f64; 3],
    /// The ray's unit direction.
    pub direction: [f32; 3],
    /// The factor of light that arrives along it.
    pub throughput: Rgb,
    /// The end of the ray.
    pub arrival: Arrival,
    /// What happens there, in this order.
    pub steps: Vec<PathStep>,
}

/// The end of a ray of a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Arrival {
    /// It left the scene.
    Miss,
    /// A point of a medium that scatters the path.
    Medium {
        /// The point.
        point: [f64; 3],
    },
    /// A surface.
    Surface(Box<ArrivalSurface>),
}

/// A surface of a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ArrivalSurface {
    /// The object's name.
    pub object: String,
    /// The object's number.
    pub object_id: u32,
    /// The material's name.
    pub material: String,
    /// The point.
    pub point: [f64; 3],
    /// The unit normal on the outer side.
    pub normal: [f32; 3],
    /// The side that the ray hit.
    pub side: Side,
}

/// A step of a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PathStep {
    /// The ray crossed a medium.
    Medium {
        /// The distance in it.
        distance: f64,
        /// The factor of the throughput.
        factor: Rgb,
    },
    /// The surface refracts red, green and blue by different angles. The path goes on for one of them.
    Dispersed {
        /// The channel.
        channel: PathChannel,
        /// The factor of the throughput.
        factor: Rgb,
    },
    /// The end of the ray sends light along it.
    Found {
        /// What sends it.
        emitter: PathEmitter,
        /// The radiance.
        radiance: Rgb,
        /// The densities of the two ways to find it. Without them there is one way, and the weight is 1.
        #[serde(skip_serializing_if = "Option::is_none")]
        densities: Option<PathDensities>,
        /// The weight of this way.
        weight: f32,
        /// What the pixel's sample gains: throughput ⊗ radiance × weight.
        contribution: Rgb,
    },
    /// The sun's disk or a light is at the end of the ray. It adds nothing, since its light comes by shadow rays.
    LeftOut(PathEmitter),
    /// The path goes straight on.
    Passed(Passage),
    /// An overlay covers a share of the surface.
    Overlay {
        /// The colour.
        color: Rgb,
        /// The share.
        share: f32,
        /// What the pixel's sample gains.
        contribution: Rgb,
    },
    /// A source of light is sampled.
    Sampled(Box<SampledNode>),
    /// The path goes on in a random direction.
    Scattered {
        /// The kind of scattering.
        lobe: Lobe,
        /// Whether the guiding field chose the direction instead of a lobe.
        is_guided: bool,
        /// The unit direction.
        direction: [f64; 3],
        /// f |cos θ|.
        f: Rgb,
        /// The density of the direction; of a mirror or a refraction, its probability.
        pdf: f64,
        /// Whether the direction is the only one of its lobe, so that no density weights it.
        is_delta: bool,
        /// The throughput after it.
        throughput: Rgb,
    },
    /// Roulette.
    Roulette {
        /// The probability of survival.
        survival: f32,
        /// Whether the path survives.
        survived: bool,
    },
    /// The path ends.
    End(PathEnd),
}

/// A sampled source of light, as seen from a vertex.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SampledNode {
    /// The name of the light or of the object.
    pub source: String,
    /// The unit direction to the sampled point.
    pub direction: [f64; 3],
    /// The distance to the point; none for light from infinity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
    /// f |cos θ| of the vertex.
    pub f: Rgb,
    /// The radiance of the source; for a light without a surface, its intensity.
    pub radiance: Rgb,
    /// The density of the direction, with the probability of the source.
    pub pdf: f64,
    /// The density of the direction by the scattering; none if no ray finds this light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scattering_pdf: Option<f64>,
    /// The weight of this way to find the light.
    pub weight: f32,
    /// The share of the light that passes what lies between.
    pub visible: Rgb,
    /// What the pixel's sample gains: throughput ⊗ f ⊗ radiance / pdf × weight, if the source is seen.
    pub contribution: Rgb,
    #[serde(skip)]
    sample: SourceSample,
}

/// Explains a pixel of path tracing. The job's camera is relative to the world's origin.
///
/// # Errors
/// [`ExplainError`] if the job's integrator traces no paths, and if there are too many rays.
pub(super) fn path_tree(world: &World, job: &Job, pixel: [u32; 2]) -> Result<PathTree, ExplainError> {
    let Integrator::Path(settings) = job.integrator else { return Err(ExplainError::NoPaths) };
    let ControlFlow::Continue(prepared) = prepare_path(world, job, settings, &()) else {
        return Err(ExplainError::TooManyRays);
    };
    let is_too_much = |rays: u64| rays > MAX_RAYS;
    let mut tracer = prepared.picture_worker(world, job, &is_too_much);
    let mut recorder = PathRecorder::new(world);
    let mut sum = WeightedSum::default();
    let mut renderer = PixelRenderer::new(job);
    let (first, end) = (job.first_sample, job.first_sample + job.sample_count());
    let is_in_passes = job.passes().is_ok();
    let mut colors = Vec::new();
    if is_in_passes {
        renderer.block_with_probe(&mut tracer, pixel, [first, end - first], &mut recorder, &mut colors);
    } else {
        renderer.pixel(&mut tracer, pixel, &mut recorder, &mut sum);
    }
    if tracer.is_cancelled() {
        return Err(ExplainError::TooManyRays);
    }
    let ([x, y], [width, height]) = (pixel, job.camera.size());
    let summing = if is_in_passes { Summing::Blocks { first, clamp: job.clamp } } else { Summing::Weights };
    let color = if is_in_passes { mean_of_blocks(&mut colors, first, job.clamp) } else { sum.mean() };
    let samples = recorder.into_samples();
    let alpha = job.film.alpha.then(|| {
        let weights: f64 = samples.iter().map(|sample| sample.weight).sum();
        let alphas = samples.iter().map(|sample| sample.weight * f64::from(sample.alpha.unwrap_or(1.0)));
        saturate((alphas.sum::<f64>() / weights) as f32)
    });
    Ok(PathTree {
        summing,
        pixel,
        chapter_pixel: [x, height - 1 - y],
        size: [width, height],
        samples,
        color,
        developed: DevelopedNode::new(color, alpha, &job.developing()),
    })
}

impl PathTree {
    /// The pixel's colour from its factors: every product and sum is repeated in the picture's order. Equal to `color`
    /// bit for bit.
    pub fn sum(&self) -> Rgb {
        let mut colors: Vec<Rgb> = self.samples.iter().map(PathSample::sum).collect();
        match self.summing {
            Summing::Blocks { first, clamp } => mean_of_blocks(&mut colors, first, clamp),
            Summing::Weights => {
                let mut sum = WeightedSum::default();
                colors.iter().zip(&self.samples).for_each(|(color, sample)| sum.add(*color, sample.weight));
                sum.mean()
            }
        }
    }

    /// The index of the sample that adds most to the pixel.
    pub fn brightest(&self) -> Option<usize> {
        let value = |index: usize| self.samples[index].value();
        (0..self.samples.len()).max_by(|a, b| value(*a).total_cmp(&value(*b)).then(b.cmp(a)))
    }

    /// The index of the sample whose colour is nearest to the pixel's.
    pub fn nearest_to_mean(&self) -> Option<usize> {
        let distance = |sample: &PathSample| {
            let [r, g, b] = (sample.color - self.color).to_array().map(f64::from);
            r * r + g * g + b * b
        };
        (0..self.samples.len()).min_by(|a, b| distance(&self.samples[*a]).total_cmp(&distance(&self.samples[*b])))
    }
}

impl PathSample {
    /// The light of the path from its factors, each product and sum repeated in the picture's order.
    pub fn sum(&self) -> Rgb {
        let (mut light, mut throughput) = (Rgb::BLACK, Rgb::WHITE);
        for step in self.rays.iter().flat_map(|ray| &ray.steps) {
            match step {
                PathStep::Medium { factor, .. } | PathStep::Dispersed { factor, .. } => {
                    throughput = throughput * *factor;
                }
                PathStep::Found { radiance, densities, .. } => {
                    let arriving = densities.map_or(*radiance, |d| *radiance * d.weight_of_scattering());
                    light += (throughput * arriving).saturated();
                }
                PathStep::Overlay { color, share, .. } => {
                    light += (throughput * *color * *share).saturated();
                    throughput *= 1.0 - share;
                }
                PathStep::Sampled(node) => {
                    light += (throughput * (node.sample.light() * node.visible).saturated()).saturated();
                }
                PathStep::Scattered { f, pdf, .. } => {
                    throughput = (throughput * *f * (1.0 / pdf) as f32).saturated();
                }
                PathStep::Roulette { survival, survived: true } => throughput *= 1.0 / survival,
                PathStep::Roulette { .. } | PathStep::LeftOut(_) | PathStep::Passed(_) | PathStep::End(_) => {}
            }
        }
        light.saturated()
    }
}
