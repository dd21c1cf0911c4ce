//! A sheet of pictures of one size, in rows of three, with lines of text below each.

use crate::legend::{INK, MARGIN, PAPER, wrapped};
use canaletto_io::picture::{CHARACTER_WIDTH, Canvas, Image, LINE_HEIGHT};

/// A picture with the lines below it.
pub(super) struct Cell<'a> {
    /// The picture, in display values.
    pub(super) image: &'a Image,
    pub(super) lines: [String; 3],
}

const COLUMNS: u32 = 3;

/// The least number of characters in a line. Narrower pictures have paper beside them.
const LEAST_CHARACTERS: u32 = 26;

/// The sheet in display values.
pub(super) fn sheet(cells: &[Cell]) -> Image {
    let (width, height) = cells.first().map_or((0, 0), |cell| (cell.image.width, cell.image.height));
    let scale = (width / 400).clamp(1, 8);
    let (character, margin) = (CHARACTER_WIDTH * scale, MARGIN * scale);
    let cell_width = width.max(LEAST_CHARACTERS * character);
    let characters = (cell_width / character) as usize;
    let texts: Vec<Vec<String>> =
        cells.iter().map(|cell| cell.lines.iter().flat_map(|line| wrapped(line, characters)).collect()).collect();
    let lines = texts.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let cell_height = height + 2 * margin + lines * LINE_HEIGHT * scale;
    let rows = (cells.len() as u32).div_ceil(COLUMNS);
    let mut canvas = Canvas::new(margin + COLUMNS * (cell_width + margin), margin + rows * cell_height, PAPER);
    for (index, (cell, text)) in (0..).zip(cells.iter().zip(&texts)) {
        let [left, top] = [margin + index % COLUMNS * (cell_width + margin), margin + index / COLUMNS * cell_height];
        draw(&mut canvas, [left, top], cell.image);
        for (line, text) in (0..).zip(text) {
            canvas.write(text, [left, top + height + margin + line * LINE_HEIGHT * scale], scale, INK);
        }
    }
    canvas.into_image()
}

fn draw(canvas: &mut Canvas, [left, top]: [u32; 2], image: &Image) {
    let Some([r, g, b]) = image.rgb() else { return };
    for index in 0..r.len() {
        let (x, y) = (index as u32 % image.width, index as u32 / image.width);
        canvas.set([left + x, top + y], [r[index], g[index], b[index]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_rows_of_three() {
        let gray = |v: f32| Image::from_rgb(200, 100, std::iter::repeat_n([v; 3], 20_000));
        let images = [gray(0.2), gray(0.4), gray(0.6), gray(0.8)];
        let cell = |image| Cell { image, lines: ["name".into(), "term".into(), String::new()] };
        let sheet = sheet(&images.iter().map(cell).collect::<Vec<_>>());
        let cell_height = 100 + 2 * MARGIN + 3 * LINE_HEIGHT;
        assert_eq!((sheet.width, sheet.height), (MARGIN + 3 * (200 + MARGIN), MARGIN + 2 * cell_height));
        let at = |x: u32, y: u32| sheet.channel("R").unwrap()[(y * sheet.width + x) as usize];
        let middle =
            |column: u32, row: u32| at(MARGIN + column * (200 + MARGIN) + 100, MARGIN + row * cell_height + 50);
        assert_eq!([middle(0, 0), middle(1, 0), middle(2, 0), middle(0, 1)], [0.2, 0.4, 0.6, 0.8]);
        assert_eq!(middle(1, 1), PAPER[0]);
    }
}
