//! Displacement (5.5, fig. 5.34b): a tessellation of a surface, fine where heights require it, and raised by them.
//!
//! Edges are split until they are short, or straight once raised. Whether an edge is split depends on the edge alone,
//! and all triangles that share it split it, so that there are no cracks. Vertices at one place (uv seams, edges of
//! boxes) are raised together: by the mean of their heights, in the mean direction of their normals.

mod estimate;

use super::cuts::Cuts;
use super::tessellate::{FrustumFrame, Place, Places, Tessellation, TessellationVertex};
use super::{Cone, Cylinder, Mesh, Shape, Triangle, solve};
use crate::math::Rgb;
use canaletto_parallel::prelude::*;
use estimate::{Raised, parts};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;

/// A vertex of a base mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub(crate) point: DVec3,
    /// The unit normal of the surface before it is raised.
    pub(crate) normal: DVec3,
    pub(crate) uv: DVec2,
    color: Rgb,
    /// The slot of the vertex in the mesh's materials.
    pub(crate) slot: u32,
    place: Place,
}

/// The surface under a base mesh.
enum BaseSurface {
    Flat,
    Sphere(DVec3, f64),
    Frustum(FrustumFrame),
}

/// The triangles of a surface before it is displaced.
pub(crate) struct BaseMesh {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    under: BaseSurface,
    has_colors: bool,
    one_sided: bool,
    name: String,
    materials: Vec<u32>,
}

/// The reason why a surface can't be displaced.
#[derive(Debug, PartialEq)]
pub(crate) enum DisplaceError {
    /// There would be more triangles than allowed.
    TooMany,
    /// A vertex would be out of the range of `f32`.
    TooFar,
}

/// The number of columns around a round shape before any split.
const COLUMNS: usize = 24;
/// The number of rows between a sphere's poles before any split.
const ROWS: usize = 12;
/// The number of triangles up to which the final number is not estimated.
const FEW: usize = 1 << 14;

impl BaseMesh {
    /// The base mesh of a shape, if it can be displaced.
    pub(crate) fn of_shape(shape: &Shape) -> Option<BaseMesh> {
        let (tessellation, under) = match shape {
            Shape::Sphere(s) => (
                Tessellation::sphere(s, &Cuts::even(COLUMNS), &Cuts::even(ROWS)),
                BaseSurface::Sphere(s.center.as_dvec3(), f64::from(s.radius)),
            ),
            Shape::Box(s) => (Tessellation::cuboid(s), BaseSurface::Flat),
            Shape::Triangle(s) => (Tessellation::triangle(s), BaseSurface::Flat),
            Shape::Rectangle(s) => (Tessellation::rectangle(s), BaseSurface::Flat),
            Shape::Cylinder(Cylinder { base, top, radius, caps }) => frustum([*base, *top], [*radius; 2], *caps),
            Shape::Cone(Cone { base, top, radius, top_radius, caps }) => {
                frustum([*base, *top], [*radius, *top_radius], *caps)
            }
            Shape::Plane(_) | Shape::Disk(_) | Shape::Torus(_) | Shape::Partial(_) => return None,
        };
        let one_sided = matches!(shape, Shape::Triangle(Triangle { one_sided: true, .. }));
        let vertex = |v: TessellationVertex| Vertex {
            point: v.point,
            normal: v.normal,
            uv: v.uv,
            color: Rgb::BLACK,
            slot: 0,
            place: v.place,
        };
        Some(BaseMesh {
            vertices: tessellation.vertices.into_iter().map(vertex).collect(),
            triangles: tessellation.triangles,
            one_sided,
            ..BaseMesh::new(under)
        })
    }

    fn new(under: BaseSurface) -> BaseMesh {
        BaseMesh {
            vertices: Vec::new(),
            triangles: Vec::new(),
            under,
            has_colors: false,
            one_sided: false,
            name: String::new(),
            materials: Vec::new(),
        }
    }

    /// The base mesh of a mesh. A mesh without normals is treated as smooth.
    pub(crate) fn of_mesh(mut mesh: Mesh) -> BaseMesh {
        if mesh.normals.is_empty() {
            smooth_over_seams(&mut mesh);
        }
        let mut base = BaseMesh::new(BaseSurface::Flat);
        // A vertex shared by two materials becomes two.
        let mut wedges: HashMap<(u32, u32), u32> = HashMap::new();
        for (i, corners) in mesh.triangles.iter().enumerate() {
            let slot = mesh.slot(i);
            let corners = corners.map(|v| {
                *wedges.entry((v, slot)).or_insert_with(|| {
                    let v = v as usize;
                    let uv = mesh.uvs.get(v).copied().unwrap_or(Vec2::ZERO).as_dvec2();
                    let normal = mesh.normals[v].as_dvec3().normalize();
                    base.vertices.push(Vertex {
                        point: mesh.positions[v].as_dvec3(),
                        normal,
                        uv,
                        color: mesh.colors.get(v).copied().unwrap_or_default(),
                        slot,
                        place: Place::Between,
                    });
                    base.vertices.len() as u32 - 1
                })
            });
            base.triangles.push(corners);
        }
        base.has_colors = !mesh.colors.is_empty();
        (base.one_sided, base.name, base.materials) = (mesh.one_sided, mesh.name, mesh.materials);
        base
    }

    /// The vertex on the surface between two others, at the fraction `t` from `a` to `b`.
    fn between(&self, a: &Vertex, b: &Vertex, t: f64) -> Vertex {
        let place = if a.place == b.place { a.place } else { Place::Between };
        // Midpoints don't depend on the direction of the edge.
        let mix = |a: DVec3, b: DVec3| if t == 0.5 { (a + b) * 0.5 } else { a + (b - a) * t };
        let uv = if t == 0.5 { (a.uv + b.uv) * 0.5 } else { a.uv + (b.uv - a.uv) * t };
        let vertex = Vertex {
            point: mix(a.point, b.point),
            normal: mix(a.normal, b.normal).normalize_or(a.normal),
            uv,
            color: a.color + (b.color - a.color) * t as f32,
            slot: a.slot,
            place,
        };
        self.settled(vertex)
    }

    fn settled(&self, v: Vertex) -> Vertex {
        // The turn nearest to that of the neighbours: the seam has both ends.
        let near = |u: f64| u + libm::round(v.uv.x - u);
        match (&self.under, v.place) {
            (BaseSurface::Flat, _) | (_, Place::Between) => v,
            (BaseSurface::Sphere(c, r), _) => {
                let n = (v.point - *c).normalize();
                let ring = (n.x * n.x + n.z * n.z).sqrt();
                let u = if ring > 1e-9 { near(solve::turn(n.x, n.z)) } else { v.uv.x };
                Vertex { point: *c + n * *r, normal: n, uv: DVec2::new(u, libm::atan2(ring, n.y) / PI), ..v }
            }
            (BaseSurface::Frustum(frame), place) => {
                let from = v.point - frame.base;
                let h = from.dot(frame.axis);
                let Some(out) = (from - frame.axis * h).try_normalize() else { return v };
                let point = frame.point(h, out);
                match place {
                    Place::Rim { top } => Vertex { point, uv: frame.cap_uv(point, top), ..v },
                    _ => {
                        let u = near(solve::turn(out.dot(frame.x), out.dot(frame.z)));
                        let uv = DVec2::new(u, 1.0 - h / frame.height);
                        Vertex { point, normal: frame.normal(out), uv, ..v }
                    }
                }
            }
        }
    }

    /// The largest side of the box around the base mesh.
    fn size(&self) -> f64 {
        let (min, max) = self
            .vertices
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), v| (min.min(v.point), max.max(v.point)));
        (max - min).max_element()
    }

    /// The base mesh split and raised by `height`, with at most `limit` triangles. No edge is longer than a sixteenth
    /// of the base mesh's size. An edge shorter than that size divided by `detail` isn't split.
    pub(crate) fn raised(
        mut self,
        detail: f64,
        limit: usize,
        height: &(dyn Fn(&Vertex) -> f64 + Sync),
    ) -> Result<Mesh, DisplaceError> {
        let size = self.size();
        let fine = size / detail;
        let coarse = (size / 16.0).max(fine);
        let mut places = Places::default();
        let mut ids: Vec<u32> = self.vertices.iter().map(|v| places.id(v.point)).collect();
        let mut heights: Vec<f64> = self.vertices.par_iter().map(height).collect();
        // Triangles before this one are final: an edge that needs no split never will.
        let mut fresh = 0;
        if self.triangles.len() > limit {
            return Err(DisplaceError::TooMany);
        }
        loop {
            let wanted = |(from, low): &Raised, (to, high): &Raised| {
                let length = from.point.distance(to.point);
                length > coarse
                    || length > fine && {
                        // The places are uneven, since a pattern may repeat at even ones.
                        [0.19, 0.5, 0.73].into_iter().any(|t| {
                            let v = self.between(from, to, t);
                            let straight = from.point + (to.point - from.point) * t;
                            let off = (height(&v) - (low + (high - low) * t)).abs() + v.point.distance(straight);
                            off > fine * 0.125
                        })
                    }
            };
            let young = &self.triangles[fresh..];
            // A far too large number is found before the triangles fill memory.
            if young.len() > FEW && self.exceeds(limit.saturating_mul(2), young, &heights, &wanted, height) {
                return Err(DisplaceError::TooMany);
            }
            let raised = |v: u32| (self.vertices[v as usize], heights[v as usize]);
            let marks: Vec<[bool; 3]> = young
                .par_iter()
                .map(|corners| {
                    let [a, b, c] = corners.map(raised);
                    [wanted(&a, &b), wanted(&b, &c), wanted(&c, &a)]
                })
                .collect();
            let edge = |a: u32, b: u32| {
                let (a, b) = (ids[a as usize], ids[b as usize]);
                (a.min(b), a.max(b))
            };
            let mut split: HashSet<(u32, u32)> = HashSet::new();
            for (&[a, b, c], marks) in young.iter().zip(&marks) {
                split.extend(
                    [(a, b), (b, c), (c, a)].into_iter().zip(marks).filter(|(_, m)| **m).map(|((a, b), _)| edge(a, b)),
                );
            }
            if split.is_empty() {
                break;
            }
            let is_split = self.conforming(split, edge);
            let next: usize = is_split.iter().map(|edges| 1 + edges.iter().filter(|split| **split).count()).sum();
            if next > limit {
                return Err(DisplaceError::TooMany);
            }
            fresh = self.split(&is_split);
            ids.extend(self.vertices[ids.len()..].iter().map(|v| places.id(v.point)));
            let more: Vec<f64> = self.vertices[heights.len()..].par_iter().map(height).collect();
            heights.extend(more);
        }
        self.raise(&ids, places.len(), &heights)
    }

    /// The squared length of an edge, equal from both ends.
    fn length(&self, a: u32, b: u32) -> f64 {
        self.vertices[a as usize].point.distance_squared(self.vertices[b as usize].point)
    }

    /// The edges to split of each triangle. A triangle with any split edge also splits its longest (Rivara, "Algorithms
    /// for refining triangular grids suitable for adaptive and multigrid techniques", 1984). Otherwise slivers would be
    /// cut from slivers without end.
    fn conforming(&self, mut split: HashSet<(u32, u32)>, edge: impl Fn(u32, u32) -> (u32, u32)) -> Vec<[bool; 3]> {
        loop {
            let before = split.len();
            for &[a, b, c] in &self.triangles {
                let edges = [(a, b), (b, c), (c, a)];
                if edges.iter().any(|&(a, b)| split.contains(&edge(a, b))) {
                    // Of equally long edges both sides choose one.
                    let rank = |&(a, b): &(u32, u32)| (self.length(a, b), edge(a, b));
                    let longest = edges.iter().copied().reduce(|x, y| if rank(&y) > rank(&x) { y } else { x });
                    split.extend(longest.map(|(a, b)| edge(a, b)));
                }
            }
            if split.len() == before {
                let is_split =
                    |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)].map(|(a, b)| split.contains(&edge(a, b)));
                return self.triangles.iter().map(is_split).collect();
            }
        }
    }

    /// Splits each triangle at the middle of these edges. Unsplit triangles come first. Returns the number of the first
    /// new triangle.
    fn split(&mut self, edges: &[[bool; 3]]) -> usize {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let whole = |(_, edges): &(&[u32; 3], &[bool; 3])| **edges == [false; 3];
        let mut triangles: Vec<[u32; 3]> =
            self.triangles.iter().zip(edges).filter(whole).map(|(triangle, _)| *triangle).collect();
        let first = triangles.len();
        for (index, edges) in edges.iter().enumerate() {
            let [a, b, c] = self.triangles[index];
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let vertex = self.between(&self.vertices[a as usize], &self.vertices[b as usize], 0.5);
                    self.vertices.push(vertex);
                    self.vertices.len() as u32 - 1
                })
            };
            let middles =
                [(edges[0], a, b), (edges[1], b, c), (edges[2], c, a)].map(|(split, a, b)| split.then(|| middle(a, b)));
            if middles != [None; 3] {
                let longer = |[a, b]: [u32; 2], [c, d]: [u32; 2]| self.length(a, b) >= self.length(c, d);
                parts([a, b, c], middles, longer, |part| triangles.push(part));
            }
        }
        self.triangles = triangles;
        first
    }

    fn raise(self, ids: &[u32], places: usize, heights: &[f64]) -> Result<Mesh, DisplaceError> {
        // The different normals at each place, most often one. Each is smooth by itself.
        let mut creases: Vec<Vec<DVec3>> = vec![Vec::new(); places];
        let mut sums = vec![(0.0, 0u32); places];
        let groups: Vec<u32> = (self.vertices.iter().zip(ids).zip(heights))
            .map(|((vertex, &id), height)| {
                let (sum, count) = &mut sums[id as usize];
                (*sum, *count) = (*sum + height, *count + 1);
                let normals = &mut creases[id as usize];
                let known = normals.iter().position(|n| n.dot(vertex.normal) > 0.9999);
                known.unwrap_or_else(|| {
                    normals.push(vertex.normal);
                    normals.len() - 1
                }) as u32
            })
            .collect();
        let raised: Vec<DVec3> = (self.vertices.iter().zip(ids))
            .map(|(vertex, &id)| {
                let normals = &creases[id as usize];
                let up = normals.iter().sum::<DVec3>().normalize_or(vertex.normal);
                let (sum, count) = sums[id as usize];
                vertex.point + up * (sum / f64::from(count))
            })
            .collect();
        let positions: Vec<Vec3> = raised.iter().map(|p| p.as_vec3()).collect();
        if positions.iter().any(|p| !p.is_finite()) {
            return Err(DisplaceError::TooFar);
        }
        let mut normals: Vec<Vec<DVec3>> = creases.iter().map(|n| vec![DVec3::ZERO; n.len()]).collect();
        for corners in &self.triangles {
            let points = corners.map(|v| raised[v as usize]);
            for k in 0..3 {
                let (at, next, last) = (points[k], points[(k + 1) % 3], points[(k + 2) % 3]);
                let cross = (next - at).cross(last - at);
                let area = cross.length();
                if area > 0.0 {
                    let angle = libm::atan2(area, (next - at).dot(last - at));
                    let v = corners[k] as usize;
                    normals[ids[v] as usize][groups[v] as usize] += cross * (angle / area);
                }
            }
        }
        let normal = |v: usize| normals[ids[v] as usize][groups[v] as usize];
        let flat = self.materials.len() <= 1 && self.vertices.iter().all(|v| v.slot == 0);
        Ok(Mesh {
            name: self.name,
            origin: DVec3::ZERO,
            normals: (0..self.vertices.len())
                .map(|v| normal(v).normalize_or(self.vertices[v].normal).as_vec3())
                .collect(),
            uvs: self.vertices.iter().map(|v| v.uv.as_vec2()).collect(),
            colors: if self.has_colors { self.vertices.iter().map(|v| v.color).collect() } else { Vec::new() },
            slots: if flat {
                Vec::new()
            } else {
                self.triangles.iter().map(|t| self.vertices[t[0] as usize].slot).collect()
            },
            positions,
            triangles: self.triangles,
            materials: self.materials,
            one_sided: self.one_sided,
            ..Mesh::default()
        })
    }
}

/// The tessellation of a cylinder or cone, and its surface.
fn frustum(ends: [Vec3; 2], radii: [f32; 2], caps: bool) -> (Tessellation, BaseSurface) {
    let frame = FrustumFrame::new(ends, radii);
    (Tessellation::frustum(&frame, caps, &Cuts::even(COLUMNS)), BaseSurface::Frustum(frame))
}

/// Normals of a mesh without normals, equal for all vertices at one place.
fn smooth_over_seams(mesh: &mut Mesh) {
    let mut places = Places::default();
    let ids: Vec<u32> = mesh.positions.iter().map(|p| places.id(p.as_dvec3())).collect();
    let mut welded = Mesh {
        positions: vec![Vec3::ZERO; places.len()],
        triangles: mesh.triangles.iter().map(|t| t.map(|v| ids[v as usize])).collect(),
        ..Mesh::default()
    };
    for (id, position) in ids.iter().zip(&mesh.positions) {
        welded.positions[*id as usize] = *position;
    }
    welded.smooth_normals();
    mesh.normals = ids.iter().map(|id| welded.normals[*id as usize]).collect();
}

#[cfg(test)]
mod tests;
