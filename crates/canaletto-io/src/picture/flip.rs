//! LDR-FLIP: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, *FLIP: A Difference Evaluator for
//! Alternating Images*, Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020.
//!
//! The two-dimensional filters of the paper are sums of separable filters, and are applied as such. Results agree with
//! the authors' program (1.7, single precision) to 10⁻⁴ in each pixel.

use super::Image;
use super::compare::{Unequal, colors};
use super::convolve::{Kernel, convolve, offsets};
use canaletto::texture::srgb_decode;
use canaletto_parallel::prelude::*;
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// The default viewing condition of the paper: a 0.7 m wide screen of 3840 pixels at a distance of 0.7 m, in pixels per
/// degree.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// The difference that an observer notices when flipping between two pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// The mean over all pixels, 0 to 1.
    pub mean: f64,
    /// The difference of each pixel, 0 to 1, the top row first.
    pub map: Vec<f32>,
}

/// The matrix from linear RGB to XYZ (Rec. 709 primaries, D65).
const TO_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

/// The FLIP of two pictures with sRGB values; values are clamped to 0 to 1.
///
/// # Errors
/// [`Unequal`] if the pictures have no common colours or size.
pub fn flip(reference: &Image, test: &Image, pixels_per_degree: f64) -> Result<Flip, Unequal> {
    let (ca, cb) = colors(reference, test)?;
    let width = reference.width as usize;
    let ppd = if pixels_per_degree.is_finite() { pixels_per_degree.clamp(1.0, 1000.0) } else { PIXELS_PER_DEGREE };
    let (a, b) = (FeatureImage::new(ca, width, ppd), FeatureImage::new(cb, width, ppd));
    let most = hyab(hunt_lab(DVec3::Y), hunt_lab(DVec3::Z)).powf_07();
    let map: Vec<f32> = (0..a.lab.len())
        .into_par_iter()
        .map(|i| {
            let color = redistribute(hyab(a.lab[i], b.lab[i]).powf_07(), most);
            let feature = (a.edges[i] - b.edges[i]).abs().max((a.points[i] - b.points[i]).abs());
            let feature = (feature / 2f64.sqrt()).clamp(0.0, 1.0).sqrt(); // q_f = 0.5
            if color <= 0.0 { 0.0 } else { libm::pow(color, 1.0 - feature) as f32 }
        })
        .collect();
    let mean = map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64;
    Ok(Flip { mean, map })
}

/// The power x^0.7; 0.7 is the paper's q_c.
trait Power {
    fn powf_07(self) -> f64;
}

impl Power for f64 {
    fn powf_07(self) -> f64 {
        libm::pow(self, 0.7)
    }
}

/// The intermediate results for one picture.
struct FeatureImage {
    /// The colours filtered by the contrast sensitivity of the eye, in L*a*b* with the Hunt effect.
    lab: Vec<DVec3>,
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl FeatureImage {
    fn new(colors: [&[f32]; 3], width: usize, ppd: f64) -> FeatureImage {
        let level = |v: f32| if v.is_nan() { 0.0 } else { f64::from(srgb_decode(v.clamp(0.0, 1.0))) };
        let at = |i: usize| to_opponent(DVec3::new(level(colors[0][i]), level(colors[1][i]), level(colors[2][i])));
        let opponent: Vec<DVec3> = (0..colors[0].len()).into_par_iter().map(at).collect();
        let channel = |c: usize| opponent.iter().map(|v| v[c]).collect::<Vec<f64>>();
        let (y, cx, cz) = (channel(0), channel(1), channel(2));

        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
        let sees = |data: &[f64], terms: &[[f64; 2]]| contrast_sensitivity(data, width, terms, radius, ppd);
        let filtered =
            [sees(&y, &[[1.0, 0.0047]]), sees(&cx, &[[1.0, 0.0053]]), sees(&cz, &[[34.1, 0.04], [13.5, 0.025]])];
        let lab = |i: usize| {
            let rgb = from_opponent(DVec3::new(filtered[0][i], filtered[1][i], filtered[2][i]));
            hunt_lab(rgb.clamp(DVec3::ZERO, DVec3::ONE))
        };
        let lab = (0..y.len()).into_par_iter().map(lab).collect();

        let gray: Vec<f64> = y.iter().map(|v| (v + 16.0) / 116.0).collect();
        let (edges, points) = (features(&gray, width, ppd, true), features(&gray, width, ppd, false));
        FeatureImage { lab, edges, points }
    }
}

/// Filters by the contrast sensitivity function, a normalised sum of Gaussians a √(π/b) exp(−π² r²/b), r in degrees.
fn contrast_sensitivity(data: &[f64], width: usize, terms: &[[f64; 2]], radius: usize, ppd: f64) -> Vec<f64> {
    let line =
        |b: f64| offsets(radius).map(move |x| libm::exp(-PI * PI * (x / ppd) * (x / ppd) / b)).collect::<Vec<f64>>();
    let weight = |a: f64, b: f64| a * (PI / b).sqrt();
    let integral = |b: f64| line(b).iter().sum::<f64>();
    let total: f64 = terms.iter().map(|[a, b]| weight(*a, *b) * integral(*b) * integral(*b)).sum();
    let mut out = vec![0.0; data.len()];
    for [a, b] in terms {
        let y = line(*b);
        let x = y.iter().map(|w| w * weight(*a, *b) / total).collect();
        let part = convolve(data, width, &Kernel { x, y });
        out.iter_mut().zip(part).for_each(|(out, v)| *out += v);
    }
    out
}

/// The strength of edges (first derivatives of a Gaussian) or of points (second derivatives).
fn features(gray: &[f64], width: usize, ppd: f64, edges: bool) -> Vec<f64> {
    let sigma = 0.5 * 0.082 * ppd;
    let radius = (3.0 * sigma).ceil() as usize;
    let across = super::convolve::gaussian(sigma, radius);
    let along =
        offsets(radius).zip(&across).map(|(x, g)| if edges { -x * g } else { (x * x / (sigma * sigma) - 1.0) * g });
    let along: Vec<f64> = along.collect();
    // The positive and the negative weights each sum to one.
    let positive: f64 = along.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -along.iter().filter(|w| **w < 0.0).sum::<f64>();
    let along: Vec<f64> = along.iter().map(|w| if *w > 0.0 { w / positive } else { w / negative }).collect();
    let in_x = convolve(gray, width, &Kernel { x: along.clone(), y: across.clone() });
    let in_y = convolve(gray, width, &Kernel { x: across, y: along });
    in_x.iter().zip(in_y).map(|(x, y)| libm::hypot(*x, y)).collect()
}

/// Converts linear RGB to Y Cx Cz.
fn to_opponent(rgb: DVec3) -> DVec3 {
    let v = TO_XYZ * rgb / white();
    DVec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

fn from_opponent(v: DVec3) -> DVec3 {
    let y = (v.x + 16.0) / 116.0;
    TO_XYZ.inverse() * (DVec3::new(y + v.y / 500.0, y, y - v.z / 200.0) * white())
}

fn white() -> DVec3 {
    TO_XYZ * DVec3::ONE
}

/// Converts linear RGB to L*a*b*, in which a* and b* are scaled by the lightness (Hunt effect).
fn hunt_lab(rgb: DVec3) -> DVec3 {
    let f = |v: f64| {
        let delta = 6.0 / 29.0;
        if v > delta * delta * delta { libm::cbrt(v) } else { v / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let v = TO_XYZ * rgb / white();
    let (x, y, z) = (f(v.x), f(v.y), f(v.z));
    let lightness = 116.0 * y - 16.0;
    DVec3::new(lightness, 500.0 * (x - y) * 0.01 * lightness, 200.0 * (y - z) * 0.01 * lightness)
}

/// The HyAB distance, for large colour differences.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    (a.x - b.x).abs() + libm::hypot(a.y - b.y, a.z - b.z)
}

/// Maps errors to 0 to 1: those up to p_c = 0.4 of the largest to [0, p_t = 0.95].
fn redistribute(error: f64, most: f64) -> f64 {
    let (pc, pt) = (0.4 * most, 0.95);
    if error < pc { pt / pc * error } else { pt + (error - pc) / (most - pc) * (1.0 - pt) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(color: [f32; 3]) -> Image {
        Image::from_rgb(24, 24, (0..24 * 24).map(move |_| color))
    }

    #[test]
    fn opponent_space_goes_both_ways() {
        let rgb = DVec3::new(0.2, 0.7, 0.1);
        assert!((from_opponent(to_opponent(rgb)) - rgb).length() < 1e-12);
        assert!((white() - DVec3::new(0.950_428_545, 1.0, 1.088_900_371)).length() < 1e-6);
    }

    #[test]
    fn the_largest_difference_of_colour_is_one() {
        // Constant pictures have no features, so FLIP is the colour difference alone.
        let result = flip(&flat([0.0, 1.0, 0.0]), &flat([0.0, 0.0, 1.0]), PIXELS_PER_DEGREE).unwrap();
        assert!((result.mean - 1.0).abs() < 1e-6, "{}", result.mean);
        // Black and white: ΔL = 100 by the definition of L*.
        let result = flip(&flat([0.0; 3]), &flat([1.0; 3]), PIXELS_PER_DEGREE).unwrap();
        let most = hyab(hunt_lab(DVec3::Y), hunt_lab(DVec3::Z)).powf_07();
        assert!((result.mean - redistribute(100f64.powf_07(), most)).abs() < 1e-6);
    }

    #[test]
    fn order_does_not_matter_and_blur_hides_fine_detail() {
        let with = |period: usize| Image::from_rgb(64, 64, (0..64 * 64).map(move |i| [((i / period) % 2) as f32; 3]));
        let gray = Image::from_rgb(64, 64, (0..64 * 64).map(|_| [0.735_357; 3]));
        let (coarse, fine) = (flip(&gray, &with(16), 67.0).unwrap().mean, flip(&gray, &with(1), 67.0).unwrap().mean);
        assert!(fine < 0.5 * coarse, "{fine} {coarse}");
        assert!((flip(&with(16), &gray, 67.0).unwrap().mean - coarse).abs() < 1e-12);
    }
}
