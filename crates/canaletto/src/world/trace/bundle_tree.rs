//! Batches of rays among many instances and groups: each hierarchy finds the rays that may hit each instance.
//!
//! The rays traverse a group's tree side by side ([`RayFilter`]) in the group's own space. Each instance is asked about
//! the rays that enter its box. They enter the geometry's space as they would alone, so results are equal. A ray that
//! [`RayFilter`] doesn't take goes alone.

use crate::world::World;
use crate::world::data::group::{InstancePath, WideRay, t_in_group};
use crate::world::data::instance::NONE;
use crate::world::data::packet_bounds::PacketBounds;
use crate::world::trace::batch_query::{BatchQuery, BatchRays, Target};
use crate::world::trace::rays::Rays;
use canaletto_bvh::{Ray, RayEnds, RayFilter};

/// The most rays that traverse a tree side by side, so that their bounds fit the nearer caches.
const MAX_RAYS: usize = 1024;

/// Buffers for the traversal of one hierarchy.
#[derive(Debug, Default)]
pub(in crate::world) struct FilterLevel {
    filter: RayFilter,
    /// The number in the batch of each ray of the filter.
    numbers: Vec<u32>,
    /// The factor from t in the world to t in the group's space, for each ray of the filter.
    t_scales: Vec<f64>,
    /// The numbers of the rays at one instance.
    entering: Vec<u32>,
}

impl FilterLevel {
    fn clear(&mut self) {
        self.filter.clear();
        self.numbers.clear();
        self.t_scales.clear();
    }
}

/// Buffers for finding the rays of each instance.
#[derive(Debug, Default)]
pub(in crate::world) struct InstanceBuffers {
    /// The rays in an instance's space.
    pub(in crate::world) local: Rays,
    pub(in crate::world) packet_bounds: Vec<PacketBounds>,
    /// Spare buffers for the traversal of one hierarchy.
    pub(in crate::world) levels: Vec<FilterLevel>,
}

impl InstanceBuffers {
    /// Finds the bounds of the groups of rays, if the world's instances are few and any of them asks for them.
    pub(in crate::world) fn bound_groups(&mut self, world: &World, rays: &[Ray], t_max: &[f32]) {
        if world.is_small() && !world.geometry.root.instances.iter().all(|instance| world.filters_rays(instance)) {
            PacketBounds::of_groups(&mut self.packet_bounds, rays, t_max);
        }
    }
}

impl World {
    /// Tests the instances for which `counts` returns true with the rays that may hit them.
    pub(in crate::world) fn meet_many_instances(
        &self,
        rays: BatchRays,
        query: &mut impl BatchQuery,
        buffers: &mut InstanceBuffers,
        counts: impl Fn(u32) -> bool,
    ) {
        let root = &self.geometry.root;
        let mut level = buffers.levels.pop().unwrap_or_default();
        let mut next = 0;
        while next < rays.rays.len() {
            level.clear();
            while next < rays.rays.len() && level.filter.len() < MAX_RAYS {
                let (ray, t_max) = (&rays.rays[next], query.t_max(next));
                // Otherwise nothing is left to be hit.
                if t_max > 0.0 {
                    if RayFilter::takes(ray) {
                        level.filter.push(ray, 0.0, t_max);
                        level.numbers.push(next as u32);
                    } else {
                        query.meet_alone(self, ray, next, rays.time(next));
                    }
                }
                next += 1;
            }
            let FilterLevel { filter, numbers, entering, .. } = &mut level;
            root.tree.filter(filter, &root.slot_bounds, &mut |slot, members, ends| {
                let index = root.tree.order()[slot as usize];
                if !counts(index) {
                    return;
                }
                entering.clear();
                entering.extend(members.iter().map(|&member| numbers[member as usize]));
                let (instance, number) = (&root.instances[index as usize], root.first(index));
                if instance.group == NONE {
                    let may_be_clear = self.may_let_light_through(index);
                    let target =
                        Target { world: self, instance, number, admitted: None, may_be_clear, times: rays.times };
                    self.meet_member(rays, query, buffers, entering, &target);
                } else {
                    let way = InstancePath::to(instance, number, None, &self.geometry.groups);
                    self.meet_group(rays, query, buffers, entering, &way);
                }
                members.iter().zip(&*entering).for_each(|(&member, &ray)| ends.set(member, query.t_max(ray as usize)));
            });
        }
        buffers.levels.push(level);
    }

    /// Tests a geometry with the rays of these numbers.
    fn meet_member(
        &self,
        rays: BatchRays,
        query: &mut impl BatchQuery,
        buffers: &mut InstanceBuffers,
        numbers: &[u32],
        target: &Target,
    ) {
        let numbers = numbers.iter().map(|&number| number as usize);
        rays.transform(self, target.instance, numbers.clone(), &mut buffers.local);
        query.meet(target, buffers.local.all(), numbers);
    }

    /// Tests the instances of a group, each in its place in the world, with the rays of these numbers.
    #[inline(never)]
    fn meet_group<Q: BatchQuery>(
        &self,
        rays: BatchRays,
        query: &mut Q,
        buffers: &mut InstanceBuffers,
        among: &[u32],
        way: &InstancePath,
    ) {
        let mut level = buffers.levels.pop().unwrap_or_default();
        level.clear();
        for &number in among {
            let ray = &rays.rays[number as usize];
            match way.inflated(ray) {
                Some(WideRay { ray, margin, t_scale }) if RayFilter::takes(&ray) => {
                    level.filter.push(&ray, margin, t_in_group(query.t_max(number as usize), t_scale));
                    level.numbers.push(number);
                    level.t_scales.push(t_scale);
                }
                _ => query.meet_group_alone(self, way, ray, number as usize, rays.time(number as usize)),
            }
        }
        let FilterLevel { filter, numbers, t_scales, entering } = &mut level;
        let group = way.group;
        group.tree.filter(filter, &group.slot_bounds, &mut |slot: u32, members: &[u32], ends: &mut RayEnds| {
            let index = group.tree.order()[slot as usize];
            let (member, number) = (&group.instances[index as usize], way.number(index));
            entering.clear();
            entering.extend(members.iter().map(|&member| numbers[member as usize]));
            if member.group == NONE {
                let instance = &way.placed(member);
                let admitted = Some((rays.rays, self.bounds_of(instance)));
                let may_be_clear = self.member_may_let_light_through(instance);
                let target = Target { world: self, instance, number, admitted, may_be_clear, times: rays.times };
                if !query.counts(instance) {
                    return;
                }
                if Q::BOX_FIRST {
                    entering.retain(|&ray| target.admits(ray as usize, query.t_max(ray as usize)));
                }
                self.meet_member(rays, query, buffers, entering, &target);
            } else {
                let way = InstancePath::to(member, number, Some(way), &self.geometry.groups);
                self.meet_group(rays, query, buffers, entering, &way);
            }
            for &member in members {
                let t_max = query.t_max(numbers[member as usize] as usize);
                ends.set(member, t_in_group(t_max, t_scales[member as usize]));
            }
        });
        buffers.levels.push(level);
    }
}
