//! Refitting, for trees over triangles that move: boxes and orders are recomputed, which takes a fraction of a build.
//! Traversal becomes slower as neighbours move apart.

use std::cmp::Ordering;

use canaletto_parallel::prelude::*;
use glam::Vec3;

use crate::build::{Corners, PrimRefs, STACK};
use crate::memory::collected;
use crate::primitive::triangle4::Triangle4;
use crate::{Aabb, BuildError, TriangleBvh, with_stack};

fn bounds(block: &Triangle4) -> Aabb {
    (0..block.len()).fold(Aabb::EMPTY, |bounds, lane| bounds.union(block.triangle(lane).bounds()))
}

fn same_bits(a: [Vec3; 3], b: [Vec3; 3]) -> bool {
    a.map(|p| p.to_array().map(f32::to_bits)) == b.map(|p| p.to_array().map(f32::to_bits))
}

impl TriangleBvh {
    /// Moves the triangles to new corners, in parallel. The tree's structure stays, only its boxes change. Query
    /// results are those of a newly built tree. If triangles that had equal corners now differ, the tree is rebuilt. A
    /// triangle that was split (see [`crate::Quality`]) has from now on its whole box in each of its leaves.
    ///
    /// # Errors
    /// [`BuildError`] names the first triangle with a corner that is not finite. The tree is then unchanged.
    pub fn refit(&mut self, corners: impl Fn(u32) -> [Vec3; 3] + Sync) -> Result<(), BuildError> {
        self.refit_within(f64::INFINITY, corners).map(|_| ())
    }

    /// [`TriangleBvh::refit`] if that leaves a good tree, otherwise a rebuild. The tree is rebuilt if its SAH cost
    /// ([`crate::Statistics::sah_cost`]) would be more than `max_cost_ratio` times its cost after the last build.
    /// Returns whether it was rebuilt. The decision depends only on the present and earlier positions of the triangles.
    /// A rebuild splits no triangle, so that the tree can be refitted again.
    ///
    /// # Errors
    /// As [`TriangleBvh::refit`].
    pub fn refit_within(
        &mut self,
        max_cost_ratio: f64,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    ) -> Result<bool, BuildError> {
        self.refit_or_rebuild(max_cost_ratio, &corners)
    }

    fn refit_or_rebuild(&mut self, max_cost_ratio: f64, corners: &Corners) -> Result<bool, BuildError> {
        with_stack(STACK, || self.refit_here(max_cost_ratio, corners))?
    }

    fn refit_here(&mut self, max_cost_ratio: f64, corners: &Corners) -> Result<bool, BuildError> {
        // `corners` is called once for each triangle, so that the stored corners are those that were checked.
        let all: Vec<[Vec3; 3]> = collected(self.len(), 0, |id| corners(id as u32));
        if let Some(index) = all.par_iter().position_first(|corners| !corners.iter().all(|corner| corner.is_finite())) {
            return Err(BuildError::InvalidBox { index, bounds: Aabb::from_points(all[index]) });
        }
        let corners = &|id: u32| all[id as usize];
        if self.duplicates().iter().any(|&[original, copy]| !same_bits(corners(original), corners(copy))) {
            return self.rebuild(corners);
        }
        let cost = self.built_cost().unwrap_or_else(|| self.statistics().sah_cost);
        *self.built_cost() = Some(cost);
        let (bvh, blocks) = self.bvh_and_blocks();
        blocks.par_iter_mut().for_each(|block| *block = block.with(corners));
        let blocks = &*blocks;
        bvh.refit(&|first| bounds(&blocks[first as usize]));
        // A NaN cost counts as worse.
        let worse = || self.statistics().sah_cost.partial_cmp(&(cost * max_cost_ratio)).is_none_or(Ordering::is_gt);
        if max_cost_ratio < f64::INFINITY && worse() {
            return self.rebuild(corners);
        }
        Ok(false)
    }

    /// Rebuilds the tree from finite corners. The old blocks are freed first.
    fn rebuild(&mut self, corners: &Corners) -> Result<bool, BuildError> {
        let refs = PrimRefs::of_whole_triangles(self.len(), corners)?;
        *self.bvh_and_blocks().1 = Vec::new();
        *self = Self::over(refs, self.quality(), self.len(), corners);
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, TestPrimitive, awkward_ray, nearest, zoo};
    use crate::{InstructionSet, PrimitiveHit, Quality};
    use glam::Vec3Swizzles;

    fn moved(scene: &[TestPrimitive], random: &mut Random) -> Vec<TestPrimitive> {
        // Some triangles collapse to points, some fly away, and signs of zero change.
        let place = |p: Vec3, r: &mut Random| match r.below(5) {
            0 => -p,
            1 => p.zxy() * 2.0,
            2 => p * 0.0,
            _ => p + 0.3 * p.length().min(1e30) * r.vector(),
        };
        let triangle = |p: &TestPrimitive, r: &mut Random| match *p {
            TestPrimitive::Triangle(corners) => TestPrimitive::Triangle(corners.map(|corner| place(corner, r))),
            sphere => sphere,
        };
        scene.iter().map(|p| triangle(p, random)).collect()
    }

    #[test]
    fn moved_triangles_are_found_where_they_are() {
        let random = &mut Random(51);
        for (name, mut scene) in zoo() {
            scene.retain(|p| matches!(p, TestPrimitive::Triangle(_)));
            for quality in [Quality::Medium, Quality::High].into_iter().filter(|_| !scene.is_empty()) {
                let corners = |scene: &[TestPrimitive], id: u32| match scene[id as usize] {
                    TestPrimitive::Triangle(corners) => corners,
                    TestPrimitive::Sphere(..) => unreachable!(),
                };
                let original = TriangleBvh::build_with(quality, scene.len(), |id| corners(&scene, id)).unwrap();
                let mut triangles = original.clone();
                let scene_moved = moved(&scene, random);
                triangles.refit(|id| corners(&scene_moved, id)).unwrap();
                let ids: Vec<u32> = (0..scene.len() as u32).collect();
                for set in InstructionSet::available() {
                    set.limit();
                    for _ in 0..100 {
                        let ray = awkward_ray(&scene_moved, random);
                        let expected = nearest(&scene_moved, &ids, &ray, f32::INFINITY).map_or(
                            PrimitiveHit::none(f32::INFINITY),
                            |(t, u, v, id)| PrimitiveHit { t, id, part: 0, uv: [u, v] },
                        );
                        let mut found = PrimitiveHit::none(f32::INFINITY);
                        triangles.intersect(&ray.prepare(), &mut found, false);
                        assert_eq!(found, expected, "{name} {set:?} {ray:?}");
                    }
                }
                // The triangles move back.
                triangles.refit(|id| corners(&scene, id)).unwrap();
                assert_eq!(triangles.bounds(), original.bounds());
                // Except if triangles had been split, or the tree was rebuilt.
                let leaves: usize = original.block_lengths().sum();
                assert!(triangles.nodes() == original.nodes() || leaves != scene.len(), "{name}");
            }
        }
    }

    #[test]
    fn a_tree_is_built_anew_before_it_gets_too_bad() {
        // A strip that is rotated out of the plane that it was built in, a little more each time, and shuffled in the
        // end.
        let at = |n: u32, turn: f32| Vec3::new(n as f32, (n % 2) as f32, 0.0).rotate_z(turn);
        let strip = |turn: f32| move |id: u32| [at(id, turn), at(id + 1, turn), at(id + 2, turn)];
        let mut triangles = TriangleBvh::build(3000, strip(0.0)).unwrap();
        let mut built = triangles.statistics().sah_cost;
        let (mut anew, mut kept) = (0, 0);
        for step in 1..40 {
            let turn = step as f32 * 0.01;
            if triangles.refit_within(1.5, strip(turn)).unwrap() {
                anew += 1;
                built = triangles.statistics().sah_cost;
                assert!(triangles.nodes() == TriangleBvh::build(3000, strip(turn)).unwrap().nodes());
            } else {
                kept += 1;
                let cost = triangles.statistics().sah_cost;
                assert!(cost <= built * 1.5, "{step}: {cost} {built}");
            }
        }
        // The triangles of the strip, each in the place of another.
        let shuffled = |id: u32| strip(0.0)(id * 7919 % 3000);
        let mut forever = triangles.clone();
        assert!(!forever.refit_within(f64::INFINITY, shuffled).unwrap());
        assert!(triangles.refit_within(1.5, shuffled).unwrap());
        assert!(forever.statistics().sah_cost > triangles.statistics().sah_cost * 1.5);
        assert!(kept > 10, "{kept} kept, {anew} built anew");
    }

    #[test]
    fn split_triangles_that_move_are_whole_from_then_on() {
        let random = &mut Random(52);
        let mut scene = crate::testing::closed_mesh(random);
        let low = scene.as_flattened().iter().fold(Vec3::INFINITY, |low, p| low.min(*p)).y;
        let ground = [[-9.0, -9.0], [-9.0, 9.0], [9.0, 9.0], [9.0, -9.0]].map(|[x, z]| Vec3::new(x, low - 0.01 * x, z));
        scene.extend([[ground[0], ground[1], ground[2]], [ground[0], ground[2], ground[3]]]);
        let count = scene.len();
        for quality in [Quality::Medium, Quality::High] {
            let mut triangles = TriangleBvh::build_with(quality, count, |id| scene[id as usize]).unwrap();
            assert!(triangles.block_lengths().sum::<usize>() > count);
            let anew: Vec<bool> = (1..9)
                .map(|step| {
                    let turned = |id: u32| scene[id as usize].map(|p| p.rotate_y(0.003 * step as f32));
                    triangles.refit_within(1.2, turned).unwrap()
                })
                .collect();
            assert_eq!(anew, [true, false, false, false, false, false, false, false]);
            assert_eq!(triangles.block_lengths().sum::<usize>(), count);
        }
    }

    #[test]
    fn a_corner_that_is_not_a_number_changes_nothing() {
        let mut triangles = TriangleBvh::build(9, |id| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + id as f32)).unwrap();
        let before = triangles.clone();
        let error = triangles.refit(|id| [Vec3::ONE, Vec3::X, if id > 4 { Vec3::NAN } else { Vec3::Y }]);
        assert!(matches!(error, Err(BuildError::InvalidBox { index: 5, .. })));
        assert!(triangles.nodes() == before.nodes() && triangles.bounds() == before.bounds());
    }

    /// The function returns something else when it is called again for a triangle.
    #[test]
    fn each_triangle_is_asked_about_once() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let random = &mut Random(53);
        let scene: Vec<[Vec3; 3]> = (0..500).map(|i| [0; 3].map(|_| random.vector() + (i / 2) as f32)).collect();
        let scene = |id: u32| scene[if id < 100 { id / 2 * 2 } else { id } as usize];
        for max_cost_ratio in [f64::INFINITY, 0.5] {
            let mut triangles = TriangleBvh::build(500, scene).unwrap();
            let asked: Vec<AtomicU32> = (0..500).map(|_| AtomicU32::new(0)).collect();
            let corners = |id: u32| match asked[id as usize].fetch_add(1, Ordering::Relaxed) {
                0 => scene(id).map(|p| p * 2.0),
                _ => [Vec3::NAN; 3],
            };
            triangles.refit_within(max_cost_ratio, corners).unwrap();
            assert!(asked.into_iter().all(|asked| asked.into_inner() == 1));
            let expected = TriangleBvh::build(500, |id| scene(id).map(|p| p * 2.0)).unwrap();
            assert_eq!(triangles.bounds(), expected.bounds());
            for _ in 0..300 {
                let ray = crate::Ray::new(random.vector() * 9.0, random.vector());
                let [mut a, mut b] = [PrimitiveHit::none(f32::INFINITY); 2];
                triangles.intersect(&ray.prepare(), &mut a, false);
                expected.intersect(&ray.prepare(), &mut b, false);
                assert_eq!(a, b);
            }
        }
    }

    #[test]
    fn no_triangles_stay_none() {
        let mut triangles = TriangleBvh::build(0, |_| unreachable!()).unwrap();
        triangles.refit(|_| unreachable!()).unwrap();
        assert!(triangles.bounds().is_empty());
    }
}
