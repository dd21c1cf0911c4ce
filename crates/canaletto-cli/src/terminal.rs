//! Colours, where there is a terminal that wants them.

use std::env;
use std::io::{self, IsTerminal};

/// Paints words, or leaves them alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint(bool);

impl Paint {
    /// For stderr: colours only on a terminal, and not if NO_COLOR is set (no-color.org) or the terminal is dumb.
    pub(crate) fn stderr() -> Paint {
        let unwanted = env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
        let dumb = env::var_os("TERM").is_some_and(|v| v == "dumb");
        Paint(!unwanted && !dumb && io::stderr().is_terminal())
    }

    pub(crate) fn on(self) -> bool {
        self.0
    }

    pub(crate) fn red(self, text: &str) -> String {
        self.with("1;31", text)
    }

    pub(crate) fn yellow(self, text: &str) -> String {
        self.with("1;33", text)
    }

    pub(crate) fn cyan(self, text: &str) -> String {
        self.with("1;36", text)
    }

    fn with(self, code: &str, text: &str) -> String {
        if self.0 { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}
