//! Filters and samples: edges, thin lines and windows with every filter and any number of rays.

use super::*;
use canaletto::Named;

/// Filters along one axis, from their papers.
fn filter(filter: Filter, x: f64) -> f64 {
    let x = x.abs();
    match filter {
        Filter::Box => f64::from(u8::from(x <= 0.5)),
        Filter::Tent => (1.0 - x).max(0.0),
        Filter::Gaussian { sigma } => {
            let t = x / f64::from(sigma);
            ((-0.5 * t * t).exp() - (-4.5f64).exp()).max(0.0)
        }
        // Mitchell & Netravali 1988, (8) with B = C = 1/3.
        Filter::Mitchell if x < 1.0 => (7.0 * x.powi(3) - 12.0 * x * x + 16.0 / 3.0) / 6.0,
        Filter::Mitchell if x < 2.0 => (-7.0 / 3.0 * x.powi(3) + 12.0 * x * x - 20.0 * x + 32.0 / 3.0) / 6.0,
        Filter::Mitchell => 0.0,
        other => panic!("{other:?} has no formula here"),
    }
}

/// The share of a filter around 0 that lies to the left of a line at `edge`.
fn left_of(kind: Filter, edge: f64) -> f64 {
    let n = 240_000;
    let (mut part, mut all) = (0.0, 0.0);
    for i in 0..n {
        let x = (f64::from(i) + 0.5) / f64::from(n) * 26.0 - 13.0;
        all += filter(kind, x);
        part += if x < edge { filter(kind, x) } else { 0.0 };
    }
    part / all
}

const FILTERS: [(&str, Filter); 5] = [
    ("\"box\"", Filter::Box),
    ("\"tent\"", Filter::Tent),
    ("\"gaussian\" sigma=0.5", Filter::Gaussian { sigma: 0.5 }),
    ("\"gaussian\" sigma=1.5", Filter::Gaussian { sigma: 1.5 }),
    ("\"mitchell\"", Filter::Mitchell),
];

/// A scene that is white up to x = `edge` pixels from the middle of the picture and black beyond, with eight pixels per
/// unit.
fn edge(film: &str, size: [u32; 2], edge: f64) -> String {
    let ([w, h], x) = (size, edge / 8.0);
    let fovy = (2.0 * (f64::from(h) / 16.0 / 1000.0).atan()).to_degrees();
    format!(
        "film {{ {film} }}
        camera {{ eye 0 0 1000; center 0 0 0; fovy {fovy}; far 5000; size {w} {h} }}
        ambient 1
        material \"w\" {{ kd 1 }}
        box material=\"w\" {{ min -99 -99 -1; max {x} 99 0 }}"
    )
}

/// A filter with negative lobes overshoots the range from 0 to 1 by their integral at most. Evenly lit areas are even,
/// for any number of rays and any sampler.
#[test]
fn filters_keep_within_their_overshoot_at_any_number_of_rays() {
    let lobe: f64 = (0..10_000)
        .map(|i| 1.0 + (f64::from(i) + 0.5) * 1e-4)
        .map(|x| 2e-4 * -filter(Filter::Mitchell, x).min(0.0))
        .sum();
    // The integral of the negative part of f(x) f(y), with ∫ f₋ = lobe and ∫ f₊ = 1 + lobe.
    let below = 2.0 * lobe * (1.0 + lobe);
    let mut films: Vec<String> = Vec::new();
    for n in [1, 2, 3, 4, 5, 7, 16, 33] {
        films.extend(SamplerKind::NAMES.iter().map(|sampler| format!("samples {n}; sampler \"{sampler}\"")));
    }
    for n in 1..=5 {
        films.extend(["regular", "jittered"].map(|place| format!("sample \"{place}\" n={n}")));
    }
    films.extend([2, 4].map(|n| format!("sample \"adaptive\" n={n} threshold=0.02")));
    for (word, kind) in FILTERS {
        let below = if kind == Filter::Mitchell { below } else { 0.0 };
        for film in &films {
            let (at, width) = (0.3, 32);
            let seen = picture(&edge(&format!("{film}; filter {word}"), [width, 24], at));
            for y in 0..24 {
                for x in 0..width {
                    let value = f64::from(seen.pixel(x, y).g);
                    assert!(
                        (-below - 1e-6..=1.0 + below + 1e-6).contains(&value),
                        "{word}, {film}: {value} at {x}, {y}"
                    );
                    let distance = f64::from(x) + 0.5 - 16.0 - at;
                    if distance.abs() > 4.6 {
                        assert_eq!(value, f64::from(u8::from(distance < 0.0)), "{word}, {film}: at {x}, {y}");
                    }
                }
            }
        }
    }
}

/// The mean over many pixels along an edge is the filter's integral up to it. One ray, or a regular grid of fewer than
/// 4 × 4, is too few for negative lobes and left out.
#[test]
fn edges_are_the_filters_integrals() {
    for (word, kind) in FILTERS {
        for (film, rows, tolerance) in [
            ("samples 2", 1600, 0.025),
            ("samples 3; sampler \"jittered\"", 1600, 0.025),
            ("samples 4; sampler \"independent\"", 1600, 0.025),
            ("samples 5", 1600, 0.02),
            ("samples 16", 400, 0.01),
            ("sample \"jittered\" n=2", 1600, 0.02),
            ("sample \"jittered\" n=5", 400, 0.01),
            ("sample \"regular\" n=16", 4, 0.04),
            ("sample \"adaptive\" n=4 threshold=0.02", 400, 0.01),
            ("sample \"adaptive\" n=16 threshold=0.02", 40, 0.01),
        ] {
            let at = 0.08;
            let seen = picture(&edge(&format!("{film}; filter {word}"), [24, rows], at));
            for x in 6..18 {
                let mean = (0..rows).map(|y| f64::from(seen.pixel(x, y).g)).sum::<f64>() / f64::from(rows);
                let exact = left_of(kind, at - (f64::from(x) + 0.5 - 12.0));
                assert!((mean - exact).abs() < tolerance, "{word}, {film}: column {x} is {mean} instead of {exact}");
            }
        }
    }
}

/// Adaptive sampling covers the filter's support. A line of 0.8 pixels adds 0.8 of light to its row, for any filter
/// whose weights sum to one. Neighbouring pixels get their share.
#[test]
fn adaptive_sampling_follows_the_filter_beside_a_thin_line() {
    for (word, kind) in FILTERS {
        let text = edge(&format!("sample \"adaptive\" n=16 threshold=0.02; filter {word}"), [32, 64], 0.0)
            .replace("min -99 -99 -1; max 0 99 0", "min -0.0125 -99 -1; max 0.0875 99 0");
        let seen = picture(&text);
        let row: Vec<f64> =
            (0..32).map(|x| (0..64).map(|y| f64::from(seen.pixel(x, y).g)).sum::<f64>() / 64.0).collect();
        for (x, value) in row.iter().enumerate() {
            let to = |line: f64| left_of(kind, line + 16.0 - x as f64 - 0.5);
            let exact = to(0.7) - to(-0.1);
            assert!((value - exact).abs() < 0.008, "{word}: {value} instead of {exact} in column {x}");
        }
        close(word, row.iter().sum::<f64>(), 0.8, 0.01);
    }
}

/// The pixels of a window and of layers equal those of the whole picture, for any filter.
#[test]
fn windows_and_layers_have_the_same_pixels() {
    for sampling in ["samples 5", "sample \"jittered\" n=3", "sample \"adaptive\" n=3 threshold=0.05"] {
        for (word, _) in FILTERS {
            let film = format!("{sampling}; filter {word}");
            let scene = scene(&edge(&film, [16, 8], 0.3), &[]);
            let whole = job(&scene);
            let world = World::build(scene).unwrap();
            let seen = render(&world, &whole, &()).unwrap();
            let layered = render(&world, &Job { aovs: vec![Aov::Ambient, Aov::Depth], ..whole.clone() }, &()).unwrap();
            assert_eq!((&seen.picture.pixels, seen.counts), (&layered.picture.pixels, layered.counts), "{film}");
            let ambient = &layered.picture.layer("ambient").unwrap().data;
            for (layer, pixel) in ambient.chunks_exact(3).zip(&seen.picture.pixels) {
                assert!((layer[0] - pixel.r).abs() < 1e-6, "{film}: {layer:?} {pixel:?}");
            }
            let mut cut = Job { tile: 3, ..whole.clone() };
            cut.film.crop = Some([5, 2, 7, 5]);
            let part = render(&world, &cut, &()).unwrap().picture;
            for y in 0..5 {
                for x in 0..7 {
                    assert_eq!(part.pixel(x, y), seen.picture.pixel(x + 5, y + 2), "{film}");
                    let tree = explain(&world, &whole, x + 5, y + 2).unwrap();
                    assert_eq!((tree.color, tree.sum()), (part.pixel(x, y), part.pixel(x, y)), "{film}");
                }
            }
        }
    }
}

/// A single ray goes through the pixel's centre, for every option that requests one. The exception is a jittered grid
/// of one.
#[test]
fn a_single_ray_goes_through_the_centre() {
    for (word, _) in FILTERS {
        for sampler in SamplerKind::NAMES {
            let text = |film: &str| {
                edge(&format!("{film}; filter {word}; sampler \"{sampler}\""), [9, 5], 0.3)
                    .replace("size 9 5", "size 9 5; lens { radius 0.2 }; motion { eye 0.1 0 1000 }")
            };
            let of = |film: &str| {
                let scene = scene(&text(film), &[]);
                let job = job(&scene);
                let world = World::build(scene).unwrap();
                let tree = explain(&world, &job, 4, 2).unwrap();
                (render(&world, &job, &()).unwrap().picture, tree.samples[0].position)
            };
            let (center, place) = of("sample \"center\"");
            assert_eq!(place, [4.5, 2.5]);
            assert_eq!(of("samples 1"), (center, place), "{word} {sampler}");
            assert_ne!(of("sample \"jittered\" n=1").1, place);
        }
    }
}
