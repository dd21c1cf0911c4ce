//! Moves references to their sides of a split, in place. A large range is partitioned in parallel: each chunk
//! separately, then the references on the wrong side of the whole are swapped. The result does not depend on the number
//! of threads.

use canaletto_parallel::prelude::*;

use super::CHUNK;
use super::bins::BinSplit;
use super::prim_ref::{Centers, PrimRef};
use crate::InstructionSet;

/// Moves the references that go left to the front. Returns their number and the boxes around the centers of both sides.
pub(super) fn partition(refs: &mut [PrimRef], bin_split: &BinSplit) -> (usize, [Centers; 2]) {
    all(refs, |refs| part(refs, bin_split))
}

/// Moves the references whose centers lie below a limit to the front and returns their number.
pub(super) fn below(refs: &mut [PrimRef], axis: usize, limit: f32) -> usize {
    all(refs, |refs| partition_chunk_below(refs, axis, limit)).0
}

/// Partitions all references by a function that partitions a chunk.
fn all(
    refs: &mut [PrimRef],
    part: impl Fn(&mut [PrimRef]) -> (usize, [Centers; 2]) + Sync + Send,
) -> (usize, [Centers; 2]) {
    if refs.len() <= 2 * CHUNK {
        return part(refs);
    }
    let parts: Vec<_> = refs.par_chunks_mut(CHUNK).map(part).collect();
    let middle = parts.iter().map(|part| part.0).sum();
    // `late`: ranges before the middle that belong behind it. `early`: ranges behind it that belong before it.
    let (mut late, mut early) = (Vec::new(), Vec::new());
    for (i, &(lefts, _)) in parts.iter().enumerate() {
        let (start, end) = (i * CHUNK, (i * CHUNK + CHUNK).min(refs.len()));
        let border = start + lefts;
        late.push(border.min(middle)..end.min(middle));
        early.push(start.max(middle)..border.max(middle));
    }
    let (front, back) = refs.split_at_mut(middle);
    let late = slices(front, 0, late);
    let early = slices(back, middle, early);
    pairs(late, early).into_par_iter().for_each(|(a, b)| a.swap_with_slice(b));
    let centers = parts.iter().fold([Centers::NONE; 2], |[a, b], (_, [c, d])| [a.join(*c), b.join(*d)]);
    (middle, centers)
}

fn part(refs: &mut [PrimRef], bin_split: &BinSplit) -> (usize, [Centers; 2]) {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::current() >= InstructionSet::Avx2 {
        #[allow(unsafe_code)]
        // SAFETY: `current` never returns more than the machine has.
        return unsafe { super::avx2::part(refs, bin_split) };
    }
    partition_chunk_by(refs, |center| bin_split.grid.bin(center, bin_split.axis) < bin_split.bin)
}

fn partition_chunk_below(refs: &mut [PrimRef], axis: usize, limit: f32) -> (usize, [Centers; 2]) {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::current() >= InstructionSet::Avx2 {
        #[allow(unsafe_code)]
        // SAFETY: as above.
        return unsafe { super::avx2::partition_chunk_below(refs, axis, limit) };
    }
    partition_chunk_by(refs, |center| center[axis] < limit)
}

/// Partitions without unpredictable branches: each reference is swapped to the border, and the border moves on if the
/// reference goes left.
#[inline(always)]
fn partition_chunk_by(refs: &mut [PrimRef], goes_left: impl Fn([f32; 4]) -> bool) -> (usize, [Centers; 2]) {
    let [mut a, mut b] = [Centers::NONE; 2];
    let mut border = 0;
    for i in 0..refs.len() {
        let center = refs[i].center();
        let left = goes_left(center);
        a.add(center, left);
        b.add(center, !left);
        refs.swap(i, border);
        border += usize::from(left);
    }
    (border, [a, b])
}

/// The slices of `refs` for ranges in ascending order. `refs` starts at index `first`.
fn slices(mut refs: &mut [PrimRef], first: usize, ranges: Vec<std::ops::Range<usize>>) -> Vec<&mut [PrimRef]> {
    let mut at = first;
    let mut out = Vec::with_capacity(ranges.len());
    for range in ranges.into_iter().filter(|range| !range.is_empty()) {
        let (_, rest) = refs.split_at_mut(range.start - at);
        let (slice, rest) = rest.split_at_mut(range.len());
        out.push(slice);
        at = range.end;
        refs = rest;
    }
    out
}

/// Cuts both lists, which have equal total length, into pairs of slices of equal length.
fn pairs<'a>(a: Vec<&'a mut [PrimRef]>, b: Vec<&'a mut [PrimRef]>) -> Vec<(&'a mut [PrimRef], &'a mut [PrimRef])> {
    let (mut a, mut b) = (a.into_iter(), b.into_iter());
    let mut out = Vec::new();
    let (mut x, mut y): (&mut [PrimRef], &mut [PrimRef]) = (&mut [], &mut []);
    loop {
        if x.is_empty() {
            let Some(next) = a.next() else { return out };
            x = next;
        }
        if y.is_empty() {
            let Some(next) = b.next() else { return out };
            y = next;
        }
        let n = x.len().min(y.len());
        let ((x_now, x_rest), (y_now, y_rest)) = (x.split_at_mut(n), y.split_at_mut(n));
        out.push((x_now, y_now));
        (x, y) = (x_rest, y_rest);
    }
}
