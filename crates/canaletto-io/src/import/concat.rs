//! Concatenation of lists that were built in parts.

use bytemuck::Pod;
use canaletto::memory;
use canaletto_parallel::prelude::*;

/// The concatenation of the parts, copied in parallel. The memory of each part is freed as soon as it is copied.
pub(super) fn concat<T: Pod + Send + Sync>(mut parts: Vec<Vec<T>>) -> Vec<T> {
    parts.retain(|part| !part.is_empty());
    if parts.len() < 2 {
        return parts.pop().unwrap_or_default();
    }
    let mut all = memory::zeros(parts.iter().map(Vec::len).sum());
    let mut rest = all.as_mut_slice();
    let places: Vec<&mut [T]> = parts.iter().map(|part| rest.split_off_mut(..part.len()).unwrap_or_default()).collect();
    places.into_par_iter().zip(parts).for_each(|(place, part)| place.copy_from_slice(&part));
    all
}
