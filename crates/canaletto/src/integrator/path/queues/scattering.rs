//! The scattering of eight vertices of one kind of material.

use super::kernels::{Arrived, FacetFrames};
use super::{LANES, rgb};
use crate::integrator::media::NONE;
use crate::integrator::path::PathTracer;
use crate::integrator::path::guiding::{GuidedVertex, GuidingField, pdf_of_both};
use crate::integrator::path::light_tree::Receiver;
use crate::integrator::path::source_points::SourcePoints;
use crate::material::{
    BaseNumbers, BsdfSample, ConductorPoint, GlossyLobes, GlossyPoint, Lobe, LobeDirections, MetalFacets, OpaqueBase,
    OpaqueBaseLobes, diffuse_direction, diffuse_pdf, diffuse_share,
};
use crate::math::Vector;
use crate::shape::{DVec3x8, Vec3x8, dvec3, set_bits, set_dvec3};
use canaletto_bvh::lanes::{LaneKernel, Mask, Real64, run_lanes};
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

    /// What the vertices send on of the light of sampled sources, and the directions that their random numbers choose.
    fn scatter(&self, points: &SourcePoints) -> (Evaluated8, Sampled8);

    /// The bodies that a ray is in after it leaves a vertex: [`PathTracer::inside_after`].
    fn inside_after(&self, tracer: &mut PathTracer, lane: usize, wi: DVec3) -> Option<[u32; 2]>;

    /// Whether a direction leads through the surface: [`SurfaceVertex::goes_through`].
    ///
    /// [`SurfaceVertex::goes_through`]: crate::integrator::path::vertex::SurfaceVertex::goes_through
    fn goes_through(&self, lane: usize, sample: &BsdfSample) -> Option<bool>;
}

/// The lobes of eight opaque surfaces.
pub(super) trait Lobes8 {
    /// The lobes in lanes, as their viewers see them.
    type Seen<F: Real64>: SeenLobes<F>;

    /// The lobes of directions that facets mirror to, and of others.
    const MIRRORED: Lobe = Lobe::Mirror;
    const NOT_MIRRORED: Lobe = Lobe::Diffuse;

    /// Whether a vertex scatters no light.
    fn is_black(&self, lane: usize) -> bool;

    /// [`Scattering8::receiver`]
    fn receiver(&self, arrived: &Arrived, lane: usize) -> Receiver {
        arrived.receiver(lane)
    }

    /// [`Scattering8::inside_after`]
    #[inline(always)]
    fn inside_after(&self, _: &mut PathTracer, _: usize, _: DVec3) -> Option<[u32; 2]> {
        Some([NONE; 2])
    }

    /// The lobes in lanes. It has to be `#[inline(always)]`.
    fn seen<F: Real64>(&self) -> Self::Seen<F>;
}

/// Lobes in lanes. The functions have to be `#[inline(always)]`.
pub(super) trait SeenLobes<F: Real64> {
    /// [`Bsdf::eval`](crate::material::Bsdf::eval) and [`Bsdf::pdf`](crate::material::Bsdf::pdf) of directions.
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F);

    /// [`Bsdf::eval`](crate::material::Bsdf::eval) for the light of point lights, where that is another.
    #[inline(always)]
    fn eval_point_lights(&self, _: Vector<F>) -> Option<Vector<F::Narrow>> {
        None
    }

    /// The directions that the numbers choose: `u_lobe` of [0, 1) the lobe, and `u` of the unit square the direction
    /// within it.
    fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F>;
}

/// Evaluates the directions of sources, and samples directions.
struct Scatter<'a, L> {
    lobes: &'a L,
    to_sources: &'a DVec3x8,
    /// A bit for each source that is a point light.
    point_lights: u32,
    u_lobe: &'a [f64; LANES],
    u: &'a [[f64; LANES]; 2],
    /// The directions of guiding fields, and a bit for each vertex that takes one.
    guided: &'a DVec3x8,
    chosen: u32,
}

/// What eight lobes send to sources, and the directions that they choose.
struct Scattered {
    towards_sources: Evaluated8,
    sampled: Evaluated8,
    wi: DVec3x8,
    /// A bit for each lobe that has chosen a direction, and for each that mirrors to it.
    valid: u32,
    mirrored: u32,
}

impl<L: Lobes8> LaneKernel for Scatter<'_, L> {
    type Answer = Scattered;

    #[inline(always)]
    fn run<F: Real64>(self) -> Scattered {
        let lobes = self.lobes.seen::<F>();
        let mut scattered = Scattered {
            towards_sources: Evaluated8::NONE,
            sampled: Evaluated8::NONE,
            wi: [[0.0; LANES]; 3],
            valid: 0,
            mirrored: 0,
        };
        let to_sources = Vector::load(self.to_sources);
        let (mut f, pdf) = lobes.eval_and_pdf(to_sources);
        if self.point_lights != 0
            && let Some(of_points) = lobes.eval_point_lights(to_sources)
        {
            f = Vector::select(F::Mask::from_bits(self.point_lights), of_points, f);
        }
        f.store(&mut scattered.towards_sources.f);
        pdf.store(&mut scattered.towards_sources.pdf);
        let [u, v] = self.u;
        let LobeDirections { wi, is_valid, is_mirrored } =
            lobes.directions(F::load(self.u_lobe), [F::load(u), F::load(v)]);
        let chosen = F::Mask::from_bits(self.chosen);
        let wi = Vector::select(chosen, Vector::load(self.guided), wi);
        wi.store(&mut scattered.wi);
        let (f, pdf) = lobes.eval_and_pdf(wi);
        f.store(&mut scattered.sampled.f);
        pdf.store(&mut scattered.sampled.pdf);
        // A surface's own direction that it doesn't scatter to has no density.
        scattered.valid = (is_valid & F::splat(0.0).less(pdf) | chosen).bits();
        scattered.mirrored = (is_mirrored & !chosen).bits();
        scattered
    }
}

/// Eight vertices, and where light comes from there as far as that was learnt.
pub(super) struct LaneVertices<'a, L> {
    pub(super) lobes: L,
    pub(super) arrived: &'a Arrived,
    pub(super) len: usize,
    pub(super) guides: Option<Box<[Option<GuidedVertex>; LANES]>>,
}

impl<'a, L: Lobes8> LaneVertices<'a, L> {
    fn new(lobes: L, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> LaneVertices<'a, L> {
        let guide = |field: &GuidingField, lane: usize| {
            let receiver = arrived.receiver(lane);
            let is_lit = lane < len && !lobes.is_black(lane);
            is_lit.then(|| field.at(receiver.point, Some(receiver.normal))).flatten()
        };
        let guides = field.map(|field| Box::new(std::array::from_fn(|lane| guide(field, lane))));
        LaneVertices { lobes, arrived, len, guides }
    }

    /// The guides of the vertices that have one.
    fn guides(&self) -> impl Iterator<Item = (usize, &GuidedVertex)> {
        let guides = self.guides.iter().flat_map(|guides| guides.iter().enumerate());
        guides.filter_map(|(lane, guide)| Some((lane, guide.as_ref()?)))
    }
}

impl<L: Lobes8> Scattering8 for LaneVertices<'_, L> {
    fn receiver(&self, lane: usize) -> Receiver {
        self.lobes.receiver(self.arrived, lane)
    }

    fn lit(&self) -> u32 {
        (0..self.len).map(|lane| u32::from(!self.lobes.is_black(lane)) << lane).sum()
    }

    fn scatter(&self, points: &SourcePoints) -> (Evaluated8, Sampled8) {
        let Arrived { u_direction: [u, v], .. } = self.arrived;
        let (mut guided, mut chosen, mut u_lobe) = ([[0.0; LANES]; 3], 0, self.arrived.u_lobe);
        for (lane, guide) in self.guides() {
            if u_lobe[lane] < guide.probability {
                set_dvec3(&mut guided, lane, guide.sample([u[lane], v[lane]]));
                chosen |= 1 << lane;
            } else {
                u_lobe[lane] = guide.u_of_surface(u_lobe[lane]);
            }
        }
        let Scattered { mut towards_sources, mut sampled, wi, valid, mirrored } = run_lanes(Scatter {
            lobes: &self.lobes,
            to_sources: &points.wi,
            point_lights: points.point_lights,
            u_lobe: &u_lobe,
            u: &self.arrived.u_direction,
            guided: &guided,
            chosen,
        });
        let mut gain = [1.0; LANES];
        for (lane, guide) in self.guides() {
            let pdf = guide.pdf(dvec3(&points.wi, lane));
            towards_sources.pdf[lane] = pdf_of_both(guide.probability, pdf, towards_sources.pdf[lane]);
            let own = sampled.pdf[lane];
            sampled.pdf[lane] = pdf_of_both(guide.probability, guide.pdf(dvec3(&wi, lane)), own);
            gain[lane] = (sampled.pdf[lane] / own) as f32;
        }
        let mut lobes = [L::NOT_MIRRORED; LANES];
        set_bits(chosen).for_each(|lane| lobes[lane] = Lobe::Diffuse);
        set_bits(mirrored).for_each(|lane| lobes[lane] = L::MIRRORED);
        let Evaluated8 { f, pdf } = sampled;
        let valid = valid & ((1 << self.len) - 1);
        (towards_sources, Sampled8 { wi, f, pdf, guided: gain, lobes, valid, delta: 0 })
    }

    #[inline(always)]
    fn inside_after(&self, tracer: &mut PathTracer, lane: usize, wi: DVec3) -> Option<[u32; 2]> {
        self.lobes.inside_after(tracer, lane, wi)
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

/// Diffuse lobes in lanes.
pub(super) struct SeenDiffuse<F: Real64> {
    kd: Vector<F::Narrow>,
    normal: Vector<F>,
    facing: Vector<F>,
}

impl Materials8 for Diffuse {
    type Vertices<'a> = LaneVertices<'a, DiffuseLobes<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        LaneVertices::new(DiffuseLobes { kd: &self.kd, arrived }, arrived, field, len)
    }
}

impl Lobes8 for DiffuseLobes<'_> {
    type Seen<F: Real64> = SeenDiffuse<F>;

    fn is_black(&self, lane: usize) -> bool {
        rgb(self.kd, lane).is_black()
    }

    #[inline(always)]
    fn seen<F: Real64>(&self) -> SeenDiffuse<F> {
        let Arrived { normal, facing, .. } = self.arrived;
        SeenDiffuse { kd: Vector::load(self.kd), normal: Vector::load(normal), facing: Vector::load(facing) }
    }
}

impl<F: Real64> SeenLobes<F> for SeenDiffuse<F> {
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        (self.kd * diffuse_share(self.normal, self.facing, wi), diffuse_pdf(self.normal, wi))
    }

    #[inline(always)]
    fn directions(&self, _: F, u: [F; 2]) -> LobeDirections<F> {
        let wi = diffuse_direction(self.normal, u);
        LobeDirections { wi, is_valid: F::Mask::splat(true), is_mirrored: F::Mask::splat(false) }
    }
}

/// Eight opaque surfaces of Phong's model with highlights and without mirrors.
#[derive(Default)]
pub(in super::super) struct Glossy {
    pub(super) points: [GlossyPoint; LANES],
}

/// Eight vertices of such surfaces.
pub(super) struct GlossyVertices<'a> {
    points: &'a [GlossyPoint; LANES],
    arrived: &'a Arrived,
}

impl Materials8 for Glossy {
    const HAS_LOBES: bool = true;

    type Vertices<'a> = LaneVertices<'a, GlossyVertices<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        LaneVertices::new(GlossyVertices { points: &self.points, arrived }, arrived, field, len)
    }
}

impl Lobes8 for GlossyVertices<'_> {
    type Seen<F: Real64> = GlossyLobes<F>;

    const MIRRORED: Lobe = Lobe::Highlight;

    fn is_black(&self, lane: usize) -> bool {
        self.points[lane].is_black()
    }

    #[inline(always)]
    fn seen<F: Real64>(&self) -> GlossyLobes<F> {
        let Arrived { wo, normal, facing, .. } = self.arrived;
        let (normal, facing, wo) = (Vector::load(normal), Vector::load(facing), Vector::load(wo));
        GlossyLobes::gather(|lane| &self.points[lane], normal, facing, wo)
    }
}

impl<F: Real64> SeenLobes<F> for GlossyLobes<F> {
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        self.eval_and_pdf(wi)
    }

    #[inline(always)]
    fn eval_point_lights(&self, wi: Vector<F>) -> Option<Vector<F::Narrow>> {
        Some(self.eval_point_lights(wi))
    }

    #[inline(always)]
    fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        self.directions(u_lobe, u)
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
    type Vertices<'a> = LaneVertices<'a, MetalLobes<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        LaneVertices::new(MetalLobes { points: &self.points, arrived }, arrived, field, len)
    }
}

impl Lobes8 for MetalLobes<'_> {
    type Seen<F: Real64> = MetalFacets<F>;

    fn is_black(&self, _: usize) -> bool {
        false
    }

    #[inline(always)]
    fn seen<F: Real64>(&self) -> MetalFacets<F> {
        let FacetFrames { axes, facing, wo } = self.arrived.facet_frames();
        MetalFacets::gather(|lane| &self.points[lane], facing, axes, wo)
    }
}

impl<F: Real64> SeenLobes<F> for MetalFacets<F> {
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        self.eval_and_pdf(wi)
    }

    #[inline(always)]
    fn directions(&self, _: F, u: [F; 2]) -> LobeDirections<F> {
        let wi = self.direction(u);
        LobeDirections { wi, is_valid: F::Mask::splat(true), is_mirrored: F::Mask::splat(true) }
    }
}

/// Eight standard surfaces that are an opaque base alone.
#[derive(Default)]
pub(in super::super) struct OpaqueBases {
    pub(super) points: [OpaqueBase; LANES],
}

/// Eight vertices of such surfaces.
pub(super) struct OpaqueBaseVertices<'a> {
    points: &'a [OpaqueBase; LANES],
    arrived: &'a Arrived,
    len: usize,
}

impl Materials8 for OpaqueBases {
    const HAS_LOBES: bool = true;

    type Vertices<'a> = LaneVertices<'a, OpaqueBaseVertices<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, field: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        LaneVertices::new(OpaqueBaseVertices { points: &self.points, arrived, len }, arrived, field, len)
    }
}

impl Lobes8 for OpaqueBaseVertices<'_> {
    type Seen<F: Real64> = OpaqueBaseLobes<F>;

    fn is_black(&self, _: usize) -> bool {
        false
    }

    #[inline(always)]
    fn seen<F: Real64>(&self) -> OpaqueBaseLobes<F> {
        let FacetFrames { axes, facing, wo } = self.arrived.facet_frames();
        let numbers = BaseNumbers::gather(|lane| &self.points[lane]);
        OpaqueBaseLobes::new(numbers, (1 << self.len) - 1, (axes, facing), wo)
    }
}

impl<F: Real64> SeenLobes<F> for OpaqueBaseLobes<F> {
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        self.eval_and_pdf(wi)
    }

    #[inline(always)]
    fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        self.directions(u_lobe, u)
    }
}
