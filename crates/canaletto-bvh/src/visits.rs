//! Counting what rays visit: how good a tree is, whatever a machine makes of it.

#![allow(unsafe_code)] // The kernels that it counts for.

use std::cell::Cell;

use crate::lanes::{Careful, Exact, Lanes};
use crate::node::{Link, Node};
use crate::traverse::closest_by;
use crate::{Leaf, Nearest, PreparedRay, Triangles};

/// What one ray visits on its way to the nearest triangle, or what many visit together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Inner nodes, of eight boxes each.
    pub nodes: u64,
    /// Leaves, of up to four triangles each.
    pub leaves: u64,
}

impl Triangles {
    /// Adds what the ray visits until its nearest triangle is known: what [`Triangles::intersect`] does, slowly.
    pub fn count_visits(&self, ray: &PreparedRay, t_max: f32, visits: &mut Visits) {
        let mut nearest = Nearest::before(t_max);
        let counted = Counted { ray, nodes: Cell::new(0) };
        let leaf = |leaf: Leaf, t_max: &mut f32| {
            visits.leaves += 1;
            self.offer_leaf(leaf, ray, &mut nearest, false);
            *t_max = nearest.t;
        };
        // SAFETY: `Counting` needs no more than `Careful`, which needs nothing; these are all nodes of the tree.
        unsafe { closest_by::<_, Counting, _>(self.nodes(), &counted, t_max, leaf) };
        visits.nodes += counted.nodes.get();
    }
}

/// A ray, and how many nodes it has visited.
struct Counted<'a> {
    ray: &'a PreparedRay,
    nodes: Cell<u64>,
}

#[derive(Clone, Copy)]
struct Counting;

impl Exact for Counting {
    type Four = <Careful as Exact>::Four;
}

impl Lanes<Counted<'_>> for Counting {
    unsafe fn visit<const ORDERED: bool>(
        node: &Node,
        counted: &Counted<'_>,
        limit: f32,
        near: *mut f32,
        links: *mut Link,
    ) -> (usize, Link) {
        counted.nodes.set(counted.nodes.get() + 1);
        // SAFETY: the caller's promise.
        unsafe { Careful::visit::<ORDERED>(node, counted.ray, limit, near, links) }
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
        // A stack of meshes: behind the first that is met, none needs to be visited.
        let mesh = closed_mesh(random);
        for axis in Vec3::AXES {
            let corners =
                |id: u32| mesh[id as usize % mesh.len()].map(|p| p + axis * (3 * (id as usize / mesh.len())) as f32);
            let triangles = Triangles::build(8 * mesh.len(), corners).unwrap();
            let one = Triangles::build(mesh.len(), corners).unwrap();
            let mut visits = [Visits::default(); 3];
            for _ in 0..200 {
                let aside = 0.3 * random.vector();
                let way = axis + 0.01 * random.vector();
                let rays = [
                    (&one, Ray::new(aside - 5.0 * axis, way)),
                    (&triangles, Ray::new(aside - 5.0 * axis, way)),
                    (&triangles, Ray::new(aside + 26.0 * axis, -way)),
                ];
                for ((tree, ray), visits) in rays.into_iter().zip(&mut visits) {
                    tree.count_visits(&ray.prepare(), f32::INFINITY, visits);
                }
            }
            let [one, ..] = visits;
            for many in &visits[1..] {
                // At most two nodes more above the one mesh.
                assert!(many.nodes <= one.nodes + 2 * 200 && many.leaves < 2 * one.leaves, "{visits:?}");
            }
        }
    }
}
