//! Environments in whole pictures. A scene is seen directly and as pictures around another scene. Explanations, threads
//! and scales are tested, too.

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::light::environment::{Environment, EnvironmentKind, Face, Gradient, Sky, Smoothing};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, Sampling, Scene, WhittedSettings};
use canaletto::texture::{ColorSpace, Image, Samples};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::gallery::{still_life, still_life_job};
use canaletto_tests::root;
use glam::{DVec3, Vec3};

fn camera(center: DVec3, up: DVec3, fovy: f64, n: u32) -> Camera {
    let intrinsics = Intrinsics { fovy, width: n, height: n, ..Intrinsics::default() };
    Camera::new(&intrinsics, &Extrinsics { eye: DVec3::ZERO, center, up }).unwrap()
}

/// The court seen by its cameras, as one image for each face.
fn court(n: u32, space: ColorSpace) -> (World, Vec<Image>) {
    let assets = FolderAssets::new(root().join("scenes/chapter/court")).unwrap();
    let (scene, _) = read_scene("court.kdl", &assets).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), Face::NAMES);
    let cameras: Vec<Camera> = scene
        .views
        .iter()
        .map(|view| Camera::new(&Intrinsics { width: n, height: n, ..view.intrinsics }, &view.extrinsics).unwrap())
        .collect();
    let world = World::build(scene).unwrap();
    let film = FilmSettings { sampling: Sampling::Regular(2), ..FilmSettings::default() };
    let image = |camera: &Camera| {
        let picture = render(&world, &Job::new(camera.clone(), film, WhittedSettings::default()), &()).unwrap().picture;
        let samples = Samples::F32(picture.pixels.iter().flat_map(|c| c.to_array()).collect());
        Image { name: "face".into(), width: n, height: n, channels: 3, samples, space, premultiplied: false }
    };
    let images = cameras.iter().map(image).collect();
    (world, images)
}

fn cube() -> EnvironmentKind {
    EnvironmentKind::Cube { faces: [0, 1, 2, 3, 4, 5], smoothing: Smoothing::Bilinear }
}

/// A cube map of pictures from six cameras shows their view in every direction from its middle.
#[test]
fn a_scene_and_its_six_pictures_look_the_same_from_the_middle() {
    let (direct, images) = court(192, ColorSpace::Linear);
    let scene = Scene { environment: Some(Environment::new(cube())), images, ..Scene::default() };
    let around = World::build(scene).unwrap();
    let film = FilmSettings { sampling: Sampling::Regular(2), ..FilmSettings::default() };
    for (center, up) in [
        (DVec3::new(1.0, 0.2, 0.7), DVec3::Y),
        (DVec3::new(-1.0, -0.5, -0.9), DVec3::new(0.3, 1.0, 0.1)),
        (DVec3::new(0.2, 1.0, 0.1), DVec3::X),
        (DVec3::new(-0.3, -1.0, 0.2), DVec3::NEG_Z),
    ] {
        let job = Job::new(camera(center, up, 100.0, 96), film, WhittedSettings::default());
        let [a, b] = [&direct, &around].map(|world| render(world, &job, &()).unwrap().picture);
        let mut differences: Vec<f32> =
            a.pixels.iter().zip(&b.pixels).map(|(a, b)| (*a - *b).map(f32::abs).max_component()).collect();
        differences.sort_by(f32::total_cmp);
        // Edges in the pictures are a texel wide; everything else is equal.
        let (most, mean) = (differences[differences.len() * 85 / 100], differences.iter().sum::<f32>() / 9216.0);
        println!("towards {center}: 85 % differ by less than {most:.4}, mean {mean:.4}");
        assert!(most < 0.01 && mean < 0.02, "towards {center}: {most} {mean}");
    }
}

/// One rotated environment of each kind, each behind a still life.
fn still_lifes(scale: f32) -> Vec<Scene> {
    let image = |w: u32, h: u32, seed: u32| Image {
        name: "noise".into(),
        width: w,
        height: h,
        channels: 3,
        samples: Samples::U8((0..w * h * 3).map(|i| (i.wrapping_mul(2_654_435_761 + seed) >> 24) as u8).collect()),
        space: ColorSpace::Srgb,
        premultiplied: false,
    };
    let smoothing = Smoothing::Bilinear;
    let kinds = [
        (cube(), (0..6).map(|i| image(9, 9, i)).collect()),
        (EnvironmentKind::Cross { image: 0, smoothing }, vec![image(12, 16, 7)]),
        (EnvironmentKind::LatLong { image: 0, smoothing }, vec![image(32, 16, 8)]),
        (EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Nearest }, vec![image(32, 16, 8)]),
        (
            EnvironmentKind::Gradient(Gradient { stops: vec![(-30.0, Rgb::BLACK), (45.0, Rgb::new(0.2, 0.5, 1.0))] }),
            vec![],
        ),
        (EnvironmentKind::Sky(Sky { sun: Vec3::new(0.3, 0.4, -1.0), ..Sky::default() }), vec![]),
    ];
    kinds
        .into_iter()
        .map(|(kind, images)| {
            let rotation = Transform::rotate(DVec3::new(0.1, 1.0, 0.2), 33.0).unwrap();
            let environment = Environment { rotation, intensity: Rgb::new(0.9, 0.8, 0.7), ..Environment::new(kind) };
            Scene { environment: Some(environment), images, ..still_life(scale) }
        })
        .collect()
}

#[test]
fn explanations_of_environments_sum_to_the_pixel_bit_for_bit() {
    for scene in still_lifes(1.0) {
        let kind = scene.environment.as_ref().unwrap().kind_name();
        let world = World::build(scene).unwrap();
        let job = still_life_job(1.0, 24, 18, Sampling::Jittered(2));
        let picture = render(&world, &job, &()).unwrap().picture;
        let mut told = 0;
        for y in 0..18 {
            for x in 0..24 {
                let tree = explain(&world, &job, x, y).unwrap();
                assert_eq!(tree.sum().to_array().map(f32::to_bits), picture.pixel(x, y).to_array().map(f32::to_bits));
                told += usize::from(tree.to_string().contains(&format!("meets nothing: environment \"{kind}\"")));
            }
        }
        assert!(told > 40, "{kind}: {told} pixels tell of it");
    }
}

#[test]
fn environments_depend_on_neither_threads_nor_the_unit_of_length() {
    let pictures = |scale: f32, threads: usize| -> Vec<Vec<u32>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let one = |scene: Scene| {
            let mut job = still_life_job(scale, 40, 30, Sampling::Jittered(2));
            job.aovs = vec![Aov::Ambient, Aov::Reflection, Aov::Refraction];
            let picture = render(&World::build(scene).unwrap(), &job, &()).unwrap().picture;
            assert!(picture.pixels.iter().all(|p| p.is_finite()));
            let layers = picture.layers.iter().flat_map(|l| l.data.iter().copied());
            picture.pixels.iter().flat_map(|p| p.to_array()).chain(layers).map(f32::to_bits).collect()
        };
        pool.install(|| still_lifes(scale).into_iter().map(one).collect())
    };
    let first = pictures(1.0, 1);
    assert!(first.windows(2).all(|pair| pair[0] != pair[1]), "environments differ");
    for threads in [2, 3, 7] {
        assert!(pictures(1.0, threads) == first, "{threads} threads");
    }
    for k in [-20, 7, 30] {
        assert!(pictures(2f32.powi(k), 2) == first, "scaled by 2^{k}");
    }
}

/// An environment of one colour equals a background of that colour.
#[test]
fn a_single_colour_all_around_is_the_background() {
    let color = Rgb::new(0.3, 0.4, 0.6);
    let job = still_life_job(1.0, 40, 30, Sampling::Center);
    let picture = |scene| render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixels;
    let plain = Scene { background: color, ..still_life(1.0) };
    let gradient = EnvironmentKind::Gradient(Gradient { stops: vec![(0.0, color)] });
    let around = Scene { environment: Some(Environment::new(gradient)), background: Rgb::WHITE, ..still_life(1.0) };
    assert_eq!(picture(plain), picture(around));
}

/// The sun of a sky is a light of the scene, and the sky's mean its ambient light.
#[test]
fn a_sky_lights_the_scene() {
    let environment = |ambient, light| {
        let sky = Sky { sun: Vec3::Y, light, ..Sky::default() };
        Scene {
            environment: Some(Environment { ambient, ..Environment::new(EnvironmentKind::Sky(sky)) }),
            ..Scene::default()
        }
    };
    let dark = World::build(environment(false, false)).unwrap();
    assert!(dark.lights.is_empty() && dark.ambient == Rgb::BLACK);
    let world = World::build(environment(true, true)).unwrap();
    let arriving = world.lights[0].illuminate(0, DVec3::ZERO);
    assert_eq!((world.lights.len(), arriving.direction), (1, DVec3::Y));
    // A white surface that faces the sun is about 1 at exposure 0; the sky is blue.
    assert!((0.6..1.2).contains(&arriving.intensity.g), "{arriving:?}");
    assert!((0.03..0.5).contains(&world.ambient.g) && world.ambient.b > world.ambient.r, "{:?}", world.ambient);
}
