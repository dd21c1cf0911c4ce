//! What integrators ask of a world: the nearest hit, the surface there, the light that passes.

use super::World;
use super::bundle::Between;
use super::geometry::{Geometry, on_shape};
use super::group::Way;
use super::instance::{Instance, NONE, Unbounded, to_local};
use crate::integrator::Probe;
use crate::light::Source;
use crate::material::Material;
use crate::math::{Line, Spread, offset_origin};
use crate::shape::{Shape, ShapeHit, Surface};
use canaletto_bvh::{Aabb, Met, PreparedRay, Ray};

/// The first stage of a hit: where, and on what. [`World::surface`] is the second stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The ray's parameter.
    pub t: f32,
    /// Index of the instance, or [`Hit::UNBOUNDED`].
    pub instance: u32,
    /// Index of the primitive in its geometry, as the description counts.
    pub primitive: u32,
    /// Which part of the shape.
    pub part: u32,
    /// Barycentric coordinates on triangles.
    pub uv: [f32; 2],
    /// When, from 0 (the shutter opens) to 1 (it closes).
    pub time: f32,
}

/// Something opaque that stood in a light's way. A hint: it changes no answer.
#[derive(Clone, Copy, Debug)]
pub struct Blocker {
    instance: u32,
    /// In leaf order.
    slot: u32,
}

impl Blocker {
    /// Nothing so far.
    pub const NONE: Blocker = Blocker { instance: NONE, slot: NONE };

    /// The slot if it is of this instance, of which it shall be from now on.
    pub(super) fn slot_in(&mut self, instance: u32) -> &mut u32 {
        if self.instance != instance {
            *self = Blocker { instance, slot: NONE };
        }
        &mut self.slot
    }
}

impl Hit {
    /// The instance number of shapes without bounds. The largest, so that ties go to shapes with bounds.
    pub const UNBOUNDED: u32 = u32::MAX;

    /// Nothing up to `t_max`.
    #[inline]
    pub(super) fn before(t_max: f32, time: f32) -> Hit {
        Hit { t: t_max, instance: NONE, primitive: Met::NONE, part: 0, uv: [0.0; 2], time }
    }

    /// It, if something was met.
    #[inline]
    pub(super) fn real(self) -> Option<Hit> {
        (self.primitive != Met::NONE).then_some(self)
    }

    /// What is met on an instance, if anything is and it is nearer; ties go to the lowest instance, then the lowest primitive.
    #[inline]
    fn nearer(&self, instance: u32, Met { t, id, part, uv }: Met) -> Option<Hit> {
        let nearer = id != Met::NONE && (t, instance, id) < (self.t, self.instance, self.primitive);
        nearer.then_some(Hit { t, instance, primitive: id, part, uv, time: self.time })
    }

    /// Becomes that.
    #[inline]
    pub(super) fn offer(&mut self, instance: u32, met: Met) {
        if let Some(hit) = self.nearer(instance, met) {
            *self = hit;
        }
    }

    pub(super) fn shape_hit(&self) -> ShapeHit {
        ShapeHit { t: self.t, part: self.part, uv: self.uv }
    }
}

impl World {
    /// The nearest hit with 0 < t ≤ t_max; ties go to the lowest instance, then the lowest primitive.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.intersect_at(ray, t_max, 0.0)
    }

    /// The same at a time in 0..=1, from the shutter's opening to its closing.
    #[inline]
    pub fn intersect_at(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            let root = &world.root;
            root.tree.intersect(ray, best.t, |leaf, t_max| {
                for slot in leaf.slots() {
                    if ray.enters(&root.slot_bounds[slot as usize], best.t) {
                        let index = root.tree.order()[slot as usize];
                        let instance = &root.instances[index as usize];
                        if instance.group == NONE {
                            world.try_instance(ray, instance, root.first(index), &mut best, Geometry::intersect);
                        } else {
                            world.try_group(ray, &Way::to(instance, root.first(index), None, &world.groups), &mut best);
                        }
                    }
                }
                *t_max = best.t;
            });
            best
        })
    }

    /// [`World::intersect`] without hierarchies: the oracle for tests.
    pub fn intersect_brute_force(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.intersect_brute_force_at(ray, t_max, 0.0)
    }

    /// [`World::intersect_at`] without hierarchies.
    pub fn intersect_brute_force_at(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            for number in 0..world.root.leaves {
                world.with_instance(number, |instance| {
                    world.try_instance(ray, instance, number, &mut best, Geometry::intersect_brute_force);
                });
            }
            best
        })
    }

    #[inline]
    fn nearest(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        instances: impl FnOnce(&World, &PreparedRay, Hit) -> Hit,
    ) -> Option<Hit> {
        let mut best = Hit::before(t_max, time);
        self.try_unbounded(ray, &mut best);
        instances(self, &ray.prepare(), best).real()
    }

    /// All shapes without bounds.
    #[inline]
    pub(super) fn try_unbounded(&self, ray: &Ray, best: &mut Hit) {
        for (id, Unbounded { shape, .. }) in (0..).zip(&self.unbounded) {
            if let Some(hit) = shape.intersect(ray, best.t) {
                best.offer(Hit::UNBOUNDED, Met { id, ..on_shape(hit) });
            }
        }
    }

    /// A group's instances, each as it stands in the world.
    #[inline(never)]
    fn try_group(&self, ray: &PreparedRay, way: &Way, best: &mut Hit) {
        way.group.intersect(&way.feeler(&ray.ray), best.t, |index| {
            let (instance, number) = (&way.group.instances[index as usize], way.number(index));
            if instance.group != NONE {
                self.try_group(ray, &Way::to(instance, number, Some(way), &self.groups), best);
                return best.t;
            }
            let admitted = |t_max| ray.enters(&self.bounds_of(&way.placed(instance)), t_max);
            if let Some(local) = way.local_ray(instance, &ray.ray) {
                let met = self.geometries[instance.geometry as usize].intersect(&local, best.t);
                // Nearly all that are met are admitted.
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

    /// Where a geometry's instance is in the world.
    fn bounds_of(&self, placed: &Instance) -> Aabb {
        placed.bounds(&self.chains, self.geometries[placed.geometry as usize].bounds())
    }

    /// Calls `f` with the instance of this number.
    #[inline]
    pub(super) fn with_instance<T>(&self, number: u32, f: impl FnOnce(&Instance) -> T) -> T {
        if self.root.is_flat() {
            f(&self.root.instances[number as usize])
        } else {
            f(&self.root.resolve(number, &self.groups))
        }
    }

    fn try_instance(
        &self,
        ray: &PreparedRay,
        instance: &Instance,
        number: u32,
        best: &mut Hit,
        intersect: impl Fn(&Geometry, &PreparedRay, f32) -> Met,
    ) {
        let geometry = &self.geometries[instance.geometry as usize];
        let met = instance.with_local_ray(ray, &self.chains, best.time, |ray| intersect(geometry, ray, best.t));
        best.offer(number, met);
    }

    /// f_s of (5.39a): the product of 1 − o over the surfaces between the ray's origin and `t_max`. `last` is what blocked
    /// the light before, which often blocks it again; `spread` is the ray's, for textures that let light through.
    pub fn transmittance<P: Probe>(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        spread: Option<&Spread>,
        last: &mut Blocker,
        probe: &mut P,
    ) -> f32 {
        // Anything opaque in between settles it; only a recording probe wants to know what stands in which order.
        match self.between(ray, t_max, time, last) {
            Between::Nothing => 1.0,
            Between::Opaque if !P::ACTIVE => 0.0,
            between => self.through(ray, t_max, time, spread, between, probe),
        }
    }

    /// [`World::transmittance`] where something stands between.
    pub(crate) fn through<P: Probe>(
        &self,
        ray: &Ray,
        t_max: f32,
        time: f32,
        spread: Option<&Spread>,
        between: Between,
        probe: &mut P,
    ) -> f32 {
        let mut passed = 1.0;
        let (mut ray, mut t_max) = (*ray, t_max);
        let (line, end) = (Line::from(&ray), ray.origin + ray.direction);
        for _ in 0..Self::MAX_CROSSINGS {
            let hit = match between {
                Between::Clear => self.intersect_clear(&ray, t_max, time),
                _ => self.intersect_at(&ray, t_max, time),
            };
            let Some(hit) = hit else { break };
            let surface = self.bare_surface(Line::from(&ray), &hit);
            let material = self.material(&hit);
            let opacity = if material.textures.is_empty() {
                material.phong.opacity
            } else {
                let step = spread.map(|s| s.along(&line, surface.exact, surface.normal));
                self.kept_light(Line::from(&ray), &hit, step)
            };
            probe.blocker(&hit, opacity);
            passed *= 1.0 - opacity;
            if passed == 0.0 {
                break;
            }
            ray.origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction.as_dvec3());
            // Towards a point the direction is the rest of the way, so that t stays at most 1.
            if t_max.is_finite() {
                let rest = end - ray.origin;
                if rest.dot(ray.direction) <= 0.0 {
                    break;
                }
                ray.direction = rest;
                t_max = 1.0 - f32::EPSILON;
            }
        }
        if between == Between::Opaque { 0.0 } else { passed }
    }

    /// The nearest hit for a ray that meets nothing opaque: instances where all is opaque need not be asked, where they are few.
    fn intersect_clear(&self, ray: &Ray, t_max: f32, time: f32) -> Option<Hit> {
        if !self.is_small() {
            return self.intersect_at(ray, t_max, time);
        }
        self.nearest(ray, t_max, time, |world, ray, mut best| {
            let clear = world.root.instances.iter().zip(&world.clear_instances).enumerate();
            for (index, (instance, _)) in clear.filter(|(_, (_, clear))| **clear) {
                world.try_instance(ray, instance, index as u32, &mut best, Geometry::intersect);
            }
            best
        })
    }

    /// The most clear surfaces that a shadow ray passes; light beyond them arrives as it is.
    const MAX_CROSSINGS: usize = 1 << 16;

    /// What stands before `t_max`.
    pub(super) fn between(&self, ray: &Ray, t_max: f32, time: f32, last: &mut Blocker) -> Between {
        let prepared = &ray.prepare();
        if last.slot != NONE && last.instance < self.root.leaves {
            let again = self.with_instance(last.instance, |instance| {
                let geometry = &self.geometries[instance.geometry as usize];
                instance.with_local_ray(prepared, &self.chains, time, |ray| geometry.blocks(last.slot, ray, t_max))
            });
            if again {
                return Between::Opaque;
            }
            // Once past its shadow's border it would be tried in vain.
            *last = Blocker::NONE;
        }
        let unbounded = self.between_unbounded(ray, t_max);
        let mut clear = unbounded == Between::Clear;
        let blocked = unbounded == Between::Opaque || {
            let root = &self.root;
            let mut block = |instance: &Instance, number: u32| {
                let geometry = &self.geometries[instance.geometry as usize];
                let slot = instance.with_local_ray(prepared, &self.chains, time, |ray| {
                    geometry.occluded(ray, t_max, |primitive| {
                        let opaque = self.clear_instances.is_empty() || self.made_of(instance, primitive).is_opaque();
                        clear |= !opaque;
                        opaque
                    })
                });
                if let Some(slot) = slot {
                    *last = Blocker { instance: number, slot };
                }
                slot.is_some()
            };
            root.tree.occluded(prepared, t_max, |leaf| {
                leaf.slots().any(|slot| {
                    if !prepared.enters(&root.slot_bounds[slot as usize], t_max) {
                        return false;
                    }
                    let index = root.tree.order()[slot as usize];
                    let instance = &root.instances[index as usize];
                    if instance.group == NONE {
                        return block(instance, root.first(index));
                    }
                    let way = Way::to(instance, root.first(index), None, &self.groups);
                    self.blocked_by_group(prepared, t_max, &way, &mut block)
                })
            })
        };
        match (blocked, clear) {
            (true, _) => Between::Opaque,
            (false, true) => Between::Clear,
            (false, false) => Between::Nothing,
        }
    }

    /// What of the shapes without bounds stands before `t_max`.
    #[inline]
    pub(super) fn between_unbounded(&self, ray: &Ray, t_max: f32) -> Between {
        let mut between = Between::Nothing;
        for (index, Unbounded { shape, .. }) in (0..).zip(&self.unbounded) {
            if shape.intersect(ray, t_max).is_some() {
                if self.is_opaque(Hit::UNBOUNDED, index) {
                    return Between::Opaque;
                }
                between = Between::Clear;
            }
        }
        between
    }

    /// Whether one of a group's instances, as they stand in the world, blocks a ray.
    #[inline(never)]
    fn blocked_by_group(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        way: &Way,
        block: &mut dyn FnMut(&Instance, u32) -> bool,
    ) -> bool {
        way.group.occluded(&way.feeler(&ray.ray), t_max, |index| {
            let (instance, number) = (&way.group.instances[index as usize], way.number(index));
            if instance.group != NONE {
                let way = Way::to(instance, number, Some(way), &self.groups);
                return self.blocked_by_group(ray, t_max, &way, block);
            }
            if self.clear_instances.is_empty()
                && let Some(local) = way.local_ray(instance, &ray.ray)
                && self.geometries[instance.geometry as usize].occluded(&local, t_max, |_| true).is_none()
            {
                return false;
            }
            let placed = way.placed(instance);
            ray.enters(&self.bounds_of(&placed), t_max) && block(&placed, number)
        })
    }

    /// Whether a primitive lets no light through.
    #[inline]
    pub(super) fn is_opaque(&self, instance: u32, primitive: u32) -> bool {
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        self.clear_instances.is_empty() || self.material(&hit).is_opaque()
    }

    /// The second stage: the surface at a hit of this line's ray.
    pub fn surface(&self, line: impl Into<Line>, hit: &Hit) -> Surface {
        self.surface_with(line.into(), hit, Shape::surface, Geometry::surface)
    }

    /// The same for whoever doesn't read its texture coordinates, which may be left out.
    #[inline]
    pub(crate) fn bare_surface(&self, line: Line, hit: &Hit) -> Surface {
        self.surface_with(line, hit, Shape::bare_surface, Geometry::bare_surface)
    }

    #[inline]
    fn surface_with(
        &self,
        line: Line,
        hit: &Hit,
        of_shape: impl Fn(&Shape, Line, &ShapeHit) -> Surface,
        of_geometry: impl Fn(&Geometry, Line, u32, &ShapeHit) -> Surface,
    ) -> Surface {
        if hit.instance == Hit::UNBOUNDED {
            return of_shape(&self.unbounded[hit.primitive as usize].shape, line, &hit.shape_hit());
        }
        self.with_instance(hit.instance, |instance| {
            let geometry = &self.geometries[instance.geometry as usize];
            let moved;
            let to_world = if instance.motion == NONE {
                &instance.to_world
            } else {
                moved = instance.placed(&self.chains, hit.time);
                &moved
            };
            match to_world {
                None => of_geometry(geometry, line, hit.primitive, &hit.shape_hit()),
                Some(t) => of_geometry(geometry, to_local(t, line), hit.primitive, &hit.shape_hit()).transformed(t),
            }
        })
    }

    /// Whether anything moves while the shutter is open.
    #[inline]
    pub fn moves(&self) -> bool {
        !self.chains.is_empty() || !self.moving_lights.is_empty()
    }

    /// Puts the lights that move to where they are at a time in 0..=1. `lights` are this world's, at any time.
    pub(crate) fn move_lights(&self, lights: &mut [Source], time: f32) {
        for moving in &self.moving_lights {
            lights[moving.index as usize] = moving.at(time, &self.light_meshes);
        }
    }

    /// Whether any light moves while the shutter is open.
    pub(crate) fn lights_move(&self) -> bool {
        !self.moving_lights.is_empty()
    }

    /// The material at a hit.
    #[inline]
    pub fn material(&self, hit: &Hit) -> &Material {
        &self.materials[self.material_index(hit) as usize]
    }

    /// The index of the material at a hit, into [`World::materials`].
    #[inline]
    pub fn material_index(&self, hit: &Hit) -> u32 {
        if hit.instance == Hit::UNBOUNDED {
            let own = self.unbounded[hit.primitive as usize].material;
            return if own == NONE { self.default_material() } else { own };
        }
        self.with_instance(hit.instance, |instance| self.material_of(instance, hit.primitive))
    }

    fn default_material(&self) -> u32 {
        self.materials.len() as u32 - 1
    }

    fn material_of(&self, instance: &Instance, primitive: u32) -> u32 {
        let own = match &self.geometries[instance.geometry as usize] {
            Geometry::Shapes { materials, .. } => materials[primitive as usize],
            Geometry::Mesh { mesh, .. } => {
                let slot = mesh.slots.get(primitive as usize).map_or(0, |&slot| slot as usize);
                mesh.materials.get(slot).copied().unwrap_or(NONE)
            }
            Geometry::Spheres { .. } | Geometry::Cylinders { .. } => NONE,
        };
        instance.effective_material(own).unwrap_or_else(|| self.default_material())
    }

    fn made_of(&self, instance: &Instance, primitive: u32) -> &Material {
        &self.materials[self.material_of(instance, primitive) as usize]
    }

    /// The object that was hit.
    pub fn object(&self, hit: &Hit) -> &super::Object {
        let index = match hit.instance {
            Hit::UNBOUNDED => self.unbounded[hit.primitive as usize].object,
            number => self.with_instance(number, |instance| self.object_of(instance, hit.primitive)),
        };
        &self.objects[index as usize]
    }

    /// A number from 1 on for the object that was hit, different for each copy of an instanced one, as far as 32 bits go.
    pub fn object_id(&self, hit: &Hit) -> u32 {
        match hit.instance {
            Hit::UNBOUNDED => self.unbounded_id_base.wrapping_add(hit.primitive),
            number => self.with_instance(number, |instance| {
                instance.id_base.wrapping_add(self.object_of(instance, hit.primitive))
            }),
        }
    }

    fn object_of(&self, instance: &Instance, primitive: u32) -> u32 {
        match &self.geometries[instance.geometry as usize] {
            Geometry::Shapes { objects, .. } => objects[primitive as usize],
            _ => instance.object,
        }
    }
}
