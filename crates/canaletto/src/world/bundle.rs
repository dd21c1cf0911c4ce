//! Many rays at once: the same questions as for one, with the same answers bit for bit.
//!
//! A world of few instances hands each of them all groups of rays that may meet it, and a mesh, a cloud or many shapes send them through
//! their tree in packets. Rays are asked about one by one in a world of many or of groups, and for what stands in a light's way where of more than a
//! few primitives some may be clear.

use super::World;
use super::geometry::Geometry;
use super::instance::{NONE, to_local};
use super::packet_bounds::{GROUP, PacketBounds};
use super::query::Hit;
use super::shadow::{OccluderCache, Occlusion};
use super::shape_list;
use crate::math::DRay;
use crate::shape::{SURFACES, Vec3x8, vec3};
use canaletto_bvh::{Aabb, PreparedRay, PrimitiveHit, Ray};
use glam::Vec3;
use std::ops::Range;

/// The most instances that are each handed all rays.
pub(super) const FEW: usize = 8;

/// The fewest primitives for which rays go together.
const MANY: usize = 32;

/// The fewest rays that go together.
const TOGETHER: usize = 8;

/// Rays that are asked about together, of which neighbours go nearly the same way, and the answers.
#[derive(Debug, Default)]
pub struct RayBundle {
    rays: Rays,
    /// Up to where each counts.
    t_max: Vec<f32>,
    /// What each met, by [`World::intersect_bundle`].
    nearest: Vec<Hit>,
    /// What stands in each one's way, by [`World::occlusion_batch`].
    occlusion: Vec<Occlusion>,
    /// The rays in an instance's space.
    local: Rays,
    packet_bounds: Vec<PacketBounds>,
    /// What a geometry answers.
    found: Vec<PrimitiveHit>,
    open: Vec<f32>,
}

/// Rays in one space.
#[derive(Debug, Default)]
struct Rays {
    rays: Vec<Ray>,
    /// Some of them, as somebody wanted them last.
    prepared: Vec<PreparedRay>,
    /// Which.
    ready: Range<usize>,
}

impl Rays {
    fn clear(&mut self) {
        self.rays.clear();
        self.ready = 0..0;
    }
}

/// Some rays of a list.
pub(super) struct RayRange<'a> {
    all: &'a mut Rays,
    range: Range<usize>,
    /// What their groups lie between, in the space where they are, if anybody knows.
    packet_bounds: &'a [PacketBounds],
}

impl RayRange<'_> {
    #[inline]
    pub(super) fn rays(&self) -> &[Ray] {
        &self.all.rays[self.range.clone()]
    }

    fn prepare(&mut self) -> &[PreparedRay] {
        let (Rays { rays, prepared, ready }, range) = (&mut *self.all, &self.range);
        if range.start < ready.start || ready.end < range.end {
            prepared.clear();
            prepared.extend(rays[range.clone()].iter().map(Ray::prepare));
            *ready = range.clone();
        }
        &prepared[range.start - ready.start..range.end - ready.start]
    }

    /// [`for_runs`] of the groups of these rays, if they are known.
    pub(super) fn for_runs(&self, bounds: &Aabb, mut f: impl FnMut(Range<usize>)) {
        match self.packet_bounds {
            [] => f(0..self.range.len()),
            packet_bounds => for_runs(packet_bounds, self.range.len(), bounds, f),
        }
    }
}

/// Calls `f` for each run of groups that a box isn't surely missed by, with the places of their rays.
fn for_runs(packet_bounds: &[PacketBounds], rays: usize, bounds: &Aabb, mut f: impl FnMut(Range<usize>)) {
    let mut start = None;
    for (index, packet_bounds) in packet_bounds.iter().enumerate() {
        match (packet_bounds.misses(bounds), start) {
            (false, None) => start = Some(index * GROUP),
            (true, Some(first)) => {
                f(first..index * GROUP);
                start = None;
            }
            _ => {}
        }
    }
    if let Some(first) = start {
        f(first..rays);
    }
}

/// Sets those of `t_max` to −∞ whose rays are `blocked` at or before; that is asked for the ray of a number.
#[inline]
pub(super) fn end<R>(rays: &[R], t_max: &mut [f32], mut blocked: impl FnMut(usize, &R, f32) -> bool) {
    for (index, (ray, t_max)) in rays.iter().zip(t_max).enumerate() {
        if *t_max > 0.0 && blocked(index, ray, *t_max) {
            *t_max = f32::NEG_INFINITY;
        }
    }
}

impl RayBundle {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.t_max.clear();
    }

    /// Forgets all rays, and has these, each of which counts up to `t_max`.
    pub fn set(&mut self, rays: &[Ray], t_max: f32) {
        self.clear();
        self.rays.rays.extend_from_slice(rays);
        self.t_max.resize(rays.len(), t_max);
    }

    /// Adds a ray that counts up to `t_max`.
    #[inline]
    pub fn push(&mut self, ray: Ray, t_max: f32) {
        self.rays.rays.push(ray);
        self.t_max.push(t_max);
    }

    /// Adds those of eight rays whose bit is set, each up to its `t_max`.
    #[inline]
    pub(crate) fn push_some(&mut self, bits: u32, origins: &Vec3x8, directions: &Vec3x8, t_max: &[f32; SURFACES]) {
        if bits == 0 {
            return;
        }
        // Each is written, and the next one over it if it doesn't count: no branch that a processor would guess wrong.
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

    /// Whether there is no ray.
    pub fn is_empty(&self) -> bool {
        self.t_max.is_empty()
    }

    /// How many rays there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.t_max.len()
    }

    /// Ray number `index`, and up to where it counts.
    #[inline]
    pub fn ray(&self, index: usize) -> (Ray, f32) {
        (self.rays.rays[index], self.t_max[index])
    }

    /// What ray number `index` met, if [`World::intersect_bundle`] was asked.
    #[inline]
    pub fn hit(&self, index: usize) -> Option<Hit> {
        self.nearest[index].real()
    }

    /// Leaves only those rays that `goes_on` says, which is asked with the place of each, the ray, up to where it counts, and what it met; it may
    /// change the first two.
    pub(super) fn retain(&mut self, mut goes_on: impl FnMut(usize, &mut Ray, &mut f32, Option<Hit>) -> bool) {
        let Self { rays, t_max, nearest, .. } = self;
        let mut left = 0;
        for index in 0..t_max.len() {
            let (mut ray, mut end) = (rays.rays[index], t_max[index]);
            if goes_on(index, &mut ray, &mut end, nearest[index].real()) {
                (rays.rays[left], t_max[left]) = (ray, end);
                left += 1;
            }
        }
        rays.rays.truncate(left);
        rays.ready = 0..0;
        t_max.truncate(left);
    }

    /// What stands in the way of ray number `index`, if [`World::occlusion_batch`] was asked.
    #[inline]
    pub fn occlusion(&self, index: usize) -> Occlusion {
        self.occlusion[index]
    }
}

impl World {
    /// [`World::intersect_at`] for each ray of a bundle; [`RayBundle::hit`] tells.
    pub fn intersect_bundle(&self, bundle: &mut RayBundle, time: f32) {
        self.intersect_bundle_with(bundle, time, |ray, t_max| self.intersect_at(ray, t_max, time), |_| true);
    }

    /// The same with those instances only that `counts` says, for whoever asks for each of a few; else by asking for the nearest that `one` ray meets.
    pub(super) fn intersect_bundle_with(
        &self,
        bundle: &mut RayBundle,
        time: f32,
        one: impl Fn(&Ray, f32) -> Option<Hit>,
        counts: impl Fn(u32) -> bool,
    ) {
        let RayBundle { rays, t_max, nearest, local, packet_bounds, found, .. } = bundle;
        nearest.clear();
        if !self.is_asked_together(&rays.rays) {
            let hit = |ray, t_max| one(ray, t_max).unwrap_or(Hit::before(t_max, time));
            nearest.extend(rays.rays.iter().zip(t_max).map(|(ray, &mut t_max)| hit(ray, t_max)));
            return;
        }
        nearest.extend(t_max.iter().map(|&t_max| Hit::before(t_max, time)));
        if !self.unbounded.is_empty() {
            rays.rays.iter().zip(&mut *nearest).for_each(|(ray, best)| self.try_unbounded(ray, best));
        }
        PacketBounds::of_groups(packet_bounds, &rays.rays, t_max);
        self.for_near((rays, local), packet_bounds, time, counts, |number, geometry, part| {
            let nearest = &mut nearest[part.range.clone()];
            found.clear();
            found.extend(nearest.iter().map(|best| PrimitiveHit::none(best.t)));
            geometry.intersect_bundle(part, found);
            for (best, &found) in nearest.iter_mut().zip(&*found) {
                best.offer(number, found);
            }
        });
    }

    /// Whether each instance is handed all of some rays.
    fn is_asked_together(&self, rays: &[Ray]) -> bool {
        rays.len() > 1 && self.is_small()
    }

    /// Whether each instance is one geometry, and they are few.
    pub(super) fn is_small(&self) -> bool {
        self.root.is_flat() && self.root.instances.len() <= FEW
    }

    /// What stands between the origin and the end of each ray of a bundle; [`RayBundle::occlusion`] tells. `last` is what stood in the
    /// way of the ray before, a hint.
    pub fn occlusion_batch(&self, bundle: &mut RayBundle, time: f32, last: &mut OccluderCache) {
        let RayBundle { rays, t_max, occlusion, local, open, packet_bounds, .. } = bundle;
        occlusion.clear();
        if !self.is_asked_together(&rays.rays) {
            occlusion
                .extend(rays.rays.iter().zip(t_max).map(|(ray, &mut t_max)| self.occlusion(ray, t_max, time, last)));
            return;
        }
        occlusion.resize(rays.rays.len(), Occlusion::Nothing);
        // A ray that something opaque was found for takes no further part.
        open.clear();
        open.extend_from_slice(t_max);
        if !self.unbounded.is_empty() {
            end(&rays.rays, open, |index, ray, t_max| {
                occlusion[index] = self.occlusion_unbounded(ray, t_max);
                occlusion[index] == Occlusion::Opaque
            });
        }
        PacketBounds::of_groups(packet_bounds, &rays.rays, open);
        self.for_near(
            (rays, local),
            packet_bounds,
            time,
            |_| true,
            |number, geometry, part| {
                let (open, occlusion) = (&mut open[part.range.clone()], &mut occlusion[part.range.clone()]);
                if self.may_let_light_through(number) {
                    geometry.occlusion_batch(part, open, |ray, primitive| {
                        let opaque = self.is_opaque(number, primitive);
                        if !opaque {
                            occlusion[ray] = Occlusion::Clear;
                        }
                        opaque
                    });
                } else {
                    geometry.occluded_bundle(part, open, || last.slot_in(number));
                }
            },
        );
        for (open, occlusion) in open.iter().zip(occlusion) {
            if *open == f32::NEG_INFINITY {
                *occlusion = Occlusion::Opaque;
            }
        }
    }

    /// Calls `f` with the number and geometry of each instance that `counts` and the rays of each run of groups that may meet it, in its space. Their parameter t
    /// stays the same: directions aren't normalised.
    fn for_near(
        &self,
        (rays, local): (&mut Rays, &mut Rays),
        packet_bounds: &[PacketBounds],
        time: f32,
        counts: impl Fn(u32) -> bool,
        mut f: impl FnMut(u32, &Geometry, RayRange),
    ) {
        for (number, (instance, bounds)) in (0..).zip(self.root.instances.iter().zip(&self.instance_bounds)) {
            if !counts(number) {
                continue;
            }
            local.clear();
            for_runs(packet_bounds, rays.rays.len(), bounds, |range| {
                let part = if instance.to_world.is_none() {
                    let groups = range.start / GROUP..range.end.div_ceil(GROUP);
                    RayRange { all: rays, range, packet_bounds: &packet_bounds[groups] }
                } else {
                    if local.rays.is_empty()
                        && let Some(to_world) = instance.placed(&self.chains, time)
                    {
                        local.rays.extend(rays.rays.iter().map(|r| to_local(&to_world, DRay::from(r)).rounded()));
                    }
                    RayRange { all: local, range, packet_bounds: &[] }
                };
                f(number, &self.geometries[instance.geometry as usize], part);
            });
        }
    }
}

impl Geometry {
    /// Whether rays as many as these go through its tree in packets.
    fn has_packets_of(&self, rays: &[Ray]) -> bool {
        matches!(self, Geometry::Mesh { .. }) || rays.len() >= TOGETHER && self.len() >= MANY
    }

    /// [`Geometry::intersect`] for many rays; `found` says up to where each counts, and takes the answers.
    fn intersect_bundle(&self, mut part: RayRange, found: &mut [PrimitiveHit]) {
        match self {
            _ if self.has_packets_of(part.rays()) => self.intersect_coherent(part.rays(), found),
            Geometry::Shapes { shapes, .. } if self.is_few() => shape_list::intersect(shapes, &part, found),
            _ if self.is_few() => {
                for (ray, found) in part.rays().iter().zip(found) {
                    *found = self.intersect_few(ray, found.t);
                }
            }
            _ => {
                for (ray, found) in part.prepare().iter().zip(found) {
                    *found = self.intersect(ray, found.t);
                }
            }
        }
    }

    /// Sets those of `t_max` to −∞ whose rays meet something at or before. `last` is asked for the slot of what was met before, or
    /// [`NONE`].
    fn occluded_bundle<'a>(&self, mut part: RayRange, t_max: &mut [f32], last: impl FnOnce() -> &'a mut u32) {
        if self.has_packets_of(part.rays()) {
            self.occluded_coherent(part.rays(), t_max);
        } else if self.is_few() {
            self.occlusion_batch(part, t_max, |_, _| true);
        } else {
            let last = last();
            end(part.prepare(), t_max, |_, ray, t_max| {
                // Once past its shadow's border it would be tried in vain.
                if *last == NONE || !self.blocks(*last, ray, t_max) {
                    *last = self.occluded(ray, t_max, |_| true).unwrap_or(NONE);
                }
                *last != NONE
            });
        }
    }

    /// Sets those of `t_max` to −∞ whose rays meet something at or before that `blocks` the ray of this number.
    fn occlusion_batch(&self, mut part: RayRange, t_max: &mut [f32], mut blocks: impl FnMut(usize, u32) -> bool) {
        match self {
            Geometry::Shapes { shapes, .. } if self.is_few() => shape_list::occlusion(shapes, &part, t_max, blocks),
            _ if self.is_few() => end(part.rays(), t_max, |index, ray, t_max| {
                self.occluded_few(ray, t_max, |primitive| blocks(index, primitive)).is_some()
            }),
            _ => end(part.prepare(), t_max, |index, ray, t_max| {
                self.occluded(ray, t_max, |primitive| blocks(index, primitive)).is_some()
            }),
        }
    }
}
