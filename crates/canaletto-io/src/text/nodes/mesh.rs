//! The node of meshes from files. Nodes that name one file share its triangles.

use super::shapes::ONE_SIDED;
use super::{CASTS_SHADOW, MATERIAL, NAME, ObjectNode, ObjectReader};
use crate::diagnostic::{Diagnostics, Severity};
use crate::import;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, NodeSchema, Text};
use crate::text::syntax::Span;
use canaletto::scene::{self, Content};
use std::collections::HashMap;
use std::path::PathBuf;

pub(super) const FILE: Field<Text> =
    Field::text("file", "the file; relative paths start at this file's folder").needed();
const SMOOTH: Field<bool> = Field::new(
    "smooth",
    "#true makes normals at the vertices from the faces around them, #false leaves out those of the file",
)
.or(|| "as in the file".into());

pub(super) static MESH: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "mesh",
        "The objects of a file: glTF (with its materials, lights and cameras), OBJ (with its MTL materials), PLY or STL. \
         A material given here replaces the file's own.",
        &[&[FILE.schema, SMOOTH.schema, ONE_SIDED.schema], &[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema]],
    )
    .argument(NAME.schema)
    .transforms()
    .example("mesh file=\"bunny.obj\" material=\"blue\" { scale 10; rotate-y 30; translate 0 1 0 }"),
    read: ObjectReader::Content(|decoder, f, material| {
        decoder.mesh(f, f.get(&SMOOTH), f.get(&ONE_SIDED), material)
    }),
};

/// The nodes of a file, by its path and the options `smooth` and `one-sided`.
pub(crate) type MeshCache = HashMap<(PathBuf, Option<bool>, Option<bool>), Vec<scene::Node>>;

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
        material: Option<u32>,
    ) -> Option<Content> {
        let file = fields.text(&FILE)?;
        let from = self.validator.files.get(fields.span(&FILE).file)?.path.clone();
        let place = from.location().parent().map(|folder| folder.join(file)).unwrap_or_else(|| file.into());
        let key = (place, smooth, one_sided);
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
                self.scene.append(fragment).shift_nodes(&mut parts);
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
