//! What stands in a light's way, and how much of the light passes.

use super::World;
use super::bundle::RayBundle;
use super::contact::{Contact, touching};
use super::geometry::Geometry;
use super::group::InstancePath;
use super::instance::{Instance, NONE, Unbounded};
use super::query::Hit;
use crate::integrator::Probe;
use crate::math::{DRay, RayDifferential, offset_origin};
use canaletto_bvh::{PreparedRay, Ray};
use glam::Vec3;

/// Something opaque that stood in a light's way. A hint: it changes no answer.
#[derive(Clone, Copy, Debug)]
pub struct OccluderCache {
    instance: u32,
    /// In leaf order.
    slot: u32,
}

impl OccluderCache {
    /// Nothing so far.
    pub const NONE: OccluderCache = OccluderCache { instance: NONE, slot: NONE };

    /// The slot if it is of this instance, of which it shall be from now on.
    pub(super) fn slot_in(&mut self, instance: u32) -> &mut u32 {
        if self.instance != instance {
            *self = OccluderCache { instance, slot: NONE };
        }
        &mut self.slot
    }
}

/// How many surfaces in a row may bring a ray no further before it is taken to stand still.
pub(crate) const MAX_STALLED: u32 = 4;

/// What stands between a ray's origin and its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occlusion {
    /// Nothing.
    Nothing,
    /// Something that lets light through, and nothing opaque.
    Clear,
    /// Something opaque.
    Opaque,
}

/// A shadow ray that crosses clear surfaces.
#[derive(Debug)]
struct ShadowRay {
    /// As it started.
    line: DRay,
    /// Where it leads, if its light has a place.
    end: Vec3,
    /// The share of the light that has passed so far.
    passed: f32,
    /// How many surfaces in a row brought it no nearer to its end.
    stalled: u32,
    /// What lies in the same place as the last one.
    contacts: Vec<Contact>,
}

impl ShadowRay {
    fn new(ray: &Ray) -> Self {
        Self { line: DRay::from(ray), end: ray.origin + ray.direction, passed: 1.0, stalled: 0, contacts: Vec::new() }
    }
}

/// Shadow rays that cross clear surfaces together.
#[derive(Debug, Default)]
pub(crate) struct ShadowRays {
    /// Those that still do.
    pub(crate) bundle: RayBundle,
    /// Their numbers.
    on_their_way: Vec<u32>,
    all: Vec<ShadowRay>,
}

impl ShadowRays {
    /// The share of the light that passes along the ray of a number.
    #[inline]
    pub(crate) fn passed(&self, number: usize) -> f32 {
        self.all[number].passed
    }
}

impl World {
    /// f_s of (5.39a): the product of 1 − o over the surfaces between the ray's origin and `t_max`. `last` is what blocked
    /// the light before, which often blocks it again; `differential` is the ray's, for textures that let light through.
    pub fn transmittance<P: Probe>(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        differential: Option<&RayDifferential>,
        last: &mut OccluderCache,
        probe: &mut P,
    ) -> f32 {
        // Anything opaque in between settles it; only a recording probe wants to know what stands in which order.
        match self.occlusion(ray, t_max, time, last) {
            Occlusion::Nothing => 1.0,
            Occlusion::Opaque if !P::ACTIVE => 0.0,
            occlusion => self.transmittance_past(ray, t_max, time, differential, occlusion, probe),
        }
    }

    /// [`World::transmittance`] where something stands between.
    pub(crate) fn transmittance_past<P: Probe>(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        differential: Option<&RayDifferential>,
        occlusion: Occlusion,
        probe: &mut P,
    ) -> f32 {
        let (mut crossing, mut ray, mut t_max) = (ShadowRay::new(ray), *ray, t_max);
        for _ in 0..Self::MAX_CROSSINGS {
            let hit = match occlusion {
                Occlusion::Clear => self.intersect_clear(&ray, t_max, time),
                _ => self.intersect_at(&ray, t_max, time),
            };
            let Some(hit) = hit else { break };
            if !self.cross(&mut crossing, &mut ray, &mut t_max, &hit, differential, probe) {
                break;
            }
        }
        if occlusion == Occlusion::Opaque { 0.0 } else { crossing.passed }
    }

    /// [`World::transmittance_past`] for rays of a bundle in whose way there is something clear and nothing opaque; [`ShadowRays::passed`] tells. `differential` is
    /// asked for that of the ray of a number.
    pub(crate) fn transmittance_batch(
        &self,
        shadow_rays: &mut ShadowRays,
        time: f32,
        differential: impl Fn(usize) -> Option<RayDifferential>,
    ) {
        let ShadowRays { bundle, on_their_way, all } = shadow_rays;
        all.clear();
        all.extend((0..bundle.len()).map(|index| ShadowRay::new(&bundle.ray(index).0)));
        on_their_way.clear();
        on_their_way.extend(0..bundle.len() as u32);
        for _ in 0..Self::MAX_CROSSINGS {
            if bundle.is_empty() {
                break;
            }
            self.intersect_clear_bundle(bundle, time);
            let mut left = 0;
            bundle.retain(|index, ray, t_max, hit| {
                let number = on_their_way[index];
                let goes_on = hit.is_some_and(|hit| {
                    let differential = differential(number as usize);
                    self.cross(&mut all[number as usize], ray, t_max, &hit, differential.as_ref(), &mut ())
                });
                on_their_way[left] = number;
                left += usize::from(goes_on);
                goes_on
            });
            on_their_way.truncate(left);
        }
    }

    /// What becomes of a shadow ray at a clear surface. Returns whether it goes on.
    fn cross<P: Probe>(
        &self,
        crossing: &mut ShadowRay,
        ray: &mut Ray,
        t_max: &mut f32,
        hit: &Hit,
        differential: Option<&RayDifferential>,
        probe: &mut P,
    ) -> bool {
        let line = DRay::from(&*ray);
        let mut surface = self.bare_surface(line, hit);
        let step = differential.map(|s| s.along(&crossing.line, surface.exact, surface.normal));
        let opacity = self.kept_light(line, hit, step);
        probe.blocker(hit, opacity);
        crossing.passed *= 1.0 - opacity;
        self.contacts(&line, hit, &surface, &mut crossing.contacts, |_| {});
        if !crossing.contacts.is_empty() {
            // What is in the same place is crossed with it.
            surface.error = touching(&surface);
            for contact in &crossing.contacts {
                let opacity = self.kept_light(line, &contact.hit, step);
                probe.blocker(&contact.hit, opacity);
                crossing.passed *= 1.0 - opacity;
            }
        }
        if crossing.passed < Self::LEAST_PASSED {
            crossing.passed = 0.0;
            return false;
        }
        let start = ray.origin;
        ray.origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction.as_dvec3());
        // Where a surface is flatter than roundings, the same one is met again from the same place.
        let advances = (ray.origin - start).dot(ray.direction) > 0.0;
        crossing.stalled = if advances { 0 } else { crossing.stalled + 1 };
        if crossing.stalled > MAX_STALLED {
            return false;
        }
        // Towards a point the direction is the rest of the way, so that t stays at most 1.
        if t_max.is_finite() {
            let rest = crossing.end - ray.origin;
            if rest.dot(ray.direction) <= 0.0 {
                return false;
            }
            ray.direction = rest;
            *t_max = 1.0 - f32::EPSILON;
        }
        true
    }

    /// The nearest hit for a ray that meets nothing opaque: instances where all is opaque need not be asked, where they are few.
    fn intersect_clear(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        if !self.is_small() {
            return self.intersect_at(ray, t_max, time);
        }
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            for (number, instance) in (0..).zip(&world.root.instances) {
                if world.may_let_light_through(number) {
                    world.try_instance(ray, instance, number, &mut best, Geometry::intersect);
                }
            }
            best
        })
    }

    /// The same for a bundle.
    fn intersect_clear_bundle(&self, bundle: &mut RayBundle, time: f32) {
        self.intersect_bundle_with(
            bundle,
            time,
            |ray, t_max| self.intersect_clear(ray, t_max, time),
            |number| self.may_let_light_through(number),
        );
    }

    /// Whether anything of an instance, where they are few, may be clear.
    pub(super) fn may_let_light_through(&self, instance: u32) -> bool {
        self.clear_instances.get(instance as usize) == Some(&true)
    }

    /// Less than this share of a light is none.
    const LEAST_PASSED: f32 = 1.0 / (1u64 << 40) as f32;

    /// The most clear surfaces that a shadow ray passes; light beyond them arrives as it is.
    const MAX_CROSSINGS: usize = 1 << 16;

    /// What stands before `t_max`.
    pub(super) fn occlusion(&self, ray: &Ray, t_max: f32, time: f32, last: &mut OccluderCache) -> Occlusion {
        let prepared = &ray.prepare();
        if last.slot != NONE && last.instance < self.root.leaves {
            let again = self.with_instance(last.instance, |instance| {
                let geometry = &self.geometries[instance.geometry as usize];
                instance.with_local_ray(prepared, &self.chains, time, |ray| geometry.blocks(last.slot, ray, t_max))
            });
            if again {
                return Occlusion::Opaque;
            }
            // Once past its shadow's border it would be tried in vain.
            *last = OccluderCache::NONE;
        }
        let unbounded = self.occlusion_unbounded(ray, t_max);
        let mut clear = unbounded == Occlusion::Clear;
        let blocked = unbounded == Occlusion::Opaque || {
            let mut block = |instance: &Instance, number: u32| {
                let geometry = &self.geometries[instance.geometry as usize];
                let slot = instance.with_local_ray(prepared, &self.chains, time, |ray| {
                    geometry.occluded(ray, t_max, |primitive| {
                        let opaque = !self.has_clear || self.made_of(instance, primitive).is_opaque();
                        clear |= !opaque;
                        opaque
                    })
                });
                if let Some(slot) = slot {
                    *last = OccluderCache { instance: number, slot };
                }
                slot.is_some()
            };
            self.any_instance(prepared, t_max, &mut block)
        };
        match (blocked, clear) {
            (true, _) => Occlusion::Opaque,
            (false, true) => Occlusion::Clear,
            (false, false) => Occlusion::Nothing,
        }
    }

    /// Whether an instance that a ray comes to at or before `t_max` `blocks` it.
    #[inline]
    pub(super) fn any_instance(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        blocks: &mut impl FnMut(&Instance, u32) -> bool,
    ) -> bool {
        let root = &self.root;
        root.tree.occluded(ray, t_max, |leaf| {
            leaf.slots().any(|slot| {
                if !ray.enters(&root.slot_bounds[slot as usize], t_max) {
                    return false;
                }
                let index = root.tree.order()[slot as usize];
                let instance = &root.instances[index as usize];
                if instance.group == NONE {
                    return blocks(instance, root.first(index));
                }
                let way = InstancePath::to(instance, root.first(index), None, &self.groups);
                self.blocked_by_group(ray, t_max, &way, blocks)
            })
        })
    }

    /// What of the shapes without bounds stands before `t_max`.
    #[inline]
    pub(super) fn occlusion_unbounded(&self, ray: &Ray, t_max: f32) -> Occlusion {
        let mut occlusion = Occlusion::Nothing;
        for (index, Unbounded { shape, .. }) in (0..).zip(&self.unbounded) {
            if shape.intersect(ray, t_max).is_some() {
                if self.is_opaque(Hit::UNBOUNDED, index) {
                    return Occlusion::Opaque;
                }
                occlusion = Occlusion::Clear;
            }
        }
        occlusion
    }

    /// Whether one of a group's instances, as they stand in the world, blocks a ray.
    #[inline(never)]
    fn blocked_by_group(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        way: &InstancePath,
        block: &mut dyn FnMut(&Instance, u32) -> bool,
    ) -> bool {
        way.group.occluded(&way.group_ray(ray.ray()), t_max, |index| {
            let (instance, number) = (&way.group.instances[index as usize], way.number(index));
            if instance.group != NONE {
                let way = InstancePath::to(instance, number, Some(way), &self.groups);
                return self.blocked_by_group(ray, t_max, &way, block);
            }
            if !self.has_clear
                && let Some(local) = way.local_ray(instance, ray.ray())
                && self.geometries[instance.geometry as usize].occluded(&local, t_max, |_| true).is_none()
            {
                return false;
            }
            let placed = way.placed(instance);
            ray.enters(&self.bounds_of(&placed), t_max) && block(&placed, number)
        })
    }

    /// Whether a primitive lets no light through.
    #[inline]
    pub(super) fn is_opaque(&self, instance: u32, primitive: u32) -> bool {
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        !self.has_clear || self.material(&hit).is_opaque()
    }
}
