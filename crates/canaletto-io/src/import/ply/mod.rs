//! PLY, the Stanford format (Turk 1994): text, and binary of both byte orders.
//!
//! This reader replaces two crates. `serde_ply` reports errors without the row. `ply-rs-bw` passes each number by the
//! name of its property, which is a search for each of millions of numbers. A header that declares more than the file
//! can hold is rejected before memory is allocated, and every message names its row.
//!
//! Vertices have `x y z`, `nx ny nz`, texture coordinates under the usual names, and `red green blue`;
//! [`super::table_color`] determines the scale of colours. Faces are polygons (`vertex_indices`) or strips
//! (`tristrips`, −1 between strips), see [`faces`]. Other elements and properties are skipped, and named in a warning.
//! Vertices with a coordinate that is NaN or infinite are left out, with their faces.

mod faces;
mod header;
mod payload;
mod pictures;
mod table;

use super::cloud::CloudSettings;
use super::lines::ImportError;
use super::positions::{Bounds, Positions};
use super::precision_warning::{self, Precision};
use super::repair::repair_normals;
use super::smooth::{Smoothing, smooth};
use super::table_color::{self, Written};
use super::{
    DefaultShading, Holds, ModelFormat, ReadFragment, ReadOptions, UpAxis, attach_source, encoding, fragment_of,
    unreadable,
};
use crate::assets::{Assets, OpenAsset};
use crate::content::View;
use crate::diagnostic::Diagnostics;
use canaletto::math::Rgb;
use canaletto::memory;
use canaletto::scene::{Content, Fragment, Node};
use canaletto::shape::{CylinderCloud, Mesh, SphereCloud};
use canaletto::texture::{ColorSpace, srgb_decode};
use canaletto_parallel::prelude::*;
use faces::{FaceList, strips};
use glam::{DVec3, Vec2, Vec3};
use header::{Element, Header, Kind};
use payload::{Payload, Row};
use pictures::Pictures;
use std::io;

/// PLY in the table of formats.
pub(super) const FORMAT: ModelFormat = ModelFormat {
    name: "PLY",
    extensions: &["ply"],
    holds: Holds::Objects,
    up: UpAxis::Y,
    read: read_model,
    duration: None,
};

fn read_model(asset: &OpenAsset, assets: &dyn Assets, options: &ReadOptions) -> ReadFragment {
    let unsaid = options.unsaid;
    let view = asset.content.view();
    let failed = |e: &io::Error| Diagnostics::from(unreadable(e).error(asset.path.name()));
    let is_utf16 = view.piece(0..encoding::START, &mut Vec::new()).map(encoding::is_utf16).map_err(|e| failed(&e))?;
    let file = asset.path.name();
    let (content, mut warnings) = if is_utf16 {
        let bytes = view.whole().map_err(|e| failed(&e))?;
        read_named(file, encoding::text(&bytes)[..].into())?
    } else {
        read_named(file, view)?
    };
    match content {
        PlyContent::Mesh(mut mesh, names) => {
            if unsaid == DefaultShading::Creases && mesh.normals.is_empty() {
                smooth(&mut mesh, Smoothing::Creases);
            }
            let pictures = pictures::read(&names, asset, assets, &mut warnings);
            mesh.materials = (0..pictures.materials.len() as u32).collect();
            let Pictures { images, textures, materials } = pictures;
            Ok((Fragment { images, textures, ..fragment_of(vec![mesh], materials) }, warnings))
        }
        PlyContent::Points(cloud) => {
            let node = Node::new(Content::Spheres(0));
            Ok((Fragment { spheres: vec![cloud], nodes: vec![node], ..Fragment::default() }, warnings))
        }
    }
}

/// What a file holds.
enum PlyContent {
    /// A mesh, with the pictures that its header names.
    Mesh(Mesh, Vec<String>),
    /// Vertices without faces.
    Points(SphereCloud),
}

/// Reads a file with this name, which messages mention.
fn read_named(file: &str, view: View<'_>) -> Result<(PlyContent, Diagnostics), Diagnostics> {
    match read_content(file.rsplit('/').next().unwrap_or_default(), view) {
        Ok((content, said)) => {
            let mut warnings = Diagnostics::new();
            said.into_iter().for_each(|complaint| warnings.push(complaint.warning(file)));
            let rounded = match &content {
                PlyContent::Mesh(mesh, _) => precision_warning::mesh(mesh, precision(view)),
                PlyContent::Points(SphereCloud { centers, radii, origin, .. }) => {
                    precision_warning::cloud(centers, 1, radii, *origin, precision(view))
                }
            };
            rounded.into_iter().for_each(|complaint| warnings.push(complaint.warning(file)));
            Ok((content, warnings))
        }
        Err(complaint) => {
            let mut errors = Diagnostics::from(complaint.error(file));
            attach_source(&mut errors, file, view);
            Err(errors)
        }
    }
}

/// Reads a mesh, or points if there are no faces. Returns it with warnings about what was left out or assumed.
fn read_content(name: &str, view: View<'_>) -> Result<(PlyContent, Vec<ImportError>), ImportError> {
    let header = read_header(view)?;
    if header.elements.iter().any(|e| is_faces(e) || e.name == "tristrips") {
        let (mesh, said) = read_payload(name, &header, Payload::new(&header, view))?;
        return Ok((PlyContent::Mesh(mesh, header.textures), said));
    }
    let (mut cloud, said) = read_spheres(name, view, &CloudSettings::default())?;
    if cloud.centers.is_empty() {
        return Err(ImportError::file("it has neither faces nor points"));
    }
    if cloud.radii.is_empty() {
        cloud.radii = vec![radius_of_points(&cloud.centers)];
    }
    Ok((PlyContent::Points(cloud), said))
}

/// The radius of points of which a file says nothing. Points of a surface as large as their box lie at distances of
/// about its diagonal divided by √n, and hide what is behind them.
fn radius_of_points(points: &[Vec3]) -> f32 {
    let radius = Bounds::of(points).diagonal() * (0.4 / (points.len() as f32).sqrt()).min(0.02);
    if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
}

/// The precision of positions in the file.
pub(super) fn precision(view: View<'_>) -> Precision {
    let single = read_header(view).is_ok_and(|header| {
        let vertices = header.elements.iter().find(|element| element.name == "vertex");
        let single = |element: &Element, at: usize| element.properties[at].kind == Kind::F32;
        vertices.is_some_and(|e| e.numbers(["x", "y", "z"]).is_some_and(|p| p.into_iter().any(|at| single(e, at))))
    });
    if single { Precision::Single } else { Precision::Double }
}

fn read_payload(
    name: &str,
    header: &Header,
    mut payload: Payload<'_>,
) -> Result<(Mesh, Vec<ImportError>), ImportError> {
    let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
    let mut said = Vec::new();
    let mut faces = FaceList::with_pictures(header.textures.len());
    for element in in_order(header)? {
        match element.name.as_str() {
            "vertex" => {
                let extra = Extra::of(element, false, &CloudSettings::default())?;
                let wanted = Wanted { extra, ..Wanted::of(element)? };
                said.extend(element.unused(&wanted.used()));
                vertices(element, &wanted, &mut payload, &mut said)?.into_mesh(&mut mesh);
            }
            "face" if is_faces(element) => faces.read(element, &mut payload, &mut mesh, &mut said)?,
            "tristrips" => strips(element, &mut payload, &mut mesh)?,
            other => {
                if element.count > 0 {
                    said.push(ImportError::file(format!("element {other} ({} rows) is left out", element.count)));
                }
                payload.skip(element)?;
            }
        }
    }
    said.extend(payload.rest()?);
    if mesh.triangles.is_empty() && faces.is_empty() {
        return Err(ImportError::file("there are no faces in it"));
    }
    faces.finish(&mut mesh, &mut said)?;
    if mesh.triangles.is_empty() {
        return Err(ImportError::file("none of its faces has three corners with finite coordinates"));
    }
    let without = mesh.normals.par_iter().filter(|n| !has_direction(n)).count();
    if without > 0 {
        said.push(ImportError::file(format!("{without} normals have no direction; they are computed from the faces")));
    }
    repair_normals(&mut mesh, Smoothing::Creases);
    let wrong = mesh.uvs.par_iter().filter(|uv| !uv.is_finite()).count();
    if wrong > 0 {
        mesh.uvs.par_iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
        said.push(ImportError::file(format!("{wrong} texture coordinates aren't finite; they are taken as 0 0")));
    }
    Ok((mesh, said))
}

/// Whether a vector can be normalised.
fn has_direction(n: &Vec3) -> bool {
    n.is_finite() && *n != Vec3::ZERO
}

/// Reads the vertices as spheres, whose radius is the property `radius` or `r` if there is one. Returns them with
/// warnings.
pub(super) fn read_spheres(
    name: &str,
    view: View<'_>,
    settings: &CloudSettings,
) -> Result<(SphereCloud, Vec<ImportError>), ImportError> {
    let header = read_header(view)?;
    let mut payload = Payload::new(&header, view);
    let mut said = Vec::new();
    for element in in_order(&header)? {
        if element.name == "vertex" {
            let extra = Extra::of(element, true, settings)?;
            let wanted = Wanted { extra, ..Wanted::of(element)? };
            let Vertices { positions, mut radii, mut colors, mut values, .. } =
                vertices(element, &wanted, &mut payload, &mut said)?;
            let (origin, mut centers) = positions.rebase();
            let good = |i: usize| centers[i].is_finite() && radii.get(i).is_none_or(|r: &f32| r.is_finite());
            let kept: Vec<bool> = (0..centers.len()).into_par_iter().map(good).collect();
            said.extend(left_out(&kept, "points"));
            keep(&mut centers, &kept);
            keep(&mut radii, &kept);
            keep(&mut colors, &kept);
            wanted.extra.check(&values, &kept)?;
            keep(&mut values, &kept);
            if let Some(map) = &settings.colormap {
                colors = map.colors(&values);
            }
            return Ok((
                SphereCloud { name: name.to_owned(), origin, centers, radii, colors, rows: row_numbers(&kept) },
                said,
            ));
        }
        payload.skip(element)?;
    }
    Ok((SphereCloud::default(), said))
}

/// Removes the items for which `kept` is false.
pub(super) fn keep<T>(list: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    // An absent list stays empty.
    list.retain(|_| kept.next().is_none_or(|kept| *kept));
}

/// The numbers of the rows that are kept, from 1 on; none if these are all rows.
pub(super) fn row_numbers(kept: &[bool]) -> Vec<u32> {
    if kept.iter().all(|kept| *kept) {
        return Vec::new();
    }
    (1..).zip(kept).filter(|(_, kept)| **kept).map(|(row, _)| row).collect()
}

/// The warning about rows that aren't kept.
pub(super) fn left_out(kept: &[bool], of: &str) -> Option<ImportError> {
    let lost = kept.par_iter().filter(|kept| !**kept).count();
    let first = kept.iter().position(|kept| !kept)?;
    Some(ImportError::file(format!(
        "{lost} of {} {of} are left out, as a coordinate or the radius isn't a finite number; the first is number {} \
         of them",
        kept.len(),
        first + 1
    )))
}

/// Reads the edges as cylinders: element `edge` with `vertex1`, `vertex2`, and optional `radius` and colours.
pub(super) fn read_cylinders(
    name: &str,
    view: View<'_>,
    settings: &CloudSettings,
) -> Result<(CylinderCloud, Vec<ImportError>), ImportError> {
    let header = read_header(view)?;
    let mut payload = Payload::new(&header, view);
    let mut cloud = CylinderCloud { name: name.to_owned(), ..CylinderCloud::default() };
    if !header.elements.iter().any(|e| e.name == "edge") {
        return Err(
            ImportError::file("it has no element `edge`").help("edges have vertex1, vertex2 and perhaps radius")
        );
    }
    let (mut points, mut said, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut extra = Extra::default();
    for element in in_order(&header)? {
        match element.name.as_str() {
            "vertex" => {
                let wanted = Wanted::of(element)?;
                (cloud.origin, points) = vertices(element, &wanted, &mut payload, &mut said)?.positions.rebase();
            }
            "edge" => {
                let ends = element.numbers(["vertex1", "vertex2"]);
                let ends = ends.ok_or_else(|| ImportError::file("edges need the properties vertex1 and vertex2"))?;
                extra = Extra::of(element, true, settings)?;
                let (extra, points) = (&extra, &points);
                payload.rows(
                    element,
                    <(CylinderCloud, Vec<f64>)>::default,
                    |(some, values), _, row| {
                        values.extend(extra.value.as_ref().map(|(at, _)| row.numbers[*at]));
                        let [a, b] = ends.map(|property| index(row.numbers[property], points.len()));
                        some.axes.push([points[a? as usize], points[b? as usize]]);
                        extra.read(row, &mut some.radii, &mut some.colors)
                    },
                    |(some, some_values)| {
                        values.extend(some_values);
                        cloud.axes.extend(some.axes);
                        cloud.radii.extend(some.radii);
                        cloud.colors.extend(some.colors);
                    },
                )?;
                said.extend(extra.rebase(&mut cloud.colors, "edges"));
            }
            _ => payload.skip(element)?,
        }
    }
    let radius = |i: usize| cloud.radii.get(i).is_none_or(|r| r.is_finite());
    let kept: Vec<bool> =
        cloud.axes.iter().enumerate().map(|(i, [a, b])| a.is_finite() && b.is_finite() && radius(i)).collect();
    said.extend(left_out(&kept, "edges"));
    keep(&mut cloud.axes, &kept);
    keep(&mut cloud.radii, &kept);
    keep(&mut cloud.colors, &kept);
    cloud.rows = row_numbers(&kept);
    extra.check(&values, &kept)?;
    keep(&mut values, &kept);
    if let Some(map) = &settings.colormap {
        cloud.colors = map.colors(&values);
    }
    Ok((cloud, said))
}

/// Parses the header, reading only as much of the file as necessary.
fn read_header(view: View<'_>) -> Result<Header, ImportError> {
    let mut buffer = Vec::new();
    let mut size = 1 << 16;
    loop {
        let start = view.piece(0..size, &mut buffer).map_err(|e| unreadable(&e))?;
        match header::read(start) {
            // The end of the header may have one more character.
            Ok(header) if header.end < size => return Ok(header),
            result if size >= view.size() => return result,
            _ => size = size.saturating_mul(4),
        }
    }
}

fn is_faces(element: &Element) -> bool {
    element.name == "face" && element.property(&["vertex_indices", "vertex_index"]).is_some()
}

/// The elements; one of them must be the vertices, and it must precede those that refer to it.
fn in_order(header: &Header) -> Result<&[Element], ImportError> {
    let place = |names: &[&str]| header.elements.iter().position(|e| names.contains(&e.name.as_str()));
    if header.elements.iter().filter(|e| e.name == "vertex").count() > 1 {
        return Err(ImportError::file("it has several elements `vertex`, which isn't supported"));
    }
    match (place(&["vertex"]), place(&["face", "tristrips", "edge"])) {
        (None, _) => Err(ImportError::file("it has no element `vertex`")),
        (Some(vertex), Some(face)) if face < vertex => {
            Err(ImportError::file("its faces come before its vertices, which isn't supported"))
        }
        _ => Ok(&header.elements),
    }
}

/// The colours and radii of vertices and edges, and the colours of faces.
#[derive(Default)]
struct Extra {
    radius: Option<usize>,
    /// The properties of red, green and blue, and their type.
    color: Option<([usize; 3], Kind)>,
    /// The linear value of each byte of a colour.
    bytes: Vec<f32>,
    /// What the scene says of the colours' numbers.
    space: Option<ColorSpace>,
    /// The property with the numbers of the colour map, and its name.
    value: Option<(usize, String)>,
}

impl Extra {
    fn of(element: &Element, with_radius: bool, settings: &CloudSettings) -> Result<Extra, ImportError> {
        let names = [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];
        let color = names.iter().find_map(|names| element.numbers(*names));
        let color = color.or_else(|| element.numbers(["r", "g", "b"]));
        let number = |name: &str| element.numbers([name]).map(|[at]| at);
        let radius = number("radius").or_else(|| number("r").filter(|r| color.is_none_or(|c| c[0] != *r)));
        let value = match settings.colormap.as_ref().map(|map| &map.column) {
            None => None,
            Some(wanted) => Some(number(&wanted.to_lowercase()).map(|at| (at, wanted.clone())).ok_or_else(|| {
                let names: Vec<&str> = element.properties.iter().map(|property| property.name.as_str()).collect();
                ImportError::file(format!("there is no property \"{wanted}\" for the colour map")).help(format!(
                    "the properties of element {} are {}",
                    element.name,
                    names.join(", ")
                ))
            })?),
        };
        let byte = |byte: u16| {
            let share = f32::from(byte) / 255.0;
            if settings.colors == Some(ColorSpace::Linear) { share } else { srgb_decode(share) }
        };
        Ok(Extra {
            radius: radius.filter(|_| with_radius),
            color: color.map(|c| (c, element.properties[c[0]].kind)),
            bytes: (0..=255).map(byte).collect(),
            space: settings.colors,
            value,
        })
    }

    /// Checks that the kept numbers of the colour map are finite.
    fn check(&self, values: &[f64], kept: &[bool]) -> Result<(), ImportError> {
        let wrong = values.iter().zip(kept).position(|(value, kept)| *kept && !value.is_finite());
        let (Some(row), Some((_, name))) = (wrong, &self.value) else { return Ok(()) };
        let message = format!("row {} (from 0): {name} isn't a finite number, which the colour map needs", row);
        Err(ImportError::file(message).help("leave the row out, or give it a number"))
    }

    fn read(&self, row: &Row, radii: &mut Vec<f32>, colors: &mut Vec<Rgb>) -> Result<(), String> {
        if let Some(property) = self.radius {
            radii.push(self.radius(row.numbers[property])?);
        }
        if let Some((properties, _)) = self.color {
            colors.push(properties.map(|property| self.channel(row.numbers[property])).into());
        }
        Ok(())
    }

    /// A radius, which may be NaN; infinity becomes NaN.
    fn radius(&self, number: f64) -> Result<f32, String> {
        let radius = number as f32;
        if radius <= 0.0 && radius.is_finite() {
            return Err(format!("radius is {radius}; it must be more than 0"));
        }
        Ok(radius)
    }

    /// One of red, green and blue: linear light for a byte, the number itself for other types.
    fn channel(&self, number: f64) -> f32 {
        match self.color {
            // The bytes of a signed type are taken as unsigned.
            Some((_, Kind::U8 | Kind::I8)) => self.bytes[usize::from(number as i64 as u8)],
            _ => number as f32,
        }
    }

    /// Converts the numbers of all colours to linear light; see [`table_color::normalise`].
    fn rebase(&self, colors: &mut [Rgb], of: &str) -> Vec<ImportError> {
        let written = match self.color {
            None | Some((_, Kind::U8 | Kind::I8)) => return Vec::new(),
            Some((_, Kind::I16)) => Written::Whole(32767.0),
            Some((_, Kind::U16)) => Written::Whole(65535.0),
            Some((_, Kind::I32)) => Written::Whole(2_147_483_647.0),
            Some((_, Kind::U32)) => Written::Whole(4_294_967_295.0),
            Some((_, Kind::F32 | Kind::F64)) => Written::Real,
        };
        table_color::normalise(colors, written, self.space, of)
    }
}

#[derive(Default)]
struct Vertices {
    positions: Positions,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
    /// The numbers of the colour map.
    values: Vec<f64>,
}

impl Vertices {
    fn into_mesh(self, mesh: &mut Mesh) {
        (mesh.origin, mesh.positions) = self.positions.rebase();
        mesh.normals = self.normals;
        mesh.uvs = self.uvs;
        mesh.colors = self.colors;
    }
}

/// The properties of vertices that are used.
struct Wanted {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    extra: Extra,
}

impl Wanted {
    /// The properties of vertices without colours and radii.
    fn of(element: &Element) -> Result<Wanted, ImportError> {
        let names = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
        let position = element.numbers(["x", "y", "z"]);
        Ok(Wanted {
            position: position.ok_or_else(|| ImportError::file("its vertices need the properties x, y and z"))?,
            normal: element.numbers(["nx", "ny", "nz"]),
            uv: names.iter().find_map(|names| element.numbers(*names)),
            extra: Extra::default(),
        })
    }

    /// The indices of the used properties.
    fn used(&self) -> Vec<usize> {
        let Wanted { position, normal, uv, extra } = self;
        let color = extra.color.iter().flat_map(|(properties, _)| properties);
        let some = position.iter().chain(normal.iter().flatten()).chain(uv.iter().flatten());
        some.chain(color).chain(&extra.radius).copied().collect()
    }

    /// The memory of a vertex in bytes.
    fn bytes(&self) -> u64 {
        let Wanted { normal, uv, extra: Extra { radius, color, .. }, .. } = self;
        let of = |there: bool, bytes: u64| if there { bytes } else { 0 };
        12 + of(normal.is_some(), 12) + of(uv.is_some(), 8) + of(radius.is_some(), 4) + of(color.is_some(), 12)
    }

    fn read(&self, row: &Row, out: &mut Vertices) -> Result<(), String> {
        let vector = |properties: [usize; 3]| Vec3::from(properties.map(|property| row.numbers[property] as f32));
        let exact = self.position.map(|property| row.numbers[property]);
        out.positions.push(vector(self.position), DVec3::from(exact));
        out.normals.extend(self.normal.map(vector));
        out.uvs.extend(self.uv.map(|uv| from_top(Vec2::from(uv.map(|property| row.numbers[property] as f32)))));
        out.values.extend(self.extra.value.as_ref().map(|(at, _)| row.numbers[*at]));
        self.extra.read(row, &mut out.radii, &mut out.colors)
    }
}

/// Texture coordinates with v from an image's top row, as elsewhere in Canaletto. Programs that write PLY count v from
/// the bottom, as OBJ does.
fn from_top(uv: Vec2) -> Vec2 {
    Vec2::new(uv.x, 1.0 - uv.y)
}

/// Reads the vertices, including those whose coordinates aren't finite.
fn vertices(
    element: &Element,
    wanted: &Wanted,
    payload: &mut Payload<'_>,
    said: &mut Vec<ImportError>,
) -> Result<Vertices, ImportError> {
    if element.count >= u64::from(u32::MAX) {
        return Err(ImportError::file(format!("it has {} vertices, more than 32 bits can count", element.count)));
    }
    payload.check_room(element)?;
    memory::room(element.count.saturating_mul(wanted.bytes())).map_err(|e| {
        let help = "each vertex takes 12 bytes for its place, and as many for its normal and its colour";
        ImportError::file(format!("{e}, which its {} vertices take", element.count)).help(help)
    })?;
    let fast = if wanted.extra.value.is_none() { table::vertices(element, wanted, payload) } else { None };
    let mut out = match fast {
        Some(vertices) => vertices,
        None => {
            let mut out = Vertices::default();
            payload.rows(
                element,
                Vertices::default,
                |some, _, row| wanted.read(row, some),
                |some| {
                    out.positions.append(some.positions);
                    out.normals.extend(some.normals);
                    out.uvs.extend(some.uvs);
                    out.radii.extend(some.radii);
                    out.colors.extend(some.colors);
                    out.values.extend(some.values);
                },
            )?;
            out
        }
    };
    said.extend(wanted.extra.rebase(&mut out.colors, "vertices"));
    Ok(out)
}

fn index(entry: f64, count: usize) -> Result<u32, String> {
    if entry >= 0.0 && entry < count as f64 && entry.fract() == 0.0 {
        return Ok(entry as u32);
    }
    Err(format!("it refers to vertex {entry}, but only {count} exist (counted from 0)"))
}

#[cfg(test)]
mod tests;
