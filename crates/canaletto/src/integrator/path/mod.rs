//! Path tracing (Kajiya 1986): the light along a camera ray by one random path, without bias.
//!
//! At each surface a light is chosen and a ray asks for it (next-event estimation). The path goes on in a direction of
//! the surface's scattering. Light that both can find is weighted by the power heuristic (Veach & Guibas 1995). Russian
//! roulette ends paths of small throughput (Arvo & Kirk 1990).
//!
//! The units are those of the chapter: a light of intensity l gives a white matte surface that faces it the radiance l
//! (5.32). Ambient light isn't added, since it stands for the light that paths find.
//!
//! Each light path is counted once. Shadow rays to lights pass smooth clear bodies straight on, as in (5.39a). The sun
//! and others of these lights are seen, too: paths find them in mirrors, but not again through clear bodies. The light
//! of surfaces and of the environment passes bodies that bend it along paths only.

mod description;
mod direct;
mod emitter;
mod escapes;
mod event;
mod guiding;
mod light_sampler;
mod light_tree;
mod meter;
mod queues;
mod see_through;
mod source_points;
mod stream;
#[cfg(test)]
mod tests;
mod trace;
mod training;
mod vertex;

use super::media::Media;
use super::{Cancelled, Counts, PreparedRayIntegrator, Probe, RayCounts, RayIntegrator};
use crate::light::PreparedLight;
use crate::light::environment::BlockWeights;
use crate::material::MaterialModel;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Sample, Sampler};
use crate::scene::PathSettings;
use crate::world::{OccluderCache, World};
use canaletto_bvh::lanes::LANES;
pub use event::{
    GuidedSample, Passage, PathChannel, PathDensities, PathEmitter, PathEnd, PathEvent, SampledSource, SourceSample,
};
pub use guiding::GuidingField;
use guiding::{GuidingRecord, GuidingRecorder};
use light_sampler::LightSampler;
pub use meter::PathMeter;
use queues::OpaqueMaterials;
use std::sync::Arc;
use stream::PathStream;
pub(crate) use training::learn_field;

/// What the threads of path tracing share.
pub(crate) struct PreparedPath {
    settings: PathSettings,
    lights: LightSampler,
    has_media: bool,
    sees_through: bool,
    warnings: Vec<String>,
    opaque: OpaqueMaterials,
    /// Where light comes from, if that was learnt.
    guide: Option<Arc<GuidingField>>,
}

impl PreparedPath {
    /// Prepares the lights of a world.
    pub(crate) fn new(world: &World, settings: PathSettings) -> PreparedPath {
        let lights = LightSampler::new(world);
        let used = world.materials_in_use();
        let in_use = || world.materials().iter().zip(&used).filter(|(_, used)| **used).map(|(material, _)| material);
        let gains: Vec<&str> =
            in_use().filter(|material| gains_light(&material.model)).map(|material| material.name.as_str()).collect();
        let warnings = match gains[..] {
            [] => Vec::new(),
            [first, ref more @ ..] => {
                let others = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
                vec![format!(
                    "material \"{first}\"{others} would return more light than arrives (kd + 2 ks / (n + 1) + k + 1 - o is \
                     more than 1), so path tracing makes it darker"
                )]
            }
        };
        let has_media = has_media(world);
        let sees_through = has_media || in_use().any(|material| material.has_holes() || material.may_pass_straight());
        PreparedPath {
            settings,
            lights,
            has_media,
            sees_through,
            warnings,
            opaque: OpaqueMaterials::new(world),
            guide: None,
        }
    }
}

impl PreparedPath {
    /// Prepares rays that only look for features.
    pub(crate) fn without_lights(world: &World) -> PreparedPath {
        PreparedPath {
            settings: PathSettings { roulette: false, ..PathSettings::DEFAULT },
            lights: LightSampler::default(),
            has_media: has_media(world),
            sees_through: false,
            warnings: Vec::new(),
            opaque: OpaqueMaterials::new(world),
            guide: None,
        }
    }

    /// Guides paths by a field, or no more.
    pub(crate) fn set_guide(&mut self, guide: Option<Arc<GuidingField>>) {
        self.guide = guide.filter(|guide| guide.cell_count() > 0);
    }
}

impl PreparedRayIntegrator for PreparedPath {
    fn preparation_counts(&self) -> Counts {
        let cells = self.guide.iter().map(|guide| ("guiding cells", guide.cell_count() as u64));
        Counts { warnings: self.warnings.clone(), others: cells.collect(), ..Counts::default() }
    }

    type Worker<'a> = PathTracer<'a>;

    fn worker<'a>(&'a self, world: &'a World, cancelled: Cancelled<'a>) -> PathTracer<'a> {
        PathTracer {
            world,
            settings: self.settings,
            lights: &self.lights,
            opaque: &self.opaque,
            guide: self.guide.as_deref(),
            moves: world.moves(),
            has_media: self.has_media,
            sees_through: self.sees_through,
            backdrop: world.backdrop,
            counts: RayCounts::default(),
            cancelled,
            is_cancelled: false,
            rays_until_poll: RAYS_PER_POLL,
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            moved_lights: if world.lights_move() { world.lights.clone() } else { Vec::new() },
            media: Media::default(),
            blocks: Default::default(),
            occluder: OccluderCache::NONE,
            stream: PathStream::default(),
        }
    }
}

/// Whether any material in use has a medium.
fn has_media(world: &World) -> bool {
    let mut all = world.materials().iter().zip(world.materials_in_use());
    all.any(|(material, used)| used && !material.medium.is_vacuum())
}

/// Whether a material would return more light than arrives. Models of physics never do.
fn gains_light(model: &MaterialModel) -> bool {
    matches!(model, MaterialModel::Phong(phong) if phong.largest_albedo() > 1.0 + 1e-6)
}

/// The number of rays between two calls of the cancel callback.
const RAYS_PER_POLL: u32 = 4096;

/// Path tracing in one thread.
pub(crate) struct PathTracer<'w> {
    world: &'w World,
    settings: PathSettings,
    lights: &'w LightSampler,
    opaque: &'w OpaqueMaterials,
    guide: Option<&'w GuidingField>,
    /// Whether anything moves while the shutter is open.
    moves: bool,
    /// Whether bodies absorb or scatter light.
    has_media: bool,
    /// Whether shadow rays to all sources pass surfaces: partial coverage, and what light passes straight on.
    sees_through: bool,
    /// The colour that camera rays see straight on instead of the environment or the background.
    backdrop: Option<Rgb>,
    counts: RayCounts,
    cancelled: Cancelled<'w>,
    is_cancelled: bool,
    rays_until_poll: u32,
    /// The source of random numbers.
    sample: Sample,
    /// The time of the current sample or path, from 0 (the shutter opens) to 1 (it closes).
    time: f32,
    /// The world's lights at that time; empty if no light moves.
    moved_lights: Vec<PreparedLight>,
    /// The media that the path is in.
    media: Media,
    /// The weights of the environment's blocks at the last vertices, by lane. A single vertex has the first lane.
    blocks: [BlockWeights; LANES],
    /// The last occluder of shadow rays.
    occluder: OccluderCache,
    stream: PathStream,
}

impl PathTracer<'_> {
    /// Counts rays towards the next call of the cancel callback, and calls it when it is due.
    fn poll(&mut self, rays: u32) {
        self.rays_until_poll = self.rays_until_poll.saturating_sub(rays);
        if self.rays_until_poll == 0 {
            self.rays_until_poll = RAYS_PER_POLL;
            self.is_cancelled |= (self.cancelled)(self.counts.total());
        }
    }

    /// Goes to a time from 0 (the shutter opens) to 1 (it closes), which is 0 for all paths where nothing moves.
    #[inline(always)]
    fn set_time(&mut self, time: f32) {
        if self.moves && time != self.time {
            self.time = time;
            self.world.move_lights(&mut self.moved_lights, time);
        }
    }

    /// The light at the current time.
    fn light(&self, number: u32) -> &PreparedLight {
        self.moved_lights.get(number as usize).unwrap_or(&self.world.lights[number as usize])
    }
}

impl<'w> RayIntegrator<'w> for PathTracer<'w> {
    const BATCH_SIZE: usize = stream::PATHS;

    fn world(&self) -> &'w World {
        self.world
    }

    fn replace_background(&mut self, radiance: Rgb) {
        self.backdrop = Some(radiance);
    }

    fn alpha(&mut self, line: DRay) -> f32 {
        self.hidden_behind(line)
    }

    fn begin(&mut self, sample: Sample, time: f32) {
        self.sample = sample;
        self.set_time(time);
    }

    fn eye(&mut self, line: DRay, differential: Option<&RayDifferential>, probe: &mut dyn Probe) -> Rgb {
        self.path(line, differential.copied(), self.sample, probe)
    }

    fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        times: &[f32],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        let mut differentials = differentials.into_iter();
        for (index, (line, sample)) in lines.iter().zip(samples).enumerate() {
            self.set_time(times.get(index).copied().unwrap_or(0.0));
            self.push_path(*line, differentials.next(), *sample);
        }
    }

    fn is_full(&self) -> bool {
        self.stream.len() >= Self::BATCH_SIZE
    }

    fn trace_pending(&mut self) -> &[Rgb] {
        self.trace_stream();
        self.stream.colors()
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }

    fn counts(&mut self) -> &mut RayCounts {
        &mut self.counts
    }
}
