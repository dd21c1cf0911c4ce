//! Lists that threads make in parts: those of which some items are left out, and those whose items share buffers.

use crate::{ParallelList, for_ranges};
use std::ops::Range;
use std::sync::Mutex;

/// Those values of `f(item)` that aren't `None`.
#[derive(Debug)]
pub struct FilterMap<L, F> {
    pub(crate) list: L,
    pub(crate) f: F,
}

impl<L: ParallelList, T, F: Fn(L::Item) -> Option<T> + Sync> FilterMap<L, F> {
    /// All values in order.
    pub fn collect(self) -> Vec<T>
    where
        T: Send,
    {
        collect_parts(self.list.len(), self.list.least(), &|range| {
            // SAFETY: the scheduler gives each index once.
            range.filter_map(|index| (self.f)(unsafe { self.list.item(index) })).collect()
        })
    }

    /// Calls `f` with each value.
    pub fn for_each(self, f: impl Fn(T) + Sync) {
        self.list.for_each(|item| {
            if let Some(value) = (self.f)(item) {
                f(value);
            }
        });
    }

    /// The number of values.
    pub fn count(self) -> usize {
        self.list.map(|item| usize::from((self.f)(item).is_some())).sum()
    }
}

/// The list of `f(value, item)`, with a value for each range of items.
#[derive(Debug)]
pub struct MapInit<L, I, F> {
    pub(crate) list: L,
    pub(crate) init: I,
    pub(crate) f: F,
}

impl<L: ParallelList, B, T: Send, I: Fn() -> B + Sync, F: Fn(&mut B, L::Item) -> T + Sync> MapInit<L, I, F> {
    /// All values in order.
    pub fn collect(self) -> Vec<T> {
        collect_parts(self.list.len(), self.list.least(), &|range| {
            let mut value = (self.init)();
            // SAFETY: the scheduler gives each index once.
            range.map(|index| (self.f)(&mut value, unsafe { self.list.item(index) })).collect()
        })
    }
}

/// The lists of all ranges of indices, as one list.
fn collect_parts<T: Send>(len: usize, least: usize, part: &(dyn Fn(Range<usize>) -> Vec<T> + Sync)) -> Vec<T> {
    let parts = Mutex::new(Vec::new());
    for_ranges(len, least, &|range| keep_in_order(&parts, range.start, part(range)));
    let parts: Vec<Vec<T>> = in_order(parts).collect();
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for mut part in parts {
        all.append(&mut part);
    }
    all
}

/// The parts of a list that threads made, each with the index of its first item.
type Parts<T> = Mutex<Vec<(usize, T)>>;

/// Keeps a part at its place among the others.
pub(crate) fn keep_in_order<T>(parts: &Parts<T>, start: usize, part: T) {
    let mut parts = parts.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let place = parts.partition_point(|&(other, _)| other < start);
    parts.insert(place, (start, part));
}

/// All parts in order.
pub(crate) fn in_order<T>(parts: Parts<T>) -> impl Iterator<Item = T> {
    parts.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner()).into_iter().map(|(_, part)| part)
}
