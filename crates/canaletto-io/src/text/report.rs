//! The collection of messages before their spans are resolved to file names.

use super::files::Files;
use super::syntax::Span;
use crate::diagnostic::{Diagnostic, Diagnostics, Severity};

/// A message about a span of bytes.
#[derive(Clone)]
pub(crate) struct Message {
    severity: Severity,
    span: Option<Span>,
    message: String,
    label: String,
    help: Option<String>,
}

impl Message {
    pub(crate) fn error(span: Span, message: impl Into<String>) -> Message {
        Message {
            severity: Severity::Error,
            span: Some(span),
            message: message.into(),
            label: String::new(),
            help: None,
        }
    }

    pub(crate) fn warning(span: Option<Span>, message: impl Into<String>) -> Message {
        Message { severity: Severity::Warning, span, message: message.into(), label: String::new(), help: None }
    }

    pub(crate) fn label(mut self, label: impl Into<String>) -> Message {
        self.label = label.into();
        self
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Message {
        self.help = Some(help.into());
        self
    }
}

/// The largest number of messages that are kept until they are sorted by position. A file that isn't a scene may have
/// an error at each of its bytes.
const MAX_MESSAGES: usize = 10_000;

/// The number of messages that were dropped.
#[derive(Clone, Copy, Default)]
struct Dropped {
    errors: usize,
    warnings: usize,
}

/// All messages of a scene.
#[derive(Clone, Default)]
pub(crate) struct Report {
    messages: Vec<Message>,
    /// The number of errors and warnings beyond those that are kept.
    dropped: Dropped,
    /// Finished messages about files that aren't scene text.
    foreign: Diagnostics,
}

impl Report {
    pub(crate) fn push(&mut self, message: Message) {
        match message.severity {
            _ if self.messages.len() < MAX_MESSAGES => self.messages.push(message),
            Severity::Error => self.dropped.errors += 1,
            Severity::Warning => self.dropped.warnings += 1,
        }
    }

    pub(crate) fn error(&mut self, span: Span, message: impl Into<String>) {
        self.push(Message::error(span, message));
    }

    /// Adds the messages of another report.
    pub(crate) fn repeat(&mut self, other: &Report) {
        other.messages.iter().for_each(|message| self.push(message.clone()));
        self.dropped.errors += other.dropped.errors;
        self.dropped.warnings += other.dropped.warnings;
    }

    /// The number of messages, kept or dropped.
    pub(crate) fn count(&self) -> usize {
        self.messages.len() + self.dropped.errors + self.dropped.warnings
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.dropped.errors > 0
            || self.messages.iter().any(|m| m.severity == Severity::Error)
            || self.foreign.has_errors()
    }

    pub(crate) fn append(&mut self, foreign: Diagnostics) {
        self.foreign.append(foreign);
    }

    /// The messages, each with the name of its file. Messages without a span are about the first file.
    pub(crate) fn finish(self, files: &Files) -> Diagnostics {
        let mut out = Diagnostics::new();
        let mut list = self.messages;
        // Texts are large, so they are stored only if messages refer to them.
        for file in files.iter().filter(|_| !list.is_empty()) {
            out.add_source(&file.name, file.text.clone());
        }
        list.sort_by_key(|m| m.span.map_or((u16::MAX, 0), |span| (span.file, span.start)));
        // An assignment that changes several nodes is reported once.
        list.dedup_by(|b, a| b.span.is_some() && a.span == b.span && a.message == b.message);
        for m in list {
            out.push(Diagnostic {
                severity: m.severity,
                message: m.message,
                file: files.get(m.span.map_or(0, |span| span.file)).map_or_else(String::new, |f| f.name.clone()),
                span: m.span.map(|span| span.start as usize..span.end as usize),
                label: m.label,
                help: m.help,
            });
        }
        out.count_more(Severity::Error, self.dropped.errors);
        out.count_more(Severity::Warning, self.dropped.warnings);
        out.append(self.foreign);
        out
    }
}
