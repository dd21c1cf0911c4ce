//! All eight boxes at once; what is met is brought together by a table of permutations.

use super::Lanes;
use crate::node::{Link, Node};
use crate::slab::{Slabs, WIDTH};
use std::arch::x86_64::*;

/// See the module.
#[derive(Clone, Copy)]
pub(crate) struct Avx2;

#[derive(Clone, Copy)]
pub(crate) struct Ray {
    pub(super) origin: [__m256; 3],
    pub(super) reciprocal: [__m256; 3],
    pub(super) leaving: [__m256; 3],
    pub(super) entry: [usize; 3],
    /// Lane i takes the child of lane i ^ octant ^ 7: the farthest first.
    pub(super) order: __m256i,
}

/// For each octant, the lanes from far to near.
#[repr(align(32))]
struct Orders([[u32; WIDTH]; 8]);

static ORDERS: Orders = {
    let mut orders = [[0; WIDTH]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut lane = 0;
        while lane < WIDTH {
            orders[octant][lane] = (lane ^ octant ^ (WIDTH - 1)) as u32;
            lane += 1;
        }
        octant += 1;
    }
    Orders(orders)
};

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

/// The ray in all lanes.
///
/// # Safety
/// The machine must have AVX2.
#[inline(always)]
pub(super) unsafe fn ray(slabs: &Slabs) -> Ray {
    // SAFETY: the caller's promise; the row has eight aligned numbers.
    unsafe {
        macro_rules! splat {
            ($v:expr) => {
                [_mm256_set1_ps($v[0]), _mm256_set1_ps($v[1]), _mm256_set1_ps($v[2])]
            };
        }
        Ray {
            origin: splat!(slabs.origin),
            reciprocal: splat!(slabs.reciprocal),
            leaving: splat!(slabs.leaving),
            entry: [usize::from(slabs.entry[0]), usize::from(slabs.entry[1]), usize::from(slabs.entry[2])],
            order: _mm256_load_si256(ORDERS.0.get_unchecked(slabs.octant()).as_ptr().cast()),
        }
    }
}

/// Where the ray enters and leaves the boxes, within (0, limit].
///
/// # Safety
/// The machine must have AVX2.
#[inline(always)]
pub(super) unsafe fn clip(node: &Node, ray: &Ray, limit: f32) -> (__m256, __m256) {
    // SAFETY: the caller's promise; each row has eight aligned numbers, and an entry is 0 or 1.
    unsafe {
        // No closures: they would be functions without the instructions until they are inlined.
        macro_rules! cross {
            ($axis:literal, $side:expr, $reciprocal:ident) => {{
                let planes = _mm256_load_ps(node.boxes.get_unchecked($side).get_unchecked($axis).as_ptr());
                _mm256_mul_ps(_mm256_sub_ps(planes, ray.origin[$axis]), ray.$reciprocal[$axis])
            }};
        }
        let [x, y, z] = ray.entry;
        let enter = [cross!(0, x, reciprocal), cross!(1, y, reciprocal), cross!(2, z, reciprocal)];
        let leave = [cross!(0, x ^ 1, leaving), cross!(1, y ^ 1, leaving), cross!(2, z ^ 1, leaving)];
        let near = _mm256_max_ps(_mm256_max_ps(enter[0], enter[1]), _mm256_max_ps(enter[2], _mm256_setzero_ps()));
        let far = _mm256_min_ps(_mm256_min_ps(leave[0], leave[1]), _mm256_min_ps(leave[2], _mm256_set1_ps(limit)));
        (near, far)
    }
}

impl Lanes for Avx2 {
    type Ray = Ray;

    #[inline(always)]
    unsafe fn ray(slabs: &Slabs) -> Ray {
        // SAFETY: the caller's promise.
        unsafe { ray(slabs) }
    }

    #[inline(always)]
    unsafe fn visit(node: &Node, ray: &Ray, limit: f32, out: *mut f32, links: *mut Link) -> usize {
        // SAFETY: the caller's promise: AVX2, and room for eight entries.
        unsafe {
            let (near, far) = clip(node, ray, limit);
            let near = _mm256_permutevar8x32_ps(near, ray.order);
            let far = _mm256_permutevar8x32_ps(far, ray.order);
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as usize;
            let row = COMPRESS.get_unchecked(mask & 255).as_ptr();
            let met = _mm256_cvtepu8_epi32(_mm_loadl_epi64(row.cast()));
            _mm256_storeu_ps(out, _mm256_permutevar8x32_ps(near, met));
            let children = _mm256_permutevar8x32_epi32(children, ray.order);
            _mm256_storeu_si256(links.cast(), _mm256_permutevar8x32_epi32(children, met));
            mask.count_ones() as usize
        }
    }
}
