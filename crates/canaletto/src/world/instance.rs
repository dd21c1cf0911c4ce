//! Instances: geometries placed in the world.

use super::motion::{Chain, around, outwards};
use crate::math::{Line, Transform};
use crate::shape::Shape;
use canaletto_bvh::{Aabb, PreparedRay};

/// No index.
pub(super) const NONE: u32 = u32::MAX;

/// A geometry placed in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instance {
    /// Index into the world's geometries.
    pub(super) geometry: u32,
    /// The object it belongs to; shapes have their own.
    pub(super) object: u32,
    /// What is added to an object's number to tell copies apart.
    pub(super) id_base: u32,
    /// The material that replaces all others, or [`NONE`].
    pub(super) material: u32,
    /// The material for what has none, or [`NONE`].
    pub(super) inherited: u32,
    /// From the geometry's space to the world's; `None` is the identity. Where it is at time 0, if it moves.
    pub(super) to_world: Option<Transform>,
    /// Index into the world's chains if it moves, or [`NONE`].
    pub(super) motion: u32,
}

/// A shape without bounds, placed in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unbounded {
    /// In the world's space.
    pub(super) shape: Shape,
    pub(super) object: u32,
    /// Or [`NONE`].
    pub(super) material: u32,
    /// The shape in its own space and where that is, if a texture needs to know and it isn't the world's.
    pub(super) own: Option<(Shape, Transform)>,
}

impl Instance {
    /// Calls `f` with the ray in the geometry's space. Its parameter t stays the same: the direction isn't normalised.
    #[inline]
    pub(super) fn with_local_ray<T>(
        &self,
        ray: &PreparedRay,
        chains: &[Chain],
        time: f32,
        f: impl FnOnce(&PreparedRay) -> T,
    ) -> T {
        match &self.to_world {
            None => f(ray),
            Some(t) if self.motion == NONE => f(&to_local(t, Line::from(&ray.ray)).rounded().prepare()),
            Some(_) => {
                let t = chains[self.motion as usize].at(time);
                f(&to_local(&t, Line::from(&ray.ray)).rounded().prepare())
            }
        }
    }

    /// The material of a primitive that names `own`, if any of them names one.
    #[inline]
    pub(super) fn effective_material(&self, own: u32) -> Option<u32> {
        [self.material, own, self.inherited].into_iter().find(|&m| m != NONE)
    }

    /// From the geometry's space to the world's at a time in 0..=1.
    pub(super) fn placed(&self, chains: &[Chain], time: f32) -> Option<Transform> {
        if self.motion == NONE { self.to_world } else { Some(chains[self.motion as usize].at(time)) }
    }

    /// World bounds of local ones over all times, rounded outwards.
    pub(super) fn bounds(&self, chains: &[Chain], local: Aabb) -> Aabb {
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

/// The line in the space that `to_world` leads out of.
pub(super) fn to_local(to_world: &Transform, line: Line) -> Line {
    let back = to_world.inverse();
    Line { origin: back.point(line.origin), direction: back.vector(line.direction) }
}
