//! The way of a pixel's colour from linear light to the bytes of a file.

use crate::Named;
use crate::film::{Developer, Picture};
use crate::math::Rgb;
use crate::scene::{FilmSettings, Tone, Transfer};
use serde::Serialize;

/// What becomes of a pixel's colour when its picture is developed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DevelopedNode {
    /// How colours are brought into 0 to 1, as a word of the scene text.
    pub tone: &'static str,
    /// The curve between linear light and the numbers of the file, as a word of the scene text.
    pub transfer: &'static str,
    /// The values on the way. None with `tone "scale"`, which depends on the whole picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<DevelopedValues>,
}

/// A pixel's colour on its way to the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DevelopedValues {
    /// The linear light in 0 to 1.
    pub toned: Rgb,
    /// The light after the curve.
    pub displayed: Rgb,
    /// The bytes in a file of 8 bits, each the nearest to 255 times the value.
    pub bytes: [u8; 3],
}

impl DevelopedNode {
    pub(super) fn new(color: Rgb, film: &FilmSettings) -> DevelopedNode {
        let FilmSettings { tone, transfer, .. } = *film;
        let values = (tone == Tone::Clamp).then(|| {
            let displayed_by = |transfer| {
                let mut values = color.to_array();
                Developer::new(&Picture::new(1, 1), tone, transfer).develop(&mut values);
                values
            };
            let displayed = displayed_by(transfer);
            // Halves are rounded up, as in PNG files.
            let bytes = displayed.map(|v| (f64::from(v * 255.0) + 0.5) as u8);
            DevelopedValues { toned: displayed_by(Transfer::None).into(), displayed: displayed.into(), bytes }
        });
        DevelopedNode { tone: tone.name(), transfer: transfer.name(), values }
    }
}
