//! Primitives: from accessors to a mesh, or to clouds of spheres and cylinders for points and lines.

use super::accessor::Accessors;
use super::deform::{Deformation, Vertices};
use super::draco;
use super::fault::Fault;
use super::schema::{Index, PrimitiveInfo};
use super::tangents::with_tangents;
use crate::import::positions::Bounds;
use canaletto::math::Rgb;
use canaletto::shape::{CylinderCloud, Mesh, SphereCloud};
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// What a primitive becomes.
pub(super) enum Body {
    Mesh(Mesh),
    Spheres(SphereCloud),
    Cylinders(CylinderCloud),
}

/// What a primitive is built for.
pub(super) struct Wanted<'a> {
    pub(super) name: &'a str,
    pub(super) deformation: &'a Deformation<'a>,
    /// The uv set of the material's normal map, for which a mesh without tangents gets some.
    pub(super) tangent_set: Option<u32>,
    pub(super) one_sided: bool,
    /// The factor of the colours of points and lines.
    pub(super) color: Rgb,
}

/// The elements of a primitive, by the indices of their vertices.
enum Topology {
    Points(Vec<u32>),
    Segments(Vec<[u32; 2]>),
    Triangles(Vec<[u32; 3]>),
}

/// The radius of points, as a share of the primitive's size. glTF's points have a size in pixels, if any.
const POINT_RADIUS: f32 = 1.0 / 200.0;
/// The radius of lines, as a share of the primitive's size.
const LINE_RADIUS: f32 = 1.0 / 400.0;

/// Builds the body of a primitive. None if it has no positions or elements, which is warned of.
pub(super) fn build(
    accessors: &Accessors,
    primitive: &PrimitiveInfo,
    wanted: &Wanted,
    warnings: &mut Vec<Fault>,
) -> Result<Option<Body>, Fault> {
    let Some(&position) = primitive.attributes.get("POSITION") else {
        warnings.push(Fault::new("it has no POSITION and is left out").at("/attributes"));
        return Ok(None);
    };
    let unpacked = draco::unpacked(accessors, primitive, warnings)?;
    let count = unpacked.count(position).map_err(|fault| fault.at_if_relative("/attributes/POSITION"))?;
    // The bytes of the vertices are there before anything is made as long as their count says.
    let vertices = vertices(&unpacked, primitive, count, warnings)?;
    let topology = topology(&unpacked, primitive, count, warnings)?;
    let vertices = wanted.deformation.apply(accessors, primitive, vertices)?;
    if let Some(i) = vertices.positions.iter().position(|p| !p.is_finite()) {
        let fault = Fault::new(format!("vertex {i} is {}; each component must be finite", vertices.positions[i]));
        return Err(fault.at("/attributes/POSITION"));
    }
    Ok(match topology {
        Topology::Triangles(triangles) if triangles.is_empty() => None,
        Topology::Triangles(triangles) => Some(Body::Mesh(mesh(vertices, triangles, wanted))),
        Topology::Points(points) => Some(Body::Spheres(spheres(&vertices, &points, wanted))),
        Topology::Segments(segments) => cylinders(&vertices, &segments, wanted).map(Body::Cylinders),
    })
}

/// The elements of the primitive's mode (glTF 2.0, 3.7.2.1).
fn topology(
    accessors: &Accessors,
    primitive: &PrimitiveInfo,
    count: usize,
    warnings: &mut Vec<Fault>,
) -> Result<Topology, Fault> {
    if let Some(triangles) = draco::triangles(accessors, count)? {
        return Ok(Topology::Triangles(triangles));
    }
    let corners: Vec<u32> = match primitive.indices {
        Some(index) => {
            let indices = accessors.whole::<1>(index).map_err(|fault| fault.at_if_relative("/indices"))?;
            if let Some(i) = indices.iter().position(|[v]| *v as usize >= count) {
                let message = format!("index {i} is vertex {}, but there are {count}, counted from 0", indices[i][0]);
                return Err(Fault::new(message).at("/indices"));
            }
            indices.into_iter().flatten().collect()
        }
        None => (0..count.min(u32::MAX as usize) as u32).collect(),
    };
    let mode = primitive.mode.unwrap_or(4);
    let (step, rest) = match mode {
        1 => (2, corners.len() % 2),
        4 => (3, corners.len() % 3),
        _ => (1, 0),
    };
    if rest > 0 {
        let message =
            format!("its {} vertices aren't a multiple of {step}; the last {rest} are left out", corners.len());
        warnings.push(Fault::new(message));
    }
    let pairs = || corners.windows(2).map(|pair| [pair[0], pair[1]]);
    Ok(match mode {
        0 => Topology::Points(corners),
        1 => Topology::Segments(corners.chunks_exact(2).map(|c| [c[0], c[1]]).collect()),
        2 => {
            let close = corners.last().zip(corners.first()).map(|(last, first)| [*last, *first]);
            Topology::Segments(pairs().chain(close.filter(|_| corners.len() > 2)).collect())
        }
        3 => Topology::Segments(pairs().collect()),
        4 => Topology::Triangles(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()),
        // Every other triangle of a strip turns round.
        5 => {
            let turned = |(i, c): (usize, &[u32])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            Topology::Triangles(corners.windows(3).enumerate().map(turned).collect())
        }
        6 => {
            let fan = corners.get(1..).unwrap_or_default().windows(2);
            Topology::Triangles(fan.map(|pair| [pair[0], pair[1], corners[0]]).collect())
        }
        _ => return Err(Fault::new(format!("is {mode}; modes are 0 to 6")).at("/mode")),
    })
}

/// The attributes of the vertices before any deformation.
fn vertices(
    accessors: &Accessors,
    primitive: &PrimitiveInfo,
    count: usize,
    warnings: &mut Vec<Fault>,
) -> Result<Vertices, Fault> {
    let mut vertices = Vertices::default();
    for (name, &index) in &primitive.attributes {
        let place = format!("/attributes/{name}");
        let mut read = || {
            let own = accessors.count(index)?;
            if own != count {
                return Err(Fault::new(format!("it has {own} elements, but POSITION has {count}")));
            }
            vertices.read(accessors, name, index)
        };
        read().map_err(|fault: Fault| fault.at_if_relative(&place))?;
    }
    let strange = vertices.repair();
    if strange > 0 {
        let message = format!("{strange} numbers of its vertices aren't finite and are taken as 0");
        warnings.push(Fault::new(message).at("/attributes"));
    }
    Ok(vertices)
}

/// The mesh of triangles, with the vertices that they use.
fn mesh(vertices: Vertices, mut triangles: Vec<[u32; 3]>, wanted: &Wanted) -> Mesh {
    let vertices = vertices.used_by(triangles.as_flattened_mut());
    let Vertices { positions, mut normals, tangents, mut uvs, colors, .. } = vertices;
    if !normals.is_empty() {
        repair_normals(&positions, &triangles, &mut normals);
    }
    let mut mesh = Mesh {
        name: wanted.name.to_owned(),
        uvs: if uvs.is_empty() { Vec::new() } else { uvs.remove(0) },
        more_uvs: uvs,
        alphas: alphas(&colors),
        colors: colors.iter().map(|[r, g, b, _]| Rgb::new(*r, *g, *b)).collect(),
        // Tangents mean nothing without normals.
        tangents: if normals.is_empty() { Vec::new() } else { tangents },
        positions,
        normals,
        triangles,
        one_sided: wanted.one_sided,
        ..Mesh::default()
    };
    if let Some(set) = wanted.tangent_set
        && mesh.tangents.is_empty()
    {
        with_tangents(&mut mesh, set);
    }
    mesh
}

/// The alphas of colours; none if all are 1.
fn alphas(colors: &[[f32; 4]]) -> Vec<f32> {
    let is_opaque = colors.iter().all(|color| color[3] == 1.0);
    if is_opaque { Vec::new() } else { colors.iter().map(|color| color[3]).collect() }
}

/// Gives normals without a direction that of the triangles around.
fn repair_normals(positions: &[Vec3], triangles: &[[u32; 3]], normals: &mut [Vec3]) {
    let is_bad = |n: &Vec3| n.as_dvec3().try_normalize().is_none();
    if !normals.iter().any(is_bad) {
        return;
    }
    let mut sums: HashMap<u32, glam::DVec3> = HashMap::new();
    for corners in triangles {
        let [a, b, c] = corners.map(|v| positions[v as usize].as_dvec3());
        for v in corners.iter().filter(|v| is_bad(&normals[**v as usize])) {
            *sums.entry(*v).or_default() += (b - a).cross(c - a);
        }
    }
    for (i, normal) in normals.iter_mut().enumerate().filter(|(_, n)| is_bad(n)) {
        let sum = sums.get(&(i as u32)).copied().unwrap_or_default();
        *normal = sum.normalize_or(glam::DVec3::Y).as_vec3();
    }
}

/// The diagonal of the box around points, or 1 if they have no extent.
fn size(points: &[Vec3]) -> f32 {
    let size = Bounds::of(points).diagonal();
    if size > 0.0 && size.is_finite() { size } else { 1.0 }
}

fn spheres(vertices: &Vertices, points: &[u32], wanted: &Wanted) -> SphereCloud {
    let centers: Vec<Vec3> = points.iter().map(|v| vertices.positions[*v as usize]).collect();
    let colors = points.iter().filter_map(|v| vertices.colors.get(*v as usize));
    SphereCloud {
        name: wanted.name.to_owned(),
        radii: vec![size(&centers) * POINT_RADIUS],
        colors: colors.map(|[r, g, b, _]| Rgb::new(*r, *g, *b) * wanted.color).collect(),
        centers,
        ..SphereCloud::default()
    }
}

/// The lines as cylinders; none if all have length 0. A line has the mean colour of its ends.
fn cylinders(vertices: &Vertices, segments: &[[u32; 2]], wanted: &Wanted) -> Option<CylinderCloud> {
    let ends = |segment: &[u32; 2]| segment.map(|v| vertices.positions[v as usize]);
    let kept: Vec<[u32; 2]> = segments.iter().filter(|s| ends(s)[0] != ends(s)[1]).copied().collect();
    if kept.is_empty() {
        return None;
    }
    let color = |segment: &[u32; 2]| {
        let [a, b] = segment.map(|v| vertices.colors.get(v as usize).map(|[r, g, b, _]| Rgb::new(*r, *g, *b)));
        Some((a? + b?) * 0.5 * wanted.color)
    };
    Some(CylinderCloud {
        name: wanted.name.to_owned(),
        radii: vec![size(&kept.iter().flat_map(ends).collect::<Vec<Vec3>>()) * LINE_RADIUS],
        colors: kept.iter().filter_map(color).collect(),
        axes: kept.iter().map(ends).collect(),
        caps: true,
        ..CylinderCloud::default()
    })
}

impl Vertices {
    /// Reads an attribute. Unknown ones are skipped.
    fn read(&mut self, accessors: &Accessors, name: &str, index: Index) -> Result<(), Fault> {
        let numbered = |prefix: &str| name.strip_prefix(prefix)?.parse::<usize>().ok().filter(|n| *n < MOST_SETS);
        match name {
            "POSITION" => self.positions = vectors(accessors, index)?,
            "NORMAL" => self.normals = vectors(accessors, index)?,
            "TANGENT" => {
                let side = |w: f32| if w < 0.0 { -1.0 } else { 1.0 };
                let tangents = accessors.numbers::<4>(index)?.into_iter();
                self.tangents = tangents.map(|[x, y, z, w]| Vec4::new(x, y, z, side(w))).collect();
            }
            "COLOR_0" => self.colors = colors(accessors, index)?,
            _ => {
                if let Some(set) = numbered("TEXCOORD_") {
                    let uvs = accessors.numbers::<2>(index)?.into_iter().map(Vec2::from).collect();
                    put(&mut self.uvs, set, uvs);
                } else if let Some(set) = numbered("JOINTS_") {
                    put(&mut self.joints, set, accessors.whole::<4>(index)?);
                } else if let Some(set) = numbered("WEIGHTS_") {
                    put(&mut self.weights, set, accessors.numbers::<4>(index)?);
                }
            }
        }
        Ok(())
    }
}

/// The most sets of an attribute that are read.
const MOST_SETS: usize = 64;

/// Puts a set in its place. Sets before it that are missing so far are empty.
fn put<T>(sets: &mut Vec<Vec<T>>, set: usize, values: Vec<T>) {
    if sets.len() <= set {
        sets.resize_with(set + 1, Vec::new);
    }
    sets[set] = values;
}

fn vectors(accessors: &Accessors, index: Index) -> Result<Vec<Vec3>, Fault> {
    Ok(accessors.numbers::<3>(index)?.into_iter().map(Vec3::from).collect())
}

/// Colours of three or four components; alpha is 1 where it is missing.
pub(super) fn colors(accessors: &Accessors, index: Index) -> Result<Vec<[f32; 4]>, Fault> {
    if accessors.width(index)? == 3 {
        return Ok(accessors.numbers::<3>(index)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect());
    }
    accessors.numbers::<4>(index)
}
