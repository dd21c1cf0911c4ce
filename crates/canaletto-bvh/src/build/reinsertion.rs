//! Improves a binary tree by reinsertion: again and again, a subtree is removed and inserted where the sum of all node
//! areas becomes least. See Bittner, Hapala and Havran, "Fast insertion-based optimization of bounding volume
//! hierarchies", 2013, and Meister and Bittner, "Parallel reinsertion for bounding volume hierarchy optimization",
//! 2018.
//!
//! Places are searched in parallel in a tree that doesn't change. Then the moves are made one after another, those of
//! largest gain first. Moves whose surroundings have changed since are skipped. The tree therefore does not depend on
//! the number of threads.

use canaletto_parallel::prelude::*;

use super::prim_ref::Box8;
use super::widen;
use super::{BinaryNode, CHUNK, CostModel};
use crate::node::MAX_DEPTH;

/// A node of the tree under change. The root is the first node.
struct Node {
    bounds: Box8,
    parent: u32,
    /// The children; None for a leaf.
    children: Option<[u32; 2]>,
}

/// A move: the subtree `from` becomes the sibling of the node `to`.
struct Move {
    from: u32,
    to: u32,
    gain: f32,
}

/// The largest number of rounds.
const ROUNDS: usize = 8;
/// A round that removes less than this fraction of the total area is the last.
const LEAST_GAIN: f64 = 0.01;
/// A round considers one node in so many, the largest ones, as most of the cost is theirs.
const FRACTION: usize = 8;
/// Nodes with less than this fraction of the mean area aren't considered either. Where sizes vary widely, a few nodes
/// have nearly all of the cost.
const LEAST_AREA: f64 = 0.05;
/// The largest number of nodes that a search visits. Few searches visit as many, but among nested boxes each search
/// would visit all nodes.
const MAX_VISITS: usize = 128;
/// The largest number of levels of the binary tree. It bounds recursion.
const MAX_HEIGHT: u32 = 500;

/// Improves a tree if possible. The tree stays unchanged if it would cost more, or become deeper than the traversal
/// stack allows. The leaves keep their contents.
pub(super) fn optimize(binary: &mut Vec<BinaryNode>, cost_model: &CostModel) {
    if binary.len() < 7 {
        return;
    }
    let mut tree = Tree { nodes: nodes(binary), scale: cost_model.scale };
    let mut touched = vec![false; tree.nodes.len()];
    let whole_area = tree.whole_area();
    let least_area = (LEAST_AREA * whole_area / tree.nodes.len() as f64) as f32;
    for _ in 0..ROUNDS {
        if tree.round(least_area, &mut touched) <= LEAST_GAIN * whole_area {
            break;
        }
    }
    let mut new = Vec::with_capacity(binary.len());
    if tree.flatten(0, binary, &mut new, 0) {
        // The cost that matters in the end is that of the wide nodes.
        if widen::all(&mut new, cost_model) < widen::all(binary, cost_model) && widen::depth(&new) <= MAX_DEPTH {
            *binary = new;
        }
    }
}

fn nodes(binary: &[BinaryNode]) -> Vec<Node> {
    let node = |node: &BinaryNode| Node { bounds: Box8::new(&node.bounds, [0.0; 2]), parent: 0, children: None };
    let mut nodes: Vec<Node> = binary.par_iter().map(node).collect();
    for (index, node) in (0..).zip(binary).filter(|(_, node)| !node.is_leaf()) {
        let children = node.children(index);
        nodes[index as usize].children = Some(children);
        children.iter().for_each(|&child| nodes[child as usize].parent = index);
    }
    nodes
}

struct Tree {
    nodes: Vec<Node>,
    scale: f32,
}

impl Tree {
    fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    fn area(&self, index: u32) -> f32 {
        self.node(index).bounds.half_area(self.scale)
    }

    /// The area of all nodes. It is summed by fixed chunks, since the bits of a sum depend on its order.
    fn whole_area(&self) -> f64 {
        let area = |node: &Node| f64::from(node.bounds.half_area(self.scale));
        let sums: Vec<f64> = self.nodes.par_chunks(CHUNK).map(|chunk| chunk.iter().map(area).sum()).collect();
        sums.into_iter().sum()
    }

    fn sibling(&self, index: u32) -> u32 {
        match self.node(self.node(index).parent).children {
            Some([left, right]) => left ^ right ^ index,
            None => index,
        }
    }

    /// Finds moves of nodes with at least the area `least_area`, and makes them. Returns the area that the moves were
    /// to remove. `touched` is scratch memory.
    fn round(&mut self, least_area: f32, touched: &mut [bool]) -> f64 {
        let mut largest: Vec<(f32, u32)> = (1..self.nodes.len())
            .into_par_iter()
            .map(|index| (self.area(index as u32), index as u32))
            // Children of the root can't be moved.
            .filter(|&(area, index)| area >= least_area && self.node(index).parent != 0)
            .collect();
        let count = (self.nodes.len() / FRACTION).clamp(1, largest.len().max(1));
        if largest.len() > count {
            let order = |a: &(f32, u32), b: &(f32, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
            largest.select_nth_unstable_by(count - 1, order);
            largest.truncate(count);
        }
        let mut moves: Vec<Move> = largest.par_iter().filter_map(|&(_, index)| self.find(index)).collect();
        let order = |a: &Move, b: &Move| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from));
        rayon::slice::ParallelSliceMut::par_sort_unstable_by(&mut *moves, order);
        touched.fill(false);
        self.apply(moves, touched)
    }

    /// Makes moves that were all found before the first is made. Moves whose surroundings have changed since are
    /// skipped. Returns the area that the moves made were to remove. No node is `touched` yet.
    fn apply(&mut self, moves: Vec<Move>, touched: &mut [bool]) -> f64 {
        let mut gained = 0.0;
        for Move { from, to, gain } in moves {
            let parent = self.node(from).parent;
            let around = [from, self.sibling(from), parent, self.node(parent).parent, to, self.node(to).parent];
            // A place that now lies in the subtree itself would make a cycle.
            if around.iter().any(|&index| touched[index as usize]) || self.is_ancestor(from, to) {
                continue;
            }
            around.iter().for_each(|&index| touched[index as usize] = true);
            self.reinsert(from, to);
            gained += f64::from(gain);
        }
        gained
    }

    /// The best place for a subtree, if there is a better one than now. Branch and bound, first below the sibling, then
    /// below the sibling of each ancestor.
    fn find(&self, from: u32) -> Option<Move> {
        let bounds = &self.node(from).bounds;
        let own = bounds.half_area(self.scale);
        let parent = self.node(from).parent;
        let mut best = Move { from, to: from, gain: 0.0 };
        let mut stack = Vec::with_capacity(64);
        // The area saved by removing the subtree, up to the ancestor reached so far.
        let mut saved = self.area(parent);
        let mut sibling = self.sibling(from);
        let mut without = self.node(sibling).bounds;
        let mut pivot = parent;
        let mut visits_left = MAX_VISITS;
        'search: loop {
            stack.push((saved, sibling));
            while let Some((saved, to)) = stack.pop() {
                if visits_left == 0 {
                    break 'search;
                }
                visits_left -= 1;
                // A node around the subtree is at least as large as the subtree.
                if saved - own <= best.gain {
                    continue;
                }
                let node = self.node(to);
                let gain = saved - node.bounds.join(bounds).half_area(self.scale);
                if gain > best.gain && to != parent {
                    (best.to, best.gain) = (to, gain);
                }
                if let Some([left, right]) = node.children {
                    let saved = gain + node.bounds.half_area(self.scale);
                    stack.extend([(saved, left), (saved, right)]);
                }
            }
            if pivot == 0 {
                break;
            }
            if pivot != parent {
                without = without.join(&self.node(sibling).bounds);
                saved += self.area(pivot) - without.half_area(self.scale);
            }
            sibling = self.sibling(pivot);
            pivot = self.node(pivot).parent;
        }
        (best.to != from && best.to != self.sibling(from)).then_some(best)
    }

    /// Whether a node lies in the subtree of another, or is that node.
    fn is_ancestor(&self, ancestor: u32, mut index: u32) -> bool {
        while index != ancestor {
            if index == 0 {
                return false;
            }
            index = self.node(index).parent;
        }
        true
    }

    /// Removes a subtree and makes it the sibling of a node that is not in it. The subtree's old parent becomes the
    /// parent of both.
    fn reinsert(&mut self, from: u32, to: u32) {
        let parent = self.node(from).parent;
        let sibling = self.sibling(from);
        let above = self.node(parent).parent;
        self.replace(above, parent, sibling);
        let other = self.node(to).parent;
        self.replace(other, to, parent);
        self.nodes[parent as usize].children = Some([to, from]);
        self.nodes[to as usize].parent = parent;
        self.refit(above);
        self.refit(parent);
    }

    fn replace(&mut self, parent: u32, old: u32, new: u32) {
        for child in self.nodes[parent as usize].children.iter_mut().flatten() {
            if *child == old {
                *child = new;
            }
        }
        self.nodes[new as usize].parent = parent;
    }

    /// Refits the boxes from a node up to the root.
    fn refit(&mut self, mut index: u32) {
        loop {
            if let Some([left, right]) = self.node(index).children {
                self.nodes[index as usize].bounds = self.node(left).bounds.join(&self.node(right).bounds);
            }
            if index == 0 {
                break;
            }
            index = self.node(index).parent;
        }
    }

    /// Appends the tree at `index`, with the leaves of `old`. Returns false if it is too high.
    fn flatten(&self, index: u32, old: &[BinaryNode], new: &mut Vec<BinaryNode>, depth: u32) -> bool {
        let Some([left, right]) = self.node(index).children else {
            new.push(old[index as usize]);
            return true;
        };
        let at = new.len();
        new.push(BinaryNode { bounds: self.node(index).bounds.aabb(), link: 0, lanes: widen::LaneSplit::LEAF });
        if depth == MAX_HEIGHT || !self.flatten(left, old, new, depth + 1) {
            return false;
        }
        new[at].link = (new.len() - at) as u32;
        // Marks it as an inner node until `widen::all` sets the distribution.
        new[at].lanes = widen::LaneSplit::UNKNOWN;
        self.flatten(right, old, new, depth + 1)
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::{Random, zoo};
    use crate::{Aabb, Bvh, Quality};
    use glam::Vec3;

    fn trees(bounds: &[Aabb]) -> [Bvh; 2] {
        [Quality::Medium, Quality::High].map(|quality| {
            let (bvh, blocks) = Bvh::build_blocks(bounds.len(), |i| bounds[i], quality).unwrap();
            let mut ids: Vec<u32> = (0..blocks.len()).flat_map(|i| blocks.block(i)).copied().collect();
            ids.sort_unstable();
            assert!(ids.into_iter().eq(0..bounds.len() as u32), "each primitive in one block");
            bvh
        })
    }

    /// Two subtrees, each to be put into the other: both moves were found in the unchanged tree.
    #[test]
    fn no_subtree_is_put_into_itself() {
        use super::{Box8, Move, Node, Tree};
        // A full tree of five levels below the root. The children of i are 2 i + 1 and 2 i + 2.
        let node = |i: u32| Node {
            bounds: Box8::new(&Aabb::from_points([Vec3::splat(i as f32)]), [0.0; 2]),
            parent: i.saturating_sub(1) / 2,
            children: (i < 31).then_some([2 * i + 1, 2 * i + 2]),
        };
        let mut tree = Tree { nodes: (0..63).map(node).collect(), scale: 1.0 };
        let (one, other) = (Move { from: 7, to: 61, gain: 2.0 }, Move { from: 14, to: 31, gain: 1.0 });
        assert!(tree.is_ancestor(7, 31) && tree.is_ancestor(14, 61), "each leads into the other");
        let mut touched = vec![false; 63];
        let gained = tree.apply(vec![one, other], &mut touched);
        assert_eq!(gained, 2.0, "the second would have made a cycle");
        for leaf in 31..63 {
            let (mut index, mut steps) = (leaf, 0);
            while index != 0 {
                (index, steps) = (tree.node(index).parent, steps + 1);
                assert!(steps < 63, "a cycle above {leaf}");
            }
        }
    }

    #[test]
    fn beams_across_small_things_are_sorted_out() {
        let random = &mut Random(44);
        let bounds: Vec<Aabb> = (0..20_000)
            .map(|i| {
                let center = (random.vector() * 3.0).round() + 0.1 * random.vector();
                let mut size = Vec3::splat(0.004);
                size[i % 3] = if i % 20 == 0 { 3.0 } else { 0.004 };
                Aabb::from_points([center - size, center + size])
            })
            .collect();
        let [medium, high] = trees(&bounds).map(|tree| tree.statistics());
        assert!(high.sah_cost < 0.95 * medium.sah_cost, "{high:?} {medium:?}");
        assert_eq!(high.leaves, medium.leaves);
    }

    #[test]
    fn no_tree_of_the_zoo_becomes_worse_or_too_deep() {
        for (name, scene) in zoo() {
            let bounds: Vec<Aabb> = scene.iter().map(crate::testing::TestPrimitive::bounds).collect();
            let [medium, high] = trees(&bounds).map(|tree| tree.statistics());
            assert!(high.depth <= crate::node::MAX_DEPTH as usize, "{name}");
            assert!(high.sah_cost <= 1.01 * medium.sah_cost, "{name}: {high:?} {medium:?}");
        }
        // Each box is far larger than all boxes before it together.
        let chain: Vec<Aabb> = (0..250)
            .map(|i| f32::from_bits((i + 2) << 23))
            .flat_map(|s| [Aabb::from_points([Vec3::splat(s), Vec3::splat(1.1 * s)]); 40])
            .collect();
        assert!(trees(&chain)[1].statistics().depth <= crate::node::MAX_DEPTH as usize);
    }

    #[test]
    fn trees_do_not_depend_on_threads() {
        let random = &mut Random(45);
        let bounds: Vec<Aabb> = (0..9000)
            .map(|_| [random.vector(), 0.1 * random.vector()])
            .map(|[p, d]| Aabb::from_points([p, p + d]))
            .collect();
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Bvh::build_blocks(bounds.len(), |i| bounds[i], Quality::High).unwrap().0)
        };
        let one = build(1);
        for threads in [2, 5] {
            assert!(build(threads) == one);
        }
    }
}
