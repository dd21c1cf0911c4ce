//! PNG (ISO/IEC 15948) in all its types; 16 bits stay 16 bits.

use super::{ImageError, judge, room};
use ::png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};
use canaletto::texture::{ColorSpace, Image, Samples};
use std::io::Cursor;

const FORMAT: &str = "PNG";

/// Reads a PNG. A gAMA chunk decides about the curve where there is no sRGB chunk; chromaticities and colour profiles
/// are ignored.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    header(bytes)?;
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 1 << 32 });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let info = reader.info();
    let (width, height) = (info.width, info.height);
    let gamma = match (info.srgb, info.gama_chunk.map(|g| g.into_scaled())) {
        (Some(_), _) | (_, None | Some(0)) => None,
        (_, Some(gamma)) => Some(gamma),
    };
    let interlaced = info.interlaced;
    let (color, depth) = reader.output_color_type();
    let channels = match color {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb | ColorType::Indexed => 3,
        ColorType::Rgba => 4,
    };
    let count = width as usize * height as usize * usize::from(channels);
    let samples = if depth == BitDepth::Sixteen {
        let mut data: Vec<u16> = room(count)?;
        let mut add = |row: &[u8]| data.extend(row.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])));
        if interlaced {
            let mut whole: Vec<u8> = room(2 * count)?;
            whole.resize(2 * count, 0);
            reader.next_frame(&mut whole).map_err(damaged)?;
            add(&whole);
        } else {
            // Row by row, so that the file's form never stands beside the image's.
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
        return Err(ImageError::Damaged { format: FORMAT, reason: "it has fewer rows than it announces".into() });
    }
    let mut image =
        Image { name: String::new(), width, height, channels, samples, space: ColorSpace::Srgb, premultiplied: false };
    match gamma {
        // 1/2.2 is how files of the sRGB curve say it.
        None | Some(44_000..=47_000) => {}
        Some(99_000..=101_000) => image.space = ColorSpace::Linear,
        Some(gamma) => straighten(&mut image, gamma),
    }
    Ok(image)
}

/// Judges the header by itself: the decoder's messages about sizes name no sizes.
fn header(bytes: &[u8]) -> Result<(), ImageError> {
    let number = |at: usize| bytes.get(at..at + 4).map(|b| u64::from(u32::from_be_bytes([b[0], b[1], b[2], b[3]])));
    if bytes.get(12..16) != Some(b"IHDR") {
        return Err(ImageError::Damaged { format: FORMAT, reason: "it doesn't start with its header".into() });
    }
    let (Some(width), Some(height)) = (number(16), number(20)) else {
        return Err(ImageError::Damaged { format: FORMAT, reason: "it ends in its header".into() });
    };
    let bits = match (bytes.get(24), bytes.get(25)) {
        (Some(depth), Some(2)) => 3 * u64::from(*depth),
        (Some(depth), Some(4)) => 2 * u64::from(*depth),
        (Some(depth), Some(6)) => 4 * u64::from(*depth),
        (Some(depth), Some(_)) => u64::from(*depth),
        _ => 0,
    };
    // Deflate makes at most 1032 bytes of one.
    judge(FORMAT, width, height, bytes.len() as u64 * 1032 * 8 / bits.max(1), bytes.len())
}

/// Turns numbers on a curve of the file's own (its exponent in 1/100000) into linear ones of 16 bits.
fn straighten(image: &mut Image, gamma: u32) {
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
    // The decoder goes on with its own state, which tells nobody anything.
    let text = error.to_string();
    let reason = text.split(" while decoding ").next().unwrap_or_default().to_owned();
    ImageError::Damaged { format: FORMAT, reason }
}
