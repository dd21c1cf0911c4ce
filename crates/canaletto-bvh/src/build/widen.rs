//! Finds how to turn a binary tree into wide nodes. For each subtree and each number of lanes that it may use, it finds
//! the least cost and how many of the lanes go to the left child. See Ylitie, Karras and Laine, "Efficient incoherent
//! ray traversal on GPUs through compressed wide BVHs", 2017, section 3.1.
//!
//! A node costs its area, since all of its boxes are tested at once; so does a block of primitives. The costs of a
//! subtree are needed only until the costs of its parent are known. The distributions of lanes are kept, in three bits
//! for each number of lanes.

use bytemuck::Zeroable;

use super::BinaryNode;
use super::binning::CostModel;
use super::prim_ref::Box8;
use crate::slab::WIDTH;

/// The least costs of a subtree that may use one lane, two, … up to eight.
pub(super) type Costs = [f32; WIDTH];

/// The distribution of lanes over two children, see [`LaneSplit::left`].
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub(crate) struct LaneSplit(u32);

impl LaneSplit {
    /// The value for a leaf, which uses a single lane.
    pub(super) const LEAF: Self = Self(0);
    /// The value for an inner node whose costs are not known or not finite.
    pub(super) const UNKNOWN: Self = Self(1);

    /// If this node may use `lanes` lanes, from 2 to 8: the number of them for its left child. The right child gets the
    /// rest. None means that the node uses one lane, as a wide node of its own. All eight lanes of an inner node are
    /// always distributed, so that no wide node is its own child.
    pub(crate) fn left(self, lanes: usize) -> Option<usize> {
        let left = (self.0 >> (3 * (lanes - 2))) as usize & 7;
        let left = if lanes == WIDTH && self != Self::LEAF { left.max(1) } else { left };
        (left > 0).then_some(left)
    }
}

/// The costs of a leaf, equal for any number of lanes.
pub(super) fn leaf(cost: f32) -> Costs {
    [cost; WIDTH]
}

/// Finds the distributions of a whole tree, and returns its cost.
pub(super) fn all(binary: &mut [BinaryNode], cost_model: &CostModel) -> f32 {
    let mut costs = vec![[0.0; WIDTH]; binary.len()];
    // Children come later in the list than their parents.
    for index in (0..binary.len()).rev() {
        let node = &mut binary[index];
        let bounds = Box8::new(&node.bounds, [0.0; 2]);
        if node.is_leaf() {
            costs[index] = leaf(cost_model.cost(&bounds, node.count()));
        } else {
            let [left, right] = node.children(index as u32);
            let (least, lanes) = join(cost_model.node(&bounds), &costs[left as usize], &costs[right as usize]);
            costs[index] = least;
            node.lanes = lanes;
        }
    }
    costs[0][0]
}

/// The largest number of wide nodes on a path to a leaf.
pub(super) fn depth(binary: &[BinaryNode]) -> u32 {
    // For each subtree: the lanes that it may use, and the number of wide nodes above.
    let mut given = vec![(WIDTH, 1); binary.len()];
    let mut deepest = 0;
    for (index, node) in binary.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
        let (mut lanes, mut depth) = given[index];
        if lanes == 1 || node.left_lanes(lanes).is_none() {
            (lanes, depth) = (WIDTH, depth + 1);
        }
        let [left, right] = node.children(index as u32);
        let to_left = node.left_lanes(lanes).unwrap_or(1);
        given[left as usize] = (to_left, depth);
        given[right as usize] = (lanes - to_left, depth);
        deepest = deepest.max(depth);
    }
    deepest
}

crate::instruction_set::compiled_wide! {
    /// The costs of a node whose own cost is `own`, and the distributions that give them. Costs that are not finite
    /// give some valid distribution.
    pub(super) fn join(own: f32, left: &Costs, right: &Costs) -> (Costs, LaneSplit) {
        // The costs of the right child behind a row of infinities, so that a window shows them shifted.
        let mut moved = [f32::INFINITY; 2 * WIDTH];
        moved[WIDTH..].copy_from_slice(right);
        let (mut least, mut ways) = ([f32::INFINITY; WIDTH], [0u32; WIDTH]);
        for lanes in 1..WIDTH {
            let window = &moved[WIDTH - lanes..][..WIDTH];
            for i in 0..WIDTH {
                let cost = left[lanes - 1] + window[i];
                let better = cost < least[i];
                least[i] = if better { cost } else { least[i] };
                ways[i] = if better { lanes as u32 } else { ways[i] };
            }
        }
        let mut way = ways[WIDTH - 1] << (3 * (WIDTH - 2));
        least[0] = least[WIDTH - 1] + own;
        // If one lane less has an equal cost, its distribution is kept. The additional lane goes to the right child and
        // costs nothing.
        let mut before = 0;
        for i in 1..WIDTH - 1 {
            if least[i] < least[i - 1] {
                before = ways[i];
            } else {
                least[i] = least[i - 1];
            }
            way |= before << (3 * (i - 1));
        }
        (least, LaneSplit(way.max(LaneSplit::UNKNOWN.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    /// A tree with the cost of each single node and leaf.
    enum Tree {
        Leaf(f32),
        Node(f32, Box<[Tree; 2]>),
    }

    fn random_tree(leaves: usize, random: &mut Random) -> Tree {
        // Whole numbers, which sum up exactly in any order.
        let cost = random.below(1000) as f32;
        if leaves == 1 {
            return Tree::Leaf(cost);
        }
        let left = 1 + random.below(leaves - 1);
        Tree::Node(cost, Box::new([random_tree(left, random), random_tree(leaves - left, random)]))
    }

    /// The least cost in at most so many lanes, by trying all distributions.
    fn least(tree: &Tree, lanes: usize) -> f32 {
        let shared = |halves: &[Tree; 2], lanes: usize| {
            (1..lanes).map(|k| least(&halves[0], k) + least(&halves[1], lanes - k)).fold(f32::INFINITY, f32::min)
        };
        match tree {
            Tree::Leaf(cost) => *cost,
            Tree::Node(cost, halves) => (cost + shared(halves, WIDTH)).min(shared(halves, lanes)),
        }
    }

    fn costs(tree: &Tree) -> (Costs, Option<LaneSplit>) {
        match tree {
            Tree::Leaf(cost) => (leaf(*cost), None),
            Tree::Node(cost, halves) => {
                let (costs, lanes) = join(*cost, &costs(&halves[0]).0, &costs(&halves[1]).0);
                (costs, Some(lanes))
            }
        }
    }

    /// The cost of the distributions that were kept.
    fn cost_of_ways(tree: &Tree, lanes: usize) -> f32 {
        let Tree::Node(cost, halves) = tree else { return costs(tree).0[0] };
        let ways = costs(tree).1.unwrap();
        let shared = |lanes: usize, k: usize| cost_of_ways(&halves[0], k) + cost_of_ways(&halves[1], lanes - k);
        match if lanes == 1 { None } else { ways.left(lanes) } {
            Some(left) => shared(lanes, left),
            None => cost + shared(WIDTH, ways.left(WIDTH).unwrap()),
        }
    }

    #[test]
    fn costs_that_are_not_finite_are_shared_out_too() {
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1.0, 0.0];
        let random = &mut Random(42);
        for _ in 0..100_000 {
            let mut costs = || std::array::from_fn(|_| strange[random.below(strange.len())]);
            let (left, right): (Costs, Costs) = (costs(), costs());
            let own = strange[random.below(strange.len())];
            let (_, ways) = join(own, &left, &right);
            assert!(ways != LaneSplit::LEAF && ways.left(WIDTH).is_some());
            for lanes in 2..=WIDTH {
                assert!(ways.left(lanes).is_none_or(|left| (1..lanes).contains(&left)), "{lanes} {ways:?}");
            }
        }
        assert!((2..=WIDTH).all(|lanes| LaneSplit::LEAF.left(lanes).is_none()));
    }

    #[test]
    fn no_way_to_share_lanes_is_cheaper() {
        let random = &mut Random(41);
        for n in 2..14 {
            for _ in 0..6 {
                let tree = random_tree(n, random);
                for lanes in 1..WIDTH {
                    assert_eq!(costs(&tree).0[lanes - 1], least(&tree, lanes));
                    assert_eq!(cost_of_ways(&tree, lanes), least(&tree, lanes), "{n} leaves in {lanes} lanes");
                }
            }
        }
    }
}
