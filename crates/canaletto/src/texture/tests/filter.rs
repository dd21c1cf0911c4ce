//! Image textures as a whole: filters and prefilters against exact values and against sampled references.

use super::super::*;
use crate::Named;
use glam::DVec3;

fn image(width: u32, height: u32, channels: u8, samples: Samples, space: ColorSpace) -> Image {
    Image { name: "test".into(), width, height, channels, samples, space, premultiplied: false }
}

fn pattern(image: Image, texture: ImageTexture) -> PreparedTexture {
    let texture = Texture { name: "t".into(), kind: TextureKind::Image(texture) };
    PreparedTexture::resolve(vec![image], &[texture]).unwrap().remove(0)
}

fn point(u: f64, v: f64) -> Lookup {
    Lookup::point(DVec3::new(u, v, 0.0))
}

#[test]
fn corners_are_the_corner_texels_as_in_the_chapter() {
    let samples = Samples::F32(vec![1.0, 2.0, 3.0, 4.0]);
    let pattern = pattern(image(2, 2, 1, samples, ColorSpace::Linear), ImageTexture::new(0));
    let at = |u, v| pattern.eval(&point(u, v));
    assert_eq!(at(0.0, 0.0), [1.0, 1.0, 1.0, 1.0]);
    assert_eq!(at(1.0, 0.0)[0], 2.0);
    assert_eq!(at(1.0, 1.0)[0], 4.0);
    assert_eq!(at(0.25, 0.5)[0], 2.25);
}

/// A pseudo-random number in [0, 1).
fn noise(i: u32) -> f32 {
    let mut x = i.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x = (x ^ x >> 15).wrapping_mul(0x2c1b_3c6d);
    x = (x ^ x >> 12).wrapping_mul(0x297a_2d39);
    ((x ^ x >> 15) >> 8) as f32 / 16_777_216.0
}

/// The mean over a footprint of the finest level's function. The weight is (1 − r²)² over 64 × 64 places of the
/// circle's square.
fn reference(pattern: &PreparedTexture, lookup: &Lookup) -> [f64; 4] {
    let (mut sum, mut total) = ([0.0; 4], 0.0);
    for i in 0..64 {
        for j in 0..64 {
            let (p, q) = ((f64::from(i) + 0.5) / 32.0 - 1.0, (f64::from(j) + 0.5) / 32.0 - 1.0);
            let rest = (1.0 - p * p - q * q).max(0.0);
            let weight = rest * rest;
            let value = pattern.eval(&Lookup::point(lookup.at + lookup.dx * p + lookup.dy * q));
            for c in 0..4 {
                sum[c] += weight * f64::from(value[c]);
            }
            total += weight;
        }
    }
    sum.map(|v| v / total)
}

/// Footprints of many sizes, directions and eccentricities up to a bound, in texels.
fn footprints(count: u32, longest: f64, thinnest: f64) -> impl Iterator<Item = (f64, f64, [f64; 2], [f64; 2])> {
    (0..count).map(move |i| {
        let r = |k: u32| f64::from(noise(i * 16 + k));
        let major = longest.powf(r(0));
        let minor = (major / (1.0 + (thinnest - 1.0) * r(1))).max(0.01);
        let angle = r(2) * std::f64::consts::TAU;
        let (sin, cos) = angle.sin_cos();
        // Conjugate radii of one ellipse.
        let (s, c) = (r(3) * std::f64::consts::TAU).sin_cos();
        let along = [major * cos, major * sin];
        let across = [-minor * sin, minor * cos];
        let dx = [along[0] * c + across[0] * s, along[1] * c + across[1] * s];
        let dy = [-along[0] * s + across[0] * c, -along[1] * s + across[1] * c];
        (r(4), r(5), dx, dy)
    })
}

/// The root mean square error over footprints.
fn error(pattern: &PreparedTexture, width: f64, height: f64, longest: f64, thinnest: f64) -> f64 {
    let count = 150;
    let mut square = 0.0;
    for (u, v, dx, dy) in footprints(count, longest, thinnest) {
        let scale = |d: [f64; 2]| DVec3::new(d[0] / width, d[1] / height, 0.0);
        let lookup = Lookup { at: DVec3::new(u * 3.0 - 1.0, v * 3.0 - 1.0, 0.0), dx: scale(dx), dy: scale(dy) };
        let (got, exact) = (pattern.eval(&lookup), reference(pattern, &lookup));
        square += (0..4).map(|c| (f64::from(got[c]) - exact[c]).powi(2)).sum::<f64>() / 4.0;
    }
    (square / f64::from(count)).sqrt()
}

fn plain(filter: Filter, prefilter: Prefilter) -> ImageTexture {
    ImageTexture { filter, prefilter, placement: Placement::Edges, ..ImageTexture::new(0) }
}

#[test]
fn ewa_is_the_mean_over_the_footprint() {
    // White noise in 0 to 1, the hardest of textures; its standard deviation is 0.29.
    for (width, height) in [(64u32, 64u32), (61, 45)] {
        let samples: Vec<f32> = (0..width * height * 4).map(noise).collect();
        let e = |prefilter, longest, thinnest| {
            let image = image(width, height, 4, Samples::F32(samples.clone()), ColorSpace::Raw);
            let pattern = pattern(image, plain(Filter::Bilinear, prefilter));
            error(&pattern, f64::from(width), f64::from(height), longest, thinnest)
        };
        for (longest, thinnest) in [(2.0, 1.0), (2.0, 16.0), (8.0, 4.0), (40.0, 1.0), (40.0, 16.0)] {
            let [ewa, trilinear, none] =
                [Prefilter::Ewa, Prefilter::Trilinear, Prefilter::None].map(|p| e(p, longest, thinnest));
            println!("{width} × {height}, up to {longest}, {thinnest}: {ewa:.4}, {trilinear:.4}, {none:.4}");
            assert!(ewa < 0.022 && ewa < 0.45 * trilinear && trilinear < none, "{longest} {thinnest}");
        }
    }
}

#[test]
fn ewa_respects_what_is_outside() {
    let (width, height) = (31, 24);
    let samples: Vec<f32> = (0..width * height * 4).map(noise).collect();
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black, Wrap::Transparent] {
        for placement in [Placement::Edges, Placement::Centers] {
            let image = image(width, height, 4, Samples::F32(samples.clone()), ColorSpace::Raw);
            let texture = ImageTexture { wrap: [wrap; 2], placement, ..plain(Filter::Bilinear, Prefilter::Ewa) };
            let pattern = pattern(image, texture);
            let error = error(&pattern, f64::from(width), f64::from(height), 20.0, 4.0);
            println!("{wrap:?} {placement:?} {error:.4}");
            let bound = match (wrap, placement) {
                // The outside of a clamped image is its border, and the border of a coarser level is broader.
                (Wrap::Clamp, _) => 0.11,
                (_, Placement::Edges) => 0.02,
                // Tiles whose border runs through their outer texels repeat with a jump inside of coarser texels.
                (_, Placement::Centers) => 0.03,
            };
            assert!(error < bound, "{wrap:?} {placement:?}");
        }
    }
}

#[test]
fn constants_are_reproduced_by_everything() {
    for prefilter in [Prefilter::None, Prefilter::Trilinear, Prefilter::Ewa] {
        for &filter in Filter::ALL {
            let data = [51, 102, 204, 128].repeat(13 * 7);
            let pattern = pattern(image(13, 7, 4, Samples::U8(data), ColorSpace::Linear), plain(filter, prefilter));
            for (u, v, dx, dy) in footprints(40, 30.0, 16.0) {
                let scale = |d: [f64; 2]| DVec3::new(d[0] / 13.0, d[1] / 7.0, 0.0);
                let lookup = Lookup { at: DVec3::new(u, v, 0.0), dx: scale(dx), dy: scale(dy) };
                for (got, exact) in pattern.eval(&lookup).iter().zip([0.2, 0.4, 0.8, 128.0 / 255.0]) {
                    // Coarser levels hold bytes as well; colours and alpha are rounded independently.
                    assert!((got - exact).abs() < 2e-6, "{filter:?} {prefilter:?}: {got} for {exact}");
                }
            }
        }
    }
}

#[test]
fn lines_and_parabolas_in_two_directions_are_reproduced() {
    let (width, height) = (40u32, 30u32);
    let centers = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f32> {
        (0..width * height).map(|i| f(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5) as f32).collect()
    };
    let line = |x: f64, y: f64| 0.02 * x - 0.03 * y + 1.0;
    let bowl = |x: f64, y: f64| 0.001 * (x - 7.0) * (y + 3.0) + 0.0005 * x * x - 0.0007 * y * y;
    for &filter in Filter::ALL {
        for (f, fits) in [
            (&line as &dyn Fn(f64, f64) -> f64, filter != Filter::Nearest),
            (&bowl, matches!(filter, Filter::Biquadratic | Filter::Bicubic)),
        ] {
            let image = image(width, height, 1, Samples::F32(centers(f)), ColorSpace::Raw);
            let pattern = pattern(image, plain(filter, Prefilter::None));
            let mut worst = 0.0f64;
            for i in 0..500 {
                let (x, y) = (3.0 + 34.0 * f64::from(noise(2 * i)), 3.0 + 24.0 * f64::from(noise(2 * i + 1)));
                let got = pattern.eval(&point(x / f64::from(width), y / f64::from(height)))[0];
                worst = worst.max((f64::from(got) - f(x, y)).abs());
            }
            assert!(!fits || worst < 1e-5, "{filter:?} is off by {worst}");
        }
    }
}

#[test]
fn a_line_stays_where_it_is_on_every_level() {
    // A shift of a coarser level would show as an offset.
    let (width, height) = (257u32, 189u32);
    let samples = (0..width * height).map(|i| (i % width) as f32 + 0.5).collect();
    let picture = image(width, height, 1, Samples::F32(samples), ColorSpace::Raw);
    for prefilter in [Prefilter::Trilinear, Prefilter::Ewa] {
        let wrap = [Wrap::Clamp; 2];
        let pattern = pattern(picture.clone(), ImageTexture { wrap, ..plain(Filter::Bilinear, prefilter) });
        for spacing in [0.7, 1.5, 2.9, 4.0, 7.3, 11.0] {
            for i in 0..50 {
                let x = 60.0 + 130.0 * f64::from(noise(i));
                let lookup = Lookup {
                    at: DVec3::new(x / f64::from(width), 0.5, 0.0),
                    dx: DVec3::X * spacing / f64::from(width),
                    dy: DVec3::Y * spacing / f64::from(height),
                };
                let got = f64::from(pattern.eval(&lookup)[0]);
                assert!((got - x).abs() < 0.02 * spacing, "{prefilter:?} {spacing}: {got} for {x}");
            }
        }
    }
}

#[test]
fn growing_footprints_change_the_value_without_jumps() {
    let samples: Vec<f32> = (0..64 * 64).map(noise).collect();
    for prefilter in [Prefilter::Trilinear, Prefilter::Ewa] {
        let image = image(64, 64, 1, Samples::F32(samples.clone()), ColorSpace::Raw);
        let pattern = pattern(image, plain(Filter::Bicubic, prefilter));
        let mut last: Option<f32> = None;
        for i in 0..4000 {
            let texels = 0.1 * 1.002f64.powi(i);
            let dx = DVec3::new(texels, 0.3 * texels, 0.0) / 64.0;
            let dy = DVec3::new(-0.1 * texels, 0.4 * texels, 0.0) / 64.0;
            let value = pattern.eval(&Lookup { at: DVec3::new(0.31, 0.77, 0.0), dx, dy })[0];
            let step = last.map_or(0.0, |last| (value - last).abs());
            assert!(step < 0.012, "{prefilter:?} jumps by {step} at {texels} texels");
            last = Some(value);
        }
    }
}

#[test]
fn hostile_lookups_give_finite_colours() {
    let mut values = vec![0.0, 1.0, -1.0, 1e-300, 1e9, -1e300, f64::NAN, f64::INFINITY];
    values.push(f64::MIN_POSITIVE);
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black, Wrap::Transparent] {
        for prefilter in [Prefilter::Trilinear, Prefilter::Ewa] {
            for (width, height) in [(1, 1), (5, 3), (300, 1)] {
                let data = (0..width * height * 4).map(|i| (noise(i) * 255.0) as u8).collect();
                let texture = ImageTexture { wrap: [wrap; 2], prefilter, ..ImageTexture::new(0) };
                let pattern = pattern(image(width, height, 4, Samples::U8(data), ColorSpace::Srgb), texture);
                for a in &values {
                    for b in &values {
                        for c in &values {
                            let lookup = Lookup {
                                at: DVec3::new(*a, 0.3, 0.0),
                                dx: DVec3::new(*b, *c, 0.0),
                                dy: DVec3::new(*c, *a, 0.0),
                            };
                            let color = pattern.eval(&lookup);
                            assert!(color.iter().all(|v| (0.0..=1.0).contains(v)), "{lookup:?}: {color:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_clear_image_from_far_away_is_nearly_nothing() {
    let texture = ImageTexture { wrap: [Wrap::Transparent; 2], ..plain(Filter::Bilinear, Prefilter::Ewa) };
    let pattern = pattern(image(16, 16, 3, Samples::U8(vec![255; 768]), ColorSpace::Srgb), texture);
    let at = DVec3::new(0.5, 0.5, 0.0);
    let mut last = 2.0;
    for size in [0.01, 0.3, 1.0, 3.0, 10.0, 100.0] {
        let alpha = pattern.eval(&Lookup { at, dx: DVec3::X * size, dy: DVec3::Y * size })[3];
        assert!(alpha < last || alpha == 1.0, "{alpha} after {last}");
        last = alpha;
    }
    assert!(last < 1e-3);
}
