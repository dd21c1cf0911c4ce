//! Images to be used as textures, as compact as their files hold them.
//!
//! [`read_image`] finds the format by a file's first bytes, not by its name. What a file announces is judged before
//! memory is taken: an image may have [`texture::Image::MAX_TEXELS`] texels, and a file that claims more than its
//! bytes can hold is refused. What would take more than 64 MiB and 20 times its file is unpacked twice where the format
//! allows that, the first time without keeping anything: so only a whole file takes it, and its reader is told.
//!
//! Decoders of others are called through the `guard`, and what is known of their faults is kept from them.
//!
//! [`texture::Image::MAX_TEXELS`]: canaletto::texture::Image::MAX_TEXELS

pub(crate) mod exr;
mod hdr;
mod jpeg;
pub(crate) mod png;
#[cfg(test)]
mod tests;
mod webp;

use crate::assets::Asset;
use crate::guard::guarded;
use canaletto::memory::{self, NoMemory};
use canaletto::texture::{Image, Samples};
use rayon::prelude::*;

/// Why a file can't be used as an image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The first bytes are of no known format.
    #[error("it is no image that can be read")]
    Unknown,
    /// It is of a format that isn't read.
    #[error("its format is {0}, which isn't read")]
    Other(&'static str),
    /// The file doesn't follow its format, or ends too early.
    #[error("the {format} file is damaged: {reason}")]
    Damaged {
        /// The format.
        format: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// The format knows more than is read here.
    #[error("the {format} file has {what}, which isn't supported")]
    Unsupported {
        /// The format.
        format: &'static str,
        /// What isn't supported.
        what: String,
    },
    /// It has no texels.
    #[error("the {format} file announces an image of {width} × {height} pixels; it needs at least one")]
    Empty {
        /// The format.
        format: &'static str,
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
    },
    /// It has more than is read, whatever its file.
    #[error(
        "the {format} file announces an image of {width} × {height} pixels; the most are {most} in all and {side} in a row or column",
        most = Image::MAX_TEXELS, side = Image::MAX_SIDE
    )]
    TooLarge {
        /// The format.
        format: &'static str,
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
    },
    /// It announces more than its bytes can hold.
    #[error(
        "the {format} file announces an image of {width} × {height} pixels, which its {bytes} bytes can't hold: it is cut off or made to fill memory"
    )]
    Unexplained {
        /// The format.
        format: &'static str,
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
        /// The file's size.
        bytes: usize,
    },
    /// Unpacking it would take far more memory than its bytes, before it is known whether they are all there.
    #[error(
        "the {format} file of {bytes} bytes announces an image of {width} × {height} pixels; unpacking it would take {} MB before it is known \
         whether the file is whole", memory / 1_000_000
    )]
    TooDense {
        /// The format.
        format: &'static str,
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
        /// The file's size.
        bytes: usize,
        /// What unpacking it would take, in bytes.
        memory: u64,
    },
    /// There is no room for it.
    #[error("there is no memory for its {0} bytes")]
    NoMemory(u64),
}

impl ImageError {
    /// What the reader could do about it.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            ImageError::Unknown | ImageError::Other(_) => {
                Some("images are read from PNG, JPEG, OpenEXR, Radiance HDR and WebP files")
            }
            ImageError::Damaged { .. } | ImageError::Unexplained { .. } => {
                Some("make the file anew, or open and save it with a program for pictures")
            }
            ImageError::Unsupported { what, .. } if what == exr::DWA => {
                Some("it would be unpacked to other numbers on other processors; save it with ZIP or PIZ compression")
            }
            ImageError::TooDense { .. } => Some("save it as PNG, which is unpacked row by row, or scale it down"),
            ImageError::TooLarge { .. } => Some("scale it down with a program for pictures"),
            _ => None,
        }
    }
}

/// The largest number of an image that is kept; what is beyond it, and no image means, is cut to it.
const BRIGHTEST: f32 = Image::MAX_VALUE;

/// Memory that any file may take.
const SMALL: u64 = 64 << 20;

/// How many bytes one of a file can become at most: deflate's 258 for two bits, which are 1032 for a byte. Formats without
/// a bound of their own are held to it.
const DENSEST: u64 = 1032;

/// Whether a file of this many bytes may take so much memory without more ado.
fn is_ordinary(memory: u64, bytes: usize) -> bool {
    memory <= SMALL + 20 * bytes as u64
}

/// Calls a foreign decoder.
fn decoder<T>(format: &'static str, f: impl FnOnce() -> Result<T, ImageError>) -> Result<T, ImageError> {
    let gave_up = || ImageError::Damaged { format, reason: "the decoder can't make sense of it".into() };
    guarded(f).unwrap_or_else(|| Err(gave_up()))
}

/// Reads an image; its name is the file's. With it comes what is worth knowing about it.
///
/// # Errors
/// [`ImageError`] says why not.
pub fn read_image(asset: &Asset) -> Result<(Image, Vec<String>), ImageError> {
    let bytes = asset.bytes.as_slice();
    let (mut image, memory) = unpack(bytes)?;
    image.name = asset.path.name().to_owned();
    let odd = tidy(&mut image.samples);
    let mut notes = match odd {
        0 => Vec::new(),
        1 => vec!["one of its numbers is infinite or no number; it is taken as the largest or as 0".into()],
        _ => vec![format!("{odd} of its numbers are infinite or no numbers; they are taken as the largest or as 0")],
    };
    if !is_ordinary(memory, bytes.len()) {
        notes.push(format!(
            "its {} bytes unpack to {} × {} texels; reading them took {} MB",
            bytes.len(),
            image.width,
            image.height,
            memory / 1_000_000
        ));
    }
    Ok((image, notes))
}

/// The image of a file without a name, and the most memory that reading it took.
pub(crate) fn unpack(bytes: &[u8]) -> Result<(Image, u64), ImageError> {
    Ok(if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        with_memory(png::read(bytes)?)
    } else if bytes.starts_with(b"\xff\xd8") {
        jpeg::read(bytes)?
    } else if bytes.starts_with(b"\x76\x2f\x31\x01") {
        with_memory(exr::read(bytes)?)
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        webp::read(bytes)?
    } else if hdr::is_hdr(bytes) {
        let (image, memory) = with_memory(hdr::read(bytes)?);
        let packed = 4 * u64::from(image.width) * u64::from(image.height);
        (image, memory + packed)
    } else {
        return Err(other(bytes));
    })
}

/// What a file is that isn't read, as far as its first bytes tell.
fn other(bytes: &[u8]) -> ImageError {
    const KINDS: [(usize, &[u8], &str); 17] = [
        (0, b"GIF8", "GIF"),
        (0, b"BM", "BMP"),
        (0, b"II*\0", "TIFF"),
        (0, b"MM\0*", "TIFF"),
        (0, b"II+\0", "BigTIFF"),
        (0, b"DDS ", "DDS"),
        (0, b"\xabKTX", "KTX"),
        (0, b"8BPS", "Photoshop"),
        (0, b"\0\0\0\x0cjP  ", "JPEG 2000"),
        (0, b"\xff\x4f\xff\x51", "JPEG 2000"),
        (0, b"\0\0\0\x0cJXL ", "JPEG XL"),
        (0, b"\xff\x0a", "JPEG XL"),
        (4, b"ftypavi", "AVIF"),
        (4, b"ftyp", "HEIF"),
        (0, b"qoif", "QOI"),
        (0, b"PF", "PFM"),
        (0, b"<svg", "SVG"),
    ];
    let is = |(at, start, _): &&(usize, &[u8], &'static str)| bytes.get(*at..).is_some_and(|b| b.starts_with(start));
    KINDS.iter().find(is).map_or(ImageError::Unknown, |(.., kind)| ImageError::Other(kind))
}

/// An image that took no more memory than its numbers, and how much these take.
fn with_memory(image: Image) -> (Image, u64) {
    let size = match image.samples {
        Samples::U8(_) => 1,
        Samples::U16(_) | Samples::F16(_) => 2,
        Samples::F32(_) => 4,
    };
    let memory = size * image.samples.len() as u64;
    (image, memory)
}

/// Puts numbers that can't be computed with in order; tells how many there were.
fn tidy(samples: &mut Samples) -> usize {
    match samples {
        Samples::U8(_) | Samples::U16(_) => 0,
        Samples::F16(data) => data
            .par_iter_mut()
            .map(|v| {
                let odd = *v & 0x7c00 == 0x7c00;
                if odd {
                    let nan = *v & 0x03ff != 0;
                    *v = if nan { 0 } else { *v & 0x8000 | 0x7bff };
                }
                usize::from(odd)
            })
            .sum(),
        Samples::F32(data) => data
            .par_iter_mut()
            .map(|v| {
                let odd = !v.is_finite() || v.abs() > BRIGHTEST;
                if odd {
                    *v = if v.is_nan() { 0.0 } else { v.clamp(-BRIGHTEST, BRIGHTEST) };
                }
                usize::from(odd)
            })
            .sum(),
    }
}

/// Judges a size before memory is taken for it. `explained` is how many texels the file's bytes can hold at most.
fn judge(format: &'static str, width: u64, height: u64, explained: u64, bytes: usize) -> Result<(), ImageError> {
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { format, width, height });
    }
    let side = u64::from(Image::MAX_SIDE);
    if width > side || height > side || width * height > Image::MAX_TEXELS {
        return Err(ImageError::TooLarge { format, width, height });
    }
    if width * height > explained {
        return Err(ImageError::Unexplained { format, width, height, bytes });
    }
    Ok(())
}

/// Room for this many numbers, if there is memory.
fn room<T: Clone + Default>(count: usize) -> Result<Vec<T>, ImageError> {
    let mut data = Vec::new();
    memory::reserve(&mut data, count).map_err(|NoMemory(bytes)| ImageError::NoMemory(bytes))?;
    Ok(data)
}

/// As many zeros, of which the system has none before they are written: a decoder that gives up takes no room for them.
fn zeros(count: usize) -> Result<Vec<u8>, ImageError> {
    drop(room::<u8>(count)?);
    Ok(vec![0; count])
}
