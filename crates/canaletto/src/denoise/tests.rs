//! Pictures whose truth is a formula, with noise of known kinds.

use super::*;

const SIDE: usize = 64;

/// Independent numbers in [0, 1).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

/// A kind of noise: the light of one sample, with mean 1.
#[derive(Clone, Copy, Debug)]
enum Noise {
    /// Uniform from 0 to 2.
    Even,
    /// Nothing, or ten times the mean.
    Rare,
    /// Half the mean, and a firefly of a thousand times the rest for one of two thousand.
    Fireflies,
}

impl Noise {
    fn sample(self, numbers: &mut Numbers) -> f32 {
        match self {
            Noise::Even => 2.0 * numbers.next(),
            Noise::Rare => {
                if numbers.next() < 0.1 {
                    10.0
                } else {
                    0.0
                }
            }
            Noise::Fireflies => 0.5 + if numbers.next() < 0.0005 { 1000.0 } else { 0.0 },
        }
    }
}

/// A textured floor under a shaded wall with a stripe of shadow, and a lamp.
struct Truth {
    color: Vec<Rgb>,
    albedo: Vec<[f32; 3]>,
    normal: Vec<[f32; 3]>,
    depth: Vec<f32>,
}

impl Truth {
    fn new() -> Truth {
        let mut truth = Truth { color: Vec::new(), albedo: Vec::new(), normal: Vec::new(), depth: Vec::new() };
        for i in 0..SIDE * SIDE {
            let (x, y) = ((i % SIDE) as f32 / SIDE as f32, (i / SIDE) as f32 / SIDE as f32);
            let is_floor = y > 0.6;
            let checker = ((x * 8.0) as u32 + (y * 8.0) as u32).is_multiple_of(2);
            let albedo = match (is_floor, checker) {
                (true, true) => [0.8, 0.7, 0.5],
                (true, false) => [0.2, 0.1, 0.05],
                (false, _) => [0.5, 0.5, 0.6],
            };
            let mut light = 0.4 + 0.3 * (3.0 * x + 2.0 * y).sin();
            if (x - y).abs() < 0.1 {
                light *= 0.3;
            }
            let is_lamp = (x - 0.3).hypot(y - 0.2) < 0.06;
            let color = if is_lamp { Rgb::gray(8.0) } else { Rgb::from(albedo) * light };
            truth.color.push(color);
            truth.albedo.push(if is_lamp { [1.0; 3] } else { albedo });
            truth.normal.push(if is_floor { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
            truth.depth.push(if is_floor { 1.0 / (y - 0.4) } else { 5.0 });
        }
        truth
    }

    /// The picture by this many samples.
    fn noisy(&self, noise: Noise, samples: u32, seed: u64) -> NoisyPicture {
        let mut numbers = Numbers(seed);
        let mut half = || -> Vec<Rgb> {
            let mean = |color: &Rgb| {
                let sum: f32 = (0..samples / 2).map(|_| noise.sample(&mut numbers)).sum();
                // A lamp is seen without noise.
                if color.r == 8.0 { *color } else { *color * (sum / (samples / 2) as f32) }
            };
            self.color.iter().map(mean).collect()
        };
        let halves = [half(), half()];
        NoisyPicture {
            width: SIDE as u32,
            height: SIDE as u32,
            color: halves[0].iter().zip(&halves[1]).map(|(a, b)| (*a + *b) * 0.5).collect(),
            halves: Some(halves),
            albedo: Some(self.albedo.clone()),
            normal: Some(self.normal.clone()),
            depth: Some(self.depth.clone()),
        }
    }

    fn error(&self, color: &[Rgb]) -> f64 {
        let square = |a: f32, b: f32| f64::from(a - b).powi(2);
        let of = |(a, b): (&Rgb, &Rgb)| square(a.r, b.r) + square(a.g, b.g) + square(a.b, b.b);
        self.color.iter().zip(color).map(of).sum::<f64>() / color.len() as f64
    }
}

fn denoised(picture: &NoisyPicture, quality: DenoiseQuality) -> DenoisedPicture {
    match denoise(picture, quality, &|_| true) {
        ControlFlow::Continue(denoised) => denoised,
        ControlFlow::Break(()) => panic!("nothing stops it"),
    }
}

/// Never worse than noisy, and much better where there is much noise.
#[test]
fn errors_fall_at_any_number_of_samples() {
    let truth = Truth::new();
    for noise in [Noise::Even, Noise::Rare, Noise::Fireflies] {
        for samples in [4, 16, 64, 256, 1024, 4096] {
            let picture = truth.noisy(noise, samples, u64::from(samples));
            for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
                let gain = truth.error(&picture.color) / truth.error(&denoised(&picture, quality).color);
                println!("{noise:?} {samples} {quality:?}: {gain:.2}");
                let least = if samples <= 64 { 3.0 } else { 1.0 };
                assert!(gain >= least, "{noise:?}, {samples} samples, {quality:?}: {gain}");
            }
        }
    }
}

/// A picture that has no noise stays as it is.
#[test]
fn a_clean_picture_stays() {
    let truth = Truth::new();
    let mut picture = truth.noisy(Noise::Even, 4, 1);
    picture.color = truth.color.clone();
    picture.halves = Some([truth.color.clone(), truth.color.clone()]);
    for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
        let result = denoised(&picture, quality);
        assert!(truth.error(&result.color) < 1e-9, "{quality:?}: {}", truth.error(&result.color));
        assert_eq!(result.outlier_light, 0.0);
    }
}

/// What an outlier had is reported and stays in the picture.
#[test]
fn the_light_of_outliers_is_reported() {
    let truth = Truth::new();
    let mut picture = truth.noisy(Noise::Even, 1024, 3);
    let firefly = SIDE * 20 + 20;
    let total = |colors: &[Rgb]| colors.iter().map(|c| f64::from(c.r + c.g + c.b)).sum::<f64>();
    let before = total(&picture.color);
    if let Some([a, _]) = &mut picture.halves {
        a[firefly] += Rgb::gray(1000.0);
    }
    picture.color[firefly] += Rgb::gray(500.0);
    let result = denoised(&picture, DenoiseQuality::Good);
    let expected = 1500.0 / (before + 1500.0);
    assert!((result.outlier_light - expected).abs() < 0.05 * expected, "{}, not {expected}", result.outlier_light);
    let after = total(&result.color) / (before + 1500.0);
    // A half met twice the light. What is kept and what is lost are all of it.
    let sum = after + result.lost_light;
    assert!((sum - 1.0).abs() < 0.02, "{after} + {}", result.lost_light);
}

/// The light of small outliers stays in the picture. Without it the picture would lose what is spread.
#[test]
fn light_of_small_outliers_stays_in_the_picture() {
    let truth = Truth::new();
    let mut picture = truth.noisy(Noise::Even, 64, 3);
    let total = |colors: &[Rgb]| colors.iter().map(|c| f64::from(c.r + c.g + c.b)).sum::<f64>();
    for pixel in (0..picture.color.len()).step_by(211) {
        if let Some([a, _]) = &mut picture.halves {
            a[pixel] += Rgb::gray(4.0);
        }
        picture.color[pixel] += Rgb::gray(2.0);
    }
    for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
        let result = denoised(&picture, quality);
        let after = total(&result.color) / total(&picture.color);
        let (found, missing) = (result.outlier_light, (after + result.lost_light - 1.0).abs());
        assert!(found > 0.01 && missing < 0.2 * found, "{quality:?}: {missing} of {found}");
    }
}

/// Equal bits for any number of threads, for light and depth in any power of two, and for mirrored pictures of one row.
#[test]
fn threads_and_units_change_nothing() {
    let truth = Truth::new();
    let picture = truth.noisy(Noise::Rare, 16, 7);
    let first = denoised(&picture, DenoiseQuality::Good).color;
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| denoised(&picture, DenoiseQuality::Good).color) == first, "{threads} threads");
    }
    let mut scaled = picture.clone();
    let scale = |colors: &mut Vec<Rgb>| colors.iter_mut().for_each(|c| *c *= 0.125);
    scale(&mut scaled.color);
    scaled.halves.iter_mut().flatten().for_each(scale);
    scaled.depth.iter_mut().flatten().for_each(|d| *d *= 1024.0);
    let mut expected = first;
    scale(&mut expected);
    assert!(denoised(&scaled, DenoiseQuality::Good).color == expected);
}

/// Missing layers, tiny pictures, and numbers that are none.
#[test]
fn odd_pictures_are_denoised() {
    let truth = Truth::new();
    let whole = truth.noisy(Noise::Even, 4, 5);
    let bare = NoisyPicture { halves: None, albedo: None, normal: None, depth: None, ..whole.clone() };
    let gain = truth.error(&bare.color) / truth.error(&denoised(&bare, DenoiseQuality::Good).color);
    assert!(gain > 1.0, "{gain}");
    for [width, height] in [[1, 1], [3, 1], [1, 5], [17, 2]] {
        let n = (width * height) as usize;
        let color = vec![Rgb::gray(0.5); n];
        let halves = Some([color.clone(), color.clone()]);
        let picture = NoisyPicture { width, height, color: color.clone(), halves, ..NoisyPicture::default() };
        assert!(denoised(&picture, DenoiseQuality::Good).color.iter().all(|c| (c.r - 0.5).abs() < 1e-5));
    }
    let mut broken = whole;
    if let Some([a, _]) = &mut broken.halves {
        a[100] = Rgb::gray(f32::NAN);
        a[200] = Rgb::gray(f32::INFINITY);
    }
    assert!(denoised(&broken, DenoiseQuality::Good).color.iter().all(|c| c.is_finite()));
}

/// Colours of the mean `light` with even noise, in rows of `width` pixels.
fn even_noise([width, height]: [usize; 2], seed: u64, light: impl Fn(usize) -> f32) -> Vec<Rgb> {
    let mut numbers = Numbers(seed);
    (0..width * height).map(|i| Rgb::gray(2.0 * numbers.next() * light(i % width))).collect()
}

/// A picture of two halves, whose features are those of one plane but for normals.
fn of_halves(size: [usize; 2], halves: [Vec<Rgb>; 2], normal: Vec<[f32; 3]>) -> NoisyPicture {
    NoisyPicture {
        width: size[0] as u32,
        height: size[1] as u32,
        color: halves[0].iter().zip(&halves[1]).map(|(a, b)| (*a + *b) * 0.5).collect(),
        halves: Some(halves),
        albedo: None,
        normal: Some(normal),
        depth: Some(vec![1.0; size[0] * size[1]]),
    }
}

fn ones(size: [usize; 2]) -> [Plane; 2] {
    [0, 1].map(|_| Plane::of(size, |_| 1.0))
}

fn picture_mean(plane: &Plane, of: impl Fn(usize) -> bool) -> f64 {
    let values = plane.values.iter().enumerate().filter(|(i, _)| of(i % plane.size[0])).map(|(_, v)| f64::from(*v));
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    sum / f64::from(count)
}

/// An outlier's light is all there, seen nowhere, and in proportion to the light that was there.
#[test]
fn the_light_of_an_outlier_is_spread_and_unseen() {
    let size = [91, 60];
    let taker = |i: usize| if i % size[0] < 45 { 1.0 } else { 0.01 };
    for (removed, is_lost) in [(0.5, false), (20.0, false), (1000.0, true)] {
        let outlier = |i: usize| if i == 30 * size[0] + 40 { [removed; 3] } else { [0.0; 3] };
        let (spread, lost) = spread_outliers(size, outlier, |i| [taker(i); 3]);
        let added: Vec<f64> = (0..size[0] * size[1]).map(|i| f64::from(spread.at(i)[0] * taker(i))).collect();
        let kept = 3.0 * added.iter().sum::<f64>();
        assert!((kept + lost - 3.0 * f64::from(removed)).abs() < 1e-3 * f64::from(removed), "{kept} + {lost}");
        assert_eq!(lost > 0.0, is_lost, "{removed}: {lost}");
        for (i, add) in added.iter().enumerate() {
            assert!(*add <= 0.0201 * f64::from(taker(i)), "{removed}: {add} at {i}");
        }
    }
}

/// A firefly is lowered to what is around it; a lamp that one half missed stays.
#[test]
fn outliers_are_lowered_and_lamps_stay() {
    let half = |firefly: f32| (0..81).map(|i| Rgb::gray(if i == 40 { firefly } else { 1.0 })).collect::<Vec<Rgb>>();
    for (albedo, expected) in [(0.5, 1.5), (1.0, 100.0)] {
        let picture = |other: f32| NoisyPicture {
            albedo: Some((0..81).map(|i| [if i == 40 { albedo } else { 0.5 }; 3]).collect()),
            ..of_halves([9, 9], [half(100.0), half(other)], vec![[0.0, 0.0, 1.0]; 81])
        };
        let lowered = |other: f32| {
            let picture = picture(other);
            let source = Source::new(&picture);
            let factors = lowering(&source);
            let removed = removed_light(&source, 0, &factors[0]) / f64::from(source.exposure);
            (source.color(0, 40)[0] / source.exposure * factors[0].values[40], removed)
        };
        let (color, removed) = lowered(1.0);
        assert!((color - expected).abs() < 1e-4, "{color}");
        assert!((removed - 3.0 * f64::from(100.0 - expected)).abs() < 1e-3, "{removed}");
        // The other half confirms what it met, too.
        assert_eq!(lowered(80.0).0, 100.0);
    }
}

/// Fireflies of both halves that chance brings together leave no islands: an even wall stays even.
#[test]
fn fireflies_leave_no_islands() {
    let size = [128, 96];
    let half = |seed: u64| {
        let mut numbers = Numbers(seed);
        let mut pixel = |_| Rgb::gray(0.8 + 0.4 * numbers.next() + if numbers.next() < 0.04 { 6.0 } else { 0.0 });
        (0..size[0] * size[1]).map(&mut pixel).collect::<Vec<Rgb>>()
    };
    let picture = of_halves(size, [1, 2].map(half), vec![[0.0, 0.0, 1.0]; size[0] * size[1]]);
    for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
        let color = denoised(&picture, quality).color;
        let mean = color.iter().map(|c| c.r).sum::<f32>() / color.len() as f32;
        let islands = color.iter().filter(|c| c.r > 1.15 * mean).count();
        println!("{quality:?}: {islands} pixels of islands, mean {mean}");
        assert!(islands <= 12, "{quality:?}: {islands} pixels");
        assert!((mean - 1.24).abs() < 0.04, "{quality:?}: {mean}");
    }
}

/// What only one filtered half shows is taken from it, and what both show stays.
#[test]
fn islands_of_one_filtered_half_are_taken() {
    let half =
        |places: &[usize]| [0, 1, 2].map(|_| Plane::of([16, 16], |i| if places.contains(&i) { 3.0 } else { 1.0 }));
    let (kept, excess) = confirmed([half(&[40, 140]), half(&[140])]);
    let seen = |planes: &[ColorPlanes; 2], i: usize| [planes[0][1].values[i], planes[1][1].values[i]];
    assert_eq!((seen(&kept, 40), seen(&excess, 40)), ([1.0, 1.0], [2.0, 0.0]));
    assert_eq!((seen(&kept, 140), seen(&excess, 140)), ([3.0, 3.0], [0.0, 0.0]));
}

/// The variance of uniform numbers from 0 to 2 is 1/3, and that of one surface says nothing of another.
#[test]
fn variances_are_those_of_halves_and_keep_to_surfaces() {
    let size = [64, 48];
    let light = |x: usize| if x < 32 { 1.0 } else { 0.1 };
    let normal = (0..64 * 48).map(|i| if i % 64 < 32 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] }).collect();
    let picture = of_halves(size, [1, 2].map(|seed| even_noise(size, seed, light)), normal);
    let source = Source::new(&picture);
    let unit = f64::from(source.exposure).powi(2);
    for variance in variance(&source, &ones(size)) {
        let (left, right) = (picture_mean(&variance, |x| x < 32) / unit, picture_mean(&variance, |x| x == 32) / unit);
        assert!((left - 1.0 / 3.0).abs() < 0.03, "{left}");
        assert!((right - 0.01 / 3.0).abs() < 0.001, "{right}");
    }
}

/// Wavelets keep an edge between two normals that the noise hides. They blur it on an even surface.
#[test]
fn wavelets_keep_edges_of_normals() {
    let size = [64, 192];
    let light = |x: usize| if x < 32 { 1.0 } else { 0.9 };
    let step = |right: [f32; 3]| {
        let normal = (0..size[0] * size[1]).map(|i| if i % 64 < 32 { [0.0, 0.0, 1.0] } else { right }).collect();
        let picture = of_halves(size, [1, 2].map(|seed| even_noise(size, seed, light)), normal);
        let source = Source::new(&picture);
        let unit = f64::from(source.exposure);
        let variance = Plane::of(size, |i| light(i % 64).powi(2) / 3.0 * source.exposure.powi(2));
        let [filtered, _] = atrous(&source, &ones(size), &variance);
        (picture_mean(&filtered[0], |x| x == 31) - picture_mean(&filtered[0], |x| x == 32)) / unit
    };
    let (kept, blurred) = (step([1.0, 0.0, 0.0]), step([0.0, 0.0, 1.0]));
    assert!((kept - 0.1).abs() < 0.03 && blurred < 0.05, "{kept} and {blurred}");
}

/// The colours and the shares of two noisy halves of mean 1 and of even candidates.
fn chosen(halves: &[Vec<Rgb>; 2], candidates: &[f32], direct: &[bool]) -> (Vec<Rgb>, Vec<f64>) {
    let size = [48, 40];
    let pair = |i: usize| [halves[0][i].to_array(), halves[1][i].to_array()];
    let mut errors = vec![Plane::of(size, |i| square_error(pair(i), pair(i)))];
    errors.extend(candidates.iter().map(|v| Plane::of(size, |i| square_error(pair(i), [[*v; 3]; 2]))));
    choose(errors, |n, i| if n == 0 { mean(pair(i)) } else { [candidates[n - 1]; 3] }, direct)
}

/// Of two filters the better one is chosen, and the noisy picture before a bad one.
#[test]
fn the_filter_of_the_least_error_is_chosen() {
    let halves = [1, 2].map(|seed| even_noise([48, 40], seed, |_| 1.0));
    let (none, all) = (vec![false; 48 * 40], vec![true; 48 * 40]);
    assert!(chosen(&halves, &[1.3, 1.05], &none).1[2] > 0.9);
    assert!(chosen(&halves, &[3.0], &none).1[0] > 0.9);
    // Pixels that are seen directly stay, also among others.
    assert!(chosen(&halves, &[1.0], &all).1[0] > 0.999);
    let at = 48 * 20 + 24;
    let direct: Vec<bool> = (0..48 * 40).map(|i| i == at).collect();
    let (colors, _) = chosen(&halves, &[1.0], &direct);
    assert_eq!((colors[at], colors[at + 1]), ((halves[0][at] + halves[1][at]) * 0.5, Rgb::WHITE));
}

/// A filter with nearly the noisy picture's error is better, but not by enough. Here the mean of both halves has
/// the mean square error ½, and noise sums to zero over squares.
#[test]
fn a_filter_has_to_be_better_by_a_tenth() {
    let sign = |n: usize| if n.is_multiple_of(2) { 1.0 } else { -1.0 };
    let half = |of: fn(usize) -> usize| (0..48 * 40).map(|i| Rgb::gray(2.0 + sign(of(i)))).collect::<Vec<Rgb>>();
    let halves = [half(|i| i % 48), half(|i| i / 48)];
    for (share, is_chosen) in [(0.8f32, true), (0.98, false)] {
        let (_, shares) = chosen(&halves, &[2.0 + (0.5 * share).sqrt()], &[false; 48 * 40]);
        assert_eq!(shares[1] > 0.9, is_chosen, "{share}: {shares:?}");
    }
}

/// A texture finer than any filter is no noise, in a picture wider than high.
#[test]
fn fine_textures_stay_in_a_wide_picture() {
    let [width, height] = [72, 40];
    let mut numbers = Numbers(5);
    let n = width * height;
    let albedo: Vec<[f32; 3]> = (0..n).map(|_| [0.4 + 0.2 * numbers.next(), 0.4 + 0.2 * numbers.next(), 0.5]).collect();
    let truth: Vec<Rgb> = (0..n)
        .map(|i| Rgb::from(albedo[i]) * (if i % width < 20 { 0.3 } else { 1.0 } + 0.3 * (i / width) as f32 / 40.0))
        .collect();
    let mut half = || -> Vec<Rgb> { truth.iter().map(|c| *c * (0.8 + 0.4 * numbers.next())).collect() };
    let halves = [half(), half()];
    let picture = NoisyPicture {
        width: width as u32,
        height: height as u32,
        color: halves[0].iter().zip(&halves[1]).map(|(a, b)| (*a + *b) * 0.5).collect(),
        halves: Some(halves),
        albedo: Some(albedo),
        normal: Some((0..n).map(|i| if i % width < 20 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] }).collect()),
        depth: Some((0..n).map(|i| if i % width < 20 { 5.0 } else { 3.0 }).collect()),
    };
    let square = |c: Rgb| f64::from(c.r * c.r + c.g * c.g + c.b * c.b);
    let error = |colors: &[Rgb]| truth.iter().zip(colors).map(|(a, b)| square(*a - *b)).sum::<f64>();
    for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
        let gain = error(&picture.color) / error(&denoised(&picture, quality).color);
        println!("{quality:?}: {gain}");
        assert!(gain > 15.0, "{quality:?}: {gain}");
    }
}

/// Running sums are those of the values.
#[test]
fn large_boxes_sum_what_small_ones_do() {
    let mut numbers = Numbers(3);
    let values: Vec<f32> = (0..23 * 70).map(|i| numbers.next() * (i % 23 + i / 23) as f32).collect();
    let plane = Plane::of([23, 70], |i| values[i]);
    for radius in [1, 4, 5, 30] {
        let (sum, mean) = (plane.box_sum(radius), plane.box_mean(radius));
        for (x, y) in [(0usize, 0usize), (5, 40), (22, 69), (11, 33)] {
            let (mut expected, mut count) = (0.0, 0.0);
            for y in y.saturating_sub(radius)..(y + radius + 1).min(70) {
                for x in x.saturating_sub(radius)..(x + radius + 1).min(23) {
                    expected += plane.at(x, y);
                    count += 1.0;
                }
            }
            assert!((sum.at(x, y) - expected).abs() < 1e-4 * expected, "{radius} at {x}, {y}");
            assert!((mean.at(x, y) - expected / count).abs() < 1e-4 * expected / count, "{radius} at {x}, {y}");
        }
    }
}

/// What no light has is counted, and filled from what is around it: in the colours, in a half, in any layer.
#[test]
fn pixels_that_are_no_light_are_filled() {
    let truth = Truth::new();
    let whole = truth.noisy(Noise::Even, 64, 5);
    let clean = denoised(&whole, DenoiseQuality::Good);
    assert_eq!(clean.filled, FilledPixels::default());
    let plain = |picture: &NoisyPicture| NoisyPicture { halves: None, ..picture.clone() };
    let plain_clean = denoised(&plain(&whole), DenoiseQuality::Good);
    let places = [20 * SIDE + 30, 20 * SIDE + 31, 50 * SIDE + 63, 0];
    for broken in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -5.0] {
        let color = |mut colors: Vec<Rgb>| {
            places.iter().for_each(|i| colors[*i].g = broken);
            colors
        };
        let feature = |mut values: Vec<[f32; 3]>| {
            places.iter().for_each(|i| values[*i][1] = if broken == -5.0 { f32::NAN } else { broken });
            values
        };
        let mut picture = whole.clone();
        picture.color = color(picture.color);
        picture.halves = picture.halves.map(|[a, b]| [color(a), color(b)]);
        picture.albedo = picture.albedo.map(feature);
        picture.normal = picture.normal.map(feature);
        picture.depth.iter_mut().for_each(|depth| depth[7] = f32::NAN);
        for (picture, clean) in [(picture.clone(), &clean), (plain(&picture), &plain_clean)] {
            let filled = denoised(&picture, DenoiseQuality::Good);
            assert_eq!((filled.filled.colors, filled.filled.features), (4, 5), "{broken}");
            for &i in &places {
                let (a, b) = (filled.color[i].to_array(), clean.color[i].to_array());
                let is_near = a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.15 * b);
                assert!(is_near, "{broken} at {i}: {a:?}, not {b:?}");
            }
        }
    }
    // A filter's lobes beside a bright edge lead below black, and stay.
    let mut rung = plain(&whole);
    (rung.color[10 * SIDE + 10], rung.color[10 * SIDE + 11]) = (Rgb::gray(-0.5), Rgb::gray(8.0));
    assert_eq!(denoised(&rung, DenoiseQuality::Fast).filled.colors, 0);
}

/// A hole is filled from its rim inwards, and a picture without any light is black.
#[test]
fn holes_and_whole_pictures_are_filled() {
    let hole = |i: usize| (20..44).contains(&(i % SIDE)) && (20..44).contains(&(i / SIDE));
    let color = |is_broken: &dyn Fn(usize) -> bool| -> Vec<Rgb> {
        (0..SIDE * SIDE).map(|i| if is_broken(i) { Rgb::gray(f32::NAN) } else { Rgb::new(1.0, 2.0, 3.0) }).collect()
    };
    let picture = |color: Vec<Rgb>| NoisyPicture { width: 64, height: 64, color, ..NoisyPicture::default() };
    let filled = denoised(&picture(color(&hole)), DenoiseQuality::Good);
    assert_eq!(filled.filled.colors, 24 * 24);
    let is_near = |c: &Rgb| [c.r - 1.0, c.g - 2.0, c.b - 3.0].iter().all(|d| d.abs() < 1e-5);
    assert!(filled.color.iter().all(is_near));
    let black = denoised(&picture(color(&|_| true)), DenoiseQuality::Good);
    assert_eq!(black.filled.colors, 64 * 64);
    assert!(black.color.iter().all(|c| *c == Rgb::BLACK));
}

/// One pixel of nearly endless light doesn't take the others.
#[test]
fn the_largest_light_leaves_the_rest() {
    let mut picture = Truth::new().noisy(Noise::Even, 64, 5);
    let expected = denoised(&picture, DenoiseQuality::Good);
    picture.halves.iter_mut().for_each(|halves| halves[1][20 * SIDE + 30] = Rgb::gray(3e38));
    let bright = denoised(&picture, DenoiseQuality::Good);
    let far = |i: &usize| (i % SIDE).abs_diff(30) > 8 || (i / SIDE).abs_diff(20) > 8;
    for i in (0..SIDE * SIDE).filter(far) {
        let (a, b) = (bright.color[i].g, expected.color[i].g);
        assert!((a - b).abs() < 0.3 * b, "{a}, not {b}, at {i}");
    }
}

#[test]
fn it_stops_when_asked() {
    let picture = Truth::new().noisy(Noise::Even, 4, 5);
    assert!(denoise(&picture, DenoiseQuality::Good, &|_| false).is_break());
}
