//! Results on the standard output, whose reader may close it early.

use crate::exit::Exit;
use crate::failure::Failure;
use serde::Serialize;
use std::io::{self, Write};

/// Prints results.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    check_open()?;
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Failure::stdout(&e))
}

/// Prints a value as indented JSON.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let json = serde_json::to_string_pretty(value)
        .map_err(|e| Failure::new(Exit::Failed, format!("the answer can't be written as JSON: {e}")))?;
    print(&(json + "\n"))
}

/// Checks that there is a standard output. If the caller has closed it (`>&-`), results would be lost silently.
pub(crate) fn check_open() -> Result<(), Failure> {
    if is_closed() { Err(Failure::new(Exit::Failed, "the standard output is closed")) } else { Ok(()) }
}

/// Whether the standard output is closed. Before `main`, std opens `/dev/null` in its place for reading and writing. A
/// redirection by the user opens it for writing only.
#[cfg(target_os = "linux")]
fn is_closed() -> bool {
    use rustix::fs::{OFlags, fcntl_getfl, fstat, major, minor};
    let out = io::stdout();
    let is_null = fstat(&out).is_ok_and(|stat| (major(stat.st_rdev), minor(stat.st_rdev)) == (1, 3));
    is_null && fcntl_getfl(&out).is_ok_and(|flags| flags & OFlags::ACCMODE == OFlags::RDWR)
}

#[cfg(not(target_os = "linux"))]
fn is_closed() -> bool {
    false
}
