//! Structural similarity: Wang, Bovik, Sheikh and Simoncelli, *Image Quality Assessment: From Error Visibility to
//! Structural Similarity*, IEEE Transactions on Image Processing 13(4), 2004.
//!
//! The parameters are those of the authors' program: luma (Rec. 601 weights) of encoded values, an 11 × 11 Gaussian
//! window of σ = 1.5, K₁ = 0.01, K₂ = 0.03. The result is the mean over the windows inside the picture. Large pictures
//! are not subsampled.

use super::Image;
use super::compare::{Unequal, colors};
use super::convolve::{Kernel, convolve, gaussian};

/// Half the window width.
const RADIUS: usize = 5;

/// The mean structural similarity of two pictures with values from 0 to 1; it is 1 for equal pictures. `None` for
/// pictures smaller than the window.
///
/// # Errors
/// [`Unequal`] if the pictures have no common colours or size.
pub fn ssim(a: &Image, b: &Image) -> Result<Option<f64>, Unequal> {
    let (ca, cb) = colors(a, b)?;
    let (width, height) = (a.width as usize, a.height as usize);
    if width <= 2 * RADIUS || height <= 2 * RADIUS {
        return Ok(None);
    }
    // A value that isn't finite would affect every window that contains it.
    let level = |v: f32| if v.is_finite() { f64::from(v).clamp(-1e6, 1e6) } else { 0.0 };
    let luma = |c: [&[f32]; 3]| -> Vec<f64> {
        let at = |i: usize| 0.299 * level(c[0][i]) + 0.587 * level(c[1][i]) + 0.114 * level(c[2][i]);
        (0..width * height).map(at).collect()
    };
    let (x, y) = (luma(ca), luma(cb));
    let kernel = Kernel { x: gaussian(1.5, RADIUS), y: gaussian(1.5, RADIUS) };
    let mean = |data: &[f64]| convolve(data, width, &kernel);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let (mx, my) = (mean(&x), mean(&y));
    let (xx, yy, xy) = (mean(&product(&x, &x)), mean(&product(&y, &y)), mean(&product(&x, &y)));
    let (c1, c2) = (0.01 * 0.01, 0.03 * 0.03);
    let mut sum = 0.0;
    for row in RADIUS..height - RADIUS {
        for i in row * width + RADIUS..(row + 1) * width - RADIUS {
            let (mx, my) = (mx[i], my[i]);
            let (vx, vy, cov) = (xx[i] - mx * mx, yy[i] - my * my, xy[i] - mx * my);
            sum += (2.0 * mx * my + c1) * (2.0 * cov + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2)); // (13)
        }
    }
    Ok(Some(sum / ((width - 2 * RADIUS) * (height - 2 * RADIUS)) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u32) -> impl Iterator<Item = f32> + Clone {
        (0u32..).map(move |i| {
            let mut v = i.wrapping_add(seed).wrapping_mul(0x9e37_79b9);
            v = (v ^ v >> 15).wrapping_mul(0x85eb_ca6b);
            (v ^ v >> 13) as f32 / u32::MAX as f32
        })
    }

    #[test]
    fn known_noise_gives_the_expected_similarity() {
        // Independent noise of variance s² over a constant picture of mean m: the covariance is that of the noise with
        // a constant, 0. The second factor is therefore near c2 / (s² (1 − Σw²) + c2).
        let flat = Image::from_rgb(128, 128, (0..128 * 128).map(|_| [0.5; 3]));
        let rough = Image::from_rgb(128, 128, noise(1).take(128 * 128).map(|v| [0.5 + 0.2 * (v - 0.5); 3]));
        let found = ssim(&flat, &rough).unwrap().unwrap();
        let w2: f64 = gaussian(1.5, RADIUS).iter().map(|w| w * w).sum::<f64>().powi(2);
        let variance = 0.04 / 12.0 * (1.0 - w2);
        let expected = 0.0009 / (variance + 0.0009);
        assert!((found - expected).abs() < 0.02, "{found} {expected}");
    }

    #[test]
    fn inverted_noise_is_negatively_similar() {
        let a = Image::from_rgb(32, 32, noise(3).take(1024).map(|v| [v; 3]));
        let b = Image::from_rgb(32, 32, noise(3).take(1024).map(|v| [1.0 - v; 3]));
        assert!(ssim(&a, &b).unwrap().unwrap() < -0.8);
    }
}
