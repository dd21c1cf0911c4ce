//! Films in one file: animated PNG, GIF, and formats that the program `ffmpeg` encodes (MP4, WebM).
//!
//! Frames are written as they arrive. The file gets its name after the last one. An unfinished film is removed unless
//! [`Movie::finish_part`] is called. All formats have 8 bits.

#[cfg(feature = "png")]
mod apng;
mod ffmpeg;
#[cfg(feature = "gif")]
mod gif;
#[cfg(feature = "gif")]
mod palette;
mod rate;

pub use ffmpeg::find_ffmpeg;
pub use rate::Rate;

use crate::codec::{self, CodecOff};
use crate::picture::{Compression, Image, WriteError, WriteOptions};
use canaletto::scene::Transfer;
use std::path::Path;

/// The film formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MovieFormat {
    /// Animated PNG, lossless.
    Apng,
    /// GIF, with 256 colours per frame.
    Gif,
    /// H.264 in MP4, encoded by ffmpeg.
    Mp4,
    /// VP9 in WebM, encoded by ffmpeg.
    WebM,
}

/// All formats with their rows, in the order of messages and help texts.
static FORMATS: [(MovieFormat, FormatInfo); 4] = [
    (MovieFormat::Apng, APNG),
    (MovieFormat::Gif, GIF),
    (MovieFormat::Mp4, ffmpeg::MP4),
    (MovieFormat::WebM, ffmpeg::WEBM),
];

/// A row of the table of film formats.
struct FormatInfo {
    /// The usual name, and a short one.
    names: [&'static str; 2],
    /// The file name extension, in lower case.
    extension: &'static str,
    /// One line about the format, for help texts.
    summary: &'static str,
    /// Whether a file with these first bytes has this format.
    recognises: fn(&[u8]) -> bool,
    /// Whether the effort of compression can be chosen.
    compression: bool,
    /// Whether frames can have alpha.
    alpha: bool,
    /// Whether the program `ffmpeg` is needed.
    needs_ffmpeg: bool,
}

/// Animated PNG in the table of film formats.
const APNG: FormatInfo = FormatInfo {
    names: ["animated PNG", "APNG"],
    extension: "apng",
    summary: "A film as animated PNG, in full colour",
    recognises: codec::is_png,
    compression: true,
    alpha: true,
    needs_ffmpeg: false,
};

/// GIF in the table of film formats.
const GIF: FormatInfo = FormatInfo {
    names: ["GIF", "GIF"],
    extension: "gif",
    summary: "A film as GIF, with 256 colours in each frame and at most 50 frames a second",
    recognises: |start| start.starts_with(b"GIF8"),
    compression: false,
    alpha: false,
    needs_ffmpeg: false,
};

impl MovieFormat {
    /// All formats in the order of messages and help texts.
    pub fn all() -> impl Iterator<Item = MovieFormat> + Clone {
        FORMATS.iter().map(|(format, _)| *format)
    }

    /// Whether a file with these first bytes is a film.
    pub fn is_film(start: &[u8]) -> bool {
        FORMATS.iter().any(|(_, info)| (info.recognises)(start))
    }

    /// The usual name, such as "animated PNG".
    pub fn name(self) -> &'static str {
        self.info().names[0]
    }

    /// The short name, such as "APNG".
    pub fn short_name(self) -> &'static str {
        self.info().names[1]
    }

    /// The file name extension, in lower case.
    pub fn extension(self) -> &'static str {
        self.info().extension
    }

    /// One line about the format, for help texts.
    pub fn summary(self) -> &'static str {
        self.info().summary
    }

    /// Whether the effort of compression can be chosen.
    pub fn has_compression(self) -> bool {
        self.info().compression
    }

    /// Whether frames can have alpha.
    pub fn has_alpha(self) -> bool {
        self.info().alpha
    }

    /// Whether the program `ffmpeg` is needed.
    pub fn needs_ffmpeg(self) -> bool {
        self.info().needs_ffmpeg
    }

    fn info(self) -> &'static FormatInfo {
        &FORMATS[self as usize].1
    }
}

/// The settings of a film.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The frame rate.
    pub rate: Rate,
    /// The number of frames.
    pub frames: u32,
    /// The encoding of the pixel values, as in a PNG.
    pub transfer: Transfer,
    /// Whether frames have alpha, for animated PNG.
    pub alpha: bool,
    /// The effort of compression, for animated PNG.
    pub compression: Compression,
    /// Texts as pairs of key and value, for formats that hold texts.
    pub metadata: Vec<(String, String)>,
}

/// The reasons why a film isn't written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MovieError {
    /// The format can't represent the film.
    #[error("{0}")]
    Unfit(String),
    /// The program was built without the format's codec.
    #[error(transparent)]
    Off(#[from] CodecOff),
    /// The file can't be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The program `ffmpeg` isn't found.
    #[error("the program ffmpeg isn't installed, or not in PATH")]
    NoFfmpeg,
    /// `ffmpeg` failed.
    #[error("ffmpeg failed: {0}")]
    Ffmpeg(String),
}

/// A film that is being written. Dropping it before [`Movie::finish`] removes it.
pub struct Movie {
    settings: MovieSettings,
    writer: Box<dyn Frames>,
    added: u32,
    /// The last frame.
    last: Vec<u8>,
}

/// A writer of frames in a format.
trait Frames {
    /// Adds a frame: red, green and blue of each pixel, and alpha, if the film has it. Only `area` differs from the
    /// frame before.
    fn add(&mut self, index: u32, pixels: &[u8], area: Area) -> Result<(), MovieError>;
    /// Ends the film after all frames, or ends a partial film, which goes to another path.
    fn finish(self: Box<Self>, part: Option<Part<'_>>) -> Result<(), MovieError>;
    /// The temporary path of the file, if it has one.
    fn temporary(&self) -> Option<&Path>;
}

/// The first frames of a film that is not completed.
struct Part<'a> {
    frames: u32,
    path: &'a Path,
}

/// The key of the text that marks a partial film, in formats that hold texts.
const UNFINISHED: &str = "unfinished";

/// A rectangle of a picture.
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
    /// [`MovieError`] if it can't be written.
    pub fn begin(
        format: MovieFormat,
        path: &Path,
        options: WriteOptions,
        settings: MovieSettings,
    ) -> Result<Movie, MovieError> {
        if settings.alpha && !format.has_alpha() {
            return Err(MovieError::Unfit(format!("{} has no alpha", format.name())));
        }
        if settings.frames == 0 || settings.width == 0 || settings.height == 0 {
            return Err(MovieError::Unfit("a film needs at least one frame of at least one pixel".into()));
        }
        let writer: Box<dyn Frames> = match format {
            #[cfg(feature = "png")]
            MovieFormat::Apng => Box::new(apng::Apng::begin(path, options, &settings)?),
            #[cfg(not(feature = "png"))]
            MovieFormat::Apng => return Err(codec::PNG.into()),
            #[cfg(feature = "gif")]
            MovieFormat::Gif => Box::new(gif::Gif::begin(path, options, &settings)?),
            #[cfg(not(feature = "gif"))]
            MovieFormat::Gif => return Err(codec::GIF.into()),
            MovieFormat::Mp4 | MovieFormat::WebM => Box::new(ffmpeg::Ffmpeg::begin(format, path, options, &settings)?),
        };
        Ok(Movie { settings, writer, added: 0, last: Vec::new() })
    }

    /// Adds a frame of display values, which are rounded as in a PNG.
    ///
    /// # Errors
    /// [`MovieError`] if the frame doesn't match the film, or can't be written.
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
        let alpha = image.channel("A").filter(|_| self.settings.alpha);
        if self.settings.alpha && alpha.is_none() {
            return Err(MovieError::Unfit("a frame of a film with alpha needs the channel A".into()));
        }
        let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8; // NaN becomes 0
        let channels: Vec<&[f32]> = [r, g, b].into_iter().chain(alpha).collect();
        let pixels: Vec<u8> = (0..r.len()).flat_map(|i| channels.iter().map(move |c| level(c[i]))).collect();
        let area = changed(&self.last, &pixels, [image.width, image.height], channels.len());
        self.writer.add(self.added, &pixels, area)?;
        self.added += 1;
        self.last = pixels;
        Ok(())
    }

    /// Ends the film and moves it to its path.
    ///
    /// # Errors
    /// [`MovieError`] if frames are missing, or if it can't be written.
    pub fn finish(self) -> Result<(), MovieError> {
        if self.added < self.settings.frames {
            let (added, frames) = (self.added, self.settings.frames);
            return Err(MovieError::Unfit(format!("the film has {added} of its {frames} frames")));
        }
        self.writer.finish(None)
    }

    /// Ends a partial film of the frames so far, if there are any, and moves it to `path`, where it replaces an
    /// existing file. Returns the number of frames. The standard output, devices and pipes keep their target.
    ///
    /// # Errors
    /// [`MovieError`] if it can't be written.
    pub fn finish_part(self, path: &Path) -> Result<u32, MovieError> {
        if self.added > 0 {
            self.writer.finish(Some(Part { frames: self.added, path }))?;
        }
        Ok(self.added)
    }

    /// The temporary path of the film, which remains if the program is killed meanwhile.
    pub fn temporary(&self) -> Option<&Path> {
        self.writer.temporary()
    }
}

/// The smallest rectangle outside of which two pictures are equal; a single pixel if they are equal everywhere.
fn changed(old: &[u8], new: &[u8], [width, height]: [u32; 2], pixel: usize) -> Area {
    if old.len() != new.len() {
        return Area { left: 0, top: 0, width, height };
    }
    let stride = width as usize * pixel;
    let rows = || old.chunks_exact(stride).zip(new.chunks_exact(stride));
    let Some(top) = rows().position(|(a, b)| a != b) else { return Area { left: 0, top: 0, width: 1, height: 1 } };
    let bottom = height as usize - rows().rev().position(|(a, b)| a != b).unwrap_or(0);
    let (mut left, mut right) = (width as usize, 0);
    for (a, b) in rows().skip(top).take(bottom - top) {
        if let Some(first) = a.iter().zip(b).position(|(a, b)| a != b) {
            left = left.min(first / pixel);
            let last = a.iter().zip(b).rposition(|(a, b)| a != b).unwrap_or(first);
            right = right.max(last / pixel + 1);
        }
    }
    Area { left: left as u32, top: top as u32, width: (right - left) as u32, height: (bottom - top) as u32 }
}

impl Area {
    /// The bytes of this rectangle of a picture that is `width` pixels of so many bytes wide.
    fn cut(self, pixels: &[u8], width: u32, pixel: usize) -> Vec<u8> {
        let stride = width as usize * pixel;
        let (from, to) = (self.left as usize * pixel, (self.left + self.width) as usize * pixel);
        let rows = pixels.chunks_exact(stride).skip(self.top as usize).take(self.height as usize);
        rows.flat_map(|row| &row[from..to]).copied().collect()
    }
}

#[cfg(test)]
mod tests;
