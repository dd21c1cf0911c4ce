//! Rows of text: separators, columns, and rows that are left out.

use super::LeftOutRows;
use crate::import::lines::{ImportError, Token};
use crate::import::number;
use crate::import::positions::Positions;
use canaletto::math::Rgb;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// The separator of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Spaces,
    Byte(u8),
}

/// The meaning of a column.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// A coordinate, by its index.
    Point(usize),
    Radius,
    /// Red, green or blue, by its index.
    Color(usize),
}

/// The columns of a text and their separator.
struct Columns {
    separator: Separator,
    count: usize,
    /// The meaning of each column; `None` for unused ones.
    roles: Vec<Option<Role>>,
    radius: bool,
    color: bool,
    /// The names of unused columns.
    unknown: Vec<String>,
}

/// Some of the rows.
#[derive(Default)]
pub(super) struct Table {
    pub(super) points: Positions,
    pub(super) radii: Vec<f32>,
    /// The colours as written in the file.
    pub(super) colors: Vec<Rgb>,
    /// The rows without a finite position or size.
    pub(super) lost: LeftOutRows,
    /// The number of decimal commas.
    pub(super) commas: u64,
    /// The names of skipped columns.
    pub(super) unknown: Vec<String>,
}

/// Reads rows of text; `points` has the names of the coordinate columns.
pub(super) fn read(bytes: &[u8], points: &[&str]) -> Result<Table, ImportError> {
    read_from(bytes, if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 }, points)
}

/// As [`read`], for rows that start at offset `from`.
pub(super) fn read_from(bytes: &[u8], from: usize, points: &[&str]) -> Result<Table, ImportError> {
    let Some(first) = rows(bytes, from..bytes.len()).next() else {
        return Ok(Table::default());
    };
    let (columns, start) = Columns::of(&first, points)?;
    // Pieces start after a line end. Each is a pure function of its bytes, and they are joined in order.
    const PIECE: usize = 1 << 20;
    let line_after = |at: usize| memchr::memchr2(b'\n', b'\r', &bytes[at..]).map_or(bytes.len(), |p| at + p + 1);
    let mut cuts = vec![start];
    while *cuts.last().unwrap_or(&0) < bytes.len() {
        let next = (cuts.last().unwrap_or(&0) + PIECE).min(bytes.len());
        cuts.push(line_after(next));
    }
    let tables: Vec<Result<Table, ImportError>> = cuts
        .par_windows(2)
        .map(|cut| {
            let mut table = Table::default();
            rows(bytes, cut[0]..cut[1]).try_for_each(|row| columns.read(&row, points, &mut table))?;
            table.points = table.points.part();
            Ok(table)
        })
        .collect();
    let mut all = Table { unknown: columns.unknown, ..Table::default() };
    for table in tables {
        let table = table?;
        all.points.append(table.points);
        all.radii.extend(table.radii);
        all.colors.extend(table.colors);
        all.lost.append(table.lost);
        all.commas += table.commas;
    }
    Ok(all)
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

/// Whether `name` is a common alternative of the coordinate name `wanted`.
fn is_called(name: &str, wanted: &str) -> bool {
    // ParaView numbers the components of a vector.
    let (other, numbered) = match wanted {
        "x" => (["px", "pos_x", "position_x", "center_x"], ["points:0", "points_0"]),
        "y" => (["py", "pos_y", "position_y", "center_y"], ["points:1", "points_1"]),
        "z" => (["pz", "pos_z", "position_z", "center_z"], ["points:2", "points_2"]),
        _ => return name == wanted,
    };
    name == wanted || other.contains(&name) || numbered.contains(&name)
}

impl Columns {
    /// The columns according to the first row, and the offset at which the rows of numbers start.
    fn of(first: &Token<'_>, points: &[&str]) -> Result<(Columns, usize), ImportError> {
        let n = points.len();
        let mut columns = Columns {
            separator: separator(first.text),
            count: 0,
            roles: Vec::new(),
            radius: false,
            color: false,
            unknown: Vec::new(),
        };
        let mut cells: Vec<Token<'_>> = columns.cells(first).collect();
        if cells.len() > 1 && cells.last().is_some_and(|cell| cell.text.is_empty()) {
            cells.pop();
        }
        columns.count = cells.len();
        let number = |cell: &Token<'_>| columns.number(cell, &mut 0).is_some() || is_missing(cell.text);
        let named = cells.iter().any(|cell| !number(cell));
        if !named || cells.iter().any(|cell| cell.number().is_ok()) {
            (columns.radius, columns.color) = match cells.len().wrapping_sub(n) {
                0 => (false, false),
                1 => (true, false),
                3 => (false, true),
                4 => (true, true),
                _ => {
                    let message = format!(
                        "a row has {} columns, but it should have {n}, {}, {} or {}",
                        cells.len(),
                        n + 1,
                        n + 3,
                        n + 4
                    );
                    let names = points.join(" ");
                    return Err(first.wrong(message).help(format!(
                        "the columns are {names} [radius] [red green blue]; others need names in the first row"
                    )));
                }
            };
            let coordinates = (0..n).map(Role::Point);
            let radius = columns.radius.then_some(Role::Radius);
            let color = (0..3).map(Role::Color).filter(|_| columns.color);
            columns.roles = coordinates.chain(radius).chain(color).map(Some).collect();
            return Ok((columns, first.start));
        }
        let names: Vec<String> = cells.iter().map(name).collect();
        let find = |wanted: &[&str]| names.iter().position(|name| wanted.iter().any(|wanted| is_called(name, wanted)));
        columns.roles = vec![None; names.len()];
        for (index, name) in points.iter().enumerate() {
            let at = find(&[name]).ok_or_else(|| {
                first.wrong(format!("the first row names no column `{name}`")).help(format!(
                    "its columns are {}; the coordinates must be called {}",
                    names.iter().take(12).map(String::as_str).collect::<Vec<_>>().join(", "),
                    points.join(", ")
                ))
            })?;
            columns.roles[at] = Some(Role::Point(index));
        }
        let short = find(&["g"]).is_some() && find(&["b"]).is_some();
        let rgb = if short {
            [find(&["r"]), find(&["g"]), find(&["b"])]
        } else {
            [find(&["red"]), find(&["green"]), find(&["blue"])]
        };
        if let [Some(r), Some(g), Some(b)] = rgb {
            columns.color = true;
            [r, g, b].iter().enumerate().for_each(|(i, at)| columns.roles[*at] = Some(Role::Color(i)));
        }
        let radius = find(&["radius"]).or(if short { None } else { find(&["r"]) });
        if let Some(at) = radius {
            columns.radius = true;
            columns.roles[at] = Some(Role::Radius);
        }
        let unknown = names.iter().zip(&columns.roles).filter(|(_, role)| role.is_none());
        columns.unknown = unknown.map(|(name, _)| name.clone()).collect();
        Ok((columns, first.start + first.text.len()))
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
        let mut count = 0;
        for cell in self.cells(row) {
            if let Some(Some(role)) = self.roles.get(count) {
                let value = match self.number(&cell, &mut table.commas) {
                    Some(value) => value,
                    None if is_missing(cell.text) => f64::NAN,
                    None => return Err(self.no_number(&cell, count, *role, points)),
                };
                match role {
                    Role::Point(index) => place[*index] = value,
                    Role::Radius if value <= 0.0 && value.is_finite() => {
                        let message = format!("column {}: radius is {value}; it must be more than 0", count + 1);
                        return Err(cell.wrong(message));
                    }
                    Role::Radius => radius = value as f32,
                    Role::Color(index) => color[*index] = value as f32,
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
        if self.radius {
            table.radii.push(radius);
        }
        if self.color {
            table.colors.push(color.into());
        }
        Ok(())
    }

    fn no_number(&self, cell: &Token<'_>, count: usize, role: Role, points: &[&str]) -> ImportError {
        let name = match role {
            Role::Point(index) => points[index],
            Role::Radius => "radius",
            Role::Color(index) => ["red", "green", "blue"][index],
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
