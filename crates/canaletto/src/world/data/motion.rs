//! Instances and lights that move while the shutter is open.
//!
//! The first level of the hierarchy holds an instance's bounds over the whole time. A ray is transformed into the
//! instance's space at the ray's own time. A moving object is never transformed at build time. A motion within a
//! motion, such as that of a wheel on a car, stays a chain of both. Rotations therefore stay rotations.

use crate::light::{Light, PreparedLight};
use crate::math::{AnimatedTransform, Transform};
use crate::world::data::light_meshes::LightMeshes;
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A transform that changes over time: transforms and paths in turn, the outermost first.
#[derive(Clone, Debug)]
pub(in crate::world) struct TransformChain {
    links: Vec<(Transform, Arc<AnimatedTransform>)>,
    innermost: Transform,
}

impl TransformChain {
    /// A transform that doesn't change.
    pub(in crate::world) fn still(place: Transform) -> TransformChain {
        TransformChain { links: Vec::new(), innermost: place }
    }

    /// This transform followed by a path.
    pub(in crate::world) fn along(mut self, path: &Arc<AnimatedTransform>) -> TransformChain {
        self.links.insert(0, (Transform::IDENTITY, path.clone()));
        self
    }

    /// This transform followed by one more.
    pub(in crate::world) fn inside(mut self, outer: &Transform) -> TransformChain {
        let first = self.links.first_mut().map_or(&mut self.innermost, |(before, _)| before);
        *first = outer.after(first);
        self
    }

    /// The transform at a time in 0..=1.
    pub(in crate::world) fn at(&self, time: f32) -> Transform {
        let inner = |inner: Transform, (before, path): &(Transform, Arc<AnimatedTransform>)| {
            let moved = path.at(f64::from(time)).after(&inner);
            if before.is_identity() { moved } else { before.after(&moved) }
        };
        self.links.iter().rev().fold(self.innermost, inner)
    }

    /// Bounds over all times of an object with these local bounds, rounded outwards.
    pub(in crate::world) fn bounds(&self, local: Aabb) -> Aabb {
        if local.is_empty() {
            return local;
        }
        let (min, max) = (local.min.as_dvec3(), local.max.as_dvec3());
        let start = around(&self.innermost, (min + max) * 0.5, (max - min) * 0.5);
        let (center, half) = self.links.iter().rev().fold(start, |(center, half), (before, path)| {
            let (center, half) = path.swept(center, half);
            around(before, center, half)
        });
        outwards(center, half)
    }
}

/// A light that moves: its index, its description in its own space, and its transform over time.
#[derive(Clone, Debug)]
pub(in crate::world) struct MovingLight {
    pub(in crate::world) index: u32,
    pub(in crate::world) light: Light,
    pub(in crate::world) chain: TransformChain,
}

impl MovingLight {
    /// The prepared light at a time in 0..=1.
    pub(in crate::world) fn at(&self, time: f32, meshes: &LightMeshes) -> PreparedLight {
        meshes.source(self.light.transformed(&self.chain.at(time)))
    }
}

/// The centre and half size of the box around a transformed box.
pub(in crate::world) fn around(t: &Transform, center: DVec3, half: DVec3) -> (DVec3, DVec3) {
    let m = t.matrix().matrix3;
    (t.point(center), m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z)
}

/// The box in `f32`. It has room, relative to its coordinates, for the rounding of rays that are transformed into the
/// geometry's space.
pub(in crate::world) fn outwards(center: DVec3, half: DVec3) -> Aabb {
    let slack = (center.abs() + half) * f64::from(f32::EPSILON) * 4.0;
    let (low, high): (Vec3, Vec3) = ((center - half - slack).as_vec3(), (center + half + slack).as_vec3());
    Aabb { min: low.map(f32::next_down), max: high.map(f32::next_up) }
}
