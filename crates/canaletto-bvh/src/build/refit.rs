//! Fits the boxes of a finished tree to moved primitives.

use canaletto_parallel::prelude::*;

use crate::Aabb;
use crate::node::{Child, Node};
use crate::slab::WIDTH;

/// Refits all boxes, given the box of each leaf, and returns the box around all.
pub(crate) fn refit(nodes: &mut [Node], leaf: &(dyn Fn(u32) -> Aabb + Sync)) -> Aabb {
    nodes.par_iter_mut().for_each(|node| {
        for lane in 0..WIDTH {
            if let Some(Child::Leaf(of_lane)) = node.children()[lane].decode() {
                node.set_box(lane, &leaf(of_lane.first()));
            }
        }
    });
    // Children come later in the list than their parents.
    for index in (0..nodes.len()).rev() {
        for lane in 0..WIDTH {
            if let Some(Child::Node(child)) = nodes[index].children()[lane].decode() {
                let bounds = nodes[child].bounds();
                nodes[index].set_box(lane, &bounds);
            }
        }
    }
    nodes.par_iter_mut().for_each(Node::compute_orders);
    nodes.first().map_or(Aabb::EMPTY, Node::bounds)
}
