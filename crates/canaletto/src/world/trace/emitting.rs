//! Surfaces that emit, for integrators that send rays to them.

use crate::shape::{Shape, Triangle};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::group::Group;
use crate::world::data::instance::{Instance, NONE};
use crate::world::trace::query::Hit;
use canaletto_bvh::{Aabb, PrimitiveHit, Ray};
use std::collections::HashMap;

/// What an integrator must know of a visible light besides its surface's material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VisibleLight {
    /// [`crate::light::Light::attenuation`].
    pub(crate) attenuation: [f32; 3],
    /// Whether the surface itself lights others: matte emission that casts shadows.
    pub(crate) is_emitter: bool,
}

/// The search for geometries with certain materials.
struct Search<'w, F> {
    world: &'w World,
    is_wanted: F,
    /// The materials of each geometry's primitives.
    own: HashMap<u32, Vec<u32>>,
    /// For each group without a material of its own, and each material that it inherits, whether it has any.
    found: HashMap<(u32, u32), bool>,
    numbers: Vec<u32>,
}

impl World {
    /// The numbers of the placed geometries in which a material may be used that `is_wanted`, in rising order. Groups
    /// and geometries without one are passed without a look at their primitives.
    pub(crate) fn geometries_with_material(&self, is_wanted: impl Fn(u32) -> bool) -> Vec<u32> {
        if !(0..self.shading.materials.len() as u32).any(&is_wanted) {
            return Vec::new();
        }
        let (own, found, numbers) = (HashMap::new(), HashMap::new(), Vec::new());
        let mut search = Search { world: self, is_wanted, own, found, numbers };
        search.collect(&self.geometry.root, 0, [NONE; 2]);
        search.numbers
    }

    /// Whether the placed geometry of this number moves while the shutter is open.
    pub(crate) fn placed_moves(&self, number: u32) -> bool {
        self.with_instance(number, |instance| instance.motion != NONE)
    }

    /// The hit on one primitive of an instance, whatever lies before it.
    pub(crate) fn intersect_primitive(&self, ray: &Ray, [number, primitive]: [u32; 2], time: f32) -> Option<Hit> {
        let id = primitive as usize;
        self.with_instance(number, |instance| {
            instance.with_local_ray(&ray.prepare(), &self.geometry.chains, time, |ray| {
                let shape = match &self.geometry.geometries[instance.geometry as usize] {
                    Geometry::Shapes { shapes, .. } => shapes[id],
                    Geometry::Mesh { mesh, .. } => {
                        let [a, b, c] = mesh.corners_at(id, time);
                        Shape::Triangle(Triangle { a, b, c, one_sided: false })
                    }
                    Geometry::Spheres { cloud, .. } => cloud.sphere(id).into(),
                    Geometry::Cylinders { cloud, .. } => cloud.cylinder(id).into(),
                };
                let hit = shape.intersect(ray.ray(), f32::INFINITY)?;
                let mut nearest = Hit::none(f32::INFINITY, time);
                nearest.update(number, PrimitiveHit { t: hit.t, id: primitive, part: hit.part, uv: hit.uv });
                nearest.real()
            })
        })
    }

    /// The visible light that a material shows.
    pub(crate) fn visible_light(&self, material: u32) -> Option<&VisibleLight> {
        let index = material.checked_sub(self.sources.light_materials.start)?;
        self.sources.visible_lights.get(index as usize)
    }

    /// The bounds of a light of this index over all times, if it moves and isn't infinitely far.
    pub(crate) fn moving_light_bounds(&self, index: u32) -> Option<Aabb> {
        let moving = self.sources.moving_lights.iter().find(|moving| moving.index == index)?;
        let [min, max] = self.sources.light_meshes.source(moving.light.clone()).bounds()?.bounds;
        Some(moving.chain.bounds(Aabb { min: min.as_vec3(), max: max.as_vec3() }))
    }
}

impl<F: Fn(u32) -> bool> Search<'_, F> {
    /// The materials of a group's member. `outer` are the material that replaces all others and the inherited one.
    fn materials(instance: &Instance, [material, inherited]: [u32; 2]) -> [u32; 2] {
        [
            if material == NONE { instance.material } else { material },
            if instance.inherited == NONE { inherited } else { instance.inherited },
        ]
    }

    /// Adds the geometries of a group, whose first has the number `first`.
    fn collect(&mut self, group: &Group, first: u32, outer: [u32; 2]) {
        for (index, instance) in (0..).zip(&group.instances) {
            if self.has(instance, outer) {
                let number = first + group.first(index);
                match instance.group {
                    NONE => self.numbers.push(number),
                    inner => {
                        let world = self.world;
                        self.collect(&world.geometry.groups[inner as usize], number, Self::materials(instance, outer));
                    }
                }
            }
        }
    }

    /// Whether a group's member may have a wanted material.
    fn has(&mut self, instance: &Instance, outer: [u32; 2]) -> bool {
        let world = self.world;
        let [material, inherited] = Self::materials(instance, outer);
        if material != NONE {
            return (self.is_wanted)(material);
        }
        if instance.group == NONE {
            let geometry = instance.geometry;
            let own = self
                .own
                .entry(geometry)
                .or_insert_with(|| world.geometry.geometries[geometry as usize].own_materials());
            let default = world.shading.materials.len() as u32 - 1;
            return own
                .iter()
                .any(|&own| (self.is_wanted)([own, inherited].into_iter().find(|m| *m != NONE).unwrap_or(default)));
        }
        let key = (instance.group, inherited);
        if let Some(found) = self.found.get(&key) {
            return *found;
        }
        let found =
            world.geometry.groups[instance.group as usize].instances.iter().any(|i| self.has(i, [NONE, inherited]));
        self.found.insert(key, found);
        found
    }
}
