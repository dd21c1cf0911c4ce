//! `--contact-sheet`: all finished pictures of a command, small and in rows.

use super::{Plan, RenderFlags};
use crate::command::compare;
use crate::command_files::CommandFiles;
use crate::failure::Failure;
use crate::legend::{INK, MARGIN, PAPER};
use crate::output::Output;
use crate::resample::covering;
use crate::told_developing::ToldDeveloping;
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::scene::{Developing, Exposure, Tone, Transfer};
use canaletto_io::picture::{CHARACTER_WIDTH, Canvas, Image, LINE_HEIGHT, PictureFormat};
use std::path::{Path, PathBuf};

/// The largest side of a small picture, for up to this many pictures.
const SIDES: [(usize, u32); 3] = [(200, 256), (2000, 128), (usize::MAX, 64)];

/// The columns of a sheet are this many times its rows.
const ASPECT: f64 = 4.0 / 3.0;

/// A sheet of pictures that are read from their files when all are there.
pub(super) struct ContactSheet {
    output: Output,
    format: PictureFormat,
    /// The names, with the files of pictures that are expected.
    cells: Vec<(String, Option<PathBuf>)>,
}

impl ContactSheet {
    /// The sheet that the flags ask for.
    pub(super) fn new(flags: &RenderFlags) -> Result<Option<ContactSheet>, Failure> {
        let Some(file) = flags.contact_sheet.as_ref().filter(|_| !flags.dry_run) else { return Ok(None) };
        let output = Output::new(&flags.output.for_file(file), "", false, false)?;
        let format = output.format.picture().filter(|_| !output.is_stdout());
        let Some(format) = format else {
            return Err(Failure::usage(format!("--contact-sheet {}: it is a picture's file", file.display()))
                .help("such as --contact-sheet sheet.png"));
        };
        if flags.output.output.as_deref().is_some_and(|output| output == "-") || flags.output.is_film() {
            return Err(Failure::usage("--contact-sheet: it shows pictures that have files of their own"));
        }
        output.check([file.clone()])?;
        Ok(Some(ContactSheet { output, format, cells: Vec::new() }))
    }

    /// The file that is written.
    pub(super) fn files(flags: &RenderFlags) -> CommandFiles {
        CommandFiles::default().writes("--contact-sheet", flags.contact_sheet.clone())
    }

    /// Leaves places for the pictures of a plan.
    pub(super) fn add(&mut self, plan: &Plan) {
        for file in plan.frames.iter().filter_map(|frame| plan.files(frame).into_iter().next()) {
            let name = file.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            self.cells.push((name, Some(file)));
        }
    }

    /// Leaves an empty place for a scene that has no picture.
    pub(super) fn add_missing(&mut self, name: &str) {
        self.cells.push((name.to_owned(), None));
    }

    /// Reads the pictures and writes the sheet. Pictures that aren't there have empty places.
    pub(super) fn write(self) -> Result<(), Failure> {
        let side = SIDES.iter().find(|(most, _)| self.cells.len() <= *most).map_or(64, |(_, side)| *side);
        let cells: Vec<(String, Option<Picture>)> =
            self.cells.into_iter().map(|(name, file)| (name, file.and_then(|file| small(&file, side)))).collect();
        let path = self.output.path(0);
        self.output.write_drawing(&path, self.format, sheet(&cells, side), &[])
    }
}

/// A picture's file, small, as display values over the paper. None if it can't be read.
fn small(file: &Path, side: u32) -> Option<Picture> {
    let input = compare::read(file, None).ok()?;
    let told = ToldDeveloping::of_texts(&input.decoded.metadata);
    let developing = Developing {
        exposure: told.exposure.unwrap_or(Exposure::Stops(0.0)),
        tone: told.tone.unwrap_or(Tone::Clamp),
        transfer: told.transfer.unwrap_or(Transfer::Srgb),
    };
    let image = input.seen(&developing, None);
    let ([r, g, b], alpha) = (image.rgb()?, image.channel("A"));
    let over = |i: usize| {
        let alpha = alpha.map_or(1.0, |alpha| alpha[i]);
        Rgb::new(r[i], g[i], b[i]) * alpha + Rgb::from(PAPER) * (1.0 - alpha)
    };
    let picture = Picture { pixels: (0..r.len()).map(over).collect(), ..Picture::new(image.width, image.height) };
    let scale = (f64::from(side) / f64::from(image.width.max(image.height))).min(1.0);
    let [width, height] = [image.width, image.height].map(|own| ((f64::from(own) * scale).round() as u32).max(1));
    Some(Picture { pixels: covering(&picture, [width, height], [0, 0, width, height]), ..Picture::new(width, height) })
}

/// The sheet in display values.
fn sheet(cells: &[(String, Option<Picture>)], side: u32) -> Image {
    let pictures = || cells.iter().filter_map(|(_, picture)| picture.as_ref());
    let width = pictures().map(|picture| picture.width).max().unwrap_or(side);
    let height = pictures().map(|picture| picture.height).max().unwrap_or(side);
    let [wide, high] = [width + MARGIN, height + LINE_HEIGHT + MARGIN];
    let count = cells.len().max(1) as u32;
    let columns = (f64::from(count) * ASPECT * f64::from(high) / f64::from(wide)).sqrt().round() as u32;
    let columns = columns.clamp(1, count);
    let size = [columns * wide + MARGIN, count.div_ceil(columns) * high + MARGIN];
    let mut canvas = Canvas::new(size[0], size[1], PAPER);
    for (index, (name, picture)) in (0..).zip(cells) {
        let [left, top] = [MARGIN + index % columns * wide, MARGIN + index / columns * high];
        if let Some(picture) = picture {
            let [x, y] = [left + (width - picture.width) / 2, top + (height - picture.height) / 2];
            for (i, color) in (0..).zip(&picture.pixels) {
                canvas.set([x + i % picture.width, y + i / picture.width], color.to_array());
            }
        } else {
            canvas.write("no picture", [left, top + height / 2], 1, INK);
        }
        let most = (width / CHARACTER_WIDTH) as usize;
        canvas.write(&shortened(name, most), [left, top + height + 2], 1, INK);
    }
    canvas.into_image()
}

/// A name of at most this many characters, without its middle if it is longer. Numbers stand at the end.
fn shortened(name: &str, most: usize) -> String {
    let all: Vec<char> = name.chars().collect();
    if all.len() <= most {
        return name.to_owned();
    }
    let kept = most.saturating_sub(2);
    let (start, end) = (kept.div_ceil(2), kept / 2);
    all[..start].iter().copied().chain(['.', '.']).chain(all[all.len() - end..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_rows_with_their_names() {
        let gray = |v: f32, [width, height]: [u32; 2]| {
            let pixels = vec![Rgb::gray(v); (width * height) as usize];
            Some(Picture { pixels, ..Picture::new(width, height) })
        };
        let cells = [("a", gray(0.4, [60, 40])), ("b", None), ("c", gray(0.8, [40, 40])), ("d", gray(0.6, [60, 20]))];
        let drawn = sheet(&cells.map(|(name, picture)| (name.to_owned(), picture)), 64);
        let [wide, high] = [60 + MARGIN, 40 + LINE_HEIGHT + MARGIN];
        assert_eq!([drawn.width, drawn.height], [2 * wide + MARGIN, 2 * high + MARGIN]);
        let at = |x: u32, y: u32| drawn.channel("R").unwrap()[(y * drawn.width + x) as usize];
        let middle = |column: u32, row: u32| at(MARGIN + column * wide + 30, MARGIN + row * high + 10);
        assert_eq!([middle(0, 0), middle(1, 0), middle(0, 1), middle(1, 1)], [0.4, PAPER[0], 0.8, 0.6]);
        assert_eq!([shortened("cake", 4), shortened("birthday-cake.0012", 10)], ["cake", "birt..0012"]);
    }
}
