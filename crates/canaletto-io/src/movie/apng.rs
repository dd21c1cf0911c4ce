//! Animated PNG (ISO/IEC 15948, third edition): each frame is the part that changed.

use super::{Area, Frames, MovieError, MovieSettings};
use crate::picture::{AtomicFile, WriteOptions, png_texts};
use ::png::{BitDepth, ColorType, Compression, Encoder, EncodingError, ScaledFloat, SrgbRenderingIntent, Writer};
use canaletto::scene::Transfer;
use std::io::Write;
use std::path::Path;

pub(super) struct Apng {
    file: AtomicFile,
    writer: Writer<Box<dyn Write + Send>>,
    width: u32,
}

impl Apng {
    pub(super) fn begin(path: &Path, options: WriteOptions, settings: &MovieSettings) -> Result<Apng, MovieError> {
        let file = AtomicFile::begin(path, options)?;
        // Its chunks are written whole, so nothing need be buffered, and no error is missed.
        let mut encoder = Encoder::new(file.handle()?, settings.width, settings.height);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::High);
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
        Ok(Apng { file, writer, width: settings.width })
    }
}

impl Frames for Apng {
    fn add(&mut self, index: u32, rgb: &[u8], area: Area) -> Result<(), MovieError> {
        let mut add = || {
            if index > 0 {
                self.writer.reset_frame_position()?;
                self.writer.set_frame_dimension(area.width, area.height)?;
                self.writer.set_frame_position(area.left, area.top)?;
            }
            self.writer.write_image_data(&area.cut(rgb, self.width))
        };
        add().map_err(|e| wrong(&self.file, e))
    }

    fn finish(self: Box<Apng>) -> Result<(), MovieError> {
        let Apng { file, writer, .. } = *self;
        writer.finish().map_err(|e| wrong(&file, e))?;
        Ok(file.commit()?)
    }
}

fn wrong(file: &AtomicFile, error: EncodingError) -> MovieError {
    match error {
        EncodingError::IoError(reason) => file.failed(reason).into(),
        other => MovieError::Unfit(format!("PNG can't hold it: {other}")),
    }
}
