//! Flattening of the tree of nodes. Groups and most prototypes are dissolved, shapes are transformed, and the rest is
//! placed as instances.

use crate::light::Light;
use crate::math::{AnimatedTransform, Transform};
use crate::scene::{Content, Node, name_of_unnamed};
use crate::shape::{CylinderCloud, Mesh, Shape, SphereCloud};
use crate::world::build::displacement::Displacements;
use crate::world::build::instancing::InstancingPolicy;
use crate::world::build::origin::{
    Exactly, FAR, Spans, away_from, origin_of, relative_to, rounded_visibly, shape_span,
};
use crate::world::build::out_of_range_message;
use crate::world::build::part::{FinishedPart, Part, check_light};
use crate::world::build::required_spaces::RequiredSpaces;
use crate::world::build::reuse::{Previous, ReuseCounts};
use crate::world::build::single_shapes::{SharedShape, SingleShape};
use crate::world::data::geometry::Geometry;
use crate::world::data::group::Group;
use crate::world::data::instance::{Instance, NONE, Placement, Unbounded};
use crate::world::data::light_meshes::LightMeshes;
use crate::world::data::motion::{MovingLight, TransformChain};
use crate::world::data::object_numbers::ObjectNumbers;
use crate::world::{BuildError, Object, World};
use canaletto_bvh::Quality;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// The placement of a node during the walk.
#[derive(Clone, Copy)]
pub(in crate::world) struct Place {
    transform: Transform,
    inherited: u32,
    casts_shadow: bool,
    /// Whether coordinates here are relative to an origin that isn't zero.
    exact: bool,
}

impl Default for Place {
    fn default() -> Place {
        Place { transform: Transform::IDENTITY, inherited: NONE, casts_shadow: true, exact: false }
    }
}

impl Place {
    /// The place whose coordinates are relative to this origin.
    pub(in crate::world) fn from(origin: DVec3) -> Place {
        Place { transform: away_from(origin), exact: origin != DVec3::ZERO, ..Place::default() }
    }
}

#[derive(Default)]
pub(in crate::world) struct Builder {
    pub(in crate::world) material_count: usize,
    /// The spaces that each material's textures need, and their union.
    pub(in crate::world) required_spaces: Vec<RequiredSpaces>,
    pub(in crate::world) union_of_required_spaces: RequiredSpaces,
    pub(in crate::world) displacement: Displacements,
    pub(in crate::world) meshes: Vec<Option<Mesh>>,
    pub(in crate::world) spheres: Vec<Option<SphereCloud>>,
    pub(in crate::world) cylinders: Vec<Option<CylinderCloud>>,
    pub(in crate::world) prototypes: Vec<Node>,
    /// The triangles of mesh lights.
    pub(in crate::world) light_meshes: LightMeshes,
    /// The number of references to each mesh. A mesh with one reference is transformed itself.
    pub(in crate::world) mesh_uses: Vec<u32>,
    /// The quality of hierarchies over triangles.
    pub(in crate::world) quality: Quality,
    pub(in crate::world) geometries: Vec<Geometry>,
    /// For each geometry of a single object, that object; [`NONE`] for others.
    pub(in crate::world) owners: Vec<u32>,
    /// The geometries of the previous world.
    pub(in crate::world) before: Previous,
    pub(in crate::world) origins: ReuseCounts,
    /// The origins of geometries' coordinates, by geometry, where they aren't zero.
    pub(in crate::world) local_origins: HashMap<u32, DVec3>,
    pub(in crate::world) spans: Spans,
    /// Prototypes that are kept as groups.
    pub(in crate::world) groups: Vec<Group>,
    pub(in crate::world) instancing: InstancingPolicy,
    /// The number of references to each prototype.
    pub(in crate::world) uses: Vec<u32>,
    /// By the mesh and its displacing material, or [`NONE`].
    pub(in crate::world) geometry_of_mesh: HashMap<(u32, u32), u32>,
    pub(in crate::world) geometry_of_spheres: HashMap<u32, u32>,
    pub(in crate::world) geometry_of_cylinders: HashMap<u32, u32>,
    /// The last shapes with geometries of their own.
    pub(in crate::world) shared_shapes: Vec<SharedShape>,
    pub(in crate::world) finished: HashMap<u32, FinishedPart>,
    pub(in crate::world) open: Vec<u32>,
    pub(in crate::world) objects: Vec<Object>,
    /// The name of the innermost named group around the current node.
    pub(in crate::world) group_name: Option<Box<str>>,
    /// The numbers of objects within each prototype that was walked.
    pub(in crate::world) prototype_numbers: Vec<ObjectNumbers>,
    /// The transforms of moving instances over time, of all parts so far.
    pub(in crate::world) chains: Vec<TransformChain>,
    /// The numbers of instances, light points and shapes without bounds in all parts so far.
    pub(in crate::world) placed: [usize; 3],
    pub(in crate::world) kinds: HashMap<&'static str, u32>,
}

impl Builder {
    pub(in crate::world) fn new(
        required_spaces: Vec<RequiredSpaces>,
        displacement: Displacements,
        meshes: Vec<Mesh>,
        spheres: Vec<SphereCloud>,
        cylinders: Vec<CylinderCloud>,
        prototypes: Vec<Node>,
    ) -> Builder {
        Builder {
            material_count: required_spaces.len(),
            union_of_required_spaces: required_spaces
                .iter()
                .fold(RequiredSpaces::default(), |all, required_spaces| all.and(*required_spaces)),
            required_spaces,
            displacement,
            mesh_uses: vec![0; meshes.len()],
            prototype_numbers: vec![ObjectNumbers::default(); prototypes.len()],
            meshes: meshes.into_iter().map(Some).collect(),
            spheres: spheres.into_iter().map(Some).collect(),
            cylinders: cylinders.into_iter().map(Some).collect(),
            prototypes,
            ..Builder::default()
        }
    }

    /// Counts references to meshes. A reference inside a prototype counts twice, since the prototype may be repeated.
    pub(in crate::world) fn count_uses(&mut self, nodes: &[Node]) {
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

    pub(in crate::world) fn flatten(
        &mut self,
        nodes: &[Node],
        place: &Place,
        part: &mut Part,
        depth: usize,
    ) -> Result<(), BuildError> {
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

    /// Places a moving node. It becomes a part of its own, which is then placed along its path.
    fn place_moving(&mut self, node: &Node, place: &Place, part: &mut Part, depth: usize) -> Result<(), BuildError> {
        let called = || node.name.as_ref().map_or_else(|| "an unnamed node".into(), |name| format!("\"{name}\""));
        let path = AnimatedTransform::new(&node.motion)
            .map_err(|e| BuildError::Invalid { object: called(), problem: e.to_string() })
            .map(Arc::new)?;
        let mut inner = Part { object_numbers: std::mem::take(&mut part.object_numbers), ..Part::default() };
        let origin = self.spans.moving_origin(node);
        let Place { inherited, casts_shadow, .. } = *place;
        let own = Place { inherited, casts_shadow, ..Place::from(origin) };
        self.place_still(node, &own, &mut inner, depth)?;
        let FinishedPart { instances, lights, moving_lights, unbounded, object_numbers, .. } =
            self.finish_part(inner)?;
        if let Some(plane) = unbounded.first() {
            let problem = "a plane has no bounds and can't move while the shutter is open; take a large disk or box";
            return Err(self.invalid(self.object_of(plane.object, &object_numbers), problem));
        }
        part.object_numbers = object_numbers;
        for instance in self.expanded(instances)? {
            let chain = match instance.motion {
                NONE => TransformChain::still(instance.to_world.unwrap_or_default()),
                motion => self.chains[motion as usize].clone(),
            };
            let chain = if origin == DVec3::ZERO { chain } else { chain.inside(&Transform::translate(origin)) };
            let moving = self.moving(&instance, chain.along(&path).inside(&place.transform))?;
            part.instances.push(moving);
        }
        let base = part.lights.len() as u32;
        let mut chains: Vec<(Light, TransformChain)> = lights
            .into_iter()
            .map(|light| (light, TransformChain::still(relative_to(origin, &Transform::IDENTITY))))
            .collect();
        for MovingLight { index, light, chain } in moving_lights {
            let chain = if origin == DVec3::ZERO { chain } else { chain.inside(&Transform::translate(origin)) };
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

    /// The instance with a transform that changes over time.
    fn moving(&mut self, instance: &Instance, chain: TransformChain) -> Result<Instance, BuildError> {
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
        let casts_shadow = place.casts_shadow && node.casts_shadow;
        let place = &Place { transform, casts_shadow, ..*place };
        match &node.content {
            Content::Shape(shape) => {
                let object = self.object(node, shape.kind(), part);
                self.place_shape(shape, &node.rest, object, inherited, place, part)
            }
            Content::Light(light) => {
                let light = Light { name: node.name.clone().or(light.name.clone()), ..light.clone() };
                check_light(&light, "")?;
                // The objects that a light shines on aren't known here. Points that the transform brings much nearer to
                // zero indicate far coordinates.
                let mut far = false;
                light.map_points(|_, p| {
                    let moved = transform.point(p.as_dvec3()).abs().max_element();
                    far |= f64::from(p.abs().max_element()) > FAR * moved;
                    p
                });
                if place.exact || far && !node.rest.is_usual() {
                    let (exactly, transform) = Exactly::before(&node.rest, transform);
                    return self.light(part, light.map_points(|i, p| exactly.point(i, p)).transformed(&transform));
                }
                self.light(part, light.transformed(&transform))
            }
            Content::Mesh(index) => {
                self.object(node, "mesh", part);
                let (geometry, moved) = self.mesh_geometry(node, *index, [own, inherited], &transform)?;
                let to_world = if moved { None } else { self.place_of(geometry, &transform) };
                if self.geometries[geometry as usize].deforms() {
                    let instance = Instance::of(geometry, part.object_numbers.last());
                    let instance = Instance { material: own, inherited, casts_shadow, ..instance };
                    let moving = self.moving(&instance, TransformChain::still(to_world.unwrap_or_default()))?;
                    return self.instance(part, moving);
                }
                self.geometry_instance(part, geometry, [own, inherited], to_world, casts_shadow)
            }
            Content::Spheres(index) => {
                let object = self.object(node, "spheres", part);
                self.reject_displacement(inherited, object)?;
                let geometry = self.spheres_geometry(node, *index, &transform)?;
                let to_world = self.place_of(geometry, &transform);
                self.geometry_instance(part, geometry, [own, inherited], to_world, casts_shadow)
            }
            Content::Cylinders(index) => {
                let object = self.object(node, "cylinders", part);
                self.reject_displacement(inherited, object)?;
                let geometry = self.cylinders_geometry(node, *index, &transform)?;
                let to_world = self.place_of(geometry, &transform);
                self.geometry_instance(part, geometry, [own, inherited], to_world, casts_shadow)
            }
            Content::Group(children) => {
                let outer = node.name.clone().map(|name| self.group_name.replace(name));
                let flattened = self.flatten(children, &Place { inherited, ..*place }, part, depth + 1);
                if let Some(outer) = outer {
                    self.group_name = outer;
                }
                flattened
            }
            Content::Instance(index) => {
                let first_object = part.object_numbers.count();
                let placement = Placement { transform, own, inherited, first_object, casts_shadow };
                self.place_prototype(node, *index, &placement, part, depth)
            }
        }
    }

    /// Places a shape. It joins the part's own geometry if the transform keeps its kind; otherwise it becomes an
    /// instance.
    fn place_shape(
        &mut self,
        shape: &Shape,
        rest: &[Vec3; 3],
        object: u32,
        material: u32,
        place: &Place,
        part: &mut Part,
    ) -> Result<(), BuildError> {
        let (mut shape, mut transform, mut origin) = (*shape, place.transform, DVec3::ZERO);
        let stays = self.required_spaces(material).allow(&shape, &transform);
        let exact = place.exact
            || !transform.is_identity()
                && (rounded_visibly(&shape, rest)
                    || origin_of(shape_span(&shape, rest), FAR) != DVec3::ZERO
                        && (!stays
                            || self.displacement.displaces(material)
                            || shape.transformed(&transform).is_none()));
        if exact {
            let (exactly, left) = Exactly::before(rest, transform);
            (shape, transform, origin) = (shape.map_points(|i, p| exactly.point(i, p)), left, exactly.zero);
        }
        shape.check().map_err(|problem| self.invalid(object, problem))?;
        if self.displacement.displaces(material) {
            let mesh =
                self.displacement.shape(&shape, origin, material).map_err(|problem| self.invalid(object, problem))?;
            return self.displaced(mesh, object, [NONE, material], &transform, place.casts_shadow, part);
        }
        let moved = if transform.is_identity() { Some(shape) } else { shape.transformed(&transform) };
        let number = part.object_numbers.last();
        let casts_shadow = place.casts_shadow;
        let shapes = if casts_shadow { &mut part.shapes } else { &mut part.shadowless_shapes };
        match moved {
            Some(moved) if moved.bounds().is_none() => {
                let own = (!stays).then_some((shape, transform));
                self.unbounded(part, Unbounded { shape: moved, object: number, material, own, origin, casts_shadow })?;
            }
            Some(moved) if stays && shapes.has_room_for(number) => {
                moved.check().map_err(|problem| self.invalid(object, format!("after its transforms, {problem}")))?;
                shapes.push(moved, number, material);
            }
            None if shape.bounds().is_none() => return Err(self.invalid(object, out_of_range_message())),
            // The transform would lose the shape's kind or a space that its textures need, or there are more than
            // 2³² copies before the shape.
            _ => {
                let single = SingleShape { shape, material, object, number, transform, origin, casts_shadow };
                return self.place_single(single, part);
            }
        }
        Ok(())
    }

    /// Clouds have too many elements to become triangles.
    fn reject_displacement(&self, material: u32, object: u32) -> Result<(), BuildError> {
        if self.displacement.displaces(material) {
            let problem = "a cloud can't be displaced; single spheres and cylinders can be";
            return Err(self.invalid(object, problem));
        }
        Ok(())
    }

    /// Places the mesh of a displaced object.
    fn displaced(
        &mut self,
        mesh: Mesh,
        object: u32,
        [own, inherited]: [u32; 2],
        transform: &Transform,
        casts_shadow: bool,
        part: &mut Part,
    ) -> Result<(), BuildError> {
        let origin = mesh.origin;
        let geometry = self.push_mesh(mesh, object)?;
        self.set_origin(geometry, origin);
        let to_world = (!transform.is_identity()).then_some(*transform);
        self.geometry_instance(part, geometry, [own, inherited], to_world, casts_shadow)
    }

    fn place_prototype(
        &mut self,
        node: &Node,
        index: u32,
        place: &Placement,
        part: &mut Part,
        depth: usize,
    ) -> Result<(), BuildError> {
        let Placement { own, inherited, first_object, .. } = *place;
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
            // A prototype has many places. Its objects have only the names of groups within it.
            let outer_group = self.group_name.take();
            let mut inner = Part::default();
            let origin = self.spans.prototype_origin(&prototype);
            self.flatten(std::slice::from_ref(&prototype), &Place::from(origin), &mut inner, depth + 1)?;
            self.group_name = outer_group;
            let mut finished = self.finish_part(inner)?;
            self.prototype_numbers[index as usize] = std::mem::take(&mut finished.object_numbers);
            finished.instances = self.as_group(index, finished.instances)?;
            finished.origin = origin;
            self.finished.insert(index, finished);
            self.open.pop();
        }
        let Some(finished) = self.finished.remove(&index) else { return Ok(()) };
        let FinishedPart { instances, lights, moving_lights, unbounded, origin, .. } = &finished;
        let transform = relative_to(*origin, &place.transform);
        let place = &Placement { transform, ..*place };
        part.object_numbers.push_copy(index, self.prototype_numbers[index as usize].count());
        self.count(0, instances.len())?;
        let or = |a: u32, b: u32| if a == NONE { b } else { a };
        for inner in instances {
            let mut placed = inner.inside(place);
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
        for Unbounded { shape, object, material, own: own_place, origin: own_origin, casts_shadow } in unbounded {
            let object = first_object.wrapping_add(*object);
            let moved = shape
                .transformed(&transform)
                .ok_or_else(|| self.invalid(self.object_of(object, &part.object_numbers), out_of_range_message()))?;
            let material = or(own, or(*material, inherited));
            let casts_shadow = *casts_shadow && place.casts_shadow;
            let (own, origin) = match own_place {
                Some((shape, t)) => (Some((*shape, transform.after(t))), own_origin),
                None => {
                    ((!self.required_spaces(material).allow(shape, &transform)).then_some((*shape, transform)), origin)
                }
            };
            let origin = *origin;
            self.unbounded(part, Unbounded { shape: moved, object, material, own, origin, casts_shadow })?;
        }
        self.finished.insert(index, finished);
        Ok(())
    }

    /// The spaces that the textures of this material need. Inside of prototypes an instance may replace the material,
    /// so the union is returned there.
    pub(in crate::world) fn required_spaces(&self, material: u32) -> RequiredSpaces {
        if self.open.is_empty() {
            self.required_spaces.get(material as usize).copied().unwrap_or_default()
        } else {
            self.union_of_required_spaces
        }
    }

    /// Registers an object as the next one of the part. Without a name of its own it has the name of the group around
    /// it, with its kind and number.
    fn object(&mut self, node: &Node, kind: &'static str, part: &mut Part) -> u32 {
        let number = self.kinds.entry(kind).or_default();
        *number += 1;
        let own = node.name.as_deref().map(str::to_owned);
        let name = own.unwrap_or_else(|| name_of_unnamed(kind, *number, self.group_name.as_deref()));
        self.objects.push(Object { name, kind });
        let object = self.objects.len() as u32 - 1;
        part.object_numbers.push_object(object);
        object
    }

    /// The described object with this number in a part.
    pub(in crate::world) fn object_of(&self, number: u64, part: &ObjectNumbers) -> u32 {
        part.object(number, &self.prototype_numbers).expect("the walk numbers all objects")
    }

    pub(in crate::world) fn invalid(&self, object: u32, problem: impl std::fmt::Display) -> BuildError {
        BuildError::Invalid { object: self.objects[object as usize].name.clone(), problem: problem.to_string() }
    }
}

pub(in crate::world) fn missing(node: &Node, what: &'static str, index: u32, count: usize) -> BuildError {
    BuildError::Missing { object: node.name.as_deref().unwrap_or("an unnamed node").into(), what, index, count }
}

#[cfg(test)]
mod tests;
