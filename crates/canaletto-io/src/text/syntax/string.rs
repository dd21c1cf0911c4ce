//! Strings: unquoted words, `"quoted"`, `"""` over several lines, `#"raw"#`.

use super::lexer::{Lexer, is_blank, is_newline, is_word};

/// A marker for a mistake that was reported.
pub(super) struct Reported;

impl Lexer<'_> {
    /// Parses a string; the next character must start one.
    pub(super) fn string(&mut self) -> Result<String, Reported> {
        match self.peek() {
            Some('"') => self.quoted(),
            Some('#') => self.raw(),
            _ => {
                let length = self.rest().find(|c| !is_word(c)).unwrap_or(self.rest().len());
                let word = self.rest()[..length].to_owned();
                self.at += length;
                Ok(word)
            }
        }
    }

    fn quoted(&mut self) -> Result<String, Reported> {
        let start = self.at;
        if self.take("\"\"\"") {
            let body = self.at;
            let end = loop {
                match self.rest().find(['"', '\\']) {
                    None => return self.unclosed(start, 3, "\"\"\""),
                    Some(found) => {
                        self.at += found;
                        let end = self.at;
                        if self.take("\"\"\"") {
                            break end;
                        }
                        // Skips a quote, or a backslash and the character after it.
                        if self.take("\\") { self.bump() } else { self.at += 1 }
                    }
                }
            };
            let lines = self.without_folds(body, end);
            let text = self.dedent(start, &lines)?;
            return self.unescape(start, &text);
        }
        self.at += 1;
        let body = self.at;
        loop {
            match self.peek() {
                Some('"') => break,
                Some('\\') => {
                    self.bump();
                    // A backslash folds white space, line ends included.
                    if self.peek().is_some_and(|c| is_blank(c) || is_newline(c)) {
                        while self.peek().is_some_and(|c| is_blank(c) || is_newline(c)) {
                            self.bump();
                        }
                    } else {
                        self.bump();
                    }
                }
                Some(c) if !is_newline(c) => self.bump(),
                _ => {
                    let span = self.span(start, self.at);
                    self.error(
                        span,
                        "this text has no closing quote on its line",
                        "texts over several lines stand between \"\"\" and \"\"\"",
                    );
                    return Err(Reported);
                }
            }
        }
        let end = self.at;
        self.at += 1;
        let folded = self.without_folds(body, end);
        self.unescape(start, &folded)
    }

    fn raw(&mut self) -> Result<String, Reported> {
        let start = self.at;
        let hashes = self.rest().bytes().take_while(|b| *b == b'#').count();
        self.at += hashes;
        let quotes = if self.looking_at("\"\"\"") { 3 } else { 1 };
        // `#""#` is empty. `#"""` opens a string of several lines unless it closes at once.
        let fence = format!("{}{}", "\"".repeat(quotes), "#".repeat(hashes));
        self.at += quotes;
        let body = self.at;
        let Some(length) = self.rest().find(&fence) else {
            return self.unclosed(start, hashes + quotes, &fence);
        };
        let end = body + length;
        self.at = end + fence.len();
        let text = &self.text[body..end];
        if quotes == 3 {
            let lines = normalise_newlines(text);
            return self.dedent(start, &lines);
        }
        if text.contains(is_newline) {
            let span = self.span(start, self.at);
            self.error(span, "a raw text of several lines needs three quotes", "write #\"\"\" and \"\"\"#");
            return Err(Reported);
        }
        Ok(text.to_owned())
    }

    fn unclosed(&mut self, start: usize, length: usize, fence: &str) -> Result<String, Reported> {
        let span = self.span(start, start + length);
        self.at = self.text.len();
        self.error(span, "this text is never closed", &format!("close it with {fence}"));
        Err(Reported)
    }

    /// The text with `\n` as line ends and without white space after a backslash. Other escapes stay.
    fn without_folds(&self, start: usize, end: usize) -> String {
        let text = &self.text[start..end];
        if !text.contains('\\') {
            return normalise_newlines(text);
        }
        let mut out = String::with_capacity(text.len());
        let mut rest = text.chars().peekable();
        while let Some(c) = rest.next() {
            if c != '\\' {
                out.push(c);
            } else if rest.peek().is_some_and(|c| is_blank(*c) || is_newline(*c)) {
                while rest.next_if(|c| is_blank(*c) || is_newline(*c)).is_some() {}
            } else {
                out.push(c);
                out.extend(rest.next());
            }
        }
        normalise_newlines(&out)
    }

    /// The lines between the quotes, without the indentation of the last line.
    fn dedent(&mut self, start: usize, text: &str) -> Result<String, Reported> {
        let span = self.span(start, start + 3);
        let mut lines: Vec<&str> = text.split('\n').collect();
        let prefix = lines.pop().unwrap_or_default();
        if lines.first() != Some(&"") {
            self.error(span, "a text of several lines starts on the line after its opening quotes", "");
            return Err(Reported);
        }
        if !prefix.chars().all(is_blank) {
            self.error(span, "the closing quotes of this text must stand on a line of their own", "");
            return Err(Reported);
        }
        let mut out = String::with_capacity(text.len());
        for (index, line) in lines.iter().enumerate().skip(1) {
            if index > 1 {
                out.push('\n');
            }
            if line.chars().all(is_blank) {
                continue;
            }
            let Some(line) = line.strip_prefix(prefix) else {
                let message = format!("line {index} of this text starts further left than its closing quotes");
                self.error(span, message, "indent each line at least as far, with the same blanks");
                return Err(Reported);
            };
            out.push_str(line);
        }
        Ok(out)
    }

    fn unescape(&mut self, start: usize, text: &str) -> Result<String, Reported> {
        if !text.contains('\\') {
            return Ok(text.to_owned());
        }
        let mut out = String::with_capacity(text.len());
        let mut rest = text.chars();
        while let Some(c) = rest.next() {
            if c != '\\' {
                out.push(c);
                continue;
            }
            let escape = rest.next();
            out.push(match escape {
                Some('n') => '\n',
                Some('r') => '\r',
                Some('t') => '\t',
                Some('b') => '\u{8}',
                Some('f') => '\u{c}',
                Some('s') => ' ',
                Some(c @ ('\\' | '"')) => c,
                Some('u') => {
                    let tail = rest.as_str();
                    let digits =
                        tail.strip_prefix('{').and_then(|t| t.split_once('}')).map_or("", |(digits, _)| digits);
                    let valid = (1..=6).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit());
                    let found = u32::from_str_radix(digits, 16).ok().and_then(char::from_u32).filter(|_| valid);
                    let Some(found) = found else {
                        let span = self.span(start, self.at);
                        self.error(span, "\\u needs the code of a character in braces", "for example \\u{e9} for é");
                        return Err(Reported);
                    };
                    rest = tail[digits.len() + 2..].chars();
                    found
                }
                other => {
                    let span = self.span(start, self.at);
                    let what = other.map_or("\\".to_owned(), |c| format!("\\{c}"));
                    self.error(
                        span,
                        format!("{what} means nothing in a text"),
                        "write \\\\ for a backslash, or / between folders",
                    );
                    return Err(Reported);
                }
            });
        }
        Ok(out)
    }
}

fn normalise_newlines(text: &str) -> String {
    let text = if text.contains('\r') { text.replace("\r\n", "\n") } else { text.to_owned() };
    if text.contains(|c| is_newline(c) && c != '\n') { text.replace(is_newline, "\n") } else { text }
}
