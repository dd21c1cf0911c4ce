//! Text as bytes: lines, words and numbers that know their place, for formats of words between spaces.

use super::number;
use super::text::Piece;
use crate::diagnostic::Diagnostic;
use glam::{DVec3, Vec3};
use std::ops::Range;

/// A piece of a file: bytes without spaces, or a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token<'a> {
    /// Where it starts in the file.
    pub(super) start: usize,
    /// Its bytes.
    pub(super) text: &'a [u8],
}

impl<'a> Token<'a> {
    /// Its place in the file.
    pub(super) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// Its text for messages, shortened.
    pub(super) fn shown(&self) -> String {
        const MAX: usize = 40;
        // A character has at most four bytes, and the last may be cut.
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

    /// Its whole text. What isn't UTF-8 is taken for Latin-1, so that different bytes stay different.
    pub(super) fn string(&self) -> String {
        match std::str::from_utf8(self.text) {
            Ok(text) => text.to_owned(),
            Err(_) => self.text.iter().map(|byte| char::from(*byte)).collect(),
        }
    }

    /// A finite number.
    pub(super) fn number(&self) -> Result<f32, ImportError> {
        match number::parse_f32(self.text) {
            Some(value) if value.is_finite() => Ok(value),
            Some(_) => Err(self.wrong(format!("\"{}\" is not a finite number up to 3.4e38", self.shown()))),
            None => Err(self.no_number()),
        }
    }

    /// A number, which may be infinite or none (NaN).
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

    /// The same number, and as exact as `f64` holds it.
    pub(super) fn exact_number(&self) -> Result<(f32, f64), ImportError> {
        let rounded = self.number()?;
        Ok((rounded, number::parse(self.text).unwrap_or(rounded.into())))
    }

    /// A complaint about this word.
    pub(super) fn wrong(&self, message: impl Into<String>) -> ImportError {
        ImportError { message: message.into(), span: Some(self.span()), help: None }
    }

    /// The words of this line. A backslash before a line's end counts as a space, as in OBJ.
    pub(super) fn words(self) -> Tokens<'a> {
        Tokens { line: self, at: 0 }
    }
}

/// What is wrong and where, before the file's name is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImportError {
    pub(super) message: String,
    pub(super) span: Option<Range<usize>>,
    pub(super) help: Option<String>,
}

impl ImportError {
    /// A complaint about the whole file.
    pub(super) fn file(message: impl Into<String>) -> ImportError {
        ImportError { message: message.into(), span: None, help: None }
    }

    /// The same with a hint.
    pub(super) fn help(mut self, help: impl Into<String>) -> ImportError {
        self.help = Some(help.into());
        self
    }

    /// The same with words in front.
    pub(super) fn within(mut self, what: &str) -> ImportError {
        self.message = format!("{what}: {}", self.message);
        self
    }

    /// As an error of this file.
    pub(super) fn error(self, file: &str) -> Diagnostic {
        let diagnostic = Diagnostic::error(file, &*self.message);
        self.finish(diagnostic)
    }

    /// As a warning of this file.
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

/// The most spaces that may stand between a backslash that joins lines and the line's end.
pub(super) const BLANKS: usize = 8;

/// Whether a backslash ends these bytes, but for spaces.
#[inline]
pub(super) fn goes_on(bytes: &[u8]) -> bool {
    bytes.iter().rev().take(BLANKS + 1).find(|byte| !matches!(byte, b' ' | b'\t')) == Some(&b'\\')
}

/// Where the next word starts behind a word that ends at `at`, on the same line.
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

    /// The next words, which must be `N` numbers; some may be infinite or none (NaN).
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

    /// The next words, which must be the three numbers of a position: rounded, and as exact as they are.
    /// Some may be infinite or none (NaN).
    pub(super) fn position(&mut self, what: &str) -> Result<(Vec3, DVec3), ImportError> {
        let mut exact = self.clone();
        let rounded = self.any_numbers::<3>(what)?;
        let exact = rounded.map(|value| exact.next().and_then(|w| number::parse(w.text)).unwrap_or(value.into()));
        Ok((rounded.into(), exact.into()))
    }

    /// The same words up to a comment, which may follow without a space. `1.#INF` is none.
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

    /// What is left of the line, without spaces at its ends.
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

/// The lines of a file, wherever `\n` or `\r` ends them; blank ones are left out.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Where the bytes start in the file.
    base: usize,
    /// Whether a backslash at a line's end, comments apart, joins the next line.
    joined: bool,
}

/// The lines of `bytes`, without a byte order mark.
pub(super) fn lines(bytes: &[u8]) -> Lines<'_> {
    let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    Lines { at, ..Lines::new(bytes, 0) }
}

impl<'a> Lines<'a> {
    /// The lines of a part of a file that starts at `base`.
    pub(super) fn new(bytes: &'a [u8], base: usize) -> Lines<'a> {
        Lines { bytes, at: 0, base, joined: false }
    }

    /// The lines of a piece of a text; the first starts behind the byte order mark, if there is one.
    pub(super) fn of_piece(piece: Piece<'a>) -> Lines<'a> {
        let at = if piece.start == 0 && piece.bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Lines { at, ..Lines::new(piece.bytes, piece.start) }
    }

    /// What `read` makes of the next line, if it makes something of it. It is given the bytes from the line's start on, and
    /// tells how many it used, none of which may be a backslash or end a line; if there is more on the line, all counts for
    /// nothing. Most lines of large files are read so, without first looking for their end.
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

    /// How far the bytes are read.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The same lines, joined where a backslash ends them.
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
