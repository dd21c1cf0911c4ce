//! Results on the standard output, whose reader may close it early.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::output::write_stdout;
use serde::Serialize;

/// Prints results.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    write_stdout(text.as_bytes())
}

/// Prints a value as indented JSON.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let json = serde_json::to_string_pretty(value)
        .map_err(|e| Failure::new(Exit::Failed, format!("the answer can't be written as JSON: {e}")))?;
    print(&(json + "\n"))
}
