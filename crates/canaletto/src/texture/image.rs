//! Images: rows of texels in the compact format of their file.

use super::ColorSpace;
use crate::OutOfRange;
use canaletto_parallel::prelude::*;
use serde::{Deserialize, Serialize};

/// An image for textures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// The image's name in messages: its file's name.
    pub name: String,
    /// The number of texels in a row, at least 1.
    pub width: u32,
    /// The number of rows, at least 1.
    pub height: u32,
    /// The number of channels of each texel: 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    pub channels: u8,
    /// width × height × channels numbers. The top row is first, and the channels of a texel are adjacent.
    pub samples: Samples,
    /// The meaning of the numbers.
    pub space: ColorSpace,
    /// Whether the colours are already multiplied by alpha, as OpenEXR's are.
    pub premultiplied: bool,
}

/// The numbers of an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Samples {
    /// Bytes: 0 to 255 represent 0 to 1.
    U8(Vec<u8>),
    /// 16-bit integers: 0 to 65535 represent 0 to 1.
    U16(Vec<u16>),
    /// The bits of IEEE 754 half-precision numbers.
    F16(Vec<u16>),
    /// Single-precision numbers of any finite value.
    F32(Vec<f32>),
}

impl Image {
    /// The largest number of texels of an image: 16384 × 16384.
    pub const MAX_TEXELS: u64 = 1 << 28;
    /// The largest side in texels.
    pub const MAX_SIDE: u32 = 1 << 20;

    /// The largest magnitude of a number: six times the sun's luminance in cd/m². Beyond it, no number means anything.
    pub const MAX_VALUE: f32 = 1e10;

    /// What an infinite number is taken as: the largest of half precision, in which the brightest texels of most images
    /// are stored.
    pub const INFINITE: f32 = 65504.0;

    /// Checks the size and the count of numbers.
    ///
    /// # Errors
    /// A sentence that names the fault.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let Image { width, height, channels, .. } = *self;
        if width == 0 || height == 0 {
            return Err(OutOfRange::whole(format!("the image has {width} × {height} texels; it needs at least one")));
        }
        if width > Image::MAX_SIDE
            || height > Image::MAX_SIDE
            || u64::from(width) * u64::from(height) > Image::MAX_TEXELS
        {
            return Err(OutOfRange::whole(format!(
                "an image of {width} × {height} texels is too large; {} in all and {} in a row or column are possible",
                Image::MAX_TEXELS,
                Image::MAX_SIDE
            )));
        }
        if !(1..=4).contains(&channels) {
            return Err(OutOfRange::whole(format!("the image has {channels} channels; 1 to 4 are possible")));
        }
        let expected = width as usize * height as usize * usize::from(channels);
        if self.samples.len() != expected {
            return Err(OutOfRange::whole(format!(
                "the image has {} numbers; {width} × {height} texels of {channels} channels need {expected}",
                self.samples.len()
            )));
        }
        let odd = match &self.samples {
            Samples::U8(_) | Samples::U16(_) => false,
            Samples::F16(data) => data.par_iter().any(|v| v & 0x7c00 == 0x7c00),
            Samples::F32(data) => data.par_iter().any(|v| !v.is_finite() || v.abs() > Image::MAX_VALUE),
        };
        if odd {
            return Err(OutOfRange::whole(format!(
                "the image has numbers that aren't finite or are beyond ±{:e}",
                Image::MAX_VALUE
            )));
        }
        Ok(())
    }
}

impl Samples {
    /// Takes all negative numbers as 0, as light is none.
    pub(crate) fn make_positive(&mut self) {
        match self {
            Samples::U8(_) | Samples::U16(_) => {}
            Samples::F16(data) => data.par_iter_mut().filter(|v| **v & 0x8000 != 0).for_each(|v| *v = 0),
            Samples::F32(data) => data.par_iter_mut().filter(|v| **v < 0.0).for_each(|v| *v = 0.0),
        }
    }

    /// The number of texels of so many channels of which a number is negative.
    pub fn count_negative(&self, channels: u8) -> usize {
        let channels = usize::from(channels);
        match self {
            Samples::U8(_) | Samples::U16(_) => 0,
            Samples::F16(data) => data.par_chunks(channels).filter(|t| t.iter().any(|v| *v > 0x8000)).count(),
            Samples::F32(data) => data.par_chunks(channels).filter(|t| t.iter().any(|v| *v < 0.0)).count(),
        }
    }

    /// The number of numbers.
    pub fn len(&self) -> usize {
        match self {
            Samples::U8(data) => data.len(),
            Samples::U16(data) | Samples::F16(data) => data.len(),
            Samples::F32(data) => data.len(),
        }
    }

    /// Whether there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number at a place: a share of the largest integer, or the number itself.
    ///
    /// # Panics
    /// If the place is beyond the end.
    pub fn number(&self, at: usize) -> f32 {
        match self {
            Samples::U8(data) => f32::from(data[at]) / 255.0,
            Samples::U16(data) => f32::from(data[at]) / 65535.0,
            Samples::F16(data) => super::from_half(data[at]),
            Samples::F32(data) => data[at],
        }
    }

    /// The size of the numbers in bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Samples::U8(data) => data.len(),
            Samples::U16(data) | Samples::F16(data) => 2 * data.len(),
            Samples::F32(data) => 4 * data.len(),
        }
    }
}
