//! A ray's line in `f64`.

use super::Transform;
use canaletto_bvh::Ray;
use glam::DVec3;

/// A ray before it was rounded to `f32` and moved off the surface that it left.
///
/// Hierarchies and the first stage of a hit use the rounded [`Ray`]. The second stage computes its point on this line,
/// so that neither rounding nor offset accumulates from one mirror to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DRay {
    /// The origin of the line.
    pub origin: DVec3,
    /// The direction, of any length.
    pub direction: DVec3,
}

impl DRay {
    /// The ray along this line from another origin near its own.
    #[inline]
    pub fn from_origin(&self, origin: glam::Vec3) -> Ray {
        Ray { origin, direction: self.direction.as_vec3() }
    }

    /// The size of the direction's largest component.
    #[inline(always)]
    pub(crate) fn longest(&self) -> f64 {
        self.direction.abs().max_element()
    }

    /// The line in the space that `to_world` maps to the world.
    pub(crate) fn to_local(self, to_world: &Transform) -> DRay {
        let back = to_world.inverse();
        DRay { origin: back.point(self.origin), direction: back.vector(self.direction) }
    }

    /// The rounded ray.
    #[inline]
    pub fn rounded(&self) -> Ray {
        self.from_origin(self.origin.as_vec3())
    }
}

impl From<&Ray> for DRay {
    #[inline]
    fn from(ray: &Ray) -> DRay {
        DRay { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3() }
    }
}
