//! JPEG (ITU-T T.81): written as baseline with full colour resolution, and read. Texts are an XMP packet.

use super::format::{Capabilities, EncodeSettings, Encoder, FormatInfo, Texts};
use super::levels::Levels;
use super::texture;
use super::{Decoded, PictureError, xmp};
use crate::codec::is_jpeg;
use canaletto::scene::Transfer;
use jpeg_encoder::{ColorType, SamplingFactor};

const NAME: &str = "JPEG";

/// JPEG in the table of picture formats.
pub(super) const FORMAT: FormatInfo = FormatInfo {
    names: [NAME; 2],
    extension: "jpg",
    recognises: is_jpeg,
    decode,
    size: Some(size),
    encoder: Some(Encoder {
        capabilities: Capabilities {
            summary: "Developed for display, 8 bits, lossy, without alpha",
            bits: &[8],
            linear: false,
            alpha: false,
            layers: false,
            texts: true,
            compression: false,
            lossy: true,
            whole_ids: false,
        },
        encode: |rendered, settings, texts, goes_on| {
            encode(&Levels::developed(rendered, false, goes_on)?, settings, texts)
        },
        encode_image: |image, _: Transfer, settings, texts| {
            encode(&Levels::of_image(image, false, NAME)?, settings, texts)
        },
        stored_bits: |_, _| 8,
        write_rows: None,
    }),
    off: None,
};

/// The application segment of an XMP packet, and what begins it (ISO 16684-3).
const SEGMENT: u8 = 1;
const SIGNATURE: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";

fn encode(levels: &Levels, settings: &EncodeSettings, texts: &Texts) -> Result<Vec<u8>, PictureError> {
    let unfit = |why: String| PictureError::Unfit(format!("JPEG {why}"));
    let [width, height] = levels.size;
    let [Ok(width), Ok(height)] = [width, height].map(u16::try_from) else {
        return Err(unfit(format!("has at most 65535 pixels on each side, not {width} x {height}")));
    };
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, settings.quality());
    encoder.set_sampling_factor(SamplingFactor::F_1_1);
    encoder.set_optimized_huffman_tables(true);
    if !texts.is_empty() {
        let packet = [SIGNATURE, xmp::packet(texts).as_bytes()].concat();
        encoder
            .add_app_segment(SEGMENT, packet)
            .map_err(|_| unfit("has no room for texts of over 65,000 bytes".into()))?;
    }
    let color = if levels.channels == 1 { ColorType::Luma } else { ColorType::Rgb };
    encoder.encode(&levels.data, width, height, color).map_err(|error| unfit(format!("can't be encoded: {error}")))?;
    Ok(bytes)
}

fn decode(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let packet = segments(bytes).find_map(|(code, segment)| match code {
        0xe1 => segment.strip_prefix(SIGNATURE),
        _ => None,
    });
    Ok(Decoded { metadata: packet.map(xmp::texts).unwrap_or_default(), ..texture::decode(bytes)? })
}

/// The width and height that the frame header declares (T.81, B.2.2).
fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let frame = segments(bytes).find(|(code, _)| matches!(code, 0xc0..=0xc2))?.1;
    let number = |at: usize| Some(u32::from(u16::from_be_bytes([*frame.get(at)?, *frame.get(at + 1)?])));
    Some([number(3)?, number(1)?])
}

/// The segments before the first scan, with their markers' codes.
fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = bytes.get(2..).unwrap_or_default();
    std::iter::from_fn(move || {
        let [0xff, code, high, low, ..] = *rest else { return None };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let segment = rest.get(4..2 + length).filter(|_| code != 0xda)?;
        rest = &rest[2 + length..];
        Some((code, segment))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{Image, PictureFormat, decode};

    fn waves() -> Image {
        let pixel = |i: u32| {
            let [x, y] = [(i % 48) as f32 / 48.0, (i / 48) as f32 / 32.0];
            [x, y, 0.5 + 0.5 * libm::sinf(9.0 * x * y)]
        };
        Image::from_rgb(48, 32, (0..48 * 32).map(pixel))
    }

    fn worst(bytes: &[u8]) -> f32 {
        let (read, waves) = (decode(bytes).unwrap(), waves());
        let channels = read.image.channels.iter().zip(&waves.channels);
        let errors = channels.flat_map(|(a, b)| a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()));
        errors.fold(0.0, f32::max)
    }

    fn encoded(quality: Option<u8>, texts: &Texts) -> Vec<u8> {
        let settings = EncodeSettings { quality, ..EncodeSettings::default() };
        PictureFormat::Jpeg.encode_image(&waves(), Transfer::Srgb, &settings, texts).unwrap()
    }

    /// A better quality is larger and nearer to the picture.
    #[test]
    fn quality_is_size_and_error() {
        let all = [Some(40), None, Some(100)].map(|quality| encoded(quality, &[]));
        let [low, usual, best] = [0, 1, 2].map(|i| worst(&all[i]));
        assert!(all[0].len() < all[1].len() && all[1].len() < all[2].len());
        assert!(best < 0.02 && best < usual && usual < 0.05 && usual < low, "{low} {usual} {best}");
        assert_eq!(all[1], encoded(None, &[]));
    }

    #[test]
    fn headers_and_texts_are_read() {
        let texts = [("scene".to_owned(), "a & b.glb".to_owned())];
        let bytes = encoded(None, &texts);
        assert_eq!(size(&bytes), Some([48, 32]));
        assert_eq!(decode(&bytes).unwrap().metadata, texts);
        for length in 0..bytes.len().min(900) {
            _ = (size(&bytes[..length]), super::decode(&bytes[..length]));
        }
        let long = [("set".to_owned(), "x".repeat(70_000))];
        let error = encode(&Levels::of_image(&waves(), false, NAME).unwrap(), &EncodeSettings::default(), &long);
        assert!(error.unwrap_err().to_string().contains("65,000 bytes"));
    }
}
