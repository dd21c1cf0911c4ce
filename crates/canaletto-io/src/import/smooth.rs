//! Normals for meshes that have none: smooth over flat edges, faceted at sharp ones.

use super::polygon::vector_area;
use canaletto::shape::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// cos 40°: faces that meet at a larger angle form a crease.
const CREASE: f64 = 0.766_044_443_118_978;

/// Gives the mesh vertex normals. Vertices at a crease are split, one copy for each side. Faces count as neighbours
/// where two of their corners have the same positions, so seams of texture coordinates don't show.
pub(super) fn smooth(mesh: &mut Mesh) {
    if !mesh.normals.is_empty() || mesh.triangles.is_empty() {
        return;
    }
    let welded = weld(&mesh.positions);
    let normals: Vec<DVec3> =
        mesh.triangles.par_iter().map(|t| vector_area(&t.map(|i| mesh.positions[i as usize]))).collect();
    // Corner 3 t + i is corner i of triangle t. Corners at one vertex that are joined share a normal.
    let mut joined = Joined { parent: (0..3 * mesh.triangles.len() as u32).collect() };
    for edge in edges(mesh, &welded).chunk_by(|a, b| a.0 == b.0) {
        // All faces at one edge in their order; usually two.
        for pair in edge.windows(2) {
            let (a, b) = (Edge::at(mesh, &welded, pair[0].1), Edge::at(mesh, &welded, pair[1].1));
            let (na, nb) = (normals[a.triangle].normalize_or_zero(), normals[b.triangle].normalize_or_zero());
            // The edge runs the other way in a neighbour of the same orientation.
            if a.from != b.from && na.dot(nb) >= CREASE {
                joined.join(a.start, b.end);
                joined.join(a.end, b.start);
            }
        }
    }
    let mut sums = vec![DVec3::ZERO; joined.parent.len()];
    for corner in 0..joined.parent.len() as u32 {
        sums[joined.root(corner) as usize] += normals[corner as usize / 3];
    }
    split(mesh, &mut joined, &sums);
}

/// Writes the normals, and copies of those vertices whose corners have several.
fn split(mesh: &mut Mesh, joined: &mut Joined, sums: &[DVec3]) {
    const FREE: u32 = u32::MAX;
    let mut first = vec![FREE; mesh.positions.len()];
    let mut copies: HashMap<(u32, u32), u32> = HashMap::new();
    let mut normals = vec![Vec3::Y; mesh.positions.len()];
    for triangle in 0..mesh.triangles.len() {
        for i in 0..3 {
            let vertex = mesh.triangles[triangle][i];
            let root = joined.root((3 * triangle + i) as u32);
            let known = &mut first[vertex as usize];
            if *known == FREE {
                *known = root;
                normals[vertex as usize] = sums[root as usize].try_normalize().unwrap_or(DVec3::Y).as_vec3();
            }
            if *known == root {
                continue;
            }
            let copy = *copies.entry((vertex, root)).or_insert_with(|| {
                mesh.positions.push(mesh.positions[vertex as usize]);
                if !mesh.uvs.is_empty() {
                    mesh.uvs.push(mesh.uvs[vertex as usize]);
                }
                if !mesh.colors.is_empty() {
                    mesh.colors.push(mesh.colors[vertex as usize]);
                }
                normals.push(sums[root as usize].try_normalize().unwrap_or(DVec3::Y).as_vec3());
                normals.len() as u32 - 1
            });
            mesh.triangles[triangle][i] = copy;
        }
    }
    mesh.normals = normals;
}

/// For each vertex the number of the first one at the same position.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(positions.len());
    let numbers = positions.iter().enumerate();
    // Adding 0 makes −0 and 0 the same.
    numbers.map(|(i, p)| *first.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(i as u32)).collect()
}

/// All edges of all triangles as (ends, corner at which it starts), sorted.
fn edges(mesh: &Mesh, welded: &[u32]) -> Vec<(u64, u32)> {
    let mut all: Vec<(u64, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (welded[triangle[i] as usize], welded[triangle[(i + 1) % 3] as usize]);
            if a != b {
                all.push((u64::from(a.min(b)) << 32 | u64::from(a.max(b)), (3 * t + i) as u32));
            }
        }
    }
    all.par_sort_unstable();
    all
}

struct Edge {
    triangle: usize,
    start: u32,
    end: u32,
    from: u32,
}

impl Edge {
    fn at(mesh: &Mesh, welded: &[u32], corner: u32) -> Edge {
        let (t, i) = (corner / 3, corner % 3);
        let from = welded[mesh.triangles[t as usize][i as usize] as usize];
        Edge { triangle: t as usize, start: corner, end: 3 * t + (i + 1) % 3, from }
    }
}

/// Sets of corners (union-find with path halving).
struct Joined {
    parent: Vec<u32>,
}

impl Joined {
    fn root(&mut self, mut corner: u32) -> u32 {
        while self.parent[corner as usize] != corner {
            let up = self.parent[self.parent[corner as usize] as usize];
            self.parent[corner as usize] = up;
            corner = up;
        }
        corner
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roof(height: f32) -> Mesh {
        let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        // Two sides that meet along the z axis, with a seam: the ridge's vertices stand twice.
        let positions = vec![
            p(0., height, 0.),
            p(0., height, 1.),
            p(-1., 0., 0.),
            p(0., height, 0.),
            p(0., height, 1.),
            p(1., 0., 0.),
        ];
        Mesh { positions, triangles: vec![[0, 2, 1], [3, 4, 5]], ..Mesh::default() }
    }

    #[test]
    fn flat_edges_are_smooth_across_seams() {
        let mut mesh = roof(0.2);
        smooth(&mut mesh);
        assert_eq!(mesh.positions.len(), 6);
        assert!((mesh.normals[0] - Vec3::Y).length() < 1e-6 && mesh.normals[0] == mesh.normals[3]);
        assert!(mesh.normals[2].x < -0.1 && mesh.normals[5].x > 0.1);
    }

    #[test]
    fn creases_stay_sharp_and_split_their_vertices() {
        let mut mesh = roof(2.0);
        mesh.triangles = vec![[0, 2, 1], [0, 1, 5]];
        mesh.uvs = vec![glam::Vec2::ONE; 6];
        smooth(&mut mesh);
        assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.normals.len()), (8, 8, 8));
        let [a, b] = [mesh.triangles[0][0], mesh.triangles[1][0]].map(|i| mesh.normals[i as usize]);
        assert!(a.x < -0.8 && b.x > 0.8);
    }

    #[test]
    fn odd_meshes_pass() {
        let point = Vec3::ONE;
        let mut mesh = Mesh { positions: vec![point; 3], triangles: vec![[0, 1, 2], [0, 0, 0]], ..Mesh::default() };
        smooth(&mut mesh);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
        // Three faces at one edge, one of them turned round.
        let mut mesh = roof(0.1);
        mesh.triangles.extend([[0, 1, 2], [1, 0, 5]]);
        smooth(&mut mesh);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
    }
}
