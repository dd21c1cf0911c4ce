//! Colours for terminals that support them.

use std::env;
use std::io::{self, IsTerminal};

/// Adds colours to words, or leaves the words unchanged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint(bool);

impl Paint {
    /// The setting for stderr. There are colours only on a terminal, unless NO_COLOR is set (no-color.org) or the
    /// terminal is dumb.
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
