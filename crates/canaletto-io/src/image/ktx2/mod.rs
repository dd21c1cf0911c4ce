//! KTX2 with textures of Basis Universal, as KHR_texture_basisu has them: ETC1S with BasisLZ, and UASTC with or without
//! Zstandard. Only the largest level is read.

#[cfg(test)]
mod tests;
mod zstd;

use super::{DENSEST, ImageError, ImageFormat, decoder, judge, room, zeros};
use crate::codec::is_ktx2;
use basisu::{DecodeFlags, Error, TargetFormat, Transcoder};
use canaletto::texture::{ColorSpace, Image, Samples};
use std::borrow::Cow;
use std::ops::Range;

const FORMAT: &str = "KTX2";

/// The number of texels that any compressed file may have. A picture of one colour takes almost no bytes at any size.
const SMALL: u64 = 1 << 24;

/// The largest memory of the decoder per texel in bytes: four in the result, and one for the blocks.
const TEXEL: u64 = 5;

/// The size of a file's header without the index of its levels.
const HEADER: usize = 80;

/// KTX2 in the table of images.
pub(super) const IMAGE: ImageFormat = ImageFormat { name: FORMAT, recognises: is_ktx2, read: Ok(read) };

/// Reads a texture; returns it with the peak memory in bytes.
fn read(bytes: &[u8]) -> Result<(Image, u64), ImageError> {
    let header = Header::read(bytes)?;
    header.judge(bytes.len())?;
    let data = decoder(FORMAT, || header.texels(bytes))?;
    let Header { width, height, space, premultiplied, .. } = header;
    let (name, channels, samples) = (String::new(), header.content.channels(), Samples::U8(data));
    let memory = TEXEL * u64::from(width) * u64::from(height);
    Ok((Image { name, width, height, channels, samples, space, premultiplied }, memory))
}

/// What a file's header tells of its largest level.
struct Header {
    width: u32,
    height: u32,
    packing: Packing,
    content: Content,
    space: ColorSpace,
    premultiplied: bool,
    /// The place of the level's bytes.
    level: Range<usize>,
    /// The place of the data format descriptor.
    descriptor: Range<usize>,
}

/// The forms of texels.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Packing {
    /// ETC1S with BasisLZ.
    Etc1s,
    /// UASTC, whose blocks of 4 × 4 texels have 16 bytes each.
    Uastc,
    /// UASTC in a frame of Zstandard.
    UastcZstd,
}

/// What the decoded red, green, blue and alpha are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    Rgb,
    Rgba,
    /// Two numbers, of which the second is in alpha. It is read as green, and blue is 0.
    RedInRgbGreenInAlpha,
}

impl Content {
    fn channels(self) -> u8 {
        if self == Content::Rgba { 4 } else { 3 }
    }
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Header, ImageError> {
        let at = |at| number(bytes, at);
        let [vulkan, width, height, depth, layers, faces] = [at(12)?, at(20)?, at(24)?, at(28)?, at(32)?, at(36)?];
        match (vulkan, height, depth, layers, faces) {
            (1.., ..) => return Err(unsupported(format!("texels of Vulkan's format {vulkan}"))),
            (_, 0, ..) => return Err(unsupported("one dimension")),
            (_, _, 1.., ..) => return Err(unsupported("three dimensions")),
            (.., 6) => return Err(unsupported("the six sides of a cube")),
            (_, _, _, 2.., _) => return Err(unsupported(format!("an array of {layers} pictures"))),
            (.., 1) => {}
            _ => return Err(wrong(format!("it has {faces} faces"))),
        }
        if value(bytes, "KTXorientation").is_some_and(|value| value.get(1) == Some(&b'u')) {
            return Err(unsupported("rows from the bottom upwards"));
        }
        let descriptor = range(bytes, at(48)?.into(), at(52)?.into())?;
        let Some([model, _, transfer, flags]) = bytes[descriptor.clone()].get(12..16) else {
            return Err(wrong("its data format descriptor is too short"));
        };
        let packing = packing(*model, at(44)?)?;
        Ok(Header {
            width,
            height,
            packing,
            content: content(packing, &bytes[descriptor.clone()]),
            space: if *transfer == 1 { ColorSpace::Linear } else { ColorSpace::Srgb },
            premultiplied: flags & 1 == 1,
            level: range(bytes, long(bytes, HEADER)?, long(bytes, HEADER + 8)?)?,
            descriptor,
        })
    }

    /// The size of the blocks of UASTC in bytes.
    fn blocks(&self) -> u64 {
        16 * u64::from(self.width.div_ceil(4)) * u64::from(self.height.div_ceil(4))
    }

    /// Checks the size.
    fn judge(&self, bytes: usize) -> Result<(), ImageError> {
        let (width, height) = (self.width.into(), self.height.into());
        if self.packing == Packing::Uastc {
            judge(FORMAT, width, height, u64::MAX, bytes)?;
            let exceeds = self.blocks() > self.level.len() as u64;
            return if exceeds {
                Err(ImageError::ExceedsFile { format: FORMAT, width, height, bytes })
            } else {
                Ok(())
            };
        }
        judge(FORMAT, width, height, SMALL + bytes as u64 * DENSEST / TEXEL, bytes).map_err(|error| match error {
            ImageError::ExceedsFile { .. } => {
                ImageError::TooDense { format: FORMAT, width, height, bytes, memory: TEXEL * width * height }
            }
            other => other,
        })
    }

    /// Decodes the texels of the largest level.
    fn texels(&self, bytes: &[u8]) -> Result<Vec<u8>, ImageError> {
        let file = match self.packing {
            Packing::UastcZstd => Cow::Owned(self.inflated(bytes)?),
            _ => Cow::Borrowed(bytes),
        };
        let transcoder = Transcoder::new(&file).map_err(damaged)?;
        let count = self.width as usize * self.height as usize;
        let mut data = zeros(4 * count)?;
        transcoder.transcode_into(0, TargetFormat::Rgba32, DecodeFlags::NONE, &mut data).map_err(damaged)?;
        if self.content != Content::Rgba {
            for i in 0..count {
                let [r, g, b, a] = [0, 1, 2, 3].map(|c| data[4 * i + c]);
                let texel = if self.content == Content::Rgb { [r, g, b] } else { [r, a, 0] };
                data[3 * i..3 * i + 3].copy_from_slice(&texel);
            }
            data.truncate(3 * count);
            data.shrink_to_fit();
        }
        Ok(data)
    }

    /// The file with its largest level alone, and without Zstandard. The module `zstd` bounds memory by the size of the
    /// level. Decoders of other crates let a block of a few bytes have any size.
    fn inflated(&self, bytes: &[u8]) -> Result<Vec<u8>, ImageError> {
        let descriptor = &bytes[self.descriptor.clone()];
        let (start, size) = (HEADER + 24 + descriptor.len(), self.blocks() as usize);
        let mut file = room(start + size)?;
        file.extend(&bytes[..HEADER]);
        file.extend([start, size, size].iter().flat_map(|n| (*n as u64).to_le_bytes()));
        file.extend(descriptor);
        // One level, no supercompression, the descriptor after the index, and nothing else.
        for (at, n) in [(40, 1u32), (44, 0), (48, HEADER as u32 + 24)] {
            file[at..at + 4].copy_from_slice(&n.to_le_bytes());
        }
        file[56..HEADER].fill(0);
        zstd::inflate(&bytes[self.level.clone()], size, &mut file)
            .ok_or_else(|| wrong(format!("its level isn't a frame of Zstandard of {size} bytes")))?;
        Ok(file)
    }
}

/// The form of texels of a colour model and a supercompression scheme.
fn packing(model: u8, scheme: u32) -> Result<Packing, ImageError> {
    match (model, scheme) {
        (163, 1) => Ok(Packing::Etc1s),
        (166, 0) => Ok(Packing::Uastc),
        (166, 2) => Ok(Packing::UastcZstd),
        (162 | 167 | 168 | 169, _) => Err(unsupported("ASTC, or a form of Basis Universal that glTF doesn't have")),
        (163 | 166, 3) => Err(unsupported("a supercompression by zlib")),
        (163 | 166, _) => Err(unsupported(format!("the supercompression {scheme} of the colour model {model}"))),
        _ => Err(unsupported(format!("the colour model {model}"))),
    }
}

/// What the channels of a data format descriptor say.
fn content(packing: Packing, descriptor: &[u8]) -> Content {
    let channel = |sample: usize| descriptor.get(31 + 16 * sample).map(|kind| kind & 15);
    match (packing, channel(0), channel(1)) {
        (Packing::Etc1s, _, Some(4)) => Content::RedInRgbGreenInAlpha,
        (Packing::Etc1s, _, Some(_)) => Content::Rgba,
        (Packing::Etc1s, ..) => Content::Rgb,
        (_, Some(3), _) => Content::Rgba,
        (_, Some(5), _) => Content::RedInRgbGreenInAlpha,
        _ => Content::Rgb,
    }
}

/// The value of a key among a file's key-value pairs.
fn value<'a>(bytes: &'a [u8], key: &str) -> Option<&'a [u8]> {
    let (at, length) = (number(bytes, 56).ok()?, number(bytes, 60).ok()?);
    let mut pairs = &bytes[range(bytes, at.into(), length.into()).ok()?];
    loop {
        let length = number(pairs, 0).ok()? as usize;
        let pair = pairs.get(4..)?.get(..length)?;
        if let Some(value) = pair.strip_prefix(key.as_bytes()).and_then(|rest| rest.strip_prefix(b"\0")) {
            return Some(value);
        }
        pairs = pairs.get(4 + length.next_multiple_of(4)..)?;
    }
}

/// A place in the file.
fn range(bytes: &[u8], at: u64, length: u64) -> Result<Range<usize>, ImageError> {
    let end = at.checked_add(length).filter(|end| *end <= bytes.len() as u64);
    end.map(|end| at as usize..end as usize).ok_or_else(|| wrong("it ends too early"))
}

fn number(bytes: &[u8], at: usize) -> Result<u32, ImageError> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).map(|b| u32::from_le_bytes(*b)).ok_or_else(header_ends)
}

fn long(bytes: &[u8], at: usize) -> Result<u64, ImageError> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).map(|b| u64::from_le_bytes(*b)).ok_or_else(header_ends)
}

fn header_ends() -> ImageError {
    wrong("it ends in its header")
}

fn damaged(error: Error) -> ImageError {
    match error {
        Error::VideoRequiresState => unsupported("the frames of a film"),
        _ => wrong("the decoder can't make sense of it"),
    }
}

fn unsupported(what: impl Into<String>) -> ImageError {
    ImageError::Unsupported { format: FORMAT, what: what.into() }
}

fn wrong(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}
