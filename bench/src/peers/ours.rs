//! Canaletto's side of the comparison. Only this file uses the interface of its triangle hierarchy.

use canaletto_bvh::{PrimitiveHit, Quality, TriangleBvh};

use super::mesh::Mesh;
use super::rays::Run;
use super::trace::{Hits, Tracer};

/// A mesh in Canaletto's hierarchy.
pub struct Ours {
    triangles: TriangleBvh,
}

impl Ours {
    /// Builds the hierarchy on the current thread pool.
    pub fn build(mesh: &Mesh, quality: Quality) -> Result<Self, String> {
        let triangles = TriangleBvh::build_with(quality, mesh.triangles.len(), |id| mesh.corners(id as usize))
            .map_err(|e| e.to_string())?;
        Ok(Self { triangles })
    }

    /// The expected number of nodes and primitives that a random ray visits.
    pub fn expected_visits(&self) -> f64 {
        self.triangles.statistics().sah_cost
    }

    /// The bytes of all data that tracing needs.
    pub fn bytes(&self) -> usize {
        self.triangles.statistics().bytes
    }
}

/// The number of rays in a query.
const CHUNK: usize = 1024;

impl Tracer for Ours {
    fn closest(&self, Run { own, t_max, coherent, .. }: Run<'_>, out: &mut Hits<'_>) {
        let mut nearest = [PrimitiveHit::none(0.0); CHUNK];
        for ((number, own), t_max) in own.chunks(CHUNK).enumerate().zip(t_max.chunks(CHUNK)) {
            let nearest = &mut nearest[..own.len()];
            for (nearest, t_max) in nearest.iter_mut().zip(t_max) {
                *nearest = PrimitiveHit::none(*t_max);
            }
            if coherent {
                self.triangles.intersect_coherent(own, nearest, false);
            } else {
                self.triangles.intersect_stream(own, nearest, false);
            }
            let place = number * CHUNK..number * CHUNK + nearest.len();
            let (t, u) = (&mut out.t[place.clone()], &mut out.u[place.clone()]);
            let (v, id) = (&mut out.v[place.clone()], &mut out.id[place]);
            for ((((hit, t), u), v), id) in nearest.iter().zip(t).zip(u).zip(v).zip(id) {
                (*t, *u, *v, *id) = (hit.t, hit.uv[0], hit.uv[1], hit.id);
            }
        }
    }

    fn any(&self, Run { own, t_max, coherent, .. }: Run<'_>, out: &mut [u8]) {
        let mut ends = [0.0; CHUNK];
        for ((own, t_max), out) in own.chunks(CHUNK).zip(t_max.chunks(CHUNK)).zip(out.chunks_mut(CHUNK)) {
            let ends = &mut ends[..own.len()];
            ends.copy_from_slice(t_max);
            if coherent {
                self.triangles.occluded_coherent(own, ends, false);
            } else {
                self.triangles.occluded_stream(own, ends, false);
            }
            for (out, t) in out.iter_mut().zip(ends) {
                *out = u8::from(*t == f32::NEG_INFINITY);
            }
        }
    }
}
