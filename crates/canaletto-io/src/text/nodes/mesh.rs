//! The node of meshes from files. Nodes that name one file share its triangles.

use super::shapes::ONE_SIDED;
use super::{CASTS_SHADOW, MATERIAL, NAME, ObjectNode, ObjectReader};
use crate::diagnostic::{Diagnostics, Severity};
use crate::import;
use crate::text::decode::Decoder;
use crate::text::reader::{Entry, Fields};
use crate::text::report::Message;
use crate::text::schema::{Block, Field, NodeSchema, Text};
use crate::text::syntax::Span;
use canaletto::OutOfRange;
use canaletto::scene::{self, Content, Fragment};
use canaletto::shape::Mesh;
use std::collections::HashMap;
use std::path::PathBuf;

pub(super) const FILE: Field<Text> =
    Field::text("file", "the file; relative paths start at this file's folder").needed();
const SMOOTH: Field<bool> = Field::new(
    "smooth",
    "#true makes normals at the vertices from the faces around them, #false leaves out those of the file",
)
.or(|| "as in the file".into());
const PART_MATERIAL: Field<Text> = Field::text("material", "the material's name").needed();

/// `part` in a mesh.
pub(crate) static PART: NodeSchema = NodeSchema::new("part", "The material of a part of a mesh.", &[])
    .argument(PART_MATERIAL.schema)
    .example("mesh file=\"bunny.obj\" { part \"blue\" }");

const PART_FIELD: Field<Block> = Field::block(
    &PART,
    "the material of a part of the file in place of its own, once for each part in their order: the parts become one \
     mesh, which is closed if all of them are together",
)
.many();

pub(super) static MESH: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "mesh",
        "The objects of a file: glTF (with its materials, lights and cameras), OBJ (with its MTL materials), PLY or \
         STL. A material given here replaces the file's own.",
        &[
            &[FILE.schema, SMOOTH.schema, ONE_SIDED.schema, PART_FIELD.schema],
            &[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema],
        ],
    )
    .argument(NAME.schema)
    .transforms()
    .example("mesh file=\"bunny.obj\" material=\"blue\" { scale 10; rotate-y 30; translate 0 1 0 }"),
    read: ObjectReader::Content(|decoder, f, material| {
        let parts = f.every(&PART_FIELD).map(|part| decoder.part_material(part)).collect();
        decoder.mesh(f, f.get(&SMOOTH), f.get(&ONE_SIDED), (material, parts))
    }),
};

/// The nodes of a file, by its path, the options `smooth` and `one-sided` and the materials of its parts.
pub(crate) type MeshCache = HashMap<(PathBuf, Option<bool>, Option<bool>, Vec<u32>), Vec<scene::Node>>;

/// The meshes of a file as one, whose parts have these materials in their order.
fn joined(fragment: &Fragment, materials: Vec<u32>) -> Result<Mesh, String> {
    let mut meshes = Vec::new();
    let mut left: Vec<&scene::Node> = fragment.nodes.iter().rev().collect();
    while let Some(node) = left.pop() {
        if !node.transform.is_usual() {
            return Err("its parts have places of their own, so they can't be one mesh; leave out part".into());
        }
        match &node.content {
            Content::Group(children) => left.extend(children.iter().rev()),
            Content::Mesh(index) => meshes.extend(fragment.meshes.get(*index as usize)),
            _ => return Err("it holds more than triangles, so it can't be one mesh; leave out part".into()),
        }
    }
    let count: usize = meshes.iter().map(|mesh| mesh.materials.len().max(1)).sum();
    if count != materials.len() {
        return Err(format!("part stands {} times, but the file has {count} parts", materials.len()));
    }
    let mut whole = Mesh { materials, ..Mesh::default() };
    for (i, mesh) in meshes.iter().enumerate() {
        if i == 0 {
            (whole.name, whole.origin, whole.one_sided) = (mesh.name.clone(), mesh.origin, mesh.one_sided);
            whole.more_uvs = vec![Vec::new(); mesh.more_uvs.len()];
        }
        append(&mut whole, mesh);
    }
    if count == 1 {
        whole.slots = Vec::new();
    }
    // Lists that some parts lack have too few entries.
    whole.check().map(|()| whole).map_err(|problem| format!("its parts have different data: {problem}"))
}

/// Appends a part to a mesh.
fn append(whole: &mut Mesh, part: &Mesh) {
    let first = whole.positions.len() as u32;
    let slot = whole.slots.last().map_or(0, |last| last + 1);
    let moved = (part.origin - whole.origin).as_vec3();
    whole.positions.extend(part.positions.iter().map(|p| *p + moved));
    whole.normals.extend(&part.normals);
    whole.uvs.extend(&part.uvs);
    whole.more_uvs.iter_mut().zip(&part.more_uvs).for_each(|(set, more)| set.extend(more));
    whole.tangents.extend(&part.tangents);
    whole.colors.extend(&part.colors);
    whole.alphas.extend(&part.alphas);
    whole.triangles.extend(part.triangles.iter().map(|corners| corners.map(|v| v + first)));
    whole.slots.extend((0..part.len()).map(|i| slot + part.slot(i)));
}

/// Gives a part, and the parts in it, a material.
fn repaint(part: &mut scene::Node, material: u32) {
    match &mut part.content {
        Content::Group(children) => children.iter_mut().for_each(|child| repaint(child, material)),
        Content::Light(_) => {}
        _ => part.material = Some(material),
    }
}

impl Decoder<'_> {
    /// Decodes the meshes of the node's file. `smooth` makes normals, or leaves out those of the file.
    pub(super) fn mesh(
        &mut self,
        fields: &Fields,
        smooth: Option<bool>,
        one_sided: Option<bool>,
        (material, of_parts): (Option<u32>, Vec<u32>),
    ) -> Option<Content> {
        let file = fields.text(&FILE)?;
        let from = self.validator.files.get(fields.span(&FILE).file)?.path.clone();
        let place = from.location().parent().map(|folder| folder.join(file)).unwrap_or_else(|| file.into());
        let key = (place, smooth, one_sided, of_parts);
        let mut parts = match self.meshes.get(&key) {
            Some(parts) => parts.clone(),
            None => {
                let read = || import::load_objects(file, self.assets, &from);
                let (mut fragment, warnings) = match self.keep.get(format!("mesh {}", key.0.display()), read) {
                    Ok(model) => model,
                    Err(errors) => {
                        self.file_failed(file, fields.span(&FILE), errors);
                        return None;
                    }
                };
                self.validator.report.append(warnings);
                if !key.3.is_empty() {
                    fragment = self.of_one_mesh(fields, &fragment, key.3.clone())?;
                }
                for mesh in &mut fragment.meshes {
                    mesh.one_sided = one_sided.unwrap_or(mesh.one_sided);
                    if smooth == Some(false) {
                        mesh.normals.clear();
                    }
                    match mesh.check() {
                        Ok(()) if smooth == Some(true) => mesh.smooth_normals(),
                        Ok(()) => {}
                        Err(problem) => {
                            self.validator.report.error(fields.span(&FILE), format!("\"{file}\": {problem}"));
                            self.valid = false;
                        }
                    }
                }
                let mut parts = std::mem::take(&mut fragment.nodes);
                let materials: Vec<Vec<u32>> = match key.3.is_empty() {
                    true => Vec::new(),
                    false => fragment.meshes.iter_mut().map(|mesh| std::mem::take(&mut mesh.materials)).collect(),
                };
                self.scene.append(fragment).shift_nodes(&mut parts);
                // The materials of parts are the scene's already.
                for (mesh, materials) in self.scene.meshes.iter_mut().rev().zip(materials.into_iter().rev()) {
                    mesh.materials = materials;
                }
                self.used.resize(self.scene.materials.len(), true);
                self.meshes.insert(key, parts.clone());
                parts
            }
        };
        if let [scene::Node { content: Content::Mesh(one), material: None, transform, .. }] = parts.as_slice()
            && transform.is_usual()
        {
            return Some(Content::Mesh(*one));
        }
        // The node's material replaces that of each part.
        if let Some(material) = material {
            parts.iter_mut().for_each(|part| repaint(part, material));
        }
        Some(Content::Group(parts))
    }

    /// The material that a part names.
    fn part_material(&mut self, part: &Entry) -> u32 {
        let name = match part.node {
            Some(node) => {
                let fields = self.validator.fields(node, &PART, PART.name);
                self.valid &= fields.valid;
                fields.text(&PART_MATERIAL)
            }
            None => part.values.first().and_then(|value| value.as_text()),
        };
        name.and_then(|name| self.named_material(name, part.span)).unwrap_or(0)
    }

    /// The meshes of a file as one, with a material for each part.
    fn of_one_mesh(&mut self, fields: &Fields, fragment: &Fragment, materials: Vec<u32>) -> Option<Fragment> {
        if fields.has(&MATERIAL) {
            let problem = "is given twice, for all and for parts; leave one out";
            self.out_of_range(fields, &OutOfRange::new(MATERIAL.name(), problem));
            return None;
        }
        match joined(fragment, materials) {
            Ok(mesh) => {
                let nodes = vec![scene::Node::new(Content::Mesh(0))];
                Some(Fragment { nodes, meshes: vec![mesh], ..Fragment::default() })
            }
            Err(problem) => {
                self.validator.report.error(fields.span(&PART_FIELD), problem);
                self.valid = false;
                None
            }
        }
    }

    /// Reports the mistakes in a file that a node names. A message about the whole file points at the name, `span`.
    pub(super) fn file_failed(&mut self, file: &str, span: Span, errors: Diagnostics) {
        self.valid = false;
        let whole = errors.len() == 1 && errors.iter().all(|d| d.span.is_none() && d.severity == Severity::Error);
        if !whole {
            self.validator.report.append(errors);
            return;
        }
        for d in &errors {
            let text = if d.message.contains(file) { d.message.clone() } else { format!("\"{file}\": {}", d.message) };
            let message = Message::error(span, text).label(d.label.clone());
            self.validator.report.push(match &d.help {
                Some(help) => message.help(help.clone()),
                None => message,
            });
        }
    }
}
