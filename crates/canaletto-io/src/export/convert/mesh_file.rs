//! Meshes in files of their own: GLB without materials, whose `f32` come back to the last bit.

use crate::export::glb::{ARRAY_BUFFER, Binary, ELEMENT_ARRAY_BUFFER, FLOAT, UNSIGNED_INT, container};
use crate::picture::SOFTWARE;
use canaletto::shape::Mesh;
use glam::Vec3;
use serde_json::{Map, Value, json};

/// The arrays of a document so far.
#[derive(Default)]
pub(super) struct Arrays {
    pub(super) binary: Binary,
    pub(super) accessors: Vec<Value>,
}

impl Arrays {
    /// Adds the numbers of a vertex attribute; returns the number of its accessor.
    pub(super) fn numbers<const N: usize>(&mut self, list: impl Iterator<Item = [f32; N]> + Clone) -> usize {
        let bytes: Vec<u8> = list.clone().flatten().flat_map(f32::to_le_bytes).collect();
        let view = self.binary.push(&bytes, json!({ "target": ARRAY_BUFFER }));
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.accessors.push(json!({
            "bufferView": view, "componentType": FLOAT, "count": list.count(), "type": kind,
        }));
        self.accessors.len() - 1
    }

    /// Adds positions; returns the number of their accessor.
    pub(super) fn positions(&mut self, list: &[Vec3]) -> usize {
        let accessor = self.numbers(list.iter().map(Vec3::to_array));
        let all = || list.iter().copied();
        self.accessors[accessor]["min"] = json!(all().fold(Vec3::INFINITY, Vec3::min).to_array());
        self.accessors[accessor]["max"] = json!(all().fold(Vec3::NEG_INFINITY, Vec3::max).to_array());
        accessor
    }

    /// Adds the corners of triangles; returns the number of their accessor.
    pub(super) fn triangles(&mut self, list: impl Iterator<Item = [u32; 3]>) -> usize {
        let corners: Vec<u32> = list.flatten().collect();
        let bytes: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.binary.push(&bytes, json!({ "target": ELEMENT_ARRAY_BUFFER }));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": corners.len(), "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }

    /// Adds the vertices of a mesh; returns its attributes.
    pub(super) fn vertices(&mut self, mesh: &Mesh) -> Map<String, Value> {
        let mut attributes = Map::new();
        let mut add = |name: String, accessor: usize| _ = attributes.insert(name, json!(accessor));
        add("POSITION".into(), self.positions(&mesh.positions));
        if !mesh.normals.is_empty() {
            add("NORMAL".into(), self.numbers(mesh.normals.iter().map(Vec3::to_array)));
        }
        if !mesh.tangents.is_empty() {
            add("TANGENT".into(), self.numbers(mesh.tangents.iter().map(|t| t.to_array())));
        }
        let first = (!mesh.uvs.is_empty()).then_some(&mesh.uvs);
        let sets = first.into_iter().chain(&mesh.more_uvs);
        for (set, uvs) in sets.enumerate() {
            add(format!("TEXCOORD_{set}"), self.numbers(uvs.iter().map(|uv| uv.to_array())));
        }
        if !mesh.alphas.is_empty() {
            let color = |i: usize| mesh.colors.get(i).map_or([1.0; 3], |color| color.to_array());
            let with_alpha = mesh.alphas.iter().enumerate().map(|(i, alpha)| {
                let [r, g, b] = color(i);
                [r, g, b, *alpha]
            });
            add("COLOR_0".into(), self.numbers(with_alpha));
        } else if !mesh.colors.is_empty() {
            add("COLOR_0".into(), self.numbers(mesh.colors.iter().map(|color| color.to_array())));
        }
        attributes
    }

    /// The document with its arrays in a container. None if it is too large.
    pub(super) fn glb(self, mut root: Value) -> Option<Vec<u8>> {
        self.describe(&mut root, None);
        container(&root, self.binary.bytes)
    }

    /// The text of the document, and its bytes for a file of this name, if there are any.
    pub(super) fn apart(self, mut root: Value, file: &str) -> (Vec<u8>, Option<Vec<u8>>) {
        self.describe(&mut root, Some(file));
        let mut text = serde_json::to_vec_pretty(&root).unwrap_or_default();
        text.push(b'\n');
        (text, (!self.binary.bytes.is_empty()).then_some(self.binary.bytes))
    }

    fn describe(&self, root: &mut Value, file: Option<&str>) {
        if self.binary.bytes.is_empty() {
            return;
        }
        if !self.accessors.is_empty() {
            root["accessors"] = json!(self.accessors);
        }
        root["bufferViews"] = json!(self.binary.views);
        // The container pads its chunk, which the buffer may end before.
        let mut buffer = json!({ "byteLength": self.binary.bytes.len() });
        if let Some(file) = file {
            buffer["uri"] = json!(percent_encoded(file));
        }
        root["buffers"] = json!([buffer]);
    }
}

/// The slots that the triangles of a mesh use, in rising order.
pub(super) fn used_slots(mesh: &Mesh) -> Vec<u32> {
    let mut slots: Vec<u32> = if mesh.slots.is_empty() { vec![0] } else { mesh.slots.clone() };
    slots.sort_unstable();
    slots.dedup();
    slots
}

/// The triangles of a slot of a mesh.
pub(super) fn triangles_of(mesh: &Mesh, slot: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..mesh.len()).filter(move |i| mesh.slot(*i) == slot).map(|i| mesh.triangles[i])
}

/// The file of some meshes. A mesh has a primitive for each slot that its triangles use, in rising order.
pub(super) fn glb(meshes: &[&Mesh]) -> Option<Vec<u8>> {
    let mut arrays = Arrays::default();
    let mut infos = Vec::new();
    for mesh in meshes {
        let attributes = arrays.vertices(mesh);
        let mut primitive =
            |slot: &u32| json!({ "attributes": attributes, "indices": arrays.triangles(triangles_of(mesh, *slot)) });
        let primitives: Vec<Value> = used_slots(mesh).iter().map(&mut primitive).collect();
        infos.push(json!({ "name": mesh.name, "primitives": primitives }));
    }
    let nodes: Vec<Value> = (0..infos.len()).map(|i| json!({ "mesh": i })).collect();
    let all: Vec<usize> = (0..infos.len()).collect();
    arrays.glb(json!({
        "asset": { "version": "2.0", "generator": SOFTWARE },
        "scene": 0,
        "scenes": [{ "nodes": all }],
        "nodes": nodes,
        "meshes": infos,
    }))
}

/// A file's name as a part of a URI (RFC 3986).
pub(super) fn percent_encoded(name: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes()
        .map(|byte| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}
