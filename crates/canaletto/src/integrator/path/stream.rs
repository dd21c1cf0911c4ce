//! Many paths side by side: all go on by one surface at a time, and their rays are traced together.
//!
//! Each path takes the steps of [`PathTracer::path`] in that order, so its colour has equal bits.

use super::PathTracer;
use super::direct::ShadowRay;
use super::escapes::Escapes;
use super::light_sampler::{LightSampler, Source};
use super::queues::VertexQueues;
use super::trace::{Arrival, Path};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::world::RayBundle;
use canaletto_bvh::Ray;

/// The most paths that are traced together.
pub(super) const PATHS: usize = 1024;

/// The paths of one thread that are traced together.
#[derive(Default)]
pub(super) struct PathStream {
    paths: Vec<Path>,
    colors: Vec<Rgb>,
    /// The paths whose rays are traced, and those that go on from there.
    wave: Wave,
    next: Wave,
    shadows: Vec<PathShadow>,
    /// The shadow rays by their sources: [`PathShadow::key`].
    shadow_order: Vec<u64>,
    /// Vertices of which eight of one kind are shaded together.
    queues: VertexQueues,
    /// Paths of which eight are ended together.
    escapes: Escapes,
    shadow_rays: RayBundle,
}

/// The numbers of paths, with the rays that they go along.
#[derive(Default)]
pub(super) struct Wave {
    paths: Vec<u32>,
    rays: RayBundle,
}

impl Wave {
    fn clear(&mut self) {
        self.paths.clear();
        self.rays.clear();
    }

    /// Adds a path that goes on.
    #[inline(always)]
    pub(super) fn push(&mut self, number: u32, ray: Ray) {
        self.paths.push(number);
        self.rays.push(ray, f32::INFINITY);
    }
}

/// A shadow ray of a path.
pub(super) struct PathShadow {
    /// The path's number.
    pub(super) path: u32,
    pub(super) ray: ShadowRay,
    /// The throughput of the path where it leaves.
    pub(super) throughput: Rgb,
}

/// The bits of a shadow ray's key that hold its index.
const INDEX_BITS: u32 = 24;

const _: () = assert!(PATHS <= 1 << INDEX_BITS);

impl PathShadow {
    /// A number that sorts shadow rays by their sources, those first that any hit hides. Its lowest bits are the index.
    fn key(&self, index: usize, lights: &LightSampler) -> u64 {
        let asks_nearest = u64::from(!lights.is_hidden_by_any(self.ray.source));
        let (kind, number) = match self.ray.source {
            Source::Light(number) => (0, number),
            Source::Emitter(number) => (1, number),
            Source::Environment => (2, 0),
        };
        ((asks_nearest << 2 | kind) << 32 | u64::from(number)) << INDEX_BITS | index as u64
    }
}

impl PathStream {
    /// The number of paths.
    pub(super) fn len(&self) -> usize {
        self.paths.len()
    }

    /// The colours of the paths that were traced last.
    pub(super) fn colors(&self) -> &[Rgb] {
        &self.colors
    }
}

impl PathTracer<'_> {
    /// Adds a path that begins with a camera ray.
    pub(super) fn push_path(&mut self, line: DRay, differential: Option<RayDifferential>, sample: Sample) {
        if self.stream.paths.is_empty() {
            self.media.clear();
        }
        let path = self.start(line, differential, sample);
        self.stream.paths.push(path);
    }

    /// Traces all paths to their ends.
    pub(super) fn trace_stream(&mut self) {
        let mut stream = std::mem::take(&mut self.stream);
        let PathStream { paths, colors, wave, next, shadows, shadow_order, queues, escapes, shadow_rays } = &mut stream;
        wave.clear();
        (0..).zip(&*paths).for_each(|(number, path)| wave.push(number, *path.ray()));
        while !wave.paths.is_empty() && !self.is_cancelled {
            self.poll(wave.paths.len() as u32);
            if self.moves {
                wave.rays.set_times(wave.paths.iter().map(|&number| paths[number as usize].time));
            }
            self.world.intersect_batch(&mut wave.rays);
            next.clear();
            shadows.clear();
            for (index, &number) in wave.paths.iter().enumerate() {
                let hit = wave.rays.hit(index);
                let is_taken = match &hit {
                    Some(hit) => self.push_opaque(queues, (number, hit), paths, shadows, next),
                    None => self.push_escape(escapes, number, paths),
                };
                if is_taken {
                    continue;
                }
                let path = &mut paths[number as usize];
                self.set_time(path.time);
                match self.arrive(path, hit, &mut ()) {
                    Arrival::Surface(vertex) => self.push_vertex(queues, (number, vertex), paths, shadows, next),
                    Arrival::Step(step) => {
                        let shadow = |(ray, throughput)| PathShadow { path: number, ray, throughput };
                        shadows.extend(step.shadow.map(shadow));
                        if step.goes_on {
                            next.push(number, *path.ray());
                        }
                    }
                }
            }
            self.scatter_waiting(queues, paths, shadows, next);
            self.end_escapes(escapes, paths);
            self.trace_shadows(shadows, shadow_order, shadow_rays, paths);
            std::mem::swap(wave, next);
        }
        colors.clear();
        colors.extend(paths.iter().map(|path| path.light.saturated()));
        paths.clear();
        self.stream = stream;
    }

    /// Adds the light of sampled sources to the paths.
    fn trace_shadows(
        &mut self,
        shadows: &[PathShadow],
        order: &mut Vec<u64>,
        bundle: &mut RayBundle,
        paths: &mut [Path],
    ) {
        // Rays to one light often have one occluder. Each path has one shadow ray, so that the order changes no sum.
        order.clear();
        order.extend(shadows.iter().enumerate().map(|(index, shadow)| shadow.key(index, self.lights)));
        order.sort_unstable();
        let shadow = |key: u64| &shadows[(key & ((1 << INDEX_BITS) - 1)) as usize];
        let lights = self.lights;
        let asks_any = |key: u64| lights.is_hidden_by_any(shadow(key).ray.source);
        for group in order.chunk_by(|a, b| asks_any(*a) == asks_any(*b)) {
            let asks_any = asks_any(group[0]);
            bundle.clear();
            for key in group {
                let ShadowRay { ray, t_max, .. } = shadow(*key).ray;
                bundle.push(ray, t_max);
            }
            if self.moves {
                bundle.set_times(group.iter().map(|key| paths[shadow(*key).path as usize].time));
            }
            if asks_any {
                self.world.occlusion_batch(bundle, &mut self.occluder);
            } else {
                self.world.intersect_batch(bundle);
            }
            for (index, key) in group.iter().enumerate() {
                let PathShadow { path, ray, throughput } = shadow(*key);
                self.set_time(paths[*path as usize].time);
                let visible = match asks_any {
                    true => self.visible_past(ray, bundle.occlusion(index)),
                    false => self.visible_at(ray, bundle.hit(index)),
                };
                paths[*path as usize].light += (*throughput * (ray.light * visible).saturated()).saturated();
            }
        }
    }
}
