//! The colours of glowing bodies by their temperature.
//!
//! Planck's law gives the spectrum. The colour-matching functions of CIE 1931 (2°) are those fitted by Wyman, Sloan &
//! Shirley, *Simple Analytic Approximations to the CIE XYZ Color Matching Functions* (JCGT 2(2), 2013), eq. 4. The
//! primaries are those of sRGB.

use super::Rgb;
use std::ops::RangeInclusive;

/// The temperatures in kelvin whose colours are known: from embers to the hottest stars.
pub const BLACK_BODY_TEMPERATURES: RangeInclusive<f64> = 1000.0..=40_000.0;

/// The second radiation constant hc/k of Planck's law, in nm K.
const C2: f64 = 1.438_776_877e7;

/// A lobe of a colour-matching function: height, place, and width below and above it in nm.
fn lobe(wavelength: f64, height: f64, place: f64, widths: [f64; 2]) -> f64 {
    let x = (wavelength - place) / widths[usize::from(wavelength >= place)];
    height * libm::exp(-0.5 * x * x)
}

/// The tristimulus values of light of one wavelength in nm.
fn color_matching(w: f64) -> [f64; 3] {
    [
        lobe(w, 1.056, 599.8, [37.9, 31.0])
            + lobe(w, 0.362, 442.0, [16.0, 26.7])
            + lobe(w, -0.065, 501.1, [20.4, 26.2]),
        lobe(w, 0.821, 568.8, [46.9, 40.5]) + lobe(w, 0.286, 530.9, [16.3, 31.1]),
        lobe(w, 1.217, 437.0, [11.8, 36.0]) + lobe(w, 0.681, 459.0, [26.0, 13.8]),
    ]
}

/// The linear colour of a black body of this temperature in kelvin, with the luminance 1. Below 1900 K its blue lies
/// outside of the primaries of sRGB and is 0. The temperature is confined to [`BLACK_BODY_TEMPERATURES`].
pub fn black_body(kelvin: f64) -> Rgb {
    let kelvin = kelvin.clamp(*BLACK_BODY_TEMPERATURES.start(), *BLACK_BODY_TEMPERATURES.end());
    let mut sums = [0.0; 3];
    for w in (360..=830).map(f64::from) {
        let x = w / 560.0;
        let planck = 1.0 / (x * x * x * x * x * libm::expm1(C2 / (w * kelvin)));
        sums.iter_mut().zip(color_matching(w)).for_each(|(sum, v)| *sum += planck * v);
    }
    let [x, y, z] = sums.map(|v| v / sums[1]);
    let linear = [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ]
    .map(|v: f64| v.max(0.0));
    let luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    Rgb::from(linear.map(|v| (v / luminance) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The chromaticity of a colour: x and y of CIE 1931.
    fn chromaticity(color: Rgb) -> [f64; 2] {
        let [r, g, b] = color.to_array().map(f64::from);
        let x = 0.4124 * r + 0.3576 * g + 0.1805 * b;
        let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        let z = 0.0193 * r + 0.1192 * g + 0.9505 * b;
        [x, y].map(|v| v / (x + y + z))
    }

    /// Points of the Planckian locus: illuminant A and other published ones (Wyszecki & Stiles, *Color Science*).
    #[test]
    fn colors_lie_on_the_planckian_locus() {
        for (kelvin, x, y) in [
            (2000.0, 0.5267, 0.4133),
            (2856.0, 0.4476, 0.4074),
            (4000.0, 0.3805, 0.3768),
            (6500.0, 0.3135, 0.3237),
            (10_000.0, 0.2807, 0.2884),
        ] {
            let [ours_x, ours_y] = chromaticity(black_body(kelvin));
            assert!((ours_x - x).abs() < 0.003 && (ours_y - y).abs() < 0.003, "{kelvin} K: {ours_x} {ours_y}");
        }
    }

    #[test]
    fn every_temperature_has_the_luminance_1() {
        for kelvin in [0.0, 1000.0, 1500.0, 2700.0, 6504.0, 40_000.0, 1e9] {
            let color = black_body(kelvin);
            let [r, g, b] = color.to_array();
            assert!((0.2126 * r + 0.7152 * g + 0.0722 * b - 1.0).abs() < 1e-5, "{kelvin} K: {color:?}");
            assert!(r >= 0.0 && g > 0.0 && b >= 0.0, "{kelvin} K: {color:?}");
        }
        assert!(black_body(2700.0).r > 4.0 * black_body(2700.0).b && black_body(20_000.0).b > black_body(20_000.0).r);
    }
}
