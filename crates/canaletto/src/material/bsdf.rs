//! Scattering at a point of a surface: evaluation, random directions and their density, as a path tracer needs them.
//!
//! Directions are unit vectors that point away from the surface. An integrator adds light along `wi` to the light that
//! leaves along `wo`. Overlay and coverage of a [`MaterialPoint`](super::MaterialPoint) are not part of it.

use super::conductor::SeenConductor;
use super::dielectric::SeenDielectric;
use super::standard::SeenStandard;
use super::{ConductorBsdf, DielectricBsdf, DiffuseBsdf, PhongBsdf, StandardBsdf};
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::Real64;
use glam::{DMat3, DVec3};
use serde::Serialize;

/// The scattering at a point, one variant for each [`MaterialModel`](super::MaterialModel), and one for diffuse
/// surfaces.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Bsdf {
    /// The diffuse term of (5.39b) alone.
    Diffuse(DiffuseBsdf),
    /// The scattering of (5.39b).
    Phong(PhongBsdf),
    /// A metal.
    Conductor(ConductorBsdf),
    /// The boundary of a clear body by Fresnel's equations.
    Dielectric(DielectricBsdf),
    /// The standard surface.
    Standard(StandardBsdf),
}

/// The surface and the media at a scattering point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteringFrame {
    /// The unit shading normal on the viewer's side.
    pub normal: DVec3,
    /// The unit geometric normal on the viewer's side.
    pub facing: DVec3,
    /// ∂P/∂u of any length, along which anisotropic microfacets are aligned; zero where nothing needs it.
    pub tangent: DVec3,
    /// Whether the viewer is on the outer side.
    pub outside: bool,
    /// The ratio ηᵢ/ηₜ of the coefficients of refraction on the viewer's side and on the other side.
    pub eta_ratio: f64,
    /// Whether the body on the other side is known, or none is needed. Nothing passes an open surface.
    pub is_closed: bool,
}

impl ScatteringFrame {
    /// A flat surface that is seen from its outer side.
    pub fn flat(normal: DVec3, eta_ratio: f64) -> ScatteringFrame {
        ScatteringFrame { normal, facing: normal, tangent: DVec3::ZERO, outside: true, eta_ratio, is_closed: true }
    }

    /// The axes of microfacets that are alike in all directions, for these normals.
    #[inline(always)]
    pub(crate) fn isotropic_facet_axes(normal: DVec3, facing: DVec3, wo: DVec3) -> DMat3 {
        let FacetAxes { x, y, z } = FacetAxes::<f64>::isotropic(normal.into(), facing.into(), wo.into());
        DMat3::from_cols(x.into(), y.into(), z.into())
    }

    /// The normal around which microfacets are distributed. It is on the side of `wo`.
    pub(super) fn facet_normal(&self, wo: DVec3) -> DVec3 {
        seen_normal::<f64>(self.normal.into(), self.facing.into(), wo.into()).into()
    }

    /// Whether the shading normal is not the geometric one.
    pub(super) fn is_bent(&self) -> bool {
        self.normal != self.facing
    }

    /// The axes of the microfacets as columns; z is their normal.
    pub(super) fn facet_axes(&self, wo: DVec3) -> DMat3 {
        if self.tangent == DVec3::ZERO {
            return ScatteringFrame::isotropic_facet_axes(self.normal, self.facing, wo);
        }
        let z = self.facet_normal(wo);
        let x = self.tangent.reject_from_normalized(z).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
        DMat3::from_cols(x, z.cross(x), z)
    }
}

/// The axes of microfacets in each lane. They are orthonormal, and z is the facets' own normal.
#[derive(Clone, Copy)]
pub(crate) struct FacetAxes<F> {
    pub(super) x: Vector<F>,
    pub(super) y: Vector<F>,
    pub(super) z: Vector<F>,
}

impl<F: Real64> FacetAxes<F> {
    /// The axes of microfacets that are alike in all directions, for these normals.
    #[inline(always)]
    pub(crate) fn isotropic(normal: Vector<F>, facing: Vector<F>, wo: Vector<F>) -> FacetAxes<F> {
        let z = seen_normal(normal, facing, wo);
        let [_, x] = z.orthonormal_pair();
        FacetAxes { x, y: z.cross(x), z }
    }

    /// The axes that a function gives for each lane as columns.
    #[inline(always)]
    pub(super) fn gather<'a>(of_lane: impl Fn(usize) -> &'a DMat3) -> FacetAxes<F> {
        FacetAxes {
            x: Vector::gather(|lane| of_lane(lane).x_axis),
            y: Vector::gather(|lane| of_lane(lane).y_axis),
            z: Vector::gather(|lane| of_lane(lane).z_axis),
        }
    }

    /// A direction of the world along these axes.
    #[inline(always)]
    pub(super) fn local(&self, w: Vector<F>) -> Vector<F> {
        Vector { x: self.x.dot(w), y: self.y.dot(w), z: self.z.dot(w) }
    }

    /// A direction along these axes in the world.
    #[inline(always)]
    pub(super) fn world(&self, w: Vector<F>) -> Vector<F> {
        self.x * w.x + self.y * w.y + self.z * w.z
    }
}

/// The shading normal on the side of `wo`. One that leans away from `wo` is mirrored to lean as much towards it, so
/// that nothing jumps where a surface bends out of sight.
#[inline(always)]
fn seen_normal<F: Real64>(normal: Vector<F>, facing: Vector<F>, wo: Vector<F>) -> Vector<F> {
    let cos = wo.dot(normal);
    let towards = Vector::select(F::splat(0.0).less(cos), normal, normal - wo * (cos * 2.0));
    Vector::select(F::splat(SEEN_EDGE_ON).less(cos.abs()), towards, facing)
}

/// The cosine below which a shading normal is at right angles to the viewer, so that the geometric one is taken.
const SEEN_EDGE_ON: f64 = 1e-9;

/// The direction on the other side of a surface with this unit normal, by the same angle. What facets send to the wrong
/// side of the geometric surface goes there, since the surface around them mirrors it, or lets it through.
#[inline(always)]
pub(super) fn mirrored_at(facing: DVec3, wi: DVec3) -> DVec3 {
    mirrored_directions::<f64>(facing.into(), wi.into()).into()
}

/// [`mirrored_at`] in each lane.
#[inline(always)]
pub(super) fn mirrored_directions<F: Real64>(facing: Vector<F>, wi: Vector<F>) -> Vector<F> {
    wi - facing * (wi.dot(facing) * 2.0)
}

/// Random directions of scattering in each lane.
pub(crate) struct LobeDirections<F: Real64> {
    pub(crate) wi: Vector<F>,
    /// Where there is a direction, and where facets mirror to it.
    pub(crate) is_valid: F::Mask,
    pub(crate) is_mirrored: F::Mask,
}

/// A random direction of scattering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The unit direction, away from the surface.
    pub wi: DVec3,
    /// f |cos θ| of all lobes together as in [`Bsdf::eval`]; of a delta lobe, its factor. f / pdf is the factor of a
    /// path's throughput. It is black for a direction into the surface.
    pub f: Rgb,
    /// The density per unit of solid angle as in [`Bsdf::pdf`]; of a delta lobe, the probability of the lobe.
    pub pdf: f64,
    /// The lobe of the direction.
    pub lobe: Lobe,
    /// Whether the lobe is a single direction, which no other lobe and no light hits by chance.
    pub is_delta: bool,
}

/// What a surface sends on in one direction to its other side: its smooth refraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpecularTransmission {
    /// The share of the light that passes. Between two η it is that of a ray on the side with the smaller one, where
    /// nothing is reflected totally.
    pub(crate) share: Rgb,
    /// Whether the direction is straight on.
    pub(crate) is_straight: bool,
}

impl SpecularTransmission {
    pub(super) const NONE: SpecularTransmission = SpecularTransmission { share: Rgb::BLACK, is_straight: false };

    /// Whether light passes as if no surface were there.
    pub(crate) fn is_whole(&self) -> bool {
        self.is_straight && self.share == Rgb::WHITE
    }
}

/// A kind of scattering.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Lobe {
    /// To all sides.
    Diffuse,
    /// Around the mirrored direction, for the light of lights.
    Highlight,
    /// The mirrored direction, or directions around it.
    Mirror,
    /// The refracted direction or directions around it. After a total reflection they are on the viewer's side.
    Refraction,
}

impl Bsdf {
    /// f(wo, wi) |cos θ|, where θ is the angle between `wi` and the shading normal. Delta lobes are 0 here.
    ///
    /// The cosine is included, as in Mitsuba, since the f of Phong's highlight is unbounded where cos θ vanishes. That
    /// highlight is normalised here. Path tracing gives point lights the chapter's instead.
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> Rgb {
        self.seen_from(wo).eval(wi)
    }

    /// A random direction: `u_lobe` of [0, 1) chooses the lobe, and `u` of the unit square the direction within it.
    /// None if the surface scatters nothing.
    pub fn sample(&self, wo: DVec3, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        self.seen_from(wo).sample(u_lobe, u)
    }

    /// The density per unit of solid angle with which [`Bsdf::sample`] returns `wi`, without delta lobes. Its integral
    /// over the whole sphere is 1 less the probability of delta lobes.
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        self.seen_from(wo).pdf(wi)
    }

    /// The scattering as it is seen from `wo`.
    pub(crate) fn seen_from(&self, wo: DVec3) -> SeenBsdf {
        match *self {
            Bsdf::Diffuse(diffuse) => SeenBsdf::Diffuse(diffuse),
            Bsdf::Phong(phong) => SeenBsdf::Phong(phong, wo),
            Bsdf::Conductor(conductor) => SeenBsdf::Conductor(SeenConductor::new(conductor, wo)),
            Bsdf::Dielectric(dielectric) => SeenBsdf::Dielectric(SeenDielectric::new(dielectric, wo)),
            Bsdf::Standard(standard) => SeenBsdf::Standard(Box::new(SeenStandard::new(standard, wo))),
        }
    }

    /// Whether all lobes are delta lobes, so that lights can't be sampled.
    pub fn is_delta(&self) -> bool {
        match self {
            Bsdf::Diffuse(diffuse) => diffuse.kd.is_black(),
            Bsdf::Phong(phong) => phong.is_delta(),
            Bsdf::Conductor(conductor) => conductor.is_delta(),
            Bsdf::Dielectric(dielectric) => dielectric.is_delta(),
            Bsdf::Standard(standard) => standard.is_delta(),
        }
    }
}

/// The scattering at a point as it is seen from one direction. What depends on that direction alone is computed once.
pub(crate) enum SeenBsdf {
    Diffuse(DiffuseBsdf),
    Phong(PhongBsdf, DVec3),
    Conductor(SeenConductor),
    Dielectric(SeenDielectric),
    /// It is boxed, so that the others are small.
    Standard(Box<SeenStandard>),
}

impl SeenBsdf {
    /// [`Bsdf::eval`].
    pub(crate) fn eval(&self, wi: DVec3) -> Rgb {
        match self {
            SeenBsdf::Diffuse(diffuse) => diffuse.eval(wi),
            SeenBsdf::Phong(phong, wo) => phong.eval(*wo, wi),
            SeenBsdf::Conductor(_) | SeenBsdf::Dielectric(_) | SeenBsdf::Standard(_) => self.eval_and_pdf(wi).0,
        }
    }

    /// [`Bsdf::eval`] and [`Bsdf::pdf`].
    pub(crate) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        match self {
            SeenBsdf::Conductor(conductor) => conductor.eval_and_pdf(wi),
            SeenBsdf::Dielectric(dielectric) => dielectric.eval_and_pdf(wi),
            SeenBsdf::Standard(standard) => standard.eval_and_pdf(wi),
            SeenBsdf::Diffuse(_) | SeenBsdf::Phong(..) => (self.eval(wi), self.pdf(wi)),
        }
    }

    /// [`Bsdf::eval`] for the light of a point light, whose intensity isn't a power: with the chapter's highlight.
    pub(crate) fn eval_point_light(&self, wi: DVec3) -> Rgb {
        match self {
            SeenBsdf::Phong(phong, wo) => phong.eval_point_light(*wo, wi),
            _ => self.eval(wi),
        }
    }

    /// A rough boundary of a clear body.
    pub(crate) fn rough_boundary(&self) -> Option<&SeenDielectric> {
        if let SeenBsdf::Dielectric(boundary) = self {
            Some(boundary).filter(|boundary| boundary.is_rough())
        } else {
            None
        }
    }

    /// [`Bsdf::sample`].
    pub(crate) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        match self {
            SeenBsdf::Diffuse(diffuse) => diffuse.sample(u),
            SeenBsdf::Phong(phong, wo) => phong.sample(*wo, u_lobe, u),
            SeenBsdf::Conductor(conductor) => conductor.sample(u),
            SeenBsdf::Dielectric(dielectric) => dielectric.sample(u_lobe, u),
            SeenBsdf::Standard(standard) => standard.sample(u_lobe, u),
        }
    }

    /// What passes in one direction.
    pub(crate) fn specular_transmission(&self) -> SpecularTransmission {
        match self {
            SeenBsdf::Diffuse(_) | SeenBsdf::Conductor(_) => SpecularTransmission::NONE,
            SeenBsdf::Phong(phong, _) => phong.specular_transmission(),
            SeenBsdf::Dielectric(dielectric) => dielectric.specular_transmission(),
            SeenBsdf::Standard(standard) => standard.specular_transmission(),
        }
    }

    /// [`Bsdf::pdf`].
    pub(crate) fn pdf(&self, wi: DVec3) -> f64 {
        match self {
            SeenBsdf::Diffuse(diffuse) if diffuse.kd.is_black() => 0.0,
            SeenBsdf::Diffuse(diffuse) => diffuse.pdf(wi),
            SeenBsdf::Phong(phong, wo) => phong.pdf(*wo, wi),
            SeenBsdf::Conductor(_) | SeenBsdf::Dielectric(_) | SeenBsdf::Standard(_) => self.eval_and_pdf(wi).1,
        }
    }
}
