//! The channels of a rendered picture in a file: red, green and blue in linear light, alpha if it has one, then those
//! of its layers. Colours are multiplied by alpha, as OpenEXR asks.

use super::{Channel, Image};
use canaletto::Named;
use canaletto::film::Picture;
use canaletto::render::Aov;
use std::ops::Range;

impl Image {
    /// A rendered picture in linear light with all its layers.
    pub fn from_picture(picture: &Picture) -> Image {
        let mut image = Image::from_rgb(picture.width, picture.height, picture.pixels.iter().map(|c| c.to_array()));
        if !picture.alpha.is_empty() {
            let alpha = (0..picture.pixels.len()).map(|i| picture.opacity(i)).collect();
            image.channels.push(Channel::new("A", alpha));
        }
        for layer in &picture.layers {
            let count = layer.channels.len();
            image.channels.extend(layer.channels.iter().enumerate().map(|(index, channel)| Channel {
                name: channel_name(layer.name, channel),
                data: layer.data.iter().skip(index).step_by(count).copied().collect(),
                ids: layer.ids.clone(),
            }));
        }
        image
    }
}

/// The names of the channels of [`Image::from_picture`].
pub(super) fn picture_channels(picture: &Picture) -> impl Iterator<Item = String> {
    names(!picture.alpha.is_empty(), picture.layers.iter().map(|layer| (layer.name, layer.channels)))
}

/// The names of the channels of a picture with these layers, in the order of [`Image::from_picture`].
pub fn channel_names(has_alpha: bool, aovs: &[Aov]) -> Vec<String> {
    names(has_alpha, aovs.iter().map(|aov| (aov.name(), aov.channels()))).collect()
}

/// The names of the channels of a layer.
pub fn layer_channel_names(aov: Aov) -> impl Iterator<Item = String> {
    aov.channels().iter().map(move |channel| channel_name(aov.name(), channel))
}

fn names<'a>(has_alpha: bool, layers: impl Iterator<Item = (&'a str, &'a [&'a str])>) -> impl Iterator<Item = String> {
    let layers = layers.flat_map(|(layer, channels)| channels.iter().map(move |channel| channel_name(layer, channel)));
    let alpha = has_alpha.then_some("A");
    ["R", "G", "B"].into_iter().chain(alpha).map(str::to_owned).chain(layers)
}

pub(super) fn channel_name(layer: &str, channel: &str) -> String {
    // Blender and Nuke accept letters, digits and underscores in a layer's name.
    format!("{}.{channel}", layer.replace('-', "_"))
}

/// Fills `out` with the values of one channel of [`Image::from_picture`], given by index, at a range of pixels.
pub(super) fn fill_channel(picture: &Picture, channel: usize, range: Range<usize>, out: &mut [f32]) {
    let Some(mut left) = channel.checked_sub(3) else {
        return out.iter_mut().zip(&picture.pixels[range]).for_each(|(v, color)| *v = color.to_array()[channel]);
    };
    if !picture.alpha.is_empty() {
        match left.checked_sub(1) {
            None => return out.iter_mut().zip(range).for_each(|(v, i)| *v = picture.opacity(i)),
            Some(after) => left = after,
        }
    }
    for layer in &picture.layers {
        let count = layer.channels.len();
        if left < count {
            let data = layer.data[range.start * count..range.end * count].iter().skip(left).step_by(count);
            return out.iter_mut().zip(data).for_each(|(v, value)| *v = *value);
        }
        left -= count;
    }
}
