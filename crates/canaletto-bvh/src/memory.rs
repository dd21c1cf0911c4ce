//! Memory for what rays visit at random: in large pages, where the system gives them, since most of the time of a ray in a large tree is
//! spent on finding out where a small page lies. Lists that are filled from files have them too: to bring about millions of
//! small pages takes longer than to read the file. And hints of what will be read.

use bytemuck::Zeroable;

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

#[cfg(target_os = "linux")]
#[allow(unsafe_code)] // A hint to the system about memory that is ours.
fn advise<T>(start: *const T, capacity: usize) {
    /// No system's small pages are larger.
    const PAGE: usize = 1 << 16;
    const LARGE: usize = 1 << 21;
    /// From here on one call is faster than to be interrupted at each page.
    const SOME: usize = 1 << 18;
    let end = (start.addr() + capacity * size_of::<T>()) / PAGE * PAGE;
    let skip = start.addr().next_multiple_of(PAGE) - start.addr();
    let first = start.cast::<u8>().wrapping_add(skip);
    let advice = match end.saturating_sub(first.addr()) {
        LARGE.. => libc::MADV_HUGEPAGE,
        SOME.. => libc::MADV_POPULATE_WRITE,
        _ => return,
    };
    // SAFETY: the pages lie wholly within the allocation, and the advice changes nothing but how and when they are mapped. Where it
    // isn't taken, all goes on as before.
    unsafe {
        libc::madvise(first.cast_mut().cast(), end - first.addr(), advice);
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
