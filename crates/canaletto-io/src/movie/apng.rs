//! Animated PNG (ISO/IEC 15948, third edition). Each frame is the rectangle that changed.

use super::{Area, Frames, MovieError, MovieSettings, Part, UNFINISHED};
use crate::picture::{AtomicFile, Compression, WriteOptions, png_texts};
use ::png::text_metadata::TEXtChunk;
use ::png::{BitDepth, ColorType, Encoder, EncodingError, Filter, ScaledFloat, SrgbRenderingIntent, Writer};
use canaletto::scene::Transfer;
use flate2::Crc;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

pub(super) struct Apng {
    file: AtomicFile,
    writer: Writer<Box<dyn Write + Send>>,
    width: u32,
    /// The bytes of a pixel.
    pixel: usize,
}

impl Apng {
    pub(super) fn begin(path: &Path, options: WriteOptions, settings: &MovieSettings) -> Result<Apng, MovieError> {
        let file = AtomicFile::begin(path, options)?;
        // Chunks are written whole, so no buffer is needed and no error is lost.
        let mut encoder = Encoder::new(file.handle()?, settings.width, settings.height);
        encoder.set_color(if settings.alpha { ColorType::Rgba } else { ColorType::Rgb });
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(compression_of_frames(settings.compression));
        encoder.set_filter(Filter::Adaptive);
        if settings.transfer == Transfer::Srgb {
            encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
            encoder.set_source_gamma(ScaledFloat::from_scaled(45_455));
        }
        png_texts(&mut encoder, &settings.metadata).map_err(|e| MovieError::Unfit(e.to_string()))?;
        let part = |n: u32| {
            u16::try_from(n).map_err(|_| {
                MovieError::Unfit(format!(
                    "animated PNG counts up to 65535 in a rate, and this one is {}",
                    settings.rate.fps()
                ))
            })
        };
        let (delay, of) = (part(settings.rate.seconds)?, part(settings.rate.frames)?);
        let mut begin = || {
            encoder.set_animated(settings.frames, 0)?; // 0: without end
            encoder.set_frame_delay(delay, of)
        };
        begin().map_err(|e| wrong(&file, e))?;
        let writer = encoder.write_header().map_err(|e| wrong(&file, e))?;
        Ok(Apng { file, writer, width: settings.width, pixel: if settings.alpha { 4 } else { 3 } })
    }
}

/// The compression of frames in the words of the crate `png`.
fn compression_of_frames(compression: Compression) -> ::png::Compression {
    match compression {
        Compression::Fast => ::png::Compression::Fast,
        Compression::Default => ::png::Compression::Balanced,
        Compression::Best => ::png::Compression::High,
    }
}

impl Frames for Apng {
    fn add(&mut self, index: u32, pixels: &[u8], area: Area) -> Result<(), MovieError> {
        let mut add = || {
            if index > 0 {
                self.writer.reset_frame_position()?;
                self.writer.set_frame_dimension(area.width, area.height)?;
                self.writer.set_frame_position(area.left, area.top)?;
            }
            self.writer.write_image_data(&area.cut(pixels, self.width, self.pixel))
        };
        add().map_err(|e| wrong(&self.file, e))
    }

    fn finish(self: Box<Apng>, part: Option<Part<'_>>) -> Result<(), MovieError> {
        let Apng { mut file, mut writer, .. } = *self;
        if part.is_some() {
            let text = TEXtChunk::new(UNFINISHED, "interrupted");
            writer.write_text_chunk(&text).map_err(|e| wrong(&file, e))?;
        }
        writer.finish().map_err(|e| wrong(&file, e))?;
        if let Some(part) = part {
            if let Some(written) = file.file() {
                count_anew(written, part.frames).map_err(|reason| file.failed(reason))?;
            }
            file.redirect(part.path);
        }
        Ok(file.commit()?)
    }

    fn temporary(&self) -> Option<&Path> {
        self.file.temporary()
    }
}

/// Changes the number of frames that the file declares.
fn count_anew(mut file: &File, frames: u32) -> io::Result<()> {
    /// The size of the chunk's name, its numbers of frames and of plays, and its checksum.
    const SIZE: usize = 4 + 8 + 4;
    file.seek(SeekFrom::Start(8))?; // the signature
    loop {
        let mut size = [0; 4];
        file.read_exact(&mut size)?;
        let start = file.stream_position()?;
        let mut chunk = [0; SIZE];
        file.read_exact(&mut chunk)?;
        if chunk.starts_with(b"acTL") {
            chunk[4..8].copy_from_slice(&frames.to_be_bytes());
            let mut sum = Crc::new();
            sum.update(&chunk[..12]);
            chunk[12..].copy_from_slice(&sum.sum().to_be_bytes());
            file.seek(SeekFrom::Start(start))?;
            return file.write_all(&chunk);
        }
        file.seek(SeekFrom::Start(start + 4 + u64::from(u32::from_be_bytes(size)) + 4))?;
    }
}

fn wrong(file: &AtomicFile, error: EncodingError) -> MovieError {
    match error {
        EncodingError::IoError(reason) => file.failed(reason).into(),
        other => MovieError::Unfit(format!("PNG can't hold it: {other}")),
    }
}
