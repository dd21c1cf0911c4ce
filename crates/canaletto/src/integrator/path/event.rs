//! What happens along a path, in the order in which it happens. An explanation records it.

use crate::material::{BsdfSample, MaterialPoint, Medium};
use crate::math::Rgb;
use crate::shape::Surface;
use crate::world::Hit;
use canaletto_bvh::Ray;
use canaletto_bvh::lanes::Real64;
use glam::DVec3;
use serde::Serialize;

/// An event along a path.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum PathEvent<'a> {
    /// The path goes along a ray to its next vertex. `depth` counts the vertices that scatter light, from 1.
    Ray {
        /// The ray.
        ray: &'a Ray,
        /// The number of the vertex at its end.
        depth: u32,
    },
    /// The ray crosses a medium, up to its hit or to the point where it is scattered.
    Medium {
        /// The medium.
        medium: &'a Medium,
        /// The distance in it.
        distance: f64,
        /// The factor of the throughput.
        factor: Rgb,
        /// The point where it is scattered, if it is.
        scattered: Option<DVec3>,
    },
    /// The ray arrives at a surface.
    Surface {
        /// The hit.
        hit: &'a Hit,
        /// The geometry there.
        surface: &'a Surface,
        /// The material there.
        material: &'a MaterialPoint,
        /// Whether the ray hit the outer side.
        outside: bool,
    },
    /// The ray leaves the scene.
    Miss,
    /// The surface, the environment or the background sends light along the ray.
    Found {
        /// What sends it.
        emitter: PathEmitter,
        /// The radiance.
        radiance: Rgb,
        /// The densities of the two ways to find this light. None if there is one way only.
        densities: Option<PathDensities>,
    },
    /// The sun or a light is there, but shadow rays have asked for its light already, or it lights nothing.
    LeftOut(PathEmitter),
    /// The surface refracts red, green and blue by different angles, and the path goes on for one of them.
    Dispersed {
        /// The channel.
        channel: PathChannel,
        /// The factor of the throughput in the channel: the sum of all three over this one. It is 0 in the others.
        factor: Rgb,
    },
    /// The path goes straight on through the surface.
    Passed(Passage),
    /// An overlay of this colour has this share of the surface.
    Overlay {
        /// The colour.
        color: Rgb,
        /// The share, 0 to 1.
        share: f32,
    },
    /// A source of light is sampled.
    Sampled(&'a SourceSample),
    /// The share of the sampled source's light that passes what lies between.
    Visible(Rgb),
    /// The path goes on in a random direction.
    Scattered {
        /// The direction, with its density by the guiding field and the surface together.
        sample: &'a BsdfSample,
        /// The part of the guiding field, if there is one at the vertex.
        guiding: Option<GuidedSample>,
    },
    /// The path survives roulette with this probability, which its throughput is divided by.
    Roulette {
        /// The probability.
        survival: f32,
        /// Whether it survives.
        survived: bool,
    },
    /// The path ends.
    End(PathEnd),
}

/// The part of the guiding field in a random direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedSample {
    /// Whether the field chose the direction. No lobe did then, and that of the sample is diffuse.
    pub is_chosen: bool,
    /// The field's density of the direction; 0 of a mirror or a refraction.
    pub pdf: f64,
    /// The density by the surface's scattering alone.
    pub pdf_scattering: f64,
}

/// What light that a path finds comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PathEmitter {
    /// The surface at the end of the ray.
    Surface,
    /// The environment.
    Environment,
    /// The background.
    Background,
}

/// The channel of a path that carries only one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PathChannel {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
}

impl PathChannel {
    /// All channels in the order of [`Rgb`].
    pub const ALL: [PathChannel; 3] = [PathChannel::Red, PathChannel::Green, PathChannel::Blue];
}

/// The densities per unit of solid angle with which two ways find the same light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PathDensities {
    /// By the scattering at the vertex before.
    pub scattering: f64,
    /// By sampling sources there.
    pub source: f64,
}

/// A sampled source of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSample {
    /// What is sampled.
    pub source: SampledSource,
    /// The vector to the sampled point, or a unit vector to an infinitely far source.
    pub to: DVec3,
    /// Whether the source is infinitely far.
    pub is_infinite: bool,
    /// f |cos θ| of the vertex.
    pub f: Rgb,
    /// The radiance of the source; for a light without a surface, its intensity.
    pub radiance: Rgb,
    /// The density of the direction, times the probability of the source.
    pub pdf: f64,
    /// The density of the direction by the scattering at the vertex; none for light that no ray finds.
    pub scattering_pdf: Option<f64>,
}

/// A source that is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SampledSource {
    /// A light: index into [`crate::world::World::lights`].
    Light(u32),
    /// An emitting surface.
    Surface {
        /// The number of the instance.
        instance: u32,
        /// One of its primitives that emits.
        primitive: u32,
    },
    /// The environment.
    Environment,
}

/// Why a path goes straight on through a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Passage {
    /// Part of the surface is missing.
    Coverage,
    /// Both sides have one η.
    IndexMatched,
}

/// Why a path ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PathEnd {
    /// It left the scene.
    Miss,
    /// It has as many vertices as `max-depth` allows.
    MaxDepth,
    /// The vertex scatters nothing in the random direction.
    Absorbed,
    /// Roulette.
    Roulette,
}

impl PathDensities {
    /// The weight of light that scattering found (power heuristic; Veach & Guibas 1995).
    pub fn weight_of_scattering(&self) -> f32 {
        power_heuristic(self.scattering, self.source)
    }
}

impl SourceSample {
    /// The weight of the sample.
    pub fn weight(&self) -> f32 {
        self.scattering_pdf.map_or(1.0, |scattering| power_heuristic(self.pdf, scattering))
    }

    /// The light that the vertex sends back if nothing hides the source, with its weight.
    pub fn light(&self) -> Rgb {
        self.f * self.radiance * (1.0 / self.pdf) as f32 * self.weight()
    }
}

/// The weight of a sample whose own density is `pdf`, where another way has density `other`.
#[inline(always)]
pub(super) fn power_heuristic<F: Real64>(pdf: F, other: F) -> F::Narrow {
    // Densities may overflow when squared.
    let ratio = other / pdf;
    let one = F::splat(1.0);
    (one / (one + ratio * ratio)).narrow()
}
