//! Developing: from linear light to the numbers that a display file holds.

use super::{Agx, PbrNeutral, Picture, metered_exposure, srgb};
use crate::math::Rgb;
use crate::scene::{Developing, Exposure, Tone, Transfer};
use canaletto_parallel::prelude::*;

/// The map from a picture's linear colours to display values.
#[derive(Clone, Copy, Debug)]
pub struct Developer {
    /// The factor of the exposure.
    exposure: f32,
    tone: Tone,
    /// What [`Tone::Scale`] multiplies exposed light by; 1 for other tones.
    scale: f32,
    transfer: Transfer,
}

impl Developer {
    /// The developer of this picture, in which what depends on a whole picture is measured.
    pub fn new(picture: &Picture, developing: &Developing) -> Developer {
        let Developing { exposure, tone, transfer } = *developing;
        let stops = match exposure {
            Exposure::Stops(stops) => stops,
            Exposure::Auto => metered_exposure(picture),
        };
        let exposure = libm::exp2f(stops);
        let scale = match tone {
            Tone::Scale => {
                let largest = (0..picture.pixels.len()).into_par_iter().map(|i| picture.straight(i).max_component());
                let largest = largest.reduce(|| 0.0, f32::max) * exposure;
                if largest > 1.0 { 1.0 / largest } else { 1.0 }
            }
            Tone::Clamp | Tone::Agx | Tone::PbrNeutral => 1.0,
        };
        Developer { exposure, tone, scale, transfer }
    }

    /// Develops the picture's colours into display values in [0, 1], in place.
    pub fn develop(&self, colors: &mut [[f32; 3]]) {
        self.tone(colors);
        display_all(colors.as_flattened_mut(), self.transfer);
    }

    /// Exposes colours and maps their tones, in place. They are linear light, and may be beyond [0, 1] a little.
    pub fn tone(&self, colors: &mut [[f32; 3]]) {
        let curve: fn(Rgb) -> Rgb = match self.tone {
            Tone::Clamp | Tone::Scale => {
                let values = colors.as_flattened_mut();
                return values.iter_mut().for_each(|v| *v = *v * self.exposure * self.scale);
            }
            Tone::Agx => |color| Agx::of(color).linear,
            Tone::PbrNeutral => |color| PbrNeutral::of(color).linear,
        };
        for color in colors {
            *color = curve(self.exposed(Rgb::from(*color))).to_array();
        }
    }

    /// The exposed light of a colour as tone curves take it: finite and not negative.
    #[expect(clippy::manual_clamp, reason = "NaN becomes black, as without a curve")]
    pub fn exposed(&self, color: Rgb) -> Rgb {
        color.map(|v| (v * self.exposure).max(0.0).min(f32::MAX))
    }

    /// Pixel number `i` of a picture with an alpha as display values in [0, 1]: its colour, not multiplied by alpha,
    /// and its alpha. A page multiplies what lies under the picture by 1 − alpha after the transfer curve. So a shadow
    /// has the alpha that makes this the curve of the light that it leaves.
    pub fn with_alpha(&self, picture: &Picture, i: usize) -> (Rgb, f32) {
        let mut color = [picture.straight(i).to_array()];
        self.develop(&mut color);
        let (color, alpha) = (Rgb::from(color[0]), picture.alpha[i]);
        let Some(shadow) = picture.shadow.get(i).filter(|shadow| **shadow > 0.0) else { return (color, alpha) };
        let mut left = [1.0 - shadow];
        display_all(&mut left, self.transfer);
        let opacity = alpha + (1.0 - alpha) * (1.0 - left[0]);
        (if opacity > 0.0 { color * (alpha / opacity) } else { Rgb::BLACK }, opacity)
    }

    /// Pixel number `i` of a picture with an alpha over a linear colour as a screen shows it, in [0, 1]: exposed, with
    /// its tone, and without the transfer curve.
    pub fn over(&self, picture: &Picture, i: usize, under: Rgb) -> Rgb {
        let mut color = [picture.straight(i).to_array()];
        self.tone(&mut color);
        display_all(color.as_flattened_mut(), Transfer::None);
        let alpha = picture.alpha[i].clamp(0.0, 1.0);
        Rgb::from(color[0]) * alpha + under * (1.0 - picture.opacity(i)).clamp(0.0, 1.0)
    }

    /// Colours as display values in [0, 1].
    pub fn developed(&self, colors: &[Rgb]) -> Vec<Rgb> {
        let mut shown = colors.to_vec();
        shown.par_chunks_mut(256).for_each(|part| {
            let mut values = [[0.0; 3]; 256];
            let values = &mut values[..part.len()];
            values.iter_mut().zip(&*part).for_each(|(value, color)| *value = color.to_array());
            self.develop(values);
            part.iter_mut().zip(values).for_each(|(color, value)| *color = Rgb::from(*value));
        });
        shown
    }
}

/// The picture's colours as display values in [0, 1], the top row first. They aren't multiplied by alpha.
pub fn develop(picture: &Picture, developing: &Developing) -> Vec<Rgb> {
    if picture.alpha.is_empty() {
        return Developer::new(picture, developing).developed(&picture.pixels);
    }
    develop_with_alpha(picture, developing).into_iter().map(|(color, _)| color).collect()
}

/// The colours of a picture with an alpha as [`develop`] has them, each with its alpha for display values
/// ([`Developer::with_alpha`]).
pub fn develop_with_alpha(picture: &Picture, developing: &Developing) -> Vec<(Rgb, f32)> {
    let developer = Developer::new(picture, developing);
    (0..picture.pixels.len()).into_par_iter().map(|i| developer.with_alpha(picture, i)).collect()
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

    fn developing(tone: Tone) -> Developing {
        Developing { tone, transfer: Transfer::None, ..Developing::default() }
    }

    #[test]
    fn clamp_cuts_and_scale_divides() {
        let p = picture(&[Rgb::new(1.3, 1.0, 0.9), Rgb::new(0.65, 0.0, 2.6)]);
        assert_eq!(develop(&p, &developing(Tone::Clamp))[0], Rgb::new(1.0, 1.0, 0.9)); // the chapter's example
        let scaled = develop(&p, &developing(Tone::Scale));
        assert!((scaled[0].r - 0.5).abs() < 1e-6 && scaled[1].b == 1.0);
        let dim = picture(&[Rgb::gray(0.25)]);
        assert_eq!(develop(&dim, &developing(Tone::Scale))[0], Rgb::gray(0.25));
    }

    /// A stop doubles light before every tone, and `auto` is the stops that it meters.
    #[test]
    fn exposure_comes_first() {
        let light = [Rgb::new(0.1, 0.4, 0.2), Rgb::new(0.02, 0.0, 0.9), Rgb::gray(3.0), Rgb::new(0.3, 0.1, 0.05)];
        let doubled = picture(&light.map(|c| c * 2.0));
        let light = picture(&light);
        for &tone in <Tone as crate::Named>::ALL {
            let with = |exposure| Developing { exposure, ..developing(tone) };
            assert_eq!(develop(&light, &with(Exposure::Stops(1.0))), develop(&doubled, &developing(tone)), "{tone:?}");
            let stops = Exposure::Stops(metered_exposure(&light));
            assert_eq!(develop(&light, &with(Exposure::Auto)), develop(&light, &with(stops)), "{tone:?}");
        }
        let odd = picture(&[Rgb::new(f32::NAN, f32::INFINITY, -1.0), Rgb::gray(f32::MAX)]);
        for &tone in <Tone as crate::Named>::ALL {
            let shown = develop(&odd, &Developing { exposure: Exposure::Stops(60.0), ..developing(tone) });
            assert!(shown.iter().all(|c| c.to_array().iter().all(|v| (0.0..=1.0).contains(v))), "{tone:?} {shown:?}");
        }
    }

    /// Pictures by paths are photos if nothing else is said. All others show a scene's numbers.
    #[test]
    fn paths_are_photos_by_default() {
        use crate::scene::FilmSettings;
        let of = |integrator: &str, film: FilmSettings| film.developing(integrator == "path");
        let film = FilmSettings::default();
        let photo = Developing { exposure: Exposure::Auto, tone: Tone::Agx, transfer: Transfer::Srgb };
        assert_eq!(of("path", film), photo);
        for integrator in ["whitted", "zbuffer", "radiosity"] {
            assert_eq!(of(integrator, film), Developing::default(), "{integrator}");
        }
        assert_eq!(of("path", FilmSettings { transfer: Transfer::None, ..film }), developing(Tone::Clamp));
        for (tone, exposure) in [
            (Tone::Clamp, Exposure::default()),
            (Tone::Scale, Exposure::default()),
            (Tone::Agx, Exposure::Auto),
            (Tone::PbrNeutral, Exposure::Auto),
        ] {
            let film = FilmSettings { tone: Some(tone), ..film };
            assert_eq!(of("path", film), Developing { exposure, tone, ..photo }, "{tone:?}");
            assert_eq!(of("whitted", film), Developing { tone, ..Developing::default() }, "{tone:?}");
            let given = FilmSettings { exposure: Some(Exposure::default()), ..film };
            assert_eq!(of("path", given).exposure, Exposure::default(), "{tone:?}");
        }
    }

    #[test]
    fn srgb_matches_published_values() {
        for (linear, encoded) in [(0.0, 0.0), (0.0031308, 0.04045), (0.18, 0.46136), (0.5, 0.73536), (1.0, 1.0)] {
            assert!((srgb_encode(linear) - encoded).abs() < 1e-4, "{linear}");
        }
    }
}
