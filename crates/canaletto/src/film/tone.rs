//! Tone curves that keep a picture's dark and bright parts in the range of a display, as published.

use crate::math::Rgb;
use serde::Serialize;

/// A colour on its way through AgX (Troy Sobotka, *AgX*, 2022), the filmic tone mapping.
///
/// Matrices and curve are those of Benjamin Wrensch, *Minimal AgX Implementation*, 2023, for the primaries of sRGB. The
/// curve is his fit of Sobotka's default contrast by a polynomial of degree 6. There is no look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Agx {
    /// The colour after the inset matrix, by which saturated colours get a share of the others.
    pub inset: Rgb,
    /// The place of its binary logarithm between -12.47393 (0) and 4.026069 (1), cut to 0 to 1. Middle grey, 0.18, has
    /// 10 stops below it and 6.5 above it.
    pub logarithm: Rgb,
    /// The polynomial of that.
    pub curve: Rgb,
    /// After the outset matrix, the inverse of the inset: the numbers for a display of exponent 2.2.
    pub outset: Rgb,
    /// The linear light of such a display: the power of 2.2.
    pub linear: Rgb,
}

/// The columns of the inset matrix: what red, green and blue become.
const INSET: [[f32; 3]; 3] = [
    [0.842_479_06, 0.042_328_242, 0.042_375_655],
    [0.078_433_6, 0.878_468_64, 0.078_433_6],
    [0.079_223_745, 0.079_166_13, 0.879_143],
];

/// The columns of the outset matrix.
const OUTSET: [[f32; 3]; 3] = [
    [1.196_879, -0.052_896_852, -0.052_971_636],
    [-0.098_020_88, 1.151_903_1, -0.098_043_45],
    [-0.099_029_74, -0.098_961_177, 1.151_073_7],
];

/// The binary logarithms of the darkest and the brightest light that differ from black and white.
const STOPS: [f32; 2] = [-12.473_93, 4.026_069];

/// The smallest light that has a logarithm here.
const LEAST: f32 = 1e-10;

impl Agx {
    /// Maps a colour whose components are finite and not negative.
    pub fn of(color: Rgb) -> Agx {
        let inset = product(&INSET, color);
        let [low, high] = STOPS;
        let logarithm = inset.map(|v| ((libm::log2f(v.max(LEAST)) - low) / (high - low)).clamp(0.0, 1.0));
        let curve = logarithm.map(|x| {
            let x2 = x * x;
            let x4 = x2 * x2;
            15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.002_32
        });
        let outset = product(&OUTSET, curve);
        Agx { inset, logarithm, curve, outset, linear: outset.map(|v| libm::powf(v.max(0.0), 2.2)) }
    }
}

/// A colour on its way through the Khronos PBR Neutral Tone Mapper (specification of 2024).
///
/// Its colours are those of materials under white light, but for the 0.04 that Fresnel's reflection adds to them. Only
/// highlights are compressed and lose saturation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PbrNeutral {
    /// What is subtracted for Fresnel's reflection: 0.04, or less of dark colours.
    pub offset: f32,
    /// The largest component after that.
    pub peak: f32,
    /// The largest component of the result: the peak, or less from 0.76 on.
    pub compressed_peak: f32,
    /// The share of white in the result.
    pub white: f32,
    /// The result in linear light.
    pub linear: Rgb,
}

/// The peak from which highlights are compressed.
const START_COMPRESSION: f32 = 0.8 - 0.04;
/// How fast compressed highlights lose saturation.
const DESATURATION: f32 = 0.15;

impl PbrNeutral {
    /// Maps a colour whose components are finite and not negative.
    pub fn of(color: Rgb) -> PbrNeutral {
        let x = color.r.min(color.g).min(color.b);
        let offset = if x < 0.08 { x - 6.25 * x * x } else { 0.04 };
        let color = color.map(|v| v - offset);
        let peak = color.max_component();
        if peak < START_COMPRESSION {
            return PbrNeutral { offset, peak, compressed_peak: peak, white: 0.0, linear: color };
        }
        let d = 1.0 - START_COMPRESSION;
        let compressed_peak = 1.0 - d * d / (peak + d - START_COMPRESSION);
        let white = 1.0 - 1.0 / (DESATURATION * (peak - compressed_peak) + 1.0);
        let linear = color.map(|v| v * (compressed_peak / peak) * (1.0 - white) + compressed_peak * white);
        PbrNeutral { offset, peak, compressed_peak, white, linear }
    }
}

/// The product of a matrix of columns with a colour.
fn product([r, g, b]: &[[f32; 3]; 3], color: Rgb) -> Rgb {
    let row = |i: usize| r[i] * color.r + g[i] * color.g + b[i] * color.b;
    Rgb::new(row(0), row(1), row(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(actual: Rgb, expected: [f64; 3], color: [f32; 3]) {
        for (actual, expected) in actual.to_array().into_iter().zip(expected) {
            assert!((f64::from(actual) - expected).abs() < 2e-5, "{color:?}: {actual}, not {expected}");
        }
    }

    /// The expected numbers are the published formulas in double precision, evaluated by another program.
    #[test]
    fn agx_has_the_published_values() {
        for (color, linear) in [
            ([0.18, 0.18, 0.18], [0.214_467, 0.214_533, 0.214_537]),
            ([1.0, 1.0, 1.0], [0.589_977, 0.590_207, 0.590_221]),
            ([4.0, 1.0, 0.25], [0.917_927, 0.615_797, 0.374_931]),
            ([0.0, 0.0, 0.05], [0.000_268, 0.000_268, 0.068_215]),
            ([20.0, 16.0, 12.0], [0.999_021, 0.996_155, 0.971_235]),
            ([100.0, 0.0, 0.0], [1.022_902, 0.862_132, 0.862_334]),
            ([0.02, 0.5, 0.3], [0.071_425, 0.440_468, 0.320_523]),
        ] {
            assert_near(Agx::of(Rgb::from(color)).linear, linear, color);
        }
        let steps = Agx::of(Rgb::new(4.0, 1.0, 0.25));
        assert_near(steps.inset, [3.468_155_8, 1.067_573_1, 0.467_722], [4.0, 1.0, 0.25]);
        assert_near(steps.logarithm, [0.864_733_3, 0.761_713_1, 0.689_554_8], [4.0, 1.0, 0.25]);
        assert_near(steps.curve, [0.923_957_2, 0.796_116_3, 0.666_539_2], [4.0, 1.0, 0.25]);
        assert_near(steps.outset, [0.961_821_8, 0.802_213, 0.640_238_2], [4.0, 1.0, 0.25]);
    }

    #[test]
    fn pbr_neutral_has_the_published_values() {
        for (color, linear) in [
            ([0.18, 0.18, 0.18], [0.14, 0.14, 0.14]),
            ([1.0, 1.0, 1.0], [0.869_091, 0.869_091, 0.869_091]),
            ([4.0, 1.0, 0.25], [0.983_256, 0.468_299, 0.339_560]),
            ([0.0, 0.0, 0.05], [0.0, 0.0, 0.05]),
            ([20.0, 16.0, 12.0], [0.997_037, 0.945_064, 0.893_091]),
            ([100.0, 0.0, 0.0], [0.999_421, 0.936_366, 0.936_366]),
            ([0.02, 0.5, 0.3], [0.0025, 0.4825, 0.2825]),
        ] {
            assert_near(PbrNeutral::of(Rgb::from(color)).linear, linear, color);
        }
    }

    /// Grey ramps rise: more light is never darker. Black and the brightest light that there is stay in range.
    #[test]
    fn curves_rise_and_stay_in_range() {
        let mut before = [-1.0; 2];
        for step in -200..=2032 {
            let v = libm::exp2f(step as f32 / 16.0).min(f32::MAX);
            let gray = Rgb::gray(v);
            let shown = [Agx::of(gray).linear.g, PbrNeutral::of(gray).linear.g];
            for (now, before) in shown.into_iter().zip(before) {
                assert!(now >= before && (0.0..=1.01).contains(&now), "{v}: {now} after {before}");
            }
            before = shown;
        }
        assert!(Agx::of(Rgb::BLACK).linear.max_component() == 0.0 && PbrNeutral::of(Rgb::BLACK).linear.is_black());
        for color in [Rgb::gray(f32::MAX), Rgb::new(f32::MAX, 0.0, 0.0)] {
            assert!(Agx::of(color).linear.is_finite() && PbrNeutral::of(color).linear.is_finite());
        }
    }
}
