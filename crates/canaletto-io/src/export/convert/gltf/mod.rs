//! glTF 2.0: meshes, materials, cameras and lights of points, in a tree of nodes. Round shapes become triangles.

mod lights;
mod materials;
mod textures;

use super::lost::Lost;
use super::mesh_file::{self, Arrays};
use super::names::Names;
use super::pictures::Originals;
use super::triangles::{Tessellator, span_of_scene};
use super::{Conversion, ConvertedFile, Source};
use crate::export::glb;
use crate::picture::SOFTWARE;
use canaletto::math::Transform;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::{Mesh, Shape};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use materials::MaterialKey;
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashMap};
use textures::TextureKey;

/// The most nodes of a document. Instances of groups are written one by one.
const MOST_NODES: usize = 1 << 20;

/// A document that is being written.
struct Writer<'a> {
    scene: &'a Scene,
    originals: &'a Originals,
    has_default_material: bool,
    tessellator: Tessellator,
    lost: Lost,
    names: Names,
    arrays: Arrays,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    images: Vec<Value>,
    lights: Vec<Value>,
    extensions: BTreeSet<&'static str>,
    /// The attributes of each mesh of the scene that was written.
    vertices: HashMap<u32, Map<String, Value>>,
    known_meshes: HashMap<(u32, Vec<Option<usize>>), usize>,
    /// The meshes of shapes and clouds, by their nodes and materials. Instances share them.
    own_meshes: HashMap<(*const Node, Option<u32>), (usize, DVec3)>,
    known_materials: HashMap<MaterialKey, usize>,
    known_textures: HashMap<TextureKey, Option<usize>>,
    known_images: HashMap<u32, Option<usize>>,
}

/// The files of a scene as glTF: one, or the document with its bytes beside it.
pub(super) fn convert(source: &Source, is_binary: bool) -> Conversion {
    let scene = source.scene;
    let mut writer = Writer {
        scene,
        originals: source.originals,
        has_default_material: source.has_default_material,
        tessellator: Tessellator::new(scene),
        lost: Lost::default(),
        names: Names::default(),
        arrays: Arrays::default(),
        nodes: Vec::new(),
        meshes: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        samplers: Vec::new(),
        images: Vec::new(),
        lights: Vec::new(),
        extensions: BTreeSet::new(),
        vertices: HashMap::new(),
        known_meshes: HashMap::new(),
        own_meshes: HashMap::new(),
        known_materials: HashMap::new(),
        known_textures: HashMap::new(),
        known_images: HashMap::new(),
    };
    super::lose_surroundings(scene, &mut writer.lost);
    let root = writer.document(source.stem);
    let Writer { arrays, mut lost, .. } = writer;
    let files = match is_binary {
        true => {
            let bytes = arrays.glb(root);
            if bytes.is_none() {
                lost.of_scene(glb::TOO_LARGE);
            }
            vec![ConvertedFile { name: format!("{}.glb", source.stem), bytes: bytes.unwrap_or_default() }]
        }
        false => {
            let (text, bytes) = arrays.apart(root, &format!("{}.bin", source.stem));
            let document = ConvertedFile { name: format!("{}.gltf", source.stem), bytes: text };
            let buffer = bytes.map(|bytes| ConvertedFile { name: format!("{}.bin", source.stem), bytes });
            [document].into_iter().chain(buffer).collect()
        }
    };
    Conversion { files, lost: lost.all }
}

impl Writer<'_> {
    /// The document without its arrays.
    fn document(&mut self, stem: &str) -> Value {
        let scene = self.scene;
        let mut roots: Vec<usize> =
            scene.nodes.iter().filter_map(|node| self.node(node, &Place::default(), None, 0)).collect();
        let mut cameras = Vec::new();
        let span = span_of_scene(scene);
        for view in &scene.views {
            if !view.motion.is_empty() {
                self.lost.add("motion of cameras while the shutter is open", &view.name);
            }
            if view.intrinsics.lens.is_some() || view.intrinsics.shift != [0.0; 2] {
                self.lost.add("lenses and shifts of cameras", &view.name);
            }
            self.nodes.push(glb::camera_node(view, cameras.len(), |v| v));
            roots.push(self.nodes.len() - 1);
            cameras.push(glb::camera(view, || glb::depth_behind(view, span.into_iter().filter(|p| p.is_finite()))));
        }
        let mut root = json!({
            "asset": { "version": "2.0", "generator": SOFTWARE },
            "scene": 0,
            "scenes": [{ "name": stem, "nodes": roots }],
        });
        let lists = [
            ("nodes", &self.nodes),
            ("meshes", &self.meshes),
            ("materials", &self.materials),
            ("textures", &self.textures),
            ("samplers", &self.samplers),
            ("images", &self.images),
            ("cameras", &cameras),
        ];
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            root[name] = json!(list);
        }
        if root["scenes"][0]["nodes"] == json!([]) {
            root["scenes"][0] = json!({ "name": stem });
        }
        if !self.lights.is_empty() {
            root["extensions"] = json!({ lights::PUNCTUAL: { "lights": self.lights } });
            self.extensions.insert(lights::PUNCTUAL);
        }
        if !self.extensions.is_empty() {
            root["extensionsUsed"] = json!(self.extensions);
        }
        root
    }

    /// Adds a node; returns its number. None if nothing of it is left.
    fn node(&mut self, node: &Node, around: &Place, inherited: Option<u32>, depth: usize) -> Option<usize> {
        if depth > Node::MAX_NESTING || self.nodes.len() >= MOST_NODES {
            self.lost.of_scene("objects beyond the first million, or too deep in groups");
            return None;
        }
        let shown = node.name.as_deref().unwrap_or("unnamed");
        if !node.motion.is_empty() {
            self.lost.add("motion while the shutter is open", shown);
        }
        if !node.casts_shadow {
            self.lost.add("objects without shadows", shown);
        }
        let own = around.sheared.after(&node.transform);
        let to_world = around.to_world.after(&node.transform);
        // glTF has no sheared nodes. What is in them is sheared itself.
        let (placed, sheared) = match parts(own.matrix()) {
            Some(_) => (own, Transform::IDENTITY),
            None => (Transform::IDENTITY, own),
        };
        let inside = Place { to_world, sheared };
        let material = node.material.or(inherited);
        let scene = self.scene;
        let mut made = match &node.content {
            Content::Light(light) => match sheared.is_identity() {
                true => self.light(light, shown)?,
                false => self.light(&light.transformed(&sheared), shown)?,
            },
            Content::Group(children) => {
                let children: Vec<usize> =
                    children.iter().filter_map(|child| self.node(child, &inside, material, depth + 1)).collect();
                (!children.is_empty()).then(|| json!({ "children": children }))?
            }
            Content::Instance(index) => {
                let prototype = scene.prototypes.get(*index as usize)?;
                json!({ "children": [self.node(prototype, &inside, material, depth + 1)?] })
            }
            Content::Mesh(index) => {
                let mesh = scene.meshes.get(*index as usize)?;
                match sheared.is_identity() {
                    true => {
                        let number = self.scene_mesh(*index, mesh, node.material, inherited)?;
                        self.at(json!({ "mesh": number }), mesh.origin)
                    }
                    false => {
                        let mesh = transformed(mesh, &sheared);
                        let number = self.parts_of(&mesh, node.material, inherited)?;
                        self.at(json!({ "mesh": number }), mesh.origin)
                    }
                }
            }
            Content::Shape(_) | Content::Spheres(_) | Content::Cylinders(_) => {
                let (number, origin) = self.own_mesh(node, &inside, material)?;
                self.at(json!({ "mesh": number }), origin)
            }
        };
        if let Some(name) = &node.name {
            made["name"] = json!(self.names.unique(name, "object"));
        }
        self.place(&mut made, &placed);
        self.nodes.push(made);
        Some(self.nodes.len() - 1)
    }

    /// The number of the mesh of a shape or cloud, and its origin.
    fn own_mesh(&mut self, node: &Node, place: &Place, material: Option<u32>) -> Option<(usize, DVec3)> {
        // The part of a plane that is there depends on its place.
        let is_same = place.sheared.is_identity() && !matches!(node.content, Content::Shape(Shape::Plane(_)));
        let key = (std::ptr::from_ref(node), material);
        if let Some(known) = self.own_meshes.get(&key).filter(|_| is_same) {
            return Some(*known);
        }
        let scene = self.scene;
        let (tessellator, lost) = (&self.tessellator, &mut self.lost);
        let mesh = match &node.content {
            Content::Shape(shape) => tessellator.shape(node, shape, &place.to_world, lost),
            Content::Spheres(index) => tessellator.spheres(scene.spheres.get(*index as usize)?, lost),
            Content::Cylinders(index) => tessellator.cylinders(scene.cylinders.get(*index as usize)?, lost),
            _ => None,
        }?;
        let mesh = if place.sheared.is_identity() { mesh } else { transformed(&mesh, &place.sheared) };
        let made = (self.parts_of(&mesh, None, material)?, mesh.origin);
        if is_same {
            self.own_meshes.insert(key, made);
        }
        Some(made)
    }

    /// A node whose coordinates are relative to an origin.
    fn at(&mut self, node: Value, origin: DVec3) -> Value {
        if origin == DVec3::ZERO { node } else { json!({ "children": [self.moved(node, origin)] }) }
    }

    /// Adds a node at another place; returns its number.
    fn moved(&mut self, mut node: Value, by: DVec3) -> usize {
        node["translation"] = json!(by.to_array());
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Sets the translation, rotation and scale of a node.
    fn place(&mut self, node: &mut Value, transform: &Transform) {
        if transform.is_identity() {
            return;
        }
        // A light's node has its own place, in its own space.
        if node.get("translation").is_some() {
            let inner = json!(node.clone());
            self.nodes.push(inner);
            *node = json!({ "children": [self.nodes.len() - 1] });
        }
        let Some((translation, rotation, scale)) = parts(transform.matrix()) else { return };
        if translation != DVec3::ZERO {
            node["translation"] = json!(translation.to_array());
        }
        if rotation != DQuat::IDENTITY {
            node["rotation"] = json!(rotation.to_array());
        }
        if scale != DVec3::ONE {
            node["scale"] = json!(scale.to_array());
        }
    }

    /// The number of a mesh of the scene with these materials.
    fn scene_mesh(&mut self, index: u32, mesh: &Mesh, own: Option<u32>, inherited: Option<u32>) -> Option<usize> {
        let slots = mesh_file::used_slots(mesh);
        let materials = self.materials_of(mesh, &slots, own, inherited);
        let key = (index, materials);
        if let Some(known) = self.known_meshes.get(&key) {
            return Some(*known);
        }
        if mesh.is_empty() {
            return None;
        }
        let attributes = match self.vertices.get(&index) {
            Some(known) => known.clone(),
            None => {
                let made = self.arrays.vertices(mesh);
                self.vertices.insert(index, made.clone());
                made
            }
        };
        let made = self.add_mesh(mesh, &attributes, &slots, &key.1);
        self.known_meshes.insert(key, made);
        Some(made)
    }

    /// The number of a mesh that the scene doesn't hold.
    fn parts_of(&mut self, mesh: &Mesh, own: Option<u32>, inherited: Option<u32>) -> Option<usize> {
        if mesh.is_empty() {
            return None;
        }
        let slots = mesh_file::used_slots(mesh);
        let materials = self.materials_of(mesh, &slots, own, inherited);
        let attributes = self.arrays.vertices(mesh);
        Some(self.add_mesh(mesh, &attributes, &slots, &materials))
    }

    fn materials_of(
        &mut self,
        mesh: &Mesh,
        slots: &[u32],
        own: Option<u32>,
        inherited: Option<u32>,
    ) -> Vec<Option<usize>> {
        let of_slot = |slot: &u32| own.or(mesh.materials.get(*slot as usize).copied()).or(inherited);
        slots.iter().map(|slot| self.material(of_slot(slot), mesh)).collect()
    }

    fn add_mesh(
        &mut self,
        mesh: &Mesh,
        attributes: &Map<String, Value>,
        slots: &[u32],
        materials: &[Option<usize>],
    ) -> usize {
        let mut primitives = Vec::new();
        for (slot, material) in slots.iter().zip(materials) {
            let indices = self.arrays.triangles(mesh_file::triangles_of(mesh, *slot));
            let mut primitive = json!({ "attributes": attributes, "indices": indices });
            if let Some(material) = material {
                primitive["material"] = json!(material);
            }
            primitives.push(primitive);
        }
        let mut made = json!({ "primitives": primitives });
        if !mesh.name.is_empty() {
            made["name"] = json!(mesh.name);
        }
        self.meshes.push(made);
        self.meshes.len() - 1
    }
}

/// Where a node's parent is.
#[derive(Clone, Copy)]
struct Place {
    /// From the parent's space to the scene's.
    to_world: Transform,
    /// The part of that which no node above has, since it shears.
    sheared: Transform,
}

impl Default for Place {
    fn default() -> Place {
        Place { to_world: Transform::IDENTITY, sheared: Transform::IDENTITY }
    }
}

/// A mesh after a map.
fn transformed(mesh: &Mesh, map: &Transform) -> Mesh {
    let mut moved = mesh.clone();
    let points: Vec<DVec3> = mesh.positions.iter().map(|p| map.point(mesh.origin + p.as_dvec3())).collect();
    moved.origin = if mesh.origin == DVec3::ZERO { DVec3::ZERO } else { points.first().copied().unwrap_or_default() };
    moved.positions = points.iter().map(|p| (*p - moved.origin).as_vec3()).collect();
    moved.normals.iter_mut().for_each(|n| *n = map.normal(n.as_dvec3()).normalize_or(DVec3::Y).as_vec3());
    let mirrors = map.matrix().matrix3.determinant() < 0.0;
    for tangent in &mut moved.tangents {
        let direction = map.vector(tangent.truncate().as_dvec3()).normalize_or(DVec3::X).as_vec3();
        *tangent = direction.extend(if mirrors { -tangent.w } else { tangent.w });
    }
    if mirrors {
        moved.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    moved
}

/// The translation, rotation and scale of a map; none if it shears.
fn parts(m: &DAffine3) -> Option<(DVec3, DQuat, DVec3)> {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let mut scale = DVec3::from_array(columns.map(|column| column.length()));
    if m.matrix3.determinant() < 0.0 {
        scale.x = -scale.x;
    }
    let turn = DMat3::from_cols(columns[0] / scale.x, columns[1] / scale.y, columns[2] / scale.z);
    let [x, y, z] = [turn.x_axis, turn.y_axis, turn.z_axis];
    let is_turn = [x.dot(y), y.dot(z), z.dot(x)].into_iter().all(|cos| cos.abs() < 1e-7);
    let rotation = if turn == DMat3::IDENTITY { DQuat::IDENTITY } else { DQuat::from_mat3(&turn).normalize() };
    is_turn.then_some((m.translation, rotation, scale))
}
