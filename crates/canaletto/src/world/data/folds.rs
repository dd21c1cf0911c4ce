//! Folds of a mesh: places where it lies on itself. Faces there are back to back, or belong to different surfaces.

use crate::shape::Mesh;
use canaletto_bvh::Aabb;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};

/// The largest distance between coinciding faces, relative to their largest coordinate. It is far larger than the one
/// that rays use.
pub(in crate::world) const NEAR: f32 = 1.0 / (1 << 14) as f32;

/// The sine of the largest angle between faces that rays treat as parallel, with a margin.
const SKEW: f32 = 0.06;

/// The number of triangles in a leaf of the hierarchy.
const LEAF: usize = 8;

/// The number of pairs tested per triangle. If a mesh needs more, all of it counts as folded.
const MAX_PAIRS_PER_TRIANGLE: usize = 16;

/// The pairs that are compared in any mesh, however small.
const MIN_PAIRS: usize = 1 << 16;

/// A triangle, or several neighbouring ones.
#[derive(Clone, Copy)]
struct TriangleCluster {
    bounds: Aabb,
    /// The box around all unit normals.
    normals: Aabb,
    /// The least and the greatest number of the surfaces that they belong to.
    surfaces: [u32; 2],
}

impl TriangleCluster {
    fn of(mesh: &Mesh, triangle: usize, surface: u32) -> TriangleCluster {
        let [a, b, c] = mesh.corners(triangle);
        let across = (b - a).cross(c - a);
        let length = across.length();
        // Squares in `f32` lose precision outside this range.
        let normal = if (1e-15..1e15).contains(&length) {
            across / length
        } else {
            let (ab, ac) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
            ab.cross(ac).normalize_or_zero().as_vec3()
        };
        TriangleCluster {
            bounds: Aabb { min: a.min(b).min(c), max: a.max(b).max(c) },
            normals: Aabb { min: normal, max: normal },
            surfaces: [surface; 2],
        }
    }

    fn and(self, other: &TriangleCluster) -> TriangleCluster {
        let union = |a: &Aabb, b: &Aabb| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) };
        let [[a, b], [c, d]] = [self.surfaces, other.surfaces];
        TriangleCluster {
            bounds: union(&self.bounds, &other.bounds),
            normals: union(&self.normals, &other.normals),
            surfaces: [a.min(c), b.max(d)],
        }
    }

    /// Whether faces of the two may coincide as a fold.
    fn may_coincide(&self, other: &TriangleCluster, near: f32) -> bool {
        let (min, max) = (-other.normals.max - SKEW, -other.normals.min + SKEW);
        let [[a, b], [c, d]] = [self.surfaces, other.surfaces];
        expanded(&self.bounds, near).overlaps(&expanded(&other.bounds, near))
            && (self.normals.overlaps(&Aabb { min, max }) || !(a == b && b == c && c == d))
    }
}

/// A box with a margin for coinciding faces.
pub(in crate::world) fn with_margin(bounds: &Aabb) -> Aabb {
    expanded(bounds, largest(bounds) * NEAR)
}

/// The largest coordinate in a box.
pub(in crate::world) fn largest(bounds: &Aabb) -> f32 {
    bounds.min.abs().max(bounds.max.abs()).max_element()
}

fn expanded(bounds: &Aabb, by: f32) -> Aabb {
    Aabb { min: bounds.min - by, max: bounds.max + by }
}

/// The box around all folds of a mesh. `surface` returns the number of the surface that a triangle belongs to. Faces of
/// one surface that are neighbours, or coincide and face in one direction, are no fold.
pub(in crate::world) fn folds(mesh: &Mesh, surface: impl Fn(usize) -> u32 + Sync) -> Aabb {
    let order = along_a_curve(mesh);
    let leaf = |ids: &[u32]| {
        let one = |&id: &u32| TriangleCluster::of(mesh, id as usize, surface(id as usize));
        ids.iter().map(one).reduce(|all, one| all.and(&one))
    };
    let mut levels: Vec<Vec<TriangleCluster>> = vec![order.par_chunks(LEAF).filter_map(leaf).collect()];
    while let Some(last) = levels.last()
        && last.len() > 1
    {
        levels.push(last.par_chunks(2).map(|pair| pair[1..].iter().fold(pair[0], TriangleCluster::and)).collect());
    }
    let Some(&[whole]) = levels.last().map(Vec::as_slice) else { return Aabb::EMPTY };
    let near = largest(&whole.bounds) * NEAR;
    let mut folds = Aabb::EMPTY;
    let mut pairs_left = order.len() * MAX_PAIRS_PER_TRIANGLE + MIN_PAIRS;
    let mut pairs = vec![(levels.len() - 1, 0, 0)];
    while let Some((level, i, j)) = pairs.pop() {
        if !levels[level][i].may_coincide(&levels[level][j], near) {
            continue;
        }
        let Some(below) = level.checked_sub(1) else {
            let [a, b] = [i, j].map(|leaf| &order[leaf * LEAF..order.len().min((leaf + 1) * LEAF)]);
            let Some(left) = pairs_left.checked_sub(a.len() * b.len()) else { return with_margin(&whole.bounds) };
            pairs_left = left;
            for (at, &first) in a.iter().enumerate() {
                let others = if i == j { &b[at + 1..] } else { b };
                for &second in others {
                    folds = folds.union(fold(mesh, [first, second], near, &surface));
                }
            }
            continue;
        };
        let children = |parent: usize| 2 * parent..levels[below].len().min(2 * parent + 2);
        for first in children(i) {
            for second in children(j).filter(|&second| i != j || second >= first) {
                pairs.push((below, first, second));
            }
        }
    }
    folds
}

/// The place where two triangles may lie on one another.
fn fold(mesh: &Mesh, pair: [u32; 2], near: f32, surface: &impl Fn(usize) -> u32) -> Aabb {
    let [a, b] = pair.map(|id| TriangleCluster::of(mesh, id as usize, surface(id as usize)));
    if !a.may_coincide(&b, near) {
        return Aabb::EMPTY;
    }
    let corners = pair.map(|id| mesh.corners(id as usize).map(|p| p.as_dvec3()));
    let apart = |of: usize, normal: Vec3| {
        let from: DVec3 = corners[of][0];
        let heights = corners[1 - of].map(|p| (p - from).dot(normal.as_dvec3()));
        heights.iter().all(|&h| h > near.into()) || heights.iter().all(|&h| h < (-near).into())
    };
    if apart(0, a.normals.min) || apart(1, b.normals.min) {
        return Aabb::EMPTY;
    }
    expanded(&a.bounds, near).intersection(&expanded(&b.bounds, near))
}

/// The triangles in the order of their first corners on a Z-shaped curve through about as many cells as there are
/// triangles.
fn along_a_curve(mesh: &Mesh) -> Vec<u32> {
    let all = mesh.positions.iter().fold(Aabb::EMPTY, |all, &p| Aabb { min: all.min.min(p), max: all.max.max(p) });
    let bits = (mesh.len().max(1).ilog2() / 3).clamp(1, 8);
    let scale = ((1 << bits) as f32 * 0.999) / (all.max - all.min).max(Vec3::splat(f32::MIN_POSITIVE));
    let spread_bits = |x: f32| {
        let x = x as u32;
        let x = (x | x << 8) & 0xf00f;
        let x = (x | x << 4) & 0xc_30c3;
        (x | x << 2) & 0x24_9249
    };
    let cell = |triangle: &[u32; 3]| {
        let at = (mesh.positions[triangle[0] as usize] - all.min) * scale;
        (spread_bits(at.x) | spread_bits(at.y) << 1 | spread_bits(at.z) << 2) as usize
    };
    let mut places = vec![0u32; (1 << (3 * bits)) + 1];
    for triangle in &mesh.triangles {
        places[cell(triangle) + 1] += 1;
    }
    for cell in 1..places.len() {
        places[cell] += places[cell - 1];
    }
    let mut order = vec![0; mesh.len()];
    for (id, triangle) in (0..).zip(&mesh.triangles) {
        let place = &mut places[cell(triangle)];
        order[*place as usize] = id;
        *place += 1;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube from `min` to `max`.
    fn cube(min: Vec3, max: Vec3) -> Mesh {
        let corner = |i: usize| Vec3::new([min, max][i & 1].x, [min, max][i >> 1 & 1].y, [min, max][i >> 2].z);
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { positions: (0..8).map(corner).collect(), triangles, ..Mesh::default() }
    }

    fn both(mut a: Mesh, b: &Mesh) -> Mesh {
        let first = a.positions.len() as u32;
        a.positions.extend(&b.positions);
        a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
        a
    }

    #[test]
    fn a_cube_has_no_folds() {
        assert!(folds(&cube(Vec3::ZERO, Vec3::ONE), |_| 0).is_empty());
        assert!(folds(&Mesh::default(), |_| 0).is_empty());
    }

    #[test]
    fn cubes_that_touch_are_folded_where_they_do() {
        let pair = both(cube(Vec3::ZERO, Vec3::ONE), &cube(Vec3::new(0.25, 1.0, 0.25), Vec3::new(0.75, 2.0, 0.75)));
        let Aabb { min, max } = folds(&pair, |_| 0);
        assert!(min.abs_diff_eq(Vec3::new(0.25, 1.0, 0.25), 1e-3) && max.abs_diff_eq(Vec3::new(0.75, 1.0, 0.75), 1e-3));
        let apart = both(cube(Vec3::ZERO, Vec3::ONE), &cube(Vec3::new(0.25, 1.01, 0.25), Vec3::new(0.75, 2.0, 0.75)));
        assert!(folds(&apart, |_| 0).is_empty());
    }

    #[test]
    fn surfaces_side_by_side_are_told_apart() {
        let lid = |triangle: usize| u32::from((6..8).contains(&triangle));
        let Aabb { min, max } = folds(&cube(Vec3::ZERO, Vec3::ONE), lid);
        assert!(min.abs_diff_eq(Vec3::new(0.0, 1.0, 0.0), 1e-3) && max.abs_diff_eq(Vec3::ONE, 1e-3), "{min} {max}");
    }

    /// The boxes of slanted faces overlap although the faces lie side by side.
    #[test]
    fn slanted_faces_side_by_side_are_no_fold() {
        let slanted = |by: f32| Mesh {
            positions: [Vec3::X, Vec3::Y, Vec3::Z].map(|p| p + by).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let mut turned = slanted(0.1);
        turned.triangles[0].swap(0, 1);
        assert!(folds(&both(slanted(0.0), &turned), |_| 0).is_empty());
        turned.positions = slanted(0.0).positions;
        assert!(!folds(&both(slanted(0.0), &turned), |_| 0).is_empty());
    }

    /// The mesh has enough triangles for a hierarchy of several levels.
    #[test]
    fn each_pair_back_to_back_is_found() {
        let mut many = Mesh::default();
        for i in 0..200 {
            let at = Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32) * 2.0;
            many = both(many, &cube(at, at + 1.0));
        }
        assert!(folds(&many, |_| 0).is_empty());
        let found = folds(&both(many, &cube(Vec3::new(6.0, 1.0, 8.0), Vec3::new(6.5, 1.5, 8.5))), |_| 0);
        assert!(
            found.min.abs_diff_eq(Vec3::new(6.0, 1.0, 8.0), 1e-2)
                && found.max.abs_diff_eq(Vec3::new(6.5, 1.0, 8.5), 1e-2)
        );
    }
}
