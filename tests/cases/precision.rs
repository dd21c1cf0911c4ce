//! Coordinates and sizes that `f32` represents badly: huge triangles, far places, far tori.

use canaletto::camera::Camera;
use canaletto::film::Picture;
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Scene, View};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::import;
use canaletto_io::text::read_scene_text;

fn scene(text: &str, files: &[(&str, Vec<u8>)]) -> Scene {
    let assets = files.iter().fold(MemoryAssets::new(), |assets, (name, bytes)| assets.with(name, bytes.clone()));
    read_scene_text(text, "scene.kdl", &assets, &[]).unwrap_or_else(|e| panic!("{text}\n{e}")).0
}

fn job(scene: &Scene, view: &View) -> Job {
    Job::new(Camera::of(view).expect("a camera"), scene.film, scene.integrator)
}

fn picture_of(scene: Scene) -> Picture {
    let job = job(&scene, &scene.views[0]);
    render(&World::build(scene).expect("a world"), &job, &()).expect("a picture").picture
}

fn picture(text: &str) -> Picture {
    picture_of(scene(text, &[]))
}

/// The share of pixels that differ by more than two of 256 steps, and the mean of all differences.
fn difference(a: &Picture, b: &Picture) -> (f64, f64) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let (mut many, mut sum) = (0u32, 0.0);
    for (a, b) in a.pixels.iter().zip(&b.pixels) {
        let most = (0..3).map(|c| (a.to_array()[c] - b.to_array()[c]).abs()).fold(0.0, f32::max);
        many += u32::from(most > 2.0 / 256.0);
        sum += f64::from(most);
    }
    let count = a.pixels.len() as f64;
    (f64::from(many) / count, sum / count)
}

#[track_caller]
fn same(what: &str, found: &Picture, expected: &Picture) {
    let (many, mean) = difference(found, expected);
    assert!(many < 0.005 && mean < 0.001, "{what}: {:.2}% of the pixels differ, the mean by {mean}", many * 100.0);
}

mod far;
mod huge;
mod ids;
mod relief;
mod shadows;
