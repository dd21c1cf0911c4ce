//! Our side of the comparison: everything that uses the hierarchy's interface is in this file.

use canaletto_bvh::{Nearest, Quality, Ray, Triangles};

use super::mesh::Mesh;
use super::rays::{Packet, Segment};
use super::trace::{Hits, Tracer};

/// A mesh in our hierarchy.
pub struct Ours {
    triangles: Triangles,
}

impl Ours {
    /// Builds it, on the current pool of threads.
    pub fn build(mesh: &Mesh, quality: Quality) -> Result<Self, String> {
        let triangles = Triangles::build_with(quality, mesh.triangles.len(), |id| mesh.corners(id as usize))
            .map_err(|e| e.to_string())?;
        Ok(Self { triangles })
    }

    /// Nodes and primitives that a random ray is expected to visit.
    pub fn expected_visits(&self) -> f64 {
        self.triangles.statistics().sah_cost
    }

    /// Memory of all that tracing needs.
    pub fn bytes(&self) -> usize {
        self.triangles.statistics().bytes
    }
}

/// How many rays are asked about at a time.
const CHUNK: usize = 1024;

impl Tracer for Ours {
    fn closest(&self, rays: &[Segment], _packets: &[Packet], coherent: bool, out: &mut Hits<'_>) {
        let (mut chunk_rays, mut nearest) = (Vec::with_capacity(CHUNK), Vec::with_capacity(CHUNK));
        for (chunk, rays) in rays.chunks(CHUNK).enumerate() {
            nearest.clear();
            nearest.extend(rays.iter().map(|ray| Nearest::before(ray.t_max)));
            chunk_rays.clear();
            chunk_rays.extend(rays.iter().map(ray));
            if coherent {
                self.triangles.intersect_coherent(&chunk_rays, &mut nearest, false);
            } else {
                self.triangles.intersect_stream(&chunk_rays, &mut nearest, false);
            }
            for (i, hit) in nearest.iter().enumerate() {
                let i = chunk * CHUNK + i;
                (out.t[i], out.id[i], out.u[i], out.v[i]) = (hit.t, hit.id, hit.u, hit.v);
            }
        }
    }

    fn any(&self, rays: &[Segment], _packets: &[Packet], coherent: bool, out: &mut [u8]) {
        let (mut chunk_rays, mut t_max) = (Vec::with_capacity(CHUNK), Vec::with_capacity(CHUNK));
        for (rays, out) in rays.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            t_max.clear();
            t_max.extend(rays.iter().map(|ray| ray.t_max));
            chunk_rays.clear();
            chunk_rays.extend(rays.iter().map(ray));
            if coherent {
                self.triangles.occluded_coherent(&chunk_rays, &mut t_max, false);
            } else {
                self.triangles.occluded_stream(&chunk_rays, &mut t_max, false);
            }
            for (out, t) in out.iter_mut().zip(&t_max) {
                *out = u8::from(*t == f32::NEG_INFINITY);
            }
        }
    }
}

fn ray(segment: &Segment) -> Ray {
    Ray::new(segment.origin, segment.direction)
}
