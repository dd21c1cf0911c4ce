//! The node test with AVX-512: all eight boxes at once. The compress instruction compacts the entered children
//! (Fuetterer, Lojewski, Pfreundt, Hamann and Ebert, "Accelerated single ray tracing for wide vector units", 2017).

use super::{AvxF64x4, NodeTest, TraversalRay, avx2};
use crate::node::{Node, NodeRef};
use crate::simd::Avx512;
use std::arch::x86_64::*;

impl NodeTest for Avx512 {
    type F64x4 = AvxF64x4;

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
    unsafe fn visit<R: TraversalRay, const ORDERED: bool>(
        node: &Node,
        ray: &R,
        limit: f32,
        out: *mut f32,
        node_refs: *mut NodeRef,
    ) -> (usize, NodeRef) {
        // SAFETY: the caller's promise.
        unsafe {
            let (mut near, mut far) = avx2::clip(node, ray.ray(), ray.origins());
            let ray = ray.ray();
            let mut children = _mm256_load_si256(node.children().as_ptr().cast());
            if ORDERED {
                let order = avx2::order(node, ray);
                near = _mm256_permutexvar_ps(order, near);
                far = _mm256_permutexvar_ps(order, far);
                children = _mm256_permutexvar_epi32(order, children);
            }
            let far = avx2::end(far, limit);
            let mask = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
            if ORDERED {
                _mm256_storeu_ps(out, _mm256_maskz_compress_ps(mask, near));
            }
            _mm256_storeu_si256(node_refs.cast(), _mm256_maskz_compress_epi32(mask, children));
            (mask.count_ones() as usize, node.last_child::<ORDERED>(mask.into(), ray))
        }
    }
}
