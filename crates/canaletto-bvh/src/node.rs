//! The nodes of the tree that rays walk: eight children each, their boxes side by side for SIMD tests.
//!
//! For each octant of directions a node knows in which order its children's centers come along the octant's diagonal, so that
//! nothing needs to be sorted on the way (Dammertz, Hanika and Keller, "Shallow bounding volume hierarchies for fast SIMD ray tracing of
//! incoherent rays", 2008, have the order of splits instead).

use std::hint::select_unpredictable;
use std::ops::Range;

use rayon::prelude::*;

use crate::Aabb;
use crate::build::{Binary, MAX_LEAF, MAX_PRIMITIVES, compiled_wide};
use crate::memory::{in_large_pages, prefetch};
use crate::slab::{Boxes, WIDTH};

/// Eight children. 256 bytes, four cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes; where there is no child, a box that no ray meets.
    pub(crate) boxes: Boxes,
    pub(crate) children: [Link; WIDTH],
    /// For rays of each octant the lanes in three bits each, the farthest lowest.
    pub(crate) orders: [u32; 8],
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

    /// Of the node to which it leads.
    #[inline(always)]
    pub(crate) fn node_index(self) -> usize {
        self.0 as usize
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

/// Where nodes and the data of leaves lie, to be fetched in advance.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    /// Of the nodes, and of the leaves' data.
    starts: [*const u8; 2],
    /// Of a node, and of a leaf's data.
    bytes: [usize; 2],
}

impl Places {
    /// Where each leaf's data are one of these.
    #[inline(always)]
    pub(crate) fn new<T>(nodes: &[Node], leaves: &[T]) -> Self {
        Self { starts: [nodes.as_ptr().cast(), leaves.as_ptr().cast()], bytes: [size_of::<Node>(), size_of::<T>()] }
    }

    /// Where nothing is known of leaves' data.
    #[inline(always)]
    pub(crate) fn of_nodes(nodes: &[Node]) -> Self {
        Self { starts: [nodes.as_ptr().cast(); 2], bytes: [size_of::<Node>(), 0] }
    }

    /// Tells the caches that what a link leads to will be read.
    #[inline(always)]
    pub(crate) fn fetch(self, link: Link) {
        let kind = usize::from(link.is_leaf());
        let start = self.starts[kind].wrapping_add(link.index() * self.bytes[kind]);
        let start = select_unpredictable(link == Link::END, self.starts[0], start);
        for line in 0..4 {
            prefetch(start.wrapping_add(64 * line));
        }
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
    const EMPTY: Self = Self {
        boxes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        children: [Link(0); WIDTH],
        orders: [0; 8],
    };

    /// The lanes from far to near for a ray of an octant, which has a bit for each axis along which it moves backwards.
    #[inline(always)]
    pub(crate) fn order(&self, octant: usize) -> impl Iterator<Item = usize> + use<> {
        let order = self.orders[octant & 7];
        (0..WIDTH).map(move |i| (order >> (3 * i)) as usize & (WIDTH - 1))
    }

    /// Adding 0 turns −0 into 0, so that equal boxes are the same bits.
    pub(crate) fn set_box(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.boxes[0][axis][lane] = bounds.min[axis] + 0.0;
            self.boxes[1][axis][lane] = bounds.max[axis] + 0.0;
        }
    }

    /// The box around all children.
    pub(crate) fn bounds(&self) -> Aabb {
        (0..WIDTH).fold(Aabb::EMPTY, |bounds, lane| bounds.union(self.get_box(lane)))
    }

    /// Finds the orders of the children.
    #[allow(clippy::needless_range_loop)] // Lanes of lists side by side.
    pub(crate) fn sort(&mut self) {
        let middle = self.bounds().center();
        let mut ways = [[0.0; WIDTH]; 3];
        for lane in 0..WIDTH {
            let bounds = self.get_box(lane);
            if !bounds.is_empty() {
                // Quarters, of which three sum up without overflow.
                let way = (bounds.center() - middle) * 0.25;
                (ways[0][lane], ways[1][lane], ways[2][lane]) = (way.x, way.y, way.z);
            }
        }
        self.orders = orders(&ways);
    }

    pub(crate) fn get_box(&self, lane: usize) -> Aabb {
        let corner = |planes: &[[f32; WIDTH]; 3]| planes.map(|p| p[lane]).into();
        Aabb { min: corner(&self.boxes[0]), max: corner(&self.boxes[1]) }
    }
}

/// Above it, a part of the binary tree is collapsed apart from the rest.
const PART: u32 = 1 << 14;

/// Makes the wide nodes that cost least of a binary tree (see `build::widen`). The uppermost nodes lie together, then parts in
/// depth-first order.
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
            let room = (part.end - part.root) as usize / 10;
            let mut inner = Collapse { binary, nodes: Vec::with_capacity(room), parts: Vec::new(), part: 0 };
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

/// Children of a wide node: where their trees begin and end.
struct Children {
    all: [(u32, u32); WIDTH],
    len: usize,
}

impl Collapse<'_> {
    /// Collects what the tree at `root`, the nodes of which end before `end`, puts into so many lanes.
    fn gather(&self, root: u32, end: u32, lanes: usize, children: &mut Children) {
        let node = &self.binary[root as usize];
        match if lanes == 1 { None } else { node.left_lanes(lanes) } {
            Some(to_left) => {
                let [left, right] = node.children(root);
                self.gather(left, right, to_left, children);
                self.gather(right, end, lanes - to_left, children);
            }
            None => {
                children.all[children.len] = (root, end);
                children.len += 1;
            }
        }
    }

    /// How soon a ray that looks for any hit should visit a tree: what many rays enter, what is small, and what fills its box, as flat things do. The
    /// powers are those with which rays visited least of the benchmark's meshes: up to a third less than the largest box first.
    fn promise(&self, (root, end): (u32, u32)) -> f64 {
        let bounds = &self.binary[root as usize].bounds;
        let extent = (bounds.max - bounds.min).as_dvec3();
        let longest = extent.max_element();
        let flat = if longest > 0.0 { extent.min_element() / longest } else { 1.0 };
        bounds.half_area() / ((flat + 1e-3) * f64::from(end - root).sqrt().sqrt())
    }

    /// Collapses the tree at `root`, the nodes of which end before `end`.
    fn adopt(&mut self, root: u32, end: u32) {
        let mut children = Children { all: [(0, 0); WIDTH], len: 0 };
        self.gather(root, end, WIDTH, &mut children);
        let children = &mut children.all[..children.len];
        // The most promising last: it is the first that any-hit rays visit.
        children.sort_by(|a, b| self.promise(*a).total_cmp(&self.promise(*b)).then(a.0.cmp(&b.0)));
        let children = &*children;
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (lane, &(child, end)) in children.iter().enumerate() {
            let node = &self.binary[child as usize];
            self.nodes[index].set_box(lane, &node.bounds);
            if node.is_leaf() {
                self.nodes[index].children[lane] = Link::to_leaf(node.first(), node.count());
            } else if end - child <= self.part {
                self.parts.push(Part { root: child, end, parent: index, lane });
            } else {
                self.nodes[index].children[lane] = Link::node(self.nodes.len());
                self.adopt(child, end);
            }
        }
        self.nodes[index].sort();
    }
}

compiled_wide! {
    /// The orders of eight points, given x, y and z of all.
    #[allow(clippy::needless_range_loop)] // Lanes of lists side by side.
    fn orders(ways: &[[f32; WIDTH]; 3]) -> [u32; 8] {
        let mut orders = [0; 8];
        for octant in 0..4 {
            let sign = |axis: usize| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let mut along = [0.0; WIDTH];
            for i in 0..WIDTH {
                along[i] = ways[0][i] * sign(0) + ways[1][i] * sign(1) + ways[2][i] * sign(2);
            }
            // How many are farther; of equals, those in later lanes.
            let mut ranks = [0; WIDTH];
            for other in 0..WIDTH {
                for i in 0..WIDTH {
                    ranks[i] += u32::from(along[other] > along[i] || along[other] == along[i] && other > i);
                }
            }
            for i in 0..WIDTH {
                orders[octant] |= (i as u32) << (3 * ranks[i]);
                // The opposite way, the other way around.
                orders[octant ^ 7] |= (i as u32) << (3 * (7 - ranks[i]));
            }
        }
        orders
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use glam::Vec3;

    #[test]
    fn each_octant_has_its_children_from_far_to_near() {
        let random = &mut Random(43);
        for n in 0..200 {
            // Some coincide.
            let points: Vec<Vec3> = (0..WIDTH).map(|_| (random.vector() * 3.0).round() * [1.0, 0.0][n % 2]).collect();
            let row = |axis: usize| std::array::from_fn(|lane| points[lane][axis]);
            let node = Node { orders: orders(&[row(0), row(1), row(2)]), ..Node::EMPTY };
            for octant in 0..8 {
                let way = Vec3::from([0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 }));
                let mut lanes: Vec<usize> = node.order(octant).collect();
                assert!(lanes.is_sorted_by(|&a, &b| points[a].dot(way) >= points[b].dot(way)));
                lanes.sort_unstable();
                assert!(lanes.into_iter().eq(0..WIDTH), "each lane once");
            }
        }
    }
}
