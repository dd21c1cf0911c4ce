//! Counting what rays visit: how good a tree is, whatever a machine makes of it.

use crate::node::Link;
use crate::slab;
use crate::{Nearest, PreparedRay, Triangles};

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
        let nodes = self.nodes();
        let mut stack: Vec<(f32, Link)> = Vec::new();
        stack.extend((!nodes.is_empty()).then_some((0.0, Link::node(0))));
        while let Some((near, link)) = stack.pop() {
            let limit = slab::limit(nearest.t);
            if near > limit {
                continue;
            }
            match link.follow() {
                Ok(leaf) => {
                    visits.leaves += 1;
                    self.offer_leaf(leaf, ray, &mut nearest, false);
                }
                Err(node) => {
                    visits.nodes += 1;
                    for lane in nodes[node].order(usize::from(ray.octant)) {
                        let (near, far) = ray.clip_carefully(&nodes[node].get_box(lane), limit);
                        if near <= far {
                            stack.push((near, nodes[node].children[lane]));
                        }
                    }
                }
            }
        }
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
