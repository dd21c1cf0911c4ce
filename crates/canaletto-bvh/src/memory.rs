//! Memory in large pages, out-of-memory errors, and prefetch hints.
//!
//! Nodes and primitives lie in large pages where the system has them. In a large tree with small pages, a ray spends
//! most of its time on TLB misses. Lists that are filled from files use large pages too, since mapping millions of
//! small pages takes longer than reading the file.

use bytemuck::Zeroable;
use canaletto_parallel::prelude::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fmt;
use std::io::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The error that an allocation of so many bytes failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} {}", NoMemory::WORDS, Size(*.0))]
pub struct NoMemory(pub u64);

impl NoMemory {
    /// The words that its message starts with. They tell it apart from other messages about files.
    pub const WORDS: &str = "there is no memory for";
}

/// A number of bytes, displayed with a unit.
struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            bytes @ ..10_000 => write!(f, "{bytes} bytes"),
            bytes @ ..10_000_000 => write!(f, "{:.1} kB", bytes as f64 / 1e3),
            bytes @ ..10_000_000_000 => write!(f, "{:.1} MB", bytes as f64 / 1e6),
            bytes => write!(f, "{:.1} GB", bytes as f64 / 1e9),
        }
    }
}

/// Checks whether `bytes` can be allocated, by allocating and freeing them.
///
/// # Errors
/// [`NoMemory`] if they can't.
pub fn room(bytes: u64) -> Result<(), NoMemory> {
    let size = usize::try_from(bytes).map_err(|_| NoMemory(bytes))?;
    reserve(&mut Vec::<u8>::new(), size)
}

/// Reserves room for `more` further items of a list.
///
/// # Errors
/// [`NoMemory`] if the allocation fails.
pub fn reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), NoMemory> {
    handling_failure(|| list.try_reserve(more))
        .map_err(|_| NoMemory((more as u64).saturating_mul(size_of::<T>() as u64)))
}

thread_local! {
    /// Whether the running code handles a failed allocation itself. [`Guarded`] then doesn't end the process.
    static HANDLES_FAILURE: Cell<bool> = const { Cell::new(false) };
}

fn handling_failure<T>(work: impl FnOnce() -> T) -> T {
    let before = HANDLES_FAILURE.replace(true);
    let result = work();
    HANDLES_FAILURE.set(before);
    result
}

/// The system's allocator for programs. When memory runs out, it ends the process with exit code 1 and a message,
/// instead of aborting it. The message names the size of the failed allocation and the work in progress (see
/// [`working_at`]). Allocations by [`room`] and [`reserve`] return an error instead.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guarded;

/// The work in progress, as the message names it.
static WORK: Mutex<&str> = Mutex::new("working");

/// Names the work for which memory is allocated from now on, such as "reading the scene".
pub fn working_at(what: &'static str) {
    if let Ok(mut work) = WORK.try_lock() {
        *work = what;
    }
}

impl Guarded {
    /// Reports a failed allocation and ends the process, unless the running code handles the failure itself.
    #[cold]
    fn allocation_failed(size: usize) {
        static REPORTED: AtomicBool = AtomicBool::new(false);
        if HANDLES_FAILURE.try_with(Cell::get).unwrap_or(false) || REPORTED.swap(true, Ordering::SeqCst) {
            return;
        }
        let what = WORK.try_lock().map_or("working", |work| *work);
        // No code here may allocate.
        let mut text = [0u8; 256];
        let mut rest = &mut text[..];
        let _ = writeln!(rest, "error: out of memory while {what}: {} more are needed", Size(size as u64));
        let left = rest.len();
        let _ = std::io::stderr().write_all(&text[..text.len() - left]);
        exit_now();
    }
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code)] // A call that ends the process.
fn exit_now() -> ! {
    // SAFETY: the call ends the process at once and allocates nothing.
    unsafe { libc::_exit(1) }
}

#[cfg(not(target_os = "linux"))]
fn exit_now() -> ! {
    std::process::exit(1)
}

// SAFETY: all calls are passed to the system's allocator unchanged, and its results are returned unchanged.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Guarded {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        let place = unsafe { System.alloc(layout) };
        if place.is_null() {
            Guarded::allocation_failed(layout.size());
        }
        place
    }

    #[inline]
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(place, layout) }
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        let place = unsafe { System.alloc_zeroed(layout) };
        if place.is_null() {
            Guarded::allocation_failed(layout.size());
        }
        place
    }

    #[inline]
    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's promise.
        let place = unsafe { System.realloc(place, layout, size) };
        if place.is_null() {
            Guarded::allocation_failed(size);
        }
        place
    }
}

/// A list of `count` zeros. The system maps the pages of a large list when they are first touched, so that the call
/// itself takes no time. Threads that write the list in parallel then map its pages in parallel, too.
pub fn zeros<T: Zeroable>(count: usize) -> Vec<T> {
    let list = bytemuck::zeroed_vec(count);
    advise(list.as_ptr(), count);
    list
}

/// An empty list with room for `capacity` items, in large pages.
pub(crate) fn in_large_pages<T>(capacity: usize) -> Vec<T> {
    let list = Vec::with_capacity(capacity);
    advise(list.as_ptr(), capacity);
    list
}

/// The list of `item(i)` for all i below `count`, computed in parallel, in large pages, with room for `room` further
/// items.
pub(crate) fn collected<T: Send>(count: usize, room: usize, item: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    let mut list = in_large_pages(count + room);
    (0..count).into_par_iter().with_min_len(1024).map(item).collect_into_vec(&mut list);
    list
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code)] // A hint to the system about our own memory.
fn advise<T>(start: *const T, capacity: usize) {
    const LARGE: usize = 1 << 21;
    /// From this size on, one call is faster than a page fault for each page.
    const SOME: usize = 1 << 15;
    if capacity * size_of::<T>() < SOME {
        return;
    }
    // SAFETY: the call only returns a number.
    let page = usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(LARGE);
    let (first, end) = (start.addr().next_multiple_of(page), (start.addr() + capacity * size_of::<T>()) / page * page);
    if end.saturating_sub(first) < SOME {
        return;
    }
    // The large pages lie between these two addresses, if there are any.
    let (low, high) = (first.next_multiple_of(LARGE).min(end), (end / LARGE * LARGE).max(first));
    let parts = if low < high {
        [
            (first..low, libc::MADV_POPULATE_WRITE),
            (low..high, libc::MADV_HUGEPAGE),
            (high..end, libc::MADV_POPULATE_WRITE),
        ]
    } else {
        [(first..end, libc::MADV_POPULATE_WRITE), (end..end, 0), (end..end, 0)]
    };
    for (part, advice) in parts.into_iter().filter(|(part, _)| !part.is_empty()) {
        let place = start.cast::<u8>().wrapping_add(part.start - start.addr()).cast_mut().cast();
        // SAFETY: the pages lie wholly within the allocation. The advice changes only how and when they are mapped.
        // Where the system ignores it, the program works as without it.
        unsafe {
            libc::madvise(place, part.len(), advice);
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn advise<T>(_start: *const T, _capacity: usize) {}

/// Prefetches the cache line of an address. It does nothing where stable Rust has no instruction for it.
#[inline(always)]
#[allow(unsafe_code)] // A prefetch intrinsic.
pub(crate) fn prefetch(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: every x86-64 has SSE; a prefetch of any address is harmless.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Prefetches all cache lines of a list.
#[inline(always)]
pub(crate) fn prefetch_all<T>(list: &[T]) {
    const LINE: usize = 64;
    for offset in (0..size_of_val(list)).step_by(LINE) {
        prefetch(list.as_ptr().cast::<u8>().wrapping_add(offset));
    }
}
