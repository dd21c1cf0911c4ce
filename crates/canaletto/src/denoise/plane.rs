//! Planes of numbers with a margin, so that windows around a pixel need no bounds.

use rayon::prelude::*;

/// The width of the margin on each side. No filter reaches farther.
pub(super) const MARGIN: usize = 32;

/// Sums of a larger radius run on. What was large in a running sum leaves a rest, so small ones don't.
const MOST_SUMMED: usize = 4;

/// One number for each pixel of a picture and of the margin around it.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) size: [usize; 2],
    pub(super) stride: usize,
    pub(super) values: Vec<f32>,
}

impl Plane {
    /// A plane of zeros.
    pub(super) fn new(size: [usize; 2]) -> Plane {
        // Rows are read in groups of 16 pixels, the last of which may reach beyond the picture.
        let stride = size[0].next_multiple_of(16) + 2 * MARGIN;
        Plane { size, stride, values: vec![0.0; stride * (size[1] + 2 * MARGIN)] }
    }

    /// A plane of a picture's values, the top row first. The margin is 0.
    pub(super) fn of(size: [usize; 2], value: impl Fn(usize) -> f32 + Sync) -> Plane {
        let mut plane = Plane::new(size);
        plane.fill(|x, y| value(y * size[0] + x));
        plane
    }

    /// Sets all values inside the picture.
    pub(super) fn fill(&mut self, value: impl Fn(usize, usize) -> f32 + Sync) {
        let [width, height] = self.size;
        let rows = self.values.par_chunks_mut(self.stride).skip(MARGIN).take(height).enumerate();
        rows.for_each(|(y, row)| {
            row[MARGIN..MARGIN + width].iter_mut().enumerate().for_each(|(x, v)| *v = value(x, y));
        });
    }

    /// The index of a pixel.
    #[inline(always)]
    pub(super) fn index(&self, x: usize, y: usize) -> usize {
        (y + MARGIN) * self.stride + x + MARGIN
    }

    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[self.index(x, y)]
    }

    /// The plane with the edge's values mirrored into a part of the margin.
    pub(super) fn with_mirrored_margin(mut self, reach: usize) -> Plane {
        let [width, height] = self.size;
        let inside = |at: isize, length: usize| {
            let last = length as isize - 1;
            let folded = if at < 0 {
                -at
            } else if at > last {
                2 * last - at
            } else {
                at
            };
            folded.clamp(0, last) as usize
        };
        let reach = reach as isize;
        let source = self.values.clone();
        for y in -reach..height as isize + reach {
            let from = inside(y, height);
            let row = (y + MARGIN as isize) as usize * self.stride;
            for x in (-reach..0).chain(width as isize..width as isize + reach) {
                self.values[(row as isize + x + MARGIN as isize) as usize] = source[self.index(inside(x, width), from)];
            }
            if from as isize != y {
                let start = self.index(0, from);
                self.values[row + MARGIN..row + MARGIN + width].copy_from_slice(&source[start..start + width]);
            }
        }
        self
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
        let mut across = Plane::new(self.size);
        across.fill(|x, y| {
            let (low, high) = (x.saturating_sub(radius), (x + radius).min(width - 1));
            let start = self.index(low, y);
            let part = &self.values[start..start + high - low + 1];
            part.iter().sum::<f32>() * scale(part.len())
        });
        let mut sum = Plane::new(self.size);
        let rows = sum.values.par_chunks_mut(self.stride).skip(MARGIN).take(height).enumerate();
        rows.for_each(|(y, row)| {
            let (low, high) = (y.saturating_sub(radius), (y + radius).min(height - 1));
            for from in low..=high {
                let start = across.index(0, from);
                let values = &across.values[start..start + width];
                row[MARGIN..MARGIN + width].iter_mut().zip(values).for_each(|(v, add)| *v += add);
            }
            let scale = scale(high - low + 1);
            row[MARGIN..MARGIN + width].iter_mut().for_each(|v| *v *= scale);
        });
        sum
    }

    /// [`Plane::summed`] for a large radius: sums that run on in f64.
    fn running(&self, radius: usize, scale: impl Fn(usize) -> f32 + Sync) -> Plane {
        let [width, height] = self.size;
        let mut across = Plane::new(self.size);
        let rows = across.values.par_chunks_mut(self.stride).skip(MARGIN).take(height).enumerate();
        rows.for_each(|(y, row)| {
            let values = &self.values[self.index(0, y)..][..width];
            let mut sum: f64 = values[..radius.min(width)].iter().map(|v| f64::from(*v)).sum();
            for (x, out) in row[MARGIN..MARGIN + width].iter_mut().enumerate() {
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
            let values = &across.values[across.index(0, y)..][..width];
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
            let start = down.index(0, y);
            down.values[start..start + width].iter_mut().zip(&sums).for_each(|(v, sum)| *v = *sum as f32 * scale);
        }
        down
    }
}

/// Red, green and blue.
pub(super) type ColorPlanes = [Plane; 3];

/// (1 − e/8)⁸, which is nearly exp(−e) for small e ≥ 0 and ends at 8.
#[inline(always)]
pub(super) fn falloff(e: f32) -> f32 {
    let v = 1.0 - e * 0.125;
    let v = if v > 0.0 { v } else { 0.0 };
    let v = v * v;
    let v = v * v;
    v * v
}
