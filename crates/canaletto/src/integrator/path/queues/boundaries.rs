//! Vertices of rough boundaries of clear bodies.

use super::SurfaceVertices;
use super::kernels::Arrived;
use super::scattering::{LaneVertices, Lobes8, Materials8, SeenLobes};
use crate::integrator::path::PathTracer;
use crate::integrator::path::guiding::GuidingField;
use crate::integrator::path::light_tree::Receiver;
use crate::integrator::path::vertex::{SurfaceVertex, Vertex};
use crate::material::{Lobe, LobeDirections, RoughBoundaries, SeenDielectric};
use crate::math::Vector;
use canaletto_bvh::lanes::Real64;
use glam::DVec3;

/// Up to eight vertices.
#[derive(Default)]
pub(in super::super) struct Boundaries(Vec<SurfaceVertex>);

impl SurfaceVertices for Boundaries {
    fn push(&mut self, vertex: SurfaceVertex) {
        self.0.push(vertex);
    }
}

/// The vertices.
pub(super) struct BoundaryLobes<'a> {
    vertices: &'a [SurfaceVertex],
}

impl Materials8 for Boundaries {
    const HAS_LOBES: bool = true;

    type Vertices<'a> = LaneVertices<'a, BoundaryLobes<'a>>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, _: Option<&GuidingField>, len: usize) -> Self::Vertices<'a> {
        let is_guided = self.0.iter().any(|vertex| vertex.guide.is_some());
        let guide = |lane: usize| self.0.get(lane).and_then(|vertex| vertex.guide.clone());
        let guides = is_guided.then(|| Box::new(std::array::from_fn(guide)));
        LaneVertices { lobes: BoundaryLobes { vertices: &self.0 }, arrived, len, guides }
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

impl BoundaryLobes<'_> {
    fn boundary(&self, lane: usize) -> &SeenDielectric {
        let boundary = self.vertices.get(lane).unwrap_or(&self.vertices[0]).bsdf.rough_boundary();
        boundary.expect("the queue takes no others")
    }
}

impl Lobes8 for BoundaryLobes<'_> {
    type Seen<F: Real64> = RoughBoundaries<F>;

    const NOT_MIRRORED: Lobe = Lobe::Refraction;

    fn is_black(&self, _: usize) -> bool {
        false
    }

    fn receiver(&self, _: &Arrived, lane: usize) -> Receiver {
        self.vertices.get(lane).map_or(Receiver::in_medium(DVec3::ZERO), |vertex| Vertex::Surface(vertex).receiver())
    }

    fn inside_after(&self, tracer: &mut PathTracer, lane: usize, wi: DVec3) -> Option<[u32; 2]> {
        tracer.inside_after(&Vertex::Surface(&self.vertices[lane]), wi)
    }

    #[inline(always)]
    fn seen<F: Real64>(&self) -> RoughBoundaries<F> {
        RoughBoundaries::gather(|lane| self.boundary(lane), (1 << self.vertices.len()) - 1)
    }
}

impl<F: Real64> SeenLobes<F> for RoughBoundaries<F> {
    #[inline(always)]
    fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let (f, pdf) = self.eval_and_pdf(wi);
        (Vector { x: f, y: f, z: f }, pdf)
    }

    #[inline(always)]
    fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        self.directions(u_lobe, u)
    }
}
