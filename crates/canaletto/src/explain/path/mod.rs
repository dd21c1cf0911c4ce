//! The explanation of a pixel of path tracing: the paths behind it, with every factor as a number.

mod record;
mod svg;
#[cfg(test)]
mod tests;
mod text;

use super::developed::DevelopedNode;
use super::summing::Summing;
use super::tree::Side;
use crate::integrator::{Passage, PathChannel, PathDensities, PathEmitter, PathEnd, RayKind, SourceSample};
use crate::material::Lobe;
use crate::math::{Rgb, saturate};
use crate::render::PlacedJob;
pub(super) use record::PathRecorder;
use serde::Serialize;

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
    /// The point of the lens that the ray left, relative to its centre, to the right and upwards.
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

impl PathTree {
    /// The tree of a pixel's recorded paths.
    pub(super) fn new(job: &PlacedJob<'_>, [x, y]: [u32; 2], recorder: PathRecorder, color: Rgb) -> PathTree {
        let ([width, height], samples) = (job.camera.size(), recorder.into_samples());
        let alpha = job.divides_by_alpha().then(|| {
            let weights: f64 = samples.iter().map(|sample| sample.weight).sum();
            let alphas = samples.iter().map(|sample| sample.weight * f64::from(sample.alpha.unwrap_or(1.0)));
            saturate((alphas.sum::<f64>() / weights) as f32)
        });
        PathTree {
            summing: Summing::of(job),
            pixel: [x, y],
            chapter_pixel: [x, height - 1 - y],
            size: [width, height],
            samples,
            color,
            developed: DevelopedNode::new(color, alpha, &job.developing()),
        }
    }

    /// The pixel's colour from its factors: every product and sum is repeated in the picture's order. Equal to `color`
    /// bit for bit.
    pub fn sum(&self) -> Rgb {
        self.summing.color(self.samples.iter().map(|sample| (sample.sum(), sample.weight)))
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
