//! Developing: from linear light to the numbers that a display file holds.

use super::{Picture, srgb};
use crate::math::Rgb;
use crate::scene::{Tone, Transfer};
use rayon::prelude::*;

/// The map from a picture's linear colours to display values.
#[derive(Clone, Copy, Debug)]
pub struct Developer {
    scale: f32,
    transfer: Transfer,
}

impl Developer {
    /// The developer of this picture.
    pub fn new(picture: &Picture, tone: Tone, transfer: Transfer) -> Developer {
        let scale = match tone {
            Tone::Clamp => 1.0,
            Tone::Scale => {
                let largest = picture.pixels.par_iter().map(|c| c.max_component()).reduce(|| 0.0, f32::max);
                if largest > 1.0 { 1.0 / largest } else { 1.0 }
            }
        };
        Developer { scale, transfer }
    }

    /// Develops components of the picture's colours into display values in [0, 1], in place.
    pub fn develop(&self, values: &mut [f32]) {
        values.iter_mut().for_each(|v| *v *= self.scale);
        display_all(values, self.transfer);
    }
}

/// The picture's colours as display values in [0, 1], the top row first.
pub fn develop(picture: &Picture, tone: Tone, transfer: Transfer) -> Vec<Rgb> {
    let developer = Developer::new(picture, tone, transfer);
    let mut shown = picture.pixels.clone();
    shown.par_chunks_mut(256).for_each(|part| {
        let mut values = [[0.0; 3]; 256];
        let values = &mut values[..part.len()];
        values.iter_mut().zip(&*part).for_each(|(value, color)| *value = color.to_array());
        developer.develop(values.as_flattened_mut());
        part.iter_mut().zip(values).for_each(|(color, value)| *color = Rgb::from(*value));
    });
    shown
}

/// Clamps values to [0, 1] and encodes them as display values.
pub(crate) fn display_all(values: &mut [f32], transfer: Transfer) {
    for v in &mut *values {
        // NaN becomes black.
        let positive = if *v > 0.0 { *v } else { 0.0 };
        *v = if positive < 1.0 { positive } else { 1.0 };
    }
    if transfer == Transfer::Srgb {
        srgb::encode_all(values);
    }
}

/// The sRGB curve (IEC 61966-2-1) for a linear value in [0, 1].
pub fn srgb_encode(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * libm::powf(v, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(colors: &[Rgb]) -> Picture {
        Picture { pixels: colors.to_vec(), ..Picture::new(colors.len() as u32, 1) }
    }

    #[test]
    fn clamp_cuts_and_scale_divides() {
        let p = picture(&[Rgb::new(1.3, 1.0, 0.9), Rgb::new(0.65, 0.0, 2.6)]);
        assert_eq!(develop(&p, Tone::Clamp, Transfer::None)[0], Rgb::new(1.0, 1.0, 0.9)); // the chapter's example
        let scaled = develop(&p, Tone::Scale, Transfer::None);
        assert!((scaled[0].r - 0.5).abs() < 1e-6 && scaled[1].b == 1.0);
        let dim = picture(&[Rgb::gray(0.25)]);
        assert_eq!(develop(&dim, Tone::Scale, Transfer::None)[0], Rgb::gray(0.25));
    }

    #[test]
    fn srgb_matches_published_values() {
        for (linear, encoded) in [(0.0, 0.0), (0.0031308, 0.04045), (0.18, 0.46136), (0.5, 0.73536), (1.0, 1.0)] {
            assert!((srgb_encode(linear) - encoded).abs() < 1e-4, "{linear}");
        }
    }
}
