//! WebP: written without losses (VP8L) and with alpha, and read. Texts are an XMP packet.

use super::format::{Capabilities, Encoder, FormatInfo, Texts};
use super::levels::Levels;
use super::texture;
use super::{Decoded, PictureError, xmp};
use crate::codec::is_webp;
use image_webp::{ColorType, WebPDecoder, WebPEncoder};
use std::io::Cursor;

const NAME: &str = "WebP";

/// WebP in the table of picture formats.
pub(super) const FORMAT: FormatInfo = FormatInfo {
    names: [NAME; 2],
    extension: "webp",
    recognises: is_webp,
    decode,
    size: Some(size),
    encoder: Some(Encoder {
        capabilities: Capabilities {
            summary: "Developed for display, 8 bits, without losses",
            bits: &[8],
            linear: false,
            alpha: true,
            layers: false,
            texts: true,
            compression: false,
            lossy: false,
            whole_ids: false,
        },
        encode: |rendered, _, texts, goes_on| encode(&Levels::developed(rendered, true, goes_on)?, texts),
        encode_image: |image, _, _, texts| encode(&Levels::of_image(image, true, NAME)?, texts),
        stored_bits: |_, _| 8,
        write_rows: None,
    }),
    off: None,
};

/// The most pixels of a side.
const MOST: u32 = 1 << 14;

fn encode(levels: &Levels, texts: &Texts) -> Result<Vec<u8>, PictureError> {
    let unfit = |why: String| PictureError::Unfit(format!("WebP {why}"));
    let [width, height] = levels.size;
    if width > MOST || height > MOST {
        return Err(unfit(format!("has at most {MOST} pixels on each side, not {width} x {height}")));
    }
    let color = match levels.channels {
        1 => ColorType::L8,
        4 => ColorType::Rgba8,
        _ => ColorType::Rgb8,
    };
    let mut bytes = Vec::new();
    let mut encoder = WebPEncoder::new(&mut bytes);
    if !texts.is_empty() {
        encoder.set_xmp_metadata(xmp::packet(texts).into_bytes());
    }
    let encoded = encoder.encode(&levels.data, width, height, color);
    encoded.map_err(|error| unfit(format!("can't be encoded: {error}")))?;
    Ok(bytes)
}

fn decode(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let decoded = texture::decode(bytes)?;
    let packet = WebPDecoder::new(Cursor::new(bytes)).ok().and_then(|mut decoder| decoder.xmp_metadata().ok()?);
    Ok(Decoded { metadata: packet.map(|packet| xmp::texts(&packet)).unwrap_or_default(), ..decoded })
}

fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let (width, height) = WebPDecoder::new(Cursor::new(bytes)).ok()?.dimensions();
    Some([width, height])
}
