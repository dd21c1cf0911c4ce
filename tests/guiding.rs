//! Path guiding: the mean of a picture stays, its noise shrinks where light is found by chance, and its bytes depend on
//! nothing else.

use canaletto::camera::Camera;
use canaletto::explain::Explainer;
use canaletto::film::BlockMean;
use canaletto::math::Rgb;
use canaletto::render::{Job, Preparation, Rendering, Session, render};
use canaletto::scene::{Guiding, PathSettings, Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::{assert_same_picture, root};

fn scene(path: &str) -> Scene {
    let path = root().join(path);
    let assets = FolderAssets::new(path.parent().unwrap()).unwrap();
    read_scene(path.file_name().unwrap().to_str().unwrap(), &assets).unwrap().0
}

fn job(scene: &Scene, guiding: Guiding, seed: u64, samples: u32) -> Job {
    let mut film = scene.film;
    film.sampling = Sampling::Sampled(samples);
    let settings = PathSettings { guiding, ..PathSettings::DEFAULT };
    Job { seed, ..Job::new(Camera::of(&scene.views[0]).unwrap(), film, settings) }
}

fn is_guided(rendering: &Rendering) -> bool {
    rendering.counts.others.iter().any(|(name, count)| *name == "guiding cells" && *count > 0)
}

/// The mean and the variance of the mean of each block of 8 × 8 pixels over pictures of different seeds.
fn blocks(pictures: &[Rendering]) -> Vec<(f64, f64)> {
    let width = pictures[0].picture.width;
    let block = |rendering: &Rendering, left: u32, top: u32| {
        let pixels = (0..64).map(|i| rendering.picture.pixel(left + i % 8, top + i / 8));
        pixels.map(|pixel| pixel.to_array().iter().map(|c| f64::from(*c)).sum::<f64>()).sum::<f64>() / 64.0
    };
    let places = (0..width / 8).flat_map(|y| (0..width / 8).map(move |x| (x * 8, y * 8)));
    let n = pictures.len() as f64;
    let of_place = |(left, top)| {
        let means: Vec<f64> = pictures.iter().map(|rendering| block(rendering, left, top)).collect();
        let mean = means.iter().sum::<f64>() / n;
        let variance = means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, variance / n)
    };
    places.map(of_place).collect()
}

/// Guided or not, blocks have the same light within their noise, and there is less noise with guiding.
#[test]
fn the_mean_stays_and_noise_shrinks() {
    let scene = scene("tests/scenes/lamp-in-glass.kdl");
    let world = World::build(scene.clone()).unwrap();
    let of = |guiding, seeds: u64| {
        let pictures = (0..12).map(|i| render(&world, &job(&scene, guiding, seeds + i, 64), &()).unwrap());
        blocks(&pictures.collect::<Vec<_>>())
    };
    let (on, off) = (of(Guiding::On, 0), of(Guiding::Off, 100));
    for (place, ((guided, own), (plain, other))) in on.iter().zip(&off).enumerate() {
        // The 16 blocks are tested together.
        let error = (own + other).sqrt();
        assert!((guided - plain).abs() < 4.5 * error, "block {place}: {guided}, not {plain} ± {error}");
    }
    let [sum_on, sum_off] = [&on, &off].map(|all| all.iter().map(|(mean, _)| mean).sum::<f64>());
    let error = on.iter().chain(&off).map(|(_, variance)| variance).sum::<f64>().sqrt();
    assert!((sum_on - sum_off).abs() < 4.0 * error, "{sum_on}, not {sum_off} ± {error}");
    let noise = |all: &[(f64, f64)]| all.iter().map(|(mean, variance)| variance / (mean * mean)).sum::<f64>();
    println!("variance with guiding {:.3} of that without", noise(&on) / noise(&off));
    assert!(noise(&on) < 0.95 * noise(&off), "{} {}", noise(&on), noise(&off));
}

/// By default it is on where directions that bring light are rare, for any size of the picture. It is off where lamps
/// that can be asked give most light, and where it learns too little. The bytes are those of the word.
#[test]
fn it_is_on_where_it_pays() {
    for (path, size, expected) in [
        ("tests/scenes/lamp-in-glass.kdl", 32, Guiding::On),
        ("tests/scenes/noise/hidden-lamp.kdl", 24, Guiding::On),
        ("scenes/cornell-box.kdl", 32, Guiding::Off),
        ("scenes/area-lights.kdl", 32, Guiding::Off),
        ("scenes/glass-and-metal.kdl", 32, Guiding::Off),
    ] {
        let mut scene = scene(path);
        let view = &mut scene.views[0].intrinsics;
        (view.width, view.height) = (size, size);
        let world = World::build(scene.clone()).unwrap();
        let of = |guiding| render(&world, &job(&scene, guiding, 1, 4), &()).unwrap();
        let (default, reference) = (of(PathSettings::DEFAULT.guiding), of(expected));
        assert_eq!(is_guided(&reference), expected == Guiding::On, "{path}");
        assert_eq!(is_guided(&default), is_guided(&reference), "{path}");
        assert_same_picture(&default.picture, &reference.picture, path);
    }
}

/// The bytes are equal for any number of threads, and for parts of a picture that are added. The explanation of a pixel
/// adds up to it.
#[test]
fn bytes_depend_on_the_scene_alone() {
    let scene = scene("tests/scenes/lamp-in-glass.kdl");
    let world = World::build(scene.clone()).unwrap();
    let whole = job(&scene, Guiding::Auto, 7, 16);
    let reference = render(&world, &whole, &()).unwrap();
    assert!(is_guided(&reference));
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| render(&world, &whole, &()).unwrap());
        assert_same_picture(&again.picture, &reference.picture, &format!("{threads} threads"));
    }
    let parts = [0, 8].map(|first_sample| {
        let part = Job { first_sample, ..job(&scene, Guiding::Auto, 7, 8) };
        render(&world, &part, &()).unwrap().picture.pixels
    });
    for (i, pixel) in reference.picture.pixels.iter().enumerate() {
        assert_eq!(BlockMean::of([parts[0][i], parts[1][i]]).mean, *pixel);
    }
    let lit = reference.picture.pixels.iter().position(|pixel| *pixel != Rgb::BLACK).unwrap() as u32;
    let [x, y] = [lit % reference.picture.width, lit / reference.picture.width];
    let session = Session::open(&world, &whole, Preparation::default()).unwrap();
    let tree = Explainer::new(&session).paths(x, y).unwrap();
    assert_eq!(tree.color, reference.picture.pixel(x, y));
    assert_eq!(tree.sum(), tree.color);
}
