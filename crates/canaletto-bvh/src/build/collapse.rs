//! Turns a binary tree into eight-wide nodes. Each subtree gets the lanes for which [`widen`](super::widen) found the
//! least cost.

use canaletto_parallel::prelude::*;

use super::BinaryNode;
use crate::memory::zeros;
use crate::node::MAX_DEPTH;
use crate::node::{Node, NodeRef};
use crate::slab::WIDTH;

/// Subtrees of at most so many binary nodes are collapsed separately, in parallel.
const MIN_SUBTREE: u32 = 1 << 12;

/// Makes the wide nodes of least cost from a binary tree (see `build::widen`). The upper nodes come first, then the
/// separately collapsed subtrees, each in depth-first order.
///
/// # Panics
/// If the tree would have more than [`MAX_DEPTH`] + 1 levels, for which the traversal stacks have no room. Builders
/// ensure that no tree has.
pub(crate) fn collapse(binary: &[BinaryNode]) -> Vec<Node> {
    let whole = Tree { root: 0, end: binary.len() as u32 };
    if binary.is_empty() {
        return Vec::new();
    }
    let mut upper = vec![Node::EMPTY; whole.wide_nodes(binary, MIN_SUBTREE)];
    let mut top = Collapse { binary, nodes: &mut upper, len: 0, first: 0, parts: Vec::new(), part: MIN_SUBTREE };
    top.add_node(whole, 0);
    let parts = top.parts;
    let sizes: Vec<usize> = parts.par_iter().map(|part| part.tree.wide_nodes(binary, 0)).collect();
    let mut first = upper.len();
    let mut nodes = zeros(first + sizes.iter().sum::<usize>());
    let (above, mut rest) = nodes.split_at_mut(first);
    let mut below = Vec::with_capacity(parts.len());
    for (part, size) in parts.iter().zip(sizes) {
        upper[part.parent].children[part.lane] = NodeRef::node(first);
        let (nodes, behind) = rest.split_at_mut(size);
        below.push((part, first, nodes));
        (first, rest) = (first + size, behind);
    }
    above.copy_from_slice(&upper);
    below.into_par_iter().for_each(|(part, first, nodes)| {
        Collapse { binary, nodes, len: 0, first, parts: Vec::new(), part: 0 }.add_node(part.tree, part.depth);
    });
    nodes
}

struct Collapse<'a> {
    binary: &'a [BinaryNode],
    /// The memory for all nodes of this part.
    nodes: &'a mut [Node],
    len: usize,
    /// The index of `nodes[0]` in the list of all nodes.
    first: usize,
    /// The subtrees that are left to be collapsed separately.
    parts: Vec<Part>,
    /// Subtrees of at most so many binary nodes are left.
    part: u32,
}

struct Part {
    tree: Tree,
    /// The number of wide nodes above it.
    depth: u32,
    parent: usize,
    lane: usize,
}

/// The range of a subtree in the list of binary nodes.
#[derive(Clone, Copy)]
struct Tree {
    root: u32,
    end: u32,
}

/// The subtrees that become the children of a wide node.
struct Children {
    all: [Tree; WIDTH],
    len: usize,
}

impl Tree {
    fn children(self, binary: &[BinaryNode]) -> Children {
        let mut children = Children { all: [Self { root: 0, end: 0 }; WIDTH], len: 0 };
        self.gather(binary, WIDTH, &mut children);
        children
    }

    /// Collects the subtrees that this tree puts into so many lanes.
    fn gather(self, binary: &[BinaryNode], lanes: usize, children: &mut Children) {
        let node = &binary[self.root as usize];
        match if lanes == 1 { None } else { node.left_lanes(lanes) } {
            Some(to_left) => {
                let [left, right] = node.children(self.root);
                Self { root: left, end: right }.gather(binary, to_left, children);
                Self { root: right, end: self.end }.gather(binary, lanes - to_left, children);
            }
            None => {
                children.all[children.len] = self;
                children.len += 1;
            }
        }
    }

    /// The number of wide nodes that it becomes, without subtrees of at most `part` binary nodes below the root.
    fn wide_nodes(self, binary: &[BinaryNode], part: u32) -> usize {
        let Children { all, len } = self.children(binary);
        let inner = |tree: &&Self| tree.len() > part.max(1);
        1 + all[..len].iter().filter(inner).map(|tree| tree.wide_nodes(binary, part)).sum::<usize>()
    }

    /// The number of its binary nodes.
    fn len(self) -> u32 {
        self.end - self.root
    }

    /// The priority of this subtree for any-hit rays. It is high for a box that many rays enter, for a subtree of few
    /// nodes, and for a flat box, since flat things fill their boxes. The exponents are those with which rays visited
    /// the fewest nodes of the benchmark's meshes: up to a third fewer than with the largest box first.
    fn any_hit_priority(self, binary: &[BinaryNode]) -> f64 {
        let bounds = &binary[self.root as usize].bounds;
        let extent = bounds.max.as_dvec3() - bounds.min.as_dvec3();
        let longest = extent.max_element();
        let flat = if longest > 0.0 { extent.min_element() / longest } else { 1.0 };
        bounds.half_area() / ((flat + 1e-3) * f64::from(self.len()).sqrt().sqrt())
    }
}

impl Collapse<'_> {
    fn add_node(&mut self, tree: Tree, depth: u32) {
        assert!(depth <= MAX_DEPTH, "the tree has more levels than the traversal stack has room for");
        let Children { all, len } = tree.children(self.binary);
        // The child of highest priority comes last, since any-hit rays visit the last lane first.
        let mut children = all.map(|tree| (0.0, tree));
        let children = &mut children[..len];
        for (any_hit_priority, tree) in &mut *children {
            *any_hit_priority = tree.any_hit_priority(self.binary);
        }
        children.sort_unstable_by(|(a, one), (b, other)| a.total_cmp(b).then(one.root.cmp(&other.root)));
        let index = self.len;
        self.len += 1;
        let mut node = Node::EMPTY;
        for (lane, &mut (_, tree)) in children.iter_mut().enumerate() {
            let child = &self.binary[tree.root as usize];
            node.set_box(lane, &child.bounds);
            if child.is_leaf() {
                node.children[lane] = NodeRef::to_leaf(child.first(), child.count());
            } else if tree.len() <= self.part {
                self.parts.push(Part { tree, depth: depth + 1, parent: index, lane });
            } else {
                node.children[lane] = NodeRef::node(self.first + self.len);
                self.add_node(tree, depth + 1);
            }
        }
        node.compute_orders();
        self.nodes[index] = node;
    }
}
