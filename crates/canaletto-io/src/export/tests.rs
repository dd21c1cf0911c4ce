//! Exported files, read back by readers of their own.

use super::*;
use crate::picture::{Decoded, decode};
use canaletto::bake::{BakeSettings, BakedVertex, TexelDensity};
use canaletto::integrator::radiosity::RadiositySolution;
use canaletto::material::{Material, Phong};
use canaletto::scene::{CameraProjection, Developing, Node, RadiositySettings, Scene};
use canaletto::shape::{Cuboid, Shape, Sphere};
use canaletto::world::World;
use glam::DQuat;
use serde_json::{Value, json};

/// A room with a lamp, a ball and a glass box.
fn scene() -> Scene {
    let material = |name: &str, kd: [f32; 3], emission: f32| {
        Material::new(name, Phong { kd: kd.into(), emission: Rgb::gray(emission), ..Phong::default() })
    };
    let mut glass = material("glass pane", [0.1, 0.2, 0.3], 0.0);
    glass.model = Phong { opacity: 0.25, ..glass.classic() }.into();
    let cuboid = |min: [f32; 3], max: [f32; 3]| Shape::Box(Cuboid { min: min.into(), max: max.into() });
    let ball = Shape::Sphere(Sphere { center: Vec3::new(0.0, -0.5, 0.0), radius: 0.5 });
    let nodes = vec![
        Node::from(cuboid([-1.0; 3], [1.0; 3])).with_material(0).named("room"),
        Node::from(cuboid([-0.3, 0.8, -0.3], [0.3, 0.9, 0.3])).with_material(1).named("lamp"),
        Node::from(ball).with_material(0).named("ball"),
        Node::from(cuboid([-0.9, -0.9, 0.7], [0.9, 0.0, 0.8])).with_material(2).named("pane"),
    ];
    let materials = vec![material("wall", [0.6, 0.5, 0.4], 0.0), material("lamp", [0.0; 3], 6.0), glass];
    let view = View {
        name: "main".into(),
        intrinsics: canaletto::scene::Intrinsics::default(),
        extrinsics: canaletto::scene::Extrinsics {
            eye: DVec3::new(0.5, 0.25, 0.9),
            center: DVec3::new(-0.25, -0.5, -1.0),
            up: DVec3::Y,
        },
        motion: Vec::new(),
    };
    Scene { materials, nodes, views: vec![view], ..Scene::default() }
}

fn baked() -> (World, BakedScene) {
    let world = World::build(scene()).unwrap();
    let radiosity = RadiositySettings { error: 0.1, ..RadiositySettings::DEFAULT };
    let solution = RadiositySolution::solve(&world, &radiosity, &()).unwrap();
    let settings = BakeSettings { density: TexelDensity::ForSide(128), dark_sides: true };
    let baked = BakedScene::bake(&world, (&solution, &radiosity), &settings, &()).unwrap();
    (world, baked)
}

struct Exported {
    world: World,
    baked: BakedScene,
    views: Vec<View>,
    developing: Developing,
}

impl Exported {
    fn new() -> Exported {
        let (world, baked) = baked();
        Exported { world, baked, views: scene().views, developing: Developing::default() }
    }

    fn files(&self, format: ExportFormat, maps: LightMaps, up: UpAxis, origin: DVec3) -> Vec<ExportedFile> {
        let export = Export {
            baked: &self.baked,
            materials: self.world.materials(),
            origin,
            views: &self.views,
            developing: self.developing,
            up,
            maps,
            stem: "room",
        };
        format.files(&export).unwrap()
    }
}

/// A GLB file: its JSON and its binary chunk.
struct Glb {
    root: Value,
    binary: Vec<u8>,
}

impl Glb {
    fn read(bytes: &[u8]) -> Glb {
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], number(4), number(8)), (&b"glTF"[..], 2, bytes.len()));
        let length = number(12);
        assert_eq!((&bytes[16..20], length % 4), (&b"JSON"[..], 0));
        let root: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        let at = 20 + length;
        assert_eq!((&bytes[at + 4..at + 8], number(at) % 4), (&b"BIN\0"[..], 0));
        let binary = bytes[at + 8..].to_vec();
        assert_eq!(binary.len(), number(at));
        let announced = root["buffers"][0]["byteLength"].as_u64().unwrap() as usize;
        assert!(announced <= binary.len() && binary.len() < announced + 4);
        Glb { root, binary }
    }

    fn view(&self, view: &Value) -> &[u8] {
        let view = &self.root["bufferViews"][view.as_u64().unwrap() as usize];
        let [at, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
        &self.binary[at..at + length]
    }

    /// The components of an accessor's elements.
    fn numbers(&self, accessor: &Value) -> Vec<[f32; 4]> {
        let accessor = &self.root["accessors"][accessor.as_u64().unwrap() as usize];
        let bytes = self.view(&accessor["bufferView"]);
        let count = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            other => panic!("{other}"),
        };
        let stride = self.root["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize]["byteStride"].as_u64();
        let stride = stride.map_or(4 * count, |stride| stride as usize);
        let at = accessor["byteOffset"].as_u64().unwrap() as usize;
        let is_float = accessor["componentType"] == FLOAT_TYPE;
        let element = |i: usize| {
            let mut element = [0.0; 4];
            for (k, value) in element.iter_mut().enumerate().take(count) {
                let from = at + i * stride + 4 * k;
                let four = bytes[from..from + 4].try_into().unwrap();
                *value = if is_float { f32::from_le_bytes(four) } else { u32::from_le_bytes(four) as f32 };
            }
            element
        };
        let all: Vec<[f32; 4]> = (0..accessor["count"].as_u64().unwrap() as usize).map(element).collect();
        for (key, fold) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
            if let Some(bounds) = accessor[key].as_array() {
                for (k, bound) in bounds.iter().enumerate() {
                    let found = all.iter().map(|element| element[k]).reduce(fold).unwrap();
                    assert_eq!(bound.as_f64(), Some(f64::from(found)));
                }
            }
        }
        all
    }

    fn image(&self) -> Decoded {
        decode(self.view(&self.root["images"][0]["bufferView"])).unwrap()
    }
}

const FLOAT_TYPE: u32 = 5126;

#[test]
fn a_glb_holds_the_triangles_and_the_light_map() {
    let exported = Exported::new();
    let files = exported.files(ExportFormat::Glb, LightMaps::Combined, UpAxis::Y, DVec3::ZERO);
    assert_eq!(files.iter().map(|file| file.ending).collect::<Vec<_>>(), [".glb"]);
    let glb = Glb::read(&files[0].bytes);
    let root = &glb.root;
    assert_eq!(root["asset"]["version"], "2.0");
    assert_eq!(root["extensionsUsed"].as_array().unwrap(), &["KHR_materials_unlit"]);
    let names: Vec<&str> = root["nodes"].as_array().unwrap().iter().map(|n| n["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["room", "lamp", "ball", "pane", "main"]);
    for (mesh, own) in root["meshes"].as_array().unwrap().iter().zip(&exported.baked.meshes) {
        for (primitive, part) in mesh["primitives"].as_array().unwrap().iter().zip(&own.parts) {
            let attribute = |name: &str, of: fn(&BakedVertex) -> [f32; 4]| {
                let expected: Vec<[f32; 4]> = part.vertices.iter().map(of).collect();
                assert!(glb.numbers(&primitive["attributes"][name]) == expected, "{name}");
            };
            attribute("POSITION", |v| v.position.extend(0.0).to_array());
            attribute("NORMAL", |v| v.normal.extend(0.0).to_array());
            attribute("TEXCOORD_0", |v| [v.uv.x, 1.0 - v.uv.y, 0.0, 0.0]);
            attribute("TEXCOORD_1", |v| [v.light_uv.x, v.light_uv.y, 0.0, 0.0]);
            let indices: Vec<f32> = glb.numbers(&primitive["indices"]).iter().map(|element| element[0]).collect();
            assert!(indices == part.triangles.as_flattened().iter().map(|&i| i as f32).collect::<Vec<_>>());
            let material = &root["materials"][primitive["material"].as_u64().unwrap() as usize];
            let source = &exported.world.materials()[part.material as usize];
            assert_eq!(material["name"], source.name);
            assert_eq!(material["alphaMode"] == "BLEND", source.name == "glass pane");
            let texture = &material["pbrMetallicRoughness"]["baseColorTexture"];
            assert_eq!((texture["index"].as_u64(), texture["texCoord"].as_u64()), (Some(0), Some(1)));
        }
    }
    let atlas = &exported.baked.atlas;
    let image = glb.image().image;
    assert_eq!((image.width, image.height), (atlas.width, atlas.height));
    for (texel, color) in atlas.radiance.iter().enumerate() {
        let shown = canaletto::film::srgb_encode(color[0].clamp(0.0, 1.0));
        let stored = image.channel("R").unwrap()[texel];
        assert!((stored - shown).abs() <= 0.51 / 255.0, "{stored} for {shown}");
    }
    assert!(image.channel("A").unwrap().contains(&(64.0 / 255.0)), "glass lets light through");
}

#[test]
fn the_light_alone_is_in_an_exr_that_materials_name() {
    let exported = Exported::new();
    let files = exported.files(ExportFormat::Glb, LightMaps::Light, UpAxis::Y, DVec3::ZERO);
    assert_eq!(files.iter().map(|file| file.ending).collect::<Vec<_>>(), [".glb", ".light.exr"]);
    let root = Glb::read(&files[0].bytes).root;
    let material = |name: &str| root["materials"].as_array().unwrap().iter().find(|m| m["name"] == name).unwrap();
    let wall = material("wall");
    let color = wall["pbrMetallicRoughness"]["baseColorFactor"].as_array().unwrap();
    let color: Vec<f32> = color.iter().map(|v| v.as_f64().unwrap() as f32).collect();
    assert_eq!(color, [0.6, 0.5, 0.4, 1.0]);
    assert_eq!(wall["extras"]["lightMap"]["file"], "room.light.exr");
    assert_eq!(wall["extras"]["lightMap"]["texCoord"], 1);
    let lamp = material("lamp");
    assert_eq!(lamp["emissiveFactor"], serde_json::json!([1.0, 1.0, 1.0]));
    assert_eq!(lamp["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 6.0);
    let light = decode(&files[1].bytes).unwrap().image;
    for (texel, light_there) in exported.baked.atlas.light.iter().enumerate() {
        assert_eq!(light.channel("G").unwrap()[texel], light_there[1] * PI);
    }
}

/// The room with z upwards is the room with y upwards, turned.
#[test]
fn axes_are_turned_and_far_places_kept() {
    for (axis, vector) in [(UpAxis::X, DVec3::X), (UpAxis::Y, DVec3::Y), (UpAxis::Z, DVec3::Z)] {
        assert_eq!(axis.turn(vector), DVec3::Y);
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| axis.turn(v));
        assert_eq!(x.cross(y), z, "a turn mirrors nothing");
        let view = View { extrinsics: canaletto::scene::Extrinsics { up: vector, ..Default::default() }, ..view() };
        assert_eq!(UpAxis::of_view(&view), axis);
    }
    let exported = Exported::new();
    let far = DVec3::new(1e7, 2e7, 3e7 + 0.125);
    let file = &exported.files(ExportFormat::Glb, LightMaps::Combined, UpAxis::Z, far)[0];
    let root = Glb::read(&file.bytes).root;
    let translation = root["nodes"][0]["translation"].as_array().unwrap();
    assert_eq!(translation.iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>(), [1e7, 3e7 + 0.125, -2e7]);
}

fn view() -> View {
    scene().views.remove(0)
}

#[test]
fn cameras_look_along_minus_z() {
    let exported = Exported::new();
    let file = &exported.files(ExportFormat::Glb, LightMaps::Combined, UpAxis::Y, DVec3::ZERO)[0];
    let root = Glb::read(&file.bytes).root;
    let node = root["nodes"].as_array().unwrap().iter().find(|node| node["camera"].is_u64()).unwrap();
    let rotation: Vec<f64> = node["rotation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let rotation = DQuat::from_slice(&rotation);
    let camera = canaletto::camera::Camera::of(&view()).unwrap();
    for (axis, own) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(camera.axes()) {
        assert!((rotation * axis).distance(own) < 1e-12, "{axis}");
    }
    assert!((root["cameras"][0]["perspective"]["yfov"].as_f64().unwrap() - 60_f64.to_radians()).abs() < 1e-12);
}

#[test]
fn an_orthographic_camera_has_half_sizes_and_planes_around_all() {
    let mut exported = Exported::new();
    let lens = &mut exported.views[0].intrinsics;
    (lens.projection, lens.width, lens.height) = (CameraProjection::Orthographic { height: 3.0 }, 200, 100);
    let camera = |exported: &Exported| {
        let file = &exported.files(ExportFormat::Glb, LightMaps::Combined, UpAxis::Y, DVec3::ZERO)[0];
        Glb::read(&file.bytes).root["cameras"][0].clone()
    };
    let found = camera(&exported);
    assert_eq!((&found["type"], &found["perspective"]), (&json!("orthographic"), &Value::Null));
    let number = |name: &str| found["orthographic"][name].as_f64().unwrap();
    assert_eq!(["xmag", "ymag", "znear"].map(number), [3.0, 1.5, 0.0]);
    let own = canaletto::camera::Camera::of(&exported.views[0]).unwrap();
    let vertices = exported.baked.meshes.iter().flat_map(|mesh| &mesh.parts).flat_map(|part| &part.vertices);
    let farthest = vertices.map(|vertex| own.distance(vertex.position.as_dvec3())).fold(0.0, f64::max);
    assert!(farthest > 0.0 && number("zfar") > farthest, "{farthest}");
    let lens = &mut exported.views[0].intrinsics;
    (lens.near, lens.far) = (Some(0.5), Some(7.0));
    let found = camera(&exported);
    assert_eq!((&found["orthographic"]["znear"], &found["orthographic"]["zfar"]), (&json!(0.5), &json!(7.0)));
}

#[test]
fn an_obj_has_the_light_map_as_its_texture() {
    let exported = Exported::new();
    let files = exported.files(ExportFormat::Obj, LightMaps::Combined, UpAxis::Y, DVec3::ZERO);
    assert_eq!(files.iter().map(|file| file.ending).collect::<Vec<_>>(), [".obj", ".mtl", ".png", ".light.exr"]);
    let [model, library] = [0, 1].map(|i| String::from_utf8(files[i].bytes.clone()).unwrap());
    let words = |word: &str| -> Vec<Vec<String>> {
        let lines = model.lines().filter_map(|line| line.strip_prefix(&format!("{word} ")));
        lines.map(|line| line.split(' ').map(str::to_owned).collect()).collect()
    };
    assert_eq!(words("mtllib"), [["room.mtl"]]);
    let parts: Vec<_> = exported.baked.meshes.iter().flat_map(|mesh| &mesh.parts).collect();
    let vertices: Vec<BakedVertex> = parts.iter().flat_map(|part| part.vertices.clone()).collect();
    let (places, coordinates) = (words("v"), words("vt"));
    assert_eq!((places.len(), coordinates.len()), (vertices.len(), vertices.len()));
    for ((place, coordinate), vertex) in places.iter().zip(&coordinates).zip(&vertices) {
        let numbers = |words: &[String]| words.iter().map(|word| word.parse::<f32>().unwrap()).collect::<Vec<_>>();
        assert_eq!(numbers(place), vertex.position.to_array());
        assert_eq!(numbers(coordinate), [vertex.light_uv.x, 1.0 - vertex.light_uv.y]);
    }
    let triangles: usize = parts.iter().map(|part| part.triangles.len()).sum();
    assert_eq!(words("f").len(), triangles);
    assert!(library.contains("newmtl glass_pane\n") && library.contains("map_Kd room.png\n"));
    let used: Vec<String> = words("usemtl").into_iter().flatten().collect();
    assert!(used.iter().all(|name| library.contains(&format!("newmtl {name}\n"))));
}
