//! Pictures compared with formulas: lights, means of panoramas, and depth. Filters and textures have modules of their
//! own.

use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{Filter, SamplerKind, Scene};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use png::{BitDepth, ColorType};
use std::f64::consts::PI;

/// The scene of a text and the files that it names.
fn scene(text: &str, files: &[(&str, Vec<u8>)]) -> Scene {
    let assets = MemoryAssets::new().with("scene.kdl", text);
    let assets = files.iter().fold(assets, |assets, (name, bytes)| assets.with(name, bytes.clone()));
    match read_scene("scene.kdl", &assets) {
        Ok((scene, warnings)) => {
            assert!(warnings.is_empty(), "{warnings}");
            scene
        }
        Err(errors) => panic!("{errors}"),
    }
}

fn job(scene: &Scene) -> Job {
    Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator)
}

fn picture_with(text: &str, files: &[(&str, Vec<u8>)]) -> Picture {
    let scene = scene(text, files);
    let job = job(&scene);
    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture
}

fn picture(text: &str) -> Picture {
    picture_with(text, &[])
}

/// The middle pixel.
fn middle(picture: &Picture) -> Rgb {
    picture.pixel(picture.width / 2, picture.height / 2)
}

fn png(width: u32, height: u32, color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

fn png8(width: u32, height: u32, color: ColorType, data: &[u8]) -> Vec<u8> {
    png(width, height, color, BitDepth::Eight, data)
}

/// A pseudorandom number in [0, 1).
fn random(i: u64) -> f64 {
    let mut x = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[track_caller]
fn close(what: &str, value: impl Into<f64>, exact: f64, relative: f64) {
    let value = value.into();
    println!("{what}: {value:.7}, exactly {exact:.7}");
    assert!((value - exact).abs() <= relative * exact.abs(), "{what}: {value} instead of {exact}");
}

mod filters;
mod textures;

// Tests of lights.

/// The middle pixel of a floor under a light.
fn floor(light: &str) -> f64 {
    let text = format!(
        "film {{ samples 64 }}
        camera {{ eye 0 1 2; center 0 0 0; fovy 2; size 4 4 }}
        material \"w\" {{ kd 1 }}
        plane material=\"w\" {{ point 0 0 0; normal 0 1 0 }}
        {light}"
    );
    let seen = picture(&text);
    seen.pixels.iter().map(|p| f64::from(p.g)).sum::<f64>() / seen.pixels.len() as f64
}

/// A mirrored light emits to the mirrored side, for any kind and number of mirrorings.
#[test]
fn mirrored_lights_shine_from_the_mirrored_side() {
    let rectangle = "light \"rectangle\" { corner -1 2 -1; u 2 0 0; v 0 0 2; samples 4; emission \"matte\"";
    let disk = "light \"disk\" { position 0 2 0; normal 0 -1 0; radius 1; samples 4; emission \"matte\"";
    // The form factors of a rectangle of 2a × 2b straight above at height h, and of a disk.
    let (a, b) = (0.5f64, 0.5f64);
    let factor = |a: f64, b: f64| {
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        4.0 / (2.0 * PI) * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    for (name, light, exact) in [("rectangle", rectangle, factor(a, b)), ("disk", disk, 1.0 / 5.0)] {
        for down in [
            "}",
            "scale -1 1 1 }",
            "scale 1 1 -1 }",
            "scale -1 1 -1 }",
            "scale -1 1 1; rotate-y 40 }",
            "rotate-y 90; scale -1 1 1; scale 1 1 -1 }",
            "samples 0; points 256; scale -1 1 1 }",
        ] {
            let light = if down.starts_with("samples") { light.replace("samples 4;", "") } else { light.to_owned() };
            let down = down.trim_start_matches("samples 0; ");
            let value = floor(&format!("{light}; {down}"));
            close(&format!("{name} {down}"), value, exact, 0.02);
            let grouped = format!("group {{ group {{ {light} }} }}\n{}\nscale 1 1 -1 }}", down.trim_end_matches('}'));
            if !down.contains("points") {
                close(&format!("grouped {name} {down}"), floor(&grouped), exact, 0.02);
                let copied = format!("prototype name=\"g\" {{ {light} }} }}\ninstance of=\"g\" {{ {down}");
                close(&format!("copied {name} {down}"), floor(&copied), exact, 0.02);
            }
        }
        let up = light.replace("corner -1 2 -1", "corner -1 -2 -1").replace("position 0 2 0", "position 0 -2 0");
        assert_eq!(floor(&format!("{up}; scale -1 }}")), 0.0, "{name} turned inside out looks up");
        let up = format!("{light}; translate 0 -4 0; scale 1 -1 1 }}");
        assert_eq!(floor(&up), 0.0, "{name} mirrored upwards looks up");
    }
}

/// Triangles and meshes keep their visible side when mirrored.
#[test]
fn mirrored_surfaces_keep_their_visible_side() {
    let obj = b"v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nf 1 2 3 4\n".to_vec();
    let looks = |object: &str, eye: f64| {
        let text = format!(
            "film {{ sample \"center\" }}
            camera {{ eye 0 {eye} 0.1; center 0 0 0; fovy 10; size 1 1 }}
            ambient 1
            material \"w\" {{ kd 1 }}
            {object}"
        );
        picture_with(&text, &[("square.obj", obj.clone())]).pixel(0, 0).g
    };
    let triangle = "triangle material=\"w\" { a -1 0 -1; b 0 0 2; c 1 0 -1; one-sided #true";
    let mesh = "mesh file=\"square.obj\" material=\"w\" { one-sided #true";
    for (name, object) in [("triangle", triangle), ("mesh", mesh)] {
        for (transform, from_above) in [
            ("", true),
            ("scale -1 1 1", true),
            ("scale 1 1 -1", true),
            ("scale -1 1 -1", true),
            ("scale 1 -1 1", false),
            ("scale -1", false),
        ] {
            for placed in [format!("{object}; {transform} }}"), format!("group {{ {object} }}; {transform} }}")] {
                let seen = [5.0, -5.0].map(|eye| looks(&placed, eye));
                let expected = if from_above { [1.0, 0.0] } else { [0.0, 1.0] };
                assert_eq!(seen, expected, "{name} {transform}: {placed}");
            }
        }
    }
}

// Tests of environments.

/// The contribution of an environment to the ambient light.
fn ambient(environment: &str, files: &[(&str, Vec<u8>)]) -> Rgb {
    let text = format!(
        "camera {{ eye 0 0 5; center 0 0 0; size 3 3; fovy 5 }}
        {environment}
        material \"w\" {{ kd 1 }}
        sphere material=\"w\" {{ center 0 0 0; radius 1 }}"
    );
    picture_with(&text, files).pixel(1, 1)
}

/// The mean of a panorama weights each texel by its solid angle.
#[test]
fn the_mean_of_a_panorama_is_exact_to_the_poles() {
    for (w, h) in [(8u32, 4u32), (64, 32), (1024, 512), (34, 17), (6, 3)] {
        for row in [0, 1, h / 2, h - 1] {
            let data: Vec<u8> = (0..h).flat_map(|y| vec![if y == row { 255 } else { 0 }; w as usize]).collect();
            let file = png8(w, h, ColorType::Grayscale, &data);
            let [from, to] = [row, row + 1].map(|y| (f64::from(y) / f64::from(h) * PI).cos());
            for filter in ["filter \"bilinear\"", "filter \"nearest\""] {
                let text = format!("environment \"lat-long\" file=\"e.png\" ambient=#true {{ {filter} }}");
                let seen = ambient(&text, &[("e.png", file.clone())]);
                close(&format!("row {row} of {w} × {h}, {filter}"), seen.g, 0.5 * (from - to), 1e-5);
            }
        }
    }
}

/// The mean of a cube map does so too. A texel in a corner covers a fifth of the solid angle of one in the middle.
#[test]
fn the_mean_of_a_cube_is_exact_to_its_corners() {
    let n = 5u32;
    for (x, y) in [(0, 0), (2, 2), (4, 1), (3, 4)] {
        let face = |white: bool| {
            let data: Vec<u8> = (0..n * n).map(|i| if white && i == y * n + x { 255 } else { 0 }).collect();
            png8(n, n, ColorType::Grayscale, &data)
        };
        // The integral ∫ (1 + x² + y²)^(−3/2) over the texel, by many points.
        let steps = 400;
        let mut angle = 0.0;
        for i in 0..steps {
            for j in 0..steps {
                let along = |texel: u32, k: u32| {
                    2.0 * (f64::from(texel) + (f64::from(k) + 0.5) / f64::from(steps)) / f64::from(n) - 1.0
                };
                let (p, q) = (along(x, i), along(y, j));
                angle += (1.0 + p * p + q * q).powf(-1.5) * (2.0 / f64::from(n) / f64::from(steps)).powi(2);
            }
        }
        for filter in ["filter \"bilinear\"", "filter \"nearest\""] {
            let text = format!(
                "environment \"cube\" ambient=#true {{ right \"w.png\"; left \"b.png\"; top \"b.png\"; bottom \"b.png\"; front \"b.png\"; back \"b.png\"; {filter} }}"
            );
            let seen = ambient(&text, &[("w.png", face(true)), ("b.png", face(false))]);
            close(&format!("texel {x}, {y}, {filter}"), seen.g, angle / (4.0 * PI), 1e-4);
        }
    }
}

// Tests of depth.

/// Depth is the distance of the position from the eye: through a lens, behind holes, and while the camera moves.
#[test]
fn depth_is_measured_from_the_eye() {
    let size = 16;
    let leaf: Vec<u8> = (0..64).flat_map(|i| [90, 90, 90, if i % 3 == 0 { 255 } else { 0 }]).collect();
    let files = [("leaf.png", png8(8, 8, ColorType::Rgba, &leaf))];
    let text = |film: &str, camera: &str, more: &str| {
        format!(
            "film {{ {film} }}
            camera {{ eye 1 2 6; center 0 0.3 0; fovy 50; size {size} {size}; {camera} }}
            {more}
            plane {{ point 0 -1 0; normal 0 1 0 }}
            sphere {{ center 0 0 0; radius 1 }}
            ambient 1"
        )
    };
    let holes = "texture \"c\" file=\"leaf.png\" { filter \"nearest\"; prefilter \"none\" }
        material \"m\" { texture \"c\" use=\"cutout\" mapping=\"planar\" space=\"world\" }
        disk material=\"m\" { center 0 0 2; normal 0 0 1; radius 3 }";
    for film in ["samples 4", "sample \"center\"", "sample \"jittered\" n=2", "samples 5; filter \"mitchell\""] {
        for (camera, more) in [
            ("", ""),
            ("lens { radius 0.8 }", ""),
            ("", holes),
            ("lens { radius 0.8 }", holes),
            ("motion { eye 2 2 6 }", ""),
            ("lens { radius 0.8 }; motion { eye 2 2 6 }", ""),
        ] {
            let scene = scene(&text(film, camera, more), &files);
            let job = Job { aovs: vec![Aov::Depth, Aov::Position], ..job(&scene) };
            let world = World::build(scene).unwrap();
            let seen = render(&world, &job, &()).unwrap().picture;
            let (depth, position) = (&seen.layer("depth").unwrap().data, &seen.layer("position").unwrap().data);
            for (i, (depth, p)) in depth.iter().zip(position.chunks_exact(3)).enumerate() {
                let tree = explain(&world, &job, i as u32 % size, i as u32 / size).unwrap();
                let time = tree.samples[0].time.unwrap_or(0.0);
                let eye = job.camera.at(time).eye().to_array();
                let distance = (0..3).map(|c| (f64::from(p[c]) - eye[c]).powi(2)).sum::<f64>().sqrt();
                assert!(
                    depth.is_infinite() || (f64::from(*depth) - distance).abs() < 1e-5 * distance,
                    "{film}; {camera}; {}: {depth} instead of {distance} in pixel {i}",
                    !more.is_empty()
                );
            }
        }
    }
}

#[test]
fn alpha_is_the_share_that_surfaces_cover() {
    // A square of side 2 at distance 4 in a picture of 4 x 4 there: a quarter is covered. Of the rest behind it, one
    // half shows through, and glass counts as covered.
    let alpha = |materials: &str, front: &str, behind: &str| {
        let scene = scene(
            &format!(
                "camera {{ eye 0 0 4; center 0 0 0; fovy 53.13010235415598; size 32 32 }}
                film {{ samples 64; filter \"box\" }}
                background 0.2 0.4 0.9
                light \"omni\" {{ position 5 5 5; intensity 1 }}
                material \"m\" {{ kd 0.5 0.5 0.5; {materials} }}
                {front}
                {behind}"
            ),
            &[],
        );
        let job = Job { aovs: vec![Aov::Alpha], ..job(&scene) };
        let picture = render(&World::build(scene).unwrap(), &job, &()).unwrap().picture;
        let data = &picture.layer("alpha").unwrap().data;
        (data.iter().map(|v| f64::from(*v)).sum::<f64>() / data.len() as f64, data[16 * 32 + 16])
    };
    let square = |z: f32| {
        format!(
            "triangle material=\"m\" {{ a -1 -1 {z}; b 1 -1 {z}; c 1 1 {z} }}
            triangle material=\"m\" {{ a -1 -1 {z}; b 1 1 {z}; c -1 1 {z} }}"
        )
    };
    let near = |(mean, middle): (f64, f32), wanted: f64, in_middle: f32| {
        assert!((mean - wanted).abs() < 2e-3 && (middle - in_middle).abs() < 1e-6, "{mean} {middle}");
    };
    near(alpha("", &square(0.0), ""), 0.25, 1.0);
    near(alpha("coverage 0.5", &square(0.0), ""), 0.125, 0.5);
    // The second square is seen through the first: 1 - 0.5 * 0.5, and it is as large as 4/5 of the first.
    near(alpha("coverage 0.5", &square(0.0), &square(-1.0)), 0.25 * (0.5 + 0.64 * 0.25), 0.75);
    near(alpha("opacity 0.2; eta 1.5", &square(0.0), ""), 0.25, 1.0);
    near(alpha("k 1", &square(10.0), ""), 0.0, 0.0);
}
