//! The bounding volume hierarchy and its traversal.

use std::ops::Range;

use crate::build::{self, BuildError, MAX_DEPTH};
use crate::node::{INNER, Node, Statistics, collapse};
use crate::slab::Slabs;
use crate::{Aabb, Ray};

/// A tree of boxes over primitives that the caller keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
    bounds: Aabb,
}

/// A child to visit.
#[derive(Clone, Copy, Default)]
struct Entry {
    near: f32,
    /// 4 × node + lane.
    link: u32,
}

/// A visit takes one entry off the stack and puts four on it at most.
const STACK: usize = 3 * MAX_DEPTH as usize + 1;

impl Bvh {
    /// Builds the tree over `bounds`, one box per primitive, in parallel; the tree does not depend on the number of
    /// threads. Boxes may be flat and may coincide.
    pub fn build(bounds: &[Aabb]) -> Result<Self, BuildError> {
        let (binary, order) = build::build(bounds)?;
        let bounds = binary.first().map_or(Aabb::EMPTY, |root| root.bounds);
        Ok(Self {
            nodes: collapse(&binary),
            order,
            bounds,
        })
    }

    /// From slot to primitive: the caller permutes its primitives into this order.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The box around all primitives.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What the tree is like. Visits all nodes.
    pub fn statistics(&self) -> Statistics {
        Statistics::of(&self.nodes, &self.bounds, self.order.len())
    }

    /// Calls `leaf` for the leaves that `ray` meets within (0, t_max], roughly from near to far, with a range of
    /// slots and the current t_max, which it lowers to the nearest hit that it finds.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32, mut leaf: impl FnMut(Range<u32>, &mut f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut t_max = t_max;
        let slabs = Slabs::new(ray);
        let mut stack = [Entry::default(); STACK];
        let mut len = 0;
        let mut index = 0;
        loop {
            let (near, far) = slabs.clip(&self.nodes[index as usize].boxes, t_max);
            let mut met = near.cmple(far).bitmask();
            let near = near.to_array();
            let base = len;
            // The nearest goes on top; of equally near ones the lower lane.
            while met != 0 {
                let lane = met.trailing_zeros();
                met &= met - 1;
                let entry = Entry {
                    near: near[lane as usize],
                    link: 4 * index + lane,
                };
                let mut i = len;
                while i > base && stack[i - 1].near <= entry.near {
                    stack[i] = stack[i - 1];
                    i -= 1;
                }
                stack[i] = entry;
                len += 1;
            }
            loop {
                if len == 0 {
                    return;
                }
                len -= 1;
                let Entry { near, link } = stack[len];
                if !Slabs::within(near, t_max) {
                    continue;
                }
                let (first, count) = self.child(link);
                if count == INNER {
                    index = first;
                    break;
                }
                if count > 0 {
                    leaf(first..first + count, &mut t_max);
                }
            }
        }
    }

    /// Calls `leaf` for the leaves that `ray` meets within (0, t_max], in no particular order, until it answers
    /// that something is hit there.
    #[inline]
    pub fn occluded(
        &self,
        ray: &Ray,
        t_max: f32,
        mut leaf: impl FnMut(Range<u32>) -> bool,
    ) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let slabs = Slabs::new(ray);
        let mut stack = [0; STACK];
        let mut len = 0;
        let mut index = 0;
        loop {
            let (near, far) = slabs.clip(&self.nodes[index as usize].boxes, t_max);
            let mut met = near.cmple(far).bitmask();
            while met != 0 {
                stack[len] = 4 * index + met.trailing_zeros();
                met &= met - 1;
                len += 1;
            }
            loop {
                if len == 0 {
                    return false;
                }
                len -= 1;
                let (first, count) = self.child(stack[len]);
                if count == INNER {
                    index = first;
                    break;
                }
                if count > 0 && leaf(first..first + count) {
                    return true;
                }
            }
        }
    }

    #[inline]
    fn child(&self, link: u32) -> (u32, u32) {
        let node = &self.nodes[(link / 4) as usize];
        let lane = (link % 4) as usize;
        (node.first[lane], node.count[lane])
    }
}
