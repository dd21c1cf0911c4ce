//! JPEG (ITU-T T.81), baseline and progressive with 8 bits: grey, colour, and Adobe's CMYK.
//!
//! The decoder's processor-specific kernels are disabled, so that a file has equal texels on every machine. It runs in
//! strict mode, so that truncated files are reported. Bytes between segments, which strict mode refuses and libjpeg
//! skips, are removed first.

use super::{ImageError, ImageFormat, decoder, judge, room, zeros};
use crate::codec::is_jpeg;
use canaletto::texture::{ColorSpace, Image, Samples};
use std::io::Cursor;
use zune_core::colorspace::ColorSpace as Layout;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

const FORMAT: &str = "JPEG";

/// The largest number of scans. Each scan takes a pass over the whole picture, however few its bytes. Programs write a
/// dozen.
const SCANS: usize = 100;

/// JPEG in the table of images.
pub(super) const IMAGE: ImageFormat = ImageFormat { name: FORMAT, recognises: is_jpeg, read: Ok(read) };

/// Reads a JPEG; returns it with the peak memory in bytes. Colour profiles and camera orientation are ignored.
fn read(bytes: &[u8]) -> Result<(Image, u64), ImageError> {
    let (plain, frame) = plain(bytes)?;
    let Frame { width, height, .. } = frame;
    let options = DecoderOptions::default().set_max_width(1 << 16).set_max_height(1 << 16).set_strict_mode(true);
    let gray = frame.factors.len() == 1;
    let channels: u8 = if gray { 1 } else { 3 };
    let count = width as usize * height as usize * usize::from(channels);
    let samples = decoder(FORMAT, || {
        let layout = if gray { Layout::Luma } else { Layout::RGB };
        let mut decoder = JpegDecoder::new_with_options(Cursor::new(&plain), options.jpeg_set_out_colorspace(layout));
        decoder.decode_headers().map_err(damaged)?;
        if decoder.dimensions() != Some((width as usize, height as usize)) {
            return Err(wrong("it has two sizes"));
        }
        let mut data = zeros(count)?;
        decoder.decode_into(&mut data).map_err(damaged)?;
        Ok(Samples::U8(data))
    })?;
    // A progressive picture also stores its coefficients, of two bytes each.
    let texels = u64::from(width) * u64::from(height);
    let memory = texels * u64::from(channels) * if frame.progressive { 3 } else { 1 };
    let (name, space) = (String::new(), ColorSpace::Srgb);
    Ok((Image { name, width, height, channels, samples, space, premultiplied: false }, memory))
}

/// The contents of a frame header (T.81, B.2.2).
struct Frame {
    width: u32,
    height: u32,
    progressive: bool,
    /// The sampling factors of each component: its number of blocks per unit, across and down.
    factors: Vec<[u32; 2]>,
}

/// Copies the supported segments of the file, and parses its frame header. Unsupported features are reported by name.
fn plain(bytes: &[u8]) -> Result<(Vec<u8>, Frame), ImageError> {
    let mut plain: Vec<u8> = room(bytes.len() + 2)?;
    plain.extend([0xff, 0xd8]);
    let (mut frame, mut scans, mut adobe) = (None, 0, false);
    let mut at = 2;
    // Any bytes may precede a marker, and any number of ff bytes may be in it (B.1.1.2).
    while let Some((code, start)) = marker(bytes, at) {
        at = start;
        match code {
            0xd9 => {
                plain.extend([0xff, 0xd9]);
                break;
            }
            0x01 | 0xd0..=0xd7 => continue,
            0xd8 => return Err(wrong("it starts a second time")),
            _ => {}
        }
        let length = bytes.get(at..at + 2).map(|two| usize::from(u16::from_be_bytes([two[0], two[1]])));
        let length = length.ok_or_else(short)?;
        if length < 2 {
            return Err(wrong("a segment is shorter than its length"));
        }
        let segment = bytes.get(at..at + length).ok_or_else(short)?;
        at += length;
        let keep = match code {
            0xc4 | 0xdb | 0xdd => true,
            0xc0..=0xc2 if frame.is_none() => {
                frame = Some(read_frame(code, &segment[2..], bytes.len())?);
                true
            }
            0xc0..=0xc2 => return Err(wrong("it has two frames")),
            0xc3 => return Err(unsupported("lossless coding")),
            0xc5..=0xc7 => return Err(unsupported("hierarchical coding")),
            0xc9..=0xcf => return Err(unsupported("arithmetic coding")),
            0xc8 | 0xf0..=0xf6 | 0xf8..=0xfd => return Err(unsupported("coding of a later kind than JPEG")),
            0xf7 => return Err(unsupported("JPEG-LS coding")),
            0xdc => return Err(unsupported("its height behind the picture (DNL)")),
            0xe0 => true,
            0xee => {
                adobe |= segment[2..].starts_with(b"Adobe");
                true
            }
            0xda => {
                scans += 1;
                if scans > SCANS {
                    return Err(unsupported(format!("more than {SCANS} scans")));
                }
                true
            }
            _ => false,
        };
        if keep {
            plain.extend([0xff, code]);
            plain.extend_from_slice(segment);
        }
        if code == 0xda {
            // The entropy-coded data of the scan ends at a marker other than a restart.
            let end =
                bytes[at..].windows(2).position(|two| two[0] == 0xff && !matches!(two[1], 0 | 0xd0..=0xd7 | 0xff));
            let end = end.map_or(bytes.len(), |length| at + length);
            plain.extend_from_slice(&bytes[at..end]);
            at = end;
        }
    }
    let frame = frame.filter(|_| scans > 0).ok_or_else(short)?;
    if frame.factors.len() == 4 && !adobe {
        return Err(unsupported("CMYK without Adobe's marker"));
    }
    Ok((plain, frame))
}

/// The next marker code from `at` on, and the offset after it.
fn marker(bytes: &[u8], mut at: usize) -> Option<(u8, usize)> {
    loop {
        at += bytes.get(at..)?.iter().position(|b| *b == 0xff)?;
        at += bytes[at..].iter().position(|b| *b != 0xff)?;
        if bytes[at] != 0 {
            return Some((bytes[at], at + 1));
        }
    }
}

fn read_frame(code: u8, segment: &[u8], bytes: usize) -> Result<Frame, ImageError> {
    let &[precision, h1, h0, w1, w0, count, ref components @ ..] = segment else { return Err(short()) };
    let [height, width] = [[h1, h0], [w1, w0]].map(|two| u32::from(u16::from_be_bytes(two)));
    if precision != 8 {
        return Err(unsupported(format!("{precision} bits for each number")));
    }
    if !matches!(count, 1 | 3 | 4) {
        return Err(unsupported(format!("{count} components")));
    }
    let components = components.as_chunks::<3>().0;
    if components.len() != usize::from(count) {
        return Err(wrong("its frame has another number of components than it says"));
    }
    let factors: Vec<[u32; 2]> = components.iter().map(|c| [u32::from(c[1] >> 4), u32::from(c[1] & 15)]).collect();
    if factors.iter().flatten().any(|factor| !(1..=4).contains(factor)) {
        return Err(wrong("a component's sampling isn't 1 to 4"));
    }
    if height == 0 && width > 0 {
        return Err(unsupported("its height behind the picture (DNL)"));
    }
    // Every block of 8 × 8 takes at least one bit, for its DC coefficient.
    let largest = |axis: usize| u64::from(factors.iter().map(|f| f[axis]).max().unwrap_or(1));
    let blocks: u64 = factors.iter().map(|f| u64::from(f[0] * f[1])).sum();
    let explained = bytes as u64 * 8 * 64 * largest(0) * largest(1) / blocks;
    judge(FORMAT, width.into(), height.into(), explained, bytes)?;
    Ok(Frame { width, height, progressive: code == 0xc2, factors })
}

fn damaged(error: DecodeErrors) -> ImageError {
    match error {
        DecodeErrors::IoErrors(_) | DecodeErrors::ExhaustedData => short(),
        DecodeErrors::Unsupported(what) => unsupported(format!("{what:?}")),
        other => wrong(other.to_string().trim().replace('\n', " ")),
    }
}

fn short() -> ImageError {
    wrong("it ends too early")
}

fn unsupported(what: impl Into<String>) -> ImageError {
    ImageError::Unsupported { format: FORMAT, what: what.into() }
}

fn wrong(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}
