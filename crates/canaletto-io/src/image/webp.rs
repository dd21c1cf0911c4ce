//! WebP (RFC 9649), lossy and lossless, with or without alpha. Of an animation only the first picture is read.

use super::{DENSEST, ImageError, ImageFormat, decoder, judge, zeros};
use crate::codec::is_webp;
use canaletto::texture::{ColorSpace, Image, Samples};
use image_webp::{DecodingError, WebPDecoder};
use std::io::Cursor;

const FORMAT: &str = "WebP";

/// The number of texels that any file may have. A picture of one colour takes almost no bytes at any size.
const SMALL: u64 = 1 << 24;

/// The largest memory of the decoder per texel in bytes: four in its own form, and four in the result.
const TEXEL: u64 = 8;

/// WebP in the table of images.
pub(super) const IMAGE: ImageFormat = ImageFormat { name: FORMAT, recognises: is_webp, read: Ok(read) };

/// Reads a WebP picture; returns it with the peak memory in bytes. Colour profiles are ignored.
fn read(bytes: &[u8]) -> Result<(Image, u64), ImageError> {
    // The decoder allocates memory for the pictures in a file before it compares their sizes with the file's size.
    judge_chunks(bytes, 12, 0)?;
    decoder(FORMAT, || {
        let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        size(width, height, bytes.len())?;
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        let count = width as usize * height as usize * usize::from(channels);
        decoder.set_memory_limit(count.saturating_mul(2).max(1 << 20));
        let mut data = zeros(count)?;
        decoder.read_image(&mut data).map_err(damaged)?;
        let (name, samples, space) = (String::new(), Samples::U8(data), ColorSpace::Srgb);
        let memory = TEXEL * u64::from(width) * u64::from(height);
        Ok((Image { name, width, height, channels, samples, space, premultiplied: false }, memory))
    })
}

/// Checks the sizes of the pictures in a file's chunks, and in the chunks of its animation frames.
fn judge_chunks(bytes: &[u8], start: usize, depth: u32) -> Result<(), ImageError> {
    let mut at = start;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
        let data = &bytes[at + 8..];
        if length > data.len() {
            return Err(wrong("it ends too early"));
        }
        let two = |at: usize| data.get(at..at + 2).map_or(0, |b| u32::from(u16::from_le_bytes([b[0], b[1]])));
        let three = |at: usize| two(at) | u32::from(data.get(at + 2).copied().unwrap_or(0)) << 16;
        let found = match &head[..4] {
            b"VP8 " if length >= 10 => Some([two(6) & 0x3fff, two(8) & 0x3fff]),
            b"VP8L" if length >= 5 => {
                let packed = two(1) | two(3) << 16;
                Some([(packed & 0x3fff) + 1, (packed >> 14 & 0x3fff) + 1])
            }
            b"VP8X" if length >= 10 => Some([three(4) + 1, three(7) + 1]),
            b"ANMF" if length >= 16 && depth == 0 => {
                judge_chunks(&bytes[..at + 8 + length], at + 8 + 16, 1)?;
                Some([three(6) + 1, three(9) + 1])
            }
            b"VP8 " | b"VP8L" | b"VP8X" => return Err(wrong("it ends in its header")),
            _ => None,
        };
        if let Some([width, height]) = found {
            size(width, height, bytes.len())?;
        }
        // Chunks begin at even offsets.
        at += 8 + length + length % 2;
    }
    Ok(())
}

fn size(width: u32, height: u32, bytes: usize) -> Result<(), ImageError> {
    let (width, height) = (width.into(), height.into());
    judge(FORMAT, width, height, SMALL + bytes as u64 * DENSEST / TEXEL, bytes).map_err(|error| match error {
        // A picture of one colour may have almost no bytes.
        ImageError::ExceedsFile { .. } => {
            ImageError::TooDense { format: FORMAT, width, height, bytes, memory: TEXEL * width * height }
        }
        other => other,
    })
}

fn damaged(error: DecodingError) -> ImageError {
    match error {
        DecodingError::UnsupportedFeature(what) => ImageError::Unsupported { format: FORMAT, what },
        other => wrong(other.to_string()),
    }
}

fn wrong(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}
