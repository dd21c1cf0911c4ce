//! Images to be used as textures, stored as compactly as in their files.
//!
//! [`read_image`] detects the format from a file's first bytes, not from its name. The size that a file declares is
//! checked before memory is allocated. An image may have [`texture::Image::MAX_TEXELS`] texels, and a file that
//! declares more than its bytes can hold is refused. A file that needs more than 64 MiB plus 20 times its size is
//! decoded twice where the format allows it. The first pass stores nothing, so only a complete file gets the memory. A
//! note then reports the memory.
//!
//! Third-party decoders are called through `guard`, and inputs that trigger their faults are refused before.
//!
//! [`texture::Image::MAX_TEXELS`]: canaletto::texture::Image::MAX_TEXELS

#[cfg(feature = "exr")]
pub(crate) mod exr;
pub(crate) mod hdr;
#[cfg(feature = "jpeg")]
mod jpeg;
#[cfg(feature = "ktx2")]
mod ktx2;
#[cfg(feature = "png")]
pub(crate) mod png;
#[cfg(test)]
mod tests;
#[cfg(feature = "webp")]
mod webp;

use crate::assets::Asset;
use crate::codec::CodecOff;
use crate::diagnostic::word_list;
use crate::guard::guarded;
use canaletto::memory::{self, NoMemory};
use canaletto::texture::{Image, Samples};
use canaletto_parallel::prelude::*;
use std::sync::LazyLock;

/// The reasons why a file can't be used as an image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The first bytes match no recognised format.
    #[error("it is no image that can be read")]
    Unknown,
    /// The format is recognised but not supported.
    #[error("its format is {0}, which isn't read")]
    Other(&'static str),
    /// The file violates its format, or ends too early.
    #[error("the {format} file is damaged: {reason}")]
    Damaged {
        /// The format.
        format: &'static str,
        /// The message of the decoder.
        reason: String,
    },
    /// The file uses a feature of the format that isn't supported.
    #[error("the {format} file has {what}, which isn't supported")]
    Unsupported {
        /// The format.
        format: &'static str,
        /// The feature.
        what: String,
    },
    /// The image has no texels.
    #[error("the {format} file announces an image of {width} × {height} pixels; it needs at least one")]
    Empty {
        /// The format.
        format: &'static str,
        /// The width in pixels.
        width: u64,
        /// The height in pixels.
        height: u64,
    },
    /// The image has more texels than the limit.
    #[error(
        "the {format} file announces an image of {width} × {height} pixels; the most are {most} in all and {side} in a row or column",
        most = Image::MAX_TEXELS, side = Image::MAX_SIDE
    )]
    TooLarge {
        /// The format.
        format: &'static str,
        /// The width in pixels.
        width: u64,
        /// The height in pixels.
        height: u64,
    },
    /// The file declares more texels than its bytes can hold.
    #[error(
        "the {format} file announces an image of {width} × {height} pixels, which its {bytes} bytes can't hold: it is cut off or made to fill memory"
    )]
    ExceedsFile {
        /// The format.
        format: &'static str,
        /// The width in pixels.
        width: u64,
        /// The height in pixels.
        height: u64,
        /// The file's size in bytes.
        bytes: usize,
    },
    /// Decoding would take far more memory than the file's size before the file is proved complete.
    #[error(
        "the {format} file of {bytes} bytes announces an image of {width} × {height} pixels; unpacking it would take {} MB before it is known \
         whether the file is whole", memory / 1_000_000
    )]
    TooDense {
        /// The format.
        format: &'static str,
        /// The width in pixels.
        width: u64,
        /// The height in pixels.
        height: u64,
        /// The file's size in bytes.
        bytes: usize,
        /// The memory that decoding would take, in bytes.
        memory: u64,
    },
    /// The program was built without the format's codec.
    #[error(transparent)]
    Off(#[from] CodecOff),
    /// The memory, in bytes, can't be allocated.
    #[error("there is no memory for its {0} bytes")]
    NoMemory(u64),
}

impl ImageError {
    /// A hint for the user.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            ImageError::Unknown | ImageError::Other(_) => Some(&READABLE),
            ImageError::Damaged { .. } | ImageError::ExceedsFile { .. } => {
                Some("make the file anew, or open and save it with a program for pictures")
            }
            ImageError::Unsupported { what, .. } if what == DWA => {
                Some("it would be unpacked to other numbers on other processors; save it with ZIP or PIZ compression")
            }
            ImageError::TooDense { .. } => Some("save it as PNG, which is unpacked row by row, or scale it down"),
            ImageError::TooLarge { .. } => Some("scale it down with a program for pictures"),
            _ => None,
        }
    }
}

/// The name of the compression of OpenEXR that isn't read, in messages.
const DWA: &str = "DWA compression";

/// The largest total memory of a scene's or a model's images in bytes.
pub(crate) const MAX_IMAGE_BYTES: u64 = 8 << 30;

/// The memory in bytes that any file may take.
const SMALL: u64 = 64 << 20;

/// The largest number of bytes into which one byte of a file can expand: deflate has 258 bytes for two bits, so 1032
/// for a byte. The limit also applies to formats without one of their own.
const DENSEST: u64 = 1032;

/// Whether a file of this size may take so much memory without a first pass.
fn is_within_budget(memory: u64, bytes: usize) -> bool {
    memory <= SMALL + 20 * bytes as u64
}

/// Calls a third-party decoder.
fn decoder<T>(format: &'static str, f: impl FnOnce() -> Result<T, ImageError>) -> Result<T, ImageError> {
    let gave_up = || ImageError::Damaged { format, reason: "the decoder can't make sense of it".into() };
    guarded(f).unwrap_or_else(|| Err(gave_up()))
}

/// Reads an image; its name is that of the file. Returns it with notes for the user.
///
/// # Errors
/// [`ImageError`] if the file can't be read.
pub fn read_image(asset: &Asset) -> Result<(Image, Vec<String>), ImageError> {
    let bytes = asset.bytes.as_slice();
    let (mut image, memory) = unpack(bytes)?;
    image.name = asset.path.name().to_owned();
    let odd = sanitise(&mut image.samples, usize::from(image.channels));
    let mut notes = odd.notes();
    if !is_within_budget(memory, bytes.len()) {
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

/// A format of images.
struct ImageFormat {
    /// The usual name.
    name: &'static str,
    /// Whether a file with these first bytes has this format.
    recognises: fn(&[u8]) -> bool,
    /// Decodes an unnamed image; returns it with the peak memory in bytes.
    read: Result<ReadImage, CodecOff>,
}

type ReadImage = fn(&[u8]) -> Result<(Image, u64), ImageError>;

/// All formats, in the order of messages.
static FORMATS: [ImageFormat; 6] = [
    #[cfg(feature = "png")]
    png::IMAGE,
    #[cfg(not(feature = "png"))]
    without(crate::codec::PNG, crate::codec::is_png),
    #[cfg(feature = "jpeg")]
    jpeg::IMAGE,
    #[cfg(not(feature = "jpeg"))]
    without(crate::codec::JPEG, crate::codec::is_jpeg),
    #[cfg(feature = "exr")]
    exr::IMAGE,
    #[cfg(not(feature = "exr"))]
    without(crate::codec::EXR, crate::codec::is_exr),
    hdr::IMAGE,
    #[cfg(feature = "webp")]
    webp::IMAGE,
    #[cfg(not(feature = "webp"))]
    without(crate::codec::WEBP, crate::codec::is_webp),
    #[cfg(feature = "ktx2")]
    ktx2::IMAGE,
    #[cfg(not(feature = "ktx2"))]
    without(crate::codec::KTX2, crate::codec::is_ktx2),
];

/// A format without its codec.
#[allow(dead_code)] // All codecs may be there.
const fn without(codec: CodecOff, recognises: fn(&[u8]) -> bool) -> ImageFormat {
    ImageFormat { name: codec.format, recognises, read: Err(codec) }
}

/// The sentence that names all formats.
static READABLE: LazyLock<String> = LazyLock::new(|| {
    let names: Vec<&str> = FORMATS.iter().filter(|format| format.read.is_ok()).map(|format| format.name).collect();
    format!("images are read from {} files", word_list(&names, "and"))
});

/// Decodes an unnamed image; returns it with the peak memory in bytes.
pub(crate) fn unpack(bytes: &[u8]) -> Result<(Image, u64), ImageError> {
    match FORMATS.iter().find(|format| (format.recognises)(bytes)) {
        Some(format) => (format.read?)(bytes),
        None => Err(unknown(bytes)),
    }
}

/// The error for an unsupported file, with the format that its first bytes indicate.
pub(crate) fn unknown(bytes: &[u8]) -> ImageError {
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

/// The image, with the size of its samples as the memory of reading it.
fn with_memory(image: Image) -> (Image, u64) {
    let size = match image.samples {
        Samples::U8(_) => 1,
        Samples::U16(_) | Samples::F16(_) => 2,
        Samples::F32(_) => 4,
    };
    let memory = size * image.samples.len() as u64;
    (image, memory)
}

/// The numbers of texels that had to be changed.
#[derive(Clone, Copy, Default)]
struct OddTexels {
    /// Those that were infinite, or too large to mean anything.
    endless: usize,
    /// Those of which a number was no number.
    nan: usize,
}

impl OddTexels {
    fn and(self, other: OddTexels) -> OddTexels {
        OddTexels { endless: self.endless + other.endless, nan: self.nan + other.nan }
    }

    /// What the user is told of them.
    fn notes(self) -> Vec<String> {
        let count = |n: usize| match n {
            1 => "one of its texels is".to_owned(),
            n => format!("{n} of its texels are"),
        };
        let endless = || {
            format!(
                "{} infinite or beyond {:e}, which would outshine all others; such numbers are taken as {}",
                count(self.endless),
                Image::MAX_VALUE,
                Image::INFINITE
            )
        };
        let nan = || format!("{} no number (NaN) and taken as 0", count(self.nan));
        [(self.endless > 0).then(endless), (self.nan > 0).then(nan)].into_iter().flatten().collect()
    }
}

/// Replaces NaN by 0, and infinite and too large numbers by [`Image::INFINITE`].
fn sanitise(samples: &mut Samples, channels: usize) -> OddTexels {
    match samples {
        Samples::U8(_) | Samples::U16(_) => OddTexels::default(),
        Samples::F16(data) => replace_odd(data, channels, |v| {
            let is_nan = v & 0x03ff != 0;
            // The largest half float is 65504.
            (v & 0x7c00 == 0x7c00).then_some((if is_nan { 0 } else { v & 0x8000 | 0x7bff }, is_nan))
        }),
        Samples::F32(data) => replace_odd(data, channels, |v| {
            let mended = if v.is_nan() { 0.0 } else { Image::INFINITE.copysign(v) };
            (v.is_nan() || v.abs() > Image::MAX_VALUE).then_some((mended, v.is_nan()))
        }),
    }
}

/// Replaces the numbers for which `mend` has another one. It also tells whether a number was NaN.
fn replace_odd<T: Copy + Send>(
    data: &mut [T],
    channels: usize,
    mend: impl Fn(T) -> Option<(T, bool)> + Sync,
) -> OddTexels {
    let texel = |numbers: &mut [T]| {
        let mut odd = OddTexels::default();
        for number in numbers {
            if let Some((mended, is_nan)) = mend(*number) {
                *number = mended;
                if is_nan { odd.nan = 1 } else { odd.endless = 1 }
            }
        }
        odd
    };
    data.par_chunks_mut(channels).map(texel).reduce(OddTexels::default, OddTexels::and)
}

/// Checks a size before memory is allocated for it. `explained` is the largest number of texels that the file's bytes
/// can hold.
fn judge(format: &'static str, width: u64, height: u64, explained: u64, bytes: usize) -> Result<(), ImageError> {
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { format, width, height });
    }
    let side = u64::from(Image::MAX_SIDE);
    if width > side || height > side || width * height > Image::MAX_TEXELS {
        return Err(ImageError::TooLarge { format, width, height });
    }
    if width * height > explained {
        return Err(ImageError::ExceedsFile { format, width, height, bytes });
    }
    Ok(())
}

/// An empty vector with capacity for `count` values, if memory can be allocated.
fn room<T: Clone + Default>(count: usize) -> Result<Vec<T>, ImageError> {
    let mut data = Vec::new();
    memory::reserve(&mut data, count).map_err(|NoMemory(bytes)| ImageError::NoMemory(bytes))?;
    Ok(data)
}

/// Zeros for which the system allocates pages only when they are written. A decoder that fails early therefore takes no
/// memory for them.
fn zeros(count: usize) -> Result<Vec<u8>, ImageError> {
    drop(room::<u8>(count)?);
    Ok(vec![0; count])
}
