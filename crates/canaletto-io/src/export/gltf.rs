//! glTF 2.0 in one binary file (Khronos, *glTF 2.0 Specification*, chapter 4, "GLB File Format").
//!
//! Finished colours are unlit materials (`KHR_materials_unlit`) with a base colour texture on the second set of texture
//! coordinates. Core glTF has no slot for light alone, so its file is named in the `extras` of materials.

use super::glb::{
    self, ARRAY_BUFFER, Binary, CLAMP_TO_EDGE, ELEMENT_ARRAY_BUFFER, FLOAT, LINEAR, LINEAR_MIPMAP_LINEAR, UNSIGNED_INT,
};
use super::{Export, LIGHT, LightMaps};
use crate::picture::{PictureError, SOFTWARE};
use canaletto::bake::{BakedPart, BakedVertex};
use canaletto::material::Material;
use canaletto::math::Rgb;
use canaletto::scene::View;
use glam::{DVec3, Vec3};
use serde_json::{Map, Value, json};

/// The set of texture coordinates of the light map.
const LIGHT_SET: u32 = 1;

/// The content of each file.
pub(super) fn files(export: &Export) -> Result<Vec<Vec<u8>>, PictureError> {
    let mut files = vec![glb(export)?];
    if export.maps == LightMaps::Light {
        files.push(export.light_exr()?);
    }
    Ok(files)
}

/// A vertex attribute of all parts.
struct Attribute {
    name: &'static str,
    kind: &'static str,
    /// The components of a vertex.
    of: fn(&Export, &BakedVertex) -> Vec<f32>,
}

const ATTRIBUTES: [Attribute; 4] = [
    Attribute { name: "POSITION", kind: "VEC3", of: |export, v| export.position(v.position).to_array().to_vec() },
    Attribute { name: "NORMAL", kind: "VEC3", of: |export, v| export.position(v.normal).to_array().to_vec() },
    // Images begin at the top in glTF.
    Attribute { name: "TEXCOORD_0", kind: "VEC2", of: |_, v| vec![v.uv.x, 1.0 - v.uv.y] },
    Attribute { name: "TEXCOORD_1", kind: "VEC2", of: |_, v| v.light_uv.to_array().to_vec() },
];

fn glb(export: &Export) -> Result<Vec<u8>, PictureError> {
    let mut binary = Binary::default();
    let parts = || export.baked.meshes.iter().flat_map(|mesh| &mesh.parts);
    let mut accessors = Vec::new();
    for attribute in &ATTRIBUTES {
        let components = if attribute.kind == "VEC3" { 3 } else { 2 };
        let view = binary.views.len();
        let mut bytes = Vec::new();
        for part in parts() {
            let values: Vec<f32> = part.vertices.iter().flat_map(|vertex| (attribute.of)(export, vertex)).collect();
            let mut accessor = json!({
                "bufferView": view, "byteOffset": bytes.len(), "componentType": FLOAT, "count": part.vertices.len(),
                "type": attribute.kind,
            });
            if attribute.name == "POSITION" {
                let all = || values.chunks_exact(3).map(Vec3::from_slice);
                accessor["min"] = json!(all().fold(Vec3::INFINITY, Vec3::min).to_array());
                accessor["max"] = json!(all().fold(Vec3::NEG_INFINITY, Vec3::max).to_array());
            }
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            accessors.push(accessor);
        }
        binary.push(&bytes, json!({ "target": ARRAY_BUFFER, "byteStride": 4 * components }));
    }
    let view = binary.views.len();
    let mut bytes = Vec::new();
    for part in parts() {
        let count = 3 * part.triangles.len();
        accessors.push(json!({
            "bufferView": view, "byteOffset": bytes.len(), "componentType": UNSIGNED_INT, "count": count,
            "type": "SCALAR",
        }));
        bytes.extend(part.triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes()));
    }
    binary.push(&bytes, json!({ "target": ELEMENT_ARRAY_BUFFER }));

    let mut materials = Materials { export, keys: Vec::new(), materials: Vec::new() };
    let count = parts().count();
    let mut number = 0;
    let mut nodes = Vec::new();
    let mut meshes = Vec::new();
    for mesh in &export.baked.meshes {
        let primitive = |part: &BakedPart| {
            let attributes: Map<String, Value> = ATTRIBUTES
                .iter()
                .enumerate()
                .map(|(i, attribute)| (attribute.name.to_owned(), json!(i * count + number)))
                .collect();
            let indices = ATTRIBUTES.len() * count + number;
            number += 1;
            json!({ "attributes": attributes, "indices": indices, "material": materials.number(part) })
        };
        let primitives: Vec<Value> = mesh.parts.iter().map(primitive).collect();
        let mut node = json!({ "name": mesh.name, "mesh": meshes.len() });
        if export.origin != DVec3::ZERO {
            node["translation"] = json!(export.point(export.origin).to_array());
        }
        meshes.push(json!({ "name": mesh.name, "primitives": primitives }));
        nodes.push(node);
    }
    let mut cameras = Vec::new();
    for view in export.views {
        nodes.push(glb::camera_node(view, cameras.len(), |v| export.point(v)));
        cameras.push(glb::camera(view, || depth_behind_all(export, view)));
    }
    let materials = materials.materials;
    let all: Vec<usize> = (0..nodes.len()).collect();
    let mut root = json!({
        "asset": { "version": "2.0", "generator": SOFTWARE },
        "scene": 0,
        "scenes": [{ "name": export.stem, "nodes": all }],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
    });
    if !cameras.is_empty() {
        root["cameras"] = json!(cameras);
    }
    let text = |key: &str| materials.iter().any(|material| material.to_string().contains(key));
    if text("\"baseColorTexture\"") {
        let view = binary.push(&export.color_png()?, json!({}));
        root["images"] = json!([{ "name": "light map", "bufferView": view, "mimeType": "image/png" }]);
        root["samplers"] = json!([{
            "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
        }]);
        root["textures"] = json!([{ "sampler": 0, "source": 0 }]);
    }
    let extensions: Vec<&str> = EXTENSIONS.into_iter().filter(|extension| text(extension)).collect();
    if !extensions.is_empty() {
        root["extensionsUsed"] = json!(extensions);
    }
    root["materials"] = json!(materials);
    root["bufferViews"] = json!(binary.views);
    root["buffers"] = json!([{ "byteLength": binary.bytes.len() }]);
    glb::container(&root, binary.bytes).ok_or_else(|| PictureError::Unfit(glb::TOO_LARGE.to_owned()))
}

const UNLIT: &str = "KHR_materials_unlit";
const EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";
const EXTENSIONS: [&str; 2] = [UNLIT, EMISSIVE_STRENGTH];

/// The materials of the file. Equal ones are written once.
struct Materials<'a> {
    export: &'a Export<'a>,
    keys: Vec<(u32, bool, bool)>,
    materials: Vec<Value>,
}

impl Materials<'_> {
    /// The number of a part's material.
    fn number(&mut self, part: &BakedPart) -> usize {
        let source = &self.export.materials[part.material as usize];
        let key = match self.export.maps {
            LightMaps::Combined => (part.material, true, true),
            LightMaps::Light => (part.material, part.is_outer || !source.may_emit(), part.constant.is_some()),
        };
        if let Some(number) = self.keys.iter().position(|other| *other == key) {
            return number;
        }
        self.keys.push(key);
        let mut material = match self.export.maps {
            LightMaps::Combined => combined(),
            LightMaps::Light => self.lit(part),
        };
        if !source.name.is_empty() {
            material["name"] = json!(source.name);
        }
        set_alpha(source, &mut material);
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// A diffuse material that waits for its light.
    fn lit(&self, part: &BakedPart) -> Value {
        let mut surface = json!({ "metallicFactor": 0.0, "roughnessFactor": 1.0 });
        let mut material = json!({
            "extras": { "lightMap": {
                "file": format!("{}{LIGHT}", self.export.stem), "texCoord": LIGHT_SET, "quantity": "irradiance",
            } },
        });
        match &part.constant {
            None => surface["baseColorTexture"] = json!({ "index": 0, "texCoord": LIGHT_SET }),
            Some(point) => {
                let [r, g, b] = point.classic.kd.to_array().map(|v| v.clamp(0.0, 1.0));
                surface["baseColorFactor"] = json!([r, g, b, point.opacity_with_coverage().clamp(0.0, 1.0)]);
                set_emission(point.emitted(part.is_outer), &mut material);
            }
        }
        material["pbrMetallicRoughness"] = surface;
        material
    }
}

/// A material whose texture is shown as it is.
fn combined() -> Value {
    json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0, "texCoord": LIGHT_SET }, "metallicFactor": 0.0, "roughnessFactor": 1.0,
        },
        "extensions": { UNLIT: {} },
    })
}

fn set_emission(emission: Rgb, material: &mut Value) {
    let largest = emission.max_component();
    if largest <= 0.0 {
        return;
    }
    let strength = largest.max(1.0);
    material["emissiveFactor"] = json!(emission.to_array().map(|v| v / strength));
    if strength > 1.0 {
        material["extensions"] = json!({ EMISSIVE_STRENGTH: { "emissiveStrength": strength } });
    }
}

/// Whether a material is blended or cut out.
fn set_alpha(source: &Material, material: &mut Value) {
    let is_cut_out = source.coverage >= 1.0 && source.classic().opacity >= 1.0;
    if !source.is_opaque() {
        material["alphaMode"] = json!(if is_cut_out { "MASK" } else { "BLEND" });
    }
}

/// A distance along the view direction beyond all triangles. glTF's orthographic cameras need a far plane.
fn depth_behind_all(export: &Export, view: &View) -> f64 {
    let vertices = export.baked.meshes.iter().flat_map(|mesh| &mesh.parts).flat_map(|part| &part.vertices);
    glb::depth_behind(view, vertices.map(|vertex| export.origin + vertex.position.as_dvec3()))
}
