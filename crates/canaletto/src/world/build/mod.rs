//! Building a world from a description: materials and textures are resolved, the tree of nodes is flattened,
//! hierarchies are built.

pub(in crate::world) mod displacement;
pub(in crate::world) mod flatten;
pub(in crate::world) mod geometries;
pub(in crate::world) mod instancing;
pub(in crate::world) mod origin;
pub(in crate::world) mod part;
pub(in crate::world) mod required_spaces;
pub(in crate::world) mod reuse;
pub(in crate::world) mod single_shapes;
#[cfg(test)]
mod tests;

use crate::light::environment::{Environment, PreparedEnvironment};
use crate::light::{Light, PreparedLight};
use crate::material::{Channel, Material, Phong, PreparedMaterial, Target};
use crate::scene::{Node, Scene};
use crate::texture::{ColorSpace, Image, Prefilter, PreparedTexture, Texture, TextureKind, Unresolved};
use crate::world::build::displacement::Displacements;
use crate::world::build::flatten::{Builder, Place};
use crate::world::build::instancing::{InstancingPolicy, uses_of};
use crate::world::build::origin::Spans;
use crate::world::build::part::{FinishedPart, Part};
use crate::world::build::required_spaces::RequiredSpaces;
use crate::world::build::reuse::Previous;
use crate::world::data::geometry::Geometry;
use crate::world::data::group::Group;
use crate::world::data::instance::{Instance, NONE};
use crate::world::data::light_meshes::LightMeshes;
use crate::world::media::body::shells;
use crate::world::media::zones::Zones;
use crate::world::trace::bundle::MAX_LISTED;
use crate::world::trace::visible_lights::add_visible_lights;
use crate::world::{BuildError, ClearBodies, LightSources, Names, SceneGeometry, Shading, World};
use canaletto_bvh::{Aabb, Quality, with_stack};
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

    pub(in crate::world) fn lower(
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
        let reads_vertex_colors = |texture: u32| builder.displacement.patterns[texture as usize].is_vertex_color();
        let prepared = |material| PreparedMaterial::new(material, reads_vertex_colors);
        let materials: Vec<PreparedMaterial> = materials.into_iter().map(prepared).collect();
        let clear_instances = clear_instances(&root.instances, &builder.geometries, &materials);
        let clear = clear_geometries(&root, &builder.groups, &builder.geometries, &materials);
        let clear_bounds = bounds.iter().zip(&clear_instances).filter(|(_, clear)| **clear).map(|(bounds, _)| *bounds);
        let clear_bounds = clear_bounds.fold(Aabb::EMPTY, |a, b| a.union(b));
        let has_clear = !materials.iter().all(PreparedMaterial::is_opaque);
        let may_emit = materials.iter().any(PreparedMaterial::may_emit);
        let is_hidden = environment.as_ref().is_some_and(|environment| !environment.visible);
        let mut world = World {
            background,
            backdrop: is_hidden.then_some(background),
            ambient,
            lights: sources(lights, &builder.light_meshes),
            textures: builder.displacement.patterns,
            shading: Shading {
                texture_names,
                needs_differentials: needs_differentials
                    || backdrop.as_ref().is_some_and(PreparedEnvironment::wants_footprint),
                materials,
            },
            environment: backdrop,
            sources: LightSources {
                light_materials,
                visible_lights,
                moving_lights,
                light_meshes: builder.light_meshes,
                may_emit,
            },
            names: Names { objects: builder.objects, object_numbers, prototype_numbers: builder.prototype_numbers },
            media: ClearBodies {
                clear_instances,
                has_clear,
                clear_bounds,
                shells: shells(&builder.geometries, |geometry| clear[geometry]),
                clear_geometries: clear,
                zones: Zones::UNKNOWN,
            },
            geometry: SceneGeometry {
                geometries: builder.geometries,
                owners: builder.owners,
                local_origins: builder.local_origins,
                origin,
                origins: builder.origins,
                root,
                groups: builder.groups,
                chains: builder.chains,
                instance_bounds: if bounds.len() <= MAX_LISTED { bounds } else { Vec::new() },
                unbounded,
            },
        };
        world.media.zones = world.find_zones();
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
                TextureKind::Constant(_) | TextureKind::Procedural(_) | TextureKind::VertexColor => continue,
            };
            if space.is_some() || texture.target.takes_color() || texture.channel == Channel::Alpha {
                continue;
            }
            let mut kind = described.kind.clone();
            match &mut kind {
                TextureKind::Image(image) => image.space = Some(ColorSpace::Raw),
                TextureKind::Grid(grid) => grid.space = Some(ColorSpace::Raw),
                TextureKind::Constant(_) | TextureKind::Procedural(_) | TextureKind::VertexColor => {}
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
            TextureKind::Constant(_) | TextureKind::VertexColor => false,
            TextureKind::Image(image) => image.prefilter != Prefilter::None,
            TextureKind::Grid(grid) => grid.prefilter != Prefilter::None,
            TextureKind::Procedural(_) => true,
        };
        filtered || used.target == Target::Bump
    });
    Ok((PreparedTexture::resolve(images, &textures)?, names, needs_differentials))
}

pub(in crate::world) fn out_of_range_message() -> String {
    format!("after its transforms it reaches beyond ±{:e}, the largest coordinate possible", f32::MAX)
}
