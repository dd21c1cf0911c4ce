//! NPY, NumPy's files of one array (NEP 1; formats 1.0 to 3.0), as tables.
//!
//! The header is a literal of Python: `{'descr': '<f8', 'fortran_order': False, 'shape': (100, 4), }`. A table is an
//! array of two dimensions, or one of records with names (a structured type). Arrays of Python objects are pickled;
//! they could hold a program, and are refused.

use super::CloudSettings;
use super::columns::{Role, Roles, Unfit};
use super::text::Table;
use crate::import::lines::ImportError;
use crate::import::table_color::Written;
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// The first bytes of a file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// The longest header that is read. NumPy itself refuses more than 10,000 characters.
const LONGEST_HEADER: usize = 1 << 20;
/// The most columns of a table.
const MOST_COLUMNS: usize = 4096;
/// The deepest nesting of a header.
const DEEPEST: usize = 16;

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    F32,
    F64,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    Bool,
}

impl Kind {
    /// The type of a code without its byte order, such as `f8`.
    fn of(code: &str) -> Option<Kind> {
        Some(match code {
            "f4" => Kind::F32,
            "f8" => Kind::F64,
            "i1" => Kind::I8,
            "i2" => Kind::I16,
            "i4" => Kind::I32,
            "i8" => Kind::I64,
            "u1" => Kind::U8,
            "u2" => Kind::U16,
            "u4" => Kind::U32,
            "u8" => Kind::U64,
            "b1" | "?" => Kind::Bool,
            _ => return None,
        })
    }

    /// How colours of this type are counted.
    fn written(self) -> Written {
        match self {
            Kind::F32 | Kind::F64 | Kind::Bool => Written::Real,
            Kind::U8 => Written::Byte,
            Kind::I8 => Written::Whole(127.0),
            Kind::I16 => Written::Whole(32767.0),
            Kind::U16 => Written::Whole(65535.0),
            Kind::I32 | Kind::I64 => Written::Whole(2_147_483_647.0),
            Kind::U32 | Kind::U64 => Written::Whole(4_294_967_295.0),
        }
    }
}

/// A column of the array.
#[derive(Debug)]
struct Column {
    /// The name in lower case; empty for padding and in arrays without names.
    name: String,
    /// The type; `None` for texts and others that aren't read.
    kind: Option<Kind>,
    big: bool,
    /// The byte of the first row's number, and the bytes from row to row.
    offset: usize,
    stride: usize,
}

impl Column {
    /// The number of a row. The data must reach that far.
    fn number(&self, data: &[u8], row: usize) -> f64 {
        let at = &data[self.offset + row * self.stride..];
        macro_rules! read {
            ($type:ty) => {{
                let bytes = at.first_chunk().copied().unwrap_or_default();
                (if self.big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }) as f64
            }};
        }
        match self.kind {
            Some(Kind::F32) => read!(f32),
            Some(Kind::F64) => read!(f64),
            Some(Kind::I8) => read!(i8),
            Some(Kind::I16) => read!(i16),
            Some(Kind::I32) => read!(i32),
            Some(Kind::I64) => read!(i64),
            Some(Kind::U8) => read!(u8),
            Some(Kind::U16) => read!(u16),
            Some(Kind::U32) => read!(u32),
            Some(Kind::U64) => read!(u64),
            Some(Kind::Bool) => f64::from(u8::from(at[0] != 0)),
            None => f64::NAN,
        }
    }
}

/// A table of an array.
pub(super) struct NumpyTable {
    pub(super) table: Table,
    /// How its colours are counted.
    pub(super) written: Written,
    /// Whether the coordinates have the precision of `f32`.
    pub(super) is_single: bool,
}

/// The rows of an array; `points` has the names of the coordinate columns.
pub(super) fn read(bytes: &[u8], points: &[&str], settings: &CloudSettings) -> Result<NumpyTable, ImportError> {
    let (header, data) = header(bytes)?;
    let (columns, rows) = columns(&header, data.len())?;
    let names = &settings.columns;
    let has_names = columns.iter().any(|column| !column.name.is_empty());
    let roles = if !names.is_empty() && names.len() != columns.len() {
        Err(Unfit {
            message: format!("the array has {} columns, but columns has {} names", columns.len(), names.len()),
            help: "name every column in its order; other names than those of numbers are passed over".into(),
        })
    } else if !names.is_empty() {
        Roles::by_name(names, points, settings, "the scene's columns")
    } else if has_names {
        let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        Roles::by_name(&names, points, settings, "the array")
    } else {
        Roles::by_count(columns.len(), points, settings)
    }?;
    let used = |at: usize| roles.roles[at].is_some() || roles.value.as_ref().is_some_and(|(value, _)| *value == at);
    if let Some(column) = (0..columns.len()).find(|at| used(*at) && columns[*at].kind.is_none()) {
        let name = &columns[column].name;
        return Err(ImportError::file(format!("column \"{name}\" holds no numbers that are read")).help(TYPES));
    }
    /// The number of rows that are read at a time.
    const PIECE: usize = 1 << 16;
    let reader = Reader { columns: &columns, roles: &roles, data, lead: points.len() };
    let parts: Vec<Result<Table, ImportError>> = (0..rows.div_ceil(PIECE))
        .into_par_iter()
        .map(|piece| {
            let mut table = Table::default();
            let first = piece * PIECE;
            (first..rows.min(first + PIECE)).try_for_each(|row| reader.row(row, &mut table))?;
            table.points = table.points.part();
            Ok(table)
        })
        .collect();
    let of = |wanted: fn(&Role) -> bool| {
        let used = roles.roles.iter().zip(&columns).filter(move |(role, _)| role.as_ref().is_some_and(wanted));
        used.filter_map(|(_, column)| column.kind)
    };
    let is_single = of(|role| matches!(role, Role::Point(_))).any(|kind| kind == Kind::F32);
    let written = of(|role| matches!(role, Role::Color(_))).next().map_or(Written::Real, Kind::written);
    let mut table = Table { unknown: roles.unknown, ..Table::default() };
    for part in parts {
        table.append(part?);
    }
    Ok(NumpyTable { table, written, is_single })
}

struct Reader<'a> {
    columns: &'a [Column],
    roles: &'a Roles,
    data: &'a [u8],
    /// The number of coordinates.
    lead: usize,
}

impl Reader<'_> {
    fn row(&self, row: usize, table: &mut Table) -> Result<(), ImportError> {
        let (mut place, mut radius, mut color) = ([0.0f64; 6], 1.0f32, [0.0f32; 3]);
        for (column, role) in self.columns.iter().zip(&self.roles.roles) {
            let Some(role) = role else { continue };
            let number = column.number(self.data, row);
            match role {
                Role::Point(index) => place[*index] = number,
                Role::Radius if number <= 0.0 && number.is_finite() => {
                    let message = format!("row {}: radius is {number}; it must be more than 0", row + 1);
                    return Err(ImportError::file(message));
                }
                Role::Radius => radius = number as f32,
                Role::Color(index) => color[*index] = number as f32,
            }
        }
        if !(place.iter().all(|v| (*v as f32).is_finite()) && radius.is_finite()) {
            table.lost.note_at(row);
            return Ok(());
        }
        table.lost.kept += 1;
        for exact in place[..self.lead].chunks_exact(3).map(DVec3::from_slice) {
            table.points.push(exact.as_vec3(), exact);
        }
        table.radii.extend(self.roles.radius.then_some(radius));
        table.colors.extend(self.roles.color.then(|| canaletto::math::Rgb::from(color)));
        if let Some((at, name)) = &self.roles.value {
            let number = self.columns[*at].number(self.data, row);
            if !number.is_finite() {
                let message = format!("row {}: {name} isn't a finite number, which the colour map needs", row + 1);
                return Err(ImportError::file(message).help("leave the row out, or give it a number"));
            }
            table.values.push(number);
        }
        Ok(())
    }
}

/// The types that are read, for messages.
const TYPES: &str = "f4, f8, i1 to i8, u1 to u8 and bool are read, of both byte orders";

/// A value of Python.
#[derive(Debug, PartialEq)]
enum Literal {
    Text(String),
    Number(u64),
    Flag(bool),
    /// A tuple or a list.
    List(Vec<Literal>),
    Dict(Vec<(String, Literal)>),
}

/// The description of the array, and its bytes.
fn header(bytes: &[u8]) -> Result<(Literal, &[u8]), ImportError> {
    let damaged =
        |what: &str| ImportError::file(format!("it is no NPY file: {what}")).help("np.save writes such files");
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("it doesn't begin with \\x93NUMPY"))?;
    let (&[major, _], rest) = rest.split_first_chunk().ok_or_else(|| damaged("its version is missing"))?;
    let cut = || damaged("its header is cut off");
    let (length, rest) = match major {
        1 => rest.split_first_chunk().map(|(length, rest)| (usize::from(u16::from_le_bytes(*length)), rest)),
        2 | 3 => rest.split_first_chunk().map(|(length, rest)| (u32::from_le_bytes(*length) as usize, rest)),
        _ => {
            let message = format!("its format is {major}.{}, and 1.0 to 3.0 are read", bytes[MAGIC.len() + 1]);
            return Err(ImportError::file(message));
        }
    }
    .ok_or_else(cut)?;
    if length > LONGEST_HEADER {
        return Err(damaged(&format!("its header would have {length} bytes")));
    }
    let (header, data) = rest.split_at_checked(length).ok_or_else(cut)?;
    // Formats before 3.0 are Latin-1, which differs in names only.
    let text = String::from_utf8_lossy(header);
    let mut parser = Parser { rest: text.trim_end(), depth: 0 };
    let dict = parser.literal().filter(|_| parser.rest.trim().is_empty());
    let dict = dict.ok_or_else(|| damaged("its header can't be understood"))?;
    Ok((dict, data))
}

struct Parser<'a> {
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn skip(&mut self, text: &str) -> bool {
        self.rest = self.rest.trim_start();
        let found = self.rest.strip_prefix(text);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn literal(&mut self) -> Option<Literal> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return None;
        }
        let found = self.inner();
        self.depth -= 1;
        found
    }

    fn inner(&mut self) -> Option<Literal> {
        for (open, close) in [("(", ")"), ("[", "]")] {
            if self.skip(open) {
                let mut list = Vec::new();
                while !self.skip(close) {
                    list.push(self.literal()?);
                    if !self.skip(",") {
                        return self.skip(close).then_some(Literal::List(list));
                    }
                }
                return Some(Literal::List(list));
            }
        }
        if self.skip("{") {
            let mut dict = Vec::new();
            while !self.skip("}") {
                let Literal::Text(key) = self.literal()? else { return None };
                if !self.skip(":") {
                    return None;
                }
                dict.push((key, self.literal()?));
                if !self.skip(",") {
                    return self.skip("}").then_some(Literal::Dict(dict));
                }
            }
            return Some(Literal::Dict(dict));
        }
        for (word, flag) in [("True", true), ("False", false)] {
            if self.skip(word) {
                return Some(Literal::Flag(flag));
            }
        }
        // Python 2 wrote u'…' and 5L.
        let _ = self.skip("u");
        for quote in ['\'', '"'] {
            if self.skip(quote.encode_utf8(&mut [0; 4])) {
                return self.text(quote);
            }
        }
        let digits = self.rest.len() - self.rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (number, rest) = self.rest.split_at(digits);
        self.rest = rest;
        let number = number.parse().ok()?;
        let _ = self.skip("L");
        Some(Literal::Number(number))
    }

    /// The rest of a text up to its quote. A backslash stands before the character that it keeps.
    fn text(&mut self, quote: char) -> Option<Literal> {
        let mut text = String::new();
        let mut chars = self.rest.char_indices();
        while let Some((at, c)) = chars.next() {
            match c {
                '\\' => text.push(chars.next()?.1),
                _ if c == quote => {
                    self.rest = &self.rest[at + c.len_utf8()..];
                    return Some(Literal::Text(text));
                }
                _ => text.push(c),
            }
        }
        None
    }
}

/// The columns of an array and the number of its rows; all lie within this many bytes of data.
fn columns(header: &Literal, available: usize) -> Result<(Vec<Column>, usize), ImportError> {
    let wrong = |what: &str| ImportError::file(format!("it is no NPY file: its header has no {what}"));
    let Literal::Dict(dict) = header else { return Err(wrong("keys")) };
    let get = |key: &str| dict.iter().find(|(name, _)| name == key).map(|(_, value)| value);
    let descr = get("descr").ok_or_else(|| wrong("descr"))?;
    let Some(Literal::Flag(fortran)) = get("fortran_order") else { return Err(wrong("fortran_order")) };
    let Some(Literal::List(shape)) = get("shape") else { return Err(wrong("shape")) };
    let numbers = |list: &[Literal]| -> Option<Vec<usize>> {
        let number = |v: &Literal| if let Literal::Number(n) = v { usize::try_from(*n).ok() } else { None };
        list.iter().map(number).collect()
    };
    let shape = numbers(shape).ok_or_else(|| wrong("shape of whole numbers"))?;
    let mut record = Record::default();
    let is_record = matches!(descr, Literal::List(_));
    record.add("", descr)?;
    let size = record.size;
    let (rows, across) = match (is_record, shape.as_slice()) {
        (true, [rows] | [rows, 1]) => (*rows, 1),
        (false, [rows, across]) => (*rows, *across),
        _ => {
            let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
            return Err(ImportError::file(format!(
                "its shape is ({}); a table has rows and columns",
                shape.join(", ")
            ))
            .help("np.column_stack([x, y, z]) makes such an array, and so does an array of records with names"));
        }
    };
    if across > MOST_COLUMNS || record.columns.len() > MOST_COLUMNS {
        return Err(ImportError::file(format!("it has {across} columns, and at most {MOST_COLUMNS} are read"))
            .help("are rows and columns exchanged? array.T exchanges them"));
    }
    let wanted = rows.checked_mul(across).and_then(|cells| cells.checked_mul(size));
    if wanted.is_none_or(|wanted| wanted > available) {
        let wanted = wanted.map_or_else(|| "more bytes than can be counted".into(), |wanted| format!("{wanted} bytes"));
        return Err(ImportError::file(format!(
            "{rows} rows of {across} × {size} bytes are {wanted}, but only {available} follow the header"
        ))
        .help("the file is cut off or damaged"));
    }
    if is_record {
        record.columns.iter_mut().for_each(|column| column.stride = size);
        return Ok((record.columns, rows));
    }
    let [column] = record.columns.as_slice() else { return Err(wrong("type")) };
    let place = |i: usize| if *fortran { (i * rows * size, size) } else { (i * size, across * size) };
    let each = |i: usize| {
        let (offset, stride) = place(i);
        Column { name: String::new(), kind: column.kind, big: column.big, offset, stride }
    };
    Ok(((0..across).map(each).collect(), rows))
}

/// The columns of a row so far.
#[derive(Default)]
struct Record {
    columns: Vec<Column>,
    /// The bytes of a row.
    size: usize,
}

impl Record {
    /// Adds a type: a code, or the fields of a record.
    fn add(&mut self, name: &str, descr: &Literal) -> Result<(), ImportError> {
        let unread = |what: String| Err(ImportError::file(what).help(TYPES));
        match descr {
            Literal::Text(code) => {
                let plain = code.trim_start_matches(['<', '>', '|', '=', '!']);
                if plain.starts_with('O') {
                    return Err(ImportError::file("it holds Python objects, which are pickled; they aren't read")
                        .help("save an array of numbers: np.save(…, allow_pickle=False) tells what is none"));
                }
                let kind = Kind::of(plain);
                let size = match plain.split_at_checked(1) {
                    Some(("?", "")) => Some(1),
                    Some(("M" | "m", _)) => Some(8),
                    Some((letter, count)) => {
                        let width = if letter == "U" { 4usize } else { 1 };
                        count.parse::<usize>().ok().and_then(|count| count.checked_mul(width))
                    }
                    None => None,
                };
                let end = size.and_then(|size| self.size.checked_add(size));
                let Some(end) = end else { return unread(format!("its type \"{code}\" isn't known")) };
                if self.columns.is_empty() && name.is_empty() && kind.is_none() && !plain.starts_with('V') {
                    return unread(format!("its type \"{code}\" isn't read"));
                }
                let big = code.starts_with('>');
                let column = Column { name: name.to_lowercase(), kind, big, offset: self.size, stride: 0 };
                self.columns.push(column);
                self.size = end;
                Ok(())
            }
            Literal::List(fields) => {
                for field in fields {
                    let Literal::List(parts) = field else { return unread("its fields have no names".into()) };
                    let (own, descr, shape) = match parts.as_slice() {
                        [own, descr] => (own, descr, None),
                        [own, descr, shape] => (own, descr, Some(shape)),
                        _ => return unread("its fields have no names".into()),
                    };
                    let own = match own {
                        Literal::Text(own) => own,
                        // A field may have a title and a name.
                        Literal::List(both) => match both.as_slice() {
                            [_, Literal::Text(own)] => own,
                            _ => return unread("its fields have no names".into()),
                        },
                        _ => return unread("its fields have no names".into()),
                    };
                    let own = if name.is_empty() { own.clone() } else { format!("{name}_{own}") };
                    self.repeated(&own, descr, shape)?;
                }
                Ok(())
            }
            _ => unread("its type can't be understood".into()),
        }
    }

    /// Adds a field, which may hold several numbers: they are columns `name_0`, `name_1` and so on.
    fn repeated(&mut self, name: &str, descr: &Literal, shape: Option<&Literal>) -> Result<(), ImportError> {
        let number = |v: &Literal| if let Literal::Number(n) = v { usize::try_from(*n).ok() } else { None };
        let count = match shape {
            None => return self.add(name, descr),
            Some(Literal::List(shape)) => shape.iter().map(number).try_fold(1usize, |all, n| all.checked_mul(n?)),
            Some(one) => number(one),
        };
        let count = count.filter(|count| self.columns.len() + count <= MOST_COLUMNS);
        let Some(count) = count else {
            return Err(ImportError::file(format!("field \"{name}\" has too many numbers for a table")));
        };
        let xyz = ["pos", "position", "center", "centre", "xyz", "point", "points"].contains(&&*name.to_lowercase());
        for i in 0..count {
            match ["x", "y", "z"].get(i).filter(|_| xyz && count == 3) {
                Some(own) => self.add(own, descr)?,
                None => self.add(&format!("{name}_{i}"), descr)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
