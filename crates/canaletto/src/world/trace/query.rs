//! Queries of a world: the nearest hit, the surface there, its material and object.

use crate::light::PreparedLight;
use crate::material::PreparedMaterial;
use crate::math::{DRay, Rgb};
use crate::shape::{Shape, ShapeHit, Surface, SurfaceInputs8, Surfaces};
use crate::world::data::geometry::{Geometry, on_shape};
use crate::world::data::group::InstancePath;
use crate::world::data::instance::{Instance, NONE, Unbounded};
use crate::world::{Object, World};
use canaletto_bvh::{Aabb, PreparedRay, PrimitiveHit, Ray};

/// The first stage of a hit: its t and its primitive. [`World::surface`] is the second stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The ray's parameter.
    pub t: f32,
    /// Index of the instance, or [`Hit::UNBOUNDED`].
    pub instance: u32,
    /// Index of the primitive in its geometry, in the order of the description.
    pub primitive: u32,
    /// Index of the part of the shape.
    pub part: u32,
    /// Barycentric coordinates, on triangles.
    pub uv: [f32; 2],
    /// The time of the hit, from 0 (the shutter opens) to 1 (it closes).
    pub time: f32,
}

impl Hit {
    /// The instance number of shapes without bounds. It is the largest number, so that ties go to shapes with bounds.
    pub const UNBOUNDED: u32 = u32::MAX;

    /// No hit up to `t_max`.
    #[inline]
    pub(crate) fn none(t_max: f32, time: f32) -> Hit {
        Hit { t: t_max, instance: NONE, primitive: PrimitiveHit::NONE, part: 0, uv: [0.0; 2], time }
    }

    /// This hit, or `None` if nothing was hit.
    #[inline]
    pub(in crate::world) fn real(self) -> Option<Hit> {
        (self.primitive != PrimitiveHit::NONE).then_some(self)
    }

    /// The hit on an instance, if it is nearer than this one. Ties go to the lowest instance, then to the lowest
    /// primitive.
    #[inline]
    pub(in crate::world) fn nearer(
        &self,
        instance: u32,
        PrimitiveHit { t, id, part, uv }: PrimitiveHit,
    ) -> Option<Hit> {
        let nearer = id != PrimitiveHit::NONE && (t, instance, id) < (self.t, self.instance, self.primitive);
        nearer.then_some(Hit { t, instance, primitive: id, part, uv, time: self.time })
    }

    /// Replaces this hit by one on an instance if that is nearer.
    #[inline]
    pub(in crate::world) fn update(&mut self, instance: u32, met: PrimitiveHit) {
        if let Some(hit) = self.nearer(instance, met) {
            *self = hit;
        }
    }

    pub(in crate::world) fn shape_hit(&self) -> ShapeHit {
        ShapeHit { t: self.t, part: self.part, uv: self.uv }
    }
}

impl World {
    /// The nearest hit with 0 < t ≤ `t_max`. Ties go to the lowest instance, then to the lowest primitive.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.intersect_at(ray, t_max, 0.0)
    }

    /// [`World::intersect`] at a time in 0..=1, from the shutter's opening to its closing.
    #[inline]
    pub fn intersect_at(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        self.nearest(ray, t_max, time, World::nearest_instance)
    }

    /// The nearest hit on an instance, if that is nearer than `best`.
    #[inline]
    pub(in crate::world) fn nearest_instance(&self, ray: &PreparedRay, mut best: Hit) -> Hit {
        let root = &self.geometry.root;
        root.tree.intersect(ray, best.t, |leaf, t_max| {
            for slot in leaf.slots() {
                if ray.enters(&root.slot_bounds[slot as usize], best.t) {
                    let index = root.tree.order()[slot as usize];
                    let instance = &root.instances[index as usize];
                    if instance.group == NONE {
                        self.try_instance(ray, instance, root.first(index), &mut best, Geometry::intersect);
                    } else {
                        let way = InstancePath::to(instance, root.first(index), None, &self.geometry.groups);
                        self.try_group(ray, &way, &mut best);
                    }
                }
            }
            *t_max = best.t;
        });
        best
    }

    /// [`World::intersect`] without hierarchies: the reference for tests.
    pub fn intersect_brute_force(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.intersect_brute_force_at(ray, t_max, 0.0)
    }

    /// [`World::intersect_at`] without hierarchies.
    pub fn intersect_brute_force_at(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            for number in 0..world.geometry.root.leaves {
                world.with_instance(number, |instance| {
                    world.try_instance(ray, instance, number, &mut best, Geometry::intersect_brute_force);
                });
            }
            best
        })
    }

    #[inline]
    pub(in crate::world) fn nearest(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        instances: impl FnOnce(&World, &PreparedRay, Hit) -> Hit,
    ) -> Option<Hit> {
        let mut best = Hit::none(t_max, time);
        self.try_unbounded(ray, &mut best);
        instances(self, &ray.prepare(), best).real()
    }

    /// Tests all shapes without bounds.
    #[inline]
    pub(in crate::world) fn try_unbounded(&self, ray: &Ray, best: &mut Hit) {
        for (id, Unbounded { shape, .. }) in (0..).zip(&self.geometry.unbounded) {
            if let Some(hit) = shape.intersect(ray, best.t) {
                best.update(Hit::UNBOUNDED, PrimitiveHit { id, ..on_shape(hit) });
            }
        }
    }

    /// Tests the instances of a group, each in its place in the world.
    #[inline(never)]
    pub(in crate::world) fn try_group(&self, ray: &PreparedRay, way: &InstancePath, best: &mut Hit) {
        way.group.intersect(&way.group_ray(ray.ray()), best.t, |index| {
            let (instance, number) = (&way.group.instances[index as usize], way.number(index));
            if instance.group != NONE {
                self.try_group(ray, &InstancePath::to(instance, number, Some(way), &self.geometry.groups), best);
                return best.t;
            }
            let admitted = |t_max| ray.enters(&self.bounds_of(&way.placed(instance)), t_max);
            if let Some(local) = way.local_ray(instance, ray.ray()) {
                let met = self.geometry.geometries[instance.geometry as usize].intersect(&local, best.t, best.time);
                // Nearly all hits are inside these bounds.
                if let Some(hit) = best.nearer(number, met)
                    && admitted(best.t)
                {
                    *best = hit;
                }
            } else if admitted(best.t) {
                self.try_instance(ray, &way.placed(instance), number, best, Geometry::intersect);
            }
            best.t
        });
    }

    /// The bounds of a geometry's instance in the world.
    pub(in crate::world) fn bounds_of(&self, placed: &Instance) -> Aabb {
        placed.bounds(&self.geometry.chains, self.geometry.geometries[placed.geometry as usize].bounds())
    }

    /// Calls `f` with the instance of this number.
    #[inline]
    pub(in crate::world) fn with_instance<T>(&self, number: u32, f: impl FnOnce(&Instance) -> T) -> T {
        if self.geometry.root.is_flat() {
            f(&self.geometry.root.instances[number as usize])
        } else {
            f(&self.geometry.root.resolve(number, &self.geometry.groups))
        }
    }

    pub(in crate::world) fn try_instance(
        &self,
        ray: &PreparedRay,
        instance: &Instance,
        number: u32,
        best: &mut Hit,
        intersect: impl Fn(&Geometry, &PreparedRay, f32, f32) -> PrimitiveHit,
    ) {
        let geometry = &self.geometry.geometries[instance.geometry as usize];
        let met = instance
            .with_local_ray(ray, &self.geometry.chains, best.time, |ray| intersect(geometry, ray, best.t, best.time));
        best.update(number, met);
    }

    /// The second stage of a hit: the surface that the ray of `line` hits.
    pub fn surface(&self, line: impl Into<DRay>, hit: &Hit) -> Surface {
        self.surface_with(line.into(), hit, Shape::surface, Geometry::surface)
    }

    /// [`World::surface`] without texture coordinates, which may be undefined.
    #[inline]
    pub(crate) fn surface_without_uv(&self, line: DRay, hit: &Hit) -> Surface {
        self.surface_with(line, hit, Shape::surface_without_uv, Geometry::surface_without_uv)
    }

    /// [`World::surface_without_uv`] into a lane of a group of eight. Some surfaces are stored in `surfaces` at once.
    /// For the others the inputs are stored in `surface_inputs`, which evaluates eight surfaces at a time. Returns the
    /// surface's own colour, if it has one.
    #[inline]
    pub(crate) fn push_surface(
        &self,
        line: &DRay,
        hit: &Hit,
        lane: usize,
        surface_inputs: &mut SurfaceInputs8,
        surfaces: &mut Surfaces,
    ) -> Option<Rgb> {
        if hit.instance != Hit::UNBOUNDED {
            let together = |instance: &Instance| {
                let (geometry, id) = (&self.geometry.geometries[instance.geometry as usize], hit.primitive as usize);
                match (geometry, &instance.to_world) {
                    _ if instance.motion != NONE => return None,
                    (Geometry::Shapes { shapes, .. }, None) => match &shapes[id] {
                        Shape::Sphere(sphere) => surface_inputs.set_sphere(lane, sphere, hit.t),
                        Shape::Box(cuboid) => surface_inputs.set_cuboid(lane, cuboid, hit.part),
                        Shape::Disk(disk) => surface_inputs.set_disk(lane, disk),
                        Shape::Triangle(triangle) => {
                            surface_inputs.set_triangle(lane, &triangle.corners(), hit.t, hit.uv);
                        }
                        Shape::Rectangle(rectangle) => {
                            surface_inputs.set_triangle(lane, &rectangle.half(hit.part), hit.t, hit.uv);
                        }
                        _ => return None,
                    },
                    (Geometry::Spheres { cloud, .. }, None) => {
                        surface_inputs.set_sphere(lane, &cloud.sphere(id), hit.t);
                        return Some(cloud.color(id));
                    }
                    (Geometry::Mesh { mesh, .. }, to_world) if mesh.colors.is_empty() => {
                        if let Some(to_world) = to_world
                            && !surface_inputs.set_instance(lane, hit.instance, to_world)
                        {
                            return None;
                        }
                        surface_inputs.set_triangle(lane, &mesh.triangle(id), hit.t, hit.uv);
                    }
                    _ => return None,
                }
                Some(None)
            };
            if let Some(color) = self.with_instance(hit.instance, together) {
                return color;
            }
        }
        let surface = self.surface_without_uv(*line, hit);
        surfaces.set(lane, &surface);
        surface.color
    }

    #[inline]
    fn surface_with(
        &self,
        line: DRay,
        hit: &Hit,
        of_shape: impl Fn(&Shape, DRay, &ShapeHit) -> Surface,
        of_geometry: impl Fn(&Geometry, DRay, u32, &ShapeHit, f32) -> Surface,
    ) -> Surface {
        if hit.instance == Hit::UNBOUNDED {
            return of_shape(&self.geometry.unbounded[hit.primitive as usize].shape, line, &hit.shape_hit());
        }
        self.with_instance(hit.instance, |instance| {
            let geometry = &self.geometry.geometries[instance.geometry as usize];
            let moved;
            let to_world = if instance.motion == NONE {
                &instance.to_world
            } else {
                moved = instance.placed(&self.geometry.chains, hit.time);
                &moved
            };
            match to_world {
                None => of_geometry(geometry, line, hit.primitive, &hit.shape_hit(), hit.time),
                Some(t) => {
                    of_geometry(geometry, line.to_local(t), hit.primitive, &hit.shape_hit(), hit.time).transformed(t)
                }
            }
        })
    }

    /// Whether anything moves while the shutter is open.
    #[inline]
    pub fn moves(&self) -> bool {
        !self.geometry.chains.is_empty() || !self.sources.moving_lights.is_empty()
    }

    /// Moves the lights that move to a time in 0..=1. `lights` are this world's lights at any time.
    pub(crate) fn move_lights(&self, lights: &mut [PreparedLight], time: f32) {
        for moving in &self.sources.moving_lights {
            lights[moving.index as usize] = moving.at(time, &self.sources.light_meshes);
        }
    }

    /// A function that returns a light at a time in 0..=1, if the light moves. `light` is its index.
    pub(crate) fn moving_light(&self, light: u32) -> Option<impl Fn(f32) -> PreparedLight> {
        let moving = self.sources.moving_lights.iter().find(|moving| moving.index == light)?;
        Some(|time| moving.at(time, &self.sources.light_meshes))
    }

    /// Whether any light moves while the shutter is open.
    pub(crate) fn lights_move(&self) -> bool {
        !self.sources.moving_lights.is_empty()
    }

    /// The material at a hit.
    #[inline]
    pub fn material(&self, hit: &Hit) -> &PreparedMaterial {
        &self.shading.materials[self.material_index(hit) as usize]
    }

    /// The radiance that shadows on catchers are measured by, if there are any: that of the background
    /// ([`Material::shadow_catcher`](crate::material::Material::shadow_catcher)).
    pub fn shadow_background(&self) -> Option<Rgb> {
        let catches = self.shading.materials.iter().any(|material| material.shadow_catcher);
        catches.then_some(self.background)
    }

    /// The index of the material at a hit, into [`World::materials`].
    #[inline]
    pub fn material_index(&self, hit: &Hit) -> u32 {
        if hit.instance == Hit::UNBOUNDED {
            let own = self.geometry.unbounded[hit.primitive as usize].material;
            return if own == NONE { self.default_material() } else { own };
        }
        self.with_instance(hit.instance, |instance| self.material_of(instance, hit.primitive))
    }

    /// Whether any material may emit light.
    #[inline]
    pub fn may_emit(&self) -> bool {
        self.sources.may_emit
    }

    /// For each material, whether any surface may have it. A material may count as used where that of an instance
    /// replaces it.
    pub fn materials_in_use(&self) -> Vec<bool> {
        let mut used = vec![false; self.shading.materials.len()];
        let own: Vec<Vec<u32>> = self.geometry.geometries.iter().map(Geometry::own_materials).collect();
        for instance in self.geometry.groups.iter().chain([&self.geometry.root]).flat_map(|group| &group.instances) {
            if instance.group != NONE {
                [instance.material, instance.inherited]
                    .iter()
                    .filter(|m| **m != NONE)
                    .for_each(|&m| used[m as usize] = true);
                continue;
            }
            for &own in &own[instance.geometry as usize] {
                used[instance.effective_material(own).unwrap_or(self.default_material()) as usize] = true;
            }
        }
        for Unbounded { material, .. } in &self.geometry.unbounded {
            used[if *material == NONE { self.default_material() } else { *material } as usize] = true;
        }
        used
    }

    fn default_material(&self) -> u32 {
        self.shading.materials.len() as u32 - 1
    }

    pub(in crate::world) fn material_of(&self, instance: &Instance, primitive: u32) -> u32 {
        let own = match &self.geometry.geometries[instance.geometry as usize] {
            Geometry::Shapes { materials, .. } => materials[primitive as usize],
            Geometry::Mesh { mesh, .. } => {
                let slot = mesh.slots.get(primitive as usize).map_or(0, |&slot| slot as usize);
                mesh.materials.get(slot).copied().unwrap_or(NONE)
            }
            Geometry::Spheres { .. } | Geometry::Cylinders { .. } => NONE,
        };
        instance.effective_material(own).unwrap_or_else(|| self.default_material())
    }

    pub(in crate::world) fn material_at(&self, instance: &Instance, primitive: u32) -> &PreparedMaterial {
        &self.shading.materials[self.material_of(instance, primitive) as usize]
    }

    /// Whether a triangle of a mesh was hit.
    pub(crate) fn is_of_mesh(&self, hit: &Hit) -> bool {
        hit.instance != Hit::UNBOUNDED && self.is_mesh(hit.instance)
    }

    /// Whether the instance of this number is a mesh.
    pub(crate) fn is_mesh(&self, instance: u32) -> bool {
        self.with_instance(instance, |instance| {
            matches!(self.geometry.geometries[instance.geometry as usize], Geometry::Mesh { .. })
        })
    }

    /// The index of the material of a primitive of the instance of this number.
    pub(crate) fn material_of_primitive(&self, instance: u32, primitive: u32) -> u32 {
        self.with_instance(instance, |instance| self.material_of(instance, primitive))
    }

    /// The object that was hit.
    pub fn object(&self, hit: &Hit) -> &Object {
        let numbers = &self.names.object_numbers;
        let index = numbers.object(self.object_number(hit), &self.names.prototype_numbers);
        &self.names.objects[index.expect("the builder numbers all objects") as usize]
    }

    /// The number of the object that was hit. The objects of a scene are numbered from 1 on in the order of the file,
    /// depth first. A copy of a prototype takes as many numbers as it has objects, at the place of the instance. A
    /// mesh, a cloud and each part of a model is one object; lights and cameras have no number. Objects beyond the
    /// range of `u32` have the number [`u32::MAX`].
    pub fn object_id(&self, hit: &Hit) -> u32 {
        u32::try_from(self.object_number(hit) + 1).unwrap_or(u32::MAX)
    }

    /// The object with this number, the inverse of [`World::object_id`]. All copies of an object are the same
    /// [`Object`]. `None` for 0, for numbers of no object, and for [`u32::MAX`].
    ///
    /// [`Object`]: Object
    pub fn object_with_id(&self, id: u32) -> Option<&Object> {
        let number = u64::from(id).checked_sub(1).filter(|_| id != u32::MAX)?;
        let index = self.names.object_numbers.object(number, &self.names.prototype_numbers)?;
        Some(&self.names.objects[index as usize])
    }

    /// The number of the element that was hit within its object, from 1 on: the row of a cloud's table, or the triangle
    /// of a mesh in the order of its file. A single shape is element 1.
    pub fn element_id(&self, hit: &Hit) -> u32 {
        if hit.instance == Hit::UNBOUNDED {
            return 1;
        }
        self.with_instance(hit.instance, |instance| {
            self.geometry.geometries[instance.geometry as usize].element_id(hit.primitive)
        })
    }

    /// The largest number of an object or a material in a layer.
    pub(crate) fn largest_id(&self) -> u64 {
        self.names.object_numbers.count().max(self.shading.materials.len() as u64)
    }

    /// The largest number of an element in a layer.
    pub(crate) fn largest_element_id(&self) -> u64 {
        // Elements stand in the order of their numbers.
        let largest = |geometry: &Geometry| geometry.len().checked_sub(1).map(|last| geometry.element_id(last as u32));
        self.geometry.geometries.iter().filter_map(largest).max().unwrap_or(0).into()
    }

    /// The number of the object that was hit, from 0 on.
    fn object_number(&self, hit: &Hit) -> u64 {
        if hit.instance == Hit::UNBOUNDED {
            return self.geometry.unbounded[hit.primitive as usize].object;
        }
        self.with_instance(hit.instance, |instance| match &self.geometry.geometries[instance.geometry as usize] {
            Geometry::Shapes { objects, .. } => instance.first_object + u64::from(objects[hit.primitive as usize]),
            _ => instance.first_object,
        })
    }
}
