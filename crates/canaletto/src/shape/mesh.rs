//! Triangle meshes with shared vertices.
//!
//! The geometric normal always follows the winding. Vertex normals only bend the shading, and never to the other side:
//! inward normals of an exporter are corrected triangle by triangle.

use super::surface_differential::outer;
use super::{ShapeHit, Surface, SurfaceDifferential, solve, triangle};
use crate::OutOfRange;
use crate::math::{DRay, Rgb};
use canaletto_bvh::triangle::{self as kernel, Triangle};
use canaletto_bvh::{Aabb, PreparedRay};
use canaletto_parallel::prelude::*;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

/// A triangle mesh as an importer returns it. Counter-clockwise corners face outwards (5.23).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// The name of the mesh's file or object, for messages.
    pub name: String,
    /// The origin of the positions. It is zero, unless they are so far from zero that `f32` would lose visible detail.
    #[serde(default)]
    pub origin: DVec3,
    /// The vertex positions, relative to the origin.
    pub positions: Vec<Vec3>,
    /// A normal for each position, or none (flat shading). Any length but zero.
    pub normals: Vec<Vec3>,
    /// Texture coordinates for each position, or none.
    pub uvs: Vec<Vec2>,
    /// The sets of texture coordinates after [`Mesh::uvs`], which is set 0. Each set has coordinates for each position.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_uvs: Vec<Vec<Vec2>>,
    /// A tangent for each position, or none: the frame of normal maps. x, y and z point along growing u and have any
    /// length but zero. w is 1 or −1: the bitangent is w N × T, and normal maps are upright along it (glTF 2.0,
    /// 3.7.2.1).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tangents: Vec<Vec4>,
    /// A colour for each position, or none. It replaces the colour of the material, unless a texture of the material
    /// reads it ([`crate::texture::TextureKind::VertexColor`]).
    pub colors: Vec<Rgb>,
    /// The alpha of each position's colour, or none: all are 1. Only textures read it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alphas: Vec<f32>,
    /// The indices of three positions for each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The slot in `materials` for each triangle, or none: all triangles use slot 0.
    pub slots: Vec<u32>,
    /// The indices into [`crate::scene::Scene::materials`]. An empty list stands for the node's or the inherited
    /// material.
    pub materials: Vec<u32>,
    /// Whether rays from behind pass through.
    pub one_sided: bool,
    /// The vertices when the shutter closes, if they move against each other while it is open. Those above are the
    /// vertices when it opens. Between the two, each moves along a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_pose: Option<Box<MeshPose>>,
}

/// What a mesh's vertices are at one time: lists as those of the [`Mesh`], of the same lengths.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshPose {
    /// The positions, relative to the mesh's origin.
    pub positions: Vec<Vec3>,
    /// The normals.
    pub normals: Vec<Vec3>,
    /// The tangents, whose w is that of the mesh.
    pub tangents: Vec<Vec4>,
}

impl Mesh {
    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The corners of triangle `i`.
    pub fn corners(&self, i: usize) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[i];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// The corners of triangle `i` at a time in 0..=1, from when the shutter opens to when it closes.
    pub fn corners_at(&self, i: usize, time: f32) -> [Vec3; 3] {
        let open = self.corners(i);
        self.end_pose
            .as_ref()
            .map_or(open, |pose| between(open, self.triangles[i].map(|v| pose.positions[v as usize]), time))
    }

    /// The slot of triangle `i` in [`Mesh::materials`].
    pub fn slot(&self, i: usize) -> u32 {
        self.slots.get(i).copied().unwrap_or(0)
    }

    /// The box around triangle `i` over all times.
    pub fn triangle_bounds(&self, i: usize) -> Aabb {
        let open = Aabb::from_points(self.corners(i));
        if self.end_pose.is_none() { open } else { open.union(Aabb::from_points(self.corners_at(i, 1.0))) }
    }

    /// The hit of triangle `i` at a time in 0..=1 as (t, u, v) with 0 < t ≤ t_max. One-sided meshes are only hit from
    /// the front.
    pub fn intersect_triangle(&self, i: usize, ray: &PreparedRay, t_max: f32, time: f32) -> Option<(f32, f32, f32)> {
        let hit = kernel::intersect(ray, &Triangle::new(self.corners_at(i, time)), t_max)?;
        (hit.front || !self.one_sided).then_some((hit.t, hit.u, hit.v))
    }

    /// The corners of triangle `i` for shading without textures and colours.
    #[inline(always)]
    pub(crate) fn triangle(&self, i: usize) -> Corners {
        let [a, b, c] = self.triangles[i].map(|v| v as usize);
        let of = |list: &[Vec3]| [list[a], list[b], list[c]];
        Corners { positions: of(&self.positions), normals: (!self.normals.is_empty()).then(|| of(&self.normals)) }
    }

    /// [`Mesh::triangle`] at a time in 0..=1.
    pub(crate) fn triangle_at(&self, i: usize, time: f32) -> Corners {
        let open = self.triangle(i);
        let Some(pose) = &self.end_pose else { return open };
        let of = |list: &[Vec3]| self.triangles[i].map(|v| list[v as usize]);
        let normals = open.normals.map(|normals| {
            let mean = between(normals, of(&pose.normals), time);
            // Opposite normals have no mean.
            [0, 1, 2].map(|k| if mean[k] == Vec3::ZERO { normals[k] } else { mean[k] })
        });
        Corners { positions: between(open.positions, of(&pose.positions), time), normals }
    }

    /// The surface of triangle `i` when the shutter opens, at the point (1 − u − v) a + u b + v c. Without texture
    /// coordinates, its uv is (u, v).
    pub fn surface(&self, i: usize, u: f32, v: f32) -> Surface {
        self.dressed(i, self.triangle(i).surface(u, v), triangle::weights(u.into(), v.into()))
    }

    /// The weights of triangle `i`'s corners at a hit of this line's ray, at a time in 0..=1.
    pub(crate) fn weights_at(&self, i: usize, line: &DRay, hit: &ShapeHit, time: f32) -> [f64; 3] {
        let corners = self.triangle_at(i, time);
        match corners.is_large(line, hit.t) {
            true => corners.on_line(line).1,
            false => triangle::weights(hit.uv[0].into(), hit.uv[1].into()),
        }
    }

    /// The colour and alpha of the vertices of triangle `i`, where its corners have these weights. White without
    /// colours.
    pub(crate) fn vertex_color(&self, i: usize, weights: [f64; 3]) -> [f32; 4] {
        let indices = self.triangles[i].map(|v| v as usize);
        let [wa, wb, wc] = weights.map(|w| w as f32);
        let mean = |list: &[Rgb]| {
            let [a, b, c] = indices.map(|v| list[v]);
            a * wa + b * wb + c * wc
        };
        let color = if self.colors.is_empty() { Rgb::WHITE } else { mean(&self.colors) };
        let alpha = match self.alphas.is_empty() {
            true => 1.0,
            false => indices.into_iter().zip([wa, wb, wc]).map(|(v, w)| self.alphas[v] * w).sum(),
        };
        [color.r, color.g, color.b, alpha]
    }

    /// The texture coordinates of a set after the first on triangle `i`, where its corners have these weights, and
    /// their gradients at a time in 0..=1. None if the mesh lacks the set.
    pub(crate) fn uv_in_set(&self, set: u32, i: usize, weights: [f64; 3], time: f32) -> Option<(DVec2, [DVec3; 2])> {
        let uvs = self.more_uvs.get((set as usize).checked_sub(1)?)?;
        let corners = self.triangles[i].map(|v| uvs[v as usize].as_dvec2());
        let uv = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        Some((uv, uv_gradients(corners, triangle::gradients(self.corners_at(i, time)))))
    }

    /// The tangent and the bitangent of triangle `i` for this unit shading normal, where its corners have these
    /// weights, at a time in 0..=1. The tangent may lean towards the normal. None if the mesh has no tangents.
    pub(crate) fn tangent_frame(&self, i: usize, weights: [f64; 3], normal: DVec3, time: f32) -> Option<[DVec3; 2]> {
        if self.tangents.is_empty() {
            return None;
        }
        let mean_of = |tangents: &[Vec4]| {
            let [a, b, c] = self.triangles[i].map(|v| tangents[v as usize].as_dvec4());
            a * weights[0] + b * weights[1] + c * weights[2]
        };
        let open = mean_of(&self.tangents);
        let mean = self.end_pose.as_ref().map_or(open, |pose| open.lerp(mean_of(&pose.tangents), time.into()));
        let tangent = mean.truncate().try_normalize()?;
        let side = if mean.w < 0.0 { -1.0 } else { 1.0 };
        Some([tangent, normal.cross(tangent) * side])
    }

    /// The surface of triangle `i` at a hit of this line's ray, at a time in 0..=1.
    pub fn surface_at(&self, i: usize, line: &DRay, hit: &ShapeHit, time: f32) -> Surface {
        let corners = self.triangle_at(i, time);
        if !corners.is_large(line, hit.t) {
            let [u, v] = hit.uv;
            return self.dressed(i, corners.surface(u, v), triangle::weights(u.into(), v.into()));
        }
        let (surface, weights) = corners.on_line(line);
        let surface = self.dressed(i, surface, weights);
        if self.uvs.is_empty() {
            return surface;
        }
        let [a, b, c] = self.triangles[i].map(|v| self.uvs[v as usize].as_dvec2());
        surface.with_fine_uv(a * weights[0] + b * weights[1] + c * weights[2])
    }

    /// The surface with the mesh's own texture coordinates and colours.
    fn dressed(&self, i: usize, mut surface: Surface, weights: [f64; 3]) -> Surface {
        let indices = self.triangles[i].map(|v| v as usize);
        let [wa, wb, wc] = weights.map(|w| w as f32);
        if !self.uvs.is_empty() {
            let [a, b, c] = indices.map(|v| self.uvs[v]);
            surface.uv = a * wa + b * wb + c * wc;
        }
        if !self.colors.is_empty() {
            let [a, b, c] = indices.map(|v| self.colors[v]);
            surface.color = Some(a * wa + b * wb + c * wc);
        }
        surface
    }

    /// The surface differential of triangle `i` at the point (1 − u − v) a + u b + v c, at a time in 0..=1.
    pub fn surface_differential(&self, i: usize, u: f32, v: f32, time: f32) -> SurfaceDifferential {
        let Corners { positions: corners, normals } = self.triangle_at(i, time);
        let gradients = triangle::gradients(corners);
        let indices = self.triangles[i].map(|v| v as usize);
        let mut surface_differential = SurfaceDifferential::flat(gradients[1], gradients[2]);
        if !self.uvs.is_empty() {
            surface_differential.gradients = uv_gradients(indices.map(|v| self.uvs[v].as_dvec2()), gradients);
        }
        if let Some(normals) = normals {
            let n = triangle::cross(corners[0], corners[1], corners[2]).normalize_or(DVec3::Z);
            let normals = facing(normals.map(|normal| normal.as_dvec3().normalize_or(n)), n);
            let [wa, wb, wc] = triangle::weights(u.into(), v.into());
            let mean = normals[0] * wa + normals[1] * wb + normals[2] * wc;
            let length = mean.length();
            if length > 0.0 {
                let turn = (0..3).fold(DMat3::ZERO, |sum, k| sum + outer(normals[k], gradients[k])) * (1.0 / length);
                let unit = mean / length;
                surface_differential.shape_operator = turn - outer(unit, turn.transpose() * unit);
            }
        }
        surface_differential
    }

    /// Sorts the triangles into the given order, a list of their present numbers.
    pub fn reorder(&mut self, order: &[u32]) {
        self.triangles = order.iter().map(|&i| self.triangles[i as usize]).collect();
        if !self.slots.is_empty() {
            self.slots = order.iter().map(|&i| self.slots[i as usize]).collect();
        }
    }

    /// Gives each vertex the mean normal of the triangles around it, weighted by their angles there. The result doesn't
    /// depend on how a flat face was cut into triangles (Thürmer and Wüthrich, *Computing vertex normals from polygonal
    /// facets*, 1998). Vertices that share a place but not an index keep separate normals. The mesh must have passed
    /// [`Mesh::check`].
    pub fn smooth_normals(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for (i, triangle) in self.triangles.iter().enumerate() {
            let corners = self.corners(i).map(Vec3::as_dvec3);
            let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let area = cross.length();
            if area == 0.0 {
                continue;
            }
            for k in 0..3 {
                let at = corners[k];
                let (next, last) = (corners[(k + 1) % 3] - at, corners[(k + 2) % 3] - at);
                sums[triangle[k] as usize] += cross * (libm::atan2(area, next.dot(last)) / area);
            }
        }
        // A vertex of no triangle, or of triangles without area, gets an arbitrary normal, since each must have one.
        self.normals = sums.into_iter().map(|n| n.normalize_or(DVec3::Y).as_vec3()).collect();
    }

    /// Checks that every list has its length, every index its target and every number is finite.
    ///
    /// # Errors
    /// A sentence that names the triangle or vertex (counted from 0), its value and what was expected.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let vertices = self.positions.len();
        let lists = [
            ("normals", self.normals.len()),
            ("uvs", self.uvs.len()),
            ("tangents", self.tangents.len()),
            ("colours", self.colors.len()),
            ("alphas", self.alphas.len()),
        ];
        let sets = self.more_uvs.iter().map(|uvs| ("uvs of a set", uvs.len())).filter(|(_, len)| *len != vertices);
        if let Some((name, len)) = lists.into_iter().filter(|(_, len)| *len != 0 && *len != vertices).chain(sets).next()
        {
            return Err(OutOfRange::whole(format!(
                "there are {len} {name} for {vertices} vertices; there must be none or one for each"
            )));
        }
        let (slots, triangles) = (self.slots.len(), self.len());
        if slots != 0 && slots != triangles {
            return Err(OutOfRange::whole(format!(
                "there are {slots} slots for {triangles} triangles; there must be none or one for each"
            )));
        }
        if let Some(pose) = &self.end_pose {
            self.check_pose(pose)?;
        }
        let missing = |corners: &[u32; 3]| corners.iter().any(|v| *v as usize >= vertices);
        if let Some(i) = self.triangles.par_iter().position_first(missing) {
            let v = self.triangles[i].iter().find(|v| **v as usize >= vertices).unwrap_or(&0);
            return Err(OutOfRange::whole(format!(
                "triangle {i} has vertex {v}; there are {vertices}, counted from 0"
            )));
        }
        let materials = self.materials.len().max(1);
        if let Some((i, slot)) = self.slots.par_iter().enumerate().find_first(|(_, slot)| **slot as usize >= materials)
        {
            return Err(OutOfRange::whole(format!(
                "triangle {i} has material slot {slot}; there are {materials}, counted from 0"
            )));
        }
        let wrong = |(i, p): (usize, &Vec3)| {
            let wrong = solve::finite("positions", *p).err()?;
            Some(OutOfRange::whole(format!("vertex {i} {}", wrong.problem)))
        };
        if let Some(wrong) = self.positions.par_iter().enumerate().find_map_first(wrong) {
            return Err(wrong);
        }
        let wrong = |(i, n): (usize, &Vec3)| {
            let wrong = solve::direction("normals", *n).err()?;
            Some(OutOfRange::whole(format!("the normal of vertex {i} {}", wrong.problem)))
        };
        if let Some(wrong) = self.normals.par_iter().enumerate().find_map_first(wrong) {
            return Err(wrong);
        }
        for uvs in std::iter::once(&self.uvs).chain(&self.more_uvs) {
            if let Some((i, uv)) = uvs.par_iter().enumerate().find_first(|(_, uv)| !uv.is_finite()) {
                return Err(OutOfRange::whole(format!(
                    "uv of vertex {i} is {} {}; each component must be finite",
                    uv.x, uv.y
                )));
            }
        }
        let is_wrong = |(_, t): &(usize, &Vec4)| !(t.is_finite() && t.w.abs() == 1.0);
        if let Some((i, t)) = self.tangents.par_iter().enumerate().find_first(is_wrong) {
            return Err(OutOfRange::whole(format!(
                "the tangent of vertex {i} is {} {} {} {}; each component must be finite, and the last 1 or -1",
                t.x, t.y, t.z, t.w
            )));
        }
        if let Some((i, alpha)) = self.alphas.par_iter().enumerate().find_first(|(_, alpha)| !alpha.is_finite()) {
            return Err(OutOfRange::whole(format!("the alpha of vertex {i} is {alpha}; it must be finite")));
        }
        if let Some((i, c)) = self.colors.par_iter().enumerate().find_first(|(_, c)| !c.is_finite()) {
            let Rgb { r, g, b } = c;
            return Err(OutOfRange::whole(format!(
                "the colour of vertex {i} is {r} {g} {b}; each component must be finite"
            )));
        }
        Ok(())
    }

    /// Checks that a pose has the lists of the mesh, and that each number is finite.
    fn check_pose(&self, pose: &MeshPose) -> Result<(), OutOfRange> {
        let lists = [
            ("positions", pose.positions.len(), self.positions.len()),
            ("normals", pose.normals.len(), self.normals.len()),
            ("tangents", pose.tangents.len(), self.tangents.len()),
        ];
        if let Some((name, of_pose, of_mesh)) = lists.into_iter().find(|(_, of_pose, of_mesh)| of_pose != of_mesh) {
            let problem = format!("its pose when the shutter closes has {of_pose} {name}; the mesh has {of_mesh}");
            return Err(OutOfRange::whole(problem));
        }
        let finite = |i: usize| {
            pose.positions[i].is_finite()
                && pose.normals.get(i).is_none_or(|n| n.is_finite())
                && pose.tangents.get(i).is_none_or(|t| t.is_finite())
        };
        match (0..pose.positions.len()).find(|&i| !finite(i)) {
            None => Ok(()),
            Some(i) => {
                let problem = format!("vertex {i} of its pose when the shutter closes must have finite numbers");
                Err(OutOfRange::whole(problem))
            }
        }
    }
}

/// The points between two others at a time in 0..=1, within the box around both.
fn between(open: [Vec3; 3], close: [Vec3; 3], time: f32) -> [Vec3; 3] {
    let at = |a: Vec3, b: Vec3| (a * (1.0 - time) + b * time).clamp(a.min(b), a.max(b));
    [at(open[0], close[0]), at(open[1], close[1]), at(open[2], close[2])]
}

/// The gradients of texture coordinates, from those of the corners and the gradients of the corners' weights.
fn uv_gradients(uvs: [DVec2; 3], gradients: [DVec3; 3]) -> [DVec3; 2] {
    let mut sums = [DVec3::ZERO; 2];
    for (uv, gradient) in uvs.into_iter().zip(gradients) {
        sums[0] += gradient * uv.x;
        sums[1] += gradient * uv.y;
    }
    sums
}

/// A triangle of a mesh.
pub(crate) struct Corners {
    pub(crate) positions: [Vec3; 3],
    /// The normals at the corners; any length but zero.
    pub(crate) normals: Option<[Vec3; 3]>,
}

impl Corners {
    /// [`Mesh::surface`] without the mesh's texture coordinates and colours. The only branch is on normals, so that the
    /// compiler vectorises.
    #[inline(always)]
    pub(super) fn surface(&self, u: f32, v: f32) -> Surface {
        let weights = triangle::weights(u.into(), v.into());
        let point = triangle::blend(self.positions, weights);
        self.around(point, weights, [f64::from(u), f64::from(v)])
    }

    /// The surface at a hit of this line's ray. The barycentric coordinates are `f32`. They are exact enough except on
    /// triangles that are large relative to the distance of the hit.
    #[inline]
    pub(super) fn at(&self, line: &DRay, hit: &ShapeHit) -> Surface {
        if self.is_large(line, hit.t) { self.on_line(line).0 } else { self.surface(hit.uv[0], hit.uv[1]) }
    }

    /// Whether the triangle is [large](solve::is_large) relative to the distance to a hit at the ray's parameter `t`.
    #[inline(always)]
    pub(super) fn is_large(&self, line: &DRay, t: f32) -> bool {
        let [a, b, c] = self.positions;
        let size = (b - a).abs().max((c - a).abs()).max_element();
        solve::is_large(size.into(), line.longest(), t)
    }

    /// The surface where the line intersects the triangle's plane (5.28), and the weights of the corners there. The
    /// only branch is on normals.
    #[inline(always)]
    pub(super) fn on_line(&self, line: &DRay) -> (Surface, [f64; 3]) {
        let [a, b, c] = self.positions;
        let cross = triangle::cross(a, b, c);
        let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
        // The unit normal keeps products of lengths within the range of `f64`.
        let n = cross.normalize_or(DVec3::Z);
        let point = line.origin + line.direction * ((a - line.origin).dot(n) / line.direction.dot(n));
        // The intersection of a line along the plane may lie outside the triangle's box.
        let point = point.max(a.min(b).min(c)).min(a.max(b).max(c));
        // L₂ and L₃ of (5.31).
        let (p, area) = (point - a, cross.dot(n));
        let (u, v) = (p.cross(c - a).dot(n) / area, (b - a).cross(p).dot(n) / area);
        let weights = triangle::weights(u.min(1.0), v.min(1.0));
        (self.around(point, weights, [u, v]).with_fine_uv(DVec2::new(u, v)), weights)
    }

    /// The surface at a point of the triangle where the corners have these weights.
    #[inline(always)]
    fn around(&self, point: DVec3, weights: [f64; 3], uv: [f64; 2]) -> Surface {
        let corners = self.positions;
        let n = triangle::cross(corners[0], corners[1], corners[2]).normalize_or(DVec3::Z); // (5.23)
        let mut surface = solve::surface(point, triangle::size(corners), n, uv);
        if let Some(normals) = self.normals {
            let normals = facing(normals.map(|normal| normal.as_dvec3().normalize_or(n)), n);
            surface.shading_normal = shading_normal(normals, weights, n);
            surface.shadow_origin = (point + lift(point, corners, normals, weights, n)).as_vec3();
        }
        surface
    }
}

/// The vertex normals, reversed if as a whole they point against the geometric normal.
#[inline(always)]
fn facing(normals: [DVec3; 3], n: DVec3) -> [DVec3; 3] {
    let [a, b, c] = normals;
    if (a + b + c).dot(n) < 0.0 { [-a, -b, -c] } else { normals }
}

/// The interpolated normal, mirrored at the triangle's plane where it points behind it.
#[inline(always)]
fn shading_normal([a, b, c]: [DVec3; 3], [wa, wb, wc]: [f64; 3], n: DVec3) -> DVec3 {
    let mean = a * wa + b * wb + c * wc;
    let front = mean - n * (2.0 * mean.dot(n).min(0.0));
    let unit = front.normalize_or(n);
    if unit.dot(n) > 0.0 { unit } else { n }
}

/// The offset from the flat triangle to the smooth surface that its normals describe. It is the weighted mean of the
/// offsets to the planes through the vertices, perpendicular to their normals. Only planes above the point count
/// (Hanika, Ray Tracing Gems II, ch. 4), and only normals on the outer side, so that the offset never points inwards.
#[inline(always)]
fn lift(point: DVec3, corners: [Vec3; 3], normals: [DVec3; 3], weights: [f64; 3], n: DVec3) -> DVec3 {
    let mut way = DVec3::ZERO;
    for k in 0..3 {
        let below = (point - corners[k].as_dvec3()).dot(normals[k]);
        if below < 0.0 && normals[k].dot(n) > 0.0 {
            way -= normals[k] * (below * weights[k]);
        }
    }
    way
}

#[cfg(test)]
mod tests;
