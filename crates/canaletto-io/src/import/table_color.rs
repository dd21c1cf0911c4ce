//! Colours of tables, converted to linear values from 0 to 1.
//!
//! Files don't declare which numbers are white. Integers of one and two bytes are fractions of their largest value;
//! reals are linear from 0 to 1. Where the numbers of a file contradict that, [`Scale`] decides, and a warning reports
//! the assumption. A scene may say which they are.

use super::color::{ROUNDED, Scale};
use super::lines::ImportError;
use canaletto::math::Rgb;
use canaletto::texture::{ColorSpace, srgb_decode};
use canaletto_parallel::prelude::*;

/// The type of the colours in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Written {
    /// Integers of one byte, of which 255 is white.
    Byte,
    /// Integers up to this one.
    Whole(f32),
    /// Numbers with a fraction, or of a text without types.
    Real,
}

/// The properties that all colour numbers of a file have in common.
#[derive(Clone, Copy, Default)]
struct Range {
    most: f32,
    fraction: bool,
    /// The number of colours with a negative component.
    negative: u64,
    /// The number of colours with a NaN or infinite component.
    missing: u64,
}

impl Range {
    fn of(colors: &[Rgb]) -> Range {
        let one = |mut range: Range, color: &Rgb| {
            let channels = color.to_array();
            if channels.iter().any(|v| !v.is_finite()) {
                range.missing += 1;
                return range;
            }
            range.negative += u64::from(channels.iter().any(|v| *v < 0.0));
            range.fraction |= channels.iter().any(|v| v.fract() != 0.0);
            range.most = channels.iter().fold(range.most, |most, v| most.max(*v));
            range
        };
        let join = |a: Range, b: Range| Range {
            most: a.most.max(b.most),
            fraction: a.fraction | b.fraction,
            negative: a.negative + b.negative,
            missing: a.missing + b.missing,
        };
        colors.par_chunks(4096).map(|colors| colors.iter().fold(Range::default(), one)).reduce(Range::default, join)
    }
}

/// Converts the numbers of a file to linear colours. Negative numbers become 0; colours with NaN or infinity become
/// white. Returns warnings about assumptions; `of` names the elements with colours, such as "vertices". `space` is what
/// the scene says of the numbers: on the sRGB curve or linear.
pub(super) fn normalise(colors: &mut [Rgb], written: Written, space: Option<ColorSpace>, of: &str) -> Vec<ImportError> {
    let range = Range::of(colors);
    let Range { most, fraction, negative, missing } = range;
    let mut said = Vec::new();
    let white = match written {
        Written::Whole(largest) => {
            let white = Scale::of(most, false).map_or(largest, Scale::most).min(largest);
            // Black is equal in every scale.
            if white != largest && most > 0.0 {
                let kind = if largest == 65535.0 { "16-bit numbers" } else { "whole numbers" };
                said.push(ImportError::file(format!(
                    "the colours of its {of} are {kind} up to {most} only; they are taken as {} from 0 to {white}",
                    if space == Some(ColorSpace::Linear) { "linear" } else { "sRGB" }
                )));
            }
            Some(white)
        }
        Written::Byte => Some(255.0),
        Written::Real if space == Some(ColorSpace::Linear) => None,
        Written::Real if space.is_some() => {
            let scale = Scale::of(most, fraction).unwrap_or(Scale::One);
            if scale == Scale::One && most > ROUNDED {
                said.push(ImportError::file(format!(
                    "the colours of its {of} go up to {most}; they are taken as sRGB with 1 as white"
                )));
            }
            Some(scale.most())
        }
        Written::Real if most <= ROUNDED => None,
        Written::Real => {
            let white = Scale::of(most, fraction).filter(|scale| *scale != Scale::One).map(Scale::most);
            said.push(ImportError::file(match white {
                Some(white) => format!(
                    "the colours of its {of} go up to {most}; they are taken as sRGB from 0 to {white}, not as linear \
                     from 0 to 1"
                ),
                None => format!(
                    "the colours of its {of} go up to {most}; they are taken as they are, linear, with 1 as white"
                ),
            }));
            white
        }
    };
    if negative > 0 {
        said.push(ImportError::file(format!(
            "{negative} colours of its {of} have a negative number; it is taken as 0"
        )));
    }
    if missing > 0 {
        said.push(ImportError::file(format!(
            "{missing} colours of its {of} have a number that isn't finite; they are taken as white"
        )));
    }
    let channel = |v: f32| match white {
        Some(white) if space == Some(ColorSpace::Linear) => v.max(0.0) / white,
        Some(white) => srgb_decode(v.max(0.0) / white),
        None => v.max(0.0),
    };
    if white.is_some() || negative + missing > 0 {
        colors.par_iter_mut().with_min_len(4096).for_each(|color| {
            let finite = color.to_array().iter().all(|v| v.is_finite());
            *color = if finite { color.to_array().map(channel).into() } else { Rgb::WHITE };
        });
    }
    said
}

/// Converts the colours of rows in a scene, whose numbers are said to be of this space. Returns warnings.
pub(crate) fn colors_of_rows(colors: &mut [Rgb], space: ColorSpace) -> Vec<String> {
    normalise(colors, Written::Real, Some(space), "rows").into_iter().map(|said| said.message).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(channels: &[f32], written: Written) -> (Vec<f32>, String) {
        let mut colors: Vec<Rgb> = channels.iter().map(|v| Rgb::gray(*v)).collect();
        let said = normalise(&mut colors, written, None, "points");
        (colors.iter().map(|c| c.g).collect(), said.into_iter().map(|c| c.message).collect::<Vec<_>>().join("; "))
    }

    #[test]
    fn the_largest_number_tells_what_is_white() {
        // The curve of IEC 61966-2-1 at one half.
        let half = 0.214_041_14;
        for (channels, written, middle, said) in [
            ([0.0, 0.5, 1.0], Written::Real, 0.5, ""),
            ([0.0, 127.5, 255.0], Written::Real, half, "go up to 255; they are taken as sRGB from 0 to 255"),
            ([0.0, 127.5, 250.0], Written::Real, half, "go up to 250; they are taken as sRGB from 0 to 255"),
            ([0.0, 32767.5, 65535.0], Written::Real, half, "sRGB from 0 to 65535"),
            ([0.0, 0.5, 3.5], Written::Real, 0.5, "go up to 3.5; they are taken as they are, linear"),
            ([0.0, 0.5, 1e6], Written::Real, 0.5, "as they are"),
            ([0.0, 127.5, 255.0], Written::Whole(65535.0), half, "16-bit numbers up to 255 only"),
            ([0.0, 32767.5, 60000.0], Written::Whole(65535.0), half, ""),
            ([0.0, 127.5, 255.0], Written::Whole(4_294_967_295.0), half, "whole numbers up to 255 only"),
            (
                [0.0, 32767.5, 60000.0],
                Written::Whole(2_147_483_647.0),
                half,
                "up to 60000 only; they are taken as sRGB from 0 to 65535",
            ),
            ([0.0, 2_147_483_648.0, 4e9], Written::Whole(4_294_967_295.0), half, ""),
            ([0.0, 0.0, 0.0], Written::Whole(65535.0), 0.0, ""),
        ] {
            let (found, message) = settled(&channels, written);
            assert!((found[1] - middle).abs() < 1e-4, "{channels:?} {written:?}: {found:?}");
            assert!(
                if said.is_empty() { message.is_empty() } else { message.contains(said) },
                "{channels:?}: {message}"
            );
        }
        // 0 and 1 of an integer type are black and white.
        assert_eq!(settled(&[0.0, 1.0, 1.0], Written::Whole(65535.0)).0, [0.0, 1.0, 1.0]);
    }

    #[test]
    fn the_scene_may_say_which_curve_they_are_on() {
        // The curve of IEC 61966-2-1 at one half.
        let half = 0.214_041_14;
        for (channels, written, space, middle, said) in [
            ([0.0, 0.5, 1.0], Written::Real, ColorSpace::Srgb, half, ""),
            ([0.0, 127.5, 255.0], Written::Real, ColorSpace::Srgb, half, ""),
            ([0.0, 127.5, 250.0], Written::Real, ColorSpace::Srgb, half, ""),
            ([0.0, 32767.5, 65535.0], Written::Real, ColorSpace::Srgb, half, ""),
            ([0.0, 0.5, 3.5], Written::Real, ColorSpace::Srgb, half, "go up to 3.5; they are taken as sRGB with 1"),
            ([0.0, 0.5, 1.0], Written::Real, ColorSpace::Linear, 0.5, ""),
            ([0.0, 20.0, 300.0], Written::Real, ColorSpace::Linear, 20.0, ""),
            ([0.0, 51.0, 255.0], Written::Byte, ColorSpace::Linear, 0.2, ""),
            ([0.0, 127.5, 255.0], Written::Byte, ColorSpace::Srgb, half, ""),
            ([0.0, 6553.5, 60000.0], Written::Whole(65535.0), ColorSpace::Linear, 0.1, ""),
            ([0.0, 51.0, 255.0], Written::Whole(65535.0), ColorSpace::Linear, 0.2, "taken as linear from 0 to 255"),
        ] {
            let mut colors: Vec<Rgb> = channels.iter().map(|v| Rgb::gray(*v)).collect();
            let messages = normalise(&mut colors, written, Some(space), "points");
            let message = messages.into_iter().map(|c| c.message).collect::<String>();
            assert!((colors[1].g - middle).abs() < 1e-4, "{channels:?} {written:?} {space:?}: {colors:?}");
            assert!(message.is_empty() == said.is_empty() && message.contains(said), "{channels:?}: {message}");
        }
    }

    #[test]
    fn what_is_no_colour_is_said() {
        let (found, said) = settled(&[-1.0, f32::NAN, 0.5, f32::INFINITY], Written::Real);
        assert_eq!(found, [0.0, 1.0, 0.5, 1.0]);
        assert!(
            said.contains("1 colours of its points have a negative number") && said.contains("2 colours"),
            "{said}"
        );
    }
}
