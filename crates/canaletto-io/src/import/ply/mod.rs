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
use super::mesh_part::mend_normals;
use super::polygon::Triangulator;
use crate::picture::decode_srgb;
use canaletto::math::Rgb;
use canaletto::shape::{CylinderCloud, Mesh, SphereCloud};
use glam::{Vec2, Vec3};
use header::{Element, Header};
use payload::{Payload, Row};

/// A mesh, and how many faces had fewer than three corners.
pub(super) fn read_mesh(name: &str, bytes: &[u8]) -> Result<(Mesh, u64), Complaint> {
    let header = header::read(bytes)?;
    let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
    let mut thin = 0;
    let mut payload = Payload::new(&header, bytes);
    if !header.elements.iter().any(|e| is_faces(e) || e.name == "tristrips") {
        return Err(Complaint::file("it has points but no faces")
            .help("a cloud of spheres takes points: `spheres file=…` with a radius"));
    }
    for element in in_order(&header)? {
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
    mend_normals(&mut mesh);
    Ok((mesh, thin))
}

/// The vertices as spheres, with the radius of property `radius` or `r` if there is one.
pub(super) fn read_spheres(name: &str, bytes: &[u8]) -> Result<SphereCloud, Complaint> {
    let header = header::read(bytes)?;
    let mut payload = Payload::new(&header, bytes);
    for element in in_order(&header)? {
        if element.name == "vertex" {
            let Vertices { positions, radii, colors, .. } = vertices(element, &mut payload)?;
            return Ok(SphereCloud { name: name.to_owned(), centers: positions, radii, colors });
        }
        payload.skip(element)?;
    }
    Ok(SphereCloud::default())
}

/// The edges as cylinders: element `edge` with `vertex1`, `vertex2` and perhaps `radius` and colours.
pub(super) fn read_cylinders(name: &str, bytes: &[u8]) -> Result<CylinderCloud, Complaint> {
    let header = header::read(bytes)?;
    let mut payload = Payload::new(&header, bytes);
    let mut cloud = CylinderCloud { name: name.to_owned(), ..CylinderCloud::default() };
    if !header.elements.iter().any(|e| e.name == "edge") {
        return Err(Complaint::file("it has no element `edge`").help("edges have vertex1, vertex2 and perhaps radius"));
    }
    let mut points = Vec::new();
    for element in in_order(&header)? {
        match element.name.as_str() {
            "vertex" => points = vertices(element, &mut payload)?.positions,
            "edge" => {
                let ends = element.numbers(["vertex1", "vertex2"]);
                let ends = ends.ok_or_else(|| Complaint::file("edges need the properties vertex1 and vertex2"))?;
                let extra = Extra::of(element);
                payload.rows(element, |_, row| {
                    let [a, b] = ends.map(|property| index(row.numbers[property], points.len()));
                    cloud.axes.push([points[a? as usize], points[b? as usize]]);
                    extra.read(row, &mut cloud.radii, &mut cloud.colors)
                })?;
            }
            _ => payload.skip(element)?,
        }
    }
    Ok(cloud)
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
            let radius = row.numbers[property] as f32;
            if !radius.is_finite() || radius <= 0.0 {
                return Err(format!("radius is {radius}; it must be more than 0"));
            }
            radii.push(radius);
        }
        if let Some((properties, share)) = self.color {
            let color = properties.map(|property| row.numbers[property]);
            if let Some(v) = color.iter().find(|v| !v.is_finite() || **v < 0.0) {
                return Err(format!("a colour is {v}; it must be 0 or more"));
            }
            colors.push(Rgb::from(color.map(|v| match share {
                Some(255.0) => self.bytes[(v as usize).min(255)],
                Some(most) => decode_srgb((v / most) as f32),
                None => v as f32,
            })));
        }
        Ok(())
    }
}

#[derive(Default)]
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
}

impl Vertices {
    fn into_mesh(self, mesh: &mut Mesh) {
        mesh.positions = self.positions;
        mesh.normals = self.normals;
        mesh.uvs = self.uvs;
        mesh.colors = self.colors;
    }
}

fn vertices(element: &Element, payload: &mut Payload<'_>) -> Result<Vertices, Complaint> {
    let position = element.numbers(["x", "y", "z"]);
    let position = position.ok_or_else(|| Complaint::file("its vertices need the properties x, y and z"))?;
    let normal = element.numbers(["nx", "ny", "nz"]);
    let names = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
    let uv = names.iter().find_map(|names| element.numbers(*names));
    let extra = Extra::of(element);
    if element.count >= u64::from(u32::MAX) {
        return Err(Complaint::file(format!("it has {} vertices, more than 32 bits can count", element.count)));
    }
    payload.check_room(element)?;
    if extra.radius.is_none() && extra.color.is_none() {
        let columns = table::Columns { position, normal, uv: uv.as_ref() };
        if let Some((positions, normals, uvs)) = table::vertices(element, payload, &columns) {
            return Ok(Vertices { positions, normals, uvs, ..Vertices::default() });
        }
    }
    let mut out = Vertices { positions: Vec::with_capacity(element.count as usize), ..Vertices::default() };
    payload.rows(element, |_, row| {
        let vector = |properties: [usize; 3]| Vec3::from(properties.map(|property| row.numbers[property] as f32));
        let p = vector(position);
        if !p.is_finite() {
            return Err(format!("its position {} {} {} is not finite", p.x, p.y, p.z));
        }
        out.positions.push(p);
        out.normals.extend(normal.map(vector));
        out.uvs.extend(uv.map(|uv| Vec2::from(uv.map(|property| row.numbers[property] as f32))));
        extra.read(row, &mut out.radii, &mut out.colors)
    })?;
    if out.uvs.iter().any(|uv| !uv.is_finite()) {
        out.uvs.iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
    }
    Ok(out)
}

fn faces(element: &Element, payload: &mut Payload<'_>, mesh: &mut Mesh) -> Result<u64, Complaint> {
    let Some(property) = element.property(&["vertex_indices", "vertex_index"]) else { return Ok(0) };
    if element.properties[property].length.is_none() {
        return Err(Complaint::file(format!("`{}` of its faces must be a list", element.properties[property].name)));
    }
    if mesh.triangles.is_empty()
        && let Some(triangles) = table::triangles(element, payload, mesh.positions.len())
    {
        mesh.triangles = triangles;
        return Ok(0);
    }
    let (mut corners, mut points, mut thin) = (Vec::new(), Vec::new(), 0);
    let mut triangulator = Triangulator::new();
    payload.rows(element, |_, row| {
        corners.clear();
        for entry in row.list(property) {
            corners.push(index(*entry, mesh.positions.len())?);
        }
        match *corners {
            [] | [_] | [_, _] => thin += 1,
            [a, b, c] => mesh.triangles.push([a, b, c]),
            _ => {
                points.clear();
                points.extend(corners.iter().map(|i| mesh.positions[*i as usize]));
                triangulator.cut(&points, |t| mesh.triangles.push(t.map(|i| corners[i])))?;
            }
        }
        Ok(())
    })?;
    Ok(thin)
}

fn strips(element: &Element, payload: &mut Payload<'_>, mesh: &mut Mesh) -> Result<(), Complaint> {
    let property = element.property(&["vertex_indices", "vertex_index"]);
    let property = property.filter(|at| element.properties[*at].length.is_some());
    let property = property.ok_or_else(|| Complaint::file("its strips need the list `vertex_indices`"))?;
    let mut strip = Vec::new();
    payload.rows(element, |_, row| {
        strip.clear();
        for entry in row.list(property) {
            if *entry == -1.0 {
                strip.clear();
                continue;
            }
            strip.push(index(*entry, mesh.positions.len())?);
            // Every second triangle turns the other way.
            let n = strip.len();
            if n >= 3 {
                let [a, b, c] = [strip[n - 3], strip[n - 2], strip[n - 1]];
                let triangle = if n % 2 == 1 { [a, b, c] } else { [b, a, c] };
                // Strips are joined by repeated corners.
                if a != b && b != c && c != a {
                    mesh.triangles.push(triangle);
                }
            }
        }
        Ok(())
    })
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
