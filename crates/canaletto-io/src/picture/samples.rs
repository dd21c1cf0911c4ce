//! The samples of a picture in a file, from which a render goes on.
//!
//! The means of blocks of samples are exact in an EXR of 32-bit floats. If each pixel has a single block, the picture
//! itself is its mean, or the layer `noisy` if it was denoised. Else there are the layers of `SampleBlocks::layers`.

use super::Decoded;
use super::channels::channel_name;
use canaletto::film::{BLOCK_HALF_LAYERS, BLOCK_LAYERS, SampleBlocks, block_count};
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
    let blocks = |count: u32| block_count(first, first + count);
    let most_blocks = counts.iter().map(|count| blocks(*count)).max().unwrap_or(0);
    let noisy = || channels(NOISY).or_else(|_| channels(""));
    let layers = match most_blocks {
        0 | 1 => vec![channels(BLOCK_LAYERS[0]).or_else(|_| noisy())?],
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
    let pair = |[a, b]: [&str; 2]| Ok::<_, SamplesError>([channels(a)?, channels(b)?]);
    let mut halves: Vec<_> = BLOCK_HALF_LAYERS[..most_blocks].iter().map_while(|names| pair(*names).ok()).collect();
    if most_blocks == 1 && halves.is_empty() {
        halves.extend(pair(HALVES));
    }
    let has_halves = halves.len() == most_blocks && most_blocks > 0;
    let of = |pixel: usize, block: usize| halves[block].map(|half| color(&half, pixel));
    Ok(SampleBlocks::of(size, first, &counts, mean, has_halves.then_some(&of as _)))
}

/// The layers of the noisy colours of a denoised picture, and of the halves of all samples.
const NOISY: &str = "noisy";
const HALVES: [&str; 2] = ["half-a", "half-b"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{EncodeSettings, PictureFormat, Rendered, decode};
    use canaletto::film::Picture;
    use canaletto::scene::Developing;

    fn file(samples: &SampleBlocks, bits: Option<u8>) -> Vec<u8> {
        let [width, height] = samples.size();
        let mut picture = Picture::new(width, height);
        for (pixel, color) in picture.pixels.iter_mut().enumerate() {
            *color = samples.mean(pixel);
        }
        picture.layers = [samples.layers(&picture.pixels), samples.half_layers()].concat();
        let rendered = Rendered { picture: &picture, developing: Developing::default() };
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
            let halves =
                |pixel: usize, block: usize| [1.0, 2.0].map(|half| Rgb::gray(half * (pixel * 20 + block) as f32));
            let mean = |pixel, block| halves(pixel, block)[0];
            let samples = SampleBlocks::of([2, 2], 0, &counts, mean, Some(&halves));
            assert!(read_samples(&decode(&file(&samples, None)).unwrap(), 0).unwrap() == samples, "{counts:?}");
        }
    }

    /// A denoised picture isn't the mean of its samples. Their block has a layer, or they are the layer `noisy`.
    #[test]
    fn samples_come_back_from_a_denoised_picture() {
        let samples = samples(&[64; 4]);
        let means: Vec<Rgb> = (0..4).map(|pixel| samples.mean(pixel)).collect();
        assert!(samples.layers(&means).is_empty());
        let denoised = vec![Rgb::gray(0.5); 4];
        let mut noisy = samples.layers(&denoised).remove(0);
        noisy.name = NOISY;
        for layers in [samples.layers(&denoised), vec![noisy]] {
            let picture = Picture { pixels: denoised.clone(), layers, ..Picture::new(2, 2) };
            let rendered = Rendered { picture: &picture, developing: Developing::default() };
            let texts = [(SAMPLES_TEXT.to_owned(), "64".to_owned())];
            let bytes = PictureFormat::Exr.encode(&rendered, &EncodeSettings::default(), &texts, &|| true).unwrap();
            assert!(read_samples(&decode(&bytes).unwrap(), 0).unwrap() == samples);
        }
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
