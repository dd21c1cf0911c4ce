//! Instances: geometries placed in the world.

use crate::math::{DRay, Transform};
use crate::shape::Shape;
use crate::world::data::motion::{TransformChain, around, outwards};
use canaletto_bvh::{Aabb, PreparedRay};
use glam::DVec3;

/// No index.
pub(in crate::world) const NONE: u32 = u32::MAX;

/// A geometry or a group placed in the world, or in the space of the group that it is a member of.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct Instance {
    /// Index into the world's geometries; [`NONE`] for a group.
    pub(in crate::world) geometry: u32,
    /// Index into the world's groups, or [`NONE`].
    pub(in crate::world) group: u32,
    /// The number of the instance's first object in the space that it is placed in; see [`super::object_numbers`].
    /// It is the sum over the instance and all groups around it.
    pub(in crate::world) first_object: u64,
    /// The material that replaces all others, or [`NONE`].
    pub(in crate::world) material: u32,
    /// The material for primitives that have none, or [`NONE`].
    pub(in crate::world) inherited: u32,
    /// The transform from the geometry's space to the world's, at time 0 if the instance moves. `None` is the identity;
    /// placed groups always have a transform.
    pub(in crate::world) to_world: Option<Transform>,
    /// Index into the world's chains if it moves, or [`NONE`].
    pub(in crate::world) motion: u32,
    /// Whether shadow rays meet it. All groups around it must cast shadows, too.
    pub(in crate::world) casts_shadow: bool,
}

/// The placement of an instance of a prototype.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct Placement {
    pub(in crate::world) transform: Transform,
    /// The material that replaces all others, or [`NONE`].
    pub(in crate::world) own: u32,
    /// The material for primitives that have none, or [`NONE`].
    pub(in crate::world) inherited: u32,
    /// The number of the copy's first object.
    pub(in crate::world) first_object: u64,
    pub(in crate::world) casts_shadow: bool,
}

/// A shape without bounds, placed in the world.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct Unbounded {
    /// The shape in the world's space.
    pub(in crate::world) shape: Shape,
    /// The number of the object; see [`super::object_numbers`].
    pub(in crate::world) object: u64,
    /// The material of the shape, or [`NONE`].
    pub(in crate::world) material: u32,
    /// The shape in its own space and that space's transform, if a texture needs them and the space isn't the world's.
    pub(in crate::world) own: Option<(Shape, Transform)>,
    /// The origin of that shape's coordinates in the object's space.
    pub(in crate::world) origin: DVec3,
    /// Whether shadow rays meet it.
    pub(in crate::world) casts_shadow: bool,
}

impl Instance {
    /// An instance of a geometry with the identity transform and the geometry's own materials.
    pub(in crate::world) fn of(geometry: u32, first_object: u64) -> Instance {
        let (material, inherited) = (NONE, NONE);
        Instance {
            geometry,
            group: NONE,
            first_object,
            material,
            inherited,
            to_world: None,
            motion: NONE,
            casts_shadow: true,
        }
    }

    /// A group without a placement.
    pub(in crate::world) fn of_group(group: u32) -> Instance {
        Instance { group, ..Instance::of(NONE, 0) }
    }

    /// This instance as a member of an instance with this placement. All transforms come from here and from
    /// [`Instance::enclose`]. They are composed from the innermost outwards. A member found through a group thus has
    /// the bits of a member of a dissolved prototype.
    pub(in crate::world) fn inside(
        &self,
        Placement { transform, own, inherited, first_object, casts_shadow }: &Placement,
    ) -> Instance {
        let mut placed = *self;
        if self.group != NONE {
            // The group's first placement. The transforms of its members come before it.
            debug_assert!(self.to_world.is_none());
            return Instance {
                to_world: Some(*transform),
                material: *own,
                inherited: *inherited,
                first_object: *first_object,
                casts_shadow: self.casts_shadow && *casts_shadow,
                ..*self
            };
        }
        placed.enclose(&Instance {
            to_world: Some(*transform),
            material: *own,
            inherited: *inherited,
            casts_shadow: *casts_shadow,
            ..Instance::of(NONE, *first_object)
        });
        placed
    }

    /// Composes this member of a group with an instance of the group, as [`Instance::inside`].
    #[inline]
    pub(in crate::world) fn enclose(&mut self, group: &Instance) {
        if let Some(transform) = &group.to_world {
            let to_world = self.to_world.as_ref().map_or(*transform, |t| transform.after(t));
            self.to_world = (!to_world.is_identity()).then_some(to_world);
        }
        if group.material != NONE {
            self.material = group.material;
        }
        if self.inherited == NONE {
            self.inherited = group.inherited;
        }
        self.casts_shadow &= group.casts_shadow;
        self.first_object = self.first_object.wrapping_add(group.first_object);
    }

    /// Calls `f` with the ray in the geometry's space. The parameter t keeps its meaning, since the direction isn't
    /// normalised.
    #[inline]
    pub(in crate::world) fn with_local_ray<T>(
        &self,
        ray: &PreparedRay,
        chains: &[TransformChain],
        time: f32,
        f: impl FnOnce(&PreparedRay) -> T,
    ) -> T {
        match &self.to_world {
            None => f(ray),
            Some(t) if self.motion == NONE => f(&DRay::from(ray.ray()).to_local(t).rounded().prepare()),
            Some(_) => {
                let t = chains[self.motion as usize].at(time);
                f(&DRay::from(ray.ray()).to_local(&t).rounded().prepare())
            }
        }
    }

    /// The material of a primitive whose own material is `own`, or `None` if no material is given.
    #[inline]
    pub(in crate::world) fn effective_material(&self, own: u32) -> Option<u32> {
        [self.material, own, self.inherited].into_iter().find(|&m| m != NONE)
    }

    /// The transform from the geometry's space to the world's at a time in 0..=1.
    pub(in crate::world) fn placed(&self, chains: &[TransformChain], time: f32) -> Option<Transform> {
        if self.motion == NONE { self.to_world } else { Some(chains[self.motion as usize].at(time)) }
    }

    /// World bounds of local ones over all times, rounded outwards.
    pub(in crate::world) fn bounds(&self, chains: &[TransformChain], local: Aabb) -> Aabb {
        let Some(t) = &self.to_world else { return local };
        if local.is_empty() {
            return local;
        }
        if self.motion != NONE {
            return chains[self.motion as usize].bounds(local);
        }
        let (min, max) = (local.min.as_dvec3(), local.max.as_dvec3());
        let (center, half) = around(t, (min + max) * 0.5, (max - min) * 0.5);
        outwards(center, half)
    }
}
