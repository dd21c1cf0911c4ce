//! The nodes of the tree that rays walk: eight children each, their boxes side by side for SIMD tests.
//!
//! For each octant of directions a node knows in which order its children's centers come along the octant's diagonal, so that
//! nothing needs to be sorted on the way (Dammertz, Hanika and Keller, "Shallow bounding volume hierarchies for fast SIMD ray tracing of
//! incoherent rays", 2008, have the order of splits instead).

use std::hint::select_unpredictable;
use std::ops::Range;

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::build::{Binary, MAX_DEPTH, MAX_LEAF, MAX_PRIMITIVES, compiled_wide};
use crate::memory::{prefetch, zeros};
use crate::slab::{Boxes, WIDTH};
use crate::{Aabb, PreparedRay};

/// Eight children. 256 bytes, four cache lines.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes; where there is no child, [`Aabb::EMPTY`], which no ray meets.
    pub(crate) boxes: Boxes,
    /// Leaves, nodes that come later in the list, at most [`MAX_DEPTH`] below each other, and [`Link::END`] where there is no child. What walks
    /// through the tree relies on that; only [`collapse`] links nodes.
    children: [Link; WIDTH],
    /// For rays of each octant the lanes in three bits each, the farthest lowest.
    pub(crate) orders: [u32; 8],
}

/// A node or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
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

    /// Where it leads to, if anywhere.
    #[inline]
    pub(crate) fn follow(self) -> Option<Child> {
        match self {
            Self::END => None,
            Self(link) if link & Self::LEAF == 0 => Some(Child::Node(link as usize)),
            Self(link) => Some(Child::Leaf(Leaf(link))),
        }
    }
}

/// What a node has below it.
pub(crate) enum Child {
    /// The index of a node.
    Node(usize),
    Leaf(Leaf),
}

/// Where nodes and the data of leaves lie, to be fetched in advance.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    nodes: *const u8,
    leaves: *const u8,
    /// Of a leaf's data.
    bytes: usize,
}

impl Places {
    /// Where each leaf's data are one of these.
    #[inline(always)]
    pub(crate) fn new<T>(nodes: &[Node], leaves: &[T]) -> Self {
        Self { nodes: nodes.as_ptr().cast(), leaves: leaves.as_ptr().cast(), bytes: size_of::<T>() }
    }

    /// Where nothing is known of leaves' data.
    #[inline(always)]
    pub(crate) fn of_nodes(nodes: &[Node]) -> Self {
        Self { bytes: 0, ..Self::new(nodes, nodes) }
    }

    /// Tells the caches that what a link leads to will be read.
    #[inline(always)]
    pub(crate) fn fetch(self, link: Link) {
        // Both computed, and one chosen: a table of the two would be read where it has just been written.
        let node = self.nodes.wrapping_add(link.index() * size_of::<Node>());
        let leaf = self.leaves.wrapping_add(link.index() * self.bytes);
        let start = select_unpredictable(link.is_leaf(), leaf, node);
        let start = select_unpredictable(link == Link::END, self.nodes, start);
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
        children: [Link::END; WIDTH],
        orders: [0; 8],
    };

    /// The children.
    #[inline(always)]
    pub(crate) fn children(&self) -> &[Link; WIDTH] {
        &self.children
    }

    /// The last child of a mask of those in the order for a ray's octant, or else of those as they lie; any, if there is none. It is read from where
    /// it has long been: what was just written side by side takes its time until a part of it can be read.
    #[inline(always)]
    pub(crate) fn last<const ORDERED: bool>(&self, met: u32, ray: &PreparedRay) -> Link {
        let last = 31 ^ met.leading_zeros();
        let lane = if ORDERED { self.orders[usize::from(ray.way.octant & 7)].wrapping_shr(3 * last) } else { last };
        self.children[lane as usize & 7]
    }

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
const PART: u32 = 1 << 12;

/// Makes the wide nodes that cost least of a binary tree (see `build::widen`). The uppermost nodes lie together, then parts in
/// depth-first order.
///
/// # Panics
/// If the tree would have more than [`MAX_DEPTH`] + 1 levels, for which rays' stacks have no room. Builders see to it that none has.
pub(crate) fn collapse(binary: &[Binary]) -> Vec<Node> {
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
        upper[part.parent].children[part.lane] = Link::node(first);
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
    binary: &'a [Binary],
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
    fn children(self, binary: &[Binary]) -> Children {
        let mut children = Children { all: [Self { root: 0, end: 0 }; WIDTH], len: 0 };
        self.gather(binary, WIDTH, &mut children);
        children
    }

    /// Collects what the tree puts into so many lanes.
    fn gather(self, binary: &[Binary], lanes: usize, children: &mut Children) {
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
    fn wide_nodes(self, binary: &[Binary], part: u32) -> usize {
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
    fn promise(self, binary: &[Binary]) -> f64 {
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
        for (promise, tree) in &mut *children {
            *promise = tree.promise(self.binary);
        }
        children.sort_unstable_by(|(a, one), (b, other)| a.total_cmp(b).then(one.root.cmp(&other.root)));
        let index = self.len;
        self.len += 1;
        let mut node = Node::EMPTY;
        for (lane, &mut (_, tree)) in children.iter_mut().enumerate() {
            let child = &self.binary[tree.root as usize];
            node.set_box(lane, &child.bounds);
            if child.is_leaf() {
                node.children[lane] = Link::to_leaf(child.first(), child.count());
            } else if tree.len() <= self.part {
                self.parts.push(Part { tree, depth: depth + 1, parent: index, lane });
            } else {
                node.children[lane] = Link::node(self.first + self.len);
                self.adopt(tree, depth + 1);
            }
        }
        node.sort();
        self.nodes[index] = node;
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
