//! Joining parts, a band of rows after the other, so that memory doesn't grow with the number of parts.

use super::{PartFile, failed, meet, rows, why};
use crate::denoiser::FEATURES;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::part::{Cut, layers_of_texts};
use canaletto::Named;
use canaletto::film::{Layer, Picture, SampleBlocks};
use canaletto::math::Rgb;
use canaletto::render::Aov;
use canaletto_io::picture::{PixelHash, SAMPLES_TEXT, SamplesError, ScanLineError, layer_channel_names, read_samples};
use canaletto_parallel::prelude::*;
use std::ops::Range;

/// What the parts make.
pub(super) struct Made {
    pub(super) samples: SampleBlocks,
    /// The colours where not all samples are there.
    pub(super) colors: Option<Vec<Rgb>>,
    pub(super) features: Vec<Layer>,
    /// The share of all samples that is there.
    pub(super) share: f64,
}

/// Rows of what the parts make.
struct Band {
    rows: [u32; 2],
    samples: SampleBlocks,
    /// The sums of the colours of all samples, and their number.
    sums: Vec<[f64; 4]>,
    features: Vec<Layer>,
    /// The hashes of the parts' pixels, by the parts' numbers.
    hashes: Vec<(usize, PixelHash)>,
}

/// The number of rows of a band: those of a compressed block, or more where the picture is narrow.
const ROWS: u32 = 16;
const PIXELS: u32 = 1 << 15;

/// Joins the parts to `whole`, in the order of their samples.
pub(super) fn join(parts: &[PartFile], whole: Cut, is_partial: bool) -> Result<Made, Failure> {
    let [_, top, width, height] = whole.area;
    let pixels = width as usize * height as usize;
    let all = pixels as f64 * f64::from(whole.samples[1] - whole.samples[0]);
    let there = |part: &PartFile| {
        let [_, _, width, height] = part.cut.area;
        f64::from(width) * f64::from(height) * f64::from(part.cut.samples[1] - part.cut.samples[0])
    };
    let share = parts.iter().map(there).sum::<f64>() / all;
    let has_colors = is_partial && share < 1.0;
    // All parts tell of the same layers.
    let mut aovs = parts.first().map_or_else(Vec::new, |part| layers_of_texts(&part.texts));
    aovs.extend(FEATURES.into_iter().filter(|aov| !aovs.contains(aov)).collect::<Vec<_>>());
    let mut made: Option<Made> = None;
    let mut hashes = vec![PixelHash::default(); parts.len()];
    for bands in bands(parts, whole).chunks(2 * rayon::current_num_threads()) {
        let bands: Vec<Result<Band, Failure>> =
            bands.par_iter().map(|rows| Band::join(parts, whole, *rows, (&aovs, has_colors))).collect();
        for band in bands {
            let band = band?;
            for (part, hash) in &band.hashes {
                hashes[*part] = hashes[*part].with(*hash);
            }
            let made = made.get_or_insert_with(|| Made {
                samples: SampleBlocks::new([width, height], whole.samples[0], band.samples.keeps_halves()),
                colors: has_colors.then(|| Vec::with_capacity(pixels)),
                features: Vec::new(),
                share,
            });
            made.samples.merge(&band.samples, [0, band.rows[0] - top]);
            made.colors.iter_mut().for_each(|colors| colors.extend(band.sums.iter().map(mean)));
            made.add_features(band.features, pixels, (band.rows[0] - top) as usize * width as usize);
        }
    }
    for (part, hash) in parts.iter().zip(hashes) {
        if part.file.is_changed(hash) {
            return Err(changed(part));
        }
    }
    made.ok_or_else(|| Failure::new(Exit::PartMissing, "there is no part"))
}

fn changed(part: &PartFile) -> Failure {
    failed(part.path, Exit::PartChanged, "its pixels aren't those that were written")
        .help("copy it again, or render this part again")
}

fn mean([r, g, b, count]: &[f64; 4]) -> Rgb {
    if *count > 0.0 { [r, g, b].map(|sum| (sum / count) as f32).into() } else { Rgb::BLACK }
}

/// The rows of `whole` in bands. No part begins or ends within one, so few blocks of rows are unpacked twice.
fn bands(parts: &[PartFile], whole: Cut) -> Vec<[u32; 2]> {
    let [top, bottom] = rows(&whole);
    let mut edges: Vec<u32> = parts.iter().flat_map(|part| rows(&part.cut)).chain([top, bottom]).collect();
    edges.sort_unstable();
    edges.dedup();
    let step = (PIXELS / whole.area[2]).max(1).next_multiple_of(ROWS);
    let cut = |[from, to]: [u32; 2]| {
        (from..to).step_by(step as usize).map(move |start| [start, start.saturating_add(step).min(to)])
    };
    edges.windows(2).flat_map(|pair| cut([pair[0], pair[1]])).collect()
}

impl Band {
    /// Joins the rows of a band. Some of `aovs` are layers of the parts.
    fn join(
        parts: &[PartFile],
        whole: Cut,
        band: [u32; 2],
        (aovs, has_colors): (&[Aov], bool),
    ) -> Result<Band, Failure> {
        let [left, _, width, _] = whole.area;
        let height = band[1] - band[0];
        let pixels = width as usize * height as usize;
        let mut samples: Option<SampleBlocks> = None;
        let mut sums = vec![[0.0; 4]; if has_colors { pixels } else { 0 }];
        let mut features: Vec<Layer> = Vec::new();
        let mut hashes = Vec::new();
        for (number, part) in parts.iter().enumerate().filter(|(_, part)| meet(rows(&part.cut), band)) {
            let [x, y, own_width, _] = part.cut.area;
            let unreadable = |message: &str| failed(part.path, Exit::PartUnreadable, message);
            // What changed bytes lead to is told as their change.
            let wrong = |message: &str| if is_changed(part) { changed(part) } else { unreadable(message) };
            let mut read = part.file.read(band[0] - y..band[1] - y).map_err(|error| unreadable(&why(&error)))?;
            hashes.push((number, read.hash));
            let count = part.cut.samples[1] - part.cut.samples[0];
            read.decoded.metadata = vec![(SAMPLES_TEXT.to_owned(), count.to_string())];
            let blocks = read_samples(&read.decoded, part.cut.samples[0]).map_err(|error| match error {
                SamplesError::Invalid(x, row, what) => {
                    wrong(&SamplesError::Invalid(x, row + band[0] - y, what).to_string())
                }
                other => wrong(&other.to_string()),
            })?;
            let place = |pixel: usize| {
                let [row, column] = [pixel / own_width as usize, pixel % own_width as usize];
                row * width as usize + (x - left) as usize + column
            };
            let own: Range<usize> = 0..blocks.counts().len();
            if has_colors {
                for pixel in own.clone() {
                    let count = f64::from(blocks.counts()[pixel]);
                    let color = blocks.mean(pixel).to_array().map(f64::from);
                    let sum = &mut sums[place(pixel)];
                    (0..3).for_each(|i| sum[i] += count * color[i]);
                    sum[3] += count;
                }
            }
            let all = samples
                .get_or_insert_with(|| SampleBlocks::new([width, height], whole.samples[0], blocks.keeps_halves()));
            if !all.merge(&blocks, [x - left, 0]) && !has_colors {
                return Err(wrong("its samples don't follow those of the parts before it"));
            }
            let channels = &read.decoded.image.channels;
            for aov in aovs {
                let channel = |name: String| channels.iter().find(|channel| channel.name == name);
                let Some(channels) = layer_channel_names(*aov).map(channel).collect::<Option<Vec<_>>>() else {
                    continue;
                };
                let layer = layer(&mut features, *aov, pixels);
                for pixel in own.clone() {
                    let to = place(pixel) * channels.len();
                    (0..channels.len()).for_each(|i| layer.data[to + i] = channels[i].data[pixel]);
                }
                if let [channel] = *channels
                    && !channel.ids.is_empty()
                {
                    layer.ids.resize(pixels, 0);
                    own.clone().for_each(|pixel| layer.ids[place(pixel)] = channel.ids[pixel]);
                }
            }
        }
        let samples = samples.unwrap_or_else(|| SampleBlocks::new([width, height], whole.samples[0], false));
        Ok(Band { rows: band, samples, sums, features, hashes })
    }
}

/// Whether the pixels of a part aren't those that were written.
fn is_changed(part: &PartFile) -> bool {
    let hash = || {
        let height = part.cut.area[3];
        let mut hash = PixelHash::default();
        for row in (0..height).step_by(ROWS as usize) {
            hash = hash.with(part.file.read(row..(row + ROWS).min(height))?.hash);
        }
        Ok::<_, ScanLineError>(hash)
    };
    hash().is_ok_and(|hash| part.file.is_changed(hash))
}

/// The layer of a feature, made when it is missing.
fn layer(layers: &mut Vec<Layer>, aov: Aov, pixels: usize) -> &mut Layer {
    let place = layers.iter().position(|layer| layer.name == aov.name()).unwrap_or_else(|| {
        layers.push(Layer::new(aov.name(), aov.channels(), vec![0.0; pixels * aov.channels().len()]));
        layers.len() - 1
    });
    &mut layers[place]
}

impl Made {
    /// Adds the features of a band, which begins at this pixel of `pixels`.
    fn add_features(&mut self, features: Vec<Layer>, pixels: usize, start: usize) {
        for feature in features {
            let Some(aov) = Aov::from_name(feature.name) else { continue };
            let layer = layer(&mut self.features, aov, pixels);
            let place = start * aov.channels().len();
            layer.data[place..place + feature.data.len()].copy_from_slice(&feature.data);
            if !feature.ids.is_empty() {
                layer.ids.resize(pixels, 0);
                layer.ids[start..start + feature.ids.len()].copy_from_slice(&feature.ids);
            }
        }
    }

    /// A layer of the whole, if the parts tell it. `picture` is the noisy picture.
    pub(super) fn layer(&self, aov: Aov, picture: &Picture) -> Option<Layer> {
        let colors = |color: &dyn Fn(usize) -> Rgb| {
            let data = (0..picture.pixels.len()).flat_map(|pixel| color(pixel).to_array()).collect();
            Some(Layer::new(aov.name(), aov.channels(), data))
        };
        let half = |half: usize| {
            let is_told = self.samples.keeps_halves() && self.colors.is_none();
            is_told.then(|| colors(&|pixel| self.samples.half_means(pixel).unwrap_or_default()[half]))?
        };
        match aov {
            Aov::HalfA => half(0),
            Aov::HalfB => half(1),
            Aov::Noisy => colors(&|pixel| picture.pixels[pixel]),
            Aov::Samples => {
                let data = self.samples.counts().iter().map(|count| *count as f32).collect();
                Some(Layer::new(aov.name(), aov.channels(), data))
            }
            _ => self.features.iter().find(|layer| layer.name == aov.name()).cloned(),
        }
    }
}
