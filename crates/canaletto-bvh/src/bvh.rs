//! The bounding volume hierarchy and its traversal.

use std::ops::Range;

use crate::build::{self, BuildError, MAX_DEPTH};
use crate::node::{INNER, Node, Statistics, collapse};
use crate::slab::Slabs;
use crate::{Aabb, Ray};

/// A tree of boxes over primitives that the caller keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
    bounds: Aabb,
}

/// A child to visit.
#[derive(Clone, Copy, Default)]
struct Entry {
    near: f32,
    /// 4 × node + lane.
    link: u32,
}

/// A visit takes one entry off the stack and puts four on it at most.
const STACK: usize = 3 * MAX_DEPTH as usize + 1;

impl Bvh {
    /// Builds the tree over `bounds`, one box per primitive, in parallel; the tree does not depend on the number of
    /// threads. Boxes may be flat and may coincide.
    pub fn build(bounds: &[Aabb]) -> Result<Self, BuildError> {
        let (binary, order) = build::build(bounds)?;
        let bounds = binary.first().map_or(Aabb::EMPTY, |root| root.bounds);
        Ok(Self { nodes: collapse(&binary), order, bounds })
    }

    /// From slot to primitive: the caller permutes its primitives into this order.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The box around all primitives.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What the tree is like. Visits all nodes.
    pub fn statistics(&self) -> Statistics {
        Statistics::of(&self.nodes, &self.bounds, self.order.len())
    }

    /// Calls `leaf` for the leaves that `ray` meets within (0, t_max], roughly from near to far, with a range of
    /// slots and the current t_max, which it lowers to the nearest hit that it finds.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32, mut leaf: impl FnMut(Range<u32>, &mut f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut t_max = t_max;
        let slabs = Slabs::new(ray);
        let mut stack = [Entry::default(); STACK];
        let mut len = 0;
        let mut index = 0;
        loop {
            let (near, far) = slabs.clip(&self.nodes[index as usize].boxes, t_max);
            let mut met = near.cmple(far).bitmask();
            // One child only needs no order, and is within t_max.
            if met.is_power_of_two() {
                let lane = met.trailing_zeros() as usize;
                let node = &self.nodes[index as usize];
                if node.count[lane] == INNER {
                    index = node.first[lane];
                    continue;
                }
            }
            let near = near.to_array();
            let base = len;
            // The nearest goes on top; of equally near ones the lower lane.
            while met != 0 {
                let lane = met.trailing_zeros();
                met &= met - 1;
                let entry = Entry { near: near[lane as usize], link: 4 * index + lane };
                let mut i = len;
                while i > base && stack[i - 1].near <= entry.near {
                    stack[i] = stack[i - 1];
                    i -= 1;
                }
                stack[i] = entry;
                len += 1;
            }
            loop {
                if len == 0 {
                    return;
                }
                len -= 1;
                let Entry { near, link } = stack[len];
                if !Slabs::within(near, t_max) {
                    continue;
                }
                let (first, count) = self.child(link);
                if count == INNER {
                    index = first;
                    break;
                }
                if count > 0 {
                    leaf(first..first + count, &mut t_max);
                }
            }
        }
    }

    /// Calls `leaf` for the leaves that `ray` meets within (0, t_max], in no particular order, until it answers
    /// that something is hit there.
    #[inline]
    pub fn occluded(&self, ray: &Ray, t_max: f32, mut leaf: impl FnMut(Range<u32>) -> bool) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let slabs = Slabs::new(ray);
        let mut stack = [0; STACK];
        let mut len = 0;
        let mut index = 0;
        loop {
            let (near, far) = slabs.clip(&self.nodes[index as usize].boxes, t_max);
            let mut met = near.cmple(far).bitmask();
            while met != 0 {
                stack[len] = 4 * index + met.trailing_zeros();
                met &= met - 1;
                len += 1;
            }
            loop {
                if len == 0 {
                    return false;
                }
                len -= 1;
                let (first, count) = self.child(stack[len]);
                if count == INNER {
                    index = first;
                    break;
                }
                if count > 0 && leaf(first..first + count) {
                    return true;
                }
            }
        }
    }

    #[inline]
    fn child(&self, link: u32) -> (u32, u32) {
        let node = &self.nodes[(link / 4) as usize];
        let lane = (link % 4) as usize;
        (node.first[lane], node.count[lane])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, awkward_ray, nearest, nearest_in_tree, tree, zoo};
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
                // Up to the hit itself, and not quite up to it.
                for t_max in [f32::INFINITY, all.map_or(1.0, |hit| hit.0)] {
                    assert_eq!(
                        nearest_in_tree(&scene, &bvh, &ray, t_max).0,
                        all.filter(|hit| hit.0 <= t_max),
                        "{name} {ray:?}"
                    );
                    let occluded = bvh.occluded(&ray, t_max, |leaf| {
                        let ids = &bvh.order()[leaf.start as usize..leaf.end as usize];
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
                continue; // Would leave the range of normal numbers.
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
                    // The origin scaled: t scales. The direction too: t stays.
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
        bvh.intersect(&ray, f32::INFINITY, |_, _| panic!());
        assert!(!bvh.occluded(&ray, f32::INFINITY, |_| panic!()));
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
            bvh.intersect(&ray, f32::INFINITY, |leaf, _| assert!(!leaf.is_empty()));
            bvh.occluded(&ray, f32::INFINITY, |leaf| {
                assert!(!leaf.is_empty());
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
            bvh.intersect(&Ray::new(Vec3::X * origin, direction), 40.5, |leaf, t_max| {
                met.push(leaf.start);
                *t_max = t_max.min(30.5);
            });
            let mut sorted = met.clone();
            sorted.sort_unstable_by_key(|&m| if direction.x > 0.0 { m } else { 64 - m });
            assert_eq!(met, sorted);
            assert!((30 / 4..=31).contains(&met.len()), "{met:?}");
        }
    }

    #[test]
    fn a_hit_culls_what_waits_behind_it() {
        // One node with four leaves.
        let bounds: Vec<Aabb> = (0..16).map(|i| Aabb::from_points([Vec3::X * (10 * (i / 4)) as f32])).collect();
        let bvh = Bvh::build(&bounds).unwrap();
        assert_eq!((bvh.statistics().inner_nodes, bvh.statistics().leaves), (1, 4));
        let mut visits = 0;
        bvh.intersect(&Ray::new(-Vec3::X, Vec3::X), f32::INFINITY, |_, t_max| {
            visits += 1;
            *t_max = 1.0;
        });
        assert_eq!(visits, 1);
    }

    #[test]
    fn equally_near_leaves_come_in_order() {
        let bounds: Vec<Aabb> =
            (0..16).map(|i| Aabb::from_points([Vec3::ZERO, Vec3::new(1.0, (1 + 10 * (i / 4)) as f32, 1.0)])).collect();
        let bvh = Bvh::build(&bounds).unwrap();
        let mut visits = Vec::new();
        let ray = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
        bvh.intersect(&ray, f32::INFINITY, |leaf, _| visits.push(leaf.start));
        assert_eq!(visits, [0, 4, 8, 12]);
    }

    #[test]
    fn statistics_count() {
        let random = &mut Random(5);
        let bounds: Vec<Aabb> =
            (0..10_000).map(|_| random.vector()).map(|p| Aabb::from_points([p, p + 0.01])).collect();
        let s = Bvh::build(&bounds).unwrap().statistics();
        assert!((2500..=10_000).contains(&s.leaves), "{s:?}");
        assert!((s.leaves / 3..s.leaves).contains(&s.inner_nodes), "{s:?}");
        assert!((6..20).contains(&s.depth), "{s:?}");
        assert!((5.0..60.0).contains(&s.sah_cost), "{s:?}");
        assert_eq!(s.bytes, 128 * s.inner_nodes + 4 * bounds.len());
    }
}
