//! The codecs of other crates, each of which a build may leave out, and how their files begin.
#![allow(dead_code)] // Where all codecs are on, no format needs the error of the missing one.

/// The error of a format whose codec the program was built without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{format} can be neither read nor written: this program was built without canaletto-io's feature \"{feature}\""
)]
#[non_exhaustive]
pub struct CodecOff {
    /// The format.
    pub format: &'static str,
    /// The feature of this crate that has its codec.
    pub feature: &'static str,
}

impl CodecOff {
    const fn new(format: &'static str, feature: &'static str) -> CodecOff {
        CodecOff { format, feature }
    }
}

pub(crate) const EXR: CodecOff = CodecOff::new("OpenEXR", "exr");
pub(crate) const GIF: CodecOff = CodecOff::new("GIF", "gif");
pub(crate) const JPEG: CodecOff = CodecOff::new("JPEG", "jpeg");
pub(crate) const KTX2: CodecOff = CodecOff::new("KTX2", "ktx2");
pub(crate) const PNG: CodecOff = CodecOff::new("PNG", "png");
pub(crate) const WEBP: CodecOff = CodecOff::new("WebP", "webp");

/// Whether the file starts like an EXR.
pub(crate) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x76\x2f\x31\x01")
}

/// Whether the file starts like a JPEG.
pub(crate) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xff\xd8")
}

/// Whether the file starts like a KTX2 texture.
pub(crate) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// Whether the file starts like a PNG.
pub(crate) fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

/// Whether the file starts like a WebP picture.
pub(crate) fn is_webp(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")
}
