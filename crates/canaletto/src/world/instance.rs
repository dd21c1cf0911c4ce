//! Instances: geometries placed in the world.

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
    /// From the geometry's space to the world's; `None` is the identity.
    pub(super) to_world: Option<Transform>,
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
    pub(super) fn with_local_ray<T>(&self, ray: &PreparedRay, f: impl FnOnce(&PreparedRay) -> T) -> T {
        match &self.to_world {
            None => f(ray),
            Some(_) => f(&self.local_line(Line::from(&ray.ray)).rounded().prepare()),
        }
    }

    /// The line in the geometry's space.
    pub(super) fn local_line(&self, line: Line) -> Line {
        match &self.to_world {
            None => line,
            Some(t) => {
                let to_local = t.inverse();
                Line { origin: to_local.point(line.origin), direction: to_local.vector(line.direction) }
            }
        }
    }

    /// World bounds of local ones, rounded outwards.
    pub(super) fn bounds(&self, local: Aabb) -> Aabb {
        let Some(t) = &self.to_world else { return local };
        if local.is_empty() {
            return local;
        }
        let (min, max) = (local.min.as_dvec3(), local.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let m = t.matrix().matrix3;
        let center = t.point(center);
        let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        // The ray is rounded on its way into the geometry's space: give the box that much, relative to its own numbers.
        let slack = (center.abs() + half) * f64::from(f32::EPSILON) * 4.0;
        let (low, high) = ((center - half - slack).as_vec3(), (center + half + slack).as_vec3());
        Aabb { min: low.map(f32::next_down), max: high.map(f32::next_up) }
    }
}
