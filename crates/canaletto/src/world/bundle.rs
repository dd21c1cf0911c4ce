//! Many rays at once: the same questions as for one, with the same answers bit for bit.
//!
//! A world of few instances hands each of them all groups of rays that may meet it, and a mesh, a cloud or many shapes send them through
//! their tree in packets. In a world of many or of groups, and where something clear may stand in a light's way, rays are asked about one by one.

use super::World;
use super::corridor::{Corridor, GROUP};
use super::geometry::{Geometry, NO_PRIMITIVE, Nearest};
use super::instance::{Instance, NONE, Unbounded, to_local};
use super::loose;
use super::query::{Blocker, Hit};
use crate::math::Line;
use crate::shape::ShapeHit;
use canaletto_bvh::{self as bvh, Aabb, Met, PreparedRay, Ray};
use std::ops::Range;

/// The most instances that are each handed all rays.
pub(super) const FEW: usize = 8;

/// The fewest primitives for which rays go together.
const MANY: usize = 32;

/// The fewest rays that go together.
const TOGETHER: usize = 8;

/// Rays that are asked about together, of which neighbours go nearly the same way, and the answers.
#[derive(Debug, Default)]
pub struct Bundle {
    rays: Rays,
    /// Up to where each counts.
    t_max: Vec<f32>,
    /// What each met, by [`World::intersect_bundle`].
    nearest: Vec<(u32, Nearest)>,
    /// What stands in each one's way, by [`World::between_bundle`].
    between: Vec<Between>,
    /// The rays in an instance's space.
    local: Rays,
    found: Vec<Nearest>,
    open: Vec<f32>,
    corridors: Vec<Corridor>,
}

/// What stands between a ray's origin and its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// Nothing.
    Nothing,
    /// Something that lets light through, and nothing opaque.
    Clear,
    /// Something opaque.
    Opaque,
}

/// Rays in one space.
#[derive(Debug, Default)]
pub(super) struct Rays {
    pub(super) rays: Vec<Ray>,
    /// Some of them, as somebody wanted them last.
    prepared: Vec<PreparedRay>,
    /// Which.
    ready: Range<usize>,
    /// What a mesh answers.
    triangles: Vec<bvh::Nearest>,
    /// What spheres, cylinders and other shapes answer.
    met: Vec<Met>,
}

/// Some rays of a list.
pub(super) struct Part<'a> {
    pub(super) rays: &'a mut Rays,
    pub(super) range: Range<usize>,
    /// What their groups lie between, in the space where they are, if anybody knows.
    pub(super) corridors: &'a [Corridor],
}

impl Part<'_> {
    fn prepare(&mut self) -> &[PreparedRay] {
        self.rays.prepare(&self.range)
    }
}

/// Calls `f` for each run of groups that a box isn't surely missed by, with the places of their rays.
pub(super) fn for_runs(corridors: &[Corridor], rays: usize, bounds: &Aabb, mut f: impl FnMut(Range<usize>)) {
    let mut start = None;
    for (index, corridor) in corridors.iter().enumerate() {
        match (corridor.misses(bounds), start) {
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

impl Rays {
    fn clear(&mut self) {
        self.rays.clear();
        self.ready = 0..0;
    }

    fn prepare(&mut self, range: &Range<usize>) -> &[PreparedRay] {
        if range.start < self.ready.start || self.ready.end < range.end {
            self.prepared.clear();
            self.prepared.extend(self.rays[range.clone()].iter().map(Ray::prepare));
            self.ready = range.clone();
        }
        &self.prepared[range.start - self.ready.start..range.end - self.ready.start]
    }
}

impl Bundle {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.t_max.clear();
    }

    /// Adds a ray that counts up to `t_max`.
    #[inline]
    pub fn push(&mut self, ray: Ray, t_max: f32) {
        self.rays.rays.push(ray);
        self.t_max.push(t_max);
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

    /// What ray number `index` met, if [`World::intersect_bundle`] was asked for this time.
    #[inline]
    pub fn hit(&self, index: usize, time: f32) -> Option<Hit> {
        let (instance, Nearest { t, primitive, part, uv }) = self.nearest[index];
        (primitive != NO_PRIMITIVE).then_some(Hit { t, instance, primitive, part, uv, time })
    }

    /// What stands in the way of ray number `index`, if [`World::between_bundle`] was asked.
    #[inline]
    pub fn between(&self, index: usize) -> Between {
        self.between[index]
    }
}

impl World {
    /// [`World::intersect_at`] for each ray of a bundle; [`Bundle::hit`] tells.
    pub fn intersect_bundle(&self, bundle: &mut Bundle, time: f32) {
        let Bundle { rays, t_max, nearest, local, found, corridors, .. } = bundle;
        nearest.clear();
        if rays.rays.len() == 1 || !self.is_small() {
            nearest.extend(rays.rays.iter().zip(t_max).map(
                |(ray, &mut t_max)| match self.intersect_at(ray, t_max, time) {
                    Some(Hit { t, instance, primitive, part, uv, .. }) => {
                        (instance, Nearest { t, primitive, part, uv })
                    }
                    None => (NONE, Nearest::before(t_max)),
                },
            ));
            return;
        }
        nearest.extend(t_max.iter().map(|&t_max| (NONE, Nearest::before(t_max))));
        for (index, Unbounded { shape, .. }) in self.unbounded.iter().enumerate() {
            for (ray, best) in rays.rays.iter().zip(&mut *nearest) {
                if let Some(ShapeHit { t, part, uv }) = shape.intersect(ray, best.1.t) {
                    offer(best, Hit::UNBOUNDED, Nearest { t, primitive: index as u32, part, uv });
                }
            }
        }
        corridors.clear();
        corridors
            .extend(rays.rays.chunks(GROUP).zip(t_max.chunks(GROUP)).map(|(rays, t_max)| Corridor::of(rays, t_max)));
        for (index, (instance, bounds)) in self.root.instances.iter().zip(&self.instance_bounds).enumerate() {
            let geometry = &self.geometries[instance.geometry as usize];
            let mut mapped = false;
            for_runs(corridors, rays.rays.len(), bounds, |range| {
                found.clear();
                found.extend(nearest[range.clone()].iter().map(|best| Nearest::before(best.1.t)));
                let corridors = known(instance, corridors, &range);
                let rays = self.in_space_of(instance, rays, local, time, &mut mapped);
                geometry.intersect_bundle(Part { rays, range: range.clone(), corridors }, found);
                for (best, &found) in nearest[range].iter_mut().zip(&*found) {
                    offer(best, index as u32, found);
                }
            });
        }
    }

    /// Whether each instance is one geometry, and they are few.
    pub(super) fn is_small(&self) -> bool {
        self.root.is_flat() && self.root.instances.len() <= FEW
    }

    /// What stands between the origin and the end of each ray of a bundle; [`Bundle::between`] tells. `last` is what stood in the
    /// way of the ray before, a hint.
    pub fn between_bundle(&self, bundle: &mut Bundle, time: f32, last: &mut Blocker) {
        let Bundle { rays, t_max, between, local, open, corridors, .. } = bundle;
        between.clear();
        if rays.rays.len() <= 1 || !self.is_small() {
            between.extend(rays.rays.iter().zip(t_max).map(|(ray, &mut t_max)| self.between(ray, t_max, time, last)));
            return;
        }
        between.resize(rays.rays.len(), Between::Nothing);
        // A ray that something opaque was found for takes no further part.
        open.clear();
        open.extend_from_slice(t_max);
        for (index, Unbounded { shape, .. }) in self.unbounded.iter().enumerate() {
            let opaque = self.is_opaque(Hit::UNBOUNDED, index as u32);
            for ((ray, open), between) in rays.rays.iter().zip(&mut *open).zip(&mut *between) {
                if *open > 0.0 && shape.intersect(ray, *open).is_some() {
                    if opaque {
                        *open = f32::NEG_INFINITY;
                    } else {
                        *between = Between::Clear;
                    }
                }
            }
        }
        corridors.clear();
        corridors.extend(rays.rays.chunks(GROUP).zip(open.chunks(GROUP)).map(|(rays, open)| Corridor::of(rays, open)));
        for (index, (instance, bounds)) in self.root.instances.iter().zip(&self.instance_bounds).enumerate() {
            let geometry = &self.geometries[instance.geometry as usize];
            let clear = self.clear_instances.get(index) == Some(&true);
            let mut mapped = false;
            for_runs(corridors, rays.rays.len(), bounds, |range| {
                let open = &mut open[range.clone()];
                let between = &mut between[range.clone()];
                let corridors = known(instance, corridors, &range);
                let part = Part { rays: self.in_space_of(instance, rays, local, time, &mut mapped), range, corridors };
                if clear {
                    geometry.between_bundle(part, open, between, |primitive| self.is_opaque(index as u32, primitive));
                } else {
                    geometry.occluded_bundle(part, open, || last.slot_in(index as u32));
                }
            });
        }
        for (open, between) in open.iter().zip(between) {
            if *open == f32::NEG_INFINITY {
                *between = Between::Opaque;
            }
        }
    }

    /// The rays in an instance's space, where they are `mapped` to once. Their parameter t stays the same: directions aren't
    /// normalised.
    fn in_space_of<'a>(
        &self,
        instance: &Instance,
        rays: &'a mut Rays,
        local: &'a mut Rays,
        time: f32,
        mapped: &mut bool,
    ) -> &'a mut Rays {
        if instance.to_world.is_none() {
            return rays;
        }
        if !std::mem::replace(mapped, true)
            && let Some(to_world) = instance.placed(&self.chains, time)
        {
            local.clear();
            local.rays.extend(rays.rays.iter().map(|ray| to_local(&to_world, Line::from(ray)).rounded()));
        }
        local
    }
}

/// The corridors of some rays if they are those of an instance's space, too.
fn known<'a>(instance: &Instance, corridors: &'a [Corridor], rays: &Range<usize>) -> &'a [Corridor] {
    if instance.to_world.is_none() { &corridors[rays.start / GROUP..rays.end.div_ceil(GROUP)] } else { &[] }
}

/// Makes a hit the nearest if it is; ties go to the lowest instance, then the lowest primitive.
#[inline]
fn offer(best: &mut (u32, Nearest), instance: u32, found: Nearest) {
    if found.primitive != NO_PRIMITIVE && (found.t, instance, found.primitive) < (best.1.t, best.0, best.1.primitive) {
        *best = (instance, found);
    }
}

impl Geometry {
    /// [`Geometry::intersect`] for many rays; `found` says up to where each counts, and takes the answers.
    fn intersect_bundle(&self, mut part: Part, found: &mut [Nearest]) {
        match self {
            Geometry::Mesh { triangles, mesh } => {
                let Rays { rays, triangles: hits, .. } = part.rays;
                hits.clear();
                hits.extend(found.iter().map(|f| bvh::Nearest::before(f.t)));
                triangles.intersect_coherent(&rays[part.range], hits, mesh.one_sided);
                for (found, hit) in found.iter_mut().zip(hits) {
                    *found = Nearest { t: hit.t, primitive: hit.id, part: 0, uv: [hit.u, hit.v] };
                }
            }
            Geometry::Shapes { shapes, .. } if shapes.len() <= loose::FEW => loose::intersect(shapes, &part, found),
            Geometry::Shapes { .. } | Geometry::Spheres { .. } | Geometry::Cylinders { .. }
                if part.range.len() >= TOGETHER && self.len() >= MANY =>
            {
                let Rays { rays, met, .. } = part.rays;
                met.clear();
                met.extend(found.iter().map(|f| Met::before(f.t)));
                self.intersect_coherent(&rays[part.range], met);
                for (found, met) in found.iter_mut().zip(met) {
                    *found = (*met).into();
                }
            }
            _ if self.is_few() => {
                for (ray, found) in part.rays.rays[part.range].iter().zip(found) {
                    if let Some(hit) = self.intersect_few(ray, found.t) {
                        *found = hit;
                    }
                }
            }
            _ => {
                for (ray, found) in part.prepare().iter().zip(found) {
                    if let Some(hit) = self.intersect(ray, found.t) {
                        *found = hit;
                    }
                }
            }
        }
    }

    /// Sets those of `t_max` to −∞ whose rays meet something at or before. `last` is asked for the slot of what was met before, or
    /// [`NONE`].
    fn occluded_bundle<'a>(&self, mut part: Part, t_max: &mut [f32], last: impl FnOnce() -> &'a mut u32) {
        match self {
            Geometry::Mesh { .. } => self.occluded_coherent(&part.rays.rays[part.range], t_max),
            _ if part.range.len() >= TOGETHER && self.len() >= MANY => {
                self.occluded_coherent(&part.rays.rays[part.range], t_max);
            }
            Geometry::Shapes { shapes, .. } if shapes.len() <= loose::FEW => {
                loose::between(shapes, &part, t_max, |_, _| true);
            }
            _ if self.is_few() => {
                for (ray, t_max) in part.rays.rays[part.range].iter().zip(t_max).filter(|(_, t_max)| **t_max > 0.0) {
                    if self.occluded_few(ray, *t_max, |_| true).is_some() {
                        *t_max = f32::NEG_INFINITY;
                    }
                }
            }
            _ => {
                let last = last();
                for (ray, t_max) in part.prepare().iter().zip(t_max).filter(|(_, t_max)| **t_max > 0.0) {
                    // Once past its shadow's border it would be tried in vain.
                    if *last == NONE || !self.blocks(*last, ray, *t_max) {
                        *last = self.occluded(ray, *t_max, |_| true).unwrap_or(NONE);
                    }
                    if *last != NONE {
                        *t_max = f32::NEG_INFINITY;
                    }
                }
            }
        }
    }

    /// [`Geometry::occluded_bundle`] where some primitives are not opaque: what they leave open is `Clear`.
    fn between_bundle(
        &self,
        mut part: Part,
        t_max: &mut [f32],
        between: &mut [Between],
        is_opaque: impl Fn(u32) -> bool,
    ) {
        if let Geometry::Shapes { shapes, .. } = self
            && shapes.len() <= loose::FEW
        {
            return loose::between(shapes, &part, t_max, |ray, shape| {
                let opaque = is_opaque(shape);
                if !opaque {
                    between[ray] = Between::Clear;
                }
                opaque
            });
        }
        let few = self.is_few();
        if !few {
            part.prepare();
        }
        let Part { rays: Rays { rays, prepared, ready, .. }, range, .. } = part;
        for (index, (t_max, between)) in t_max.iter_mut().zip(between).enumerate().filter(|(_, (t, _))| **t > 0.0) {
            let blocks = |primitive| {
                let opaque = is_opaque(primitive);
                if !opaque {
                    *between = Between::Clear;
                }
                opaque
            };
            let blocker = if few {
                self.occluded_few(&rays[range.start + index], *t_max, blocks)
            } else {
                self.occluded(&prepared[range.start - ready.start + index], *t_max, blocks)
            };
            if blocker.is_some() {
                *t_max = f32::NEG_INFINITY;
            }
        }
    }
}
