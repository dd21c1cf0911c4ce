//! Why methods differ: scenes with a single cause, and the parts of a still life against layers, which a probe of their
//! own makes.

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::causes::{Cause, Causes, MethodPicture, find_causes};
use canaletto::film::Picture;
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{
    Integrator, RadiositySettings, RadiosityShow, Sampling, Scene, Shading, ShadowMethod, Stage, WhittedSettings,
    ZbufferSettings,
};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::gallery::{still_life, still_life_job};
use canaletto_tests::textured::textured_still_life;
use glam::DVec3;

const TOLERANCE: f64 = 0.5;

fn picture(world: &World, job: &Job) -> Picture {
    let rendering = render(world, job, &()).unwrap();
    assert!(rendering.complete);
    rendering.picture
}

/// The causes of differences between a job and the same job with another integrator.
fn causes_of(world: &World, job: &Job, other: impl Into<Integrator>) -> Causes {
    let other = Job { integrator: other.into(), ..job.clone() };
    let pictures = [job, &other].map(|job| picture(world, job));
    let method = |job, picture| MethodPicture { job, picture, solution: None };
    let causes = find_causes(world, &method(job, &pictures[0]), &method(&other, &pictures[1]), TOLERANCE, &()).unwrap();
    assert!(causes.complete);
    let sum: u64 = Cause::ALL.iter().map(|cause| causes.count(*cause)).sum();
    assert_eq!(sum, causes.differing());
    causes
}

/// A scene text in front of a camera that looks along -z at the plane z = 0, of which it sees 2 x 1.5 lengths.
fn scene(text: &str) -> (World, Job) {
    let camera =
        "camera { eye 0 0 5; center 0 0 0; fovy 17.0615; near 1; far 100; size 80 60 }\nfilm { sample \"center\" }\n";
    let assets = MemoryAssets::new().with("s.kdl", format!("{camera}{text}"));
    let (scene, warnings) = read_scene("s.kdl", &assets).unwrap_or_else(|e| panic!("{e}"));
    assert!(warnings.is_empty(), "{warnings}");
    of(scene)
}

fn of(scene: Scene) -> (World, Job) {
    let camera = Camera::of(&scene.views[0]).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    (World::build(scene).unwrap(), job)
}

/// Asserts that only these causes occur, and the first of them in more than `least` pixels.
#[track_caller]
fn only(causes: &Causes, allowed: &[Cause], least: u64) {
    let found: Vec<(&str, u64)> = Cause::ALL.iter().map(|c| (c.name(), causes.count(*c))).filter(|c| c.1 > 0).collect();
    let all: u64 = allowed.iter().map(|cause| causes.count(*cause)).sum();
    assert_eq!(all, causes.differing(), "{found:?} {:?}", causes.worst);
    assert!(causes.count(allowed[0]) > least, "{found:?} of {}", causes.pixels.len());
}

const WHOLE: u64 = 80 * 60 - 1;

#[test]
fn a_mirror_that_fills_the_picture() {
    let (world, job) = scene(
        "background 0.2 0.3 0.5; ambient 0.3 0.3 0.3\nmaterial \"m\" { kd 0.4 0.3 0.2; k 0.5 }\n\
         plane name=\"wall\" material=\"m\" { point 0 0 0; normal 0 0 1 }\n\
         box name=\"behind\" material=\"m\" { min -1 -1 8; max 1 1 9 }",
    );
    let causes = causes_of(&world, &job, ZbufferSettings::default());
    only(&causes, &[Cause::Mirror], WHOLE);
    assert_eq!(causes.worst[0].object.as_deref(), Some("wall"));
    assert!((causes.worst[0].shares[0].1 - 1.0).abs() < 1e-3, "{:?}", causes.worst);
}

#[test]
fn glass_that_fills_the_picture() {
    let (world, job) = scene(
        "background 0.2 0.3 0.5; ambient 0.3 0.3 0.3\nmaterial \"g\" { kd 0.1 0.1 0.1; opacity 0.3; eta 1.3 }\n\
         material \"m\" { kd 0.9 0.2 0.1 }\n\
         plane name=\"wall\" material=\"m\" { point 0 0 -1; normal 0 0 1 }\n\
         box name=\"pane\" material=\"g\" { min -2 -2 -0.5; max 2 2 0 }",
    );
    let causes = causes_of(&world, &job, ZbufferSettings::default());
    only(&causes, &[Cause::Refraction], WHOLE);
    assert_eq!(causes.worst[0].object.as_deref(), Some("pane"));
}

#[test]
fn half_covered_surfaces_are_drawn_or_left_out() {
    for (coverage, shown) in [(0.7, "leaf"), (0.3, "wall")] {
        let (world, job) = scene(&format!(
            "ambient 0.9 0.9 0.9\nmaterial \"leaf\" {{ kd 0.1 0.6 0.1; coverage {coverage} }}\nmaterial \"m\" {{ kd 0.9 0.2 0.1 }}\n\
             plane name=\"wall\" material=\"m\" {{ point 0 0 -1; normal 0 0 1 }}\n\
             disk name=\"leaf\" material=\"leaf\" {{ center 0 0 0; normal 0 0 1; radius 3 }}",
        ));
        let causes = causes_of(&world, &job, ZbufferSettings::default());
        only(&causes, &[Cause::Refraction], WHOLE);
        assert_eq!(causes.worst[0].other_object.as_deref(), Some(shown));
    }
}

/// The shadow of a box that isn't seen. Without shadow maps all of it differs; with coarse maps its edge does.
#[test]
fn the_edge_of_a_shadow() {
    let (world, job) = scene(
        "ambient 0.2 0.2 0.2\nmaterial \"m\" { kd 0.7 0.6 0.5 }\n\
         plane name=\"wall\" material=\"m\" { point 0 0 0; normal 0 0 1 }\n\
         box name=\"board\" material=\"m\" { min -0.2 2 1; max 3 2.1 3 }\n\
         light \"directional\" name=\"sun\" { direction 0 -1 -1; intensity 0.9 0.9 0.9 }",
    );
    let none = causes_of(&world, &job, ZbufferSettings { shadows: ShadowMethod::None, ..ZbufferSettings::default() });
    only(&none, &[Cause::Shadow], 1000);
    assert_eq!(none.worst[0].light.as_deref(), Some("sun"));
    let coarse = causes_of(&world, &job, ZbufferSettings { shadow_map_size: 64, ..ZbufferSettings::default() });
    only(&coarse, &[Cause::Shadow], 20);
    assert!(coarse.differing() < none.differing() / 2);
}

#[test]
fn a_sphere_of_few_triangles() {
    let (world, job) = scene(
        "ambient 0.2 0.2 0.2\nmaterial \"m\" { kd 0.7 0.6 0.5; ks 0.3 0.3 0.3; n 20 }\n\
         sphere name=\"ball\" material=\"m\" { center 0 0 -2.5; radius 2.5 }\n\
         light \"omni\" name=\"lamp\" { position 4 5 6; intensity 0.9 0.9 0.9 }",
    );
    let settings = ZbufferSettings { tolerance: 6.0, shadows: ShadowMethod::None, ..ZbufferSettings::default() };
    let flat = ZbufferSettings { shading: Shading::Flat, ..settings };
    let mut job = job;
    job.integrator = WhittedSettings { stage: Stage::Specular, ..WhittedSettings::default() }.into();
    // With Phong's shading each pixel has the point and normal of the sphere itself.
    assert_eq!(causes_of(&world, &job, settings).differing(), 0);
    for settings in [flat, ZbufferSettings { shading: Shading::Gouraud, ..settings }] {
        let causes = causes_of(&world, &job, settings);
        only(&causes, &[Cause::Tessellation], 1000);
        assert_eq!(causes.worst[0].object.as_deref(), Some("ball"));
    }
}

#[test]
fn boxes_that_the_near_and_far_planes_cut() {
    // The near plane lies at z = 4, the far plane at z = -95.
    for (text, other) in [("min -0.1 -0.1 0; max 0.1 0.1 4.5", "box"), ("min -3 -9 -97; max 9 9 -96", "box")] {
        let (world, job) = scene(&format!(
            "background 0.9 0.1 0.1; ambient 0.9 0.9 0.9\nmaterial \"m\" {{ kd 0.2 0.6 0.5 }}\nbox name=\"{other}\" material=\"m\" {{ {text} }}"
        ));
        let causes = causes_of(&world, &job, ZbufferSettings::default());
        only(&causes, &[Cause::NearFar, Cause::Edge], 100);
        assert!(causes.count(Cause::Edge) * 10 < causes.differing());
    }
}

#[test]
fn a_plane_with_a_texture() {
    let (world, mut job) = scene(
        "ambient 0.9 0.9 0.9\ntexture \"squares\" kind=\"checker\" { even 0; odd 1 }\n\
         material \"m\" { kd 0.7 0.6 0.5; texture \"squares\" mapping=\"solid\" { scale 0.02 } }\n\
         plane name=\"wall\" material=\"m\" { point 0 0 0; normal 0 0.3 1 }",
    );
    job.film.sampling = Sampling::Sampled(4);
    let causes = causes_of(&world, &job, ZbufferSettings::default());
    only(&causes, &[Cause::TextureFilter], 100);
}

#[test]
fn light_from_other_surfaces() {
    let (world, mut job) = scene(
        "ambient 0.5 0.2 0.2\nmaterial \"m\" { kd 0.7 0.6 0.5 }\nplane material=\"m\" { point 0 0 0; normal 0 0 1 }\n\
         light \"omni\" { position 4 5 6; intensity 0.5 0.5 0.5 }",
    );
    job.integrator = WhittedSettings { stage: Stage::Ambient, ..WhittedSettings::default() }.into();
    let without = WhittedSettings { stage: Stage::Diffuse, ..WhittedSettings::default() };
    only(&causes_of(&world, &job, without), &[Cause::IndirectLight], WHOLE);
}

/// Rooms in which the light from wall to wall is all that the classic integrator leaves out. Mirrors show it, too.
#[test]
fn light_from_wall_to_wall() {
    let walls = "material \"w\" { kd 0.6 0.5 0.4 }\nmaterial \"red\" { kd 0.8 0.1 0.1 }\n\
                 box name=\"room\" material=\"w\" { min -2 -2 -1; max 2 2 7 }\n\
                 box name=\"cupboard\" material=\"red\" { min -0.9 -2 -0.9; max -0.3 0.2 -0.2 }\n";
    let bulb = "light \"omni\" name=\"bulb\" { position 0.5 1 3; intensity 0.6 0.6 0.6 }\n";
    let lamp = "material \"lamp\" { kd 0; emission 4 4 3 }\nmaterial \"silver\" { kd 0.1 0.1 0.1; k 0.8 }\n\
                box name=\"lamp\" material=\"lamp\" { min 0 1.9 2; max 1 2 3 }\n\
                sphere name=\"ball\" material=\"silver\" { center 0.5 -0.2 0; radius 0.4 }\n";
    for lights in [bulb, lamp] {
        let (world, job) = scene(&format!("{walls}{lights}"));
        for show in [RadiosityShow::Full, RadiosityShow::Solution] {
            // A solution without a second pass has no mirrors.
            let allowed: &[Cause] = match show {
                RadiosityShow::Solution if lights == lamp => &[Cause::IndirectLight, Cause::Mirror, Cause::Several],
                _ => &[Cause::IndirectLight],
            };
            let settings = RadiositySettings { error: 0.05, show, ..RadiositySettings::DEFAULT };
            let causes = causes_of(&world, &job, Integrator::Radiosity(settings));
            only(&causes, allowed, WHOLE * 3 / 4);
        }
    }
}

/// Of a pixel whose cause is a mirror, the difference is mostly the layer of reflections; and so on.
#[test]
fn causes_agree_with_layers() {
    let world = World::build(still_life(1.0)).unwrap();
    let mut job = still_life_job(1.0, 160, 120, Sampling::Center);
    job.aovs = vec![Aov::ObjectId];
    let zbuffer = Job { integrator: ZbufferSettings::default().into(), ..job.clone() };
    let other = picture(&world, &zbuffer);
    job.aovs = vec![Aov::ObjectId, Aov::Reflection, Aov::Refraction, Aov::Position];
    let own = picture(&world, &job);
    let method = |job, picture| MethodPicture { job, picture, solution: None };
    let causes = find_causes(&world, &method(&job, &own), &method(&zbuffer, &other), TOLERANCE, &()).unwrap();
    let layer = |name: &str, pixel: usize| {
        let data = &own.layer(name).unwrap().data;
        DVec3::new(data[3 * pixel].into(), data[3 * pixel + 1].into(), data[3 * pixel + 2].into())
    };
    let color = |picture: &Picture, pixel: usize| DVec3::from_array(picture.pixels[pixel].to_array().map(f64::from));
    let camera = &job.camera;
    let mut seen = [0; 4];
    for (pixel, cause) in causes.pixels.iter().enumerate() {
        let difference = color(&own, pixel) - color(&other, pixel);
        let ids = [&own, &other].map(|picture| picture.layer("object-id").unwrap().id(pixel));
        let z = -(layer("position", pixel) - camera.eye()).dot(camera.axes()[2]);
        let is_drawn = camera.is_between_planes(z);
        let is_in_range = color(&own, pixel).max_element() < 1.0 && color(&other, pixel).max_element() < 1.0;
        let part = match cause {
            Some(Cause::Mirror) => layer("reflection", pixel),
            Some(Cause::Refraction) => layer("refraction", pixel),
            Some(Cause::NearFar) => {
                assert!(!is_drawn && ids[0] > 0, "{pixel}");
                seen[2] += 1;
                continue;
            }
            Some(Cause::Edge) => {
                seen[3] += usize::from(ids[0] != ids[1]);
                continue;
            }
            None => {
                // A pixel that shows other objects differs, unless these are equally bright.
                continue;
            }
            _ => {
                assert_eq!(ids[0], ids[1], "{pixel} {cause:?}");
                continue;
            }
        };
        assert_eq!(ids[0], ids[1]);
        seen[usize::from(*cause == Some(Cause::Refraction))] += 1;
        if is_in_range {
            // A quarter of the difference may be of other causes; the display's curve stretches it.
            assert!((difference - part).length() <= 0.5 * difference.length(), "{pixel} {cause:?} {difference} {part}");
        }
    }
    println!("mirror {}, refraction {}, near/far {}, edges {}", seen[0], seen[1], seen[2], seen[3]);
    let found: Vec<(&str, u64)> = Cause::ALL.iter().map(|c| (c.name(), causes.count(*c))).collect();
    println!("{found:?}");
    assert!(seen[0] > 300 && seen[1] > 100 && seen[3] > 10, "{seen:?}");
    assert_eq!(causes.count(Cause::Unexplained), 0, "{:?}", causes.worst);
}

#[test]
fn little_is_unexplained_and_threads_change_nothing() {
    let samplings = [Sampling::Center, Sampling::Regular(2), Sampling::Adaptive { n: 3, threshold: 0.1 }];
    for (scene, name) in [(still_life(1.0), "plain"), (textured_still_life(1.0), "textured")] {
        let world = World::build(scene).unwrap();
        for sampling in samplings {
            let job = still_life_job(1.0, 64, 48, sampling);
            let settings = ZbufferSettings { shadow_map_size: 128, multisampling: 4, ..ZbufferSettings::default() };
            let mut all = Vec::new();
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                all.push(pool.install(|| causes_of(&world, &job, settings)));
            }
            assert!(all.iter().all(|causes| *causes == all[0]), "{name} {sampling:?}");
            let found: Vec<(&str, u64)> = Cause::ALL.iter().map(|c| (c.name(), all[0].count(*c))).collect();
            println!("{name} {sampling:?} {found:?}");
            assert!(all[0].count(Cause::Unexplained) * 1000 <= all[0].differing(), "{name} {sampling:?} {found:?}");
        }
    }
}
