//! The conversion from an image's numbers to linear light, and back for the coarser levels of a pyramid.

use super::half::{from_half, to_half};
use super::space::srgb_encode;
use super::{ColorSpace, Samples, srgb_decode};

/// The meaning of an image's numbers.
#[derive(Debug)]
pub(super) struct Codec {
    /// The number of channels of each texel, 1 to 4.
    pub(super) channels: usize,
    /// The meaning of the last channel.
    pub(super) alpha: Alpha,
    /// Whether the numbers are not colours.
    data: bool,
    /// Whether integers are on the sRGB curve. Floating-point numbers were converted to linear light before.
    curved: bool,
    /// The linear light of each possible integer of a colour channel.
    table: Vec<f32>,
    /// The encoder from linear light to bytes on the curve.
    encoder: Option<Encoder>,
}

/// The meaning of the last of two or four channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Alpha {
    /// The last channel is a number like the others.
    Data,
    /// The last channel is alpha, and colours must be multiplied by it before they are averaged.
    Straight,
    /// The last channel is alpha, and colours are already multiplied by it.
    Premultiplied,
}

/// One term of a weighted sum of texels: the texel's position in the level, and its weight.
pub(super) type Tap = (u32, f32);

impl Codec {
    pub(super) fn new(channels: u8, samples: &Samples, space: ColorSpace, premultiplied: bool) -> Codec {
        let curved = space == ColorSpace::Srgb;
        let curve = |v: f32| if curved { srgb_decode(v) } else { v };
        let table: Vec<f32> = match samples {
            Samples::U8(_) => (0..=255u8).map(|v| curve(f32::from(v) / 255.0)).collect(),
            Samples::U16(_) => (0..=65535u16).map(|v| curve(f32::from(v) / 65535.0)).collect(),
            _ => Vec::new(),
        };
        let alpha = match (space, premultiplied) {
            _ if !channels.is_multiple_of(2) => Alpha::Data,
            (ColorSpace::Raw, _) => Alpha::Data,
            (_, true) => Alpha::Premultiplied,
            (_, false) => Alpha::Straight,
        };
        let encoder = (curved && matches!(samples, Samples::U8(_))).then(Encoder::new);
        Codec { channels: usize::from(channels), alpha, data: space == ColorSpace::Raw, curved, table, encoder }
    }

    /// The weighted sum of texels in linear light, with colours multiplied by alpha.
    pub(super) fn sum(&self, samples: &Samples, taps: &[Tap]) -> [f32; 4] {
        match samples {
            Samples::U8(data) => match <&[f32; 256]>::try_from(self.table.as_slice()) {
                Ok(table) => self.sum_of(data, taps, |v| table[usize::from(v)], |v| f32::from(v) * (1.0 / 255.0)),
                Err(_) => [0.0; 4],
            },
            Samples::U16(data) => {
                self.sum_of(data, taps, |v| self.table[usize::from(v)], |v| f32::from(v) * (1.0 / 65535.0))
            }
            Samples::F16(data) => self.sum_of(data, taps, from_half, from_half),
            Samples::F32(data) => self.sum_of(data, taps, |v| v, |v| v),
        }
    }

    /// Four texels at their positions, each as by [`Codec::sum`].
    pub(super) fn four(&self, samples: &Samples, at: [u32; 4]) -> [[f32; 4]; 4] {
        match samples {
            // The frequent formats of environments are compiled for themselves.
            Samples::F32(data) if self.channels == 3 => {
                at.map(|at| gather::<_, 3>(data, &[(at, 1.0)], |v| v, |v| v, false))
            }
            Samples::F16(data) if self.channels == 3 => {
                at.map(|at| gather::<_, 3>(data, &[(at, 1.0)], from_half, from_half, false))
            }
            _ => at.map(|at| self.sum(samples, &[(at, 1.0)])),
        }
    }

    /// Consecutive texels from position `first` on, each converted as by [`Codec::sum`].
    pub(super) fn texels(&self, samples: &Samples, first: u32, texels: &mut [[f32; 4]]) {
        match samples {
            Samples::U8(data) => {
                if let Ok(table) = <&[f32; 256]>::try_from(self.table.as_slice()) {
                    let plain = |v| f32::from(v) * (1.0 / 255.0);
                    self.texels_of(data, first, texels, |v| table[usize::from(v)], plain);
                }
            }
            Samples::U16(data) => {
                let plain = |v| f32::from(v) * (1.0 / 65535.0);
                self.texels_of(data, first, texels, |v| self.table[usize::from(v)], plain);
            }
            Samples::F16(data) => self.texels_of(data, first, texels, from_half, from_half),
            Samples::F32(data) => self.texels_of(data, first, texels, |v| v, |v| v),
        }
    }

    fn texels_of<T: Copy>(
        &self,
        data: &[T],
        first: u32,
        texels: &mut [[f32; 4]],
        color: impl Fn(T) -> f32 + Copy,
        plain: impl Fn(T) -> f32 + Copy,
    ) {
        let multiply = self.alpha == Alpha::Straight;
        let data = &data[first as usize * self.channels..];
        match self.channels {
            1 => each::<T, 1>(data, texels, color, plain, multiply),
            2 => each::<T, 2>(data, texels, color, plain, multiply),
            3 => each::<T, 3>(data, texels, color, plain, multiply),
            _ => each::<T, 4>(data, texels, color, plain, multiply),
        }
    }

    fn sum_of<T: Copy>(
        &self,
        data: &[T],
        taps: &[Tap],
        color: impl Fn(T) -> f32,
        plain: impl Fn(T) -> f32,
    ) -> [f32; 4] {
        let multiply = self.alpha == Alpha::Straight;
        match self.channels {
            1 => gather::<T, 1>(data, taps, color, plain, multiply),
            2 => gather::<T, 2>(data, taps, color, plain, multiply),
            3 => gather::<T, 3>(data, taps, color, plain, multiply),
            _ => gather::<T, 4>(data, taps, color, plain, multiply),
        }
    }

    /// A filtered colour as textures return it: not multiplied by alpha, nor, with `ends`, by the share of the filter
    /// that lies on the image. `ends` holds for images with a transparent outside. Filters with negative weights
    /// overshoot. Light is therefore clamped below at 0, and above at 1 where the format holds nothing above 1. Alpha
    /// is clamped to [0, 1].
    #[inline]
    pub(super) fn finish(&self, sum: [f32; 4], samples: &Samples, ends: bool) -> [f32; 4] {
        let [r, g, b, alpha] = sum;
        if self.data {
            return sum;
        }
        let a = alpha.clamp(0.0, 1.0);
        let divide = (ends || self.alpha != Alpha::Data) && a > 0.0 && alpha != 1.0;
        let most = if matches!(samples, Samples::U8(_) | Samples::U16(_)) { 1.0 } else { f32::MAX };
        let color = |v: f32| (if divide { v / alpha } else { v }).clamp(0.0, most);
        [color(r), color(g), color(b), a]
    }

    /// Raw numbers used as a colour of an image with a transparent outside. Without an alpha of their own, they are
    /// multiplied by the share of the filter on the image; the result is divided by it.
    pub(super) fn uncovered(&self, value: [f32; 4]) -> [f32; 4] {
        let [r, g, b, a] = value;
        let covered = self.data && !self.channels.is_multiple_of(2) && a > 0.0;
        if covered { [r / a, g / a, b / a, a] } else { value }
    }

    /// Stores a mean of texels in a level.
    pub(super) fn store(&self, mean: [f32; 4], slot: &mut Slot) {
        let [mut r, mut g, mut b, a] = mean;
        if self.alpha == Alpha::Straight && a > 0.0 && a < 1.0 {
            (r, g, b) = (r / a, g / a, b / a);
        }
        let numbers = match self.channels {
            1 => [r, 0.0, 0.0, 0.0],
            2 => [r, a, 0.0, 0.0],
            3 => [r, g, b, 0.0],
            _ => [r, g, b, a],
        };
        let plain = |i: usize| self.channels.is_multiple_of(2) && i == self.channels - 1;
        for (i, v) in numbers.into_iter().take(self.channels).enumerate() {
            match slot {
                Slot::U8(data) => {
                    data[i] = match &self.encoder {
                        Some(encoder) if !plain(i) => encoder.encode(v),
                        _ => (v.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8,
                    }
                }
                Slot::U16(data) => {
                    let v = v.clamp(0.0, 1.0);
                    let v = if self.curved && !plain(i) { srgb_encode(v) } else { v };
                    data[i] = (v * 65535.0).round_ties_even() as u16;
                }
                Slot::F16(data) => data[i] = to_half(v),
                Slot::F32(data) => data[i] = v,
            }
        }
    }
}

/// The place of a texel in a level.
pub(super) enum Slot<'a> {
    /// Bytes.
    U8(&'a mut [u8]),
    /// 16-bit integers.
    U16(&'a mut [u16]),
    /// Half-precision numbers.
    F16(&'a mut [u16]),
    /// Single-precision numbers.
    F32(&'a mut [f32]),
}

#[inline]
fn each<T: Copy, const C: usize>(
    data: &[T],
    texels: &mut [[f32; 4]],
    color: impl Fn(T) -> f32 + Copy,
    plain: impl Fn(T) -> f32 + Copy,
    multiply: bool,
) {
    for (texel, data) in texels.iter_mut().zip(data.chunks_exact(C)) {
        *texel = gather::<T, C>(data, &[(0, 1.0)], color, plain, multiply);
    }
}

#[inline]
fn gather<T: Copy, const C: usize>(
    data: &[T],
    taps: &[Tap],
    color: impl Fn(T) -> f32,
    plain: impl Fn(T) -> f32,
    multiply: bool,
) -> [f32; 4] {
    let mut sum = [0.0; 4];
    for &(at, weight) in taps {
        let at = at as usize * C;
        let texel = &data[at..at + C];
        match C {
            1 => sum[0] += color(texel[0]) * weight,
            3 => {
                for i in 0..3 {
                    sum[i] += color(texel[i]) * weight;
                }
            }
            _ => {
                let alpha = plain(texel[C - 1]);
                let colored = if multiply { weight * alpha } else { weight };
                for i in 0..C - 1 {
                    sum[i] += color(texel[i]) * colored;
                }
                sum[3] += alpha * weight;
            }
        }
        if C % 2 == 1 {
            sum[3] += weight;
        }
    }
    if C < 3 { [sum[0], sum[0], sum[0], sum[3]] } else { sum }
}

/// The encoder from linear light to bytes on the sRGB curve. It rounds to the nearest byte in linear light, so that the
/// mean of many texels is kept. The curve's power function would take most of a pyramid's time.
#[derive(Debug)]
struct Encoder {
    /// The boundary between the values of byte i and byte i + 1.
    ends: Vec<f32>,
    /// The byte at the start of each of [`Encoder::STEPS`] equal parts of 0 to 1.
    starts: Vec<u8>,
}

impl Encoder {
    const STEPS: usize = 4096;

    fn new() -> Encoder {
        let light = |byte: u8| srgb_decode(f32::from(byte) / 255.0);
        let ends: Vec<f32> = (0..255u8).map(|i| 0.5 * (light(i) + light(i + 1))).collect();
        let starts = (0..=Encoder::STEPS)
            .map(|i| ends.partition_point(|end| *end <= i as f32 / Encoder::STEPS as f32) as u8)
            .collect();
        Encoder { ends, starts }
    }

    fn encode(&self, v: f32) -> u8 {
        let v = v.clamp(0.0, 1.0);
        let mut byte = self.starts[(v * Encoder::STEPS as f32) as usize];
        while self.ends.get(usize::from(byte)).is_some_and(|end| *end <= v) {
            byte += 1;
        }
        byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_the_nearest_in_linear_light() {
        let encoder = Encoder::new();
        let light = |byte: u8| srgb_decode(f32::from(byte) / 255.0);
        for byte in 0..=255u8 {
            assert_eq!(encoder.encode(light(byte)), byte);
        }
        for i in 0..=100_000 {
            let v = i as f32 / 100_000.0;
            let byte = encoder.encode(v);
            let near = |other: u8| (light(byte) - v).abs() <= (light(other) - v).abs() + 1e-7;
            assert!(near(byte.saturating_sub(1)) && near(byte.saturating_add(1)), "{v}: {byte}");
        }
        assert_eq!((encoder.encode(-1.0), encoder.encode(7.0), encoder.encode(f32::NAN)), (0, 255, 0));
    }
}
