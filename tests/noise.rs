//! `--noise`: the real error of pictures whose pixels get samples until their estimated error is small enough.

use canaletto::camera::Camera;
use canaletto::film::{HalfBuffers, Picture};
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::root;

/// Scenes of 24 × 24 pixels, each with another reason why light is hard to find.
const SCENES: [&str; 10] =
    ["gap", "small-lights", "glass", "sky", "lamp", "metal", "hidden-lamp", "dark", "blur", "checks"];

/// The side of the blocks whose error is limited.
const BLOCK: u32 = 8;

fn scene(name: &str) -> Scene {
    let assets = FolderAssets::new(root().join("tests/scenes/noise")).unwrap();
    read_scene(&format!("{name}.kdl"), &assets).unwrap().0
}

/// The relative error of each block, by the definition of [`Job::noise`]. The error of the reference itself is taken
/// away.
fn errors(picture: &Picture, reference: &Picture) -> Vec<f64> {
    let halves = HalfBuffers::of(reference).unwrap();
    let mut blocks = Vec::new();
    for top in (0..picture.height).step_by(BLOCK as usize) {
        for left in (0..picture.width).step_by(BLOCK as usize) {
            let (mut square, mut light) = (0.0, 0.0);
            for i in 0..BLOCK * BLOCK {
                let (x, y) = (left + i % BLOCK, top + i / BLOCK);
                let own = halves.variance((y * picture.width + x) as usize).to_array();
                let both = picture.pixel(x, y).to_array().into_iter().zip(reference.pixel(x, y).to_array());
                for ((color, exact), own) in both.zip(own) {
                    square += f64::from(color - exact).powi(2) - f64::from(own);
                    light += f64::from(exact);
                }
            }
            let components = f64::from(3 * BLOCK * BLOCK);
            blocks.push((square.max(0.0) / components, light / components));
        }
    }
    let mut lights: Vec<f64> = blocks.iter().map(|(_, light)| *light).filter(|light| *light > 0.0).collect();
    lights.sort_unstable_by(f64::total_cmp);
    let darkest = 0.1 * lights[lights.len() / 2];
    blocks.iter().map(|(square, light)| square.sqrt() / light.max(darkest)).collect()
}

/// No scene has more than 1.2 times the error that is asked for. Light through a gap, of small lamps, through glass and
/// out of focus is found by chance, so that few samples may look even where it was missed.
#[test]
fn the_real_error_is_the_one_that_is_asked_for() {
    const ASKED: f32 = 0.2;
    let most = Sampling::Sampled(1024);
    let mut too_large = Vec::new();
    for name in SCENES {
        let scene = scene(name);
        let world = World::build(scene.clone()).unwrap();
        let job = |seed: u64, sampling: Sampling| {
            let mut film = scene.film;
            film.sampling = sampling;
            let aovs = vec![Aov::HalfA, Aov::HalfB, Aov::Samples];
            Job { seed, aovs, ..Job::new(Camera::of(&scene.views[0]).unwrap(), film, scene.integrator) }
        };
        let reference = render(&world, &job(99, Sampling::Sampled(2048)), &()).unwrap().picture;
        let mut blocks = Vec::new();
        let (mut samples, mut worst_seed, mut reached) = (0.0, 0.0f64, 0);
        const SEEDS: u64 = 2;
        for seed in 0..SEEDS {
            let rendering = render(&world, &Job { noise: Some(ASKED), ..job(seed, most) }, &()).unwrap();
            let errors = errors(&rendering.picture, &reference);
            let statistics = rendering.statistics.unwrap();
            // A picture that has the most samples first makes no promise.
            reached += u32::from(statistics.noise.unwrap() <= ASKED);
            samples += statistics.total as f64 / rendering.picture.pixels.len() as f64 / SEEDS as f64;
            let mean = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
            worst_seed = worst_seed.max(mean.sqrt() / f64::from(ASKED));
            blocks.extend(errors);
        }
        let all = (blocks.iter().map(|error| error * error).sum::<f64>() / blocks.len() as f64).sqrt();
        let worst = blocks.iter().fold(0.0f64, |most, error| most.max(*error));
        println!(
            "{name:<13} {samples:>7.0} samples, {reached} of {SEEDS} reached it; error/asked: mean {:.2}, worst picture {worst_seed:.2}, worst block {:.2}",
            all / f64::from(ASKED),
            worst / f64::from(ASKED)
        );
        if worst_seed > 1.2 && reached == SEEDS as u32 {
            too_large.push(name);
        }
    }
    assert!(too_large.is_empty(), "too much error: {too_large:?}");
}
