//! Memory for what rays visit at random: in large pages, where the system gives them, since most of the time of a ray in a large tree is
//! spent on finding out where a small page lies. Lists that are filled from files have them too: to bring about millions of
//! small pages takes longer than to read the file. And hints of what will be read.

use bytemuck::Zeroable;
use rayon::prelude::*;

/// A list of `count` zeros. The system brings about large lists where they are first touched, so that this takes no time, and
/// whoever writes them in parallel gets memory in parallel.
pub fn zeros<T: Zeroable>(count: usize) -> Vec<T> {
    let list = bytemuck::zeroed_vec(count);
    advise(list.as_ptr(), count);
    list
}

/// An empty list with room for `capacity` items.
pub(crate) fn in_large_pages<T>(capacity: usize) -> Vec<T> {
    let list = Vec::with_capacity(capacity);
    advise(list.as_ptr(), capacity);
    list
}

/// What many threads make of the numbers below `count`, in large pages, with room for so many items more.
pub(crate) fn collected<T: Send>(count: usize, room: usize, item: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    let mut list = in_large_pages(count + room);
    (0..count).into_par_iter().with_min_len(1024).map(item).collect_into_vec(&mut list);
    list
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code)] // A hint to the system about memory that is ours.
fn advise<T>(start: *const T, capacity: usize) {
    const LARGE: usize = 1 << 21;
    /// From here on one call is faster than to be interrupted at each page.
    const SOME: usize = 1 << 15;
    if capacity * size_of::<T>() < SOME {
        return;
    }
    // SAFETY: asks for a number.
    let page = usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(LARGE);
    let (first, end) = (start.addr().next_multiple_of(page), (start.addr() + capacity * size_of::<T>()) / page * page);
    if end.saturating_sub(first) < SOME {
        return;
    }
    // Large pages have room between these, if there are any.
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
        // SAFETY: the pages lie wholly within the allocation, and the advice changes nothing but how and when they are mapped. Where it
        // isn't taken, all goes on as before.
        unsafe {
            libc::madvise(place, part.len(), advice);
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn advise<T>(_start: *const T, _capacity: usize) {}

/// Tells the caches that this address will be read. Does nothing where stable Rust has no instruction for it.
#[inline(always)]
#[allow(unsafe_code)] // A hint.
pub(crate) fn prefetch(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: every x86-64 has SSE; a prefetch of any address is harmless.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// The same with all of a list.
#[inline(always)]
pub(crate) fn prefetch_all<T>(list: &[T]) {
    const LINE: usize = 64;
    for offset in (0..size_of_val(list)).step_by(LINE) {
        prefetch(list.as_ptr().cast::<u8>().wrapping_add(offset));
    }
}
