//! Boundaries of roots with common vertices: where a corner of one root lies on an edge of another, both have a vertex.
//! Triangles over such boundaries leave no pixels uncovered between them.

use crate::integrator::radiosity::SolvedRoot;
use canaletto_bvh::{Aabb, BuildError, Bvh};
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};

/// The vertices of all roots.
pub(super) struct Boundaries {
    /// The places of the vertices. Corners of equal places up to rounding are one vertex.
    pub(super) points: Vec<DVec3>,
    /// The vertices around each root, counter-clockwise when seen from its side.
    pub(super) loops: Vec<Vec<u32>>,
    /// For each root, whether all its vertices are its corners.
    pub(super) is_plain: Vec<bool>,
}

/// Points in a hierarchy, each with the distance within which others count as equal.
struct PointTree {
    tree: Bvh,
}

impl PointTree {
    fn new(points: &[(DVec3, f64)]) -> Result<PointTree, BuildError> {
        let boxes: Vec<Aabb> = points.par_iter().map(|&(p, near)| grown(&[p], near)).collect();
        Ok(PointTree { tree: Bvh::build(&boxes)? })
    }

    /// The numbers of the points whose boxes overlap `bounds`, in order.
    fn near(&self, bounds: &Aabb) -> Vec<u32> {
        let mut found = Vec::new();
        self.tree.overlapping(bounds, |leaf| {
            found.extend(leaf.slots().map(|slot| self.tree.order()[slot as usize]));
            true
        });
        found.sort_unstable();
        found
    }
}

fn grown(points: &[DVec3], near: f64) -> Aabb {
    let Aabb { min, max } = Aabb::from_points(points.iter().map(|p| p.as_vec3()));
    let near = Vec3::splat(near as f32);
    Aabb { min: min - near, max: max + near }
}

impl Boundaries {
    /// The boundaries of roots.
    ///
    /// # Errors
    /// If a hierarchy over the vertices can't be built.
    pub(super) fn new(roots: &[SolvedRoot]) -> Result<Boundaries, BuildError> {
        let corners: Vec<(DVec3, f64)> =
            roots.iter().flat_map(|root| root.corners().iter().map(|&p| (p, root.tolerance()))).collect();
        let tree = PointTree::new(&corners)?;
        let equal: Vec<Vec<u32>> = corners
            .par_iter()
            .enumerate()
            .map(|(i, &(p, near))| {
                let mut all = tree.near(&grown(&[p], near));
                all.retain(|&j| (j as usize) < i && corners[j as usize].0.distance(p) <= near);
                all
            })
            .collect();
        // Each corner is the first of the corners before it that is near and is a vertex.
        let mut vertex_of: Vec<u32> = Vec::with_capacity(corners.len());
        let mut first = Vec::new();
        let mut points: Vec<(DVec3, f64)> = Vec::new();
        for (i, equal) in equal.iter().enumerate() {
            let vertex = equal.iter().find(|&&j| first[vertex_of[j as usize] as usize] == j);
            vertex_of.push(match vertex {
                Some(&j) => vertex_of[j as usize],
                None => {
                    first.push(i as u32);
                    points.push(corners[i]);
                    points.len() as u32 - 1
                }
            });
        }
        let tree = PointTree::new(&points)?;
        let mut from = 0;
        let starts: Vec<usize> = roots
            .iter()
            .map(|root| {
                from += root.corners().len();
                from - root.corners().len()
            })
            .collect();
        let loops: Vec<Vec<u32>> = roots
            .par_iter()
            .zip(&starts)
            .map(|(root, &start)| {
                let own = &vertex_of[start..start + root.corners().len()];
                let mut around = Vec::with_capacity(own.len());
                for (i, &a) in own.iter().enumerate() {
                    let b = own[(i + 1) % own.len()];
                    if a != b {
                        around.push(a);
                        on_edge(&points, &tree, [a, b], root.tolerance(), &mut around);
                    }
                }
                around
            })
            .collect();
        let is_plain = loops.iter().zip(roots).map(|(around, root)| around.len() == root.corners().len()).collect();
        Ok(Boundaries { points: points.into_iter().map(|(p, _)| p).collect(), loops, is_plain })
    }
}

/// Adds the vertices between the ends of an edge, in order.
fn on_edge(points: &[(DVec3, f64)], tree: &PointTree, [from, to]: [u32; 2], tolerance: f64, around: &mut Vec<u32>) {
    let [a, b] = [from, to].map(|vertex| points[vertex as usize].0);
    let way = b - a;
    let length = way.length();
    let mut found: Vec<(f64, u32)> = tree
        .near(&grown(&[a, b], tolerance))
        .into_iter()
        .filter(|&vertex| vertex != from && vertex != to)
        .filter_map(|vertex| {
            let (p, near) = points[vertex as usize];
            let near = near.max(tolerance);
            let along = (p - a).dot(way) / length;
            let off = (a + way * (along / length)).distance(p);
            (off <= 2.0 * near && along > 4.0 * near && along < length - 4.0 * near).then_some((along, vertex))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut last = 0.0;
    for (along, vertex) in found {
        if along - last > 4.0 * tolerance {
            around.push(vertex);
            last = along;
        }
    }
}
