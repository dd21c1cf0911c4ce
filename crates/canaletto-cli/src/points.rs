//! Files of points: each row holds a place and a direction.
//!
//! Rows are CSV, with quotes by RFC 4180, or numbers between blanks. CSV has neither blanks that separate nor comments,
//! and a quote that isn't closed must not swallow rows. So rows are divided here.

use crate::exit::Exit;
use crate::failure::{Failure, plural};
use crate::source::{STDIN, STDIN_NAME, missing};
use canaletto::glam::DVec3;
use canaletto_io::diagnostic::{Diagnostic, Diagnostics, Severity, word_list};
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

/// A place and a unit direction.
pub(crate) type Point = (DVec3, DVec3);

/// The columns of a point, in the order of a file without a header.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// The hint for a row that is wrong.
const ROW: &str = "a line holds x y z nx ny nz, such as 0 0.8 0  0 1 0";
/// The number of wrong rows that are listed.
const MOST_ERRORS: usize = 10;

/// The points of a file; `-` is the standard input.
pub(crate) fn read_points(path: &Path) -> Result<Vec<Point>, Failure> {
    let mut bytes = Vec::new();
    let (name, read) = if path == Path::new(STDIN) {
        (STDIN_NAME.to_owned(), io::stdin().lock().read_to_end(&mut bytes))
    } else {
        let read = File::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
        (path.display().to_string(), read)
    };
    read.map_err(|e| match missing(path, &e) {
        failure @ Failure::Message { help: None, .. } => {
            failure.help("--points names a file of places and directions; - is the standard input")
        }
        failure => failure,
    })?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let (before, byte) = (&e.as_bytes()[..at], e.as_bytes()[at]);
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        let message = format!("line {line} isn't UTF-8 text: byte {at} is 0x{byte:02x}");
        Failure::new(Exit::Scene, format!("{name}: {message}"))
            .help("save the points as UTF-8 text; a spreadsheet calls it \"CSV UTF-8\"")
    })?;
    Ok(parse_points(&text, &name)?)
}

/// The points of a text; `name` is its file for messages.
fn parse_points(text: &str, name: &str) -> Result<Vec<Point>, Diagnostics> {
    let mut points = Vec::new();
    let mut errors = Vec::new();
    let mut columns = Columns::default();
    let mut has_begun = false;
    let mut at = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    while at < text.len() {
        if !has_begun {
            match header(text, at, name) {
                Ok(None) => {}
                Ok(Some((named, end))) => {
                    (columns, at, has_begun) = (named, end, true);
                    continue;
                }
                Err(error) => {
                    errors.push(error);
                    break;
                }
            }
        }
        let row = columns.row(text, at);
        if !row.is_empty() {
            has_begun = true;
            match columns.point(&row, name) {
                Ok(point) => points.push(point),
                Err(error) => errors.push(error),
            }
        }
        at = row.end;
    }
    if points.is_empty() && errors.is_empty() {
        errors.push(Diagnostic::error(name, "there are no points").help(ROW).into());
    }
    if errors.is_empty() {
        return Ok(points);
    }
    let mut all = Diagnostics::new();
    all.add_source(name, text);
    let more = errors.len().saturating_sub(MOST_ERRORS);
    errors.into_iter().take(MOST_ERRORS).for_each(|error| all.push(*error));
    all.count_more(Severity::Error, more);
    Err(all)
}

/// A field of a row, without its quotes.
struct Field<'t> {
    text: Cow<'t, str>,
    span: Range<usize>,
}

/// A row of a file.
struct Row<'t> {
    /// The fields but for empty ones at the end.
    fields: Vec<Field<'t>>,
    /// The row itself.
    span: Range<usize>,
    /// The start of the next row.
    end: usize,
    /// What is wrong with quotes, and where.
    error: Option<(Range<usize>, &'static str)>,
}

impl Row<'_> {
    /// Whether it is an empty line or a comment.
    fn is_empty(&self) -> bool {
        self.fields.is_empty() && self.error.is_none()
    }
}

/// How rows are divided into fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Style {
    /// The character between fields; `None` if there are only blanks.
    separator: Option<char>,
    /// Whether blanks separate fields, too. Then # begins a comment anywhere, and else only at a line's start.
    blanks: bool,
}

impl Style {
    /// The row at a place of the text.
    fn row(self, text: &str, start: usize) -> Row<'_> {
        let Style { separator, blanks } = self;
        let char_at = |at: usize| text[at..].chars().next();
        let is_blank = |c: char| c.is_whitespace() && c != '\n' && Some(c) != separator;
        let line_end = |at: usize| text[at..].find('\n').map_or(text.len(), |length| at + length);
        let skip = |at: usize| text[at..].find(|c| !is_blank(c)).map_or(text.len(), |length| at + length);
        let mut fields: Vec<Field> = Vec::new();
        let mut error = None;
        let mut at = skip(start);
        while let Some(c) = char_at(at).filter(|c| *c != '\n') {
            let begun = at;
            let is_first = fields.is_empty();
            let content = if c == '#' && (blanks || is_first) {
                at = line_end(at);
                break;
            } else if c == '"' {
                let Some(closing) = closing_quote(text, at) else {
                    error = Some((at..line_end(at), "this quote isn't closed"));
                    at = line_end(at);
                    break;
                };
                at = closing + 1;
                match &text[begun + 1..closing] {
                    doubled if doubled.contains('"') => Cow::from(doubled.replace("\"\"", "\"")),
                    content => content.into(),
                }
            } else {
                let ends = |c: char| c == '\n' || Some(c) == separator || blanks && (c == '#' || is_blank(c));
                at = text[at..].find(ends).map_or(text.len(), |length| at + length);
                text[begun..at].trim_end().into()
            };
            fields.push(Field { text: content, span: begun..begun + text[begun..at].trim_end().len() });
            let after = at;
            at = skip(at);
            match char_at(at) {
                None | Some('\n') => {}
                next if next == separator => at = skip(at + 1),
                Some(next) if blanks && (at > after || next == '#') => {}
                Some(_) => {
                    error = Some((at..line_end(at), "after a closing quote the field must end"));
                    at = line_end(at);
                    break;
                }
            }
        }
        while fields.last().is_some_and(|field| field.text.trim().is_empty()) {
            fields.pop();
        }
        let span = fields.first().map_or(start, |field| field.span.start)..at.max(start);
        let span = span.start..span.start + text[span.clone()].trim_end().len();
        Row { fields, span, end: (at + 1).min(text.len()), error }
    }
}

/// The place of the quote that ends the field whose opening quote is at `open`. Two quotes are a quote of the text.
fn closing_quote(text: &str, open: usize) -> Option<usize> {
    let mut at = open + 1;
    loop {
        at += text[at..].find('"')?;
        if !text[at + 1..].starts_with('"') {
            return Some(at);
        }
        at += 2;
    }
}

/// The first of these separators outside of quotes in the row at a place of the text.
fn first_separator(text: &str, start: usize, separators: &[char]) -> Option<char> {
    let mut is_quoted = false;
    for c in text[start..].chars() {
        is_quoted ^= c == '"';
        if !is_quoted && c == '\n' {
            return None;
        }
        if !is_quoted && separators.contains(&c) {
            return Some(c);
        }
    }
    None
}

/// The separators of rows without a header.
const SEPARATORS: [char; 2] = [',', ';'];

/// The columns of a file.
struct Columns {
    /// The columns of x y z nx ny nz.
    places: [usize; 6],
    /// The number of columns.
    count: usize,
    /// How rows are divided; `None` if each row has its own separator.
    style: Option<Style>,
    /// Whether a header named them.
    is_named: bool,
}

impl Default for Columns {
    /// Those of a file without a header.
    fn default() -> Columns {
        Columns { places: [0, 1, 2, 3, 4, 5], count: NAMES.len(), style: None, is_named: false }
    }
}

/// The columns that the row at a place of the text names, and the end of this row. `None` if it is no header.
fn header(text: &str, at: usize, name: &str) -> Result<Option<(Columns, usize)>, Box<Diagnostic>> {
    let separator = first_separator(text, at, &SEPARATORS);
    let by_tabs = || first_separator(text, at, &['\t']);
    let exact = separator.or_else(by_tabs).map(|separator| Style { separator: Some(separator), blanks: false });
    let loose = Style { separator, blanks: true };
    for style in exact.into_iter().chain([loose]) {
        let row = style.row(text, at);
        let column = |name: &&str| row.fields.iter().position(|field| field.text.eq_ignore_ascii_case(name));
        let places: Vec<usize> = NAMES.iter().filter_map(column).collect();
        if let (Ok(places), None) = (<[usize; 6]>::try_from(places), &row.error) {
            let is_again = |i: &usize| {
                let name = &row.fields[*i].text;
                NAMES.iter().any(|n| n.eq_ignore_ascii_case(name)) && !places.contains(i)
            };
            if let Some(again) = (0..row.fields.len()).find(is_again) {
                let Field { text, span } = &row.fields[again];
                return Err(Diagnostic::error(name, format!("the header names {text} twice")).at(span.clone()).into());
            }
            let count = row.fields.len();
            let style = (count > NAMES.len()).then_some(style);
            return Ok(Some((Columns { places, count, style, is_named: true }, row.end)));
        }
    }
    let row = exact.unwrap_or(loose).row(text, at);
    let is_name = |field: &Field| NAMES.iter().any(|name| field.text.eq_ignore_ascii_case(name));
    let is_header = row.fields.iter().any(is_name) || row.fields.iter().all(|f| f.text.parse::<f64>().is_err());
    if !is_header || row.fields.is_empty() || row.error.is_some() {
        return Ok(None);
    }
    let lacking: Vec<&str> =
        NAMES.into_iter().filter(|n| !row.fields.iter().any(|f| f.text.eq_ignore_ascii_case(n))).collect();
    let named: Vec<String> = row.fields.iter().map(|field| format!("\"{}\"", field.text)).collect();
    let message = format!("the header lacks {}; it names {}", word_list(&lacking, "and"), word_list(&named, "and"));
    let help = "a header names the columns x, y, z, nx, ny and nz in any order, and may name others; a file without a \
                header has these six";
    Err(Diagnostic::error(name, message).at(row.span.clone()).help(help).into())
}

impl Columns {
    /// The row at a place of the text.
    fn row<'t>(&self, text: &'t str, at: usize) -> Row<'t> {
        let style = match self.style {
            // Blanks may stand for the separator in a whole row.
            Some(style) => style.separator.and_then(|s| first_separator(text, at, &[s])).map(|_| style),
            None => first_separator(text, at, &SEPARATORS).map(|s| Style { separator: Some(s), blanks: true }),
        };
        style.unwrap_or(Style { separator: None, blanks: true }).row(text, at)
    }

    /// The point of a row.
    fn point(&self, row: &Row, name: &str) -> Result<Point, Box<Diagnostic>> {
        let wrong = |span: &Range<usize>, message: String| Diagnostic::error(name, message).at(span.clone());
        if let Some((span, message)) = &row.error {
            return Err(wrong(span, (*message).into())
                .help("a quote within a quoted field is written twice: \"\"")
                .into());
        }
        let mut numbers = [0.0; 6];
        for (number, (place, column)) in numbers.iter_mut().zip(self.places.iter().zip(NAMES)) {
            let Some(field) = row.fields.get(*place) else { continue };
            // A comment may follow the last number.
            let text = field.text.split('#').next().unwrap_or_default().trim();
            match text.parse::<f64>() {
                Ok(found) if found.is_finite() => *number = found,
                Ok(_) => return Err(wrong(&field.span, format!("{column}: {text} isn't finite")).into()),
                Err(_) if text.is_empty() => {
                    return Err(wrong(&field.span, format!("{column} is empty")).help(ROW).into());
                }
                Err(_) => return Err(wrong(&field.span, format!("{column}: \"{text}\" is no number")).into()),
            }
        }
        let found = row.fields.len();
        if found <= *self.places.iter().max().unwrap_or(&0) || found > self.count {
            let found = plural(found, "field");
            let error = if self.is_named {
                wrong(&row.span, format!("there are {found}, but the header names {} columns", self.count))
            } else {
                wrong(&row.span, format!("there are {found}, but a point has 6 numbers")).help(ROW)
            };
            return Err(error.into());
        }
        let [x, y, z, nx, ny, nz] = numbers;
        match DVec3::new(nx, ny, nz).try_normalize() {
            Some(direction) => Ok((DVec3::new(x, y, z), direction)),
            None => Err(wrong(&row.span, "the direction nx ny nz is zero".into()).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points that the texts below hold.
    const TWO: [Point; 2] = [(DVec3::new(1.0, 2.0, 3.0), DVec3::Z), (DVec3::new(4.0, 5.0, 6.0), DVec3::X)];

    #[test]
    fn points_are_read_as_csv_or_between_blanks() {
        for text in [
            "x,y,z,nx,ny,nz\n1,2,3,0,0,2\n\n# a comment\n4 5 6\t1 0 0 # to the right, or left\n",
            "1 2 3  0 0 1\n4 5 6  1 0 0",
            "\u{feff}1,2,3,0,0,1\r\n\r\n4,5,6,1,0,0\r\n",
            "\u{feff}# a comment\n\n\"x\",\"y\",\"z\",\"nx\",\"ny\",\"nz\"\n\
             \"1\",\"2\",\"3\",\"0\",\"0\",\"1\"\n4;5;6;1;0;0\n",
            "\"1\" \"2\" \"3\" \"0\" \"0\" \"1\"\n \"4\" , 5 ,6 , 1,0,0 , \n,,,,,\n",
            "1;2;3;0;0;1\n4,5,6  1,0,0#right\n",
            "nx\tny\tnz\tx\ty\tz\n0\t0\t1\t1\t2\t3\n1\t0\t0\t4\t5\t6\n",
            "NZ;NY;NX;Z;Y;X\n1;0;0;3;2;1\n0 0 1 6 5 4\n",
            "x y z\tnx ny nz\n1 2 3 0 0 1\n4 5 6 1 0 0\n",
            "name,x,y,z,nx,ny,nz,note\n\"a desk, \"\"old\"\"\nand small\",1,2,3,0,0,1\n\
             lamp #2,4,5,6,1,0,0 # right, left\n",
            "no\tx\ty\tz\tname of it\tnx\tny\tnz\n7\t1\t2\t3\t\t0\t0\t1\n8\t4\t5\t6\tb c\t1\t0\t0\n",
            "x y z nx ny nz n\n1 2 3 0 0 1 7\n4 5 6 1 0 0\n",
        ] {
            let points = parse_points(text, "p").map_err(|all| all.iter().map(|d| all.render(d)).collect::<String>());
            assert_eq!(points.as_deref(), Ok(&TWO[..]), "{text:?}");
        }
    }

    #[test]
    fn wrong_rows_are_all_listed_with_their_lines() {
        for (text, wrong) in [
            ("1 2 3 0 0 1\n1 2 3 0 0\n", &[(2, "there are 5 fields")][..]),
            ("1 2 3 0 0 1 7\n", &[(1, "there are 7 fields")]),
            ("1 2 3 0 0 1\n\nzero,2,3,0,0,1\n1,,3,0,0,1\n", &[(3, "x: \"zero\" is no number"), (4, "y is empty")]),
            (
                "\u{feff}1 2 3 0 0 0\r\n1 2 inf 0 0 1\r\n1 2 1e400 0 0 1",
                &[(1, "the direction nx ny nz is zero"), (2, "z: inf isn't finite"), (3, "z: 1e400 isn't finite")],
            ),
            ("0,5;2;3;0;0;1\n", &[(1, "y: \"5;2;3;0;0;1\" is no number")]),
            ("\"lab\",0,0,0,0,1,0\n1 2 3 0 0 1", &[(1, "x: \"lab\" is no number")]),
            ("\"1,2,3,0,0,1\n1 2 3 0 x 1\n", &[(1, "this quote isn't closed"), (2, "ny: \"x\" is no number")]),
            ("\"1\"2,2,3,0,0,1\n1 2 3 0 0 1\n", &[(1, "after a closing quote the field must end")]),
            ("", &[(0, "there are no points")]),
            ("x,y,z,nx,ny,nz\n# none\n", &[(0, "there are no points")]),
            ("foo\n1 2 3 0 0 1\n", &[(1, "the header lacks x, y, z, nx, ny and nz; it names \"foo\"")]),
            (
                "x,y,z,u,v,w\n1,2,3,0,0,1\n",
                &[(1, "lacks nx, ny and nz; it names \"x\", \"y\", \"z\", \"u\", \"v\" and \"w\"")],
            ),
            ("x,y,z,X,nx,ny,nz\n", &[(1, "the header names X twice")]),
            (
                "x,y,z,nx,ny,nz,a\n1,2,3,0,0,1,2,3\n1,2,3,0,0\n",
                &[
                    (2, "there are 8 fields, but the header names 7 columns"),
                    (3, "there are 5 fields, but the header names 7 columns"),
                ],
            ),
        ] {
            let all = parse_points(text, "p").unwrap_err();
            let found: Vec<_> = all.iter().map(|d| (all.start(d).map_or(0, |at| at.line), &d.message)).collect();
            let equal =
                |(found, wrong): (&(usize, &String), &(usize, &str))| found.0 == wrong.0 && found.1.contains(wrong.1);
            assert!(found.len() == wrong.len() && found.iter().zip(wrong).all(equal), "{text:?}: {found:?}");
        }
        let all = parse_points(&"1 2 3\n".repeat(25), "p").unwrap_err();
        assert_eq!((all.len(), all.errors()), (10, 25));
    }
}
