//! Lines on stdout. A closed pipe (`peers list | head -1`) ends the program with success.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process::ExitCode;

/// The error that prevents further output. It unwinds to [`run`], so destructors run and no panic message appears.
struct Unheard(std::io::Error);

/// Writes a line; use [`say!`](crate::say!).
#[doc(hidden)]
pub fn line(text: Arguments<'_>, end: &str) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_fmt(text).and_then(|()| out.write_all(end.as_bytes())).and_then(|()| out.flush()) {
        drop(out);
        resume_unwind(Box::new(Unheard(error)));
    }
}

/// `println!` that doesn't panic; only within [`run`](crate::say::run).
#[macro_export]
macro_rules! say {
    () => { $crate::say::line(format_args!(""), "\n") };
    ($($text:tt)*) => { $crate::say::line(format_args!($($text)*), "\n") };
}

/// `print!` that doesn't panic; only within [`run`](crate::say::run).
#[macro_export]
macro_rules! say_on {
    ($($text:tt)*) => { $crate::say::line(format_args!($($text)*), "") };
}

/// Runs a program that prints its results by [`say!`](crate::say!). Prints the error if it fails.
pub fn run(program: impl FnOnce() -> Result<(), String>) -> ExitCode {
    let message = match catch_unwind(AssertUnwindSafe(program)) {
        Ok(Ok(())) => return ExitCode::SUCCESS,
        Ok(Err(message)) => message,
        Err(payload) => match payload.downcast::<Unheard>() {
            Ok(unheard) if unheard.0.kind() == ErrorKind::BrokenPipe => return ExitCode::SUCCESS,
            Ok(unheard) => format!("stdout: {}", unheard.0),
            Err(other) => resume_unwind(other),
        },
    };
    // An error of this output can't be reported.
    let _ = writeln!(std::io::stderr(), "error: {message}");
    ExitCode::FAILURE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unheard(kind: ErrorKind) -> ExitCode {
        run(|| resume_unwind(Box::new(Unheard(kind.into()))))
    }

    #[test]
    fn a_reader_who_has_seen_enough_is_no_failure_and_other_errors_are() {
        assert_eq!(run(|| Ok(())), ExitCode::SUCCESS);
        assert_eq!(run(|| Err("no".into())), ExitCode::FAILURE);
        assert_eq!(unheard(ErrorKind::BrokenPipe), ExitCode::SUCCESS);
        assert_eq!(unheard(ErrorKind::StorageFull), ExitCode::FAILURE);
    }
}
