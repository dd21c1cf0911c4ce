//! PNG (ISO/IEC 15948): written with 8 or 16 bits and texts, read in all its types.

mod bands;

use super::format::{Capabilities, Compression, EncodeSettings, Encoder as PictureEncoder, FormatInfo};
use super::levels::level;
use super::texture::named;
use super::{Decoded, Image, PictureError, SOFTWARE, Window, check, no_pixels};
use crate::codec::is_png;
use crate::image::png::{Unpacked, size, unpack};
use ::png::chunk::IDAT;
use ::png::{BitDepth, ColorType, Encoder, ScaledFloat, SrgbRenderingIntent};
use bands::Shape;
use canaletto::film::{Developer, Picture};
use canaletto::math::Rgb;
use canaletto::scene::{Developing, Transfer};
use std::fmt::Display;
use std::io::Write;
use std::ops::Range;

/// PNG in the table of picture formats.
pub(super) const FORMAT: FormatInfo = FormatInfo {
    names: ["PNG", "PNG"],
    extension: "png",
    recognises: is_png,
    decode: decode_png,
    size: Some(size),
    encoder: Some(PictureEncoder {
        capabilities: Capabilities {
            summary: "Developed for display, 8 or 16 bits",
            bits: &[8, 16],
            linear: false,
            alpha: true,
            layers: false,
            texts: true,
            compression: true,
            lossy: false,
            whole_ids: false,
        },
        encode: |rendered, settings, texts, goes_on| {
            develop_png(rendered.picture, &rendered.developing, PngSettings::from(settings), texts, goes_on)
        },
        encode_image: |image, transfer, settings, texts| {
            encode_png(image, PngSettings::from(settings), transfer, texts)
        },
        stored_bits: |settings, _| PngSettings::from(settings).depth.bits(),
        write_rows: None,
    }),
    off: None,
};

/// The number of bits of each value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Depth {
    /// Values from 0 to 255.
    #[default]
    Eight,
    /// Values from 0 to 65535.
    Sixteen,
}

impl Depth {
    /// The number of bits.
    fn bits(self) -> u8 {
        match self {
            Depth::Eight => 8,
            Depth::Sixteen => 16,
        }
    }

    fn bytes(self) -> usize {
        usize::from(self.bits() / 8)
    }

    /// Writes values as bytes.
    fn put(self, values: &[f32], bytes: &mut [u8]) {
        match self {
            Depth::Eight => bytes.iter_mut().zip(values).for_each(|(byte, &v)| *byte = level(v, 255.0) as u8),
            Depth::Sixteen => {
                for (two, &v) in bytes.as_chunks_mut().0.iter_mut().zip(values) {
                    *two = (level(v, 65535.0) as u16).to_be_bytes();
                }
            }
        }
    }
}

impl Compression {
    /// The deflate level.
    fn level(self) -> u32 {
        match self {
            Compression::Fast => 1,
            Compression::Default => 6,
            Compression::Best => 9,
        }
    }
}

/// Options of writing a PNG. A [`Depth`] converts into them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct PngSettings {
    /// The number of bits of each value.
    depth: Depth,
    /// The effort of compression.
    compression: Compression,
}

impl From<&EncodeSettings> for PngSettings {
    fn from(settings: &EncodeSettings) -> PngSettings {
        let depth = if settings.bits == Some(16) { Depth::Sixteen } else { Depth::Eight };
        PngSettings { depth, compression: settings.compression }
    }
}

impl From<Depth> for PngSettings {
    fn from(depth: Depth) -> PngSettings {
        PngSettings { depth, compression: Compression::Default }
    }
}

/// The bytes of a PNG of the channels R G B, or Y, with A if there is one; other channels are left out. Values are
/// display values: they are clamped to 0 to 1 and rounded to the nearest level. `transfer` only declares the encoding
/// of the values: sRGB is recorded in the file (chunks sRGB and gAMA), other encodings are not. `metadata` becomes
/// texts.
///
/// # Errors
/// [`PictureError::Unfit`] if there is no colour, or a key isn't 1 to 79 Latin letters.
fn encode_png(
    image: &Image,
    settings: impl Into<PngSettings>,
    transfer: Transfer,
    metadata: &[(String, String)],
) -> Result<Vec<u8>, PictureError> {
    check(image)?;
    let mut channels: Vec<&[f32]> = match (image.rgb(), image.channel("R")) {
        (Some(rgb), Some(_)) => rgb.to_vec(),
        (Some([y, ..]), None) => vec![y],
        (None, _) => return Err(PictureError::Unfit("PNG needs the channels R G B, or Y".into())),
    };
    channels.extend(image.channel("A"));
    let count = channels.len();
    encode([image.width, image.height], count, settings.into(), transfer, metadata, |range, values| {
        for (index, channel) in channels.iter().enumerate() {
            for (value, &v) in values[index..].iter_mut().step_by(count).zip(&channel[range.clone()]) {
                *value = v;
            }
        }
    })
}

/// The bytes of a PNG of a picture in linear light, developed while `goes_on` returns true.
/// The rest of the picture is black. `metadata` becomes texts. With alpha, colours are divided by it before they are
/// developed, as PNG asks. Alpha is that of display values ([`Developer::with_alpha`]).
///
/// # Errors
/// [`PictureError::Unfit`] if there is no pixel, or a key isn't 1 to 79 Latin letters.
fn develop_png(
    picture: &Picture,
    developing: &Developing,
    settings: impl Into<PngSettings>,
    metadata: &[(String, String)],
    goes_on: impl Fn() -> bool + Sync,
) -> Result<Vec<u8>, PictureError> {
    if picture.pixels.is_empty() {
        return Err(no_pixels());
    }
    let developer = Developer::new(picture, developing);
    if !picture.alpha.is_empty() {
        let size = [picture.width, picture.height];
        return encode(size, 4, settings.into(), developing.transfer, metadata, |range, values| {
            if !goes_on() {
                return values.fill(0.0);
            }
            for (value, pixel) in values.as_chunks_mut().0.iter_mut().zip(range) {
                let (Rgb { r, g, b }, alpha) = developer.with_alpha(picture, pixel);
                *value = [r, g, b, alpha];
            }
        });
    }
    encode([picture.width, picture.height], 3, settings.into(), developing.transfer, metadata, |range, values| {
        if !goes_on() {
            return values.fill(0.0);
        }
        let (values, _) = values.as_chunks_mut();
        for (value, color) in values.iter_mut().zip(&picture.pixels[range]) {
            *value = color.to_array();
        }
        developer.develop(values);
    })
}

/// A PNG whose values `fill` writes, for a range of pixels.
fn encode(
    [width, height]: [u32; 2],
    channels: usize,
    PngSettings { depth, compression }: PngSettings,
    transfer: Transfer,
    metadata: &[(String, String)],
    fill: impl Fn(Range<usize>, &mut [f32]) + Sync,
) -> Result<Vec<u8>, PictureError> {
    let color = [ColorType::Grayscale, ColorType::GrayscaleAlpha, ColorType::Rgb, ColorType::Rgba][channels - 1];
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, width, height);
    encoder.set_color(color);
    encoder.set_depth(if depth == Depth::Eight { BitDepth::Eight } else { BitDepth::Sixteen });
    if transfer == Transfer::Srgb {
        encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
        encoder.set_source_gamma(ScaledFloat::from_scaled(45_455));
    }
    png_texts(&mut encoder, metadata)?;
    let mut writer = encoder.write_header().map_err(unfit)?;
    let bytes = |range: Range<usize>, bytes: &mut [u8]| {
        /// The number of values that fit in the first-level cache.
        const FEW: usize = 1 << 10;
        let mut values = [0.0; FEW];
        let (few, pixel) = (FEW / channels, channels * depth.bytes());
        for (start, bytes) in range.clone().step_by(few).zip(bytes.chunks_mut(few * pixel)) {
            let part = start..range.end.min(start + few);
            let values = &mut values[..part.len() * channels];
            fill(part, values);
            depth.put(values, bytes);
        }
    };
    let shape = Shape { width: width as usize, height: height as usize, pixel: channels * depth.bytes() };
    for part in bands::compressed(shape, compression, bytes).map_err(unfit)? {
        writer.write_chunk(IDAT, &part).map_err(unfit)?;
    }
    writer.finish().map_err(unfit)?;
    Ok(out)
}

fn unfit(reason: impl Display) -> PictureError {
    PictureError::Unfit(format!("PNG can't hold it: {reason}"))
}

/// Adds texts to a PNG: the program's name and `metadata`.
pub(crate) fn png_texts<W: Write>(
    encoder: &mut Encoder<'_, W>,
    metadata: &[(String, String)],
) -> Result<(), PictureError> {
    let software = ("Software".to_owned(), SOFTWARE.to_owned());
    for (key, text) in std::iter::once(&software).chain(metadata) {
        let latin = text.chars().all(|c| matches!(c, '\n' | ' '..='~' | '\u{a1}'..='\u{ff}'));
        let add = if latin { Encoder::add_text_chunk } else { Encoder::add_itxt_chunk };
        if key.is_empty() || key.chars().count() > 79 {
            return Err(PictureError::Unfit(format!("\"{key}\" can't be a PNG's text key: it needs 1 to 79 letters")));
        }
        add(encoder, key.clone(), text.clone()).map_err(unfit)?;
    }
    Ok(())
}

/// Reads a PNG. Stored values are divided by the largest one; palettes are resolved.
///
/// # Errors
/// [`PictureError`] if the file can't be read.
fn decode_png(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let Unpacked { width, height, channels, samples, bits, is_srgb, gamma, texts } = unpack(bytes, true)?;
    let transfer = match (is_srgb, gamma) {
        (true, _) | (false, Some(45_000..=46_000)) => Some(Transfer::Srgb),
        (false, Some(100_000)) => Some(Transfer::None),
        _ => None,
    };
    let image = Image { width, height, channels: named(channels, &samples) };
    check(&image)?;
    let window = Window::whole(image.width, image.height);
    Ok(Decoded {
        image,
        bits,
        transfer,
        metadata: texts,
        window,
        left_out: Vec::new(),
        is_changed: false,
        display_referred: true,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::ImageError;
    use crate::picture::Channel;
    use canaletto::film::develop;
    use canaletto::scene::Tone;
    use std::io::Read;

    fn ramp() -> Image {
        Image::from_rgb(16, 16, (0..256).map(|i| [i as f32 / 255.0, 1.0 - i as f32 / 255.0, 0.5]))
    }

    #[test]
    fn levels_and_texts_come_back() {
        let texts = vec![("seed".to_owned(), "7".to_owned()), ("Title".to_owned(), "Veneza à noite → 水".to_owned())];
        for (depth, bits, step) in [(Depth::Eight, 8, 0.5 / 255.0), (Depth::Sixteen, 16, 0.5 / 65535.0)] {
            let bytes = encode_png(&ramp(), depth, Transfer::Srgb, &texts).unwrap();
            assert_eq!(bytes, encode_png(&ramp(), depth, Transfer::Srgb, &texts).unwrap());
            let read = decode_png(&bytes).unwrap();
            assert_eq!((read.bits, read.transfer), (bits, Some(Transfer::Srgb)));
            for (a, b) in read.image.channels.iter().zip(&ramp().channels) {
                assert!(a.name == b.name && a.data.iter().zip(&b.data).all(|(a, b)| (a - b).abs() <= step + 1e-7));
            }
            assert!(read.metadata.iter().any(|(k, v)| k == "Software" && v.starts_with("Canaletto 0.")));
            assert!(texts.iter().all(|text| read.metadata.contains(text)));
        }
    }

    /// A picture of several bands, with noise and constant parts, so that all filters are used.
    fn picture() -> Picture {
        let (width, height) = (601, 803);
        let value = |i: usize, c: usize| match i / width / 160 {
            0 => 0.25,
            1 => (i % width) as f32 / 600.0,
            2 => (i / width) as f32 / 803.0 * (c as f32 + 1.0),
            3 => (i.wrapping_mul(2_654_435_761).wrapping_add(c * 77_777) >> 7 & 0xff) as f32 / 255.0,
            _ => ((i % width + i / width) % 256) as f32 / 255.0,
        };
        let mut picture = Picture::new(width as u32, height);
        for (i, color) in picture.pixels.iter_mut().enumerate() {
            *color = [0, 1, 2].map(|c| value(i, c)).into();
        }
        picture
    }

    #[test]
    fn bands_are_one_picture_whatever_the_threads() {
        let (picture, texts) = (picture(), vec![("seed".to_owned(), "7".to_owned())]);
        for (depth, tone) in [(Depth::Eight, Tone::Clamp), (Depth::Sixteen, Tone::Scale)] {
            let film = Developing { tone, ..Developing::default() };
            let shown = develop(&picture, &film);
            let image = Image::from_rgb(picture.width, picture.height, shown.iter().map(|c| c.to_array()));
            let [one, many] = [1, 5].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| develop_png(&picture, &film, depth, &texts, || true).unwrap())
            });
            assert!(one == many && one == encode_png(&image, depth, film.transfer, &texts).unwrap());
            assert!(one.windows(4).filter(|w| w == b"IDAT").count() > 3);
            let most = if depth == Depth::Eight { 255.0 } else { 65535.0 };
            for (a, b) in decode_png(&one).unwrap().image.channels.iter().zip(&image.channels) {
                assert!(a.data.iter().zip(&b.data).all(|(a, b)| a * most == level(*b, most) as f32));
            }
        }
        assert!(develop_png(&Picture::new(0, 3), &Developing::default(), Depth::Eight, &[], || true).is_err());
    }

    /// The data of the IDAT chunks.
    fn stream(png: &[u8]) -> Vec<u8> {
        let (mut at, mut stream) = (8, Vec::new());
        while let Some(head) = png.get(at..at + 8) {
            let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
            if &head[4..] == b"IDAT" {
                stream.extend(&png[at + 8..at + 8 + length]);
            }
            at += 12 + length;
        }
        stream
    }

    #[test]
    fn files_are_as_small_as_one_stream_of_their_rows() {
        let flat = Picture::new(1920, 1080);
        for (picture, fast) in [(picture(), 1.05), (flat, 1.05)] {
            let with = |compression| {
                let settings = PngSettings { depth: Depth::Eight, compression };
                stream(&develop_png(&picture, &Developing::default(), settings, &[], || true).unwrap())
            };
            let [small, default, large] = [Compression::Best, Compression::Default, Compression::Fast].map(with);
            let mut rows = Vec::new();
            flate2::read::ZlibDecoder::new(&default[..]).read_to_end(&mut rows).unwrap();
            assert_eq!(rows.len(), (3 * picture.width as usize + 1) * picture.height as usize);
            let mut whole = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(6));
            whole.write_all(&rows).unwrap();
            let whole = whole.finish().unwrap().len() as f64;
            assert!((default.len() as f64) < 1.03 * whole, "{} {whole}", default.len());
            assert!(small.len() <= default.len() && large.len() as f64 > fast * whole);
        }
    }

    #[test]
    fn the_nearest_level_is_taken() {
        for most in [255.0, 65535.0] {
            for step in 0..=2 * most as u32 {
                let v = step as f32 / (2.0 * most);
                for v in [v.next_down(), v, v.next_up()] {
                    assert_eq!(level(v, most) as f32, (v.clamp(0.0, 1.0) * most).round(), "{v}");
                }
            }
        }
        assert_eq!([level(f32::NAN, 255.0), level(-0.1, 255.0), level(9.0, 255.0)], [0, 0, 255]);
    }

    #[test]
    fn plain_values_carry_no_note() {
        let bytes = encode_png(&ramp(), Depth::Eight, Transfer::None, &[]).unwrap();
        assert!(!bytes.windows(4).any(|w| w == b"sRGB" || w == b"gAMA"));
        let bytes = encode_png(&ramp(), Depth::Eight, Transfer::Srgb, &[]).unwrap();
        assert!(bytes.windows(4).any(|w| w == b"sRGB") && bytes.windows(4).any(|w| w == b"gAMA"));
    }

    #[test]
    fn grey_alpha_and_odd_values() {
        let data = vec![f32::NAN, -3.0, 7.0, f32::INFINITY];
        let channels =
            vec![Channel::new("Y", data), Channel::new("A", vec![1.0; 4]), Channel::new("depth.Z", vec![9.0; 4])];
        let bytes = encode_png(&Image { width: 2, height: 2, channels }, Depth::Eight, Transfer::None, &[]).unwrap();
        let image = decode_png(&bytes).unwrap().image;
        assert_eq!(image.channel("Y").unwrap(), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!((image.channels.len(), image.rgb().unwrap()[2].len()), (2, 4));
    }

    #[test]
    fn what_is_wrong_is_told() {
        let unfit = |image: &Image| encode_png(image, Depth::Eight, Transfer::None, &[]).unwrap_err().to_string();
        assert_eq!(unfit(&Image::default()), "a picture needs at least one pixel");
        let mut image = ramp();
        image.channels[1].data.pop();
        assert_eq!(unfit(&image), "channel G has 255 values for 16 × 16 pixels");
        image.channels.clear();
        assert_eq!(unfit(&image), "PNG needs the channels R G B, or Y");
        let text = [("k".repeat(80), String::new())];
        assert!(encode_png(&ramp(), Depth::Eight, Transfer::None, &text).is_err());
    }

    #[test]
    fn a_bomb_is_refused_before_memory_is_taken() {
        let mut bytes = encode_png(&ramp(), Depth::Eight, Transfer::None, &[]).unwrap();
        bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 0, 8, 0]); // 65536 × 2048
        let crc = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        assert_eq!(
            decode_png(&bytes).unwrap_err(),
            PictureError::Image(ImageError::ExceedsFile {
                format: "PNG",
                width: 65536,
                height: 2048,
                bytes: bytes.len()
            })
        );
    }

    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        })
    }

    #[test]
    fn damage_never_panics() {
        let whole = encode_png(&ramp(), Depth::Sixteen, Transfer::Srgb, &[]).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            let _ = decode_png(&bytes);
            let _ = decode_png(&whole[..at]);
        }
    }
}
