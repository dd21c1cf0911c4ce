//! What a tree is like.

use crate::Aabb;
use crate::node::{Child, Node};
use crate::slab::WIDTH;

/// What a tree is like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Nodes with children.
    pub inner_nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Most inner nodes on a way from the root to a leaf.
    pub depth: usize,
    /// Inner nodes plus primitives that a random ray which meets the tree's box is expected to visit.
    pub sah_cost: f64,
    /// Memory of the nodes and of the order.
    pub bytes: usize,
}

impl Statistics {
    pub(crate) fn of(nodes: &[Node], root: &Aabb, slots: usize) -> Self {
        let mut s = Self { inner_nodes: nodes.len(), ..Self::default() };
        s.bytes = size_of_val(nodes) + slots * size_of::<u32>();
        if nodes.is_empty() {
            return s;
        }
        let total = root.half_area();
        let mut todo = vec![(0, 1.0, 1)];
        while let Some((node, chance, depth)) = todo.pop() {
            s.sah_cost += chance;
            s.depth = s.depth.max(depth);
            let node: &Node = &nodes[node];
            for lane in 0..WIDTH {
                let bounds = node.get_box(lane);
                // Without area every ray that meets the root meets all.
                let chance = if total > 0.0 { bounds.half_area() / total } else { 1.0 };
                match node.children[lane].follow() {
                    Some(Child::Node(node)) => todo.push((node, chance, depth + 1)),
                    Some(Child::Leaf(leaf)) => {
                        s.leaves += 1;
                        s.sah_cost += chance * f64::from(leaf.count());
                    }
                    None => {}
                }
            }
        }
        s
    }
}
