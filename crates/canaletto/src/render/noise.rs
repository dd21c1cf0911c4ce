//! The error of a picture, estimated while it is made, by which pixels get more samples or none (after Dammertz,
//! Hanika, Keller & Lensch, *A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination*, 2010).
//!
//! The halves of a pixel's samples estimate the same light, so half their difference is an estimate of the error of
//! their mean. One such number says little. Cells of 8 × 8 pixels take the mean square over all pixels and components.
//! Its root, relative to the cell's brightness, is the relative error of the cell.
//!
//! The mean square is an estimate, too. Where few pixels hold most of it, it is often too small. Its standard error
//! over the pixels of the cell is therefore added before the root is taken.
//!
//! Light that is rarely found makes no error before it is found. Three rules answer this. No cell stops before it has
//! [`NoiseEstimate::LEAST_SAMPLES`] samples. It goes on as long as one of its eight neighbours is too noisy. A cell
//! that has stopped goes on again when that becomes true. So a cell rests on the samples of 24 × 24 pixels, 36,864 at
//! least.

use crate::film::{NoisiestPixels, SamplesLeft};
use crate::math::Rgb;

/// The error of each cell.
#[derive(Clone, Debug)]
pub(super) struct NoiseEstimate {
    size: [u32; 2],
    /// The largest relative error that is asked for.
    limit: f32,
    /// The sum of the components of each pixel, and the sum of their squared errors.
    light: Vec<f32>,
    squares: Vec<f32>,
    /// The relative error of each cell with its uncertainty, in rows from the upper left.
    errors: Vec<f32>,
    /// The brightness to which the error of each cell is relative.
    scales: Vec<f64>,
    /// Whether a cell needs more samples.
    needed: Vec<bool>,
}

impl NoiseEstimate {
    /// The number of samples of each pixel before its error is believed.
    pub(super) const LEAST_SAMPLES: u32 = 64;
    /// The side of a cell in pixels.
    const CELL: u32 = 8;
    /// The brightness that counts at least, as a share of that of the picture's middle cell. What is darker is seen
    /// beside brighter parts, not by itself.
    const DARKEST: f64 = 0.1;

    pub(super) fn new(size: [u32; 2], limit: f32) -> NoiseEstimate {
        let pixels = size[0] as usize * size[1] as usize;
        let cells = size.map(|side| side.div_ceil(Self::CELL) as usize);
        let cells = cells[0] * cells[1];
        NoiseEstimate {
            size,
            limit,
            light: vec![0.0; pixels],
            squares: vec![0.0; pixels],
            errors: vec![f32::INFINITY; cells],
            scales: vec![0.0; cells],
            needed: vec![true; cells],
        }
    }

    /// The cell of a pixel in a picture of this width.
    pub(super) fn cell_of([x, y]: [u32; 2], width: u32) -> usize {
        (y / Self::CELL * width.div_ceil(Self::CELL) + x / Self::CELL) as usize
    }

    /// Sets the mean of a pixel's samples and the means of their halves. Unknown halves are NaN.
    pub(super) fn set(&mut self, pixel: usize, mean: Rgb, halves: [Rgb; 2]) {
        let square = |a: f32, b: f32| 0.25 * (a - b) * (a - b);
        let [a, b] = halves;
        self.light[pixel] = mean.r + mean.g + mean.b;
        self.squares[pixel] = square(a.r, b.r) + square(a.g, b.g) + square(a.b, b.b);
    }

    /// Takes up a decision about the cells. Returns the number of pixels that need more samples, or none if the
    /// decision is one about another number of cells.
    pub(super) fn resume(&mut self, needed: &[bool]) -> Option<u64> {
        if needed.len() != self.needed.len() {
            return None;
        }
        self.needed.copy_from_slice(needed);
        let [width, height] = self.size;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        Some(pixels.filter(|pixel| needed[Self::cell_of(*pixel, width)]).count() as u64)
    }

    /// Whether each cell needs more samples.
    pub(super) fn needed(&self) -> &[bool] {
        &self.needed
    }

    /// The largest relative error of a cell; infinite if one is unknown.
    pub(super) fn largest(&self) -> f32 {
        self.errors.iter().fold(0.0, |most, error| if *error <= most { most } else { error.max(most) })
    }

    /// The number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.squares.len()
    }

    /// The fewest pixels that hold half of the noise, by their places after `origin`. None while nothing is known.
    pub(super) fn noisiest(&self, origin: [u32; 2]) -> Option<NoisiestPixels> {
        /// The most pixels that are listed.
        const MOST_LISTED: usize = 256;
        let [width, _] = self.size;
        let place = |pixel: usize| [pixel as u32 % width, pixel as u32 / width];
        let noise = |pixel: usize| {
            let scale = self.scales[Self::cell_of(place(pixel), width)];
            let noise = f64::from(self.squares[pixel]) / (scale * scale);
            if noise.is_finite() { noise } else { 0.0 }
        };
        let mut noisy: Vec<(f64, usize)> =
            (0..self.pixels()).map(|i| (noise(i), i)).filter(|(v, _)| *v > 0.0).collect();
        noisy.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let all: f64 = noisy.iter().map(|(noise, _)| noise).sum();
        if noisy.is_empty() {
            return None;
        }
        let (mut sum, mut number) = (0.0, 0);
        while sum < 0.5 * all && number < noisy.len() {
            sum += noisy[number].0;
            number += 1;
        }
        let places = noisy[..number.min(MOST_LISTED)].iter().map(|(noise, pixel)| {
            let [x, y] = place(*pixel);
            ([origin[0] + x, origin[1] + y], noise / all)
        });
        let pixels = number as f64 / self.pixels() as f64;
        Some(NoisiestPixels { pixels, noise: sum / all, places: places.collect() })
    }

    /// The samples that are left, of pixels that have `counts` and get at most `end`. Each cell needs what the noisiest
    /// of its neighbours needs, n (error / limit)² samples instead of n. None while no error is known.
    pub(super) fn samples_left(&self, counts: &[u32], end: u32) -> Option<SamplesLeft> {
        let [across, down] = self.size.map(|side| side.div_ceil(Self::CELL));
        let mut cells = vec![(0.0f64, 0.0f64); self.errors.len()];
        for (pixel, count) in counts.iter().enumerate() {
            let place = [pixel as u32 % self.size[0], pixel as u32 / self.size[0]];
            let (pixels, samples) = &mut cells[Self::cell_of(place, self.size[0])];
            *pixels += 1.0;
            *samples += f64::from(*count);
        }
        let needed = |x: u32, y: u32| {
            let cell = (y * across + x) as usize;
            let ratio = f64::from(self.errors[cell] / self.limit);
            let count = cells[cell].1 / cells[cell].0;
            (count * (ratio * ratio).max(1.0)).max(f64::from(Self::LEAST_SAMPLES))
        };
        let (mut made, mut left, mut most) = (0.0, 0.0, 0.0f64);
        for y in 0..down {
            for x in 0..across {
                let rows = y.saturating_sub(1)..(y + 2).min(down);
                let around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(across)).map(move |x| [x, y]));
                let needed = around.map(|[x, y]| needed(x, y)).filter(|n| n.is_finite()).fold(0.0, f64::max);
                let (pixels, samples) = cells[(y * across + x) as usize];
                made += samples;
                left += (pixels * needed.min(f64::from(end)) - samples).max(0.0);
                most = most.max(needed);
            }
        }
        let is_known = self.errors.iter().any(|error| error.is_finite());
        is_known.then_some(SamplesLeft { made, left, most, is_out_of_reach: most > f64::from(end) })
    }

    /// Decides which cells need more than `count` samples. Returns the number of their pixels.
    pub(super) fn judge(&mut self, count: u32) -> u64 {
        let [across, down] = self.size.map(|side| side.div_ceil(Self::CELL));
        let mut sums = Vec::with_capacity(self.errors.len());
        for y in 0..down {
            for x in 0..across {
                let (mut light, mut squares, mut fourths, mut pixels) = (0.0f64, 0.0f64, 0.0f64, 0u32);
                for row in y * Self::CELL..((y + 1) * Self::CELL).min(self.size[1]) {
                    for column in x * Self::CELL..((x + 1) * Self::CELL).min(self.size[0]) {
                        let pixel = row as usize * self.size[0] as usize + column as usize;
                        light += f64::from(self.light[pixel]);
                        let square = f64::from(self.squares[pixel]);
                        squares += square;
                        fourths += square * square;
                        pixels += 1;
                    }
                }
                let components = 3.0 * f64::from(pixels);
                // The standard error of the sum, by the scatter of the pixels.
                let standard_error = (fourths - squares * squares / f64::from(pixels)).max(0.0).sqrt();
                sums.push((light / components, ((squares + standard_error) / components).sqrt(), pixels));
            }
        }
        let mut lights: Vec<f64> = sums.iter().map(|(light, ..)| *light).filter(|light| *light > 0.0).collect();
        lights.sort_unstable_by(f64::total_cmp);
        let darkest = lights.get(lights.len() / 2).map_or(0.0, |middle| middle * Self::DARKEST);
        for ((error, scale), (light, deviation, _)) in self.errors.iter_mut().zip(&mut self.scales).zip(&sums) {
            *scale = light.max(darkest);
            *error = if *deviation == 0.0 { 0.0 } else { (deviation / light.max(darkest)) as f32 };
        }
        // An unknown error is no number, and so not small enough.
        let is_noisy = |x: u32, y: u32| {
            let error = self.errors[(y * across + x) as usize];
            error.is_nan() || error > self.limit
        };
        let mut pixels = 0;
        for y in 0..down {
            for x in 0..across {
                let rows = y.saturating_sub(1)..(y + 2).min(down);
                let is_needed = count < Self::LEAST_SAMPLES
                    || rows
                        .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(across)).map(move |x| [x, y]))
                        .any(|[x, y]| is_noisy(x, y));
                let cell = (y * across + x) as usize;
                self.needed[cell] = is_needed;
                pixels += if is_needed { u64::from(sums[cell].2) } else { 0 };
            }
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 3 × 3 cells of brightness 1, with one pixel whose halves differ by `difference`.
    fn estimate(limit: f32, difference: f32) -> NoiseEstimate {
        let mut noise = NoiseEstimate::new([20, 20], limit);
        for pixel in 0..400 {
            noise.set(pixel, Rgb::WHITE, [Rgb::WHITE; 2]);
        }
        noise.set(0, Rgb::WHITE, [Rgb::WHITE, Rgb::gray(1.0 + difference)]);
        noise
    }

    #[test]
    fn a_noisy_cell_keeps_its_neighbours_at_work() {
        // The mean of (difference / 2)² over 64 pixels is 1, and its standard error nearly 1.
        let mut noise = estimate(0.1, 16.0);
        assert_eq!(noise.judge(64), 16 * 16);
        let exact = (1.0 + (63.0f64 / 64.0).sqrt()).sqrt() as f32;
        assert!((noise.largest() - exact).abs() < 1e-6);
        assert_eq!(noise.needed, [true, true, false, true, true, false, false, false, false]);
        assert_eq!(estimate(1.01 * exact, 16.0).judge(64), 0);
        assert_eq!(estimate(0.99 * exact, 16.0).judge(64), 16 * 16);
    }

    /// One pixel with all noise, and the samples that it asks for: 4 times those of an error twice as large.
    #[test]
    fn the_noisiest_pixels_and_the_samples_left() {
        let mut noise = estimate(0.1, 16.0);
        noise.judge(64);
        let noisiest = noise.noisiest([100, 50]).unwrap();
        assert_eq!((noisiest.pixels, noisiest.noise), (1.0 / 400.0, 1.0));
        assert_eq!(noisiest.places, [([100, 50], 1.0)]);
        let limit = noise.largest() / 2.0;
        let mut noise = estimate(limit, 16.0);
        noise.judge(64);
        let left = noise.samples_left(&[64; 400], 1 << 20).unwrap();
        assert!((left.most - 256.0).abs() < 1e-3 && !left.is_out_of_reach, "{left:?}");
        // The cell and its three neighbours, of 16 × 16 pixels.
        assert!((left.left - 256.0 * 192.0).abs() < 1.0 && left.made == 400.0 * 64.0, "{left:?}");
        let short = noise.samples_left(&[64; 400], 128).unwrap();
        assert!((short.left - 256.0 * 64.0).abs() < 1.0 && short.is_out_of_reach, "{short:?}");
        // Even noise: half of it is in half of the pixels.
        let mut even = NoiseEstimate::new([16, 16], 0.1);
        (0..256).for_each(|pixel| even.set(pixel, Rgb::WHITE, [Rgb::gray(0.5), Rgb::gray(1.5)]));
        even.judge(64);
        assert_eq!(even.noisiest([0, 0]).map(|noisiest| noisiest.pixels), Some(0.5));
        assert_eq!(NoiseEstimate::new([16, 16], 0.1).noisiest([0, 0]), None);
    }

    #[test]
    fn no_cell_stops_before_it_has_samples_and_known_halves() {
        assert_eq!(estimate(0.1, 0.0).judge(NoiseEstimate::LEAST_SAMPLES - 1), 400);
        assert_eq!(estimate(0.1, 0.0).judge(NoiseEstimate::LEAST_SAMPLES), 0);
        assert_eq!(estimate(0.1, f32::NAN).judge(1000), 16 * 16);
    }

    #[test]
    fn dark_cells_count_by_the_middle_of_the_picture() {
        let mut noise = estimate(0.1, 0.0);
        for row in 0..8 {
            for column in 0..8 {
                noise.set(row * 20 + column, Rgb::gray(1e-6), [Rgb::BLACK, Rgb::gray(2e-6)]);
            }
        }
        assert_eq!(noise.judge(64), 0);
        assert!((noise.largest() - 1e-5).abs() < 1e-9);
    }
}
