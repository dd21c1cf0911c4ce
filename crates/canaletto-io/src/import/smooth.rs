//! Vertex normals for meshes without them: smooth across some edges, faceted at the others.

use canaletto::shape::Mesh;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// cos 40°: faces that meet at a larger angle form a crease.
const CREASE: f64 = 0.766_044_443_118_978;

/// The cosine of an angle of about 10⁻⁶, the rounding between parts of a flat face.
const FLAT: f64 = 1.0 - 1e-12;

/// The edges across which a surface is smooth.
#[derive(Clone, Copy, Debug)]
pub(super) enum Smoothing<'a> {
    /// All edges except creases.
    Creases,
    /// The edges between triangles of one group. Each triangle has a group; 0 is none.
    Groups(&'a [u32]),
}

impl Smoothing<'_> {
    fn joins(self, normals: &[DVec3], a: usize, b: usize) -> bool {
        match self {
            Smoothing::Creases => normals[a].dot(normals[b]) >= CREASE,
            // Triangles of a flat face share their vertices.
            Smoothing::Groups(groups) => {
                groups[a] == groups[b] && (groups[a] != 0 || normals[a].dot(normals[b]) > FLAT)
            }
        }
    }
}

/// Computes normals for vertices whose normal is zero, and for all if there are none. A vertex is split into one copy
/// for each side of a sharp edge. Triangles are neighbours if two of their corners have equal positions, so seams of
/// texture coordinates are invisible. Each triangle is weighted by its angle at the vertex, so the triangulation of
/// polygons doesn't matter (Thürmer and Wüthrich, *Computing vertex normals from polygonal facets*, 1998).
pub(super) fn smooth(mesh: &mut Mesh, smoothing: Smoothing<'_>) {
    if mesh.normals.is_empty() {
        mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
    }
    let normals: Vec<DVec3> = mesh.triangles.par_iter().map(|t| unit_normal(mesh, t)).collect();
    // Corner 3 t + i is corner i of triangle t. Joined corners at a vertex share a normal.
    let corners = {
        let welded = weld(&mesh.positions);
        let mut joined = Joined { parent: (0..3 * mesh.triangles.len() as u32).collect() };
        for edge in edges(mesh, &welded).chunk_by(|a, b| a[..2] == b[..2]) {
            // All triangles at one edge, in order; usually two.
            for pair in edge.windows(2) {
                let (a, b) = (Edge::at(mesh, &welded, pair[0][2]), Edge::at(mesh, &welded, pair[1][2]));
                // The edge has the opposite direction in a neighbour of equal orientation.
                if a.from != b.from && smoothing.joins(&normals, a.triangle, b.triangle) {
                    joined.join(a.start, b.end);
                    joined.join(a.end, b.start);
                }
            }
        }
        joined.numbered()
    };
    let mut sums = vec![DVec3::ZERO; corners.iter().max().map_or(0, |most| *most as usize + 1)];
    for (triangle, normal) in normals.iter().enumerate() {
        for (i, angle) in angles(mesh, &mesh.triangles[triangle]).into_iter().enumerate() {
            sums[corners[3 * triangle + i] as usize] += *normal * angle;
        }
    }
    split(mesh, &corners, &sums);
}

fn unit_normal(mesh: &Mesh, triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
    (b - a).cross(c - a).normalize_or_zero()
}

/// The angles of a triangle.
fn angles(mesh: &Mesh, triangle: &[u32; 3]) -> [f64; 3] {
    let corners = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
    std::array::from_fn(|k| {
        let (next, last) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
        libm::atan2(next.cross(last).length(), next.dot(last))
    })
}

/// Writes the normals, and copies the vertices whose corners have several. `corners` has the index into `sums` for each
/// corner.
fn split(mesh: &mut Mesh, corners: &[u32], sums: &[DVec3]) {
    const FREE: u32 = u32::MAX;
    let lacks: Vec<bool> = mesh.normals.iter().map(|n| *n == Vec3::ZERO).collect();
    let normal = |sum: u32| sums[sum as usize].try_normalize().unwrap_or(DVec3::Y).as_vec3();
    let mut first = vec![FREE; mesh.positions.len()];
    let mut copies: HashMap<(u32, u32), u32> = HashMap::new();
    for triangle in 0..mesh.triangles.len() {
        for i in 0..3 {
            let (vertex, sum) = (mesh.triangles[triangle][i], corners[3 * triangle + i]);
            let at = vertex as usize;
            if !lacks[at] {
                continue;
            }
            if first[at] == FREE {
                first[at] = sum;
                mesh.normals[at] = normal(sum);
            }
            if first[at] == sum {
                continue;
            }
            let copy = *copies.entry((vertex, sum)).or_insert_with(|| {
                mesh.positions.push(mesh.positions[at]);
                if !mesh.uvs.is_empty() {
                    mesh.uvs.push(mesh.uvs[at]);
                }
                if !mesh.colors.is_empty() {
                    mesh.colors.push(mesh.colors[at]);
                }
                mesh.normals.push(normal(sum));
                mesh.normals.len() as u32 - 1
            });
            mesh.triangles[triangle][i] = copy;
        }
    }
    // Vertices that no triangle uses must have a normal, too.
    mesh.normals.par_iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
}

/// For each vertex, the index of the first vertex at an equal position.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    // Adding 0 turns −0 into 0.
    let place = |i: u32| (positions[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    rayon::slice::ParallelSliceMut::par_sort_unstable_by_key(&mut *order, |i| (place(*i), *i));
    let mut welded = vec![0; positions.len()];
    for same in order.chunk_by(|a, b| place(*a) == place(*b)) {
        same.iter().for_each(|i| welded[*i as usize] = same[0]);
    }
    welded
}

/// All edges of all triangles as [one end, other end, corner at which it starts], sorted.
fn edges(mesh: &Mesh, welded: &[u32]) -> Vec<[u32; 3]> {
    let mut all: Vec<[u32; 3]> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (welded[triangle[i] as usize], welded[triangle[(i + 1) % 3] as usize]);
            if a != b {
                all.push([a.min(b), a.max(b), (3 * t + i) as u32]);
            }
        }
    }
    rayon::slice::ParallelSliceMut::par_sort_unstable(&mut *all);
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

    /// The number of each corner's set, from 0 in the order of their first corners.
    fn numbered(mut self) -> Vec<u32> {
        let mut count = 0;
        for corner in 0..self.parent.len() {
            // A parent comes before its children, so its number is assigned already.
            let up = self.parent[corner] as usize;
            if up == corner {
                self.parent[corner] = count;
                count += 1;
            } else {
                self.parent[corner] = self.parent[up];
            }
        }
        self.parent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roof(height: f32) -> Mesh {
        let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        // Two sides that meet along the z axis, with a seam: the vertices of the ridge are duplicated.
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
        smooth(&mut mesh, Smoothing::Creases);
        assert_eq!(mesh.positions.len(), 6);
        assert!((mesh.normals[0] - Vec3::Y).length() < 1e-6 && mesh.normals[0] == mesh.normals[3]);
        assert!(mesh.normals[2].x < -0.1 && mesh.normals[5].x > 0.1);
    }

    #[test]
    fn creases_stay_sharp_and_split_their_vertices() {
        let mut mesh = roof(2.0);
        mesh.triangles = vec![[0, 2, 1], [0, 1, 5]];
        mesh.uvs = vec![glam::Vec2::ONE; 6];
        smooth(&mut mesh, Smoothing::Creases);
        assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.normals.len()), (8, 8, 8));
        let [a, b] = [mesh.triangles[0][0], mesh.triangles[1][0]].map(|i| mesh.normals[i as usize]);
        assert!(a.x < -0.8 && b.x > 0.8);
    }

    #[test]
    fn odd_meshes_pass() {
        let point = Vec3::ONE;
        let mut mesh = Mesh { positions: vec![point; 3], triangles: vec![[0, 1, 2], [0, 0, 0]], ..Mesh::default() };
        smooth(&mut mesh, Smoothing::Creases);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
        // Three faces at one edge; one of them has the opposite orientation.
        let mut mesh = roof(0.1);
        mesh.triangles.extend([[0, 1, 2], [1, 0, 5]]);
        smooth(&mut mesh, Smoothing::Creases);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
    }

    /// The sides of a prism of n corners around y, from y = 0 to 2, two triangles each, and a fan for the upper face.
    fn prism(n: u32) -> Mesh {
        let angle = |i: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        let point = |i: u32, y: f32| Vec3::new(libm::cos(angle(i)) as f32, y, -libm::sin(angle(i)) as f32);
        let positions = (0..2 * n).map(|i| point(i % n, if i < n { 0.0 } else { 2.0 })).collect();
        let side = |i: u32| [[i, (i + 1) % n, n + (i + 1) % n], [i, n + (i + 1) % n, n + i]];
        let triangles = (0..n).flat_map(side).collect();
        let mut mesh = Mesh { positions, triangles, ..Mesh::default() };
        mesh.triangles.extend((1..n - 1).map(|i| [n, n + i, n + i + 1]));
        mesh
    }

    #[test]
    fn groups_are_smooth_whatever_the_angle() {
        for n in [3, 4, 8] {
            let mut mesh = prism(n);
            let groups: Vec<u32> = (0..mesh.triangles.len() as u32).map(|t| u32::from(t < 2 * n)).collect();
            smooth(&mut mesh, Smoothing::Groups(&groups));
            assert_eq!(mesh.positions.len(), 2 * n as usize + n as usize);
            for (t, triangle) in mesh.triangles.iter().enumerate() {
                for i in triangle.map(|i| i as usize) {
                    let p = mesh.positions[i];
                    let right = if t < 2 * n as usize { Vec3::new(p.x, 0.0, p.z) } else { Vec3::Y };
                    assert!((mesh.normals[i] - right).length() < 1e-6, "{n}: {} at {p}", mesh.normals[i]);
                }
            }
        }
        // A separate group for each side, or none at all: every side is faceted.
        for groups in [[0; 10], [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]] {
            let mut mesh = prism(4);
            smooth(&mut mesh, Smoothing::Groups(&groups));
            for triangle in &mesh.triangles {
                let normal = unit_normal(&mesh, triangle).as_vec3();
                assert!(triangle.iter().all(|i| (mesh.normals[*i as usize] - normal).length() < 1e-6));
            }
        }
    }

    #[test]
    fn normals_that_are_there_stay() {
        let mut mesh = prism(8);
        mesh.normals = vec![Vec3::ZERO; 16];
        mesh.normals[3] = Vec3::NEG_X;
        smooth(&mut mesh, Smoothing::Creases);
        assert_eq!(mesh.normals[3], Vec3::NEG_X);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
    }
}
