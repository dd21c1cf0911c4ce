//! Lambert's diffuse reflection of an opaque surface: f = kd / π.

use super::{BsdfSample, Lobe};
use crate::math::{Rgb, warp};
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Diffuse reflection at a point. Path tracing evaluates eight of them side by side by the same functions.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseBsdf {
    pub(crate) kd: Rgb,
    /// The unit shading normal and the unit geometric normal, both on the viewer's side.
    pub(crate) normal: DVec3,
    pub(crate) facing: DVec3,
}

impl DiffuseBsdf {
    /// f |cos θ|. Directions below the surface or below its shading normal have none.
    #[inline(always)]
    pub(crate) fn eval(&self, wi: DVec3) -> Rgb {
        let cos = self.normal.dot(wi);
        let is_above = (cos > 0.0) & (self.facing.dot(wi) > 0.0);
        // (5.32b)
        let share = if is_above { (cos * FRAC_1_PI) as f32 } else { 0.0 };
        self.kd * share
    }

    #[inline(always)]
    pub(crate) fn pdf(&self, wi: DVec3) -> f64 {
        let cos = self.normal.dot(wi);
        if cos > 0.0 { cos * FRAC_1_PI } else { 0.0 }
    }

    /// The unit direction at `u` of the unit square, with the density of its cosine.
    #[inline(always)]
    pub(crate) fn direction(&self, u: [f64; 2]) -> DVec3 {
        let local = warp::cosine_hemisphere(u);
        let (x, y) = self.normal.any_orthonormal_pair();
        x * local.x + y * local.y + self.normal * local.z
    }

    pub(super) fn sample(&self, u: [f64; 2]) -> Option<BsdfSample> {
        if self.kd.is_black() {
            return None;
        }
        let wi = self.direction(u);
        Some(BsdfSample { wi, f: self.eval(wi), pdf: self.pdf(wi), lobe: Lobe::Diffuse, is_delta: false })
    }
}
