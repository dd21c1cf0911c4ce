//! Limits for any values in a scene: no stack or memory overflow, no uncancellable render, no pixel that isn't a
//! number.

use canaletto::camera::Camera;
use canaletto::explain::{ExplainError, explain};
use canaletto::integrator::layers_of;
use canaletto::render::{Job, JobError, Observer, Progress, render};
use canaletto::scene::{Integrator, Scene, WhittedSettings};
use canaletto::world::{BuildError, World};
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene_text;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const BALL: &str = "sphere { center 0 0 0; radius 1 }\n";

fn scene(text: &str) -> Scene {
    let camera = "camera { eye 0 0 5; center 0 0 0; fovy 40; size 12 8 }\nlight \"omni\" { position 0 5 5 }\n";
    read_scene_text(&format!("{camera}{text}"), "s", &MemoryAssets::new(), &[]).unwrap_or_else(|e| panic!("{e}")).0
}

fn world(text: &str) -> Result<World, BuildError> {
    World::build(scene(text))
}

fn job(text: &str) -> (World, Job) {
    let scene = scene(text);
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).expect("a camera");
    let job = Job::new(camera, scene.film, scene.integrator);
    (World::build(scene).expect("a world"), job)
}

/// Nested prototypes. Each contains the previous one twice.
fn doubled(what: &str, times: u32) -> String {
    let mut text = format!("prototype name=\"p0\" {{ {what} }}\n");
    for i in 1..=times {
        let last = i - 1;
        text += &format!(
            "prototype name=\"p{i}\" {{ instance of=\"p{last}\"; instance of=\"p{last}\" {{ translate {i} 0 0 }} }}\n"
        );
    }
    text + &format!("instance of=\"p{times}\"\n{BALL}")
}

#[test]
fn instances_of_instances_do_not_fill_memory() {
    assert_eq!(world(&doubled(BALL, 40)).unwrap_err(), BuildError::TooManyCopies("\"p32\"".into()));
    assert_eq!(world(&doubled("plane { point 0 0 0; normal 0 1 0 }", 40)).unwrap_err(), BuildError::TooManyPlanes);
    assert_eq!(world(&doubled("light \"omni\" { position 0 1 0 }", 40)).unwrap_err(), BuildError::TooManyLights);
    let disk = "light \"disk\" { position 0 1 0; normal 0 1 0; radius 1; points 4096 }";
    assert_eq!(world(&doubled(disk, 9)).unwrap_err(), BuildError::TooManyLights);
    assert!(world(&doubled(BALL, 10)).is_ok());
}

#[test]
fn nesting_counts_through_prototypes() {
    let mut text = format!("prototype name=\"p0\" {{ {BALL} }}\n");
    for i in 1..250 {
        let (open, close) = ("group { ".repeat(120), " }".repeat(120));
        text += &format!("prototype name=\"p{i}\" {{ {open} instance of=\"p{}\" {close} }}\n", i - 1);
    }
    assert_eq!(world(&(text + "instance of=\"p249\"\n")).unwrap_err(), BuildError::TooDeep);
}

#[test]
fn transforms_beyond_numbers_are_told() {
    let far = |text: &str| world(text).unwrap_err().to_string();
    let message = far("sphere name=\"moon\" { center 0 0 0; radius 1; scale 1e30; scale 1e30 }");
    assert_eq!(message, "moon: after its transforms it reaches beyond ±3.4028235e38, the largest coordinate possible");
    assert!(far("plane { point 0 1 0; normal 0 1 0; scale 1e30; scale 1e30 }").starts_with("plane #1: after its"));
    let plane =
        "prototype name=\"p\" { plane { point 0 1 0; normal 0 1 0; scale 1e30 } }\ninstance of=\"p\" { scale 1e30 }";
    assert!(far(plane).starts_with("group \"p\", plane #1: after its"), "{}", far(plane));
    let light = "group { scale 1e30; group { scale 1e30; light \"omni\" name=\"sun\" { position 0 1 0 } } }";
    assert!(far(light).starts_with("light \"sun\": after its transforms, position"), "{}", far(light));
    let deep = format!("{} {BALL} {}", "group { scale 1e30; ".repeat(11), "}".repeat(11));
    assert!(far(&deep).contains("beyond all numbers"), "{}", far(&deep));
}

const MIRRORS: &str = "material \"m\" { k 1 1 1; kd 0 0 0 }\n\
    box material=\"m\" { min -1e6 -1e6 6; max 1e6 1e6 7 }\nbox material=\"m\" { min -1e6 -1e6 -7; max 1e6 1e6 -6 }\n";

fn with_depth(job: &Job, max_depth: u32) -> Integrator {
    WhittedSettings { max_depth, ..*job.description().whitted().unwrap() }.into()
}

/// The deepest tree runs on a thread with the system's default stack. A debug build has the largest frames.
#[test]
fn facing_mirrors_do_not_overflow_the_stack() {
    let (world, mut job) = job(MIRRORS);
    job.integrator = with_depth(&job, WhittedSettings::MAX_DEPTH);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(2 << 20).build().expect("a thread");
    let rendering = pool.install(|| render(&world, &job, &())).expect("a picture");
    assert!(rendering.complete && rendering.counts.rays.reflected.traced > 12 * 8 * 200);
    let tree = pool.install(|| explain(&world, &job, 6, 4)).expect("a tree");
    assert_eq!(pool.install(|| tree.sum()), tree.color);
    pool.install(move || drop(tree));
    for depth in [0, WhittedSettings::MAX_DEPTH + 1, u32::MAX] {
        job.integrator = with_depth(&job, depth);
        assert_eq!(render(&world, &job, &()).unwrap_err(), JobError::Depth(depth));
    }
}

/// Five balls that reflect and refract, at depth 256: the rays of a single pixel would take practically forever.
const ENDLESS: &str = "material \"m\" { k 1 1 1; kd 0 0 0; opacity 0; eta 1.5 }\n\
    spheres material=\"m\" radius=1 { points 0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 }\nintegrator { max-depth 256 }";

/// Cancels at the fourth query, which is among the first pixels' rays.
struct AtTheFourth(AtomicUsize);

impl Observer for AtTheFourth {
    fn cancelled(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) >= 3
    }
}

#[test]
fn an_endless_pixel_can_be_cancelled() {
    let (world, job) = job(ENDLESS);
    let start = Instant::now();
    let observer = AtTheFourth(AtomicUsize::new(0));
    let rendering = render(&world, &job, &observer).expect("a picture");
    assert!(!rendering.complete && start.elapsed() < Duration::from_secs(20));
    assert!(observer.0.into_inner() >= 4);
    assert_eq!(explain(&world, &job, 6, 4).unwrap_err(), ExplainError::TooManyRays);
}

/// Objects near the largest `f32`, more than fit into a leaf.
#[test]
fn things_as_large_as_numbers_have_hierarchies() {
    let data = |kind: &str, lines: &str| format!("{kind} {{ data \"\"\"\n{lines}\n\"\"\"\n}}\n");
    let many = |text: fn(usize) -> String| (0..9).map(text).collect::<String>();
    let scenes = [
        data("spheres", &format!("{}0 0 0 1.8e38", "0 0 0 1\n".repeat(4))),
        data("spheres", &"0 0 0 3.4e38\n".repeat(9)),
        data("cylinders", &format!("{}0 0 0 0 1 0 1.8e38", "0 0 0 0 1 0 1\n".repeat(4))),
        many(|i| format!("cylinder {{ base 0 {i} 0; top 0 9 0; radius 1.8e38 }}\n")),
        many(|i| format!("torus {{ center 0 0 0; axis 0 1 {i}; radius 1.6e38; tube 5e37 }}\n")),
        many(|i| format!("triangle {{ a -2e38 -2e38 {i}; b 2e38 -2e38 {i}; c 0 2e38 {i} }}\n")),
        many(|i| format!("box {{ min -3.4e38 -3.4e38 -{i}; max 3.4e38 3.4e38 0 }}\n")),
        many(|i| format!("disk {{ center 0 0 {i}; normal 0 0 1; radius 3.3e38 }}\n")),
    ];
    for text in scenes {
        let (world, job) = job(&text);
        let picture = render(&world, &job, &()).expect("a picture").picture;
        assert!(picture.pixels.iter().all(|p| p.r.is_finite() && p.g.is_finite() && p.b.is_finite()), "{text}");
    }
}

/// Panics after the first tile, and counts the tiles that still finish.
struct Panics(AtomicUsize);

impl Observer for Panics {
    fn progress(&self, _: &Progress) {
        if self.0.fetch_add(1, Ordering::Relaxed) == 0 {
            // The panic hook is skipped, since its backtrace may take longer than all tiles.
            resume_unwind(Box::new("the first tile"));
        }
    }
}

#[test]
fn a_panic_of_the_observer_stops_all_threads() {
    let (world, mut job) = job(&format!("{BALL}film {{ samples 4096 }}"));
    job.tile = 1;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("threads");
    let observer = Panics(AtomicUsize::new(0));
    let panicked = catch_unwind(AssertUnwindSafe(|| pool.install(|| render(&world, &job, &observer))));
    let said = panicked.expect_err("the panic comes through");
    assert_eq!(said.downcast_ref::<&str>(), Some(&"the first tile"));
    assert!(observer.0.into_inner() < 12 * 8 / 2, "of 96 tiles");
}

/// The smallest stack size for a thread that occurs in practice, in bytes.
const SMALL_STACK: usize = 64 << 10;

/// A world of the maximum depth, and rays of the maximum depth.
#[test]
fn small_stacks_do_not_overflow() {
    let mut text = format!("{MIRRORS}prototype name=\"p0\" {{ {} }}\n", BALL.repeat(3));
    for i in 1..28 {
        let (last, beside) = (i - 1, 3 << i);
        text += &format!(
            "prototype name=\"p{i}\" {{ {BALL} instance of=\"p{last}\"; instance of=\"p{last}\" {{ translate {beside} 0 0 }} }}\n"
        );
    }
    let (open, close) = ("group { ".repeat(120), " }".repeat(120));
    let cloud = "1 2 3 ".repeat(3000);
    let text = format!("{text}{open} instance of=\"p27\" {close}\nspheres radius=0.5 {{ points {cloud} }}");
    let scene = scene(&text);
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).expect("a camera");
    let mut job = Job::new(camera, scene.film, scene.integrator);
    job.integrator = with_depth(&job, WhittedSettings::MAX_DEPTH);
    let work = || {
        let world = World::build(scene.clone()).expect("a world");
        let picture = render(&world, &job, &()).expect("a picture");
        assert!(picture.complete);
        (picture.picture, explain(&world, &job, 6, 4).map(|tree| tree.color))
    };
    let expected = work();
    let thread = std::thread::Builder::new().stack_size(SMALL_STACK);
    let outside =
        std::thread::scope(|scope| thread.spawn_scoped(scope, work).expect("a thread").join().expect("no panic"));
    assert!(outside == expected);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).stack_size(SMALL_STACK).build().expect("threads");
    assert!(pool.install(work) == expected);
}

#[test]
fn no_pixel_is_ever_infinite_or_nan() {
    let glass = |numbers: &str| {
        format!(
            "material \"m\" {{ {numbers} }}\nsphere material=\"m\" {{ center 0 0 0; radius 1 }}\n\
             sphere material=\"m\" {{ center 0 0 0; radius 0.5 }}\nbox material=\"m\" {{ min -3 -2 -3; max 3 -1 3 }}\n\
             sphere material=\"m\" {{ center 0 0 5; radius 0.5 }}\n\
             light \"omni\" {{ position 1 9 9; intensity 3e38 }}\nbackground 3e38\nambient 3e38"
        )
    };
    let lit = |light: &str| format!("{BALL}light {light}");
    let scenes = [
        glass("eta 1e-30; opacity 0.1"),
        glass("eta 1e30; opacity 0"),
        glass("eta 3e38; opacity 0; k 1"),
        glass("eta 1e-45; opacity 0"),
        glass("n 3e38; ks 3e38"),
        glass("n 0; ks 1"),
        glass("kd 3e38"),
        glass("k 3e38"),
        glass("k 3e38 0 0; opacity 0; kd 3e38 0 1; ks 3e38 0 1; n 100"),
        lit("\"omni\" { position 0 0 1; attenuation 0 0 1 }"),
        lit("\"omni\" { position 0 0 1; attenuation 0 0 1e-45; intensity 3e38 }"),
        lit("\"omni\" { position 0 0 5; attenuation 1e-38 0 0; intensity 3e38 }"),
        lit("\"omni\" { position 0 0 0 }"),
        lit("\"omni\" { position 1e-45 0 0 0 }"),
        lit("\"spot\" { position 0 0 1; target 0 0 0; outer 1e-30 }"),
        lit("\"spot\" { position 0 0 5; target 0 0 0; outer 90; exponent 1e38 }"),
        lit("\"disk\" { position 0 0 1; normal 0 0 1; radius 1e-45; points 3 }"),
        "sphere { center 0 0 0; radius 1e38 }\nplane { point 0 0 0; normal 1e38 1e38 1e38 }".into(),
        "sphere { center 0 0 0; radius 1e-38 }\nbox { min 0 0 0; max 0 0 0 }".into(),
        "triangle { a -1e38 0 0; b 1e38 0 0; c 0 1e38 0 }\ntriangle { a 0 0 0; b 0 0 0; c 0 0 0 }".into(),
        "torus { center 0 0 0; axis 0 1 0; radius 1e38; tube 1 }\ntorus { center 0 0 0; axis 0 0 1; radius 1; tube 5 }".into(),
        "cone { base 0 0 0; top 0 1 0; radius 1e-38; top-radius 1e38 }\ncylinder { base 0 -1e38 0; top 0 1e38 0; radius 1 }".into(),
        "sphere { center 0 0 0; radius 1; scale 1e-300 1 1 }\ndisk { center 0 0 0; normal 1e-38 0 1e-38; radius 1e38 }".into(),
    ];
    for text in &scenes {
        let (world, mut job) = job(text);
        job.aovs = layers_of(&job.integrator, false);
        let picture = render(&world, &job, &()).expect("a picture").picture;
        assert!(picture.pixels.iter().all(|c| c.is_finite()), "{text}");
        for layer in &picture.layers {
            let good = |v: &f32| v.is_finite() || layer.name.ends_with("depth") && *v == f32::INFINITY;
            assert!(layer.data.iter().all(good), "{}: {text}", layer.name);
        }
        let tree = explain(&world, &job, 6, 4).expect("a tree");
        assert_eq!((tree.sum(), tree.color), (picture.pixel(6, 4), picture.pixel(6, 4)), "{text}");
    }
}

/// A shadow ray crosses a thousand transparent shells, and a light is inside an opaque ball.
#[test]
fn shadows_end() {
    let mut text = String::from("material \"m\" { kd 0 0 0; opacity 0 }\n");
    for i in 0..1000 {
        text += &format!("sphere material=\"m\" {{ center 0 5 5; radius {} }}\n", 0.1 + f64::from(i) * 1e-3);
    }
    let (world, job) = job(&(text + "plane { point 0 -1 0; normal 0 1 0 }\n"));
    assert!(render(&world, &job, &()).expect("a picture").picture.pixels.iter().any(|c| c.r > 0.0));
}
