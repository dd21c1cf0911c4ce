//! Compressed buffer views: EXT_meshopt_compression and KHR_meshopt_compression.
//!
//! A stream has one of three modes: [`attributes`], [`triangles`] and [`indices`]. [`filters`] change decoded
//! attributes in their place. Streams tell neither their length nor their count. Each must end just where its tail
//! begins.

mod attributes;
mod filters;
mod indices;
#[cfg(test)]
mod tests;
mod triangles;

use super::fault::Fault;
use super::schema::{CompressedView, CompressionFilter, CompressionMode};

/// The most bytes that a byte of a stream can decode to. A block of 256 elements without differences takes a byte for
/// each 4 of an element.
pub(super) const MOST_PER_BYTE: usize = 1024;

/// What is wrong with a stream.
type Decoded<T> = Result<T, &'static str>;

const CUT_OFF: &str = "they end too early";
const LEFT_OVER: &str = "some are left over";

/// The decoded bytes of a view, whose stream is `bytes`.
pub(super) fn decode(view: &CompressedView, bytes: &[u8]) -> Result<Vec<u8>, Fault> {
    check(view)?;
    let decode = match view.mode {
        CompressionMode::Attributes => attributes::decode,
        CompressionMode::Triangles => triangles::decode,
        CompressionMode::Indices => indices::decode,
    };
    let mut decoded = decode(bytes, view.count, view.byte_stride).map_err(|why| {
        Fault::new(format!("its {} compressed bytes can't be decoded: {why}", bytes.len()))
            .help("the file may be damaged")
    })?;
    filters::apply(view.filter, view.byte_stride, &mut decoded);
    Ok(decoded)
}

/// Checks the numbers of a view against its mode and its filter.
fn check(view: &CompressedView) -> Result<(), Fault> {
    let stride = view.byte_stride;
    let (fits, strides) = match (view.mode, view.filter) {
        (CompressionMode::Triangles | CompressionMode::Indices, CompressionFilter::None) => {
            (matches!(stride, 2 | 4), "2 or 4")
        }
        (CompressionMode::Triangles | CompressionMode::Indices, _) => {
            return Err(Fault::new("only the mode ATTRIBUTES has filters").at("/filter"));
        }
        (CompressionMode::Attributes, CompressionFilter::Octahedral | CompressionFilter::Color) => {
            (matches!(stride, 4 | 8), "4 or 8")
        }
        (CompressionMode::Attributes, CompressionFilter::Quaternion) => (stride == 8, "8"),
        (CompressionMode::Attributes, CompressionFilter::None | CompressionFilter::Exponential) => {
            ((4..=256).contains(&stride) && stride.is_multiple_of(4), "a multiple of 4 from 4 to 256")
        }
    };
    if !fits {
        let message = format!("is {stride}; with its mode and filter it must be {strides}");
        return Err(Fault::new(message).at("/byteStride"));
    }
    if view.count == 0 {
        return Err(Fault::new("is 0; a view has at least one element").at("/count"));
    }
    if view.mode == CompressionMode::Triangles && !view.count.is_multiple_of(3) {
        return Err(Fault::new(format!("is {}; triangles have 3 indices each", view.count)).at("/count"));
    }
    Ok(())
}

/// The bytes of a stream that aren't read yet.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Decoded<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(taken)
    }

    /// The last `count` bytes, which are cut away.
    fn take_back(&mut self, count: usize) -> Decoded<&'a [u8]> {
        let data = self.0.len().checked_sub(count).ok_or(CUT_OFF)?;
        let (rest, taken) = self.0.split_at(data);
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Decoded<u8> {
        let (&byte, rest) = self.0.split_first().ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(byte)
    }

    /// A number in at most 5 bytes of 7 bits, the lowest first. The highest bit of all bytes but the last is set.
    fn number(&mut self) -> Decoded<u32> {
        let mut number = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err("a number has more than 5 bytes")
    }

    fn end(&self) -> Decoded<()> {
        if self.0.is_empty() { Ok(()) } else { Err(LEFT_OVER) }
    }
}

/// A difference whose sign is its lowest bit.
fn difference(zigzag: u32) -> u32 {
    zigzag >> 1 ^ (zigzag & 1).wrapping_neg()
}

/// Adds an index of 2 or 4 bytes.
fn push_index(bytes: &mut Vec<u8>, index: u32, stride: usize) {
    bytes.extend_from_slice(&index.to_le_bytes()[..stride]);
}
