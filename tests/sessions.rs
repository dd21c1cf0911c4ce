//! Sessions: pictures of all integrators grow by samples that add up, tile by tile, and what is prepared also explains.

use canaletto::explain::Explainer;
use canaletto::film::SampleBlocks;
use canaletto::integrator::radiosity::RadiositySolution;
use canaletto::math::Rgb;
use canaletto::render::{
    Aov, FinishedTile, Job, JobError, Observer, Preparation, Progress, Rendering, Session, render, render_on,
};
use canaletto::scene::{
    Filter, Guiding, Integrator, PathSettings, RadiositySettings, SamplerKind, Sampling, Scene, Shading,
    WhittedSettings, ZbufferSettings,
};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::assert_same_picture;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

/// A room with a lamp of some size, a mirror, a clear ball and a half-covered pane, seen through an open front.
const ROOM: &str = r#"
    camera { eye 0.4 1.1 4.2; center 0 0.8 0; fovy 50; size 26 20; lens { radius 0.02; focus-point 0 0.8 0 } }
    film { samples 8 }
    background 0.2 0.3 0.5
    material "wall" { kd 0.7 0.6 0.5 }
    material "mirror" { kd 0.05 0.05 0.05; k 0.8 0.8 0.8; ks 0.3 0.3 0.3; n 80 }
    material "glass" { kd 0 0 0; eta 1.4; opacity 0.2; ks 1 1 1; n 60 }
    material "pane" { kd 0.2 0.5 0.2; coverage 0.5 }
    material "lamp" { kd 0 0 0; emission 6 6 5 }
    box material="wall" { min -1 0 -1; max 1 0.05 1 }
    box material="wall" { min -1 0 -1.1; max 1 1.8 -1 }
    box material="mirror" { min -0.9 0.05 -0.6; max -0.3 0.7 -0.2 }
    sphere material="glass" { center 0.5 0.4 0.2; radius 0.35 }
    box material="pane" { min -0.2 0.1 0.5; max 0.2 0.6 0.52 }
    box material="lamp" { min -0.3 1.7 -0.3; max 0.3 1.75 0.3 }
    light "sphere" { center 1.2 1.9 1.4; radius 0.2; intensity 0.7 0.7 0.7; samples 2 }
"#;

fn scene() -> Scene {
    read_scene("room.kdl", &MemoryAssets::new().with("room.kdl", ROOM)).unwrap().0
}

fn integrators() -> Vec<(&'static str, Integrator)> {
    let zbuffer = |shading| ZbufferSettings { shading, shadow_map_size: 64, ..ZbufferSettings::DEFAULT }.into();
    vec![
        ("whitted", WhittedSettings::DEFAULT.into()),
        ("zbuffer", zbuffer(Shading::Phong)),
        ("zbuffer gouraud", zbuffer(Shading::Gouraud)),
        ("radiosity", RadiositySettings { error: 0.2, ..RadiositySettings::DEFAULT }.into()),
        ("path", PathSettings::DEFAULT.into()),
        ("guided", PathSettings { guiding: Guiding::On, ..PathSettings::DEFAULT }.into()),
    ]
}

fn job(scene: &Scene, integrator: Integrator, samples: u32) -> Job {
    let camera = canaletto::camera::Camera::of(&scene.views[0]).unwrap();
    let film = canaletto::scene::FilmSettings { sampling: Sampling::Sampled(samples), alpha: true, ..scene.film };
    Job { progressive: true, tile: 8, ..Job::new(camera, film, integrator) }
}

/// The solution of a job with radiosity, so that each test solves it once.
fn solution(world: &World, integrator: &Integrator) -> Option<Arc<RadiositySolution>> {
    let settings = canaletto::integrator::describe(integrator).radiosity()?;
    Some(Arc::new(RadiositySolution::solve(world, settings, &()).unwrap()))
}

/// The picture of some samples of each pixel.
fn picture(world: &World, job: &Job, solution: Option<&Arc<RadiositySolution>>) -> (Vec<Rgb>, SampleBlocks) {
    let preparation = Preparation { solution, ..Preparation::default() };
    let mut session = Session::open(world, job, preparation).unwrap();
    let end = job.first_sample + job.film.sampling.count();
    assert!(session.pass(end, session.tiles(), &()).unwrap().is_continue());
    (session.picture().pixels.clone(), session.samples().unwrap())
}

#[test]
fn samples_of_all_integrators_add_up() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators() {
        let solution = solution(&world, &integrator);
        let job = |samples| job(&scene, integrator, samples);
        let (whole, all) = picture(&world, &job(16), solution.as_ref());
        let (_, first) = picture(&world, &job(8), solution.as_ref());
        let (second, next) = picture(&world, &Job { first_sample: 8, ..job(8) }, solution.as_ref());
        assert_ne!(whole, second, "{name}");
        let preparation = || Preparation { solution: solution.as_ref(), ..Preparation::default() };
        let mut session = Session::open(&world, &job(16), preparation()).unwrap();
        // The second half first: its numbers don't begin with 0.
        assert!(matches!(session.merge(&next), Err(JobError::Start(_))), "{name}");
        session.merge(&first).unwrap();
        session.merge(&next).unwrap();
        assert_eq!(session.picture().pixels, whole, "{name}");
        assert!(session.samples().unwrap() == all, "{name}");
        assert!(matches!(session.merge(&next), Err(JobError::Start(_))), "{name}: the same samples twice");
        // Or gone on with, by tiles in another order.
        let mut session = Session::open(&world, &job(16), preparation()).unwrap();
        session.merge(&first).unwrap();
        let tiles = session.tiles();
        for tile in tiles.clone().rev() {
            assert!(session.pass(11, tile..tile + 1, &()).unwrap().is_continue());
        }
        assert!(session.pass(16, tiles, &()).unwrap().is_continue());
        assert_eq!(session.picture().pixels, whole, "{name}");
    }
}

#[test]
fn pictures_that_go_on_have_the_bytes_of_one_render() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators() {
        let mut job = job(&scene, integrator, 32);
        job.aovs = vec![Aov::HalfA, Aov::HalfB, Aov::Samples, Aov::Normal, Aov::ObjectId];
        let start =
            Job { film: canaletto::scene::FilmSettings { sampling: Sampling::Sampled(16), ..job.film }, ..job.clone() };
        let start = render(&world, &start, &()).unwrap();
        let on = render_on(&world, &job, start.samples.as_ref().unwrap(), &()).unwrap();
        let whole = render(&world, &Job { tile: 5, ..job.clone() }, &()).unwrap();
        assert_same_picture(&on.picture, &whole.picture, name);
        assert_eq!(on.picture.alpha, whole.picture.alpha, "{name}");
        assert!(on.samples == whole.samples, "{name}");
        let alpha = &whole.picture.alpha;
        assert!(alpha.contains(&0.0) && alpha.contains(&1.0), "{name}: {alpha:?}");
        assert!(alpha.iter().any(|a| *a > 0.0 && *a < 1.0), "{name}");
    }
}

/// The mean of a growing picture is the one of a picture of as many rays at places that are chosen together. A z-buffer
/// then has a grid, whose edges are steps of a sixteenth of a pixel.
#[test]
fn growing_pictures_show_the_same_light() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators().into_iter().take(3) {
        let growing = render(&world, &job(&scene, integrator, 256), &()).unwrap().picture;
        let usual = render(&world, &Job { progressive: false, ..job(&scene, integrator, 256) }, &()).unwrap().picture;
        for (index, (a, b)) in growing.pixels.iter().zip(&usual.pixels).enumerate() {
            let difference = (*a - *b).to_array().map(f32::abs);
            assert!(difference.iter().all(|d| *d < 0.12), "{name} {index}: {a:?} {b:?}");
        }
        let sum = |pixels: &[Rgb]| pixels.iter().map(|p| f64::from(p.r + p.g + p.b)).sum::<f64>();
        let ratio = sum(&growing.pixels) / sum(&usual.pixels);
        assert!((ratio - 1.0).abs() < if name == "whitted" { 3e-3 } else { 1e-2 }, "{name}: {ratio}");
    }
}

/// An open session explains the picture that it makes, with what it prepared.
#[test]
fn explanations_of_a_session_are_of_its_picture() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators() {
        for progressive in [true, false] {
            let job = Job { progressive, ..job(&scene, integrator, 6) };
            let mut session = Session::open(&world, &job, Preparation::default()).unwrap();
            assert!(session.pass(6, session.tiles(), &()).unwrap().is_continue());
            let pixels = session.picture().pixels.clone();
            let explainer = Explainer::new(&session);
            for pixel in (0..26 * 20).step_by(7) {
                let [x, y] = [pixel % 26, pixel / 26];
                let (color, sum) = if job.description().traces_paths() {
                    let tree = explainer.paths(x, y).unwrap();
                    (tree.color, tree.sum())
                } else {
                    let tree = explainer.pixel(x, y).unwrap();
                    (tree.color, tree.sum())
                };
                let of_picture = pixels[pixel as usize];
                assert_eq!([color, sum], [of_picture; 2], "{name}, progressive {progressive}, pixel {x} {y}");
            }
        }
    }
}

/// Collects finished tiles.
#[derive(Default)]
struct Tiles(Mutex<BTreeMap<[u32; 2], Rgb>>);

impl Observer for Tiles {
    fn tile_finished(&self, tile: &FinishedTile<'_>) {
        let [x, y, width, _] = tile.area;
        let mut pixels = self.0.lock().unwrap();
        for (row, colors) in (y..).zip(tile.rows()) {
            assert_eq!(colors.len() as u32, width);
            pixels.extend((x..).zip(colors).map(|(column, color)| ([column, row], *color)));
        }
    }
}

#[test]
fn observers_get_all_finished_tiles() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for progressive in [true, false] {
        let mut job = Job { progressive, ..job(&scene, WhittedSettings::DEFAULT.into(), 4) };
        job.film.crop = Some([3, 2, 19, 15]);
        let tiles = Tiles::default();
        let Rendering { picture, .. } = render(&world, &job, &tiles).unwrap();
        let seen = tiles.0.into_inner().unwrap();
        assert_eq!(seen.len(), 19 * 15);
        assert!(seen.iter().all(|([x, y], color)| *color == picture.pixel(x - 3, y - 2)));
    }
}

/// Keeps the largest number of finished pixels, and the number of all.
#[derive(Default)]
struct Finished(Mutex<[u64; 2]>);

impl Observer for Finished {
    fn progress(&self, progress: &Progress) {
        let mut most = self.0.lock().unwrap();
        *most = [most[0].max(progress.pixels_done), progress.pixels];
    }
}

#[test]
fn passes_of_a_session_progress_to_all_pixels() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for progressive in [true, false] {
        let job = Job { progressive, ..job(&scene, WhittedSettings::DEFAULT.into(), 4) };
        let mut session = Session::open(&world, &job, Preparation::default()).unwrap();
        let finished = Finished::default();
        if progressive {
            assert!(session.pass(2, session.tiles(), &finished).unwrap().is_continue());
            assert_eq!(*finished.0.lock().unwrap(), [26 * 20 / 2, 26 * 20]);
        }
        assert!(session.pass(4, session.tiles(), &finished).unwrap().is_continue());
        assert_eq!(*finished.0.lock().unwrap(), [26 * 20; 2]);
    }
}

/// Cancels at once.
struct Cancelled;

impl Observer for Cancelled {
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn cancelled_sessions_keep_what_they_have() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators() {
        let job = job(&scene, integrator, 8);
        let mut session = Session::open(&world, &job, Preparation::default()).unwrap();
        assert!(session.pass(2, session.tiles(), &()).unwrap().is_continue());
        let before = session.picture().clone();
        assert_eq!(session.pass(8, session.tiles(), &Cancelled), Ok(ControlFlow::Break(())), "{name}");
        assert_same_picture(session.picture(), &before, name);
        assert!(session.samples().unwrap().counts().iter().all(|count| *count == 2), "{name}");
        if name == "radiosity" || name == "guided" {
            let opened = Session::new(&world, &job, Preparation::default(), &Cancelled).unwrap();
            assert!(opened.is_break(), "{name} learns and solves first");
        }
    }
}

#[test]
fn what_cannot_grow_says_what_to_set() {
    let scene = scene();
    let world = World::build(scene.clone()).unwrap();
    for (name, integrator) in integrators() {
        let refused = |change: &dyn Fn(&mut Job)| {
            let mut job = job(&scene, integrator, 16);
            change(&mut job);
            render(&world, &job, &()).unwrap_err().to_string()
        };
        let told = [
            (refused(&|job| job.film.sampling = Sampling::Regular(4)), "--samples without --pattern"),
            (refused(&|job| job.film.sampling = Sampling::Corner), "--samples sends others"),
            (refused(&|job| job.film.sampler = SamplerKind::Jittered), "the jittered sampler"),
            (refused(&|job| job.film.filter = Filter::Mitchell), "the mitchell filter"),
            (refused(&|job| job.aovs = vec![Aov::Diffuse]), "\"diffuse\""),
        ];
        for (message, what) in told {
            assert!(message.contains(what), "{name}: {message}");
        }
    }
}

/// Prints what an explanation in an open session takes beside its preparation. Run it by hand, with `--nocapture`.
#[test]
#[ignore = "prints times"]
fn explanations_take_no_preparation() {
    for (scene, integrator) in [
        ("cornell-box.kdl", PathSettings { guiding: Guiding::On, ..PathSettings::DEFAULT }.into()),
        ("gallery-room.kdl", RadiositySettings::DEFAULT.into()),
    ] {
        let integrator: Integrator = integrator;
        let folder = canaletto_tests::root().join("scenes").join(scene);
        let (assets, name) = canaletto_io::assets::FolderAssets::beside(&folder).unwrap();
        let described = read_scene(&name, &assets).unwrap().0;
        let job = Job { progressive: false, ..job(&described, integrator, 16) };
        let world = World::build(described).unwrap();
        let begun = std::time::Instant::now();
        let session = Session::open(&world, &job, Preparation { keeps_links: true, ..Preparation::default() }).unwrap();
        let prepared = begun.elapsed();
        let explainer = Explainer::new(&session);
        let begun = std::time::Instant::now();
        let [x, y] = job.camera.size().map(|side| side / 2);
        match job.description().traces_paths() {
            true => drop(explainer.paths(x, y).unwrap()),
            false => drop(explainer.pixel(x, y).unwrap()),
        }
        println!("{scene}: prepared in {prepared:?}, a pixel explained in {:?}", begun.elapsed());
    }
}
