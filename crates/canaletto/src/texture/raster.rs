//! An image as lookups see it: texels that become linear colours one by one when they are asked for.

use super::{ColorSpace, Image, Samples, srgb_decode};
use std::sync::Arc;

/// One resolution of an image.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) width: u32,
    pub(super) height: u32,
    channels: usize,
    image: Arc<Image>,
    /// Whether the last channel is an alpha, and whether colours are multiplied by it already.
    alpha: bool,
    premultiplied: bool,
    /// What the possible values of a colour channel are in linear light; empty for floating-point numbers.
    decode: Vec<f32>,
    /// Whether floating-point colours are on the sRGB curve.
    curve: bool,
}

impl Raster {
    /// The image's own resolution.
    pub(super) fn new(image: Arc<Image>, space: ColorSpace) -> Raster {
        let channels = usize::from(image.channels);
        let alpha = space.has_alpha() && channels.is_multiple_of(2);
        let curve = |v: f32| if space == ColorSpace::Srgb { srgb_decode(v) } else { v };
        let decode = match &image.samples {
            Samples::U8(_) => (0..=255u8).map(|v| curve(f32::from(v) / 255.0)).collect(),
            Samples::U16(_) => (0..=65535u16).map(|v| curve(f32::from(v) / 65535.0)).collect(),
            _ => Vec::new(),
        };
        let (width, height, premultiplied) = (image.width, image.height, image.premultiplied);
        Raster { width, height, channels, image, alpha, premultiplied, decode, curve: space == ColorSpace::Srgb }
    }

    /// A texel in linear light, its colours multiplied by its alpha.
    pub(super) fn texel(&self, x: u32, y: u32) -> [f32; 4] {
        let at = (y as usize * self.width as usize + x as usize) * self.channels;
        let last = self.channels - 1;
        let plain = |i: usize| match &self.image.samples {
            Samples::U8(data) => f32::from(data[at + i]) / 255.0,
            Samples::U16(data) => f32::from(data[at + i]) / 65535.0,
            Samples::F16(data) => half(data[at + i]),
            Samples::F32(data) => data[at + i],
        };
        let float = |v: f32| if self.curve { srgb_decode(v) } else { v };
        let color = |i: usize| match &self.image.samples {
            Samples::U8(data) => self.decode[usize::from(data[at + i])],
            Samples::U16(data) => self.decode[usize::from(data[at + i])],
            Samples::F16(data) => float(half(data[at + i])),
            Samples::F32(data) => float(data[at + i]),
        };
        let [r, g, b] = if self.channels < 3 { [color(0); 3] } else { [color(0), color(1), color(2)] };
        let a = if self.channels.is_multiple_of(2) { plain(last) } else { 1.0 };
        if self.alpha && !self.premultiplied { [r * a, g * a, b * a, a] } else { [r, g, b, a] }
    }

    /// A sum of weighted texels as a colour that is not multiplied by its alpha. Where there is nothing, it is black.
    pub(super) fn finish(&self, sum: [f32; 4]) -> [f32; 4] {
        let [r, g, b, a] = sum;
        if self.alpha && a > 0.0 && a != 1.0 { [r / a, g / a, b / a, a] } else { sum }
    }
}

/// The value of a half-precision number.
pub(super) fn half(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let rest = u32::from(bits & 0x7fff);
    let magnitude = match rest {
        // Subnormal: a multiple of 2⁻²⁴.
        0..0x0400 => (rest as f32 * (1.0 / 16_777_216.0)).to_bits(),
        0x7c00.. => 0x7f80_0000 | (rest & 0x03ff) << 13,
        _ => (rest << 13) + (112 << 23),
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use super::half;

    #[test]
    fn half_precision_follows_ieee_754() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(half(bits), value, "{bits:#x}");
        }
        assert!(half(0x7e00).is_nan() && half(0x8000).is_sign_negative());
    }
}
