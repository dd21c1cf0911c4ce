//! Trees over spheres and cylinders, four of which are sorted out side by side before an exact kernel decides about the rest.

mod leaves;

use crate::build::STACK;
use crate::memory::in_large_pages;
use crate::packet::rounds::Field;
use crate::packet::{self, Packet, Query};
use crate::round::{Ask, Block, LANES, Met, Rough, Round};
use crate::{Aabb, BuildError, Bvh, PreparedRay, Quality, Ray, Statistics, with_stack};
pub(crate) use leaves::offer;
use leaves::{AnyOf, AnyOfRays, OfRay, OfRays, any, closest};
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
        with_stack(STACK, || {
            let (bvh, leaves) = Bvh::build_blocks(bounds.len(), |id| bounds[id], Quality::Medium)?;
            let mut blocks = in_large_pages(leaves.len());
            (0..leaves.len())
                .into_par_iter()
                .map(|index| Block::new(leaves.block(index).iter().map(|&id| (id, bounds[id as usize], round(id)))))
                .collect_into_vec(&mut blocks);
            let few = blocks.len() <= 1 && blocks.iter().all(Block::is_round);
            Ok(Self { bvh, blocks, count: bounds.len(), few })
        })?
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
            let sorted = block.sort_round(block.filled(), &rough, nearest.t);
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
            let sorted = block.sort_any_round(block.filled(), &rough, t_max);
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
        let leaf = OfRays { blocks: &self.blocks, rough: &rough, nearest, ask };
        self.bvh.closest_of_many(rays, &mut t_max, leaf);
    }

    /// [`Rounds::intersect`] for rays of which neighbours in the list go nearly the same way, as those through neighbouring pixels do:
    /// sixteen at a time go through the tree together. Any rays give the right answer.
    ///
    /// # Panics
    /// If there are not as many `nearest` as rays.
    pub fn intersect_coherent(&self, rays: &[Ray], nearest: &mut [Met], ask: &impl Ask) {
        packet::coherent(&Coherent { rounds: self, ask }, rays, nearest);
    }

    fn field<'a, A: Ask>(&'a self, ask: &'a A) -> Field<'a, A> {
        Field { nodes: self.bvh.nodes(), blocks: &self.blocks, ask }
    }

    /// [`Rounds::occluded_stream`] for rays of which neighbours in the list go nearly the same way.
    ///
    /// # Panics
    /// If there are not as many `t_max` as rays.
    pub fn occluded_coherent(&self, rays: &[Ray], t_max: &mut [f32], ask: &impl Ask) {
        packet::coherent(&Coherent { rounds: self, ask }, rays, t_max);
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
        self.bvh.closest_of_many(rays, t_max, AnyOfRays { blocks: &self.blocks, rough: &rough, ask });
    }

    /// Calls `f` with the ids of all primitives whose boxes overlap this one and some whose boxes come near it, until it answers that it wants no more.
    pub fn overlapping(&self, bounds: &Aabb, mut f: impl FnMut(u32) -> bool) {
        self.bvh.overlapping(bounds, |leaf| {
            let block = &self.blocks[leaf.first() as usize];
            (0..leaf.count() as usize).all(|lane| f(block.ids[lane]))
        });
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

/// What is asked about rays that go together.
struct Coherent<'a, A> {
    rounds: &'a Rounds,
    ask: &'a A,
}

/// The nearest primitives.
impl<A: Ask> Query<Met> for Coherent<'_, A> {
    const AGAIN: bool = false;

    fn together(&self, packet: &mut Packet, rays: &[Ray], nearest: &mut [Met]) -> u64 {
        let outcome = packet::rounds::closest(self.rounds.field(self.ask), packet, rays, nearest);
        outcome.apart | outcome.again
    }

    fn apart(&self, rays: &[Ray], nearest: &mut [Met]) {
        self.rounds.intersect_stream(&prepared(rays), nearest, self.ask);
    }
}

/// Whether there is any, by −∞.
impl<A: Ask> Query<f32> for Coherent<'_, A> {
    const AGAIN: bool = false;

    fn together(&self, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> u64 {
        packet::rounds::any(self.rounds.field(self.ask), packet, rays, t_max).apart
    }

    fn apart(&self, rays: &[Ray], t_max: &mut [f32]) {
        self.rounds.occluded_stream(&prepared(rays), t_max, self.ask);
    }
}

fn prepared(rays: &[Ray]) -> Vec<PreparedRay> {
    rays.iter().map(Ray::prepare).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packet::RAYS;
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
    #[test]
    fn packets_find_what_single_rays_find() {
        let random = &mut Random(44);
        for (name, scene, tree) in mixed() {
            let (ask, mut together) = (ask(&scene), 0);
            for n in 0..30 {
                // A ray and up to a hundred that hardly differ from it, so that some of them touch what it touches.
                let Ray { origin, direction } = awkward_ray(&scene, random);
                let direction = direction * [1.0, 1.0, 1e-3, 1e30, 1e-37][n % 5];
                let size = direction.abs().max_element();
                let rays: Vec<Ray> = (0..[1 + n % 16, n + 40][n % 2])
                    .map(|_| {
                        let turned = random.vector() * size * [0.0, 1e-6, 0.01, 0.03][random.below(4)];
                        let moved = turned * [0.0, 1.0][random.below(2)];
                        Ray::new(origin + moved, direction + turned - moved * 0.5)
                    })
                    .collect();
                let mut found = vec![Met::before(f32::INFINITY); rays.len()];
                let few = rays.len().min(RAYS);
                let outcome = packet::rounds::closest(tree.field(&ask), &mut Packet::new(), &rays[..few], &mut found);
                together += usize::from(outcome.apart == 0);
                let expected = |i: usize, mut met: Met| {
                    tree.intersect_brute_force(&rays[i].prepare(), &mut met, &ask);
                    met
                };
                let nothing = Met::before(f32::INFINITY);
                let first: Vec<Met> = (0..rays.len()).map(|i| expected(i, nothing)).collect();
                // Up to anywhere, up to the hit, short of it, and where something as near is known already.
                let starts = [0, 1, 2, 3, 4].map(|start| {
                    let known = |met: &Met| match start {
                        0 => nothing,
                        1 => Met::before(met.t),
                        2 => Met::before(met.t.next_down()),
                        3 => *met,
                        _ => Met { id: met.id.saturating_add(1), part: 7, ..*met },
                    };
                    let before: Vec<Met> = first.iter().map(known).collect();
                    let after: Vec<Met> = before.iter().enumerate().map(|(i, met)| expected(i, *met)).collect();
                    (before, after)
                });
                for set in InstructionSet::available() {
                    set.limit();
                    for (before, after) in &starts {
                        let mut found = before.clone();
                        tree.intersect_coherent(&rays, &mut found, &ask);
                        assert_eq!(&found, after, "{name} {set:?} {rays:?} {before:?}");
                    }
                    for limit in [f32::INFINITY, 0.5] {
                        let mut t_max: Vec<f32> = first.iter().map(|met| met.t.min(limit)).collect();
                        tree.occluded_coherent(&rays, &mut t_max, &ask);
                        for (i, (t_max, met)) in t_max.iter().zip(&first).enumerate() {
                            let hit = met.id != Met::NONE && met.t <= limit;
                            assert_eq!(*t_max == f32::NEG_INFINITY, hit, "{name} {set:?} {:?}", rays[i]);
                        }
                    }
                }
            }
            assert!(together > 2, "{name}: {together}");
        }
    }
}
