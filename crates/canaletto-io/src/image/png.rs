//! Decoding of PNG (ISO/IEC 15948) in all its types; 16-bit samples stay 16 bits.

use super::{ImageError, ImageFormat, decoder, is_within_budget, judge, room, with_memory};
use crate::codec::is_png;
use ::png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Reader, Transformations};
use canaletto::texture::{ColorSpace, Image, Samples};
use std::io::{Cursor, Read};

const FORMAT: &str = "PNG";

/// Texts as pairs of key and value.
type TextList = Vec<(String, String)>;

/// The decoded content of a PNG.
pub(crate) struct Unpacked {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// The number of channels, 1 to 4: grey, grey and alpha, colour, colour and alpha.
    pub(crate) channels: u8,
    /// The samples, of 8 or 16 bits.
    pub(crate) samples: Samples,
    /// The number of bits of each sample in the file.
    pub(crate) bits: u8,
    /// Whether the file declares the sRGB curve.
    pub(crate) is_srgb: bool,
    /// The exponent of the declared gamma curve in 1/100000.
    pub(crate) gamma: Option<u32>,
    /// The texts with their keys.
    pub(crate) texts: TextList,
}

/// PNG in the table of images.
pub(super) const IMAGE: ImageFormat =
    ImageFormat { name: FORMAT, recognises: is_png, read: Ok(|bytes| Ok(with_memory(read(bytes)?))) };

/// Reads a PNG. A gAMA chunk determines the curve if there is no sRGB chunk; chromaticities and colour profiles are
/// ignored.
fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let Unpacked { width, height, channels, samples, is_srgb, gamma, .. } = unpack(bytes, false)?;
    let space = ColorSpace::Srgb;
    let mut image = Image { name: String::new(), width, height, channels, samples, space, premultiplied: false };
    match gamma.filter(|gamma| !is_srgb && *gamma > 0) {
        // Files on the sRGB curve declare 1/2.2.
        None | Some(44_000..=47_000) => {}
        Some(99_000..=101_000) => image.space = ColorSpace::Linear,
        Some(gamma) => linearise(&mut image, gamma),
    }
    Ok(image)
}

/// Decodes a PNG. An animated PNG yields its default image, which viewers without animation show.
pub(crate) fn unpack(bytes: &[u8], texts: bool) -> Result<Unpacked, ImageError> {
    header(bytes)?;
    let (strip_chunks, texts) = strip_chunks(bytes, texts)?;
    let needed = {
        let reader = decoder(FORMAT, || open(&strip_chunks))?;
        let (_, depth) = reader.output_color_type();
        let (info, size) = (reader.info(), if depth == BitDepth::Sixteen { 2 } else { 1 });
        u64::from(info.width) * u64::from(info.height) * channels(&reader) as u64 * size
    };
    if !is_within_budget(needed, bytes.len()) {
        // The rows are checked for completeness before memory is allocated for them.
        decoder(FORMAT, || {
            let mut reader = open(&strip_chunks)?;
            while reader.next_row().map_err(damaged)?.is_some() {}
            Ok(())
        })?;
    }
    decoder(FORMAT, || {
        let mut reader = open(&strip_chunks)?;
        let samples = samples(&mut reader)?;
        let info = reader.info();
        Ok(Unpacked {
            width: info.width,
            height: info.height,
            channels: channels(&reader) as u8,
            samples,
            bits: info.bit_depth as u8,
            is_srgb: info.srgb.is_some(),
            gamma: info.gama_chunk.map(|g| g.into_scaled()),
            texts,
        })
    })
}

fn open(bytes: &[u8]) -> Result<Reader<Cursor<&[u8]>>, ImageError> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 1 << 32 });
    decoder.set_transformations(Transformations::EXPAND);
    decoder.read_info().map_err(damaged)
}

fn channels(reader: &Reader<Cursor<&[u8]>>) -> usize {
    match reader.output_color_type().0 {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb | ColorType::Indexed => 3,
        ColorType::Rgba => 4,
    }
}

fn samples(reader: &mut Reader<Cursor<&[u8]>>) -> Result<Samples, ImageError> {
    let (info, depth) = (reader.info(), reader.output_color_type().1);
    let (count, interlaced) = (info.width as usize * info.height as usize * channels(reader), info.interlaced);
    let samples = if depth == BitDepth::Sixteen {
        let mut data: Vec<u16> = room(count)?;
        let mut add = |row: &[u8]| data.extend(row.as_chunks().0.iter().map(|two| u16::from_be_bytes(*two)));
        if interlaced {
            let mut whole: Vec<u8> = room(2 * count)?;
            whole.resize(2 * count, 0);
            reader.next_frame(&mut whole).map_err(damaged)?;
            add(&whole);
        } else {
            // Rows are converted one by one, so that only one form of the image is in memory.
            while let Some(row) = reader.next_row().map_err(damaged)? {
                add(row.data());
            }
        }
        Samples::U16(data)
    } else {
        let mut data: Vec<u8> = room(count)?;
        data.resize(count, 0);
        reader.next_frame(&mut data).map_err(damaged)?;
        Samples::U8(data)
    };
    if samples.len() != count {
        return Err(wrong("it has fewer rows than it announces"));
    }
    Ok(samples)
}

/// Checks the size in the header, since the decoder's messages about sizes don't contain them.
fn header(bytes: &[u8]) -> Result<(), ImageError> {
    let number = |at: usize| bytes.get(at..at + 4).map(|b| u64::from(u32::from_be_bytes([b[0], b[1], b[2], b[3]])));
    if bytes.get(12..16) != Some(b"IHDR") {
        return Err(wrong("it doesn't start with its header"));
    }
    let (Some(width), Some(height)) = (number(16), number(20)) else { return Err(wrong("it ends in its header")) };
    let bits = match (bytes.get(24), bytes.get(25)) {
        (Some(depth), Some(2)) => 3 * u64::from(*depth),
        (Some(depth), Some(4)) => 2 * u64::from(*depth),
        (Some(depth), Some(6)) => 4 * u64::from(*depth),
        (Some(depth), Some(_)) => u64::from(*depth),
        _ => 0,
    };
    judge(FORMAT, width, height, bytes.len() as u64 * super::DENSEST * 8 / bits.max(1), bytes.len())
}

/// The size that the header of a PNG declares.
pub(crate) fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let number = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
    if bytes.get(12..16) == Some(b"IHDR") { Some([number(16)?, number(20)?]) } else { None }
}

/// The file reduced to the chunks that are used, and its texts. The decoder (`png` 0.18) would unpack colour profiles
/// and compressed texts of any size without a request. It panics for palettes whose length isn't a multiple of three
/// (`transform/palette.rs`).
fn strip_chunks(bytes: &[u8], with_texts: bool) -> Result<(Vec<u8>, TextList), ImageError> {
    /// The end of the signature, where the header starts.
    const START: usize = 8;
    let mut strip_chunks: Vec<u8> = room(bytes.len())?;
    strip_chunks.extend_from_slice(&bytes[..START]);
    let mut texts = Texts { all: Vec::new(), left: TEXTS };
    let indexed = bytes.get(25) == Some(&3);
    let mut at = START;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let end = (at + length).saturating_add(12).min(bytes.len());
        let keep = match &head[4..8] {
            b"PLTE" if indexed && !(length.is_multiple_of(3) && (3..=768).contains(&length)) => {
                let reason = format!("its palette has {length} bytes; 1 to 256 colours of three each are expected");
                return Err(wrong(reason));
            }
            b"PLTE" => indexed,
            b"tRNS" | b"sRGB" | b"gAMA" => true,
            b"tEXt" | b"zTXt" | b"iTXt" => {
                if let Some(data) = bytes.get(at + 8..at + 8 + length).filter(|_| with_texts) {
                    texts.add(head[4], data);
                }
                false
            }
            // The names of ancillary chunks start with a lower-case letter.
            name => !name[0].is_ascii_lowercase(),
        };
        if keep {
            strip_chunks.extend_from_slice(&bytes[at..end]);
        }
        if &head[4..8] == b"IEND" {
            break;
        }
        at = end;
    }
    Ok((strip_chunks, texts.all))
}

/// The largest total size of decompressed texts in bytes; the excess is left out.
const TEXTS: u64 = 1 << 20;

struct Texts {
    all: TextList,
    /// The bytes that are left for compressed texts.
    left: u64,
}

impl Texts {
    /// Adds the text of a chunk `tEXt`, `zTXt` or `iTXt`. `kind` is the first letter of its name (the standard's
    /// 11.3.3).
    fn add(&mut self, kind: u8, data: &[u8]) -> Option<()> {
        let latin = |bytes: &[u8]| bytes.iter().map(|b| char::from(*b)).collect::<String>();
        let cut = |data: &'_ [u8]| data.iter().position(|b| *b == 0);
        let end = cut(data)?;
        let (key, mut rest) = (latin(&data[..end]), &data[end + 1..]);
        let text = match kind {
            b't' => latin(rest),
            b'z' => latin(&self.unpacked(rest.get(1..)?)?),
            _ => {
                let &[packed, _, ref names @ ..] = rest else { return None };
                rest = names;
                // The language and the translated key are skipped.
                for _ in 0..2 {
                    rest = &rest[cut(rest)? + 1..];
                }
                String::from_utf8(if packed == 0 { rest.to_vec() } else { self.unpacked(rest)? }).ok()?
            }
        };
        self.all.push((key, text));
        Some(())
    }

    fn unpacked(&mut self, data: &[u8]) -> Option<Vec<u8>> {
        let mut text = Vec::new();
        flate2::read::ZlibDecoder::new(data).take(self.left + 1).read_to_end(&mut text).ok()?;
        self.left = self.left.checked_sub(text.len() as u64)?;
        Some(text)
    }
}

/// Converts samples on a gamma curve (its exponent in 1/100000) to linear samples of 16 bits.
fn linearise(image: &mut Image, gamma: u32) {
    let exponent = 100_000.0 / f64::from(gamma);
    let level = |v: f64| (libm::pow(v, exponent) * 65535.0).round() as u16;
    let plain = |v: f64| (v * 65535.0).round() as u16;
    let channels = usize::from(image.channels);
    let is_alpha = |i: usize| channels.is_multiple_of(2) && i % channels == channels - 1;
    let data: Vec<u16> = match &image.samples {
        Samples::U8(data) => {
            let table: Vec<u16> = (0..=255u8).map(|v| level(f64::from(v) / 255.0)).collect();
            let each = data.iter().enumerate();
            each.map(|(i, v)| if is_alpha(i) { plain(f64::from(*v) / 255.0) } else { table[usize::from(*v)] }).collect()
        }
        Samples::U16(data) => {
            let table: Vec<u16> = (0..=65535u16).map(|v| level(f64::from(v) / 65535.0)).collect();
            data.iter().enumerate().map(|(i, v)| if is_alpha(i) { *v } else { table[usize::from(*v)] }).collect()
        }
        _ => return,
    };
    image.samples = Samples::U16(data);
    image.space = ColorSpace::Linear;
}

fn damaged(error: DecodingError) -> ImageError {
    // The decoder's message ends with its internal state, which is removed.
    let text = error.to_string();
    wrong(text.split(" while decoding ").next().unwrap_or_default())
}

fn wrong(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}
