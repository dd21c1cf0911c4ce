//! TriangleBvh with the same corners, of which one is in the tree: a ray that meets one meets all of them at the same t, and a tie goes to the
//! lowest id.

use rayon::prelude::*;

use super::prim_ref::{Corners, PrimRef};
use crate::Aabb;

/// Moves to the front what is not the same triangle as another with a lower id, and tells how many that are. The others
/// are told in pairs, each after the first that is the same.
pub(super) fn distinct(refs: &mut [PrimRef], corners: &Corners<'_>) -> (usize, Vec<[u32; 2]>) {
    // The references of a triangle that was split have boxes of their own, and the same as those of its copies.
    let bits = |prim: &PrimRef| {
        let Aabb { min, max } = prim.bounds().aabb();
        let [a, b, c] = corners(prim.id());
        [a, b, c, min, max].map(|p| p.to_array().map(f32::to_bits))
    };
    // What differs in its hash is distinct; of what does not, all is compared.
    let hash = |prim: &PrimRef| {
        let mix = |hash: u64, &bits: &u32| (hash ^ u64::from(bits)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        bits(prim).as_flattened().iter().fold(0, mix)
    };
    let mut sorted: Vec<(u64, u32, u32)> =
        refs.par_iter().zip(0..refs.len() as u32).map(|(prim, place)| (hash(prim), prim.id(), place)).collect();
    sorted.par_sort_unstable();
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

/// The copies of a triangle among sorted pairs.
pub(crate) fn of(duplicates: &[[u32; 2]], id: u32) -> impl Iterator<Item = u32> {
    let first = duplicates.partition_point(|&[original, _]| original < id);
    duplicates[first..].iter().take_while(move |&&[original, _]| original == id).map(|&[_, copy]| copy)
}
