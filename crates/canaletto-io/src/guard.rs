//! A boundary around third-party decoders: a panic inside becomes `None`, without a message on standard error.
//!
//! Files may be hostile and decoders have faults. A panic in a decoder is caught on its own thread, so that a damaged
//! picture yields an error and doesn't end the program. Panics outside the boundary reach the previous panic hook.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// The number of nested [`guarded`] calls on this thread.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// The result of `f`, or `None` if it panicked. After a panic, the values that `f` changed must not be used. `f` must
/// not hand work to other threads.
pub(crate) fn guarded<T>(f: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if DEPTH.get() == 0 {
                told(info);
            }
        }));
    });
    DEPTH.set(DEPTH.get() + 1);
    let result = panic::catch_unwind(AssertUnwindSafe(f));
    DEPTH.set(DEPTH.get() - 1);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_nothing_and_the_next_one_is_caught_too() {
        assert_eq!(guarded(|| 3), Some(3));
        for i in 0..3usize {
            let numbers = [0u8; 2];
            assert_eq!(guarded(|| numbers[..i].iter().map(|n| 1 / n).sum::<u8>()), (i == 0).then_some(0));
        }
        let inner: Option<Option<()>> = guarded(|| guarded(|| panic!("inside")));
        assert_eq!(inner, Some(None));
        assert_eq!(DEPTH.get(), 0);
    }
}
