//! A picture in an OpenEXR file of scan lines, of which only some rows are in memory.

use super::exr::{bits, from_utf8, texts_of, window_of};
use super::pixel_hash::{PIXEL_HASH, PixelHash};
use super::{Channel, Decoded, Image, PictureError, Window};
use crate::image::exr::{ScanLines, floats};
use ::exr::meta::attribute::SampleType;
use canaletto::scene::Transfer;
use std::io;
use std::ops::Range;
use std::path::Path;

/// A picture in an OpenEXR file of one part in scan lines, whose rows are read when they are asked for.
///
/// The file is opened by each call and closed after it, so a program may use any number of them.
#[derive(Debug)]
pub struct ScanLineFile {
    lines: ScanLines,
    texts: Vec<(String, String)>,
    hash: Option<String>,
}

/// The reasons why a file's rows can't be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScanLineError {
    /// The system can't read the file.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is no such picture, or it is damaged.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// Rows of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The rows as a picture of their own.
    pub decoded: Decoded,
    /// The hash of their values at their places.
    pub hash: PixelHash,
}

impl ScanLineFile {
    /// Opens a file, and reads its header.
    ///
    /// # Errors
    /// [`ScanLineError`] if the file can't be read, or isn't an OpenEXR of one part in scan lines.
    pub fn open(path: &Path) -> Result<ScanLineFile, ScanLineError> {
        let lines = ScanLines::open(path)?.map_err(PictureError::from)?;
        let mut texts = texts_of(lines.header());
        texts.sort();
        let hash = texts.iter().position(|(key, _)| key == PIXEL_HASH).map(|place| texts.remove(place).1);
        Ok(ScanLineFile { lines, texts, hash })
    }

    /// The width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        let size = self.lines.header().layer_size;
        [size.x() as u32, size.y() as u32]
    }

    /// The texts, sorted by their keys.
    pub fn texts(&self) -> &[(String, String)] {
        &self.texts
    }

    /// Reads rows, the first of which is 0, without the texts.
    ///
    /// # Errors
    /// [`ScanLineError`] if they aren't there or are damaged.
    pub fn read(&self, rows: Range<u32>) -> Result<Rows, ScanLineError> {
        let (width, range) = (self.size()[0] as usize, rows.start as usize..rows.end as usize);
        let list = &self.lines.header().channels.list;
        let names = || list.iter().map(|channel| from_utf8(&channel.name));
        let mut channels: Vec<Channel> =
            names().map(|name| Channel::new(name, Vec::with_capacity(width * range.len()))).collect();
        let mut hash = PixelHash::default();
        let read = self.lines.rows(range.clone(), |channel, y, row| {
            let Channel { name, data, ids } = &mut channels[channel];
            let start = data.len();
            let kind = list[channel].sample_type;
            data.extend(floats(kind, row));
            if kind == SampleType::U32 {
                ids.extend(row.as_chunks().0.iter().map(|bytes| u32::from_ne_bytes(*bytes)));
            }
            hash.add_row(name, y, data[start..].iter().copied());
        })?;
        read.map_err(PictureError::from)?;
        let image = Image { width: width as u32, height: range.len() as u32, channels };
        super::check(&image)?;
        let are_half = list.iter().map(|channel| channel.sample_type == SampleType::F16);
        let bits = bits(image.channels.iter().map(|channel| channel.name.as_str()).zip(are_half));
        let Window { at: [x, y], whole } = window_of(self.lines.header());
        let decoded = Decoded {
            image,
            bits,
            transfer: Some(Transfer::None),
            metadata: Vec::new(),
            window: Window { at: [x, y.saturating_add_unsigned(rows.start)], whole },
            left_out: Vec::new(),
            is_changed: false,
            display_referred: false,
        };
        Ok(Rows { decoded, hash })
    }

    /// Whether the pixels aren't those that this program wrote: the file is damaged, or another program changed it.
    /// `hash` is that of all rows. Only files that hold a hash of their pixels tell.
    pub fn is_changed(&self, hash: PixelHash) -> bool {
        self.hash.as_ref().is_some_and(|told| *told != hash.text())
    }
}
