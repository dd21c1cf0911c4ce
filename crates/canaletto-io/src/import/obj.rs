//! Wavefront OBJ (*Advanced Visualizer* manual, appendix B), its polygons with their materials.
//!
//! Read by our own code and not by crate `tobj`, whose errors know no lines, whose fans turn concave polygons inside
//! out, and which makes a mesh for each material. Two passes over the text: the vertices and materials, then the
//! faces, so that faces may come before their vertices.
//!
//! Each object or group is one mesh, `object/group` if both are named; a group that comes again goes on. Vertex colours
//! (`v x y z r g b`, 0 to 1) are sRGB, as Blender and MeshLab write them. Smoothing groups are ignored.

use super::ignored::Ignored;
use super::lines::{Complaint, Word, lines};
use super::mesh_part::{Corner, NONE, Parts, Vertices};
use super::polygon::Triangulator;
use super::{Imported, mtl};
use crate::assets::{Asset, AssetError, Assets};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::picture::decode_srgb;
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// Meshes and materials of an OBJ file.
pub(super) fn read(asset: &Asset, assets: &dyn Assets) -> Result<Imported, Diagnostics> {
    let file = asset.path.name();
    let mut reader =
        Reader { asset, assets, warnings: Diagnostics::new(), materials: Vec::new(), ignored: Ignored::default() };
    let result = reader.vertices().and_then(|vertices| reader.faces(&vertices));
    let Reader { mut warnings, materials, ignored, .. } = reader;
    ignored.report(file, &mut warnings);
    match result {
        Ok((meshes, materials_with_default)) => {
            let mut materials = materials;
            materials.extend(materials_with_default);
            super::attach_source(&mut warnings, file, &asset.bytes);
            Ok(Imported { meshes, materials, warnings })
        }
        Err(complaint) => {
            let mut errors = Diagnostics::from(complaint.error(file));
            super::attach_source(&mut errors, file, &asset.bytes);
            Err(errors)
        }
    }
}

struct Reader<'a> {
    asset: &'a Asset,
    assets: &'a dyn Assets,
    warnings: Diagnostics,
    materials: Vec<Material>,
    ignored: Ignored,
}

type Faces = (Vec<canaletto::shape::Mesh>, Option<Material>);

impl Reader<'_> {
    /// The first pass: vertices and materials.
    fn vertices(&mut self) -> Result<Vertices, Complaint> {
        let mut out = Vertices::default();
        for line in lines(&self.asset.bytes).joined() {
            let mut words = line.words();
            let Some(word) = words.next() else { continue };
            match word.text {
                b"v" => {
                    out.positions.push(words.numbers::<3>("vertex")?.into());
                    if let Some(color) = vertex_color(words)? {
                        out.colors.resize(out.positions.len() - 1, Rgb::WHITE);
                        out.colors.push(color);
                    }
                }
                b"vt" => {
                    let u = words.number("texture coordinate")?;
                    let v = words.next().map_or(Ok(0.0), |w| w.number())?;
                    out.uvs.push(Vec2::new(u, v));
                }
                b"vn" => out.normals.push(words.numbers::<3>("normal")?.into()),
                b"mtllib" => self.materials(words.rest()),
                _ => {}
            }
        }
        if !out.colors.is_empty() {
            out.colors.resize(out.positions.len(), Rgb::WHITE);
        }
        if [out.positions.len(), out.uvs.len(), out.normals.len()].iter().any(|n| *n >= NONE as usize) {
            return Err(Complaint::file("it has more vertices than 32 bits can count"));
        }
        Ok(out)
    }

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
                    super::attach_source(&mut warnings, asset.path.name(), &asset.bytes);
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

    /// The second pass: faces and what groups them.
    fn faces(&mut self, vertices: &Vertices) -> Result<Faces, Complaint> {
        let by_name: HashMap<&[u8], u32> =
            self.materials.iter().enumerate().rev().map(|(i, m)| (m.name.as_bytes(), i as u32)).collect();
        let unnamed = self.asset.path.name().rsplit('/').next().unwrap_or_default();
        let mut parts = Parts::new(vertices.positions.len());
        let (mut object, mut group) = (String::new(), String::new());
        let (mut material, mut place) = (NONE, None);
        let mut unknown = Ignored::default();
        let mut seen = [0usize; 3];
        let mut polygon = Polygon::new();
        for line in lines(&self.asset.bytes).joined() {
            let mut words = line.words();
            let Some(word) = words.next() else { continue };
            match word.text {
                b"v" => seen[0] += 1,
                b"vt" => seen[1] += 1,
                b"vn" => seen[2] += 1,
                b"f" | b"fo" => {
                    if !polygon.read(line, words, seen, vertices, &mut self.ignored)? {
                        self.ignored.note(&word, "with fewer than 3 corners is left out");
                        continue;
                    }
                    let (part, slot) = *place.get_or_insert_with(|| {
                        let name = match (object.as_str(), group.as_str()) {
                            ("", "") => unnamed,
                            (name, "") | ("", name) => name,
                            (object, group) if object == group => object,
                            (object, group) => &format!("{object}/{group}"),
                        };
                        let part = parts.named(name);
                        (part, parts.slot(part, material))
                    });
                    polygon.add(&mut parts, part, slot).map_err(|message| line.wrong(message))?;
                }
                b"o" => (object, group, place) = (words.rest().string(), String::new(), None),
                b"g" => (group, place) = (words.rest().string(), None),
                b"usemtl" => {
                    let name = words.rest();
                    material = by_name.get(name.text).copied().unwrap_or(NONE);
                    if material == NONE && !name.text.is_empty() {
                        unknown.note(&name, "is no material of this file; its faces get the default");
                    }
                    place = None;
                }
                b"s" => {
                    if words.any(|w| w.text != b"off" && w.text != b"0") {
                        self.ignored
                            .note(&word, "is ignored: smoothing follows the normals, or the angle between faces");
                    }
                }
                b"l" | b"p" => self.ignored.note(&word, "is left out: lines and points have no area"),
                b"mtllib" => {}
                text if text.starts_with(b"#") => {}
                _ => self.ignored.note(&word, "is left out"),
            }
        }
        let mut default = None;
        let count = self.materials.len() as u32;
        let meshes = parts.finish(vertices, || {
            default.get_or_insert_with(|| Material::new("default", Phong::default()));
            count
        });
        unknown.report(self.asset.path.name(), &mut self.warnings);
        if meshes.is_empty() {
            return Err(Complaint::file("there are no faces in it").help("an OBJ file has lines such as `f 1 2 3`"));
        }
        Ok((meshes, default))
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

/// The colour after a position, if there is one. A single number is the weight of rational curves.
fn vertex_color(words: super::lines::Words<'_>) -> Result<Option<Rgb>, Complaint> {
    let mut words = words;
    if words.clone().count() < 3 {
        return Ok(None);
    }
    let line = words.rest();
    let color = words.numbers::<3>("vertex colour")?;
    match color.iter().find(|v| **v < 0.0) {
        Some(v) => Err(line.wrong(format!("vertex colour {v} is less than 0"))),
        None => Ok(Some(Rgb::from(color).map(decode_srgb))),
    }
}

/// One face; keeps its memory for the next.
struct Polygon {
    corners: Vec<Corner>,
    points: Vec<Vec3>,
    numbers: Vec<u32>,
    triangulator: Triangulator,
}

impl Polygon {
    fn new() -> Polygon {
        Polygon { corners: Vec::new(), points: Vec::new(), numbers: Vec::new(), triangulator: Triangulator::new() }
    }

    /// Reads the corners; false if they are fewer than three. `seen` counts the vertices so far, for negative indices.
    fn read<'a>(
        &mut self,
        line: Word<'a>,
        words: impl Iterator<Item = Word<'a>>,
        seen: [usize; 3],
        vertices: &Vertices,
        ignored: &mut Ignored,
    ) -> Result<bool, Complaint> {
        self.corners.clear();
        self.points.clear();
        let exist = [vertices.positions.len(), vertices.uvs.len(), vertices.normals.len()];
        for word in words {
            if word.text.starts_with(b"#") {
                break;
            }
            let corner = corner(&word, seen, exist, ignored)?;
            self.points.push(vertices.positions[corner[0] as usize]);
            self.corners.push(corner);
        }
        if self.corners.len() >= NONE as usize {
            return Err(line.wrong("this face has too many corners"));
        }
        Ok(self.corners.len() >= 3)
    }

    fn add(&mut self, parts: &mut Parts, part: usize, slot: u32) -> Result<(), String> {
        self.numbers.clear();
        self.numbers.extend(self.corners.iter().map(|corner| parts.corner(part, *corner)));
        let numbers = &self.numbers;
        self.triangulator.cut(&self.points, |t| parts.triangle(part, t.map(|i| numbers[i]), slot))
    }
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or from the latest backwards if negative. Texture coordinates and
/// normals that don't exist are left out, as some subdivision models have them; a position must exist.
fn corner(word: &Word<'_>, seen: [usize; 3], exist: [usize; 3], ignored: &mut Ignored) -> Result<Corner, Complaint> {
    let mut out = [NONE; 3];
    for (which, piece) in word.text.split(|b| *b == b'/').enumerate() {
        if which > 0 && piece.is_empty() {
            continue;
        }
        let form = || {
            let message =
                format!("\"{}\" is not a corner: v, v/vt, v//vn or v/vt/vn, each a whole number", word.shown());
            word.wrong(message)
        };
        if which >= 3 {
            return Err(form());
        }
        let index = integer(piece).ok_or_else(form)?;
        let resolved = if index > 0 { index - 1 } else { seen[which] as i64 + index };
        if index != 0 && (0..exist[which] as i64).contains(&resolved) {
            out[which] = resolved as u32;
            continue;
        }
        let face = Word { start: word.start, text: b"f" };
        match (which, index) {
            (1, _) => ignored.note(&face, "refers to texture coordinates that don't exist"),
            (2, _) => ignored.note(&face, "refers to normals that don't exist; they are computed"),
            (_, 0) => return Err(word.wrong("face refers to vertex 0, but they are counted from 1")),
            (_, 1..) => {
                return Err(word.wrong(format!("face refers to vertex {index}, but only {} exist", exist[0])));
            }
            _ => {
                return Err(word.wrong(format!("face refers to vertex {index}, but only {} come before it", seen[0])));
            }
        }
    }
    Ok(out)
}

fn integer(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let value = digits.iter().try_fold(0i64, |sum, d| d.is_ascii_digit().then(|| sum * 10 + i64::from(d - b'0')))?;
    Some(if negative { -value } else { value })
}

#[cfg(test)]
#[path = "obj_tests.rs"]
mod tests;
