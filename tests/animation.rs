//! Tests of the book's animation. Its frames are compared with `docs/pictures/bouncing-ball.png`, which people have
//! checked (`CANALETTO_BLESS=1` replaces it). The number of threads changes nothing, and objects are at their
//! calculated places.

use canaletto::camera::Camera;
use canaletto::film::{Picture, develop};
use canaletto::render::{Job, render};
use canaletto::scene::{Content, FilmSettings, Scene};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::movie::{Movie, MovieFormat, MovieSettings, Rate};
use canaletto_io::picture::{Compression, EncodeSettings, Image, PictureFormat, WriteOptions, decode};
use canaletto_io::source::SceneSource;
use canaletto_io::text::SceneDocument;
use canaletto_tests::{clamped, root};
use glam::DVec3;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::PathBuf;

fn open(name: &str, set: &[&str]) -> (SceneDocument, FolderAssets) {
    let (assets, name) = FolderAssets::beside(root().join("scenes/chapter").join(name)).unwrap();
    let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
    (SceneDocument::read(&name, &assets, &set).unwrap_or_else(|errors| panic!("{errors}")), assets)
}

fn script() -> (SceneDocument, FolderAssets) {
    open("bouncing-ball.kdl", &[])
}

fn scene_of((script, assets): &mut (SceneDocument, FolderAssets), frame: f64) -> Scene {
    let (scene, warnings) = script.scene(assets, frame).unwrap_or_else(|errors| panic!("{errors}"));
    assert!(warnings.is_empty(), "{warnings}");
    scene
}

fn scene(frame: u32) -> Scene {
    scene_of(&mut script(), f64::from(frame))
}

/// A picture in linear light.
fn rendered(scene: Scene, frame: u32) -> Picture {
    let camera = Camera::of(&scene.views[0]).unwrap();
    let job = Job { frame, ..Job::new(camera, scene.film, scene.integrator) };
    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture
}

fn picture(frame: u32) -> (Image, FilmSettings) {
    let scene = scene(frame);
    let film = scene.film;
    let picture = rendered(scene, frame);
    let shown = develop(&picture, &clamped(&film));
    (Image::from_rgb(picture.width, picture.height, shown.iter().map(|c| c.to_array())), film)
}

fn bytes(image: &Image) -> Vec<u8> {
    let [r, g, b] = image.rgb().unwrap();
    let level = |v: f32| (v * 255.0).round() as u8;
    (0..r.len()).flat_map(|i| [level(r[i]), level(g[i]), level(b[i])]).collect()
}

fn golden() -> PathBuf {
    root().join("docs/pictures/bouncing-ball.png")
}

/// The frames of an animated PNG of 8 bits and 3 channels, composed from their changed parts.
fn frames() -> Vec<Vec<u8>> {
    let mut reader = png::Decoder::new(BufReader::new(File::open(golden()).unwrap())).read_info().unwrap();
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let count = reader.info().animation_control.unwrap().num_frames;
    let (mut canvas, mut data) = (vec![0; width * height * 3], vec![0; reader.output_buffer_size().unwrap()]);
    (0..count)
        .map(|_| {
            let part = reader.next_frame(&mut data).unwrap();
            let at = *reader.info().frame_control().unwrap();
            for (y, row) in data.chunks_exact(part.line_size).take(part.height as usize).enumerate() {
                let to = ((at.y_offset as usize + y) * width + at.x_offset as usize) * 3;
                canvas[to..to + row.len()].copy_from_slice(row);
            }
            canvas.clone()
        })
        .collect()
}

#[test]
fn frames_look_as_they_did_when_people_looked_at_them() {
    let (script, _) = script();
    let [first, last] = script.timeline().frames.unwrap();
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        let (image, film) = picture(first);
        let settings = MovieSettings {
            width: image.width,
            height: image.height,
            rate: Rate::new(script.timeline().fps),
            frames: last - first + 1,
            transfer: film.transfer,
            alpha: false,
            compression: Compression::Default,
            metadata: Vec::new(),
        };
        let mut movie = Movie::begin(MovieFormat::Apng, &golden(), WriteOptions::default(), settings).unwrap();
        for frame in first..=last {
            movie.add(&picture(frame).0).unwrap();
        }
        movie.finish().unwrap();
    }
    let golden_frames = frames();
    assert_eq!(golden_frames.len() as u32, last - first + 1);
    for frame in [0, 7, 12, 24, 31, 47] {
        assert!(golden_frames[frame as usize] == bytes(&picture(frame).0), "frame {frame} has changed");
    }
    assert!(fs::metadata(golden()).unwrap().len() <= 200 << 10);
}

#[test]
fn frames_are_the_same_on_any_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| picture(19).0)
    };
    let one = on(1);
    assert!([2, 3, 7].into_iter().all(|threads| on(threads) == one));
}

/// The ball follows the laws of free fall. The camera stays on its rail and keeps its intrinsic parameters.
#[test]
fn the_ball_falls_and_the_camera_moves_on_its_rail() {
    let intrinsics = scene(0).views[0].intrinsics;
    let (start, end) = (DVec3::new(100.0, 40.0, 40.0), DVec3::new(-20.0, 50.0, 110.0));
    for frame in 0..=48 {
        let scene = scene(frame);
        let ball = scene.nodes.iter().find(|node| node.name.as_deref() == Some("ball")).unwrap();
        assert!(matches!(ball.content, Content::Shape(_)));
        let height = ball.transform.point(DVec3::ZERO).y;
        // The ball falls for 12 of 24 frames. It is 60 (t/12)² below its highest point, t frames before or after it.
        let t = f64::from(((frame + 12) % 24).abs_diff(12));
        assert!((height - (20.0 - 60.0 * (t / 12.0) * (t / 12.0))).abs() < 1e-12, "frame {frame}: {height}");
        let view = &scene.views[0];
        assert_eq!(view.intrinsics, intrinsics);
        match frame {
            0 | 48 => assert_eq!(view.extrinsics.eye, start),
            24 => assert!((view.extrinsics.eye - end).length() < 1e-9),
            _ => assert!(view.extrinsics.eye.length() > 100.0),
        }
    }
}

/// The blurred picture equals the mean of pictures at 48 moments while the shutter is open. The two computations share
/// only the keys.
#[test]
fn blur_is_the_mean_of_sharp_pictures() {
    let set = ["camera.size=80 60", "film.sample=\"jittered\" n=6"];
    let blurred = scene_of(&mut open("bouncing-ball-blurred.kdl", &set), 9.0);
    let ball = blurred.nodes.iter().find(|node| node.name.as_deref() == Some("ball")).unwrap();
    assert!(ball.motion.len() > 2 && blurred.views[0].motion.len() > 2);
    let blurred = rendered(blurred, 9);
    let moments = 48;
    let mut mean = vec![DVec3::ZERO; blurred.pixels.len()];
    let mut sharp = open("bouncing-ball.kdl", &["camera.size=80 60"]);
    for moment in 0..moments {
        let frame = 8.0 + 2.0 * (f64::from(moment) + 0.5) / f64::from(moments);
        let picture = rendered(scene_of(&mut sharp, frame), moment);
        for (sum, pixel) in mean.iter_mut().zip(&picture.pixels) {
            *sum += DVec3::from_array(pixel.to_array().map(f64::from)) / f64::from(moments);
        }
    }
    let still = rendered(scene_of(&mut sharp, 9.0), 9);
    let rms = |picture: &Picture| {
        let pixels = picture.pixels.iter().map(|pixel| DVec3::from_array(pixel.to_array().map(f64::from)));
        (pixels.zip(&mean).map(|(a, b)| (a - *b).length_squared()).sum::<f64>() / (3.0 * mean.len() as f64)).sqrt()
    };
    println!("blurred: {:.4} from the mean, sharp: {:.4}", rms(&blurred), rms(&still));
    assert!(rms(&blurred) < 0.008 && rms(&still) > 4.0 * rms(&blurred));
}

#[test]
fn the_blurred_frame_looks_as_it_did() {
    let scene = scene_of(&mut open("bouncing-ball-blurred.kdl", &[]), 9.0);
    let film = scene.film;
    let picture = rendered(scene, 9);
    let shown = develop(&picture, &clamped(&film));
    let image = Image::from_rgb(picture.width, picture.height, shown.iter().map(|c| c.to_array()));
    let path = root().join("docs/pictures/bouncing-ball-blurred.png");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        fs::write(
            &path,
            PictureFormat::Png.encode_image(&image, film.transfer, &EncodeSettings::default(), &[]).unwrap(),
        )
        .unwrap();
    }
    let golden = decode(&fs::read(path).unwrap()).unwrap().image;
    assert!(bytes(&golden) == bytes(&image));
}
