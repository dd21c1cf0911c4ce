//! Parallel loops over lists, on Rayon's threads and in Rayon's words.
//!
//! Rayon's iterators compile their whole scheduler anew for each closure: a hundred loops were a fifth of the library's
//! code. These loops share one scheduler, [`for_ranges`]. It calls each loop through a pointer, once for a range of
//! items, so that the items of a range cost what they cost in a plain loop.
//!
//! Results don't depend on the number of threads: lists keep their order, searches find the first, and reductions join
//! neighbouring ranges from left to right.
//!
//! ```
//! use canaletto_parallel::prelude::*;
//!
//! let squares = (0..5usize).into_par_iter().map(|i| i * i).collect();
//! assert_eq!(squares, [0, 1, 4, 9, 16]);
//! assert_eq!(squares.par_iter().position_first(|&square| square > 3), Some(2));
//! ```

// The workspace denies `unsafe`. Here the loops write results and hand out mutable items by index.
#![allow(unsafe_code)]
#![deny(clippy::disallowed_methods)]

mod in_parts;
mod list;
mod scheduler;
#[cfg(test)]
mod tests;

pub use in_parts::{FilterMap, MapInit};
pub use list::{
    Chunks, ChunksMut, Enumerate, Indices, IntoItems, IntoParallel, Items, ItemsMut, Map, MinLen, ParallelList,
    ParallelSlice, ParallelSliceMut, Zip,
};
pub use scheduler::for_ranges;

/// The traits, to be imported as Rayon's are.
pub mod prelude {
    pub use crate::{IntoParallel, ParallelList, ParallelSlice, ParallelSliceMut};
}
