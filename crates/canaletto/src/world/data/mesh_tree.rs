//! The hierarchy over a mesh's triangles.

use crate::shape::Mesh;
use canaletto_bvh::{
    Aabb, BuildError, FilterFunction, PreparedRay, Primitive, PrimitiveBvh, PrimitiveHit, Quality, Ray, TriangleBvh,
    UserPrimitive,
};
use canaletto_parallel::prelude::*;

/// A tree over a mesh's triangles. All of its queries take the mesh that it was built from.
#[derive(Debug)]
pub(in crate::world) enum MeshTree {
    /// Triangles at rest. The tree holds a copy of the corners for ray tests.
    Still(TriangleBvh),
    /// Triangles that move while the shutter is open. The boxes hold all of their way.
    Moving(PrimitiveBvh),
}

/// The kernel of triangles that move, at a time in 0..=1.
fn triangle(mesh: &Mesh, time: f32) -> impl Fn(UserPrimitive, &PreparedRay, f32) -> Option<PrimitiveHit> {
    move |asked, ray, t_max| {
        let (t, u, v) = mesh.intersect_triangle(asked.id as usize, ray, t_max, time)?;
        Some(PrimitiveHit { t, id: PrimitiveHit::NONE, part: 0, uv: [u, v] })
    }
}

impl MeshTree {
    pub(in crate::world) fn build(mesh: &Mesh, quality: Quality) -> Result<MeshTree, BuildError> {
        if mesh.end_pose.is_none() {
            return TriangleBvh::build_with(quality, mesh.len(), |id| mesh.corners(id as usize)).map(MeshTree::Still);
        }
        let bounds: Vec<Aabb> = (0..mesh.len()).into_par_iter().map(|id| mesh.triangle_bounds(id)).collect();
        PrimitiveBvh::build(&bounds, |_| Primitive::User).map(MeshTree::Moving)
    }

    /// The number of triangles.
    pub(in crate::world) fn len(&self) -> usize {
        match self {
            MeshTree::Still(tree) => tree.len(),
            MeshTree::Moving(tree) => tree.len(),
        }
    }

    /// The box around all triangles over all times.
    pub(in crate::world) fn bounds(&self) -> Aabb {
        match self {
            MeshTree::Still(tree) => tree.bounds(),
            MeshTree::Moving(tree) => tree.bounds(),
        }
    }

    /// The memory that the tree takes.
    pub(in crate::world) fn bytes(&self) -> usize {
        match self {
            MeshTree::Still(tree) => tree.statistics().bytes,
            MeshTree::Moving(tree) => tree.statistics().bytes,
        }
    }

    /// [`TriangleBvh::intersect`] at a time in 0..=1.
    #[inline]
    pub(in crate::world) fn intersect(&self, mesh: &Mesh, ray: &PreparedRay, nearest: &mut PrimitiveHit, time: f32) {
        match self {
            MeshTree::Still(tree) => tree.intersect(ray, nearest, mesh.one_sided),
            MeshTree::Moving(tree) => tree.intersect(ray, nearest, &triangle(mesh, time)),
        }
    }

    /// [`TriangleBvh::intersect_coherent`], for rays at time 0.
    pub(in crate::world) fn intersect_coherent(&self, mesh: &Mesh, rays: &[Ray], nearest: &mut [PrimitiveHit]) {
        match self {
            MeshTree::Still(tree) => tree.intersect_coherent(rays, nearest, mesh.one_sided),
            MeshTree::Moving(tree) => tree.intersect_coherent(rays, nearest, &triangle(mesh, 0.0)),
        }
    }

    /// [`TriangleBvh::intersect_stream`], for rays at time 0.
    pub(in crate::world) fn intersect_stream(&self, mesh: &Mesh, rays: &[Ray], nearest: &mut [PrimitiveHit]) {
        match self {
            MeshTree::Still(tree) => tree.intersect_stream(rays, nearest, mesh.one_sided),
            MeshTree::Moving(tree) => tree.intersect_coherent(rays, nearest, &triangle(mesh, 0.0)),
        }
    }

    /// [`TriangleBvh::occluded_stream`], for rays at time 0.
    pub(in crate::world) fn occluded_stream(&self, mesh: &Mesh, rays: &[Ray], t_max: &mut [f32]) {
        match self {
            MeshTree::Still(tree) => tree.occluded_stream(rays, t_max, mesh.one_sided),
            MeshTree::Moving(tree) => tree.occluded_coherent(rays, t_max, &triangle(mesh, 0.0)),
        }
    }

    /// [`TriangleBvh::occluded_coherent`], for rays at time 0.
    pub(in crate::world) fn occluded_coherent(&self, mesh: &Mesh, rays: &[Ray], t_max: &mut [f32]) {
        match self {
            MeshTree::Still(tree) => tree.occluded_coherent(rays, t_max, mesh.one_sided),
            MeshTree::Moving(tree) => tree.occluded_coherent(rays, t_max, &triangle(mesh, 0.0)),
        }
    }

    /// [`TriangleBvh::occluded`] at a time in 0..=1.
    #[inline]
    pub(in crate::world) fn occluded(
        &self,
        mesh: &Mesh,
        ray: &PreparedRay,
        t_max: f32,
        time: f32,
        counts: &mut FilterFunction,
    ) -> Option<u32> {
        match self {
            MeshTree::Still(tree) => tree.occluded(ray, t_max, mesh.one_sided, counts),
            MeshTree::Moving(tree) => tree.occluded(ray, t_max, &triangle(mesh, time), counts),
        }
    }

    /// [`TriangleBvh::is_hit_at`] at a time in 0..=1.
    #[inline]
    pub(in crate::world) fn is_hit_at(
        &self,
        mesh: &Mesh,
        place: u32,
        ray: &PreparedRay,
        t_max: f32,
        time: f32,
    ) -> bool {
        match self {
            MeshTree::Still(tree) => tree.is_hit_at(place, ray, t_max, mesh.one_sided),
            MeshTree::Moving(tree) => tree.is_hit_at(place, ray, t_max, &triangle(mesh, time)),
        }
    }

    /// [`TriangleBvh::overlapping`], over all times.
    pub(in crate::world) fn overlapping(&self, bounds: &Aabb, f: impl FnMut(u32) -> bool) {
        match self {
            MeshTree::Still(tree) => tree.overlapping(bounds, f),
            MeshTree::Moving(tree) => tree.overlapping(bounds, f),
        }
    }

    /// [`TriangleBvh::intersect_brute_force`] at a time in 0..=1.
    pub(in crate::world) fn intersect_brute_force(
        &self,
        mesh: &Mesh,
        ray: &PreparedRay,
        nearest: &mut PrimitiveHit,
        time: f32,
    ) {
        match self {
            MeshTree::Still(tree) => tree.intersect_brute_force(ray, nearest, mesh.one_sided),
            MeshTree::Moving(tree) => tree.intersect_brute_force(ray, nearest, &triangle(mesh, time)),
        }
    }
}
