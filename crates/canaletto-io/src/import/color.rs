//! The scale of colours with numbers above 1.

/// The number that stands for full intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    One,
    /// 8-bit numbers up to 255.
    Bytes,
    /// 16-bit numbers up to 65535.
    Tokens,
}

/// The largest number above 1 that is taken as rounding.
pub(super) const ROUNDED: f32 = 1.001;

/// The smallest fractional number that is taken as part of a picture, not as bright light.
const PICTURE: f32 = 16.0;

impl Scale {
    /// The scale of colours with this largest number; `None` if it exceeds all scales. Integers above 1 are those of an
    /// 8-bit or 16-bit picture. If any number has a fraction, numbers below 16 are light brighter than white.
    pub(super) fn of(largest: f32, fraction: bool) -> Option<Scale> {
        match largest {
            ..=ROUNDED => Some(Scale::One),
            v if fraction && v < PICTURE => Some(Scale::One),
            ..=255.0 => Some(Scale::Bytes),
            ..=65535.0 => Some(Scale::Tokens),
            _ => None,
        }
    }

    /// The number of full intensity.
    pub(super) fn most(self) -> f32 {
        match self {
            Scale::One => 1.0,
            Scale::Bytes => 255.0,
            Scale::Tokens => 65535.0,
        }
    }

    /// The end of a message about colours with numbers above 1.
    pub(super) fn assumed(self) -> &'static str {
        match self {
            Scale::One => "goes beyond 1 and is taken as it is, brighter than white",
            Scale::Bytes => "goes beyond 1, so it is read as going from 0 to 255",
            Scale::Tokens => "goes beyond 255, so it is read as going from 0 to 65535",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_those_of_pictures() {
        for (largest, fraction, scale) in [
            (0.0, false, Some(Scale::One)),
            (1.0, false, Some(Scale::One)),
            (1.0005, true, Some(Scale::One)),
            (2.0, false, Some(Scale::Bytes)),
            (2.0, true, Some(Scale::One)),
            (15.9, true, Some(Scale::One)),
            (16.0, true, Some(Scale::Bytes)),
            (255.0, true, Some(Scale::Bytes)),
            (256.0, false, Some(Scale::Tokens)),
            (65536.0, false, None),
        ] {
            assert_eq!(Scale::of(largest, fraction), scale, "{largest} {fraction}");
        }
    }
}
