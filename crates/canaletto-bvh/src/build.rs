//! Building a binary tree: the surface area heuristic in bins (Wald, "On fast construction of SAH-based bounding
//! volume hierarchies", 2007), top down and in parallel.
//!
//! Nothing depends on the number of threads: both halves of a split are built apart and joined in order, and bins
//! filled apart are merged by counts, minima and maxima.

use glam::Vec3;
use rayon::prelude::*;

use crate::Aabb;

/// The most primitives in a leaf.
pub(crate) const MAX_LEAF: usize = 4;
/// The most levels below the root. Half of them would do for median splits, so the heuristic has the other half to
/// be unbalanced in; with none left, the median it is. Bounds the traversal's stack and the time of the build.
pub(crate) const MAX_DEPTH: u32 = 40;
/// The most primitives: a link packs a leaf's first slot and its length into 31 bits.
pub(crate) const MAX_PRIMITIVES: usize = 1 << 29;
const MAX_BINS: usize = 16;
/// Above it, the halves of a split are built in parallel.
const PARALLEL_BUILD: usize = 4096;
/// Above it, a node's primitives are binned in parallel, in chunks of this size.
const PARALLEL_BINS: usize = 1 << 16;
/// Cost of a node in units of the cost of a primitive.
const NODE_COST: f64 = 1.0;

/// Why there is no tree.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A box has a coordinate that is NaN or infinite, or ends before it starts.
    #[error("the box of primitive {index} is not finite or is empty: {} to {}", .bounds.min, .bounds.max)]
    InvalidBox {
        /// The primitive, the first such.
        index: usize,
        /// Its box.
        bounds: Aabb,
    },
    /// There are too many primitives for one tree.
    #[error("{count} primitives are too many for one tree, the most are {MAX_PRIMITIVES}")]
    TooManyPrimitives {
        /// How many there are.
        count: usize,
    },
}

/// A node of a binary tree in depth-first order, where the left child comes next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binary {
    pub(crate) bounds: Aabb,
    /// The first slot of a leaf; the distance to the right child of a node.
    pub(crate) link: u32,
    /// Primitives in a leaf; 0 for a node.
    pub(crate) count: u32,
}

impl Binary {
    pub(crate) fn is_leaf(&self) -> bool {
        self.count > 0
    }

    /// The children of this node, which lies at `index`.
    pub(crate) fn children(&self, index: u32) -> [u32; 2] {
        [index + 1, index + self.link]
    }
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    id: u32,
}

/// The tree and, for each slot, its primitive. A leaf costs as much as the blocks of `block` primitives that it fills, and no
/// leaf of one block is split.
pub(crate) fn build(bounds: &[Aabb], block: usize) -> Result<(Vec<Binary>, Vec<u32>), BuildError> {
    if bounds.len() > MAX_PRIMITIVES {
        return Err(BuildError::TooManyPrimitives { count: bounds.len() });
    }
    if let Some(index) = bounds.par_iter().position_first(|b| !b.is_finite() || b.is_empty()) {
        return Err(BuildError::InvalidBox { index, bounds: bounds[index] });
    }
    // Adding 0 turns -0 into 0, of which minima would keep either, as it happens.
    let mut items: Vec<Item> = bounds
        .par_iter()
        .enumerate()
        .map(|(id, b)| Item { bounds: Aabb { min: b.min + 0.0, max: b.max + 0.0 }, id: id as u32 })
        .collect();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        subdivide(&mut items, 0, 0, block, &mut nodes);
    }
    Ok((nodes, items.par_iter().map(|item| item.id).collect()))
}

/// Appends the tree over `items`, whose first slot is `first`.
fn subdivide(items: &mut [Item], first: u32, depth: u32, block: usize, nodes: &mut Vec<Binary>) {
    let extent = Extent::of(items);
    let index = nodes.len();
    nodes.push(Binary { bounds: extent.bounds, link: first, count: items.len() as u32 });
    let Some(middle) = split(items, &extent, depth, block) else {
        return;
    };
    let (left, right) = items.split_at_mut(middle);
    let right_first = first + middle as u32;
    if left.len() + right.len() > PARALLEL_BUILD {
        let (mut left_nodes, mut right_nodes) = (Vec::new(), Vec::new());
        rayon::join(
            || subdivide(left, first, depth + 1, block, &mut left_nodes),
            || subdivide(right, right_first, depth + 1, block, &mut right_nodes),
        );
        nodes.append(&mut left_nodes);
        nodes[index].link = (nodes.len() - index) as u32;
        nodes.append(&mut right_nodes);
    } else {
        subdivide(left, first, depth + 1, block, nodes);
        nodes[index].link = (nodes.len() - index) as u32;
        subdivide(right, right_first, depth + 1, block, nodes);
    }
    nodes[index].count = 0;
}

/// Reorders `items` into two parts and tells where the second starts, or None for a leaf.
fn split(items: &mut [Item], extent: &Extent, depth: u32, block: usize) -> Option<usize> {
    let n = items.len();
    // Levels that median splits down to single primitives still need: ⌈log₂ n⌉.
    let needed = usize::BITS - (n - 1).leading_zeros();
    if depth + needed >= MAX_DEPTH {
        return (n > MAX_LEAF).then(|| split_at_median(items, extent));
    }
    if n <= block {
        return None;
    }
    let Some(plan) = Plan::best(items, extent, block) else {
        // Centers that coincide: any halves are as good.
        return (n > MAX_LEAF).then_some(n / 2);
    };
    let area = extent.bounds.half_area();
    if n <= MAX_LEAF && NODE_COST * area + plan.cost >= n.div_ceil(block) as f64 * area {
        return None;
    }
    Some(partition(items, |item| plan.grid.bin(item, plan.axis) < plan.bin))
}

fn split_at_median(items: &mut [Item], extent: &Extent) -> usize {
    let size = extent.centers.max - extent.centers.min;
    let axis = size.max_position();
    let middle = items.len() / 2;
    let key = |item: &Item| item.bounds.center()[axis];
    items.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.id.cmp(&b.id)));
    middle
}

/// Moves the items for which `left` holds to the front and tells how many they are.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut start = 0;
    let mut end = items.len();
    loop {
        while start < end && left(&items[start]) {
            start += 1;
        }
        while start < end && !left(&items[end - 1]) {
            end -= 1;
        }
        if start == end {
            return start;
        }
        items.swap(start, end - 1);
    }
}

/// `Aabb::union` for boxes known to hold no NaN.
fn join(a: Aabb, b: Aabb) -> Aabb {
    Aabb { min: a.min.min(b.min), max: a.max.max(b.max) }
}

/// The box around some items, and that around their centers.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Aabb,
    centers: Aabb,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, centers: Aabb::EMPTY };

    fn of(items: &[Item]) -> Self {
        if items.len() > PARALLEL_BINS {
            return items.par_chunks(PARALLEL_BINS).map(Self::of).reduce(|| Self::EMPTY, Self::merge);
        }
        items.iter().fold(Self::EMPTY, |extent, item| {
            let center = item.bounds.center();
            extent.merge(Self { bounds: item.bounds, centers: Aabb { min: center, max: center } })
        })
    }

    fn merge(self, other: Self) -> Self {
        Self { bounds: join(self.bounds, other.bounds), centers: join(self.centers, other.centers) }
    }
}

/// Where a center falls among equal bins along each axis.
#[derive(Clone, Copy)]
struct Grid {
    origin: Vec3,
    scale: Vec3,
    bins: usize,
}

impl Grid {
    /// A size of 0 or too small to divide by makes the scale infinite, and one too large makes it 0: fewer bins or
    /// one are used then, since a float becomes an integer by saturation, NaN becoming 0.
    fn new(centers: &Aabb, bins: usize) -> Self {
        Self { origin: centers.min, scale: bins as f32 / (centers.max - centers.min), bins }
    }

    #[inline]
    fn bin(&self, item: &Item, axis: usize) -> usize {
        let x = (item.bounds.center()[axis] - self.origin[axis]) * self.scale[axis];
        (x as usize).min(self.bins - 1)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, count: 0 };

    fn merge(self, other: Self) -> Self {
        Self { bounds: join(self.bounds, other.bounds), count: self.count + other.count }
    }

    fn cost(&self, block: usize) -> f64 {
        self.bounds.half_area() * self.count.div_ceil(block) as f64
    }
}

type Bins = [[Bin; MAX_BINS]; 3];

fn fill(items: &[Item], grid: &Grid) -> Bins {
    if items.len() > PARALLEL_BINS {
        return items.par_chunks(PARALLEL_BINS).map(|chunk| fill(chunk, grid)).reduce(
            || [[Bin::EMPTY; MAX_BINS]; 3],
            |mut a, b| {
                for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
                    *a = a.merge(*b);
                }
                a
            },
        );
    }
    let mut bins = [[Bin::EMPTY; MAX_BINS]; 3];
    for item in items {
        for (axis, bins) in bins.iter_mut().enumerate() {
            let bin = &mut bins[grid.bin(item, axis)];
            *bin = bin.merge(Bin { bounds: item.bounds, count: 1 });
        }
    }
    bins
}

/// A split: items whose bin along `axis` lies below `bin` go left.
struct Plan {
    grid: Grid,
    axis: usize,
    bin: usize,
    /// Sum over both sides of area times blocks.
    cost: f64,
}

impl Plan {
    /// The cheapest split, of equal ones the first. None if all centers fall into one bin.
    fn best(items: &[Item], extent: &Extent, block: usize) -> Option<Self> {
        let grid = Grid::new(&extent.centers, items.len().clamp(4, MAX_BINS));
        let bins = fill(items, &grid);
        let mut best: Option<Self> = None;
        for (axis, bins) in bins.iter().enumerate() {
            let bins = &bins[..grid.bins];
            let mut right_costs = [0.0; MAX_BINS];
            let mut right = Bin::EMPTY;
            for i in (1..bins.len()).rev() {
                right = right.merge(bins[i]);
                right_costs[i] = right.cost(block);
            }
            let mut left = Bin::EMPTY;
            for i in 1..bins.len() {
                left = left.merge(bins[i - 1]);
                if left.count == 0 || left.count == items.len() {
                    continue;
                }
                let cost = left.cost(block) + right_costs[i];
                if best.as_ref().is_none_or(|best| cost < best.cost) {
                    best = Some(Self { grid, axis, bin: i, cost });
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bvh;
    use crate::testing::{Primitive, Random, zoo};

    fn boxes(n: usize) -> Vec<Aabb> {
        let random = &mut Random(7);
        (0..n)
            .map(|_| {
                let p = random.vector();
                Aabb::from_points([p, p + 0.01 * random.vector()])
            })
            .collect()
    }

    /// Checks the tree and returns its height.
    fn check(bounds: &[Aabb]) -> u32 {
        fn visit(nodes: &[Binary], index: u32, parent: &Aabb, slots: &mut Vec<u32>) -> (Aabb, u32) {
            let node = &nodes[index as usize];
            assert_eq!(parent.union(node.bounds), *parent);
            if node.is_leaf() {
                assert!(node.count as usize <= MAX_LEAF);
                slots.extend(node.link..node.link + node.count);
                return (node.bounds, 0);
            }
            let [left, right] = node.children(index);
            let (a, left) = visit(nodes, left, &node.bounds, slots);
            let (b, right) = visit(nodes, right, &node.bounds, slots);
            assert_eq!(a.union(b), node.bounds);
            (node.bounds, 1 + left.max(right))
        }
        let (nodes, order) = build(bounds, 1).unwrap();
        let mut slots = Vec::new();
        let (_, height) = visit(&nodes, 0, &nodes[0].bounds, &mut slots);
        assert!(slots.into_iter().eq(0..bounds.len() as u32), "each slot in one leaf, in order");
        for node in nodes.iter().filter(|node| node.is_leaf()) {
            let ids = &order[node.link as usize..][..node.count as usize];
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
            let bounds: Vec<_> = scene.iter().map(Primitive::bounds).collect();
            assert!(check(&bounds) <= MAX_DEPTH);
        }
        check(&boxes(20_000));
    }

    #[test]
    fn centers_that_coincide_are_halved() {
        assert_eq!(check(&vec![Aabb::from_points([Vec3::ONE]); 1 << 18]), 16);
    }

    #[test]
    fn the_height_is_bounded_when_every_split_takes_one() {
        // Each box is far larger than all before it together.
        let chain: Vec<Aabb> = (0..250)
            .map(|i| f32::from_bits((i + 2) << 23))
            .flat_map(|s| [Aabb::from_points([Vec3::splat(s), Vec3::splat(1.1 * s)]); 40])
            .collect();
        let height = check(&chain);
        assert!((20..=MAX_DEPTH).contains(&height), "{height}");
    }

    #[test]
    fn trees_do_not_depend_on_the_number_of_threads() {
        // Enough for the bins of the first levels to be filled in parallel.
        let bounds = boxes(3 * PARALLEL_BINS);
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Bvh::build(&bounds).unwrap())
        };
        let one = build(1);
        for threads in [2, 3, 7] {
            assert!(build(threads) == one, "{threads} threads");
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
        let (nodes, _) = build(&cluster(0.0).chain(cluster(1000.0)).collect::<Vec<_>>(), 1).unwrap();
        let [left, right] = nodes[0].children(0);
        assert_eq!(nodes[left as usize].bounds.max.y, 0.0);
        assert_eq!(nodes[right as usize].bounds.min.y, 1000.0);
    }
}
