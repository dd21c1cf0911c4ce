//! Lines, words and numbers of a byte text with their offsets, for formats of words between spaces.

use super::number;
use super::text::Piece;
use crate::diagnostic::Diagnostic;
use glam::{DVec3, Vec3};
use std::ops::Range;

/// A part of a file: a word without spaces, or a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token<'a> {
    /// The offset of the start in the file.
    pub(super) start: usize,
    /// The bytes.
    pub(super) text: &'a [u8],
}

impl<'a> Token<'a> {
    /// The byte range in the file.
    pub(super) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// The text for messages, shortened.
    pub(super) fn shown(&self) -> String {
        const MAX: usize = 40;
        // A character has at most four bytes, and the last one may be cut.
        let start = &self.text[..self.text.len().min(4 * MAX + 3)];
        let valid = match std::str::from_utf8(start) {
            Err(error) if error.error_len().is_none() && start.len() < self.text.len() => &start[..error.valid_up_to()],
            _ => start,
        };
        let text = Token { start: 0, text: valid }.string();
        match text.char_indices().nth(MAX) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text,
        }
    }

    /// The whole text. Bytes that aren't UTF-8 are taken as Latin-1, so that different bytes yield different texts.
    pub(super) fn string(&self) -> String {
        match std::str::from_utf8(self.text) {
            Ok(text) => text.to_owned(),
            Err(_) => self.text.iter().map(|byte| char::from(*byte)).collect(),
        }
    }

    /// The word as a finite number.
    pub(super) fn number(&self) -> Result<f32, ImportError> {
        match number::parse_f32(self.text) {
            Some(value) if value.is_finite() => Ok(value),
            Some(_) => Err(self.wrong(format!("\"{}\" is not a finite number up to 3.4e38", self.shown()))),
            None => Err(self.no_number()),
        }
    }

    /// The word as a number, which may be infinite or NaN.
    pub(super) fn any_number(&self) -> Result<f32, ImportError> {
        number::parse_f32(self.text).ok_or_else(|| self.no_number())
    }

    fn no_number(&self) -> ImportError {
        let complaint = self.wrong(format!("\"{}\" is not a number", self.shown()));
        let parts = |separator: &[u8]| {
            let mut parts = self.text.split(|byte| separator.contains(byte));
            parts.clone().nth(1).is_some()
                && parts.all(|part| !part.is_empty() && part.iter().all(|b| b.is_ascii_digit() || *b == b'.'))
        };
        if parts(b",") {
            complaint.help("a decimal point is expected, not a comma")
        } else if parts(b"+-") {
            complaint.help("there may be a space missing between two numbers")
        } else {
            complaint
        }
    }

    /// The finite number in `f32` and in `f64`.
    pub(super) fn exact_number(&self) -> Result<(f32, f64), ImportError> {
        let rounded = self.number()?;
        Ok((rounded, number::parse(self.text).unwrap_or(rounded.into())))
    }

    /// An error about this word.
    pub(super) fn wrong(&self, message: impl Into<String>) -> ImportError {
        ImportError { message: message.into(), span: Some(self.span()), help: None }
    }

    /// The words of this line. A backslash before a line's end counts as a space, as in OBJ.
    pub(super) fn words(self) -> Tokens<'a> {
        Tokens { line: self, at: 0 }
    }
}

/// An error message with its byte range; the file's name is added later.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImportError {
    pub(super) message: String,
    pub(super) span: Option<Range<usize>>,
    pub(super) help: Option<String>,
}

impl ImportError {
    /// An error about the whole file.
    pub(super) fn file(message: impl Into<String>) -> ImportError {
        ImportError { message: message.into(), span: None, help: None }
    }

    /// Sets the hint.
    pub(super) fn help(mut self, help: impl Into<String>) -> ImportError {
        self.help = Some(help.into());
        self
    }

    /// Prefixes the message.
    pub(super) fn within(mut self, what: &str) -> ImportError {
        self.message = format!("{what}: {}", self.message);
        self
    }

    /// The message as an error of this file.
    pub(super) fn error(self, file: &str) -> Diagnostic {
        let diagnostic = Diagnostic::error(file, &*self.message);
        self.finish(diagnostic)
    }

    /// The message as a warning of this file.
    pub(super) fn warning(self, file: &str) -> Diagnostic {
        let diagnostic = Diagnostic::warning(file, &*self.message);
        self.finish(diagnostic)
    }

    fn finish(self, mut diagnostic: Diagnostic) -> Diagnostic {
        diagnostic.span = self.span;
        diagnostic.help = self.help;
        diagnostic
    }
}

/// The words of a line.
#[derive(Clone)]
pub(super) struct Tokens<'a> {
    line: Token<'a>,
    at: usize,
}

#[inline]
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// The largest number of spaces between a backslash that joins lines and the line's end.
pub(super) const BLANKS: usize = 8;

/// Whether these bytes end with a backslash, possibly followed by spaces.
#[inline]
pub(super) fn goes_on(bytes: &[u8]) -> bool {
    bytes.iter().rev().take(BLANKS + 1).find(|byte| !matches!(byte, b' ' | b'\t')) == Some(&b'\\')
}

/// The offset of the next word on the line after a word that ends at `at`.
#[inline]
pub(super) fn gap(line: &[u8], at: usize) -> Option<usize> {
    let spaces = line.get(at..)?.iter().position(|byte| !matches!(byte, b' ' | b'\t'))?;
    (spaces > 0).then_some(at + spaces)
}

impl<'a> Tokens<'a> {
    /// The next word, which must be a number.
    pub(super) fn number(&mut self, what: &str) -> Result<f32, ImportError> {
        match self.next() {
            Some(word) => word.number().map_err(|c| c.within(what)),
            None => Err(self.line.wrong(format!("{what} is missing"))),
        }
    }

    /// The next words, which must be `N` numbers; they may be infinite or NaN.
    pub(super) fn any_numbers<const N: usize>(&mut self, what: &str) -> Result<[f32; N], ImportError> {
        let mut out = [0.0; N];
        for (index, value) in out.iter_mut().enumerate() {
            let Some(word) = self.next() else {
                return Err(self.line.wrong(format!("{what} needs {N} numbers, and here are {index}")));
            };
            *value = word.any_number().map_err(|c| c.within(what))?;
        }
        Ok(out)
    }

    /// The next words, which must be the three numbers of a position, in `f32` and in `f64`. They may be infinite or
    /// NaN.
    pub(super) fn position(&mut self, what: &str) -> Result<(Vec3, DVec3), ImportError> {
        let mut exact = self.clone();
        let rounded = self.any_numbers::<3>(what)?;
        let exact = rounded.map(|value| exact.next().and_then(|w| number::parse(w.text)).unwrap_or(value.into()));
        Ok((rounded.into(), exact.into()))
    }

    /// The words up to a comment, which may follow without a space. `1.#INF` is no comment.
    pub(super) fn before_comment(mut self) -> Tokens<'a> {
        let text = self.line.text;
        let number = |at: usize| {
            at > 0 && text[at - 1] == b'.' && matches!(text.get(at + 1), Some(b'I' | b'i' | b'Q' | b'q' | b'S' | b's'))
        };
        if let Some(at) = memchr::memchr_iter(b'#', text).find(|&at| at >= self.at && !number(at)) {
            self.line.text = &text[..at];
        }
        self
    }

    /// The rest of the line, without spaces at its ends.
    pub(super) fn rest(&self) -> Token<'a> {
        let text = &self.line.text[self.at..];
        let lead = text.len() - text.trim_ascii_start().len();
        Token { start: self.line.start + self.at + lead, text: text.trim_ascii() }
    }
}

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;
    fn next(&mut self) -> Option<Token<'a>> {
        let text = self.line.text;
        let joins = |at: usize| {
            let behind = || text[at + 1..].iter().take(BLANKS + 1).find(|byte| !matches!(byte, b' ' | b'\t'));
            text[at] == b'\\' && matches!(behind(), Some(b'\n' | b'\r'))
        };
        while self.at < text.len() && (is_space(text[self.at]) || joins(self.at)) {
            self.at += 1;
        }
        let start = self.at;
        while self.at < text.len() && !is_space(text[self.at]) && !joins(self.at) {
            self.at += 1;
        }
        (self.at > start).then(|| Token { start: self.line.start + start, text: &text[start..self.at] })
    }
}

/// The lines of a file, ended by `\n` or `\r`; blank ones are omitted.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The offset of the bytes in the file.
    base: usize,
    /// Whether a backslash at a line's end, comments apart, joins the next line.
    joined: bool,
}

/// The lines of `bytes` after a byte order mark, if there is one.
pub(super) fn lines(bytes: &[u8]) -> Lines<'_> {
    let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    Lines { at, ..Lines::new(bytes, 0) }
}

impl<'a> Lines<'a> {
    /// The lines of a part of a file that starts at `base`.
    pub(super) fn new(bytes: &'a [u8], base: usize) -> Lines<'a> {
        Lines { bytes, at: 0, base, joined: false }
    }

    /// The lines of a piece of a text; the first one starts after the byte order mark, if there is one.
    pub(super) fn of_piece(piece: Piece<'a>) -> Lines<'a> {
        let at = if piece.start == 0 && piece.bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Lines { at, ..Lines::new(piece.bytes, piece.start) }
    }

    /// The fast path for a line: calls `read` with the bytes from the line's first word on. `read` returns a value and
    /// the number of bytes that it used, none of which may be a backslash or a line end. The result is `None`, and
    /// nothing is consumed, if the line has more bytes. Most lines of large files are read in this manner, without a
    /// search for their end.
    #[inline]
    pub(super) fn easy<T>(&mut self, read: impl FnOnce(&[u8]) -> Option<(T, usize)>) -> Option<T> {
        let rest = self.bytes.get(self.at..)?;
        let lead = rest.iter().position(|b| !is_space(*b))?;
        let (value, length) = read(&rest[lead..])?;
        let end = lead + length;
        matches!(rest.get(end), None | Some(b'\n' | b'\r')).then(|| {
            self.at += end;
            value
        })
    }

    /// The offset up to which the bytes are read.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The lines, joined where a backslash ends them.
    pub(super) fn joined(mut self) -> Self {
        self.joined = true;
        self
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Token<'a>;
    fn next(&mut self) -> Option<Token<'a>> {
        while self.at < self.bytes.len() {
            let rest = &self.bytes[self.at..];
            let lead = rest.iter().position(|b| !is_space(*b)).unwrap_or(rest.len());
            let start = self.at + lead;
            let mut end = start;
            loop {
                end += memchr::memchr2(b'\n', b'\r', &self.bytes[end..]).unwrap_or(self.bytes.len() - end);
                let joins = self.joined && goes_on(&self.bytes[start..end]) && self.bytes[start] != b'#';
                if end == self.bytes.len() || !joins {
                    break;
                }
                end += if self.bytes[end..].starts_with(b"\r\n") { 2 } else { 1 };
            }
            self.at = end;
            if end > start {
                return Some(Token { start: self.base + start, text: self.bytes[start..end].trim_ascii_end() });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_know_their_place() {
        let text = b"\xef\xbb\xbf# path \\\r\n  v 1 \\\r\n 2\n\n3\rlast\\";
        let all: Vec<Vec<String>> = lines(text).joined().map(|l| l.words().map(|w| w.string()).collect()).collect();
        assert_eq!(all, [vec!["#", "path", "\\"], vec!["v", "1", "2"], vec!["3"], vec!["last\\"]]);
        for word in lines(text).joined().flat_map(Token::words) {
            assert_eq!(&text[word.span()], word.text);
        }
    }

    #[test]
    fn numbers_are_finite() {
        let number = |text: &str| Token { start: 0, text: text.as_bytes() }.number();
        assert_eq!(number("-.5e+01").unwrap(), -5.0);
        assert_eq!(number("1e99").unwrap_err().message, "\"1e99\" is not a finite number up to 3.4e38");
        assert_eq!(number("1,5").unwrap_err().message, "\"1,5\" is not a number");
        assert!(number("nan").is_err() && number(&"9".repeat(100)).unwrap_err().message.len() < 120);
    }
}
