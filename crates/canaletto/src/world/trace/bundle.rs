//! Queries for batches of rays. Results equal those of single rays bit for bit.
//!
//! In a world of few instances, each instance is tested with all groups of rays that may hit it. In a world of many
//! instances or of groups, the hierarchy finds the rays of each instance (`bundle_tree`). A mesh, a cloud or a geometry
//! of many shapes sends its rays through its tree in packets, and scattered rays at a mesh go as a stream. Few shapes
//! are tested one after the other with the rays near them (`shape_list`). Shadow rays are traced one by one at a
//! geometry of more than a few primitives of which some may be clear.

use crate::shape::{SURFACES, Vec3x8, vec3};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE};
use crate::world::data::packet_bounds::GROUP;
use crate::world::trace::batch_query::{BatchQuery, BatchRays, Blockers, NearestHits, Target};
use crate::world::trace::bundle_tree::InstanceBuffers;
use crate::world::trace::occlusion::{OccluderCache, Occlusion};
use crate::world::trace::query::Hit;
use crate::world::trace::rays::{RayRange, Rays, end, for_candidate_runs};
use crate::world::trace::shape_list;
use canaletto_bvh::{PrimitiveHit, Ray};
use glam::Vec3;

/// The most instances that are each tested with all rays.
pub(in crate::world) const MAX_LISTED: usize = 8;

/// The fewest primitives that are tested with packets.
const MIN_PACKET_PRIMITIVES: usize = 32;

/// The fewest rays that form packets.
const MIN_PACKET_RAYS: usize = 8;

/// The fewest rays that form packets or streams at a mesh. Fewer are scattered rays, or rays at a distant copy among
/// many. Their triangles differ, and a packet then costs as much as a group of sixteen.
const MIN_MESH_PACKET_RAYS: usize = 16;

/// The cosine of the largest angle between rays of a packet at a mesh, 18 degrees. Scattered rays take 1.5 times as
/// long in packets as in streams.
const COHERENT: f32 = 0.951;

/// A batch of rays of one query, and the results. Neighbouring rays should be nearly parallel.
#[derive(Debug, Default)]
pub struct RayBundle {
    rays: Rays,
    /// The `t_max` of each ray.
    t_max: Vec<f32>,
    /// The time of each ray; empty if that is 0 for all rays.
    times: Vec<f32>,
    /// The hit of each ray, by [`World::intersect_batch`].
    nearest: Vec<Hit>,
    /// The occlusion of each ray, by [`World::occlusion_batch`].
    occlusion: Vec<Occlusion>,
    /// The results of one geometry.
    found: Vec<PrimitiveHit>,
    /// The end of each ray that isn't blocked yet.
    open: Vec<f32>,
    /// The ends of the rays at one geometry.
    ends: Vec<f32>,
    buffers: InstanceBuffers,
}

impl RayBundle {
    /// Removes all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.t_max.clear();
        self.times.clear();
    }

    /// Replaces the rays. Each has this `t_max`, and time 0.
    pub fn set(&mut self, rays: &[Ray], t_max: f32) {
        self.clear();
        self.rays.rays.extend_from_slice(rays);
        self.t_max.resize(rays.len(), t_max);
    }

    /// Adds a ray with its `t_max`. Its time is 0.
    #[inline]
    pub fn push(&mut self, ray: Ray, t_max: f32) {
        self.rays.rays.push(ray);
        self.t_max.push(t_max);
    }

    /// Sets the times of the rays, from 0 (the shutter opens) to 1 (it closes). Rays beyond the list have time 0.
    pub fn set_times(&mut self, times: impl IntoIterator<Item = f32>) {
        self.times.clear();
        self.times.extend(times);
    }

    /// Adds those of eight rays whose bit is set, each with its `t_max`.
    #[inline]
    pub(crate) fn push_some(&mut self, bits: u32, origins: &Vec3x8, directions: &Vec3x8, t_max: &[f32; SURFACES]) {
        if bits == 0 {
            return;
        }
        // Each ray is written, and the next one overwrites it if its bit isn't set. There is no branch to mispredict.
        let mut end = self.t_max.len();
        self.rays.rays.resize(end + SURFACES, Ray { origin: Vec3::ZERO, direction: Vec3::ZERO });
        self.t_max.resize(end + SURFACES, 0.0);
        for (lane, &reach) in t_max.iter().enumerate() {
            self.rays.rays[end] = Ray { origin: vec3(origins, lane), direction: vec3(directions, lane) };
            self.t_max[end] = reach;
            end += (bits >> lane & 1) as usize;
        }
        self.rays.rays.truncate(end);
        self.t_max.truncate(end);
    }

    /// Whether the batch has no rays.
    pub fn is_empty(&self) -> bool {
        self.t_max.is_empty()
    }

    /// The number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.t_max.len()
    }

    /// The ray at `index` and its `t_max`.
    #[inline]
    pub fn ray(&self, index: usize) -> (Ray, f32) {
        (self.rays.rays[index], self.t_max[index])
    }

    /// The hit of the ray at `index`, after [`World::intersect_batch`].
    #[inline]
    pub fn hit(&self, index: usize) -> Option<Hit> {
        self.nearest[index].real()
    }

    /// Keeps the rays for which `goes_on` returns true. It gets the index of a ray, the ray, its `t_max` and its hit,
    /// and may change the ray and its `t_max`.
    pub(in crate::world) fn retain(&mut self, mut goes_on: impl FnMut(usize, &mut Ray, &mut f32, Option<Hit>) -> bool) {
        let Self { rays, t_max, times, nearest, .. } = self;
        let mut left = 0;
        for index in 0..t_max.len() {
            let (mut ray, mut end) = (rays.rays[index], t_max[index]);
            if goes_on(index, &mut ray, &mut end, nearest[index].real()) {
                (rays.rays[left], t_max[left]) = (ray, end);
                if let Some(&time) = times.get(index) {
                    times[left] = time;
                }
                left += 1;
            }
        }
        rays.rays.truncate(left);
        rays.change();
        t_max.truncate(left);
        times.truncate(left);
    }

    /// The occlusion of the ray at `index`, after [`World::occlusion_batch`].
    #[inline]
    pub fn occlusion(&self, index: usize) -> Occlusion {
        self.occlusion[index]
    }
}

impl World {
    /// [`World::intersect_at`] for each ray of a batch. [`RayBundle::hit`] returns the results.
    pub fn intersect_batch(&self, bundle: &mut RayBundle) {
        self.intersect_bundle_with(bundle, |_| true);
    }

    /// [`World::intersect_batch`], restricted to those of the root's instances for which `counts` returns true.
    pub(in crate::world) fn intersect_bundle_with(&self, bundle: &mut RayBundle, counts: impl Fn(u32) -> bool) {
        let RayBundle { rays, t_max, times, nearest, found, buffers, .. } = bundle;
        nearest.clear();
        nearest.extend(t_max.iter().map(|&t_max| Hit::none(t_max, 0.0)));
        nearest.iter_mut().zip(&*times).for_each(|(hit, &time)| hit.time = time);
        if !self.geometry.unbounded.is_empty() {
            rays.rays.iter().zip(&mut *nearest).for_each(|(ray, best)| self.try_unbounded(ray, best));
        }
        buffers.bound_groups(self, &rays.rays, t_max);
        let mut query = NearestHits { nearest, found };
        self.meet_instances(rays, times, &mut query, buffers, counts);
    }

    /// Whether each instance is one geometry, and instances are few. Each of them is then tested with all rays of a
    /// batch.
    pub(in crate::world) fn is_small(&self) -> bool {
        self.geometry.root.is_flat() && self.geometry.root.instances.len() <= MAX_LISTED
    }

    /// The occlusion of each ray of a batch. [`RayBundle::occlusion`] returns the results. `last` is the last occluder
    /// of earlier rays, a hint.
    pub fn occlusion_batch(&self, bundle: &mut RayBundle, last: &mut OccluderCache) {
        let RayBundle { rays, t_max, times, occlusion, open, ends, buffers, .. } = bundle;
        occlusion.clear();
        occlusion.resize(rays.rays.len(), Occlusion::Nothing);
        // A ray with an opaque occluder takes no further part.
        open.clear();
        open.extend_from_slice(t_max);
        if !self.geometry.unbounded.is_empty() {
            end(&rays.rays, open, |index, ray, t_max| {
                occlusion[index] = self.occlusion_unbounded(ray, t_max);
                occlusion[index] == Occlusion::Opaque
            });
        }
        buffers.bound_groups(self, &rays.rays, open);
        let mut query = Blockers { open, occlusion, ends, last };
        self.meet_instances(rays, times, &mut query, buffers, |number| {
            self.geometry.root.instances[number as usize].casts_shadow
        });
        for (open, occlusion) in open.iter().zip(occlusion) {
            if *open == f32::NEG_INFINITY {
                *occlusion = Occlusion::Opaque;
            }
        }
    }

    /// Tests the root's instances for which `counts` returns true with the rays of a batch.
    fn meet_instances(
        &self,
        rays: &mut Rays,
        times: &[f32],
        query: &mut impl BatchQuery,
        buffers: &mut InstanceBuffers,
        counts: impl Fn(u32) -> bool,
    ) {
        if self.is_small() {
            self.meet_few_instances(rays, times, query, buffers, counts);
        } else {
            self.meet_many_instances(BatchRays { rays: &rays.rays, times }, query, buffers, counts);
        }
    }

    /// Whether the rays near each shape are found without bounds of groups of rays: those of few shapes in the world's
    /// space that are all of the world.
    pub(in crate::world) fn filters_rays(&self, instance: &Instance) -> bool {
        self.geometry.root.instances.len() == 1
            && instance.to_world.is_none()
            && self.geometry.geometries[instance.geometry as usize].is_list()
    }

    /// Tests each instance with each run of groups of rays that may hit it.
    fn meet_few_instances(
        &self,
        rays: &mut Rays,
        times: &[f32],
        query: &mut impl BatchQuery,
        buffers: &mut InstanceBuffers,
        counts: impl Fn(u32) -> bool,
    ) {
        let InstanceBuffers { local, packet_bounds, .. } = buffers;
        for (number, (instance, bounds)) in
            (0..).zip(self.geometry.root.instances.iter().zip(&self.geometry.instance_bounds))
        {
            if !counts(number) {
                continue;
            }
            let may_be_clear = self.may_let_light_through(number);
            let target = Target { world: self, instance, number, admitted: None, may_be_clear, times };
            if self.filters_rays(instance) {
                let range = 0..rays.rays.len();
                query.meet(&target, RayRange { all: rays, range: range.clone() }, range);
                continue;
            }
            for_candidate_runs(packet_bounds, rays.rays.len(), bounds, |range| {
                let part = if instance.to_world.is_none() {
                    RayRange { all: rays, range: range.clone() }
                } else {
                    BatchRays { rays: &rays.rays, times }.transform(self, instance, range.clone(), local);
                    local.all()
                };
                query.meet(&target, part, range);
            });
        }
    }
}

/// How rays go through a geometry's tree.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Traversal {
    /// One after the other.
    Single,
    /// Sixteen neighbours together: rays through neighbouring pixels, or to one lamp.
    Packets,
    /// Several at once, each on its own way: scattered rays.
    Stream,
}

/// Whether most groups of sixteen neighbouring rays are nearly parallel.
fn are_coherent(rays: &[Ray]) -> bool {
    let groups = rays.chunks(GROUP);
    let count = groups.len();
    2 * groups.filter(|group| is_coherent(group)).count() >= count
}

/// Whether the directions of all rays lie within [`COHERENT`] of the first one's.
fn is_coherent(rays: &[Ray]) -> bool {
    let first = rays[0].direction;
    let least = COHERENT * COHERENT * first.length_squared();
    rays.iter().all(|ray| {
        let cosine = ray.direction.dot(first);
        cosine > 0.0 && cosine * cosine >= least * ray.direction.length_squared()
    })
}

impl Geometry {
    /// How these rays go through the geometry's tree.
    fn traversal_of(&self, rays: &[Ray]) -> Traversal {
        match self {
            Geometry::Mesh { .. } if rays.len() < MIN_MESH_PACKET_RAYS => Traversal::Single,
            Geometry::Mesh { .. } if !are_coherent(rays) => Traversal::Stream,
            Geometry::Mesh { .. } => Traversal::Packets,
            _ if rays.len() >= MIN_PACKET_RAYS && self.len() >= MIN_PACKET_PRIMITIVES => Traversal::Packets,
            _ => Traversal::Single,
        }
    }

    /// [`Geometry::intersect`] for many rays at a geometry that doesn't [deform](Geometry::deforms). `found` holds the
    /// `t_max` of each ray and takes the results.
    pub(in crate::world) fn intersect_batch(&self, mut part: RayRange, found: &mut [PrimitiveHit]) {
        match (self, self.traversal_of(part.rays())) {
            (_, Traversal::Packets) => self.intersect_coherent(part.rays(), found),
            (Geometry::Mesh { triangles, mesh }, Traversal::Stream) => {
                triangles.intersect_stream(mesh, part.rays(), found);
            }
            (Geometry::Shapes { shapes, .. }, _) if self.is_list() => shape_list::intersect(shapes, part, found),
            _ if self.is_few() => {
                for (ray, found) in part.rays().iter().zip(found) {
                    *found = self.intersect_few(ray, found.t);
                }
            }
            _ => {
                for (ray, found) in part.prepare().iter().zip(found) {
                    *found = self.intersect(ray, found.t, 0.0);
                }
            }
        }
    }

    /// Sets `t_max` to −∞ for each ray that hits something of a geometry that doesn't deform at or before it. `last`
    /// returns the slot of the last occluder, or [`NONE`].
    pub(in crate::world) fn occluded_batch<'a>(
        &self,
        mut part: RayRange,
        t_max: &mut [f32],
        last: impl FnOnce() -> &'a mut u32,
    ) {
        match (self, self.traversal_of(part.rays())) {
            (_, Traversal::Packets) => self.occluded_coherent(part.rays(), t_max),
            (Geometry::Mesh { triangles, mesh }, Traversal::Stream) => {
                triangles.occluded_stream(mesh, part.rays(), t_max);
            }
            _ if self.is_few() => self.occlusion_batch(part, t_max, |_, _| true),
            _ => {
                let last = last();
                end(part.prepare(), t_max, |_, ray, t_max| {
                    // Once a ray is outside the occluder's shadow, further tests of it rarely succeed.
                    if *last == NONE || !self.blocks(*last, ray, t_max, 0.0) {
                        *last = self.occluded(ray, t_max, 0.0, &mut |_| true).unwrap_or(NONE);
                    }
                    *last != NONE
                });
            }
        }
    }

    /// Sets `t_max` to −∞ for each ray that hits a primitive at or before it for which `blocks` returns true. `blocks`
    /// gets the ray's index and the primitive.
    pub(in crate::world) fn occlusion_batch(
        &self,
        mut part: RayRange,
        t_max: &mut [f32],
        mut blocks: impl FnMut(usize, u32) -> bool,
    ) {
        match self {
            Geometry::Shapes { shapes, .. } if self.is_few() => shape_list::occlusion(shapes, part, t_max, blocks),
            _ if self.is_few() => end(part.rays(), t_max, |index, ray, t_max| {
                self.occluded_few(ray, t_max, &mut |primitive| blocks(index, primitive)).is_some()
            }),
            _ => end(part.prepare(), t_max, |index, ray, t_max| {
                self.occluded(ray, t_max, 0.0, &mut |primitive| blocks(index, primitive)).is_some()
            }),
        }
    }
}
