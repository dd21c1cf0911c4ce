//! Wavefront OBJ (*Advanced Visualizer* manual, appendix B): polygons with their materials.
//!
//! This reader replaces the crate `tobj`, whose errors have no lines, whose fans invert concave polygons, and which
//! makes a mesh for each material. Two passes read the text: the first reads vertices and materials, the second faces,
//! so faces may precede their vertices. Both read [pieces](super::text) of the file in parallel. The results of pieces
//! are joined in file order, so they equal those of a single piece.
//!
//! Each object or group is one mesh, named `object/group` if both have names. A group that occurs again continues its
//! mesh. Vertex colours (`v x y z r g b`, 0 to 1) are sRGB, as Blender and MeshLab write them. Smoothing groups (`s`)
//! apply to faces without normals; in a file that has any, faces before the first are flat.

mod faces;
mod keyword;
mod library;
mod parts;
mod pictures;
mod vertices;

use super::encoding;
use super::ignored::Ignored;
use super::lines::{ImportError, Token};
use super::precision_warning::{self, Precision};
use super::text::Text;
use super::{DefaultShading, Holds, ModelFormat, ReadFragment, ReadOptions, UpAxis, fragment_of, unreadable};
use crate::assets::{Assets, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::material::{Material, Phong};
use canaletto::scene::Fragment;
use canaletto::shape::Mesh;
use faces::{Faces, Mark, NONE};
use parts::Parts;
use pictures::Pictures;
use std::collections::HashSet;
use std::ops::Range;
use std::path::PathBuf;
use vertices::First;

/// OBJ in the table of formats.
pub(super) const FORMAT: ModelFormat = ModelFormat {
    name: "OBJ",
    extensions: &["obj"],
    holds: Holds::Objects,
    up: UpAxis::Y,
    read: read_model,
    duration: None,
};

fn read_model(asset: &OpenAsset, assets: &dyn Assets, options: &ReadOptions) -> ReadFragment {
    let unsaid = options.unsaid;
    let ObjContent { meshes, materials, pictures, mut warnings } = read(asset, assets, unsaid)?;
    let rounded = meshes.iter().find_map(|mesh| precision_warning::mesh(mesh, Precision::Double));
    rounded.into_iter().for_each(|complaint| warnings.push(complaint.warning(asset.path.name())));
    let Pictures { images, textures, .. } = pictures;
    Ok((Fragment { images, textures, ..fragment_of(meshes, materials) }, warnings))
}

/// The content of an OBJ file and its libraries.
#[derive(Debug)]
struct ObjContent {
    meshes: Vec<Mesh>,
    materials: Vec<Material>,
    pictures: Pictures,
    warnings: Diagnostics,
}

fn read(asset: &OpenAsset, assets: &dyn Assets, unsaid: DefaultShading) -> Result<ObjContent, Diagnostics> {
    let view = asset.content.view();
    let failed = |complaint: ImportError| Diagnostics::from(complaint.error(asset.path.name()));
    let start = view.piece(0..encoding::START, &mut Vec::new()).map(encoding::is_utf16);
    if !start.map_err(|e| failed(unreadable(&e)))? {
        return read_pieces(asset, assets, Text::new(view), unsaid);
    }
    let bytes = view.whole().map_err(|e| failed(unreadable(&e)))?;
    read_pieces(asset, assets, Text::new(encoding::utf8(&bytes)[..].into()), unsaid)
}

fn read_pieces(
    asset: &OpenAsset,
    assets: &dyn Assets,
    text: Text<'_>,
    unsaid: DefaultShading,
) -> Result<ObjContent, Diagnostics> {
    let file = asset.path.name();
    let mut reader = Reader {
        asset,
        assets,
        warnings: Diagnostics::new(),
        materials: Vec::new(),
        pictures: Pictures::default(),
        read: HashSet::new(),
        size: 0.0,
    };
    let result = vertices::read(text).and_then(|first| {
        reader.size = first.vertices.size();
        reader.libraries(&first.libraries);
        reader.faces(text, first, unsaid)
    });
    let Reader { mut warnings, materials, pictures, .. } = reader;
    match result {
        Ok((meshes, default)) => {
            let mut materials = materials;
            materials.extend(default);
            super::attach_source(&mut warnings, file, text.view);
            Ok(ObjContent { meshes, materials, pictures, warnings })
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
    pictures: Pictures,
    /// The libraries that were read.
    read: HashSet<PathBuf>,
    /// The diagonal of the box around all positions.
    size: f32,
}

impl Reader<'_> {
    /// The second pass: faces and their groups. Returns them with the material of faces that have none, if it is
    /// needed.
    fn faces(
        &mut self,
        text: Text<'_>,
        first: First,
        unsaid: DefaultShading,
    ) -> Result<(Vec<Mesh>, Option<Material>), ImportError> {
        let names = library::Names::new(&self.materials);
        let file = self.asset.path.name();
        let mut grouping = Grouping {
            unnamed: file.rsplit('/').next().unwrap_or_default(),
            object: String::new(),
            group: String::new(),
            material: NONE,
            smoothing: None,
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
                    if !matches!(mark, Mark::Smoothing(_)) {
                        grouping.place = None;
                    }
                    match mark {
                        Mark::Object(name) => (grouping.object, grouping.group) = (name, String::new()),
                        Mark::Group(name) => grouping.group = name,
                        Mark::Smoothing(group) => grouping.smoothing = Some(group),
                        Mark::Material(at, name) => {
                            let word = Token { start: at, text: &name };
                            grouping.material = names.find(&word, &mut unknown).unwrap_or(NONE);
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
        let non_finite = !first.vertices.non_finite.is_empty();
        let meshes = parts.finish(first.vertices, unsaid, || {
            default.get_or_insert_with(|| Material::new("default", Phong::default()));
            count
        });
        unknown.report(file, &mut self.warnings);
        first.ignored.report(file, &mut self.warnings);
        if let Some(assumed) = first.assumed {
            self.warnings.push(Diagnostic::warning(file, assumed));
        }
        ignored.report(file, &mut self.warnings);
        if meshes.is_empty() {
            if non_finite {
                return Err(ImportError::file("none of its faces has three corners with finite coordinates"));
            }
            return Err(ImportError::file("there are no faces in it").help("an OBJ file has lines such as `f 1 2 3`"));
        }
        Ok((meshes, default))
    }
}

/// The groups of the next faces, as set by the lines before them.
struct Grouping<'a> {
    unnamed: &'a str,
    object: String,
    group: String,
    material: u32,
    /// The smoothing group, if a line sets one; 0 is none.
    smoothing: Option<u32>,
    /// The part and its slot, once computed.
    place: Option<(usize, u32)>,
}

impl Grouping<'_> {
    /// Assigns some triangles of the next piece to their part.
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
        parts.run(triangles, part, slot, self.smoothing);
    }
}

#[cfg(test)]
mod tests;
