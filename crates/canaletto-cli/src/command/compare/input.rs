//! The input pictures of a comparison.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::picture_file::read_picture;
use crate::settings::list;
use crate::told_developing::ToldDeveloping;
use canaletto::film::{Developer, Picture, srgb_encode};
use canaletto::math::Rgb;
use canaletto::scene::{Developing, Exposure, Tone, Transfer};
use canaletto::texture::srgb_decode;
use canaletto_io::diagnostic::closest_word;
use canaletto_io::picture::{Decoded, Image};
use std::path::Path;

/// A picture from a file.
pub(in crate::command) struct Input {
    pub(in crate::command) decoded: Decoded,
    /// Whether the values are those of a layer that holds no colours.
    pub(in crate::command) is_raw: bool,
}

/// Reads a picture and chooses the layer to compare: its own colours, or its only layer.
pub(in crate::command) fn read(path: &Path, layer: Option<&str>) -> Result<Input, Failure> {
    let decoded = read_picture(path)?;
    let layer = match layer {
        None if decoded.image.rgb().is_some() => return Ok(Input { decoded, is_raw: false }),
        None => decoded.main_layer().ok_or_else(|| no_colors(path, &decoded))?,
        Some(layer) => layer.to_owned(),
    };
    let is_raw = decoded.image.channel(&format!("{layer}.R")).is_none();
    let layers = decoded.layers();
    let decoded = decoded.with_layer(&layer).ok_or_else(|| no_layer(path, &layer, &layers))?;
    Ok(Input { decoded, is_raw })
}

fn no_colors(path: &Path, decoded: &Decoded) -> Failure {
    let names: Vec<&str> = decoded.image.channels.iter().map(|channel| channel.name.as_str()).collect();
    let message = format!("{} has no channels R G B or Y; it has {}", path.display(), list(&names));
    Failure::new(Exit::Scene, message).help(
        "choose what is compared with --layer NAME: the part of a channel before its last point, or all of one without",
    )
}

fn no_layer(path: &Path, layer: &str, layers: &[String]) -> Failure {
    let names: Vec<&str> = layers.iter().map(String::as_str).collect();
    let failure = Failure::new(Exit::Scene, format!("{} has no layer \"{layer}\"", path.display()));
    match closest_word(layer, names.iter().copied()) {
        Some(near) => failure.help(format!("did you mean \"{near}\"?")),
        None => failure.help(format!("its layers are: {}", list(&names))),
    }
}

impl Input {
    /// The transfer curve of a PNG, if the file declares one. PNGs of this program always do.
    pub(in crate::command) fn curve(&self) -> Option<Transfer> {
        if !self.decoded.display_referred {
            return None;
        }
        ToldDeveloping::of_texts(&self.decoded.metadata).transfer.or(self.decoded.transfer)
    }

    /// The largest value that a PNG holds.
    pub(in crate::command) fn steps(&self) -> Option<f32> {
        self.decoded.display_referred.then_some(if self.decoded.bits > 8 { 65535.0 } else { 255.0 })
    }

    /// How a PNG of this program was developed before its transfer curve.
    pub(in crate::command) fn exposure_and_tone(&self) -> Option<(Exposure, Tone)> {
        let told = ToldDeveloping::of_texts(&self.decoded.metadata);
        told.exposure.zip(told.tone).filter(|_| self.decoded.display_referred)
    }

    /// The picture for display. An EXR is developed, and rounded to the bits of the PNG that it is compared with.
    pub(in crate::command) fn seen(&self, developing: &Developing, steps: Option<f32>) -> Image {
        let image = self.decoded.image.clone();
        if self.decoded.display_referred {
            return image;
        }
        // Display values aren't multiplied by alpha, as in a PNG.
        let image = image.unpremultiplied();
        let image = if (developing.exposure, developing.tone) == (Exposure::default(), Tone::Clamp) {
            image
        } else {
            toned(image, developing)
        };
        image.map_color(|v| {
            let v = if v.is_nan() { v } else { v.clamp(0.0, 1.0) };
            let v = if developing.transfer == Transfer::Srgb { srgb_encode(v) } else { v };
            steps.map_or(v, |steps| (v * steps).round() / steps)
        })
    }

    /// The picture in linear light.
    pub(in crate::command) fn linear(self, curve: Transfer) -> Image {
        let Decoded { image, display_referred, .. } = self.decoded;
        match display_referred {
            false => image,
            // Linear light is multiplied by alpha, as in an EXR.
            true if curve == Transfer::None => image.premultiplied(),
            true => image.map_color(srgb_decode).premultiplied(),
        }
    }
}

/// An image in linear light with its exposure and tone. NaN stays, so that a comparison finds it.
fn toned(image: Image, developing: &Developing) -> Image {
    let Some([r, g, b]) = image.rgb() else { return image };
    let pixels: Vec<Rgb> = (0..r.len()).map(|i| Rgb::new(r[i], g[i], b[i])).collect();
    let picture = Picture { pixels, ..Picture::new(image.width, image.height) };
    let developer = Developer::new(&picture, developing);
    let mut colors: Vec<[f32; 3]> = picture.pixels.iter().map(|color| color.to_array()).collect();
    developer.tone(&mut colors);
    for (color, linear) in colors.iter_mut().zip(&picture.pixels) {
        for (value, linear) in color.iter_mut().zip(linear.to_array()) {
            if linear.is_nan() {
                *value = linear;
            }
        }
    }
    let others = image.channels.into_iter().filter(|c| !["R", "G", "B", "Y"].contains(&c.name.as_str()));
    let mut shown = Image::from_rgb(picture.width, picture.height, colors.into_iter());
    shown.channels.extend(others);
    shown
}
