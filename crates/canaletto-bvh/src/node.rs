//! The nodes of the tree that rays walk: eight children each, their boxes side by side for SIMD tests.
//!
//! A child's lane tells where it lies: bit 0 is set for one rather towards +x, bit 1 for +y, bit 2 for +z, as well as
//! one child per lane allows. Seen along a ray of octant o, the lanes i ^ o for i = 0, 1, … then come roughly from near
//! to far, and nothing needs to be sorted (Garanzha and Loop, "Fast ray sorting and breadth-first packet traversal for
//! GPU ray tracing", 2010; Ylitie, Karras and Laine, "Efficient incoherent ray traversal on GPUs through compressed
//! wide BVHs", 2017).

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::Aabb;
use crate::build::{Binary, MAX_LEAF, MAX_PRIMITIVES};
use crate::memory::in_large_pages;
use crate::slab::{Boxes, WIDTH};

/// Eight children. 256 bytes, four cache lines, of which 224 are used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes; where there is no child, a box that no ray meets.
    pub(crate) boxes: Boxes,
    pub(crate) children: [Link; WIDTH],
}

/// A node or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(transparent)]
pub(crate) struct Link(u32);

impl Link {
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// Of 1 to [`MAX_LEAF`] primitives.
    fn to_leaf(first: u32, count: u32) -> Self {
        Self(Self::LEAF | (count - 1) << FIRST_BITS | first)
    }

    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// No place at all.
    pub(crate) const END: Self = Self(u32::MAX);

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Of the node, or the leaf's first slot or block.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & ((1 << FIRST_BITS) - 1)) as usize
    }

    /// The leaf that it leads to.
    #[inline(always)]
    pub(crate) fn leaf(self) -> Leaf {
        Leaf(self.0)
    }

    /// The leaf, else the node.
    #[inline]
    pub(crate) fn follow(self) -> Result<Leaf, usize> {
        if self.0 & Self::LEAF == 0 { Err(self.0 as usize) } else { Ok(Leaf(self.0)) }
    }

    /// The same place in a list that starts `nodes` later; leaves stay.
    fn moved(self, nodes: usize) -> Self {
        if self.0 & Self::LEAF == 0 { Self(self.0 + nodes as u32) } else { self }
    }
}

/// Bits for the first slot of a leaf.
const FIRST_BITS: u32 = 29;
const _: () = assert!(MAX_PRIMITIVES < 1 << FIRST_BITS && MAX_LEAF <= 1 << (31 - FIRST_BITS));

/// Primitives that a ray has to be tested against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf(u32);

impl Leaf {
    /// The number of the leaf's block, or of its first slot: see [`crate::Bvh::build_blocks`].
    #[inline]
    pub fn first(self) -> u32 {
        self.0 & ((1 << FIRST_BITS) - 1)
    }

    /// How many primitives there are, 1 to 4.
    #[inline]
    pub fn count(self) -> u32 {
        1 + ((self.0 ^ Link::LEAF) >> FIRST_BITS)
    }

    /// The slots.
    #[inline]
    pub fn slots(self) -> Range<u32> {
        self.first()..self.first() + self.count()
    }
}

impl Node {
    const EMPTY: Self =
        Self { boxes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]], children: [Link(0); WIDTH] };

    fn set_box(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.boxes[0][axis][lane] = bounds.min[axis];
            self.boxes[1][axis][lane] = bounds.max[axis];
        }
    }

    pub(crate) fn get_box(&self, lane: usize) -> Aabb {
        let corner = |planes: &[[f32; WIDTH]; 3]| planes.map(|p| p[lane]).into();
        Aabb { min: corner(&self.boxes[0]), max: corner(&self.boxes[1]) }
    }
}

/// Above it, a part of the binary tree is collapsed apart from the rest.
const PART: u32 = 1 << 14;

/// Collapses a binary tree: each node adopts the children of its largest inner child until it has eight (Wald,
/// Benthin and Boulos, "Getting rid of packets", 2008). The uppermost nodes lie together, then parts in depth-first order.
pub(crate) fn collapse(binary: &[Binary]) -> Vec<Node> {
    let mut top = Collapse { binary, nodes: Vec::new(), parts: Vec::new(), part: PART };
    if binary.is_empty() {
        return top.nodes;
    }
    top.adopt(0, binary.len() as u32);
    let Collapse { nodes: mut upper, parts, .. } = top;
    let below: Vec<Vec<Node>> = parts
        .par_iter()
        .map(|part| {
            let mut inner = Collapse { binary, nodes: Vec::new(), parts: Vec::new(), part: 0 };
            inner.adopt(part.root, part.end);
            inner.nodes
        })
        .collect();
    let mut nodes = in_large_pages(upper.len() + below.iter().map(Vec::len).sum::<usize>());
    nodes.append(&mut upper);
    for (part, below) in parts.iter().zip(below) {
        let first = nodes.len();
        nodes[part.parent].children[part.lane] = Link::node(first);
        nodes.extend(below.into_iter().map(|node| Node { children: node.children.map(|c| c.moved(first)), ..node }));
    }
    nodes
}

struct Collapse<'a> {
    binary: &'a [Binary],
    nodes: Vec<Node>,
    /// Parts left to be collapsed apart.
    parts: Vec<Part>,
    /// Trees of at most so many binary nodes are left.
    part: u32,
}

struct Part {
    root: u32,
    end: u32,
    parent: usize,
    lane: usize,
}

impl Collapse<'_> {
    /// Collapses the tree at `root`, the nodes of which end before `end`.
    fn adopt(&mut self, root: u32, end: u32) {
        let mut children = [(root, end); WIDTH];
        let mut len = 1;
        while len < WIDTH {
            let largest = (0..len)
                .filter(|&i| !self.binary[children[i].0 as usize].is_leaf())
                .map(|i| (i, self.binary[children[i].0 as usize].bounds.half_area()))
                .reduce(|best, next| if next.1 > best.1 { next } else { best });
            let Some((i, _)) = largest else { break };
            let (at, end) = children[i];
            let [left, right] = self.binary[at as usize].children(at);
            children[i] = (left, right);
            children[len] = (right, end);
            len += 1;
        }
        let children = &children[..len];
        let lanes = lanes(
            children.iter().map(|c| self.binary[c.0 as usize].bounds.center()),
            &self.binary[root as usize].bounds,
        );
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (&(child, end), &lane) in children.iter().zip(&lanes) {
            let node = &self.binary[child as usize];
            self.nodes[index].set_box(lane, &node.bounds);
            if node.is_leaf() {
                self.nodes[index].children[lane] = Link::to_leaf(node.link, node.count);
            } else if end - child <= self.part {
                self.parts.push(Part { root: child, end, parent: index, lane });
            } else {
                self.nodes[index].children[lane] = Link::node(self.nodes.len());
                self.adopt(child, end);
            }
        }
    }
}

/// A lane of its own for each child, given the centers of all and the box around them: the pair of child and lane that suit each
/// other best first.
fn lanes(centers: impl ExactSizeIterator<Item = Vec3>, bounds: &Aabb) -> [usize; WIDTH] {
    let count = centers.len();
    let middle = bounds.center();
    // How well each lane suits each child: the child's way from the middle along the lane's diagonal.
    let mut suits = [[f32::NEG_INFINITY; WIDTH]; WIDTH];
    for (suits, center) in suits.iter_mut().zip(centers) {
        let Vec3 { x, y, z } = (center - middle) * 0.25;
        for (lane, suits) in suits.iter_mut().enumerate() {
            let along = |way: f32, bit: usize| if lane & bit == 0 { -way } else { way };
            *suits = along(x, 1) + along(y, 2) + along(z, 4);
        }
    }
    let mut lanes = [0; WIDTH];
    let (mut children, mut free) = ((1u32 << count) - 1, (1u32 << WIDTH) - 1);
    while children != 0 {
        let mut best = (f32::NEG_INFINITY, children.trailing_zeros() as usize, free.trailing_zeros() as usize);
        for child in (0..count).filter(|child| children >> child & 1 == 1) {
            for lane in (0..WIDTH).filter(|lane| free >> lane & 1 == 1) {
                if suits[child][lane] > best.0 {
                    best = (suits[child][lane], child, lane);
                }
            }
        }
        let (_, child, lane) = best;
        lanes[child] = lane;
        children &= !(1 << child);
        free &= !(1 << lane);
    }
    lanes
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
                if bounds.is_empty() {
                    continue;
                }
                // Without area every ray that meets the root meets all.
                let chance = if total > 0.0 { bounds.half_area() / total } else { 1.0 };
                match node.children[lane].follow() {
                    Err(node) => todo.push((node, chance, depth + 1)),
                    Ok(leaf) => {
                        s.leaves += 1;
                        s.sah_cost += chance * f64::from(leaf.count());
                    }
                }
            }
        }
        s
    }
}
