//! All eight boxes at once; what is met is brought together by a table of permutations.

use super::Lanes;
use crate::node::{Link, Node};
use crate::slab::{Slabs, WIDTH};
use std::arch::x86_64::*;

/// See the module.
#[derive(Clone, Copy)]
pub(crate) struct Avx2;

/// For each mask, the lanes that are set, in order.
static COMPRESS: [[u8; WIDTH]; 256] = {
    let mut table = [[0; WIDTH]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < WIDTH {
            if mask >> lane & 1 == 1 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// The lanes from far to near, in the lowest three bits of each.
///
/// # Safety
/// The machine must have AVX2.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) unsafe fn order(node: &Node, slabs: &Slabs) -> __m256i {
    // SAFETY: there are eight octants.
    let order = unsafe { *node.orders.get_unchecked(slabs.octant()) };
    _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21))
}

/// Where the ray enters and leaves the boxes, within (0, limit].
///
/// # Safety
/// The machine must have AVX2.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) unsafe fn clip(node: &Node, slabs: &Slabs, limit: f32) -> (__m256, __m256) {
    // No closures: they would be functions without the instructions until they are inlined.
    macro_rules! cross {
        ($axis:literal, $offset:expr, $reciprocal:ident) => {{
            // SAFETY: the offset is that of a row of eight aligned numbers.
            let planes = unsafe { _mm256_load_ps((&raw const *node).cast::<f32>().byte_add($offset)) };
            _mm256_mul_ps(
                _mm256_sub_ps(planes, _mm256_set1_ps(slabs.origin[$axis])),
                _mm256_set1_ps(slabs.$reciprocal[$axis]),
            )
        }};
    }
    let [x, y, z] = slabs.entry_rows;
    let enter = [cross!(0, x, reciprocal), cross!(1, y, reciprocal), cross!(2, z, reciprocal)];
    let leave = [cross!(0, 96 - x, leaving), cross!(1, 160 - y, leaving), cross!(2, 224 - z, leaving)];
    let near = _mm256_max_ps(_mm256_max_ps(enter[0], enter[1]), _mm256_max_ps(enter[2], _mm256_setzero_ps()));
    let far = _mm256_min_ps(_mm256_min_ps(leave[0], leave[1]), _mm256_min_ps(leave[2], _mm256_set1_ps(limit)));
    (near, far)
}

impl Lanes for Avx2 {
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn visit(node: &Node, slabs: &Slabs, limit: f32, out: *mut f32, links: *mut Link) -> usize {
        // SAFETY: the caller's promise: AVX2, and room for eight entries.
        unsafe {
            let order = order(node, slabs);
            let (near, far) = clip(node, slabs, limit);
            let near = _mm256_permutevar8x32_ps(near, order);
            let far = _mm256_permutevar8x32_ps(far, order);
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as usize;
            let row = COMPRESS.get_unchecked(mask & 255).as_ptr();
            let met = _mm256_cvtepu8_epi32(_mm_loadl_epi64(row.cast()));
            _mm256_storeu_ps(out, _mm256_permutevar8x32_ps(near, met));
            let children = _mm256_permutevar8x32_epi32(_mm256_load_si256(node.children.as_ptr().cast()), order);
            _mm256_storeu_si256(links.cast(), _mm256_permutevar8x32_epi32(children, met));
            mask.count_ones() as usize
        }
    }
}
