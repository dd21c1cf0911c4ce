//! Metrics of the difference between two pictures.

use super::{Channel, Image, flip, ssim};

/// The largest difference of two pictures and its position.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Difference {
    /// The pixel's column, from the left.
    pub x: u32,
    /// The pixel's row, from the top.
    pub y: u32,
    /// The channel: `R`, `G` or `B`.
    pub channel: char,
    /// |a − b|.
    pub value: f64,
}

/// The difference of two pictures. Two NaN count as equal; a NaN and a number differ infinitely.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Comparison {
    /// The mean squared error over all pixels and colour channels.
    pub mse: f64,
    /// The root of the mean squared error.
    pub rmse: f64,
    /// 10 log₁₀ (1 / MSE), decibels for values from 0 to 1; infinite for equal pictures.
    pub psnr: f64,
    /// The largest difference; the first one if there are several.
    pub max: Difference,
    /// The number of pixels that differ.
    pub differing: u64,
    /// The mean structural similarity, 1 for equal pictures; `None` for pictures under 11 × 11 pixels.
    pub ssim: Option<f64>,
    /// The mean of LDR-FLIP, from 0 for equal pictures to 1.
    pub flip: f64,
}

/// The reasons why two pictures can't be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unequal {
    /// The sizes differ: width and height of the first, then of the second.
    #[error("the pictures have different sizes: {} × {} and {} × {}", .0[0], .0[1], .0[2], .0[3])]
    Sizes([u32; 4]),
    /// A picture has no colour channels.
    #[error("a picture has neither the channels R G B nor Y")]
    NoColor,
    /// The pictures have no pixels.
    #[error("the pictures have no pixels")]
    Empty,
}

/// Compares the stored colours. MSE and PSNR are computed from the values as they are; SSIM and FLIP expect sRGB values
/// from 0 to 1.
///
/// # Errors
/// [`Unequal`] if the pictures have no common colours or size.
pub fn compare(a: &Image, b: &Image, pixels_per_degree: f64) -> Result<Comparison, Unequal> {
    let (ca, cb) = colors(a, b)?;
    let mut sum = 0.0;
    let mut differing = vec![false; ca[0].len()];
    let mut max = Difference { x: 0, y: 0, channel: 'R', value: 0.0 };
    for (channel, (a_data, b_data)) in ['R', 'G', 'B'].into_iter().zip(ca.iter().zip(cb)) {
        for (i, (va, vb)) in a_data.iter().zip(b_data).enumerate() {
            let value = distance(*va, *vb);
            sum += value * value;
            differing[i] |= value > 0.0;
            if value > max.value {
                let (x, y) = (i % a.width as usize, i / a.width as usize);
                max = Difference { x: x as u32, y: y as u32, channel, value };
            }
        }
    }
    let mse = sum / (3 * ca[0].len()) as f64;
    Ok(Comparison {
        mse,
        rmse: mse.sqrt(),
        psnr: if mse == 0.0 { f64::INFINITY } else { -10.0 * libm::log10(mse) },
        max,
        differing: differing.iter().filter(|d| **d).count() as u64,
        ssim: ssim(a, b)?,
        flip: flip(a, b, pixels_per_degree)?.mean,
    })
}

/// The number of pixels that differ in colour or are marked in `others`, which has an entry for each pixel or is empty.
///
/// # Errors
/// As [`compare`].
pub fn differing(a: &Image, b: &Image, others: &[bool]) -> Result<u64, Unequal> {
    let (ca, cb) = colors(a, b)?;
    let differs = |i: usize| ca.iter().zip(&cb).any(|(a, b)| distance(a[i], b[i]) > 0.0);
    Ok((0..a.pixels()).filter(|i| others.get(*i) == Some(&true) || differs(*i)).count() as u64)
}

/// The picture of `scale` × |a − b|.
///
/// # Errors
/// As [`compare`].
pub fn difference(a: &Image, b: &Image, scale: f32) -> Result<Image, Unequal> {
    let (ca, cb) = colors(a, b)?;
    let channel = |i: usize| ca[i].iter().zip(cb[i]).map(|(a, b)| distance(*a, *b) as f32 * scale).collect();
    let names = ["R", "G", "B"].iter().enumerate();
    let channels = names.map(|(i, name)| Channel::new(*name, channel(i))).collect();
    Ok(Image { width: a.width, height: a.height, channels })
}

pub(super) fn distance(a: impl Into<f64>, b: impl Into<f64>) -> f64 {
    let (a, b) = (a.into(), b.into());
    if a == b || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    let value = (a - b).abs();
    if value.is_nan() { f64::INFINITY } else { value }
}

/// The red, green and blue channels.
pub(super) type Colors<'a> = [&'a [f32]; 3];

/// The colours of two pictures of equal size.
pub(super) fn colors<'a>(a: &'a Image, b: &'a Image) -> Result<(Colors<'a>, Colors<'a>), Unequal> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(Unequal::Sizes([a.width, a.height, b.width, b.height]));
    }
    let (Some(ca), Some(cb)) = (a.rgb(), b.rgb()) else { return Err(Unequal::NoColor) };
    if a.pixels() == 0 || ca.iter().chain(&cb).any(|channel| channel.len() != a.pixels()) {
        return Err(Unequal::Empty);
    }
    Ok((ca, cb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::PIXELS_PER_DEGREE;

    fn gray(width: u32, height: u32, f: impl Fn(usize) -> f32 + Clone) -> Image {
        Image::from_rgb(width, height, (0..(width * height) as usize).map(|i| [f(i); 3]))
    }

    #[test]
    fn equal_pictures_are_perfect() {
        let a = gray(16, 12, |i| (i % 7) as f32 / 7.0);
        let result = compare(&a, &a, PIXELS_PER_DEGREE).unwrap();
        assert_eq!((result.mse, result.psnr, result.ssim, result.flip), (0.0, f64::INFINITY, Some(1.0), 0.0));
        assert_eq!((result.max.value, result.differing), (0.0, 0));
    }

    #[test]
    fn a_known_difference_gives_known_numbers() {
        let a = gray(16, 12, |_| 0.5);
        let b = gray(16, 12, |_| 0.75);
        let result = compare(&a, &b, PIXELS_PER_DEGREE).unwrap();
        assert_eq!((result.mse, result.rmse, result.differing), (0.0625, 0.25, 192));
        assert!((result.psnr - 12.041_199_826_559_248).abs() < 1e-12);
        // For constant pictures SSIM is (2 μx μy + c1) / (μx² + μy² + c1), with c1 = 0.0001.
        assert!((result.ssim.unwrap() - 0.7501 / 0.8126).abs() < 1e-6);
        assert_eq!(difference(&a, &b, 2.0).unwrap().channel("G").unwrap()[7], 0.5);
    }

    #[test]
    fn the_largest_difference_has_a_place() {
        let a = gray(16, 12, |_| 0.0);
        let mut b = a.clone();
        b.channels[2].data[16 * 3 + 5] = -0.5;
        let max = compare(&a, &b, PIXELS_PER_DEGREE).unwrap().max;
        assert_eq!(max, Difference { x: 5, y: 3, channel: 'B', value: 0.5 });
    }

    #[test]
    fn odd_values_and_sizes_pass() {
        let a = gray(3, 2, |i| if i == 1 { f32::NAN } else { f32::INFINITY });
        assert_eq!(compare(&a, &a, PIXELS_PER_DEGREE).unwrap().mse, 0.0);
        let b = gray(3, 2, |_| 0.0);
        let result = compare(&a, &b, PIXELS_PER_DEGREE).unwrap();
        assert!(result.mse.is_infinite() && result.ssim.is_none() && result.flip.is_finite());
        let error = compare(&a, &gray(2, 3, |_| 0.0), PIXELS_PER_DEGREE).unwrap_err();
        assert_eq!(error.to_string(), "the pictures have different sizes: 3 × 2 and 2 × 3");
        assert_eq!(compare(&Image::default(), &Image::default(), 67.0), Err(Unequal::NoColor));
    }
}
