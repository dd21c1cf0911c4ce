//! Pictures as bytes for formats of 8 bits.

use super::format::{GoesOn, Rendered};
use super::{Image, PictureError, check, no_pixels};
use canaletto::film::Developer;
use canaletto::math::Rgb;

/// The level from 0 to `most` nearest to `v` × `most`, halves rounded up; 0 for NaN. It consists of sums and selections
/// only, which vectorise on every machine.
#[inline]
pub(super) fn level(v: f32, most: f32) -> u32 {
    /// From this value on floats are integers, and their last bits are units.
    const WHOLE: f32 = (1 << 23) as f32;
    let v = if v > 0.0 { v } else { 0.0 };
    let v = if v < 1.0 { v } else { 1.0 } * most;
    // Rounded to nearest, halves to even, which may round down.
    let even = v + WHOLE - WHOLE;
    let nearest = even + if v - even >= 0.5 { 1.0 } else { 0.0 };
    (nearest + WHOLE).to_bits() & 0xffff
}

/// The levels of a picture's pixels side by side.
pub(super) struct Levels {
    pub(super) size: [u32; 2],
    /// One for grey, three for colours, or four with an alpha.
    pub(super) channels: usize,
    pub(super) data: Vec<u8>,
}

impl Levels {
    /// The levels of a rendered picture, developed while `goes_on` returns true; the rest is black. Without
    /// `keeps_alpha` an alpha is left out.
    pub(super) fn developed(
        rendered: &Rendered<'_>,
        keeps_alpha: bool,
        goes_on: GoesOn<'_>,
    ) -> Result<Levels, PictureError> {
        let Rendered { picture, developing } = rendered;
        if picture.pixels.is_empty() {
            return Err(no_pixels());
        }
        let developer = Developer::new(picture, developing);
        let has_alpha = !picture.alpha.is_empty();
        let channels = if has_alpha && keeps_alpha { 4 } else { 3 };
        let mut data = vec![0; picture.pixels.len() * channels];
        let width = picture.width.max(1) as usize;
        for (y, row) in data.chunks_mut(width * channels).enumerate().take_while(|_| goes_on()) {
            for (x, levels) in row.chunks_mut(channels).enumerate() {
                let i = y * width + x;
                let (Rgb { r, g, b }, alpha) = match has_alpha {
                    true => developer.with_alpha(picture, i),
                    false => {
                        let mut color = [picture.pixels[i].to_array()];
                        developer.develop(&mut color);
                        (color[0].into(), 1.0)
                    }
                };
                levels.iter_mut().zip([r, g, b, alpha]).for_each(|(to, v)| *to = level(v, 255.0) as u8);
            }
        }
        Ok(Levels { size: [picture.width, picture.height], channels, data })
    }

    /// The levels of an image, whose values are stored as they are.
    pub(super) fn of_image(image: &Image, keeps_alpha: bool, format: &str) -> Result<Levels, PictureError> {
        check(image)?;
        let mut channels: Vec<&[f32]> = match (image.rgb(), image.channel("R")) {
            (Some(rgb), Some(_)) => rgb.to_vec(),
            (Some([y, ..]), None) => vec![y],
            (None, _) => return Err(PictureError::Unfit(format!("{format} needs the channels R G B, or Y"))),
        };
        if let Some(alpha) = image.channel("A").filter(|_| keeps_alpha) {
            // These formats have an alpha beside colours only.
            channels = if channels.len() == 1 { vec![channels[0]; 3] } else { channels };
            channels.push(alpha);
        }
        let count = image.width as usize * image.height as usize;
        let pixel = |i: usize| channels.iter().map(move |channel| level(channel[i], 255.0) as u8);
        let data = (0..count).flat_map(pixel).collect();
        Ok(Levels { size: [image.width, image.height], channels: channels.len(), data })
    }
}
