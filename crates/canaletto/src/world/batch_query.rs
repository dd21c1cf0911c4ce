//! What is asked of the rays of a batch: their nearest hits, or what blocks them. A query tests one geometry with some
//! of the rays.

use super::World;
use super::bundle::{RayRange, Rays};
use super::geometry::Geometry;
use super::group::InstancePath;
use super::instance::{Instance, NONE};
use super::query::Hit;
use super::shadow::{OccluderCache, Occlusion};
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, PrimitiveHit, Ray};

/// A query for the rays of a batch.
pub(super) trait BatchQuery {
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
pub(super) struct Target<'a> {
    pub(super) world: &'a World,
    pub(super) instance: &'a Instance,
    /// The instance's number.
    pub(super) number: u32,
    /// For an instance of a group, the rays of the batch and its box in the world. Only rays that enter the box hit the
    /// instance.
    pub(super) admitted: Option<(&'a [Ray], Aabb)>,
    /// Whether it may let light through.
    pub(super) may_be_clear: bool,
}

impl Target<'_> {
    fn geometry(&self) -> &Geometry {
        &self.world.geometries[self.instance.geometry as usize]
    }

    /// Whether the ray with this number may hit the instance at or before `t_max`.
    #[inline]
    pub(super) fn admits(&self, number: usize, t_max: f32) -> bool {
        self.admitted.is_none_or(|(rays, bounds)| rays[number].prepare().enters(&bounds, t_max))
    }
}

/// The rays of a batch, with their times.
#[derive(Clone, Copy)]
pub(super) struct BatchRays<'a> {
    pub(super) rays: &'a [Ray],
    /// Rays beyond this list have time 0.
    pub(super) times: &'a [f32],
}

impl BatchRays<'_> {
    /// The time of a ray.
    #[inline]
    pub(super) fn time(&self, ray: usize) -> f32 {
        self.times.get(ray).copied().unwrap_or(0.0)
    }

    /// Sets `local` to the rays of these numbers in an instance's space. The parameter t keeps its meaning, since
    /// directions aren't normalised.
    pub(super) fn transform(
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
                let chain = &world.chains[instance.motion as usize];
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
pub(super) struct NearestHits<'a> {
    pub(super) nearest: &'a mut [Hit],
    /// The results of one geometry.
    pub(super) found: &'a mut Vec<PrimitiveHit>,
}

impl BatchQuery for NearestHits<'_> {
    const BOX_FIRST: bool = false;

    fn counts(&self, _: &Instance) -> bool {
        true
    }

    fn t_max(&self, ray: usize) -> f32 {
        self.nearest[ray].t
    }

    fn meet(&mut self, target: &Target, part: RayRange, numbers: impl Iterator<Item = usize> + Clone) {
        let NearestHits { nearest, found } = self;
        found.clear();
        found.extend(numbers.clone().map(|number| PrimitiveHit::none(nearest[number].t)));
        target.geometry().intersect_batch(part, found);
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
pub(super) struct Blockers<'a> {
    /// The end of each ray; −∞ once it is blocked.
    pub(super) open: &'a mut [f32],
    /// Whether each ray has met anything clear.
    pub(super) occlusion: &'a mut [Occlusion],
    /// The ends of the rays at one geometry.
    pub(super) ends: &'a mut Vec<f32>,
    pub(super) last: &'a mut OccluderCache,
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

    fn meet(&mut self, target: &Target, part: RayRange, numbers: impl Iterator<Item = usize> + Clone) {
        let Blockers { open, occlusion, ends, last } = self;
        let Target { world, instance, .. } = *target;
        ends.clear();
        ends.extend(numbers.clone().map(|number| open[number]));
        if target.may_be_clear {
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
