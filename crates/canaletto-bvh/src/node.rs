//! The memory layout of the tree: nodes of eight children, and the references between them.
//!
//! A node keeps its children's boxes side by side, so that one SIMD test covers all eight. For each octant of ray
//! directions a node also stores the order of its children's centers along the octant's diagonal. The traversal
//! therefore sorts nothing. (Dammertz, Hanika and Keller, "Shallow bounding volume hierarchies for fast SIMD ray
//! tracing of incoherent rays", 2008, store the order of the splits instead.)

use std::hint::select_unpredictable;
use std::ops::Range;

use bytemuck::Zeroable;

use crate::instruction_set::compiled_wide;
use crate::memory::prefetch;
use crate::slab::{Boxes, WIDTH};
use crate::{Aabb, PreparedRay};

/// The largest number of primitives in a leaf.
pub(crate) const MAX_LEAF: usize = 4;

/// The largest number of levels below the root. Median splits of a million primitives need 20 levels, so that SAH
/// splits have 20 to spare. When the remaining levels are only just enough for median splits, the builder splits at the
/// median. The limit bounds the traversal stack and the build time.
pub(crate) const MAX_DEPTH: u32 = 40;

/// The largest number of primitives: a `NodeRef` packs a leaf's first slot and its length into 31 bits.
pub(crate) const MAX_PRIMITIVES: usize = 1 << 28;

/// An inner node with up to eight children: 256 bytes, four cache lines.
///
/// | byte | field | size |
/// |---|---|---|
/// | 0 | `boxes`: \[lower, upper\] × \[x, y, z\] × 8 lanes of f32 | 192 |
/// | 192 | `children`: 8 × [`NodeRef`] | 32 |
/// | 224 | `orders`: 8 octants × u32 | 32 |
///
/// # An order word
/// `orders[octant]` lists the eight lanes in three bits each: bits 0–2 hold the farthest lane, bits 21–23 the nearest.
/// Bits 24–31 are 0. Bit `axis` of the octant is set if the ray moves backwards along that axis.
///
/// Example: the centers of lanes 0, 1, … 7 lie at x = 0, 1, … 7, with equal y and z. A ray of octant 0 moves forwards
/// along x, so lane 7 is the farthest and lane 0 the nearest: the word is `0o01234567`. In octant 1 the ray moves
/// backwards along x, and the word is `0o76543210`.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The children's boxes: `boxes[0]` holds the lower planes and `boxes[1]` the upper planes, each as rows x, y and z
    /// with one f32 per lane. A lane without a child holds [`Aabb::EMPTY`], which no ray enters.
    pub(crate) boxes: Boxes,
    /// The child of each lane: a leaf, an inner node, or [`NodeRef::END`] where there is no child. An inner child comes
    /// later in the list of nodes than its parent. At most `MAX_DEPTH` inner nodes lie below the root on any path. The
    /// traversal relies on these facts; only `build::collapse` links nodes.
    pub(crate) children: [NodeRef; WIDTH],
    /// One order word for each octant of ray directions: the lanes in three bits each, the farthest lane in the lowest
    /// bits.
    pub(crate) orders: [u32; 8],
}

/// A reference to an inner node or a leaf, in 32 bits (Embree's `NodeRef`).
///
/// | | bit 31 | bits 29–30 | bits 0–28 |
/// |---|---|---|---|
/// | inner node | 0 | upper bits of the index | lower bits of the index |
/// | leaf | 1 | count − 1, for 1 to 4 primitives | first slot, or the block's number |
/// | no child | 1 | all ones | all ones |
///
/// No leaf has all bits set, since slots are smaller than 2²⁹ − 1. Example: `0xc000_0005` is a leaf of 3 primitives at
/// slot 5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
#[repr(transparent)]
pub(crate) struct NodeRef(u32);

impl NodeRef {
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// A reference to a leaf of 1 to [`MAX_LEAF`] primitives.
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

    /// The reference of a lane without a child. As the lowest entry of a stack it ends the traversal.
    pub(crate) const END: Self = Self(u32::MAX);

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of the inner node.
    #[inline(always)]
    pub(crate) fn node_index(self) -> usize {
        self.0 as usize
    }

    /// The index of the inner node, or the leaf's first slot or block number.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & ((1 << FIRST_BITS) - 1)) as usize
    }

    /// The leaf that it refers to.
    #[inline(always)]
    pub(crate) fn leaf(self) -> Leaf {
        Leaf(self.0)
    }

    /// The inner node or the leaf that it refers to, if there is one.
    #[inline]
    pub(crate) fn decode(self) -> Option<Child> {
        match self {
            Self::END => None,
            Self(link) if link & Self::LEAF == 0 => Some(Child::Node(link as usize)),
            Self(link) => Some(Child::Leaf(Leaf(link))),
        }
    }
}

/// A decoded [`NodeRef`].
pub(crate) enum Child {
    /// The index of an inner node.
    Node(usize),
    Leaf(Leaf),
}

/// The addresses of the nodes and of the leaves' data, for prefetching.
#[derive(Clone, Copy)]
pub(crate) struct PrefetchTable {
    nodes: *const u8,
    leaves: *const u8,
    /// The size of one leaf's data.
    bytes: usize,
}

impl PrefetchTable {
    /// A table for leaves whose data are one `T` each.
    #[inline(always)]
    pub(crate) fn new<T>(nodes: &[Node], leaves: &[T]) -> Self {
        Self { nodes: nodes.as_ptr().cast(), leaves: leaves.as_ptr().cast(), bytes: size_of::<T>() }
    }

    /// A table of the nodes alone, where the place of the leaves' data is unknown.
    #[inline(always)]
    pub(crate) fn of_nodes(nodes: &[Node]) -> Self {
        Self { bytes: 0, ..Self::new(nodes, nodes) }
    }

    /// Prefetches the node or the leaf data that a reference leads to.
    #[inline(always)]
    pub(crate) fn fetch(self, link: NodeRef) {
        // Both addresses are computed and one is selected. A table of the two would be read right after it was written.
        let node = self.nodes.wrapping_add(link.index() * size_of::<Node>());
        let leaf = self.leaves.wrapping_add(link.index() * self.bytes);
        let start = select_unpredictable(link.is_leaf(), leaf, node);
        let start = select_unpredictable(link == NodeRef::END, self.nodes, start);
        for line in 0..4 {
            prefetch(start.wrapping_add(64 * line));
        }
    }
}

/// The number of bits for a leaf's first slot.
const FIRST_BITS: u32 = 29;
const _: () = assert!(MAX_PRIMITIVES < 1 << FIRST_BITS && MAX_LEAF <= 1 << (31 - FIRST_BITS));

/// A leaf: up to four primitives that a ray has to be tested against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf(u32);

impl Leaf {
    /// The number of the leaf's block (see [`crate::Bvh::build_blocks`]), or its first slot in a tree without blocks.
    #[inline]
    pub fn first(self) -> u32 {
        self.0 & ((1 << FIRST_BITS) - 1)
    }

    /// The number of primitives, 1 to 4.
    #[inline]
    pub fn count(self) -> u32 {
        1 + ((self.0 ^ NodeRef::LEAF) >> FIRST_BITS)
    }

    /// The range of slots.
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

    /// The references to the children.
    #[inline(always)]
    pub(crate) fn children(&self) -> &[NodeRef; WIDTH] {
        &self.children
    }

    /// The child of the highest bit in a mask of entered children. With `ORDERED`, the mask counts in the order for the
    /// ray's octant, otherwise by lane. Any child is returned for an empty mask.
    ///
    /// The child is read from the node and not from the vector just written: that would be a failed store-to-load
    /// forward.
    #[inline(always)]
    pub(crate) fn last_child<const ORDERED: bool>(&self, met: u32, ray: &PreparedRay) -> NodeRef {
        let last = 31 ^ met.leading_zeros();
        let lane =
            if ORDERED { self.orders[usize::from(ray.axis_order.octant & 7)].wrapping_shr(3 * last) } else { last };
        self.children[lane as usize & 7]
    }

    /// The lanes from far to near for a ray of an octant. The octant has one bit for each axis along which the ray
    /// moves backwards.
    #[inline(always)]
    pub(crate) fn order(&self, octant: usize) -> impl Iterator<Item = usize> + use<> {
        let order = self.orders[octant & 7];
        (0..WIDTH).map(move |i| (order >> (3 * i)) as usize & (WIDTH - 1))
    }

    /// Sets a child's box. Adding 0 turns −0 into 0, so that equal boxes have equal bits.
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

    /// Computes the order words from the children's boxes.
    #[allow(clippy::needless_range_loop)] // Loops over lists side by side.
    pub(crate) fn compute_orders(&mut self) {
        let middle = self.bounds().center();
        let mut offsets = [[0.0; WIDTH]; 3];
        for lane in 0..WIDTH {
            let bounds = self.get_box(lane);
            if !bounds.is_empty() {
                // Quarters, so that a sum of three doesn't overflow.
                let way = (bounds.center() - middle) * 0.25;
                (offsets[0][lane], offsets[1][lane], offsets[2][lane]) = (way.x, way.y, way.z);
            }
        }
        self.orders = orders(&offsets);
    }

    pub(crate) fn get_box(&self, lane: usize) -> Aabb {
        let corner = |planes: &[[f32; WIDTH]; 3]| planes.map(|p| p[lane]).into();
        Aabb { min: corner(&self.boxes[0]), max: corner(&self.boxes[1]) }
    }
}

compiled_wide! {
    /// The order words for eight points, given as rows of x, y and z.
    #[allow(clippy::needless_range_loop)] // Loops over lists side by side.
    fn orders(offsets: &[[f32; WIDTH]; 3]) -> [u32; 8] {
        let mut orders = [0; 8];
        for octant in 0..4 {
            let sign = |axis: usize| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let mut along = [0.0; WIDTH];
            for i in 0..WIDTH {
                along[i] = offsets[0][i] * sign(0) + offsets[1][i] * sign(1) + offsets[2][i] * sign(2);
            }
            // The number of lanes that are farther. Of equal lanes, the later one counts as farther.
            let mut ranks = [0; WIDTH];
            for other in 0..WIDTH {
                for i in 0..WIDTH {
                    ranks[i] += u32::from(along[other] > along[i] || along[other] == along[i] && other > i);
                }
            }
            for i in 0..WIDTH {
                orders[octant] |= (i as u32) << (3 * ranks[i]);
                // The opposite octant has the reverse order.
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
            // Some points coincide.
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
