//! Decoding of meshes from files. Nodes that name one file share its triangles.

use super::Decoder;
use super::fields::Fields;
use crate::diagnostic::{Diagnostics, Severity};
use crate::import;
use crate::text::report::Message;
use canaletto::scene::{self, Content};
use std::collections::HashMap;
use std::path::PathBuf;

/// The nodes of a file, by its path and the options `smooth` and `one-sided`.
pub(super) type Cache = HashMap<(PathBuf, Option<bool>, bool), Vec<scene::Node>>;

impl Decoder<'_> {
    /// Decodes the meshes of the node's file.
    pub(super) fn mesh(&mut self, fields: &Fields, material: Option<u32>) -> Option<Content> {
        let file = fields.text("file")?;
        let from = self.validator.files.get(fields.span("file").file)?.path.clone();
        let place = from.location().parent().map(|folder| folder.join(file)).unwrap_or_else(|| file.into());
        let key = (place, fields.flag("smooth"), fields.flag("one-sided").unwrap_or(false));
        let mut parts = match self.meshes.get(&key) {
            Some(parts) => parts.clone(),
            None => {
                let read = || import::load_objects(file, self.assets, &from);
                let (mut fragment, warnings) = match self.keep.get(format!("mesh {}", key.0.display()), read) {
                    Ok(model) => model,
                    Err(errors) => {
                        self.file_failed(fields, file, errors);
                        return None;
                    }
                };
                self.validator.report.append(warnings);
                for mesh in &mut fragment.meshes {
                    mesh.one_sided = key.2;
                    if key.1 == Some(false) {
                        mesh.normals.clear();
                    }
                    match mesh.check() {
                        Ok(()) if key.1 == Some(true) => mesh.smooth_normals(),
                        Ok(()) => {}
                        Err(problem) => {
                            self.validator.report.error(fields.span("file"), format!("\"{file}\": {problem}"));
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
        if let [scene::Node { content: Content::Mesh(one), .. }] = parts.as_slice() {
            return Some(Content::Mesh(*one));
        }
        // Each part is a node; the node's material replaces the material of the part.
        parts.iter_mut().for_each(|part| part.material = material.or(part.material));
        Some(Content::Group(parts))
    }

    /// Reports the mistakes in a file that a node names. A message about the whole file points at the node.
    pub(super) fn file_failed(&mut self, fields: &Fields, file: &str, errors: Diagnostics) {
        self.valid = false;
        let whole = errors.len() == 1 && errors.iter().all(|d| d.span.is_none() && d.severity == Severity::Error);
        if !whole {
            self.validator.report.append(errors);
            return;
        }
        for d in &errors {
            let text = if d.message.contains(file) { d.message.clone() } else { format!("\"{file}\": {}", d.message) };
            let message = Message::error(fields.span("file"), text).label(d.label.clone());
            self.validator.report.push(match &d.help {
                Some(help) => message.help(help.clone()),
                None => message,
            });
        }
    }
}
