//! A picture by each half of its samples, for what needs to know the error of pixels.

use super::Picture;
use crate::math::Rgb;

/// Two pictures of the same light by equal numbers of other samples, in rows from the upper left. Their mean is the
/// picture. The squared difference of a pixel, divided by 4, estimates the variance of the picture there. In pictures
/// by Sobol's sequence the variance is smaller than that where light is smooth.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfBuffers {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The colours by the first and by the second half of the samples.
    pub halves: [Vec<Rgb>; 2],
    /// The number of samples of each pixel in both halves together. A single sample is in both.
    pub samples: Vec<u32>,
}

impl HalfBuffers {
    /// The halves of a picture that has the layers `half-a`, `half-b` and `samples`.
    pub fn of(picture: &Picture) -> Option<HalfBuffers> {
        let colors = |name| {
            let values = picture.layer(name)?.data.chunks_exact(3);
            Some(values.map(|v| Rgb::new(v[0], v[1], v[2])).collect())
        };
        let samples = picture.layer("samples")?.data.iter().map(|count| *count as u32).collect();
        let halves = [colors("half-a")?, colors("half-b")?];
        Some(HalfBuffers { width: picture.width, height: picture.height, halves, samples })
    }

    /// The estimated variance of a pixel's mean, for each component.
    pub fn variance(&self, pixel: usize) -> Rgb {
        let [a, b] = [self.halves[0][pixel], self.halves[1][pixel]];
        let square = |a: f32, b: f32| 0.25 * (a - b) * (a - b);
        Rgb::new(square(a.r, b.r), square(a.g, b.g), square(a.b, b.b))
    }
}
