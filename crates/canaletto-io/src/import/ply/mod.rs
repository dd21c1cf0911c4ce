//! PLY, the Stanford format (Turk 1994): text and binary of both byte orders.
//!
//! Read by our own code: crate `serde_ply` reports errors without the row, and `ply-rs-bw` hands over each number by its
//! property's name, a search for every number of millions. A header that announces more than the file can hold fails
//! before memory is taken, and every message names its row.
//!
//! Vertices have `x y z`, `nx ny nz`, texture coordinates under the usual names and `red green blue`; colours of whole
//! types are sRGB shares of their largest value, those of `float` are linear. Faces are polygons
//! (`vertex_indices`) or strips (`tristrips`, −1 between strips). Other elements and properties are passed over.

mod header;
mod payload;
mod table;

use super::lines::Complaint;
use super::mend::mend_normals;
use super::polygon::Triangulator;
use super::positions::Positions;
use super::smooth::Smoothing;
use super::unreadable;
use crate::content::View;
use crate::picture::decode_srgb;
use canaletto::math::Rgb;
use canaletto::shape::{CylinderCloud, Mesh, SphereCloud};
use glam::{DVec3, Vec2, Vec3};
use header::{Element, Header};
use payload::{Payload, Row};

/// A mesh, and how many faces had fewer than three corners.
pub(super) fn read_mesh(name: &str, view: View<'_>) -> Result<(Mesh, u64), Complaint> {
    let header = read_header(view)?;
    read_payload(name, &header, Payload::new(&header, view))
}

/// Whether the file's positions are of single precision.
pub(super) fn is_single(view: View<'_>) -> bool {
    read_header(view).is_ok_and(|header| {
        let vertices = header.elements.iter().find(|element| element.name == "vertex");
        let single = |element: &Element, at: usize| element.properties[at].kind == header::Kind::F32;
        vertices.is_some_and(|e| e.numbers(["x", "y", "z"]).is_some_and(|p| p.into_iter().any(|at| single(e, at))))
    })
}

fn read_payload(name: &str, header: &Header, mut payload: Payload<'_>) -> Result<(Mesh, u64), Complaint> {
    let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
    let mut thin = 0;
    if !header.elements.iter().any(|e| is_faces(e) || e.name == "tristrips") {
        return Err(Complaint::file("it has points but no faces")
            .help("a cloud of spheres takes points: `spheres file=…` with a radius"));
    }
    for element in in_order(header)? {
        match element.name.as_str() {
            "vertex" => vertices(element, &mut payload)?.into_mesh(&mut mesh),
            "face" if is_faces(element) => thin += faces(element, &mut payload, &mut mesh)?,
            "tristrips" => strips(element, &mut payload, &mut mesh)?,
            _ => payload.skip(element)?,
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Complaint::file("there are no faces in it"));
    }
    mend_normals(&mut mesh, Smoothing::Creases);
    Ok((mesh, thin))
}

/// The vertices as spheres, with the radius of property `radius` or `r` if there is one.
pub(super) fn read_spheres(name: &str, view: View<'_>) -> Result<SphereCloud, Complaint> {
    let header = read_header(view)?;
    let mut payload = Payload::new(&header, view);
    for element in in_order(&header)? {
        if element.name == "vertex" {
            let Vertices { positions, radii, colors, .. } = vertices(element, &mut payload)?;
            let (origin, centers) = positions.settle();
            return Ok(SphereCloud { name: name.to_owned(), origin, centers, radii, colors });
        }
        payload.skip(element)?;
    }
    Ok(SphereCloud::default())
}

/// The edges as cylinders: element `edge` with `vertex1`, `vertex2` and perhaps `radius` and colours.
pub(super) fn read_cylinders(name: &str, view: View<'_>) -> Result<CylinderCloud, Complaint> {
    let header = read_header(view)?;
    let mut payload = Payload::new(&header, view);
    let mut cloud = CylinderCloud { name: name.to_owned(), ..CylinderCloud::default() };
    if !header.elements.iter().any(|e| e.name == "edge") {
        return Err(Complaint::file("it has no element `edge`").help("edges have vertex1, vertex2 and perhaps radius"));
    }
    let mut points = Vec::new();
    for element in in_order(&header)? {
        match element.name.as_str() {
            "vertex" => (cloud.origin, points) = vertices(element, &mut payload)?.positions.settle(),
            "edge" => {
                let ends = element.numbers(["vertex1", "vertex2"]);
                let ends = ends.ok_or_else(|| Complaint::file("edges need the properties vertex1 and vertex2"))?;
                let extra = Extra::of(element);
                let points = &points;
                payload.rows(
                    element,
                    CylinderCloud::default,
                    |some, _, row| {
                        let [a, b] = ends.map(|property| index(row.numbers[property], points.len()));
                        some.axes.push([points[a? as usize], points[b? as usize]]);
                        extra.read(row, &mut some.radii, &mut some.colors)
                    },
                    |some| {
                        cloud.axes.extend(some.axes);
                        cloud.radii.extend(some.radii);
                        cloud.colors.extend(some.colors);
                    },
                )?;
            }
            _ => payload.skip(element)?,
        }
    }
    Ok(cloud)
}

/// Reads the header from as much of the file as it takes.
fn read_header(view: View<'_>) -> Result<Header, Complaint> {
    let mut buffer = Vec::new();
    let mut size = 1 << 16;
    loop {
        let start = view.piece(0..size, &mut buffer).map_err(|e| unreadable(&e))?;
        match header::read(start) {
            // The header's end may have one more character.
            Ok(header) if header.end < size => return Ok(header),
            result if size >= view.size() => return result,
            _ => size = size.saturating_mul(4),
        }
    }
}

fn is_faces(element: &Element) -> bool {
    element.name == "face" && element.property(&["vertex_indices", "vertex_index"]).is_some()
}

/// The elements, of which one must be the vertices, before those that refer to them.
fn in_order(header: &Header) -> Result<&[Element], Complaint> {
    let place = |names: &[&str]| header.elements.iter().position(|e| names.contains(&e.name.as_str()));
    match (place(&["vertex"]), place(&["face", "tristrips", "edge"])) {
        (None, _) => Err(Complaint::file("it has no element `vertex`")),
        (Some(vertex), Some(face)) if face < vertex => {
            Err(Complaint::file("its faces come before its vertices, which isn't supported"))
        }
        _ => Ok(&header.elements),
    }
}

/// Colours and radii, which vertices and edges may have.
struct Extra {
    radius: Option<usize>,
    /// The properties of red, green and blue, and their largest value if they are shares of it.
    color: Option<([usize; 3], Option<f64>)>,
    /// sRGB of the 256 values of a byte, decoded.
    bytes: Vec<f32>,
}

impl Extra {
    fn of(element: &Element) -> Extra {
        let names = [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];
        let color = names.iter().find_map(|names| element.numbers(*names));
        let color = color.or_else(|| element.numbers(["r", "g", "b"]));
        let number = |name: &str| element.numbers([name]).map(|[at]| at);
        let radius = number("radius").or_else(|| number("r").filter(|r| color.is_none_or(|c| c[0] != *r)));
        Extra {
            radius,
            color: color.map(|c| (c, element.properties[c[0]].kind.share())),
            bytes: (0..=255).map(|byte| decode_srgb(byte as f32 / 255.0)).collect(),
        }
    }

    fn read(&self, row: &Row, radii: &mut Vec<f32>, colors: &mut Vec<Rgb>) -> Result<(), String> {
        if let Some(property) = self.radius {
            radii.push(self.radius(row.numbers[property])?);
        }
        if let Some((properties, _)) = self.color {
            let [r, g, b] = properties.map(|property| self.channel(row.numbers[property]));
            colors.push(Rgb::new(r?, g?, b?));
        }
        Ok(())
    }

    fn radius(&self, number: f64) -> Result<f32, String> {
        let radius = number as f32;
        if radius.is_finite() && radius > 0.0 {
            return Ok(radius);
        }
        Err(format!("radius is {radius}; it must be more than 0"))
    }

    /// One of red, green and blue.
    fn channel(&self, number: f64) -> Result<f32, String> {
        if !number.is_finite() || number < 0.0 {
            return Err(format!("a colour is {number}; it must be 0 or more"));
        }
        Ok(match self.color {
            Some((_, Some(255.0))) => self.bytes[(number as usize).min(255)],
            Some((_, Some(most))) => decode_srgb((number / most) as f32),
            _ => number as f32,
        })
    }
}

#[derive(Default)]
struct Vertices {
    positions: Positions,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
}

impl Vertices {
    fn into_mesh(self, mesh: &mut Mesh) {
        (mesh.origin, mesh.positions) = self.positions.settle();
        mesh.normals = self.normals;
        mesh.uvs = self.uvs;
        mesh.colors = self.colors;
    }
}

/// Which properties of vertices have a meaning.
struct Wanted {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    extra: Extra,
}

impl Wanted {
    fn of(element: &Element) -> Option<Wanted> {
        let names = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
        Some(Wanted {
            position: element.numbers(["x", "y", "z"])?,
            normal: element.numbers(["nx", "ny", "nz"]),
            uv: names.iter().find_map(|names| element.numbers(*names)),
            extra: Extra::of(element),
        })
    }

    fn read(&self, row: &Row, out: &mut Vertices) -> Result<(), String> {
        let vector = |properties: [usize; 3]| Vec3::from(properties.map(|property| row.numbers[property] as f32));
        let p = vector(self.position);
        if !p.is_finite() {
            return Err(format!("its position {} {} {} is not finite", p.x, p.y, p.z));
        }
        let exact = self.position.map(|property| row.numbers[property]);
        out.positions.push(p, DVec3::from(exact));
        out.normals.extend(self.normal.map(vector));
        out.uvs.extend(self.uv.map(|uv| from_top(Vec2::from(uv.map(|property| row.numbers[property] as f32)))));
        self.extra.read(row, &mut out.radii, &mut out.colors)
    }
}

/// Texture coordinates with v from an image's top row, as everywhere here. Programs that write PLY count it from the bottom,
/// as OBJ does. What isn't finite is 0 0.
fn from_top(uv: Vec2) -> Vec2 {
    if uv.is_finite() { Vec2::new(uv.x, 1.0 - uv.y) } else { Vec2::ZERO }
}

fn vertices(element: &Element, payload: &mut Payload<'_>) -> Result<Vertices, Complaint> {
    let wanted = Wanted::of(element);
    let wanted = wanted.ok_or_else(|| Complaint::file("its vertices need the properties x, y and z"))?;
    if element.count >= u64::from(u32::MAX) {
        return Err(Complaint::file(format!("it has {} vertices, more than 32 bits can count", element.count)));
    }
    payload.check_room(element)?;
    if let Some(vertices) = table::vertices(element, &wanted, payload) {
        return Ok(vertices);
    }
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
        },
    )?;
    Ok(out)
}

/// Reads faces; how many have fewer than three corners.
fn faces(element: &Element, payload: &mut Payload<'_>, mesh: &mut Mesh) -> Result<u64, Complaint> {
    let Some(property) = element.property(&["vertex_indices", "vertex_index"]) else { return Ok(0) };
    if element.properties[property].length.is_none() {
        return Err(Complaint::file(format!("`{}` of its faces must be a list", element.properties[property].name)));
    }
    if mesh.triangles.is_empty()
        && let Some(triangles) = table::triangles(element, property, payload, mesh.positions.len())
    {
        mesh.triangles = triangles;
        return Ok(0);
    }
    let Mesh { positions, triangles, .. } = mesh;
    let mut thin = 0;
    payload.rows(
        element,
        Faces::default,
        |some, _, row| some.read(row.list(property), positions),
        |some| {
            triangles.extend(some.triangles);
            thin += some.thin;
        },
    )?;
    Ok(thin)
}

/// Some faces, cut into triangles.
#[derive(Default)]
struct Faces {
    triangles: Vec<[u32; 3]>,
    /// How many have fewer than three corners.
    thin: u64,
    corners: Vec<u32>,
    points: Vec<Vec3>,
    triangulator: Triangulator,
}

impl Faces {
    fn read(&mut self, entries: &[f64], positions: &[Vec3]) -> Result<(), String> {
        self.corners.clear();
        for entry in entries {
            self.corners.push(index(*entry, positions.len())?);
        }
        match *self.corners {
            [] | [_] | [_, _] => self.thin += 1,
            [a, b, c] => self.triangles.push([a, b, c]),
            _ => {
                let Faces { triangles, corners, points, triangulator, .. } = self;
                points.clear();
                points.extend(corners.iter().map(|i| positions[*i as usize]));
                triangulator.cut(points, |t| triangles.push(t.map(|i| corners[i])))?;
            }
        }
        Ok(())
    }
}

fn strips(element: &Element, payload: &mut Payload<'_>, mesh: &mut Mesh) -> Result<(), Complaint> {
    let property = element.property(&["vertex_indices", "vertex_index"]);
    let property = property.filter(|at| element.properties[*at].length.is_some());
    let property = property.ok_or_else(|| Complaint::file("its strips need the list `vertex_indices`"))?;
    let Mesh { positions, triangles, .. } = mesh;
    let read = |some: &mut Vec<[u32; 3]>, _, row: &Row| {
        let mut strip = Vec::new();
        for entry in row.list(property) {
            if *entry == -1.0 {
                strip.clear();
                continue;
            }
            strip.push(index(*entry, positions.len())?);
            // Every second triangle turns the other way.
            let n = strip.len();
            if n >= 3 {
                let [a, b, c] = [strip[n - 3], strip[n - 2], strip[n - 1]];
                let triangle = if n % 2 == 1 { [a, b, c] } else { [b, a, c] };
                // Strips are joined by repeated corners.
                if a != b && b != c && c != a {
                    some.push(triangle);
                }
            }
        }
        Ok(())
    };
    payload.rows(element, Vec::new, read, |some| triangles.extend(some))
}

fn index(entry: f64, count: usize) -> Result<u32, String> {
    if entry >= 0.0 && entry < count as f64 && entry.fract() == 0.0 {
        return Ok(entry as u32);
    }
    Err(format!("it refers to vertex {entry}, but only {count} exist (counted from 0)"))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
