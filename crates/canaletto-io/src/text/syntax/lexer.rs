//! Characters, white space and comments.

use super::tree::Span;
use crate::text::report::{Message, Report};

/// A cursor in a text.
pub(super) struct Lexer<'a> {
    pub(super) text: &'a str,
    /// The offset of the next byte.
    pub(super) at: usize,
    /// The offset of `text` in its file.
    base: usize,
    file: u16,
    /// Whether `true` may stand for `#true`.
    pub(super) bare_keywords: bool,
    pub(super) report: &'a mut Report,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, base: usize, file: u16, report: &'a mut Report) -> Lexer<'a> {
        let at = if base == 0 && text.starts_with('\u{feff}') { 3 } else { 0 };
        Lexer { text, at, base, file, bare_keywords: false, report }
    }

    pub(super) fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    pub(super) fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    pub(super) fn looking_at(&self, what: &str) -> bool {
        self.rest().starts_with(what)
    }

    /// Skips `what` if it comes next, and returns whether it did.
    pub(super) fn take(&mut self, what: &str) -> bool {
        let found = self.looking_at(what);
        if found {
            self.at += what.len();
        }
        found
    }

    pub(super) fn bump(&mut self) {
        self.at += self.peek().map_or(0, char::len_utf8);
    }

    pub(super) fn span(&self, start: usize, end: usize) -> Span {
        Span { file: self.file, start: (self.base + start) as u32, end: (self.base + end) as u32 }
    }

    pub(super) fn span_from(&self, start: usize) -> Span {
        self.span(start, self.at)
    }

    /// The span of the next character.
    pub(super) fn span_here(&self) -> Span {
        self.span(self.at, self.at + self.peek().map_or(0, char::len_utf8))
    }

    pub(super) fn error(&mut self, span: Span, message: impl Into<String>, help: &str) {
        let message = Message::error(span, message);
        self.report.push(if help.is_empty() { message } else { message.help(help) });
    }

    /// Skips blanks, `/* */` comments and line continuations; returns whether there were any.
    pub(super) fn skip_node_space(&mut self) -> bool {
        let start = self.at;
        loop {
            match self.peek() {
                Some(c) if is_blank(c) => self.bump(),
                Some('/') if self.looking_at("/*") => self.skip_block_comment(),
                Some('\\') => {
                    let backslash = self.at;
                    self.bump();
                    while self.peek().is_some_and(is_blank) || self.looking_at("/*") {
                        if self.looking_at("/*") { self.skip_block_comment() } else { self.bump() }
                    }
                    if self.looking_at("//") {
                        self.skip_line();
                    }
                    if !self.skip_newline() && self.peek().is_some() {
                        let span = self.span(backslash, backslash + 1);
                        self.error(
                            span,
                            "a \\ continues a line: nothing may follow it there",
                            "texts with \\ stand in quotes",
                        );
                    }
                }
                _ => return self.at > start,
            }
        }
    }

    /// Skips white space, comments and line ends between nodes.
    pub(super) fn skip_line_space(&mut self) {
        loop {
            if self.skip_node_space() || self.skip_newline() {
                continue;
            }
            if !self.looking_at("//") {
                return;
            }
            self.skip_line();
        }
    }

    /// Skips one line end; returns whether there was one.
    pub(super) fn skip_newline(&mut self) -> bool {
        if self.take("\r\n") {
            return true;
        }
        let newline = self.peek().is_some_and(is_newline);
        if newline {
            self.bump();
        }
        newline
    }

    /// Skips to the end of the line.
    pub(super) fn skip_line(&mut self) {
        self.at += self.rest().find(is_newline).unwrap_or(self.rest().len());
    }

    fn skip_block_comment(&mut self) {
        let start = self.at;
        let bytes = self.text.as_bytes();
        let mut depth = 0usize;
        while self.at < bytes.len() {
            match &bytes[self.at..bytes.len().min(self.at + 2)] {
                b"/*" => depth += 1,
                b"*/" => depth -= 1,
                _ => {
                    self.at += 1;
                    continue;
                }
            }
            self.at += 2;
            if depth == 0 {
                return;
            }
        }
        let span = self.span(start, start + 2);
        self.error(span, "this comment is never closed", "close it with */; comments inside it need their own");
    }

    /// Reports characters that KDL forbids everywhere.
    pub(super) fn check_characters(&mut self) {
        let found: Vec<(usize, char)> = self
            .text
            .char_indices()
            .filter(|&(at, c)| is_forbidden(c) && !(c == '\u{feff}' && at == 0 && self.base == 0))
            .take(20)
            .collect();
        for (at, c) in found {
            let span = self.span(at, at + c.len_utf8());
            self.error(span, format!("the invisible character U+{:04X} can't stand in scene text", c as u32), "");
        }
    }
}

pub(super) fn is_blank(c: char) -> bool {
    matches!(c, '\t' | ' ' | '\u{a0}' | '\u{1680}' | '\u{2000}'..='\u{200a}' | '\u{202f}' | '\u{205f}' | '\u{3000}')
}

pub(super) fn is_newline(c: char) -> bool {
    matches!(c, '\n' | '\r' | '\u{85}' | '\u{b}' | '\u{c}' | '\u{2028}' | '\u{2029}')
}

/// Whether `c` is a control character or a mark that changes the direction of text.
fn is_forbidden(c: char) -> bool {
    matches!(c, '\0'..='\u{8}' | '\u{e}'..='\u{1f}' | '\u{7f}' | '\u{200e}' | '\u{200f}'
        | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

/// Whether `c` may be in an unquoted word.
pub(super) fn is_word(c: char) -> bool {
    !is_blank(c)
        && !is_newline(c)
        && !matches!(c, '\\' | '/' | '(' | ')' | '{' | '}' | ';' | '[' | ']' | '"' | '#' | '=')
        && !is_forbidden(c)
}
