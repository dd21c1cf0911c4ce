//! Worlds: scenes lowered to flat arrays and `u32` ids, with bounding volume hierarchies. There are two levels of
//! hierarchies, or more where prototypes are kept as groups. A world is built once, then immutable. Building is the
//! last step that can fail.

mod build;
mod build_error;
mod data;
mod media;
mod trace;

pub use build::BuildOptions;
pub use build::reuse::ReuseCounts;
pub use build_error::BuildError;
pub use canaletto_bvh::Quality;
pub(crate) use data::shells::signed_volume;
pub(crate) use media::body::Body;
pub(crate) use media::solids::Solids;
pub use trace::bundle::RayBundle;
pub(crate) use trace::contact::{Contact, touching};
pub(crate) use trace::facets::Facet;
pub use trace::geometry_probe::GeometryProbe;
pub use trace::object_surface::{ObjectSurface, TooManyPrimitives};
pub use trace::occlusion::{OccluderCache, Occlusion};
pub(crate) use trace::placed::{MeshFacet, PlacedGeometry, Primitives};
pub use trace::query::Hit;
pub(crate) use trace::shadow::{MAX_STALLED, ShadowRays};
pub use trace::textured::{Reading, TextureRead};

use crate::light::PreparedLight;
use crate::light::environment::PreparedEnvironment;
use crate::material::PreparedMaterial;
use crate::math::Rgb;
use crate::texture::PreparedTexture;
use canaletto_bvh::Aabb;
use data::geometry::Geometry;
use data::group::Group;
use data::instance::Unbounded;
use data::light_meshes::LightMeshes;
use data::motion::{MovingLight, TransformChain};
use data::object_numbers::ObjectNumbers;
use data::shells::Shells;
use glam::{DVec3, Vec3};
use media::zones::Zones;
use std::collections::HashMap;
use std::ops::Range;
use trace::emitting::VisibleLight;

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
    /// The colour that camera rays see straight on instead of the environment, if it isn't visible.
    pub(crate) backdrop: Option<Rgb>,
    /// The surroundings of the scene; they replace the background.
    pub environment: Option<PreparedEnvironment>,
    /// Iₐ of (5.33).
    pub ambient: Rgb,
    /// All lights, in world space. Lights that move are at their positions at time 0.
    pub lights: Vec<PreparedLight>,
    /// All textures, ready for lookups. The first ones are those of [`crate::scene::Scene::textures`].
    pub textures: Vec<PreparedTexture>,
    geometry: SceneGeometry,
    shading: Shading,
    sources: LightSources,
    names: Names,
    media: ClearBodies,
}

/// What rays can hit: geometries, and the instances and groups that place them.
#[derive(Debug)]
struct SceneGeometry {
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
    /// The bounds of each of the root's instances, if they are few.
    instance_bounds: Vec<Aabb>,
    /// Shapes without bounds, which are tested one by one. Their hits have the instance [`Hit::UNBOUNDED`].
    unbounded: Vec<Unbounded>,
}

/// What surfaces look like.
#[derive(Debug)]
struct Shading {
    texture_names: Vec<String>,
    /// Whether any texture or the environment needs the footprint of a sample.
    needs_differentials: bool,
    /// All materials; the last one is the default for objects without a material.
    materials: Vec<PreparedMaterial>,
}

/// Where light comes from, besides the lights themselves.
#[derive(Debug)]
struct LightSources {
    /// The indices of the materials that show lights, and these lights.
    light_materials: Range<u32>,
    visible_lights: Vec<VisibleLight>,
    /// The lights that move; `lights` has them at time 0.
    moving_lights: Vec<MovingLight>,
    /// The triangles of mesh lights, for lights that move.
    light_meshes: LightMeshes,
    /// Whether any material may emit light.
    may_emit: bool,
}

/// The names and numbers of objects.
#[derive(Debug)]
struct Names {
    /// The names and kinds of the described objects.
    objects: Vec<Object>,
    /// The numbers of all objects, copies included.
    object_numbers: ObjectNumbers,
    /// The numbers of objects within each prototype.
    prototype_numbers: Vec<ObjectNumbers>,
}

/// What may let light through.
#[derive(Debug)]
struct ClearBodies {
    /// For each of the root's instances, whether it may let light through. Empty if no material does.
    clear_instances: Vec<bool>,
    /// For each geometry, whether any material on it may let light through.
    clear_geometries: Vec<bool>,
    /// Whether any material may let light through.
    has_clear: bool,
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
        self.geometry.origin
    }

    /// The bounds of all instances and shapes that have bounds, in the scene's coordinates.
    pub fn bounds(&self) -> Aabb {
        let bounds = self.geometry.root.tree.bounds();
        if self.geometry.origin == DVec3::ZERO || bounds.is_empty() {
            return bounds;
        }
        Aabb { min: self.to_scene(bounds.min), max: self.to_scene(bounds.max) }
    }

    /// The scene's coordinates of a point of the world, rounded to `f32`.
    pub fn to_scene(&self, p: Vec3) -> Vec3 {
        if self.geometry.origin == DVec3::ZERO { p } else { (self.geometry.origin + p.as_dvec3()).as_vec3() }
    }

    /// The materials; the last one is the default.
    pub fn materials(&self) -> &[PreparedMaterial] {
        &self.shading.materials
    }

    /// The number of primitives, counted once for each instance.
    pub fn primitives(&self) -> u64 {
        self.geometry.root.primitives.saturating_add(self.geometry.unbounded.len() as u64)
    }

    /// The most groups that are nested around a primitive.
    pub(crate) fn most_groups(&self) -> usize {
        self.geometry.groups.len().min(World::MAX_NESTING)
    }

    /// Counts the parts of the world. Visits all of it.
    pub fn stats(&self) -> WorldStats {
        let mut stats = WorldStats {
            objects: self.names.objects.len() as u64,
            instances: self.geometry.root.leaves.into(),
            shapes: self.geometry.unbounded.len() as u64,
            light_points: self.lights.iter().map(|l| u64::from(l.points())).sum(),
            materials: self.shading.materials.len() as u64,
            primitives: self.primitives(),
            bytes: self
                .geometry
                .groups
                .iter()
                .chain([&self.geometry.root])
                .map(|group| group.bytes() as u64)
                .sum::<u64>()
                + self
                    .names
                    .prototype_numbers
                    .iter()
                    .chain([&self.names.object_numbers])
                    .map(|n| n.bytes() as u64)
                    .sum::<u64>(),
            ..WorldStats::default()
        };
        for geometry in &self.geometry.geometries {
            geometry.count(&mut stats);
        }
        stats
    }
}
