//! The nodes of the tree that rays walk: four children each, their boxes side by side for one SIMD test.

use glam::Vec4;

use crate::Aabb;
use crate::build::Binary;
use crate::slab::Boxes;

/// Four children. 128 bytes, two cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) boxes: Boxes,
    /// The child's first slot if it is a leaf, its node if not.
    pub(crate) first: [u32; 4],
    /// Primitives in the leaf, 0 where there is no child, or [`INNER`].
    pub(crate) count: [u32; 4],
}

/// The count of a child that is a node.
pub(crate) const INNER: u32 = u32::MAX;

impl Node {
    const EMPTY: Self = Self { boxes: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], first: [0; 4], count: [0; 4] };

    fn set_box(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.boxes[0][axis][lane] = bounds.min[axis];
            self.boxes[1][axis][lane] = bounds.max[axis];
        }
    }

    fn get_box(&self, lane: usize) -> Aabb {
        let corner = |planes: &[Vec4; 3]| planes.map(|p| p[lane]).into();
        Aabb { min: corner(&self.boxes[0]), max: corner(&self.boxes[1]) }
    }
}

/// Collapses a binary tree: each node adopts the children of its largest inner child until it has four (Wald,
/// Benthin and Boulos, "Getting rid of packets", 2008). Depth-first order.
pub(crate) fn collapse(binary: &[Binary]) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(binary.len() / 4 + 1);
    if !binary.is_empty() {
        adopt(binary, 0, &mut nodes);
    }
    nodes
}

fn adopt(binary: &[Binary], root: u32, nodes: &mut Vec<Node>) {
    let mut children = [root; 4];
    let mut len = 1;
    while len < 4 {
        let largest = (0..len)
            .filter(|&i| !binary[children[i] as usize].is_leaf())
            .map(|i| (i, binary[children[i] as usize].bounds.half_area()))
            .reduce(|best, next| if next.1 > best.1 { next } else { best });
        let Some((i, _)) = largest else { break };
        let [left, right] = binary[children[i] as usize].children(children[i]);
        children.copy_within(i + 1..len, i + 2);
        children[i] = left;
        children[i + 1] = right;
        len += 1;
    }
    let index = nodes.len();
    nodes.push(Node::EMPTY);
    for (lane, &child) in children[..len].iter().enumerate() {
        let node = &binary[child as usize];
        nodes[index].set_box(lane, &node.bounds);
        if node.is_leaf() {
            nodes[index].first[lane] = node.link;
            nodes[index].count[lane] = node.count;
        } else {
            nodes[index].first[lane] = nodes.len() as u32;
            nodes[index].count[lane] = INNER;
            adopt(binary, child, nodes);
        }
    }
}

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
    pub(crate) fn of(nodes: &[Node], root: &Aabb, primitives: usize) -> Self {
        let mut s = Self { inner_nodes: nodes.len(), ..Self::default() };
        s.bytes = size_of_val(nodes) + primitives * size_of::<u32>();
        if nodes.is_empty() {
            return s;
        }
        let total = root.half_area();
        let mut todo = vec![(0u32, 1.0, 1)];
        while let Some((node, chance, depth)) = todo.pop() {
            s.sah_cost += chance;
            s.depth = s.depth.max(depth);
            let node = &nodes[node as usize];
            for lane in 0..4 {
                // Without area every ray that meets the root meets all.
                let chance = if total > 0.0 { node.get_box(lane).half_area() / total } else { 1.0 };
                match node.count[lane] {
                    0 => {}
                    INNER => todo.push((node.first[lane], chance, depth + 1)),
                    count => {
                        s.leaves += 1;
                        s.sah_cost += chance * f64::from(count);
                    }
                }
            }
        }
        s
    }
}
