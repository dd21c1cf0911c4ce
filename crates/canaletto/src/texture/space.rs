//! What the numbers of an image mean.

use serde::{Deserialize, Serialize};

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ColorSpace {
    /// Colours on the sRGB curve (IEC 61966-2-1) with linear alpha: pictures for screens.
    #[default]
    Srgb,
    /// Linear colours with alpha.
    Linear,
    /// No colours: heights, normals, masks. Numbers are taken as they are, and the fourth is no alpha that weighs the
    /// others.
    Raw,
}

impl ColorSpace {
    /// Whether a last channel of two or four is an alpha.
    pub(super) fn has_alpha(self) -> bool {
        self != ColorSpace::Raw
    }
}

/// From a value on the sRGB curve to linear light.
pub fn srgb_decode(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { libm::pow((f64::from(v) + 0.055) / 1.055, 2.4) as f32 }
}
