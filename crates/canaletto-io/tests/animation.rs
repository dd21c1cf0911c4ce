//! Keys and paths in the scene text: the scene at a frame. Expected values are computed by hand.

use canaletto::integrator::describe;
use canaletto::light::LightKind;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Node, Scene, Stage, Transfer};
use canaletto::shape::Shape;
use canaletto_io::assets::{Asset, AssetError, AssetPath, Assets, MemoryAssets};
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat};
use canaletto_io::source::SceneSource;
use canaletto_io::text::{SceneDocument, read_scene_text};
use glam::{DVec3, Vec3};
use std::sync::atomic::{AtomicUsize, Ordering};

fn script(text: &str) -> SceneDocument {
    SceneDocument::of_text(text, "scene.kdl", &MemoryAssets::new(), &[]).unwrap_or_else(|errors| panic!("{errors}"))
}

fn at(text: &str, frame: f64) -> Scene {
    match script(text).scene(&MemoryAssets::new(), frame) {
        Ok((scene, _)) => scene,
        Err(errors) => panic!("{errors}"),
    }
}

/// The origin of the first object.
fn origin(text: &str, frame: f64) -> DVec3 {
    at(text, frame).nodes[0].transform.point(DVec3::ZERO)
}

fn stage(scene: &Scene) -> Stage {
    describe(&scene.integrator).whitted().unwrap().stage
}

#[test]
fn everything_moves() {
    let text = r#"
        background { key 0 0 0 0; key 10 1 0.5 0; ease "linear" }
        ambient { key 0 0; key 10 1; ease "linear" }
        camera { eye { key 0  0 0 10; key 10  10 0 10; ease "linear" }; fovy { key 0 40; key 10 60; ease "linear" }; size 8 8 }
        material "m" { kd { key 0  1 0 0; key 10  0 0 1; ease "linear" }; n { key 0 10; key 10 20; ease "linear" } }
        sphere material="m" { center 0 0 0; radius { key 0 1; key 10 2; ease "linear" } }
        spheres radius=1 { points { key 0 0 0 0 1 1 1; key 10 10 0 0 1 1 2; ease "linear" } }
        group { translate { key 0  0 0 0; key 10  0 5 0; ease "linear" }
            light "spot" { position 0 9 0; target { key 0  0 0 0; key 10  1 0 0; ease "linear" }; outer 30
                intensity { key 0 1; key 10 3; ease "linear" } } }
        integrator { max-depth { key 0 1; key 10 6; ease "linear" }; stage { key 0 "diffuse"; key 5 "full" } }
        film { filter "gaussian" { sigma { key 0 0.4; key 10 0.8; ease "linear" } } }
    "#;
    let scene = at(text, 2.5);
    assert_eq!((scene.background, scene.ambient), (Rgb::new(0.25, 0.125, 0.0), Rgb::gray(0.25)));
    let view = &scene.views[0];
    assert_eq!((view.extrinsics.eye, view.intrinsics.fovy), (DVec3::new(2.5, 0.0, 10.0), 45.0));
    assert_eq!((scene.materials[0].classic().kd, scene.materials[0].classic().n), (Rgb::new(0.75, 0.0, 0.25), 12.5));
    assert!(matches!(&scene.nodes[0].content, Content::Shape(Shape::Sphere(s)) if s.radius == 1.25));
    assert_eq!(scene.spheres[0].centers, [Vec3::new(2.5, 0.0, 0.0), Vec3::new(1.0, 1.0, 1.25)]);
    assert_eq!(scene.nodes[2].transform.point(DVec3::ZERO), DVec3::new(0.0, 1.25, 0.0));
    let Content::Group(inside) = &scene.nodes[2].content else { panic!() };
    let Content::Light(light) = &inside[0].content else { panic!() };
    assert_eq!(light.intensity, Rgb::gray(1.5));
    assert!(matches!(&light.kind, LightKind::Spot(spot) if spot.target == Vec3::new(0.25, 0.0, 0.0)));
    // 2.25 is rounded; a keyword holds until the next key.
    assert_eq!((describe(&scene.integrator).max_depth(), stage(&scene)), (2, Stage::Diffuse));
    assert_eq!(stage(&at(text, 5.0)), Stage::Full);
    // Values are constant before the first and after the last key.
    assert_eq!((at(text, -7.0), at(text, 99.0)), (at(text, 0.0), at(text, 10.0)));
}

#[test]
fn textures_and_environments_move() {
    let pixel = Image::from_rgb(1, 1, [[0.5; 3]].into_iter());
    let png = PictureFormat::Png.encode_image(&pixel, Transfer::Srgb, &EncodeSettings::default(), &[]).unwrap();
    let assets = MemoryAssets::new().with("a.png", png);
    let text = r#"
        texture "a" file="a.png" { filter { key 0 "nearest"; key 5 "bilinear" } }
        material "m" { texture "a" use="bump" { height { key 0 0; key 10 1; ease "linear" }
            translate { key 0 0 0 0; key 10 1 0 0; ease "linear" } } }
        sphere material="m" { center 0 0 0; radius 1 }
        environment "gradient" { intensity { key 0 1; key 10 2; ease "linear" }; rotate-y { key 0 0; key 10 180; ease "linear" }
            stops -90 0 0 0  90 1 1 1 }
        light "omni" { position 0 9 0 }
    "#;
    let mut script = SceneDocument::of_text(text, "s", &assets, &[]).ok().unwrap();
    let mut at = |frame| script.scene(&assets, frame).unwrap_or_else(|errors| panic!("{errors}")).0;
    let (first, later) = (at(0.0), at(5.0));
    assert_ne!(first.textures, later.textures);
    assert_eq!(first.images, later.images);
    let place = &later.materials[0].textures[0];
    assert_eq!(place.range, [0.0, 0.5]);
    assert_eq!(place.mapping.transform.point(DVec3::ZERO), DVec3::X / 2.0);
    let environment = later.environment.unwrap();
    assert_eq!(environment.intensity, Rgb::gray(1.5));
    assert!((environment.rotation.vector(DVec3::X) - DVec3::NEG_Z).length() < 1e-12);
}

#[test]
fn a_scene_that_stands_still_is_the_same_at_all_frames() {
    let text = "sphere { center 0 0 0; radius 1 }\ncamera { eye 0 0 9 }";
    let mut script = script(text);
    assert!(!script.timeline().moves && script.key_frames().is_empty() && script.first_frame() == 0);
    let scene = script.scene(&MemoryAssets::new(), 3.0).ok().unwrap().0;
    assert_eq!(scene, read_scene_text(text, "s", &MemoryAssets::new(), &[]).ok().unwrap().0);
}

/// A body that falls 80 units in 12 frames: 80 − 80 (t/12)², and rises symmetrically.
#[test]
fn a_ball_bounces_as_gravity_has_it() {
    let text = "sphere { center 0 0 0; radius 1\n\
        translate { key 1  0 80 0 ease=\"in\"; key 13  0 0 0 ease=\"out\"; key 25  0 80 0 } }";
    for frame in 0..=26 {
        let t = (f64::from(frame).clamp(1.0, 25.0) - 13.0).abs() / 12.0;
        let fallen = 80.0 * (1.0 - t) * (1.0 - t);
        assert!((origin(text, f64::from(frame)).y - (80.0 - fallen)).abs() < 1e-12 || frame == 13, "{frame}");
    }
    assert_eq!(origin(text, 13.0).y, 0.0);
}

#[test]
fn seconds_depend_on_the_frames_of_a_second() {
    let text = "animation { fps 10; keys \"seconds\"; frames 5 20 }\n\
        sphere { center 0 0 0; radius 1; translate { key 0 0 0 0; key 2  20 0 0; ease \"linear\" } }";
    assert_eq!(origin(text, 5.0).x, 5.0);
    let mut script = script(text);
    assert_eq!(
        (script.first_frame(), script.timeline().frames, script.key_frames()),
        (5, Some([5, 20]), vec![0.0, 20.0])
    );
    script.set_fps(20.0);
    let scene = script.scene(&MemoryAssets::new(), 5.0).ok().unwrap().0;
    assert_eq!(scene.nodes[0].transform.point(DVec3::ZERO).x, 2.5);
}

#[test]
fn angles_count_unless_the_short_way_is_asked_for() {
    let x = |motion: &str, frame| {
        let text = format!("sphere {{ center 0 0 0; radius 1; {motion} }}");
        at(&text, frame).nodes[0].transform.vector(DVec3::X)
    };
    let close = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} {b}");
    let (right, back, front) = (DVec3::X, DVec3::NEG_Z, DVec3::Z);
    // Two full turns: an eighth of the time is a quarter turn.
    close(x("rotate-y { key 0 0; key 8 720 }", 1.0), back);
    // 270° in the shorter direction is −90°.
    close(x("rotate-y { key 0 0; key 8 270; turn \"shortest\" }", 4.0), (right + front).normalize());
    close(x("rotate-y { key 0 0; key 8 270; turn \"shortest\" }", 8.0), front);
    close(x("rotate { key 0 0 1 0 0; key 8 0 1 0 720 }", 1.0), back);
    close(x("rotate { key 0 0 1 0 0; key 8 0 1 0 270; turn \"shortest\" }", 4.0), (right + front).normalize());
    // From a quarter turn around z to one around −z, through the identity: the axes differ, so the shorter direction is
    // used.
    close(x("rotate { key 0 0 0 1 90; key 8 0 0 -1 90 }", 0.0), DVec3::Y);
    close(x("rotate { key 0 0 0 1 90; key 8 0 0 -1 90 }", 4.0), right);
    close(x("rotate { key 0 0 0 1 90; key 8 0 0 -1 90 }", 8.0), DVec3::NEG_Y);
}

const RAIL: &str = "path \"rail\" { points 0 0 0  30 0 0  30 0 10; curve \"line\" }\n";

#[test]
fn objects_follow_paths_by_length_and_face_ahead() {
    let motion = "follow \"rail\" { at { key 0 0; key 40 1 }; face 0 0 1 }";
    let text = format!("{RAIL} sphere {{ center 0 0 0; radius 1; scale 2; {motion}; translate 0 1 0 }}");
    assert!((origin(&text, 12.0) - DVec3::new(12.0, 1.0, 0.0)).length() < 1e-12);
    assert!((origin(&text, 35.0) - DVec3::new(30.0, 1.0, 5.0)).length() < 1e-12);
    let node: Node = at(&text, 12.0).nodes.remove(0);
    assert!((node.transform.vector(DVec3::Z) - DVec3::X * 2.0).length() < 1e-12);
    assert!((node.transform.vector(DVec3::Y) - DVec3::Y * 2.0).length() < 1e-12);
    assert!((at(&text, 35.0).nodes[0].transform.vector(DVec3::Z) - DVec3::Z * 2.0).length() < 1e-12);
}

#[test]
fn cameras_and_points_follow_paths() {
    let text = format!(
        "{RAIL} camera {{ follow \"rail\" {{ at {{ key 0 0; key 40 1 }}; along #true }}; size 8 8 }}
        camera \"watch\" {{ eye 0 9 0; center {{ follow \"rail\" {{ at 0.875 }} }} }}
        sphere {{ center {{ follow \"rail\" {{ at 0.5 }} }}; radius 1 }}"
    );
    let scene = at(&text, 10.0);
    let e = scene.views[0].extrinsics;
    assert!((e.eye - DVec3::new(10.0, 0.0, 0.0)).length() < 1e-12);
    assert!(((e.center - e.eye).normalize() - DVec3::X).length() < 1e-12);
    assert_eq!(scene.views[1].extrinsics.center, DVec3::new(30.0, 0.0, 5.0));
    assert!(
        matches!(&scene.nodes[0].content, Content::Shape(Shape::Sphere(s)) if s.center == Vec3::new(20.0, 0.0, 0.0))
    );
    // A later file may change a camera of an earlier one.
    let assets = MemoryAssets::new().with("base.kdl", "camera { eye 1 2 3; center 0 0 5 }");
    let text =
        format!("include \"base.kdl\"\n{RAIL} camera {{ follow \"rail\" }}\nsphere {{ center 0 0 0; radius 1 }}");
    let scene = read_scene_text(&text, "s", &assets, &[]).unwrap_or_else(|errors| panic!("{errors}")).0;
    assert_eq!((scene.views[0].extrinsics.eye, scene.views[0].extrinsics.center), (DVec3::ZERO, DVec3::Z * 5.0));
}

#[test]
fn values_can_be_set_over_keys() {
    let text = "sphere name=\"a\" { center 0 0 0; radius { key 0 1; key 9 5 } }\nanimation { fps 10 }";
    let set = ["sphere.a.radius=7".to_owned(), "animation.frames=3 4".to_owned()];
    let mut script = SceneDocument::of_text(text, "s", &MemoryAssets::new(), &set).ok().unwrap();
    assert_eq!(script.timeline().frames, Some([3, 4]));
    let scene = script.scene(&MemoryAssets::new(), 4.0).ok().unwrap().0;
    assert!(matches!(&scene.nodes[0].content, Content::Shape(Shape::Sphere(s)) if s.radius == 7.0));
}

/// Assets that count their reads.
struct Counting(MemoryAssets, AtomicUsize);

impl Assets for Counting {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.read(path, from)
    }
}

#[test]
fn files_are_read_once_for_all_frames() {
    let text = "mesh file=\"m.obj\" { rotate-y { key 0 0; key 9 90 } }\nspheres file=\"c.csv\" radius=1\n\
        cylinders file=\"d.csv\" radius=1";
    let memory = MemoryAssets::new()
        .with("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .with("c.csv", "1,2,3\n4,5,6\n")
        .with("d.csv", "1,2,3,4,5,6\n");
    let assets = Counting(memory, AtomicUsize::new(0));
    let mut script = SceneDocument::of_text(text, "s", &assets, &[]).ok().unwrap();
    let first = script.scene(&assets, 0.0).unwrap_or_else(|errors| panic!("{errors}")).0;
    assert_eq!(assets.1.load(Ordering::Relaxed), 3);
    let later = script.scene(&assets, 5.0).ok().unwrap().0;
    assert_eq!(assets.1.load(Ordering::Relaxed), 3);
    assert!(first != later && first.meshes == later.meshes && first.spheres == later.spheres);
}

#[test]
fn mistakes_that_come_with_time_are_told_then() {
    let mut script = script("sphere { center 0 0 0; radius { key 0 1; key 9 -1; ease \"linear\" } }");
    assert!(script.scene(&MemoryAssets::new(), 4.0).is_ok());
    let errors = script.scene(&MemoryAssets::new(), 5.0).err().unwrap().to_string();
    assert!(errors.contains("radius is -0.11"), "{errors}");
}

/// With a shutter from 0 to half a frame there are 17 poses, at 0, 1/32, … 1/2 of a frame.
#[test]
fn what_keys_move_is_blurred_by_the_shutter() {
    let text = r#"
        camera { eye { key 0  0 0 9; key 8  8 0 9; ease "linear" }; center 0 0 0; shutter 0 0.5 }
        camera "fast" { eye 0 0 9 }
        sphere { center 0 0 0; radius 1; scale 2; translate 1 0 0
            rotate-y { key 0 0; key 8 720; ease "linear" }; translate { key 0  0 0 0; key 8  0 8 0; ease "in" } }
        sphere { center 0 0 0; radius 1; translate { key 20  0 0 0; key 30  1 0 0 } }
        light "omni" { position 0 9 0; translate { key 0 0 0 0; key 8 8 0 0; ease "linear" } }
    "#;
    let scene = at(text, 4.0);
    let node = &scene.nodes[0];
    // Transforms before the first moving one are constant.
    assert_eq!(node.transform.point(DVec3::X), DVec3::new(3.0, 0.0, 0.0));
    assert_eq!(node.motion.len(), 17);
    for (k, pose) in node.motion.iter().enumerate() {
        let frame = 4.0 + 0.5 * k as f64 / 16.0;
        let (sin, cos) = libm::sincos((frame * 90.0).to_radians());
        let expected = DVec3::new(cos, 8.0 * (frame / 8.0) * (frame / 8.0), -sin);
        assert!((pose.point(DVec3::X) - expected).length() < 1e-12, "{k}");
        assert!((scene.views[0].motion[k].eye - DVec3::new(frame, 0.0, 9.0)).length() < 1e-12);
        assert!((scene.nodes[2].motion[k].point(DVec3::ZERO) - DVec3::new(frame, 0.0, 0.0)).length() < 1e-12);
    }
    // Values that are constant while the shutter is open have no poses, and a camera without a shutter blurs nothing.
    assert!(scene.nodes[1].motion.is_empty() && scene.views[1].motion.is_empty());
    let mut script = script(text);
    script.use_shutter_of("fast");
    let scene = script.scene(&MemoryAssets::new(), 4.0).ok().unwrap().0;
    assert!(scene.nodes.iter().all(|node| node.motion.is_empty()) && scene.views[0].motion.is_empty());
    assert!((scene.nodes[0].transform.vector(DVec3::X) - DVec3::X * 2.0).length() < 1e-12);
}

/// A camera that passes overhead is aimed along its own `up` at one frame, where it keeps the roll of the frame before.
#[test]
fn a_camera_that_passes_overhead_keeps_its_roll() {
    let orbit = "camera { eye { key 1 0 8 4; key 3 0 8 -4; ease \"linear\" }; center 0 0 0; size 8 8 }";
    let up = |text: &str, frame: f64| at(text, frame).views[0].extrinsics.up;
    assert_eq!((up(orbit, 1.0), up(orbit, 3.0)), (DVec3::Y, DVec3::Y));
    assert!((up(orbit, 2.0) - DVec3::NEG_Z).length() < 1e-12, "it came from +z: {}", up(orbit, 2.0));
    // The camera stays overhead for several frames.
    let hang = "camera { eye { key 1 0 8 4; key 3 0 8 0; key 9 0 8 0; key 12 4 8 0; ease \"linear\" }; size 8 8 }";
    for frame in [3.0, 5.5, 9.0] {
        assert!((up(hang, frame) - DVec3::NEG_Z).length() < 1e-12, "{frame}: {}", up(hang, frame));
    }
    // The camera starts overhead: the first frame with a defined roll is later.
    let begin = "camera { eye { key 1 0 8 0; key 3 0 8 4; ease \"linear\" }; size 8 8 }";
    assert!((up(begin, 1.0) - DVec3::NEG_Z).length() < 1e-12, "{}", up(begin, 1.0));
    // A path over the pole, with the camera aimed at the centre.
    let path = "path \"p\" curve=\"line\" { points -4 8 0  0 8 0  4 8 0 }
        camera { follow \"p\" { at { key 0 0; key 10 1; ease \"linear\" } }; center 0 0 0; size 8 8 }";
    assert!((up(path, 5.0) - DVec3::X).length() < 1e-12, "{}", up(path, 5.0));
    // The camera is always overhead, which is a mistake, as for a static camera.
    for never in ["camera { eye { key 1 0 8 0; key 3 0 9 0 }; size 8 8 }", "camera { eye 0 8 0; size 8 8 }"] {
        let errors = script(never).scene(&MemoryAssets::new(), 1.0).unwrap_err();
        assert!(errors.to_string().contains("up is parallel"), "{errors}");
    }
}

/// While the shutter is open the roll doesn't flip, as it would if `up` alone defined it.
#[test]
fn the_roll_does_not_flip_while_the_shutter_is_open() {
    let text =
        "camera { eye { key 1 0 8 4; key 3 0 8 -4; ease \"linear\" }; center 0 0 0; size 8 8; shutter -0.5 0.5 }";
    let scene = at(text, 2.0);
    let motion = &scene.views[0].motion;
    let camera = canaletto::camera::Camera::of(&scene.views[0]).unwrap();
    for step in 0..=64 {
        let upwards = camera.at(f64::from(step) / 64.0).axes()[1];
        assert!(upwards.z < -0.9, "{step}: {upwards}");
    }
    assert!(motion.iter().all(canaletto::camera::has_roll));
}
