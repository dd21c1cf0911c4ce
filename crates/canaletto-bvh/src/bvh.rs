//! The bounding volume hierarchy and its traversal.

use std::ops::Range;

use crate::build::{self, BuildError};
use crate::node::{Link, Node, Statistics, collapse};
use crate::slab::Slabs;
use crate::{Aabb, PreparedRay};

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
    link: Link,
}

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
    pub fn intersect(&self, ray: &PreparedRay, t_max: f32, mut leaf: impl FnMut(Range<u32>, &mut f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut t_max = t_max;
        let mut stack = Stack::new();
        let mut link = Link::node(0);
        loop {
            match link.follow() {
                Ok(slots) => leaf(slots, &mut t_max),
                Err(index) => {
                    let node = &self.nodes[index];
                    let (near, far) = ray.slabs.clip(&node.boxes, t_max);
                    let mut met = near.cmple(far).bitmask();
                    if met != 0 {
                        let near = near.to_array();
                        let next = |met: &mut u32| {
                            let lane = met.trailing_zeros() as usize & 3;
                            *met &= *met - 1;
                            Entry { near: near[lane], link: node.children[lane] }
                        };
                        // The nearest is next, the others wait in order; of equally near ones the lower lane goes first.
                        let first = next(&mut met);
                        if met == 0 {
                            link = first.link;
                            continue;
                        }
                        let second = next(&mut met);
                        let mut found = if second.near < first.near { [first, second] } else { [second, first] };
                        if met != 0 {
                            let third = next(&mut met);
                            let fourth = (met != 0).then(|| next(&mut met));
                            found = sort(&mut stack, found, third, fourth);
                        }
                        let [farther, nearest] = found;
                        stack.push(farther);
                        link = nearest.link;
                        continue;
                    }
                }
            }
            loop {
                let Some(entry) = stack.pop() else { return };
                if Slabs::within(entry.near, t_max) {
                    link = entry.link;
                    break;
                }
            }
        }
    }

    /// Calls `leaf` for the leaves that `ray` meets within (0, t_max], in no particular order, until it answers
    /// that something is hit there.
    #[inline]
    pub fn occluded(&self, ray: &PreparedRay, t_max: f32, mut leaf: impl FnMut(Range<u32>) -> bool) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let mut stack = Stack::new();
        let mut link = Link::node(0);
        loop {
            match link.follow() {
                Ok(slots) => {
                    if leaf(slots) {
                        return true;
                    }
                }
                Err(index) => {
                    let node = &self.nodes[index];
                    let (near, far) = ray.slabs.clip(&node.boxes, t_max);
                    let mut met = near.cmple(far).bitmask();
                    if met != 0 {
                        link = node.children[met.trailing_zeros() as usize & 3];
                        met &= met - 1;
                        while met != 0 {
                            stack.push(node.children[met.trailing_zeros() as usize & 3]);
                            met &= met - 1;
                        }
                        continue;
                    }
                }
            }
            let Some(waiting) = stack.pop() else { return false };
            link = waiting;
        }
    }
}

/// Sorts a third and perhaps a fourth child into two, the nearer last; what is not among the nearest two then waits on the
/// stack.
#[inline]
fn sort(stack: &mut Stack<Entry>, [mut b, mut a]: [Entry; 2], mut c: Entry, fourth: Option<Entry>) -> [Entry; 2] {
    // Later lanes move up only if they are strictly nearer.
    if c.near < b.near {
        (b, c) = (c, b);
        if b.near < a.near {
            (a, b) = (b, a);
        }
    }
    let Some(mut d) = fourth else {
        stack.push(c);
        return [b, a];
    };
    if d.near < c.near {
        (c, d) = (d, c);
        if c.near < b.near {
            (b, c) = (c, b);
            if b.near < a.near {
                (a, b) = (b, a);
            }
        }
    }
    stack.push(d);
    stack.push(c);
    [b, a]
}

/// What waits to be visited: the first few in place, so that most rays neither clear nor allocate much memory.
struct Stack<T> {
    first: [T; IN_PLACE],
    len: usize,
    rest: Vec<T>,
}

/// Enough for most rays; each level of the tree leaves at most three waiting.
const IN_PLACE: usize = 32;

impl<T: Copy + Default> Stack<T> {
    #[inline]
    fn new() -> Self {
        Self { first: [T::default(); IN_PLACE], len: 0, rest: Vec::new() }
    }

    #[inline]
    fn push(&mut self, item: T) {
        match self.first.get_mut(self.len) {
            Some(place) => *place = item,
            None => self.rest.push(item),
        }
        self.len += 1;
    }

    #[inline]
    fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        match self.first.get(self.len) {
            Some(&item) => Some(item),
            None => self.rest.pop(),
        }
    }
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;
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
                    let occluded = bvh.occluded(&ray.prepare(), t_max, |leaf| {
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
            bvh.intersect(&ray.prepare(), f32::INFINITY, |leaf, _| assert!(!leaf.is_empty()));
            bvh.occluded(&ray.prepare(), f32::INFINITY, |leaf| {
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
            bvh.intersect(&Ray::new(Vec3::X * origin, direction).prepare(), 40.5, |leaf, t_max| {
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
        bvh.intersect(&Ray::new(-Vec3::X, Vec3::X).prepare(), f32::INFINITY, |_, t_max| {
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
        bvh.intersect(&ray.prepare(), f32::INFINITY, |leaf, _| visits.push(leaf.start));
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
