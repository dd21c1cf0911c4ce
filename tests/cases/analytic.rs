//! Pictures against formulas: filters, means of textures and panoramas, lights, samples, depth.

use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Filter, SamplerKind, Scene};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use png::{BitDepth, ColorType};
use std::f64::consts::PI;

/// The scene of a text and the files that it names.
fn scene(text: &str, files: &[(&str, Vec<u8>)]) -> Scene {
    let assets = MemoryAssets::new().with("scene.kdl", text);
    let assets = files.iter().fold(assets, |assets, (name, bytes)| assets.with(name, bytes.clone()));
    match read_scene("scene.kdl", &assets) {
        Ok((scene, warnings)) => {
            assert!(warnings.is_empty(), "{warnings}");
            scene
        }
        Err(errors) => panic!("{errors}"),
    }
}

fn job(scene: &Scene) -> Job {
    Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator)
}

fn picture_with(text: &str, files: &[(&str, Vec<u8>)]) -> Picture {
    let scene = scene(text, files);
    let job = job(&scene);
    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture
}

fn picture(text: &str) -> Picture {
    picture_with(text, &[])
}

/// The middle pixel.
fn middle(picture: &Picture) -> Rgb {
    picture.pixel(picture.width / 2, picture.height / 2)
}

fn png(width: u32, height: u32, color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

fn png8(width: u32, height: u32, color: ColorType, data: &[u8]) -> Vec<u8> {
    png(width, height, color, BitDepth::Eight, data)
}

/// Numbers that look random, 0 to 1.
fn random(i: u64) -> f64 {
    let mut x = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[track_caller]
fn close(what: &str, value: impl Into<f64>, exact: f64, relative: f64) {
    let value = value.into();
    println!("{what}: {value:.7}, exactly {exact:.7}");
    assert!((value - exact).abs() <= relative * exact.abs(), "{what}: {value} instead of {exact}");
}

// Filters and samples.

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

/// White up to x = `edge` pixels from the middle of the picture, black beyond, eight pixels for each unit.
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

/// A filter with negative lobes leaves a range from 0 to 1 by their integral at most, and evenly lit areas are even, whatever
/// the number of rays and the sampler.
#[test]
fn filters_keep_within_their_overshoot_at_any_number_of_rays() {
    let lobe: f64 = (0..10_000)
        .map(|i| 1.0 + (f64::from(i) + 0.5) * 1e-4)
        .map(|x| 2e-4 * -filter(Filter::Mitchell, x).min(0.0))
        .sum();
    // ∫∫ of the negative part of f(x) f(y), with ∫ f₋ = lobe and ∫ f₊ = 1 + lobe.
    let below = 2.0 * lobe * (1.0 + lobe);
    let mut films: Vec<String> = Vec::new();
    for n in [1, 2, 3, 4, 5, 7, 16, 33] {
        films.extend(SamplerKind::ALL.map(|(_, sampler)| format!("samples {n}; sampler \"{sampler}\"")));
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

/// The mean over many pixels along an edge is the filter's integral up to it. Left out is what has too few rays for the
/// filter's negative lobes: one, or a regular grid of fewer than 4 × 4.
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

/// Adaptive sampling looks as far as the filter reaches: a line of 0.8 pixels gives 0.8 of light to its row, through any filter
/// whose texels sum up, and what lies beside it has its share.
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

/// What a window shows, and what layers show, are the pixels of the whole picture, whatever the filter.
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

/// One ray goes through the pixel's centre, however it is asked for; only a jittered grid of one asks for another place.
#[test]
fn a_single_ray_goes_through_the_centre() {
    for (word, _) in FILTERS {
        for (_, sampler) in SamplerKind::ALL {
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

// Textures where an image ends, and their means.

/// A plane of `units` by `units` in 8 × 8 pixels, with a texture on the unit square in its middle.
fn textured(texture: &str, used: &str, units: f64) -> String {
    let fovy = (2.0 * (0.5 * units / 1000.0).atan()).to_degrees();
    format!(
        "film {{ sample \"center\" }}
        camera {{ eye 0 0 1000; center 0 0 0; fovy {fovy}; far 5000; size 8 8 }}
        ambient 1
        {texture}
        material \"m\" {{ kd 0 0 1; {used} }}
        plane material=\"m\" {{ point 0 0 0; normal 0 0 1 }}"
    )
}

/// Beyond an image that ends in nothing there is nothing of its colour: an image without an alpha is the same as with an alpha
/// of 1, for any filter, size and use, and a white print darkens nothing.
#[test]
fn images_without_alpha_end_like_those_with_alpha() {
    let values: Vec<u8> = (0..64).map(|i| (random(i) * 255.0) as u8).collect();
    let each = |f: &dyn Fn(u8) -> Vec<u8>| values.iter().flat_map(|v| f(*v)).collect::<Vec<u8>>();
    let files = [
        ("l.png", png8(8, 8, ColorType::Grayscale, &values)),
        ("la.png", png8(8, 8, ColorType::GrayscaleAlpha, &each(&|v| vec![v, 255]))),
        ("rgb.png", png8(8, 8, ColorType::Rgb, &each(&|v| vec![v, 255 - v, 40]))),
        ("rgba.png", png8(8, 8, ColorType::Rgba, &each(&|v| vec![v, 255 - v, 40, 255]))),
        ("white.png", png8(8, 8, ColorType::Rgb, &[255; 192])),
    ];
    let mut filters: Vec<String> =
        ["nearest", "bilinear", "biquadratic", "bicubic", "quadratic-spline", "cubic-spline"]
            .iter()
            .map(|filter| format!("filter \"{filter}\""))
            .collect();
    filters.extend(["none", "trilinear", "ewa"].map(|prefilter| format!("prefilter \"{prefilter}\"")));
    let mut partly = 0;
    for filter in &filters {
        for wrap in [
            "wrap \"transparent\"",
            "wrap-u \"transparent\"; wrap-v \"clamp\"",
            "wrap-u \"repeat\"; wrap-v \"transparent\"",
        ] {
            for use_of in ["decal", "replace", "diffuse", "ks", "k"] {
                for units in [1.3, 4.0, 30.0] {
                    let used = format!(
                        "texture \"c\" use=\"{use_of}\" mapping=\"planar\" space=\"world\" {{ translate 0.1 0.2 0 }}"
                    );
                    let of = |file: &str, space: &str| {
                        let texture =
                            format!("texture \"c\" file=\"{file}\" {{ texels \"edges\"; {wrap}; {filter}; {space} }}");
                        picture_with(&textured(&texture, &used, units), &files)
                    };
                    for (without, with) in [("l.png", "la.png"), ("rgb.png", "rgba.png")] {
                        let (a, b) = (of(without, ""), of(with, ""));
                        for (a, b) in a.pixels.iter().zip(&b.pixels) {
                            let same = a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < 2e-6);
                            assert!(same, "{filter} {wrap} {use_of} {units}: {a:?} {b:?}");
                        }
                    }
                    if use_of == "decal" {
                        for space in ["", "space \"raw\"", "space \"linear\""] {
                            for pixel in of("white.png", space).pixels {
                                assert!((pixel.b - 1.0).abs() < 2e-6, "{filter} {wrap} {space} {units}: {pixel:?}");
                                partly += usize::from(pixel.r > 0.01 && pixel.r < 0.99);
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(partly > 300, "{partly}");
}

/// The same for voxels.
#[test]
fn grids_without_alpha_end_in_their_own_colour() {
    for filter in ["filter \"bilinear\"", "filter \"bicubic\"", "prefilter \"none\"", "filter \"cubic-spline\""] {
        for units in [1.3, 2.0, 4.0] {
            let texture = format!(
                "texture \"c\" kind=\"grid\" file=\"white.raw\" {{ size 4 4 4; space \"linear\"; wrap \"transparent\"; {filter} }}"
            );
            let used = "texture \"c\" use=\"decal\" mapping=\"solid\" space=\"world\"";
            let seen = picture_with(&textured(&texture, used, units), &[("white.raw", vec![255; 64])]);
            assert!(seen.pixels.iter().all(|p| (p.b - 1.0).abs() < 2e-6), "{filter} {units}: {:?}", seen.pixels);
            assert!(seen.pixels.iter().any(|p| p.r > 0.01));
        }
    }
}

fn srgb(v: u8) -> f64 {
    let v = f64::from(v) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The colour of an image seen as a single pixel, and at sizes between.
fn from_afar(file: Vec<u8>, texture: &str, used: &str, pixels: u32) -> Picture {
    let texture = format!("texture \"c\" file=\"c.png\" {{ texels \"edges\"; {texture} }}");
    let used = format!("texture \"c\" {used} mapping=\"planar\" space=\"world\"");
    let text = textured(&texture, &used, f64::from(pixels)).replace("kd 0 0 1", "kd 1");
    let text = text.replace("size 8 8", &format!("size {pixels} {pixels}"));
    picture_with(&text, &[("c.png", file)])
}

/// A pixel that is the whole picture shows the mean of its texels: of sparse leaves, of noise in linear and in sRGB numbers,
/// of colours by their alpha, in 8 and 16 bits.
#[test]
fn coarse_levels_are_the_mean_of_what_they_cover() {
    for prefilter in ["prefilter \"ewa\"", "prefilter \"trilinear\""] {
        for side in [32u32, 100, 256, 511] {
            let count = side * side;
            let every = |n: u32| move |i: u32| i % side % n == n / 2 && i / side % n == n / 2;
            for n in [4, 8, 32] {
                if side % n != 0 {
                    continue;
                }
                let here = every(n);
                let share = 1.0 / f64::from(n * n);
                let leaves: Vec<u8> = (0..count).flat_map(|i| [200, 100, 0, if here(i) { 255 } else { 0 }]).collect();
                let file = png8(side, side, ColorType::Rgba, &leaves);
                let seen = middle(&from_afar(file.clone(), prefilter, "use=\"cutout\"", 3));
                close(&format!("{prefilter}: a leaf in {n}² of {side}²"), seen.r, share, 5e-3);
                let seen = middle(&from_afar(file, prefilter, "use=\"decal\"", 3));
                close("their colour", 1.0 - seen.b, share, 5e-3);
                close("their colour", 1.0 - seen.r, share * (1.0 - srgb(200)), 5e-3);
                for space in ["linear", "srgb"] {
                    let dots: Vec<u8> = (0..count).map(|i| if here(i) { 255 } else { 0 }).collect();
                    let wide: Vec<u8> = dots.iter().flat_map(|v| [*v; 2]).collect();
                    let text = format!("space \"{space}\"; {prefilter}");
                    let file = png8(side, side, ColorType::Grayscale, &dots);
                    close("dots", middle(&from_afar(file, &text, "use=\"replace\"", 3)).g, share, 5e-3);
                    let file = png(side, side, ColorType::Grayscale, BitDepth::Sixteen, &wide);
                    close("dots of 16 bits", middle(&from_afar(file, &text, "use=\"replace\"", 3)).g, share, 5e-3);
                }
            }
            for (dark, bright) in [(0.0, 255.99), (0.0, 3.99), (250.0, 255.99), (100.0, 140.0)] {
                let noise: Vec<u8> =
                    (0..count).map(|i| (dark + random(u64::from(i)) * (bright - dark)) as u8).collect();
                let mean = |of: &dyn Fn(u8) -> f64| noise.iter().map(|v| of(*v)).sum::<f64>() / f64::from(count);
                for (space, exact) in [("linear", mean(&|v| f64::from(v) / 255.0)), ("srgb", mean(&srgb))] {
                    let text = format!("space \"{space}\"; {prefilter}");
                    let file = png8(side, side, ColorType::Grayscale, &noise);
                    let seen = middle(&from_afar(file, &text, "use=\"replace\"", 3));
                    // An ellipse's weights differ from part to part of the picture, and so do these.
                    let tolerance = if prefilter.contains("ewa") { 0.03 } else { 1e-4 };
                    close(&format!("{space} noise from {dark} to {bright} of {side}²"), seen.g, exact, tolerance);
                }
            }
        }
    }
}

/// Also where a pixel covers a few texels, the picture as a whole keeps its light.
#[test]
fn levels_between_keep_the_light_of_a_picture() {
    let side = 256u32;
    let noise: Vec<u8> = (0..side * side).map(|i| (random(u64::from(i)) * 3.99) as u8).collect();
    for (space, of) in [("linear", (&|v: u8| f64::from(v) / 255.0) as &dyn Fn(u8) -> f64), ("srgb", &srgb)] {
        let exact = noise.iter().map(|v| of(*v)).sum::<f64>() / f64::from(side * side);
        for pixels in [16, 32, 48, 64] {
            let text = format!("space \"{space}\"");
            let seen = from_afar(png8(side, side, ColorType::Grayscale, &noise), &text, "use=\"replace\"", pixels)
                .pixels
                .iter()
                .map(|p| f64::from(p.g))
                .sum::<f64>();
            // `from_afar` shows as many units as pixels; the picture repeats in each.
            close(&format!("{space} over {pixels} pixels"), seen / f64::from(pixels * pixels), exact, 5e-3);
        }
    }
}

/// A ramp's mean over a pixel is that over its width: exactly where it runs along a side of the pixel.
#[test]
fn ramps_are_averaged_over_the_pixel() {
    let text = |used: &str| {
        let texture = "texture \"c\" kind=\"ramp\" { stops 0 1 0 0.2  0.3 0 1 0.4  0.7 0.9 0.1 0  1 0.2 0.3 1; interpolation \"step\" }";
        textured(texture, &format!("texture \"c\" use=\"replace\" mapping=\"planar\" space=\"world\" {used}"), 1.0)
    };
    let steps: [(f64, [f64; 3]); 4] =
        [(0.0, [1.0, 0.0, 0.2]), (0.3, [0.0, 1.0, 0.4]), (0.7, [0.9, 0.1, 0.0]), (1.0, [0.2, 0.3, 1.0])];
    let seen = picture(&text(""));
    for x in 0..8u32 {
        let (low, high) = (f64::from(x) / 8.0, f64::from(x + 1) / 8.0);
        let exact: [f64; 3] = std::array::from_fn(|c| {
            let part = |i: usize| (steps[i + 1].0.min(high) - steps[i].0.max(low)).max(0.0) * steps[i].1[c];
            (0..3).map(part).sum::<f64>() * 8.0
        });
        for (value, exact) in seen.pixel(x, 3).to_array().into_iter().zip(exact) {
            assert!((f64::from(value) - exact).abs() < 1e-4, "{x}: {value} for {exact}");
        }
    }
    // Turned by a quarter it runs downwards.
    let turned = picture(&text("{ rotate-z 90 }"));
    let rows: Vec<Rgb> = (0..8).map(|y| turned.pixel(3, y)).collect();
    let columns: Vec<Rgb> = (0..8).map(|x| seen.pixel(x, 3)).collect();
    let near = |a: &Rgb, b: &Rgb| a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < 1e-4);
    assert!(rows.iter().rev().zip(&columns).all(|(a, b)| near(a, b)), "{rows:?} {columns:?}");
}

// Lights.

/// A floor under a light, seen in its middle.
fn floor(light: &str) -> f64 {
    let text = format!(
        "film {{ samples 64 }}
        camera {{ eye 0 1 2; center 0 0 0; fovy 2; size 4 4 }}
        material \"w\" {{ kd 1 }}
        plane material=\"w\" {{ point 0 0 0; normal 0 1 0 }}
        {light}"
    );
    let seen = picture(&text);
    seen.pixels.iter().map(|p| f64::from(p.g)).sum::<f64>() / seen.pixels.len() as f64
}

/// A mirrored light shines from the mirrored side, whatever mirrors it and however often.
#[test]
fn mirrored_lights_shine_from_the_mirrored_side() {
    let rectangle = "light \"rectangle\" { corner -1 2 -1; u 2 0 0; v 0 0 2; samples 4; emission \"matte\"";
    let disk = "light \"disk\" { position 0 2 0; normal 0 -1 0; radius 1; samples 4; emission \"matte\"";
    // The form factor of a rectangle of 2a × 2b straight above at height h, and of a disk.
    let (a, b) = (0.5f64, 0.5f64);
    let factor = |a: f64, b: f64| {
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        4.0 / (2.0 * PI) * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    for (name, light, exact) in [("rectangle", rectangle, factor(a, b)), ("disk", disk, 1.0 / 5.0)] {
        for down in [
            "}",
            "scale -1 1 1 }",
            "scale 1 1 -1 }",
            "scale -1 1 -1 }",
            "scale -1 1 1; rotate-y 40 }",
            "rotate-y 90; scale -1 1 1; scale 1 1 -1 }",
            "samples 0; points 256; scale -1 1 1 }",
        ] {
            let light = if down.starts_with("samples") { light.replace("samples 4;", "") } else { light.to_owned() };
            let down = down.trim_start_matches("samples 0; ");
            let value = floor(&format!("{light}; {down}"));
            close(&format!("{name} {down}"), value, exact, 0.02);
            let grouped = format!("group {{ group {{ {light} }} }}\n{}\nscale 1 1 -1 }}", down.trim_end_matches('}'));
            if !down.contains("points") {
                close(&format!("grouped {name} {down}"), floor(&grouped), exact, 0.02);
                let copied = format!("prototype name=\"g\" {{ {light} }} }}\ninstance of=\"g\" {{ {down}");
                close(&format!("copied {name} {down}"), floor(&copied), exact, 0.02);
            }
        }
        let up = light.replace("corner -1 2 -1", "corner -1 -2 -1").replace("position 0 2 0", "position 0 -2 0");
        assert_eq!(floor(&format!("{up}; scale -1 }}")), 0.0, "{name} turned inside out looks up");
        let up = format!("{light}; translate 0 -4 0; scale 1 -1 1 }}");
        assert_eq!(floor(&up), 0.0, "{name} mirrored upwards looks up");
    }
}

/// Sides of triangles and meshes stay theirs in mirrors too.
#[test]
fn mirrored_surfaces_keep_their_visible_side() {
    let obj = b"v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nf 1 2 3 4\n".to_vec();
    let looks = |object: &str, eye: f64| {
        let text = format!(
            "film {{ sample \"center\" }}
            camera {{ eye 0 {eye} 0.1; center 0 0 0; fovy 10; size 1 1 }}
            ambient 1
            material \"w\" {{ kd 1 }}
            {object}"
        );
        picture_with(&text, &[("square.obj", obj.clone())]).pixel(0, 0).g
    };
    let triangle = "triangle material=\"w\" { a -1 0 -1; b 0 0 2; c 1 0 -1; one-sided #true";
    let mesh = "mesh file=\"square.obj\" material=\"w\" { one-sided #true";
    for (name, object) in [("triangle", triangle), ("mesh", mesh)] {
        for (transform, from_above) in [
            ("", true),
            ("scale -1 1 1", true),
            ("scale 1 1 -1", true),
            ("scale -1 1 -1", true),
            ("scale 1 -1 1", false),
            ("scale -1", false),
        ] {
            for placed in [format!("{object}; {transform} }}"), format!("group {{ {object} }}; {transform} }}")] {
                let seen = [5.0, -5.0].map(|eye| looks(&placed, eye));
                let expected = if from_above { [1.0, 0.0] } else { [0.0, 1.0] };
                assert_eq!(seen, expected, "{name} {transform}: {placed}");
            }
        }
    }
}

// Surroundings.

/// The light that surroundings add to the ambient light.
fn ambient(environment: &str, files: &[(&str, Vec<u8>)]) -> Rgb {
    let text = format!(
        "camera {{ eye 0 0 5; center 0 0 0; size 3 3; fovy 5 }}
        {environment}
        material \"w\" {{ kd 1 }}
        sphere material=\"w\" {{ center 0 0 0; radius 1 }}"
    );
    picture_with(&text, files).pixel(1, 1)
}

/// The mean of a panorama is that of its texels by the solid angle that each covers.
#[test]
fn the_mean_of_a_panorama_is_exact_to_the_poles() {
    for (w, h) in [(8u32, 4u32), (64, 32), (1024, 512), (34, 17), (6, 3)] {
        for row in [0, 1, h / 2, h - 1] {
            let data: Vec<u8> = (0..h).flat_map(|y| vec![if y == row { 255 } else { 0 }; w as usize]).collect();
            let file = png8(w, h, ColorType::Grayscale, &data);
            let [from, to] = [row, row + 1].map(|y| (f64::from(y) / f64::from(h) * PI).cos());
            for filter in ["filter \"bilinear\"", "filter \"nearest\""] {
                let text = format!("environment \"lat-long\" file=\"e.png\" ambient=#true {{ {filter} }}");
                let seen = ambient(&text, &[("e.png", file.clone())]);
                close(&format!("row {row} of {w} × {h}, {filter}"), seen.g, 0.5 * (from - to), 1e-5);
            }
        }
    }
}

/// So is that of a cube, in which a texel in a corner covers a fifth of what one in the middle does.
#[test]
fn the_mean_of_a_cube_is_exact_to_its_corners() {
    let n = 5u32;
    for (x, y) in [(0, 0), (2, 2), (4, 1), (3, 4)] {
        let face = |white: bool| {
            let data: Vec<u8> = (0..n * n).map(|i| if white && i == y * n + x { 255 } else { 0 }).collect();
            png8(n, n, ColorType::Grayscale, &data)
        };
        // ∫ (1 + x² + y²)^(−3/2) over the texel, by many points.
        let steps = 400;
        let mut angle = 0.0;
        for i in 0..steps {
            for j in 0..steps {
                let along = |texel: u32, k: u32| {
                    2.0 * (f64::from(texel) + (f64::from(k) + 0.5) / f64::from(steps)) / f64::from(n) - 1.0
                };
                let (p, q) = (along(x, i), along(y, j));
                angle += (1.0 + p * p + q * q).powf(-1.5) * (2.0 / f64::from(n) / f64::from(steps)).powi(2);
            }
        }
        for filter in ["filter \"bilinear\"", "filter \"nearest\""] {
            let text = format!(
                "environment \"cube\" ambient=#true {{ right \"w.png\"; left \"b.png\"; top \"b.png\"; bottom \"b.png\"; front \"b.png\"; back \"b.png\"; {filter} }}"
            );
            let seen = ambient(&text, &[("w.png", face(true)), ("b.png", face(false))]);
            close(&format!("texel {x}, {y}, {filter}"), seen.g, angle / (4.0 * PI), 1e-4);
        }
    }
}

// Depth.

/// Depth is the distance of the position from the eye: through a lens, behind holes, and while the camera moves.
#[test]
fn depth_is_measured_from_the_eye() {
    let size = 16;
    let leaf: Vec<u8> = (0..64).flat_map(|i| [90, 90, 90, if i % 3 == 0 { 255 } else { 0 }]).collect();
    let files = [("leaf.png", png8(8, 8, ColorType::Rgba, &leaf))];
    let text = |film: &str, camera: &str, more: &str| {
        format!(
            "film {{ {film} }}
            camera {{ eye 1 2 6; center 0 0.3 0; fovy 50; size {size} {size}; {camera} }}
            {more}
            plane {{ point 0 -1 0; normal 0 1 0 }}
            sphere {{ center 0 0 0; radius 1 }}
            ambient 1"
        )
    };
    let holes = "texture \"c\" file=\"leaf.png\" { filter \"nearest\"; prefilter \"none\" }
        material \"m\" { texture \"c\" use=\"cutout\" mapping=\"planar\" space=\"world\" }
        disk material=\"m\" { center 0 0 2; normal 0 0 1; radius 3 }";
    for film in ["samples 4", "sample \"center\"", "sample \"jittered\" n=2", "samples 5; filter \"mitchell\""] {
        for (camera, more) in [
            ("", ""),
            ("lens { radius 0.8 }", ""),
            ("", holes),
            ("lens { radius 0.8 }", holes),
            ("motion { eye 2 2 6 }", ""),
            ("lens { radius 0.8 }; motion { eye 2 2 6 }", ""),
        ] {
            let scene = scene(&text(film, camera, more), &files);
            let job = Job { aovs: vec![Aov::Depth, Aov::Position], ..job(&scene) };
            let world = World::build(scene).unwrap();
            let seen = render(&world, &job, &()).unwrap().picture;
            let (depth, position) = (&seen.layer("depth").unwrap().data, &seen.layer("position").unwrap().data);
            for (i, (depth, p)) in depth.iter().zip(position.chunks_exact(3)).enumerate() {
                let tree = explain(&world, &job, i as u32 % size, i as u32 / size).unwrap();
                let time = tree.samples[0].time.unwrap_or(0.0);
                let eye = job.camera.at(time).eye().to_array();
                let distance = (0..3).map(|c| (f64::from(p[c]) - eye[c]).powi(2)).sum::<f64>().sqrt();
                assert!(
                    depth.is_infinite() || (f64::from(*depth) - distance).abs() < 1e-5 * distance,
                    "{film}; {camera}; {}: {depth} instead of {distance} in pixel {i}",
                    !more.is_empty()
                );
            }
        }
    }
}
