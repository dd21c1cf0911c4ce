//! A mesh under construction from corners that index positions, texture coordinates and normals apart.

use super::polygon::vector_area;
use canaletto::math::Rgb;
use canaletto::shape::Mesh;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// What the file's lists of vertices hold.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    /// Empty, or one for each position.
    pub(super) colors: Vec<Rgb>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
}

/// No texture coordinates, normal or material.
pub(super) const NONE: u32 = u32::MAX;

/// Positions in the lists of [`Vertices`]: position, texture coordinates, normal; the last two may be [`NONE`].
pub(super) type Corner = [u32; 3];

/// One mesh so far.
pub(super) struct Part {
    name: String,
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    slots: Vec<u32>,
    materials: Vec<u32>,
}

/// Meshes by name, each corner shared by its triangles.
#[derive(Default)]
pub(super) struct Parts {
    list: Vec<Part>,
    names: HashMap<String, usize>,
    /// For each position the corner met last and its number, with the part: the usual case needs no hash.
    latest: Vec<Option<(u32, Corner, u32)>>,
    others: HashMap<(u32, Corner), u32>,
    slots: HashMap<(usize, u32), u32>,
}

impl Parts {
    pub(super) fn new(positions: usize) -> Parts {
        Parts { latest: vec![None; positions], ..Parts::default() }
    }

    /// The number of the part of this name.
    pub(super) fn named(&mut self, name: &str) -> usize {
        if let Some(part) = self.names.get(name) {
            return *part;
        }
        self.names.insert(name.to_owned(), self.list.len());
        self.list.push(Part {
            name: name.to_owned(),
            corners: Vec::new(),
            triangles: Vec::new(),
            slots: Vec::new(),
            materials: Vec::new(),
        });
        self.list.len() - 1
    }

    /// The slot of a material in a part.
    pub(super) fn slot(&mut self, part: usize, material: u32) -> u32 {
        let materials = &mut self.list[part].materials;
        *self.slots.entry((part, material)).or_insert_with(|| {
            materials.push(material);
            materials.len() as u32 - 1
        })
    }

    /// The number that a corner has in a part.
    pub(super) fn corner(&mut self, part: usize, corner: Corner) -> u32 {
        let key = part as u32;
        let latest = &mut self.latest[corner[0] as usize];
        if let Some((of, known, number)) = *latest {
            if of == key && known == corner {
                return number;
            }
            self.others.insert((of, known), number);
        }
        let corners = &mut self.list[part].corners;
        let number = self.others.get(&(key, corner)).copied().unwrap_or_else(|| {
            corners.push(corner);
            corners.len() as u32 - 1
        });
        *latest = Some((key, corner, number));
        number
    }

    pub(super) fn triangle(&mut self, part: usize, triangle: [u32; 3], slot: u32) {
        let part = &mut self.list[part];
        part.triangles.push(triangle);
        part.slots.push(slot);
    }

    /// The meshes that have triangles. Faces without a material get `default`, asked for only where others have one.
    pub(super) fn finish(self, vertices: &Vertices, mut default: impl FnMut() -> u32) -> Vec<Mesh> {
        drop((self.latest, self.others));
        let parts = self.list.into_iter().filter(|part| !part.triangles.is_empty());
        parts.map(|part| part.finish(vertices, &mut default)).collect()
    }
}

impl Part {
    fn finish(self, vertices: &Vertices, default: &mut impl FnMut() -> u32) -> Mesh {
        let Part { name, corners, triangles, mut slots, mut materials } = self;
        if materials == [NONE] {
            materials.clear();
        }
        for material in materials.iter_mut().filter(|m| **m == NONE) {
            *material = default();
        }
        if materials.len() < 2 {
            slots.clear();
        }
        let some = |which: usize| corners.iter().any(|c| c[which] != NONE);
        let take = |c: &Corner, which: usize| (c[which] != NONE).then_some(c[which] as usize);
        let uvs = if some(1) {
            corners.iter().map(|c| take(c, 1).map_or(Vec2::ZERO, |i| vertices.uvs[i])).collect()
        } else {
            Vec::new()
        };
        let normals = if some(2) {
            corners.iter().map(|c| take(c, 2).map_or(Vec3::ZERO, |i| vertices.normals[i])).collect()
        } else {
            Vec::new()
        };
        let colors = if vertices.colors.is_empty() {
            Vec::new()
        } else {
            corners.iter().map(|c| vertices.colors[c[0] as usize]).collect()
        };
        let positions = corners.iter().map(|c| vertices.positions[c[0] as usize]).collect();
        let mut mesh = Mesh { name, positions, normals, uvs, colors, triangles, slots, materials, one_sided: false };
        mend_normals(&mut mesh);
        mesh
    }
}

/// Makes normals unit vectors, and gives vertices whose normal has no direction the mean of their triangles'; no normals
/// at all stay none.
pub(super) fn mend_normals(mesh: &mut Mesh) {
    // Through f64, since the squares of f32 may vanish or overflow.
    mesh.normals.iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
    let broken = |n: &Vec3| *n == Vec3::ZERO;
    if !mesh.normals.iter().any(broken) {
        return;
    }
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let normal = vector_area(&triangle.map(|i| mesh.positions[i as usize]));
        triangle.iter().for_each(|i| sums[*i as usize] += normal);
    }
    for (normal, sum) in mesh.normals.iter_mut().zip(sums) {
        if broken(normal) {
            *normal = sum.try_normalize().unwrap_or(DVec3::Y).as_vec3();
        }
    }
}
