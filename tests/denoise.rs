//! Denoised pictures of the project's scenes beside converged ones, and the features that denoising takes.

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::denoise::{DenoiseQuality, NoisyPicture, denoise};
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Intrinsics, PathSettings, Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::{FolderAssets, MemoryAssets};
use canaletto_io::text::read_scene;
use canaletto_tests::root;
use std::ops::ControlFlow;

fn job(scene: &Scene, size: [u32; 2], samples: u32, seed: u64, aovs: &[Aov]) -> Job {
    let mut view = scene.views[0].clone();
    view.intrinsics = Intrinsics { width: size[0], height: size[1], ..view.intrinsics };
    let mut film = scene.film;
    film.sampling = Sampling::Sampled(samples);
    let job = Job::new(Camera::of(&view).unwrap(), film, PathSettings::DEFAULT);
    Job { seed, aovs: aovs.to_vec(), ..job }
}

fn triples(picture: &Picture, aov: Aov) -> Vec<[f32; 3]> {
    picture.layer(aov.name()).unwrap().data.as_chunks::<3>().0.to_vec()
}

fn noisy(picture: &Picture) -> NoisyPicture {
    let half = |aov| triples(picture, aov).into_iter().map(Rgb::from).collect();
    NoisyPicture {
        width: picture.width,
        height: picture.height,
        color: picture.pixels.clone(),
        halves: Some([half(Aov::HalfA), half(Aov::HalfB)]),
        albedo: Some(triples(picture, Aov::DenoisingAlbedo)),
        normal: Some(triples(picture, Aov::DenoisingNormal)),
        depth: Some(picture.layer("denoising-depth").unwrap().data.clone()),
    }
}

/// The mean square error beside two converged pictures, without their own noise.
fn error(colors: &[Rgb], converged: &[Picture; 2]) -> f64 {
    let mut sum = 0.0;
    for ((color, a), b) in colors.iter().zip(&converged[0].pixels).zip(&converged[1].pixels) {
        for ((v, a), b) in color.to_array().into_iter().zip(a.to_array()).zip(b.to_array()) {
            let (mean, spread) = (0.5 * f64::from(a + b), 0.5 * f64::from(a - b));
            sum += (f64::from(v) - mean).powi(2) - spread * spread;
        }
    }
    sum / colors.len() as f64
}

/// No denoised picture is worse than the noisy one, from few samples to many.
#[test]
fn no_denoised_picture_is_worse_than_the_noisy_one() {
    let layers = [Aov::HalfA, Aov::HalfB, Aov::DenoisingAlbedo, Aov::DenoisingNormal, Aov::DenoisingDepth];
    for name in ["path", "cornell-box", "gallery-room"] {
        let assets = FolderAssets::new(root().join("scenes")).unwrap();
        let scene = read_scene(&format!("{name}.kdl"), &assets).unwrap().0;
        let world = World::build(scene.clone()).unwrap();
        let size = [64, 48];
        let converged = [101, 102].map(|seed| render(&world, &job(&scene, size, 256, seed, &[]), &()).unwrap().picture);
        for samples in [4, 16, 64] {
            let picture = render(&world, &job(&scene, size, samples, 1, &layers), &()).unwrap().picture;
            let noisy = noisy(&picture);
            for quality in [DenoiseQuality::Fast, DenoiseQuality::Good] {
                let ControlFlow::Continue(denoised) = denoise(&noisy, quality, &|_| true) else { panic!() };
                let gain = error(&noisy.color, &converged) / error(&denoised.color, &converged);
                println!("{name:14} {samples:4} {:5} {gain:6.2}", quality.name());
                assert!(gain > 1.0, "{name}, {samples} samples, {}: {gain}", quality.name());
            }
        }
    }
}

/// Through a mirror and through glass the features are those of the wall behind.
#[test]
fn features_follow_mirrors_and_glass() {
    let text = r#"
        camera { eye 0 0 4; center 0 0 0; fovy 20; size 8 8 }
        integrator "path"
        background 0.25 0.5 4
        material "red" { kd 0.6 0.2 0.1 }
        material "mirror" { kd 0; ks 0; k 0.5 }
        material "glass" { dielectric 1.5 }
        material "lamp" { kd 0; emission 8 4 2 }
    "#;
    let seen = |shapes: &str| {
        let assets = MemoryAssets::new().with("s.kdl", format!("{text}\n{shapes}"));
        let scene = read_scene("s.kdl", &assets).unwrap_or_else(|e| panic!("{e}")).0;
        let world = World::build(scene.clone()).unwrap();
        let layers = [Aov::DenoisingAlbedo, Aov::DenoisingNormal, Aov::DenoisingDepth];
        let picture = render(&world, &job(&scene, [8, 8], 16, 0, &layers), &()).unwrap().picture;
        let at = 4 * 8 + 4;
        let depth = picture.layer("denoising-depth").unwrap().data[at];
        (triples(&picture, layers[0])[at], triples(&picture, layers[1])[at], depth)
    };
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.02);
    let wall = "box material=\"red\" { min -9 -9 -2; max 9 9 -1 }";
    let (albedo, normal, depth) = seen(wall);
    assert!(near(albedo, [0.6, 0.2, 0.1]) && near(normal, [0.0, 0.0, 1.0]) && (depth - 5.0).abs() < 0.1);
    // The mirror shows the wall behind the eye: 4 to the mirror, and 6 back.
    let mirrored =
        "box material=\"mirror\" { min -9 -9 -1; max 9 9 0 }\nbox material=\"red\" { min -9 -9 6; max 9 9 7 }";
    let (albedo, normal, depth) = seen(mirrored);
    assert!(near(albedo, [0.3, 0.1, 0.05]) && near(normal, [0.0, 0.0, -1.0]) && (depth - 10.0).abs() < 0.2);
    // A pane loses 4 % on each side and mirrors the blue background, whose albedo is its colour over its largest part.
    let (albedo, normal, _) = seen(&format!("{wall}\nbox material=\"glass\" {{ min -9 -9 0; max 9 9 0.1 }}"));
    assert!(albedo[0] > 0.5 && albedo[0] < 0.62 && normal[2] > 0.8, "{albedo:?} {normal:?}");
    let (albedo, normal, depth) = seen("");
    assert!(near(albedo, [0.0625, 0.125, 1.0]) && near(normal, [0.0; 3]) && depth.is_infinite());
    let (albedo, ..) = seen("box material=\"lamp\" { min -9 -9 -1; max 9 9 0 }");
    assert!(near(albedo, [1.0, 0.5, 0.25]));
}
