//! Results go to the standard output; whoever reads them may stop reading.

use crate::exit::Exit;
use crate::failure::Failure;
use std::io::{self, Write};

/// Prints results.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    check_open()?;
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Failure::stdout(&e))
}

/// Prints a value as indented JSON.
pub(crate) fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    print(&format!("{value:#}\n"))
}

/// Whether there is a standard output at all. One that the caller has closed (`>&-`) would swallow results without a word.
pub(crate) fn check_open() -> Result<(), Failure> {
    if is_closed() { Err(Failure::new(Exit::Failed, "the standard output is closed")) } else { Ok(()) }
}

/// Before `main`, std opens `/dev/null` for reading and writing in the place of a standard output that is closed. One that the
/// user sends there is open for writing only.
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
