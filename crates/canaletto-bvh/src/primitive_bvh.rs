//! A tree over spheres, cylinders and user primitives. Four of them are culled side by side before an exact test
//! decides the rest.

mod leaves;

use crate::build::STACK;
use crate::memory::in_large_pages;
use crate::primitive::cull::{LANES, UnitRay};
use crate::primitive::primitive4::{FilterFunction, Primitive, Primitive4, UserIntersect};
use crate::traverse::packet::primitives::PrimitiveScene;
use crate::traverse::packet::{self, Packet, PacketQuery};
use crate::{Aabb, BuildError, Bvh, PreparedRay, PrimitiveHit, Quality, Ray, Statistics, with_stack};
use canaletto_parallel::prelude::*;
use leaves::{AnyHitOfRay, AnyHitOfStream, ClosestOfRay, ClosestOfStream, any, closest};
use std::borrow::Borrow;

/// A tree over spheres, cylinders and user primitives. The id of a primitive is its index in the list that the tree was
/// built from.
#[derive(Clone, Debug)]
pub struct PrimitiveBvh {
    bvh: Bvh,
    blocks: Vec<Primitive4>,
    count: usize,
    few: bool,
}

impl PrimitiveBvh {
    /// Builds the tree over primitives with these bounds, in parallel.
    ///
    /// # Errors
    /// [`BuildError`] names the first box that is not finite or is empty, or reports that there are too many boxes.
    pub fn build(bounds: &[Aabb], primitive: impl Fn(u32) -> Primitive + Sync) -> Result<Self, BuildError> {
        Self::build_over(bounds, &primitive)
    }

    /// [`PrimitiveBvh::build`], compiled once for all functions of primitives.
    fn build_over(bounds: &[Aabb], primitive: &(dyn Fn(u32) -> Primitive + Sync)) -> Result<Self, BuildError> {
        with_stack(STACK, || {
            let (bvh, leaves) = Bvh::build_blocks(bounds.len(), |id| bounds[id], Quality::Medium)?;
            let mut blocks = in_large_pages(leaves.len());
            (0..leaves.len())
                .into_par_iter()
                .map(|index| {
                    Primitive4::new(leaves.block(index).iter().map(|&id| (id, bounds[id as usize], primitive(id))))
                })
                .collect_into_vec(&mut blocks);
            let few = blocks.len() <= 1 && blocks.iter().all(Primitive4::has_shapes_only);
            Ok(Self { bvh, blocks, count: bounds.len(), few })
        })?
    }

    /// The number of primitives.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is no primitive.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The box around all primitives.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// The statistics of the tree. `bytes` includes the primitives.
    pub fn statistics(&self) -> Statistics {
        let nodes = self.bvh.statistics();
        Statistics { bytes: nodes.bytes + size_of_val(self.blocks.as_slice()), ..nodes }
    }

    /// Finds the nearest primitive in front of the origin and not beyond `nearest.t`. Of equally near primitives it
    /// finds the one of the lowest id. A primitive as near as `nearest.t` must also have an id below `nearest.id`.
    /// `nearest` is unchanged if there is no such primitive.
    #[inline]
    pub fn intersect(&self, ray: &PreparedRay, nearest: &mut PrimitiveHit, user: &UserIntersect) {
        if self.is_few() {
            return self.intersect_all(&ray.ray, || ray, nearest, user);
        }
        self.bvh.closest(
            ray,
            nearest.t,
            ClosestOfRay { blocks: &self.blocks, ray, unit_ray: UnitRay::new(&ray.ray), nearest, user },
        );
    }

    /// Whether testing all primitives is faster than traversing the tree: for up to four spheres and cylinders.
    #[inline]
    pub fn is_few(&self) -> bool {
        self.few
    }

    /// [`PrimitiveBvh::intersect`] without the tree, best where the primitives [are few](PrimitiveBvh::is_few). Rays
    /// that miss all primitives need not be prepared.
    #[inline]
    pub fn intersect_few(&self, ray: &Ray, nearest: &mut PrimitiveHit, user: &UserIntersect) {
        self.intersect_all(ray, || ray.prepare(), nearest, user);
    }

    #[inline(always)]
    fn intersect_all<R: Borrow<PreparedRay>>(
        &self,
        ray: &Ray,
        prepared: impl Fn() -> R,
        nearest: &mut PrimitiveHit,
        user: &UserIntersect,
    ) {
        let unit_ray = UnitRay::new(ray);
        for block in &self.blocks {
            let candidates = block.cull_shapes(block.filled(), &unit_ray, nearest.t);
            if candidates.lanes != 0 {
                closest(block, &candidates, prepared().borrow(), nearest, user);
            }
        }
    }

    /// [`PrimitiveBvh::occluded`] without the tree, as [`PrimitiveBvh::intersect_few`].
    #[inline]
    pub fn occluded_few(
        &self,
        ray: &Ray,
        t_max: f32,
        user: &UserIntersect,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        self.occluded_all(ray, || ray.prepare(), t_max, user, counts)
    }

    #[inline(always)]
    fn occluded_all<R: Borrow<PreparedRay>>(
        &self,
        ray: &Ray,
        prepared: impl Fn() -> R,
        t_max: f32,
        user: &UserIntersect,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        let unit_ray = UnitRay::new(ray);
        self.blocks.iter().enumerate().find_map(|(index, block)| {
            let candidates = block.cull_any_shapes(block.filled(), &unit_ray, t_max);
            if candidates == (0, 0) {
                return None;
            }
            let lane = any(block, candidates, prepared().borrow(), t_max, user, counts)?;
            Some((index * LANES) as u32 + lane)
        })
    }

    /// [`PrimitiveBvh::intersect`] for many incoherent rays.
    ///
    /// # Panics
    /// If `rays` and `nearest` differ in length.
    pub fn intersect_stream(&self, rays: &[PreparedRay], nearest: &mut [PrimitiveHit], user: &UserIntersect) {
        assert_eq!(rays.len(), nearest.len());
        let mut t_max: Vec<f32> = nearest.iter().map(|n| n.t).collect();
        let unit_ray: Vec<UnitRay> = rays.iter().map(|ray| UnitRay::new(&ray.ray)).collect();
        let leaf = ClosestOfStream { blocks: &self.blocks, unit_ray: &unit_ray, nearest, user };
        self.bvh.trace_stream(rays, &mut t_max, leaf);
    }

    /// [`PrimitiveBvh::intersect`] for coherent rays, where neighbours in the list have nearly one direction, as rays
    /// through neighbouring pixels have. Sixteen at a time traverse the tree together. The results are right for
    /// incoherent rays, too.
    ///
    /// # Panics
    /// If `rays` and `nearest` differ in length.
    pub fn intersect_coherent(&self, rays: &[Ray], nearest: &mut [PrimitiveHit], user: &UserIntersect) {
        packet::coherent(&Coherent { bvh: self, user }, rays, nearest);
    }

    fn field<'a>(&'a self, user: &'a UserIntersect<'a>) -> PrimitiveScene<'a> {
        PrimitiveScene { nodes: self.bvh.nodes(), blocks: &self.blocks, user }
    }

    /// [`PrimitiveBvh::occluded_stream`] for coherent rays.
    ///
    /// # Panics
    /// If `rays` and `t_max` differ in length.
    pub fn occluded_coherent(&self, rays: &[Ray], t_max: &mut [f32], user: &UserIntersect) {
        packet::coherent(&Coherent { bvh: self, user }, rays, t_max);
    }

    /// The place of a primitive that is hit at or before `t_max` and for whose id `counts` returns true.
    /// [`PrimitiveBvh::is_hit_at`] takes such a place.
    #[inline]
    pub fn occluded(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        user: &UserIntersect,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        if self.is_few() {
            return self.occluded_all(&ray.ray, || ray, t_max, user, counts);
        }
        let (mut place, blocks, unit_ray) = (None, &self.blocks, UnitRay::new(&ray.ray));
        self.bvh.any(ray, t_max, AnyHitOfRay { blocks, ray, unit_ray, t_max, user, counts, place: &mut place });
        place
    }

    /// Sets `t_max` to −∞ for each of many rays that hits a primitive at or before its `t_max`. The rays may be
    /// incoherent.
    ///
    /// # Panics
    /// If `rays` and `t_max` differ in length.
    pub fn occluded_stream(&self, rays: &[PreparedRay], t_max: &mut [f32], user: &UserIntersect) {
        let unit_ray: Vec<UnitRay> = rays.iter().map(|ray| UnitRay::new(&ray.ray)).collect();
        self.bvh.trace_stream(rays, t_max, AnyHitOfStream { blocks: &self.blocks, unit_ray: &unit_ray, user });
    }

    /// Calls `f` with the ids of all primitives whose boxes overlap `bounds`, and of some whose boxes are near it.
    /// It ends when `f` returns false.
    pub fn overlapping(&self, bounds: &Aabb, mut f: impl FnMut(u32) -> bool) {
        self.bvh.overlapping(bounds, |leaf| {
            let block = &self.blocks[leaf.first() as usize];
            (0..leaf.count() as usize).all(|lane| f(block.ids[lane]))
        });
    }

    /// Whether the primitive at this place is hit at or before `t_max`.
    #[inline]
    pub fn is_hit_at(&self, place: u32, ray: &PreparedRay, t_max: f32, user: &UserIntersect) -> bool {
        let lane = place as usize % LANES;
        self.blocks[place as usize / LANES].intersect(lane, ray, t_max, user).is_some()
    }

    /// [`PrimitiveBvh::intersect`] by a loop over all primitives, without culling.
    pub fn intersect_brute_force(&self, ray: &PreparedRay, nearest: &mut PrimitiveHit, user: &UserIntersect) {
        for block in &self.blocks {
            for lane in (0..LANES).filter(|&lane| block.ids[lane] != u32::MAX) {
                block.accept_if_nearer(lane, ray, nearest, user);
            }
        }
    }
}

/// A query for coherent rays.
struct Coherent<'a> {
    bvh: &'a PrimitiveBvh,
    user: &'a UserIntersect<'a>,
}

/// The closest-hit query.
impl PacketQuery<PrimitiveHit> for Coherent<'_> {
    const RETRY: bool = false;

    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], nearest: &mut [PrimitiveHit]) -> u64 {
        let outcome = packet::primitives::closest(self.bvh.field(self.user), packet, rays, nearest);
        outcome.diverged | outcome.retry
    }

    fn trace_diverged(&self, rays: &[Ray], nearest: &mut [PrimitiveHit]) {
        self.bvh.intersect_stream(&prepared(rays), nearest, self.user);
    }
}

/// The any-hit query. A hit sets `t_max` to −∞.
impl PacketQuery<f32> for Coherent<'_> {
    const RETRY: bool = false;

    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> u64 {
        packet::primitives::any(self.bvh.field(self.user), packet, rays, t_max).diverged
    }

    fn trace_diverged(&self, rays: &[Ray], t_max: &mut [f32]) {
        self.bvh.occluded_stream(&prepared(rays), t_max, self.user);
    }
}

fn prepared(rays: &[Ray]) -> Vec<PreparedRay> {
    rays.iter().map(Ray::prepare).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitive::primitive4::UserPrimitive;
    use crate::primitive::triangle::{self, Triangle};
    use crate::testing::{Random, TestPrimitive, awkward_ray, nearest, zoo};
    use crate::traverse::packet::RAYS;
    use crate::{InstructionSet, Ray};

    /// The scenes of the zoo as spheres, with triangles as user primitives.
    fn mixed() -> impl Iterator<Item = (&'static str, Vec<TestPrimitive>, PrimitiveBvh)> {
        let random = &mut Random(41);
        let mut scenes = zoo();
        scenes.push(("far diverged", {
            let far = |r: &mut Random| r.vector() * 10f32.powi(r.below(7) as i32);
            (0..300).map(|i| TestPrimitive::Sphere(far(random), 10f32.powi(i % 9 - 5))).collect()
        }));
        for power in [-30, -19, 18, 30] {
            let s = 10f32.powi(power);
            scenes.push((
                "tiny and huge",
                (0..200).map(|_| TestPrimitive::Sphere(random.vector() * s, s * 0.1 * random.signed().abs())).collect(),
            ));
        }
        scenes.into_iter().map(|(name, scene)| {
            let bounds: Vec<Aabb> = scene.iter().map(TestPrimitive::bounds).collect();
            let tree = PrimitiveBvh::build(&bounds, |id| match scene[id as usize] {
                TestPrimitive::Sphere(center, radius) => Primitive::Sphere { center, radius },
                TestPrimitive::Triangle(_) => Primitive::User,
            });
            (name, scene, tree.unwrap())
        })
    }

    fn user(scene: &[TestPrimitive]) -> impl Fn(UserPrimitive, &PreparedRay, f32) -> Option<PrimitiveHit> {
        |UserPrimitive { id, .. }, ray, t_max| match scene[id as usize] {
            TestPrimitive::Triangle(corners) => {
                let hit = triangle::intersect(ray, &Triangle::new(corners), t_max)?;
                Some(PrimitiveHit { uv: [hit.u, hit.v], ..PrimitiveHit::none(hit.t) })
            }
            TestPrimitive::Sphere(..) => panic!("spheres have a kernel of their own"),
        }
    }

    #[test]
    fn blocks_find_what_a_loop_over_single_primitives_finds() {
        let random = &mut Random(42);
        for (name, scene, tree) in mixed() {
            let user = user(&scene);
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
                let mut stream = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                tree.intersect_stream(&prepared, &mut stream, &user);
                for limit in [f32::INFINITY, 0.9] {
                    let mut any: Vec<f32> = stream.iter().map(|met| met.t.min(limit)).collect();
                    tree.occluded_stream(&prepared, &mut any, &user);
                    for (any, met) in any.iter().zip(&stream) {
                        assert_eq!(*any == f32::NEG_INFINITY, met.id != PrimitiveHit::NONE && met.t <= limit, "{name}");
                    }
                }
                for ((ray, prepared), stream) in rays.iter().zip(&prepared).zip(stream) {
                    let expected = nearest(&scene, &ids, ray, f32::INFINITY).map_or(
                        PrimitiveHit::none(f32::INFINITY),
                        |(t, u, v, id)| PrimitiveHit { t, id, part: 0, uv: [u, v] },
                    );
                    assert_eq!(stream, expected, "{name} {set:?} {ray:?}");
                    let mut all = PrimitiveHit::none(f32::INFINITY);
                    tree.intersect_brute_force(prepared, &mut all, &user);
                    assert_eq!(all, expected, "{name} {ray:?}");
                    // An end at the hit itself, and one just before it.
                    for t_max in [f32::INFINITY, expected.t, expected.t.next_down()] {
                        let expected = if expected.t <= t_max { expected } else { PrimitiveHit::none(t_max) };
                        let mut found = PrimitiveHit::none(t_max);
                        tree.intersect(prepared, &mut found, &user);
                        assert_eq!(found, expected, "{name} {set:?} {ray:?}");
                        let place = tree.occluded(prepared, t_max, &user, &mut |_| true);
                        assert_eq!(
                            place.is_some(),
                            expected.id != PrimitiveHit::NONE,
                            "{name} {set:?} {ray:?} {t_max}"
                        );
                        assert!(place.is_none_or(|place| tree.is_hit_at(place, prepared, t_max, &user)));
                        let counted = tree.occluded(prepared, t_max, &user, &mut |id| id == expected.id);
                        assert_eq!(
                            counted.is_some(),
                            expected.id != PrimitiveHit::NONE,
                            "{name} {set:?} {ray:?} {t_max}"
                        );
                    }
                }
            }
        }
    }
    #[test]
    fn packets_find_what_single_rays_find() {
        let random = &mut Random(44);
        for (name, scene, tree) in mixed() {
            let (user, mut trace_packet) = (user(&scene), 0);
            for n in 0..30 {
                // A ray and up to a hundred that hardly differ from it, so that some of them hit what it hits.
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
                let mut found = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                let few = rays.len().min(RAYS);
                let outcome =
                    packet::primitives::closest(tree.field(&user), &mut Packet::new(), &rays[..few], &mut found);
                trace_packet += usize::from(outcome.diverged == 0);
                let expected = |i: usize, mut met: PrimitiveHit| {
                    tree.intersect_brute_force(&rays[i].prepare(), &mut met, &user);
                    met
                };
                let nothing = PrimitiveHit::none(f32::INFINITY);
                let first: Vec<PrimitiveHit> = (0..rays.len()).map(|i| expected(i, nothing)).collect();
                // No end, an end at the hit, an end before it, and an equally near hit that is already known.
                let starts = [0, 1, 2, 3, 4].map(|start| {
                    let known = |met: &PrimitiveHit| match start {
                        0 => nothing,
                        1 => PrimitiveHit::none(met.t),
                        2 => PrimitiveHit::none(met.t.next_down()),
                        3 => *met,
                        _ => PrimitiveHit { id: met.id.saturating_add(1), part: 7, ..*met },
                    };
                    let before: Vec<PrimitiveHit> = first.iter().map(known).collect();
                    let after: Vec<PrimitiveHit> =
                        before.iter().enumerate().map(|(i, met)| expected(i, *met)).collect();
                    (before, after)
                });
                for set in InstructionSet::available() {
                    set.limit();
                    for (before, after) in &starts {
                        let mut found = before.clone();
                        tree.intersect_coherent(&rays, &mut found, &user);
                        assert_eq!(&found, after, "{name} {set:?} {rays:?} {before:?}");
                    }
                    for limit in [f32::INFINITY, 0.5] {
                        let mut t_max: Vec<f32> = first.iter().map(|met| met.t.min(limit)).collect();
                        tree.occluded_coherent(&rays, &mut t_max, &user);
                        for (i, (t_max, met)) in t_max.iter().zip(&first).enumerate() {
                            let hit = met.id != PrimitiveHit::NONE && met.t <= limit;
                            assert_eq!(*t_max == f32::NEG_INFINITY, hit, "{name} {set:?} {:?}", rays[i]);
                        }
                    }
                }
            }
            assert!(trace_packet > 2, "{name}: {trace_packet}");
        }
    }
}
