//! Points where a path is scattered: of surfaces, in media, and where light is measured.

use super::GuidedSample;
use super::guiding::{GuidedVertex, pdf_of_both};
use super::light_tree::Receiver;
use crate::integrator::media::Crossing;
use crate::integrator::visible_hit::{Frame, HitInside};
use crate::material::{BsdfSample, HenyeyGreenstein, Lobe, SeenBsdf};
use crate::math::{DRay, Rgb, offset_origin, rounding, warp};
use canaletto_bvh::Ray;
use glam::DVec3;
use std::f64::consts::PI;

/// A point where a path is scattered.
pub(super) enum Vertex<'a> {
    /// A point of a surface.
    Surface(&'a SurfaceVertex),
    /// A point in a medium.
    Medium(MediumVertex),
    /// A point where light is measured.
    Meter(MeterVertex),
}

/// A point where light is measured: a white matte surface that no ray hits.
pub(super) struct MeterVertex {
    pub(super) position: DVec3,
    pub(super) normal: DVec3,
    /// The bodies that it is in.
    pub(super) inside: u32,
}

/// A surface of a path.
pub(super) struct SurfaceVertex {
    pub(super) hit: HitInside,
    pub(super) frame: Frame,
    pub(super) bsdf: SeenBsdf,
    /// Whether light is scattered to single directions only.
    pub(super) is_delta: bool,
    /// Where light comes from, as far as that was learnt.
    pub(super) guide: Option<GuidedVertex>,
    /// What a ray into the surface crosses; none at opaque surfaces.
    pub(super) crossing: Option<Crossing>,
}

impl SurfaceVertex {
    /// Whether light passes as if no surface were there.
    pub(super) fn is_index_matched(&self) -> bool {
        self.bsdf.specular_transmission().is_whole()
    }

    /// Whether a sampled direction leads through the surface as the only one of its lobe; if so, whether it is straight
    /// on.
    pub(super) fn goes_through(&self, sample: &BsdfSample) -> Option<bool> {
        let goes_through = sample.is_delta && sample.wi.dot(self.frame.facing) < 0.0;
        goes_through.then(|| self.bsdf.specular_transmission().is_straight)
    }

    /// The density with which the path goes on along `wi`, by the guiding field and by the surface together.
    pub(super) fn pdf(&self, wi: DVec3) -> f64 {
        self.with_guide(wi, self.bsdf.pdf(wi))
    }

    /// [`Vertex::towards_source`].
    pub(super) fn towards_source(&self, wi: DVec3, is_point_light: bool, is_found: bool) -> (Rgb, Option<f64>) {
        if is_found {
            let (f, own) = self.bsdf.eval_and_pdf(wi);
            return (f, Some(self.with_guide(wi, own)));
        }
        (if is_point_light { self.bsdf.eval_point_light(wi) } else { self.bsdf.eval(wi) }, None)
    }

    fn with_guide(&self, wi: DVec3, own: f64) -> f64 {
        self.guide.as_ref().map_or(own, |guide| pdf_of_both(guide.probability, guide.pdf(wi), own))
    }

    /// A random direction in which the path goes on, and the part of the guiding field in it.
    pub(super) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<(BsdfSample, Option<GuidedSample>)> {
        let Some(guide) = &self.guide else { return Some((self.bsdf.sample(u_lobe, u)?, None)) };
        let probability = guide.probability;
        let is_chosen = u_lobe < probability;
        let sample = if is_chosen {
            let wi = guide.sample(u);
            let (f, pdf) = self.bsdf.eval_and_pdf(wi);
            BsdfSample { wi, f, pdf, lobe: Lobe::Diffuse, is_delta: false }
        } else {
            self.bsdf.sample(guide.u_of_surface(u_lobe), u)?
        };
        let pdf = if sample.is_delta { 0.0 } else { guide.pdf(sample.wi) };
        let guiding = GuidedSample { is_chosen, pdf, pdf_scattering: sample.pdf };
        let of_both = BsdfSample { pdf: pdf_of_both(probability, pdf, sample.pdf), ..sample };
        Some((of_both, Some(guiding)))
    }
}

/// A point in a medium where a path is scattered.
pub(super) struct MediumVertex {
    pub(super) position: DVec3,
    pub(super) wo: DVec3,
    pub(super) phase: HenyeyGreenstein,
    /// The bodies that it is in.
    pub(super) inside: u32,
}

impl Vertex<'_> {
    /// Whether light is scattered to single directions only, so that no source is sampled.
    pub(super) fn is_delta(&self) -> bool {
        match self {
            Vertex::Surface(surface) => surface.is_delta,
            Vertex::Medium(_) | Vertex::Meter(_) => false,
        }
    }

    /// The point before rounding.
    pub(super) fn position(&self) -> DVec3 {
        match self {
            Vertex::Surface(surface) => surface.frame.exact,
            Vertex::Medium(medium) => medium.position,
            Vertex::Meter(meter) => meter.position,
        }
    }

    /// The point as lights see it.
    pub(super) fn receiver(&self) -> Receiver {
        match self {
            Vertex::Surface(SurfaceVertex { frame, crossing, .. }) => {
                Receiver { point: frame.exact, normal: frame.normal, two_sided: crossing.is_some() }
            }
            Vertex::Medium(medium) => Receiver::in_medium(medium.position),
            Vertex::Meter(MeterVertex { position, normal, .. }) => {
                Receiver { point: *position, normal: *normal, two_sided: false }
            }
        }
    }

    /// f |cos θ| of a source's light along `wi`, and the density with which the path goes on along `wi`, if rays find
    /// the source, too.
    pub(super) fn towards_source(&self, wi: DVec3, is_point_light: bool, is_found: bool) -> (Rgb, Option<f64>) {
        match self {
            Vertex::Surface(surface) => surface.towards_source(wi, is_point_light, is_found),
            Vertex::Medium(_) | Vertex::Meter(_) => (self.eval(wi), is_found.then(|| self.pdf(wi))),
        }
    }

    /// f |cos θ| of light along `wi`; in a medium, the phase function.
    pub(super) fn eval(&self, wi: DVec3) -> Rgb {
        match self {
            Vertex::Surface(surface) => surface.bsdf.eval(wi),
            Vertex::Medium(medium) => Rgb::gray(medium.phase.eval(medium.wo, wi) as f32),
            Vertex::Meter(_) => Rgb::gray(self.pdf(wi) as f32),
        }
    }

    /// The density with which the path goes on along `wi`.
    pub(super) fn pdf(&self, wi: DVec3) -> f64 {
        match self {
            Vertex::Surface(surface) => surface.pdf(wi),
            Vertex::Medium(medium) => medium.phase.eval(medium.wo, wi),
            Vertex::Meter(meter) => meter.normal.dot(wi).max(0.0) / PI,
        }
    }

    /// A random direction in which the path goes on, and the part of the guiding field in it.
    pub(super) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<(BsdfSample, Option<GuidedSample>)> {
        let sample = match self {
            Vertex::Surface(surface) => return surface.sample(u_lobe, u),
            Vertex::Medium(MediumVertex { wo, phase, .. }) => {
                let wi = phase.sample(*wo, u);
                let pdf = phase.eval(*wo, wi);
                Some(BsdfSample { wi, f: Rgb::gray(pdf as f32), pdf, lobe: Lobe::Diffuse, is_delta: false })
            }
            Vertex::Meter(MeterVertex { normal, .. }) => {
                let (x, y) = normal.any_orthonormal_pair();
                let p = warp::cosine_hemisphere(u);
                let wi = x * p.x + y * p.y + *normal * p.z;
                let pdf = self.pdf(wi);
                let f = Rgb::gray(pdf as f32);
                (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe: Lobe::Diffuse, is_delta: false })
            }
        };
        Some((sample?, None))
    }

    /// The `f64` ray that leaves in a direction.
    pub(super) fn line(&self, wi: DVec3) -> DRay {
        DRay { origin: self.position(), direction: wi }
    }

    /// The rounded ray of a line that leaves.
    pub(super) fn ray(&self, line: &DRay) -> Ray {
        match self {
            Vertex::Surface(surface) => surface.frame.rounded(line),
            Vertex::Medium(_) => line.rounded(),
            Vertex::Meter(MeterVertex { position, normal, .. }) => {
                // A point on a surface sees what lies before it.
                let near = position.as_vec3();
                line.from_origin(offset_origin(near, rounding(near) * 4.0, *normal, *normal))
            }
        }
    }
}
