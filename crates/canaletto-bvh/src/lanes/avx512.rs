//! All eight boxes at once; what is met is brought together by the compress instruction (Fuetterer, Lojewski, Pfreundt,
//! Hamann and Ebert, "Accelerated single ray tracing for wide vector units", 2017).

use super::{Lanes, Wide, avx2};
use crate::node::{Link, Node};
use crate::{PreparedRay, WideRay};
use std::arch::x86_64::*;

/// See the module.
#[derive(Clone, Copy)]
pub(crate) struct Avx512;

/// Writes the children that are entered before they are left and before the limit.
///
/// # Safety
/// The machine must have AVX-512, and there must be room for eight entries.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
unsafe fn write<const ORDERED: bool>(
    node: &Node,
    ray: &PreparedRay,
    (mut near, mut far): (__m256, __m256),
    limit: f32,
    out: *mut f32,
    links: *mut Link,
) -> (usize, Link) {
    // SAFETY: the caller's promise.
    unsafe {
        let mut children = _mm256_load_si256(node.children.as_ptr().cast());
        if ORDERED {
            let order = avx2::order(node, ray);
            near = _mm256_permutexvar_ps(order, near);
            far = _mm256_permutexvar_ps(order, far);
            children = _mm256_permutexvar_epi32(order, children);
        }
        let far = avx2::end(far, limit);
        let mask = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
        _mm256_storeu_ps(out, _mm256_maskz_compress_ps(mask, near));
        _mm256_storeu_si256(links.cast(), _mm256_maskz_compress_epi32(mask, children));
        (mask.count_ones() as usize, super::last::<ORDERED>(node, ray, u32::from(mask)))
    }
}

impl Lanes for Avx512 {
    type Ray = PreparedRay;

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
    unsafe fn visit<const ORDERED: bool>(
        node: &Node,
        ray: &PreparedRay,
        limit: f32,
        out: *mut f32,
        links: *mut Link,
    ) -> (usize, Link) {
        let origin = &ray.ray.origin.to_array();
        // SAFETY: the caller's promise: AVX-512, and room for eight entries.
        unsafe { write::<ORDERED>(node, ray, avx2::clip(node, ray, [origin, origin]), limit, out, links) }
    }
}

impl Lanes for Wide<Avx512> {
    type Ray = WideRay;

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
    unsafe fn visit<const ORDERED: bool>(
        node: &Node,
        WideRay { ray, origins: [first, last], .. }: &WideRay,
        limit: f32,
        out: *mut f32,
        links: *mut Link,
    ) -> (usize, Link) {
        // SAFETY: the caller's promise: AVX-512, and room for eight entries.
        unsafe { write::<ORDERED>(node, ray, avx2::clip(node, ray, [first, last]), limit, out, links) }
    }
}
