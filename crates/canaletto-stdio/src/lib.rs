//! Whether the standard output was closed when the program started.
//!
//! Before `main`, Rust's runtime opens `/dev/null` for reading and writing in the place of a closed stream. A caller
//! that wants no output passes the same file: Python's `DEVNULL` and Node's `ignore` do. Nothing tells the two apart
//! later. So a function that the loader calls before the runtime asks the system.

/// Whether the standard output was closed when the program started, as `>&-` does. Results would be lost silently.
/// False where the system can't be asked.
pub fn stdout_was_closed() -> bool {
    #[cfg(target_os = "linux")]
    return linux::WAS_CLOSED.load(std::sync::atomic::Ordering::Relaxed);
    #[cfg(not(target_os = "linux"))]
    false
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code)]
mod linux {
    use std::sync::atomic::{AtomicBool, Ordering};

    pub(super) static WAS_CLOSED: AtomicBool = AtomicBool::new(false);

    /// The loader calls the functions of this section before the program's start.
    #[used]
    #[unsafe(link_section = ".init_array")]
    static BEFORE_START: extern "C" fn() = ask;

    extern "C" fn ask() {
        // SAFETY: `F_GETFD` takes no pointer and changes nothing; it fails if there is no such file.
        let flags = unsafe { libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) };
        WAS_CLOSED.store(flags < 0, Ordering::Relaxed);
    }
}
