//! Clear bodies as light has them: Fresnel's share is mirrored, the rest is refracted, at a smooth boundary or at GGX
//! microfacets (Walter et al. 2007). Light that goes from facet to facet is given back on both sides, so that a rough
//! boundary loses nothing, either. The whole is reciprocal.

use super::bsdf::{FacetAxes, mirrored_at, mirrored_directions};
use super::dielectric_albedo::{DielectricAlbedo, loss_pdfs, losses_at};
use super::fresnel::fresnel_dielectrics;
use super::ggx::{Ggx, circle_point};
use super::{
    BsdfSample, Lobe, LobeDirections, MaterialPoint, Phong, ScatteringFrame, SpecularTransmission, fresnel_dielectric,
    reflect, refract,
};
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{LANES, Mask, Real64};
use glam::DVec3;
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
}

/// A rough boundary in each lane, as it is seen from one direction.
pub(crate) struct RoughBoundaries<F: Real64> {
    albedo: [DielectricAlbedo; LANES],
    ggx: Ggx<F>,
    eta_ratio: F,
    /// The axes of the facets, and the viewer's direction in them.
    axes: FacetAxes<F>,
    wo: Vector<F>,
    /// The light that one scattering loses, the share of it that is mirrored, and the losses of both sides.
    lost: F,
    mirrored: F,
    losses: [F; 2],
    /// The geometric normal on the viewer's side, and where it isn't the shading normal.
    facing: Vector<F>,
    bent: F::Mask,
    /// A bit for each lane that counts.
    lanes: u32,
}

impl<F: Real64> RoughBoundaries<F> {
    /// The boundaries that a function gives for each lane. All are rough. `lanes` has a bit for each one that counts,
    /// and the first one does.
    #[inline(always)]
    pub(crate) fn gather<'a>(of_lane: impl Fn(usize) -> &'a SeenDielectric, lanes: u32) -> RoughBoundaries<F> {
        let frame = |lane: usize| &of_lane(lane).bsdf.frame;
        let of = |lane: usize| DielectricAlbedo::new(frame(lane).eta_ratio, of_lane(lane).bsdf.alpha);
        let mut albedo = [of(0); LANES];
        let (mut mirrored, mut losses) = ([1.0; LANES], [[1.0; LANES]; 2]);
        for lane in (0..F::COUNT).filter(|lane| lanes >> lane & 1 == 1) {
            albedo[lane] = of(lane);
            let back = albedo[lane].given_back();
            (mirrored[lane], losses[0][lane], losses[1][lane]) = (back.mirrored, back.losses[0], back.losses[1]);
        }
        let wo = Vector::gather(|lane| of_lane(lane).wo);
        let (normal, facing) = (Vector::gather(|lane| frame(lane).normal), Vector::gather(|lane| frame(lane).facing));
        let axes = FacetAxes::isotropic(normal, facing, wo);
        let wo = axes.local(wo);
        RoughBoundaries {
            ggx: Ggx::isotropic(F::gather(|lane| of_lane(lane).bsdf.alpha)),
            eta_ratio: F::gather(|lane| frame(lane).eta_ratio),
            axes,
            wo,
            lost: losses_at(&albedo, wo.z, F::Mask::splat(true), lanes),
            mirrored: F::load(&mirrored),
            losses: [F::load(&losses[0]), F::load(&losses[1])],
            facing,
            bent: !normal.equal(facing),
            albedo,
            lanes,
        }
    }

    /// f |cos θ| and the density, whose costly parts are the same.
    #[inline(always)]
    pub(crate) fn eval_and_pdf(&self, wi: Vector<F>) -> (F::Narrow, F) {
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
        let (zero, one, i) = (F::splat(0.0), F::splat(1.0), self.axes.local(wi));
        let is_up = zero.less(i.z);
        let is_right = (is_up & above) | (!is_up & !above);
        let share = F::select(above, self.mirrored, one - self.mirrored);
        let loss = F::select(above, self.losses[0], self.losses[1]);
        let (cos, lanes) = (i.z.abs(), is_right.bits() & self.lanes);
        let lost = losses_at(&self.albedo, cos, above, lanes);
        let lost_pdf = loss_pdfs(&self.albedo, cos, above, lanes);
        let density = self.pdf_of_facets(i);
        let single = density * self.ggx.shadowing(self.wo, i);
        let again = self.lost * share * lost / loss * cos * FRAC_1_PI;
        let pdf = density * (one - self.lost) + self.lost * share * lost_pdf;
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

    /// The directions that the numbers choose: `u_lobe` of [0, 1) what happens, and `u` of the unit square the facet or
    /// the direction of lost light.
    #[inline(always)]
    pub(crate) fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        let (zero, one, wo) = (F::splat(0.0), F::splat(1.0), self.wo);
        let m = self.ggx.sample_visible(wo, u);
        let cos = wo.dot(m);
        let mut is_mirrored = ((u_lobe - self.lost) / (one - self.lost)).less(fresnel_dielectrics(cos, self.eta_ratio));
        // (5.43) and (5.44)
        let tangential = (m * cos - wo) * self.eta_ratio;
        let sin2 = tangential.length_squared();
        let refracted = tangential - m * (one - sin2).sqrt();
        let mut local = Vector::select(is_mirrored, m * (cos * 2.0) - wo, refracted);
        let mut is_valid = is_mirrored | sin2.less(one);
        let is_lost = u_lobe.less(self.lost);
        let lost = is_lost.bits() & self.lanes;
        if lost != 0 {
            let stays = u_lobe.less(self.lost * self.mirrored);
            let (numbers, stay) = (u[1].to_array(), stays.bits());
            let mut cosines = [0.0; LANES];
            for lane in (0..F::COUNT).filter(|lane| lost >> lane & 1 == 1) {
                cosines[lane] = self.albedo[lane].sample_lost(numbers[lane], stay >> lane & 1 == 1);
            }
            let (z, [x, y]) = (F::load(&cosines), circle_point(u[0]));
            let across = (one - z * z).max(zero).sqrt();
            let given_back = Vector { x: x * across, y: y * across, z: F::select(stays, z, -z) };
            local = Vector::select(is_lost, given_back, local);
            is_mirrored = (is_lost & stays) | (!is_lost & is_mirrored);
            is_valid = is_valid | is_lost;
        }
        let is_up = zero.less(local.z);
        is_valid = is_valid & ((is_up & is_mirrored) | (!is_up & !is_mirrored));
        let wi = self.axes.world(local).normalized();
        let above = zero.less(wi.dot(self.facing));
        let is_right = (above & is_mirrored) | (!above & !is_mirrored);
        let wi = Vector::select(is_right, wi, mirrored_directions(self.facing, wi));
        LobeDirections { wi, is_valid, is_mirrored }
    }
}

impl SeenDielectric {
    pub(super) fn new(bsdf: DielectricBsdf, wo: DVec3) -> SeenDielectric {
        SeenDielectric { bsdf, wo }
    }

    /// Whether both sides have one η, so that nothing is mirrored or bent.
    fn is_index_matched(&self) -> bool {
        self.bsdf.is_index_matched()
    }

    /// What passes in one direction.
    pub(super) fn specular_transmission(&self) -> SpecularTransmission {
        if self.is_rough() {
            return SpecularTransmission::NONE;
        }
        let (frame, is_straight) = (&self.bsdf.frame, self.is_index_matched());
        let ratio = frame.eta_ratio.min(1.0 / frame.eta_ratio);
        let cos = self.wo.dot(frame.facet_normal(self.wo));
        let passed = if is_straight { 1.0 } else { 1.0 - fresnel_dielectric(cos, ratio) };
        SpecularTransmission { share: Rgb::gray(passed as f32), is_straight }
    }

    /// Whether facets scatter light to all sides.
    #[inline]
    pub(super) fn is_rough(&self) -> bool {
        !self.bsdf.is_delta()
    }

    /// f |cos θ| and the density.
    pub(super) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        if !self.is_rough() {
            return (Rgb::BLACK, 0.0);
        }
        let (f, pdf) = RoughBoundaries::<f64>::gather(|_| self, 1).eval_and_pdf(wi.into());
        (Rgb::gray(f), pdf)
    }

    pub(super) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        if self.is_index_matched() {
            return Some(BsdfSample { wi: -self.wo, f: Rgb::WHITE, pdf: 1.0, lobe: Lobe::Refraction, is_delta: true });
        }
        if !self.is_rough() {
            return self.bsdf.smooth(self.wo, u_lobe);
        }
        let boundary = RoughBoundaries::<f64>::gather(|_| self, 1);
        let LobeDirections { wi, is_valid, is_mirrored } = boundary.directions(u_lobe, u);
        let (f, pdf) = boundary.eval_and_pdf(wi);
        let lobe = if is_mirrored { Lobe::Mirror } else { Lobe::Refraction };
        (is_valid && pdf > 0.0).then(|| BsdfSample { wi: wi.into(), f: Rgb::gray(f), pdf, lobe, is_delta: false })
    }
}

#[cfg(test)]
mod tests;
