//! What colours stand for that go beyond 1.

/// The number that stands for full intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    One,
    /// 255.
    Bytes,
    /// 65535.
    Words,
}

impl Scale {
    /// The scale of colours whose largest number this is, unless it is beyond all. What is a little more than 1 is a bright
    /// colour; twice as much is nobody's.
    pub(super) fn of(largest: f32) -> Option<Scale> {
        match largest {
            ..=2.0 => Some(Scale::One),
            ..=255.0 => Some(Scale::Bytes),
            ..=65535.0 => Some(Scale::Words),
            _ => None,
        }
    }

    /// Full intensity.
    pub(super) fn most(self) -> f32 {
        match self {
            Scale::One => 1.0,
            Scale::Bytes => 255.0,
            Scale::Words => 65535.0,
        }
    }

    /// Completes a message about colours.
    pub(super) fn assumed(self) -> &'static str {
        match self {
            Scale::One => "is read from 0 to 1",
            Scale::Bytes => "goes beyond 1, so it is read as going from 0 to 255",
            Scale::Words => "goes beyond 255, so it is read as going from 0 to 65535",
        }
    }
}
