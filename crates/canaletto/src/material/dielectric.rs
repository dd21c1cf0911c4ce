//! Clear bodies as light has them: Fresnel's share is mirrored, the rest is refracted, at a smooth boundary or at GGX
//! microfacets (Walter et al. 2007). Light that goes from facet to facet is given back on both sides, so that a rough
//! boundary loses nothing, either. The whole is reciprocal.

use super::bsdf::{mirrored_at, mirrored_directions};
use super::dielectric_albedo::{DielectricAlbedo, GivenBack};
use super::fresnel::fresnel_dielectrics;
use super::ggx::{Ggx, on_circle};
use super::{
    BsdfSample, Lobe, MaterialPoint, Phong, ScatteringFrame, SpecularTransmission, fresnel_dielectric, reflect, refract,
};
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{LANES, LaneKernel, Mask, Real, Real64};
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
pub(crate) struct BoundaryFacets {
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

/// A rough boundary in each lane, as it is seen from one direction.
struct Boundaries<'a, F: Real64> {
    albedo: [&'a DielectricAlbedo; LANES],
    ggx: Ggx<F>,
    eta_ratio: F,
    /// The axes of the facets, and the viewer's direction in them.
    axes: [Vector<F>; 3],
    wo: Vector<F>,
    /// The light that one scattering loses, the share of it that is mirrored, and the losses of both sides.
    lost: F,
    mirrored: F,
    losses: [F; 2],
    /// The geometric normal on the viewer's side, and where it isn't the shading normal.
    facing: Vector<F>,
    bent: F::Mask,
}

impl<'a, F: Real64> Boundaries<'a, F> {
    /// The boundary that a function gives for each lane, with its facets.
    #[inline(always)]
    fn gather(of_lane: impl Fn(usize) -> (&'a DielectricBsdf, &'a BoundaryFacets)) -> Boundaries<'a, F> {
        let facets = |lane: usize| of_lane(lane).1;
        let frame = |lane: usize| of_lane(lane).0.frame;
        let mut albedo = [&facets(0).albedo; LANES];
        for (lane, of) in albedo[..F::COUNT].iter_mut().enumerate() {
            *of = &facets(lane).albedo;
        }
        Boundaries {
            albedo,
            ggx: Ggx::isotropic(F::gather(|lane| facets(lane).ggx.alpha[0])),
            eta_ratio: F::gather(|lane| facets(lane).eta_ratio),
            axes: [
                Vector::gather(|lane| facets(lane).axes.x_axis),
                Vector::gather(|lane| facets(lane).axes.y_axis),
                Vector::gather(|lane| facets(lane).axes.z_axis),
            ],
            wo: Vector::gather(|lane| facets(lane).wo),
            lost: F::gather(|lane| facets(lane).lost),
            mirrored: F::gather(|lane| facets(lane).back.mirrored),
            losses: [F::gather(|lane| facets(lane).back.losses[0]), F::gather(|lane| facets(lane).back.losses[1])],
            facing: Vector::gather(|lane| frame(lane).facing),
            bent: F::Mask::gather(|lane| frame(lane).is_bent()),
        }
    }

    /// f |cos θ| and the density, whose costly parts are the same.
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (F::Narrow, F) {
        let one = F::splat(1.0);
        let above = F::splat(0.0).less(wi.dot(self.facing));
        let (mut f, mut pdf) = self.of_direction(wi, above);
        // The direction that is mirrored at the geometric surface leads there, too.
        if self.bent.any() {
            let (again, again_pdf) = self.of_direction(mirrored_directions(self.facing, wi), above);
            f = F::select(self.bent, f + again, f);
            pdf = F::select(self.bent, pdf + again_pdf, pdf);
        }
        // Radiance is squeezed with the solid angle where light enters a denser medium: (ηₒ/ηᵢ)².
        ((f * F::select(above, one, self.eta_ratio * self.eta_ratio)).narrow(), pdf)
    }

    /// What facets send to a direction, and the density there, if it is on the right side of them.
    #[inline(always)]
    fn of_direction(&self, wi: Vector<F>, above: F::Mask) -> (F, F) {
        let (zero, one, [x, y, z]) = (F::splat(0.0), F::splat(1.0), self.axes);
        let i = Vector { x: x.dot(wi), y: y.dot(wi), z: z.dot(wi) };
        let is_up = zero.less(i.z);
        let is_right = (is_up & above) | (!is_up & !above);
        let share = F::select(above, self.mirrored, one - self.mirrored);
        let loss = F::select(above, self.losses[0], self.losses[1]);
        let cos = i.z.abs();
        let (cosines, bits) = (cos.to_array(), (above.bits(), is_right.bits()));
        let (mut lost, mut lost_pdf) = ([0.0; LANES], [0.0; LANES]);
        for lane in (0..F::COUNT).filter(|lane| bits.1 >> lane & 1 == 1) {
            let above = bits.0 >> lane & 1 == 1;
            lost[lane] = self.albedo[lane].lost(cosines[lane], above);
            lost_pdf[lane] = self.albedo[lane].lost_pdf(cosines[lane], above);
        }
        let density = self.pdf_of_facets(i);
        let single = density * self.ggx.shadowing(self.wo, i);
        let again = self.lost * share * F::load(&lost) / loss * cos * FRAC_1_PI;
        let pdf = density * (one - self.lost) + self.lost * share * F::load(&lost_pdf);
        (F::select(is_right, single + again, zero), F::select(is_right, pdf, zero))
    }

    /// The density of `wi` over all facets that the viewer sees, each of which mirrors or refracts by Fresnel's share.
    /// The direction is in the frame of the facets.
    #[inline(always)]
    fn pdf_of_facets(&self, wi: Vector<F>) -> F {
        let (zero, one, ratio) = (F::splat(0.0), F::splat(1.0), self.eta_ratio);
        let above = zero.less(wi.z);
        let half = Vector::select(above, self.wo + wi, self.wo * ratio + wi);
        let shrink = one / half.length();
        let is_facet = zero.less(shrink) & shrink.less(F::splat(f64::INFINITY));
        let m = half * shrink;
        let m = Vector::select(m.z.less(zero), -m, m);
        let (o, i) = (self.wo.dot(m), wi.dot(m));
        let is_front = zero.less(i);
        let is_seen = is_facet & zero.less(o) & ((is_front & above) | (!is_front & !above));
        let (mirrored, visible) = (fresnel_dielectrics(o, ratio), self.ggx.visible_pdf(self.wo, m));
        let reflected = mirrored * visible / (o * 4.0);
        // Walter (17): dω_m / dω_i
        let across = ratio * o + i;
        let refracted = (one - mirrored) * visible * -i / (across * across);
        F::select(is_seen, F::select(above, reflected, refracted), zero)
    }
}

/// f |cos θ| and the densities of eight directions at eight rough boundaries.
pub(crate) struct EvaluateBoundaries<'a> {
    pub(crate) boundaries: [&'a SeenDielectric; LANES],
    pub(crate) wi: &'a [[f64; LANES]; 3],
}

impl LaneKernel for EvaluateBoundaries<'_> {
    type Answer = ([f32; LANES], [f64; LANES]);

    #[inline(always)]
    fn run<F: Real64>(self) -> Self::Answer {
        let EvaluateBoundaries { boundaries, wi } = self;
        let Some(any) = boundaries.iter().find_map(|boundary| boundary.rough()) else {
            return ([0.0; LANES], [0.0; LANES]);
        };
        let lanes = Boundaries::<F>::gather(|lane| boundaries[lane].rough().unwrap_or(any));
        let (f, pdf) = lanes.eval_and_pdf(Vector::load(wi));
        (f.to_array(), pdf.to_array())
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

    /// A rough boundary with its facets.
    #[inline]
    pub(crate) fn rough(&self) -> Option<(&DielectricBsdf, &BoundaryFacets)> {
        Some((&self.bsdf, self.facets.as_ref()?))
    }

    /// f |cos θ| and the density.
    pub(super) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        let Some(rough) = self.rough() else { return (Rgb::BLACK, 0.0) };
        let (f, pdf) = Boundaries::<f64>::gather(|_| rough).eval_and_pdf(wi.into());
        (Rgb::gray(f), pdf)
    }

    pub(super) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let wo = self.wo;
        if self.is_index_matched() {
            return Some(BsdfSample { wi: -wo, f: Rgb::WHITE, pdf: 1.0, lobe: Lobe::Refraction, is_delta: true });
        }
        let Some(facets) = &self.facets else { return self.bsdf.smooth(wo, u_lobe) };
        let (wi, lobe) = self.direction(facets, u_lobe, u)?;
        let (f, pdf) = self.eval_and_pdf(wi);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe, is_delta: false })
    }

    /// The direction at a rough boundary that the numbers choose, and its lobe.
    pub(crate) fn rough_direction(&self, u_lobe: f64, u: [f64; 2]) -> Option<(DVec3, Lobe)> {
        self.direction(self.facets.as_ref()?, u_lobe, u)
    }

    fn direction(&self, facets: &BoundaryFacets, u_lobe: f64, u: [f64; 2]) -> Option<(DVec3, Lobe)> {
        let ratio = self.bsdf.frame.eta_ratio;
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
        Some((wi, if is_mirrored { Lobe::Mirror } else { Lobe::Refraction }))
    }
}

#[cfg(test)]
mod tests;
