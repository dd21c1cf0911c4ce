//! The traversal of many rays side by side through a tree. Each node passes on to each child the rays that enter the
//! child's box. It is for leaves that are worth a batch of rays, such as instances.
//!
//! Stream filtering after Wald, Gribble, Boulos and Kensler, "SIMD ray stream tracing" (2007), with nodes of eight
//! children as in Tsakok, "Faster incoherent rays: multi-BVH ray stream tracing" (2009). Rays are kept in groups of
//! sixteen, and a child's list holds a bit for each ray of a group. A group is tested against a box side by side, or
//! each of its few remaining rays against all eight boxes. One test of the intervals of a group of one octant culls
//! boxes for all its rays. Nodes are visited in the order for the first ray of their list.
//!
//! The tests are conservative, as those of single rays are: a box that a ray alone would enter is entered.

#![allow(clippy::needless_range_loop)] // Loops over lists side by side.

use super::packet::Interval;
use crate::node::{Node, NodeRef};
use crate::simd::dispatch::{self, SimdKernel};
use crate::simd::{Instructions, ROW, Row, Vector};
use crate::slab::{INFLATE, WIDTH, cull_limit};
use crate::{Aabb, Ray};

/// The range of components of directions whose reciprocals are normal numbers.
const REGULAR: std::ops::RangeInclusive<f32> = 1e-37..=1e37;

/// Up to sixteen rays, as far as box tests need them.
#[derive(Clone)]
#[repr(C, align(64))]
struct BoxRays {
    /// The origins, moved ahead by the margin for lower planes and back by it for upper planes, as rows x, y and z.
    /// Moving a plane by the margin is equivalent.
    origins: [[Row<f32>; 3]; 2],
    /// The directions until the group is complete, then their reciprocals.
    reciprocal: [Row<f32>; 3],
    /// The largest entry distance at which each ray still visits a box; −∞ for a ray that has ended.
    limit: Row<f32>,
    /// The intervals of all origins for the lower and for the upper planes, and of all reciprocals.
    hull: [[Interval; 3]; 2],
    /// The octant of the first ray.
    octant: usize,
    /// Whether all rays have this octant.
    is_coherent: bool,
}

impl BoxRays {
    const EMPTY: Self = Self {
        origins: [[Row([0.0; ROW]); 3]; 2],
        reciprocal: [Row([1.0; ROW]); 3],
        limit: Row([f32::NEG_INFINITY; ROW]),
        hull: [[Interval::NONE; 3]; 2],
        octant: 0,
        is_coherent: false,
    };

    /// Completes a group of `count` rays.
    #[inline(always)]
    fn complete<S: Instructions>(&mut self, s: S, count: usize) {
        // The first ray stands in for missing ones.
        for lane in count..ROW {
            for row in self.origins.iter_mut().flatten().chain(&mut self.reciprocal) {
                row.0[lane] = row.0[0];
            }
            self.limit.0[lane] = f32::NEG_INFINITY;
        }
        self.octant = 0;
        self.is_coherent = true;
        for axis in 0..3 {
            let mut backwards = 0;
            let (mut low, mut high) = (s.splat(f32::INFINITY), s.splat(f32::NEG_INFINITY));
            for part in 0..S::Vector::PARTS {
                let direction = s.load(&self.reciprocal[axis], part);
                backwards |= S::Vector::bits(direction.less(s.splat(0.0)), part);
                let reciprocal = s.splat(1.0) / direction;
                reciprocal.store(&mut self.reciprocal[axis], part);
                (low, high) = (low.min(reciprocal), high.max(reciprocal));
            }
            self.octant |= (backwards as usize & 1) << axis;
            self.is_coherent &= backwards == 0 || backwards == u32::MAX >> (32 - ROW);
            let reciprocal = ends(s, low, high);
            for side in 0..2 {
                let (mut low, mut high) = (s.splat(f32::INFINITY), s.splat(f32::NEG_INFINITY));
                for part in 0..S::Vector::PARTS {
                    let origin = s.load(&self.origins[side][axis], part);
                    (low, high) = (low.min(origin), high.max(origin));
                }
                self.hull[side][axis] = Interval { origin: ends(s, low, high), reciprocal };
            }
        }
    }

    /// The rays that enter a box, one bit for each.
    #[inline(always)]
    fn entering<S: Instructions>(&self, s: S, [lower, upper]: [[f32; 3]; 2]) -> u32 {
        let mut met = 0;
        for part in 0..S::Vector::PARTS {
            let (mut near, mut far) = (s.splat(0.0), s.splat(f32::INFINITY));
            for axis in 0..3 {
                let r = s.load(&self.reciprocal[axis], part);
                let a = (s.splat(lower[axis]) - s.load(&self.origins[0][axis], part)) * r;
                let b = (s.splat(upper[axis]) - s.load(&self.origins[1][axis], part)) * r;
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            let end = (far * s.splat(INFLATE)).min(s.load(&self.limit, part));
            met |= S::Vector::bits(near.less_or_equal(end), part);
        }
        met
    }

    /// The boxes of a node that one ray enters, one bit for each.
    #[inline(always)]
    fn entered<S: Instructions>(&self, s: S, node: &Node, ray: usize) -> u32 {
        let mut met = 0;
        for part in 0..S::Vector::PARTS_OF_EIGHT {
            let (mut near, mut far) = (s.splat(0.0), s.splat(f32::INFINITY));
            for axis in 0..3 {
                let r = s.splat(self.reciprocal[axis].0[ray]);
                let a = (s.eight(&node.boxes[0][axis], part) - s.splat(self.origins[0][axis].0[ray])) * r;
                let b = (s.eight(&node.boxes[1][axis], part) - s.splat(self.origins[1][axis].0[ray])) * r;
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            let end = (far * s.splat(INFLATE)).min(s.splat(self.limit.0[ray]));
            met |= S::Vector::bits(near.less_or_equal(end), part);
        }
        met
    }

    /// The boxes of a node that any ray may enter, for rays of one octant.
    #[inline(always)]
    fn candidates<S: Instructions>(&self, s: S, node: &Node) -> u32 {
        let mut farthest = s.load(&self.limit, 0);
        for part in 1..S::Vector::PARTS {
            farthest = farthest.max(s.load(&self.limit, part));
        }
        let farthest = farthest.largest();
        let mut met = 0;
        for part in 0..S::Vector::PARTS_OF_EIGHT {
            let (mut near, mut far) = (s.splat(0.0), s.splat(f32::INFINITY));
            for axis in 0..3 {
                let entry = self.octant >> axis & 1;
                let (first, second) = (&self.hull[entry][axis], &self.hull[entry ^ 1][axis]);
                // The origin farthest ahead enters first, the one farthest back leaves last.
                let (enter, leave) = if entry == 1 { (0, 1) } else { (1, 0) };
                let x = s.eight(&node.boxes[entry][axis], part) - s.splat(first.origin[enter]);
                let y = s.eight(&node.boxes[entry ^ 1][axis], part) - s.splat(second.origin[leave]);
                let (r0, r1) = (s.splat(first.reciprocal[0]), s.splat(first.reciprocal[1]));
                near = near.max((x * r0).min(x * r1));
                far = far.min((y * r0).max(y * r1));
            }
            let end = (far * s.splat(INFLATE)).min(s.splat(farthest));
            met |= S::Vector::bits(near.less_or_equal(end), part);
        }
        met
    }
}

/// The smallest and the largest number of all lanes.
#[inline(always)]
fn ends<S: Instructions>(s: S, low: S::Vector, high: S::Vector) -> [f32; 2] {
    [-(s.splat(0.0) - low).largest(), high.largest()]
}

/// Some rays of a group, one bit for each.
#[derive(Clone, Copy, Default)]
struct Members {
    group: u16,
    rays: u16,
}

/// A node or leaf to visit, with its rays.
#[derive(Clone, Copy)]
struct Visit {
    node_ref: NodeRef,
    /// The start of its list in [`RayFilter::waiting`].
    first: usize,
}

/// Rays that go through a tree together, and the memory for it.
#[derive(Default)]
pub struct RayFilter {
    groups: Vec<BoxRays>,
    len: usize,
    stack: Vec<Visit>,
    /// The lists of the nodes and leaves on the stack, one after the other.
    waiting: Vec<Members>,
    /// The list of the current node or leaf.
    current: Vec<Members>,
    /// The lists of the current node's children.
    children: [Vec<Members>; WIDTH],
    /// The rays at the current leaf.
    entering: Vec<u32>,
}

impl std::fmt::Debug for RayFilter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RayFilter").field("len", &self.len).finish_non_exhaustive()
    }
}

impl RayFilter {
    /// The largest number of rays.
    pub const MAX_RAYS: usize = ROW << 16;

    /// Whether a ray can be among others. The others, such as those along an axis, have to be traced alone.
    #[inline]
    pub fn takes(ray: &Ray) -> bool {
        let size = ray.direction.abs();
        let is_regular = REGULAR.contains(&size.min_element()) && REGULAR.contains(&size.max_element());
        is_regular && !size.is_nan() && ray.origin.is_finite()
    }

    /// Removes all rays.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds a ray that [`RayFilter::takes`] admits. Neighbouring rays should be nearly parallel. The ray enters a box
    /// if it comes within `margin` of the box along each axis, at or before `t_max`.
    ///
    /// # Panics
    /// If there are more than [`RayFilter::MAX_RAYS`].
    #[inline]
    pub fn push(&mut self, ray: &Ray, margin: f32, t_max: f32) {
        let (group, lane) = (self.len / ROW, self.len % ROW);
        assert!(self.len < Self::MAX_RAYS);
        if group == self.groups.len() {
            self.groups.push(BoxRays::EMPTY);
        }
        let group = &mut self.groups[group];
        for axis in 0..3 {
            group.origins[0][axis].0[lane] = ray.origin[axis] + margin;
            group.origins[1][axis].0[lane] = ray.origin[axis] - margin;
            group.reciprocal[axis].0[lane] = ray.direction[axis];
        }
        group.limit.0[lane] = cull_limit(t_max);
        self.len += 1;
    }

    /// Calls `visit` for the slots whose boxes rays enter, roughly from near to far. `visit` gets the slot and the rays
    /// that enter its box. It may lower their ends.
    pub(crate) fn traverse(
        &mut self,
        nodes: &[Node],
        slot_bounds: &[Aabb],
        visit: &mut dyn FnMut(u32, &[u32], &mut RayEnds),
    ) {
        if self.len > 0 && !nodes.is_empty() {
            dispatch::run(Traversal { filter: self, nodes, slot_bounds, visit });
        }
    }
}

/// The ends of the rays of a [`RayFilter`].
pub struct RayEnds<'a>(&'a mut [BoxRays]);

impl RayEnds<'_> {
    /// Lowers the end of a ray; to −∞ if it goes no further.
    #[inline]
    pub fn set(&mut self, ray: u32, t_max: f32) {
        self.0[ray as usize / ROW].limit.0[ray as usize % ROW] = cull_limit(t_max);
    }
}

struct Traversal<'a> {
    filter: &'a mut RayFilter,
    nodes: &'a [Node],
    slot_bounds: &'a [Aabb],
    visit: &'a mut dyn FnMut(u32, &[u32], &mut RayEnds),
}

impl SimdKernel for Traversal<'_> {
    type Answer = ();

    #[inline(always)]
    fn run<S: Instructions>(self, s: S) {
        let Self { filter, nodes, slot_bounds, visit } = self;
        let RayFilter { groups, len, stack, waiting, current, children, entering } = filter;
        let groups = &mut groups[..len.div_ceil(ROW)];
        stack.clear();
        waiting.clear();
        for (number, group) in groups.iter_mut().enumerate() {
            let count = (*len - number * ROW).min(ROW);
            group.complete(s, count);
            waiting.push(Members { group: number as u16, rays: u16::MAX >> (ROW - count) });
        }
        stack.push(Visit { node_ref: NodeRef::node(0), first: 0 });
        while let Some(Visit { node_ref, first }) = stack.pop() {
            current.clear();
            current.extend_from_slice(&waiting[first..]);
            waiting.truncate(first);
            if node_ref.is_leaf() {
                for slot in node_ref.leaf().slots() {
                    let bounds = &slot_bounds[slot as usize];
                    let planes = [bounds.min.to_array(), bounds.max.to_array()];
                    entering.clear();
                    for members in &*current {
                        let group = usize::from(members.group);
                        let mut left = u32::from(members.rays) & groups[group].entering(s, planes);
                        while left != 0 {
                            entering.push((group * ROW) as u32 + left.trailing_zeros());
                            left &= left - 1;
                        }
                    }
                    if !entering.is_empty() {
                        visit(slot, entering, &mut RayEnds(groups));
                    }
                }
                continue;
            }
            let node = &nodes[node_ref.node_index()];
            let mut real = 0;
            for lane in 0..WIDTH {
                real |= u32::from(node.children[lane] != NodeRef::END) << lane;
                children[lane].clear();
            }
            for members in &*current {
                let group = &groups[usize::from(members.group)];
                let mut boxes = if group.is_coherent { group.candidates(s, node) & real } else { real };
                let rays = u32::from(members.rays);
                // Two registers hold a group, one register holds a node's boxes.
                if 2 * boxes.count_ones() <= rays.count_ones() {
                    while boxes != 0 {
                        let lane = boxes.trailing_zeros() as usize % WIDTH;
                        boxes &= boxes - 1;
                        let plane = |side: usize| [0, 1, 2].map(|axis| node.boxes[side][axis][lane]);
                        let met = group.entering(s, [plane(0), plane(1)]) & rays;
                        if met != 0 {
                            children[lane].push(Members { rays: met as u16, ..*members });
                        }
                    }
                    continue;
                }
                let (mut met, mut left) = ([0u16; WIDTH], rays);
                let mut any = 0;
                while left != 0 {
                    let ray = left.trailing_zeros() as usize % ROW;
                    left &= left - 1;
                    let mut entered = group.entered(s, node, ray) & boxes;
                    any |= entered;
                    while entered != 0 {
                        met[entered.trailing_zeros() as usize % WIDTH] |= 1 << ray;
                        entered &= entered - 1;
                    }
                }
                while any != 0 {
                    let lane = any.trailing_zeros() as usize % WIDTH;
                    any &= any - 1;
                    children[lane].push(Members { rays: met[lane], ..*members });
                }
            }
            let octant = groups[usize::from(current[0].group)].octant;
            for lane in node.order(octant) {
                if !children[lane].is_empty() {
                    stack.push(Visit { node_ref: node.children[lane], first: waiting.len() });
                    waiting.extend_from_slice(&children[lane]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use crate::{Bvh, InflatedRay, InstructionSet};
    use glam::Vec3;

    /// Boxes with their tree, and rays side by side, from one place, or any rays.
    fn rays_and_boxes(random: &mut Random, round: usize) -> (Vec<Aabb>, Bvh, Vec<(Ray, f32)>) {
        let count = [1, 7, 60, 400][round % 4];
        let bounds: Vec<Aabb> = (0..count)
            .map(|_| {
                let min = random.vector() * 4.0;
                Aabb { min, max: min + random.vector().abs() * [0.0, 0.3, 1.5][round % 3] }
            })
            .collect();
        let bvh = Bvh::build(&bounds).unwrap();
        let (origin, to) = (random.vector() * 5.0, random.vector());
        let spread = [0.01, 0.3, 3.0][round % 3];
        let rays = (0..[1, 16, 100][round / 4 % 3]).map(|n| {
            let from = origin + random.vector() * spread * (round % 2) as f32;
            (Ray::new(from, to + random.vector() * spread - from), [f32::INFINITY, 1.2, 0.0][n % 7 / 3])
        });
        let rays = rays.filter(|(ray, _)| RayFilter::takes(ray)).collect();
        (bounds, bvh, rays)
    }

    fn slot_bounds(bounds: &[Aabb], bvh: &Bvh) -> Vec<Aabb> {
        bvh.order().iter().map(|&id| bounds[id as usize]).collect()
    }

    #[test]
    fn each_ray_comes_to_the_boxes_that_it_enters_alone() {
        let (random, mut filter) = (&mut Random(67), RayFilter::default());
        let mut met = [0; 2];
        for round in 0..240 {
            let (bounds, bvh, rays) = rays_and_boxes(random, round);
            let slots = slot_bounds(&bounds, &bvh);
            for set in InstructionSet::available() {
                set.limit();
                for margin in [0.0, 0.2] {
                    filter.clear();
                    rays.iter().for_each(|(ray, t_max)| filter.push(ray, margin, *t_max));
                    let mut found = Vec::new();
                    bvh.filter(&mut filter, &slots, &mut |slot, members, _| {
                        found.extend(members.iter().map(|&ray| (slot, ray)));
                    });
                    let visits = found.len();
                    found.sort_unstable();
                    found.dedup();
                    assert_eq!(visits, found.len(), "no ray comes twice");
                    let alone = |slot: usize, ray: usize, margin: f32| {
                        InflatedRay::new(&rays[ray].0, margin).enters(&slots[slot], rays[ray].1)
                    };
                    for (slot, ray) in (0..slots.len()).flat_map(|slot| (0..rays.len()).map(move |ray| (slot, ray))) {
                        let comes = found.binary_search(&(slot as u32, ray as u32)).is_ok();
                        // With a margin, roundings may differ.
                        let [least, most] = [0.9999, 1.0001].map(|share| alone(slot, ray, margin * share));
                        assert!(comes >= least && comes <= most, "{set:?} {margin} {:?} {:?}", rays[ray], slots[slot]);
                        met[usize::from(margin > 0.0)] += usize::from(comes);
                    }
                }
            }
        }
        assert!(met[0] > 3000 && met[1] > 2 * met[0], "{met:?}");
    }

    #[test]
    fn ends_cull_what_lies_behind() {
        let (random, mut filter) = (&mut Random(68), RayFilter::default());
        let (mut entries, mut all) = (0, 0);
        for round in 0..60 {
            let (bounds, bvh, rays) = rays_and_boxes(random, round);
            let slots = slot_bounds(&bounds, &bvh);
            filter.clear();
            rays.iter().for_each(|(ray, t_max)| filter.push(ray, 0.0, *t_max));
            // The nearest entry of each ray.
            let entry =
                |ray: usize, slot: u32| rays[ray].0.prepare().clamp_to_box(&slots[slot as usize], 0.0, rays[ray].1);
            let mut nearest = vec![f32::INFINITY; rays.len()];
            bvh.filter(&mut filter, &slots, &mut |slot, members, ends| {
                for &ray in members {
                    entries += 1;
                    if let Some(t) = entry(ray as usize, slot)
                        && t < nearest[ray as usize]
                    {
                        nearest[ray as usize] = t;
                        ends.set(ray, t);
                    }
                }
            });
            for (ray, nearest) in nearest.iter().enumerate() {
                let expected = (0..slots.len() as u32).filter_map(|slot| entry(ray, slot));
                assert_eq!(*nearest, expected.clone().fold(f32::INFINITY, f32::min));
                all += expected.count();
            }
        }
        assert!(entries * 4 < all * 3, "{entries} {all}");
    }

    #[test]
    fn rays_along_axes_and_without_numbers_are_not_taken() {
        assert!(RayFilter::takes(&Ray::new(Vec3::ONE, Vec3::new(1.0, -2.0, 1e-30))));
        for (origin, direction) in [
            (Vec3::ONE, Vec3::new(1.0, 0.0, 1.0)),
            (Vec3::ONE, Vec3::new(1.0, 1e-40, 1.0)),
            (Vec3::ONE, Vec3::new(1.0, f32::NAN, 1.0)),
            (Vec3::ONE, Vec3::new(1.0, f32::INFINITY, 1.0)),
            (Vec3::INFINITY, Vec3::ONE),
            (Vec3::NAN, Vec3::ONE),
        ] {
            assert!(!RayFilter::takes(&Ray::new(origin, direction)));
        }
    }
}
