//! Counts of the nodes and leaves that rays visit: a measure of a tree's quality that doesn't depend on the machine.

#![allow(unsafe_code)] // The call of an unsafe kernel.

use std::cell::Cell;

use crate::simd::{IrregularNodeTest, TraversalRay};
use crate::traverse::closest_by;
use crate::{Aabb, Leaf, PreparedRay, PrimitiveHit, TriangleBvh};

/// The numbers of nodes and leaves that one ray, or many rays together, visit on the search for the nearest triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalStats {
    /// The number of inner nodes, of eight boxes each.
    pub nodes: u64,
    /// The number of leaves, of up to four triangles each.
    pub leaves: u64,
}

impl TriangleBvh {
    /// Adds the nodes and leaves that [`TriangleBvh::intersect`] visits for a ray. It is slower than `intersect`.
    pub fn count_traversal(&self, ray: &PreparedRay, t_max: f32, visits: &mut TraversalStats) {
        let mut nearest = PrimitiveHit::none(t_max);
        let counted = Counted { ray, nodes: Cell::new(0) };
        let leaf = |leaf: Leaf, t_max: &mut f32| {
            visits.leaves += 1;
            self.accept_leaf(leaf, ray, &mut nearest, false);
            *t_max = nearest.t;
        };
        // SAFETY: `IrregularNodeTest` needs no special instructions, and these are all nodes of the tree.
        unsafe { closest_by::<_, IrregularNodeTest, _>(self.nodes(), &counted, t_max, leaf) };
        visits.nodes += counted.nodes.get();
    }
}

/// A ray and the number of nodes that it has visited.
struct Counted<'a> {
    ray: &'a PreparedRay,
    nodes: Cell<u64>,
}

impl TraversalRay for Counted<'_> {
    fn ray(&self) -> &PreparedRay {
        self.ray
    }

    fn origins(&self) -> [&[f32; 3]; 2] {
        self.ray.origins()
    }

    fn inflate(&self, bounds: Aabb) -> Aabb {
        bounds
    }

    fn visited(&self) {
        self.nodes.set(self.nodes.get() + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;
    use crate::testing::{Random, closed_mesh};
    use glam::Vec3;

    #[test]
    fn near_children_come_first_whatever_the_direction() {
        let random = &mut Random(42);
        // A stack of meshes: behind the first mesh that is hit, none needs to be visited.
        let mesh = closed_mesh(random);
        for axis in Vec3::AXES {
            let corners =
                |id: u32| mesh[id as usize % mesh.len()].map(|p| p + axis * (3 * (id as usize / mesh.len())) as f32);
            let triangles = TriangleBvh::build(8 * mesh.len(), corners).unwrap();
            let one = TriangleBvh::build(mesh.len(), corners).unwrap();
            let mut visits = [TraversalStats::default(); 3];
            for _ in 0..200 {
                let aside = 0.3 * random.vector();
                let way = axis + 0.01 * random.vector();
                let rays = [
                    (&one, Ray::new(aside - 5.0 * axis, way)),
                    (&triangles, Ray::new(aside - 5.0 * axis, way)),
                    (&triangles, Ray::new(aside + 26.0 * axis, -way)),
                ];
                for ((tree, ray), visits) in rays.into_iter().zip(&mut visits) {
                    tree.count_traversal(&ray.prepare(), f32::INFINITY, visits);
                }
            }
            let [one, ..] = visits;
            for many in &visits[1..] {
                // At most two additional nodes above the one mesh.
                assert!(many.nodes <= one.nodes + 2 * 200 && many.leaves < 2 * one.leaves, "{visits:?}");
            }
        }
    }
}
