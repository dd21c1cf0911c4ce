//! Planes of numbers for whole pictures, and windows of them with a margin, so that kernels need no bounds.
//!
//! Filters work on strips of rows, and within a strip on parts of a few hundred pixels. A part copies what it reads
//! into windows. So whole planes exist only of what one step hands to the next, and memory doesn't grow with the number
//! of layers that a step reads.

use canaletto_parallel::prelude::*;

/// Sums of a larger radius run on. What was large in a running sum leaves a rest, so small ones don't.
const MOST_SUMMED: usize = 4;

/// One number for each pixel of a picture, the top row first.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) size: [usize; 2],
    pub(super) values: Vec<f32>,
}

/// Red, green and blue.
pub(super) type ColorPlanes = [Plane; 3];

impl Plane {
    /// A plane of zeros.
    pub(super) fn new(size: [usize; 2]) -> Plane {
        Plane { size, values: vec![0.0; size[0] * size[1]] }
    }

    /// A plane of the values of each pixel's index.
    pub(super) fn of(size: [usize; 2], value: impl Fn(usize) -> f32 + Sync) -> Plane {
        let mut plane = Plane::new(size);
        plane.fill(value);
        plane
    }

    /// Sets the value of each pixel by its index.
    pub(super) fn fill(&mut self, value: impl Fn(usize) -> f32 + Sync) {
        let width = self.size[0];
        let rows = self.values.par_chunks_mut(width).enumerate();
        rows.for_each(|(y, row)| row.iter_mut().enumerate().for_each(|(x, v)| *v = value(y * width + x)));
    }

    /// The value of a pixel.
    #[cfg(test)]
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.size[0] + x]
    }

    /// The sum of all values, in a fixed order.
    pub(super) fn total(&self) -> f64 {
        self.values.iter().map(|v| f64::from(*v)).sum()
    }

    /// The sums over squares of side 2 `radius` + 1, of the pixels inside the picture.
    pub(super) fn box_sum(&self, radius: usize) -> Plane {
        self.summed(radius, |_| 1.0)
    }

    /// The means over squares of side 2 `radius` + 1, of the pixels inside the picture.
    pub(super) fn box_mean(&self, radius: usize) -> Plane {
        self.summed(radius, |count| 1.0 / count as f32)
    }

    /// Sums along rows and then columns, each scaled by a function of the number of pixels.
    fn summed(&self, radius: usize, scale: impl Fn(usize) -> f32 + Sync) -> Plane {
        if radius > MOST_SUMMED {
            return self.running(radius, scale);
        }
        let [width, height] = self.size;
        let across = Plane::of(self.size, |i| {
            let (x, start) = (i % width, i - i % width);
            let part = &self.values[start + x.saturating_sub(radius)..=start + (x + radius).min(width - 1)];
            part.iter().sum::<f32>() * scale(part.len())
        });
        let mut sum = Plane::new(self.size);
        sum.values.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let (low, high) = (y.saturating_sub(radius), (y + radius).min(height - 1));
            for values in across.values[low * width..(high + 1) * width].chunks_exact(width) {
                row.iter_mut().zip(values).for_each(|(v, add)| *v += add);
            }
            let scale = scale(high - low + 1);
            row.iter_mut().for_each(|v| *v *= scale);
        });
        sum
    }

    /// [`Plane::summed`] for a large radius: sums that run on in f64.
    fn running(&self, radius: usize, scale: impl Fn(usize) -> f32 + Sync) -> Plane {
        let [width, height] = self.size;
        let mut across = Plane::new(self.size);
        let rows = across.values.par_chunks_mut(width).zip(self.values.par_chunks(width));
        rows.for_each(|(row, values)| {
            let mut sum: f64 = values[..radius.min(width)].iter().map(|v| f64::from(*v)).sum();
            for (x, out) in row.iter_mut().enumerate() {
                if x + radius < width {
                    sum += f64::from(values[x + radius]);
                }
                if x > radius {
                    sum -= f64::from(values[x - radius - 1]);
                }
                *out = sum as f32 * scale((x + radius).min(width - 1) - x.saturating_sub(radius) + 1);
            }
        });
        let mut sums = vec![0.0f64; width];
        let mut down = Plane::new(self.size);
        let add = |sums: &mut [f64], y: usize, sign: f64| {
            let values = &across.values[y * width..][..width];
            sums.iter_mut().zip(values).for_each(|(sum, v)| *sum += sign * f64::from(*v));
        };
        (0..radius.min(height)).for_each(|y| add(&mut sums, y, 1.0));
        for y in 0..height {
            if y + radius < height {
                add(&mut sums, y + radius, 1.0);
            }
            if y > radius {
                add(&mut sums, y - radius - 1, -1.0);
            }
            let scale = scale((y + radius).min(height - 1) - y.saturating_sub(radius) + 1);
            down.values[y * width..][..width].iter_mut().zip(&sums).for_each(|(v, sum)| *v = *sum as f32 * scale);
        }
        down
    }
}

/// The rows of some planes that one task writes, from row `top` on.
pub(super) struct Strip<'a, const N: usize> {
    pub(super) top: usize,
    pub(super) rows: [&'a mut [f32]; N],
}

impl<const N: usize> Strip<'_, N> {
    /// The parts of the strip, from left to right.
    pub(super) fn parts(&self, picture: [usize; 2]) -> impl Iterator<Item = Part> + use<N> {
        let (top, height) = (self.top, self.rows[0].len() / picture[0]);
        let columns = (0..picture[0]).step_by(PART_WIDTH);
        columns.map(move |left| Part { picture, at: [left, top], size: [PART_WIDTH.min(picture[0] - left), height] })
    }
}

/// The width of parts.
const PART_WIDTH: usize = 256;
/// The height of strips.
const STRIP_HEIGHT: usize = 32;

/// Cuts planes of one size into strips.
pub(super) fn strips<const N: usize>(planes: [&mut Plane; N]) -> Vec<Strip<'_, N>> {
    let [width, height] = planes[0].size;
    let mut chunks = planes.map(|plane| plane.values.chunks_mut(width * STRIP_HEIGHT));
    let tops = (0..height).step_by(STRIP_HEIGHT);
    tops.map(|top| Strip { top, rows: chunks.each_mut().map(|chunks| chunks.next().unwrap_or_default()) }).collect()
}

/// A rectangle of a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) picture: [usize; 2],
    pub(super) at: [usize; 2],
    pub(super) size: [usize; 2],
}

impl Part {
    /// The index in the picture of a pixel of the part.
    #[inline(always)]
    pub(super) fn index(&self, x: usize, y: usize) -> usize {
        (self.at[1] + y) * self.picture[0] + self.at[0] + x
    }

    /// The place in a strip of the part's height of a row of the part.
    pub(super) fn row(&self, y: usize) -> std::ops::Range<usize> {
        let start = y * self.picture[0] + self.at[0];
        start..start + self.size[0]
    }

    /// Windows of values by the pixel's index, with what lies at most `reach` around the part. Beyond the picture are
    /// zeros.
    pub(super) fn windows<const N: usize>(&self, reach: usize, value: impl Fn(usize) -> [f32; N]) -> [Window; N] {
        let mut windows = [(); N].map(|()| Window::new(self.size, reach));
        let [left, top] = self.at;
        let ends = [0, 1].map(|axis: usize| (self.at[axis] + self.size[axis] + reach).min(self.picture[axis]));
        let starts = [left.saturating_sub(reach), top.saturating_sub(reach)];
        for y in starts[1]..ends[1] {
            let row = (y + reach - top) * windows[0].stride + reach;
            for x in starts[0]..ends[0] {
                let values = value(y * self.picture[0] + x);
                for (window, value) in windows.iter_mut().zip(values) {
                    window.values[row + x - left] = value;
                }
            }
        }
        windows
    }

    /// 1 inside the picture, and 0 beyond.
    pub(super) fn inside(&self, reach: usize) -> Window {
        let [inside] = self.windows(reach, |_| [1.0]);
        inside
    }

    /// [`Part::windows`] with the picture mirrored at its edges.
    pub(super) fn mirrored<const N: usize>(&self, reach: usize, value: impl Fn(usize) -> [f32; N]) -> [Window; N] {
        let folded = |at: isize, length: usize| {
            let last = length as isize - 1;
            let at = if at < 0 { -at } else { at };
            (if at > last { 2 * last - at } else { at }).clamp(0, last) as usize
        };
        let mut windows = [(); N].map(|()| Window::new(self.size, reach));
        let length = self.size.map(|length| length + 2 * reach);
        for y in 0..length[1] {
            let from = folded((self.at[1] + y) as isize - reach as isize, self.picture[1]) * self.picture[0];
            let row = y * windows[0].stride;
            for x in 0..length[0] {
                let values = value(from + folded((self.at[0] + x) as isize - reach as isize, self.picture[0]));
                for (window, value) in windows.iter_mut().zip(values) {
                    window.values[row + x] = value;
                }
            }
        }
        windows
    }
}

/// The number of pixels side by side.
pub(super) const LANES: usize = 16;

/// One number for each of [`LANES`] pixels.
pub(super) type Lanes = [f32; LANES];

/// The values of a part with a margin.
#[derive(Clone, Debug)]
pub(super) struct Window {
    pub(super) size: [usize; 2],
    pub(super) margin: usize,
    pub(super) stride: usize,
    pub(super) values: Vec<f32>,
}

impl Window {
    pub(super) fn new(size: [usize; 2], margin: usize) -> Window {
        // Rows are read in groups of LANES pixels, the last of which may reach beyond the part.
        let stride = size[0].next_multiple_of(LANES) + 2 * margin;
        Window { size, margin, stride, values: vec![0.0; stride * (size[1] + 2 * margin)] }
    }

    /// The index of a pixel of the part.
    #[inline(always)]
    pub(super) fn index(&self, x: usize, y: usize) -> usize {
        (y + self.margin) * self.stride + x + self.margin
    }

    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[self.index(x, y)]
    }

    #[inline(always)]
    pub(super) fn load(&self, index: usize) -> Lanes {
        let mut lanes = [0.0; LANES];
        lanes.copy_from_slice(&self.values[index..index + LANES]);
        lanes
    }

    /// Means over 3 × 3 pixels of those where `inside` is 1, for the part and `reach` around it.
    pub(super) fn means(&self, inside: &Window, reach: usize) -> Window {
        let mut means = Window::new(self.size, self.margin);
        let from = self.margin - reach;
        for y in from..self.size[1] + self.margin + reach {
            for x in from..self.size[0] + self.margin + reach {
                let (mut sum, mut count) = (0.0, 0.0);
                for row in [y - 1, y, y + 1] {
                    for i in row * self.stride + x - 1..=row * self.stride + x + 1 {
                        sum += self.values[i] * inside.values[i];
                        count += inside.values[i];
                    }
                }
                means.values[y * self.stride + x] = if count > 0.0 { sum / count } else { 0.0 };
            }
        }
        means
    }

    /// The value of a pixel and of its neighbours where `inside` is 1.
    pub(super) fn neighbors(&self, inside: &Window, x: usize, y: usize) -> impl Iterator<Item = f32> {
        let center = self.index(x, y) - self.stride - 1;
        let places = [0, 1, 2].map(|row: usize| [0, 1, 2].map(|column: usize| center + row * self.stride + column));
        let places = places.into_iter().flatten();
        places.filter(|i| inside.values[*i] > 0.0).map(|i| self.values[i])
    }
}

/// (1 − e/8)⁸, which is nearly exp(−e) for small e ≥ 0 and ends at 8.
#[inline(always)]
pub(super) fn falloff(e: f32) -> f32 {
    let v = 1.0 - e * 0.125;
    let v = if v > 0.0 { v } else { 0.0 };
    let v = v * v;
    let v = v * v;
    v * v
}
