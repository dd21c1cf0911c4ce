//! Images to be used as textures, as compact as their files hold them.
//!
//! [`read_image`] finds the format by a file's first bytes, not by its name. What a file announces is judged before
//! memory is taken: an image may have [`texture::Image::MAX_TEXELS`] texels, and a file that claims far more than its
//! bytes can explain is refused.
//!
//! [`texture::Image::MAX_TEXELS`]: canaletto::texture::Image::MAX_TEXELS

mod exr;
mod hdr;
mod jpeg;
mod png;
#[cfg(test)]
mod tests;
mod webp;

use crate::assets::Asset;
use canaletto::memory::{self, NoMemory};
use canaletto::texture::{Image, Samples};
use rayon::prelude::*;

/// Why a file can't be used as an image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// The first bytes are of no known format.
    #[error("it is no image that can be read")]
    Unknown,
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
    /// There is no room for it.
    #[error("there is no memory for its {0} bytes")]
    NoMemory(u64),
}

impl ImageError {
    /// What the reader could do about it.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            ImageError::Unknown => Some("images are read from PNG, JPEG, OpenEXR, Radiance HDR and WebP files"),
            ImageError::Damaged { .. } | ImageError::Unexplained { .. } => {
                Some("make the file anew, or open and save it with a program for pictures")
            }
            ImageError::TooLarge { .. } => Some("scale it down with a program for pictures"),
            _ => None,
        }
    }
}

/// The largest number of an image that is kept; what is beyond it, and no image means, is cut to it.
const BRIGHTEST: f32 = Image::MAX_VALUE;

/// Reads an image; its name is the file's. With it comes what is worth knowing about it.
///
/// # Errors
/// [`ImageError`] says why not.
pub fn read_image(asset: &Asset) -> Result<(Image, Vec<String>), ImageError> {
    let bytes = asset.bytes.as_slice();
    let mut image = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        png::read(bytes)?
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        jpeg::read(bytes)?
    } else if bytes.starts_with(b"\x76\x2f\x31\x01") {
        exr::read(bytes)?
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        webp::read(bytes)?
    } else if hdr::is_hdr(bytes) {
        hdr::read(bytes)?
    } else {
        return Err(ImageError::Unknown);
    };
    image.name = asset.path.name().to_owned();
    let odd = tidy(&mut image.samples);
    let notes = match odd {
        0 => Vec::new(),
        1 => vec!["one of its numbers is infinite or no number; it is taken as the largest or as 0".into()],
        _ => vec![format!("{odd} of its numbers are infinite or no numbers; they are taken as the largest or as 0")],
    };
    Ok((image, notes))
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
