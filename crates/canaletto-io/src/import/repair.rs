//! Repair of the normals of a file.

use super::smooth::{Smoothing, smooth};
use canaletto::shape::Mesh;
use canaletto_parallel::prelude::*;
use glam::Vec3;

/// Normalises normals, and computes those without a direction. If the triangles use only such normals, the mesh gets
/// none.
pub(super) fn repair_normals(mesh: &mut Mesh, smoothing: Smoothing<'_>) {
    // The computation is in f64, since the squares of f32 may underflow or overflow.
    mesh.normals.par_iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
    if !mesh.normals.par_iter().any(|n| *n == Vec3::ZERO) {
        return;
    }
    let lacks = |i: &u32| mesh.normals[*i as usize] == Vec3::ZERO;
    if mesh.triangles.par_iter().all(|triangle| triangle.iter().all(lacks)) {
        mesh.normals = Vec::new();
    } else if mesh.triangles.par_iter().any(|triangle| triangle.iter().any(lacks)) {
        smooth(mesh, smoothing);
    } else {
        // No triangle uses these normals, but each must have a direction.
        mesh.normals.par_iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
    }
}
