//! Orthographic cameras: outlines by hand, bodies that only some rays start in, explanations, and scales.

use canaletto::camera::Camera;
use canaletto::explain::{Explainer, Outcome, PixelTree, explain};
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job, Preparation, Session, render};
use canaletto::scene::{
    Aperture, CameraProjection, Extrinsics, FilmSettings, Focus, Integrator, Intrinsics, Lens, Node, PathSettings,
    Sampling, Scene, Shading, ShadowMethod, View, WhittedSettings, ZbufferSettings,
};
use canaletto::shape::{Shape, Sphere};
use canaletto::world::World;
use canaletto_tests::assert_same_picture;
use canaletto_tests::gallery::{distributed_still_life, orthographic_job, still_life};
use canaletto_tests::textured::textured_still_life;
use glam::{DVec3, Vec3};

fn zbuffer(shading: Shading) -> ZbufferSettings {
    ZbufferSettings { shadows: ShadowMethod::None, shading, ..ZbufferSettings::default() }
}

/// A square view of 10 units along −z from z = 10.
fn square_view(pixels: u32) -> Camera {
    let projection = CameraProjection::Orthographic { height: 10.0 };
    let intrinsics = Intrinsics { projection, width: pixels, height: pixels, ..Intrinsics::default() };
    Camera::new(&intrinsics, &Extrinsics { eye: DVec3::Z * 10.0, ..Extrinsics::default() }).unwrap()
}

/// Balls of one radius at different distances have outlines of this radius, and the depth of each point is exact.
#[test]
fn a_balls_outline_has_its_radius_at_every_distance() {
    const RADIUS: f64 = 1.5;
    let centers = [DVec3::new(-2.0, 2.0, 8.0), DVec3::new(2.0, 2.0, -30.0), DVec3::new(0.0, -2.5, -400.0)];
    let ball = |center: &DVec3| Shape::Sphere(Sphere { center: center.as_vec3(), radius: RADIUS as f32 });
    let nodes = centers.iter().map(|center| Node::from(ball(center))).collect();
    let world = World::build(Scene { nodes, ..Scene::default() }).unwrap();
    let integrators: [Integrator; 2] = [WhittedSettings::default().into(), zbuffer(Shading::Phong).into()];
    for integrator in integrators {
        let mut job = Job::new(square_view(200), FilmSettings::default(), integrator);
        job.film.sampling = Sampling::Center;
        job.aovs = vec![Aov::ObjectId, Aov::Depth];
        let picture = render(&world, &job, &()).unwrap().picture;
        let (ids, depths) = (picture.layer("object-id").unwrap(), picture.layer("depth").unwrap());
        let mut inside = 0;
        for (index, depth) in depths.data.iter().enumerate() {
            let place = |pixel: usize| (pixel as f64 + 0.5) / 20.0 - 5.0;
            let at = DVec3::new(place(index % 200), -place(index / 200), 0.0);
            let away = |center: &DVec3| ((center - at) * DVec3::new(1.0, 1.0, 0.0)).length();
            // Corners of the rasteriser's triangles are snapped to 1/256 pixel.
            if centers.iter().any(|center| (away(center) - RADIUS).abs() < 0.01 * RADIUS) {
                continue;
            }
            let seen = centers.iter().position(|center| away(center) < RADIUS);
            assert_eq!(ids.id(index), seen.map_or(0, |ball| ball as u32 + 1), "{integrator:?} {at}");
            let Some(ball) = seen else { continue };
            let front = (RADIUS * RADIUS - away(&centers[ball]).powi(2)).sqrt();
            let expected = 10.0 - centers[ball].z - front;
            assert!((f64::from(*depth) - expected).abs() < 1e-4 * expected, "{integrator:?} {at}: {depth} {expected}");
            inside += 1;
        }
        assert!(inside > 7000, "{inside}");
    }
}

/// The plane through the eye cuts a glass ball, and the eye is beside it. Rays that start in glass don't see the drop
/// of water that the glass fills, and leave glass. Others miss the ball and see their own drop.
#[test]
fn each_ray_starts_in_its_own_bodies() {
    let clear = |eta: f32, priority: f32| {
        let phong = Phong { opacity: 0.0, eta, ..Phong::default() };
        Material { priority, ..Material::new("clear", phong) }
    };
    let ball = |x: f32, z: f32, radius: f32, material: u32| {
        Node::from(Shape::Sphere(Sphere { center: Vec3::new(x, 0.0, z), radius })).with_material(material)
    };
    let world = World::build(Scene {
        background: Rgb::new(0.2, 0.4, 0.6),
        materials: vec![clear(1.5, 1.0), clear(1.33, 0.0)],
        nodes: vec![
            ball(2.5, 10.0, 2.0, 0),
            ball(2.5, 9.0, 0.7, 1).named("hidden drop"),
            ball(-2.5, 9.0, 0.7, 1).named("drop"),
        ],
        ..Scene::default()
    })
    .unwrap();
    let mut job = Job::new(square_view(40), FilmSettings::default(), WhittedSettings::default());
    job.film.sampling = Sampling::Center;
    let picture = render(&world, &job, &()).unwrap().picture;
    let (mut leaving, mut hidden, mut seen) = (0, 0, 0);
    for (x, y) in (0..40).flat_map(|x| (0..40).map(move |y| (x, y))) {
        let tree = explain(&world, &job, x, y).unwrap();
        assert_eq!(tree.color, picture.pixel(x, y), "{x} {y}");
        let place = |pixel: u32| (f64::from(pixel) + 0.5) / 4.0 - 5.0;
        let starts_inside = (place(x) - 2.5).hypot(place(y)) < 2.0;
        let ray = &tree.samples[0].ray;
        hidden += ray.hidden.len();
        let Outcome::Hit(hit) = &ray.outcome else {
            assert!(!starts_inside, "{x} {y}");
            continue;
        };
        let media: Vec<_> = hit.children.iter().filter_map(|ray| ray.media).collect();
        let expected = if starts_inside { [1.5, 1.0] } else { [1.0, 1.33] };
        assert!(media.iter().all(|media| *media == expected), "{x} {y}: {media:?}");
        assert_eq!(hit.object == "drop", !starts_inside, "{x} {y}: {}", hit.object);
        *(if starts_inside { &mut leaving } else { &mut seen }) += media.len();
    }
    // Rays beyond the critical angle are mirrored inside. A drop has about 25 pixels and two sides.
    assert!(leaving > 80 && hidden > 40 && seen > 20, "{leaving} {hidden} {seen}");
}

/// The sum of a pixel's explanation is the pixel, of rays side by side and of a rasteriser. Some rays start in glass.
#[test]
fn the_explanations_sum_is_the_pixel() {
    let integrators: [Integrator; 4] = [
        WhittedSettings::default().into(),
        zbuffer(Shading::Phong).into(),
        zbuffer(Shading::Gouraud).into(),
        zbuffer(Shading::Flat).into(),
    ];
    for scene in [still_life, textured_still_life] {
        let world = World::build(scene(1.0)).unwrap();
        for (integrator, sampling) in
            integrators.iter().flat_map(|i| [(i, Sampling::Center), (i, Sampling::Regular(2))])
        {
            let job = Job { integrator: *integrator, ..orthographic_job(1.0, 24, 18, sampling) };
            all_pixels_are_explained(&world, &job);
        }
    }
    // A lens, and everything moves, the camera too.
    let world = World::build(distributed_still_life(1.0)).unwrap();
    let lens = Lens { aperture: Aperture::Radius(0.1), focus: Focus::Center, blades: 5, rotation: 10.0 };
    let projection = CameraProjection::Orthographic { height: 5.0 };
    let from = Extrinsics { eye: DVec3::new(2.0, 3.0, 7.0), center: DVec3::ZERO, up: DVec3::Y };
    let view = View {
        name: "moving".into(),
        intrinsics: Intrinsics { projection, width: 24, height: 18, lens: Some(lens), ..Intrinsics::default() },
        extrinsics: from,
        motion: vec![from, Extrinsics { eye: DVec3::new(2.5, 3.0, 6.5), ..from }],
    };
    let film = FilmSettings { sampling: Sampling::Sampled(3), ..FilmSettings::default() };
    let job = Job::new(Camera::of(&view).unwrap(), film, WhittedSettings::default());
    let told = all_pixels_are_explained(&world, &job);
    assert!(told.contains("from the point of the lens") && told.contains("at time "), "{told}");
}

/// Compares all explanations with the picture, and returns the text of one.
fn all_pixels_are_explained(world: &World, job: &Job) -> String {
    let picture = render(world, job, &()).unwrap().picture;
    let [width, height] = job.camera.size();
    let mut starts = 0;
    for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
        let tree = explain(world, job, x, y).unwrap();
        assert_eq!((tree.sum(), tree.color), (picture.pixel(x, y), picture.pixel(x, y)), "pixel {x}, {y}\n{tree}");
        starts += tree.samples.iter().filter(|sample| starts_where_it_says(job, &tree, sample.position)).count();
    }
    assert!(starts > 400);
    explain(world, job, width / 2, height / 2).unwrap().to_string()
}

/// Whether the ray of a sample through the shutter's opening and the middle of the lens starts at its `start`.
fn starts_where_it_says(job: &Job, tree: &PixelTree, position: [f64; 2]) -> bool {
    let sample = tree.samples.iter().find(|sample| sample.position == position).unwrap();
    let line = job.camera.at(sample.time.unwrap_or(0.0)).line(position[0], position[1]);
    assert!((DVec3::from(sample.start.unwrap()) - line.origin).length() < 1e-12);
    true
}

#[test]
fn paths_start_at_their_own_places() {
    let world = World::build(still_life(1.0)).unwrap();
    let film_job = orthographic_job(1.0, 16, 12, Sampling::Sampled(4));
    let job = Job { integrator: PathSettings::default().into(), ..film_job };
    let picture = render(&world, &job, &()).unwrap().picture;
    let session = Session::open(&world, &job, Preparation::default()).unwrap();
    let explainer = Explainer::new(&session);
    for (x, y) in (0..16).flat_map(|x| (0..12).map(move |y| (x, y))) {
        let tree = explainer.paths(x, y).unwrap();
        assert_eq!(tree.color, picture.pixel(x, y), "{x} {y}");
    }
}

#[test]
fn threads_tiles_and_powers_of_two_change_no_bit() {
    let integrators: [Integrator; 2] = [WhittedSettings::default().into(), zbuffer(Shading::Phong).into()];
    for integrator in integrators {
        let pictures = [(1, 32, 1.0), (2, 5, 1.0), (3, 16, 4.0), (7, 64, 0.125)].map(|(threads, tile, scale)| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let world = World::build(textured_still_life(scale)).unwrap();
                let mut job = orthographic_job(scale, 60, 45, Sampling::Regular(2));
                (job.tile, job.integrator) = (tile, integrator);
                job.aovs = vec![Aov::ObjectId, Aov::Normal];
                render(&world, &job, &()).unwrap().picture
            })
        });
        for picture in &pictures {
            assert_same_picture(picture, &pictures[0], &format!("{integrator:?}"));
        }
    }
}
