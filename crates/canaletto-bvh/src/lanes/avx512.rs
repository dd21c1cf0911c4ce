//! All eight boxes at once; what is met is brought together by the compress instruction (Fuetterer, Lojewski, Pfreundt,
//! Hamann and Ebert, "Accelerated single ray tracing for wide vector units", 2017).

use super::{Lanes, avx2};
use crate::node::{Link, Node};
use crate::slab::Slabs;
use std::arch::x86_64::*;

/// See the module.
#[derive(Clone, Copy)]
pub(crate) struct Avx512;

impl Lanes for Avx512 {
    type Ray = avx2::Ray;

    #[inline(always)]
    unsafe fn ray(slabs: &Slabs) -> avx2::Ray {
        // SAFETY: the caller's promise.
        unsafe { avx2::ray(slabs) }
    }

    #[inline(always)]
    unsafe fn visit(node: &Node, ray: &avx2::Ray, limit: f32, out: *mut f32, links: *mut Link) -> usize {
        // SAFETY: the caller's promise: AVX-512, and room for eight entries.
        unsafe {
            let (near, far) = avx2::clip(node, ray, limit);
            let near = _mm256_permutexvar_ps(ray.order, near);
            let far = _mm256_permutexvar_ps(ray.order, far);
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            let children = _mm256_permutexvar_epi32(ray.order, children);
            let mask = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
            _mm256_storeu_ps(out, _mm256_maskz_compress_ps(mask, near));
            _mm256_storeu_si256(links.cast(), _mm256_maskz_compress_epi32(mask, children));
            mask.count_ones() as usize
        }
    }
}
