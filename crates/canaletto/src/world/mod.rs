//! What rays meet: a scene lowered to flat arrays and `u32` ids, with bounding volume hierarchies on two levels, or on
//! more where prototypes stay whole. Built once, then immutable; building is the last step that can fail.

mod body;
mod build;
mod bundle;
mod contact;
mod displacement;
mod edges;
mod flatten;
mod folds;
mod geometries;
mod geometry;
mod group;
mod instance;
mod instancing;
#[cfg(test)]
mod instancing_tests;
mod light_meshes;
mod motion;
mod origin;
mod packet_bounds;
mod query;
mod required_spaces;
mod reuse;
#[cfg(test)]
mod reuse_tests;
mod shadow;
mod shape_list;
mod shells;
mod textured;
mod zones;

pub(crate) use body::Body;
pub use build::{BuildError, BuildOptions};
pub use bundle::RayBundle;
pub use canaletto_bvh::Quality;
pub(crate) use contact::{Contact, touching};
pub use query::Hit;
pub use reuse::ReuseCounts;
pub(crate) use shadow::{MAX_STALLED, ShadowRays};
pub use shadow::{OccluderCache, Occlusion};
pub use textured::{Reading, TextureRead};

use crate::light::PreparedLight;
use crate::light::environment::PreparedEnvironment;
use crate::material::Material;
use crate::math::Rgb;
use crate::texture::PreparedTexture;
use canaletto_bvh::Aabb;
use geometry::Geometry;
use glam::{DVec3, Vec3};
use group::Group;
use instance::Unbounded;
use light_meshes::LightMeshes;
use motion::{MovingLight, TransformChain};
use shells::Shells;
use std::collections::HashMap;
use zones::Zones;

/// A scene ready to be traced. Its coordinates are counted from [`World::origin`].
#[derive(Debug)]
pub struct World {
    /// The colour of rays that meet nothing, where there is no environment.
    pub background: Rgb,
    /// What surrounds the scene, instead of the background.
    pub environment: Option<PreparedEnvironment>,
    /// Iₐ of (5.33).
    pub ambient: Rgb,
    /// All lights, in world space; those that move where they are when the shutter opens.
    pub lights: Vec<PreparedLight>,
    /// All textures, ready to be looked up; the first ones are those of [`crate::scene::Scene::textures`].
    pub textures: Vec<PreparedTexture>,
    texture_names: Vec<String>,
    /// Whether any texture or the environment has to know how large a piece of it a sample sees.
    needs_differentials: bool,
    /// All materials; the last one is the default for objects that name none.
    materials: Vec<Material>,
    /// What the scene's nodes are called.
    objects: Vec<Object>,
    geometries: Vec<Geometry>,
    /// The object that each of them is the only geometry of; for the world after this.
    owners: Vec<u32>,
    /// Where the coordinates of geometries are counted from in their object's space, of those that have no zero of their own.
    local_origins: HashMap<u32, DVec3>,
    /// What lies at the zero of all coordinates.
    origin: DVec3,
    origins: ReuseCounts,
    /// All of it.
    root: Group,
    /// What many instances repeat and is kept once.
    groups: Vec<Group>,
    /// Where instances that move are at each time.
    chains: Vec<TransformChain>,
    /// The lights that move; `lights` has them where they are at time 0.
    moving_lights: Vec<MovingLight>,
    /// The triangles of meshes that shine, for lights that move.
    light_meshes: LightMeshes,
    /// The bounds of each of the root's instances, if there are few.
    instance_bounds: Vec<Aabb>,
    /// Shapes without bounds, met one by one. Their hits carry [`Hit::UNBOUNDED`] as instance.
    unbounded: Vec<Unbounded>,
    /// The number of the first of them; see [`World::object_id`].
    unbounded_id_base: u32,
    /// Which of the root's instances may let light through; empty if no material does.
    clear_instances: Vec<bool>,
    /// Whether any material may let light through.
    has_clear: bool,
    /// The bounds of all that may let light through.
    clear_bounds: Aabb,
    /// Of each geometry that is a mesh and may be clear, what is closed of it.
    shells: Vec<Option<Shells>>,
    /// Where what is clear may touch anything.
    zones: Zones,
}

/// One object of the scene's description.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Object {
    /// Its own name, or its kind and number, such as "sphere #3".
    pub name: String,
    /// "sphere", "mesh", …
    pub kind: &'static str,
}

/// What a world is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct WorldStats {
    /// Objects in the scene's description.
    pub objects: u64,
    /// Placed copies of geometries.
    pub instances: u64,
    /// Single shapes, as often as they are stored.
    pub shapes: u64,
    /// Triangles of meshes, as often as they are stored.
    pub triangles: u64,
    /// Spheres of clouds, as often as they are stored.
    pub cloud_spheres: u64,
    /// Cylinders of clouds, as often as they are stored.
    pub cloud_cylinders: u64,
    /// Primitives that rays can meet, each instance counted.
    pub primitives: u64,
    /// Points of light.
    pub light_points: u64,
    /// Materials.
    pub materials: u64,
    /// Bytes of geometry and hierarchies.
    pub bytes: u64,
}

impl World {
    /// What all coordinates of this world are counted from, those of rays, hits, surfaces and lights: zero, unless the scene or
    /// what its view looks at lies so far from zero that `f32` would lose what can be seen. Places in the scene are theirs plus the origin.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The bounds of everything that has bounds, in the scene's coordinates.
    pub fn bounds(&self) -> Aabb {
        let bounds = self.root.tree.bounds();
        if self.origin == DVec3::ZERO || bounds.is_empty() {
            return bounds;
        }
        Aabb { min: self.in_the_scene(bounds.min), max: self.in_the_scene(bounds.max) }
    }

    /// Where a point of the world is in the scene, rounded to `f32`.
    pub fn in_the_scene(&self, p: Vec3) -> Vec3 {
        if self.origin == DVec3::ZERO { p } else { (self.origin + p.as_dvec3()).as_vec3() }
    }

    /// The materials; the last one is the default.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The primitives that rays can meet, each instance counted.
    pub fn primitives(&self) -> u64 {
        self.root.primitives.saturating_add(self.unbounded.len() as u64)
    }

    /// In so many groups, at most, lies what a ray meets.
    pub(crate) fn most_groups(&self) -> usize {
        self.groups.len().min(World::MAX_NESTING)
    }

    /// Counts what the world is made of. Visits all of it.
    pub fn stats(&self) -> WorldStats {
        let mut stats = WorldStats {
            objects: self.objects.len() as u64,
            instances: self.root.leaves.into(),
            shapes: self.unbounded.len() as u64,
            light_points: self.lights.iter().map(|l| u64::from(l.points())).sum(),
            materials: self.materials.len() as u64,
            primitives: self.primitives(),
            bytes: self.groups.iter().chain([&self.root]).map(|group| group.bytes() as u64).sum(),
            ..WorldStats::default()
        };
        for geometry in &self.geometries {
            geometry.count(&mut stats);
        }
        stats
    }
}
