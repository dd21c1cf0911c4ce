//! Trees over triangles that move but stay the same ones: boxes and orders are computed anew, which takes a fraction of a build. Rays
//! slow down as far as neighbours part.

use glam::Vec3;
use rayon::prelude::*;

use crate::block::Block;
use crate::node::{Link, Node};
use crate::slab::WIDTH;
use crate::{Aabb, BuildError, Triangles};

fn bounds(block: &Block) -> Aabb {
    (0..block.len()).fold(Aabb::EMPTY, |bounds, lane| bounds.union(block.triangle(lane).bounds()))
}

fn same(a: [Vec3; 3], b: [Vec3; 3]) -> bool {
    a.map(|p| p.to_array().map(f32::to_bits)) == b.map(|p| p.to_array().map(f32::to_bits))
}

impl Triangles {
    /// Takes the triangles to where `corners` tells, in parallel; the tree stays what it is but for its boxes. Answers are those of a
    /// tree built anew, which it is if triangles part that had the same corners. A triangle that was split (see [`crate::Quality::High`]) has from now on its whole box in each of its leaves.
    ///
    /// # Errors
    /// [`BuildError`] names the first triangle with a corner that is not finite; then nothing has changed.
    pub fn refit(&mut self, corners: impl Fn(u32) -> [Vec3; 3] + Sync) -> Result<(), BuildError> {
        let bad = |&id: &u32| !corners(id).iter().all(|corner| corner.is_finite());
        if let Some(id) = (0..self.len() as u32).into_par_iter().find_first(bad) {
            return Err(BuildError::InvalidBox { index: id as usize, bounds: Aabb::from_points(corners(id)) });
        }
        if self.copies().iter().any(|&[original, copy]| !same(corners(original), corners(copy))) {
            *self = Self::build_with(self.quality(), self.len(), corners)?;
            return Ok(());
        }
        let (bvh, blocks) = self.parts();
        blocks.par_iter_mut().for_each(|block| *block = block.with(&corners));
        let blocks = &*blocks;
        bvh.refit(|first| bounds(&blocks[first as usize]));
        Ok(())
    }
}

/// Fits boxes to the leaves, of which `leaf` tells the boxes, and returns the box around all.
pub(crate) fn refit(nodes: &mut [Node], leaf: impl Fn(u32) -> Aabb + Sync) -> Aabb {
    let is_leaf = |child: Link| child.follow().ok();
    nodes.par_iter_mut().for_each(|node| {
        for lane in 0..WIDTH {
            if let Some(leaf_of_lane) = is_leaf(node.children[lane]) {
                node.set_box(lane, &leaf(leaf_of_lane.first()));
            }
        }
    });
    // Children come later than their parents.
    for index in (0..nodes.len()).rev() {
        for lane in 0..WIDTH {
            // Links of lanes without a child, which have empty boxes, lead anywhere.
            let there = !nodes[index].get_box(lane).is_empty();
            if let (true, Err(child)) = (there, nodes[index].children[lane].follow()) {
                let bounds = nodes[child].bounds();
                nodes[index].set_box(lane, &bounds);
            }
        }
    }
    nodes.par_iter_mut().for_each(Node::sort);
    nodes.first().map_or(Aabb::EMPTY, Node::bounds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Primitive, Random, awkward_ray, nearest, zoo};
    use crate::{InstructionSet, Nearest, Quality};
    use glam::Vec3Swizzles;

    fn moved(scene: &[Primitive], random: &mut Random) -> Vec<Primitive> {
        // Some collapse to points, some fly away; signs of zero change.
        let place = |p: Vec3, r: &mut Random| match r.below(5) {
            0 => -p,
            1 => p.zxy() * 2.0,
            2 => p * 0.0,
            _ => p + 0.3 * p.length().min(1e30) * r.vector(),
        };
        let triangle = |p: &Primitive, r: &mut Random| match *p {
            Primitive::Triangle(corners) => Primitive::Triangle(corners.map(|corner| place(corner, r))),
            sphere => sphere,
        };
        scene.iter().map(|p| triangle(p, random)).collect()
    }

    #[test]
    fn moved_triangles_are_found_where_they_are() {
        let random = &mut Random(51);
        for (name, mut scene) in zoo() {
            scene.retain(|p| matches!(p, Primitive::Triangle(_)));
            for quality in [Quality::Medium, Quality::High].into_iter().filter(|_| !scene.is_empty()) {
                let corners = |scene: &[Primitive], id: u32| match scene[id as usize] {
                    Primitive::Triangle(corners) => corners,
                    Primitive::Sphere(..) => unreachable!(),
                };
                let original = Triangles::build_with(quality, scene.len(), |id| corners(&scene, id)).unwrap();
                let mut triangles = original.clone();
                let scene_moved = moved(&scene, random);
                triangles.refit(|id| corners(&scene_moved, id)).unwrap();
                let ids: Vec<u32> = (0..scene.len() as u32).collect();
                for set in InstructionSet::available() {
                    set.limit();
                    for _ in 0..100 {
                        let ray = awkward_ray(&scene_moved, random);
                        let expected = nearest(&scene_moved, &ids, &ray, f32::INFINITY)
                            .map_or(Nearest::before(f32::INFINITY), |(t, u, v, id)| Nearest { t, u, v, id });
                        let mut found = Nearest::before(f32::INFINITY);
                        triangles.intersect(&ray.prepare(), &mut found, false);
                        assert_eq!(found, expected, "{name} {set:?} {ray:?}");
                    }
                }
                // And back again.
                triangles.refit(|id| corners(&scene, id)).unwrap();
                assert_eq!(triangles.bounds(), original.bounds());
                // But for triangles that had been split, and trees that had to be built anew.
                let leaves: usize = original.block_lengths().sum();
                assert!(triangles.nodes() == original.nodes() || leaves != scene.len(), "{name}");
            }
        }
    }

    #[test]
    fn a_corner_that_is_not_a_number_changes_nothing() {
        let mut triangles = Triangles::build(9, |id| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + id as f32)).unwrap();
        let before = triangles.clone();
        let error = triangles.refit(|id| [Vec3::ONE, Vec3::X, if id > 4 { Vec3::NAN } else { Vec3::Y }]);
        assert!(matches!(error, Err(BuildError::InvalidBox { index: 5, .. })));
        assert!(triangles.nodes() == before.nodes() && triangles.bounds() == before.bounds());
    }

    #[test]
    fn no_triangles_stay_none() {
        let mut triangles = Triangles::build(0, |_| unreachable!()).unwrap();
        triangles.refit(|_| unreachable!()).unwrap();
        assert!(triangles.bounds().is_empty());
    }
}
