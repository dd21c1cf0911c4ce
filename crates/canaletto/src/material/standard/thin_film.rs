//! The colours of a thin film (Belcour & Barla, *A Practical Extension to Microfacet Theory for the Modeling of Varying
//! Iridescence*, 2017).
//!
//! Light that is reflected at both sides of the film interferes. By wavelength, the reflection is a sum of cosines of
//! the optical path. The response of the eye to each is known in closed form, so that a few terms give red, green and
//! blue. The constants of the response are the paper's.
//!
//! Deviation: what a film over a metal sends back has the phase of a metal of infinite index, since the metal's own
//! index is not known. White is that of equal energy at all wavelengths, so that a film of no thickness is colourless.

use crate::math::Rgb;
use std::f64::consts::TAU;

/// What lies under a film.
#[derive(Clone, Copy, Debug)]
pub(super) enum UnderFilm {
    /// A dielectric of this η.
    Dielectric(f64),
    /// A metal with this reflection at the angle inside the film.
    Metal([f64; 3]),
}

/// The Gaussian fits to the Fourier transforms of the colour-matching functions x, y, z, and of the second lobe of x:
/// height, position and variance.
const RESPONSE: [[f64; 3]; 4] = [
    [5.485_6e-13, 1.681_0e6, 4.327_8e9],
    [4.420_1e-13, 1.795_3e6, 9.304_6e9],
    [5.248_1e-13, 2.208_4e6, 6.612_1e9],
    [9.747_0e-14, 2.239_9e6, 4.528_2e9],
];

/// The rows of the map from XYZ to linear sRGB, each divided by its sum.
const TO_RGB: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// The mean of cos(2π D / λ) over the response of red, green and blue, for a path of D metres.
fn response(path: f64) -> [f64; 3] {
    let phase = TAU * path;
    let lobe = |[height, position, variance]: [f64; 3]| {
        height * (TAU * variance).sqrt() * libm::cos(position * phase) * libm::exp(-variance * phase * phase)
    };
    let [x, y, z, second] = RESPONSE.map(lobe);
    let at_zero = RESPONSE.map(|[height, _, variance]| height * (TAU * variance).sqrt());
    let xyz = [(x + second) / (at_zero[0] + at_zero[3]), y / at_zero[1], z / at_zero[2]];
    TO_RGB.map(|row| {
        let sum: f64 = row.iter().sum();
        row.iter().zip(xyz).map(|(m, v)| m * v).sum::<f64>() / sum
    })
}

/// The amplitudes that a boundary reflects, across and along the plane of incidence, with the cosine beyond it. The
/// first is 1 beyond the critical angle.
fn amplitudes(cos: f64, eta_ratio: f64) -> ([f64; 2], Option<f64>) {
    let sin2 = eta_ratio * eta_ratio * (1.0 - cos * cos);
    if sin2 >= 1.0 {
        return ([1.0; 2], None);
    }
    let beyond = (1.0 - sin2).sqrt();
    let across = (eta_ratio * cos - beyond) / (eta_ratio * cos + beyond);
    let along = (cos - eta_ratio * beyond) / (cos + eta_ratio * beyond);
    ([across, along], Some(beyond))
}

/// The share that a film mirrors in air. `cos` ≥ 0 is the cosine of the angle of incidence, `ior` the film's η, and
/// `thickness` is in micrometres.
pub(super) fn reflectance(cos: f64, ior: f64, thickness: f64, under: impl Fn(f64) -> UnderFilm) -> Rgb {
    let (first, Some(inside)) = amplitudes(cos, 1.0 / ior) else { return Rgb::WHITE };
    let under = under(inside);
    // The second boundary's amplitudes by polarisation and colour.
    let second = match under {
        UnderFilm::Dielectric(eta) => amplitudes(inside, ior / eta).0.map(|r| [r; 3]),
        UnderFilm::Metal(share) => [share.map(|f| -f.sqrt()); 2],
    };
    // Twice the film's thickness along the ray.
    let path = 2.0 * ior * thickness * 1e-6 * inside;
    let terms = [response(path), response(2.0 * path)];
    Rgb::from([0, 1, 2].map(|c: usize| {
        let mut mean = 0.0;
        for (r12, r23) in first.iter().zip(second) {
            let (r12_squared, r23) = (r12 * r12, r23[c]);
            let (through, r23_squared) = (1.0 - r12_squared, r23 * r23);
            // The light that leaves after any number of reflections in the film, without interference.
            let later = through * through * r23_squared / (1.0 - r12_squared * r23_squared).max(1e-9);
            // r21 r23, whose powers are the amplitudes of the terms; r21 = −r12.
            let turn = -r12 * r23;
            let mut sum = r12_squared + later;
            let mut power = 1.0;
            for term in &terms {
                power *= turn;
                sum += 2.0 * (later - through) * power * term[c];
            }
            mean += 0.5 * sum;
        }
        mean.clamp(0.0, 1.0) as f32
    }))
}
