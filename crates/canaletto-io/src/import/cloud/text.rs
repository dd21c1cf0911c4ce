//! Rows of text: separators, columns, and rows that are left out.

use super::columns::{Role, Roles, Unfit};
use super::{CloudSettings, LeftOutRows};
use crate::import::lines::{ImportError, Token};
use crate::import::number;
use crate::import::positions::Positions;
use canaletto::math::Rgb;
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::ops::Range;

/// The separator of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Spaces,
    Byte(u8),
}

/// The columns of a text and their separator.
struct Columns {
    separator: Separator,
    count: usize,
    of: Roles,
}

/// Some of the rows.
#[derive(Default)]
pub(super) struct Table {
    pub(super) points: Positions,
    pub(super) radii: Vec<f32>,
    /// The colours as written in the file.
    pub(super) colors: Vec<Rgb>,
    /// The numbers of the colour map.
    pub(super) values: Vec<f64>,
    /// The rows without a finite position or size.
    pub(super) lost: LeftOutRows,
    /// The number of decimal commas.
    pub(super) commas: u64,
    /// The names of skipped columns.
    pub(super) unknown: Vec<String>,
}

/// Reads rows of text; `points` has the names of the coordinate columns.
pub(super) fn read(bytes: &[u8], points: &[&str], settings: &CloudSettings) -> Result<Table, ImportError> {
    read_from(bytes, if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 }, points, settings)
}

/// As [`read`], for rows that start at offset `from`.
pub(super) fn read_from(
    bytes: &[u8],
    from: usize,
    points: &[&str],
    settings: &CloudSettings,
) -> Result<Table, ImportError> {
    let Some(first) = rows(bytes, from..bytes.len()).next() else {
        return Ok(Table::default());
    };
    let (columns, start) = Columns::of(&first, points, settings)?;
    // Pieces start after a line end. Each is a pure function of its bytes, and they are joined in order.
    const PIECE: usize = 1 << 20;
    let line_after = |at: usize| memchr::memchr2(b'\n', b'\r', &bytes[at..]).map_or(bytes.len(), |p| at + p + 1);
    let mut cuts = vec![start];
    while *cuts.last().unwrap_or(&0) < bytes.len() {
        let next = (cuts.last().unwrap_or(&0) + PIECE).min(bytes.len());
        cuts.push(line_after(next));
    }
    let tables: Vec<Result<Table, ImportError>> = cuts
        .par_iter()
        .zip(&cuts[1..])
        .map(|(&start, &end)| {
            let mut table = Table::default();
            rows(bytes, start..end).try_for_each(|row| columns.read(&row, points, &mut table))?;
            table.points = table.points.part();
            Ok(table)
        })
        .collect();
    let mut all = Table { unknown: columns.of.unknown, ..Table::default() };
    for table in tables {
        all.append(table?);
    }
    Ok(all)
}

impl Table {
    /// Adds the rows of a later part.
    pub(super) fn append(&mut self, later: Table) {
        self.points.append(later.points);
        self.radii.extend(later.radii);
        self.colors.extend(later.colors);
        self.values.extend(later.values);
        self.lost.append(later.lost);
        self.commas += later.commas;
    }
}

/// The rows of a part of the file, without blank lines and comments.
fn rows(bytes: &[u8], part: Range<usize>) -> impl Iterator<Item = Token<'_>> {
    let mut at = part.start;
    let lines = bytes[part].split_inclusive(|b| *b == b'\n' || *b == b'\r').map(move |line| {
        let start = at;
        at += line.len();
        let line = without_remark(line);
        Token { start: start + line.len() - line.trim_ascii_start().len(), text: line.trim_ascii() }
    });
    let comment = |row: &[u8]| [&b"#"[..], b"//", b"%"].iter().any(|mark| row.starts_with(mark));
    lines.filter(move |row| !row.text.is_empty() && !comment(row.text))
}

/// The line up to ` #`.
fn without_remark(line: &[u8]) -> &[u8] {
    let remark = memchr::memchr_iter(b'#', line).find(|at| *at > 0 && matches!(line[at - 1], b' ' | b'\t'));
    match remark {
        Some(at) if memchr::memchr_iter(b'"', &line[..at]).count().is_multiple_of(2) => &line[..at],
        _ => line,
    }
}

/// Whether the text stands for a missing number.
fn is_missing(text: &[u8]) -> bool {
    const WORDS: [&[u8]; 8] = [b"", b"na", b"n/a", b"null", b"none", b"-", b"missing", b"?"];
    WORDS.iter().any(|word| text.eq_ignore_ascii_case(word))
}

/// A cell without its quotes.
fn unquoted(cell: Token<'_>) -> Token<'_> {
    match cell.text {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => {
            let lead = inner.len() - inner.trim_ascii_start().len();
            Token { start: cell.start + 1 + lead, text: inner.trim_ascii() }
        }
        _ => cell,
    }
}

/// The name of a column in lower case, without its unit: `X [m]` is `x`.
fn name(cell: &Token<'_>) -> String {
    let name = cell.string().to_lowercase();
    name.split(['(', '[']).next().unwrap_or_default().trim().to_owned()
}

impl Columns {
    /// The columns according to the first row, and the offset at which the rows of numbers start.
    fn of(first: &Token<'_>, points: &[&str], settings: &CloudSettings) -> Result<(Columns, usize), ImportError> {
        let mut columns = Columns { separator: separator(first.text), count: 0, of: Roles::default() };
        let mut cells: Vec<Token<'_>> = columns.cells(first).collect();
        if cells.len() > 1 && cells.last().is_some_and(|cell| cell.text.is_empty()) {
            cells.pop();
        }
        columns.count = cells.len();
        let number = |cell: &Token<'_>| columns.number(cell, &mut 0).is_some() || is_missing(cell.text);
        let named = cells.iter().any(|cell| !number(cell)) && !cells.iter().any(|cell| cell.number().is_ok());
        let start = if named { first.start + first.text.len() } else { first.start };
        let own: Vec<String> = cells.iter().map(name).collect();
        let found = match &settings.columns {
            given if !given.is_empty() && given.len() != cells.len() => {
                let message = format!("a row has {} columns, but columns has {} names", cells.len(), given.len());
                let help = "name every column in its order; other names than those of numbers are passed over".into();
                Err(Unfit { message, help })
            }
            given if !given.is_empty() => Roles::by_name(given, points, settings, "the scene's columns"),
            _ if named => Roles::by_name(&own, points, settings, "the first row"),
            _ => Roles::by_count(cells.len(), points, settings),
        };
        columns.of = found.map_err(|Unfit { message, help }| first.wrong(message).help(help))?;
        Ok((columns, start))
    }

    /// The cells of a row without their quotes.
    fn cells<'a>(&self, row: &Token<'a>) -> impl Iterator<Item = Token<'a>> + use<'a> {
        let (separator, row) = (self.separator, *row);
        let by_space = (separator == Separator::Spaces).then(|| row.words()).into_iter().flatten();
        let quoted = memchr::memchr(b'"', row.text).is_some();
        let mut left = match separator {
            Separator::Spaces => None,
            Separator::Byte(byte) => Some((row.start, row.text, byte)),
        };
        let by_separator = std::iter::from_fn(move || {
            let (start, text, byte) = left?;
            let end = if quoted { outside_quotes(text, byte) } else { memchr::memchr(byte, text) };
            let cell = &text[..end.unwrap_or(text.len())];
            left = end.map(|end| (start + end + 1, &text[end + 1..], byte));
            let lead = cell.len() - cell.trim_ascii_start().len();
            Some(Token { start: start + lead, text: cell.trim_ascii() })
        });
        by_separator.chain(by_space).map(unquoted)
    }

    /// The number of a cell; `None` if it is missing. Decimal commas are read unless the separator is the comma.
    fn number(&self, cell: &Token<'_>, commas: &mut u64) -> Option<f64> {
        if let Some(number) = number::parse(cell.text) {
            return Some(number);
        }
        if self.separator == Separator::Byte(b',') || memchr::memchr_iter(b',', cell.text).count() != 1 {
            return None;
        }
        let point: Vec<u8> = cell.text.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect();
        let number = number::parse(&point)?;
        *commas += 1;
        Some(number)
    }

    fn read(&self, row: &Token<'_>, points: &[&str], table: &mut Table) -> Result<(), ImportError> {
        let n = points.len();
        let mut place = [0.0f64; 6];
        let (mut radius, mut color) = (1.0f32, [0.0f32; 3]);
        let mut mapped = None;
        let mut count = 0;
        let mapped_column = self.of.value.as_ref().map(|(at, _)| *at);
        for cell in self.cells(row) {
            let role = self.of.roles.get(count).copied().flatten();
            let is_mapped = mapped_column == Some(count);
            if role.is_some() || is_mapped {
                let value = match self.number(&cell, &mut table.commas) {
                    Some(value) => value,
                    None if is_missing(cell.text) => f64::NAN,
                    None => return Err(self.no_number(&cell, count, role, points)),
                };
                if is_mapped {
                    mapped = Some((cell, value));
                }
                match role {
                    None => {}
                    Some(Role::Point(index)) => place[index] = value,
                    Some(Role::Radius) if value <= 0.0 && value.is_finite() => {
                        let message = format!("column {}: radius is {value}; it must be more than 0", count + 1);
                        return Err(cell.wrong(message));
                    }
                    Some(Role::Radius) => radius = value as f32,
                    Some(Role::Color(index)) => color[index] = value as f32,
                }
            } else if count == self.count && cell.text.is_empty() {
                // The row ends with a separator.
                continue;
            }
            count += 1;
        }
        if count != self.count {
            return Err(row.wrong(format!("this row has {count} columns, and the first one {}", self.count)));
        }
        if !(place.iter().all(|v| (*v as f32).is_finite()) && radius.is_finite()) {
            table.lost.note(row);
            return Ok(());
        }
        table.lost.kept += 1;
        for exact in place[..n].chunks_exact(3).map(DVec3::from_slice) {
            table.points.push(exact.as_vec3(), exact);
        }
        if self.of.radius {
            table.radii.push(radius);
        }
        if self.of.color {
            table.colors.push(color.into());
        }
        if let Some((cell, value)) = mapped {
            if !value.is_finite() {
                let cell = if cell.text.is_empty() { row } else { &cell };
                return Err(cell.wrong(self.unmapped()).help("leave the row out, or give it a number"));
            }
            table.values.push(value);
        }
        Ok(())
    }

    /// The message about a number of the colour map that is missing.
    fn unmapped(&self) -> String {
        let (at, name) = self.of.value.as_ref().map_or((0, ""), |(at, name)| (*at, name));
        format!("column {} ({name}) has no finite number here, which the colour map needs", at + 1)
    }

    fn no_number(&self, cell: &Token<'_>, count: usize, role: Option<Role>, points: &[&str]) -> ImportError {
        let name = match role {
            Some(Role::Point(index)) => points[index],
            Some(Role::Radius) => "radius",
            Some(Role::Color(index)) => ["red", "green", "blue"][index],
            None => self.of.value.as_ref().map_or("", |(_, name)| name),
        };
        let message = format!("column {} ({name}): \"{}\" is not a number", count + 1, cell.shown());
        let complaint = cell.wrong(message);
        if self.separator == Separator::Byte(b',') && cell.text.contains(&b' ') {
            return complaint
                .help("are these decimal commas? With semicolons or tabs between the columns they are read as points");
        }
        complaint
    }
}

/// The separator in a row: semicolons, else single tabs, else commas, else spaces. Quoted text is ignored.
fn separator(row: &[u8]) -> Separator {
    let has = |byte: u8| outside_quotes(row, byte).is_some();
    if has(b';') {
        Separator::Byte(b';')
    } else if has(b'\t') && !row.windows(2).any(|two| two == b"\t\t") && tabs_part(row) {
        Separator::Byte(b'\t')
    } else if has(b',') {
        Separator::Byte(b',')
    } else {
        Separator::Spaces
    }
}

/// Whether the cells between tabs contain no spaces or commas that would separate further, except in quoted names.
fn tabs_part(row: &[u8]) -> bool {
    row.split(|byte| *byte == b'\t').all(|cell| {
        let cell = cell.trim_ascii();
        cell.starts_with(b"\"") || !(cell.contains(&b' ') || cell.ends_with(b","))
    })
}

/// The first offset of a byte outside quotes.
fn outside_quotes(text: &[u8], byte: u8) -> Option<usize> {
    let mut inside = false;
    text.iter().position(|b| {
        inside ^= *b == b'"';
        *b == byte && !inside
    })
}
