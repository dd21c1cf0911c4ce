//! Environments as scenes use them: the radiance in each direction, without seams.

use super::*;
use crate::Named;
use crate::texture::ColorSpace;
use glam::DVec3;

const STILL: [DVec3; 2] = [DVec3::ZERO; 2];

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [f32; 3]) -> Image {
    let samples = (0..width * height).flat_map(|i| texel(i % width, i / width)).collect();
    Image {
        name: "test".into(),
        width,
        height,
        channels: 3,
        samples: Samples::F32(samples),
        space: ColorSpace::Linear,
        premultiplied: false,
    }
}

fn backdrop(kind: EnvironmentKind, images: Vec<Image>) -> PreparedEnvironment {
    let mut images = images;
    PreparedEnvironment::new(&Environment::new(kind), &mut images, |_| false).unwrap()
}

fn number(i: u32, k: u32) -> f64 {
    let x = i.wrapping_mul(0x9e37_79b1) ^ k.wrapping_mul(0x85eb_ca6b);
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    f64::from(x ^ (x >> 15)) / f64::from(u32::MAX)
}

/// A cube of noise, the roughest image there can be.
fn noise_cube(n: u32, smoothing: Smoothing) -> PreparedEnvironment {
    let face = |f: u32| image(n, n, move |x, y| [0, 1, 2].map(|c| number(f * 100_000 + y * n + x, c) as f32));
    backdrop(EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing }, (0..6).map(face).collect())
}

fn noise_panorama(w: u32, h: u32, smoothing: Smoothing) -> PreparedEnvironment {
    let picture = image(w, h, |x, y| [0, 1, 2].map(|c| number(y * w + x, c) as f32));
    backdrop(EnvironmentKind::LatLong { image: 0, smoothing }, vec![picture])
}

fn difference(a: Rgb, b: Rgb) -> f32 {
    (a - b).map(f32::abs).max_component()
}

fn direction(i: u32) -> DVec3 {
    let y = 2.0 * number(i, 11) - 1.0;
    let (s, c) = (number(i, 12) * std::f64::consts::TAU).sin_cos();
    DVec3::new((1.0 - y * y).sqrt() * c, y, (1.0 - y * y).sqrt() * s)
}

/// Fig. 5.35: each face shows its own image, and each texel is seen in its direction.
#[test]
fn texels_of_all_faces_are_seen_in_their_directions() {
    let n = 5;
    let face = |f: usize| image(n, n, move |x, y| [f as f32, x as f32, y as f32]);
    for smoothing in [Smoothing::Nearest, Smoothing::Bilinear] {
        let cube = backdrop(EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing }, (0..6).map(face).collect());
        for (f, side) in Face::ALL.iter().enumerate() {
            for x in 0..n {
                for y in 0..n {
                    let uv = [(f64::from(x) + 0.5) / f64::from(n), (f64::from(y) + 0.5) / f64::from(n)];
                    let seen = cube.lookup(side.direction(uv), STILL);
                    let expected = Rgb::new(f as f32, x as f32, y as f32);
                    assert!(difference(seen.radiance, expected) < 1e-5, "{side:?} {x} {y}: {seen:?}");
                    let Place::Face { face, uv: at } = seen.place else { panic!("{seen:?}") };
                    assert!(face == *side && (at[0] - uv[0]).abs() < 1e-12 && (at[1] - uv[1]).abs() < 1e-12);
                }
            }
        }
    }
}

/// The radiance changes across the 12 edges and 8 corners no faster than within a face.
#[test]
fn a_cube_has_no_seams() {
    let n = 8;
    let cube = noise_cube(n, Smoothing::Bilinear);
    // Bilinear slopes are at most the largest difference of texels: 1 in a texel, whose least angle is 1/3 of 2/n.
    let step = 1e-7;
    let bound = (2.0 * 3.0 * step * f64::from(n) / 2.0) as f32 + 1e-6;
    let mut crossings = 0;
    let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 0 { 1.0 } else { -1.0 });
    for i in 0..60_000u32 {
        // A point on an edge, or next to a corner.
        let axis = (i % 3) as usize;
        let mut p = corner(i / 3);
        p[axis] *= if i.is_multiple_of(4) { 1.0 - number(i, 1) * 1e-8 } else { 2.0 * number(i, 1) - 1.0 };
        let p = DVec3::from_array(p).normalize();
        let away = direction(i) * step;
        let [a, b] = [(p + away).normalize(), (p - away).normalize()];
        let (a, b) = (cube.lookup(a, STILL), cube.lookup(b, STILL));
        crossings += u32::from(
            matches!((a.place, b.place), (Place::Face { face: f, .. }, Place::Face { face: g, .. }) if f != g),
        );
        assert!(difference(a.radiance, b.radiance) < bound, "{a:?}\n{b:?}");
    }
    assert!(crossings > 20_000, "{crossings}");
}

/// Prefiltered lookups have no seams either: a footprint of several texels moves smoothly over edges and corners.
#[test]
fn prefiltered_cubes_have_no_seams() {
    let cube = noise_cube(32, Smoothing::Bilinear);
    let wide = |d: DVec3| {
        let side = d.any_orthonormal_vector() * 0.3;
        cube.lookup(d, [side, d.cross(side)]).radiance
    };
    let mut worst = 0f32;
    for i in 0..3000u32 {
        let p = DVec3::new(1.0, 1.0, 2.0 * number(i, 1) - 1.0).normalize();
        let away = DVec3::new(1e-6, -1e-6, 0.0);
        worst = worst.max(difference(wide((p + away).normalize()), wide((p - away).normalize())));
    }
    // The smallest visible differences are a thousandth; a seam of unfiltered noise is a tenth and more.
    assert!(worst < 2e-3, "{worst}");
}

/// Checks the seam of a panorama and its poles.
#[test]
fn a_panorama_has_no_seam_and_no_hole_at_its_poles() {
    let (w, h) = (16, 8);
    let sky = noise_panorama(w, h, Smoothing::Bilinear);
    for i in 0..2000 {
        let (s, c) = ((number(i, 1) - 0.5) * 3.0).sin_cos();
        let [a, b] = [1e-9, -1e-9].map(|x| sky.lookup(DVec3::new(x, s, c), STILL));
        assert!(difference(a.radiance, b.radiance) < 1e-6, "{a:?}\n{b:?}");
    }
    for pole in [DVec3::Y, DVec3::NEG_Y] {
        // Straight through the pole: the radiance before it equals that behind it.
        for i in 0..200 {
            let (s, c) = (number(i, 2) * std::f64::consts::TAU).sin_cos();
            let step = DVec3::new(c, 0.0, s) * 1e-9;
            let [a, b] = [sky.lookup(pole + step, STILL), sky.lookup(pole - step, STILL)];
            assert!(difference(a.radiance, b.radiance) < 1e-6, "{a:?}\n{b:?}");
        }
        assert!(sky.lookup(pole, STILL).radiance.is_finite());
    }
}

/// An image that is a smooth function of the direction is seen as that function everywhere.
#[test]
fn smooth_pictures_are_seen_as_what_they_show() {
    let truth = |d: DVec3| Rgb::new(0.5 + 0.5 * d.x as f32, 0.5 + 0.5 * d.y as f32, 0.5 + 0.5 * d.z as f32);
    let n = 64;
    let face = |f: usize| {
        image(n, n, move |x, y| {
            let uv = [(f64::from(x) + 0.5) / f64::from(n), (f64::from(y) + 0.5) / f64::from(n)];
            truth(Face::ALL[f].direction(uv).normalize()).to_array()
        })
    };
    let cube = EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing: Smoothing::Bilinear };
    let cube = backdrop(cube, (0..6).map(face).collect());
    let (w, h) = (256, 128);
    let picture = image(w, h, |x, y| {
        let uv = [(f64::from(x) + 0.5) / f64::from(w), (f64::from(y) + 0.5) / f64::from(h)];
        truth(panorama::direction(uv)).to_array()
    });
    let sky = backdrop(EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Bilinear }, vec![picture]);
    for i in 0..20_000 {
        let d = direction(i);
        for (what, seen) in [("cube", cube.lookup(d, STILL)), ("panorama", sky.lookup(d, STILL))] {
            let error = difference(seen.radiance, truth(d));
            assert!(error < 3e-3, "{what} {d}: {error}");
        }
    }
    for (what, backdrop) in [("cube", &cube), ("panorama", &sky)] {
        assert!(difference(backdrop.mean(), Rgb::gray(0.5)) < 1e-3, "{what}: {:?}", backdrop.mean());
    }
}

/// Compares the prefilter on noise with 4096 lookups over the footprint: round and long footprints, away from and close
/// to edges and poles.
#[test]
fn footprints_are_means_of_what_they_cover() {
    for (what, backdrop) in
        [("cube", noise_cube(128, Smoothing::Bilinear)), ("panorama", noise_panorama(512, 256, Smoothing::Bilinear))]
    {
        let (mut filtered, mut unfiltered, mut count) = (0.0, 0.0, 0.0);
        for i in 0..300 {
            let d = direction(i);
            let x = d.any_orthonormal_vector() * (0.02 + 0.1 * number(i, 3));
            let y = d.cross(x.normalize()) * (0.02 + 0.03 * number(i, 4));
            let mut sum = Rgb::BLACK;
            for k in 0..4096u32 {
                // A Gaussian of half the pixel distance's width, which is about the filter of trilinear boxes.
                let r = (-2.0 * (1.0 - (f64::from(k) + 0.5) / 4096.0).ln()).sqrt() * 0.4;
                let (s, c) = (f64::from(k) * 2.399963).sin_cos();
                sum += backdrop.lookup(d + x * (r * c) + y * (r * s), STILL).radiance;
            }
            let mean = sum / 4096.0;
            let seen = backdrop.lookup(d, [x, y]);
            assert!(seen.footprint.unwrap().level > 0.0, "{seen:?}");
            filtered += f64::from(difference(seen.radiance, mean)).powi(2);
            unfiltered += f64::from(difference(backdrop.lookup(d, STILL).radiance, mean)).powi(2);
            count += 1.0;
        }
        let [filtered, unfiltered] = [filtered, unfiltered].map(|sum: f64| (sum / count).sqrt());
        println!("{what}: differences of {filtered:.4} with, {unfiltered:.4} without the prefilter");
        assert!(filtered < 0.2 * unfiltered, "{what}: {filtered} with, {unfiltered} without the prefilter");
    }
}

#[test]
fn crosses_hold_the_six_faces() {
    let n = 4u32;
    let code = |f: usize, x: u32, y: u32| [f as f32, x as f32, y as f32];
    // The column and row of each face's square, in the order of faces.
    let wide = [[2, 1], [0, 1], [1, 0], [1, 2], [1, 1], [3, 1]];
    let high = [[2, 1], [0, 1], [1, 0], [1, 2], [1, 1], [1, 3]];
    for (squares, [across, down]) in [(wide, [4, 3]), (high, [3, 4])] {
        let cross = image(across * n, down * n, |x, y| {
            let square = squares.iter().position(|place| *place == [x / n, y / n]);
            let (x, y) = (x % n, y % n);
            match square {
                Some(5) if down == 4 => code(5, n - 1 - x, n - 1 - y),
                Some(f) => code(f, x, y),
                None => [-1.0; 3],
            }
        });
        let cross = backdrop(EnvironmentKind::Cross { image: 0, smoothing: Smoothing::Nearest }, vec![cross]);
        let face = |f: usize| image(n, n, move |x, y| code(f, x, y));
        let kind = EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing: Smoothing::Nearest };
        let cube = backdrop(kind, (0..6).map(face).collect());
        for i in 0..5000 {
            assert_eq!(cross.lookup(direction(i), STILL).radiance, cube.lookup(direction(i), STILL).radiance);
        }
    }
}

#[test]
fn environments_turn_and_shine() {
    let stops = vec![(-1.0, Rgb::BLACK), (1.0, Rgb::WHITE)];
    let mut environment = Environment::new(EnvironmentKind::Gradient(Gradient { stops }));
    environment.rotation = Transform::rotate(DVec3::Z, 90.0).unwrap();
    environment.intensity = Rgb::new(1.0, 2.0, 3.0);
    let turned = PreparedEnvironment::new(&environment, &mut [], |_| false).unwrap();
    // The rotation moved the top of the environment to −x.
    assert_eq!(turned.lookup(DVec3::NEG_X * 5.0, STILL).radiance, Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(turned.lookup(DVec3::X, STILL).radiance, Rgb::BLACK);
    assert!(difference(turned.mean(), Rgb::new(0.5, 1.0, 1.5)) < 0.01);
    for (bad, word) in [
        (Transform::translate(DVec3::X), "turned"),
        (Transform::scale(DVec3::splat(2.0)).unwrap(), "turned"),
        (Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap(), "mirrored"),
    ] {
        environment.rotation = bad;
        let problem = PreparedEnvironment::new(&environment, &mut [], |_| false).unwrap_err();
        assert!(problem.contains(word), "{problem}");
    }
}

#[test]
fn faces_and_crosses_of_wrong_sizes_are_refused() {
    let plain = |w, h| image(w, h, |_, _| [1.0; 3]);
    let cube = EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing: Smoothing::Bilinear };
    let problem = |kind: &EnvironmentKind, mut images: Vec<Image>| {
        PreparedEnvironment::new(&Environment::new(kind.clone()), &mut images, |_| false).unwrap_err()
    };
    let mut images: Vec<Image> = (0..6).map(|_| plain(4, 4)).collect();
    images[3] = plain(4, 2);
    assert_eq!(problem(&cube, images.clone()), "bottom is 4 × 2 pixels; the faces of a cube must be square");
    images[3] = plain(2, 2);
    assert!(problem(&cube, images.clone()).starts_with("bottom is 2 × 2 pixels, but right is 4 × 4"));
    images.truncate(5);
    assert!(problem(&cube, images).contains("image number 5"));
    let cross = EnvironmentKind::Cross { image: 0, smoothing: Smoothing::Bilinear };
    assert!(problem(&cross, vec![plain(8, 8)]).contains("4 × 3 or 3 × 4 squares"));
    let sky = EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Bilinear };
    assert!(problem(&sky, vec![image(2, 1, |_, _| [f32::INFINITY; 3])]).contains("aren't finite"));
}

/// Sizes of one texel, odd sizes, and footprints of any size and kind give finite colours.
#[test]
fn nothing_breaks_a_look() {
    let all = [
        noise_cube(1, Smoothing::Bilinear),
        noise_cube(7, Smoothing::Bilinear),
        noise_panorama(1, 1, Smoothing::Bilinear),
        noise_panorama(13, 5, Smoothing::Bilinear),
        noise_panorama(5, 13, Smoothing::Nearest),
    ];
    for backdrop in &all {
        for i in 0..2000 {
            let mut d = direction(i);
            if i % 7 == 0 {
                d = [DVec3::X, DVec3::Y, DVec3::NEG_Z, DVec3::ONE, DVec3::new(1.0, -1.0, 1.0)][i as usize / 7 % 5];
            }
            for size in [0.0, 1e-300, 1e-3, 1.0, 1e6, 1e300, f64::INFINITY, f64::NAN] {
                let seen = backdrop.lookup(d, [direction(i + 1) * size, direction(i + 2) * size]);
                let value = seen.radiance.to_array();
                assert!(value.iter().all(|v| (-1e-6..=1.0 + 1e-6).contains(v)), "{size} {seen:?}");
            }
        }
    }
}
