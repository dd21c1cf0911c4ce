//! Interactions of rays with surfaces.

use super::ray_state::PathState;
use crate::material::{MaterialPoint, reflect};
use crate::math::{DRay, RayDifferential, offset_origin};
use crate::sampler::Sample;
use crate::shape::Surface;
use crate::world::Hit;
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3, Vec3};

/// An interaction of one ray: the first surface that it sees, with everything that shading asks of it.
pub(super) struct SurfaceInteraction<'a> {
    pub(super) hit: &'a Hit,
    pub(super) material: &'a MaterialPoint,
    pub(super) frame: Frame,
    pub(super) footprint: Option<&'a Footprint>,
    /// The bodies that the ray is in.
    pub(super) inside: u32,
    /// The crossing for rays into a clear body, with the coinciding surfaces, or [`media::NONE`](super::media::NONE).
    pub(super) crossing: u32,
    /// The state of the ray.
    pub(super) path_state: PathState,
    /// The source of random numbers of the ray.
    pub(super) sample: &'a Sample,
}

/// The directions and points at an interaction. Normals and directions have unit length.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    /// Whether the ray hit the outer side.
    pub(super) outside: bool,
    /// v̂, the direction back along the ray.
    pub(super) wo: DVec3,
    /// The geometric normal on the outer side.
    pub(super) outer: DVec3,
    /// The geometric normal on the viewer's side.
    pub(super) facing: DVec3,
    /// n, the shading normal on the viewer's side.
    pub(super) normal: DVec3,
    /// r, the mirrored direction (5.37).
    pub(super) mirrored: DVec3,
    /// The point before rounding.
    pub(super) exact: DVec3,
    /// The point and its error bound.
    pub(super) point: Vec3,
    pub(super) error: Vec3,
    /// The origin of shadow rays.
    pub(super) start: Vec3,
}

impl Frame {
    /// The frame of a ray in this direction that hits a surface.
    #[inline(always)]
    pub(super) fn new(direction: DVec3, surface: &Surface) -> Frame {
        let Surface { point, exact, error, normal: outer, shading_normal, shadow_origin, .. } = *surface;
        let outside = direction.dot(outer) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let (wo, facing, normal) = (-direction.normalize(), outer * side, shading_normal * side);
        let start = offset_origin(if outside { shadow_origin } else { point }, error, facing, facing);
        Frame { outside, wo, outer, facing, normal, mirrored: reflect(wo, normal), exact, point, error, start }
    }

    /// The `f64` ray that leaves the surface in a direction.
    #[inline]
    pub(super) fn leave(&self, direction: DVec3) -> DRay {
        DRay { origin: self.exact, direction }
    }

    /// The rounded ray of `line`, its origin moved off the surface by the error bound.
    #[inline]
    pub(super) fn rounded(&self, line: &DRay) -> Ray {
        line.from_origin(offset_origin(self.point, self.error, self.outer, line.direction))
    }
}

/// The first surface that a ray sees, past holes and past surfaces that another body hides.
pub(super) struct VisibleHit {
    pub(super) hit: Hit,
    pub(super) surface: Surface,
    pub(super) material: MaterialPoint,
    /// The ray's line, whose origin moves to each hole that it passes.
    pub(super) line: DRay,
    pub(super) footprint: Option<Footprint>,
    /// The bodies that the ray is in at the hit.
    pub(super) inside: u32,
    pub(super) crossing: u32,
}

/// The differential of the arriving ray, and its effect at the surface.
#[derive(Clone, Copy)]
pub(super) struct Footprint {
    /// The differential of the arriving ray.
    pub(super) differential: RayDifferential,
    /// The offsets along the surface to the hits of the neighbouring rays.
    pub(super) step: [DVec3; 2],
    /// The derivative of the shading normal along the surface; zero where nothing needs it.
    pub(super) shape_operator: DMat3,
}

impl Footprint {
    pub(super) fn new(differential: Option<&RayDifferential>, line: &DRay, surface: &Surface) -> Option<Footprint> {
        differential.map(|differential| Footprint {
            differential: *differential,
            step: differential.along(line, surface.exact, surface.normal),
            shape_operator: DMat3::ZERO,
        })
    }
}
