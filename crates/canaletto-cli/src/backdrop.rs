//! What a picture is laid over: a colour, a gradient or another picture, as they look on a screen.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::resample::covering;
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
    /// Whether [`Finish::apply`] changes this picture.
    pub(crate) fn changes(&self, picture: &Picture) -> bool {
        !picture.alpha.is_empty() && (self.backdrop.is_some() || self.world.shadow_background().is_some())
    }

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
    let share = (at - first as f64) as f32;
    if from == to || share == 0.0 {
        return from;
    }
    let encode = |color: Rgb| color.map(canaletto::film::srgb_encode);
    (encode(from) + (encode(to) - encode(from)) * share).map(srgb_decode)
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
}
