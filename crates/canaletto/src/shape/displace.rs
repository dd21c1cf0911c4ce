//! Displacement (5.5, fig. 5.34b): a tessellation of a surface, fine where heights require it, and raised by them.
//!
//! Edges are split until they are short, or straight once raised. Whether an edge is split depends on the edge alone,
//! and all triangles that share it split it, so that there are no cracks. Vertices at one place (uv seams, edges of
//! boxes) are raised together: by the mean of their heights, in the mean direction of their normals.

mod estimate;

use super::{Cone, Cuboid, Cylinder, Mesh, Shape, Sphere, Triangle, solve};
use crate::math::Rgb;
use estimate::{Raised, parts};
use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

/// A vertex of a tessellation.
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

/// The rule for the place of a new vertex on the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The place between the vertex's neighbours.
    Between,
    /// A place on the round part of the shape.
    Round,
    /// A place on the rim of the cap at the top or at the base.
    Rim { top: bool },
}

/// The surface under a tessellation.
enum BaseSurface {
    Flat,
    Sphere(DVec3, f64),
    Frustum(Body),
}

/// A cylinder's or cone's body.
struct Body {
    base: DVec3,
    axis: DVec3,
    x: DVec3,
    z: DVec3,
    height: f64,
    radii: [f64; 2],
}

/// A tessellation of a surface.
pub(crate) struct Tessellation {
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

impl Body {
    fn radius(&self, h: f64) -> f64 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * (h / self.height)
    }

    fn point(&self, h: f64, out: DVec3) -> DVec3 {
        self.base + self.axis * h + out * self.radius(h)
    }

    fn normal(&self, out: DVec3) -> DVec3 {
        (out - self.axis * ((self.radii[1] - self.radii[0]) / self.height)).normalize()
    }

    fn cap_uv(&self, point: DVec3, top: bool) -> DVec2 {
        let (h, r, z) = if top { (self.height, self.radii[1], self.z) } else { (0.0, self.radii[0], -self.z) };
        let across = point - self.base - self.axis * h;
        DVec2::new(across.dot(self.x), across.dot(z)) * (0.5 / r) + 0.5
    }
}

/// The number of columns around a round shape before any split.
const COLUMNS: usize = 24;
/// The number of rows between a sphere's poles before any split.
const ROWS: usize = 12;
/// The number of triangles up to which the final number is not estimated.
const FEW: usize = 1 << 14;

impl Tessellation {
    /// The tessellation of a shape, if it has one.
    pub(crate) fn of_shape(shape: &Shape) -> Option<Tessellation> {
        match shape {
            Shape::Sphere(s) => Some(Tessellation::sphere(s)),
            Shape::Box(s) => Some(Tessellation::cuboid(s)),
            Shape::Triangle(s) => Some(Tessellation::triangle(s)),
            Shape::Cylinder(Cylinder { base, top, radius, caps }) => {
                Some(Tessellation::frustum([*base, *top], [*radius, *radius], *caps))
            }
            Shape::Cone(Cone { base, top, radius, top_radius, caps }) => {
                Some(Tessellation::frustum([*base, *top], [*radius, *top_radius], *caps))
            }
            Shape::Plane(_) | Shape::Disk(_) | Shape::Torus(_) => None,
        }
    }

    fn new(under: BaseSurface) -> Tessellation {
        Tessellation {
            vertices: Vec::new(),
            triangles: Vec::new(),
            under,
            has_colors: false,
            one_sided: false,
            name: String::new(),
            materials: Vec::new(),
        }
    }

    fn add(&mut self, point: DVec3, normal: DVec3, uv: DVec2, place: Place) -> u32 {
        self.vertices.push(Vertex { point, normal, uv, color: Rgb::BLACK, slot: 0, place });
        self.vertices.len() as u32 - 1
    }

    fn sphere(sphere: &Sphere) -> Tessellation {
        let (c, r) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        let mut tessellation = Tessellation::new(BaseSurface::Sphere(c, r));
        for j in 0..=ROWS {
            for i in 0..=COLUMNS {
                let pole = j == 0 || j == ROWS;
                let direction = match j {
                    0 => DVec3::Y,
                    ROWS => DVec3::NEG_Y,
                    _ => {
                        let (sin, cos) = libm::sincos(PI * j as f64 / ROWS as f64);
                        around(i) * sin + DVec3::Y * cos
                    }
                };
                let u = (i as f64 + if pole { 0.5 } else { 0.0 }) / COLUMNS as f64;
                tessellation.add(c + direction * r, direction, DVec2::new(u, j as f64 / ROWS as f64), Place::Round);
            }
        }
        let at = |i: usize, j: usize| (j * (COLUMNS + 1) + i) as u32;
        for (i, j) in (0..COLUMNS).flat_map(|i| (0..ROWS).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            match j {
                0 => tessellation.triangles.push([a, c, d]),
                _ if j == ROWS - 1 => tessellation.triangles.push([a, c, b]),
                _ => tessellation.triangles.extend([[a, c, d], [a, d, b]]),
            }
        }
        tessellation
    }

    fn cuboid(cuboid: &Cuboid) -> Tessellation {
        let (min, max) = (cuboid.min.as_dvec3(), cuboid.max.as_dvec3());
        let mut tessellation = Tessellation::new(BaseSurface::Flat);
        // For each face: the corner where u = v = 0 (true: max), and the axes of u and v (fig. 5.31).
        let faces = [
            ([false, true, false], 2, 1),
            ([true, true, true], 2, 1),
            ([false, false, true], 0, 2),
            ([false, true, false], 0, 2),
            ([true, true, false], 0, 1),
            ([false, true, true], 0, 1),
        ];
        for (face, (corner, u, v)) in faces.into_iter().enumerate() {
            let normal = DVec3::AXES[face / 2] * if face % 2 == 1 { 1.0 } else { -1.0 };
            let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
                let mut side = corner;
                side[u] ^= i == 1;
                side[v] ^= j == 1;
                let at = |axis: usize| if side[axis] { max[axis] } else { min[axis] };
                let uv = DVec2::new(f64::from(i), f64::from(j));
                tessellation.add(DVec3::new(at(0), at(1), at(2)), normal, uv, Place::Between)
            });
            tessellation.triangles.extend([[a, c, d], [a, d, b]]);
        }
        tessellation
    }

    fn triangle(t: &Triangle) -> Tessellation {
        let mut tessellation = Tessellation::new(BaseSurface::Flat);
        let [a, b, c] = [t.a, t.b, t.c].map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
        let uv = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let corners = [0, 1, 2].map(|i| tessellation.add([a, b, c][i], normal, uv[i], Place::Between));
        tessellation.triangles.push(corners);
        tessellation.one_sided = t.one_sided;
        tessellation
    }

    fn frustum([base, top]: [Vec3; 2], radii: [f32; 2], caps: bool) -> Tessellation {
        let (base, top) = (base.as_dvec3(), top.as_dvec3());
        let frame = solve::Frame::around(top - base);
        let body = Body {
            base,
            axis: frame.y,
            x: frame.x,
            z: frame.z,
            height: (top - base).length(),
            radii: radii.map(f64::from),
        };
        let out = |i: usize| {
            let d = around(i);
            frame.x * d.x + frame.z * d.z
        };
        let mut tessellation = Tessellation::new(BaseSurface::Flat);
        for (j, h) in [(0, body.height), (1, 0.0)] {
            for i in 0..=COLUMNS {
                let uv = DVec2::new(i as f64 / COLUMNS as f64, f64::from(j));
                tessellation.add(body.point(h, out(i)), body.normal(out(i)), uv, Place::Round);
            }
        }
        let row = COLUMNS as u32 + 1;
        for i in 0..COLUMNS as u32 {
            let [a, b, c, d] = [i, i + 1, row + i, row + i + 1];
            if body.radii[1] > 0.0 {
                tessellation.triangles.push([a, d, b]);
            }
            if body.radii[0] > 0.0 {
                tessellation.triangles.push([a, c, d]);
            }
        }
        for top in [true, false] {
            let (h, r) = if top { (body.height, body.radii[1]) } else { (0.0, body.radii[0]) };
            if !caps || r == 0.0 {
                continue;
            }
            let normal = if top { body.axis } else { -body.axis };
            let center = tessellation.add(body.base + body.axis * h, normal, DVec2::splat(0.5), Place::Between);
            let rim: Vec<u32> = (0..=COLUMNS)
                .map(|i| {
                    let point = body.point(h, out(i));
                    tessellation.add(point, normal, body.cap_uv(point, top), Place::Rim { top })
                })
                .collect();
            for i in 0..COLUMNS {
                let (from, to) = if top { (rim[i], rim[i + 1]) } else { (rim[i + 1], rim[i]) };
                tessellation.triangles.push([center, from, to]);
            }
        }
        tessellation.under = BaseSurface::Frustum(body);
        tessellation
    }

    /// The tessellation of a mesh. A mesh without normals is treated as smooth.
    pub(crate) fn of_mesh(mut mesh: Mesh) -> Tessellation {
        if mesh.normals.is_empty() {
            smooth_over_seams(&mut mesh);
        }
        let mut tessellation = Tessellation::new(BaseSurface::Flat);
        // A vertex shared by two materials becomes two.
        let mut wedges: HashMap<(u32, u32), u32> = HashMap::new();
        for (i, corners) in mesh.triangles.iter().enumerate() {
            let slot = mesh.slot(i);
            let corners = corners.map(|v| {
                *wedges.entry((v, slot)).or_insert_with(|| {
                    let v = v as usize;
                    let uv = mesh.uvs.get(v).copied().unwrap_or(Vec2::ZERO).as_dvec2();
                    let normal = mesh.normals[v].as_dvec3().normalize();
                    let index = tessellation.add(mesh.positions[v].as_dvec3(), normal, uv, Place::Between);
                    let vertex = &mut tessellation.vertices[index as usize];
                    vertex.slot = slot;
                    vertex.color = mesh.colors.get(v).copied().unwrap_or_default();
                    index
                })
            });
            tessellation.triangles.push(corners);
        }
        tessellation.has_colors = !mesh.colors.is_empty();
        (tessellation.one_sided, tessellation.name, tessellation.materials) =
            (mesh.one_sided, mesh.name, mesh.materials);
        tessellation
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
            (BaseSurface::Frustum(body), place) => {
                let from = v.point - body.base;
                let h = from.dot(body.axis);
                let Some(out) = (from - body.axis * h).try_normalize() else { return v };
                let point = body.point(h, out);
                match place {
                    Place::Rim { top } => Vertex { point, uv: body.cap_uv(point, top), ..v },
                    _ => {
                        let u = near(solve::turn(out.dot(body.x), out.dot(body.z)));
                        let uv = DVec2::new(u, 1.0 - h / body.height);
                        Vertex { point, normal: body.normal(out), uv, ..v }
                    }
                }
            }
        }
    }

    /// The largest side of the box around the tessellation.
    fn size(&self) -> f64 {
        let (min, max) = self
            .vertices
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), v| (min.min(v.point), max.max(v.point)));
        (max - min).max_element()
    }

    /// The tessellation split and raised by `height`, with at most `limit` triangles. No edge is longer than a
    /// sixteenth of the tessellation's size. An edge shorter than that size divided by `detail` isn't split.
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
        self.raise(&ids, places.map.len(), &heights)
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
        })
    }
}

/// The direction of column `i` around +y, the inverse of (5.45a). The first column, at u = 0, is at −z.
fn around(i: usize) -> DVec3 {
    let (sin, cos) = libm::sincos(TAU * ((i % COLUMNS) as f64 / COLUMNS as f64 - 0.5));
    DVec3::new(sin, 0.0, cos)
}

/// Numbers for places. Equal bits have equal numbers.
#[derive(Default)]
struct Places {
    map: HashMap<[u64; 3], u32>,
}

impl Places {
    fn id(&mut self, point: DVec3) -> u32 {
        // −0 becomes 0.
        let key = (point + 0.0).to_array().map(f64::to_bits);
        let next = self.map.len() as u32;
        *self.map.entry(key).or_insert(next)
    }
}

/// Normals of a mesh without normals, equal for all vertices at one place.
fn smooth_over_seams(mesh: &mut Mesh) {
    let mut places = Places::default();
    let ids: Vec<u32> = mesh.positions.iter().map(|p| places.id(p.as_dvec3())).collect();
    let mut welded = Mesh {
        positions: vec![Vec3::ZERO; places.map.len()],
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
#[path = "displace_tests.rs"]
mod tests;
