//! The scattering of eight vertices of one kind of material.

use super::kernels::Arrived;
use super::{LANES, rgb};
use crate::integrator::media::NONE;
use crate::integrator::path::PathTracer;
use crate::integrator::path::guiding::{GuidedVertex, GuidingField, pdf_of_both};
use crate::integrator::path::light_tree::Receiver;
use crate::integrator::path::source_points::SourcePoints;
use crate::material::{
    BsdfSample, ConductorPoint, Lobe, MetalFacets, diffuse_direction, diffuse_pdf, diffuse_share, isotropic_axes,
};
use crate::math::Vector;
use crate::shape::{DVec3x8, Vec3x8, dvec3, set_bits, set_dvec3, set_vec3};
use canaletto_bvh::lanes::{LaneKernel, Real64, run_lanes};
use glam::DVec3;

/// The materials of eight vertices of one kind.
pub(super) trait Materials8: Default {
    /// Whether surfaces choose among several lobes.
    const HAS_LOBES: bool = false;

    type Vertices<'a>: Scattering8
    where
        Self: 'a;

    /// The first `len` vertices, as their viewers see them, and as a guiding field knows them.
    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a>;

    /// Forgets the vertices.
    fn clear(&mut self) {}
}

/// f |cos θ| of eight directions, and the densities with which paths go on along them.
pub(super) struct Evaluated8 {
    pub(super) f: Vec3x8,
    pub(super) pdf: [f64; LANES],
}

impl Evaluated8 {
    pub(super) const NONE: Evaluated8 = Evaluated8 { f: [[0.0; LANES]; 3], pdf: [1.0; LANES] };
}

/// Eight directions in which paths go on: [`BsdfSample`] side by side.
pub(super) struct Sampled8 {
    pub(super) wi: DVec3x8,
    pub(super) f: Vec3x8,
    pub(super) pdf: [f64; LANES],
    /// How much more probable the directions were by the guiding field and the surfaces than by the surfaces alone.
    pub(super) guided: [f32; LANES],
    pub(super) lobes: [Lobe; LANES],
    /// A bit for each vertex that has a direction, and for each direction that is the only one of its lobe.
    pub(super) valid: u32,
    pub(super) delta: u32,
}

impl Sampled8 {
    pub(super) const NONE: Sampled8 = Sampled8 {
        wi: [[0.0; LANES]; 3],
        f: [[0.0; LANES]; 3],
        pdf: [1.0; LANES],
        guided: [1.0; LANES],
        lobes: [Lobe::Diffuse; LANES],
        valid: 0,
        delta: 0,
    };
}

/// The scattering of eight vertices, by the functions of single vertices.
pub(super) trait Scattering8 {
    /// A vertex as lights see it.
    fn receiver(&self, lane: usize) -> Receiver;

    /// A bit for each vertex that sources are sampled for.
    fn lit(&self) -> u32;

    /// The light from sampled sources.
    fn evaluate(&self, points: &SourcePoints) -> Evaluated8;

    /// The directions that the vertices' random numbers choose.
    fn sample(&self) -> Sampled8;

    /// The bodies that a ray is in after it leaves a vertex: [`PathTracer::inside_after`].
    fn inside_after(&self, tracer: &mut PathTracer, lane: usize, wi: DVec3) -> Option<[u32; 2]>;

    /// Whether a direction leads through the surface: [`SurfaceVertex::goes_through`].
    ///
    /// [`SurfaceVertex::goes_through`]: crate::integrator::path::vertex::SurfaceVertex::goes_through
    fn goes_through(&self, lane: usize, sample: &BsdfSample) -> Option<bool>;
}

/// The lobes of eight opaque surfaces.
pub(super) trait Lobes8 {
    /// The lobe of the directions that surfaces choose.
    const LOBE: Lobe;

    /// Whether a vertex scatters no light.
    fn is_black(&self, lane: usize) -> bool;

    /// [`Bsdf::eval`](crate::material::Bsdf::eval) and [`Bsdf::pdf`](crate::material::Bsdf::pdf) of directions. It has
    /// to be `#[inline(always)]`.
    fn evaluate<F: Real64>(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F);

    /// The directions at `u` of the unit square. It has to be `#[inline(always)]`.
    fn directions<F: Real64>(&self, u: [F; 2]) -> Vector<F>;
}

struct Evaluate<'a, L> {
    lobes: &'a L,
    wi: &'a DVec3x8,
}

impl<L: Lobes8> LaneKernel for Evaluate<'_, L> {
    type Answer = Evaluated8;

    #[inline(always)]
    fn run<F: Real64>(self) -> Evaluated8 {
        let (f, pdf) = self.lobes.evaluate(Vector::<F>::load(self.wi));
        let mut evaluated = Evaluated8::NONE;
        f.store(&mut evaluated.f);
        pdf.store(&mut evaluated.pdf);
        evaluated
    }
}

struct Directions<'a, L> {
    lobes: &'a L,
    u: &'a [[f64; LANES]; 2],
}

impl<L: Lobes8> LaneKernel for Directions<'_, L> {
    type Answer = DVec3x8;

    #[inline(always)]
    fn run<F: Real64>(self) -> DVec3x8 {
        let [u, v] = self.u;
        let mut wi = [[0.0; LANES]; 3];
        self.lobes.directions([F::load(u), F::load(v)]).store(&mut wi);
        wi
    }
}

/// Eight opaque vertices, and where light comes from there as far as that was learnt.
pub(super) struct OpaqueVertices<'a, L> {
    lobes: L,
    arrived: &'a Arrived,
    len: usize,
    guides: Option<Box<[Option<GuidedVertex>; LANES]>>,
}

impl<'a, L: Lobes8> OpaqueVertices<'a, L> {
    fn new(lobes: L, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> OpaqueVertices<'a, L> {
        let guide = |field: &GuidingField, lane: usize| {
            let receiver = arrived.receiver(lane);
            let is_lit = lane < len && !lobes.is_black(lane);
            is_lit.then(|| field.at(receiver.point, Some(receiver.normal))).flatten()
        };
        let guides = field.map(|field| Box::new(std::array::from_fn(|lane| guide(field, lane))));
        OpaqueVertices { lobes, arrived, len, guides }
    }

    /// The guides of the vertices that have one.
    fn guides(&self) -> impl Iterator<Item = (usize, &GuidedVertex)> {
        let guides = self.guides.iter().flat_map(|guides| guides.iter().enumerate());
        guides.filter_map(|(lane, guide)| Some((lane, guide.as_ref()?)))
    }
}

impl<L: Lobes8> Scattering8 for OpaqueVertices<'_, L> {
    fn receiver(&self, lane: usize) -> Receiver {
        self.arrived.receiver(lane)
    }

    fn lit(&self) -> u32 {
        (0..self.len).map(|lane| u32::from(!self.lobes.is_black(lane)) << lane).sum()
    }

    fn evaluate(&self, points: &SourcePoints) -> Evaluated8 {
        let mut evaluated = run_lanes(Evaluate { lobes: &self.lobes, wi: &points.wi });
        for (lane, guide) in self.guides() {
            let pdf = guide.pdf(dvec3(&points.wi, lane));
            evaluated.pdf[lane] = pdf_of_both(guide.probability, pdf, evaluated.pdf[lane]);
        }
        evaluated
    }

    fn sample(&self) -> Sampled8 {
        let [u, v] = &self.arrived.u_direction;
        let (mut wi, mut chosen) = (run_lanes(Directions { lobes: &self.lobes, u: &self.arrived.u_direction }), 0);
        for (lane, guide) in self.guides() {
            if self.arrived.u_lobe[lane] < guide.probability {
                set_dvec3(&mut wi, lane, guide.sample([u[lane], v[lane]]));
                chosen |= 1 << lane;
            }
        }
        let Evaluated8 { f, mut pdf } = run_lanes(Evaluate { lobes: &self.lobes, wi: &wi });
        // A surface's own direction that it doesn't scatter to has no density.
        let valid = (0..self.len).map(|lane| u32::from(pdf[lane] > 0.0) << lane).sum::<u32>() | chosen;
        let (mut guided, mut lobes) = ([1.0; LANES], [L::LOBE; LANES]);
        for (lane, guide) in self.guides() {
            let own = pdf[lane];
            pdf[lane] = pdf_of_both(guide.probability, guide.pdf(dvec3(&wi, lane)), own);
            guided[lane] = (pdf[lane] / own) as f32;
        }
        set_bits(chosen).for_each(|lane| lobes[lane] = Lobe::Diffuse);
        Sampled8 { wi, f, pdf, guided, lobes, valid, delta: 0 }
    }

    #[inline(always)]
    fn inside_after(&self, _: &mut PathTracer, _: usize, _: DVec3) -> Option<[u32; 2]> {
        Some([NONE; 2])
    }

    #[inline(always)]
    fn goes_through(&self, _: usize, _: &BsdfSample) -> Option<bool> {
        None
    }
}

/// The colours of eight diffuse vertices.
#[derive(Default)]
pub(in super::super) struct Diffuse {
    pub(super) kd: Vec3x8,
}

/// Eight diffuse vertices.
pub(super) struct DiffuseLobes<'a> {
    kd: &'a Vec3x8,
    arrived: &'a Arrived,
}

impl Materials8 for Diffuse {
    type Vertices<'a> = OpaqueVertices<'a, DiffuseLobes<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        OpaqueVertices::new(DiffuseLobes { kd: &self.kd, arrived }, arrived, field, len)
    }
}

impl Lobes8 for DiffuseLobes<'_> {
    const LOBE: Lobe = Lobe::Diffuse;

    fn is_black(&self, lane: usize) -> bool {
        rgb(self.kd, lane).is_black()
    }

    #[inline(always)]
    fn evaluate<F: Real64>(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let (normal, facing) = (Vector::load(&self.arrived.normal), Vector::load(&self.arrived.facing));
        (Vector::load(self.kd) * diffuse_share(normal, facing, wi), diffuse_pdf(normal, wi))
    }

    #[inline(always)]
    fn directions<F: Real64>(&self, u: [F; 2]) -> Vector<F> {
        diffuse_direction(Vector::load(&self.arrived.normal), u)
    }
}

/// Eight rough metals.
#[derive(Default)]
pub(in super::super) struct Metals {
    pub(super) points: [ConductorPoint; LANES],
}

/// Eight vertices of rough metals.
pub(super) struct MetalLobes<'a> {
    points: &'a [ConductorPoint; LANES],
    arrived: &'a Arrived,
}

impl Materials8 for Metals {
    type Vertices<'a> = OpaqueVertices<'a, MetalLobes<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        OpaqueVertices::new(MetalLobes { points: &self.points, arrived }, arrived, field, len)
    }
}

impl MetalLobes<'_> {
    /// The facets as the viewers see them, without the factors of what they reflect.
    #[inline(always)]
    fn facets<F: Real64>(&self) -> MetalFacets<F> {
        let Arrived { wo, normal, facing, .. } = self.arrived;
        let (wo, facing) = (Vector::load(wo), Vector::load(facing));
        let [mut eta, mut k] = [[[0.0; LANES]; 3]; 2];
        for (lane, point) in self.points.iter().enumerate() {
            set_vec3(&mut eta, lane, point.eta.to_array().into());
            set_vec3(&mut k, lane, point.k.to_array().into());
        }
        let alpha = F::gather(|lane| self.points[lane].alpha);
        let axes = isotropic_axes(Vector::load(normal), facing, wo);
        MetalFacets::new(Vector::load(&eta), Vector::load(&k), alpha, facing, axes, wo)
    }
}

impl Lobes8 for MetalLobes<'_> {
    const LOBE: Lobe = Lobe::Mirror;

    fn is_black(&self, _: usize) -> bool {
        false
    }

    #[inline(always)]
    fn evaluate<F: Real64>(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        self.facets::<F>().returning(|lane, cos| self.points[lane].returned(cos)).eval_and_pdf(wi)
    }

    #[inline(always)]
    fn directions<F: Real64>(&self, u: [F; 2]) -> Vector<F> {
        self.facets::<F>().direction(u)
    }
}
