//! Clear bodies as light has them: Fresnel's share is mirrored, the rest is refracted, at a smooth boundary or at GGX
//! microfacets (Walter et al. 2007). Light that goes from facet to facet is given back on both sides, so that a rough
//! boundary loses nothing, either. The whole is reciprocal.

use super::dielectric_albedo::DielectricAlbedo;
use super::ggx::Ggx;
use super::{BsdfSample, Lobe, MicrofacetOptions, Phong, ScatteringFrame, fresnel_dielectric, reflect, refract};
use crate::OutOfRange;
use crate::math::{Rgb, warp};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_PI;

/// A clear body whose boundary obeys Fresnel's equations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dielectric {
    /// Options of the scattering by microfacets.
    #[serde(default)]
    pub microfacets: MicrofacetOptions,
    /// What integrators without this model take in its place. Its η and roughness are those of the body, too.
    pub phong: Phong,
}

impl Dielectric {
    /// A clear body with this η.
    pub fn new(eta: f32) -> Dielectric {
        let mirrored = fresnel_dielectric(1.0, 1.0 / f64::from(eta)) as f32;
        let phong = Phong { kd: Rgb::BLACK, k: Rgb::gray(mirrored), eta, opacity: mirrored, ..Phong::default() };
        Dielectric { microfacets: MicrofacetOptions::default(), phong }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.phong.check()
    }
}

/// The boundary of a clear body at a point.
#[derive(Clone, Copy, Debug)]
pub struct DielectricBsdf {
    alpha: f64,
    microfacets: MicrofacetOptions,
    frame: ScatteringFrame,
}

impl DielectricBsdf {
    pub(super) fn new(dielectric: &Dielectric, frame: ScatteringFrame) -> DielectricBsdf {
        let roughness = f64::from(dielectric.phong.roughness);
        DielectricBsdf { alpha: roughness * roughness, microfacets: dielectric.microfacets, frame }
    }

    /// Whether both sides have one η, so that nothing is mirrored or bent.
    pub fn is_index_matched(&self) -> bool {
        self.frame.eta_ratio == 1.0
    }

    pub(super) fn is_delta(&self) -> bool {
        self.alpha == 0.0 || self.is_index_matched()
    }

    fn ggx(&self) -> Ggx {
        Ggx::isotropic(self.alpha, self.microfacets.masking)
    }

    fn albedo(&self) -> Option<DielectricAlbedo> {
        let options = self.microfacets;
        options.multiple_scattering.then(|| DielectricAlbedo::new(self.frame.eta_ratio, self.alpha, options.masking))
    }

    /// Whether a direction is on the viewer's side of the surface; none if the shading normal says otherwise.
    fn is_above(&self, wi: DVec3, local: DVec3) -> Option<bool> {
        let above = wi.dot(self.frame.facing) > 0.0;
        ((local.z > 0.0) == above).then_some(above)
    }

    /// The density of `wi` over all facets that the viewer sees, each of which mirrors or refracts by Fresnel's share.
    /// The directions are in the frame of the facets.
    fn facet_pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (ggx, ratio, above) = (self.ggx(), self.frame.eta_ratio, wi.z > 0.0);
        let m = if above { wo + wi } else { wo * ratio + wi };
        let Some(m) = m.try_normalize() else { return 0.0 };
        let m = if m.z < 0.0 { -m } else { m };
        let (o, i) = (wo.dot(m), wi.dot(m));
        if o <= 0.0 || (i > 0.0) != above {
            return 0.0;
        }
        let (mirrored, visible) = (fresnel_dielectric(o, ratio), ggx.visible_pdf(wo, m));
        if above {
            mirrored * visible / (4.0 * o)
        } else {
            // Walter (17): dω_m / dω_i
            (1.0 - mirrored) * visible * -i / ((ratio * o + i) * (ratio * o + i))
        }
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Rgb {
        if self.is_delta() {
            return Rgb::BLACK;
        }
        let axes = self.frame.facet_axes(wo).transpose();
        let (o, i) = (axes * wo, axes * wi);
        let Some(above) = self.is_above(wi, i) else { return Rgb::BLACK };
        let mut f = self.facet_pdf(o, i) * self.ggx().shadowing(o, i);
        if let Some(albedo) = self.albedo() {
            let back = albedo.given_back();
            let (share, loss) =
                if above { (back.mirrored, back.losses[0]) } else { (1.0 - back.mirrored, back.losses[1]) };
            f += albedo.lost(o.z, true) * share * albedo.lost(i.z.abs(), above) / loss * i.z.abs() * FRAC_1_PI;
        }
        Rgb::gray((f * self.radiance_scale(above)) as f32)
    }

    /// Radiance is squeezed with the solid angle where light enters a denser medium: (ηₒ/ηᵢ)².
    fn radiance_scale(&self, above: bool) -> f64 {
        if above { 1.0 } else { self.frame.eta_ratio * self.frame.eta_ratio }
    }

    pub(super) fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if self.is_delta() {
            return 0.0;
        }
        let axes = self.frame.facet_axes(wo).transpose();
        let (o, i) = (axes * wo, axes * wi);
        let Some(above) = self.is_above(wi, i) else { return 0.0 };
        let single = self.facet_pdf(o, i);
        let Some(albedo) = self.albedo() else { return single };
        let (lost, mirrored) = (albedo.lost(o.z, true), albedo.given_back().mirrored);
        let share = if above { mirrored } else { 1.0 - mirrored };
        single * (1.0 - lost) + lost * share * i.z.abs() * FRAC_1_PI
    }

    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let ratio = self.frame.eta_ratio;
        if self.is_index_matched() {
            return Some(BsdfSample { wi: -wo, f: Rgb::WHITE, pdf: 1.0, lobe: Lobe::Refraction, is_delta: true });
        }
        if self.is_delta() {
            return self.smooth(wo, u_lobe);
        }
        let axes = self.frame.facet_axes(wo);
        let o = axes.transpose() * wo;
        // The lobe of lost light, or a facet.
        let (mut lost, mut lost_mirrored) = (0.0, 0.0);
        if let Some(albedo) = self.albedo() {
            lost = albedo.lost(o.z, true);
            lost_mirrored = lost * albedo.given_back().mirrored;
        }
        let (is_mirrored, i) = if u_lobe < lost {
            let is_mirrored = u_lobe < lost_mirrored;
            let i = warp::cosine_hemisphere(u);
            (is_mirrored, if is_mirrored { i } else { -i })
        } else {
            let m = self.ggx().sample_visible(o, u);
            let is_mirrored = (u_lobe - lost) / (1.0 - lost) < fresnel_dielectric(o.dot(m), ratio);
            (is_mirrored, if is_mirrored { reflect(o, m) } else { refract(o, m, ratio)? })
        };
        let wi = (axes * i).normalize();
        if (wi.dot(self.frame.facing) > 0.0) != is_mirrored {
            return None;
        }
        let lobe = if is_mirrored { Lobe::Mirror } else { Lobe::Refraction };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, f: self.eval(wo, wi), pdf, lobe, is_delta: false })
    }

    /// The direction mirrored or refracted by a smooth boundary.
    fn smooth(&self, wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        let (ratio, facing, normal) = (self.frame.eta_ratio, self.frame.facing, self.frame.facet_normal(wo));
        let mirrored = fresnel_dielectric(wo.dot(normal), ratio);
        let is_mirrored = u_lobe < mirrored;
        let (lobe, pdf) = if is_mirrored { (Lobe::Mirror, mirrored) } else { (Lobe::Refraction, 1.0 - mirrored) };
        let bent = |m: DVec3| if is_mirrored { Some(reflect(wo, m)) } else { refract(wo, m, ratio) };
        let wi = bent(normal)?;
        let stays = (wi.dot(facing) > 0.0) == is_mirrored;
        let wi = if stays { wi } else { bent(facing).unwrap_or(-facing) };
        let f = Rgb::gray((pdf * self.radiance_scale(wi.dot(facing) > 0.0)) as f32);
        Some(BsdfSample { wi, f, pdf, lobe, is_delta: true })
    }
}

#[cfg(test)]
#[path = "dielectric_tests.rs"]
mod tests;
