//! Lists whose items are made by index, and what is done with all of them.

use crate::for_ranges;
use crate::in_parts::{FilterMap, MapInit, in_order, keep_in_order};
use std::marker::PhantomData;
use std::mem::ManuallyDrop;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A list whose items threads take by index, each once.
pub trait ParallelList: Sync + Sized {
    /// An item.
    type Item;

    /// The number of items.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The fewest items of a range that one thread works on.
    fn least(&self) -> usize {
        1
    }

    /// An item.
    ///
    /// # Safety
    /// `index` lies below the length, and no item is taken while an earlier taking of it is in use.
    unsafe fn item(&self, index: usize) -> Self::Item;

    /// The list of `f(item)`.
    fn map<T, F: Fn(Self::Item) -> T + Sync>(self, f: F) -> Map<Self, F> {
        Map { list: self, f }
    }

    /// [`ParallelList::map`] with a value that `init` makes for each range of items, such as a buffer.
    fn map_init<B, T, I, F>(self, init: I, f: F) -> MapInit<Self, I, F>
    where
        I: Fn() -> B + Sync,
        F: Fn(&mut B, Self::Item) -> T + Sync,
    {
        MapInit { list: self, init, f }
    }

    /// Those values of `f(item)` that aren't `None`.
    fn filter_map<T, F: Fn(Self::Item) -> Option<T> + Sync>(self, f: F) -> FilterMap<Self, F> {
        FilterMap { list: self, f }
    }

    /// Those items for which `f` returns true.
    fn filter(
        self,
        f: impl Fn(&Self::Item) -> bool + Sync,
    ) -> FilterMap<Self, impl Fn(Self::Item) -> Option<Self::Item> + Sync> {
        self.filter_map(move |item| f(&item).then_some(item))
    }

    /// Each item with its index.
    fn enumerate(self) -> Enumerate<Self> {
        Enumerate { list: self }
    }

    /// Pairs of items with equal indices, as many as the shorter list has.
    fn zip<L: IntoParallel>(self, other: L) -> Zip<Self, L::List> {
        Zip { left: self, right: other.into_par_iter() }
    }

    /// The list, in ranges of at least so many items for a thread.
    fn with_min_len(self, least: usize) -> MinLen<Self> {
        MinLen { list: self, least }
    }

    /// Calls `f` with each item.
    fn for_each(self, f: impl Fn(Self::Item) + Sync) {
        // SAFETY: the scheduler gives each index once.
        for_ranges(self.len(), self.least(), &|range| range.for_each(|index| f(unsafe { self.item(index) })));
    }

    /// [`ParallelList::for_each`] with a value that `init` makes for each range of items, such as a buffer.
    fn for_each_init<B>(self, init: impl Fn() -> B + Sync, f: impl Fn(&mut B, Self::Item) + Sync) {
        for_ranges(self.len(), self.least(), &|range| {
            let mut value = init();
            // SAFETY: the scheduler gives each index once.
            range.for_each(|index| f(&mut value, unsafe { self.item(index) }));
        });
    }

    /// All items in order.
    fn collect(self) -> Vec<Self::Item>
    where
        Self::Item: Send,
    {
        let mut items = Vec::new();
        self.collect_into_vec(&mut items);
        items
    }

    /// All items in order, in place of what a list held.
    fn collect_into_vec(self, items: &mut Vec<Self::Item>)
    where
        Self::Item: Send,
    {
        let len = self.len();
        items.clear();
        items.reserve_exact(len);
        let slots = Slots(items.as_mut_ptr());
        for_ranges(len, self.least(), &|range| {
            for index in range {
                // SAFETY: the scheduler gives each index once, and there is room for `len` items.
                unsafe { slots.at(index).write(self.item(index)) };
            }
        });
        // SAFETY: all items are written.
        unsafe { items.set_len(len) };
    }

    /// The items joined by an associative function, from left to right.
    fn reduce(
        self,
        identity: impl Fn() -> Self::Item + Sync,
        join: impl Fn(Self::Item, Self::Item) -> Self::Item + Sync,
    ) -> Self::Item
    where
        Self::Item: Send,
    {
        let parts = Mutex::new(Vec::new());
        for_ranges(self.len(), self.least(), &|range| {
            let start = range.start;
            // SAFETY: the scheduler gives each index once.
            let part = range.map(|index| unsafe { self.item(index) }).fold(identity(), &join);
            keep_in_order(&parts, start, part);
        });
        in_order(parts).fold(identity(), join)
    }

    /// The sum of all items.
    fn sum(self) -> usize
    where
        Self: ParallelList<Item = usize>,
    {
        self.reduce(|| 0, |a, b| a + b)
    }

    /// The first value of `f(item)` that isn't `None`. `f` may be called for items after it, too.
    fn find_map_first<T: Send>(self, f: impl Fn(Self::Item) -> Option<T> + Sync) -> Option<T> {
        let (first, found) = (AtomicUsize::new(usize::MAX), Mutex::new(None));
        for_ranges(self.len(), self.least(), &|range| {
            for index in range {
                if index > first.load(Ordering::Relaxed) {
                    return;
                }
                // SAFETY: the scheduler gives each index once.
                if let Some(value) = f(unsafe { self.item(index) }) {
                    let mut found = found.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                    if first.fetch_min(index, Ordering::Relaxed) > index {
                        *found = Some(value);
                    }
                    return;
                }
            }
        });
        found.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// The first item for which `f` returns true.
    fn find_first(self, f: impl Fn(&Self::Item) -> bool + Sync) -> Option<Self::Item>
    where
        Self::Item: Send,
    {
        self.find_map_first(|item| f(&item).then_some(item))
    }

    /// The index of the first item for which `f` returns true.
    fn position_first(self, f: impl Fn(Self::Item) -> bool + Sync) -> Option<usize> {
        self.enumerate().find_map_first(|(index, item)| f(item).then_some(index))
    }

    /// Whether `f` returns true for any item.
    fn any(self, f: impl Fn(Self::Item) -> bool + Sync) -> bool {
        self.find_map_first(|item| f(item).then_some(())).is_some()
    }

    /// Whether `f` returns true for all items.
    fn all(self, f: impl Fn(Self::Item) -> bool + Sync) -> bool {
        !self.any(|item| !f(item))
    }
}

/// What becomes a list for threads.
pub trait IntoParallel {
    /// The list.
    type List: ParallelList;
    /// This as a list.
    fn into_par_iter(self) -> Self::List;
}

impl<L: ParallelList> IntoParallel for L {
    type List = L;

    fn into_par_iter(self) -> L {
        self
    }
}

impl<'a, T: Sync> IntoParallel for &'a [T] {
    type List = Items<'a, T>;

    fn into_par_iter(self) -> Items<'a, T> {
        Items(self)
    }
}

impl<'a, T: Sync> IntoParallel for &'a Vec<T> {
    type List = Items<'a, T>;

    fn into_par_iter(self) -> Items<'a, T> {
        Items(self)
    }
}

impl<'a, T: Send> IntoParallel for &'a mut [T] {
    type List = ItemsMut<'a, T>;

    fn into_par_iter(self) -> ItemsMut<'a, T> {
        self.par_iter_mut()
    }
}

impl<T: Send> IntoParallel for Vec<T> {
    type List = IntoItems<T>;

    fn into_par_iter(self) -> IntoItems<T> {
        IntoItems(self.into_iter().map(ManuallyDrop::new).collect())
    }
}

/// The items of a list, moved out of it. Items that no thread takes aren't dropped.
#[derive(Debug)]
pub struct IntoItems<T>(Vec<ManuallyDrop<T>>);

// SAFETY: an item is reached by the one thread that takes it.
unsafe impl<T: Send> Sync for IntoItems<T> {}

impl<T: Send> ParallelList for IntoItems<T> {
    type Item = T;

    fn len(&self) -> usize {
        self.0.len()
    }

    unsafe fn item(&self, index: usize) -> T {
        // SAFETY: the item is taken once, and the list doesn't drop it.
        unsafe { std::ptr::read(&raw const *self.0[index]) }
    }
}

impl IntoParallel for Range<usize> {
    type List = Indices<usize>;

    fn into_par_iter(self) -> Indices<usize> {
        Indices { start: self.start, len: self.len() }
    }
}

impl IntoParallel for Range<u32> {
    type List = Indices<u32>;

    fn into_par_iter(self) -> Indices<u32> {
        Indices { start: self.start, len: self.len() }
    }
}

/// The numbers of a range.
#[derive(Clone, Debug)]
pub struct Indices<T> {
    start: T,
    len: usize,
}

impl ParallelList for Indices<usize> {
    type Item = usize;

    fn len(&self) -> usize {
        self.len
    }

    unsafe fn item(&self, index: usize) -> usize {
        self.start + index
    }
}

impl ParallelList for Indices<u32> {
    type Item = u32;

    fn len(&self) -> usize {
        self.len
    }

    unsafe fn item(&self, index: usize) -> u32 {
        self.start + index as u32
    }
}

/// Lists of the items of slices.
pub trait ParallelSlice<T: Sync> {
    /// The items.
    fn par_iter(&self) -> Items<'_, T>;
    /// Consecutive parts of `size` items; the last may be shorter.
    ///
    /// # Panics
    /// If `size` is 0.
    fn par_chunks(&self, size: usize) -> Chunks<'_, T>;
    /// [`ParallelSlice::par_chunks`] without the rest that is shorter.
    ///
    /// # Panics
    /// If `size` is 0.
    fn par_chunks_exact(&self, size: usize) -> Chunks<'_, T>;
}

impl<T: Sync> ParallelSlice<T> for [T] {
    fn par_iter(&self) -> Items<'_, T> {
        Items(self)
    }

    fn par_chunks(&self, size: usize) -> Chunks<'_, T> {
        assert!(size > 0, "parts have no items");
        Chunks { items: self, size }
    }

    fn par_chunks_exact(&self, size: usize) -> Chunks<'_, T> {
        self[..self.len() / size * size].par_chunks(size)
    }
}

/// The items of a slice.
#[derive(Debug)]
pub struct Items<'a, T>(&'a [T]);

impl<'a, T: Sync> ParallelList for Items<'a, T> {
    type Item = &'a T;

    fn len(&self) -> usize {
        self.0.len()
    }

    unsafe fn item(&self, index: usize) -> &'a T {
        &self.0[index]
    }
}

/// Parts of a slice.
#[derive(Debug)]
pub struct Chunks<'a, T> {
    items: &'a [T],
    size: usize,
}

impl<'a, T: Sync> ParallelList for Chunks<'a, T> {
    type Item = &'a [T];

    fn len(&self) -> usize {
        self.items.len().div_ceil(self.size)
    }

    unsafe fn item(&self, index: usize) -> &'a [T] {
        let start = index * self.size;
        &self.items[start..self.items.len().min(start + self.size)]
    }
}

/// Lists of the items of mutable slices.
pub trait ParallelSliceMut<T: Send> {
    /// The items.
    fn par_iter_mut(&mut self) -> ItemsMut<'_, T>;
    /// Consecutive parts of `size` items; the last may be shorter.
    ///
    /// # Panics
    /// If `size` is 0.
    fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, T>;
}

impl<T: Send> ParallelSliceMut<T> for [T] {
    fn par_iter_mut(&mut self) -> ItemsMut<'_, T> {
        ItemsMut { len: self.len(), items: Slots(self.as_mut_ptr()), borrowed: PhantomData }
    }

    fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, T> {
        assert!(size > 0, "parts have no items");
        ChunksMut { len: self.len(), items: Slots(self.as_mut_ptr()), size, borrowed: PhantomData }
    }
}

/// The first place of a list that several threads write, each its own places.
#[derive(Debug)]
struct Slots<T>(*mut T);

// SAFETY: places are reached by unsafe calls alone, whose callers give each place to one thread at a time.
unsafe impl<T: Send> Sync for Slots<T> {}

impl<T> Slots<T> {
    fn at(&self, index: usize) -> *mut T {
        self.0.wrapping_add(index)
    }
}

/// The items of a mutable slice.
#[derive(Debug)]
pub struct ItemsMut<'a, T> {
    items: Slots<T>,
    len: usize,
    borrowed: PhantomData<&'a mut ()>,
}

impl<'a, T: Send + 'a> ParallelList for ItemsMut<'a, T> {
    type Item = &'a mut T;

    fn len(&self) -> usize {
        self.len
    }

    unsafe fn item(&self, index: usize) -> &'a mut T {
        // SAFETY: the index lies in the slice, and the caller holds no other borrow of the item.
        unsafe { &mut *self.items.at(index) }
    }
}

/// Parts of a mutable slice.
#[derive(Debug)]
pub struct ChunksMut<'a, T> {
    items: Slots<T>,
    len: usize,
    size: usize,
    borrowed: PhantomData<&'a mut ()>,
}

impl<'a, T: Send + 'a> ParallelList for ChunksMut<'a, T> {
    type Item = &'a mut [T];

    fn len(&self) -> usize {
        self.len.div_ceil(self.size)
    }

    unsafe fn item(&self, index: usize) -> &'a mut [T] {
        let start = index * self.size;
        // SAFETY: the part lies in the slice, and the caller holds no other borrow of it.
        unsafe { std::slice::from_raw_parts_mut(self.items.at(start), self.size.min(self.len - start)) }
    }
}

/// The list of `f(item)`.
#[derive(Debug)]
pub struct Map<L, F> {
    list: L,
    f: F,
}

impl<L: ParallelList, T, F: Fn(L::Item) -> T + Sync> ParallelList for Map<L, F> {
    type Item = T;

    fn len(&self) -> usize {
        self.list.len()
    }

    fn least(&self) -> usize {
        self.list.least()
    }

    unsafe fn item(&self, index: usize) -> T {
        // SAFETY: the caller's promise.
        (self.f)(unsafe { self.list.item(index) })
    }
}

/// Items with their indices.
#[derive(Debug)]
pub struct Enumerate<L> {
    list: L,
}

impl<L: ParallelList> ParallelList for Enumerate<L> {
    type Item = (usize, L::Item);

    fn len(&self) -> usize {
        self.list.len()
    }

    fn least(&self) -> usize {
        self.list.least()
    }

    unsafe fn item(&self, index: usize) -> (usize, L::Item) {
        // SAFETY: the caller's promise.
        (index, unsafe { self.list.item(index) })
    }
}

/// Pairs of items.
#[derive(Debug)]
pub struct Zip<A, B> {
    left: A,
    right: B,
}

impl<A: ParallelList, B: ParallelList> ParallelList for Zip<A, B> {
    type Item = (A::Item, B::Item);

    fn len(&self) -> usize {
        self.left.len().min(self.right.len())
    }

    fn least(&self) -> usize {
        self.left.least().max(self.right.least())
    }

    unsafe fn item(&self, index: usize) -> (A::Item, B::Item) {
        // SAFETY: the caller's promise.
        unsafe { (self.left.item(index), self.right.item(index)) }
    }
}

/// A list in ranges of at least so many items.
#[derive(Debug)]
pub struct MinLen<L> {
    list: L,
    least: usize,
}

impl<L: ParallelList> ParallelList for MinLen<L> {
    type Item = L::Item;

    fn len(&self) -> usize {
        self.list.len()
    }

    fn least(&self) -> usize {
        self.least
    }

    unsafe fn item(&self, index: usize) -> L::Item {
        // SAFETY: the caller's promise.
        unsafe { self.list.item(index) }
    }
}
