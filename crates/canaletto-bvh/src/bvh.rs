//! The bare bounding volume hierarchy: a tree of boxes, without the primitives.

use crate::build::collapse::collapse;
use crate::build::refit;
use crate::build::{self, BuildError, Built, PrimRefs, Quality};
use crate::node::{Child, Leaf, MAX_LEAF, Node};
use crate::traverse::{self, AnyHitVisitor, ClosestVisitor, StreamVisitor};
use crate::{Aabb, InflatedRay, PreparedRay, RayEnds, RayFilter, Statistics, with_stack};

/// A tree of boxes over primitives that the caller keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
    bounds: Aabb,
}

impl Bvh {
    /// Builds the tree over `bounds`, one box per primitive, in parallel. The tree does not depend on the number of
    /// threads. Boxes may be flat and may coincide. A leaf is a range of slots, and [`Bvh::order`] gives the primitive
    /// of each slot.
    ///
    /// # Errors
    /// [`BuildError`] names the first box that is not finite or is empty, or reports that there are too many boxes.
    pub fn build(bounds: &[Aabb]) -> Result<Self, BuildError> {
        with_stack(build::STACK, || {
            let refs = PrimRefs::new(bounds.len(), &|i| bounds[i])?;
            let Built { nodes, order, bounds, .. } = build::build(refs, 1, Quality::Medium);
            Ok(Self { nodes: collapse(&nodes), order, bounds })
        })?
    }

    /// Builds a tree whose leaves are blocks of up to four primitives. The primitives of a block are tested side by
    /// side: a block has one cost however full it is. [`Leaf::first`] is then the block's number. `bounds` returns the
    /// box of each of `count` primitives. The primitives of each block are returned too, as the tree itself keeps none.
    ///
    /// # Errors
    /// As [`Bvh::build`].
    pub fn build_blocks(
        count: usize,
        bounds: impl Fn(usize) -> Aabb + Sync,
        quality: Quality,
    ) -> Result<(Self, Blocks), BuildError> {
        with_stack(build::STACK, || Ok(Self::over_blocks(PrimRefs::new(count, &bounds)?, quality)))?
    }

    /// Builds a tree over blocks. A primitive may have several references; then it may be in several blocks.
    pub(crate) fn over_blocks(refs: PrimRefs<'_>, quality: Quality) -> (Self, Blocks) {
        let built = build::build(refs, MAX_LEAF, quality);
        let Built { nodes: mut binary, mut order, bounds, duplicates } = built;
        let mut leaves = Vec::new();
        for leaf in binary.iter_mut().filter(|node| node.is_leaf()) {
            let block = leaves.len() as u32;
            let count = distinct(&mut order[leaf.first() as usize..][..leaf.count() as usize]);
            leaves.push((leaf.first(), count));
            leaf.set(block, count);
        }
        let nodes = collapse(&binary);
        (Self { nodes, order: Vec::new(), bounds }, Blocks { leaves, order, duplicates })
    }

    /// The primitive of each slot. The caller permutes its primitives into this order. Empty for a tree over blocks.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The box around all primitives.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The statistics of the tree. The call visits all nodes.
    pub fn statistics(&self) -> Statistics {
        Statistics::of(&self.nodes, &self.bounds, self.order.len())
    }

    /// Calls `leaf` for the leaves whose boxes `ray` enters within (0, t_max], roughly from near to far. `leaf` gets
    /// the current t_max and lowers it to the nearest hit that it finds.
    #[inline]
    pub fn intersect(&self, ray: &PreparedRay, t_max: f32, leaf: impl FnMut(Leaf, &mut f32)) {
        self.closest(ray, t_max, leaf);
    }

    #[inline]
    pub(crate) fn closest(&self, ray: &PreparedRay, t_max: f32, leaf: impl ClosestVisitor) -> f32 {
        traverse::closest(&self.nodes, ray, t_max, leaf)
    }

    /// Calls `leaf` for the leaves whose boxes `ray` enters within (0, t_max], in no particular order, until `leaf`
    /// returns true for a hit.
    #[inline]
    pub fn occluded(&self, ray: &PreparedRay, t_max: f32, leaf: impl FnMut(Leaf) -> bool) -> bool {
        self.any(ray, t_max, leaf)
    }

    #[inline]
    pub(crate) fn any(&self, ray: &PreparedRay, t_max: f32, leaf: impl AnyHitVisitor) -> bool {
        traverse::any(&self.nodes, ray, t_max, leaf)
    }

    /// [`Bvh::intersect`] for a ray with a margin. It is not inlined, for recursive callers: its stack frame is large.
    #[inline(never)]
    pub fn intersect_inflated(&self, ray: &InflatedRay, t_max: f32, leaf: impl FnMut(Leaf, &mut f32)) {
        traverse::closest(&self.nodes, ray, t_max, leaf);
    }

    /// [`Bvh::occluded`] for a ray with a margin. It is not inlined either.
    #[inline(never)]
    pub fn occluded_inflated(&self, ray: &InflatedRay, t_max: f32, leaf: impl FnMut(Leaf) -> bool) -> bool {
        traverse::any(&self.nodes, ray, t_max, leaf)
    }

    /// Calls `visit` for the slots whose boxes any of many rays enters, roughly from near to far. `slot_bounds` are the
    /// boxes in the order of the slots. `visit` gets the slot and the numbers of the rays that enter its box, and may
    /// lower the ends of rays.
    ///
    /// # Panics
    /// If there is no box for a slot.
    pub fn filter(&self, rays: &mut RayFilter, slot_bounds: &[Aabb], visit: &mut dyn FnMut(u32, &[u32], &mut RayEnds)) {
        rays.traverse(&self.nodes, slot_bounds, visit);
    }

    /// Calls `leaf` for the leaves whose boxes overlap `bounds`. It ends when `leaf` returns false.
    pub fn overlapping(&self, bounds: &Aabb, mut leaf: impl FnMut(Leaf) -> bool) {
        let mut waiting: Vec<usize> = (0..self.nodes.len().min(1)).collect();
        while let Some(node) = waiting.pop() {
            let node = &self.nodes[node];
            for (lane, child) in node.children().iter().enumerate() {
                match child.decode() {
                    Some(_) if !node.get_box(lane).overlaps(bounds) => {}
                    Some(Child::Node(index)) => waiting.push(index),
                    Some(Child::Leaf(found)) if !leaf(found) => return,
                    _ => {}
                }
            }
        }
    }

    /// Refits the boxes to leaves that moved. `leaf` returns the box of the leaf with this first slot or block number.
    pub(crate) fn refit(&mut self, leaf: &(dyn Fn(u32) -> Aabb + Sync)) {
        self.bounds = refit::refit(&mut self.nodes, leaf);
    }

    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    #[inline]
    pub(crate) fn trace_stream(&self, rays: &[PreparedRay], t_max: &mut [f32], leaf: impl StreamVisitor) {
        traverse::trace_stream(&self.nodes, rays, t_max, leaf);
    }
}

/// Moves the distinct ids of a short list to the front and returns their number.
fn distinct(ids: &mut [u32]) -> u32 {
    let mut count = 0;
    for i in 0..ids.len() {
        if !ids[..count].contains(&ids[i]) {
            ids[count] = ids[i];
            count += 1;
        }
    }
    count as u32
}

/// The primitives in the leaves of a tree over blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// The first slot and the number of slots of each block.
    leaves: Vec<(u32, u32)>,
    order: Vec<u32>,
    /// The duplicates, as in [`Built`].
    pub(crate) duplicates: Vec<[u32; 2]>,
}

impl Blocks {
    /// The number of blocks.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    /// The ids of the 1 to 4 primitives of a block.
    pub fn block(&self, index: usize) -> &[u32] {
        let (first, count) = self.leaves[index];
        &self.order[first as usize..][..count as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, awkward_ray, nearest, nearest_in_tree, tree, zoo};
    use crate::{InstructionSet, Ray};
    use glam::Vec3;

    #[test]
    fn the_tree_finds_what_a_loop_finds() {
        let random = &mut Random(2);
        for (name, scene) in zoo() {
            let bvh = tree(&scene);
            let ids: Vec<u32> = (0..scene.len() as u32).collect();
            let mut hits = 0;
            for _ in 0..400 {
                let ray = awkward_ray(&scene, random);
                let all = nearest(&scene, &ids, &ray, f32::INFINITY);
                // An end at the hit itself, and one just before it.
                for t_max in [f32::INFINITY, all.map_or(1.0, |hit| hit.0)] {
                    assert_eq!(
                        nearest_in_tree(&scene, &bvh, &ray, t_max).0,
                        all.filter(|hit| hit.0 <= t_max),
                        "{name} {ray:?}"
                    );
                    let occluded = bvh.occluded(&ray.prepare(), t_max, |leaf| {
                        let ids = &bvh.order()[leaf.first() as usize..leaf.slots().end as usize];
                        nearest(&scene, ids, &ray, t_max).is_some()
                    });
                    assert_eq!(occluded, all.is_some_and(|hit| hit.0 <= t_max), "{name} {ray:?}");
                }
                if let Some((t, ..)) = all {
                    hits += 1;
                    assert_eq!(nearest_in_tree(&scene, &bvh, &ray, t.next_down()).0, None, "{name} {ray:?}");
                }
            }
            assert!(hits >= 40 || name == "points and segments" && hits == 0, "{name}: {hits} hits");
        }
    }

    #[test]
    fn a_scale_by_a_power_of_two_changes_nothing() {
        let random = &mut Random(3);
        for (name, scene) in zoo() {
            if name.starts_with("1e") || name.starts_with("powers") {
                continue; // These would leave the range of normal numbers.
            }
            let bvh = tree(&scene);
            let rays: Vec<Ray> = (0..20).map(|_| awkward_ray(&scene, random)).collect();
            for k in (-20..=30).step_by(5) {
                let s = 2f32.powi(k);
                let scaled: Vec<_> = scene.iter().map(|p| p.scaled(s)).collect();
                let scaled_bvh = tree(&scaled);
                assert_eq!(bvh.order(), scaled_bvh.order());
                for ray in &rays {
                    let (hit, visits) = nearest_in_tree(&scene, &bvh, ray, f32::INFINITY);
                    // If the origin is scaled, t scales. If the direction is scaled too, t stays.
                    for (direction, t_scale) in [(ray.direction, s), (ray.direction * s, 1.0)] {
                        let ray = Ray::new(ray.origin * s, direction);
                        let other = nearest_in_tree(&scaled, &scaled_bvh, &ray, f32::INFINITY);
                        let expected = hit.map(|(t, u, v, id)| (t * t_scale, u, v, id));
                        assert_eq!(other, (expected, visits.clone()), "{name} 2^{k} {ray:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn an_empty_tree_is_never_hit() {
        let bvh = Bvh::build(&[]).unwrap();
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        bvh.intersect(&ray.prepare(), f32::INFINITY, |_, _| panic!());
        assert!(!bvh.occluded(&ray.prepare(), f32::INFINITY, |_| panic!()));
        assert!(bvh.bounds().is_empty() && bvh.order().is_empty());
        assert_eq!(bvh.statistics(), Statistics::default());
    }

    #[test]
    fn rays_without_direction_hit_nothing_and_return() {
        for (_, scene) in zoo() {
            let bvh = tree(&scene);
            for d in [0.0, -0.0] {
                let ray = Ray::new(scene[0].bounds().center(), Vec3::splat(d));
                assert_eq!(nearest_in_tree(&scene, &bvh, &ray, f32::INFINITY).0, None);
            }
            // As for any direction too short for a reciprocal, no lane without a child may be visited.
            let ray = Ray::new(Vec3::ZERO, Vec3::splat(1e-45));
            bvh.intersect(&ray.prepare(), f32::INFINITY, |leaf, _| assert!(!leaf.slots().is_empty()));
            bvh.occluded(&ray.prepare(), f32::INFINITY, |leaf| {
                assert!(!leaf.slots().is_empty());
                false
            });
        }
    }

    #[test]
    fn near_leaves_come_first_and_far_ones_are_culled() {
        let bounds: Vec<Aabb> = (0..64).map(|i| Aabb::from_points([Vec3::X * i as f32])).collect();
        let bvh = Bvh::build(&bounds).unwrap();
        for (origin, direction) in [(-1.0, Vec3::X), (64.0, -Vec3::X)] {
            let mut met = Vec::new();
            bvh.intersect(&Ray::new(Vec3::X * origin, direction).prepare(), 40.5, |leaf, t_max| {
                met.push(leaf.first());
                *t_max = t_max.min(30.5);
            });
            // The nearest leaf comes first. Leaves behind the hit are not visited.
            assert_eq!(met[0] as usize, if direction.x > 0.0 { 0 } else { bvh.order().len() - 4 });
            let culled = bvh.order().len() - met.len();
            assert!((30 / 4..=31).contains(&met.len()) && culled > 30, "{met:?}");
        }
    }

    #[test]
    fn a_hit_culls_what_waits_behind_it() {
        // One node with four leaves.
        let bounds: Vec<Aabb> = (0..16).map(|i| Aabb::from_points([Vec3::X * (10 * (i / 4)) as f32])).collect();
        let bvh = Bvh::build(&bounds).unwrap();
        assert_eq!((bvh.statistics().inner_nodes, bvh.statistics().leaves), (1, 4));
        let mut visits = 0;
        bvh.intersect(&Ray::new(-Vec3::X, Vec3::X).prepare(), f32::INFINITY, |_, t_max| {
            visits += 1;
            *t_max = 1.0;
        });
        assert_eq!(visits, 1);
    }

    #[test]
    fn every_instruction_set_and_a_stream_find_the_same() {
        // `limit` acts on all threads: other tests then run with fewer instructions, which changes no result.
        let random = &mut Random(4);
        for (name, scene) in zoo() {
            let bvh = tree(&scene);
            let rays: Vec<Ray> = (0..300).map(|_| awkward_ray(&scene, random)).collect();
            for set in InstructionSet::available() {
                set.limit();
                let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
                let mut t_max = vec![f32::INFINITY; rays.len()];
                let mut best = vec![None; rays.len()];
                bvh.trace_stream(&prepared, &mut t_max, |index: usize, leaf: Leaf, t_max: &mut f32| {
                    let ids = &bvh.order()[leaf.first() as usize..leaf.slots().end as usize];
                    if let Some(hit) = nearest(&scene, ids, &rays[index], *t_max)
                        && best[index].is_none_or(|best: crate::testing::Hit| hit.0 < best.0 || hit.3 < best.3)
                    {
                        (best[index], *t_max) = (Some(hit), hit.0);
                    }
                });
                for (ray, best) in rays.iter().zip(best) {
                    let ids: Vec<u32> = (0..scene.len() as u32).collect();
                    let all = nearest(&scene, &ids, ray, f32::INFINITY);
                    assert_eq!(best, all, "{name} {set:?} {ray:?}");
                    assert_eq!(nearest_in_tree(&scene, &bvh, ray, f32::INFINITY).0, all, "{name} {set:?} {ray:?}");
                }
            }
        }
    }

    #[test]
    fn statistics_count() {
        let random = &mut Random(5);
        let bounds: Vec<Aabb> =
            (0..10_000).map(|_| random.vector()).map(|p| Aabb::from_points([p, p + 0.01])).collect();
        let s = Bvh::build(&bounds).unwrap().statistics();
        assert!((2500..=10_000).contains(&s.leaves), "{s:?}");
        assert!((s.leaves / 7..s.leaves / 2).contains(&s.inner_nodes), "{s:?}");
        assert!((4..14).contains(&s.depth), "{s:?}");
        assert!((5.0..60.0).contains(&s.sah_cost), "{s:?}");
        assert_eq!(s.bytes, 256 * s.inner_nodes + 4 * bounds.len());
    }

    #[test]
    fn a_box_finds_the_leaves_that_it_overlaps() {
        let at = |i: u32| Vec3::new((i * 37 % 101) as f32, (i * 53 % 89) as f32, (i * 71 % 97) as f32);
        let bounds: Vec<Aabb> = (0..3000).map(|i| Aabb { min: at(i), max: at(i) + 1.5 }).collect();
        let bvh = Bvh::build(&bounds).unwrap();
        for i in 0..50 {
            let wanted = Aabb { min: at(i * 7), max: at(i * 7) + (i % 9) as f32 };
            let mut found = Vec::new();
            bvh.overlapping(&wanted, |leaf| {
                found.extend(leaf.slots().map(|slot| bvh.order()[slot as usize]));
                true
            });
            found.retain(|&id| bounds[id as usize].overlaps(&wanted));
            found.sort_unstable();
            let all: Vec<u32> = (0..3000).filter(|&id| bounds[id as usize].overlaps(&wanted)).collect();
            assert_eq!(found, all);
        }
        Bvh::build(&[]).unwrap().overlapping(&bounds[0], |_| panic!("there is nothing"));
    }
}
