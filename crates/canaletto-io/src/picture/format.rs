//! The table of picture formats: what a file of each can hold, how it is read and written.

#[cfg(feature = "exr")]
use super::exr;
#[cfg(feature = "jpeg")]
use super::jpeg;
#[cfg(feature = "png")]
use super::png;
#[cfg(feature = "webp")]
use super::webp;
use super::{Decoded, Image, PictureError, Window, pnm, texture};
use crate::codec::CodecOff;
use crate::image;
use canaletto::film::Picture;
use canaletto::scene::{Developing, Transfer};
use std::io::{self, Seek, Write};

/// The formats of picture files.
///
/// ```
/// use canaletto::scene::Transfer;
/// use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, decode};
///
/// let image = Image::from_rgb(2, 1, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].into_iter());
/// let png = PictureFormat::Png.encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[])?;
/// assert_eq!(decode(&png)?.image, image);
/// # Ok::<(), canaletto_io::picture::PictureError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PictureFormat {
    /// PNG.
    #[default]
    Png,
    /// OpenEXR.
    Exr,
    /// JPEG.
    Jpeg,
    /// WebP.
    WebP,
    /// Radiance HDR, which is only read.
    Hdr,
    /// PPM and PGM, which are only read.
    Pnm,
}

/// All formats in the order of messages and help texts.
static FORMATS: [(PictureFormat, FormatInfo); 6] = [
    #[cfg(feature = "png")]
    (PictureFormat::Png, png::FORMAT),
    #[cfg(not(feature = "png"))]
    (PictureFormat::Png, texture::PNG),
    #[cfg(feature = "exr")]
    (PictureFormat::Exr, exr::FORMAT),
    #[cfg(not(feature = "exr"))]
    (PictureFormat::Exr, texture::EXR),
    #[cfg(feature = "jpeg")]
    (PictureFormat::Jpeg, jpeg::FORMAT),
    #[cfg(not(feature = "jpeg"))]
    (PictureFormat::Jpeg, texture::JPEG),
    #[cfg(feature = "webp")]
    (PictureFormat::WebP, webp::FORMAT),
    #[cfg(not(feature = "webp"))]
    (PictureFormat::WebP, texture::WEBP),
    (PictureFormat::Hdr, texture::HDR),
    (PictureFormat::Pnm, pnm::FORMAT),
];

/// A row of the table.
pub(super) struct FormatInfo {
    /// The usual name, and a short one.
    pub(super) names: [&'static str; 2],
    /// The file name extension, in lower case.
    pub(super) extension: &'static str,
    /// Whether a file with these first bytes has this format.
    pub(super) recognises: fn(&[u8]) -> bool,
    pub(super) decode: fn(&[u8]) -> Result<Decoded, PictureError>,
    /// The width and height in pixels that a file's header declares.
    pub(super) size: Option<ReadSize>,
    pub(super) encoder: Option<Encoder>,
    /// Why the format can be neither read nor written.
    pub(super) off: Option<CodecOff>,
}

/// The writing of a format.
pub(super) struct Encoder {
    pub(super) capabilities: Capabilities,
    /// Writes a rendered picture while the callback returns true; the rest of it is black.
    pub(super) encode: Encode,
    /// Writes an image whose values have this curve.
    pub(super) encode_image: EncodeImage,
    /// The number of bits that [`Decoded::bits`] has for a file of these channels.
    pub(super) stored_bits: fn(&EncodeSettings, &[String]) -> u8,
    /// Writes a rendered picture row by row into a file.
    pub(super) write_rows: Option<WriteRows>,
}

type ReadSize = fn(&[u8]) -> Option<[u32; 2]>;
type Encode = fn(&Rendered<'_>, &EncodeSettings, &Texts, GoesOn<'_>) -> Result<Vec<u8>, PictureError>;
type EncodeImage = fn(&Image, Transfer, &EncodeSettings, &Texts) -> Result<Vec<u8>, PictureError>;
type WriteRows = fn(&Rendered<'_>, &EncodeSettings, &Texts, &mut dyn SeekWrite, GoesOn<'_>) -> Result<(), PartError>;

/// Texts of a file as pairs of key and value.
pub(super) type Texts = [(String, String)];

/// A callback that returns whether there is time to go on.
pub(super) type GoesOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// What a format can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Capabilities {
    /// One line about the format, for help texts.
    pub summary: &'static str,
    /// The numbers of bits that a value may have, the default first.
    pub bits: &'static [u8],
    /// Whether values are linear light of any range. Other formats hold display values from 0 to 1, encoded by a
    /// transfer curve.
    pub linear: bool,
    /// Whether a file can hold alpha, the channel `A`.
    pub alpha: bool,
    /// Whether one file holds all layers of a picture. Other formats have a file for each layer, as a picture of it.
    pub layers: bool,
    /// Whether a file holds texts, by which a complete picture is recognised.
    pub texts: bool,
    /// Whether the effort of compression can be chosen.
    pub compression: bool,
    /// Whether values are rounded by a quality that can be chosen.
    pub lossy: bool,
    /// Whether ids of objects and materials can be whole numbers.
    pub whole_ids: bool,
}

/// How a picture is written. A format ignores what it has no choice of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncodeSettings {
    /// The number of bits of a value, one of [`Capabilities::bits`]; `None` for the default. EXR has them in colours
    /// only.
    pub bits: Option<u8>,
    /// The effort of compression. [`Compression::Fast`] writes an EXR without compression.
    pub compression: Compression,
    /// The quality of a lossy format, from 1 to 100; `None` for [`EncodeSettings::DEFAULT_QUALITY`].
    pub quality: Option<u8>,
    /// Whether ids of objects and materials are whole numbers.
    pub whole_ids: bool,
    /// The position in a larger picture; `None` if the picture is the whole.
    pub window: Option<Window>,
}

impl EncodeSettings {
    /// The quality of lossy formats that are said nothing of. Its errors are hardly seen.
    pub const DEFAULT_QUALITY: u8 = 92;

    /// The quality of a lossy format, from 1 to 100.
    pub(super) fn quality(&self) -> u8 {
        self.quality.unwrap_or(EncodeSettings::DEFAULT_QUALITY).clamp(1, 100)
    }
}

/// The effort of compression. The pixels don't depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compression {
    /// A tenth to twice as large as by default, in a fifth of the time.
    Fast,
    /// The size of zlib's level 6.
    #[default]
    Default,
    /// Smaller than by default by some hundredths, in three times the time.
    Best,
}

/// A rendered picture, and how formats with display values develop it.
#[derive(Clone, Copy, Debug)]
pub struct Rendered<'a> {
    /// The picture in linear light, with its layers.
    pub picture: &'a Picture,
    /// How it is developed.
    pub developing: Developing,
}

/// A file, or anything else that is written at any place.
pub trait SeekWrite: Write + Seek {}

impl<T: Write + Seek> SeekWrite for T {}

/// The reasons why a part of a picture isn't written.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The format can't represent the picture.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// Writing failed.
    #[error(transparent)]
    Write(#[from] io::Error),
}

impl PictureFormat {
    /// All formats in the order of messages and help texts.
    pub fn all() -> impl Iterator<Item = PictureFormat> + Clone {
        FORMATS.iter().map(|(format, _)| *format)
    }

    /// The formats that are read.
    pub fn readable() -> impl Iterator<Item = PictureFormat> + Clone {
        PictureFormat::all().filter(|format| format.info().off.is_none())
    }

    /// The formats that are written.
    pub fn written() -> impl Iterator<Item = PictureFormat> + Clone {
        PictureFormat::all().filter(|format| format.info().encoder.is_some())
    }

    /// The format of a file with these first bytes.
    pub fn of_bytes(start: &[u8]) -> Option<PictureFormat> {
        PictureFormat::all().find(|format| (format.info().recognises)(start))
    }

    /// The usual name, such as "OpenEXR".
    pub fn name(self) -> &'static str {
        self.info().names[0]
    }

    /// The short name, such as "EXR".
    pub fn short_name(self) -> &'static str {
        self.info().names[1]
    }

    /// The file name extension, in lower case.
    pub fn extension(self) -> &'static str {
        self.info().extension
    }

    /// What a file of this format can hold; `None` if the format is only read.
    pub fn capabilities(self) -> Option<&'static Capabilities> {
        self.info().encoder.as_ref().map(|encoder| &encoder.capabilities)
    }

    /// The bytes of a rendered picture in this format. `texts` go into the file if it holds texts. When `goes_on`
    /// returns false, the rest of the picture may be black or missing.
    ///
    /// # Errors
    /// [`PictureError::Unfit`] if the format is only read, or can't hold this picture.
    pub fn encode(
        self,
        rendered: &Rendered<'_>,
        settings: &EncodeSettings,
        texts: &Texts,
        goes_on: GoesOn<'_>,
    ) -> Result<Vec<u8>, PictureError> {
        (self.encoder()?.encode)(rendered, settings, texts, goes_on)
    }

    /// The bytes of an image in this format. Its values are stored as they are, and have the curve `transfer`.
    ///
    /// # Errors
    /// As [`PictureFormat::encode`].
    pub fn encode_image(
        self,
        image: &Image,
        transfer: Transfer,
        settings: &EncodeSettings,
        texts: &Texts,
    ) -> Result<Vec<u8>, PictureError> {
        (self.encoder()?.encode_image)(image, transfer, settings, texts)
    }

    /// The number of bits that [`Decoded::bits`] has for a file with these settings and channels.
    ///
    /// # Errors
    /// As [`PictureFormat::encode`].
    pub fn stored_bits(self, settings: &EncodeSettings, channels: &[String]) -> Result<u8, PictureError> {
        Ok((self.encoder()?.stored_bits)(settings, channels))
    }

    /// Whether [`PictureFormat::write_rows`] can write this picture without rounding it.
    pub fn has_rows(self, picture: &Picture) -> bool {
        let writes = self.info().encoder.as_ref().is_some_and(|encoder| encoder.write_rows.is_some());
        // Rows hold floats, which round large ids.
        writes && picture.layers.iter().all(|layer| layer.ids.is_empty())
    }

    /// Writes a picture row by row into `out`, without a copy of it, while `goes_on` returns true. The rest of it is
    /// black. This is the fastest way to save a part of a picture when a program must end.
    ///
    /// # Errors
    /// As [`PictureFormat::encode`], and the errors of `out`.
    pub fn write_rows(
        self,
        rendered: &Rendered<'_>,
        settings: &EncodeSettings,
        texts: &Texts,
        out: &mut dyn SeekWrite,
        goes_on: GoesOn<'_>,
    ) -> Result<(), PartError> {
        let write = self.encoder()?.write_rows.ok_or_else(|| self.unfit("isn't written in rows"))?;
        write(rendered, settings, texts, out, goes_on)
    }

    fn info(self) -> &'static FormatInfo {
        &FORMATS[self as usize].1
    }

    fn encoder(self) -> Result<&'static Encoder, PictureError> {
        let info = self.info();
        info.encoder.as_ref().ok_or_else(|| match info.off {
            Some(off) => image::ImageError::from(off).into(),
            None => self.unfit("is only read"),
        })
    }

    fn unfit(self, why: &str) -> PictureError {
        PictureError::Unfit(format!("{} {why}", self.name()))
    }
}

/// Reads a picture; the format is detected from its first bytes.
///
/// # Errors
/// [`PictureError`] if the picture can't be read.
pub fn decode(bytes: &[u8]) -> Result<Decoded, PictureError> {
    match PictureFormat::of_bytes(bytes) {
        Some(format) => (format.info().decode)(bytes),
        None => Err(match image::unknown(bytes) {
            image::ImageError::Unknown => PictureError::Unknown,
            error => error.into(),
        }),
    }
}

/// The width and height in pixels that the header of a file declares, for formats that are written.
pub fn announced_size(bytes: &[u8]) -> Option<[u32; 2]> {
    (PictureFormat::of_bytes(bytes)?.info().size?)(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Channel;

    #[test]
    fn rows_of_the_table_are_at_the_place_of_their_format() {
        for (index, (format, info)) in FORMATS.iter().enumerate() {
            assert_eq!((*format as usize, format.name()), (index, info.names[0]));
        }
    }

    /// A format is what its capabilities say: bits, values beyond 1, texts, layers.
    #[test]
    fn capabilities_hold_for_files() {
        let mut picture = Picture::new(5, 3);
        picture.pixels[7] = [0.5, 2.0, 0.25].into();
        let rendered = Rendered { picture: &picture, developing: Developing::default() };
        let texts = [("seed".to_owned(), "7".to_owned())];
        for format in PictureFormat::written() {
            let can = format.capabilities().unwrap();
            assert!(!can.bits.is_empty());
            for bits in can.bits {
                let settings = EncodeSettings { bits: Some(*bits), ..EncodeSettings::default() };
                let bytes = format.encode(&rendered, &settings, &texts, &|| true).unwrap();
                assert_eq!((PictureFormat::of_bytes(&bytes), announced_size(&bytes)), (Some(format), Some([5, 3])));
                let read = decode(&bytes).unwrap();
                let names: Vec<String> = read.image.channels.iter().map(|channel| channel.name.clone()).collect();
                assert_eq!((read.bits, *bits), (format.stored_bits(&settings, &names).unwrap(), read.bits));
                assert_eq!(read.display_referred, !can.linear);
                assert_eq!(read.image.channel("G").unwrap()[7] == 2.0, can.linear);
                assert_eq!(read.metadata.contains(&texts[0]), can.texts);
                let first = format.encode(&rendered, &EncodeSettings::default(), &texts, &|| true).unwrap();
                assert_eq!(first == bytes, *bits == can.bits[0], "the first is the default");
            }
            assert_eq!(format.has_rows(&picture), format == PictureFormat::Exr);
            let image = Image::from_picture(&picture);
            let alpha = Channel::new("A", vec![1.0; 15]);
            let image = Image { channels: [image.channels, vec![alpha]].concat(), ..image };
            let bytes = format.encode_image(&image, Transfer::None, &EncodeSettings::default(), &texts).unwrap();
            assert_eq!(decode(&bytes).unwrap().image.channel("A").is_some(), can.alpha);
        }
        let read_only = PictureFormat::all().filter(|format| format.capabilities().is_none());
        for format in read_only {
            let settings = EncodeSettings::default();
            let error = format.encode(&rendered, &settings, &texts, &|| true).unwrap_err();
            assert_eq!(error.to_string(), format!("{} is only read", format.name()));
        }
    }
}
