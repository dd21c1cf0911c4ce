//! Tangents of meshes without any, by MikkTSpace, as glTF asks for normal maps (3.7.2.1).

use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use canaletto::shape::Mesh;
use glam::Vec4;
use std::collections::HashMap;

/// Functions that give equal bits on every machine.
struct Libm;

impl Ops for Libm {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        libm::acosf(x)
    }
}

struct Corners<'a> {
    mesh: &'a Mesh,
    uvs: &'a [glam::Vec2],
    /// The tangent of each corner.
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry<Libm> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        let [x, y, z, w] = space.tangent_encoded();
        // v grows downwards in images, and MikkTSpace takes it to grow upwards.
        self.tangents[3 * face + corner] = Vec4::new(x, y, z, if w < 0.0 { 1.0 } else { -1.0 });
    }
}

/// Gives a mesh with normals the tangents of a set of its texture coordinates. Vertices whose corners have different
/// tangents become several. Without normals or the set, the mesh stays as it is.
pub(super) fn with_tangents(mesh: &mut Mesh, set: u32) {
    let uvs = match set {
        0 => Some(&mesh.uvs),
        _ => mesh.more_uvs.get(set as usize - 1),
    };
    let Some(uvs) = uvs.filter(|uvs| !uvs.is_empty() && !mesh.normals.is_empty()) else { return };
    let none = Vec4::new(0.0, 0.0, 0.0, 1.0);
    let mut corners = Corners { mesh, uvs, tangents: vec![none; 3 * mesh.triangles.len()] };
    if generate_tangents(&mut corners).is_err() {
        return;
    }
    let tangents = corners.tangents;
    split(mesh, &tangents);
}

/// Gives each corner its tangent. The first tangent of a vertex stays with it.
fn split(mesh: &mut Mesh, of_corners: &[Vec4]) {
    let count = mesh.positions.len();
    let mut own: Vec<Option<Vec4>> = vec![None; count];
    let mut others: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut copies: Vec<(usize, Vec4)> = Vec::new();
    for (corner, tangent) in mesh.triangles.as_flattened_mut().iter_mut().zip(of_corners) {
        match &mut own[*corner as usize] {
            Some(known) if known != tangent => {
                let key = (*corner, tangent.to_array().map(f32::to_bits));
                *corner = *others.entry(key).or_insert_with(|| {
                    copies.push((*corner as usize, *tangent));
                    (count + copies.len() - 1) as u32
                });
            }
            slot => *slot = Some(*tangent),
        }
    }
    fn again<T: Copy>(list: &mut Vec<T>, copies: &[(usize, Vec4)]) {
        if !list.is_empty() {
            copies.iter().for_each(|(from, _)| list.push(list[*from]));
        }
    }
    again(&mut mesh.positions, &copies);
    again(&mut mesh.normals, &copies);
    again(&mut mesh.uvs, &copies);
    mesh.more_uvs.iter_mut().for_each(|uvs| again(uvs, &copies));
    again(&mut mesh.colors, &copies);
    again(&mut mesh.alphas, &copies);
    let none = Vec4::new(0.0, 0.0, 0.0, 1.0);
    mesh.tangents = own.into_iter().map(|t| t.unwrap_or(none)).chain(copies.iter().map(|(_, t)| *t)).collect();
}
