//! Vertices of any kind of surface, whose scattering is evaluated one by one.

use super::SurfaceVertices;
use super::kernels::Arrived;
use super::scattering::{Evaluated8, Materials8, Sampled8, Scattering8};
use crate::integrator::path::PathTracer;
use crate::integrator::path::guiding::GuidingField;
use crate::integrator::path::light_tree::Receiver;
use crate::integrator::path::source_points::SourcePoints;
use crate::integrator::path::vertex::{SurfaceVertex, Vertex};
use crate::material::BsdfSample;
use crate::shape::{dvec3, set_bits, set_dvec3, set_vec3};
use glam::DVec3;

/// Up to eight vertices.
#[derive(Default)]
pub(in super::super) struct AnySurfaces(Vec<SurfaceVertex>);

impl SurfaceVertices for AnySurfaces {
    fn push(&mut self, vertex: SurfaceVertex) {
        self.0.push(vertex);
    }
}

/// The vertices, with their random numbers.
pub(super) struct AnyVertices<'a> {
    vertices: &'a [SurfaceVertex],
    arrived: &'a Arrived,
}

impl Materials8 for AnySurfaces {
    const HAS_LOBES: bool = true;

    type Vertices<'a> = AnyVertices<'a>;

    fn vertices<'a>(&'a self, arrived: &'a Arrived, _: Option<&GuidingField>, _: usize) -> AnyVertices<'a> {
        AnyVertices { vertices: &self.0, arrived }
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

impl Scattering8 for AnyVertices<'_> {
    fn receiver(&self, lane: usize) -> Receiver {
        self.vertices.get(lane).map_or(Receiver::in_medium(DVec3::ZERO), |vertex| Vertex::Surface(vertex).receiver())
    }

    fn lit(&self) -> u32 {
        (0..).zip(self.vertices).map(|(lane, vertex)| u32::from(!vertex.is_delta) << lane).sum()
    }

    fn scatter(&self, points: &SourcePoints) -> (Evaluated8, Sampled8) {
        let (mut evaluated, mut sampled) = (Evaluated8::NONE, Sampled8::NONE);
        for lane in set_bits(points.lit) {
            let (vertex, wi) = (&self.vertices[lane], dvec3(&points.wi, lane));
            let is_set = |bits: u32| bits >> lane & 1 == 1;
            let (f, pdf) = vertex.towards_source(wi, is_set(points.point_lights), is_set(points.found));
            set_vec3(&mut evaluated.f, lane, f.to_array().into());
            evaluated.pdf[lane] = pdf.unwrap_or(1.0);
        }
        let [u, v] = &self.arrived.u_direction;
        for (lane, vertex) in self.vertices.iter().enumerate() {
            let Some((sample, guiding)) = vertex.sample(self.arrived.u_lobe[lane], [u[lane], v[lane]]) else {
                continue;
            };
            set_dvec3(&mut sampled.wi, lane, sample.wi);
            set_vec3(&mut sampled.f, lane, sample.f.to_array().into());
            sampled.pdf[lane] = sample.pdf;
            sampled.guided[lane] = guiding.map_or(1.0, |guiding| (sample.pdf / guiding.pdf_scattering) as f32);
            sampled.valid |= 1 << lane;
            sampled.delta |= u32::from(sample.is_delta) << lane;
            sampled.lobes[lane] = sample.lobe;
        }
        (evaluated, sampled)
    }

    fn inside_after(&self, tracer: &mut PathTracer, lane: usize, wi: DVec3) -> Option<[u32; 2]> {
        tracer.inside_after(&Vertex::Surface(&self.vertices[lane]), wi)
    }

    fn goes_through(&self, lane: usize, sample: &BsdfSample) -> Option<bool> {
        self.vertices[lane].goes_through(sample)
    }
}
