//! Pictures that move, in one file: animated PNG, GIF, and what the program `ffmpeg` makes (MP4, WebM).
//!
//! Frames are written as they come, into a file that takes its name when the last of them is there. Of an unfinished film nothing
//! is left, unless it is [asked for](Movie::finish_part). All of them have 8 bits and no alpha.

mod apng;
mod ffmpeg;
mod gif;
mod palette;
mod rate;

pub use ffmpeg::find_ffmpeg;
pub use rate::Rate;

use crate::picture::{Compression, Image, WriteError, WriteOptions};
use canaletto::scene::Transfer;
use std::path::Path;

/// The formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MovieFormat {
    /// Animated PNG: every colour as it is.
    Apng,
    /// GIF: 256 colours in each frame.
    Gif,
    /// H.264 in MP4, by ffmpeg.
    Mp4,
    /// VP9 in WebM, by ffmpeg.
    WebM,
}

impl MovieFormat {
    /// Whether the program `ffmpeg` is needed.
    pub fn needs_ffmpeg(self) -> bool {
        matches!(self, MovieFormat::Mp4 | MovieFormat::WebM)
    }
}

/// What a film is, besides its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Frames of a second.
    pub rate: Rate,
    /// How many frames there will be.
    pub frames: u32,
    /// How the numbers of its pictures are encoded, as in a PNG.
    pub transfer: Transfer,
    /// How much time is spent on a small file, in animated PNG.
    pub compression: Compression,
    /// Texts with their keys, where the format holds some.
    pub metadata: Vec<(String, String)>,
}

/// Why a film isn't written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MovieError {
    /// The format can't hold it.
    #[error("{0}")]
    Unfit(String),
    /// The file can't be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// There is no program `ffmpeg`.
    #[error("the program ffmpeg isn't installed, or not in PATH")]
    NoFfmpeg,
    /// `ffmpeg` failed.
    #[error("ffmpeg failed: {0}")]
    Ffmpeg(String),
}

/// A film that is being written. Dropping it before [`Movie::finish`] leaves nothing of it.
pub struct Movie {
    settings: MovieSettings,
    writer: Box<dyn Frames>,
    added: u32,
    /// The last frame.
    last: Vec<u8>,
}

/// What writes frames in a format.
trait Frames {
    /// Adds a frame: red, green and blue of each pixel. Only `area` differs from the frame before.
    fn add(&mut self, index: u32, rgb: &[u8], area: Area) -> Result<(), MovieError>;
    /// All frames are there; or those of a part, which goes elsewhere.
    fn finish(self: Box<Self>, part: Option<Part<'_>>) -> Result<(), MovieError>;
    /// The temporary name of the file, if it has one.
    fn temporary(&self) -> Option<&Path>;
}

/// The first frames of a film that will not be whole.
struct Part<'a> {
    frames: u32,
    path: &'a Path,
}

/// The key of the text that a part has, where its format holds texts.
const UNFINISHED: &str = "unfinished";

/// A part of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Area {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
}

impl Movie {
    /// Begins a film of at least one frame.
    ///
    /// # Errors
    /// [`MovieError`] says why it can't be written.
    pub fn begin(
        format: MovieFormat,
        path: &Path,
        options: WriteOptions,
        settings: MovieSettings,
    ) -> Result<Movie, MovieError> {
        if settings.frames == 0 || settings.width == 0 || settings.height == 0 {
            return Err(MovieError::Unfit("a film needs at least one frame of at least one pixel".into()));
        }
        let writer: Box<dyn Frames> = match format {
            MovieFormat::Apng => Box::new(apng::Apng::begin(path, options, &settings)?),
            MovieFormat::Gif => Box::new(gif::Gif::begin(path, options, &settings)?),
            MovieFormat::Mp4 | MovieFormat::WebM => Box::new(ffmpeg::Ffmpeg::begin(format, path, options, &settings)?),
        };
        Ok(Movie { settings, writer, added: 0, last: Vec::new() })
    }

    /// Adds a frame of display values, which are rounded as in a PNG.
    ///
    /// # Errors
    /// [`MovieError`] if it isn't like the film, or can't be written.
    pub fn add(&mut self, image: &Image) -> Result<(), MovieError> {
        let Some([r, g, b]) = image.rgb() else {
            return Err(MovieError::Unfit("a frame needs red, green and blue".into()));
        };
        if (image.width, image.height) != (self.settings.width, self.settings.height) {
            return Err(MovieError::Unfit(format!(
                "a frame of {} × {} pixels doesn't fit into a film of {} × {}",
                image.width, image.height, self.settings.width, self.settings.height
            )));
        }
        if self.added == self.settings.frames {
            return Err(MovieError::Unfit(format!("the film has its {} frames already", self.added)));
        }
        let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8; // NaN becomes 0
        let rgb: Vec<u8> = r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [level(*r), level(*g), level(*b)]).collect();
        let area = changed(&self.last, &rgb, image.width, image.height);
        self.writer.add(self.added, &rgb, area)?;
        self.added += 1;
        self.last = rgb;
        Ok(())
    }

    /// Puts the film in its place.
    ///
    /// # Errors
    /// [`MovieError`] if frames are missing, or it can't be written.
    pub fn finish(self) -> Result<(), MovieError> {
        if self.added < self.settings.frames {
            let (added, frames) = (self.added, self.settings.frames);
            return Err(MovieError::Unfit(format!("the film has {added} of its {frames} frames")));
        }
        self.writer.finish(None)
    }

    /// Makes a film of the frames so far, if there are any, and puts it in another place, where it replaces what is there. Returns their
    /// number. The standard output, devices and pipes have no other place.
    ///
    /// # Errors
    /// [`MovieError`] if it can't be written.
    pub fn finish_part(self, path: &Path) -> Result<u32, MovieError> {
        if self.added > 0 {
            self.writer.finish(Some(Part { frames: self.added, path }))?;
        }
        Ok(self.added)
    }

    /// The temporary name of its file, which stays if the program is ended meanwhile.
    pub fn temporary(&self) -> Option<&Path> {
        self.writer.temporary()
    }
}

/// The smallest part outside of which two pictures are alike; a single pixel if they are alike everywhere.
fn changed(old: &[u8], new: &[u8], width: u32, height: u32) -> Area {
    if old.len() != new.len() {
        return Area { left: 0, top: 0, width, height };
    }
    let stride = width as usize * 3;
    let rows = || old.chunks_exact(stride).zip(new.chunks_exact(stride));
    let Some(top) = rows().position(|(a, b)| a != b) else { return Area { left: 0, top: 0, width: 1, height: 1 } };
    let bottom = height as usize - rows().rev().position(|(a, b)| a != b).unwrap_or(0);
    let (mut left, mut right) = (width as usize, 0);
    for (a, b) in rows().skip(top).take(bottom - top) {
        if let Some(first) = a.iter().zip(b).position(|(a, b)| a != b) {
            left = left.min(first / 3);
            let last = a.iter().zip(b).rposition(|(a, b)| a != b).unwrap_or(first);
            right = right.max(last / 3 + 1);
        }
    }
    Area { left: left as u32, top: top as u32, width: (right - left) as u32, height: (bottom - top) as u32 }
}

impl Area {
    /// The bytes of this part of a picture that is `width` pixels wide.
    fn cut(self, rgb: &[u8], width: u32) -> Vec<u8> {
        let stride = width as usize * 3;
        let (from, to) = (self.left as usize * 3, (self.left + self.width) as usize * 3);
        let rows = rgb.chunks_exact(stride).skip(self.top as usize).take(self.height as usize);
        rows.flat_map(|row| &row[from..to]).copied().collect()
    }
}

#[cfg(test)]
mod tests;
