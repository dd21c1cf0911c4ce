//! From frame to frame: what the world before leaves to the next, so that hierarchies over what stayed needn't be built again.
//!
//! An object is found again by its name, or kind and number; if it isn't the same one, that costs a comparison and changes
//! nothing, since lists are compared bit by bit and every tree gives the same hits.

use super::geometry::Geometry;
use super::instance::NONE;
use super::{BuildError, World};
use crate::shape::{CylinderCloud, Mesh, SphereCloud};
use canaletto_bvh::{self as bvh, Quality, TriangleBvh};
use std::collections::HashMap;

/// Geometries of the world before, by the objects that they belonged to.
#[derive(Debug, Default)]
pub(super) struct Previous {
    /// By the object's name, and which one of that name it is.
    geometries: HashMap<(String, u32), Geometry>,
    /// How many of each name were asked for.
    asked: HashMap<String, u32>,
    /// How much more than when they were built trees may cost that are refitted.
    pub(super) slack: RefitBudget,
}

/// Where hierarchies over meshes and clouds come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ReuseCounts {
    /// Those of the world before, which fit as they are.
    pub kept: u64,
    /// Those of the world before, made to fit.
    pub refitted: u64,
    /// Those that were built for this world.
    pub built: u64,
}

/// Where one comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Origin {
    Kept,
    Refitted,
    Built,
}

impl ReuseCounts {
    pub(super) fn count(&mut self, origin: Origin) {
        *match origin {
            Origin::Kept => &mut self.kept,
            Origin::Refitted => &mut self.refitted,
            Origin::Built => &mut self.built,
        } += 1;
    }
}

/// A geometry and where its hierarchy comes from.
pub(super) type Found = Result<(Geometry, Origin), bvh::BuildError>;

/// How far refitting may go.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RefitBudget {
    rays: u64,
}

impl RefitBudget {
    /// The most that rays may cost in any refitted tree, against one that was just built.
    const MOST: f64 = 1.5;
    /// Where no more than this is allowed, a tree is built at once.
    const LEAST: f64 = 1.05;

    pub(super) fn new(rays: u64) -> RefitBudget {
        RefitBudget { rays }
    }

    /// A build takes the time of some two rays for each triangle; half of that at most may be lost on the way of the rays.
    pub(super) fn most(self, triangles: usize) -> Option<f64> {
        let most = 1.0 + triangles as f64 / self.rays.max(1) as f64;
        (most > RefitBudget::LEAST).then_some(most.min(RefitBudget::MOST))
    }
}

impl Previous {
    /// Takes a world apart; what isn't needed is freed here.
    pub(super) fn new(world: World, rays: u64) -> Previous {
        let World { geometries, owners, objects, .. } = world;
        let mut before = Previous { slack: RefitBudget::new(rays), ..Previous::default() };
        let mut counts = HashMap::new();
        for (geometry, owner) in geometries.into_iter().zip(owners) {
            // Loose shapes are read anew, which takes longer than a tree over them.
            if owner == NONE || matches!(geometry, Geometry::Shapes { .. }) {
                continue;
            }
            let name = &objects[owner as usize].name;
            let key = numbered(&mut counts, name);
            before.geometries.insert(key, geometry);
        }
        before
    }

    /// What the next object of this name was, if there was one.
    pub(super) fn take(&mut self, name: &str) -> Option<Geometry> {
        if self.geometries.is_empty() {
            return None;
        }
        let key = numbered(&mut self.asked, name);
        self.geometries.remove(&key)
    }
}

/// The name with a number that tells it from others like it.
fn numbered(counts: &mut HashMap<String, u32>, name: &str) -> (String, u32) {
    let count = counts.entry(name.to_owned()).or_default();
    *count += 1;
    (name.to_owned(), *count)
}

fn same<T: bytemuck::NoUninit>(a: &[T], b: &[T]) -> bool {
    bytemuck::cast_slice::<T, u8>(a) == bytemuck::cast_slice::<T, u8>(b)
}

impl Geometry {
    /// [`Geometry::mesh`], from what the object was before.
    pub(super) fn mesh_after(before: Option<Geometry>, mesh: Mesh, quality: Quality, slack: RefitBudget) -> Found {
        let usable =
            |(old, tree): &(Mesh, TriangleBvh)| tree.quality() == quality && same(&old.triangles, &mesh.triangles);
        if let Some((old, mut triangles)) = mesh_of(before).filter(usable) {
            if same(&old.positions, &mesh.positions) {
                return Ok((Geometry::Mesh { triangles, mesh }, Origin::Kept));
            }
            drop(old);
            if let Some(most) = slack.most(mesh.len()) {
                let built = triangles.refit_within(most, |id| mesh.corners(id as usize))?;
                let origin = if built { Origin::Built } else { Origin::Refitted };
                return Ok((Geometry::Mesh { triangles, mesh }, origin));
            }
        }
        Ok((Geometry::mesh(mesh, quality)?, Origin::Built))
    }

    /// [`Geometry::spheres`], likewise.
    pub(super) fn spheres_after(before: Option<Geometry>, cloud: SphereCloud) -> Found {
        if let Some(Geometry::Spheres { tree, cloud: old }) = before
            && same(&old.centers, &cloud.centers)
            && same(&old.radii, &cloud.radii)
        {
            return Ok((Geometry::Spheres { tree, cloud }, Origin::Kept));
        }
        Ok((Geometry::spheres(cloud)?, Origin::Built))
    }

    /// [`Geometry::cylinders`], likewise.
    pub(super) fn cylinders_after(before: Option<Geometry>, cloud: CylinderCloud) -> Found {
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
        Some(Geometry::Mesh { triangles, mesh }) => Some((mesh, triangles)),
        _ => None,
    }
}

impl World {
    /// Where its hierarchies over meshes and clouds come from.
    pub fn origins(&self) -> ReuseCounts {
        self.origins
    }

    /// [`World::build_with`] for the next frame of an animation: hierarchies over what is as it was in the world before are kept, and
    /// those over meshes whose vertices moved are refitted, as long as that pays. The world is the same but for its trees, which no
    /// picture depends on.
    ///
    /// # Errors
    /// As [`World::build`].
    pub fn build_after(
        before: World,
        scene: crate::scene::Scene,
        options: &super::BuildOptions,
    ) -> Result<World, BuildError> {
        let before = Previous::new(before, options.rays);
        World::lower(scene, options, super::instancing::InstancingPolicy::default(), before)
    }
}
