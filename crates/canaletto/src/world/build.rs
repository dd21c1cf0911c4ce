//! Building a world from a description: materials and textures are resolved, the tree of nodes is flattened,
//! hierarchies are built.

use super::World;
use super::body::shells;
use super::bundle::MAX_LISTED;
use super::displacement::Displacements;
use super::flatten::{Builder, Place};
use super::geometry::Geometry;
use super::group::Group;
use super::instance::{Instance, NONE};
use super::instancing::{InstancingPolicy, uses_of};
use super::light_meshes::LightMeshes;
use super::origin::Spans;
use super::part::{FinishedPart, Part};
use super::required_spaces::RequiredSpaces;
use super::reuse::Previous;
use super::visible_lights::add_visible_lights;
use super::zones::Zones;
use crate::light::environment::{Environment, PreparedEnvironment};
use crate::light::{Light, PreparedLight};
use crate::material::{Channel, Material, Phong, PreparedMaterial, Target};
use crate::scene::{Node, Scene};
use crate::texture::{ColorSpace, Image, Prefilter, PreparedTexture, Texture, TextureKind, Unresolved};
use canaletto_bvh::{Aabb, NoThreads, Quality, with_stack};
use std::collections::HashMap;

/// The stack in bytes that the deepest nesting needs, with the hierarchies built there.
const STACK: usize = 3 << 19;

/// Options for building a world. No picture of a scene near zero depends on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// The quality of hierarchies over triangles.
    pub quality: Quality,
    /// The approximate number of rays that will be traced, or 0 if unknown. It decides whether a hierarchy is refitted
    /// or rebuilt; see [`World::build_after`].
    pub rays: u64,
    /// The index in [`Scene::views`] of the view that the world is seen through. `f32` has the highest resolution near
    /// its camera; see [`World::origin`].
    pub view: usize,
}

/// The reason why a scene can't be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A number is out of range.
    #[error("{object}: {problem}")]
    Invalid {
        /// The name of the object, light or material.
        object: String,
        /// The problem and the expected value.
        problem: String,
    },
    /// An index refers to nothing.
    #[error("{object} refers to {what} number {index}, but the scene has only {count}")]
    Missing {
        /// The node with the reference.
        object: String,
        /// The kind of the reference: "material", "mesh", …
        what: &'static str,
        /// The index.
        index: u32,
        /// The number of such items in the scene.
        count: usize,
    },
    /// A prototype contains itself.
    #[error("{0} contains an instance of itself")]
    Cycle(String),
    /// There are more instances that are kept one by one than [`World::MAX_INSTANCES`].
    #[error("the scene expands to more than {max} instances", max = World::MAX_INSTANCES)]
    TooManyInstances,
    /// There are more nested copies than [`World::MAX_COPIES`].
    #[error("{0} expands to more than {max} copies", max = World::MAX_COPIES)]
    TooManyCopies(String),
    /// There are more light points and shining triangles than [`World::MAX_LIGHT_POINTS`], counted once for each copy
    /// of a light.
    #[error("the scene expands to more than {max} points of light and triangles that shine", max = World::MAX_LIGHT_POINTS)]
    TooManyLights,
    /// There are more moving instances than [`World::MAX_MOVING`].
    #[error("the scene expands to more than {max} objects that move while the shutter is open", max = World::MAX_MOVING)]
    TooManyMoving,
    /// There are more shapes without bounds than [`World::MAX_UNBOUNDED`]. Every ray is tested with each of them.
    #[error("the scene expands to more than {max} planes", max = World::MAX_UNBOUNDED)]
    TooManyPlanes,
    /// Groups and instances are nested deeper than [`World::MAX_NESTING`].
    #[error("groups and instances are nested more than {max} deep", max = World::MAX_NESTING)]
    TooDeep,
    /// A hierarchy can't be built.
    #[error("{object}: {problem}")]
    Hierarchy {
        /// The name of the geometry.
        object: String,
        /// The builder's error.
        problem: String,
    },
    /// Building needs threads that can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

impl From<Unresolved> for BuildError {
    fn from(unresolved: Unresolved) -> BuildError {
        match unresolved {
            Unresolved::Invalid { object, problem } => BuildError::Invalid { object, problem },
            Unresolved::Missing { object, what, index, count } => BuildError::Missing { object, what, index, count },
        }
    }
}

impl World {
    /// The most instances that are kept one by one, in a scene and its prototypes together. They are the scene's
    /// instances, each prototype's instances, and the copies of members of dissolved prototypes. A prototype is
    /// dissolved if it has few members or moves.
    pub const MAX_INSTANCES: usize = 1 << 22;
    /// The most copies that nested instances may make. Copies have numbers of 32 bits.
    pub const MAX_COPIES: u32 = u32::MAX - 1;
    /// The most instances that move while the shutter is open, each copy counted. Each has a path of its own.
    pub const MAX_MOVING: usize = 1 << 20;
    /// The most light points and triangles of lights, each copy counted.
    pub const MAX_LIGHT_POINTS: usize = 1 << 20;
    /// The most shapes without bounds, each copy counted.
    pub const MAX_UNBOUNDED: usize = 1 << 16;
    /// The most triangles that the displacements of all objects may make together.
    pub const MAX_DISPLACED: usize = 1 << 21;
    /// The deepest nesting of groups and instances, from the root through all prototypes.
    pub const MAX_NESTING: usize = Node::MAX_NESTING;

    /// Lowers a scene. Meshes and clouds are moved out of it, not copied.
    ///
    /// # Errors
    /// The first problem that prevents rendering. Nothing after this can fail.
    pub fn build(scene: Scene) -> Result<World, BuildError> {
        World::build_with(scene, &BuildOptions::default())
    }

    /// [`World::build`] with options.
    ///
    /// # Errors
    /// As [`World::build`].
    pub fn build_with(scene: Scene, options: &BuildOptions) -> Result<World, BuildError> {
        World::lower(scene, options, InstancingPolicy::default(), Previous::default())
    }

    pub(super) fn lower(
        scene: Scene,
        options: &BuildOptions,
        instancing: InstancingPolicy,
        before: Previous,
    ) -> Result<World, BuildError> {
        with_stack(STACK, || World::lower_here(scene, options, instancing, before))?
    }

    fn lower_here(
        mut scene: Scene,
        options: &BuildOptions,
        instancing: InstancingPolicy,
        before: Previous,
    ) -> Result<World, BuildError> {
        for material in &scene.materials {
            material.check().map_err(|problem| BuildError::Invalid {
                object: format!("material \"{}\"", material.name),
                problem: problem.to_string(),
            })?;
        }
        let described = scene.materials.len() as u32;
        let visible_lights = add_visible_lights(&mut scene);
        let light_materials = described..scene.materials.len() as u32;
        let Scene {
            background,
            environment,
            ambient,
            mut materials,
            textures,
            mut images,
            meshes,
            spheres,
            cylinders,
            prototypes,
            nodes,
            views,
            ..
        } = scene;
        let backdrop =
            environment.as_ref().map(|environment| backdrop(environment, &mut images, &textures)).transpose()?;
        let ambient = match (&environment, &backdrop) {
            (Some(Environment { ambient: true, .. }), Some(backdrop)) => (ambient + backdrop.mean()).saturated(),
            _ => ambient,
        };
        let (textures, texture_names, needs_differentials) = resolve_textures(images, textures, &mut materials)?;
        let required_spaces = materials.iter().map(RequiredSpaces::of).collect();
        let light_meshes = LightMeshes::collect(nodes.iter().chain(&prototypes), &meshes)?;
        let displacement = Displacements::new(textures, &materials);
        let spans = Spans::new(&meshes, &spheres, &cylinders, &prototypes);
        let origin = spans.world(&nodes, views.get(options.view));
        let uses = uses_of(&nodes, &prototypes);
        let mut builder = Builder::new(required_spaces, displacement, meshes, spheres, cylinders, prototypes);
        (builder.light_meshes, builder.spans) = (light_meshes, spans);
        (builder.instancing, builder.uses) = (instancing, uses);
        (builder.quality, builder.before) = (options.quality, before);
        builder.count_uses(&nodes);
        let mut root = Part::default();
        let place = Place::from(origin);
        pieces(nodes).try_for_each(|piece| builder.flatten(&piece, &place, &mut root, 0))?;
        let FinishedPart { instances, mut lights, moving_lights, unbounded, object_numbers, .. } =
            builder.finish_part(root)?;
        lights.extend(environment.as_ref().zip(backdrop.as_ref()).and_then(|(described, ready)| ready.sun(described)));
        let bounds: Vec<Aabb> = instances.iter().map(|instance| builder.tables().bounds(instance)).collect();
        if let Some(index) = bounds.iter().position(|b| !(b.is_empty() || b.is_finite())) {
            let object = builder.object_of(instances[index].first_object, &object_numbers);
            return Err(builder.invalid(object, out_of_range_message()));
        }
        let root = Group::new(instances, &bounds, "the scene", builder.tables())?;
        materials.push(Material::new("default", Phong::default()));
        let materials: Vec<PreparedMaterial> = materials.into_iter().map(PreparedMaterial::new).collect();
        let clear_instances = clear_instances(&root.instances, &builder.geometries, &materials);
        let clear = clear_geometries(&root, &builder.groups, &builder.geometries, &materials);
        let clear_bounds = bounds.iter().zip(&clear_instances).filter(|(_, clear)| **clear).map(|(bounds, _)| *bounds);
        let mut world = World {
            background,
            needs_differentials: needs_differentials
                || backdrop.as_ref().is_some_and(PreparedEnvironment::wants_footprint),
            environment: backdrop,
            ambient,
            lights: sources(lights, &builder.light_meshes),
            light_meshes: builder.light_meshes,
            textures: builder.displacement.patterns,
            texture_names,
            has_clear: !materials.iter().all(PreparedMaterial::is_opaque),
            may_emit: materials.iter().any(PreparedMaterial::may_emit),
            clear_bounds: clear_bounds.fold(Aabb::EMPTY, |a, b| a.union(b)),
            clear_instances,
            shells: shells(&builder.geometries, |geometry| clear[geometry]),
            clear_geometries: clear,
            materials,
            light_materials,
            visible_lights,
            objects: builder.objects,
            object_numbers,
            prototype_numbers: builder.prototype_numbers,
            geometries: builder.geometries,
            owners: builder.owners,
            local_origins: builder.local_origins,
            origin,
            origins: builder.origins,
            root,
            groups: builder.groups,
            chains: builder.chains,
            moving_lights,
            instance_bounds: if bounds.len() <= MAX_LISTED { bounds } else { Vec::new() },
            unbounded,
            zones: Zones::UNKNOWN,
        };
        world.zones = world.find_zones();
        Ok(world)
    }
}

/// A list in pieces of some tens of megabytes. Each piece may be dropped before the next is used, so that the result of
/// a long list reuses its memory.
fn pieces<T>(mut list: Vec<T>) -> impl Iterator<Item = Vec<T>> {
    const PIECE: usize = 1 << 17;
    let mut pieces = Vec::with_capacity(list.len() / PIECE + 1);
    while list.len() > PIECE {
        let last = (list.len() - 1) / PIECE * PIECE;
        pieces.push(list.split_off(last));
        list.shrink_to_fit();
    }
    pieces.push(list);
    pieces.into_iter().rev()
}

fn sources(lights: Vec<Light>, meshes: &LightMeshes) -> Vec<PreparedLight> {
    let mut sources = Vec::with_capacity(lights.len());
    pieces(lights).for_each(|piece| sources.extend(piece.into_iter().map(|light| meshes.source(light))));
    sources
}

/// For each instance, whether it may let light through. Empty if no material does. The last material is the default.
fn clear_instances(instances: &[Instance], geometries: &[Geometry], materials: &[PreparedMaterial]) -> Vec<bool> {
    if materials.iter().all(PreparedMaterial::is_opaque) {
        return Vec::new();
    }
    let own: Vec<Vec<u32>> = geometries.iter().map(Geometry::own_materials).collect();
    let clear = |instance: &Instance| {
        if instance.group != NONE {
            return true;
        }
        own[instance.geometry as usize].iter().any(|&own| {
            let index = instance.effective_material(own).unwrap_or(materials.len() as u32 - 1);
            !materials[index as usize].is_opaque()
        })
    };
    instances.iter().map(clear).collect()
}

/// For each geometry, whether any material on it may be clear.
fn clear_geometries(
    root: &Group,
    groups: &[Group],
    geometries: &[Geometry],
    materials: &[PreparedMaterial],
) -> Vec<bool> {
    let mut clear = vec![false; geometries.len()];
    if materials.iter().all(PreparedMaterial::is_opaque) {
        return clear;
    }
    let is_clear = |index: u32| materials.get(index as usize).is_some_and(|material| !material.is_opaque());
    // A material of a group applies to all its members.
    let all = || groups.iter().chain([root]).flat_map(|group| &group.instances);
    let given = all().any(|group| group.group != NONE && (is_clear(group.material) || is_clear(group.inherited)));
    for instance in all().filter(|instance| instance.group == NONE) {
        let own = geometries[instance.geometry as usize].own_materials();
        clear[instance.geometry as usize] |=
            given || own.iter().any(|&own| instance.effective_material(own).is_some_and(is_clear));
    }
    clear
}

/// The prepared environment. Its images are moved out of `images` unless a texture uses them too.
fn backdrop(
    environment: &Environment,
    images: &mut [Image],
    textures: &[Texture],
) -> Result<PreparedEnvironment, BuildError> {
    let kept = |index| textures.iter().any(|t| matches!(&t.kind, TextureKind::Image(t) if t.image == index));
    PreparedEnvironment::new(environment, images, kept)
        .map_err(|problem| BuildError::Invalid { object: "the environment".into(), problem })
}

/// The prepared textures, their names, and whether any texture in use needs footprints. Values that aren't colours are
/// read from images without conversion, unless the texture names its image's colour space. A material then refers to a
/// copy of the texture without conversion.
fn resolve_textures(
    images: Vec<Image>,
    mut textures: Vec<Texture>,
    materials: &mut [Material],
) -> Result<(Vec<PreparedTexture>, Vec<String>, bool), BuildError> {
    let count = textures.len();
    let mut raw: HashMap<u32, u32> = HashMap::new();
    for material in &mut *materials {
        for texture in &mut material.textures {
            let index = texture.texture;
            let Some(described) = textures.get(index as usize) else {
                let object = format!("material \"{}\"", material.name);
                return Err(BuildError::Missing { object, what: "texture", index, count });
            };
            let space = match &described.kind {
                TextureKind::Image(image) => image.space,
                TextureKind::Grid(grid) => grid.space,
                TextureKind::Constant(_) | TextureKind::Procedural(_) => continue,
            };
            if space.is_some() || texture.target.takes_color() || texture.channel == Channel::Alpha {
                continue;
            }
            let mut kind = described.kind.clone();
            match &mut kind {
                TextureKind::Image(image) => image.space = Some(ColorSpace::Raw),
                TextureKind::Grid(grid) => grid.space = Some(ColorSpace::Raw),
                TextureKind::Constant(_) | TextureKind::Procedural(_) => {}
            }
            texture.texture = *raw.entry(index).or_insert_with(|| {
                let name = textures[index as usize].name.clone();
                textures.push(Texture { name, kind });
                textures.len() as u32 - 1
            });
        }
    }
    let names = textures.iter().map(|texture| texture.name.clone()).collect();
    let needs_differentials = materials.iter().flat_map(|m| &m.textures).any(|used| {
        let filtered = match &textures[used.texture as usize].kind {
            TextureKind::Constant(_) => false,
            TextureKind::Image(image) => image.prefilter != Prefilter::None,
            TextureKind::Grid(grid) => grid.prefilter != Prefilter::None,
            TextureKind::Procedural(_) => true,
        };
        filtered || used.target == Target::Bump
    });
    Ok((PreparedTexture::resolve(images, &textures)?, names, needs_differentials))
}

pub(super) fn out_of_range_message() -> String {
    format!("after its transforms it reaches beyond ±{:e}, the largest coordinate possible", f32::MAX)
}

pub(super) fn hierarchy_error(object: &str, error: &canaletto_bvh::BuildError) -> BuildError {
    BuildError::Hierarchy { object: object.into(), problem: error.to_string() }
}
