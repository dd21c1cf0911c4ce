//! What is asked of the rays of a batch: their nearest hits, or what blocks them. A query tests one geometry with some
//! of the rays.

use crate::math::{DRay, Transform};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::group::InstancePath;
use crate::world::data::instance::{Instance, NONE};
use crate::world::trace::occlusion::{OccluderCache, Occlusion};
use crate::world::trace::query::Hit;
use crate::world::trace::rays::{RayRange, Rays};
use canaletto_bvh::{Aabb, PreparedRay, PrimitiveHit, Ray};

/// A query for the rays of a batch.
pub(in crate::world) trait BatchQuery {
    /// Whether only rays that enter the box of a group's member may be tested with it. Otherwise the box may be asked
    /// about hits.
    const BOX_FIRST: bool;

    /// Whether a group's member takes part.
    fn counts(&self, member: &Instance) -> bool;

    /// The end of a ray; −∞ once it takes no further part.
    fn t_max(&self, ray: usize) -> f32;

    /// Tests a geometry with the rays of these numbers. `part` holds them in its space.
    fn meet(&mut self, target: &Target, part: RayRange, numbers: impl Iterator<Item = usize> + Clone);

    /// Tests all instances with a ray of this number and time.
    fn meet_alone(&mut self, world: &World, ray: &Ray, number: usize, time: f32);

    /// Tests the instances of a group with a ray of this number and time.
    fn meet_group_alone(&mut self, world: &World, way: &InstancePath, ray: &Ray, number: usize, time: f32);
}

/// A geometry placed in the world.
pub(in crate::world) struct Target<'a> {
    pub(in crate::world) world: &'a World,
    pub(in crate::world) instance: &'a Instance,
    /// The instance's number.
    pub(in crate::world) number: u32,
    /// For an instance of a group, the rays of the batch and its box in the world. Only rays that enter the box hit the
    /// instance.
    pub(in crate::world) admitted: Option<(&'a [Ray], Aabb)>,
    /// Whether it may let light through.
    pub(in crate::world) may_be_clear: bool,
    /// The times of the batch's rays; see [`BatchRays::times`].
    pub(in crate::world) times: &'a [f32],
}

impl Target<'_> {
    fn geometry(&self) -> &Geometry {
        &self.world.geometry.geometries[self.instance.geometry as usize]
    }

    /// The time of the ray with this number.
    fn time(&self, number: usize) -> f32 {
        self.times.get(number).copied().unwrap_or(0.0)
    }

    /// Whether the ray with this number may hit the instance at or before `t_max`.
    #[inline]
    pub(in crate::world) fn admits(&self, number: usize, t_max: f32) -> bool {
        self.admitted.is_none_or(|(rays, bounds)| rays[number].prepare().enters(&bounds, t_max))
    }
}

/// The rays of a batch, with their times.
#[derive(Clone, Copy)]
pub(in crate::world) struct BatchRays<'a> {
    pub(in crate::world) rays: &'a [Ray],
    /// Rays beyond this list have time 0.
    pub(in crate::world) times: &'a [f32],
}

impl BatchRays<'_> {
    /// The time of a ray.
    #[inline]
    pub(in crate::world) fn time(&self, ray: usize) -> f32 {
        self.times.get(ray).copied().unwrap_or(0.0)
    }

    /// Sets `local` to the rays of these numbers in an instance's space. The parameter t keeps its meaning, since
    /// directions aren't normalised.
    pub(in crate::world) fn transform(
        &self,
        world: &World,
        instance: &Instance,
        numbers: impl Iterator<Item = usize>,
        local: &mut Rays,
    ) {
        local.clear();
        let to_local = |ray: usize, to_world: &Transform| DRay::from(&self.rays[ray]).to_local(to_world).rounded();
        match &instance.to_world {
            None => local.rays.extend(numbers.map(|ray| self.rays[ray])),
            Some(to_world) if instance.motion == NONE => local.rays.extend(numbers.map(|ray| to_local(ray, to_world))),
            Some(_) => {
                let chain = &world.geometry.chains[instance.motion as usize];
                let mut last: Option<(f32, Transform)> = None;
                local.rays.extend(numbers.map(|ray| {
                    let time = self.time(ray);
                    if last.is_none_or(|(known, _)| known != time) {
                        last = Some((time, chain.at(time)));
                    }
                    last.map_or(self.rays[ray], |(_, to_world)| to_local(ray, &to_world))
                }));
            }
        }
    }
}

/// The query of the nearest hits.
pub(in crate::world) struct NearestHits<'a> {
    pub(in crate::world) nearest: &'a mut [Hit],
    /// The results of one geometry.
    pub(in crate::world) found: &'a mut Vec<PrimitiveHit>,
}

impl BatchQuery for NearestHits<'_> {
    const BOX_FIRST: bool = false;

    fn counts(&self, _: &Instance) -> bool {
        true
    }

    fn t_max(&self, ray: usize) -> f32 {
        self.nearest[ray].t
    }

    fn meet(&mut self, target: &Target, mut part: RayRange, numbers: impl Iterator<Item = usize> + Clone) {
        let NearestHits { nearest, found } = self;
        found.clear();
        let geometry = target.geometry();
        if geometry.deforms() {
            let one =
                |(ray, number): (&PreparedRay, usize)| geometry.intersect(ray, nearest[number].t, target.time(number));
            found.extend(part.prepare().iter().zip(numbers.clone()).map(one));
        } else {
            found.extend(numbers.clone().map(|number| PrimitiveHit::none(nearest[number].t)));
            geometry.intersect_batch(part, found);
        }
        for (number, &found) in numbers.zip(&**found) {
            let best = &mut nearest[number];
            if let Some(hit) = best.nearer(target.number, found)
                && target.admits(number, best.t)
            {
                *best = hit;
            }
        }
    }

    fn meet_alone(&mut self, world: &World, ray: &Ray, number: usize, _: f32) {
        let best = &mut self.nearest[number];
        *best = world.nearest_instance(&ray.prepare(), *best);
    }

    fn meet_group_alone(&mut self, world: &World, way: &InstancePath, ray: &Ray, number: usize, _: f32) {
        world.try_group(&ray.prepare(), way, &mut self.nearest[number]);
    }
}

/// The query of what blocks rays.
pub(in crate::world) struct Blockers<'a> {
    /// The end of each ray; −∞ once it is blocked.
    pub(in crate::world) open: &'a mut [f32],
    /// Whether each ray has met anything clear.
    pub(in crate::world) occlusion: &'a mut [Occlusion],
    /// The ends of the rays at one geometry.
    pub(in crate::world) ends: &'a mut Vec<f32>,
    pub(in crate::world) last: &'a mut OccluderCache,
}

impl Blockers<'_> {
    fn meet_one(&mut self, number: usize, occlusion: Occlusion) {
        match occlusion {
            Occlusion::Nothing => {}
            Occlusion::Clear => self.occlusion[number] = Occlusion::Clear,
            Occlusion::Opaque => self.open[number] = f32::NEG_INFINITY,
        }
    }
}

impl BatchQuery for Blockers<'_> {
    const BOX_FIRST: bool = true;

    fn counts(&self, member: &Instance) -> bool {
        member.casts_shadow
    }

    fn t_max(&self, ray: usize) -> f32 {
        self.open[ray]
    }

    fn meet(&mut self, target: &Target, mut part: RayRange, numbers: impl Iterator<Item = usize> + Clone) {
        let Blockers { open, occlusion, ends, last } = self;
        let Target { world, instance, .. } = *target;
        ends.clear();
        ends.extend(numbers.clone().map(|number| open[number]));
        if target.geometry().deforms() {
            for ((ray, end), number) in part.prepare().iter().zip(&mut **ends).zip(numbers.clone()) {
                let blocks = &mut |primitive| {
                    let opaque = !target.may_be_clear || world.material_at(instance, primitive).is_opaque();
                    if !opaque {
                        occlusion[number] = Occlusion::Clear;
                    }
                    opaque
                };
                if target.geometry().occluded(ray, *end, target.time(number), blocks).is_some() {
                    *end = f32::NEG_INFINITY;
                }
            }
        } else if target.may_be_clear {
            target.geometry().occlusion_batch(part, ends, |index, primitive| {
                let opaque = world.material_at(instance, primitive).is_opaque();
                if !opaque && let Some(number) = numbers.clone().nth(index) {
                    occlusion[number] = Occlusion::Clear;
                }
                opaque
            });
        } else {
            target.geometry().occluded_batch(part, ends, || last.slot_in(target.number));
        }
        for (number, &end) in numbers.zip(&**ends) {
            open[number] = end;
        }
    }

    fn meet_alone(&mut self, world: &World, ray: &Ray, number: usize, time: f32) {
        let occlusion = world.occlusion(ray, self.open[number], time, self.last);
        self.meet_one(number, occlusion);
    }

    fn meet_group_alone(&mut self, world: &World, way: &InstancePath, ray: &Ray, number: usize, time: f32) {
        let occlusion = world.occlusion_by_group(ray, self.open[number], time, way, self.last);
        self.meet_one(number, occlusion);
    }
}
