//! Tests of the glTF reader: small documents whose results are known.

use crate::assets::AssetPath;
use crate::assets::MemoryAssets;
use crate::import::{Moment, Staging, load, load_objects};
use canaletto::light::LightKind;
use canaletto::material::{Channel, Parameter, Target};
use canaletto::math::Rgb;
use canaletto::scene::{Content, Fragment, Scene};
use glam::{DVec3, Vec2, Vec3};
use serde_json::{Value, json};

/// A document of these bytes in one buffer, each list of which has a buffer view.
struct Model {
    json: Value,
    bytes: Vec<u8>,
}

fn merge(into: &mut Value, more: Value) {
    match (into, more) {
        (Value::Object(into), Value::Object(more)) => {
            for (key, value) in more {
                merge(into.entry(key).or_insert(Value::Null), value);
            }
        }
        (into, more) => *into = more,
    }
}

impl Model {
    fn new() -> Model {
        let json = json!({ "asset": { "version": "2.0" }, "bufferViews": [], "accessors": [] });
        Model { json, bytes: Vec::new() }
    }

    /// Adds bytes as a buffer view.
    fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend_from_slice(bytes);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        views.len() - 1
    }

    /// Adds an accessor; its fields may be changed by `more`.
    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize, more: Value) -> usize {
        let view = self.view(bytes);
        let mut accessor = json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        merge(&mut accessor, more);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, width: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, numbers.len() / width, json!({}))
    }

    fn set(&mut self, more: Value) {
        merge(&mut self.json, more);
    }

    fn glb(&self) -> Vec<u8> {
        let mut document = self.json.clone();
        document["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        glb(&document.to_string(), &self.bytes)
    }

    fn fragment(&self) -> Result<Fragment, String> {
        self.told().map(|(fragment, _)| fragment)
    }

    /// The objects and the warnings.
    fn told(&self) -> Result<(Fragment, String), String> {
        let assets = MemoryAssets::new().with("m.glb", self.glb());
        let read = load_objects("m.glb", &assets, &AssetPath::base());
        read.map(|(fragment, told)| (fragment, told.to_string())).map_err(|e| e.to_string())
    }
}

fn glb(json: &str, bytes: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = bytes.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let word = |v: usize| (v as u32).to_le_bytes();
    [b"glTF", &word(2)[..], &word(length), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", &bin].concat()
}

/// The unit square in the plane z = 0 as a fan of 4 corners, with a node and a scene.
fn square() -> Model {
    let mut model = Model::new();
    let positions = model.floats("VEC3", 3, &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    assert_eq!(positions, 0);
    model.set(json!({
        "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 6 }] }],
    }));
    model
}

fn primitive(model: &mut Model) -> &mut Value {
    &mut model.json["meshes"][0]["primitives"][0]
}

#[test]
fn modes_are_the_specifications() {
    let expected: [(u32, &[[u32; 3]]); 3] =
        [(4, &[[0, 1, 2]]), (5, &[[0, 1, 2], [1, 3, 2]]), (6, &[[0, 1, 2], [0, 2, 3]])];
    for (mode, triangles) in expected {
        let mut model = square();
        primitive(&mut model)["mode"] = mode.into();
        let mesh = &model.fragment().unwrap().meshes[0];
        let corners = |i: usize| mesh.corners(i);
        let original = [Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::Y];
        assert_eq!(mesh.len(), triangles.len(), "mode {mode}");
        for (i, expected) in triangles.iter().enumerate() {
            let expected = expected.map(|v| original[v as usize]);
            let turns = (0..3).map(|k| [expected[k], expected[(k + 1) % 3], expected[(k + 2) % 3]]);
            assert!(turns.into_iter().any(|turn| turn == corners(i)), "mode {mode}, triangle {i}");
        }
    }
    for (mode, count) in [(1, 2), (2, 4), (3, 3)] {
        let mut model = square();
        primitive(&mut model)["mode"] = mode.into();
        assert_eq!(model.fragment().unwrap().cylinders[0].len(), count, "mode {mode}");
    }
    let mut model = square();
    primitive(&mut model)["mode"] = 0.into();
    assert_eq!(model.fragment().unwrap().spheres[0].centers.len(), 4);
}

#[test]
fn all_component_types_are_read() {
    let corners = [0, 0, 0, 64, 0, 0, 64, 64, 0, 0, 64, 0];
    for (component, size) in [(5120, 1), (5121, 1), (5122, 2), (5123, 2), (5126, 4)] {
        for normalized in [false, true].into_iter().filter(|n| !n || component != 5126) {
            let mut model = square();
            // Elements of 3 numbers are padded to a multiple of 4 bytes.
            let stride = (3 * size as usize).next_multiple_of(4);
            let mut bytes = Vec::new();
            for corner in corners.chunks(3) {
                let start = bytes.len();
                for v in corner {
                    match component {
                        5126 => bytes.extend_from_slice(&(*v as f32).to_le_bytes()),
                        _ if size == 1 => bytes.push(*v as u8),
                        _ => bytes.extend_from_slice(&(*v as u16).to_le_bytes()),
                    }
                }
                bytes.resize(start + stride, 0xff);
            }
            let accessor = model.accessor(&bytes, component, "VEC3", 4, json!({ "normalized": normalized }));
            model.json["bufferViews"][accessor]["byteStride"] = stride.into();
            primitive(&mut model)["attributes"]["POSITION"] = accessor.into();
            let most = match component {
                _ if !normalized => 1.0,
                5120 => 127.0,
                5121 => 255.0,
                5122 => 32767.0,
                _ => 65535.0,
            };
            let mesh = &model.fragment().unwrap().meshes[0];
            assert_eq!(mesh.positions[2], Vec3::new(64.0 / most, 64.0 / most, 0.0), "{component} {normalized}");
        }
    }
}

#[test]
fn sparse_values_replace_elements() {
    let mut model = square();
    let indices = model.view(&[2, 3]);
    let values: Vec<u8> = [5.0f32, 6., 7., 8., 9., 10.].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = model.view(&values);
    let sparse = json!({ "sparse": {
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values },
    } });
    merge(&mut model.json["accessors"][0], sparse.clone());
    let positions = |model: &Model| model.fragment().unwrap().meshes[0].positions.clone();
    assert_eq!(positions(&model)[1..], [Vec3::X, Vec3::new(5., 6., 7.), Vec3::new(8., 9., 10.)]);
    // Without a buffer view all other elements are 0.
    model.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(positions(&model)[..2], [Vec3::ZERO; 2]);
    model.json["accessors"][0]["sparse"]["indices"]["byteOffset"] = 1.into();
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/accessors/0/sparse/indices") && told.contains("beyond"), "{told}");
}

#[test]
fn morph_targets_add_up() {
    let mut model = square();
    let [a, b] = [[1.0, 2.0, 3.0], [0.0, 0.0, -4.0]].map(|d| model.floats("VEC3", 3, &d.repeat(4)));
    primitive(&mut model)["targets"] = json!([{ "POSITION": a }, { "POSITION": b }]);
    model.set(json!({ "meshes": [model.json["meshes"][0].clone()] }));
    model.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    let positions = |model: &Model| model.fragment().unwrap().meshes[0].positions[1];
    assert_eq!(positions(&model), Vec3::new(1.5, 1.0, 0.5));
    // A node's own weights win.
    model.json["nodes"][0]["weights"] = json!([0, 1]);
    assert_eq!(positions(&model), Vec3::new(1.0, 0.0, -4.0));
}

/// Skinned vertices are Σ w (joint × inverse bind) p; the place of the mesh's own node doesn't count.
#[test]
fn skins_follow_their_joints() {
    let mut model = square();
    let joints: Vec<u8> = [[0u8, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0]].concat();
    let joints = model.accessor(&joints, 5121, "VEC4", 4, json!({}));
    let weights = [[0.25f32, 0.75, 0., 0.], [1., 0., 0., 0.], [1., 0., 0., 0.], [0.5, 0.5, 0., 0.]];
    let weights = model.floats("VEC4", 4, &weights.concat());
    let bind = |x: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., x, 0., 0., 1.];
    let matrices = model.floats("MAT4", 16, &[bind(0.0), bind(-1.0)].concat());
    primitive(&mut model)["attributes"]["JOINTS_0"] = joints.into();
    primitive(&mut model)["attributes"]["WEIGHTS_0"] = weights.into();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    model.set(json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0, "skin": 0, "translation": [100, 0, 0] },
            { "children": [2], "translation": [0, 0, 2] },
            // A quarter turn around z.
            { "translation": [1, 0, 0], "rotation": [0, 0, half, half] },
        ],
        "skins": [{ "joints": [1, 2], "inverseBindMatrices": matrices }],
    }));
    let fragment = model.fragment().unwrap();
    let quarter = |p: Vec3| Vec3::new(1.0 - p.y, p.x - 1.0, p.z + 2.0);
    let moved = |p: Vec3| p + Vec3::Z * 2.0;
    let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1., 1., 0.), Vec3::Y];
    let expected = [
        moved(corners[0]) * 0.25 + quarter(corners[0]) * 0.75,
        quarter(corners[1]),
        moved(corners[2]),
        (quarter(corners[3]) + moved(corners[3])) * 0.5,
    ];
    for (found, expected) in fragment.meshes[0].positions.iter().zip(expected) {
        assert!((*found - expected).length() < 1e-6, "{found} {expected}");
    }
    assert!(fragment.nodes[0].transform.is_usual());
    primitive(&mut model)["attributes"]["JOINTS_0"] = {
        let far = model.accessor(&[9u8; 16], 5121, "VEC4", 4, json!({}));
        far.into()
    };
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/meshes/0/primitives/0/attributes/JOINTS_0: vertex 0 names joint 9"), "{told}");
}

#[test]
fn transforms_multiply_down_the_tree() {
    let mut model = square();
    model.set(json!({
        "nodes": [
            { "translation": [1, 2, 3], "children": [1] },
            { "scale": [2, 2, -2], "children": [2] },
            { "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1], "mesh": 0 },
        ],
    }));
    let fragment = model.fragment().unwrap();
    let place = |p: DVec3| fragment.nodes[0].transform.point(p);
    assert_eq!(place(DVec3::ZERO), DVec3::new(21.0, 2.0, 3.0));
    assert_eq!(place(DVec3::X + DVec3::Z), DVec3::new(21.0, 4.0, 1.0));
}

/// u' and v' are those of the extension's text, also where the picture is turned.
#[test]
fn texture_transforms_are_khronos() {
    use super::schema::TextureTransform;
    use canaletto::material::{Mapping, Place};
    use canaletto::shape::SurfaceDifferential;
    let transform = TextureTransform { offset: [0.3, -0.7], rotation: 0.4, scale: [2.0, 0.5], tex_coord: None };
    let (sin, cos) = transform.rotation.sin_cos();
    let flat = SurfaceDifferential { gradients: [DVec3::X, DVec3::Y], shape_operator: glam::DMat3::ZERO, round: false };
    let mapping = Mapping { transform: super::texture::placement(&transform), ..Mapping::default() };
    for [u, v] in [[0.0, 0.0], [1.0, 0.0], [0.25, 0.8]] {
        let place = Place {
            point: DVec3::ZERO,
            normal: DVec3::Z,
            uv: glam::DVec2::new(u, v),
            surface_differential: &flat,
            to_world: None,
            bounds: None,
            origins: [DVec3::ZERO; 2],
        };
        let at = mapping.coords(&place)[0].at;
        let expected = [0.3 + cos * 2.0 * u + sin * 0.5 * v, -0.7 - sin * 2.0 * u + cos * 0.5 * v];
        assert!((at.x - expected[0]).abs() + (at.y - expected[1]).abs() < 1e-14, "{u} {v}: {at} {expected:?}");
    }
}

/// The texture in KTX2 is taken, and not the picture beside it.
#[cfg(feature = "ktx2")]
#[test]
fn textures_of_basis_universal_are_read() {
    let mut model = square();
    let uvs = model.floats("VEC2", 2, &[0.; 8]);
    primitive(&mut model)["attributes"]["TEXCOORD_0"] = uvs.into();
    primitive(&mut model)["material"] = 0.into();
    let view = model.view(include_bytes!("../../../tests/fuzz/seeds/etc1s.ktx2"));
    model.set(json!({
        "extensionsUsed": ["KHR_texture_basisu"], "extensionsRequired": ["KHR_texture_basisu"],
        "images": [{ "uri": "none.png" }, { "bufferView": view, "mimeType": "image/ktx2" }],
        "textures": [{ "source": 0, "extensions": { "KHR_texture_basisu": { "source": 1 } } }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
    }));
    let (fragment, told) = model.told().unwrap();
    assert!(!told.contains("/images/1") && !told.contains("/textures"), "{told}");
    let sizes: Vec<_> = fragment.images.iter().map(|image| (image.width, image.height)).collect();
    assert_eq!(sizes, [(24, 20)]);
}

/// A square with normals, texture coordinates and a normal map gets tangents along u, and bitangents along falling v.
#[test]
fn tangents_are_made_where_a_normal_map_needs_them() {
    for flipped in [false, true] {
        let mut model = square();
        let normals = model.floats("VEC3", 3, &[0., 0., 1.].repeat(4));
        let u = |x: f32| if flipped { 1.0 - x } else { x };
        let uvs: Vec<f32> = [[0., 1.], [1., 1.], [1., 0.], [0., 0.]].iter().flat_map(|[x, y]| [u(*x), *y]).collect();
        let uvs = model.floats("VEC2", 2, &uvs);
        let attributes = &mut primitive(&mut model)["attributes"];
        merge(attributes, json!({ "NORMAL": normals, "TEXCOORD_0": uvs }));
        primitive(&mut model)["material"] = 0.into();
        model.set(json!({ "materials": [{ "normalTexture": { "index": 0 } }] }));
        let mesh = &model.fragment().unwrap().meshes[0];
        assert_eq!(mesh.tangents.len(), mesh.positions.len());
        for tangent in &mesh.tangents {
            let along = if flipped { Vec3::NEG_X } else { Vec3::X };
            let bitangent = Vec3::Z.cross(tangent.truncate()) * tangent.w;
            assert!((tangent.truncate() - along).length() < 1e-6, "{tangent}");
            // v falls upwards here.
            assert!((bitangent - Vec3::Y).length() < 1e-6, "{tangent}");
        }
    }
}

#[test]
fn materials_become_standard_surfaces() {
    let mut model = square();
    primitive(&mut model)["material"] = 0.into();
    let colors = model.floats("VEC4", 4, &[0.5, 0.25, 1., 0.5].repeat(4));
    let more = model.floats("VEC2", 2, &[0.; 8]);
    let attributes = &mut primitive(&mut model)["attributes"];
    merge(attributes, json!({ "COLOR_0": colors, "TEXCOORD_0": more, "TEXCOORD_1": more }));
    model.set(json!({
        "materials": [{
            "name": "paint", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
            "emissiveFactor": [1, 0.5, 0],
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 1, 0.75], "metallicFactor": 0.25, "roughnessFactor": 0.5 },
            "extensions": {
                "KHR_materials_emissive_strength": { "emissiveStrength": 4 },
                "KHR_materials_ior": { "ior": 1.75 },
                "KHR_materials_clearcoat": { "clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25 },
                "KHR_materials_sheen": { "sheenColorFactor": [0.25, 0.5, 0] },
                "KHR_materials_transmission": { "transmissionFactor": 0.5 },
                "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25] },
                "KHR_materials_iridescence": { "iridescenceFactor": 1, "iridescenceThicknessMaximum": 500 },
            },
        }],
    }));
    let fragment = model.fragment().unwrap();
    let material = &fragment.materials[0];
    let surface = material.standard().unwrap();
    assert_eq!((surface.base.color, surface.base.metalness), (Rgb::new(0.5, 1.0, 1.0), 0.25));
    assert_eq!((surface.specular.roughness, surface.specular.ior), (0.5, 1.75));
    assert_eq!((surface.emission.radiance, surface.emission.color), (4.0, Rgb::new(1.0, 0.5, 0.0)));
    assert_eq!((surface.coat.weight, surface.coat.roughness, surface.coat.darkening), (0.5, 0.25, 0.0));
    assert_eq!((surface.fuzz.weight, surface.fuzz.color), (0.5, Rgb::new(0.5, 1.0, 0.0)));
    assert_eq!((surface.thin_film.weight, surface.thin_film.thickness), (1.0, 0.5));
    assert_eq!((surface.transmission.weight, surface.transmission.depth, surface.thin_walled), (0.5, 2.0, false));
    assert!((material.medium.absorption.g - 2f32.ln() / 2.0).abs() < 1e-6);
    assert_eq!((material.coverage, material.alpha_cutoff, material.two_sided), (0.75, Some(0.25), true));
    let targets: Vec<(Target, Channel, bool)> =
        material.textures.iter().map(|used| (used.target, used.channel, used.multiply)).collect();
    let diffuse = (Target::Parameter(Parameter::Diffuse), Channel::Luminance, true);
    let tint = (canaletto::Named::from_name("transmission-tint").unwrap(), Channel::Luminance, true);
    assert_eq!(targets, [diffuse, tint, (Target::Cutout, Channel::Alpha, true)]);
    assert_eq!(surface.transmission.tint, Rgb::new(0.5, 1.0, 1.0));
    let mesh = &fragment.meshes[0];
    assert_eq!((mesh.colors[3], mesh.alphas[3]), (Rgb::new(0.5, 0.25, 1.0), 0.5));
    assert_eq!((mesh.uvs.len(), mesh.more_uvs.len(), mesh.one_sided), (4, 1, false));
    assert_eq!(mesh.uvs[0], Vec2::ZERO);
}

#[test]
fn cameras_and_lights_are_placed() {
    let mut model = square();
    model.set(json!({
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0 },
            { "camera": 0, "name": "side", "translation": [0, 0, 5] },
            { "translation": [0, 2, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.5, "aspectRatio": 2, "znear": 0.1 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 3, "color": [1, 0.5, 0] }] } },
    }));
    let assets = MemoryAssets::new().with("m.glb", model.glb());
    let (scene, _): (Scene, _) = load("m.glb", &assets, &Staging::default()).unwrap();
    let view = &scene.views[0];
    assert_eq!((view.name.as_str(), view.intrinsics.width, view.intrinsics.height), ("side", 960, 480));
    assert!((view.intrinsics.fovy - 0.5f64.to_degrees()).abs() < 1e-12);
    assert_eq!((view.extrinsics.eye, view.extrinsics.center), (DVec3::Z * 5.0, DVec3::Z * 4.0));
    let lights: Vec<_> = scene
        .nodes
        .iter()
        .filter_map(|node| match &node.content {
            Content::Light(light) => Some(light),
            _ => None,
        })
        .collect();
    assert_eq!(lights.len(), 1, "the studio's lights stay out");
    assert!(matches!(lights[0].kind, LightKind::Omni(_)));
    assert_eq!(lights[0].attenuation, [0.0, 0.0, 1.0]);
    assert!((lights[0].intensity.r - 3.0 / std::f32::consts::PI).abs() < 1e-6);
}

#[test]
fn instances_share_their_mesh() {
    let mut model = square();
    let places = model.floats("VEC3", 3, &[0., 0., 0., 0., 0., 3., 0., 0., 6.]);
    model.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places } } });
    let fragment = model.fragment().unwrap();
    assert_eq!((fragment.meshes.len(), fragment.prototypes.len(), fragment.nodes.len()), (1, 1, 3));
    assert_eq!(fragment.nodes[2].transform.point(DVec3::ZERO), DVec3::Z * 6.0);
}

/// Reads the unit square out of compressed views of an extension. Their own buffer has no bytes.
fn compressed_square(extension: &str, change: impl Fn(&mut Value)) -> Result<Fragment, String> {
    let streams = "oerqqgB/AH8AAH8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAEgEA4fAAAHaHVmd4qYZliWiYAWkAAA==";
    let positions = json!({ "buffer": 0, "byteLength": 36, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES" });
    let corners = json!({
        "buffer": 0, "byteOffset": 36, "byteLength": 19, "byteStride": 2, "count": 6, "mode": "TRIANGLES",
        "filter": "NONE",
    });
    let mut model = square();
    primitive(&mut model).as_object_mut().unwrap().remove("mode");
    primitive(&mut model)["indices"] = json!(1);
    model.set(json!({
        "extensionsUsed": [extension], "extensionsRequired": [extension],
        "buffers": [
            { "byteLength": 55, "uri": format!("data:;base64,{streams}") },
            { "byteLength": 60, "extensions": { extension: { "fallback": true } } },
        ],
        "bufferViews": [
            { "buffer": 1, "byteLength": 48, "byteStride": 12, "extensions": { extension: positions } },
            { "buffer": 1, "byteOffset": 48, "byteLength": 12, "extensions": { extension: corners } },
        ],
    }));
    let index = json!({ "bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6 });
    model.json["accessors"].as_array_mut().unwrap().push(index);
    change(&mut model.json);
    let assets = MemoryAssets::new().with("m.gltf", model.json.to_string());
    load_objects("m.gltf", &assets, &AssetPath::base()).map(|(fragment, _)| fragment).map_err(|e| e.to_string())
}

#[test]
fn compressed_views_are_decoded() {
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let fragment = compressed_square(extension, |_| {}).unwrap();
        let mesh = &fragment.meshes[0];
        let triangles = [0, 1].map(|i| mesh.corners(i));
        assert_eq!(triangles, [[Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z], [Vec3::ZERO, Vec3::ONE - Vec3::Z, Vec3::Y]]);
        for (field, value, words) in [
            ("buffer", json!(1), "/buffers/1: it has no uri"),
            ("buffer", json!(2), "/buffer: buffer 2 doesn't exist"),
            ("byteLength", json!(35), ": its 35 compressed bytes can't be decoded"),
            ("byteLength", json!(56), ": byteOffset 0 and byteLength 56 go beyond the 55 bytes"),
            ("byteOffset", json!(usize::MAX), ": byteOffset"),
            ("byteStride", json!(10), "/byteStride: is 10"),
            ("count", json!(5), ": its 36 compressed bytes can't be decoded"),
            ("count", json!(1u64 << 60), "/count: is 1152921504606846976: the compressed views of buffer 0 have more"),
            ("mode", json!("INDICES"), "/byteStride: is 12"),
            ("mode", json!("LINES"), "/mode: unknown variant `LINES`"),
            ("filter", json!("COLOR"), "/byteStride: is 12"),
        ] {
            let change = |json: &mut Value| json["bufferViews"][0]["extensions"][extension][field] = value.clone();
            let told = compressed_square(extension, change).unwrap_err();
            let place =
                if words.starts_with("/buffers") { "" } else { &format!("/bufferViews/0/extensions/{extension}") };
            assert!(told.contains(&format!("{place}{words}")), "{field}: {told}");
        }
    }
}

/// Views of the same bytes would fill the memory: at most as much is decoded as views of their own bytes could hold.
#[test]
fn compressed_views_that_share_bytes_are_bounded() {
    const NAME: &str = "KHR_meshopt_compression";
    // 100 blocks of 256 elements, which are 0: a byte for each 4 of an element.
    let stream = [&[0xA1][..], &[0xAA; 800], &[0; 40]].concat();
    let mut model = square();
    let from = model.view(&stream);
    let compressed = json!({
        "buffer": 0, "byteOffset": model.json["bufferViews"][from]["byteOffset"], "byteLength": stream.len(),
        "byteStride": 32, "count": 25_600, "mode": "ATTRIBUTES",
    });
    for place in ["POSITION", "NORMAL"] {
        let accessor = model.accessor(&[], 5126, "VEC3", 25_600, json!({}));
        primitive(&mut model)["attributes"][place] = accessor.into();
        let view = model.json["bufferViews"].as_array_mut().unwrap().last_mut().unwrap();
        view["extensions"] = json!({ NAME: compressed });
    }
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/extensions/KHR_meshopt_compression/count: is 25600"), "{told}");
    primitive(&mut model)["attributes"].as_object_mut().unwrap().remove("NORMAL");
    assert!(model.fragment().unwrap_err().contains("nothing in it has an area"), "one view is decoded");
}

#[test]
fn a_scene_that_lists_a_child_draws_it_once() {
    let mut model = square();
    model.set(json!({ "nodes": [{ "children": [1] }, { "mesh": 0 }], "scenes": [{ "nodes": [0, 1] }] }));
    let (fragment, told) = model.told().unwrap();
    assert!(fragment.nodes.len() == 1 && told.contains("/scenes/0/nodes/1"), "{told}");
    model.json["scenes"][0]["nodes"] = json!([1]);
    let (fragment, told) = model.told().unwrap();
    assert!(fragment.nodes.len() == 1 && told.contains("node 1 is a child of node 0"), "{told}");
    model.json["nodes"][1]["children"] = json!([0]);
    let told = model.fragment().unwrap_err();
    assert!(told.contains("circle"), "{told}");
}

#[test]
fn mistakes_name_their_place() {
    let with = |pointer: &str, value: Value| {
        let mut model = square();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match model.json.pointer_mut(parent).unwrap() {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            object => object[key] = value,
        }
        model.fragment().unwrap_err()
    };
    for (pointer, value, words) in [
        ("/asset/version", json!("1.0"), "/asset/version: it is glTF 1.0"),
        ("/meshes/0/primitives/0/indices", json!(7), "/meshes/0/primitives/0/indices: accessor 7 doesn't exist"),
        ("/meshes/0/primitives/0/mode", json!(9), "/meshes/0/primitives/0/mode: is 9"),
        ("/accessors/0/count", json!(5), "/accessors/0: 5 elements of 12 bytes"),
        ("/accessors/0/count", json!(0), "/accessors/0/count"),
        ("/accessors/0/count", json!(u64::MAX), "/accessors/0"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "go beyond"),
        ("/accessors/0/type", json!("VEC2"), "/accessors/0/type"),
        ("/accessors/0/componentType", json!(1), "/accessors/0/componentType"),
        ("/bufferViews/0/byteLength", json!(1u64 << 40), "/bufferViews/0"),
        ("/bufferViews/0/byteStride", json!(3), "/bufferViews/0/byteStride"),
        ("/bufferViews/0/buffer", json!(3), "buffer 3 doesn't exist"),
        ("/nodes/0/mesh", json!(-1), "/nodes/0/mesh: invalid value"),
        ("/nodes/0/mesh", json!(4), "/nodes/0/mesh: mesh 4 doesn't exist"),
        ("/nodes/0/children", json!([9]), "/nodes/0/children/0: node 9"),
        ("/nodes/0/skin", json!(1), "/nodes/0/skin: skin 1"),
        ("/scenes/0/nodes/0", json!(2), "/scenes/0/nodes/0: node 2"),
        ("/extensionsRequired", json!(["ACME_sphere"]), "/extensionsRequired/0: it requires ACME_sphere"),
    ] {
        let told = with(pointer, value);
        assert!(told.contains(words), "{pointer}: {told}");
    }
    let mut model = square();
    model.bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/meshes/0/primitives/0/attributes/POSITION: vertex 1"), "{told}");
}

/// Nothing but files below the model's folder is opened.
#[test]
fn uris_stay_in_the_folder() {
    for (uri, words) in [
        ("http://example.com/a.bin", "nothing is downloaded"),
        ("file:///etc/passwd", "its scheme is file"),
        ("../a.bin", "outside"),
        ("%2e%2e/a.bin", "outside"),
        ("/etc/passwd", "outside"),
        ("a%", "percent"),
        ("a%00b", "NUL"),
        ("C:%5Ca.bin", "outside"),
        ("data:application/octet-stream;base64,####", "damaged"),
        ("data:nonsense", "no comma"),
        ("", "empty"),
        ("none.bin", "there is no file"),
    ] {
        let mut model = square();
        model.json["buffers"] = json!([{ "byteLength": 48, "uri": uri }]);
        let assets = MemoryAssets::new().with("m.gltf", model.json.to_string());
        let told = load("m.gltf", &assets, &Staging::default()).unwrap_err().to_string();
        assert!(told.contains(words) && told.contains("/buffers/0/uri"), "{uri}: {told}");
    }
    for uri in ["sub/a%20b.bin", "sub/a b.bin", "./sub/a%20b.bin"] {
        let mut model = square();
        model.json["buffers"] = json!([{ "byteLength": 48, "uri": uri }]);
        let assets = MemoryAssets::new().with("m.gltf", model.json.to_string()).with("sub/a b.bin", &model.bytes[..]);
        load("m.gltf", &assets, &Staging::default()).unwrap();
    }
}

/// JSON may write a whole number as 1.0.
#[test]
fn whole_numbers_may_be_written_as_real_ones() {
    let mut model = square();
    model.json["accessors"][0]["count"] = 4.0.into();
    model.json["nodes"][0]["mesh"] = 0.0.into();
    assert_eq!(model.fragment().unwrap().meshes[0].len(), 2);
    model.json["accessors"][0]["count"] = 3.5.into();
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/accessors/0/count: invalid type: floating point `3.5`"), "{told}");
}

#[test]
fn containers_are_checked() {
    let whole = square().glb();
    let read = |bytes: &[u8]| {
        let assets = MemoryAssets::new().with("m.glb", bytes);
        load("m.glb", &assets, &Staging::default()).map(|(_, told)| told.to_string()).map_err(|e| e.to_string())
    };
    assert!(read(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(read(&whole[..length]).is_err(), "{length}");
    }
    assert!(read(&[&whole[..], b"more"].concat()).unwrap().contains("4 follow them"));
    let mut version = whole.clone();
    version[4] = 1;
    assert!(read(&version).unwrap_err().contains("version 1"));
    let mut kind = whole.clone();
    kind[16..20].copy_from_slice(b"ABCD");
    assert!(read(&kind).unwrap_err().contains("first chunk isn't JSON"));
}

/// The scene of a model at a moment.
fn at(model: &Model, clip: Option<&str>, seconds: f64) -> Result<Scene, String> {
    let assets = MemoryAssets::new().with("m.glb", model.glb());
    let moment = Some(Moment { clip: clip.map(str::to_owned), seconds });
    let read = load("m.glb", &assets, &Staging { moment, ..Staging::default() });
    read.map(|(scene, _)| scene).map_err(|e| e.to_string())
}

/// Channels by the formulas of appendix C, before the first key, between keys and after the last one.
#[test]
fn clips_move_nodes() {
    let mut model = square();
    let times = model.floats("SCALAR", 1, &[1.0, 3.0]);
    let linear = model.floats("VEC3", 3, &[0., 0., 0., 4., 0., 0.]);
    let cubic = [[0., 0., 0.], [1., 1., 1.], [0.5, 0., 0.], [-1., 0., 0.], [2., 1., 1.], [0., 0., 0.]].concat();
    let cubic = model.floats("VEC3", 3, &cubic);
    let (sin, cos) = (60f32.to_radians().sin(), 60f32.to_radians().cos());
    // The second quaternion is negated: the shorter way is taken all the same.
    let turns = model.floats("VEC4", 4, &[0., 0., 0., 1., 0., 0., -sin, -cos]);
    model.set(json!({ "animations": [
        {
            "name": "move",
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 1, "target": { "node": 0, "path": "scale" } },
                { "sampler": 2, "target": { "node": 0, "path": "rotation" } },
                { "sampler": 0, "target": { "path": "translation" } },
            ],
            "samplers": [
                { "input": times, "output": linear },
                { "input": times, "output": cubic, "interpolation": "CUBICSPLINE" },
                { "input": times, "output": turns, "interpolation": "LINEAR" },
            ],
        },
        {
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
            "samplers": [{ "input": times, "output": linear, "interpolation": "STEP" }],
        },
    ] }));
    let place = |clip, seconds: f64| at(&model, clip, seconds).unwrap().nodes[0].transform.clone();
    let origin = |clip, seconds: f64| place(clip, seconds).point(DVec3::ZERO);
    for (seconds, x) in [(0.0, 0.0), (1.0, 0.0), (1.5, 1.0), (2.0, 2.0), (3.0, 4.0), (9.0, 4.0)] {
        assert!((origin(None, seconds).x - x).abs() < 1e-6, "{seconds}");
    }
    assert_eq!([origin(Some("1"), 2.9).x, origin(Some("1"), 3.0).x], [0.0, 4.0]);
    // Halfway the quaternion is that of half the angle, 60 degrees, and the scale p(½) of the cubic.
    let half = place(Some("move"), 2.0);
    let scale = 0.5 * 1.0 + 2.0 * (0.125 * 0.5) + 0.5 * 2.0 + 2.0 * (-0.125 * -1.0);
    let expected = DVec3::new(60f64.to_radians().cos(), 60f64.to_radians().sin(), 0.0) * scale;
    assert!((half.vector(DVec3::X) - expected).length() < 1e-6, "{} {expected}", half.vector(DVec3::X));
    let told = at(&model, Some("jump"), 0.0).unwrap_err();
    assert!(told.contains("no clip \"jump\"") && told.contains("its clips are move, 1"), "{told}");
    let assets = MemoryAssets::new().with("m.glb", model.glb());
    assert_eq!(crate::import::duration("m.glb", &assets, None).unwrap(), Some(3.0));
    assert_eq!(
        crate::import::duration("m.glb", &MemoryAssets::new().with("m.glb", square().glb()), None).unwrap(),
        None
    );
}

/// KHR_animation_pointer changes any number, and morph weights are a list.
#[test]
fn clips_change_what_pointers_name() {
    let mut model = square();
    let times = model.floats("SCALAR", 1, &[0.0, 1.0]);
    let colors = model.floats("VEC4", 4, &[0., 0., 0., 1., 1., 0.5, 0.25, 1.]);
    let morph = model.floats("VEC3", 3, &[0., 0., 2.].repeat(4));
    let weights = model.floats("SCALAR", 1, &[0.0, 1.0]);
    primitive(&mut model)["targets"] = json!([{ "POSITION": morph }]);
    primitive(&mut model)["material"] = 0.into();
    let pointer = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    model.set(json!({
        "materials": [{ "pbrMetallicRoughness": {} }],
        "animations": [{
            "channels": [
                { "sampler": 0, "target": { "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } } },
                { "sampler": 1, "target": { "node": 0, "path": "weights" } },
            ],
            "samplers": [{ "input": times, "output": colors }, { "input": times, "output": weights }],
        }],
    }));
    let scene = at(&model, None, 0.5).unwrap();
    assert_eq!(scene.materials[0].standard().unwrap().base.color, Rgb::new(0.5, 0.25, 0.125));
    assert_eq!(scene.meshes[0].positions[0], Vec3::Z);
}

/// Vertices that a clip moves while the shutter is open are blurred: they are where the clip has them when it opens and
/// when it closes.
#[test]
fn clips_blur_vertices() {
    let mut model = square();
    let times = model.floats("SCALAR", 1, &[0.0, 1.0]);
    let morph = model.floats("VEC3", 3, &[0., 0., 2.].repeat(4));
    let weights = model.floats("SCALAR", 1, &[0.0, 1.0]);
    primitive(&mut model)["targets"] = json!([{ "POSITION": morph }]);
    model.set(json!({
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": times, "output": weights }],
        }],
    }));
    let assets = MemoryAssets::new().with("a.glb", model.glb());
    let staging = Staging { plays: true, ..Staging::default() };
    let mut source =
        crate::scene_file::open("a.glb", &assets, &["camera.shutter=0.3 1.5".to_owned()], &staging).unwrap();
    // Frames are a 25th of a second, and z grows by 2 in a second.
    let (scene, warnings) = source.scene(&assets, 6.0).unwrap();
    assert_eq!(warnings.to_string(), "");
    let close = scene.meshes[0].end_pose.as_ref().unwrap();
    for (start, end) in scene.meshes[0].positions.iter().zip(&close.positions) {
        assert!((start.z - 6.3 / 12.5).abs() < 1e-6 && (end.z - 7.5 / 12.5).abs() < 1e-6, "{start} {end}");
    }
    // After the clip's end the vertices rest.
    assert!(source.scene(&assets, 25.0).unwrap().0.meshes[0].end_pose.is_none());
}

#[test]
fn variants_choose_materials() {
    let mut model = square();
    primitive(&mut model)["material"] = 0.into();
    primitive(&mut model)["extensions"] =
        json!({ "KHR_materials_variants": { "mappings": [{ "material": 1, "variants": [1] }] } });
    model.set(json!({
        "materials": [{ "name": "blue" }, { "name": "red" }],
        "extensions": { "KHR_materials_variants": { "variants": [{ "name": "sea" }, { "name": "sunset" }] } },
    }));
    let name = |variant: Option<&str>| {
        let assets = MemoryAssets::new().with("m.glb", model.glb());
        let staging = Staging { variant: variant.map(str::to_owned), ..Staging::default() };
        load("m.glb", &assets, &staging).map(|(scene, _)| scene.materials[0].name.clone()).map_err(|e| e.to_string())
    };
    assert_eq!(
        [name(None), name(Some("sea")), name(Some("sunset"))],
        ["blue", "blue", "red"].map(|n| Ok(n.to_owned()))
    );
    assert!(name(Some("night")).unwrap_err().contains("its variants are sea, sunset"));
}

/// The archived model, diffuse transmission and the numbers of specular and anisotropy.
#[test]
fn further_materials_are_mapped() {
    let material = |json: Value| {
        let mut model = square();
        primitive(&mut model)["material"] = 0.into();
        model.set(json!({ "materials": [json] }));
        *model.fragment().unwrap().materials[0].standard().unwrap()
    };
    let paint = material(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 1, 1, 1], "specularFactor": [0.5, 0.25, 0.125], "glossinessFactor": 0.75,
    } } }));
    assert!(paint.schlick && (paint.specular.roughness, paint.base.metalness) == (0.25, 0.0));
    assert_eq!((paint.specular.color, paint.base.color), (Rgb::new(0.5, 0.25, 0.125), Rgb::new(0.5, 1.0, 1.0)));
    assert_eq!(paint.base.weight, 0.5);
    let leaf = material(json!({ "extensions": { "KHR_materials_diffuse_transmission": {
        "diffuseTransmissionFactor": 0.75, "diffuseTransmissionColorFactor": [0, 1, 0],
    } } }));
    let through = leaf.subsurface;
    assert_eq!((through.weight, through.color, through.scatter_anisotropy), (0.75, Rgb::new(0.0, 1.0, 0.0), 1.0));
    assert!(leaf.thin_walled);
    // A colour beyond 1 is a larger F0: 2 × 0.04.
    let bright = material(json!({ "extensions": { "KHR_materials_specular": {
        "specularFactor": 0.5, "specularColorFactor": [2, 1, 0],
    } } }));
    let f0 = (bright.specular.ior - 1.0) / (bright.specular.ior + 1.0);
    assert!(bright.schlick && (f0 * f0 - 0.08).abs() < 1e-6 && bright.specular.weight == 0.5);
    assert_eq!(bright.specular.color, Rgb::new(1.0, 0.5, 0.0));
    // αt = mix(r², 1, s²) and αb = r² are the widths that roughness and anisotropy give.
    let brushed = material(json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.5 }, "extensions": {
        "KHR_materials_anisotropy": { "anisotropyStrength": 0.5, "anisotropyRotation": 1 },
    } }));
    let squash = 1.0 - brushed.specular.anisotropy;
    let along = brushed.specular.roughness * brushed.specular.roughness * (2.0 / (1.0 + squash * squash)).sqrt();
    assert!((along - (0.25 + 0.75 * 0.25)).abs() < 1e-6 && (along * squash - 0.25).abs() < 1e-6);
    assert!((brushed.specular.anisotropy_rotation - 1f32.to_degrees()).abs() < 1e-4);
}

const DRACO: &str = "KHR_draco_mesh_compression";

/// Unit cubes of Draco's own encoder, whose 24 vertices have normals.
const CUBES: [&[u8]; 2] = [
    include_bytes!("../../../tests/fuzz/seeds/draco/cube-edgebreaker.drc"),
    include_bytes!("../../../tests/fuzz/seeds/draco/cube-sequential.drc"),
];

/// A cube of a stream: the accessors of its positions, normals and indices have no elements of their own.
fn compressed_cube(stream: &[u8]) -> Model {
    let mut model = Model::new();
    let view = model.view(stream);
    let accessor =
        |count: u32, component: u32, kind: &str| json!({ "count": count, "componentType": component, "type": kind });
    let draco = json!({ "bufferView": view, "attributes": { "POSITION": 0, "NORMAL": 1 } });
    model.set(json!({
        "extensionsUsed": [DRACO], "extensionsRequired": [DRACO],
        "accessors": [accessor(24, 5126, "VEC3"), accessor(24, 5126, "VEC3"), accessor(36, 5123, "SCALAR")],
        "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2, "extensions": { DRACO: draco },
        }] }],
    }));
    let bounds = json!({ "min": [-0.5, -0.5, -0.5], "max": [0.5, 0.5, 0.5] });
    merge(&mut model.json["accessors"][0], bounds);
    model
}

#[test]
fn compressed_primitives_are_read() {
    for stream in CUBES {
        let (fragment, told) = compressed_cube(stream).told().unwrap();
        assert_eq!(told, "");
        let mesh = &fragment.meshes[0];
        assert_eq!((mesh.len(), mesh.positions.len(), mesh.normals.len()), (12, 24, 24));
        let mut volume = 0.0;
        for (i, corners) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(i);
            volume += a.dot(b.cross(c)) / 6.0;
            let area = (b - a).cross(c - a);
            assert!(corners.iter().all(|v| mesh.normals[*v as usize].dot(area) > 0.98), "{area}");
        }
        assert!((volume - 1.0).abs() < 0.02, "{volume}");
    }
}

/// What a stream doesn't have is in the order of its points: attributes and morph targets.
#[test]
fn compressed_primitives_have_other_elements_beside_them() {
    for stream in CUBES {
        let plain = compressed_cube(stream).fragment().unwrap();
        let plain = &plain.meshes[0].positions;
        let mut model = compressed_cube(stream);
        let uvs: Vec<f32> = (0..24).flat_map(|i| [i as f32, 0.5]).collect();
        let uvs = model.floats("VEC2", 2, &uvs);
        let moves: Vec<f32> = plain.iter().zip(0..).flat_map(|(p, i)| [i as f32 - p.x, -p.y, p.x]).collect();
        let moves = model.floats("VEC3", 3, &moves);
        primitive(&mut model)["attributes"]["TEXCOORD_0"] = uvs.into();
        primitive(&mut model)["targets"] = json!([{ "POSITION": moves }]);
        model.json["meshes"][0]["weights"] = json!([1]);
        let fragment = model.fragment().unwrap();
        let mesh = &fragment.meshes[0];
        for (i, p) in plain.iter().enumerate() {
            assert_eq!(mesh.uvs[i], Vec2::new(i as f32, 0.5));
            assert!((mesh.positions[i] - Vec3::new(i as f32, 0.0, p.z + p.x)).length() < 1e-5);
        }
    }
}

/// Primitives with the same accessors have streams of their own.
#[test]
fn compressed_primitives_share_accessors() {
    let mut model = compressed_cube(CUBES[0]);
    let view = model.view(CUBES[1]);
    let mut other = primitive(&mut model).clone();
    other["extensions"][DRACO]["bufferView"] = view.into();
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    let together = model.fragment().unwrap().meshes;
    let apart = CUBES.map(|stream| compressed_cube(stream).fragment().unwrap().meshes.remove(0));
    assert!(together.len() == 2 && apart[0].positions != apart[1].positions);
    for (own, mesh) in apart.iter().zip(&together) {
        assert_eq!((&own.positions, &own.triangles), (&mesh.positions, &mesh.triangles));
    }
}

/// The accessor says whether integers are fractions. Where it has floats, the stream says it.
#[test]
fn integers_of_streams_are_normalized() {
    let colors = |component: u32, normalized: bool| {
        let mut model = square();
        let stream = include_bytes!("../../../tests/fuzz/seeds/draco/plain.drc");
        let draco = json!({ "bufferView": model.view(stream), "attributes": { "COLOR_0": 4 } });
        let color = json!({ "componentType": component, "normalized": normalized, "type": "VEC4", "count": 4 });
        model.json["accessors"].as_array_mut().unwrap().push(color);
        model.json["meshes"][0]["primitives"][0] =
            json!({ "attributes": { "POSITION": 0, "COLOR_0": 1 }, "extensions": { DRACO: draco } });
        let (fragment, told) = model.told().unwrap();
        assert_eq!(told.contains("/accessors/1/componentType"), component != 5121, "{told}");
        let mesh = &fragment.meshes[0];
        (mesh.colors.iter().map(|color| color.r).fold(0.0, f32::max), mesh.alphas.first().copied())
    };
    assert_eq!(colors(5121, true), (3.0 / 255.0, None));
    assert_eq!(colors(5121, false), (3.0, Some(255.0)));
    assert_eq!(colors(5126, false), (3.0, Some(255.0)));
}

#[test]
fn streams_fit_their_primitive() {
    let told = |change: &dyn Fn(&mut Value)| {
        let mut model = compressed_cube(CUBES[0]);
        change(&mut model.json);
        model.told().map(|(fragment, told)| {
            assert_eq!((fragment.meshes[0].positions.len(), fragment.meshes[0].len()), (24, 12));
            told
        })
    };
    let draco = format!("/meshes/0/primitives/0/extensions/{DRACO}");
    for (pointer, value, words) in [
        ("/accessors/0/type", json!("VEC2"), "/accessors/0/type: is \"VEC2\", but the elements of its stream have 3"),
        ("/meshes/0/primitives/0/mode", json!(1), "/meshes/0/primitives/0/mode: is 1; compressed primitives"),
        (&format!("{draco}/bufferView"), json!(5), "/extensions/KHR_draco_mesh_compression: buffer view 5"),
        (
            &format!("{draco}/attributes/NORMAL"),
            json!(7),
            "/attributes/NORMAL: is 7; its stream has the attributes 0, 1",
        ),
        (&format!("{draco}/attributes"), json!({ "COLOR_0": 0 }), "/attributes/COLOR_0: the primitive has no such"),
    ] {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let told = told(&|json| json.pointer_mut(parent).unwrap()[key] = value.clone()).unwrap_err();
        assert!(told.contains(words), "{pointer}: {told}");
    }
    // Positions outside of the stream must be as many as its points.
    for (attributes, words) in [
        (json!({ "NORMAL": 1 }), "/attributes/NORMAL: it has 24 elements, but POSITION has 7"),
        (json!({}), "its stream has 24 vertices, but POSITION has 7"),
    ] {
        let change = |json: &mut Value| {
            *json.pointer_mut(&format!("{draco}/attributes")).unwrap() = attributes.clone();
            json["accessors"][0]["count"] = 7.into();
            json["accessors"][1]["count"] = 7.into();
        };
        let told = told(&change).unwrap_err();
        assert!(told.contains(words), "{told}");
    }
    for (accessor, field, value, words) in [
        (0, "count", 23, "/accessors/0/count: is 23, but its stream has 24 elements"),
        (1, "componentType", 5120, "/accessors/1/componentType: is 5120, but its stream has numbers of the type F32"),
        (2, "count", 30, "/accessors/2/count: is 30, but its stream has 36 elements"),
    ] {
        let told = told(&|json| json["accessors"][accessor][field] = value.into()).unwrap();
        assert!(told.contains(words), "{told}");
    }
    // Strips are triangles in a stream.
    let strip = |json: &mut Value| {
        json["meshes"][0]["primitives"][0]["mode"] = 5.into();
        json["accessors"][2]["count"] = 14.into();
    };
    assert_eq!(told(&strip).unwrap(), "");
}

#[test]
fn damaged_streams_are_refused() {
    for stream in CUBES {
        for length in 0..stream.len() {
            let told = compressed_cube(&stream[..length]).fragment().unwrap_err();
            assert!(told.contains("/bufferViews/0: its ") && told.contains("can't be decoded"), "{length}: {told}");
        }
        let mut older = stream.to_vec();
        older[6] = 1;
        let told = compressed_cube(&older).fragment().unwrap_err();
        assert!(told.contains("they have version 2.1, not 2.2"), "{told}");
    }
    // Elements of the accessors' own take the place of those of a damaged stream.
    let mut model = square();
    let view = model.view(&[0; 20]);
    primitive(&mut model)["mode"] = 4.into();
    primitive(&mut model)["extensions"] = json!({ DRACO: { "bufferView": view, "attributes": { "POSITION": 0 } } });
    let (fragment, told) = model.told().unwrap();
    assert!(fragment.meshes[0].len() == 1 && told.contains("they don't begin with DRACO"), "{told}");
    model.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(model.fragment().unwrap_err().contains("they don't begin with DRACO"));
}

/// A stream of a triangle with 600,000 points, all of which are 0 and take no bytes.
#[test]
fn streams_that_share_bytes_are_bounded() {
    let mut stream = b"DRACO\x02\x02\x01\0\0\0\x01\xC0\xCF\x24\x01\0\x01\x02".to_vec();
    // One group of one attribute: three integers of 16 bits, which are symbols of an alphabet of one.
    stream.extend([1, 1, 0, 4, 3, 0, 0, 1, 0xFE, 1, 1, 1, 1, 1, 64, 1, 0]);
    let mut model = square();
    let views = [0; 2].map(|_| model.view(&stream));
    model.json["accessors"][0] = json!({ "count": 600_000, "componentType": 5123, "type": "VEC3" });
    let primitives = views.map(|view| {
        let draco = json!({ "bufferView": view, "attributes": { "POSITION": 0 } });
        json!({ "attributes": { "POSITION": 0 }, "extensions": { DRACO: draco } })
    });
    model.json["meshes"][0]["primitives"] = primitives.to_vec().into();
    let told = model.fragment().unwrap_err();
    assert!(told.contains("/bufferViews/2: ") && told.contains("they announce more numbers than they may"), "{told}");
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().pop();
    assert!(model.fragment().unwrap_err().contains("nothing in it has an area"), "one stream is decoded");
}
