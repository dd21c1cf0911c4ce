//! A tree over triangles, four of which are tested side by side.

mod leaves;
mod refit;

use crate::build::{Corners, PrimRefs, STACK, duplicates};
use crate::memory::in_large_pages;
use crate::node::Node;
use crate::primitive::edge_error::EdgeError;
use crate::primitive::triangle4::{Search, Triangle4, TriangleScene};
use crate::traverse::packet::{self, Packet, PacketQuery};
use crate::triangle;
use crate::{
    Aabb, BuildError, Bvh, FilterFunction, Leaf, PreparedRay, PrimitiveHit, Quality, Ray, Statistics, with_stack,
};
use canaletto_parallel::prelude::*;
use glam::Vec3;
use leaves::{AnyHitOfRay, AnyHitOfStream, ClosestOfRay, ClosestOfStream};

/// A tree over triangles. The id of a triangle is its index in the list that the tree was built from.
#[derive(Clone, Debug)]
pub struct TriangleBvh {
    bvh: Bvh,
    blocks: Vec<Triangle4>,
    count: usize,
    quality: Quality,
    /// The SAH cost of the tree when it was built, if it has been refitted since.
    built_cost: Option<f64>,
    /// Pairs of triangles with equal corners, the second of which is in no block, in ascending order.
    duplicates: Vec<[u32; 2]>,
}

/// The number of rays of a stream that are prepared at a time.
const STREAM: usize = 1024;

impl TriangleBvh {
    /// Builds the tree over `count` triangles, in parallel.
    ///
    /// # Errors
    /// [`BuildError`] names the first triangle with a corner that is not finite, or reports that there are too many
    /// triangles.
    pub fn build(count: usize, corners: impl Fn(u32) -> [Vec3; 3] + Sync) -> Result<Self, BuildError> {
        Self::build_with(Quality::Medium, count, corners)
    }

    /// [`TriangleBvh::build`] with a [`Quality`].
    ///
    /// # Errors
    /// As [`TriangleBvh::build`].
    pub fn build_with(
        quality: Quality,
        count: usize,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    ) -> Result<Self, BuildError> {
        Self::build_over(quality, count, &corners)
    }

    /// [`TriangleBvh::build_with`], compiled once for all functions of corners.
    fn build_over(quality: Quality, count: usize, corners: &Corners) -> Result<Self, BuildError> {
        with_stack(STACK, || Ok(Self::over(PrimRefs::of_triangles(count, corners)?, quality, count, corners)))?
    }

    pub(crate) fn over(refs: PrimRefs<'_>, quality: Quality, count: usize, corners: &Corners) -> Self {
        let (bvh, leaves) = Bvh::over_blocks(refs, quality);
        let mut blocks = in_large_pages(leaves.len());
        (0..leaves.len())
            .into_par_iter()
            .map(|index| Triangle4::new(leaves.block(index).iter().map(|&id| (id, corners(id)))))
            .collect_into_vec(&mut blocks);
        Self { bvh, blocks, count, quality, built_cost: None, duplicates: leaves.duplicates }
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// The statistics of the tree. `bytes` includes the triangles.
    pub fn statistics(&self) -> Statistics {
        let nodes = self.bvh.statistics();
        Statistics {
            bytes: nodes.bytes + size_of_val(self.blocks.as_slice()) + size_of_val(self.duplicates.as_slice()),
            ..nodes
        }
    }

    /// Finds the nearest triangle in front of the origin and not beyond `nearest.t`. Of equally near triangles it finds
    /// the one of the lowest id. A triangle as near as `nearest.t` must also have an id below `nearest.id`. `nearest`
    /// is unchanged if there is no such triangle. With `front_only`, triangles seen from behind are ignored.
    #[inline]
    pub fn intersect(&self, ray: &PreparedRay, nearest: &mut PrimitiveHit, front_only: bool) {
        let mut search = Search::new(ray, &self.bounds(), nearest.t);
        let scene = self.scene(front_only);
        let t_max =
            self.bvh.closest(ray, nearest.t, ClosestOfRay { scene, ray, nearest: &mut *nearest, search: &mut search });
        search.resolve(scene, ray, nearest, t_max);
        if search.failed {
            self.intersect_at_once(ray, nearest, front_only);
        }
    }

    /// [`TriangleBvh::intersect`] without pending triangles: each triangle is tested exactly at its leaf.
    #[cold]
    #[inline(never)]
    fn intersect_at_once(&self, ray: &PreparedRay, nearest: &mut PrimitiveHit, front_only: bool) {
        self.bvh.intersect(ray, nearest.t, |leaf, t_max| {
            self.accept_leaf(leaf, ray, nearest, front_only);
            *t_max = nearest.t;
        });
    }

    /// [`TriangleBvh::intersect`] for many incoherent rays, several of them in flight at once.
    ///
    /// # Panics
    /// If `rays` and `nearest` differ in length.
    pub fn intersect_stream(&self, rays: &[Ray], nearest: &mut [PrimitiveHit], front_only: bool) {
        assert_eq!(rays.len(), nearest.len());
        let scene = self.scene(front_only);
        let (mut prepared, mut last_seen, mut t_max) = (Vec::new(), Vec::new(), Vec::new());
        for (rays, nearest) in rays.chunks(STREAM).zip(nearest.chunks_mut(STREAM)) {
            let bound = scene.prepare(rays, &mut prepared);
            t_max.clear();
            t_max.extend(nearest.iter().map(|nearest| nearest.t));
            last_seen.clear();
            last_seen.resize(rays.len(), PrimitiveHit::NONE);
            let of_rays = ClosestOfStream { scene, nearest, bound, last_seen: &mut last_seen };
            self.bvh.trace_stream(&prepared, &mut t_max, of_rays);
        }
    }

    /// [`TriangleBvh::intersect`] for coherent rays, where neighbours in the list have nearly one direction, as rays
    /// through neighbouring pixels have. Sixteen at a time traverse the tree together. The results are right for
    /// incoherent rays, too.
    ///
    /// # Panics
    /// If `rays` and `nearest` differ in length.
    pub fn intersect_coherent(&self, rays: &[Ray], nearest: &mut [PrimitiveHit], front_only: bool) {
        packet::coherent(&Coherent { triangles: self, front_only }, rays, nearest);
    }

    fn scene(&self, front_only: bool) -> TriangleScene<'_> {
        TriangleScene { nodes: self.bvh.nodes(), blocks: &self.blocks, bounds: self.bounds(), front_only }
    }

    /// [`TriangleBvh::occluded_stream`] for coherent rays.
    ///
    /// # Panics
    /// If `rays` and `t_max` differ in length.
    pub fn occluded_coherent(&self, rays: &[Ray], t_max: &mut [f32], front_only: bool) {
        packet::coherent(&Coherent { triangles: self, front_only }, rays, t_max);
    }

    /// The place of a triangle that is hit at or before `t_max` and for which `counts` returns true. `counts` is called
    /// with the triangle's id and with the ids of triangles with equal corners; one true is enough. It may be called
    /// more than once for an id. [`TriangleBvh::is_hit_at`] takes such a place.
    #[inline]
    pub fn occluded(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        front_only: bool,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        let mut place = None;
        let counts = &mut |id| counts(id) || duplicates::of(&self.duplicates, id).any(&mut *counts);
        let (scene, bound) = (self.scene(front_only), EdgeError::new(ray, &self.bounds()));
        self.bvh.any(ray, t_max, AnyHitOfRay { scene, ray, bound, t_max, counts, place: &mut place });
        place
    }

    /// Sets `t_max` to −∞ for each of many rays that hits a triangle at or before its `t_max`. The rays may be
    /// incoherent.
    ///
    /// # Panics
    /// If `rays` and `t_max` differ in length.
    pub fn occluded_stream(&self, rays: &[Ray], t_max: &mut [f32], front_only: bool) {
        assert_eq!(rays.len(), t_max.len());
        let scene = self.scene(front_only);
        let mut prepared = Vec::new();
        for (rays, t_max) in rays.chunks(STREAM).zip(t_max.chunks_mut(STREAM)) {
            let bound = scene.prepare(rays, &mut prepared);
            self.bvh.trace_stream(&prepared, t_max, AnyHitOfStream { scene, bound });
        }
    }

    /// Whether the triangle at this place is hit at or before `t_max`.
    #[inline]
    pub fn is_hit_at(&self, place: u32, ray: &PreparedRay, t_max: f32, front_only: bool) -> bool {
        let triangle = self.blocks[(place >> 2) as usize].triangle((place & 3) as usize);
        triangle::intersect(ray, &triangle, t_max).is_some_and(|hit| hit.front || !front_only)
    }

    /// Calls `f` with the ids of all triangles whose boxes overlap `bounds`, and of some whose boxes are near it. Of
    /// duplicates only the lowest id is passed. It ends when `f` returns false.
    pub fn overlapping(&self, bounds: &Aabb, mut f: impl FnMut(u32) -> bool) {
        self.bvh.overlapping(bounds, |leaf| {
            let block = &self.blocks[leaf.first() as usize];
            (0..leaf.count() as usize).all(|lane| f(block.id(lane)))
        });
    }

    /// The quality that the tree was built with.
    pub fn quality(&self) -> Quality {
        self.quality
    }

    /// Pairs of triangles with equal corners, the second of which is in no block.
    pub(crate) fn duplicates(&self) -> &[[u32; 2]] {
        &self.duplicates
    }

    pub(crate) fn bvh_and_blocks(&mut self) -> (&mut Bvh, &mut Vec<Triangle4>) {
        (&mut self.bvh, &mut self.blocks)
    }

    /// The SAH cost ([`Statistics::sah_cost`]) of the tree as it was built.
    pub(crate) fn built_cost(&mut self) -> &mut Option<f64> {
        &mut self.built_cost
    }

    pub(crate) fn nodes(&self) -> &[Node] {
        self.bvh.nodes()
    }

    #[cfg(test)]
    pub(crate) fn block_lengths(&self) -> impl Iterator<Item = usize> {
        self.blocks.iter().map(Triangle4::len)
    }

    /// Tests a leaf's triangles exactly and stores the nearest in `nearest`, if it is nearer.
    pub(crate) fn accept_leaf(&self, leaf: Leaf, ray: &PreparedRay, nearest: &mut PrimitiveHit, front_only: bool) {
        for lane in 0..leaf.count() as usize {
            self.blocks[leaf.first() as usize].accept_if_nearer(lane, ray, nearest, front_only);
        }
    }

    /// [`TriangleBvh::intersect`] by a loop over all triangles.
    pub fn intersect_brute_force(&self, ray: &PreparedRay, nearest: &mut PrimitiveHit, front_only: bool) {
        for block in &self.blocks {
            for lane in 0..block.len() {
                block.accept_if_nearer(lane, ray, nearest, front_only);
            }
        }
    }
}

/// A query for coherent rays.
struct Coherent<'a> {
    triangles: &'a TriangleBvh,
    front_only: bool,
}

/// The closest-hit query.
impl PacketQuery<PrimitiveHit> for Coherent<'_> {
    const RETRY: bool = true;

    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], nearest: &mut [PrimitiveHit]) -> u64 {
        let outcome = packet::closest(self.triangles.scene(self.front_only), packet, rays, nearest);
        let mut retry = outcome.retry;
        while retry != 0 {
            let i = retry.trailing_zeros() as usize;
            retry &= retry - 1;
            self.triangles.intersect_at_once(&rays[i].prepare(), &mut nearest[i], self.front_only);
        }
        outcome.diverged
    }

    fn trace_diverged(&self, rays: &[Ray], nearest: &mut [PrimitiveHit]) {
        self.triangles.intersect_stream(rays, nearest, self.front_only);
    }
}

/// The any-hit query. A hit sets `t_max` to −∞.
impl PacketQuery<f32> for Coherent<'_> {
    const RETRY: bool = true;

    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], t_max: &mut [f32]) -> u64 {
        packet::any(self.triangles.scene(self.front_only), packet, rays, t_max).diverged
    }

    fn trace_diverged(&self, rays: &[Ray], t_max: &mut [f32]) {
        self.triangles.occluded_stream(rays, t_max, self.front_only);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::InstructionSet;
    use crate::testing::{Random, TestPrimitive, awkward_ray, nearest, zoo};
    use crate::traverse::packet::RAYS;

    /// The triangles of each scene that has some, with trees of each quality.
    fn triangles_of_the_zoo() -> impl Iterator<Item = (&'static str, Vec<TestPrimitive>, TriangleBvh)> {
        let scenes = zoo()
            .into_iter()
            .flat_map(|(name, scene)| [(Quality::Medium, name, scene.clone()), (Quality::High, name, scene)]);
        scenes.filter_map(|(quality, name, mut scene)| {
            scene.retain(|p| matches!(p, TestPrimitive::Triangle(_)));
            let corners = |id: u32| match scene[id as usize] {
                TestPrimitive::Triangle(corners) => corners,
                TestPrimitive::Sphere(..) => unreachable!(),
            };
            let triangles = TriangleBvh::build_with(quality, scene.len(), corners).unwrap();
            (!scene.is_empty()).then_some((name, scene, triangles))
        })
    }

    #[test]
    fn blocks_find_what_a_loop_over_single_triangles_finds() {
        let random = &mut Random(31);
        for (name, scene, triangles) in triangles_of_the_zoo() {
            let ids: Vec<u32> = (0..scene.len() as u32).collect();
            let rays: Vec<Ray> = (0..300).map(|_| awkward_ray(&scene, random)).collect();
            let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
            for set in InstructionSet::available() {
                set.limit();
                let mut stream = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                triangles.intersect_stream(&rays, &mut stream, false);
                let mut any = vec![f32::INFINITY; rays.len()];
                triangles.occluded_stream(&rays, &mut any, false);
                for (any, stream) in any.iter().zip(&stream) {
                    assert_eq!(*any == f32::NEG_INFINITY, stream.id != PrimitiveHit::NONE);
                }
                for ((ray, prepared), stream) in rays.iter().zip(&prepared).zip(stream) {
                    let expected = nearest(&scene, &ids, ray, f32::INFINITY).map_or(
                        PrimitiveHit::none(f32::INFINITY),
                        |(t, u, v, id)| PrimitiveHit { t, id, part: 0, uv: [u, v] },
                    );
                    assert_eq!(stream, expected, "{name} {set:?} {ray:?}");
                    // An end at the hit itself, and one just before it.
                    for t_max in [f32::INFINITY, expected.t, expected.t.next_down()] {
                        let expected = if expected.t <= t_max { expected } else { PrimitiveHit::none(t_max) };
                        let mut found = PrimitiveHit::none(t_max);
                        triangles.intersect(prepared, &mut found, false);
                        assert_eq!(found, expected, "{name} {set:?} {ray:?}");
                        let place = triangles.occluded(prepared, t_max, false, &mut |_| true);
                        assert_eq!(place.is_some(), expected.id != PrimitiveHit::NONE, "{name} {set:?} {ray:?}");
                        assert!(place.is_none_or(|place| triangles.is_hit_at(place, prepared, t_max, false)));
                    }
                }
            }
        }
    }

    #[test]
    fn rays_without_a_finite_origin_leave_others_of_their_stream_alone() {
        let random = &mut Random(48);
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e30];
        for (name, scene, triangles) in triangles_of_the_zoo() {
            let mut rays: Vec<Ray> = (0..40).map(|_| awkward_ray(&scene, random)).collect();
            for (i, x) in strange.into_iter().enumerate() {
                let mut ray = rays[7 * i];
                ray.origin[i % 3] = x;
                rays.insert(7 * i, ray);
            }
            let mut expected = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
            for (ray, nearest) in rays.iter().zip(&mut expected) {
                triangles.intersect_brute_force(&ray.prepare(), nearest, false);
            }
            for set in InstructionSet::available() {
                set.limit();
                // Each strange ray alone among the others, too, since one may hide the effect of another.
                for n in 0..=strange.len() {
                    let counts = |i: &usize| n == strange.len() || !i.is_multiple_of(7) || *i > 28 || i / 7 == n;
                    let which: Vec<usize> = (0..rays.len()).filter(counts).collect();
                    let some: Vec<Ray> = which.iter().map(|&i| rays[i]).collect();
                    let mut found = vec![PrimitiveHit::none(f32::INFINITY); some.len()];
                    triangles.intersect_stream(&some, &mut found, false);
                    let mut any = vec![f32::INFINITY; some.len()];
                    triangles.occluded_stream(&some, &mut any, false);
                    for ((&i, found), any) in which.iter().zip(found).zip(any) {
                        assert_eq!(found, expected[i], "{name} {set:?} {:?}", rays[i]);
                        assert_eq!(
                            any == f32::NEG_INFINITY,
                            found.id != PrimitiveHit::NONE,
                            "{name} {set:?} {:?}",
                            rays[i]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn packets_find_what_single_rays_find() {
        let random = &mut Random(33);
        for (name, scene, triangles) in triangles_of_the_zoo() {
            let mut trace_packet = 0;
            for n in 0..60 {
                // A ray and up to a hundred that hardly differ from it. If it passes through a corner or an edge, so do
                // some of them.
                let first = awkward_ray(&scene, random);
                let size = first.direction.abs().max_element();
                let rays: Vec<Ray> = (0..[1 + n % 16, n + 40][n % 2])
                    .map(|i| {
                        let turned = random.vector() * size * [0.0, 1e-6, 0.01, 0.1][random.below(4)];
                        let moved = turned * [0.0, 1.0][i % 2];
                        Ray::new(first.origin + moved, first.direction + turned - moved * 0.5)
                    })
                    .collect();
                let mut found = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                let outcome = packet::closest(
                    triangles.scene(false),
                    &mut Packet::new(),
                    &rays[..rays.len().min(RAYS)],
                    &mut found,
                );
                trace_packet += usize::from(outcome.diverged == 0);
                for front_only in [false, true] {
                    let mut expected = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                    for (ray, nearest) in rays.iter().zip(&mut expected) {
                        triangles.intersect_brute_force(&ray.prepare(), nearest, front_only);
                    }
                    for set in InstructionSet::available() {
                        set.limit();
                        let mut found = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                        triangles.intersect_coherent(&rays, &mut found, front_only);
                        assert_eq!(found, expected, "{name} {set:?} {rays:?}");
                        for limit in [f32::INFINITY, 0.5] {
                            let mut t_max: Vec<f32> = expected.iter().map(|e| e.t.min(limit)).collect();
                            triangles.occluded_coherent(&rays, &mut t_max, front_only);
                            for (t_max, e) in t_max.iter().zip(&expected) {
                                let hit = e.id != PrimitiveHit::NONE && e.t <= limit;
                                assert_eq!(*t_max == f32::NEG_INFINITY, hit, "{name} {set:?} {rays:?}");
                            }
                        }
                    }
                }
            }
            assert!(trace_packet > 5, "{name}: {trace_packet}");
        }
    }

    #[test]
    fn many_shadow_rays_together_find_what_single_ones_find() {
        let random = &mut Random(45);
        for (name, scene, triangles) in triangles_of_the_zoo() {
            let first = awkward_ray(&scene, random);
            let size = first.direction.abs().max_element();
            // More than two packets.
            let rays: Vec<Ray> = (0..2 * RAYS + 21)
                .map(|_| Ray::new(first.origin, first.direction + random.vector() * size * 0.02))
                .collect();
            let mut t_max = vec![2.0; rays.len()];
            triangles.occluded_coherent(&rays, &mut t_max, false);
            for (ray, t_max) in rays.iter().zip(t_max) {
                let single = triangles.occluded(&ray.prepare(), 2.0, false, &mut |_| true).is_some();
                assert_eq!(t_max == f32::NEG_INFINITY, single, "{name} {ray:?}");
            }
        }
    }

    #[test]
    fn of_triangles_with_the_same_corners_the_first_is_tested_and_all_are_asked() {
        let random = &mut Random(46);
        let one = [Vec3::ZERO, Vec3::X, Vec3::Y];
        // Other triangles among them, some with an equal box.
        let others: Vec<[Vec3; 3]> = (0..300).map(|_| [0; 3].map(|_| random.vector() + 10.0)).collect();
        let corners = |id: u32| match id % 50 {
            7 => others[id as usize / 50],
            11 => [Vec3::ZERO, Vec3::X, Vec3::new(0.25, 1.0, 0.0)],
            _ => one,
        };
        for quality in [Quality::Medium, Quality::High] {
            let triangles = TriangleBvh::build_with(quality, 15_000, corners).unwrap();
            assert_eq!(triangles.len(), 15_000);
            assert!(triangles.block_lengths().sum::<usize>() < 2000 && triangles.duplicates().len() > 14_600);
            let ray = Ray::new(Vec3::new(0.25, 0.25, 1e-3), -Vec3::Z).prepare();
            let mut found = PrimitiveHit::none(f32::INFINITY);
            triangles.intersect(&ray, &mut found, false);
            assert_eq!((found.t, found.id), (1e-3, 0));
            let mut asked = Vec::new();
            triangles.occluded(&ray, 1e-3, false, &mut |id| {
                asked.push(id);
                false
            });
            asked.sort_unstable();
            let expected: Vec<u32> = (0..15_000).filter(|&id| id % 50 != 7).collect();
            assert_eq!(asked, expected);
            assert!(triangles.occluded(&ray, 1e-3, false, &mut |id| id == 14_999).is_some());
            // When the corners become different, all triangles can be hit.
            let mut parted = triangles.clone();
            parted.refit(|id| if id % 50 == 7 { corners(id) } else { one.map(|p| p - Vec3::Z * id as f32) }).unwrap();
            for id in [0, 1234, 14_999] {
                let mut found = PrimitiveHit::none(f32::INFINITY);
                let ray = Ray::new(Vec3::new(0.25, 0.25, 0.5 - id as f32), -Vec3::Z).prepare();
                parted.intersect(&ray, &mut found, false);
                assert_eq!((found.t, found.id), (0.5, id));
            }
        }
    }

    #[test]
    fn what_a_ray_passes_at_a_distance_is_not_met_however_small_it_is() {
        let random = &mut Random(47);
        for i in 0..2000 {
            // The triangles' size is a few units in the last place.
            let size = f32::EPSILON * [0.5, 2.0, 8.0, 64.0][i % 4];
            let corners = [0; 4].map(|_| {
                let far = random.vector() + 2.0 * Vec3::Z;
                [0; 3].map(|_| far + random.vector() * size)
            });
            let triangles = TriangleBvh::build(4, |id| corners[id as usize]).unwrap();
            let rays = [0; RAYS].map(|_| Ray::new(random.vector() * 0.1, random.vector() * 0.5 + 2.0 * Vec3::Z));
            for trace_packet in [false, true] {
                let mut t_max = [f32::INFINITY; RAYS];
                if trace_packet {
                    triangles.occluded_coherent(&rays, &mut t_max, false);
                } else {
                    triangles.occluded_stream(&rays, &mut t_max, false);
                }
                for (ray, t_max) in rays.iter().zip(t_max) {
                    let mut found = PrimitiveHit::none(f32::INFINITY);
                    triangles.intersect_brute_force(&ray.prepare(), &mut found, false);
                    assert_eq!(t_max == f32::NEG_INFINITY, found.id != PrimitiveHit::NONE, "{ray:?} {corners:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_seen_from_behind_can_be_left_out() {
        let corners = [[Vec3::ZERO, Vec3::X, Vec3::Y], [-Vec3::Z, -Vec3::Z + Vec3::Y, -Vec3::Z + Vec3::X]];
        let triangles = TriangleBvh::build(2, |id| corners[id as usize]).unwrap();
        for (z, way, expected) in [(1.0, -1.0, [0, 0]), (-2.0, 1.0, [1, 1]), (-0.5, 1.0, [0, PrimitiveHit::NONE])] {
            let ray = Ray::new(Vec3::new(0.25, 0.25, z), Vec3::Z * way).prepare();
            for (front_only, expected) in [false, true].into_iter().zip(expected) {
                let mut found = PrimitiveHit::none(f32::INFINITY);
                triangles.intersect(&ray, &mut found, front_only);
                assert_eq!(found.id, expected);
                let place = triangles.occluded(&ray, f32::INFINITY, front_only, &mut |_| true);
                assert_eq!(place.is_some(), expected != PrimitiveHit::NONE);
            }
        }
    }

    #[test]
    fn a_corner_that_is_not_a_number_is_named() {
        let error = TriangleBvh::build(3, |id| [Vec3::ZERO, Vec3::X, if id == 1 { Vec3::NAN } else { Vec3::Y }]);
        assert!(matches!(error, Err(BuildError::InvalidBox { index: 1, .. })));
    }
}
