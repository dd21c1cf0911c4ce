//! The node test with AVX2: all eight boxes at once. A table of permutations compacts the entered children.

use super::{AvxF64x4, NodeTest, TraversalRay};
use crate::PreparedRay;
use crate::lanes::SET_LANES;
use crate::node::{Node, NodeRef};
use crate::simd::Avx2;
use crate::slab::INFLATE;
use std::arch::x86_64::*;

/// The end of the interval in which a box is entered. With this argument order a NaN is kept, so that the box is not
/// entered.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn end(far: __m256, limit: f32) -> __m256 {
    _mm256_min_ps(_mm256_set1_ps(limit), _mm256_mul_ps(far, _mm256_set1_ps(INFLATE)))
}

/// The lanes of an order word, in the lowest three bits of each element.
#[inline]
#[target_feature(enable = "avx2")]
pub(in crate::simd) fn lanes_of(order: u32) -> __m256i {
    _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21))
}

/// The lanes from far to near for a ray, in the lowest three bits of each element.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn order(node: &Node, ray: &PreparedRay) -> __m256i {
    lanes_of(node.orders[usize::from(ray.axis_order.octant & 7)])
}

/// The distances at which the ray enters and leaves the boxes. The latter are neither inflated nor limited. `origins`
/// are the origins for the entry planes and for the exit planes. In a lane without a child, whose planes are infinite,
/// the ray leaves at −∞ or NaN, whatever the origins.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn clip(node: &Node, ray: &PreparedRay, origins: [&[f32; 3]; 2]) -> (__m256, __m256) {
    // No closures: until they are inlined, closures are functions without the instructions.
    macro_rules! cross {
        ($side:literal, $axis:literal, $planes:expr) => {{
            // SAFETY: at this offset in the boxes lie eight numbers, aligned to their size.
            let planes = unsafe { _mm256_load_ps((&raw const node.boxes).cast::<f32>().byte_add($planes.offset())) };
            _mm256_mul_ps(
                _mm256_sub_ps(_mm256_set1_ps(origins[$side][$axis]), planes),
                _mm256_set1_ps(ray.neg_reciprocal[$axis]),
            )
        }};
    }
    let ([x, y, z], [u, v, w]) = (ray.axis_order.entries, ray.axis_order.exits);
    let enter = [cross!(0, 0, x), cross!(0, 1, y), cross!(0, 2, z)];
    let leave = [cross!(1, 0, u), cross!(1, 1, v), cross!(1, 2, w)];
    let near = _mm256_max_ps(_mm256_max_ps(enter[0], enter[1]), _mm256_max_ps(enter[2], _mm256_setzero_ps()));
    let far = _mm256_min_ps(_mm256_min_ps(leave[0], leave[1]), leave[2]);
    (near, far)
}

impl NodeTest for Avx2 {
    type F64x4 = AvxF64x4;

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        out: *mut f32,
        node_refs: *mut NodeRef,
    ) -> (usize, NodeRef) {
        // SAFETY: the caller's promise.
        unsafe {
            let (mut near, mut far) = clip(node, ray.ray(), ray.origins());
            let ray = ray.ray();
            let mut children = _mm256_load_si256(node.children().as_ptr().cast());
            if ORDERED {
                let order = order(node, ray);
                near = _mm256_permutevar8x32_ps(near, order);
                far = _mm256_permutevar8x32_ps(far, order);
                children = _mm256_permutevar8x32_epi32(children, order);
            }
            let far = end(far, limit);
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as usize;
            let row = SET_LANES.get_unchecked(mask & 255).as_ptr();
            let met = _mm256_cvtepu8_epi32(_mm_loadl_epi64(row.cast()));
            if ORDERED {
                _mm256_storeu_ps(out, _mm256_permutevar8x32_ps(near, met));
            }
            _mm256_storeu_si256(node_refs.cast(), _mm256_permutevar8x32_epi32(children, met));
            (mask.count_ones() as usize, node.last_child::<ORDERED>(mask as u32, ray))
        }
    }
}
