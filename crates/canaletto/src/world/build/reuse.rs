//! Reuse of hierarchies between frames. The geometries of the previous world are kept where nothing has changed, so
//! that their hierarchies needn't be built again.
//!
//! An object is matched by its name, or by kind and number. A wrong match costs a comparison and changes nothing: lists
//! are compared bit by bit, and every tree gives equal hits.

use crate::shape::{CylinderCloud, Mesh, SphereCloud};
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::NONE;
use crate::world::data::mesh_tree::MeshTree;
use crate::world::{BuildError, Names, SceneGeometry, World};
use canaletto_bvh::{self as bvh, Quality, TriangleBvh};
use std::collections::HashMap;

/// The geometries of the previous world, by the objects that they belonged to.
#[derive(Debug, Default)]
pub(in crate::world) struct Previous {
    /// The geometries, by the object's name and its number among objects of that name.
    geometries: HashMap<(String, u32), Geometry>,
    /// The number of lookups for each name.
    asked: HashMap<String, u32>,
    /// The budget for refitting: the cost of refitted trees relative to built ones.
    pub(in crate::world) slack: RefitBudget,
}

/// The numbers of reused and built hierarchies over meshes and clouds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ReuseCounts {
    /// The number of hierarchies of the previous world that are kept unchanged.
    pub kept: u64,
    /// The number of hierarchies of the previous world that are refitted.
    pub refitted: u64,
    /// The number of hierarchies that are built for this world.
    pub built: u64,
}

/// The source of a hierarchy: kept, refitted or built.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) enum Origin {
    Kept,
    Refitted,
    Built,
}

impl ReuseCounts {
    pub(in crate::world) fn count(&mut self, origin: Origin) {
        *match origin {
            Origin::Kept => &mut self.kept,
            Origin::Refitted => &mut self.refitted,
            Origin::Built => &mut self.built,
        } += 1;
    }
}

/// A geometry and the source of its hierarchy.
pub(in crate::world) type Found = Result<(Geometry, Origin), bvh::BuildError>;

/// The limit of the cost of refitted trees.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::world) struct RefitBudget {
    rays: u64,
}

impl RefitBudget {
    /// The highest cost of rays in a refitted tree, relative to a tree just built.
    const MOST: f64 = 1.5;
    /// A tree is built at once if its limit is no higher than this.
    const LEAST: f64 = 1.05;

    pub(in crate::world) fn new(rays: u64) -> RefitBudget {
        RefitBudget { rays }
    }

    /// The highest cost of rays in a refitted tree of so many triangles, relative to a tree just built. A build takes
    /// the time of about two rays per triangle, and rays may lose at most half of that.
    pub(in crate::world) fn most(self, triangles: usize) -> Option<f64> {
        let most = 1.0 + triangles as f64 / self.rays.max(1) as f64;
        (most > RefitBudget::LEAST).then_some(most.min(RefitBudget::MOST))
    }
}

impl Previous {
    /// Takes the geometries out of a world and frees the rest.
    pub(in crate::world) fn new(world: World, rays: u64) -> Previous {
        let World { geometry: SceneGeometry { geometries, owners, .. }, names: Names { objects, .. }, .. } = world;
        let mut before = Previous { slack: RefitBudget::new(rays), ..Previous::default() };
        let mut counts = HashMap::new();
        for (geometry, owner) in geometries.into_iter().zip(owners) {
            // Single shapes are built anew. Reading them takes longer than building their tree.
            if owner == NONE || matches!(geometry, Geometry::Shapes { .. }) {
                continue;
            }
            let name = &objects[owner as usize].name;
            let key = numbered(&mut counts, name);
            before.geometries.insert(key, geometry);
        }
        before
    }

    /// The previous geometry of the next object of this name, if there is one.
    pub(in crate::world) fn take(&mut self, name: &str) -> Option<Geometry> {
        if self.geometries.is_empty() {
            return None;
        }
        let key = numbered(&mut self.asked, name);
        self.geometries.remove(&key)
    }
}

/// The name and its number among equal names.
fn numbered(counts: &mut HashMap<String, u32>, name: &str) -> (String, u32) {
    let count = counts.entry(name.to_owned()).or_default();
    *count += 1;
    (name.to_owned(), *count)
}

fn same<T: bytemuck::NoUninit>(a: &[T], b: &[T]) -> bool {
    bytemuck::cast_slice::<T, u8>(a) == bytemuck::cast_slice::<T, u8>(b)
}

impl Geometry {
    /// [`Geometry::mesh`] with the hierarchy of the object's previous geometry, if possible.
    pub(in crate::world) fn mesh_after(
        before: Option<Geometry>,
        mesh: Mesh,
        quality: Quality,
        slack: RefitBudget,
    ) -> Found {
        let usable =
            |(old, tree): &(Mesh, TriangleBvh)| tree.quality() == quality && same(&old.triangles, &mesh.triangles);
        let before = if mesh.end_pose.is_none() { mesh_of(before) } else { None };
        if let Some((old, mut triangles)) = before.filter(usable) {
            if same(&old.positions, &mesh.positions) {
                let triangles = MeshTree::Still(triangles);
                return Ok((Geometry::Mesh { triangles, mesh: Box::new(mesh) }, Origin::Kept));
            }
            drop(old);
            if let Some(most) = slack.most(mesh.len()) {
                let built = triangles.refit_within(most, |id| mesh.corners(id as usize))?;
                let origin = if built { Origin::Built } else { Origin::Refitted };
                let triangles = MeshTree::Still(triangles);
                return Ok((Geometry::Mesh { triangles, mesh: Box::new(mesh) }, origin));
            }
        }
        Ok((Geometry::mesh(mesh, quality)?, Origin::Built))
    }

    /// [`Geometry::spheres`] with the hierarchy of the object's previous geometry, if possible.
    pub(in crate::world) fn spheres_after(before: Option<Geometry>, cloud: SphereCloud) -> Found {
        if let Some(Geometry::Spheres { tree, cloud: old }) = before
            && same(&old.centers, &cloud.centers)
            && same(&old.radii, &cloud.radii)
        {
            return Ok((Geometry::Spheres { tree, cloud }, Origin::Kept));
        }
        Ok((Geometry::spheres(cloud)?, Origin::Built))
    }

    /// [`Geometry::cylinders`] with the hierarchy of the object's previous geometry, if possible.
    pub(in crate::world) fn cylinders_after(before: Option<Geometry>, cloud: CylinderCloud) -> Found {
        if let Some(Geometry::Cylinders { tree, cloud: old }) = before
            && same(&old.axes, &cloud.axes)
            && same(&old.radii, &cloud.radii)
            && old.caps == cloud.caps
        {
            return Ok((Geometry::Cylinders { tree, cloud }, Origin::Kept));
        }
        Ok((Geometry::cylinders(cloud)?, Origin::Built))
    }
}

fn mesh_of(geometry: Option<Geometry>) -> Option<(Mesh, TriangleBvh)> {
    match geometry {
        Some(Geometry::Mesh { triangles: MeshTree::Still(triangles), mesh }) => Some((*mesh, triangles)),
        _ => None,
    }
}

impl World {
    /// The numbers of the world's reused and built hierarchies over meshes and clouds.
    pub fn origins(&self) -> ReuseCounts {
        self.geometry.origins
    }

    /// [`World::build_with`] for the next frame of an animation. Hierarchies over unchanged objects are kept.
    /// Hierarchies over meshes whose vertices moved are refitted, as long as that saves time. The result differs from a
    /// world built anew only in its trees, and no picture depends on these.
    ///
    /// # Errors
    /// As [`World::build`].
    pub fn build_after(
        before: World,
        scene: crate::scene::Scene,
        options: &super::BuildOptions,
    ) -> Result<World, BuildError> {
        let before = Previous::new(before, options.rays);
        World::lower(scene, options, crate::world::build::instancing::InstancingPolicy::default(), before)
    }
}

#[cfg(test)]
mod tests;
