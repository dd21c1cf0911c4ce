//! Shadow rays: occlusion, and the transmittance of clear surfaces.

use crate::math::{DRay, RayDifferential, offset_origin};
use crate::world::GeometryProbe;
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::group::InstancePath;
use crate::world::data::instance::{Instance, NONE, Unbounded};
use crate::world::trace::bundle::RayBundle;
use crate::world::trace::contact::{Contact, touching};
use crate::world::trace::occlusion::{OccluderCache, Occlusion};
use crate::world::trace::query::Hit;
use canaletto_bvh::{PreparedRay, Ray};
use glam::Vec3;

/// The most surfaces in a row that may bring a ray no further. After more, the ray counts as stuck.
pub(crate) const MAX_STALLED: u32 = 4;

/// A shadow ray that crosses clear surfaces.
#[derive(Debug)]
struct ShadowRay {
    /// The initial ray.
    line: DRay,
    /// The ray's end, if its light has a position.
    end: Vec3,
    /// The share of the light that has passed so far.
    passed: f32,
    /// How far along its initial direction the ray has come, times the square of the direction's length.
    progress: f64,
    /// The number of surfaces in a row that brought the ray no further.
    stalled: u32,
    /// The surfaces that coincide with the last one.
    contacts: Vec<Contact>,
}

impl ShadowRay {
    fn new(ray: &Ray) -> Self {
        let (line, end) = (DRay::from(ray), ray.origin + ray.direction);
        Self { line, end, passed: 1.0, progress: 0.0, stalled: 0, contacts: Vec::new() }
    }
}

/// Shadow rays that cross clear surfaces together.
#[derive(Debug, Default)]
pub(crate) struct ShadowRays {
    /// The rays that haven't ended.
    pub(crate) bundle: RayBundle,
    /// The numbers of these rays.
    active: Vec<u32>,
    all: Vec<ShadowRay>,
}

impl ShadowRays {
    /// The share of the light that passes along the ray with this number.
    #[inline]
    pub(crate) fn passed(&self, number: usize) -> f32 {
        self.all[number].passed
    }
}

impl World {
    /// f_s of (5.39a): the product of 1 − o over the surfaces between the ray's origin and `t_max`. `last` is the last
    /// occluder of the light, which often blocks the next ray too. `differential` is the ray's differential, for
    /// textures that let light through.
    pub fn transmittance<P: GeometryProbe + ?Sized>(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        differential: Option<&RayDifferential>,
        last: &mut OccluderCache,
        probe: &mut P,
    ) -> f32 {
        // An opaque occluder gives 0. Only a probe needs the order of the surfaces before it.
        match self.occlusion(ray, t_max, time, last) {
            Occlusion::Nothing => 1.0,
            Occlusion::Opaque if !probe.is_active() => 0.0,
            occlusion => self.transmittance_past(ray, t_max, time, differential, occlusion, probe),
        }
    }

    /// [`World::transmittance`] for a ray whose occlusion isn't [`Occlusion::Nothing`].
    pub(crate) fn transmittance_past<P: GeometryProbe + ?Sized>(
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

    /// [`World::transmittance_past`] for a batch of rays whose occlusion is [`Occlusion::Clear`].
    /// [`ShadowRays::passed`] returns the results. `differential` returns the differential of the ray with a number.
    pub(crate) fn transmittance_batch(
        &self,
        shadow_rays: &mut ShadowRays,
        differential: impl Fn(usize) -> Option<RayDifferential>,
    ) {
        let ShadowRays { bundle, active, all } = shadow_rays;
        all.clear();
        all.extend((0..bundle.len()).map(|index| ShadowRay::new(&bundle.ray(index).0)));
        active.clear();
        active.extend(0..bundle.len() as u32);
        for _ in 0..Self::MAX_CROSSINGS {
            if bundle.is_empty() {
                break;
            }
            self.intersect_clear_batch(bundle);
            let mut left = 0;
            bundle.retain(|index, ray, t_max, hit| {
                let number = active[index];
                let goes_on = hit.is_some_and(|hit| {
                    let differential = differential(number as usize);
                    self.cross(&mut all[number as usize], ray, t_max, &hit, differential.as_ref(), &mut ())
                });
                active[left] = number;
                left += usize::from(goes_on);
                goes_on
            });
            active.truncate(left);
        }
    }

    /// Crosses a clear surface with a shadow ray. Returns whether the ray goes on.
    fn cross<P: GeometryProbe + ?Sized>(
        &self,
        crossing: &mut ShadowRay,
        ray: &mut Ray,
        t_max: &mut f32,
        hit: &Hit,
        differential: Option<&RayDifferential>,
        probe: &mut P,
    ) -> bool {
        let line = DRay::from(&*ray);
        let mut surface = self.surface_without_uv(line, hit);
        let step = differential.map(|s| s.along(&crossing.line, surface.exact, surface.normal));
        let mut block = |hit: &Hit| {
            if self.casts_shadow(hit.instance, hit.primitive) {
                let opacity = self.opacity_at(line, hit, step);
                probe.blocker(hit, opacity);
                crossing.passed *= 1.0 - opacity;
            }
        };
        block(hit);
        self.contacts(&line, hit, &surface, &mut crossing.contacts, |_| {});
        if !crossing.contacts.is_empty() {
            // Coinciding surfaces are crossed with this one.
            surface.error = touching(&surface);
            for contact in &crossing.contacts {
                block(&contact.hit);
            }
        }
        if crossing.passed < Self::LEAST_PASSED {
            crossing.passed = 0.0;
            return false;
        }
        ray.origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction.as_dvec3());
        // Where a surface is flatter than rounding errors, the ray hits it again without advancing. Between two such
        // surfaces it may go to and fro, so that only what is beyond all earlier origins counts.
        let progress = (ray.origin.as_dvec3() - crossing.line.origin).dot(crossing.line.direction);
        crossing.stalled = if progress > crossing.progress { 0 } else { crossing.stalled + 1 };
        crossing.progress = crossing.progress.max(progress);
        if crossing.stalled > MAX_STALLED {
            return false;
        }
        // Towards a point, the direction is the rest of the segment, so that t stays at most 1.
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

    /// The nearest hit of a ray without opaque hits. Where instances are few, those of opaque materials only are
    /// skipped.
    fn intersect_clear(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        if !self.is_small() {
            return self.intersect_at(ray, t_max, time);
        }
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            for (number, instance) in (0..).zip(&world.geometry.root.instances) {
                if instance.casts_shadow && world.may_let_light_through(number) {
                    world.try_instance(ray, instance, number, &mut best, Geometry::intersect);
                }
            }
            best
        })
    }

    /// [`World::intersect_clear`] for a batch of rays.
    fn intersect_clear_batch(&self, bundle: &mut RayBundle) {
        self.intersect_bundle_with(bundle, |number| {
            !self.is_small()
                || self.geometry.root.instances[number as usize].casts_shadow && self.may_let_light_through(number)
        });
    }

    /// Whether any part of the root's instance at this index may be clear.
    pub(in crate::world) fn may_let_light_through(&self, index: u32) -> bool {
        self.media.clear_instances.get(index as usize) == Some(&true)
    }

    /// Whether any part of a group's member may be clear. It is placed in the world.
    pub(in crate::world) fn member_may_let_light_through(&self, member: &Instance) -> bool {
        match member.material {
            NONE => self.media.clear_geometries[member.geometry as usize],
            material => !self.shading.materials[material as usize].is_opaque(),
        }
    }

    /// A smaller share of a light counts as zero.
    const LEAST_PASSED: f32 = 1.0 / (1u64 << 40) as f32;

    /// The most clear surfaces that a shadow ray crosses. Light from beyond them arrives without further loss.
    const MAX_CROSSINGS: usize = 1 << 16;

    /// The occlusion of a ray before `t_max`.
    pub(crate) fn occlusion(&self, ray: &Ray, t_max: f32, time: f32, last: &mut OccluderCache) -> Occlusion {
        let prepared = &ray.prepare();
        if last.slot != NONE && last.instance < self.geometry.root.leaves {
            let again = self.with_instance(last.instance, |instance| {
                let geometry = &self.geometry.geometries[instance.geometry as usize];
                instance.with_local_ray(prepared, &self.geometry.chains, time, |ray| {
                    geometry.blocks(last.slot, ray, t_max, time)
                })
            });
            if again {
                return Occlusion::Opaque;
            }
            // Once a ray is outside the occluder's shadow, further tests of it rarely succeed.
            *last = OccluderCache::NONE;
        }
        let unbounded = self.occlusion_unbounded(ray, t_max);
        let mut clear = unbounded == Occlusion::Clear;
        let blocked = unbounded == Occlusion::Opaque
            || self.any_instance(prepared, t_max, &mut self.blocker(prepared, t_max, time, last, &mut clear));
        Occlusion::of(blocked, clear)
    }

    /// The occlusion of a ray before `t_max` by the instances of a group.
    pub(in crate::world) fn occlusion_by_group(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        way: &InstancePath,
        last: &mut OccluderCache,
    ) -> Occlusion {
        let (prepared, mut clear) = (&ray.prepare(), false);
        let blocked =
            self.blocked_by_group(prepared, t_max, way, &mut self.blocker(prepared, t_max, time, last, &mut clear));
        Occlusion::of(blocked, clear)
    }

    /// A function that tells whether an instance with a number blocks a ray. It sets `clear` where the ray meets a
    /// clear surface.
    fn blocker<'a>(
        &'a self,
        ray: &'a PreparedRay,
        t_max: f32,
        time: f32,
        last: &'a mut OccluderCache,
        clear: &'a mut bool,
    ) -> impl FnMut(&Instance, u32) -> bool {
        move |instance, number| {
            if !instance.casts_shadow {
                return false;
            }
            let geometry = &self.geometry.geometries[instance.geometry as usize];
            let slot = instance.with_local_ray(ray, &self.geometry.chains, time, |ray| {
                geometry.occluded(ray, t_max, time, &mut |primitive| {
                    let opaque = !self.media.has_clear || self.material_at(instance, primitive).is_opaque();
                    *clear |= !opaque;
                    opaque
                })
            });
            if let Some(slot) = slot {
                *last = OccluderCache { instance: number, slot };
            }
            slot.is_some()
        }
    }

    /// Whether `blocks` returns true for any instance that the ray enters at or before `t_max`.
    #[inline]
    pub(in crate::world) fn any_instance(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        blocks: &mut dyn FnMut(&Instance, u32) -> bool,
    ) -> bool {
        let root = &self.geometry.root;
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
                let way = InstancePath::to(instance, root.first(index), None, &self.geometry.groups);
                self.blocked_by_group(ray, t_max, &way, blocks)
            })
        })
    }

    /// The occlusion by shapes without bounds before `t_max`.
    #[inline]
    pub(in crate::world) fn occlusion_unbounded(&self, ray: &Ray, t_max: f32) -> Occlusion {
        let mut occlusion = Occlusion::Nothing;
        for (index, Unbounded { shape, casts_shadow, .. }) in (0..).zip(&self.geometry.unbounded) {
            if *casts_shadow && shape.intersect(ray, t_max).is_some() {
                if self.is_opaque(Hit::UNBOUNDED, index) {
                    return Occlusion::Opaque;
                }
                occlusion = Occlusion::Clear;
            }
        }
        occlusion
    }

    /// Whether an instance of a group, in its place in the world, blocks a ray.
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
                let way = InstancePath::to(instance, number, Some(way), &self.geometry.groups);
                return self.blocked_by_group(ray, t_max, &way, block);
            }
            // Members of groups don't move.
            let geometry = &self.geometry.geometries[instance.geometry as usize];
            if !self.media.has_clear
                && let Some(local) = way.local_ray(instance, ray.ray())
                && geometry.occluded(&local, t_max, 0.0, &mut |_| true).is_none()
            {
                return false;
            }
            let placed = way.placed(instance);
            ray.enters(&self.bounds_of(&placed), t_max) && block(&placed, number)
        })
    }

    /// Whether shadow rays meet all primitives.
    pub(crate) fn all_cast_shadows(&self) -> bool {
        let mut groups = self.geometry.groups.iter().chain([&self.geometry.root]);
        groups.all(|group| group.instances.iter().all(|instance| instance.casts_shadow))
            && self.geometry.unbounded.iter().all(|unbounded| unbounded.casts_shadow)
    }

    /// Whether shadow rays meet a primitive.
    pub(crate) fn casts_shadow(&self, instance: u32, primitive: u32) -> bool {
        if instance == Hit::UNBOUNDED {
            return self.geometry.unbounded[primitive as usize].casts_shadow;
        }
        self.with_instance(instance, |instance| instance.casts_shadow)
    }

    /// Whether a primitive lets no light through.
    #[inline]
    pub(in crate::world) fn is_opaque(&self, instance: u32, primitive: u32) -> bool {
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        !self.media.has_clear || self.material(&hit).is_opaque()
    }
}

#[cfg(test)]
mod tests;
