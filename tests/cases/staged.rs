//! Models as `canaletto render MODEL` shows them: the light of the studio, the floor, and lights of glTF files.

use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::math::Rgb;
use canaletto::render::{Job, Rendering, render};
use canaletto::scene::{Content, Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::import::{StageLight, Staging, StandardView, load};
use canaletto_tests::gallery::icosphere;
use serde_json::json;

/// A GLB of a ball whose material is glTF's white: base colour 1, not metal, rough.
fn ball(radius: f32) -> Vec<u8> {
    ball_of(radius, json!({ "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0 } }] }))
}

/// A GLB of a ball of the first material of `more`. Its texture coordinates are all 0.
fn ball_of(radius: f32, more: serde_json::Value) -> Vec<u8> {
    let mesh = icosphere(3, radius, true);
    let mut bytes: Vec<u8> = Vec::new();
    let mut vectors = |list: &[glam::Vec3]| {
        let start = bytes.len();
        bytes.extend(list.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
        json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() - start })
    };
    let mut views = vec![vectors(&mesh.positions), vectors(&mesh.normals)];
    let (start, corners) = (bytes.len(), mesh.triangles.as_flattened());
    bytes.extend(corners.iter().flat_map(|v| v.to_le_bytes()));
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() - start }));
    let accessor = |view: usize, component: u32, kind: &str, count: usize| json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
    let vertices = mesh.positions.len();
    let attributes = json!({ "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 3 });
    let mut whole = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": 2, "material": 0 }] }],
        "accessors": [
            accessor(0, 5126, "VEC3", vertices), accessor(1, 5126, "VEC3", vertices),
            accessor(2, 5125, "SCALAR", corners.len()),
            { "componentType": 5126, "type": "VEC2", "count": vertices },
        ],
        "bufferViews": views,
    });
    for (key, value) in more.as_object().unwrap() {
        whole[key] = value.clone();
    }
    document(whole, &bytes)
}

/// A GLB of a document without version and buffer, and of the buffer's bytes.
fn document(mut json: serde_json::Value, bytes: &[u8]) -> Vec<u8> {
    json["asset"] = json!({ "version": "2.0" });
    json["buffers"] = json!([{ "byteLength": bytes.len() }]);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |v: usize| (v as u32).to_le_bytes();
    let length = 28 + text.len() + bytes.len();
    [b"glTF", &word(2)[..], &word(length), &word(text.len()), b"JSON", &text, &word(bytes.len()), b"BIN\0", bytes]
        .concat()
}

fn staged(glb: Vec<u8>, staging: &Staging) -> Scene {
    let assets = MemoryAssets::new().with("m.glb", glb).with("p.png", pixel([200, 100, 50, 128]));
    load("m.glb", &assets, staging).unwrap_or_else(|errors| panic!("{errors}")).0
}

/// A PNG of one pixel.
fn pixel(rgba: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&rgba).unwrap();
    bytes
}

fn rendered(mut scene: Scene, [width, height]: [u32; 2], samples: u32) -> (Rendering, Job) {
    (scene.views[0].intrinsics.width, scene.views[0].intrinsics.height) = (width, height);
    scene.film.sampling = Sampling::Sampled(samples);
    let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
    (render(&World::build(scene).unwrap(), &job, &()).unwrap(), job)
}

/// White is 0.8 to 0.9 on screen, whatever the ball's size, the side that is seen and the light are.
#[test]
fn white_is_bright_and_the_same_from_file_to_file() {
    let mean = |radius: f32, staging: Staging| {
        let mut scene = staged(ball(radius), &staging);
        // Only the ball hides what is behind it.
        scene.film.alpha = true;
        scene.nodes.retain(|node| matches!(node.content, Content::Mesh(_)));
        let (rendering, job) = rendered(scene, [48, 36], 32);
        let shown = develop(&rendering.picture, &job.developing());
        let alpha = &rendering.picture.alpha;
        let on_ball: Vec<f64> = shown.iter().zip(alpha).filter(|(_, a)| **a > 0.99).map(|(c, _)| c.g.into()).collect();
        assert!(on_ball.len() > 300, "{} pixels", on_ball.len());
        on_ball.iter().sum::<f64>() / on_ball.len() as f64
    };
    let of = |view, light| Staging { view: Some(view), light: Some(light), ..Staging::default() };
    let first = mean(1.0, Staging::default());
    for (radius, staging) in [
        (1.0, Staging::default()),
        (1e-3, Staging::default()),
        (250.0, Staging::default()),
        (1.0, of(StandardView::Front, StageLight::Studio)),
        (1.0, of(StandardView::Back, StageLight::Studio)),
        (1.0, of(StandardView::ThreeQuarter, StageLight::Neutral)),
    ] {
        let name = format!("{radius} {:?} {:?}", staging.view, staging.light);
        let found = mean(radius, staging);
        assert!((0.8..=0.9).contains(&found) && (found - first).abs() < 0.05, "{name}: {found}, the first {first}");
    }
}

/// The middle of a ball of this material under an even white sky.
fn under_white(more: serde_json::Value) -> [f64; 3] {
    let staging = Staging { view: Some(StandardView::Front), ..Staging::default() };
    let mut scene = staged(ball_of(1.0, more), &staging);
    scene.nodes.retain(|node| matches!(node.content, Content::Mesh(_)));
    (scene.environment, scene.background) = (None, Rgb::WHITE);
    scene.views[0].intrinsics.fovy = 1.0;
    let (rendering, _) = rendered(scene, [8, 8], 256);
    let sum = rendering.picture.pixels.iter().fold(Rgb::BLACK, |sum, c| sum + *c);
    (sum * (1.0 / 64.0)).to_array().map(f64::from)
}

/// Materials of pairs of extensions return the share of white light that the extensions' formulas give, seen at right
/// angles. F is the reflectance of an index of 1.5 there.
#[test]
fn extensions_of_materials_go_together() {
    const F: f64 = 0.04;
    let of = |base: serde_json::Value, extensions: serde_json::Value| {
        under_white(json!({ "materials": [{ "pbrMetallicRoughness": base, "extensions": extensions }] }))
    };
    let near = |found: [f64; 3], expected: [f64; 3], what: &str| {
        let is_near = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 0.03 * b + 1e-3);
        assert!(is_near, "{what}: {found:.4?}, not {expected:.4?}");
    };
    // KHR_materials_unlit: the base colour times its texture.
    let color = [0.75, 0.5, 0.25];
    let base = || json!({ "baseColorFactor": [0.75, 0.5, 0.25, 1], "metallicFactor": 0, "roughnessFactor": 0.02 });
    near(of(base(), json!({ "KHR_materials_unlit": {} })), color, "unlit");
    // A coat leaves 1 − F to the base, whose own reflection is F as without it.
    let dark = json!({ "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 0.02 });
    let coat = json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1 } });
    near(of(dark.clone(), coat), [F + (1.0 - F) * F; 3], "a coat over a dark base");
    near(of(dark, json!({ "KHR_materials_specular": {} })), [F; 3], "specular without a change");
    // Each crossing of the surface tints, and so does the way inside: here 2 long, with the half of red after 2.
    let clear = |distance: f64| {
        let volume = json!({ "thicknessFactor": 1, "attenuationDistance": distance, "attenuationColor": [0.5, 1, 1] });
        let transmission = json!({ "transmissionFactor": 1 });
        of(base(), json!({ "KHR_materials_transmission": transmission, "KHR_materials_volume": volume }))
    };
    let crossings = color.map(|c| F + (1.0 - F) * c * c);
    near(clear(1e6), crossings, "a tinted body");
    near(clear(2.0), [F + 0.5 * (crossings[0] - F), crossings[1], crossings[2]], "a tinted body with a volume");
    // A texture of one colour is that colour.
    let glossy = |texture: bool| {
        let linear = |v: f64| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
        let mut model = json!({ "diffuseFactor": [0.9, 0.6, 0.3, 1] });
        if texture {
            model["specularGlossinessTexture"] = json!({ "index": 0 });
        } else {
            model["specularFactor"] = json!([linear(200.0), linear(100.0), linear(50.0)]);
            model["glossinessFactor"] = json!(128.0 / 255.0);
        }
        let extensions = json!({ "KHR_materials_pbrSpecularGlossiness": model });
        under_white(json!({
            "materials": [{ "extensions": extensions }],
            "textures": [{ "source": 0 }], "images": [{ "uri": "p.png" }],
        }))
    };
    near(glossy(true), glossy(false), "specular and glossiness of a texture");
}

/// Far from the ball the floor is as bright as the background above the horizon.
#[test]
fn no_horizon_is_seen() {
    let mut scene = staged(ball(0.01), &Staging { view: Some(StandardView::Front), ..Staging::default() });
    scene.views[0].extrinsics.eye.y += 0.5;
    scene.views[0].extrinsics.center.y += 0.5;
    let background = scene.background;
    let (rendering, _) = rendered(scene, [32, 24], 64);
    let row = |y: usize| {
        let pixels = &rendering.picture.pixels[32 * y..32 * (y + 1)];
        pixels.iter().fold(Rgb::BLACK, |sum, c| sum + *c) * (1.0 / 32.0)
    };
    // The camera looks along the floor: the horizon is in the middle of the picture.
    for y in [2, 8, 14, 17, 20] {
        assert!((row(y).g / background.g - 1.0).abs() < 0.02, "row {y}: {:?}, background {background:?}", row(y));
    }
}

/// Without a background the shadow is in the alpha. Over the background's grey the picture is that with its floor.
#[test]
fn shadows_are_in_the_alpha() {
    for light in [StageLight::Studio, StageLight::Neutral, StageLight::Sky] {
        let staging = Staging { light: Some(light), ..Staging::default() };
        let with_floor = staged(ball(1.0), &staging);
        let mut cut_out = with_floor.clone();
        cut_out.film.alpha = true;
        let background = cut_out.background;
        let samples = if light == StageLight::Sky { 256 } else { 64 };
        let [(whole, _), (seen, job)] = [with_floor, cut_out].map(|scene| rendered(scene, [48, 36], samples));
        let picture = &seen.picture;
        let (mut clear, mut shadows, mut worst) = (0, 0, 0f32);
        for i in 0..picture.pixels.len() {
            let over = picture.pixels[i] + background * (1.0 - picture.opacity(i));
            let expected = whole.picture.pixels[i];
            let error = (over.luminance() - expected.luminance()) / background.luminance();
            if picture.alpha[i] == 0.0 {
                assert_eq!(picture.pixels[i], Rgb::BLACK);
                clear += u32::from(picture.shadow[i] < 0.05);
                shadows += u32::from(picture.shadow[i] > 0.1);
                // What is brighter than the background, as noise makes it, isn't shown.
                worst = worst.max(if error < 0.0 && picture.shadow[i] == 0.0 { 0.0 } else { error.abs() });
            } else if picture.alpha[i] == 1.0 {
                assert_eq!((picture.pixels[i], picture.shadow[i]), (expected, 0.0));
            }
        }
        assert!(worst < 0.02, "{light:?}: {worst}");
        assert!(clear > 300 && shadows > 30, "{light:?}: {clear} {shadows}");
        // A page that blends the numbers of the file shows the numbers of the light.
        let is_half = |i: &usize| picture.alpha[*i] == 0.0 && (0.3..0.9).contains(&picture.shadow[*i]);
        let Some(half) = (0..picture.shadow.len()).find(is_half) else { continue };
        let developer = canaletto::film::Developer::new(picture, &job.developing());
        let (color, alpha) = developer.with_alpha(picture, half);
        let page = canaletto::film::srgb_encode(0.6);
        let light = 0.6 * (1.0 - picture.shadow[half]);
        assert_eq!(color, Rgb::BLACK);
        assert!((page * (1.0 - alpha) - canaletto::film::srgb_encode(light)).abs() < 0.03);
    }
}

/// Lights of KHR_lights_punctual: E = I cos / d² and the cone's square, on a white floor that returns E / π.
#[test]
fn lights_of_gltf_have_their_units() {
    let corners = [[-9.0f32, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0], [-9.0, 0.0, -9.0]];
    let bytes: Vec<u8> = corners.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let (sin, cos) = (-45f64).to_radians().sin_cos();
    let seen = |light: serde_json::Value, at: [f64; 3], place: f64| {
        let glb = document(
            json!({
                "nodes": [
                    { "mesh": 0 },
                    // Lights shine along their -z, which is turned to -y.
                    { "translation": at, "rotation": [sin, 0, 0, cos], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
                    { "camera": 0, "translation": [place, 3, 0], "rotation": [sin, 0, 0, cos] },
                ],
                "scenes": [{ "nodes": [0, 1, 2] }], "scene": 0,
                "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.01, "aspectRatio": 1 } }],
                "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 6, "material": 0 }] }],
                // A dielectric without reflection is matte.
                "materials": [{ "extensions": { "KHR_materials_ior": { "ior": 1 } }, "pbrMetallicRoughness": { "metallicFactor": 0 } }],
                "extensions": { "KHR_lights_punctual": { "lights": [light] } },
                "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4 }],
                "bufferViews": [{ "buffer": 0, "byteLength": 48 }],
            }),
            &bytes,
        );
        let (rendering, _) = rendered(staged(glb, &Staging::default()), [4, 4], 16);
        // The mean of the pixels around the middle.
        [5, 6, 9, 10].iter().map(|i| f64::from(rendering.picture.pixels[*i].g)).sum::<f64>() / 4.0
    };
    let pi = std::f64::consts::PI;
    let near = |found: f64, expected: f64, what: &str| {
        assert!((found - expected).abs() <= 0.01 * expected + 1e-9, "{what}: {found}, expected {expected}");
    };
    let point = json!({ "type": "point", "intensity": 40 });
    near(seen(point.clone(), [0.0, 2.0, 0.0], 0.0), 40.0 / 4.0 / pi, "below a point");
    let d2: f64 = 4.0 + 2.25;
    near(seen(point, [0.0, 2.0, 0.0], 1.5), 40.0 / d2 * (2.0 / d2.sqrt()) / pi, "beside a point");
    let ranged = json!({ "type": "point", "intensity": 40, "range": 3 });
    near(seen(ranged.clone(), [0.0, 2.0, 0.0], 0.0), 10.0 / pi * (1.0 - (2.0f64 / 3.0).powi(4)), "within a range");
    near(seen(ranged, [0.0, 4.0, 0.0], 0.0), 0.0, "beyond a range");
    near(seen(json!({ "type": "directional", "intensity": 5 }), [0.0; 3], 1.0), 5.0 / pi, "a sun");
    let spot = json!({ "type": "spot", "intensity": 40, "spot": { "innerConeAngle": 0.2, "outerConeAngle": 0.9 } });
    let cos_angle = 2.0 / d2.sqrt();
    let s = (cos_angle - 0.9f64.cos()) / (0.2f64.cos() - 0.9f64.cos());
    near(seen(spot, [0.0, 2.0, 0.0], 1.5), 40.0 / d2 * cos_angle * s * s / pi, "in the cone's edge");
}
