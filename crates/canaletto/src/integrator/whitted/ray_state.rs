//! A ray of the ray tree, with its place in the tree.

use crate::integrator::RayKind;
use crate::integrator::media;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Dimension, Sample};
use canaletto_bvh::Ray;

/// Numbers of the uses of random numbers at a hit.
pub(super) mod uses {
    /// The microfacets of rough surfaces, and the rays that leave them.
    pub(in super::super) const REFLECTION_MICROFACET: u32 = 1;
    pub(in super::super) const REFRACTION_MICROFACET: u32 = 2;
    pub(in super::super) const REFLECTED: u32 = 3;
    pub(in super::super) const REFRACTED: u32 = 4;
    pub(in super::super) const PASSED: u32 = 5;
    pub(in super::super) const EYE: u32 = 6;
    /// The first light; each light has a use of its own.
    pub(in super::super) const LIGHTS: u32 = 8;
}

/// A ray to be traced.
pub(super) struct RayState {
    pub(super) ray: Ray,
    /// The ray in `f64`, not rounded and not offset off the surface that it left.
    pub(super) line: DRay,
    pub(super) path_state: PathState,
    /// The source of random numbers.
    pub(super) sample: Sample,
    /// The ray differential, if anything uses it.
    pub(super) differential: Option<RayDifferential>,
}

/// The state of a ray in the ray tree.
#[derive(Clone, Copy)]
pub(super) struct PathState {
    pub(super) kind: RayKind,
    pub(super) depth: u32,
    /// The factor of the ray's colour in the sum of its parent.
    pub(super) attenuation: Rgb,
    /// The product of all attenuations from the eye.
    pub(super) throughput: Rgb,
    /// Whether it has gone straight on from the eye.
    pub(super) is_straight: bool,
    /// The number of surfaces of partial coverage that the path has passed.
    pub(super) passed_surfaces: u32,
    /// The dimension that separates the random numbers here from those elsewhere in the tree.
    pub(super) place: Dimension,
    /// The bodies that the ray is in.
    pub(super) inside: u32,
    /// The coinciding surface at the ray's origin that it crosses before any other surface.
    pub(super) first_crossing: u32,
}

impl PathState {
    /// The state of a camera ray.
    pub(super) const EYE: PathState = PathState {
        kind: RayKind::Eye,
        depth: 1,
        attenuation: Rgb::WHITE,
        throughput: Rgb::WHITE,
        is_straight: true,
        passed_surfaces: 0,
        place: Dimension::EYE.of(uses::EYE),
        inside: media::NONE,
        first_crossing: media::NONE,
    };
}
