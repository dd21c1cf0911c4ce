//! The builder: a binary tree by the binned surface area heuristic (Wald, "On fast construction of SAH-based bounding
//! volume hierarchies", 2007), top down and in parallel. Read the files in this order:
//!
//! 1. `prim_ref`: primitive references, which the builder sorts. `presplit` cuts large triangles into several
//!    references.
//! 2. `bins`: bins of references. `binning`: fills them and finds the split of least SAH cost. `partition` moves
//!    references to their side of the split. `avx2` holds the inner loops of both.
//! 3. `duplicates`: leaves out triangles with equal corners.
//! 4. `reinsertion`: improves the binary tree for [`Quality::High`].
//! 5. `widen` and `collapse`: find and make the eight-wide nodes of least cost.
//! 6. `refit`: fits the boxes of a finished tree to moved triangles.
//!
//! The tree doesn't depend on the number of threads. Chunks have a fixed size. Bins that are filled separately are
//! merged by counts, minima and maxima. Both halves of a split are built separately and joined in order.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod binning;
mod bins;
pub(crate) mod collapse;
#[cfg(test)]
mod degenerate_inputs;
pub(crate) mod duplicates;
mod partition;
mod presplit;
mod prim_ref;
pub(crate) mod refit;
mod reinsertion;
mod widen;

use std::sync::{Mutex, PoisonError};

use bytemuck::Zeroable;
use glam::Vec3;

use crate::memory::{collected, in_large_pages, zeros};
use crate::node::{MAX_DEPTH, MAX_LEAF, MAX_PRIMITIVES};
use crate::{Aabb, NoThreads};
use binning::CostModel;
use bins::{BinSplit, Bins};
use prim_ref::{Box8, Centers, Extent, PrimRef};
pub(crate) use prim_ref::{Corners, PrimRefs};
use widen::{Costs, LaneSplit};

/// The number of levels, beyond those that median splits need, that may lie above large sets of primitives.
const LEVELS_TO_SPARE: u32 = 5;
/// Above this number of primitives, the halves of a split are built in parallel.
const PARALLEL_BUILD: usize = 4096;
/// Above this number, a node's primitives are processed in parallel, in chunks of this size.
const CHUNK: usize = 1 << 15;
/// The cost of a node, in units of the cost of a primitive.
const NODE_COST: f32 = 1.0;
/// The minimum cost of a node, where the root's is about 1. With it, subtrees of zero area get few nodes, too.
const LEAST_COST: f32 = 1e-30;

/// The amount of work for building a tree. No query result depends on it. Large triangles that fill little of their
/// boxes are split into references, at most 30 % more references than there are triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// A fast build.
    #[default]
    Medium,
    /// A better tree for twice the work, worthwhile if many rays visit it.
    High,
}

/// The reason why no tree was built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A box has a coordinate that is NaN or infinite, or its minimum is above its maximum.
    #[error("the box of primitive {index} is not finite or is empty: {} to {}", .bounds.min, .bounds.max)]
    InvalidBox {
        /// The first such primitive.
        index: usize,
        /// Its box.
        bounds: Aabb,
    },
    /// There are too many primitives for one tree.
    #[error("{count} primitives are too many for one tree, the most are {MAX_PRIMITIVES}")]
    TooManyPrimitives {
        /// The number of primitives.
        count: usize,
    },
    /// The work needs threads that can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

/// A node of a binary tree in depth-first order. The left child directly follows its parent.
#[derive(Clone, Copy, Debug, Zeroable)]
pub(crate) struct BinaryNode {
    pub(crate) bounds: Aabb,
    /// For a leaf: the first slot, and in the upper bits the number of primitives minus 1. For an inner node: the
    /// distance to the right child.
    link: u32,
    /// The distribution of a wide node's lanes over the two children, see `widen`.
    lanes: LaneSplit,
}

/// The number of bits for a leaf's first slot.
const FIRST_BITS: u32 = MAX_PRIMITIVES.ilog2();
const _: () = assert!(MAX_LEAF <= 1 << (32 - FIRST_BITS) && size_of::<BinaryNode>() == 32);

impl BinaryNode {
    fn leaf(bounds: &Box8, first: u32, count: usize) -> Self {
        Self { bounds: bounds.aabb(), link: first | (count as u32 - 1) << FIRST_BITS, lanes: LaneSplit::LEAF }
    }

    pub(crate) fn is_leaf(&self) -> bool {
        self.lanes == LaneSplit::LEAF
    }

    /// The first slot of a leaf.
    pub(crate) fn first(&self) -> u32 {
        self.link & ((1 << FIRST_BITS) - 1)
    }

    /// Sets a leaf's first slot and number of primitives.
    pub(crate) fn set(&mut self, first: u32, count: u32) {
        self.link = first | (count - 1) << FIRST_BITS;
    }

    /// The number of primitives in a leaf.
    pub(crate) fn count(&self) -> u32 {
        1 + (self.link >> FIRST_BITS)
    }

    /// If this subtree may use `lanes` lanes, from 2 to 8: the number of them for its left child. None if it uses a
    /// single one.
    pub(crate) fn left_lanes(&self, lanes: usize) -> Option<usize> {
        self.lanes.left(lanes)
    }

    /// The indices of the children of this node, which lies at `index`.
    pub(crate) fn children(&self, index: u32) -> [u32; 2] {
        [index + 1, index + self.link]
    }
}

/// The result of a build.
pub(crate) struct Built {
    /// The binary nodes. With [`Quality::High`] the leaves need not be in the order of their slots.
    pub(crate) nodes: Vec<BinaryNode>,
    /// The primitive of each slot.
    pub(crate) order: Vec<u32>,
    /// The box around all primitives.
    pub(crate) bounds: Aabb,
    /// Pairs of triangles with equal corners: the triangle of the lower id, which is in the tree, and the copy, which
    /// is in no leaf.
    pub(crate) duplicates: Vec<[u32; 2]>,
}

/// The stack that a builder needs at most. It covers the levels of a tree, each with its bins, and the levels of other
/// subtrees that a waiting thread takes on.
pub(crate) const STACK: usize = 1 << 20;

/// Builds the tree. A leaf costs as much as the blocks of `block` primitives that it fills. A leaf of one block is not
/// split.
pub(crate) fn build(refs: PrimRefs<'_>, block: usize, quality: Quality) -> Built {
    let PrimRefs { list: mut refs, whole, corners } = refs;
    let (mut nodes, mut duplicates) = (Vec::new(), Vec::new());
    if !refs.is_empty() {
        let extent = Extent::of(&refs);
        let cost_model = CostModel { block: block as u32, scale: extent.bounds.scale() };
        let most_levels = (levels(refs.len()) + LEVELS_TO_SPARE).min(MAX_DEPTH);
        let builder = Builder { cost_model, most_levels, corners, duplicates: Mutex::new(Vec::new()) };
        let tree = builder.subtree(&mut refs, 0, 0, extent).0;
        nodes = zeros(tree.len());
        tree.place(&mut nodes);
        duplicates = builder.duplicates.into_inner().unwrap_or_else(PoisonError::into_inner);
        duplicates.sort_unstable();
        duplicates.dedup();
        if quality == Quality::High {
            reinsertion::optimize(&mut nodes, &cost_model);
        }
    }
    let root = nodes.first().map_or(Aabb::EMPTY, |root| root.bounds);
    Built { nodes, order: collected(refs.len(), 0, |slot| refs[slot].id()), bounds: whole.unwrap_or(root), duplicates }
}

/// A tree in the pieces that the threads built.
enum Subtree {
    Whole(Vec<BinaryNode>),
    Split(Box8, LaneSplit, Box<[Subtree; 2]>),
}

impl Subtree {
    fn len(&self) -> usize {
        match self {
            Self::Whole(nodes) => nodes.len(),
            Self::Split(_, _, halves) => 1 + halves[0].len() + halves[1].len(),
        }
    }

    /// Copies the pieces to their places in a list of as many nodes.
    fn place(self, nodes: &mut [BinaryNode]) {
        match self {
            Self::Whole(own) => nodes.copy_from_slice(&own),
            Self::Split(bounds, lanes, halves) => {
                let [left, right] = *halves;
                let Some((root, rest)) = nodes.split_first_mut() else { return };
                let (on_the_left, on_the_right) = rest.split_at_mut(left.len());
                *root = BinaryNode { bounds: bounds.aabb(), link: 1 + on_the_left.len() as u32, lanes };
                rayon::join(|| left.place(on_the_left), || right.place(on_the_right));
            }
        }
    }
}

struct Builder<'a> {
    cost_model: CostModel,
    /// The largest number of levels above large sets of primitives. It bounds the build time where each split takes off
    /// a few of very many primitives.
    most_levels: u32,
    corners: Option<&'a Corners<'a>>,
    /// The duplicates, as in [`Built`], in any order.
    duplicates: Mutex<Vec<[u32; 2]>>,
}

/// The result of splitting a range of references. The references are reordered.
enum Split {
    /// A leaf of the first so many references.
    Leaf(usize),
    /// Two parts: their ends in the range, and their extents.
    Halves([usize; 2], [Extent; 2]),
}

impl Split {
    fn at(refs: &[PrimRef], middle: usize) -> Self {
        let (left, right) = refs.split_at(middle);
        Self::Halves([middle, refs.len()], [Extent::of(left), Extent::of(right)])
    }

    /// Splits the first `count` references, whose centers coincide. Any two halves have equal cost.
    fn halve(refs: &[PrimRef], count: usize) -> Self {
        if count <= MAX_LEAF {
            return Self::Leaf(count);
        }
        let (left, right) = refs[..count].split_at(count / 2);
        let extents = [left, right].map(|half| Extent { duplicates_removed: true, ..Extent::of(half) });
        Self::Halves([count / 2, count], extents)
    }
}

impl Builder<'_> {
    /// Builds the tree over `refs`, whose first slot is `first`.
    fn subtree(&self, refs: &mut [PrimRef], first: u32, depth: u32, extent: Extent) -> (Subtree, Costs) {
        let n = refs.len();
        if n <= PARALLEL_BUILD {
            let mut nodes = in_large_pages(2 * n.div_ceil(self.cost_model.block as usize));
            let costs = self.subdivide(refs, first, depth, extent, &mut nodes, &mut { Bins::EMPTY });
            return (Subtree::Whole(nodes), costs);
        }
        let ([middle, end], [a, b]) = match self.split(refs, &extent, depth, &mut { Bins::EMPTY }) {
            Split::Halves(ends, extents) => (ends, extents),
            Split::Leaf(count) => {
                return (
                    Subtree::Whole(vec![BinaryNode::leaf(&extent.bounds, first, count)]),
                    self.leaf(&extent, count),
                );
            }
        };
        let (left, right) = refs[..end].split_at_mut(middle);
        let ((left, a), (right, b)) = rayon::join(
            || self.subtree(left, first, depth + 1, a),
            || self.subtree(right, first + middle as u32, depth + 1, b),
        );
        let (costs, lanes) = widen::join(self.cost_model.node(&extent.bounds), &a, &b);
        (Subtree::Split(extent.bounds, lanes, Box::new([left, right])), costs)
    }

    fn leaf(&self, extent: &Extent, count: usize) -> Costs {
        widen::leaf(self.cost_model.cost(&extent.bounds, count as u32))
    }

    /// Appends the tree over `refs` to `nodes`.
    fn subdivide(
        &self,
        refs: &mut [PrimRef],
        first: u32,
        depth: u32,
        extent: Extent,
        nodes: &mut Vec<BinaryNode>,
        bins: &mut Bins,
    ) -> Costs {
        let ([middle, end], [a, b]) = match self.split(refs, &extent, depth, bins) {
            Split::Halves(ends, extents) => (ends, extents),
            Split::Leaf(count) => {
                nodes.push(BinaryNode::leaf(&extent.bounds, first, count));
                return self.leaf(&extent, count);
            }
        };
        let index = nodes.len();
        nodes.push(BinaryNode { bounds: extent.bounds.aabb(), link: 0, lanes: LaneSplit::LEAF });
        let (left, right) = refs[..end].split_at_mut(middle);
        let a = self.subdivide(left, first, depth + 1, a, nodes, bins);
        nodes[index].link = (nodes.len() - index) as u32;
        let b = self.subdivide(right, first + middle as u32, depth + 1, b, nodes, bins);
        let (costs, lanes) = widen::join(self.cost_model.node(&extent.bounds), &a, &b);
        nodes[index].lanes = lanes;
        costs
    }

    fn split(&self, refs: &mut [PrimRef], extent: &Extent, depth: u32, bins: &mut Bins) -> Split {
        let n = refs.len();
        let needed = levels(n);
        if depth + needed >= if n > PARALLEL_BUILD { self.most_levels } else { MAX_DEPTH } {
            if n <= MAX_LEAF {
                return Split::Leaf(n);
            }
            let middle = split_at_median(refs, extent);
            return Split::at(refs, middle);
        }
        if n <= self.cost_model.block as usize {
            return Split::Leaf(n);
        }
        if extent.duplicates_removed {
            return Split::halve(refs, n);
        }
        let Some(bin_split) = BinSplit::best(refs, &extent.centers, &self.cost_model, bins) else {
            let count = if n > MAX_LEAF { self.duplicates_removed(refs) } else { n };
            return Split::halve(refs, count);
        };
        let area = extent.bounds.half_area(self.cost_model.scale);
        if n <= MAX_LEAF && NODE_COST * area + bin_split.cost >= self.cost_model.blocks(n as u32) * area {
            return Split::Leaf(n);
        }
        let (middle, [a, b]) = partition::partition(refs, &bin_split);
        // A plan has references on both sides. If rounding put all of them on one side, the build would try that split
        // again without end.
        if middle == 0 || middle == n {
            let middle = split_at_median(refs, extent);
            return Split::at(refs, middle);
        }
        let [left, right] = bin_split.bounds;
        let extents =
            [(left, a), (right, b)].map(|(bounds, centers)| Extent { bounds, centers, duplicates_removed: false });
        Split::Halves([middle, n], extents)
    }

    /// Moves the distinct triangles to the front, records the duplicates and returns the number of distinct ones.
    fn duplicates_removed(&self, refs: &mut [PrimRef]) -> usize {
        let Some(corners) = self.corners else { return refs.len() };
        let (count, mut duplicates) = duplicates::move_distinct_first(refs, corners);
        self.duplicates.lock().unwrap_or_else(PoisonError::into_inner).append(&mut duplicates);
        count
    }
}

/// The number of levels that median splits down to single primitives need: ⌈log₂ n⌉.
fn levels(n: usize) -> u32 {
    usize::BITS - (n - 1).leading_zeros()
}

/// Splits near the median, so that neither side needs as many levels as the whole.
fn split_at_median(refs: &mut [PrimRef], extent: &Extent) -> usize {
    let Centers(centers) = &extent.centers;
    let axis = Vec3::from([0, 1, 2].map(|axis| centers.max(axis) - centers.min(axis))).max_position();
    let key = |prim: &PrimRef| prim.center()[axis];
    // The median of a sample is cheap, and for nearly all inputs close enough.
    let mut sample: Vec<f32> = refs.iter().step_by((refs.len() / SAMPLE).max(1)).map(key).collect();
    let half = sample.len() / 2;
    let (_, &mut limit, _) = sample.select_nth_unstable_by(half, f32::total_cmp);
    let middle = partition::below(refs, axis, limit);
    if levels(middle.max(refs.len() - middle)) < levels(refs.len()) {
        return middle;
    }
    let middle = refs.len() / 2;
    refs.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.id().cmp(&b.id())));
    middle
}

/// The number of centers in the sample for the median.
const SAMPLE: usize = 1024;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, TestPrimitive, zoo};
    use crate::{Bvh, InstructionSet};

    fn boxes(n: usize) -> Vec<Aabb> {
        let random = &mut Random(7);
        (0..n)
            .map(|_| {
                let p = random.vector();
                Aabb::from_points([p, p + 0.01 * random.vector()])
            })
            .collect()
    }

    fn build_boxes(bounds: &[Aabb]) -> (Vec<BinaryNode>, Vec<u32>) {
        let built = build(PrimRefs::new(bounds.len(), &|i| bounds[i]).unwrap(), 1, Quality::Medium);
        (built.nodes, built.order)
    }

    /// Checks the tree and returns its height.
    fn check(bounds: &[Aabb]) -> u32 {
        fn visit(nodes: &[BinaryNode], index: u32, parent: &Aabb, slots: &mut Vec<u32>) -> (Aabb, u32) {
            let node = &nodes[index as usize];
            assert_eq!(parent.union(node.bounds), *parent);
            if node.is_leaf() {
                assert!(node.count() as usize <= MAX_LEAF);
                slots.extend(node.first()..node.first() + node.count());
                return (node.bounds, 0);
            }
            let [left, right] = node.children(index);
            let (a, left) = visit(nodes, left, &node.bounds, slots);
            let (b, right) = visit(nodes, right, &node.bounds, slots);
            assert_eq!(a.union(b), node.bounds);
            (node.bounds, 1 + left.max(right))
        }
        let (nodes, order) = build_boxes(bounds);
        let mut slots = Vec::new();
        let (_, height) = visit(&nodes, 0, &nodes[0].bounds, &mut slots);
        assert!(slots.into_iter().eq(0..bounds.len() as u32), "each slot in one leaf, in order");
        for node in nodes.iter().filter(|node| node.is_leaf()) {
            let ids = &order[node.first() as usize..][..node.count() as usize];
            let union = ids.iter().fold(Aabb::EMPTY, |b, &id| b.union(bounds[id as usize]));
            assert_eq!(union, node.bounds, "a leaf fits its primitives");
        }
        let mut ids = order;
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..bounds.len() as u32), "each primitive in one slot");
        height
    }

    #[test]
    fn every_primitive_lies_in_one_leaf_and_every_box_fits() {
        for (_, scene) in zoo() {
            let bounds: Vec<_> = scene.iter().map(TestPrimitive::bounds).collect();
            assert!(check(&bounds) <= MAX_DEPTH);
        }
        check(&boxes(20_000));
        // This is enough for several chunks that are partitioned separately.
        check(&boxes(5 * CHUNK + 17));
    }

    #[test]
    fn centers_that_coincide_are_halved() {
        assert_eq!(check(&vec![Aabb::from_points([Vec3::ONE]); 1 << 18]), 16);
    }

    #[test]
    fn the_height_is_bounded_when_every_split_takes_one() {
        // Each box is far larger than all boxes before it together.
        let chain: Vec<Aabb> = (0..250)
            .map(|i| f32::from_bits((i + 2) << 23))
            .flat_map(|s| [Aabb::from_points([Vec3::splat(s), Vec3::splat(1.1 * s)]); 40])
            .collect();
        let height = check(&chain);
        assert!((20..=MAX_DEPTH).contains(&height), "{height}");
    }

    #[test]
    fn trees_depend_neither_on_threads_nor_on_instructions() {
        // This is enough for the bins of the first levels and the medians to be computed in parallel.
        let even = boxes(7 * CHUNK + 5);
        let mut scaled = even.clone();
        for (i, bounds) in (0..).zip(&mut scaled) {
            let scale = f32::from_bits((27 + i % 200) << 23);
            *bounds = Aabb { min: bounds.min * scale, max: bounds.max * scale };
        }
        assert!((20..=MAX_DEPTH).contains(&check(&scaled)));
        for bounds in [even, scaled] {
            let build = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| Bvh::build(&bounds).unwrap())
            };
            let one = build(1);
            for set in InstructionSet::available() {
                set.limit();
                assert!(build(2) == one, "{set:?}");
            }
            for threads in [2, 3, 7] {
                assert!(build(threads) == one, "{threads} threads");
            }
        }
    }

    #[test]
    fn boxes_as_large_as_numbers_are_split_by_their_areas() {
        for power in [-149, -126, -60, 0, 100, 126, 127] {
            let size = (2f64.powi(power) * if power == 127 { 1.999 } else { 1.0 }) as f32;
            // The boxes are equal at every size, except for the sign of zero and for bits lost below the smallest
            // number.
            let bounds: Vec<Aabb> = (0..300)
                .map(|i| {
                    let place = Vec3::new((i % 10) as f32, (i / 10 % 5) as f32, (i / 50) as f32) * 0.2 - 1.0;
                    Aabb { min: place * size, max: (place + 0.1) * size }
                })
                .collect();
            assert!(check(&bounds) <= MAX_DEPTH);
            let whole = PrimRefs::new(1, &|_| Aabb { min: Vec3::splat(-size), max: Vec3::splat(size) }).unwrap();
            let root = *whole.list[0].bounds();
            let area = root.half_area(root.scale());
            assert!(area.is_finite() && (area > 1.0 || power < -125), "2^{power}: {area}");
            let tree = Bvh::build(&bounds).unwrap().statistics();
            assert!(tree.leaves >= 75 && tree.depth < 10, "2^{power}: {tree:?}");
        }
    }

    #[test]
    fn the_sign_of_zero_makes_no_difference() {
        let [mut a, mut b] = [boxes(100), boxes(100)];
        for (a, b) in a.iter_mut().zip(&mut b) {
            a.min.x = 0.0_f32.min(a.min.x);
            (a.max.x, b.max.x) = (0.0, -0.0);
            b.min.x = a.min.x;
        }
        let bits = |bounds: &[Aabb]| format!("{:?}", Bvh::build(bounds).unwrap());
        assert_eq!(bits(&a), bits(&b));
    }

    #[test]
    fn a_bad_box_is_named() {
        let bad = [
            (Vec3::NAN, Vec3::ONE),
            (Vec3::ZERO, Vec3::new(0.0, f32::INFINITY, 0.0)),
            (Vec3::new(0.0, 0.0, f32::NEG_INFINITY), Vec3::ONE),
            (Vec3::ZERO, Vec3::new(1.0, 1.0, -1.0)),
        ];
        for (min, max) in bad {
            let mut bounds = boxes(1000);
            bounds[500] = Aabb { min, max };
            bounds[700] = Aabb::EMPTY;
            match Bvh::build(&bounds) {
                Err(BuildError::InvalidBox { index, .. }) => assert_eq!(index, 500),
                other => panic!("{other:?}"),
            }
        }
        let error = Bvh::build(&[Aabb::EMPTY]).unwrap_err().to_string();
        assert!(error.starts_with("the box of primitive 0 is not finite or is empty: [inf"), "{error}");
    }

    #[test]
    fn halves_are_found_where_the_gap_is() {
        // Two clusters along y: the root's children must be the clusters.
        let cluster = |y: f32| (0..10).map(move |i| Aabb::from_points([Vec3::new(i as f32, y, 0.0)]));
        let (nodes, _) = build_boxes(&cluster(0.0).chain(cluster(1000.0)).collect::<Vec<_>>());
        let [left, right] = nodes[0].children(0);
        assert_eq!(nodes[left as usize].bounds.max.y, 0.0);
        assert_eq!(nodes[right as usize].bounds.min.y, 1000.0);
    }
}
