//! Normals as files give them, made fit for use.

use super::polygon::vector_area;
use canaletto::shape::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Makes normals unit vectors, and gives vertices whose normal has no direction the mean of their triangles'; no normals
/// at all stay none.
pub(super) fn mend_normals(mesh: &mut Mesh) {
    // Through f64, since the squares of f32 may vanish or overflow.
    mesh.normals.par_iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
    let broken = |n: &Vec3| *n == Vec3::ZERO;
    if !mesh.normals.par_iter().any(broken) {
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
