//! Textures: the borders of images, and the means in coarse levels and ramps.

use super::*;

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

/// Beyond an image with the border mode "none" there is nothing of its colour. An image without alpha equals one with
/// an alpha of 1, for any filter, size and use. A white overlay darkens nothing.
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

/// Voxel grids without alpha behave as images do.
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

/// A picture of an image at this number of pixels; the image fills one pixel at 1.
fn from_afar(file: Vec<u8>, texture: &str, used: &str, pixels: u32) -> Picture {
    let texture = format!("texture \"c\" file=\"c.png\" {{ texels \"edges\"; {texture} }}");
    let used = format!("texture \"c\" {used} mapping=\"planar\" space=\"world\"");
    let text = textured(&texture, &used, f64::from(pixels)).replace("kd 0 0 1", "kd 1");
    let text = text.replace("size 8 8", &format!("size {pixels} {pixels}"));
    picture_with(&text, &[("c.png", file)])
}

/// A pixel that covers the whole image shows the mean of its texels. Cases are sparse leaves, noise in linear and in
/// sRGB values, and colours with alpha, in 8 and 16 bits.
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
                    // The weights of an EWA ellipse vary over the picture, and so do its values.
                    let tolerance = if prefilter.contains("ewa") { 0.03 } else { 1e-4 };
                    close(&format!("{space} noise from {dark} to {bright} of {side}²"), seen.g, exact, tolerance);
                }
            }
        }
    }
}

/// The picture keeps its mean where a pixel covers a few texels, too.
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
            // `from_afar` shows as many units as pixels; the image repeats in each.
            close(&format!("{space} over {pixels} pixels"), seen / f64::from(pixels * pixels), exact, 5e-3);
        }
    }
}

/// A ramp's mean over a pixel is its mean over the pixel's width. It is exact where the ramp is parallel to a side of
/// the pixel.
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
    // After a quarter turn the ramp runs downwards.
    let turned = picture(&text("{ rotate-z 90 }"));
    let rows: Vec<Rgb> = (0..8).map(|y| turned.pixel(3, y)).collect();
    let columns: Vec<Rgb> = (0..8).map(|x| seen.pixel(x, 3)).collect();
    let near = |a: &Rgb, b: &Rgb| a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < 1e-4);
    assert!(rows.iter().rev().zip(&columns).all(|(a, b)| near(a, b)), "{rows:?} {columns:?}");
}
