//! The exposure that a picture needs, metered as a camera does.

use super::Picture;
use crate::math::Rgb;

/// The luminance that the middle of a picture gets: middle grey, a reflectance of 18 %.
const MIDDLE_GRAY: f64 = 0.18;
/// The share of pixels, the darkest and the brightest, that don't count: lamps, and windows that may be white.
const CUT: f64 = 0.1;
/// How far below the bright parts light may be and still count. What is darker is the background of a lit scene.
const RANGE: f32 = 1.0 / 256.0;

/// The exposure in stops, to a hundredth, with which the picture's middle becomes middle grey.
///
/// The middle is the mean of the logarithms of luminance (Reinhard et al., *Photographic Tone Reproduction for Digital
/// Images*, 2002), over the pixels between the darkest and the brightest tenth. Black pixels don't count, nor those
/// eight stops below the brightest tenth, so that neither the part that isn't rendered yet nor an empty background
/// make a picture bright. A black picture has 0 stops.
pub fn metered_exposure(picture: &Picture) -> f32 {
    let mut light: Vec<f32> =
        (0..picture.pixels.len()).map(|i| luminance(picture.straight(i))).filter(|l| *l > 0.0).collect();
    light.sort_unstable_by(f32::total_cmp);
    let place = |pixels: &[f32], share: f64| (pixels.len() as f64 * share) as usize;
    let Some(bright) = light.get(place(&light, 1.0 - CUT)).copied() else { return 0.0 };
    let counted = &light[light.partition_point(|l| *l < bright * RANGE)..];
    let cut = place(counted, CUT);
    let middle = &counted[cut..counted.len() - cut];
    let mean = middle.iter().map(|l| libm::log2(f64::from(*l))).sum::<f64>() / middle.len() as f64;
    let stops = libm::log2(MIDDLE_GRAY) - mean;
    // Adding 0 makes a negative zero positive.
    ((stops * 100.0).round().clamp(-6400.0, 6400.0) / 100.0) as f32 + 0.0
}

/// The luminance; 0 of what isn't light.
fn luminance(color: Rgb) -> f32 {
    let luminance = color.luminance();
    if luminance.is_finite() { luminance.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(parts: &[(usize, f32)]) -> Picture {
        let pixels: Vec<Rgb> = parts.iter().flat_map(|&(count, v)| vec![Rgb::gray(v); count]).collect();
        Picture { pixels, ..Picture::new(parts.iter().map(|(count, _)| *count as u32).sum(), 1) }
    }

    #[test]
    fn an_even_picture_becomes_middle_grey() {
        for (light, stops) in [(0.18, 0.0), (0.09, 1.0), (0.72, -2.0), (18.0, -6.64), (1e-30, 64.0)] {
            assert_eq!(metered_exposure(&picture(&[(100, light)])), stops, "{light}");
        }
        assert_eq!(metered_exposure(&Picture::new(4, 4)), 0.0);
        assert_eq!(metered_exposure(&Picture::new(0, 0)), 0.0);
        assert_eq!(metered_exposure(&picture(&[(1, f32::NAN), (1, f32::INFINITY), (1, 0.18)])), 0.0);
    }

    /// A black background, a dim one, a lamp and a window change the exposure of a room little or not at all.
    #[test]
    fn windows_and_backgrounds_do_not_matter() {
        assert_eq!(metered_exposure(&picture(&[(800, 0.0), (200, 0.18)])), 0.0);
        assert_eq!(metered_exposure(&picture(&[(800, 0.0004), (200, 0.18)])), 0.0);
        assert_eq!(metered_exposure(&picture(&[(950, 0.18), (50, 1000.0)])), 0.0);
        let stops = metered_exposure(&picture(&[(850, 0.18), (150, 18.0)]));
        assert!((-0.5..0.0).contains(&stops), "{stops}");
    }

    #[test]
    fn a_scaled_picture_has_other_stops() {
        let light: Vec<(usize, f32)> = (1..500).map(|i| (1, (i * i % 97) as f32 * 0.02)).collect();
        let doubled: Vec<(usize, f32)> = light.iter().map(|&(count, v)| (count, 2.0 * v)).collect();
        let [one, two] = [light, doubled].map(|parts| metered_exposure(&picture(&parts)));
        assert!((one - two - 1.0).abs() < 1e-5, "{one} {two}");
    }
}
