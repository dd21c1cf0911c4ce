//! A valid document, and each rule that it can break.

use crate::assets::MemoryAssets;
use crate::import::{Staging, load};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// A PNG of one pixel.
const PIXEL: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVQYV2P4z/AfAAQAAf+I0P3MAAAAAElFTkSuQmCC";

/// A document whose accessors have a buffer view each, of the same number.
struct Sample {
    json: Value,
    views: Vec<Vec<u8>>,
}

const POSITION: usize = 0;
const NORMAL: usize = 1;
const TANGENT: usize = 2;
const COLOR: usize = 3;
const JOINTS: usize = 4;
const WEIGHTS: usize = 5;
const UV: usize = 6;
const INDICES: usize = 7;
const MATRICES: usize = 8;
const TIMES: usize = 9;
const TURNS: usize = 10;
const MORPH: usize = 11;

impl Sample {
    /// A skinned, animated triangle with all attributes.
    fn new() -> Sample {
        let unit = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
        let floats: [(usize, &str, usize, Vec<f32>); 9] = [
            (POSITION, "VEC3", 3, vec![0., 0., 0., 1., 0., 0., 0., 1., 0.]),
            (NORMAL, "VEC3", 3, [0., 0., 1.].repeat(3)),
            (TANGENT, "VEC4", 4, [1., 0., 0., 1.].repeat(3)),
            (COLOR, "VEC4", 4, vec![0.5; 12]),
            (WEIGHTS, "VEC4", 4, [1., 0., 0., 0.].repeat(3)),
            (UV, "VEC2", 2, vec![0.; 6]),
            (MATRICES, "MAT4", 16, unit.repeat(2)),
            (TIMES, "SCALAR", 1, vec![0., 1.]),
            (TURNS, "VEC4", 4, [0., 0., 0., 1.].repeat(2)),
        ];
        let mut views = vec![Vec::new(); 12];
        let mut accessors = vec![Value::Null; 12];
        let morph = (MORPH, "VEC3", 3, vec![0.0f32; 9]);
        for (index, kind, width, numbers) in floats.into_iter().chain([morph]) {
            views[index] = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
            accessors[index] = json!({
                "bufferView": index, "componentType": 5126, "type": kind, "count": numbers.len() / width,
            });
        }
        views[JOINTS] = vec![0; 12];
        accessors[JOINTS] = json!({ "bufferView": JOINTS, "componentType": 5121, "type": "VEC4", "count": 3 });
        views[INDICES] = vec![0, 0, 1, 0, 2, 0, 0, 0];
        accessors[INDICES] = json!({ "bufferView": INDICES, "componentType": 5123, "type": "SCALAR", "count": 3 });
        for (index, low, high) in [(POSITION, json!([0, 0, 0]), json!([1, 1, 0])), (TIMES, json!([0]), json!([1]))] {
            accessors[index]["min"] = low;
            accessors[index]["max"] = high;
        }
        accessors[MORPH]["min"] = json!([0, 0, 0]);
        accessors[MORPH]["max"] = json!([0, 0, 0]);
        let json = json!({
            "asset": { "version": "2.0" },
            "scene": 0, "scenes": [{ "nodes": [0, 1] }],
            "nodes": [{ "mesh": 0, "skin": 0 }, { "children": [2] }, { "camera": 0, "rotation": [0, 0, 0, 1] }],
            "meshes": [{
                "primitives": [{
                    "attributes": {
                        "POSITION": POSITION, "NORMAL": NORMAL, "TANGENT": TANGENT, "COLOR_0": COLOR,
                        "JOINTS_0": JOINTS, "WEIGHTS_0": WEIGHTS, "TEXCOORD_0": UV,
                    },
                    "indices": INDICES, "material": 0, "targets": [{ "POSITION": MORPH }],
                }],
                "weights": [0],
            }],
            "skins": [{ "joints": [1, 2], "skeleton": 1, "inverseBindMatrices": MATRICES }],
            "animations": [{
                "channels": [{ "sampler": 0, "target": { "node": 2, "path": "rotation" } }],
                "samplers": [{ "input": TIMES, "output": TURNS }],
            }],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1, "zfar": 9 } }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "textures": [{ "source": 0, "sampler": 0 }], "samplers": [{ "wrapS": 33071 }],
            "images": [{ "uri": format!("data:image/png;base64,{PIXEL}") }],
            "accessors": accessors,
        });
        Sample { json, views }
    }

    /// Sets a property, or removes it by null.
    fn set(&mut self, pointer: &str, value: Value) {
        let (above, key) = pointer.rsplit_once('/').unwrap();
        match self.json.pointer_mut(above) {
            Some(Value::Object(object)) if value.is_null() => drop(object.remove(key)),
            Some(Value::Object(object)) => drop(object.insert(key.to_owned(), value)),
            Some(Value::Array(list)) if key == "-" => list.push(value),
            Some(Value::Array(list)) => list[key.parse::<usize>().unwrap()] = value,
            _ => panic!("{pointer}"),
        }
    }

    fn float(&mut self, view: usize, index: usize, value: f32) {
        self.views[view][4 * index..][..4].copy_from_slice(&value.to_le_bytes());
    }

    /// Sets a property of a buffer view, which are made last.
    fn view(&mut self, view: usize, name: &str, value: Value) {
        self.json["views"][format!("{view} {name}")] = value;
    }

    fn told(mut self) -> String {
        let changes = self.json.as_object_mut().unwrap().remove("views");
        let (mut bytes, mut views) = (Vec::new(), Vec::new());
        for view in &self.views {
            views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": view.len() }));
            bytes.extend_from_slice(view);
        }
        for (name, value) in changes.iter().filter_map(Value::as_object).flatten() {
            let (view, name) = name.split_once(' ').unwrap();
            views[view.parse::<usize>().unwrap()][name] = value.clone();
        }
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&bytes));
        let more = self.json.as_object_mut().unwrap().remove("more");
        let mut buffers = vec![json!({ "byteLength": bytes.len(), "uri": uri })];
        buffers.extend(more);
        self.json["bufferViews"] = json!(views);
        self.json["buffers"] = json!(buffers);
        let assets = MemoryAssets::new().with("m.gltf", self.json.to_string());
        match load("m.gltf", &assets, &Staging::default()) {
            Ok((_, told)) => told.to_string(),
            Err(told) => told.to_string(),
        }
    }
}

#[test]
fn a_valid_document_breaks_no_rule() {
    assert_eq!(Sample::new().told(), "");
}

/// Each change of the valid document is told at its place with these words.
#[test]
fn broken_rules_are_told() {
    type Change = fn(&mut Sample);
    const ATTRIBUTES: &str = "/meshes/0/primitives/0/attributes";
    let rules: &[(Change, &str)] = &[
        // Form.
        (|s| s.set("/cameras/-", json!({})), "/cameras/1: missing field `type`"),
        (|s| s.set("/skins/-", json!({})), "/skins/1: its joints is missing"),
        (|s| s.set("/meshes/-", json!({ "primitives": [] })), "/meshes/1/primitives: is empty"),
        (|s| s.set("/materials/-", json!([])), "/materials/1: "),
        (|s| s.set("/extensions", json!({ "A_b": 1 })), "/extensions/A_b: it must be an object"),
        (|s| s.set("/extensionsUsed", json!([])), "/extensionsUsed: is empty"),
        (|s| s.set("/nodes/1/children", json!([2, 2])), "/nodes/1/children/1: 2 is listed twice"),
        (|s| s.set("/textures/-", json!({ "source": 7 })), "/textures/1/source: image 7 doesn't exist"),
        (|s| s.set("/skins/0/skeleton", json!(9)), "/skins/0/skeleton: node 9 doesn't exist; there are 3"),
        (|s| s.set("/nodes/2/rotation", json!([0, 0, 0, 2])), "/nodes/2/rotation/3: is 2; it must be between"),
        (|s| s.set("/samplers/0/wrapS", json!(1)), "/samplers/0/wrapS: is 1; it must be one of 33071"),
        (|s| s.set("/cameras/0/perspective/znear", json!(0)), "/znear: is 0; it must be more than 0"),
        (
            |s| {
                let texture = json!({ "sheenColorTexture": { "index": 3 } });
                s.set("/materials/0/extensions", json!({ "KHR_materials_sheen": texture }));
                s.set("/extensionsUsed", json!(["KHR_materials_sheen"]));
            },
            "/materials/0/extensions/KHR_materials_sheen/sheenColorTexture/index: texture 3 doesn't exist",
        ),
        // Extensions.
        (|s| s.set("/extensions", json!({ "A_b": {} })), "/extensions/A_b: it isn't in extensionsUsed"),
        (
            |s| s.set("/extensionsRequired", json!(["KHR_xmp_json_ld"])),
            "/extensionsRequired/0: \"KHR_xmp_json_ld\" isn't in extensionsUsed",
        ),
        // Buffers and views.
        (|s| s.json["more"] = json!({ "byteLength": 1, "uri": "none.bin" }), "/buffers/1/uri: there is no file"),
        (|s| s.json["more"] = json!({ "byteLength": 2, "uri": "data:a/b;base64,AA==" }), "/buffers/1/byteLength: is 2"),
        (|s| s.json["more"] = json!({ "byteLength": 1, "uri": "data:a/b;base64,AA==" }), "its media type is \"a/b\""),
        (|s| s.json["more"] = json!({ "byteLength": 1, "uri": "data:a/b;;base64,AA==" }), "no parameter of its media"),
        (|s| s.view(UV, "byteStride", json!(254)), "/bufferViews/6/byteStride: is 254"),
        (|s| s.view(TIMES, "target", json!(34963)), "/samplers/0/input: buffer view 9 holds keys"),
        (|s| s.view(TURNS, "byteLength", json!(999)), "/bufferViews/10/byteLength: from byte"),
        (|s| s.view(TURNS, "byteOffset", json!(9999)), "/bufferViews/10/byteOffset: is 9999"),
        (|s| s.view(TIMES, "byteStride", json!(4)), "/animations/0/samplers/0/input: its buffer view has a byteStride"),
        // Accessors.
        (|s| s.set("/accessors/3/normalized", json!(true)), "/accessors/3/normalized: FLOAT can't"),
        (|s| s.set("/accessors/3/min", json!([0])), "/accessors/3/min: it has 1 numbers, but its elements have 4"),
        (|s| s.set("/accessors/10/byteOffset", json!(2)), "/accessors/10/byteOffset: is 2; components of 4 bytes"),
        (|s| s.set("/accessors/8/byteOffset", json!(2)), "/accessors/8/byteOffset: is 2; matrices start"),
        (|s| s.set("/accessors/10/count", json!(3)), "/accessors/10: it has 48 bytes from 0 on, more than the 32"),
        (
            |s| s.view(TURNS, "byteStride", json!(4)),
            "/accessors/10: its elements of 16 bytes don't fit the byteStride 4",
        ),
        (
            |s| {
                s.set("/accessors/-", json!({ "byteOffset": 4, "componentType": 5126, "type": "VEC2", "count": 1 }));
            },
            "/accessors/12/byteOffset: it has no bufferView",
        ),
        (
            |s| {
                let part = json!({ "bufferView": TIMES, "componentType": 5121 });
                let sparse = json!({ "count": 5, "indices": part, "values": { "bufferView": TIMES } });
                s.set("/accessors/10/sparse", sparse);
            },
            "/accessors/10/sparse/count: is 5, more than the 2",
        ),
        // Meshes.
        (|s| s.set(&format!("{ATTRIBUTES}/OTHER"), json!(3)), "/attributes/OTHER: it's no attribute"),
        (|s| s.set(&format!("{ATTRIBUTES}/COLOR_01"), json!(3)), "/attributes/COLOR_01: it's no attribute"),
        (|s| s.set(&format!("{ATTRIBUTES}/COLOR_2"), json!(3)), "/attributes: it has COLOR_2, but not all sets"),
        (|s| s.set(&format!("{ATTRIBUTES}/WEIGHTS_0"), Value::Null), "it has 1 sets of JOINTS and 0 of WEIGHTS"),
        (|s| s.set(&format!("{ATTRIBUTES}/_OTHER"), json!(TIMES)), "/attributes/_OTHER: it has 2 elements, but"),
        (|s| s.set(&format!("{ATTRIBUTES}/TEXCOORD_0"), json!(NORMAL)), "/attributes/TEXCOORD_0: its elements are"),
        (|s| s.set("/accessors/0/min", Value::Null), "/attributes/POSITION: its accessor has no min and max"),
        (|s| s.set("/accessors/6/byteOffset", json!(2)), "/attributes/TEXCOORD_0: its elements don't start"),
        (|s| s.set("/accessors/1/bufferView", json!(POSITION)), "/bufferViews/0: several accessors"),
        (|s| s.set("/meshes/0/primitives/0/targets/0/_A", json!(MORPH)), "/targets/0/_A: the primitive itself"),
        (|s| s.set("/meshes/0/weights", json!([0, 1])), "/meshes/0/weights: it has 2 weights for 1 morph"),
        (
            |s| {
                let attributes = json!({ "POSITION": POSITION });
                s.set("/meshes/0/primitives/-", json!({ "attributes": attributes }));
            },
            "/meshes/0/primitives/1/targets: it has 0 targets, but the first primitive 1",
        ),
        (|s| s.set("/meshes/0/primitives/0/indices", json!(TIMES)), "/indices: its elements are SCALAR of FLOAT"),
        (
            |s| s.set("/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord", json!(1)),
            "/meshes/0/primitives/0/material: material 0 needs TEXCOORD_1",
        ),
        // Nodes, scenes and skins.
        (|s| s.set("/nodes/1/weights", json!([1])), "/nodes/1/weights: its node has no mesh"),
        (|s| s.set("/nodes/0/weights", json!([1, 2])), "/nodes/0/weights: it has 2 weights, but its mesh has 1"),
        (|s| s.set("/nodes/2/rotation", json!([0, 0, 0, 0.5])), "/nodes/2/rotation: its length is 0.5"),
        (
            |s| s.set("/nodes/2/matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
            "/nodes/2/matrix: its node has a rotation, too",
        ),
        (
            |s| s.set("/nodes/1/matrix", json!([1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
            "/nodes/1/matrix: it can't be taken apart",
        ),
        (|s| s.set("/nodes/-", json!({ "children": [2] })), "/nodes/3/children/0: node 2 is a child of node 1"),
        (|s| s.set("/nodes/-", json!({ "children": [3] })), "/nodes/3: it is below itself"),
        (|s| s.set("/scenes/-", json!({ "nodes": [2] })), "/scenes/1/nodes/0: node 2 is a child of node 1"),
        (|s| s.set("/scenes/-", json!({ "nodes": [0] })), "/nodes/0: it is in a scene without the joints"),
        (|s| s.set("/skins/-", json!({ "joints": [0, 2] })), "/skins/1/joints: there is no node above all"),
        (|s| s.set("/skins/0/skeleton", json!(2)), "/skins/0/skeleton: joint 1 isn't below node 2"),
        (|s| s.set("/skins/0/inverseBindMatrices", json!(UV)), "/skins/0/inverseBindMatrices: its elements are"),
        (
            |s| {
                let attributes = json!({ "POSITION": POSITION });
                s.set("/meshes/-", json!({ "primitives": [{ "attributes": attributes }] }));
                s.set("/nodes/-", json!({ "mesh": 1, "skin": 0 }));
            },
            "/nodes/3: it has a skin, but its mesh has no joints",
        ),
        // Animations.
        (|s| s.set("/animations/0/channels/0/sampler", json!(1)), "/channels/0/sampler: sampler 1 doesn't exist"),
        (
            |s| {
                let channel = s.json["animations"][0]["channels"][0].clone();
                s.set("/animations/0/channels/-", channel);
            },
            "/animations/0/channels/1/target: it has the same target as channel 0",
        ),
        (|s| s.set("/nodes/2", json!({ "matrix": [1] })), "/nodes/2/matrix: "),
        (
            |s| s.set("/animations/0/channels/0/target/path", json!("weights")),
            "/animations/0/channels/0/target: its node has no mesh with morph targets",
        ),
        (
            |s| s.set("/animations/0/channels/0/target/path", json!("scale")),
            "/animations/0/channels/0/sampler: its output is VEC4 of FLOAT; scale must be VEC3",
        ),
        (
            |s| s.set("/animations/0/samplers/0/interpolation", json!("CUBICSPLINE")),
            "/channels/0/sampler: its output has 2 elements, but its 2 keys need 3 each",
        ),
        (|s| s.set("/accessors/9/max", Value::Null), "/samplers/0/input: its accessor has no min and max"),
        // Cameras and images.
        (|s| s.set("/cameras/0/perspective/zfar", json!(0.05)), "/cameras/0/perspective: zfar is 0.05"),
        (|s| s.set("/cameras/-", json!({ "type": "orthographic" })), "/cameras/1: its orthographic is missing"),
        (|s| s.set("/images/-", json!({})), "/images/1: it has neither uri nor bufferView"),
        (|s| s.set("/images/-", json!({ "uri": "none.png" })), "/images/1/uri: there is no file"),
        (|s| s.set("/images/-", json!({ "bufferView": 0 })), "/images/1/bufferView: its image has no mimeType"),
        (
            |s| s.set("/images/-", json!({ "uri": format!("data:image/gif;base64,{PIXEL}") })),
            "/images/1/uri: its media type is \"image/gif\", but its bytes are image/png",
        ),
        (
            |s| s.set("/images/-", json!({ "uri": format!("data:image/png;base64,{}", &PIXEL[..24]) })),
            "/images/1: its PNG ends too early",
        ),
        // Numbers.
        (|s| s.float(POSITION, 3, 2.0), "/accessors/0/max: is 1 1 0, but the greatest of its elements is 2 1 0"),
        (|s| s.float(POSITION, 3, -2.0), "/accessors/0/min: is 0 0 0, but the least of its elements is -2 0 0"),
        (|s| s.float(TURNS, 3, f32::NAN), "/accessors/10: element 0 holds NaN"),
        (|s| s.float(NORMAL, 5, 2.0), "/attributes/NORMAL: normal 1 has length 2"),
        (|s| s.float(TANGENT, 4, 2.0), "/attributes/TANGENT: tangent 1 has length 2"),
        (|s| s.float(TANGENT, 7, 0.0), "/attributes/TANGENT: the last number of tangent 1 is 0"),
        (|s| s.float(COLOR, 4, 1.5), "/attributes/COLOR_0: colour 1 is 1.5 0.5 0.5 0.5"),
        (|s| s.float(WEIGHTS, 0, 1.5), "/attributes/WEIGHTS_0: the weights of vertex 0 have the sum 1.5"),
        (|s| s.float(WEIGHTS, 5, -1.0), "/attributes/WEIGHTS_0: a weight of vertex 1 is -1"),
        (|s| s.float(WEIGHTS, 1, 0.5), "/attributes/JOINTS_0: vertex 0 has joint 0 twice"),
        (|s| s.views[JOINTS][5] = 7, "/attributes/JOINTS_0: vertex 1 names joint 7, but the skin has 2"),
        (|s| s.views[INDICES][4] = 9, "/indices: index 2 is vertex 9, but there are 3"),
        (
            |s| {
                let primitive = s.json["meshes"][0]["primitives"][0].clone();
                s.set("/meshes/-", json!({ "primitives": [primitive] }));
                s.set("/nodes/0/mesh", json!(1));
                s.views.push(vec![0, 0, 255, 255, 1, 0]);
                s.set("/accessors/-", json!({ "bufferView": 12, "componentType": 5123, "type": "SCALAR", "count": 3 }));
                s.set("/meshes/0/primitives/0/indices", json!(12));
            },
            "/indices: index 1 is 65535, which would start a new primitive",
        ),
        (|s| s.float(MATRICES, 15, 2.0), "/inverseBindMatrices: the last row of matrix 0 isn't 0 0 0 1"),
        (|s| s.float(TIMES, 0, -1.0), "/samplers/0/input: key 0 is at -1 seconds"),
        (|s| s.float(TIMES, 1, 0.0), "/samplers/0/input: key 1 is at 0 seconds, not later"),
        (|s| s.float(TURNS, 7, 0.5), "/channels/0/sampler: the rotation of key 1 has length 0.5"),
    ];
    for (change, words) in rules {
        let mut sample = Sample::new();
        change(&mut sample);
        let told = sample.told();
        assert!(told.contains(words), "{words}: {told}");
    }
}

/// What the importer says itself isn't said again.
#[test]
fn a_place_is_told_once() {
    let mut sample = Sample::new();
    sample.set("/meshes/0/primitives/0/material", json!(3));
    let told = sample.told();
    assert_eq!(told.matches("/meshes/0/primitives/0/material: ").count(), 1, "{told}");
}

#[test]
fn many_broken_rules_are_counted() {
    let mut sample = Sample::new();
    sample.json["meshes"].as_array_mut().unwrap().extend(vec![json!({ "primitives": [] }); 2000]);
    let told = sample.told();
    assert!(told.matches("warning:").count() == 21 && told.contains("there are 1980 more warnings about it"), "{told}");
}
