//! Normals as files give them, made fit for use.

use super::smooth::{Smoothing, smooth};
use canaletto::shape::Mesh;
use glam::Vec3;
use rayon::prelude::*;

/// Makes normals unit vectors, and computes those that have no direction. If triangles use no others, there are none.
pub(super) fn repair_normals(mesh: &mut Mesh, smoothing: Smoothing<'_>) {
    // Through f64, since the squares of f32 may vanish or overflow.
    mesh.normals.par_iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
    if !mesh.normals.par_iter().any(|n| *n == Vec3::ZERO) {
        return;
    }
    let lacks = |i: &u32| mesh.normals[*i as usize] == Vec3::ZERO;
    if mesh.triangles.par_iter().flatten().all(lacks) {
        mesh.normals = Vec::new();
    } else if mesh.triangles.par_iter().flatten().any(lacks) {
        smooth(mesh, smoothing);
    } else {
        // No triangle uses them, but each must have one.
        mesh.normals.par_iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
    }
}
