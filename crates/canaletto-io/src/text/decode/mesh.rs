//! Decoding of meshes from files. Nodes that name one file share its triangles.

use super::Decoder;
use super::fields::Fields;
use crate::diagnostic::{Diagnostics, Severity};
use crate::import;
use crate::text::report::Message;
use canaletto::scene::{self, Content};
use std::collections::HashMap;
use std::path::PathBuf;

/// Mesh indices by the path of the file and the options `smooth` and `one-sided`.
pub(super) type Cache = HashMap<(PathBuf, Option<bool>, bool), Vec<u32>>;

impl Decoder<'_> {
    /// Decodes the meshes of the node's file.
    pub(super) fn mesh(&mut self, fields: &Fields, material: Option<u32>) -> Option<Content> {
        let file = fields.text("file")?;
        let from = self.validator.files.get(fields.span("file").file)?.path.clone();
        let place = from.location().parent().map(|folder| folder.join(file)).unwrap_or_else(|| file.into());
        let key = (place, fields.flag("smooth"), fields.flag("one-sided").unwrap_or(false));
        let indices = match self.meshes.get(&key) {
            Some(indices) => indices.clone(),
            None => {
                let read = || import::load_mesh(file, self.assets, &from);
                let model = match self.keep.get(format!("mesh {}", key.0.display()), read) {
                    Ok(model) => model,
                    Err(errors) => {
                        self.file_failed(fields, file, errors);
                        return None;
                    }
                };
                self.validator.report.append(model.warnings);
                let first = self.scene.materials.len() as u32;
                self.scene.materials.extend(model.materials);
                self.used.resize(self.scene.materials.len(), true);
                let start = self.scene.meshes.len() as u32;
                for mut mesh in model.meshes {
                    mesh.materials.iter_mut().for_each(|m| *m += first);
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
                    self.scene.meshes.push(mesh);
                }
                let indices: Vec<u32> = (start..self.scene.meshes.len() as u32).collect();
                self.meshes.insert(key, indices.clone());
                indices
            }
        };
        if let [one] = indices.as_slice() {
            return Some(Content::Mesh(*one));
        }
        // Each part is a node; the node's material replaces the material of the part.
        let part = |index: u32| {
            let name = Some(self.scene.meshes[index as usize].name.clone()).filter(|name| !name.is_empty());
            scene::Node { name: name.map(Into::into), material, ..scene::Node::new(Content::Mesh(index)) }
        };
        Some(Content::Group(indices.into_iter().map(part).collect()))
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
