//! GIF 89a: each frame has its own 256 colours ([`super::palette`]). Every pixel takes the nearest colour without
//! dithering, which would flicker between frames.

use super::palette::palette;
use super::{Area, Frames, MovieError, MovieSettings, Part, Rate, UNFINISHED};
use crate::picture::{AtomicFile, WriteOptions};
use ::gif::{AnyExtension, DisposalMethod, Encoder, EncodingError, Extension, Frame, Repeat};
use std::io::{BufWriter, Write};
use std::path::Path;

pub(super) struct Gif {
    file: AtomicFile,
    encoder: Encoder<BufWriter<Box<dyn Write + Send>>>,
    width: u32,
    rate: Rate,
}

/// The highest frame rate. Viewers show a frame of less than 2 hundredths of a second for 10.
const FASTEST: f64 = 50.0;

impl Gif {
    pub(super) fn begin(path: &Path, options: WriteOptions, settings: &MovieSettings) -> Result<Gif, MovieError> {
        if settings.rate.fps() > FASTEST {
            return Err(MovieError::Unfit(format!(
                "GIF shows at most {FASTEST} frames a second, and this film has {}",
                settings.rate.fps()
            )));
        }
        let side = |n: u32| {
            u16::try_from(n)
                .map_err(|_| MovieError::Unfit(format!("a side of a GIF has at most 65535 pixels, not {n}")))
        };
        let (width, height) = (side(settings.width)?, side(settings.height)?);
        let file = AtomicFile::begin(path, options)?;
        let mut encoder =
            Encoder::new(BufWriter::new(file.handle()?), width, height, &[]).map_err(|e| wrong(&file, e))?;
        encoder.set_repeat(Repeat::Infinite).map_err(|e| wrong(&file, e))?;
        Ok(Gif { file, encoder, width: settings.width, rate: settings.rate })
    }
}

impl Frames for Gif {
    fn add(&mut self, index: u32, rgb: &[u8], area: Area) -> Result<(), MovieError> {
        let part = area.cut(rgb, self.width, 3);
        let (colors, indices) = palette(&part);
        let mut frame = Frame::from_palette_pixels(area.width as u16, area.height as u16, indices, colors, None);
        (frame.left, frame.top) = (area.left as u16, area.top as u16);
        frame.dispose = DisposalMethod::Keep;
        // Delays are whole hundredths of a second; their sum follows the exact time.
        let time = self.rate.hundredths(index + 1) - self.rate.hundredths(index);
        frame.delay = time.min(u64::from(u16::MAX)) as u16;
        self.encoder.write_frame(&frame).map_err(|e| wrong(&self.file, e))
    }

    fn finish(self: Box<Gif>, part: Option<Part<'_>>) -> Result<(), MovieError> {
        let Gif { mut file, mut encoder, .. } = *self;
        if let Some(part) = part {
            let comment = encoder.write_raw_extension(AnyExtension(Extension::Comment as u8), &[UNFINISHED.as_bytes()]);
            comment.map_err(|e| wrong(&file, e))?;
            file.redirect(part.path);
        }
        let mut out = encoder.into_inner().map_err(|e| wrong(&file, e))?;
        out.flush().map_err(|reason| file.failed(reason))?;
        Ok(file.commit()?)
    }

    fn temporary(&self) -> Option<&Path> {
        self.file.temporary()
    }
}

fn wrong(file: &AtomicFile, error: EncodingError) -> MovieError {
    match error {
        EncodingError::Io(reason) => file.failed(reason).into(),
        other => MovieError::Unfit(format!("GIF can't hold it: {other}")),
    }
}
