//! Tests of the door of integrators, by one that needs no rays.

use super::*;
use crate::camera::Camera;
use crate::integrator::{Cancelled, TileWorker};
use crate::math::Rgb;
use crate::scene::{Extrinsics, FilmSettings, Intrinsics, Scene};
use std::sync::atomic::AtomicU64;

/// An integrator of several passes. Pass k of pixel (x, y) adds the colour (x, y, k) with the weight k + 1.
struct Passes(u32);

struct PassWorker<'a> {
    cancelled: Cancelled<'a>,
    pixels: u64,
}

impl TileIntegrator for Passes {
    fn passes(&self) -> u32 {
        self.0
    }

    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn TileWorker + 'a> {
        Box::new(PassWorker { cancelled, pixels: 0 })
    }
}

impl TileWorker for PassWorker<'_> {
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        let ([x0, y0, width, _], pass) = (buffer.area(), buffer.pass());
        for index in 0..buffer.len() {
            if (self.cancelled)(0) {
                return ControlFlow::Break(());
            }
            let (x, y) = (x0 + index as u32 % width, y0 + index as u32 / width);
            buffer.add(index, Rgb::from([x, y, pass].map(|v| v as f32)), f64::from(pass) + 1.0);
            buffer.add_to_layer(0, index, &[f64::from(pass) + 5.0]);
            buffer.add_to_layer(1, index, &[f64::from(pass)]);
            self.pixels += 1;
        }
        ControlFlow::Continue(())
    }

    fn take_counts(&mut self) -> Counts {
        Counts { others: vec![("pixels", std::mem::take(&mut self.pixels))], ..Counts::default() }
    }
}

fn job() -> Job {
    let intrinsics = Intrinsics { width: 21, height: 17, ..Intrinsics::default() };
    let camera = Camera::new(&intrinsics, &Extrinsics::default()).unwrap();
    let film = FilmSettings { crop: Some([3, 2, 15, 13]), ..FilmSettings::default() };
    Job { tile: 4, aovs: vec![Aov::Depth, Aov::Cost], ..Job::new(camera, film, Integrator::default()) }
}

#[test]
fn passes_accumulate_over_all_tiles() {
    let world = World::build(Scene::default()).unwrap();
    let rendering = on_all_threads(&world, &job(), &Passes(3), &());
    assert!(rendering.complete && rendering.pixels_done == 15 * 13);
    assert_eq!(rendering.counts.others, [("pixels", 3 * 15 * 13)]);
    for (index, color) in rendering.picture.pixels.iter().enumerate() {
        let (x, y) = (3 + index % 15, 2 + index / 15);
        // (0 · 1 + 1 · 2 + 2 · 3) / 6
        assert_eq!(color.to_array(), [x as f32, y as f32, (8.0f64 / 6.0) as f32], "{x} {y}");
    }
    assert!(rendering.picture.layer("depth").unwrap().data.iter().all(|v| *v == 5.0));
    assert!(rendering.picture.layer("cost").unwrap().data.iter().all(|v| *v == 3.0));
}

/// An observer that cancels when this many pixels of all passes are finished.
struct After(u64, AtomicU64);

impl Observer for After {
    fn cancelled(&self) -> bool {
        self.1.load(Ordering::Relaxed) >= self.0
    }

    fn progress(&self, progress: &Progress) {
        assert_eq!(progress.pixels, 3 * 15 * 13);
        self.1.fetch_max(progress.pixels_done, Ordering::Relaxed);
    }
}

#[test]
fn a_cancelled_pass_leaves_the_passes_before() {
    let world = World::build(Scene::default()).unwrap();
    let observer = After(15 * 13 + 40, AtomicU64::new(0));
    let rendering = on_all_threads(&world, &job(), &Passes(3), &observer);
    assert!(!rendering.complete && rendering.pixels_done == 15 * 13);
    let blue: Vec<f32> = rendering.picture.pixels.iter().map(|color| color.b).collect();
    // After the first pass it is 0, after the second 2 / 3.
    let second = blue.iter().filter(|b| **b == 2.0f32 / 3.0).count();
    assert!((40..15 * 13).contains(&second), "{second}");
    assert_eq!(blue.iter().filter(|b| **b == 0.0).count(), 15 * 13 - second);
}
