//! Many paths side by side: all go on by one surface at a time, and their rays are traced together.
//!
//! Each path takes the steps of [`PathTracer::path`] in that order, so its colour has equal bits.

use super::PathTracer;
use super::direct::ShadowRay;
use super::escapes::Escapes;
use super::light_sampler::Source;
use super::queues::VertexQueues;
use super::trace::{Arrival, Path};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use crate::world::RayBundle;

/// The most paths that are traced together.
pub(super) const PATHS: usize = 1024;

/// The paths of one thread that are traced together.
#[derive(Default)]
pub(super) struct PathStream {
    paths: Vec<Path>,
    colors: Vec<Rgb>,
    /// The numbers of the paths that go on.
    active: Vec<u32>,
    shadows: Vec<PathShadow>,
    /// The shadow rays by their sources: [`PathShadow::key`].
    shadow_order: Vec<u64>,
    /// Vertices of which eight of one kind are shaded together.
    queues: VertexQueues,
    /// Paths of which eight are ended together.
    escapes: Escapes,
    /// For each path whether it has ended.
    ended: Vec<bool>,
    bundle: RayBundle,
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
    /// A number that sorts shadow rays by their sources, lights first. Its lowest bits are the index.
    fn key(&self, index: usize) -> u64 {
        let (kind, number) = match self.ray.source {
            Source::Light(number) => (0, number),
            Source::Emitter(number) => (1, number),
            Source::Environment => (2, 0),
        };
        (kind << 32 | u64::from(number)) << INDEX_BITS | index as u64
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
        let PathStream { paths, colors, active, shadows, shadow_order, queues, escapes, ended, bundle } = &mut stream;
        active.clear();
        active.extend(0..paths.len() as u32);
        ended.clear();
        ended.resize(paths.len(), false);
        while !active.is_empty() && !self.is_cancelled {
            self.poll(active.len() as u32);
            bundle.clear();
            active.iter().for_each(|&number| bundle.push(*paths[number as usize].ray(), f32::INFINITY));
            if self.world.moves() {
                bundle.set_times(active.iter().map(|&number| paths[number as usize].time));
            }
            self.world.intersect_batch(bundle);
            shadows.clear();
            for (index, &number) in active.iter().enumerate() {
                let hit = bundle.hit(index);
                if let Some(hit) = &hit {
                    let end = |path: u32| ended[path as usize] = true;
                    if self.push_opaque(queues, (number, hit), paths, shadows, end) {
                        continue;
                    }
                } else if self.push_escape(escapes, number, paths) {
                    ended[number as usize] = true;
                    continue;
                }
                self.set_time(paths[number as usize].time);
                match self.arrive(&mut paths[number as usize], hit, &mut ()) {
                    Arrival::Surface(vertex) => {
                        let end = |path: u32| ended[path as usize] = true;
                        self.push_vertex(queues, (number, vertex), paths, shadows, end);
                    }
                    Arrival::Step(step) => {
                        let shadow = |(ray, throughput)| PathShadow { path: number, ray, throughput };
                        shadows.extend(step.shadow.map(shadow));
                        ended[number as usize] = !step.goes_on;
                    }
                }
            }
            self.scatter_waiting(queues, paths, shadows, |path: u32| ended[path as usize] = true);
            self.end_escapes(escapes, paths);
            active.retain(|&number| !ended[number as usize]);
            self.trace_shadows(shadows, shadow_order, bundle, paths);
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
        order.extend(shadows.iter().enumerate().map(|(index, shadow)| shadow.key(index)));
        order.sort_unstable();
        let shadow = |key: u64| &shadows[(key & ((1 << INDEX_BITS) - 1)) as usize];
        let is_light = |key: u64| matches!(shadow(key).ray.source, Source::Light(_));
        for group in order.chunk_by(|a, b| is_light(*a) == is_light(*b)) {
            let is_light = is_light(group[0]);
            bundle.clear();
            for key in group {
                let ShadowRay { ray, t_max, .. } = shadow(*key).ray;
                bundle.push(ray, t_max);
            }
            if self.world.moves() {
                bundle.set_times(group.iter().map(|key| paths[shadow(*key).path as usize].time));
            }
            if is_light {
                self.world.occlusion_batch(bundle, &mut self.occluder);
            } else {
                self.world.intersect_batch(bundle);
            }
            for (index, key) in group.iter().enumerate() {
                let PathShadow { path, ray, throughput } = shadow(*key);
                self.set_time(paths[*path as usize].time);
                let visible = match is_light {
                    true => self.visible_past(ray, bundle.occlusion(index)),
                    false => self.visible_at(ray, bundle.hit(index)),
                };
                paths[*path as usize].light += (*throughput * (ray.light * visible).saturated()).saturated();
            }
        }
    }
}
