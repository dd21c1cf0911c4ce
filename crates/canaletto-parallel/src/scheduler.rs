//! The one scheduler of all loops.

use rayon::FnContext;
use std::ops::Range;

/// Calls `work` with ranges that together hold each index below `len` once, in parallel. Ranges are halved for idle
/// threads, as Rayon does it, but not below `least` indices.
///
/// # Panics
/// If `work` panics.
pub fn for_ranges(len: usize, least: usize, work: &(dyn Fn(Range<usize>) + Sync)) {
    if len > 0 {
        halve(0..len, least.max(1), rayon::current_num_threads(), work);
    }
}

/// Works on a range that may be halved `splits` times, more often where another thread takes it.
fn halve(range: Range<usize>, least: usize, splits: usize, work: &(dyn Fn(Range<usize>) + Sync)) {
    if splits == 0 || range.len() / 2 < least {
        return work(range);
    }
    let middle = range.start + range.len() / 2;
    let half = |range, context: FnContext| {
        let more = if context.migrated() { rayon::current_num_threads() } else { 0 };
        halve(range, least, more.max(splits / 2), work);
    };
    rayon::join_context(|context| half(range.start..middle, context), |context| half(middle..range.end, context));
}
