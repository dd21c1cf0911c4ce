//! Trees over spheres and cylinders, four of which are sorted out side by side before an exact kernel decides about the rest.

#![allow(unsafe_code)] // What is done at leaves may be compiled for a stream's instructions, though here it needs none.

use crate::lanes::Exact;
use crate::memory::in_large_pages;
use crate::round::{Ask, Block, LANES, Met, Rough, Round, Sorted};
use crate::traverse::{Any, Closest, ClosestOfMany};
use crate::{Aabb, BuildError, Bvh, Leaf, PreparedRay, Quality, Ray, Statistics};
use rayon::prelude::*;
use std::borrow::Borrow;

/// Spheres, cylinders and whatever is among them, ready for rays. A primitive's id is its place in the list that the tree was built from.
#[derive(Clone, Debug)]
pub struct Rounds {
    bvh: Bvh,
    blocks: Vec<Block>,
    count: usize,
    few: bool,
}

impl Rounds {
    /// Builds the tree over primitives with these bounds, in parallel.
    ///
    /// # Errors
    /// [`BuildError`] names the first box that is not finite or is empty, or says that there are too many.
    pub fn build(bounds: &[Aabb], round: impl Fn(u32) -> Round + Sync) -> Result<Self, BuildError> {
        let (bvh, leaves) = Bvh::build_blocks(bounds.len(), |id| bounds[id], Quality::Medium)?;
        let mut blocks = in_large_pages(leaves.len());
        (0..leaves.len())
            .into_par_iter()
            .map(|index| Block::new(leaves.block(index).iter().map(|&id| (id, round(id)))))
            .collect_into_vec(&mut blocks);
        let few = blocks.len() <= 1 && blocks.iter().all(Block::is_sorted_out);
        Ok(Self { bvh, blocks, count: bounds.len(), few })
    }

    /// How many primitives there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The box around all of them.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// What the tree is like. `bytes` includes the primitives.
    pub fn statistics(&self) -> Statistics {
        let nodes = self.bvh.statistics();
        Statistics { bytes: nodes.bytes + size_of_val(self.blocks.as_slice()), ..nodes }
    }

    /// The nearest primitive in front of the origin and not beyond `nearest.t`; of equally near ones that of the lowest id, which also has to
    /// be below `nearest.id` where it is as near as that. `nearest` stays where there is none.
    #[inline]
    pub fn intersect(&self, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) {
        if self.is_few() {
            return self.offer_all(&ray.ray, || ray, nearest, ask);
        }
        self.bvh.closest(
            ray,
            nearest.t,
            OfRay { blocks: &self.blocks, ray, rough: Rough::new(&ray.ray), nearest, ask },
        );
    }

    /// Whether a look at all of them is shorter than a way through the tree: up to four spheres and cylinders.
    #[inline]
    pub fn is_few(&self) -> bool {
        self.few
    }

    /// [`Rounds::intersect`] by a look at all of them, best where they [are few](Rounds::is_few): rays that meet none need not be prepared.
    #[inline]
    pub fn intersect_few(&self, ray: &Ray, nearest: &mut Met, ask: &impl Ask) {
        self.offer_all(ray, || ray.prepare(), nearest, ask);
    }

    #[inline(always)]
    fn offer_all<R: Borrow<PreparedRay>>(
        &self,
        ray: &Ray,
        prepared: impl Fn() -> R,
        nearest: &mut Met,
        ask: &impl Ask,
    ) {
        let rough = Rough::new(ray);
        for block in &self.blocks {
            let sorted = block.sort(block.filled(), &rough, nearest.t);
            if sorted.lanes != 0 {
                closest(block, &sorted, prepared().borrow(), nearest, ask);
            }
        }
    }

    /// [`Rounds::occluded`] likewise.
    #[inline]
    pub fn occluded_few(&self, ray: &Ray, t_max: f32, ask: &impl Ask, counts: impl FnMut(u32) -> bool) -> Option<u32> {
        self.any_of_all(ray, || ray.prepare(), t_max, ask, counts)
    }

    #[inline(always)]
    fn any_of_all<R: Borrow<PreparedRay>>(
        &self,
        ray: &Ray,
        prepared: impl Fn() -> R,
        t_max: f32,
        ask: &impl Ask,
        mut counts: impl FnMut(u32) -> bool,
    ) -> Option<u32> {
        let rough = Rough::new(ray);
        self.blocks.iter().enumerate().find_map(|(index, block)| {
            let sorted = block.sort_any(block.filled(), &rough, t_max);
            if sorted == (0, 0) {
                return None;
            }
            let lane = any(block, sorted, prepared().borrow(), t_max, ask, &mut counts)?;
            Some((index * LANES) as u32 + lane)
        })
    }

    /// [`Rounds::intersect`] for many rays that need not go the same way.
    ///
    /// # Panics
    /// If there are not as many `nearest` as rays.
    pub fn intersect_stream(&self, rays: &[PreparedRay], nearest: &mut [Met], ask: &impl Ask) {
        assert_eq!(rays.len(), nearest.len());
        let mut t_max: Vec<f32> = nearest.iter().map(|n| n.t).collect();
        let rough: Vec<Rough> = rays.iter().map(|ray| Rough::new(&ray.ray)).collect();
        let leaf = OfRays { blocks: &self.blocks, rays, rough: &rough, nearest, ask };
        self.bvh.closest_of_many(rays, &mut t_max, leaf);
    }

    /// The place, as [`Rounds::blocks`] takes it, of a primitive that is met at or before `t_max` and for whose id `counts` holds.
    #[inline]
    pub fn occluded(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        ask: &impl Ask,
        counts: impl FnMut(u32) -> bool,
    ) -> Option<u32> {
        if self.is_few() {
            return self.any_of_all(&ray.ray, || ray, t_max, ask, counts);
        }
        let (mut place, blocks, rough) = (None, &self.blocks, Rough::new(&ray.ray));
        self.bvh.any(ray, t_max, AnyOf { blocks, ray, rough, t_max, ask, counts, place: &mut place });
        place
    }

    /// Whether each of many rays meets a primitive at or before its `t_max`, which is −∞ afterwards for those that do. The rays need not go
    /// the same way.
    ///
    /// # Panics
    /// If there are not as many `t_max` as rays.
    pub fn occluded_stream(&self, rays: &[PreparedRay], t_max: &mut [f32], ask: &impl Ask) {
        let rough: Vec<Rough> = rays.iter().map(|ray| Rough::new(&ray.ray)).collect();
        self.bvh.closest_of_many(rays, t_max, AnyOfRays { blocks: &self.blocks, rays, rough: &rough, ask });
    }

    /// Whether the primitive at this place is met at or before `t_max`.
    #[inline]
    pub fn blocks(&self, place: u32, ray: &PreparedRay, t_max: f32, ask: &impl Ask) -> bool {
        let lane = place as usize % LANES;
        self.blocks[place as usize / LANES].exact(lane, ray, t_max, ask).is_some()
    }

    /// [`Rounds::intersect`] by trying all of them, none sorted out.
    pub fn intersect_brute_force(&self, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) {
        for block in &self.blocks {
            for lane in (0..LANES).filter(|&lane| block.ids[lane] != u32::MAX) {
                offer(block, lane, ray, nearest, ask);
            }
        }
    }
}

/// The bits of the lanes of a leaf that hold something.
#[inline(always)]
fn filled(leaf: Leaf) -> u32 {
    (1 << leaf.count()) - 1
}

/// Makes the primitive in this lane the nearest if it is.
#[inline(always)]
fn offer(block: &Block, lane: usize, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) {
    let id = block.ids[lane];
    if let Some(met) = block.exact(lane, ray, nearest.t, ask)
        && (met.t < nearest.t || id < nearest.id)
    {
        *nearest = Met { id, ..met };
    }
}

#[inline(always)]
fn closest(block: &Block, sorted: &Sorted, ray: &PreparedRay, nearest: &mut Met, ask: &impl Ask) {
    let mut lanes = sorted.lanes;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        // What was met meanwhile may be nearer; where the bound is no number it can't be told.
        if sorted.near[lane] > nearest.t {
            continue;
        }
        offer(block, lane, ray, nearest, ask);
    }
}

#[inline(always)]
fn any(
    block: &Block,
    (lanes, surely): (u32, u32),
    ray: &PreparedRay,
    t_max: f32,
    ask: &impl Ask,
    counts: &mut impl FnMut(u32) -> bool,
) -> Option<u32> {
    // Those that need no asking first.
    for (mut lanes, surely) in [(surely, true), (lanes & !surely, false)] {
        while lanes != 0 {
            let lane = lanes.trailing_zeros();
            lanes &= lanes - 1;
            let met = surely || block.exact(lane as usize, ray, t_max, ask).is_some();
            if met && counts(block.ids[lane as usize]) {
                return Some(lane);
            }
        }
    }
    None
}

struct OfRay<'a, A> {
    blocks: &'a [Block],
    ray: &'a PreparedRay,
    rough: Rough,
    nearest: &'a mut Met,
    ask: &'a A,
}

impl<A: Ask> Closest for OfRay<'_, A> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        let block = &self.blocks[leaf.first() as usize];
        let sorted = block.sort(filled(leaf), &self.rough, self.nearest.t);
        closest(block, &sorted, self.ray, self.nearest, self.ask);
        *t_max = self.nearest.t;
    }
}

struct OfRays<'a, A> {
    blocks: &'a [Block],
    rays: &'a [PreparedRay],
    rough: &'a [Rough],
    nearest: &'a mut [Met],
    ask: &'a A,
}

impl<A: Ask> ClosestOfMany for OfRays<'_, A> {
    type Finding = Sorted;

    #[inline(always)]
    fn test(&self, ray: usize, leaf: Leaf, t_max: f32) -> (bool, Sorted) {
        let sorted = self.blocks[leaf.first() as usize].sort(filled(leaf), &self.rough[ray], t_max);
        (sorted.lanes != 0, sorted)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: usize, leaf: Leaf, sorted: &Sorted, t_max: &mut f32) {
        let (block, nearest) = (&self.blocks[leaf.first() as usize], &mut self.nearest[ray]);
        closest(block, sorted, &self.rays[ray], nearest, self.ask);
        *t_max = nearest.t;
    }

    #[inline(always)]
    fn places(&self) -> Option<(*const u8, usize)> {
        Some((self.blocks.as_ptr().cast(), size_of::<Block>()))
    }
}

struct AnyOfRays<'a, A> {
    blocks: &'a [Block],
    rays: &'a [PreparedRay],
    rough: &'a [Rough],
    ask: &'a A,
}

impl<A: Ask> ClosestOfMany for AnyOfRays<'_, A> {
    type Finding = (u32, u32);
    const NEAREST: bool = false;

    #[inline(always)]
    fn test(&self, ray: usize, leaf: Leaf, t_max: f32) -> (bool, (u32, u32)) {
        let sorted = self.blocks[leaf.first() as usize].sort_any(filled(leaf), &self.rough[ray], t_max);
        (sorted.0 | sorted.1 != 0, sorted)
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: usize, leaf: Leaf, sorted: &(u32, u32), t_max: &mut f32) {
        let block = &self.blocks[leaf.first() as usize];
        if any(block, *sorted, &self.rays[ray], *t_max, self.ask, &mut |_| true).is_some() {
            *t_max = f32::NEG_INFINITY;
        }
    }

    #[inline(always)]
    fn places(&self) -> Option<(*const u8, usize)> {
        Some((self.blocks.as_ptr().cast(), size_of::<Block>()))
    }
}

struct AnyOf<'a, A, F> {
    blocks: &'a [Block],
    ray: &'a PreparedRay,
    rough: Rough,
    t_max: f32,
    ask: &'a A,
    counts: F,
    place: &'a mut Option<u32>,
}

impl<A: Ask, F: FnMut(u32) -> bool> Any for AnyOf<'_, A, F> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let block = &self.blocks[leaf.first() as usize];
        let sorted = block.sort_any(filled(leaf), &self.rough, self.t_max);
        *self.place = any(block, sorted, self.ray, self.t_max, self.ask, &mut self.counts)
            .map(|lane| leaf.first() * LANES as u32 + lane);
        self.place.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::round::Asked;
    use crate::testing::{Primitive, Random, awkward_ray, nearest, zoo};
    use crate::triangle::{self, Triangle};
    use crate::{InstructionSet, Ray};

    /// The scenes of the zoo as spheres with triangles among them.
    fn mixed() -> impl Iterator<Item = (&'static str, Vec<Primitive>, Rounds)> {
        let random = &mut Random(41);
        let mut scenes = zoo();
        scenes.push(("far apart", {
            let far = |r: &mut Random| r.vector() * 10f32.powi(r.below(7) as i32);
            (0..300).map(|i| Primitive::Sphere(far(random), 10f32.powi(i % 9 - 5))).collect()
        }));
        for power in [-30, -19, 18, 30] {
            let s = 10f32.powi(power);
            scenes.push((
                "tiny and huge",
                (0..200).map(|_| Primitive::Sphere(random.vector() * s, s * 0.1 * random.signed().abs())).collect(),
            ));
        }
        scenes.into_iter().map(|(name, scene)| {
            let bounds: Vec<Aabb> = scene.iter().map(Primitive::bounds).collect();
            let tree = Rounds::build(&bounds, |id| match scene[id as usize] {
                Primitive::Sphere(center, radius) => Round::Sphere { center, radius },
                Primitive::Triangle(_) => Round::Other,
            });
            (name, scene, tree.unwrap())
        })
    }

    fn ask(scene: &[Primitive]) -> impl Fn(Asked, &PreparedRay, f32) -> Option<Met> {
        |Asked { id, .. }, ray, t_max| match scene[id as usize] {
            Primitive::Triangle(corners) => {
                let hit = triangle::intersect(ray, &Triangle::new(corners), t_max)?;
                Some(Met { uv: [hit.u, hit.v], ..Met::before(hit.t) })
            }
            Primitive::Sphere(..) => panic!("spheres are known"),
        }
    }

    #[test]
    fn blocks_find_what_a_loop_over_single_primitives_finds() {
        let random = &mut Random(42);
        for (name, scene, tree) in mixed() {
            let ask = ask(&scene);
            let ids: Vec<u32> = (0..scene.len() as u32).collect();
            let rays: Vec<Ray> = (0..300)
                .map(|i| {
                    let ray = awkward_ray(&scene, random);
                    Ray::new(ray.origin, ray.direction * [1.0, 1e-3, 300.0, 1e-30, 1e-38][i % 5])
                })
                .collect();
            let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
            for set in InstructionSet::available() {
                set.limit();
                let mut stream = vec![Met::before(f32::INFINITY); rays.len()];
                tree.intersect_stream(&prepared, &mut stream, &ask);
                for limit in [f32::INFINITY, 0.9] {
                    let mut any: Vec<f32> = stream.iter().map(|met| met.t.min(limit)).collect();
                    tree.occluded_stream(&prepared, &mut any, &ask);
                    for (any, met) in any.iter().zip(&stream) {
                        assert_eq!(*any == f32::NEG_INFINITY, met.id != Met::NONE && met.t <= limit, "{name}");
                    }
                }
                for ((ray, prepared), stream) in rays.iter().zip(&prepared).zip(stream) {
                    let expected = nearest(&scene, &ids, ray, f32::INFINITY)
                        .map_or(Met::before(f32::INFINITY), |(t, u, v, id)| Met { t, id, part: 0, uv: [u, v] });
                    assert_eq!(stream, expected, "{name} {set:?} {ray:?}");
                    let mut all = Met::before(f32::INFINITY);
                    tree.intersect_brute_force(prepared, &mut all, &ask);
                    assert_eq!(all, expected, "{name} {ray:?}");
                    // Up to the hit itself, and not quite up to it.
                    for t_max in [f32::INFINITY, expected.t, expected.t.next_down()] {
                        let expected = if expected.t <= t_max { expected } else { Met::before(t_max) };
                        let mut found = Met::before(t_max);
                        tree.intersect(prepared, &mut found, &ask);
                        assert_eq!(found, expected, "{name} {set:?} {ray:?}");
                        let place = tree.occluded(prepared, t_max, &ask, |_| true);
                        assert_eq!(place.is_some(), expected.id != Met::NONE, "{name} {set:?} {ray:?} {t_max}");
                        assert!(place.is_none_or(|place| tree.blocks(place, prepared, t_max, &ask)));
                        let counted = tree.occluded(prepared, t_max, &ask, |id| id == expected.id);
                        assert_eq!(counted.is_some(), expected.id != Met::NONE, "{name} {set:?} {ray:?} {t_max}");
                    }
                }
            }
        }
    }
}
