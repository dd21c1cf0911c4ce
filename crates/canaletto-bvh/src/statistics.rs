//! Statistics of a tree.

use crate::Aabb;
use crate::node::{Child, Node};
use crate::slab::WIDTH;

/// The size and the expected cost of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// The number of inner nodes.
    pub inner_nodes: usize,
    /// The number of leaves.
    pub leaves: usize,
    /// The largest number of inner nodes on a path from the root to a leaf.
    pub depth: usize,
    /// The SAH cost: the expected number of inner nodes and primitives that a random ray visits if it enters the tree's
    /// box.
    pub sah_cost: f64,
    /// The bytes of the nodes and of the order.
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
                // In a tree without area, every ray that enters the root enters all boxes.
                let chance = if total > 0.0 { bounds.half_area() / total } else { 1.0 };
                match node.children[lane].decode() {
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
