//! From description to world: the tree of nodes flattened, shapes moved into place, hierarchies built.

use super::bundle::FEW;
use super::geometry::Geometry;
use super::instance::{Instance, NONE, Unbounded};
use super::light_meshes::LightMeshes;
use super::motion::{Chain, MovingLight};
use super::relief::Relief;
use super::wants::Wants;
use super::{Object, World};
use crate::light::Light;
use crate::light::environment::{Backdrop, Environment};
use crate::material::{Channel, Material, Phong, Target};
use crate::math::{Path, Transform};
use crate::scene::{Content, Node, Scene};
use crate::shape::{CylinderCloud, Mesh, Shape, SphereCloud};
use crate::texture::{ColorSpace, Image, Pattern, Prefilter, Texture, TextureKind, Unresolved};
use canaletto_bvh::{Aabb, Bvh};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Why a scene can't be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A number is out of range.
    #[error("{object}: {problem}")]
    Invalid {
        /// What it is about: an object's, light's or material's name.
        object: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// An index points at nothing.
    #[error("{object} refers to {what} number {index}, but the scene has only {count}")]
    Missing {
        /// The node that refers.
        object: String,
        /// "material", "mesh", …
        what: &'static str,
        /// The index.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A prototype contains itself.
    #[error("{0} contains an instance of itself")]
    Cycle(String),
    /// Instances of instances multiply beyond bounds.
    #[error("the scene expands to more than {max} instances", max = World::MAX_INSTANCES)]
    TooManyInstances,
    /// Lights, each counted with its points, those of meshes with their triangles too, and as often as instances repeat it.
    #[error("the scene expands to more than {max} points of light and triangles that shine", max = World::MAX_LIGHT_POINTS)]
    TooManyLights,
    /// Instances that move, likewise.
    #[error("the scene expands to more than {max} objects that move while the shutter is open", max = World::MAX_MOVING)]
    TooManyMoving,
    /// Shapes without bounds, which every ray has to be tested with.
    #[error("the scene expands to more than {max} planes", max = World::MAX_UNBOUNDED)]
    TooManyPlanes,
    /// Groups in groups in groups.
    #[error("groups and instances are nested more than {max} deep", max = World::MAX_NESTING)]
    TooDeep,
    /// The hierarchy can't be built.
    #[error("{object}: {problem}")]
    Hierarchy {
        /// The geometry.
        object: String,
        /// What the builder says.
        problem: String,
    },
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
    /// The most instances that a scene and its prototypes may expand to, all together: a few lines in which each
    /// prototype has two of the one before would fill any memory.
    pub const MAX_INSTANCES: usize = 1 << 22;
    /// The most instances that move while the shutter is open, likewise; each needs its own way.
    pub const MAX_MOVING: usize = 1 << 20;
    /// The most points of light and triangles of lights, likewise.
    pub const MAX_LIGHT_POINTS: usize = 1 << 20;
    /// The most shapes without bounds, likewise.
    pub const MAX_UNBOUNDED: usize = 1 << 16;
    /// The most triangles that displacements may make of all objects together.
    pub const MAX_DISPLACED: usize = 1 << 21;
    /// The deepest nesting of groups and instances, from the root through all prototypes.
    pub const MAX_NESTING: usize = 256;

    /// Lowers a scene. Meshes and clouds are moved out of it, not copied.
    ///
    /// # Errors
    /// The first thing that can't be rendered. Nothing after this can fail.
    pub fn build(scene: Scene) -> Result<World, BuildError> {
        for material in &scene.materials {
            material.check().map_err(|problem| BuildError::Invalid {
                object: format!("material \"{}\"", material.name),
                problem,
            })?;
        }
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
            ..
        } = scene;
        let backdrop =
            environment.as_ref().map(|environment| backdrop(environment, &mut images, &textures)).transpose()?;
        let ambient = match (&environment, &backdrop) {
            (Some(Environment { ambient: true, .. }), Some(backdrop)) => (ambient + backdrop.mean()).saturated(),
            _ => ambient,
        };
        let (textures, texture_names, wants_spread) = resolve_textures(images, textures, &mut materials)?;
        let wants = materials.iter().map(Wants::of).collect();
        let light_meshes = LightMeshes::collect(nodes.iter().chain(&prototypes), &meshes)?;
        let relief = Relief::new(textures, &materials);
        let mut builder = Builder::new(wants, relief, meshes, spheres, cylinders, prototypes);
        builder.light_meshes = light_meshes;
        builder.count_uses(&nodes);
        let mut root = Part::default();
        builder.flatten(&nodes, &Place::default(), &mut root, 0)?;
        let Finished { mut instances, mut lights, moving_lights, unbounded } = builder.finish_part(root, NONE)?;
        lights.extend(environment.as_ref().zip(backdrop.as_ref()).and_then(|(described, ready)| ready.sun(described)));
        let unbounded_id_base = number_objects(&mut instances, &builder.geometries);
        let bounds: Vec<Aabb> = instances
            .iter()
            .map(|instance| instance.bounds(&builder.chains, builder.geometries[instance.geometry as usize].bounds()))
            .collect();
        if let Some(index) = bounds.iter().position(|b| !(b.is_empty() || b.is_finite())) {
            let object = builder.objects.get(instances[index].object as usize).map_or("an object", |o| o.name.as_str());
            return Err(BuildError::Invalid { object: object.into(), problem: too_far() });
        }
        let top = Bvh::build(&bounds).map_err(|e| hierarchy_error("the scene", &e))?;
        materials.push(Material::new("default", Phong::default()));
        Ok(World {
            background,
            wants_spread: wants_spread || backdrop.as_ref().is_some_and(Backdrop::wants_footprint),
            environment: backdrop,
            ambient,
            lights: lights.into_iter().map(|light| builder.light_meshes.source(light)).collect(),
            light_meshes: builder.light_meshes,
            textures: builder.relief.patterns,
            texture_names,
            clear_instances: clear_instances(&instances, &builder.geometries, &materials),
            materials,
            objects: builder.objects,
            geometries: builder.geometries,
            instances,
            chains: builder.chains,
            moving_lights,
            top,
            instance_bounds: if bounds.len() <= FEW { bounds } else { Vec::new() },
            unbounded,
            unbounded_id_base,
        })
    }
}

/// Which instances may let light through; none if no material does. The last material is the default.
fn clear_instances(instances: &[Instance], geometries: &[Geometry], materials: &[Material]) -> Vec<bool> {
    if materials.iter().all(Material::is_opaque) {
        return Vec::new();
    }
    let own: Vec<Vec<u32>> = geometries.iter().map(Geometry::own_materials).collect();
    let clear = |instance: &Instance| {
        own[instance.geometry as usize].iter().any(|&own| {
            let index = instance.effective_material(own).unwrap_or(materials.len() as u32 - 1);
            !materials[index as usize].is_opaque()
        })
    };
    instances.iter().map(clear).collect()
}

/// The environment, ready to be looked at; its images are taken unless a texture has them too.
fn backdrop(environment: &Environment, images: &mut [Image], textures: &[Texture]) -> Result<Backdrop, BuildError> {
    let kept = |index| textures.iter().any(|t| matches!(&t.kind, TextureKind::Image(t) if t.image == index));
    Backdrop::new(environment, images, kept)
        .map_err(|problem| BuildError::Invalid { object: "the environment".into(), problem })
}

/// The patterns of textures, their names, and whether any of those in use needs footprints. Numbers that aren't colours
/// are read from images as they stand, unless the texture says what its image holds; materials are turned to the
/// patterns that do.
fn resolve_textures(
    images: Vec<Image>,
    mut textures: Vec<Texture>,
    materials: &mut [Material],
) -> Result<(Vec<Pattern>, Vec<String>, bool), BuildError> {
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
    let wants_spread = materials.iter().flat_map(|m| &m.textures).any(|used| {
        let filtered = match &textures[used.texture as usize].kind {
            TextureKind::Constant(_) => false,
            TextureKind::Image(image) => image.prefilter != Prefilter::None,
            TextureKind::Grid(grid) => grid.prefilter != Prefilter::None,
            TextureKind::Procedural(_) => true,
        };
        filtered || used.target == Target::Bump
    });
    Ok((Pattern::resolve(images, &textures)?, names, wants_spread))
}

/// Gives each instance the number that, added to an object's, makes a number of its own for every placed copy, from 1
/// on. Returns the first number that is left.
fn number_objects(instances: &mut [Instance], geometries: &[Geometry]) -> u32 {
    let mut next = 1u32;
    for instance in instances {
        let (first, last) =
            geometries[instance.geometry as usize].objects().unwrap_or((instance.object, instance.object));
        instance.id_base = next.wrapping_sub(first);
        next = next.wrapping_add(last - first + 1);
    }
    next
}

fn too_far() -> String {
    format!("after its transforms it reaches beyond ±{:e}, the largest coordinate possible", f32::MAX)
}

fn hierarchy_error(object: &str, error: &canaletto_bvh::BuildError) -> BuildError {
    BuildError::Hierarchy { object: object.into(), problem: error.to_string() }
}

/// Where a node stands while the tree is walked.
#[derive(Clone, Copy)]
struct Place {
    transform: Transform,
    inherited: u32,
}

impl Default for Place {
    fn default() -> Place {
        Place { transform: Transform::IDENTITY, inherited: NONE }
    }
}

/// How an instance stands.
struct Placed {
    transform: Transform,
    own: u32,
    inherited: u32,
}

/// What one walk collects: the root's, or a prototype's in its own space.
#[derive(Clone, Default)]
struct Part {
    shapes: Vec<Shape>,
    shape_objects: Vec<u32>,
    shape_materials: Vec<u32>,
    instances: Vec<Instance>,
    lights: Vec<Light>,
    moving_lights: Vec<MovingLight>,
    unbounded: Vec<Unbounded>,
}

/// A part whose loose shapes have become one more instance.
struct Finished {
    instances: Vec<Instance>,
    lights: Vec<Light>,
    moving_lights: Vec<MovingLight>,
    unbounded: Vec<Unbounded>,
}

#[derive(Default)]
struct Builder {
    material_count: usize,
    /// What each material's textures want to know of objects, and what all of them want together.
    wants: Vec<Wants>,
    all_wants: Wants,
    relief: Relief,
    meshes: Vec<Option<Mesh>>,
    spheres: Vec<Option<SphereCloud>>,
    cylinders: Vec<Option<CylinderCloud>>,
    prototypes: Vec<Node>,
    /// The triangles that shine.
    light_meshes: LightMeshes,
    /// How often the description refers to each mesh; one that is met once is moved into place.
    mesh_uses: Vec<u32>,
    geometries: Vec<Geometry>,
    /// By the mesh and the material that displaces it, or [`NONE`].
    geometry_of_mesh: HashMap<(u32, u32), u32>,
    geometry_of_spheres: HashMap<u32, u32>,
    geometry_of_cylinders: HashMap<u32, u32>,
    finished: HashMap<u32, Finished>,
    open: Vec<u32>,
    objects: Vec<Object>,
    /// Where instances that move are, of all parts so far.
    chains: Vec<Chain>,
    /// Instances, points of light and shapes without bounds in all parts so far.
    placed: [usize; 3],
    kinds: HashMap<&'static str, u32>,
}

impl Builder {
    fn new(
        wants: Vec<Wants>,
        relief: Relief,
        meshes: Vec<Mesh>,
        spheres: Vec<SphereCloud>,
        cylinders: Vec<CylinderCloud>,
        prototypes: Vec<Node>,
    ) -> Builder {
        Builder {
            material_count: wants.len(),
            all_wants: wants.iter().fold(Wants::default(), |all, wants| all.and(*wants)),
            wants,
            relief,
            mesh_uses: vec![0; meshes.len()],
            meshes: meshes.into_iter().map(Some).collect(),
            spheres: spheres.into_iter().map(Some).collect(),
            cylinders: cylinders.into_iter().map(Some).collect(),
            prototypes,
            ..Builder::default()
        }
    }

    /// Counts references to meshes; those inside prototypes count as many.
    fn count_uses(&mut self, nodes: &[Node]) {
        fn walk(uses: &mut [u32], node: &Node, weight: u32, depth: usize) {
            match &node.content {
                Content::Mesh(index) => {
                    if let Some(n) = uses.get_mut(*index as usize) {
                        *n = n.saturating_add(weight);
                    }
                }
                Content::Group(children) if depth < World::MAX_NESTING => {
                    children.iter().for_each(|child| walk(uses, child, weight, depth + 1));
                }
                _ => {}
            }
        }
        nodes.iter().for_each(|node| walk(&mut self.mesh_uses, node, 1, 0));
        self.prototypes.iter().for_each(|node| walk(&mut self.mesh_uses, node, 2, 0));
    }

    fn flatten(&mut self, nodes: &[Node], place: &Place, part: &mut Part, depth: usize) -> Result<(), BuildError> {
        if depth > World::MAX_NESTING {
            return Err(BuildError::TooDeep);
        }
        nodes.iter().try_for_each(|node| self.place(node, place, part, depth))
    }

    fn place(&mut self, node: &Node, place: &Place, part: &mut Part, depth: usize) -> Result<(), BuildError> {
        if node.motion.is_empty() {
            self.place_still(node, place, part, depth)
        } else {
            self.place_moving(node, place, part, depth)
        }
    }

    /// What moves becomes a part of its own, which is then placed along its path.
    fn place_moving(&mut self, node: &Node, place: &Place, part: &mut Part, depth: usize) -> Result<(), BuildError> {
        let called = || node.name.as_ref().map_or_else(|| "an unnamed node".into(), |name| format!("\"{name}\""));
        let path = Path::new(&node.motion)
            .map_err(|e| BuildError::Invalid { object: called(), problem: e.to_string() })
            .map(Arc::new)?;
        let mut inner = Part::default();
        let own = Place { transform: Transform::IDENTITY, inherited: place.inherited };
        self.place_still(node, &own, &mut inner, depth)?;
        let first_object = inner.shape_objects.first().copied().unwrap_or(NONE);
        let Finished { instances, lights, moving_lights, unbounded } = self.finish_part(inner, first_object)?;
        if let Some(plane) = unbounded.first() {
            let problem = "a plane has no bounds and can't move while the shutter is open; take a large disk or box";
            return Err(self.invalid(plane.object, problem.into()));
        }
        for instance in instances {
            let chain = match instance.motion {
                NONE => Chain::still(instance.to_world.unwrap_or_default()),
                motion => self.chains[motion as usize].clone(),
            };
            let moving = self.moving(&instance, chain.along(&path).inside(&place.transform))?;
            part.instances.push(moving);
        }
        let base = part.lights.len() as u32;
        let mut chains: Vec<(Light, Chain)> =
            lights.into_iter().map(|light| (light, Chain::still(Transform::IDENTITY))).collect();
        for MovingLight { index, light, chain } in moving_lights {
            chains[index as usize] = (light, chain);
        }
        for (index, (light, chain)) in chains.into_iter().enumerate() {
            let chain = chain.along(&path).inside(&place.transform);
            part.lights.push(light.transformed(&chain.at(0.0)));
            check_light(&part.lights[base as usize + index], "after its transforms, ")?;
            part.moving_lights.push(MovingLight { index: base + index as u32, light, chain });
        }
        Ok(())
    }

    /// The instance with its place changing like this.
    fn moving(&mut self, instance: &Instance, chain: Chain) -> Result<Instance, BuildError> {
        if self.chains.len() >= World::MAX_MOVING {
            return Err(BuildError::TooManyMoving);
        }
        let to_world = Some(chain.at(0.0));
        self.chains.push(chain);
        Ok(Instance { to_world, motion: self.chains.len() as u32 - 1, ..*instance })
    }

    fn place_still(&mut self, node: &Node, place: &Place, part: &mut Part, depth: usize) -> Result<(), BuildError> {
        let transform = place.transform.after(&node.transform);
        if !(transform.matrix().is_finite() && transform.inverse().matrix().is_finite()) {
            let object = node.name.as_ref().map_or_else(|| "an unnamed node".into(), |name| format!("\"{name}\""));
            let problem = "its transforms and those around it together scale or move beyond all numbers".into();
            return Err(BuildError::Invalid { object, problem });
        }
        let own = match node.material {
            Some(index) if index as usize >= self.material_count => {
                return Err(missing(node, "material", index, self.material_count));
            }
            Some(index) => index,
            None => NONE,
        };
        let inherited = if own == NONE { place.inherited } else { own };
        match &node.content {
            Content::Shape(shape) => {
                let object = self.object(node, shape.kind());
                shape.check().map_err(|problem| self.invalid(object, problem))?;
                self.place_shape(shape, object, inherited, &transform, part)
            }
            Content::Light(light) => {
                let light = Light { name: node.name.clone().or(light.name.clone()), ..light.clone() };
                check_light(&light, "")?;
                self.light(part, light.transformed(&transform))
            }
            Content::Mesh(index) => {
                let object = self.object(node, "mesh");
                let (geometry, moved) = self.mesh_geometry(node, *index, [own, inherited], &transform)?;
                let to_world = (!moved && !transform.is_identity()).then_some(transform);
                self.instance(
                    part,
                    Instance { geometry, object, id_base: 0, material: own, inherited, to_world, motion: NONE },
                )
            }
            Content::Spheres(index) => {
                let object = self.object(node, "spheres");
                self.refuse_relief(inherited, object)?;
                let geometry = self.spheres_geometry(node, *index)?;
                let to_world = (!transform.is_identity()).then_some(transform);
                self.instance(
                    part,
                    Instance { geometry, object, id_base: 0, material: own, inherited, to_world, motion: NONE },
                )
            }
            Content::Cylinders(index) => {
                let object = self.object(node, "cylinders");
                self.refuse_relief(inherited, object)?;
                let geometry = self.cylinders_geometry(node, *index)?;
                let to_world = (!transform.is_identity()).then_some(transform);
                self.instance(
                    part,
                    Instance { geometry, object, id_base: 0, material: own, inherited, to_world, motion: NONE },
                )
            }
            Content::Group(children) => self.flatten(children, &Place { transform, inherited }, part, depth + 1),
            Content::Instance(index) => {
                self.place_prototype(node, *index, &Placed { transform, own, inherited }, part, depth)
            }
        }
    }

    /// A shape goes into the part's own geometry where the transform keeps its kind; else it becomes an instance.
    fn place_shape(
        &mut self,
        shape: &Shape,
        object: u32,
        material: u32,
        transform: &Transform,
        part: &mut Part,
    ) -> Result<(), BuildError> {
        if self.relief.raises(material) {
            let mesh = self.relief.shape(shape, material).map_err(|problem| self.invalid(object, problem))?;
            return self.displaced(mesh, object, [NONE, material], transform, part);
        }
        let moved = if transform.is_identity() { Some(*shape) } else { shape.transformed(transform) };
        let stays = self.wants(material).allow(shape, transform);
        match moved {
            Some(moved) if moved.bounds().is_none() => {
                let own = (!stays).then_some((*shape, *transform));
                self.unbounded(part, Unbounded { shape: moved, object, material, own })?;
            }
            Some(moved) if stays => {
                moved.check().map_err(|problem| self.invalid(object, format!("after its transforms, {problem}")))?;
                part.shapes.push(moved);
                part.shape_objects.push(object);
                part.shape_materials.push(material);
            }
            None if shape.bounds().is_none() => return Err(self.invalid(object, too_far())),
            // Its kind or what its textures hold on to would be lost.
            _ => {
                let geometry = self.push(Geometry::shapes(vec![*shape], vec![object], vec![material]), object)?;
                let to_world = Some(*transform);
                self.instance(
                    part,
                    Instance { geometry, object, id_base: 0, material: NONE, inherited: NONE, to_world, motion: NONE },
                )?;
            }
        }
        Ok(())
    }

    /// Clouds are too many to become triangles.
    fn refuse_relief(&self, material: u32, object: u32) -> Result<(), BuildError> {
        if self.relief.raises(material) {
            let problem = "a cloud can't be displaced; single spheres and cylinders can be";
            return Err(self.invalid(object, problem.into()));
        }
        Ok(())
    }

    /// A mesh that stands for a displaced object.
    fn displaced(
        &mut self,
        mesh: Mesh,
        object: u32,
        [own, inherited]: [u32; 2],
        transform: &Transform,
        part: &mut Part,
    ) -> Result<(), BuildError> {
        let geometry = self.push(Geometry::mesh(mesh), object)?;
        let to_world = (!transform.is_identity()).then_some(*transform);
        self.instance(part, Instance { geometry, object, id_base: 0, material: own, inherited, to_world, motion: NONE })
    }

    fn place_prototype(
        &mut self,
        node: &Node,
        index: u32,
        placed: &Placed,
        part: &mut Part,
        depth: usize,
    ) -> Result<(), BuildError> {
        let Placed { transform, own, inherited } = *placed;
        if index as usize >= self.prototypes.len() {
            return Err(missing(node, "prototype", index, self.prototypes.len()));
        }
        if !self.finished.contains_key(&index) {
            if self.open.contains(&index) {
                let name = self.prototypes[index as usize].name.clone();
                return Err(BuildError::Cycle(
                    name.map_or_else(|| format!("prototype {index}"), |n| format!("\"{n}\"")),
                ));
            }
            self.open.push(index);
            let prototype = self.prototypes[index as usize].clone();
            let mut inner = Part::default();
            self.flatten(std::slice::from_ref(&prototype), &Place::default(), &mut inner, depth + 1)?;
            let first_object = inner.shape_objects.first().copied().unwrap_or(NONE);
            let finished = self.finish_part(inner, first_object)?;
            self.finished.insert(index, finished);
            self.open.pop();
        }
        let Some(finished) = self.finished.remove(&index) else { return Ok(()) };
        let Finished { instances, lights, moving_lights, unbounded } = &finished;
        self.count(0, instances.len())?;
        let or = |a: u32, b: u32| if a == NONE { b } else { a };
        for inner in instances {
            let to_world = match &inner.to_world {
                Some(t) => transform.after(t),
                None => transform,
            };
            let mut placed = Instance {
                material: or(own, inner.material),
                inherited: or(inner.inherited, inherited),
                to_world: (!to_world.is_identity()).then_some(to_world),
                ..*inner
            };
            if inner.motion != NONE {
                let chain = self.chains[inner.motion as usize].clone();
                placed = self.moving(&placed, chain.inside(&transform))?;
            }
            part.instances.push(placed);
        }
        let base = part.lights.len() as u32;
        for light in lights {
            self.light(part, light.transformed(&transform))?;
        }
        part.moving_lights.extend(moving_lights.iter().map(|MovingLight { index, light, chain }| MovingLight {
            index: base + index,
            light: light.clone(),
            chain: chain.clone().inside(&transform),
        }));
        for Unbounded { shape, object, material, own: place } in unbounded {
            let moved = shape.transformed(&transform).ok_or_else(|| self.invalid(*object, too_far()))?;
            let material = or(own, or(*material, inherited));
            let place = match place {
                Some((shape, t)) => Some((*shape, transform.after(t))),
                None => (!self.wants(material).allow(shape, &transform)).then_some((*shape, transform)),
            };
            self.unbounded(part, Unbounded { shape: moved, object: *object, material, own: place })?;
        }
        self.finished.insert(index, finished);
        Ok(())
    }

    fn light(&mut self, part: &mut Part, light: Light) -> Result<(), BuildError> {
        check_light(&light, "after its transforms, ")?;
        let points = light.points() as usize + self.light_meshes.count(&light);
        self.count(1, points)?;
        part.lights.push(light);
        Ok(())
    }

    /// What the textures of this material want to know of an object. Inside of prototypes an instance may still put
    /// another material in its place.
    fn wants(&self, material: u32) -> Wants {
        if self.open.is_empty() {
            self.wants.get(material as usize).copied().unwrap_or_default()
        } else {
            self.all_wants
        }
    }

    fn unbounded(&mut self, part: &mut Part, shape: Unbounded) -> Result<(), BuildError> {
        self.count(2, 1)?;
        part.unbounded.push(shape);
        Ok(())
    }

    /// Counts what is placed before memory is taken for it: instances, points of light, shapes without bounds.
    fn count(&mut self, what: usize, more: usize) -> Result<(), BuildError> {
        self.placed[what] = self.placed[what].saturating_add(more);
        match what {
            0 if self.placed[0] > World::MAX_INSTANCES => Err(BuildError::TooManyInstances),
            1 if self.placed[1] > World::MAX_LIGHT_POINTS => Err(BuildError::TooManyLights),
            2 if self.placed[2] > World::MAX_UNBOUNDED => Err(BuildError::TooManyPlanes),
            _ => Ok(()),
        }
    }

    /// Turns a part's loose shapes into one more instance.
    fn finish_part(&mut self, part: Part, object: u32) -> Result<Finished, BuildError> {
        let Part { shapes, shape_objects, shape_materials, mut instances, lights, moving_lights, unbounded } = part;
        if !shapes.is_empty() {
            let geometry =
                Geometry::shapes(shapes, shape_objects, shape_materials).map_err(|e| hierarchy_error("shapes", &e))?;
            self.geometries.push(geometry);
            let geometry = self.geometries.len() as u32 - 1;
            let (material, inherited) = (NONE, NONE);
            instances.push(Instance {
                geometry,
                object,
                id_base: 0,
                material,
                inherited,
                to_world: None,
                motion: NONE,
            });
        }
        Ok(Finished { instances, lights, moving_lights, unbounded })
    }

    fn mesh_geometry(
        &mut self,
        node: &Node,
        index: u32,
        [own, inherited]: [u32; 2],
        transform: &Transform,
    ) -> Result<(u32, bool), BuildError> {
        let count = self.meshes.len();
        let slot = self.meshes.get_mut(index as usize).ok_or_else(|| missing(node, "mesh", index, count))?;
        // A material in place of all others, or one for what has none, displaces it in its own way.
        let by = if own == NONE { inherited } else { own };
        let key = (index, if self.relief.raises(by) { by } else { NONE });
        if let Some(&geometry) = self.geometry_of_mesh.get(&key) {
            return Ok((geometry, false));
        }
        // Another use may want it as it is.
        let again = self.relief.any() && self.mesh_uses[index as usize] > 1;
        let mut mesh = if again { slot.clone() } else { slot.take() }.unwrap_or_default();
        let object = self.objects.len() as u32 - 1;
        mesh.check().map_err(|problem| self.invalid(object, problem))?;
        if let Some(&bad) = mesh.materials.iter().find(|&&m| m as usize >= self.material_count) {
            return Err(missing(node, "material", bad, self.material_count));
        }
        let of_slot = |slot: u32| match mesh.materials.get(slot as usize) {
            Some(&material) if own == NONE => material,
            _ => by,
        };
        if (0..mesh.materials.len().max(1) as u32).any(|slot| self.relief.raises(of_slot(slot))) {
            let materials: Vec<u32> = (0..mesh.materials.len().max(1) as u32).map(of_slot).collect();
            let of_slot = |slot: u32| materials.get(slot as usize).copied().unwrap_or(NONE);
            mesh = self.relief.mesh(mesh, &of_slot).map_err(|problem| self.invalid(object, problem))?;
        }
        let mut wants = self.wants(by);
        if own == NONE {
            wants = mesh.materials.iter().fold(wants, |all, m| all.and(self.wants(*m)));
        }
        let moved = self.mesh_uses[index as usize] == 1 && (wants.allow_mesh() || transform.is_identity());
        if moved && !transform.is_identity() {
            move_mesh(&mut mesh, transform);
            mesh.check().map_err(|problem| self.invalid(object, format!("after its transforms, {problem}")))?;
        }
        let geometry = self.push(Geometry::mesh(mesh), object)?;
        self.geometry_of_mesh.insert(key, geometry);
        Ok((geometry, moved))
    }

    fn spheres_geometry(&mut self, node: &Node, index: u32) -> Result<u32, BuildError> {
        let count = self.spheres.len();
        if let Some(&geometry) = self.geometry_of_spheres.get(&index) {
            return Ok(geometry);
        }
        let slot =
            self.spheres.get_mut(index as usize).ok_or_else(|| missing(node, "cloud of spheres", index, count))?;
        let cloud = slot.take().unwrap_or_default();
        let object = self.objects.len() as u32 - 1;
        cloud.check().map_err(|problem| self.invalid(object, problem))?;
        let geometry = self.push(Geometry::spheres(cloud), object)?;
        self.geometry_of_spheres.insert(index, geometry);
        Ok(geometry)
    }

    fn cylinders_geometry(&mut self, node: &Node, index: u32) -> Result<u32, BuildError> {
        let count = self.cylinders.len();
        if let Some(&geometry) = self.geometry_of_cylinders.get(&index) {
            return Ok(geometry);
        }
        let slot =
            self.cylinders.get_mut(index as usize).ok_or_else(|| missing(node, "cloud of cylinders", index, count))?;
        let cloud = slot.take().unwrap_or_default();
        let object = self.objects.len() as u32 - 1;
        cloud.check().map_err(|problem| self.invalid(object, problem))?;
        let geometry = self.push(Geometry::cylinders(cloud), object)?;
        self.geometry_of_cylinders.insert(index, geometry);
        Ok(geometry)
    }

    fn push(&mut self, geometry: Result<Geometry, canaletto_bvh::BuildError>, object: u32) -> Result<u32, BuildError> {
        let geometry = geometry.map_err(|e| hierarchy_error(&self.objects[object as usize].name, &e))?;
        self.geometries.push(geometry);
        Ok(self.geometries.len() as u32 - 1)
    }

    fn instance(&mut self, part: &mut Part, instance: Instance) -> Result<(), BuildError> {
        self.count(0, 1)?;
        part.instances.push(instance);
        Ok(())
    }

    /// Enters an object into the register: by its own name, or by kind and number.
    fn object(&mut self, node: &Node, kind: &'static str) -> u32 {
        let number = self.kinds.entry(kind).or_default();
        *number += 1;
        let name = node.name.clone().unwrap_or_else(|| format!("{kind} #{number}"));
        self.objects.push(Object { name, kind });
        self.objects.len() as u32 - 1
    }

    fn invalid(&self, object: u32, problem: String) -> BuildError {
        BuildError::Invalid { object: self.objects[object as usize].name.clone(), problem }
    }
}

fn check_light(light: &Light, when: &str) -> Result<(), BuildError> {
    light.check().map_err(|problem| BuildError::Invalid {
        object: light.name.clone().map_or(format!("{} light", light.kind_name()), |n| format!("light \"{n}\"")),
        problem: format!("{when}{problem}"),
    })
}

fn missing(node: &Node, what: &'static str, index: u32, count: usize) -> BuildError {
    BuildError::Missing { object: node.name.clone().unwrap_or_else(|| "an unnamed node".into()), what, index, count }
}

/// Moves a mesh's vertices. A mirroring transform turns the corners round, so that they stay counter-clockwise seen from
/// outside.
fn move_mesh(mesh: &mut Mesh, transform: &Transform) {
    mesh.positions.par_iter_mut().for_each(|p| *p = transform.point(p.as_dvec3()).as_vec3());
    mesh.normals.par_iter_mut().for_each(|n| *n = transform.normal(n.as_dvec3()).normalize_or_zero().as_vec3());
    if transform.matrix().matrix3.determinant() < 0.0 {
        mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
}
