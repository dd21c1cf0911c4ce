//! Properties of all kinds of samplers.

use super::*;
use crate::scene::SamplerKind::{self, Independent, Jittered, Sobol};

const KINDS: [SamplerKind; 3] = [Sobol, Jittered, Independent];

#[test]
fn numbers_are_uniform_over_every_key() {
    // χ² over 64 cells with 63 degrees of freedom: 99.9 % lie below 103.4.
    for vary in 0..4 {
        let mut cells = [0u32; 64];
        for i in 0..64_000u32 {
            let at = |k: usize| if k == vary { i } else { 7 };
            let value = Sampler::new(3, 0, [at(0), at(1)]).uniform(at(2), at(3));
            cells[(value * 64.0) as usize] += 1;
        }
        let chi2: f64 = cells.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
        assert!(chi2 < 103.4, "varying key {vary}: {chi2}");
    }
}

#[test]
fn keys_do_not_share_numbers() {
    let a = Sampler::new(1, 2, [3, 4]);
    for b in [Sampler::new(2, 2, [3, 4]), Sampler::new(1, 3, [3, 4]), Sampler::new(1, 2, [4, 3])] {
        assert_ne!(a.uniform(0, 0), b.uniform(0, 0));
        for kind in KINDS {
            let of = |s: Sampler| s.of_kind(kind).sample(5, 16).two(Dimension::EYE.of(9));
            assert_ne!(of(a), of(b), "{kind:?}");
        }
    }
    assert_ne!(a.uniform(0, 1), a.uniform(1, 0));
}

/// A fixed sample of many pixels, and of many dimensions, is uniform over the square and the line: χ² over 64 cells.
#[test]
fn each_sample_is_uniform_over_pixels_and_dimensions() {
    for kind in KINDS {
        for (index, count) in [(0, 1), (3, 7), (63, 64)] {
            let mut cells = [[0u32; 64]; 4];
            for i in 0..64_000u32 {
                let pixel = Sampler::new(0, 0, [i % 320, i / 320]).of_kind(kind).sample(index, count);
                let other = Sampler::new(0, 0, [5, 9]).of_kind(kind).sample(index, count);
                let square = |[x, y]: [f64; 2]| (x * 8.0) as usize * 8 + (y * 8.0) as usize;
                cells[0][square(pixel.two(Dimension::EYE.of(4)))] += 1;
                cells[1][square(other.two(Dimension::EYE.of(i)))] += 1;
                cells[2][(pixel.one(Dimension::EYE) * 64.0) as usize] += 1;
                cells[3][square(pixel.eye().lens)] += 1;
            }
            for (which, cells) in cells.iter().enumerate() {
                let chi2: f64 = cells.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
                assert!(chi2 < 115.0, "{kind:?}, sample {index} of {count}, {which}: {chi2}");
            }
        }
    }
}

/// The estimates of neighbouring pixels, and of two dimensions of a pixel, are uncorrelated: their correlation over
/// many pixels is that of independent numbers, 1/√n.
#[test]
fn pixels_and_dimensions_are_decorrelated() {
    let n = 4000u32;
    for kind in KINDS {
        let estimate = |x: u32, y: u32, dimension: u32| -> f64 {
            let sampler = Sampler::new(1, 0, [x, y]).of_kind(kind);
            (0..5).map(|i| sampler.sample(i, 5).two(Dimension::EYE.of(dimension))).map(|[u, v]| u * u + v).sum()
        };
        let pairs: [(&str, Vec<[f64; 2]>); 3] = [
            ("right", (0..n).map(|i| [estimate(i, 3, 0), estimate(i + 1, 3, 0)]).collect()),
            ("above", (0..n).map(|i| [estimate(7, i, 0), estimate(7, i + 1, 0)]).collect()),
            ("dimension", (0..n).map(|i| [estimate(i, i, 0), estimate(i, i, 1)]).collect()),
        ];
        for (name, pairs) in pairs {
            let mean = |f: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(f).sum::<f64>() / f64::from(n);
            let (a, b) = (mean(&|p| p[0]), mean(&|p| p[1]));
            let deviation = |k: usize, m: f64| mean(&|p| (p[k] - m).powi(2)).sqrt();
            let r = mean(&|p| (p[0] - a) * (p[1] - b)) / (deviation(0, a) * deviation(1, b));
            assert!(r.abs() < 4.0 / f64::from(n).sqrt(), "{kind:?} {name}: {r}");
        }
    }
}

#[test]
fn numbers_stay_below_one() {
    for kind in KINDS {
        for count in [1, 2, 3, 256, 65_535, 1 << 24] {
            for index in [0, count / 2, count - 1] {
                for pixel in 0..50 {
                    let sample = Sampler::new(0, 0, [pixel, 0]).of_kind(kind).sample(index, count);
                    let CameraNumbers { film, lens, time } = sample.eye();
                    let light = sample.two_of(Dimension::EYE.of(3), 3, 4);
                    for u in film.into_iter().chain(lens).chain(light).chain([time]) {
                        assert!((0.0..1.0).contains(&u), "{kind:?} {index} of {count}: {u}");
                    }
                }
            }
        }
    }
}

/// The root mean square errors of a sampler's estimate of ∫f over the square with 4, 16, … samples, over many pixels.
/// The result is the exponent of N that fits the errors best.
fn rate(kind: SamplerKind, integral: f64, f: impl Fn([f64; 2]) -> f64, draw: impl Fn(&Sample) -> [f64; 2]) -> f64 {
    let errors: Vec<(f64, f64)> = (1..=6)
        .map(|m| {
            let n = 4u32.pow(m);
            let pixels = 600;
            let sum: f64 = (0..pixels)
                .map(|pixel| {
                    let sampler = Sampler::new(5, 0, [pixel, 2]).of_kind(kind);
                    let mean = (0..n).map(|i| f(draw(&sampler.sample(i, n)))).sum::<f64>() / f64::from(n);
                    (mean - integral).powi(2)
                })
                .sum();
            (f64::from(n).ln(), (sum / f64::from(pixels)).sqrt().ln())
        })
        .collect();
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| errors.iter().map(f).sum::<f64>() / errors.len() as f64;
    let (x, y) = (mean(&|e| e.0), mean(&|e| e.1));
    mean(&|e| (e.0 - x) * (e.1 - y)) / mean(&|e| (e.0 - x).powi(2))
}

/// Theory: independent samples always err by N^-1/2. One sample in each cell of a grid errs by N^-1 for a smooth
/// integrand and by N^-3/4 at an edge (Mitchell 1996). Owen's nets err by N^-3/2 (log N)^1/2 for a smooth integrand
/// (Owen 1997), which from 4 to 4096 samples is near N^-1.37, and by N^-3/4 at an edge in no special direction.
#[test]
fn errors_fall_as_theory_says() {
    let smooth = |[x, y]: [f64; 2]| (x * y).exp();
    // ∫∫ exp(xy) = Σ 1 / (k! (k+1)²)
    let integral = (0..20).map(|k| 1.0 / ((1..=k).map(f64::from).product::<f64>() * f64::from(k + 1).powi(2))).sum();
    let edge = |[x, y]: [f64; 2]| if x * x + y * y < 1.0 { 1.0 } else { 0.0 };
    let quarter = std::f64::consts::FRAC_PI_4;
    let light = |s: &Sample| s.two(Dimension::EYE.of(12));
    let film = |s: &Sample| s.eye().film;
    for (kind, smooth_rate, edge_rate) in [(Sobol, -1.37, -0.75), (Jittered, -1.0, -0.75), (Independent, -0.5, -0.5)] {
        for (use_of, draw) in [("light", &light as &dyn Fn(&Sample) -> [f64; 2]), ("film", &film)] {
            let found = [rate(kind, integral, smooth, draw), rate(kind, quarter, edge, draw)];
            println!("{kind:?} {use_of}: {:.3} smooth, {:.3} edge", found[0], found[1]);
            assert!((found[0] - smooth_rate).abs() < 0.06, "{kind:?} {use_of}: N^{} for a smooth integrand", found[0]);
            assert!((found[1] - edge_rate).abs() < 0.08, "{kind:?} {use_of}: N^{} at an edge", found[1]);
        }
    }
}

/// The points of a light over all samples of a pixel are distributed jointly, for any number per sample.
#[test]
fn several_points_for_a_sample_are_spread_like_as_many_samples() {
    let dimension = Dimension::EYE.of(3);
    for kind in KINDS {
        let sampler = Sampler::new(0, 0, [1, 1]).of_kind(kind);
        let all: Vec<_> = (0..16).map(|i| sampler.sample(i, 16).two(dimension)).collect();
        let some: Vec<_> = (0..4)
            .flat_map(|i| (0..4).map(move |n| (i, n)))
            .map(|(i, n)| sampler.sample(i, 4).two_of(dimension, n, 4))
            .collect();
        assert_eq!(all, some, "{kind:?}");
    }
}

/// Samples that choose the same one of several things have points that are as even as if there were no choice. With a
/// choice apart they would be random ones.
#[test]
fn a_choice_leaves_its_points_even() {
    let error = |joint: bool| -> f64 {
        let (mut squares, count) = (0.0, 256);
        for pixel in 0..400 {
            let sampler = FrameSampler::new(4, 0, Sobol).pixel([pixel, 3]);
            let (mut sum, mut chosen) = (0.0, 0.0);
            for index in 0..count {
                let sample = sampler.sample(index, count);
                let dimension = Dimension::EYE.of(5);
                let (choice, [u, v]) = match joint {
                    true => sample.one_and_two(dimension),
                    false => (sample.one(dimension.of(1)), sample.two(dimension.of(2))),
                };
                if choice < 0.25 {
                    sum += u * v;
                    chosen += 1.0;
                }
            }
            squares += (sum / chosen - 0.25f64).powi(2);
        }
        (squares / 400.0).sqrt()
    };
    let (joint, apart) = (error(true), error(false));
    println!("joint {joint:.5}, apart {apart:.5}");
    assert!(joint < 0.6 * apart, "joint {joint}, apart {apart}");
}

/// Numbers that are drawn together are uniform over their cube, for a fixed sample of many pixels: χ² over 64 cells.
#[test]
fn joint_numbers_are_uniform_over_pixels() {
    for index in [0, 1, 6] {
        let mut cells = [[0u32; 64]; 3];
        for i in 0..64_000u32 {
            let sampler = Sampler::new(2, 0, [i % 320, i / 320]);
            let (w, [u, v]) = sampler.sample(index, 16).one_and_two(Dimension::EYE.of(4));
            let [a, b, c, d] = sampler.four(Dimension::EYE.of(4), index);
            let cube = |p: [f64; 3]| p.iter().fold(0, |cell, x| cell * 4 + (x * 4.0) as usize);
            for (cells, p) in cells.iter_mut().zip([[u, v, w], [a, b, c], [b, c, d]]) {
                cells[cube(p)] += 1;
            }
        }
        for (which, cells) in cells.iter().enumerate() {
            let chi2: f64 = cells.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
            assert!(chi2 < 115.0, "sample {index}, {which}: {chi2}");
        }
    }
}

/// Two uses go through their points in orders of their own. In one order, the numbers of two uses would fill 16 of
/// these 256 cells; independent ones fill 63 %.
#[test]
fn uses_have_orders_of_their_own() {
    for kind in KINDS {
        let mut filled = 0;
        for pixel in 0..20 {
            let mut cells = [false; 256];
            for index in 0..256 {
                let sample = Sampler::new(8, 0, [pixel, 1]).of_kind(kind).sample(index, 256);
                let [a, b] = [0, 1].map(|n| sample.two(Dimension::EYE.of(n))[0]);
                cells[(a * 16.0) as usize * 16 + (b * 16.0) as usize] = true;
            }
            filled += cells.iter().filter(|cell| **cell).count();
        }
        let share = f64::from(filled as u32) / (20.0 * 256.0);
        assert!((0.55..0.75).contains(&share), "{kind:?}: {share}");
    }
}

/// The numbers stay what they are, so that pictures keep their bytes.
#[test]
fn numbers_stay_what_they_are() {
    let sampler = Sampler::new(7, 3, [11, 5]);
    let sample = sampler.sample(9, 64);
    let (w, [u, v]) = sample.one_and_two(Dimension::EYE.of(2));
    let [a, b] = sample.two(Dimension::EYE.of(1));
    let all = [w, u, v, a, b, sample.one(Dimension::EYE)].into_iter().chain(sampler.four(Dimension::EYE, 9));
    let digits: Vec<u32> = all.map(|number| (number * 65536.0) as u32).collect();
    assert_eq!(digits, [49277, 13269, 40290, 46187, 14365, 10369, 11581, 37944, 26812, 65]);
}
