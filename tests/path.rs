//! Path tracing beside the other integrators, and its promises of equal bytes.

use canaletto::camera::Camera;
use canaletto::film::Picture;
use canaletto::render::{Job, render};
use canaletto::scene::{PathSettings, RadiositySettings, SamplerKind, Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::{FolderAssets, MemoryAssets};
use canaletto_io::text::read_scene;
use canaletto_tests::assert_same_picture;
use canaletto_tests::gallery::{distributed_job, distributed_still_life, still_life, still_life_job};
use canaletto_tests::root;

const PATH: PathSettings = PathSettings::DEFAULT;

fn project_scene(name: &str) -> Scene {
    let assets = FolderAssets::new(root().join("scenes")).unwrap();
    read_scene(name, &assets).unwrap().0
}

/// The mean colours of square blocks of a picture.
fn blocks(picture: &Picture, side: u32) -> Vec<[f64; 3]> {
    let mut means = Vec::new();
    for top in (0..picture.height).step_by(side as usize) {
        for left in (0..picture.width).step_by(side as usize) {
            let mut sum = [0.0; 3];
            for i in 0..side * side {
                let color = picture.pixel(left + i % side, top + i / side).to_array();
                sum.iter_mut().zip(color).for_each(|(sum, v)| *sum += f64::from(v) / f64::from(side * side));
            }
            means.push(sum);
        }
    }
    means
}

/// In the Cornell box all surfaces are matte, so both integrators find the same light.
#[test]
fn paths_find_the_light_of_radiosity() {
    let mut scene = project_scene("cornell-box.kdl");
    (scene.views[0].intrinsics.width, scene.views[0].intrinsics.height) = (64, 64);
    scene.film.sampling = Sampling::Sampled(256);
    let world = World::build(scene.clone()).unwrap();
    let picture = |integrator: canaletto::scene::Integrator, seed: u64| {
        let camera = Camera::of(&scene.views[0]).unwrap();
        let job = Job { seed, ..Job::new(camera, scene.film, integrator) };
        render(&world, &job, &()).unwrap().picture
    };
    let radiosity = blocks(&picture(RadiositySettings { error: 0.003, ..RadiositySettings::DEFAULT }.into(), 0), 16);
    let [one, two] = [1, 2].map(|seed| blocks(&picture(PATH.into(), seed), 16));
    let (mut worst, mut sum) = (0.0f64, [0.0; 2]);
    for ((radiosity, one), two) in radiosity.iter().zip(&one).zip(&two) {
        for c in 0..3 {
            let path = 0.5 * (one[c] + two[c]);
            sum[0] += path;
            sum[1] += radiosity[c];
            // Two pictures tell the noise of their mean.
            let noise = (one[c] - two[c]).abs();
            worst = worst.max(((path - radiosity[c]).abs() - 2.0 * noise) / radiosity[c].max(0.02));
        }
    }
    let mean = sum[0] / sum[1] - 1.0;
    println!("mean {mean:+.5}, worst block {worst:.4}");
    assert!(mean.abs() < 0.004 && worst < 0.03, "mean {mean:+.5}, worst block {worst:.4}");
}

#[test]
fn threads_and_tiles_change_no_bit_of_paths() {
    let mut pictures = Vec::new();
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let world = World::build(distributed_still_life(1.0)).unwrap();
            for tile in [5, 64] {
                let mut job = distributed_job(1.0, 60, 45, 4, SamplerKind::Sobol);
                (job.integrator, job.tile) = (PATH.into(), tile);
                let rendering = render(&world, &job, &()).unwrap();
                assert!(rendering.complete);
                pictures.push((format!("{threads} threads, tile {tile}"), rendering));
            }
        });
    }
    for (name, rendering) in &pictures {
        assert_same_picture(&rendering.picture, &pictures[0].1.picture, name);
        assert_eq!(rendering.counts, pictures[0].1.counts, "{name}");
    }
}

#[test]
fn the_unit_of_length_changes_no_bit_of_paths() {
    let picture = |scale: f32| {
        let world = World::build(still_life(scale)).unwrap();
        let mut job = still_life_job(scale, 60, 45, Sampling::Sampled(4));
        job.integrator = PATH.into();
        render(&world, &job, &()).unwrap().picture
    };
    for scale in [1.0 / 1024.0, 64.0] {
        assert_same_picture(&picture(scale), &picture(1.0), &format!("scale {scale}"));
    }
}

fn picture_of(text: &str) -> Picture {
    let scene = read_scene("s.kdl", &MemoryAssets::new().with("s.kdl", text)).unwrap().0;
    let world = World::build(scene.clone()).unwrap();
    let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
    render(&world, &job, &()).unwrap().picture
}

/// The mean of a picture of this scene text.
fn mean_of(text: &str, integrator: &str) -> f64 {
    let picture = picture_of(&text.replace("INTEGRATOR", integrator));
    let sum: f64 = picture.pixels.iter().flat_map(|color| color.to_array()).map(f64::from).sum();
    sum / (3.0 * picture.pixels.len() as f64)
}

/// Of lights that are infinitely far one is chosen, and the mean is that of all of them: l kd cos θ each.
#[test]
fn far_lights_are_chosen_by_their_probabilities() {
    let text = r#"
        camera { eye 0 4 1; center 0 0 0; fovy 30; size 16 16 }
        film { samples 1024 }
        integrator "INTEGRATOR"
        background 0
        ambient 0
        material "floor" { kd 0.5 }
        plane material="floor" { point 0 0 0; normal 0 1 0 }
        light "directional" { direction 0.3 -1 0; intensity 0.5 }
        light "directional" { direction -1 -0.5 0.2; intensity 0.4 }
        light "directional" { direction 0 -0.2 1; intensity 0.9 }
    "#;
    let [path, classic] = ["path", "whitted"].map(|integrator| mean_of(text, integrator));
    assert!((path / classic - 1.0).abs() < 0.003, "{path}, not {classic}");
}

/// A lamp whose texture is half black gives half of the light.
#[test]
fn a_textured_lamp_lights_by_its_texture() {
    let text = |texture: &str| {
        format!(
            "camera {{ eye 0 1 4; center 0 0 3; fovy 40; size 16 16 }}\nfilm {{ samples 512 }}\n\
             integrator \"INTEGRATOR\"\nbackground 0\nmaterial \"floor\" {{ kd 0.5 }}\n\
             plane material=\"floor\" {{ point 0 0 0; normal 0 1 0 }}\n\
             texture \"checks\" kind=\"checker\" {{ even 1; odd 0 }}\n\
             material \"lamp\" {{ kd 0; emission 1{texture} }}\n\
             box material=\"lamp\" {{ min -0.5 2 2.5; max 0.5 2.1 3.5 }}\n"
        )
    };
    let textured = "; texture \"checks\" use=\"emission\" mapping=\"solid\" space=\"object\" { scale 0.05 }";
    let share = mean_of(&text(textured), "path") / mean_of(&text(""), "path");
    assert!((share - 0.5).abs() < 0.02, "{share}");
}

/// A checkered floor under an even sky is the same floor of 64 squares, pixel by pixel up to the horizon: with many
/// samples no footprint blurs it. The samples of both pictures are the same ones.
#[test]
fn many_samples_leave_no_blur_of_textures() {
    let view = |samples: u32| {
        format!(
            "camera {{ eye 3 2.2 6; center 0 0.6 0; fovy 40; size 36 24 }}\n\
             film {{ samples {samples}; filter \"box\"; transfer \"none\" }}\n\
             integrator \"path\" {{ guiding \"off\" }}\nbackground 1\n"
        )
    };
    let textured = "texture \"checks\" kind=\"checker\" { even 0.1; odd 0.8 }
        material \"floor\" { texture \"checks\" mapping=\"solid\" space=\"world\" { scale 1.25; translate -5 -0.5 -5 } }
        box material=\"floor\" { min -5 -1 -5; max 5 0 5 }\n";
    let mut squares = String::from("material \"even\" { kd 0.1 }\nmaterial \"odd\" { kd 0.8 }\n");
    for (i, j) in (0..64).map(|i| (i % 8, i / 8)) {
        let material = if (i + j) % 2 == 0 { "even" } else { "odd" };
        let [x, z] = [i, j].map(|i| 1.25 * f64::from(i) - 5.0);
        squares += &format!("box material=\"{material}\" {{ min {x} -1 {z}; max {} 0 {} }}\n", x + 1.25, z + 1.25);
    }
    let differences = |samples: u32| -> f32 {
        let [one, other] = [textured, &squares].map(|floor| picture_of(&(view(samples) + floor)));
        let floor = one.pixels.iter().zip(&other.pixels);
        floor.map(|(a, b)| (a.r - b.r).abs()).fold(0.0, f32::max)
    };
    let (few, many) = (differences(16), differences(256));
    // The first 16 samples do blur.
    assert!(few > 0.004, "{few}");
    assert!(many < 0.07 * few, "{few}, {many}");
}
