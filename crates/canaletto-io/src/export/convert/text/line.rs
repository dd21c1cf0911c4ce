//! The layout of a written scene text: nodes with their values, and how they are cut into lines.

use std::fmt::Write;

/// A node of the text.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line {
    /// The word, with the values and properties behind it.
    head: String,
    children: Vec<Line>,
}

/// The longest line of a node with its block.
const WIDTH: usize = 110;

impl Line {
    /// A node without values.
    pub(super) fn new(word: &str) -> Line {
        Line { head: word.to_owned(), children: Vec::new() }
    }

    /// A node with values, which are scene text already.
    pub(super) fn of(word: &str, values: impl AsRef<str>) -> Line {
        Line::new(word).value(values)
    }

    /// A node with a text.
    pub(super) fn named(word: &str, text: &str) -> Line {
        Line::of(word, quoted(text))
    }

    /// Adds a value, which is scene text already.
    #[must_use]
    pub(super) fn value(mut self, value: impl AsRef<str>) -> Line {
        let _ = write!(self.head, " {}", value.as_ref());
        self
    }

    /// Adds a property, whose value is scene text already.
    #[must_use]
    pub(super) fn property(mut self, word: &str, value: impl AsRef<str>) -> Line {
        let _ = write!(self.head, " {word}={}", value.as_ref());
        self
    }

    /// Adds a property if there is a value.
    #[must_use]
    pub(super) fn property_if(self, word: &str, value: Option<String>) -> Line {
        match value {
            Some(value) => self.property(word, value),
            None => self,
        }
    }

    /// Adds a node to the block.
    #[must_use]
    pub(super) fn child(mut self, child: Line) -> Line {
        self.children.push(child);
        self
    }

    /// Adds nodes to the block.
    #[must_use]
    pub(super) fn children(mut self, more: impl IntoIterator<Item = Line>) -> Line {
        self.children.extend(more);
        self
    }

    /// Adds a node with a value if there is one.
    #[must_use]
    pub(super) fn child_if(self, word: &str, value: Option<String>) -> Line {
        let child = value.map(|value| Line::of(word, value));
        self.children(child)
    }

    /// Whether the block is empty.
    pub(super) fn has_no_block(&self) -> bool {
        self.children.is_empty()
    }

    /// Appends the node as lines of text.
    pub(super) fn write(&self, depth: usize, text: &mut String) {
        let indent = "    ".repeat(depth);
        if let Some(line) = self.on_one_line().filter(|line| indent.len() + line.len() <= WIDTH || self.is_bare()) {
            let _ = writeln!(text, "{indent}{line}");
            return;
        }
        let _ = writeln!(text, "{indent}{} {{", self.head);
        for child in &self.children {
            child.write(depth + 1, text);
        }
        let _ = writeln!(text, "{indent}}}");
    }

    fn is_bare(&self) -> bool {
        self.children.is_empty()
    }

    /// The node on one line, unless blocks stand three deep in it. Several nodes of one word have lines of their own.
    fn on_one_line(&self) -> Option<String> {
        let is_list = self.children.windows(2).any(|pair| pair[0].word() == pair[1].word());
        if self.depth() > 2 || is_list {
            return None;
        }
        if self.children.is_empty() {
            return Some(self.head.clone());
        }
        let parts: Option<Vec<String>> = self.children.iter().map(Line::on_one_line).collect();
        Some(format!("{} {{ {} }}", self.head, parts?.join("; ")))
    }

    fn word(&self) -> &str {
        self.head.split(' ').next().unwrap_or_default()
    }

    /// How deep blocks stand in it.
    fn depth(&self) -> usize {
        self.children.iter().map(|child| child.depth() + 1).max().unwrap_or(0)
    }
}

/// A text in quotes. Characters that scene text forbids become escapes.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if is_escaped(c) => {
                let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Whether a character is a control character, a line end or a mark that changes the direction of text.
fn is_escaped(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

/// A flag as scene text.
pub(super) fn flag(value: bool) -> String {
    format!("#{value}")
}
