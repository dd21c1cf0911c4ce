//! Images: rows of texels as compact as their file holds them.

use super::ColorSpace;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A picture to be used as a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// What messages call it: the file's name.
    pub name: String,
    /// Texels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Numbers of each texel: 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    pub channels: u8,
    /// width × height × channels numbers; the top row first, the channels of a texel side by side.
    pub samples: Samples,
    /// What the numbers mean.
    pub space: ColorSpace,
    /// Whether the colours were multiplied by alpha already, as OpenEXR's are.
    pub premultiplied: bool,
}

/// The numbers of an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Samples {
    /// 0 to 255 stand for 0 to 1.
    U8(Vec<u8>),
    /// 0 to 65535 stand for 0 to 1.
    U16(Vec<u16>),
    /// The bits of IEEE 754 half-precision numbers.
    F16(Vec<u16>),
    /// Any finite number.
    F32(Vec<f32>),
}

impl Image {
    /// The most texels of one image: 16384 × 16384.
    pub const MAX_TEXELS: u64 = 1 << 28;
    /// The longest side in texels.
    pub const MAX_SIDE: u32 = 1 << 20;

    /// The largest number in magnitude: sums of such numbers stay finite.
    pub const MAX_VALUE: f32 = 1e30;

    /// Checks size and count of numbers.
    ///
    /// # Errors
    /// A sentence that says what is wrong.
    pub fn check(&self) -> Result<(), String> {
        let Image { width, height, channels, .. } = *self;
        if width == 0 || height == 0 {
            return Err(format!("the image has {width} × {height} texels; it needs at least one"));
        }
        if width > Image::MAX_SIDE
            || height > Image::MAX_SIDE
            || u64::from(width) * u64::from(height) > Image::MAX_TEXELS
        {
            return Err(format!(
                "an image of {width} × {height} texels is too large; {} in all and {} in a row or column are possible",
                Image::MAX_TEXELS,
                Image::MAX_SIDE
            ));
        }
        if !(1..=4).contains(&channels) {
            return Err(format!("the image has {channels} channels; 1 to 4 are possible"));
        }
        let expected = width as usize * height as usize * usize::from(channels);
        if self.samples.len() != expected {
            return Err(format!(
                "the image has {} numbers; {width} × {height} texels of {channels} channels need {expected}",
                self.samples.len()
            ));
        }
        let odd = match &self.samples {
            Samples::U8(_) | Samples::U16(_) => false,
            Samples::F16(data) => data.par_iter().any(|v| v & 0x7c00 == 0x7c00),
            Samples::F32(data) => data.par_iter().any(|v| !v.is_finite() || v.abs() > Image::MAX_VALUE),
        };
        if odd {
            return Err(format!("the image has numbers that aren't finite or are beyond ±{:e}", Image::MAX_VALUE));
        }
        Ok(())
    }
}

impl Samples {
    /// How many numbers there are.
    pub fn len(&self) -> usize {
        match self {
            Samples::U8(data) => data.len(),
            Samples::U16(data) | Samples::F16(data) => data.len(),
            Samples::F32(data) => data.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bytes that they take.
    pub fn bytes(&self) -> usize {
        match self {
            Samples::U8(data) => data.len(),
            Samples::U16(data) | Samples::F16(data) => 2 * data.len(),
            Samples::F32(data) => 4 * data.len(),
        }
    }
}
