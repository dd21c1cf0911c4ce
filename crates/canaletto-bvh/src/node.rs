//! The nodes of the tree that rays walk: four children each, their boxes side by side for one SIMD test.

use std::ops::Range;

use glam::Vec4;

use crate::Aabb;
use crate::build::{Binary, MAX_LEAF, MAX_PRIMITIVES};
use crate::slab::Boxes;

/// Four children. 128 bytes, two cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes; where there is no child, a box that no ray meets.
    pub(crate) boxes: Boxes,
    pub(crate) children: [Link; 4],
}

/// A node or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Link(u32);

impl Link {
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// Of 1 to [`MAX_LEAF`] primitives.
    fn leaf(first: u32, count: u32) -> Self {
        Self(Self::LEAF | (count - 1) << FIRST_BITS | first)
    }

    /// The slots if it is a leaf, else the node.
    #[inline]
    pub(crate) fn follow(self) -> Result<Range<u32>, usize> {
        if self.0 & Self::LEAF == 0 {
            return Err(self.0 as usize);
        }
        let first = self.0 & ((1 << FIRST_BITS) - 1);
        Ok(first..first + 1 + ((self.0 ^ Self::LEAF) >> FIRST_BITS))
    }
}

/// Bits for the first slot of a leaf.
const FIRST_BITS: u32 = 29;
const _: () = assert!(MAX_PRIMITIVES <= 1 << FIRST_BITS && MAX_LEAF <= 1 << (31 - FIRST_BITS));

impl Node {
    const EMPTY: Self = Self { boxes: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], children: [Link(0); 4] };

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
            nodes[index].children[lane] = Link::leaf(node.link, node.count);
        } else {
            nodes[index].children[lane] = Link::node(nodes.len());
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
        let mut todo = vec![(0, 1.0, 1)];
        while let Some((node, chance, depth)) = todo.pop() {
            s.sah_cost += chance;
            s.depth = s.depth.max(depth);
            let node: &Node = &nodes[node];
            for lane in 0..4 {
                let bounds = node.get_box(lane);
                if bounds.is_empty() {
                    continue;
                }
                // Without area every ray that meets the root meets all.
                let chance = if total > 0.0 { bounds.half_area() / total } else { 1.0 };
                match node.children[lane].follow() {
                    Err(node) => todo.push((node, chance, depth + 1)),
                    Ok(leaf) => {
                        s.leaves += 1;
                        s.sah_cost += chance * leaf.len() as f64;
                    }
                }
            }
        }
        s
    }
}
