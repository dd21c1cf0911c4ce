//! The shadows on catchers, separated from a picture with an alpha.
//!
//! Such a picture is rendered with its background, which catchers look like where nothing shadows them. What is darker
//! is the shadow. It is found after denoising, since a denoiser sees light and no alpha.

use super::Picture;
use crate::math::Rgb;

/// The darkening that counts as none, so that what is far from all objects is clear in spite of the last noise.
const UNSEEN: f32 = 1.0 / 64.0;

/// How far from a pixel that an object covers in part its shadow is looked for, in pixels.
const REACH: u32 = 2;

impl Picture {
    /// Separates the shadows on catchers from a picture whose [`alpha`](Picture::alpha) leaves the catchers out.
    /// `background` is the radiance that they are measured by
    /// ([`World::shadow_background`](crate::world::World::shadow_background)). Colours are those of objects alone
    /// afterwards, multiplied by alpha. A picture without an alpha, or whose shadow is known, stays as it is. If it
    /// isn't complete, black pixels without an alpha aren't rendered yet, and have no shadow.
    ///
    /// A render does so by itself unless its job has layers for denoising: the picture is then denoised first.
    pub fn separate_shadow(&mut self, background: Rgb, is_complete: bool) {
        if self.alpha.is_empty() || !self.shadow.is_empty() {
            return;
        }
        let level = background.luminance();
        let darkening = |color: Rgb| {
            if !is_complete && color.is_black() {
                return 0.0;
            }
            let lost = if level > 0.0 { 1.0 - color.luminance() / level } else { 0.0 };
            // Light that isn't a number loses nothing.
            ((lost.max(0.0) - UNSEEN) / (1.0 - UNSEEN)).clamp(0.0, 1.0)
        };
        let bare = |i: usize| if self.alpha[i] <= 0.0 { Some(darkening(self.pixels[i])) } else { None };
        let shadow: Vec<f32> = (0..self.pixels.len())
            .map(|i| match self.alpha[i] {
                1.0.. => 0.0,
                _ => bare(i).unwrap_or_else(|| self.mean_around(i, bare)),
            })
            .collect();
        for (i, color) in self.pixels.iter_mut().enumerate() {
            let alpha = self.alpha[i];
            let under = background * ((1.0 - alpha) * (1.0 - shadow[i]));
            *color = if alpha > 0.0 { (*color - under).map(|v| v.max(0.0)) } else { Rgb::BLACK };
        }
        self.shadow = shadow;
    }

    /// The mean of the nearest pixels that have a value; 0 if none is near.
    fn mean_around(&self, i: usize, value: impl Fn(usize) -> Option<f32>) -> f32 {
        let (x, y) = (i as u32 % self.width, i as u32 / self.width);
        for reach in 1..=REACH {
            let across = x.saturating_sub(reach)..=(x + reach).min(self.width - 1);
            let down = y.saturating_sub(reach)..=(y + reach).min(self.height - 1);
            let near = down.flat_map(|y| across.clone().map(move |x| y as usize * self.width as usize + x as usize));
            let (sum, count) = near.filter_map(&value).fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
            if count > 0 {
                return sum / count as f32;
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row: unshadowed floor, half shadow, an edge over half shadow, an object.
    fn row() -> (Picture, Rgb) {
        let (background, object) = (Rgb::gray(0.6), Rgb::new(0.9, 0.2, 0.1));
        let edge = object * 0.5 + background * (0.5 * 0.5);
        let mut picture = Picture::new(4, 1);
        picture.pixels = vec![background, background * 0.5, edge, object];
        picture.alpha = vec![0.0, 0.0, 0.5, 1.0];
        (picture, background)
    }

    #[test]
    fn an_object_over_its_shadow_is_the_picture_again() {
        let (before, background) = row();
        let mut picture = before.clone();
        picture.separate_shadow(background, true);
        assert_eq!((picture.shadow[0], picture.shadow[3]), (0.0, 0.0));
        assert!((picture.shadow[1] - 0.5).abs() < UNSEEN);
        assert_eq!((picture.pixels[0], picture.pixels[1]), (Rgb::BLACK, Rgb::BLACK));
        for i in 0..4 {
            let over = picture.pixels[i] + background * (1.0 - picture.opacity(i));
            let error = over - before.pixels[i];
            assert!(error.to_array().iter().all(|v| v.abs() < 0.6 * UNSEEN), "{i} {error:?}");
        }
        let once = picture.clone();
        picture.separate_shadow(background, true);
        assert_eq!(picture, once);
    }

    #[test]
    fn what_is_no_number_or_brighter_casts_no_shadow() {
        let (mut picture, background) = row();
        picture.pixels[0] = Rgb::gray(f32::NAN);
        picture.pixels[1] = Rgb::gray(5.0);
        picture.separate_shadow(background, true);
        assert_eq!(picture.shadow, [0.0; 4]);
        let mut part = Picture { alpha: vec![0.0], ..Picture::new(1, 1) };
        part.separate_shadow(background, false);
        assert_eq!(part.shadow, [0.0]);
        let mut opaque = Picture::new(1, 1);
        opaque.separate_shadow(background, true);
        assert!(opaque.shadow.is_empty());
    }
}
