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
                let least = if samples <= 64 { 4.0 } else { 1.0 };
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
    // It is spread over surfaces of other albedos.
    assert!((after - 1.0).abs() < 0.25, "{after}");
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

#[test]
fn it_stops_when_asked() {
    let picture = Truth::new().noisy(Noise::Even, 4, 5);
    assert!(denoise(&picture, DenoiseQuality::Good, &|_| false).is_break());
}
