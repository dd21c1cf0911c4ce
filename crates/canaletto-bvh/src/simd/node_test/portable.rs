//! The baseline node test: two halves of four boxes, as glam and the compiler implement them (SSE2, NEON or scalar
//! code). The test for irregular rays follows below.

use super::{NodeTest, ScalarF64x4, TraversalRay};
use crate::node::{Node, NodeRef};
use crate::simd::Baseline;
use crate::slab::{INFLATE, WIDTH};
use glam::Vec4;

/// Writes the children in the lanes of a mask, from far to near if `ORDERED`.
#[inline(always)]
unsafe fn write<const ORDERED: bool>(
    mask: u32,
    octant: usize,
    node: &Node,
    near: &[f32; WIDTH],
    out: *mut f32,
    node_refs: *mut NodeRef,
) -> (usize, NodeRef) {
    if mask == 0 {
        return (0, NodeRef::END);
    }
    let mut count = 0;
    for (i, ordered) in node.order(octant).enumerate() {
        let lane = if ORDERED { ordered } else { i };
        // SAFETY: the caller has room for eight entries, and before the last lane there are at most seven.
        unsafe {
            if ORDERED {
                *out.add(count) = near[lane];
            }
            *node_refs.add(count) = node.children()[lane];
        }
        count += (mask >> lane & 1) as usize;
    }
    // SAFETY: the mask is not 0, so at least one child was written.
    (count, unsafe { *node_refs.add(count - 1) })
}

impl NodeTest for Baseline {
    type F64x4 = ScalarF64x4;

    #[inline(always)]
    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        out: *mut f32,
        node_refs: *mut NodeRef,
    ) -> (usize, NodeRef) {
        let (origins, ray) = (ray.origins(), ray.ray());
        let mut near = [0.0; WIDTH];
        let mut mask = 0;
        for half in 0..2 {
            let cross = |side: u8, axis: usize, origin: f32| {
                let planes = Vec4::from_slice(&node.boxes[usize::from(side & 1)][axis][4 * half..]);
                (Vec4::splat(origin) - planes) * Vec4::splat(ray.neg_reciprocal[axis])
            };
            let enter = |axis: usize| cross(ray.axis_order.octant >> axis, axis, origins[0][axis]);
            let leave = |axis: usize| cross(!ray.axis_order.octant >> axis, axis, origins[1][axis]);
            let n = enter(0).max(enter(1)).max(enter(2).max(Vec4::ZERO));
            let f = leave(0).min(leave(1)).min(leave(2)) * INFLATE;
            near[4 * half..4 * half + 4].copy_from_slice(&n.to_array());
            // Two comparisons, since the minimum with NaN differs between machines.
            mask |= (n.cmple(f) & n.cmple(Vec4::splat(limit))).bitmask() << (4 * half);
        }
        // SAFETY: the caller's promise.
        unsafe { write::<ORDERED>(mask, usize::from(ray.axis_order.octant), node, &near, out, node_refs) }
    }
}

/// The node test for rays that are not regular: an axis has a direction of 0 or nearly 0, or the origin is not finite.
/// It tests the boxes one by one.
#[derive(Clone, Copy)]
pub(crate) struct IrregularNodeTest;

impl NodeTest for IrregularNodeTest {
    type F64x4 = ScalarF64x4;

    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        out: *mut f32,
        node_refs: *mut NodeRef,
    ) -> (usize, NodeRef) {
        ray.visited();
        let mut near = [0.0; WIDTH];
        let mut mask = 0;
        for (lane, near) in near.iter_mut().enumerate() {
            let (enter, leave) = ray.ray().clip_irregular(&ray.inflate(node.get_box(lane)), limit);
            *near = enter;
            mask |= u32::from(enter <= leave) << lane;
        }
        // SAFETY: the caller's promise.
        unsafe { write::<ORDERED>(mask, usize::from(ray.ray().axis_order.octant), node, &near, out, node_refs) }
    }
}
