//! Messages about files: what is wrong, where, and what would be right.

mod closest_word;

pub use closest_word::closest_word;

use serde::ser::{Serialize, SerializeSeq, SerializeStruct, Serializer};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::{self, Write};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// The severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The file can be used, but probably not as meant.
    Warning,
    /// The file can't be used.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Severity::Warning => "warning",
            Severity::Error => "error",
        })
    }
}

/// One message about one place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The severity.
    pub severity: Severity,
    /// What is wrong, as a sentence without a full stop.
    pub message: String,
    /// The display name of the file.
    pub file: String,
    /// The bytes of the file that the message is about; `None` if it is about the whole file.
    pub span: Option<Range<usize>>,
    /// A short label at the span; may be empty.
    pub label: String,
    /// A hint: what would be right.
    pub help: Option<String>,
}

impl Diagnostic {
    /// An error about a whole file.
    pub fn error(file: impl Into<String>, message: impl Into<String>) -> Diagnostic {
        Diagnostic {
            severity: Severity::Error,
            message: message.into(),
            file: file.into(),
            span: None,
            label: String::new(),
            help: None,
        }
    }

    /// A warning about a whole file.
    pub fn warning(file: impl Into<String>, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(file, message) }
    }

    /// Sets the span of the message, in bytes.
    pub fn at(mut self, span: Range<usize>) -> Diagnostic {
        self.span = Some(span);
        self
    }

    /// Sets the label at the span.
    pub fn label(mut self, label: impl Into<String>) -> Diagnostic {
        self.label = label.into();
        self
    }

    /// Sets the hint.
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help = Some(help.into());
        self
    }
}

/// A position as editors count it: lines and columns from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Position {
    /// The line, from 1.
    pub line: usize,
    /// The column in the line, in characters from 1.
    pub column: usize,
}

/// Messages, and the texts to which they refer. The first [`Diagnostics::MOST`] errors and as many warnings are kept;
/// further ones are only counted.
#[derive(Clone, Default)]
pub struct Diagnostics {
    list: Vec<Diagnostic>,
    /// The number of errors, listed and dropped.
    errors: Tally,
    warnings: Tally,
    sources: HashMap<String, Arc<Source>>,
}

/// The number of messages of one severity.
#[derive(Clone, Copy, Default)]
struct Tally {
    listed: usize,
    more: usize,
}

struct Source {
    text: Arc<str>,
    lines: OnceLock<Vec<usize>>,
}

impl Source {
    /// The byte offset at which each line starts.
    fn lines(&self) -> &[usize] {
        self.lines.get_or_init(|| {
            let start = if self.text.starts_with('\u{feff}') { 3 } else { 0 };
            std::iter::once(start).chain(self.text.match_indices('\n').map(|(at, _)| at + 1)).collect()
        })
    }

    fn position(&self, offset: usize) -> Position {
        let lines = self.lines();
        let offset = floor(&self.text, offset).max(lines[0]);
        let line = lines.partition_point(|start| *start <= offset) - 1;
        Position { line: line + 1, column: self.text[lines[line]..offset].chars().count() + 1 }
    }

    /// The text of a line, numbered from 1, without its line end.
    fn line(&self, line: usize) -> &str {
        let lines = self.lines();
        let end = lines.get(line).copied().unwrap_or(self.text.len());
        self.text[lines[line - 1]..end].trim_end_matches(['\n', '\r'])
    }
}

fn floor(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

impl Diagnostics {
    /// The largest number of errors that are kept, and of warnings. A file of the wrong type may have an error at each
    /// of its bytes.
    pub const MOST: usize = 100;

    /// An empty list.
    pub fn new() -> Diagnostics {
        Diagnostics::default()
    }

    /// Stores the text of the file of this name, from which lines and columns are computed.
    pub fn add_source(&mut self, file: &str, text: impl Into<Arc<str>>) {
        self.sources.insert(file.to_owned(), Arc::new(Source { text: text.into(), lines: OnceLock::new() }));
    }

    /// The stored text of a file.
    pub fn source(&self, file: &str) -> Option<&str> {
        self.sources.get(file).map(|source| &*source.text)
    }

    /// Adds a message, or only counts it if [`Diagnostics::MOST`] of its severity are listed.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        let tally = self.tally(diagnostic.severity);
        if tally.listed < Diagnostics::MOST {
            tally.listed += 1;
            self.list.push(diagnostic);
        } else {
            tally.more += 1;
        }
    }

    /// Counts messages that were dropped elsewhere.
    pub fn count_more(&mut self, severity: Severity, count: usize) {
        self.tally(severity).more += count;
    }

    fn tally(&mut self, severity: Severity) -> &mut Tally {
        match severity {
            Severity::Error => &mut self.errors,
            Severity::Warning => &mut self.warnings,
        }
    }

    /// A summary message for each severity that has messages beyond the list.
    pub fn more(&self) -> impl Iterator<Item = Diagnostic> {
        let more = [(Severity::Error, self.errors.more), (Severity::Warning, self.warnings.more)];
        more.into_iter().filter(|(_, more)| *more > 0).map(|(severity, more)| {
            let message = match more {
                1 => format!("there is 1 more {severity}, which isn't listed"),
                _ => format!("there are {more} more {severity}s, which aren't listed"),
            };
            let file = self.list.iter().rfind(|d| d.severity == severity).map_or("", |d| &d.file);
            Diagnostic { severity, ..Diagnostic::error(file, message) }
        })
    }

    /// Appends the messages and texts of another list.
    pub fn append(&mut self, other: Diagnostics) {
        other.list.into_iter().for_each(|diagnostic| self.push(diagnostic));
        self.count_more(Severity::Error, other.errors.more);
        self.count_more(Severity::Warning, other.warnings.more);
        self.sources.extend(other.sources);
    }

    /// Removes the messages for which `keep` is false.
    pub fn retain(&mut self, keep: impl FnMut(&Diagnostic) -> bool) {
        self.list.retain(keep);
    }

    /// Replaces the sentence of each message by `change` of it.
    pub fn map_messages(&mut self, change: impl Fn(&str) -> String) {
        self.list.iter_mut().for_each(|diagnostic| diagnostic.message = change(&diagnostic.message));
    }

    /// The messages in the order of the list.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.list.iter()
    }

    /// The number of messages in the list.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there are no messages, listed or counted.
    pub fn is_empty(&self) -> bool {
        self.errors() + self.warnings() == 0
    }

    /// The number of errors, listed or only counted.
    pub fn errors(&self) -> usize {
        self.errors.listed + self.errors.more
    }

    /// The number of warnings, listed or only counted.
    pub fn warnings(&self) -> usize {
        self.warnings.listed + self.warnings.more
    }

    /// Whether any message is an error.
    pub fn has_errors(&self) -> bool {
        self.errors() > 0
    }

    /// Sorts the messages by position, file by file in the order of each file's first message.
    pub fn sort(&mut self) {
        let mut order = HashMap::new();
        for diagnostic in &self.list {
            let next = order.len();
            order.entry(diagnostic.file.clone()).or_insert(next);
        }
        self.list.sort_by_key(|d| (order[&d.file], d.span.as_ref().map_or(usize::MAX, |span| span.start)));
    }

    /// The position at which the span of a message begins.
    pub fn start(&self, diagnostic: &Diagnostic) -> Option<Position> {
        Some(self.sources.get(&diagnostic.file)?.position(diagnostic.span.as_ref()?.start))
    }

    /// The position after the last character of the span of a message.
    pub fn end(&self, diagnostic: &Diagnostic) -> Option<Position> {
        Some(self.sources.get(&diagnostic.file)?.position(diagnostic.span.as_ref()?.end))
    }

    /// A message as plain text: `file:line:column: error: message`, the source line, a marker under the span, and the
    /// hint.
    pub fn render(&self, diagnostic: &Diagnostic) -> String {
        let mut out = diagnostic.file.clone();
        let start = self.start(diagnostic);
        if let Some(p) = start {
            let _ = write!(out, ":{}:{}", p.line, p.column);
        }
        let mut out = visible(&out).into_owned();
        let _ = writeln!(out, ": {}: {}", diagnostic.severity, visible(&diagnostic.message));
        if let (Some(start), Some(end), Some(source)) =
            (start, self.end(diagnostic), self.sources.get(&diagnostic.file))
        {
            let line = source.line(start.line);
            let length = line.chars().count();
            let last = if end.line == start.line { end.column } else { length + 1 };
            excerpt(&mut out, start.line, line, start.column - 1..last - 1, &diagnostic.label);
        } else if !diagnostic.label.is_empty() {
            let _ = writeln!(out, "  {}", diagnostic.label);
        }
        if let Some(help) = &diagnostic.help {
            let _ = writeln!(out, "  help: {}", visible(help));
        }
        out
    }
}

/// The text with its control characters made visible, so that the content of a file can't control the terminal.
pub fn visible(text: &str) -> Cow<'_, str> {
    let bad = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if text.contains(bad) { text.replace(bad, "\u{fffd}").into() } else { text.into() }
}

/// The largest number of characters of a line that are shown.
const WIDTH: usize = 120;

/// Appends a line with a marker under the characters `mark`. Long lines are cut around it.
fn excerpt(out: &mut String, number: usize, line: &str, mark: Range<usize>, label: &str) {
    let number = number.to_string();
    let blank = " ".repeat(number.len());
    let from = if mark.end <= WIDTH { 0 } else { mark.start.saturating_sub(WIDTH / 4) };
    let mut shown: Vec<char> = line.chars().skip(from).take(WIDTH + 1).collect();
    let cut = shown.len() > WIDTH;
    shown.truncate(WIDTH);
    // A control character would displace the marker.
    let text: String = shown.iter().map(|c| if c.is_control() && *c != '\t' { '\u{fffd}' } else { *c }).collect();
    let (left, right) = (if from > 0 { "…" } else { "" }, if cut { "…" } else { "" });
    let _ = writeln!(out, "{number} | {left}{text}{right}");
    let indent: String = shown.iter().take(mark.start - from).map(|c| if *c == '\t' { '\t' } else { ' ' }).collect();
    let carets = "^".repeat(mark.len().clamp(1, (WIDTH + from).saturating_sub(mark.start).max(1)));
    let pad = if from > 0 { " " } else { "" };
    let text = format!("{blank} | {pad}{indent}{carets} {label}");
    let _ = writeln!(out, "{}", text.trim_end());
}

/// All messages as plain text, separated by empty lines, followed by the summary of dropped messages.
impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let more: Vec<Diagnostic> = self.more().collect();
        for (index, diagnostic) in self.iter().chain(&more).enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            f.write_str(&self.render(diagnostic))?;
        }
        Ok(())
    }
}

impl fmt::Debug for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Diagnostics {}

impl<'a> IntoIterator for &'a Diagnostics {
    type Item = &'a Diagnostic;
    type IntoIter = std::slice::Iter<'a, Diagnostic>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(diagnostic: Diagnostic) -> Diagnostics {
        let mut all = Diagnostics::new();
        all.push(diagnostic);
        all
    }
}

/// A list of messages, each with `start` and `end` as line and column beside its byte span. Dropped messages are
/// counted by a summary message.
impl Serialize for Diagnostics {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let more: Vec<Diagnostic> = self.more().collect();
        let mut list = serializer.serialize_seq(Some(self.len() + more.len()))?;
        for diagnostic in self.iter().chain(&more) {
            list.serialize_element(&Located(self, diagnostic))?;
        }
        list.end()
    }
}

struct Located<'a>(&'a Diagnostics, &'a Diagnostic);

impl Serialize for Located<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Located(all, d) = self;
        let mut out = serializer.serialize_struct("Diagnostic", 8)?;
        out.serialize_field("severity", &d.severity)?;
        out.serialize_field("message", &d.message)?;
        out.serialize_field("file", &d.file)?;
        out.serialize_field("bytes", &d.span.as_ref().map(|span| [span.start, span.end]))?;
        out.serialize_field("start", &all.start(d))?;
        out.serialize_field("end", &all.end(d))?;
        out.serialize_field("label", &d.label)?;
        out.serialize_field("help", &d.help)?;
        out.end()
    }
}

/// A list of words in a sentence, such as "PNG, JPEG and WebP" with "and" as its last word but one.
pub fn word_list<T: AsRef<str>>(words: &[T], conjunction: &str) -> String {
    let words: Vec<&str> = words.iter().map(AsRef::as_ref).collect();
    match &words[..] {
        [] => String::new(),
        [only] => (*only).to_owned(),
        [all @ .., last] => format!("{} {conjunction} {last}", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str, span: Range<usize>) -> Diagnostics {
        let mut all = Diagnostics::from(Diagnostic::error("a.kdl", "wrong").at(span).label("here").help("do this"));
        all.add_source("a.kdl", text);
        all
    }

    #[test]
    fn columns_count_characters() {
        let all = one("é\n\tñandú x\r\n", 12..13);
        assert_eq!(all.to_string(), "a.kdl:2:8: error: wrong\n2 | \tñandú x\n  | \t      ^ here\n  help: do this\n");
    }

    #[test]
    fn places_at_the_end_and_beyond_are_shown() {
        assert!(one("", 0..0).to_string().starts_with("a.kdl:1:1:"));
        assert!(one("ab", 2..2).to_string().contains("1 | ab\n  |   ^ here"));
        assert!(one("ab\n", 90..99).to_string().starts_with("a.kdl:2:1:"));
        assert!(one("\u{feff}ab", 3..4).to_string().starts_with("a.kdl:1:1:"));
    }

    #[test]
    fn several_lines_are_marked_on_the_first() {
        assert!(one("ab {\n}\n", 3..6).to_string().contains("1 | ab {\n  |    ^ here"));
    }

    #[test]
    fn long_lines_are_cut_around_the_place() {
        let text = format!("{}X{}", "a".repeat(1000), "b".repeat(1000));
        let shown = one(&text, 1000..1001).to_string();
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[1].chars().count() < 130 && lines[1].contains("…aaa"), "{shown}");
        let column = |line: &str, c: char| line.chars().position(|x| x == c);
        assert_eq!(column(lines[1], 'X'), column(lines[2], '^'));
    }

    #[test]
    fn only_so_many_messages_are_kept_and_the_others_counted() {
        let mut all = Diagnostics::new();
        for i in 0..250 {
            all.push(Diagnostic::warning("a.kdl", format!("doubt {i}")));
        }
        let mut other = Diagnostics::new();
        (0..120).for_each(|i| other.push(Diagnostic::error("b.kdl", format!("mistake {i}"))));
        all.append(other);
        all.append(Diagnostics::from(Diagnostic::error("c.kdl", "one more")));
        assert_eq!((all.len(), all.errors(), all.warnings()), (200, 121, 250));
        let text = all.to_string();
        assert!(text.contains("mistake 99") && !text.contains("mistake 100"), "{text}");
        assert!(text.contains("b.kdl: error: there are 21 more errors, which aren't listed"), "{text}");
        assert!(text.contains("a.kdl: warning: there are 150 more warnings, which aren't listed"), "{text}");
        let json = serde_json::to_value(&all).unwrap();
        assert_eq!(json.as_array().unwrap().len(), 202);
        assert_eq!(json[201]["severity"], "warning");
    }

    #[test]
    fn json_has_lines_and_bytes() {
        let json = serde_json::to_value(one("a\nbc", 3..4)).unwrap();
        assert_eq!(json[0]["start"], serde_json::json!({ "line": 2, "column": 2 }));
        assert_eq!(json[0]["bytes"], serde_json::json!([3, 4]));
    }
}
