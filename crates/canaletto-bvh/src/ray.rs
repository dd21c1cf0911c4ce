//! Rays.

use glam::{DVec3, Vec3};

use crate::Aabb;
use crate::slab::Slabs;
use crate::triangle::Shear;

/// The points `origin + t * direction`, t > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0.
    pub origin: Vec3,
    /// The way of growing t; of any length.
    pub direction: Vec3,
}

impl Ray {
    /// The ray from `origin` along `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction }
    }

    /// The point at `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }

    /// The ray, ready for trees and kernels.
    pub fn prepare(&self) -> PreparedRay {
        PreparedRay::new(self)
    }
}

/// A ray with all that trees and kernels want to know about it, computed once for any number of them.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// The ray itself.
    pub ray: Ray,
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// The direction's squared length.
    pub(crate) squared: f64,
    pub(crate) slabs: Slabs,
    pub(crate) shear: Shear,
}

impl PreparedRay {
    /// Prepares `ray`.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        let slabs = Slabs::new(ray);
        Self {
            ray: *ray,
            origin: ray.origin.as_dvec3(),
            direction,
            squared: direction.dot(direction),
            slabs,
            shear: Shear::new(ray, &slabs),
        }
    }

    /// Whether the ray meets a box within (0, t_max], as trees ask it: true in doubt.
    #[inline]
    pub fn enters(&self, bounds: &Aabb, t_max: f32) -> bool {
        self.slabs.enters(bounds, t_max)
    }

    /// The hit at `t` on something in this box, moved into it by no more than rounding explains, so that no tree over such boxes can lose it; `None`
    /// if the ray misses the box or the hit lies outside (0, t_max].
    #[inline]
    pub fn confine(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        self.slabs.confine(bounds, t, t_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_lies_t_directions_from_the_origin() {
        let ray = Ray::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, -2.0, 4.0));
        assert_eq!(ray.at(0.5), Vec3::new(1.0, 1.0, 5.0));
    }
}
