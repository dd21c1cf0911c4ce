//! From linear light to the numbers that a display file holds.

use super::{Picture, srgb};
use crate::math::Rgb;
use crate::scene::{Tone, Transfer};
use rayon::prelude::*;

/// The picture's colours as display values in [0, 1], the top row first.
pub fn develop(picture: &Picture, tone: Tone, transfer: Transfer) -> Vec<Rgb> {
    let scale = match tone {
        Tone::Clamp => 1.0,
        Tone::Scale => {
            let largest = picture.pixels.iter().map(|c| c.max_component()).fold(0.0, f32::max);
            if largest > 1.0 { 1.0 / largest } else { 1.0 }
        }
    };
    let mut shown: Vec<Rgb> = picture.pixels.par_iter().map(|&c| c * scale).collect();
    shown.par_chunks_mut(4096).for_each(|part| display_all(part, transfer));
    shown
}

/// Turns colours into display values: cut to [0, 1], then encoded.
pub(crate) fn display_all(colors: &mut [Rgb], transfer: Transfer) {
    let cut = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) };
    for part in colors.chunks_mut(16) {
        let mut values = [0.0; 48];
        let values = &mut values[..3 * part.len()];
        for (v, color) in values.chunks_exact_mut(3).zip(part.iter()) {
            v.copy_from_slice(&color.to_array().map(cut));
        }
        if transfer == Transfer::Srgb {
            srgb::encode_all(values);
        }
        for (color, v) in part.iter_mut().zip(values.chunks_exact(3)) {
            *color = Rgb::new(v[0], v[1], v[2]);
        }
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
