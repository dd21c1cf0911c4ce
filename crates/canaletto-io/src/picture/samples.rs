//! The samples of a picture in a file, from which a render goes on.
//!
//! The means of blocks of samples are exact in an EXR of 32-bit floats. If each pixel has a single block, the picture
//! itself is its mean. Else there are the layers of `SampleBlocks::layers`.

use super::Decoded;
use super::channels::channel_name;
use canaletto::film::{BLOCK_LAYERS, SampleBlocks, block_sizes};
use canaletto::math::Rgb;
use canaletto::scene::Sampling;

/// The key of a file's text for the number of samples of each pixel, or for the fewest and the most of them.
pub const SAMPLES_TEXT: &str = "samples";

/// The reasons why a file has no samples to go on with.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplesError {
    /// The values aren't linear light in 32-bit floats.
    #[error("its colours are rounded; only an EXR of 32 bits holds what samples add up to")]
    Rounded,
    /// The file doesn't say how many samples its pixels have.
    #[error("it doesn't say how many samples its pixels have; pictures by paths that this program wrote do")]
    NoCount,
    /// A channel is missing.
    #[error("it has no channel {0}, which holds a part of its samples")]
    NoChannel(String),
    /// A number of samples, or a colour, is none.
    #[error("pixel {0}, {1} has no valid {2}")]
    Invalid(u32, u32, &'static str),
}

/// The samples of a picture that was read, from number `first` on.
///
/// # Errors
/// [`SamplesError`] if they aren't all there.
pub fn read_samples(decoded: &Decoded, first: u32) -> Result<SampleBlocks, SamplesError> {
    if decoded.display_referred || decoded.bits != 32 {
        return Err(SamplesError::Rounded);
    }
    let image = &decoded.image;
    let place = |pixel: usize| (pixel as u32 % image.width, pixel as u32 / image.width);
    let invalid = |pixel: usize, what| {
        let (x, y) = place(pixel);
        SamplesError::Invalid(x, y, what)
    };
    let pixels = image.width as usize * image.height as usize;
    let most = Sampling::MAX_SAMPLES - first.min(Sampling::MAX_SAMPLES);
    let counts: Vec<u32> = match image.channel(&channel_name("samples", "X")) {
        Some(counts) => {
            let is_count = |count: f32| count >= 0.0 && count <= most as f32 && count.fract() == 0.0;
            if let Some(pixel) = counts.iter().position(|count| !is_count(*count)) {
                return Err(invalid(pixel, "number of samples"));
            }
            counts.iter().map(|count| *count as u32).collect()
        }
        None => {
            let text = decoded.metadata.iter().find(|(key, _)| key == SAMPLES_TEXT);
            let count = text.and_then(|(_, text)| text.parse::<u32>().ok()).filter(|count| *count <= most);
            vec![count.ok_or(SamplesError::NoCount)?; pixels]
        }
    };
    let channels = |layer: &str| -> Result<[&[f32]; 3], SamplesError> {
        let of = |channel: &str| {
            let name = if layer.is_empty() { channel.to_owned() } else { channel_name(layer, channel) };
            image.channel(&name).ok_or(SamplesError::NoChannel(name))
        };
        Ok([of("R")?, of("G")?, of("B")?])
    };
    let blocks = |count: u32| block_sizes(first, first + count).count();
    let most_blocks = counts.iter().map(|count| blocks(*count)).max().unwrap_or(0);
    let layers = match most_blocks {
        0 | 1 => vec![channels("")?],
        _ => BLOCK_LAYERS[..most_blocks].iter().map(|layer| channels(layer)).collect::<Result<_, _>>()?,
    };
    let color = |layer: &[&[f32]; 3], pixel: usize| Rgb::from(layer.map(|channel| channel[pixel]));
    for (pixel, count) in counts.iter().enumerate() {
        if layers.iter().take(blocks(*count)).any(|layer| !color(layer, pixel).is_finite()) {
            return Err(invalid(pixel, "colour"));
        }
    }
    let mean = |pixel: usize, block: usize| color(&layers[block], pixel);
    let size = [image.width, image.height];
    let both = channels("half-a").and_then(|a| Ok([a, channels("half-b")?]));
    Ok(match both {
        Ok(halves) if most_blocks <= 1 => {
            let halves = |pixel: usize| halves.map(|half| color(&half, pixel));
            SampleBlocks::of(size, first, &counts, mean, Some(&halves))
        }
        _ => SampleBlocks::of(size, first, &counts, mean, None),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{EncodeSettings, PictureFormat, Rendered, decode};
    use canaletto::film::Picture;
    use canaletto::scene::FilmSettings;

    fn file(samples: &SampleBlocks, bits: Option<u8>) -> Vec<u8> {
        let [width, height] = samples.size();
        let mut picture = Picture::new(width, height);
        for (pixel, color) in picture.pixels.iter_mut().enumerate() {
            *color = samples.mean(pixel);
        }
        picture.layers = samples.layers();
        let rendered = Rendered { picture: &picture, film: &FilmSettings::default() };
        let settings = EncodeSettings { bits, ..EncodeSettings::default() };
        let texts: &[_] = match samples.counts() {
            [first, rest @ ..] if rest.iter().all(|count| count == first) => {
                &[(SAMPLES_TEXT.into(), first.to_string())]
            }
            _ => &[],
        };
        PictureFormat::Exr.encode(&rendered, &settings, texts, &|| true).unwrap()
    }

    fn samples(counts: &[u32]) -> SampleBlocks {
        let mean = |pixel: usize, block: usize| Rgb::new(pixel as f32 * 0.1, block as f32 + 0.3, 1.0 / 3.0);
        SampleBlocks::of([2, counts.len() as u32 / 2], 0, counts, mean, None)
    }

    #[test]
    fn samples_come_back_from_a_file() {
        for counts in [[64; 4], [96; 4], [64, 7, 0, 100], [1, 2, 4, 65_536]] {
            let samples = samples(&counts);
            let bytes = file(&samples, None);
            assert!(read_samples(&decode(&bytes).unwrap(), 0).unwrap() == samples, "{counts:?}");
        }
        assert!(samples(&[64; 4]).layers().is_empty());
    }

    #[test]
    fn files_without_samples_are_refused_with_their_reason() {
        let of = |decoded: &Decoded| read_samples(decoded, 0).unwrap_err().to_string();
        assert!(of(&decode(&file(&samples(&[64; 4]), Some(16))).unwrap()).contains("rounded"));
        let whole = decode(&file(&samples(&[3, 64, 64, 64]), None)).unwrap();
        let mut none = whole.clone();
        none.image.channels.retain(|channel| channel.name != "samples.X");
        assert!(of(&none).contains("how many"));
        let mut none = whole.clone();
        none.image.channels.retain(|channel| channel.name != "block_2.G");
        assert!(of(&none).contains("block_2.G"));
        for (name, value, word) in
            [("samples.X", 0.5, "number"), ("samples.X", -1.0, "number"), ("block_1.R", f32::NAN, "colour")]
        {
            let mut wrong = whole.clone();
            wrong.image.channels.iter_mut().find(|channel| channel.name == name).unwrap().data[2] = value;
            let error = of(&wrong);
            assert!(error.contains("pixel 0, 1") && error.contains(word), "{error}");
        }
    }
}
