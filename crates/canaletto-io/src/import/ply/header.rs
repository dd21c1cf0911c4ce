//! The header of a PLY file: its encoding, and its elements with their properties.

use crate::import::lines::{ImportError, Token, Tokens};

/// The encoding of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The number types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(name: &[u8]) -> Option<Kind> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"int8" => Kind::I8,
            b"uchar" | b"uint8" => Kind::U8,
            b"short" | b"int16" => Kind::I16,
            b"ushort" | b"uint16" => Kind::U16,
            b"int" | b"int32" => Kind::I32,
            b"uint" | b"uint32" => Kind::U32,
            b"float" | b"float32" => Kind::F32,
            b"double" | b"float64" => Kind::F64,
            _ => return None,
        })
    }

    /// The size in bytes in the binary encodings.
    pub(super) fn size(self) -> usize {
        match self {
            Kind::I8 | Kind::U8 => 1,
            Kind::I16 | Kind::U16 => 2,
            Kind::I32 | Kind::U32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }
}

/// One column of an element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// The type of the length, for list properties.
    pub(super) length: Option<Kind>,
    pub(super) kind: Kind,
}

/// One table of the file.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The index of the first property with one of these names.
    pub(super) fn property(&self, names: &[&str]) -> Option<usize> {
        names.iter().find_map(|name| self.properties.iter().position(|p| p.name == *name))
    }

    /// The indices of the number properties of these names, if all exist.
    pub(super) fn numbers<const N: usize>(&self, names: [&str; N]) -> Option<[usize; N]> {
        let found = names.map(|name| self.property(&[name]).filter(|at| self.properties[*at].length.is_none()));
        found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
    }

    /// The warning about unused properties, if there are any.
    pub(super) fn unused(&self, used: &[usize]) -> Option<ImportError> {
        /// The largest number of names in the message.
        const MOST: usize = 12;
        let names = self.properties.iter().enumerate().filter(|(at, _)| !used.contains(at)).map(|(_, p)| &*p.name);
        let names: Vec<&str> = names.collect();
        if names.is_empty() || self.count == 0 {
            return None;
        }
        let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
        let (listed, one) = (names[..names.len().min(MOST)].join(", "), names.len() == 1);
        let (noun, is) = if one { ("property", "is") } else { ("properties", "are") };
        Some(ImportError::file(format!("the {noun} {listed}{more} of element {} {is} left out", self.name)))
    }

    /// The smallest size of a row in bytes. It is the exact size of binary rows without lists.
    pub(super) fn row_size(&self, encoding: Encoding) -> u64 {
        let size =
            |p: &Property| if encoding == Encoding::Ascii { 2 } else { p.length.unwrap_or(p.kind).size() as u64 };
        self.properties.iter().map(size).sum()
    }
}

/// The contents of the header.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The pictures that comments name as textures, as MeshLab writes them.
    pub(super) textures: Vec<String>,
    /// The offset of the numbers in the file.
    pub(super) end: usize,
}

/// The largest number of pictures that are stored.
const MAX_TEXTURES: usize = 16;

/// Reads the header. Keywords, types and names may be in capitals. Spaces or a byte order mark may surround its lines.
pub(super) fn read(bytes: &[u8]) -> Result<Header, ImportError> {
    let start = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let first = bytes[start..].iter().position(|b| *b == b'\n' || *b == b'\r').map(|length| start + length);
    let Some(end) = first.filter(|end| bytes[start..*end].trim_ascii().eq_ignore_ascii_case(b"ply")) else {
        return Err(ImportError::file("it doesn't start with the line `ply`").help("is it a PLY file?"));
    };
    // If \r alone ends lines, a \n after the last one is the first byte of the numbers.
    let pairs = bytes[end..].starts_with(b"\r\n");
    let mut at = start;
    let mut encoding = None;
    let mut textures = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    while at < bytes.len() {
        let rest = &bytes[at..];
        let length = rest.iter().position(|b| *b == b'\n' || *b == b'\r').unwrap_or(rest.len());
        let line = Token { start: at, text: &rest[..length] };
        at += length + if pairs && rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
        let mut words = line.words();
        let Some(word) = words.next() else { continue };
        match word.text.to_ascii_lowercase().as_slice() {
            _ if line.start == start => {}
            b"ply" | b"obj_info" => {}
            b"comment" => {
                let texture = words.next().filter(|word| word.text.eq_ignore_ascii_case(b"texturefile"));
                if texture.is_some() && textures.len() < MAX_TEXTURES {
                    textures.push(words.rest().string());
                }
            }
            b"format" => encoding = Some(format(&line, words)?),
            b"element" => elements.push(element(&line, words)?),
            b"property" => {
                let Some(element) = elements.last_mut() else {
                    return Err(line.wrong("this property stands before the first element"));
                };
                element.properties.push(property(&line, words)?);
            }
            b"end_header" => {
                let encoding = encoding.ok_or_else(|| line.wrong("the header names no format"))?;
                return Ok(Header { encoding, elements, textures, end: at.min(bytes.len()) });
            }
            _ => return Err(line.wrong(format!("the header has an unknown word, \"{}\"", word.shown()))),
        }
    }
    Err(ImportError::file("the header has no end: there is no line `end_header`"))
}

fn format(line: &Token<'_>, mut words: Tokens<'_>) -> Result<Encoding, ImportError> {
    let (name, version) = (words.next(), words.next());
    let encoding = match name.map(|w| w.text.to_ascii_lowercase()).as_deref() {
        Some(b"ascii") => Encoding::Ascii,
        Some(b"binary_little_endian") => Encoding::Little,
        Some(b"binary_big_endian") => Encoding::Big,
        _ => return Err(line.wrong("the format must be ascii, binary_little_endian or binary_big_endian")),
    };
    match version.map(|w| w.text) {
        Some(b"1.0" | b"1") => Ok(encoding),
        _ => Err(line.wrong("the format's version must be 1.0")),
    }
}

fn element(line: &Token<'_>, mut words: Tokens<'_>) -> Result<Element, ImportError> {
    let (Some(name), Some(count)) = (words.next(), words.next()) else {
        return Err(line.wrong("an element needs a name and a count"));
    };
    let number = std::str::from_utf8(count.text).ok().and_then(|text| text.parse().ok());
    let count = number.ok_or_else(|| count.wrong(format!("\"{}\" is not a count", count.shown())))?;
    Ok(Element { name: name.string().to_lowercase(), count, properties: Vec::new() })
}

fn property(line: &Token<'_>, mut words: Tokens<'_>) -> Result<Property, ImportError> {
    let kind = |word: Option<Token<'_>>| {
        let word = word.ok_or_else(|| line.wrong("a property needs a type and a name"))?;
        Kind::named(word.text).ok_or_else(|| word.wrong(format!("\"{}\" is not a type of PLY", word.shown())))
    };
    let first = words.next();
    let (length, kind) = if first.is_some_and(|w| w.text.eq_ignore_ascii_case(b"list")) {
        (Some(kind(words.next())?), kind(words.next())?)
    } else {
        (None, kind(first)?)
    };
    if matches!(length, Some(Kind::F32 | Kind::F64)) {
        return Err(line.wrong("a list's length must be of a whole type"));
    }
    let name = words.next().ok_or_else(|| line.wrong("a property needs a type and a name"))?;
    Ok(Property { name: name.string().to_lowercase(), length, kind })
}
