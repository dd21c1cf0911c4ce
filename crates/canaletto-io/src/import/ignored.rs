//! Unsupported words of a file: counted, and reported once for each word.

use super::lines::Token;
use crate::diagnostic::{Diagnostic, Diagnostics};
use std::ops::Range;

/// Ignored words in the order of their first occurrence.
#[derive(Default)]
pub(super) struct Ignored {
    list: Vec<Entry>,
    more: usize,
    /// Whether this is the list of a part of a file, which is complete.
    part: bool,
}

struct Entry {
    word: Vec<u8>,
    first: Range<usize>,
    count: usize,
    why: &'static str,
}

impl Ignored {
    /// The largest number of words that are listed; further ones are only counted.
    const MAX: usize = 24;

    /// An empty list for a part of a file, to be [appended](Ignored::append) to others.
    pub(super) fn of_part() -> Ignored {
        Ignored { part: true, ..Ignored::default() }
    }

    /// Counts a word; `why` completes "`word` …".
    pub(super) fn note(&mut self, word: &Token<'_>, why: &'static str) {
        let mut told = self.list.iter_mut().take(Ignored::MAX);
        if let Some(entry) = told.find(|e| e.word == word.text && e.why == why) {
            entry.count += 1;
        } else if self.part || self.list.len() < Ignored::MAX {
            self.list.push(Entry { word: word.text.into(), first: word.span(), count: 1, why });
        } else {
            self.more += 1;
        }
    }

    /// Appends the words of a later part of the file. The limit applies only here, so that the result doesn't depend on
    /// the division into parts.
    pub(super) fn append(&mut self, later: Ignored) {
        for entry in later.list {
            if let Some(known) = self.list.iter_mut().find(|e| e.word == entry.word && e.why == entry.why) {
                known.count += entry.count;
            } else if self.list.len() < Ignored::MAX {
                self.list.push(entry);
            } else {
                self.more += entry.count;
            }
        }
    }

    /// Adds a warning for each word.
    pub(super) fn report(self, file: &str, into: &mut Diagnostics) {
        for entry in self.list {
            let word = Token { start: 0, text: &entry.word }.shown();
            let count = if entry.count > 1 { format!(" ({} times)", entry.count) } else { String::new() };
            into.push(Diagnostic::warning(file, format!("`{word}` {}{count}", entry.why)).at(entry.first));
        }
        if self.more > 0 {
            into.push(Diagnostic::warning(
                file,
                format!("{} more lines with other unknown words are left out", self.more),
            ));
        }
    }
}
