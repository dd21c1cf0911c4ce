//! The build: a binary tree from the top down, by the heuristic of Conty & Kulla, which is then made wide.

use super::bounds::ClusterBounds;
use glam::DVec3;

/// The number of places along an axis at which a cluster may be split.
const BUCKETS: usize = 12;

/// The depth from which on clusters are halved, so that no tree is deeper than about 100.
const DEEPEST: usize = 64;

/// A node of the binary tree.
pub(super) struct BinaryNode {
    pub(super) bounds: ClusterBounds,
    /// The number of lights.
    pub(super) count: u32,
    pub(super) content: Content,
}

#[derive(Clone, Copy)]
pub(super) enum Content {
    /// The number of the light.
    Light(u32),
    /// The indices of two nodes.
    Pair([u32; 2]),
}

/// The binary tree over these lights, the root last.
pub(super) fn build(lights: &[ClusterBounds]) -> Vec<BinaryNode> {
    let mut builder = Builder { lights, nodes: Vec::with_capacity(2 * lights.len()) };
    let mut order: Vec<u32> = (0..lights.len() as u32).collect();
    if !order.is_empty() {
        builder.node(&mut order, 0);
    }
    builder.nodes
}

struct Builder<'a> {
    lights: &'a [ClusterBounds],
    nodes: Vec<BinaryNode>,
}

impl Builder<'_> {
    /// The index of the node over these lights.
    fn node(&mut self, order: &mut [u32], depth: usize) -> u32 {
        let node = if let [light] = *order {
            BinaryNode { bounds: self.lights[light as usize], count: 1, content: Content::Light(light) }
        } else {
            let middle = self.split(order, depth);
            let (first, second) = order.split_at_mut(middle);
            let pair = [self.node(first, depth + 1), self.node(second, depth + 1)];
            let [a, b] = pair.map(|child| self.nodes[child as usize].bounds);
            BinaryNode { bounds: a.union(b), count: order.len() as u32, content: Content::Pair(pair) }
        };
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Sorts two or more lights into two parts, and returns the number of the first.
    fn split(&self, order: &mut [u32], depth: usize) -> usize {
        let center = |light: &u32| self.lights[*light as usize].center();
        let (min, max) = order
            .iter()
            .map(center)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
        let extent = max - min;
        let bucket = |light: &u32, axis: usize| {
            let place = (center(light)[axis] - min[axis]) / extent[axis] * BUCKETS as f64;
            (place as usize).min(BUCKETS - 1)
        };
        let mut best: Option<(f64, usize, usize)> = None;
        for axis in 0..3 {
            if extent[axis] <= 0.0 || depth >= DEEPEST {
                continue;
            }
            let mut buckets = [ClusterBounds::NONE; BUCKETS];
            for light in order.iter() {
                let bucket = &mut buckets[bucket(light, axis)];
                *bucket = bucket.union(self.lights[*light as usize]);
            }
            let mut above = [0.0; BUCKETS];
            let mut all = ClusterBounds::NONE;
            for (i, bucket) in buckets.iter().enumerate().rev() {
                all = all.union(*bucket);
                above[i] = all.cost();
            }
            // Long boxes are split across (K_r of the paper).
            let shape = extent.max_element() / extent[axis];
            let mut below = ClusterBounds::NONE;
            for i in 1..BUCKETS {
                below = below.union(buckets[i - 1]);
                let cost = shape * (below.cost() + above[i]);
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, i));
                }
            }
        }
        if let Some((_, axis, at)) = best {
            // A stable order is the same on every machine.
            order.sort_by_key(|light| bucket(light, axis) >= at);
            let middle = order.iter().take_while(|light| bucket(light, axis) < at).count();
            if middle > 0 && middle < order.len() {
                return middle;
            }
        }
        let axis = extent.max_position();
        order.sort_by(|a, b| center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(b)));
        order.len() / 2
    }
}
