//! The numbers of a PLY file, row by row.
//!
//! A window moves over the file. The boundaries of its rows are found sequentially; the rows are then decoded in
//! parallel.

use super::header::{Element, Encoding, Header, Kind};
use crate::content::View;
use crate::import::lines::{ImportError, Lines, Token};
use crate::import::{number, unreadable};
use canaletto_parallel::prelude::*;
use std::ops::Range;

/// The numbers of one row.
#[derive(Default)]
pub(super) struct Row {
    /// For each property its number, or the length of its list.
    pub(super) numbers: Vec<f64>,
    /// The concatenated entries of all lists.
    entries: Vec<f64>,
    /// For each property the end of its list in `entries`.
    ends: Vec<usize>,
}

impl Row {
    /// The list of a property.
    pub(super) fn list(&self, property: usize) -> &[f64] {
        let start = if property == 0 { 0 } else { self.ends[property - 1] };
        &self.entries[start..self.ends[property]]
    }

    fn clear(&mut self) {
        self.numbers.clear();
        self.entries.clear();
        self.ends.clear();
    }
}

/// The size of a window per thread in bytes.
const WINDOW: usize = 1 << 22;

/// The number of rows that are decoded together.
const GROUP: u64 = 1024;

/// A cursor over the elements in the order of the file.
pub(super) struct Payload<'a> {
    encoding: Encoding,
    view: View<'a>,
    at: usize,
    window: usize,
}

/// Consecutive rows in a window.
struct Group {
    /// The index of the first row, counted from the start of the window.
    first: u64,
    rows: u64,
    /// The byte range of the rows in the window.
    bytes: Range<usize>,
}

impl<'a> Payload<'a> {
    pub(super) fn new(header: &Header, view: View<'a>) -> Payload<'a> {
        Payload::with_window(header, view, WINDOW * rayon::current_num_threads())
    }

    /// A cursor with an initial window of `window` bytes, at least one.
    pub(super) fn with_window(header: &Header, view: View<'a>, window: usize) -> Payload<'a> {
        Payload { encoding: header.encoding, view, at: header.end, window }
    }

    fn left(&self) -> usize {
        self.view.size().saturating_sub(self.at)
    }

    /// Fails if the rest of the file can't hold this element, before memory is allocated for it.
    pub(super) fn check_room(&self, element: &Element) -> Result<(), ImportError> {
        let rest = self.left() as u64;
        let least = element.count.saturating_mul(element.row_size(self.encoding));
        // The last line of text may have no line end.
        if least <= rest.saturating_add(1) {
            return Ok(());
        }
        Err(ImportError::file(format!(
            "the header announces {} rows of {}, at least {least} bytes, but only {rest} bytes are left",
            element.count, element.name
        ))
        .help("the file may have been cut off"))
    }

    /// Skips an element.
    pub(super) fn skip(&mut self, element: &Element) -> Result<(), ImportError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        if self.encoding != Encoding::Ascii && element.properties.iter().all(|p| p.length.is_none()) {
            self.check_room(element)?;
            let size = element.count.saturating_mul(element.row_size(self.encoding));
            let end = (self.at as u64).saturating_add(size);
            if end > self.view.size() as u64 {
                return Err(self.cut_off(element, 0));
            }
            self.at = end as usize;
            return Ok(());
        }
        self.rows(element, || (), |(), _, _| Ok(()), |()| ())
    }

    /// Reads the rows of an element in parallel groups. `row` gets the state of its group, the row's index from 0 and
    /// the row. The states are passed to `merge` in the order of the file.
    pub(super) fn rows<S: Send>(
        &mut self,
        element: &Element,
        state: impl Fn() -> S + Sync,
        row: impl Fn(&mut S, u64, &Row) -> Result<(), String> + Sync,
        mut merge: impl FnMut(S),
    ) -> Result<(), ImportError> {
        self.check_room(element)?;
        if element.properties.is_empty() {
            return Ok(());
        }
        let (mut next, mut size, mut buffer) = (0, self.window, Vec::new());
        while next < element.count {
            let range = self.at..self.at.saturating_add(size);
            let window = self.view.piece(range, &mut buffer).map_err(|e| unreadable(&e))?;
            let last = self.at + window.len() == self.view.size();
            let left = element.count - next;
            let scan = if self.encoding == Encoding::Ascii {
                scan_text(window, left, last)
            } else {
                scan_binary(window, left, element, self.encoding)
            };
            let decode_rows = |group: &Group| {
                let mut state = state();
                self.decode_rows(element, next, window, group, |index, values| row(&mut state, index, values))?;
                Ok(state)
            };
            let states: Vec<Result<S, ImportError>> = scan.groups.par_iter().map(decode_rows).collect();
            for state in states {
                merge(state?);
            }
            next += scan.rows;
            self.at += scan.end;
            if scan.end == 0 {
                if last {
                    return Err(self.cut_off(element, next));
                }
                // The row is larger than the window.
                size = size.saturating_mul(2);
            }
        }
        Ok(())
    }

    /// Decodes the rows of a group; the window starts with row `first` of the element.
    fn decode_rows(
        &self,
        element: &Element,
        first: u64,
        window: &[u8],
        group: &Group,
        mut row: impl FnMut(u64, &Row) -> Result<(), String>,
    ) -> Result<(), ImportError> {
        let mut buffer = Row::default();
        let bytes = &window[group.bytes.clone()];
        let indices = first + group.first..first + group.first + group.rows;
        if self.encoding == Encoding::Ascii {
            for (index, line) in indices.zip(Lines::new(bytes, self.at + group.bytes.start)) {
                let what = || format!("{} {index}", element.name);
                text_row(element, &line, &mut buffer).map_err(|complaint| complaint.within(&what()))?;
                row(index, &buffer).map_err(|message| line.wrong(message).within(&what()))?;
            }
            return Ok(());
        }
        let mut numbers = Numbers { bytes, big: self.encoding == Encoding::Big };
        for index in indices {
            if numbers.row(element, &mut buffer).is_none() {
                return Err(self.cut_off(element, index));
            }
            row(index, &buffer).map_err(|message| ImportError::file(format!("{} {index}: {message}", element.name)))?;
        }
        Ok(())
    }

    /// The offset of the rows of an element, if each has `stride` bytes and the file is long enough. [`Payload::pass`]
    /// consumes them.
    pub(super) fn table(&self, element: &Element, stride: usize) -> Option<usize> {
        let size = usize::try_from(element.count).ok()?.checked_mul(stride)?;
        (self.encoding != Encoding::Ascii && stride > 0 && size <= self.left()).then_some(self.at)
    }

    /// The warning about bytes after the last element, unless they are blanks or a trailer of a few bytes.
    pub(super) fn rest(&self) -> Result<Option<ImportError>, ImportError> {
        const FEW: usize = 16;
        let left = self.left();
        if left <= FEW && self.encoding != Encoding::Ascii {
            return Ok(None);
        }
        let mut buffer = Vec::new();
        let some = self.view.piece(self.at..self.at + left.min(1 << 12), &mut buffer).map_err(|e| unreadable(&e))?;
        let blank = if self.encoding == Encoding::Ascii { some.len() - some.trim_ascii_start().len() } else { 0 };
        let more = blank < some.len();
        Ok(more.then(|| ImportError::file(format!("{} bytes behind its last element are left out", left - blank))))
    }

    /// Skips this many bytes.
    pub(super) fn pass(&mut self, bytes: usize) {
        self.at += bytes;
    }

    pub(super) fn encoding(&self) -> Encoding {
        self.encoding
    }

    pub(super) fn view(&self) -> View<'a> {
        self.view
    }

    fn cut_off(&self, element: &Element, index: u64) -> ImportError {
        ImportError::file(format!("the file ends inside {} {index} of {}", element.name, element.count))
            .help("the file may have been cut off")
    }
}

/// The rows that were found in a window.
struct Scan {
    groups: Vec<Group>,
    /// The number of rows in the groups.
    rows: u64,
    /// The offset of the first row after the groups.
    end: usize,
}

impl Scan {
    /// Adds a group of `rows` rows that ends at `end`.
    fn push(&mut self, rows: u64, end: usize) {
        if rows > 0 {
            self.groups.push(Group { first: self.rows, rows, bytes: self.end..end });
            (self.rows, self.end) = (self.rows + rows, end);
        }
    }
}

/// Finds up to `most` lines. In the last window the last line needs no line end.
fn scan_text(window: &[u8], most: u64, last: bool) -> Scan {
    let whole = if last { window.len() } else { memchr::memrchr2(b'\n', b'\r', window).unwrap_or(0) };
    let mut all = Lines::new(&window[..whole], 0);
    let mut scan = Scan { groups: Vec::new(), rows: 0, end: 0 };
    while scan.rows < most {
        let rows = all.by_ref().take((most - scan.rows).min(GROUP) as usize).count() as u64;
        if rows == 0 {
            scan.end = whole;
            break;
        }
        scan.push(rows, all.position());
    }
    scan
}

/// Finds up to `most` complete rows of binary numbers.
fn scan_binary(window: &[u8], most: u64, element: &Element, encoding: Encoding) -> Scan {
    let mut numbers = Numbers { bytes: window, big: encoding == Encoding::Big };
    let mut scan = Scan { groups: Vec::new(), rows: 0, end: 0 };
    let (mut rows, mut end) = (0, 0);
    while scan.rows + rows < most && numbers.pass(element).is_some() {
        (rows, end) = (rows + 1, window.len() - numbers.bytes.len());
        if rows == GROUP {
            scan.push(rows, end);
            rows = 0;
        }
    }
    scan.push(rows, end);
    scan
}

/// A cursor over binary numbers.
struct Numbers<'a> {
    bytes: &'a [u8],
    big: bool,
}

impl Numbers<'_> {
    /// Skips a row.
    #[inline]
    fn pass(&mut self, element: &Element) -> Option<()> {
        for property in &element.properties {
            let size = match property.length {
                Some(kind) => self.length(kind)?.checked_mul(property.kind.size())?,
                None => property.kind.size(),
            };
            self.bytes = self.bytes.get(size..)?;
        }
        Some(())
    }

    #[inline]
    fn length(&mut self, kind: Kind) -> Option<usize> {
        let length = self.next(kind)?;
        (length >= 0.0).then_some(length as usize)
    }

    fn row(&mut self, element: &Element, row: &mut Row) -> Option<()> {
        row.clear();
        for property in &element.properties {
            if let Some(kind) = property.length {
                let length = self.length(kind)?;
                if length.checked_mul(property.kind.size())? > self.bytes.len() {
                    return None;
                }
                row.numbers.push(length as f64);
                for _ in 0..length {
                    let entry = self.next(property.kind)?;
                    row.entries.push(entry);
                }
            } else {
                let number = self.next(property.kind)?;
                row.numbers.push(number);
            }
            row.ends.push(row.entries.len());
        }
        Some(())
    }

    #[inline]
    fn next(&mut self, kind: Kind) -> Option<f64> {
        macro_rules! number {
            ($type:ty) => {{
                let (bytes, rest) = self.bytes.split_first_chunk()?;
                self.bytes = rest;
                f64::from(if self.big { <$type>::from_be_bytes(*bytes) } else { <$type>::from_le_bytes(*bytes) })
            }};
        }
        Some(match kind {
            Kind::I8 => number!(i8),
            Kind::U8 => number!(u8),
            Kind::I16 => number!(i16),
            Kind::U16 => number!(u16),
            Kind::I32 => number!(i32),
            Kind::U32 => number!(u32),
            Kind::F32 => number!(f32),
            Kind::F64 => number!(f64),
        })
    }
}

fn text_row(element: &Element, line: &Token<'_>, row: &mut Row) -> Result<(), ImportError> {
    row.clear();
    let mut words = line.words();
    for property in &element.properties {
        let mut number = |what: &str| {
            let word = words.next().ok_or_else(|| line.wrong(format!("the line ends before {what}")))?;
            // The type is f64, since f32 doesn't hold all indices.
            let parsed = number::parse(word.text);
            parsed.ok_or_else(|| word.wrong(format!("{what}: \"{}\" is not a number", word.shown())))
        };
        let value = number(&property.name)?;
        if property.length.is_some() {
            if !(0.0..=line.text.len() as f64).contains(&value) || value.fract() != 0.0 {
                return Err(line.wrong(format!("{} can't have {value} entries", property.name)));
            }
            for _ in 0..value as u64 {
                row.entries.push(number(&property.name)?);
            }
        }
        row.numbers.push(value);
        row.ends.push(row.entries.len());
    }
    match words.next() {
        Some(word) => Err(word.wrong(format!("\"{}\" is more than the header announces for a line", word.shown()))),
        None => Ok(()),
    }
}
