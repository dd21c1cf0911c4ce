//! Triangles with equal corners, of which only one is put into the tree. A ray that hits one of them hits all of them
//! at one t, and a tie goes to the lowest id.

use canaletto_parallel::prelude::*;

use super::prim_ref::{Corners, PrimRef};
use crate::Aabb;

/// Moves to the front the references that don't repeat a triangle of a lower id, and returns their number. The others
/// are returned in pairs: the first equal triangle, then the repeated one.
pub(super) fn move_distinct_first(refs: &mut [PrimRef], corners: &Corners<'_>) -> (usize, Vec<[u32; 2]>) {
    // The references of a presplit triangle have boxes of their own, and its copies have references with equal boxes.
    // The box is therefore part of the key.
    let bits = |prim: &PrimRef| {
        let Aabb { min, max } = prim.bounds().aabb();
        let [a, b, c] = corners(prim.id());
        [a, b, c, min, max].map(|p| p.to_array().map(f32::to_bits))
    };
    // Triangles with different hashes are distinct. For equal hashes all bits are compared.
    let hash = |prim: &PrimRef| {
        let mix = |hash: u64, &bits: &u32| (hash ^ u64::from(bits)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        bits(prim).as_flattened().iter().fold(0, mix)
    };
    let mut sorted: Vec<(u64, u32, u32)> =
        refs.par_iter().enumerate().map(|(place, prim)| (hash(prim), prim.id(), place as u32)).collect();
    rayon::slice::ParallelSliceMut::par_sort_unstable(&mut *sorted);
    let mut duplicates = Vec::new();
    let mut kept = vec![true; refs.len()];
    for same in sorted.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        let (_, original, place) = same[0];
        let first = bits(&refs[place as usize]);
        for &(_, copy, place) in &same[1..] {
            if bits(&refs[place as usize]) == first {
                kept[place as usize] = false;
                duplicates.push([original, copy]);
            }
        }
    }
    let mut count = 0;
    for place in (0..refs.len()).filter(|&place| kept[place]) {
        refs.swap(count, place);
        count += 1;
    }
    (count, duplicates)
}

/// The copies of a triangle, from a sorted list of pairs.
pub(crate) fn of(duplicates: &[[u32; 2]], id: u32) -> impl Iterator<Item = u32> {
    let first = duplicates.partition_point(|&[original, _]| original < id);
    duplicates[first..].iter().take_while(move |&&[original, _]| original == id).map(|&[_, copy]| copy)
}
