//! What is known of the samples of a picture besides its colours: their numbers, those that aren't finite, and what a
//! clamp has removed.

use crate::math::Rgb;

/// The most samples that aren't finite which are listed.
const MOST_LISTED: usize = 16;

/// A sample of a pixel, by its place and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SamplePlace {
    /// The number of the sample in its pixel, from 0 on.
    pub sample: u32,
    /// The row of the pixel from the top.
    pub y: u32,
    /// The column of the pixel.
    pub x: u32,
}

/// Statistics of a picture's samples.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SampleStatistics {
    /// The smallest number of samples of a pixel.
    pub fewest: u32,
    /// The largest number of samples of a pixel.
    pub most: u32,
    /// The number of samples of all pixels.
    pub total: u64,
    /// The largest relative error of a block of pixels ([`crate::render::Job::noise`]), if errors were estimated.
    pub noise: Option<f32>,
    /// The number of samples that were infinite or no numbers. They count as black.
    pub non_finite: u64,
    /// The first of these samples.
    pub non_finite_samples: Vec<SamplePlace>,
    /// The number of samples that the clamp made darker.
    pub clamped: u64,
    /// The sum of all components of all samples of this run, and how much of it the clamp removed.
    light: f64,
    removed: f64,
}

impl SampleStatistics {
    /// The share of the light of this run's samples that the clamp removed, 0 to 1.
    pub fn removed_share(&self) -> f64 {
        if self.light > 0.0 { self.removed / self.light } else { 0.0 }
    }

    /// Checks samples of a pixel, whose first has number `first`. Those that aren't finite become black. Those with a
    /// component above the clamp become darker, without a change of hue.
    #[inline]
    pub(crate) fn check(&mut self, colors: &mut [Rgb], clamp: Option<f32>, [x, y]: [u32; 2], first: u32) {
        for (sample, color) in (first..).zip(colors) {
            let [r, g, b] = color.to_array().map(f32::abs);
            // Integrators replace infinite light by the largest number.
            if !(r < f32::MAX && g < f32::MAX && b < f32::MAX) {
                self.list(SamplePlace { sample, y, x });
                *color = Rgb::BLACK;
            }
            let Some(most) = clamp else { continue };
            let [light, largest] =
                [f64::from(color.r) + f64::from(color.g) + f64::from(color.b), color.max_component().into()];
            self.light += light;
            if largest > f64::from(most) {
                let rest = f64::from(most) / largest;
                *color = color.map(|v| (f64::from(v) * rest) as f32);
                self.removed += light * (1.0 - rest);
                self.clamped += 1;
            }
        }
    }

    #[cold]
    fn list(&mut self, place: SamplePlace) {
        self.non_finite += 1;
        self.non_finite_samples.push(place);
        if self.non_finite_samples.len() > 4 * MOST_LISTED {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        self.non_finite_samples.sort_unstable();
        self.non_finite_samples.truncate(MOST_LISTED);
    }

    /// Adds the statistics of another part of the picture.
    pub(crate) fn add(&mut self, other: &SampleStatistics) {
        self.non_finite += other.non_finite;
        self.non_finite_samples.extend(&other.non_finite_samples);
        self.shorten();
        self.clamped += other.clamped;
        self.light += other.light;
        self.removed += other.removed;
    }

    /// Sets the numbers of samples.
    pub(crate) fn count(&mut self, counts: &[u32]) {
        self.fewest = counts.iter().copied().min().unwrap_or(0);
        self.most = counts.iter().copied().max().unwrap_or(0);
        self.total = counts.iter().map(|count| u64::from(*count)).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_arent_finite_are_listed_and_black() {
        let mut statistics = SampleStatistics::default();
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for (y, v) in (0..).zip(bad) {
            let mut colors = [Rgb::WHITE, Rgb::new(1.0, v, 0.0), Rgb::gray(3e38)];
            statistics.check(&mut colors, None, [5, 3 - y], 64);
            assert_eq!(colors, [Rgb::WHITE, Rgb::BLACK, Rgb::gray(3e38)]);
        }
        let mut all = SampleStatistics::default();
        all.add(&statistics);
        assert_eq!((all.non_finite, all.non_finite_samples.len()), (4, 4));
        assert_eq!(all.non_finite_samples[0], SamplePlace { sample: 65, y: 0, x: 5 });
    }

    #[test]
    fn the_clamp_tells_what_it_removes() {
        let mut statistics = SampleStatistics::default();
        let mut colors = [Rgb::new(8.0, 4.0, 0.0), Rgb::gray(1.0), Rgb::gray(2.0)];
        statistics.check(&mut colors, Some(2.0), [0, 0], 0);
        assert_eq!(colors, [Rgb::new(2.0, 1.0, 0.0), Rgb::gray(1.0), Rgb::gray(2.0)]);
        // 9 of 12 + 3 + 6.
        assert_eq!((statistics.clamped, statistics.removed_share()), (1, 9.0 / 21.0));
    }
}
