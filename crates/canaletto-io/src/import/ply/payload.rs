//! The numbers of a PLY file, row by row.

use super::header::{Element, Encoding, Header, Kind};
use crate::import::lines::{Complaint, Lines, Word, lines};

/// The numbers of one row.
#[derive(Default)]
pub(super) struct Row {
    /// For each property its number, or the length of its list.
    pub(super) numbers: Vec<f64>,
    /// The entries of all its lists, one after another.
    entries: Vec<f64>,
    /// For each property where its list ends in `entries`.
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

/// Goes through the elements in the order of the file.
pub(super) struct Payload<'a> {
    encoding: Encoding,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Payload<'a> {
    pub(super) fn new(header: &Header, bytes: &'a [u8]) -> Payload<'a> {
        Payload { encoding: header.encoding, bytes, at: header.end }
    }

    /// Fails if the rest of the file can't hold this element, before anything is allocated for it.
    pub(super) fn check_room(&self, element: &Element) -> Result<(), Complaint> {
        let rest = (self.bytes.len() - self.at) as u64;
        let least = element.count.saturating_mul(element.row_size(self.encoding));
        // The last line of text may have no end.
        if least <= rest.saturating_add(1) {
            return Ok(());
        }
        Err(Complaint::file(format!(
            "the header announces {} rows of {}, at least {least} bytes, but only {rest} bytes are left",
            element.count, element.name
        ))
        .help("the file may have been cut off"))
    }

    /// Passes over an element.
    pub(super) fn skip(&mut self, element: &Element) -> Result<(), Complaint> {
        if element.properties.is_empty() {
            return Ok(());
        }
        if self.encoding != Encoding::Ascii && element.properties.iter().all(|p| p.length.is_none()) {
            self.check_room(element)?;
            let size = element.count.saturating_mul(element.row_size(self.encoding));
            let end = (self.at as u64).saturating_add(size);
            if end > self.bytes.len() as u64 {
                return Err(self.cut_off(element, 0));
            }
            self.at = end as usize;
            return Ok(());
        }
        self.rows(element, |_, _| Ok(()))
    }

    /// Hands out the rows of an element with their numbers from 0.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        mut row: impl FnMut(u64, &Row) -> Result<(), String>,
    ) -> Result<(), Complaint> {
        self.check_room(element)?;
        if element.properties.is_empty() {
            return Ok(());
        }
        let mut buffer = Row::default();
        if self.encoding == Encoding::Ascii {
            let mut all: Lines<'_> = lines(&self.bytes[self.at..]);
            for index in 0..element.count {
                let Some(line) = all.next() else { return Err(self.cut_off(element, index)) };
                let line = Word { start: line.start + self.at, text: line.text };
                let what = || format!("{} {index}", element.name);
                text_row(element, &line, &mut buffer).map_err(|complaint| complaint.within(&what()))?;
                row(index, &buffer).map_err(|message| line.wrong(message).within(&what()))?;
            }
            self.at += all.position();
            return Ok(());
        }
        for index in 0..element.count {
            if self.binary_row(element, &mut buffer).is_none() {
                return Err(self.cut_off(element, index));
            }
            row(index, &buffer).map_err(|message| Complaint::file(format!("{} {index}: {message}", element.name)))?;
        }
        Ok(())
    }

    /// The rows of an element whose rows are all of `stride` bytes, if that many are left. They count as read once
    /// [`Payload::pass`] is called.
    pub(super) fn table(&self, element: &Element, stride: usize) -> Option<&'a [u8]> {
        let size = usize::try_from(element.count).ok()?.checked_mul(stride)?;
        (self.encoding != Encoding::Ascii).then(|| self.bytes[self.at..].get(..size)).flatten()
    }

    /// Goes on behind a table.
    pub(super) fn pass(&mut self, table: &[u8]) {
        self.at += table.len();
    }

    /// Whether numbers start with their highest byte.
    pub(super) fn is_big(&self) -> bool {
        self.encoding == Encoding::Big
    }

    fn cut_off(&self, element: &Element, index: u64) -> Complaint {
        Complaint::file(format!("the file ends inside {} {index} of {}", element.name, element.count))
            .help("the file may have been cut off")
    }

    fn binary_row(&mut self, element: &Element, row: &mut Row) -> Option<()> {
        row.clear();
        for property in &element.properties {
            if let Some(kind) = property.length {
                let length = self.binary(kind)?;
                let size = (length.max(0.0) as u64).checked_mul(property.kind.size() as u64)?;
                if length < 0.0 || size > (self.bytes.len() - self.at) as u64 {
                    return None;
                }
                row.numbers.push(length);
                for _ in 0..length as u64 {
                    let entry = self.binary(property.kind)?;
                    row.entries.push(entry);
                }
            } else {
                let number = self.binary(property.kind)?;
                row.numbers.push(number);
            }
            row.ends.push(row.entries.len());
        }
        Some(())
    }

    #[inline]
    fn binary(&mut self, kind: Kind) -> Option<f64> {
        let rest = self.bytes.get(self.at..)?;
        self.at += kind.size();
        let big = self.encoding == Encoding::Big;
        macro_rules! number {
            ($type:ty) => {{
                let bytes = *rest.first_chunk()?;
                f64::from(if big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
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

fn text_row(element: &Element, line: &Word<'_>, row: &mut Row) -> Result<(), Complaint> {
    row.clear();
    let mut words = line.words();
    for property in &element.properties {
        let mut number = |what: &str| {
            let word = words.next().ok_or_else(|| line.wrong(format!("the line ends before {what}")))?;
            // As f64, since f32 doesn't hold all indices.
            let parsed: Option<f64> = std::str::from_utf8(word.text).ok().and_then(|text| text.parse().ok());
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
