//! Clear bodies as light has them: Fresnel's share is mirrored, the rest is refracted, at a smooth boundary or at GGX
//! microfacets (Walter et al. 2007). Light that goes from facet to facet is given back on both sides, so that a rough
//! boundary loses nothing, either. The whole is reciprocal.

use super::bsdf::mirrored_at;
use super::dielectric_albedo::{DielectricAlbedo, GivenBack};
use super::ggx::{Ggx, on_circle};
use super::{
    BsdfSample, Lobe, MaterialPoint, Phong, ScatteringFrame, SpecularTransmission, fresnel_dielectric, reflect, refract,
};
use crate::math::Rgb;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_PI;

/// A clear body whose boundary obeys Fresnel's equations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dielectric {
    /// The coefficient of refraction η > 0.
    pub eta: f32,
    /// The roughness r, 0 (polished) to 1; α = r².
    #[serde(default)]
    pub roughness: f32,
    /// The radiance that the surface emits by itself ([`Phong::emission`]).
    #[serde(default)]
    pub emission: Rgb,
}

impl Dielectric {
    /// A polished clear body with this η.
    pub fn new(eta: f32) -> Dielectric {
        Dielectric { eta, roughness: 0.0, emission: Rgb::BLACK }
    }

    /// The clear body that comes nearest, for integrators without this model.
    pub(super) fn classic(&self) -> Phong {
        let Dielectric { eta, roughness, emission, .. } = *self;
        let mirrored = fresnel_dielectric(1.0, 1.0 / f64::from(eta)) as f32;
        let (k, opacity) = (Rgb::gray(mirrored), mirrored);
        Phong { kd: Rgb::BLACK, k, eta, opacity, roughness, emission, ..Phong::default() }
    }
}

/// The boundary of a clear body at a point.
#[derive(Clone, Copy, Debug)]
pub struct DielectricBsdf {
    alpha: f64,
    frame: ScatteringFrame,
}

impl DielectricBsdf {
    pub(super) fn new(point: &MaterialPoint, frame: ScatteringFrame) -> DielectricBsdf {
        let roughness = f64::from(point.classic.roughness);
        DielectricBsdf { alpha: roughness * roughness, frame }
    }

    /// Whether both sides have one η, so that nothing is mirrored or bent.
    pub fn is_index_matched(&self) -> bool {
        self.frame.eta_ratio == 1.0
    }

    #[cfg(test)]
    pub(super) fn eta_ratio(&self) -> f64 {
        self.frame.eta_ratio
    }

    pub(super) fn is_delta(&self) -> bool {
        self.alpha == 0.0 || self.is_index_matched()
    }

    /// Radiance is squeezed with the solid angle where light enters a denser medium: (ηₒ/ηᵢ)².
    fn radiance_scale(&self, above: bool) -> f64 {
        if above { 1.0 } else { self.frame.eta_ratio * self.frame.eta_ratio }
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
        let wi = if stays { wi } else { mirrored_at(facing, wi) };
        let f = Rgb::gray((pdf * self.radiance_scale(wi.dot(facing) > 0.0)) as f32);
        Some(BsdfSample { wi, f, pdf, lobe, is_delta: true })
    }
}

/// The boundary of a clear body at a point, as it is seen from one direction.
pub(crate) struct SeenDielectric {
    bsdf: DielectricBsdf,
    wo: DVec3,
    /// The facets of a rough boundary.
    facets: Option<BoundaryFacets>,
}

/// The facets of a rough boundary as they are seen from one direction.
struct BoundaryFacets {
    ggx: Ggx,
    eta_ratio: f64,
    /// The axes of the facets as columns, and the viewer's direction in them.
    axes: DMat3,
    wo: DVec3,
    albedo: DielectricAlbedo,
    /// The light that one scattering loses from the viewer's direction.
    lost: f64,
    /// How lost light is given back.
    back: GivenBack,
}

impl BoundaryFacets {
    /// The density of `wi` over all facets that the viewer sees, each of which mirrors or refracts by Fresnel's share.
    /// The direction is in the frame of the facets.
    fn pdf(&self, wi: DVec3) -> f64 {
        let (wo, ratio, above) = (self.wo, self.eta_ratio, wi.z > 0.0);
        let m = if above { wo + wi } else { wo * ratio + wi };
        let Some(m) = m.try_normalize() else { return 0.0 };
        let m = if m.z < 0.0 { -m } else { m };
        let (o, i) = (wo.dot(m), wi.dot(m));
        if o <= 0.0 || (i > 0.0) != above {
            return 0.0;
        }
        let (mirrored, visible) = (fresnel_dielectric(o, ratio), self.ggx.visible_pdf(wo, m));
        if above {
            mirrored * visible / (4.0 * o)
        } else {
            // Walter (17): dω_m / dω_i
            (1.0 - mirrored) * visible * -i / ((ratio * o + i) * (ratio * o + i))
        }
    }
}

impl SeenDielectric {
    pub(super) fn new(bsdf: DielectricBsdf, wo: DVec3) -> SeenDielectric {
        let facets = (!bsdf.is_delta()).then(|| {
            let axes = bsdf.frame.facet_axes(wo);
            let local = axes.transpose() * wo;
            let (ggx, eta_ratio) = (Ggx::isotropic(bsdf.alpha), bsdf.frame.eta_ratio);
            let albedo = DielectricAlbedo::new(eta_ratio, bsdf.alpha);
            let (lost, back) = (albedo.lost(local.z, true), albedo.given_back());
            BoundaryFacets { ggx, eta_ratio, axes, wo: local, albedo, lost, back }
        });
        SeenDielectric { bsdf, wo, facets }
    }

    /// Whether both sides have one η, so that nothing is mirrored or bent.
    fn is_index_matched(&self) -> bool {
        self.bsdf.is_index_matched()
    }

    /// What passes in one direction.
    pub(super) fn specular_transmission(&self) -> SpecularTransmission {
        if self.facets.is_some() {
            return SpecularTransmission::NONE;
        }
        let (frame, is_straight) = (&self.bsdf.frame, self.is_index_matched());
        let ratio = frame.eta_ratio.min(1.0 / frame.eta_ratio);
        let cos = self.wo.dot(frame.facet_normal(self.wo));
        let passed = if is_straight { 1.0 } else { 1.0 - fresnel_dielectric(cos, ratio) };
        SpecularTransmission { share: Rgb::gray(passed as f32), is_straight }
    }

    /// f |cos θ| and the density, whose costly parts are the same.
    pub(super) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        let Some(facets) = &self.facets else { return (Rgb::BLACK, 0.0) };
        let above = wi.dot(self.bsdf.frame.facing) > 0.0;
        let BoundaryFacets { albedo, lost, back, .. } = facets;
        let (share, loss) = if above { (back.mirrored, back.losses[0]) } else { (1.0 - back.mirrored, back.losses[1]) };
        let [f, pdf] = self.both(facets, wi, |i| {
            let density = facets.pdf(i);
            let single = density * facets.ggx.shadowing(facets.wo, i);
            let again = lost * share * albedo.lost(i.z.abs(), above) / loss * i.z.abs() * FRAC_1_PI;
            [single + again, density * (1.0 - lost) + lost * share * albedo.lost_pdf(i.z.abs(), above)]
        });
        (Rgb::gray((f * self.bsdf.radiance_scale(above)) as f32), pdf)
    }

    /// The sum of a function over the directions of the facets' own frame that lead to a direction: itself, and the one
    /// that is mirrored at the geometric surface.
    fn both(&self, facets: &BoundaryFacets, wi: DVec3, of: impl Fn(DVec3) -> [f64; 2]) -> [f64; 2] {
        let facing = self.bsdf.frame.facing;
        let above = wi.dot(facing) > 0.0;
        let one = |wi: DVec3| {
            let i = facets.axes.transpose() * wi;
            if (i.z > 0.0) == above { of(i) } else { [0.0; 2] }
        };
        let [f, pdf] = one(wi);
        if self.bsdf.frame.is_bent() {
            let mirrored = one(mirrored_at(facing, wi));
            return [f + mirrored[0], pdf + mirrored[1]];
        }
        [f, pdf]
    }

    pub(super) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let (wo, ratio) = (self.wo, self.bsdf.frame.eta_ratio);
        if self.is_index_matched() {
            return Some(BsdfSample { wi: -wo, f: Rgb::WHITE, pdf: 1.0, lobe: Lobe::Refraction, is_delta: true });
        }
        let Some(facets) = &self.facets else { return self.bsdf.smooth(wo, u_lobe) };
        let BoundaryFacets { ggx, wo: o, albedo, lost, back, .. } = facets;
        // The lobe of lost light, or a facet.
        let (is_mirrored, i) = if u_lobe < *lost {
            let is_mirrored = u_lobe < lost * back.mirrored;
            let cos = albedo.sample_lost(u[1], is_mirrored);
            let z = if is_mirrored { cos } else { -cos };
            (is_mirrored, (on_circle(u[0]) * (1.0 - cos * cos).max(0.0).sqrt()).extend(z))
        } else {
            let m = DVec3::from(ggx.sample_visible(*o, u));
            let is_mirrored = (u_lobe - lost) / (1.0 - lost) < fresnel_dielectric(o.dot(m), ratio);
            (is_mirrored, if is_mirrored { reflect(*o, m) } else { refract(*o, m, ratio)? })
        };
        if (i.z > 0.0) != is_mirrored {
            return None;
        }
        let (wi, facing) = ((facets.axes * i).normalize(), self.bsdf.frame.facing);
        let wi = if (wi.dot(facing) > 0.0) == is_mirrored { wi } else { mirrored_at(facing, wi) };
        let lobe = if is_mirrored { Lobe::Mirror } else { Lobe::Refraction };
        let (f, pdf) = self.eval_and_pdf(wi);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe, is_delta: false })
    }
}

#[cfg(test)]
mod tests;
