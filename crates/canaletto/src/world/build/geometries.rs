//! Conversion of the description's meshes and clouds to geometries, each once for all of its uses.

use crate::math::Transform;
use crate::scene::Node;
use crate::shape::Mesh;
use crate::world::BuildError;
use crate::world::build::flatten::{Builder, missing};
use crate::world::build::origin::{FAR, origin_of, relative_to, span};
use crate::world::build::reuse::Found;
use crate::world::build_error::hierarchy_error;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::NONE;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};

impl Builder {
    pub(in crate::world) fn mesh_geometry(
        &mut self,
        node: &Node,
        index: u32,
        [own, inherited]: [u32; 2],
        transform: &Transform,
    ) -> Result<(u32, bool), BuildError> {
        let count = self.meshes.len();
        let slot = self.meshes.get_mut(index as usize).ok_or_else(|| missing(node, "mesh", index, count))?;
        // The instance's own material displaces the mesh; without one, the inherited material does.
        let by = if own == NONE { inherited } else { own };
        let key = (index, if self.displacement.displaces(by) { by } else { NONE });
        if let Some(&geometry) = self.geometry_of_mesh.get(&key) {
            return Ok((geometry, false));
        }
        // Another use may need the mesh without displacement.
        let again = self.displacement.any() && self.mesh_uses[index as usize] > 1;
        let mut mesh = if again { slot.clone() } else { slot.take() }.unwrap_or_default();
        let transform = &relative_to(mesh.origin, transform);
        let object = self.objects.len() as u32 - 1;
        mesh.check().map_err(|problem| self.invalid(object, problem))?;
        if let Some(&bad) = mesh.materials.iter().find(|&&m| m as usize >= self.material_count) {
            return Err(missing(node, "material", bad, self.material_count));
        }
        let of_slot = |slot: u32| match mesh.materials.get(slot as usize) {
            Some(&material) if own == NONE => material,
            _ => by,
        };
        if (0..mesh.materials.len().max(1) as u32).any(|slot| self.displacement.displaces(of_slot(slot))) {
            if mesh.end_pose.is_some() {
                let problem =
                    "its vertices move while the shutter is open, and a material displaces it; it can't be both";
                return Err(self.invalid(object, problem));
            }
            let materials: Vec<u32> = (0..mesh.materials.len().max(1) as u32).map(of_slot).collect();
            let of_slot = |slot: u32| materials.get(slot as usize).copied().unwrap_or(NONE);
            mesh = self.displacement.mesh(mesh, &of_slot).map_err(|problem| self.invalid(object, problem))?;
        }
        let mut required_spaces = self.required_spaces(by);
        if own == NONE {
            required_spaces = mesh.materials.iter().fold(required_spaces, |all, m| all.and(self.required_spaces(*m)));
        }
        let may_move = required_spaces.allow_mesh() && mesh.end_pose.is_none();
        let moved = self.mesh_uses[index as usize] == 1 && (may_move || transform.is_identity());
        if moved && !transform.is_identity() {
            move_mesh(&mut mesh, transform);
            mesh.check().map_err(|problem| self.invalid(object, format!("after its transforms, {problem}")))?;
            mesh.origin = DVec3::ZERO;
        }
        if !moved && !transform.is_identity() {
            let origin = near(&mut mesh.positions);
            if let Some(pose) = &mut mesh.end_pose {
                relative(&mut pose.positions, origin);
            }
            mesh.origin += origin;
        }
        let origin = mesh.origin;
        let geometry = self.push_mesh(mesh, object)?;
        self.set_origin(geometry, origin);
        self.geometry_of_mesh.insert(key, geometry);
        Ok((geometry, moved))
    }

    pub(in crate::world) fn spheres_geometry(
        &mut self,
        node: &Node,
        index: u32,
        transform: &Transform,
    ) -> Result<u32, BuildError> {
        let count = self.spheres.len();
        if let Some(&geometry) = self.geometry_of_spheres.get(&index) {
            return Ok(geometry);
        }
        let slot =
            self.spheres.get_mut(index as usize).ok_or_else(|| missing(node, "cloud of spheres", index, count))?;
        let mut cloud = slot.take().unwrap_or_default();
        let object = self.objects.len() as u32 - 1;
        cloud.check().map_err(|problem| self.invalid(object, problem))?;
        if !transform.is_identity() {
            cloud.origin += near(&mut cloud.centers);
        }
        let origin = cloud.origin;
        let before = self.before_of(object);
        let geometry = self.push_found(Geometry::spheres_after(before, cloud), object)?;
        self.set_origin(geometry, origin);
        self.geometry_of_spheres.insert(index, geometry);
        Ok(geometry)
    }

    pub(in crate::world) fn cylinders_geometry(
        &mut self,
        node: &Node,
        index: u32,
        transform: &Transform,
    ) -> Result<u32, BuildError> {
        let count = self.cylinders.len();
        if let Some(&geometry) = self.geometry_of_cylinders.get(&index) {
            return Ok(geometry);
        }
        let slot =
            self.cylinders.get_mut(index as usize).ok_or_else(|| missing(node, "cloud of cylinders", index, count))?;
        let mut cloud = slot.take().unwrap_or_default();
        let object = self.objects.len() as u32 - 1;
        cloud.check().map_err(|problem| self.invalid(object, problem))?;
        if !transform.is_identity() {
            cloud.origin += near(cloud.axes.as_flattened_mut());
        }
        let origin = cloud.origin;
        let before = self.before_of(object);
        let geometry = self.push_found(Geometry::cylinders_after(before, cloud), object)?;
        self.set_origin(geometry, origin);
        self.geometry_of_cylinders.insert(index, geometry);
        Ok(geometry)
    }

    /// Stores the origin of a geometry's coordinates in its object's space.
    pub(in crate::world) fn set_origin(&mut self, geometry: u32, origin: DVec3) {
        if origin != DVec3::ZERO {
            self.local_origins.insert(geometry, origin);
        }
    }

    /// The transform from a geometry's coordinates to the world's for an object with this transform, unless it is the
    /// identity.
    pub(in crate::world) fn place_of(&self, geometry: u32, transform: &Transform) -> Option<Transform> {
        let place = match self.local_origins.get(&geometry) {
            Some(origin) => relative_to(*origin, transform),
            None => *transform,
        };
        (!place.is_identity()).then_some(place)
    }

    pub(in crate::world) fn push_mesh(&mut self, mesh: Mesh, object: u32) -> Result<u32, BuildError> {
        let before = self.before_of(object);
        self.push_found(Geometry::mesh_after(before, mesh, self.quality, self.before.slack), object)
    }

    fn push_found(&mut self, found: Found, object: u32) -> Result<u32, BuildError> {
        let found = found.map(|(geometry, origin)| {
            self.origins.count(origin);
            geometry
        });
        self.push(found, object)
    }

    /// The object's geometry in the previous world.
    fn before_of(&mut self, object: u32) -> Option<Geometry> {
        self.before.take(&self.objects[object as usize].name)
    }

    pub(in crate::world) fn push(
        &mut self,
        geometry: Result<Geometry, canaletto_bvh::BuildError>,
        object: u32,
    ) -> Result<u32, BuildError> {
        let geometry = geometry.map_err(|e| hierarchy_error(&self.objects[object as usize].name, &e))?;
        self.geometries.push(geometry);
        self.owners.push(object);
        Ok(self.geometries.len() as u32 - 1)
    }
}

/// Makes points that lie far from zero relative to their middle, without error. Returns that origin.
fn near(points: &mut [Vec3]) -> DVec3 {
    let origin = origin_of(span(points), FAR);
    relative(points, origin);
    origin
}

/// Makes points relative to an origin.
fn relative(points: &mut [Vec3], origin: DVec3) {
    if origin != DVec3::ZERO {
        points.par_iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
    }
}

/// Transforms a mesh's vertices. A mirroring transform swaps corners, so that they stay counter-clockwise seen from
/// outside.
fn move_mesh(mesh: &mut Mesh, transform: &Transform) {
    mesh.positions.par_iter_mut().for_each(|p| *p = transform.point(p.as_dvec3()).as_vec3());
    mesh.normals.par_iter_mut().for_each(|n| *n = transform.normal(n.as_dvec3()).normalize_or_zero().as_vec3());
    let is_mirroring = transform.matrix().matrix3.determinant() < 0.0;
    let side = if is_mirroring { -1.0 } else { 1.0 };
    mesh.tangents.par_iter_mut().for_each(|t| {
        let along = transform.vector(t.truncate().as_dvec3()).normalize_or_zero().as_vec3();
        *t = along.extend(t.w * side);
    });
    if is_mirroring {
        mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
}
