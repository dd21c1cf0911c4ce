//! The nodes of the tree that rays walk: eight children each, their boxes side by side for SIMD tests.
//!
//! For each octant of directions a node knows in which order its children's centers come along the octant's diagonal, so that
//! nothing needs to be sorted on the way (Dammertz, Hanika and Keller, "Shallow bounding volume hierarchies for fast SIMD ray tracing of
//! incoherent rays", 2008, have the order of splits instead).

use std::hint::select_unpredictable;
use std::ops::Range;

use bytemuck::Zeroable;

use crate::build::{MAX_LEAF, MAX_PRIMITIVES};
use crate::memory::prefetch;
use crate::simd::compiled_wide;
use crate::slab::{Boxes, WIDTH};
use crate::{Aabb, PreparedRay};

/// Eight children. 256 bytes, four cache lines.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes; where there is no child, [`Aabb::EMPTY`], which no ray meets.
    pub(crate) boxes: Boxes,
    /// Leaves, nodes that come later in the list, at most [`MAX_DEPTH`] below each other, and [`NodeRef::END`] where there is no child. What walks
    /// through the tree relies on that; only [`collapse`] links nodes.
    pub(crate) children: [NodeRef; WIDTH],
    /// For rays of each octant the lanes in three bits each, the farthest lowest.
    pub(crate) orders: [u32; 8],
}

/// A node or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
#[repr(transparent)]
pub(crate) struct NodeRef(u32);

impl NodeRef {
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// Of 1 to [`MAX_LEAF`] primitives.
    pub(crate) fn to_leaf(first: u32, count: u32) -> Self {
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
pub(crate) struct PrefetchTable {
    nodes: *const u8,
    leaves: *const u8,
    /// Of a leaf's data.
    bytes: usize,
}

impl PrefetchTable {
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
    pub(crate) fn fetch(self, link: NodeRef) {
        // Both computed, and one chosen: a table of the two would be read where it has just been written.
        let node = self.nodes.wrapping_add(link.index() * size_of::<Node>());
        let leaf = self.leaves.wrapping_add(link.index() * self.bytes);
        let start = select_unpredictable(link.is_leaf(), leaf, node);
        let start = select_unpredictable(link == NodeRef::END, self.nodes, start);
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
        1 + ((self.0 ^ NodeRef::LEAF) >> FIRST_BITS)
    }

    /// The slots.
    #[inline]
    pub fn slots(self) -> Range<u32> {
        self.first()..self.first() + self.count()
    }
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        boxes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        children: [NodeRef::END; WIDTH],
        orders: [0; 8],
    };

    /// The children.
    #[inline(always)]
    pub(crate) fn children(&self) -> &[NodeRef; WIDTH] {
        &self.children
    }

    /// The last child of a mask of those in the order for a ray's octant, or else of those as they lie; any, if there is none. It is read from where
    /// it has long been: what was just written side by side takes its time until a part of it can be read.
    #[inline(always)]
    pub(crate) fn last<const ORDERED: bool>(&self, met: u32, ray: &PreparedRay) -> NodeRef {
        let last = 31 ^ met.leading_zeros();
        let lane =
            if ORDERED { self.orders[usize::from(ray.axis_order.octant & 7)].wrapping_shr(3 * last) } else { last };
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
    #[allow(clippy::needless_range_loop)] // NodeTest of lists side by side.
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

compiled_wide! {
    /// The orders of eight points, given x, y and z of all.
    #[allow(clippy::needless_range_loop)] // NodeTest of lists side by side.
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
