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

use super::bsdf::{LobeDirections, mirrored_directions};
use super::ggx::circle_point;
use super::{
    BsdfSample, Lobe, Phong, ScatteringFrame, SpecularTransmission, diffuse_direction, diffuse_pdf, diffuse_share,
    ggx_vndf_pdf, reflect, reflect_into_hemisphere, refract, sample_ggx_vndf,
};
use crate::math::functions::pow;
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::Real64;
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

    /// The diffuse lobe and the highlight.
    fn glossy(&self, wo: DVec3) -> GlossyLobes<f64> {
        let point = GlossyPoint { phong: self.phong, gloss: self.gloss, sums: [self.sums[0], self.sums[1]] };
        let ScatteringFrame { normal, facing, .. } = self.frame;
        GlossyLobes::gather(|_| &point, normal.into(), facing.into(), wo.into())
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Rgb {
        Rgb::from(self.glossy(wo).eval_and_pdf(wi.into()).0) + self.eval_rough(wo, wi)
    }

    /// [`PhongBsdf::eval`] for the light of a point light, with the chapter's highlight.
    pub(super) fn eval_point_light(&self, wo: DVec3, wi: DVec3) -> Rgb {
        Rgb::from(self.glossy(wo).eval_point_lights(wi.into())) + self.eval_rough(wo, wi)
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
        let density = |i: usize| match (self.probability(i), LOBES[i]) {
            (0.0, _) => 0.0,
            (_, lobe) if self.is_delta_lobe(lobe) => 0.0,
            (probability, Lobe::Mirror) => probability * self.mirror_pdf(wo, wi),
            (probability, _) => probability * self.refraction_pdf(wo, wi),
        };
        self.glossy(wo).eval_and_pdf(wi.into()).1 + density(2) + density(3)
    }

    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let i = self.sums.iter().position(|sum| u_lobe < *sum)?;
        let lobe = LOBES[i];
        let wi = match lobe {
            Lobe::Diffuse | Lobe::Highlight => self.glossy(wo).directions(u_lobe, u).wi.into(),
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

/// The diffuse lobe and the highlight of Phong's model at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlossyPoint {
    phong: Phong,
    /// The share of light from all sides that the highlight returns.
    gloss: Rgb,
    /// The cumulative sums of the lobes' probabilities.
    sums: [f64; 2],
}

impl Default for GlossyPoint {
    fn default() -> GlossyPoint {
        GlossyPoint { phong: Phong::default(), gloss: Rgb::BLACK, sums: [1.0; 2] }
    }
}

impl GlossyPoint {
    /// The lobes of an opaque surface without a mirror; none if the surface has more of them.
    pub(crate) fn new(phong: &Phong) -> Option<GlossyPoint> {
        let phong = phong.bounded();
        let is_all = phong.k.is_black() && phong.opacity >= 1.0;
        is_all.then(|| {
            let PhongBsdf { gloss, sums, .. } = PhongBsdf::new(phong, ScatteringFrame::flat(DVec3::Z, 1.0));
            GlossyPoint { phong, gloss, sums: [sums[0], sums[1]] }
        })
    }

    /// Whether it scatters no light.
    pub(crate) fn is_black(&self) -> bool {
        self.sums[1] == 0.0
    }
}

/// The diffuse lobe and the highlight of Phong's model in each lane, as they are seen from one direction.
pub(crate) struct GlossyLobes<F: Real64> {
    kd: Vector<F::Narrow>,
    ks: Vector<F::Narrow>,
    gloss: Vector<F::Narrow>,
    n: F,
    sums: [F; 2],
    normal: Vector<F>,
    facing: Vector<F>,
    /// r, the mirrored direction (5.37).
    mirrored: Vector<F>,
    /// The axis of the highlight's directions. With the exponent 0 it has the same brightness on the whole hemisphere.
    axis: Vector<F>,
}

impl<F: Real64> GlossyLobes<F> {
    /// The lobes that a function gives for each lane, between these normals and the viewers.
    #[inline(always)]
    pub(crate) fn gather<'a>(
        of_lane: impl Fn(usize) -> &'a GlossyPoint,
        normal: Vector<F>,
        facing: Vector<F>,
        wo: Vector<F>,
    ) -> GlossyLobes<F> {
        let n = F::gather(|lane| of_lane(lane).phong.n.into());
        let mirrored = normal * (wo.dot(normal) * 2.0) - wo;
        GlossyLobes {
            kd: Rgb::gather(|lane| of_lane(lane).phong.kd),
            ks: Rgb::gather(|lane| of_lane(lane).phong.ks),
            gloss: Rgb::gather(|lane| of_lane(lane).gloss),
            n,
            sums: [F::gather(|lane| of_lane(lane).sums[0]), F::gather(|lane| of_lane(lane).sums[1])],
            normal,
            facing,
            mirrored,
            axis: Vector::select(n.equal(F::splat(0.0)), normal, mirrored),
        }
    }

    /// f |cos θ| and the density of both lobes.
    #[inline(always)]
    pub(crate) fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let diffuse = diffuse_share(self.normal, self.facing, wi);
        let highlight = self.highlight_pdf(wi);
        let [of_diffuse, of_both] = self.sums;
        let pdf = of_diffuse * diffuse_pdf(self.normal, wi) + (of_both - of_diffuse) * highlight;
        (self.kd * diffuse + self.gloss * highlight.narrow(), pdf)
    }

    /// f |cos θ| for the light of point lights, with the chapter's highlight.
    #[inline(always)]
    pub(crate) fn eval_point_lights(&self, wi: Vector<F>) -> Vector<F::Narrow> {
        let zero = F::splat(0.0);
        let is_above = zero.less(self.normal.dot(wi)) & zero.less(self.facing.dot(wi));
        let highlight = power_of_cosine(self.mirrored.dot(wi), self.n) * FRAC_1_PI;
        let highlight = F::select(is_above, highlight, zero).narrow();
        // (5.32b), (5.38)
        self.kd * diffuse_share(self.normal, self.facing, wi) + self.ks * highlight
    }

    /// The density (n + 1) / 2π cosⁿ α of the highlight, where directions into the surface are mirrored out of it.
    #[inline(always)]
    fn highlight_pdf(&self, wi: Vector<F>) -> F {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let cosines = [self.axis.dot(wi), self.axis.dot(mirrored_directions(self.facing, wi))];
        let both = cosine_power(cosines[0], self.n) + cosine_power(cosines[1], self.n);
        F::select(zero.less(wi.dot(self.facing)), (self.n + one) / TAU * both, zero)
    }

    /// The directions that the numbers choose: `u_lobe` of [0, 1) the lobe, and `u` of the unit square the direction
    /// within it.
    #[inline(always)]
    pub(crate) fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        let (zero, one, [of_diffuse, of_both]) = (F::splat(0.0), F::splat(1.0), self.sums);
        let cos = pow((one - u[0]).max(F::splat(f64::MIN_POSITIVE)), one / (self.n + one));
        let (across, [x, y]) = ((one - cos * cos).max(zero).sqrt(), circle_point(u[1]));
        let [along_x, along_y] = self.axis.orthonormal_pair();
        let wi = along_x * (x * across) + along_y * (y * across) + self.axis * cos;
        let folded = mirrored_directions(self.facing, wi);
        let highlight = Vector::select(wi.dot(self.facing).less(zero), folded, wi);
        let is_diffuse = u_lobe.less(of_diffuse);
        LobeDirections {
            wi: Vector::select(is_diffuse, diffuse_direction(self.normal, u), highlight),
            is_valid: u_lobe.less(of_both),
            is_mirrored: !is_diffuse,
        }
    }
}

/// cosⁿ α where the cosine is positive, else 0.
#[inline(always)]
fn cosine_power<F: Real64>(cos: F, n: F) -> F {
    let least = F::splat(f64::MIN_POSITIVE);
    F::select(F::splat(0.0).less(cos), pow(cos.max(least), n), F::splat(0.0))
}

/// cosⁿ α of (5.38). An n of 0 gives 1 everywhere.
#[inline(always)]
fn power_of_cosine<F: Real64>(cos: F, n: F) -> F {
    F::select(n.equal(F::splat(0.0)), F::splat(1.0), cosine_power(cos, n))
}

#[cfg(test)]
mod tests;
