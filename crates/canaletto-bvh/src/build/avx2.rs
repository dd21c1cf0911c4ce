//! The two loops that take most of the build time, filling bins and partitioning, with a box in one register. The
//! compiler would generate masked stores and branches for them. The operations are those of the loops in `binning` and
//! `partition`, and so are the resulting bits.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::x86_64::*;

use super::bins::{BinSplit, Bins, Grid, MAX_BINS};
use super::prim_ref::{Box8, Centers, PrimRef};

/// The bins of a center along each axis.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn bins(center: __m128, origin: __m128, scale: __m128) -> __m128i {
    let at = _mm_add_ps(_mm_mul_ps(_mm_sub_ps(center, origin), scale), _mm_set1_ps(16.0));
    _mm_and_si128(_mm_srli_epi32::<19>(_mm_castps_si128(at)), _mm_set1_epi32(MAX_BINS as i32 - 1))
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn center(bounds: __m256) -> __m128 {
    let quarters = _mm256_mul_ps(bounds, _mm256_set1_ps(0.25));
    _mm_sub_ps(_mm256_extractf128_ps::<1>(quarters), _mm256_castps256_ps128(quarters))
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn load(bounds: &Box8) -> __m256 {
    // SAFETY: the box has eight numbers, aligned to their total size.
    unsafe { _mm256_load_ps(bounds.0.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn store(bounds: &mut Box8, value: __m256) {
    // SAFETY: as above.
    unsafe { _mm256_store_ps(bounds.0.as_mut_ptr(), value) }
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn join(all: &mut Box8, bounds: __m256) {
    let joined = _mm256_max_ps(load(all), bounds);
    store(all, joined);
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn four(numbers: &[f32; 4]) -> __m128 {
    // SAFETY: the array has four numbers.
    unsafe { _mm_loadu_ps(numbers.as_ptr()) }
}

/// Adds references to the bins.
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn fill(all: &mut Bins, refs: &[PrimRef], grid: &Grid) {
    // Two sets of bins are filled in turn. Neighbours often fall into one bin, and the second update would have to wait
    // for the first.
    if refs.len() >= TWO_BINS_FROM {
        let mut other = Bins::EMPTY;
        let (pairs, last) = refs.as_chunks();
        for [one, two] in pairs {
            add(all, one, grid);
            add(&mut other, two, grid);
        }
        for prim in last {
            add(all, prim, grid);
        }
        all.join(&other, grid.bins);
    } else {
        for prim in refs {
            add(all, prim, grid);
        }
    }
}

/// The number of references from which on two sets of bins pay.
const TWO_BINS_FROM: usize = 256;

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn add(all: &mut Bins, prim: &PrimRef, grid: &Grid) {
    let (origin, scale) = (four(&grid.origin), four(&grid.scale));
    let [xs, ys, zs] = &mut all.boxes;
    let [nx, ny, nz] = &mut all.counts;
    let bounds = load(prim.bounds());
    let bins = bins(center(bounds), origin, scale);
    let xy = _mm_cvtsi128_si64(bins) as u64;
    let x = xy as usize & (MAX_BINS - 1);
    let y = (xy >> 32) as usize & (MAX_BINS - 1);
    let z = _mm_extract_epi32::<2>(bins) as usize & (MAX_BINS - 1);
    join(&mut xs[x], bounds);
    join(&mut ys[y], bounds);
    join(&mut zs[z], bounds);
    nx[x] += 1;
    ny[y] += 1;
    nz[z] += 1;
}

/// Moves the references that go left to the front.
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn part(refs: &mut [PrimRef], bin_split: &BinSplit) -> (usize, [Centers; 2]) {
    let (origin, scale) = (four(&bin_split.grid.origin), four(&bin_split.grid.scale));
    let end = _mm_set1_epi32(bin_split.bin as i32);
    partition_chunk_by(refs, bin_split.axis, |center| {
        _mm_castsi128_ps(_mm_cmpgt_epi32(end, bins(center, origin, scale)))
    })
}

/// Moves the references whose centers lie below a limit to the front.
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn partition_chunk_below(refs: &mut [PrimRef], axis: usize, limit: f32) -> (usize, [Centers; 2]) {
    let limit = _mm_set1_ps(limit);
    partition_chunk_by(refs, axis, |center| _mm_cmplt_ps(center, limit))
}

/// Moves the references that go left to the front. In the mask `below(center)`, an axis is set if the center lies on
/// the left along that axis.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn partition_chunk_by(refs: &mut [PrimRef], axis: usize, below: impl Fn(__m128) -> __m128) -> (usize, [Centers; 2]) {
    let none = _mm256_set1_ps(f32::NEG_INFINITY);
    let (mut a, mut b) = (none, none);
    let mut border = 0;
    for i in 0..refs.len() {
        let prim = refs[i];
        let center = center(load(prim.bounds()));
        let left = _mm_movemask_ps(below(center)) as usize >> axis & 1;
        let corners = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_xor_ps(center, _mm_set1_ps(-0.0))), center);
        let goes_left = _mm256_castsi256_ps(_mm256_set1_epi32(-(left as i32)));
        a = _mm256_max_ps(_mm256_blendv_ps(none, corners, goes_left), a);
        b = _mm256_max_ps(_mm256_blendv_ps(corners, none, goes_left), b);
        refs[i] = refs[border];
        refs[border] = prim;
        border += left;
    }
    let centers = |corners: __m256| {
        let mut centers = Box8::EMPTY;
        store(&mut centers, corners);
        Centers(centers)
    };
    (border, [centers(a), centers(b)])
}
