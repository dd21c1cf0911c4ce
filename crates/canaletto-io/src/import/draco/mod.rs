//! Meshes compressed by Draco, in version 2.2 of its bitstream.
//!
//! A stream has a header, metadata, the triangles and the attributes. Triangles are a list ([`sequential`]), or a
//! surface that grows triangle by triangle ([`edgebreaker`]): a table of its [`corners`]. Each group of [`attributes`]
//! may cut it along [`seams`]; [`points`] are what all cuts leave together. A [`layout`] is the order of a group's
//! values, which is that of a [`traversal`]. [`values`] are a [`prediction`] and a correction, which a [`transform`]
//! puts together. [`entropy`] coders have the numbers.
//!
//! Points and triangles have the order of Google's own decoder, so that what is stored outside of a stream fits.

mod attributes;
mod corners;
mod edgebreaker;
mod entropy;
mod layout;
mod points;
mod prediction;
mod reader;
mod seams;
mod sequential;
#[cfg(test)]
mod tests;
mod transform;
mod traversal;
mod values;

use attributes::Domain;
use reader::Reader;
use std::borrow::Cow;

/// What is wrong with a stream.
pub(super) type Reason = Cow<'static, str>;
type Decoded<T> = Result<T, Reason>;

const CUT_OFF: &str = "they end too early";

/// A decoded mesh.
#[derive(Debug, PartialEq)]
pub(super) struct Mesh {
    /// The points of the triangles' corners.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) points: usize,
    pub(super) attributes: Vec<Attribute>,
}

impl Mesh {
    /// The bytes of memory that its lists take.
    pub(super) fn bytes(&self) -> usize {
        self.attributes.iter().fold(size_of_val(&self.triangles[..]), |sum, attribute| sum + attribute.bytes.len())
    }
}

/// An attribute of points.
#[derive(Debug, PartialEq)]
pub(super) struct Attribute {
    pub(super) id: u32,
    pub(super) component: Component,
    /// Whether integers stand for fractions of the largest one.
    pub(super) is_normalized: bool,
    /// The numbers of an element.
    pub(super) width: usize,
    /// The elements of all points, the lowest byte of each number first.
    pub(super) bytes: Vec<u8>,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
}

impl Component {
    fn of(code: u8) -> Option<Component> {
        use Component::*;
        [I8, U8, I16, U16, I32, U32, I64, U64, F32, F64, Bool].get(usize::from(code).checked_sub(1)?).copied()
    }

    pub(super) fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 | Component::Bool => 1,
            Component::I16 | Component::U16 => 2,
            Component::I32 | Component::U32 | Component::F32 => 4,
            Component::I64 | Component::U64 | Component::F64 => 8,
        }
    }

    fn is_small_integer(self) -> bool {
        use Component::*;
        matches!(self, I8 | U8 | I16 | U16 | I32 | U32)
    }
}

/// The numbers that may still be made. Entropy coders have no bits for what is certain, so that few bytes can announce
/// any count.
struct Budget {
    left: usize,
}

/// The most numbers that a stream of so many bytes may have, at its corners and in its attributes. Meshes in use have
/// up to 60 for a byte. A plane of 2 million equal triangles has 540.
pub(super) fn most_numbers(bytes: usize) -> usize {
    const FREE: usize = 1 << 21;
    let dense = bytes.saturating_mul(1024).min(1 << 26);
    bytes.saturating_mul(128).max(dense).saturating_add(FREE)
}

impl Budget {
    /// Takes the corners of triangles, which have as many tables.
    fn triangles(&mut self, triangles: u32, tables: usize) -> Decoded<()> {
        // Corners and vertices are numbered by 32 bits.
        let corners = if triangles <= u32::MAX / 4 { 3 * triangles as usize } else { usize::MAX };
        self.take(corners, tables, "triangles")
    }

    /// Takes the elements of an attribute.
    fn numbers(&mut self, elements: usize, width: usize) -> Decoded<()> {
        self.take(elements, width, "numbers")
    }

    fn take(&mut self, count: usize, each: usize, what: &str) -> Decoded<()> {
        match count.checked_mul(each).and_then(|numbers| self.left.checked_sub(numbers)) {
            Some(left) => self.left = left,
            None => return Err(format!("they announce more {what} than they may").into()),
        }
        Ok(())
    }
}

/// Decodes a mesh of at most `most` numbers.
pub(super) fn decode(bytes: &[u8], most: usize) -> Result<Mesh, Reason> {
    let mut stream = Reader(bytes);
    let mut budget = Budget { left: most_numbers(bytes.len()).min(most) };
    match header(&mut stream)? {
        Method::Sequential => {
            let list = sequential::list(&mut stream, &mut budget)?;
            let attributes = attributes::attributes(&mut stream, &Domain::Points(list.points), &mut budget)?;
            Ok(Mesh { triangles: list.triangles, points: list.points, attributes })
        }
        Method::Edgebreaker => {
            let surface = edgebreaker::surface(&mut stream, &mut budget)?;
            let points = points::number(&surface)?;
            let domain = Domain::Surface(&surface, &points);
            let attributes = attributes::attributes(&mut stream, &domain, &mut budget)?;
            Ok(Mesh { triangles: points.of_corners.as_chunks().0.to_vec(), points: points.count, attributes })
        }
    }
}

enum Method {
    Sequential,
    Edgebreaker,
}

/// Reads what is before the triangles.
fn header(stream: &mut Reader) -> Decoded<Method> {
    const METADATA: u8 = 0x80;
    if stream.take(5)? != b"DRACO" {
        return Err("they don't begin with DRACO".into());
    }
    let version = [stream.byte()?, stream.byte()?];
    let (kind, method) = (stream.byte()?, stream.byte()?);
    let [_, flags] = [stream.byte()?, stream.byte()?];
    if kind != 1 {
        return Err("they are a cloud of points, not a mesh".into());
    }
    if version != [2, 2] {
        return Err(format!("they have version {}.{}, not 2.2", version[0], version[1]).into());
    }
    if flags & METADATA != 0 {
        skip_metadata(stream)?;
    }
    match method {
        0 => Ok(Method::Sequential),
        1 => Ok(Method::Edgebreaker),
        _ => Err(format!("their method {method} is unknown").into()),
    }
}

/// Skips the metadata of some attributes and of the mesh.
fn skip_metadata(stream: &mut Reader) -> Decoded<()> {
    for _ in 0..stream.number()? {
        stream.number()?;
        skip_metadata_tree(stream)?;
    }
    skip_metadata_tree(stream)
}

/// Skips named values, and below them named values of the same kind.
fn skip_metadata_tree(stream: &mut Reader) -> Decoded<()> {
    let mut left = 1u64;
    let mut has_name = false;
    while left > 0 {
        if has_name {
            skip_name(stream)?;
        }
        has_name = true;
        for _ in 0..stream.number()? {
            skip_name(stream)?;
            stream.block()?;
        }
        left += u64::from(stream.number()?);
        left -= 1;
    }
    Ok(())
}

fn skip_name(stream: &mut Reader) -> Decoded<()> {
    let length = stream.byte()?;
    stream.take(length.into())?;
    Ok(())
}
