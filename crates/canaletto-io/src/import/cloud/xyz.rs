//! XYZ, a format of chemistry: a count of atoms, a comment line, and a line `element x y z` for each atom.
//!
//! Radii are van der Waals radii (Alvarez, *A cartography of the van der Waals territories*, Dalton Trans. 42, 2013)
//! unless the scene sets one. Colours are those of Jmol. Extended XYZ declares its columns in the comment line
//! (`Properties=species:S:1:pos:R:3:radius:R:1:color:R:3`); columns of forces, charges and the like are skipped. Of
//! several frames only the first is read.

use super::LeftOutRows;
use super::elements::{Element, element};
use crate::import::lines::{ImportError, Token};
use crate::import::number;
use crate::import::positions::Positions;
use canaletto::math::Rgb;
use glam::DVec3;

/// The atoms of a file.
#[derive(Default)]
pub(super) struct Atoms {
    pub(super) centers: Positions,
    /// The radii of the file, or of the elements.
    pub(super) radii: Vec<f32>,
    pub(super) has_radii: bool,
    /// The colours of the elements, linear.
    pub(super) colors: Vec<Rgb>,
    /// The colours of the file, as written; empty if it has none.
    pub(super) own_colors: Vec<Rgb>,
    pub(super) lost: LeftOutRows,
    /// The first name that is no element, and the number of such names.
    pub(super) unknown: Option<(String, u64)>,
    /// Whether more frames follow the first.
    pub(super) more: bool,
}

/// The columns that are used.
struct Columns {
    species: Option<usize>,
    position: usize,
    radius: Option<usize>,
    color: Option<usize>,
    count: usize,
}

/// The content of a text that starts with a count alone in its first line.
pub(super) enum Counted {
    /// The atoms.
    Atoms(Box<Atoms>),
    /// Plain rows, which start at this offset.
    Rows(usize),
}

/// Reads the content after a count, if the text starts with one.
pub(super) fn read(bytes: &[u8]) -> Option<Result<Counted, ImportError>> {
    let mut lines = Lines { bytes, at: if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } };
    let first = lines.find(|line| !line.text.is_empty())?;
    let count: u64 = std::str::from_utf8(first.text).ok()?.parse().ok()?;
    let rows = lines.at;
    let remarks = lines.next().unwrap_or(Token { start: bytes.len(), text: &[] });
    // As many numeric rows as the count and no comment line: points with a count in front, as scanners write them.
    let mut plain = Lines { bytes, at: rows }.filter(|line| !line.text.is_empty());
    let numbers = |line: &Token<'_>| line.words().count() >= 3 && line.words().all(|word| word.number().is_ok());
    if plain.next().is_none_or(|line| numbers(&line)) && plain.count() as u64 + 1 == count {
        return Some(Ok(Counted::Rows(rows)));
    }
    Some(atoms(count, &first, &remarks, lines).map(|atoms| Counted::Atoms(Box::new(atoms))))
}

fn atoms(count: u64, first: &Token<'_>, remarks: &Token<'_>, mut lines: Lines<'_>) -> Result<Atoms, ImportError> {
    let columns = Columns::of(remarks)?;
    let mut atoms = Atoms { has_radii: columns.radius.is_some(), ..Atoms::default() };
    for index in 0..count {
        let line = lines.next().filter(|line| !line.text.is_empty());
        let Some(line) = line else {
            let message = format!("it announces {count} atoms, but only {index} follow");
            return Err(first
                .wrong(message)
                .help("an XYZ file is a count, a line of remarks, and a line for each atom"));
        };
        columns.read(&line, &mut atoms)?;
    }
    atoms.more = lines.any(|line| !line.text.is_empty());
    Ok(atoms)
}

impl Columns {
    /// The columns that the comment line declares, or the default ones.
    fn of(remarks: &Token<'_>) -> Result<Columns, ImportError> {
        let usual = Columns { species: Some(0), position: 1, radius: None, color: None, count: 4 };
        let text = remarks.string();
        let lower = text.to_ascii_lowercase();
        let Some(at) = lower.find("properties=") else { return Ok(usual) };
        let list = text[at + "properties=".len()..].trim_start_matches(['"', '\'']);
        let list = list.split([' ', '\t', '"', '\'']).next().unwrap_or_default();
        let fields: Vec<&str> = list.split(':').collect();
        let mut columns = Columns { species: None, position: usize::MAX, radius: None, color: None, count: 0 };
        for field in fields.chunks(3) {
            let wrong = || remarks.wrong(format!("\"{list}\" is not a list of name:type:columns"));
            let [name, _, width] = field else { return Err(wrong()) };
            let width: usize = width.parse().ok().filter(|width| (1..=1024).contains(width)).ok_or_else(wrong)?;
            match (name.to_ascii_lowercase().as_str(), width) {
                ("species" | "element" | "z", 1) => columns.species = columns.species.or(Some(columns.count)),
                ("pos" | "positions", 3) => columns.position = columns.count,
                ("radius" | "radii", 1) => columns.radius = Some(columns.count),
                ("color" | "colour" | "colors", 3) => columns.color = Some(columns.count),
                _ => {}
            }
            columns.count += width;
        }
        if columns.position == usize::MAX {
            return Err(remarks.wrong("its Properties have no positions: pos:R:3 is expected"));
        }
        Ok(columns)
    }

    fn read(&self, line: &Token<'_>, atoms: &mut Atoms) -> Result<(), ImportError> {
        let words: Vec<Token<'_>> = line.words().collect();
        if words.len() < self.count {
            let message = format!("this line has {} columns; {} are expected", words.len(), self.count);
            return Err(line.wrong(message).help("a line is the element and its place: C 0.0 0.0 0.0"));
        }
        let number = |at: usize, what: &str| {
            let word = &words[at];
            let value = number::parse(word.text);
            value.ok_or_else(|| word.wrong(format!("{what}: \"{}\" is not a number", word.shown())))
        };
        let center =
            DVec3::new(number(self.position, "x")?, number(self.position + 1, "y")?, number(self.position + 2, "z")?);
        let known = self.species.and_then(|at| element(words[at].text));
        if let (None, Some(at)) = (known, self.species) {
            atoms.unknown.get_or_insert_with(|| (words[at].shown(), 0)).1 += 1;
        }
        let Element { radius, color } = known.unwrap_or(Element::UNKNOWN);
        let radius = self.radius.map_or(Ok(radius.into()), |at| number(at, "radius"))? as f32;
        if radius <= 0.0 && radius.is_finite() {
            return Err(line.wrong(format!("radius is {radius}; it must be more than 0")));
        }
        let own = self
            .color
            .map(|at| Ok::<_, ImportError>([number(at, "red")?, number(at + 1, "green")?, number(at + 2, "blue")?]));
        let own: Option<[f64; 3]> = own.transpose()?;
        if !(center.as_vec3().is_finite() && radius.is_finite()) {
            atoms.lost.note(line);
            return Ok(());
        }
        atoms.lost.kept += 1;
        atoms.centers.push(center.as_vec3(), center);
        atoms.radii.push(radius);
        atoms.colors.push(color);
        atoms.own_colors.extend(own.map(|color| Rgb::from(color.map(|v| v as f32))));
        Ok(())
    }
}

/// All lines, including blank ones, ended by `\n`, `\r` or both.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Iterator for Lines<'a> {
    type Item = Token<'a>;
    fn next(&mut self) -> Option<Token<'a>> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        let start = self.at;
        self.at += end + if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        let line = &rest[..end];
        Some(Token { start: start + line.len() - line.trim_ascii_start().len(), text: line.trim_ascii() })
    }
}
