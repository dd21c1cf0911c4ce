//! The picture of causes: colours over the dimmed reference, and a legend below.

use super::MethodComparison;
use crate::format::count;
use crate::layers::developed;
use crate::legend::{INK, MARGIN, PAPER, wrapped};
use canaletto::Named;
use canaletto::causes::Cause;
use canaletto::film::Picture;
use canaletto::scene::Developing;
use canaletto_io::picture::{CHARACTER_WIDTH, Canvas, Image, LINE_HEIGHT, text_width};

/// The colour of a cause: those of Okabe and Ito (2008), which colour-blind people tell apart, then wine and white.
/// What is unexplained is a colour that nothing else has.
fn color(cause: Cause) -> [f32; 3] {
    let [r, g, b] = match cause {
        Cause::NearFar => [0, 0, 0],
        Cause::Edge => [240, 228, 66],
        Cause::Tessellation => [230, 159, 0],
        Cause::Sampling => [136, 34, 85],
        Cause::TextureFilter => [213, 94, 0],
        Cause::Shadow => [0, 114, 178],
        Cause::Mirror => [86, 180, 233],
        Cause::Refraction => [204, 121, 167],
        Cause::IndirectLight => [0, 158, 115],
        Cause::Several => [255, 255, 255],
        _ => [255, 0, 255],
    };
    [r, g, b].map(|v: u8| f32::from(v) / 255.0)
}

/// The greys of the dimmed reference, from black to white.
const DIMMED: [f32; 2] = [0.2, 0.6];

/// An entry of the legend.
struct Entry {
    cause: Cause,
    text: String,
}

/// The lines below one comparison.
struct Legend {
    title: Vec<String>,
    entries: Vec<Entry>,
}

impl Legend {
    fn new(scene: &str, reference: &str, comparison: &MethodComparison, characters: usize) -> Legend {
        let causes = &comparison.causes;
        let ([width, height], differing) = (causes.size, causes.differing());
        let pixels = u64::from(width) * u64::from(height);
        let scene = scene.rsplit('/').next().unwrap_or(scene);
        let percent = |n: u64| format!("{:.2}%", n as f64 * 100.0 / pixels as f64);
        let title = format!(
            "{scene}, {width} x {height}: {} against {reference}, {} of {} pixels differ, {}",
            comparison.method,
            count(differing),
            count(pixels),
            percent(differing)
        );
        let entries = Cause::ALL.iter().map(|&cause| (cause, causes.count(cause))).filter(|(_, n)| *n > 0);
        let entry = |(cause, n): (Cause, u64)| Entry {
            cause,
            text: format!("{:<14} {:>9} {:>7}", cause.name(), count(n), percent(n)),
        };
        Legend { title: wrapped(&title, characters), entries: entries.map(entry).collect() }
    }

    fn columns(&self, characters: usize) -> usize {
        (characters / ENTRY).clamp(1, self.entries.len().max(1))
    }

    fn lines(&self, characters: usize) -> u32 {
        (self.title.len() + self.entries.len().div_ceil(self.columns(characters))) as u32
    }
}

/// The characters of an entry, with its swatch and a gap.
const ENTRY: usize = 3 + 14 + 1 + 9 + 1 + 7 + 2;

/// The picture of all comparisons, one below the other, in display values. Each has the pixels of the reference at its
/// upper left.
pub(super) fn cause_picture(
    scene: &str,
    reference: &str,
    comparisons: &[MethodComparison],
    picture: &Picture,
    developing: &Developing,
) -> Image {
    let scale = (picture.width / 800).clamp(1, 8);
    let character = CHARACTER_WIDTH * scale;
    let width = picture.width.max(ENTRY as u32 * character + 2 * MARGIN * scale);
    let characters = ((width - 2 * MARGIN * scale) / character) as usize;
    let legends: Vec<Legend> =
        comparisons.iter().map(|comparison| Legend::new(scene, reference, comparison, characters)).collect();
    let strip = |legend: &Legend| (legend.lines(characters) * LINE_HEIGHT + 2 * MARGIN) * scale;
    let height = legends.iter().map(|legend| picture.height + strip(legend)).sum();
    let mut canvas = Canvas::new(width, height, PAPER);
    let image = developed(picture, developing);
    let mut top = 0;
    for (comparison, legend) in comparisons.iter().zip(&legends) {
        draw_pixels(&mut canvas, top, comparison, &image);
        top += picture.height;
        let place = |line: u32, column: u32| {
            [MARGIN * scale + column * ENTRY as u32 * character, top + (MARGIN + line * LINE_HEIGHT) * scale]
        };
        for (line, text) in (0..).zip(&legend.title) {
            canvas.write(text, place(line, 0), scale, INK);
        }
        let columns = legend.columns(characters);
        for (index, entry) in legend.entries.iter().enumerate() {
            let line = (legend.title.len() + index / columns) as u32;
            let [x, y] = place(line, (index % columns) as u32);
            canvas.fill([x, y, 2 * character, 7 * scale], INK);
            canvas.fill([x + scale, y + scale, 2 * character - 2 * scale, 5 * scale], color(entry.cause));
            canvas.write(&entry.text, [x + text_width("   ", scale), y], scale, INK);
        }
        top += strip(legend);
    }
    canvas.into_image()
}

fn draw_pixels(canvas: &mut Canvas, top: u32, comparison: &MethodComparison, image: &Image) {
    let Some([r, g, b]) = image.rgb() else { return };
    for (index, cause) in comparison.causes.pixels.iter().enumerate() {
        // The luma of Rec. 709.
        let luma = 0.2126 * r[index] + 0.7152 * g[index] + 0.0722 * b[index];
        let gray = DIMMED[0] + (DIMMED[1] - DIMMED[0]) * luma;
        let (x, y) = (index as u32 % image.width, index as u32 / image.width);
        canvas.set([x, top + y], cause.map_or([gray; 3], color));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_have_colours_of_their_own() {
        for (index, a) in Cause::ALL.iter().enumerate() {
            assert!(Cause::ALL[..index].iter().all(|b| color(*a) != color(*b)), "{a:?}");
            // The greys of the dimmed reference are none of them.
            let [r, g, b] = color(*a);
            assert!(r != g || g != b || !(DIMMED[0]..=DIMMED[1]).contains(&r), "{a:?}");
        }
    }
}
