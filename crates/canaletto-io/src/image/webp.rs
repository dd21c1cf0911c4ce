//! WebP, lossy and lossless, with or without alpha; of an animation the first picture.

use super::{ImageError, judge, room};
use canaletto::texture::{ColorSpace, Image, Samples};
use image_webp::{DecodingError, WebPDecoder};
use std::io::Cursor;

const FORMAT: &str = "WebP";

/// Reads a WebP picture. Colour profiles are ignored.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    // A picture of one colour takes next to no bytes, whatever its size; the format ends at 16383 × 16383.
    judge(FORMAT, width.into(), height.into(), u64::MAX, bytes.len())?;
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    let count = width as usize * height as usize * usize::from(channels);
    decoder.set_memory_limit(count.saturating_mul(2).max(1 << 20));
    let mut data: Vec<u8> = room(count)?;
    data.resize(count, 0);
    decoder.read_image(&mut data).map_err(damaged)?;
    let samples = Samples::U8(data);
    Ok(Image { name: String::new(), width, height, channels, samples, space: ColorSpace::Srgb, premultiplied: false })
}

fn damaged(error: DecodingError) -> ImageError {
    match error {
        DecodingError::UnsupportedFeature(what) => ImageError::Unsupported { format: FORMAT, what },
        other => ImageError::Damaged { format: FORMAT, reason: other.to_string() },
    }
}
