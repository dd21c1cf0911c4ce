//! How a pixel is made of its samples.

use crate::film::{BlockMean, SampleBlocks, SampleStatistics, WeightedSum, block_sizes};
use crate::job::Job;
use crate::math::Rgb;

/// How a pixel is made of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Summing {
    /// The mean over blocks of samples ([`SampleBlocks`]). Samples are numbered from `first` on.
    Blocks { first: u32, clamp: Option<f32> },
    /// The weighted mean.
    Weights,
}

impl Summing {
    /// The way of a job's pixels.
    pub(super) fn of(job: &Job) -> Summing {
        match job.is_progressive() {
            true => Summing::Blocks { first: job.first_sample, clamp: job.clamp },
            false => Summing::Weights,
        }
    }

    /// The pixel's colour from the colours and weights of its samples.
    pub(super) fn color(self, samples: impl Iterator<Item = (Rgb, f64)>) -> Rgb {
        match self {
            Summing::Weights => {
                let mut sum = WeightedSum::default();
                samples.for_each(|(color, weight)| sum.add(color, weight));
                sum.mean()
            }
            Summing::Blocks { first, clamp } => mean_of_blocks(&mut whole_samples(samples), first, clamp),
        }
    }
}

/// The colours of samples. A rasteriser that shades the corners of triangles makes a sample of several parts, whose
/// weights sum to 1.
fn whole_samples(parts: impl Iterator<Item = (Rgb, f64)>) -> Vec<Rgb> {
    /// Weights are barycentric coordinates, which are rounded.
    const WHOLE: f64 = 1.0 - 1e-6;
    let (mut colors, mut sum) = (Vec::new(), WeightedSum::default());
    for (color, weight) in parts {
        if weight == 1.0 {
            colors.push(color);
            continue;
        }
        sum.add(color, weight);
        if sum.weight() >= WHOLE {
            colors.push(std::mem::take(&mut sum).mean());
        }
    }
    colors
}

/// The mean of samples from number `first` on, as a progressive picture has it.
fn mean_of_blocks(colors: &mut [Rgb], first: u32, clamp: Option<f32>) -> Rgb {
    SampleStatistics::default().check(colors, clamp, [0, 0], first);
    let mut blocks = SampleBlocks::new([1, 1], first, false);
    let mut start = 0;
    for size in block_sizes(first, first + colors.len() as u32) {
        let end = start + size as usize;
        blocks.push(0, size, BlockMean::of_samples(&mut colors[start..end]));
        start = end;
    }
    blocks.mean(0)
}
