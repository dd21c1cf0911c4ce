//! Building a binary tree: the surface area heuristic in bins (Wald, "On fast construction of SAH-based bounding
//! volume hierarchies", 2007), top down and in parallel.
//!
//! Nothing depends on the number of threads: both halves of a split are built apart and joined in order, and bins
//! filled apart are merged by counts, minima and maxima.

use glam::Vec3;
use rayon::prelude::*;

use crate::Aabb;

/// The most primitives in a leaf.
const MAX_LEAF: usize = 4;
/// The most levels below the root. Half of them would do for median splits, so the heuristic has the other half to
/// be unbalanced in; with none left, the median it is. Bounds the traversal's stack and the time of the build.
pub(crate) const MAX_DEPTH: u32 = 40;
/// The most primitives: the traversal packs a node and one of its four children into 32 bits.
const MAX_PRIMITIVES: usize = 1 << 30;
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

/// The tree and, for each slot, its primitive.
pub(crate) fn build(bounds: &[Aabb]) -> Result<(Vec<Binary>, Vec<u32>), BuildError> {
    if bounds.len() > MAX_PRIMITIVES {
        return Err(BuildError::TooManyPrimitives {
            count: bounds.len(),
        });
    }
    if let Some(index) = bounds
        .par_iter()
        .position_first(|b| !b.is_finite() || b.is_empty())
    {
        return Err(BuildError::InvalidBox {
            index,
            bounds: bounds[index],
        });
    }
    // Adding 0 turns -0 into 0, of which minima would keep either, as it happens.
    let mut items: Vec<Item> = bounds
        .par_iter()
        .enumerate()
        .map(|(id, b)| Item {
            bounds: Aabb {
                min: b.min + 0.0,
                max: b.max + 0.0,
            },
            id: id as u32,
        })
        .collect();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        subdivide(&mut items, 0, 0, &mut nodes);
    }
    Ok((nodes, items.par_iter().map(|item| item.id).collect()))
}

/// Appends the tree over `items`, whose first slot is `first`.
fn subdivide(items: &mut [Item], first: u32, depth: u32, nodes: &mut Vec<Binary>) {
    let extent = Extent::of(items);
    let index = nodes.len();
    nodes.push(Binary {
        bounds: extent.bounds,
        link: first,
        count: items.len() as u32,
    });
    let Some(middle) = split(items, &extent, depth) else {
        return;
    };
    let (left, right) = items.split_at_mut(middle);
    let right_first = first + middle as u32;
    if left.len() + right.len() > PARALLEL_BUILD {
        let (mut left_nodes, mut right_nodes) = (Vec::new(), Vec::new());
        rayon::join(
            || subdivide(left, first, depth + 1, &mut left_nodes),
            || subdivide(right, right_first, depth + 1, &mut right_nodes),
        );
        nodes.append(&mut left_nodes);
        nodes[index].link = (nodes.len() - index) as u32;
        nodes.append(&mut right_nodes);
    } else {
        subdivide(left, first, depth + 1, nodes);
        nodes[index].link = (nodes.len() - index) as u32;
        subdivide(right, right_first, depth + 1, nodes);
    }
    nodes[index].count = 0;
}

/// Reorders `items` into two parts and tells where the second starts, or None for a leaf.
fn split(items: &mut [Item], extent: &Extent, depth: u32) -> Option<usize> {
    let n = items.len();
    // Levels that median splits down to single primitives still need: ⌈log₂ n⌉.
    let needed = usize::BITS - (n - 1).leading_zeros();
    if depth + needed >= MAX_DEPTH {
        return (n > MAX_LEAF).then(|| split_at_median(items, extent));
    }
    if n == 1 {
        return None;
    }
    let Some(plan) = Plan::best(items, extent) else {
        // Centers that coincide: any halves are as good.
        return (n > MAX_LEAF).then_some(n / 2);
    };
    let area = extent.bounds.half_area();
    if n <= MAX_LEAF && NODE_COST * area + plan.cost >= n as f64 * area {
        return None;
    }
    Some(partition(items, |item| {
        plan.grid.bin(item, plan.axis) < plan.bin
    }))
}

fn split_at_median(items: &mut [Item], extent: &Extent) -> usize {
    let size = extent.centers.max - extent.centers.min;
    let axis = size.max_position();
    let middle = items.len() / 2;
    let key = |item: &Item| item.bounds.center()[axis];
    items.select_nth_unstable_by(middle, |a, b| {
        key(a).total_cmp(&key(b)).then(a.id.cmp(&b.id))
    });
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
    Aabb {
        min: a.min.min(b.min),
        max: a.max.max(b.max),
    }
}

/// The box around some items, and that around their centers.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Aabb,
    centers: Aabb,
}

impl Extent {
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        centers: Aabb::EMPTY,
    };

    fn of(items: &[Item]) -> Self {
        if items.len() > PARALLEL_BINS {
            return items
                .par_chunks(PARALLEL_BINS)
                .map(Self::of)
                .reduce(|| Self::EMPTY, Self::merge);
        }
        items.iter().fold(Self::EMPTY, |extent, item| {
            let center = item.bounds.center();
            extent.merge(Self {
                bounds: item.bounds,
                centers: Aabb {
                    min: center,
                    max: center,
                },
            })
        })
    }

    fn merge(self, other: Self) -> Self {
        Self {
            bounds: join(self.bounds, other.bounds),
            centers: join(self.centers, other.centers),
        }
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
        Self {
            origin: centers.min,
            scale: bins as f32 / (centers.max - centers.min),
            bins,
        }
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
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        count: 0,
    };

    fn merge(self, other: Self) -> Self {
        Self {
            bounds: join(self.bounds, other.bounds),
            count: self.count + other.count,
        }
    }

    fn cost(&self) -> f64 {
        self.bounds.half_area() * self.count as f64
    }
}

type Bins = [[Bin; MAX_BINS]; 3];

fn fill(items: &[Item], grid: &Grid) -> Bins {
    if items.len() > PARALLEL_BINS {
        return items
            .par_chunks(PARALLEL_BINS)
            .map(|chunk| fill(chunk, grid))
            .reduce(
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
            *bin = bin.merge(Bin {
                bounds: item.bounds,
                count: 1,
            });
        }
    }
    bins
}

/// A split: items whose bin along `axis` lies below `bin` go left.
struct Plan {
    grid: Grid,
    axis: usize,
    bin: usize,
    /// Sum over both sides of area times primitives.
    cost: f64,
}

impl Plan {
    /// The cheapest split, of equal ones the first. None if all centers fall into one bin.
    fn best(items: &[Item], extent: &Extent) -> Option<Self> {
        let grid = Grid::new(&extent.centers, items.len().clamp(4, MAX_BINS));
        let bins = fill(items, &grid);
        let mut best: Option<Self> = None;
        for (axis, bins) in bins.iter().enumerate() {
            let bins = &bins[..grid.bins];
            let mut right_costs = [0.0; MAX_BINS];
            let mut right = Bin::EMPTY;
            for i in (1..bins.len()).rev() {
                right = right.merge(bins[i]);
                right_costs[i] = right.cost();
            }
            let mut left = Bin::EMPTY;
            for i in 1..bins.len() {
                left = left.merge(bins[i - 1]);
                if left.count == 0 || left.count == items.len() {
                    continue;
                }
                let cost = left.cost() + right_costs[i];
                if best.as_ref().is_none_or(|best| cost < best.cost) {
                    best = Some(Self {
                        grid,
                        axis,
                        bin: i,
                        cost,
                    });
                }
            }
        }
        best
    }
}
