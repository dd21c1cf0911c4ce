//! `--preview`: coarse pictures before the whole one, and the whole one while samples are added to it.

use crate::backdrop::Finish;
use crate::complete::texts;
use crate::failure::{Failure, print_diagnostics};
use crate::flags::{PictureFlags, PictureSize};
use crate::interrupt;
use crate::output::{Output, unfit};
use crate::partial::UNFINISHED;
use crate::progress::Style;
use crate::settings::Settings;
use canaletto::film::Picture;
use canaletto::render::Job;
use canaletto::scene::Scene;
use canaletto_io::diagnostic::Diagnostic;
use canaletto_io::picture::{Compression, EncodeSettings, Rendered, Window};
use std::borrow::Cow;

/// The sides of the blocks of pixels that one ray stands for, in the order of the previews.
const BLOCKS: [u32; 3] = [16, 4, 1];

/// A coarse picture to be rendered.
#[derive(Clone, Debug)]
pub(crate) struct Preview {
    /// A job for a smaller picture with one ray for each pixel.
    pub job: Job,
    /// The side of the blocks that become of its pixels.
    pub block: u32,
}

/// The previews of a picture, the coarsest first. A picture with one ray for each pixel has none of its own size.
pub(crate) fn previews(name: &str, scene: &Scene, flags: &PictureFlags, whole: &Job) -> Vec<Preview> {
    let is_finer = |block: u32| block > 1 || !whole.film.sampling.is_single();
    let jobs = BLOCKS.into_iter().filter(|block| is_finer(*block)).filter_map(|block| {
        let share = PictureSize::Share(1.0 / f64::from(block));
        let coarse = PictureFlags {
            size: Some(PictureSize::Pixels(share.of(whole.camera.size()))),
            crop: whole.film.crop.map(|crop| share.window(crop)),
            samples: Some(1),
            pattern: None,
            ..flags.clone()
        };
        // A window at the edge of a very small picture may lie outside after rounding.
        let job = Settings::new(name, scene, &coarse).ok()?.job;
        Some(Preview { job: Job { tile: whole.tile, ..job }, block })
    });
    jobs.collect()
}

/// The file of pictures in the making.
pub(crate) struct PreviewFile<'a> {
    pub output: &'a Output,
    pub job: &'a Job,
    /// The text entries of the picture's file.
    pub texts: &'a [(String, String)],
    pub window: Window,
    pub finish: Finish<'a>,
}

impl PreviewFile<'_> {
    /// Writes the picture after a pass, when each pixel has `samples` samples or as many as it needs.
    pub(crate) fn write(&self, picture: &Picture, samples: u32) -> Result<(), Failure> {
        self.write_as(picture, format!("a preview with {samples} samples"))
    }

    /// Writes a picture that is no complete one, and why it isn't.
    pub(crate) fn write_as(&self, picture: &Picture, unfinished: String) -> Result<(), Failure> {
        let Some(format) = self.output.format.picture() else { return Ok(()) };
        let mut texts = texts(self.texts, self.job, None);
        texts.push((UNFINISHED.into(), unfinished));
        let settings =
            EncodeSettings { compression: Compression::Fast, window: Some(self.window), ..self.output.settings };
        let mut picture = Cow::Borrowed(picture);
        let developing = match self.finish.changes(&picture) {
            true => self.finish.apply(picture.to_mut(), self.job, true),
            false => self.job.developing(),
        };
        let rendered = Rendered { picture: &picture, developing };
        let bytes = format.encode(&rendered, &settings, &texts, &|| !interrupt::stops()).map_err(|e| unfit(&e))?;
        if interrupt::stops() {
            return Ok(());
        }
        self.output.write(&self.output.path(self.job.frame), &bytes)
    }
}

/// Warns that a picture besides the render's own can't be written. The render goes on without it.
pub(crate) fn warn_unwritten(flag: &str, failure: &Failure, style: Style, is_quiet: bool) {
    // The reader of a pipe may want no more.
    let Failure::Message { message, .. } = failure else { return };
    if !is_quiet {
        let warning = Diagnostic::warning(flag, message).help("the render goes on without these pictures");
        print_diagnostics(&warning.into(), style == Style::Json);
    }
}

/// The picture with each pixel as a block, at a size in pixels.
pub(crate) fn enlarged(picture: &Picture, [width, height]: [u32; 2]) -> Picture {
    let mut large = Picture::new(width, height);
    // The pixel under the centre of another one. The products of two sides fit into 64 bits.
    let nearest =
        |at: u32, from: u32, to: u32| ((2 * u64::from(at) + 1) * u64::from(from) / (2 * u64::from(to))) as u32;
    let rows = large.pixels.chunks_exact_mut(width.max(1) as usize);
    for (y, row) in rows.enumerate() {
        let from = nearest(y as u32, picture.height, height);
        for (x, pixel) in row.iter_mut().enumerate() {
            let from = [nearest(x as u32, picture.width, width), from];
            *pixel = picture.pixel(from[0], from[1]);
            let number = from[1] as usize * picture.width as usize + from[0] as usize;
            large.alpha.extend(picture.alpha.get(number));
            large.shadow.extend(picture.shadow.get(number));
        }
    }
    large
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::math::Rgb;

    #[test]
    fn pixels_become_blocks() {
        let mut small = Picture::new(2, 1);
        small.pixels = vec![Rgb::gray(1.0), Rgb::gray(2.0)];
        let large = enlarged(&small, [5, 2]);
        let row = [1.0, 1.0, 2.0, 2.0, 2.0].map(Rgb::gray);
        assert_eq!(large.pixels, [row, row].concat());
        assert_eq!(enlarged(&small, [2, 1]).pixels, small.pixels);
        assert_eq!(enlarged(&large, [2, 1]).pixels, small.pixels);
    }
}
