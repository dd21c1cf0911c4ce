//! The chapter's equation (5.39b) as a BSDF.
//!
//! A light of intensity l gives a white matte surface that faces it the radiance l, so that it arrives as an irradiance
//! of π l. The terms of (5.39a) are then π l times
//!
//! f(wo, wi) cos θ = (kd cos θ + ks cosⁿ α) / π,
//!
//! where α is the angle between `wi` and the mirrored direction r (5.37). This is Phong's own form (1975). It is not
//! reciprocal, and f itself is unbounded at cos θ = 0.
//!
//! The height of that highlight doesn't depend on n, so that it returns 2 / (n + 1) of the light that arrives from all
//! sides. It suits point lights, whose intensity is no power. Other light is returned by a lobe of the same shape that
//! is normalised (Lewis, *Making Shaders More Physically Plausible*, 1994): ks times the density (n + 1) / 2π cosⁿ α.
//! Directions into the surface are mirrored out of it, so that nothing is lost. ks is less there where kd, k and 1 − o
//! leave less.
//!
//! The mirrored and the refracted ray carry k and 1 − o, in one direction each where the surface is polished. A rough
//! surface spreads them as the microfacets do: the lobe is the factor times the density of the directions that
//! [`sample_ggx_vndf`] leads to, so nothing is lost.
//!
//! Deviation: light from below the geometric surface gives nothing, while (5.39a) admits it where an interpolated
//! normal leans towards it.

use super::{
    BsdfSample, Lobe, Phong, ScatteringFrame, SpecularTransmission, ggx_vndf_pdf, reflect, reflect_into_hemisphere,
    refract, sample_ggx_vndf,
};
use crate::math::{Rgb, warp};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, TAU};

/// Phong's model at a point.
#[derive(Clone, Copy, Debug)]
pub struct PhongBsdf {
    phong: Phong,
    frame: ScatteringFrame,
    /// The share of light from all sides that the highlight returns.
    gloss: Rgb,
    /// The cumulative sums of the lobes' probabilities, in the order of [`LOBES`]. All are 0 for a black surface.
    sums: [f64; 4],
}

const LOBES: [Lobe; 4] = [Lobe::Diffuse, Lobe::Highlight, Lobe::Mirror, Lobe::Refraction];

impl PhongBsdf {
    pub(super) fn new(phong: Phong, frame: ScatteringFrame) -> PhongBsdf {
        let size = |color: Rgb| f64::from(color.max_component());
        let gloss = gloss(&phong);
        let albedos = [size(phong.kd), size(gloss), size(phong.k), f64::from(1.0 - phong.opacity)];
        let mut total = 0.0;
        let sums = albedos.map(|albedo| {
            total += albedo;
            total
        });
        PhongBsdf { phong, frame, gloss, sums: if total > 0.0 { sums.map(|sum| sum / total) } else { sums } }
    }

    /// The probability of a lobe.
    fn probability(&self, lobe: usize) -> f64 {
        self.sums[lobe] - if lobe == 0 { 0.0 } else { self.sums[lobe - 1] }
    }

    /// Whether a lobe is a single direction.
    fn is_delta_lobe(&self, lobe: Lobe) -> bool {
        match lobe {
            Lobe::Diffuse | Lobe::Highlight => false,
            Lobe::Mirror => self.phong.roughness == 0.0,
            // Between equal media all facets let light pass straight.
            Lobe::Refraction => self.phong.roughness == 0.0 || self.frame.eta_ratio == 1.0,
        }
    }

    pub(super) fn is_delta(&self) -> bool {
        LOBES.iter().enumerate().all(|(i, lobe)| self.probability(i) == 0.0 || self.is_delta_lobe(*lobe))
    }

    /// What passes in one direction.
    pub(super) fn specular_transmission(&self) -> SpecularTransmission {
        if !self.is_delta_lobe(Lobe::Refraction) {
            return SpecularTransmission::NONE;
        }
        let share = Rgb::gray(1.0 - self.phong.opacity);
        SpecularTransmission { share, is_straight: self.frame.eta_ratio == 1.0 }
    }

    /// Whether a direction is on the viewer's side of the surface and of the shading normal.
    fn is_above(&self, wi: DVec3) -> bool {
        self.frame.normal.dot(wi) > 0.0 && self.frame.facing.dot(wi) > 0.0
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Rgb {
        let mut f = Rgb::BLACK;
        if self.is_above(wi) {
            f += self.phong.kd * (self.frame.normal.dot(wi) * FRAC_1_PI) as f32;
        }
        if !self.gloss.is_black() {
            f += self.gloss * self.highlight_pdf(wo, wi) as f32;
        }
        f + self.eval_rough(wo, wi)
    }

    /// [`PhongBsdf::eval`] for the light of a point light, with the chapter's highlight.
    pub(super) fn eval_point_light(&self, wo: DVec3, wi: DVec3) -> Rgb {
        let Phong { kd, ks, n, .. } = self.phong;
        let mut f = Rgb::BLACK;
        if self.is_above(wi) {
            let cosine = reflect(wo, self.frame.normal).dot(wi);
            let highlight = if cosine > 0.0 || n == 0.0 { libm::pow(cosine.max(0.0), n.into()) } else { 0.0 };
            // (5.32b), (5.38)
            f += kd * (self.frame.normal.dot(wi) * FRAC_1_PI) as f32 + ks * (highlight * FRAC_1_PI) as f32;
        }
        f + self.eval_rough(wo, wi)
    }

    /// The mirror and the refraction of a rough surface.
    fn eval_rough(&self, wo: DVec3, wi: DVec3) -> Rgb {
        let Phong { k, opacity, .. } = self.phong;
        let mut f = Rgb::BLACK;
        if !self.is_delta_lobe(Lobe::Mirror) && !k.is_black() {
            f += k * self.mirror_pdf(wo, wi) as f32;
        }
        if !self.is_delta_lobe(Lobe::Refraction) && opacity < 1.0 {
            f += Rgb::gray((f64::from(1.0 - opacity) * self.refraction_pdf(wo, wi)) as f32);
        }
        f
    }

    pub(super) fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let density = |(i, lobe): (usize, &Lobe)| match self.probability(i) {
            0.0 => 0.0,
            _ if self.is_delta_lobe(*lobe) => 0.0,
            probability => {
                probability
                    * match lobe {
                        Lobe::Diffuse => self.frame.normal.dot(wi).max(0.0) * FRAC_1_PI,
                        Lobe::Highlight => self.highlight_pdf(wo, wi),
                        Lobe::Mirror => self.mirror_pdf(wo, wi),
                        Lobe::Refraction => self.refraction_pdf(wo, wi),
                    }
            }
        };
        LOBES.iter().enumerate().map(density).sum()
    }

    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let i = self.sums.iter().position(|sum| u_lobe < *sum)?;
        let lobe = LOBES[i];
        let wi = match lobe {
            Lobe::Diffuse => around(self.frame.normal, warp::cosine_hemisphere(u)),
            Lobe::Highlight => {
                let cos = libm::pow(1.0 - u[0], 1.0 / (f64::from(self.phong.n) + 1.0));
                let (sin, across) = (libm::sincos(TAU * u[1]), (1.0 - cos * cos).max(0.0).sqrt());
                let wi = around(self.highlight_axis(wo), DVec3::new(sin.1 * across, sin.0 * across, cos));
                reflect_into_hemisphere(wi, self.frame.facing)
            }
            Lobe::Mirror => self.reflected(wo, self.microfacet(wo, u)),
            Lobe::Refraction if self.frame.eta_ratio == 1.0 => -wo,
            Lobe::Refraction => {
                let microfacet = self.microfacet(wo, u);
                match refract(wo, microfacet.unwrap_or(self.frame.normal), self.frame.eta_ratio) {
                    Some(wi) if microfacet.is_some() => reflect_into_hemisphere(wi, -self.frame.facing),
                    Some(wi) if wi.dot(self.frame.facing) < 0.0 => wi,
                    Some(_) => refract(wo, self.frame.facing, self.frame.eta_ratio).unwrap_or(-self.frame.facing),
                    None => self.reflected(wo, microfacet),
                }
            }
        };
        if self.is_delta_lobe(lobe) {
            let f = if lobe == Lobe::Mirror { self.phong.k } else { Rgb::gray(1.0 - self.phong.opacity) };
            return Some(BsdfSample { wi, f, pdf: self.probability(i), lobe, is_delta: true });
        }
        Some(BsdfSample { wi, f: self.eval(wo, wi), pdf: self.pdf(wo, wi), lobe, is_delta: false })
    }

    /// A random microfacet's normal, if the surface is rough.
    fn microfacet(&self, wo: DVec3, u: [f64; 2]) -> Option<DVec3> {
        let roughness = f64::from(self.phong.roughness);
        (roughness > 0.0).then(|| sample_ggx_vndf(wo, self.frame.facet_normal(wo), roughness, u))
    }

    /// The direction mirrored in a microfacet, or in the smooth surface. It stays above the geometric surface.
    fn reflected(&self, wo: DVec3, microfacet: Option<DVec3>) -> DVec3 {
        let ScatteringFrame { normal, facing, .. } = self.frame;
        match microfacet {
            Some(microfacet) => reflect_into_hemisphere(reflect(wo, microfacet), facing),
            None if reflect(wo, normal).dot(facing) > 0.0 => reflect(wo, normal),
            None => reflect(wo, facing),
        }
    }

    /// The axis of the highlight's directions. With the exponent 0 it has the same brightness on the whole hemisphere.
    fn highlight_axis(&self, wo: DVec3) -> DVec3 {
        if self.phong.n == 0.0 { self.frame.normal } else { reflect(wo, self.frame.normal) }
    }

    /// The density (n + 1) / 2π cosⁿ α, folded.
    fn highlight_pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (axis, n) = (self.highlight_axis(wo), f64::from(self.phong.n));
        self.folded(wi, 1.0, |wi| {
            let cosine = axis.dot(wi);
            if cosine > 0.0 { (n + 1.0) / TAU * libm::pow(cosine, n) } else { 0.0 }
        })
    }

    /// The density of directions mirrored in a microfacet.
    fn mirror_pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        self.folded(wi, 1.0, |wi| self.facet_mirror_pdf(wo, wi, false))
    }

    /// The density of directions refracted, or totally reflected, by a microfacet.
    fn refraction_pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        self.folded(wi, -1.0, |wi| self.facet_refraction_pdf(wo, wi))
            + self.folded(wi, 1.0, |wi| self.facet_mirror_pdf(wo, wi, true))
    }

    /// The density on one side of the surface, +1 or −1, where directions to the other side are mirrored to this one.
    fn folded(&self, wi: DVec3, side: f64, density: impl Fn(DVec3) -> f64) -> f64 {
        let facing = self.frame.facing;
        if wi.dot(facing) * side <= 0.0 {
            return 0.0;
        }
        density(wi) + density(wi - facing * (2.0 * wi.dot(facing)))
    }

    /// The density of directions mirrored in a microfacet, before folding: dω_m / dω_i = 1 / (4 wo·m). Of total
    /// reflections only, if asked for.
    fn facet_mirror_pdf(&self, wo: DVec3, wi: DVec3, total: bool) -> f64 {
        let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
        let cos = wo.dot(m);
        if total && self.frame.eta_ratio * self.frame.eta_ratio * (1.0 - cos * cos) < 1.0 {
            return 0.0;
        }
        ggx_vndf_pdf(wo, self.frame.facet_normal(wo), self.phong.roughness.into(), m) / (4.0 * cos)
    }

    /// The density of directions refracted by a microfacet, before folding (Walter et al. 2007, (16) and (17)).
    fn facet_refraction_pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (ratio, normal) = (self.frame.eta_ratio, self.frame.facet_normal(wo));
        let Some(m) = (wo * ratio + wi).try_normalize() else { return 0.0 };
        let m = if m.dot(normal) < 0.0 { -m } else { m };
        let (o, i) = (wo.dot(m), wi.dot(m));
        if o <= 0.0 || i >= 0.0 {
            return 0.0;
        }
        let jacobian = -i / ((ratio * o + i) * (ratio * o + i));
        ggx_vndf_pdf(wo, normal, self.phong.roughness.into(), m) * jacobian
    }
}

/// The highlight's albedo: ks, made smaller so that no more light leaves than arrives.
fn gloss(phong: &Phong) -> Rgb {
    let Phong { kd, ks, k, opacity, .. } = *phong;
    let left = (Rgb::WHITE - kd - k - Rgb::gray(1.0 - opacity)).to_array();
    let scale = ks.to_array().into_iter().zip(left).filter(|(ks, _)| *ks > 0.0).map(|(ks, left)| left / ks);
    ks * scale.fold(1.0, f32::min).max(0.0)
}

/// The direction with these coordinates in a frame around the unit vector `z`.
fn around(z: DVec3, local: DVec3) -> DVec3 {
    let (x, y) = z.any_orthonormal_pair();
    x * local.x + y * local.y + z * local.z
}

#[cfg(test)]
mod tests;
