//! Lambert's diffuse reflection of an opaque surface: f = kd / π.

use super::{BsdfSample, Lobe};
use crate::math::{Rgb, Vector, warp};
use canaletto_bvh::lanes::Real64;
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
    pub(crate) fn eval(&self, wi: DVec3) -> Rgb {
        self.kd * diffuse_share::<f64>(self.normal.into(), self.facing.into(), wi.into())
    }

    /// The density of [`DiffuseBsdf::direction`].
    pub(crate) fn pdf(&self, wi: DVec3) -> f64 {
        diffuse_pdf::<f64>(self.normal.into(), wi.into())
    }

    /// The unit direction at `u` of the unit square, with the density of its cosine.
    pub(crate) fn direction(&self, u: [f64; 2]) -> DVec3 {
        diffuse_direction::<f64>(self.normal.into(), u).into()
    }

    pub(super) fn sample(&self, u: [f64; 2]) -> Option<BsdfSample> {
        if self.kd.is_black() {
            return None;
        }
        let wi = self.direction(u);
        Some(BsdfSample { wi, f: self.eval(wi), pdf: self.pdf(wi), lobe: Lobe::Diffuse, is_delta: false })
    }
}

/// f |cos θ| / kd: cos θ / π (5.32b). Directions below the surface or below its shading normal have none.
#[inline(always)]
pub(crate) fn diffuse_share<F: Real64>(normal: Vector<F>, facing: Vector<F>, wi: Vector<F>) -> F::Narrow {
    let (zero, cos) = (F::splat(0.0), normal.dot(wi));
    let is_above = zero.less(cos) & zero.less(facing.dot(wi));
    F::select(is_above, cos * FRAC_1_PI, zero).narrow()
}

/// The density of [`diffuse_direction`].
#[inline(always)]
pub(crate) fn diffuse_pdf<F: Real64>(normal: Vector<F>, wi: Vector<F>) -> F {
    (normal.dot(wi)).max(F::splat(0.0)) * FRAC_1_PI
}

/// The unit direction at `u` of the unit square, with the density of its cosine.
#[inline(always)]
pub(crate) fn diffuse_direction<F: Real64>(normal: Vector<F>, u: [F; 2]) -> Vector<F> {
    let local = warp::cosine_hemisphere_lanes(u);
    let [x, y] = normal.orthonormal_pair();
    x * local.x + y * local.y + normal * local.z
}
