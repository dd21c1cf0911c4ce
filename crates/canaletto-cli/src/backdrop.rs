//! What a picture is laid over: a colour, a gradient or another picture, as they look on a screen.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use canaletto::film::{Developer, Picture};
use canaletto::math::Rgb;
use canaletto::render::Job;
use canaletto::scene::{Developing, Exposure, Tone};
use canaletto::texture::srgb_decode;
use canaletto::world::World;
use canaletto_io::picture::{Decoded, decode};
use canaletto_io::text::color;
use std::fs;
use std::path::{Path, PathBuf};

/// The value of --background.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BackgroundFlag {
    /// A transparent one.
    None,
    /// That of the scene.
    Scene,
    /// Something that the picture is laid over.
    Backdrop(BackdropFlag),
}

/// What a picture is laid over, as it was given.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BackdropFlag {
    /// The word as given.
    pub(crate) word: String,
    kind: BackdropKind,
}

#[derive(Clone, Debug, PartialEq)]
enum BackdropKind {
    /// Colours from the top to the bottom as display values with the sRGB curve; one for a plain backdrop.
    Colors(Vec<Rgb>),
    File(PathBuf),
}

/// The parser of --background.
pub(crate) fn background(text: &str) -> Result<BackgroundFlag, String> {
    let kind = match text {
        "none" => return Ok(BackgroundFlag::None),
        "scene" => return Ok(BackgroundFlag::Scene),
        _ => match text.split(',').map(|word| color(word.trim())).collect::<Option<Vec<Rgb>>>() {
            Some(colors) => BackdropKind::Colors(colors),
            None if Path::new(text).extension().is_some() => BackdropKind::File(text.into()),
            None => {
                return Err(
                    "write none, scene, a colour such as #ffffff, two or more from the top to the bottom such \
                            as '#fff,#9ab', or a picture's file"
                        .into(),
                );
            }
        },
    };
    Ok(BackgroundFlag::Backdrop(BackdropFlag { word: text.to_owned(), kind }))
}

/// What a picture is laid over, in linear light as a screen shows it.
#[derive(Clone, Debug)]
pub(crate) enum Backdrop {
    /// Linear colours from the top to the bottom.
    Colors(Vec<Rgb>),
    /// A picture that covers the whole of the rendered one. What is too wide or too high is cut off at both sides.
    Picture(Picture),
}

impl BackgroundFlag {
    /// What the picture is laid over.
    pub(crate) fn backdrop(&self) -> Option<&BackdropFlag> {
        if let BackgroundFlag::Backdrop(flag) = self { Some(flag) } else { None }
    }

    /// The file that is read.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        if let BackdropKind::File(file) = &self.backdrop()?.kind { Some(file) } else { None }
    }
}

impl BackdropFlag {
    /// Reads the backdrop.
    pub(crate) fn load(&self) -> Result<Backdrop, Failure> {
        let file = match &self.kind {
            BackdropKind::Colors(colors) => return Ok(Backdrop::Colors(colors.clone())),
            BackdropKind::File(file) => file,
        };
        let failed = |why: &str| Failure::new(Exit::Scene, format!("--background {}: {why}", file.display()));
        let bytes = fs::read(file).map_err(|error| failed(&reason(&error)))?;
        let Decoded { image, display_referred, .. } = decode(&bytes).map_err(|error| failed(&error.to_string()))?;
        let [r, g, b] = image.rgb().ok_or_else(|| failed("it has no colours"))?;
        let linear = |v: f32| if display_referred { srgb_decode(v) } else { v.clamp(0.0, 1.0) };
        let pixels = (0..r.len()).map(|i| Rgb::new(r[i], g[i], b[i]).map(linear)).collect();
        Ok(Backdrop::Picture(Picture { pixels, ..Picture::new(image.width, image.height) }))
    }
}

/// What becomes of a rendered picture before it is written.
#[derive(Clone, Copy)]
pub(crate) struct Finish<'a> {
    pub world: &'a World,
    pub backdrop: Option<&'a Backdrop>,
    /// Whether the file holds light of any range.
    pub is_linear: bool,
}

impl Finish<'_> {
    /// Finishes a denoised picture; returns how it is developed. `is_complete`: all its pixels are rendered.
    pub(crate) fn apply(&self, picture: &mut Picture, job: &Job, is_complete: bool) -> Developing {
        if let Some(background) = self.world.shadow_background() {
            picture.separate_shadow(background, is_complete);
        }
        match self.backdrop.filter(|_| !picture.alpha.is_empty()) {
            Some(backdrop) => backdrop.lay_under(picture, job, self.is_linear),
            None => job.developing(),
        }
    }
}

impl Backdrop {
    /// Lays a picture with an alpha over the backdrop. It has none afterwards, and is developed as the result says.
    /// `is_linear`: it keeps its light, as linear files do. Else its tones are those of the screen already, so that the
    /// backdrop keeps its colours.
    fn lay_under(&self, picture: &mut Picture, job: &Job, is_linear: bool) -> Developing {
        let developing = job.developing();
        let developer = Developer::new(picture, &developing);
        let mut under = self.colors(job);
        for (i, under) in under.iter_mut().enumerate() {
            *under = match is_linear {
                true => picture.pixels[i] + *under * (1.0 - picture.opacity(i)),
                false => developer.over(picture, i, *under),
            };
        }
        picture.pixels = under;
        (picture.alpha, picture.shadow) = (Vec::new(), Vec::new());
        if is_linear {
            return developing;
        }
        Developing { exposure: Exposure::Stops(0.0), tone: Tone::Clamp, ..developing }
    }

    /// The colours under the pixels of the job's window.
    fn colors(&self, job: &Job) -> Vec<Rgb> {
        let ([left, top, width, height], size) = (job.window(), job.camera.size());
        match self {
            Backdrop::Colors(colors) => {
                let row = |y: u32| vec![gradient(colors, (f64::from(y) + 0.5) / f64::from(size[1])); width as usize];
                (top..top + height).flat_map(row).collect()
            }
            Backdrop::Picture(picture) => covering(picture, size, [left, top, width, height]),
        }
    }
}

/// The linear colour at a place from 0 (the top) to 1 of linear colours that are mixed as display values.
fn gradient(colors: &[Rgb], place: f64) -> Rgb {
    let at = place * (colors.len() - 1) as f64;
    let first = (at as usize).min(colors.len() - 1);
    let (from, to) = (colors[first], colors[(first + 1).min(colors.len() - 1)]);
    if from == to {
        return from;
    }
    let encode = |color: Rgb| color.map(canaletto::film::srgb_encode);
    (encode(from) + (encode(to) - encode(from)) * (at - first as f64) as f32).map(srgb_decode)
}

/// A window of a picture that is scaled to cover another size. Each pixel is the mean of the area that it covers.
fn covering(picture: &Picture, size: [u32; 2], [left, top, width, height]: [u32; 4]) -> Vec<Rgb> {
    let own = [picture.width, picture.height].map(f64::from);
    let [w, h] = size.map(f64::from);
    let step = (own[0] / w).min(own[1] / h);
    let begin = [(own[0] - step * w) / 2.0, (own[1] - step * h) / 2.0];
    let shares = |from: u32, count: u32, begin: f64, most: u32| -> Vec<Vec<(usize, f32)>> {
        (from..from + count).map(|at| covered(begin + step * f64::from(at), step, most)).collect()
    };
    let columns = shares(left, width, begin[0], picture.width);
    let rows = shares(top, height, begin[1], picture.height);
    let pixel = |row: &[(usize, f32)], column: &[(usize, f32)]| {
        let mut sum = Rgb::BLACK;
        for &(y, share) in row {
            for &(x, other) in column {
                sum += picture.pixels[y * picture.width as usize + x] * (share * other);
            }
        }
        sum
    };
    rows.iter().flat_map(|row| columns.iter().map(move |column| pixel(row, column))).collect()
}

/// The texels from `begin` on that an interval of a length covers, with their shares. An interval shorter than a texel
/// mixes the two whose centres are nearest.
fn covered(begin: f64, length: f64, most: u32) -> Vec<(usize, f32)> {
    let (from, to) = match length < 1.0 {
        true => (begin + 0.5 * length - 0.5, begin + 0.5 * length + 0.5),
        false => (begin, begin + length),
    };
    let texels = from.floor() as i64..to.ceil() as i64;
    let share = |texel: i64| (to.min(texel as f64 + 1.0) - from.max(texel as f64)) / (to - from);
    texels.map(|texel| (texel.clamp(0, i64::from(most) - 1) as usize, share(texel) as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_colors_gradients_and_files() {
        assert_eq!(background("none"), Ok(BackgroundFlag::None));
        assert_eq!(background("scene"), Ok(BackgroundFlag::Scene));
        let kind = |text: &str| match background(text) {
            Ok(BackgroundFlag::Backdrop(flag)) => flag.kind,
            other => panic!("{other:?}"),
        };
        assert_eq!(kind("#fff"), BackdropKind::Colors(vec![Rgb::WHITE]));
        assert_eq!(kind("#fff, #000"), BackdropKind::Colors(vec![Rgb::WHITE, Rgb::BLACK]));
        assert_eq!(kind("beach,2.jpg"), BackdropKind::File("beach,2.jpg".into()));
        assert!(background("nothing").is_err_and(|why| why.contains("#ffffff")));
    }

    #[test]
    fn a_gradient_goes_from_the_top_to_the_bottom() {
        let colors = [Rgb::WHITE, Rgb::BLACK, Rgb::WHITE];
        assert_eq!(gradient(&colors, 0.0), Rgb::WHITE);
        assert_eq!(gradient(&colors, 0.5), Rgb::BLACK);
        assert_eq!(gradient(&colors, 1.0), Rgb::WHITE);
        assert!((gradient(&colors, 0.25).r - srgb_decode(0.5)).abs() < 1e-6);
        assert_eq!(gradient(&colors[..1], 0.7), Rgb::WHITE);
    }

    /// A picture twice as wide as the other one loses both sides. Its mean stays at smaller sizes.
    #[test]
    fn a_backdrop_covers_the_picture() {
        let mut picture = Picture::new(8, 4);
        picture.pixels = (0..32).map(|i| Rgb::gray((i % 8) as f32)).collect();
        let same = covering(&picture, [4, 4], [0, 0, 4, 4]);
        assert_eq!(same[..4], [2.0, 3.0, 4.0, 5.0].map(Rgb::gray));
        let half = covering(&picture, [2, 2], [0, 0, 2, 2]);
        assert_eq!(half[..2], [2.5, 4.5].map(Rgb::gray));
        let large = covering(&picture, [8, 8], [0, 0, 8, 8]);
        assert!((large[3].r - 3.25).abs() < 1e-6, "{large:?}");
        assert_eq!(covering(&picture, [8, 8], [3, 2, 1, 1]), [large[3]]);
    }
}
