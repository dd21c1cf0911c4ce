//! Worlds: scenes lowered to flat arrays and `u32` ids, with bounding volume hierarchies. There are two levels of
//! hierarchies, or more where prototypes are kept as groups. A world is built once, then immutable. Building is the
//! last step that can fail.

mod batch_query;
mod body;
mod build;
mod bundle;
mod bundle_tree;
mod contact;
mod displacement;
mod edges;
mod emitting;
mod facets;
mod flat_objects;
mod flatten;
#[cfg(test)]
mod flatten_tests;
mod folds;
mod geometries;
mod geometry;
mod geometry_probe;
mod group;
mod instance;
mod instancing;
#[cfg(test)]
mod instancing_tests;
mod light_meshes;
mod motion;
#[cfg(test)]
mod object_id_tests;
mod object_numbers;
mod object_surface;
mod origin;
mod packet_bounds;
mod part;
mod placed;
mod query;
mod required_spaces;
mod reuse;
#[cfg(test)]
mod reuse_tests;
mod shadow;
#[cfg(test)]
mod shadow_tests;
mod shape_list;
mod shells;
mod single_shapes;
mod solids;
mod textured;
mod visible_lights;
mod zones;

pub(crate) use body::Body;
pub use build::{BuildError, BuildOptions};
pub use bundle::RayBundle;
pub use canaletto_bvh::Quality;
pub(crate) use contact::{Contact, touching};
pub(crate) use facets::Facet;
pub use geometry_probe::GeometryProbe;
pub use object_surface::{ObjectSurface, TooManyPrimitives};
pub(crate) use placed::{MeshFacet, PlacedGeometry, Primitives};
pub use query::Hit;
pub use reuse::ReuseCounts;
pub(crate) use shadow::{MAX_STALLED, ShadowRays};
pub use shadow::{OccluderCache, Occlusion};
pub(crate) use solids::Solids;
pub use textured::{Reading, TextureRead};

use crate::light::PreparedLight;
use crate::light::environment::PreparedEnvironment;
use crate::material::PreparedMaterial;
use crate::math::Rgb;
use crate::texture::PreparedTexture;
use canaletto_bvh::Aabb;
use emitting::VisibleLight;
use geometry::Geometry;
use glam::{DVec3, Vec3};
use group::Group;
use instance::Unbounded;
use light_meshes::LightMeshes;
use motion::{MovingLight, TransformChain};
use object_numbers::ObjectNumbers;
use shells::Shells;
use std::collections::HashMap;
use std::ops::Range;
use zones::Zones;

/// A scene ready to be traced. Its coordinates are relative to [`World::origin`].
///
/// ```
/// use canaletto::Ray;
/// use canaletto::glam::Vec3;
/// use canaletto::scene::{Node, Scene};
/// use canaletto::shape::{Shape, Sphere};
/// use canaletto::world::World;
///
/// let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
/// let world = World::build(Scene { nodes: vec![Node::from(ball).named("ball")], ..Scene::default() })?;
/// let hit = world.intersect(&Ray::new(Vec3::Z * 5.0, -Vec3::Z), f32::INFINITY);
/// assert_eq!(hit.map(|hit| hit.t), Some(4.0));
/// # Ok::<(), canaletto::world::BuildError>(())
/// ```
#[derive(Debug)]
pub struct World {
    /// The colour of rays without a hit, if there is no environment.
    pub background: Rgb,
    /// The surroundings of the scene; they replace the background.
    pub environment: Option<PreparedEnvironment>,
    /// Iₐ of (5.33).
    pub ambient: Rgb,
    /// All lights, in world space. Lights that move are at their positions at time 0.
    pub lights: Vec<PreparedLight>,
    /// All textures, ready for lookups. The first ones are those of [`crate::scene::Scene::textures`].
    pub textures: Vec<PreparedTexture>,
    texture_names: Vec<String>,
    /// Whether any texture or the environment needs the footprint of a sample.
    needs_differentials: bool,
    /// All materials; the last one is the default for objects without a material.
    materials: Vec<PreparedMaterial>,
    /// The indices of the materials that show lights, and these lights.
    light_materials: Range<u32>,
    visible_lights: Vec<VisibleLight>,
    /// The names and kinds of the described objects.
    objects: Vec<Object>,
    /// The numbers of all objects, copies included.
    object_numbers: ObjectNumbers,
    /// The numbers of objects within each prototype.
    prototype_numbers: Vec<ObjectNumbers>,
    geometries: Vec<Geometry>,
    /// For each geometry of a single object, that object. [`World::build_after`] uses it.
    owners: Vec<u32>,
    /// The origins of geometries' coordinates in their objects' spaces, by geometry, where they aren't zero.
    local_origins: HashMap<u32, DVec3>,
    /// The point of the scene at the zero of the world's coordinates.
    origin: DVec3,
    origins: ReuseCounts,
    /// The group of the whole scene.
    root: Group,
    /// Prototypes that are kept once, however many instances repeat them.
    groups: Vec<Group>,
    /// The transforms of moving instances over time.
    chains: Vec<TransformChain>,
    /// The lights that move; `lights` has them at time 0.
    moving_lights: Vec<MovingLight>,
    /// The triangles of mesh lights, for lights that move.
    light_meshes: LightMeshes,
    /// The bounds of each of the root's instances, if they are few.
    instance_bounds: Vec<Aabb>,
    /// Shapes without bounds, which are tested one by one. Their hits have the instance [`Hit::UNBOUNDED`].
    unbounded: Vec<Unbounded>,
    /// For each of the root's instances, whether it may let light through. Empty if no material does.
    clear_instances: Vec<bool>,
    /// For each geometry, whether any material on it may let light through.
    clear_geometries: Vec<bool>,
    /// Whether any material may let light through.
    has_clear: bool,
    /// Whether any material may emit light.
    may_emit: bool,
    /// The bounds of all instances that may let light through.
    clear_bounds: Aabb,
    /// For each geometry that is a mesh and may be clear, its closed parts.
    shells: Vec<Option<Box<Shells>>>,
    /// The boxes in which a clear surface may touch anything.
    zones: Zones,
}

/// One object of the scene's description.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Object {
    /// The object's own name, or its kind and number, such as "sphere #3" or "group \"lamp\", sphere #3".
    pub name: String,
    /// The kind: "sphere", "mesh", …
    pub kind: &'static str,
}

/// Numbers of the parts of a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct WorldStats {
    /// Objects in the scene's description.
    pub objects: u64,
    /// PlacedGeometry copies of geometries, those in groups included.
    pub instances: u64,
    /// Single shapes, counted as often as they are stored.
    pub shapes: u64,
    /// Triangles of meshes, counted as often as they are stored.
    pub triangles: u64,
    /// Spheres of clouds, counted as often as they are stored.
    pub cloud_spheres: u64,
    /// Cylinders of clouds, counted as often as they are stored.
    pub cloud_cylinders: u64,
    /// Primitives, counted once for each instance.
    pub primitives: u64,
    /// Light points.
    pub light_points: u64,
    /// Materials.
    pub materials: u64,
    /// Bytes of geometry and hierarchies.
    pub bytes: u64,
}

impl World {
    /// The point of the scene that the coordinates of this world are relative to. Rays, hits, surfaces and lights have
    /// such coordinates. A point of the scene is the origin plus a point of the world.
    ///
    /// The origin is zero, unless the scene or its view's target lies so far from zero that `f32` would lose visible
    /// detail.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The bounds of all instances and shapes that have bounds, in the scene's coordinates.
    pub fn bounds(&self) -> Aabb {
        let bounds = self.root.tree.bounds();
        if self.origin == DVec3::ZERO || bounds.is_empty() {
            return bounds;
        }
        Aabb { min: self.to_scene(bounds.min), max: self.to_scene(bounds.max) }
    }

    /// The scene's coordinates of a point of the world, rounded to `f32`.
    pub fn to_scene(&self, p: Vec3) -> Vec3 {
        if self.origin == DVec3::ZERO { p } else { (self.origin + p.as_dvec3()).as_vec3() }
    }

    /// The materials; the last one is the default.
    pub fn materials(&self) -> &[PreparedMaterial] {
        &self.materials
    }

    /// The number of primitives, counted once for each instance.
    pub fn primitives(&self) -> u64 {
        self.root.primitives.saturating_add(self.unbounded.len() as u64)
    }

    /// The most groups that are nested around a primitive.
    pub(crate) fn most_groups(&self) -> usize {
        self.groups.len().min(World::MAX_NESTING)
    }

    /// Counts the parts of the world. Visits all of it.
    pub fn stats(&self) -> WorldStats {
        let mut stats = WorldStats {
            objects: self.objects.len() as u64,
            instances: self.root.leaves.into(),
            shapes: self.unbounded.len() as u64,
            light_points: self.lights.iter().map(|l| u64::from(l.points())).sum(),
            materials: self.materials.len() as u64,
            primitives: self.primitives(),
            bytes: self.groups.iter().chain([&self.root]).map(|group| group.bytes() as u64).sum::<u64>()
                + self.prototype_numbers.iter().chain([&self.object_numbers]).map(|n| n.bytes() as u64).sum::<u64>(),
            ..WorldStats::default()
        };
        for geometry in &self.geometries {
            geometry.count(&mut stats);
        }
        stats
    }
}
