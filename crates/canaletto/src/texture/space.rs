//! The meaning of an image's numbers.

use crate::named;
use serde::{Deserialize, Serialize};

/// The meaning of an image's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ColorSpace {
    /// Colours on the sRGB curve (IEC 61966-2-1) with linear alpha: pictures for screens.
    #[default]
    Srgb,
    /// Linear colours with alpha.
    Linear,
    /// Numbers that are not colours: heights, normals, masks. They are used unchanged, and the fourth is no alpha that
    /// weights the others.
    Raw,
}

named!(ColorSpace {
    Srgb => "srgb",
    Linear => "linear",
    Raw => "raw",
});

/// Converts a value on the sRGB curve to linear light.
pub fn srgb_decode(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { libm::pow((f64::from(v) + 0.055) / 1.055, 2.4) as f32 }
}

/// Converts linear light to a value on the sRGB curve.
pub(super) fn srgb_encode(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { (1.055 * libm::pow(f64::from(v), 1.0 / 2.4) - 0.055) as f32 }
}
