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
    /// What a clamp or more samples would change, once a render in passes has ended.
    pub outlook: Option<NoiseOutlook>,
    /// The sum of all components of all samples of this run, and how much of it the clamp removed.
    light: f64,
    removed: f64,
    /// The sum of the squares of these components, and the number of these samples.
    squares: f64,
    checked: u64,
    /// How much of `light` and of `squares` a clamp at [`SampleStatistics::TRIED_CLAMP`] would remove.
    bright: [f64; 2],
}

/// What is left of a picture's noise: where it is, how long it would take, and what a clamp would change.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct NoiseOutlook {
    /// The pixels with the most noise, if the halves of samples tell it.
    pub noisiest: Option<NoisiestPixels>,
    /// How many samples are left, if an error is asked for and known.
    pub left: Option<SamplesLeft>,
    /// What a clamp at [`SampleStatistics::TRIED_CLAMP`] would remove, if nothing is clamped.
    pub clamp: Option<ClampOutlook>,
}

/// The fewest pixels that hold half of a picture's noise. Noise is the square error relative to the light of the
/// pixel's block.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NoisiestPixels {
    /// Their share of all pixels, 0 to 1.
    pub pixels: f64,
    /// Their share of the noise, 0.5 or a little more.
    pub noise: f64,
    /// The noisiest of them with the share of each, at most 256, in falling order.
    pub places: Vec<([u32; 2], f64)>,
}

/// The samples that are left, where the error falls as the root of their number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SamplesLeft {
    /// The number of samples of all pixels that have been made.
    pub made: f64,
    /// The number that is left.
    pub left: f64,
    /// The number of samples of the pixels that need the most.
    pub most: f64,
    /// Whether the most samples that a pixel gets are too few for the error that is asked for.
    pub is_out_of_reach: bool,
}

/// What a clamp would remove.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClampOutlook {
    /// The share of the light, 0 to 1.
    pub light: f64,
    /// The share of the samples' variance, 0 to 1.
    pub noise: f64,
}

impl SampleStatistics {
    /// The clamp whose effect is told before anybody asks for it.
    pub const TRIED_CLAMP: f32 = 10.0;

    /// What a clamp would remove of samples that aren't clamped. `mean_squares` are the squares of the components of a
    /// pixel's mean, averaged over all samples: the variance is what the samples' own squares have more.
    pub(crate) fn clamp_outlook(&self, mean_squares: f64) -> Option<ClampOutlook> {
        let [light, squared] = self.bright;
        let variance = self.squares - mean_squares * self.checked as f64;
        let share = |part: f64, whole: f64| if part > 0.0 && whole > 0.0 { (part / whole).min(1.0) } else { 0.0 };
        (self.light > 0.0).then(|| ClampOutlook { light: share(light, self.light), noise: share(squared, variance) })
    }

    /// The share of the light of this run's samples that the clamp removed, 0 to 1.
    pub fn removed_share(&self) -> f64 {
        if self.light > 0.0 { self.removed / self.light } else { 0.0 }
    }

    /// Checks samples of a pixel, whose first has number `first`. Those that aren't finite become black. Those with a
    /// component above the clamp become darker, without a change of hue.
    #[inline]
    pub(crate) fn check(&mut self, colors: &mut [Rgb], clamp: Option<f32>, [x, y]: [u32; 2], first: u32) {
        self.checked += colors.len() as u64;
        for (sample, color) in (first..).zip(colors) {
            let [r, g, b] = color.to_array().map(f32::abs);
            // Integrators replace infinite light by the largest number.
            if !(r < f32::MAX && g < f32::MAX && b < f32::MAX) {
                self.list(SamplePlace { sample, y, x });
                *color = Rgb::BLACK;
            }
            let [light, largest] =
                [f64::from(color.r) + f64::from(color.g) + f64::from(color.b), color.max_component().into()];
            let most = clamp.unwrap_or(Self::TRIED_CLAMP);
            let square: f64 = color.to_array().map(|v| f64::from(v) * f64::from(v)).iter().sum();
            self.light += light;
            self.squares += square;
            let is_brighter = largest > f64::from(most);
            let rest = if is_brighter { f64::from(most) / largest } else { 1.0 };
            if is_brighter && clamp.is_none() {
                self.bright[0] += light * (1.0 - rest);
                self.bright[1] += square * (1.0 - rest * rest);
            } else if is_brighter {
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
        self.squares += other.squares;
        self.checked += other.checked;
        for (own, other) in self.bright.iter_mut().zip(other.bright) {
            *own += other;
        }
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

    /// Samples stay as they are, and what a clamp would remove is that which the clamp removes.
    #[test]
    fn a_clamp_is_told_before_it_is_asked_for() {
        let samples = [Rgb::new(40.0, 4.0, 0.0), Rgb::gray(1.0), Rgb::gray(2.0), Rgb::gray(20.0)];
        let (mut tried, mut clamped) = (SampleStatistics::default(), SampleStatistics::default());
        let mut colors = samples;
        tried.check(&mut colors, None, [0, 0], 0);
        assert_eq!(colors, samples);
        clamped.check(&mut colors, Some(SampleStatistics::TRIED_CLAMP), [0, 0], 0);
        let squares = |colors: &[Rgb]| colors.iter().flat_map(|c| c.to_array()).map(|v| f64::from(v * v)).sum::<f64>();
        // A black mean leaves the squares as the variance.
        let outlook = tried.clamp_outlook(0.0).unwrap();
        assert!((outlook.light - clamped.removed_share()).abs() < 1e-12, "{outlook:?}");
        let removed = 1.0 - squares(&colors) / squares(&samples);
        assert!((outlook.noise - removed).abs() < 1e-6, "{outlook:?}, not {removed}");
        assert_eq!(SampleStatistics::default().clamp_outlook(0.0), None);
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
