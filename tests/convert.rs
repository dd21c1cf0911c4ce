//! Scenes and models in other forms show the same picture.

use canaletto::camera::Camera;
use canaletto::film::Picture;
use canaletto::render::{Job, render};
use canaletto::scene::{Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::{Asset, AssetError, AssetPath, Assets, FolderAssets, MemoryAssets};
use canaletto_io::export::convert::{Conversion, ConvertFormat, Originals, Source, convert};
use canaletto_io::import::Staging;
use canaletto_io::scene_file::open;
use canaletto_tests::{assert_same_picture, root};
use serde_json::{Value, json};

/// The scene of a file. Models get what they lack for paths, for the classic integrators, or nothing.
fn read(file: &str, assets: &dyn Assets, staging: &Staging) -> Scene {
    let mut source = open(file, assets, &[], staging).unwrap_or_else(|e| panic!("{file}: {e:?}"));
    source.scene(assets, 0.0).unwrap_or_else(|e| panic!("{file}: {e}")).0
}

/// A small picture by the scene's integrator.
fn picture(scene: &Scene, [width, height]: [u32; 2], samples: u32) -> Picture {
    let mut view = scene.views[0].clone();
    (view.intrinsics.width, view.intrinsics.height) = (width, height);
    let mut film = scene.film;
    if !scene.integrator.eq(&canaletto::scene::Integrator::default()) {
        film.sampling = Sampling::Sampled(samples);
    }
    let world = World::build(scene.clone()).unwrap();
    render(&world, &Job::new(Camera::of(&view).unwrap(), film, scene.integrator), &()).unwrap().picture
}

fn converted(scene: &Scene, format: ConvertFormat, originals: &Originals, is_model: bool) -> Conversion {
    let source =
        Source { scene, originals, stem: "out", has_default_material: !is_model, remarks: vec!["a remark".into()] };
    convert(&source, format)
}

fn assets_of(conversion: &Conversion) -> MemoryAssets {
    let files = conversion.files.iter();
    files.fold(MemoryAssets::new(), |assets, file| assets.with(&file.name, file.bytes.clone()))
}

/// Checks that the scene text of a file shows its pictures, by paths and by the classic integrator.
fn stays_in_text(file: &str, assets: &dyn Assets, originals: &Originals) -> String {
    let mut text = String::new();
    for staging in [Staging::default(), Staging::classic()] {
        let scene = read(file, assets, &staging);
        let made = converted(&scene, ConvertFormat::Text, originals, false);
        assert!(made.lost.is_empty(), "{file}: {:?}", made.lost);
        let again = read("out.kdl", &assets_of(&made), &Staging::default());
        assert_same_picture(&picture(&again, [40, 30], 4), &picture(&scene, [40, 30], 4), file);
        text = String::from_utf8(made.files[0].bytes.clone()).unwrap();
    }
    text
}

/// The mean difference of two pictures' numbers.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let pairs = || a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| a.to_array().into_iter().zip(b.to_array()));
    pairs().map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / pairs().count() as f64
}

#[test]
fn models_keep_their_pictures_as_scene_text() {
    let assets = FolderAssets::new(root().join("scenes/models")).unwrap();
    for file in ["spot.obj", "globe.obj", "ring.obj", "tin.ply", "cake.glb"] {
        stays_in_text(file, &assets, &Originals::new());
    }
}

/// A quad with all that a vertex can have, in several materials, placed by instances, turned and sheared nodes, with a
/// camera and lights.
fn rich_model() -> MemoryAssets {
    let corners = [[-1.0f32, -1.0, 0.0], [1.0, -1.0, 0.3], [1.0, 1.0, 0.1], [-1.0, 1.0, 0.0]];
    let mut bytes = Vec::new();
    let mut views: Vec<Value> = Vec::new();
    let mut accessors: Vec<Value> = Vec::new();
    let mut add = |numbers: Vec<f32>, kind: &str| {
        let count = numbers.len() / kind[3..].parse::<usize>().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * numbers.len() }));
        bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        accessors.push(json!({ "bufferView": views.len() - 1, "componentType": 5126, "count": count, "type": kind }));
        accessors.len() - 1
    };
    let each = |of: fn([f32; 3]) -> Vec<f32>| corners.iter().flat_map(|p| of(*p)).collect::<Vec<f32>>();
    let attributes = json!({
        "POSITION": add(each(|p| p.to_vec()), "VEC3"),
        "NORMAL": add(each(|[x, y, _]| vec![0.1 * x, 0.2 * y, 0.97]), "VEC3"),
        "TANGENT": add(each(|_| vec![1.0, 0.0, 0.0, -1.0]), "VEC4"),
        "TEXCOORD_0": add(each(|[x, y, _]| vec![0.5 + 0.4 * x, 0.3 - 0.4 * y]), "VEC2"),
        "TEXCOORD_1": add(each(|[x, y, _]| vec![y, x]), "VEC2"),
        "COLOR_0": add(each(|[x, y, z]| vec![0.6 + 0.3 * x, 0.5, 0.7 + z, 0.8 + 0.2 * y]), "VEC4"),
    });
    // What lies at one place is no case for comparisons.
    let behind = add(each(|[x, y, z]| vec![x, y, z - 0.4]), "VEC3");
    let plain = json!({ "POSITION": behind, "TEXCOORD_0": 3 });
    let places = add(vec![-3.0, 0.0, 0.0, 3.0, 0.5, -1.0], "VEC3");
    views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": 6 }));
    bytes.extend([0u8, 1, 2, 0, 2, 3]);
    accessors.push(json!({ "bufferView": views.len() - 1, "componentType": 5121, "count": 6, "type": "SCALAR" }));
    let indices = accessors.len() - 1;
    let moved = json!({ "KHR_texture_transform": { "offset": [0.1, 0.2], "rotation": 0.5, "scale": [2.0, 3.0] } });
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_texture_transform", "KHR_materials_clearcoat", "KHR_materials_transmission",
            "KHR_materials_volume", "KHR_lights_punctual", "EXT_mesh_gpu_instancing", "KHR_materials_unlit"],
        "buffers": [{ "uri": "b.bin", "byteLength": bytes.len() }],
        "bufferViews": views, "accessors": accessors,
        "images": [{ "uri": "p.png" }],
        "samplers": [{ "wrapS": 33648, "wrapT": 33071, "magFilter": 9728 }],
        "textures": [{ "source": 0, "sampler": 0 }, { "source": 0, "name": "odd \"name\"\\" }],
        "materials": [
            { "name": "all \"of\" it", "alphaMode": "BLEND", "doubleSided": true,
              "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "baseColorFactor": [0.9, 0.8, 0.7, 0.9],
                  "metallicRoughnessTexture": { "index": 1, "texCoord": 1, "extensions": moved },
                  "metallicFactor": 0.4 },
              "normalTexture": { "index": 1, "scale": 0.5 },
              "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 0.7,
                  "clearcoatTexture": { "index": 1, "extensions": moved } } } },
            { "alphaMode": "MASK", "alphaCutoff": 0.4, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } },
            { "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 }, "KHR_materials_volume":
                { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [0.5, 0.9, 0.7] } } },
            { "extensions": { "KHR_materials_unlit": {} }, "emissiveFactor": [0.1, 0.2, 0.3] },
        ],
        "meshes": [
            { "name": "a/b", "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 },
                { "attributes": plain, "indices": indices, "material": 1 }] },
            { "primitives": [{ "attributes": plain, "indices": indices, "material": 2 }] },
            { "primitives": [{ "attributes": attributes, "indices": indices, "material": 3 }] },
            { "primitives": [{ "attributes": plain, "indices": indices, "material": 1 }] },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.9, "znear": 0.1, "aspectRatio": 1.3 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "type": "point", "intensity": 40, "color": [1, 0.8, 0.6], "range": 20 },
            { "type": "spot", "intensity": 90, "spot": { "innerConeAngle": 0.2, "outerConeAngle": 0.6 } },
            { "type": "directional", "intensity": 1.5, "name": "sun" }] } },
        "nodes": [
            { "mesh": 0, "rotation": [0.1, 0.2, 0.3, 0.927], "scale": [1.0, 1.5, 0.7], "name": "twice" },
            { "mesh": 1, "translation": [0.3, 0.4, 1.0], "scale": [0.5, 0.5, 0.5], "name": "twice" },
            { "mesh": 2, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places } } } },
            { "scale": [1.0, 2.0, 1.0], "children": [4], "translation": [0.0, -2.0, -1.0] },
            { "mesh": 3, "rotation": [0.0, 0.0, 0.383, 0.924] },
            { "camera": 0, "translation": [0.5, 0.7, 7.0] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } }, "translation": [0.0, 3.0, 4.0] },
            { "extensions": { "KHR_lights_punctual": { "light": 1 } }, "translation": [1.0, 1.0, 6.0] },
            { "extensions": { "KHR_lights_punctual": { "light": 2 } }, "rotation": [-0.3, 0.2, 0.0, 0.93] },
        ],
        "scenes": [{ "nodes": [0, 1, 2, 3, 5, 6, 7, 8] }],
    });
    MemoryAssets::new().with("m.gltf", document.to_string()).with("b.bin", bytes).with("p.png", small_png())
}

/// A picture of 4 × 4 texels with alpha.
fn small_png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 4, 4);
    encoder.set_color(png::ColorType::Rgba);
    let texels: Vec<u8> = (0..64u8).map(|i| if i % 4 == 3 { 255 - i } else { i.wrapping_mul(37) }).collect();
    encoder.write_header().unwrap().write_image_data(&texels).unwrap();
    bytes
}

#[test]
fn a_rich_gltf_keeps_its_picture_as_scene_text_and_as_gltf() {
    let assets = rich_model();
    let mut originals = Originals::new();
    originals.add(&AssetPath::new("p.png", "p.png", "p.png"), small_png(), &assets);
    let text = stays_in_text("m.gltf", &assets, &originals);
    assert!(text.contains("material \"all \\\"of\\\" it\"") && text.contains("mesh \"twice (2)\""), "{text}");
    let scene = read("m.gltf", &assets, &Staging::default());
    let made = converted(&scene, ConvertFormat::Text, &originals, false);
    let kept = made.files.iter().find(|file| file.name == "out.assets/p.png").unwrap();
    assert_eq!(kept.bytes, small_png(), "the picture's own bytes");

    for format in [ConvertFormat::Glb, ConvertFormat::Gltf] {
        let bare = read("m.gltf", &assets, &Staging { bare: true, ..Staging::default() });
        let made = converted(&bare, format, &originals, true);
        assert!(made.lost.is_empty(), "{:?}", made.lost);
        let again = read(&made.files[0].name, &assets_of(&made), &Staging::default());
        let off = difference(&picture(&again, [40, 30], 16), &picture(&scene, [40, 30], 16));
        assert!(off < 1e-3, "{off}");
        assert_eq!(again.views.len(), 1);
    }
}

#[test]
fn a_cake_is_the_same_as_gltf() {
    let assets = FolderAssets::new(root().join("scenes/models")).unwrap();
    let scene = read("cake.glb", &assets, &Staging::default());
    let bare = read("cake.glb", &assets, &Staging { bare: true, ..Staging::default() });
    let made = converted(&bare, ConvertFormat::Glb, &Originals::new(), true);
    assert!(made.lost.is_empty(), "{:?}", made.lost);
    let again = read("out.glb", &assets_of(&made), &Staging::default());
    let off = difference(&picture(&again, [40, 30], 16), &picture(&scene, [40, 30], 16));
    assert!(off < 1e-3, "{off}");
}

/// Shapes, a cloud, instances, lights and procedural textures.
const SHAPES: &str = r#"
camera { eye 0 3 9; center 0 1 0; fovy 40 }
material "red" { kd 0.7 0.1 0.1 }
material "blue" { kd 0.1 0.2 0.7 }
texture "t" kind="marble"
material "veined" { texture "t" }
sphere "ball" material="red" { center 0 1 0; radius 1 }
instance "ball" { scale 0.5; translate 2 0 1 }
group "tower" material="blue" { rotate-y 30; box { min -3 0 0; max -2 2 1 }
  cone { base -2.5 2 0.5; top -2.5 3 0.5; radius 0.6 } }
plane "floor" { point 0 0 0; normal 0 1 0 }
spheres "beads" radius=0.2 material="red" { points 1 0.2 2  1.5 0.2 2.2 }
torus "ring" material="veined" { center 0 0.3 2; axis 0 1 0; radius 0.5; tube 0.2 }
light "omni" { position 3 6 5; intensity 60; attenuation 0 0 1 }
light "disk" name="lamp" { position 0 9 0; normal 0 -1 0; radius 1 }
background 0.2
"#;

#[test]
fn shapes_become_triangles_and_what_is_lost_is_told() {
    let assets = MemoryAssets::new().with("s.kdl", SHAPES);
    let scene = read("s.kdl", &assets, &Staging::default());
    let world = |scene: &Scene| World::build(scene.clone()).unwrap().bounds();
    for (format, expected) in [
        (
            ConvertFormat::Glb,
            vec![
                "lights with a surface (1): \"lamp\"",
                "textures that are computed or projected (1): \"veined\"",
                "the background's colour",
                "the rest of planes, which have ends there (1): \"floor\"",
            ],
        ),
        (
            ConvertFormat::Obj,
            vec![
                "cameras (1): \"camera\"",
                "lights (2): \"unnamed\", \"lamp\"",
                "textures that are computed, projected or for other numbers (1): \"veined\"",
                "the background's colour",
                "the rest of planes, which have ends there (1): \"floor\"",
            ],
        ),
        (
            ConvertFormat::Ply,
            vec![
                "all of materials but their diffuse colour (1): \"veined\"",
                "cameras (1): \"camera\"",
                "lights (2): \"unnamed\", \"lamp\"",
                "the background's colour",
                "the rest of planes, which have ends there (1): \"floor\"",
            ],
        ),
    ] {
        let made = converted(&scene, format, &Originals::new(), false);
        let mut lost: Vec<String> = made.lost.iter().map(ToString::to_string).collect();
        lost.sort();
        assert_eq!(lost, expected, "{format:?}");
        let again = read(&made.files[0].name, &assets_of(&made), &Staging { bare: true, ..Staging::default() });
        let [whole, own] = [world(&again), world(&scene)];
        // The floor ends; all else keeps its place.
        assert!((whole.max.y - own.max.y).abs() < 1e-3 && whole.max.x > 5.0, "{format:?}: {whole:?} for {own:?}");
    }
    // All colours, in a file of one mesh.
    let made = converted(&scene, ConvertFormat::Ply, &Originals::new(), false);
    let again = read("out.ply", &assets_of(&made), &Staging { bare: true, ..Staging::default() });
    let found = |rgb: [f32; 3]| {
        let near = |color: &canaletto::math::Rgb| color.to_array().iter().zip(rgb).all(|(a, b)| (a - b).abs() < 5e-3);
        again.meshes[0].colors.iter().any(near)
    };
    assert!(found([0.7, 0.1, 0.1]) && found([0.1, 0.2, 0.7]) && found([0.8; 3]));
}

/// Assets that have no file.
struct Nothing;

impl Assets for Nothing {
    fn read(&self, path: &str, _: &AssetPath) -> Result<Asset, AssetError> {
        Err(AssetError::Missing { path: path.into(), nearest: None })
    }
}

#[test]
fn files_that_are_no_pictures_are_not_kept() {
    let mut originals = Originals::new();
    originals.add(&AssetPath::new("a.png", "a.png", "a.png"), b"no picture".to_vec(), &Nothing);
    originals.add(&AssetPath::new("a.glb", "a.glb", "a.glb"), b"glTF no model".to_vec(), &Nothing);
    let scene = read("m.gltf", &rich_model(), &Staging::default());
    let made = converted(&scene, ConvertFormat::Text, &originals, false);
    assert!(made.lost.is_empty(), "{:?}", made.lost);
}
