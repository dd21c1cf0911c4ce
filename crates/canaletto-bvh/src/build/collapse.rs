//! Binary trees become wide: each subtree takes the lanes that [`widen`](super::widen) found to cost least.

use rayon::prelude::*;

use super::{BinaryNode, MAX_DEPTH};
use crate::memory::zeros;
use crate::node::{Node, NodeRef};
use crate::slab::WIDTH;

/// Above it, a part of the binary tree is collapsed apart from the rest.
const PART: u32 = 1 << 12;

/// Makes the wide nodes that cost least of a binary tree (see `build::widen`). The uppermost nodes lie together, then parts in
/// depth-first order.
///
/// # Panics
/// If the tree would have more than [`MAX_DEPTH`] + 1 levels, for which rays' stacks have no room. Builders see to it that none has.
pub(crate) fn collapse(binary: &[BinaryNode]) -> Vec<Node> {
    let whole = Tree { root: 0, end: binary.len() as u32 };
    if binary.is_empty() {
        return Vec::new();
    }
    let mut upper = vec![Node::EMPTY; whole.wide_nodes(binary, PART)];
    let mut top = Collapse { binary, nodes: &mut upper, len: 0, first: 0, parts: Vec::new(), part: PART };
    top.adopt(whole, 0);
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
        Collapse { binary, nodes, len: 0, first, parts: Vec::new(), part: 0 }.adopt(part.tree, part.depth);
    });
    nodes
}

struct Collapse<'a> {
    binary: &'a [BinaryNode],
    /// Room for all.
    nodes: &'a mut [Node],
    len: usize,
    /// Where they come in the list of all.
    first: usize,
    /// Parts left to be collapsed apart.
    parts: Vec<Part>,
    /// Trees of at most so many binary nodes are left.
    part: u32,
}

struct Part {
    tree: Tree,
    /// How many wide nodes are above it.
    depth: u32,
    parent: usize,
    lane: usize,
}

/// Where a tree begins and ends among binary nodes.
#[derive(Clone, Copy)]
struct Tree {
    root: u32,
    end: u32,
}

/// What becomes the children of a wide node.
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

    /// Collects what the tree puts into so many lanes.
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

    /// How many wide nodes it becomes, without trees of at most `part` binary nodes below the root.
    fn wide_nodes(self, binary: &[BinaryNode], part: u32) -> usize {
        let Children { all, len } = self.children(binary);
        let inner = |tree: &&Self| tree.len() > part.max(1);
        1 + all[..len].iter().filter(inner).map(|tree| tree.wide_nodes(binary, part)).sum::<usize>()
    }

    /// Its binary nodes.
    fn len(self) -> u32 {
        self.end - self.root
    }

    /// How soon a ray that looks for any hit should visit it: what many rays enter, what is small, and what fills its box, as flat things do. The
    /// powers are those with which rays visited least of the benchmark's meshes: up to a third less than the largest box first.
    fn any_hit_priority(self, binary: &[BinaryNode]) -> f64 {
        let bounds = &binary[self.root as usize].bounds;
        let extent = bounds.max.as_dvec3() - bounds.min.as_dvec3();
        let longest = extent.max_element();
        let flat = if longest > 0.0 { extent.min_element() / longest } else { 1.0 };
        bounds.half_area() / ((flat + 1e-3) * f64::from(self.len()).sqrt().sqrt())
    }
}

impl Collapse<'_> {
    fn adopt(&mut self, tree: Tree, depth: u32) {
        assert!(depth <= MAX_DEPTH, "a tree of more levels than rays' stacks have room for");
        let Children { all, len } = tree.children(self.binary);
        // The most promising last: it is the first that any-hit rays visit.
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
                self.adopt(tree, depth + 1);
            }
        }
        node.sort();
        self.nodes[index] = node;
    }
}
