//! Wavefront OBJ (*Advanced Visualizer* manual, appendix B), its polygons with their materials.
//!
//! Read by our own code and not by crate `tobj`, whose errors know no lines, whose fans turn concave polygons inside
//! out, and which makes a mesh for each material. Two passes over the text: the vertices and materials, then the
//! faces, so that faces may come before their vertices. Both go over [pieces](super::text) of the file in parallel; that
//! the pieces' results are put together in the order of the file makes them those of a single piece.
//!
//! Each object or group is one mesh, `object/group` if both are named; a group that comes again goes on. Vertex colours
//! (`v x y z r g b`, 0 to 1) are sRGB, as Blender and MeshLab write them. Smoothing groups are ignored.

mod faces;
mod parts;
mod vertices;

use super::ignored::Ignored;
use super::lines::{Complaint, Word};
use super::text::Text;
use super::{Imported, mtl};
use crate::assets::{AssetError, Assets, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::material::{Material, Phong};
use canaletto::shape::Mesh;
use faces::{Faces, Mark, NONE};
use parts::Parts;
use std::collections::HashMap;
use std::ops::Range;
use vertices::First;

/// Meshes and materials of an OBJ file.
pub(super) fn read(asset: &OpenAsset, assets: &dyn Assets) -> Result<Imported, Diagnostics> {
    read_pieces(asset, assets, Text::new(asset.content.view()))
}

fn read_pieces(asset: &OpenAsset, assets: &dyn Assets, text: Text<'_>) -> Result<Imported, Diagnostics> {
    let file = asset.path.name();
    let mut reader = Reader { asset, assets, warnings: Diagnostics::new(), materials: Vec::new() };
    let result = vertices::read(text).and_then(|first| {
        first.libraries.iter().for_each(|(start, text)| reader.materials(Word { start: *start, text }));
        reader.faces(text, first)
    });
    let Reader { mut warnings, materials, .. } = reader;
    match result {
        Ok((meshes, default)) => {
            let mut materials = materials;
            materials.extend(default);
            super::attach_source(&mut warnings, file, text.view);
            Ok(Imported { meshes, materials, warnings })
        }
        Err(complaint) => {
            let mut errors = Diagnostics::from(complaint.error(file));
            super::attach_source(&mut errors, file, text.view);
            Err(errors)
        }
    }
}

struct Reader<'a> {
    asset: &'a OpenAsset,
    assets: &'a dyn Assets,
    warnings: Diagnostics,
    materials: Vec<Material>,
}

impl Reader<'_> {
    /// Reads the materials of `mtllib`: one name with spaces, or else several names. What is missing is a warning.
    fn materials(&mut self, names: Word<'_>) {
        let read = |name: &str| match self.assets.read(name, &self.asset.path) {
            Err(AssetError::Missing { .. }) if name.contains('\\') => {
                self.assets.read(&name.replace('\\', "/"), &self.asset.path)
            }
            other => other,
        };
        let whole = (names, read(&names.string()));
        let found = match &whole.1 {
            Err(AssetError::Missing { .. }) if names.words().count() > 1 => {
                unescaped(names).into_iter().map(|(word, name)| (word, read(&name))).collect()
            }
            _ => vec![whole],
        };
        for (word, result) in found {
            match result {
                Ok(asset) => {
                    let mut warnings = Diagnostics::new();
                    self.materials.extend(mtl::read(asset.path.name(), &asset.bytes, &mut warnings));
                    super::attach_source(&mut warnings, asset.path.name(), asset.bytes.as_slice().into());
                    self.warnings.append(warnings);
                }
                Err(error) => {
                    let mut warning = Diagnostic::warning(self.asset.path.name(), error.to_string()).at(word.span());
                    warning.help = error.help();
                    warning.label = "its materials are left out".into();
                    self.warnings.push(warning);
                }
            }
        }
    }

    /// The second pass: faces and what groups them. With them comes the material of those that have none, if it is needed.
    fn faces(&mut self, text: Text<'_>, first: First) -> Result<(Vec<Mesh>, Option<Material>), Complaint> {
        let by_name: HashMap<&[u8], u32> =
            self.materials.iter().enumerate().rev().map(|(i, m)| (m.name.as_bytes(), i as u32)).collect();
        let file = self.asset.path.name();
        let mut grouping = Grouping {
            unnamed: file.rsplit('/').next().unwrap_or_default(),
            object: String::new(),
            group: String::new(),
            material: NONE,
            place: None,
        };
        let mut parts = Parts::default();
        let (mut ignored, mut unknown) = (Ignored::default(), Ignored::default());
        text.each(
            &first.others,
            |index, piece| faces::read(piece, first.before[index], &first.vertices),
            |_, found| {
                let Faces { triangles, marks, ignored: more } = found?;
                ignored.append(more);
                let mut start = 0;
                for (end, mark) in marks {
                    grouping.run(start..end, &mut parts);
                    start = end;
                    grouping.place = None;
                    match mark {
                        Mark::Object(name) => (grouping.object, grouping.group) = (name, String::new()),
                        Mark::Group(name) => grouping.group = name,
                        Mark::Material(at, name) => {
                            grouping.material = by_name.get(name.as_slice()).copied().unwrap_or(NONE);
                            if grouping.material == NONE && !name.is_empty() {
                                let word = Word { start: at, text: &name };
                                unknown.note(&word, "is no material of this file; its faces get the default");
                            }
                        }
                    }
                }
                grouping.run(start..triangles.len(), &mut parts);
                parts.add(triangles);
                Ok(())
            },
        )?;
        let mut default = None;
        let count = self.materials.len() as u32;
        let meshes = parts.finish(first.vertices, || {
            default.get_or_insert_with(|| Material::new("default", Phong::default()));
            count
        });
        unknown.report(file, &mut self.warnings);
        ignored.report(file, &mut self.warnings);
        if meshes.is_empty() {
            return Err(Complaint::file("there are no faces in it").help("an OBJ file has lines such as `f 1 2 3`"));
        }
        Ok((meshes, default))
    }
}

/// What faces belong to, as the lines before them say.
struct Grouping<'a> {
    unnamed: &'a str,
    object: String,
    group: String,
    material: u32,
    /// The part and its slot, once they are known.
    place: Option<(usize, u32)>,
}

impl Grouping<'_> {
    /// Puts some triangles of the next piece into their part.
    fn run(&mut self, triangles: Range<usize>, parts: &mut Parts) {
        if triangles.is_empty() {
            return;
        }
        let (part, slot) = *self.place.get_or_insert_with(|| {
            let name = match (self.object.as_str(), self.group.as_str()) {
                ("", "") => self.unnamed,
                (name, "") | ("", name) => name,
                (object, group) if object == group => object,
                (object, group) => &format!("{object}/{group}"),
            };
            let part = parts.named(name);
            (part, parts.slot(part, self.material))
        });
        parts.run(triangles, part, slot);
    }
}

/// The names between spaces, of which some may be part of a name after a backslash.
fn unescaped(names: Word<'_>) -> Vec<(Word<'_>, String)> {
    let mut out: Vec<(Word<'_>, String)> = Vec::new();
    for word in names.words() {
        match out.last_mut().filter(|(_, name)| name.ends_with('\\')) {
            Some((whole, name)) => {
                whole.text = &names.text[whole.start - names.start..word.span().end - names.start];
                name.pop();
                *name += &format!(" {}", word.string());
            }
            None => out.push((word, word.string())),
        }
    }
    out
}

#[cfg(test)]
mod tests;
